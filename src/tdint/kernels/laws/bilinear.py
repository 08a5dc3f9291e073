"""The bilinear law with kinematic hardening.

    f = a k d + z,   dz = (1 - a) k dd,   |z| <= (1 - a) Fy

z is an elastic-perfectly plastic spring beside an elastic one (Prandtl's element with a spring in
parallel).
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Parameters
_YIELD_FORCE = at.FIRST_PARAMETER
_HARDENING = at.FIRST_PARAMETER + 1


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inlined

    @inlined
    def force(law_parameters, springs, i, past, trial, drift):
        k = law_parameters[at.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        z = springs[past + at.INTERNAL, i] + (1.0 - hardening) * k * (
            drift - springs[past + at.DRIFT, i]
        )
        tangent = k
        if z > strength:
            z = strength
            tangent = hardening * k
        elif z < -strength:
            z = -strength
            tangent = hardening * k
        springs[trial + at.INTERNAL, i] = z
        springs[trial + at.FORCE, i] = hardening * k * drift + z
        return tangent

    @inlined
    def recoverable(law_parameters, springs, i):
        d = springs[at.DRIFT, i]
        z = springs[at.INTERNAL, i]
        k = law_parameters[at.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        return 0.5 * hardening * k * d * d + 0.5 * z * z / ((1.0 - hardening) * k)

    @inlined
    def settle(law_parameters, springs, i, past, trial):
        springs[trial + at.DISSIPATED, i] = springs[past + at.DISSIPATED, i]
        z = springs[trial + at.INTERNAL, i]
        soft = 1.0 - law_parameters[_HARDENING, i]
        if abs(z) == soft * law_parameters[_YIELD_FORCE, i]:  # else the way was elastic
            stretch = springs[trial + at.DRIFT, i] - springs[past + at.DRIFT, i]
            slip = stretch - (z - springs[past + at.INTERNAL, i]) / (
                soft * law_parameters[at.STIFFNESS, i]
            )
            springs[trial + at.DISSIPATED, i] += abs(z * slip)

    @inlined
    def enter(law_parameters, springs, i):
        soft = 1.0 - law_parameters[_HARDENING, i]
        strength = soft * law_parameters[_YIELD_FORCE, i]
        k = law_parameters[at.STIFFNESS, i]
        springs[at.UPPER, i] = springs[at.DRIFT, i] + (strength - springs[at.INTERNAL, i]) / (
            soft * k
        )
        springs[at.LOWER, i] = springs[at.DRIFT, i] - (strength + springs[at.INTERNAL, i]) / (
            soft * k
        )

    @inlined
    def advance(law_parameters, springs, i, block, step, mean_force):
        if springs[block + at.TURN, i] == 0.0:
            elastic = (
                law_parameters[_HARDENING, i]
                * law_parameters[at.STIFFNESS, i]
                * springs[block + at.DRIFT, i]
            )
            springs[block + at.INTERNAL, i] = springs[block + at.FORCE, i] - elastic
        else:
            springs[block + at.DISSIPATED, i] += abs(springs[block + at.INTERNAL, i] * step)

    @inlined
    def switch(law_parameters, springs, i, block, event):
        k = law_parameters[at.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        drift = springs[block + at.DRIFT, i]
        if event == at.TURNED:
            side = springs[block + at.TURN, i]
            back = drift - side * 2.0 * strength / ((1.0 - hardening) * k)
            springs[block + at.SLOPE, i] = k
            springs[block + at.TURN, i] = 0.0
            springs[block + at.UPPER, i] = max(drift, back)
            springs[block + at.LOWER, i] = min(drift, back)
        else:
            springs[block + at.INTERNAL, i] = event * strength
            springs[block + at.FORCE, i] = hardening * k * drift + event * strength
            springs[block + at.SLOPE, i] = hardening * k
            springs[block + at.TURN, i] = event
            springs[block + at.UPPER, i] = math.inf
            springs[block + at.LOWER, i] = -math.inf

    return LawFunctions(
        force=force,
        recoverable=recoverable,
        settle=settle,
        enter=enter,
        advance=advance,
        switch=switch,
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
