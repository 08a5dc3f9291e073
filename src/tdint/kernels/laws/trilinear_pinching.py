"""Trilinear law with pinched reloading, for building types of regional studies.

The backbone curve of each side rises to the yield point, continues to the ultimate point and
remains constant at larger drifts. The unloading stiffness is k (dy / maximum drift)^unloading, down
to zero force. Reloading towards the point of maximum drift of the other side has two parts. The
first part is flatter and ends at the fraction `pinching` of the force at that point (Lu, McKenna,
Cheng, Xu, Zeng and Mahin 2020); pinching 1 is the rule of Clough (1966). It is the peak rule
(`tdint.kernels.laws.peak_rule`) with equal fractions of drift and force.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength
from tdint.kernels.laws.peak_rule import backbone_curve, parameter, peak_law

# Rows of `law_parameters` with the parameters of the law: forces (N), drift (m), fraction and
# exponent.
_YIELD_FORCE = rows.FIRST_PARAMETER
_ULTIMATE_FORCE = rows.FIRST_PARAMETER + 1
_ULTIMATE_DRIFT = rows.FIRST_PARAMETER + 2
_PINCHING = rows.FIRST_PARAMETER + 3
_UNLOADING_EXPONENT = rows.FIRST_PARAMETER + 4


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline

    @inline
    def point_drift(law_parameters, i, side, j):
        """Return the drift of the yield point and of the ultimate point, m; infinite after it."""
        if j == 0:
            return law_parameters[_YIELD_FORCE, i] / law_parameters[rows.STIFFNESS, i]
        return law_parameters[_ULTIMATE_DRIFT, i] if j == 1 else math.inf

    @inline
    def point_force(law_parameters, i, side, j):
        """Return the force of the yield point and of the ultimate point, N."""
        return law_parameters[_YIELD_FORCE if j == 0 else _ULTIMATE_FORCE, i]

    @inline
    def last_slope(law_parameters, i, side):
        """Return the slope beyond the ultimate point, 0."""
        return 0.0

    curve = backbone_curve(point_drift, point_force, last_slope, 2)
    return peak_law(curve, 2, parameter(_UNLOADING_EXPONENT), parameter(_PINCHING))


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return an error message if the ultimate point of the backbone curve is invalid, otherwise
    None.
    """
    strength, ultimate_force, ultimate_drift = values[:3]
    if ultimate_force < strength:
        return (
            f"ultimate_force must be at least yield_force, got {ultimate_force:.10g} N under "
            f"{strength:.10g} N"
        )
    if ultimate_drift <= strength / stiffness:
        return (
            f"ultimate_drift must be beyond the yield drift {strength / stiffness:.6g} m, got "
            f"{ultimate_drift:.10g} m"
        )
    if ultimate_force >= stiffness * ultimate_drift:
        return (
            "the ultimate point must lie below the line of the initial stiffness: ultimate_drift "
            f"beyond {ultimate_force / stiffness:.6g} m, got {ultimate_drift:.10g} m"
        )
    return None


def _slope_to_ultimate(stiffness: float, values: Sequence[float]) -> float:
    """Return the stiffness from the yield point to the ultimate point, N/m.

    It is 0 if the ultimate drift does not exceed the yield drift.
    """
    yield_force, ultimate_force, ultimate_drift = values[:3]
    drift = ultimate_drift - yield_force / stiffness
    return (ultimate_force - yield_force) / drift if drift > 0.0 else 0.0


LAW = DriftLaw(
    "trilinear-pinching",
    "backbone to (dy, Fy), (ultimate_drift, Fu), flat beyond; unloads with k (dy / "
    "dmax)^unloading, reloads pinched",
    _functions,
    parameters=(
        LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
        LawParameter("ultimate_force", force=1, low=0.0, low_allowed=False),
        LawParameter("ultimate_drift", length=1, low=0.0, low_allowed=False),
        LawParameter("pinching", low=0.0, high=1.0, low_allowed=False),
        LawParameter("unloading", low=0.0, high=1.0, high_allowed=False),
    ),
    kinked=True,
    equal_directions=lambda values: True,
    yield_drift=yields_at_its_strength,
    stiffness_after_yield=_slope_to_ultimate,
    fault=_fault,
)
