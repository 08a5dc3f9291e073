"""Figures of elastic spectra: over the period, tripartite, or acceleration over displacement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tdint.files import Writer
from tdint.output.figures.spectra.over_periods import Panel, draw_over_periods, line_labels, over_periods_title
from tdint.output.figures.spectra.spectrum_axes import draw_adrs, draw_tripartite
from tdint.output.figures.style import add_title, picture
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.spectra.elastic import Spectrum

Array = NDArray[np.float64]
DrawSpectra = Callable[[Sequence["Spectrum"], Sequence[str], OutputUnits], Figure]


def spectrum_picture(
    spectra: Sequence[Spectrum], suffix: str, axes: str = "periods", units: OutputUnits = SI
) -> Writer:
    """Picture of spectra, a line per component and damping ratio, or the fractiles of a suite.

    Return value and errors are those of `tdint.output.figures.style.picture`.

    Parameters
    ----------
    axes : str
        A key of `DRAWN`: pseudo-acceleration and displacement over the `periods`, `tripartite` (pseudo-velocity over
        the period, with scales of the other two), or `adrs` (pseudo-acceleration over displacement).
    """
    return picture(suffix, lambda: _draw(spectra, DRAWN[axes], units.in_pictures))


def _draw(spectra: Sequence[Spectrum], draw: DrawSpectra, units: OutputUnits) -> Figure:
    figure = draw(spectra, line_labels(spectra), units)
    title = over_periods_title("Elastic response spectrum", "Elastic response spectra", spectra, _how(spectra[0]))
    add_title(figure, title)
    return figure


def _draw_periods(spectra: Sequence[Spectrum], labels: Sequence[str], units: OutputUnits) -> Figure:
    panels: list[Panel[Spectrum]] = [
        (f"pseudo-acceleration PSA ({units.label('m/s^2')})", lambda spectrum: units.of(spectrum.psa, "m/s^2")),
        (f"displacement SD ({units.label('m')})", lambda spectrum: units.of(spectrum.sd, "m")),
    ]
    return draw_over_periods(spectra, panels, labels)


DRAWN = {"periods": _draw_periods, "tripartite": draw_tripartite, "adrs": draw_adrs}
"""What draws spectra, by the name of its axes."""


def _how(spectrum: Spectrum) -> str:
    """The method, and what was chosen beside it."""
    words = ["exact solution" if spectrum.method == "exact" else spectrum.method]
    if spectrum.method == "exact" and spectrum.maxima != "exact":
        words.append(f"maxima: {spectrum.maxima}")
    if spectrum.interpolation != "linear":
        words.append(f"{spectrum.interpolation} motion")
    return ", ".join(words)
