"""Resultants of a run in two directions: peaks over time of the length of vectors in plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.tabular import Described


@dataclass(frozen=True, eq=False, repr=False)
class Resultant(Described):
    """Peaks over time of the resultant of a quantity, arrays over the stories or floors, SI units.

    Attributes
    ----------
    value : ndarray
        Peak of sqrt(x^2 + y^2).
    time : ndarray
        Time of the peak, s.
    direction : ndarray
        Direction at this time, degrees from x to y, from 0 to 360.
    x, y : ndarray
        Peaks of the absolute values in both directions.
    error : ndarray
        Estimated error of `value`; nan if it is unknown.
    """

    value: Array
    time: Array
    direction: Array
    x: Array
    y: Array
    error: Array

    @property
    def srss(self) -> Array:
        """Square root of the sum of the squares of x and y: an upper limit of `value`."""
        return np.hypot(self.x, self.y)

    @property
    def rule_100_30(self) -> Array:
        """Combination 100 % + 30 % of x and y, the larger of both (EN 1998-1, 4.3.3.5.1)."""
        return np.maximum(self.x + 0.3 * self.y, 0.3 * self.x + self.y)


@dataclass(frozen=True, eq=False, repr=False)
class Resultants(Described):
    """Resultants of each floor (displacement, absolute acceleration) and story (drift, shear).

    The shear of the first story is the base shear.
    """

    displacement: Resultant
    drift: Resultant
    absolute_acceleration: Resultant
    shear: Resultant

    def _headline(self) -> str:
        largest = int(np.argmax(self.drift.value))
        value, direction = self.drift.value[largest], self.drift.direction[largest]
        return f"largest drift {value:.4g} m in story {largest + 1}, {direction:.4g} degrees from x"
