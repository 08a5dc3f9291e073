"""Text tables: columns of numbers, or rows of successive samples, with any header.

A file consists of text and blocks of numbers (`tdint.ground_motion.formats.table_lines`). The text
contains declarations `key = value`, statements in free wording and names of columns. The layout of
the largest block follows from evidence, in this order:

1. numbers in the first lines that are no samples (`table_evidence.first_numbers`);
2. the roles of the columns (`table_roles.column_roles`): a column of times is named as a time, or
   its values increase by equal steps in nearly all rows;
3. the number of samples in the header: it is the number of values (rows of samples) or the number
   of lines (columns);
4. the options of the user (`TextLayout.rows`, `TextLayout.column`);
5. the continuity of the values (`table_evidence.continuity`).

Otherwise the user is asked (`tdint.ground_motion.missing`). All numbers of a file are used or
explained: a line of text, a lost or an unreadable number within the samples is an error, and
numbers around the samples are accepted only if the header explains them.

Columns named as acceleration are read. Velocity and displacement columns next to an acceleration
supply its peaks; without an acceleration column they are the motion. Units are not guessed.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.choice import AS_STATED, TextLayout
from tdint.ground_motion.formats.header_statements import (
    Statements,
    named_integrals,
    named_spectra,
    statements,
)
from tdint.ground_motion.formats.lines import Lines, is_row_of_numbers, read_lines, recognizer
from tdint.ground_motion.formats.series import (
    Series,
    to_stream,
)
from tdint.ground_motion.formats.table_columns import (
    COMMENT,
    MOTIONS,
    OTHER,
    SECONDS,
    TIME,
    ColumnName,
    any_names,
    column_names,
    declarations,
    spectrum_name,
    with_units,
)
from tdint.ground_motion.formats.table_evidence import (
    FirstNumbers,
    continuity,
    doubtful_lines,
    first_numbers,
    has_card_numbers,
    is_filled,
    transposed,
)
from tdint.ground_motion.formats.table_lines import (
    NumberBlock,
    Numbers,
    TableText,
    block_numbers,
    table_text,
)
from tdint.ground_motion.formats.table_roles import (
    Names,
    Roles,
    are_times,
    axis,
    column_roles,
    counts_rows,
    has_pairs,
)
from tdint.ground_motion.formats.table_series import TableColumns, incomplete, table_components
from tdint.ground_motion.messages import caught_messages
from tdint.ground_motion.missing import Missing, OtherContent
from tdint.ground_motion.record import has_one_sign
from tdint.number_parsing import any_case, pluralize

if TYPE_CHECKING:
    from obspy import Stream

_MIN_VALUES = 20  # numbers; a smaller table that cannot be read may be a part of any text
_MAX_PARTS = 6
"""Maximum number of parts of a table between blank lines that may be different quantities; a table
with more parts has blank lines between its rows or pages."""

_REGULAR = 0.9
"""Fraction of the lines with the same number of values; a table with fewer such lines is not
regular, and single lines cannot be named as the error."""

_INTEGER = re.compile(r"\+?\d+")
_WITHOUT_POINT = re.compile(r"[-+]?0*[1-9]\d*(?:[EeDd][-+]?\d+)?")
"""Pattern of a number without a decimal point, except zero."""
_ENDS_WITH_ZERO = re.compile(r"\.0\b")

_SEPARATORS = re.compile(r"[\s,;]+")


@dataclass(frozen=True)
class TextTable:
    """Components of a table, or the reason why it cannot be read.

    Attributes
    ----------
    series : tuple of Series
        Components; empty if the table cannot be read.
    problem : RecordError or None
        Error; None if the table can be read.
    """

    series: tuple[Series, ...] = ()
    notes: tuple[str, ...] = ()
    problem: RecordError | None = None

    def read(self, *, headonly: bool = False) -> Stream:
        """Return the components as an ObsPy stream.

        Raises
        ------
        RecordError
            The table cannot be read, or its peak differs from the peak in the header.
        """
        if self.problem:
            raise self.problem
        for note in self.notes:
            warnings.warn(note, stacklevel=2)
        return to_stream(self.series, headonly=headonly)


@recognizer
def is_text(lines: list[str]) -> object:
    """Return True if a file starts with declarations, names of columns and rows of numbers.

    `find_table` reads more tables; this check is for `obspy.read`, which tries formats in any
    order.
    """
    text = table_text(Lines("\n".join(lines)))
    if not text.blocks or len(text.blocks[0].lines) < 2:
        return False
    numbers = block_numbers(text.blocks[0].part(0, 2))
    # Columns without names are recognized only if the first increases like times.
    is_table = numbers.widths[0] == numbers.widths[1] and (
        numbers.width == 1
        or any(map(column_names, text.blocks[0].above))
        or bool(np.diff(numbers.table()[:, 0]) > 0.0)
    )
    return is_table and all(
        bool(COMMENT.fullmatch(line) or declarations(line) or column_names(line))
        and not _OTHER_FORMAT.match(line)
        for line in text.blocks[0].above
    )


_OTHER_FORMAT = any_case(r"#\s*DataSequence\s*:")
"""Pattern of a comment that identifies another format (CWB)."""


def read_text(
    file: Any, headonly: bool = False, layout: TextLayout = AS_STATED, **_: Any
) -> Stream:
    """Read a text table, and return its components as an ObsPy stream.

    Raises
    ------
    RecordError
        The file contains no table of numbers, or the table cannot be read.
    """
    table = _table_in(file, layout)
    if table is None:
        raise RecordError("the file contains no table of numbers")
    return table.read(headonly=headonly)


def find_table(data: bytes, layout: TextLayout) -> TextTable | None:
    """Find the accelerogram in a text file; return None if the file contains no table of
    numbers."""
    try:
        return _table_in(BytesIO(data), layout)
    except RecordError:
        return None


def _table_in(file: Any, layout: TextLayout) -> TextTable | None:
    """Return the table in a file; None if the file has no row of numbers."""
    lines = read_lines(file, text_only=True)
    lines.skip(layout.skip_lines or 0)
    if columns := transposed(lines):
        lines = columns
    text = table_text(lines)
    if not text.blocks:
        return None
    try:
        # `read` repeats the warnings, which are ignored while formats are tried.
        with caught_messages() as messages:
            series = _read_table(lines, text, layout)
            if columns:
                warnings.warn("the lines are the columns of a table: times, values", stacklevel=2)
            if layout.skip_lines:
                skipped = pluralize(layout.skip_lines, "line")
                warnings.warn(f"{skipped} ignored at the beginning, as requested", stacklevel=2)
    except RecordError as error:
        return TextTable(problem=error)
    return TextTable(tuple(series), tuple(messages))


def _read_table(lines: Lines, text: TableText, layout: TextLayout) -> list[Series]:
    """Read and return the ground motions in the main block of a text."""
    blocks, main = text.blocks, text.main
    numbers = block_numbers(blocks[main])
    if numbers.sizes[0] == 1 and numbers.values.size < _MIN_VALUES:
        raise RecordError(
            "the file has only one row of numbers; a record needs at least two samples: check that "
            "the file is complete"
        )

    # Separate the samples from numbers of a header above them and from quantities after them.
    names, header = _names_and_header(blocks[: main + 1], numbers, layout)
    block, numbers = _with_separate_first_lines(blocks, main, numbers, layout)
    # The samples may precede a statement: `a = [...]; dt = 0.01`.
    stated = statements([*header, *text.below])
    _check_content(names, header, stated)
    first = FirstNumbers()
    # The numbers of a ramp continue each other.
    if stated.counts.isdisjoint(numbers.sizes) and not (
        numbers.width == 1 and are_times(numbers.values)
    ):
        first = first_numbers(block, numbers, layout)
        start, end = (first.lines, None) if first.lines else _stated_part(block, numbers, stated)
        if not (start or end):
            first = doubtful_lines(block, numbers, layout, is_named=bool(names))
            start = first.lines
        block, numbers = block.part(start, end), numbers.part(start, end)
    if first.count:
        stated = replace(stated, counts=frozenset([first.count]))
    if first.interval:
        stated = stated.with_interval(first.interval)
    if first.note:
        warnings.warn(first.note, stacklevel=2)
    numbers = _without_filling(_without_cards(block, numbers, names), stated)
    is_confirmed = not stated.counts.isdisjoint(numbers.sizes)
    _check_surroundings(blocks, main, text.below, stated, numbers)
    if not is_confirmed:
        _check_blank_lines(block)

    roles = column_roles(numbers, names, text.ignored, layout)
    if roles.has_pairs:
        names = names[:2]
    if roles.time is not None and not (names or stated.intervals):
        _check_unit_of_times(header)
    table = TableColumns([], names, stated, roles, layout.one_sided)
    kind, reason = _layout_of(block, numbers, table, layout)
    if kind in ("single", "rows", "numbered rows"):
        _check_decimal_points(block, numbers, int(kind == "numbered rows"))
    # Check whether the last number of the file is cut off.
    lines.checked(numbers.values, block.line_numbers[0] - 1)
    if kind not in ("columns", "single"):  # no column of the lines remains
        roles = Roles(0 if kind == "pairs" else None)
    table = replace(table, columns=_columns(numbers, kind), roles=roles)
    _check_signs(table, header)
    is_bare = not header and layout.step is not None and not layout.skip_lines
    if (
        kind == "columns"
        and len(table.candidates) > 1
        and not (names or roles.time is not None or layout.column or is_bare)
    ):
        raise incomplete(
            f"each of the {numbers.width} columns is a separate ground motion of "
            f"{len(table.columns[0])} samples; select columns by `column`",
            table,
            layout,
            Missing(columns=tuple(map(table.name, table.candidates))),
        )
    if reason:
        warnings.warn(f"each line continues the ground motion: {reason}", stacklevel=2)
    return table_components(table, layout, reason)


_MILLISECONDS = any_case(r"[(\[]\s*(?:ms|msec)\s*[)\]]|\bin (?:ms|msec)\b")


def _check_unit_of_times(header: Sequence[str]) -> None:
    """Raise RecordError if the header of a table without names of columns contains milliseconds,
    because the times would be read as seconds."""
    if line := next(filter(_MILLISECONDS.search, header), ""):
        raise RecordError(
            f"the times may be in ms, but the line {line.strip()[:60]!r} does not name the "
            "columns; separate its names as the values"
        )


def _check_content(names: Names, header: Sequence[str], stated: Statements) -> None:
    """Raise OtherContent if the names or the header show that the table contains spectra."""
    if name := spectrum_name(names):
        raise OtherContent(
            f"the table contains a spectrum (column {name[:40]!r}: periods or frequencies), not a "
            "ground motion; specify the file of the acceleration",
            "spectrum",
        )
    texts = [*header, " ".join(name.text for name in names)]
    if not stated.counts and (spectra := named_spectra(texts)):
        raise OtherContent(
            f"the file contains {spectra.lower()} (volume 3 of a record), not a ground motion; "
            "specify the file of the acceleration (volume 1 or 2)",
            "spectrum",
        )


_SPECTRAL_WORD = any_case(r"spectr\w*|\bperiods?\b|\bfrequenc\w*|\bp?sa\b|\bpg[avd]\b")


def _check_signs(table: TableColumns, header: Sequence[str]) -> None:
    """Raise an error if a table contains only times or a list of peaks, or if its values have one
    sign, and its first column may be periods or frequencies: the header mentions a spectrum, or the
    column is not named as a time. `T` is also the symbol of a period.
    """
    names, time = table.names, table.roles.time
    values = [table.columns[index] for index in table.candidates]
    if table.one_sided or (time is None and len(values) != 1):
        return
    if not (table.values or table.roles.ignored):
        raise OtherContent(
            "the column always increases or decreases, as times and periods do; for a ramp specify "
            "`one_sided`",
            "times",
        )
    first = names[time].text if names and time is not None else ""
    has_motion = any(name.quantity in MOTIONS for name in names)
    texts = [*header, *(name.text for name in names)]
    word = next((match[0] for text in texts if (match := _SPECTRAL_WORD.search(text))), "")
    is_spectrum = bool(word) and not has_motion and sum(v.size for v in values) >= _MIN_VALUES // 2
    if is_spectrum and all(np.min(column) >= 0.0 for column in values):
        raise OtherContent(
            f"the header mentions {word!r}, and no value is negative: the table contains a "
            "spectrum, not a ground motion; specify the file of the acceleration",
            "spectrum",
        )
    may_be = not first or first.partition(" ")[0] == "T"
    if time is None:  # a constant is no list of peaks
        may_be = not (table.stated.intervals or table.stated.units) and bool(np.ptp(values[0]))
    if may_be and values and all(map(has_one_sign, values)):
        raise RecordError(
            "no value is below zero, or none is above: a list of peaks, or a spectrum with periods "
            "or frequencies; for a pulse of one sign, specify `one_sided`"
        )


# ---- Numbers around the samples


def _columns(numbers: Numbers, kind: str) -> list[Array]:
    """Return the columns of a table by its layout; rows of samples are one column."""
    if kind in ("single", "rows"):
        return [numbers.values]
    if kind == "pairs":
        return list(numbers.values.reshape(-1, 2).T.copy())
    if kind == "numbered rows":
        return [numbers.without_first().values]
    return list(numbers.table().T)


def _with_separate_first_lines(
    blocks: list[NumberBlock], main: int, numbers: Numbers, layout: TextLayout
) -> tuple[NumberBlock, Numbers]:
    """Return the main block with the count and the interval above it, which text may separate from
    the samples (`name`, `4000 0.01`, `ACCELERATION IN G`), or which may be a comment."""
    block, previous = blocks[main], blocks[main - 1]
    if rows := [row for line in block.above if (row := _commented_row(line))]:
        previous = NumberBlock(block.above, rows[-1:], [block.line_numbers[0] - 1])
    elif main == 0 or len(previous.lines) > 2 or len(" ".join(previous.lines).split()) > 5:
        return block, numbers
    joined = NumberBlock(
        previous.above,
        [*previous.lines, *block.lines],
        [*previous.line_numbers, *block.line_numbers],
        [index + len(previous.lines) for index in block.after_blank],
    )
    with suppress(RecordError):
        above = block_numbers(previous)
        together = Numbers(
            np.concatenate((above.values, numbers.values)),
            np.concatenate((above.widths, numbers.widths)),
        )
        if first_numbers(joined, together, layout).lines == len(previous.lines):
            return joined, together
    return block, numbers


def _commented_row(line: str) -> str:
    """Return the numbers in a comment; empty if a line is no comment or contains other text."""
    comment = COMMENT.fullmatch(line)
    return comment[1].strip() if comment and is_row_of_numbers(comment[1]) else ""


def _without_cards(block: NumberBlock, numbers: Numbers, names: Names) -> Numbers:
    """Return the values without line numbers (of cards) at the end of each line, with a warning."""
    if names or int(numbers.widths.min()) < 2 or not has_card_numbers(block, numbers):
        return numbers
    note = "the last number of each line is the number of the line and is not read"
    warnings.warn(note, stacklevel=2)
    return numbers.without_last()


def _without_filling(numbers: Numbers, stated: Statements) -> Numbers:
    """Return the samples without zeros that fill the last row after the stated number of samples,
    with a warning."""
    width, total = int(numbers.widths[-1]), numbers.values.size
    counts = [n for n in stated.counts if is_filled(numbers.values, n, width)]
    if len(counts) != 1 or not numbers.is_regular:
        return numbers
    widths = numbers.widths.copy()
    widths[-1] -= total - counts[0]
    note = f"{pluralize(total - counts[0], 'zero')} after the {counts[0]} stated samples omitted"
    warnings.warn(note, stacklevel=2)
    return Numbers(numbers.values[: counts[0]], widths)


def _stated_part(
    block: NumberBlock, numbers: Numbers, stated: Statements
) -> tuple[int, int | None]:
    """Return the first and the end line of the samples in a block by the stated number of samples.

    The velocity and the displacement may follow the acceleration if the header names them. Numbers
    of the header may precede the samples without a line of text, in lines with whole numbers or
    with another number of values; other lines may be samples of another record.
    """
    if not stated.counts:
        return 0, None
    lines, total = numbers.sizes
    ends = numbers.line_ends
    for count in sorted(stated.counts):
        if total in (2 * count, 3 * count) and "velocity" in stated.integrals and count in ends:
            return 0, int(np.searchsorted(ends, count))
    for first in range(1, min(lines, _MAX_NUMBER_LINES)):
        has_whole = any(map(_INTEGER.fullmatch, block.lines[first - 1].split()))
        if not has_whole and numbers.widths[first - 1] == numbers.width:
            break
        if int(total - ends[first]) in stated.counts and numbers.part(first).is_regular:
            return first, None
    return 0, None


_MAX_NUMBER_LINES = 100  # lines of numbers in a header


_FEW_LINES = 3  # lines that text may have replaced


def _check_surroundings(
    blocks: list[NumberBlock], main: int, below: list[str], stated: Statements, numbers: Numbers
) -> None:
    """Raise RecordError if lines around the samples are no header and not explained by a header.

    Otherwise a line of text or a damaged number would split the samples, and a part of the ground
    motion would be lost without a message.
    """
    is_confirmed = not stated.counts.isdisjoint(numbers.sizes)
    later = blocks[main + 1 :]
    # The velocity and the displacement of the acceleration may follow, with the same number of
    # values. Text must name them: the text above each block, or the header if only blank lines
    # separate the blocks. A repeated header starts another record.
    header = set(blocks[main].above)
    are_integrals = (is_confirmed and len(later) <= 2) and all(
        (
            named_integrals([line for line in block.above if line not in header])
            if block.above
            else stated.integrals
        )
        and block_numbers(block).values.size == numbers.values.size
        for block in later
    )
    for block in [] if are_integrals else later:
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
    # A damaged first or last row is not a row of numbers. The last row may be shorter.
    width = numbers.width
    after = blocks[main + 1].above if main + 1 < len(blocks) else below
    first, last = blocks[main].line_numbers[0] - 1, blocks[main].line_numbers[-1] + 1
    neighbors = [
        (line, f"line {first}", range(width - 1 if width > 2 else width, width + 2))
        for line in blocks[main].above[-1:]
    ]
    neighbors += [(line, f"line {last}", range(1, width + 2)) for line in after[:1]]
    for line, where, widths in neighbors:
        words = _SEPARATORS.split(line.strip())
        damaged = sum(map(_resembles_number, words))
        # A line with a unit or a sampling interval is a header.
        is_damaged = len(words) in widths and damaged and 2 * damaged >= len(words)
        if is_damaged and not (statements([line]) or COMMENT.fullmatch(line)):
            raise RecordError(
                f"{where}: {line.strip()[:60]!r} next to the samples must contain numbers; correct "
                "or remove it"
            )
    for block in blocks[:main]:
        words = " ".join(block.lines).split()
        is_name = len(block.lines) <= 2 and all(map(_INTEGER.fullmatch, words))
        # A number of samples that is nearly right shows that text replaces a few samples.
        if not is_name or any(
            abs(int(word) - size) <= _FEW_LINES for word in words for size in numbers.sizes
        ):
            first, last = block.line_numbers[0], block.line_numbers[-1]
            where = f"line {first}" if first == last else f"lines {first} to {last}"
            raise RecordError(
                f"the numbers in {where} precede the samples, and the header does not explain "
                f"them; if they are no samples, skip them by `skip_lines={last}`"
            )


def _resembles_number(word: str) -> bool:
    """Return True if a word contains a decimal point and a digit, or marks a missing number."""
    has_point = "." in word and any(map(str.isdecimal, word))
    return has_point or word.lower().lstrip("-") in ("nan", "inf", "null", "none")


def _check_blank_lines(block: NumberBlock) -> None:
    """Raise RecordError if blank lines divide a block into a few parts, which may be different
    quantities."""
    if 0 < len(block.after_blank) < _MAX_PARTS:
        number = block.line_numbers[block.after_blank[0]]
        raise RecordError(
            f"a blank line before line {number} divides the numbers, and the header does not state "
            "the number of samples; remove the blank line if the numbers are one ground motion, or "
            "split the file"
        )


def _check_decimal_points(block: NumberBlock, numbers: Numbers, skipped: int) -> None:
    """Raise RecordError if a number has no decimal point, but all other numbers have the same
    number of decimals: the point is lost. Zero may be written without a point. The first `skipped`
    numbers of each line are not samples."""
    lines, values = numbers.sizes
    points = sum(part.count(b".") for part in block.text.parts())
    if points == values - skipped * lines or values < _MIN_VALUES:
        return
    rows = [_SEPARATORS.split(line.strip(" \t,;"))[skipped:] for line in block.lines]
    decimals = {len(word.partition(".")[2]) for row in rows for word in row if "." in word}
    # Numbers with a single decimal may also be written without final zeros.
    has_zeros = any(map(_ENDS_WITH_ZERO.search, block.lines))
    if len(decimals) != 1 or (decimals == {1} and not has_zeros):
        return
    for row, number in zip(rows, block.line_numbers, strict=True):
        for word in row:
            if _WITHOUT_POINT.fullmatch(word):
                raise RecordError(
                    f"line {number}: {word[:40]} has no decimal point, but all other numbers have "
                    "the same number of decimals; correct it"
                )


# ---- Layout


def _layout_of(
    block: NumberBlock, numbers: Numbers, table: TableColumns, layout: TextLayout
) -> tuple[str, str]:
    """Return the layout of a block (`single`, `rows`, `numbered rows`, `columns`, `pairs`), and the
    reason for rows; raise RecordError if an option contradicts the file, or if the layout is
    unknown."""
    lines, total = numbers.sizes
    kind, count, reason = next(_layouts(block, numbers, table, layout))
    _check_count(table.stated, count, lines, total)
    if layout.rows and kind in ("columns", "pairs"):
        raise RecordError(f"`rows` contradicts {reason}; remove it")
    if layout.column and "rows" in kind and lines > 1:
        raise RecordError(
            f"`column` cannot be used: each line continues one ground motion ({reason}); remove it"
        )
    # The last line of pairs may be shorter.
    is_complete = numbers.widths[-1] % 2 == 0 if kind == "pairs" else numbers.is_complete
    if kind in ("columns", "pairs") and not is_complete:
        raise _irregular(block, numbers)
    return kind, reason if "rows" in kind else ""


def _layouts(
    block: NumberBlock, numbers: Numbers, table: TableColumns, layout: TextLayout
) -> Iterator[tuple[str, int, str]]:
    """Yield the layouts of a block for which there is evidence, in the order of its strength, with
    the number of samples and the evidence; then raise the question for the layout."""
    stated, names, roles = table.stated, table.names, table.roles
    lines, total = numbers.sizes
    width = numbers.width
    # A column of line numbers is not a part of the samples.
    is_numbered = bool(roles.ignored) and width > 3
    rows, count = ("numbered rows", total - lines) if is_numbered else ("rows", total)
    by_values = f"the header states {count} samples, the number of values"
    if not numbers.is_regular:
        if total in stated.counts:
            yield "rows", total, by_values
        raise _irregular(block, numbers)
    if width == 1:
        yield "single", lines, ""
    if lines == 1:
        yield "rows", total, "the table has only one line"
    if roles.has_pairs:
        yield "pairs", total // 2, "the times in the table"
    if names:
        yield "columns", lines, "the names of the columns in the table"
    if roles.time is not None:
        yield "columns", lines, "the times in the table"
    if count in stated.counts:
        yield rows, count, by_values
    if stated.counts:
        yield "columns", lines, f"the header, which states {lines} samples, the number of lines"
    if len(roles.ignored) == width - 1:  # there is no choice
        yield "columns", lines, "the single column"
    found, evidence = continuity(numbers.table()[:, int(is_numbered) :])
    if found == "rows":
        yield rows, count, evidence
    if layout.rows:
        yield rows, count, "as specified by `rows`"
    # Rows of samples may have a shorter last line, columns may not.
    if layout.column or (found == "columns" and numbers.is_complete):
        yield "columns", lines, evidence
    reason = evidence or _NO_EVIDENCE.get(width, f"only {lines} lines")
    raise incomplete(
        f"the table that starts in line {block.line_numbers[0]} has {width} values per line, and "
        f"the file does not show ({reason}) whether each line continues one ground motion (specify "
        "`rows`) or each column is a separate ground motion (specify `column`)",
        table,
        layout,
        Missing(
            columns=tuple(str(i + 1) for i in range(width) if i not in roles.ignored), rows=True
        ),
    )


_NO_EVIDENCE = {2: "no times, no number of samples"}


def _check_count(stated: Statements, count: int, lines: int, total: int) -> None:
    """Raise RecordError if the header states other numbers of samples than `count`."""
    if stated.counts and count not in stated.counts:
        numbers = " or ".join(map(str, sorted(stated.counts)))
        values = "" if total == lines else f" with {total} values"
        raise RecordError(
            f"the header states {numbers} samples, but the table has {pluralize(lines, 'line')}"
            f"{values}; complete the file, or correct the number"
        )


def _irregular(block: NumberBlock, numbers: Numbers) -> RecordError:
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


def _names_and_header(
    blocks: Sequence[NumberBlock], numbers: Numbers, layout: TextLayout
) -> tuple[Names, list[str]]:
    """Return the names of the columns, and the other lines of text above the last block.

    A line of recognized names may be followed by other lines, such as their units. Arbitrary text
    names the columns only in the last line, if this line contains no other statement and the rows
    are separated in the same way.

    Raises
    ------
    RecordError
        A line of recognized names has another number of names than the rows.
    """
    block, width = blocks[-1], numbers.width
    above = [x for x in block.above if re.search(r"\w", x) and not _commented_row(x)]
    header = [line for earlier in blocks[:-1] for line in earlier.above]
    separator = block.separator
    for index in range(len(above) - 1, max(len(above) - 1 - _MAX_LINES_BELOW_NAMES, -1), -1):
        names = column_names(above[index], separator) or column_names(above[index])
        others = [*above[:index], *above[index + 1 :]]
        first = numbers.table()[:, 0] if numbers.is_regular else np.ones(1)
        # Names of rows are texts, which are zero here, or numbers of the rows.
        if len(names) == width - 1 > 0 and (counts_rows(first) or not np.any(first)):
            names = (ColumnName(OTHER), *names)  # the column of row names has no name
        if len(names) == width:
            units = above[index + 1 :]
            if len(units) == 1:
                names = with_units(names, units[0], separator) or names
            return names, header + others
        if len(names) > 1 and names[0].quantity == TIME and index == len(above) - 1:
            raise RecordError(
                f"the header of the table names {pluralize(len(names), 'column')}, but the rows "
                f"have {pluralize(width, 'value')}"
            )
    if width > 1 and above:
        for count in (2, 1):
            if names := _other_names(above[-count:], separator, numbers, layout):
                return names, header + above[:-count]
    return (), header + above


_MAX_LINES_BELOW_NAMES = 4  # lines between the names of the columns and the rows


def _other_names(
    lines: Sequence[str], separator: str, numbers: Numbers, layout: TextLayout
) -> Names:
    """Return the column names in the last line, or in the line before the last line and their units
    in the last line; empty if the lines do not name the columns.

    Words that are separated by blanks may be a sentence. They name the columns only if the column
    of a word for a time increases, or if the user selects a word or skips the lines above.
    """
    names = any_names(lines[0], separator, numbers.width)
    is_statement = bool(statements(lines[:1]) or declarations(lines[-1]))
    if len(lines) == 2:
        return () if is_statement else with_units(names, lines[1], separator)
    has_time = numbers.is_regular and any(
        axis(numbers.table()[:, index])
        for index, name in enumerate(names)
        if name.quantity == TIME or (name.units and name.units in SECONDS)
    )
    if not names or is_statement:
        accelerations = [name for name in names if name.quantity == "acceleration" and name.units]
        is_numbered = len(accelerations) == len(names) - 1 and bool(
            _NUMBER.fullmatch(names[0].plain)
        )
        return names if accelerations and (has_time or is_numbered) else ()
    is_sentence = not re.search(r"[,;\t]|\s{2,}", lines[0].strip())
    if is_sentence and (_SENTENCE.search(lines[0]) or has_pairs(numbers)):
        return ()
    is_selected = any(_has_name(names, column) for column in layout.column)
    is_named = not is_sentence or has_time or is_selected or bool(layout.skip_lines)
    return names if is_named else ()


_SENTENCE = any_case(r"\b(?:of|the|in|for|del?|series|history)\b")
"""Pattern of words that occur in titles, not in the names of columns."""

_NUMBER = re.compile(r"#|n|no\.?|nr\.?|number|index|i|row|line|points?|samples?|counts?")
"""Pattern of the name of a first column that numbers the lines."""


def _has_name(names: Names, column: str) -> bool:
    """Return True if a column that the user selects is a name, not a number."""
    return not column.isdecimal() and any(
        column.lower() in (name.text.lower(), name.plain) for name in names
    )
