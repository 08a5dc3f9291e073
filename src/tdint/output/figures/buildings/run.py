"""Figure of a run: histories, energies, profiles over the height, and one hysteresis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from tdint.files import Writer
from tdint.output.figures.buildings.profiles import draw_profiles
from tdint.output.figures.style import (
    INK,
    LIGHT,
    MARK,
    add_title,
    changed,
    picture,
    record_name,
    scaled_unit,
)
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import History, Response

Array = NDArray[np.float64]


def run_picture(response: Response, suffix: str, units: OutputUnits = SI) -> Writer:
    """Picture of a run: ground, roof displacement and energies over time; drifts, floor accelerations and shears over
    the height; the hysteresis of one story.

    Return value and errors are those of `tdint.output.figures.style.picture`; the response has its history, else
    ValueError.
    """
    if response.history is None:
        raise ValueError("a picture of a run needs its history: run(..., history=True)")
    return picture(suffix, lambda: _draw(response, units.in_pictures))


def _draw(response: Response, units: OutputUnits) -> Figure:
    history = response.history
    assert history is not None
    figure = Figure(figsize=(8.0, 9.4), layout="constrained")
    grid = figure.add_gridspec(4, 1, height_ratios=(1.0, 1.6, 1.9, 3.4))
    if response.record is None:
        roof = figure.add_subplot(grid[:2])
    else:
        ground = figure.add_subplot(grid[0])
        _draw_ground(ground, history, units)
        roof = figure.add_subplot(grid[1], sharex=ground)
    _draw_roof(roof, history, units)
    _draw_energies(figure.add_subplot(grid[2], sharex=roof), response, history, units)
    below = grid[3].subgridspec(1, 4, width_ratios=(1.0, 0.8, 0.8, 1.35))
    profiles = [figure.add_subplot(below[i]) for i in range(3)]
    draw_profiles(profiles, response, units)
    _draw_hysteresis(figure.add_subplot(below[3]), response, history, units)
    title = f"{response.model.name}\n{response.method}, dt {response.dt:.4g} s"
    if response.record is not None:
        title += f", {record_name(response.record.source)} {response.record.component}".rstrip()
        title += changed([response.record])
    if (collapse := response.collapse) is not None:
        title += f"; story {collapse.story} {'failed' if collapse.failed else 'collapsed'} at {collapse.time:.4g} s"
    add_title(figure, title)
    return figure


def _draw_ground(axes: Any, history: History, units: OutputUnits) -> None:
    ground, unit = units.of(history.ground_acceleration, "m/s^2"), units.label("m/s^2")
    axes.plot(history.time, ground, color=LIGHT, linewidth=0.8)
    axes.set_ylabel(f"ground ({unit})")
    axes.tick_params(labelbottom=False)
    axes.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    _mark_peak(axes, history.time, ground, unit)


def _draw_roof(axes: Any, history: History, units: OutputUnits) -> None:
    roof, unit = units.of(history.displacement[:, -1], "m"), units.label("m")
    axes.plot(history.time, roof, color=INK, linewidth=1.0)
    axes.set_ylabel(f"roof displacement\n({unit})")
    axes.tick_params(labelbottom=False)
    axes.set_xlim(history.time[0], history.time[-1])
    _mark_peak(axes, history.time, roof, unit)


def _draw_energies(axes: Any, response: Response, history: History, units: OutputUnits) -> None:
    """Where the input energy went: layers of dissipated, damped, stored and kinetic energy below it."""
    energy = history.energy
    given = response.energy.start + energy.input
    factor, unit = scaled_unit(float(np.max(np.abs(given))), "J", units)
    layers = (
        (energy.dissipated, "dissipated by stories", "0.35", None),
        (energy.damping, "damping", "0.62", None),
        (energy.recoverable, "stored", "0.85", None),
        (energy.kinetic, "kinetic", "1.0", "//////"),
    )
    below = np.zeros(len(given))
    for values, label, gray, hatch in layers:
        if not np.any(values):
            continue
        above = below + factor * values
        axes.fill_between(
            history.time, below, above, facecolor=gray, edgecolor="0.5", hatch=hatch, linewidth=0.0, label=label
        )
        below = above
    axes.plot(history.time, factor * given, color=INK, linewidth=1.2, label="input")
    axes.set_ylabel(f"energy ({unit})")
    axes.set_xlabel("time (s)")
    axes.set_xlim(history.time[0], history.time[-1])
    # Above the panel: inside, it would lie over what it names.
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 0.99), ncols=5, reverse=True, borderaxespad=0.0, columnspacing=1.2,
        handlelength=1.6,
    )  # fmt: skip
    if np.any(given):
        error = f"balance off by {100.0 * abs(response.energy.error):.1g} %"
        axes.set_title(error, loc="right", fontsize=8.0)


def _mark_peak(axes: Any, time: Array, values: Array, unit: str) -> None:
    """A dot at the largest absolute value, the value in the upper right corner; nothing of what is at rest."""
    if not np.any(values):
        return
    i = int(np.argmax(np.abs(values)))
    axes.plot(time[i], values[i], "o", color=MARK, markersize=4)
    axes.margins(y=0.12)
    axes.text(
        0.995, 0.95, f"peak {abs(values[i]):.3g} {unit} at {time[i]:.4g} s", transform=axes.transAxes, ha="right",
        va="top", fontsize=8.0, color=MARK, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    )  # fmt: skip


def _draw_hysteresis(axes: Any, response: Response, history: History, units: OutputUnits) -> None:
    story, reason = _telling_story(response, units)
    drift, shear = units.of(history.drift[:, story], "m"), history.shear[:, story]
    if np.isnan(response.stories.ductility[story]):
        # The force of a law that does not yield follows from the drift: its curve, not the chords between the steps.
        order = np.argsort(drift)
        drift, shear = drift[order], shear[order]
    factor, unit = scaled_unit(float(np.max(np.abs(shear))), "N", units)
    axes.plot(drift, shear * factor, color=INK, linewidth=0.8)
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.axvline(0.0, color=LIGHT, linewidth=0.6)
    axes.set_title(f"Story {story + 1}: {reason}", fontsize=8.5)
    axes.set_xlabel(f"drift ({units.label('m')})")
    axes.set_ylabel(f"story shear ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))


def _telling_story(response: Response, units: OutputUnits) -> tuple[int, str]:
    """The story whose hysteresis says most, from 0: the largest ductility, else drift ratio, else drift."""
    stories = response.stories
    for values, name, factor, unit in (
        (stories.ductility, "largest ductility", 1.0, ""),
        (stories.peak_drift_ratio, "largest drift", 100.0, " %"),
        (units.of(stories.peak_drift, "m"), "largest drift", 1.0, f" {units.label('m')}"),
    ):
        if np.any(np.isfinite(values)):
            story = int(np.nanargmax(values))
            return story, f"{name}, {factor * values[story]:.3g}{unit}"
    return 0, "no drift"
