"""The tanh law: elastic, softening towards a strength."""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inlined

    @inlined
    def force(law_parameters, springs, i, past, trial, drift):
        strength = law_parameters[at.FIRST_PARAMETER, i]
        part = math.tanh(law_parameters[at.STIFFNESS, i] * drift / strength)
        springs[trial + at.FORCE, i] = strength * part
        return law_parameters[at.STIFFNESS, i] * (1.0 - part * part)

    @inlined
    def recoverable(law_parameters, springs, i):
        strength = law_parameters[at.FIRST_PARAMETER, i]
        x = abs(law_parameters[at.STIFFNESS, i] * springs[at.DRIFT, i] / strength)
        # ln cosh x, without overflow
        return (
            strength
            * strength
            / law_parameters[at.STIFFNESS, i]
            * (x + math.log1p(math.exp(-2.0 * x)) - math.log(2.0))
        )

    @inlined
    def points(law_parameters, springs, i, way):
        """Good to about 1e-10 of the strength: the poles of tanh x are i pi / 2 away."""
        return (
            3.0
            + 3.2 * way * law_parameters[at.STIFFNESS, i] / law_parameters[at.FIRST_PARAMETER, i]
        )

    return LawFunctions(force=force, recoverable=recoverable, points=points)


LAW = DriftLaw(
    "tanh",
    "f = F tanh(k d / F): elastic, strength F",
    _functions,
    parameters=(LawParameter("strength", force=1, low=0.0, low_allowed=False),),
    curved=True,
)
