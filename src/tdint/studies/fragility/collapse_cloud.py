"""Cloud with collapses: a line through the demands of the motions that the building survives, and a
logistic probability of collapse (Jalayer and Cornell 2009; Jalayer et al. 2017)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, ndtr, ndtri

from tdint.arrays import Array
from tdint.errors import AnalysisError

_MAX_STEPS = 100  # of Newton's method; it converges in about ten
_FRACTIONS = (0.16, 0.84)
"""Probabilities of the intensities from which the equivalent dispersion follows."""

_MAX_DISTANCE = 30.0
"""Distance from the median of the survivors, in logarithms of the intensity, of the search for an
intensity."""


class CollapseCloud(NamedTuple):
    """Parameters of ln d = b0 + b1 ln s with the deviation sigma for the survivors, and of the
    collapse probability 1 / (1 + exp(-a0 - a1 ln s))."""

    b0: float
    b1: float
    sigma: float
    a0: float
    a1: float

    def collapse_probability(self, im: Array) -> Array:
        """Return the probability of collapse at intensities."""
        with np.errstate(divide="ignore"):  # intensity 0
            return np.asarray(expit(self.a0 + self.a1 * np.log(im)))

    def exceedance(self, limit: float, im: Array) -> Array:
        """Return the probability that the demand exceeds a limit at intensities."""
        collapse = self.collapse_probability(im)
        with np.errstate(divide="ignore"):
            z = (self.b0 + self.b1 * np.log(im) - math.log(limit)) / self.sigma
        return np.asarray(collapse + (1.0 - collapse) * ndtr(z))

    def intensity(self, limit: float, probability: float) -> float:
        """Return the intensity where a limit is exceeded with a probability."""
        from scipy.optimize import brentq  # imported late: other commands do not need it

        def excess(ln_im: float) -> float:
            """Return the exceedance minus the probability."""
            return float(self.exceedance(limit, np.exp(ln_im))) - probability

        median = (math.log(limit) - self.b0) / self.b1
        ends = median - _MAX_DISTANCE, median + _MAX_DISTANCE
        return math.exp(brentq(excess, *ends, xtol=1e-13))

    def lognormal(self, limit: float) -> tuple[float, float]:
        """Return the intensity where the exceedance of a limit is 50 %, and the equivalent
        dispersion: that of a lognormal function with the same 16 and 84 % points."""
        low, high = (self.intensity(limit, probability) for probability in _FRACTIONS)
        width = float(ndtri(_FRACTIONS[1]) - ndtri(_FRACTIONS[0]))
        return self.intensity(limit, 0.5), math.log(high / low) / width

    def in_units(self, factor: float) -> CollapseCloud:
        """Return the parameters for intensities that are multiplied by a factor."""
        logarithm = math.log(factor)
        return self._replace(b0=self.b0 - self.b1 * logarithm, a0=self.a0 - self.a1 * logarithm)


def collapse_line(im: Array, collapsed: NDArray[np.bool_], weight: Array) -> tuple[float, float]:
    """Fit the probability of collapse 1 / (1 + exp(-a0 - a1 ln s)) by maximum likelihood, and
    return a0 and a1.

    Raises
    ------
    AnalysisError
        The likelihood has no maximum, or the probability does not increase with the intensity.
    """
    if im[collapsed].min() > im[~collapsed].max():
        raise AnalysisError(
            "all collapses are at higher intensities than all other motions, so that the logistic "
            "probability of collapse has no finite maximum of the likelihood; use --fit stripes, "
            "or add motions"
        )
    design = np.column_stack([np.ones(im.size), np.log(im)])
    a = np.zeros(2)
    for _ in range(_MAX_STEPS):
        p = expit(design @ a)
        information = (design.T * (weight * p * (1.0 - p))) @ design
        if not np.isfinite(information).all() or np.linalg.cond(information) > 1e14:
            break
        step = np.linalg.solve(information, design.T @ (weight * (collapsed - p)))
        a = a + step
        if np.max(np.abs(step)) < 1e-12 * max(1.0, float(np.max(np.abs(a)))):
            if a[1] > 0.0:
                return float(a[0]), float(a[1])
            break
    raise AnalysisError(
        "the probability of collapse does not increase with the intensity: a logistic function "
        "cannot be fitted; use --fit stripes, or add motions"
    )
