"""Figure of a run in two directions: path of the worst story in plan."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.output.figures.style import (
    COLORS,
    INK,
    LIGHT,
    MARK,
    drift_scale,
    motion_name,
    over_stories,
    titled,
)
from tdint.response.runs.outcome import Response
from tdint.response.runs.two_directions import histories_of
from tdint.units import SI, OutputUnits

_LIMIT = 1.12  # limit of the axes in plan, divided by the resultant


def plan_picture(response: Response, units: OutputUnits = SI) -> Figure:
    """Plot the path of the story with the largest drift in plan, the roof displacements over time,
    and the peak drifts over the height.

    Parameters
    ----------
    response : Response
        Result of a run in two directions with its histories.
    """
    units = units.in_figures
    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0), height_ratios=(1.0, 1.3))
    stories = response.stories
    ratios = stories.peak_drift_ratio
    story = int(np.argmax(stories.peak_drift if np.isnan(ratios).any() else ratios))
    _draw_path(figure.add_subplot(grid[:, 0]), response, story, units)
    _draw_roof(figure.add_subplot(grid[0, 1]), response, units)
    _draw_drifts(figure.add_subplot(grid[1, 1]), response, units)
    title = f"{response.model.name}\n{response.method}, dt {response.dt:.4g} s"
    if response.record is not None:
        title += f", {motion_name(response.record)}"
    if (collapse := response.collapse) is not None:
        title += f"; collapsed at {collapse.time:.4g} s"
    return titled(figure, title)


def _draw_path(axes: Any, response: Response, story: int, units: OutputUnits) -> None:
    """Plot the drift in y against the drift in x of a story, and its largest resultant."""
    assert response.resultants is not None
    x, y = (units.of(history.drift[:, story], "m") for history in histories_of(response))
    peak = response.resultants.drift
    radius = float(units.of(peak.value[story], "m"))
    angle = np.radians(peak.direction[story])
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(radius * np.cos(turn), radius * np.sin(turn), color=LIGHT, linewidth=0.8)
    axes.plot(x, y, color=INK, linewidth=0.8)
    end = radius * np.cos(angle), radius * np.sin(angle)
    axes.plot((0.0, end[0]), (0.0, end[1]), color=MARK, linewidth=1.0)
    axes.plot(*end, "o", color=MARK, markersize=4.0)
    axes.set(
        xlim=(-_LIMIT * radius, _LIMIT * radius) if radius else (-1.0, 1.0),
        ylim=(-_LIMIT * radius, _LIMIT * radius) if radius else (-1.0, 1.0),
        aspect="equal",
        xlabel=f"drift in x ({units.label('m')})",
        ylabel=f"drift in y ({units.label('m')})",
    )
    unit = units.label("m")
    axes.set_title(
        f"Story {story + 1}: {radius:.4g} {unit} at {peak.time[story]:.4g} s,\n"
        f"{peak.direction[story]:.3g}° from x",
        fontsize=8.5,
    )


def _draw_roof(axes: Any, response: Response, units: OutputUnits) -> None:
    """Plot the roof displacements in both directions over time."""
    for number, history in enumerate(histories_of(response)):
        roof = units.of(history.displacement[:, -1], "m")
        axes.plot(history.time, roof, label="xy"[number], **_line(number))
    axes.set(xlabel="time (s)", ylabel=f"roof displacement\n({units.label('m')})")
    axes.legend(loc="lower right", fontsize=7.0, ncols=2, handlelength=1.6)


def _draw_drifts(axes: Any, response: Response, units: OutputUnits) -> None:
    """Plot the peak drifts in both directions and their resultants over the height."""
    scale, label = drift_scale(response.stories.height, units)
    for number, part in enumerate(response.directions):
        over_stories(axes, scale * part.stories.peak_drift, label="xy"[number], **_line(number))
    drift = scale * response.stories.peak_drift
    over_stories(axes, drift, label="resultant", color=MARK, linewidth=1.4)
    axes.set(xlabel=label, ylabel="story", ylim=(0.5, drift.size + 0.5), xlim=(0.0, None))
    axes.yaxis.get_major_locator().set_params(integer=True)
    axes.legend(loc="best", fontsize=7.0, handlelength=1.6)


def _line(number: int) -> dict[str, Any]:
    """Return the style of the line of a direction."""
    return {"color": COLORS[number], "linewidth": 1.0, "linestyle": ("-", "--")[number]}
