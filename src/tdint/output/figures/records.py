"""Figure of records: acceleration, velocity and displacement over time, and how their Arias intensity builds up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.files import Writer
from tdint.ground_motion.measures import cumulative_energy, integrate, time_of_energy
from tdint.output.figures.style import COLORS, IN_G, LIGHT, MARK, changed, picture, record_name
from tdint.output.tables.records import RecordInfo

MOST_RECORDS = 3
"""As many are drawn, side by side; what comes after them is left out."""

_SHARES = (0.05, 0.75, 0.95)


def info_picture(infos: Sequence[RecordInfo], suffix: str) -> Writer:
    """Picture of the first records, at most MOST_RECORDS: a column each.

    Return value and errors are those of `tdint.output.figures.style.picture`.

    Parameters
    ----------
    infos : sequence of RecordInfo
        One at least.
    """
    return picture(suffix, lambda: _draw(infos[:MOST_RECORDS]))


def _draw(infos: Sequence[RecordInfo]) -> Figure:
    figure = Figure(figsize=(7.5 if len(infos) == 1 else 5.0 * len(infos), 8.5), layout="constrained")
    grid = figure.subplots(4, len(infos), sharex="col", sharey="row", squeeze=False)
    for column, info in zip(grid.T, infos, strict=True):
        _draw_record(column, info)
    for axes, label in zip(
        grid[:, 0], ("acceleration (g)", "velocity (m/s)", "displacement (m)", "Arias intensity (%)"), strict=True
    ):
        axes.set_ylabel(label)
    return figure


def _draw_record(column: Any, info: RecordInfo) -> None:
    record, measures = info.record, info.measures
    motion = integrate(record)
    time = np.arange(record.acceleration.size) * record.dt
    for axes, values, peak, unit in (
        (column[0], IN_G * record.acceleration, IN_G * measures.pga, "g"),
        (column[1], motion.velocity, measures.pgv, "m/s"),
        (column[2], motion.displacement, measures.pgd, "m"),
    ):
        axes.plot(time, values, color=COLORS[0], linewidth=0.8)
        axes.axhline(0.0, color=LIGHT, linewidth=0.6)
        axes.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
        _write(axes, f"peak {peak:.3g} {unit}")
    title = f"{record_name(record.source)} {record.component}".rstrip() + changed([record])
    column[0].set_title(title, parse_math=False)
    _draw_husid(column[3], info, time)
    column[3].set_xlim(time[0], time[-1])
    column[3].set_xlabel("time (s)")


def _draw_husid(axes: Any, info: RecordInfo, time: Any) -> None:
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
    text = f"{measures.arias:.3g} m/s\nD5-75 {measures.d5_75:.3g} s\nD5-95 {measures.d5_95:.3g} s"
    _write(axes, text, top=0.5)


def _write(axes: Any, text: str, top: float = 0.95) -> None:
    axes.text(
        0.99, top, text, transform=axes.transAxes, ha="right", va="top", fontsize=8.0, color=MARK,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    )  # fmt: skip
