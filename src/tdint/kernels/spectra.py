"""Peak response of many linear oscillators to one ground motion: the exact recursion, many oscillators side by side."""

from __future__ import annotations

import numpy as np

from tdint.kernels.compiling import I8, TABLE, VECTOR, kernel

# Rows of the table of oscillators
A11 = 0  # u1 = A11 u0 + A12 v0 - B10 g0 - B11 g1
A12 = 1
B10 = 2
B11 = 3
A21 = 4  # v1 = A21 u0 + A22 v0 - B20 g0 - B21 g1
A22 = 5
B20 = 6
B21 = 7
BY_DISPLACEMENT = 8  # omega^2
BY_VELOCITY = 9  # 2 xi omega
COEFFICIENTS = 10

# Rows of the table of peaks
PEAK_DISPLACEMENT = 0
PEAK_VELOCITY = 1
PEAK_ACCELERATION = 2
PEAKS = 3


@kernel(I8(VECTOR, TABLE, TABLE, I8), allocates=True)
def sampled_peaks(ground, oscillators, peaks, lanes):
    """March oscillators from rest over the samples of `ground` (m/s^2); largest absolute values at the samples.

    The motion is linear between samples. Displacement and velocity are relative, the acceleration is absolute,
    2 xi omega v + omega^2 u. The tables have a multiple of `lanes` columns; a group of that many is marched together,
    in arrays of its own so that the compiler sees that they do not overlap. Returns 0.
    """
    a11, a12, b10, b11 = np.empty(lanes), np.empty(lanes), np.empty(lanes), np.empty(lanes)
    a21, a22, b20, b21 = np.empty(lanes), np.empty(lanes), np.empty(lanes), np.empty(lanes)
    by_u, by_v = np.empty(lanes), np.empty(lanes)
    u, v = np.empty(lanes), np.empty(lanes)
    sd, sv, sa = np.empty(lanes), np.empty(lanes), np.empty(lanes)
    for group in range(0, oscillators.shape[1], lanes):
        for i in range(lanes):
            a11[i], a12[i] = oscillators[A11, group + i], oscillators[A12, group + i]
            b10[i], b11[i] = oscillators[B10, group + i], oscillators[B11, group + i]
            a21[i], a22[i] = oscillators[A21, group + i], oscillators[A22, group + i]
            b20[i], b21[i] = oscillators[B20, group + i], oscillators[B21, group + i]
            by_u[i], by_v[i] = oscillators[BY_DISPLACEMENT, group + i], oscillators[BY_VELOCITY, group + i]
            u[i] = v[i] = sd[i] = sv[i] = sa[i] = 0.0
        before = ground[0]
        for s in range(1, ground.size):
            after = ground[s]
            for i in range(lanes):
                new_u = a11[i] * u[i] + a12[i] * v[i] - b10[i] * before - b11[i] * after
                new_v = a21[i] * u[i] + a22[i] * v[i] - b20[i] * before - b21[i] * after
                size_u = abs(new_u)
                size_v = abs(new_v)
                size_a = abs(by_u[i] * new_u + by_v[i] * new_v)
                u[i] = new_u
                v[i] = new_v
                sd[i] = size_u if size_u > sd[i] else sd[i]
                sv[i] = size_v if size_v > sv[i] else sv[i]
                sa[i] = size_a if size_a > sa[i] else sa[i]
            before = after
        for i in range(lanes):
            peaks[PEAK_DISPLACEMENT, group + i] = sd[i]
            peaks[PEAK_VELOCITY, group + i] = sv[i]
            peaks[PEAK_ACCELERATION, group + i] = sa[i]
    return 0
