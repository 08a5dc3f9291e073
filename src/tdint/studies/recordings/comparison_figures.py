"""Figures that compare computed with recorded responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.arrays import Array
from tdint.model.building import assemble
from tdint.output.figures import style
from tdint.output.figures.spectrum_curves import log_periods
from tdint.output.figures.static_curves import COMPUTED, MAX_ROWS, RECORDED, WORST_ROWS
from tdint.studies.recordings.compare import Comparison, FloorComparison, FloorSpectra
from tdint.units import SI, OutputUnits

_ENERGY_BOUNDS = (0.0005, 0.9995)
"""Fractions of the final integral of the squared recorded motion. They determine the start and the
end of the time axis, so that it excludes the quiet parts of a recording."""

_CYCLES = 8  # number of recorded cycles in the close-up; single oscillations remain visible

_UNITS = {"acceleration": "m/s^2", "displacement": "m"}
"""SI unit of each recorded quantity."""


def comparison_picture(
    comparisons: Sequence[Comparison], periods: Array, damping: float, units: OutputUnits = SI
) -> Figure:
    """Plot the computed and the recorded floor motions of a building in one or several events, and
    their response spectra.

    Each floor of each event has a row of three panels, with the highest floor of an event on top.
    If there are more than `MAX_ROWS` floors, only the floors with the lowest correlation have a
    row, and two panels below show the correlation and the peak ratio of all floors. The title names
    the building, the first recording and the method.
    """
    units = units.in_figures
    period = assemble(comparisons[0].response.model).first_period
    rows: list[_FloorRow] = []
    for comparison in comparisons:
        all_spectra = comparison.spectra(periods, damping)
        floor_rows = [
            _FloorRow(comparison, floor, spectra)
            for floor, spectra in zip(comparison.floors, all_spectra, strict=True)
        ]
        rows += reversed(floor_rows)
    floor_count = len(rows)
    has_overview = floor_count > MAX_ROWS
    if has_overview:
        rows = sorted(rows, key=lambda row: row.floor.correlation)[:WORST_ROWS]
    heights = [(1.8, (4, 3, 3))] * len(rows) + [(1.6, (1, 1))] * has_overview
    figure, panels = style.new_panels(7.5, *heights)
    if has_overview:
        _draw_overview(panels.pop(), comparisons)
    for row, row_panels in zip(rows, panels, strict=True):
        _draw_floor(row_panels, row, units, period, name_event=len(comparisons) > 1)
    for axes, label in zip(panels[-1], ("time (s)", "time (s)", "period (s)"), strict=True):
        axes.set_xlabel(label)
    panels[0][2].set_title(f"spectra, {100.0 * damping:g} %", fontsize=8.5)
    # The legend also states the first period, which the spectra mark.
    lines = [*panels[0][0].get_lines()[:2], *panels[0][2].get_lines()[2:]]
    names = ["recorded", "computed", *(str(line.get_label()) for line in lines[2:])]
    style.add_legend(figure, lines, names)
    # The agreement depends on the method and on the processing of the recordings, so the second
    # line of the title states both.
    first = comparisons[0]
    response, recording = first.response, first.event.recording
    facts = [f"{response.method}, dt {response.dt:.4g} s"]
    if recording.band:
        facts.append(f"{recording.band[0]:g} to {recording.band[1]:g} Hz")
    if first.shift:
        facts.append(f"recordings shifted by {first.shift:.4g} s")
    if has_overview:
        facts.append(f"the {WORST_ROWS} floors with least agreement; below all {floor_count}")
    return style.titled(
        figure,
        f"{response.model.name} and {style.record_name(recording.source)}\n{', '.join(facts)}",
    )


class _FloorRow(NamedTuple):
    """Content of one row of panels in the figure of comparisons."""

    comparison: Comparison
    floor: FloorComparison
    spectra: FloorSpectra


def _draw_floor(
    panels: Any, row: _FloorRow, units: OutputUnits, period: float, *, name_event: bool
) -> None:
    """Plot the motion of a floor, a close-up of the strongest cycles, and the response spectra with
    a mark at the first period of the building.
    """
    comparison, floor, spectra = row
    history, close_up, spectrum = panels
    event = f"{style.record_name(comparison.event.recording.source)}, " if name_event else ""
    agreement = f"correlation {floor.correlation:.3f}, peak ratio {floor.peak_ratio:.3f}"
    _draw_histories(history, floor, units)
    label = f"{floor.quantity}\n({units.label(_UNITS[floor.quantity])})"
    history.set(xlim=_strong_motion(comparison), ylabel=label)
    history.set_title(
        f"{event}floor {floor.floor}: {agreement}", loc="left", fontsize=8.5, parse_math=False
    )
    _draw_histories(close_up, floor, units)
    close_up.set_xlim(*_strongest_cycles(comparison))
    # Next to the history, the close-up has its axis.
    close_up.tick_params(labelleft=close_up.get_subplotspec().is_first_col())
    for values, color, width in (
        (spectra.recorded, RECORDED, 1.5),
        (spectra.computed, COMPUTED, 0.9),
    ):
        spectrum.plot(spectra.periods, units.of(values, "m/s^2"), color=color, linewidth=width)
    spectrum.set(ylim=(0.0, None), ylabel=f"SA ({units.label('m/s^2')})")
    spectrum.tick_params(axis="x", which="both", labelsize=7.0)
    log_periods(spectrum, spectra.periods)
    style.mark_first_periods(spectrum, [("", period)], color="black")


def _draw_overview(panels: Any, comparisons: Sequence[Comparison]) -> None:
    """Plot the correlation and the peak ratio of every floor in two panels with a common x axis.

    With several events, the x axis is the number of the event, and the highest floor has a dark
    marker. With a single event, the x axis is the number of the floor.
    """
    correlation_axes, ratio_axes = panels
    for event_number, comparison in enumerate(comparisons, start=1):
        for floor in comparison.floors:
            x = event_number if len(comparisons) > 1 else floor.floor
            color = "0.15" if floor is comparison.floors[-1] else style.LIGHT
            correlation_axes.plot([x], [floor.correlation], "o", color=color, markersize=3.0)
            ratio_axes.plot([x], [floor.peak_ratio], "o", color=color, markersize=3.0)
    correlation_axes.set_ylabel("correlation")
    correlation_axes.set_title("all floors, the highest dark", loc="left", fontsize=8.5)
    ratio_axes.set_ylabel("peaks, computed\ndivided by recorded")
    ratio_axes.axhline(1.0, color=style.LIGHT, linewidth=0.8)
    for axes in panels:
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        axes.set_xlabel("event, in the order of the input" if len(comparisons) > 1 else "floor")


def _draw_histories(axes: Any, floor: FloorComparison, units: OutputUnits) -> None:
    """Plot the recorded and the computed motion of a floor over the time in the unit of `units`."""
    unit = _UNITS[floor.quantity]
    axes.plot(floor.time, units.of(floor.recorded, unit), color=RECORDED, linewidth=1.6)
    axes.plot(floor.time, units.of(floor.computed, unit), color=COMPUTED, linewidth=0.7)
    axes.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _strong_motion(comparison: Comparison) -> tuple[float, float]:
    """Return the start and the end of the strong motion of all floors, s; those of the recorded
    motion if they are equal.

    The energy of a floor is the integral of its squared recorded motion. The strong motion starts
    when the first floor reaches the first fraction in `_ENERGY_BOUNDS` of its final energy, and
    ends when the last floor reaches the second fraction.
    """
    times = []
    for floor in comparison.floors:
        energy = np.cumsum(floor.recorded**2)
        for fraction in _ENERGY_BOUNDS:
            times.append(floor.time[int(np.searchsorted(energy, fraction * energy[-1]))])
    if min(times) < max(times):
        return min(times), max(times)
    return comparison.floors[0].time[0], comparison.floors[0].time[-1]


def _strongest_cycles(comparison: Comparison) -> tuple[float, float]:
    """Return the start and the end of a close-up, s.

    The interval contains the `_CYCLES` cycles around the recorded peak of the highest floor. If the
    recording has fewer than two zero crossings near the peak, the interval of the strong motion is
    returned.
    """
    floor = comparison.floors[-1]
    # `zero_crossings` contains the indices of the samples before a change of sign. `middle` is the
    # number of zero crossings before the peak.
    zero_crossings = np.flatnonzero(np.diff(np.signbit(floor.recorded)))
    middle = int(np.searchsorted(zero_crossings, int(np.argmax(np.abs(floor.recorded)))))
    # A cycle has two zero crossings.
    near = zero_crossings[max(0, middle - _CYCLES) : middle + _CYCLES]
    if near.size < 2:
        return _strong_motion(comparison)
    return floor.time[near[0]], floor.time[near[-1]]
