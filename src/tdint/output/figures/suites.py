"""A suite of motions as several figures draw it: the median, and the fractiles on both sides of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.output.figures.style import DASHES

Array = NDArray[np.float64]

FRACTILES = (16, 84)
BETWEEN_FRACTILES = f"{FRACTILES[0]} % and {FRACTILES[1]} %"
"""What a legend calls their lines."""


def draw_median(axes: Any, x: Array, rows: Array, color: str, *, zorder: float = 3.0) -> Any:
    """The line of the median of the rows, shape (motions, k), over x, shape (k,)."""
    return axes.plot(x, np.nanmedian(rows, axis=0), color=color, linewidth=2.0, zorder=zorder)[0]


def draw_fractiles(axes: Any, x: Array, rows: Array, color: str, *, zorder: float = 2.5) -> Any:
    """The lines of the fractiles of the rows; one of them, for the legend."""
    low, high = np.nanpercentile(rows, FRACTILES, axis=0)
    axes.plot(x, low, color=color, linestyle=DASHES[1], zorder=zorder)
    return axes.plot(x, high, color=color, linestyle=DASHES[1], zorder=zorder)[0]
