"""Bilinear law with kinematic hardening.

    f = a k d + z,   dz = (1 - a) k dd,   |z| <= (1 - a) Fy

with the force f, the drift d, the initial stiffness k, the yield force Fy and the hardening ratio
a. The law is the sum of two parallel springs: an elastic spring with the stiffness a k, and an
elastic-perfectly plastic spring with the force z, which row INTERNAL of the law state contains. The
second spring yields at the drift Fy / k, as the story does.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Rows of `law_parameters` with the parameters of this law: yield force (N), hardening ratio.
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1


def _functions() -> LawFunctions:
    """Return the compiled functions of the bilinear law with kinematic hardening.

    f = a k d + z with |z| <= (1 - a) Fy: force f, drift d, initial stiffness k, hardening ratio a,
    yield force Fy, force z of the plastic spring (row INTERNAL). The bounds of the parameters
    exclude a = 1, so that a division by 1 - a is possible.
    """
    from tdint.kernels.compiling import inline

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force f = a k d + z at the drift d; return the tangent stiffness, N/m.

        k is the initial stiffness, a the hardening ratio and Fy the yield force. The force z of the
        plastic spring (row INTERNAL) changes by (1 - a) k times the change of drift and is limited
        to (1 - a) Fy. FORCE and INTERNAL are written to block `trial`; the caller writes DRIFT. The
        tangent is k, or a k if the story yields.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the hysteretic laws: one row per quantity, one column per
            story.
        i : int
            Index of the story.
        previous : int
            First row of the block of `law_state` with the state at the start of the path.
        trial : int
            First row of the block of `law_state` with the state at the end of the path.
        drift : float
            Drift, m.
        """
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        # Predict the force of the plastic spring elastically, then limit it to the strength.
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
        """Return the elastic energy of both springs, J.

        The law consists of two parallel springs, with the initial stiffness k, the hardening ratio
        a, the drift d and the force z of the plastic spring (row INTERNAL):

            elastic spring     stiffness a k          energy a k d^2 / 2
            plastic spring     stiffness (1 - a) k    energy z^2 / (2 (1 - a) k)

        Column `i` of the tables `law_parameters` and `law_state` contains parameters and states of
        story `i`.
        """
        d = law_state[rows.DRIFT, i]
        z = law_state[rows.INTERNAL, i]
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        return 0.5 * hardening * k * d * d + 0.5 * z * z / ((1.0 - hardening) * k)

    @inline
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        """Compute the energy dissipated until the state in block `trial`, J.

        A path that ends at the strength (1 - a) Fy of the plastic spring dissipates its force |z|
        times the plastic part of the change of drift, dd - dz / ((1 - a) k), with the changes dd of
        the drift and dz of the force z, the hardening ratio a and the stiffness k. The energy of
        the path plus DISSIPATED of block `previous` is stored in row DISSIPATED of block `trial`.
        Both blocks already contain DRIFT and INTERNAL.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the hysteretic laws: one row per quantity, one column per
            story.
        i : int
            Index of the story.
        previous : int
            First row of the block of `law_state` with the state at the start of the path.
        trial : int
            First row of the block of `law_state` with the state at the end of the path.
        """
        law_state[trial + rows.DISSIPATED, i] = law_state[previous + rows.DISSIPATED, i]
        z = law_state[trial + rows.INTERNAL, i]
        plastic_share = 1.0 - law_parameters[_HARDENING, i]
        # The path was elastic unless z is exactly equal to the strength, to which `force` limits
        # it.
        if abs(z) == plastic_share * law_parameters[_YIELD_FORCE, i]:
            drift_change = law_state[trial + rows.DRIFT, i] - law_state[previous + rows.DRIFT, i]
            # The plastic part of the change of drift is the change minus its elastic part.
            plastic_change = drift_change - (z - law_state[previous + rows.INTERNAL, i]) / (
                plastic_share * law_parameters[rows.STIFFNESS, i]
            )
            law_state[trial + rows.DISSIPATED, i] += abs(z * plastic_change)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the limits of the elastic branch of the committed state: its two yield drifts.

        At a yield drift, the plastic spring with the force z (row INTERNAL) reaches its strength.
        With the current drift d, the hardening ratio a, the yield force Fy and the initial
        stiffness k, the limits are

            UPPER    d + ((1 - a) Fy - z) / ((1 - a) k)
            LOWER    d - ((1 - a) Fy + z) / ((1 - a) k)

        Column `i` of `law_parameters` contains the parameters of the story. The committed state, in
        the first rows of column `i` of `law_state`, is changed.
        """
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
        """Update INTERNAL or DISSIPATED in `block` after a change of drift along one branch.

        The caller has already set DRIFT and FORCE to their values at the end of the path. The force
        of the story is f = a k d + z, with the hardening ratio a, the initial stiffness k, the
        drift d and the force z of the plastic spring, row INTERNAL. On an elastic branch
        (RATE_SIGN 0), z = f - a k d. On a yielding branch, z is constant and the dissipated energy
        increases by |z| times the absolute change of drift.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the hysteretic laws: one row per quantity, one column per
            story.
        i : int
            Index of the story.
        block : int
            First row of the state in `law_state`: 0 for the committed state (the end of the last
            step or substep), otherwise the first row of a trial state.
        step : float
            Change of drift, m.
        mean_force : float
            Mean force on the path, N; not used by this law.
        """
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

        The force is f = a k d + z with |z| <= (1 - a) Fy: hardening ratio a, initial stiffness k,
        drift d, force z of the plastic spring (row INTERNAL) and yield force Fy. After a reversal,
        the story is elastic until it yields on the other side, at a drift that differs by 2 Fy / k.
        A yielding branch has the stiffness a k and ends at a reversal.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the hysteretic laws: one row per quantity, one column per
            story.
        i : int
            Index of the story.
        block : int
            First row of the state in `law_state`: 0 for the committed state (the end of the last
            step or substep), otherwise the first row of a trial state.
        event : float
            Reason for the end of the branch: ABOVE or BELOW (the drift exceeds the upper limit or
            falls below the lower limit) or REVERSED (the drift rate changes its sign).
        """
        k = law_parameters[rows.STIFFNESS, i]
        hardening = law_parameters[_HARDENING, i]
        strength = (1.0 - hardening) * law_parameters[_YIELD_FORCE, i]
        drift = law_state[block + rows.DRIFT, i]
        if event == rows.REVERSED:
            # Unload elastically, between the current drift and the yield drift of the other side.
            # Their distance is 2 Fy / k, and `strength` is (1 - a) Fy.
            side = law_state[block + rows.RATE_SIGN, i]
            opposite_yield = drift - side * 2.0 * strength / ((1.0 - hardening) * k)
            law_state[block + rows.SLOPE, i] = k
            law_state[block + rows.RATE_SIGN, i] = 0.0
            law_state[block + rows.UPPER, i] = max(drift, opposite_yield)
            law_state[block + rows.LOWER, i] = min(drift, opposite_yield)
        else:
            # Yield in the direction of the event (ABOVE is 1, BELOW is -1).
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
