"""Multilinear law: a backbone curve with any number of points, and a rule for unloading.

The backbone curve of a side rises from the origin through its points (d_j, F_j) and continues with
`last_slope`. k is its first slope, S_j the slope of segment j up to point j, and S_last the slope
after the last point. The rule determines the forces inside the curve:

    kinematic   parallel elastic-perfectly plastic springs with the stiffnesses S_j - S_(j+1) and
                the yield drifts d_j, and an elastic spring S_last (Iwan 1966). A branch is the
                curve of twice the size (Masing).
    isotropic   elastic with k up to the strength R(p). The path of the plastic drift p of both
                sides moves along the plastic drifts d_j - F_j / k of the curve.
    origin      lines from the points of maximum drift to the origin
    peak        unloading to zero force, then reloading towards the point of maximum drift of the
                other side, with pinching and damage (`tdint.kernels.laws.peak_rule`)
    elastic     the curve itself
    flag        an elastic force between the curve and the curve `return`
                (`tdint.kernels.laws.flag_rule`)

A falling curve ends at zero force, where the story fails (rules `isotropic`, `origin`, `peak`) or
has no resistance left (`last_line`).

In the functions below, drifts and forces with a `side` are positive in the direction of the side.
`tdint.kernels.laws.law.LawFunctions` describes the functions and their arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.laws.flag_rule import flag_rule
from tdint.kernels.laws.law import MAX_POINTS, SIDES, DriftLaw, LawFunctions, LawParameter
from tdint.kernels.laws.peak_rule import (
    FAILED,
    TOLERANCE,
    UNLOADING,
    PeakKeys,
    backbone_curve,
    parameter,
    peak_rule,
)

_RULES = ("kinematic", "isotropic", "origin", "peak", "elastic", "flag")
_KINEMATIC, _ISOTROPIC, _ORIGIN, _PEAK, _ELASTIC, _FLAG = map(float, range(len(_RULES)))
_ONE_SIDED = (_PEAK, _ELASTIC, _FLAG)

_MAX_RETURN_POINTS = 10
"""Maximum number of points of the lower curve of rule `flag` on each side."""

# Rows of `law_parameters`: rule (index in `_RULES`), slope after the last point (N/m), then drift
# (m) and force (N) of each point of the positive side and of the negative side. Points that the
# model does not specify are infinite.
_RULE = rows.FIRST_PARAMETER
_LAST_SLOPE = rows.FIRST_PARAMETER + 1
_POINTS = rows.FIRST_PARAMETER + 2
_SIDE = 2 * MAX_POINTS
# Slope after the last point of the negative side, keys of rule `peak`, index in `SIDES`
_NEGATIVE_LAST_SLOPE = _POINTS + 2 * _SIDE
_FIRST_PEAK_KEY = _NEGATIVE_LAST_SLOPE + 1
_SIDES_ROW = _FIRST_PEAK_KEY + 6
# Lower curve of rule `flag`: slopes after the last points and points of both sides
_RETURN_SLOPE = _SIDES_ROW + 1
_RETURN_POINTS = _RETURN_SLOPE + 2
_RETURN_SIDE = 2 * _MAX_RETURN_POINTS
# Stiffness between the curves of rule `flag`, N/m; 0 for the steepest slope of the curve
_ELASTIC_STIFFNESS = _RETURN_POINTS + 2 * _RETURN_SIDE

# Rules `kinematic` and `isotropic`: drift at the start of the branch (m) and path of the plastic
# drift at this point (m). The forces of the springs at this point are the extra rows, N.
_START = rows.HIGH_DRIFT
_PLASTIC_PATH = rows.HIGH_FORCE

# Row INTERNAL contains the type of the branch for the rules `origin` and `peak`, as in `peak_rule`,
# and the index of the segment (`set_segment`) for rule `elastic`.

# Fraction of the yield drift of a spring. Springs with a smaller distance yield together.
_TOGETHER = 1e-10
# Fraction of the initial stiffness. Slopes that differ less are equal, because points are rounded.
_SAME_SLOPE = 1e-6


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import extra_rows, fail, follow_branches, set_branch

    # ---- Backbone curve

    @inline
    def has_side(law_parameters, i, side):
        """Return True unless the law acts on the other side only."""
        sides = law_parameters[_SIDES_ROW, i]
        return sides == 0.0 or (sides == 1.0) == (side > 0.0)

    @inline
    def point_drift(law_parameters, i, side, j):
        """Return the drift of point `j` of a side, m; infinite after the last point."""
        return law_parameters[_POINTS + 2 * j + (0 if side > 0.0 else _SIDE), i]

    @inline
    def point_force(law_parameters, i, side, j):
        """Return the force of point `j` of a side, N; 0 on a side without a curve."""
        if not has_side(law_parameters, i, side):
            return 0.0
        return law_parameters[_POINTS + 2 * j + 1 + (0 if side > 0.0 else _SIDE), i]

    @inline
    def last_slope(law_parameters, i, side):
        """Return the slope after the last point of a side, N/m."""
        if not has_side(law_parameters, i, side):
            return 0.0
        return law_parameters[_LAST_SLOPE if side > 0.0 else _NEGATIVE_LAST_SLOPE, i]

    curve = backbone_curve(point_drift, point_force, last_slope, MAX_POINTS)
    segment_slope, segment_end, backbone_force = curve.slope, curve.end, curve.force

    peak_keys = [parameter(_FIRST_PEAK_KEY + j) for j in range(len(PeakKeys._fields) - 1)]
    peak = peak_rule(curve, PeakKeys._make([*peak_keys, has_side]), MAX_POINTS)
    set_backbone = peak.set_backbone

    # ---- Rule `kinematic`

    @inline
    def spring_stiffness(law_parameters, i, j):
        """Return the stiffness of spring `j`, N/m; 0 without a change of slope at its point."""
        return max(
            segment_slope(law_parameters, i, 1.0, j) - segment_slope(law_parameters, i, 1.0, j + 1),
            0.0,
        )

    @inline
    def has_spring(law_parameters, i, j):
        """Return True if the backbone curve has a point `j`."""
        return j < MAX_POINTS and point_drift(law_parameters, i, 1.0, j) < math.inf

    @inline
    def spring_force(law_parameters, law_state, i, block, j):
        """Return the force of spring `j` at the current drift, N.

        On a branch of loading, the springs at their strength in this direction yield.
        """
        side = law_state[block + rows.RATE_SIGN, i]
        force = law_state[extra_rows(law_state, block) + j, i]
        stiffness = spring_stiffness(law_parameters, i, j)
        if side != 0.0 and side * force == stiffness * point_drift(law_parameters, i, side, j):
            return force
        return force + stiffness * (law_state[block + rows.DRIFT, i] - law_state[block + _START, i])

    @outlined
    def set_kinematic(law_parameters, law_state, i, block, side):
        """Set the branch of loading towards a side (1, -1), or the elastic branch (0).

        The springs that reach their strength on this side yield from here on.
        """
        first = extra_rows(law_state, block)
        j = 0
        while has_spring(law_parameters, i, j):
            law_state[first + j, i] = spring_force(law_parameters, law_state, i, block, j)
            j += 1
        drift = law_state[block + rows.DRIFT, i]
        law_state[block + _START, i] = drift
        slope = last_slope(law_parameters, i, 1.0)
        force = slope * drift
        reach_up = reach_down = math.inf
        j = 0
        while has_spring(law_parameters, i, j):
            stiffness = spring_stiffness(law_parameters, i, j)
            if stiffness > 0.0:
                up = point_drift(law_parameters, i, 1.0, j)
                down = point_drift(law_parameters, i, -1.0, j)
                to_up = up - law_state[first + j, i] / stiffness
                to_down = down + law_state[first + j, i] / stiffness
                if side > 0.0 and to_up <= _TOGETHER * up:
                    law_state[first + j, i] = stiffness * up
                elif side < 0.0 and to_down <= _TOGETHER * down:
                    law_state[first + j, i] = -(stiffness * down)
                else:
                    slope += stiffness
                    reach_up = min(reach_up, max(to_up, 0.0))
                    reach_down = min(reach_down, max(to_down, 0.0))
                force += law_state[first + j, i]
            j += 1
        law_state[block + rows.FORCE, i] = force
        upper = drift + reach_up if side >= 0.0 else math.inf
        lower = drift - reach_down if side <= 0.0 else -math.inf
        set_branch(law_state, i, block, slope, lower, upper, side)

    @outlined
    def kinematic_energy(law_parameters, law_state, i):
        """Return the energy stored in the springs, J.

        If the curve falls, its last springs and S_last store f^2 / (2 S) together, with their
        force f and the slope S of the last rising segment, as the bilinear law does.
        """
        drift = law_state[rows.DRIFT, i]
        last_slope = law_parameters[_LAST_SLOPE, i]
        energy = 0.5 * max(last_slope, 0.0) * drift * drift
        falling_force = last_slope * drift
        rising_slope = math.inf
        j = 0
        while has_spring(law_parameters, i, j):
            force = spring_force(law_parameters, law_state, i, 0, j)
            if last_slope < 0.0 and segment_slope(law_parameters, i, 1.0, j + 1) <= 0.0:
                falling_force += force
                if segment_slope(law_parameters, i, 1.0, j) > 0.0:
                    rising_slope = segment_slope(law_parameters, i, 1.0, j)
            elif spring_stiffness(law_parameters, i, j) > 0.0:
                energy += 0.5 * force * force / spring_stiffness(law_parameters, i, j)
            j += 1
        if last_slope < 0.0:
            energy += 0.5 * falling_force * falling_force / rising_slope
        return energy

    # ---- Rule `isotropic`

    @inline
    def plastic_drift(law_parameters, i, side, j):
        """Return the plastic drift of point `j` of a side, m; infinite after the last point."""
        end = segment_end(law_parameters, i, side, j)
        if end == math.inf:
            return math.inf
        return end - point_force(law_parameters, i, side, j) / law_parameters[rows.STIFFNESS, i]

    @inline
    def strength(law_parameters, i, side, path):
        """Return the strength of a side (N) after a path of the plastic drift (m), with the slope
        of the backbone curve (N/m) and the path at the end of its segment."""
        k = law_parameters[rows.STIFFNESS, i]
        j = 1
        start = 0.0
        end = plastic_drift(law_parameters, i, side, j)
        while path >= end * (1.0 - TOLERANCE):
            start = end
            j += 1
            end = plastic_drift(law_parameters, i, side, j)
        slope = segment_slope(law_parameters, i, side, j)
        force = point_force(law_parameters, i, side, j - 1) + slope * k / (k - slope) * (
            path - start
        )
        if slope < 0.0:
            end = min(end, path - force * (k - slope) / (slope * k))
        return force, slope, end

    @inline
    def plastic_path(law_parameters, law_state, i, block):
        """Return the path of the plastic drift, m."""
        path = law_state[block + _PLASTIC_PATH, i]
        if law_state[block + rows.RATE_SIGN, i] != 0.0:
            share = 1.0 - law_state[block + rows.SLOPE, i] / law_parameters[rows.STIFFNESS, i]
            path += share * abs(law_state[block + rows.DRIFT, i] - law_state[block + _START, i])
        return path

    @outlined
    def set_isotropic(law_parameters, law_state, i, block, side):
        """Set the branch of yielding on a side (1, -1), or the elastic branch (0)."""
        k = law_parameters[rows.STIFFNESS, i]
        path = plastic_path(law_parameters, law_state, i, block)
        drift = law_state[block + rows.DRIFT, i]
        law_state[block + _PLASTIC_PATH, i] = path
        law_state[block + _START, i] = drift
        if side == 0.0:
            force = law_state[block + rows.FORCE, i]
            positive, _, _ = strength(law_parameters, i, 1.0, path)
            negative, _, _ = strength(law_parameters, i, -1.0, path)
            lower = drift - max(negative + force, 0.0) / k
            upper = drift + max(positive - force, 0.0) / k
            set_branch(law_state, i, block, k, lower, upper, 0.0)
            return
        force, slope, end = strength(law_parameters, i, side, path)
        if force <= TOLERANCE * point_force(law_parameters, i, side, 0):
            fail(law_state, i, block, FAILED)
            return
        law_state[block + rows.FORCE, i] = side * force
        end = side * drift + (end - path) * k / (k - slope)
        upper = end if side > 0.0 else math.inf
        lower = -end if side < 0.0 else -math.inf
        set_branch(law_state, i, block, slope, lower, upper, side)

    # ---- Rule `origin`

    @inline
    def set_maximum(law_state, i, block, side):
        """Store the current point as the point of maximum drift of a side."""
        row = rows.HIGH_DRIFT if side > 0.0 else rows.LOW_DRIFT
        law_state[block + row, i] = law_state[block + rows.DRIFT, i]
        law_state[block + row + 1, i] = law_state[block + rows.FORCE, i]

    @inline
    def set_secant(law_state, i, block, side):
        """Set the line from the origin to the point of maximum drift of a side, rule `origin`."""
        row = rows.HIGH_DRIFT if side > 0.0 else rows.LOW_DRIFT
        max_drift = law_state[block + row, i]
        slope = law_state[block + row + 1, i] / max_drift
        law_state[block + rows.INTERNAL, i] = side * UNLOADING
        law_state[block + rows.FORCE, i] = slope * law_state[block + rows.DRIFT, i]
        set_branch(law_state, i, block, slope, min(max_drift, 0.0), max(max_drift, 0.0), 0.0)

    @inline
    def switch_origin(law_parameters, law_state, i, block, event):
        """Set the branch that follows, rule `origin`."""
        if event == rows.REVERSED:
            side = law_state[block + rows.RATE_SIGN, i]
            set_maximum(law_state, i, block, side)
            set_secant(law_state, i, block, side)
            return
        row = rows.HIGH_DRIFT if event > 0.0 else rows.LOW_DRIFT
        max_drift = law_state[block + row, i]
        if event * (max_drift - law_state[block + rows.DRIFT, i]) > TOLERANCE * abs(max_drift):
            set_secant(law_state, i, block, event)
        else:
            set_backbone(law_parameters, law_state, i, block, event)

    # ---- Rule `flag`

    @inline
    def return_drift(law_parameters, i, side, j):
        """Return the drift of point `j` of the lower curve, m; infinite after the last point."""
        return law_parameters[_RETURN_POINTS + 2 * j + (0 if side > 0.0 else _RETURN_SIDE), i]

    @inline
    def return_force(law_parameters, i, side, j):
        """Return the force of point `j` of the lower curve, N; 0 on a side without a curve."""
        if not has_side(law_parameters, i, side):
            return 0.0
        return law_parameters[_RETURN_POINTS + 2 * j + 1 + (0 if side > 0.0 else _RETURN_SIDE), i]

    @inline
    def return_slope(law_parameters, i, side):
        """Return the slope after the last point of the lower curve, N/m."""
        if not has_side(law_parameters, i, side):
            return 0.0
        return law_parameters[_RETURN_SLOPE + (0 if side > 0.0 else 1), i]

    @outlined
    def elastic_stiffness(law_parameters, i):
        """Return the stiffness between the curves, N/m: the specified one, or the steepest slope
        of the upper curves."""
        stiffness = law_parameters[_ELASTIC_STIFFNESS, i]
        if stiffness > 0.0:
            return stiffness
        for part in range(2):
            side = 1.0 if part == 0 else -1.0
            j = 0
            while segment_end(law_parameters, i, side, j) < math.inf:
                stiffness = max(stiffness, segment_slope(law_parameters, i, side, j))
                j += 1
        return stiffness

    lower_curve = backbone_curve(return_drift, return_force, return_slope, _MAX_RETURN_POINTS)
    flag = flag_rule(curve, lower_curve, elastic_stiffness)

    # ---- Rule `elastic`

    @outlined
    def set_segment(law_parameters, law_state, i, block, index):
        """Set a segment of the curve as the branch, rule `elastic`.

        Index 0 and the positive ones are the segments of the positive side, -1 and below are
        the segments of the negative side. The first segments of both sides are one branch if their
        slopes are equal.
        """
        side = 1.0 if index >= 0.0 else -1.0
        j = int(index) if index >= 0.0 else int(-1.0 - index)
        slope = segment_slope(law_parameters, i, side, j)
        end = segment_end(law_parameters, i, side, j)
        begin = point_drift(law_parameters, i, side, j - 1) if j > 0 else 0.0
        if j == 0 and segment_slope(law_parameters, i, -side, 0) == slope:
            begin = -point_drift(law_parameters, i, -side, 0)
        law_state[block + rows.INTERNAL, i] = index
        law_state[block + rows.FORCE, i] = side * backbone_force(
            law_parameters, i, side, j, side * law_state[block + rows.DRIFT, i]
        )
        set_branch(law_state, i, block, slope, min(side * begin, side * end), 0.0, 0.0)
        law_state[block + rows.UPPER, i] = max(side * begin, side * end)

    @inline
    def switch_elastic(law_parameters, law_state, i, block, event):
        """Set the next segment in the direction of the event, rule `elastic`."""
        index = law_state[block + rows.INTERNAL, i]
        # One branch contains the first segments of both sides, or ends at zero drift.
        if (
            (index == 0.0 or index == -1.0)
            and law_state[block + rows.LOWER, i] < 0.0
            and law_state[block + rows.UPPER, i] > 0.0
        ):
            index = 0.0 if event > 0.0 else -1.0
        set_segment(law_parameters, law_state, i, block, index + event)

    @outlined
    def elastic_energy(law_parameters, i, drift):
        """Return the area below the curve up to a drift, J, rule `elastic`."""
        side = 1.0 if drift >= 0.0 else -1.0
        size = abs(drift)
        energy = begin = 0.0
        j = 0
        while True:
            end = min(segment_end(law_parameters, i, side, j), size)
            if end > begin:
                forces = backbone_force(law_parameters, i, side, j, begin)
                forces += backbone_force(law_parameters, i, side, j, end)
                energy += 0.5 * (end - begin) * forces
            if end == size:
                return energy
            begin = end
            j += 1

    # ---- Functions of the law

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows by the rule."""
        rule = law_parameters[_RULE, i]
        if rule == _KINEMATIC:
            set_kinematic(law_parameters, law_state, i, block, event)
        elif rule == _ISOTROPIC:
            set_isotropic(law_parameters, law_state, i, block, event)
        elif rule == _ORIGIN:
            switch_origin(law_parameters, law_state, i, block, event)
        elif rule == _PEAK:
            peak.switch(law_parameters, law_state, i, block, event)
        elif rule == _ELASTIC:
            switch_elastic(law_parameters, law_state, i, block, event)
        else:
            flag.switch(law_parameters, law_state, i, block, event)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the energy that unloading to zero force would release, J."""
        rule = law_parameters[_RULE, i]
        force = law_state[rows.FORCE, i]
        drift = law_state[rows.DRIFT, i]
        if law_state[rows.INTERNAL, i] == FAILED:
            return 0.0
        if rule == _KINEMATIC:
            return kinematic_energy(law_parameters, law_state, i)
        if rule == _ISOTROPIC:
            return 0.5 * force * force / law_parameters[rows.STIFFNESS, i]
        if rule == _ORIGIN:
            return 0.5 * force * drift
        if rule == _PEAK:
            return peak.strain_energy(law_parameters, law_state, i)
        if rule == _FLAG:
            return flag.strain_energy(law_parameters, law_state, i)
        return elastic_energy(law_parameters, i, drift)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the first branch, elastic between the first points of both sides."""
        rule = law_parameters[_RULE, i]
        if rule == _ELASTIC:
            set_segment(law_parameters, law_state, i, 0, 0.0)
            return
        if rule == _PEAK:
            peak.enter(law_parameters, law_state, i)
            return
        if rule == _FLAG:
            flag.enter(law_parameters, law_state, i)
            return
        for side in (1.0, -1.0):
            row = rows.HIGH_DRIFT if side > 0.0 else rows.LOW_DRIFT
            if rule == _ORIGIN:
                law_state[row, i] = side * point_drift(law_parameters, i, side, 0)
                law_state[row + 1, i] = side * point_force(law_parameters, i, side, 0)
        law_state[rows.UPPER, i] = point_drift(law_parameters, i, 1.0, 0)
        law_state[rows.LOWER, i] = -point_drift(law_parameters, i, -1.0, 0)

    functions = follow_branches(switch, strain_energy, enter)
    work_not_stored = functions.hysteretic_energy

    @inline
    def hysteretic_energy(law_parameters, law_state, i):
        """Return the dissipated energy, J; exactly 0 for rule `elastic`."""
        if law_parameters[_RULE, i] == _ELASTIC:
            return 0.0
        return work_not_stored(law_parameters, law_state, i)

    return replace(functions, hysteretic_energy=hysteretic_energy)


# ---- Checks and properties of the parameters

_Points = list[tuple[float, float]]


class _Curve(NamedTuple):
    """Curve of a side: its points (drift, m, and force, N) and the slope after them, N/m."""

    points: _Points
    last_slope: float

    @property
    def slopes(self) -> list[float]:
        """Slopes of all segments, N/m; infinite between points with the same drift."""
        corners = [(0.0, 0.0), *self.points]
        return [
            (force - previous_force) / (drift - previous_drift)
            if drift != previous_drift
            else math.inf
            for (previous_drift, previous_force), (drift, force) in pairwise(corners)
        ] + [self.last_slope]

    def force(self, drift: float) -> float:
        """Return the force at a drift, N."""
        force, corners = 0.0, [(0.0, 0.0), *self.points, (math.inf, 0.0)]
        for slope, ((start, _), (end, _)) in zip(self.slopes, pairwise(corners), strict=True):
            if drift > start:
                force += slope * (min(drift, end) - start)
        return force


def _points(values: Sequence[float], row: int, size: int) -> _Points:
    """Return the points whose numbers start in a row of `law_parameters`."""
    numbers = values[row - rows.FIRST_PARAMETER :][:size]
    pairs = zip(numbers[::2], numbers[1::2], strict=True)
    return [(drift, force) for drift, force in pairs if drift != math.inf]


def _sides(values: Sequence[float]) -> dict[float, tuple[_Curve, _Curve]]:
    """Return the upper and the lower curve of the sides (1, -1) on which the law acts. The lower
    curve has no points unless the rule is `flag`."""
    result = {}
    for side, part in ((1.0, 0), (-1.0, 1)):
        if values[_SIDES_ROW - rows.FIRST_PARAMETER] in (0.0, 1.0 + part):
            slope_row = _NEGATIVE_LAST_SLOPE if part else _LAST_SLOPE
            upper = _points(values, _POINTS + part * _SIDE, _SIDE)
            lower = _points(values, _RETURN_POINTS + part * _RETURN_SIDE, _RETURN_SIDE)
            result[side] = (
                _Curve(upper, values[slope_row - rows.FIRST_PARAMETER]),
                _Curve(lower, values[_RETURN_SLOPE + part - rows.FIRST_PARAMETER]),
            )
    return result


def _upper_curves(values: Sequence[float]) -> list[_Curve]:
    """Return the upper curves of the sides on which the law acts."""
    return [upper for upper, _ in _sides(values).values()]


def _all_slopes(values: Sequence[float]) -> list[float]:
    """Return the slopes of all segments of the upper curves, N/m."""
    return [slope for upper in _upper_curves(values) for slope in upper.slopes]


def _initial_stiffness(values: Sequence[float]) -> float:
    """Return the slope of the first segment of the first side on which the law acts, N/m."""
    return _upper_curves(values)[0].slopes[0]


def _largest_stiffness(stiffness: float, values: Sequence[float]) -> float:
    """Return the steepest slope of a branch, N/m."""
    return max([*_all_slopes(values), values[_ELASTIC_STIFFNESS - rows.FIRST_PARAMETER]])


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return an error message if the curves do not fit the rule, otherwise None."""
    rule = values[0]
    name = _RULES[int(rule)]
    keys = dict(zip(_PEAK_KEYS, values[_FIRST_PEAK_KEY - rows.FIRST_PARAMETER :], strict=False))
    changed = [key for key, value in keys.items() if value != _PEAK_KEYS[key]]
    if changed and rule != _PEAK:
        return f"{changed[0].partition('.')[0]} requires rule peak, got rule {name}"
    sides = _sides(values)
    if len(sides) == 1 and rule not in _ONE_SIDED:
        return f"sides requires rule peak, elastic or flag, got rule {name}"
    if len(sides) == 1 and (keys["damage.drift"] or keys["damage.work"]):
        return "damage requires both sides, because each side damages the other one"
    for side, (upper, lower) in sides.items():
        prefix = "" if side > 0.0 else "negative."
        fault = (
            _points_fault(upper.points, f"{prefix}backbone", name, _ON_AXIS.get(rule, 0))
            or _points_fault(lower.points, f"{prefix}return", name, len(lower.points))
            or (_flag_fault(upper, lower, prefix, values) if rule == _FLAG else None)
        )
        if fault:
            return fault
        if lower.points and rule != _FLAG:
            return f"return requires rule flag, got rule {name}"
        first_slope = upper.slopes[0]
        if rule not in (_ELASTIC, _FLAG) and not math.isclose(
            first_slope, stiffness, rel_tol=_SAME_SLOPE
        ):
            return (
                f"the first point of {prefix}backbone must be on the line of the initial stiffness "
                f"{stiffness:.10g} N/m, got a slope of {first_slope:.10g} N/m"
            )
    slopes = [upper.slopes for upper, _ in sides.values()]
    specified = values[_ELASTIC_STIFFNESS - rows.FIRST_PARAMETER]
    allowed = {stiffness, max(map(max, slopes))} if rule == _PEAK else {stiffness}
    agrees = any(math.isclose(specified, slope, rel_tol=_SAME_SLOPE) for slope in allowed)
    if specified and rule != _FLAG and not agrees:
        return (
            f"stiffness must agree with the initial stiffness {stiffness:.10g} N/m of the "
            f"backbone curve, got {specified:.10g} N/m; correct it or omit it"
        )
    if rule == _KINEMATIC:
        return _kinematic_fault(slopes)
    if rule == _ISOTROPIC and max(max(side[1:]) for side in slopes) >= stiffness:
        return (
            f"rule {name} requires slopes below the initial stiffness {stiffness:.10g} N/m after "
            "the first point; use rule peak or origin for a curve that becomes steeper"
        )
    return None


def _points_fault(points: _Points, key: str, name: str, zero_forces: int) -> str | None:
    """Return an error message if the points of a curve are invalid.

    The forces of the first `zero_forces` points may be zero, and have any sign for rule elastic.
    """
    for j, ((drift, force), (previous_drift, _)) in enumerate(
        zip(points, [(0.0, 0.0), *points], strict=False), start=1
    ):
        if not drift > previous_drift:
            return (
                f"the drifts of {key} must be positive and increase from point to point, got "
                f"{drift:.10g} m after {previous_drift:.10g} m (point {j})"
            )
        if force < 0.0 and j <= zero_forces and name != "elastic":
            return f"the forces of {key} must not be negative, got {force:.10g} N (point {j})"
        if not force > 0.0 and j > zero_forces:
            return (
                f"the forces of {key} must be positive for rule {name}, got {force:.10g} N "
                f"(point {j}); use last_slope for a curve that falls to zero"
            )
    return None


def _flag_fault(upper: _Curve, lower: _Curve, prefix: str, values: Sequence[float]) -> str | None:
    """Return an error message if the curves of rule `flag` intersect or are too steep."""
    if not lower.points:
        return f"rule flag requires {prefix}return, the points of the lower curve"
    if lower.last_slope < 0.0:
        return f"the slope of {prefix}return must not be negative, got {lower.last_slope:.10g} N/m"
    if upper.last_slope < lower.last_slope:
        return (
            f"{prefix}return must not exceed {prefix}backbone, but its slope after the last point "
            f"is {lower.last_slope:.10g} N/m and that of the backbone {upper.last_slope:.10g} N/m"
        )
    for drift, _ in sorted({*upper.points, *lower.points}):
        high, low = upper.force(drift), lower.force(drift)
        if low > high * (1.0 + _SAME_SLOPE):
            return (
                f"{prefix}return must not exceed {prefix}backbone, got {low:.10g} N and "
                f"{high:.10g} N at {drift:.10g} m"
            )
    elastic = _largest_stiffness(math.nan, values)
    specified = values[_ELASTIC_STIFFNESS - rows.FIRST_PARAMETER]
    if specified and elastic > specified * (1.0 + _SAME_SLOPE):
        return (
            f"stiffness, between the curves of rule flag, must be at least the steepest slope of "
            f"the backbone {elastic:.10g} N/m, got {specified:.10g} N/m"
        )
    return None


def _kinematic_fault(slopes: Sequence[Sequence[float]]) -> str | None:
    """Return an error message if a curve of rule `kinematic` needs a spring that creates energy."""
    positive, negative = slopes
    for j, (slope, next_slope) in enumerate(pairwise(positive), start=1):
        if next_slope > slope + _SAME_SLOPE * positive[0]:
            return (
                f"rule kinematic requires slopes that decrease from point to point, got "
                f"{next_slope:.10g} N/m after {slope:.10g} N/m at point {j}; use rule isotropic, "
                "origin, peak or elastic"
            )
    if len(positive) != len(negative) or any(
        abs(slope - other) > _SAME_SLOPE * positive[0]
        for slope, other in zip(positive, negative, strict=True)
    ):
        return (
            "rule kinematic requires the same slopes on both sides; the drifts of the points of "
            "negative.backbone may differ"
        )
    return None


def _warning(stiffness: float, values: Sequence[float]) -> str | None:
    """Return a warning if the line to the origin becomes steeper, which creates energy, or if
    each reversal increases the drift to which reloading is directed."""
    if any(values[_FIRST_PEAK_KEY + 4 - rows.FIRST_PARAMETER :][:2]):
        return (
            "damage increases the drift of the target at each reversal, however small the cycle; "
            "many small cycles can move it without limit"
        )
    if values[0] != _ORIGIN:
        return None
    for upper in _upper_curves(values):
        secants = [force / drift for drift, force in upper.points]
        for slope, secant in zip(upper.slopes[1:], secants, strict=True):
            if slope > (1.0 + _SAME_SLOPE) * secant:
                return (
                    "the backbone curve of rule origin becomes steeper than its line to the "
                    "origin: unloading then releases more energy than was supplied; use rule peak"
                )
    return None


def _stiffens(values: Sequence[float]) -> bool:
    """Return True if a branch is steeper than the first segment."""
    first_slope = _initial_stiffness(values)
    return _largest_stiffness(first_slope, values) > (1.0 + _SAME_SLOPE) * first_slope


def _is_symmetric(values: Sequence[float]) -> bool:
    """Return True if the law is elastic with the same curve on both sides."""
    return values[0] == _ELASTIC and _has_equal_sides(values)


def _has_equal_sides(values: Sequence[float]) -> bool:
    """Return True if the law acts on both sides with the same curves."""
    curves = list(_sides(values).values())
    return len(curves) == 2 and curves[0] == curves[1]


def _yield_drift(stiffness: float, values: Sequence[float]) -> float:
    """Return the drift of the first point of both sides, m, or of the next point if the first one
    has no force; nan for rule `elastic`."""
    if values[0] == _ELASTIC:
        return math.nan
    return min(
        next((drift for drift, force in upper.points if force > 0.0), upper.points[0][0])
        for upper in _upper_curves(values)
    )


def _last_line(
    stiffness: float, values: Sequence[float], side: float
) -> tuple[float, float] | None:
    """Return force at zero drift (N) and slope (N/m) after the last point of a side.

    The other rules fail at zero force, and rule `flag` does not fall.
    """
    curves = _sides(values).get(side)
    if values[0] not in (_KINEMATIC, _ELASTIC) or curves is None:
        return None
    upper = curves[0]
    drift, force = upper.points[-1]
    return force - upper.last_slope * drift, upper.last_slope


def _falls(stiffness: float, values: Sequence[float]) -> bool:
    """Return True if a segment of a curve falls."""
    return min(min(upper.slopes[:-1]) for upper in _upper_curves(values)) < 0.0


_CURVE = LawParameter(
    "backbone",
    points=MAX_POINTS,
    least_points=1,
    open_ended=True,
    long_form="multilinear, rule: peak",
)
_RETURN = LawParameter(
    "return", points=_MAX_RETURN_POINTS, least_points=1, open_ended=True, default=math.inf
)
_SLOPE = LawParameter("last_slope", force=1, length=-1, default=0.0)

_PEAK_KEYS = {
    "unloading": 0.0,
    "reloading": 0.0,
    "pinching.drift": 1.0,
    "pinching.force": 1.0,
    "damage.drift": 0.0,
    "damage.work": 0.0,
}
"""Keys of rule `peak` in the order of their rows, with the values of a law without them."""

_ON_AXIS = {_PEAK: 1, _FLAG: MAX_POINTS, _ELASTIC: MAX_POINTS}
"""Number of points of the backbone curve, from the first one, whose force may be zero."""

LAW = DriftLaw(
    "multilinear",
    "backbone through any number of points, and a rule: kinematic (Iwan, Masing), isotropic, "
    "origin, peak (Clough, Takeda, pinching, slack), elastic or flag",
    _functions,
    parameters=(
        LawParameter("rule", choices=_RULES),
        _SLOPE,
        _CURVE,
        replace(_CURVE, default="backbone", group="negative"),
        replace(_SLOPE, default="last_slope", group="negative"),
        LawParameter("unloading", low=0.0, high=1.0, high_allowed=False, default=0.0),
        LawParameter("reloading", low=0.0, high=1.0, high_allowed=False, default=0.0),
        LawParameter("drift", low=0.0, high=1.0, group="pinching", without=1.0),
        LawParameter("force", low=0.0, high=1.0, group="pinching", without=1.0),
        LawParameter("drift", low=0.0, group="damage", default=0.0),
        LawParameter("work", low=0.0, group="damage", default=0.0),
        LawParameter("sides", choices=SIDES, default="both"),
        LawParameter("return_slope", force=1, length=-1, default="last_slope"),
        LawParameter("return_slope", force=1, length=-1, default="return_slope", group="negative"),
        _RETURN,
        replace(_RETURN, default="return", group="negative"),
        LawParameter("stiffness", force=1, length=-1, low=0.0, low_allowed=False, default=0.0),
    ),
    kinked=True,
    extra_rows=MAX_POINTS,
    stiffens=_stiffens,
    symmetric=_is_symmetric,
    equal_directions=_has_equal_sides,
    initial_stiffness=_initial_stiffness,
    largest_stiffness=_largest_stiffness,
    yield_drift=_yield_drift,
    fault=_fault,
    warning=_warning,
    falls=_falls,
    failed=FAILED,
    last_line=_last_line,
)
