"""The Bouc-Wen law (Bouc 1967, Wen 1976): a smooth hysteresis that the drift drives, whatever its
rate.

    f = a k d + (1 - a) Fy w,   dw/dx = 1 - |w|^n (beta sgn(w dx) + 1 - beta),   x = k d / Fy

with A = 1 and beta + gamma = 1, so that |w| tends to 1 (Ma, Zhang, Bockstette, Foliente and Paevere
2004 show that the other parameters are redundant). beta >= 1/2 keeps the dissipation from being
negative.

The equation is integrated along the drift in substeps of a fixed length from the committed state,
the last one shortened: the force is a continuous function of the drift. Where w changes its sign a
substep ends too. There |w|^n is not smooth: for n below 2 the time steps that locate kinks end
there, and near it the equation is integrated as a series in |w|^n, exactly.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Parameters
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1
_EXPONENT = rows.FIRST_PARAMETER + 2
_BETA = rows.FIRST_PARAMETER + 3

_SUBSTEP = 0.125
"""Length of a substep times the exponent n, in yield drifts; classical Runge-Kutta then errs by
about 1e-7 Fy a leg; over many legs this adds up, to 1.3e-6 Fy after 60 (exponent 1)."""
_SATURATED = 1e-14
_SMOOTH = 2.0
"""Exponent from which on the force is smooth enough where w changes its sign."""
_NEAR = 0.25
"""Largest |w|^n for which the series is taken."""
_THERE = 1e-6
"""Over the yield drift: a sign that changes no farther ahead changes here."""
_NODES = (0.18343464249564978, 0.525532409916329, 0.7966664774136267, 0.9602898564975362)
_WEIGHTS = (0.36268378337836166, 0.3137066458778869, 0.22238103445337443, 0.10122853629037706)
"""Of Gauss and Legendre with eight points, those on the right."""


def _functions() -> LawFunctions:
    import numpy as np

    from tdint.kernels.compiling import inline, outlined

    nodes = 0.5 + 0.5 * np.array([*(-node for node in reversed(_NODES)), *_NODES])
    weights = 0.5 * np.array([*reversed(_WEIGHTS), *_WEIGHTS])

    @inline
    def power(x, n):
        return x if n == 1.0 else (x * x if n == 2.0 else x**n)

    @inline
    def unloading(u, q, n, r):
        """u' = -(1 + q u^n) over r, and the loss q u^(n + 1) summed up on the way, over Fy^2 /
        k."""
        p1 = q * power(u, n)
        u2 = u - 0.5 * r * (1.0 + p1)
        p2 = q * power(abs(u2), n)
        u3 = u - 0.5 * r * (1.0 + p2)
        p3 = q * power(abs(u3), n)
        u4 = u - r * (1.0 + p3)
        p4 = q * power(abs(u4), n)
        loss = r / 6.0 * (p1 * u + 2.0 * (p2 * u2 + p3 * u3) + p4 * u4)
        return u - r - r / 6.0 * (p1 + 2.0 * (p2 + p3) + p4), loss

    @inline
    def loading(w, n, r):
        """w' = 1 - w^n over r, and the loss w^(n + 1) summed up on the way, over Fy^2 / k."""
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
        """The way from 0 to w, over Fy / k, where w' = 1 - p w^n; and the loss p w^(n + 1) summed
        up on it."""
        ratio = p * w**n
        term = w
        way = w
        loss = 0.0
        for j in range(1, 26):
            term *= ratio
            way += term / (j * n + 1.0)
            loss += term * w / (j * n + 2.0)
        return way, loss

    @outlined
    def at_way(x, n, p):
        """Where the way of `series` is x, by Newton's iteration."""
        w = x
        for _ in range(8):
            way, _ = series(w, n, p)
            new = w - (way - x) * (1.0 - p * w**n)
            done = abs(new - w) <= 1e-15 * x
            w = new
            if done:
                break
        return w

    @outlined
    def force(law_parameters, law_state, i, previous, trial, drift):
        k = law_parameters[rows.STIFFNESS, i]
        strength = law_parameters[_YIELD_FORCE, i]
        hardening = law_parameters[_HARDENING, i]
        n = law_parameters[_EXPONENT, i]
        q = 2.0 * law_parameters[_BETA, i] - 1.0
        stretch = drift - law_state[previous + rows.DRIFT, i]
        side = 1.0 if stretch >= 0.0 else -1.0
        w = side * law_state[previous + rows.INTERNAL, i]
        left = abs(stretch) * k / strength
        longest = _SUBSTEP / n
        loss = 0.0
        near = _NEAR ** (1.0 / n) if n < _SMOOTH else 0.0
        while w < 0.0 and left > 0.0:
            r = min(longest, left)
            u = -w
            if u <= near:
                way, lost = series(u, n, -q)
                u = at_way(way - left, n, -q) if way > left else 0.0
                loss += (series(u, n, -q)[1] if u > 0.0 else 0.0) - lost
                w = -u
                left -= min(way, left)
                break
            if u <= 2.0 * r:
                # The way to w = 0, by Simpson's rule for dx/du
                way = (
                    u
                    / 6.0
                    * (1.0 + 4.0 / (1.0 + q * power(0.5 * u, n)) + 1.0 / (1.0 + q * power(u, n)))
                )
                if way <= r:
                    loss += 0.5 * u * u - u * u / 6.0 * (
                        2.0 / (1.0 + q * power(0.5 * u, n)) + 1.0 / (1.0 + q * power(u, n))
                    )
                    w = 0.0
                    left -= way
                    break
            u, lost = unloading(u, q, n, r)
            w = -u
            loss += lost
            left -= r
        if 0.0 <= w < near and left > 0.0:
            way, lost = series(w, n, 1.0)
            whole, lost_whole = series(near, n, 1.0)
            if way + left < whole:
                w = at_way(way + left, n, 1.0)
                loss += series(w, n, 1.0)[1] - lost
                left = 0.0
            else:
                w = near
                loss += lost_whole - lost
                left -= whole - way
        while w >= 0.0 and left > 0.0:
            if 1.0 - w <= _SATURATED:
                w = 1.0
                loss += left
                break
            r = min(longest, left)
            w, lost = loading(w, n, r)
            loss += lost
            left -= r
        if stretch == 0.0:
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
            + (1.0 - hardening) * strength * strength / k * loss
        )
        return k * (hardening + (1.0 - hardening) * rate)

    @inline
    def strain_energy(law_parameters, law_state, i):
        d = law_state[rows.DRIFT, i]
        z = law_parameters[_YIELD_FORCE, i] * law_state[rows.INTERNAL, i]
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        return 0.5 * hardening * k * d * d + 0.5 * (1.0 - hardening) * z * z / k

    @inline
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        pass  # summed up on the way

    @outlined
    def kink(law_parameters, law_state, i, block, side):
        """How far ahead on that side w changes its sign, by Gauss points in the root of w: dx = du
        / (1 + q u^n)."""
        u = -side * law_state[block + rows.INTERNAL, i]
        if not u > 0.0:
            return math.inf
        n = law_parameters[_EXPONENT, i]
        q = 2.0 * law_parameters[_BETA, i] - 1.0
        way = 0.0
        for point in range(8):
            root = nodes[point]
            way += weights[point] * 2.0 * root / (1.0 + q * power(u * root * root, n))
        return way * u * law_parameters[_YIELD_FORCE, i] / law_parameters[rows.STIFFNESS, i]

    @outlined
    def look_ahead(law_parameters, law_state, i, previous, block):
        """Let the branch in `block` end where w will change its sign, seen from the state in
        `previous`."""
        side = law_state[block + rows.RATE_SIGN, i]
        law_state[block + rows.UPPER, i] = math.inf
        law_state[block + rows.LOWER, i] = -math.inf
        if side * law_state[previous + rows.INTERNAL, i] < 0.0:
            way = kink(law_parameters, law_state, i, previous, side)
            if way * law_parameters[rows.STIFFNESS, i] > _THERE * law_parameters[_YIELD_FORCE, i]:
                law_state[block + (rows.UPPER if side > 0.0 else rows.LOWER), i] = (
                    law_state[previous + rows.DRIFT, i] + side * way
                )

    @inline
    def keep(law_parameters, law_state, i, previous, trial):
        stretch = law_state[trial + rows.DRIFT, i] - law_state[previous + rows.DRIFT, i]
        if stretch != 0.0:
            law_state[rows.RATE_SIGN, i] = math.copysign(1.0, stretch)
        if law_parameters[_EXPONENT, i] < _SMOOTH:
            look_ahead(law_parameters, law_state, i, trial, 0)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """The drift rate has turned, and the tangent jumps; or w changes its sign."""
        if event == rows.REVERSED:
            law_state[block + rows.RATE_SIGN, i] = -law_state[block + rows.RATE_SIGN, i]
            if law_parameters[_EXPONENT, i] < _SMOOTH:
                look_ahead(law_parameters, law_state, i, block, block)
        else:
            law_state[block + rows.UPPER, i] = math.inf
            law_state[block + rows.LOWER, i] = -math.inf

    @inline
    def points(law_parameters, law_state, i, way):
        """Good to about 1e-6 of the yield force."""
        n = law_parameters[_EXPONENT, i]
        return (
            1.9
            + 4.0
            * (n + 1.0)
            * way
            * law_parameters[rows.STIFFNESS, i]
            / law_parameters[_YIELD_FORCE, i]
        )

    return LawFunctions(
        force=force,
        strain_energy=strain_energy,
        accumulate_dissipation=accumulate_dissipation,
        keep=keep,
        switch=switch,
        points=points,
        kink=kink,
    )


LAW = DriftLaw(
    "bouc-wen",
    "f = a k d + (1 - a) Fy w, dw = (1 - |w|^n (beta sgn(w dd) + 1 - beta)) k dd / Fy: smooth "
    "hysteresis",
    _functions,
    parameters=(
        LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
        LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
        LawParameter("exponent", low=1.0, high=100.0),
        LawParameter("beta", low=0.5, high=1.0),
    ),
    kinked=True,
    curved=True,
    yield_drift=yields_at_its_strength,
)
