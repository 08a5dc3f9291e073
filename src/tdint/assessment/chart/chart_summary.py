"""JSON summaries of charts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

from tdint.ground_motion.record import Record
from tdint.model.definition import Model
from tdint.response.defaults import PEAKS, QUANTITIES
from tdint.system import CLOCKS

if TYPE_CHECKING:
    from tdint.assessment.chart.performance_profiles import FieldChart
    from tdint.assessment.chart.work_precision import Chart, Point, Timing
from tdint.output.summary import model_input, record_summary, schema, versions


@dataclass(frozen=True)
class Advice:
    """Recommended method and time step for an error limit.

    Attributes
    ----------
    limit : float
        Limit of the relative error.
    point : Point | None
        Recommended point of the chart; None if no point meets the limit.
    next_best : Point | None
        Best point of another method.
    estimated_error : float
        Error of a peak drift that `tdint run` estimates at this point: maximum over the stories,
        divided by the peak drift; NaN if it is unknown.
    """

    limit: float
    point: Point | None
    next_best: Point | None
    estimated_error: float


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
    """Return the content of the JSON file of a work-precision diagram.

    It contains the reference solutions with their estimated accuracy, and the recommended methods.

    Parameters
    ----------
    meanings : mapping
        Units and meanings of the columns of the table.
    """
    return {
        "schema": schema("chart"),
        "command": "chart",
        "name": model.name,
        "model": model_input(model)._asdict(),
        "record": record_summary(record) if record else None,
        "target": target,
        "method_parameters": _parameters_of(
            point.line for chart in charts for point in chart.points
        ),
        "interval_s": charts[0].interval,
        "timing": [_timing(chart.timing) for chart in charts],
        "references": [
            {
                "stories": chart.stories,
                "method": chart.reference.method,
                "dt_s": chart.reference.dt,
                "confirmed_by": chart.reference.confirmed_by,
                "gap": {
                    quantity.replace("-", "_"): chart.reference.gap.of(quantity)
                    for quantity in QUANTITIES
                },
            }
            for chart in charts
        ],
        "peers": [asdict(peer) for chart in charts for peer in chart.peers],
        "recommended": [
            {"limit": advised.limit}
            | (_point(advised.point, target) if advised.point else {"method": None})
            | {
                "told_error": None
                if math.isnan(advised.estimated_error)
                else advised.estimated_error,
                "next_best": advised.next_best and _point(advised.next_best, target),
            }
            for advised in advice
        ],
        "usual": _point(charts[0].usual, target) if len(charts) == 1 else None,
        "notes": list(notes),
        "columns": meanings,
        "versions": versions(),
    }


def field_summary(
    chart: FieldChart, *, notes: Sequence[str], meanings: Mapping[str, Mapping[str, str]]
) -> dict[str, Any]:
    """Return the content of the JSON file of performance profiles.

    It contains the problems, the accuracy of their reference solutions, all measurements and the
    recommended methods.
    """
    peaks = [name.replace("-", "_") for name in PEAKS]
    # The accuracy of the reference and the points have other forms.
    omitted = ("gap", "points", "peer_gap", "peer_note")
    return {
        "schema": schema("profiles"),
        "command": "chart",
        "method_parameters": _parameters_of(chart.lines),
        "problems": [
            {
                field.name: getattr(case, field.name)
                for field in fields(case)
                if field.name not in omitted
            }
            | {
                "reference": "impulse4, 32 time steps per interval",
                "gap": asdict(case.gap),
                "points": [
                    [point.method, point.dt, point.outcome, point.iterations, point.fastest]
                    + [point.error(quantity) for quantity in asdict(case.gap)]
                    for point in case.points
                ],
            }
            for case in chart.measured
        ],
        # Order of the values in the lists of points. There are thousands of points, so their
        # values have no keys.
        "points": [
            "method",
            "dt_s",
            "outcome",
            "solves",
            "time_min_s",
            *(f"{quantity}_error" for quantity in peaks),
        ],
        "recommended": chart.leaders()._asdict(),
        "timing": _timing(chart.timing),
        "peers": [asdict(peer) for peer in chart.peers],
        "notes": list(notes),
        "columns": meanings,
        "versions": versions(),
    }


def _parameters_of(lines: Iterable[str]) -> dict[str, dict[str, float]]:
    """Return the parameters of each method of tdint, by the label of its line in a chart.

    Labels of other programs, such as `scipy/DOP853`, contain a slash. Labels of runs with a
    tolerance, such as `impulse4 by tolerance`, contain a space. Both are skipped.
    """
    from tdint.methods.catalogue import resolved  # most summaries do not need the catalogue

    # The condition is True for a label without a slash and without a space.
    return {line: resolved(line) for line in lines if not set("/ ") & set(line)}


def _timing(timing: Timing) -> Mapping[str, Any]:
    """Return the conditions of a time measurement for a JSON file: clock, repetitions, processor.

    `wall_over_processor_time` is above 1 if other programs used the processor meanwhile.
    """
    return {
        "clock": CLOCKS[timing.clock],
        "repeats": list(timing.repeats),
        "load": timing.load,
        "processor": timing.processor,
        "processors": timing.processors,
        "wall_over_processor_time": timing.stretch,
    }


def _point(point: Point, target: str) -> dict[str, Any]:
    """Return the description of a point of a work-precision diagram for a JSON file.

    Its error is the error of the quantity `target`, such as `peak-drift`.
    """
    return {
        "method": point.method,
        "dt_s": point.dt,
        "time_min_s": point.fastest,
        "error": point.error(target),
        "outcome": point.outcome,
    }
