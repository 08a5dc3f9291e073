"""Figure of sensitivity: a tornado for each peak, the parameter that moves it most on top."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from tdint.output.figures.style import COLORS, LIGHT, add_title, scaled_unit
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.campaign.sensitivity import Swing

_NAMES = {
    "peak_drift_ratio": "drift ratio",
    "peak_acceleration": "floor acceleration",
    "peak_roof_displacement": "roof displacement",
    "peak_base_shear": "base shear",
}


def sensitivity_picture(swings: Sequence[Swing], units: OutputUnits = SI) -> Figure:
    """Picture of swings (`tdint.campaign.sensitivity.swings`)."""
    parameters = len({one.parameter for one in swings})
    figure = Figure(figsize=(7.2, 2.2 + 0.56 * parameters), layout="constrained")
    for axes, name in zip(figure.subplots(2, 2).flat, _NAMES, strict=True):
        _tornado(axes, [one for one in swings if one.quantity.name == name], units)
    add_title(figure, f"{swings[0].building}: medians of the peaks, one parameter at its ends at a time")
    return figure


def _tornado(axes: Any, swings: Sequence[Swing], units: OutputUnits) -> None:
    first = swings[0]
    if first.quantity.unit == "1":
        factor, unit = 100.0, "%"
    else:
        factor, unit = scaled_unit(first.as_it_is, first.quantity.unit, units)
    for place, one in enumerate(swings):
        for end, value, color in (("low", one.at_low, COLORS[0]), ("high", one.at_high, COLORS[1])):
            label = f"{end} value" if place == 0 else None
            width = (value - one.as_it_is) * factor
            axes.barh(place, width, left=one.as_it_is * factor, height=0.62, color=color, label=label)
    axes.axvline(first.as_it_is * factor, color=LIGHT, linewidth=0.8)
    names = [f"{one.parameter}\n{one.low:g} to {one.high:g}" for one in swings]
    axes.set_yticks(range(len(swings)), names, fontsize=7.0)
    axes.invert_yaxis()
    axes.margins(x=0.08)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(f"{_NAMES[first.quantity.name]} ({unit})")
    if first.quantity.name == next(iter(_NAMES)):
        axes.legend(fontsize=7.0, loc="best")
