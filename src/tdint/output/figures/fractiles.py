"""Lines of the median and of fractiles over ground motions, for figures of suites."""

from __future__ import annotations

from typing import Any

from tdint.arrays import Array
from tdint.fractiles import fractiles
from tdint.output.figures.style import DASHES

FRACTILES = (16, 84)

BETWEEN_FRACTILES = f"{FRACTILES[0]} % and {FRACTILES[1]} %"
"""Label of the fractiles in legends."""


def draw_median(axes: Any, x: Array, rows: Array, color: str, *, zorder: float = 3.0) -> Any:
    """Plot the median over all ground motions, and return the line for the legend.

    `rows` has a row of values at `x` for each ground motion; nan is ignored.
    """
    return axes.plot(x, fractiles(rows, (0.5,))[0], color=color, linewidth=2.0, zorder=zorder)[0]


def draw_fractiles(axes: Any, x: Array, rows: Array, color: str, *, zorder: float = 2.5) -> Any:
    """Plot the fractiles `FRACTILES` over all ground motions as dashed lines.

    `rows` has a row of values at `x` for each ground motion; nan is ignored. The returned line of
    the upper fractile represents both lines in the legend.
    """
    low, _, high = fractiles(rows)
    axes.plot(x, low, color=color, linestyle=DASHES[1], zorder=zorder)
    return axes.plot(x, high, color=color, linestyle=DASHES[1], zorder=zorder)[0]
