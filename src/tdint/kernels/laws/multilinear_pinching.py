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

    peak (maximum drift / ultimate drift)^peak_exponent
        + work ((work - elastic energy) / capacity)^work_exponent <= limit

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
_OF_STIFFNESS = rows.FIRST_PARAMETER + 23
_OF_DRIFT = rows.FIRST_PARAMETER + 28
_OF_STRENGTH = rows.FIRST_PARAMETER + 33
_CAPACITY = rows.FIRST_PARAMETER + 38

# Extra rows, relative to the first extra row of the state.
# drift and force of the three points of the current path, positive on the side of the path
_PATH_POINTS = 0
_STRENGTH_LOSS = 6  # fractions of strength and stiffness that were lost at the last reversal
_STIFFNESS_LOSS = 7
_LAST_LOSSES = (
    # losses of stiffness, drift and strength at the moment at which the last drift of the backbone
    # curve was exceeded
    8
)
_EXTRA_ROWS = _LAST_LOSSES + 3

# Types of branches in row INTERNAL. The value is negative on the negative side, and 0 before the
# first branch.
_ON_PATH = 1.0
_ON_BACKBONE = 2.0
_FAILED = 3.0  # positive for both sides

_REACHED_TOLERANCE = (
    1e-12  # relative to a drift; a point within this distance ahead is regarded as reached
)
# Relative to the first drift of the backbone curve. A reversal within this drift is not counted. An
# upper story of a building at rest reverses at about 1e-10 m because of the time discretization,
# and would lose up to a fifth of its stiffness. The value is a tenth of the limit in OpenSees.
# Forces of this size are negligible in any response.
_MIN_REVERSAL = 1e-5
_EQUAL = 1e-12  # relative difference of stiffnesses that is regarded as rounding error
# difference of the force fractions at or below which the reloading is not pinched
_NO_PINCHING = 1e-8
_MIN_SLOPE = 1e-8  # relative to the stiffness; minimum slope of a path


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import extra_rows, fail, follow_branches

    @inline
    def side_row(side, row):
        """Return the row of a pair of rows for side `side`; the row of the negative side is two
        rows later.

        Values of both sides are positive.
        """
        return row if side > 0.0 else row + 2

    @inline
    def point_drift(law_parameters, i, side, point):
        """Return the drift of point `point` (1 to 4) of the backbone curve, m.

        Parameters
        ----------
        law_parameters : ndarray
            Parameters of the laws.
        i : int
            Index of the story.
        side : float
            Direction of loading, 1 or -1.
        point : int
            Number of the point, 1 to 4.
        """
        return law_parameters[(_POINTS if side > 0.0 else _POINTS + _SIDE) + 2 * (point - 1), i]

    @inline
    def point_force(law_parameters, i, side, point):
        """Return the force of point `point` (1 to 4) of the backbone curve, N.

        Parameters
        ----------
        law_parameters : ndarray
            Parameters of the laws.
        i : int
            Index of the story.
        side : float
            Direction of loading, 1 or -1.
        point : int
            Number of the point, 1 to 4.
        """
        return law_parameters[(_POINTS if side > 0.0 else _POINTS + _SIDE) + 2 * point - 1, i]

    @inline
    def pinching(law_parameters, i, side, index):
        """Return a pinching parameter of a side: 0 is `drift`, 1 is `force`, 2 is `unloading`.

        Parameters
        ----------
        law_parameters : ndarray
            Parameters of the laws.
        i : int
            Index of the story.
        side : float
            Direction of loading, 1 or -1.
        index : int
            Index of the parameter.
        """
        return law_parameters[(_PINCHING if side > 0.0 else _PINCHING + _PINCHING_SIDE) + index, i]

    @inline
    def stiffness(law_parameters, i, side):
        """Return the stiffness of the first line of the backbone curve, N/m."""
        return point_force(law_parameters, i, side, 1) / point_drift(law_parameters, i, side, 1)

    @inline
    def last_slope(law_parameters, i, side):
        """Return the slope beyond the last point of the backbone curve, N/m, at least 0."""
        rise = point_force(law_parameters, i, side, 4) - point_force(law_parameters, i, side, 3)
        return max(rise, 0.0) / (
            point_drift(law_parameters, i, side, 4) - point_drift(law_parameters, i, side, 3)
        )

    @outlined
    def backbone(law_parameters, i, side, drift):
        """Return the force of the backbone curve without degradation, N, at a drift (m) of a side.

        Parameters
        ----------
        law_parameters : ndarray
            Parameters of the laws.
        i : int
            Index of the story.
        side : float
            Direction of loading, 1 or -1.
        drift : float
            Drift, m.
        """
        x, y = 0.0, 0.0
        for point in range(1, 5):
            end, force = (
                point_drift(law_parameters, i, side, point),
                point_force(law_parameters, i, side, point),
            )
            if drift <= end:
                return y + (drift - x) * (force - y) / (end - x)
            x, y = end, force
        return y + last_slope(law_parameters, i, side) * (drift - x)

    @inline
    def area(law_parameters, i, side):
        """Return the area below the backbone curve up to its last point, J."""
        x, y, sum_ = 0.0, 0.0, 0.0
        for point in range(1, 5):
            end, force = (
                point_drift(law_parameters, i, side, point),
                point_force(law_parameters, i, side, point),
            )
            sum_ += 0.5 * (y + force) * (end - x)
            x, y = end, force
        return sum_

    @inline
    def last_drift(law_parameters, i):
        """Return the larger drift of the last points of the two sides, m."""
        return max(point_drift(law_parameters, i, 1.0, 4), point_drift(law_parameters, i, -1.0, 4))

    @inline
    def degrades(law_parameters, i):
        """Return True if a degradation limit of the story is positive."""
        limits = 0.0
        for row in (_OF_STIFFNESS, _OF_DRIFT, _OF_STRENGTH):
            limits += law_parameters[row + 4, i]
        return limits > 0.0

    @inline
    def loss(law_parameters, i, row, drift_ratio, used_capacity):
        """Return the fraction lost by one type of degradation, at most its limit.

        Parameters
        ----------
        law_parameters : ndarray
            Parameters of the laws.
        i : int
            Index of the story.
        row : int
            First of the five rows of the type of degradation.
        drift_ratio : float
            Maximum drift over ultimate drift.
        used_capacity : float
            Dissipated work over the energy capacity; not positive if the response is elastic.
        """
        limit = law_parameters[row + 4, i]
        if limit == 0.0 or used_capacity >= 1.0:
            return limit
        losses_now = law_parameters[row, i] * drift_ratio ** law_parameters[row + 2, i]
        if used_capacity > 0.0:
            losses_now += law_parameters[row + 1, i] * used_capacity ** law_parameters[row + 3, i]
        return min(losses_now, limit)

    @inline
    def has_yielded(law_parameters, law_state, i, block):
        """Return True if the maximum drift of a side exceeds the first drift of the backbone curve.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the laws.
        i : int
            Index of the story.
        block : int
            First row of the state.
        """
        side = 1.0 if law_state[block + rows.INTERNAL, i] > 0.0 else -1.0
        loading = abs(law_state[block + rows.INTERNAL, i]) == _ON_BACKBONE
        if loading and side * law_state[block + rows.DRIFT, i] > point_drift(
            law_parameters, i, side, 1
        ):
            return True
        above = law_state[block + rows.HIGH_DRIFT, i] > point_drift(law_parameters, i, 1.0, 1)
        return above or law_state[block + rows.LOW_DRIFT, i] > point_drift(
            law_parameters, i, -1.0, 1
        )

    @outlined
    def degradation(law_parameters, law_state, i, block):
        """Return the losses of stiffness, maximum drift and strength for a reversal at the current
        state.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the laws.
        i : int
            Index of the story.
        block : int
            First row of the state.

        Returns
        -------
        tuple of float
            Three fractions. The loss of stiffness is bounded so that the stiffness remains at least
            the secant stiffness of the backbone curve.
        """
        first = extra_rows(law_state, block)
        drift = law_state[block + rows.DRIFT, i]
        if not degrades(law_parameters, i) or not has_yielded(law_parameters, law_state, i, block):
            return 0.0, 0.0, 0.0
        ultimate = last_drift(law_parameters, i)
        if abs(drift) > ultimate * (1.0 + _REACHED_TOLERANCE):
            return (
                law_state[first + _LAST_LOSSES, i],
                law_state[first + _LAST_LOSSES + 1, i],
                law_state[first + _LAST_LOSSES + 2, i],
            )
        force, work = law_state[block + rows.FORCE, i], law_state[block + rows.WORK, i]
        capacity = law_parameters[_CAPACITY, i] * max(
            area(law_parameters, i, 1.0), area(law_parameters, i, -1.0)
        )
        k = stiffness(law_parameters, i, 1.0 if drift > 0.0 else -1.0) * (
            1.0 - law_state[first + _STIFFNESS_LOSS, i]
        )
        used_capacity = 2.0 if work >= capacity else (work - 0.5 * force * force / k) / capacity
        secant = 0.0
        for side in (1.0, -1.0):
            max_drift = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
            secant = max(
                secant,
                backbone(law_parameters, i, side, max_drift)
                / max_drift
                / stiffness(law_parameters, i, side),
            )
        available = max(0.0, 1.0 - secant * (1.0 - law_state[first + _STRENGTH_LOSS, i]))
        drift_ratio = (
            max(law_state[block + rows.HIGH_DRIFT, i], law_state[block + rows.LOW_DRIFT, i])
            / ultimate
        )
        return (
            min(loss(law_parameters, i, _OF_STIFFNESS, drift_ratio, used_capacity), available),
            loss(law_parameters, i, _OF_DRIFT, drift_ratio, used_capacity),
            loss(law_parameters, i, _OF_STRENGTH, drift_ratio, used_capacity),
        )

    @inline
    def validated_path(u, f, points, lowest, secant):
        """Return the three points of a path, replaced if the path goes backwards or falls.

        The replacement is the line to the last point, or two lines through the origin.

        Parameters
        ----------
        u, f : float
            Drift (m) and force (N) at the start of the path.
        points : tuple of float
            Drift and force of the three points.
        lowest : float
            Minimum slope of the line for which the two lines through the origin are used, N/m.
        secant : float
            Maximum slope for the same purpose, N/m.
        """
        b, fb, c, fc, d, fd = points
        if b >= u and c >= b and d >= c and fb >= f and fc >= fb and fd >= fc:
            return b, fb, c, fc, d, fd
        slope = (fd - f) / (d - u)
        if slope > lowest and slope < secant:
            return 0.0, 0.0, 0.0, 0.0, d, fd
        return d, fd, d, fd, d, fd

    @inline
    def reloading_point(
        law_parameters, i, side, strength_factor, k, max_drift, force, is_beyond_third
    ):
        """Return drift and force at the end of the pinched part of the path to the point of maximum
        drift.

        Parameters
        ----------
        law_parameters : ndarray
            Parameters of the laws.
        i : int
            Index of the story.
        side : float
            Direction of loading, 1 or -1.
        strength_factor : float
            Remaining fraction of the strength.
        k : float
            Loading stiffness, N/m.
        max_drift, force : float
            Point of maximum drift, m and N.
        is_beyond_third : bool
            True if the maximum drift exceeds the third point of the backbone curve.
        """
        fraction, unloading = (
            pinching(law_parameters, i, side, 1),
            pinching(law_parameters, i, side, 2),
        )
        drift, pinched = pinching(law_parameters, i, side, 0) * max_drift, fraction * force
        if fraction - unloading <= _NO_PINCHING:
            third = (
                force
                if is_beyond_third
                else strength_factor * point_force(law_parameters, i, side, 3)
            )
            pinched = max(
                third * unloading, strength_factor * point_force(law_parameters, i, side, 4)
            ) * (1.0 + 1e-6)
        if force - pinched > k * (max_drift - drift) or drift == max_drift:
            drift = max_drift - (force - pinched) / k
        return drift, pinched

    @outlined
    def path(law_parameters, i, side, u, f, demand, losses_now):
        """Return the three points of the path after a reversal, as a tuple of drifts and forces.

        Parameters
        ----------
        law_parameters : ndarray
            Parameters of the laws.
        i : int
            Index of the story.
        side : float
            Direction of loading, 1 or -1.
        u, f : float
            Drift (m) and force (N) at the reversal.
        demand : float
            Maximum drift of this side, m.
        losses_now : tuple of float
            Losses of stiffness, maximum drift and strength.
        """
        strength_factor = 1.0 - losses_now[2]
        k = stiffness(law_parameters, i, side) * (1.0 - losses_now[0])
        d = demand * (1.0 + losses_now[1])
        fd = strength_factor * backbone(law_parameters, i, side, d)
        if u * d >= 0.0 or u >= d:
            return d, fd, d, fd, d, fd
        unloading_stiffness = stiffness(law_parameters, i, -side) * (1.0 - losses_now[0])
        secant = f / u if side > 0.0 else fd / d
        is_beyond_third = demand > point_drift(law_parameters, i, side, 3)
        c, fc = reloading_point(law_parameters, i, side, strength_factor, k, d, fd, is_beyond_third)
        if c < u:
            return d, fd, d, fd, d, fd
        fb = (
            pinching(law_parameters, i, side, 2)
            * strength_factor
            * point_force(law_parameters, i, side, 4 if is_beyond_third else 3)
        )
        b = u + (fb - f) / unloading_stiffness
        if b < u:
            b, fb = 0.5 * (u + c), 0.5 * (f + fc)
        elif (c != b and (fc - fb) / (c - b) > max(k, unloading_stiffness)) or (c == b and fc > fb):
            return d, fd, d, fd, d, fd
        elif c < b or fc < fb:
            if b > 0.0:
                b, fb = 0.5 * (u + c), 0.5 * (f + fc)
            elif c < 0.0:
                c, fc = 0.5 * (b + d), 0.5 * (fb + fd)
            else:
                mean = 0.5 * (fb + fc)
                first_slope, last_slope_of_path = (fb - f) / (b - u), (fd - fc) / (d - c)
                fb, fc = mean - abs(mean) / 100.0, mean + abs(mean) / 100.0
                b, c = u + (fb - f) / first_slope, d - (fd - fc) / last_slope_of_path
        return validated_path(u, f, (b, fb, c, fc, d, fd), _MIN_SLOPE * k, secant)

    @outlined
    def set_loading_branch(law_parameters, law_state, i, block, side, branch_type, slope, end):
        """Set a branch that ends at the drift `end` on side `side`.

        The branch also ends at the ultimate drift, and at the drift from which on the degradation
        is constant.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the laws.
        i : int
            Index of the story.
        block : int
            First branch_type of the state.
        side : float
            Direction of loading, 1 or -1.
        branch_type : float
            Type of the branch.
        slope : float
            Stiffness of the branch, N/m.
        end : float
            Drift at the end of the branch, m.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        end = min(end, law_parameters[_ULTIMATE, i])
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
        """Set the force and the branch of the backbone curve at the current drift.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the laws.
        i : int
            Index of the story.
        block : int
            First row of the state.
        side : float
            Direction of loading, 1 or -1.
        """
        drift = side * law_state[block + rows.DRIFT, i]
        strength_factor = 1.0 - law_state[extra_rows(law_state, block) + _STRENGTH_LOSS, i]
        law_state[block + rows.FORCE, i] = (
            side * strength_factor * backbone(law_parameters, i, side, drift)
        )
        x, y = 0.0, 0.0
        for point in range(1, 5):
            end, force = (
                point_drift(law_parameters, i, side, point),
                point_force(law_parameters, i, side, point),
            )
            if drift < end * (1.0 - _REACHED_TOLERANCE):
                set_loading_branch(
                    law_parameters,
                    law_state,
                    i,
                    block,
                    side,
                    _ON_BACKBONE,
                    strength_factor * (force - y) / (end - x),
                    end,
                )
                return
            x, y = end, force
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
        """Set the next part of the path, or the backbone curve after the end of the path.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the laws.
        i : int
            Index of the story.
        block : int
            First row of the state.
        side : float
            Direction of loading, 1 or -1.
        """
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        max_drift = law_state[first + _PATH_POINTS + 4, i]
        for knot in range(_PATH_POINTS, _PATH_POINTS + 6, 2):
            end = law_state[first + knot, i]
            if drift < end - _REACHED_TOLERANCE * max_drift:
                slope = (law_state[first + knot + 1, i] - force) / (end - drift)
                set_loading_branch(law_parameters, law_state, i, block, side, _ON_PATH, slope, end)
                return
        set_backbone_branch(law_parameters, law_state, i, block, side)

    @outlined
    def start_path(law_parameters, law_state, i, block, side):
        """Apply the degradation at a reversal and set the first part of the path towards side
        `side`.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the laws.
        i : int
            Index of the story.
        block : int
            First row of the state.
        side : float
            Direction of loading, 1 or -1.
        """
        first = extra_rows(law_state, block)
        drift = law_state[block + rows.DRIFT, i]
        losses_now = degradation(law_parameters, law_state, i, block)
        if abs(law_state[block + rows.INTERNAL, i]) == _ON_BACKBONE:
            maximum_row = side_row(-side, rows.HIGH_DRIFT)
            reached_drift = law_state[block + maximum_row, i] * (1.0 + losses_now[1])
            law_state[block + maximum_row, i] = max(reached_drift, -side * drift)
        law_state[first + _STIFFNESS_LOSS, i], law_state[first + _STRENGTH_LOSS, i] = (
            losses_now[0],
            losses_now[2],
        )
        demand = law_state[block + side_row(side, rows.HIGH_DRIFT), i]
        points = path(
            law_parameters,
            i,
            side,
            side * drift,
            side * law_state[block + rows.FORCE, i],
            demand,
            losses_now,
        )
        for row in range(6):
            law_state[first + _PATH_POINTS + row, i] = points[row]
        continue_path(law_parameters, law_state, i, block, side)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows, depending on the type of the branch and on the event.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the laws.
        i : int
            Index of the story.
        block : int
            First row of the state.
        event : float
            End of the branch: ABOVE, BELOW or REVERSED.
        """
        branch_type = abs(law_state[block + rows.INTERNAL, i])
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
            held = degradation(law_parameters, law_state, i, block)
            for row in range(3):
                law_state[extra_rows(law_state, block) + _LAST_LOSSES + row, i] = held[row]
        if branch_type == _ON_PATH:
            continue_path(law_parameters, law_state, i, block, event)
        else:
            set_backbone_branch(law_parameters, law_state, i, block, event)

    @inline
    def released_energy(u, f, points):
        """Return the energy released along a path from a negative force to zero force, J.

        Parameters
        ----------
        u, f : float
            Drift (m) and negative force (N) at the start.
        points : tuple of float
            Drift and force of the three points of the path.
        """
        energy = 0.0
        for row in range(0, 6, 2):
            end, force = points[row], points[row + 1]
            if end > u:
                if force >= 0.0:
                    return energy + 0.5 * f * f * (end - u) / (force - f)
                energy -= 0.5 * (f + force) * (end - u)
                u, f = end, force
        return energy

    @outlined
    def strain_energy(law_parameters, law_state, i):
        """Return the energy released along the current path or along the path after a reversal,
        J."""
        drift, force = law_state[rows.DRIFT, i], law_state[rows.FORCE, i]
        if force == 0.0:
            return 0.0
        if law_state[rows.INTERNAL, i] == 0.0:
            return 0.5 * force * force / law_parameters[rows.STIFFNESS, i]
        first = extra_rows(law_state, 0)
        side = law_state[rows.RATE_SIGN, i]
        if side * force < 0.0:
            row = first + _PATH_POINTS
            b, fb, c, fc = (
                law_state[row, i],
                law_state[row + 1, i],
                law_state[row + 2, i],
                law_state[row + 3, i],
            )
            points = (b, fb, c, fc, law_state[row + 4, i], law_state[row + 5, i])
        else:
            side = -side
            demand = law_state[side_row(side, rows.HIGH_DRIFT), i]
            points = path(
                law_parameters,
                i,
                side,
                side * drift,
                side * force,
                demand,
                degradation(law_parameters, law_state, i, 0),
            )
        return released_energy(side * drift, side * force, points)

    @inline
    def is_elastic_before_yielding(law_parameters, i):
        """Return True if all paths before the first yielding coincide with one straight line."""
        if (
            abs(stiffness(law_parameters, i, -1.0) / stiffness(law_parameters, i, 1.0) - 1.0)
            > _EQUAL
        ):
            return False
        for side in (1.0, -1.0):
            drift, force = (
                pinching(law_parameters, i, side, 0),
                pinching(law_parameters, i, side, 1),
            )
            unloading = pinching(law_parameters, i, side, 2)
            if not (unloading < force - _NO_PINCHING and force <= drift):
                return False
            if unloading * point_force(law_parameters, i, side, 3) >= force * point_force(
                law_parameters, i, side, 1
            ):
                return False
        return True

    @inline
    def enter(law_parameters, law_state, i):
        """Set the initial maximum drifts and the limits of the first branch."""
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
    """Return the slopes of the backbone curve of one side, N/m."""
    points = [(0.0, 0.0), *zip(side[::2], side[1::2], strict=True)]
    return [(force - f) / (drift - d) for (d, f), (drift, force) in pairwise(points)]


def _stiffens(values: Sequence[float]) -> bool:
    """Return True if a line of the backbone curve is stiffer than the first line of the positive
    side."""
    first = values[1] / values[0]
    return max(*_slopes(values[:_SIDE]), *_slopes(values[_SIDE : 2 * _SIDE])) > first * (
        1.0 + _EQUAL
    )


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return an error message if the drifts of a backbone curve do not increase, otherwise None."""
    for drifts, name in (
        (values[0:_SIDE:2], "backbone"),
        (values[_SIDE : 2 * _SIDE : 2], "negative.backbone"),
    ):
        if any(later <= drift for drift, later in pairwise(drifts)):
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
    """Return the parameters of one type of degradation: `stiffness`, `drift` or `strength`."""
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
        LawParameter("backbone", points=True, low=0.0, low_allowed=False),
        LawParameter(
            "backbone",
            points=True,
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
    failed=_FAILED,
)
