"""Figures of what leads to collapse: an incremental dynamic analysis, a gray curve for each record with fractiles and
capacities; fragility functions over intensity with observations and 95 % confidence bands; a cloud with its line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.campaign.fragility.fits import CloudPoints, Fragility
from tdint.campaign.ida.curve import IdaCurve, fractiles
from tdint.campaign.ida.study import IdaStudy
from tdint.campaign.suites.intensity import MotionIntensity
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    MARKERS,
    add_title,
    changed,
    legend_columns,
    line_look,
    plain_logarithmic,
    record_name,
)
from tdint.output.figures.suites import GRAY, add_gravity_axis, measure_label, single_look
from tdint.written_numbers import how_many

_PARTS = (0.16, 0.5, 0.84)
_DRIFTS = 240
_FEW = 3  # records: fewer have no fractiles
_ROOM = 1.1  # the axis of intensity ends so far above the largest capacity
_BEYOND = 1.04  # of drift: where flat lines end


def ida_picture(study: IdaStudy) -> Figure:
    """Picture of a study, in the units that its intensities have (`IdaStudy.in_units`)."""
    figure = Figure(figsize=(7.2, 5.2), layout="constrained")
    draw_ida(figure.subplots(), study)
    add_title(figure, _ida_title(study))
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
    drifts = np.linspace(0.0, limit, _DRIFTS)[1:]
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


def _ida_title(study: IdaStudy) -> str:
    records = [curve.record for curve in study.states[0].curves]
    what = f"{len(records)} records" if len(records) > 1 else f"{record_name(records[0].source)} {records[0].component}"
    text = f"{study.model.name}\nIncremental dynamic analysis, {what}{changed(records)}, {study.method}"
    if isinstance(study.measure, MotionIntensity) or study.measure.periods == (0.0,):
        return text
    return f"{text}, {100.0 * study.measure.damping:g} % damping of Sa"


_POINTS = 300
_ACROSS = 4  # panels of types in a row
_FAR = 2.6  # standard deviations above the largest median at which the axis ends
_NAMES = {
    "stripes": "Fragility of stripes, maximum likelihood",
    "ida": "Fragility of capacities",
    "cloud": "Cloud and its fragility, maximum likelihood",
}


def fragility_picture(functions: Sequence[Fragility]) -> Figure:
    """Picture of functions of one fit and one intensity measure, one at least."""
    cloud = functions[0].cloud
    figure = Figure(figsize=(9.2 if cloud else 6.8, 4.6), layout="constrained")
    if cloud is None:
        draw_functions(figure.subplots(), functions)
    else:
        left, right = figure.subplots(1, 2)
        _draw_cloud(left, cloud, functions)
        draw_functions(right, functions)
    add_title(figure, _fragility_title(functions))
    return figure


def types_picture(functions: Sequence[Fragility]) -> Figure:
    """Picture of functions of types of buildings, a panel for each type with a curve for each damage state."""
    types = {name: [one for one in functions if one.type == name] for name in dict.fromkeys(f.type for f in functions)}
    states = list(dict.fromkeys(one.state for one in sorted(functions, key=lambda one: one.threshold)))
    wide = min(len(types), _ACROSS)
    high = -(-len(types) // wide)
    figure = Figure(figsize=(max(2.5 * wide, 5.0) + 0.6, 2.0 * high + 1.3), layout="constrained")
    grid = figure.subplots(high, wide, squeeze=False, sharey=True)
    for axes in grid.flat[len(types) :]:
        axes.set_visible(False)
    for place, (axes, (name, of_one)) in enumerate(zip(grid.flat, types.items(), strict=False)):
        _draw_type(axes, of_one, states)
        axes.set_title(name, fontsize="medium")
        if place % wide == 0:
            axes.set_ylabel("probability")
        alike = len({one.im for one in functions}) == 1
        if not alike or place >= len(types) - wide:
            axes.set_xlabel(_im_label(of_one[0]))
    lines = [axes.plot([], [], **line_look(i), linewidth=1.8)[0] for i in range(len(states))]
    figure.legend(lines, states, loc="outside lower center", ncols=legend_columns(states, 5), handlelength=3.2)
    add_title(figure, "Probability of reaching or exceeding damage states, 95 % confidence over the motions")
    return figure


def _draw_type(axes: Any, functions: Sequence[Fragility], states: Sequence[str]) -> None:
    """The functions of a type with what was observed and how sure they are."""
    end = _end(functions)
    im = np.linspace(0.0, end, _POINTS)[1:]
    for one in functions:
        i = states.index(one.state)
        style = line_look(i)
        if np.isfinite(one.covariance).all():
            axes.fill_between(im, *one.band(im), color=style["color"], alpha=0.08, linewidth=0.0)
            for edge in one.band(im):
                axes.plot(im, edge, linewidth=0.4, **style)
        axes.plot(im, one.probability(im, total=one.beta_model > 0.0), linewidth=1.6, **style)
        if one.points is not None:
            shown = one.points.im <= end
            mark = {"marker": MARKERS[i % len(MARKERS)], "markersize": 3.5, "markerfacecolor": "white"}
            axes.plot(
                one.points.im[shown], one.points.part[shown], linestyle="none", color=style["color"], zorder=4, **mark
            )
    axes.set(xlim=(0.0, end), ylim=(-0.01, 1.01))


def draw_functions(axes: Any, functions: Sequence[Fragility]) -> None:
    """The functions with their observations and confidence bands."""
    end = _end(functions)
    im = np.linspace(0.0, end, _POINTS)[1:]
    for i, function in enumerate(functions):
        look = line_look(i)
        color = look["color"]
        low, high = function.band(im)
        axes.fill_between(im, low, high, color=color, alpha=0.18 if len(functions) == 1 else 0.08, linewidth=0.0)
        for edge in (low, high):
            axes.plot(im, edge, **look, linewidth=0.5)
        axes.plot(im, function.probability(im), **look, linewidth=1.8, label=_label(function))
        if function.beta_model:
            whole, label = function.probability(im, total=True), rf"with $\beta_{{model}}$: {function.beta_total:.2f}"
            axes.plot(im, whole, color=color, linestyle=":", linewidth=1.2, label=label)
        if function.points is not None:
            shown = function.points.im <= end
            mark = {"marker": MARKERS[i % len(MARKERS)], "markersize": 4.5, "markerfacecolor": "white"}
            points = function.points.im[shown], function.points.part[shown]
            axes.plot(*points, linestyle="none", color=color, **mark, zorder=4)
    axes.fill_between([], [], [], color="0.5", alpha=0.25, label="95 % confidence")
    axes.set(xlim=(0.0, end), ylim=(-0.01, 1.01), xlabel=_im_label(functions[0]), ylabel="probability of exceedance")
    add_gravity_axis(axes, functions[0].unit, horizontal=True)
    title = None if math.isnan(functions[0].threshold) else "exceedance of"
    axes.legend(loc="lower right", frameon=True, framealpha=0.85, edgecolor="none", title=title, alignment="left")


def _end(functions: Sequence[Fragility]) -> float:
    """Where the axis of intensity ends: behind the functions, but not far behind all observations."""
    ends = []
    for one in functions:
        seen = one.points.im if one.points is not None else one.cloud.im if one.cloud is not None else np.array([])
        curve = one.theta * math.exp(_FAR * one.beta)
        most = float(np.max(seen)) if seen.size else curve
        ends.append(min(curve, 2.0 * max(most, one.theta)))
    return max(ends)


def _draw_cloud(axes: Any, cloud: CloudPoints, functions: Sequence[Fragility]) -> None:
    """Demands over intensities, both logarithmic, with the line and a standard deviation to both sides."""
    known = ~cloud.censored
    axes.scatter(cloud.im[known], cloud.edp[known], s=14, facecolor=GRAY, edgecolor="0.45", linewidth=0.5, label="runs")
    if cloud.censored.any():
        mark = {"s": 22, "marker": "^", "facecolor": "white", "edgecolor": "0.35", "linewidth": 0.8}
        axes.scatter(cloud.im[~known], cloud.edp[~known], **mark, label="above the limit")
    im = np.geomspace(np.min(cloud.im), np.max(cloud.im), 50)
    line = np.exp(cloud.intercept) * im**cloud.slope
    axes.plot(im, line, color=COLORS[0], linewidth=1.8, label=f"slope {cloud.slope:.3g}")
    for factor in (math.exp(-cloud.sigma), math.exp(cloud.sigma)):
        last = axes.plot(im, factor * line, color=COLORS[0], linestyle=DASHES[1])[0]
    last.set_label(rf"$\pm\sigma$ = {cloud.sigma:.3g}")
    for i, function in enumerate(functions):
        axes.axhline(function.threshold, **line_look(i), linewidth=0.9)
    plain_logarithmic(axes)
    edges = [*cloud.edp.tolist(), *(function.threshold for function in functions)]
    axes.set(ylim=(min(edges) / 1.6, 1.6 * max(edges)), xlabel=_im_label(functions[0]), ylabel="demand")
    axes.legend(loc="lower right", frameon=True, framealpha=0.85, edgecolor="none")


def _im_label(function: Fragility) -> str:
    return measure_label(function.im, function.unit)


def _label(function: Fragility) -> str:
    what = "" if math.isnan(function.threshold) else f"{function.threshold:g}: "
    if function.damage == function.damage:
        state = f"damaged to {100.0 * function.damage:g} %" if function.damage else "intact"
        what += f"{state}, "
    return rf"{what}$\theta$ = {function.theta:.3g}, $\beta$ = {function.beta:.2f}"


def _fragility_title(functions: Sequence[Fragility]) -> str:
    first = functions[0]
    text = _NAMES[first.fit]
    if first.fit == "ida":
        text += ", maximum likelihood" if any(one.censored for one in functions) else ", method of moments"
    count = how_many(first.records, "run" if first.fit == "cloud" else "record")
    numbers = {one.censored for one in functions}
    most = max(numbers)
    censored = f", {'up to ' * (len(numbers) > 1)}{most} censored" if most else ""
    return f"{text}\n{count}{censored}"
