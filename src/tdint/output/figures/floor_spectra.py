"""Figure of the floor spectra of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from tdint.output.figures.style import (
    line_style,
    mark_first_periods,
    new_axes,
    plain_logarithmic,
    psa_label,
    titled,
)
from tdint.response.spectra.floor_motions import FloorSpectrum
from tdint.units import SI, OutputUnits


def floor_picture(
    spectra: Sequence[FloorSpectrum],
    units: OutputUnits = SI,
    *,
    title: str = "",
    period: float = math.nan,
) -> Figure:
    """Plot the floor spectra of a run, with a labeled curve for each floor and damping ratio.

    Parameters
    ----------
    period : float
        First period of the building, s, which is marked; nan by default for no mark.
    """
    units = units.in_figures
    figure, axes = new_axes(7.2, 4.8)
    floors = list(dict.fromkeys(floor_spectrum.floor for floor_spectrum in spectra))
    ratios = list(dict.fromkeys(floor_spectrum.spectrum.damping for floor_spectrum in spectra))
    for floor_spectrum in spectra:
        floor, spectrum = floor_spectrum.floor, floor_spectrum.spectrum
        damping_text = f", {100.0 * spectrum.damping:g} %" if len(ratios) > 1 else ""
        label = floor_spectrum.place + damping_text
        plot_style = line_style(
            floors.index(floor), ratios.index(spectrum.damping) if len(ratios) > 1 else None
        ) | {"linewidth": 1.6}
        axes.plot(spectrum.periods, units.of(spectrum.psa, "m/s^2"), **plot_style, label=label)
    set_floor_axes(axes, units)
    mark_first_periods(axes, [("", period)])
    damping = f", {100.0 * ratios[0]:g} % damping" if len(ratios) == 1 else ""
    return titled(figure, f"{title}\nspectra of absolute floor accelerations{damping}".strip())


def set_floor_axes(axes: Any, units: OutputUnits) -> None:
    """Make the axes of a panel of floor spectra logarithmic, and set their labels."""
    plain_logarithmic(axes)
    axes.set(xlabel="period (s)", ylabel=psa_label(units))
    axes.label_outer()
