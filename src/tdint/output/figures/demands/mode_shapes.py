"""Figure of the shapes of a building's first modes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.model.modes import Modes
from tdint.output.figures.style import COLORS, DASHES, LIGHT, MARKERS, add_title

_MOST = 4
_MARKED = 20  # floors that have markers


def mode_picture(modes: Modes, *, name: str, norm: str = "roof") -> Figure:
    """Picture of the first modes over the floors, normalized as `tdint.model.modes.Modes.normalized` says."""
    figure = Figure(figsize=(5.4, 5.6), layout="constrained")
    draw_modes(figure.subplots(), modes, norm)
    add_title(figure, name)
    return figure


def draw_modes(axes: Any, modes: Modes, norm: str = "roof") -> None:
    """The shapes of the first modes over the floors."""
    shapes = modes.normalized(norm)
    floors = np.arange(len(shapes) + 1)
    axes.axvline(0.0, color=LIGHT, linewidth=0.8)
    for mode in range(min(_MOST, len(floors) - 1)):
        label = f"mode {mode + 1}, {2.0 * math.pi / modes.omega[mode]:.4g} s"
        marker = MARKERS[mode] if len(shapes) <= _MARKED else None
        style = {"color": COLORS[mode], "linestyle": DASHES[mode], "marker": marker, "markersize": 4.0}
        axes.plot([0.0, *shapes[:, mode]], floors, label=label, clip_on=False, **style)
    axes.set_ylim(0.0, floors[-1])
    axes.yaxis.set_major_locator(MaxNLocator(11, integer=True, min_n_ticks=1))
    axes.set_ylabel("floor")
    axes.set_xlabel("shape, 1 at the roof" if norm == "roof" else "shape, with a participation factor of 1")
    axes.legend(loc="best")
