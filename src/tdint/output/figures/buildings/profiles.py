"""Profiles of a run over the height: drifts, floor accelerations, story shears; an isolator apart from the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from tdint.output.figures.style import DASHES, INK, LIGHT, MARK, scaled_unit
from tdint.output_units import OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import Response

Array = NDArray[np.float64]

_NEAR = 0.4  # the collapse drift is shown where the peak reaches this part of it
_SEEN = 0.002  # estimated errors are shown where one reaches this part of the largest peak
_VISIBLE = 0.05  # the drift at the end is shown where it reaches this part of the peak
_APART = 8.0  # the first story's drift over the largest of all others, from which it is that of an isolator
_BEYOND = 1.25  # where the bar of an isolator ends, over the largest of all others


@dataclass(frozen=True)
class _Drifts:
    """Drifts in percent of the height or a unit of length, shape (n,), and the stories that are drawn apart."""

    peak: Array
    residual: Array
    error: Array | None
    unit: str
    apart: NDArray[np.bool_]

    @classmethod
    def of(cls, response: Response, units: OutputUnits) -> _Drifts:
        """By height where there is one: stories without one are apart, and a first story that slides under the rest."""
        stories = response.stories
        tall = np.isfinite(stories.height)
        by_height = bool(tall.any())
        length = np.full_like(stories.height, 1.0 / units.unit("m")[1])
        scale = 100.0 / np.where(tall, stories.height, 1.0) if by_height else length
        peak, residual = scale * stories.peak_drift, scale * np.abs(stories.residual_drift)
        apart = ~tall if by_height else np.zeros(peak.size, dtype=bool)
        if peak.size > 2 and not apart.any():
            apart[0] = peak[0] > _APART * np.max(peak[1:])
        error = None if response.check is None else scale * response.check.errors.peak_drift
        return cls(peak, residual, error, "%" if by_height else units.label("m"), apart)

    @property
    def largest(self) -> float:
        """The largest of those that are not apart."""
        rest = self.peak[~self.apart]
        return float(np.max(rest)) if rest.size else 0.0


def draw_profiles(panels: Sequence[Any], response: Response, units: OutputUnits) -> None:
    """Three panels over the stories: drifts, absolute accelerations of the floors (the ground below them), shears."""
    drifts, accelerations, shears = panels
    _draw_drifts(drifts, response, units)
    _draw_accelerations(accelerations, response, units)
    _draw_shears(shears, response, units)
    count = response.stories.peak_drift.size
    for axes in panels:
        axes.set_ylim(0.5, count + 0.5)
        axes.yaxis.set_major_locator(MaxNLocator(11, integer=True, min_n_ticks=1))
        axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
        axes.set_xlim(left=0.0)
        axes.tick_params(labelleft=axes is drifts)
    drifts.set_ylabel("story")


def _bars(axes: Any, values: Array, **style: Any) -> None:
    axes.stairs(values, np.arange(values.size + 1) + 0.5, orientation="horizontal", **style)


def _draw_drifts(axes: Any, response: Response, units: OutputUnits) -> None:
    drifts = _Drifts.of(response, units)
    values = np.where(drifts.apart, np.nan, drifts.peak)
    filled = np.nan_to_num(values)
    _bars(axes, filled, fill=True, color=INK, alpha=0.18)
    _bars(axes, filled, color=INK, linewidth=1.4)
    largest = drifts.largest
    residual = np.where(drifts.apart, 0.0, drifts.residual)
    if np.any(residual > _VISIBLE * largest):
        _bars(axes, residual, color=MARK, linestyle=DASHES[2], label="at the end of the run")
    if drifts.error is not None and np.any(np.where(drifts.apart, 0.0, drifts.error) > _SEEN * largest):
        places = np.arange(1, values.size + 1)
        errors = np.where(drifts.apart, np.nan, drifts.error)
        axes.errorbar(values, places, xerr=errors, fmt="none", ecolor=INK, capsize=2.0, label="estimated error")
    limit = 100.0 * response.model.collapse_drift
    if drifts.unit == "%" and largest > _NEAR * limit:
        axes.axvline(limit, color=MARK, linestyle=DASHES[1], label=f"collapse drift {limit:g} %")
    _mark_apart(axes, units.of(response.stories.peak_drift, "m"), units.label("m"), drifts)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best", fontsize=7.0, handlelength=1.6)
    axes.set_xlabel(f"drift ({drifts.unit}{' of height' if drifts.unit == '%' else ''})")


def _mark_apart(axes: Any, peaks: Array, unit: str, drifts: _Drifts) -> None:
    """A bar off the scale with its length in it."""
    end = _BEYOND * drifts.largest or 1.0
    for place in np.flatnonzero(drifts.apart):
        axes.barh(place + 1, end, height=1.0, facecolor="none", edgecolor=LIGHT, hatch="////", linewidth=0.0)
        text = f"{peaks[place]:#.3g} {unit}"
        axes.text(
            0.5 * end, place + 1, text, ha="center", va="center", fontsize=8.0, color=MARK,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
        )  # fmt: skip
    if drifts.apart.any():
        axes.set_xlim(right=end)


def _draw_accelerations(axes: Any, response: Response, units: OutputUnits) -> None:
    """Points at the floors: that of story 1 lies above it; the ground at the bottom."""
    floors = units.of(response.stories.peak_acceleration, "m/s^2")
    places = np.arange(floors.size + 1) + 0.5
    ground = units.of(response.record.pga, "m/s^2") if response.record is not None else 0.0
    marker = "o" if floors.size <= 20 else None
    axes.plot([ground, *floors], places, color=INK, linewidth=1.2, marker=marker, markersize=3.0, clip_on=False)
    if max(ground, np.max(floors)) > 0.0:
        axes.set_xlim(right=1.08 * max(ground, float(np.max(floors))))
    axes.set_xlabel(f"absolute floor\nacceleration ({units.label('m/s^2')})")


def _draw_shears(axes: Any, response: Response, units: OutputUnits) -> None:
    shears = response.stories.peak_shear
    factor, unit = scaled_unit(float(np.max(shears)), "N", units)
    _bars(axes, factor * shears, fill=True, color=INK, alpha=0.18)
    _bars(axes, factor * shears, color=INK, linewidth=1.4)
    axes.set_xlabel(f"story shear ({unit})")
