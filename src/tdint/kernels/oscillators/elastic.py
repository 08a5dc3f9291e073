"""Peak response of many linear oscillators to one ground motion, many oscillators side by side.

The motion is linear between its samples, so that the recursion from sample to sample is exact
(Nigam and Jennings
1969) and the motion of an oscillator between two samples is known, too. What is asked for is its
  largest value, at the samples and between them:

1. All oscillators march together and leave the largest values at the samples of each stretch of
  `STRETCH` steps.
2. Between two samples a quantity q cannot exceed the larger of its two values by more than h^2/8
  times the largest
   q'' there, and q'' is a free vibration, which the largest values bound. Few stretches can hold
   the largest value; these are marched again, one oscillator at a time.
3. Where q' changes its sign between two samples of such a stretch, Newton's method finds the place
  on the Taylor series
   of q. With omega h <= 1 a dozen terms leave less than 1e-9.

Steps longer than that are divided by the caller, for each oscillator as it needs.
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
from tdint.kernels.oscillators.between import (
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
    divide,
    largest_between,
    may_exceed,
    rise,
    terms,
)
from tdint.kernels.stepping import Array

# Rows of the table of oscillators behind those of the recursion
BY_DISPLACEMENT = RECURSION_ROWS  # omega^2
BY_VELOCITY = RECURSION_ROWS + 1  # 2 xi omega
COEFFICIENTS = RECURSION_ROWS + 2

# Rows of the table of peaks
PEAK_DISPLACEMENT = 0
PEAK_VELOCITY = 1
PEAK_ACCELERATION = 2
PEAKS = 3

STRETCH = 32
"""Steps over which largest values are kept."""

_BLOCK = 4  # steps that a lane does before the next lane's turn: its numbers stay in registers


def scratch(samples: int, parts: int, lanes: int) -> tuple[NDArray[np.float64], ...]:
    """What `peaks` works on for so many samples, parts and lanes."""
    steps = (samples - 1) * parts
    whole = steps // STRETCH
    return (
        np.empty(steps + 1),
        np.empty((lanes, whole + 1, 2)),
        np.empty((lanes, whole, PEAKS)),
        np.empty((whole, 2)),
    )


@kernel(
    I8(VECTOR, F8, I8, TABLE, I8, I8, TABLE, VECTOR, CUBE, CUBE, TABLE), parts=(), vectorized=True
)
def peaks(samples, dt, parts, oscillators, lanes, between, result, ground, starts, tops, shaking):
    """March oscillators from rest over a ground motion; largest absolute values.

    Displacement and velocity are relative, the acceleration is absolute, 2 xi omega v + omega^2 u.

    Parameters
    ----------
    samples : ground acceleration, m/s^2, dt seconds apart; each interval is marched in so many
    `parts` of length h
    oscillators : shape (COEFFICIENTS, multiple of `lanes`); a group of `lanes` is marched together
    between : 1 for the largest values between the steps' ends, too (omega h must not exceed 1), 0
    for those at the ends
    result : shape (PEAKS, k), filled for the first k oscillators; the others only fill up the last
    group ground, starts, tops, shaking : of `scratch`

    Returns 0.
    """
    h = dt / parts
    divide(samples, parts, ground)
    steps = ground.size - 1
    whole = steps // STRETCH
    # Arrays of their own: the compiler must see that they do not overlap.
    a11, a12, b10, b11 = local(lanes), local(lanes), local(lanes), local(lanes)
    a21, a22, b20, b21 = local(lanes), local(lanes), local(lanes), local(lanes)
    by_u, by_v = local(lanes), local(lanes)
    us, vs = local(lanes), local(lanes)
    top_u, top_v, top_a = local(lanes), local(lanes), local(lanes)
    best, series = local(PEAKS), local_table(3, TERMS)  # of q, q' and q''
    for c in range(whole):
        _measure_shaking(ground, h, c, shaking)
    for group in range(0, oscillators.shape[1], lanes):
        for i in range(lanes):
            a11[i], a12[i] = oscillators[A11, group + i], oscillators[A12, group + i]
            b10[i], b11[i] = oscillators[B10, group + i], oscillators[B11, group + i]
            a21[i], a22[i] = oscillators[A21, group + i], oscillators[A22, group + i]
            b20[i], b21[i] = oscillators[B20, group + i], oscillators[B21, group + i]
            by_u[i], by_v[i] = (
                oscillators[BY_DISPLACEMENT, group + i],
                oscillators[BY_VELOCITY, group + i],
            )
            us[i] = vs[i] = 0.0
        for c in range(whole):
            for i in range(lanes):
                starts[i, c, 0], starts[i, c, 1] = us[i], vs[i]
                top_u[i], top_v[i], top_a[i] = (
                    abs(us[i]),
                    abs(vs[i]),
                    abs(by_u[i] * us[i] + by_v[i] * vs[i]),
                )
            for s in range(c * STRETCH, (c + 1) * STRETCH, _BLOCK):
                for i in range(lanes):
                    u, v, size_u, size_v, size_a = us[i], vs[i], top_u[i], top_v[i], top_a[i]
                    for j in range(_BLOCK):
                        g0, g1 = ground[s + j], ground[s + j + 1]
                        u1 = a11[i] * u + (a12[i] * v - (b10[i] * g0 + b11[i] * g1))
                        v = a21[i] * u + (a22[i] * v - (b20[i] * g0 + b21[i] * g1))
                        u = u1
                        a = abs(by_u[i] * u + by_v[i] * v)
                        size_u = abs(u) if abs(u) > size_u else size_u
                        size_v = abs(v) if abs(v) > size_v else size_v
                        size_a = a if a > size_a else size_a
                    us[i], vs[i], top_u[i], top_v[i], top_a[i] = u, v, size_u, size_v, size_a
            for i in range(lanes):
                tops[i, c, 0], tops[i, c, 1], tops[i, c, 2] = top_u[i], top_v[i], top_a[i]
        for i in range(min(lanes, result.shape[1] - group)):
            starts[i, whole, 0], starts[i, whole, 1] = us[i], vs[i]
            best[:] = 0.0
            oscillator = _One(ground, h, oscillators, group + i, starts[i], between, series, best)
            _search(oscillator, tops[i], shaking)
            for k in range(PEAKS):
                result[k, group + i] = best[k]
    return 0


@outlined
def _measure_shaking(ground, h, stretch, shaking):
    """Largest acceleration and slope of the ground in a stretch."""
    begin = stretch * STRETCH
    size, slope = abs(ground[begin]), 0.0
    for s in range(begin, begin + STRETCH):
        size = max(size, abs(ground[s + 1]))
        slope = max(slope, abs(ground[s + 1] - ground[s]))
    shaking[stretch, 0], shaking[stretch, 1] = size, slope / h


class _One(NamedTuple):
    """One oscillator of the table that is marched by itself."""

    ground: Array
    h: float
    oscillators: Array
    column: int
    starts: Array  # displacement and velocity at the start of each stretch
    between: int  # 1 to look between the steps, too
    series: Array  # of q, q' and q''
    best: Array  # largest values so far


@inline
def _vibration(oscillator):
    oscillators, column = oscillator.oscillators, oscillator.column
    return Vibration(
        oscillators[BY_DISPLACEMENT, column], oscillators[BY_VELOCITY, column], oscillator.h
    )


@outlined
def _search(oscillator, tops, shaking):
    """Largest values of one oscillator, from its largest at the samples of each stretch."""
    best = oscillator.best
    whole = tops.shape[0]
    at_u = at_v = at_a = whole
    for c in range(whole):
        if tops[c, 0] > best[0]:
            at_u, best[0] = c, tops[c, 0]
        if tops[c, 1] > best[1]:
            at_v, best[1] = c, tops[c, 1]
        if tops[c, 2] > best[2]:
            at_a, best[2] = c, tops[c, 2]
    _march(oscillator, whole)
    if oscillator.between == 0:
        return
    # The stretches of the largest samples come first: what they leave is hard to exceed.
    if at_u < whole:
        _march(oscillator, at_u)
    if at_v < whole and at_v != at_u:
        _march(oscillator, at_v)
    if at_a < whole and at_a != at_u and at_a != at_v:
        _march(oscillator, at_a)
    vibration = _vibration(oscillator)
    by_u, by_v, _ = vibration
    margin = rise(vibration)
    for c in range(whole):
        if c in (at_u, at_v, at_a):
            continue
        bend_u = tops[c, 2] + shaking[c, 0]
        bend_v = by_v * bend_u + by_u * tops[c, 1] + shaking[c, 1]
        bend_a = by_v * bend_v + by_u * bend_u
        if (
            tops[c, 0] + margin * bend_u > best[0]
            or tops[c, 1] + margin * bend_v > best[1]
            or tops[c, 2] + margin * bend_a > best[2]
        ):
            _march(oscillator, c)


@outlined
def _march(oscillator, stretch):
    """March one oscillator over a stretch (or the steps after the last whole one) and look between
    the samples."""
    ground, h, oscillators, column, starts, between, series, best = oscillator
    a11, a12 = oscillators[A11, column], oscillators[A12, column]
    b10, b11 = oscillators[B10, column], oscillators[B11, column]
    a21, a22 = oscillators[A21, column], oscillators[A22, column]
    b20, b21 = oscillators[B20, column], oscillators[B21, column]
    vibration = _vibration(oscillator)
    by_u, by_v, _ = vibration
    margin, n = rise(vibration), terms(vibration)
    u, v = starts[stretch, 0], starts[stretch, 1]
    g0 = ground[stretch * STRETCH]
    p = by_u * u + by_v * v  # less the absolute acceleration
    a = -p - g0
    for s in range(stretch * STRETCH, min((stretch + 1) * STRETCH, ground.size - 1)):
        g1 = ground[s + 1]
        u1 = a11 * u + (a12 * v - (b10 * g0 + b11 * g1))
        v1 = a21 * u + (a22 * v - (b20 * g0 + b21 * g1))
        p1 = by_u * u1 + by_v * v1
        a1 = -p1 - g1
        best[0] = max(best[0], abs(u1))
        best[1] = max(best[1], abs(v1))
        best[2] = max(best[2], abs(p1))
        if between == 1:
            slope = (g1 - g0) / h
            dp, dp1 = by_u * v + by_v * a, by_u * v1 + by_v * a1
            j, j1 = -dp - slope, -dp1 - slope
            ddp, ddp1 = by_u * a + by_v * j, by_u * a1 + by_v * j1
            if may_exceed(best[0], margin, u, v, a, u1, v1, a1):
                best[0] = max(best[0], largest_between(u, (v, a, j), v1, vibration, n, series))
            if may_exceed(best[1], margin, v, a, j, v1, a1, j1):
                best[1] = max(best[1], largest_between(v, (a, j, -ddp), a1, vibration, n, series))
            if may_exceed(best[2], margin, p, dp, ddp, p1, dp1, ddp1):
                dddp = by_u * j - by_v * ddp
                best[2] = max(
                    best[2], largest_between(p, (dp, ddp, dddp), dp1, vibration, n, series)
                )
        u, v, p, a, g0 = u1, v1, p1, a1, g1
