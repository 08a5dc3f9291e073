"""The gap law: elastic pounding against a stop on either side."""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter

# Parameters
_GAP = rows.FIRST_PARAMETER
_STOP_STIFFNESS = rows.FIRST_PARAMETER + 1


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import set_branch

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        force = law_parameters[rows.STIFFNESS, i] * drift
        tangent = law_parameters[rows.STIFFNESS, i]
        beyond = abs(drift) - law_parameters[_GAP, i]
        if beyond > 0.0:
            force += math.copysign(law_parameters[_STOP_STIFFNESS, i] * beyond, drift)
            tangent += law_parameters[_STOP_STIFFNESS, i]
        law_state[trial + rows.FORCE, i] = force
        return tangent

    @inline
    def strain_energy(law_parameters, law_state, i):
        d = law_state[rows.DRIFT, i]
        beyond = max(abs(d) - law_parameters[_GAP, i], 0.0)
        return (
            0.5 * law_parameters[rows.STIFFNESS, i] * d * d
            + 0.5 * law_parameters[_STOP_STIFFNESS, i] * beyond * beyond
        )

    @outlined
    def go_to(law_parameters, law_state, i, block, side):
        """Put story `i` into the gap (side 0) or against the stop on that side of it."""
        gap = law_parameters[_GAP, i]
        drift = law_state[block + rows.DRIFT, i]
        stop = abs(side) * law_parameters[_STOP_STIFFNESS, i]
        law_state[block + rows.FORCE, i] = law_parameters[rows.STIFFNESS, i] * drift + stop * (
            drift - side * gap
        )
        lower = -math.inf if side < 0.0 else side * gap if side > 0.0 else -gap
        upper = math.inf if side > 0.0 else side * gap if side < 0.0 else gap
        set_branch(law_state, i, block, law_parameters[rows.STIFFNESS, i] + stop, lower, upper, 0.0)

    @inline
    def enter(law_parameters, law_state, i):
        drift = law_state[rows.DRIFT, i]
        inside = abs(drift) < law_parameters[_GAP, i]
        go_to(law_parameters, law_state, i, 0, 0.0 if inside else math.copysign(1.0, drift))

    @inline
    def switch(law_parameters, law_state, i, block, event):
        inside = law_state[block + rows.UPPER, i] + law_state[block + rows.LOWER, i] == 0.0
        go_to(law_parameters, law_state, i, block, event if inside else 0.0)

    return LawFunctions(force=force, strain_energy=strain_energy, enter=enter, switch=switch)


LAW = DriftLaw(
    "gap",
    "f = k d, beyond the gap stop_stiffness (|d| - gap) more: elastic pounding against a stop on "
    "either side",
    _functions,
    parameters=(
        LawParameter("gap", length=1, low=0.0, low_allowed=False),
        LawParameter("stop_stiffness", force=1, length=-1, low=0.0),
    ),
    kinked=True,
    stiffens=lambda values: values[1] > 0.0,
)
