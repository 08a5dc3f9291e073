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

In the functions below, drifts and forces with a `side` are positive in the direction of that side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Rows of `law_parameters`: first the parameters of the positive side, then those of the negative
# side (_SIDE rows later), then those of both sides. The capacities are the reference energies
# Lambda Fy of deterioration divided by the yield force Fy, m.
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

# Types of branches in row INTERNAL. The value is negative on the negative side, and 0 before the
# first yielding.
_UNLOADING = 1.0
_PINCHED = 2.0
_TOWARDS_PEAK = 3.0
_TOWARDS_MAXIMUM = 4.0
_PLASTIC = 5.0
_SOFTENING = 6.0
_RESIDUAL = 7.0
_FAILED = 8.0  # no strength; the value is positive for both sides

# Fraction of a drift. A point is regarded as reached if the drift is closer to it than this.
_REACHED_TOLERANCE = 1e-12
# Relative to the maximum drift. A reversal within this distance of the last reversal is regarded as
# the same reversal, which a time step did not locate exactly.
_SAME_REVERSAL_TOLERANCE = 1e-6


def _functions() -> LawFunctions:
    """Return the compiled functions of the law imk (Ibarra, Medina and Krawinkler 2005).

    The functions of the result are `switch` (next branch), `strain_energy` and `enter` (first
    branch), and those that `follow_branches` builds from them. The other functions defined here are
    their parts. Drifts and forces with a `side` (1 or -1) are positive in the direction of that
    side. The decorators are imported here, because they import numba in a process that compiles.
    """
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import extra_rows, fail, follow_branches

    @inline
    def side_row(side, row):
        """Return the row of a law state that contains a quantity for one side of the story.

        Quantities with separate values for both sides have a row for the positive side (`side` 1),
        `row`, and a row for the negative side (`side` -1) two rows later. The values of both sides
        are positive.
        """
        return row if side > 0.0 else row + 2

    @inline
    def side_parameter(law_parameters, i, side, parameter):
        """Return the parameter of a side of the story from the table of parameters.

        `parameter` is the row of the parameter of the positive side.
        """
        return law_parameters[parameter if side > 0.0 else parameter + _SIDE, i]

    @inline
    def plastic_line(law_parameters, law_state, i, block, side):
        """Return the current hardening line of a side: its force at zero drift, N, and slope, N/m.

        The line leads through the yield point, which is at the force r Fy and the drift r Fy / k:

            slope s                r (Fc - Fy) / (plastic drift)
            force at zero drift    r Fy (1 - s / k)

        Fy is the initial yield force and k the initial stiffness. r is the fraction of the strength
        that remains after deterioration (row _STRENGTH). Fc = (capping ratio) Fy is the initial
        capping force, and the plastic drift is the drift from the yield point to the capping point.
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

        Without deterioration, the line falls from the initial capping point with the slope
        -Fc / (post-capping drift). The capping point has the force Fc = (capping ratio) Fy and the
        drift Fy / k + (plastic drift), with the yield force Fy and the initial stiffness k.
        Deterioration multiplies the force at zero drift by the remaining fraction (row _CAPPING)
        and does not change the slope.
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
        """Return the residual force of a side, N: residual ratio times initial yield force.

        Column `i` of the table `law_parameters` contains the parameters of story `i`.
        """
        return side_parameter(law_parameters, i, side, _RESIDUAL_RATIO) * side_parameter(
            law_parameters, i, side, _YIELD_FORCE
        )

    @inline
    def backbone(law_parameters, law_state, i, block, side, drift):
        """Return the force of the current backbone curve of a side at a drift, N.

        It is the smaller force of hardening line and capping line, but at least the residual force.
        `plastic_line` and `capping_line` return the force of their line at zero drift and its
        slope. The elastic part below the yield drift is not represented.

        `drift` is the total drift of the story, m, positive on this side; not less than the yield
        drift.
        """
        hardening_force, hardening_slope = plastic_line(law_parameters, law_state, i, block, side)
        capping_force, capping_slope = capping_line(law_parameters, law_state, i, block, side)
        return max(
            min(hardening_force + hardening_slope * drift, capping_force + capping_slope * drift),
            residual(law_parameters, i, side),
        )

    @inline
    def deterioration(law_parameters, i, capacity, work, total_work):
        """Return beta, the relative change of a quantity at a zero crossing or reversal.

        Four quantities deteriorate. The strength, the force of the capping line and the unloading
        stiffness decrease; the maximum drift increases. `deteriorate` and `unload` apply the
        change; `deteriorate` multiplies beta by the parameter `rate` of the side. With the capacity
        Lambda (m) of the quantity and the yield force Fy of the positive side,

            beta = (work / (Lambda Fy - total work))^exponent

        The result is between 0 and 1. It is 2 if beta is at least 1, or if no capacity remains
        (Lambda Fy <= total work): the story then fails. If the work since the last zero crossing is
        not positive and capacity remains, beta is 0.

        `capacity` is the row of the capacity Lambda in the table of parameters, m. `work` is the
        work done on the story since the last zero crossing of the force, J. `total_work` is the
        work done on the story since the start, J.
        """
        # Remaining capacity, J. If the work reaches it, the story fails; the result 2 is an
        # arbitrary value above 1.
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
        """Return the fraction of the unloading stiffness that would be lost by a reversal now.

        The work done on the story determines this fraction (`deterioration`). The energy that
        unloading from the force F with the unloading stiffness Ku would release, F^2 / (2 Ku), is
        subtracted from the work. The result is between 0 and 1, or 2 if the story would fail. The
        law state is not changed.
        """
        first = extra_rows(law_state, block)
        force = law_state[block + rows.FORCE, i]
        stored = 0.5 * force * force / law_state[first + _UNLOADING_STIFFNESS, i]
        total_work = law_state[block + rows.WORK, i] - stored
        return deterioration(
            law_parameters,
            i,
            _UNLOADING_CAPACITY,
            total_work - law_state[first + _WORK_AT_ZERO, i],
            total_work,
        )

    @outlined
    def set_loading_branch(law_parameters, law_state, i, block, side, branch_type, slope, end):
        """Set a loading branch of one side that ends at the drift `end` or at the ultimate drift.

        The branch consists of the rows INTERNAL, SLOPE, RATE_SIGN, UPPER and LOWER of the law
        state; it also ends at a reversal of the drift. If the story has already reached the
        ultimate drift, it fails instead.

        `branch_type` is the type of the branch for row INTERNAL, a positive constant of this
        module. `slope` is the stiffness of the branch, N/m. `end` is the drift at the end of the
        branch, m, positive on this side.
        """
        ultimate = side_parameter(law_parameters, i, side, _ULTIMATE_DRIFT)
        if side * law_state[block + rows.DRIFT, i] >= ultimate * (1.0 - _REACHED_TOLERANCE):
            fail(law_state, i, block, _FAILED)
            return
        end = min(end, ultimate)
        law_state[block + rows.INTERNAL, i] = side * branch_type
        law_state[block + rows.SLOPE, i] = slope
        law_state[block + rows.RATE_SIGN, i] = side
        law_state[block + rows.UPPER, i] = end if side > 0.0 else math.inf
        law_state[block + rows.LOWER, i] = -end if side < 0.0 else -math.inf

    @outlined
    def set_backbone_branch(law_parameters, law_state, i, block, side):
        """Continue on the backbone curve: set its force and its branch at the current drift d.

        The hardening line has the force h + s d, and the capping line the force c + t d (t
        negative). h and c are the forces at zero drift, s and t the slopes, and R is the residual
        force. The parts of the curve are

            hardening line    up to the capping drift (c - h) / (s - t)
            capping line      up to the drift (R - c) / t, where the force falls to R
            constant force    R above this drift

        If deterioration has reduced the hardening line below R, the force is R there as well.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        # Forces of both lines at zero drift (h, c) and slopes (s, t). The lines intersect at the
        # capping drift.
        hardening_force, hardening_slope = plastic_line(law_parameters, law_state, i, block, side)
        capping_force, capping_slope = capping_line(law_parameters, law_state, i, block, side)
        residual_force = residual(law_parameters, i, side)
        capping_drift = (capping_force - hardening_force) / (hardening_slope - capping_slope)
        tolerance = _REACHED_TOLERANCE * drift
        # The story is on the hardening line up to the capping drift.
        if (
            drift < capping_drift - tolerance
            and hardening_force + hardening_slope * drift >= residual_force
        ):
            law_state[block + rows.FORCE, i] = side * (hardening_force + hardening_slope * drift)
            set_loading_branch(
                law_parameters, law_state, i, block, side, _PLASTIC, hardening_slope, capping_drift
            )
        # The story is on the capping line until this line falls to the residual force.
        elif (
            drift >= capping_drift - tolerance
            and drift < (residual_force - capping_force) / capping_slope - tolerance
        ):
            law_state[block + rows.FORCE, i] = side * (capping_force + capping_slope * drift)
            set_loading_branch(
                law_parameters,
                law_state,
                i,
                block,
                side,
                _SOFTENING,
                capping_slope,
                (residual_force - capping_force) / capping_slope,
            )
        # The force is the residual force.
        else:
            law_state[block + rows.FORCE, i] = side * residual_force
            # Deterioration can reduce the hardening line below the residual force. It then exceeds
            # the residual force again at `recovery_drift`, if this is before the capping drift.
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
            rise = (
                law_state[block + side_row(side, rows.HIGH_FORCE), i]
                - side * law_state[block + rows.FORCE, i]
            )
            set_loading_branch(
                law_parameters,
                law_state,
                i,
                block,
                side,
                _TOWARDS_MAXIMUM,
                rise / (max_drift - drift),
                max_drift,
            )
        else:
            set_backbone_branch(law_parameters, law_state, i, block, side)

    @outlined
    def set_branch_to_peak(law_parameters, law_state, i, block, side):
        """Set the reloading branch of a side towards the last peak or the point of maximum drift.

        The last peak is the point of the last reversal on this side. It is selected if three
        conditions are met, otherwise the point of maximum drift:

            - drift and force of the last peak are larger than the current drift and force
            - the force of the last peak is smaller than the force of the point of maximum drift
            - the line to the last peak is steeper than the line to the point of maximum drift
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
            and peak_force < max_force
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
        maximum drift. The unloading stiffness is reduced by its deterioration. The branch ends at
        zero force, or, if the story is loaded again, at the reversal.
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
        if (
            abs(side * drift - law_state[first + _REVERSAL_DRIFT, i])
            <= _SAME_REVERSAL_TOLERANCE * law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        ):
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
        law_state[block + rows.SLOPE, i] = slope
        law_state[block + rows.RATE_SIGN, i] = 0.0
        law_state[block + rows.UPPER, i] = side * drift if side > 0.0 else zero_drift
        law_state[block + rows.LOWER, i] = zero_drift if side > 0.0 else side * drift

    @outlined
    def deteriorate(law_parameters, law_state, i, block, side):
        """Apply the deterioration of the side that is loaded after a zero crossing of the force.

        `deterioration` returns a fraction beta for each of three quantities. beta depends on the
        capacity of the quantity and on the work since the last zero crossing. With the parameter
        `rate` of the side, D, the quantities change by these factors:

            yield force and hardening                   1 - D beta    row _STRENGTH
            force of the capping line at zero drift     1 - D beta    row _CAPPING
            maximum drift                               1 + D beta    row HIGH_DRIFT or LOW_DRIFT

        D is between 0 and 1 (checked when a model is read), so that the factors are positive unless
        the story fails. The rows are also changed if the story fails; the law does not use them
        after a failure.

        Returns
        -------
        bool
            True if the story fails: at least one of the three fractions beta has reached 1, so
            that `deterioration` returns 2.
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
        """Apply the deterioration at a zero crossing of the force, and set the reloading branch.

        `switch` calls this function in two cases: an unloading branch has reached zero force, or a
        loading branch reverses before its force has become positive. In both cases the force is
        already 0 up to rounding, because the force of a loading branch is never negative. The force
        is set to exactly 0, and side `side` is loaded next. All drifts and forces below are
        positive on this side.

        1. The deterioration is applied (`deteriorate`). If a fraction beta reaches 1, the story
           fails, and steps 2 and 3 are omitted.
        2. The point of maximum drift, with the drift dm and the force Fm, is moved to the
           deteriorated backbone curve.
        3. The reloading branch is set. With pinching, it leads to the pinched point with the drift
           x and the force F:

               x = (1 - kD) (dm - Fm / Ku),   F = kF Fm (x - z) / (dm - z)

           kD and kF are the pinching parameters `drift` and `force`, z is the drift of the zero
           crossing, and Ku is the unloading stiffness. If kD and kF are 1, or if x is not larger
           than z, the pinched point is omitted. The branch then leads towards the last peak or the
           point of maximum drift (`set_branch_to_peak`).
        """
        first = extra_rows(law_state, block)
        law_state[block + rows.FORCE, i] = 0.0
        # Infinite: there has been no reversal since this zero crossing.
        law_state[first + _REVERSAL_DRIFT, i] = math.inf
        if deteriorate(law_parameters, law_state, i, block, side):
            fail(law_state, i, block, _FAILED)
            return
        stiffness = law_state[first + _UNLOADING_STIFFNESS, i]
        zero_drift = side * law_state[block + rows.DRIFT, i]
        max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        if max_drift <= zero_drift * (1.0 + _REACHED_TOLERANCE) and zero_drift > 0.0:
            # The drift of the zero crossing is at least the maximum drift of this side. This occurs
            # if the stiffness of unloading from the other side is small. The point of maximum drift
            # is moved ahead of the zero crossing: new maximum drift = drift of the zero crossing +
            # backbone force at the old maximum drift / unloading stiffness. The lower bound of the
            # force avoids a reloading line of zero length.
            max_drift = (
                zero_drift
                + max(
                    backbone(law_parameters, law_state, i, block, side, max_drift),
                    _REACHED_TOLERANCE * law_parameters[_YIELD_FORCE, i],
                )
                / stiffness
            )
            law_state[block + side_row(side, rows.HIGH_DRIFT), i] = max_drift
        max_force = backbone(law_parameters, law_state, i, block, side, max_drift)
        law_state[block + side_row(side, rows.HIGH_FORCE), i] = max_force
        # With both pinching parameters equal to 1, reloading has no pinched part: it leads directly
        # towards the last peak or the point of maximum drift.
        if law_parameters[_PINCHING_FORCE, i] != 1.0 or law_parameters[_PINCHING_DRIFT, i] != 1.0:
            # Compute the pinched point (x, F). The branch leads to this point, unless the point is
            # behind the zero crossing.
            pinched_drift = (1.0 - law_parameters[_PINCHING_DRIFT, i]) * (
                max_drift - max_force / stiffness
            )
            pinched_force = (
                law_parameters[_PINCHING_FORCE, i]
                * max_force
                * (pinched_drift - zero_drift)
                / (max_drift - zero_drift)
            )
            law_state[first + _PINCHED_DRIFT, i] = pinched_drift
            law_state[first + _PINCHED_FORCE, i] = pinched_force
            if zero_drift < pinched_drift - _REACHED_TOLERANCE * max_drift:
                set_loading_branch(
                    law_parameters,
                    law_state,
                    i,
                    block,
                    side,
                    _PINCHED,
                    pinched_force / (pinched_drift - zero_drift),
                    pinched_drift,
                )
                return
        set_branch_to_peak(law_parameters, law_state, i, block, side)

    @outlined
    def resume_loading(law_parameters, law_state, i, block, side):
        """Set the branch after an interrupted unloading that returned to the last reversal.

        The story has been loaded again along the unloading line and has reached the last reversal.
        Loading continues towards the pinched point, the end of the flatter first part of reloading,
        if three conditions are met, otherwise towards the point of maximum drift:

            - drift and force of the pinched point are larger than the current drift and force
            - they are smaller than drift and force of the point of maximum drift
            - the line to the pinched point is less steep than the line to the point of maximum
              drift
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

        Row INTERNAL contains the type of the current branch. The next branch depends on the type
        and on the point where the branch ends:

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

        Parameters
        ----------
        event : float
            Reason for the end of the branch: ABOVE or BELOW (the drift exceeds the upper limit or
            falls below the lower limit) or REVERSED (the drift rate changes its sign).
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
            # INTERNAL has the sign of the side that was unloaded. A movement to the other side ends
            # at zero force, a movement back at the reversal.
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

        Column `i` of the tables `law_parameters` and `law_state` contains parameters and states of
        story `i`.
        """
        force = law_state[rows.FORCE, i]
        energy = 0.5 * force * force / law_state[extra_rows(law_state, 0) + _UNLOADING_STIFFNESS, i]
        # The types of all loading branches are above _UNLOADING. The stiffness is multiplied by 1 -
        # loss; the loss is limited to 0.9 to avoid a division by zero.
        if abs(law_state[rows.INTERNAL, i]) > _UNLOADING and force != 0.0:
            energy /= 1.0 - min(deterioration_at_reversal(law_parameters, law_state, i, 0), 0.9)
        return energy

    @inline
    def enter(law_parameters, law_state, i):
        """Set the limits of the first branch of story `i`, the yield drifts, and the initial state.

        The first branch is elastic. The caller has already set SLOPE to the initial stiffness and
        RATE_SIGN to 0 (valid in both directions). FORCE and INTERNAL (type of the branch) are 0 at
        the start of a run.

        The yield points are also the initial points of maximum drift and the initial last peaks.
        The remaining fractions of strength (_STRENGTH) and of the capping line (_CAPPING) are 1.
        The unloading stiffness (_UNLOADING_STIFFNESS) is the initial stiffness.
        _REVERSAL_DRIFT is infinite, because there has been no reversal.

        Column `i` of `law_parameters` contains the parameters of the story. The committed state, in
        the first rows of column `i` of `law_state`, is changed.
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
    """Return an error message if the parameters of a side are inconsistent, otherwise None.

    The ultimate drift must exceed the yield drift, and the residual ratio must not exceed the
    capping ratio. The parameters of the positive side are followed by the parameters of the
    negative side.

    `stiffness` is the initial stiffness, N/m.
    """
    for side_values, group in ((values[:_SIDE], ""), (values[_SIDE : 2 * _SIDE], "negative.")):
        # The check does not need the plastic and post-capping drifts and the deterioration rate.
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
    compiled_separately=True,
    extra_rows=_EXTRA_ROWS,
    yield_drift=yields_at_its_strength,
    stiffness_after_yield=_slope_to_capping,
    fault=_fault,
    falls=lambda stiffness, values: True,
    failed=_FAILED,
)
