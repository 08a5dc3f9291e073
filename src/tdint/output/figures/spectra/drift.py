"""Figure of drift spectra: drift ratios over the fundamental period, with the height of the buildings above."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from tdint.files import Writer
from tdint.output.figures.axes import plain_numbers
from tdint.output.figures.spectra.over_periods import Panel, draw_over_periods, line_labels, over_periods_title
from tdint.output.figures.style import add_title, picture
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.spectra.drift import DriftSpectrum


def drift_spectrum_picture(spectra: Sequence[DriftSpectrum], suffix: str, units: OutputUnits = SI) -> Writer:
    """Picture of drift spectra: a line per component and damping ratio.

    Return value and errors are those of `tdint.output.figures.style.picture`.

    Parameters
    ----------
    spectra : sequence of DriftSpectrum
        One at least; all of the same kind of building.
    """
    return picture(suffix, lambda: _draw(spectra, units))


def _draw(spectra: Sequence[DriftSpectrum], units: OutputUnits) -> Figure:
    beam = spectra[0].stories[0] == 0
    panels: list[Panel[DriftSpectrum]] = [
        ("drift ratio at the base (%)" if beam else "largest story drift ratio (%)", _peaks),
        ("roof displacement over height (%)", lambda spectrum: 100.0 * spectrum.roof_drift_ratio),
    ]
    figure = draw_over_periods(spectra, panels, line_labels(spectra))
    _add_heights(figure.axes[0], spectra[0], units)
    add_title(figure, over_periods_title("Drift spectrum", "Drift spectra", spectra, _buildings(spectra[0])))
    return figure


def _peaks(spectrum: DriftSpectrum) -> Any:
    return 100.0 * spectrum.peak_drift_ratio


def _buildings(spectrum: DriftSpectrum) -> str:
    least, most = int(spectrum.stories.min()), int(spectrum.stories.max())
    if most == 0:
        return "continuous shear beam"
    stories = f"{most}" if least == most else f"{least} to {most}"
    return f"shear buildings of {stories} {'story' if most == 1 else 'stories'}"


def _add_heights(axes: Any, spectrum: DriftSpectrum, units: OutputUnits) -> None:
    """A scale of the heights on top; they are a power of the period."""
    first, last = spectrum.periods.argmin(), spectrum.periods.argmax()
    if spectrum.periods[first] == spectrum.periods[last]:
        return
    periods = spectrum.periods[[first, last]].tolist()
    heights = units.of(spectrum.heights[[first, last]], "m").tolist()
    power = math.log(heights[1] / heights[0]) / math.log(periods[1] / periods[0])
    scale = axes.secondary_xaxis(
        "top",
        functions=(
            lambda period: heights[0] * (abs(period) / periods[0]) ** power,
            lambda height: periods[0] * (abs(height) / heights[0]) ** (1.0 / power),
        ),
    )
    scale.set_xlabel(f"height ({units.label('m')})")
    scale.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    plain_numbers(scale.xaxis)
    scale.xaxis.set_minor_formatter(NullFormatter())
