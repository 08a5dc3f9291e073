"""The largest value of an oscillator's response between two steps' ends.

Under a ground motion that is linear over the step every quantity q that is asked for has a q'' that
vibrates freely. That bounds how far q can rise above its values at both ends, and with omega h <= 1
a short Taylor series is q itself.

At the ends the recursion from one step to the next is exact (Nigam and Jennings 1969): u1 = A11 u0
+ A12 v0 - B10 g0 - B11 g1 and v1 = A21 u0 + A22 v0 - B20 g0 - B21 g1 for a ground acceleration that
goes in a straight line from g0 to g1; `tdint.analysis.spectra.elastic` fills the tables.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels.compiling import inline, outlined

# Rows of the tables of oscillators
A11 = 0
A12 = 1
B10 = 2
B11 = 3
A21 = 4
A22 = 5
B20 = 6
B21 = 7
RECURSION_ROWS = 8

TERMS = 15
"""Most terms of a Taylor series: with omega h <= 1 less than 1e-9 is left out."""

_LEAST = 5  # terms: the cubic and the two next ones
_LEFT_OUT = 2e-10  # of the cubic term
_NEWTON = 30  # kept between two values, so that it ends in any case
_NEAR = 1e-4  # of a step: the last correction by Newton's method
_CLOSE = 1e-5  # of a step: an error of the place, whose square is the error of the largest value
_INVERSE = tuple(1.0 / max(k, 1) for k in range(TERMS + 1))


class Vibration(NamedTuple):
    """How an oscillator vibrates, and how long its steps are."""

    by_u: float  # omega^2
    by_v: float  # 2 xi omega
    h: float


@outlined
def divide(samples, parts, ground):
    """Put points on the straight lines between the samples, `parts` steps to an interval."""
    for i in range(samples.size - 1):
        rise = samples[i + 1] - samples[i]
        for k in range(parts):
            ground[i * parts + k] = samples[i] + rise * k / parts
    ground[ground.size - 1] = samples[samples.size - 1]


@inline
def rise(vibration):
    """By how much, at most, a quantity exceeds its values at both ends of a step, over the larger
    of its q'' there.

    q lies within h^2/8 max |q''| of the chord. q'' is a free vibration: over omega h <= 1 its
    largest value is at most exp(xi omega h) / cos(omega h / 2) times the larger one at the ends.
    """
    by_u, by_v, h = vibration
    return 0.125 * h * h * math.exp(0.5 * by_v * h) / math.cos(0.5 * math.sqrt(by_u) * h)


@inline
def may_exceed(best, rise, q0, d0, e0, q1, d1, e1):
    """Whether q, with q' = d and q'' = e at both ends, may have an extreme between them that is
    larger than `best`.

    e changes its sign once at most, so that d has one zero if its signs differ, else two or none.
    Where d starts from zero (at rest), e is its sign.
    """
    turns = (d0 if d0 != 0.0 else e0) * d1 < 0.0 or (d0 * e0 < 0.0 and d1 * e1 > 0.0)
    return turns and max(abs(q0), abs(q1)) + rise * max(abs(e0), abs(e1)) > best


@outlined
def largest_between(q, rates, d1, vibration, n, series):
    """Largest absolute value at the extremes of q within a step; q and its `rates` q', q'', q'''
    are those at its start, d1 is q' at its end. n is the number of `terms`; `series`, shape (3,
    TERMS), is room for the series of q, q' and q''.
    """
    d, e, f = rates
    by_u, by_v, h = vibration
    w, z = h * h * by_u, h * by_v
    value, speed, bend, jerk = series[0], series[1], series[2], f * h * h * h
    bend[0], bend[1] = e * h * h, jerk
    for k in range(2, n - 2):
        bend[k] = -(z * bend[k - 1] + w * _INVERSE[k - 1] * bend[k - 2]) * _INVERSE[k]
    speed[0], value[0] = d * h, q
    for k in range(1, n - 1):
        speed[k] = bend[k - 1] * _INVERSE[k]
    for k in range(1, n):
        value[k] = speed[k - 1] * _INVERSE[k]
    if d == 0.0:  # a zero at the start is none between: divide by x
        for k in range(n - 2):
            speed[k] = speed[k + 1]
        return abs(_value(value, n, _root(speed, n - 2, 0.0, 1.0, speed[0], d1 * h))[0])
    if d * d1 < 0.0:
        return abs(_value(value, n, _root(speed, n - 1, 0.0, 1.0, d * h, d1 * h))[0])
    turn = _root(bend, n - 2, 0.0, 1.0, bend[0], _value(bend, n - 2, 1.0)[0])
    at_turn = _value(speed, n - 1, turn)[0]
    if at_turn * d >= 0.0:
        return 0.0
    here = _root(speed, n - 1, 0.0, turn, d * h, at_turn)
    there = _root(speed, n - 1, turn, 1.0, at_turn, d1 * h)
    return max(abs(_value(value, n, here)[0]), abs(_value(value, n, there)[0]))


@outlined
def terms(vibration):
    """Terms of the series of q that matter beside the cubic one.

    From the third on each derivative is about omega times the one before; the ground's slope is in
    the third.
    """
    by_u, by_v, h = vibration
    reach = h * max(math.sqrt(by_u), by_v)
    n, term = 3, 1.0
    while n < TERMS and (n < _LEAST or term > _LEFT_OUT):
        n += 1
        term *= reach * _INVERSE[n]
    return n


@outlined
def _root(coefficients, n, low, high, at_low, at_high):
    """The zero of a series of n terms whose signs differ at `low` and `high`: Newton's method, kept
    between them."""
    x = low + (high - low) * at_low / (at_low - at_high)
    for _ in range(_NEWTON):
        value, slope = _value(coefficients, n, x)
        if value * at_low > 0.0:
            low = x
        else:
            high = x
        better = x - value / slope if slope != 0.0 else low
        if low < better < high:
            if abs(better - x) < _NEAR:  # what is left is the square of that
                return better
        else:
            better = 0.5 * (low + high)
            if abs(better - x) < _CLOSE:
                return better
        x = better
    return x


@inline
def _value(coefficients, n, x):
    """A power series of n terms at x, and its slope (Horner)."""
    value = slope = 0.0
    for k in range(n - 1, -1, -1):
        slope = slope * x + value
        value = value * x + coefficients[k]
    return value, slope


@inline
def narrowed(left, at_left, right, at_right, side, t, value):
    """A root's bracket narrowed by false position with halved weights, the Illinois method (Dowell
    and Jarratt 1971): the bracket after a look at t, with its values; the value of an end that
    stays twice in a row is halved.

    `side` is 1 if the right end was moved last, -1 for the left one, 0 at first; returned with the
    bracket, as is the distance by which an end was moved. `value` is not zero.
    """
    if (value > 0.0) == (at_right > 0.0):
        moved = right - t
        if side > 0:
            at_left *= 0.5
        return left, at_left, t, value, 1, moved
    moved = t - left
    if side < 0:
        at_right *= 0.5
    return t, value, right, at_right, -1, moved
