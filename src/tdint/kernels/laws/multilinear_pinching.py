"""Multilinear law with pinched reloading, for the capacity curves of regional models.

The backbone curve of each side rises or falls through four points. After the last point it is
constant, or continues with its last slope if this slope is positive. A reversal starts a path of at
most three linear parts to the point of maximum drift of the side towards which the story moves:
unloading to the fraction `unloading` of the force at the third point, then to the fractions `drift`
and `force` of the point of maximum drift, then to that point. The law is Pinching4 of OpenSees
(Lowes and Altoontash 2003), with two differences: each reversal occurs at its exact drift and not
at the end of a time step, and effects of rounding are removed.

At each reversal, degradation reduces stiffness and strength and increases the maximum drifts by the
fraction

    peak (maximum drift / drift of the last backbone point)^peak_exponent
        + work ((work done on the story - elastic energy) / energy capacity)^work_exponent <= limit

The factors, exponents and limits are separate parameters of the three types of degradation
(stiffness, drift and strength). The fractions of stiffness and strength are totals relative to the
law without degradation. The fraction of drift is the increase of a stored maximum drift at this
reversal. The energy capacity is the parameter `capacity` times the area below the backbone curve.
There is no degradation before the first yielding.

In the functions below, `side` is 1 or -1, and drifts and forces with a `side` are positive in the
direction of the side. The stored maximum drifts (rows HIGH_DRIFT and LOW_DRIFT) are positive on
both sides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter

# Rows of `law_parameters`: drift and force of four points of the positive side, then of the
# negative side (_SIDE rows later), then the pinching parameters of both sides, and from row
# _..._DEGRADATION on peak, work, peak_exponent, work_exponent and limit of a type of degradation.
_POINTS = rows.FIRST_PARAMETER
_PINCHING = rows.FIRST_PARAMETER + 16
_SIDE = 8
_PINCHING_SIDE = 3
_ULTIMATE = rows.FIRST_PARAMETER + 22
_STIFFNESS_DEGRADATION = rows.FIRST_PARAMETER + 23
_DRIFT_DEGRADATION = rows.FIRST_PARAMETER + 28
_STRENGTH_DEGRADATION = rows.FIRST_PARAMETER + 33
_CAPACITY = rows.FIRST_PARAMETER + 38

# The following are extra rows of the law state, relative to its first extra row.
# Drift and force of the three points of the current path; both are positive in the direction in
# which the path leads.
_PATH_POINTS = 0
# Fractions of strength and stiffness that have been lost until the last reversal, relative to the
# law without degradation
_STRENGTH_LOSS = 6
_STIFFNESS_LOSS = 7
# Three results of `degradation` at the moment when the drift of the last backbone point was
# reached
_LAST_LOSSES = 8
_EXTRA_ROWS = _LAST_LOSSES + 3

# Types of branches in row INTERNAL, negative on the negative side; 0 before the first branch
_ON_PATH = 1.0
_ON_BACKBONE = 2.0
_FAILED = 3.0  # no strength; positive for both sides

# Fraction of a drift. A point is regarded as reached if its distance from the drift is smaller than
# this fraction.
_REACHED_TOLERANCE = 1e-12
_EQUAL = 1e-12  # relative difference of stiffnesses that is regarded as rounding error
# Relative difference of the slope of the pinched part and the stiffness, regarded as rounding.
# Before the first yielding, all parts of a path are on one line.
_STEEP = 1e-9
# Difference of the force fractions at the end of the pinched part and at the end of unloading, at
# or below which the reloading is not pinched
_NO_PINCHING = 1e-8
_MIN_SLOPE = 1e-8  # relative to the stiffness; minimum slope of a path


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import (
        REST,
        extra_rows,
        fail,
        follow_branches,
        set_directed,
        side_row,
    )

    @inline
    def point_drift(law_parameters, i, side, point):
        """Return the drift of point `point` (1 to 4) of the backbone curve, m."""
        # The rows of a side contain drift and force of point 1, then of point 2, and so on.
        return law_parameters[(_POINTS if side > 0.0 else _POINTS + _SIDE) + 2 * (point - 1), i]

    @inline
    def point_force(law_parameters, i, side, point):
        """Return the force of point `point` (1 to 4) of the backbone curve, N."""
        # The rows of a side contain drift and force of point 1, then of point 2, and so on.
        return law_parameters[(_POINTS if side > 0.0 else _POINTS + _SIDE) + 2 * point - 1, i]

    @inline
    def pinching(law_parameters, i, side, index):
        """Return a pinching parameter of a side: `drift` (index 0), `force` (1) or `unloading` (2).

        The story unloads to the fraction `unloading` of the force of the third backbone point, or
        of the fourth point if the maximum drift exceeds the third point.
        """
        return law_parameters[(_PINCHING if side > 0.0 else _PINCHING + _PINCHING_SIDE) + index, i]

    @inline
    def stiffness(law_parameters, i, side):
        """Return the stiffness of the first line of the backbone curve of a side, N/m."""
        return point_force(law_parameters, i, side, 1) / point_drift(law_parameters, i, side, 1)

    @inline
    def last_slope(law_parameters, i, side):
        """Return the slope of a side beyond the last backbone point, N/m, at least 0."""
        rise = point_force(law_parameters, i, side, 4) - point_force(law_parameters, i, side, 3)
        return max(rise, 0.0) / (
            point_drift(law_parameters, i, side, 4) - point_drift(law_parameters, i, side, 3)
        )

    @outlined
    def backbone(law_parameters, i, side, drift):
        """Return the force of the backbone curve of a side without degradation at a drift, N."""
        start, start_force = 0.0, 0.0
        for point in range(1, 5):
            end = point_drift(law_parameters, i, side, point)
            force = point_force(law_parameters, i, side, point)
            if drift <= end:
                return start_force + (drift - start) * (force - start_force) / (end - start)
            start, start_force = end, force
        return start_force + last_slope(law_parameters, i, side) * (drift - start)

    @inline
    def area(law_parameters, i, side):
        """Return the area below the backbone curve of a side from zero drift to its last point,
        J."""
        start, start_force, total = 0.0, 0.0, 0.0
        for point in range(1, 5):
            end = point_drift(law_parameters, i, side, point)
            force = point_force(law_parameters, i, side, point)
            total += 0.5 * (start_force + force) * (end - start)
            start, start_force = end, force
        return total

    @inline
    def last_drift(law_parameters, i):
        """Return the drift of the last backbone point, m: the larger value of both sides."""
        return max(point_drift(law_parameters, i, 1.0, 4), point_drift(law_parameters, i, -1.0, 4))

    @inline
    def degrades(law_parameters, i):
        """Return True if the limit of a type of degradation is positive.

        Limits are not negative (checked when a model is read), so that their sum is positive if and
        only if a limit is positive.
        """
        limits = 0.0
        for row in (_STIFFNESS_DEGRADATION, _DRIFT_DEGRADATION, _STRENGTH_DEGRADATION):
            limits += law_parameters[row + 4, i]
        return limits > 0.0

    @inline
    def loss(law_parameters, i, row, drift_ratio, used_capacity):
        """Return the fraction of the type of degradation whose parameters start in `row`.

        `drift_ratio` is the maximum drift over the drift of the last backbone point.
        `used_capacity` is the dissipated work over the energy capacity; not positive if the
        response is elastic.
        """
        limit = law_parameters[row + 4, i]
        # The limit is reached when the energy capacity is used up.
        if limit == 0.0 or used_capacity >= 1.0:
            return limit
        lost_fraction = law_parameters[row, i] * drift_ratio ** law_parameters[row + 2, i]
        if used_capacity > 0.0:
            lost_fraction += (
                law_parameters[row + 1, i] * used_capacity ** law_parameters[row + 3, i]
            )
        return min(lost_fraction, limit)

    @inline
    def has_yielded(law_parameters, law_state, i, block):
        """Return True if the maximum drift of a side exceeds the first point of the backbone curve.

        The stored maximum drifts are updated only at reversals. The current drift is therefore
        included if the story is on the backbone curve.
        """
        for side in (1.0, -1.0):
            reached = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
            if law_state[block + rows.INTERNAL, i] == side * _ON_BACKBONE:
                reached = max(reached, side * law_state[block + rows.DRIFT, i])
            if reached > point_drift(law_parameters, i, side, 1):
                return True
        return False

    @outlined
    def degradation(law_parameters, law_state, i, block):
        """Return the fractions ks (stiffness), ds (maximum drift) and fs (strength) of the
        degradation by a reversal at the current state.

        They are only computed here; `start_path` applies them at the reversal. ks and fs are total
        losses relative to the law without degradation; ds is the increase at this reversal only.

        As in Pinching4, the current drift is not part of the maximum drift, even if it is larger:
        `start_path` updates the stored values after it has called this function. The energy
        capacity is the capacity of the side with the larger area.

        ks is bounded: the remaining fraction 1 - ks of the stiffness is at least the ratio of the
        secant stiffness, to the point of maximum drift on the degraded backbone curve, to the
        stiffness of the first line. Since ks applies to both sides, the side with the larger ratio
        determines the bound.
        """
        first = extra_rows(law_state, block)
        drift = law_state[block + rows.DRIFT, i]
        if not degrades(law_parameters, i) or not has_yielded(law_parameters, law_state, i, block):
            return 0.0, 0.0, 0.0
        last_backbone_drift = last_drift(law_parameters, i)
        # Above the last drift, the fractions are constant: `switch` has stored them.
        if abs(drift) > last_backbone_drift * (1.0 + _REACHED_TOLERANCE):
            return (
                law_state[first + _LAST_LOSSES, i],
                law_state[first + _LAST_LOSSES + 1, i],
                law_state[first + _LAST_LOSSES + 2, i],
            )
        # Unloading with the current degraded stiffness k would release the elastic energy F^2 / (2
        # k).
        force, work = law_state[block + rows.FORCE, i], law_state[block + rows.WORK, i]
        capacity = law_parameters[_CAPACITY, i] * max(
            area(law_parameters, i, 1.0), area(law_parameters, i, -1.0)
        )
        k = stiffness(law_parameters, i, 1.0 if drift > 0.0 else -1.0) * (
            1.0 - law_state[first + _STIFFNESS_LOSS, i]
        )
        # If the work reaches the capacity, the capacity is used up, even if a part of the work is
        # elastic. For any value from 1 on, `loss` returns the limit.
        used_capacity = 2.0 if work >= capacity else (work - 0.5 * force * force / k) / capacity
        # Upper bound of ks
        secant_ratio = 0.0
        for side in (1.0, -1.0):
            max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
            secant = backbone(law_parameters, i, side, max_drift) / max_drift
            secant_ratio = max(secant_ratio, secant / stiffness(law_parameters, i, side))
        remaining = 1.0 - law_state[first + _STRENGTH_LOSS, i]
        largest = max(law_state[block + rows.HIGH_DRIFT, i], law_state[block + rows.LOW_DRIFT, i])
        drift_ratio = largest / last_backbone_drift
        stiffness_loss = loss(law_parameters, i, _STIFFNESS_DEGRADATION, drift_ratio, used_capacity)
        return (
            min(stiffness_loss, max(0.0, 1.0 - secant_ratio * remaining)),
            loss(law_parameters, i, _DRIFT_DEGRADATION, drift_ratio, used_capacity),
            loss(law_parameters, i, _STRENGTH_DEGRADATION, drift_ratio, used_capacity),
        )

    @inline
    def validated_path(start_drift, start_force, points, min_slope, max_slope):
        """Return the points of a path if no drift or force decreases, otherwise a replacement.

        The replacement is, as in Pinching4, a line to the origin and a line from there to the point
        of maximum drift, if the slope of the direct line from the start to this point is between
        `min_slope` and `max_slope`, and otherwise the direct line (all points are then the last
        point).
        """
        unloading_drift, unloading_force, pinched_drift, pinched_force, end_drift, end_force = (
            points
        )
        if (
            unloading_drift >= start_drift
            and pinched_drift >= unloading_drift
            and end_drift >= pinched_drift
            and unloading_force >= start_force
            and pinched_force >= unloading_force
            and end_force >= pinched_force
        ):
            return points
        slope = (end_force - start_force) / (end_drift - start_drift)
        if slope > min_slope and slope < max_slope:
            return 0.0, 0.0, 0.0, 0.0, end_drift, end_force
        return end_drift, end_force, end_drift, end_force, end_drift, end_force

    @inline
    def reloading_point(
        law_parameters, i, side, strength_factor, k, max_drift, force, is_beyond_third
    ):
        """Return the end of the pinched part of reloading: drift (m) and force (N).

        It is at the fractions `drift` and `force` of the point of maximum drift, with two
        exceptions:

        - If the fraction `force` does not exceed the fraction `unloading`, the reloading is not
          pinched,
          and the force is replaced.
        - If the last part would be steeper than the loading stiffness k, the drift is reduced.

        `is_beyond_third` is True if the maximum drift exceeds the third point of the backbone
        curve.
        """
        force_fraction = pinching(law_parameters, i, side, 1)
        unloading_fraction = pinching(law_parameters, i, side, 2)
        pinched_drift = pinching(law_parameters, i, side, 0) * max_drift
        pinched_force = force_fraction * force
        # As in Pinching4, the reference force can differ from the force at the end of unloading:
        # for a maximum drift beyond the third point, `path` computes the latter with the force of
        # the fourth point.
        if force_fraction - unloading_fraction <= _NO_PINCHING:
            reference_force = (
                force
                if is_beyond_third
                else strength_factor * point_force(law_parameters, i, side, 3)
            )
            pinched_force = max(
                reference_force * unloading_fraction,
                strength_factor * point_force(law_parameters, i, side, 4),
            ) * (1.0 + 1e-6)
        # A part with the loading stiffness k is not vertical.
        if force - pinched_force > k * (max_drift - pinched_drift) or pinched_drift == max_drift:
            pinched_drift = max_drift - (force - pinched_force) / k
        return pinched_drift, pinched_force

    @outlined
    def path(law_parameters, i, side, start_drift, start_force, previous_max_drift, losses):
        """Return drift (m) and force (N) of the three points of the path after a reversal.

        `side` is the side towards which the story moves; drift and force of the reversal are
        usually negative. The path leads from the reversal in straight lines to

        1. the end of unloading, which has the fraction `unloading` of the degraded force of the
           third backbone point, or of the fourth point if the maximum drift exceeds the third
           point,
        2. the end of the pinched part (`reloading_point`), and
        3. the point of maximum drift, with the degraded force. `previous_max_drift` is the maximum
           drift before its increase by degradation.

        The points are computed in the order 3, 2, 1. As in Pinching4, points 1 and 2 are moved if a
        part would lead backwards or fall, or the path is the direct line from the reversal to point
        3 (all three points are then point 3). If a drift or force still decreases, `validated_path`
        replaces the path. `losses` is the result of `degradation`.
        """
        # As `end_drift` is positive, the first condition means that the drift of the reversal is
        # zero or positive, so that the path does not cross zero drift. It includes the second
        # condition.
        strength_factor = 1.0 - losses[2]
        k = stiffness(law_parameters, i, side) * (1.0 - losses[0])
        end_drift = previous_max_drift * (1.0 + losses[1])
        end_force = strength_factor * backbone(law_parameters, i, side, end_drift)
        if start_drift * end_drift >= 0.0 or start_drift >= end_drift:
            return end_drift, end_force, end_drift, end_force, end_drift, end_force
        # The story unloads on the opposite side.
        unloading_stiffness = stiffness(law_parameters, i, -side) * (1.0 - losses[0])
        # `secant` is the upper limit of the slope of the direct line in `validated_path`. As in
        # Pinching4, the negative side is used for both directions of movement.
        secant = start_force / start_drift if side > 0.0 else end_force / end_drift
        is_beyond_third = previous_max_drift > point_drift(law_parameters, i, side, 3)
        pinched_drift, pinched_force = reloading_point(
            law_parameters, i, side, strength_factor, k, end_drift, end_force, is_beyond_third
        )
        if pinched_drift < start_drift:  # point 2 is behind the reversal
            return end_drift, end_force, end_drift, end_force, end_drift, end_force
        unloading_force = (
            pinching(law_parameters, i, side, 2)
            * strength_factor
            * point_force(law_parameters, i, side, 4 if is_beyond_third else 3)
        )
        unloading_drift = start_drift + (unloading_force - start_force) / unloading_stiffness
        if unloading_drift < start_drift:
            # Unloading would lead backwards.
            unloading_drift = 0.5 * (start_drift + pinched_drift)
            unloading_force = 0.5 * (start_force + pinched_force)
        elif (
            pinched_drift != unloading_drift
            and (pinched_force - unloading_force) / (pinched_drift - unloading_drift)
            > max(k, unloading_stiffness) * (1.0 - _STEEP)
        ) or (pinched_drift == unloading_drift and pinched_force > unloading_force):
            # The slope of the pinched part exceeds both stiffnesses, or the part is vertical and
            # rises. The first condition includes parts that lead backwards and fall steeply, and
            # the paths of an elastic story.
            return end_drift, end_force, end_drift, end_force, end_drift, end_force
        elif pinched_drift < unloading_drift or pinched_force < unloading_force:
            # The pinched part leads backwards or falls.
            if unloading_drift > 0.0:
                unloading_drift = 0.5 * (start_drift + pinched_drift)
                unloading_force = 0.5 * (start_force + pinched_force)
            elif pinched_drift < 0.0:
                pinched_drift = 0.5 * (unloading_drift + end_drift)
                pinched_force = 0.5 * (unloading_force + end_force)
            else:
                # Both points are moved, along the unloading line and along the last line, to forces
                # 1 % below and above the mean of both forces.
                mean = 0.5 * (unloading_force + pinched_force)
                first_slope = (unloading_force - start_force) / (unloading_drift - start_drift)
                last_slope_of_path = (end_force - pinched_force) / (end_drift - pinched_drift)
                unloading_force, pinched_force = mean - abs(mean) / 100.0, mean + abs(mean) / 100.0
                unloading_drift = start_drift + (unloading_force - start_force) / first_slope
                pinched_drift = end_drift - (end_force - pinched_force) / last_slope_of_path
        points = (
            unloading_drift,
            unloading_force,
            pinched_drift,
            pinched_force,
            end_drift,
            end_force,
        )
        return validated_path(start_drift, start_force, points, _MIN_SLOPE * k, secant)

    @outlined
    def set_loading_branch(law_parameters, law_state, i, block, side, branch_type, slope, end):
        """Set a loading branch of a single side that ends at the drift `end` (infinite for no end)
        or earlier: at the ultimate drift, and at the last drift of the backbone curve, because the
        degradation is constant above it.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        end = min(end, law_parameters[_ULTIMATE, i])
        # `switch` stores the losses at the last drift.
        if degrades(law_parameters, i) and drift < last_drift(law_parameters, i) * (
            1.0 - _REACHED_TOLERANCE
        ):
            end = min(end, last_drift(law_parameters, i))
        set_directed(law_state, i, block, side, branch_type, slope, end)

    @outlined
    def set_backbone_branch(law_parameters, law_state, i, block, side):
        """Continue on the backbone curve, with the strength that remains after the last reversal:
        set its force and its branch at the current drift.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        strength_factor = 1.0 - law_state[extra_rows(law_state, block) + _STRENGTH_LOSS, i]
        law_state[block + rows.FORCE, i] = (
            side * strength_factor * backbone(law_parameters, i, side, drift)
        )
        start_drift, start_force = 0.0, 0.0
        for point in range(1, 5):
            end = point_drift(law_parameters, i, side, point)
            force = point_force(law_parameters, i, side, point)
            if drift < end * (1.0 - _REACHED_TOLERANCE):
                slope = strength_factor * (force - start_force) / (end - start_drift)
                set_loading_branch(
                    law_parameters, law_state, i, block, side, _ON_BACKBONE, slope, end
                )
                return
            start_drift, start_force = end, force
        slope = strength_factor * last_slope(law_parameters, i, side)
        set_loading_branch(law_parameters, law_state, i, block, side, _ON_BACKBONE, slope, math.inf)

    @outlined
    def continue_path(law_parameters, law_state, i, block, side):
        """Set the next of the three linear parts of the current path, or the backbone curve after
        its end.
        """
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        # `knot` is the row of the drift of a point; the next row contains its force.
        max_drift = law_state[first + _PATH_POINTS + 4, i]  # drift of the point of maximum drift
        for knot in range(_PATH_POINTS, _PATH_POINTS + 6, 2):
            end = law_state[first + knot, i]
            if drift < end - _REACHED_TOLERANCE * max_drift:
                slope = (law_state[first + knot + 1, i] - force) / (end - drift)
                set_loading_branch(law_parameters, law_state, i, block, side, _ON_PATH, slope, end)
                return
        set_backbone_branch(law_parameters, law_state, i, block, side)

    @outlined
    def start_path(law_parameters, law_state, i, block, side):
        """Start the reloading path towards `side` at a reversal, with new degradation."""
        first = extra_rows(law_state, block)
        drift = law_state[block + rows.DRIFT, i]
        losses = degradation(law_parameters, law_state, i, block)
        # After a reversal on the backbone curve, the stored maximum drift of the side that is
        # unloaded increases by degradation and includes the drift of the reversal.
        if abs(law_state[block + rows.INTERNAL, i]) == _ON_BACKBONE:
            maximum_row = side_row(-side, rows.HIGH_DRIFT)
            increased_drift = law_state[block + maximum_row, i] * (1.0 + losses[1])
            law_state[block + maximum_row, i] = max(increased_drift, -side * drift)
        # As in Pinching4, the maximum drift of `side` is increased for this path only and not
        # stored.
        stiffness_loss, _, strength_loss = losses
        law_state[first + _STIFFNESS_LOSS, i] = stiffness_loss
        law_state[first + _STRENGTH_LOSS, i] = strength_loss
        max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        force = side * law_state[block + rows.FORCE, i]
        points = path(law_parameters, i, side, side * drift, force, max_drift, losses)
        for row in range(6):
            law_state[first + _PATH_POINTS + row, i] = points[row]
        continue_path(law_parameters, law_state, i, block, side)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows the current branch at its end, and store the losses at the
        last drift of the backbone curve, because they remain constant above it.

        `event` is ABOVE or BELOW (the drift exceeds the upper limit or falls below the lower limit)
        or REVERSED.
        """
        branch_type = abs(law_state[block + rows.INTERNAL, i])
        # ABOVE is 1 and BELOW is -1: these events are also the side of the story that is loaded.
        # `reached_drift` is not used after a reversal.
        reached_drift = event * law_state[block + rows.DRIFT, i]
        if event == rows.REVERSED:
            start_path(law_parameters, law_state, i, block, -law_state[block + rows.RATE_SIGN, i])
            return
        if reached_drift >= law_parameters[_ULTIMATE, i] * (1.0 - _REACHED_TOLERANCE):
            fail(law_state, i, block, _FAILED)
            return
        if (
            degrades(law_parameters, i)
            and abs(reached_drift / last_drift(law_parameters, i) - 1.0) <= _REACHED_TOLERANCE
        ):
            losses = degradation(law_parameters, law_state, i, block)
            first = extra_rows(law_state, block) + _LAST_LOSSES
            for row in range(3):
                law_state[first + row, i] = losses[row]
        if branch_type == _ON_PATH:
            continue_path(law_parameters, law_state, i, block, event)
        else:
            set_backbone_branch(law_parameters, law_state, i, block, event)

    @inline
    def released_energy(start_drift, start_force, points):
        """Return the energy that the story releases on a path from a negative force to zero force,
        J.

        It is the area between the path and the drift axis, up to the drift where the force is zero.
        """
        # Points behind the start have already been passed.
        energy = 0.0
        for row in range(0, 6, 2):
            end, force = points[row], points[row + 1]
            if end > start_drift:
                if force >= 0.0:
                    return energy + 0.5 * start_force * start_force * (end - start_drift) / (
                        force - start_force
                    )
                energy -= 0.5 * (start_force + force) * (end - start_drift)
                start_drift, start_force = end, force
        return energy

    @outlined
    def strain_energy(law_parameters, law_state, i):
        """Return the stored energy of the committed state, J: the energy that unloading to zero
        force releases (`released_energy`).

        During loading, it is the energy of the path that would follow a reversal at this state.
        """
        drift, force = law_state[rows.DRIFT, i], law_state[rows.FORCE, i]
        if force == 0.0:
            return 0.0
        if law_state[rows.INTERNAL, i] == 0.0:
            return 0.5 * force * force / law_parameters[rows.STIFFNESS, i]
        first = extra_rows(law_state, 0)
        # If the force has the opposite sign of the movement, the story is unloading on its current
        # path.
        side = law_state[rows.RATE_SIGN, i]
        if side * force < 0.0:
            row = first + _PATH_POINTS
            points = (
                law_state[row, i],
                law_state[row + 1, i],
                law_state[row + 2, i],
                law_state[row + 3, i],
                law_state[row + 4, i],
                law_state[row + 5, i],
            )
        else:
            # A reversal at the current state would start a path towards the other side.
            side = -side
            max_drift = law_state[side_row(side, rows.HIGH_DRIFT), i]
            losses = degradation(law_parameters, law_state, i, 0)
            points = path(law_parameters, i, side, side * drift, side * force, max_drift, losses)
        return released_energy(side * drift, side * force, points)

    @inline
    def is_elastic_before_yielding(law_parameters, i):
        """Return True if all paths before the first yielding coincide with a single straight line.

        The first branch can then extend to the first points of the backbone curves. Before the
        first yielding, the point of maximum drift of a side is the first point of its backbone
        curve, and there is no degradation. The conditions, 2 to 4 for each side, are

        1. the stiffnesses of the first lines of both sides are equal
        2. the reloading is pinched: without a pinched part, `reloading_point` sets the force of its
           end from the third and fourth points of the backbone curve
        3. the force fraction of the end of the pinched part is at most its drift fraction.
           `reloading_point` then moves this end to the line with the stiffness of the first line;
           with a larger force fraction, the end would be above the line
        4. the force at the end of unloading, which is on the line, is smaller than the force at the
           end of the pinched part. Otherwise the pinched part would lead backwards, and `path`
           would correct it
        """
        # Condition 1
        if (
            abs(stiffness(law_parameters, i, -1.0) / stiffness(law_parameters, i, 1.0) - 1.0)
            > _EQUAL
        ):
            return False
        for side in (1.0, -1.0):
            drift_fraction = pinching(law_parameters, i, side, 0)
            force_fraction = pinching(law_parameters, i, side, 1)
            unloading_fraction = pinching(law_parameters, i, side, 2)
            # Conditions 2 and 3
            if not (
                unloading_fraction < force_fraction - _NO_PINCHING
                and force_fraction <= drift_fraction
            ):
                return False
            # Condition 4. The force at the end of unloading is a fraction of the force of point 3,
            # the force at the end of the pinched part a fraction of the force of point 1.
            if unloading_fraction * point_force(
                law_parameters, i, side, 3
            ) >= force_fraction * point_force(law_parameters, i, side, 1):
                return False
        return True

    @inline
    def enter(law_parameters, law_state, i):
        """Set the initial maximum drifts and the limits of the first branch of story `i`.

        The first branch ends at the drift of the first point of the backbone curve. If the paths
        before the first yielding do not coincide with a straight line, reversals below the first
        point change the path. The first branch then ends at the very small fraction REST of the
        maximum drift.
        """
        fraction = 1.0 if is_elastic_before_yielding(law_parameters, i) else REST
        high, low = point_drift(law_parameters, i, 1.0, 1), point_drift(law_parameters, i, -1.0, 1)
        ultimate = law_parameters[_ULTIMATE, i]
        law_state[rows.HIGH_DRIFT, i] = high
        law_state[rows.LOW_DRIFT, i] = low
        law_state[rows.UPPER, i] = min(fraction * high, ultimate)
        law_state[rows.LOWER, i] = -min(fraction * low, ultimate)

    return follow_branches(switch, strain_energy, enter)


def _slopes(side: Sequence[float]) -> list[float]:
    """Return the slopes of the four lines of the backbone curve of a single side, N/m.

    `side` contains drift and force of each of the four points in succession.
    """
    points = [(0.0, 0.0), *zip(side[::2], side[1::2], strict=True)]
    return [
        (force_1 - force_0) / (drift_1 - drift_0)
        for (drift_0, force_0), (drift_1, force_1) in pairwise(points)
    ]


def _stiffens(values: Sequence[float]) -> bool:
    """Return True if a line of the backbone curve is stiffer than the first line of the positive
    side.
    """
    first_slope = values[1] / values[0]
    return max(*_slopes(values[:_SIDE]), *_slopes(values[_SIDE : 2 * _SIDE])) > first_slope * (
        1.0 + _EQUAL
    )


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return an error message if the drifts of a backbone curve do not increase, otherwise None.

    The bounds of the parameter `backbone` ensure that all drifts and forces are positive.
    """
    # Every second value of a side is a drift.
    for drifts, name in (
        (values[0:_SIDE:2], "backbone"),
        (values[_SIDE : 2 * _SIDE : 2], "negative.backbone"),
    ):
        if any(next_drift <= drift for drift, next_drift in pairwise(drifts)):
            return (
                f"the drifts of {name} must rise from point to point, got "
                f"{', '.join(f'{d:.6g}' for d in drifts)} m"
            )
    return None


_PINCHING_PARAMETERS = (
    LawParameter("drift", low=0.0, high=1.0, group="pinching"),
    LawParameter("force", low=0.0, high=1.0, group="pinching"),
    LawParameter("unloading", low=-1.0, high=1.0, group="pinching"),
)


def _has_equal_sides(values: Sequence[float]) -> bool:
    """Return True if both sides have the same backbone curve and the same pinching."""
    backbones, pinching = values[: 2 * _SIDE], values[2 * _SIDE :][: 2 * _PINCHING_SIDE]
    return (backbones[:_SIDE], pinching[:_PINCHING_SIDE]) == (
        backbones[_SIDE:],
        pinching[_PINCHING_SIDE:],
    )


def _degradation_parameters(name: str) -> tuple[LawParameter, ...]:
    """Return the declarations of the five parameters of a type of degradation: `stiffness`, `drift`
    or `strength`.

    `without` is the value of a parameter in a model without this group.
    """
    group = f"degradation.{name}"
    fraction = LawParameter("peak", low=0.0, default=0.0, group=group, without=0.0)
    exponent = replace(fraction, default=1.0, without=1.0)
    return (
        fraction,
        replace(fraction, name="work"),
        replace(exponent, name="peak_exponent"),
        replace(exponent, name="work_exponent"),
        LawParameter("limit", low=0.0, high=1.0, high_allowed=False, group=group, without=0.0),
    )


_BACKBONE = LawParameter("backbone", points=4, low=0.0, low_allowed=False)

LAW = DriftLaw(
    "multilinear-pinching",
    "backbone through two to four points a side, rising or falling; unloads, pinches and reloads "
    "along straight lines (Pinching4)",
    _functions,
    parameters=(
        _BACKBONE,
        replace(_BACKBONE, default="backbone", group="negative"),
        *_PINCHING_PARAMETERS,
        *(
            replace(parameter, default=parameter.name, group="negative.pinching")
            for parameter in _PINCHING_PARAMETERS
        ),
        LawParameter("ultimate_drift", length=1, low=0.0, low_allowed=False, default=math.inf),
        *_degradation_parameters("stiffness"),
        *_degradation_parameters("drift"),
        *_degradation_parameters("strength"),
        LawParameter("capacity", low=0.0, low_allowed=False, group="degradation", without=math.inf),
    ),
    kinked=True,
    equal_directions=_has_equal_sides,
    extra_rows=_EXTRA_ROWS,
    initial_stiffness=lambda values: values[1] / values[0],
    yield_drift=lambda stiffness, values: values[0],  # the first point of the positive side
    stiffens=_stiffens,
    fault=_fault,
    falls=lambda stiffness, values: True,  # lines of reloading and unloading can fall
    failed=_FAILED,
)
