"""Bilinear law with kinematic hardening or softening.

    f = a k d + z,   dz = (1 - a) k dd,   -(1 - a) Fy- <= z <= (1 - a) Fy+

with the force f, the drift d, the initial stiffness k, the yield forces Fy+ and Fy- of both sides
and the hardening ratio a. The law is the sum of two parallel springs: an elastic spring with the
stiffness a k, and an elastic-perfectly plastic spring with the force z, which row INTERNAL of the
law state contains. The second spring yields at the drift Fy / k, as the story does.

For a < 0 the lines of yielding fall. The line of a side has no force beyond the drift
(1 - a) Fy / (|a| k), where the story has lost its resistance. The elastic spring would store a
negative energy, so the energies are the energies of a spring k in series with a plastic hinge:

    strain energy       f^2 / (2 k)
    dissipated energy   integral of f over the plastic drift d - f / k

`tdint.kernels.laws.law.LawFunctions` describes the functions and their arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, hardening_stiffness

# Yield force of the positive side (N), hardening ratio and yield force of the negative side in
# `law_parameters`. The bounds of `LAW` exclude a = 1, so that a division by 1 - a is possible.
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1
_NEGATIVE_YIELD_FORCE = rows.FIRST_PARAMETER + 2


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline

    @inline
    def side_yield_force(law_parameters, i, side):
        """Return the yield force of a side; only the sign of `side` is used."""
        return law_parameters[_YIELD_FORCE if side > 0.0 else _NEGATIVE_YIELD_FORCE, i]

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute force and z; return the tangent stiffness: k, or a k if the story yields."""
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        negative_strength = (1.0 - hardening) * law_parameters[_NEGATIVE_YIELD_FORCE, i]
        # Predict z elastically, then limit it to the strength.
        z = law_state[previous + rows.INTERNAL, i] + (1.0 - hardening) * k * (
            drift - law_state[previous + rows.DRIFT, i]
        )
        tangent = k
        if z > strength:
            z = strength
            tangent = hardening * k
        elif z < -negative_strength:
            z = -negative_strength
            tangent = hardening * k
        law_state[trial + rows.INTERNAL, i] = z
        law_state[trial + rows.FORCE, i] = hardening * k * drift + z
        return tangent

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the elastic energy of both springs, a k d^2 / 2 + z^2 / (2 (1 - a) k), or
        f^2 / (2 k) if the line of yielding falls."""
        d = law_state[rows.DRIFT, i]
        z = law_state[rows.INTERNAL, i]
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        if hardening < 0.0:
            return 0.5 * law_state[rows.FORCE, i] ** 2 / k
        return 0.5 * hardening * k * d * d + 0.5 * z * z / ((1.0 - hardening) * k)

    @inline
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        """Add the energy dissipated on the yielding part x of the path, if it ends at the strength.

        It is |z x|, or the mean force times the plastic drift (1 - a) x if the line of yielding
        falls.
        """
        law_state[trial + rows.DISSIPATED, i] = law_state[previous + rows.DISSIPATED, i]
        z = law_state[trial + rows.INTERNAL, i]
        hardening = law_parameters[_HARDENING, i]
        plastic_share = 1.0 - hardening
        # `force` limits z to exactly this strength; otherwise the path was elastic.
        if z == plastic_share * law_parameters[_YIELD_FORCE, i] or (
            z == -plastic_share * law_parameters[_NEGATIVE_YIELD_FORCE, i]
        ):
            k = law_parameters[rows.STIFFNESS, i]
            drift_change = law_state[trial + rows.DRIFT, i] - law_state[previous + rows.DRIFT, i]
            yielding = drift_change - (z - law_state[previous + rows.INTERNAL, i]) / (
                plastic_share * k
            )
            if hardening < 0.0:
                mean_force = law_state[trial + rows.FORCE, i] - 0.5 * hardening * k * yielding
                law_state[trial + rows.DISSIPATED, i] += mean_force * plastic_share * yielding
            else:
                law_state[trial + rows.DISSIPATED, i] += abs(z * yielding)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the limits of the elastic branch of the committed state: its two yield drifts.

        At a yield drift, the plastic spring with the force z (row INTERNAL) reaches its strength:

            UPPER    d + ((1 - a) Fy+ - z) / ((1 - a) k)
            LOWER    d - ((1 - a) Fy- + z) / ((1 - a) k)
        """
        plastic_share = 1.0 - law_parameters[_HARDENING, i]
        strength = plastic_share * law_parameters[_YIELD_FORCE, i]
        negative_strength = plastic_share * law_parameters[_NEGATIVE_YIELD_FORCE, i]
        k = law_parameters[rows.STIFFNESS, i]
        law_state[rows.UPPER, i] = law_state[rows.DRIFT, i] + (
            strength - law_state[rows.INTERNAL, i]
        ) / (plastic_share * k)
        law_state[rows.LOWER, i] = law_state[rows.DRIFT, i] - (
            negative_strength + law_state[rows.INTERNAL, i]
        ) / (plastic_share * k)

    @inline
    def advance(law_parameters, law_state, i, block, step, mean_force):
        """Update INTERNAL or DISSIPATED in `block` after a change of drift along one branch.

        The caller has already set DRIFT and FORCE to their values at the end of the path. On an
        elastic branch (RATE_SIGN 0), z = f - a k d. On a yielding branch, z is constant and the
        dissipated energy increases as in `accumulate_dissipation`.
        """
        if law_state[block + rows.RATE_SIGN, i] == 0.0:
            slope = law_parameters[_HARDENING, i] * law_parameters[rows.STIFFNESS, i]
            elastic_force = slope * law_state[block + rows.DRIFT, i]
            law_state[block + rows.INTERNAL, i] = law_state[block + rows.FORCE, i] - elastic_force
        elif law_parameters[_HARDENING, i] < 0.0:
            plastic_change = (1.0 - law_parameters[_HARDENING, i]) * step
            law_state[block + rows.DISSIPATED, i] += mean_force * plastic_change
        else:
            law_state[block + rows.DISSIPATED, i] += abs(law_state[block + rows.INTERNAL, i] * step)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows: elastic after a reversal, yielding after a yield drift.

        A yielding branch ends only at a reversal.
        """
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        drift = law_state[block + rows.DRIFT, i]
        if event == rows.REVERSED:
            # Unload elastically, between the current drift and the yield drift of the other side.
            side = law_state[block + rows.RATE_SIGN, i]
            strengths = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i] + (
                1.0 - hardening
            ) * law_parameters[_NEGATIVE_YIELD_FORCE, i]
            opposite_yield = drift - side * strengths / ((1.0 - hardening) * k)
            law_state[block + rows.SLOPE, i] = k
            law_state[block + rows.RATE_SIGN, i] = 0.0
            law_state[block + rows.UPPER, i] = max(drift, opposite_yield)
            law_state[block + rows.LOWER, i] = min(drift, opposite_yield)
        else:
            # Yield in the direction of the event (ABOVE is 1, BELOW is -1).
            strength = (1.0 - hardening) * side_yield_force(law_parameters, i, event)
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


def _yield_drift(stiffness: float, values: Sequence[float]) -> float:
    """Return the smaller yield drift of both sides, m."""
    yield_force, _, negative_yield_force = values[:3]
    return min(yield_force, negative_yield_force) / stiffness


def _last_line(stiffness: float, values: Sequence[float], side: float) -> tuple[float, float]:
    """Return force at zero drift (N) and slope (N/m) of the line of yielding of a side."""
    yield_force, hardening, negative_yield_force = values[:3]
    force = (1.0 - hardening) * (yield_force if side > 0.0 else negative_yield_force)
    return force, hardening * stiffness


LAW = DriftLaw(
    "bilinear",
    "f = a k d + z, -(1 - a) Fy- <= z <= (1 - a) Fy+: yield forces Fy, kinematic hardening a",
    _functions,
    parameters=(
        LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
        LawParameter("hardening", low=-1.0, high=1.0, low_allowed=False, high_allowed=False),
        LawParameter(
            "yield_force",
            force=1,
            low=0.0,
            low_allowed=False,
            default="yield_force",
            group="negative",
        ),
    ),
    kinked=True,
    concave=True,
    equal_directions=lambda values: values[0] == values[2],
    yield_drift=_yield_drift,
    stiffness_after_yield=hardening_stiffness,
    last_line=_last_line,
)
