"""Figures of a building at rest: its modes, the loops of a cyclic test and their energy, and a pushover."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.output.figures.style import COLORS, DASHES, LIGHT, MARKERS, add_ratio_axis, add_title, line_look, scaled_unit
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.static.cyclic import CyclicTest
    from tdint.analysis.static.pushover import Pushover
    from tdint.model.modes import Modes

_MOST = 4
_MARKED = 20  # floors that have markers


def mode_picture(modes: Modes, *, name: str, norm: str = "roof") -> Figure:
    """Picture of the first modes over the floors, normalized as `tdint.model.modes.Modes.normalized` says."""
    figure = Figure(figsize=(5.4, 5.6), layout="constrained")
    draw_modes(figure.subplots(), modes, norm)
    add_title(figure, name)
    return figure


def draw_modes(axes: Any, modes: Modes, norm: str = "roof") -> None:
    """The shapes of the first modes over the floors."""
    shapes = modes.normalized(norm)
    floors = np.arange(len(shapes) + 1)
    axes.axvline(0.0, color=LIGHT, linewidth=0.8)
    for mode in range(min(_MOST, len(floors) - 1)):
        label = f"mode {mode + 1}, {2.0 * math.pi / modes.omega[mode]:.4g} s"
        marker = MARKERS[mode] if len(shapes) <= _MARKED else None
        look = line_look(mode) | {"marker": marker, "markersize": 4.0}
        axes.plot([0.0, *shapes[:, mode]], floors, label=label, clip_on=False, **look)
    axes.set_ylim(0.0, floors[-1])
    axes.yaxis.set_major_locator(MaxNLocator(11, integer=True, min_n_ticks=1))
    axes.set_ylabel("floor")
    axes.set_xlabel("shape, 1 at the roof" if norm == "roof" else "shape, with a participation factor of 1")
    axes.legend(loc="best")


def cyclic_picture(test: CyclicTest, units: OutputUnits = SI) -> Figure:
    """Picture of a cyclic test: shear over drift, and the energies over the cycles.

    Parameters
    ----------
    test : CyclicTest
        A result of `tdint.analysis.static.cyclic.cyclic_test`.
    """
    figure = Figure(figsize=(6.5, 7.6), layout="constrained")
    loop, energy = figure.subplots(2, 1, height_ratios=(2.6, 1.0))
    draw_loop(loop, test, units)
    _draw_energy(energy, test, units)
    kind = "cyclic test" if test.points else "path of drifts"
    add_title(figure, f"{test.model.name}\nStory {test.story}, {test.law} law: {kind} without dashpots")
    return figure


def draw_loop(axes: Any, test: CyclicTest, units: OutputUnits) -> None:
    """The shear of the story over its drift."""
    factor, unit = scaled_unit(float(np.max(np.abs(test.path.shear))), "N", units)
    drift = units.of(test.path.drift, "m")
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.axvline(0.0, color=LIGHT, linewidth=0.6)
    axes.plot(drift, test.path.shear * factor, color=COLORS[0], label="restoring force of the law")
    if test.geometric_stiffness:
        # Not dashed: the dashes of one cycle would fill the gaps of another.
        force = test.shear_with_p_delta * factor
        axes.plot(drift, force, color=LIGHT, linewidth=0.9, zorder=1.9, label="with P-delta")
    _mark_yielding(axes, test, units)
    if len(axes.get_legend_handles_labels()[0]) > 1:
        axes.legend(loc="upper left")
    axes.set(xlabel=f"drift ({units.label('m')})", ylabel=f"story shear ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
    add_ratio_axis(axes, units.of(test.height, "m"), "drift ratio (%)")


def _mark_yielding(axes: Any, test: CyclicTest, units: OutputUnits) -> None:
    """Dotted lines at the drifts of first yield, where the test goes beyond them."""
    if not test.yield_drift < float(np.max(test.path.drift)):
        return
    drift = units.of(test.yield_drift, "m")
    label = f"yield drift {drift:.3g} {units.label('m')}"
    for at, said in ((drift, label), (-drift, None)):
        axes.axvline(at, color=LIGHT, linestyle=DASHES[2], linewidth=1.0, label=said)


def _draw_energy(axes: Any, test: CyclicTest, units: OutputUnits) -> None:
    cycle = np.arange(test.path.drift.size) / (4.0 * test.points if test.points else 1.0)
    factor, unit = scaled_unit(float(np.max(test.path.recoverable + test.path.dissipated)), "J", units)
    axes.plot(cycle, test.path.dissipated * factor, color=COLORS[0], label="dissipated")
    axes.plot(cycle, test.path.recoverable * factor, color=COLORS[1], linestyle=DASHES[1], label="recoverable")
    axes.legend(loc="upper left")
    axes.set_xlim(0.0, max(cycle[-1], 1.0))
    axes.set(ylim=(min(0.0, axes.get_ylim()[0]), None), xlabel="cycle" if test.points else "step")
    axes.set_ylabel(f"energy ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))


def pushover_picture(result: Pushover, units: OutputUnits = SI) -> Figure:
    """Picture of a pushover; return value and errors are those of `tdint.output.figures.style.picture`."""
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    curve, profile = figure.subplots(1, 2, width_ratios=(1.7, 1.0))
    draw_curve(curve, result, units)
    _draw_profile(profile, result, units)
    add_title(figure, f"{result.model.name}\nPushover, {result.pattern} pattern")
    return figure


def draw_curve(axes: Any, result: Pushover, units: OutputUnits) -> None:
    """The base shear over the roof displacement."""
    factor, unit = scaled_unit(float(np.max(np.abs(result.base_shear))), "N", units)
    roof, shear = units.of(result.roof_displacement, "m"), result.base_shear * factor
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.plot(roof, shear, color=COLORS[0])
    at, most = units.of(result.roof_at_largest, "m"), result.largest_base_shear * factor
    axes.plot(at, most, "o", color=COLORS[0], label=f"largest base shear {most:.4g} {unit}")
    axes.legend(loc="best")
    axes.set(xlim=(0.0, roof[-1]), xlabel=f"roof displacement ({units.label('m')})", ylabel=f"base shear ({unit})")
    add_ratio_axis(axes, units.of(result.height, "m"), "roof drift ratio (%)")


def _draw_profile(axes: Any, result: Pushover, units: OutputUnits) -> None:
    """Drifts of the stories at the largest base shear and at the end."""
    stories = np.arange(result.drift.shape[1] + 1) + 0.5
    heights = [story.drift_height for story in result.model.stories]
    ratio = all(height is not None for height in heights)
    scale = 100.0 / np.array(heights, float) if ratio else np.full(len(heights), 1.0 / units.unit("m")[1])
    shown = (
        (result.drift_at_largest, DASHES[1], "at the largest base shear"),
        (result.drift[-1], DASHES[0], "at the end"),
    )
    for drift, style, text in shown:
        axes.stairs(
            drift * scale,
            stories,
            orientation="horizontal",
            baseline=None,
            linestyle=style,
            color=COLORS[0],
            label=text,
        )
    axes.axvline(0.0, color=LIGHT, linewidth=0.6)
    axes.legend(loc="best")
    axes.set_ylim(stories[0], stories[-1])
    axes.yaxis.get_major_locator().set_params(integer=True)
    axes.set(ylabel="story", xlabel="drift ratio (%)" if ratio else f"drift ({units.label('m')})")
