"""Figures of spectra: elastic (over the period, tripartite, ADRS), inelastic, rotated and drift
spectra, comparisons with published spectra, and target spectra."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.fractiles import fractiles
from tdint.ground_motion.horizontals import is_vertical
from tdint.ground_motion.record import component_names, named_components
from tdint.number_parsing import pluralize
from tdint.output.figures.fractiles import BETWEEN_FRACTILES, draw_fractiles, draw_median
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    INK,
    LIGHT,
    FirstPeriods,
    Style,
    add_legend,
    changed,
    line_style,
    mark_first_periods,
    motion_name,
    new_axes,
    new_panels,
    plain_minor_numbers,
    plain_numbers,
    psa_label,
    record_name,
    record_names,
    titled,
)
from tdint.output.spectrum_text import spectrum_text
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.response.spectra.drift import DriftSpectrum
    from tdint.response.spectra.elastic import Spectrum
    from tdint.response.spectra.inelastic import InelasticSpectrum
    from tdint.response.spectra.rotated import RotatedSpectrum
    from tdint.response.spectra.target import SpectrumDifference, TargetSpectrum


# ---- This part contains functions that all figures over the period use: lines of components, or
# fractiles of a suite. It also contains the figures of elastic spectra on other axes: tripartite,
# and acceleration over displacement (ADRS).

_MIN_UNMARKED_PERIODS = 8  # lines with fewer periods have a marker at each period
_MIN_SUITE = 7  # minimum number of ground motions for median and fractiles
GRAY = "0.75"
"""Color of the line of a single ground motion in a suite."""

_MINOR_GRID = "0.94"  # gray of the grid at minor ticks

_SCALE = "0.82"  # gray of the diagonal lines and rays that are scales of a further quantity
_PERIODS = (0.2, 0.5, 1.0, 2.0, 4.0)  # s; periods of the rays of an ADRS figure
_LABEL_RANGE = 0.85  # fraction of the axes that contains the labels of scales
_MIN_DISTANCE = 0.09  # minimum distance of labels as a fraction of the axes


Panel = tuple[str, Callable[[Any], Array]]
"""Label of the values, and function that returns the values of a line, shape (k,)."""


def draw_over_periods(
    results: Sequence[Any],
    panels: Sequence[Panel],
    labels: Sequence[str],
    variants: Sequence[Hashable] | None = None,
    *,
    columns: Sequence[str] | None = None,
) -> Figure:
    """Plot results over the period in two panels above each other, without a title.

    Each result has a line. Many ground motions are plotted as a suite: gray lines, with median and
    fractiles of each variant. A panel is its label and the function that returns the values of a
    result. `variants` distinguishes lines of the same component; by default it is the damping
    ratio. `columns` contains the title of the column of panels for each result; by default
    there is a single column without title.
    """
    variants = [result.damping for result in results] if variants is None else variants
    suite = is_suite(results)
    titles = list(dict.fromkeys(columns)) if columns is not None and not suite else [""]
    # With several columns, the components of a quantity have a common axis.
    heights = (4.3, 3.5)
    rows: list[Any]
    figure, rows = new_panels(
        7.5, *((height, (1,) * len(titles)) for height in heights), share="xy"
    )
    lines: dict[str, Any] = {}
    if suite:
        lines = _draw_suite([row[0] for row in rows], results, panels, variants)
    else:
        # Lines are distinguishable without color: dashes differ by component, or by variant if
        # there are several variants.
        motions = _motions(results)
        motion_index = {motion: i for i, motion in enumerate(dict.fromkeys(motions))}
        variant_index = {variant: i for i, variant in enumerate(dict.fromkeys(variants))}
        has_columns = len(titles) > 1
        column_titles = columns if columns is not None else [titles[0]] * len(results)
        for result, title, label, motion, variant in zip(
            results, column_titles, labels, motions, variants, strict=True
        ):
            by_variant = len(variant_index) > 1 or has_columns
            dash = variant_index[variant] if by_variant else motion_index[motion]
            # Colors differ by component, unless each component has a separate column of panels.
            by_motion = len(motion_index) > 1 and not has_columns
            color = motion_index[motion] if by_motion else dash
            indices = _positive_periods(result.periods)
            periods = result.periods[indices]
            style = line_style(color, dash)
            if periods.size < _MIN_UNMARKED_PERIODS:
                style |= {"marker": "o", "markersize": 4}
            for axes, (_, values) in zip(rows, panels, strict=True):
                (lines[label],) = axes[titles.index(title)].plot(
                    periods, values(result)[indices], **style
                )
    for row, (label, _) in zip(rows, panels, strict=True):
        row[0].set(ylabel=label, ylim=(0.0, None))
    for axes, title in zip(rows[0], titles, strict=True):
        axes.set_title(title, parse_math=False)
    for axes in rows[-1]:
        axes.set_xlabel("period (s)")
    log_periods(rows[-1][0], np.concatenate([result.periods for result in results]))
    for panel in figure.axes:
        panel.grid(which="minor", axis="x", color=_MINOR_GRID, linewidth=0.5)
    # A single line has no legend, because the title contains its name.
    add_legend(figure, list(lines.values()), _distinct(list(lines)))
    return figure


def _distinct(labels: Sequence[str]) -> list[str]:
    """Return labels without the parts that are equal in all labels, such as the component."""
    parts = [label.split(", ") for label in labels]
    while min(map(len, parts)) > 1 and len({first for first, *_ in parts}) == 1:
        parts = [others for _, *others in parts]
    return [", ".join(others) for others in parts]


def _motions(results: Sequence[Any]) -> list[tuple[str, str]]:
    """Return the file of the record and the name of the component of each result."""
    return named_components([result.record for result in results])


def is_suite(results: Sequence[Any]) -> bool:
    """Return True if results are plotted as a suite, with median and fractiles.

    This requires at least `_MIN_SUITE` ground motions and equal periods of all results.
    """
    if len(set(_motions(results))) < _MIN_SUITE:
        return False
    return all(np.array_equal(result.periods, results[0].periods) for result in results)


def in_median(results: Sequence[Any]) -> list[bool]:
    """Return a list with True for each result that the median of a suite includes.

    Vertical components are excluded if there are horizontal components.
    """
    is_horizontal = [not is_vertical(result.record.component) for result in results]
    return is_horizontal if any(is_horizontal) else [True] * len(is_horizontal)


def _draw_suite(
    column: Any, results: Sequence[Any], panels: Sequence[Panel], variants: Sequence[Hashable]
) -> dict[str, Any]:
    """Plot the lines of all results in gray, with median and fractiles of each variant."""
    indices = _positive_periods(results[0].periods)
    periods = results[0].periods[indices]
    distinct_variants = list(dict.fromkeys(variants))
    lines: dict[str, Any] = {}
    is_in_median = np.array(in_median(results))
    # Lines that the median omits are dotted.
    omitted = "" if is_in_median.all() else " without verticals"
    groups = (is_in_median, "-", "components"), (~is_in_median, ":", "vertical components")
    motions = np.array([" ".join(motion) for motion in _motions(results)])
    for axes, (_, values) in zip(column, panels, strict=True):
        rows = np.array([values(result)[indices] for result in results])
        for group, dashes, noun in groups:
            if group.any():
                style = {"color": GRAY, "linewidth": 0.8, "linestyle": dashes, "zorder": 1.5}
                label = f"{len(set(motions[group]))} {noun}"
                lines.setdefault(label, axes.plot(periods, rows[group].T, **style)[0])
        for i, variant in enumerate(distinct_variants):
            is_variant = np.array([other == variant for other in variants])
            selected = rows[is_variant & is_in_median]
            color = COLORS[i % len(COLORS)]
            name = f", {_variant_text(variant)}" if len(distinct_variants) > 1 else ""
            median = draw_median(axes, periods, selected, color)
            lines.setdefault(f"median{omitted}{name}", median)
            fractiles = draw_fractiles(axes, periods, selected, color)
            lines.setdefault(f"{BETWEEN_FRACTILES}{name}", fractiles)
    return lines


def _variant_text(variant: Hashable) -> str:
    """Return the label of a variant: a damping ratio in percent, such as `5 %`, or the items of a
    tuple separated by commas, such as `5 %, ductility 2`."""
    items = variant if isinstance(variant, tuple) else (variant,)
    return ", ".join(
        f"{100.0 * item:g} %" if isinstance(item, float) else str(item) for item in items
    )


def _positive_periods(periods: Array) -> NDArray[np.intp]:
    """Return the indices of the positive periods in increasing order, for a logarithmic axis.

    If no period is positive, the indices of all periods are returned.
    """
    order = np.argsort(periods, kind="stable")
    positive = order[periods[order] > 0.0]
    return positive if positive.size else order


def log_periods(axes: Any, periods: Array) -> None:
    """Make the x axis logarithmic, from the shortest positive period to the longest period, s.

    Without a positive period, the axis does not change. Over about a decade, all ticks are labeled.
    """
    shown = periods[_positive_periods(periods)]
    low, high = float(np.min(shown)), float(np.max(shown))
    if not low > 0.0:
        return
    axes.set_xscale("log")
    if low < high:
        axes.set_xlim(low, high)
    plain_numbers(axes.xaxis)
    plain_minor_numbers(axes.xaxis, every=high < 12.0 * low)


def line_labels(results: Sequence[Any]) -> list[str]:
    """Return the label of each line over the period.

    It consists of the file of the record (with several files), the component, and the damping ratio
    (with several ratios).
    """
    names = component_names([result.record for result in results])
    files = record_names(result.record.source for result in results)
    several_files = len(files) > 1
    several_ratios = len({result.damping for result in results}) > 1
    labels = []
    for result, name in zip(results, names, strict=True):
        file = files[result.record.source] if several_files or not name else ""
        ratio = f"{100.0 * result.damping:g} %" if several_ratios else ""
        labels.append(", ".join(filter(None, (file, name, ratio))))
    return labels


def over_periods_title(single_title: str, several: str, results: Sequence[Any], more: str) -> str:
    """Return the title of a figure over the period.

    The first line is `single_title` with the file and the component of a single result, or
    `several` with the file or the number of records. The second line contains the damping ratios
    and `more`.

    Parameters
    ----------
    single_title, several : str
        Names of the quantity in the singular and in the plural.
    more : str
        Further conditions, such as the method of solution.
    """
    sources = list(dict.fromkeys(result.record.source for result in results))
    ratios = list(dict.fromkeys(result.damping for result in results))
    subject = record_name(sources[0]) if len(sources) == 1 else f"{len(sources)} records"
    subject += changed(result.record for result in results)
    damping = ", ".join(f"{100.0 * ratio:g} %" for ratio in ratios)
    if len(set(_motions(results))) == 1:
        subject = motion_name(results[0].record) + changed([results[0].record])
    title = single_title if len(results) == 1 else several
    return f"{title} of {subject}\n{damping} damping, {more}"


_Curve = tuple["Spectrum", str, Style]
"""Line with its label (may be empty) and its style."""


def _curves(spectra: Sequence[Spectrum], labels: Sequence[str]) -> list[_Curve]:
    """Return the lines of a figure as tuples of a spectrum, a label and a line style.

    There is a line per spectrum. A suite has gray lines, and a median for each damping ratio.
    """
    if not is_suite(spectra):
        plot_styles = (line_style(i) | {"zorder": 3} for i in range(len(spectra)))
        return list(zip(spectra, labels, plot_styles, strict=True))
    gray = {"color": GRAY, "linewidth": 0.6, "zorder": 1.5}
    curves = [
        (spectrum, "single components" if i == 0 else "", gray)
        for i, spectrum in enumerate(spectra)
    ]
    ratios = dict.fromkeys(spectrum.damping for spectrum in spectra)
    for i, ratio in enumerate(ratios):
        selected = [
            spectrum
            for spectrum, is_included in zip(spectra, in_median(spectra), strict=True)
            if is_included and spectrum.damping == ratio
        ]
        medians = {
            quantity: fractiles(
                np.array([getattr(spectrum, quantity) for spectrum in selected]), (0.5,)
            )[0]
            for quantity in ("sd", "psv", "psa")
        }
        label = f"median of {len(selected)}"
        if len(ratios) > 1:
            label += f", {100.0 * ratio:g} %"
        style = line_style(i) | {"zorder": 3, "linewidth": 2.0}
        curves.append((replace(spectra[0], **medians), label, style))
    return curves


def _positive(spectrum: Spectrum) -> NDArray[np.intp]:
    """Return the indices of periods with a point on logarithmic axes, by increasing period.

    A period has a point if the period and its spectral displacement are positive.
    """
    order = np.argsort(spectrum.periods, kind="stable")
    return order[(spectrum.periods[order] > 0.0) & (spectrum.sd[order] > 0.0)]


def draw_tripartite(
    spectra: Sequence[Spectrum], labels: Sequence[str], units: OutputUnits
) -> Figure:
    """Plot tripartite spectra: pseudo-velocity over period on logarithmic axes.

    Displacement and pseudo-acceleration are scales along diagonal lines.
    """
    figure, axes = new_axes(7.5, 6.2)
    curves = _curves(spectra, labels)
    for curve, label, style in curves:
        indices = _positive(curve)
        psv = units.of(curve.psv[indices], "m/s")
        axes.plot(curve.periods[indices], psv, label=label, **style)
    log_periods(axes, np.concatenate([spectrum.periods for spectrum in spectra]))
    axes.set(xlabel="period (s)", ylabel=f"pseudo-velocity PSV ({units.label('m/s')})")
    values = units.of(np.concatenate([curve.psv[_positive(curve)] for curve, *_ in curves]), "m/s")
    if values.size:
        axes.set_yscale("log")
        low, high = float(np.min(values)), float(np.max(values))
        axes.set_ylim(max(low / 1.5, high / 3e3), 1.8 * high)
        plain_numbers(axes.yaxis)
        axes.yaxis.set_minor_formatter(NullFormatter())
        # With omega = 2 pi / T, the pseudo-velocity of a constant displacement is omega SD, which
        # decreases with the period. That of a constant pseudo-acceleration, PSA / omega, increases.
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        ends = np.array([left, right])
        omega = 2.0 * math.pi / ends
        # `velocity` is the pseudo-velocity of a displacement of 1 m, or of an acceleration of
        # 1 m/s^2.
        for si, velocity in (("m", omega), ("m/s^2", 1.0 / omega)):
            unit, unit_line = units.label(si), units.of(units.unit(si)[1] * velocity, "m/s")
            smallest = bottom / float(np.max(unit_line))
            largest = top / float(np.min(unit_line))
            first, last = math.floor(math.log10(smallest)), math.ceil(math.log10(largest))
            for decade in range(first, last + 1):
                value = 10.0**decade
                axes.plot(ends, value * unit_line, color=_SCALE, linewidth=0.8, zorder=1.2)
                _label_scale(axes, ends, value * unit_line, f"{value:g} {unit}", (bottom, top))
        axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.grid(which="minor", color="0.95", linewidth=0.5)
    return figure


def _label_scale(
    axes: Any, ends: Array, velocities: Array, text: str, limits: tuple[float, float]
) -> None:
    """Write the value of a line of a scale along the line, near the end at the top or at the side.
    The position avoids existing labels, for units where values 1 and 10 of two scales meet near
    the top. A label without a free position is omitted.
    """
    x, y = np.log(ends), np.log(velocities)
    bottom, top = np.log(limits)
    height = top - bottom
    # At this fraction of its length, the line reaches the height of the labels. The limits keep the
    # label away from the sides of the panel.
    fraction = (bottom + _LABEL_RANGE * height - y[0]) / (y[1] - y[0])
    fraction = min(max(float(fraction), 1.0 - _LABEL_RANGE), _LABEL_RANGE)
    min_distance = _MIN_DISTANCE * np.array([x[1] - x[0], height])
    labels = [np.log(other.get_position()) for other in axes.texts]
    for step in range(3):
        shifted = fraction - step * _MIN_DISTANCE
        position = np.array([x[0] + shifted * (x[1] - x[0]), y[0] + shifted * (y[1] - y[0])])
        is_covered = any(np.all(np.abs(position - label) < min_distance) for label in labels)
        if shifted > _MIN_DISTANCE and not is_covered:
            break
    else:
        return
    if not bottom + 0.04 * height < position[1] < bottom + (_LABEL_RANGE + 0.05) * height:
        return
    abscissa, ordinate = np.exp(position).tolist()
    axes.text(
        abscissa,
        ordinate,
        text,
        # The label is parallel to its line, whose direction on these axes is (x, y) or (x, -y).
        rotation=math.degrees(math.atan2(math.copysign(ordinate, y[1] - y[0]), abscissa)),
        transform_rotates_text=True,
        ha="center",
        va="center",
        fontsize=7.5,
        color=LIGHT,
        clip_on=True,
        zorder=1.8,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
    )


def draw_adrs(spectra: Sequence[Spectrum], labels: Sequence[str], units: OutputUnits) -> Figure:
    """Plot pseudo-acceleration over displacement (ADRS); rays from the origin mark periods."""
    figure, axes = new_axes(7.0, 6.4)
    curves = _curves(spectra, labels)
    for curve, label, style in curves:
        order = np.argsort(curve.periods, kind="stable")
        values = units.of(curve.sd[order], "m"), units.of(curve.psa[order], "m/s^2")
        axes.plot(*values, label=label, **style)
    axes.set(xlim=(0.0, None), ylim=(0.0, None))
    axes.margins(0.05)
    right, top = axes.get_xlim()[1], axes.get_ylim()[1]
    last = -right  # abscissa of the last label
    for period in _PERIODS:
        # The slope of a ray is the pseudo-acceleration of a unit displacement, omega^2.
        slope = units.of(units.unit("m")[1] * (2.0 * math.pi / period) ** 2, "m/s^2")
        end = min(right, top / slope)
        axes.plot([0.0, end], [0.0, slope * end], color=_SCALE, linewidth=0.8, zorder=1.2)
        # A ray ends at the right side or at the top of the panel, with its label outside.
        if end == right:
            offset, horizontal, vertical = (2, 0), "left", "center"
        else:
            offset, horizontal, vertical = (0, 2), "center", "bottom"
        if end < right and end - last < _MIN_DISTANCE * right:
            continue
        last = end
        axes.annotate(
            f"{period:g} s",
            (end, slope * end),
            xytext=offset,
            textcoords="offset points",
            ha=horizontal,
            va=vertical,
            fontsize=7.5,
            color=LIGHT,
            annotation_clip=False,
        )
    axes.set(xlim=(0.0, right), ylim=(0.0, top), xlabel=f"displacement SD ({units.label('m')})")
    axes.set_ylabel(psa_label(units))
    return figure


# ---- Spectrum curves

_MAX_COLUMNS = 4  # maximum number of components with separate panels
_NAMES = {
    "sd": ("displacement SD", "m"),
    "psv": ("pseudo-velocity PSV", "m/s"),
    "psa": ("pseudo-acceleration PSA", "m/s^2"),
    "sv": ("velocity SV", "m/s"),
    "sa": ("absolute acceleration SA", "m/s^2"),
}
"""Label and SI unit of each spectral quantity."""

_TARGET: Style = {"color": "0.1", "linewidth": 2.2, "zorder": 6}
_POINTS: Style = {"color": "0.25", "markersize": 3.0, "markerfacecolor": "none"}


def spectrum_picture(
    spectra: Sequence[Spectrum],
    axes: str = "periods",
    units: OutputUnits = SI,
    target: TargetSpectrum | None = None,
) -> Figure:
    """Plot elastic response spectra: a line per component and damping ratio, or a suite.

    A suite has gray lines with median and fractiles (over the periods), or with the median.

    Parameters
    ----------
    spectra : sequence of Spectrum
        Spectra; at least one.
    axes : str
        A key of `DRAWN`: pseudo-acceleration and displacement over the `periods`, `tripartite`
        (pseudo-velocity over the period, with scales of the other two), or `adrs`
        (pseudo-acceleration over displacement).
    target : TargetSpectrum, optional
        Target spectrum, plotted if `axes` is `periods`.
    """
    units = units.in_figures
    figure = DRAWN[axes](spectra, _distinct(line_labels(spectra)), units)
    if target is not None:
        _add_target(figure, target, units)
    # The title states settings that differ from the defaults; only the exact solution has settings.
    solution = spectra[0].method
    if solution == "exact":
        solution = ", ".join(["exact solution", *_special_settings(spectra[0])])
    title = over_periods_title(
        "Elastic response spectrum", "Elastic response spectra", spectra, solution
    )
    return titled(figure, title)


def low_picture(
    spectra: Sequence[Spectrum], units: OutputUnits = SI, periods: FirstPeriods = ()
) -> Figure:
    """Plot pseudo-accelerations over the period in a figure of small height for reports.

    Many ground motions are gray lines, with their median and fractiles.

    Parameters
    ----------
    periods : sequence of (str, float)
        Names and first periods of buildings, s, which are marked; none by default.
    """
    figure, axes = new_axes(8.0, 2.5)
    units = units.in_figures
    if is_suite(spectra):
        panel = _elastic_panels(units)[0]
        lines = _draw_suite([axes], spectra, [panel], [spectrum.damping for spectrum in spectra])
        for label, line in lines.items():
            line.set_label(label)
        axes.set(ylim=(0.0, None), xlabel="period (s)", ylabel=panel[0])
        log_periods(axes, spectra[0].periods)
    else:
        draw_accelerations(axes, spectra, units)
    if len(spectra) >= _MIN_MEAN:
        mean = np.mean([units.of(spectrum.psa, "m/s^2") for spectrum in spectra], axis=0)
        style = {"color": INK, "linewidth": 2.0, "linestyle": DASHES[3], "zorder": 4}
        axes.plot(spectra[0].periods, mean, label="mean", **style)
    mark_first_periods(axes, periods)
    return figure


_MIN_MEAN = 3  # minimum number of spectra for their mean


def _elastic_panels(units: OutputUnits) -> list[Panel]:
    """Return the two panels of elastic spectra: pseudo-acceleration and displacement.

    A panel is a tuple of the label of its axis and a function that returns the values of a spectrum
    in the unit of the label.
    """
    return [
        (psa_label(units), lambda line: units.of(line.psa, "m/s^2")),
        (f"displacement SD ({units.label('m')})", lambda line: units.of(line.sd, "m")),
    ]


def draw_accelerations(axes: Any, spectra: Sequence[Spectrum], units: OutputUnits) -> None:
    """Plot pseudo-accelerations over the period in a panel, with a line per spectrum and a legend.

    The colors continue after the lines that the panel already contains.
    """
    for number, (spectrum, label) in enumerate(
        zip(spectra, line_labels(spectra), strict=True), len(axes.get_lines())
    ):
        axes.plot(
            spectrum.periods, units.of(spectrum.psa, "m/s^2"), label=label, **line_style(number)
        )
    log_periods(axes, np.concatenate([spectrum.periods for spectrum in spectra]))
    axes.set(ylim=(0.0, None), xlabel="period (s)", ylabel=psa_label(units))


DRAWN: dict[str, Callable[..., Figure]] = {
    "periods": lambda spectra, labels, units: draw_over_periods(
        spectra, _elastic_panels(units), labels
    ),
    "tripartite": draw_tripartite,
    "adrs": draw_adrs,
}
"""Functions that plot spectra, by the name of the axes."""


def _special_settings(spectrum: Spectrum | RotatedSpectrum) -> list[str]:
    """Return the settings of an exact solution that differ from the defaults, as texts for a title:
    determination of the maxima, interpolation of the ground motion."""
    settings = []
    if spectrum.maxima != "exact":
        settings.append(f"maxima: {spectrum.maxima}")
    if spectrum.interpolation != "linear":
        settings.append(f"{spectrum.interpolation} motion")
    return settings


def inelastic_picture(spectra: Sequence[InelasticSpectrum], units: OutputUnits = SI) -> Figure:
    """Plot inelastic spectra: a line per component, damping ratio, and ductility or strength.

    Parameters
    ----------
    spectra : sequence of InelasticSpectrum
        Spectra; at least one; all for ductilities or all for strengths.
    """
    panels: list[Panel] = [
        ("yield strength over weight", lambda spectrum: spectrum.yield_strength_ratio)
        if spectra[0].target is not None
        else ("ductility", lambda spectrum: spectrum.ductility),
        (f"maximum displacement ({units.label('m')})", lambda spectrum: units.of(spectrum.sd, "m")),
    ]
    # An inelastic spectrum is computed for a prescribed ductility, or for a prescribed strength,
    # which is the same at all periods or reduces the elastic force by the same factor.
    prescribed = [spectrum.prescribed for spectrum in spectra]
    has_several_values = len(set(prescribed)) > 1
    # A few components have separate columns of panels. The title of a column is the component, with
    # the file name if there are several files.
    files = record_names(spectrum.record.source for spectrum in spectra)
    names = component_names([spectrum.record for spectrum in spectra])
    components = [
        f"{files[spectrum.record.source]} {name}".rstrip() if len(files) > 1 else name
        for spectrum, name in zip(spectra, names, strict=True)
    ]
    has_columns = 1 < len(set(components)) <= _MAX_COLUMNS
    first_labels = line_labels(spectra)
    if has_columns:
        has_several_ratios = len({spectrum.damping for spectrum in spectra}) > 1
        first_labels = [
            f"{100.0 * spectrum.damping:g} %" if has_several_ratios else "" for spectrum in spectra
        ]
    labels = [
        ", ".join(filter(None, (label, value if has_several_values else "")))
        for label, value in zip(first_labels, prescribed, strict=True)
    ]
    # Lines of different components with the same damping ratio and prescribed value are variants of
    # each other: with a column per component, they have the same color and dashes.
    variants = [
        (spectrum.damping, value) for spectrum, value in zip(spectra, prescribed, strict=True)
    ]
    figure = draw_over_periods(
        spectra, panels, labels, variants, columns=components if has_columns else None
    )
    # Spectra for prescribed strengths (without a target ductility) show ductilities. These differ
    # by orders of magnitude, so that their axis is logarithmic. The line at 1 marks first yield.
    if spectra[0].target is None and any(np.any(spectrum.ductility > 0.0) for spectrum in spectra):
        upper = figure.axes[0]
        upper.set_yscale("log")
        upper.autoscale(axis="y")
        # The ductility panels of all columns share this axis, but not its lines.
        for axes in upper.get_shared_y_axes().get_siblings(upper):
            axes.axhline(1.0, color=LIGHT, linewidth=0.8)
        plain_numbers(upper.yaxis)
    prescribed_text = "" if has_several_values else f"{prescribed[0]}, "
    description = f"{prescribed_text}bilinear, hardening {spectra[0].hardening:g}"
    return titled(
        figure, over_periods_title("Inelastic spectrum", "Inelastic spectra", spectra, description)
    )


def rotated_picture(
    spectra: Sequence[RotatedSpectrum],
    units: OutputUnits = SI,
    target: TargetSpectrum | None = None,
) -> Figure:
    """Plot RotD spectra: percentiles of the spectral accelerations over all horizontal directions.

    There is a line per ground motion, damping ratio and percentile, and for the geometric mean of
    the two components.

    Parameters
    ----------
    spectra : sequence of RotatedSpectrum
        Spectra with the same percentiles; at least one.
    """
    units = units.in_figures
    # Each line shows one ground motion at a single damping ratio: a percentile over the horizontal
    # directions (RotD), or the geometric mean of the two components.
    lines: list[Any] = []
    for spectrum in spectra:
        motion = spectrum.motion
        files = dict.fromkeys((record_name(motion.first.source), record_name(motion.second.source)))
        record = replace(motion.first, source="+".join(files), component=motion.component)
        percentiles = [f"RotD{percentile:02d}" for percentile in spectrum.percentiles]
        for name, psa in (
            *zip(percentiles, spectrum.psa, strict=True),
            ("geometric mean", spectrum.geometric_mean),
        ):
            lines.append(
                SimpleNamespace(
                    name=name,
                    record=record,
                    damping=spectrum.damping,
                    periods=spectrum.periods,
                    psa=psa,
                    sd=psa * (spectrum.periods / (2.0 * math.pi)) ** 2,
                )
            )
    labels = [
        f"{label}, {line.name}" for label, line in zip(line_labels(lines), lines, strict=True)
    ]
    figure = draw_over_periods(
        lines, _elastic_panels(units), labels, [(line.damping, line.name) for line in lines]
    )
    if target is not None:
        _add_target(figure, target, units)
    description = ", ".join(["exact solution", "180 directions", *_special_settings(spectra[0])])
    return titled(figure, over_periods_title("RotD spectrum", "RotD spectra", lines, description))


def drift_spectrum_picture(spectra: Sequence[DriftSpectrum], units: OutputUnits = SI) -> Figure:
    """Plot drift spectra: a line per component and damping ratio.

    Parameters
    ----------
    spectra : sequence of DriftSpectrum
        Spectra of the same type of building; at least one.
    """
    beam = spectra[0].stories[0] == 0  # the number of stories of a continuous shear beam is 0
    panels: list[Panel] = [
        (
            "drift ratio at the base (%)" if beam else "maximum story drift ratio (%)",
            lambda spectrum: 100.0 * spectrum.peak_drift_ratio,
        ),
        ("roof displacement / height (%)", lambda spectrum: 100.0 * spectrum.roof_drift_ratio),
    ]
    figure = draw_over_periods(spectra, panels, line_labels(spectra))
    _add_heights(figure.axes[0], spectra[0], units)
    fewest, most = int(spectra[0].stories.min()), int(spectra[0].stories.max())
    if most == 0:
        buildings = "continuous shear beam"
    elif fewest < most:
        buildings = f"shear buildings of {fewest} to {pluralize(most, 'story')}"
    else:
        buildings = f"shear buildings of {pluralize(most, 'story')}"
    return titled(figure, over_periods_title("Drift spectrum", "Drift spectra", spectra, buildings))


def _add_heights(axes: Any, spectrum: DriftSpectrum, units: OutputUnits) -> None:
    """Add an axis of building heights on top of a panel over the period.

    The building height is a power of the period, which follows from the heights of the shortest and
    the longest period. Without at least two different periods and heights, no axis is added.
    """
    first, last = spectrum.periods.argmin(), spectrum.periods.argmax()
    periods = spectrum.periods[[first, last]].tolist()
    heights = units.of(spectrum.heights[[first, last]], "m").tolist()
    if periods[0] == periods[1] or heights[0] == heights[1]:
        return
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
    """Plot computed spectra with published values as points, and their differences in percent.

    Parameters
    ----------
    lines : sequence of SpectrumDifference
        Comparisons of the same spectral quantity; at least one.
    """
    units = units.in_figures
    name, si = _NAMES[lines[0].published.quantity]
    panels: list[Panel] = [
        (f"{name} ({units.label(si)})", lambda line: units.of(line.computed, si)),
        ("computed / published - 1 (%)", lambda line: 100.0 * line.relative_difference),
    ]
    figure = draw_over_periods(lines, panels, line_labels(lines))
    upper, lower = figure.axes
    # Several lines can have the same published spectrum, which is plotted only for the last line.
    for line in {id(line.published): line for line in lines}.values():
        upper.plot(line.periods, units.of(line.expected, si), "o", **_POINTS, zorder=3)
    upper.plot([], [], "o", **_POINTS, label="published")
    lower.autoscale(axis="y")
    lower.axhline(0.0, color=LIGHT, linewidth=0.8, zorder=1.5)
    title = over_periods_title(
        "Spectrum",
        "Spectra",
        lines,
        f"compared with {record_name(lines[0].published.source)} (points)",
    )
    return titled(figure, title)


def target_picture(target: TargetSpectrum, units: OutputUnits = SI) -> Figure:
    """Plot a target spectrum: pseudo-acceleration and displacement over the period."""
    units = units.in_figures
    figure, ((upper,), (lower,)) = new_panels(7.5, (4.0, (1,)), (3.2, (1,)), share="x")
    _add_target(figure, target, units, legend=False)
    upper.set_ylabel(psa_label(units))
    lower.set(ylabel=f"displacement SD ({units.label('m')})", xlabel="period (s)")
    log_periods(lower, target.periods)
    for axes in (upper, lower):
        axes.set_ylim(bottom=0.0)
    damping = "" if target.damping is None else f"\n{100.0 * target.damping:g} % damping"
    return titled(figure, f"Target spectrum {_target_name(target)}{damping}")


def _target_name(target: TargetSpectrum) -> str:
    """Return the printed form of a design spectrum, or the file name without directory."""
    return spectrum_text(target.source) if target.curve else record_name(target.source)


def _add_target(
    figure: Figure, target: TargetSpectrum, units: OutputUnits, *, legend: bool = True
) -> None:
    """Plot a target spectrum in the panels of pseudo-acceleration and displacement over the period.
    If the figure also contains spectra (`legend`), the target is listed in the legend, and does not
    change the range of the periods.
    """
    upper, lower = figure.axes[:2]
    low, high = upper.get_xlim()
    psa, sd = units.of(target.psa, "m/s^2"), units.of(target.sd, "m")
    label = f"target {_target_name(target)}" if legend else ""
    upper.plot(target.periods, psa, label=label, **_TARGET)
    lower.plot(target.periods, sd, **_TARGET)
    if not legend:
        return
    upper.set_xlim(low, high)
    shown = (target.periods >= low) & (target.periods <= high)
    for axes, values in ((upper, psa), (lower, sd)):
        if np.any(shown):
            axes.set_ylim(top=max(axes.get_ylim()[1], 1.05 * float(np.max(values[shown]))))
