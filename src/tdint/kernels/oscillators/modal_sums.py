"""Maximum drifts of a building by superposition of its modes, with an exact recursion for each
mode.

The ground motion is linear between its samples. The drift ratio of a story, or of the roof in the
last column, is the sum of modal coordinate q times `shapes` over the modes, minus `static` times
the ground acceleration. A modal coordinate satisfies q'' + 2 xi omega q' + omega^2 q = -ag. The
time is divided into chunks. In each chunk all modes are integrated together and then superposed for
each story. The first pass computes the maxima at the steps. The second pass processes the chunks
that can contain the maximum between the steps again, and computes the maximum from the closed form
of the modes.

After the last sample, the ground acceleration decreases to zero within a sampling interval. The
modes then vibrate freely, and the time integration continues while the sum of their amplitudes
exceeds a maximum.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.kernels.compiling import F8, I8, TABLE, VECTOR, inline, kernel, local, outlined
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
    narrow_bracket,
)
from tdint.kernels.stepping import Array
from tdint.kernels.time_loop.ground import ground_at

# Rows of the table of modes after the rows of the recursion. The variables u and v of the recursion
# are the modal coordinate q and its rate.
OMEGA = RECURSION_ROWS
DAMPING = RECURSION_ROWS + 1
MODE_ROWS = RECURSION_ROWS + 2

BLOCK = 4
"""The number of modes in the table must be a multiple of BLOCK."""

# Elements of the array `results` of `largest_drifts`
PEAK = 0  # maximum absolute drift ratio of all stories
STORY = 1  # index of the story with this maximum
ROOF = 2  # maximum absolute roof drift ratio (last column)
RESULTS = 3

_CHUNK_STEPS = 64  # steps of a chunk; must be a multiple of 4 (`scratch`)
# Fraction of the maximum second difference of the drift ratios. Between two steps, the drift ratio
# can exceed its values at the steps by less than one eighth of the second difference; this fraction
# is a safe bound. Steps with values below the maximum minus this tolerance cannot be near the
# maximum.
_TOLERANCE = 0.5


class _Sum(NamedTuple):
    """Terms of the superposition of modes.

    Attributes
    ----------
    modes : ndarray
        Table of the modes, with the coefficients of the recursion.
    shapes : ndarray
        Contributions of the modes to the columns (drift ratios of the stories).
    static : ndarray
        Static correction: flexibility that is not included in the modes, s^2/m.
    """

    modes: Array
    shapes: Array
    static: Array
    h: float


class _Steps(NamedTuple):
    """Steps of a chunk, one row for each step: modal coordinates, ground acceleration and drift
    ratios.

    Attributes
    ----------
    q, rate : ndarray
        Modal coordinates and their rates; one column per mode.
    motion : ndarray
        Ground acceleration at the steps, m/s^2.
    drift : ndarray
        Drift ratios; one column per story, and a last column for the roof.
    """

    q: Array
    rate: Array
    motion: Array
    drift: Array


@outlined
def _integrate_modes(ground, parts, first, modes, q, rate, motion):
    """Integrate the modes from row 0 of `q` and `rate` to the following rows, and interpolate the
    ground acceleration (`motion`).

    `first` is the index of the first step of the chunk.
    """
    count = modes.shape[1]
    for row in range(_CHUNK_STEPS + 1):
        motion[row] = ground_at(ground, first + row, parts, 1)
    for row in range(1, _CHUNK_STEPS + 1):
        previous_ground, next_ground = motion[row - 1], motion[row]
        for j in range(count):
            u, v = q[row - 1, j], rate[row - 1, j]
            q[row, j] = (
                modes[A11, j] * u
                + modes[A12, j] * v
                - modes[B10, j] * previous_ground
                - modes[B11, j] * next_ground
            )
            rate[row, j] = (
                modes[A21, j] * u
                + modes[A22, j] * v
                - modes[B20, j] * previous_ground
                - modes[B21, j] * next_ground
            )


@outlined
def _superpose(q, shapes, static, motion, drift):
    """Compute the drift ratios of all stories and of the roof at successive steps from the modes.

    Four rows (d0 to d3) and four modes (w0 to w3) are processed at a time, which is faster. The
    numbers of rows and of modes are multiples of 4.
    """
    columns = shapes.shape[1]
    for row in range(0, q.shape[0], 4):
        d0, d1, d2, d3 = drift[row], drift[row + 1], drift[row + 2], drift[row + 3]
        q0, q1, q2, q3 = q[row], q[row + 1], q[row + 2], q[row + 3]
        for c in range(columns):
            d0[c] = -static[c] * motion[row]
            d1[c] = -static[c] * motion[row + 1]
            d2[c] = -static[c] * motion[row + 2]
            d3[c] = -static[c] * motion[row + 3]
        # qab is the coordinate of mode j + b at step row + a.
        for j in range(0, shapes.shape[0], 4):
            w0, w1, w2, w3 = shapes[j], shapes[j + 1], shapes[j + 2], shapes[j + 3]
            q00, q01, q02, q03 = q0[j], q0[j + 1], q0[j + 2], q0[j + 3]
            q10, q11, q12, q13 = q1[j], q1[j + 1], q1[j + 2], q1[j + 3]
            q20, q21, q22, q23 = q2[j], q2[j + 1], q2[j + 2], q2[j + 3]
            q30, q31, q32, q33 = q3[j], q3[j + 1], q3[j + 2], q3[j + 3]
            for c in range(columns):
                s0, s1, s2, s3 = w0[c], w1[c], w2[c], w3[c]
                d0[c] += q00 * s0 + q01 * s1 + q02 * s2 + q03 * s3
                d1[c] += q10 * s0 + q11 * s1 + q12 * s2 + q13 * s3
                d2[c] += q20 * s0 + q21 * s1 + q22 * s2 + q23 * s3
                d3[c] += q30 * s0 + q31 * s1 + q32 * s2 + q33 * s3


@outlined
def _update_maxima(drift, column_maxima, column_curvatures):
    """Store the maximum absolute value and the maximum absolute second difference of each column in
    a chunk.

    The second difference d0 - 2 d1 + d2 of three successive steps bounds the excess of the drift
    ratio between the steps.
    """
    columns = drift.shape[1]
    for c in range(columns):
        column_maxima[c] = abs(drift[0, c])
        column_curvatures[c] = 0.0
    for row in range(1, _CHUNK_STEPS + 1):
        for c in range(columns):
            size = abs(drift[row, c])
            column_maxima[c] = size if size > column_maxima[c] else column_maxima[c]
    for row in range(1, _CHUNK_STEPS):
        for c in range(columns):
            size = abs(drift[row - 1, c] - 2.0 * drift[row, c] + drift[row + 1, c])
            column_curvatures[c] = size if size > column_curvatures[c] else column_curvatures[c]


@inline
def _rate(sums, steps, row, slope, c):
    """Return the rate of the drift ratio of column `c` at step `row`, 1/s; `slope` is the rate of
    the ground acceleration, m/s^3.
    """
    total = -sums.static[c] * slope
    for j in range(sums.shapes.shape[0]):
        total += sums.shapes[j, c] * steps.rate[row, j]
    return total


@outlined
def _column_at(sums, steps, row, slope, t, c):
    """Return the drift ratio of column `c` and its rate (1/s) at the time `t` after step `row`.

    With the ground acceleration g0 + slope t, a modal coordinate is the sum of a particular
    solution and a damped free vibration,

        particular   -g0 / omega^2 + 2 xi slope / omega^3 - slope t / omega^2
        vibration    exp(-xi omega t) (y cos(wd t) + (y' + xi omega y) / wd sin(wd t))

    with wd = omega sqrt(1 - xi^2); y and y' are the values of q and q' minus the particular
    solution and its rate at t = 0.
    """
    modes, shapes, static, _ = sums
    q, rate, motion, _ = steps
    g0 = motion[row]
    value = -static[c] * (g0 + slope * t)
    speed = -static[c] * slope
    for j in range(shapes.shape[0]):
        weight = shapes[j, c]
        if weight != 0.0:
            omega, xi = modes[OMEGA, j], modes[DAMPING, j]
            damped = omega * math.sqrt((1.0 - xi) * (1.0 + xi))
            particular_rate = -slope / (omega * omega)
            particular = -g0 / (omega * omega) - 2.0 * xi * particular_rate / omega
            y = q[row, j] - particular
            y_rate = rate[row, j] - particular_rate
            by_sine = (y_rate + xi * omega * y) / damped
            decay = math.exp(-xi * omega * t)
            # Decaying cosine and sine
            c_t, s_t = decay * math.cos(damped * t), decay * math.sin(damped * t)
            value += weight * (particular + particular_rate * t + y * c_t + by_sine * s_t)
            speed += weight * (
                particular_rate + y_rate * c_t - (omega * y + xi * y_rate) * (omega / damped) * s_t
            )
    return value, speed


@outlined
def _maximum_after(sums, steps, row, c, size):
    """Return the larger value of `size` and of the maximum absolute drift ratio of column `c` at an
    extremum between step `row` and the next step.

    If the rate has different signs at both steps, its zero is located by regula falsi, and all
    values of the iteration are considered. The values at both steps are not evaluated: `size` is
    the absolute value at one step.
    """
    h = sums.h
    slope = (steps.motion[row + 1] - steps.motion[row]) / h
    left_speed = _rate(sums, steps, row, slope, c)
    right_speed = _rate(sums, steps, row + 1, slope, c)
    if left_speed * right_speed >= 0.0:
        return size
    left, right = 0.0, h  # The rate changes its sign between both times.
    side = 0  # `narrow_bracket` sets 1 if it moved the right endpoint, and -1 if the left endpoint
    for _ in range(60):
        t = (left * right_speed - right * left_speed) / (right_speed - left_speed)
        if not left < t < right:
            break
        value, speed = _column_at(sums, steps, row, slope, t, c)
        size = max(size, abs(value))
        if speed == 0.0 or right - left < 1e-7 * h:
            break
        left, left_speed, right, right_speed, side, change = narrow_bracket(
            left, left_speed, right, right_speed, side, t, speed
        )
        if change < 1e-7 * h:
            break
    return size


@outlined
def _refine(sums, steps, first, last, threshold, best):
    """Return the maximum absolute drift ratio in a chunk of the columns from `first` to `last` - 1,
    including the time between the steps, and its column; `best` if it is not larger.

    Only the intervals next to a step with an absolute value of at least `threshold` are searched.
    """
    value, column = best
    drift = steps.drift
    for c in range(first, last):
        for row in range(_CHUNK_STEPS + 1):
            if abs(drift[row, c]) < threshold:
                continue
            # The last argument is a lower limit of the result, which therefore includes the value
            # at this step.
            for start in (row - 1, row):
                if 0 <= start < _CHUNK_STEPS:
                    size = _maximum_after(sums, steps, start, c, abs(drift[row, c]))
                    if size > value:
                        value, column = size, float(c)
    return value, column


@outlined
def _may_grow(modes, shapes, q, rate, story_maximum, roof_maximum):
    """Return True if the drift ratio of a story or of the roof can exceed its maximum in the free
    vibration from row 0 of `q` and `rate`.

    A drift ratio is at most the sum of the amplitudes of the modes, sqrt(q^2 + 2 xi q q' / omega +
    (q' / omega)^2), which do not increase.
    """
    columns = shapes.shape[1]
    for c in range(columns):
        bound = 0.0
        for j in range(shapes.shape[0]):
            if shapes[j, c] != 0.0:
                u, v = q[0, j], rate[0, j] / modes[OMEGA, j]
                square = u * u + 2.0 * modes[DAMPING, j] * u * v + v * v
                bound += abs(shapes[j, c]) * math.sqrt(max(square, 0.0))
        if bound > (roof_maximum if c == columns - 1 else story_maximum):
            return True
    return False


def scratch(steps: int, modes: int, columns: int) -> tuple[NDArray[np.float64], ...]:
    """Return the scratch arrays of `largest_drifts`, filled with zeros, in the order of its
    arguments, for a maximum number of steps.

    Returns
    -------
    q, rate : ndarray, shape (rows, modes)
        Modal coordinates and their rates (1/s) at the steps of a single chunk.
    motion : ndarray, shape (rows,)
        Ground acceleration at the steps of the chunk, m/s^2.
    drift : ndarray, shape (rows, columns)
        Drift ratios at the steps of the chunk.
    start_q, start_rate : ndarray, shape (chunks, modes)
        Modal coordinates and their rates at the start of each chunk, for its second integration.
    column_maxima, column_curvatures : ndarray, shape (columns,)
        Maximum absolute drift ratio of each column in a chunk, and maximum absolute second
        difference of the drift ratio.
    chunk_maxima : ndarray, shape (chunks, 2)
        Maximum absolute drift ratio of each chunk: of all stories, and of the roof.
    """
    chunks = -(-steps // _CHUNK_STEPS) + 1  # rounded up; and one for the end of the ground motion
    # A chunk has one row more than steps. `_superpose` processes four rows at a time.
    rows = _CHUNK_STEPS + 4
    shapes = (
        (rows, modes),  # q
        (rows, modes),  # rate
        (rows,),  # motion
        (rows, columns),  # drift
        (chunks, modes),  # start_q
        (chunks, modes),  # start_rate
        (columns,),  # column_maxima
    )
    # column_curvatures and chunk_maxima
    return *(np.zeros(shape) for shape in shapes), np.zeros(columns), np.zeros((chunks, 2))


_INPUT_TYPES = (VECTOR, I8, F8, TABLE, TABLE, VECTOR, VECTOR)
_SCRATCH_TYPES = (TABLE, TABLE, VECTOR, TABLE, TABLE, TABLE, VECTOR, VECTOR, TABLE)


@kernel(I8(*_INPUT_TYPES, *_SCRATCH_TYPES), has_forms=False, vectorized=True)
def largest_drifts(
    ground, parts, h, modes, shapes, static, results,
    q, rate, motion, drift, start_q, start_rate, column_maxima, column_curvatures, chunk_maxima,
):  # fmt: skip
    """Compute the maximum drift ratio of a building from rest, its story, and the maximum roof
    drift ratio.

    The first pass computes the maxima at the steps. The second pass integrates again all chunks
    that can contain the maximum between the steps. The result is 1 if the scratch arrays are too
    small for the free vibration that can exceed the maxima, otherwise 0.

    Parameters
    ----------
    modes : ndarray, shape (MODE_ROWS, modes)
        Recursion coefficients, circular frequencies (rad/s) and damping ratios (below 1) of the
        modes.
    shapes : ndarray, shape (modes, stories + 1)
        Contribution of each mode to the drift ratio of each story and (last column) of the roof,
        1/m.
    static : ndarray, shape (stories + 1,)
        Static correction, s^2/m.
    q, rate, motion, drift, start_q, start_rate : ndarray
    column_maxima, column_curvatures, chunk_maxima : ndarray
        Scratch arrays from `scratch`. They must be zero at the start: row 0 of `q` and `rate` is
        the state of rest, and the maxima in `chunk_maxima` start from zero.
    """
    sums = _Sum(modes, shapes, static, h)
    steps = ground.size * parts  # until the ground is at rest
    count, columns = shapes.shape
    # of the stories and of the roof
    curvatures = local(2)
    curvatures[:] = 0.0
    # First pass
    story_maximum = roof_maximum = 0.0
    chunks = chunk_maxima.shape[0]
    may_grow = 1
    for chunk in range(chunks):
        if chunk * _CHUNK_STEPS >= steps and not _may_grow(
            modes, shapes, q, rate, story_maximum, roof_maximum
        ):
            chunks, may_grow = chunk, 0
            break
        for j in range(count):
            start_q[chunk, j], start_rate[chunk, j] = q[0, j], rate[0, j]
        _integrate_modes(ground, parts, chunk * _CHUNK_STEPS, modes, q, rate, motion)
        _superpose(q, shapes, static, motion, drift)
        _update_maxima(drift, column_maxima, column_curvatures)
        for c in range(columns):
            # Group 0 contains the stories, group 1 the roof, which is the last column.
            group = 1 if c == columns - 1 else 0
            chunk_maxima[chunk, group] = max(chunk_maxima[chunk, group], column_maxima[c])
            curvatures[group] = max(curvatures[group], column_curvatures[c])
        story_maximum = max(story_maximum, chunk_maxima[chunk, 0])
        roof_maximum = max(roof_maximum, chunk_maxima[chunk, 1])
        for j in range(count):
            q[0, j], rate[0, j] = q[_CHUNK_STEPS, j], rate[_CHUNK_STEPS, j]
    # Second pass. Between two steps, a smooth curve exceeds its values at both steps by at most
    # about one eighth of the second difference; _TOLERANCE exceeds one eighth with a margin.
    story_tolerance, roof_tolerance = _TOLERANCE * curvatures[0], _TOLERANCE * curvatures[1]
    story, roof = (-1.0, 0.0), (-1.0, 0.0)
    for chunk in range(chunks):
        may_contain_story_maximum = chunk_maxima[chunk, 0] >= story_maximum - story_tolerance
        may_contain_roof_maximum = chunk_maxima[chunk, 1] >= roof_maximum - roof_tolerance
        if not (may_contain_story_maximum or may_contain_roof_maximum):
            continue
        for j in range(count):
            q[0, j], rate[0, j] = start_q[chunk, j], start_rate[chunk, j]
        _integrate_modes(ground, parts, chunk * _CHUNK_STEPS, modes, q, rate, motion)
        _superpose(q, shapes, static, motion, drift)
        chunk_steps = _Steps(q, rate, motion, drift)
        if may_contain_story_maximum:
            story = _refine(
                sums, chunk_steps, 0, columns - 1, story_maximum - story_tolerance, story
            )
        if may_contain_roof_maximum:
            roof = _refine(
                sums, chunk_steps, columns - 1, columns, roof_maximum - roof_tolerance, roof
            )
    results[PEAK], results[STORY], results[ROOF] = story[0], story[1], roof[0]
    return may_grow
