"""Figure of an incremental dynamic analysis: a gray curve for each record, fractiles, capacities."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.campaign.ida.curve import IdaCurve, fractiles
from tdint.campaign.ida.study import IdaStudy
from tdint.campaign.suites.intensity import MotionIntensity
from tdint.output.figures.style import COLORS, DASHES, add_title, changed, record_name
from tdint.output.figures.suites import add_gravity_axis, measure_label, single_look
from tdint.written_numbers import how_many

_PARTS = (0.16, 0.5, 0.84)
_POINTS = 240
_FEW = 3  # records: fewer have no fractiles
_ROOM = 1.1  # the axis of intensity ends so far above the largest capacity
_BEYOND = 1.04  # of drift: where flat lines end


def ida_picture(study: IdaStudy) -> Figure:
    """Picture of a study, in the units that its intensities have (`IdaStudy.in_units`)."""
    figure = Figure(figsize=(7.2, 5.2), layout="constrained")
    draw_ida(figure.subplots(), study)
    add_title(figure, _title(study))
    return figure


def draw_ida(axes: Any, study: IdaStudy) -> None:
    """The curves of a study with their fractiles and capacities."""
    limit = _largest_drift(study)
    states = study.states
    count = len(states[0].curves)
    look = single_look(count > 1 or len(states) > 1)
    axes.plot([], [], label=how_many(count, "record"), **look)
    for curve in study.curves:
        _draw_curve(axes, curve, limit, look)
    for state, color in zip(states, (COLORS[0], *COLORS[2:]), strict=False):
        _draw_fractiles(axes, state, limit, color, several=len(states) > 1)
    for state in states:
        _draw_capacities(axes, state, limit)
    _draw_lost(axes, study, limit)
    axes.set(xlim=(0.0, 100.0 * _BEYOND * limit), ylim=(0.0, _ROOM * (max(map(_highest, study.curves)) or 1.0)))
    axes.set(xlabel="largest drift ratio (%)", ylabel=measure_label(study.im_name, study.measure.unit))
    add_gravity_axis(axes, study.measure.unit)
    axes.legend(loc="lower right", frameon=True, framealpha=0.9, edgecolor="none")


def _highest(curve: IdaCurve) -> float:
    """The largest intensity that is shown of a curve: its capacity, or the largest level that the building stands."""
    known = [run.im for run in curve.stable]
    if math.isfinite(curve.collapse.capacity):
        known.append(curve.collapse.capacity)
    return max(known, default=0.0)


def _largest_drift(study: IdaStudy) -> float:
    """The drift ratio at which the axis ends: that of collapse, where some building collapses or comes near to it."""
    collapse_drift = study.model.collapse_drift
    largest = max((run.drift_ratio for curve in study.curves for run in curve.stable), default=0.0)
    collapses = any(not curve.collapse.censored for curve in study.curves)
    if collapses or largest > 0.5 * collapse_drift or largest == 0.0:
        return collapse_drift
    return largest


def _draw_curve(axes: Any, curve: IdaCurve, limit: float, look: dict[str, Any]) -> None:
    """From the origin, or the drift that was left, through the runs that stand; flat from the capacity on."""
    drift = [curve.left, *(run.drift_ratio for run in curve.stable)]
    im = [0.0, *(run.im for run in curve.stable)]
    if not curve.collapse.censored and curve.stable:
        drift += [drift[-1], _BEYOND * limit]
        im += [curve.collapse.capacity] * 2
    axes.plot(100.0 * np.array(drift), im, zorder=1, **look)


def _draw_fractiles(axes: Any, study: IdaStudy, limit: float, color: str, *, several: bool) -> None:
    """Fractiles of a state; where there are `several`, the median alone, and of few records each curve."""
    damage = study.curves[0].damage
    state = (f", damaged to {100.0 * damage:g} %" if damage else ", intact") * several
    if len(study.curves) < _FEW:
        for curve in study.curves if several else ():
            _draw_curve(axes, curve, limit, {"color": color, "linewidth": 1.6, "label": state.removeprefix(", ")})
            state = ""
        return
    drifts = np.linspace(0.0, limit, _POINTS)[1:]
    for part, row in reversed(list(zip(_PARTS, fractiles(study.curves, drifts, _PARTS), strict=True))):
        if not np.isfinite(row).any() or (several and part != 0.5):
            continue
        style = {"linewidth": 2.2} if part == 0.5 else {"linestyle": DASHES[1], "linewidth": 1.4}
        label = f"median{state}" if part == 0.5 else "16 % and 84 %" if part == _PARTS[0] else None
        start = [] if damage else [0.0]  # a damaged building does not begin at rest in the origin
        axes.plot([*start, *(100.0 * drifts)], [*start, *row], color=color, zorder=3, label=label, **style)


def _draw_capacities(axes: Any, study: IdaStudy, limit: float) -> None:
    """A mark where each curve becomes flat, another where it ends for want of higher levels."""
    groups: dict[str, list[tuple[float, float]]] = {"collapse": [], "again": [], "censored": []}
    for curve in study.curves:
        if not curve.stable:
            continue
        drift = min(curve.stable[-1].drift_ratio, limit)
        kind = "censored" if curve.collapse.censored else "again" if curve.resurrection else "collapse"
        groups[kind].append((100.0 * drift, curve.collapse.capacity))
    looks = {
        "collapse": ("o", COLORS[1], "capacity against collapse"),
        "again": ("D", "white", "the same, stands again above it"),
        "censored": ("^", "white", "does not collapse up to here"),
    }
    for kind, points in groups.items():
        if points:
            marker, face, label = looks[kind]
            x, y = zip(*points, strict=True)
            # Of several states each kind is named once.
            shown = None if label in axes.get_legend_handles_labels()[1] else label
            axes.scatter(
                x, y, s=26, marker=marker, facecolor=face, edgecolor=COLORS[1], linewidth=1.1, zorder=4, label=shown
            )


def _draw_lost(axes: Any, study: IdaStudy, limit: float) -> None:
    """Levels of runs without a result, at the edge."""
    lost = [run.im for curve in study.curves for run in curve.runs if not (run.stable or run.collapsed)]
    if lost:
        axes.plot([100.0 * limit] * len(lost), lost, "x", color="0.4", label="run without a result", clip_on=False)


def _title(study: IdaStudy) -> str:
    records = [curve.record for curve in study.states[0].curves]
    what = f"{len(records)} records" if len(records) > 1 else f"{record_name(records[0].source)} {records[0].component}"
    text = f"{study.model.name}\nIncremental dynamic analysis, {what}{changed(records)}, {study.method}"
    if isinstance(study.measure, MotionIntensity) or study.measure.periods == (0.0,):
        return text
    return f"{text}, {100.0 * study.measure.damping:g} % damping of Sa"
