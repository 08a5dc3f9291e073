"""Force of a damper in series with its brace (Maxwell element) over a time step.

The drift d of the story is the sum of the deformations b of the brace and p of the damper. Both
have the same force F, which is the state of the element:

    d = b + p,   F = kb b = q(p') = c p' (p'^2 + y0^2)^e,   F' = kb (d' - g(F))

kb is the stiffness of the brace, g the inverse function of q, and the exponent of the damper is
1 + 2 e. The power F d' is the rate of the stored energy F^2 / (2 kb) plus the dissipated power
F g(F), which is never negative.

Within a step of length h, the drift rate is (rise + bend s) / h with s = t - 1/2, t from 0 to 1.
The force is integrated by collocation at Gauss points c_i = 1/2 + s_i with the matrix A, starting
from the force F0:

    F_i + h kb sum_j A_ij g(F_j) = F0 + kb sum_j A_ij (rise + bend s_j)

Two points serve the methods of order 4, one point (the midpoint) the methods of order 2. Mean and
first moment of the force are

    mean = (F_1 + F_2) / 2,   moment = 12 int s F dt = F(end) - F0

With these values, rise * mean + bend * moment / 12 is equal to the change of F^2 / (2 kb) plus the
energy (h / 2) (F_1 g(F_1) + F_2 g(F_2)) that the damper dissipates. For a linear damper, two points
give the (2,2) Pade approximation of the exponential of the complete system.

The unknown of a point is its force, because g is flat at F = 0 for exponents up to 1. For larger
exponents, where g is vertical, for dampers with a linear part (y0 > 0), where g has no closed
form, and for dampers with a relief force, where g can be vertical, the unknown is the damper rate.

A damper with a relief force Fr (oil damper: Kasai, Takahashi and Sekiguchi 2004) has q(y) = c y up
to Fr, and from there the slope p c with the ratio p (0 <= p < 1).

References
----------
Hairer, E. and Wanner, G. (1996). Solving Ordinary Differential Equations II, section IV.5.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.equations.iteration import must_halve
from tdint.kernels.linear_terms import above, tie
from tdint.kernels.stories.path import (
    MEAN,
    MEAN_BY_BEND,
    MEAN_BY_RISE,
    MOMENT,
    MOMENT_BY_BEND,
    MOMENT_BY_RISE,
)

# Rows of the results of a story, relative to the first row. The first six rows are the same as in
# `tdint.kernels.stories.path`; the last is the energy that the damper dissipates in the step, J.
DISSIPATED = 6
BRACE_RESULT_ROWS = 7

# Gauss method with two stages: positions of the points from the middle of the step, and matrix
_S = math.sqrt(3.0) / 6.0
_A_SELF = 0.25
_A_12 = 0.25 - _S
_A_21 = 0.25 + _S

# Dimensionless. Ratio of the step to the relaxation time of the brace, h kb g'(F). Above this value
# the force at the end of the step, which the collocation does not damp, is not reported.
_STIFF = 3.0
# Dimensionless. Largest curvature of the drift rate for which its parabola is reliable
_MAX_BEND = 0.25
# Dimensionless. Residual of the equations of a story relative to their largest term
_TOLERANCE = 1e-14
# Straight lines for the parabola of the drift rate in a step, parts between changes of the line of
# the damper in each, and bisections of the time of a change
_RATE_PARTS = 4
_MAX_PARTS = 6
_BISECTIONS = 50
_INSTANTS = 16  # instants of a step at which a sum of forces is compared
_MAX_ITERATIONS = 80  # the slowest of the tested combinations needs 25


@inline
def _is_solved_for_rate(linear_terms, i):
    """Return True if the unknown of story `i` is the damper rate, False if it is the force."""
    return (
        linear_terms[rows.BRACED_EXPONENT, i] > 1.0
        or linear_terms[rows.BRACED_THRESHOLD, i] > 0.0
        or linear_terms[rows.BRACED_RELIEF, i] > 0.0
    )


@outlined
def _damper_at(linear_terms, i, x):
    """Return the damper of story `i` for a value `x` of the unknown: force (N), damper rate (m/s),
    and the derivatives of both with respect to x."""
    c = linear_terms[rows.BRACED_DAMPER, i]
    exponent = linear_terms[rows.BRACED_EXPONENT, i]
    if not _is_solved_for_rate(linear_terms, i):
        size = abs(x)
        if size == 0.0:
            return 0.0, 0.0, 1.0, 1.0 / c if exponent == 1.0 else 0.0
        rate = (size / c) ** (1.0 / exponent)
        return x, math.copysign(rate, x), 1.0, rate / (exponent * size)
    relief = linear_terms[rows.BRACED_RELIEF, i]
    if relief > 0.0 and abs(x) > relief / c:
        slope = linear_terms[rows.BRACED_RELIEF_RATIO, i] * c
        return math.copysign(relief + slope * (abs(x) - relief / c), x), x, slope, 1.0
    squared = x * x + linear_terms[rows.BRACED_THRESHOLD, i]
    if squared == 0.0:
        return 0.0, 0.0, 0.0, 1.0
    secant = c * squared ** (0.5 * (exponent - 1.0))
    return secant * x, x, secant * (1.0 + (exponent - 1.0) * x * x / squared), 1.0


@inline
def _damper_force(linear_terms, i, rate):
    """Return the force of the damper of story `i` at a damper rate, N."""
    if rate == 0.0:
        return 0.0
    if linear_terms[rows.BRACED_RELIEF, i] > 0.0:
        return _damper_at(linear_terms, i, rate)[0]
    power = 0.5 * (linear_terms[rows.BRACED_EXPONENT, i] - 1.0)
    squared = rate * rate + linear_terms[rows.BRACED_THRESHOLD, i]
    return linear_terms[rows.BRACED_DAMPER, i] * rate * squared**power


@inline
def _first_guess(linear_terms, i, weight, load):
    """Return an unknown of at least the size of the solution of F + `weight` g(F) = `load` for a
    damper without a linear part, with the sign of `load`."""
    c = linear_terms[rows.BRACED_DAMPER, i]
    exponent = linear_terms[rows.BRACED_EXPONENT, i]
    size = abs(load)
    if _is_solved_for_rate(linear_terms, i):
        guess = (size / c) ** (1.0 / exponent)
        guess = min(guess, size / weight) if weight > 0.0 else guess
    else:
        guess = min(size, c * (size / weight) ** exponent) if weight > 0.0 else size
    return math.copysign(guess, load)


@outlined
def _solve_one_point(linear_terms, i, weight, load):
    """Return the unknown x that solves F(x) + `weight` g(x) = `load`, weight in N s/m.

    The left side increases with x. Newton's method is monotone for a damper without a linear part,
    because the left side is convex between zero and the first guess. With a linear part, an iterate
    that changes its sign is replaced by zero, from where the iteration is monotone.
    """
    x = _first_guess(linear_terms, i, weight, load)
    for _ in range(_MAX_ITERATIONS):
        force, rate, force_slope, rate_slope = _damper_at(linear_terms, i, x)
        residual = force + weight * rate - load
        if abs(residual) <= _TOLERANCE * abs(load):
            break
        slope = force_slope + weight * rate_slope
        if slope == 0.0:
            break
        x -= residual / slope
        if x * load < 0.0:
            x = 0.0
    return x


@outlined
def follow_brace(linear_terms, i, h, rise, bend, force_0, scratch, row):
    """Compute mean and first moment of the force of brace and damper along a parabola of drift, by
    two Gauss points, with their derivatives and the dissipated energy.

    Parameters
    ----------
    force_0 : float
        Force at the start of the step (BRACE_FORCE), N.
    row : int
        First of the BRACE_RESULT_ROWS rows that are set. The force at the end is `force_0` plus the
        row MOMENT.
    """
    stiffness = linear_terms[rows.BRACE, i]
    weight = h * stiffness
    rise_1, rise_2 = rise - _S * bend, rise + _S * bend  # h times the drift rates at the points
    load_1 = force_0 + stiffness * (_A_SELF * rise_1 + _A_12 * rise_2)
    load_2 = force_0 + stiffness * (_A_21 * rise_1 + _A_SELF * rise_2)
    x_1 = _first_guess(linear_terms, i, weight * (0.5 - _S), load_1)
    x_2 = _first_guess(linear_terms, i, weight * (0.5 + _S), load_2)
    size = max(abs(load_1), abs(load_2), abs(force_0))
    step_1 = step_2 = 0.0
    fraction = 1.0
    previous_norm = math.inf
    iterations = 0
    while True:
        force_1, rate_1, force_slope_1, rate_slope_1 = _damper_at(linear_terms, i, x_1)
        force_2, rate_2, force_slope_2, rate_slope_2 = _damper_at(linear_terms, i, x_2)
        # Entries of the matrix of Newton's method
        m_11 = force_slope_1 + weight * _A_SELF * rate_slope_1
        m_12 = weight * _A_12 * rate_slope_2
        m_21 = weight * _A_21 * rate_slope_1
        m_22 = force_slope_2 + weight * _A_SELF * rate_slope_2
        determinant = m_11 * m_22 - m_12 * m_21
        residual_1 = force_1 + weight * (_A_SELF * rate_1 + _A_12 * rate_2) - load_1
        residual_2 = force_2 + weight * (_A_21 * rate_1 + _A_SELF * rate_2) - load_2
        scale = max(size, weight * max(abs(_A_21 * rate_1), abs(_A_SELF * rate_2)))
        if (
            max(abs(residual_1), abs(residual_2)) <= _TOLERANCE * scale
            or iterations == _MAX_ITERATIONS
            or determinant == 0.0
        ):
            break
        norm = residual_1 * residual_1 + residual_2 * residual_2
        if must_halve(norm, previous_norm, fraction):
            fraction *= 0.5
            x_1 -= fraction * step_1
            x_2 -= fraction * step_2
            continue
        previous_norm = norm
        fraction = 1.0
        step_1 = (m_12 * residual_2 - m_22 * residual_1) / determinant
        step_2 = (m_21 * residual_1 - m_11 * residual_2) / determinant
        x_1 += step_1
        x_2 += step_2
        iterations += 1
    scratch[row + MEAN, i] = 0.5 * (force_1 + force_2)
    scratch[row + MOMENT, i] = 6.0 * _S * (force_2 - force_1)
    scratch[row + DISSIPATED, i] = 0.5 * h * (force_1 * rate_1 + force_2 * rate_2)
    # The loads have these derivatives with respect to the rise, then to the bend.
    for column in range(2):
        by_1 = stiffness * ((0.5 - _S) if column == 0 else _S * (_A_12 - _A_SELF))
        by_2 = stiffness * ((0.5 + _S) if column == 0 else _S * (_A_SELF - _A_21))
        force_by_1 = force_by_2 = 0.0
        if determinant != 0.0:
            force_by_1 = force_slope_1 * (m_22 * by_1 - m_12 * by_2) / determinant
            force_by_2 = force_slope_2 * (m_11 * by_2 - m_21 * by_1) / determinant
        scratch[row + MEAN_BY_RISE + column, i] = 0.5 * (force_by_1 + force_by_2)
        scratch[row + MOMENT_BY_RISE + column, i] = 6.0 * _S * (force_by_2 - force_by_1)


@outlined
def follow_brace_at_midpoint(linear_terms, i, h, rise, force_0, scratch, row):
    """Compute the same results by one Gauss point, for methods of order 2.

    The force at the midpoint is Fm = F0 + kb (rise - h g(Fm)) / 2, and F(end) = 2 Fm - F0. The
    derivatives with respect to the bend are 0.
    """
    stiffness = linear_terms[rows.BRACE, i]
    weight = 0.5 * h * stiffness
    load = force_0 + 0.5 * stiffness * rise
    force, rate, force_slope, rate_slope = _damper_at(
        linear_terms, i, _solve_one_point(linear_terms, i, weight, load)
    )
    scratch[row + MEAN, i] = force
    scratch[row + MOMENT, i] = 2.0 * (force - force_0)
    scratch[row + DISSIPATED, i] = h * force * rate
    slope = force_slope + weight * rate_slope
    scratch[row + MEAN_BY_RISE, i] = 0.5 * stiffness * force_slope / slope if slope > 0.0 else 0.0
    scratch[row + MOMENT_BY_RISE, i] = 2.0 * scratch[row + MEAN_BY_RISE, i]
    scratch[row + MEAN_BY_BEND, i] = 0.0
    scratch[row + MOMENT_BY_BEND, i] = 0.0


@inline
def _damper_rate(linear_terms, i, force):
    """Return g(F), the damper rate (m/s) for a force (N), and its derivative with respect to F."""
    _, rate, force_slope, rate_slope = _damper_at(
        linear_terms, i, _solve_one_point(linear_terms, i, 0.0, force)
    )
    return rate, rate_slope / force_slope if force_slope > 0.0 else math.inf


@inline
def _is_stiff(linear_terms, i, h, force_0, scratch, row):
    """Return True if the damper follows the drift rate within a fraction of the step, so that the
    force at the end of the step oscillates about the true force."""
    force_1 = force_0 + scratch[row + MOMENT, i]
    force = max(abs(scratch[row + MEAN, i]), abs(force_0), abs(force_1))
    _, slope = _damper_rate(linear_terms, i, force)
    return h * linear_terms[rows.BRACE, i] * slope > _STIFF


@inline
def _force_after_mean(linear_terms, i, h, mean, rate):
    """Return the force of a stiff damper at the end of a step with a drift rate, N, by an implicit
    step from the mean of the force at the midpoint."""
    weight = 0.5 * h * linear_terms[rows.BRACE, i]
    unknown = _solve_one_point(linear_terms, i, weight, mean + weight * rate)
    return _damper_at(linear_terms, i, unknown)[0]


@outlined
def _along_line(stiffness, line, force, rate, rate_slope, duration):
    """Return the force on a line of the damper after a duration, N, and the largest absolute value
    between.

    `line` contains the slope (N s/m) and a point of the line: rate (m/s) and force (N). The drift
    rate is linear, so that F' + kb F / slope is linear in time.
    """
    slope, line_rate, line_force = line
    lag = slope / stiffness
    moving = slope * rate_slope
    steady = slope * (rate - line_rate) + line_force - moving * lag
    transient = force - steady
    end = steady + moving * duration + transient * math.exp(-duration / lag)
    largest = max(abs(force), abs(end))
    if moving != 0.0 and transient / (lag * moving) > 1.0:  # F' = 0 at a positive time
        extremum = lag * math.log(transient / (lag * moving))
        if extremum < duration:
            largest = max(largest, abs(steady + moving * (extremum + lag)))
    return end, largest


@outlined
def _along_relief(linear_terms, i, force, rate, rate_slope, duration):
    """Return the force of brace and damper after a duration with a linear drift rate, N, and its
    largest absolute value between, for a damper with a relief force.

    The force follows the line of the damper up to the relief force, then the line beyond; each
    change of the line is an instant at which the force is the relief force. Both results are forces
    of the law.
    """
    stiffness = linear_terms[rows.BRACE, i]
    c = linear_terms[rows.BRACED_DAMPER, i]
    relief = linear_terms[rows.BRACED_RELIEF, i]
    beyond = linear_terms[rows.BRACED_RELIEF_RATIO, i] * c
    corner = relief / c  # rate at the relief force
    if beyond == 0.0:
        force = min(max(force, -relief), relief)
    largest = abs(force)
    for _ in range(_MAX_PARTS):
        side = math.copysign(1.0, force)
        excess = side * rate - corner
        opens = excess > 0.0 or (excess == 0.0 and side * rate_slope > 0.0)
        is_beyond = abs(force) > relief or (abs(force) == relief and opens)
        if is_beyond and beyond == 0.0:
            # The force remains until the rate returns to the corner.
            falling = -side * rate_slope
            if excess >= falling * duration:
                break
            duration -= excess / falling
            rate = side * corner
            continue
        line = (beyond, side * corner, side * relief) if is_beyond else (c, 0.0, 0.0)
        end, most = _along_line(stiffness, line, force, rate, rate_slope, duration)
        if side * end >= relief if is_beyond else abs(end) <= relief:
            return end, max(largest, most)
        side = side if is_beyond else math.copysign(1.0, end)
        low, high = 0.0, duration
        for _ in range(_BISECTIONS):
            part = 0.5 * (low + high)
            value, _ = _along_line(stiffness, line, force, rate, rate_slope, part)
            if (side * value < relief) == is_beyond:
                high = part
            else:
                low = part
        largest = max(
            largest, relief, _along_line(stiffness, line, force, rate, rate_slope, low)[1]
        )
        force = side * relief
        rate += rate_slope * high
        duration -= high
    return force, largest


@outlined
def follow_relief(linear_terms, i, h, rates, force_0):
    """Return the force of a damper with a relief force at the end of a step, N, and its largest
    absolute value in the step.

    The drift rate is a parabola with the values at both ends and the mean, `rates`; each of
    _RATE_PARTS parts is a straight line, on which the force is exact. The force is a value of the
    law, and does not exceed the relief force if the ratio is 0.
    """
    first_rate, last_rate, mean_rate = rates
    bend = 6.0 * mean_rate - 3.0 * (first_rate + last_rate)
    part = h / _RATE_PARTS
    force = force_0
    largest = 0.0
    rate = first_rate
    for j in range(1, _RATE_PARTS + 1):
        t = j / _RATE_PARTS
        next_rate = first_rate + t * (last_rate - first_rate + bend * (1.0 - t))
        slope = (next_rate - rate) / part
        force, most = _along_relief(linear_terms, i, force, rate, slope, part)
        largest = max(largest, most)
        rate = next_rate
    return force, largest


@outlined
def instant_of_largest_sum(linear_terms, i, h, ends, force_0, spring):
    """Return the instant at which the force of a damper with a relief force and of a spring are
    largest together, as a fraction of the step; 0 for an end of the step.

    `ends` contains drift (m) and drift rate (m/s) at both ends, `spring` the force (N) of the
    spring at the start and its stiffness (N/m). The force of the damper has a kink where it reaches
    or leaves the relief force, so that the values at the ends do not show the peak.
    """
    d_0, rate_0, d_1, rate_1 = ends
    spring_force, stiffness = spring
    rise = d_1 - d_0
    bend = 6.0 * rise / h - 3.0 * (rate_0 + rate_1)
    force, rate, drift = force_0, rate_0, 0.0
    part = h / _INSTANTS
    best, largest = 0.0, abs(spring_force + force_0)
    for j in range(1, _INSTANTS + 1):
        t = j / _INSTANTS
        next_rate = rate_0 + t * (rate_1 - rate_0 + bend * (1.0 - t))
        force, _ = _along_relief(linear_terms, i, force, rate, (next_rate - rate) / part, part)
        drift += 0.5 * part * (rate + next_rate)
        rate = next_rate
        total = abs(spring_force + stiffness * drift + force)
        if total > largest:
            best, largest = (t if j < _INSTANTS else 0.0), total
    return best


@outlined
def brace_force_at(linear_terms, i, duration, motion, force_0, scratch, row):
    """Return the force of brace and damper at an instant inside a step, N.

    `duration` is the time since the start of the step, s, and `motion` contains the change of drift
    until then (m) and the drift rates at the start and at the instant (m/s). `force_0` is the
    reported force at the start of the step, N.
    """
    rise, first_rate, rate = motion
    if duration == 0.0:
        return force_0
    if linear_terms[rows.BRACED_RELIEF, i] > 0.0:
        rates = (first_rate, rate, rise / duration)
        return follow_relief(linear_terms, i, duration, rates, force_0)[0]
    bend = duration * (rate - first_rate)
    follow_brace(linear_terms, i, duration, rise, bend, force_0, scratch, row)
    if _is_stiff(linear_terms, i, duration, force_0, scratch, row):
        return _force_after_mean(linear_terms, i, duration, scratch[row + MEAN, i], rate)
    return force_0 + scratch[row + MOMENT, i]


@outlined
def commit_brace(linear_terms, i, h, rates, state, scratch, row):
    """Move brace and damper of story `i` to the end of the step, and update their peak force.

    BRACE_FORCE becomes the force at the end. The reported force is this force, and its peak within
    the step the extremum of the cubic with F and F' = kb (d' - g(F)) at both ends. If the damper is
    stiff, the reported force follows from the mean of the force at the midpoint and an implicit
    step to the end, F + (h kb / 2) g(F) = mean + (h kb / 2) d', which tends to q(d'); the peak
    within the step is then the largest of this force, the mean and the force at the extremum of
    the drift rate.

    Parameters
    ----------
    rates : tuple of float
        Drift rates at both ends of the step, the rate d' for a stiff damper, and the mean rate,
        m/s. The third is the mean rate if the method does not damp its rates at the ends.
    row : int
        First row of the results of `follow_brace` or `follow_brace_at_midpoint`.
    """
    first_rate, last_rate, stiff_rate, mean_rate = rates
    stiffness = linear_terms[rows.BRACE, i]
    force_0 = state[rows.BRACE_FORCE, i]
    mean = scratch[row + MEAN, i]
    force_1 = force_0 + scratch[row + MOMENT, i]
    state[rows.BRACE_FORCE, i] = force_1
    state[rows.BRACE_DISSIPATED, i] += scratch[row + DISSIPATED, i]
    state[rows.BRACE_START, i] = state[rows.BRACE_REPORTED, i]
    if linear_terms[rows.BRACED_RELIEF, i] > 0.0:
        ends = (first_rate, last_rate, mean_rate)
        reported, peak = follow_relief(linear_terms, i, h, ends, state[rows.BRACE_REPORTED, i])
    elif _is_stiff(linear_terms, i, h, force_0, scratch, row):
        reported = _force_after_mean(linear_terms, i, h, mean, stiff_rate)
        peak = max(abs(reported), abs(mean))
        # Extremum of the parabola of the drift rate. Near it, the force lags behind the force of
        # the damper alone, and its peak corresponds to a rate that is smaller by `bend` lag^2.
        bend = 6.0 * mean_rate - 3.0 * (first_rate + last_rate)
        change = last_rate - first_rate
        if abs(change) < abs(bend) <= _MAX_BEND * (abs(first_rate) + abs(last_rate)):
            rate = first_rate + 0.25 * (bend + change) * (bend + change) / bend
            _, slope = _damper_rate(linear_terms, i, _damper_force(linear_terms, i, rate))
            lag = 1.0 / (h * stiffness * slope)
            peak = max(peak, abs(_damper_force(linear_terms, i, rate - bend * lag * lag)))
    else:
        reported = force_1
        peak = abs(force_1)
        slope_0 = h * stiffness * (first_rate - _damper_rate(linear_terms, i, force_0)[0])
        slope_1 = h * stiffness * (last_rate - _damper_rate(linear_terms, i, force_1)[0])
        # The cubic has the rate slope_0 + 2 b t + 3 c t^2.
        b = 3.0 * (force_1 - force_0) - 2.0 * slope_0 - slope_1
        c = slope_0 + slope_1 - 2.0 * (force_1 - force_0)
        discriminant = b * b - 3.0 * c * slope_0
        if slope_0 * slope_1 < 0.0 and discriminant > 0.0:
            # With opposite slopes at the ends, exactly one root is within the step.
            q = -(b + math.copysign(math.sqrt(discriminant), b))
            t = slope_0 / q if q != 0.0 and 0.0 < slope_0 / q < 1.0 else q / (3.0 * c)
            peak = max(peak, abs(force_0 + t * (slope_0 + t * (b + t * c))))
    state[rows.BRACE_REPORTED, i] = reported
    state[rows.BRACE_PEAK, i] = max(state[rows.BRACE_PEAK, i], peak)


@outlined
def add_reported_accelerations(linear_terms, state, scratch, row):
    """Replace the forces of braces in the accelerations of a scratch row (m/s^2) by the reported
    forces. The accelerations are the accelerations of equilibrium with BRACE_FORCE."""
    n = linear_terms.shape[1] - 1
    for i in range(n):
        difference = state[rows.BRACE_FORCE, i] - state[rows.BRACE_REPORTED, i]
        difference -= above(linear_terms, state, rows.BRACE_FORCE, i) - above(
            linear_terms, state, rows.BRACE_REPORTED, i
        )
        scratch[row, i] += linear_terms[rows.INVERSE_MASS, i] * difference
    tie(linear_terms, scratch, row)
