"""Ground motions in columns of CSV tables, selected by the column names in the first line.

The first column contains times, and the names include units.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tdint.csv_table import read_table
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.formats.lines import equal_steps
from tdint.ground_motion.formats.table_columns import SECONDS, name_and_units
from tdint.ground_motion.record import Input
from tdint.ground_motion.signal import Signal
from tdint.units import parse_units

_TIMES = ("t", "time", "times")
_NEEDS = "a recording is a CSV file with times in the first column and units in the column names"


def read_column(source: str | Path, column: str, units: str | None = None) -> Signal:
    """Read a column of a CSV table with names in the first line and times in the first column.

    Parameters
    ----------
    source : str or Path
        File name, or `-` for standard input. Columns are separated by commas, semicolons or tabs.
    column : str
        Name of the column in the header.
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
    table = read_table(str(source), _NEEDS, columns=(column,), error=RecordError)
    title = table.titles[0].strip("\"'")
    time, time_units = name_and_units(title)
    if time not in _TIMES or time_units not in SECONDS:
        raise RecordError(
            f"{source}: the first column must be the time (time_s), but its name is {title[:40]!r}"
        )
    times = SECONDS[time_units] * np.array(table.numbers(table.titles[0]))
    samples = np.array(table.numbers(column))
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
        samples=stated.scale * samples,
        dt=dt,
        quantity=stated.quantity,
        label=f"{source}: {column}",
        start=float(times[0]),
        clock="table",
        notes=(),
        warnings=(),
        input=Input(str(source), table.digest),
    )
