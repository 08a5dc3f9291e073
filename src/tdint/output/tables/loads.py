"""Table of the forces on floors that a model reads from files or points."""

from __future__ import annotations

import numpy as np

from tdint.model.definition import Excitation, TableForce
from tdint.output.tables.columns import declared
from tdint.output.tables.table import Table


def _impulse(force: TableForce) -> float:
    """Return the integral of the force over its times, N s."""
    values = force.values
    return float(np.sum(0.5 * np.diff(force.times) * (values[1:] + values[:-1])))


LOAD_COLUMNS = declared(
    "loads.load_columns",
    table=lambda force: force.table.source,
    column=lambda force: force.table.columns[force.column],
    first_time_s=lambda force: float(force.times[0]),
    last_time_s=lambda force: float(force.times[-1]),
    peak_load_N=lambda force: float(np.max(np.abs(force.values))),
    impulse_Ns=_impulse,
)
"""Columns of the table, evaluated for each force. They are also the keys in summary.json."""


def load_table(excitation: Excitation) -> Table:
    """Return the table of the forces from tables, with a row for each force."""
    return Table.of_results(LOAD_COLUMNS, excitation.tables)
