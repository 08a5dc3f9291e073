"""Tables and summary of a chart of work against precision.

The results of `tdint.analysis` fit the shapes told here as protocols, because imports run one way.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from tdint.ground_motion.record import Record
from tdint.model.definition import Model
from tdint.output.summaries.summary import model_input, record_summary, versions
from tdint.output.tables.tables import Cell, Table

QUANTITIES = {
    "peak-drift": "largest error of a story's peak drift",
    "drift": "error of the drifts (L2 of the history)",
    "displacement": "error of the displacements (L2 of the history)",
    "velocity": "error of the velocities (L2 of the history)",
    "acceleration": "error of the accelerations (L2 of the history)",
}
"""What a chart may show, and what it is."""

CHART_COLUMNS = (
    "method",
    "dt_s",
    "steps",
    "iterations",
    "time_s",
    "time_min_s",
    "error_displacement",
    "error_drift",
    "error_peak_drift",
    "error_acceleration",
    "outcome",
    "error_velocity",
)

PEER = "/"
"""In the name of a line that is another program's: program/method."""


class ErrorsOf(Protocol):
    """Relative errors of a motion."""

    @property
    def displacement(self) -> float: ...
    @property
    def drift(self) -> float: ...
    @property
    def velocity(self) -> float: ...
    @property
    def acceleration(self) -> float: ...
    @property
    def peak_drift(self) -> float: ...


class PointOf(Protocol):
    """One method with one step; nan for a step or a time that there is not."""

    @property
    def method(self) -> str: ...
    @property
    def line(self) -> str: ...
    @property
    def dt(self) -> float: ...
    @property
    def steps(self) -> int | None: ...
    @property
    def iterations(self) -> int | None: ...
    @property
    def time(self) -> float: ...
    @property
    def fastest(self) -> float: ...
    @property
    def errors(self) -> ErrorsOf | None: ...
    @property
    def outcome(self) -> str: ...


class ReferenceOf(Protocol):
    """How the reference was computed and how far another solution is from it."""

    @property
    def method(self) -> str: ...
    @property
    def dt(self) -> float: ...
    @property
    def confirmed_by(self) -> str: ...
    @property
    def gap(self) -> ErrorsOf: ...


class ChartOf(Protocol):
    """All points of one building, method by method, each from its largest step to its smallest."""

    @property
    def stories(self) -> int: ...
    @property
    def interval(self) -> float: ...
    @property
    def recorded(self) -> bool: ...
    @property
    def points(self) -> Sequence[PointOf]: ...
    @property
    def reference(self) -> ReferenceOf: ...
    @property
    def usual(self) -> PointOf: ...


@dataclass(frozen=True)
class Advice:
    """What is recommended for an error within a limit; None where no point of the chart is."""

    limit: float
    point: PointOf | None


def error_of(errors: ErrorsOf | None, quantity: str) -> float:
    """One of the errors by its name in `QUANTITIES`; nan for none."""
    return math.nan if errors is None else float(getattr(errors, quantity.replace("-", "_")))


def chart_table(chart: ChartOf) -> Table:
    """One row per method and step; empty cells for what there is not."""
    return Table(CHART_COLUMNS, [_row(point) for point in chart.points])


def sizes_table(charts: Iterable[ChartOf]) -> Table:
    """The tables of several charts, with the number of stories before all."""
    rows = [(chart.stories, *_row(point)) for chart in charts for point in chart.points]
    return Table(("stories", *CHART_COLUMNS), rows)


def _row(point: PointOf) -> tuple[Cell, ...]:
    names = ("displacement", "drift", "peak-drift", "acceleration")
    return (
        point.method,
        point.dt,
        point.steps,
        point.iterations,
        point.time,
        point.fastest,
        *(error_of(point.errors, name) for name in names),
        point.outcome,
        error_of(point.errors, "velocity"),
    )


def chart_summary(
    charts: Sequence[ChartOf],
    *,
    model: Model,
    record: Record | None,
    target: str,
    advice: Sequence[Advice],
    notes: Sequence[str],
) -> dict[str, Any]:
    """Content of the JSON file beside the table: the references and how well they are known, what is recommended."""
    file = model_input(model)
    return {
        "command": "chart",
        "name": model.name,
        "model": {"file": file.file, "sha256": file.sha256},
        "record": record_summary(record) if record else None,
        "target": target,
        "interval_s": charts[0].interval,
        "references": [_reference(chart) for chart in charts],
        "recommended": [_advice(one, target) for one in advice],
        "usual": _point(charts[0].usual, target) if len(charts) == 1 else None,
        "notes": list(notes),
        "versions": versions(),
    }


def _reference(chart: ChartOf) -> Mapping[str, Any]:
    reference = chart.reference
    return {
        "stories": chart.stories,
        "method": reference.method,
        "dt_s": reference.dt,
        "confirmed_by": reference.confirmed_by,
        "gap": {quantity.replace("-", "_"): error_of(reference.gap, quantity) for quantity in QUANTITIES},
    }


def _advice(advice: Advice, target: str) -> dict[str, Any]:
    return {"limit": advice.limit, **(_point(advice.point, target) if advice.point else {"method": None})}


def _point(point: PointOf, target: str) -> dict[str, Any]:
    return {
        "method": point.method,
        "dt_s": point.dt,
        "time_min_s": point.fastest,
        "error": error_of(point.errors, target),
        "outcome": point.outcome,
    }
