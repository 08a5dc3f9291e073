"""Figure of a comparison: each floor's motion as recorded and as computed, and the spectra of both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.arrays import Array
from tdint.output.figures.spectrum_axes import log_periods
from tdint.output.figures.style import LIGHT, MARK, add_title, record_name
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.comparison.compare import Comparison, FloorComparison, FloorSpectra


_RECORDED, _COMPUTED = LIGHT, MARK
_MOST_ROWS, _WORST = 6, 4  # floors that are drawn; of more, those that agree least, and an overview
_ENERGY = (0.0005, 0.9995)  # parts of the recorded energy between which the histories are shown
_CYCLES = 8  # of the recording, that the close-up shows
_UNITS = {"acceleration": "m/s^2", "displacement": "m"}
"""By quantity its SI unit."""


def comparison_picture(
    comparisons: Sequence[Comparison], periods: Array, damping: float, units: OutputUnits = SI
) -> Figure:
    """Picture of results beside recordings, a row for each floor of each event, the roof on top.

    Parameters
    ----------
    comparisons : sequence of Comparison
        One at least.
    periods : ndarray, shape (k,)
        Of the spectra, s, and their damping ratio.
    units : OutputUnits
        Of lengths and accelerations.
    """
    units = units.in_pictures
    rows = [
        (one, floor, spectra)
        for one in comparisons
        for floor, spectra in reversed(list(zip(one.floors, one.spectra(periods, damping), strict=True)))
    ]
    left_out = len(rows) - _WORST if len(rows) > _MOST_ROWS else 0
    if left_out:
        rows = sorted(rows, key=lambda row: row[1].correlation)[:_WORST]
    figure = Figure(figsize=(7.5, 1.5 + 1.55 * len(rows) + 2.6 * bool(left_out)), layout="constrained")
    top: Any = figure
    if left_out:
        parts: Any = figure.subfigures(2, 1, height_ratios=(1.55 * len(rows), 2.6))
        top, below = parts
        _draw_overview(below.subplots(2, 1, sharex=True), comparisons)
    panels = top.subplots(len(rows), 3, squeeze=False, width_ratios=(2.2, 1.4, 1.1))
    for (one, floor, spectra), (history, close, spectrum) in zip(rows, panels, strict=True):
        event = record_name(one.event.recording.source) if len(comparisons) > 1 else ""
        _draw_histories(history, floor, units)
        history.set_xlim(*_shaken(one))
        history.set_ylabel(f"{floor.quantity}\n({units.label(_UNITS[floor.quantity])})")
        history.set_title(_agreement(floor, event), loc="left", fontsize=8.5, parse_math=False)
        _draw_histories(close, floor, units)
        close.set_xlim(*_strongest(one))
        close.tick_params(labelleft=False)
        _draw_spectra(spectrum, spectra, units)
    panels[-1, 1].set_xlabel("time (s)")
    panels[-1, 2].set_xlabel("period (s)")
    panels[0, 2].set_title(f"spectra, {100.0 * damping:g} %", fontsize=8.5)
    panels[-1, 0].set_xlabel("time (s)")
    lines = panels[0, 0].get_lines()
    figure.legend(lines[:2], ["recorded", "computed"], loc="outside lower center", ncols=2, handlelength=3.0)
    add_title(figure, _title(comparisons[0], left_out))
    return figure


def _title(one: Comparison, left_out: int) -> str:
    band = one.event.recording.band
    what = f"{one.response.model.name} beside {record_name(one.event.recording.source)}"
    how = [f"{one.response.method}, dt {one.response.dt:.4g} s"]
    if band:
        how.append(f"{band[0]:g} to {band[1]:g} Hz")
    if one.shift:
        how.append(f"recordings shifted by {one.shift:.4g} s")
    if left_out:
        how.append(f"the {_WORST} floors that agree least; below all {left_out + _WORST}")
    return f"{what}\n{', '.join(how)}"


def _draw_overview(panels: Any, comparisons: Sequence[Comparison]) -> None:
    """Correlation and ratio of the peaks of every floor: over the events, or over the floors of a single one."""
    above, below = panels
    for place, one in enumerate(comparisons, start=1):
        for floor in one.floors:
            x = place if len(comparisons) > 1 else floor.floor
            dark = "0.15" if floor is one.floors[-1] else LIGHT
            above.plot([x], [floor.correlation], "o", color=dark, markersize=3.0)
            below.plot([x], [floor.peak_ratio], "o", color=dark, markersize=3.0)
    above.set_ylabel("correlation")
    above.set_title("all floors, the highest dark", loc="left", fontsize=8.5)
    below.set_ylabel("peaks, computed\nover recorded")
    below.axhline(1.0, color=LIGHT, linewidth=0.8)
    below.xaxis.set_major_locator(MaxNLocator(12, integer=True))
    below.set_xlabel("event, in the order of the command line" if len(comparisons) > 1 else "floor")


def _draw_histories(axes: Any, floor: FloorComparison, units: OutputUnits) -> None:
    unit = _UNITS[floor.quantity]
    axes.plot(floor.time, units.of(floor.recorded, unit), color=_RECORDED, linewidth=1.6)
    axes.plot(floor.time, units.of(floor.computed, unit), color=_COMPUTED, linewidth=0.7)
    axes.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _agreement(floor: FloorComparison, event: str) -> str:
    place = f"{event}, floor {floor.floor}" if event else f"floor {floor.floor}"
    return f"{place}: correlation {floor.correlation:.3f}, peaks {floor.peak_ratio:.3f}"


def _shaken(one: Comparison) -> tuple[float, float]:
    """The times between which the floors were shaken, s."""
    ends = []
    for floor in one.floors:
        energy = np.cumsum(floor.recorded**2)
        ends += [floor.time[int(np.searchsorted(energy, part * energy[-1]))] for part in _ENERGY]
    return (min(ends), max(ends)) if min(ends) < max(ends) else (one.floors[0].time[0], one.floors[0].time[-1])


def _strongest(one: Comparison) -> tuple[float, float]:
    """Some cycles around the largest recorded value of the highest floor, s."""
    floor = one.floors[-1]
    crossings = np.flatnonzero(np.diff(np.signbit(floor.recorded)))
    peak = int(np.argmax(np.abs(floor.recorded)))
    middle = int(np.searchsorted(crossings, peak))
    near = crossings[max(0, middle - _CYCLES) : middle + _CYCLES]
    if near.size < 2:
        return _shaken(one)
    return float(floor.time[near[0]]), float(floor.time[near[-1]])


def _draw_spectra(axes: Any, spectra: FloorSpectra, units: OutputUnits) -> None:
    axes.plot(spectra.periods, units.of(spectra.recorded, "m/s^2"), color=_RECORDED, linewidth=1.5)
    axes.plot(spectra.periods, units.of(spectra.computed, "m/s^2"), color=_COMPUTED, linewidth=0.9)
    axes.set(ylim=(0.0, None), ylabel=f"SA ({units.label('m/s^2')})")
    axes.tick_params(axis="x", which="both", labelsize=7.0)
    log_periods(axes, spectra.periods)
