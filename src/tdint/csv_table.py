"""Tables given as CSV files with a header: columns by their names, one set of checks, every fault with its line."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from tdint.errors import ModelError, TdintError, nearest
from tdint.files import MOST_BYTES, STDIN, note_input, read_at_most
from tdint.written_numbers import LARGEST, SMALLEST, how_many

_END = "end"  # a last row of our own
_OF_A_TABLE = re.compile(r"'[=+@-]")
"""What tables put before a text that a spreadsheet would take for a formula."""

_TRUE, _FALSE = ("true", "1", "yes"), ("false", "0", "no", "")


@dataclass(frozen=True)
class CsvTable:
    """A CSV file with a header; the names of its columns are compared without regard to case.

    Whoever asks for a column learns what is wrong with the table, as its `error`: there is no such column, there are no
    rows, or rows have more cells than the header has names.

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
            raise self.error(f"{self.source}:{self.header_line}: no column {', '.join(missing)}; {hint}")

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
                    f"{self.source}:{line}: {how_many(len(cells), 'cell')} under {how_many(len(self.header), 'column')}"
                )
            # Empty cells at the end of a row may be left out; our own tables put an apostrophe before a formula.
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
                raise self.error(f"{self.source}:{line}: {name} must be true or false, got {text[:40]!r}")
        return [text.lower() in _TRUE for text in self.texts(name)]

    def only(self, name: str) -> str:
        """What stands in all rows of a column; nothing where there is no such column."""
        if not self.has(name):
            return ""
        values = list(dict.fromkeys(self.texts(name)))
        if len(values) > 1:
            several = ", ".join(values[:5])
            raise self.error(f"{self.source}: column {name} has several values, {several}: leave the rows of one")
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


def no_number(text: str, expected: str) -> str:
    """What a cell must be that is no such number, as the end of a message."""
    # Only of a finite number the size can be what is wrong with it.
    limits = f"; its size must lie between {SMALLEST:g} and {LARGEST:g}" if math.isfinite(_float(text)) else ""
    return f"must be {expected}, got {text[:40]!r}{limits if math.isnan(number(text)) else ''}"


def _float(text: str) -> float:
    """As Python writes numbers, but for its underscores and other alphabets' digits; nan for words."""
    try:
        return float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        return math.nan


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
        What a line above the header begins with that is none, as in OpenQuake's files; nothing for no such lines.
    error : type
        The error of this kind of file; by default the one of models.

    Raises
    ------
    TdintError
        Of that type: it cannot be read, is no CSV file in UTF-8, is empty, or two columns have one name.
    """
    lines = iter(_lines(source, _text(source, needs, error), error))
    table = _headed(source, needs, lines, columns, comment, error)
    return replace(table, rows=tuple(lines))


def stream_table(
    source: str, needs: str, *, columns: Collection[str], comment: str = "", error: type[TdintError] = ModelError
) -> tuple[CsvTable, Iterator[tuple[int, list[str]]]]:
    """The same of a table of millions of rows, which are read as they are asked for: the table without its rows, and
    these with their lines. Errors are those of `read_table`, of the rows when these are read."""
    # A pipe can be read once only: its digest is that of what was read.
    if source == STDIN or not Path(source).is_file():
        whole = read_table(source, needs, columns=columns, comment=comment, error=error)
        return replace(whole, rows=()), iter(whole.rows)
    note_input(source, lambda: _digest(source))
    rows = _streamed(source, error)
    return _headed(source, needs, rows, columns, comment, error), rows


def _headed(
    source: str,
    needs: str,
    rows: Iterator[tuple[int, list[str]]],
    columns: Collection[str] | None,
    comment: str,
    error: type[TdintError],
) -> CsvTable:
    """The table without its rows, of which the header and what stands above it are taken."""
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
    return CsvTable(source, names, titles, header_line, (), needs, error)


def _digest(source: str) -> str:
    with Path(source).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _streamed(source: str, error: type[TdintError]) -> Iterator[tuple[int, list[str]]]:
    """The rows of a file that are not blank, and their lines."""
    with Path(source).open(encoding="utf-8-sig", newline="") as file:

        def lines() -> Iterator[str]:
            for number, line in enumerate(file, start=1):
                if "\0" in line:
                    raise error(f"{source}:{number}: a null character; save it as UTF-8 text")
                yield line
            yield from ("\n", f"{_END}\n")

        reader, above, closed = csv.reader(lines(), skipinitialspace=True), 0, False
        try:
            for row in reader:
                closed = row == [_END]
                if not closed and any(cell.strip() for cell in row):
                    above = reader.line_num
                    yield above, row
        except csv.Error as fault:
            raise error(f"{source}:{reader.line_num}: no CSV: {fault}") from None
        except UnicodeDecodeError as fault:
            byte = fault.object[fault.start]
            raise error(f"{source}: not UTF-8 text (byte 0x{byte:02x}); save it as UTF-8") from None
        if not closed:
            raise error(f"{source}: a quotation mark below line {above} is not closed")


def _lines(source: str, text: str, error: type[TdintError]) -> list[tuple[int, list[str]]]:
    """The rows that are not blank, and their lines.

    A quotation mark that is never closed would take all rows below it into one cell: the last row tells.
    """
    reader = csv.reader(io.StringIO(f"{text}\n{_END}\n", newline=""), skipinitialspace=True)
    try:
        lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as fault:
        raise error(f"{source}:{reader.line_num}: no CSV: {fault}") from None
    if lines.pop()[1] != [_END]:
        above = lines[-1][0] if lines else 0
        raise error(f"{source}: a quotation mark below line {above} is not closed")
    return lines


def _text(source: str, needs: str, error: type[TdintError]) -> str:
    try:
        data = read_at_most(source, MOST_BYTES, error)
    except FileNotFoundError:
        raise error(f"{source}: no such file; {needs}") from None
    except (OSError, ValueError) as fault:
        raise error(f"{source}: cannot be read: {getattr(fault, 'strerror', None) or fault}") from None
    if len(data) > MOST_BYTES:
        raise error(f"{source}: larger than {MOST_BYTES // 1024**2} MiB; {needs}")
    note_input(source, data)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise error(f"{source}: not UTF-8 text (byte 0x{data[fault.start]:02x}); save it as UTF-8") from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise error(f"{source}:{line}: a null character; save it as UTF-8 text")
    return text
