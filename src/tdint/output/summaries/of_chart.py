"""Summary of a chart of work against precision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tdint.analysis.defaults import QUANTITIES
from tdint.ground_motion.record import Record
from tdint.model.definition import Model
from tdint.output.summaries.summary import model_input, record_summary, schema, versions

if TYPE_CHECKING:
    from tdint.analysis.chart.work_precision import Chart, Point


@dataclass(frozen=True)
class Advice:
    """What is recommended for an error within a limit, None where no point of the chart is; and what costs the same."""

    limit: float
    point: Point | None
    ties: Sequence[Point] = ()


def chart_summary(
    charts: Sequence[Chart],
    *,
    model: Model,
    record: Record | None,
    target: str,
    advice: Sequence[Advice],
    notes: Sequence[str],
    meanings: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    """Content of the JSON file beside the table: the references and how well they are known, what is recommended."""
    file = model_input(model)
    return {
        "schema": schema("chart"),
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
        "columns": meanings,
        "versions": versions(),
    }


def _reference(chart: Chart) -> Mapping[str, Any]:
    reference = chart.reference
    return {
        "stories": chart.stories,
        "method": reference.method,
        "dt_s": reference.dt,
        "confirmed_by": reference.confirmed_by,
        "gap": {quantity.replace("-", "_"): reference.gap.of(quantity) for quantity in QUANTITIES},
    }


def _advice(advice: Advice, target: str) -> dict[str, Any]:
    found = _point(advice.point, target) if advice.point else {"method": None}
    return {"limit": advice.limit, **found, "ties": [_point(tie, target) for tie in advice.ties]}


def _point(point: Point, target: str) -> dict[str, Any]:
    return {
        "method": point.method,
        "dt_s": point.dt,
        "time_min_s": point.fastest,
        "error": point.error(target),
        "outcome": point.outcome,
    }
