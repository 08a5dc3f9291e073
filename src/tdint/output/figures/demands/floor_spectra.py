"""Figure of response spectra of floors: of one run a curve for each floor, of a suite a panel for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tdint.analysis.spectra.floors import FloorSpectrum
from tdint.campaign.floor_suites import FloorSuite
from tdint.output.figures.demands.story_profiles import building_colors
from tdint.output.figures.style import COLORS, DASHES, INK, add_title, legend_columns, plain_logarithmic
from tdint.output.figures.suites import GRAY
from tdint.output_units import SI, OutputUnits

_MOST = 6  # panels


def floor_picture(spectra: Sequence[FloorSpectrum], units: OutputUnits = SI, *, title: str = "") -> Figure:
    """Picture of the spectra of a run's floors, a curve for each floor and damping ratio, named by the floor."""
    units = units.in_pictures
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    axes = figure.subplots()
    floors = list(dict.fromkeys(one.floor for one in spectra))
    ratios = list(dict.fromkeys(one.spectrum.damping for one in spectra))
    for one in spectra:
        label = f"floor {one.floor}" + (f", {100.0 * one.spectrum.damping:g} %" if len(ratios) > 1 else "")
        color = COLORS[floors.index(one.floor) % len(COLORS)]
        dashes = DASHES[ratios.index(one.spectrum.damping) % len(DASHES)]
        psa = units.of(one.spectrum.psa, "m/s^2")
        axes.plot(one.spectrum.periods, psa, color=color, linestyle=dashes, linewidth=1.6, label=label)
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
    shown = list(panels.values())[:_MOST]
    columns = min(len(shown), 2)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(4.0 * columns + 0.4, 3.6 * rows + 0.8), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    names = list(dict.fromkeys(one.building for one in suites))
    colors = building_colors(names)
    for axes, same in zip(grid.ravel(), shown, strict=False):
        for one in same:
            _draw_suite(axes, one, units, INK if len(names) == 1 else colors[one.building], alone=len(names) == 1)
        _finish(axes, units)
        axes.set_title(_named(same[0], several=len({repr(one.scale) for one in suites}) > 1), fontsize=9.0)
    for axes in grid.ravel()[len(shown) :]:
        axes.set_visible(False)
    handles, labels = grid[0][0].get_legend_handles_labels()
    for text in figure.legend(handles, labels, loc="outside lower center", ncols=legend_columns(labels, 4)).get_texts():
        text.set_parse_math(False)
    what = names[0] if len(names) == 1 else f"{len(names)} buildings"
    more = f"; the first {len(shown)} of {len(panels)} panels" if len(panels) > len(shown) else ""
    add_title(figure, f"{what}, {suites[0].runs} motions\nspectra of absolute floor accelerations{more}")
    return figure


def _draw_suite(axes: Any, one: FloorSuite, units: OutputUnits, color: str, *, alone: bool) -> None:
    psa = units.of(one.psa, "m/s^2")
    if alone:
        axes.plot(one.periods, psa.T, color=GRAY, linewidth=0.7, zorder=1.5)
        axes.plot([], [], color=GRAY, linewidth=0.7, label="one motion each")
    name = "" if alone else f"{one.building}, "
    axes.plot(one.periods, np.mean(psa, axis=0), color=color, linewidth=1.9, label=f"{name}mean", zorder=3)
    style = {"color": color, "linewidth": 1.1, "linestyle": DASHES[1], "zorder": 2.5}
    axes.plot(one.periods, np.max(psa, axis=0), label="envelope" if alone else f"{name}envelope", **style)


def _named(one: FloorSuite, *, several: bool) -> str:
    scale = f", scale {one.scale:g}" if one.scale == one.scale and several else ""
    level = f", level {one.level:.4g}" if one.level == one.level else ""
    return f"floor {one.floor}{scale}{level}, {100.0 * one.damping:g} % damping"


def _finish(axes: Any, units: OutputUnits) -> None:
    plain_logarithmic(axes)
    axes.set_xlabel("period (s)")
    axes.set_ylabel(f"pseudo-acceleration ({units.label('m/s^2')})")
    axes.label_outer()
