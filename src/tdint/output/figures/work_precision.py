"""Figures of work against precision: time over error, error over step, cost over size; readable in black and white."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from tdint.analysis.defaults import QUANTITIES
from tdint.output.figures.style import LIGHT, MARKERS, add_legend, add_title, line_look, plain_numbers, write_labels
from tdint.output.tables.methods import PEER
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from tdint.analysis.chart.work_precision import Chart, Point

_NARROW = 31  # labels that fit into three columns
_FRONT = "0.85"
_SMALLEST_GAP = 1e-14  # so that it has a place on a logarithmic axis
_LARGEST_ERROR = 10.0  # what is further off is cut


def chart_picture(chart: Chart, *, name: str, target: str, versus: str = "time") -> Figure:
    """Picture of a chart: time over error, a line per method; or error over step.

    A point whose error is below the gap of the reference is not drawn. Of those of a line that has some, a triangle at
    the gap stands for the cheapest. The grey band joins the points that no other one beats in both time and error.

    Parameters
    ----------
    chart : Chart
        What was measured.
    name : str
        Of the building, for the title.
    target : str
        The error to show, a key of `QUANTITIES`.
    versus : str
        `time` or `dt`.
    """
    draw = {"time": _draw_times, "dt": _draw_steps}[versus]
    return draw(_Drawing(chart, target), name)


def sizes_picture(charts: Sequence[Chart], *, name: str, target: str) -> Figure:
    """Picture of time per step and of error over the number of stories, at the step closest to the record's."""
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    cost, accuracy = figure.subplots(1, 2)
    lines = list(dict.fromkeys(point.line for chart in charts for point in chart.points))
    handles = []
    for i, line in enumerate(lines):
        drawings = [_Drawing(chart, target) for chart in charts]
        points = [(drawing, _closest(drawing, line)) for drawing in drawings]
        found = [(drawing, point) for drawing, point in points if point is not None]
        stories = [drawing.chart.stories for drawing, _ in found]
        step_cost = [1e6 * point.fastest / (point.steps or math.nan) for _, point in found]
        handles += cost.plot(stories, step_cost, **_style(i, line))
        error = [drawing.error(point) for drawing, point in found]
        accuracy.plot(stories, error, **_style(i, line))
    for axes, label in ((cost, "time per step (us)"), (accuracy, QUANTITIES[target])):
        _frame(axes)
        plain_numbers(axes.xaxis)
        axes.set(xlabel="stories (dotted: in proportion to them)" if axes is cost else "stories", ylabel=label)
    _draw_proportion(cost, charts)
    add_legend(figure, cost, handles, lines, _NARROW)
    add_title(
        figure,
        f"{name}, with more stories\ncost and accuracy over the number of stories, dt {charts[0].interval:.4g} s",
    )
    return figure


class _Drawing:
    """What of a chart is drawn for one of the errors."""

    def __init__(self, chart: Chart, target: str) -> None:
        self.chart = chart
        self.target = target
        self.gap = max(chart.reference.gap.of(target), _SMALLEST_GAP)
        lines: dict[str, list[Point]] = {point.line: [] for point in chart.points}
        for point in chart.points:
            if point.errors is not None:
                lines[point.line].append(point)
        self.lines = {line: points for line, points in lines.items() if points}
        self.points = [point for points in self.lines.values() for point in points]

    def error(self, point: Point) -> float:
        """The error, or the gap where it is less."""
        return max(point.error(self.target), self.gap)

    def known(self, points: Sequence[Point]) -> list[Point]:
        """Points whose error is above the gap."""
        return [point for point in points if point.error(self.target) > self.gap]

    def place(self, point: Point) -> tuple[float, float]:
        """Error and time."""
        return self.error(point), point.fastest

    def front(self) -> list[Point]:
        """The points that no other one beats in both time and error, the fastest first."""
        front: list[Point] = []
        for point in sorted(self.points, key=lambda point: (point.fastest, self.error(point))):
            if not front or self.error(point) < self.error(front[-1]):
                front.append(point)
        return front

    def shown(self) -> list[Point]:
        """Points that have a mark: those above the gap, and of each line the cheapest below it."""
        return [point for points in self.lines.values() for point in (*self.known(points), *self.below(points))]

    def below(self, points: Sequence[Point]) -> list[Point]:
        """The cheapest point below the gap, if there is one."""
        below = [point for point in points if point.error(self.target) <= self.gap]
        return [min(below, key=lambda point: point.fastest)] if below else []

    def own(self) -> list[Point]:
        """The points with the record's own step."""
        interval = self.chart.interval
        return [point for point in self.shown() if abs(point.dt - interval) <= 1e-9 * interval]


def _style(i: int, line: str) -> dict[str, Any]:
    """Dashes and markers that tell lines apart without color; open markers for other programs."""
    look = line_look(i)
    face = "white" if PEER in line else look["color"]
    return look | {"marker": MARKERS[i % len(MARKERS)], "markersize": 4.5, "markerfacecolor": face}


def _draw_times(drawing: _Drawing, name: str) -> Figure:
    figure = Figure(figsize=(7.5, 5.6), layout="constrained")
    axes = figure.subplots()
    front = drawing.front()
    axes.plot(*_columns(drawing, front), color=_FRONT, linewidth=9.0, solid_capstyle="round", zorder=1)
    handles = []
    for i, (line, points) in enumerate(drawing.lines.items()):
        style = _style(i, line)
        known, below = drawing.known(points), drawing.below(points)
        axes.plot(*_columns(drawing, [*known, *below]), **style | {"marker": "none"})
        axes.plot(*_columns(drawing, known), **style | {"linestyle": "none"})
        axes.plot(*_columns(drawing, below), linestyle="none", marker="<", markersize=7.0, color=style["color"])
        handles += axes.plot([], [], **style)
    rings: dict[str, Any] = {"marker": "o", "markersize": 10.0, "markerfacecolor": "none", "markeredgecolor": "0.25"}
    axes.plot(*_columns(drawing, drawing.own()), linestyle="none", **rings, markeredgewidth=0.8)
    _frame(axes)
    axes.set_xlim(right=min(axes.get_xlim()[1], _LARGEST_ERROR))
    axes.set(xlabel=f"{QUANTITIES[drawing.target]}\n{_footnote(drawing)}", ylabel="time of the compiled loop (s)")
    add_legend(figure, axes, handles, list(drawing.lines), _NARROW)
    add_title(figure, _title(drawing, name, "time against accuracy, time steps (s) at the points"))
    shown = drawing.shown()
    finest = [points[-1] for points in drawing.lines.values() if points[-1] in shown]
    wanted = list(dict.fromkeys(point for point in (*front, *finest) if not math.isnan(point.dt)))
    labels = [(*drawing.place(point), f"{point.dt:.4g}") for point in wanted]
    write_labels(figure, axes, labels, [drawing.place(point) for point in shown])
    return figure


def _columns(drawing: _Drawing, points: Sequence[Point]) -> tuple[list[float], list[float]]:
    return [drawing.error(point) for point in points], [point.fastest for point in points]


def _frame(axes: Any) -> None:
    """Logarithmic axes with every decade."""
    for axis, scale in ((axes.xaxis, axes.set_xscale), (axes.yaxis, axes.set_yscale)):
        scale("log")
        axis.set_major_locator(LogLocator(numticks=20))
        axis.set_minor_formatter(NullFormatter())


def _footnote(drawing: _Drawing) -> str:
    """What the ring marks, and what the errors are relative to."""
    chart, reference = drawing.chart, drawing.chart.reference
    gap = reference.gap.of(drawing.target)
    whose = "record" if chart.recorded else "model"
    return (
        f"circle: the {whose}'s own step, {chart.interval:.4g} s; reference: {reference.method}, dt "
        f"{reference.dt:.3g} s,\nfrom which {reference.confirmed_by} differs by {gap:.1e}"
    )


def _title(drawing: _Drawing, name: str, what: str) -> str:
    stories = drawing.chart.stories
    return f"{name}\n{how_many(stories, 'story')}: {what}"


def _draw_steps(drawing: _Drawing, name: str) -> Figure:
    figure = Figure(figsize=(7.5, 5.6), layout="constrained")
    axes = figure.subplots()
    handles, labels = [], []
    for i, (line, points) in enumerate(drawing.lines.items()):
        known = [point for point in drawing.known(points) if not math.isnan(point.dt)]
        if known:
            handles += axes.plot(
                [point.dt for point in known], [drawing.error(point) for point in known], **_style(i, line)
            )
            labels.append(line)
    axes.axvline(drawing.chart.interval, color=LIGHT, linewidth=0.8, zorder=1)
    _frame(axes)
    axes.set_ylim(top=min(axes.get_ylim()[1], _LARGEST_ERROR))
    axes.set_xlabel(f"time step (s)\n{_footnote(drawing).replace('circle', 'vertical line')}")
    axes.set_ylabel(QUANTITIES[drawing.target])
    add_legend(figure, axes, handles, labels, _NARROW)
    add_title(figure, _title(drawing, name, "error over the time step"))
    return figure


def _closest(drawing: _Drawing, line: str) -> Point | None:
    """The point of a line whose step is closest to the record's."""
    interval = drawing.chart.interval
    points = [point for point in drawing.lines.get(line, []) if not math.isnan(point.dt)]
    return min(points, key=lambda point: abs(math.log(point.dt / interval)), default=None)


def _draw_proportion(axes: Any, charts: Sequence[Chart]) -> None:
    """A line of cost in proportion to size, under the others."""
    stories = np.array([min(chart.stories for chart in charts), max(chart.stories for chart in charts)], dtype=float)
    top = axes.get_ylim()[1]
    limits = axes.get_ylim()
    axes.plot(stories, 0.5 * top * stories / stories[-1], color="0.6", linewidth=0.8, linestyle=":", zorder=1)
    axes.set_ylim(limits)
