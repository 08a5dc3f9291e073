"""Figures of scaled suites, and labels of intensity measures that figures of suites share."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.ground_motion.measures import MEASURES
from tdint.ground_motion.reading.suites import components
from tdint.number_parsing import number_text, pluralize
from tdint.output.figures.fractiles import BETWEEN_FRACTILES, draw_fractiles, draw_median
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    NO_BREAK_SPACE,
    FirstPeriods,
    changed,
    mark_first_periods,
    motion_name,
    new_axes,
    plain_logarithmic,
    psa_label,
    record_name,
    titled,
)
from tdint.output.spectrum_text import spectrum_text
from tdint.response.spectra.elastic import SHORTEST
from tdint.studies.motions import intensity
from tdint.studies.motions.scaling import MIN_AVERAGE_RATIO, Scaling, suite_spectra
from tdint.units import SI, OutputUnits

# ---- Parts that several figures of suites share: median, fractiles and intensity measures
#
# For example, the figure of a scaled suite shows the spectrum of each ground motion as a gray line,
# and the median, the fractiles and the target as lines in color.

GRAY = "0.72"
"""Color of the line of a single record in a suite."""

_PAIR_NAMES = {
    intensity.GEOMETRIC_MEAN: "geometric mean",
    "rotd50": "RotD50",
    "rotd100": "RotD100",
    intensity.LARGER_COMPONENT: "larger component",
    intensity.SRSS: "SRSS of both components",
}
_SPECTRAL_NAMES = {"sa": "Sa", "sa-avg": "Sa_avg"}


MIN_MOTIONS = 3  # minimum number of ground motions for fractiles
_PERIODS = (0.05, 5.0, 120)
"""First period (s), last period (s) and number of periods of the spectra of a scaled suite."""
_MAX_PERIOD_RATIO = 1.5
"""Period divided by the longest period of the rule, up to which spectra determine the axis."""


def pair_text(demand: str) -> str:
    """Return the text in figures for a measure of both components of a pair; a `demand` that is not
    in `_PAIR_NAMES` is returned unchanged."""
    suffix = " of both components" if demand == intensity.GEOMETRIC_MEAN else ""
    return f"{_PAIR_NAMES.get(demand, demand)}{suffix}"


def single_style(several: bool) -> dict[str, Any]:
    """Return the line style of a single record as keyword arguments of matplotlib.

    The line is light if the figure contains `several` records, because their median is then plotted
    in a dark color.
    """
    return {"color": GRAY, "linewidth": 0.8} if several else {"color": COLORS[0], "linewidth": 1.6}


def measure_words(name: str) -> str:
    """Return the name of an intensity measure as in publications: Sa(1.095 s) for `sa(1.09504)`.

    `name` is the name in tdint: a measure, with the period (s) in parentheses if it has one, and
    after the treatment of pairs for pairs, as in `rotd50-sa(1.0)`.
    """
    # The name is [PAIR-]MEASURE[(PERIOD)]. A parameter that is not a number is not changed.
    pair = next((pair for pair in intensity.PAIRS if name.startswith(f"{pair}-")), "")
    measure, _, parameter = name.removeprefix(f"{pair}-").partition("(")
    period = parameter.removesuffix(")")
    with suppress(ValueError):
        period = f"{_period_text(float(period))} s"
    symbol = MEASURES[measure].symbol if measure in MEASURES else ""
    text = f"{_PAIR_NAMES.get(pair, '')} {symbol or _SPECTRAL_NAMES.get(measure, measure)}".strip()
    return f"{text}({period})" if period else text


def _period_text(period: float) -> str:
    """Return a period with four digits, and with at least two decimals: 0.90, 1.095, 12.00."""
    text = number_text(period)
    # A power of ten is kept.
    return text if len(text.partition(".")[2]) > 1 or "e" in text else f"{period:.2f}"


def measure_label(name: str, unit: str) -> str:
    """Return the label of an intensity axis: the measure, and its unit if it is known."""
    text = measure_words(name) or "intensity measure"
    return f"{text} ({unit.replace('^2', '²')})" if unit else text


def suite_picture(scaling: Scaling, units: OutputUnits = SI, periods: FirstPeriods = ()) -> Figure:
    """Plot the response spectra of a suite of scaled ground motions, with the target of the
    scaling. `periods` are names and first periods (s) of buildings to be marked."""
    figure, axes = new_axes(7.2, 5.2)
    units = units.in_figures
    draw_suite(axes, scaling, units)
    mark_first_periods(axes, periods)
    target = ""
    if scaling.target is not None:
        source = scaling.target.source
        target = spectrum_text(source) if scaling.target.curve else record_name(source)
        target = target.replace(" ", NO_BREAK_SPACE)
    value = ""
    if scaling.measure is not None and scaling.value is not None:
        unit = scaling.measure.unit
        value = (
            f"{measure_words(scaling.measure.name)} = {units.of(scaling.value, unit):.4g} "
            f"{units.label(unit)}"
        )
    selected = "selected and " if scaling.chosen else ""
    median = f", scaled to median {value}" if value else ""
    scaling_texts = {
        "value": f"scaled to {value}",
        "mean": f"{selected}scaled to {target}, least squares of ln Sa",
        "asce7": f"scaled to {target} by ASCE 7",
        "ec8": f"scaled to {target} by EN 1998-1",
        "p695": f"normalized by FEMA P-695{median}",
    }
    # Many names would not fit.
    records = [record for motion in scaling.motions for record in components(motion)]
    subject = scaling.suite
    if len(scaling.motions) == 1:
        subject = motion_name(scaling.motions[0])
    title = f"{subject}{changed(records)}, {scaling_texts[scaling.rule]}\n"
    title += f"{100.0 * scaling.damping:g} % damping"
    if scaling.noun != "record" and scaling.rule != "p695":
        title += f", {pair_text(scaling.pair)}"
    return titled(figure, title)


def draw_suite(axes: Any, scaling: Scaling, units: OutputUnits) -> None:
    """Plot the spectra of scaled ground motions with their median, fractiles and target.

    Records that were not selected are plotted in light gray.
    """
    # The periods include all periods of the target. The shortest period must be resolved by the
    # samples.
    low, high, count = _PERIODS
    for target_periods in (scaling.periods, _target_periods(scaling)):
        if target_periods is not None and len(target_periods) and target_periods[0] > 0.0:
            low = min(low, 0.8 * float(target_periods[0]))
            high = max(high, 1.25 * float(target_periods[-1]))
    intervals = [record.dt for motion in scaling.motions for record in components(motion)]
    periods = np.geomspace(max(low, SHORTEST * max(intervals)), high, int(count))
    # One line for each ground motion. FEMA P-695 uses the median of all components: one line for
    # each component.
    quantity = scaling.noun
    if quantity == "pair" and scaling.rule == "p695":
        quantity = "component"
        parts = [
            factor * suite_spectra(components(motion), periods, scaling.damping, scaling.pair)
            for motion, factor in zip(scaling.motions, scaling.factors, strict=True)
        ]
        spectra = units.of(np.concatenate(parts), "m/s^2")
    else:
        spectra = units.of(scaling.spectra(periods), "m/s^2")
    several = len(spectra) > 1
    others, other_style = scaling.unselected_spectra, {"color": "0.8", "linewidth": 0.4}
    if others is not None and len(others):
        axes.plot([], [], label=f"{pluralize(len(others), quantity)} not selected", **other_style)
    plot_style = single_style(several)
    axes.plot(periods, spectra.T, zorder=1, **plot_style)
    axes.plot([], [], label=pluralize(len(spectra), quantity), **plot_style)
    if several:
        style = {"color": COLORS[2], "linewidth": 2.0, "linestyle": DASHES[3], "zorder": 5}
        axes.plot(periods, np.mean(spectra, axis=0), **style, label="mean")
        draw_median(axes, periods, spectra, COLORS[0], zorder=4.0).set_label("median")
    if len(spectra) >= MIN_MOTIONS:
        draw_fractiles(axes, periods, spectra, COLORS[0], zorder=3.0).set_label(BETWEEN_FRACTILES)
    _draw_target(axes, scaling, units)
    plain_logarithmic(axes)
    # Smaller values, at periods beyond the range of the rule, do not matter for the scaling.
    if scaling.periods is not None and scaling.target is not None:
        in_range = periods <= _MAX_PERIOD_RATIO * scaling.periods[-1]
        smallest = float(np.min(spectra[:, in_range]))
        if smallest > 0.0:
            axes.set_ylim(bottom=0.8 * smallest)
    if others is not None and len(others):
        # The limits of the axis follow from the selected motions and the target.
        limits = axes.get_ylim()
        axes.plot(scaling.periods, units.of(others, "m/s^2").T, zorder=0.5, **other_style)
        axes.set_ylim(limits)
    axes.set(xlim=(periods[0], periods[-1]), xlabel="period (s)")
    axes.set_ylabel(psa_label(units))


def _draw_target(axes: Any, scaling: Scaling, units: OutputUnits) -> None:
    """Plot the target of a scaling: a target spectrum, or the value of an intensity measure.

    For rules that limit the mean of the scaled spectra, 90 % of the target is plotted as well.
    """
    red = COLORS[1]
    if scaling.target is not None and scaling.periods is not None:
        target, psa = scaling.target, units.of(scaling.target.psa, "m/s^2")
        ends = f"{scaling.periods[0]:.3g} to {scaling.periods[-1]:.3g} s"
        label = f"range of the rule, {ends}"
        axes.axvspan(scaling.periods[0], scaling.periods[-1], color="0.95", zorder=0, label=label)
        axes.plot(target.periods, psa, color=red, linewidth=2.2, label="target", zorder=5)
        if scaling.least is not None:
            axes.plot(
                target.periods,
                MIN_AVERAGE_RATIO * psa,
                color=red,
                linestyle=DASHES[2],
                zorder=5,
                label="90 % of the target",
            )
    target_periods = _target_periods(scaling)
    if scaling.value is None or not target_periods:
        return
    value = units.of(scaling.value, "m/s^2")
    value_text = f"{value:.4g} {units.label('m/s^2')}"
    first, last = target_periods[0], target_periods[-1]
    if len(target_periods) == 1 and first > 0.0:
        label = f"Sa({first:.4g} s) = {value_text}"
        axes.plot(first, value, "o", color=red, markersize=7, zorder=6, label=label)
    elif len(target_periods) > 1:
        label = f"Sa_avg = {value_text}"
        axes.axvspan(first, last, color="0.95", zorder=0)
        axes.plot([first, last], [value] * 2, color=red, zorder=5, label=label)


def _target_periods(scaling: Scaling) -> tuple[float, ...]:
    """Return the periods of the target intensity measure, s; empty for a target spectrum."""
    return (
        scaling.measure.periods if isinstance(scaling.measure, intensity.SpectralIntensity) else ()
    )
