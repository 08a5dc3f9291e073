"""Tables that studies are given as CSV files: columns by their names, and every fault with its line."""

from __future__ import annotations

import csv
import io
import math
import sys
from dataclasses import dataclass
from pathlib import Path

from tdint.errors import ModelError, did_you_mean

_MOST_BYTES = 256 * 1024 * 1024
_TRUE, _FALSE = ("true", "1", "yes"), ("false", "0", "no", "")


@dataclass(frozen=True)
class CsvTable:
    """A CSV file with a header; names in it are compared without regard to case.

    Attributes
    ----------
    source : str
        The file as the user named it.
    header : tuple of str
        The columns' names, in lower case.
    rows : tuple of (int, list of str)
        Line and cells of each row.
    """

    source: str
    header: tuple[str, ...]
    rows: tuple[tuple[int, list[str]], ...]

    def has(self, *names: str) -> bool:
        """Whether there are columns of all these names."""
        return all(name in self.header for name in names)

    def texts(self, name: str) -> list[str]:
        """The cells of a column.

        Raises
        ------
        ModelError
            There is no such column.
        """
        if name not in self.header:
            hint = did_you_mean(name, self.header)
            raise ModelError(f"{self.source}:1: no column {name}{hint}; there are {', '.join(self.header)[:200]}")
        place = self.header.index(name)
        return [row[place].strip() if place < len(row) else "" for _, row in self.rows]

    def numbers(self, name: str, *, empty: bool = False, positive: bool = False) -> list[float]:
        """The cells of a column as finite numbers; with `empty` nan for a cell without one.

        Raises
        ------
        ModelError
            There is no such column, or a cell is no such number.
        """
        found = []
        for (line, _), text in zip(self.rows, self.texts(name), strict=True):
            try:
                number = math.nan if empty and not text else float(text)
            except ValueError:
                number = math.inf
            if math.isinf(number) or (math.isnan(number) and text) or (positive and number <= 0.0):
                what = "a positive number" if positive else "a number"
                raise ModelError(f"{self.source}:{line}: {name} must be {what}, got {text[:40]!r}")
            if math.isnan(number) and not empty:
                raise ModelError(f"{self.source}:{line}: {name} is missing")
            found.append(number)
        return found

    def truths(self, name: str) -> list[bool]:
        """The cells of a column of true and false; false where there is no such column.

        Raises
        ------
        ModelError
            A cell is neither.
        """
        if name not in self.header:
            return [False] * len(self.rows)
        for (line, _), text in zip(self.rows, self.texts(name), strict=True):
            if text.lower() not in (*_TRUE, *_FALSE):
                raise ModelError(f"{self.source}:{line}: {name} must be true or false, got {text[:40]!r}")
        return [text.lower() in _TRUE for text in self.texts(name)]

    def only(self, name: str) -> str:
        """What stands in all rows of a column; nothing where there is no such column.

        Raises
        ------
        ModelError
            The rows differ.
        """
        if name not in self.header:
            return ""
        values = list(dict.fromkeys(self.texts(name)))
        if len(values) > 1:
            raise ModelError(f"{self.source}: several {name}: {', '.join(values[:5])}; leave one of them")
        return values[0] if values else ""


def read_table(source: str, needs: str) -> CsvTable:
    """Read a CSV file with a header; `needs` says which columns it must have, for messages. `-` is standard input.

    Raises
    ------
    ModelError
        It cannot be read, or holds no rows.
    """
    reader = csv.reader(io.StringIO(_text(source, needs), newline=""))
    try:
        lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise ModelError(f"{source}:{reader.line_num}: no CSV: {error}") from None
    if not lines:
        raise ModelError(f"{source}: is empty; {needs}")
    (_, header), *rows = lines
    names = tuple(cell.strip().lower() for cell in header)
    twice = next((name for i, name in enumerate(names) if name and name in names[:i]), None)
    if twice:
        raise ModelError(f"{source}:1: the column {twice} is there twice")
    for line, row in rows:
        if len(row) > len(header):
            raise ModelError(f"{source}:{line}: {len(row)} cells under {len(header)} columns")
    if not rows:
        raise ModelError(f"{source}: has no rows below its header; {needs}")
    return CsvTable(source, names, tuple(rows))


def _text(source: str, needs: str) -> str:
    try:
        data = sys.stdin.buffer.read(_MOST_BYTES + 1) if source == "-" else Path(source).read_bytes()
    except FileNotFoundError:
        raise ModelError(f"{source}: no such file; {needs}") from None
    except (OSError, ValueError) as error:
        raise ModelError(f"{source}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > _MOST_BYTES:
        raise ModelError(f"{source}: larger than {_MOST_BYTES // 1024**2} MiB")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ModelError(f"{source}: not UTF-8 text (byte 0x{data[error.start]:02x})") from None
