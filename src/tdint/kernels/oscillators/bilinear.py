"""Exact response of bilinear oscillators to a ground motion that is linear between its samples.

The equation of motion is u'' + c u' + f = -ag. On each branch f is linear in u: k u + offset
(elastic) or hardening k u + offset (yielding). The response on a branch is known in closed form.
Here it is a recursion over steps. Within a step it is the Taylor series of the response, which is
summed until additional terms are negligible (the steps are short, omega h <= 1). The branch changes
where u reaches the yield surface, or where u' changes its sign during yielding. These times are
bracketed and computed with the series.

No event can be missed. On a branch, u'' is a decaying sine (or the sum of two exponentials, or of
an exponential and a constant) and has at most one zero within a step. Therefore the velocity is
monotonic between the zeros of u'', and the displacement is monotonic between the zeros of u'.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels.compiling import F8, I8, VECTOR, inline, kernel, local, outlined
from tdint.kernels.oscillators.between_steps import (
    Vibration,
    largest_afterwards,
    narrow_bracket,
)

# Elements of the state of an oscillator: displacement (m), velocity (m/s) and the branch.
U = 0
V = 1
SIDE = 2  # 0 for elastic, 1 or -1 for yielding in this direction
OFFSET = 3  # the force over the mass is the stiffness of the branch times u, plus this value, m/s^2
UPPER = 4  # limits of the elastic branch, m
LOWER = 5
PEAK = 6  # maximum |u| until now, m
STATE_ROWS = 7

# Elements of the array `results` of `bilinear_response`
LARGEST = 0  # maximum |u|, also after the ground motion, m
RESIDUAL = 1  # u after the decay of the free vibration, m
RESULTS = 2

TOO_MANY_EVENTS = -1
"""Error code: more changes of branch within a step than the maximum."""

NEVER = -1.0  # time of an event that does not occur; times are not negative

# Maximum number of terms of a power series. About 30 terms are sufficient for the longest step: a
# series ends when its terms are below 1e-18 of its largest terms.
_MAX_TERMS = 44
_MAX_EVENTS = 60  # maximum number of changes of branch within a step
# Maximum number of steps of the free vibration after the ground motion. The length of a step is
# one radian of the elastic vibration (1 / omega).
_FREE_VIBRATION = 1_000_000


class _Hysteretic(NamedTuple):
    """Properties of a bilinear oscillator, divided by its mass.

    Attributes
    ----------
    k : float
        Initial stiffness over mass, 1/s^2.
    c : float
        Damping coefficient over mass, 1/s.
    hardening : float
        Ratio of the stiffness after yielding to the initial stiffness.
    strength : float
        Yield force over mass times (1 - hardening), m/s^2: the strength of the elastic-perfectly
        plastic part of the force. The other part is elastic, with the stiffness hardening k.
    """

    k: float
    c: float
    hardening: float
    strength: float


@outlined
def _taylor(series, u, v, load, slope, k, c, t):
    """Compute the Taylor coefficients of the solution of u'' + c u' + k u = load + slope t, and
    return how many are needed up to the time t (s).

    With u(t) = sum of s_j t^j, the coefficients are s_0 = u(0), s_1 = u'(0) and, by comparison of
    powers,

        s_2 = (load - c s_1 - k s_0) / 2,   s_3 = (slope - 2 c s_2 - k s_1) / 6
        s_j = -(c (j - 1) s_(j-1) + k s_(j-2)) / (j (j - 1))   for j >= 4

    The load (m/s^2) and its rate are divided by the mass. The callers use sqrt(k) t <= 1 and
    damping ratios below 1, so that c t <= 2. The series then ends with fewer than _MAX_TERMS
    coefficients (at most about 30).
    """
    series[0], series[1] = u, v
    series[2] = 0.5 * (load - c * v - k * u)
    series[3] = (slope - 2.0 * c * series[2] - k * v) / 6.0
    # A term is negligible if it is below 1e-18 of the largest of the first four terms. The series
    # ends after two negligible terms in succession, because a single term can be zero by chance.
    power = t * t * t
    largest = max(abs(u), abs(v) * t, abs(series[2]) * t * t, abs(series[3]) * power)
    negligible_terms = 0
    for j in range(4, _MAX_TERMS):
        series[j] = -(c * (j - 1) * series[j - 1] + k * series[j - 2]) / (j * (j - 1))
        power *= t
        negligible_terms = negligible_terms + 1 if abs(series[j]) * power <= 1e-18 * largest else 0
        if negligible_terms == 2:
            return j + 1
    return _MAX_TERMS


@inline
def _displacement(series, terms, t):
    """Return the displacement s_0 + s_1 t + s_2 t^2 + ... at time `t` (s), m.

    `series` contains the coefficients s_j; only the first `terms` coefficients are used.
    """
    value = 0.0
    for j in range(terms - 1, -1, -1):
        value = value * t + series[j]
    return value


@inline
def _velocity(series, terms, t):
    """Return the velocity s_1 + 2 s_2 t + 3 s_3 t^2 + ... at time `t` (s), m/s."""
    value = 0.0
    for j in range(terms - 1, 0, -1):
        value = value * t + j * series[j]
    return value


@inline
def _acceleration(series, terms, t):
    """Return the acceleration 2 s_2 + 6 s_3 t + 12 s_4 t^2 + ... at time `t` (s), m/s^2."""
    value = 0.0
    for j in range(terms - 1, 1, -1):
        value = value * t + j * (j - 1) * series[j]
    return value


@outlined
def _derivative(series, terms, order, t):
    """Return the displacement (order 0, m), the velocity (1, m/s) or the acceleration (2, m/s^2) at
    time `t`."""
    if order == 0:
        return _displacement(series, terms, t)
    if order == 1:
        return _velocity(series, terms, t)
    return _acceleration(series, terms, t)


@outlined
def _root(series, terms, order, level, left, right):
    """Return the time (s) between `left` and `right` when displacement, velocity or acceleration
    (derivative of order 0, 1 or 2 of the series) crosses a level.

    The method is regula falsi with halved weights (Illinois), with bisection in every fourth
    iteration. If the values at both times are not on different sides of the level, the result is
    `left`. The callers ensure that the value at `right` is different from the level and on the
    other side. Only the value at `left` can be equal to the level, or on the same side by rounding;
    the crossing is then at `left`.
    """
    at_left = _derivative(series, terms, order, left) - level
    at_right = _derivative(series, terms, order, right) - level
    if at_left == 0.0 or (at_left > 0.0) == (at_right > 0.0):
        return left
    # Narrow the bracket until its width or the last movement is of the order of rounding errors.
    side = 0
    for i in range(100):
        t = (left * at_right - right * at_left) / (at_right - at_left)
        if not left < t < right or i % 4 == 3:
            t = 0.5 * (left + right)
        value = _derivative(series, terms, order, t) - level
        if value == 0.0 or not left < t < right:
            return t
        left, at_left, right, at_right, side, moved = narrow_bracket(
            left, at_left, right, at_right, side, t, value
        )
        if right - left <= 4e-16 * right or (moved <= 4e-16 * right and i % 4 != 3):
            break
    # `side` is -1 if `narrow_bracket` moved `left` last, and 1 if it moved `right` last. The
    # endpoint that was moved last is the best estimate.
    return left if side < 0 else right


@outlined
def _velocity_zero(series, terms, start, end):
    """Return the time (s) when the velocity, which must be monotonic, changes its sign between
    `start` and `end`; `end` if it does not.
    """
    if _velocity(series, terms, start) * _velocity(series, terms, end) < 0.0:
        # Locate the time when the velocity (derivative of order 1) crosses the level 0.
        return _root(series, terms, 1, 0.0, start, end)
    return end


@outlined
def _end_of_yielding(series, terms, side, middle, remaining):
    """Return the time (s) when yielding ends within a step, or NEVER (-1): when the velocity
    changes to the sign opposite to the direction of yielding.

    The velocity is monotonic until `middle`, the zero of the acceleration (or `remaining`), and
    from there to `remaining`, the end of the step.
    """
    start = 0.0
    for end in (middle, remaining):
        if side * _velocity(series, terms, end) < 0.0:
            # The velocity may already be opposite (or zero) at the start of this part.
            if side * _velocity(series, terms, start) <= 0.0:
                return start
            return _velocity_zero(series, terms, start, end)
        start = end
    return NEVER


@outlined
def _end_of_elastic_branch(series, terms, state, middle, remaining):
    """Return the time (s) when the displacement reaches a limit of the elastic branch within a
    step, or NEVER (-1), and update the peak displacement. `middle` and `remaining` are the same as
    for `_end_of_yielding`.

    The step is divided into parts with monotonic u. PEAK is updated with |u| at the end of
    each part before the returned time. These times include all extrema of u.
    """
    start = 0.0
    # u is monotonic between these times. If the velocity has no zero between two times,
    # `_velocity_zero` returns the second time, and the next part has the length 0.
    for end in (
        _velocity_zero(series, terms, 0.0, middle),
        middle,
        _velocity_zero(series, terms, middle, remaining),
        remaining,
    ):
        u = _displacement(series, terms, end)
        if u > state[UPPER] or u < state[LOWER]:
            limit = state[UPPER] if u > state[UPPER] else state[LOWER]
            # Locate the time when the displacement (derivative of order 0) crosses the limit.
            return _root(series, terms, 0, limit, start, end)
        state[PEAK] = max(state[PEAK], abs(u))
        start = end
    return NEVER


@outlined
def _end_yielding(state, oscillator):
    """Set the elastic branch that follows yielding, at a reversal of the velocity.

    The force over the mass is hardening k u + side strength during yielding, and k u + OFFSET on
    the elastic branch. Both are equal at the reversal, which determines OFFSET. The oscillator
    yields again at the current displacement, or on the other side after a change of displacement of
    twice the yield displacement, 2 strength / ((1 - hardening) k).
    """
    k, _, hardening, strength = oscillator
    u, side = state[U], state[SIDE]
    # The elastic branch is valid between the displacement at the reversal and the opposite limit.
    opposite_limit = u - side * 2.0 * strength / ((1.0 - hardening) * k)
    state[SIDE] = 0.0
    state[V] = 0.0
    state[OFFSET] = side * strength - (1.0 - hardening) * k * u
    state[UPPER], state[LOWER] = max(u, opposite_limit), min(u, opposite_limit)


@outlined
def _start_yielding(state, strength):
    """Set the yielding branch that follows the elastic branch at one of its limits, and the
    displacement to this limit. The force over the mass is then hardening k u + OFFSET, with OFFSET
    = side strength.
    """
    # The limit that was reached is the nearer one. Rounding must not reverse the velocity.
    side = 1.0 if 2.0 * state[U] > state[UPPER] + state[LOWER] else -1.0
    state[SIDE] = side
    state[U] = state[UPPER] if side > 0.0 else state[LOWER]
    state[V] = side * max(side * state[V], 0.0)
    state[OFFSET] = side * strength


@outlined
def _integrate_step(state, series, oscillator, g, slope, h):
    """Integrate a bilinear oscillator over one step of length h (sqrt(k) h <= 1) and through all
    branch changes within it. Return the number of branch changes, or TOO_MANY_EVENTS (-1).

    The equation of motion on a branch is u'' + c u' + k' u = -(g + slope t) - OFFSET, with the
    stiffness k' = k (elastic) or hardening k (yielding) over the mass. Its response is the Taylor
    series of the exact solution. If the oscillator yields or unloads within the step, the time of
    this event is computed, the branch is changed, and the integration continues from this time.

    PEAK is updated at each event and at the end of the step. During yielding, u is monotonic until
    the event, so that no extremum is missed. On the elastic branch, `_end_of_elastic_branch` also
    updates PEAK at the extrema of u before the event.
    """
    k, c, hardening, strength = oscillator
    # `t` is the time of the last event, from the start of the step. The series and the times
    # `remaining`, `middle`, `event` and `end` start from this event.
    t = 0.0
    for events in range(_MAX_EVENTS):
        side = state[SIDE]
        remaining = h - t
        load = -(g + slope * t) - state[OFFSET]
        # Compute the coefficients of the response on the branch; `terms` is their number.
        stiffness = k if side == 0.0 else hardening * k
        terms = _taylor(series, state[U], state[V], load, -slope, stiffness, c, remaining)
        # The velocity is monotonic from 0 to `middle`, and from `middle` to `remaining`, because
        # the acceleration has at most one zero. `_root` locates this zero (derivative of order 2,
        # level 0) between the times 0 and `remaining`. series[2] is half of u'' at the time 0.
        middle = remaining
        if series[2] * _acceleration(series, terms, remaining) < 0.0:
            middle = _root(series, terms, 2, 0.0, 0.0, remaining)
        if side == 0.0:
            event = _end_of_elastic_branch(series, terms, state, middle, remaining)
        else:
            event = _end_of_yielding(series, terms, side, middle, remaining)
        # Move to the event or to the end of the step, and change the branch at the event.
        end = remaining if event == NEVER else event
        state[U] = _displacement(series, terms, end)
        state[V] = _velocity(series, terms, end)
        # The start of yielding sets the displacement to the limit exactly, before the peak is
        # updated.
        if event != NEVER and side == 0.0:
            _start_yielding(state, strength)
        state[PEAK] = max(state[PEAK], abs(state[U]))
        if event == NEVER:
            return events
        if side != 0.0:
            _end_yielding(state, oscillator)
        t += event
    return TOO_MANY_EVENTS


@outlined
def _coefficients(steps, first, series, k, c, h):
    """Compute the coefficients of the exact step of an oscillator on a branch, and store s_0 to s_7
    from element `first` of `steps` on: 0 for the elastic branch, 8 for the yielding branch.

    The equation of motion is u'' + c u' + k u = -p. The load is -p, and p is linear from p0 to p1
    within a step of length h:

        u1 = s_0 u0 + s_1 v0 + s_2 p0 + s_3 p1,   v1 = s_4 u0 + s_5 v0 + s_6 p0 + s_7 p1

    The coefficients are the responses to unit values of u0, v0, p0 and p1.
    """
    # Column 0: u0 = 1. Column 1: v0 = 1. Column 2: p0 = 1, so the load is -1 at the start and 0 at
    # the end. Column 3: p1 = 1, so the load is 0 at the start and -1 at the end.
    for column in range(4):
        u = 1.0 if column == 0 else 0.0
        v = 1.0 if column == 1 else 0.0
        load = -1.0 if column == 2 else 0.0
        slope = 1.0 / h if column == 2 else (-1.0 / h if column == 3 else 0.0)
        terms = _taylor(series, u, v, load, slope, k, c, h)
        # Elements 0 to 3 give the displacement at the end, elements 4 to 7 the velocity.
        steps[first + column] = _displacement(series, terms, h)
        steps[first + 4 + column] = _velocity(series, terms, h)


@outlined
def _integrate_motion(ground, parts, h, oscillator, steps, series, state):
    """Integrate a bilinear oscillator from rest over the complete ground motion. Return the number
    of branch changes, or TOO_MANY_EVENTS (-1).

    With the ground acceleration ag and p = ag + OFFSET, the equation of motion on a branch is u'' +
    c u' + k' u = -p, k' = k or hardening k. The response at the end of a step is an exact linear
    function of the displacement and the velocity at its start, and of p at both endpoints, with the
    coefficients of `_coefficients` (`steps`).

    The step is accepted if the oscillator cannot change its branch in the step, and if the peak
    displacement cannot be exceeded between the endpoints. Otherwise the step is repeated with
    `_integrate_step`, which locates the changes of branch and updates the peak displacement, also
    at extrema between the endpoints.

    `parts` is the number of steps per sampling interval; sqrt(k) h must not exceed 1. `state`
    contains the limits of the elastic branch, and receives the state at the end and PEAK.
    """
    k, c, hardening, _ = oscillator
    e00, e01, e02, e03 = steps[0], steps[1], steps[2], steps[3]
    e10, e11, e12, e13 = steps[4], steps[5], steps[6], steps[7]
    y00, y01, y02, y03 = steps[8], steps[9], steps[10], steps[11]
    y10, y11, y12, y13 = steps[12], steps[13], steps[14], steps[15]
    # Within a step, the distance of u from its chord is at most h^2/8 max |u''|. u'' is a free
    # vibration: a decaying sine over at most one radian, because omega h <= 1. Therefore u'' has at
    # most one zero in a step, and max |u''| is at most e^(c h / 2) / cos(0.5) = 1.14 e^(c h / 2)
    # times its larger value at the endpoints. The factor 0.25 is above 1.14 / 8, with a margin.
    bend_limit = 0.25 * h * h * math.exp(0.5 * c * h)
    yielding_stiffness = hardening * k
    step_fraction = 1.0 / parts
    events = 0
    u, v, side, offset, upper, lower, peak = 0.0, 0.0, 0.0, 0.0, state[UPPER], state[LOWER], 0.0
    # `side` is 0 on the elastic branch, and 1 or -1 during yielding in this direction. `a` is -u'',
    # which is p + c v + k' u. Only its absolute value and changes of its sign are used.
    a = ground[0]
    for i in range(1, ground.size):
        g0 = ground[i - 1]
        increment = (ground[i] - g0) * step_fraction
        for _ in range(parts):
            p0 = g0 + offset
            p1 = p0 + increment
            if side == 0.0:
                u1 = (e02 * p0 + e03 * p1) + e00 * u + e01 * v
                v1 = (e12 * p0 + e13 * p1) + e10 * u + e11 * v
                a1 = p1 + c * v1 + k * u1
                excess = bend_limit * max(abs(a), abs(a1))
                highest = max(u, u1) + excess
                lowest = min(u, u1) - excess
                # The step is simple if u cannot reach a limit of the branch and cannot exceed the
                # peak at an extremum: either the bounds are at most the peak, or u has no extremum.
                # If v and u'' keep their signs from start to end, u'' has no zero in the step.
                # Therefore v is monotonic and has no zero, and u has no extremum.
                is_simple = (highest < upper and lowest > lower) and (
                    max(highest, -lowest) <= peak or (v * v1 > 0.0 and a * a1 > 0.0)
                )
            else:
                u1 = (y02 * p0 + y03 * p1) + y00 * u + y01 * v
                v1 = (y12 * p0 + y13 * p1) + y10 * u + y11 * v
                a1 = p1 + c * v1 + yielding_stiffness * u1
                # The step is simple if v and u'' keep their signs from start to end. In this case
                # v has no zero in the step, so yielding continues and u is monotonic.
                is_simple = v * v1 > 0.0 and a * a1 > 0.0
            if is_simple:
                u, v, a = u1, v1, a1
                peak = max(peak, abs(u))
                g0 += increment
                continue
            # The step is not simple: integrate through its events.
            state[U], state[V], state[SIDE], state[OFFSET] = u, v, side, offset
            state[UPPER], state[LOWER], state[PEAK] = upper, lower, peak
            count = _integrate_step(state, series, oscillator, g0, increment / h, h)
            if count < 0:
                return count
            events += count
            u, v, side, offset = state[U], state[V], state[SIDE], state[OFFSET]
            upper, lower, peak = state[UPPER], state[LOWER], state[PEAK]
            g0 += increment
            a = g0 + offset + c * v + (k if side == 0.0 else yielding_stiffness) * u
    state[U], state[V], state[SIDE], state[OFFSET] = u, v, side, offset
    state[UPPER], state[LOWER], state[PEAK] = upper, lower, peak
    return events


@outlined
def _vibrate_freely(state, series, oscillator):
    """Integrate an oscillator without ground motion until its vibration remains within the elastic
    branch, and return the displacement after the decay of this vibration, m.

    The result is the center of the vibration, -OFFSET / k, also for an undamped oscillator. It is
    NaN if a step has too many changes of branch. The integration ends after _FREE_VIBRATION steps;
    if the oscillator yields at this time, the result is its displacement. PEAK includes the two
    largest extrema of the remaining vibration, one on each side of its center.
    """
    # The length of a step is one radian of the elastic vibration.
    k, c = oscillator.k, oscillator.c
    h = 1.0 / math.sqrt(k)
    for _ in range(_FREE_VIBRATION):
        # If the free vibration remains within the elastic branch, it decays to its center.
        if state[SIDE] == 0.0:
            center = 0.0 - state[OFFSET] / k  # not -0.0 if OFFSET is zero
            amplitude = math.sqrt((state[U] - center) ** 2 + state[V] ** 2 / k)
            tolerance = 1e-9 * (state[UPPER] - state[LOWER])
            if (
                center + amplitude <= state[UPPER] + tolerance
                and center - amplitude >= state[LOWER] - tolerance
            ):
                first = largest_afterwards(state[U] - center, state[V], Vibration(k, c, h), 0.0)
                # The next extremum is half a damped period later.
                ratio = c / math.sqrt(4.0 * k - c * c)
                second = first * math.exp(-math.pi * ratio)
                # The velocity has the sign of the first extremum.
                is_upper = state[V] > 0.0 or (state[V] == 0.0 and state[U] > center)
                side = 1.0 if is_upper else -1.0
                state[PEAK] = max(
                    state[PEAK], max(abs(center + side * first), abs(center - side * second))
                )
                return center
        if _integrate_step(state, series, oscillator, 0.0, 0.0, h) < 0:
            return math.nan
    return -state[OFFSET] / k if state[SIDE] == 0.0 else state[U]


@outlined
def _continue_after_motion(state, series, oscillator, last_sample, dt, parts):
    """Continue after the last sample of a ground motion, update PEAK, and return the displacement
    after the decay of the free vibration (m). The ground acceleration decreases to zero within a
    sampling interval, which has `parts` steps.
    """
    h = dt / parts
    for part in range(parts):
        g = last_sample * (1.0 - part / parts)
        if _integrate_step(state, series, oscillator, g, -last_sample / dt, h) < 0:
            return math.nan
    return _vibrate_freely(state, series, oscillator)


@kernel(I8(VECTOR, F8, F8, F8, F8, F8, VECTOR), has_forms=False, vectorized=True)
def bilinear_response(ground, dt, omega, xi, hardening, yield_displacement, results):
    """Compute the response of a bilinear oscillator from rest to a ground motion, and to the ground
    at rest after it. Return the number of branch changes during the ground motion, or
    TOO_MANY_EVENTS (-1).

    The equation of motion is u'' + 2 xi omega u' + f = -ag, with the ground acceleration ag, linear
    between its samples, and the bilinear restoring force f over the mass with the initial stiffness
    omega^2. The integration is exact up to rounding. The hardening ratio is in [0, 1); the yield
    displacement is infinite for an elastic oscillator.
    """
    steps, series, state = local(16), local(_MAX_TERMS), local(STATE_ROWS)
    state[:] = 0.0
    # Divide sampling intervals so that omega h <= 1, as the Taylor series require.
    parts = max(1, math.ceil(omega * dt))
    h = dt / parts
    k, c = omega * omega, 2.0 * xi * omega
    # `steps` receives 8 coefficients of the elastic branch, then 8 of the yielding branch.
    _coefficients(steps, 0, series, k, c, h)
    _coefficients(steps, 8, series, hardening * k, c, h)
    # The yield force over the mass is k times the yield displacement. `strength` is this value
    # minus hardening k times the yield displacement: the force of the yielding branch at u = 0.
    strength = (1.0 - hardening) * k * yield_displacement
    state[UPPER], state[LOWER] = yield_displacement, -yield_displacement
    oscillator = _Hysteretic(k, c, hardening, strength)
    events = _integrate_motion(ground, parts, h, oscillator, steps, series, state)
    state_at_end = local(STATE_ROWS)
    for row in range(STATE_ROWS):
        state_at_end[row] = state[row]
    # The residual displacement is the one after a ground motion that ends at its last sample. If
    # the displacement still grows, it belongs to the same motion as the peak.
    residual = _vibrate_freely(state, series, oscillator) if events > 0 else 0.0
    peak = state_at_end[PEAK]
    later_residual = _continue_after_motion(state_at_end, series, oscillator, ground[-1], dt, parts)
    results[LARGEST] = state_at_end[PEAK]
    results[RESIDUAL] = later_residual if state_at_end[PEAK] > peak else residual
    return events
