"""Maximum of the response of an oscillator between the endpoints of a step, and after the last
step.

If the ground acceleration is linear within the step, the second derivative q'' of every required
quantity q is a free vibration. This bounds the excess of q over its values at both endpoints. With
omega h <= 1, a short Taylor series represents q.

At the endpoints, the recursion from step to step is exact (Nigam and Jennings 1969): u1 = A11 u0 +
A12 v0 - B10 g0 - B11 g1 and v1 = A21 u0 + A22 v0 - B20 g0 - B21 g1 for a ground acceleration that
changes linearly from g0 to g1. `tdint.response.spectra.elastic` computes the coefficients.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels.compiling import inline, outlined

# Rows of the tables of oscillators: coefficients of the recursion
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
"""Maximum number of terms of a Taylor series. With omega h <= 1 the remainder is below 1e-9."""

_MIN_TERMS = 5  # minimum number of terms: from the constant term to the fourth power
_TRUNCATION = 2e-10  # maximum of the first omitted term relative to the cubic term
# Maximum number of iterations. At most 17 bisections reduce the bracket to _BISECTION_TOLERANCE.
_MAX_ITERATIONS = 30
_NEWTON_TOLERANCE = 1e-4  # fraction of the step; maximum last correction of Newton's method
# Fraction of the step; maximum last correction of the time by bisection. The relative error of the
# maximum is of the order of its square.
_BISECTION_TOLERANCE = 1e-5
# 1 / k at index k; index 0 is not used
_INVERSE = tuple(1.0 / max(k, 1) for k in range(TERMS + 1))


class Vibration(NamedTuple):
    """Properties of an oscillator and the length of its steps.

    Attributes
    ----------
    by_u : float
        omega^2, 1/s^2.
    by_v : float
        2 xi omega, 1/s.
    """

    by_u: float
    by_v: float
    h: float


@outlined
def interpolate_samples(samples, parts, ground):
    """Interpolate a ground motion linearly between its samples."""
    for i in range(samples.size - 1):
        increment = samples[i + 1] - samples[i]
        for k in range(parts):
            ground[i * parts + k] = samples[i] + increment * k / parts
    ground[ground.size - 1] = samples[samples.size - 1]


@inline
def excess_factor(vibration):
    """Return the factor that bounds the excess of |q| within a step over its endpoint values, s^2.

    The absolute value of q exceeds the larger of its two endpoint values by at most the factor
    times the larger of the two values |q''| at the endpoints. This follows from two facts. Within a
    step, q differs from the straight line between its endpoint values by at most h^2/8 times the
    maximum of |q''|. And q'' is a free vibration: for omega h <= 1, the maximum of |q''| is at most
    exp(xi omega h) / cos(omega h / 2) times its larger endpoint value.
    """
    by_u, by_v, h = vibration
    return 0.125 * h * h * math.exp(0.5 * by_v * h) / math.cos(0.5 * math.sqrt(by_u) * h)


@inline
def may_exceed(best, factor, q0, d0, e0, q1, d1, e1):
    """Return True if a quantity q can have an extremum above `best` between the endpoints of a
    step.

    q'' is a free vibration and changes its sign at most once in a step, so that q' has at most two
    zeros: one if the signs of q' at the endpoints differ, and either two or no zeros if they agree.
    If q' is zero at the start (from rest), the sign of q'' at the start replaces its sign. q, d and
    e are q, q' and q'', `factor` is the result of `excess_factor`.
    """
    initial_direction = d0 if d0 != 0.0 else e0
    # q' approaches zero at the start and moves away from zero at the end: two zeros are possible.
    has_extremum = initial_direction * d1 < 0.0 or (d0 * e0 < 0.0 and d1 * e1 > 0.0)
    return has_extremum and max(abs(q0), abs(q1)) + factor * max(abs(e0), abs(e1)) > best


@outlined
def largest_between(q, rates, d1, vibration, n, series):
    """Return the maximum absolute value of a quantity q at its extrema within a step.

    The extrema are the zeros of the time derivative q'. The caller must first test the step with
    `may_exceed`, which returns True only in three cases:

        case    q' at the endpoints       q''                        zeros of q' inside the step
        1       0 at the start            at the start: sign         1
                                          opposite to q' at the end
        2       different signs           any                        1
        3       same sign                 different signs at the     2 or 0 (result 0)
                                          endpoints

    If q' is exactly zero at the end, `may_exceed` returns False: the extremum is the value at the
    end of the step, which the caller records.

    Power series in x = t / h, with x from 0 to 1 over the step, represent the three functions:

        q         n terms        integral of the series of h q'
        h q'      n - 1 terms    integral of the series of h^2 q''
        h^2 q''   n - 2 terms    coefficients at the start c_0 = h^2 q'' and c_1 = h^3 times the
                                 third derivative of q; for k > 1,
                                 c_k = -(2 xi omega h c_(k-1) + (omega h)^2 c_(k-2) / (k - 1)) / k

    The formula for c_k follows from y'' = -(2 xi omega y' + omega^2 y) for y = q'', which is a free
    vibration of the oscillator.
    """
    d, e, f = rates
    by_u, by_v, h = vibration
    scaled_stiffness, scaled_damping = h * h * by_u, h * by_v
    q_series, rate_series, curvature_series = series[0], series[1], series[2]
    curvature_series[0], curvature_series[1] = e * h * h, f * h * h * h
    for k in range(2, n - 2):
        curvature_series[k] = (
            -(
                scaled_damping * curvature_series[k - 1]
                + scaled_stiffness * _INVERSE[k - 1] * curvature_series[k - 2]
            )
            * _INVERSE[k]
        )
    rate_series[0], q_series[0] = d * h, q
    for k in range(1, n - 1):
        rate_series[k] = curvature_series[k - 1] * _INVERSE[k]
    for k in range(1, n):
        q_series[k] = rate_series[k - 1] * _INVERSE[k]
    # The last two arguments of `_root` are the values of the series at the ends. `_value` returns
    # the value of a series and its derivative.
    #
    # Case 1: h q' is zero at x = 0, so that its series has no constant term. The series of h q' / x
    # is zero only at the zero of q' inside the step. Its values at the endpoints are h^2 q''(0) at
    # x = 0 and h q' at x = 1.
    if d == 0.0:
        for k in range(n - 2):
            rate_series[k] = rate_series[k + 1]
        return abs(
            _value(q_series, n, _root(rate_series, n - 2, 0.0, 1.0, rate_series[0], d1 * h))[0]
        )
    # Case 2
    if d * d1 < 0.0:
        return abs(_value(q_series, n, _root(rate_series, n - 1, 0.0, 1.0, d * h, d1 * h))[0])
    # Case 3: q' has two zeros if its sign at the zero of q'' in between is opposite.
    start, end = curvature_series[0], _value(curvature_series, n - 2, 1.0)[0]
    inflection = _root(curvature_series, n - 2, 0.0, 1.0, start, end)
    speed_at_inflection = _value(rate_series, n - 1, inflection)[0]
    if speed_at_inflection * d >= 0.0:
        return 0.0
    first_zero = _root(rate_series, n - 1, 0.0, inflection, d * h, speed_at_inflection)
    second_zero = _root(rate_series, n - 1, inflection, 1.0, speed_at_inflection, d1 * h)
    return max(abs(_value(q_series, n, first_zero)[0]), abs(_value(q_series, n, second_zero)[0]))


@outlined
def largest_afterwards(q, d, vibration, best):
    """Return the larger value of `best` and of the maximum of |q| in the free vibration that
    follows the state q, d = q'.

    During free vibration, E = omega^2 q^2 + 2 xi omega q q' + q'^2 decays as exp(-2 xi omega t). At
    an extremum, q' is zero and E is omega^2 q^2. The first extremum is therefore the largest, and

        |q| = sqrt(E) / omega exp(-xi omega t),   tan(wd t) = wd q' / (omega^2 q + xi omega q')

    with the values of q, q' and E at the start, the time t of the first extremum, and
    wd = omega sqrt(1 - xi^2).
    """
    by_u, by_v, _ = vibration
    amplitude = math.sqrt(max(by_u * q * q + by_v * q * d + d * d, 0.0) / by_u)
    # Most responses have decayed at the end of a ground motion.
    if amplitude <= best:
        return best
    decay = 0.5 * by_v
    damped = math.sqrt(by_u - decay * decay)
    angle = math.atan2(damped * d, by_u * q + decay * d)
    time = (angle if angle >= 0.0 else angle + math.pi) / damped
    return max(best, amplitude * math.exp(-decay * time))


@outlined
def term_count(vibration):
    """Return the number n of terms that the power series of a quantity q needs for an oscillator.

    Above the third derivative, which contains the slope of the ground acceleration, each derivative
    is about s times the previous derivative. Here s is the larger value of omega and 2 xi omega.
    Therefore the coefficient c_k is about s h / k times c_(k-1) for k > 3. The result is the
    smallest n from _MIN_TERMS on for which the first omitted coefficient c_n is at most _TRUNCATION
    times c_3. It is at most TERMS.
    """
    by_u, by_v, h = vibration
    scale = h * max(math.sqrt(by_u), by_v)
    n, term = 3, 1.0  # estimate of |c_n / c_3|
    while n < TERMS and (n < _MIN_TERMS or term > _TRUNCATION):
        n += 1
        term *= scale * _INVERSE[n]
    return n


@outlined
def _root(coefficients, n, low, high, at_low, at_high):
    """Return the zero of a power series between `low` and `high`, where it has the values `at_low`
    and `at_high` with different signs.

    Newton's method starts from the zero of the secant and maintains a bracket of the zero, with
    bisection if an iterate is outside. If an iterate is exactly the zero, it becomes the end `high`
    of the bracket, and the bisection approaches it from below. The error of the result is of the
    order of _BISECTION_TOLERANCE.
    """
    x = low + (high - low) * at_low / (at_low - at_high)
    for _ in range(_MAX_ITERATIONS):
        value, slope = _value(coefficients, n, x)
        if value * at_low > 0.0:
            low = x
        else:
            high = x
        # For a zero slope, `low` is not inside the bracket, so that the next step is a bisection.
        new_x = x - value / slope if slope != 0.0 else low
        if low < new_x < high:
            # The remaining error is of the order of the square of the correction.
            if abs(new_x - x) < _NEWTON_TOLERANCE:
                return new_x
        else:
            new_x = 0.5 * (low + high)
            if abs(new_x - x) < _BISECTION_TOLERANCE:
                return new_x
        x = new_x
    return x


@inline
def _value(coefficients, n, x):
    """Return a power series c_0 + c_1 x + ... with `n` terms at `x`, and its derivative, by
    Horner's scheme.

    `coefficients` contains c_0, c_1, ...
    """
    value = slope = 0.0
    for k in range(n - 1, -1, -1):
        slope = slope * x + value
        value = value * x + coefficients[k]
    return value, slope


@inline
def narrow_bracket(left, at_left, right, at_right, side, t, value):
    """Narrow the bracket of a root to the side of a new argument that contains the root; return
    also the distance that an endpoint was moved.

    The function is used by regula falsi with halved weights (Illinois method, Dowell and Jarratt
    1971): if an endpoint remains unchanged twice in succession, the value stored for this endpoint
    is halved, so that the next secant moves this endpoint. `value` is not zero.
    """
    # The new argument replaces the endpoint with the same sign.
    if (value > 0.0) == (at_right > 0.0):
        moved = right - t
        if side > 0:
            at_left *= 0.5
        return left, at_left, t, value, 1, moved
    moved = t - left
    if side < 0:
        at_right *= 0.5
    return t, value, right, at_right, -1, moved
