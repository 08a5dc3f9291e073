"""The tanh law: elastic, softening towards a strength."""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inline

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        strength = law_parameters[rows.FIRST_PARAMETER, i]
        part = math.tanh(law_parameters[rows.STIFFNESS, i] * drift / strength)
        law_state[trial + rows.FORCE, i] = strength * part
        return law_parameters[rows.STIFFNESS, i] * (1.0 - part * part)

    @inline
    def strain_energy(law_parameters, law_state, i):
        strength = law_parameters[rows.FIRST_PARAMETER, i]
        x = abs(law_parameters[rows.STIFFNESS, i] * law_state[rows.DRIFT, i] / strength)
        # ln cosh x, without overflow
        return (
            strength
            * strength
            / law_parameters[rows.STIFFNESS, i]
            * (x + math.log1p(math.exp(-2.0 * x)) - math.log(2.0))
        )

    @inline
    def points(law_parameters, law_state, i, way):
        """Good to about 1e-10 of the strength: the poles of tanh x are i pi / 2 away."""
        return (
            3.0
            + 3.2
            * way
            * law_parameters[rows.STIFFNESS, i]
            / law_parameters[rows.FIRST_PARAMETER, i]
        )

    return LawFunctions(force=force, strain_energy=strain_energy, points=points)


LAW = DriftLaw(
    "tanh",
    "f = F tanh(k d / F): elastic, strength F",
    _functions,
    parameters=(LawParameter("strength", force=1, low=0.0, low_allowed=False),),
    curved=True,
)
