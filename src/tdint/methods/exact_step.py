"""Exact step of linear oscillators under a load that is linear within the step.

Spectra and the method `exact` use it (Nigam and Jennings 1969, Van Loan 1978).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from tdint.arrays import Array

Array = Array

# Limit of max(1, 2 xi) omega h below which power series are used, because the closed form suffers
# from cancellation. Above it, the series would need more than 42 terms.
_SERIES_BELOW = 4.0
# Number of terms of the series: the first value plus the second value times the largest omega h
_SERIES_TERMS = 18, 6.0


def oscillator(omega_h: Array, damping: Array) -> Array:
    """Return the exact step of oscillators u'' + 2 xi omega u' + omega^2 u = p, with a load p that
    is linear within the step.

    With the time divided by h, the step has the length 1 and the circular frequency is w = omega h;
    velocities are multiplied by h and loads by h^2. At the end of this step,

        g        is the displacement after a unit initial velocity (impulse response)
        i1, i2   are the first and second integral of the impulse response over the step
        a11      is the displacement after a unit initial displacement: a11 = 1 - w^2 i1
        a22      is the velocity after a unit initial velocity: a22 = a11 - 2 xi w g

    Returns
    -------
    ndarray, shape (k, 2, 4)
        Matrix that maps (u0, h v0, h^2 p0, h^2 p1) to (u1, h v1), with the displacement u, velocity
        v and load p at the start (0) and at the end (1). For small omega h it is computed from
        power series, because the closed form suffers from cancellation; for other underdamped
        oscillators in closed form; for the remaining oscillators from Van Loan's block matrix.
    """
    omega_h, damping = np.broadcast_arrays(np.asarray(omega_h, float), np.asarray(damping, float))
    result = np.empty((*omega_h.shape, 2, 4))
    use_series = np.maximum(omega_h, 2.0 * damping * omega_h) < _SERIES_BELOW
    use_closed_form = ~use_series & (damping < 1.0)
    if use_series.any():
        # Taylor series of the impulse response and its first two integrals; exact at omega = 0. The
        # impulse response is the sum of terms[n] t^(n + 1) / (n + 1)!, with t = 1 at the end of the
        # step. Its k-th integral has the factors 1 / (n + 1 + k)! instead.
        w, xi = omega_h[use_series], damping[use_series]
        count = _SERIES_TERMS[0] + math.ceil(_SERIES_TERMS[1] * np.max(np.maximum(w, 2.0 * xi * w)))
        terms = np.empty((count, *w.shape))
        terms[0], terms[1] = 1.0, -2.0 * xi * w
        for n in range(2, count):
            terms[n] = terms[1] * terms[n - 1] - w * w * terms[n - 2]
        inverse = 1.0 / np.cumprod(np.arange(1.0, count + 3.0))  # 1 / 1!, 1 / 2!, ...
        g, i1, i2 = (np.tensordot(inverse[k : k + count], terms, 1) for k in range(3))
        a11 = 1.0 - w * w * i1
        result[use_series] = _assemble_step(w, g, i1, i2, a11, a11 - 2.0 * xi * w * g)
    if use_closed_form.any():
        w, xi = omega_h[use_closed_form], damping[use_closed_form]
        # Damped circular frequency times h
        damped, decay = w * np.sqrt((1.0 - xi) * (1.0 + xi)), np.exp(-xi * w)
        # c is the decaying cosine.
        c, g = decay * np.cos(damped), decay * np.sin(damped) / damped
        a11 = c + xi * w * g
        i1 = (1.0 - a11) / w**2
        i2 = (1.0 - g - 2.0 * xi * w * i1) / w**2
        result[use_closed_form] = _assemble_step(w, g, i1, i2, a11, c - xi * w * g)
    # Overdamped oscillators with a large omega h are rare.
    for index in np.argwhere(~use_series & ~use_closed_form):
        w, xi = omega_h[tuple(index)], damping[tuple(index)]
        result[tuple(index)] = van_loan(np.array([[w * w]]), np.array([[2.0 * xi * w]]), np.eye(1))
    return result


def _assemble_step(w: Array, g: Array, i1: Array, i2: Array, a11: Array, a22: Array) -> Array:
    """Assemble the matrices of `oscillator`, shape (k, 2, 4), for a step of unit length.

    A load that is linear from p0 to p1 causes at the end the displacement (i1 - i2) p0 + i2 p1 and
    the velocity (g - i1) p0 + i1 p1. A unit initial displacement causes the displacement a11 and
    the velocity -w^2 g, a unit initial velocity the displacement g and the velocity a22.
    """
    coefficient_rows = np.array([[a11, g, i1 - i2, i2], [-w * w * g, a22, g - i1, i1]])
    return np.moveaxis(coefficient_rows, (0, 1), (-2, -1))


def van_loan(
    k: Array,
    c: Array,
    patterns: Array,
    h: float = 1.0,
    transition: Callable[[Array], Array] | None = None,
) -> Array:
    """Return the exact step of u'' + c u' + k u = P p(t) over the time h, by Van Loan (1978): the
    matrix that maps (u0, v0, p0, p1) to (u1, v1).

    The load p = p0 + (p1 - p0) t / h and its increase d = p1 - p0 are additional state variables of
    the first-order system, with derivatives with respect to t / h,

        u' = h v,   v' = h (-k u - c v + P p),   p' = d,   d' = 0

    `patterns` is the distribution P of each load over the floors, divided by the masses.
    `transition` approximates the exponential of the matrix of the system; default: exact.
    """
    if transition is None:
        from scipy.linalg import expm

        transition = expm
    # u (n floors), v (n floors), p and d (loads each)
    n, loads = patterns.shape
    block = np.zeros((2 * n + 2 * loads, 2 * n + 2 * loads))
    block[:n, n : 2 * n] = h * np.eye(n)
    block[n : 2 * n, :n] = -h * k
    block[n : 2 * n, n : 2 * n] = -h * c
    block[n : 2 * n, 2 * n : 2 * n + loads] = h * patterns
    block[2 * n : 2 * n + loads, 2 * n + loads :] = np.eye(loads)
    # With the columns P0 and D of the exponential for p0 and d, the response to the load is P0 p0 +
    # D (p1 - p0) = (P0 - D) p0 + D p1.
    exponential = transition(block)[: 2 * n]
    by_increase = exponential[:, 2 * n + loads :]
    return np.hstack(
        [exponential[:, : 2 * n], exponential[:, 2 * n : 2 * n + loads] - by_increase, by_increase]
    )
