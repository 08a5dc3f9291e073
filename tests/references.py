"""References that share no code with tdint: matrix exponential for linear buildings, DOP853 for smooth laws."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from tdint.model.building import assemble


def matrices(model):
    """Dense M (vector), C, K of a model's initial state."""
    building = assemble(model)
    return building.mass, building.damping_matrix(), building.stiffness_matrix()


def exact_linear(model, record):
    """Displacements at the samples, shape (samples, n): dense exponential of the motion with a linear ground slope."""
    m, c, k = matrices(model)
    n = m.size
    h = record.dt
    a = np.zeros((2 * n + 2, 2 * n + 2))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n] = -k / m[:, None]
    a[n : 2 * n, n : 2 * n] = -c / m[:, None]
    a[n : 2 * n, 2 * n] = -1.0
    a[2 * n, 2 * n + 1] = 1.0
    step = expm(a * h)
    x = np.zeros(2 * n + 2)
    result = np.zeros((record.acceleration.size, n))
    ground = record.acceleration
    for j in range(ground.size - 1):
        x[2 * n : 2 * n + 2] = ground[j], (ground[j + 1] - ground[j]) / h
        x = step @ x
        result[j + 1] = x[:n]
    return result


def smooth(acceleration, u0, v0, times):
    """u'' = acceleration(t, u, v) of one degree of freedom by DOP853 at 1e-13; displacement and velocity at `times`."""

    def rate(t, y):
        return [y[1], acceleration(t, y[0], y[1])]

    solution = solve_ivp(
        rate, (times[0], times[-1]), [u0, v0], method="DOP853", t_eval=times, rtol=1e-13, atol=1e-15, max_step=0.02
    )
    assert solution.success
    return solution.y


def orders(errors):
    """Observed orders from errors at halved steps."""
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])


def drifts(displacement):
    """Story drifts from floor displacements, shape (times, n)."""
    return np.diff(displacement, axis=1, prepend=0.0)
