"""Geometric sequences of numbers, such as the periods of a spectrum."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tdint.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_GRID_POINTS = 1_000_000
"""Maximum number of points of a grid. A larger number is probably a typing error."""


@dataclass(frozen=True)
class Grid:
    """Geometric sequence of positive numbers, such as the periods of a spectrum.

    Attributes
    ----------
    first, last : float
        First and last number; both are part of the grid.
    count : int
        Number of values; 1 if the grid is the single number `first`.
    """

    first: float
    last: float
    count: int

    def __str__(self) -> str:
        """Return the grid in the form that `parse_grid` reads."""
        return f"{self.first:.12g}:{self.last:.12g}:{self.count}"

    def values(self) -> NDArray[np.float64]:
        """Return the values of the grid, shape (count,)."""
        import numpy as np

        result = np.geomspace(self.first, self.last, self.count)
        # The endpoints are exact, so that a requested period is found in the table.
        result[0], result[-1] = self.first, self.last
        return result


def parse_grid(text: str) -> Grid:
    """Parse a geometric sequence of numbers `first:last:count`, such as `0.01:10:200`, or a single
    number.

    Raises
    ------
    UsageError
        The text has another form, a number is not positive, `first` is not less than `last`, or
        `count` is not between 2 and `MAX_GRID_POINTS`.
    """
    first, *more = text.split(":")
    try:
        # A single number is a grid with a single point. Any number of colons other than 0 and 2
        # raises ValueError.
        last, count = more or (first, "1")
        grid = Grid(float(first), float(last), int(count))
    except ValueError:
        raise UsageError(
            f"{text!r} is neither FIRST:LAST:COUNT, such as 0.01:10:200, nor a number"
        ) from None
    if not 0.0 < grid.first <= grid.last < math.inf:
        raise UsageError(
            f"{text!r}: FIRST and LAST must be positive numbers, FIRST the smaller one"
        )
    if more and not (grid.first < grid.last and 2 <= grid.count <= MAX_GRID_POINTS):
        raise UsageError(
            f"{text!r}: FIRST must be below LAST, COUNT between 2 and {MAX_GRID_POINTS}"
        )
    return grid
