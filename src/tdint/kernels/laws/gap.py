"""Gap law: elastic pounding against a stop on each side, or on one side.

f = k d                                        for |d| <= gap
f = k d + stop_stiffness (|d| - gap) sgn(d)    for |d| > gap

The dashpot of a contact (Kelvin) adds the force c times the drift rate while |d| > gap. It is
damping with the tangent stiffness (row TANGENT_DAMPING of the linear terms, with c over
stop_stiffness), because the tangent stiffness is that of the stop in contact, and otherwise zero.
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


def _functions() -> LawFunctions:
    """Return the compiled functions of the gap law.

    f = k d for |d| <= gap, and f = k d + stop_stiffness (|d| - gap) sgn(d) in contact with a stop:
    force f, drift d, initial stiffness k.
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
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force f at the drift d; return the tangent stiffness, N/m.

        f = k d for |d| <= gap, and f = k d + stop_stiffness (|d| - gap) sgn(d) in contact with a
        stop.
        """
        force = law_parameters[rows.STIFFNESS, i] * drift
        tangent = law_parameters[rows.STIFFNESS, i]
        penetration = abs(drift) - gap_of(law_parameters, i, drift)
        if penetration > 0.0:
            force += math.copysign(law_parameters[_STOP_STIFFNESS, i] * penetration, drift)
            tangent += law_parameters[_STOP_STIFFNESS, i]
        law_state[trial + rows.FORCE, i] = force
        return tangent

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the elastic energy of the committed state with the drift d, J.

        It is k d^2 / 2 plus, in contact with a stop, stop_stiffness (|d| - gap)^2 / 2.
        """
        d = law_state[rows.DRIFT, i]
        penetration = max(abs(d) - gap_of(law_parameters, i, d), 0.0)
        return (
            0.5 * law_parameters[rows.STIFFNESS, i] * d * d
            + 0.5 * law_parameters[_STOP_STIFFNESS, i] * penetration * penetration
        )

    @outlined
    def set_contact(law_parameters, law_state, i, block, side):
        """Set force and branch of a law state within the gap or in contact with a stop.

        With the drift d and the initial stiffness k, force and stiffness of the branch are

            within the gap    k d                                      k
            in contact        k d + stop_stiffness (d - side gap)      k + stop_stiffness
        """
        gap = law_parameters[_GAP, i]
        drift = law_state[block + rows.DRIFT, i]
        stop_stiffness = abs(side) * law_parameters[_STOP_STIFFNESS, i]
        stiffness = law_parameters[rows.STIFFNESS, i]
        law_state[block + rows.FORCE, i] = stiffness * drift + stop_stiffness * (drift - side * gap)
        # In contact, the branch is limited by the stop on one side only; within the gap, by both
        # stops. It is valid for both signs of the drift rate (0), because the law is elastic.
        lower, upper = -gap_of(law_parameters, i, -1.0), gap_of(law_parameters, i, 1.0)
        if side > 0.0:
            lower, upper = gap, math.inf
        elif side < 0.0:
            lower, upper = -math.inf, -gap
        set_branch(law_state, i, block, stiffness + stop_stiffness, lower, upper, 0.0)

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


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return the message for a dashpot that cannot act in contact only."""
    _, stop_stiffness, _, dashpot, restitution = values
    if dashpot == 0.0 and restitution == 1.0:
        return None
    if dashpot != 0.0 and restitution != 1.0:
        return "give either dashpot or restitution, not both"
    if stiffness != 0.0 or stop_stiffness == 0.0:
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
    _functions,
    parameters=(
        LawParameter("gap", length=1, low=0.0, low_allowed=False),
        LawParameter("stop_stiffness", force=1, length=-1, low=0.0),
        LawParameter("sides", choices=SIDES, default="both"),
        LawParameter("dashpot", force=1, length=-1, low=0.0, default=0.0),
        LawParameter("restitution", low=0.0, low_allowed=False, high=1.0, default=1.0),
    ),
    fault=_fault,
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
