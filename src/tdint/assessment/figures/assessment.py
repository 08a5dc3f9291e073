"""Figures of methods, readable in black and white: stability, overshoot, order and work-precision
diagrams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from tdint.analysis.defaults import QUANTITIES
from tdint.arrays import Array
from tdint.assessment.figures.chart_notes import BAND_RULE, footnote, short_footnote
from tdint.number_parsing import pluralize
from tdint.output.figures.legends import add_legend, legend_columns
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    LIGHT,
    NARROW,
    is_narrow,
    method_styles,
    plain_minor_numbers,
    plain_numbers,
    titled,
    write_labels,
)
from tdint.output.tables.methods import PEER
from tdint.system import CLOCKS

if TYPE_CHECKING:
    from tdint.assessment.chart.work_precision import Chart, Point
    from tdint.assessment.order import ObservedOrder
    from tdint.assessment.stability import Overshoot, StabilityCurve

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
    radius, decay, period, damping = (
        figure.add_subplot(grid[i, j]) for i in (0, 1) for j in (0, 1)
    )
    styles = _curve_styles(curves)
    lines = _draw_quantity(radius, curves, "spectral_radius", styles)
    for axes, quantity in (
        (decay, "amplitude_decay"),
        (period, "period_error"),
        (damping, "numerical_damping"),
    ):
        _draw_quantity(axes, curves, quantity, styles)
    # The additional panel shows the growth near the stability limit of linear acceleration. A
    # logarithmic axis would enlarge rounding errors, so that growth below `_ROUNDING` is omitted.
    if band:
        zoom = figure.add_subplot(grid[2, :])
        for curve, style in zip(curves, styles, strict=True):
            growth = curve.spectral_radius - 1.0
            _plot(
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
    styles = line_styles(
        [motion.method for motion in motions], [motion.damping for motion in motions]
    )
    lines = {}
    for motion, style in zip(motions, styles, strict=True):
        style |= {"markevery": 1, "marker": style.get("marker", "o")}
        displacement_axes, velocity_axes = panels[starts.index(motion.start)]
        label = motion.method
        if len(dampings) > 1:
            label += f", ξ {motion.damping:g}"
        (lines[label],) = displacement_axes.plot(motion.displacement, **style)
        velocity_axes.plot(motion.velocity, **style)
    for start, row in zip(starts, panels, strict=False):
        for axes, quantity in zip(row, ("displacement", "velocity"), strict=True):
            axes.set_title(f"{quantity}, from a {start}")
            axes.axhspan(-1.0, 1.0, color="0.92", zorder=0.5)
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            # Some methods exceed the exact motion by orders of magnitude. The axis is then
            # logarithmic for values above 1, the maximum of the exact motion.
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
    figure = _draw_orders(measured, thin) if several and has_ratio else _draw_order_chart(measured)
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


def _plot(axes: Any, x: Array, y: Array, style: dict[str, Any]) -> list[Any]:
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
    lines = _draw_quantity(axes, curves, quantity, _thinned(_curve_styles(curves), thin))
    add_legend(figure, axes, lines, _curve_labels(curves), NARROW)
    return titled(figure, title)


def _curve_styles(curves: Sequence[StabilityCurve]) -> list[dict[str, Any]]:
    """Return the line style of each curve."""
    return line_styles([curve.method for curve in curves], [curve.damping for curve in curves])


def _thinned(styles: list[dict[str, Any]], count: int) -> list[dict[str, Any]]:
    """Return line styles in which the last `count` lines are thin and have no markers."""
    first_thin = len(styles) - count
    return [
        *styles[:first_thin],
        *({**style, "linewidth": _THIN, "marker": None} for style in styles[first_thin:]),
    ]


def _curve_labels(curves: Sequence[StabilityCurve]) -> list[str]:
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
            lines += _plot(axes, x, np.minimum(y, _MAX_RADIUS), style)
        else:
            lines += _plot(axes, x[shown], 100.0 * y[shown], style)
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


def _draw_orders(measured: Sequence[ObservedOrder], thin: int) -> Figure:
    """Plot observed order and error at the smallest time step over the frequency ratio."""
    figure = Figure(figsize=(7.5, 6.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    methods = list(dict.fromkeys(order.method for order in measured))
    lines = []
    # All lines have the same damping ratio, 0.0, so that styles differ only by method.
    damping_ratios = [0.0] * len(methods)
    styles = _thinned(line_styles(methods, damping_ratios), thin)
    for method, style in zip(methods, styles, strict=True):
        orders = [order for order in measured if order.method == method]
        ratios = np.array([order.frequency_ratio for order in orders])
        lines += _plot(
            upper, ratios, np.array([order.order("displacement") for order in orders]), style
        )
        _plot(lower, ratios, np.array([order.displacement[-1] for order in orders]), style)
    upper.set_ylabel("observed order of displacement")
    upper.yaxis.set_major_locator(MaxNLocator(integer=True))
    bottom, top = upper.get_ylim()
    upper.set_ylim(min(bottom, 0.5), max(top, 4.5))
    lower.set(ylabel="relative error at the smallest time step", yscale="log", xscale="log")
    lower.set_xlabel("ω₀ / ω, frequency of the load over natural frequency")
    lower.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    plain_numbers(lower.xaxis)
    lower.xaxis.set_minor_formatter(NullFormatter())
    add_legend(figure, upper, lines, methods, NARROW)
    return figure


def _draw_order_chart(measured: Sequence[ObservedOrder]) -> Figure:
    """Plot the observed orders of accuracy as markers, in a row for each method.

    Markers show the orders of displacement, velocity, acceleration and algorithmic acceleration. A
    row without order (the errors are rounding errors) has a text instead.
    """
    figure = Figure(figsize=(7.5, 1.9 + 0.24 * len(measured)), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(measured), 0.0, -1.0)
    marks = (
        ("displacement", "o", 8.0, "none"),
        ("velocity", "s", 4.0, COLORS[1]),
        ("acceleration", "x", 6.0, COLORS[0]),
        ("algorithmic_acceleration", "^", 6.0, "none"),
    )
    for quantity, marker, size, fill in marks:
        orders = [order.order(quantity) for order in measured]
        label = "algorithmic acceleration" if quantity == "algorithmic_acceleration" else quantity
        mark: dict[str, Any] = {
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
    axes.set_yticks(rows, [order.method for order in measured], parse_math=False)
    axes.set(ylim=(0.3, len(measured) + 0.7), xlim=(0.0, 5.6), xlabel="observed order")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    labels = axes.get_legend_handles_labels()[1]
    columns = legend_columns(labels, 4)
    figure.set_figheight(figure.get_figheight() + 0.17 * (math.ceil(len(labels) / columns) - 1))
    figure.legend(loc="outside lower center", ncols=columns, handlelength=1.2)
    return figure


# ---- Work-precision diagrams: time over error, error over time step, cost over number of stories;
# readable in black and white

_FRONT_COLOR = "0.85"  # gray of the band that connects the points of the front
_MIN_GAP = 1e-14  # replaces a gap of 0, which has no position on a logarithmic axis
_MAX_ERROR = 10.0  # end of the axis of relative errors; larger errors are outside of the panel
_COSTS = {
    "time": "{clock} in the compiled loop (s)",
    "steps": "time steps",
    "solves": "solutions of the equations (for scipy: evaluations of the derivatives)",
}
"""Label of the axis of each type of cost."""
_HIGH = 6.6
"""Height, inches, of a figure for one column of a page, before the height of the legend is added
and the figure is reduced to the width of the column."""


def chart_picture(
    chart: Chart, *, name: str, target: str, versus: str = "time", highlight: str = ""
) -> Figure:
    """Plot a work-precision diagram: cost over error with a line per method, or error over time
    step.

    `target` is the shown error, a key of `QUANTITIES`. `versus` is `time` (the default), `steps`,
    `solves` or `dt` (error over time step). Programs that do not count their time steps or
    solutions have no points for these costs. The line of the method `highlight` is thick.

    Points with an error below the uncertainty of the reference solution are not shown. If a line
    has such points, a triangle at this uncertainty represents the cheapest of these points. The
    gray band connects the points for which no other point has both less cost and less error.
    """
    if versus == "dt":
        return _error_figure(_Drawing(chart, target), name, highlight)
    return _cost_figure(_Drawing(chart, target, versus), name, highlight)


def sizes_picture(
    charts: Sequence[Chart], *, name: str, target: str, highlight: str = ""
) -> Figure:
    """Plot the computing time per time step, and the error, over the number of stories.

    Of each method, the measurement with the time step closest to the sampling interval of the
    record is shown.

    Parameters
    ----------
    target : str
        Error that is shown, a key of `QUANTITIES`.
    highlight : str
        Method with a thick line in front of the other lines; empty by default.
    """
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    cost, accuracy = figure.subplots(1, 2)
    lines = list(dict.fromkeys(point.line for chart in charts for point in chart.points))
    drawings = [_Drawing(chart, target) for chart in charts]
    handles = []
    for line, style in _styles(lines, highlight).items():
        stories, step_costs, errors = [], [], []
        for drawing in drawings:
            points = [point for point in drawing.lines.get(line, []) if not math.isnan(point.dt)]
            if points:
                interval = drawing.chart.interval
                closest = min(points, key=lambda point: abs(math.log(point.dt / interval)))
                stories.append(drawing.chart.stories)
                # The time per step is in microseconds; it is nan without time steps.
                step_costs.append(1e6 * closest.fastest / (closest.steps or math.nan))
                errors.append(drawing.error(closest))
        handles += cost.plot(stories, step_costs, **style)
        accuracy.plot(stories, errors, **style)
    for axes, label in ((cost, "time per step (us)"), (accuracy, QUANTITIES[target])):
        _chart_frame(axes)
        plain_numbers(axes.xaxis)
        axes.set(
            xlabel="stories (dotted: in proportion to them)" if axes is cost else "stories",
            ylabel=label,
        )
    # The dotted line is proportional to the number of stories, for comparison. It must not change
    # the limits of the axis.
    limits = cost.get_ylim()
    ends = np.array(
        [min(chart.stories for chart in charts), max(chart.stories for chart in charts)],
        dtype=float,
    )
    cost.plot(
        ends, 0.5 * limits[1] * ends / ends[-1], color="0.6", linewidth=0.8, linestyle=":", zorder=1
    )
    cost.set_ylim(limits)
    add_legend(figure, cost, handles, lines, NARROW)
    titled(
        figure,
        f"{name}, with more stories\ncost and accuracy over the number of stories, dt "
        f"{charts[0].interval:.4g} s",
    )
    return figure


class _Drawing:
    """Points of a chart that are drawn for a single type of error.

    Attributes
    ----------
    target : str
        Type of error, a key of `QUANTITIES`.
    versus : str
        Type of cost: `time`, `steps` or `solves`.
    gap : float
        Uncertainty of the reference solution. Smaller errors are not known.
    lines : dict of str to list of Point
        Points with a known error and cost, by the name of their line.
    """

    def __init__(self, chart: Chart, target: str, versus: str = "time") -> None:
        self.chart = chart
        self.target = target
        self.versus = versus
        self.gap = max(chart.reference.gap.of(target), _MIN_GAP)
        lines: dict[str, list[Point]] = {point.line: [] for point in chart.points}
        for point in chart.points:
            # Comparisons with nan are false, so points with unknown values are excluded.
            if point.error(target) >= 0.0 and self.cost(point) > 0.0:
                lines[point.line].append(point)
        self.lines = {line: points for line, points in lines.items() if points}
        self.points = [point for points in self.lines.values() for point in points]

    def cost(self, point: Point) -> float:
        """Return the cost of the time integration of a point: computing time (s), number of time
        steps or number of solutions, as `versus` selects; nan if it was not counted."""
        cost = {"time": point.fastest, "steps": point.steps, "solves": point.iterations}[
            self.versus
        ]
        return math.nan if cost is None else float(cost)

    def error(self, point: Point) -> float:
        """Return the error of a point, or the uncertainty of the reference (`gap`) if the error is
        smaller."""
        return max(point.error(self.target), self.gap)

    def known(self, points: Sequence[Point]) -> list[Point]:
        """Return the points with an error above the uncertainty of the reference (`gap`)."""
        return [point for point in points if point.error(self.target) > self.gap]

    def position(self, point: Point) -> tuple[float, float]:
        """Return error and cost, the coordinates of a point."""
        return self.error(point), self.cost(point)

    def front(self) -> list[Point]:
        """Return the points that no other point beats in cost and error, the cheapest first."""
        # In the order of increasing cost, a point belongs to the front if its error is smaller than
        # the errors of all cheaper points.
        front: list[Point] = []
        for point in sorted(self.points, key=lambda point: (self.cost(point), self.error(point))):
            if not front or self.error(point) < self.error(front[-1]):
                front.append(point)
        return front

    @property
    def has_triangles(self) -> bool:
        """True if any line has a point with an error below the uncertainty of the reference."""
        return any(map(self.below, self.lines.values()))

    @property
    def at_interval(self) -> list[Point]:
        """Points with the sampling interval of the record as time step."""
        # The tolerance allows for the rounding of time steps that are computed from the interval.
        interval = self.chart.interval
        return [point for point in self.points if abs(point.dt - interval) <= 1e-9 * interval]

    def footnote(self, mark: str) -> str:
        """Return the explanation below a figure that is wider than a column of a page; `mark` is
        the symbol of the sampling interval."""
        return footnote(self.chart, self.target, self.points, mark, self.has_triangles)

    def below(self, points: Sequence[Point]) -> list[Point]:
        """Return a list with the cheapest of the points with an error of at most the uncertainty of
        the reference (`gap`); an empty list without such points."""
        below = [point for point in points if point.error(self.target) <= self.gap]
        return [min(below, key=self.cost)] if below else []


def _styles(lines: Sequence[str], highlight: str) -> dict[str, dict[str, Any]]:
    """Return the style of each line of a work-precision diagram as keyword arguments of matplotlib.

    Markers of other programs are hollow.

    `highlight` is the method with a thick line; empty for no such method.
    """
    plot_styles = method_styles(lines, highlight)
    faces = {line: "white" if PEER in line else plot_styles[line]["color"] for line in lines}
    return {
        line: plot_styles[line] | {"markersize": 4.5, "markerfacecolor": faces[line]}
        for line in lines
    }


def _cost_figure(drawing: _Drawing, name: str, highlight: str) -> Figure:
    """Return the figure of the costs of the methods over their errors, with the gray band."""
    # In one column, the explanation is the title of the legend, and the panel is higher.
    narrow = is_narrow()
    figure = Figure(figsize=(7.5, _HIGH if narrow else 5.6), layout="constrained")
    axes = figure.subplots()
    front = drawing.front()
    (band,) = axes.plot(
        *_columns(drawing, front),
        color=_FRONT_COLOR,
        linewidth=9.0,
        solid_capstyle="round",
        zorder=1,
    )
    handles, shown_points = _plot_cost_lines(axes, drawing, highlight)
    _set_cost_axes(axes, drawing, narrow=narrow)
    add_legend(
        figure,
        axes,
        [*handles, band],
        [*drawing.lines, "band" if narrow else f"band: {BAND_RULE}"],
        NARROW,
    )
    subject = f"{drawing.versus} against accuracy, "
    if narrow:
        legend = figure.legends[-1]
        has_circles = bool(drawing.at_interval)
        legend.set_title(
            short_footnote(drawing.chart, drawing.target, has_circles, drawing.has_triangles)
        )
        legend.get_title().set(fontsize=6.0, multialignment="center")
        subject = ""
    titled(figure, _title(drawing, name, f"{subject}time steps (s) at the points"))
    # Points of the front and the last point of each line (the smallest time step) are labeled with
    # their time step. Labels without space are omitted.
    finest = [points[-1] for points in drawing.lines.values() if points[-1] in shown_points]
    labelled = dict.fromkeys(point for point in (*front, *finest) if not math.isnan(point.dt))
    labels = [(*drawing.position(point), f"{point.dt:.4g}") for point in labelled]
    write_labels(figure, axes, labels, [drawing.position(point) for point in shown_points])
    return figure


def _plot_cost_lines(axes: Any, drawing: _Drawing, highlight: str) -> tuple[list[Any], list[Point]]:
    """Plot a line for each method, with markers at its points and rings at some of the markers.
    Return the entries of the legend, in the order of `drawing.lines`, and the points with a marker.

    The marker of an error below the gap of the reference is a triangle. A ring marks a time step
    that is equal to the sampling interval of the record.
    """
    handles = []
    shown_points: list[Point] = []
    styles = _styles(list(drawing.lines), highlight)
    for line, points in drawing.lines.items():
        style = styles[line]
        compared, below = drawing.known(points), drawing.below(points)
        shown_points += [*compared, *below]
        axes.plot(*_columns(drawing, [*compared, *below]), **style | {"marker": "none"})
        axes.plot(*_columns(drawing, compared), **style | {"linestyle": "none"})
        axes.plot(
            *_columns(drawing, below),
            linestyle="none",
            marker="<",
            markersize=7.0,
            color=style["color"],
        )
        handles += axes.plot([], [], **style)
    rings: dict[str, Any] = {
        "marker": "o",
        "markersize": 10.0,
        "markerfacecolor": "none",
        "markeredgecolor": "0.25",
    }
    at_interval = [point for point in shown_points if point in drawing.at_interval]
    axes.plot(*_columns(drawing, at_interval), linestyle="none", **rings, markeredgewidth=0.8)
    return handles, shown_points


def _set_cost_axes(axes: Any, drawing: _Drawing, *, narrow: bool) -> None:
    """Set scales, range and labels of the axes of a figure of costs over errors. A narrow figure,
    in one column of a page, has no footnote below the axis.
    """
    _chart_frame(axes)
    # Numbers of steps and of solutions, and the times of a few time steps, often differ by less
    # than a decade, so that ticks at powers of ten are not sufficient.
    low, high = np.log10(axes.get_ylim())
    if drawing.versus != "time" or math.floor(high) - math.ceil(low) < 1:
        plain_numbers(axes.yaxis)
        plain_minor_numbers(axes.yaxis)
    axes.set_xlim(right=min(axes.get_xlim()[1], _MAX_ERROR))
    quantity = QUANTITIES[drawing.target]
    text = drawing.footnote("circle" if drawing.at_interval else "")
    axes.set_xlabel(quantity if narrow else f"{quantity}\n{text}")
    # The label of a time states which part of each program is timed.
    chart = drawing.chart
    label = _COSTS[drawing.versus].format(clock=CLOCKS[chart.timing.clock])
    if drawing.versus == "time" and chart.peers:
        label += "\n" + ", ".join(f"{peer.name}: in {peer.timed}" for peer in chart.peers)
    axes.set_ylabel(label)


def _columns(drawing: _Drawing, points: Sequence[Point]) -> tuple[list[float], list[float]]:
    """Return the errors and the costs of points as two lists, the coordinates for matplotlib."""
    return [drawing.error(point) for point in points], [drawing.cost(point) for point in points]


def _chart_frame(axes: Any) -> None:
    """Make both axes of a panel logarithmic, with labeled ticks at every power of ten."""
    for axis, scale in ((axes.xaxis, axes.set_xscale), (axes.yaxis, axes.set_yscale)):
        scale("log")
        axis.set_major_locator(LogLocator(numticks=20))
        axis.set_minor_formatter(NullFormatter())


def _title(drawing: _Drawing, name: str, subject: str) -> str:
    """Return the title of a figure: building, number of stories and plotted quantities."""
    return f"{name}\n{pluralize(drawing.chart.stories, 'story')}: {subject}"


def _error_figure(drawing: _Drawing, name: str, highlight: str) -> Figure:
    """Return the figure of the errors of the methods over their time steps.

    `highlight` is the method with a thick line in front of the other lines; empty for no such
    method.
    """
    figure = Figure(figsize=(7.5, 5.6), layout="constrained")
    axes = figure.subplots()
    handles, labels = [], []
    styles = _styles(list(drawing.lines), highlight)
    for line, points in drawing.lines.items():
        compared = [point for point in drawing.known(points) if not math.isnan(point.dt)]
        if compared:
            handles += axes.plot(
                [point.dt for point in compared],
                [drawing.error(point) for point in compared],
                **styles[line],
            )
            labels.append(line)
    axes.axvline(drawing.chart.interval, color=LIGHT, linewidth=0.8, zorder=1)
    _chart_frame(axes)
    axes.set_ylim(top=min(axes.get_ylim()[1], _MAX_ERROR))
    axes.set_xlabel(f"time step (s)\n{drawing.footnote('vertical line')}")
    axes.set_ylabel(QUANTITIES[drawing.target])
    add_legend(figure, axes, handles, labels, NARROW)
    return titled(figure, _title(drawing, name, "error over the time step"))
