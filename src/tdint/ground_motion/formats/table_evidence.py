"""Evidence for the layout of a table of numbers: rows of successive samples, or columns.

If a table has no times and no stated number of samples, the continuity of the values may decide.
In rows of successive samples, the step from the end of a row to the start of the next is as large
as the steps within a row and in the same direction, neighbors are closer to each other than numbers
in successive rows, and all columns have the same scale. The limits were measured on 8316 tables
from 90 public motions: rows of 2 to 10 samples, and columns with the components of a motion, the
floors of a building, suites, and identical, scaled and delayed motions. Two numbers per row are
never decided, because two columns at a distance of half a step cannot be distinguished from rows.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.choice import TextLayout
from tdint.ground_motion.formats.header_statements import MAX_STEP, MIN_COUNT, MIN_STEP
from tdint.ground_motion.formats.table_lines import NumberBlock, Numbers
from tdint.ground_motion.missing import IncompleteRecord, Missing
from tdint.number_parsing import pluralize

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


def continuity(table: NDArray[np.float64]) -> tuple[str, str]:
    """Return the layout of a table by its continuity, `rows`, `columns`, or an empty text if the
    continuity does not decide, and the ratios for a message; empty if the table is too small.

    A motion with a period of one row also has small steps between rows. It is distinguished from
    separate motions by the steps at row ends and by the equal scale of its columns.

    Parameters
    ----------
    table : ndarray, shape (rows, columns)
        Complete rows.
    """
    rows, width = table.shape
    if width < _MIN_WIDTH or rows < _MIN_ROWS:
        return "", ""
    within = np.diff(table, axis=1)
    row_ends = table[1:, 0] - table[:-1, -1]
    neighbors = _ratio_of_means(np.concatenate((within.ravel(), row_ends)), np.diff(table, axis=0))
    ratios = (
        f"the mean step at line ends is {_ratio_of_means(row_ends, within):.2f} of the step within "
        f"lines, the step between neighbors {neighbors:.2f} of the step between lines"
    )
    rms = np.sqrt(np.mean(table**2, axis=0))
    column_steps = np.mean(np.abs(within), axis=0)
    scatter = 1.0 / sqrt(rows)
    has_equal_columns = _ratio(np.max(rms), np.min(rms)) < max(
        _MAX_SCALE_RATIO, 1.0 + _SCALE_SCATTER * scatter
    ) and _ratio(np.max(column_steps), np.min(column_steps)) < max(
        _MAX_SPREAD, 1.0 + _SPREAD_SCATTER * scatter
    )
    is_even = _are_equal(row_ends, within, _STEP_AT_ROW_ENDS, _STEP_AT_ROW_ENDS_OF_SHORT_TABLE)
    if is_even and neighbors < _MAX_NEIGHBOR_RATIO:
        # Changes of the step at row ends and within rows
        bends = np.concatenate((row_ends - within[:-1, -1], within[1:, 0] - row_ends))
        is_smooth = _are_equal(
            bends, np.diff(within, axis=1), _BEND_AT_ROW_ENDS, _BEND_AT_ROW_ENDS_OF_SHORT_TABLE
        )
        return "rows" if has_equal_columns and is_smooth else "", ratios
    min_ratio = _MIN_RATIO_OF_EVEN_COLUMNS if is_even else _MIN_COLUMN_RATIO
    return "columns" if neighbors > min_ratio and not has_equal_columns else "", ratios


def _are_equal(
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    limits: tuple[float, float],
    wide_limits: tuple[float, float],
) -> bool:
    """Return True if the ratio of the mean absolute values of two arrays is within the limits; the
    wide limits apply if the difference may be random."""
    sizes, others = np.abs(first), np.abs(second)
    error = sqrt(np.var(sizes) / sizes.size + np.var(others) / others.size)
    is_random = abs(_ratio(np.mean(sizes) - np.mean(others), error)) < _MAX_STANDARD_ERRORS
    low, high = wide_limits if is_random else limits
    return low < _ratio_of_means(first, second) < high


def _ratio_of_means(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Return the ratio of the mean absolute values of two arrays."""
    return _ratio(np.mean(np.abs(first)), np.mean(np.abs(second)))


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


_MAX_FIRST_LINES = 4  # lines at the start of a block that may contain statements
_SHORTEST_STEP, _LONGEST_STEP = 1e-4, 0.1
"""Sampling intervals, s, that are recognized without a number of samples next to them."""

_MAX_STEP_DIGITS = 4  # significant digits of a sampling interval; most samples have more
_JUMP = 5.0
"""Minimum ratio of the change from a first number to the next number to the changes of the samples,
if the first number is not a sample."""

_MIN_DIGITS_EXCESS = 3
"""Minimum number of significant digits that the samples have in addition to those of a first number
that is no sample; one of a thousand samples ends with three zeros."""

_JUMP_SAMPLES = 12  # samples that are compared with the first number
_WHOLE = re.compile(r"\+?\d{1,12}(?:\.0*)?")
_WITHOUT_POINT = re.compile(r"[-+]?\d+")
_FIXED = re.compile(r"[-+]?\d*\.\d*")  # number with a decimal point and without exponent


@dataclass(frozen=True)
class FirstNumbers:
    """Statements in the first lines of a block of numbers.

    Attributes
    ----------
    count : int
        Number of samples; 0 if it is not stated.
    interval : float
        Sampling interval, s; 0 if it is not stated.
    lines : int
        Number of lines with these numbers; 0 if all lines contain samples.
    note : str
        Note for the user if no number of samples confirms that the lines are not samples.
    """

    count: int = 0
    interval: float = 0.0
    lines: int = 0
    note: str = ""


def first_numbers(block: NumberBlock, numbers: Numbers, layout: TextLayout) -> FirstNumbers:
    """Return the statements in the first lines of a block.

    One rule applies to numbers in successive lines and to several numbers in a line:

    1. a number that is equal to the number of the remaining lines or values is the number of
       samples, and another number from 1e-5 to 1 is the sampling interval;
    2. a whole number and a plausible sampling interval are no samples: the whole number is a flag
       if it is below 20, otherwise it contradicts the number of samples;
    3. a first number of a column is the sampling interval if it is equal to the specified interval,
       or if it is a plausible interval and does not continue the samples.

    A number of samples without an interval counts only above a single column, because tables of
    nodes also start with a number. `skip_lines=0` states that the values of rules 2 and 3 are
    samples.

    Raises
    ------
    RecordError
        A number of samples does not agree with the block, or the first number may be a sample or
        the sampling interval.
    """
    words, number = block.first_words, block.line_numbers[0]
    values, widths = numbers.values, numbers.widths
    lines = len(widths)
    if lines < _MIN_TIMES:
        return FirstNumbers()
    width = int(np.bincount(widths).argmax())
    if width == widths[0] and is_index_row(words):
        return FirstNumbers(lines=1, note=f"line {number}, the numbers of the columns, is not read")
    unconfirmed = None
    for used in range(1, min(_MAX_FIRST_LINES, lines - 2) + 1):
        is_other = bool(np.all(widths[:used] != width))
        if not (is_other or width == 1 or used == 1):
            break
        texts = [word for row in words[:used] for word in row]
        if len(texts) != int(np.sum(widths[:used])):  # numbers without separators
            break
        first = values[: len(texts)].tolist()
        whole = [n for t, n in zip(texts, first, strict=True) if _WHOLE.fullmatch(t)]
        steps = [
            n
            for t, n in zip(texts, first, strict=True)
            if not _WITHOUT_POINT.fullmatch(t) and MIN_STEP <= n <= MAX_STEP
        ]
        if not is_other and width == 1 and len(whole) + len(steps) < len(texts):
            break
        steps.sort(key=_is_plausible, reverse=True)  # a flag may be printed as 1.0
        samples = values[len(texts) :]
        remaining = (lines - used, samples.size)
        count = next(
            (n for n in whole if (n >= 1.0 and n in remaining) or is_filled(samples, n, width)),
            0.0,
        )
        if count and steps:
            return FirstNumbers(int(count), steps[0], used)
        is_header = len(set(filter(_is_plausible, steps))) == 1 and bool(whole)
        # Without the first line, the first column may contain times.
        is_timed = width > 1 and are_times(samples[::width]) and not are_times(values[::width])
        if unconfirmed is None and is_header and (is_other or width == 1 or is_timed):
            unconfirmed = used, whole, steps[0]
    if width == 1 and values[0] == lines - 1:
        return FirstNumbers(lines - 1, 0.0, 1)
    if unconfirmed is not None:
        used, whole, interval = unconfirmed
        remaining = (lines - used, values.size - sum(map(len, words[:used])))
        has_flag = any(whole) or layout.has_step(interval) or _has_other_form(words, used)
        if counts := [n for n in whole if n >= MIN_COUNT]:
            raise _wrong_count(words, counts[0], remaining, number)
        if has_flag and layout.skip_lines != 0:
            return FirstNumbers(0, interval, used, _first_lines_note(used, number, interval))
    if width == 1 and layout.skip_lines != 0:
        return _interval_alone(words, values, layout, number)
    return FirstNumbers()


def is_filled(values: NDArray[np.float64], count: float, width: int) -> bool:
    """Return True if only zeros, which fill the last of the rows of `width` values, follow the
    first `count` values."""
    is_in_last_row = max(values.size - width, 0) < count < values.size
    return is_in_last_row and count == int(count) and not np.any(values[int(count) :])


def _is_plausible(step: float) -> bool:
    """Return True if a number is plausible as a sampling interval without other evidence."""
    is_usual = _SHORTEST_STEP <= step <= _LONGEST_STEP
    return is_usual and _significant_digits(step) <= _MAX_STEP_DIGITS


def _significant_digits(value: float) -> int:
    """Return the number of significant digits of a printed number."""
    return len(f"{abs(value):.9e}".partition("e")[0].rstrip("0").replace(".", ""))


def _first_lines_note(used: int, number: int, interval: float) -> str:
    """Return the note that the first lines are not read as samples."""
    last = number + used - 1
    where = f"line {number} is" if used == 1 else f"lines {number} to {last} are"
    return (
        f"{where} not read as samples: the sampling interval is {interval:g} s; if these numbers "
        "are samples, specify `skip_lines=0`"
    )


def _has_other_form(words: list[list[str]], used: int) -> bool:
    """Return True if the first numbers have fewer decimals than all samples."""
    decimals = [len(word.partition(".")[2]) for row in words for word in row]
    return max(decimals[:used]) < min(decimals[used:], default=0)


def _wrong_count(
    words: list[list[str]], count: float, remaining: tuple[int, int], number: int
) -> RecordError:
    """Return the error for a number of samples that does not agree with the block."""
    lines, values = remaining
    contents = pluralize(values, "value")
    if lines != values:
        contents = f"{pluralize(lines, 'line')} and {contents}"
    return RecordError(
        f"line {number}: {' '.join(words[0])[:60]!r} is not a row of samples, and {count:.0f} is "
        f"not the number of samples: {contents} follow; complete the file, correct the number, or "
        f"skip the line by `skip_lines={number}`"
    )


def _interval_alone(
    words: list[list[str]], values: NDArray[np.float64], layout: TextLayout, number: int
) -> FirstNumbers:
    """Return the sampling interval in the first line of a column; raise IncompleteRecord if the
    number may also be a sample."""
    value, samples = float(values[0]), values[1:]
    is_specified = layout.has_step(value)
    if not (is_specified or _is_plausible(value)):
        return FirstNumbers()
    changes = np.abs(np.diff(samples[:_JUMP_SAMPLES]))
    has_jump = abs(value - float(samples[0])) > _JUMP * float(np.max(changes, initial=0.0))
    others = samples[samples != 0.0][:_JUMP_SAMPLES].tolist()
    # The median sample has more digits than an interval, which is a round number.
    more = sorted(_significant_digits(sample) - _significant_digits(value) for sample in others)
    excess = more[len(more) // 2] if more else 0
    if (has_jump and (is_specified or excess > 0)) or excess >= _MIN_DIGITS_EXCESS:
        return FirstNumbers(0, value, 1, _first_lines_note(1, number, value))
    texts = [row[0] for row in words]
    decimals = {len(text.partition(".")[2]) for text in texts[1:]}
    has_other_form = (
        len(decimals) == 1
        and len(texts[0].partition(".")[2]) not in decimals
        and all(map(_FIXED.fullmatch, texts))
    )
    if not (is_specified or has_other_form or has_jump):
        return FirstNumbers()
    reason = (
        "equals the specified sampling interval"
        if is_specified
        else "has another number of decimals than the other values"
        if has_other_form
        else "does not continue to the other values"
    )
    above = " remove the lines above it and" if number > 1 else ""
    raise IncompleteRecord(
        f"the first value, {texts[0]} in line {number}, {reason}. If it is the sampling "
        f"interval, skip it by `skip_lines={number}`; if it is a sample,{above} specify "
        "`skip_lines=0`",
        Missing(skip_lines=number, step=layout.step is None),
    )


def unexplained_first_line(block: NumberBlock, numbers: Numbers) -> None:
    """Raise RecordError if the numbers of a first line differ in form from the samples.

    In a table of numbers with decimal points, a whole number without a point is a number of
    samples or of a station, never a sample.
    """
    words, widths = block.first_words, numbers.widths
    # Each of the first two lines of a column may contain a number.
    used = 2 if len(words) > 1 and len(words[0]) == len(words[1]) == 1 else 1
    first = [word for row in words[:used] for word in row]
    whole = [word for word in first if _WITHOUT_POINT.fullmatch(word) and float(word) >= MIN_COUNT]
    samples = [word for row in words for word in row]
    if len(words[0]) > 3 or len(whole) != 1:
        return
    samples.remove(whole[0])
    if samples and all("." in word for word in samples):
        remaining = (len(widths) - 1, int(np.sum(widths[1:])))
        raise _wrong_count(words, float(whole[0]), remaining, block.line_numbers[0])


def is_index_row(words: list[list[str]]) -> bool:
    """Return True if the first row contains the numbers of the columns, counted from 0 or 1, in
    place of values."""
    first = words[0]
    if len(first) < 2 or not all(map(_WITHOUT_POINT.fullmatch, first)):
        return False
    numbers = [float(word) for word in first]
    start = numbers[0]
    is_counted = start in (0, 1) and all(n == start + i for i, n in enumerate(numbers))
    return is_counted and all("." in word for row in words[1:] for word in row[-1:])


def has_card_numbers(block: NumberBlock, numbers: Numbers) -> bool:
    """Return True if the last number of each line is the number of the line."""
    is_whole = all(_WITHOUT_POINT.fullmatch(row[-1]) for row in block.first_words)
    return is_whole and counts_rows(numbers.values[numbers.line_ends[1:] - 1])
