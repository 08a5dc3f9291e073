"""Tables of methods: what they are, what is measured of them, what they cost; and of validation
cases."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.methods.catalogue import references_of
from tdint.output.tables.table import DAMPING, METHOD_SPEC, Cell, Column, Table, cell_text
from tdint.units import suffix

if TYPE_CHECKING:
    from tdint.analysis.assessment.failures import Trial
    from tdint.analysis.assessment.order import ObservedOrder
    from tdint.analysis.assessment.paper_examples import ExampleRun
    from tdint.analysis.assessment.stability import Overshoot, StabilityCurve
    from tdint.analysis.chart.profiles import FieldChart
    from tdint.analysis.chart.work_precision import Chart
    from tdint.methods.method import Integrator, Method
    from tdint.validation import ValidationResult


def _uncut(name: str) -> Callable[[Any], str]:
    """A text of ours without commas, that a table can be split at them."""
    return lambda row: str(attrgetter(name)(row)).replace(",", ";")


def _power(value: float) -> float:
    """A power; nan for that of nothing, minus infinity."""
    return value if math.isfinite(value) else math.nan


def _or_none(name: str) -> Callable[[Any], float | str]:
    """A limit; none where there is none."""
    return lambda row: "none" if math.isinf(limit := attrgetter(name)(row)) else limit


METHOD = (
    Column("name", "text", "method.name", "name"),
    Column("family", "text", "family.name", "methods that share one compiled step"),
    Column(
        "parameters",
        "text",
        # beta=0.25 in [0 to 1]; theta=1.02 in [1 to 10] computed: a computed default follows from
        # the ones before it.
        lambda integrator: "; ".join(
            f"{parameter.name}={cell_text(value)} in {parameter.range.replace(',', ' to')}"
            + " computed" * callable(parameter.default)
            for parameter, value in zip(
                integrator.method.parameters, integrator.values, strict=True
            )
        ),
        "defaults and ranges",
    ),
    Column("order", "1", "order", "order of displacement and velocity for a smooth load"),
    Column(
        "implicit", "text", "implicit", "whether a step solves for the restoring force at its end"
    ),
    Column(
        "stability_limit",
        "1",
        _or_none("stability_limit"),
        "largest stable omega dt without damping; none for stable at any step",
    ),
    Column("rho_inf", "1", "rho_inf", "spectral radius for omega dt to infinity"),
    Column("source", "text", _uncut("method.source"), "who published it"),
)


DECLARATION = (
    Column("method", "text", "integrator.label", "method with its parameters"),
    Column("order", "1", "integrator.order", "declared order"),
    Column(
        "observed_order",
        "1",
        "order",
        "smallest of displacement and velocity, free and under a harmonic force",
    ),
    Column(
        "stability_limit",
        "1",
        _or_none("integrator.stability_limit"),
        "declared largest stable omega dt without damping",
    ),
    Column("measured_limit", "1", _or_none("limit"), "the same as measured"),
    Column(
        "rho_inf", "1", "integrator.rho_inf", "declared spectral radius for omega dt to infinity"
    ),
    Column("measured_rho_inf", "1", "rho_inf", "the same as measured"),
    Column("faults", "1", lambda one: len(one.faults), "declarations that do not hold"),
)

_DT_OVER_T = Column(
    "dt_over_t", "1", "dt_over_t", "step over the undamped period of the oscillator"
)

STABILITY = (
    METHOD_SPEC,
    DAMPING,
    _DT_OVER_T,
    Column(
        "spectral_radius",
        "1",
        "spectral_radius",
        "largest modulus of the eigenvalues of the amplification matrix",
    ),
    Column("period_error", "1", "period_error", "numerical over exact damped period, less 1"),
    Column(
        "numerical_damping",
        "1",
        "numerical_damping",
        "damping ratio of the numerical oscillation less the exact one",
    ),
    Column(
        "amplitude_decay",
        "1",
        "amplitude_decay",
        "part of the amplitude that the method takes in one cycle",
    ),
    Column(
        "spurious_radius",
        "1",
        "spurious_radius",
        "largest modulus of eigenvalues beside the principal pair",
    ),
)
OVERSHOOT = (
    METHOD_SPEC,
    DAMPING,
    _DT_OVER_T,
    Column("start", "text", "start", "what the oscillator starts from"),
    Column("step", "1", lambda motion: np.arange(motion.displacement.size), "step; 0 is the start"),
    Column("displacement", "1", "displacement", "over the largest one of the exact motion"),
    Column("velocity", "1", "velocity", "over the largest one of the exact motion"),
    Column(
        "displacement_power",
        "1",
        lambda one: _power(one.displacement_power),
        "power of omega dt in the first step's displacement; empty where the step leaves nothing "
        "of it",
    ),
    Column(
        "velocity_power",
        "1",
        lambda one: _power(one.velocity_power),
        "power of omega dt in the first step's velocity times dt; empty where the step leaves "
        "nothing of it",
    ),
    Column("law", "text", "law", "restoring force of the oscillator"),
)


def _order(quantity: str) -> Column:
    return Column(
        f"{quantity}_order",
        "1",
        lambda order: order.order(quantity),
        f"observed order of the {quantity}",
    )


ORDER = (
    METHOD_SPEC,
    Column("load", "text", "load", "load of the oscillator"),
    Column("law", "text", "law", "drift law of the oscillator"),
    Column(
        "frequency_ratio",
        "1",
        "frequency_ratio",
        "frequency of the load over that of the oscillator",
    ),
    *map(_order, ("displacement", "velocity", "acceleration", "algorithmic_acceleration")),
    Column(
        "displacement_error",
        "1",
        lambda one: float(one.displacement[-1]),
        "largest error with the smallest step, over the largest displacement",
    ),
)


def _chart_error(quantity: str, meaning: str, name: str = "") -> Column:
    return Column(
        f"{name or quantity}_error",
        "1",
        lambda point: math.nan if point.errors is None else getattr(point.errors, quantity),
        f"{meaning}, over that of the reference",
    )


CHART_STORIES = Column("stories", "1", "stories", "stories of the building")
CHART = (
    METHOD_SPEC,
    Column("dt_s", "s", "dt", "time step"),
    Column("steps", "1", "steps", "time steps"),
    Column("iterations", "1", "iterations", "solves; of scipy evaluations of the rate"),
    Column(
        "time_s",
        "s",
        "time",
        "median time of the compiled loop, on the clock that the summary names",
    ),
    Column("time_min_s", "s", "fastest", "least time of the compiled loop"),
    _chart_error(
        "displacement", "error of the displacements relative to the ground (L2 of the history)"
    ),
    _chart_error("drift", "error of the drifts (L2 of the history)"),
    _chart_error("peak_drift", "largest error of a story's peak drift"),
    _chart_error(
        "acceleration",
        "error of the absolute accelerations (L2 of the history)",
        name="absolute_acceleration",
    ),
    Column("outcome", "text", "outcome", "how `tdint run` ends"),
    _chart_error("velocity", "error of the velocities relative to the ground (L2 of the history)"),
)
FAILURE = (
    Column("problem", "text", "problem", "problem"),
    METHOD_SPEC,
    Column("dt_s", "s", "dt", "time step"),
    Column(
        "energy_ratio_min",
        "1",
        "energy_ratio_min",
        "least energy over the largest of the exact motion",
    ),
    Column(
        "energy_ratio_max",
        "1",
        "energy_ratio_max",
        "largest energy over the largest of the exact motion",
    ),
    Column("error", "1", "error", "what error_of says"),
    Column("outcome", "text", "outcome", "how `tdint run` ends"),
    Column("verdict", "text", "verdict", "pass, the fault found, or how the run failed"),
    Column("end_s", "s", "time", "last time reached"),
    Column("error_of", "text", _uncut("error_of"), "what the error is"),
)


def _example_errors(reference: str, against: str, prefix: str = "") -> tuple[Column, ...]:
    def column(quantity: str, unit: str) -> Column:
        about = f"largest error of the {quantity}, all floors, against {against}"
        name = f"{prefix}{quantity}{suffix(unit)}_error"
        return Column(name, unit, lambda run: run.error(quantity, reference), about)

    return tuple(map(column, ("displacement", "velocity", "acceleration"), ("m", "m/s", "m/s^2")))


EXAMPLE = (
    Column("example", "1", "example", "example of the paper"),
    METHOD_SPEC,
    Column("variant", "text", lambda run: run.variant or None, "what was done otherwise"),
    Column("dt_s", "s", "dt", "time step"),
    *_example_errors("paper", "what the paper calls exact: newmark-linear with 0.001 or 0.002 s"),
    *_example_errors("finer", "rk5 with steps 8 times finer", "finer_"),
)
OUTCOME = Column("outcome", "text", "outcome", "how the run ended")


def rank(of: Callable[[Any], int | None]) -> Column:
    """The column of a method's rank among others."""
    return Column(
        "rank",
        "1",
        of,
        "place by the displacement's error (that of --reference) among the methods, from 1",
    )


REFERENCE = (
    Column("method", "text", "method", "name"),
    Column(
        "reference",
        "text",
        "reference",
        "authors, year, title, place; of a plug-in's method its source",
    ),
    Column("doi", "text", "doi", "where it is known for sure"),
)


def reference_table(methods: Iterable[Method]) -> Table:
    """The publications of methods, a row for each."""
    rows: list[tuple[Cell, ...]] = []
    for method in methods:
        references = references_of(method)
        # The DOI has a column of its own; a plug-in's method has its source alone.
        rows += [
            (method.name, reference.text.partition(" doi:")[0].replace(",", ";"), reference.doi)
            for reference in references
        ]
        rows += [] if references else [(method.name, method.source.replace(",", ";"), "")]
    return Table.of(REFERENCE, rows)


def method_table(integrators: Iterable[Integrator]) -> Table:
    """One row per method with its parameters' defaults and ranges; the other values are those at
    the defaults."""
    return Table.of_results(METHOD, integrators)


def stability_table(curves: Iterable[StabilityCurve]) -> Table:
    """One row per method, damping ratio and step over period."""
    return Table.of_results(STABILITY, curves)


def overshoot_table(motions: Iterable[Overshoot]) -> Table:
    """One row per method, start and step; step 0 is the start."""
    return Table.of_results(OVERSHOOT, motions)


def order_table(measured: Iterable[ObservedOrder]) -> Table:
    """One row per method and frequency ratio."""
    return Table.of_results(ORDER, measured)


def failure_table(trials: Iterable[Trial]) -> Table:
    """One row per problem, method and step."""
    return Table.of_results(FAILURE, trials)


def example_table(runs: Sequence[ExampleRun], reference: str = "paper") -> Table:
    """One row per example, step, method and variant; methods are ranked by the displacement's
    error, best first.

    The rank is by the error against this one of
    `tdint.analysis.assessment.paper_examples.REFERENCES`.
    """

    def place(ranked: ExampleRun) -> int | None:
        """Among the methods as they are; none for a variant and for a run without an end."""
        error = ranked.error("displacement", reference)
        if ranked.variant or math.isnan(error):
            return None
        rivals = [
            run
            for run in runs
            if (run.example, run.dt, run.variant) == (ranked.example, ranked.dt, "")
        ]
        return 1 + sum(run.error("displacement", reference) < error for run in rivals)

    return Table.of_results((*EXAMPLE, rank(place), OUTCOME), runs)


PEER = "/"
"""In the name of a line that is another program's: program/method."""


def chart_table(chart: Chart) -> Table:
    """One row per method and step; empty cells for what there is not."""
    return Table.of_results(CHART, chart.points)


def sizes_table(charts: Iterable[Chart]) -> Table:
    """The tables of several charts, with the number of stories before all."""
    points = [((chart.stories,), point) for chart in charts for point in chart.points]
    return Table.of_results(
        (CHART_STORIES, *CHART), [point for _, point in points], [head for head, _ in points]
    )


def _within(factor: float, name: str = "") -> Column:
    meaning = f"of these, at no more than {factor:g} times the least cost"
    return Column(
        name or f"within_{factor:g}", "1", lambda profile: profile.within(factor), meaning
    )


PROFILE = (
    Column("quantity", "text", "quantity", "what the error is of"),
    Column("tolerance", "1", "tolerance", "largest relative error of a story"),
    METHOD_SPEC,
    Column(
        "problems",
        "1",
        "problems",
        "problems whose reference is known well enough, less those of not_run",
    ),
    Column("taken", "1", "taken", "of these, those that it takes; the others it does not solve"),
    Column(
        "not_run",
        "1",
        "not_run",
        "problems that are not counted, because the method has no step within the tolerance and "
        "its smaller steps were not run",
    ),
    Column(
        "solved",
        "1",
        "solved",
        "of these, with a step that is within the tolerance, as are all smaller ones",
    ),
    _within(1.1, "cheapest"),
    *map(_within, (2.0, 5.0, 10.0)),
    Column(
        "median_ratio",
        "1",
        lambda one: _power(one.median),
        "median of its cost over the least of our methods, of those taken; empty where half of "
        "these are not solved",
    ),
    Column("worst_ratio", "1", "worst", "the largest of those solved"),
)


def profile_table(chart: FieldChart) -> Table:
    """One row per quantity, tolerance and method."""
    return Table.of_results(PROFILE, chart.profiles)


MEASURED = ("time_s", "time_min_s", *(column.name for column in PROFILE[7:]))
"""Columns of a chart that hang on measured times: other ones in each run."""

VALIDATION = (
    Column("case", "text", "case.name", "name of the case"),
    Column("what", "text", _uncut("case.title"), "what it shows"),
    Column("source", "text", _uncut("case.source"), "where its numbers come from"),
    Column("numbers", "1", lambda one: len(one.case.published), "how many numbers are compared"),
    Column("unit", "text", _uncut("case.unit"), "unit of the numbers"),
    Column(
        "relative", "text", "case.relative", "whether differences are over the published numbers"
    ),
    Column(
        "largest_difference",
        "1",
        "largest",
        "largest difference of computed from published numbers",
    ),
    Column("tolerance", "1", "case.tolerance", "the largest difference that the case allows"),
    Column("difference_is", "text", _uncut("case.difference_is"), "what differences are made of"),
    Column("within", "text", "within", "whether all numbers are within the tolerance"),
)


def validation_table(results: Iterable[ValidationResult]) -> Table:
    """One row per case."""
    return Table.of_results(VALIDATION, results)
