"""Multilinear law with pinched reloading, for the capacity curves of regional models.

The backbone curve of each side rises or falls through four points. Beyond the last point it is
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

In the functions below, drifts and forces with a `side` are positive in the direction of that side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter

# Rows of `law_parameters`: drift and force of four points of the positive side, then of the
# negative side (_SIDE rows later), then the pinching parameters of both sides.
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

# Types of branches in row INTERNAL. The value is negative on the negative side, and 0 before the
# first branch.
_ON_PATH = 1.0
_ON_BACKBONE = 2.0
_FAILED = 3.0  # no strength; the value is positive for both sides

# Fraction of a drift. A point is regarded as reached if the drift is closer to it than this.
_REACHED_TOLERANCE = 1e-12
# Fraction of the drift of the first backbone point. Until the drift of a story first exceeds this
# fraction in either direction, its reversals are not counted and do not change the path. Otherwise,
# an upper story of a building at rest, which reverses at about 1e-10 m because of the time
# discretization, would lose up to a fifth of its stiffness. The value is a tenth of the limit in
# OpenSees. Forces of this size are negligible in any response.
_MIN_REVERSAL = 1e-5
_EQUAL = 1e-12  # relative difference of stiffnesses that is regarded as rounding error
# Difference of the force fractions at the end of the pinched part and at the end of unloading, at
# or below which the reloading is not pinched
_NO_PINCHING = 1e-8
_MIN_SLOPE = 1e-8  # relative to the stiffness; minimum slope of a path


def _functions() -> LawFunctions:
    """Return the compiled functions of the multilinear law with pinched reloading (Pinching4).

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
        `row`, and a row for the negative side (`side` -1) two rows later: LOW_DRIFT for HIGH_DRIFT.
        In this law, the values of both sides are positive, also in row LOW_DRIFT.
        """
        return row if side > 0.0 else row + 2

    @inline
    def point_drift(law_parameters, i, side, point):
        """Return the drift of point `point` (1 to 4) of the backbone curve, m.

        `point` is the number of the point, 1 to 4.
        """
        # The rows of a side contain drift and force of point 1, then of point 2, and so on.
        return law_parameters[(_POINTS if side > 0.0 else _POINTS + _SIDE) + 2 * (point - 1), i]

    @inline
    def point_force(law_parameters, i, side, point):
        """Return the force of point `point` (1 to 4) of the backbone curve, N.

        `point` is the number of the point, 1 to 4.
        """
        # The rows of a side contain drift and force of point 1, then of point 2, and so on.
        return law_parameters[(_POINTS if side > 0.0 else _POINTS + _SIDE) + 2 * point - 1, i]

    @inline
    def pinching(law_parameters, i, side, index):
        """Return a pinching parameter of a side of the story.

        The parameter with index 0 is the fraction `drift` of the maximum drift and with index 1 the
        fraction `force` of its force, where the pinched part of reloading ends. Index 2 is the
        fraction `unloading`: the story unloads to this fraction of the force of the third backbone
        point, or of the fourth point if the maximum drift exceeds the third point.
        """
        return law_parameters[(_PINCHING if side > 0.0 else _PINCHING + _PINCHING_SIDE) + index, i]

    @inline
    def stiffness(law_parameters, i, side):
        """Return the stiffness of the first line of the backbone curve of a side, N/m.

        It is the force of the first point divided by its drift; `side` is 1 or -1.

        Column `i` of the table `law_parameters` contains the parameters of story `i`.
        """
        return point_force(law_parameters, i, side, 1) / point_drift(law_parameters, i, side, 1)

    @inline
    def last_slope(law_parameters, i, side):
        """Return the slope of a side beyond the last point of the backbone curve, N/m, at least 0.

        It is the slope between the third and the fourth point, if it is positive; `side` is 1 or
        -1.

        Column `i` of the table `law_parameters` contains the parameters of story `i`.
        """
        rise = point_force(law_parameters, i, side, 4) - point_force(law_parameters, i, side, 3)
        return max(rise, 0.0) / (
            point_drift(law_parameters, i, side, 4) - point_drift(law_parameters, i, side, 3)
        )

    @outlined
    def backbone(law_parameters, i, side, drift):
        """Return the force of the backbone curve of a side without degradation, N, at a drift.

        The curve leads from zero through four points and is linear in between. Beyond the last
        point it continues with the slope `last_slope`.

        `drift` is the drift, m, positive on this side.
        """
        # Find the line that contains the drift; `start` and `end` are the drifts of its ends.
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
        """Return the area below the backbone curve of a side from zero drift to its last point, J.

        `side` is 1 or -1.

        Column `i` of the table `law_parameters` contains the parameters of story `i`.
        """
        start, start_force, total = 0.0, 0.0, 0.0
        for point in range(1, 5):
            end = point_drift(law_parameters, i, side, point)
            force = point_force(law_parameters, i, side, point)
            total += 0.5 * (start_force + force) * (end - start)
            start, start_force = end, force
        return total

    @inline
    def last_drift(law_parameters, i):
        """Return the drift of the last backbone point, m: the larger value of both sides.

        Column `i` of the table `law_parameters` contains the parameters of story `i`.
        """
        return max(point_drift(law_parameters, i, 1.0, 4), point_drift(law_parameters, i, -1.0, 4))

    @inline
    def degrades(law_parameters, i):
        """Return True if the story degrades: the limit of a type of degradation is positive.

        The types are stiffness, maximum drift and strength. The limit is the last of the five
        parameters of each type: peak, work, peak_exponent, work_exponent and limit. Limits are not
        negative (checked when a model is read), so that their sum is positive if and only if a
        limit is positive.

        Column `i` of the table `law_parameters` contains the parameters of story `i`.
        """
        limits = 0.0
        for row in (_STIFFNESS_DEGRADATION, _DRIFT_DEGRADATION, _STRENGTH_DEGRADATION):
            limits += law_parameters[row + 4, i]  # limit, the fifth parameter of the type
        return limits > 0.0

    @inline
    def loss(law_parameters, i, row, drift_ratio, used_capacity):
        """Return the fraction of a type of degradation: stiffness, drift or strength.

        The fraction is

            peak drift_ratio^peak_exponent + work used_capacity^work_exponent,   at most limit

        The five parameters of a type are in consecutive rows, from `row` on: peak, work,
        peak_exponent, work_exponent and limit. `degradation` describes the effect of the fraction.

        `drift_ratio` is the maximum drift over the drift of the last backbone point.
        `used_capacity` is the dissipated work over the energy capacity; not positive if the
        response is elastic. For 1 and more, the result is the limit.
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

        The maximum drifts of the positive side (row HIGH_DRIFT) and of the negative side (row
        LOW_DRIFT) are both positive in this law. They are updated only at reversals. The current
        drift is therefore included if the story is on the backbone curve. Row INTERNAL is the type
        of the branch (_ON_PATH or _ON_BACKBONE) with the sign of its side.
        """
        side = 1.0 if law_state[block + rows.INTERNAL, i] > 0.0 else -1.0
        is_on_backbone = abs(law_state[block + rows.INTERNAL, i]) == _ON_BACKBONE
        if is_on_backbone and side * law_state[block + rows.DRIFT, i] > point_drift(
            law_parameters, i, side, 1
        ):
            return True
        has_yielded_positive = law_state[block + rows.HIGH_DRIFT, i] > point_drift(
            law_parameters, i, 1.0, 1
        )
        return has_yielded_positive or law_state[block + rows.LOW_DRIFT, i] > point_drift(
            law_parameters, i, -1.0, 1
        )

    @outlined
    def degradation(law_parameters, law_state, i, block):
        """Return the degradation of stiffness, maximum drift and strength by a reversal at the
        current state, as three fractions.

        The three fractions are ks (stiffness), ds (maximum drift) and fs (strength). They are only
        computed here; `start_path` applies them at the reversal:

            stiffness        (1 - ks) times the stiffness of the first line of the backbone curve
            strength         (1 - fs) times the force of the backbone curve
            maximum drift    (1 + ds) times the stored maximum drift

        ks and fs are therefore total losses relative to the law without degradation; they replace
        the values of the last reversal. ds is the increase at this reversal only. Each fraction is
        at most the limit of its type of degradation (`loss`). With the parameters peak,
        peak_exponent, work and work_exponent of this type, the fraction is

            peak (maximum drift / last drift)^peak_exponent
                + work (dissipated work / energy capacity)^work_exponent

        The maximum drift is the larger of the two stored maximum drifts (rows HIGH_DRIFT and
        LOW_DRIFT), and the last drift is the drift of the last backbone point (`last_drift`). As in
        Pinching4, the current drift is not included, even if it is larger: `start_path` updates the
        rows after it has called this function. The current drift is only used in the tests whether
        the story has yielded and whether the last drift is exceeded. The dissipated work is the
        work done on the story (row WORK) minus its elastic energy. The energy capacity is the
        parameter `capacity` times the area below the backbone curve up to its last point (`area`),
        for the side with the larger area.

        The fractions are zero if all limits are zero (`degrades`) and before the first yielding
        (`has_yielded`). Above the last drift, they are constant: `switch` has stored them in the
        rows _LAST_LOSSES when the drift reached the last drift.

        Returns
        -------
        float, float, float
            ks, ds and fs. ks is bounded, as in Pinching4 of OpenSees: the remaining fraction 1 - ks
            of the stiffness is at least the ratio of the secant stiffness to the stiffness of the
            first line. The secant leads from the origin to the point of maximum drift on the
            degraded backbone curve. Since ks applies to both sides, the side with the larger ratio
            determines the bound. The bound also uses the stored maximum drifts.
        """
        first = extra_rows(law_state, block)
        drift = law_state[block + rows.DRIFT, i]
        if not degrades(law_parameters, i) or not has_yielded(law_parameters, law_state, i, block):
            return 0.0, 0.0, 0.0
        last_backbone_drift = last_drift(law_parameters, i)
        # Above the last drift, the fractions are constant: `switch` has stored them when the drift
        # reached the last drift.
        if abs(drift) > last_backbone_drift * (1.0 + _REACHED_TOLERANCE):
            return (
                law_state[first + _LAST_LOSSES, i],
                law_state[first + _LAST_LOSSES + 1, i],
                law_state[first + _LAST_LOSSES + 2, i],
            )
        # The dissipated work is the work minus the elastic energy F^2 / (2 k), which unloading with
        # the current degraded stiffness k would release.
        force, work = law_state[block + rows.FORCE, i], law_state[block + rows.WORK, i]
        capacity = law_parameters[_CAPACITY, i] * max(
            area(law_parameters, i, 1.0), area(law_parameters, i, -1.0)
        )
        k = stiffness(law_parameters, i, 1.0 if drift > 0.0 else -1.0) * (
            1.0 - law_state[first + _STIFFNESS_LOSS, i]
        )
        # If the work reaches the capacity, the capacity is used up, even if a part of the work is
        # elastic. For any value from 1 on, `loss` returns the limit; 2 is an arbitrary such value.
        used_capacity = 2.0 if work >= capacity else (work - 0.5 * force * force / k) / capacity
        # Upper bound of ks: secant stiffness of the backbone curve to the point of maximum drift,
        # divided by the stiffness of the first line, for the side with the larger ratio. The factor
        # 1 - _STRENGTH_LOSS below reduces the force of the secant to the degraded strength.
        secant_ratio = 0.0
        for side in (1.0, -1.0):
            max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
            secant_ratio = max(
                secant_ratio,
                backbone(law_parameters, i, side, max_drift)
                / max_drift
                / stiffness(law_parameters, i, side),
            )
        max_stiffness_loss = max(
            0.0, 1.0 - secant_ratio * (1.0 - law_state[first + _STRENGTH_LOSS, i])
        )
        drift_ratio = (
            max(law_state[block + rows.HIGH_DRIFT, i], law_state[block + rows.LOW_DRIFT, i])
            / last_backbone_drift
        )
        return (
            min(
                loss(law_parameters, i, _STIFFNESS_DEGRADATION, drift_ratio, used_capacity),
                max_stiffness_loss,
            ),
            loss(law_parameters, i, _DRIFT_DEGRADATION, drift_ratio, used_capacity),
            loss(law_parameters, i, _STRENGTH_DEGRADATION, drift_ratio, used_capacity),
        )

    @inline
    def validated_path(start_drift, start_force, points, min_slope, max_slope):
        """Return the points of a path if no drift or force decreases, otherwise a replacement.

        The path leads from the start to the end of unloading, to the end of the pinched part, and
        to the point of maximum drift. The direct line leads from the start to the point of maximum
        drift. The result is, as in Pinching4,

            1. the unchanged path, if drift and force do not decrease along the path
            2. otherwise, a line to the origin and a line from there to the point of maximum drift,
               if the slope of the direct line is between `min_slope` and `max_slope`
            3. otherwise, the direct line

        `start_drift` and `start_force` are the drift (m) and force (N) at the start of the path.
        All drifts and forces are positive in the direction of the path. `points` is the drift and
        force of the end of unloading, of the end of the pinched part, and of the point of maximum
        drift. `min_slope` and `max_slope`: limits of the slope of the direct line between which the
        two lines through the origin are used, N/m.

        Returns
        -------
        tuple of float
            Drift (m) and force (N) of the three points, in the order of `points`. In case 2, the
            first two points are the origin. In case 3, all points are the last point.
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

        Reloading has a flat (pinched) part that follows unloading, and a last part that leads to
        the point of maximum drift. The pinched part ends at the fractions `pinching.drift` and
        `pinching.force` of drift and force of the point of maximum drift, with two exceptions:

            - Unloading ends at the fraction `pinching.unloading`. If `pinching.force` does not
              exceed this fraction, the reloading is not pinched, and the force is replaced.
            - If the last part would be steeper than the loading stiffness, the drift is reduced.

        `k` is the loading stiffness, N/m. `is_beyond_third` is True if the maximum drift exceeds
        the third point of the backbone curve.
        """
        force_fraction = pinching(law_parameters, i, side, 1)
        unloading_fraction = pinching(law_parameters, i, side, 2)
        pinched_drift = pinching(law_parameters, i, side, 0) * max_drift
        pinched_force = force_fraction * force
        # Without a pinched part, the force is the larger of two forces, increased by the factor
        # 1 + 1e-6:
        # - `reference_force` times the fraction `unloading`. The reference force is the degraded
        #   force of the third backbone point. If the maximum drift exceeds the third point, it is
        #   the force at the maximum drift.
        # - the degraded force of the fourth backbone point
        # As in Pinching4, the first force can differ from the force at the end of unloading. `path`
        # computes the latter with the force of the fourth point if the maximum drift exceeds the
        # third point.
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
        # The last part of the path has at most the loading stiffness k, and is not vertical.
        if force - pinched_force > k * (max_drift - pinched_drift) or pinched_drift == max_drift:
            pinched_drift = max_drift - (force - pinched_force) / k
        return pinched_drift, pinched_force

    @outlined
    def path(law_parameters, i, side, start_drift, start_force, previous_max_drift, losses):
        """Return the path after a reversal: drift and force of three points.

        `side` is the side towards which the story moves after the reversal. All drifts and forces
        are positive in this direction; drift and force of the reversal are usually negative. The
        path leads from the reversal in straight lines to three points:

            1. End of unloading. The force is the pinching parameter `unloading` times the degraded
               force of the third backbone point, or of the fourth point if the maximum drift
               exceeds the third point. The drift follows from the unloading stiffness.
            2. End of the pinched part (`reloading_point`). Drift and force are the pinching
               parameters `drift` and `force` times drift and force of point 3.
            3. Point of maximum drift on side `side`, with the degraded force.

        The points are computed in the order 3, 2, 1. As in Pinching4 of OpenSees (Lowes and
        Altoontash 2003), points 1 and 2 are moved if a part would lead backwards or fall. The path
        is the direct line from the reversal to point 3 (all three points are then point 3) if

            - the drift of the reversal is zero or positive,
            - point 2 is behind the reversal, or
            - the pinched part is vertical and rises, or
            - the slope of the pinched part is larger than the stiffnesses of loading and unloading.
              The slope is the quotient of the differences of force and drift. It is also positive
              if the pinched part leads backwards and falls.

        If a drift or force still decreases along the path after the corrections, `validated_path`
        replaces the path by the direct line, or by two lines through the origin.

        `start_drift` and `start_force` are the drift (m) and force (N) at the reversal.
        `previous_max_drift` is the maximum drift of this side before its increase by degradation,
        m.

        Parameters
        ----------
        losses : tuple of float
            Fractions of stiffness, maximum drift and strength from `degradation`. Stiffness and
            strength are reduced, the maximum drift is increased by its fraction.

        Returns
        -------
        tuple of float
            Drift (m) and force (N) of point 1, of point 2 and of point 3, positive on this side.
        """
        # Compute point 3 from the losses of stiffness (losses[0]), maximum drift (losses[1]) and
        # strength (losses[2]). If the path does not cross zero drift, it is the direct line. As
        # `end_drift` is positive, the first condition means that the drift of the reversal is zero
        # or positive. It includes the second condition.
        strength_factor = 1.0 - losses[2]
        k = stiffness(law_parameters, i, side) * (1.0 - losses[0])
        end_drift = previous_max_drift * (1.0 + losses[1])
        end_force = strength_factor * backbone(law_parameters, i, side, end_drift)
        if start_drift * end_drift >= 0.0 or start_drift >= end_drift:
            return end_drift, end_force, end_drift, end_force, end_drift, end_force
        # Compute point 2, the end of the pinched part. The story unloads on the opposite side.
        unloading_stiffness = stiffness(law_parameters, i, -side) * (1.0 - losses[0])
        # `validated_path` uses `secant` as the upper limit of the slope of the direct line. It is
        # the slope of a line from the origin to a point on the negative side of the story. If the
        # story moves to the positive side, this point is the reversal, otherwise point 3. As in
        # Pinching4, the negative side is used for both directions of movement.
        secant = start_force / start_drift if side > 0.0 else end_force / end_drift
        is_beyond_third = previous_max_drift > point_drift(law_parameters, i, side, 3)
        pinched_drift, pinched_force = reloading_point(
            law_parameters, i, side, strength_factor, k, end_drift, end_force, is_beyond_third
        )
        if pinched_drift < start_drift:  # point 2 is behind the reversal: direct line
            return end_drift, end_force, end_drift, end_force, end_drift, end_force
        # Compute point 1, the end of unloading, and correct points 1 and 2 if necessary.
        unloading_force = (
            pinching(law_parameters, i, side, 2)
            * strength_factor
            * point_force(law_parameters, i, side, 4 if is_beyond_third else 3)
        )
        unloading_drift = start_drift + (unloading_force - start_force) / unloading_stiffness
        if unloading_drift < start_drift:
            # Unloading would lead backwards: it ends midway to the pinched point.
            unloading_drift = 0.5 * (start_drift + pinched_drift)
            unloading_force = 0.5 * (start_force + pinched_force)
        elif (
            pinched_drift != unloading_drift
            and (pinched_force - unloading_force) / (pinched_drift - unloading_drift)
            > max(k, unloading_stiffness)
        ) or (pinched_drift == unloading_drift and pinched_force > unloading_force):
            # The slope of the pinched part exceeds both stiffnesses, or the part is vertical and
            # rises. The path is therefore the direct line. The first condition includes parts that
            # lead backwards and fall steeply.
            return end_drift, end_force, end_drift, end_force, end_drift, end_force
        elif pinched_drift < unloading_drift or pinched_force < unloading_force:
            # The pinched part leads backwards or falls, and the condition above is not met. It is
            # corrected by one of three rules:
            # 1. If point 1 has a positive drift, it is moved midway between reversal and point 2.
            # 2. If point 2 has a negative drift, it is moved midway between points 1 and 3.
            # 3. Otherwise both points are moved.
            if unloading_drift > 0.0:
                unloading_drift = 0.5 * (start_drift + pinched_drift)
                unloading_force = 0.5 * (start_force + pinched_force)
            elif pinched_drift < 0.0:
                pinched_drift = 0.5 * (unloading_drift + end_drift)
                pinched_force = 0.5 * (unloading_force + end_force)
            else:
                # Move point 1 along the unloading line, and point 2 along the last line, to forces
                # 1 % below and above the mean of both forces.
                mean = 0.5 * (unloading_force + pinched_force)
                first_slope = (unloading_force - start_force) / (unloading_drift - start_drift)
                last_slope_of_path = (end_force - pinched_force) / (end_drift - pinched_drift)
                unloading_force, pinched_force = mean - abs(mean) / 100.0, mean + abs(mean) / 100.0
                unloading_drift = start_drift + (unloading_force - start_force) / first_slope
                pinched_drift = end_drift - (end_force - pinched_force) / last_slope_of_path
        return validated_path(
            start_drift,
            start_force,
            (unloading_drift, unloading_force, pinched_drift, pinched_force, end_drift, end_force),
            _MIN_SLOPE * k,
            secant,
        )

    @outlined
    def set_loading_branch(law_parameters, law_state, i, block, side, branch_type, slope, end):
        """Set a loading branch of one side that ends at the drift `end` or earlier.

        The branch ends earlier at the ultimate drift, where the story fails, and at the last drift
        of the backbone curve, because the degradation is constant above it. The branch consists of
        the rows INTERNAL, SLOPE, RATE_SIGN, UPPER and LOWER of the law state; it also ends at a
        reversal of the drift.

        `branch_type` is the type of the branch for row INTERNAL, a positive constant of this
        module. `slope` is the stiffness of the branch, N/m. `end` is the drift at the end of the
        branch, m, positive on this side; infinite for no end.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        end = min(end, law_parameters[_ULTIMATE, i])
        # If the story degrades, the branch also ends at the last drift of the backbone curve, where
        # `switch` stores the losses that remain constant above this drift.
        if degrades(law_parameters, i) and drift < last_drift(law_parameters, i) * (
            1.0 - _REACHED_TOLERANCE
        ):
            end = min(end, last_drift(law_parameters, i))
        law_state[block + rows.INTERNAL, i] = side * branch_type
        law_state[block + rows.SLOPE, i] = slope
        law_state[block + rows.RATE_SIGN, i] = side
        law_state[block + rows.UPPER, i] = end if side > 0.0 else math.inf
        law_state[block + rows.LOWER, i] = -end if side < 0.0 else -math.inf

    @outlined
    def set_backbone_branch(law_parameters, law_state, i, block, side):
        """Continue on the backbone curve: set its force and its branch at the current drift.

        The backbone curve consists of four lines through its points and a last line without end.
        Forces and slopes are multiplied by the fraction of the strength that remains after the last
        reversal.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        strength_factor = 1.0 - law_state[extra_rows(law_state, block) + _STRENGTH_LOSS, i]
        law_state[block + rows.FORCE, i] = (
            side * strength_factor * backbone(law_parameters, i, side, drift)
        )
        # The branch is the first line that ends at a larger drift than the current drift.
        start_drift, start_force = 0.0, 0.0
        for point in range(1, 5):
            end = point_drift(law_parameters, i, side, point)
            force = point_force(law_parameters, i, side, point)
            if drift < end * (1.0 - _REACHED_TOLERANCE):
                set_loading_branch(
                    law_parameters,
                    law_state,
                    i,
                    block,
                    side,
                    _ON_BACKBONE,
                    strength_factor * (force - start_force) / (end - start_drift),
                    end,
                )
                return
            start_drift, start_force = end, force
        # Beyond the last point, the branch is the last line without end.
        set_loading_branch(
            law_parameters,
            law_state,
            i,
            block,
            side,
            _ON_BACKBONE,
            strength_factor * last_slope(law_parameters, i, side),
            math.inf,
        )

    @outlined
    def continue_path(law_parameters, law_state, i, block, side):
        """Set the next of the three linear parts of the current path.

        The path leads from the last reversal to the end of unloading (point 1), to the end of the
        pinched part (point 2) and to the point of maximum drift (point 3). After the end of the
        path, the story continues on the backbone curve.
        """
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        # The rows from _PATH_POINTS on contain drift and force of point 1, of point 2 and of point
        # 3, which is the point of maximum drift. `knot` is the row of the drift of a point; the
        # next row contains its force. The branch leads to the first point not yet reached.
        max_drift = law_state[first + _PATH_POINTS + 4, i]  # drift of point 3
        for knot in range(_PATH_POINTS, _PATH_POINTS + 6, 2):
            end = law_state[first + knot, i]
            if drift < end - _REACHED_TOLERANCE * max_drift:
                slope = (law_state[first + knot + 1, i] - force) / (end - drift)
                set_loading_branch(law_parameters, law_state, i, block, side, _ON_PATH, slope, end)
                return
        set_backbone_branch(law_parameters, law_state, i, block, side)

    @outlined
    def start_path(law_parameters, law_state, i, block, side):
        """Start the reloading path towards `side` at a reversal, with new degradation.

        The losses of stiffness and strength replace the losses stored at the last reversal. The
        three points of the path (end of unloading, end of the pinched part, point of maximum drift)
        are computed and stored in the law state, and the first part of the path is set as branch.
        """
        first = extra_rows(law_state, block)
        drift = law_state[block + rows.DRIFT, i]
        losses = degradation(law_parameters, law_state, i, block)
        # After a reversal on the backbone curve, the stored maximum drift of the side that is
        # unloaded increases by degradation and includes the drift of the reversal.
        if abs(law_state[block + rows.INTERNAL, i]) == _ON_BACKBONE:
            maximum_row = side_row(-side, rows.HIGH_DRIFT)
            increased_drift = law_state[block + maximum_row, i] * (1.0 + losses[1])
            law_state[block + maximum_row, i] = max(increased_drift, -side * drift)
        # `path` multiplies the maximum drift of `side` by 1 + losses[1] (drift fraction) for this
        # path only. As in Pinching4, the increased value is not stored in the row of `side`.
        stiffness_loss, _, strength_loss = losses
        law_state[first + _STIFFNESS_LOSS, i] = stiffness_loss
        law_state[first + _STRENGTH_LOSS, i] = strength_loss
        max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        points = path(
            law_parameters,
            i,
            side,
            side * drift,
            side * law_state[block + rows.FORCE, i],
            max_drift,
            losses,
        )
        for row in range(6):
            law_state[first + _PATH_POINTS + row, i] = points[row]
        continue_path(law_parameters, law_state, i, block, side)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows the current branch at its end.

        Row INTERNAL contains the type of the current branch. The next branch depends on the type
        and on the point where the branch ends:

            reversal                                 path towards the other side (`start_path`)
            ultimate drift                           failure
            path (_ON_PATH), at one of its points    next part of the path (`continue_path`)
            backbone curve, at one of its points     next line of the backbone curve

        If the story degrades and reaches the last drift of the backbone curve, the losses are
        stored as well, because they remain constant above this drift.

        Parameters
        ----------
        event : float
            Reason for the end of the branch: ABOVE or BELOW (the drift exceeds the upper limit or
            falls below the lower limit) or REVERSED (the drift rate changes its sign).
        """
        branch_type = abs(law_state[block + rows.INTERNAL, i])
        # ABOVE is 1 and BELOW is -1: these events are also the side of the story that is loaded.
        # `reached_drift` is positive on this side; it is not used after a reversal.
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
            constant_losses = degradation(law_parameters, law_state, i, block)
            for row in range(3):
                law_state[extra_rows(law_state, block) + _LAST_LOSSES + row, i] = constant_losses[
                    row
                ]
        if branch_type == _ON_PATH:
            continue_path(law_parameters, law_state, i, block, event)
        else:
            set_backbone_branch(law_parameters, law_state, i, block, event)

    @inline
    def released_energy(start_drift, start_force, points):
        """Return the energy that the story releases from a negative force to zero force, J.

        The story follows a path of up to three linear parts. Drifts and forces are positive in the
        direction of the path, so that the force is negative at first and increases. The energy is
        the area between the path and the drift axis, up to the drift where the force is zero.

        `start_drift` and `start_force` are the drift (m) and negative force (N) at the start.
        `points` is the drift (m) and force (N) of point 1, of point 2 and of point 3 of the path.
        """
        # Sum up the areas of the linear parts: trapezoids as long as the force is negative, then
        # the triangle up to zero force. Points behind the start have already been passed.
        # `points` alternates between the drift and the force of a point.
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
        """Return the stored energy of the committed state, J, which unloading to zero force
        releases.

        After a reversal, the story follows a path of up to three straight lines to the point of
        maximum drift of the other side. The energy is the area between this path and the drift
        axis, up to zero force (`released_energy`). The path depends on the state:

            before the first branch change    straight line to the origin: the energy is F^2 / (2 k)
                                              with the force F and the initial stiffness k
            unloading                         remaining part of the current path
            loading                           path that would follow a reversal at this state

        The law state is not changed.

        Column `i` of the tables `law_parameters` and `law_state` contains parameters and states of
        story `i`.
        """
        drift, force = law_state[rows.DRIFT, i], law_state[rows.FORCE, i]
        if force == 0.0:
            return 0.0
        if law_state[rows.INTERNAL, i] == 0.0:
            return 0.5 * force * force / law_parameters[rows.STIFFNESS, i]
        first = extra_rows(law_state, 0)
        # `side` is the direction of the movement: 1 or -1. If the force has the opposite sign, the
        # story is unloading. Its current path is then stored as six numbers: drift and force of the
        # end of unloading, of the end of the pinched part, and of the point of maximum drift.
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
            # The story is loading. A reversal at the current state would start a path towards the
            # other side; `path` returns its six numbers.
            side = -side
            max_drift = law_state[side_row(side, rows.HIGH_DRIFT), i]
            points = path(
                law_parameters,
                i,
                side,
                side * drift,
                side * force,
                max_drift,
                degradation(law_parameters, law_state, i, 0),
            )
        return released_energy(side * drift, side * force, points)

    @inline
    def is_elastic_before_yielding(law_parameters, i):
        """Return True if all paths before the first yielding coincide with one straight line.

        The first branch can then extend to the first points of the backbone curves. Before the
        first yielding, the point of maximum drift of a side is the first point of its backbone
        curve, and there is no degradation. All paths (`path`) then coincide with the straight line
        through the origin if the following conditions are met, 2 to 4 for each side:

            1. the stiffnesses of the first lines of both sides are equal
            2. the reloading is pinched: without a pinched part, `reloading_point` sets the force of
               its end from the third and fourth points of the backbone curve
            3. the force fraction of the end of the pinched part is at most its drift fraction.
               `reloading_point` then moves this end to the line with the stiffness of the first
               line; with a larger force fraction, the end would be above the line
            4. the force at the end of unloading, which is on the line, is smaller than the force at
               the end of the pinched part. Otherwise the pinched part would lead backwards, and
               `path` would correct it

        Column `i` of the table `law_parameters` contains the parameters of story `i`.
        """
        # Condition 1: the stiffnesses of the first lines of both sides are equal.
        if (
            abs(stiffness(law_parameters, i, -1.0) / stiffness(law_parameters, i, 1.0) - 1.0)
            > _EQUAL
        ):
            return False
        for side in (1.0, -1.0):
            # The pinched part ends at fractions of the maximum drift and of its force. Unloading
            # ends at a fraction of the force of point 3.
            drift_fraction = pinching(law_parameters, i, side, 0)
            force_fraction = pinching(law_parameters, i, side, 1)
            unloading_fraction = pinching(law_parameters, i, side, 2)
            # Conditions 2 and 3: the reloading is pinched, and the force fraction of the end of the
            # pinched part is at most its drift fraction.
            if not (
                unloading_fraction < force_fraction - _NO_PINCHING
                and force_fraction <= drift_fraction
            ):
                return False
            # Condition 4: unloading ends below the end of the pinched part. The force at the end of
            # unloading is a fraction of the force of point 3, the force at the end of the pinched
            # part a fraction of the force of point 1.
            if unloading_fraction * point_force(
                law_parameters, i, side, 3
            ) >= force_fraction * point_force(law_parameters, i, side, 1):
                return False
        return True

    @inline
    def enter(law_parameters, law_state, i):
        """Set the initial maximum drifts and the limits of the first branch of story `i`.

        The caller has already set SLOPE to the initial stiffness and RATE_SIGN to 0 (valid in both
        directions). FORCE and INTERNAL (type of the branch) are 0 at the start of a run.

        The initial maximum drift of a side is the drift of the first point of its backbone curve.
        The first branch ends at this drift, or at the ultimate drift if it is smaller. If the paths
        before the first yielding do not coincide with a straight line, reversals below the first
        point change the path. The first branch then ends at the very small fraction _MIN_REVERSAL
        of the drift.

        Column `i` of `law_parameters` contains the parameters of the story. The committed state, in
        the first rows of column `i` of `law_state`, is changed.
        """
        fraction = 1.0 if is_elastic_before_yielding(law_parameters, i) else _MIN_REVERSAL
        law_state[rows.HIGH_DRIFT, i] = point_drift(law_parameters, i, 1.0, 1)
        law_state[rows.LOW_DRIFT, i] = point_drift(law_parameters, i, -1.0, 1)
        law_state[rows.UPPER, i] = min(
            fraction * point_drift(law_parameters, i, 1.0, 1), law_parameters[_ULTIMATE, i]
        )
        law_state[rows.LOWER, i] = -min(
            fraction * point_drift(law_parameters, i, -1.0, 1), law_parameters[_ULTIMATE, i]
        )

    return follow_branches(switch, strain_energy, enter)


def _slopes(side: Sequence[float]) -> list[float]:
    """Return the slopes of the four lines of the backbone curve of one side, N/m.

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

    `values` are the parameters in the order of `LAW.parameters`: drift (m) and force (N) of the
    four points of the positive side (_SIDE = 8 values), drift and force of the four points of the
    negative side, and then parameters that are not used here.
    """
    first_slope = values[1] / values[0]  # force divided by drift of the first point, N/m
    return max(*_slopes(values[:_SIDE]), *_slopes(values[_SIDE : 2 * _SIDE])) > first_slope * (
        1.0 + _EQUAL
    )


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return an error message if the drifts of a backbone curve do not increase, otherwise None.

    The bounds of the parameter `backbone` ensure that all drifts and forces are positive. The drift
    of the first point is therefore not checked.

    `stiffness` is the initial stiffness, N/m; not used. All laws have the same arguments for this
    check.

    Parameters
    ----------
    values : sequence of float
        Parameters in SI units, in the order of `LAW.parameters`: drift and force of the four points
        of the positive side, then of the negative side, then other parameters.
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


def _degradation_parameters(name: str) -> tuple[LawParameter, ...]:
    """Return the declarations of the five parameters of a type of degradation.

    `name` is the type: `stiffness`, `drift` or `strength`. The parameters are `peak`, `work`,
    `peak_exponent`, `work_exponent` and `limit`. The stiffness and the strength decrease, and the
    maximum drift increases, by the fraction

        peak (maximum drift / drift of the last backbone point)^peak_exponent
            + work (used part of the energy capacity)^work_exponent

    but at most by `limit`. `without` is the value of a parameter in a model without this group.
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


LAW = DriftLaw(
    "multilinear-pinching",
    "backbone through two to four points a side, rising or falling; unloads, pinches and reloads "
    "along straight lines (Pinching4)",
    _functions,
    parameters=(
        LawParameter("backbone", points=4, low=0.0, low_allowed=False),
        LawParameter(
            "backbone",
            points=4,
            low=0.0,
            low_allowed=False,
            default="backbone",
            group="negative",
        ),
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
    compiled_separately=True,
    extra_rows=_EXTRA_ROWS,
    initial_stiffness=lambda values: values[1] / values[0],
    yield_drift=lambda stiffness, values: values[0],  # the first point of the positive side
    stiffens=_stiffens,
    fault=_fault,
    falls=lambda stiffness, values: True,  # lines of reloading and unloading can fall
    failed=_FAILED,
)
