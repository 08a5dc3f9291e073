"""Figures of fragility functions with observations and 95 % confidence bands, and of cloud
analyses with regression lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.arrays import Array
from tdint.number_parsing import pluralize
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    LIGHT,
    MARKERS,
    add_legend,
    line_style,
    minor_ticks,
    new_panels,
    plain_logarithmic,
    plain_numbers,
    titled,
)
from tdint.studies.fragility.fragility_function import CloudPoints, Fragility, Points
from tdint.studies.fragility.hazard import HazardCurve
from tdint.studies.motions import scaling_figures
from tdint.units import OutputUnits

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


def in_figure_units(functions: Sequence[Fragility], units: OutputUnits) -> list[Fragility]:
    """Return functions with their accelerations in g, unless another unit was requested."""
    return [
        function.in_units(units.in_figures) if function.unit == "m/s^2" else function
        for function in functions
    ]


def fragility_picture(functions: Sequence[Fragility], hazard: HazardCurve | None = None) -> Figure:
    """Plot fragility functions of the same fit and intensity measure with their observations and
    confidence bands.

    A cloud analysis has a second panel with its regression. A hazard curve has two further panels:
    its rates, and the contributions of intensities to the annual frequencies. If more than
    `_MAX_IN_PANEL` functions have a modeling dispersion, the functions with this dispersion have a
    separate panel.
    """
    cloud = functions[0].cloud
    crowded = (
        cloud is None
        and len(functions) > _MAX_IN_PANEL
        and any(function.modeling_dispersion for function in functions)
    )
    has_two = bool(cloud) or crowded
    rows = [(4.6, (1,) * (1 + has_two)), *([(3.0, (1, 1))] if hazard else [])]
    figure, (panels, *below) = new_panels(
        9.2 if has_two else 6.8, *rows, share="y" * (crowded and not hazard)
    )
    if hazard:
        _draw_hazard(below[0], functions, hazard)
    if crowded:
        draw_functions(panels[0], functions, total=False)
        draw_functions(panels[1], functions, fitted=False)
    else:
        draw_functions(panels[-1], functions)
    if cloud:
        _draw_cloud(panels[0], cloud, functions)
    function = functions[0]
    title = _NAMES[function.fit]
    censored = {function.censored for function in functions}
    if function.fit == "ida":
        title += ", maximum likelihood" if any(censored) else ", method of moments"
    number = function.motions if function.fit == "stripes" else function.runs
    # A pair of components is one ground motion, as in the table of `tdint ida`.
    title += f"\n{pluralize(number, 'run' if function.fit == 'cloud' else 'ground motion')}"
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
    height = 2.0 * math.ceil(len(types) / _TYPES_PER_ROW) + 1.3
    figure, (panels,) = new_panels(
        max(2.5 * min(len(types), _TYPES_PER_ROW), 5.0) + 0.6,
        (height, (1,) * len(types)),
        share="y",
        columns=_TYPES_PER_ROW,
    )
    # With a common intensity measure, only the lowest panels have a label.
    has_common_measure = len({function.im for function in functions}) == 1
    for axes, name in zip(panels, types, strict=True):
        _draw_type(axes, types[name], states)
        axes.set_title(name, fontsize="medium")
        place = axes.get_subplotspec()
        if place.is_first_col():
            axes.set_ylabel("probability")
        if not has_common_measure or place.is_last_row():
            axes.set_xlabel(_im_label(types[name][0]))
    lines = [axes.plot([], [], **line_style(i), linewidth=1.8)[0] for i in range(len(states))]
    add_legend(figure, lines, states)
    has_band = any(function.has_band for function in functions)
    bands = ", 95 % confidence over the motions" if has_band else ""
    return titled(figure, f"Probability of damage states and observed fractions{bands}")


def _draw_type(axes: Any, functions: Sequence[Fragility], states: Sequence[str]) -> None:
    """Plot the fragility functions of a building type with observations and confidence bands. The
    position of a state in `states` determines the style of its curve."""
    im = _intensities(axes, functions)
    for function in functions:
        total = function.modeling_dispersion > 0.0
        _draw_function(
            axes, function, im, states.index(function.state), (0.4, 1.6, 3.5), total=total
        )


def draw_functions(
    axes: Any, functions: Sequence[Fragility], *, fitted: bool = True, total: bool = True
) -> None:
    """Plot fragility functions of the same intensity measure with observations and confidence
    bands, and with dotted lines that include the modeling dispersion if `total`. Without `fitted`,
    plot only curves that include the modeling dispersion."""
    im = _intensities(axes, functions)
    for i, function in enumerate(functions):
        style = line_style(i)
        if not fitted:
            label = _label(function, function.beta_total)
            probability = function.probability(im, total=True)
            axes.plot(im, probability, **style, linewidth=1.8, label=label)
            continue
        # The areas of more functions would merge; their bands have only edges.
        alpha = (0.18, 0.08)[len(functions) - 1] if len(functions) <= _MAX_IN_PANEL else 0.0
        _draw_function(axes, function, im, i, (0.5, 1.8, 4.5), alpha=alpha, label=_label(function))
        if function.modeling_dispersion and total:
            probability = function.probability(im, total=True)
            label = rf"with $\beta_{{model}}$: {function.beta_total:.2f}"
            axes.plot(
                im, probability, color=style["color"], linestyle=":", linewidth=1.2, label=label
            )
    which = rf"with $\beta_{{model}}$ = {functions[0].modeling_dispersion:.2g}"
    if fitted and any(function.has_band for function in functions):
        if len(functions) <= _MAX_IN_PANEL:
            axes.fill_between([], [], [], color="0.5", alpha=0.25, label="95 % confidence")
        else:
            axes.plot([], [], color="0.5", linewidth=0.5, label="95 % confidence")
    exceeded = ""
    if not math.isnan(functions[0].threshold):
        exceeded = " of the drift ratio" if functions[0].is_drift_ratio else " of the threshold"
    axes.set(xlabel=_im_label(functions[0]), ylabel=f"probability of exceedance{exceeded}")
    axes.set_title("" if fitted else which)


def _draw_function(
    axes: Any,
    function: Fragility,
    im: Array,
    i: int,
    sizes: tuple[float, float, float],
    *,
    total: bool = False,
    alpha: float = 0.08,
    label: str | None = None,
) -> None:
    """Plot a fragility function with the style number `i`, its confidence band, unless its
    covariance is unknown, and the observed fractions.

    These are the fractions at intensity levels, the cumulative distribution of capacities, or the
    fractions of the runs of a cloud in bins of the intensity. `sizes` contains the line widths of
    the edges of the band and of the curve, and the size of markers.
    """
    edge_width, width, marker_size = sizes
    style = line_style(i)
    if function.has_band:
        low, high = function.band(im)
        if alpha:
            axes.fill_between(im, low, high, color=style["color"], alpha=alpha, linewidth=0.0)
        for edge in (low, high):
            axes.plot(im, edge, **style, linewidth=edge_width)
    probability = function.probability(im, total=total)
    axes.plot(im, probability, **style, linewidth=width, label=label)
    points, counted = function.points, function.counted
    if points is None and counted is not None:
        points = Points(counted.im, counted.fraction)
    if points is not None:
        shown = points.im <= im[-1]
        axes.plot(
            points.im[shown],
            points.fraction[shown],
            linestyle="none",
            markerfacecolor="white",
            zorder=4,
            color=style["color"],
            marker=MARKERS[i % len(MARKERS)],
            markersize=marker_size,
        )


def _intensities(axes: Any, functions: Sequence[Fragility]) -> Array:
    """Set the limits of the axes of fragility functions, and return the intensities of the curves.

    The axis ends at the largest intensity where a probability is nearly 1, but for each function at
    most two times the maximum observed intensity, or two times the median if the median is larger.
    """
    ends = []
    for function in functions:
        observed = function.points or function.cloud
        curve_end = function.theta * math.exp(_END_DEVIATIONS * function.beta)
        max_observed = float(np.max(observed.im)) if observed and observed.im.size else curve_end
        ends.append(min(curve_end, 2.0 * max(max_observed, function.theta)))
    axes.set(xlim=(0.0, max(ends)), ylim=(-0.01, 1.01))
    return np.linspace(0.0, max(ends), _POINTS)[1:]


def _draw_hazard(panels: Sequence[Any], functions: Sequence[Fragility], curve: HazardCurve) -> None:
    """Plot the rates of a hazard curve, and the disaggregation of the annual frequency of each
    function: the density of its contributions F |dH| over ln s, divided by the frequency."""
    rates, density = panels
    curve = curve.in_unit(functions[0])
    im = np.geomspace(curve.im[0], curve.im[-1], _POINTS)
    rates.plot(curve.im, curve.rate, "o", color=COLORS[0], markersize=3.0)
    rates.plot(im, curve.rates(im), color=COLORS[0])
    rates.set(ylabel="annual rate of exceedance (1/year)")
    middle, steps = np.sqrt(im[1:] * im[:-1]), -np.diff(curve.rates(im)) / np.diff(np.log(im))
    for i, function in enumerate(functions):
        if function.risk:
            share = function.probability(middle) * steps / function.risk.annual_frequency
            density.plot(middle, share, **line_style(i))
            density.axvline(function.risk.contributing_im, color=LIGHT, linewidth=0.8)
    density.set(ylim=(0.0, None), ylabel="density of contributions to\nthe annual frequency")
    rates.set(yscale="log")
    for axes in panels:
        axes.set(xscale="log", xlabel=_im_label(functions[0]))
        plain_numbers(axes.xaxis)
        minor_ticks(axes.xaxis)


def _draw_cloud(axes: Any, cloud: CloudPoints, functions: Sequence[Fragility]) -> None:
    """Plot the runs of a cloud analysis and their regression line on logarithmic axes.

    Dashed lines have a distance of a standard deviation of the residuals from the regression line.
    Horizontal lines mark the thresholds of `functions`.
    """
    measured = ~cloud.censored
    axes.scatter(
        cloud.im[measured],
        cloud.edp[measured],
        s=14,
        facecolor=scaling_figures.GRAY,
        edgecolor="0.45",
        linewidth=0.5,
        label="runs",
    )
    hollow = {"s": 22, "facecolor": "white", "edgecolor": "0.35", "linewidth": 0.8}
    if (limited := cloud.censored).any():
        axes.scatter(
            cloud.im[limited], cloud.edp[limited], marker="^", label="above the limit", **hollow
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


def _im_label(function: Fragility) -> str:
    """Return the label of the intensity axis: the measure and its unit."""
    return scaling_figures.measure_label(function.im, function.unit)


def _label(function: Fragility, beta_total: float | None = None) -> str:
    """Return the legend entry of a fragility function: demand threshold, initial damage if known,
    median theta and dispersion beta, or `beta_total`, which includes the modeling dispersion.

    The initial damage is the drift ratio that a previous earthquake has caused, in percent.
    """
    threshold = f"{function.threshold_text}: " if function.threshold_text else ""
    if function.initial_damage:
        threshold += f"{function.initial_damage}, "
    beta = rf"$\beta$ = {function.beta:.2f}"
    if beta_total is not None:
        beta = rf"$\beta_{{total}}$ = {beta_total:.2f}"
    theta = f"{function.theta:.3g} {function.unit.replace('^2', '²')}".strip()
    return rf"{threshold}$\theta$ = {theta}, {beta}"
