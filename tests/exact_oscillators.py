"""Linear oscillators under a ground motion that is linear between its samples, by the matrix
exponential with many steps per sampling interval."""

import numpy as np
from scipy.linalg import expm

from tdint.kernels.oscillators.between_steps import A11, B10


def transition(by_u, by_v, h):
    """Matrices A and B of the step y1 = A y0 - B (g0, g1) of an oscillator with the state y =
    (u, v), from the exponential of the system with the ground acceleration and its slope."""
    system = np.zeros((4, 4))
    system[0, 1], system[1] = 1.0, (-by_u, -by_v, -1.0, 0.0)
    system[2, 3] = 1.0
    step = expm(system * h)
    of_start, of_slope = step[:2, 2], step[:2, 3] / h
    return step[:2, :2], -np.column_stack([of_start - of_slope, of_slope])


def recursion_table(row_count, first, omegas, ratios, h):
    """Return a table of oscillators: the recursion, then two more rows.

    Parameters
    ----------
    row_count : int
        Number of rows.
    first : function
        (omega, damping ratio) -> values of the two last rows.
    omegas, ratios : array_like
        Circular frequencies, rad/s, and damping ratios.
    h : float
        Length of a step, s.
    """
    found = np.zeros((row_count, len(omegas)))
    for i, (omega, ratio) in enumerate(zip(omegas, ratios, strict=True)):
        a, b = transition(omega**2, 2.0 * ratio * omega, h)
        for k in range(2):
            found[[A11 + 4 * k, A11 + 4 * k + 1], i] = a[k]
            found[[B10 + 4 * k, B10 + 4 * k + 1], i] = b[k]
        found[-2:, i] = first(omega, ratio)
    return found


def motion(samples, dt, omega, ratio, count):
    """Return displacement and velocity with `count` steps per sampling interval, and the ground
    acceleration at these steps."""
    a, b = transition(omega**2, 2.0 * ratio * omega, dt / count)
    samples = np.asarray(samples)
    times = np.arange((samples.size - 1) * count + 1) / count
    ground = np.interp(times, np.arange(samples.size), samples)
    forcing = np.column_stack([ground[:-1], ground[1:]]) @ b.T
    states = np.zeros((times.size, 2))
    u = v = 0.0
    (a11, a12), (a21, a22) = a.tolist()
    for k, (f, g) in enumerate(forcing.tolist()):
        u, v = a11 * u + a12 * v - f, a21 * u + a22 * v - g
        states[k + 1] = u, v
    return states[:, 0], states[:, 1], ground


def largest(values, count):
    """Return the maximum absolute value of each column, by parabolas through three adjacent values.

    Parameters
    ----------
    values : ndarray
        Values with `count` rows per step. The function is smooth within a step.
    count : int
        Number of intervals in a step.
    """
    best = np.max(np.abs(values), axis=0)
    for k in range(0, values.shape[0] - 1, count):
        before, here, after = (values[k + j : k + count - 1 + j] for j in range(3))
        bend = before - 2.0 * here + after
        difference = before - after
        inside = np.abs(difference) < 2.0 * np.abs(bend)
        vertex = here - 0.125 * difference**2 / np.where(inside, bend, np.inf)
        best = np.maximum(best, np.max(np.abs(np.where(inside, vertex, 0.0)), axis=0))
    return best
