"""The maximum of a likelihood of normal observations, some of which are known only to lie below or above a value.

Each observation i has z_i = x_i . p, linear in the parameters, which makes the logarithm of the likelihood concave
(Pratt 1981; Olsen 1978): Newton's iteration finds its one maximum. A value that is known adds ln p_s - z^2 / 2, with
p_s the parameter that is 1 / sigma; one known to be below adds ln Phi(z), one above ln Phi(-z).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

Array = NDArray[np.float64]

_ITERATIONS = 200
_CONVERGED = 1e-13
"""Of Newton's decrement, twice the distance of the likelihood's logarithm from its maximum; the next is its square."""

_SHORTEST = 1e-12
"""Part of a step below which there is no rise: the maximum is where 1 / sigma is not positive."""

_FLATTEST = 1e-12
"""Least curvature over the largest, scaled to equal diagonals: below it there is no one maximum."""


@dataclass(frozen=True)
class Observations:
    """Observations of a model that is linear in its parameters.

    Attributes
    ----------
    design : ndarray, shape (n, k)
        z = design @ parameters.
    below, above : ndarray of bool, shape (n,)
        Those whose value is known only to be below, or above, what the design has; known exactly if neither.
    count : ndarray, shape (n,)
        How often each was made.
    inverse_sigma : int
        The place of the parameter that is 1 / sigma.
    """

    design: Array
    below: NDArray[np.bool_]
    above: NDArray[np.bool_]
    count: Array
    inverse_sigma: int

    @property
    def known(self) -> float:
        """How many values are known exactly."""
        return float(np.sum(self.count[~(self.below | self.above)]))

    def logarithm(self, parameters: Array) -> float:
        """Logarithm of the likelihood but for a constant; -inf where 1 / sigma is not positive."""
        rate = float(parameters[self.inverse_sigma])
        if not rate > 0.0:
            return -math.inf
        z = self.design @ parameters
        terms = np.where(self.below, log_ndtr(z), np.where(self.above, log_ndtr(-z), -0.5 * z * z))
        return float(np.sum(self.count * terms)) + self.known * math.log(rate)

    def derivatives(self, parameters: Array) -> tuple[Array, Array]:
        """Gradient and Hessian of the logarithm, shapes (k,) and (k, k)."""
        z = self.design @ parameters
        hazard_below, hazard_above = (np.exp(-0.5 * y * y - log_ndtr(y)) / math.sqrt(2.0 * math.pi) for y in (z, -z))
        first = np.where(self.below, hazard_below, np.where(self.above, -hazard_above, -z))
        second = np.where(
            self.below,
            -hazard_below * (hazard_below + z),
            np.where(self.above, -hazard_above * (hazard_above - z), -1.0),
        )
        rate, place = float(parameters[self.inverse_sigma]), self.inverse_sigma
        gradient = self.design.T @ (self.count * first)
        hessian = (self.design.T * (self.count * second)) @ self.design
        gradient[place] += self.known / rate
        hessian[place, place] -= self.known / rate**2
        return gradient, hessian


def maximize(observations: Observations, start: Array) -> tuple[Array, Array] | None:
    """The parameters of the largest likelihood, shape (k,), and the inverse of the observed information, shape (k, k).

    Parameters
    ----------
    start : ndarray, shape (k,)
        Parameters to begin with, 1 / sigma positive.

    Returns
    -------
    tuple or None
        None where there is no maximum at finite parameters.
    """
    parameters = np.asarray(start, float)
    value = observations.logarithm(parameters)
    for _ in range(_ITERATIONS):
        gradient, hessian = observations.derivatives(parameters)
        if not (np.isfinite(gradient).all() and np.isfinite(hessian).all()) or _is_flat(hessian):
            return None
        step = np.linalg.solve(-hessian, gradient)
        decrement = float(gradient @ step)
        if decrement <= _CONVERGED * max(1.0, abs(value)):  # The last step: beyond it floats show no rise.
            return parameters + step, _inverse(-hessian)
        length = 1.0
        while not (moved := observations.logarithm(parameters + length * step)) > value:
            length *= 0.5
            if length < _SHORTEST:
                return None
        parameters, value = parameters + length * step, moved
    return None


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), float)


def _is_flat(hessian: Array) -> bool:
    """Whether some direction has no curvature: the likelihood rises for ever, or does not tell the parameters apart."""
    diagonal = -np.diagonal(hessian)
    if not np.all(diagonal > 0.0):
        return True
    scale = 1.0 / np.sqrt(diagonal)
    curvatures = np.linalg.eigvalsh(-hessian * np.outer(scale, scale))
    return bool(curvatures[0] <= _FLATTEST * curvatures[-1])
