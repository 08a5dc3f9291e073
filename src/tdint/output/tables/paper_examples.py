"""Errors of methods on the paper's examples as a table.

The results of `tdint.analysis` fit the shapes told here as protocols, because imports run one way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from tdint.output.results import Array
from tdint.output.tables.tables import Cell, Table

EXAMPLE_COLUMNS = (
    "example",
    "method",
    "variant",
    "dt_s",
    "error_displacement_m",
    "error_velocity_m_s",
    "error_acceleration_m_s2",
    "rank",
    "outcome",
)


class FloorMotion(Protocol):
    """Times (s), shape (steps + 1,), and motion of the floors, shape (steps + 1, n), SI."""

    @property
    def time(self) -> Array: ...
    @property
    def displacement(self) -> Array: ...
    @property
    def velocity(self) -> Array: ...
    @property
    def acceleration(self) -> Array: ...


class ExampleResult(Protocol):
    """One method on one example with one step; `variant` is what was done otherwise, empty for nothing."""

    @property
    def example(self) -> int: ...
    @property
    def method(self) -> str: ...
    @property
    def variant(self) -> str: ...
    @property
    def dt(self) -> float: ...
    @property
    def outcome(self) -> str: ...
    @property
    def motion(self) -> FloorMotion: ...
    @property
    def reference(self) -> FloorMotion: ...
    def error(self, quantity: str) -> float: ...


def example_table(runs: Sequence[ExampleResult]) -> Table:
    """One row per example, step, method and variant; methods are ranked by the displacement's error, best first."""
    rows: list[tuple[Cell, ...]] = [
        (
            one.example,
            one.method,
            one.variant or None,
            one.dt,
            one.error("displacement"),
            one.error("velocity"),
            one.error("acceleration"),
            _rank(one, runs),
            one.outcome,
        )
        for one in runs
    ]
    return Table(EXAMPLE_COLUMNS, rows)


def _rank(one: ExampleResult, runs: Sequence[ExampleResult]) -> int | None:
    """Place among the methods as they are; none for a variant and for a run without an end."""
    error = one.error("displacement")
    if one.variant or math.isnan(error):
        return None
    rivals = [run for run in runs if (run.example, run.dt, run.variant) == (one.example, one.dt, "")]
    return 1 + sum(run.error("displacement") < error for run in rivals)
