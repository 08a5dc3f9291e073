"""One column of a table of motions: times in the first column, names with units in the header."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError, UsageError, did_you_mean
from tdint.ground_motion.formats.steps import equal_steps
from tdint.ground_motion.formats.tables.columns import name_and_units
from tdint.ground_motion.reading.source import digested, read_bytes
from tdint.ground_motion.signal import Signal
from tdint.units import Units, parse_units

_TIMES = ("t", "time", "times")
_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3}


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
    data = read_bytes(source)
    text = data.decode("utf-8-sig", "replace")
    header, _, body = text.partition("\n")
    mark = next((mark for mark in ("\t", ";", ",") if mark in header), ",")
    names = [name.strip().strip("\"'") for name in header.split(mark)]
    time, time_units = name_and_units(names[0])
    if time not in _TIMES or time_units not in _SECONDS:
        raise RecordError(f"{source}: the first column must be the time (time_s), its name is {names[0][:40]!r}")
    if names.count(column) != 1:
        how = "there are several columns" if column in names else "there is no column"
        hint = did_you_mean(column, names) or f"; there are {', '.join(names[1:13])[:200]}"
        raise RecordError(f"{source}: {how} {column!r}{hint}")
    place = names.index(column)
    found = parse_units(units) if units else _units_of(column, str(source))
    times, values = _numbers(body, mark, place, len(names), str(source))
    try:
        step = equal_steps(times * _SECONDS[time_units])
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from None
    return Signal(
        samples=found.scale * values,
        dt=step.dt,
        quantity=found.quantity,
        label=f"{source}: {column}",
        start=float(times[0]) * _SECONDS[time_units],
        clock="table",
        notes=(),
        warnings=(),
        input=digested(data, source),
    )


def _units_of(column: str, source: str) -> Units:
    _, text = name_and_units(column)
    try:
        return parse_units(text)
    except UsageError:
        raise RecordError(
            f"{source}: the name of the column {column!r} does not end with its units (_m_s2, _m); give units"
        ) from None


def _numbers(
    body: str, mark: str, place: int, width: int, source: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and values of the column."""
    point = "," if mark in (";", "\t") else "."
    found: list[tuple[float, float]] = []
    for number, line in enumerate(io.StringIO(body), start=2):
        if not line.strip():
            continue
        cells = line.rstrip("\r\n").split(mark)
        try:
            if len(cells) != width:
                raise ValueError
            pair = (float(cells[0].replace(point, ".")), float(cells[place].replace(point, ".")))
        except ValueError:
            shown = repr(cells[place][:40]) if len(cells) == width else f"{len(cells)} cells in place of {width}"
            raise RecordError(f"{source}: line {number}: {shown} is no number") from None
        if not all(map(np.isfinite, pair)):
            raise RecordError(f"{source}: line {number}: {cells[place][:40]!r} is no finite number")
        found.append(pair)
    if len(found) < 2:
        raise RecordError(f"{source}: the table has fewer than two rows")
    table = np.array(found)
    return table[:, 0].copy(), table[:, 1].copy()
