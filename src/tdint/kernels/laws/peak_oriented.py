"""Peak-oriented law: bilinear backbone curve with stiffness degradation by the maximum drifts.

The unloading stiffness is ku = k (dy / maximum drift)^unloading (Takeda, Sozen and Nielsen 1970).
Reloading is directed towards the point of maximum drift on the other side (Clough 1966).

Without bounds and with hardening, the unloading line would eventually cross zero drift, or even the
yield point of the other side, and unloading would release more energy than was stored. The
unloading stiffness is therefore at least

    F / dmax, the stiffness of the line from the point of maximum drift to the origin, and
    k min(1, hardening / (1 - unloading / 2)).

With these bounds no branch creates energy. During yielding, the energy that unloading would
release, E = F^2 / (2 ku), increases by at most the work F dd. At the first bound, E = F d / 2 and
F' d <= F. At the second bound, E' = F F' / ku with F' = hardening k. Otherwise E' = F (F' / ku +
unloading F / (2 ku d)) <= F ((1 - unloading / 2) + unloading / 2). Reloading from a zero crossing
on the other side of the origin is never stiffer than unloading.
"""

from __future__ import annotations

import math
from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import (
    DriftLaw,
    LawFunctions,
    LawParameter,
    hardening_stiffness,
    yields_at_its_strength,
)

# Rows of `law_parameters` with the parameters of the law: yield force (N), hardening ratio.
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1
_EXPONENT = rows.FIRST_PARAMETER + 2  # exponent of the unloading stiffness

# Types of branches in row INTERNAL of a peak-oriented law. The value is negative on the negative
# side, and 0 before the first yielding.
BACKBONE = 1.0
RELOADING = 2.0
UNLOADING = 3.0


def peak_oriented_switch(unloading_stiffness: Any, set_backbone: Any) -> Any:
    """Return the function `switch` of a law that reloads towards the maximum drift of a side.

    The branches follow each other in this order:

        1. After a reversal, the story unloads with the unloading stiffness. The branch is valid in
           both directions (RATE_SIGN 0), from the reversal to zero force.
        2. From either end of this branch, the story reloads in its direction of movement, towards
           the point of maximum drift of this side (rows HIGH_DRIFT to LOW_FORCE).
        3. From this point on, the story follows the backbone curve.

    `unloading_stiffness` is a function (law_parameters, law_state, i, block, side) -> N/m.
    `set_backbone` (law_parameters, law_state, i, block, side) sets the branch of the backbone curve
    at the current drift, with the type BACKBONE.
    """
    from tdint.kernels.compiling import outlined
    from tdint.kernels.laws.branch_following import set_branch

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows the current branch at a reversal or at its limit."""
        drift = law_state[block + rows.DRIFT, i]
        force = law_state[block + rows.FORCE, i]
        if event == rows.REVERSED:
            # A reversal on the backbone curve is the new point of maximum drift of its side.
            side = law_state[block + rows.RATE_SIGN, i]
            if abs(law_state[block + rows.INTERNAL, i]) == BACKBONE:
                row = rows.HIGH_DRIFT if side > 0.0 else rows.LOW_DRIFT
                law_state[block + row, i] = drift
                law_state[block + row + 1, i] = force
            slope = unloading_stiffness(law_parameters, law_state, i, block, side)
            zero_drift = drift - force / slope  # drift at zero force
            law_state[block + rows.INTERNAL, i] = side * UNLOADING
            set_branch(
                law_state, i, block, slope, min(drift, zero_drift), max(drift, zero_drift), 0.0
            )
            return
        # ABOVE is 1, BELOW is -1: loading continues on the side of `event`.
        row = rows.HIGH_DRIFT if event > 0.0 else rows.LOW_DRIFT
        target = law_state[block + row, i]
        # 1e-12 covers rounding errors.
        if event * (target - drift) > 1e-12 * abs(target):
            law_state[block + rows.INTERNAL, i] = event * RELOADING
            slope = (law_state[block + row + 1, i] - force) / (target - drift)
            upper = target if event > 0.0 else math.inf
            lower = target if event < 0.0 else -math.inf
            set_branch(law_state, i, block, slope, lower, upper, event)
        else:
            set_backbone(law_parameters, law_state, i, block, event)

    return switch


def _functions() -> LawFunctions:
    """Return the compiled functions of the peak-oriented law."""
    from tdint.kernels.compiling import inline
    from tdint.kernels.laws.branch_following import follow_branches, set_branch

    @inline
    def unloading_stiffness(law_parameters, law_state, i, block, side):
        """Return the unloading stiffness ku of a single side, N/m, with the lower bounds of the
        docstring of the module.
        """
        k = law_parameters[rows.STIFFNESS, i]
        strength = law_parameters[_YIELD_FORCE, i]
        hardening = law_parameters[_HARDENING, i]
        unloading = law_parameters[_EXPONENT, i]
        # While the story yields, the current drift is the maximum drift.
        drift = law_state[block + rows.DRIFT, i]
        max_drift = (
            max(law_state[block + rows.HIGH_DRIFT, i], drift)
            if side > 0.0
            else -min(law_state[block + rows.LOW_DRIFT, i], drift)
        )
        # dy / dmax, and F / (k dmax) with F = hardening k dmax + (1 - hardening) k dy
        drift_ratio = strength / (k * max_drift)
        to_origin = hardening + (1.0 - hardening) * drift_ratio
        return k * max(
            drift_ratio**unloading, to_origin, min(hardening / (1.0 - 0.5 * unloading), 1.0)
        )

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the stored energy F^2 / (2 ku), J, released by unloading from force F to zero."""
        force = law_state[rows.FORCE, i]
        return 0.5 * force * force / unloading_stiffness(law_parameters, law_state, i, 0, force)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the limits of the first branch, elastic between the two yield points, towards which
        reloading is directed as long as the story has not yielded.
        """
        strength = law_parameters[_YIELD_FORCE, i]
        k = law_parameters[rows.STIFFNESS, i]
        law_state[rows.HIGH_DRIFT, i] = law_state[rows.UPPER, i] = strength / k
        law_state[rows.LOW_DRIFT, i] = law_state[rows.LOWER, i] = -strength / k
        law_state[rows.HIGH_FORCE, i] = strength
        law_state[rows.LOW_FORCE, i] = -strength

    @inline
    def set_backbone(law_parameters, law_state, i, block, side):
        """Yield along the backbone curve."""
        law_state[block + rows.INTERNAL, i] = side * BACKBONE
        slope = law_parameters[_HARDENING, i] * law_parameters[rows.STIFFNESS, i]
        set_branch(law_state, i, block, slope, -math.inf, math.inf, side)

    switch = peak_oriented_switch(unloading_stiffness, set_backbone)
    return follow_branches(switch, strain_energy, enter)


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
    yield_drift=yields_at_its_strength,
    stiffness_after_yield=hardening_stiffness,
)
