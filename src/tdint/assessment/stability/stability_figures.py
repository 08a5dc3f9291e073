"""Figures of the stability, accuracy and overshoot of methods, readable in black and white."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from tdint.arrays import Array
from tdint.output.figures.legends import add_legend
from tdint.output.figures.style import (
    DASHES,
    LIGHT,
    NARROW,
    method_styles,
    titled,
)

if TYPE_CHECKING:
    from tdint.assessment.stability.stability import Overshoot, StabilityCurve


_ACCURACY_RANGE = 0.4  # maximum dt/T in figures of accuracy: 2.5 time steps per period
_RADIUS_RANGE = (1e-2, 1e3)  # widest range of dt/T in figures of the spectral radius
_BAND = (3.1, 3.7)  # omega dt around sqrt(12), the stability limit of linear acceleration
_ROUNDING = 1e-9  # a spectral radius that exceeds 1 by less is 1 with a rounding error
_THIN = 0.7  # points; width of additional lines
_MAX_AXIS = 1e4  # maximum of the axis of an overshoot; larger values are outside of the panel


def stability_picture(curves: Sequence[StabilityCurve], *, band: bool = False) -> Figure:
    """Plot spectral radius, period error, numerical damping and amplitude decay over dt/T.

    Parameters
    ----------
    band : bool
        True to add a panel of the growth per time step around omega dt = sqrt(12), on a logarithmic
        scale.
    """
    figure = Figure(figsize=(7.5, 8.6 if band else 6.4), layout="constrained")
    grid = figure.add_gridspec(3 if band else 2, 2)
    radius, *others = (figure.add_subplot(grid[i, j]) for i in (0, 1) for j in (0, 1))
    styles = _curve_styles(curves)
    lines = _draw_quantity(radius, curves, "spectral_radius", styles)
    quantities = ("amplitude_decay", "period_error", "numerical_damping")
    for axes, quantity in zip(others, quantities, strict=True):
        _draw_quantity(axes, curves, quantity, styles)
    # The additional panel shows the growth near the stability limit of linear acceleration. A
    # logarithmic axis would enlarge rounding errors, so that growth below `_ROUNDING` is omitted.
    if band:
        zoom = figure.add_subplot(grid[2, :])
        for curve, style in zip(curves, styles, strict=True):
            growth = curve.spectral_radius - 1.0
            plot(
                zoom,
                2.0 * math.pi * curve.dt_over_t,
                np.where(growth > _ROUNDING, growth, math.nan),
                style,
            )
        zoom.set(yscale="log", ylim=(1e-4, 1.0), xlim=_BAND)
        zoom.axvline(math.sqrt(12.0), color=LIGHT, linewidth=0.8)
        zoom.set(xlabel="ω dt (the line marks √12)", ylabel="spectral radius - 1")
    add_legend(figure, radius, lines, _curve_labels(curves), NARROW)
    # A figure with a single line has no legend, so that its title names the method.
    ratios = [f"{ratio:g}" for ratio in dict.fromkeys(curve.damping for curve in curves)]
    noun = "damping ratio" if len(ratios) == 1 else "damping ratios"
    title = f"One time step of an oscillator without load, {noun} {', '.join(ratios)}"
    if len(curves) == 1:
        title = f"{curves[0].method}\n{title}"
    return titled(figure, title)


def overshoot_picture(motions: Sequence[Overshoot]) -> Figure:
    """Plot displacement and velocity of an oscillator in the first time steps.

    Each row of panels is for another start: an initial displacement or an initial velocity. The
    values are divided by the amplitude of the exact motion, so that values above 1 are overshoot.

    Parameters
    ----------
    motions : sequence of Overshoot
        First time steps of each method, start and damping ratio; at least one.
    """
    figure = Figure(figsize=(7.5, 6.4), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True)
    starts = tuple(dict.fromkeys(motion.start for motion in motions))
    dampings = list(dict.fromkeys(motion.damping for motion in motions))
    lines = {}
    for motion, style, label in zip(
        motions, _curve_styles(motions), _curve_labels(motions), strict=True
    ):
        style |= {"markevery": 1, "marker": style.get("marker", "o")}
        displacement_axes, velocity_axes = panels[starts.index(motion.start)]
        (lines[label],) = displacement_axes.plot(motion.displacement, **style)
        velocity_axes.plot(motion.velocity, **style)
    for start, row in zip(starts, panels, strict=False):
        for axes, quantity in zip(row, ("displacement", "velocity"), strict=True):
            axes.set_title(f"{quantity}, from a {start}")
            axes.axhspan(-1.0, 1.0, color="0.92", zorder=0.5)
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            # If methods exceed the exact motion by orders of magnitude, the axis is logarithmic for
            # values above 1, the maximum of the exact motion.
            largest = max(
                float(np.nanmax(np.abs(line.get_ydata()), initial=1.0)) for line in axes.get_lines()
            )
            if largest > 10.0:
                axes.set_yscale("symlog", linthresh=1.0, linscale=1.0)
                axes.yaxis.set_minor_formatter(NullFormatter())
            limit = min(1.3 * largest, _MAX_AXIS)
            axes.set_ylim(-limit, limit)
    for axes in panels[-1]:
        axes.set_xlabel("step")
    add_legend(figure, panels[0, 0], list(lines.values()), list(lines), NARROW)
    first = motions[0]
    spring = "" if first.law == "linear" else f", {first.law} spring"
    ratios = ", ".join(f"{ratio:g}" for ratio in dampings)
    title = (
        f"First time steps with dt = {first.dt_over_t:g} T, damping ratio {ratios}{spring}, "
        "relative to the exact amplitude\n"
        "The exact motion remains in the shaded band"
    )
    return titled(figure, f"{first.method}\n{title}" if len(lines) == 1 else title)


def line_styles(methods: Sequence[str], dampings: Sequence[float]) -> list[dict[str, Any]]:
    """Return the style of each line as keyword arguments of matplotlib.

    The lines are distinguishable without color: methods differ by dashes and markers. If there are
    several damping ratios, the dashes distinguish the ratios, and the markers the methods.
    """
    method_index = {method: i for i, method in enumerate(dict.fromkeys(methods))}
    ratio_index = {ratio: i for i, ratio in enumerate(dict.fromkeys(dampings))}
    plot_styles, styles = method_styles(methods), []
    for method, ratio in zip(methods, dampings, strict=True):
        # Markers have a distance of 0.2 times the diagonal of the axes. They start at different
        # positions, so that markers of lines that coincide do not cover each other.
        start = 0.025 * (method_index[method] % 8)
        style = plot_styles[method] | {"markersize": 3.5, "markevery": (start, 0.2)}
        if len(ratio_index) > 1:
            style["linestyle"] = DASHES[ratio_index[ratio] % len(DASHES)]
        styles.append(style)
    return styles


_MAX_RADIUS = 1e3
"""Maximum spectral radius that is plotted; the axis ends at 1.25. On a line that rises to 1e14, the
placement of markers at equal distances along the line would not end."""


def plot(axes: Any, x: Array, y: Array, style: dict[str, Any]) -> list[Any]:
    """Plot a line, also if no point of it is finite.

    `x` and `y` are the points; nan is allowed.
    """
    # Without a finite point, matplotlib cannot compute the distances of markers along the line.
    if not np.any(np.isfinite(x) & np.isfinite(y)):
        style = {**style, "markevery": None}
    return list(axes.plot(x, y, **style))


def draw_radius(axes: Any, curves: Sequence[StabilityCurve]) -> None:
    """Plot the spectral radius of each curve over dt/T, with a legend."""
    styles = [
        style | {"label": label}
        for style, label in zip(_curve_styles(curves), _curve_labels(curves), strict=True)
    ]
    _draw_quantity(axes, curves, "spectral_radius", styles)
    axes.legend(loc="best")


def accuracy_picture(
    curves: Sequence[StabilityCurve], quantity: str, title: str, thin: int = 0
) -> Figure:
    """Plot a single quantity of stability or accuracy over dt/T.

    Parameters
    ----------
    quantity : str
        `spectral_radius`, `period_error`, `numerical_damping` or `amplitude_decay`.
    thin : int
        Number of curves at the end that have thin lines; 0 by default.
    """
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    axes = figure.subplots()
    lines = _draw_quantity(axes, curves, quantity, thinned(_curve_styles(curves), thin))
    add_legend(figure, axes, lines, _curve_labels(curves), NARROW)
    return titled(figure, title)


def _curve_styles(curves: Sequence[StabilityCurve | Overshoot]) -> list[dict[str, Any]]:
    """Return the line style of each curve."""
    return line_styles([curve.method for curve in curves], [curve.damping for curve in curves])


def thinned(styles: list[dict[str, Any]], count: int) -> list[dict[str, Any]]:
    """Return line styles where the last `count` lines are thin and have no markers."""
    first_thin = len(styles) - count
    return [
        *styles[:first_thin],
        *({**style, "linewidth": _THIN, "marker": None} for style in styles[first_thin:]),
    ]


def _curve_labels(curves: Sequence[StabilityCurve | Overshoot]) -> list[str]:
    """Return the label of each curve: the method, and the damping ratio if the ratios differ."""
    if len({curve.damping for curve in curves}) == 1:
        return [curve.method for curve in curves]
    return [f"{curve.method}, ξ {curve.damping:g}" for curve in curves]


_ACCURACY_AXES = {
    "period_error": ("period error (%)", -20.0, 60.0),
    "numerical_damping": ("numerical damping ratio (%)", -2.0, 20.0),
    "amplitude_decay": ("amplitude lost per cycle (%)", -10.0, 100.0),
}
"""Label and maximum range (percent) of the axis of each quantity. Methods with values outside of
this range are not useful."""


def _draw_quantity(
    axes: Any, curves: Sequence[StabilityCurve], quantity: str, styles: Sequence[dict[str, Any]]
) -> list[Any]:
    """Plot a quantity of each curve over dt/T, and set the ranges and the labels of the axes.

    `quantity` is the name of an attribute of the curves: `spectral_radius`, or a key of
    `_ACCURACY_AXES`, which is plotted in percent.
    """
    lines = []
    for curve, style in zip(curves, styles, strict=True):
        x, y = curve.dt_over_t, getattr(curve, quantity)
        # The line reaches the end of the axis, because points up to 1 % above the end are plotted.
        shown = x <= _ACCURACY_RANGE * 1.01
        if quantity == "spectral_radius":
            lines += plot(axes, x, np.minimum(y, _MAX_RADIUS), style)
        else:
            lines += plot(axes, x[shown], 100.0 * y[shown], style)
    axes.set_xlabel("dt / T")
    if quantity == "spectral_radius":
        axes.set_xscale("log")
        steps = np.concatenate([curve.dt_over_t for curve in curves])
        low = max(float(np.min(steps)), _RADIUS_RANGE[0])
        high = min(float(np.max(steps)), _RADIUS_RANGE[1])
        if low < high:
            axes.set_xlim(low, high)
        axes.axhline(1.0, color=LIGHT, linewidth=0.8)
        smallest = min(float(np.min(curve.spectral_radius)) for curve in curves)
        axes.set(ylim=(0.0 if smallest < 0.7 else 0.7, 1.25), ylabel="spectral radius")
        return lines
    # The axis includes at least -0.05 to 1 %; rounding errors are not visible in this range.
    name, min_bottom, max_top = _ACCURACY_AXES[quantity]
    bottom, top = axes.get_ylim()
    limits = min(max(bottom, min_bottom), -0.05), max(min(top, max_top), 1.0)
    axes.set(ylim=limits, xlim=(0.0, _ACCURACY_RANGE), ylabel=name)
    return lines
