"""Rows of numbers in the text of a table, converted to a common form from the forms of programs.

A row may end with separators, a backslash or a bracket (lists of Tcl, Python and MATLAB), may be
enclosed in quotation marks, and may contain cells with dates, times of day or words. The rows that
this module reads contain only numbers and single separators. A line keeps its number, and a column
its position:

- separators at the end of a row, and rows that consist of separators, are omitted;
- a column of times of day becomes a column of seconds if its times increase;
- any other column of text, and a column of empty cells, is listed in `TableText.ignored`.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import date
from itertools import islice, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.formats.header_statements import named_integrals
from tdint.ground_motion.formats.lines import Lines, TextLines, row_of_numbers
from tdint.ground_motion.formats.table_columns import COMMENT

_MAX_HEADER_LINE = 1000  # characters of a line of text that are searched for statements

_NUMBERS = b"-+.0123456789Ee \n"  # characters of numbers that NumPy reads
_CHARACTERS = re.compile(r"[-+.,;\dEeDd\s*]*")
"""Characters of rows of numbers. Fortran writes asterisks for a number that exceeds its field. The
pattern is fast also for a line of a million characters."""

_DIGIT = re.compile(r"\d")
_DECIMAL = re.compile(r"[-+]?(?:\d+\.\d*|\.\d+)(?:[EeDd][-+]?\d+)?")
_EMPTY_CELL = re.compile(r"[,;]\s*[,;]")
_TABS = re.compile(r"[ ]*\t[\t ]*")
_LIST_MARKS = str.maketrans(dict.fromkeys('{}[]()\\&"', " "))
"""Characters around and between the rows of a list, without meaning for its numbers."""

_LIST_MARK = re.compile(r'[{}\[\]()\\&"]|\.\.\.\s*$')
_SEPARATORS = ",;\t"
_ROW_ENDS = (b",", b";", b"\t", b" ")  # separators at the end of a row, which are removed
_BLANKS = " \t\r,;"  # characters of a row without cells, and at the end of a row
_FIRST_LINES = 50  # lines that are compared with the form of the first lines


@dataclass
class NumberBlock:
    """Consecutive lines of numbers. `above` is the text between the preceding block and this block;
    `after_blank` contains the indices of lines that follow a blank line."""

    above: list[str]
    lines: Sequence[str] = field(default_factory=list)
    line_numbers: Sequence[int] = field(default_factory=list)
    after_blank: list[int] = field(default_factory=list)

    @property
    def text(self) -> TextLines:
        """Lines of the block as one text."""
        if isinstance(self.lines, TextLines):
            return self.lines
        return TextLines("\n".join(self.lines).encode())

    @property
    def characters(self) -> int:
        """Size of the block; unlike the number of values, it does not require parsing."""
        return sum(map(len, self.text.parts()))

    @property
    def separator(self) -> str:
        """Separator of the cells: semicolon, tab, comma or blank."""
        return next((mark for mark in ";\t," if mark in self.lines[-1].strip()), " ")

    @property
    def first_words(self) -> list[list[str]]:
        """Texts of the numbers in the first lines, which are compared with the other lines."""
        return [re.split(r"[\s,;]+", line.strip(_BLANKS)) for line in self.lines[:_FIRST_LINES]]

    def part(self, start: int, end: int | None = None) -> NumberBlock:
        """Return the lines from index `start` up to index `end`."""
        if not start and end is None:
            return self
        return NumberBlock(
            self.above,
            self.lines[start:end],
            self.line_numbers[start:end],
            [index - start for index in self.after_blank if start < index < (end or np.inf)],
        )


@dataclass(frozen=True)
class Numbers:
    """Values of a block in the order of the file, and the number of values in each line."""

    values: Array
    widths: NDArray[np.signedinteger[Any]]

    @property
    def width(self) -> int:
        """Most frequent number of values per line."""
        if np.all(self.widths == self.widths[0]):
            return int(self.widths[0])
        return int(Counter(self.widths.tolist()).most_common(1)[0][0])

    @property
    def is_regular(self) -> bool:
        """True if all lines have the same number of values, except for a shorter last line."""
        return bool(
            np.all(self.widths[:-1] == self.widths[0]) and self.widths[-1] <= self.widths[0]
        )

    @property
    def is_complete(self) -> bool:
        """True if the last line has as many values as most lines."""
        return int(self.widths[-1]) == self.width

    @property
    def sizes(self) -> tuple[int, int]:
        """Number of lines and of values."""
        return self.widths.size, self.values.size

    @property
    def line_ends(self) -> NDArray[np.signedinteger[Any]]:
        """Index after the last value of each line, with 0 before the first line."""
        return np.concatenate(([0], np.cumsum(self.widths)))

    def part(self, start: int, end: int | None = None) -> Numbers:
        """Return the numbers of the lines from index `start` up to index `end`."""
        first, count = int(np.sum(self.widths[:start])), int(np.sum(self.widths[start:end]))
        return Numbers(self.values[first : first + count], self.widths[start:end])

    def without_first(self) -> Numbers:
        """Return the numbers without the first number of each line."""
        return Numbers(np.delete(self.values, self.line_ends[:-1]), self.widths - 1)

    def without_last(self) -> Numbers:
        """Return the numbers without the last number of each line."""
        return Numbers(np.delete(self.values, self.line_ends[1:] - 1), self.widths - 1)

    def table(self) -> Array:
        """Return the complete lines of a regular block, shape (lines, values per line)."""
        width = int(self.widths[0])
        return self.values[: self.values.size // width * width].reshape(-1, width)


@dataclass(frozen=True)
class TableText:
    """Blocks of numbers of a text, and the text below the last block.

    Attributes
    ----------
    ignored : frozenset of int
        Indices of the columns of text, which are zero in the blocks.
    """

    blocks: list[NumberBlock]
    below: list[str]
    ignored: frozenset[int] = frozenset()

    @property
    def main(self) -> int:
        """Index of the first block that is about as large as the largest block."""
        if len(self.blocks) == 1:
            return 0
        largest = max(block.characters for block in self.blocks)
        return next(
            index
            for index, block in enumerate(self.blocks)
            if block.characters >= _SIMILAR_SIZE * largest
        )


_SIMILAR_SIZE = 0.9  # fraction of the largest block; the first such block is the main block


def table_text(lines: Lines) -> TableText:
    """Divide the remaining lines of a file into text and blocks of numbers."""
    first = lines.number + 1
    texts = lines.remaining()
    texts, ignored = _without_text_columns(texts)
    blocks: list[NumberBlock] = []
    above: list[str] = []
    block: NumberBlock | None = None
    rows: list[str] = []  # lines of the block
    numbers: list[int] = []
    is_after_blank = False
    for number, text in enumerate(texts, start=first):
        if block is not None and len(rows) == _FIRST_LINES and not is_after_blank:
            # The remaining lines of most files are rows in the usual form, without text.
            rest, start = texts[number - first :], numbers[0]
            if _are_plain_rows(rest):
                if [*texts[start - first : number - first]] == rows:
                    block.lines = texts[start - first :]
                    block.line_numbers = range(start, number + len(rest))
                else:
                    rows += rest
                    numbers += range(number, number + len(rest))
                break
        line = text.rstrip(_BLANKS)
        if not line:
            is_after_blank = True
            continue
        if _is_row(line) and not line.endswith("..."):
            row, title = line, ""
        else:
            row, title = _row_of_list(line)
        if title:
            above.append(title)
            block = None
        if row:
            if block is None:
                rows, numbers = [], []
                block = NumberBlock(above, rows, numbers)
                blocks.append(block)
                above = []
            elif is_after_blank:
                block.after_blank.append(len(rows))
            rows.append(row)
            numbers.append(number)
        elif not title and (block is None or not _is_remark(line)):
            block = None
            above.append(line[:_MAX_HEADER_LINE])
        is_after_blank = False
    return TableText(blocks, above, ignored)


_DIGITS_AS_ZEROS = bytes.maketrans(b"123456789", b"000000000")


def _are_plain_rows(lines: TextLines) -> bool:
    """Return True if all lines are rows of numbers that need no change: each has a digit, and none
    ends with a separator."""
    characters = _NUMBERS + b",;\tDd"
    for part in lines.parts():
        text = part + b"\n"
        if text.translate(None, characters) or any(mark + b"\n" in text for mark in _ROW_ENDS):
            return False
        # Each line is now its digits, as zeros.
        if b"\n\n" in b"\n" + text.translate(_DIGITS_AS_ZEROS, b"-+.Ee ,;\tDd"):
            return False
    return True


def _is_row(line: str) -> bool:
    """Return True if a line contains only numbers, or numbers and asterisks of a lost number."""
    if not _CHARACTERS.fullmatch(line):
        return False
    if "*" in line:
        # A title such as *** 12 *** is no row.
        return "***" in line and bool(_DECIMAL.search(line) or line.lstrip()[0].isdecimal())
    return bool(_DIGIT.search(line))


def _is_remark(line: str) -> bool:
    """Return True if a line within a block is a comment that names no other quantity, or contains
    only the marks of a list."""
    if not line.translate(_LIST_MARKS).strip(_BLANKS):
        return True
    return bool(COMMENT.fullmatch(line)) and not named_integrals([line])


def _row_of_list(line: str) -> tuple[str, str]:
    """Return the numbers in a line of a list, and the text that precedes them; both are empty if
    the line is not a part of a list.

    `set ag { 0.1 0.2 \\` has the text `set ag` and the numbers 0.1 and 0.2.
    """
    if not _LIST_MARK.search(line):
        return "", ""
    title, mark, rest = line, "", ""
    if opening := re.search(r"[{\[(]", line):
        title, mark, rest = line[: opening.start()], opening[0], line[opening.end() :]
    for text, words in ((line, ""), (rest, title)) if mark else ((line, ""),):
        row = re.sub(r"\.\.\.\s*$", " ", text).translate(_LIST_MARKS).rstrip(_BLANKS)
        # A number in brackets after text, such as `Depth (24.5)`, is not a list.
        is_list = not words.strip() or (
            "." in row
            and (not re.search(r"[)\]}]", text) or (re.search(r"\S[\s,;]+\S", row) and mark != "("))
        )
        if row and is_list and _is_row(row):
            return row, words.strip()[:_MAX_HEADER_LINE]
    return "", ""


# ---- Columns of text

_CELLS_PER_SAMPLE = 400  # lines that are examined to find columns of text
_MIN_TEXT_ROWS = 5  # rows with text and numbers; fewer rows are a header
_MIN_NUMERIC = 0.9  # fraction of the rows where a column of numbers contains a number
_DATE = re.compile(r"(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})")
_CLOCK = re.compile(r"(?:(\d{1,2}):)?(\d{1,2}):(\d{1,2}(?:[.,]\d+)?)")
_QUOTES = " \t\"'"


def _without_text_columns(texts: TextLines) -> tuple[TextLines, frozenset[int]]:
    """Return the lines of a table with numbers instead of the cells of text columns, and the
    indices of the columns that are not a time.

    Lines without such cells are unchanged, and also all lines if the table has no text columns.
    """
    # A table of numbers has more rows than other lines; its lines are not examined further.
    filled = (text for text in reversed(texts) if text.strip(_BLANKS))
    sample = [*islice(filled, _CELLS_PER_SAMPLE)][::-1]
    rows = [row for row in map(split_cells, sample) if len(row) > 1]
    if 2 * sum(_is_plain_row(text) for text in sample) >= len(sample) or not rows:
        return texts, frozenset()
    width = Counter(map(len, rows)).most_common(1)[0][0]
    rows = [row for row in rows if len(row) == width]
    numeric = [
        np.mean([_is_number(row[index]) for row in rows]) >= _MIN_NUMERIC for index in range(width)
    ]
    columns = [index for index in range(width) if numeric[index]]
    is_table = len(rows) >= _MIN_TEXT_ROWS and 2 * len(rows) >= len(sample)
    if not is_table or not columns or all(numeric):
        return texts, frozenset()
    all_cells = [split_cells(text) for text in texts]
    indices = [
        index
        for index, cells in enumerate(all_cells)
        if len(cells) == width and all(_is_number(cells[column]) for column in columns)
    ]
    text_columns = [column for column in range(width) if not numeric[column]]
    seconds = _seconds([[all_cells[index][column] for column in text_columns] for index in indices])
    # The last column with the time of day contains the times.
    time_column = text_columns[-1] if seconds is not None else None
    result = list(texts)
    for row, index in enumerate(indices):
        cells = all_cells[index]
        for column in text_columns:
            is_time = seconds is not None and column == time_column
            cells[column] = f"{seconds[row]:.6f}" if is_time and seconds is not None else "0"
        result[index] = ";".join(cell.strip(_QUOTES) for cell in cells)
    rows_of_numbers = TextLines("\n".join(result).encode())
    return rows_of_numbers, frozenset(text_columns) - {
        time_column if time_column is not None else -1
    }


def _is_plain_row(text: str) -> bool:
    """Return True if a line is a row of numbers without empty cells."""
    row = text.rstrip(_BLANKS)
    return (_is_row(row) and not _EMPTY_CELL.search(row)) or bool(_row_of_list(row)[0])


def split_cells(text: str) -> list[str]:
    """Return the cells of a line, separated by its first separator other than a blank."""
    line = text.rstrip(_BLANKS)
    mark = next((mark for mark in ";\t," if mark in line), None)
    return line.split(mark)


def _is_number(cell: str) -> bool:
    """Return True if a cell contains one number."""
    with suppress(ValueError):
        return len(row_of_numbers(cell.strip(_QUOTES).replace(",", "."))) == 1
    return False


def _seconds(rows: Sequence[Sequence[str]]) -> list[float] | None:
    """Return the times of day in rows of text cells, s from the first row; None if a row has no
    time, or if the times do not increase."""
    moments = []
    for cells in rows:
        text = " ".join(cells)
        day = _DATE.search(text)
        clock = _CLOCK.search(text.replace(day[0], " ") if day else text)
        if not clock:
            return None
        hours, minutes, seconds = (
            float((part or "0").replace(",", ".")) for part in clock.groups()
        )
        days = 0
        if day:
            with suppress(ValueError):
                days = date(*map(int, day.groups())).toordinal()
        moments.append((days, 3600.0 * hours + 60.0 * minutes + seconds))
    if len(moments) < _MIN_TEXT_ROWS:
        return None
    first_day, first = moments[0]
    times = [86400.0 * (day - first_day) + (moment - first) for day, moment in moments]
    if not first_day:  # A time of day without a date starts again at midnight.
        nights = np.cumsum(np.diff(times, prepend=0.0) < 0.0)
        times = [moment + 86400.0 * night for moment, night in zip(times, nights, strict=True)]
    return times if all(a < b for a, b in pairwise(times)) else None


# ---- Numbers of a block


def block_numbers(block: NumberBlock) -> Numbers:
    """Return the numbers of a block.

    Raises
    ------
    RecordError
        A cell is empty, or a line cannot be separated into numbers.
    """
    if numbers := _plain_numbers(block.text):
        return numbers
    rows = [_row(line) for line in block.lines]
    if not all(rows) and (width := _field_width(block.lines)):
        # Numbers that fill their fields follow each other without a blank.
        rows = [row or _row(line, width) for row, line in zip(rows, block.lines, strict=True)]
    for row, line, number in zip(rows, block.lines, block.line_numbers, strict=True):
        if not row:
            reason = "must contain numbers"
            if "***" in line:
                reason = "has a number that exceeds its field (***), so that a sample is lost"
            elif _EMPTY_CELL.search(_TABS.sub(";", line)) or line.lstrip(" ")[:1] in _SEPARATORS:
                reason = "must contain numbers, but a cell is empty"
            raise RecordError(
                f"line {number} {reason}, got {line.strip()[:60]!r}; correct the file"
            )
    values = np.array([value for row in rows for value in row])
    return Numbers(values, np.array(list(map(len, rows))))


def _plain_numbers(lines: TextLines) -> Numbers | None:
    """Return the numbers of rows that contain only numbers and separators, as most files do; None
    for other rows."""
    marks = [mark for mark in _MARKS if any(mark in part for part in lines.parts())]
    # Several tabs separate two cells if all rows have the same number of cells.
    has_empty_cells = any(b"\t\t" in part for part in lines.parts()) and (
        len({len(line.split()) for line in lines}) > 1
    )
    found = []
    for part in lines.parts():
        numbers = _numbers_of(_with_blanks(part, marks, has_empty_cells))
        if numbers is None:
            return None
        found.append(numbers)
    values, widths = map(np.concatenate, zip(*found, strict=True))
    return Numbers(values, widths)


def _numbers_of(text: bytes) -> tuple[Array, NDArray[np.intp]] | None:
    """Return the numbers of lines of words, and their number in each line; None if a word is not a
    number."""
    if text.translate(None, _NUMBERS + b"\t\r\v\f"):
        return None
    codes = np.frombuffer(text, np.uint8)
    is_character = np.concatenate([[False], codes > ord(" "), [False]])
    changes = np.flatnonzero(is_character[1:] != is_character[:-1])
    starts, ends = changes[::2], changes[1::2]
    line_ends = np.append(np.flatnonzero(codes == ord("\n")), codes.size)
    per_line = np.diff(np.searchsorted(starts, line_ends), prepend=0)
    with warnings.catch_warnings(), suppress(DeprecationWarning, ValueError):
        warnings.simplefilter("error", DeprecationWarning)
        values = _decimal_values(text, starts, ends)
        # NumPy also accepts numbers without a separator, which changes their count.
        values = np.fromstring(text, sep=" ") if values is None else values
        return (values, per_line) if values.size == starts.size else None
    return None


def _decimal_values(text: bytes, starts: NDArray[np.intp], ends: NDArray[np.intp]) -> Array | None:
    """Return the value of each word if all have the form 1.25, or all have the form 1.25E-02; None
    for other forms.

    The digits without the point are converted as whole numbers, in a quarter of the time. The
    quotient or product of two numbers that are exact as floats is rounded once, as the conversion
    of the text (Clinger 1990).
    """
    codes = np.frombuffer(text, np.uint8)
    points = np.flatnonzero(codes == ord("."))
    marks = np.flatnonzero((codes | 0x20) == ord("e"))
    has_exponents = marks.size > 0
    digit_ends = marks if has_exponents else ends
    if not points.size == digit_ends.size == starts.size or not np.all(
        (starts <= points) & (points < digit_ends) & (digit_ends <= ends)
    ):
        return None
    is_sign = (codes == ord("-")) | (codes == ord("+"))
    signs = np.count_nonzero(is_sign[starts])
    if has_exponents:
        signs += np.count_nonzero(is_sign[np.minimum(marks + 1, codes.size - 1)])
    if (
        signs != np.count_nonzero(is_sign)
        or np.max(digit_ends - starts, initial=0) > _MAX_DIGITS + 1
    ):
        return None
    whole = np.fromstring(text.translate(_WITHOUT_EXPONENT, b"."), dtype=np.int64, sep=" ")
    if whole.size != starts.size * (1 + has_exponents):
        return None
    powers = points + 1 - digit_ends
    if has_exponents:
        powers += whole[1::2]
        whole = whole[::2]
    if np.max(np.abs(powers), initial=0) >= _POWERS.size:
        return None
    factors = _POWERS[np.abs(powers)]
    values: Array = np.where(powers < 0, whole / factors, whole * factors)
    values[(whole == 0) & (codes[starts] == ord("-"))] = -0.0
    return values


_MARKS = (b",", b";", b"\t")  # separators other than blanks
_MAX_DIGITS = 15  # digits of a whole number that is exact as a float
_POWERS = 10.0 ** np.arange(23)  # powers of ten that are exact as floats
_WITHOUT_EXPONENT = bytes.maketrans(b"Ee", b"  ")


def _with_blanks(text: bytes, marks: Sequence[bytes], has_empty_cells: bool) -> bytes:
    """Return the text of rows with blanks instead of the separators `marks` and points instead of
    decimal commas; separators and commas remain if a cell is empty."""
    text = text.replace(b"D", b"E")
    if b"\t" in marks:
        if has_empty_cells:
            return text
        text = text.replace(b"\t", b" ")
    if b";" in marks or (b"," in marks and b"\t" not in marks):
        marked = b"\n" + text.translate(None, b" \t\r\v\f")
        before = (*marks, b"\n")
        if any(
            first + mark in marked for mark in (b",", b";") if mark in marks for first in before
        ):
            return text
        if b",\n" in marked or b";\n" in marked:
            return text
        text = text.replace(b";", b" ")
    if b"," in marks:
        # If the separator is a semicolon or a tab, a comma is a decimal point.
        text = text.replace(b",", b"." if len(marks) > 1 else b" ")
    return text


def _row(line: str, width: int | None = None) -> list[float]:
    """Return the numbers in a line; empty if a cell is empty or has other text. `width` is the
    number of characters of fields without separators."""
    text = line.strip()
    mark = next((mark for mark in ";\t," if mark in text), None)
    if mark is not None:
        cells = text.split(mark)
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
