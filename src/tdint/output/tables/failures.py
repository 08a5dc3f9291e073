"""Table of the problems on which methods fail.

The results of `tdint.analysis` fit the shape told here as a protocol, because imports run one way.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from tdint.output.tables.tables import Cell, Table

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


class TrialResult(Protocol):
    """One method on one problem with one step; nan for no number."""

    @property
    def problem(self) -> str: ...
    @property
    def method(self) -> str: ...
    @property
    def dt(self) -> float: ...
    @property
    def energy_ratio_min(self) -> float: ...
    @property
    def energy_ratio_max(self) -> float: ...
    @property
    def error(self) -> float: ...
    @property
    def error_of(self) -> str: ...
    @property
    def outcome(self) -> str: ...
    @property
    def verdict(self) -> str: ...
    @property
    def time(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def measure(self) -> float: ...


def failure_table(trials: Iterable[TrialResult]) -> Table:
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
