"""Figures of comparisons with recordings, of buildings without ground motion (cyclic tests,
pushovers), of records, and of performance profiles of methods."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullFormatter

from tdint.analysis.defaults import PEAKS
from tdint.arrays import Array
from tdint.ground_motion.measures import cumulative_energy, integrate, time_of_energy
from tdint.ground_motion.record import Record, component_names
from tdint.model.building import assemble
from tdint.number_parsing import pluralize
from tdint.output.figures.legends import add_legend
from tdint.output.figures.spectrum_curves import log_periods
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    LIGHT,
    MARK,
    MARKERS,
    NARROW,
    add_ratio_axis,
    changed,
    is_narrow,
    line_style,
    mark_first_periods,
    method_styles,
    over_stories,
    plain_logarithmic,
    plain_numbers,
    record_name,
    record_names,
    scaled_unit,
    titled,
    write_note,
)
from tdint.output.spectrum_text import spectrum_text
from tdint.output.tables.methods import PEER
from tdint.output.tables.spectra import RecordInfo
from tdint.system import CLOCKS, version_of_sources
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.chart.profiles import FieldChart
    from tdint.analysis.chart.work_precision import PerformanceProfile
    from tdint.analysis.compare import Comparison, FloorComparison, FloorSpectra
    from tdint.analysis.cyclic import CyclicTest
    from tdint.analysis.matching import Match
    from tdint.analysis.pushover import Pushover
    from tdint.analysis.spectra.fourier import FourierSpectrum
    from tdint.analysis.target_displacement import TargetDisplacement

_RECORDED, _COMPUTED = LIGHT, MARK
_MAX_ROWS, _WORST_ROWS = 6, 4
"""Maximum number of floors that have a row of panels each, and the number of floors with a row if
there are more. These are then the floors with the lowest correlation; a fifth row would not fit on
a page with the overview of all floors."""
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
    If there are more than `_MAX_ROWS` floors, only the floors with the lowest correlation have a
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
    has_overview = floor_count > _MAX_ROWS
    if has_overview:
        rows = sorted(rows, key=lambda row: row.floor.correlation)[:_WORST_ROWS]
    # A row of panels is 1.55 inches high. If the figure has the width of a column of a page, the
    # panels of a floor are on two lines, and the labels are wrapped to more lines.
    row_height = 4.4 if is_narrow() else 1.55
    height = 1.5 + row_height * len(rows) + (2.6 if has_overview else 0.0)
    figure = Figure(figsize=(7.5, height), layout="constrained")
    upper: Any = figure
    if has_overview:
        subfigures: Any = figure.subfigures(2, 1, height_ratios=(row_height * len(rows), 2.6))
        upper, lower = subfigures
        _draw_overview(lower.subplots(2, 1, sharex=True), comparisons)
    panels = _floor_panels(upper, len(rows))
    for row, row_panels in zip(rows, panels, strict=True):
        _draw_floor(row_panels, row, units, period, name_event=len(comparisons) > 1)
    for axes, label in zip(panels[-1], ("time (s)", "time (s)", "period (s)"), strict=True):
        axes.set_xlabel(label)
    panels[0][2].set_title(f"spectra, {100.0 * damping:g} %", fontsize=8.5)
    # The legend also states the first period, which the spectra mark.
    lines = [*panels[0][0].get_lines()[:2], *panels[0][2].get_lines()[2:]]
    names = ["recorded", "computed", *(str(line.get_label()) for line in lines[2:])]
    figure.legend(lines, names, loc="outside lower center", ncols=len(lines), handlelength=3.0)
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
        facts.append(f"the {_WORST_ROWS} floors with least agreement; below all {floor_count}")
    return titled(
        figure,
        f"{response.model.name} and {record_name(recording.source)}\n{', '.join(facts)}",
    )


def _floor_panels(figure: Any, count: int) -> list[list[Any]]:
    """Return the panels of `count` floors: history, close-up and spectra of each floor. In one
    column of a page, the history is above the two other panels."""
    if not is_narrow():
        rows = figure.subplots(count, 3, squeeze=False, width_ratios=(2.0, 1.3, 1.5))
        return [list(row) for row in rows]
    grid = figure.add_gridspec(2 * count, 2)
    return [
        [figure.add_subplot(grid[2 * i, :])]
        + [figure.add_subplot(grid[2 * i + 1, column]) for column in range(2)]
        for i in range(count)
    ]


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
    event = f"{record_name(comparison.event.recording.source)}, " if name_event else ""
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
    close_up.tick_params(labelleft=is_narrow())
    for values, color, width in (
        (spectra.recorded, _RECORDED, 1.5),
        (spectra.computed, _COMPUTED, 0.9),
    ):
        spectrum.plot(spectra.periods, units.of(values, "m/s^2"), color=color, linewidth=width)
    spectrum.set(ylim=(0.0, None), ylabel=f"SA ({units.label('m/s^2')})")
    spectrum.tick_params(axis="x", which="both", labelsize=7.0)
    log_periods(spectrum, spectra.periods)
    mark_first_periods(spectrum, [("", period)], color="black")


def _draw_overview(panels: Any, comparisons: Sequence[Comparison]) -> None:
    """Plot the correlation and the peak ratio of every floor in two panels with a common x axis.

    With several events, the x axis is the number of the event, and the highest floor has a dark
    marker. With a single event, the x axis is the number of the floor.
    """
    correlation_axes, ratio_axes = panels
    for event_number, comparison in enumerate(comparisons, start=1):
        for floor in comparison.floors:
            x = event_number if len(comparisons) > 1 else floor.floor
            color = "0.15" if floor is comparison.floors[-1] else LIGHT
            correlation_axes.plot([x], [floor.correlation], "o", color=color, markersize=3.0)
            ratio_axes.plot([x], [floor.peak_ratio], "o", color=color, markersize=3.0)
    correlation_axes.set_ylabel("correlation")
    correlation_axes.set_title("all floors, the highest dark", loc="left", fontsize=8.5)
    ratio_axes.set_ylabel("peaks, computed\ndivided by recorded")
    ratio_axes.axhline(1.0, color=LIGHT, linewidth=0.8)
    ratio_axes.xaxis.set_major_locator(MaxNLocator(12, integer=True))
    ratio_axes.set_xlabel(
        "event, in the order of the command line" if len(comparisons) > 1 else "floor"
    )


def _draw_histories(axes: Any, floor: FloorComparison, units: OutputUnits) -> None:
    """Plot the recorded and the computed motion of a floor over the time in the unit of `units`."""
    unit = _UNITS[floor.quantity]
    axes.plot(floor.time, units.of(floor.recorded, unit), color=_RECORDED, linewidth=1.6)
    axes.plot(floor.time, units.of(floor.computed, unit), color=_COMPUTED, linewidth=0.7)
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


# ---- Figures of buildings without ground motion: cyclic tests and pushovers


def cyclic_picture(test: CyclicTest, units: OutputUnits = SI) -> Figure:
    """Plot a cyclic test of a story: shear over drift, and energies over the cycles.

    Parameters
    ----------
    units : OutputUnits
        Units of drifts, shears and energies; SI by default.
    """
    figure = Figure(figsize=(6.5, 7.6), layout="constrained")
    loop, energy = figure.subplots(2, 1, height_ratios=(2.6, 1.0))
    draw_loop(loop, test, units)
    # Each cycle has four quarters with `points` points. A path of drifts has no cycles, so that the
    # axis counts its steps.
    cycle = np.arange(test.path.drift.size) / (4.0 * test.points if test.points else 1.0)
    factor, unit = scaled_unit(
        float(np.max(test.path.strain_energy + test.path.hysteretic_energy)), "J", units
    )
    energy.plot(cycle, test.path.hysteretic_energy * factor, color=COLORS[0], label="dissipated")
    energy.plot(
        cycle,
        test.path.strain_energy * factor,
        color=COLORS[1],
        linestyle=DASHES[1],
        label="recoverable",
    )
    energy.legend(loc="upper left")
    energy.set(xlim=(0.0, max(cycle[-1], 1.0)), ylim=(min(0.0, energy.get_ylim()[0]), None))
    energy.set(xlabel="cycle" if test.points else "step", ylabel=f"energy ({unit})")
    energy.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
    test_name = "cyclic test" if test.points else "path of drifts"
    subject = f"Story {test.story}, {test.law} law: {test_name} without dashpots"
    return titled(figure, f"{test.model.name}\n{subject}")


def draw_loop(axes: Any, test: CyclicTest, units: OutputUnits) -> None:
    """Plot the shear of a story over its drift, with and without the P-delta effect.

    Parameters
    ----------
    test : CyclicTest
        Cyclic test of the story. If it exceeds the yield drift, the yield drift is marked.
    """
    factor, unit = scaled_unit(float(np.max(np.abs(test.path.shear))), "N", units)
    drift = units.of(test.path.drift, "m")
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.axvline(0.0, color=LIGHT, linewidth=0.6)
    axes.plot(drift, test.path.shear * factor, color=COLORS[0], label="restoring force of the law")
    if test.geometric_stiffness:
        # A dashed line would look solid, because dashes of a cycle fill gaps of other cycles.
        force = test.shear_with_p_delta * factor
        axes.plot(drift, force, color=LIGHT, linewidth=0.9, zorder=1.9, label="with P-delta")
    # The yield drift is outside of the panel if the story remains elastic.
    if test.yield_drift < float(np.max(test.path.drift)):
        yielding = units.of(test.yield_drift, "m")
        label = f"yield drift {yielding:.3g} {units.label('m')}"
        # Only the line at the positive yield drift has a label, so that the legend has one entry.
        style = {"color": LIGHT, "linestyle": DASHES[2], "linewidth": 1.0}
        axes.axvline(yielding, label=label, **style)
        axes.axvline(-yielding, **style)
    if len(axes.get_legend_handles_labels()[0]) > 1:
        axes.legend(loc="upper left")
    axes.set(xlabel=f"drift ({units.label('m')})", ylabel=f"story shear ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
    add_ratio_axis(axes, units.of(test.height, "m"), "drift ratio (%)")


def pushover_picture(result: Pushover, units: OutputUnits = SI) -> Figure:
    """Plot the pushover curve of a building and the drifts of its stories.

    Parameters
    ----------
    units : OutputUnits
        Units of displacements and forces; SI by default.
    """
    narrow = is_narrow()
    figure = Figure(figsize=(8.4, 9.2 if narrow else 4.6), layout="constrained")
    curve, profile = (
        figure.subplots(2, 1) if narrow else figure.subplots(1, 2, width_ratios=(1.7, 1.0))
    )
    draw_curve(curve, result, units)
    _draw_profile(profile, result, units)
    return titled(figure, f"{result.model.name}\nPushover, {result.pattern} pattern")


def draw_curve(axes: Any, result: Pushover, units: OutputUnits) -> None:
    """Plot the base shear over the roof displacement of a pushover, and mark the maximum.

    Parameters
    ----------
    axes : Axes
        The panel. If the model has heights, an axis of the roof drift ratio is added on top.
    """
    factor, unit = scaled_unit(float(np.max(np.abs(result.base_shear))), "N", units)
    roof, shear = units.of(result.roof_displacement, "m"), result.base_shear * factor
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.plot(roof, shear, color=COLORS[0])
    roof_at_maximum, maximum = (
        units.of(result.roof_at_largest, "m"),
        result.largest_base_shear * factor,
    )
    axes.plot(
        roof_at_maximum,
        maximum,
        "o",
        color=COLORS[0],
        label=f"maximum base shear {maximum:.4g} {unit}",
    )
    axes.legend(loc="best", frameon=True, framealpha=1.0, edgecolor="none")
    axes.set(
        xlim=(0.0, np.max(roof)),
        xlabel=f"roof displacement ({units.label('m')})",
        ylabel=f"base shear ({unit})",
    )
    add_ratio_axis(axes, units.of(result.height, "m"), "roof drift ratio (%)")


def target_picture(results: Sequence[TargetDisplacement], units: OutputUnits = SI) -> Figure:
    """Plot the target displacements of a building that several methods give.

    The panels show the pushover curve with its idealizations, the equivalent oscillator with the
    elastic demand (acceleration over displacement), and the story drifts at each target.

    Parameters
    ----------
    results : sequence of TargetDisplacement
        Results of the methods for a single pushover; the result of the method `n2` is required.
    units : OutputUnits
        Units of displacements, forces and accelerations; SI by default.
    """
    pushed = results[0].pushed
    narrow = is_narrow()
    figure = Figure(figsize=(8.6, 11.0 if narrow else 3.2), layout="constrained")
    curve, adrs, profile = (
        figure.subplots(3, 1) if narrow else figure.subplots(1, 3, width_ratios=(1.5, 1.5, 1.0))
    )
    draw_curve(curve, pushed, units)
    factor, _ = scaled_unit(float(np.max(np.abs(pushed.base_shear))), "N", units)
    for i, result in enumerate(results):
        plot_style = line_style(i + 1) | {"label": result.method}
        corners = [0.0, result.yield_displacement, result.roof_displacement]
        # The idealized curve of the N2 method is horizontal after yield.
        end_force = result.yield_force if result.method == "n2" else result.base_shear
        shears = np.array([0.0, result.yield_force, end_force]) * factor
        # An idealized curve without yielding before the target is a single line.
        count = 3 if result.roof_displacement > result.yield_displacement else 2
        curve.plot(units.of(np.array(corners[:count]), "m"), shears[:count], **plot_style)
        curve.plot(
            units.of(result.roof_displacement, "m"),
            result.base_shear * factor,
            MARKERS[i],
            color=COLORS[i + 1],
        )
    curve.legend(loc="best", frameon=True, framealpha=1.0, edgecolor="none")
    n2 = next(result for result in results if result.method == "n2")
    _draw_oscillator(adrs, n2, units)
    drifts = [(result.drift, i + 1, result.method) for i, result in enumerate(results)]
    _draw_profile(profile, pushed, units, drifts)
    return titled(
        figure,
        f"{pushed.model.name}\nPushover, {pushed.pattern} pattern, under "
        f"{spectrum_text(n2.target.source)}",
    )


def _draw_oscillator(axes: Any, result: TargetDisplacement, units: OutputUnits) -> None:
    """Plot the equivalent oscillator of the N2 method and the elastic demand as acceleration over
    displacement.

    The displacement of the oscillator is the roof displacement divided by the participation factor.
    Its acceleration is the base shear divided by the participation factor and by its mass. A dashed
    line from the origin with the period T* leads to the elastic demand.
    """
    target, pushed = result.target, result.pushed
    displacement, acceleration = (
        pushed.roof_displacement / result.participation,
        pushed.base_shear / result.participation / result.mass,
    )
    axes.plot(
        units.of(target.sd, "m"), units.of(target.psa, "m/s^2"), color=LIGHT, label="elastic demand"
    )
    axes.plot(
        units.of(displacement, "m"),
        units.of(acceleration, "m/s^2"),
        color=COLORS[0],
        label="equivalent oscillator",
    )
    idealized_roof = np.array(
        [0.0, result.yield_displacement, max(result.yield_displacement, result.roof_displacement)]
    )
    idealized_acceleration = np.array([0.0, result.yield_force, result.yield_force]) / result.mass
    idealized = (
        units.of(idealized_roof / result.participation, "m"),
        units.of(idealized_acceleration / result.participation, "m/s^2"),
    )
    axes.plot(*idealized, **line_style(1) | {"label": f"idealized, T* {result.period:.3g} s"})
    # The spectral displacement of the elastic oscillator is Sd = Sa / omega^2.
    elastic = result.spectral_acceleration * (result.period / (2.0 * math.pi)) ** 2
    elastic_line = (
        np.array([0.0, units.of(elastic, "m")]),
        np.array([0.0, units.of(result.spectral_acceleration, "m/s^2")]),
    )
    axes.plot(*elastic_line, color=LIGHT, linestyle=DASHES[2])
    target_displacement = result.roof_displacement / result.participation
    axes.plot(
        units.of(target_displacement, "m"),
        idealized[1][-1],
        MARKERS[0],
        color=COLORS[1],
        label="target displacement",
    )
    axes.legend(loc="best", frameon=True, framealpha=1.0, edgecolor="none")
    # The axis ends before the long periods of the demand, which are far to the right of the target
    # displacement.
    axis_end = 1.6 * max(target_displacement, elastic)
    axes.set(xlim=(0.0, units.of(axis_end, "m")), ylim=(0.0, None))
    axes.set(
        xlabel=f"displacement ({units.label('m')})", ylabel=f"acceleration ({units.label('m/s^2')})"
    )


def _draw_profile(
    axes: Any,
    result: Pushover,
    units: OutputUnits,
    drifts: Sequence[tuple[Array, int, str]] | None = None,
) -> None:
    """Plot story drifts over the stories; drift ratios if the heights of all stories are known.

    By default, the drifts (m, number of color, label) are those at the maximum base shear (dashed)
    and at the end.
    """
    heights = [story.drift_height for story in result.model.stories]
    has_ratios = all(height is not None for height in heights)
    if has_ratios:
        scale = 100.0 / np.array(heights, float)
    else:
        scale = np.full(len(heights), 1.0 / units.unit("m")[1])
    # Different dashes, because two methods often result in the same drifts.
    lines = [
        (drift, DASHES[number % len(DASHES)], COLORS[number], label)
        for drift, number, label in drifts or ()
    ]
    if not lines:
        lines = [
            (result.drift_at_largest, DASHES[1], COLORS[0], "at the maximum base shear"),
            (result.drift[-1], DASHES[0], COLORS[0], "at the end"),
        ]
    for drift, dashes, color, label in lines:
        over_stories(axes, drift * scale, baseline=None, linestyle=dashes, color=color, label=label)
    axes.axvline(0.0, color=LIGHT, linewidth=0.6)
    axes.legend(loc="best")
    axes.yaxis.get_major_locator().set_params(integer=True)
    axis_label = "drift ratio (%)" if has_ratios else f"drift ({units.label('m')})"
    axes.set(ylim=(0.5, len(heights) + 0.5), ylabel="story", xlabel=axis_label)


# ---- Figure of records: acceleration, velocity, displacement and cumulative Arias intensity

_MIN_AMPLITUDE = 1e-4
"""Lower end of the axis of Fourier amplitudes divided by the maximum amplitude. Filters of the
record leave smaller amplitudes, which have no meaning."""

MOST_RECORDS = 3
"""Maximum number of records in a figure; further records are omitted."""

_ENERGY_FRACTIONS = (0.05, 0.75, 0.95)
"""Fractions of the Arias intensity that bound the significant durations D5-75 and D5-95."""
_MOTION = {"acceleration": "m/s^2", "velocity": "m/s", "displacement": "m"}
"""Quantities over time from top to bottom, with their SI units."""


def info_picture(infos: Sequence[RecordInfo], units: OutputUnits = SI) -> Figure:
    """Plot acceleration, velocity, displacement and Arias intensity of records over the time.

    Each record has a column; only the first `MOST_RECORDS` records are plotted.

    Parameters
    ----------
    infos : sequence of RecordInfo
        Records with their intensity measures; at least one.
    """
    infos = infos[:MOST_RECORDS]
    units = units.in_figures
    figure = Figure(
        figsize=(7.5 if len(infos) == 1 else 5.0 * len(infos), 8.5), layout="constrained"
    )
    grid = figure.subplots(4, len(infos), sharex="col", sharey="row", squeeze=False)
    for column, info in zip(grid.T, infos, strict=True):
        _draw_record(column, info, units)
    for axes, (name, si) in zip(grid[:, 0], _MOTION.items(), strict=False):
        axes.set_ylabel(f"{name} ({units.label(si)})")
    grid[-1, 0].set_ylabel("Arias intensity (%)")
    return figure


def match_picture(matched: Match, units: OutputUnits = SI) -> Figure:
    """Plot a spectrally matched ground motion and the scaled record from which it was computed.

    The upper panel shows the response spectra with the target spectrum. The panels below show
    acceleration, velocity, displacement and Arias intensity of each component over the time.
    """
    from tdint.analysis.spectra.target import source_of

    units = units.in_figures
    parts = matched.parts
    figure = Figure(figsize=(7.5 if len(parts) == 1 else 10.0, 9.5), layout="constrained")
    grid = figure.add_gridspec(5, len(parts), height_ratios=(2.2, 1, 1, 1, 1))
    draw_match(figure.add_subplot(grid[0, :]), matched, units)
    for column, part in enumerate(parts):
        panels = [figure.add_subplot(grid[row, column]) for row in range(1, 5)]
        # The seed is plotted first, so that the matched ground motion is in front. The first item
        # of `motions` is the matched ground motion, the first style of `_MATCHED` is for the seed.
        for record, motion, plot_style in zip(
            (part.before, part.after), part.motions[::-1], _MATCHED.values(), strict=True
        ):
            energy = np.cumsum(record.acceleration**2)
            time = record.dt * np.arange(record.acceleration.size)
            motions = (record.acceleration, motion.velocity, motion.displacement)
            for axes, values, si in zip(panels, motions, _MOTION.values(), strict=False):
                axes.plot(time, units.of(values, si), **plot_style)
            panels[3].plot(time, 100.0 * (energy / energy[-1]), **plot_style)
        panels[3].set_xlabel("time (s)")
        if column == 0:
            for axes, (name, si) in zip(panels, _MOTION.items(), strict=False):
                axes.set_ylabel(f"{name} ({units.label(si)})")
            panels[3].set_ylabel("Arias intensity (%)")
        if len(parts) > 1:
            panels[0].set_title(part.after.component, fontsize="medium")
    subject = f"{record_name(matched.seed.source)} {matched.seed.component}".rstrip()
    source = source_of([spectrum.target for spectrum in matched.by_damping])
    target = spectrum_text(source) if matched.target.curve else record_name(source)
    pair_text = ", RotD100" if len(parts) > 1 else ""
    ratios = ", ".join(f"{100.0 * spectrum.damping:g}" for spectrum in matched.by_damping)
    return titled(figure, f"{subject} matched to {target}\n{ratios} % damping{pair_text}")


_MATCHED: dict[str, dict[str, Any]] = {
    "scaled seed": {"color": "0.6", "linewidth": 0.9},
    "matched": {"color": COLORS[0], "linewidth": 0.9},
}
"""Line style of the record before and after spectral matching, by the label in the legend."""


def draw_match(axes: Any, matched: Match, units: OutputUnits) -> None:
    """Plot the response spectra of a matched ground motion and of its scaled seed, and the target.

    The axes contain the spectra for each damping ratio; the legend has a single entry for all
    ratios. Periods outside of the matched range have a gray background.

    Parameters
    ----------
    matched : Match
        Result of the matching. For a pair, the spectra of both components are plotted also.
    """
    shortest, longest = float(matched.periods[0]), float(matched.periods[-1])
    periods = matched.shown_periods
    for number, spectrum in enumerate(matched.by_damping):
        # matplotlib omits labels with a leading underscore from the legend.
        hidden = "_" if number else ""
        target = spectrum.target
        inside = (periods >= target.periods[0]) & (periods <= target.periods[-1])
        values = units.of(target.at(periods[inside]), "m/s^2")
        axes.plot(periods[inside], values, color=COLORS[1], linewidth=2.2, label=f"{hidden}target")
        # The first item of `spectra` is the demand that was matched. For a pair, the spectra of the
        # two components follow. Each item contains the matched ground motion and the seed.
        spectra = spectrum.spectra_at(periods)
        for psa, (name, plot_style) in zip(spectra[0][::-1], _MATCHED.items(), strict=True):
            axes.plot(periods, units.of(psa, "m/s^2"), label=f"{hidden}{name}", **plot_style)
        for part, (after, _), style in zip(spectrum.parts, spectra[1:], (":", "--"), strict=False):
            name = f"{hidden}matched, {part.after.component or 'component'}"
            plot_style = _MATCHED["matched"] | {"linestyle": style}
            axes.plot(periods, units.of(after, "m/s^2"), label=name, **plot_style)
    # The gray background marks the periods outside of the matched range.
    for first, last in ((periods[0], shortest), (longest, periods[-1])):
        if first < last:
            axes.axvspan(first, last, color="0.92", zorder=0)
    axes.set(xscale="log", yscale="log", xlabel="period (s)", xlim=(periods[0], periods[-1]))
    axes.set_ylabel(f"Sa ({units.label('m/s^2')})")
    plain_logarithmic(axes)
    axes.legend(loc="lower left")


def fourier_picture(spectra: Sequence[FourierSpectrum], units: OutputUnits = SI) -> Figure:
    """Plot Fourier amplitude spectra on logarithmic axes, with a line per component.

    Parameters
    ----------
    spectra : sequence of FourierSpectrum
        Spectra with the same smoothing; at least one.
    """
    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    axes = figure.subplots()
    draw_fourier(axes, spectra, units)
    sources = list(dict.fromkeys(spectrum.record.source for spectrum in spectra))
    subject = record_name(sources[0]) if len(sources) == 1 else f"{len(sources)} records"
    if len(spectra) == 1:
        subject = f"{subject} {spectra[0].record.component}".rstrip()
    subject += changed(spectrum.record for spectrum in spectra)
    # The bandwidth coefficient b of Konno and Ohmachi is nan for a spectrum without smoothing.
    b = spectra[0].bandwidth
    smoothing = "not smoothed" if math.isnan(b) else f"Konno-Ohmachi smoothing, b = {b:g}"
    return titled(figure, f"Fourier amplitude spectrum of {subject}\n{smoothing}")


def draw_fourier(axes: Any, spectra: Sequence[FourierSpectrum], units: OutputUnits) -> None:
    """Plot Fourier amplitudes over the frequency, down to four decades below the maximum.

    Parameters
    ----------
    units : OutputUnits
        Unit of the amplitudes; m/s in SI.
    """
    files = record_names(spectrum.record.source for spectrum in spectra)
    names = component_names([spectrum.record for spectrum in spectra])
    for number, (spectrum, name) in enumerate(zip(spectra, names, strict=True)):
        label = ", ".join(
            filter(None, (files[spectrum.record.source] if len(files) > 1 else "", name))
        )
        amplitude = units.of(spectrum.amplitude, "m/s")
        axes.plot(
            spectrum.frequencies, amplitude, label=label, **line_style(number) | {"linewidth": 1.0}
        )
    axes.set(xscale="log", yscale="log")
    axes.set(xlabel="frequency (Hz)", ylabel=f"Fourier amplitude ({units.label('m/s')})")
    largest = max(float(np.max(spectrum.amplitude)) for spectrum in spectra)
    axes.set_ylim(units.of(_MIN_AMPLITUDE * largest, "m/s") or None, None)
    plain_numbers(axes.xaxis)
    if len(spectra) > 1:
        axes.legend(loc="best")


def draw_acceleration(axes: Any, record: Record, units: OutputUnits) -> None:
    """Plot the acceleration of a record over the time in a panel with its peak as text."""
    time = np.arange(record.acceleration.size) * record.dt
    axes.plot(time, units.of(record.acceleration, "m/s^2"), color=COLORS[0], linewidth=0.8)
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.set(
        xlim=(time[0], time[-1]), xlabel="time (s)", ylabel=f"acceleration ({units.label('m/s^2')})"
    )
    write_note(axes, f"peak {units.of(record.pga, 'm/s^2'):.3g} {units.label('m/s^2')}")


def _draw_record(column: Any, info: RecordInfo, units: OutputUnits) -> None:
    """Plot acceleration, velocity, displacement and Husid plot of a record over the time.

    `info`: record with its intensity measures, whose values are written in the panels.
    """
    record, measures = info.record, info.measures
    motion = integrate(record)
    time = np.arange(record.acceleration.size) * record.dt
    peaks = (measures.pga, measures.pgv, measures.pgd)
    motions = (record.acceleration, motion.velocity, motion.displacement)
    for axes, values, peak, si in zip(column, motions, peaks, _MOTION.values(), strict=False):
        axes.plot(time, units.of(values, si), color=COLORS[0], linewidth=0.8)
        axes.axhline(0.0, color=LIGHT, linewidth=0.6)
        axes.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
        write_note(axes, f"peak {units.of(peak, si):.3g} {units.label(si)}")
    # `changed` returns a suffix for a scaled or processed record, such as ` x 1.7 (processed)`.
    title = f"{record_name(record.source)} {record.component}".rstrip() + changed([record])
    column[0].set_title(title, parse_math=False)
    # A Husid plot (1969) shows the integral of the squared acceleration divided by its final value.
    # Its marks bound the significant durations.
    energy = cumulative_energy(record)
    total = float(energy[-1])
    husid = column[3]
    husid.set_ylim(-2.0, 102.0)
    if total > 0.0:
        husid.plot(time, 100.0 * energy / total, color=COLORS[0])
        times = [time_of_energy(record, energy, fraction) for fraction in _ENERGY_FRACTIONS]
        percentages = [100.0 * fraction for fraction in _ENERGY_FRACTIONS]
        husid.plot(times, percentages, "o", color=MARK, markersize=4)
        text = f"{units.of(measures.arias, 'm/s'):.3g} {units.label('m/s')}\n"
        text += f"D5-75 {measures.d5_75:.3g} s\nD5-95 {measures.d5_95:.3g} s"
        write_note(husid, text, y=0.5)
    husid.set(xlim=(time[0], time[-1]), xlabel="time (s)")


# ---- Performance profiles: methods compared over many problems

_MAX_COST_RATIO = 30.0  # end of the axis of cost ratios; slower methods are not of interest
_BOLD = {"impulse4": 2.4, "moment4": 2.4, "newmark-average": 2.0}
"""Line widths (points) of emphasized methods: the methods that tdint recommends, and the method
that most programs use."""

_PROFILE_FOOT, _NARROW_FOOT = 110, 64
"""Characters per line of the footnote in a figure of full width, and in a figure with the width of
one column of a page."""


def profile_picture(chart: FieldChart, *, target: str, highlight: str = "") -> Figure:
    """Plot performance profiles (Dolan and More 2002), with a panel for each tolerance.

    A profile is the fraction of problems that a method solves within a factor of the minimum cost.

    Parameters
    ----------
    target : str
        Quantity of the error, a key of `PEAKS`.
    highlight : str
        Method that has a thick line in front of the other lines; empty by default, which emphasizes
        the methods in `_BOLD`.
    """
    quantity = target.replace("-", "_")
    profiles = [profile for profile in chart.profiles if profile.quantity == quantity]
    tolerances = sorted({profile.tolerance for profile in profiles}, reverse=True)
    narrow = is_narrow()
    figure = Figure(figsize=(7.5, 9.0 if narrow else 5.4), layout="constrained")
    panels = figure.subplots(*(3, 2) if narrow else (2, 3), sharex=True, sharey=True)
    plot_styles = method_styles(chart.lines, highlight)
    handles: dict[str, Any] = {}
    for axes, tolerance in zip(panels.flat, tolerances, strict=False):
        shown = [profile for profile in profiles if profile.tolerance == tolerance]
        handles |= _plot_profiles(axes, shown, plot_styles)
        count = max(profile.problems for profile in shown)
        axes.set_title(f"error within {100.0 * tolerance:g} % ({pluralize(count, 'problem')})")
    for axes in panels.flat[len(tolerances) :]:
        axes.set_axis_off()
    for axes in panels[:, 0]:
        axes.set_ylabel("fraction of problems solved")
    for axes in panels[-1]:
        axes.set_xlabel("time divided by minimum time")
    shown_lines = [line for line in chart.lines if line in handles]
    add_legend(
        figure,
        panels[0, 0],
        [handles[line] for line in shown_lines],
        [
            # The second text is empty (times False) if the method was run for all problems.
            chart.named(line)
            + ", partly not run" * any(p.not_run for p in profiles if p.method == line)
            for line in shown_lines
        ],
        NARROW,
    )
    _add_profile_footnote(figure, chart, narrow)
    return titled(
        figure,
        f"Performance profiles over {pluralize(len(chart.measured), 'problem')}\n{PEAKS[target]}",
    )


def _plot_profiles(
    axes: Any, profiles: Sequence[PerformanceProfile], plot_styles: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    """Plot the performance profiles of all methods for a single tolerance, over the cost divided by
    the minimum cost.

    If a line style (`method_styles`) has a line width, its method is emphasized instead of the
    methods in `_BOLD`.
    """
    line_widths = {
        method: plot_style["linewidth"]
        for method, plot_style in plot_styles.items()
        if "linewidth" in plot_style
    } or _BOLD
    lines: dict[str, Any] = {}
    # Emphasized methods are plotted last, so that their lines are in front.
    for profile in sorted(profiles, key=lambda profile: line_widths.get(profile.method, 0.0)):
        # The profile rises by a single problem at each cost ratio. At the end of the panel it
        # reaches the fraction of problems that the method solves within the maximum cost ratio.
        ratios = [ratio for ratio in profile.ratios if ratio <= _MAX_COST_RATIO]
        solved_fractions = np.arange(len(ratios) + 1) / max(profile.problems, 1)
        x, y = [1.0, *ratios, _MAX_COST_RATIO], [*solved_fractions, solved_fractions[-1]]
        plot_style = plot_styles[profile.method] | {"markersize": 3.5, "markevery": 0.2}
        plot_style |= {"linewidth": line_widths.get(profile.method, 1.0)}
        # Methods of other programs have hollow markers.
        plot_style |= {"markerfacecolor": "white"} if PEER in profile.method else {}
        (lines[profile.method],) = axes.step(x, y, where="post", **plot_style)
    axes.set(xscale="log", xlim=(1.0, _MAX_COST_RATIO), ylim=(0.0, 1.03))
    axes.xaxis.set_major_locator(FixedLocator([1.0, 2.0, 5.0, 10.0, 30.0]))
    axes.xaxis.set_minor_formatter(NullFormatter())
    plain_numbers(axes.xaxis)
    axes.axvline(2.0, color=LIGHT, linewidth=0.6)
    return lines


def _add_profile_footnote(figure: Figure, chart: FieldChart, narrow: bool) -> None:
    """Write the conditions of the measurement below performance profiles: clock, processor and
    versions of the programs.

    The text is the title of the legend, because the layout reserves space for a legend. A figure of
    a single method has no legend and no such text.
    """
    timing = chart.timing
    programs = [
        f"tdint {version_of_sources()[0]}",
        *(f"{peer.name} {peer.version}" for peer in chart.peers),
    ]
    conditions = (
        "Each method has the cheapest time step that is within the tolerance together with all "
        "smaller time steps; lines end at the fraction solved within "
        f"{_MAX_COST_RATIO:g} times the minimum cost. Times: "
        f"{CLOCKS[timing.clock]}, {timing.description}, {timing.processor}; {', '.join(programs)}"
    )
    for legend in figure.legends:
        footnote = wrap(conditions, _NARROW_FOOT if narrow else _PROFILE_FOOT)
        figure.set_figheight(figure.get_figheight() + (0.3 if narrow else 0.14) * len(footnote))
        legend.set_title("\n".join(footnote), prop={"size": 7.5})  # type: ignore[arg-type]
        legend.get_title().set_multialignment("center")
