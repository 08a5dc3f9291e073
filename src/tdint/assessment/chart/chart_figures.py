"""Work-precision diagrams and performance profiles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter

from tdint.number_parsing import abbreviate, pluralize
from tdint.output.figures.style import (
    LIGHT,
    Style,
    add_legend,
    method_styles,
    new_axes,
    new_panels,
    plain_minor_numbers,
    plain_numbers,
    titled,
    write_labels,
)
from tdint.output.tables.methods import PEER
from tdint.response.defaults import PEAKS, QUANTITIES
from tdint.system import CLOCKS

if TYPE_CHECKING:
    from tdint.assessment.chart.performance_profiles import FieldChart
    from tdint.assessment.chart.work_precision import Chart, PerformanceProfile, Point


BAND_RULE = "no other point is cheaper and more accurate"

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
    figure, ((cost, accuracy),) = new_panels(7.5, (4.6, (1, 1)))
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
    add_legend(figure, handles, lines)
    titled(
        figure,
        f"{name}, with more stories\ncost and accuracy over the number of stories, dt "
        f"{charts[0].interval:.4g} s",
    )
    return figure


class _Drawing:
    """Points of a chart that are plotted for a single type of error.

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
    def at_interval(self) -> list[Point]:
        """Points with the sampling interval of the record as time step."""
        # The tolerance allows for the rounding of time steps that are computed from the interval.
        interval = self.chart.interval
        return [point for point in self.points if abs(point.dt - interval) <= 1e-9 * interval]

    def explanation(self, mark: str) -> str:
        """Return the meaning of the symbols, for the title of the legend; `mark` is the symbol of
        the sampling interval, empty if no point has this time step."""
        chart = self.chart
        interval = "sampling interval of the record" if chart.recorded else "time step of the model"
        parts = [f"{mark}: {interval}, {chart.interval:.4g} s"] if mark else []
        # The time step of a point is nan for a run with a tolerance (--tolerance) and for other
        # programs; the names of their lines contain a slash (PEER).
        if any(math.isnan(point.dt) and PEER not in point.line for point in self.points):
            parts.append("by tolerance: times of the whole run")
        if any(map(self.below, self.lines.values())):
            parts.append(f"triangle: error below {self.gap:.1e}, the uncertainty of the reference")
        return "; ".join([*parts, f"reference: {chart.reference.method}"])

    def below(self, points: Sequence[Point]) -> list[Point]:
        """Return a list with the cheapest of the points with an error of at most the uncertainty of
        the reference (`gap`); an empty list without such points."""
        below = [point for point in points if point.error(self.target) <= self.gap]
        return [min(below, key=self.cost)] if below else []


def _styles(lines: Sequence[str], highlight: str) -> dict[str, Style]:
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
    figure, axes = new_axes(7.5, 5.6)
    front = drawing.front()
    (band,) = axes.plot(
        *_columns(drawing, front),
        color=_FRONT_COLOR,
        linewidth=9.0,
        solid_capstyle="round",
        zorder=1,
    )
    handles, shown_points = _plot_cost_lines(axes, drawing, highlight)
    _set_cost_axes(axes, drawing)
    add_legend(
        figure,
        [*handles, band],
        [*drawing.lines, f"band: {BAND_RULE}"],
        title=drawing.explanation("circle" if drawing.at_interval else ""),
    )
    subject = f"{drawing.versus} against accuracy, time steps (s) at the points"
    titled(figure, _title(drawing, name, subject))
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
    rings: Style = {
        "marker": "o",
        "markersize": 10.0,
        "markerfacecolor": "none",
        "markeredgecolor": "0.25",
    }
    at_interval = [point for point in shown_points if point in drawing.at_interval]
    axes.plot(*_columns(drawing, at_interval), linestyle="none", **rings, markeredgewidth=0.8)
    return handles, shown_points


def _set_cost_axes(axes: Any, drawing: _Drawing) -> None:
    """Set scales, range and labels of the axes of a figure of costs over errors."""
    _chart_frame(axes)
    # Numbers of steps and of solutions, and the times of a few time steps, often differ by less
    # than a decade, so that ticks at powers of ten are not sufficient.
    low, high = np.log10(axes.get_ylim())
    if drawing.versus != "time" or math.floor(high) - math.ceil(low) < 1:
        plain_numbers(axes.yaxis)
        plain_minor_numbers(axes.yaxis)
    axes.set_xlim(right=min(axes.get_xlim()[1], _MAX_ERROR))
    axes.set_xlabel(QUANTITIES[drawing.target])
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
    figure, axes = new_axes(7.5, 5.6)
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
    axes.set_xlabel("time step (s)")
    axes.set_ylabel(QUANTITIES[drawing.target])
    add_legend(figure, handles, labels, title=drawing.explanation("vertical line"))
    return titled(figure, _title(drawing, name, "error over the time step"))


_MAX_COST_RATIO = 30.0  # end of the axis of cost ratios; slower methods are not of interest

_MAX_UNSOLVED = 3  # problems that are named below a figure; the command prints all

_BOLD = {"impulse4": 2.4, "moment4": 2.4, "newmark-average": 2.0}
"""Line widths (points) of emphasized methods: the methods that tdint recommends, and the method
that most programs use."""


def profile_picture(chart: FieldChart, *, target: str, highlight: str = "") -> Figure:
    """Plot performance profiles (Dolan and More 2002), with a panel for each tolerance.

    A profile is the fraction of problems that a method solves within a factor of the minimum cost.

    Parameters
    ----------
    target : str
        Quantity of the error, a key of `PEAKS`.
    highlight : str
        Method that has a thick line in front of the other lines; empty by default, which emphasizes
        the methods in `_BOLD`.
    """
    quantity = target.replace("-", "_")
    profiles = [profile for profile in chart.profiles if profile.quantity == quantity]
    tolerances = sorted({profile.tolerance for profile in profiles}, reverse=True)
    figure, (panels,) = new_panels(7.5, (4.8, (1,) * len(tolerances)), share="xy", columns=3)
    plot_styles = method_styles(chart.lines, highlight)
    handles: dict[str, Any] = {}
    for axes, tolerance in zip(panels, tolerances, strict=True):
        shown = [profile for profile in profiles if profile.tolerance == tolerance]
        handles |= _plot_profiles(axes, shown, plot_styles)
        count = max(profile.problems for profile in shown)
        axes.set_title(f"error within {100.0 * tolerance:g} % ({pluralize(count, 'problem')})")
        axes.set(xlabel="time divided by minimum time", ylabel="fraction of problems solved")
        axes.label_outer()
    shown_lines = [line for line in chart.lines if line in handles]
    names = [
        # The second text is empty (times False) if the method was run for all problems.
        chart.named(line)
        + ", partly not run" * any(p.not_run for p in profiles if p.method == line)
        for line in shown_lines
    ]
    text = (
        "Each method has the cheapest time step that is within the tolerance together with all "
        "smaller time steps; lines end at the fraction solved within "
        f"{_MAX_COST_RATIO:g} times the minimum cost"
    )
    if unsolved := chart.unsolved():
        text += f". Not solved within 10 %: {abbreviate(unsolved, _MAX_UNSOLVED)}"
    add_legend(figure, [handles[line] for line in shown_lines], names, title=text)
    return titled(
        figure,
        f"Performance profiles over {pluralize(len(chart.measured), 'problem')}\n{PEAKS[target]}",
    )


def _plot_profiles(
    axes: Any, profiles: Sequence[PerformanceProfile], plot_styles: dict[str, Style]
) -> dict[str, Any]:
    """Plot the performance profiles of all methods for a single tolerance, over the cost divided by
    the minimum cost.

    If a line style (`method_styles`) has a line width, its method is emphasized instead of the
    methods in `_BOLD`.
    """
    line_widths = {
        method: plot_style["linewidth"]
        for method, plot_style in plot_styles.items()
        if "linewidth" in plot_style
    } or _BOLD
    lines: dict[str, Any] = {}
    # Emphasized methods are plotted last, so that their lines are in front.
    for profile in sorted(profiles, key=lambda profile: line_widths.get(profile.method, 0.0)):
        # The profile rises by a single problem at each cost ratio. At the end of the panel it
        # reaches the fraction of problems that the method solves within the maximum cost ratio.
        ratios = [ratio for ratio in profile.ratios if ratio <= _MAX_COST_RATIO]
        solved_fractions = np.arange(len(ratios) + 1) / max(profile.problems, 1)
        x, y = [1.0, *ratios, _MAX_COST_RATIO], [*solved_fractions, solved_fractions[-1]]
        plot_style = plot_styles[profile.method] | {"markersize": 3.5, "markevery": 0.2}
        plot_style |= {"linewidth": line_widths.get(profile.method, 1.0)}
        # Methods of other programs have hollow markers.
        plot_style |= {"markerfacecolor": "white"} if PEER in profile.method else {}
        (lines[profile.method],) = axes.step(x, y, where="post", **plot_style)
    axes.set(xscale="log", xlim=(1.0, _MAX_COST_RATIO), ylim=(0.0, 1.03))
    axes.xaxis.set_major_locator(FixedLocator([1.0, 2.0, 5.0, 10.0, 30.0]))
    axes.xaxis.set_minor_formatter(NullFormatter())
    plain_numbers(axes.xaxis)
    axes.axvline(2.0, color=LIGHT, linewidth=0.6)
    return lines
