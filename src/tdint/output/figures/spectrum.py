"""Figures over the period: elastic spectra, and what the figures of other spectra share with them."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from tdint.files import Writer
from tdint.ground_motion.record import Record, component_names
from tdint.output.figures.run import COLORS, DASHES, MARKERS, add_legend, add_title, changed, picture, record_name

if TYPE_CHECKING:
    from tdint.analysis.spectra.elastic import Spectrum

Array = NDArray[np.float64]

_FEW = 8  # periods: with fewer every one is marked


def spectrum_picture(spectra: Sequence[Spectrum], suffix: str) -> Writer:
    """Picture of spectra: pseudo-acceleration and displacement over period, a line per component and damping ratio.

    Parameters, return value and errors are those of `tdint.output.figures.run.run_picture`.
    """
    return picture(suffix, lambda: _draw_spectra(spectra))


def _draw_spectra(spectra: Sequence[Spectrum]) -> Figure:
    panels: list[Panel[Spectrum]] = [
        ("pseudo-acceleration PSA (m/s²)", lambda spectrum: spectrum.psa),
        ("displacement SD (m)", lambda spectrum: spectrum.sd),
    ]
    figure = draw_over_periods(spectra, panels, line_labels(spectra))
    title = over_periods_title("Elastic response spectrum", "Elastic response spectra", spectra, _how(spectra[0]))
    add_title(figure, title)
    return figure


def _how(spectrum: Spectrum) -> str:
    """The method, and what was chosen beside it."""
    words = ["exact solution" if spectrum.method == "exact" else spectrum.method]
    if spectrum.method == "exact" and spectrum.maxima != "exact":
        words.append(f"maxima: {spectrum.maxima}")
    if spectrum.interpolation != "linear":
        words.append(f"{spectrum.interpolation} motion")
    return ", ".join(words)


class OverPeriods(Protocol):
    """What a line over the period needs; `periods` (s) of shape (k,)."""

    @property
    def record(self) -> Record: ...
    @property
    def damping(self) -> float: ...
    @property
    def periods(self) -> Array: ...


Line = TypeVar("Line", bound=OverPeriods)
Panel = tuple[str, Callable[[Line], Array]]
"""Label of the values, and the values of a line, shape (k,)."""


def draw_over_periods(
    results: Sequence[Line],
    panels: Sequence[Panel[Line]],
    labels: Sequence[str],
    variants: Sequence[Hashable] | None = None,
) -> Figure:
    """Two panels one above the other, with a line for each result over its periods; no title yet.

    `variants` tell lines of one component apart, by default their damping ratios.
    """
    variants = [result.damping for result in results] if variants is None else variants
    figure = Figure(figsize=(7.5, 7.8), layout="constrained")
    both = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1.0))
    lines = []
    for result, style in zip(results, _line_styles(results, variants), strict=True):
        order = _shown(result.periods)
        period = result.periods[order]
        if period.size < _FEW:
            style = {"marker": "o", **style, "markevery": 1}
        for axes, (_, values) in zip(both, panels, strict=True):
            lines += axes.plot(period, values(result)[order], markersize=4, **style)
    for axes, (label, _) in zip(both, panels, strict=True):
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
    both[1].set_xlabel("period (s)")
    log_periods(both[1], np.concatenate([result.periods for result in results]))
    add_legend(figure, both[0], lines[::2], list(labels))  # a single line has its name in the title
    return figure


def _line_styles(results: Sequence[OverPeriods], variants: Sequence[Hashable]) -> list[dict[str, Any]]:
    """Lines to be told apart without color: dashes per component, or per variant and markers per component."""
    names = component_names([result.record for result in results])
    motions = [(result.record.source, name) for result, name in zip(results, names, strict=True)]
    number = {motion: i for i, motion in enumerate(dict.fromkeys(motions))}
    kinds = {variant: i for i, variant in enumerate(dict.fromkeys(variants))}
    marked = len(number) > len(DASHES) or (len(number) > 1 and len(kinds) > 1)
    styles = []
    for motion, variant in zip(motions, variants, strict=True):
        i = number[motion]
        dash = kinds[variant] if len(kinds) > 1 else i
        color = i if len(number) > 1 else dash
        style = {"color": COLORS[color % len(COLORS)], "linestyle": DASHES[dash % len(DASHES)]}
        if marked:
            style |= {"marker": MARKERS[i % len(MARKERS)], "markevery": (0.03 * (i % 6), 0.18)}
        styles.append(style)
    return styles


def _shown(periods: Array) -> NDArray[np.intp]:
    """Places of the periods that are drawn, in rising order: period 0 has none on a logarithmic axis."""
    order = np.argsort(periods, kind="stable")
    positive = order[periods[order] > 0.0]
    return positive if positive.size else order


def log_periods(axes: Any, periods: Array) -> None:
    """A logarithmic axis over the positive ones of these periods (s)."""
    shown = periods[_shown(periods)]
    low, high = float(np.min(shown)), float(np.max(shown))
    if not low > 0.0:
        return
    axes.set_xscale("log")
    if low < high:
        axes.set_xlim(low, high)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(
        FuncFormatter(lambda value, _: f"{value:g}" if high < 12.0 * low or _leads(value, "25") else "")
    )


def _leads(value: float, digits: str) -> bool:
    """Whether the first digit of `value` is one of `digits`."""
    return f"{value / 10.0 ** math.floor(math.log10(value) + 1e-9):.0f}" in digits


def line_labels(results: Sequence[OverPeriods]) -> list[str]:
    """What tells the lines apart: the record if there are several, the component, the damping if there are several."""
    names = component_names([result.record for result in results])
    several_files = len({result.record.source for result in results}) > 1
    several_ratios = len({result.damping for result in results}) > 1
    labels = []
    for result, name in zip(results, names, strict=True):
        file = record_name(result.record.source) if several_files or not name else ""
        ratio = f"{100.0 * result.damping:g} %" if several_ratios else ""
        labels.append(", ".join(filter(None, (file, name, ratio))))
    return labels


def over_periods_title(one: str, several: str, results: Sequence[OverPeriods], more: str) -> str:
    """`ONE of FILE COMPONENT`, or `SEVERAL of ...`; below it the damping and what more there is to say."""
    sources = list(dict.fromkeys(result.record.source for result in results))
    ratios = list(dict.fromkeys(result.damping for result in results))
    what = record_name(sources[0]) if len(sources) == 1 else f"{len(sources)} records"
    what += changed(result.record for result in results)
    damping = ", ".join(f"{100.0 * ratio:g} %" for ratio in ratios)
    if len(results) == 1:
        return f"{one} of {what} {results[0].record.component}\n{damping} damping, {more}"
    return f"{several} of {what}\n{damping} damping, {more}"
