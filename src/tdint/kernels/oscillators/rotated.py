"""Peak displacement of many oscillators under two horizontal motions, in each of 180 directions.

The two motions shake the oscillators along two axes; what is asked for is the largest displacement
along every direction, at the samples and between them. As in `spectra` all oscillators march
together first. They leave the largest displacement of each stretch of steps along `AXES`
directions; no displacement along a direction between two of these is larger than the larger one
over the cosine of half the angle between them. Few stretches can therefore hold a largest
displacement; in these, by the same rule for narrower sectors, few steps and directions remain to be
looked at.
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
from tdint.kernels.oscillators.between import (
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
    divide,
    largest_between,
    may_exceed,
    rise,
    terms,
)
from tdint.kernels.oscillators.elastic import BY_DISPLACEMENT, BY_VELOCITY, COEFFICIENTS, STRETCH
from tdint.kernels.stepping import Array

ANGLES = 180
"""Directions, one degree apart from the first motion towards the second."""

AXES = 6  # 30 degrees apart: no displacement between two exceeds 1.04 times the larger one
_SECTORS = 18  # 10 degrees each, in which few steps remain
_SECTOR = ANGLES // _SECTORS
_SECTORS_PER_WEDGE = _SECTORS // AXES  # between two axes
_SPREAD = 1.0 / math.cos(math.radians(_SECTOR / 2))
_FACTORS = tuple(
    math.sin(math.radians(j * _SECTOR)) / math.sin(math.pi / AXES)
    for j in range(_SECTORS_PER_WEDGE + 1)
)

# Rows of numbers per edge of a sector; the last edge is the first one again
_LOWS = 0  # of the sector behind the edge: the smallest of the largest displacements
_BEFORE = 1  # absolute displacements at the step's start, and at its end
_AFTER = 2
_COSINES = 3
_SINES = 4
_WORK = 5
_BEND = AXES  # place of the largest relative acceleration after the largest displacements
_C, _S = math.cos(math.pi / 6), 0.5
_BLOCK = 4

LANES = 16
"""Oscillators that march together; a constant, so that the compiler sees where the numbers of each
begin."""

# Rows of the numbers of the lanes, behind those of the table of oscillators
_STATE = COEFFICIENTS
_X, _V = _STATE, _STATE + 1  # displacement and velocity along the first axis,
_Y, _W = _STATE + 2, _STATE + 3  # and along the second
_TOPS = (
    _STATE + 4
)  # largest displacements along the axes, then the square of the largest relative acceleration
_ROWS = _TOPS + AXES + 1


def scratch(samples: int, parts: int) -> tuple[NDArray[np.float64], ...]:
    """What `rotated_peaks` works on for so many samples and parts."""
    steps = (samples - 1) * parts
    whole = steps // STRETCH
    return (
        np.empty((2, steps + 1)),
        np.empty((LANES, whole + 1, 4)),
        np.empty((LANES, whole, AXES + 1)),
    )


@kernel(
    I8(VECTOR, VECTOR, F8, I8, TABLE, TABLE, I8, TABLE, TABLE, CUBE, CUBE),
    parts=(),
    vectorized=True,
)
def rotated_peaks(
    first, second, dt, parts, oscillators, directions, between, result, ground, starts, tops
):
    """March oscillators from rest over two ground motions; largest absolute displacements in all
    directions.

    Parameters
    ----------
    first, second : ground accelerations, m/s^2, dt seconds apart; each interval is marched in so
    many `parts`
    oscillators : as for `spectra.peaks`, with a multiple of LANES columns
    directions : shape (2, ANGLES), cosine and sine of each
    between : 1 for the largest values between the steps' ends, too (omega h must not exceed 1), 0
    for those at the ends
    result : shape (k, ANGLES), filled for the first k oscillators
    ground, starts, tops : of `scratch`

    Returns 0.
    """
    h = dt / parts
    divide(first, parts, ground[0])
    divide(second, parts, ground[1])
    whole = (ground.shape[1] - 1) // STRETCH
    lane = local(_ROWS * LANES)
    best, scratch = local(ANGLES), local_table(_WORK, _SECTORS + 1)
    for k in range(_SECTORS + 1):
        scratch[_COSINES, k] = directions[0, k * _SECTOR % ANGLES]
        scratch[_SINES, k] = directions[1, k * _SECTOR % ANGLES]
    series = local_table(3, TERMS)
    for group in range(0, oscillators.shape[1], LANES):
        for k in range(COEFFICIENTS):
            for i in range(LANES):
                lane[k * LANES + i] = oscillators[k, group + i]
        for i in range(_STATE * LANES, _TOPS * LANES):
            lane[i] = 0.0
        for c in range(whole + 1):
            for i in range(LANES):
                for k in range(4):
                    starts[i, c, k] = lane[(_STATE + k) * LANES + i]
            if c == whole:
                break
            for i in range(_TOPS * LANES, _ROWS * LANES):
                lane[i] = 0.0
            for s in range(c * STRETCH, (c + 1) * STRETCH, _BLOCK):
                _advance(ground, s, lane)
            for i in range(LANES):
                for k in range(AXES):
                    tops[i, c, k] = lane[(_TOPS + k) * LANES + i]
                tops[i, c, _BEND] = math.sqrt(lane[(_TOPS + _BEND) * LANES + i])
        for i in range(min(LANES, result.shape[0] - group)):
            best[:] = 0.0
            column = group + i
            vibration = Vibration(
                oscillators[BY_DISPLACEMENT, column], oscillators[BY_VELOCITY, column], h
            )
            oscillator = _One(
                ground, oscillators, column, vibration, directions, starts[i], scratch, series, best
            )
            _search(oscillator, tops[i], between * rise(vibration))
            for k in range(ANGLES):
                result[group + i, k] = best[k]
    return 0


@outlined
def _advance(ground, s, lane):
    """March LANES oscillators over a block of steps; keep the largest values at their starts and
    ends."""
    for i in range(LANES):
        a11, a12, b10, b11 = (
            lane[A11 * LANES + i],
            lane[A12 * LANES + i],
            lane[B10 * LANES + i],
            lane[B11 * LANES + i],
        )
        a21, a22, b20, b21 = (
            lane[A21 * LANES + i],
            lane[A22 * LANES + i],
            lane[B20 * LANES + i],
            lane[B21 * LANES + i],
        )
        by_u, by_v = lane[BY_DISPLACEMENT * LANES + i], lane[BY_VELOCITY * LANES + i]
        x, v, y, w = (
            lane[_X * LANES + i],
            lane[_V * LANES + i],
            lane[_Y * LANES + i],
            lane[_W * LANES + i],
        )
        t0, t1, t2 = (
            lane[_TOPS * LANES + i],
            lane[(_TOPS + 1) * LANES + i],
            lane[(_TOPS + 2) * LANES + i],
        )
        t3, t4, t5 = (
            lane[(_TOPS + 3) * LANES + i],
            lane[(_TOPS + 4) * LANES + i],
            lane[(_TOPS + 5) * LANES + i],
        )
        bend = lane[(_TOPS + _BEND) * LANES + i]
        for j in range(_BLOCK + 1):
            f0, g0 = ground[0, s + j], ground[1, s + j]
            cx, sx, cy, sy = _C * x, _S * x, _C * y, _S * y
            t0 = abs(x) if abs(x) > t0 else t0
            t1 = abs(cx + sy) if abs(cx + sy) > t1 else t1
            t2 = abs(sx + cy) if abs(sx + cy) > t2 else t2
            t3 = abs(y) if abs(y) > t3 else t3
            t4 = abs(cy - sx) if abs(cy - sx) > t4 else t4
            t5 = abs(sy - cx) if abs(sy - cx) > t5 else t5
            a, b = by_u * x + by_v * v + f0, by_u * y + by_v * w + g0
            size = a * a + b * b
            bend = size if size > bend else bend
            if j < _BLOCK:
                f1, g1 = ground[0, s + j + 1], ground[1, s + j + 1]
                x1 = a11 * x + (a12 * v - (b10 * f0 + b11 * f1))
                v = a21 * x + (a22 * v - (b20 * f0 + b21 * f1))
                x = x1
                y1 = a11 * y + (a12 * w - (b10 * g0 + b11 * g1))
                w = a21 * y + (a22 * w - (b20 * g0 + b21 * g1))
                y = y1
        lane[_X * LANES + i], lane[_V * LANES + i], lane[_Y * LANES + i], lane[_W * LANES + i] = (
            x,
            v,
            y,
            w,
        )
        lane[_TOPS * LANES + i], lane[(_TOPS + 1) * LANES + i], lane[(_TOPS + 2) * LANES + i] = (
            t0,
            t1,
            t2,
        )
        (
            lane[(_TOPS + 3) * LANES + i],
            lane[(_TOPS + 4) * LANES + i],
            lane[(_TOPS + 5) * LANES + i],
        ) = t3, t4, t5
        lane[(_TOPS + _BEND) * LANES + i] = bend


class _One(NamedTuple):
    """One oscillator of the table that is marched by itself."""

    ground: Array
    oscillators: Array
    column: int
    vibration: Vibration
    directions: Array
    starts: Array  # displacements and velocities at the start of each stretch
    scratch: Array
    series: Array  # of q, q' and q''
    best: Array  # largest displacements so far


@outlined
def _search(oscillator, tops, margin):
    """Largest displacements of one oscillator in all directions, from those along the axes in each
    stretch.

    `margin` is its `rise`, 0 if nobody asks for what lies between the steps."""
    scratch, best = oscillator.scratch, oscillator.best
    whole = tops.shape[0]
    lows = scratch[_LOWS]
    # The stretches of the largest displacements along the axes come first: what they leave is hard
    # to exceed.
    _march(oscillator, whole, margin, True)
    last = whole
    for k in range(AXES):
        place = 0
        for c in range(1, whole):
            if tops[c, k] > tops[place, k]:
                place = c
        if whole > 0 and place != last:
            _march(oscillator, place, margin, True)
            last = place
    for k in range(_SECTORS):
        lows[k] = _lowest(best, k)
    _march(oscillator, whole, margin, False)
    for c in range(whole):
        _interpolate(tops[c], scratch)
        if _count_higher(scratch, margin * tops[c, _BEND]) > 0:
            _march(oscillator, c, margin, False)


@outlined
def _interpolate(top, scratch):
    """Bounds of the displacements of a stretch along the edges of the sectors, from those along the
    axes.

    A direction between two axes is a sum of both with positive factors, and so is the displacement
    along it.
    """
    for k in range(AXES):
        first, other = top[k], top[(k + 1) % AXES]
        for j in range(_SECTORS_PER_WEDGE):
            bound = _FACTORS[_SECTORS_PER_WEDGE - j] * first + _FACTORS[j] * other
            scratch[_BEFORE, k * _SECTORS_PER_WEDGE + j] = scratch[
                _AFTER, k * _SECTORS_PER_WEDGE + j
            ] = bound
    scratch[_BEFORE, _SECTORS] = scratch[_AFTER, _SECTORS] = top[0]


@outlined
def _lowest(best, sector):
    """Smallest of the largest displacements in the directions of a sector."""
    low = best[sector * _SECTOR]
    for k in range(sector * _SECTOR + 1, (sector + 1) * _SECTOR):
        low = min(low, best[k])
    return low


@outlined
def _march(oscillator, stretch, margin, coarse):
    """March one oscillator over a stretch (or the steps after the last whole one) and raise `best`.

    `coarse`: by the values at the steps' ends in all directions; else also by those between, where
    they may be larger.
    """
    ground, oscillators, column, vibration, directions, starts, scratch, series, best = oscillator
    a11, a12 = oscillators[A11, column], oscillators[A12, column]
    b10, b11 = oscillators[B10, column], oscillators[B11, column]
    a21, a22 = oscillators[A21, column], oscillators[A22, column]
    b20, b21 = oscillators[B20, column], oscillators[B21, column]
    by_u, by_v, h = vibration
    n = terms(vibration)
    lows, before, after = scratch[_LOWS], scratch[_BEFORE], scratch[_AFTER]
    x, v, y, w = starts[stretch, 0], starts[stretch, 1], starts[stretch, 2], starts[stretch, 3]
    f0, g0 = ground[0, stretch * STRETCH], ground[1, stretch * STRETCH]
    a, b = -(by_u * x + by_v * v) - f0, -(by_u * y + by_v * w) - g0
    _project(x, y, scratch, before)
    for s in range(stretch * STRETCH, min((stretch + 1) * STRETCH, ground.shape[1] - 1)):
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
            _project(x1, y1, scratch, after)
            over = margin * math.sqrt(max(a * a + b * b, a1 * a1 + b1 * b1))
            p = -(by_u * v + by_v * a) - (f1 - f0) / h
            q = -(by_u * w + by_v * b) - (g1 - g0) / h
            for sector in range(_SECTORS if _count_higher(scratch, over) > 0 else 0):
                if _top(scratch, sector) * _SPREAD + over <= lows[sector]:
                    continue
                for k in range(sector * _SECTOR, (sector + 1) * _SECTOR):
                    c, d = directions[0, k], directions[1, k]
                    u0, u1, v0 = c * x + d * y, c * x1 + d * y1, c * v + d * w
                    speed, e0, e1 = c * v1 + d * w1, c * a + d * b, c * a1 + d * b1
                    best[k] = max(best[k], abs(u1))
                    if margin > 0.0 and may_exceed(best[k], margin, u0, v0, e0, u1, speed, e1):
                        size = largest_between(
                            u0, (v0, e0, c * p + d * q), speed, vibration, n, series
                        )
                        best[k] = max(best[k], size)
                lows[sector] = _lowest(best, sector)
            for k in range(_SECTORS + 1):
                before[k] = after[k]
        x, v, y, w, a, b, f0, g0 = x1, v1, y1, w1, a1, b1, f1, g1


@outlined
def _project(x, y, scratch, sizes):
    """Absolute displacements along the edges of the sectors."""
    for k in range(_SECTORS + 1):
        sizes[k] = abs(scratch[_COSINES, k] * x + scratch[_SINES, k] * y)


@outlined
def _count_higher(scratch, over):
    """Number of sectors in which the displacement of a step may be larger than the smallest of the
    largest."""
    count = 0
    for k in range(_SECTORS):
        count += 1 if _top(scratch, k) * _SPREAD + over > scratch[_LOWS, k] else 0
    return count


@inline
def _top(scratch, k):
    """Largest displacement at both ends of a step along both edges of a sector."""
    return max(
        max(scratch[_BEFORE, k], scratch[_AFTER, k]),
        max(scratch[_BEFORE, k + 1], scratch[_AFTER, k + 1]),
    )
