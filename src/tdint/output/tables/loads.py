"""Table of the forces on floors that a model reads from files or points."""

from __future__ import annotations

import numpy as np

from tdint.model.definition import Excitation, TableForce
from tdint.output.tables.table import Column, Table

LOAD_COLUMNS = (
    Column.named("floor", "floor, numbered from the ground"),
    Column(
        "table", "text", lambda force: force.table.source, "file; empty for points of the model"
    ),
    Column("column", "text", lambda force: force.table.columns[force.column], "column of the file"),
    Column.named("factor", "factor on the forces of the column"),
    Column("first_time_s", "s", lambda force: float(force.times[0]), "time of the first force"),
    Column("last_time_s", "s", lambda force: float(force.times[-1]), "time of the last force"),
    Column("peak_load_N", "N", lambda force: _peak(force), "maximum absolute force"),
    Column("impulse_Ns", "N*s", lambda force: _impulse(force), "integral of the force over time"),
)
"""Columns of the table, evaluated for each force. They are also the keys in summary.json."""


def _peak(force: TableForce) -> float:
    """Return the maximum absolute force, N."""
    return float(np.max(np.abs(force.values)))


def _impulse(force: TableForce) -> float:
    """Return the integral of the force over its times, N s."""
    values = force.values
    return float(np.sum(0.5 * np.diff(force.times) * (values[1:] + values[:-1])))


def load_table(excitation: Excitation) -> Table:
    """Return the table of the forces from tables, with a row for each force."""
    return Table.of_results(LOAD_COLUMNS, excitation.tables)
