"""Figure of a pushover: base shear over roof displacement, and the drifts of the stories on the way."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from tdint.files import Writer
from tdint.output.figures.axes import add_ratio_axis
from tdint.output.figures.style import COLORS, DASHES, LIGHT, add_title, picture, scaled_unit
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.static.pushover import Pushover


def pushover_picture(result: Pushover, suffix: str, units: OutputUnits = SI) -> Writer:
    """Picture of a pushover; return value and errors are those of `tdint.output.figures.style.picture`."""
    return picture(suffix, lambda: _draw(result, units))


def _draw(result: Pushover, units: OutputUnits) -> Figure:
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    curve, profile = figure.subplots(1, 2, width_ratios=(1.7, 1.0))
    _draw_curve(curve, result, units)
    _draw_profile(profile, result, units)
    add_title(figure, f"{result.model.name}\nPushover, {result.pattern} pattern")
    return figure


def _draw_curve(axes: Any, result: Pushover, units: OutputUnits) -> None:
    factor, unit = scaled_unit(float(np.max(np.abs(result.base_shear))), "N", units)
    roof, shear = units.of(result.roof_displacement, "m"), result.base_shear * factor
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.plot(roof, shear, color=COLORS[0])
    at, most = units.of(result.roof_at_largest, "m"), result.largest_base_shear * factor
    axes.plot(at, most, "o", color=COLORS[0], label=f"largest base shear {most:.4g} {unit}")
    axes.legend(loc="best")
    axes.set_xlim(0.0, roof[-1])
    axes.set_xlabel(f"roof displacement ({units.label('m')})")
    axes.set_ylabel(f"base shear ({unit})")
    add_ratio_axis(axes, units.of(result.height, "m"), "roof drift ratio (%)")


def _draw_profile(axes: Any, result: Pushover, units: OutputUnits) -> None:
    """Drifts of the stories at the largest base shear and at the end."""
    stories = np.arange(result.drift.shape[1] + 1) + 0.5
    heights = [story.height for story in result.model.stories]
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
    axes.set_ylabel("story")
    axes.set_xlabel("drift ratio (%)" if ratio else f"drift ({units.label('m')})")
