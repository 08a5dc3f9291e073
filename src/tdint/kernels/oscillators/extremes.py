"""Extrema of linear oscillators with their times and signs, for spectral matching."""

from __future__ import annotations

import math

from tdint.kernels.compiling import F8, I8, TABLE, VECTOR, kernel
from tdint.kernels.oscillators.between_steps import A11, A12, A21, A22, B10, B11, B20, B21
from tdint.kernels.oscillators.elastic import BY_DISPLACEMENT, BY_VELOCITY

# Rows of the table `extrema`, which has one column for each extremum
OSCILLATOR = 0  # index of the oscillator
TIME = 1  # s
VALUE = 2  # signed pseudo-acceleration omega^2 u, m/s^2
# Number of Newton iterations for the zero of a cubic, starting from the zero of the secant. It is
# sufficient for full precision.
_ITERATIONS = 4


@kernel(I8(VECTOR, F8, VECTOR, TABLE, VECTOR, TABLE, TABLE), has_forms=False)
def extremes(samples, dt, parts, oscillators, level, extrema, largest):
    """Integrate oscillators from rest over a ground motion that is linear between its samples;
    return the number of stored extrema of their displacements.

    An extremum is the displacement at a change of the sign of the velocity within a step. The
    displacement at the end of the motion is not an extremum, even if it is the largest. A velocity
    that is exactly zero at a step, as for an oscillator at rest, does not count as a change of
    sign. An extremum is stored if its pseudo-acceleration omega^2 |u| exceeds the level of the
    oscillator and if the table has a free column. The largest extremum of each oscillator is
    recorded in any case.

    Parameters
    ----------
    parts : ndarray, shape (k,)
        Steps per sampling interval, for each oscillator. With the length h of a step, omega h must
        be at most 0.5, so that the velocity has at most one zero within a step.
    oscillators : ndarray, shape (COEFFICIENTS, k)
        Table of oscillators (`tdint.kernels.oscillators.elastic`).
    level : ndarray, shape (k,)
        Pseudo-acceleration above which an extremum is stored, m/s^2.
    extrema : ndarray, shape (3, capacity)
        Receives the extrema: rows OSCILLATOR (index), TIME (s) and VALUE (omega^2 u with its sign,
        m/s^2).
    largest : ndarray, shape (2, k)
        Receives, for each oscillator, omega^2 |u| of the largest extremum (m/s^2; 0 without an
        extremum) and its column in `extrema`, -1 if it is not stored.
    """
    count = 0
    for i in range(level.size):
        steps = int(parts[i])
        h = dt / steps
        stiffness, viscous = oscillators[BY_DISPLACEMENT, i], oscillators[BY_VELOCITY, i]
        a11, a12 = oscillators[A11, i], oscillators[A12, i]
        a21, a22 = oscillators[A21, i], oscillators[A22, i]
        b10, b11 = oscillators[B10, i], oscillators[B11, i]
        b20, b21 = oscillators[B20, i], oscillators[B21, i]
        u, v = 0.0, 0.0  # at the start of the step
        # Extrema with a smaller pseudo-acceleration are not stored and are not the largest until
        # now.
        threshold = 0.0
        largest[0, i], largest[1, i] = 0.0, -1.0
        for sample in range(samples.size - 1):
            # Ground acceleration at the start of a step, and its change in a step
            g0, increment = samples[sample], (samples[sample + 1] - samples[sample]) / steps
            for step in range(steps):
                g1 = g0 + increment
                u1 = (a11 * u + a12 * v) - (b10 * g0 + b11 * g1)
                v1 = (a21 * u + a22 * v) - (b20 * g0 + b21 * g1)
                # Within the step, the distance of the displacement from the nearer endpoint is at
                # most h times the larger rate.
                if (
                    v * v1 < 0.0
                    and stiffness * (max(abs(u), abs(u1)) + h * max(abs(v), abs(v1))) > threshold
                ):
                    # With x = time / h in [0, 1], the velocity is approximated by the cubic v + a0
                    # x + square x^2 + cube x^3 with the velocities and accelerations (times h) at
                    # both endpoints.
                    a0 = h * (-viscous * v - stiffness * u - g0)
                    a1 = h * (-viscous * v1 - stiffness * u1 - g1)
                    square = 3.0 * (v1 - v) - 2.0 * a0 - a1
                    cube = 2.0 * (v - v1) + a0 + a1
                    x = v / (v - v1)
                    for _ in range(_ITERATIONS):
                        slope = a0 + x * (2.0 * square + 3.0 * x * cube)
                        if slope != 0.0:
                            x = min(
                                max(x - (v + x * (a0 + x * (square + x * cube))) / slope, 0.0), 1.0
                            )
                    # The displacement is the quintic with the displacements, velocities (c0, c1)
                    # and accelerations (b0, b1) at both endpoints.
                    change, c0, c1, b0, b1 = u1 - u, h * v, h * v1, h * a0, h * a1
                    c3 = 10.0 * change - 6.0 * c0 - 4.0 * c1 - 1.5 * b0 + 0.5 * b1
                    c4 = -15.0 * change + 8.0 * c0 + 7.0 * c1 + 1.5 * b0 - b1
                    c5 = 6.0 * change - 3.0 * c0 - 3.0 * c1 - 0.5 * b0 + 0.5 * b1
                    value = stiffness * (
                        u + x * (c0 + x * (0.5 * b0 + x * (c3 + x * (c4 + x * c5))))
                    )
                    is_stored = abs(value) > level[i] and count < extrema.shape[1]
                    if abs(value) > largest[0, i]:
                        largest[0, i], largest[1, i] = abs(value), count if is_stored else -1.0
                        threshold = min(level[i], abs(value))
                    if is_stored:
                        extrema[OSCILLATOR, count] = i
                        extrema[TIME, count] = (sample + (step + x) / steps) * dt
                        extrema[VALUE, count] = value
                        count += 1
                u, v, g0 = u1, v1, g1
    return count


@kernel(I8(TABLE, F8, VECTOR, TABLE, VECTOR, TABLE, TABLE), has_forms=False)
def radii(samples, dt, parts, oscillators, level, extrema, largest):
    """Integrate oscillators under two horizontal components of a ground motion from rest; return
    the number of stored local maxima of the distance from the origin.

    The distance is the square root of the sum of the squared displacements along both components.
    It has a maximum where its rate changes from positive to negative. The arguments are the same as
    for `extremes`, with these differences:

    Parameters
    ----------
    parts : ndarray, shape (k,)
        Twice the number for `extremes`, because the distance has twice the frequency of the
        displacements. The cubics then have an error of 1e-5.
    extrema : ndarray, shape (4, capacity)
        Receives the maxima, rows OSCILLATOR, TIME, and VALUE and VALUE + 1 with the
        pseudo-accelerations of both components, m/s^2.
    """
    count = 0
    for i in range(level.size):
        steps = int(parts[i])
        h = dt / steps
        stiffness = oscillators[BY_DISPLACEMENT, i]
        a11, a12 = oscillators[A11, i], oscillators[A12, i]
        a21, a22 = oscillators[A21, i], oscillators[A22, i]
        b10, b11 = oscillators[B10, i], oscillators[B11, i]
        b20, b21 = oscillators[B20, i], oscillators[B21, i]
        # u, v along the first component and p, q along the second; ground accelerations f and g
        u, v, p, q = 0.0, 0.0, 0.0, 0.0
        largest[0, i], largest[1, i] = 0.0, -1.0
        for sample in range(samples.shape[1] - 1):
            f0, f_rise = samples[0, sample], (samples[0, sample + 1] - samples[0, sample]) / steps
            g0, g_rise = samples[1, sample], (samples[1, sample + 1] - samples[1, sample]) / steps
            for step in range(steps):
                f1, g1 = f0 + f_rise, g0 + g_rise
                u1 = (a11 * u + a12 * v) - (b10 * f0 + b11 * f1)
                v1 = (a21 * u + a22 * v) - (b20 * f0 + b21 * f1)
                p1 = (a11 * p + a12 * q) - (b10 * g0 + b11 * g1)
                q1 = (a21 * p + a22 * q) - (b20 * g0 + b21 * g1)
                # Half the rate of the squared distance
                outward, outward1 = u * v + p * q, u1 * v1 + p1 * q1
                if outward > 0.0 and outward1 <= 0.0:
                    # x is the zero of the rate by linear interpolation. The displacements there are
                    # cubics with the weights c0, c1 of the displacements and r0, r1 of the
                    # velocities at both endpoints.
                    x = outward / (outward - outward1)
                    remainder = 1.0 - x
                    c0 = remainder * remainder * (1.0 + 2.0 * x)
                    c1 = x * x * (3.0 - 2.0 * x)
                    r0 = h * x * remainder * remainder
                    r1 = -h * x * x * remainder
                    first = stiffness * (c0 * u + c1 * u1 + r0 * v + r1 * v1)
                    second = stiffness * (c0 * p + c1 * p1 + r0 * q + r1 * q1)
                    value = math.sqrt(first * first + second * second)
                    is_stored = value > level[i] and count < extrema.shape[1]
                    if value > largest[0, i]:
                        largest[0, i], largest[1, i] = value, count if is_stored else -1.0
                    if is_stored:
                        extrema[OSCILLATOR, count] = i
                        extrema[TIME, count] = (sample + (step + x) / steps) * dt
                        extrema[VALUE, count], extrema[VALUE + 1, count] = first, second
                        count += 1
                u, v, p, q, f0, g0 = u1, v1, p1, q1, f1, g1
    return count
