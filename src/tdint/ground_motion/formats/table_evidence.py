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
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from math import inf, sqrt

import numpy as np

from tdint.arrays import Array, max_absolute
from tdint.errors import RecordError
from tdint.ground_motion.choice import TextLayout
from tdint.ground_motion.formats.header_statements import MAX_STEP, MIN_COUNT, MIN_STEP
from tdint.ground_motion.formats.lines import Lines, equal_steps, row_of_numbers
from tdint.ground_motion.formats.table_lines import NumberBlock, Numbers, split_cells
from tdint.ground_motion.formats.table_roles import MIN_TIMES, are_times, counts_rows
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


def continuity(table: Array) -> tuple[str, str]:
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
    with np.errstate(over="ignore"):  # samples up to 1.8e308
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
    first: Array,
    second: Array,
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


def _ratio_of_means(first: Array, second: Array) -> float:
    """Return the ratio of the mean absolute values of two arrays."""
    return _ratio(np.mean(np.abs(first)), np.mean(np.abs(second)))


def _ratio(numerator: np.floating | float, denominator: np.floating | float) -> float:
    """Return a ratio; infinite if the denominator is zero, 1 if both are zero."""
    if denominator == 0.0:
        return 1.0 if numerator == 0.0 else inf
    return float(numerator / denominator)


_MAX_LONG_LINES = 20  # lines of a table with columns that are written as lines
_MAX_TITLE_LINES = 20  # lines above such a table
_MIN_LONG = 20  # cells of a line; shorter lines are rows


def _is_row_of_times(row: list[str]) -> bool:
    """Return True if the cells of a line after the first are times."""
    cells = [cell.strip("\"' ").replace(",", ".") for cell in row[1:]]
    with suppress(ValueError):
        times = row_of_numbers(" ".join(cells))
        return len(times) == len(cells) and are_times(np.array(times))
    return False


def transposed(lines: Lines) -> Lines | None:
    """Return the columns of a table that is written by lines, as the lines of a table; None for
    any other file.

    Such a table has a long line of times, which may start with its name, and lines of values with
    the same number of cells.
    """
    start = lines.number
    texts = lines.remaining()
    lines.back_to(start)
    if len(texts) > 5 * (_MAX_TITLE_LINES + _MAX_LONG_LINES):  # also blank lines
        return None
    filled = [index for index, text in enumerate(texts) if text.strip()]
    first = next((index for index in filled if len(texts[index]) > 2 * _MIN_LONG), len(texts))
    if not 2 <= len([i for i in filled if i >= first]) <= _MAX_LONG_LINES or (
        first > _MAX_TITLE_LINES
    ):
        return None
    rows = [split_cells(texts[index]) for index in filled if index >= first]
    if len(rows[0]) < _MIN_LONG or len(set(map(len, rows))) != 1:
        return None
    if not any(map(_is_row_of_times, rows)):
        return None
    columns = [";".join(cells) for cells in zip(*rows, strict=True)]
    return Lines("\n".join([*texts[:first], *columns, ""]))


_MAX_FIRST_LINES = 4  # lines at the start of a block that may contain statements
_SHORTEST_STEP, _LONGEST_STEP = 1e-4, 0.1
"""Sampling intervals, s, that are recognized without an adjacent number of samples."""

_MAX_STEP_DIGITS = 4  # significant digits of a sampling interval; most samples have more
_JUMP = 5.0
"""Minimum ratio of the change from a first number to the next number to the changes of the samples,
if the first number is not a sample."""

_MIN_DIGITS_EXCESS = 3
"""Minimum number of additional significant digits of the samples, compared with a first number that
is no sample; one of a thousand samples ends with three zeros."""

_JUMP_SAMPLES = 12  # samples that are compared with the first number
_EQUAL = 1e-9  # relative difference of two equal numbers that are printed in different forms
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
    """Return the statements in the first lines of a block. The first rule that applies decides:

    1. A number in the first lines is equal to the number of the remaining lines or values. All
       lines up to this remainder are a header, and a number from 1e-5 to 1 in this header is the
       sampling interval. Without times, other numbers of the header must not be printed like the
       samples, unless they are the peak: a repeated line would move the start of the samples. A
       number of samples without an interval counts only above a single column and above times,
       because tables of nodes also start with a number.
    2. A whole number and a plausible sampling interval are no samples: the whole number is a flag
       if it is below 20, otherwise it contradicts the number of samples. `skip_lines=0` states that
       these numbers are samples.

    Numbers that may be parameters or samples are examined by `doubtful_lines`.

    Raises
    ------
    RecordError
        A number of samples does not agree with the block.
    """
    words, number = block.first_words, block.line_numbers[0]
    values, widths = numbers.values, numbers.widths
    lines = len(widths)
    if lines < MIN_TIMES:
        return FirstNumbers()
    width = numbers.width if numbers.is_regular else int(np.bincount(widths).argmax())
    if width == widths[0] and is_index_row(words):
        return FirstNumbers(lines=1, note=f"line {number}, the numbers of the columns, is not read")
    unconfirmed = None
    has_times = width > 1 and are_times(values[::width])
    for used in range(1, min(_MAX_FIRST_LINES, lines - 2) + 1):
        texts = [word for row in words[:used] for word in row]
        if len(texts) != int(np.sum(widths[:used])):  # numbers without separators
            break
        first, samples = values[: len(texts)].tolist(), values[len(texts) :]
        whole = [n for n in first if n >= 0.0 and n.is_integer()]
        peak = max_absolute(samples)
        steps = [
            n
            for text, n in zip(texts, first, strict=True)
            if not _WITHOUT_POINT.fullmatch(text) and MIN_STEP <= n <= MAX_STEP and n != peak
        ]
        steps.sort(key=_is_plausible, reverse=True)  # a flag may be printed as 1.0
        # Without the first lines, the first column may contain times.
        is_timed = width > 1 and not has_times and are_times(samples[::width])
        is_other = bool(np.all(widths[:used] != width))
        count = _number_of_samples(whole, (lines - used, samples.size), samples, width)
        known = {float(count), peak, *steps}
        rows = np.split(values[: len(texts)], np.cumsum(widths[: used - 1]))
        others = [row for row, of_row in zip(words, rows, strict=False) if known.isdisjoint(of_row)]
        if count and not is_timed and any(_are_printed_like(row, words[used:]) for row in others):
            count = 0
        if count and (is_timed or is_other or width == 1 or used == 1):
            if is_timed:  # the times state the interval
                steps = [n for n in steps if _is_plausible(n)]
            if steps:  # the interval that the user specifies, otherwise the most plausible number
                return FirstNumbers(count, next(filter(layout.has_step, steps), steps[0]), used)
            if (width == 1 or is_timed) and (used == 1 or count >= MIN_COUNT):
                return FirstNumbers(count, 0.0, used)
        is_header = len(set(filter(_is_plausible, steps))) == 1 and bool(whole)
        # A zero below the interval is the first sample.
        is_column = width == 1 and len(whole) + len(steps) == len(texts) and first[-1] != 0.0
        if unconfirmed is None and is_header and (is_other or is_column or is_timed):
            unconfirmed = used, whole, steps[0]
    if unconfirmed is not None:
        used, whole, interval = unconfirmed
        remaining = (lines - used, values.size - sum(map(len, words[:used])))
        has_flag = any(whole) or layout.has_step(interval) or _has_other_form(words, used)
        if counts := [n for n in whole if n >= MIN_COUNT]:
            raise _wrong_count(words, counts[0], remaining, number)
        if has_flag and layout.skip_lines != 0:
            return FirstNumbers(0, interval, used, _first_lines_note(used, number, interval))
    return FirstNumbers()


def _number_of_samples(
    whole: list[float], remaining: tuple[int, int], samples: Array, width: int
) -> int:
    """Return the whole number that is the number of the remaining lines or values; 0 if there is
    none."""
    return next(
        (int(n) for n in whole if (n >= 1.0 and n in remaining) or is_filled(samples, n, width)), 0
    )


def is_filled(values: Array, count: float, width: int) -> bool:
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


def _are_printed_like(row: list[str], samples: list[list[str]]) -> bool:
    """Return True if each number of a row has the number of decimals of a sample."""
    decimals = {len(word.partition(".")[2]) for later in samples for word in later}
    return all(len(word.partition(".")[2]) in decimals for word in row)


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


def doubtful_lines(
    block: NumberBlock, numbers: Numbers, layout: TextLayout, *, is_named: bool
) -> FirstNumbers:
    """Return the first lines of a block that are no samples, although no number of samples confirms
    it.

    1. Without these lines, the first column consists of times in equal steps.
    2. A number is as large as the peak of all numbers below it, and does not continue to the next
       number: a peak, a scale factor, a coordinate. The number above it is then no sample either.
    3. A number of a column is the sampling interval if it is equal to the specified interval, or if
       it is a plausible interval and does not continue the samples.

    `skip_lines=0` states that all numbers are samples.

    Parameters
    ----------
    is_named : bool
        The columns have names: a line between the names and the samples is no sample only if it
        interrupts the times.

    Raises
    ------
    RecordError
        The first line differs in form from the samples.
    IncompleteRecord
        The lines may contain parameters or samples, and no option decides.
    """
    _check_form(block, numbers)
    words, number, width = block.first_words, block.line_numbers[0], numbers.width
    if layout.skip_lines == 0 or numbers.widths.size < MIN_TIMES:
        return FirstNumbers()
    if width > 1:
        used = _lines_above_times(numbers, width)
        reason = "is not a part of the times in equal steps below"
        if not used and not is_named and numbers.is_regular:
            used = _lines_above_samples(numbers.table())
            reason = "does not continue to the other values and is as large as their peak"
        if used:
            raise _question(words, used, number, reason, layout)
        return FirstNumbers()
    if is_named or not np.all(numbers.widths == 1):
        return FirstNumbers()
    values = numbers.values
    used = _lines_above_samples(values[:, None])
    specified = [i for i in range(max(used, 2)) if layout.has_step(float(values[i]))]
    if used or any(specified):
        used = max(used, *(index + 1 for index in specified), 0)
        if not specified and _is_plausible(float(values[used])):
            has_jump, excess = _differs(values[used:], 1)
            used += has_jump and excess > 0
        has_jump, excess = _differs(values, used)
        if specified and ((has_jump and excess > 0) or excess >= _MIN_DIGITS_EXCESS):
            interval = float(values[specified[0]])
            return FirstNumbers(0, interval, used, _first_lines_note(used, number, interval))
        reason = (
            "equals the specified sampling interval"
            if specified
            else "does not continue to the other values and is as large as their peak"
        )
        raise _question(words, used, number, reason, layout)
    return _interval_alone(words, values, layout, number)


def _lines_above_times(numbers: Numbers, width: int) -> int:
    """Return the number of first lines without which the first column of a table contains times in
    equal steps; 0 if the complete table has such times, or no times."""
    for used in range(min(_MAX_FIRST_LINES, numbers.widths.size - MIN_TIMES) + 1):
        rest = numbers.part(used).values
        # A single shorter line is reported as an irregular line.
        is_short = used == 1 and numbers.widths[0] != width
        if np.all(numbers.widths[used:] == width) and are_times(rest[::width]):
            with suppress(RecordError):
                equal_steps(rest[::width])
                return 0 if is_short else used
    return 0


@np.errstate(over="ignore")  # samples up to 1.8e308
def _lines_above_samples(table: Array) -> int:
    """Return the number of first rows up to the last row that is as large as the peak of all rows
    below it, and does not continue to the next row, in all columns of a table; 0 without such a
    row.
    """
    for used in range(min(_MAX_FIRST_LINES, len(table) - _JUMP_SAMPLES), 0, -1):
        first, samples = table[used - 1], table[used:]
        changes = np.max(np.abs(np.diff(samples[:_JUMP_SAMPLES], axis=0)), axis=0)
        change = np.abs(first - samples[0])
        if not np.all(change > changes):  # the row continues to the samples
            continue
        sizes = np.abs(samples)
        peaks = np.max(sizes, axis=0)
        is_peak = np.abs(np.abs(first) - peaks) <= _EQUAL * peaks
        has_jump = change > _JUMP * changes
        # The peak of a motion is unique, unless the motion is periodic or has few digits. A motion
        # that starts at a peak continues smoothly.
        is_unique = np.sum(sizes >= (1.0 - _EQUAL) * peaks, axis=0) == 1
        is_copy = is_peak & is_unique & (change > changes)
        is_larger = (np.abs(first) > peaks) | is_peak
        if np.all(peaks > 0.0) and np.all((is_larger & has_jump) | is_copy):
            return used
    return 0


def _differs(values: Array, used: int) -> tuple[bool, int]:
    """Return True if one of the first `used` values does not continue to the samples below, and by
    how many significant digits the median sample exceeds the last of these values.

    A sampling interval is a round number and has few digits.
    """
    samples = values[used:]
    largest = _JUMP * max_absolute(np.diff(samples[:_JUMP_SAMPLES]))
    has_jump = bool(np.any(np.abs(values[:used] - samples[0]) > largest))
    others = list(islice(filter(None, samples.flat), _JUMP_SAMPLES))
    more = sorted(
        _significant_digits(sample) - _significant_digits(values[used - 1]) for sample in others
    )
    return has_jump, more[len(more) // 2] if more else 0


def _interval_alone(
    words: list[list[str]], values: Array, layout: TextLayout, number: int
) -> FirstNumbers:
    """Return the sampling interval in the first line of a column; raise IncompleteRecord if the
    number may also be a sample."""
    value = float(values[0])
    is_specified = layout.has_step(value)
    if not (is_specified or _is_plausible(value)):
        return FirstNumbers()
    has_jump, excess = _differs(values, 1)
    is_step = is_specified and (has_jump or values[1] == 0.0)  # a motion starts with a zero
    if is_step or (has_jump and excess > 0) or excess >= _MIN_DIGITS_EXCESS:
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
    raise _question(words, 1, number, reason, layout)


def _question(
    words: list[list[str]], used: int, number: int, reason: str, layout: TextLayout
) -> IncompleteRecord:
    """Return the question whether the first lines of a block contain parameters or samples.

    `reason` is a predicate of the last of these lines. The first line has the number `number`.
    """
    last = number + used - 1
    text = " ".join(words[used - 1])[:60]
    above = " remove the lines above it and" if number > 1 else ""
    return IncompleteRecord(
        f"the line above the samples, {text} in line {last}, {reason}. If it is a parameter "
        f"(a peak, a factor, a sampling interval), skip it by `skip_lines={last}`; if it is a "
        f"sample,{above} specify `skip_lines=0`",
        Missing(skip_lines=last, step=layout.step is None),
    )


def _check_form(block: NumberBlock, numbers: Numbers) -> None:
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
    """Return True if the first row contains column numbers, counted from 0 or 1, instead of
    values."""
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
