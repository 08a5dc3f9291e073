"""Fractiles over ground motions, by the same rule in all studies and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tdint.arrays import Array

FRACTIONS = (0.16, 0.5, 0.84)
"""Probabilities of the fractiles over ground motions: median, and a standard deviation of a normal
distribution below and above."""


def fractiles(values: Array, probabilities: Sequence[float] = FRACTIONS) -> Array:
    """Return fractiles over ground motions, the first axis of the values.

    The fractile p of n sorted values is at the position (n - 1) p (type 7 of Hyndman and Fan 1996,
    The American Statistician 50(4)). Between two values it is interpolated in logarithms; linearly
    if the lower value is not positive.

    Parameters
    ----------
    values : ndarray, shape (motions, ...)
        Infinity is a collapse, which is larger than every value. NaN is a motion without a result,
        which is not counted.

    Returns
    -------
    ndarray, shape (probabilities, ...)
        Infinity if a value with a weight is a collapse; NaN without any counted motion.
    """
    shape = (len(probabilities), *values.shape[1:])
    ordered = np.sort(values, axis=0)  # NaN last
    counted = np.sum(~np.isnan(ordered), axis=0)
    if not len(ordered) or not counted.any():
        return np.full(shape, np.nan)
    position = np.multiply.outer(probabilities, np.maximum(counted - 1.0, 0.0))
    below = np.floor(position)
    low, high = (
        np.take_along_axis(ordered, index.astype(np.intp), axis=0)
        for index in (below, np.ceil(position))
    )
    weight = position - below
    with np.errstate(all="ignore"):
        logarithmic = low * (high / low) ** weight
        result = np.where(low > 0.0, logarithmic, low + (high - low) * weight)
    return np.where(np.isinf(high) | (weight == 0.0), high, result)


RELIABLE = 7
"""Minimum number of ground motions for the fractiles of 16 and 84 % without a warning."""


def expected_deviation(motions: int) -> float:
    """Return the expected standard deviation (n - 1) of n normal values divided by the true one,
    c4(n)."""
    gammas = math.lgamma(0.5 * motions) - math.lgamma(0.5 * (motions - 1))
    return math.sqrt(2.0 / (motions - 1)) * math.exp(gammas)


def small_sample_warning(motions: int) -> str:
    """Return the warning about the fractiles of fewer than `RELIABLE` ground motions; otherwise,
    and for one motion, which has no fractiles, an empty text."""
    if not 1 < motions < RELIABLE:
        return ""
    return (
        f"the 16 and 84 % fractiles of {motions} motions are close to the smallest and the largest "
        f"value; use at least {RELIABLE} motions"
    )
