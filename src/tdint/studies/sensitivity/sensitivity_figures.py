"""Figure of the sensitivity of peak responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from tdint.output.figures import style
from tdint.output.figures.runs import QUANTITY_LABELS
from tdint.studies.sensitivity.sensitivity import ParameterEffect
from tdint.units import SI, OutputUnits


def sensitivity_picture(
    parameter_effects: Sequence[ParameterEffect], units: OutputUnits = SI
) -> Figure:
    """Plot the effects of parameters of a building on its peak responses, as tornado diagrams.

    Parameters
    ----------
    parameter_effects : sequence of ParameterEffect
        Results of `tdint.studies.sensitivity.sensitivity.parameter_effects`; at least one.
    """
    units = units.in_figures
    parameters = len({effect.parameter for effect in parameter_effects})
    height = 2.2 + 0.56 * parameters
    figure, (panels,) = style.new_panels(7.2, (height, (1,) * 4), share="y", columns=2)
    for axes, name in zip(panels, QUANTITY_LABELS, strict=True):
        effects = [effect for effect in parameter_effects if effect.quantity.name == name]
        _tornado(axes, effects, units)
    return style.titled(
        figure,
        f"{parameter_effects[0].building}\n"
        "medians of the peak responses, one parameter changed at a time",
    )


def _tornado(axes: Any, parameter_effects: Sequence[ParameterEffect], units: OutputUnits) -> None:
    """Plot a tornado diagram: a bar from the low to the high value for each varied parameter."""
    first = parameter_effects[0]
    is_first = first.quantity.name == next(iter(QUANTITY_LABELS))
    if first.quantity.unit == "1":
        factor, unit = 100.0, "%"
    else:
        factor, unit = style.scaled_unit(first.as_it_is, first.quantity.unit, units)
    for row, effect in enumerate(parameter_effects):
        low = (effect.at_low - effect.as_it_is) * factor
        high = (effect.at_high - effect.as_it_is) * factor
        # If both bars extend to the same side, the shorter bar must be in front (larger zorder).
        low_order, high_order = (1.6, 1.5) if abs(low) < abs(high) else (1.5, 1.6)
        if abs(low) == abs(high):
            low_order = high_order = 1.5
        for name, width, color, order in (
            ("low", low, style.COLORS[0], low_order),
            ("high", high, style.COLORS[1], high_order),
        ):
            axes.barh(
                row,
                width,
                left=effect.as_it_is * factor,
                height=0.62,
                color=color,
                label=f"{name} value" if is_first and row == 0 else None,
                zorder=order,
            )
    axes.axvline(first.as_it_is * factor, color=style.LIGHT, linewidth=0.8)
    names = [
        f"{effect.parameter.replace('_', ' ')}\n{effect.low:g} to {effect.high:g}"
        for effect in parameter_effects
    ]
    axes.set_yticks(range(len(parameter_effects)), names, fontsize=7.0)
    axes.set_ylim(len(names) - 0.5, -0.5)  # the first parameter is at the top
    axes.margins(x=0.08)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(f"{QUANTITY_LABELS[first.quantity.name]} ({unit})")
