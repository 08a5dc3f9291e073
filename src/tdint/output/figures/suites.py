"""A suite of motions as several figures draw it: the median and the fractiles on both sides, and intensity measures.

And the figure of a scaled suite: each spectrum in gray, median and fractiles, and what it was scaled to.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.arrays import Array
from tdint.campaign.suites.intensity import GEOMETRIC_MEAN, PAIRS, SpectralIntensity
from tdint.campaign.suites.scaling import LEAST_PART, Scaling, suite_spectra
from tdint.ground_motion.reading.suites import components
from tdint.ground_motion.record import Record
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    add_title,
    changed,
    minor_ticks,
    plain_logarithmic,
    plain_numbers,
    record_name,
)
from tdint.output_units import SI, OutputUnits
from tdint.units import ACCELERATION, STANDARD_GRAVITY
from tdint.written_numbers import how_many

GRAY = "0.72"
"""Of what is one record among many."""

_PAIRS = {GEOMETRIC_MEAN: "geometric mean ", "rotd50": "RotD50 ", "rotd100": "RotD100 "}
_WORDS = {"sa": "Sa", "sa-avg": "Sa_avg", "pga": "PGA", "pgv": "PGV", "arias": "Arias intensity", "cav": "CAV"}

FRACTILES = (16, 84)
BETWEEN_FRACTILES = f"{FRACTILES[0]} % and {FRACTILES[1]} %"
"""What a legend calls their lines."""

_PERIODS = (0.05, 5.0, 120)
_SHORTEST = 0.06  # sampling intervals; below there is nothing in a record
_FEW = 3  # motions: fewer have no fractiles
_PAIR = {GEOMETRIC_MEAN: "geometric mean of both components", "rotd50": "RotD50", "rotd100": "RotD100"}


def single_look(several: bool) -> dict[str, Any]:
    """How a line of a single record is drawn: light among several, plain alone."""
    return {"color": GRAY, "linewidth": 0.8} if several else {"color": COLORS[0], "linewidth": 1.6}


def measure_words(name: str) -> str:
    """An intensity measure as a paper writes it: Sa(1.095 s) of `sa(1.09504)`."""
    pair = next((pair for pair in PAIRS if name.startswith(f"{pair}-")), "")
    kind, _, rest = name.removeprefix(f"{pair}-").partition("(")
    period = rest.removesuffix(")")
    with suppress(ValueError):
        period = f"{float(period):.4g} s"
    return _PAIRS.get(pair, "") + _WORDS.get(kind, kind) + (f"({period})" if period else "")


def measure_label(name: str, unit: str) -> str:
    """An axis of intensity: its measure, and its unit as far as known."""
    text = measure_words(name) or "intensity measure"
    return f"{text} ({unit.replace('^2', '²')})" if unit else text


def add_gravity_axis(axes: Any, unit: str, *, horizontal: bool = False) -> None:
    """A second axis, in g, on the other side of one in another unit of acceleration; none beside other units."""
    if unit == "g" or unit not in ACCELERATION:
        return
    g = STANDARD_GRAVITY / ACCELERATION[unit]
    both = (lambda value: value / g, lambda value: value * g)
    second = (
        axes.secondary_xaxis("top", functions=both) if horizontal else axes.secondary_yaxis("right", functions=both)
    )
    axis = second.xaxis if horizontal else second.yaxis
    plain_numbers(axis)
    if (axes.get_xscale() if horizontal else axes.get_yscale()) == "log":
        minor_ticks(axis)
    axis.set_label_text("(g)")


def draw_median(axes: Any, x: Array, rows: Array, color: str, *, zorder: float = 3.0) -> Any:
    """The line of the median of the rows, shape (motions, k), over x, shape (k,)."""
    return axes.plot(x, np.nanmedian(rows, axis=0), color=color, linewidth=2.0, zorder=zorder)[0]


def draw_fractiles(axes: Any, x: Array, rows: Array, color: str, *, zorder: float = 2.5) -> Any:
    """The lines of the fractiles of the rows; one of them, for the legend."""
    low, high = np.nanpercentile(rows, FRACTILES, axis=0)
    axes.plot(x, low, color=color, linestyle=DASHES[1], zorder=zorder)
    return axes.plot(x, high, color=color, linestyle=DASHES[1], zorder=zorder)[0]


def suite_picture(scaling: Scaling, units: OutputUnits = SI) -> Figure:
    """Picture of a scaled suite."""
    figure = Figure(figsize=(7.2, 5.2), layout="constrained")
    draw_suite(figure.subplots(), scaling, units)
    add_title(figure, _title(scaling, units))
    return figure


def draw_suite(axes: Any, scaling: Scaling, units: OutputUnits) -> None:
    """The scaled spectra with median, fractiles and what they were scaled to."""
    periods = _periods(scaling)
    spectra, what = _spectra(scaling, periods)
    spectra = units.of(spectra, "m/s^2")
    several = len(spectra) > 1
    look = single_look(several)
    axes.plot(periods, spectra.T, zorder=1, **look)
    axes.plot([], [], label=how_many(len(spectra), what), **look)
    if several:
        draw_median(axes, periods, spectra, COLORS[0], zorder=4.0).set_label("median")
    if len(spectra) >= _FEW:
        draw_fractiles(axes, periods, spectra, COLORS[0], zorder=3.0).set_label(BETWEEN_FRACTILES)
    _draw_aim(axes, scaling, periods, spectra, units)
    plain_logarithmic(axes)
    axes.set(xlim=(periods[0], periods[-1]), xlabel="period (s)")
    axes.set_ylabel(f"pseudo-acceleration Sa ({units.label('m/s^2')})")
    add_gravity_axis(axes, units.unit("m/s^2")[0])
    axes.legend(loc="lower left")


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
        if scaling.least is not None:
            axes.plot(target.periods, LEAST_PART * psa, color=red, linestyle=DASHES[2], zorder=5, label="90 % of it")
            style = {"color": COLORS[2], "linewidth": 2.0, "linestyle": DASHES[3], "zorder": 5}
            axes.plot(periods, np.mean(spectra, axis=0), **style, label="average")
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
    named = scaling.target
    target = "" if named is None else named.source if named.curve else record_name(named.source)
    value = ""
    if scaling.measure is not None and scaling.value is not None:
        unit = scaling.measure.unit
        value = f"{measure_words(scaling.measure.name)} = {units.of(scaling.value, unit):.4g} {units.label(unit)}"
    ways = {
        "value": f"scaled to {value}",
        "mean": f"scaled to {target}, least squares of ln Sa",
        "asce7": f"scaled to {target} by ASCE 7",
        "ec8": f"scaled to {target} by EN 1998-1",
        "p695": "normalized by FEMA P-695" + (f", scaled to median {value}" if value else ""),
    }
    records = [record for motion in scaling.motions for record in components(motion)]
    count = len(scaling.motions)
    what = "record" if isinstance(scaling.motions[0], Record) else "pair"
    names = how_many(count, what) if count > 1 else f"{record_name(records[0].source)} {scaling.motions[0].component}"
    measure = f", {_PAIR[scaling.pair]}" if what == "pair" and scaling.rule != "p695" else ""
    return f"{names}{changed(records)}, {ways[scaling.rule]}\n{100.0 * scaling.damping:g} % damping{measure}"
