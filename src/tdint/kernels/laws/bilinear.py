"""The bilinear law with kinematic hardening.

    f = a k d + z,   dz = (1 - a) k dd,   |z| <= (1 - a) Fy

z is an elastic-perfectly plastic spring beside an elastic one (Prandtl's element with a spring in
parallel).
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Parameters
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inline

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        z = law_state[previous + rows.INTERNAL, i] + (1.0 - hardening) * k * (
            drift - law_state[previous + rows.DRIFT, i]
        )
        tangent = k
        if z > strength:
            z = strength
            tangent = hardening * k
        elif z < -strength:
            z = -strength
            tangent = hardening * k
        law_state[trial + rows.INTERNAL, i] = z
        law_state[trial + rows.FORCE, i] = hardening * k * drift + z
        return tangent

    @inline
    def strain_energy(law_parameters, law_state, i):
        d = law_state[rows.DRIFT, i]
        z = law_state[rows.INTERNAL, i]
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        return 0.5 * hardening * k * d * d + 0.5 * z * z / ((1.0 - hardening) * k)

    @inline
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        law_state[trial + rows.DISSIPATED, i] = law_state[previous + rows.DISSIPATED, i]
        z = law_state[trial + rows.INTERNAL, i]
        soft = 1.0 - law_parameters[_HARDENING, i]
        if abs(z) == soft * law_parameters[_YIELD_FORCE, i]:  # else the way was elastic
            stretch = law_state[trial + rows.DRIFT, i] - law_state[previous + rows.DRIFT, i]
            slip = stretch - (z - law_state[previous + rows.INTERNAL, i]) / (
                soft * law_parameters[rows.STIFFNESS, i]
            )
            law_state[trial + rows.DISSIPATED, i] += abs(z * slip)

    @inline
    def enter(law_parameters, law_state, i):
        soft = 1.0 - law_parameters[_HARDENING, i]
        strength = soft * law_parameters[_YIELD_FORCE, i]
        k = law_parameters[rows.STIFFNESS, i]
        law_state[rows.UPPER, i] = law_state[rows.DRIFT, i] + (
            strength - law_state[rows.INTERNAL, i]
        ) / (soft * k)
        law_state[rows.LOWER, i] = law_state[rows.DRIFT, i] - (
            strength + law_state[rows.INTERNAL, i]
        ) / (soft * k)

    @inline
    def advance(law_parameters, law_state, i, block, step, mean_force):
        if law_state[block + rows.RATE_SIGN, i] == 0.0:
            elastic = (
                law_parameters[_HARDENING, i]
                * law_parameters[rows.STIFFNESS, i]
                * law_state[block + rows.DRIFT, i]
            )
            law_state[block + rows.INTERNAL, i] = law_state[block + rows.FORCE, i] - elastic
        else:
            law_state[block + rows.DISSIPATED, i] += abs(law_state[block + rows.INTERNAL, i] * step)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        drift = law_state[block + rows.DRIFT, i]
        if event == rows.REVERSED:
            side = law_state[block + rows.RATE_SIGN, i]
            back = drift - side * 2.0 * strength / ((1.0 - hardening) * k)
            law_state[block + rows.SLOPE, i] = k
            law_state[block + rows.RATE_SIGN, i] = 0.0
            law_state[block + rows.UPPER, i] = max(drift, back)
            law_state[block + rows.LOWER, i] = min(drift, back)
        else:
            law_state[block + rows.INTERNAL, i] = event * strength
            law_state[block + rows.FORCE, i] = hardening * k * drift + event * strength
            law_state[block + rows.SLOPE, i] = hardening * k
            law_state[block + rows.RATE_SIGN, i] = event
            law_state[block + rows.UPPER, i] = math.inf
            law_state[block + rows.LOWER, i] = -math.inf

    return LawFunctions(
        force=force,
        strain_energy=strain_energy,
        accumulate_dissipation=accumulate_dissipation,
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
