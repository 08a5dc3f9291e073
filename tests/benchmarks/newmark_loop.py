"""A plain compiled time loop for bilinear stories, the baseline of benchmarks of time loops."""

import numba
import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.model.building import Building


@numba.njit(error_model="numpy")
def plain_loop(m, k, strength, hardening, floor, damper, ground, h, peak):
    """Average acceleration with Newton's method, tridiagonal elimination, and peak drifts."""
    n = m.size
    u, v, a, z, d = np.zeros(n), np.zeros(n), np.full(n, -ground[0]), np.zeros(n), np.zeros(n)
    u1, v1, a1, z1, d1 = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    force, residual, diagonal, coupling = np.zeros(n + 1), np.zeros(n), np.zeros(n), np.zeros(n + 1)
    for s in range(1, ground.size):
        for i in range(n):
            u1[i] = u[i] + h * v[i]
        for _ in range(40):
            for i in range(n):
                a1[i] = 4.0 / h**2 * (u1[i] - u[i] - h * v[i]) - a[i]
                v1[i] = v[i] + 0.5 * h * (a[i] + a1[i])
            below_u = below_v = 0.0
            for i in range(n):
                d1[i] = u1[i] - below_u
                z1[i] = z[i] + (1.0 - hardening[i]) * k[i] * (d1[i] - d[i])
                tangent = k[i]
                if abs(z1[i]) > strength[i]:
                    z1[i] = strength[i] if z1[i] > 0.0 else -strength[i]
                    tangent = hardening[i] * k[i]
                force[i] = hardening[i] * k[i] * d1[i] + z1[i] + damper[i] * (v1[i] - below_v)
                spring = tangent + 2.0 / h * damper[i]
                diagonal[i] = m[i] * 4.0 / h**2 + 2.0 / h * floor[i] + spring
                coupling[i] = -spring
                below_u, below_v = u1[i], v1[i]
            for i in range(n):
                residual[i] = (
                    -m[i] * (ground[s] + a1[i]) - floor[i] * v1[i] - force[i] + force[i + 1]
                )
                if i < n - 1:
                    diagonal[i] -= coupling[i + 1]
            for i in range(1, n):
                w = coupling[i] / diagonal[i - 1]
                diagonal[i] -= w * coupling[i]
                residual[i] -= w * residual[i - 1]
            largest = correction = 0.0
            for i in range(n - 1, -1, -1):
                correction = (residual[i] - coupling[i + 1] * correction) / diagonal[i]
                u1[i] += correction
                largest = max(largest, abs(correction))
            if largest < 1e-10:
                break
        for i in range(n):
            new = 4.0 / h**2 * (u1[i] - u[i] - h * v[i]) - a[i]
            v[i] += 0.5 * h * (a[i] + new)
            a[i], u[i], z[i], d[i] = new, u1[i], z1[i], d1[i]
            peak[i] = max(peak[i], abs(d1[i]))


def loop_arguments(building: Building) -> tuple[Array, ...]:
    """Return the arguments of `plain_loop` that describe a building of bilinear stories."""
    n = building.stories
    hardening = building.law_parameters[rows.FIRST_PARAMETER + 1, :n].copy()
    return (
        building.mass.copy(),
        building.law_parameters[rows.STIFFNESS, :n].copy(),
        (1.0 - hardening) * building.law_parameters[rows.FIRST_PARAMETER, :n],
        hardening,
        building.linear_terms[rows.FLOOR_DAMPER, :n].copy(),
        building.linear_terms[rows.STORY_DAMPER, :n].copy(),
    )
