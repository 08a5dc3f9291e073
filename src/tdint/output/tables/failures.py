"""Table of the problems on which methods fail."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tdint.output.tables.tables import Cell, Table

if TYPE_CHECKING:
    from tdint.analysis.assessment.failures import Trial

FAILURE_COLUMNS = (
    "problem",
    "method",
    "dt_s",
    "energy_ratio_min",
    "energy_ratio_max",
    "error",
    "outcome",
    "verdict",
    "end_s",
    "error_of",
)


def failure_table(trials: Iterable[Trial]) -> Table:
    """One row per problem, method and step."""
    rows: list[tuple[Cell, ...]] = [
        (
            trial.problem,
            trial.method,
            trial.dt,
            trial.energy_ratio_min,
            trial.energy_ratio_max,
            trial.error,
            trial.outcome,
            trial.verdict,
            trial.time,
            trial.error_of,
        )
        for trial in trials
    ]
    return Table(FAILURE_COLUMNS, rows)
