"""The bilinear law with kinematic hardening.

    f = a k d + z,   dz = (1 - a) k dd,   |z| <= (1 - a) Fy

z is an elastic-perfectly plastic spring beside an elastic one (Prandtl's element with a spring in parallel).
"""

from __future__ import annotations

import math

from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength
from tdint.kernels.layout import (
    DISSIPATED,
    DRIFT,
    FIRST_PARAMETER,
    FORCE,
    INTERNAL,
    LOWER,
    SLOPE,
    STIFFNESS,
    TURN,
    TURNED,
    UPPER,
)


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inlined

    @inlined
    def force(laws, springs, i, past, trial, drift):
        k = laws[STIFFNESS, i]
        hardening = laws[FIRST_PARAMETER + 1, i]
        strength = (1.0 - hardening) * laws[FIRST_PARAMETER, i]
        z = springs[past + INTERNAL, i] + (1.0 - hardening) * k * (drift - springs[past + DRIFT, i])
        tangent = k
        if z > strength:
            z = strength
            tangent = hardening * k
        elif z < -strength:
            z = -strength
            tangent = hardening * k
        springs[trial + INTERNAL, i] = z
        springs[trial + FORCE, i] = hardening * k * drift + z
        return tangent

    @inlined
    def recoverable(laws, springs, i):
        d = springs[DRIFT, i]
        z = springs[INTERNAL, i]
        k = laws[STIFFNESS, i]
        hardening = laws[FIRST_PARAMETER + 1, i]
        return 0.5 * hardening * k * d * d + 0.5 * z * z / ((1.0 - hardening) * k)

    @inlined
    def settle(laws, springs, i, past, trial):
        springs[trial + DISSIPATED, i] = springs[past + DISSIPATED, i]
        z = springs[trial + INTERNAL, i]
        soft = 1.0 - laws[FIRST_PARAMETER + 1, i]
        if abs(z) == soft * laws[FIRST_PARAMETER, i]:  # else the way was elastic
            stretch = springs[trial + DRIFT, i] - springs[past + DRIFT, i]
            slip = stretch - (z - springs[past + INTERNAL, i]) / (soft * laws[STIFFNESS, i])
            springs[trial + DISSIPATED, i] += abs(z * slip)

    @inlined
    def enter(laws, springs, i):
        soft = 1.0 - laws[FIRST_PARAMETER + 1, i]
        strength = soft * laws[FIRST_PARAMETER, i]
        k = laws[STIFFNESS, i]
        springs[UPPER, i] = springs[DRIFT, i] + (strength - springs[INTERNAL, i]) / (soft * k)
        springs[LOWER, i] = springs[DRIFT, i] - (strength + springs[INTERNAL, i]) / (soft * k)

    @inlined
    def advance(laws, springs, i, block, step, mean_force):
        if springs[block + TURN, i] == 0.0:
            elastic = laws[FIRST_PARAMETER + 1, i] * laws[STIFFNESS, i] * springs[block + DRIFT, i]
            springs[block + INTERNAL, i] = springs[block + FORCE, i] - elastic
        else:
            springs[block + DISSIPATED, i] += abs(springs[block + INTERNAL, i] * step)

    @inlined
    def switch(laws, springs, i, block, event):
        k = laws[STIFFNESS, i]
        hardening = laws[FIRST_PARAMETER + 1, i]
        strength = (1.0 - hardening) * laws[FIRST_PARAMETER, i]
        drift = springs[block + DRIFT, i]
        if event == TURNED:
            side = springs[block + TURN, i]
            back = drift - side * 2.0 * strength / ((1.0 - hardening) * k)
            springs[block + SLOPE, i] = k
            springs[block + TURN, i] = 0.0
            springs[block + UPPER, i] = max(drift, back)
            springs[block + LOWER, i] = min(drift, back)
        else:
            springs[block + INTERNAL, i] = event * strength
            springs[block + FORCE, i] = hardening * k * drift + event * strength
            springs[block + SLOPE, i] = hardening * k
            springs[block + TURN, i] = event
            springs[block + UPPER, i] = math.inf
            springs[block + LOWER, i] = -math.inf

    return LawFunctions(
        force=force, recoverable=recoverable, settle=settle, enter=enter, advance=advance, switch=switch
    )


LAW = DriftLaw(
    "bilinear",
    "f = a k d + z, |z| <= (1 - a) Fy: yield force Fy, kinematic hardening a",
    _functions,
    parameters=(
        LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
        LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
    ),
    kinked=True,
    yield_drift=yields_at_its_strength,
)
