"""Input tables: CSV files with a header.

Columns are accessed by name. The same checks apply to all tables, and errors state the line.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import chain, dropwhile, islice, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

from tdint.errors import ModelError, TdintError, nearest
from tdint.files import MOST_BYTES, STDIN, digest_of, is_file, read_whole, record_digest
from tdint.items import LazySequence
from tdint.number_parsing import LARGEST, SMALLEST, has_underflow, number_or_nan, pluralize

if TYPE_CHECKING:
    from tdint.arrays import Array

_LAST_ROW = "end"
"""Only cell of a row that is appended to each file. If a quotation mark is not closed, the parsed
rows do not contain this row.
"""

_SEPARATORS = "\t;,"
"""Separators of the cells of a table that is read completely: the most frequent of these in the
header, where names can contain the rest. With tabs and semicolons, a comma may be the decimal
point."""

_PROTECTED_TEXT = re.compile(r"'[=+@-]")
"""Start of a text that tdint protected from interpretation as a formula by a spreadsheet program:
an apostrophe before the text.
"""

BLOCK = 500
"""Number of rows of a large table that are converted to columns together. Each row is a list. The
number is below 700, because 700 new lists start Python's garbage collector, which is slow.
"""

_CHARACTERS_PER_READ = 2**18
"""Number of characters of a large table that are read together."""

_TRUE_TEXTS, _FALSE_TEXTS = ("true", "1", "yes"), ("false", "0", "no", "")

_END_OF_CELL = "\0"
"""Separator of the cells in a `TextColumn`. The readers below refuse it in files."""

_CELLS_PER_BLOCK = 50
"""Number of cells that are joined to a text (block) of a `TextColumn`. A separate text object
requires the memory of about 50 characters. Splitting a block to read a cell requires 1 us."""

_CELLS_PER_PART = 1000 * _CELLS_PER_BLOCK
"""Maximum number of cells of a `TextColumn` that are split to separate texts at the same time."""


@dataclass(frozen=True)
class CsvTable:
    """CSV file with a header. Upper and lower case in the names of columns are equivalent.

    The methods that return a column raise `error` if the table is invalid: the column is missing,
    there are no rows, or a row has more cells than the header has names.

    Attributes
    ----------
    source : str
        Name of the file as the user wrote it.
    header : tuple of str
        Names of the columns in lower case.
    titles : tuple of str
        Names of the columns as in the file.
    rows : tuple of (int, list of str)
        Line number and cells of each row. If a row has fewer cells than the header has names, the
        missing cells are empty.
    needs : str
        Description of a valid file, for messages.
    error : type
        Type of the exceptions that the methods raise.
    has_decimal_commas : bool
        True if the separator is a semicolon or a tab, and a comma is a decimal point.
    digest : str
        SHA-256 of the file; empty for a table with rows that are read on demand.
    """

    source: str
    header: tuple[str, ...]
    titles: tuple[str, ...]
    header_line: int
    rows: tuple[tuple[int, list[str]], ...]
    needs: str
    error: type[TdintError]
    has_decimal_commas: bool = False
    digest: str = ""

    def has(self, *names: str) -> bool:
        """Return True if the table has columns with all these names."""
        return all(name.lower() in self.header for name in names)

    def need(self, *names: str) -> None:
        """Raise an error that lists the missing columns, if any.

        The message does not contain the header, because the file may not be a table: the text of
        its first line may be confidential.
        """
        missing = [name for name in names if not self.has(name)]
        if missing:
            similar = nearest(missing[0], self.header)
            hint = self.needs
            if similar:
                hint = f"rename the column {similar!r} if it contains these values"
            raise self.error(
                f"{self.source}:{self.header_line}: no column {', '.join(missing)} among "
                f"{pluralize(len(self.header), 'column')}; {hint}"
            )

    def texts(self, name: str, *, empty: bool = True) -> list[str]:
        """Return the cells of a column as texts without surrounding blanks.

        Raise `self.error` if the column or all rows are missing, or if a row has too many cells.

        Parameters
        ----------
        empty : bool
            True (the default) to allow empty cells; otherwise an empty cell is an error.
        """
        self.need(name)
        if not self.rows:
            raise self.error(f"{self.source}: the table has no rows below its header; {self.needs}")
        index = self.header.index(name.lower())
        texts = []
        for line, cells in self.rows:
            # Refuse additional cells. A decimal comma (0,5), or a comma in a name without quotation
            # marks, splits a cell in two and shifts all cells to its right.
            if error := self.surplus(cells):
                raise self.error(
                    f"{self.source}:{line}: {error}; use decimal points, not commas, and quote "
                    "texts with commas"
                )
            # A row may omit empty cells at its end. An apostrophe at the start is removed, because
            # tdint writes it before texts that a spreadsheet program would treat as a formula.
            text = cells[index].strip() if index < len(cells) else ""
            text = text[1:] if _PROTECTED_TEXT.match(text) else text
            if not text and not empty:
                raise self.error(f"{self.source}:{line}: {name} is missing")
            texts.append(text)
        return texts

    def numbers(self, name: str, *, empty: bool = False, positive: bool = False) -> list[float]:
        """Return the cells of a column as finite numbers.

        Raise `self.error` if a cell is not a number.

        Parameters
        ----------
        empty : bool
            True to return nan for empty cells; by default they are errors.
        positive : bool
            True if only numbers above 0 are valid; false by default.
        """
        expected = "a positive number" if positive else "a number"
        numbers = []
        for line, text in self.lines(name, empty=empty):
            value = self.number(text)
            if text and (math.isnan(value) or (positive and value <= 0.0)):
                raise self.error(f"{self.source}:{line}: {name} {number_error(text, expected)}")
            numbers.append(value)
        return numbers

    def number(self, text: str) -> float:
        """Return the number in a cell, nan for another text. The decimal point may be a comma if
        commas do not separate the cells."""
        return number(text.replace(",", ".") if self.has_decimal_commas else text)

    def truths(self, name: str) -> list[bool]:
        """Return the cells of a column as bool; empty cells and a missing column are False.

        Raise `self.error` for a text other than true, 1, yes, false, 0 and no.
        """
        if not self.has(name):
            return [False] * len(self.rows)
        for line, text in self.lines(name):
            if text.lower() not in (*_TRUE_TEXTS, *_FALSE_TEXTS):
                raise self.error(
                    f"{self.source}:{line}: {name} must be true or false, got {text[:40]!r}"
                )
        return [text.lower() in _TRUE_TEXTS for text in self.texts(name)]

    def only(self, name: str) -> str:
        """Return the common value of all rows of a column.

        The result is empty if the column does not exist. Different values are an error.
        """
        if not self.has(name):
            return ""
        values = list(dict.fromkeys(self.texts(name)))
        if len(values) > 1:
            listed = ", ".join(values[:5])
            raise self.error(
                f"{self.source}: column {name} must have the same value in all rows, got {listed}; "
                "keep only the rows with one value"
            )
        return values[0]

    def check(self, name: str, valid: Iterable[bool], requirement: str) -> None:
        """Raise an error for the first row with an invalid cell.

        Parameters
        ----------
        valid : iterable of bool
            For each row, True if the cell is valid.
        requirement : str
            Requirement for the message, such as `must be positive`.
        """
        for is_valid, (line, text) in zip(valid, self.lines(name), strict=True):
            if not is_valid:
                raise self.error(f"{self.source}:{line}: {name} {requirement}, got {text[:40]!r}")

    def lines(self, name: str, *, empty: bool = True) -> Iterator[tuple[int, str]]:
        """Return the line number and the text of each cell of a column."""
        return zip((line for line, _ in self.rows), self.texts(name, empty=empty), strict=True)

    def distinct(self, name: str, noun: str) -> list[str]:
        """Return the texts of a column, and raise `self.error` if a text is empty or occurs twice.

        `noun` is the noun for the texts in messages.
        """
        lines: dict[str, int] = {}
        for line, text in self.lines(name, empty=False):
            if text in lines:
                raise self.error(
                    f"{self.source}:{line}: {noun} {text[:60]!r} is already on line {lines[text]}; "
                    "keep only one of these rows"
                )
            lines[text] = line
        return list(lines)

    def columns_of(self, rows: Sequence[list[str]]) -> list[tuple[str, ...]]:
        """Return the cells of rows by column. Missing cells at the end of a row are empty, surplus
        cells are omitted."""
        columns = list(islice(zip_longest(*rows, fillvalue=""), len(self.header)))
        return columns + [("",) * len(rows)] * (len(self.header) - len(columns))

    def surplus(self, cells: list[str]) -> str:
        """Return the error of a row with a cell to the right of the last column that is not empty;
        empty for any other row."""
        columns = len(self.header)
        if len(cells) <= columns or not any(map(str.strip, cells[columns:])):
            return ""
        return (
            f"the row has {pluralize(len(cells), 'cell')}, but the header has "
            f"{pluralize(columns, 'column')}"
        )


class TableHeader(NamedTuple):
    """Header of a table: number of its line, separator of the cells, and names of the columns."""

    line: int
    separator: str
    titles: list[str]


FindHeader = Callable[[Sequence[str]], TableHeader | None]
"""Function of the lines of a file that returns its header, or None for a file without a header."""


class TextColumn(LazySequence[str]):
    """Texts of a column of a large table.

    A million separate texts require about 60 MB. This class joins the texts to blocks, which
    require little more memory than their characters.
    """

    def __init__(self, texts: Iterable[str] = ()) -> None:
        self._joined: list[str] = []  # blocks of joined cells
        self._length = 0
        # Index and cells of the block that was split last; -1 before the first access
        self._split: tuple[int, list[str]] = (-1, [])
        remaining = iter(texts)
        while part := list(islice(remaining, _CELLS_PER_PART)):
            self.add(part)

    def add(self, texts: Sequence[str]) -> None:
        """Append texts, joined to blocks of 50.

        The number of texts must be a multiple of 50, except in the last call, because
        `make` computes the block from the index and all blocks before the last must be full.
        """
        assert self._length % _CELLS_PER_BLOCK == 0  # all previous blocks are full
        for first in range(0, len(texts), _CELLS_PER_BLOCK):
            self._joined.append(_END_OF_CELL.join(texts[first : first + _CELLS_PER_BLOCK]))
        self._length += len(texts)

    def __len__(self) -> int:
        return self._length

    def make(self, number: int) -> str:
        """Return the text of a cell."""
        block, cell = divmod(number, _CELLS_PER_BLOCK)
        # Successive accesses to a block split it only once. The tuple is replaced in a single
        # assignment, because several threads may read the column.
        split_block, cells = self._split
        if split_block != block:
            cells = self._joined[block].split(_END_OF_CELL)
            self._split = (block, cells)
        return cells[cell]

    def __iter__(self) -> Iterator[str]:
        return chain.from_iterable(joined.split(_END_OF_CELL) for joined in self._joined)

    def parts(self) -> Iterator[list[str]]:
        """Yield all texts as lists of at most `_CELLS_PER_PART` texts."""
        blocks = _CELLS_PER_PART // _CELLS_PER_BLOCK
        for first in range(0, len(self._joined), blocks):
            yield _END_OF_CELL.join(self._joined[first : first + blocks]).split(_END_OF_CELL)

    def numbers(self) -> Array:
        """Return all texts as numbers; nan for texts that `number` does not accept."""
        import numpy as np  # Imported here, because commands that read only models do not need it.

        return np.concatenate([np.empty(0), *map(numbers_in, self.parts())])


def number(text: str) -> float:
    """Return a cell as a number; nan for a text that is not a number, or is too small or large.

    The absolute value must be 0 or between `SMALLEST` and `LARGEST`.
    """
    value = _number_or_nan(text)
    return value if value == 0.0 or SMALLEST <= abs(value) <= LARGEST else math.nan


def numbers_in(texts: Sequence[str]) -> Array:
    """Return many cells as numbers; nan for cells that `number` does not accept."""
    import numpy as np  # Imported here, because commands that read only model files do not need it.

    joined, values = "".join(texts), np.empty(0)
    # Cells that are not numbers are rare. Without such cells all cells are converted together,
    # which is faster. If a cell is not a number, `float` raises ValueError, and each cell is
    # converted separately below. Cells with underscores or digits of other alphabets are also
    # converted separately, because `float` accepts them, but this function must not.
    with suppress(ValueError):
        if joined.isascii() and "_" not in joined:
            if "" in texts:
                values = np.array([float(text or math.nan) for text in texts])
            else:
                values = np.array(list(map(float, texts)))
            # Numbers that are too small for double precision have become 0.
            zeros = {texts[index] for index in np.flatnonzero(values == 0.0).tolist()}
            if any(map(has_underflow, zeros)):
                values = np.empty(0)
    if len(values) < len(texts):
        values = np.array([_number_or_nan(text) for text in texts])
    absolute_values = np.abs(values)
    is_within_limits = (absolute_values >= SMALLEST) & (absolute_values <= LARGEST)
    values[~((values == 0.0) | is_within_limits)] = math.nan
    return values


def number_error(text: str, expected: str) -> str:
    """Return the end of a message about an invalid number: `must be a number, got '1,5'`.

    Parameters
    ----------
    expected : str
        Requirement, such as `a positive number`.
    """
    message = f"must be {expected}, got {text[:40]!r}"
    # A finite number that `number` does not accept is outside the limits.
    if math.isfinite(_number_or_nan(text)) and math.isnan(number(text)):
        message += f"; the absolute value must be between {SMALLEST:g} and {LARGEST:g}"
    return message


def _number_or_nan(text: str) -> float:
    """Return a text as float; nan if it is not a number.

    Underscores and digits of other alphabets, which Python accepts, are refused.
    """
    return number_or_nan(text) if text.isascii() and "_" not in text else math.nan


def read_table(
    source: str,
    needs: str,
    *,
    columns: Collection[str] | None = None,
    comment: str = "",
    error: type[TdintError] = ModelError,
    find_header: FindHeader | None = None,
) -> CsvTable:
    """Read a CSV file (`-` is standard input) with a header.

    `needs` describes a valid file, for messages: `a target spectrum is a CSV file with the columns
    ...`. The names of the columns that will be read must be unique, by default all. `comment`
    contains the first characters of comment lines above the header, as in files of OpenQuake; empty
    if such lines are not allowed. The cells are separated by tabs, semicolons or commas
    (`_SEPARATORS`). `find_header` returns a header below titles or with another separator; if it
    returns None, the first line is the header.

    Raises
    ------
    TdintError
        The file cannot be read, is not a CSV file in UTF-8, is empty, or has two columns with the
        same name. The type is `error`.
    """
    table, rows = stream_table(
        source,
        needs,
        columns=columns,
        comment=comment,
        error=error,
        read_first=True,
        find_header=find_header,
    )
    return replace(table, rows=tuple(rows))


def stream_table(
    source: str,
    needs: str,
    *,
    columns: Collection[str] | None = None,
    comment: str = "",
    error: type[TdintError] = ModelError,
    read_first: bool = False,
    find_header: FindHeader | None = None,
) -> tuple[CsvTable, Iterator[tuple[int, list[str]]]]:
    """Open a CSV file with a header as by `read_table`, and read each row on demand without storing
    it. Return the table without rows, and the line number and cells of each row.

    With `read_first`, the bytes of the complete file are read before the first row; the size is
    limited to `MOST_BYTES`.

    Raises
    ------
    TdintError
        As by `read_table`. An error in a row is raised when the row is read.
    """
    # A pipe cannot be read again, but its digest and its rows are both needed. Therefore its
    # complete content is read into memory first.
    mark, digest = ",", ""
    found: TableHeader | None = None
    if read_first or source == STDIN or not is_file(source):
        data = _read_bytes(source, needs, error)
        lines = (line.decode("utf-8", "replace") for line in io.BytesIO(data))
        header_text = next(
            (t for t in lines if t.strip() and not (comment and t.startswith(comment))), ""
        )
        if read_first:
            marks = (mark for mark in _SEPARATORS if mark in header_text)
            mark = max(marks, key=header_text.count, default=",")
        if find_header and (found := find_header(data.decode("utf-8-sig", "replace").splitlines())):
            mark = found.separator
        digest = sha256(data).hexdigest()
        rows = _stream_rows(source, io.BytesIO(data), error, mark)
    else:
        record_digest(source, lambda: digest_of(Path(source)))
        rows = _stream_rows(source, io.BufferedReader(io.FileIO(source)), error)
    # The header is the first row that is not a comment line. `next` returns an empty row at the end
    # of the file.
    header_line, header = next(rows, (0, []))
    while comment and header and header[0].lstrip().startswith(comment):
        header_line, header = next(rows, (0, []))
    if found:
        header_line, header = found.line, found.titles
        rows = dropwhile(lambda row: row[0] <= header_line, rows)
    if not header:
        raise error(f"{source}: the file is empty; {needs}")
    titles = tuple(cell.strip() for cell in header)
    names = tuple(title.lower() for title in titles)
    for name in names if columns is None else columns:
        if name and names.count(name.lower()) > 1:
            raise error(
                f"{source}:{header_line}: the header contains the column {name} twice; rename or "
                "remove one of these columns"
            )
    table = CsvTable(source, names, titles, header_line, (), needs, error, mark != ",", digest)
    return table, rows


def read_rows(source: str, needs: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of each row of a CSV file without a header.

    Raises
    ------
    ModelError
        The file cannot be read; `needs` describes the file in the message.
    """
    yield from _stream_rows(source, io.BytesIO(_read_bytes(source, needs, ModelError)), ModelError)


def _stream_rows(
    source: str, stream: BinaryIO, error: type[TdintError], separator: str = ","
) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of each row of a CSV file, which is decoded in parts,
    because decoded text can require four bytes per character.

    `error` is the type of the exception that is raised if the file contains a null character or is
    not UTF-8 text.
    """
    with io.TextIOWrapper(stream, encoding="utf-8-sig", newline="") as file:

        def lines() -> Iterator[str]:
            """Yield the lines of the file, and raise an error for a null character."""
            lines_before = 0
            while block := file.readlines(_CHARACTERS_PER_READ):
                if "\0" in "".join(block):
                    numbered = enumerate(block, start=lines_before + 1)
                    line_number = next(number for number, line in numbered if "\0" in line)
                    raise error(
                        f"{source}:{line_number}: null character; save the file as UTF-8 text"
                    )
                yield from block
                lines_before += len(block)

        try:
            yield from _parse_rows(source, lines(), error, separator)
        except UnicodeDecodeError as decoding_error:
            byte = decoding_error.object[decoding_error.start]
            raise error(f"{source}: not UTF-8 text (byte 0x{byte:02x}); save it as UTF-8") from None


def _parse_rows(
    source: str, lines: Iterable[str], error: type[TdintError], separator: str
) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of each row that is not blank.

    If a quotation mark is not closed, all following rows are part of a single cell. The row
    `_LAST_ROW`, which is appended to the lines, detects this error: it is then missing.
    """
    # The line break before the appended row ends the last line of a file that has no line break.
    ended = chain(lines, ("\n", f"{_LAST_ROW}\n"))
    reader = csv.reader(ended, delimiter=separator, skipinitialspace=True)
    is_complete = False  # True if the appended row was read as a separate row
    previous_line = last_line = 0
    try:
        for row in reader:
            is_complete = row == [_LAST_ROW]
            if not is_complete and row and (row[0].strip() or any(map(str.strip, row))):
                previous_line, last_line = last_line, reader.line_num
                yield last_line, row
    except csv.Error as csv_error:
        raise error(f"{source}:{reader.line_num}: invalid CSV: {csv_error}") from None
    if not is_complete:
        # The last row that was read contains the quotation mark and all of the file that follows.
        # Only its last line is known, so the message names the row before it.
        raise error(f"{source}: a quotation mark below line {previous_line} is not closed")


def _read_bytes(source: str, needs: str, error: type[TdintError]) -> bytes:
    """Read a complete file, and record its digest as an input of the command. `error` is raised if
    the file cannot be read, or is larger than `MOST_BYTES`.
    """
    large = f"larger than {MOST_BYTES // 1024**2} MiB; {needs}"
    data = read_whole(
        source, error, {FileNotFoundError: f"file not found; {needs}"}, large, MOST_BYTES
    )
    record_digest(source, data)
    return data
