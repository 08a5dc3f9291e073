"""Bouc-Wen law (Bouc 1967, Wen 1976): smooth hysteresis that depends on the drift and not on its
rate.

    f = a k d + (1 - a) Fy w,   dw/dx = 1 - |w|^n (beta sgn(w dx) + 1 - beta),   x = k d / Fy

with A = 1 and beta + gamma = 1, so that |w| approaches 1. Ma, Zhang, Bockstette, Foliente and
Paevere (2004) show that the other parameters are redundant. The dissipation is not negative if beta
>= 1/2; with a smaller beta, unloading releases more energy than was stored. Row INTERNAL contains
w.

The equation is integrated along the drift in substeps of a fixed length that start at the committed
state; the last substep is shorter. The force is therefore a continuous function of the drift. A
substep also ends where w changes its sign, because |w|^n is not smooth at w = 0. For n < 2, the
time steps that locate kinks end at this point, and near this point the equation is integrated
exactly as a series in |w|^n.

With degradation (Baber and Wen 1981), pinching (Baber and Noori 1985; Foliente 1995) or asymmetry
(Wang and Wen 2000), and with the energy E of the hysteretic part, the integral of (1 - a) Fy w over
d (row WORK, J):

    dw/dx = h / eta (A - nu |w|^n (beta sgn(w dx) + 1 - beta + phi (sgn w + sgn dx)))
    A = 1 - dA E,   nu = 1 + dnu E,   eta = 1 + deta E
    h = 1 - z1 exp(-((w sgn dx - q nu^(-1/n)) / z2)^2)
    z1 = zs (1 - exp(-p E)),   z2 = (psi + dpsi E) (lambda + z1)

The strengths of both sides are (1 + 2 phi)^(-1/n) Fy and (1 - 2 phi)^(-1/n) Fy. If A reaches 0, the
story has failed.

In the functions below, q = 2 beta - 1, u = |w| while it decreases (unloading), and all drift
changes r, x and `path` are multiples of Fy / k.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import (
    DriftLaw,
    LawFunctions,
    LawParameter,
    hardening_stiffness,
    yields_at_its_strength,
)

# Rows of `law_parameters` with the parameters of the law: yield force (N), hardening ratio,
# exponent n and parameter beta.
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1
_EXPONENT = rows.FIRST_PARAMETER + 2
_BETA = rows.FIRST_PARAMETER + 3

# Degradation dA, dnu, deta (1/J); pinching zs, p (1/J), q, psi, dpsi (1/J), lambda; asymmetry phi
_AMPLITUDE = rows.FIRST_PARAMETER + 4
_STRENGTH_RATE = rows.FIRST_PARAMETER + 5
_STIFFNESS_RATE = rows.FIRST_PARAMETER + 6
_SLIP = rows.FIRST_PARAMETER + 7
_SLIP_RATE = rows.FIRST_PARAMETER + 8
_START = rows.FIRST_PARAMETER + 9
_SIZE = rows.FIRST_PARAMETER + 10
_GROWTH = rows.FIRST_PARAMETER + 11
_SEVERITY = rows.FIRST_PARAMETER + 12
_ASYMMETRY = rows.FIRST_PARAMETER + 13

_FAILED = 1e3
"""Value of row INTERNAL after A has reached 0; larger than any w."""
_NO_AMPLITUDE = 1e-6
"""A at which the story has failed: for small exponents it approaches 0, but does not reach it."""
_PINCHING_SUBSTEP = 0.1
"""Maximum length of a substep as a fraction of z2, the width of the pinching in w."""
_GRADING = 0.5
"""For exponents below _SMOOTH, maximum change of w in a substep as a fraction of |w|, because |w|^n
is not smooth at w = 0, with the following minimum."""
_MIN_GRADING = 1e-4
_MAX_UNLOADING = 1e3
"""Maximum drift change, in yield drifts, that is searched for the change of sign of w: degradation
and pinching can make unloading very soft."""
_PINCHING_DENSITY = 3.0
"""Additional Gauss points for a drift change of Fy / k times the smallest z2."""
_MAX_CROSSINGS = 8
"""Newton's method for the change of sign of w in a substep converges in three or four
iterations."""

_SUBSTEP = 0.125
"""Length of a substep times the exponent n, in yield drifts. The error of the classical Runge-Kutta
method is then about 1e-7 Fy on each monotonic path and accumulates: 1.3e-6 Fy after 60 paths with
exponent 1."""
_SATURATED = 1e-14
"""Difference between w and 1 below which w is set to 1, its limit. Of the order of the rounding
error."""
_SMOOTH = 2.0
"""Smallest exponent for a force that is smooth enough at a change of sign of w."""
_NEAR = 0.25
"""Maximum |w|^n for which the series is used. It then converges with 25 terms."""
_AT_SIGN_CHANGE = 1e-6
"""Multiple of the yield drift. If w changes its sign within this distance of the current drift, the
branch has no limit. Otherwise a step that ends at the change of sign, up to rounding, would
be followed by a branch of nearly zero length."""
_PANELS = 8
"""Parts of the interval of a quadrature for beta < 1/2. The relative error of the drift change up
to w = 0 is then below 1e-7 for beta = 0.05."""
_NODES = (0.18343464249564978, 0.525532409916329, 0.7966664774136267, 0.9602898564975362)
_WEIGHTS = (0.36268378337836166, 0.3137066458778869, 0.22238103445337443, 0.10122853629037706)
"""Nodes and weights of the Gauss-Legendre rule with eight points on [-1, 1]; only the positive
half."""


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    import numpy as np

    from tdint.kernels.compiling import inline, outlined

    nodes = 0.5 + 0.5 * np.array([*(-node for node in reversed(_NODES)), *_NODES])
    weights = 0.5 * np.array([*reversed(_WEIGHTS), *_WEIGHTS])

    @inline
    def power(x, n):
        """Return x^n for a number x that is not negative.

        The exponents 1 and 2 are common and do not require the function of the C library.
        """
        return x if n == 1.0 else (x * x if n == 2.0 else x**n)

    @inline
    def unloading(u, q, n, r):
        """Integrate du/dx = -(1 + q u^n) over the drift change `r` by a single classical
        Runge-Kutta step; return u at the end, and the dissipated energy, the integral of q u^(n +
        1), a multiple of (1 - a) Fy^2 / k.
        """
        p1 = q * power(u, n)
        u2 = u - 0.5 * r * (1.0 + p1)
        p2 = q * power(abs(u2), n)  # a stage can be slightly below zero
        u3 = u - 0.5 * r * (1.0 + p2)
        p3 = q * power(abs(u3), n)
        u4 = u - r * (1.0 + p3)
        p4 = q * power(abs(u4), n)
        loss = r / 6.0 * (p1 * u + 2.0 * (p2 * u2 + p3 * u3) + p4 * u4)
        return u - r - r / 6.0 * (p1 + 2.0 * (p2 + p3) + p4), loss

    @inline
    def loading(w, n, r):
        """Integrate dw/dx = 1 - w^n over the drift change `r` by a single classical Runge-Kutta
        step; return w at the end, and the dissipated energy, the integral of w^(n + 1), a multiple
        of (1 - a) Fy^2 / k.
        """
        p1 = power(w, n)
        w2 = w + 0.5 * r * (1.0 - p1)
        p2 = power(w2, n)
        w3 = w + 0.5 * r * (1.0 - p2)
        p3 = power(w3, n)
        w4 = w + r * (1.0 - p3)
        p4 = power(w4, n)
        loss = r / 6.0 * (p1 * w + 2.0 * (p2 * w2 + p3 * w3) + p4 * w4)
        return w + r - r / 6.0 * (p1 + 2.0 * (p2 + p3) + p4), loss

    @outlined
    def series(w, n, p):
        """Return the drift change x over which the force increases from 0 to w, and an energy.

        With dw/dx = 1 - p w^n, drift change and energy are integrals from 0 to w and power series
        in p w^n:

            x        int dw / (1 - p w^n)               = w sum_(j >= 0) (p w^n)^j / (j n + 1)
            energy   int p w^(n + 1) / (1 - p w^n) dw   = w^2 sum_(j >= 1) (p w^n)^j / (j n + 2)

        During loading, p is 1, and the energy is the energy that the path dissipates. Unloading
        from u = |w| to 0 is the same path backwards, with p = 1 - 2 beta (not positive). x is then
        the drift change until w = 0. The energy E(u) is minus the energy that unloading from u to 0
        dissipates. Unloading from u0 to u1 therefore dissipates E(u1) - E(u0).
        """
        ratio = p * w**n
        term = w  # w (p w^n)^j
        path = w
        loss = 0.0
        for j in range(1, 26):
            term *= ratio
            path += term / (j * n + 1.0)
            loss += term * w / (j * n + 2.0)
        return path, loss

    @outlined
    def solve_series(x, n, p):
        """Return the force w after the drift change `x` from w = 0, the inverse of `series`, by
        Newton's method.

        The convergence limit is about one rounding error of w. Rounding can therefore prevent a
        convergence; w is nevertheless exact up to rounding after eight iterations.
        """
        w = x
        for _ in range(8):
            path, _ = series(w, n, p)
            new_w = w - (path - x) * (1.0 - p * w**n)  # the derivative of `path` is 1 / (1 - p w^n)
            has_converged = abs(new_w - w) <= 1e-15 * x
            w = new_w
            if has_converged:
                break
        return w

    # ---- Degradation, pinching and asymmetry

    @inline
    def is_general(law_parameters, i):
        """Return True if the law has degradation, pinching or asymmetry."""
        return (
            law_parameters[_AMPLITUDE, i] != 0.0
            or law_parameters[_STRENGTH_RATE, i] != 0.0
            or law_parameters[_STIFFNESS_RATE, i] != 0.0
            or law_parameters[_SLIP, i] != 0.0
            or law_parameters[_ASYMMETRY, i] != 0.0
        )

    @inline
    def pinching_width(law_parameters, i, energy):
        """Return z1 and z2 after the energy E, J."""
        slip = law_parameters[_SLIP, i] * (1.0 - math.exp(-law_parameters[_SLIP_RATE, i] * energy))
        size = law_parameters[_SIZE, i] + law_parameters[_GROWTH, i] * energy
        return slip, size * (law_parameters[_SEVERITY, i] + slip)

    @outlined
    def general_rate(law_parameters, i, w, energy, side):
        """Return dw/dx for w positive in the direction of movement, after the energy E, J."""
        n = law_parameters[_EXPONENT, i]
        amplitude = 1.0 - law_parameters[_AMPLITUDE, i] * energy
        strength = 1.0 + law_parameters[_STRENGTH_RATE, i] * energy
        stiffness = 1.0 + law_parameters[_STIFFNESS_RATE, i] * energy
        shape = 1.0 - 2.0 * law_parameters[_BETA, i]
        if w > 0.0:
            shape = 1.0 + 2.0 * side * law_parameters[_ASYMMETRY, i]
        rate = (amplitude - strength * power(abs(w), n) * shape) / stiffness
        if law_parameters[_SLIP, i] > 0.0:
            slip, width = pinching_width(law_parameters, i, energy)
            distance = (w - law_parameters[_START, i] * strength ** (-1.0 / n)) / width
            rate *= 1.0 - slip * math.exp(-distance * distance)
        return rate

    @outlined
    def general_step(law_parameters, i, w, energy, side, r):
        """Integrate w and E over the drift change `r` by a classical Runge-Kutta step."""
        strength = law_parameters[_YIELD_FORCE, i]
        c = (1.0 - law_parameters[_HARDENING, i]) * strength * strength
        c /= law_parameters[rows.STIFFNESS, i]  # dE/dx = c w
        p1 = general_rate(law_parameters, i, w, energy, side)
        w2, e2 = w + 0.5 * r * p1, energy + 0.5 * r * c * w
        p2 = general_rate(law_parameters, i, w2, e2, side)
        w3, e3 = w + 0.5 * r * p2, energy + 0.5 * r * c * w2
        p3 = general_rate(law_parameters, i, w3, e3, side)
        w4, e4 = w + r * p3, energy + r * c * w3
        p4 = general_rate(law_parameters, i, w4, e4, side)
        return (
            w + r / 6.0 * (p1 + 2.0 * (p2 + p3) + p4),
            energy + r / 6.0 * c * (w + 2.0 * (w2 + w3) + w4),
        )

    @outlined
    def follow_general(law_parameters, i, state, side, length, ends_at_zero):
        """Integrate w and E, the tuple `state`, over a drift change in substeps; return w, E and
        the drift change. With `ends_at_zero`, the path ends where w changes its sign."""
        w, energy = state
        n = law_parameters[_EXPONENT, i]
        remaining = length
        while remaining > 0.0:
            if 1.0 - law_parameters[_AMPLITUDE, i] * energy <= _NO_AMPLITUDE:
                break
            r = 0.5 * _SUBSTEP / n
            if law_parameters[_SLIP, i] > 0.0:
                _, width = pinching_width(law_parameters, i, energy)
                r = min(r, _PINCHING_SUBSTEP * width)
            if n < _SMOOTH:
                r = min(r, max(_GRADING * abs(w), _MIN_GRADING))
            r = min(r, remaining)
            new_w, new_energy = general_step(law_parameters, i, w, energy, side, r)
            if w < 0.0 <= new_w:
                for _ in range(_MAX_CROSSINGS):
                    rate = general_rate(law_parameters, i, 0.0, new_energy, side)
                    change = new_w / rate
                    r = min(max(r - change, 0.0), remaining)
                    new_w, new_energy = general_step(law_parameters, i, w, energy, side, r)
                    if abs(change) <= 1e-15 * r:
                        break
                new_w = 0.0
                if ends_at_zero:
                    return new_w, new_energy, length - remaining + r
            w, energy = new_w, new_energy
            remaining -= r
        return w, energy, math.inf if ends_at_zero else length

    @outlined
    def general_force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force of a law with degradation, pinching or asymmetry; return the tangent
        stiffness, N/m."""
        if law_state[previous + rows.INTERNAL, i] == _FAILED:
            for row in (rows.INTERNAL, rows.DISSIPATED, rows.WORK):
                law_state[trial + row, i] = law_state[previous + row, i]
            law_state[trial + rows.FORCE, i] = 0.0
            return 0.0
        k = law_parameters[rows.STIFFNESS, i]
        strength = law_parameters[_YIELD_FORCE, i]
        hardening = law_parameters[_HARDENING, i]
        drift_change = drift - law_state[previous + rows.DRIFT, i]
        side = 1.0 if drift_change >= 0.0 else -1.0
        start = (side * law_state[previous + rows.INTERNAL, i], law_state[previous + rows.WORK, i])
        length = abs(drift_change) * k / strength
        w, energy, _ = follow_general(law_parameters, i, start, side, length, False)
        law_state[trial + rows.WORK, i] = energy
        if 1.0 - law_parameters[_AMPLITUDE, i] * energy <= _NO_AMPLITUDE:
            law_state[trial + rows.INTERNAL, i] = _FAILED
            law_state[trial + rows.FORCE, i] = 0.0
            law_state[trial + rows.DISSIPATED, i] = energy + 0.5 * hardening * k * drift * drift
            return 0.0
        law_state[trial + rows.INTERNAL, i] = side * w
        law_state[trial + rows.FORCE, i] = (
            hardening * k * drift + (1.0 - hardening) * strength * side * w
        )
        rate = 1.0
        if drift_change != 0.0:
            rate = general_rate(law_parameters, i, w, energy, side)
        return k * (hardening + (1.0 - hardening) * rate)

    @outlined
    def general_strain(law_parameters, law_state, i):
        """Return the energy that the hysteretic spring releases until w = 0, J."""
        w = law_state[rows.INTERNAL, i]
        if w == 0.0:
            return 0.0
        start = (-abs(w), law_state[rows.WORK, i])
        length = _MAX_UNLOADING * max(abs(w), 1.0)
        _, energy, _ = follow_general(
            law_parameters, i, start, math.copysign(1.0, -w), length, True
        )
        return start[1] - energy

    # ---- Functions of the law

    @outlined
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force at a drift; return the tangent stiffness, N/m.

        w and x are positive in the direction of movement. The story unloads while w is negative,
        and loads while w is positive. With u = -w, the equation is

            unloading    sgn(w dx) = -1    du/dx = -(1 + q u^n)    dissipation int q u^(n + 1) dx
            loading      sgn(w dx) = 1     dw/dx = 1 - w^n         dissipation int w^(n + 1) dx

        The path has up to three parts. It ends earlier if the drift is reached:

        1. unloading until w = 0: by Runge-Kutta steps; near w = 0 by a power series (n < _SMOOTH)
           or by Simpson's rule (larger n)
        2. loading near w = 0: by a power series (n < _SMOOTH only)
        3. loading: by Runge-Kutta steps
        """
        if is_general(law_parameters, i):
            return general_force(law_parameters, law_state, i, previous, trial, drift)
        k = law_parameters[rows.STIFFNESS, i]
        strength = law_parameters[_YIELD_FORCE, i]
        hardening = law_parameters[_HARDENING, i]
        n = law_parameters[_EXPONENT, i]
        q = 2.0 * law_parameters[_BETA, i] - 1.0
        drift_change = drift - law_state[previous + rows.DRIFT, i]
        side = 1.0 if drift_change >= 0.0 else -1.0  # direction of the path
        w = side * law_state[previous + rows.INTERNAL, i]
        remaining = abs(drift_change) * k / strength  # multiple of Fy / k
        substep = _SUBSTEP / n
        dissipation = 0.0  # multiple of (1 - a) Fy^2 / k
        # For a smooth force (large n), the series is not necessary.
        series_limit = _NEAR ** (1.0 / n) if n < _SMOOTH else 0.0
        # Part 1
        while w < 0.0 and remaining > 0.0:
            r = min(substep, remaining)
            u = -w
            if u <= series_limit:
                # `path` is the drift change until w = 0. The energies of `series` are negative
                # during unloading.
                path, start_energy = series(u, n, -q)
                u = solve_series(path - remaining, n, -q) if path > remaining else 0.0
                dissipation += (series(u, n, -q)[1] if u > 0.0 else 0.0) - start_energy
                w = -u
                remaining -= min(path, remaining)
                break
            if u <= 2.0 * r:
                # Drift change until w = 0 by Simpson's rule, as the integral of du / (1 + q u^n)
                # from 0 to u. For u > 2 r it never fits into this substep, because 1 + q u^n is at
                # most 2.
                middle, end = 1.0 + q * power(0.5 * u, n), 1.0 + q * power(u, n)
                path = u / 6.0 * (1.0 + 4.0 / middle + 1.0 / end)
                if path <= r:
                    # The dissipation is the integral of q u^(n + 1) dx = u du - u du / (1 + q u^n).
                    # The second integrand is 0 at u = 0.
                    dissipation += 0.5 * u * u - u * u / 6.0 * (2.0 / middle + 1.0 / end)
                    w = 0.0
                    remaining -= path
                    break
            u, path_dissipation = unloading(u, q, n, r)
            w = -u
            dissipation += path_dissipation
            remaining -= r
        # Part 2
        if 0.0 <= w < series_limit and remaining > 0.0:
            path, path_dissipation = series(w, n, 1.0)
            path_to_limit, dissipation_to_limit = series(series_limit, n, 1.0)
            if path + remaining < path_to_limit:
                w = solve_series(path + remaining, n, 1.0)
                dissipation += series(w, n, 1.0)[1] - path_dissipation
                remaining = 0.0
            else:
                w = series_limit
                dissipation += dissipation_to_limit - path_dissipation
                remaining -= path_to_limit - path
        # Part 3. A saturated w remains 1; its dissipation is then the drift change.
        while w >= 0.0 and remaining > 0.0:
            if 1.0 - w <= _SATURATED:
                w = 1.0
                dissipation += remaining
                break
            r = min(substep, remaining)
            w, path_dissipation = loading(w, n, r)
            dissipation += path_dissipation
            remaining -= r
        # dw/dx at the end of the path. Without a path, the direction is unknown, and the initial
        # stiffness is returned.
        if drift_change == 0.0:
            rate = 1.0
        elif w > 0.0:
            rate = 1.0 - power(w, n)
        else:
            rate = 1.0 + q * power(-w, n)
        law_state[trial + rows.INTERNAL, i] = side * w
        law_state[trial + rows.FORCE, i] = (
            hardening * k * drift + (1.0 - hardening) * strength * side * w
        )
        law_state[trial + rows.DISSIPATED, i] = (
            law_state[previous + rows.DISSIPATED, i]
            + (1.0 - hardening) * strength * strength / k * dissipation
        )
        return k * (hardening + (1.0 - hardening) * rate)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the stored energy, J: a k d^2 / 2 + (1 - a) Fy^2 w^2 / (2 k).

        The law consists of two parallel springs: an elastic spring with the stiffness a k, and a
        hysteretic spring with the stiffness (1 - a) k and the force (1 - a) Fy w.
        """
        if law_state[rows.INTERNAL, i] == _FAILED:
            return 0.0
        d = law_state[rows.DRIFT, i]
        k = law_parameters[rows.STIFFNESS, i]
        elastic = 0.5 * law_parameters[_HARDENING, i] * k * d * d
        if is_general(law_parameters, i):
            return elastic + general_strain(law_parameters, law_state, i)
        z = law_parameters[_YIELD_FORCE, i] * law_state[rows.INTERNAL, i]  # Fy w
        return elastic + 0.5 * (1.0 - law_parameters[_HARDENING, i]) * z * z / k

    @inline
    def hysteretic_energy(law_parameters, law_state, i):
        """Return the dissipated energy, J. With degradation, pinching or asymmetry, it is the
        energy E minus its part that the hysteretic spring releases."""
        if law_state[rows.INTERNAL, i] == _FAILED or not is_general(law_parameters, i):
            return law_state[rows.DISSIPATED, i]
        return law_state[rows.WORK, i] - general_strain(law_parameters, law_state, i)

    @inline
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        """Do nothing: the function `force` of the law computes the dissipated energy together with
        the force. The arguments are not used.
        """
        pass

    @outlined
    def kink(law_parameters, law_state, i, block, side):
        """Return the drift change after which w changes its sign, m; infinite if it does not.

        With the current value u of |w|, the drift change is

            x = int_0^u dv / (1 + q v^n) = u int_0^1 2 s ds / (1 + q (u s^2)^n),   v = u s^2

        The substitution makes the integrand smooth near v = 0. For q < 0 the integrand rises near v
        = 1, and the Gauss rule with eight points is applied to _PANELS parts.
        """
        u = -side * law_state[block + rows.INTERNAL, i]
        if not u > 0.0:  # w already has the sign of the direction
            return math.inf
        unit = law_parameters[_YIELD_FORCE, i] / law_parameters[rows.STIFFNESS, i]
        if is_general(law_parameters, i):
            if law_state[block + rows.INTERNAL, i] == _FAILED:
                return math.inf
            start = (-u, law_state[block + rows.WORK, i])
            _, _, path = follow_general(
                law_parameters, i, start, side, _MAX_UNLOADING * max(u, 1.0), True
            )
            return path * unit
        n = law_parameters[_EXPONENT, i]
        q = 2.0 * law_parameters[_BETA, i] - 1.0
        path = 0.0  # integral over s
        if q < 0.0:
            for point in range(8 * _PANELS):
                root = (point // 8 + nodes[point % 8]) / _PANELS
                path += weights[point % 8] * root / (1.0 + q * power(u * root * root, n))
            path *= 2.0 / _PANELS
        else:
            for point in range(8):
                root = nodes[point]  # sqrt(v / u)
                path += weights[point] * 2.0 * root / (1.0 + q * power(u * root * root, n))
        return path * u * unit

    @outlined
    def limit_branch(law_parameters, law_state, i, previous, block):
        """Set the limits of the branch in `block`: the drift of the change of sign of w.

        The time integration ends a substep at the limit of a branch, so that no substep contains
        the kink at w = 0. The branch has no limit if w already has the sign of the direction of
        loading (RATE_SIGN of `block`), or if w changes its sign within _AT_SIGN_CHANGE of the
        current drift. `block` can be the same as `previous`.
        """
        side = law_state[block + rows.RATE_SIGN, i]
        law_state[block + rows.UPPER, i] = math.inf
        law_state[block + rows.LOWER, i] = -math.inf
        if side * law_state[previous + rows.INTERNAL, i] < 0.0:
            distance = kink(law_parameters, law_state, i, previous, side)  # to w = 0
            # The yield drift is Fy / k.
            if (
                distance * law_parameters[rows.STIFFNESS, i]
                > _AT_SIGN_CHANGE * law_parameters[_YIELD_FORCE, i]
            ):
                law_state[block + (rows.UPPER if side > 0.0 else rows.LOWER), i] = (
                    law_state[previous + rows.DRIFT, i] + side * distance
                )

    @inline
    def keep(law_parameters, law_state, i, previous, trial):
        """Commit the branch of a trial state: its direction and, for small exponents, its limit."""
        drift_change = law_state[trial + rows.DRIFT, i] - law_state[previous + rows.DRIFT, i]
        if drift_change != 0.0:  # without a movement, the direction remains
            law_state[rows.RATE_SIGN, i] = math.copysign(1.0, drift_change)
        if is_general(law_parameters, i):
            law_state[rows.WORK, i] = law_state[trial + rows.WORK, i]
        if law_parameters[_EXPONENT, i] < _SMOOTH:
            limit_branch(law_parameters, law_state, i, trial, 0)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows the current branch at its end.

        At a reversal, the direction of the branch is reversed. Otherwise w has changed its sign,
        and the branch continues without limits.
        """
        if event == rows.REVERSED:
            law_state[block + rows.RATE_SIGN, i] = -law_state[block + rows.RATE_SIGN, i]
            if law_parameters[_EXPONENT, i] < _SMOOTH:
                limit_branch(law_parameters, law_state, i, block, block)
        else:
            law_state[block + rows.UPPER, i] = math.inf
            law_state[block + rows.LOWER, i] = -math.inf

    @inline
    def points(law_parameters, law_state, i, drift_change):
        """Return the number of Gauss points that integrate the force over a path with an error of
        about 1e-6 Fy; not an integer.

        The constants were determined by numerical experiments.
        """
        n = law_parameters[_EXPONENT, i]
        density = 4.0 * (n + 1.0)
        if law_parameters[_SLIP, i] > 0.0:
            density += _PINCHING_DENSITY / (law_parameters[_SIZE, i] * law_parameters[_SEVERITY, i])
        k, strength = law_parameters[rows.STIFFNESS, i], law_parameters[_YIELD_FORCE, i]
        return 1.9 + density * drift_change * k / strength

    return LawFunctions(
        force=force,
        strain_energy=strain_energy,
        hysteretic_energy=hysteretic_energy,
        accumulate_dissipation=accumulate_dissipation,
        keep=keep,
        switch=switch,
        points=points,
        kink=kink,
    )


def _warning(stiffness: float, values: Sequence[float]) -> str | None:
    """Return a warning if unloading can create energy."""
    beta = values[3]
    if beta >= 0.5:
        return None
    return (
        f"beta {beta:.4g} is below 0.5: the loops of bouc-wen can then create energy; check the "
        "energies of the run"
    )


_RATE = LawParameter("", force=-1, length=-1, low=0.0, group="degradation", default=0.0)
"""Rate per energy of the hysteretic part."""

LAW = DriftLaw(
    "bouc-wen",
    "f = a k d + (1 - a) Fy w, dw = (1 - |w|^n (beta sgn(w dd) + 1 - beta)) k dd / Fy: smooth "
    "hysteresis",
    _functions,
    parameters=(
        LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
        LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
        LawParameter("exponent", low=1.0, high=100.0),
        LawParameter("beta", low=0.0, high=1.0, low_allowed=False, is_ratio=False),
        *(replace(_RATE, name=name) for name in ("amplitude", "strength", "stiffness")),
        LawParameter("slip", low=0.0, high=1.0, high_allowed=False, group="pinching", without=0.0),
        replace(_RATE, name="rate", group="pinching", default=None, without=0.0),
        LawParameter("start", group="pinching", default=0.0),
        LawParameter("size", low=0.0, low_allowed=False, group="pinching", without=1.0),
        replace(_RATE, name="growth", group="pinching"),
        LawParameter("severity", low=0.0, low_allowed=False, group="pinching", without=1.0),
        LawParameter(
            *("asymmetry", 0, 0, -0.5, 0.5), low_allowed=False, high_allowed=False, default=0.0
        ),
    ),
    other_keys=(
        (
            "gamma",
            "it is 1 - beta here, so that the strength is yield_force; write a law with a gamma of "
            "its own as a plug-in, see src/tdint/README.md",
        ),
        ("alpha", "hardening"),
        ("n", "exponent"),
    ),
    kinked=True,
    curved=True,
    equal_directions=lambda values: values[-1] == 0.0,  # asymmetry
    failed=_FAILED,
    warning=_warning,
    yield_drift=yields_at_its_strength,
    stiffness_after_yield=hardening_stiffness,
)
