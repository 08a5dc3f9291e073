"""Law imk of Ibarra, Medina and Krawinkler (2005), with capping and cyclic deterioration.

The modifications of Lignos and Krawinkler (2012) are included.

The backbone curve of each side rises to the yield point and to the capping point, falls to a
residual force and ends at the ultimate drift. Reloading is directed towards the last peak or the
point of maximum drift (peak-oriented), or first, with a smaller force, towards a point near zero
drift (pinching). With the work done on the story, the strength, the capping line, the reloading
point and the unloading stiffness of a side deteriorate at each zero crossing of the force or at
each reversal, by

    beta = ((work since the last zero crossing) / (Lambda Fy - total work))^exponent

The story fails if beta reaches 1 or if the drift reaches the ultimate drift. Its strength is then
zero permanently.

In the functions below, `side` is 1 or -1, and drifts and forces with a `side` are positive in the
direction of the side. k is the initial stiffness, Fy the initial yield force, and Fc = (capping
ratio) Fy the initial capping force.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Rows of `law_parameters`: first the parameters of the positive side, then the parameters of the
# negative side (_SIDE rows later), then the parameters of both sides. The capacities are the
# reference energies Lambda Fy of deterioration divided by the yield force Fy, m.
_YIELD_FORCE = rows.FIRST_PARAMETER
_PLASTIC_DRIFT = rows.FIRST_PARAMETER + 1
_POST_CAPPING_DRIFT = rows.FIRST_PARAMETER + 2
_CAPPING_RATIO = rows.FIRST_PARAMETER + 3
_RESIDUAL_RATIO = rows.FIRST_PARAMETER + 4
_ULTIMATE_DRIFT = rows.FIRST_PARAMETER + 5
_RATE = rows.FIRST_PARAMETER + 6
_SIDE = 7
_STRENGTH_CAPACITY = rows.FIRST_PARAMETER + 14
_CAPPING_CAPACITY = rows.FIRST_PARAMETER + 15
_RELOADING_CAPACITY = rows.FIRST_PARAMETER + 16
_UNLOADING_CAPACITY = rows.FIRST_PARAMETER + 17
_EXPONENT = rows.FIRST_PARAMETER + 18
_PINCHING_FORCE = rows.FIRST_PARAMETER + 19
_PINCHING_DRIFT = rows.FIRST_PARAMETER + 20

# Extra rows, relative to the first extra row of the state. Rows of a pair belong to the positive
# side; the row of the negative side is two rows later.
_PEAK_DRIFT = 0  # drift and force at the last reversal on each side
_PEAK_FORCE = 1
_STRENGTH = 4  # remaining fraction of yield force and hardening on each side
_CAPPING = 5  # remaining fraction of the force of the capping line at zero drift, on each side
_UNLOADING_STIFFNESS = 8
_WORK_AT_ZERO = 9  # work at the last zero crossing of the force, J
_PINCHED_DRIFT = 10  # drift and force at the end of the pinched part of the current reloading
_PINCHED_FORCE = 11
# Drift at the last reversal since the last zero crossing of the force, m; infinite if there was no
# reversal
_REVERSAL_DRIFT = 12
_EXTRA_ROWS = 13

# Types of branches in row INTERNAL, negative on the negative side; 0 before the first yielding
_UNLOADING = 1.0
_PINCHED = 2.0
_TOWARDS_PEAK = 3.0
_TOWARDS_MAXIMUM = 4.0
_PLASTIC = 5.0
_SOFTENING = 6.0
_RESIDUAL = 7.0
_FAILED = 8.0  # no strength; positive for both sides

# Fraction of a drift. A point is regarded as reached if its distance from the drift is smaller than
# this fraction.
_REACHED_TOLERANCE = 1e-12
# Relative to the maximum drift. A reversal within this distance of the last reversal is regarded as
# the same reversal, which a time step did not locate exactly.
_SAME_REVERSAL_TOLERANCE = 1e-6
# Relative difference of two forces that is regarded as rounding. The last peak and the point of
# maximum drift often both have the residual force.
_EQUAL_FORCES = 1e-9


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import (
        extra_rows,
        fail,
        follow_branches,
        set_branch,
        set_directed,
        side_row,
    )

    @inline
    def side_parameter(law_parameters, i, side, parameter):
        """Return the parameter of a side of the story from the table of parameters.

        `parameter` is the row of the parameter of the positive side.
        """
        return law_parameters[parameter if side > 0.0 else parameter + _SIDE, i]

    @inline
    def plastic_line(law_parameters, law_state, i, block, side):
        """Return the current hardening line of a side: its force at zero drift, N, and slope, N/m.

        The line leads through the yield point with the force r Fy and the drift r Fy / k, where r
        is the fraction of the strength that remains after deterioration. The plastic drift is the
        drift from the yield point to the capping point.
        """
        k = law_parameters[rows.STIFFNESS, i]
        yield_force = side_parameter(law_parameters, i, side, _YIELD_FORCE)
        remaining_fraction = law_state[extra_rows(law_state, block) + side_row(side, _STRENGTH), i]
        slope = (
            remaining_fraction
            * (side_parameter(law_parameters, i, side, _CAPPING_RATIO) - 1.0)
            * yield_force
            / side_parameter(law_parameters, i, side, _PLASTIC_DRIFT)
        )
        return remaining_fraction * yield_force * (1.0 - slope / k), slope

    @inline
    def capping_line(law_parameters, law_state, i, block, side):
        """Return the current capping line of a side: its force at zero drift, N, and slope, N/m.

        Without deterioration, the line falls from the initial capping point with the slope -Fc /
        (post-capping drift). Deterioration multiplies the force at zero drift by the remaining
        fraction (row _CAPPING) and does not change the slope.
        """
        yield_force = side_parameter(law_parameters, i, side, _YIELD_FORCE)
        capping_force = side_parameter(law_parameters, i, side, _CAPPING_RATIO) * yield_force
        slope = -capping_force / side_parameter(law_parameters, i, side, _POST_CAPPING_DRIFT)
        initial_capping_drift = yield_force / law_parameters[rows.STIFFNESS, i] + side_parameter(
            law_parameters, i, side, _PLASTIC_DRIFT
        )
        return law_state[extra_rows(law_state, block) + side_row(side, _CAPPING), i] * (
            capping_force - slope * initial_capping_drift
        ), slope

    @inline
    def residual(law_parameters, i, side):
        """Return the residual force of a side, N: residual ratio times initial yield force."""
        return side_parameter(law_parameters, i, side, _RESIDUAL_RATIO) * side_parameter(
            law_parameters, i, side, _YIELD_FORCE
        )

    @inline
    def backbone(law_parameters, law_state, i, block, side, drift):
        """Return the force of the current backbone curve of a side at a drift, N.

        The elastic part below the yield drift is not represented.
        """
        hardening_force, hardening_slope = plastic_line(law_parameters, law_state, i, block, side)
        capping_force, capping_slope = capping_line(law_parameters, law_state, i, block, side)
        return max(
            min(hardening_force + hardening_slope * drift, capping_force + capping_slope * drift),
            residual(law_parameters, i, side),
        )

    @inline
    def deterioration(law_parameters, i, capacity, work, total_work):
        """Return beta, the relative change of a quantity at a zero crossing or reversal; 2 if the
        story fails.

        `capacity` is the row of the capacity Lambda of the quantity, m. `work` is the work done on
        the story since the last zero crossing of the force, `total_work` since the start, J. Fy is
        the yield force of the positive side.
        """
        # Remaining capacity, J. If the work reaches it, the story fails.
        remaining = law_parameters[capacity, i] * law_parameters[_YIELD_FORCE, i] - total_work
        if work <= 0.0 and remaining > 0.0:
            return 0.0
        if remaining <= 0.0 or work >= remaining:
            return 2.0
        ratio = work / remaining
        exponent = law_parameters[_EXPONENT, i]
        return ratio if exponent == 1.0 else ratio**exponent

    @outlined
    def deterioration_at_reversal(law_parameters, law_state, i, block):
        """Return the fraction of the unloading stiffness that would be lost by a reversal now
        (`deterioration`).

        The energy that unloading would release is subtracted from the work.
        """
        first = extra_rows(law_state, block)
        force = law_state[block + rows.FORCE, i]
        stored = 0.5 * force * force / law_state[first + _UNLOADING_STIFFNESS, i]
        total_work = law_state[block + rows.WORK, i] - stored
        work = total_work - law_state[first + _WORK_AT_ZERO, i]
        return deterioration(law_parameters, i, _UNLOADING_CAPACITY, work, total_work)

    @outlined
    def set_loading_branch(law_parameters, law_state, i, block, side, branch_type, slope, end):
        """Set a loading branch of a single side that ends at the drift `end` or at the ultimate
        drift, or fail at the ultimate drift.
        """
        ultimate = side_parameter(law_parameters, i, side, _ULTIMATE_DRIFT)
        if side * law_state[block + rows.DRIFT, i] >= ultimate * (1.0 - _REACHED_TOLERANCE):
            fail(law_state, i, block, _FAILED)
            return
        set_directed(law_state, i, block, side, branch_type, slope, min(end, ultimate))

    @outlined
    def set_backbone_branch(law_parameters, law_state, i, block, side):
        """Continue on the backbone curve: set its force and its branch at the current drift.

        If deterioration has reduced the hardening line below the residual force, the force is the
        residual force there as well.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        hardening_force, hardening_slope = plastic_line(law_parameters, law_state, i, block, side)
        capping_force, capping_slope = capping_line(law_parameters, law_state, i, block, side)
        residual_force = residual(law_parameters, i, side)
        capping_drift = (capping_force - hardening_force) / (hardening_slope - capping_slope)
        tolerance = _REACHED_TOLERANCE * drift
        if (
            drift < capping_drift - tolerance
            and hardening_force + hardening_slope * drift >= residual_force
        ):
            law_state[block + rows.FORCE, i] = side * (hardening_force + hardening_slope * drift)
            set_loading_branch(
                law_parameters, law_state, i, block, side, _PLASTIC, hardening_slope, capping_drift
            )
        # The capping line ends at the residual force.
        elif (
            drift >= capping_drift - tolerance
            and drift < (residual_force - capping_force) / capping_slope - tolerance
        ):
            law_state[block + rows.FORCE, i] = side * (capping_force + capping_slope * drift)
            end = (residual_force - capping_force) / capping_slope
            set_loading_branch(
                law_parameters, law_state, i, block, side, _SOFTENING, capping_slope, end
            )
        else:
            law_state[block + rows.FORCE, i] = side * residual_force
            # The hardening line exceeds the residual force again at `recovery_drift`, if this is
            # before the capping drift.
            recovery_drift = math.inf
            if hardening_slope > 0.0:
                recovery_drift = (residual_force - hardening_force) / hardening_slope
            end = math.inf
            if drift < recovery_drift - tolerance and recovery_drift < capping_drift:
                end = recovery_drift
            set_loading_branch(law_parameters, law_state, i, block, side, _RESIDUAL, 0.0, end)

    @outlined
    def set_branch_to_maximum(law_parameters, law_state, i, block, side):
        """Set the reloading branch towards the point of maximum drift of a side.

        If this point is reached, the story continues on the backbone curve.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        if drift < max_drift * (1.0 - _REACHED_TOLERANCE):
            # The force must change by `rise` (N) up to the point of maximum drift.
            max_force = law_state[block + side_row(side, rows.HIGH_FORCE), i]
            rise = max_force - side * law_state[block + rows.FORCE, i]
            slope = rise / (max_drift - drift)
            set_loading_branch(
                law_parameters, law_state, i, block, side, _TOWARDS_MAXIMUM, slope, max_drift
            )
        else:
            set_backbone_branch(law_parameters, law_state, i, block, side)

    @outlined
    def set_branch_to_peak(law_parameters, law_state, i, block, side):
        """Set the reloading branch of a side towards the last peak or the point of maximum drift.

        The last peak is the point of the last reversal on this side. It is selected if it is ahead,
        has a smaller force than the point of maximum drift, and the line to this point is steeper.
        """
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        max_force = law_state[block + side_row(side, rows.HIGH_FORCE), i]
        peak_drift = law_state[first + side_row(side, _PEAK_DRIFT), i]
        peak_force = law_state[first + side_row(side, _PEAK_FORCE), i]
        if (
            drift < peak_drift - _REACHED_TOLERANCE * max_drift
            and force < peak_force
            and peak_force < max_force * (1.0 - _EQUAL_FORCES)
        ):
            slope = (peak_force - force) / (peak_drift - drift)
            # The line to the peak is steeper if it passes above the point of maximum drift.
            if slope * (max_drift - drift) > max_force - force:
                set_loading_branch(
                    law_parameters, law_state, i, block, side, _TOWARDS_PEAK, slope, peak_drift
                )
                return
        set_branch_to_maximum(law_parameters, law_state, i, block, side)

    @outlined
    def unload(law_parameters, law_state, i, block, side):
        """Set the unloading branch after a reversal on a loading branch.

        The reversal becomes the last peak of the side and, if its drift is larger, the point of
        maximum drift.
        """
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        law_state[first + side_row(side, _PEAK_DRIFT), i] = drift
        law_state[first + side_row(side, _PEAK_FORCE), i] = force
        if drift > law_state[block + side_row(side, rows.HIGH_DRIFT), i]:
            law_state[block + side_row(side, rows.HIGH_DRIFT), i] = drift
            law_state[block + side_row(side, rows.HIGH_FORCE), i] = force
        stiffness_loss = deterioration_at_reversal(law_parameters, law_state, i, block)
        # A repetition of the last reversal causes no further deterioration.
        distance = abs(side * drift - law_state[first + _REVERSAL_DRIFT, i])
        max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        if distance <= _SAME_REVERSAL_TOLERANCE * max_drift:
            stiffness_loss = 0.0
        law_state[first + _REVERSAL_DRIFT, i] = side * drift
        if stiffness_loss >= 1.0:
            fail(law_state, i, block, _FAILED)
            return
        slope = law_state[first + _UNLOADING_STIFFNESS, i] * (1.0 - stiffness_loss)
        law_state[first + _UNLOADING_STIFFNESS, i] = slope
        # The branch is valid in both directions, between zero force and the reversal.
        zero_drift = side * (drift - force / slope)
        law_state[block + rows.INTERNAL, i] = side * _UNLOADING
        upper = side * drift if side > 0.0 else zero_drift
        lower = zero_drift if side > 0.0 else side * drift
        set_branch(law_state, i, block, slope, lower, upper, 0.0)

    @outlined
    def deteriorate(law_parameters, law_state, i, block, side):
        """Apply the deterioration of the side that is loaded after a zero crossing of the force;
        return True if the story fails.

        The parameter `rate` is between 0 and 1 (checked when a model is read), so that the factors
        are positive unless the story fails. The law does not use the rows after a failure.
        """
        first = extra_rows(law_state, block)
        total_work = law_state[block + rows.WORK, i]
        work = total_work - law_state[first + _WORK_AT_ZERO, i]
        rate = side_parameter(law_parameters, i, side, _RATE)
        strength_loss = deterioration(law_parameters, i, _STRENGTH_CAPACITY, work, total_work)
        capping_loss = deterioration(law_parameters, i, _CAPPING_CAPACITY, work, total_work)
        reloading_loss = deterioration(law_parameters, i, _RELOADING_CAPACITY, work, total_work)
        law_state[first + _WORK_AT_ZERO, i] = total_work
        law_state[first + side_row(side, _STRENGTH), i] *= 1.0 - rate * strength_loss
        law_state[first + side_row(side, _CAPPING), i] *= 1.0 - rate * capping_loss
        law_state[block + side_row(side, rows.HIGH_DRIFT), i] *= 1.0 + rate * reloading_loss
        return max(strength_loss, capping_loss, reloading_loss) > 1.0

    @outlined
    def cross_zero_force(law_parameters, law_state, i, block, side):
        """Apply the deterioration at a zero crossing of the force, and set the reloading branch of
        `side`.

        `switch` calls this function if an unloading branch has reached zero force, or if a loading
        branch reverses before its force has become positive. In both cases the force is already 0
        up to rounding, because the force of a loading branch is never negative.

        The point of maximum drift, with the drift dm and the force Fm, is moved to the deteriorated
        backbone curve. With pinching, the reloading branch leads to the pinched point

            x = (1 - kD) (dm - Fm / Ku),   F = kF Fm (x - z) / (dm - z)

        with the pinching parameters kD and kF (`drift` and `force`), the drift z of the zero
        crossing and the unloading stiffness Ku.
        """
        first = extra_rows(law_state, block)
        law_state[block + rows.FORCE, i] = 0.0
        # no reversal since this zero crossing
        law_state[first + _REVERSAL_DRIFT, i] = math.inf
        if deteriorate(law_parameters, law_state, i, block, side):
            fail(law_state, i, block, _FAILED)
            return
        stiffness = law_state[first + _UNLOADING_STIFFNESS, i]
        zero_drift = side * law_state[block + rows.DRIFT, i]
        max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        if max_drift <= zero_drift * (1.0 + _REACHED_TOLERANCE) and zero_drift > 0.0:
            # This occurs if the stiffness of unloading from the other side is small. The point of
            # maximum drift is moved ahead of the zero crossing. The lower bound of the force avoids
            # a reloading line of zero length.
            force = backbone(law_parameters, law_state, i, block, side, max_drift)
            force = max(force, _REACHED_TOLERANCE * law_parameters[_YIELD_FORCE, i])
            max_drift = zero_drift + force / stiffness
            law_state[block + side_row(side, rows.HIGH_DRIFT), i] = max_drift
        max_force = backbone(law_parameters, law_state, i, block, side, max_drift)
        law_state[block + side_row(side, rows.HIGH_FORCE), i] = max_force
        # With both pinching parameters equal to 1, reloading has no pinched part.
        if law_parameters[_PINCHING_FORCE, i] != 1.0 or law_parameters[_PINCHING_DRIFT, i] != 1.0:
            pinched_drift = (1.0 - law_parameters[_PINCHING_DRIFT, i]) * (
                max_drift - max_force / stiffness
            )
            pinched_force = law_parameters[_PINCHING_FORCE, i] * max_force
            pinched_force *= pinched_drift - zero_drift
            pinched_force /= max_drift - zero_drift
            law_state[first + _PINCHED_DRIFT, i] = pinched_drift
            law_state[first + _PINCHED_FORCE, i] = pinched_force
            if zero_drift < pinched_drift - _REACHED_TOLERANCE * max_drift:
                slope = pinched_force / (pinched_drift - zero_drift)
                set_loading_branch(
                    law_parameters, law_state, i, block, side, _PINCHED, slope, pinched_drift
                )
                return
        set_branch_to_peak(law_parameters, law_state, i, block, side)

    @outlined
    def resume_loading(law_parameters, law_state, i, block, side):
        """Set the branch after an interrupted unloading that returned to the last reversal.

        Loading continues towards the pinched point if it is ahead, between the current point and
        the point of maximum drift, and the line to this point is less steep.
        """
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        max_force = law_state[block + side_row(side, rows.HIGH_FORCE), i]
        pinched_drift = law_state[first + _PINCHED_DRIFT, i]
        pinched_force = law_state[first + _PINCHED_FORCE, i]
        if (
            drift < pinched_drift - _REACHED_TOLERANCE * max_drift
            and force < pinched_force
            and pinched_drift < max_drift
            and pinched_force < max_force
        ):
            slope = (pinched_force - force) / (pinched_drift - drift)
            # The line to the pinched point is less steep if it passes below the point of maximum
            # drift.
            if slope * (max_drift - drift) < max_force - force:
                set_loading_branch(
                    law_parameters, law_state, i, block, side, _PINCHED, slope, pinched_drift
                )
                return
        set_branch_to_maximum(law_parameters, law_state, i, block, side)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows the current branch at its end.

        elastic (type 0), at a yield point     backbone curve
        loading, reversal                      unloading
        loading, reversal, force not yet       deterioration, then reloading of the other side
            positive on the side of loading
        unloading, at zero force               deterioration, then reloading of the other side
        unloading, back at the reversal        reloading
        loading, at the ultimate drift         failure
        pinched part of reloading              reloading towards the last peak or the point of
                                               maximum drift (`set_branch_to_peak`)
        towards the last peak                  reloading towards the point of maximum drift
        towards the maximum drift              backbone curve
        line of the backbone curve             next line of the backbone curve
        """
        branch_type = abs(law_state[block + rows.INTERNAL, i])
        # ABOVE is 1 and BELOW is -1: the event is also the side of the story that is loaded.
        if event == rows.REVERSED:
            side = law_state[block + rows.RATE_SIGN, i]
            if side * law_state[block + rows.FORCE, i] > 0.0:
                unload(law_parameters, law_state, i, block, side)
            else:
                cross_zero_force(law_parameters, law_state, i, block, -side)
        elif branch_type == _UNLOADING:
            # INTERNAL has the sign of the side that was unloaded.
            if event * law_state[block + rows.INTERNAL, i] < 0.0:
                cross_zero_force(law_parameters, law_state, i, block, event)
            else:
                resume_loading(law_parameters, law_state, i, block, event)
        elif event * law_state[block + rows.DRIFT, i] >= side_parameter(
            law_parameters, i, event, _ULTIMATE_DRIFT
        ) * (1.0 - _REACHED_TOLERANCE):
            fail(law_state, i, block, _FAILED)
        elif branch_type == _PINCHED:
            set_branch_to_peak(law_parameters, law_state, i, block, event)
        elif branch_type == _TOWARDS_PEAK:
            set_branch_to_maximum(law_parameters, law_state, i, block, event)
        else:
            set_backbone_branch(law_parameters, law_state, i, block, event)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the stored energy F^2 / (2 Ku), J, released by unloading from force F to zero.

        On a loading branch, Ku is the unloading stiffness after the deterioration that a reversal
        at the current state would cause. There are two differences from a reversal (`unload`): the
        loss of stiffness is at most 0.9, and it is not set to 0 close to the last reversal.
        """
        force = law_state[rows.FORCE, i]
        energy = 0.5 * force * force / law_state[extra_rows(law_state, 0) + _UNLOADING_STIFFNESS, i]
        # The limit 0.9 avoids a division by zero.
        if abs(law_state[rows.INTERNAL, i]) > _UNLOADING and force != 0.0:
            energy /= 1.0 - min(deterioration_at_reversal(law_parameters, law_state, i, 0), 0.9)
        return energy

    @inline
    def enter(law_parameters, law_state, i):
        """Set the limits of the first, elastic branch of story `i`, the yield drifts, and the
        initial state.

        The yield points are also the initial points of maximum drift and the initial last peaks.
        """
        k = law_parameters[rows.STIFFNESS, i]
        first = extra_rows(law_state, 0)
        law_state[first + _UNLOADING_STIFFNESS, i] = k
        law_state[first + _REVERSAL_DRIFT, i] = math.inf
        for side in (1.0, -1.0):
            strength = side_parameter(law_parameters, i, side, _YIELD_FORCE)
            law_state[side_row(side, rows.HIGH_DRIFT), i] = strength / k
            law_state[side_row(side, rows.HIGH_FORCE), i] = strength
            law_state[first + side_row(side, _PEAK_DRIFT), i] = strength / k
            law_state[first + side_row(side, _PEAK_FORCE), i] = strength
            law_state[first + side_row(side, _STRENGTH), i] = 1.0
            law_state[first + side_row(side, _CAPPING), i] = 1.0
        law_state[rows.UPPER, i] = side_parameter(law_parameters, i, 1.0, _YIELD_FORCE) / k
        law_state[rows.LOWER, i] = -side_parameter(law_parameters, i, -1.0, _YIELD_FORCE) / k

    return follow_branches(switch, strain_energy, enter)


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return an error message if the ultimate drift of a side does not exceed the yield drift, or
    its residual ratio exceeds the capping ratio, otherwise None.
    """
    for side_values, group in ((values[:_SIDE], ""), (values[_SIDE : 2 * _SIDE], "negative.")):
        strength, _, _, capping_ratio, residual_ratio, ultimate_drift, _ = side_values
        if ultimate_drift <= strength / stiffness:
            return (
                f"{group}ultimate_drift must be beyond the yield drift {strength / stiffness:.6g} "
                f"m, got {ultimate_drift:.10g} m"
            )
        if residual_ratio > capping_ratio:
            return (
                f"{group}residual_ratio must not exceed capping_ratio {capping_ratio:.10g}, got "
                f"{residual_ratio:.10g}"
            )
    return None


_SIDE_PARAMETERS = (
    LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
    LawParameter("plastic_drift", length=1, low=0.0, low_allowed=False),
    LawParameter("post_capping_drift", length=1, low=0.0, low_allowed=False),
    LawParameter("capping_ratio", low=1.0),
    LawParameter("residual_ratio", low=0.0, high=1.0),
    LawParameter("ultimate_drift", length=1, low=0.0, low_allowed=False),
    LawParameter("rate", low=0.0, high=1.0, default=1.0),
)


def _slope_to_capping(stiffness: float, values: Sequence[float]) -> float:
    """Return the stiffness from the yield point to the capping point, N/m."""
    yield_force, plastic_drift, _, capping_ratio = values[:4]
    return (capping_ratio - 1.0) * yield_force / plastic_drift


_CAPACITY = LawParameter(
    "strength", length=1, low=0.0, low_allowed=False, group="deterioration", shared=True
)

LAW = DriftLaw(
    "imk",
    "Ibarra-Medina-Krawinkler: capping, residual force, cyclic deterioration; peak-oriented or "
    "pinching",
    _functions,
    parameters=(
        *_SIDE_PARAMETERS,
        *(
            replace(parameter, default=parameter.name, group="negative")
            for parameter in _SIDE_PARAMETERS
        ),
        *(
            replace(_CAPACITY, name=name, default=math.inf, without=math.inf)
            for name in ("strength", "capping", "reloading", "unloading")
        ),
        LawParameter("exponent", low=0.0, low_allowed=False, default=1.0),
        LawParameter("force", low=0.0, high=1.0, low_allowed=False, group="pinching", without=1.0),
        LawParameter("drift", low=0.0, high=1.0, group="pinching", without=1.0),
    ),
    kinked=True,
    equal_directions=lambda values: values[:_SIDE] == values[_SIDE : 2 * _SIDE],
    extra_rows=_EXTRA_ROWS,
    yield_drift=yields_at_its_strength,
    stiffness_after_yield=_slope_to_capping,
    fault=_fault,
    falls=lambda stiffness, values: True,
    failed=_FAILED,
)
