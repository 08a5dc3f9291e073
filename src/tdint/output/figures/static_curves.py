"""Figures of comparisons with recordings, of buildings without ground motion (cyclic tests,
pushovers) and of records."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.arrays import Array, max_absolute
from tdint.ground_motion.measures import cumulative_energy, integrate, time_of_energy
from tdint.ground_motion.record import Record, component_names
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    INK,
    LIGHT,
    MARK,
    MARKERS,
    ZERO,
    Style,
    add_ratio_axis,
    changed,
    drift_scale,
    line_style,
    motion_name,
    new_axes,
    new_panels,
    over_stories,
    plain_numbers,
    psa_label,
    record_name,
    record_names,
    scaled_unit,
    titled,
    write_note,
)
from tdint.output.spectrum_text import spectrum_text
from tdint.output.tables.spectra import RecordInfo
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.response.runs.history import History
    from tdint.response.spectra.fourier import FourierSpectrum
    from tdint.response.static.cyclic import CyclicTest
    from tdint.response.static.pushover import Pushover
    from tdint.response.static.target_displacement import TargetDisplacement

RECORDED, COMPUTED = LIGHT, INK
MAX_ROWS, WORST_ROWS = 4, 3
"""Maximum number of floors with one row of panels per floor, and the number of rows if there are
more floors. These are then the floors with the lowest correlation. In a column of a page, a row has
two lines, so that a fifth row would not fit on the page."""


# ---- Figures of buildings without ground motion: cyclic tests and pushovers


def cyclic_picture(test: CyclicTest, units: OutputUnits = SI) -> Figure:
    """Plot a cyclic test of a story: shear over drift, and energies over the cycles.

    Parameters
    ----------
    units : OutputUnits
        Units of drifts, shears and energies; SI by default.
    """
    figure, ((loop,), (energy,)) = new_panels(6.5, (5.4, (1,)), (2.2, (1,)))
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
    factor, unit = scaled_unit(max_absolute(test.path.shear), "N", units)
    drift = units.of(test.path.drift, "m")
    axes.axhline(0.0, **ZERO)
    axes.axvline(0.0, **ZERO)
    axes.plot(drift, test.path.shear * factor, color=COLORS[0], label="restoring force of the law")
    if test.geometric_stiffness:
        # A dashed line would look solid, because dashes of a cycle fill gaps of other cycles.
        force = test.shear_with_p_delta * factor
        axes.plot(drift, force, color=LIGHT, linewidth=0.9, zorder=1.9, label="with P-delta")
    # The yield drift is outside of the panel if the story remains elastic.
    if test.yield_drift < float(np.max(test.path.drift)):
        yielding = units.of(test.yield_drift, "m")
        label = f"yield drift {yielding:.3g} {units.label('m')}"
        # Only the line at the positive yield drift has a label, so that the legend has an entry.
        style = {"color": LIGHT, "linestyle": DASHES[2], "linewidth": 1.0}
        axes.axvline(yielding, label=label, **style)
        axes.axvline(-yielding, **style)
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
    figure, ((curve, profile),) = new_panels(8.4, (4.6, (5, 3)))
    draw_curve(curve, result, units)
    drifts = [
        (result.drift_at_largest, DASHES[1], COLORS[0], "at the maximum applied force"),
        (result.drift[-1], DASHES[0], COLORS[0], "at the end"),
    ]
    _draw_profile(profile, result, units, drifts)
    return titled(figure, f"{result.model.name}\nPushover, {result.pattern} pattern")


def draw_curve(axes: Any, result: Pushover, units: OutputUnits) -> None:
    """Plot the applied force over the roof displacement of a pushover, and mark the maximum.

    Parameters
    ----------
    axes : Axes
        The panel. If the model has heights, an axis of the roof drift ratio is added on top.
    """
    factor, unit = scaled_unit(max_absolute(result.applied_force), "N", units)
    roof, shear = units.of(result.roof_displacement, "m"), result.applied_force * factor
    axes.axhline(0.0, **ZERO)
    axes.plot(roof, shear, color=COLORS[0])
    roof_at_maximum = units.of(result.roof_at_largest, "m")
    maximum = result.largest_applied_force * factor
    axes.plot(
        roof_at_maximum,
        maximum,
        "o",
        color=COLORS[0],
        label=f"maximum applied force {maximum:.4g} {unit}",
    )
    axes.set(
        xlim=(0.0, np.max(roof)),
        xlabel=f"roof displacement ({units.label('m')})",
        ylabel=f"applied force ({unit})",
    )
    add_ratio_axis(axes, units.of(result.height, "m"), "roof drift ratio (%)")


def run_and_pushover_picture(history: History, pushed: Pushover, units: OutputUnits = SI) -> Figure:
    """Plot the base shear of a run over the roof drift, with the pushover curve of the building.

    Both base shears are restoring forces of the first story.
    """
    units = units.in_figures
    figure, axes = new_axes(7.0, 2.6)
    shear = history.shear[:, 0]
    roof, height = history.displacement[:, -1], pushed.height
    scale, label = 1.0 / units.unit("m")[1], f"roof displacement ({units.label('m')})"
    if not math.isnan(height):
        scale, label = 100.0 / height, "roof drift ratio (%)"
    largest = max(max_absolute(values) for values in (shear, pushed.base_shear))
    factor, unit = scaled_unit(largest, "N", units)
    axes.plot(scale * roof, factor * shear, color=LIGHT, linewidth=0.8, label="run")
    # The pushover has the sign of the larger side of the run.
    sign = math.copysign(1.0, roof[np.argmax(np.abs(roof))])
    x, y = sign * scale * pushed.roof_displacement, sign * factor * pushed.base_shear
    axes.plot(x, y, color=MARK, label=f"pushover, {pushed.pattern} pattern")
    axes.axhline(0.0, **ZERO)
    axes.axvline(0.0, **ZERO)
    axes.set(xlabel=label, ylabel=f"base shear ({unit})")
    return figure


_TARGET_METHODS = {"n2": "EN 1998-1 (N2)", "coefficients": "ASCE 41 (coefficients)"}
"""Names of the methods of target displacements in legends."""


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
    pushed, units = results[0].pushed, units.in_figures
    figure, ((curve, adrs, profile),) = new_panels(8.6, (4.0, (3, 3, 2)))
    draw_curve(curve, pushed, units)
    factor, _ = scaled_unit(max_absolute(pushed.applied_force), "N", units)
    for i, result in enumerate(results):
        plot_style = line_style(i + 1) | {"label": _TARGET_METHODS[result.method]}
        corners = [0.0, result.yield_displacement, result.roof_displacement]
        # The idealized curve of the N2 method is horizontal after yield.
        end_force = result.yield_force if result.method == "n2" else result.applied_force
        shears = np.array([0.0, result.yield_force, end_force]) * factor
        # An idealized curve without yielding before the target is a single line.
        count = 3 if result.roof_displacement > result.yield_displacement else 2
        curve.plot(units.of(np.array(corners[:count]), "m"), shears[:count], **plot_style)
        curve.plot(
            units.of(result.roof_displacement, "m"),
            result.applied_force * factor,
            MARKERS[i],
            color=COLORS[i + 1],
        )
    n2 = next(result for result in results if result.method == "n2")
    _draw_oscillator(adrs, n2, units)
    # Different dashes, because two methods often result in the same drifts.
    drifts = [
        (result.drift, DASHES[i % len(DASHES)], COLORS[i], _TARGET_METHODS[result.method])
        for i, result in enumerate(results, start=1)
    ]
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
    Its acceleration is the applied force divided by the participation factor and by its mass. A
    dashed line from the origin with the period T* leads to the elastic demand.
    """
    target, pushed = result.target, result.pushed
    displacement = pushed.roof_displacement / result.participation
    acceleration = pushed.applied_force / result.participation / result.mass
    # Beyond the largest displacement, the demand of long periods would look like another line.
    shown = slice(int(np.argmax(target.sd)) + 1)
    periods, sd = target.periods[shown], units.of(target.sd[shown], "m")
    psa = units.of(target.psa[shown], "m/s^2")
    axes.plot(sd, psa, color=LIGHT, label="elastic demand")
    # The inelastic demand of a ductility follows from the rule of the method: the displacement
    # ratio of annex B is ductility / reduction.
    ductility = max(result.roof_displacement / result.yield_displacement, 1.0)
    short = np.where(periods < target.corner, periods / target.corner, 1.0)
    reduction = 1.0 + (ductility - 1.0) * short
    style = {"color": LIGHT, "linestyle": DASHES[3], "label": f"ductility {ductility:.3g}"}
    axes.plot(sd * ductility / reduction, psa / reduction, **style)
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
    # The axis ends before the long periods of the demand, which are far to the right of the target
    # displacement.
    axis_end = 1.6 * max(target_displacement, elastic)
    axes.set(xlim=(0.0, units.of(axis_end, "m")), ylim=(0.0, None))
    axes.set(xlabel=f"displacement SD ({units.label('m')})", ylabel=psa_label(units))


def _draw_profile(
    axes: Any, result: Pushover, units: OutputUnits, drifts: Sequence[tuple[Array, Any, str, str]]
) -> None:
    """Plot story drifts (m, dashes, color, label) over the stories; drift ratios if the heights of
    all stories are known."""
    heights = np.array([story.drift_height for story in result.model.stories], float)
    scale, axis_label = drift_scale(heights, units)
    for drift, dashes, color, label in drifts:
        over_stories(axes, drift * scale, baseline=None, linestyle=dashes, color=color, label=label)
    axes.axvline(0.0, **ZERO)
    axes.yaxis.get_major_locator().set_params(integer=True)
    axes.set(ylim=(0.5, len(heights) + 0.5), ylabel="story", xlabel=axis_label)


# ---- Figure of records: acceleration, velocity, displacement and cumulative Arias intensity

_MIN_AMPLITUDE = 1e-4
"""Lower end of the axis of Fourier amplitudes divided by the maximum amplitude. Filters of the
record produce smaller amplitudes, which have no meaning."""

MOST_RECORDS = 3
"""Maximum number of records in a figure; further records are omitted."""

_ENERGY_FRACTIONS = (0.05, 0.75, 0.95)
"""Fractions of the Arias intensity that bound the significant durations D5-75 and D5-95."""
MOTION = {"acceleration": "m/s^2", "velocity": "m/s", "displacement": "m"}
"""Quantities over time from top to bottom, with their SI units."""


def info_picture(infos: Sequence[RecordInfo], units: OutputUnits = SI) -> Figure:
    """Plot acceleration, velocity, displacement and Arias intensity of a record over the time, or
    the accelerations of several records with their Arias intensities in one panel.

    Only the first `MOST_RECORDS` records are plotted.

    Parameters
    ----------
    infos : sequence of RecordInfo
        Records with their intensity measures; at least one.
    """
    shown, units = infos[:MOST_RECORDS], units.in_figures
    if len(shown) == 1:
        figure, panels = new_panels(7.5, *[(2.1, (1,))] * 4, share="x")
        _draw_record([axes for (axes,) in panels], shown[0], units)
        return figure
    rows = [*[(1.6, (1,))] * len(shown), (2.6, (1,))]
    figure, panels = new_panels(7.5, *rows, share="x")
    (husid,) = panels[-1]
    for number, ((axes,), info) in enumerate(zip(panels, shown, strict=False)):
        record, name = info.record, motion_name(info.record) + changed([info.record])
        draw_acceleration(axes, record, units)
        axes.set(xlabel="", ylabel=f"({units.label('m/s^2')})")
        axes.set_title(name, loc="left", parse_math=False)
        energy = cumulative_energy(record)
        style = line_style(number) | {"label": f"{name}, D5-95 {info.measures.d5_95:.3g} s"}
        husid.plot(record.time, 100.0 * energy / max(energy[-1], _TINY), **style)
    husid.set(xlabel="time (s)", ylabel="Arias intensity (%)")
    husid.set_xlim(0.0, max(info.record.time[-1] for info in shown))
    if len(infos) > len(shown):
        titled(figure, f"The first {len(shown)} of {len(infos)} records")
    return figure


_TINY = 1e-300  # m/s; Arias intensity that replaces zero in a quotient

MATCHED: dict[str, Style] = {
    "scaled seed": {"color": "0.6", "linewidth": 0.9},
    "matched": {"color": COLORS[0], "linewidth": 0.9},
}
"""Line style of the record before and after spectral matching, by the label in the legend."""


def fourier_picture(spectra: Sequence[FourierSpectrum], units: OutputUnits = SI) -> Figure:
    """Plot Fourier amplitude spectra on logarithmic axes, with a line per component.

    Parameters
    ----------
    spectra : sequence of FourierSpectrum
        Spectra with the same smoothing; at least one.
    """
    figure, axes = new_axes(7.5, 5.0)
    draw_fourier(axes, spectra, units)
    sources = list(dict.fromkeys(spectrum.record.source for spectrum in spectra))
    subject = record_name(sources[0]) if len(sources) == 1 else f"{len(sources)} records"
    if len(spectra) == 1:
        subject = motion_name(spectra[0].record)
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
    amplitudes = np.concatenate([spectrum.amplitude for spectrum in spectra])
    smallest = max(_MIN_AMPLITUDE * float(np.max(amplitudes)), float(np.min(amplitudes)))
    axes.set_ylim(0.8 * units.of(smallest, "m/s") or None, None)
    plain_numbers(axes.xaxis)


def draw_acceleration(axes: Any, record: Record, units: OutputUnits) -> None:
    """Plot the acceleration of a record over the time in a panel with its peak as text."""
    time = record.time
    axes.plot(time, units.of(record.acceleration, "m/s^2"), color=COLORS[0], linewidth=0.8)
    axes.axhline(0.0, **ZERO)
    axes.set(
        xlim=(time[0], time[-1]), xlabel="time (s)", ylabel=f"acceleration ({units.label('m/s^2')})"
    )
    write_note(axes, f"peak {units.of(record.pga, 'm/s^2'):.3g} {units.label('m/s^2')}")


def _draw_record(column: Any, info: RecordInfo, units: OutputUnits) -> None:
    """Plot acceleration, velocity, displacement and Husid plot of a record over the time.

    `info`: record with its intensity measures; their values are written in the panels.
    """
    record, measures = info.record, info.measures
    motion = integrate(record)
    time = record.time
    peaks = (measures.pga, measures.pgv, measures.pgd)
    motions = (record.acceleration, motion.velocity, motion.displacement)
    for axes, values, peak, (name, si) in zip(column, motions, peaks, MOTION.items(), strict=False):
        axes.set_ylabel(f"{name} ({units.label(si)})")
        axes.plot(time, units.of(values, si), color=COLORS[0], linewidth=0.8)
        axes.axhline(0.0, **ZERO)
        axes.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
        write_note(axes, f"peak {units.of(peak, si):.3g} {units.label(si)}")
    # `changed` returns a suffix for a scaled or processed record, such as ` x 1.7 (processed)`.
    title = motion_name(record) + changed([record])
    # The title is above the line of the peak.
    column[0].set_title(title, loc="left", pad=14.0, parse_math=False)
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
        text = f"{units.of(measures.arias, 'm/s'):.3g} {units.label('m/s')},\n"
        write_note(husid, text + f"D5-75 {measures.d5_75:.3g} s, D5-95 {measures.d5_95:.3g} s")
    husid.set(xlim=(time[0], time[-1]), xlabel="time (s)", ylabel="Arias intensity (%)")
