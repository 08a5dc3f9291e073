"""Largest drifts of a building by superposition of its modes, each an exact recursion.

The motion is linear between its samples. The time is gone through in chunks: modes side by side,
then their sum for every story. A first pass finds the largest values at the steps; a second one
goes again through the chunks that can hold the largest value between the steps, and finds it there
from the closed form of the modes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.kernels.compiling import F8, I8, TABLE, VECTOR, inline, kernel, local, outlined
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
    narrowed,
)
from tdint.kernels.stepping import Array

# Rows of the table of modes behind those of the recursion, whose u and v are a mode's coordinate q
# and its rate r
OMEGA = RECURSION_ROWS
DAMPING = RECURSION_ROWS + 1
MODE_ROWS = RECURSION_ROWS + 2

BLOCK = 4
"""The number of modes in the table is a multiple of this."""

# Results
PEAK = 0  # largest absolute value of the stories
STORY = 1  # and where it is, from 0
ROOF = 2  # largest absolute value of the last column
RESULTS = 3

_CHUNK = 64  # steps
# over the second difference, which exceeds eight times what a maximum gains between two steps
_SLACK = 0.5


class _Sum(NamedTuple):
    """What columns are summed up of."""

    modes: Array
    shapes: Array
    static: Array
    h: float


class _Steps(NamedTuple):
    """The steps of a chunk: modes, ground acceleration and columns."""

    q: Array
    rate: Array
    motion: Array
    drift: Array
    rows: int


@outlined
def _march(ground, parts, first, rows, modes, q, rate, motion):
    """Modes from row 0 of `q` and `rate` on to the rows after it; `motion` takes the ground
    acceleration."""
    count = modes.shape[1]
    for row in range(rows):
        i, part = divmod(first + row, parts)
        motion[row] = (
            ground[i] if part == 0 else ground[i] + (ground[i + 1] - ground[i]) * (part / parts)
        )
    for row in range(1, rows):
        before, after = motion[row - 1], motion[row]
        for j in range(count):
            u, v = q[row - 1, j], rate[row - 1, j]
            q[row, j] = (
                modes[A11, j] * u
                + modes[A12, j] * v
                - modes[B10, j] * before
                - modes[B11, j] * after
            )
            rate[row, j] = (
                modes[A21, j] * u
                + modes[A22, j] * v
                - modes[B20, j] * before
                - modes[B21, j] * after
            )


@outlined
def _superpose(q, shapes, static, motion, drift):
    """Rows of drifts from rows of modes, four rows and four modes at a time."""
    columns = shapes.shape[1]
    for row in range(0, q.shape[0], 4):
        d0, d1, d2, d3 = drift[row], drift[row + 1], drift[row + 2], drift[row + 3]
        for c in range(columns):
            d0[c] = -static[c] * motion[row]
            d1[c] = -static[c] * motion[row + 1]
            d2[c] = -static[c] * motion[row + 2]
            d3[c] = -static[c] * motion[row + 3]
        for j in range(0, shapes.shape[0], 4):
            w0, w1, w2, w3 = shapes[j], shapes[j + 1], shapes[j + 2], shapes[j + 3]
            q00, q01, q02, q03 = q[row, j], q[row, j + 1], q[row, j + 2], q[row, j + 3]
            q10, q11, q12, q13 = (
                q[row + 1, j],
                q[row + 1, j + 1],
                q[row + 1, j + 2],
                q[row + 1, j + 3],
            )
            q20, q21, q22, q23 = (
                q[row + 2, j],
                q[row + 2, j + 1],
                q[row + 2, j + 2],
                q[row + 2, j + 3],
            )
            q30, q31, q32, q33 = (
                q[row + 3, j],
                q[row + 3, j + 1],
                q[row + 3, j + 2],
                q[row + 3, j + 3],
            )
            for c in range(columns):
                s0, s1, s2, s3 = w0[c], w1[c], w2[c], w3[c]
                d0[c] += q00 * s0 + q01 * s1 + q02 * s2 + q03 * s3
                d1[c] += q10 * s0 + q11 * s1 + q12 * s2 + q13 * s3
                d2[c] += q20 * s0 + q21 * s1 + q22 * s2 + q23 * s3
                d3[c] += q30 * s0 + q31 * s1 + q32 * s2 + q33 * s3


@outlined
def _tops(drift, rows, top, bend):
    """Largest absolute value of each column, and of its second differences."""
    columns = drift.shape[1]
    for c in range(columns):
        top[c] = abs(drift[0, c])
        bend[c] = 0.0
    for row in range(1, rows):
        for c in range(columns):
            size = abs(drift[row, c])
            top[c] = size if size > top[c] else top[c]
    for row in range(1, rows - 1):
        for c in range(columns):
            size = abs(drift[row - 1, c] - 2.0 * drift[row, c] + drift[row + 1, c])
            bend[c] = size if size > bend[c] else bend[c]


@inline
def _rate(sums, steps, row, slope, c):
    """Rate of a column at a step."""
    total = -sums.static[c] * slope
    for j in range(sums.shapes.shape[0]):
        total += sums.shapes[j, c] * steps.rate[row, j]
    return total


@outlined
def _inside(sums, steps, row, slope, t, c):
    """A column and its rate at the time t after a step, from the closed form of every mode."""
    modes, shapes, static, _ = sums
    q, rate, motion, _, _ = steps
    g0 = motion[row]
    value = -static[c] * (g0 + slope * t)
    speed = -static[c] * slope
    for j in range(shapes.shape[0]):
        weight = shapes[j, c]
        if weight != 0.0:
            omega, xi = modes[OMEGA, j], modes[DAMPING, j]
            damped = omega * math.sqrt((1.0 - xi) * (1.0 + xi))
            rest_rate = -slope / (omega * omega)
            rest = -g0 / (omega * omega) - 2.0 * xi * rest_rate / omega
            y = q[row, j] - rest
            y_rate = rate[row, j] - rest_rate
            by_sine = (y_rate + xi * omega * y) / damped
            decay = math.exp(-xi * omega * t)
            c_t, s_t = decay * math.cos(damped * t), decay * math.sin(damped * t)
            value += weight * (rest + rest_rate * t + y * c_t + by_sine * s_t)
            speed += weight * (
                rest_rate + y_rate * c_t - (omega * y + xi * y_rate) * (omega / damped) * s_t
            )
    return value, speed


@outlined
def _summit(sums, steps, row, c, size):
    """Largest absolute value of a column between a step and the next, `size` that at the step if it
    is not between."""
    h = sums.h
    slope = (steps.motion[row + 1] - steps.motion[row]) / h
    left_speed = _rate(sums, steps, row, slope, c)
    right_speed = _rate(sums, steps, row + 1, slope, c)
    if left_speed * right_speed >= 0.0:
        return size
    left, right = 0.0, h  # The rate changes its sign between.
    side = 0
    for _ in range(60):
        t = (left * right_speed - right * left_speed) / (right_speed - left_speed)
        if not left < t < right:
            break
        value, speed = _inside(sums, steps, row, slope, t, c)
        size = max(size, abs(value))
        if speed == 0.0 or right - left < 1e-7 * h:
            break
        left, left_speed, right, right_speed, side, moved = narrowed(
            left, left_speed, right, right_speed, side, t, speed
        )
        if moved < 1e-7 * h:
            break
    return size


@outlined
def _refine(sums, steps, first, last, least, best):
    """Largest absolute value of the columns `first` to `last` in a chunk, between the steps too, if
    above `best`; at steps less than `least` there is none."""
    value, column = best
    _, _, _, drift, rows = steps
    for c in range(first, last):
        for row in range(rows):
            if abs(drift[row, c]) < least:
                continue
            for start in (row - 1, row):
                if 0 <= start < rows - 1:
                    size = _summit(sums, steps, start, c, abs(drift[row, c]))
                    if size > value:
                        value, column = size, float(c)
    return value, column


def scratch(samples: int, parts: int, modes: int, columns: int) -> tuple[NDArray[np.float64], ...]:
    """What `largest_drifts` works on for so many samples, parts, modes, and stories with the
    roof."""
    chunks = -(-(samples - 1) * parts // _CHUNK)
    rows = _CHUNK + 4
    shapes = (
        (rows, modes),
        (rows, modes),
        (rows,),
        (rows, columns),
        (chunks, modes),
        (chunks, modes),
        (columns,),
    )
    return *(np.zeros(shape) for shape in shapes), np.zeros(columns), np.zeros((chunks, 2))


_GIVEN = (VECTOR, I8, F8, TABLE, TABLE, VECTOR, VECTOR)
_SCRATCH = (TABLE, TABLE, VECTOR, TABLE, TABLE, TABLE, VECTOR, VECTOR, TABLE)


@kernel(I8(*_GIVEN, *_SCRATCH), parts=(), vectorized=True)
def largest_drifts(
    ground, parts, h, modes, shapes, static, results,
    q, rate, motion, drift, start_q, start_rate, top, bend, tops,
):  # fmt: skip
    """Largest drift ratio of a building from rest, its story, and the largest roof drift ratio.

    Parameters
    ----------
    ground : shape (samples,)
        Ground acceleration, m/s^2.
    parts, h
        Steps per sampling interval, and the step, s.
    modes : shape (MODE_ROWS, modes)
        Their exact steps, circular frequencies (rad/s) and damping ratios (below 1).
    shapes : shape (modes, stories + 1)
        What each mode adds to the drift ratio of each story and, in the last column, of the roof,
        1/m.
    static : shape (stories + 1,)
        Flexibility that the modes leave out, 1/m times s^2: it follows the ground without delay.
    results : shape (RESULTS,)
        Written.
    q, rate, motion, drift, start_q, start_rate, top, bend, tops
        Of `scratch`.
    """
    sums = _Sum(modes, shapes, static, h)
    steps = (ground.size - 1) * parts
    count, columns = shapes.shape
    chunks = (steps + _CHUNK - 1) // _CHUNK
    bends = local(2)  # of the stories, of the roof
    bends[:] = 0.0
    at_steps = at_steps_roof = 0.0
    for chunk in range(chunks):
        rows = min(_CHUNK, steps - chunk * _CHUNK) + 1
        for j in range(count):
            start_q[chunk, j], start_rate[chunk, j] = q[0, j], rate[0, j]
        _march(ground, parts, chunk * _CHUNK, rows, modes, q, rate, motion)
        _superpose(q, shapes, static, motion, drift)
        _tops(drift, rows, top, bend)
        for c in range(columns):
            kind = 1 if c == columns - 1 else 0
            tops[chunk, kind] = max(tops[chunk, kind], top[c])
            bends[kind] = max(bends[kind], bend[c])
        at_steps, at_steps_roof = max(at_steps, tops[chunk, 0]), max(at_steps_roof, tops[chunk, 1])
        for j in range(count):
            q[0, j], rate[0, j] = q[rows - 1, j], rate[rows - 1, j]
    slack, slack_roof = _SLACK * bends[0], _SLACK * bends[1]
    story, roof = (-1.0, 0.0), (-1.0, 0.0)
    for chunk in range(chunks):
        in_stories = tops[chunk, 0] >= at_steps - slack
        in_roof = tops[chunk, 1] >= at_steps_roof - slack_roof
        if not (in_stories or in_roof):
            continue
        rows = min(_CHUNK, steps - chunk * _CHUNK) + 1
        for j in range(count):
            q[0, j], rate[0, j] = start_q[chunk, j], start_rate[chunk, j]
        _march(ground, parts, chunk * _CHUNK, rows, modes, q, rate, motion)
        _superpose(q, shapes, static, motion, drift)
        here = _Steps(q, rate, motion, drift, rows)
        if in_stories:
            story = _refine(sums, here, 0, columns - 1, at_steps - slack, story)
        if in_roof:
            roof = _refine(sums, here, columns - 1, columns, at_steps_roof - slack_roof, roof)
    results[PEAK], results[STORY], results[ROOF] = story[0], story[1], roof[0]
    return 0
