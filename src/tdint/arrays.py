"""The type of arrays of numbers, and how an interval is halved."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def halved(below: Callable[[float], bool], low: float, high: float, times: int) -> tuple[float, float]:
    """Both ends of the interval in which something ceases to hold, halved so many times or down to the last digit.

    Parameters
    ----------
    below : callable
        Whether it holds: at `low` it does, at `high` it does not.
    """
    for _ in range(times):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if below(middle) else (low, middle)
    return low, high
