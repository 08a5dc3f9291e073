"""Figure of the forces on floors that a model reads from files or points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from tdint.arrays import Array, max_absolute
from tdint.items import grouped
from tdint.output.figures.style import COLORS, DASHES, LIGHT, new_axes, scaled_unit, titled
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.model.definition import Excitation, Model

_MAX_LINES = 6
"""Maximum number of forces with a color and an entry in the legend. Further forces are gray."""

_SHORT, _SHORT_MARGIN, _NEGLIGIBLE = 0.1, 0.25, 1e-3
"""Fraction of the time of a run below which only the time of the loads is shown, the margin on both
sides divided by this time, and the fraction of the peak below which a load is not considered."""


def load_picture(model: Model, end: float, units: OutputUnits = SI) -> Figure:
    """Plot the forces from tables over the time of a run."""
    figure, axes = new_axes(8.0, 3.0)
    draw_loads(axes, model.excitation, end, units.in_figures)
    axes.set_xlabel("time (s)")
    floors = sorted({force.floor for force in model.excitation.tables})
    return titled(figure, f"{model.name}: forces on {_floors_text(floors)}")


def active_interval(loads: Sequence[tuple[Array, Array]], end: float) -> tuple[float, float]:
    """Return the limits of the time axis of loads: from 0 to the end of the run, or only the time
    where short loads act. A load consists of its times, s, and its values."""
    active: list[float] = []
    for times, values in loads:
        indices = np.flatnonzero(np.abs(values) > _NEGLIGIBLE * max_absolute(values))
        if indices.size:
            active += [times[max(indices[0] - 1, 0)], times[min(indices[-1] + 1, len(times) - 1)]]
    first, last = (max(min(active), 0.0), max(active)) if active else (0.0, end)
    if last - first > _SHORT * end or last >= end:
        return 0.0, end
    margin = _SHORT_MARGIN * (last - first)
    return max(0.0, float(first - margin)), min(float(last + margin), end)


def draw_loads(axes: Any, excitation: Excitation, end: float, units: OutputUnits) -> None:
    """Plot the forces from tables up to the end of a run, s, or in the time where short forces
    act. Equal forces are a single line.

    Parameters
    ----------
    excitation : Excitation
        Forces; at least one force is a table.
    """
    # Equal forces, from the top of the building to its bottom.
    groups = grouped(
        ((force.table, force.column, force.factor, force.start), force)
        for force in sorted(excitation.tables, key=lambda force: -force.floor)
    )
    # The largest forces are the most important forces for the legend.
    peaks = {same: max_absolute(forces[0].values) for same, forces in groups.items()}
    largest = sorted(groups, key=lambda same: -peaks[same])[:_MAX_LINES]
    named = [same for same in groups if same in largest]
    factor, unit = scaled_unit(max(peaks.values()), "N", units)
    for same, (force, *others) in groups.items():
        # The force is zero before the first and after the last point.
        times = np.concatenate([[min(0.0, force.times[0])], force.times[[0]], force.times])
        times = np.concatenate([times, force.times[[-1]], [max(end, force.times[-1])]])
        values = factor * np.concatenate([[0.0, 0.0], force.values, [0.0, 0.0]])
        if same in named:
            index = named.index(same)
            label = _floors_text(sorted({force.floor, *(other.floor for other in others)}))
            style = {"color": COLORS[index % len(COLORS)], "linestyle": DASHES[index % len(DASHES)]}
            axes.plot(times, values, linewidth=1.0, label=label, **style)
        else:
            axes.plot(times, values, linewidth=0.6, color=LIGHT, zorder=0)
    shown = active_interval([(force[0].times, force[0].values) for force in groups.values()], end)
    axes.set(xlim=shown, ylabel=f"force ({unit})")


def _floors_text(floors: list[int]) -> str:
    """Return the names of floors in ascending order, such as `floors 1 to 6`."""
    if len(floors) == 1:
        return f"floor {floors[0]}"
    if floors == list(range(floors[0], floors[-1] + 1)) and len(floors) > 2:
        return f"floors {floors[0]} to {floors[-1]}"
    if len(floors) > _MAX_LINES:
        return f"{len(floors)} floors"
    return f"floors {', '.join(map(str, floors))}"
