"""Figures of the stability, accuracy and order of methods, and of the examples of the paper."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from tdint.arrays import Array
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    LIGHT,
    Style,
    add_legend,
    method_styles,
    new_axes,
    new_panels,
    plain_numbers,
    titled,
)

if TYPE_CHECKING:
    from tdint.assessment.examples.paper_examples import ExampleFigure, ExampleRun
    from tdint.assessment.order.order import ObservedOrder
    from tdint.assessment.stability.stability import Overshoot, StabilityCurve
    from tdint.model.definition import Model


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
    rows = [(3.0, (1, 1))] * 2 + [(2.4, (1,))] * band
    figure, panels = new_panels(7.5, *rows)
    radius, *others = panels[0] + panels[1]
    styles = _curve_styles(curves)
    lines = _draw_quantity(radius, curves, "spectral_radius", styles)
    quantities = ("amplitude_decay", "period_error", "numerical_damping")
    for axes, quantity in zip(others, quantities, strict=True):
        _draw_quantity(axes, curves, quantity, styles)
    # The additional panel shows the growth near the stability limit of linear acceleration. A
    # logarithmic axis would enlarge rounding errors, so that growth below `_ROUNDING` is omitted.
    if band:
        (zoom,) = panels[2]
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
    add_legend(figure, lines, _curve_labels(curves))
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
    figure, panels = new_panels(7.5, *[(3.1, (1, 1))] * 2, share="x")
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
    add_legend(figure, list(lines.values()), list(lines))
    first = motions[0]
    spring = "" if first.law == "linear" else f", {first.law} spring"
    ratios = ", ".join(f"{ratio:g}" for ratio in dampings)
    title = (
        f"First time steps with dt = {first.dt_over_t:g} T, damping ratio {ratios}{spring}, "
        "relative to the exact amplitude\n"
        "The exact motion remains in the shaded band"
    )
    return titled(figure, f"{first.method}\n{title}" if len(lines) == 1 else title)


def line_styles(methods: Sequence[str], dampings: Sequence[float]) -> list[Style]:
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


def plot(axes: Any, x: Array, y: Array, style: Style) -> list[Any]:
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
    figure, axes = new_axes(7.5, 4.6)
    lines = _draw_quantity(axes, curves, quantity, thinned(_curve_styles(curves), thin))
    add_legend(figure, lines, _curve_labels(curves))
    return titled(figure, title)


def _curve_styles(curves: Sequence[StabilityCurve | Overshoot]) -> list[Style]:
    """Return the line style of each curve."""
    return line_styles([curve.method for curve in curves], [curve.damping for curve in curves])


def thinned(styles: list[Style], count: int) -> list[Style]:
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
    axes: Any, curves: Sequence[StabilityCurve], quantity: str, styles: Sequence[Style]
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


def order_picture(measured: Sequence[ObservedOrder], name: str = "", thin: int = 0) -> Figure:
    """Plot observed orders of convergence.

    The x axis is the frequency ratio if the orders were measured for several frequency ratios of
    the load. Otherwise each method has a row of markers for displacement, velocity and
    acceleration.

    Parameters
    ----------
    measured : sequence of ObservedOrder
        Observed order of each method and frequency ratio, for a single load; at least one.
    name : str
        Text before the title, such as the name of the figure; empty by default.
    """
    first = measured[0]
    has_ratio = not math.isnan(first.frequency_ratio)
    several = len({order.frequency_ratio for order in measured}) > 1
    # The lines of many methods would cover each other, because most have the same order.
    is_clear = len({order.method for order in measured}) <= _MAX_ORDER_LINES
    is_curve = several and has_ratio and is_clear
    figure = _draw_orders(measured, thin) if is_curve else _draw_order_chart(measured)
    # The title states the properties that all curves share, so that the legend is short.
    loads = {
        "free": "free vibration",
        "harmonic": "harmonic load",
        "record": "a record that is linear between its samples",
    }
    title = f"Observed order: {loads.get(first.load, first.load)}, {first.law} law"
    if has_ratio and not several:
        title += f", frequency ratio {first.frequency_ratio:g}"
    if len({order.method for order in measured}) == 1:
        title = f"{first.method}\n{title}"
    return titled(figure, name + title)


_MAX_ORDER_LINES = 8  # methods in a figure of orders over the frequency ratio


def _draw_orders(measured: Sequence[ObservedOrder], thin: int) -> Figure:
    """Plot observed order and error at the smallest time step over the frequency ratio."""
    figure, ((upper,), (lower,)) = new_panels(7.5, (3.3, (1,)), (3.3, (1,)), share="x")
    methods = list(dict.fromkeys(order.method for order in measured))
    lines = []
    # All lines have the same damping ratio, 0.0, so that styles differ only by method.
    styles = thinned(line_styles(methods, [0.0] * len(methods)), thin)
    for method, style in zip(methods, styles, strict=True):
        orders = [order for order in measured if order.method == method]
        ratios = np.array([order.frequency_ratio for order in orders])
        lines += plot(
            upper, ratios, np.array([order.order("displacement") for order in orders]), style
        )
        plot(lower, ratios, np.array([order.displacement[-1] for order in orders]), style)
    upper.set_ylabel("observed order of displacement")
    upper.yaxis.set_major_locator(MaxNLocator(integer=True))
    bottom, top = upper.get_ylim()
    upper.set_ylim(min(bottom, 0.5), max(top, 4.5))
    lower.set(ylabel="relative error at the smallest time step", yscale="log", xscale="log")
    lower.set_xlabel("ω₀ / ω, frequency of the load over natural frequency")
    lower.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    plain_numbers(lower.xaxis)
    lower.xaxis.set_minor_formatter(NullFormatter())
    add_legend(figure, lines, methods)
    return figure


def _draw_order_chart(measured: Sequence[ObservedOrder]) -> Figure:
    """Plot the observed orders of accuracy as markers, in a row for each method.

    Markers show the orders of displacement, velocity, acceleration and algorithmic acceleration. A
    row without order (the errors are rounding errors) has a text instead.
    """
    methods = list(dict.fromkeys(order.method for order in measured))
    figure, axes = new_axes(7.5, 1.9 + 0.24 * len(methods))
    rows = [len(methods) - methods.index(order.method) for order in measured]
    marks = (
        ("displacement", "o", 8.0, "none"),
        ("velocity", "s", 4.0, COLORS[1]),
        ("acceleration", "x", 6.0, COLORS[0]),
        ("algorithmic_acceleration", "^", 6.0, "none"),
    )
    for quantity, marker, size, fill in marks:
        orders = [order.order(quantity) for order in measured]
        label = "algorithmic acceleration" if quantity == "algorithmic_acceleration" else quantity
        mark: Style = {
            "markersize": size,
            "markerfacecolor": fill,
            "markeredgecolor": COLORS[0],
        }
        axes.plot(orders, rows, marker, **mark, label=label)
    for order, row in zip(measured, rows, strict=True):
        if math.isnan(order.order("displacement")):
            axes.text(
                0.08, row, "errors are rounding errors", va="center", fontsize=8.0, color="0.35"
            )
    axes.set_yticks(range(len(methods), 0, -1), methods, parse_math=False)
    axes.set(ylim=(0.3, len(methods) + 0.7), xlim=(0.0, 5.6), xlabel="observed order")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    add_legend(figure, *axes.get_legend_handles_labels())
    return figure


_NEAR = 3  # number of time steps on both sides of the peak in a close-up
_SHOWN = 2  # number of masses at each end of a long row
_SIDE = 0.5  # side of a mass divided by the distance between masses


def example_picture(
    about: str, runs: Sequence[ExampleRun], shown: ExampleFigure, exact: str, reference: str
) -> Figure:
    """Plot the displacement of a floor in an example of the paper, or its error, over the time.

    A second panel is a close-up at the peak.

    Parameters
    ----------
    runs : sequence of ExampleRun
        Runs of a single example and one time step; at least one run is completed. Variants are
        omitted.
    exact : str
        Label of the exact solution in the legend.
    reference : str
        Key of the exact solution in `tdint.assessment.examples.paper_examples.REFERENCES`.
    """
    runs = [run for run in runs if run.outcome == "done" and not run.variant]
    figure, ((history_axes, close_up_axes),) = new_panels(7.5, (3.8, (3, 2)))
    time = runs[0].motion.time
    exact_displacement = runs[0].exact(reference).displacement[:, shown.floor - 1]
    displacements = [run.motion.displacement[:, shown.floor - 1] for run in runs]
    # The plotted values of each run are absolute errors or displacements.
    values = displacements
    if shown.is_error:
        values = [np.abs(motion - exact_displacement) for motion in displacements]
    # The close-up is at the largest error of any run, or at the peak of the exact solution. `peak`
    # is the index of the time step.
    peak = int(np.argmax(np.max(values, axis=0) if shown.is_error else np.abs(exact_displacement)))
    close_up = slice(max(peak - _NEAR, 0), peak + _NEAR + 1)
    labels = [run.method for run in runs]
    styles = line_styles(labels, [0.0] * len(labels))
    lines: dict[str, Any] = {}
    for axes, samples in ((history_axes, slice(None)), (close_up_axes, close_up)):
        if not shown.is_error:
            (lines[exact],) = axes.plot(
                time[samples], exact_displacement[samples], color="0.78", linewidth=4.0
            )
        # Each method has a line with markers at some time steps; in the close-up at every time
        # step.
        for motion, label, style in zip(values, labels, styles, strict=True):
            plot_style = (
                style | {"linewidth": 0.8} | ({"markevery": 1} if axes is close_up_axes else {})
            )
            (lines[label],) = axes.plot(time[samples], motion[samples], **plot_style)
        axes.set_xlabel("time (s)")
    quantity = "|u - u_exact|" if shown.is_error else "displacement u"
    history_axes.set_ylabel(f"{quantity} (m)", parse_math=False)
    history_axes.set_xlim(time[0], time[-1])
    history_axes.axvline(time[peak], color="0.3", linewidth=0.8)
    close_up_axes.set_title(f"close-up at {time[peak]:.4g} s")
    close_up_axes.xaxis.set_major_locator(MaxNLocator(3))
    if shown.is_error:
        for axes in (history_axes, close_up_axes):
            axes.set_ylim(bottom=0.0)
    add_legend(figure, list(lines.values()), list(lines))
    reference_text = f"; u_exact: {exact.removeprefix('exact: ')}" if shown.is_error else ""
    floor = f", floor {shown.floor}" if runs[0].motion.displacement.shape[1] > 1 else ""
    return titled(
        figure,
        f"Figure {shown.number}: {about}\n{quantity}{floor}, dt {runs[0].dt:g} s{reference_text}",
    )


# ---- Drawing of a building: masses in a row between springs and dashpots, the first at a wall


def row_picture(title: str, model: Model) -> Figure:
    """Plot a building as a row of masses, springs and dashpots between a wall and a free end.

    Only the first and the last masses of a long row are plotted, with three dots between them. In
    the coordinates of the figure, the distance between masses is 1 and the row is at the height 0.

    Parameters
    ----------
    model : Model
        Building with polynomial laws and linear dashpots. Forces on its floors are written above
        the masses.
    """
    count = len(model.stories)
    is_cut = count > 2 * _SHOWN
    shown = [*range(_SHOWN), *range(count - _SHOWN, count)] if is_cut else list(range(count))
    figure, axes = new_axes(7.5, 2.9)
    # Three dots have the width of a mass. `is_cut` (True) counts as 1.
    axes.set(xlim=(-0.15, len(shown) + is_cut + 0.5), ylim=(-0.85, 0.95), aspect="equal")
    axes.axis("off")
    axes.add_patch(
        Rectangle((-0.12, -0.4), 0.12, 0.8, facecolor="0.85", hatch="////", edgecolor="0.4")
    )
    for position, index in enumerate(shown):
        left = position + 1.0 - _SIDE  # left side of the mass
        if is_cut and position >= _SHOWN:  # the mass is to the right of the three dots
            left += 1.0
        if is_cut and position == _SHOWN:
            axes.text(
                left - 1.0 + 0.5 * _SIDE, 0.0, "· · ·", ha="center", va="center", fontsize=14.0
            )
        _draw_link(axes, left - (1.0 - _SIDE), left)
        _draw_mass(axes, model, index, left)
    # The hysteretic laws are polynomials of the drift d. A law that all links have is written one
    # time, without the number of a link.
    laws: list[str] = []
    for story in model.stories:
        powers = zip(story.law.parameters, ("d", "d²", "d³"), strict=False)
        spring = " + ".join(f"{value:g} {power}" for value, power in powers if value)
        laws.append(f"f = {spring} N, dashpot {story.dashpot:g} N s/m")
    laws = list(dict.fromkeys(laws))
    if len(laws) > 1:
        laws = [f"link {i}: {law}" for i, law in enumerate(laws, start=1)]
    axes.text(0.0, -0.6, "\n".join(laws), ha="left", va="top", fontsize=7.5)
    return titled(figure, title)


def _draw_link(axes: Any, start: float, end: float) -> None:
    """Plot a spring and a dashpot below the spring, from the abscissa `start` to `end`."""
    black: Style = {"color": "black", "linewidth": 0.9}
    middle = 0.5 * (start + end)
    # The spring is a zigzag line between two straight parts.
    teeth = np.array([0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0, 0.0, 0.0])
    axes.plot(np.linspace(start, end, 9), 0.13 + 0.05 * teeth, **black)
    # The lines of the dashpot are the rod, the piston, the cylinder and its connection.
    axes.plot([start, middle], [-0.13, -0.13], **black)
    axes.plot([middle, middle], [-0.18, -0.08], **black)
    cylinder = [middle - 0.06, middle + 0.06, middle + 0.06, middle - 0.06]
    axes.plot(cylinder, [-0.2, -0.2, -0.06, -0.06], **black)
    axes.plot([middle + 0.06, end], [-0.13, -0.13], **black)


def _draw_mass(axes: Any, model: Model, index: int, left: float) -> None:
    """Plot the mass of a floor with its number and its force.

    `index` is the index of the floor, from 0.
    """
    axes.add_patch(
        Rectangle((left, -0.5 * _SIDE), _SIDE, _SIDE, facecolor="0.93", edgecolor="black")
    )
    center = left + 0.5 * _SIDE
    mass = f"{model.stories[index].mass:g} kg"
    axes.text(center, 0.0, mass, ha="center", va="center", fontsize=7.5)
    axes.text(center, -0.4, f"{index + 1}", ha="center", va="center", fontsize=7.5)
    # The force on the floor is a sum of cosines and sines of the time t.
    terms: list[str] = []
    for force in model.excitation.forces:
        if force.floor == index + 1:
            for amplitude, function in ((force.cosine, "cos"), (force.sine, "sin")):
                if amplitude:
                    terms.append(f"{amplitude:g} {function} {force.omega:g}t")
    if terms:
        axes.annotate("", (left + _SIDE, 0.45), (left, 0.45), arrowprops={"arrowstyle": "->"})
        axes.text(center, 0.55, f"{' + '.join(terms)} N", ha="center", va="bottom", fontsize=7.0)
