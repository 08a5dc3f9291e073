"""Peak rule: a backbone curve, and reloading towards the point of maximum drift of a side.

The rule contains the laws of Clough (1966), modified Takeda (Takeda, Sozen and Nielsen 1970; Otani
1974; Litton 1975), the trilinear law with pinching (Lu and others 2020), `Hysteretic` of OpenSees
and rods with slack. In the following, s is the side of loading (1 or -1), o the other side, and
drifts and forces are positive in the direction of s:

    dy, K    drift of the first point of the backbone curve, its steepest slope
    m        farthest drift of a side, at least dy
    ku       unloading stiffness of a side, K (dy / m)^unloading, with the bounds below
    z        drift at zero force where the loading of a side starts

1. Virgin loading follows the backbone curve.
2. After a reversal, the story unloads with ku of the unloaded side to zero force, at z of the other
   side. If the unloaded side has yielded (m_o > dy_o), each reversal first increases m of the other
   side by the fraction `damage.drift` (m_o / dy_o - 1) + `damage.work` (W - f^2 / (2 ku_o)) / A. W
   is the work done on the story, A the area below both backbone curves up to their last points.
3. Reloading is directed to the target t = m - `reloading` (m - dy), with the force M of the
   backbone curve. The first part ends at the pinching point, the second part at the target:

       (z, 0),   (c, Y M) with c = z + X (t - (1 - Y) M / ku - z),   (t, M)

   X and Y are `pinching.drift` and `pinching.force`. From the target on, the story follows the
   backbone curve. The force never exceeds the line of slope ku through (z, 0), or through the last
   reversal. If c < z, only the second line remains.

Bounds of ku: with hardening and a small ku, unloading would release more energy than was stored. ku
is therefore at least M / m (with the force M at m), and at least S / (1 - unloading / 2) on a
segment of the backbone curve with the slope S. With these bounds no branch creates energy. During
yielding, the energy that unloading would release, E = M^2 / (2 ku), increases by at most the work
M dm. At the first bound, E = M m / 2 and S m <= M. At the second bound, E' = M S / ku. Otherwise
E' = M (S / ku + unloading M / (2 ku m)) <= M ((1 - unloading / 2) + unloading / 2). A bound that
acts at the end of a segment remains, because a smaller ku would increase E.

A side without a curve has no force. The spring is slack on this side, and reloads from its own z.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import LawFunctions

# Types of branches in row INTERNAL, negative on the negative side. 0 is the first branch, elastic
# between the first points of both sides.
BACKBONE = 1.0
PINCHED = 2.0  # first part of reloading
RELOADING = 3.0  # second part of reloading
UNLOADING = 4.0  # line with the unloading stiffness
_SLACK = 5.0  # side without a curve

FAILED = 1e3
"""Value of INTERNAL of a law that has lost its strength; larger than any type or index of a
segment."""

TOLERANCE = 1e-12
"""Fraction of a drift or force. Points that are closer to each other are regarded as equal."""

_ON_CURVE = 1e-10
"""Fraction of the force at the target or of K dy. A force that is below the reloading curve by less
is regarded as on the curve."""


class BackboneCurve(NamedTuple):
    """Functions of the backbone curve of a law. Segment j ends at point j; the last has no end.

    Attributes
    ----------
    slope, end : function
        (law_parameters, i, side, j) -> slope of a segment, N/m, and drift at its end, m.
    segment : function
        (law_parameters, i, side, drift) -> segment that starts at a drift, or that contains it.
    force : function
        (law_parameters, i, side, j, drift) -> force of segment j at a drift, N.
    """

    slope: Any
    end: Any
    segment: Any
    force: Any


def backbone_curve(
    point_drift: Any, point_force: Any, last_slope: Any, points: int
) -> BackboneCurve:
    """Return the functions of a backbone curve from its points.

    Parameters
    ----------
    point_drift, point_force : function
        (law_parameters, i, side, j) -> drift (m) and force (N) of point j. The drift is infinite
        after the last point.
    last_slope : function
        (law_parameters, i, side) -> slope after the last point, N/m.
    points : int
        Maximum number of points of a side.
    """
    from tdint.kernels.compiling import inline, outlined

    @outlined
    def slope(law_parameters, i, side, j):
        """Return the slope of segment `j` of a side, N/m."""
        if j == 0:
            return point_force(law_parameters, i, side, 0) / point_drift(law_parameters, i, side, 0)
        if j == points or point_drift(law_parameters, i, side, j) == math.inf:
            return last_slope(law_parameters, i, side)
        return (
            point_force(law_parameters, i, side, j) - point_force(law_parameters, i, side, j - 1)
        ) / (point_drift(law_parameters, i, side, j) - point_drift(law_parameters, i, side, j - 1))

    @inline
    def end(law_parameters, i, side, j):
        """Return the drift at the end of segment `j` of a side, m; infinite for the last one."""
        return point_drift(law_parameters, i, side, j) if j < points else math.inf

    @inline
    def segment(law_parameters, i, side, drift):
        """Return the segment that begins at a drift, or that contains it."""
        j = 0
        while j < points and point_drift(law_parameters, i, side, j) <= drift * (1.0 + TOLERANCE):
            j += 1
        return j

    @inline
    def force(law_parameters, i, side, j, drift):
        """Return the force of segment `j` of a side at a drift, N."""
        segment_slope = slope(law_parameters, i, side, j)
        if j == 0:
            return segment_slope * drift
        return point_force(law_parameters, i, side, j - 1) + segment_slope * (
            drift - point_drift(law_parameters, i, side, j - 1)
        )

    return BackboneCurve(slope, end, segment, force)


class PeakKeys(NamedTuple):
    """Functions (law_parameters, i) that return the keys of the rule, and `has_side`
    (law_parameters, i, side), which returns True if a side has a curve."""

    unloading: Any
    reloading: Any
    pinching_drift: Any
    pinching_force: Any
    damage_drift: Any
    damage_work: Any
    has_side: Any


class PeakRule(NamedTuple):
    """Functions of the rule, as in `tdint.kernels.laws.law.LawFunctions`, and `set_backbone`
    (law_parameters, law_state, i, block, side), which sets the backbone curve as the branch."""

    switch: Any
    strain_energy: Any
    enter: Any
    set_backbone: Any


def constant(value: float) -> Any:
    """Return a compiled function (law_parameters, i) that returns a constant."""
    from tdint.kernels.compiling import inline

    @inline
    def key(law_parameters, i):
        """Return the constant."""
        return value

    return key


def parameter(row: int) -> Any:
    """Return a compiled function (law_parameters, i) that returns a parameter of the law."""
    from tdint.kernels.compiling import inline

    @inline
    def key(law_parameters, i):
        """Return the parameter in the row."""
        return law_parameters[row, i]

    return key


def peak_rule(curve: BackboneCurve, keys: PeakKeys, points: int) -> PeakRule:
    """Return the functions of a law that follows the peak rule.

    Rows HIGH_DRIFT and LOW_DRIFT of a state contain the farthest drifts of the positive and of the
    negative side, rows HIGH_FORCE and LOW_FORCE the drifts z of both sides.

    `points` is the maximum number of points of the backbone curve of a side.
    """
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import (
        fail,
        is_at_rest,
        set_branch,
        set_directed,
        side_row,
    )

    @outlined
    def steepest_slope(law_parameters, i, side):
        """Return K, the steepest slope of the backbone curve of a side, N/m."""
        steepest = curve.slope(law_parameters, i, side, 0)
        j = 0
        while curve.end(law_parameters, i, side, j) < math.inf:
            j += 1
            steepest = max(steepest, curve.slope(law_parameters, i, side, j))
        return steepest

    @inline
    def has_damage(law_parameters, i):
        """Return True if reversals increase the farthest drifts. All branches then end at a
        reversal, because each reversal counts."""
        return (
            keys.damage_drift(law_parameters, i) > 0.0 or keys.damage_work(law_parameters, i) > 0.0
        )

    @inline
    def far(law_parameters, law_state, i, block, side):
        """Return the farthest drift of a side, at least that of the first point, m; on the backbone
        curve, the current drift is included."""
        reached = abs(law_state[block + side_row(side, rows.HIGH_DRIFT), i])
        if law_state[block + rows.INTERNAL, i] == side * BACKBONE:
            reached = max(reached, side * law_state[block + rows.DRIFT, i])
        return max(reached, curve.end(law_parameters, i, side, 0))

    @outlined
    def unloading_stiffness(law_parameters, i, side, far_drift):
        """Return the unloading stiffness of a side with the farthest drift `far_drift`, N/m."""
        steepest = steepest_slope(law_parameters, i, side)
        unloading = keys.unloading(law_parameters, i)
        if unloading == 0.0:
            return steepest
        first = curve.end(law_parameters, i, side, 0)
        stiffness = steepest * (first / far_drift) ** unloading
        # Bounds by the slopes of the segments. A segment that ends before the farthest drift only
        # counts if its bound acts at its end.
        j = 1
        while True:
            end = curve.end(law_parameters, i, side, j)
            bound = curve.slope(law_parameters, i, side, j) / (1.0 - 0.5 * unloading)
            if bound > stiffness and (
                end >= far_drift or bound > steepest * (first / end) ** unloading
            ):
                stiffness = bound
            if end >= far_drift:
                break
            j += 1
        force = curve.force(law_parameters, i, side, j, far_drift)
        return min(max(stiffness, force / far_drift), steepest)

    @outlined
    def set_backbone(law_parameters, law_state, i, block, side):
        """Set the backbone curve as the branch; the story fails where a falling curve has no
        force."""
        drift = side * law_state[block + rows.DRIFT, i]
        j = curve.segment(law_parameters, i, side, drift)
        slope = curve.slope(law_parameters, i, side, j)
        force = curve.force(law_parameters, i, side, j, drift)
        end = curve.end(law_parameters, i, side, j)
        if slope < 0.0:
            # Rounding of a force is relative to the forces of the segment.
            if force <= TOLERANCE * (abs(force) - slope * drift):
                fail(law_state, i, block, FAILED)
                return
            end = min(end, drift - force / slope)
        elif j > 0 and force <= 0.0 and slope == 0.0:
            fail(law_state, i, block, FAILED)
            return
        law_state[block + rows.FORCE, i] = side * force
        set_directed(law_state, i, block, side, BACKBONE, slope, end)

    @inline
    def set_line(law_parameters, law_state, i, block, side, slope, limits, direction):
        """Set a line with the unloading stiffness of a side between two drifts, positive on this
        side. It is valid in both directions; with damage, in one direction."""
        lower, upper = limits
        law_state[block + rows.INTERNAL, i] = side * UNLOADING
        turn = direction if has_damage(law_parameters, i) else 0.0
        if side > 0.0:
            set_branch(law_state, i, block, slope, lower, upper, turn)
        else:
            set_branch(law_state, i, block, slope, -upper, -lower, turn)

    @outlined
    def line_end(law_parameters, i, side, slope, drift, force, target):
        """Return the drift at which a line from a point below the backbone curve meets this curve
        beyond the drift `target`; infinite if it does not meet it."""
        j = curve.segment(law_parameters, i, side, max(drift, target))
        while True:
            end = curve.end(law_parameters, i, side, j)
            curve_slope = curve.slope(law_parameters, i, side, j)
            missing = curve.force(law_parameters, i, side, j, drift) - force
            # The line meets the segment at drift + missing / (slope - curve_slope).
            if slope > curve_slope and missing <= (slope - curve_slope) * (end - drift):
                return drift + max(missing, 0.0) / (slope - curve_slope)
            if end == math.inf:
                return math.inf
            j += 1

    @inline
    def is_virgin(law_parameters, law_state, i, block, side):
        """Return True if no reversal has counted and the drift is still that of rest: the loading
        of a side is then virgin loading, in either direction."""
        return (
            law_state[block + rows.HIGH_DRIFT, i] == 0.0
            and law_state[block + rows.LOW_DRIFT, i] == 0.0
            and is_at_rest(law_state, i, block, curve.end(law_parameters, i, side, 0))
        )

    @outlined
    def continue_loading(law_parameters, law_state, i, block, side):
        """Set the branch of loading towards a side that starts at the current point.

        It is a part of the reloading curve or of the backbone curve if the point is on it,
        otherwise the line with the unloading stiffness up to this curve.
        """
        if is_virgin(law_parameters, law_state, i, block, side):
            # After slack of the other side, from rest on
            set_backbone(law_parameters, law_state, i, block, side)
            return
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        far_drift = far(law_parameters, law_state, i, block, side)
        first = curve.end(law_parameters, i, side, 0)
        target = far_drift - keys.reloading(law_parameters, i) * (far_drift - first)
        j = curve.segment(law_parameters, i, side, target)
        target_force = curve.force(law_parameters, i, side, j, target)
        slope = unloading_stiffness(law_parameters, i, side, far_drift)
        if target > first * (1.0 + TOLERANCE) and target_force <= TOLERANCE * slope * first:
            # Damage has moved the target to the end of a falling curve.
            fail(law_state, i, block, FAILED)
            return
        tolerance = TOLERANCE * target
        force_tolerance = _ON_CURVE * max(target_force, slope * first)
        end = math.nan
        if drift < target - tolerance:
            zero_drift = side * law_state[block + side_row(side, rows.HIGH_DRIFT) + 1, i]
            pinched_force = keys.pinching_force(law_parameters, i) * target_force
            pinched_drift = zero_drift + keys.pinching_drift(law_parameters, i) * (
                target - (target_force - pinched_force) / slope - zero_drift
            )
            # First part, from (zero_drift, 0) to the pinching point
            if drift < pinched_drift - tolerance:
                part = pinched_force / (pinched_drift - zero_drift)
                missing = part * (drift - zero_drift) - force
                if missing <= force_tolerance:
                    part = (pinched_force - force) / (pinched_drift - drift)
                    if part <= slope * (1.0 + _ON_CURVE):
                        set_directed(law_state, i, block, side, PINCHED, part, pinched_drift)
                        return
                if missing <= (slope - part) * (pinched_drift - drift):
                    end = drift + missing / (slope - part)
            # Second part, from the pinching point to the target
            if end != end and target - pinched_drift > tolerance:
                part = (target_force - pinched_force) / (target - pinched_drift)
                missing = pinched_force + part * (drift - pinched_drift) - force
                if missing <= force_tolerance and drift >= pinched_drift - tolerance:
                    part = (target_force - force) / (target - drift)
                    if part <= slope * (1.0 + _ON_CURVE):
                        set_directed(law_state, i, block, side, RELOADING, part, target)
                        return
                if missing <= (slope - part) * (target - drift):
                    end = drift + missing / (slope - part)
        else:
            j = curve.segment(law_parameters, i, side, drift)
            if curve.force(law_parameters, i, side, j, drift) - force <= force_tolerance:
                set_backbone(law_parameters, law_state, i, block, side)
                return
        if end != end:
            end = line_end(law_parameters, i, side, slope, drift, force, target)
        limits = (drift - force / slope, end)
        set_line(law_parameters, law_state, i, block, side, slope, limits, side)

    @outlined
    def cross_zero_force(law_parameters, law_state, i, block, side):
        """Set the branch that follows a zero crossing of the force towards a side."""
        drift = law_state[block + rows.DRIFT, i]
        law_state[block + rows.FORCE, i] = 0.0
        if keys.has_side(law_parameters, i, side):
            law_state[block + side_row(side, rows.HIGH_DRIFT) + 1, i] = drift
            continue_loading(law_parameters, law_state, i, block, side)
            return
        law_state[block + side_row(-side, rows.HIGH_DRIFT) + 1, i] = drift
        law_state[block + rows.INTERNAL, i] = side * _SLACK
        lower, upper = (drift, math.inf) if side > 0.0 else (-math.inf, drift)
        set_branch(law_state, i, block, 0.0, lower, upper, 0.0)

    @inline
    def damage(law_parameters, law_state, i, block, side, stiffness):
        """Return the fraction by which a reversal towards a side increases its farthest drift.

        `stiffness` is the unloading stiffness of the other side, N/m.
        """
        other = -side
        first = curve.end(law_parameters, i, other, 0)
        far_drift = far(law_parameters, law_state, i, block, other)
        if far_drift <= first * (1.0 + TOLERANCE):
            return 0.0
        force = law_state[block + rows.FORCE, i]
        work = law_state[block + rows.WORK, i] - 0.5 * force * force / stiffness
        area = 0.0
        for part in range(2):
            sign = 1.0 if part == 0 else -1.0
            begin = begin_force = 0.0
            j = 0
            while j < points and curve.end(law_parameters, i, sign, j) < math.inf:
                end = curve.end(law_parameters, i, sign, j)
                end_force = curve.force(law_parameters, i, sign, j, end)
                area += 0.5 * (begin_force + end_force) * (end - begin)
                begin, begin_force = end, end_force
                j += 1
        return (
            keys.damage_drift(law_parameters, i) * (far_drift / first - 1.0)
            + keys.damage_work(law_parameters, i) * work / area
        )

    @inline
    def reverse(law_parameters, law_state, i, block):
        """Set the branch that follows a reversal."""
        side = -law_state[block + rows.RATE_SIGN, i]
        drift = law_state[block + rows.DRIFT, i]
        force = law_state[block + rows.FORCE, i]
        row, other_row = side_row(side, rows.HIGH_DRIFT), side_row(-side, rows.HIGH_DRIFT)
        if is_virgin(law_parameters, law_state, i, block, side):
            # The movement from rest is in the direction that the branch has not assumed.
            if keys.has_side(law_parameters, i, side):
                set_backbone(law_parameters, law_state, i, block, side)
            else:
                cross_zero_force(law_parameters, law_state, i, block, side)
            return
        if law_state[block + rows.INTERNAL, i] == -side * BACKBONE:
            reached = max(abs(law_state[block + other_row, i]), -side * drift)
            law_state[block + other_row, i] = -side * reached
        far_drift = far(law_parameters, law_state, i, block, -side)
        stiffness = unloading_stiffness(law_parameters, i, -side, far_drift)
        farthest = abs(law_state[block + row, i])
        if side * force <= 0.0 and has_damage(law_parameters, i):
            farthest *= 1.0 + damage(law_parameters, law_state, i, block, side, stiffness)
        first = curve.end(law_parameters, i, side, 0)
        law_state[block + row, i] = side * max(farthest, first)
        if side * force > 0.0:
            continue_loading(law_parameters, law_state, i, block, side)
        elif force == 0.0:
            cross_zero_force(law_parameters, law_state, i, block, side)
        else:
            # Seen from the unloaded side, with a positive force
            top = -side * drift
            limits = (top - abs(force) / stiffness, top)
            set_line(law_parameters, law_state, i, block, -side, stiffness, limits, side)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows the current branch at its end.

        reversal                                       unloading line; the farthest drift is stored
        unloading line, at zero force                  reloading of the other side
        line, part of reloading or of the backbone     next part
        slack                                          reloading of the side with a curve
        """
        if event == rows.REVERSED:
            reverse(law_parameters, law_state, i, block)
            return
        # ABOVE is 1, BELOW is -1: loading continues on the side of `event`.
        branch_type = law_state[block + rows.INTERNAL, i]
        is_crossing = abs(branch_type) == UNLOADING and event * branch_type < 0.0
        if is_crossing or not keys.has_side(law_parameters, i, event):
            cross_zero_force(law_parameters, law_state, i, block, event)
        else:
            continue_loading(law_parameters, law_state, i, block, event)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the stored energy f^2 / (2 ku), J, released by unloading from force f to zero."""
        force = law_state[rows.FORCE, i]
        if force == 0.0:
            return 0.0
        side = 1.0 if force > 0.0 else -1.0
        far_drift = far(law_parameters, law_state, i, 0, side)
        return 0.5 * force * force / unloading_stiffness(law_parameters, i, side, far_drift)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the first branch: elastic between the first points of both sides. If unloading is
        steeper from the start, or each reversal counts, it is the backbone curve in the positive
        direction."""
        lower = upper = 0.0
        is_directed = has_damage(law_parameters, i)
        for part in range(2):
            side = 1.0 if part == 0 else -1.0
            first = curve.end(law_parameters, i, side, 0)
            slope = curve.slope(law_parameters, i, side, 0)
            law_state[side_row(side, rows.HIGH_DRIFT), i] = side * first
            law_state[side_row(side, rows.HIGH_DRIFT) + 1, i] = 0.0
            if keys.has_side(law_parameters, i, side):
                if side > 0.0:
                    upper = first
                else:
                    lower = -first
                steepest = steepest_slope(law_parameters, i, side)
                is_directed = is_directed or 0.0 < slope < steepest * (1.0 - _ON_CURVE)
        law_state[rows.UPPER, i] = upper
        law_state[rows.LOWER, i] = lower
        if is_directed:
            law_state[rows.HIGH_DRIFT, i] = law_state[rows.LOW_DRIFT, i] = 0.0
            side = 1.0 if keys.has_side(law_parameters, i, 1.0) else -1.0
            slope = curve.slope(law_parameters, i, side, 0)
            set_directed(
                law_state, i, 0, side, BACKBONE, slope, curve.end(law_parameters, i, side, 0)
            )

    return PeakRule(switch, strain_energy, enter, set_backbone)


def peak_law(
    curve: BackboneCurve, points: int, unloading: Any, pinching: Any | None = None
) -> LawFunctions:
    """Return the functions of a law that follows the peak rule on both sides, without damage.

    `unloading` and `pinching` (both fractions; default: 1) are functions (law_parameters, i).
    """
    from tdint.kernels.compiling import inline
    from tdint.kernels.laws.branch_following import follow_branches

    @inline
    def has_side(law_parameters, i, side):
        """Return True: both sides have a curve."""
        return True

    zero, pinching = constant(0.0), pinching or constant(1.0)
    keys = PeakKeys(unloading, zero, pinching, pinching, zero, zero, has_side)
    rule = peak_rule(curve, keys, points)
    return follow_branches(rule.switch, rule.strain_energy, rule.enter)
