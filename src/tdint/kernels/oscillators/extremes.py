"""Extremes of linear oscillators with their times and signs: what a motion is matched to a spectrum
by."""

from __future__ import annotations

import math

from tdint.kernels.compiling import F8, I8, TABLE, VECTOR, kernel
from tdint.kernels.oscillators.between import A11, A12, A21, A22, B10, B11, B20, B21
from tdint.kernels.oscillators.elastic import BY_DISPLACEMENT, BY_VELOCITY

# Rows of the table of extremes
WHO, WHEN, VALUE = 0, 1, 2  # oscillator, time (s), pseudo-acceleration with its sign (m/s^2)
_ITERATIONS = 4  # of Newton on a cubic, from where a straight line has its zero: to all digits


@kernel(I8(VECTOR, F8, VECTOR, TABLE, VECTOR, TABLE, TABLE), parts=())
def extremes(samples, dt, parts, oscillators, level, found, largest):
    """March oscillators from rest over a ground motion, linear between its samples.

    Parameters
    ----------
    parts : shape (k,), steps in a sampling interval of each oscillator
    oscillators : shape (COEFFICIENTS, k), as of `elastic.peaks`
    level : shape (k,), pseudo-acceleration above which an extreme is kept, m/s^2
    found : shape (3, room), filled with the extremes kept, rows WHO, WHEN, VALUE
    largest : shape (2, k): the largest of each oscillator, and its place in `found`, -1 if it is
    not there

    Returns how many there are.
    """
    count = 0
    for i in range(level.size):
        steps = int(parts[i])
        h = dt / steps
        stiffness, viscous = oscillators[BY_DISPLACEMENT, i], oscillators[BY_VELOCITY, i]
        a11, a12, a21, a22 = (
            oscillators[A11, i],
            oscillators[A12, i],
            oscillators[A21, i],
            oscillators[A22, i],
        )
        b10, b11, b20, b21 = (
            oscillators[B10, i],
            oscillators[B11, i],
            oscillators[B20, i],
            oscillators[B21, i],
        )
        u, v, least = 0.0, 0.0, 0.0
        largest[0, i], largest[1, i] = 0.0, -1.0
        for sample in range(samples.size - 1):
            g0, rise = samples[sample], (samples[sample + 1] - samples[sample]) / steps
            for part in range(steps):
                g1 = g0 + rise
                u1 = (a11 * u + a12 * v) - (b10 * g0 + b11 * g1)
                v1 = (a21 * u + a22 * v) - (b20 * g0 + b21 * g1)
                # Within the step it moves no farther from the nearer end than by the larger rate.
                if (
                    v * v1 < 0.0
                    and stiffness * (max(abs(u), abs(u1)) + h * max(abs(v), abs(v1))) > least
                ):
                    # The rate is a cubic between both ends, by their accelerations; the
                    # displacement a quintic.
                    a0, a1 = (
                        h * (-viscous * v - stiffness * u - g0),
                        h * (-viscous * v1 - stiffness * u1 - g1),
                    )
                    square, cube = 3.0 * (v1 - v) - 2.0 * a0 - a1, 2.0 * (v - v1) + a0 + a1
                    x = v / (v - v1)
                    for _ in range(_ITERATIONS):
                        slope = a0 + x * (2.0 * square + 3.0 * x * cube)
                        if slope != 0.0:
                            x = min(
                                max(x - (v + x * (a0 + x * (square + x * cube))) / slope, 0.0), 1.0
                            )
                    way, c0, c1, b0, b1 = u1 - u, h * v, h * v1, h * a0, h * a1
                    c3 = 10.0 * way - 6.0 * c0 - 4.0 * c1 - 1.5 * b0 + 0.5 * b1
                    c4 = -15.0 * way + 8.0 * c0 + 7.0 * c1 + 1.5 * b0 - b1
                    c5 = 6.0 * way - 3.0 * c0 - 3.0 * c1 - 0.5 * b0 + 0.5 * b1
                    value = stiffness * (
                        u + x * (c0 + x * (0.5 * b0 + x * (c3 + x * (c4 + x * c5))))
                    )
                    kept = abs(value) > level[i] and count < found.shape[1]
                    if abs(value) > largest[0, i]:
                        largest[0, i], largest[1, i] = abs(value), count if kept else -1.0
                        least = min(level[i], abs(value))
                    if kept:
                        found[WHO, count] = i
                        found[WHEN, count] = (sample + (part + x) / steps) * dt
                        found[VALUE, count] = value
                        count += 1
                u, v, g0 = u1, v1, g1
    return count


@kernel(I8(TABLE, F8, VECTOR, TABLE, VECTOR, TABLE, TABLE), parts=())
def radii(samples, dt, parts, oscillators, level, found, largest):
    """March oscillators of two components from rest: the largest distances of their paths from the
    origin.

    Parameters
    ----------
    samples : shape (2, n), of both components
    found : shape (4, room), rows WHO, WHEN, VALUE and VALUE + 1, pseudo-accelerations of both
    components parts, oscillators, level, largest
        As of `extremes`, for the square root of the sum of the components' squares.

    Returns how many there are.
    """
    count = 0
    for i in range(level.size):
        # Distances have twice the frequency of the components; cubics between the ends of steps of
        # half the size are off by 1e-5.
        steps = int(parts[i])
        h = dt / steps
        stiffness = oscillators[BY_DISPLACEMENT, i]
        a11, a12, a21, a22 = (
            oscillators[A11, i],
            oscillators[A12, i],
            oscillators[A21, i],
            oscillators[A22, i],
        )
        b10, b11, b20, b21 = (
            oscillators[B10, i],
            oscillators[B11, i],
            oscillators[B20, i],
            oscillators[B21, i],
        )
        u, v, p, q = 0.0, 0.0, 0.0, 0.0
        largest[0, i], largest[1, i] = 0.0, -1.0
        for sample in range(samples.shape[1] - 1):
            f0, f_rise = samples[0, sample], (samples[0, sample + 1] - samples[0, sample]) / steps
            g0, g_rise = samples[1, sample], (samples[1, sample + 1] - samples[1, sample]) / steps
            for part in range(steps):
                f1, g1 = f0 + f_rise, g0 + g_rise
                u1 = (a11 * u + a12 * v) - (b10 * f0 + b11 * f1)
                v1 = (a21 * u + a22 * v) - (b20 * f0 + b21 * f1)
                p1 = (a11 * p + a12 * q) - (b10 * g0 + b11 * g1)
                q1 = (a21 * p + a22 * q) - (b20 * g0 + b21 * g1)
                outward, outward1 = u * v + p * q, u1 * v1 + p1 * q1
                if outward > 0.0 and outward1 <= 0.0:
                    x = outward / (outward - outward1)
                    rest = 1.0 - x
                    c0, c1, r0, r1 = (
                        rest * rest * (1.0 + 2.0 * x),
                        x * x * (3.0 - 2.0 * x),
                        h * x * rest * rest,
                        -h * x * x * rest,
                    )
                    first = stiffness * (c0 * u + c1 * u1 + r0 * v + r1 * v1)
                    second = stiffness * (c0 * p + c1 * p1 + r0 * q + r1 * q1)
                    value = math.sqrt(first * first + second * second)
                    kept = value > level[i] and count < found.shape[1]
                    if value > largest[0, i]:
                        largest[0, i], largest[1, i] = value, count if kept else -1.0
                    if kept:
                        found[WHO, count] = i
                        found[WHEN, count] = (sample + (part + x) / steps) * dt
                        found[VALUE, count], found[VALUE + 1, count] = first, second
                        count += 1
                u, v, p, q, f0, g0 = u1, v1, p1, q1, f1, g1
    return count
