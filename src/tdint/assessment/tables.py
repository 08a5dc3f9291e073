"""Tables of the laboratory of methods: stability, order, failures, examples, charts, validation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from tdint.output.tables.methods import _finite_or_nan, _limit_or_none, _without_commas
from tdint.output.tables.table import DAMPING, METHOD_SPEC, TEXT, Cell, Column, Table, numbered
from tdint.units import suffix

if TYPE_CHECKING:
    from tdint.assessment.chart.performance_profiles import FieldChart
    from tdint.assessment.chart.work_precision import Chart
    from tdint.assessment.examples.paper_examples import ExampleRun


DECLARATION = (
    Column("method", "text", "integrator.label", "method with its parameters"),
    Column.named("integrator.order", "declared order of accuracy"),
    Column(
        "observed_order",
        "1",
        "order",
        "minimum of the orders of displacement and velocity, in free vibration and under a "
        "harmonic force",
    ),
    Column(
        "stability_limit",
        "1",
        _limit_or_none("integrator.stability_limit"),
        "declared largest stable omega dt without damping",
    ),
    Column("measured_limit", "1", _limit_or_none("limit"), "measured largest stable omega dt"),
    Column.named("integrator.rho_inf", "declared spectral radius for omega dt to infinity"),
    Column("measured_rho_inf", "1", "rho_inf", "measured spectral radius for omega dt to infinity"),
    Column("faults", "1", lambda result: len(result.faults), "number of incorrect declarations"),
)

_DT_OVER_T = Column.named("dt_over_t", "time step divided by the undamped period of the oscillator")

STABILITY: tuple[Column, ...] = (
    METHOD_SPEC,
    DAMPING,
    _DT_OVER_T,
    Column.named(
        "spectral_radius", "maximum modulus of the eigenvalues of the amplification matrix"
    ),
    Column.named("period_error", "numerical damped period divided by exact damped period, minus 1"),
    Column.named(
        "numerical_damping",
        "damping ratio of the numerical oscillation minus the exact damping ratio",
    ),
    Column.named(
        "amplitude_decay", "fraction by which the method reduces the amplitude in one cycle"
    ),
    Column.named(
        "spurious_radius", "maximum modulus of the eigenvalues other than the principal pair"
    ),
)

OVERSHOOT: tuple[Column, ...] = (
    METHOD_SPEC,
    DAMPING,
    _DT_OVER_T,
    Column.named("start", "initial condition of the oscillator", TEXT),
    Column("step", "1", numbered("displacement", 0), "number of the time step; 0 is the start"),
    Column.named("displacement", "displacement divided by the maximum of the exact displacement"),
    Column.named("velocity", "velocity divided by the maximum of the exact velocity"),
    Column(
        "displacement_power",
        "1",
        lambda result: _finite_or_nan(result.displacement_power),
        "exponent of omega dt in the displacement after the first step; empty if this displacement "
        "is zero",
    ),
    Column(
        "velocity_power",
        "1",
        lambda result: _finite_or_nan(result.velocity_power),
        "exponent of omega dt in the velocity times dt after the first step; empty if this "
        "velocity is zero",
    ),
    Column.named("law", "restoring force of the oscillator", TEXT),
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
    Column.named("load", "load of the oscillator", TEXT),
    Column.named("law", "hysteretic law of the oscillator", TEXT),
    Column.named(
        "frequency_ratio", "frequency of the load divided by the frequency of the oscillator"
    ),
    *map(_order, ("displacement", "velocity", "acceleration", "algorithmic_acceleration")),
    Column(
        "displacement_error",
        "1",
        lambda result: float(result.displacement[-1]),
        "maximum error with the smallest time step, divided by the maximum displacement",
    ),
)


FAILURE = (
    Column.named("problem", "problem", TEXT),
    METHOD_SPEC,
    Column.named("dt", "time step", "s"),
    Column.named(
        "energy_ratio_min", "minimum energy divided by the maximum energy of the exact motion"
    ),
    Column.named(
        "energy_ratio_max", "maximum energy divided by the maximum energy of the exact motion"
    ),
    Column.named("error", "error of the quantity in error_of"),
    Column.named("outcome", "status with which `tdint run` ends", TEXT),
    Column.named("verdict", "pass, the detected defect, or the type of failure", TEXT),
    Column("end_s", "s", "time", "last time reached"),
    Column("error_of", "text", _without_commas("error_of"), "quantity of the error"),
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


EXAMPLE = (
    Column.named("example", "example of the paper"),
    METHOD_SPEC,
    Column("variant", "text", lambda run: run.variant or None, "variant of the analysis"),
    Column.named("dt", "time step", "s"),
    *_example_errors(
        "paper", "the reference of the paper: newmark-linear with time steps of 0.001 or 0.002 s"
    ),
    *_example_errors("finer", "rk5 with 8 times smaller time steps", "finer_"),
)

OUTCOME = Column.named("outcome", "status of the run", TEXT)


def rank(rank_of: Callable[[Any], int | None]) -> Column:
    """Return the column of the rank of a method.

    `rank_of` is a function that receives a result and returns its rank from 1; None results in an
    empty cell.
    """
    return Column(
        "rank",
        "1",
        rank_of,
        "rank of the method by the maximum displacement error (relative to --reference), from 1; "
        "methods with equal errors (within 5 %) have the same rank",
    )


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


def _chart_error(quantity: str, meaning: str, name: str = "") -> Column:
    """Return the column of an error in the table of a work-precision diagram.

    The cell of a point without errors, such as a failed run, is nan.

    `name` is the start of the column name; the quantity by default.
    """
    return Column(
        f"{name or quantity}_error",
        "1",
        lambda point: math.nan if point.errors is None else getattr(point.errors, quantity),
        f"{meaning}, relative to the reference",
    )


CHART_STORIES = Column.named("stories", "number of stories of the building")

CHART = (
    METHOD_SPEC,
    Column.named("dt", "time step", "s"),
    Column.named("steps", "number of time steps"),
    Column.named(
        "iterations",
        "number of solutions of the equations; for scipy, number of evaluations of the derivatives",
    ),
    Column.named(
        "time", "median time of the compiled loop, on the clock that the summary states", "s"
    ),
    Column("time_min_s", "s", "fastest", "minimum time of the compiled loop"),
    _chart_error(
        "displacement",
        "error of the displacements relative to the ground (L2 norm of the response history)",
    ),
    _chart_error("drift", "error of the drifts (L2 norm of the response history)"),
    _chart_error("peak_drift", "maximum error of the peak drift of a story"),
    _chart_error(
        "acceleration",
        "error of the absolute accelerations (L2 norm of the response history)",
        name="absolute_acceleration",
    ),
    Column.named("outcome", "status with which `tdint run` ends", TEXT),
    _chart_error(
        "velocity",
        "error of the velocities relative to the ground (L2 norm of the response history)",
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


PROFILE = (
    Column.named("quantity", "quantity of the error", TEXT),
    Column.named("tolerance", "maximum relative error over the stories"),
    METHOD_SPEC,
    Column.named(
        "problems",
        "number of problems with a sufficiently accurate reference, minus those of not_run",
    ),
    Column.named(
        "taken", "number of these problems that the method accepts; the others count as not solved"
    ),
    Column.named(
        "not_run",
        "number of excluded problems, for which no time step of the method is within the tolerance "
        "and smaller time steps were not run",
    ),
    Column.named(
        "solved",
        "number of these problems that are within the tolerance with one time step and all smaller "
        "time steps",
    ),
    _within(1.1, "cheapest"),
    *map(_within, (2.0, 5.0, 10.0)),
    Column(
        "median_ratio",
        "1",
        lambda result: _finite_or_nan(result.median),
        "median over the problems in taken of cost divided by the minimum cost of the methods of "
        "tdint; empty if half of these problems are not solved",
    ),
    Column("worst_ratio", "1", "worst", "maximum of this cost ratio over the solved problems"),
)


def profile_table(chart: FieldChart) -> Table:
    """Return the table of performance profiles (costs of methods over many problems), with a row
    per quantity, tolerance and method."""
    return Table.of_results(PROFILE, chart.profiles)


VALIDATION = (
    Column("case", "text", "case.name", "name of the case"),
    Column("what", "text", _without_commas("case.title"), "subject of the case"),
    Column("source", "text", _without_commas("case.source"), "source of the published numbers"),
    Column(
        "numbers",
        "1",
        lambda result: len(result.case.published),
        "number of compared published numbers",
    ),
    Column("unit", "text", _without_commas("case.unit"), "unit of the numbers"),
    Column.named(
        "case.relative", "true if differences are relative to the published numbers", TEXT
    ),
    Column(
        "largest_difference",
        "1",
        "largest",
        "maximum difference between computed and published numbers",
    ),
    Column.named("case.tolerance", "maximum allowed difference"),
    Column(
        "difference_is",
        "text",
        _without_commas("case.difference_is"),
        "cause of the difference: rounding of the source, numerical error or model error",
    ),
    Column.named("within", "true if all differences are within the tolerance", TEXT),
)
