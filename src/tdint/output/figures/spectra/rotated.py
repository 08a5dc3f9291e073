"""Figure of spectra over all directions: percentiles and geometric mean over the period."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tdint.files import Writer
from tdint.ground_motion.record import Record
from tdint.output.figures.spectra.over_periods import Panel, draw_over_periods, line_labels, over_periods_title
from tdint.output.figures.style import add_title, picture, record_name
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.spectra.rotated import RotatedSpectrum

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Line:
    """A line of the figure: a percentile or the geometric mean of a motion and damping ratio."""

    name: str
    record: Record
    damping: float
    periods: Array
    psa: Array

    @property
    def sd(self) -> Array:
        """Displacement, m."""
        return self.psa * (self.periods / (2.0 * math.pi)) ** 2


def rotated_picture(spectra: Sequence[RotatedSpectrum], suffix: str, units: OutputUnits = SI) -> Writer:
    """Picture of spectra over all directions: a line per motion, damping ratio, percentile, and the geometric mean.

    Return value and errors are those of `tdint.output.figures.style.picture`.

    Parameters
    ----------
    spectra : sequence of RotatedSpectrum
        One at least; all of the same percentiles.
    """
    return picture(suffix, lambda: _draw(spectra, units.in_pictures))


def _draw(spectra: Sequence[RotatedSpectrum], units: OutputUnits) -> Figure:
    lines = [line for spectrum in spectra for line in _lines(spectrum)]
    panels: list[Panel[_Line]] = [
        (f"pseudo-acceleration PSA ({units.label('m/s^2')})", lambda line: units.of(line.psa, "m/s^2")),
        (f"displacement SD ({units.label('m')})", lambda line: units.of(line.sd, "m")),
    ]
    labels = [f"{label}, {line.name}" for label, line in zip(line_labels(lines), lines, strict=True)]
    figure = draw_over_periods(lines, panels, labels, [(line.damping, line.name) for line in lines])
    more = ["exact solution", "180 directions"]
    if spectra[0].maxima != "exact":
        more.append(f"maxima: {spectra[0].maxima}")
    if spectra[0].interpolation != "linear":
        more.append(f"{spectra[0].interpolation} motion")
    add_title(figure, over_periods_title("RotD spectrum", "RotD spectra", lines, ", ".join(more)))
    return figure


def _lines(spectrum: RotatedSpectrum) -> Iterator[_Line]:
    motion = spectrum.motion
    names = dict.fromkeys((record_name(motion.first.source), record_name(motion.second.source)))
    record = replace(motion.first, source="+".join(names), component=motion.component)
    for percentile, psa in zip(spectrum.percentiles, spectrum.psa, strict=True):
        yield _Line(f"RotD{percentile:02d}", record, spectrum.damping, spectrum.periods, psa)
    yield _Line("geometric mean", record, spectrum.damping, spectrum.periods, spectrum.geometric_mean)
