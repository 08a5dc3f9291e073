"""Tables of work-precision diagrams and performance profiles."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from tdint.output.tables.table import METHOD_SPEC, TEXT, Cell, Column, Table

if TYPE_CHECKING:
    from tdint.assessment.chart.performance_profiles import FieldChart
    from tdint.assessment.chart.work_precision import Chart
from tdint.output.tables.methods import _finite_or_nan


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
