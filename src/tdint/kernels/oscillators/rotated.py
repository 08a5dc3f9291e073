"""Peak displacement of many oscillators subjected to two horizontal ground motions, in each of 180
directions.

The two ground motions are two perpendicular components. The result is the maximum displacement in
each direction, at the samples and between the samples. As in `tdint.kernels.oscillators.elastic`,
all oscillators are integrated together first. This pass stores the maximum displacement along
`AXES` axes, the directions at steps of 30 degrees, for each interval of INTERVAL_STEPS steps. The
displacement in a direction between two adjacent axes is at most the larger of both displacements
divided by the cosine of half their angle. Therefore only few intervals can contain a maximum. In
these intervals, the same rule for sectors of 10 degrees keeps few steps and directions for the
exact computation.

The equation of motion along each component is u'' + 2 xi omega u' + omega^2 u = -ag. Displacement,
velocity and ground acceleration are x, v, f along the first component and y, w, g along the second,
the relative accelerations a and b. The displacement in the direction of the angle theta is x
cos(theta) + y sin(theta).

An edge is one of the directions at steps of 10 degrees, which are the limits of the sectors; edge 3
k is axis k. The steps after the last complete interval are treated as the interval with the next
index; it has no stored maxima. `best` contains the maximum displacement until now in each
direction, `scratch` the table of the sectors, and `margin` (`excess_factor`, s^2) times the maximum
relative acceleration bounds the excess of a displacement between two steps; it is 0 if maxima
between the steps are not required.
"""

from __future__ import annotations

import math
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
    TERMS,
    Vibration,
    excess_factor,
    interpolate_samples,
    largest_afterwards,
    largest_between,
    may_exceed,
    term_count,
)
from tdint.kernels.oscillators.elastic import (
    BY_DISPLACEMENT,
    BY_VELOCITY,
    COEFFICIENTS,
    INTERVAL_STEPS,
)
from tdint.kernels.stepping import Array

ANGLES = 180
"""Number of directions at steps of 1 degree. Direction 0 is the first ground motion component,
direction 90 the second component."""

# Number of axes, at steps of 30 degrees; a displacement between two axes exceeds the larger of both
# by at most a factor of 1.04
AXES = 6
_SECTORS = 18  # number of sectors of 10 degrees; few steps can contain a maximum of a sector
_SECTOR = ANGLES // _SECTORS  # directions in a sector
_SECTORS_PER_WEDGE = _SECTORS // AXES  # number of sectors between two axes
# Bound of the displacement in a sector divided by the larger displacement along its edges
_SPREAD = 1.0 / math.cos(math.radians(_SECTOR / 2))
# The unit vector at j sectors after an axis is the sum of the next axis times factor j and of this
# axis times factor _SECTORS_PER_WEDGE - j.
_FACTORS = tuple(
    math.sin(math.radians(j * _SECTOR)) / math.sin(math.pi / AXES)
    for j in range(_SECTORS_PER_WEDGE + 1)
)

# Rows of the table with one column for each edge of a sector; the last edge is equal to the first
# edge
# Smallest of the maximum displacements until now, over the directions of the sector after the edge
_LOWEST = 0
_AT_START = 1  # absolute displacements along the edges at the start and at the end of the step
_AT_END = 2
_COSINES = 3  # cosines and sines of the directions of the edges
_SINES = 4
_SECTOR_ROWS = 5
_ACCELERATION = AXES  # index of the maximum relative acceleration, after the maximum displacements
_C, _S = math.cos(math.pi / 6), 0.5  # cosine and sine of 30 degrees
# Number of steps of an oscillator in a call of `_advance`; then the next oscillator of the group
# follows. Must divide INTERVAL_STEPS.
_BLOCK = 4

LANES = 16
"""Number of oscillators that are integrated together. A constant, so that the compiler knows the
position of their values."""

# Rows of the values of the oscillators in a group, after the rows of the table of oscillators
_STATE = COEFFICIENTS
_X, _V = _STATE, _STATE + 1  # displacement and velocity along the first component
_Y, _W = _STATE + 2, _STATE + 3  # displacement and velocity along the second component
# Maximum displacements along the AXES axes, then the square of the maximum relative acceleration
_MAXIMA = _STATE + 4
_ROWS = _MAXIMA + AXES + 1


def scratch(samples: int, parts: int) -> tuple[NDArray[np.float64], ...]:
    """Return the scratch arrays of `rotated_peaks`, uninitialized, in the order of its arguments.

    Returns
    -------
    ground : ndarray, shape (2, steps + 1)
        Ground accelerations of both components at the steps, m/s^2.
    starts : ndarray, shape (LANES, intervals + 1, 4)
        Displacement (m) and velocity (m/s) along the first component, then along the second
        component, of each oscillator at the start of each interval.
    maxima : ndarray, shape (LANES, intervals, AXES + 1)
        Maximum absolute displacement along each of the AXES axes in each interval (m), then the
        maximum resultant of the relative accelerations of both components (m/s^2).
    """
    steps = (samples - 1) * parts
    intervals = steps // INTERVAL_STEPS
    return (
        np.empty((2, steps + 1)),
        np.empty((LANES, intervals + 1, 4)),
        np.empty((LANES, intervals, AXES + 1)),
    )


@kernel(
    I8(VECTOR, VECTOR, F8, I8, TABLE, TABLE, I8, TABLE, TABLE, CUBE, CUBE),
    has_forms=False,
    vectorized=True,
)
def rotated_peaks(
    first, second, dt, parts, oscillators, directions, between_steps, result, ground, starts, maxima
):
    """Integrate oscillators from rest over two ground motions and store their maximum absolute
    displacements in all directions.

    The oscillators of LANES successive columns are integrated together. The result is always 0,
    because the integration of linear oscillators cannot fail.

    Parameters
    ----------
    first, second : ndarray
        Ground accelerations of both components at the samples, m/s^2.
    parts : int
        Steps per sampling interval. The option `parts` of the decorator is a different quantity.
    oscillators : ndarray, shape (COEFFICIENTS, multiple of LANES)
        Table of oscillators, one column per oscillator, as in `tdint.kernels.oscillators.elastic`.
    directions : ndarray, shape (2, ANGLES)
        Cosine and sine of each direction, at 0, 1, ..., 179 degrees.
    between_steps : int
        As in `tdint.kernels.oscillators.elastic.peaks`; the last samples must then be zero.
    result : ndarray, shape (k, ANGLES)
        Receives the peaks of the first k oscillators, m.
    ground, starts, maxima : ndarray
        Scratch arrays from `scratch`.
    """
    h = dt / parts
    interpolate_samples(first, parts, ground[0])
    interpolate_samples(second, parts, ground[1])
    intervals = (ground.shape[1] - 1) // INTERVAL_STEPS
    # Value `row` of oscillator `i` is element row * LANES + i. The rows are the COEFFICIENTS rows
    # of the table of oscillators, then the rows from _STATE on.
    lane = local(_ROWS * LANES)
    # The table of sectors has a column for each of their edges, at 0, 10, ..., 180 degrees. The
    # last edge is equal to the first edge, because only absolute displacements are used.
    best, scratch = local(ANGLES), local_table(_SECTOR_ROWS, _SECTORS + 1)
    for k in range(_SECTORS + 1):
        scratch[_COSINES, k] = directions[0, k * _SECTOR % ANGLES]
        scratch[_SINES, k] = directions[1, k * _SECTOR % ANGLES]
    # Taylor series of a displacement and its two derivatives
    series = local_table(3, TERMS)
    for group in range(0, oscillators.shape[1], LANES):
        for k in range(COEFFICIENTS):
            for i in range(LANES):
                lane[k * LANES + i] = oscillators[k, group + i]
        for i in range(_STATE * LANES, _MAXIMA * LANES):
            lane[i] = 0.0
        # Index `intervals` denotes the remaining steps. Only the state at their start is stored.
        for c in range(intervals + 1):
            for i in range(LANES):
                for k in range(4):
                    starts[i, c, k] = lane[(_STATE + k) * LANES + i]
            if c == intervals:
                break
            for i in range(_MAXIMA * LANES, _ROWS * LANES):
                lane[i] = 0.0
            for s in range(c * INTERVAL_STEPS, (c + 1) * INTERVAL_STEPS, _BLOCK):
                _advance(ground, s, lane)
            for i in range(LANES):
                for k in range(AXES):
                    maxima[i, c, k] = lane[(_MAXIMA + k) * LANES + i]
                # `_advance` stores the square of the acceleration.
                maxima[i, c, _ACCELERATION] = math.sqrt(lane[(_MAXIMA + _ACCELERATION) * LANES + i])
        for i in range(min(LANES, result.shape[0] - group)):
            best[:] = 0.0
            column = group + i
            vibration = Vibration(
                oscillators[BY_DISPLACEMENT, column], oscillators[BY_VELOCITY, column], h
            )
            oscillator = _TableOscillator(
                ground, oscillators, column, vibration, directions, starts[i], scratch, series, best
            )
            _search(oscillator, maxima[i], between_steps * excess_factor(vibration))
            for k in range(ANGLES):
                result[group + i, k] = best[k]
    return 0


@outlined
def _advance(ground, s, lane):
    """Integrate LANES oscillators over a block of steps from step `s` on, and update the maxima at
    the steps.

    `lane` contains the values of the oscillators (`rotated_peaks`).
    """
    for i in range(LANES):
        a11, a12 = lane[A11 * LANES + i], lane[A12 * LANES + i]
        b10, b11 = lane[B10 * LANES + i], lane[B11 * LANES + i]
        a21, a22 = lane[A21 * LANES + i], lane[A22 * LANES + i]
        b20, b21 = lane[B20 * LANES + i], lane[B21 * LANES + i]
        by_u, by_v = lane[BY_DISPLACEMENT * LANES + i], lane[BY_VELOCITY * LANES + i]
        x, v = lane[_X * LANES + i], lane[_V * LANES + i]
        y, w = lane[_Y * LANES + i], lane[_W * LANES + i]
        # t0 to t5 are the maximum displacements along the axes.
        t0, t1 = lane[_MAXIMA * LANES + i], lane[(_MAXIMA + 1) * LANES + i]
        t2, t3 = lane[(_MAXIMA + 2) * LANES + i], lane[(_MAXIMA + 3) * LANES + i]
        t4, t5 = lane[(_MAXIMA + 4) * LANES + i], lane[(_MAXIMA + 5) * LANES + i]
        # Without a square root
        max_acceleration_squared = lane[(_MAXIMA + _ACCELERATION) * LANES + i]
        # The maxima include both endpoints of the block. The last pass has no step.
        for j in range(_BLOCK + 1):
            f0, g0 = ground[0, s + j], ground[1, s + j]
            cx, sx, cy, sy = _C * x, _S * x, _C * y, _S * y
            t0 = abs(x) if abs(x) > t0 else t0
            t1 = abs(cx + sy) if abs(cx + sy) > t1 else t1
            t2 = abs(sx + cy) if abs(sx + cy) > t2 else t2
            t3 = abs(y) if abs(y) > t3 else t3
            t4 = abs(cy - sx) if abs(cy - sx) > t4 else t4
            t5 = abs(sy - cx) if abs(sy - cx) > t5 else t5
            # a and b have the opposite sign, which has no effect on the squares.
            a, b = by_u * x + by_v * v + f0, by_u * y + by_v * w + g0
            acceleration_squared = a * a + b * b
            max_acceleration_squared = (
                acceleration_squared
                if acceleration_squared > max_acceleration_squared
                else max_acceleration_squared
            )
            if j < _BLOCK:
                f1, g1 = ground[0, s + j + 1], ground[1, s + j + 1]
                x1 = a11 * x + (a12 * v - (b10 * f0 + b11 * f1))
                v = a21 * x + (a22 * v - (b20 * f0 + b21 * f1))
                x = x1
                y1 = a11 * y + (a12 * w - (b10 * g0 + b11 * g1))
                w = a21 * y + (a22 * w - (b20 * g0 + b21 * g1))
                y = y1
        lane[_X * LANES + i], lane[_V * LANES + i] = x, v
        lane[_Y * LANES + i], lane[_W * LANES + i] = y, w
        lane[_MAXIMA * LANES + i], lane[(_MAXIMA + 1) * LANES + i] = t0, t1
        lane[(_MAXIMA + 2) * LANES + i], lane[(_MAXIMA + 3) * LANES + i] = t2, t3
        lane[(_MAXIMA + 4) * LANES + i], lane[(_MAXIMA + 5) * LANES + i] = t4, t5
        lane[(_MAXIMA + _ACCELERATION) * LANES + i] = max_acceleration_squared


class _TableOscillator(NamedTuple):
    """Oscillator in `column` of the table that is integrated separately; `vibration` contains its
    properties and the length of a step.
    """

    ground: Array
    oscillators: Array
    column: int
    vibration: Vibration
    directions: Array
    starts: Array
    scratch: Array
    series: Array
    best: Array


@outlined
def _search(oscillator, maxima, margin):
    """Compute the maximum displacements of an oscillator in all directions.

    Only intervals that can contain a maximum are integrated, in two passes:

    1. Preliminary maxima, from the values at the steps only. This pass integrates the remaining
       steps, and for each axis the interval with the maximum along this axis. The results are close
       to the final maxima, so that few intervals can exceed them.
    2. Final maxima, with the maxima between the steps. An interval is skipped if its bounds show
       that no displacement of the interval can exceed a maximum in `best`. The remaining steps have
       no bounds and are always integrated. The free vibration after the last sample is included if
       maxima between the steps are.

    The bounds along the edges follow from those along the axes (`_interpolate`). Row _LOWEST of
    `scratch` contains, for each sector, the smallest of the maxima in its directions.
    """
    scratch, best = oscillator.scratch, oscillator.best
    intervals = maxima.shape[0]
    lowest = scratch[_LOWEST]
    # If two successive axes have the same interval, it is not integrated again.
    _integrate_interval(oscillator, intervals, margin, True)
    last_interval = intervals
    for k in range(AXES):
        interval = 0
        for c in range(1, intervals):
            if maxima[c, k] > maxima[interval, k]:
                interval = c
        if intervals > 0 and interval != last_interval:
            _integrate_interval(oscillator, interval, margin, True)
            last_interval = interval
    for k in range(_SECTORS):
        lowest[k] = _lowest(best, k)
    x, v, y, w = _integrate_interval(oscillator, intervals, margin, False)
    if margin > 0.0:
        for k in range(ANGLES):
            c, d = oscillator.directions[0, k], oscillator.directions[1, k]
            best[k] = largest_afterwards(
                c * x + d * y, c * v + d * w, oscillator.vibration, best[k]
            )
    for c in range(intervals):
        _interpolate(maxima[c], scratch)
        if _count_higher(scratch, margin * maxima[c, _ACCELERATION]) > 0:
            _integrate_interval(oscillator, c, margin, False)


@outlined
def _interpolate(axis_maxima, scratch):
    """Store bounds of the displacements along the edges of the sectors in an interval of steps.

    A unit vector at j sectors after an axis is f(3 - j) times this axis plus f(j) times the next
    axis, with the factors f of _FACTORS. The same sum of the maximum displacements along both axes
    is a bound of the displacement in this direction. The last axis is followed by the first axis
    with the opposite direction, for which the absolute displacements are the same.

    An interval has a single bound, which is stored in both rows, _AT_START and _AT_END, that `_top`
    compares.
    """
    for k in range(AXES):
        axis_maximum, next_axis_maximum = axis_maxima[k], axis_maxima[(k + 1) % AXES]
        for j in range(_SECTORS_PER_WEDGE):
            bound = (
                _FACTORS[_SECTORS_PER_WEDGE - j] * axis_maximum + _FACTORS[j] * next_axis_maximum
            )
            edge = k * _SECTORS_PER_WEDGE + j
            scratch[_AT_START, edge] = scratch[_AT_END, edge] = bound
    scratch[_AT_START, _SECTORS] = scratch[_AT_END, _SECTORS] = axis_maxima[0]


@outlined
def _lowest(best, sector):
    """Return the smallest of the maximum displacements in the directions of a sector, m.

    A step can only change a maximum in the sector if its displacement exceeds the result.
    """
    low = best[sector * _SECTOR]
    for k in range(sector * _SECTOR + 1, (sector + 1) * _SECTOR):
        low = min(low, best[k])
    return low


@outlined
def _integrate_interval(oscillator, interval, margin, coarse):
    """Integrate one oscillator over an interval of steps, update its maxima in all directions, and
    return displacement and velocity along both components at the end.

    p and q are the rates of the relative accelerations a and b (jerks) along both components,
    m/s^3. The suffixes 0 and 1 denote the start and the end of a step; x, y, v, w, a and b without
    a suffix are values at the start. The displacement in a direction with the cosine c and the sine
    d is c x + d y.

    A sector is skipped in a step if the displacement in the sector cannot exceed the smallest of
    its maxima until now.

    `coarse` is True for the pass of preliminary maxima: only values at the steps are used, in all
    directions, and row _LOWEST is not used.
    """
    ground, oscillators, column, vibration, directions, starts, scratch, series, best = oscillator
    a11, a12 = oscillators[A11, column], oscillators[A12, column]
    b10, b11 = oscillators[B10, column], oscillators[B11, column]
    a21, a22 = oscillators[A21, column], oscillators[A22, column]
    b20, b21 = oscillators[B20, column], oscillators[B21, column]
    by_u, by_v, h = vibration
    n = term_count(vibration)
    lowest, start_values, end_values = scratch[_LOWEST], scratch[_AT_START], scratch[_AT_END]
    x, v, y, w = starts[interval, 0], starts[interval, 1], starts[interval, 2], starts[interval, 3]
    f0, g0 = ground[0, interval * INTERVAL_STEPS], ground[1, interval * INTERVAL_STEPS]
    a, b = -(by_u * x + by_v * v) - f0, -(by_u * y + by_v * w) - g0
    _project(x, y, scratch, start_values)
    for s in range(
        interval * INTERVAL_STEPS, min((interval + 1) * INTERVAL_STEPS, ground.shape[1] - 1)
    ):
        f1, g1 = ground[0, s + 1], ground[1, s + 1]
        x1 = a11 * x + (a12 * v - (b10 * f0 + b11 * f1))
        v1 = a21 * x + (a22 * v - (b20 * f0 + b21 * f1))
        y1 = a11 * y + (a12 * w - (b10 * g0 + b11 * g1))
        w1 = a21 * y + (a22 * w - (b20 * g0 + b21 * g1))
        a1, b1 = -(by_u * x1 + by_v * v1) - f1, -(by_u * y1 + by_v * w1) - g1
        if coarse:
            for k in range(ANGLES):
                size = abs(directions[0, k] * x1 + directions[1, k] * y1)
                best[k] = size if size > best[k] else best[k]
        else:
            _project(x1, y1, scratch, end_values)
            excess = margin * math.sqrt(max(a * a + b * b, a1 * a1 + b1 * b1))
            # Relative jerks at the start of the step
            p = -(by_u * v + by_v * a) - (f1 - f0) / h
            q = -(by_u * w + by_v * b) - (g1 - g0) / h
            # `_count_higher` usually returns 0.
            for sector in range(_SECTORS if _count_higher(scratch, excess) > 0 else 0):
                if _top(scratch, sector) * _SPREAD + excess <= lowest[sector]:
                    continue
                for k in range(sector * _SECTOR, (sector + 1) * _SECTOR):
                    # Motion in direction `k`: the displacements at both endpoints of the step are
                    # u0 and u1, the velocities v0 and `speed`, the accelerations e0 and e1.
                    c, d = directions[0, k], directions[1, k]
                    u0, u1, v0 = c * x + d * y, c * x1 + d * y1, c * v + d * w
                    speed, e0, e1 = c * v1 + d * w1, c * a + d * b, c * a1 + d * b1
                    best[k] = max(best[k], abs(u1))
                    # The third derivative of u0 is the jerk c p + d q.
                    if margin > 0.0 and may_exceed(best[k], margin, u0, v0, e0, u1, speed, e1):
                        size = largest_between(
                            u0, (v0, e0, c * p + d * q), speed, vibration, n, series
                        )
                        best[k] = max(best[k], size)
                lowest[sector] = _lowest(best, sector)
            for k in range(_SECTORS + 1):
                start_values[k] = end_values[k]
        x, v, y, w, a, b, f0, g0 = x1, v1, y1, w1, a1, b1, f1, g1
    return x, v, y, w


@outlined
def _project(x, y, scratch, sizes):
    """Store the absolute displacements |x cos(theta) + y sin(theta)| along the edges of the
    sectors, m.

    `x` and `y` are the displacements along both ground motion components, m. `sizes` contains the
    receives the absolute displacements, one element per edge.
    """
    for k in range(_SECTORS + 1):
        sizes[k] = abs(scratch[_COSINES, k] * x + scratch[_SINES, k] * y)


@outlined
def _count_higher(scratch, excess):
    """Return the number of sectors with a maximum that the displacement of a step, or of an
    interval of steps (`_interpolate`), can exceed; `excess` is the bound of the excess between the
    steps, m.
    """
    count = 0
    for k in range(_SECTORS):
        count += 1 if _top(scratch, k) * _SPREAD + excess > scratch[_LOWEST, k] else 0
    return count


@inline
def _top(scratch, k):
    """Return the largest displacement along both edges of sector `k` at both endpoints of a step,
    m.
    """
    return max(
        max(scratch[_AT_START, k], scratch[_AT_END, k]),
        max(scratch[_AT_START, k + 1], scratch[_AT_END, k + 1]),
    )
