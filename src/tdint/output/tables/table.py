"""Tables and their columns, and their output as CSV and Parquet.

CSV files are UTF-8 with LF line ends and a header. Numbers have 12 significant digits, Booleans are
true or false, and a missing value is an empty cell.

Every column is declared one time, with its name, unit, value and meaning: in `columns.csv` of its
package, with a value that follows from the name or that the module of the table states
(`tdint.output.tables.columns`), or in the module of its subject if one of them depends on other
values. The name ends with the suffix of the unit (`tdint.units.suffix`). Names of absolute
quantities contain "absolute"; all other quantities are relative to the ground or to the floor
below. The estimated error of a column is called `<column>_error`.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import chain, repeat
from typing import Any, NamedTuple

import numpy as np

from tdint.errors import write_out_controls
from tdint.tabular import import_optional
from tdint.units import SI, OutputUnits, Quantity, quantities, suffix

Cell = bool | int | float | str | None

TEXT = "text"
"""Unit of a column of text."""

_WORD = r"\w+"
_FORMULA = frozenset("=+-@\t\r")  # first characters of a formula in a spreadsheet
_FORMULA_AFTER_SEMICOLON = r";\s*['\"]?[=+@-]"
_NUMBER_OR_SIGN = r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|[-+]"
"""Plain numbers, and a single sign, because - is the name of standard input."""


class Column(NamedTuple):
    """Column of a table.

    Attributes
    ----------
    unit : str
        SI unit; 1 for a dimensionless number, `text` for text.
    value : str, callable or ndarray
        Source of the cells: the name of an attribute of the result, a function of the result, or
        the cells. An array gives one cell per row; any other value applies to all rows of the
        result.
    meaning : str
        Description for users.
    """

    name: str
    unit: str
    value: Any
    meaning: str

    @classmethod
    def named(cls, attribute: str, meaning: str, unit: str = "1") -> Column:
        """Return the column of an attribute of a result. Its name is the name of the attribute with
        the suffix of the unit."""
        return cls(f"{attribute}{suffix(unit)}", unit, attribute, meaning)

    @classmethod
    def of_quantity(cls, quantity: Quantity) -> Column:
        """Return the column of a declared quantity, which is an attribute of the result."""
        return cls(quantity.column, quantity.unit, quantity.name, quantity.meaning)

    def of(self, result: Any) -> Any:
        """Return the value of the column for a result: an array with a cell for each row, or a
        single value that applies to all rows of the result."""
        if isinstance(self.value, np.ndarray):
            return self.value
        return self.value(result) if callable(self.value) else getattr(result, self.value)


def columns_of(result_class: type, *additional: str) -> tuple[Column, ...]:
    """Return the columns that a class of results declares in the annotations of its fields
    (`tdint.units.Quantity`).

    Parameters
    ----------
    *additional : str
        Names of quantities that are included in addition to the quantities of every table.
    """
    return tuple(
        Column(quantity.column, quantity.unit, quantity.value or quantity.name, quantity.meaning)
        for quantity in quantities(result_class)
        if "table" in quantity.shown or quantity.name in additional
    )


class _Path:
    """Function of a result, which returns a part of it; None if the result does not have this part.
    The attributes and elements of a path are paths as well."""

    def __init__(self, part_of: Callable[[Any], Any]) -> None:
        self._part_of = part_of

    def __call__(self, result: Any) -> Any:
        return self._part_of(result)

    def __getattr__(self, name: str) -> _Path:
        return _Path(lambda result: None if (part := self(result)) is None else getattr(part, name))

    def __getitem__(self, index: Any) -> _Path:
        return _Path(lambda result: self(result)[index])


def placeholder() -> Any:
    """Return a placeholder for a result in the declarations of columns.

    Its attributes and their elements are functions of a result, which return these parts: after
    `test: CyclicTest = placeholder()`, `test.path.drift` is the value of a column. Type checkers
    read it as an attribute of the class in the annotation.
    """
    return _Path(lambda result: result)


def numbered(values: Any, first: float = 1) -> Callable[[Any], Any]:
    """Return a function of a result, which returns consecutive numbers from `first`, one for each
    element of `values`, the name of an attribute or a function of the result."""
    column = Column("", "1", values, "")
    return lambda result: np.arange(first, len(column.of(result)) + first)


def names(columns: Iterable[Column]) -> tuple[str, ...]:
    """Return the names of columns in their order."""
    return tuple(column.name for column in columns)


def describe(columns: Iterable[Column]) -> dict[str, dict[str, str]]:
    """Return a dictionary from the name of each column to its `meaning` and `unit`, for the JSON
    file of a table. Columns of text have no unit."""
    descriptions = {}
    for column in columns:
        descriptions[column.name] = {"meaning": column.meaning}
        if column.unit != TEXT:
            descriptions[column.name]["unit"] = column.unit
    return descriptions


def described_in(
    meanings: Mapping[str, Mapping[str, str]], units: OutputUnits
) -> dict[str, dict[str, str]]:
    """Return the descriptions of columns for a table in output units.

    Parameters
    ----------
    meanings : mapping of str to mapping
        `meaning` and `unit` (SI) of each column by its name, as `describe` returns them.

    Returns
    -------
    dict of str to dict
        Descriptions by the new name of the column, with the new units.
    """
    # Descriptions can refer to other columns by their names, which change as well.
    new_names = {
        name: units.column(name, description.get("unit", TEXT))[0]
        for name, description in meanings.items()
    }
    result = {}
    for name, description in meanings.items():
        changed = dict(description)
        changed["meaning"] = re.sub(
            _WORD, lambda word: new_names.get(word[0], word[0]), description["meaning"]
        )
        if "unit" in description:
            changed["unit"] = units.unit(description["unit"])[0]
        result[new_names[name]] = changed
    return result


def converted(value: Cell, factor: float) -> Cell:
    """Return a number divided by `factor`, the SI value of a unit; other cells are unchanged."""
    # In Python, True and False are integers, but they have no unit.
    if factor == 1.0 or isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return value
    return float(value) / factor


def rows_of(columns: Sequence[Column], result: Any) -> list[tuple[Cell, ...]]:
    """Return the rows of a result in a table, each with a single cell per column.

    The number of rows is the common length of the arrays in the values of the columns; without
    arrays, there is one row.
    """
    values = [column.of(result) for column in columns]
    # A value that is not an array applies to every row.
    lengths = {value.size for value in values if isinstance(value, np.ndarray)}
    if not lengths:
        return [tuple(values)]
    (length,) = lengths  # raises an error if arrays have different lengths
    cells_of_columns = (
        value.tolist() if isinstance(value, np.ndarray) else repeat(value, length)
        for value in values
    )
    return list(zip(*cells_of_columns, strict=True))


def joined_rows(groups: Iterable[tuple[Sequence[Column], Any]]) -> list[tuple[Cell, ...]]:
    """Return the rows of several results side by side: for each group of columns, the cells of its
    result. Groups without a result (None) are omitted."""
    parts = [rows_of(columns, result) for columns, result in groups if result is not None]
    return [tuple(chain.from_iterable(row)) for row in zip(*parts, strict=True)]


def error_columns(columns: Iterable[Column]) -> tuple[Column, ...]:
    """Return, for each column, the column NAME_error of the estimated errors of its values."""
    return tuple(
        column._replace(
            name=f"{column.name}_error", meaning=f"estimated absolute error of {column.name}"
        )
        for column in columns
    )


def error_percent(error: Cell, value: Cell) -> float | None:
    """Return an error in percent of a value, with two digits; None if the value is zero, or if the
    value or the error is not a number."""
    if not isinstance(error, float) or not isinstance(value, float):
        return None
    if math.isnan(error) or value == 0.0:
        return None
    return float(f"{100.0 * error / abs(value):.2g}")


class Table(NamedTuple):
    """Table with the names of its columns, rows with a single cell per column, and descriptions of
    the columns, as `describe` returns them.
    """

    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]
    meanings: dict[str, dict[str, str]] = {}  # noqa: RUF012  never changed

    @classmethod
    def of(cls, columns: Sequence[Column], rows: Iterable[Iterable[Any]]) -> Table:
        """Return a table from its columns and its rows; the cells of a row are in the order of the
        columns."""
        return cls(names(columns), list(map(tuple, rows)), describe(columns))

    @classmethod
    def of_results(
        cls,
        columns: Sequence[Column],
        results: Iterable[Any],
        heads: Iterable[tuple[Cell, ...]] = repeat(()),
    ) -> Table:
        """Return a table with the rows of several results.

        Parameters
        ----------
        heads : iterable of tuple
            Cells of the first columns for each result, which are the same in all its rows; the
            remaining columns are evaluated. By default all columns are evaluated.
        """
        rows: list[tuple[Cell, ...]] = []
        for result, head in zip(results, heads, strict=False):
            rows += ((*head, *row) for row in rows_of(columns[len(head) :], result))
        return cls.of(columns, rows)

    @classmethod
    def joined(cls, *groups: tuple[Sequence[Column], Any]) -> Table:
        """Return a table with the columns of several results side by side. Groups of columns
        without a result (None) are omitted."""
        columns = [column for part, result in groups if result is not None for column in part]
        return cls.of(columns, joined_rows(groups))

    @classmethod
    def of_units(cls, units: Mapping[str, str], rows: Iterable[tuple[Cell, ...]]) -> Table:
        """Return a table of a report, with a unit (or `TEXT`) for each column, and no meanings."""
        meanings = {name: {"meaning": "", "unit": unit} for name, unit in units.items()}
        return cls(tuple(units), list(rows), meanings)

    def in_units(self, units: OutputUnits) -> Table:
        """Return the table of SI values in other units, with renamed columns, converted numbers and
        new descriptions."""
        if units == SI:
            return self
        names_and_factors = [
            units.column(name, self.meanings.get(name, {}).get("unit", TEXT))
            for name in self.columns
        ]
        new_names = tuple(name for name, _ in names_and_factors)
        factors = [factor for _, factor in names_and_factors]
        rows = [tuple(map(converted, row, factors)) for row in self.rows]
        return Table(new_names, rows, described_in(self.meanings, units))

    def as_summary(self, key: str) -> dict[str, Any]:
        """Return the table for a JSON file: a list of rows, each a dictionary by column, under the
        key `key`, and the descriptions of the columns under the key `meanings`."""
        return {key: self.as_dictionaries(), "meanings": dict(self.meanings)}

    def as_dictionaries(self) -> list[dict[str, Any]]:
        """Return the rows, each as a dictionary by column; None for nan, which JSON does not
        have."""
        # For nan, != is true.
        return [
            {
                name: None if cell != cell else cell
                for name, cell in zip(self.columns, row, strict=True)
            }
            for row in self.rows
        ]

    def chosen(self, names: Iterable[str]) -> Table:
        """Return the table with only the columns in `names`, in this order. Names that the table
        does not have are ignored."""
        indices = [self.columns.index(name) for name in names if name in self.columns]
        rows = [tuple(row[i] for i in indices) for row in self.rows]
        return Table(tuple(self.columns[i] for i in indices), rows, self.meanings)

    def with_values(self, name: str, function: Callable[[Cell], Cell]) -> Table:
        """Return the table with the results of a function instead of the values of a column."""
        column = self.columns.index(name)
        rows = [(*row[:column], function(row[column]), *row[column + 1 :]) for row in self.rows]
        return self._replace(rows=rows)

    def by_column(self) -> list[tuple[Column, Any]]:
        """Return each column with its cells.

        The cells of a column of numbers are an array, with nan for missing values. The cells of
        other columns are a list.
        """
        columns = []
        for index, name in enumerate(self.columns):
            description = self.meanings[name]
            unit = description.get("unit", TEXT)
            cells = [row[index] for row in self.rows]
            # A column of numbers can contain text, for example `none` if there is no limit.
            values: Any = cells
            if unit != TEXT and not any(isinstance(cell, str) for cell in cells):
                values = np.array([np.nan if cell is None else cell for cell in cells])
            columns.append((Column(name, unit, name, description["meaning"]), values))
        return columns

    def csv(self) -> bytes:
        """Return the table as CSV."""
        return csv_bytes([self.columns, *self.rows])

    def parquet(self) -> bytes:
        """Return the table as Parquet, with units and meanings, and with all digits of numbers.

        Raises
        ------
        UsageError
            pyarrow is not installed.
        """
        columns = {}
        for column, cells in self.by_column():
            # Numbers in a column with text become text, because a Parquet column has one type.
            if isinstance(cells, list):
                cells = [cell if cell is None else cell_text(cell) for cell in cells]
            columns[column.name] = cells
        return parquet(columns, self.meanings)


PARQUET = ("a Parquet file", "parquet")
"""Name of the feature that requires pyarrow, and its optional dependency group."""


def parquet(columns: Mapping[str, Any], meanings: Mapping[str, Mapping[str, str]]) -> bytes:
    """Return a table as Parquet.

    Raises
    ------
    UsageError
        pyarrow is not installed.
    """
    pyarrow, writer = (import_optional(name, *PARQUET) for name in ("pyarrow", "pyarrow.parquet"))
    arrays = []
    for cells in columns.values():
        # pyarrow infers the type, except for a text column without any text. An empty cell is null.
        is_empty_text = isinstance(cells, list) and all(cell is None for cell in cells)
        cell_type = pyarrow.string() if is_empty_text else None
        arrays.append(pyarrow.array(cells, cell_type, from_pandas=True))
    fields = [
        pyarrow.field(name, array.type, metadata=meanings.get(name, {}))
        for name, array in zip(columns, arrays, strict=True)
    ]
    stream = io.BytesIO()
    writer.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), stream)
    return stream.getvalue()


def digits(value: float | np.floating[Any]) -> float:
    """Return a number with 12 significant digits, as in tables."""
    return float(format(value + 0.0, ".12g"))


def cell_text(value: Cell) -> str:
    """Return a cell as text: 12 significant digits, true or false, empty for None and nan."""
    match value:
        case None:
            return ""
        case bool() | np.bool_():
            return "true" if value else "false"
        case float() | np.floating():
            # Adding 0.0 removes the sign of negative zero.
            return "" if math.isnan(value) else format(value + 0.0, ".12g")
        case _:
            return harmless(str(value))


def harmless(text: str) -> str:
    """Return text from a file header or file name in a form that is safe in CSV files.

    Control characters and bytes that are not valid UTF-8 are written out. Spreadsheets execute text
    that starts with = + - @, a tab or a carriage return and is not a number; an apostrophe before
    the text prevents this.
    """
    printable = write_out_controls(text)
    # Bytes of a file name that Python could not decode in this locale are stored as surrogates.
    printable = printable.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    is_formula = text[:1] in _FORMULA and not re.fullmatch(_NUMBER_OR_SIGN, printable)
    return f"'{printable}" if is_formula else printable


def csv_bytes(rows: Iterable[Iterable[Cell]]) -> bytes:
    """Return rows of cells as CSV (UTF-8, LF line ends), each cell as by `cell_text`."""
    lines = []
    for row in rows:
        # Numbers as text without a call per cell: a campaign has millions of cells. Adding 0.0
        # removes the sign of negative zero; cell == cell is false for nan.
        cells = [
            (f"{cell + 0.0:.12g}" if cell == cell else "")
            if type(cell) is float
            else f"{cell}"
            if type(cell) is int
            else _csv_cell(cell)
            for cell in row
        ]
        lines.append(",".join(cells) or '""' * len(cells))  # a line with a single empty cell
    return "".join(f"{line}\n" for line in lines).encode()


@lru_cache(maxsize=4096, typed=True)
def _csv_cell(value: Cell) -> str:
    """Return a cell for a line of CSV. A cell that contains a formula after a semicolon is quoted,
    because many spreadsheets use the semicolon as separator."""
    cell, text = cell_text(value), io.StringIO()
    if ";" in cell and re.search(_FORMULA_AFTER_SEMICOLON, cell):
        cell += "\r"  # makes the writer quote the cell; harmless cells contain none
    csv.writer(text, lineterminator="\r\n").writerow([cell, ""])
    return text.getvalue()[:-3].replace("\r", "")


RECORD_COLUMNS = (
    Column("record", "text", placeholder().record.source, "file of the record"),
    Column("component", "text", placeholder().record.component, "component of the record"),
)
"""First columns of tables over records. The components of several records are named together."""

PAIR_DEMAND = Column.named(
    "pair_demand",
    "how the two components of a recording are counted: larger or mean (one ground motion with the "
    "larger or the mean demand) or separate (two ground motions)",
    TEXT,
)
"""Last column of tables over ground motions that include pairs."""

NAMED_RECORD_COLUMNS = (
    Column.named("record", "file of the record", TEXT),
    Column.named("component", "component of the record", TEXT),
)
"""First columns of tables over results that store only the names of record and component."""

DAMPING = Column.named("damping", "viscous damping ratio")
PERIOD = Column("period_s", "s", "periods", "natural period")
FLOOR = Column.named("floor", "floor, from 1 at the bottom")
METHOD_SPEC = Column.named("method", "time-integration method with its parameters", TEXT)
