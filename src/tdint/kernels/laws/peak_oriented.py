"""Peak-oriented law: bilinear backbone curve with stiffness degradation by the maximum drifts.

It is the peak rule (`tdint.kernels.laws.peak_rule`) without pinching (Clough 1966), with the
unloading stiffness ku = k (dy / maximum drift)^unloading (Takeda, Sozen and Nielsen 1970).
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
from tdint.kernels.laws.peak_rule import backbone_curve, parameter, peak_law

# Rows of `law_parameters` with the parameters of the law: yield force (N), hardening ratio,
# exponent of the unloading stiffness.
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1
_EXPONENT = rows.FIRST_PARAMETER + 2


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline

    @inline
    def point_drift(law_parameters, i, side, j):
        """Return the yield drift, m; infinite after this point."""
        if j > 0:
            return math.inf
        return law_parameters[_YIELD_FORCE, i] / law_parameters[rows.STIFFNESS, i]

    @inline
    def point_force(law_parameters, i, side, j):
        """Return the yield force, N."""
        return law_parameters[_YIELD_FORCE, i]

    @inline
    def last_slope(law_parameters, i, side):
        """Return the stiffness after yield, N/m."""
        return law_parameters[_HARDENING, i] * law_parameters[rows.STIFFNESS, i]

    curve = backbone_curve(point_drift, point_force, last_slope, 1)
    return peak_law(curve, 1, parameter(_EXPONENT))


LAW = DriftLaw(
    "peak-oriented",
    "bilinear backbone; unloads with k (dy / dmax)^unloading, reloads towards the farthest point "
    "(Clough)",
    _functions,
    parameters=(
        LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
        LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
        LawParameter("unloading", low=0.0, high=1.0, high_allowed=False),
    ),
    kinked=True,
    equal_directions=lambda values: True,
    yield_drift=yields_at_its_strength,
    stiffness_after_yield=hardening_stiffness,
)
