"""Hyperbolic-tangent elastic law that softens towards a strength F, f = F tanh(k d / F)."""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter


def _functions() -> LawFunctions:
    """Return the compiled functions of the law f = F tanh(k d / F).

    f is the force, d the drift, k the initial stiffness and F the strength.
    """
    from tdint.kernels.compiling import inline

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force F tanh(k d / F) at the drift d; return the tangent stiffness, N/m.

        F is the strength and k the initial stiffness. The tangent is k (1 - tanh^2(k d / F)).
        """
        strength = law_parameters[rows.FIRST_PARAMETER, i]
        ratio = math.tanh(law_parameters[rows.STIFFNESS, i] * drift / strength)
        law_state[trial + rows.FORCE, i] = strength * ratio
        return law_parameters[rows.STIFFNESS, i] * (1.0 - ratio * ratio)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the elastic energy F^2 / k ln cosh(k d / F) of the committed state, J.

        F is the strength (N), k the initial stiffness (N/m) and d the drift (m).
        """
        strength = law_parameters[rows.FIRST_PARAMETER, i]
        k = law_parameters[rows.STIFFNESS, i]
        x = abs(k * law_state[rows.DRIFT, i] / strength)
        # ln cosh x = x + ln(1 + exp(-2 x)) - ln 2 does not overflow.
        logarithm = x + math.log1p(math.exp(-2.0 * x)) - math.log(2.0)
        return strength * strength / k * logarithm

    @inline
    def points(law_parameters, law_state, i, drift_change):
        """Return the number of Gauss points that integrate the force over a path with an error of
        about 1e-10 of the strength.

        The force is F tanh(x) with x = k d / F: strength F, initial stiffness k and drift d. The
        number, 3 + 3.2 times the absolute change of x along the path, is not an integer; the caller
        rounds it up. It increases with the change of x because tanh has poles near the real axis,
        at x = +-i pi / 2, which limit the convergence of the Gauss rule.

        `drift_change` is the absolute change of drift along the path, m.
        """
        k, strength = law_parameters[rows.STIFFNESS, i], law_parameters[rows.FIRST_PARAMETER, i]
        return 3.0 + 3.2 * drift_change * k / strength

    return LawFunctions(force=force, strain_energy=strain_energy, points=points)


LAW = DriftLaw(
    "tanh",
    "f = F tanh(k d / F): elastic, strength F",
    _functions,
    parameters=(LawParameter("strength", force=1, low=0.0, low_allowed=False),),
    curved=True,
    concave=True,
    equal_directions=lambda values: True,
    stiffness_after_yield=lambda stiffness, values: 0.0,
)
