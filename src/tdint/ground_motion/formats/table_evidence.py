"""Evidence for the layout of a table of numbers: rows of successive samples, or columns.

If a table has no times and no stated number of samples, the continuity of the numbers may decide.
In rows of successive samples, the step from the end of a row to the start of the next is as large
as the steps within a row and in the same direction, neighbors are closer to each other than numbers
in successive rows, and all columns have the same scale. The limits were measured on 8316 tables
from 90 public motions: rows of 2 to 10 samples, and columns with the components of a motion, the
floors of a building, suites, and identical, scaled and delayed motions. Two numbers per row are
never decided, because two columns that are half a step apart cannot be distinguished from rows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.choice import TextLayout
from tdint.ground_motion.formats.header_statements import MAX_STEP, MIN_COUNT, MIN_STEP

_MIN_WIDTH, _MIN_ROWS = 3, 20
"""Minimum number of values per row and of rows for a decision by continuity."""

_STEP_AT_ROW_ENDS = (0.8, 1.25)
_STEP_AT_ROW_ENDS_OF_SHORT_TABLE = (0.6, 1.67)
_BEND_AT_ROW_ENDS = (0.7, 1.43)
_BEND_AT_ROW_ENDS_OF_SHORT_TABLE = (0.5, 2.0)
_MAX_STANDARD_ERRORS = 2.5
"""Ratio of the mean step at row ends to the mean step within rows, and of the mean changes of the
step, in rows of samples. The wide interval applies if the difference is at most
`_MAX_STANDARD_ERRORS` standard errors."""

_MAX_NEIGHBOR_RATIO, _MIN_COLUMN_RATIO, _MIN_RATIO_OF_EVEN_COLUMNS = 0.85, 1.2, 3.0
"""Ratio of the mean step between neighbors to the mean step between rows: rows below the first
value, columns above the second value, or above the third value if the steps at row ends are as
large as the steps within rows."""

_MAX_SCALE_RATIO, _SCALE_SCATTER = 1.25, 4.0
_MAX_SPREAD, _SPREAD_SCATTER = 1.5, 6.0
"""Maximum ratio of the rms of two columns, and of the mean steps between two pairs of columns, and
the increase of both limits in a table with one row; it decreases with the root of the number of
rows."""


@dataclass(frozen=True)
class MeanRatio:
    """Ratio of two means.

    Attributes
    ----------
    standard_errors : float
        Difference of the means over its standard error.
    """

    ratio: float
    standard_errors: float

    @classmethod
    def of(cls, first: NDArray[np.float64], second: NDArray[np.float64]) -> MeanRatio:
        """Return the ratio of the mean absolute values of two arrays."""
        means = float(np.mean(np.abs(first))), float(np.mean(np.abs(second)))
        error = sqrt(np.var(np.abs(first)) / first.size + np.var(np.abs(second)) / second.size)
        return cls(_ratio(*means), _ratio(means[0] - means[1], error))

    def is_one(self, limits: tuple[float, float], wide_limits: tuple[float, float]) -> bool:
        """Return True if the ratio is within the limits; the wide limits apply if the difference
        may be random."""
        is_random = abs(self.standard_errors) < _MAX_STANDARD_ERRORS
        low, high = wide_limits if is_random else limits
        return low < self.ratio < high


@dataclass(frozen=True)
class Continuity:
    """Continuity of a table, row by row.

    Attributes
    ----------
    row_ends : MeanRatio
        Step from the end of a row to the start of the next over the step within rows.
    bends : MeanRatio
        Change of the step at row ends over the change of the step within rows.
    neighbors : float
        Mean step between neighbors over the mean step between rows.
    scale, spread : float
        Maximum over minimum rms of the columns; maximum over minimum mean step between two columns.
    """

    row_ends: MeanRatio
    bends: MeanRatio
    neighbors: float
    scale: float
    spread: float
    rows: int

    @property
    def layout(self) -> str:
        """`rows`, `columns`, or an empty text if the continuity does not decide.

        A motion with a period of one row also has small steps between rows. It is distinguished
        from separate motions by the steps at row ends and by the equal scale of its columns.
        """
        scatter = 1.0 / sqrt(self.rows)
        is_even = self.row_ends.is_one(_STEP_AT_ROW_ENDS, _STEP_AT_ROW_ENDS_OF_SHORT_TABLE)
        has_equal_columns = self.scale < max(
            _MAX_SCALE_RATIO, 1.0 + _SCALE_SCATTER * scatter
        ) and self.spread < max(_MAX_SPREAD, 1.0 + _SPREAD_SCATTER * scatter)
        if is_even and self.neighbors < _MAX_NEIGHBOR_RATIO:
            is_smooth = self.bends.is_one(_BEND_AT_ROW_ENDS, _BEND_AT_ROW_ENDS_OF_SHORT_TABLE)
            return "rows" if has_equal_columns and is_smooth else ""
        min_ratio = _MIN_RATIO_OF_EVEN_COLUMNS if is_even else _MIN_COLUMN_RATIO
        is_separate = self.neighbors > min_ratio and not has_equal_columns
        return "columns" if is_separate else ""

    def __str__(self) -> str:
        """Return the ratios for a message."""
        return (
            f"the mean step at line ends is {self.row_ends.ratio:.2f} of the step within "
            f"lines, the step between neighbors {self.neighbors:.2f} of the step between lines"
        )


def continuity(table: NDArray[np.float64]) -> Continuity | None:
    """Return the continuity of a table; None if the table is too small for a decision.

    Parameters
    ----------
    table : ndarray, shape (rows, columns)
        Complete rows.
    """
    rows, width = table.shape
    if width < _MIN_WIDTH or rows < _MIN_ROWS:
        return None
    within = np.diff(table, axis=1)
    row_ends = table[1:, 0] - table[:-1, -1]
    between_rows = np.diff(table, axis=0)
    bends = np.concatenate((row_ends - within[:-1, -1], within[1:, 0] - row_ends))
    rms = np.sqrt(np.mean(table**2, axis=0))
    column_steps = np.mean(np.abs(within), axis=0)
    neighbors = np.concatenate((within.ravel(), row_ends))
    return Continuity(
        row_ends=MeanRatio.of(row_ends, within),
        bends=MeanRatio.of(bends, np.diff(within, axis=1)),
        neighbors=MeanRatio.of(neighbors, between_rows).ratio,
        scale=_ratio(np.max(rms), np.min(rms)),
        spread=_ratio(np.max(column_steps), np.min(column_steps)),
        rows=rows,
    )


def _ratio(numerator: np.floating | float, denominator: np.floating | float) -> float:
    """Return a ratio; infinite if the denominator is zero, 1 if both are zero."""
    if denominator == 0.0:
        return 1.0 if numerator == 0.0 else inf
    return float(numerator / denominator)


_MIN_TIMES = 4  # rows; fewer numbers increase by accident
_NEARLY = 0.1
"""Permitted deviation of most steps of times from their median, as a fraction."""


def are_times(column: NDArray[np.float64]) -> bool:
    """Return True if numbers increase, most of them by nearly the same step.

    Single steps may differ: this is an error in a column of times, not evidence for samples.

    Parameters
    ----------
    column : ndarray, shape (rows,)
        First number of each row.
    """
    steps = np.diff(column)
    if column.size < _MIN_TIMES or not np.all(steps > 0.0):
        return False
    median = float(np.median(steps))
    # Half of the steps may deviate by the rounding of the printed times.
    return bool(np.quantile(np.abs(steps - median), 0.5) <= _NEARLY * median) and bool(
        np.quantile(steps, 0.95) < 2.0 * median + _NEARLY * median
    )


def paired(table: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return a table with a time and a value per row if the rows of `table` consist of such pairs;
    otherwise None.
    """
    width = table.shape[1]
    if width < 4 or width % 2:
        return None
    pairs = table.reshape(-1, 2)
    return pairs if are_times(pairs[:, 0]) else None


def counts_rows(column: NDArray[np.float64]) -> bool:
    """Return True if a column numbers the rows: it starts with 0 or 1 and increases by 1.

    Parameters
    ----------
    column : ndarray, shape (rows,)
        First number of each row.
    """
    return bool(column.size >= _MIN_TIMES and column[0] in (0.0, 1.0)) and bool(
        np.all(np.diff(column) == 1.0)
    )


_MAX_FIRST_NUMBERS = 3  # numbers in a first line: count, step and another number
_WHOLE = re.compile(r"\+?\d{1,12}")
_FIXED = re.compile(r"[-+]?\d*\.\d*")  # number with a decimal point and without exponent


@dataclass(frozen=True)
class FirstNumbers:
    """Number of samples and sampling interval in the first lines of a block of numbers.

    Attributes
    ----------
    count : int
        Number of samples; 0 if it is not stated.
    interval : float
        Sampling interval, s; 0 if it is not stated.
    lines : int
        Number of lines with these numbers; 0 if all lines contain samples.
    """

    count: int = 0
    interval: float = 0.0
    lines: int = 0


def first_numbers(
    values: NDArray[np.float64], widths: Sequence[int] | NDArray[np.int64]
) -> FirstNumbers:
    """Return the number of samples and the sampling interval in the first lines of a block.

    The number must be equal to the number of the remaining lines or values. Both numbers may be in
    one line, in any order and with a third number (start, number of periods), or in two lines.
    A number of samples without an interval counts only above a single column, because tables of
    nodes also start with a number.

    Parameters
    ----------
    values : ndarray, shape (values,)
        Values of the block in the order of the file.
    """
    lines, first_width = len(widths), int(widths[0])
    if lines < _MIN_TIMES:
        return FirstNumbers()
    used = 0
    if first_width in (2, 3):
        used = 1
    elif first_width == int(widths[1]) == 1:
        used = 2
    if used:
        numbers = float(values[0]), float(values[1])
        remaining = (lines - used, values.size - int(np.sum(widths[:used])))
        for count, interval in (numbers, numbers[::-1]):
            if count in remaining and MIN_STEP <= interval <= MAX_STEP:
                return FirstNumbers(int(count), interval, used)
    if values.size == lines and values[0] == lines - 1:
        return FirstNumbers(lines - 1, 0.0, 1)
    return FirstNumbers()


def unexplained_first_line(lines: Sequence[str]) -> str:
    """Return the first line of a block if its numbers differ in form from the samples; otherwise an
    empty text.

    In a table of numbers with decimal points, a whole number without a point is a number of
    samples or of a station, never a sample.
    """
    rows = [re.split(r"[\s,;]+", line.strip(" \t,;")) for line in lines]
    # The first two lines of a column may contain a number each.
    first = rows[0] + (rows[1] if len(rows) > 1 and len(rows[0]) == len(rows[1]) == 1 else [])
    whole = [word for word in first if _WHOLE.fullmatch(word) and int(word) >= MIN_COUNT]
    samples = [word for row in rows for word in row]
    if len(rows[0]) > _MAX_FIRST_NUMBERS or len(whole) != 1:
        return ""
    samples.remove(whole[0])
    has_points = bool(samples) and all("." in word for word in samples)
    return lines[0].strip() if has_points else ""


def check_first_value(lines: Sequence[str], number: int, layout: TextLayout) -> None:
    """Raise RecordError if the first value of a column may be its sampling interval.

    This is the case if the value is equal to the specified interval, or if all other values have
    another number of decimals.

    Parameters
    ----------
    number : int
        Number of the first of these lines, counted from 1.
    layout : TextLayout
        Description of the table by the user; `skip_lines=0` states that the value is a sample.
    """
    texts = [line.strip() for line in lines]
    if layout.skip_lines == 0 or len(texts) <= _MIN_TIMES or not _FIXED.fullmatch(texts[0]):
        return
    value = float(texts[0])
    decimals = {len(text.partition(".")[2]) for text in texts[1:]}
    has_other_form = (
        len(decimals) == 1
        and len(texts[0].partition(".")[2]) not in decimals
        and all(map(_FIXED.fullmatch, texts[1:]))
    )
    if MIN_STEP <= value <= MAX_STEP and (value == layout.step or has_other_form):
        reason = (
            "equals the specified sampling interval"
            if value == layout.step
            else "has another number of decimals than the other values"
        )
        above = " remove the lines above it and" if number > 1 else ""
        raise RecordError(
            f"the first value, {texts[0]} in line {number}, {reason}. If it is the sampling "
            f"interval, skip it by `skip_lines={number}`; if it is a sample,{above} specify "
            "`skip_lines=0`"
        )
