"""Elastic spectra on other axes: tripartite, and acceleration over displacement (ADRS)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from tdint.output.figures.axes import plain_numbers
from tdint.output.figures.spectra.over_periods import GRAY, is_suite, log_periods
from tdint.output.figures.style import COLORS, DASHES, LIGHT, add_legend
from tdint.output_units import OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.spectra.elastic import Spectrum

Array = NDArray[np.float64]

_SCALE = "0.82"
_PERIODS = (0.2, 0.5, 1.0, 2.0, 4.0)  # s, of the rays of an ADRS
_ROOM = 0.85  # of the axes that labels of scales stay within
_NEAR = 0.09  # of the axes: labels that are nearer to each other would overlap


@dataclass(frozen=True)
class _Curve:
    """A line of the figure in its units, shape (k,), its name in the legend (empty for none) and its style."""

    periods: Array
    sd: Array
    psv: Array
    psa: Array
    name: str
    style: dict[str, Any]

    @classmethod
    def of(cls, one: Spectrum, units: OutputUnits, name: str, style: dict[str, Any]) -> _Curve:
        """The line of a spectrum."""
        values = (units.of(one.sd, "m"), units.of(one.psv, "m/s"), units.of(one.psa, "m/s^2"))
        return cls(one.periods, *values, name, style)


def _curves(spectra: Sequence[Spectrum], labels: Sequence[str], units: OutputUnits) -> list[_Curve]:
    """A line for each spectrum; of a suite all in gray, and the median for each damping ratio."""

    def style(i: int) -> dict[str, Any]:
        return {"color": COLORS[i % len(COLORS)], "linestyle": DASHES[i % len(DASHES)], "zorder": 3}

    if not is_suite(spectra):
        return [
            _Curve.of(one, units, label, style(i)) for i, (one, label) in enumerate(zip(spectra, labels, strict=True))
        ]
    gray = {"color": GRAY, "linewidth": 0.6, "zorder": 1.5}
    curves = [_Curve.of(one, units, "", gray) for one in spectra]
    curves[0] = replace(curves[0], name="single components")
    ratios = dict.fromkeys(one.damping for one in spectra)
    for i, ratio in enumerate(ratios):
        own = [curve for one, curve in zip(spectra, curves, strict=False) if one.damping == ratio]
        sd, psv, psa = (np.median([getattr(one, name) for one in own], axis=0) for name in ("sd", "psv", "psa"))
        name = f"median of {len(own)}" + (f", {100.0 * ratio:g} %" if len(ratios) > 1 else "")
        curves.append(_Curve(spectra[0].periods, sd, psv, psa, name, style(i) | {"linewidth": 2.0}))
    return curves


def _name_curves(figure: Figure, axes: Any, curves: Sequence[_Curve]) -> None:
    named = [(line, curve.name) for line, curve in zip(axes.get_lines(), curves, strict=False) if curve.name]
    add_legend(figure, axes, [line for line, _ in named], [name for _, name in named])


def _positive(spectrum: _Curve) -> NDArray[np.intp]:
    """Places of the periods that can be drawn, in rising order."""
    order = np.argsort(spectrum.periods, kind="stable")
    return order[(spectrum.periods[order] > 0.0) & (spectrum.sd[order] > 0.0)]


def draw_tripartite(spectra: Sequence[Spectrum], labels: Sequence[str], units: OutputUnits) -> Figure:
    """Pseudo-velocity over the period, both logarithmic: displacement and pseudo-acceleration are straight scales."""
    figure = Figure(figsize=(7.5, 6.2), layout="constrained")
    axes = figure.subplots()
    curves = _curves(spectra, labels, units)
    for curve in curves:
        place = _positive(curve)
        axes.plot(curve.periods[place], curve.psv[place], **curve.style)
    log_periods(axes, np.concatenate([spectrum.periods for spectrum in spectra]))
    axes.set_xlabel("period (s)")
    axes.set_ylabel(f"pseudo-velocity PSV ({units.label('m/s')})")
    values = np.concatenate([curve.psv[_positive(curve)] for curve in curves])
    if values.size:
        axes.set_yscale("log")
        low, high = float(np.min(values)), float(np.max(values))
        axes.set_ylim(max(low / 1.5, high / 3e3), 1.8 * high)
        plain_numbers(axes.yaxis)
        axes.yaxis.set_minor_formatter(NullFormatter())
        _add_scales(axes, units)
    axes.grid(which="minor", color="0.95", linewidth=0.5)
    _name_curves(figure, axes, curves)
    _turn_names(figure, axes)
    return figure


def _turn_names(figure: Figure, axes: Any) -> None:
    """Lay the names of scales along their lines, which have one slope on the paper."""
    if axes.get_yscale() != "log" or axes.get_xscale() != "log":
        return
    figure.draw_without_rendering()  # the layout decides the slope
    extent = axes.get_window_extent()
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    rise, run = extent.height / math.log(top / bottom), extent.width / math.log(right / left)
    slope = math.degrees(math.atan2(rise, run))
    for text in axes.texts:
        text.set_rotation(-slope if text.get_rotation() > 180.0 else slope)


def _add_scales(axes: Any, units: OutputUnits) -> None:
    """Lines of equal displacement (rising to the left) and of equal pseudo-acceleration (rising to the right)."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    ends = np.array([left, right])
    omega = 2.0 * math.pi / ends
    for si, speed in (("m", omega), ("m/s^2", 1.0 / omega)):  # pseudo-velocity of a unit of displacement, acceleration
        unit, reach = units.label(si), units.of(units.unit(si)[1] * speed, "m/s")
        low, high = bottom / float(np.max(reach)), top / float(np.min(reach))
        decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        for value in (10.0**decade for decade in decades):
            speeds = value * reach
            axes.plot(ends, speeds, color=_SCALE, linewidth=0.8, zorder=1.2)
            _name_scale(axes, ends, speeds, f"{value:g} {unit}", (bottom, top))
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)


def _name_scale(axes: Any, ends: Array, speeds: Array, text: str, limits: tuple[float, float]) -> None:
    """The value of a scale's line, along it, near where it leaves the axes at the top or at the side.

    It makes way for the names that are there: in units in which 1 and 10 of two scales meet near the top.
    """
    x, y = np.log(ends), np.log(speeds)
    bottom, top = np.log(limits)
    target = bottom + _ROOM * (top - bottom)
    part = (target - y[0]) / (y[1] - y[0])
    part = min(max(float(part), 1.0 - _ROOM), _ROOM)
    room = np.array([x[1] - x[0], top - bottom])
    taken = [np.log(other.get_position()) for other in axes.texts]
    for place in (part, part - _NEAR, part - 2.0 * _NEAR):
        at = np.array([x[0] + place * (x[1] - x[0]), y[0] + place * (y[1] - y[0])])
        if place > _NEAR and not any(np.all(np.abs(at - other) < _NEAR * room) for other in taken):
            break
    else:
        return
    if not bottom + 0.04 * (top - bottom) < at[1] < bottom + (_ROOM + 0.05) * (top - bottom):
        return
    white = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
    axes.text(
        math.exp(at[0]), math.exp(at[1]), text, rotation=45.0 if y[1] > y[0] else -45.0, ha="center", va="center",
        fontsize=7.5, color=LIGHT, clip_on=True, zorder=1.8, bbox=white,
    )  # fmt: skip


def draw_adrs(spectra: Sequence[Spectrum], labels: Sequence[str], units: OutputUnits) -> Figure:
    """Pseudo-acceleration over displacement; periods are rays from the origin."""
    figure = Figure(figsize=(7.0, 6.4), layout="constrained")
    axes = figure.subplots()
    curves = _curves(spectra, labels, units)
    for curve in curves:
        order = np.argsort(curve.periods, kind="stable")
        axes.plot(curve.sd[order], curve.psa[order], **curve.style)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.margins(0.05)
    right, top = axes.get_xlim()[1], axes.get_ylim()[1]
    for period in _PERIODS:
        slope = units.of(units.unit("m")[1] * (2.0 * math.pi / period) ** 2, "m/s^2")
        end = min(right, top / slope)
        axes.plot([0.0, end], [0.0, slope * end], color=_SCALE, linewidth=0.8, zorder=1.2)
        side = "left" if end == right else "center"
        axes.annotate(
            f"{period:g} s", (end, slope * end), xytext=(2, 0) if side == "left" else (0, 2), ha=side,
            textcoords="offset points", va="center" if side == "left" else "bottom", fontsize=7.5, color=LIGHT,
            annotation_clip=False,
        )  # fmt: skip
    axes.set_xlim(0.0, right)
    axes.set_ylim(0.0, top)
    axes.set_xlabel(f"displacement SD ({units.label('m')})")
    axes.set_ylabel(f"pseudo-acceleration PSA ({units.label('m/s^2')})")
    _name_curves(figure, axes, curves)
    return figure
