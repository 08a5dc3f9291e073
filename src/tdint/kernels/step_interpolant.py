"""Interpolant of the response of a floor or story within a time step or substep.

Interpolant
-----------
With s = (t - t0) / h in [0, 1], the displacement u(s) of a floor is approximated by the quintic
with displacement, velocity and acceleration (u0, v0, a0) at s = 0 and (u1, v1, a1) at s = 1. A
story drift is the difference of two such quintics. The acceleration of the quintic is

    a(s) = a0 + (a1 - a0) s + s (1 - s) (B + D (1 - 2 s))
    B = 6 (v1 - v0) / h - 3 (a0 + a1)                                     bulge
    D = 60 ((u1 - u0) / h - (v0 + v1) / 2) / h + 5 (a1 - a0)              tilt

B and D are the symmetric and antisymmetric deviations from the straight line between a0 and a1.
For a harmonic response of circular frequency omega, the maximum error of a(s) is
(omega h)^4 / 1920 of the acceleration amplitude.

Accelerations
-------------
The tilt depends on displacements, divided by h^2. A displacement error d of the time-integration
method in one step changes a(s) by up to 5.8 d / h^2. For second-order methods this change is of the
size of a1 - a0, so the tilt is not reliable. The weight w of B and D therefore depends on |D / B|:

    |D| <= |B|              w = 1: a(s) remains on one side of the straight line
    |B| < |D| < 2 |B|       w = 2 - |D / B|, so that peaks change continuously
    |D| >= 2 |B|            the interior is not searched: the maximum is the larger endpoint value
"""

from __future__ import annotations

import math

from tdint.kernels.compiling import inline

# Dimensionless. Maximum deviation of the interior Bezier points of the acceleration from the
# straight line between the endpoints, divided by the sum of the absolute endpoint values.
_MAX_ACCELERATION_DEVIATION = 1.0

# Dimensionless. Ratio |tilt / bulge| above which both are ignored. They are fully used up to a
# ratio of 1; the linear transition in between avoids jumps of peaks.
_MAX_TILT_RATIO = 2.0


@inline
def bulge_and_tilt(h, ends):
    """Return bulge B and tilt D of the acceleration of the quintic interpolant."""
    by_h = 1.0 / h
    return acceleration_bulge(by_h, ends), acceleration_tilt(by_h, ends)


@inline
def tilt_weight(bulge, tilt):
    """Return the weight w of bulge and tilt, from 0 to 1."""
    if abs(tilt) >= _MAX_TILT_RATIO * abs(bulge):
        return 0.0
    return min((_MAX_TILT_RATIO - abs(tilt / bulge)) / (_MAX_TILT_RATIO - 1.0), 1.0)


@inline
def acceleration_bulge(by_h, ends):
    """Return the bulge B of the acceleration within a step; displacements are not used.

    With this B, the mean of the acceleration is (v1 - v0) / h for any tilt. `by_h` is 1 / h.
    """
    return 6.0 * by_h * (ends.v1 - ends.v0) - 3.0 * (ends.a0 + ends.a1)


@inline
def acceleration_tilt(by_h, ends):
    """Return the tilt D of the acceleration within a step. `by_h` is 1 / h."""
    u0, v0, a0, u1, v1, a1, _, _ = ends
    return 60.0 * by_h * (by_h * (u1 - u0) - 0.5 * (v0 + v1)) + 5.0 * (a1 - a0)


@inline
def max_interior_bezier_point(absolute_0, absolute_1, bulge, tilt):
    """Return the larger absolute value of the two interior Bezier points of an acceleration."""
    point_1_times_3 = abs(2.0 * absolute_0 + absolute_1 + bulge + tilt)
    point_2_times_3 = abs(absolute_0 + 2.0 * absolute_1 + bulge - tilt)
    return max(point_1_times_3, point_2_times_3) / 3.0


@inline
def is_near_line(bulge, tilt, scale):
    """Return True if an acceleration is close to the straight line between its endpoint values.

    Its interior Bezier points deviate from the line by at most (|B| + |D|) / 3. `scale` is the sum
    of the absolute endpoint values.
    """
    return abs(bulge) + abs(tilt) <= 3.0 * _MAX_ACCELERATION_DEVIATION * scale


@inline
def resolves_motion(span, ends):
    """Return True if velocities and accelerations of two successive steps are nearly linear.

    The result is always True without unresolved modes (`span.fast` is False).
    """
    v_difference = abs(ends.v1 - 2.0 * ends.v0 + ends.v_earlier)
    a_difference = abs(ends.a1 - 2.0 * ends.a0 + ends.a_earlier)
    velocities = v_difference <= abs(ends.v0) + abs(ends.v1)
    accelerations = a_difference <= abs(ends.a0) + abs(ends.a1)
    return not span.fast or (velocities and accelerations)


@inline
def quintic_coefficients(h, ends):
    """Return the coefficients c3, c4, c5 of the quintic u0 + h v0 s + h^2 a0 s^2 / 2 + c3 s^3 + c4
    s^4 + c5 s^5, m.
    """
    u0, v0, a0, u1, v1, a1, _, _ = ends
    # Value, slope and half of the curvature at s = 1 of the terms from s^3 on, m
    value = u1 - u0 - h * (v0 + 0.5 * h * a0)
    slope = h * (v1 - v0 - h * a0)
    half_curvature = 0.5 * h * h * (a1 - a0)
    c3 = 10.0 * value - 4.0 * slope + half_curvature
    c4 = -15.0 * value + 7.0 * slope - 2.0 * half_curvature
    c5 = 6.0 * value - 3.0 * slope + half_curvature
    return c3, c4, c5


@inline
def quintic_motion(h, ends, s):
    """Return displacement (m) and velocity (m/s) of the quintic at `s`."""
    c3, c4, c5 = quintic_coefficients(h, ends)
    c2 = 0.5 * h * h * ends.a0
    u = ends.u0 + s * (h * ends.v0 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    rate = 2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5))
    return u, ends.v0 + s * rate / h


@inline
def quintic_extremum(s, coefficients):
    """Return the maximum or minimum of the polynomial p0 + p1 s + ... + p5 s^5 for s in [0, 1].

    The sign of p1, which must not be zero, determines the type of the extremum: a maximum if the
    polynomial increases at s = 0. Newton's method is repeated from the best of seven points if this
    point is more extreme than the extremum near the estimate `s`. The result is a value of the
    polynomial within the step, so it never exceeds the true maximum.
    """
    extremum = _nearest_extremum(s, coefficients)
    s, best = _best_of_samples(coefficients)
    if (best - extremum) * coefficients[1] > 0.0:
        extremum = _nearest_extremum(s, coefficients)
        extremum = best if (best - extremum) * coefficients[1] > 0.0 else extremum
    return extremum


@inline
def _nearest_extremum(s, coefficients):
    """Return the value of a quintic polynomial at the extremum near `s`, by three Newton
    iterations.

    The convergence is not tested: the result is a value of the polynomial in any case, and the
    caller compares it with other values.
    """
    _, p1, p2, p3, p4, p5 = coefficients
    for _ in range(3):
        slope = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
        curvature = 2.0 * p2 + s * (6.0 * p3 + s * (12.0 * p4 + s * 20.0 * p5))
        # Where the curvature has the sign of p1, Newton's method would approach the opposite
        # extremum: keep s.
        s -= slope / curvature if curvature * p1 < 0.0 else 0.0
        s = min(max(s, 0.0), 1.0)
    return _value(s, coefficients)


@inline
def _best_of_samples(coefficients):
    """Return the location of the best of the points 1/8, 2/8, ..., 7/8 of a quintic polynomial, and
    its value there.
    """
    s, best = 0.125, _value(0.125, coefficients)
    # p1 > 0: the largest value is the best; p1 < 0: the smallest.
    for k in range(2, 8):
        value = _value(0.125 * k, coefficients)
        if (value - best) * coefficients[1] > 0.0:
            s, best = 0.125 * k, value
    return s, best


@inline
def _value(s, coefficients):
    """Return the value p0 + p1 s + ... + p5 s^5 of a polynomial at `s`; `coefficients` are p0 to
    p5.
    """
    p0, p1, p2, p3, p4, p5 = coefficients
    return p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))


@inline
def cubic_extremum(p0, p1, p2, p3):
    """Return the value with the largest absolute value, p0 or an interior extremum of a cubic, and
    its location s.

    The cubic is p(s) = p0 + p1 s + p2 s^2 + p3 s^3 with 0 < s < 1. Its value at s = 1 is not
    considered, because the caller records the end of the step.
    """
    largest, location = p0, 0.0
    # The extrema are at the zeros of p'(s) = p1 + 2 p2 s + 3 p3 s^2. The first zero is
    # numerator / (3 p3), with the sign of the square root for which `numerator` has no
    # cancellation. The product of both zeros is p1 / (3 p3), so the second zero is p1 / numerator.
    # For p3 = 0, p' is linear, and the second zero is its only zero.
    discriminant = p2 * p2 - 3.0 * p1 * p3
    if discriminant >= 0.0:
        numerator = -(p2 + math.copysign(math.sqrt(discriminant), p2))
        s = numerator / (3.0 * p3) if p3 != 0.0 else 0.0
        if 0.0 < s < 1.0:
            value = p0 + s * (p1 + s * (p2 + s * p3))
            location = s if abs(value) > abs(largest) else location
            largest = value if abs(value) > abs(largest) else largest
        s = p1 / numerator if numerator != 0.0 else 0.0
        if 0.0 < s < 1.0:
            value = p0 + s * (p1 + s * (p2 + s * p3))
            location = s if abs(value) > abs(largest) else location
            largest = value if abs(value) > abs(largest) else largest
    return largest, location
