"""Accelerograms in tables under a free header: rows of successive samples, columns, and numbers in
the first line.

A file consists of text and blocks of numbers. The layout of the largest block follows from
evidence, in this order:

1. a first line with a number of samples and a sampling interval, if the number agrees with the
   rest of the block;
2. names of columns, or a first number in each line that increases by equal steps (times);
3. the number of samples in the header: it is the number of values (rows of samples) or the number
   of lines (columns);
4. the answer of the user (`TextLayout.rows`, `TextLayout.column`);
5. the continuity of the values (`tdint.ground_motion.formats.table_evidence`).

Otherwise the user is asked. All numbers of a file are used or explained: a line of text, a lost or
an unreadable number within the samples is an error, and numbers around the samples are accepted
only if the header explains them.
"""

from __future__ import annotations

import re
import warnings
from array import array
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from io import BytesIO
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.choice import SAME_STEP, TextLayout
from tdint.ground_motion.formats.header_statements import (
    Statements,
    named_integrals,
    named_spectra,
    statements,
)
from tdint.ground_motion.formats.lines import (
    Lines,
    last_decimal,
    read_lines,
    row_of_numbers,
)
from tdint.ground_motion.formats.series import Series, stated_peak, to_stream
from tdint.ground_motion.formats.table_columns import (
    COMMENT,
    SECONDS,
    TIME,
    ColumnName,
    TableHeader,
    any_names,
    column_names,
    declared_in,
    read_header,
)
from tdint.ground_motion.formats.table_evidence import (
    are_times,
    check_first_value,
    continuity,
    counts_rows,
    first_numbers,
    paired,
    unexplained_first_line,
)
from tdint.ground_motion.formats.text import table_series
from tdint.ground_motion.messages import caught_messages
from tdint.ground_motion.miniseed_checks import last_place
from tdint.number_parsing import pluralize

if TYPE_CHECKING:
    from obspy import Stream

_MIN_VALUES = 20  # numbers; a smaller table is not an accelerogram
_MAX_PARTS = 6
"""Maximum number of parts of a table between blank lines that may be different quantities; a table
with more parts has blank lines between its rows or pages."""

_REGULAR = 0.9
"""Fraction of the lines with the same number of values; a table with fewer such lines is not
regular, and single lines cannot be named as the error."""

_SIMILAR_SIZE = 0.9  # fraction of the largest block; the first block of this size is the main block

_PLAIN = re.compile(r"[-+.\dEe\s]*")
_CHARACTERS = re.compile(r"[-+.,;\dEeDd\s*]*")
"""Characters of rows of numbers. Fortran writes asterisks for a number that exceeds its field. The
pattern is fast also for a line of a million characters."""

_DIGIT = re.compile(r"\d")

_DECIMAL = re.compile(r"[-+]?(?:\d+\.\d*|\.\d+)(?:[EeDd][-+]?\d+)?")
_INTEGER = re.compile(r"\+?\d+")
_WITHOUT_POINT = re.compile(r"[-+]?0*[1-9]\d*(?:[EeDd][-+]?\d+)?")
"""Pattern of a number without a decimal point, except zero."""

_SEPARATORS = re.compile(r"[\s,;]+")


@dataclass(frozen=True)
class FreeTable:
    """Components of a table, or the reason why it cannot be read.

    Attributes
    ----------
    series : tuple of Series
        Components; empty if the table cannot be read.
    problem : str
        Error message; empty if the table can be read.
    is_record : bool
        True if the table is an accelerogram or the user specifies how to read it. Otherwise a
        directory may contain the file for another purpose.
    """

    series: tuple[Series, ...] = ()
    notes: tuple[str, ...] = ()
    problem: str = ""
    is_record: bool = True

    def read(self) -> Stream:
        """Return the components as an ObsPy stream.

        Raises
        ------
        RecordError
            The table cannot be read, or its peak differs from the peak in the header.
        """
        if self.problem:
            raise RecordError(self.problem)
        for note in self.notes:
            warnings.warn(note, stacklevel=2)
        return to_stream(self.series)


@dataclass
class _NumberBlock:
    """Consecutive lines of numbers. `above` is the text between the preceding block and this block;
    `after_blank` contains the indices of lines that follow a blank line."""

    above: list[str]
    lines: list[str] = field(default_factory=list)
    line_numbers: list[int] = field(default_factory=list)
    after_blank: list[int] = field(default_factory=list)

    @property
    def characters(self) -> int:
        """Size of the block; unlike the number of values, it does not require parsing."""
        return sum(map(len, self.lines))

    def part(self, start: int, end: int | None = None) -> _NumberBlock:
        """Return the lines from index `start` up to index `end`."""
        return _NumberBlock(
            self.above,
            self.lines[start:end],
            self.line_numbers[start:end],
            [index - start for index in self.after_blank if start < index < (end or np.inf)],
        )


@dataclass(frozen=True)
class _Numbers:
    """Values of a block in the order of the file, and the number of values in each line."""

    values: NDArray[np.float64]
    widths: NDArray[np.int64]

    @property
    def width(self) -> int:
        """Most frequent number of values per line."""
        return int(Counter(self.widths.tolist()).most_common(1)[0][0])

    @property
    def is_regular(self) -> bool:
        """True if all lines have the same number of values, except for a shorter last line."""
        return bool(
            np.all(self.widths[:-1] == self.widths[0]) and self.widths[-1] <= self.widths[0]
        )

    @property
    def sizes(self) -> tuple[int, int]:
        """Number of lines and of values."""
        return self.widths.size, self.values.size

    def part(self, start: int, end: int | None = None) -> _Numbers:
        """Return the numbers of the lines from index `start` up to index `end`."""
        ends = np.concatenate(([0], np.cumsum(self.widths)))
        last = ends[self.widths.size if end is None else end]
        return _Numbers(self.values[ends[start] : last], self.widths[start:end])

    def without_first_column(self) -> _Numbers:
        """Return the numbers of a regular block without the first number of each line."""
        line_starts = np.concatenate(([0], np.cumsum(self.widths)[:-1]))
        return _Numbers(np.delete(self.values, line_starts), self.widths - 1)

    def table(self) -> NDArray[np.float64]:
        """Return the complete lines of a regular block, shape (lines, values per line)."""
        width = int(self.widths[0])
        return self.values[: self.values.size // width * width].reshape(-1, width)


def find_table(data: bytes, layout: TextLayout) -> FreeTable | None:
    """Find the accelerogram in a text file of unknown format.

    Returns
    -------
    FreeTable | None
        None if the file contains no table that this module reads or asks about. It may still
        contain a table of `tdint.ground_motion.formats.text`.
    """
    try:
        lines = read_lines(BytesIO(data), text_only=True)
        lines.skip(layout.skip_lines or 0)
    except RecordError:
        return None
    blocks, below = _split(lines)
    if not blocks:
        return None
    largest = max(block.characters for block in blocks)
    main = next(
        index for index, block in enumerate(blocks) if block.characters >= _SIMILAR_SIZE * largest
    )
    try:
        return _read_table(lines, blocks, main, below, layout)
    except RecordError as error:
        # Without a statement or an option, the file may be any table of numbers.
        stated = statements([line for block in blocks[: main + 1] for line in block.above])
        is_described = bool(layout) and isinstance(error, _LayoutError)
        is_stated = bool(stated.intervals and (stated.units or stated.counts))
        is_record = layout.rows or is_described or is_stated
        return FreeTable(problem=str(error), is_record=is_record)


class _LayoutError(RecordError):
    """The file does not show the layout of its table, or contradicts its description."""


def _split(lines: Lines) -> tuple[list[_NumberBlock], list[str]]:
    """Return the blocks of numbers of a file, and the text below the last block."""
    blocks: list[_NumberBlock] = []
    above: list[str] = []
    block: _NumberBlock | None = None
    is_after_blank = False
    first = lines.number + 1
    for number, line in enumerate(lines.remaining(), start=first):
        if not line or line.isspace():
            is_after_blank = True
            continue
        if _is_row(line):
            if block is None:
                block = _NumberBlock(above)
                blocks.append(block)
                above = []
            elif is_after_blank:
                block.after_blank.append(len(block.lines))
            block.lines.append(line)
            block.line_numbers.append(number)
        else:
            block = None
            above.append(line[:_MAX_HEADER_LINE])
        is_after_blank = False
    return blocks, above


def _is_row(line: str) -> bool:
    """Return True if a line contains only numbers, or numbers and asterisks of a lost number."""
    if not _CHARACTERS.fullmatch(line):
        return False
    has_lost_number = "*" in line
    if has_lost_number:
        return "***" in line and bool(_DECIMAL.search(line))
    return bool(_DIGIT.search(line))


_MAX_HEADER_LINE = 1000  # characters of a line of text that are searched for statements


def _read_table(
    lines: Lines, blocks: list[_NumberBlock], main: int, below: list[str], layout: TextLayout
) -> FreeTable | None:
    """Read the ground motion in the block with index `main`; `below` is the text at the end."""
    header = [line for block in blocks[: main + 1] for line in block.above]
    stated = statements(header)
    numbers = _numbers(blocks[main])
    if numbers.values.size < _MIN_VALUES:
        return None

    # Separate the samples from numbers of a header above them and from quantities after them.
    block, numbers = _with_separate_first_lines(blocks, main, numbers)
    first = first_numbers(numbers.values, numbers.widths)
    start, end = (first.lines, None) if first.lines else _stated_part(block, numbers, stated)
    block, numbers = block.part(start, end), numbers.part(start, end)
    if first.count:
        stated = replace(stated, counts=frozenset([first.count]))
    if first.interval:
        stated = replace(stated, intervals=(*stated.intervals, first.interval))
    is_confirmed = not stated.counts.isdisjoint(numbers.sizes)
    _check_surroundings(blocks, main, below, stated, numbers)
    if not is_confirmed:
        _check_blank_lines(block)
        _check_first_lines(block, numbers)

    names = _column_names(blocks[main].above, numbers.width, layout)
    is_numbered = not layout.column and _has_numbered_times(numbers)
    if is_numbered:
        numbers, names = numbers.without_first_column(), _names_after_first(blocks[main].above)
    kind, reason = _layout_of(block, numbers, stated, names, layout)
    is_bare = not header and layout.step is not None and not layout.skip_lines
    is_left = not (reason or first.lines or is_bare or kind == "pairs" or is_numbered)
    if is_left and _is_text_table(header, kind, names, stated):
        return None
    if not is_confirmed and named_spectra(header):
        return None
    if kind == "single" and not stated.intervals:
        check_first_value(block.lines[:_FIRST_LINES], block.line_numbers[0], layout)
    if kind in ("single", "rows", "numbered rows"):
        _check_decimal_points(block, numbers, int(kind == "numbered rows"))
    # Check whether the last number of the file is cut off.
    lines.checked(array("d", numbers.values), block.line_numbers[0] - 1)

    columns = _columns(numbers, kind)
    has_times = bool(names and names[0].quantity == TIME) or kind == "pairs"
    if kind == "columns" and not names:
        has_times = are_times(columns[0]) and not counts_rows(columns[0])
    if kind == "columns" and not (names or has_times or layout.column or is_bare):
        raise _LayoutError(
            f"each of the {numbers.width} columns is a separate ground motion of {len(columns[0])} "
            "samples; select columns by `column`"
        )
    if reason and not (stated.intervals or layout.step):
        raise RecordError(
            f"each line continues one ground motion ({reason}), but the file does not state the "
            "sampling interval; specify it by `step`"
        )
    notes = (f"each line continues the ground motion: {reason}",) if reason else ()
    # `read` repeats the warnings, which are ignored while formats are tried.
    with caught_messages() as messages:
        series, unit_notes = _components(columns, names, stated, layout, has_times=has_times)
    return FreeTable(tuple(series), (*notes, *unit_notes, *messages))


_FIRST_LINES = 50  # lines that are compared with the form of the first line


def _check_first_lines(block: _NumberBlock, numbers: _Numbers) -> None:
    """Raise RecordError if the first line of a block contains a number of samples that does not
    agree with the block."""
    lines, total = numbers.sizes
    if line := unexplained_first_line(block.lines[:_FIRST_LINES]):
        number = block.line_numbers[0]
        raise RecordError(
            f"line {number}: {line[:60]!r} is not a row of samples, and states no number of "
            f"samples that agrees with the {pluralize(lines - 1, 'line')} and "
            f"{total - int(numbers.widths[0])} values below it; correct it, or skip it by "
            f"`skip_lines={number}`"
        )


# ---- Components


def _columns(numbers: _Numbers, kind: str) -> list[NDArray[np.float64]]:
    """Return the columns of a table by its layout; rows of samples are one column."""
    if kind in ("single", "rows"):
        return [numbers.values]
    if kind == "numbered rows":
        return [numbers.without_first_column().values]
    table = numbers.values.reshape(-1, 2) if kind == "pairs" else numbers.table()
    return list(table.T.copy())


def _components(
    columns: list[NDArray[np.float64]],
    names: tuple[ColumnName, ...],
    stated: Statements,
    layout: TextLayout,
    *,
    has_times: bool,
) -> tuple[list[Series], tuple[str, ...]]:
    """Return the components in the columns of a table, and notes about their units."""
    intervals = stated.intervals
    if intervals and max(intervals) - min(intervals) > SAME_STEP * max(intervals):
        raise RecordError(
            "the header states several sampling intervals, "
            f"{' s and '.join(f'{value:g}' for value in intervals)} s; correct the header"
        )
    declared = {"dt": f"{intervals[0]!r} s"} if intervals else {}
    if stated.counts:
        declared["samples"] = str(columns[0].size)
    notes: tuple[str, ...] = ()
    if len(stated.units) > 1:
        notes = (f"the header states several units, {', '.join(stated.units)}; they are not used",)
    elif stated.units:
        declared["units"] = stated.units[0]
    times = None
    if has_times:
        times = columns[0] * (SECONDS[names[0].units] if names else 1.0)
    series = table_series(columns, TableHeader(declared, names), layout, times)
    if len(series) == 1:
        series = [_with_peak(series[0], stated)]
    if stated.quantity != "acceleration" and not names:
        series = [replace(component, quantity=stated.quantity) for component in series]
    return series, notes


def _with_peak(series: Series, stated: Statements) -> Series:
    """Return a component with the peak in the header, and with the units of the peak if the file
    states no other units and the largest sample is equal to the peak."""
    number, peak_units = stated.peak
    if not number or series.quantity not in ("", "acceleration"):
        return series
    rounding = last_decimal(series.samples)
    units = series.units
    if not units and peak_units:
        largest = float(np.max(np.abs(series.samples)))
        tolerance = 1.01 * (last_place(number) + rounding) + 1e-6 * largest
        if abs(abs(float(number)) - largest) > tolerance:
            return series
        units = peak_units
    peak = stated_peak(number, peak_units or units or "", units or "")
    if peak is not None:
        # Programs compute the peak before the samples are rounded.
        peak = replace(peak, rounding=peak.rounding + rounding * peak.factor)
    return replace(series, units=units, peak=peak)


# ---- Numbers of a block


def _numbers(block: _NumberBlock) -> _Numbers:
    """Return the numbers of a block; raise RecordError for a line that cannot be separated."""
    # Most files need only float(), which is fast.
    joined = " ".join(block.lines)
    if _PLAIN.fullmatch(joined):
        try:
            values = np.array(array("d", map(float, joined.split())))
        except ValueError:
            pass
        else:
            return _Numbers(values, np.array([len(line.split()) for line in block.lines]))
    rows = [_row(line) for line in block.lines]
    if not all(rows) and (width := _field_width(block.lines)):
        # Numbers that fill their fields follow each other without a blank.
        rows = [row or _row(line, width) for row, line in zip(rows, block.lines, strict=True)]
    for row, line, number in zip(rows, block.lines, block.line_numbers, strict=True):
        if not row:
            is_lost = "***" in line
            reason = "has a number that exceeds its field (***), so that a sample is lost"
            raise RecordError(
                f"line {number} {reason if is_lost else 'must contain numbers'}, got "
                f"{line.strip()[:60]!r}; correct the file"
            )
    values = np.array([value for row in rows for value in row])
    return _Numbers(values, np.array(list(map(len, rows))))


def _row(line: str, width: int | None = None) -> list[float]:
    """Return the numbers in a line; empty if a cell is empty or has other text. `width` is the
    number of characters of fields without separators."""
    text = line.strip()
    mark = next((mark for mark in ";\t," if mark in text), None)
    if mark is not None:
        cells = text.removesuffix(mark).split(mark)
        if not all(map(str.strip, cells)):
            return []
        # If the separator is a semicolon or a tab, a comma is a decimal point.
        text = " ".join(cells) if mark == "," else " ".join(cells).replace(",", ".")
    elif width is not None:
        # The first field of a line may lack its leading blanks.
        text = line.rstrip()
        text = text.rjust(-(-len(text) // width) * width)
    try:
        return row_of_numbers(text, width)
    except ValueError:
        return []


def _check_decimal_points(block: _NumberBlock, numbers: _Numbers, skipped: int) -> None:
    """Raise RecordError if a number has no decimal point, but all other numbers have the same
    number of decimals: the point is lost. Zero may be written without a point. The first `skipped`
    numbers of each line are not samples."""
    lines, values = numbers.sizes
    if sum(line.count(".") for line in block.lines) == values - skipped * lines:
        return
    rows = [_SEPARATORS.split(line.strip(" \t,;"))[skipped:] for line in block.lines]
    decimals = {len(word.partition(".")[2]) for row in rows for word in row if "." in word}
    if len(decimals) != 1:
        return
    for row, number in zip(rows, block.line_numbers, strict=True):
        for word in row:
            if _WITHOUT_POINT.fullmatch(word):
                raise RecordError(
                    f"line {number}: {word[:40]} has no decimal point, but all other numbers have "
                    "the same number of decimals; correct it"
                )


def _field_width(lines: Sequence[str]) -> int | None:
    """Return the width of fields that are not separated: the distance of the decimal points if it
    is the same in all lines, otherwise None."""
    width = None
    for line in lines:
        points = [index for index, character in enumerate(line) if character == "."]
        for before, after in pairwise(points):
            width = width or after - before
            if after - before != width:
                return None
    return width


# ---- Numbers around the samples


def _with_separate_first_lines(
    blocks: list[_NumberBlock], main: int, numbers: _Numbers
) -> tuple[_NumberBlock, _Numbers]:
    """Return the main block with the count and the interval above it, which text may separate from
    the samples (`name`, `4000 0.01`, `ACCELERATION IN G`)."""
    block, previous = blocks[main], blocks[main - 1]
    is_short = main > 0 and len(previous.lines) <= 2 and len(" ".join(previous.lines).split()) <= 3
    if is_short:
        joined = _NumberBlock(
            previous.above,
            previous.lines + block.lines,
            previous.line_numbers + block.line_numbers,
            [index + len(previous.lines) for index in block.after_blank],
        )
        above = _numbers(previous)
        together = _Numbers(
            np.concatenate((above.values, numbers.values)),
            np.concatenate((above.widths, numbers.widths)),
        )
        if first_numbers(together.values, together.widths).lines == len(previous.lines):
            return joined, together
    return block, numbers


def _stated_part(
    block: _NumberBlock, numbers: _Numbers, stated: Statements
) -> tuple[int, int | None]:
    """Return the first and the end line of the samples in a block by the stated number of samples.

    The velocity and the displacement may follow the acceleration if the header names them. Numbers
    of the header may precede the samples without a line of text, in lines with whole numbers or
    with another number of values; other lines may be samples of another record.
    """
    lines, total = numbers.sizes
    if not stated.counts.isdisjoint((lines, total)):
        return 0, None
    ends = np.concatenate(([0], np.cumsum(numbers.widths)))
    for count in sorted(stated.counts):
        if total in (2 * count, 3 * count) and "velocity" in stated.integrals and count in ends:
            return 0, int(np.searchsorted(ends, count))
    for first in range(1, min(lines, _MAX_NUMBER_LINES)):
        before = block.lines[first - 1]
        has_whole = any(map(_INTEGER.fullmatch, before.split()))
        if not has_whole and numbers.widths[first - 1] == numbers.width:
            break
        if int(total - ends[first]) in stated.counts and numbers.part(first).is_regular:
            return first, None
    return 0, None


_MAX_NUMBER_LINES = 100  # lines of numbers in a header


def _check_surroundings(
    blocks: list[_NumberBlock], main: int, below: list[str], stated: Statements, numbers: _Numbers
) -> None:
    """Raise RecordError if lines around the samples are neither a header nor explained by it.

    Otherwise a line of text or a damaged number would split the samples, and a part of the ground
    motion would be lost without a message.
    """
    is_confirmed = not stated.counts.isdisjoint(numbers.sizes)
    later = blocks[main + 1 :]
    if is_confirmed and _are_integrals(blocks, main, later, stated, numbers):
        later = []
    for block in later:
        is_remark = is_confirmed and len(" ".join(block.lines).split()) <= 2
        if not is_remark:
            text = block.above[-1].strip()[:40] if block.above else "a blank line"
            raise RecordError(
                f"the numbers that start in line {block.line_numbers[0]} follow the text {text!r}: "
                "a text line interrupts the samples, or another record starts; remove the line, or "
                "split the file"
            )
    if is_confirmed:
        return
    for block in blocks[:main]:
        is_name = len(block.lines) <= 2 and all(
            _INTEGER.fullmatch(word) for word in " ".join(block.lines).split()
        )
        if not is_name:
            first, last = block.line_numbers[0], block.line_numbers[-1]
            where = f"line {first}" if first == last else f"lines {first} to {last}"
            raise RecordError(
                f"the numbers in {where} precede the samples, and the header does not explain "
                f"them; if they are no samples, skip them by `skip_lines={last}`"
            )
    # A damaged first or last row is not a row of numbers. The last row may be shorter.
    width = numbers.width
    after = blocks[main + 1].above if main + 1 < len(blocks) else below
    neighbors = [
        (line, range(width - 1 if width > 2 else width, width + 2))
        for line in blocks[main].above[-1:]
    ]
    neighbors += [(line, range(1, width + 2)) for line in after[:1]]
    for line, widths in neighbors:
        words = _SEPARATORS.split(line.strip())
        damaged = sum(map(_resembles_number, words))
        if len(words) in widths and damaged and 2 * damaged >= len(words):
            raise RecordError(
                f"the line {line.strip()[:60]!r} next to the samples must contain numbers; correct "
                "or remove it"
            )


def _resembles_number(word: str) -> bool:
    """Return True if a word contains a decimal point and a digit, or marks a missing number."""
    has_point = "." in word and any(map(str.isdecimal, word))
    return has_point or word.lower().lstrip("-") in ("nan", "inf", "null", "none")


def _are_integrals(
    blocks: list[_NumberBlock],
    main: int,
    later: list[_NumberBlock],
    stated: Statements,
    numbers: _Numbers,
) -> bool:
    """Return True if the blocks after the acceleration are its velocity and its displacement.

    They must have the same number of values, and text must name them: the text above each block,
    or the header if only blank lines separate the blocks. A repeated header starts another record.
    """
    if not 0 < len(later) <= 2:
        return False
    header = set(blocks[main].above)
    for block in later:
        text = [line for line in block.above if line not in header]
        is_named = bool(named_integrals(text)) if block.above else bool(stated.integrals)
        if not is_named or _numbers(block).values.size != numbers.values.size:
            return False
    return True


def _check_blank_lines(block: _NumberBlock) -> None:
    """Raise RecordError if blank lines divide a block into a few parts, which may be different
    quantities."""
    if 0 < len(block.after_blank) < _MAX_PARTS:
        number = block.line_numbers[block.after_blank[0]]
        raise RecordError(
            f"a blank line before line {number} divides the numbers, and the header does not state "
            "the number of samples; remove the blank line if the numbers are one ground motion, or "
            "split the file"
        )


# ---- Layout


def _layout_of(
    block: _NumberBlock,
    numbers: _Numbers,
    stated: Statements,
    names: tuple[ColumnName, ...],
    layout: TextLayout,
) -> tuple[str, str]:
    """Return the layout of a block (`single`, `rows`, `numbered rows`, `columns`, `pairs`), and the
    reason for rows; raise RecordError if the layout contradicts the file, or if it is
    unknown."""
    lines, total = numbers.sizes
    width = numbers.width
    if not numbers.is_regular:
        if total in stated.counts:
            return "rows", f"the header states {total} samples, the number of values"
        raise _irregular(block, numbers)
    if width == 1:
        _check_count(stated, lines, lines, total)
        return "single", ""

    # Names and times show columns.
    table = numbers.table()
    is_timed = are_times(table[:, 0]) and not counts_rows(table[:, 0])
    pairs = None if names else paired(table)
    if names or is_timed or pairs is not None:
        if layout.rows:
            raise _LayoutError(
                f"`rows` contradicts the {'names of the columns' if names else 'times'} in the "
                "table; remove it"
            )
        # The last line of pairs may be shorter.
        if numbers.widths[-1] != width and (pairs is None or numbers.widths[-1] % 2):
            raise _irregular(block, numbers)
        count = lines if pairs is None else total // 2
        _check_count(stated, count, lines, total)
        return ("columns" if pairs is None else "pairs"), ""

    # A column of line numbers is not a part of the samples.
    is_numbered = counts_rows(table[:, 0]) and width > 3
    kind = "numbered rows" if is_numbered else "rows"
    value_count = total - lines if is_numbered else total
    if stated.counts:
        _check_count(stated, value_count, lines, total, lines)
        if value_count in stated.counts:
            if layout.column:
                raise _no_columns(f"the header states {value_count} samples")
            return kind, f"the header states {value_count} samples, the number of values"
        if layout.rows:
            raise _LayoutError(
                f"`rows` contradicts the header, which states {lines} samples, the number of "
                "lines; remove it"
            )
        if numbers.widths[-1] != width:
            raise _irregular(block, numbers)
        return "columns", ""

    evidence = continuity(table[:, int(is_numbered) :])
    found = evidence.layout if evidence else ""
    if layout.column and found == "rows":
        raise _no_columns(str(evidence))
    if layout.rows or found == "rows":
        return kind, str(evidence) if found == "rows" else "as specified by `rows`"
    # Rows of samples may have a shorter last line, columns may not.
    is_complete = numbers.widths[-1] == width
    if layout.column and not is_complete:
        raise _irregular(block, numbers)
    if layout.column or (found == "columns" and is_complete):
        return "columns", ""
    reason = str(evidence) if evidence else _NO_EVIDENCE.get(width, f"only {len(table)} lines")
    raise _question(block, width, stated, layout, reason)


def _question(
    block: _NumberBlock, width: int, stated: Statements, layout: TextLayout, reason: str
) -> _LayoutError:
    """Return the question about the layout of a table, with the options that each answer
    requires."""
    first = block.line_numbers[0]
    # The reader of columns under text without statements (`tdint.ground_motion.formats.text`)
    # requires that the user skips the text.
    is_stated = bool(stated.units or stated.counts or stated.intervals)
    is_text = not is_stated and any(declared_in(line) is None for line in block.above)
    skip = f" and skip the lines above by `skip_lines={first - 1}`" if is_text else ""
    step = "" if stated.intervals or layout.step else "; the sampling interval is required (`step`)"
    return _LayoutError(
        f"the table that starts in line {first} has {width} values per line, and the file does not "
        f"show ({reason}) whether each line continues one ground motion (specify `rows`) or each "
        f"column is a separate ground motion (specify `column`{skip}){step}"
    )


_NO_EVIDENCE = {2: "no times, no number of samples"}


def _no_columns(reason: str) -> _LayoutError:
    """Return the error that the user selects a column of a table of rows."""
    return _LayoutError(
        f"`column` cannot be used: each line continues one ground motion ({reason}); remove it"
    )


def _check_count(stated: Statements, count: int, lines: int, total: int, *others: int) -> None:
    """Raise RecordError if the header states numbers of samples, but neither `count` nor another
    possible number."""
    if stated.counts and stated.counts.isdisjoint((count, *others)):
        numbers = " or ".join(map(str, sorted(stated.counts)))
        values = "" if total == lines else f" with {total} values"
        raise _LayoutError(
            f"the header states {numbers} samples, but the table has {pluralize(lines, 'line')}"
            f"{values}; complete the file, or correct the number"
        )


def _irregular(block: _NumberBlock, numbers: _Numbers) -> RecordError:
    """Return the error for a block with different numbers of values per line."""
    width = numbers.width
    index = int(np.flatnonzero(numbers.widths != width)[0])
    if np.mean(numbers.widths == width) < _REGULAR:
        return RecordError(
            f"the lines from line {block.line_numbers[0]} have different numbers of values, "
            f"{numbers.widths[0]} to {numbers.widths.max()}; the number of samples in the header "
            "must be equal to their sum"
        )
    number = block.line_numbers[index]
    remedy = ""
    header_rows = int(np.argmax(numbers.widths == width))
    if 0 < header_rows <= _MAX_HEADER_ROWS and numbers.part(header_rows).is_regular:
        skip = block.line_numbers[header_rows - 1]
        remedy = f"; if it belongs to the header, skip it by `skip_lines={skip}`"
    return RecordError(
        f"line {number} must contain {width} numbers, got "
        f"{block.lines[index].strip()[:60]!r}{remedy}"
    )


_MAX_HEADER_ROWS = 3  # rows of numbers at the start that may belong to the header


def _column_names(above: list[str], width: int, layout: TextLayout) -> tuple[ColumnName, ...]:
    """Return the names of the columns in the last line above a block; empty if it has none.

    Arbitrary text names columns only if the first name is a time and another name is an
    acceleration with units, or if the user selects a column.
    """
    if not above or width == 1:
        return ()
    comment = COMMENT.fullmatch(above[-1])
    line = comment[1] if comment else above[-1]
    names = tuple(column_names(line))
    if len(names) == width:
        return names
    names = any_names(line, width)
    is_clear = bool(names) and names[0].quantity == TIME and _has_acceleration(names)
    return names if is_clear or (layout.column and not comment) else ()


def _has_numbered_times(numbers: _Numbers) -> bool:
    """Return True if each line starts with its number, followed by a time."""
    if len(set(numbers.widths)) != 1 or numbers.width < 3:
        return False
    first, second = numbers.table()[:, :2].T
    return counts_rows(first) and are_times(second) and not counts_rows(second)


def _names_after_first(above: list[str]) -> tuple[ColumnName, ...]:
    """Return the names of the columns without the first, which numbers the lines; empty if the last
    line above the block does not name them."""
    line = "".join(above[-1:]).lstrip("#%;!/ ")
    _, _, others = line.partition(next((mark for mark in ",;\t" if mark in line), " "))
    return tuple(column_names(others))


def _has_acceleration(names: tuple[ColumnName, ...]) -> bool:
    """Return True if a name states an acceleration with units."""
    return any(name.quantity == "acceleration" and name.units for name in names)


def _is_text_table(
    header: list[str], kind: str, names: tuple[ColumnName, ...], stated: Statements
) -> bool:
    """Return True if a table is left to `tdint.ground_motion.formats.text`, where the user
    specifies its layout: all lines above it are declarations, or the file does not show that it
    contains accelerations."""
    declarations = header[:-1] if names else header
    with suppress(RecordError):
        if all(declared_in(line) is not None for line in declarations):
            read_header(declarations, len(names) or 1).intervals()
            return True
    if names:
        return not _has_acceleration(names) and not stated.units
    is_stated = bool(stated.counts or stated.intervals)
    return not (stated.units or (is_stated and kind in ("single", "columns")))
