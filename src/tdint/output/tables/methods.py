"""Tables of methods: what they are, and what is measured of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from tdint.output.tables.columns import methods as columns
from tdint.output.tables.table import Table

if TYPE_CHECKING:
    from tdint.analysis.assessment.failures import Trial
    from tdint.analysis.assessment.order import ObservedOrder
    from tdint.analysis.assessment.overshoot import Overshoot
    from tdint.analysis.assessment.paper_examples import ExampleRun
    from tdint.analysis.assessment.stability import StabilityCurve
    from tdint.methods.method import Integrator


def method_table(integrators: Iterable[Integrator]) -> Table:
    """One row per method with its parameters' defaults and ranges; the other values are those at the defaults."""
    return Table.of_results(columns.METHOD, integrators)


def stability_table(curves: Iterable[StabilityCurve]) -> Table:
    """One row per method, damping ratio and step over period."""
    return Table.of_results(columns.STABILITY, curves)


def overshoot_table(motions: Iterable[Overshoot]) -> Table:
    """One row per method, start and step; step 0 is the start."""
    return Table.of_results(columns.OVERSHOOT, motions)


def order_table(measured: Iterable[ObservedOrder]) -> Table:
    """One row per method and frequency ratio."""
    return Table.of_results(columns.ORDER, measured)


def failure_table(trials: Iterable[Trial]) -> Table:
    """One row per problem, method and step."""
    return Table.of_results(columns.FAILURE, trials)


def example_table(runs: Sequence[ExampleRun], reference: str = "paper") -> Table:
    """One row per example, step, method and variant; methods are ranked by the displacement's error, best first.

    The rank is by the error against this one of `tdint.analysis.assessment.paper_examples.REFERENCES`.
    """
    rank = columns.rank(lambda one: _rank(one, runs, reference))
    return Table.of_results((*columns.EXAMPLE, rank, columns.OUTCOME), runs)


def _rank(one: ExampleRun, runs: Sequence[ExampleRun], reference: str) -> int | None:
    """Place among the methods as they are; none for a variant and for a run without an end."""
    error = one.error("displacement", reference)
    if one.variant or math.isnan(error):
        return None
    rivals = [run for run in runs if (run.example, run.dt, run.variant) == (one.example, one.dt, "")]
    return 1 + sum(run.error("displacement", reference) < error for run in rivals)
