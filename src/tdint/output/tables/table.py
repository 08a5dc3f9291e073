"""A table as CSV: UTF-8, LF ends, a header, 12 significant digits, true/false, an empty cell for no
value; and what a column of it is.

Every column is declared once, in the module of its subject: its name, its unit, where its value
comes from, and what it means. A name ends with the unit's `tdint.units.suffix`; a quantity that is
absolute says so, all others are relative to the ground or to the floor below. An estimated error of
a column is called `<column>_error`.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from operator import attrgetter
from typing import Any

import numpy as np

from tdint.arrays import Array
from tdint.tabular import optional
from tdint.units import SI, OutputUnits, Quantity, quantities

Cell = bool | int | float | str | None

TEXT = "text"
"""Unit of a column of words."""

_UNFIT = re.compile(
    r"[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udc7f\udd00-\udfff]"
)
"""What steers a terminal, and halves of letters; not the bytes that Python could not read."""

_WORD = re.compile(r"\w+")
_FORMULA = frozenset("=+-@\t\r")
_BEHIND = re.compile(r";\s*['\"]?[=+@-]")
_HARMLESS = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|[-+]")
"""Plain numbers, and a sign alone: - is the name of standard input."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    name : str
        As in the header.
    unit : str
        In SI; 1 for a number without one, `text` for words.
    value : str, callable or ndarray
        The attribute of a result (dots lead on) or the function of it that gives the cells: one for
        each row if it is an array, else the same for all rows of the result. Or the cells
        themselves, where one result has the table.
    meaning : str
        What it is, for people.
    """

    name: str
    unit: str
    value: str | Callable[[Any], Any] | Array
    meaning: str

    @classmethod
    def of_quantity(cls, quantity: Quantity) -> Column:
        """The column of a declared quantity, which is an attribute of the result."""
        return cls(quantity.column, quantity.unit, quantity.name, quantity.meaning)

    def of(self, result: Any) -> Any:
        """The value for a result."""
        if isinstance(self.value, np.ndarray):
            return self.value
        return self.value(result) if callable(self.value) else attrgetter(self.value)(result)


def columns_of(kind: type, *asked: str) -> tuple[Column, ...]:
    """The columns that a result declares in its fields; of those that are shown when asked for the
    ones named."""
    return tuple(
        Column(quantity.column, quantity.unit, quantity.value or quantity.name, quantity.meaning)
        for quantity in quantities(kind)
        if "table" in quantity.shown or quantity.name in asked
    )


def part(name: str, place: Any) -> Callable[[Any], Any]:
    """The value of a column that is a part of an array: the attribute of a result, and the place in
    it."""
    return lambda result: attrgetter(name)(result)[place]


def numbered(name: str) -> Callable[[Any], Any]:
    """The value of a column of numbers from 1, as many as an attribute has members."""
    return lambda result: np.arange(1, len(attrgetter(name)(result)) + 1)


def names(columns: Iterable[Column]) -> tuple[str, ...]:
    """The names of some columns."""
    return tuple(column.name for column in columns)


def describe(columns: Iterable[Column]) -> dict[str, dict[str, str]]:
    """Unit and meaning of each column, for a JSON file beside the table."""
    return {
        column.name: {"meaning": column.meaning}
        | ({} if column.unit == TEXT else {"unit": column.unit})
        for column in columns
    }


def described_in(
    meanings: Mapping[str, Mapping[str, str]], units: OutputUnits
) -> dict[str, dict[str, str]]:
    """What columns or keys mean (`describe`), under the names that they have in these units."""
    # Meanings name other columns: these words change with them.
    shown = {name: units.column(name, said.get("unit", TEXT))[0] for name, said in meanings.items()}
    result = {}
    for name, said in meanings.items():
        told = {"meaning": _WORD.sub(lambda word: shown.get(word[0], word[0]), said["meaning"])}
        told |= {"unit": units.unit(said["unit"])[0]} if "unit" in said else {}
        result[shown[name]] = {**said, **told}
    return result


def converted(value: Cell, factor: float) -> Cell:
    """A cell over a unit's value in SI; what is no number stays."""
    # To Python true is a number.
    if factor == 1.0 or isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return value
    return float(value) / factor


def rows_of(columns: Sequence[Column], result: Any) -> list[tuple[Cell, ...]]:
    """The rows that a result has: as many as its arrays are long."""
    values = [column.of(result) for column in columns]
    # What is no array holds for every row.
    sizes = {value.size for value in values if isinstance(value, np.ndarray)}
    if not sizes:
        return [tuple(values)]
    (size,) = sizes
    cells = (
        value.tolist() if isinstance(value, np.ndarray) else repeat(value, size) for value in values
    )
    return list(zip(*cells, strict=True))


def error_columns(columns: Iterable[Column]) -> tuple[Column, ...]:
    """The columns of the estimated errors of others."""
    return tuple(
        replace(
            column,
            name=f"{column.name}_error",
            meaning=f"estimated absolute error of {column.name}",
        )
        for column in columns
    )


@dataclass(frozen=True)
class Table:
    """Column names, rows of as many cells, and what the columns mean, as `describe` tells it."""

    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]
    meanings: dict[str, dict[str, str]] = field(default_factory=dict)

    @classmethod
    def of(cls, columns: Sequence[Column], rows: Iterable[Iterable[Any]]) -> Table:
        """A table of declared columns."""
        return cls(names(columns), list(map(tuple, rows)), describe(columns))

    @classmethod
    def of_results(
        cls,
        columns: Sequence[Column],
        results: Iterable[Any],
        heads: Iterable[tuple[Cell, ...]] = repeat(()),
    ) -> Table:
        """The rows of each result, in the order given; with `heads` what stands in the first
        columns of each."""
        rows: list[tuple[Cell, ...]] = []
        for result, head in zip(results, heads, strict=False):
            rows += ((*head, *row) for row in rows_of(columns[len(head) :], result))
        return cls.of(columns, rows)

    def in_units(self, units: OutputUnits) -> Table:
        """The same table in other units: columns renamed with them, numbers converted."""
        if units == SI:
            return self
        headed = [
            units.column(name, self.meanings.get(name, {}).get("unit", TEXT))
            for name in self.columns
        ]
        factors = [factor for _, factor in headed]
        rows = [tuple(map(converted, row, factors)) for row in self.rows]
        return Table(tuple(name for name, _ in headed), rows, described_in(self.meanings, units))

    def as_summary(self, key: str) -> dict[str, Any]:
        """What a JSON file has of it: its rows under a key, and what their numbers mean."""
        rows = [dict(zip(self.columns, row, strict=True)) for row in self.rows]
        return {key: rows, "meanings": dict(self.meanings)}

    def chosen(self, names: Iterable[str]) -> Table:
        """Some columns, by their names; what it has not is left out."""
        places = [self.columns.index(name) for name in names if name in self.columns]
        rows = [tuple(row[i] for i in places) for row in self.rows]
        return Table(tuple(self.columns[i] for i in places), rows, self.meanings)

    def by_column(self) -> list[tuple[Column, Any]]:
        """Each column with its cells: numbers as an array, nan for none; words as a list."""
        columns = []
        for place, name in enumerate(self.columns):
            about = self.meanings[name]
            unit = about.get("unit", TEXT)
            cells = [row[place] for row in self.rows]
            # Columns of numbers may have a word among them: a limit that is none.
            words = unit == TEXT or any(isinstance(cell, str) for cell in cells)
            values = (
                cells if words else np.array([np.nan if cell is None else cell for cell in cells])
            )
            columns.append((Column(name, unit, name, about["meaning"]), values))
        return columns

    def csv(self) -> bytes:
        """The table as CSV."""
        return csv_bytes([map(harmless, self.columns), *(map(cell_text, row) for row in self.rows)])

    def parquet(self) -> bytes:
        """The table as Parquet: each column with its unit and meaning, numbers with all their
        digits.

        Raises
        ------
        UsageError
            pyarrow is not installed.
        """
        # Numbers among words are words as well: a column of Parquet has one kind.
        columns = {
            column.name: [cell if cell is None else cell_text(cell) for cell in cells]
            if isinstance(cells, list)
            else cells
            for column, cells in self.by_column()
        }
        return parquet(columns, self.meanings)


PARQUET = ("a Parquet file", "parquet")
"""What needs pyarrow, and the extra that brings it."""


def parquet(columns: Mapping[str, Any], meanings: Mapping[str, Mapping[str, str]]) -> bytes:
    """Columns, arrays or lists, as Parquet, each with its meaning; UsageError without pyarrow."""
    pyarrow, writer = (optional(name, *PARQUET) for name in ("pyarrow", "pyarrow.parquet"))
    # Of a column of words in which nothing stands the kind would be none.
    empty = [
        isinstance(cells, list) and all(cell is None for cell in cells)
        for cells in columns.values()
    ]
    kinds = [pyarrow.string() if is_empty else None for is_empty in empty]
    arrays = [
        pyarrow.array(cells, kind) for cells, kind in zip(columns.values(), kinds, strict=True)
    ]
    fields = [
        pyarrow.field(name, array.type, metadata=meanings.get(name, {}))
        for name, array in zip(columns, arrays, strict=True)
    ]
    stream = io.BytesIO()
    writer.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), stream)
    return stream.getvalue()


def digits(value: float | np.floating[Any]) -> float:
    """Twelve significant digits, as in tables."""
    return float(format(value + 0.0, ".12g"))


def cell_text(value: Cell) -> str:
    """One cell as text: 12 significant digits, true/false, nothing for None and nan."""
    match value:
        case None:
            return ""
        case bool() | np.bool_():
            return "true" if value else "false"
        case float() | np.floating():
            return (
                "" if math.isnan(value) else format(value + 0.0, ".12g")
            )  # + 0.0: zero has no sign
        case _:
            return harmless(str(value))


def harmless(text: str) -> str:
    """Text of a file's header or name, which may hold anything: nothing that steers a terminal, is
    no UTF-8 (written out), or is a formula.

    Spreadsheets run what begins with = + - @, a tab or a return and is no number; an apostrophe
    before it makes it a text.
    """
    plain = _UNFIT.sub(lambda match: repr(match[0])[1:-1], text)
    # Bytes of a name that Python could not read in this locale reach it as surrogates.
    plain = plain.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    return f"'{plain}" if text[:1] in _FORMULA and not _HARMLESS.fullmatch(plain) else plain


def csv_bytes(rows: Iterable[Iterable[str]]) -> bytes:
    """Rows of harmless cells as CSV. One in which a formula would stand behind a semicolon, the
    separator of many spreadsheets, has quotation marks."""
    text = io.StringIO()
    # No harmless cell has a return: one at its end has the writer quote it, and goes again.
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerows(
        [f"{cell}\r" if ";" in cell and _BEHIND.search(cell) else cell for cell in row]
        for row in rows
    )
    return text.getvalue().replace("\r", "").encode()


OF_RECORD = (
    Column("record", "text", "record.source", "file of the record"),
    Column("component", "text", "record.component", "component of the record"),
)
"""The first columns of tables over records; of several records the components' cells are found
together."""

PAIR_DEMAND = Column(
    "pair_demand",
    "text",
    "pair_demand",
    "how the two components of a recording count: larger or mean (one motion, with the larger or "
    "the mean demand) or separate (two motions)",
)
"""Last column of tables over motions among which there are pairs."""

OF_NAMED_RECORD = (
    Column("record", "text", "record", "file of the record"),
    Column("component", "text", "component", "component of the record"),
)
"""The same, of what has the names alone."""

DAMPING = Column("damping", "1", "damping", "viscous damping ratio")
PERIOD = Column("period_s", "s", "periods", "natural period")
FLOOR = Column("floor", "1", "floor", "floor, from 1 at the bottom")
METHOD_SPEC = Column("method", "text", "method", "time-integration method with its parameters")
