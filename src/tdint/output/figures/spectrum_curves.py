"""Spectra: elastic (over the period, tripartite, ADRS), inelastic, rotated, drift; beside a published one; targets."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from tdint.arrays import Array
from tdint.ground_motion.record import Record, component_names
from tdint.output.figures.spectrum_axes import (
    Panel,
    draw_adrs,
    draw_over_periods,
    draw_tripartite,
    line_labels,
    log_periods,
    over_periods_title,
)
from tdint.output.figures.style import LIGHT, add_title, line_look, plain_numbers, record_name, record_names
from tdint.output_units import SI, OutputUnits
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from tdint.analysis.spectra.drift import DriftSpectrum
    from tdint.analysis.spectra.elastic import Spectrum
    from tdint.analysis.spectra.inelastic import InelasticSpectrum
    from tdint.analysis.spectra.published import SpectrumDifference
    from tdint.analysis.spectra.rotated import RotatedSpectrum
    from tdint.campaign.suites.target import TargetSpectrum


_MOST = 4  # components that have panels of their own
_NAMES = {
    "sd": ("displacement SD", "m"),
    "psv": ("pseudo-velocity PSV", "m/s"),
    "psa": ("pseudo-acceleration PSA", "m/s^2"),
    "sv": ("velocity SV", "m/s"),
    "sa": ("absolute acceleration SA", "m/s^2"),
}
"""By quantity its name and SI unit."""

_TARGET: dict[str, Any] = {"color": "0.1", "linewidth": 2.2, "zorder": 6}
_POINTS: dict[str, Any] = {"color": "0.25", "markersize": 3.0, "markerfacecolor": "none"}


def spectrum_picture(
    spectra: Sequence[Spectrum], axes: str = "periods", units: OutputUnits = SI, target: TargetSpectrum | None = None
) -> Figure:
    """Picture of spectra, a line per component and damping ratio, or the fractiles of a suite.

    Parameters
    ----------
    axes : str
        A key of `DRAWN`: pseudo-acceleration and displacement over the `periods`, `tripartite` (pseudo-velocity over
        the period, with scales of the other two), or `adrs` (pseudo-acceleration over displacement).
    target : TargetSpectrum, optional
        Drawn over them on the axes `periods`.
    """
    units = units.in_pictures
    figure = DRAWN[axes](spectra, line_labels(spectra), units)
    if target is not None:
        _add_target(figure, target, units)
    title = over_periods_title("Elastic response spectrum", "Elastic response spectra", spectra, _how(spectra[0]))
    add_title(figure, title)
    return figure


def _draw_periods(spectra: Sequence[Spectrum], labels: Sequence[str], units: OutputUnits) -> Figure:
    return draw_over_periods(spectra, _elastic_panels(units), labels)


def _elastic_panels(units: OutputUnits) -> list[Panel[Any]]:
    """Pseudo-accelerations above displacements."""
    return [
        (f"pseudo-acceleration PSA ({units.label('m/s^2')})", lambda line: units.of(line.psa, "m/s^2")),
        (f"displacement SD ({units.label('m')})", lambda line: units.of(line.sd, "m")),
    ]


def draw_accelerations(axes: Any, spectra: Sequence[Spectrum], units: OutputUnits) -> None:
    """Pseudo-accelerations over the periods, a line each."""
    for number, (spectrum, label) in enumerate(zip(spectra, line_labels(spectra), strict=True), len(axes.get_lines())):
        axes.plot(spectrum.periods, units.of(spectrum.psa, "m/s^2"), label=label, **line_look(number))
    log_periods(axes, np.concatenate([spectrum.periods for spectrum in spectra]))
    axes.set(ylim=(0.0, None), xlabel="period (s)", ylabel=f"pseudo-acceleration PSA ({units.label('m/s^2')})")
    if len(axes.get_lines()) > 1:
        axes.legend(loc="best")


DRAWN = {"periods": _draw_periods, "tripartite": draw_tripartite, "adrs": draw_adrs}
"""What draws spectra, by the name of its axes."""


def _how(spectrum: Spectrum) -> str:
    """The method, and what was chosen beside it."""
    if spectrum.method != "exact":
        return spectrum.method + f", {spectrum.interpolation} motion" * (spectrum.interpolation != "linear")
    return ", ".join(["exact solution", *_choices(spectrum)])


def _choices(spectrum: Spectrum | RotatedSpectrum) -> list[str]:
    """What was chosen of an exact solution that is not usual."""
    maxima = [f"maxima: {spectrum.maxima}"] if spectrum.maxima != "exact" else []
    return maxima + ([f"{spectrum.interpolation} motion"] if spectrum.interpolation != "linear" else [])


def inelastic_picture(spectra: Sequence[InelasticSpectrum], units: OutputUnits = SI) -> Figure:
    """Picture of inelastic spectra: a line per component, damping ratio, and ductility or strength.

    Parameters
    ----------
    spectra : sequence of InelasticSpectrum
        One at least; all for ductilities or all for strengths.
    """
    panels: list[Panel[InelasticSpectrum]] = [
        ("yield strength over weight", lambda spectrum: spectrum.yield_strength_ratio)
        if spectra[0].target is not None
        else ("ductility", lambda spectrum: spectrum.ductility),
        (f"largest displacement ({units.label('m')})", lambda spectrum: units.of(spectrum.sd, "m")),
    ]
    given = [_given(spectrum) for spectrum in spectra]
    several = len(set(given)) > 1
    components = _components(spectra)
    apart = 1 < len(set(components)) <= _MOST
    ratios = len({spectrum.damping for spectrum in spectra}) > 1
    own = [f"{100.0 * spectrum.damping:g} %" * ratios for spectrum in spectra] if apart else line_labels(spectra)
    labels = [", ".join(filter(None, (label, what * several))) for label, what in zip(own, given, strict=True)]
    variants = [(spectrum.damping, what) for spectrum, what in zip(spectra, given, strict=True)]
    figure = draw_over_periods(spectra, panels, labels, variants, columns=components if apart else None)
    if spectra[0].target is None:
        _show_ductility(figure.axes[0], spectra)
    more = ("" if several else f"{given[0]}, ") + f"bilinear, hardening {spectra[0].hardening:g}"
    add_title(figure, over_periods_title("Inelastic spectrum", "Inelastic spectra", spectra, more))
    return figure


def _components(spectra: Sequence[InelasticSpectrum]) -> list[str]:
    """What each spectrum is of; the file, too, where there are several."""
    files = record_names(spectrum.record.source for spectrum in spectra)
    several = len(files) > 1
    names = component_names([spectrum.record for spectrum in spectra])
    return [
        f"{files[spectrum.record.source]} {name}".rstrip() if several else name
        for spectrum, name in zip(spectra, names, strict=True)
    ]


def _show_ductility(axes: Any, spectra: Sequence[InelasticSpectrum]) -> None:
    """On a logarithmic axis, with a line at first yielding."""
    if not any(np.any(spectrum.ductility > 0.0) for spectrum in spectra):
        return
    axes.set_yscale("log")
    axes.autoscale(axis="y")
    axes.axhline(1.0, color=LIGHT, linewidth=0.8)
    plain_numbers(axes.yaxis)


def _given(spectrum: InelasticSpectrum) -> str:
    """What was asked for: a ductility, or a strength, which is the same at all periods."""
    if spectrum.target is not None:
        return f"ductility {spectrum.target:g}"
    return f"strength {spectrum.yield_strength_ratio[0]:.4g}"


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


def rotated_picture(
    spectra: Sequence[RotatedSpectrum], units: OutputUnits = SI, target: TargetSpectrum | None = None
) -> Figure:
    """Picture of spectra over all directions: a line per motion, damping ratio, percentile, and the geometric mean.

    Parameters
    ----------
    spectra : sequence of RotatedSpectrum
        One at least; all of the same percentiles.
    target : TargetSpectrum, optional
        Drawn over them.
    """
    units = units.in_pictures
    lines = [line for spectrum in spectra for line in _lines(spectrum)]
    labels = [f"{label}, {line.name}" for label, line in zip(line_labels(lines), lines, strict=True)]
    figure = draw_over_periods(lines, _elastic_panels(units), labels, [(line.damping, line.name) for line in lines])
    if target is not None:
        _add_target(figure, target, units)
    more = ", ".join(["exact solution", "180 directions", *_choices(spectra[0])])
    add_title(figure, over_periods_title("RotD spectrum", "RotD spectra", lines, more))
    return figure


def _lines(spectrum: RotatedSpectrum) -> Iterator[_Line]:
    motion = spectrum.motion
    names = dict.fromkeys((record_name(motion.first.source), record_name(motion.second.source)))
    record = replace(motion.first, source="+".join(names), component=motion.component)
    for percentile, psa in zip(spectrum.percentiles, spectrum.psa, strict=True):
        yield _Line(f"RotD{percentile:02d}", record, spectrum.damping, spectrum.periods, psa)
    yield _Line("geometric mean", record, spectrum.damping, spectrum.periods, spectrum.geometric_mean)


def drift_spectrum_picture(spectra: Sequence[DriftSpectrum], units: OutputUnits = SI) -> Figure:
    """Picture of drift spectra: a line per component and damping ratio.

    Parameters
    ----------
    spectra : sequence of DriftSpectrum
        One at least; all of the same kind of building.
    """
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
    return f"shear buildings of {f'{least} to ' * (least < most)}{how_many(most, 'story')}"


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


def difference_picture(lines: Sequence[SpectrumDifference], units: OutputUnits = SI) -> Figure:
    """Picture of spectra, the published values as points, and of the differences below."""
    units = units.in_pictures
    name, si = _NAMES[lines[0].published.quantity]
    panels: list[Panel[SpectrumDifference]] = [
        (f"{name} ({units.label(si)})", lambda line: units.of(line.computed, si)),
        ("computed over published, less 1 (%)", lambda line: 100.0 * line.relative_difference),
    ]
    figure = draw_over_periods(lines, panels, line_labels(lines))
    upper, lower = figure.axes
    for line in {id(line.published): line for line in lines}.values():
        upper.plot(line.periods, units.of(line.expected, si), "o", **_POINTS, zorder=3)
    upper.plot([], [], "o", **_POINTS, label="published")
    upper.legend(loc="best")
    lower.autoscale(axis="y")
    lower.axhline(0.0, color=LIGHT, linewidth=0.8, zorder=1.5)
    title = over_periods_title(
        "Spectrum", "Spectra", lines, f"beside {record_name(lines[0].published.source)} (points)"
    )
    add_title(figure, title)
    return figure


def target_picture(target: TargetSpectrum, units: OutputUnits = SI) -> Figure:
    """Picture of a target spectrum: pseudo-acceleration and displacement over the period."""
    units = units.in_pictures
    figure = Figure(figsize=(7.5, 7.2), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1.0))
    _add_target(figure, target, units, legend=False)
    upper.set_ylabel(f"pseudo-acceleration Sa ({units.label('m/s^2')})")
    lower.set(ylabel=f"displacement SD ({units.label('m')})", xlabel="period (s)")
    log_periods(lower, target.periods)
    for axes in (upper, lower):
        axes.set_ylim(bottom=0.0)
    damping = "" if target.damping is None else f"\n{100.0 * target.damping:g} % damping"
    add_title(figure, f"Target spectrum {_target_name(target)}{damping}")
    return figure


def _target_name(target: TargetSpectrum) -> str:
    """A design spectrum as it was named, or the name of the file without its folder."""
    return target.source if target.curve else record_name(target.source)


def _add_target(figure: Figure, target: TargetSpectrum, units: OutputUnits, *, legend: bool = True) -> None:
    """Draw a target into the panels of pseudo-acceleration and of displacement of a figure over the period."""
    upper, lower = figure.axes[:2]
    low, high = upper.get_xlim()
    psa, sd = units.of(target.psa, "m/s^2"), units.of(target.sd, "m")
    upper.plot(target.periods, psa, label=f"target {_target_name(target)}", **_TARGET)
    lower.plot(target.periods, sd, **_TARGET)
    if not legend:
        return
    upper.set_xlim(low, high)
    shown = (target.periods >= low) & (target.periods <= high)
    for axes, values in ((upper, psa), (lower, sd)):
        if np.any(shown):
            axes.set_ylim(top=max(axes.get_ylim()[1], 1.05 * float(np.max(values[shown]))))
    upper.legend(loc="upper right")
