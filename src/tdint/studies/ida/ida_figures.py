"""Figures of incremental dynamic analyses, with fractiles and capacities."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.fractiles import FRACTIONS
from tdint.number_parsing import pluralize
from tdint.output.figures.style import COLORS, changed, line_style, motion_name, new_axes, titled
from tdint.studies.fragility.fragility_function import initial_damage
from tdint.studies.ida.ida import IdaStudy
from tdint.studies.ida.ida_curve import IdaCurve, capacity_fractiles, fractile_drifts
from tdint.studies.motions import scaling_figures
from tdint.studies.motions.intensity import MotionIntensity

# ---- Collapse

_IM_MARGIN = 1.1  # upper end of the intensity axis divided by the maximum capacity
_DRIFT_MARGIN = 1.04  # end of flat lines divided by the maximum drift


def ida_picture(study: IdaStudy) -> Figure:
    """Plot an incremental dynamic analysis: intensity over maximum drift ratio.

    The axis has the unit of the intensities of `study`, which `IdaStudy.in_units` converts.
    """
    figure, axes = new_axes(7.2, 5.2)
    draw_ida(axes, study)
    records = [curve.record for curve in study.states[0].curves]
    subject = study.motions_text
    if len(records) == 1:
        subject = motion_name(records[0])
    title = (
        f"{study.model.name}\nIncremental dynamic analysis, {subject}{changed(records)}, "
        f"{study.method}"
    )
    # The damping ratio is stated for spectral accelerations, but not for PGA (the period 0).
    if not isinstance(study.measure, MotionIntensity) and study.measure.periods != (0.0,):
        title += f", {100.0 * study.measure.damping:g} % damping of Sa"
    return titled(figure, title)


def draw_ida(axes: Any, study: IdaStudy) -> None:
    """Plot the curves of an incremental dynamic analysis with their fractiles and capacities.

    Runs without a result are marked by crosses at the right edge. `study` has a state for each
    level of initial damage.
    """
    # The drift axis ends at the collapse drift if a building collapses or nearly collapses.
    limit = study.model.collapse_drift
    curves = study.motion_curves
    largest = max((run.drift_ratio for curve in curves for run in curve.stable), default=0.0)
    if 0.0 < largest <= 0.5 * limit and all(curve.collapse.censored for curve in curves):
        limit = largest
    states = study.states
    count = len(states[0].motion_curves)
    plot_style = scaling_figures.single_style(count > 1 or len(states) > 1)
    axes.plot(
        [], [], label=pluralize(count, "motion" if study.partners else "record"), **plot_style
    )
    for curve in study.motion_curves:
        _draw_curve(axes, curve, limit, plot_style)
    for number, state in enumerate(states):
        _draw_fractiles(axes, state, limit, number, several=len(states) > 1)
    for state in states:
        _draw_capacities(axes, state, limit)
    # The drift ratio of a failed run is unknown.
    failed_levels = [
        run.im for curve in study.curves for run in curve.runs if not (run.stable or run.collapsed)
    ]
    if failed_levels:
        axes.plot(
            [100.0 * limit] * len(failed_levels),
            failed_levels,
            "x",
            color="0.4",
            label="run without a result",
            clip_on=False,
        )
    capacities = (curve.collapse.capacity for curve in study.motion_curves)
    stable = (run.im for curve in study.motion_curves for run in curve.stable)
    highest = max((*filter(math.isfinite, capacities), *stable), default=0.0)
    axes.set(xlim=(0.0, 100.0 * _DRIFT_MARGIN * limit))
    axes.set(ylim=(0.0, _IM_MARGIN * (highest or 1.0)))
    axes.set(
        xlabel="maximum drift ratio (%)",
        ylabel=scaling_figures.measure_label(study.im_name, study.measure.unit),
    )


def _draw_curve(axes: Any, curve: IdaCurve, limit: float, plot_style: dict[str, Any]) -> None:
    """Plot the curve of a ground motion: intensity over maximum drift ratio in percent.

    The curve leads from the origin, or from the residual drift of a damaged building, through the
    runs without collapse. At the capacity, it continues horizontally to the right edge (`limit`).
    """
    drift = [curve.residual_drift_ratio, *(run.drift_ratio for run in curve.stable)]
    im = [0.0, *(run.im for run in curve.stable)]
    if not curve.collapse.censored and curve.stable:
        drift += [drift[-1], _DRIFT_MARGIN * limit]
        im += [curve.collapse.capacity] * 2
    axes.plot(100.0 * np.array(drift), im, zorder=1, **plot_style)


def _draw_fractiles(
    axes: Any, study: IdaStudy, limit: float, number: int, *, several: bool
) -> None:
    """Plot the fractiles of the curves for a state of initial damage; only the median if there are
    `several` states.

    Fewer than `MIN_MOTIONS` curves have no fractiles; they are plotted in the color of the state if
    there are several states.
    """
    damage = study.motion_curves[0].damage
    state = initial_damage(damage)
    if len(study.motion_curves) < scaling_figures.MIN_MOTIONS:
        for i, curve in enumerate(study.motion_curves if several else ()):
            # The curves of a state have the same style and one legend entry.
            style = line_style(number) | {"linewidth": 1.6, "label": "" if i else state}
            _draw_curve(axes, curve, limit, style)
        return
    drifts = fractile_drifts(limit)
    rows = capacity_fractiles(study.motion_curves, drifts)
    # In reverse order, the legend lists the median first; both dashed lines have an entry.
    for fraction, row in reversed(list(zip(FRACTIONS, rows, strict=True))):
        is_median = fraction == 0.5
        if not np.isfinite(row).any() or (several and not is_median):
            continue
        if is_median:
            style = {"linewidth": 2.2, "label": f"median, {state}" if several else "median"}
            style |= line_style(number)
        else:
            label = "16 % and 84 %" if fraction == FRACTIONS[0] else None
            style = line_style(0, 1) | {"linewidth": 1.4, "label": label}
        start = [] if damage else [0.0]  # a damaged building does not start at the origin
        shown = np.where(np.isinf(row), np.nan, row)
        axes.plot([*start, *(100.0 * drifts)], [*start, *shown], zorder=3, **style)


def _draw_capacities(axes: Any, study: IdaStudy, limit: float) -> None:
    """Mark the capacity of each curve, or the last level of a curve without collapse, at a drift
    ratio of at most `limit`. A curve without a run that is free of collapse has no mark, because
    the capacity has no drift."""
    # Points (drift ratio in percent, intensity) of each type of mark: marker, filling and label.
    collapse = ("o", COLORS[1], "capacity against collapse")
    resurrection = ("D", "white", "capacity, no collapse at a higher level")
    censored = ("^", "white", "does not collapse up to here")
    groups: dict[tuple[str, str, str], list[tuple[float, float]]] = {
        mark: [] for mark in (collapse, resurrection, censored)
    }
    for curve in study.motion_curves:
        if curve.stable:
            drift = min(curve.stable[-1].drift_ratio, limit)
            mark = resurrection if curve.resurrection else collapse
            if curve.collapse.censored:
                mark = censored
            groups[mark].append((100.0 * drift, curve.collapse.capacity))
    for (marker, face, label), points in groups.items():
        if points:
            x, y = zip(*points, strict=True)
            # Each type of mark has one legend entry for all states.
            legend_label = None if label in axes.get_legend_handles_labels()[1] else label
            axes.scatter(
                x,
                y,
                s=26,
                marker=marker,
                facecolor=face,
                edgecolor=COLORS[1],
                linewidth=1.1,
                zorder=4,
                label=legend_label,
            )
