"""Columns of CSV tables, selected by the column names in the first line.

A ground motion is one column of such a table. The first column contains times, and the names
include units.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError, UsageError, did_you_mean
from tdint.ground_motion.formats.lines import equal_steps
from tdint.ground_motion.formats.table_columns import name_and_units
from tdint.ground_motion.reading.contents import read_bytes, register_input
from tdint.ground_motion.record import Input
from tdint.ground_motion.signal import Signal
from tdint.number_parsing import number_or_nan
from tdint.units import parse_units

SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3}
"""Units of times and periods in column names, and their values in s."""

_MIN_ROWS = 2  # rows; a ground motion needs two times, whose difference is the sampling interval


@dataclass(frozen=True)
class NamedTable:
    """Cells of a table as text.

    Attributes
    ----------
    names : tuple of str
        Column names in the first line.
    rows : tuple of (int, tuple of str)
        Line number, counted from 1, and cells of each row.
    comma : bool
        True if the decimal separator is a comma.
    """

    source: str
    names: tuple[str, ...]
    rows: tuple[tuple[int, tuple[str, ...]], ...]
    comma: bool
    input: Input

    def column_index(self, name: str) -> int:
        """Return the index of the column with a name, counted from 0; raise RecordError unless
        exactly one column has this name."""
        if self.names.count(name) == 1:
            return self.names.index(name)
        if name in self.names:
            raise RecordError(
                f"{self.source}: several columns have the name {name!r}; rename all except one"
            )
        columns = ", ".join(self.names[:12])[:200]
        hint = did_you_mean(name, self.names) or f"; the columns are {columns}"
        raise RecordError(f"{self.source}: column {name!r} not found{hint}")

    def numbers(self, column: int) -> NDArray[np.float64]:
        """Return the values of the column with an index, shape (rows,); raise RecordError for
        a cell that is not a finite number."""
        values = np.empty(len(self.rows))
        for i, (line, cells) in enumerate(self.rows):
            values[i] = number_or_nan(
                cells[column].replace(",", ".") if self.comma else cells[column]
            )
            if not isfinite(values[i]):
                shown = cells[column].strip()[:40]
                name = self.names[column][:40]
                raise RecordError(
                    f"{self.source}: line {line}: {name}: {shown!r} is not a finite number"
                )
        return values


def read_named_table(source: str | Path) -> NamedTable:
    """Read a table with columns separated by commas, semicolons or tabs; with semicolons or tabs, a
    comma is the decimal point.

    Raises
    ------
    RecordError
        The file cannot be read, a row has another number of cells than the first line, or the table
        has fewer than two rows.
    """
    data = read_bytes(source)
    lines = data.decode("utf-8-sig", "replace").splitlines()
    # Tabs and semicolons are searched first, because a comma may then be the decimal point.
    mark = next((mark for mark in ("\t", ";", ",") if mark in lines[0]), ",")
    names = tuple(name.strip().strip("\"'") for name in lines[0].split(mark))
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        cells = tuple(line.split(mark))
        if len(cells) != len(names):
            raise RecordError(
                f"{source}: line {number}: the row has {len(cells)} cells, but the header has "
                f"{len(names)} columns"
            )
        rows.append((number, cells))
    if len(rows) < _MIN_ROWS:
        raise RecordError(
            f"{source}: the table must have at least {_MIN_ROWS} rows, got {len(rows)}"
        )
    return NamedTable(
        str(source), names, tuple(rows), mark in (";", "\t"), register_input(data, source)
    )


_TIMES = ("t", "time", "times")


def read_column(source: str | Path, column: str, units: str | None = None) -> Signal:
    """Read a column of a CSV table with names in the first line and times in the first column.

    Parameters
    ----------
    source : str or Path
        File name, or `-` for standard input. Columns are separated by commas, semicolons or tabs.
    column : str
        Name of the column, spelled as in the header.
    units : str, optional
        Units for `parse_units`. Default: the units at the end of the column name (`base_m_s2`,
        `roof (cm)`).

    Returns
    -------
    Signal
        Samples in SI units, with the times of the table as clock.

    Raises
    ------
    RecordError
        The file cannot be read, its times are not in equal steps, the column does not exist, a cell
        is not a finite number, or the units of the column are unknown.
    """
    table = read_named_table(source)
    time, time_units = name_and_units(table.names[0])
    if time not in _TIMES or time_units not in ("", *SECONDS):
        raise RecordError(
            f"{source}: the first column must be the time (time_s), but its name is "
            f"{table.names[0][:40]!r}"
        )
    times = SECONDS[time_units or "s"] * table.numbers(0)
    index = table.column_index(column)
    try:
        stated = parse_units(units or name_and_units(column)[1])
    except UsageError:
        if units:
            raise  # The message explains the error in the argument of the user.
        raise RecordError(
            f"{source}: the name of the column {column!r} does not end with its units (_m_s2, _m); "
            "specify them by `units`"
        ) from None
    try:
        dt, _ = equal_steps(times)
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from None
    return Signal(
        samples=stated.scale * table.numbers(index),
        dt=dt,
        quantity=stated.quantity,
        label=f"{source}: {column}",
        start=float(times[0]),
        clock="table",
        notes=(),
        warnings=(),
        input=table.input,
    )
