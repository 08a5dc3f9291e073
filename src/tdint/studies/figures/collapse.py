"""Figures of collapse: incremental dynamic analyses with fractiles and capacities, fragility
functions with observations and 95 % confidence bands, and cloud analyses with regression lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.arrays import Array
from tdint.ground_motion.reading.suites import components
from tdint.ground_motion.record import Record
from tdint.number_parsing import number_text, pluralize
from tdint.output.figures.fractiles import BETWEEN_FRACTILES, draw_fractiles, draw_median
from tdint.output.figures.legends import legend_columns
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    MARKERS,
    FirstPeriods,
    changed,
    is_narrow,
    line_style,
    mark_first_periods,
    minor_ticks,
    plain_logarithmic,
    plain_numbers,
    record_name,
    titled,
)
from tdint.output.spectrum_text import spectrum_text
from tdint.studies.fragility.fragility_function import CloudPoints, Fragility, Points
from tdint.studies.ida import IdaStudy
from tdint.studies.ida_curve import IdaCurve, fractiles
from tdint.studies.intensity import GEOMETRIC_MEAN, PAIRS, MotionIntensity, SpectralIntensity
from tdint.studies.pairs import SEPARATE, motions_text
from tdint.studies.scaling import MIN_AVERAGE_RATIO, Scaling, suite_spectra
from tdint.units import ACCELERATION, SI, STANDARD_GRAVITY, OutputUnits

# ---- Parts that several figures of suites share: median, fractiles and intensity measures
#
# For example, the figure of a scaled suite shows the spectrum of each ground motion as a gray line,
# and the median, the fractiles and the target as lines in color.

GRAY = "0.72"
"""Color of the line of a single record in a suite."""

_PAIR_PREFIXES = {GEOMETRIC_MEAN: "geometric mean ", "rotd50": "RotD50 ", "rotd100": "RotD100 "}
_MEASURE_NAMES = {
    "sa": "Sa",
    "sa-avg": "Sa_avg",
    "pga": "PGA",
    "pgv": "PGV",
    "arias": "Arias intensity",
    "cav": "CAV",
}


_MIN_MOTIONS = 3  # minimum number of ground motions for fractiles
_PERIODS = (0.05, 5.0, 120)
"""First period (s), last period (s) and number of periods of the spectra of a scaled suite."""
_MIN_INTERVALS = 0.06  # minimum period of spectra divided by the sampling interval
_PAIR_TEXTS = {
    GEOMETRIC_MEAN: "geometric mean of both components",
    "rotd50": "RotD50",
    "rotd100": "RotD100",
}


def pair_text(demand: str) -> str:
    """Return the text in figures for a measure of both components of a pair; a `demand` that is not
    in `_PAIR_TEXTS` is returned unchanged."""
    return _PAIR_TEXTS.get(demand, demand)


def single_style(several: bool) -> dict[str, Any]:
    """Return the line style of a single record as keyword arguments of matplotlib.

    The line is light if the figure contains `several` records, because their median is then drawn
    in a dark color.
    """
    return {"color": GRAY, "linewidth": 0.8} if several else {"color": COLORS[0], "linewidth": 1.6}


def measure_words(name: str) -> str:
    """Return the name of an intensity measure as in publications: Sa(1.095 s) for `sa(1.09504)`.

    `name` is the name in tdint: a measure, with the period (s) in parentheses if it has one, and
    after the treatment of pairs for pairs, as in `rotd50-sa(1.0)`.
    """
    # The name is [PAIR-]MEASURE[(PERIOD)]. A parameter that is not a number is not changed.
    pair = next((pair for pair in PAIRS if name.startswith(f"{pair}-")), "")
    measure, _, parameter = name.removeprefix(f"{pair}-").partition("(")
    period = parameter.removesuffix(")")
    with suppress(ValueError):
        period = f"{_period_text(float(period))} s"
    text = _PAIR_PREFIXES.get(pair, "") + _MEASURE_NAMES.get(measure, measure)
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


def add_gravity_axis(axes: Any, unit: str, *, horizontal: bool = False) -> None:
    """Add a second axis in g, if the axis of a panel has another unit of acceleration.

    Parameters
    ----------
    unit : str
        Unit of the existing axis. For g and for units of other quantities, no axis is added.
    """
    if unit == "g" or unit not in ACCELERATION:
        return
    g = STANDARD_GRAVITY / ACCELERATION[unit]
    conversions = (lambda value: value / g, lambda value: value * g)
    if horizontal:
        axis = axes.secondary_xaxis("top", functions=conversions).xaxis
        scale = axes.get_xscale()
    else:
        axis = axes.secondary_yaxis("right", functions=conversions).yaxis
        scale = axes.get_yscale()
    plain_numbers(axis)
    if scale == "log":
        minor_ticks(axis)
    axis.set_label_text("(g)")


def suite_picture(scaling: Scaling, units: OutputUnits = SI, periods: FirstPeriods = ()) -> Figure:
    """Plot the response spectra of a suite of scaled ground motions, with the target of the
    scaling. `periods` are names and first periods (s) of buildings to be marked."""
    figure = Figure(figsize=(7.2, 5.2), layout="constrained")
    axes = figure.subplots()
    draw_suite(axes, scaling, units)
    if periods:
        mark_first_periods(axes, periods)
        axes.legend(loc="lower left")
    target = ""
    if scaling.target is not None:
        source = scaling.target.source
        target = spectrum_text(source) if scaling.target.curve else record_name(source)
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
    noun = "record" if isinstance(scaling.motions[0], Record) else "pair"
    subject = pluralize(len(scaling.motions), noun)
    if len(scaling.motions) == 1:
        subject = f"{record_name(records[0].source)} {scaling.motions[0].component}"
    title = f"{subject}{changed(records)}, {scaling_texts[scaling.rule]}\n"
    title += f"{100.0 * scaling.damping:g} % damping"
    if noun == "pair" and scaling.rule != "p695":
        title += f", {_PAIR_TEXTS[scaling.pair]}"
    return titled(figure, title)


def draw_suite(axes: Any, scaling: Scaling, units: OutputUnits) -> None:
    """Plot the spectra of scaled ground motions with their median, fractiles and target.

    Records that were not selected are drawn in light gray.
    """
    # The periods include all periods of the target. The shortest period must be resolved by the
    # samples.
    low, high, count = _PERIODS
    for target_periods in (scaling.periods, _target_periods(scaling)):
        if target_periods is not None and len(target_periods) and target_periods[0] > 0.0:
            low = min(low, 0.8 * float(target_periods[0]))
            high = max(high, 1.25 * float(target_periods[-1]))
    intervals = [record.dt for motion in scaling.motions for record in components(motion)]
    periods = np.geomspace(max(low, _MIN_INTERVALS * max(intervals)), high, int(count))
    # One line for each ground motion. FEMA P-695 uses the median of all components: one line for
    # each component.
    quantity = "record" if isinstance(scaling.motions[0], Record) else "pair"
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
    if (
        scaling.unselected_spectra is not None
        and scaling.periods is not None
        and len(scaling.unselected_spectra)
    ):
        others = {"color": "0.8", "linewidth": 0.4}
        axes.plot(
            scaling.periods, units.of(scaling.unselected_spectra, "m/s^2").T, zorder=0.5, **others
        )
        axes.plot(
            [],
            [],
            label=f"{pluralize(len(scaling.unselected_spectra), quantity)} not selected",
            **others,
        )
    plot_style = single_style(several)
    axes.plot(periods, spectra.T, zorder=1, **plot_style)
    axes.plot([], [], label=pluralize(len(spectra), quantity), **plot_style)
    if several:
        draw_median(axes, periods, spectra, COLORS[0], zorder=4.0).set_label("median")
    if len(spectra) >= _MIN_MOTIONS:
        draw_fractiles(axes, periods, spectra, COLORS[0], zorder=3.0).set_label(BETWEEN_FRACTILES)
    _draw_target(axes, scaling, periods, spectra, units)
    plain_logarithmic(axes)
    axes.set(xlim=(periods[0], periods[-1]), xlabel="period (s)")
    axes.set_ylabel(f"pseudo-acceleration Sa ({units.label('m/s^2')})")
    add_gravity_axis(axes, units.unit("m/s^2")[0])
    axes.legend(loc="lower left")


def _draw_target(
    axes: Any, scaling: Scaling, periods: Array, spectra: Array, units: OutputUnits
) -> None:
    """Plot the target of a scaling: a target spectrum, or the value of an intensity measure.

    `spectra` are the scaled spectra in the unit of the axis, shape (motions, periods). Their
    average is drawn if the rule of the scaling limits it.
    """
    red = COLORS[1]
    if scaling.target is not None and scaling.periods is not None:
        target, psa = scaling.target, units.of(scaling.target.psa, "m/s^2")
        axes.axvspan(scaling.periods[0], scaling.periods[-1], color="0.95", zorder=0)
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
            style = {"color": COLORS[2], "linewidth": 2.0, "linestyle": DASHES[3], "zorder": 5}
            axes.plot(periods, np.mean(spectra, axis=0), **style, label="average")
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
    return scaling.measure.periods if isinstance(scaling.measure, SpectralIntensity) else ()


# ---- Collapse

_FRACTIONS = (0.16, 0.5, 0.84)  # probabilities of the fractiles of IDA curves
_DRIFTS = 240  # number of points of a curve, which is smooth at a width of 180 mm
_IM_MARGIN = 1.1  # upper end of the intensity axis divided by the maximum capacity
_DRIFT_MARGIN = 1.04  # end of flat lines divided by the maximum drift


def ida_picture(study: IdaStudy) -> Figure:
    """Plot an incremental dynamic analysis: intensity over maximum drift ratio.

    The axis has the unit of the intensities of `study`, which `IdaStudy.in_units` converts.
    """
    figure = Figure(figsize=(7.2, 5.2), layout="constrained")
    draw_ida(figure.subplots(), study)
    records = [curve.record for curve in study.states[0].curves]
    paired = 0 if study.pair_demand == SEPARATE else len(study.states[0].partners)
    subject = (
        motions_text(len(records), paired)
        if len(records) > 1
        else f"{record_name(records[0].source)} {records[0].component}"
    )
    title = (
        f"{study.model.name}\nIncremental dynamic analysis, {subject}{changed(records)}, "
        f"{study.method}"
    )
    # The damping ratio is stated for spectral accelerations, but not for PGA (the period 0).
    if not isinstance(study.measure, MotionIntensity) and study.measure.periods != (0.0,):
        title += f", {100.0 * study.measure.damping:g} % damping of Sa"
    return titled(figure, title)


def draw_ida(axes: Any, study: IdaStudy) -> None:
    """Plot the curves of an incremental dynamic analysis with their fractiles and capacities.

    Runs without a result are marked by crosses at the right edge. `study` has a state for each
    level of initial damage.
    """
    # The drift axis ends at the collapse drift if a building collapses or nearly collapses.
    limit = study.model.collapse_drift
    curves = study.motion_curves
    largest = max((run.drift_ratio for curve in curves for run in curve.stable), default=0.0)
    if 0.0 < largest <= 0.5 * limit and all(curve.collapse.censored for curve in curves):
        limit = largest
    states = study.states
    count = len(states[0].motion_curves)
    plot_style = single_style(count > 1 or len(states) > 1)
    axes.plot(
        [], [], label=pluralize(count, "motion" if study.partners else "record"), **plot_style
    )
    for curve in study.motion_curves:
        _draw_curve(axes, curve, limit, plot_style)
    for state, color in zip(states, (COLORS[0], *COLORS[2:]), strict=False):
        _draw_fractiles(axes, state, limit, color, several=len(states) > 1)
    for state in states:
        _draw_capacities(axes, state, limit)
    # The drift ratio of a failed run is unknown.
    failed_levels = [
        run.im for curve in study.curves for run in curve.runs if not (run.stable or run.collapsed)
    ]
    if failed_levels:
        axes.plot(
            [100.0 * limit] * len(failed_levels),
            failed_levels,
            "x",
            color="0.4",
            label="run without a result",
            clip_on=False,
        )
    capacities = (curve.collapse.capacity for curve in study.motion_curves)
    stable = (run.im for curve in study.motion_curves for run in curve.stable)
    highest = max((*filter(math.isfinite, capacities), *stable), default=0.0)
    axes.set(xlim=(0.0, 100.0 * _DRIFT_MARGIN * limit))
    axes.set(ylim=(0.0, _IM_MARGIN * (highest or 1.0)))
    axes.set(
        xlabel="maximum drift ratio (%)", ylabel=measure_label(study.im_name, study.measure.unit)
    )
    add_gravity_axis(axes, study.measure.unit)
    axes.legend(loc="lower right", frameon=True, framealpha=0.9, edgecolor="none")


def _draw_curve(axes: Any, curve: IdaCurve, limit: float, plot_style: dict[str, Any]) -> None:
    """Plot the curve of a ground motion: intensity over maximum drift ratio in percent.

    The curve leads from the origin, or from the residual drift of a damaged building, through the
    runs without collapse. At the capacity, it continues horizontally to the right edge (`limit`).
    """
    drift = [curve.residual_drift_ratio, *(run.drift_ratio for run in curve.stable)]
    im = [0.0, *(run.im for run in curve.stable)]
    if not curve.collapse.censored and curve.stable:
        drift += [drift[-1], _DRIFT_MARGIN * limit]
        im += [curve.collapse.capacity] * 2
    axes.plot(100.0 * np.array(drift), im, zorder=1, **plot_style)


def _draw_fractiles(axes: Any, study: IdaStudy, limit: float, color: str, *, several: bool) -> None:
    """Plot the fractiles of the curves for a state of initial damage; only the median if there are
    `several` states.

    Fewer than `_MIN_MOTIONS` curves have no fractiles; they are drawn in the color of the state if
    there are several states.
    """
    damage = study.motion_curves[0].damage
    state = f"damaged to {100.0 * damage:g} %" if damage else "intact"
    if len(study.motion_curves) < _MIN_MOTIONS:
        for i, curve in enumerate(study.motion_curves if several else ()):
            # The curves of a state have the same style and one legend entry.
            style = {"color": color, "linewidth": 1.6, "label": "" if i else state}
            _draw_curve(axes, curve, limit, style)
        return
    drifts = np.linspace(0.0, limit, _DRIFTS)[1:]
    rows = fractiles(study.motion_curves, drifts, _FRACTIONS)
    # In reverse order, the legend lists the median first; both dashed lines have one entry.
    for fraction, row in reversed(list(zip(_FRACTIONS, rows, strict=True))):
        is_median = fraction == 0.5
        if not np.isfinite(row).any() or (several and not is_median):
            continue
        if is_median:
            style = {"linewidth": 2.2, "label": f"median, {state}" if several else "median"}
        else:
            label = "16 % and 84 %" if fraction == _FRACTIONS[0] else None
            style = {"linestyle": DASHES[1], "linewidth": 1.4, "label": label}
        start = [] if damage else [0.0]  # a damaged building does not start at the origin
        axes.plot([*start, *(100.0 * drifts)], [*start, *row], color=color, zorder=3, **style)


def _draw_capacities(axes: Any, study: IdaStudy, limit: float) -> None:
    """Mark the capacity of each curve, or the last level of a curve without collapse, at a drift
    ratio of at most `limit`. A curve without a run that is free of collapse has no mark, because
    the capacity has no drift."""
    # Points (drift ratio in percent, intensity) of each type of mark: marker, filling and label.
    collapse = ("o", COLORS[1], "capacity against collapse")
    resurrection = ("D", "white", "capacity, no collapse at a higher level")
    censored = ("^", "white", "does not collapse up to here")
    groups: dict[tuple[str, str, str], list[tuple[float, float]]] = {
        collapse: [],
        resurrection: [],
        censored: [],
    }
    for curve in study.motion_curves:
        if curve.stable:
            drift = min(curve.stable[-1].drift_ratio, limit)
            mark = resurrection if curve.resurrection else collapse
            if curve.collapse.censored:
                mark = censored
            groups[mark].append((100.0 * drift, curve.collapse.capacity))
    for (marker, face, label), points in groups.items():
        if points:
            x, y = zip(*points, strict=True)
            # Each type of mark has one legend entry for all states.
            legend_label = None if label in axes.get_legend_handles_labels()[1] else label
            axes.scatter(
                x,
                y,
                s=26,
                marker=marker,
                facecolor=face,
                edgecolor=COLORS[1],
                linewidth=1.1,
                zorder=4,
                label=legend_label,
            )


_POINTS = 300  # points of a fragility function
_TYPES_PER_ROW = 4  # panels of building types per row
# Maximum number of fragility functions in a single panel. A function with a modeling dispersion has
# two curves: without and with this dispersion. For more functions, the curves with the modeling
# dispersion are in a second panel.
_MAX_IN_PANEL = 2
_END_DEVIATIONS = 2.6  # standard deviations from the maximum median to the end of the axis
_NAMES = {
    "stripes": "Fragility of stripes, maximum likelihood",
    "ida": "Fragility of capacities",
    "cloud": "Cloud and its fragility, maximum likelihood",
}


def fragility_picture(functions: Sequence[Fragility]) -> Figure:
    """Plot fragility functions of the same fit and intensity measure with their observations and
    confidence bands.

    A cloud analysis has a second panel with its regression. If more than `_MAX_IN_PANEL` functions
    have a modeling dispersion, the functions with this dispersion have a separate panel.
    """
    cloud = functions[0].cloud
    crowded = (
        cloud is None
        and len(functions) > _MAX_IN_PANEL
        and any(function.modeling_dispersion for function in functions)
    )
    stacked = crowded and is_narrow()
    figure = Figure(
        figsize=(6.8, 9.2) if stacked else (9.2 if cloud or crowded else 6.8, 4.6),
        layout="constrained",
    )
    if crowded:
        first, second = figure.subplots(2, 1) if stacked else figure.subplots(1, 2, sharey=True)
        draw_functions(first, functions, total=False)
        end = _axis_end(functions)
        im = np.linspace(0.0, end, _POINTS)[1:]
        for i, function in enumerate(functions):
            label = _label(function, function.beta_total)
            second.plot(
                im,
                function.probability(im, total=True),
                **line_style(i),
                linewidth=1.8,
                label=label,
            )
        second.set(xlim=(0.0, end), ylim=(-0.01, 1.01), xlabel=_im_label(functions[0]))
        add_gravity_axis(second, functions[0].unit, horizontal=True)
        _name_functions(
            second, functions, rf"with $\beta_{{model}}$ = {functions[0].modeling_dispersion:.2g}"
        )
        if stacked:
            second.set_ylabel(first.get_ylabel())
    elif cloud is None:
        draw_functions(figure.subplots(), functions)
    else:
        left, right = figure.subplots(1, 2)
        _draw_cloud(left, cloud, functions)
        draw_functions(right, functions)
    function = functions[0]
    title = _NAMES[function.fit]
    censored = {function.censored for function in functions}
    if function.fit == "ida":
        title += ", maximum likelihood" if any(censored) else ", method of moments"
    number = function.motions if function.fit == "stripes" else function.runs
    title += f"\n{pluralize(number, 'run' if function.fit == 'cloud' else 'record')}"
    if any(censored):
        # The number of censored observations can differ between the functions.
        title += f", {'up to ' * (len(censored) > 1)}{max(censored)} censored"
    return titled(figure, title)


def types_picture(functions: Sequence[Fragility]) -> Figure:
    """Plot fragility functions of building types, with a panel per type and a curve per state."""
    types = {
        name: [function for function in functions if function.type == name]
        for name in dict.fromkeys(f.type for f in functions)
    }
    states = list(
        dict.fromkeys(
            function.state
            for function in sorted(functions, key=lambda function: function.threshold)
        )
    )
    columns = min(len(types), _TYPES_PER_ROW)
    rows = math.ceil(len(types) / columns)
    size = (max(2.5 * columns, 5.0) + 0.6, 2.0 * rows + 1.3)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axes in grid.flat[len(types) :]:
        axes.set_visible(False)
    # With a common intensity measure, only the lowest panels have a label.
    has_common_measure = len({function.im for function in functions}) == 1
    for index, (axes, name) in enumerate(zip(grid.flat, types, strict=False)):
        _draw_type(axes, types[name], states)
        axes.set_title(name, fontsize="medium")
        if index % columns == 0:
            axes.set_ylabel("probability")
        if not has_common_measure or index >= len(types) - columns:
            axes.set_xlabel(_im_label(types[name][0]))
    lines = [axes.plot([], [], **line_style(i), linewidth=1.8)[0] for i in range(len(states))]
    figure.legend(
        lines, states, loc="outside lower center", ncols=legend_columns(states, 5), handlelength=3.2
    )
    return titled(
        figure,
        "Probability of damage states and observed fractions, 95 % confidence over the motions",
    )


def _draw_type(axes: Any, functions: Sequence[Fragility], states: Sequence[str]) -> None:
    """Plot the fragility functions of a building type with observations and confidence bands. The
    position of a state in `states` determines the style of its curve."""
    end = _axis_end(functions)
    im = np.linspace(0.0, end, _POINTS)[1:]
    for function in functions:
        i = states.index(function.state)
        style = line_style(i)
        _draw_band(axes, function, im, style, alpha=0.08, linewidth=0.4)
        axes.plot(
            im,
            function.probability(im, total=function.modeling_dispersion > 0.0),
            linewidth=1.6,
            **style,
        )
        _draw_counted(
            axes,
            function,
            end,
            color=style["color"],
            marker=MARKERS[i % len(MARKERS)],
            markersize=3.5,
        )
    axes.set(xlim=(0.0, end), ylim=(-0.01, 1.01))


def draw_functions(axes: Any, functions: Sequence[Fragility], *, total: bool = True) -> None:
    """Plot fragility functions of the same intensity measure with observations and confidence
    bands, and with dotted lines that include the modeling dispersion if `total`."""
    end = _axis_end(functions)
    im = np.linspace(0.0, end, _POINTS)[1:]
    for i, function in enumerate(functions):
        plot_style = line_style(i)
        color = plot_style["color"]
        _draw_band(
            axes,
            function,
            im,
            plot_style,
            alpha=0.18 if len(functions) == 1 else 0.08,
            linewidth=0.5,
        )
        axes.plot(im, function.probability(im), **plot_style, linewidth=1.8, label=_label(function))
        if function.modeling_dispersion and total:
            probability = function.probability(im, total=True)
            label = rf"with $\beta_{{model}}$: {function.beta_total:.2f}"
            axes.plot(im, probability, color=color, linestyle=":", linewidth=1.2, label=label)
        _draw_counted(
            axes, function, end, color=color, marker=MARKERS[i % len(MARKERS)], markersize=4.5
        )
    if any(np.isfinite(function.covariance).all() for function in functions):
        axes.fill_between([], [], [], color="0.5", alpha=0.25, label="95 % confidence")
    axes.set(
        xlim=(0.0, end),
        ylim=(-0.01, 1.01),
        xlabel=_im_label(functions[0]),
        ylabel="probability of exceedance",
    )
    add_gravity_axis(axes, functions[0].unit, horizontal=True)
    _name_functions(axes, functions)


def _draw_band(
    axes: Any,
    function: Fragility,
    im: Array,
    plot_style: dict[str, Any],
    alpha: float,
    linewidth: float,
) -> None:
    """Plot the confidence band of a fragility function, unless its covariance is unknown."""
    if np.isfinite(function.covariance).all():
        low, high = function.band(im)
        axes.fill_between(im, low, high, color=plot_style["color"], alpha=alpha, linewidth=0.0)
        for edge in (low, high):
            axes.plot(im, edge, **plot_style, linewidth=linewidth)


def _name_functions(axes: Any, functions: Sequence[Fragility], which: str = "") -> None:
    """Add the legend of the fragility functions to a panel. The first line of its title is `which`.

    "exceedance of" is omitted for functions without a threshold of the demand.
    """
    exceeded = "" if math.isnan(functions[0].threshold) else "exceedance of"
    title = "\n".join(filter(None, (which, exceeded))) or None
    axes.legend(
        loc="lower right",
        frameon=True,
        framealpha=0.85,
        edgecolor="none",
        title=title,
        alignment="left",
    )


def _draw_counted(axes: Any, function: Fragility, end: float, **plot_style: Any) -> None:
    """Plot the observed fractions to which a fragility function was fitted, up to the intensity
    `end`.

    They are the fractions at intensity levels, the cumulative distribution of capacities, or the
    fractions of the runs of a cloud in bins of the intensity.
    """
    points, counted = function.points, function.counted
    if points is None and counted is not None:
        points = Points(counted.im, counted.fraction)
    if points is not None:
        shown = points.im <= end
        axes.plot(
            points.im[shown],
            points.fraction[shown],
            linestyle="none",
            markerfacecolor="white",
            zorder=4,
            **plot_style,
        )


def _axis_end(functions: Sequence[Fragility]) -> float:
    """Return the end of the intensity axis of fragility functions: the largest intensity where a
    probability is nearly 1, but for each function at most two times the maximum observed intensity,
    or two times the median if the median is larger.
    """
    ends = []
    for function in functions:
        observed = function.points or function.cloud
        curve_end = function.theta * math.exp(_END_DEVIATIONS * function.beta)
        max_observed = float(np.max(observed.im)) if observed and observed.im.size else curve_end
        ends.append(min(curve_end, 2.0 * max(max_observed, function.theta)))
    return max(ends)


def _draw_cloud(axes: Any, cloud: CloudPoints, functions: Sequence[Fragility]) -> None:
    """Plot the runs of a cloud analysis and their regression line on logarithmic axes.

    Dashed lines have a distance of a standard deviation of the residuals from the regression line.
    Horizontal lines mark the thresholds of `functions`.
    """
    measured = ~(cloud.censored | cloud.below)
    axes.scatter(
        cloud.im[measured],
        cloud.edp[measured],
        s=14,
        facecolor=GRAY,
        edgecolor="0.45",
        linewidth=0.5,
        label="runs",
    )
    hollow = {"s": 22, "facecolor": "white", "edgecolor": "0.35", "linewidth": 0.8}
    for limited, marker, label in (
        (cloud.censored, "^", "above the limit"),
        (cloud.below, "v", "below the lightest state"),
    ):
        if limited.any():
            axes.scatter(
                cloud.im[limited], cloud.edp[limited], marker=marker, label=label, **hollow
            )
    im = np.geomspace(np.min(cloud.im), np.max(cloud.im), 50)
    line = np.exp(cloud.intercept) * im**cloud.slope
    axes.plot(im, line, color=COLORS[0], linewidth=1.8, label=f"slope {cloud.slope:.3g}")
    for factor in (math.exp(-cloud.sigma), math.exp(cloud.sigma)):
        last = axes.plot(im, factor * line, color=COLORS[0], linestyle=DASHES[1])[0]
    last.set_label(rf"$\pm\sigma$ = {cloud.sigma:.3g}")
    for i, function in enumerate(functions):
        axes.axhline(function.threshold, **line_style(i), linewidth=0.9)
    plain_logarithmic(axes)
    edges = [*cloud.edp.tolist(), *(function.threshold for function in functions)]
    axes.set(
        ylim=(min(edges) / 1.6, 1.6 * max(edges)), xlabel=_im_label(functions[0]), ylabel="demand"
    )
    axes.legend(loc="lower right", frameon=True, framealpha=0.85, edgecolor="none")


def _im_label(function: Fragility) -> str:
    """Return the label of the intensity axis: the measure and its unit."""
    return measure_label(function.im, function.unit)


def _label(function: Fragility, beta_total: float | None = None) -> str:
    """Return the legend entry of a fragility function: demand threshold, initial damage if known,
    median theta and dispersion beta, or `beta_total`, which includes the modeling dispersion.

    The initial damage is the drift ratio that a previous earthquake has caused, in percent.
    """
    threshold = f"{function.threshold_text}: " if function.threshold_text else ""
    if not math.isnan(function.damage):
        state = f"damaged to {100.0 * function.damage:g} %" if function.damage else "intact"
        threshold += f"{state}, "
    beta = (
        rf"$\beta$ = {function.beta:.2f}"
        if beta_total is None
        else rf"$\beta_{{total}}$ = {beta_total:.2f}"
    )
    return rf"{threshold}$\theta$ = {function.theta:.3g}, {beta}"
