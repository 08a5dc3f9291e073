"""Tables of the laboratory of methods: stability, order, failures, examples, charts, validation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from tdint.output.tables.columns import ColumnFile
from tdint.output.tables.methods import _finite_or_nan, _limit_or_none, _without_commas
from tdint.output.tables.table import (
    DAMPING,
    METHOD_SPEC,
    Cell,
    Column,
    Table,
    numbered,
    placeholder,
)
from tdint.units import suffix

if TYPE_CHECKING:
    from tdint.assessment.chart.performance_profiles import FieldChart
    from tdint.assessment.chart.work_precision import Chart, PerformanceProfile, Point
    from tdint.assessment.examples.paper_examples import ExampleRun
    from tdint.assessment.failures.failures import Trial
    from tdint.assessment.order.order import MethodCheck
    from tdint.assessment.validation.validation import ValidationResult


declared = ColumnFile(__file__)
"""Columns of `tables.csv`."""

_check: MethodCheck = placeholder()
DECLARATION = declared(
    "declaration",
    method=_check.integrator.label,
    order=_check.integrator.order,
    observed_order=_check.order,
    stability_limit=_limit_or_none(_check.integrator.stability_limit),
    measured_limit=_limit_or_none(_check.limit),
    rho_inf=_check.integrator.rho_inf,
    measured_rho_inf=_check.rho_inf,
    faults=lambda result: len(result.faults),
)

_OSCILLATOR = (METHOD_SPEC, DAMPING, *declared("dt_over_t"))

STABILITY = (*_OSCILLATOR, *declared("stability"))

OVERSHOOT = (
    *_OSCILLATOR,
    *declared(
        "overshoot",
        step=numbered("displacement", 0),
        displacement_power=lambda result: _finite_or_nan(result.displacement_power),
        velocity_power=lambda result: _finite_or_nan(result.velocity_power),
    ),
)


def _order(quantity: str) -> Column:
    """Return the column of the observed order of accuracy of a quantity, such as `velocity`."""
    return Column(
        f"{quantity}_order",
        "1",
        lambda order: order.order(quantity),
        f"observed order of accuracy of the {quantity}",
    )


ORDER = (
    METHOD_SPEC,
    *declared("order"),
    *map(_order, ("displacement", "velocity", "acceleration", "algorithmic_acceleration")),
    *declared("order_error", displacement_error=lambda result: float(result.displacement[-1])),
)


_trial: Trial = placeholder()
FAILURE = (
    *declared("failure-1"),
    METHOD_SPEC,
    *declared("failure-2", end_s=_trial.time, error_of=_without_commas(_trial.error_of)),
)


def _example_errors(reference: str, description: str, prefix: str = "") -> tuple[Column, ...]:
    """Return the columns of the errors of an example of the paper: displacement, velocity and
    acceleration.

    `reference` is the reference of the errors, a key of
    `tdint.assessment.examples.paper_examples.REFERENCES`. `prefix` is the start of the column
    names.
    """

    def column(quantity: str, unit: str) -> Column:
        """Return the column of the error of a quantity with this unit."""
        meaning = f"maximum error of the {quantity} over all floors, relative to {description}"
        name = f"{prefix}{quantity}{suffix(unit)}_error"
        return Column(name, unit, lambda run: run.error(quantity, reference), meaning)

    def norm_column(norm: str) -> Column:
        """Return the column of another norm of the displacement error."""
        meaning = f"{norm} error of the displacement over all floors, relative to {description}"
        name = f"{prefix}displacement_{norm}_m_error"
        return Column(name, "m", lambda run: run.error("displacement", reference, norm), meaning)

    maxima = map(column, ("displacement", "velocity", "acceleration"), ("m", "m/s", "m/s^2"))
    return (*maxima, norm_column("rms"), norm_column("mean"))


_EXAMPLE, *_RUN = declared("example", variant=lambda run: run.variant or None)
EXAMPLE = (
    _EXAMPLE,
    METHOD_SPEC,
    *_RUN,
    *_example_errors(
        "paper", "the reference of the paper: newmark-linear with time steps of 0.001 or 0.002 s"
    ),
    *_example_errors("finer", "rk5 with 8 times smaller time steps", "finer_"),
)

(OUTCOME,) = declared("outcome")


def rank(rank_of: Callable[[Any], int | None]) -> Column:
    """Return the column of the rank of a method.

    `rank_of` is a function that receives a result and returns its rank from 1; None results in an
    empty cell.
    """
    (column,) = declared("rank", rank=rank_of)
    return column


def example_table(runs: Sequence[ExampleRun], reference: str = "paper") -> Table:
    """Return the table of the errors in the examples of the paper, with a row per example, time
    step, method and variant.

    Methods are ranked by the displacement error relative to `reference`, a key of
    `tdint.assessment.examples.paper_examples.REFERENCES`.
    """
    # Imported here, because most commands do not need the examples.
    from tdint.assessment.examples.paper_examples import ordered_methods

    # Ranks by example, time step and method. Methods with equal errors share the smallest rank.
    ranks: dict[tuple[int, float, str], int] = {}
    for example, dt in dict.fromkeys((run.example, run.dt) for run in runs):
        compared = [run for run in runs if (run.example, run.dt) == (example, dt)]
        first_rank = 1
        for group in ordered_methods(compared, reference, "maximum"):
            ranks |= {(example, dt, method): first_rank for method in group}
            first_rank += len(group)

    def rank_of(run: ExampleRun) -> int | None:
        """Return the rank of a run; None for a variant and for a failed run."""
        return None if run.variant else ranks.get((run.example, run.dt, run.method))

    return Table.of_results((*EXAMPLE, rank(rank_of), OUTCOME), runs)


def _error(quantity: str) -> Callable[[Any], float]:
    """Return a function of a point of a work-precision diagram, which returns its error of a
    quantity; nan for a point without errors, such as a failed run."""
    return lambda point: math.nan if point.errors is None else getattr(point.errors, quantity)


(CHART_STORIES,) = declared("chart_stories")

_point: Point = placeholder()
CHART = (
    METHOD_SPEC,
    *declared(
        "chart",
        time_min_s=_point.fastest,
        displacement_error=_error("displacement"),
        drift_error=_error("drift"),
        peak_drift_error=_error("peak_drift"),
        absolute_acceleration_error=_error("acceleration"),
        velocity_error=_error("velocity"),
    ),
)


def chart_table(chart: Chart) -> Table:
    """Return the table of a work-precision diagram, with a row per method and time step; missing
    values are empty cells."""
    return Table.of_results(CHART, chart.points)


def sizes_table(charts: Iterable[Chart]) -> Table:
    """Return the table of the work-precision diagrams of buildings of different size, with the
    number of stories in the first column."""
    points: list[Any] = []
    heads: list[tuple[Cell, ...]] = []
    for chart in charts:
        points += chart.points
        heads += [(chart.stories,)] * len(chart.points)
    return Table.of_results((CHART_STORIES, *CHART), points, heads)


def _within(factor: float, name: str = "") -> Column:
    """Return the column of the number of problems that a method solves at a cost of at most
    `factor` times the minimum cost of the methods of tdint.

    `name` is the name of the column, by default `within_FACTOR`.
    """
    meaning = f"number of these problems with a cost of at most {factor:g} times the minimum cost"
    return Column(
        name or f"within_{factor:g}", "1", lambda profile: profile.within(factor), meaning
    )


_profile: PerformanceProfile = placeholder()
PROFILE = (
    *declared("profile-1"),
    METHOD_SPEC,
    *declared("profile-2"),
    _within(1.1, "cheapest"),
    *map(_within, (2.0, 5.0, 10.0)),
    *declared(
        "profile-3",
        median_ratio=lambda result: _finite_or_nan(result.median),
        worst_ratio=_profile.worst,
    ),
)


def profile_table(chart: FieldChart) -> Table:
    """Return the table of performance profiles (costs of methods over many problems), with a row
    per quantity, tolerance and method."""
    return Table.of_results(PROFILE, chart.profiles)


_validated: ValidationResult = placeholder()
VALIDATION = declared(
    "validation",
    case=_validated.case.name,
    what=_without_commas(_validated.case.title),
    source=_without_commas(_validated.case.source),
    numbers=lambda result: len(result.case.published),
    unit=_without_commas(_validated.case.unit),
    relative=_validated.case.relative,
    largest_difference=_validated.largest,
    tolerance=_validated.case.tolerance,
    difference_is=_without_commas(_validated.case.difference_is),
)
