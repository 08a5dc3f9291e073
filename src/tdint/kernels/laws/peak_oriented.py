"""The peak-oriented law: a bilinear backbone, and stiffness that degrades with the largest drifts.

Unloading goes down to zero force with k (dy / largest drift)^unloading (Takeda, Sozen and Nielsen
1970), reloading towards the farthest point of the other side (Clough 1966).

With hardening that line would at last pass zero drift, even the other side's yield point, and
unloading give back more than was put in. The stiffness is therefore at least

    F / dmax, that of the line from the farthest point to the origin, and
    k min(1, hardening / (1 - unloading / 2)).

Then no branch makes energy. While a side yields, what unloading would give back, E = F^2 / (2 ku),
grows by at most the work F dd: on the first bound E = F d / 2 and F' d <= F; on the second E' = F
F' / ku with F' = hardening k; otherwise E' = F (F' / ku + unloading F / (2 ku d)) <= F ((1 -
unloading / 2) + unloading / 2). And reloading from a zero that lies on the other side of the origin
is never stiffer than unloading.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Parameters
_YIELD_FORCE = at.FIRST_PARAMETER
_HARDENING = at.FIRST_PARAMETER + 1
_EXPONENT = at.FIRST_PARAMETER + 2  # of unloading

# Kinds of branches, in INTERNAL; negative on the negative side, 0 before the first yielding
_YIELDING = 1.0
_RELOADING = 2.0
_UNLOADING = 3.0


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import called, inlined
    from tdint.kernels.laws.walking import walking

    @inlined
    def unloading_stiffness(law_parameters, springs, i, block, side):
        """k (dy / |largest drift on that side|)^unloading, within its bounds."""
        k = law_parameters[at.STIFFNESS, i]
        strength = law_parameters[_YIELD_FORCE, i]
        hardening = law_parameters[_HARDENING, i]
        unloading = law_parameters[_EXPONENT, i]
        drift = springs[block + at.DRIFT, i]  # the farthest one where the story yields at present
        farthest = (
            max(springs[block + at.HIGH_DRIFT, i], drift)
            if side > 0.0
            else -min(springs[block + at.LOW_DRIFT, i], drift)
        )
        part = strength / (k * farthest)
        to_origin = hardening + (1.0 - hardening) * part
        return k * max(part**unloading, to_origin, min(hardening / (1.0 - 0.5 * unloading), 1.0))

    @inlined
    def recoverable(law_parameters, springs, i):
        force = springs[at.FORCE, i]
        return 0.5 * force * force / unloading_stiffness(law_parameters, springs, i, 0, force)

    @inlined
    def enter(law_parameters, springs, i):
        strength = law_parameters[_YIELD_FORCE, i]
        k = law_parameters[at.STIFFNESS, i]
        springs[at.HIGH_DRIFT, i] = springs[at.UPPER, i] = strength / k
        springs[at.LOW_DRIFT, i] = springs[at.LOWER, i] = -strength / k
        springs[at.HIGH_FORCE, i] = strength
        springs[at.LOW_FORCE, i] = -strength

    @called
    def switch(law_parameters, springs, i, block, event):
        kind = springs[block + at.INTERNAL, i]
        drift = springs[block + at.DRIFT, i]
        force = springs[block + at.FORCE, i]
        if event == at.TURNED:
            side = springs[block + at.TURN, i]
            if abs(kind) == _YIELDING:
                if side > 0.0:
                    springs[block + at.HIGH_DRIFT, i] = drift
                    springs[block + at.HIGH_FORCE, i] = force
                else:
                    springs[block + at.LOW_DRIFT, i] = drift
                    springs[block + at.LOW_FORCE, i] = force
            slope = unloading_stiffness(law_parameters, springs, i, block, side)
            zero = drift - force / slope
            springs[block + at.INTERNAL, i] = side * _UNLOADING
            springs[block + at.SLOPE, i] = slope
            springs[block + at.TURN, i] = 0.0
            springs[block + at.UPPER, i] = max(drift, zero)
            springs[block + at.LOWER, i] = min(drift, zero)
            return
        # The branch ended in the direction of `event`: load further on that side.
        target = (
            springs[block + at.HIGH_DRIFT, i] if event > 0.0 else springs[block + at.LOW_DRIFT, i]
        )
        target_force = (
            springs[block + at.HIGH_FORCE, i] if event > 0.0 else springs[block + at.LOW_FORCE, i]
        )
        springs[block + at.TURN, i] = event
        if event * (target - drift) > 1e-12 * abs(target):
            springs[block + at.INTERNAL, i] = event * _RELOADING
            springs[block + at.SLOPE, i] = (target_force - force) / (target - drift)
            springs[block + at.UPPER, i] = target if event > 0.0 else math.inf
            springs[block + at.LOWER, i] = target if event < 0.0 else -math.inf
        else:
            springs[block + at.INTERNAL, i] = event * _YIELDING
            springs[block + at.SLOPE, i] = (
                law_parameters[_HARDENING, i] * law_parameters[at.STIFFNESS, i]
            )
            springs[block + at.UPPER, i] = math.inf
            springs[block + at.LOWER, i] = -math.inf

    return walking(switch, recoverable, enter)


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
    apart=True,
    yield_drift=yields_at_its_strength,
)
