"""Trilinear law with pinched reloading, for building types of regional studies.

The backbone curve of each side rises to the yield point, continues to the ultimate point and
remains constant at larger drifts. The unloading stiffness is k (dy / maximum drift)^unloading, down
to zero force. Reloading towards the point of maximum drift of the other side has two parts. The
first part is flatter and ends at the fraction `pinching` of the force at that point (Lu, McKenna,
Cheng, Xu, Zeng and Mahin 2020); pinching 1 is the rule of Clough (1966). Reloading is never stiffer
than unloading.

In the functions below, `side` is 1 or -1, and drifts and forces with a `side` are positive in the
direction of that side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Rows of `law_parameters` with the parameters of the law: forces (N), drift (m), fraction and
# exponent.
_YIELD_FORCE = rows.FIRST_PARAMETER
_ULTIMATE_FORCE = rows.FIRST_PARAMETER + 1
_ULTIMATE_DRIFT = rows.FIRST_PARAMETER + 2
_PINCHING = rows.FIRST_PARAMETER + 3
_UNLOADING_EXPONENT = rows.FIRST_PARAMETER + 4

# Row of the drift at the last zero crossing of the force, m. The row HIGH_FORCE is free because the
# forces at the maximum drifts follow from the backbone curve.
_ZERO = rows.HIGH_FORCE

# Types of branches in row INTERNAL, negative on the negative side; 0 before the first yielding
_YIELDING = 1.0  # loading on the backbone curve
_PINCHED = 2.0  # first, flatter part of the reloading
_RELOADING = 3.0  # second part of the reloading, to the point of maximum drift
_UNLOADING_LINE = 4.0  # branch with the unloading stiffness, valid in both directions

# Fraction of a drift. A point is regarded as reached if the drift is closer to it than this.
_REACHED_TOLERANCE = 1e-12


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import follow_branches

    @inline
    def hardening(law_parameters, i):
        """Return the slope of the backbone curve between yield and ultimate point of a side,
        N/m.
        """
        strength = law_parameters[_YIELD_FORCE, i]
        return (law_parameters[_ULTIMATE_FORCE, i] - strength) / (
            law_parameters[_ULTIMATE_DRIFT, i] - strength / law_parameters[rows.STIFFNESS, i]
        )

    @inline
    def backbone(law_parameters, i, drift):
        """Return the force of the backbone curve, N, at a drift (m) above the yield drift."""
        strength = law_parameters[_YIELD_FORCE, i]
        if drift >= law_parameters[_ULTIMATE_DRIFT, i]:
            return law_parameters[_ULTIMATE_FORCE, i]
        return strength + hardening(law_parameters, i) * (
            drift - strength / law_parameters[rows.STIFFNESS, i]
        )

    @inline
    def max_drift(law_state, i, block, side):
        """Return the absolute maximum drift on side `side`, m; during yielding, the current drift
        is included.

        Row HIGH_DRIFT contains the maximum drift of the positive side, row LOW_DRIFT the minimum
        drift of the story, which is negative.
        """
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
        """Return the unloading stiffness of a side, N/m."""
        k = law_parameters[rows.STIFFNESS, i]
        return (
            k
            * (law_parameters[_YIELD_FORCE, i] / (k * max_drift(law_state, i, block, side)))
            ** law_parameters[_UNLOADING_EXPONENT, i]
        )

    @inline
    def set_loading_branch(law_state, i, block, side, branch_type, slope, end, rate_sign):
        """Set a loading branch of a side that ends at the drift `end` (infinite for no end);
        `rate_sign` is `side`, or 0 if the branch is valid in both directions.
        """
        law_state[block + rows.INTERNAL, i] = side * branch_type
        law_state[block + rows.SLOPE, i] = slope
        law_state[block + rows.RATE_SIGN, i] = rate_sign
        law_state[block + rows.UPPER, i] = end if side > 0.0 else math.inf
        law_state[block + rows.LOWER, i] = -end if side < 0.0 else -math.inf

    @inline
    def set_unloading_line(law_parameters, law_state, i, block, side, slope, end):
        """Set an unloading line through the current point, valid in both directions.

        In the direction of `side`, the line ends at the drift `end`. In the opposite direction, it
        ends where the force is zero.
        """
        zero_drift = law_state[block + rows.DRIFT, i] - law_state[block + rows.FORCE, i] / slope
        # RATE_SIGN 0: a reversal does not end the branch.
        set_loading_branch(law_state, i, block, side, _UNLOADING_LINE, slope, end, 0.0)
        if side > 0.0:
            law_state[block + rows.LOWER, i] = zero_drift
        else:
            law_state[block + rows.UPPER, i] = zero_drift

    @inline
    def drift_at_pinching_end(law_parameters, law_state, i, block, side, target, force, slope):
        """Return the drift at the end of the first, flatter part of reloading, m.

        `target` is the maximum drift, `force` its force and `slope` the unloading stiffness.
        Unloading from the point of maximum drift reaches the fraction `pinching` of its force at a
        certain drift. The first part covers the fraction `pinching` of the distance from the last
        zero crossing to this drift.
        """
        zero_drift = side * law_state[block + _ZERO, i]
        pinching = law_parameters[_PINCHING, i]
        return zero_drift + pinching * (target - (1.0 - pinching) * force / slope - zero_drift)

    @outlined
    def continue_loading(law_parameters, law_state, i, block, side):
        """Set the loading branch that starts at the current point."""
        drift = side * law_state[block + rows.DRIFT, i]
        current_force = side * law_state[block + rows.FORCE, i]
        target = max_drift(law_state, i, block, side)
        # Below the maximum drift the story reloads, on the first (pinched) or on the second part.
        if drift < target * (1.0 - _REACHED_TOLERANCE):
            target_force = backbone(law_parameters, i, target)
            slope = unloading_stiffness(law_parameters, law_state, i, block, side)
            pinching_end = drift_at_pinching_end(
                law_parameters, law_state, i, block, side, target, target_force, slope
            )
            if drift < pinching_end - _REACHED_TOLERANCE * target:
                pinched_slope = (law_parameters[_PINCHING, i] * target_force - current_force) / (
                    pinching_end - drift
                )
                set_loading_branch(
                    law_state, i, block, side, _PINCHED, pinched_slope, pinching_end, side
                )
            else:
                set_loading_branch(
                    law_state,
                    i,
                    block,
                    side,
                    _RELOADING,
                    (target_force - current_force) / (target - drift),
                    target,
                    side,
                )
        else:
            law_state[block + rows.FORCE, i] = side * backbone(law_parameters, i, drift)
            ultimate = law_parameters[_ULTIMATE_DRIFT, i]
            if drift < ultimate * (1.0 - _REACHED_TOLERANCE):
                set_loading_branch(
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
                set_loading_branch(law_state, i, block, side, _YIELDING, 0.0, math.inf, side)

    @outlined
    def cross_zero_force(law_parameters, law_state, i, block, side):
        """Set the branch that follows a zero crossing of the force.

        The first part of reloading is the next branch if its end and the point of maximum drift are
        ahead of the zero crossing, and it is not stiffer than unloading. Otherwise, the next branch
        is a line with the unloading stiffness. It ends where it meets the second part, or at the
        backbone curve if it does not meet the second part.
        """
        zero_drift = side * law_state[block + rows.DRIFT, i]
        law_state[block + rows.FORCE, i] = 0.0
        law_state[block + _ZERO, i] = law_state[block + rows.DRIFT, i]
        target = max_drift(law_state, i, block, side)
        target_force = backbone(law_parameters, i, target)
        slope = unloading_stiffness(law_parameters, law_state, i, block, side)
        pinching_end = drift_at_pinching_end(
            law_parameters, law_state, i, block, side, target, target_force, slope
        )
        pinched_force = law_parameters[_PINCHING, i] * target_force
        if (
            pinching_end > zero_drift + _REACHED_TOLERANCE * target
            and pinched_force <= slope * (pinching_end - zero_drift)
            and zero_drift < target
        ):
            continue_loading(law_parameters, law_state, i, block, side)
            return
        end_drift = math.inf
        # Drift d where the unloading line meets the line of the second part: slope (d - zero_drift)
        # = pinched_force + second_slope (d - pinching_end)
        if target > pinching_end:
            second_slope = (target_force - pinched_force) / (target - pinching_end)
            if slope > second_slope:
                end_drift = (pinched_force - second_slope * pinching_end + slope * zero_drift) / (
                    slope - second_slope
                )
        # If this point is not on the second part, the unloading line ends at the backbone curve. It
        # meets the constant part, at the ultimate force, unless it meets the hardening line before
        # the ultimate drift. The hardening line does not fall: the ultimate force is at least the
        # yield force (`_fault`). With a very small pinching factor, the point is the start of the
        # second part. The tolerance keeps it on the second part in spite of rounding errors.
        second_start = max(pinching_end, zero_drift) - _REACHED_TOLERANCE * target
        if end_drift > target or end_drift < second_start:
            hardening_slope = hardening(law_parameters, i)
            end_drift = zero_drift + law_parameters[_ULTIMATE_FORCE, i] / slope
            if slope > hardening_slope:
                strength = law_parameters[_YIELD_FORCE, i]
                meeting_drift = (
                    strength
                    - hardening_slope * strength / law_parameters[rows.STIFFNESS, i]
                    + slope * zero_drift
                ) / (slope - hardening_slope)
                if meeting_drift < law_parameters[_ULTIMATE_DRIFT, i]:
                    end_drift = min(meeting_drift, end_drift)
        set_unloading_line(law_parameters, law_state, i, block, side, slope, end_drift)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows the current branch at its end.

        elastic (type 0), at a yield drift     backbone curve
        loading, reversal                      unloading; the maximum drift is stored
        unloading line, at zero force          reloading of the other side
        unloading line, at its other end       reloading or backbone curve of the same side
        part of reloading or of the backbone   next part of reloading or of the backbone
        """
        branch_type = law_state[block + rows.INTERNAL, i]  # negative on the negative side
        # ABOVE is 1 and BELOW is -1: except for a reversal, the event is also the direction of the
        # drift.
        if branch_type == 0.0:  # first yielding
            continue_loading(law_parameters, law_state, i, block, event)
        elif event == rows.REVERSED:
            side = law_state[block + rows.RATE_SIGN, i]
            # The maximum drift includes the current drift during yielding.
            if side > 0.0:
                law_state[block + rows.HIGH_DRIFT, i] = max_drift(law_state, i, block, side)
            else:
                law_state[block + rows.LOW_DRIFT, i] = -max_drift(law_state, i, block, side)
            slope = unloading_stiffness(law_parameters, law_state, i, block, side)
            set_unloading_line(
                law_parameters,
                law_state,
                i,
                block,
                side,
                slope,
                side * law_state[block + rows.DRIFT, i],
            )
        # In the direction opposite to its side, the unloading line ends at zero force.
        elif abs(branch_type) == _UNLOADING_LINE and event * branch_type < 0.0:
            cross_zero_force(law_parameters, law_state, i, block, event)
        else:
            continue_loading(law_parameters, law_state, i, block, event)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the stored energy F^2 / (2 ku), J, released by unloading from force F to zero with
        the unloading stiffness ku.
        """
        force = law_state[rows.FORCE, i]
        side = 1.0 if force > 0.0 else -1.0
        return 0.5 * force * force / unloading_stiffness(law_parameters, law_state, i, 0, side)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the limits of the first branch of story `i`, elastic between the yield drifts, which
        are also the initial maximum drifts.
        """
        drift = law_parameters[_YIELD_FORCE, i] / law_parameters[rows.STIFFNESS, i]
        law_state[rows.HIGH_DRIFT, i] = law_state[rows.UPPER, i] = drift
        law_state[rows.LOW_DRIFT, i] = law_state[rows.LOWER, i] = -drift

    return follow_branches(switch, strain_energy, enter)


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
    yield_drift=yields_at_its_strength,
    stiffness_after_yield=_slope_to_ultimate,
    fault=_fault,
)
