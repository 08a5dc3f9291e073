"""One column of a table of motions: times in the first column, names with units in the header."""

from __future__ import annotations

from pathlib import Path

from tdint.errors import RecordError, UsageError
from tdint.ground_motion.formats.steps import equal_steps
from tdint.ground_motion.formats.tables.columns import name_and_units
from tdint.ground_motion.reading.named_table import SECONDS, read_named_table
from tdint.ground_motion.signal import Signal
from tdint.units import Units, parse_units

_TIMES = ("t", "time", "times")


def read_column(source: str | Path, column: str, units: str | None = None) -> Signal:
    """Read a column of a table: CSV with names in its first line, of which the first is that of the times.

    Parameters
    ----------
    source : str or Path
        The file, or `-` for standard input. Commas, semicolons or tabs divide columns.
    column : str
        The column's name, as the header has it.
    units : str, optional
        As `parse_units` understands them; by default those at the end of the column's name (`base_m_s2`, `roof (cm)`).

    Raises
    ------
    RecordError
        The file cannot be read, has no times in equal steps, no such column, a cell that is no finite number, or a
        column of unknown units.
    """
    table = read_named_table(source)
    time, time_units = name_and_units(table.names[0])
    if time not in _TIMES or time_units not in ("", *SECONDS):
        raise RecordError(f"{source}: the first column must be the time (time_s), its name is {table.names[0][:40]!r}")
    times = SECONDS[time_units or "s"] * table.numbers(0)
    place = table.place(column)
    found = parse_units(units) if units else _units_of(column, str(source))
    try:
        step = equal_steps(times)
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from None
    return Signal(
        samples=found.scale * table.numbers(place),
        dt=step.dt,
        quantity=found.quantity,
        label=f"{source}: {column}",
        start=float(times[0]),
        clock="table",
        notes=(),
        warnings=(),
        input=table.input,
    )


def _units_of(column: str, source: str) -> Units:
    _, text = name_and_units(column)
    try:
        return parse_units(text)
    except UsageError:
        raise RecordError(
            f"{source}: the name of the column {column!r} does not end with its units (_m_s2, _m); give units"
        ) from None
