"""Tables and summary of a chart of work against precision."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tdint.ground_motion.record import Record
from tdint.model.definition import Model
from tdint.output.summaries.summary import model_input, record_summary, versions
from tdint.output.tables.tables import Cell, Table

if TYPE_CHECKING:
    from tdint.analysis.chart.reference import Errors
    from tdint.analysis.chart.work_precision import Chart, Point

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


@dataclass(frozen=True)
class Advice:
    """What is recommended for an error within a limit; None where no point of the chart is."""

    limit: float
    point: Point | None


def error_of(errors: Errors | None, quantity: str) -> float:
    """One of the errors by its name in `QUANTITIES`; nan for none."""
    return math.nan if errors is None else float(getattr(errors, quantity.replace("-", "_")))


def chart_table(chart: Chart) -> Table:
    """One row per method and step; empty cells for what there is not."""
    return Table(CHART_COLUMNS, [_row(point) for point in chart.points])


def sizes_table(charts: Iterable[Chart]) -> Table:
    """The tables of several charts, with the number of stories before all."""
    rows = [(chart.stories, *_row(point)) for chart in charts for point in chart.points]
    return Table(("stories", *CHART_COLUMNS), rows)


def _row(point: Point) -> tuple[Cell, ...]:
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
    charts: Sequence[Chart],
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


def _reference(chart: Chart) -> Mapping[str, Any]:
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


def _point(point: Point, target: str) -> dict[str, Any]:
    return {
        "method": point.method,
        "dt_s": point.dt,
        "time_min_s": point.fastest,
        "error": error_of(point.errors, target),
        "outcome": point.outcome,
    }
