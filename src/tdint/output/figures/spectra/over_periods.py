"""What the figures over the period share: lines of components or the fractiles of a suite, panel by panel."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tdint.ground_motion.record import Record, component_names
from tdint.output.figures.axes import plain_minor_numbers, plain_numbers
from tdint.output.figures.style import COLORS, DASHES, add_legend, changed, record_name
from tdint.output.figures.suites import BETWEEN_FRACTILES, draw_fractiles, draw_median

Array = NDArray[np.float64]

_FEW = 8  # periods: with fewer every one is marked
_SUITE = 7  # motions from which they are a suite: single ones in gray, median and fractiles
GRAY = "0.75"
"""Of what is one among many."""

_MINOR_GRID = "0.94"


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
    *,
    columns: Sequence[str] | None = None,
) -> Figure:
    """Panels one above the other, with a line for each result over its periods; no title yet.

    Many motions are a suite: all in gray, and the median and fractiles of each variant.

    Parameters
    ----------
    variants : sequence, optional
        What tells lines of one component apart, by default their damping ratios.
    columns : sequence of str, optional
        The column of panels that each result stands in, by its title; all in one without.
    """
    variants = [result.damping for result in results] if variants is None else variants
    suite = is_suite(results)
    titles = list(dict.fromkeys(columns)) if columns is not None and not suite else [""]
    figure = Figure(figsize=(7.5 if len(titles) == 1 else 8.5, 7.8), layout="constrained")
    rows = figure.subplots(
        len(panels), len(titles), sharex=True, sharey="row", squeeze=False, height_ratios=(1.25, 1.0)
    )
    lines: dict[str, Any] = {}
    if suite:
        lines = _draw_suite(rows[:, 0], results, panels, variants)
    else:
        places = [0] * len(results) if columns is None else [titles.index(title) for title in columns]
        styles = _line_styles(results, variants, by_variant=len(titles) > 1)
        for result, place, label, style in zip(results, places, labels, styles, strict=True):
            lines[label] = _draw_line(rows[:, place], result, panels, style)
    for axes, (label, _) in zip(rows[:, 0], panels, strict=True):
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
    for axes, title in zip(rows[0], titles, strict=True):
        axes.set_title(title, parse_math=False)
    for axes in rows[-1]:
        axes.set_xlabel("period (s)")
    log_periods(rows[-1, 0], np.concatenate([result.periods for result in results]))
    for axes in rows.flat:
        axes.grid(which="minor", axis="x", color=_MINOR_GRID, linewidth=0.5)
    add_legend(figure, rows[0, 0], list(lines.values()), list(lines))  # a single line has its name in the title
    return figure


def _motions(results: Sequence[OverPeriods]) -> list[tuple[str, str]]:
    """File and component of each result."""
    names = component_names([result.record for result in results])
    return [(result.record.source, name) for result, name in zip(results, names, strict=True)]


def is_suite(results: Sequence[OverPeriods]) -> bool:
    """Whether these are so many motions that their fractiles say more than each of them."""
    if len(set(_motions(results))) < _SUITE:
        return False
    return all(np.array_equal(result.periods, results[0].periods) for result in results)


def _draw_line(column: Any, result: Line, panels: Sequence[Panel[Line]], style: dict[str, Any]) -> Any:
    """A line in each panel of a column; the first one, for the legend."""
    order = _shown(result.periods)
    period = result.periods[order]
    if period.size < _FEW:
        style = {**style, "marker": "o", "markersize": 4}
    drawn = [
        axes.plot(period, values(result)[order], **style)[0] for axes, (_, values) in zip(column, panels, strict=True)
    ]
    return drawn[0]


def _draw_suite(
    column: Any, results: Sequence[Line], panels: Sequence[Panel[Line]], variants: Sequence[Hashable]
) -> dict[str, Any]:
    """All lines in gray, the median and fractiles of each variant; by their names, for the legend."""
    order = _shown(results[0].periods)
    period = results[0].periods[order]
    kinds = list(dict.fromkeys(variants))
    lines: dict[str, Any] = {}
    for axes, (_, values) in zip(column, panels, strict=True):
        rows = np.array([values(result)[order] for result in results])
        gray = axes.plot(period, rows.T, color=GRAY, linewidth=0.6, zorder=1.5)[0]
        lines.setdefault(f"{len(set(_motions(results)))} components", gray)
        for i, kind in enumerate(kinds):
            own = rows[[variant == kind for variant in variants]]
            color, name = COLORS[i % len(COLORS)], f", {_variant_name(kind)}" if len(kinds) > 1 else ""
            lines.setdefault(f"median{name}", draw_median(axes, period, own, color))
            lines.setdefault(f"{BETWEEN_FRACTILES}{name}", draw_fractiles(axes, period, own, color))
    return lines


def _variant_name(variant: Hashable) -> str:
    parts = variant if isinstance(variant, tuple) else (variant,)
    return ", ".join(f"{100.0 * part:g} %" if isinstance(part, float) else str(part) for part in parts)


def _line_styles(
    results: Sequence[OverPeriods], variants: Sequence[Hashable], *, by_variant: bool
) -> list[dict[str, Any]]:
    """Lines to be told apart without color: dashes per component, or per variant where there are several."""
    motions = _motions(results)
    number = {motion: i for i, motion in enumerate(dict.fromkeys(motions))}
    kinds = {variant: i for i, variant in enumerate(dict.fromkeys(variants))}
    styles = []
    for motion, variant in zip(motions, variants, strict=True):
        dash = kinds[variant] if len(kinds) > 1 or by_variant else number[motion]
        color = dash if len(number) == 1 or by_variant else number[motion]
        styles.append({"color": COLORS[color % len(COLORS)], "linestyle": DASHES[dash % len(DASHES)]})
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
    plain_numbers(axes.xaxis)
    plain_minor_numbers(axes.xaxis, every=high < 12.0 * low)


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
