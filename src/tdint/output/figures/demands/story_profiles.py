"""Figure of buildings under a suite: drifts, floor accelerations and shears over the height, of each motion and over
all; of several buildings side by side, each in the color of its name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from tdint.campaign.profiles import DRIFT_RATIO, Profile
from tdint.output.figures.style import COLORS, DASHES, INK, MARK, add_title, legend_columns, scaled_unit
from tdint.output.figures.suites import GRAY
from tdint.output_units import SI, OutputUnits
from tdint.written_numbers import how_many

Array = NDArray[np.float64]

_MOST_ROWS = 4
"""Levels that are drawn, one row of panels each."""


def profile_picture(
    profiles: Sequence[Profile], units: OutputUnits = SI, *, limit: float | None = None, title: str = ""
) -> Figure:
    """Picture of the profiles of buildings, a row of panels for each level.

    Parameters
    ----------
    limit : float, optional
        A drift ratio, drawn as a line.
    title : str
        What was run; the building's name where there is one alone.
    """
    units = units.in_pictures
    rows: dict[tuple[str, str], list[Profile]] = {}
    for one in profiles:
        rows.setdefault((repr(one.scale), repr(one.level)), []).append(one)
    shown = list(rows.values())[:_MOST_ROWS]
    figure = Figure(figsize=(8.0, 0.9 + 3.6 * len(shown)), layout="constrained")
    panels = figure.subplots(len(shown), 3, squeeze=False)
    names = [one.building for one in profiles]
    colors = building_colors(names)
    alone = len(colors) == 1
    for axes, same in zip(panels, shown, strict=True):
        by_length = any(map(_without_heights, same))
        for one in same:
            _draw_row(axes, one, units, INK if alone else colors[one.building], alone=alone, by_length=by_length)
        _finish_row(axes, same, units, None if by_length else limit, _level(same[0]) if len(rows) > 1 else "")
        axes[0].set_xlabel(f"drift ({units.label('m')})" if by_length else "drift (% of height)")
    told = (row[0].get_legend_handles_labels() for row in panels)
    named = {label: handle for handles, labels in told for handle, label in zip(handles, labels, strict=True)}
    labels, handles = list(named), list(named.values())
    legend = figure.legend(handles, labels, loc="outside lower center", ncols=legend_columns(labels, 4))
    for text in legend.get_texts():
        text.set_parse_math(False)
    what = names[0] if alone else title or f"{len(colors)} buildings"
    more = f"; the first {len(shown)} of {len(rows)} levels" if len(rows) > len(shown) else ""
    add_title(figure, f"{what}\n{_suite(shown[0])}{more}")
    return figure


def building_colors(names: Sequence[str]) -> dict[str, str]:
    """A color for each building, by the order of the names: the same whatever the order of the files."""
    return {name: COLORS[i % len(COLORS)] for i, name in enumerate(sorted(dict.fromkeys(names)))}


def _suite(profiles: Sequence[Profile]) -> str:
    """How many motions there were."""
    runs, pairs = profiles[0].runs, profiles[0].pairs
    if 0 < pairs < runs:
        return f"{how_many(runs, 'motion')}, of {how_many(pairs, 'pair')} the larger component"
    return f"{how_many(pairs, 'pair')}, the larger component of each" if pairs else how_many(runs, "motion")


def _level(profile: Profile) -> str:
    if profile.scale == profile.scale:
        return f"scale {profile.scale:g}"
    return f"level {profile.level:.4g}" if profile.level == profile.level else ""


def _draw_row(
    axes: Sequence[Any], profile: Profile, units: OutputUnits, color: str, *, alone: bool, by_length: bool
) -> None:
    """The lines of a building: its motions thin and gray if it stands alone, their mean and the largest."""
    for panel, (values, by_floor) in zip(axes, _quantities(profile, units, by_length=by_length), strict=True):
        if not len(values):
            continue
        if alone:
            for row in values:
                _line(panel, row, by_floor, color=GRAY, linewidth=0.7, zorder=1.5)
            panel.plot([], [], color=GRAY, linewidth=0.7, label="one motion each")
        name = "" if alone else f"{profile.building}, "
        _line(panel, np.mean(values, axis=0), by_floor, color=color, linewidth=1.9, label=f"{name}mean", zorder=3)
        style = {"color": color, "linewidth": 1.1, "linestyle": DASHES[1], "zorder": 2.5}
        _line(panel, np.max(values, axis=0), by_floor, label="largest" if alone else f"{name}largest", **style)


def _quantities(profile: Profile, units: OutputUnits, *, by_length: bool) -> list[tuple[Array, bool]]:
    """What the panels show, shape (motions, n), and whether it is of floors; drifts in percent of the height, or as
    lengths."""
    drifts = units.of(profile.peaks["peak_drift"], "m") if by_length else 100.0 * profile.peaks[DRIFT_RATIO]
    return [
        (drifts, False),
        (units.of(profile.peaks["peak_acceleration"], "m/s^2"), True),
        (profile.peaks["peak_total_shear"], False),
    ]


def _without_heights(profile: Profile) -> bool:
    """Whether there are drifts, and none over a height."""
    return bool(profile.motions) and bool(np.isnan(profile.peaks[DRIFT_RATIO]).all())


def _line(axes: Any, values: Array, by_floor: bool, **style: Any) -> None:
    """A value for each floor as a line through the floors, one for each story as steps."""
    places = np.arange(values.size) + 1.0
    if by_floor:
        axes.plot(values, places + 0.5, **style)
        return
    edges = np.repeat(np.arange(values.size + 1) + 0.5, 2)[1:-1]
    axes.plot(np.repeat(values, 2), edges, **style)


def _finish_row(
    axes: Sequence[Any], profiles: Sequence[Profile], units: OutputUnits, limit: float | None, level: str
) -> None:
    drifts, accelerations, shears = axes
    if limit is not None:
        drifts.axvline(100.0 * limit, color=MARK, linestyle=DASHES[2], label=f"limit {100.0 * limit:g} %", zorder=4)
    accelerations.set_xlabel(f"absolute floor acceleration ({units.label('m/s^2')})")
    _scale_shears(shears, units)
    drifts.set_ylabel(f"{level}\nstory" if level else "story")
    lost, runs = sum(one.collapsed + one.failed for one in profiles), sum(one.runs for one in profiles)
    if lost:
        drifts.set_title(f"{lost} of {runs} collapsed or failed, in no line", loc="left", fontsize=8.0)
    most = max(one.height.size for one in profiles)
    for panel in axes:
        panel.set_ylim(0.5, most + (0.6 if panel is accelerations else 0.5))
        panel.yaxis.set_major_locator(MaxNLocator(11, integer=True, min_n_ticks=1))
        panel.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        panel.set_xlim(left=0.0)
        panel.tick_params(labelleft=panel is drifts)
        if not any(one.motions for one in profiles):
            panel.set_xticks([])


def _scale_shears(axes: Any, units: OutputUnits) -> None:
    """The forces of a panel in the unit of their largest."""
    lines = [line for line in axes.get_lines() if len(line.get_xdata())]
    largest = max((float(np.max(line.get_xdata())) for line in lines), default=0.0)
    factor, unit = scaled_unit(largest, "N", units)
    for line in lines:
        line.set_xdata(np.asarray(line.get_xdata()) * factor)
    axes.relim()
    axes.autoscale_view()
    axes.set_xlabel(f"total story shear ({unit})")
