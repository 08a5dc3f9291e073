"""Bilinear law with kinematic hardening.

    f = a k d + z,   dz = (1 - a) k dd,   |z| <= (1 - a) Fy

with the force f, the drift d, the initial stiffness k, the yield force Fy and the hardening ratio
a. The law is the sum of two parallel springs: an elastic spring with the stiffness a k, and an
elastic-perfectly plastic spring with the stiffness (1 - a) k and the force z, which row INTERNAL of
the law state contains. The second spring yields at the drift Fy / k, as the story does.

`tdint.kernels.laws.law.LawFunctions` describes the functions and their arguments.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import (
    DriftLaw,
    LawFunctions,
    LawParameter,
    hardening_stiffness,
    yields_at_its_strength,
)

# Yield force (N) and hardening ratio in `law_parameters`. The bounds of `LAW` exclude a = 1, so
# that a division by 1 - a is possible.
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute force and z; return the tangent stiffness: k, or a k if the story yields."""
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        # Predict z elastically, then limit it to the strength.
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
        """Return the elastic energy of both springs: a k d^2 / 2 + z^2 / (2 (1 - a) k)."""
        d = law_state[rows.DRIFT, i]
        z = law_state[rows.INTERNAL, i]
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        return 0.5 * hardening * k * d * d + 0.5 * z * z / ((1.0 - hardening) * k)

    @inline
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        """Add |z| times the plastic part of the change of drift, if the path ends at the
        strength."""
        law_state[trial + rows.DISSIPATED, i] = law_state[previous + rows.DISSIPATED, i]
        z = law_state[trial + rows.INTERNAL, i]
        plastic_share = 1.0 - law_parameters[_HARDENING, i]
        # `force` limits z to exactly this strength; otherwise the path was elastic.
        if abs(z) == plastic_share * law_parameters[_YIELD_FORCE, i]:
            drift_change = law_state[trial + rows.DRIFT, i] - law_state[previous + rows.DRIFT, i]
            plastic_change = drift_change - (z - law_state[previous + rows.INTERNAL, i]) / (
                plastic_share * law_parameters[rows.STIFFNESS, i]
            )
            law_state[trial + rows.DISSIPATED, i] += abs(z * plastic_change)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the limits of the elastic branch: the drifts at which z reaches its strength."""
        plastic_share = 1.0 - law_parameters[_HARDENING, i]
        strength = plastic_share * law_parameters[_YIELD_FORCE, i]
        k = law_parameters[rows.STIFFNESS, i]
        law_state[rows.UPPER, i] = law_state[rows.DRIFT, i] + (
            strength - law_state[rows.INTERNAL, i]
        ) / (plastic_share * k)
        law_state[rows.LOWER, i] = law_state[rows.DRIFT, i] - (
            strength + law_state[rows.INTERNAL, i]
        ) / (plastic_share * k)

    @inline
    def advance(law_parameters, law_state, i, block, step, mean_force):
        """Update INTERNAL on an elastic branch (RATE_SIGN 0), or DISSIPATED on a yielding branch,
        where z is constant."""
        if law_state[block + rows.RATE_SIGN, i] == 0.0:
            elastic_force = (
                law_parameters[_HARDENING, i]
                * law_parameters[rows.STIFFNESS, i]
                * law_state[block + rows.DRIFT, i]
            )
            law_state[block + rows.INTERNAL, i] = law_state[block + rows.FORCE, i] - elastic_force
        else:
            law_state[block + rows.DISSIPATED, i] += abs(law_state[block + rows.INTERNAL, i] * step)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows: elastic after a reversal, yielding after a yield drift.

        A yielding branch ends only at a reversal.
        """
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        drift = law_state[block + rows.DRIFT, i]
        if event == rows.REVERSED:
            # The yield drift of the other side is at a distance of 2 Fy / k.
            side = law_state[block + rows.RATE_SIGN, i]
            opposite_yield = drift - side * 2.0 * strength / ((1.0 - hardening) * k)
            law_state[block + rows.SLOPE, i] = k
            law_state[block + rows.RATE_SIGN, i] = 0.0
            law_state[block + rows.UPPER, i] = max(drift, opposite_yield)
            law_state[block + rows.LOWER, i] = min(drift, opposite_yield)
        else:
            # The event ABOVE is 1, BELOW is -1: the direction of yielding.
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
    stiffness_after_yield=hardening_stiffness,
)
