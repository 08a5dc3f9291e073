"""Roles of the columns of a table, and the layout of its lines, by evidence that is collected once.

Evidence about a column needs nearly all rows: a time that is repeated, or a last row with another
quantity, is an error to be named, not evidence that the column contains samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.choice import TextLayout
from tdint.ground_motion.formats.lines import last_decimal
from tdint.ground_motion.formats.table_columns import (
    NO_MOTION,
    TIME,
    ColumnName,
    quantity_of_units,
)
from tdint.ground_motion.formats.table_lines import Numbers
from tdint.ground_motion.record import has_one_sign

Names = tuple[ColumnName, ...]

MIN_TIMES = 4  # rows; fewer numbers increase by accident
_MAX_BREAKS, _MIN_STEPS = 0.02, 20
"""Maximum fraction of the steps of times that do not increase, and the minimum number of steps for
a single such step."""

_NEARLY = 0.1
"""Permitted deviation of most steps of times from their median, as a fraction."""


class Axis(NamedTuple):
    """Steps of a column that increases: times, periods, frequencies.

    Attributes
    ----------
    is_even : bool
        Most steps are nearly equal.
    breaks : int
        Number of steps that do not increase.
    """

    is_even: bool
    breaks: int = 0


def axis(column: Array) -> Axis | None:
    """Return the steps of a column that increases in nearly all rows; None for other columns."""
    for part in (column[: column.size // 16], column):  # a motion is recognized by its first part
        steps = np.diff(part)
        breaks = steps.size - int(np.count_nonzero(steps > 0.0))
        if breaks > max(_MAX_BREAKS * column.size, column.size > _MIN_STEPS):
            return None
    if not steps.size:
        return None
    if column.size < MIN_TIMES or np.ptp(steps) <= _NEARLY * np.min(steps):
        return Axis(column.size >= MIN_TIMES)  # usually, and without the sorting of the steps
    median = float(np.median(steps))
    # Half of the steps may deviate by the rounding of the printed times.
    allowed = max(_NEARLY * median, 1.01 * last_decimal(column))
    is_even = (
        np.median(np.abs(steps - median)) <= allowed
        and np.quantile(steps, 0.95) < (2.0 + _NEARLY) * median
    )
    return Axis(bool(is_even), breaks)


def are_times(column: Array) -> bool:
    """Return True if all numbers increase, mostly by nearly the same step."""
    return axis(column) == Axis(is_even=True)


def counts_rows(column: Array) -> bool:
    """Return True if a column numbers the rows: it starts with 0 or 1 and increases by 1."""
    return bool(column.size >= MIN_TIMES and column[0] in (0.0, 1.0)) and all(
        np.all(np.diff(part) == 1.0) for part in (column[:MIN_TIMES], column)
    )


def has_pairs(numbers: Numbers) -> bool:
    """Return True if each line consists of pairs of a time and a value."""
    table = numbers.table()
    width = table.shape[1]
    pairs = axis(table.reshape(-1, 2)[:, 0]) if width > 2 and not width % 2 else None
    return bool(pairs and pairs.is_even)


class Roles(NamedTuple):
    """Roles of the columns.

    Attributes
    ----------
    time : int or None
        Index of the column of times.
    ignored : frozenset of int
        Indices of the columns of text or line numbers.
    has_pairs : bool
        Each line consists of pairs of a time and a value.
    """

    time: int | None = None
    ignored: frozenset[int] = frozenset()
    has_pairs: bool = False


def column_roles(numbers: Numbers, names: Names, text: frozenset[int], layout: TextLayout) -> Roles:
    """Return the roles of the columns of a block; `text` contains the indices of columns of text.

    The column of times is the first that numbers no lines and fits the strongest of these kinds of
    evidence: it is named as a time, with a unit; it is named as a time; it has a unit of time and
    equal steps; it has equal steps and no unit of a motion; it is the first, has no name, and
    increases.
    """
    if not numbers.is_regular or len(table := numbers.table()) < 2:
        return Roles(ignored=text)
    width = table.shape[1]
    if has_pairs(numbers):
        return Roles(0, text, has_pairs=True)
    is_single = width == 1
    counted = {i for i in range(width) if not (is_single or i in text) and counts_rows(table[:, i])}
    named = {i for i, name in enumerate(names) if name.quantity == TIME and i not in text}
    if named:
        best = max(named, key=lambda i: (bool(axis(table[:, i])), bool(names[i].units), -i))
        return Roles(best, text | (counted & set(range(best))) | (named - {best}))
    others = [i for i in range(width) if i not in text | counted]
    for index in others:
        units = names[index].units if names else ""
        if quantity_of_units(units):
            continue
        found = axis(table[:, index]) or (axis(table[::-1, index]) if is_single else None)
        is_first = index == others[0] and not (names or layout.rows)
        may_be_pulse = is_single and (layout.one_sided or len(table) < _MIN_STEPS)
        if found and (found.is_even or is_first) and not may_be_pulse:
            return Roles(index, text | {i for i in counted if i < index or not names})
    return Roles(None, text | counted)


def other_columns(
    columns: list[Array], indices: list[int], names: Names, *, one_sided: bool
) -> dict[int, str]:
    """Return the reasons why columns are no ground motion: the name states another quantity, or the
    values have one sign and are the resultant of the other columns, by the name or by the values.

    `indices` are the columns except times, text and line numbers.
    """
    found = {
        i: "states a quantity that is not a ground motion"
        for i in indices
        if names and names[i].quantity == NO_MOTION
    }
    rest = [i for i in indices if i not in found]
    is_alone = one_sided or len(indices) < 2
    positive = [] if is_alone else [i for i in rest if has_one_sign(columns[i])]
    resultants = [i for i in positive if names and names[i].may_be_resultant]
    if positive and not resultants and len(rest) > 2:
        # Only the largest column can be the resultant; the last of equal columns is.
        last = max(positive, key=lambda i: (np.sum(columns[i] ** 2), i))
        root = np.sqrt(sum(columns[i] ** 2 for i in rest if i != last))
        rounding = last_decimal(columns[last]) + 1e-3 * np.max(columns[last])
        if np.max(np.abs(root - columns[last])) <= rounding:
            resultants = [last]
    return found | dict.fromkeys(resultants, "is a resultant or contains absolute values")
