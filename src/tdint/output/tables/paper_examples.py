"""Errors of methods on the paper's examples as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.output.tables.tables import Cell, Table

if TYPE_CHECKING:
    from tdint.analysis.assessment.paper_examples import ExampleRun

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


def example_table(runs: Sequence[ExampleRun]) -> Table:
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


def _rank(one: ExampleRun, runs: Sequence[ExampleRun]) -> int | None:
    """Place among the methods as they are; none for a variant and for a run without an end."""
    error = one.error("displacement")
    if one.variant or math.isnan(error):
        return None
    rivals = [run for run in runs if (run.example, run.dt, run.variant) == (one.example, one.dt, "")]
    return 1 + sum(run.error("displacement") < error for run in rivals)
