"""Figure of records: acceleration, velocity and displacement over time, and how their Arias intensity builds up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.ground_motion.measures import cumulative_energy, integrate, time_of_energy
from tdint.ground_motion.record import Record
from tdint.output.figures.style import COLORS, LIGHT, MARK, changed, record_name, write_note
from tdint.output.tables.spectra import RecordInfo
from tdint.output_units import SI, OutputUnits

MOST_RECORDS = 3
"""As many are drawn, side by side; what comes after them is left out."""

_SHARES = (0.05, 0.75, 0.95)
_MOTION = {"acceleration": "m/s^2", "velocity": "m/s", "displacement": "m"}
"""What is drawn over time, from the top, and its SI unit."""


def info_picture(infos: Sequence[RecordInfo], units: OutputUnits = SI) -> Figure:
    """Picture of the first records, at most MOST_RECORDS: a column each.

    Parameters
    ----------
    infos : sequence of RecordInfo
        One at least.
    """
    infos = infos[:MOST_RECORDS]
    units = units.in_pictures
    figure = Figure(figsize=(7.5 if len(infos) == 1 else 5.0 * len(infos), 8.5), layout="constrained")
    grid = figure.subplots(4, len(infos), sharex="col", sharey="row", squeeze=False)
    for column, info in zip(grid.T, infos, strict=True):
        _draw_record(column, info, units)
    for axes, (name, si) in zip(grid[:, 0], _MOTION.items(), strict=False):
        axes.set_ylabel(f"{name} ({units.label(si)})")
    grid[-1, 0].set_ylabel("Arias intensity (%)")
    return figure


def draw_acceleration(axes: Any, record: Record, units: OutputUnits) -> None:
    """The acceleration over time with its peak."""
    time = np.arange(record.acceleration.size) * record.dt
    axes.plot(time, units.of(record.acceleration, "m/s^2"), color=COLORS[0], linewidth=0.8)
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.set(xlim=(time[0], time[-1]), xlabel="time (s)", ylabel=f"acceleration ({units.label('m/s^2')})")
    write_note(axes, f"peak {units.of(record.pga, 'm/s^2'):.3g} {units.label('m/s^2')}")


def _draw_record(column: Any, info: RecordInfo, units: OutputUnits) -> None:
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
    title = f"{record_name(record.source)} {record.component}".rstrip() + changed([record])
    column[0].set_title(title, parse_math=False)
    _draw_husid(column[3], info, time, units)
    column[3].set(xlim=(time[0], time[-1]), xlabel="time (s)")


def _draw_husid(axes: Any, info: RecordInfo, time: Any, units: OutputUnits) -> None:
    """The integral of the squared acceleration over its final value (Husid 1969), with the significant durations."""
    energy = cumulative_energy(info.record)
    total = float(energy[-1])
    axes.set_ylim(-2.0, 102.0)
    if total == 0.0:
        return
    axes.plot(time, 100.0 * energy / total, color=COLORS[0])
    times = [time_of_energy(info.record, energy, share) for share in _SHARES]
    axes.plot(times, [100.0 * share for share in _SHARES], "o", color=MARK, markersize=4)
    measures = info.measures
    text = f"{units.of(measures.arias, 'm/s'):.3g} {units.label('m/s')}\n"
    text += f"D5-75 {measures.d5_75:.3g} s\nD5-95 {measures.d5_95:.3g} s"
    write_note(axes, text, y=0.5)
