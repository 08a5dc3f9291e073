"""Peak response of many linear oscillators u'' + 2 xi omega u' + omega^2 u = -ag to a ground
motion.

The ground motion is linear between its samples. Therefore the recursion from sample to sample is
exact (Nigam and Jennings 1969), and the response between two samples is known. The result is the
maximum at the samples and between the samples:

1. All oscillators are integrated together, in groups of `lanes`. The maxima at the samples are
  stored for each interval of `INTERVAL_STEPS` steps.
2. Between two steps, a quantity q exceeds the larger of its two values by at most h^2/8 times the
  maximum of |q''|. q'' is a free vibration, which the maxima bound. Only few intervals can contain
  the overall maximum. These intervals are integrated again, separately for each oscillator.
3. If q' changes its sign between two samples of such an interval, Newton's method computes the zero
  with the Taylor series of q. With omega h <= 1 the error of the series is below 1e-9.
4. After the last sample, the ground is at rest. The first extremum of the free vibration, which is
  the largest, follows from its closed form.

The caller divides longer steps, for each oscillator as required.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.kernels.compiling import (
    CUBE,
    F8,
    I8,
    TABLE,
    VECTOR,
    inline,
    kernel,
    local,
    local_table,
    outlined,
)
from tdint.kernels.oscillators.between_steps import (
    A11,
    A12,
    A21,
    A22,
    B10,
    B11,
    B20,
    B21,
    RECURSION_ROWS,
    TERMS,
    Vibration,
    excess_factor,
    interpolate_samples,
    largest_afterwards,
    largest_between,
    may_exceed,
    term_count,
)
from tdint.kernels.stepping import Array

# Rows of the table of oscillators after the rows of the recursion
BY_DISPLACEMENT = RECURSION_ROWS  # omega^2, 1/s^2
BY_VELOCITY = RECURSION_ROWS + 1  # 2 xi omega, 1/s
COEFFICIENTS = RECURSION_ROWS + 2

# Rows of the table of peaks: relative displacement (m), relative velocity (m/s) and absolute
# acceleration (m/s^2)
PEAK_DISPLACEMENT = 0
PEAK_VELOCITY = 1
PEAK_ACCELERATION = 2
PEAKS = 3

INTERVAL_STEPS = 32
"""Number of steps of an interval for which maxima are stored."""

# Number of steps of an oscillator before the next oscillator is processed, so that its values
# remain in registers; must divide INTERVAL_STEPS
_BLOCK = 4


def scratch(samples: int, parts: int, lanes: int) -> tuple[NDArray[np.float64], ...]:
    """Return the scratch arrays of `peaks`, uninitialized, in the order of its arguments.

    A step is a sampling interval divided by `parts`. The remaining steps after the last complete
    interval only have a row in `starts`.

    Returns
    -------
    ground : ndarray, shape (steps + 1,)
        Ground acceleration at the steps, m/s^2.
    starts : ndarray, shape (lanes, intervals + 1, 2)
        Displacement (m) and velocity (m/s) of each oscillator at the start of each interval.
    maxima : ndarray, shape (lanes, intervals, PEAKS)
        Maxima of each oscillator at the steps of each interval.
    ground_maxima : ndarray, shape (intervals, 2)
        Maximum ground acceleration (m/s^2) and its maximum rate (m/s^3) in each interval.
    """
    steps = (samples - 1) * parts
    intervals = steps // INTERVAL_STEPS
    return (
        np.empty(steps + 1),
        np.empty((lanes, intervals + 1, 2)),
        np.empty((lanes, intervals, PEAKS)),
        np.empty((intervals, 2)),
    )


@kernel(
    I8(VECTOR, F8, I8, TABLE, I8, I8, TABLE, VECTOR, CUBE, CUBE, TABLE),
    has_forms=False,
    vectorized=True,
)
def peaks(
    samples,
    dt,
    parts,
    oscillators,
    lanes,
    between_steps,
    result,
    ground,
    starts,
    maxima,
    ground_maxima,
):
    """Integrate oscillators from rest over a ground motion and store their maximum absolute
    responses.

    Displacement and velocity are relative to the ground; the absolute acceleration is -(2 xi omega
    v + omega^2 u). The step is exact:

        u1 = A11 u0 + A12 v0 - B10 ag0 - B11 ag1,   v1 = A21 u0 + A22 v0 - B20 ag0 - B21 ag1

    The result is always 0.

    Parameters
    ----------
    oscillators : ndarray, shape (COEFFICIENTS, multiple of `lanes`)
        Table of oscillators, one column each: rows A11 to B21, coefficients of the step, then
        BY_DISPLACEMENT, omega^2 (1/s^2), and BY_VELOCITY, 2 xi omega (1/s).
    between_steps : int
        1 to include maxima between the steps (omega h must not exceed 1) and in the free vibration
        after the last sample, which must be zero; 0 for maxima at the steps only.
    result : ndarray, shape (PEAKS, k)
        Receives the peaks of the first k oscillators: displacement (m), velocity (m/s) and absolute
        acceleration (m/s^2). The remaining oscillators only complete the last group.
    ground, starts, maxima, ground_maxima : ndarray
        Scratch arrays from `scratch`.
    """
    h = dt / parts
    interpolate_samples(samples, parts, ground)
    steps = ground.size - 1
    intervals = steps // INTERVAL_STEPS
    # Each coefficient has a separate array, so that the compiler detects that they do not overlap.
    a11, a12, b10, b11 = local(lanes), local(lanes), local(lanes), local(lanes)
    a21, a22, b20, b21 = local(lanes), local(lanes), local(lanes), local(lanes)
    by_u, by_v = local(lanes), local(lanes)
    us, vs = local(lanes), local(lanes)
    max_u, max_v, max_a = local(lanes), local(lanes), local(lanes)
    # Maxima of an oscillator, and scratch array for the Taylor series
    best, series = local(PEAKS), local_table(3, TERMS)
    for c in range(intervals):
        _measure_ground(ground, h, c, ground_maxima)
    for group in range(0, oscillators.shape[1], lanes):
        for i in range(lanes):
            a11[i], a12[i] = oscillators[A11, group + i], oscillators[A12, group + i]
            b10[i], b11[i] = oscillators[B10, group + i], oscillators[B11, group + i]
            a21[i], a22[i] = oscillators[A21, group + i], oscillators[A22, group + i]
            b20[i], b21[i] = oscillators[B20, group + i], oscillators[B21, group + i]
            by_u[i] = oscillators[BY_DISPLACEMENT, group + i]
            by_v[i] = oscillators[BY_VELOCITY, group + i]
            us[i] = vs[i] = 0.0
        # `size_u`, `size_v` and `size_a` are the maxima of |u|, |v| and |omega^2 u + 2 xi omega v|
        # until now.
        for c in range(intervals):
            for i in range(lanes):
                starts[i, c, 0], starts[i, c, 1] = us[i], vs[i]
                max_u[i], max_v[i] = abs(us[i]), abs(vs[i])
                max_a[i] = abs(by_u[i] * us[i] + by_v[i] * vs[i])
            for s in range(c * INTERVAL_STEPS, (c + 1) * INTERVAL_STEPS, _BLOCK):
                for i in range(lanes):
                    u, v, size_u, size_v, size_a = us[i], vs[i], max_u[i], max_v[i], max_a[i]
                    for j in range(_BLOCK):
                        g0, g1 = ground[s + j], ground[s + j + 1]
                        u1 = a11[i] * u + (a12[i] * v - (b10[i] * g0 + b11[i] * g1))
                        v = a21[i] * u + (a22[i] * v - (b20[i] * g0 + b21[i] * g1))
                        u = u1
                        a = abs(by_u[i] * u + by_v[i] * v)
                        size_u = abs(u) if abs(u) > size_u else size_u
                        size_v = abs(v) if abs(v) > size_v else size_v
                        size_a = a if a > size_a else size_a
                    us[i], vs[i], max_u[i], max_v[i], max_a[i] = u, v, size_u, size_v, size_a
            for i in range(lanes):
                maxima[i, c, 0], maxima[i, c, 1], maxima[i, c, 2] = max_u[i], max_v[i], max_a[i]
        # Row `intervals` of `starts` is the state at the start of the remaining steps.
        for i in range(min(lanes, result.shape[1] - group)):
            starts[i, intervals, 0], starts[i, intervals, 1] = us[i], vs[i]
            best[:] = 0.0
            oscillator = _TableOscillator(
                ground, h, oscillators, group + i, starts[i], between_steps, series, best
            )
            _search(oscillator, maxima[i], ground_maxima)
            for k in range(PEAKS):
                result[k, group + i] = best[k]
    return 0


@outlined
def _measure_ground(ground, h, interval, ground_maxima):
    """Store the maximum absolute ground acceleration (m/s^2) and its maximum rate (m/s^3) in a
    complete interval.
    """
    begin = interval * INTERVAL_STEPS
    size, slope = abs(ground[begin]), 0.0
    for s in range(begin, begin + INTERVAL_STEPS):
        size = max(size, abs(ground[s + 1]))
        slope = max(slope, abs(ground[s + 1] - ground[s]))
    ground_maxima[interval, 0], ground_maxima[interval, 1] = size, slope / h


class _TableOscillator(NamedTuple):
    """Oscillator in `column` of the table that is integrated separately; `best` contains its maxima
    until now.
    """

    ground: Array
    h: float
    oscillators: Array
    column: int
    starts: Array
    between_steps: int
    series: Array
    best: Array


@inline
def _vibration(oscillator):
    """Return omega^2 (1/s^2) and 2 xi omega (1/s) of an oscillator of the table, and the length of
    its steps (s).
    """
    oscillators, column = oscillator.oscillators, oscillator.column
    return Vibration(
        oscillators[BY_DISPLACEMENT, column], oscillators[BY_VELOCITY, column], oscillator.h
    )


@outlined
def _search(oscillator, maxima, ground_maxima):
    """Compute the maxima of an oscillator from its maxima at the steps of each interval (`maxima`).

    Intervals where the bound of a quantity (`excess_factor`) does not exceed the maximum of the
    run are skipped. The bounds of the second derivatives are

        |u''| <= max |p| + max |ag|,   |v''| <= 2 xi omega |u''| + omega^2 |v| + max |ag'|
        |p''| <= 2 xi omega |v''| + omega^2 |u''|,   p = 2 xi omega v + omega^2 u

    where -p is the absolute acceleration.
    """
    # Intervals with the maximum of each quantity; `intervals` without a complete interval
    best = oscillator.best
    intervals = maxima.shape[0]
    interval_u = interval_v = interval_a = intervals
    for c in range(intervals):
        if maxima[c, 0] > best[0]:
            interval_u, best[0] = c, maxima[c, 0]
        if maxima[c, 1] > best[1]:
            interval_v, best[1] = c, maxima[c, 1]
        if maxima[c, 2] > best[2]:
            interval_a, best[2] = c, maxima[c, 2]
    # The steps after the last complete interval have no stored maxima.
    u, v = _integrate_interval(oscillator, intervals)
    if oscillator.between_steps == 0:
        return
    _vibrate_freely(oscillator, u, v)
    # Few other intervals can exceed the maxima of the intervals with the maximum samples.
    if interval_u < intervals:
        _integrate_interval(oscillator, interval_u)
    if interval_v < intervals and interval_v != interval_u:
        _integrate_interval(oscillator, interval_v)
    if interval_a < intervals and interval_a != interval_u and interval_a != interval_v:
        _integrate_interval(oscillator, interval_a)
    vibration = _vibration(oscillator)
    by_u, by_v, _ = vibration
    factor = excess_factor(vibration)
    for c in range(intervals):
        if c in (interval_u, interval_v, interval_a):
            continue
        bound_u = maxima[c, 2] + ground_maxima[c, 0]
        bound_v = by_v * bound_u + by_u * maxima[c, 1] + ground_maxima[c, 1]
        bound_a = by_v * bound_v + by_u * bound_u
        if (
            maxima[c, 0] + factor * bound_u > best[0]
            or maxima[c, 1] + factor * bound_v > best[1]
            or maxima[c, 2] + factor * bound_a > best[2]
        ):
            _integrate_interval(oscillator, c)


@outlined
def _vibrate_freely(oscillator, u, v):
    """Update the maxima of an oscillator with the free vibration from the state u, v."""
    vibration, best = _vibration(oscillator), oscillator.best
    by_u, by_v, _ = vibration
    p = by_u * u + by_v * v  # the relative acceleration is -p
    best[0] = largest_afterwards(u, v, vibration, best[0])
    best[1] = largest_afterwards(v, -p, vibration, best[1])
    best[2] = largest_afterwards(p, by_u * v - by_v * p, vibration, best[2])


@outlined
def _integrate_interval(oscillator, interval):
    """Integrate one oscillator over an interval of steps, update its maxima, and return its
    displacement and velocity at the end.

    -p = -(omega^2 u + 2 xi omega v) is the absolute acceleration, a = -p - ag the relative
    acceleration and j = -p' - ag' its rate. `dp`, `ddp` and `dddp` are the first, second and third
    derivative of p. The suffix 1 denotes the end of a step. The index after the last complete
    interval denotes the remaining steps.
    """
    ground, h, oscillators, column, starts, between_steps, series, best = oscillator
    a11, a12 = oscillators[A11, column], oscillators[A12, column]
    b10, b11 = oscillators[B10, column], oscillators[B11, column]
    a21, a22 = oscillators[A21, column], oscillators[A22, column]
    b20, b21 = oscillators[B20, column], oscillators[B21, column]
    vibration = _vibration(oscillator)
    by_u, by_v, _ = vibration
    # `n` is the number of terms of the Taylor series.
    factor, n = excess_factor(vibration), term_count(vibration)
    u, v = starts[interval, 0], starts[interval, 1]
    g0 = ground[interval * INTERVAL_STEPS]
    p = by_u * u + by_v * v  # the absolute acceleration is -p
    a = -p - g0
    for s in range(
        interval * INTERVAL_STEPS, min((interval + 1) * INTERVAL_STEPS, ground.size - 1)
    ):
        g1 = ground[s + 1]
        u1 = a11 * u + (a12 * v - (b10 * g0 + b11 * g1))
        v1 = a21 * u + (a22 * v - (b20 * g0 + b21 * g1))
        p1 = by_u * u1 + by_v * v1
        a1 = -p1 - g1
        best[0] = max(best[0], abs(u1))
        best[1] = max(best[1], abs(v1))
        best[2] = max(best[2], abs(p1))
        if between_steps == 1:
            # ag is linear within the step (ag'' = 0), so that j' = -p''. Therefore the third
            # derivative of v is -p'', and p''' = omega^2 j - 2 xi omega p''.
            slope = (g1 - g0) / h
            dp, dp1 = by_u * v + by_v * a, by_u * v1 + by_v * a1
            j, j1 = -dp - slope, -dp1 - slope
            ddp, ddp1 = by_u * a + by_v * j, by_u * a1 + by_v * j1
            if may_exceed(best[0], factor, u, v, a, u1, v1, a1):
                best[0] = max(best[0], largest_between(u, (v, a, j), v1, vibration, n, series))
            if may_exceed(best[1], factor, v, a, j, v1, a1, j1):
                best[1] = max(best[1], largest_between(v, (a, j, -ddp), a1, vibration, n, series))
            if may_exceed(best[2], factor, p, dp, ddp, p1, dp1, ddp1):
                dddp = by_u * j - by_v * ddp
                best[2] = max(
                    best[2], largest_between(p, (dp, ddp, dddp), dp1, vibration, n, series)
                )
        u, v, p, a, g0 = u1, v1, p1, a1, g1
    return u, v
