"""Tables of any content whose columns are asked for by name: CSV with names in its first line.

A motion is one column of them: times in the first column, names with units in the header.
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
from tdint.ground_motion.reading.contents import digested, read_bytes
from tdint.ground_motion.record import Input
from tdint.ground_motion.signal import Signal
from tdint.units import parse_units
from tdint.written_numbers import number_or_nan

SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3}
"""Units of times and periods in the name of a column, and their values in s."""

_FEWEST = 2  # rows: a motion has a sampling interval


@dataclass(frozen=True)
class NamedTable:
    """The cells of a table as text.

    Attributes
    ----------
    source : str
        The file as the user named it.
    names : tuple of str
        Those of the columns, as in the first line.
    rows : tuple of (int, tuple of str)
        The number of each line, from 1, and its cells.
    comma : bool
        Whether a comma is the decimal point.
    input : Input
        The file with its SHA-256.
    """

    source: str
    names: tuple[str, ...]
    rows: tuple[tuple[int, tuple[str, ...]], ...]
    comma: bool
    input: Input

    def place(self, name: str) -> int:
        """The place of a column; RecordError if there is none or several of this name."""
        if self.names.count(name) == 1:
            return self.names.index(name)
        how = "there are several columns" if name in self.names else "there is no column"
        hint = did_you_mean(name, self.names) or f"; there are {', '.join(self.names[:12])[:200]}"
        raise RecordError(f"{self.source}: {how} {name!r}{hint}")

    def numbers(self, place: int) -> NDArray[np.float64]:
        """The numbers of a column, shape (rows,); RecordError for a cell that is none or not
        finite."""
        values = np.empty(len(self.rows))
        for i, (line, cells) in enumerate(self.rows):
            values[i] = number_or_nan(
                cells[place].replace(",", ".") if self.comma else cells[place]
            )
            if not isfinite(values[i]):
                shown = cells[place].strip()[:40]
                name = self.names[place][:40]
                raise RecordError(
                    f"{self.source}: line {line}: {name}: {shown!r} is no finite number"
                )
        return values


def read_named_table(source: str | Path) -> NamedTable:
    """Read a table. Commas, semicolons or tabs divide columns; beside the latter two a comma is a
    decimal point.

    Raises
    ------
    RecordError
        The file cannot be read, its rows have other numbers of cells than the first line, or there
        are next to none.
    """
    data = read_bytes(source)
    lines = data.decode("utf-8-sig", "replace").splitlines()
    # Beside semicolons and tabs a comma is a decimal point, so that these come first.
    mark = next((mark for mark in ("\t", ";", ",") if mark in lines[0]), ",")
    names = tuple(name.strip().strip("\"'") for name in lines[0].split(mark))
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        cells = tuple(line.split(mark))
        if len(cells) != len(names):
            raise RecordError(
                f"{source}: line {number}: {len(cells)} cells, its first line names {len(names)} "
                "columns"
            )
        rows.append((number, cells))
    if len(rows) < _FEWEST:
        raise RecordError(f"{source}: the table has fewer than {_FEWEST} rows")
    return NamedTable(str(source), names, tuple(rows), mark in (";", "\t"), digested(data, source))


_TIMES = ("t", "time", "times")


def read_column(source: str | Path, column: str, units: str | None = None) -> Signal:
    """Read a column of a table: CSV with names in its first line, of which the first is that of the
    times.

    Parameters
    ----------
    source : str or Path
        The file, or `-` for standard input. Commas, semicolons or tabs divide columns.
    column : str
        The column's name, as the header has it.
    units : str, optional
        As `parse_units` understands them; by default those at the end of the column's name
        (`base_m_s2`, `roof (cm)`).

    Raises
    ------
    RecordError
        The file cannot be read, has no times in equal steps, no such column, a cell that is no
        finite number, or a column of unknown units.
    """
    table = read_named_table(source)
    time, time_units = name_and_units(table.names[0])
    if time not in _TIMES or time_units not in ("", *SECONDS):
        raise RecordError(
            f"{source}: the first column must be the time (time_s), its name is "
            f"{table.names[0][:40]!r}"
        )
    times = SECONDS[time_units or "s"] * table.numbers(0)
    place = table.place(column)
    try:
        stated = parse_units(units or name_and_units(column)[1])
    except UsageError:
        if units:
            raise
        raise RecordError(
            f"{source}: the name of the column {column!r} does not end with its units (_m_s2, _m); "
            "give `units`"
        ) from None
    try:
        dt, _ = equal_steps(times)
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from None
    return Signal(
        samples=stated.scale * table.numbers(place),
        dt=dt,
        quantity=stated.quantity,
        label=f"{source}: {column}",
        start=float(times[0]),
        clock="table",
        notes=(),
        warnings=(),
        input=table.input,
    )
