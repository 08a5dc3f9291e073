"""The trilinear law with pinched reloading, for building types of regional studies.

The backbone of each side rises to the yield point, on to the ultimate point, and stays there.
Unloading goes down to zero force with k (dy / largest drift)^unloading; reloading towards the
farthest point of the other side in two parts, of which the first, flatter one ends at the part
`pinching` of the force (Lu, McKenna, Cheng, Xu, Zeng and Mahin 2020; pinching 1 is Clough's rule of
1966). No reloading is stiffer than unloading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Parameters
_YIELD_FORCE = rows.FIRST_PARAMETER
_ULTIMATE_FORCE = rows.FIRST_PARAMETER + 1
_ULTIMATE_DRIFT = rows.FIRST_PARAMETER + 2
_PINCHING = rows.FIRST_PARAMETER + 3
_UNLOADING = rows.FIRST_PARAMETER + 4

# The drift at the last passage of zero force: the forces of the farthest points are the backbone's
_ZERO = rows.HIGH_FORCE

# Kinds of branches, in INTERNAL; negative on the negative side, 0 before the first yielding
_YIELDING = 1.0  # on the backbone
_PINCHED = 2.0  # the first part of the reloading
_RELOADING = 3.0  # the second one
_GLIDING = 4.0  # with the unloading stiffness, down and up

_HERE = 1e-12  # over a drift: what lies no farther ahead is reached


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import follow_branches

    @inline
    def hardening(law_parameters, i):
        """Slope of the backbone between the yield and the ultimate point, N/m."""
        strength = law_parameters[_YIELD_FORCE, i]
        return (law_parameters[_ULTIMATE_FORCE, i] - strength) / (
            law_parameters[_ULTIMATE_DRIFT, i] - strength / law_parameters[rows.STIFFNESS, i]
        )

    @inline
    def backbone(law_parameters, i, drift):
        """Force of the backbone at a drift beyond the yield drift."""
        strength = law_parameters[_YIELD_FORCE, i]
        if drift >= law_parameters[_ULTIMATE_DRIFT, i]:
            return law_parameters[_ULTIMATE_FORCE, i]
        return strength + hardening(law_parameters, i) * (
            drift - strength / law_parameters[rows.STIFFNESS, i]
        )

    @inline
    def farthest(law_state, i, block, side):
        """The farthest drift on a side, the present one included; positive on either side."""
        reached = (
            law_state[block + rows.HIGH_DRIFT, i]
            if side > 0.0
            else -law_state[block + rows.LOW_DRIFT, i]
        )
        if law_state[block + rows.INTERNAL, i] == side * _YIELDING:
            reached = max(reached, side * law_state[block + rows.DRIFT, i])
        return reached

    @outlined
    def unloading_stiffness(law_parameters, law_state, i, block, side):
        k = law_parameters[rows.STIFFNESS, i]
        return (
            k
            * (law_parameters[_YIELD_FORCE, i] / (k * farthest(law_state, i, block, side)))
            ** law_parameters[_UNLOADING, i]
        )

    @inline
    def lead(law_state, i, block, side, kind, slope, end, turn):
        """Put the story on a branch that ends at `end` ahead on that side, and does not hold
        backwards where it turns."""
        law_state[block + rows.INTERNAL, i] = side * kind
        law_state[block + rows.SLOPE, i] = slope
        law_state[block + rows.RATE_SIGN, i] = turn
        law_state[block + rows.UPPER, i] = end if side > 0.0 else math.inf
        law_state[block + rows.LOWER, i] = -end if side < 0.0 else -math.inf

    @inline
    def glide(law_parameters, law_state, i, block, side, slope, end):
        """The line of the unloading stiffness through the present point, from zero force up to
        `end`."""
        zero = law_state[block + rows.DRIFT, i] - law_state[block + rows.FORCE, i] / slope
        lead(law_state, i, block, side, _GLIDING, slope, end, 0.0)
        if side > 0.0:
            law_state[block + rows.LOWER, i] = zero
        else:
            law_state[block + rows.UPPER, i] = zero

    @inline
    def end_of_pinching(law_parameters, law_state, i, block, side, target, force, slope):
        """Drift at which the first part of the reloading ends, on that side."""
        zero = side * law_state[block + _ZERO, i]
        pinching = law_parameters[_PINCHING, i]
        return zero + pinching * (target - (1.0 - pinching) * force / slope - zero)

    @outlined
    def load(law_parameters, law_state, i, block, side):
        """Further on that side from a point of the reloading or of the backbone."""
        drift = side * law_state[block + rows.DRIFT, i]
        here = side * law_state[block + rows.FORCE, i]
        target = farthest(law_state, i, block, side)
        if drift < target * (1.0 - _HERE):
            force = backbone(law_parameters, i, target)
            slope = unloading_stiffness(law_parameters, law_state, i, block, side)
            bend = end_of_pinching(law_parameters, law_state, i, block, side, target, force, slope)
            if drift < bend - _HERE * target:
                to_bend = (law_parameters[_PINCHING, i] * force - here) / (bend - drift)
                lead(law_state, i, block, side, _PINCHED, to_bend, bend, side)
            else:
                lead(
                    law_state,
                    i,
                    block,
                    side,
                    _RELOADING,
                    (force - here) / (target - drift),
                    target,
                    side,
                )
        else:
            law_state[block + rows.FORCE, i] = side * backbone(law_parameters, i, drift)
            ultimate = law_parameters[_ULTIMATE_DRIFT, i]
            if drift < ultimate * (1.0 - _HERE):
                lead(
                    law_state,
                    i,
                    block,
                    side,
                    _YIELDING,
                    hardening(law_parameters, i),
                    ultimate,
                    side,
                )
            else:
                lead(law_state, i, block, side, _YIELDING, 0.0, math.inf, side)

    @outlined
    def cross(law_parameters, law_state, i, block, side):
        """Zero force is passed towards a side: load there, not stiffer than with its unloading
        stiffness."""
        zero = side * law_state[block + rows.DRIFT, i]
        law_state[block + rows.FORCE, i] = 0.0
        law_state[block + _ZERO, i] = law_state[block + rows.DRIFT, i]
        target = farthest(law_state, i, block, side)
        force = backbone(law_parameters, i, target)
        slope = unloading_stiffness(law_parameters, law_state, i, block, side)
        bend = end_of_pinching(law_parameters, law_state, i, block, side, target, force, slope)
        part = law_parameters[_PINCHING, i] * force
        if bend > zero + _HERE * target and part <= slope * (bend - zero) and zero < target:
            load(law_parameters, law_state, i, block, side)
            return
        # Up with the unloading stiffness to where that meets the second part, or behind that the
        # backbone
        meeting = math.inf
        if target > bend:
            second = (force - part) / (target - bend)
            if slope > second:
                meeting = (part - second * bend + slope * zero) / (slope - second)
        if meeting > target or meeting < max(bend, zero):
            rise = hardening(law_parameters, i)
            meeting = zero + law_parameters[_ULTIMATE_FORCE, i] / slope
            if slope > rise:
                strength = law_parameters[_YIELD_FORCE, i]
                bent = (
                    strength - rise * strength / law_parameters[rows.STIFFNESS, i] + slope * zero
                ) / (slope - rise)
                meeting = (
                    min(bent, meeting) if bent < law_parameters[_ULTIMATE_DRIFT, i] else meeting
                )
        glide(law_parameters, law_state, i, block, side, slope, meeting)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        kind = law_state[block + rows.INTERNAL, i]
        if kind == 0.0:
            load(law_parameters, law_state, i, block, event)
        elif event == rows.REVERSED:
            side = law_state[block + rows.RATE_SIGN, i]
            if side > 0.0:
                law_state[block + rows.HIGH_DRIFT, i] = farthest(law_state, i, block, side)
            else:
                law_state[block + rows.LOW_DRIFT, i] = -farthest(law_state, i, block, side)
            slope = unloading_stiffness(law_parameters, law_state, i, block, side)
            glide(
                law_parameters,
                law_state,
                i,
                block,
                side,
                slope,
                side * law_state[block + rows.DRIFT, i],
            )
        elif abs(kind) == _GLIDING and event * kind < 0.0:
            cross(law_parameters, law_state, i, block, event)
        else:
            load(law_parameters, law_state, i, block, event)

    @inline
    def strain_energy(law_parameters, law_state, i):
        force = law_state[rows.FORCE, i]
        side = 1.0 if force > 0.0 else -1.0
        return 0.5 * force * force / unloading_stiffness(law_parameters, law_state, i, 0, side)

    @inline
    def enter(law_parameters, law_state, i):
        drift = law_parameters[_YIELD_FORCE, i] / law_parameters[rows.STIFFNESS, i]
        law_state[rows.HIGH_DRIFT, i] = law_state[rows.UPPER, i] = drift
        law_state[rows.LOW_DRIFT, i] = law_state[rows.LOWER, i] = -drift

    return follow_branches(switch, strain_energy, enter)


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    strength, ultimate, drift = values[:3]
    if ultimate < strength:
        return (
            f"ultimate_force must be at least yield_force, got {ultimate:.10g} N under "
            f"{strength:.10g} N"
        )
    if drift <= strength / stiffness:
        return (
            f"ultimate_drift must be beyond the yield drift {strength / stiffness:.6g} m, got "
            f"{drift:.10g} m"
        )
    if ultimate >= stiffness * drift:
        return (
            "the ultimate point must lie below the line of the initial stiffness: ultimate_drift "
            f"beyond {ultimate / stiffness:.6g} m, got {drift:.10g} m"
        )
    return None


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
    apart=True,
    yield_drift=yields_at_its_strength,
    fault=_fault,
)
