"""The gap law: elastic pounding against a stop on either side."""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter

# Parameters
_GAP = at.FIRST_PARAMETER
_STOP_STIFFNESS = at.FIRST_PARAMETER + 1


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import called, inlined
    from tdint.kernels.laws.walking import put_on_branch

    @inlined
    def force(law_parameters, springs, i, past, trial, drift):
        force = law_parameters[at.STIFFNESS, i] * drift
        tangent = law_parameters[at.STIFFNESS, i]
        beyond = abs(drift) - law_parameters[_GAP, i]
        if beyond > 0.0:
            force += math.copysign(law_parameters[_STOP_STIFFNESS, i] * beyond, drift)
            tangent += law_parameters[_STOP_STIFFNESS, i]
        springs[trial + at.FORCE, i] = force
        return tangent

    @inlined
    def recoverable(law_parameters, springs, i):
        d = springs[at.DRIFT, i]
        beyond = max(abs(d) - law_parameters[_GAP, i], 0.0)
        return (
            0.5 * law_parameters[at.STIFFNESS, i] * d * d
            + 0.5 * law_parameters[_STOP_STIFFNESS, i] * beyond * beyond
        )

    @called
    def go_to(law_parameters, springs, i, block, side):
        """Put story `i` into the gap (side 0) or against the stop on that side of it."""
        gap = law_parameters[_GAP, i]
        drift = springs[block + at.DRIFT, i]
        stop = abs(side) * law_parameters[_STOP_STIFFNESS, i]
        springs[block + at.FORCE, i] = law_parameters[at.STIFFNESS, i] * drift + stop * (
            drift - side * gap
        )
        lower = -math.inf if side < 0.0 else side * gap if side > 0.0 else -gap
        upper = math.inf if side > 0.0 else side * gap if side < 0.0 else gap
        put_on_branch(springs, i, block, law_parameters[at.STIFFNESS, i] + stop, lower, upper, 0.0)

    @inlined
    def enter(law_parameters, springs, i):
        drift = springs[at.DRIFT, i]
        inside = abs(drift) < law_parameters[_GAP, i]
        go_to(law_parameters, springs, i, 0, 0.0 if inside else math.copysign(1.0, drift))

    @inlined
    def switch(law_parameters, springs, i, block, event):
        inside = springs[block + at.UPPER, i] + springs[block + at.LOWER, i] == 0.0
        go_to(law_parameters, springs, i, block, event if inside else 0.0)

    return LawFunctions(force=force, recoverable=recoverable, enter=enter, switch=switch)


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
