"""Tables given as CSV files with a header: columns by their names, one set of checks, every fault
with its line."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from tdint.errors import ModelError, TdintError, nearest
from tdint.files import MOST_BYTES, STDIN, digest_of, is_file, note_input, read_whole
from tdint.written_numbers import LARGEST, SMALLEST, how_many, number_or_nan

if TYPE_CHECKING:
    from tdint.arrays import Array

_END = "end"  # a last row of our own
_OF_A_TABLE = re.compile(r"'[=+@-]")
"""What tables put before a text that a spreadsheet would take for a formula."""

BLOCK = 500
"""Rows of a large table that are turned into columns together: fewer lists than wake Python's
collector (700)."""

_TRUE, _FALSE = ("true", "1", "yes"), ("false", "0", "no", "")


@dataclass(frozen=True)
class CsvTable:
    """A CSV file with a header; the names of its columns are compared without regard to case.

    Whoever asks for a column learns what is wrong with the table, as its `error`: there is no such
    column, there are no rows, or rows have more cells than the header has names.

    Attributes
    ----------
    source : str
        The file as the user named it.
    header : tuple of str
        The columns' names, in lower case.
    titles : tuple of str
        The same as they are written.
    header_line : int
        Where they stand.
    rows : tuple of (int, list of str)
        Line and cells of each row. There may be fewer cells than columns: the others are empty.
    needs : str
        What the file must be, for messages.
    error : type
        Of what is raised.
    """

    source: str
    header: tuple[str, ...]
    titles: tuple[str, ...]
    header_line: int
    rows: tuple[tuple[int, list[str]], ...]
    needs: str
    error: type[TdintError]

    def has(self, *names: str) -> bool:
        """Whether there are columns of all these names."""
        return all(name.lower() in self.header for name in names)

    def need(self, *names: str) -> None:
        """Raise an error that names all of these columns that are missing."""
        missing = [name for name in names if not self.has(name)]
        if missing:
            near = nearest(missing[0], self.header)
            there = f"there are {', '.join(self.header)[:200]}; {self.needs}"
            hint = f"did you mean it by {near!r}?" if near else there
            raise self.error(
                f"{self.source}:{self.header_line}: no column {', '.join(missing)}; {hint}"
            )

    def texts(self, name: str, *, empty: bool = True) -> list[str]:
        """The cells of a column; without `empty` none of them may be."""
        self.need(name)
        if not self.rows:
            raise self.error(f"{self.source}: has no rows below its header; {self.needs}")
        place = self.header.index(name.lower())
        texts = []
        for line, cells in self.rows:
            # A decimal comma, or a name with a comma in it, would shift all cells behind it.
            if self.overfull(cells):
                raise self.error(
                    f"{self.source}:{line}: {how_many(len(cells), 'cell')} under "
                    f"{how_many(len(self.header), 'column')}"
                )
            # Empty cells at the end of a row may be left out; our own tables put an apostrophe
            # before a formula.
            text = cells[place].strip() if place < len(cells) else ""
            text = text[1:] if _OF_A_TABLE.match(text) else text
            if not text and not empty:
                raise self.error(f"{self.source}:{line}: {name} is missing")
            texts.append(text)
        return texts

    def numbers(self, name: str, *, empty: bool = False, positive: bool = False) -> list[float]:
        """The cells of a column as finite numbers; with `empty` nan for a cell without one."""
        expected = "a positive number" if positive else "a number"
        numbers = []
        for line, text in self.lines(name, empty=empty):
            value = number(text)
            if text and (math.isnan(value) or (positive and value <= 0.0)):
                raise self.error(f"{self.source}:{line}: {name} {no_number(text, expected)}")
            numbers.append(value)
        return numbers

    def truths(self, name: str) -> list[bool]:
        """The cells of a column of true and false; false where there is no such column."""
        if not self.has(name):
            return [False] * len(self.rows)
        for line, text in self.lines(name):
            if text.lower() not in (*_TRUE, *_FALSE):
                raise self.error(
                    f"{self.source}:{line}: {name} must be true or false, got {text[:40]!r}"
                )
        return [text.lower() in _TRUE for text in self.texts(name)]

    def only(self, name: str) -> str:
        """What stands in all rows of a column; nothing where there is no such column."""
        if not self.has(name):
            return ""
        values = list(dict.fromkeys(self.texts(name)))
        if len(values) > 1:
            several = ", ".join(values[:5])
            raise self.error(
                f"{self.source}: column {name} has several values, {several}: leave the rows of one"
            )
        return values[0]

    def check(self, name: str, sound: Iterable[bool], must: str) -> None:
        """Raise an error for the first row whose cell is not sound."""
        for is_sound, (line, text) in zip(sound, self.lines(name), strict=True):
            if not is_sound:
                raise self.error(f"{self.source}:{line}: {name} {must}, got {text[:40]!r}")

    def lines(self, name: str, *, empty: bool = True) -> Iterator[tuple[int, str]]:
        """The lines of a column's cells, and the cells."""
        return zip((line for line, _ in self.rows), self.texts(name, empty=empty), strict=True)

    def overfull(self, cells: list[str]) -> bool:
        """Whether something stands in cells of a row that no column is above."""
        return any(cell.strip() for cell in cells[len(self.header) :])


def number(text: str) -> float:
    """A cell as a number that can be computed with; nan if it is none."""
    value = _float(text)
    return value if value == 0.0 or SMALLEST <= abs(value) <= LARGEST else math.nan


def numbers_in(texts: Sequence[str]) -> Array:
    """The same of many cells."""
    import numpy as np  # a model file is read without

    together, values = "".join(texts), np.empty(0)
    # Words are rare: of numbers alone many are read at once.
    with suppress(ValueError):
        if together.isascii() and "_" not in together:
            values = np.array(
                [float(text or math.nan) for text in texts]
                if "" in texts
                else list(map(float, texts))
            )
    if len(values) < len(texts):
        values = np.array([_float(text) for text in texts])
    size = np.abs(values)
    values[~((values == 0.0) | ((size >= SMALLEST) & (size <= LARGEST)))] = math.nan
    return values


def no_number(text: str, expected: str) -> str:
    """What a cell must be that is no such number, as the end of a message."""
    # Only of a finite number the size can be what is wrong with it.
    limits = (
        f"; its size must lie between {SMALLEST:g} and {LARGEST:g}"
        if math.isfinite(_float(text))
        else ""
    )
    return f"must be {expected}, got {text[:40]!r}{limits if math.isnan(number(text)) else ''}"


def _float(text: str) -> float:
    """As Python writes numbers, but for its underscores and other alphabets' digits; nan for
    words."""
    return number_or_nan(text) if text.isascii() and "_" not in text else math.nan


def read_table(
    source: str,
    needs: str,
    *,
    columns: Collection[str] | None = None,
    comment: str = "",
    error: type[TdintError] = ModelError,
) -> CsvTable:
    """Read a CSV file with a header.

    Parameters
    ----------
    source : str
        The file; `-` is standard input.
    needs : str
        What it must be, for messages: `a target spectrum is a CSV file with the columns ...`.
    columns : collection of str, optional
        Those that will be asked for, no two of one name; all if it is not given.
    comment : str
        What a line above the header begins with that is none, as in OpenQuake's files; nothing for
        no such lines.
    error : type
        The error of this kind of file; by default the one of models.

    Raises
    ------
    TdintError
        Of that type: it cannot be read, is no CSV file in UTF-8, is empty, or two columns have one
        name.
    """
    table, rows = stream_table(
        source, needs, columns=columns, comment=comment, error=error, whole=True
    )
    return replace(table, rows=tuple(rows))


def stream_table(
    source: str,
    needs: str,
    *,
    columns: Collection[str] | None = None,
    comment: str = "",
    error: type[TdintError] = ModelError,
    whole: bool = False,
) -> tuple[CsvTable, Iterator[tuple[int, list[str]]]]:
    """The same of a table of millions of rows, which are read as they are asked for: the table
    without its rows, and these with their lines. Errors are those of `read_table`, of the rows when
    these are read; with `whole`, of a file that is too large at once."""
    # A pipe can be read once only: its digest is that of what was read.
    if whole or source == STDIN or not is_file(source):
        rows = _rows(source, io.StringIO(_text(source, needs, error), newline=""), error)
    else:
        note_input(source, lambda: digest_of(Path(source)))
        rows = _streamed(source, error)
    # The header, and what stands above it, are taken from the rows.
    header_line, header = next(rows, (0, []))
    while comment and header and header[0].lstrip().startswith(comment):
        header_line, header = next(rows, (0, []))
    if not header:
        raise error(f"{source}: is empty; {needs}")
    titles = tuple(cell.strip() for cell in header)
    names = tuple(title.lower() for title in titles)
    for name in names if columns is None else columns:
        if name and names.count(name.lower()) > 1:
            raise error(f"{source}:{header_line}: the column {name} is there twice")
    return CsvTable(source, names, titles, header_line, (), needs, error), rows


def _streamed(source: str, error: type[TdintError]) -> Iterator[tuple[int, list[str]]]:
    """The rows of a file."""
    with Path(source).open(encoding="utf-8-sig", newline="") as file:

        def lines() -> Iterator[str]:
            for number, line in enumerate(file, start=1):
                if "\0" in line:
                    raise error(f"{source}:{number}: a null character; save it as UTF-8 text")
                yield line

        try:
            yield from _rows(source, lines(), error)
        except UnicodeDecodeError as fault:
            byte = fault.object[fault.start]
            raise error(f"{source}: not UTF-8 text (byte 0x{byte:02x}); save it as UTF-8") from None


def _rows(
    source: str, lines: Iterable[str], error: type[TdintError]
) -> Iterator[tuple[int, list[str]]]:
    """The rows that are not blank, and their lines.

    A quotation mark that is never closed would take all rows below it into one cell: the last row
    tells.
    """
    reader, above, closed = (
        csv.reader(chain(lines, ("\n", f"{_END}\n")), skipinitialspace=True),
        0,
        False,
    )
    last = 0
    try:
        for row in reader:
            closed = row == [_END]
            if not closed and any(map(str.strip, row)):
                above, last = last, reader.line_num
                yield last, row
    except csv.Error as fault:
        raise error(f"{source}:{reader.line_num}: no CSV: {fault}") from None
    if not closed:
        raise error(f"{source}: a quotation mark below line {above} is not closed")


def _text(source: str, needs: str, error: type[TdintError]) -> str:
    large = f"larger than {MOST_BYTES // 1024**2} MiB; {needs}"
    data = read_whole(
        source, error, {FileNotFoundError: f"no such file; {needs}"}, large, MOST_BYTES
    )
    note_input(source, data)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise error(
            f"{source}: not UTF-8 text (byte 0x{data[fault.start]:02x}); save it as UTF-8"
        ) from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise error(f"{source}:{line}: a null character; save it as UTF-8 text")
    return text
