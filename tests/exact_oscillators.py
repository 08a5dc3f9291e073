"""Linear oscillators under a ground motion that is linear between its samples, by the matrix
exponential with many steps per sampling interval."""

import numpy as np
from scipy.linalg import expm

from tdint.kernels.oscillators.between_steps import A11, B10


def transition(by_u, by_v, h):
    """Return the matrices A and B of the step y1 = A y0 - B (g0, g1) of an oscillator.

    The state y contains displacement and velocity; g0 and g1 are the ground accelerations at the
    start and the end of the step. The matrices are computed from the exponential of the system that
    also contains the ground acceleration and its slope.

    Parameters
    ----------
    by_u, by_v : float
        omega^2, 1/s^2, and 2 xi omega, 1/s.
    h : float
        Length of the step, s.
    """
    system = np.zeros((4, 4))
    system[0, 1], system[1] = 1.0, (-by_u, -by_v, -1.0, 0.0)
    system[2, 3] = 1.0
    step = expm(system * h)
    # The slope of the ground acceleration is (g1 - g0) / h.
    by_start, by_change = step[:2, 2], step[:2, 3] / h
    return step[:2, :2], -np.column_stack([by_start - by_change, by_change])


def recursion_table(row_count, first, omegas, ratios, h):
    """Return a table for compiled oscillators, with a column for each oscillator.

    It contains A and B of `transition` in the rows from A11 and B10 on, and two other values in the
    last two rows.

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
    table = np.zeros((row_count, len(omegas)))
    for i, (omega, ratio) in enumerate(zip(omegas, ratios, strict=True)):
        a, b = transition(omega**2, 2.0 * ratio * omega, h)
        for k in range(2):
            table[[A11 + 4 * k, A11 + 4 * k + 1], i] = a[k]
            table[[B10 + 4 * k, B10 + 4 * k + 1], i] = b[k]
        table[-2:, i] = first(omega, ratio)
    return table


def motion(samples, dt, omega, ratio, count):
    """Return displacement, velocity and ground acceleration with `count` steps per sampling
    interval, from rest.

    Parameters
    ----------
    samples : array_like
        Ground acceleration at the samples, m/s^2.
    dt : float
        Sampling interval, s.
    omega, ratio : float
        Circular frequency, rad/s, and damping ratio.
    count : int
        Number of steps per sampling interval.
    """
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
    # Each slice contains the inner rows of a step, or their neighbors before and after.
    for k in range(0, values.shape[0] - 1, count):
        before, here, after = (values[k + j : k + count - 1 + j] for j in range(3))
        bend = before - 2.0 * here + after
        difference = before - after
        inside = np.abs(difference) < 2.0 * np.abs(bend)
        vertex = here - 0.125 * difference**2 / np.where(inside, bend, np.inf)
        best = np.maximum(best, np.max(np.abs(np.where(inside, vertex, 0.0)), axis=0))
    return best
