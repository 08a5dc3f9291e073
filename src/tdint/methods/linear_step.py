"""Steps of methods in linear models whose mass matrix is not diagonal.

The compiled steps of `tdint.methods` have floor masses. For y' = A y + b(t) with the displacements
and velocities y and a load b that is linear within the step, the steps below are

    y1 - theta h y1' + beta h^2 y1'' = y0 + (1 - theta) h y0' + alpha h^2 y0''

a Pade approximation of the matrix exponential for most coefficients.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tdint.arrays import Array
from tdint.methods.method import Integrator

Coefficients = tuple[float, float, float]


def _momentum(rho_inf: float) -> Coefficients:
    """Return theta, alpha and beta of impulse4 (`tdint.methods.impulse4.coefficients`)."""
    theta = (2.0 + rho_inf) / (3.0 * (1.0 + rho_inf))
    return theta, 1.0 / 3.0 - theta / 2.0, theta / 2.0 - 1.0 / 6.0


_COEFFICIENTS: dict[str, Callable[..., Coefficients]] = {
    "newmark-average": lambda: (0.5, 0.0, 0.0),
    "gauss4": lambda: _momentum(1.0),
    "impulse4": _momentum,
    "moment4": _momentum,
}
"""Parameter values of a method -> theta, alpha and beta."""


def step_coefficients(integrator: Integrator) -> Coefficients | None:
    """Return theta, alpha and beta of a method; None for a method without this form."""
    coefficients = _COEFFICIENTS.get(integrator.method.name)
    return coefficients(*integrator.values) if coefficients else None


def transition(matrix: Array, coefficients: Coefficients) -> Array:
    """Return the matrix of a step in place of the exponential of `matrix`, which is h times the
    matrix of y' = A y."""
    theta, alpha, beta = coefficients
    unit, square = np.eye(len(matrix)), matrix @ matrix
    left = unit - theta * matrix + beta * square
    right = unit + (1.0 - theta) * matrix + alpha * square
    return np.asarray(np.linalg.solve(left, right))
