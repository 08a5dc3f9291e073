"""Figures of the laboratory, readable in black and white: stability, overshoot, order, examples of the paper."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from tdint.arrays import Array
from tdint.output.figures.style import (
    COLORS,
    LIGHT,
    MARKERS,
    add_legend,
    add_title,
    legend_columns,
    line_look,
    plain_numbers,
)

if TYPE_CHECKING:
    from tdint.analysis.assessment.order import ObservedOrder
    from tdint.analysis.assessment.overshoot import Overshoot
    from tdint.analysis.assessment.paper_examples import ExampleFigure, ExampleRun
    from tdint.analysis.assessment.stability import StabilityCurve

_NARROW = 31  # labels that fit into three columns
_ACCURACY_RANGE = 0.4  # dt/T up to which accuracy is of interest
_RADIUS_RANGE = (1e-2, 1e3)  # dt/T
_BAND = (3.1, 3.7)  # omega dt around sqrt(12)
_ROUNDING = 1e-9  # what a spectral radius may lie above 1
_TALLEST = 1e4  # what runs away is cut here
_NEAR = 3  # steps on both sides of the peak that a close-up shows


def stability_picture(curves: Sequence[StabilityCurve], *, band: bool = False) -> Figure:
    """Picture of stability: spectral radius, period error, numerical damping and amplitude decay over dt/T.

    Parameters
    ----------
    curves : sequence of StabilityCurve
        A line each.
    band : bool
        Add a panel with the growth per step around omega dt = sqrt(12), on a log scale.
    """
    figure = Figure(figsize=(7.5, 8.6 if band else 6.4), layout="constrained")
    grid = figure.add_gridspec(3 if band else 2, 2)
    radius, decay, period, damping = (figure.add_subplot(grid[i, j]) for i in (0, 1) for j in (0, 1))
    zoom = figure.add_subplot(grid[2, :]) if band else None
    lines = []
    for curve, style in zip(curves, _curve_styles(curves), strict=True):
        x = curve.dt_over_t
        lines += _plot(radius, x, curve.spectral_radius, style)
        near = x <= _ACCURACY_RANGE * 1.01
        for axes, values in (
            (decay, curve.amplitude_decay),
            (period, curve.period_error),
            (damping, curve.numerical_damping),
        ):
            _plot(axes, x[near], 100.0 * values[near], style)
        if zoom is not None:
            growth = curve.spectral_radius - 1.0
            _plot(zoom, 2.0 * math.pi * x, np.where(growth > _ROUNDING, growth, math.nan), style)
    _frame_radius(radius, curves)
    _frame_accuracy(period, "period error (%)", -20.0, 60.0)
    _frame_accuracy(damping, "numerical damping ratio (%)", -2.0, 20.0)
    _frame_accuracy(decay, "amplitude lost per cycle (%)", -10.0, 100.0)
    if zoom is not None:
        _frame_band(zoom)
    add_legend(figure, radius, lines, _curve_labels(curves), _NARROW)
    add_title(figure, _stability_title(curves))
    return figure


def overshoot_picture(motions: Sequence[Overshoot]) -> Figure:
    """Picture of the first steps: displacement and velocity, from a displacement and from a velocity."""
    figure = Figure(figsize=(7.5, 6.4), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True)
    starts = tuple(dict.fromkeys(motion.start for motion in motions))
    methods = [motion.method for motion in motions]
    short = short_labels(methods)
    lines = {}
    for motion, style in zip(motions, line_styles(methods, [motion.damping for motion in motions]), strict=True):
        style |= {"markevery": 1, "marker": style.get("marker", "o")}
        row = panels[starts.index(motion.start)]
        (lines[motion.method],) = row[0].plot(motion.displacement, **style)
        row[1].plot(motion.velocity, **style)
    for start, row in zip(starts, panels, strict=False):
        for axes, quantity in zip(row, ("displacement", "velocity"), strict=True):
            axes.set_title(f"{quantity}, from a {start}")
            _frame_steps(axes)
    for axes in panels[-1]:
        axes.set_xlabel("step")
    add_legend(figure, panels[0, 0], list(lines.values()), [short[method] for method in lines], _NARROW)
    add_title(figure, _overshoot_title(motions, short))
    return figure


def order_picture(measured: Sequence[ObservedOrder]) -> Figure:
    """Picture of the observed order: over the frequency ratio, or for each method where the load has no frequency."""
    several = len({one.frequency_ratio for one in measured}) > 1 and not math.isnan(measured[0].frequency_ratio)
    return _draw_orders(measured) if several else _draw_order_chart(measured)


def short_labels(labels: Sequence[str]) -> dict[str, str]:
    """Labels with four digits per parameter, where they still differ from each other."""
    short = {label: re.sub(r"=([^,]+)", lambda match: f"={_number(float(match[1]))}", label) for label in labels}
    return short if len(set(short.values())) == len(short) else {label: label for label in labels}


def _number(value: float) -> str:
    """Four digits; a fraction such as 1/144 where it is one that they do not tell."""
    digits = f"{value:.4g}"
    whole = round(1.0 / value) if value else 0
    is_fraction = float(digits) != value and 0 < whole < 1000 and value == 1.0 / whole
    return f"1/{whole}" if is_fraction else digits


def line_styles(methods: Sequence[str], dampings: Sequence[float]) -> list[dict[str, Any]]:
    """Lines to be told apart without color: dashes and markers per method; dashes per damping ratio if there are
    several."""
    number = {method: i for i, method in enumerate(dict.fromkeys(methods))}
    ratios = {ratio: i for i, ratio in enumerate(dict.fromkeys(dampings))}
    styles = []
    for method, ratio in zip(methods, dampings, strict=True):
        i = number[method]
        dash = ratios[ratio] if len(ratios) > 1 else i
        style = line_look(i, dash) | {"markersize": 3.5}
        if len(number) > 4 or (len(number) > 1 and len(ratios) > 1):
            style |= {"marker": MARKERS[i % len(MARKERS)], "markevery": (0.025 * (i % 8), 0.2)}
        styles.append(style)
    return styles


def _plot(axes: Any, x: Array, y: Array, style: dict[str, Any]) -> list[Any]:
    """A line; matplotlib cannot space markers along one without a finite point."""
    if not np.any(np.isfinite(x) & np.isfinite(y)):
        style = {**style, "markevery": None}
    return list(axes.plot(x, y, **style))


def draw_radius(axes: Any, curves: Sequence[StabilityCurve]) -> None:
    """The spectral radius over dt/T."""
    labels = _curve_labels(curves)
    for curve, style, label in zip(curves, _curve_styles(curves), labels, strict=True):
        _plot(axes, curve.dt_over_t, curve.spectral_radius, {**style, "label": label})
    _frame_radius(axes, curves)
    axes.legend(loc="best")


def _curve_styles(curves: Sequence[StabilityCurve]) -> list[dict[str, Any]]:
    return line_styles([curve.method for curve in curves], [curve.damping for curve in curves])


def _curve_labels(curves: Sequence[StabilityCurve]) -> list[str]:
    short = short_labels([curve.method for curve in curves])
    several = len({curve.damping for curve in curves}) > 1
    return [short[curve.method] + (f", ξ {curve.damping:g}" if several else "") for curve in curves]


def _stability_title(curves: Sequence[StabilityCurve]) -> str:
    ratios = [f"{ratio:g}" for ratio in dict.fromkeys(curve.damping for curve in curves)]
    what = f"One step of an oscillator without load, damping ratio{'s' * (len(ratios) > 1)} {', '.join(ratios)}"
    return f"{short_labels([curves[0].method])[curves[0].method]}\n{what}" if len(curves) == 1 else what


def _frame_radius(axes: Any, curves: Sequence[StabilityCurve]) -> None:
    axes.set_xscale("log")
    low, high = (float(limit([limit(curve.dt_over_t) for curve in curves])) for limit in (np.min, np.max))
    low, high = max(low, _RADIUS_RANGE[0]), min(high, _RADIUS_RANGE[1])
    if low < high:
        axes.set_xlim(low, high)
    axes.axhline(1.0, color=LIGHT, linewidth=0.8)
    smallest = min(float(np.min(curve.spectral_radius)) for curve in curves)
    axes.set(ylim=(0.0 if smallest < 0.7 else 0.7, 1.25), xlabel="dt / T", ylabel="spectral radius")


def _frame_accuracy(axes: Any, name: str, low: float, high: float) -> None:
    """Limits within `low` and `high`, and not so narrow that rounding is seen."""
    bottom, top = axes.get_ylim()
    axes.set(ylim=(min(max(bottom, low), -0.05), max(min(top, high), 1.0)), xlim=(0.0, _ACCURACY_RANGE))
    axes.set(xlabel="dt / T", ylabel=name)


def _frame_band(axes: Any) -> None:
    axes.set(yscale="log", ylim=(1e-4, 1.0))
    axes.set_xlim(*_BAND)
    axes.axvline(math.sqrt(12.0), color=LIGHT, linewidth=0.8)
    axes.set(xlabel="ω dt (the line marks √12)", ylabel="spectral radius - 1")


def _frame_steps(axes: Any) -> None:
    """Shade what the exact motion keeps to; logarithmic beyond where steps leave it far behind."""
    largest = max(float(np.nanmax(np.abs(line.get_ydata()), initial=1.0)) for line in axes.get_lines())
    axes.axhspan(-1.0, 1.0, color="0.92", zorder=0.5)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if largest > 10.0:
        axes.set_yscale("symlog", linthresh=1.0, linscale=1.0)
        axes.yaxis.set_minor_formatter(NullFormatter())
    reach = min(1.3 * largest, _TALLEST)
    axes.set_ylim(-reach, reach)


def _overshoot_title(motions: Sequence[Overshoot], short: dict[str, str]) -> str:
    first = motions[0]
    text = (
        f"First steps with dt = {first.dt_over_t:g} T, damping ratio {first.damping:g}, over the exact amplitude\n"
        "The exact motion stays in the shaded band"
    )
    return f"{short[first.method]}\n{text}" if len(short) == 1 else text


def _draw_orders(measured: Sequence[ObservedOrder]) -> Figure:
    """Observed order, and the error at the finest step, over the frequency ratio."""
    figure = Figure(figsize=(7.5, 6.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    methods = list(dict.fromkeys(one.method for one in measured))
    short = short_labels(methods)
    lines = []
    for method, style in zip(methods, line_styles(methods, [0.0] * len(methods)), strict=True):
        own = [one for one in measured if one.method == method]
        ratios = np.array([one.frequency_ratio for one in own])
        lines += _plot(upper, ratios, np.array([one.order("displacement") for one in own]), style)
        _plot(lower, ratios, np.array([one.displacement[-1] for one in own]), style)
    upper.set_ylabel("observed order of displacement")
    upper.yaxis.set_major_locator(MaxNLocator(integer=True))
    bottom, top = upper.get_ylim()
    upper.set_ylim(min(bottom, 0.5), max(top, 4.5))
    lower.set(ylabel="relative error at the finest step", yscale="log", xscale="log")
    lower.set_xlabel("frequency of the load over natural frequency")
    lower.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    plain_numbers(lower.xaxis)
    lower.xaxis.set_minor_formatter(NullFormatter())
    add_legend(figure, upper, lines, [short[method] for method in methods], _NARROW)
    add_title(figure, _order_title(measured))
    return figure


def _draw_order_chart(measured: Sequence[ObservedOrder]) -> Figure:
    """Observed orders of displacement, velocity and acceleration, one row of marks per method."""
    figure = Figure(figsize=(7.5, 1.9 + 0.24 * len(measured)), layout="constrained")
    axes = figure.subplots()
    short = short_labels([one.method for one in measured])
    rows = np.arange(len(measured), 0.0, -1.0)
    marks = (
        ("displacement", "o", 8.0, "none"),
        ("velocity", "s", 4.0, COLORS[1]),
        ("acceleration", "x", 6.0, COLORS[0]),
        ("own_acceleration", "^", 6.0, "none"),
    )
    for quantity, marker, size, fill in marks:
        orders = [one.order(quantity) for one in measured]
        label = "the method's own acceleration" if quantity == "own_acceleration" else quantity
        mark: dict[str, Any] = {"markersize": size, "markerfacecolor": fill, "markeredgecolor": COLORS[0]}
        axes.plot(orders, rows, marker, **mark, label=label)
    for one, row in zip(measured, rows, strict=True):
        if math.isnan(one.order("displacement")):
            axes.text(0.08, row, "errors are rounding", va="center", fontsize=8.0, color="0.35")
    axes.set_yticks(rows, [short[one.method] for one in measured], parse_math=False)
    axes.set(ylim=(0.3, len(measured) + 0.7), xlim=(0.0, 5.6))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("observed order")
    labels = axes.get_legend_handles_labels()[1]
    columns = legend_columns(labels, 4)
    figure.set_figheight(figure.get_figheight() + 0.17 * (math.ceil(len(labels) / columns) - 1))
    figure.legend(loc="outside lower center", ncols=columns, handlelength=1.2)
    add_title(figure, _order_title(measured))
    return figure


def _order_title(measured: Sequence[ObservedOrder]) -> str:
    first = measured[0]
    loads = {
        "free": "free vibration",
        "harmonic": "harmonic load",
        "record": "a record that is linear between its samples",
    }
    text = f"Observed order: {loads.get(first.load, first.load)}, {first.law} law"
    if len({one.frequency_ratio for one in measured}) == 1 and not math.isnan(first.frequency_ratio):
        text += f", frequency ratio {first.frequency_ratio:g}"
    if len({one.method for one in measured}) == 1:
        return f"{short_labels([first.method])[first.method]}\n{text}"
    return text


def example_picture(about: str, runs: Sequence[ExampleRun], shown: ExampleFigure, exact: str, reference: str) -> Figure:
    """One figure of the paper: displacement or error of a floor by several methods, with a close-up at the peak.

    Parameters
    ----------
    about : str
        What the example is, in a line.
    runs : sequence of ExampleRun
        Of one example and one step; at least one of them ended. Variants are left out.
    shown : ExampleFigure
        Which one.
    exact : str
        What is called exact: its name in the legend.
    reference : str
        Which one of `tdint.analysis.assessment.paper_examples.REFERENCES` that is.
    """
    runs = [run for run in runs if run.outcome == "done" and not run.variant]
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    wide, close = figure.subplots(1, 2, width_ratios=(2.6, 1.0))
    time = runs[0].motion.time
    true = runs[0].exact(reference).displacement[:, shown.floor - 1]
    found = [run.motion.displacement[:, shown.floor - 1] for run in runs]
    values = [np.abs(one - true) for one in found] if shown.is_error else found
    peak = int(np.argmax(np.max(values, axis=0) if shown.is_error else np.abs(true)))
    near = slice(max(peak - _NEAR, 0), peak + _NEAR + 1)
    labels = list(short_labels([run.method for run in runs]).values())
    lines: dict[str, Any] = {}
    for axes, part in ((wide, slice(None)), (close, near)):
        if not shown.is_error:
            (lines[exact],) = axes.plot(time[part], true[part], color="0.78", linewidth=4.0)
        lines |= _draw_motions(axes, time[part], [one[part] for one in values], labels, marked=axes is close)
    what = "|u - u_exact|" if shown.is_error else "displacement u"
    wide.set_ylabel(f"{what} (m)", parse_math=False)
    wide.set_xlim(time[0], time[-1])
    wide.axvline(time[peak], color="0.3", linewidth=0.8)
    close.set_title(f"close-up at {time[peak]:.4g} s")
    close.xaxis.set_major_locator(MaxNLocator(3))
    if shown.is_error:
        for axes in (wide, close):
            axes.set_ylim(bottom=0.0)
    add_legend(figure, wide, list(lines.values()), list(lines), _NARROW)
    beside = f"; u_exact: {exact.removeprefix('exact: ')}" if shown.is_error else ""
    floor = f", floor {shown.floor}" if runs[0].motion.displacement.shape[1] > 1 else ""
    add_title(figure, f"Figure {shown.number}: {about}\n{what}{floor}, dt {runs[0].dt:g} s{beside}")
    return figure


def _draw_motions(axes: Any, time: Array, values: Sequence[Any], labels: Sequence[str], marked: bool) -> dict[str, Any]:
    """A line for each method; with markers at every step, or at some. Lines by label."""
    lines = {}
    for one, label, style in zip(values, labels, line_styles(labels, [0.0] * len(labels)), strict=True):
        marks = {"markevery": 1} if marked else {}
        (line,) = axes.plot(time, one, **{**style, **marks}, linewidth=0.8)
        lines[label] = line
    axes.set_xlabel("time (s)")
    return lines
