"""Figures of what buildings have to bear: demands of a suite over the height, spectra of floors, and what moves peaks.

Of a suite each motion and all together are drawn; of several buildings side by side, each in the color of its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.analysis.spectra.floors import FloorSpectrum
from tdint.arrays import Array
from tdint.campaign.floor_suites import FloorSuite
from tdint.campaign.profiles import DRIFT_RATIO, Profile, level_text
from tdint.output.figures.style import (
    COLORS,
    DASHES,
    INK,
    LIGHT,
    MARK,
    add_title,
    legend_columns,
    line_look,
    plain_logarithmic,
    scaled_unit,
)
from tdint.output.figures.suites import GRAY
from tdint.output_units import SI, OutputUnits
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from tdint.campaign.sensitivity import Swing

_MOST_PANELS = 6  # of floors

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
    looks = building_looks(one.building for one in profiles)
    for axes, same in zip(panels, shown, strict=True):
        by_length = any(map(_without_heights, same))
        for one in same:
            for panel, (values, by_floor) in zip(axes, _quantities(one, units, by_length=by_length), strict=True):
                if len(values):
                    line = partial(_line, panel, by_floor=by_floor)
                    _draw_motions(panel, values, line, looks[one.building], "largest")
        _finish_row(axes, same, units, None if by_length else limit, same[0].level_text if len(rows) > 1 else "")
        axes[0].set_xlabel(f"drift ({units.label('m')})" if by_length else "drift (% of height)")
    _name_below(figure, panels[:, 0])
    what = profiles[0].building if len(looks) == 1 else title or f"{len(looks)} buildings"
    more = f"; the first {len(shown)} of {len(rows)} levels" if len(rows) > len(shown) else ""
    add_title(figure, f"{what}\n{_suite(shown[0])}{more}")
    return figure


def building_looks(names: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Color and name of each building, by the order of the names: the same whatever the order of the files; one alone
    is not named."""
    found = sorted(dict.fromkeys(names))
    if len(found) == 1:
        return {found[0]: (INK, "")}
    return {name: (COLORS[i % len(COLORS)], f"{name}, ") for i, name in enumerate(found)}


def _name_below(figure: Figure, panels: Iterable[Any]) -> None:
    """What is named in some panels, each name once, in a legend below all."""
    told = (axes.get_legend_handles_labels() for axes in panels)
    named = {label: handle for handles, labels in told for handle, label in zip(handles, labels, strict=True)}
    columns = legend_columns(list(named), 4, figure.get_figwidth())
    legend = figure.legend(list(named.values()), list(named), loc="outside lower center", ncols=columns)
    for text in legend.get_texts():
        text.set_parse_math(False)


def _suite(profiles: Sequence[Profile]) -> str:
    """How many motions there were."""
    runs, pairs = profiles[0].runs, profiles[0].pairs
    if 0 < pairs < runs:
        return f"{how_many(runs, 'motion')}, of {how_many(pairs, 'pair')} the larger component"
    return f"{how_many(pairs, 'pair')}, the larger component of each" if pairs else how_many(runs, "motion")


def _draw_motions(axes: Any, rows: Array, line: Callable[..., Any], look: tuple[str, str], largest: str) -> None:
    """What `line` draws of each motion, thin and gray where no building is named, of their mean and their largest."""
    color, name = look
    if not name:
        for row in rows:
            line(row, color=GRAY, linewidth=0.7, zorder=1.5)
        axes.plot([], [], color=GRAY, linewidth=0.7, label="one motion each")
    line(np.mean(rows, axis=0), color=color, linewidth=1.9, label=f"{name}mean", zorder=3)
    style = {"color": color, "linewidth": 1.1, "linestyle": DASHES[1], "zorder": 2.5}
    line(np.max(rows, axis=0), label=f"{name}{largest}", **style)


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
        panel.set_ylim(0.5, most + 0.5)
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


def floor_picture(spectra: Sequence[FloorSpectrum], units: OutputUnits = SI, *, title: str = "") -> Figure:
    """Picture of the spectra of a run's floors, a curve for each floor and damping ratio, named by the floor."""
    units = units.in_pictures
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    axes = figure.subplots()
    floors = list(dict.fromkeys(one.floor for one in spectra))
    ratios = list(dict.fromkeys(one.spectrum.damping for one in spectra))
    for one in spectra:
        label = f"floor {one.floor}" + (f", {100.0 * one.spectrum.damping:g} %" if len(ratios) > 1 else "")
        look = line_look(floors.index(one.floor), ratios.index(one.spectrum.damping))
        axes.plot(one.spectrum.periods, units.of(one.spectrum.psa, "m/s^2"), **look, linewidth=1.6, label=label)
    _finish(axes, units)
    axes.legend(loc="best")
    alone = f", {100.0 * ratios[0]:g} % damping" if len(ratios) == 1 else ""
    add_title(figure, f"{title}\nspectra of absolute floor accelerations{alone}".strip())
    return figure


def floor_suite_picture(suites: Sequence[FloorSuite], units: OutputUnits = SI) -> Figure:
    """Picture of the spectra of floors under a suite: the motions thin and gray, mean and envelope; a panel for each
    floor, scale and damping ratio, and of several buildings means and envelopes in the colors of their names.
    """
    units = units.in_pictures
    panels: dict[tuple[object, ...], list[FloorSuite]] = {}
    for one in suites:
        panels.setdefault((one.floor, repr(one.scale), repr(one.level), one.damping), []).append(one)
    shown = list(panels.values())[:_MOST_PANELS]
    columns = min(len(shown), 2)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(4.0 * columns + 0.4, 3.6 * rows + 0.8), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    looks = building_looks(one.building for one in suites)
    for axes, same in zip(grid.ravel(), shown, strict=False):
        for one in same:
            line, psa = partial(axes.plot, one.periods), units.of(one.psa, "m/s^2")
            _draw_motions(axes, psa, line, looks[one.building], "envelope")
        _finish(axes, units)
        axes.set_title(_named(same[0], several=len({repr(one.scale) for one in suites}) > 1), fontsize=9.0)
    for axes in grid.ravel()[len(shown) :]:
        axes.set_visible(False)
    _name_below(figure, grid.ravel())
    what = suites[0].building if len(looks) == 1 else f"{len(looks)} buildings"
    more = f"; the first {len(shown)} of {len(panels)} panels" if len(panels) > len(shown) else ""
    add_title(figure, f"{what}, {how_many(suites[0].runs, 'motion')}\nspectra of absolute floor accelerations{more}")
    return figure


def _named(one: FloorSuite, *, several: bool) -> str:
    level = level_text(one.scale if several else math.nan, one.level, one.measure)
    return ", ".join(filter(None, [f"floor {one.floor}", level, f"{100.0 * one.damping:g} % damping"]))


def _finish(axes: Any, units: OutputUnits) -> None:
    plain_logarithmic(axes)
    axes.set(xlabel="period (s)", ylabel=f"pseudo-acceleration ({units.label('m/s^2')})")
    axes.label_outer()


_NAMES = {
    "peak_drift_ratio": "drift ratio",
    "peak_acceleration": "floor acceleration",
    "peak_roof_displacement": "roof displacement",
    "peak_base_shear": "base shear",
}


def sensitivity_picture(swings: Sequence[Swing], units: OutputUnits = SI) -> Figure:
    """Picture of swings (`tdint.campaign.sensitivity.swings`)."""
    parameters = len({one.parameter for one in swings})
    figure = Figure(figsize=(7.2, 2.2 + 0.56 * parameters), layout="constrained")
    for axes, name in zip(figure.subplots(2, 2).flat, _NAMES, strict=True):
        _tornado(axes, [one for one in swings if one.quantity.name == name], units)
    add_title(figure, f"{swings[0].building}\nmedians of the peaks, one parameter at its ends at a time")
    return figure


def _tornado(axes: Any, swings: Sequence[Swing], units: OutputUnits) -> None:
    first = swings[0]
    if first.quantity.unit == "1":
        factor, unit = 100.0, "%"
    else:
        factor, unit = scaled_unit(first.as_it_is, first.quantity.unit, units)
    for place, one in enumerate(swings):
        low, high = ((value - one.as_it_is) * factor for value in (one.at_low, one.at_high))
        for end, width, other, color in (("low", low, high, COLORS[0]), ("high", high, low, COLORS[1])):
            label = f"{end} value" if place == 0 else None
            above = 1.6 if abs(width) < abs(other) else 1.5  # or it hides behind one to the same side
            axes.barh(place, width, left=one.as_it_is * factor, height=0.62, color=color, label=label, zorder=above)
    axes.axvline(first.as_it_is * factor, color=LIGHT, linewidth=0.8)
    names = [f"{one.parameter}\n{one.low:g} to {one.high:g}" for one in swings]
    axes.set_yticks(range(len(swings)), names, fontsize=7.0)
    axes.invert_yaxis()
    axes.margins(x=0.08)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(f"{_NAMES[first.quantity.name]} ({unit})")
    if first.quantity.name == next(iter(_NAMES)):
        axes.legend(fontsize=7.0, loc="best")
