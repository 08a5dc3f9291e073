"""Contact law of Hertz: the law `gap` with a force of the stops that grows with the power 1.5.

f = k d                                              for |d| <= gap
f = k d + stop_stiffness (|d| - gap)^1.5 sgn(d)      for |d| > gap

A coefficient of restitution e adds the damping of Hertz-damp (Muthukumar and DesRoches 2006) in a
link without k. With the approach velocity v, the drift rate r and zeta = 3 stop_stiffness (1 -
e^2) / (4 v),

f = stop_stiffness (|d| - gap)^1.5 sgn(d) + zeta (|d| - gap)^1.5 r

v is the absolute drift rate at the closing of each contact. The damping is a rate, as damping with
the tangent stiffness is: 3 (1 - e^2) / 4 (row TANGENT_DAMPING of the linear terms) over v, times
the rate of the strain energy. Row INTERNAL of the law state contains 1 / v
(`tdint.kernels.stories.impact`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tdint.kernels.laws import gap
from tdint.kernels.laws.law import LawFunctions, LawParameter


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    return gap.contact_functions(is_hertz=True)


def _impact_damping(values: Sequence[float], mass: float) -> float:
    """Return zeta v / stop_stiffness, without unit."""
    return 0.75 * (1.0 - values[3] ** 2)


_GAP, _, _SIDES, _, _RESTITUTION = gap.LAW.parameters

LAW = replace(
    gap.LAW,
    name="hertz",
    formula="f = k d, beyond the gap stop_stiffness (|d| - gap)^1.5 more: contact of Hertz with a "
    "stop on either side, or on one of the `sides`",
    functions=_functions,
    parameters=(
        _GAP,
        LawParameter("stop_stiffness", force=1, length=-1.5, low=0.0),
        _SIDES,
        _RESTITUTION,
    ),
    curved=True,
    tangent_damping=_impact_damping,
    stop_exponent=1.5,
    largest_stiffness=None,
)
