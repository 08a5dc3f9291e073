"""Gap law: elastic pounding against a stop on each side, or on one side.

f = k d                                        for |d| <= gap
f = k d + stop_stiffness (|d| - gap) sgn(d)    for |d| > gap

The dashpot of a contact (Kelvin) adds the force c times the drift rate while |d| > gap. It is
damping with the tangent stiffness (row TANGENT_DAMPING of the linear terms, with c over
stop_stiffness), because the tangent stiffness is that of the stop in contact, and otherwise zero.

The law `hertz` has the same functions with the force of a stop stop_stiffness (|d| - gap)^1.5
(`tdint.kernels.laws.hertz`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import SIDES, DriftLaw, LawFunctions, LawParameter

# Rows of `law_parameters` with the parameters of the law: gap (m), stiffness of the stops (N/m),
# index in `SIDES`.
_GAP = rows.FIRST_PARAMETER
_STOP_STIFFNESS = rows.FIRST_PARAMETER + 1
_SIDES = rows.FIRST_PARAMETER + 2


def contact_functions(is_hertz: bool = False) -> LawFunctions:
    """Return the compiled functions of the gap law, or of the law `hertz`.

    f = k d for |d| <= gap, and f = k d + s sgn(d) in contact with a stop: force f, drift d, initial
    stiffness k. The force s of the stop is stop_stiffness (|d| - gap), or for the law `hertz`
    stop_stiffness (|d| - gap)^1.5.
    """
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import set_branch

    @inline
    def gap_of(law_parameters, i, side):
        """Return the gap of a side, m; infinite without a stop."""
        sides = law_parameters[_SIDES, i]
        has_stop = sides == 0.0 or (sides == 1.0) == (side > 0.0)
        return law_parameters[_GAP, i] if has_stop else math.inf

    @inline
    def stop(law_parameters, i, penetration):
        """Return force (N) and tangent stiffness (N/m) of a stop at a positive penetration, m."""
        stiffness = law_parameters[_STOP_STIFFNESS, i]
        if is_hertz:
            secant = stiffness * math.sqrt(penetration)
            return secant * penetration, 1.5 * secant
        return stiffness * penetration, stiffness

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force f at the drift d; return the tangent stiffness, N/m."""
        force = law_parameters[rows.STIFFNESS, i] * drift
        tangent = law_parameters[rows.STIFFNESS, i]
        penetration = abs(drift) - gap_of(law_parameters, i, drift)
        if penetration > 0.0:
            stop_force, stop_stiffness = stop(law_parameters, i, penetration)
            force += math.copysign(stop_force, drift)
            tangent += stop_stiffness
        law_state[trial + rows.FORCE, i] = force
        if is_hertz:
            law_state[trial + rows.INTERNAL, i] = law_state[previous + rows.INTERNAL, i]
        return tangent

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the elastic energy of the committed state with the drift d, J.

        It is k d^2 / 2 plus, in contact with a stop, the work of its force: the force times |d| -
        gap, over 2, or for the law `hertz` over 2.5.
        """
        d = law_state[rows.DRIFT, i]
        penetration = max(abs(d) - gap_of(law_parameters, i, d), 0.0)
        stop_force, _ = stop(law_parameters, i, penetration)
        work = (0.4 if is_hertz else 0.5) * stop_force * penetration
        return 0.5 * law_parameters[rows.STIFFNESS, i] * d * d + work

    @outlined
    def set_contact(law_parameters, law_state, i, block, side):
        """Set force and branch of a law state within the gap (`side` 0) or in contact with the stop
        of a side. In contact, the branch of the law `hertz` is curved.
        """
        gap = law_parameters[_GAP, i]
        drift = law_state[block + rows.DRIFT, i]
        stiffness = law_parameters[rows.STIFFNESS, i]
        # In contact, the branch is limited by the stop on one side only; within the gap, by both
        # stops. It is valid for both signs of the drift rate (0), because the law is elastic.
        lower, upper = -gap_of(law_parameters, i, -1.0), gap_of(law_parameters, i, 1.0)
        if side > 0.0:
            lower, upper = gap, math.inf
        elif side < 0.0:
            lower, upper = -math.inf, -gap
        if is_hertz:
            stop_force, _ = stop(law_parameters, i, max(side * drift - gap, 0.0))
            law_state[block + rows.FORCE, i] = stiffness * drift + side * stop_force
            slope = stiffness if side == 0.0 else math.inf
        else:
            stop_stiffness = abs(side) * law_parameters[_STOP_STIFFNESS, i]
            law_state[block + rows.FORCE, i] = stiffness * drift + stop_stiffness * (
                drift - side * gap
            )
            slope = stiffness + stop_stiffness
        set_branch(law_state, i, block, slope, lower, upper, 0.0)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the branch of the committed state: within the gap (|d| < gap), or in contact with a
        stop. At |d| = gap, both branches have the same force; the branch in contact is set.
        """
        drift = law_state[rows.DRIFT, i]
        is_within_gap = abs(drift) < gap_of(law_parameters, i, drift)
        side = 0.0 if is_within_gap else math.copysign(1.0, drift)
        set_contact(law_parameters, law_state, i, 0, side)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows the current branch at the drift of a stop.

        From the gap, it is the contact with the stop on the side of the event (ABOVE or BELOW);
        from a contact, it is the gap. The event REVERSED cannot occur, because all branches are
        valid for both signs of the drift rate.
        """
        # The events ABOVE and BELOW are 1 and -1, the sides of the stops. The gap ends at a stop on
        # the side of the event; a contact ends at the stop on the other side of zero drift.
        row = rows.UPPER if event > 0.0 else rows.LOWER
        is_within_gap = event * law_state[block + row, i] > 0.0
        set_contact(law_parameters, law_state, i, block, event if is_within_gap else 0.0)

    return LawFunctions(force=force, strain_energy=strain_energy, enter=enter, switch=switch)


def contact_fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return the message for a dashpot that cannot act in contact only; the law `hertz` has no
    `dashpot`."""
    dashpot, restitution = (0.0, *values[3:])[-2:]
    if dashpot == 0.0 and restitution == 1.0:
        return None
    if dashpot != 0.0 and restitution != 1.0:
        return "give either dashpot or restitution, not both"
    if stiffness != 0.0 or values[1] == 0.0:
        return (
            "a dashpot or a restitution acts in contact only; use it in a link without `stiffness` "
            "and with a positive stop_stiffness"
        )
    return None


def _contact_damping(values: Sequence[float], mass: float) -> float:
    """Return the coefficient of the dashpot that acts in contact over the stiffness of the stop, s.

    A coefficient of restitution e replaces it by 2 xi sqrt(k m) with xi = -ln e / sqrt(pi^2 +
    ln^2 e) (Anagnostopoulos 1988), the stiffness k of the stop and the mass m = m1 m2 / (m1 + m2)
    of both bodies, kg.
    """
    _, stop_stiffness, _, dashpot, restitution = values
    if dashpot == 0.0 and restitution == 1.0:
        return 0.0
    decrement = -math.log(restitution)
    ratio = decrement / math.hypot(math.pi, decrement)
    return (dashpot + 2.0 * ratio * math.sqrt(stop_stiffness * mass)) / stop_stiffness


LAW = DriftLaw(
    "gap",
    "f = k d, beyond the gap stop_stiffness (|d| - gap) more: elastic pounding against a stop on "
    "either side, or on one of the `sides`",
    contact_functions,
    parameters=(
        LawParameter("gap", length=1, low=0.0, low_allowed=False),
        LawParameter("stop_stiffness", force=1, length=-1, low=0.0),
        LawParameter("sides", choices=SIDES, default="both"),
        LawParameter("dashpot", force=1, length=-1, low=0.0, default=0.0),
        LawParameter("restitution", low=0.0, low_allowed=False, high=1.0, default=1.0),
    ),
    fault=contact_fault,
    kinked=True,
    tangent_damping=_contact_damping,
    stops=lambda values: (
        0.0 if SIDES[int(values[2])] == "negative" else values[0],
        0.0 if SIDES[int(values[2])] == "positive" else values[0],
        values[1],
    ),
    stiffens=lambda values: values[1] > 0.0,
    symmetric=lambda values: values[2] == 0.0,
    largest_stiffness=lambda stiffness, values: stiffness + values[1],
)
