"""Bilinear oscillators under a ground motion that is linear between its samples, without error of
time integration.

u'' + c u' + f = -ag, where f is linear in u on each branch: k u + offset (elastic) or hardening k u
+ offset (yielding). On a branch the response is known in closed form; here it is a recursion over
steps, and inside a step its Taylor series, which is summed until nothing is left to add (the steps
are short: omega h <= 1). The branch changes where u reaches the yield surface, or where u' turns
its sign while yielding; these instants are bracketed and found on the series itself.

No event can be missed: on a branch u'' is a decaying sine (or two exponentials, or one and a
constant) and has at most one zero within a step, so between the zeros of u'' the velocity is
monotone, and between those of u' the displacement.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels.compiling import F8, I8, VECTOR, inline, kernel, local, outlined
from tdint.kernels.oscillators.between import narrowed

# Rows of the state of an oscillator
U = 0
V = 1
SIDE = 2  # 0 elastic, 1 or -1 yielding
OFFSET = 3  # the force is the branch's stiffness times u, plus this
UPPER = 4  # ends of the elastic branch
LOWER = 5
PEAK = 6  # largest |u| so far
STATE_ROWS = 7

# Results
LARGEST = 0  # largest |u|, m
RESIDUAL = 1  # u after all motion has died away, m
RESULTS = 2

NO_END = -1
"""Code: more changes of branch in a step than can be."""

NEVER = -1.0  # a time; none is negative

_ORDER = 44  # terms at most: what is left is below 1e-18 before, for any step
_EVENTS = 60  # within a step
_FREE_STEPS = 600  # radians of free vibration after the motion


class _Hysteretic(NamedTuple):
    """Elastic stiffness and damping over the mass, and what yields."""

    k: float
    c: float
    hardening: float
    strength: float  # of the elastic-plastic part, (1 - hardening) times the yield force


@outlined
def _taylor(series, u, v, load, slope, k, c, t):
    """Coefficients of the solution of u'' + c u' + k u = load + slope t, as many as count up to the
    time t; their number."""
    series[0], series[1] = u, v
    series[2] = 0.5 * (load - c * v - k * u)
    series[3] = (slope - 2.0 * c * series[2] - k * v) / 6.0
    power = t * t * t
    largest = max(abs(u), abs(v) * t, abs(series[2]) * t * t, abs(series[3]) * power)
    small = 0
    for j in range(4, _ORDER):
        series[j] = -(c * (j - 1) * series[j - 1] + k * series[j - 2]) / (j * (j - 1))
        power *= t
        small = small + 1 if abs(series[j]) * power <= 1e-18 * largest else 0
        if small == 2:
            return j + 1
    return _ORDER


@inline
def _displacement(series, terms, t):
    value = 0.0
    for j in range(terms - 1, -1, -1):
        value = value * t + series[j]
    return value


@inline
def _velocity(series, terms, t):
    value = 0.0
    for j in range(terms - 1, 0, -1):
        value = value * t + j * series[j]
    return value


@inline
def _acceleration(series, terms, t):
    value = 0.0
    for j in range(terms - 1, 1, -1):
        value = value * t + j * (j - 1) * series[j]
    return value


@outlined
def _derivative(series, terms, order, t):
    if order == 0:
        return _displacement(series, terms, t)
    if order == 1:
        return _velocity(series, terms, t)
    return _acceleration(series, terms, t)


@outlined
def _root(series, terms, order, level, left, right):
    """Where the derivative `order` of the series passes `level` between two times that bracket it.

    False position with halved weights (Illinois), bisection every fourth time.
    """
    at_left = _derivative(series, terms, order, left) - level
    at_right = _derivative(series, terms, order, right) - level
    if at_left == 0.0 or (at_left > 0.0) == (at_right > 0.0):
        return left
    side = 0
    for i in range(100):
        t = (left * at_right - right * at_left) / (at_right - at_left)
        if not left < t < right or i % 4 == 3:
            t = 0.5 * (left + right)
        value = _derivative(series, terms, order, t) - level
        if value == 0.0 or not left < t < right:
            return t
        left, at_left, right, at_right, side, moved = narrowed(
            left, at_left, right, at_right, side, t, value
        )
        if right - left <= 4e-16 * right or (moved <= 4e-16 * right and i % 4 != 3):
            break
    return left if side < 0 else right


@outlined
def _turn(series, terms, start, end):
    """When the velocity, monotone between two times, changes its sign; `end` if it does not."""
    if _velocity(series, terms, start) * _velocity(series, terms, end) < 0.0:
        return _root(series, terms, 1, 0.0, start, end)
    return end


@outlined
def _yielding_until(series, terms, side, middle, rest):
    """When the velocity turns against the yielding; NEVER if it does not before `rest`."""
    start = 0.0
    for end in (middle, rest):
        if side * _velocity(series, terms, end) < 0.0:
            return (
                start
                if side * _velocity(series, terms, start) <= 0.0
                else _turn(series, terms, start, end)
            )
        start = end
    return NEVER


@outlined
def _elastic_until(series, terms, state, middle, rest):
    """When u passes an end of the elastic branch; NEVER if it does not before `rest`. Takes up the
    peaks before."""
    left = 0.0
    # Between these times u is monotone.
    for stop in (
        _turn(series, terms, 0.0, middle),
        middle,
        _turn(series, terms, middle, rest),
        rest,
    ):
        u = _displacement(series, terms, stop)
        if u > state[UPPER] or u < state[LOWER]:
            return _root(
                series, terms, 0, state[UPPER] if u > state[UPPER] else state[LOWER], left, stop
            )
        state[PEAK] = max(state[PEAK], abs(u))
        left = stop
    return NEVER


@outlined
def _unload(state, oscillator):
    """Elastic again, from where the yielding ended back by twice the yield displacement."""
    k, _, hardening, strength = oscillator
    u, side = state[U], state[SIDE]
    back = u - side * 2.0 * strength / ((1.0 - hardening) * k)
    state[SIDE] = 0.0
    state[V] = 0.0
    state[OFFSET] = side * strength - (1.0 - hardening) * k * u
    state[UPPER], state[LOWER] = max(u, back), min(u, back)


@outlined
def _yield(state, strength):
    """Yielding from that end of the elastic branch which was reached."""
    side = 1.0 if 2.0 * state[U] > state[UPPER] + state[LOWER] else -1.0
    state[SIDE] = side
    state[U] = state[UPPER] if side > 0.0 else state[LOWER]
    state[V] = side * max(side * state[V], 0.0)
    state[OFFSET] = side * strength


@outlined
def _within(state, series, oscillator, g, slope, h):
    """A step of length h, through all branches, under the ground acceleration g + slope t; number
    of events, or a negative code."""
    k, c, hardening, strength = oscillator
    t = 0.0
    for events in range(_EVENTS):
        side = state[SIDE]
        rest = h - t
        load = -(g + slope * t) - state[OFFSET]
        terms = _taylor(
            series, state[U], state[V], load, -slope, k if side == 0.0 else hardening * k, c, rest
        )
        # The velocity is monotone from 0 to `middle`, and from there to `rest`.
        middle = rest
        if series[2] * _acceleration(series, terms, rest) < 0.0:
            middle = _root(series, terms, 2, 0.0, 0.0, rest)
        if side == 0.0:
            event = _elastic_until(series, terms, state, middle, rest)
        else:
            event = _yielding_until(series, terms, side, middle, rest)
        end = rest if event == NEVER else event
        state[U] = _displacement(series, terms, end)
        state[V] = _velocity(series, terms, end)
        if event != NEVER and side == 0.0:
            _yield(state, strength)
        state[PEAK] = max(state[PEAK], abs(state[U]))
        if event == NEVER:
            return events
        if side != 0.0:
            _unload(state, oscillator)
        t += event
    return NO_END


@outlined
def _coefficients(steps, first, series, k, c, h):
    """The step of a branch as a matrix: u1, v1 from u0, v0 and minus the loads at both ends."""
    for column in range(4):
        u = 1.0 if column == 0 else 0.0
        v = 1.0 if column == 1 else 0.0
        load = -1.0 if column == 2 else 0.0
        slope = 1.0 / h if column == 2 else (-1.0 / h if column == 3 else 0.0)
        terms = _taylor(series, u, v, load, slope, k, c, h)
        steps[first + column] = _displacement(series, terms, h)
        steps[first + 4 + column] = _velocity(series, terms, h)


@outlined
def _respond(ground, parts, h, oscillator, steps, series, state):
    """From rest over the whole motion; the number of events, or a negative code. The state's limits
    are set."""
    k, c, hardening, _ = oscillator
    e00, e01, e02, e03 = steps[0], steps[1], steps[2], steps[3]
    e10, e11, e12, e13 = steps[4], steps[5], steps[6], steps[7]
    y00, y01, y02, y03 = steps[8], steps[9], steps[10], steps[11]
    y10, y11, y12, y13 = steps[12], steps[13], steps[14], steps[15]
    # Within a step u leaves its chord by h^2/8 max |u''| at most, and |u''|, a decaying sine over
    # at most a radian, exceeds the larger of its ends by 1.14 e^(c h / 2) at most.
    reach = 0.25 * h * h * math.exp(0.5 * c * h)
    soft = hardening * k
    part = 1.0 / parts
    events = 0
    u, v, side, offset, upper, lower, peak = 0.0, 0.0, 0.0, 0.0, state[UPPER], state[LOWER], 0.0
    a = ground[0]  # with its sign turned, as all loads here
    for i in range(1, ground.size):
        g0 = ground[i - 1]
        rise = (ground[i] - g0) * part
        for _ in range(parts):
            p0 = g0 + offset
            p1 = p0 + rise
            if side == 0.0:
                u1 = (e02 * p0 + e03 * p1) + e00 * u + e01 * v
                v1 = (e12 * p0 + e13 * p1) + e10 * u + e11 * v
                a1 = p1 + c * v1 + k * u1
                bend = reach * max(abs(a), abs(a1))
                top = max(u, u1) + bend
                bottom = min(u, u1) - bend
                simple = (top < upper and bottom > lower) and (
                    max(top, -bottom) <= peak or (v * v1 > 0.0 and a * a1 > 0.0)
                )
            else:
                u1 = (y02 * p0 + y03 * p1) + y00 * u + y01 * v
                v1 = (y12 * p0 + y13 * p1) + y10 * u + y11 * v
                a1 = p1 + c * v1 + soft * u1
                simple = v * v1 > 0.0 and a * a1 > 0.0
            if simple:
                u, v, a = u1, v1, a1
                peak = max(peak, abs(u))
                g0 += rise
                continue
            state[U], state[V], state[SIDE], state[OFFSET] = u, v, side, offset
            state[UPPER], state[LOWER], state[PEAK] = upper, lower, peak
            count = _within(state, series, oscillator, g0, rise / h, h)
            if count < 0:
                return count
            events += count
            u, v, side, offset = state[U], state[V], state[SIDE], state[OFFSET]
            upper, lower, peak = state[UPPER], state[LOWER], state[PEAK]
            g0 += rise
            a = g0 + offset + c * v + (k if side == 0.0 else soft) * u
    state[U], state[V], state[SIDE], state[OFFSET] = u, v, side, offset
    state[UPPER], state[LOWER], state[PEAK] = upper, lower, peak
    return events


@outlined
def _come_to_rest(state, series, oscillator):
    """Displacement after the free vibration that follows; where it vibrates for ever, its
    center."""
    k = oscillator.k
    h = 1.0 / math.sqrt(k)
    for _ in range(_FREE_STEPS):
        if state[SIDE] == 0.0:
            center = -state[OFFSET] / k
            swing = math.sqrt((state[U] - center) ** 2 + state[V] ** 2 / k)
            slack = 1e-9 * (state[UPPER] - state[LOWER])
            if center + swing <= state[UPPER] + slack and center - swing >= state[LOWER] - slack:
                return center
        if _within(state, series, oscillator, 0.0, 0.0, h) < 0:
            return math.nan
    return -state[OFFSET] / k if state[SIDE] == 0.0 else state[U]


@kernel(I8(VECTOR, F8, F8, F8, F8, F8, VECTOR), parts=(), vectorized=True)
def bilinear_response(ground, dt, omega, xi, hardening, yield_displacement, results):
    """Response of one bilinear oscillator from rest to a ground motion.

    Parameters
    ----------
    ground : shape (samples,)
        Ground acceleration, m/s^2.
    dt : float
        Sampling interval, s.
    omega, xi, hardening : float
        Circular frequency (rad/s) and damping ratio of the elastic branch; hardening ratio in [0,
        1).
    yield_displacement : float
        Displacement at first yield, m, positive; infinite for an oscillator that stays elastic.
    results : shape (RESULTS,)
        Written.

    Returns
    -------
    int
        The number of changes of branch, or NO_END.
    """
    steps, series, state = local(16), local(_ORDER), local(STATE_ROWS)
    state[:] = 0.0
    parts = max(1, math.ceil(omega * dt))
    h = dt / parts
    k, c = omega * omega, 2.0 * xi * omega
    _coefficients(steps, 0, series, k, c, h)
    _coefficients(steps, 8, series, hardening * k, c, h)
    strength = 0.0
    if yield_displacement < math.inf:
        strength = (1.0 - hardening) * k * yield_displacement
    state[UPPER], state[LOWER] = yield_displacement, -yield_displacement
    oscillator = _Hysteretic(k, c, hardening, strength)
    events = _respond(ground, parts, h, oscillator, steps, series, state)
    results[LARGEST] = state[PEAK]
    results[RESIDUAL] = _come_to_rest(state, series, oscillator) if events > 0 else 0.0
    return events
