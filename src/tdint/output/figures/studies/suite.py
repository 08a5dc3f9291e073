"""Figure of a scaled suite: each spectrum in gray, median and fractiles, and what it was scaled to."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tdint.campaign.suites.intensity import GEOMETRIC_MEAN, SpectralIntensity
from tdint.campaign.suites.scaling import LEAST_PART, Scaling, suite_spectra
from tdint.campaign.suites.suite import components
from tdint.files import Writer
from tdint.ground_motion.record import Record
from tdint.output.figures.axes import plain_logarithmic
from tdint.output.figures.studies.intensity import add_gravity_axis, measure_words, single_look
from tdint.output.figures.style import COLORS, DASHES, add_title, changed, picture, record_name
from tdint.output.figures.suites import BETWEEN_FRACTILES, draw_fractiles, draw_median
from tdint.output_units import SI, OutputUnits

Array = NDArray[np.float64]

_PERIODS = (0.05, 5.0, 120)
_SHORTEST = 0.06  # sampling intervals; below there is nothing in a record
_FEW = 3  # motions: fewer have no fractiles
_PAIR = {GEOMETRIC_MEAN: "geometric mean of both components", "rotd50": "RotD50", "rotd100": "RotD100"}


def suite_picture(scaling: Scaling, suffix: str, units: OutputUnits = SI) -> Writer:
    """Picture of a scaled suite.

    Parameters, return value and errors are those of `tdint.output.figures.style.picture`.
    """
    return picture(suffix, lambda: _draw(scaling, units))


def _draw(scaling: Scaling, units: OutputUnits) -> Figure:
    figure = Figure(figsize=(7.2, 5.2), layout="constrained")
    axes = figure.subplots()
    periods = _periods(scaling)
    spectra, what = _spectra(scaling, periods)
    spectra = units.of(spectra, "m/s^2")
    several = len(spectra) > 1
    look = single_look(several)
    axes.plot(periods, spectra.T, zorder=1, **look)
    axes.plot([], [], label=f"{len(spectra)} {what}{'s' * several}", **look)
    if several:
        draw_median(axes, periods, spectra, COLORS[0], zorder=4.0).set_label("median")
    if len(spectra) >= _FEW:
        draw_fractiles(axes, periods, spectra, COLORS[0], zorder=3.0).set_label(BETWEEN_FRACTILES)
    _draw_aim(axes, scaling, periods, spectra, units)
    plain_logarithmic(axes)
    axes.set_xlim(periods[0], periods[-1])
    axes.set_xlabel("period (s)")
    axes.set_ylabel(f"pseudo-acceleration Sa ({units.label('m/s^2')})")
    add_gravity_axis(axes, units.unit("m/s^2")[0])
    axes.legend(loc="lower left")
    add_title(figure, _title(scaling, units))
    return figure


def _spectra(scaling: Scaling, periods: Array) -> tuple[Array, str]:
    """What is drawn, and what one of them is: the median of FEMA P-695 is that of all components."""
    if isinstance(scaling.motions[0], Record):
        return scaling.spectra(periods), "record"
    if scaling.rule != "p695":
        return scaling.spectra(periods), "pair"
    parts = [
        factor * suite_spectra(components(motion), periods, scaling.damping, scaling.pair)
        for motion, factor in zip(scaling.motions, scaling.factors, strict=True)
    ]
    return np.concatenate(parts), "component"


def _draw_aim(axes: Any, scaling: Scaling, periods: Array, spectra: Array, units: OutputUnits) -> None:
    """What the suite was scaled to: a point, or a spectrum over its range."""
    red = COLORS[1]
    if scaling.target is not None and scaling.periods is not None:
        target, psa = scaling.target, units.of(scaling.target.psa, "m/s^2")
        axes.axvspan(scaling.periods[0], scaling.periods[-1], color="0.95", zorder=0)
        axes.plot(target.periods, psa, color=red, linewidth=2.2, label="target", zorder=5)
        if scaling.rule == "asce7":
            axes.plot(target.periods, LEAST_PART * psa, color=red, linestyle=DASHES[2], zorder=5, label="90 % of it")
            axes.plot(
                periods, np.mean(spectra, axis=0), color=COLORS[2], linewidth=2.0, linestyle=DASHES[3], zorder=5,
                label="average",
            )  # fmt: skip
    periods_aimed = _aimed(scaling)
    if scaling.value is None or not periods_aimed:
        return
    value = units.of(scaling.value, "m/s^2")
    said = f"{value:.4g} {units.label('m/s^2')}"
    if len(periods_aimed) == 1 and periods_aimed[0] > 0.0:
        label = f"Sa({periods_aimed[0]:.4g} s) = {said}"
        axes.plot(periods_aimed[0], value, "o", color=red, markersize=7, zorder=6, label=label)
    elif len(periods_aimed) > 1:
        label = f"Sa_avg = {said}"
        axes.axvspan(periods_aimed[0], periods_aimed[-1], color="0.95", zorder=0)
        axes.plot([periods_aimed[0], periods_aimed[-1]], [value] * 2, color=red, zorder=5, label=label)


def _aimed(scaling: Scaling) -> tuple[float, ...]:
    """Periods of the measure that was scaled to."""
    return scaling.measure.periods if isinstance(scaling.measure, SpectralIntensity) else ()


def _periods(scaling: Scaling) -> Array:
    """Periods that show the suite, and what it was scaled to."""
    low, high, count = _PERIODS
    for periods in (scaling.periods, _aimed(scaling)):
        if periods is not None and len(periods) and periods[0] > 0.0:
            low, high = min(low, 0.8 * float(periods[0])), max(high, 1.25 * float(periods[-1]))
    intervals = [record.dt for motion in scaling.motions for record in components(motion)]
    return np.geomspace(max(low, _SHORTEST * max(intervals)), high, int(count))


def _title(scaling: Scaling, units: OutputUnits) -> str:
    target = record_name(scaling.target.source) if scaling.target else ""
    value = ""
    if scaling.measure is not None and scaling.value is not None:
        unit = scaling.measure.unit
        value = f"{measure_words(scaling.measure.name)} = {units.of(scaling.value, unit):.4g} {units.label(unit)}"
    ways = {
        "value": f"scaled to {value}",
        "mean": f"scaled to {target}, least squares of ln Sa",
        "asce7": f"scaled to {target} by ASCE 7",
        "p695": "normalized by FEMA P-695" + (f", scaled to median {value}" if value else ""),
    }
    records = [record for motion in scaling.motions for record in components(motion)]
    count = len(scaling.motions)
    what = "record" if isinstance(scaling.motions[0], Record) else "pair"
    names = f"{count} {what}s" if count > 1 else f"{record_name(records[0].source)} {scaling.motions[0].component}"
    measure = f", {_PAIR[scaling.pair]}" if what == "pair" and scaling.rule != "p695" else ""
    return f"{names}{changed(records)}, {ways[scaling.rule]}\n{100.0 * scaling.damping:g} % damping{measure}"
