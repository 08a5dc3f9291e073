"""Figure of the forces on floors that a model reads from files or points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tdint.output.figures.style import COLORS, DASHES, LIGHT, titled
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.model.definition import Model

_MAX_LINES = 6
"""Maximum number of forces with a color and an entry in the legend. Further forces are gray."""


def load_picture(model: Model, end: float, units: OutputUnits = SI) -> Figure:
    """Plot the forces from tables over the time of a run.

    Parameters
    ----------
    model : Model
        Building with forces from tables.
    end : float
        End of the run, s.
    units : OutputUnits
        Units of the figure; SI by default.
    """
    units = units.in_figures
    figure = Figure(figsize=(8.0, 3.0), layout="constrained")
    axes = figure.add_subplot()
    tables = sorted(model.excitation.tables, key=lambda force: -force.floor)
    # The largest forces are the most important ones for the legend.
    by_size = sorted(tables, key=lambda force: -float(np.max(np.abs(force.values))))
    named = [force for force in tables if force in by_size[:_MAX_LINES]][:_MAX_LINES]
    for force in tables:
        # The force is zero before the first and after the last point.
        times = np.concatenate([[min(0.0, force.times[0])], force.times[[0]], force.times])
        times = np.concatenate([times, force.times[[-1]], [max(end, force.times[-1])]])
        values = units.of(np.concatenate([[0.0, 0.0], force.values, [0.0, 0.0]]), "N")
        if force in named:
            index = named.index(force)
            style = {"color": COLORS[index % len(COLORS)], "linestyle": DASHES[index % len(DASHES)]}
            axes.plot(times, values, linewidth=1.0, label=f"floor {force.floor}", **style)
        else:
            axes.plot(times, values, linewidth=0.6, color=LIGHT, zorder=0)
    axes.set(xlim=(0.0, end), xlabel="time (s)", ylabel=f"force ({units.label('N')})")
    if len(tables) > 1:
        axes.legend(loc="upper right", fontsize=7.0, handlelength=2.4)
    floors = sorted({force.floor for force in tables})
    listed = ", ".join(map(str, floors)) if len(floors) <= _MAX_LINES else f"{len(floors)} floors"
    noun = "floor" if len(floors) == 1 else "floors" if len(floors) <= _MAX_LINES else ""
    return titled(figure, f"{model.name}: forces on {noun} {listed}".replace("  ", " "))
