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
    peak        unloading with k to zero force, then a line to the point of maximum drift of the
                other side (Clough 1966)
    elastic     the curve itself

If a segment of rule `peak` is steeper than k, the unloading stiffness is the steepest slope that
the side has reached: no branch then creates energy. A falling curve ends at zero force, where the
story fails (rules `isotropic`, `origin`, `peak`) or has no resistance left (`last_line`).

In the functions below, drifts and forces with a `side` are positive in the direction of that side.
`tdint.kernels.laws.law.LawFunctions` describes the functions and their arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import MAX_POINTS, DriftLaw, LawFunctions, LawParameter
from tdint.kernels.laws.peak_oriented import BACKBONE, UNLOADING, peak_oriented_switch

_RULES = ("kinematic", "isotropic", "origin", "peak", "elastic")
_KINEMATIC, _ISOTROPIC, _ORIGIN, _PEAK, _ELASTIC = map(float, range(len(_RULES)))

# Rows of `law_parameters`: rule (index in `_RULES`), slope after the last point (N/m), then drift
# (m) and force (N) of each point of the positive side and of the negative side. Points that the
# model does not specify are infinite.
_RULE = rows.FIRST_PARAMETER
_LAST_SLOPE = rows.FIRST_PARAMETER + 1
_POINTS = rows.FIRST_PARAMETER + 2
_SIDE = 2 * MAX_POINTS

# Rules `kinematic` and `isotropic`: drift at the start of the branch (m) and path of the plastic
# drift at this point (m). The forces of the springs at this point are the extra rows, N.
_START = rows.HIGH_DRIFT
_PLASTIC_PATH = rows.HIGH_FORCE

# Row INTERNAL contains the type of the branch for the rules `origin` and `peak`, as in
# `peak_oriented`, and the index of the segment (`set_segment`) for rule `elastic`.
_FAILED = 1e3  # no strength; larger than the index of any segment

# Fraction of a drift or force. Points that are closer to each other are regarded as equal.
_TOLERANCE = 1e-12
# Fraction of the yield drift of a spring. Springs with a smaller distance yield together.
_TOGETHER = 1e-10
# Fraction of the initial stiffness. Slopes that differ less are equal, because points are rounded.
_SAME_SLOPE = 1e-6


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import extra_rows, fail, follow_branches, set_branch

    # ---- Backbone curve. Segment j ends at point j; the last segment has no end.

    @inline
    def point_drift(law_parameters, i, side, j):
        """Return the drift of point `j` of a side, m; infinite after the last point."""
        return law_parameters[_POINTS + 2 * j + (0 if side > 0.0 else _SIDE), i]

    @inline
    def point_force(law_parameters, i, side, j):
        """Return the force of point `j` of a side, N."""
        return law_parameters[_POINTS + 2 * j + 1 + (0 if side > 0.0 else _SIDE), i]

    @outlined
    def segment_slope(law_parameters, i, side, j):
        """Return the slope of segment `j` of a side, N/m."""
        if j == 0:
            return point_force(law_parameters, i, side, 0) / point_drift(law_parameters, i, side, 0)
        if j == MAX_POINTS or point_drift(law_parameters, i, side, j) == math.inf:
            return law_parameters[_LAST_SLOPE, i]
        return (
            point_force(law_parameters, i, side, j) - point_force(law_parameters, i, side, j - 1)
        ) / (point_drift(law_parameters, i, side, j) - point_drift(law_parameters, i, side, j - 1))

    @inline
    def segment_end(law_parameters, i, side, j):
        """Return the drift at the end of segment `j` of a side, m; infinite for the last one."""
        return point_drift(law_parameters, i, side, j) if j < MAX_POINTS else math.inf

    @inline
    def segment_of(law_parameters, i, side, drift):
        """Return the segment that begins at a drift, or that contains it."""
        j = 0
        while j < MAX_POINTS and point_drift(law_parameters, i, side, j) <= drift * (
            1.0 + _TOLERANCE
        ):
            j += 1
        return j

    @inline
    def backbone_force(law_parameters, i, side, j, drift):
        """Return the force of segment `j` of a side at a drift, N."""
        slope = segment_slope(law_parameters, i, side, j)
        if j == 0:
            return slope * drift
        return point_force(law_parameters, i, side, j - 1) + slope * (
            drift - point_drift(law_parameters, i, side, j - 1)
        )

    @inline
    def set_loading(law_state, i, block, side, slope, end):
        """Set a branch that is valid for the direction of a side, up to the drift `end`."""
        upper = end if side > 0.0 else math.inf
        lower = -end if side < 0.0 else -math.inf
        set_branch(law_state, i, block, slope, lower, upper, side)

    @outlined
    def set_backbone(law_parameters, law_state, i, block, side):
        """Set the backbone curve as the branch; the story fails where its force is zero."""
        drift = side * law_state[block + rows.DRIFT, i]
        j = segment_of(law_parameters, i, side, drift)
        slope = segment_slope(law_parameters, i, side, j)
        force = backbone_force(law_parameters, i, side, j, drift)
        if force <= _TOLERANCE * point_force(law_parameters, i, side, 0):
            fail(law_state, i, block, _FAILED)
            return
        end = segment_end(law_parameters, i, side, j)
        if slope < 0.0:
            end = min(end, drift - force / slope)
        law_state[block + rows.INTERNAL, i] = side * BACKBONE
        law_state[block + rows.FORCE, i] = side * force
        set_loading(law_state, i, block, side, slope, end)

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
        slope = law_parameters[_LAST_SLOPE, i]
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
        while path >= end * (1.0 - _TOLERANCE):
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
            set_branch(
                law_state,
                i,
                block,
                k,
                drift - max(negative + force, 0.0) / k,
                drift + max(positive - force, 0.0) / k,
                0.0,
            )
            return
        force, slope, end = strength(law_parameters, i, side, path)
        if force <= _TOLERANCE * point_force(law_parameters, i, side, 0):
            fail(law_state, i, block, _FAILED)
            return
        law_state[block + rows.FORCE, i] = side * force
        set_loading(law_state, i, block, side, slope, side * drift + (end - path) * k / (k - slope))

    # ---- Rules `origin` and `peak`

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
        if event * (max_drift - law_state[block + rows.DRIFT, i]) > _TOLERANCE * abs(max_drift):
            set_secant(law_state, i, block, event)
        else:
            set_backbone(law_parameters, law_state, i, block, event)

    @outlined
    def unloading_stiffness(law_parameters, law_state, i, block, side):
        """Return the steepest slope of the backbone curve of a side up to its maximum drift, N/m,
        rule `peak`."""
        max_drift = (
            law_state[block + rows.HIGH_DRIFT, i]
            if side > 0.0
            else -law_state[block + rows.LOW_DRIFT, i]
        )
        max_drift = max(max_drift, side * law_state[block + rows.DRIFT, i])
        stiffness = law_parameters[rows.STIFFNESS, i]
        j = 0
        while j < MAX_POINTS and point_drift(law_parameters, i, side, j) < max_drift:
            j += 1
            stiffness = max(stiffness, segment_slope(law_parameters, i, side, j))
        return stiffness

    switch_peak = peak_oriented_switch(unloading_stiffness, set_backbone)

    # ---- Rule `elastic`

    @outlined
    def set_segment(law_parameters, law_state, i, block, index):
        """Set a segment of the curve as the branch, rule `elastic`.

        Index 0 and the positive ones are the segments of the positive side, -1 and below those of
        the negative side. The first segments of both sides are one branch if their slopes are
        equal.
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
                energy += (
                    0.5
                    * (end - begin)
                    * (
                        backbone_force(law_parameters, i, side, j, begin)
                        + backbone_force(law_parameters, i, side, j, end)
                    )
                )
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
            switch_peak(law_parameters, law_state, i, block, event)
        else:
            switch_elastic(law_parameters, law_state, i, block, event)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the energy that unloading to zero force would release, J."""
        rule = law_parameters[_RULE, i]
        force = law_state[rows.FORCE, i]
        drift = law_state[rows.DRIFT, i]
        if law_state[rows.INTERNAL, i] == _FAILED:
            return 0.0
        if rule == _KINEMATIC:
            return kinematic_energy(law_parameters, law_state, i)
        if rule == _ISOTROPIC:
            return 0.5 * force * force / law_parameters[rows.STIFFNESS, i]
        if rule == _ORIGIN:
            return 0.5 * force * drift
        if rule == _PEAK:
            side = 1.0 if force >= 0.0 else -1.0
            return 0.5 * force * force / unloading_stiffness(law_parameters, law_state, i, 0, side)
        return elastic_energy(law_parameters, i, drift)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the first branch, elastic between the first points of both sides."""
        rule = law_parameters[_RULE, i]
        if rule == _ELASTIC:
            set_segment(law_parameters, law_state, i, 0, 0.0)
            return
        for side in (1.0, -1.0):
            row = rows.HIGH_DRIFT if side > 0.0 else rows.LOW_DRIFT
            if rule in (_ORIGIN, _PEAK):
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


def _sides(values: Sequence[float]) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Return the points (drift, force) of the positive and of the negative side."""
    first = _POINTS - rows.FIRST_PARAMETER
    positive, negative = (
        [
            (drift, force)
            for drift, force in zip(numbers[::2], numbers[1::2], strict=True)
            if drift != math.inf
        ]
        for numbers in (values[first : first + _SIDE], values[first + _SIDE : first + 2 * _SIDE])
    )
    return positive, negative


def _slopes(points: Sequence[tuple[float, float]], last_slope: float) -> list[float]:
    """Return the slopes of all segments of a backbone curve, N/m."""
    corners = [(0.0, 0.0), *points]
    return [
        (force - previous_force) / (drift - previous_drift)
        for (previous_drift, previous_force), (drift, force) in pairwise(corners)
    ] + [last_slope]


def _initial_stiffness(values: Sequence[float]) -> float:
    """Return the slope of the first segment of the positive side, N/m."""
    (drift, force), *_ = _sides(values)[0]
    return force / drift


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    """Return an error message if the points do not fit the rule, otherwise None."""
    rule, last_slope = values[:2]
    name = _RULES[int(rule)]
    sides = _sides(values)
    for points, key in zip(sides, ("backbone", "negative.backbone"), strict=True):
        for j, ((drift, force), (previous_drift, _)) in enumerate(
            zip(points, [(0.0, 0.0), *points], strict=False), start=1
        ):
            if not drift > previous_drift:
                return (
                    f"the drifts of {key} must be positive and increase from point to point, got "
                    f"{drift:.10g} m after {previous_drift:.10g} m (point {j})"
                )
            if rule != _ELASTIC and not force > 0.0:
                return (
                    f"the forces of {key} must be positive for rule {name}, got {force:.10g} N "
                    f"(point {j}); use last_slope for a curve that falls to zero"
                )
        first_slope = points[0][1] / points[0][0]
        if rule != _ELASTIC and not math.isclose(first_slope, stiffness, rel_tol=_SAME_SLOPE):
            return (
                f"the first point of {key} must be on the line of the initial stiffness "
                f"{stiffness:.10g} N/m, got a slope of {first_slope:.10g} N/m"
            )
    slopes = [_slopes(points, last_slope) for points in sides]
    if rule == _KINEMATIC:
        return _kinematic_fault(slopes)
    if rule == _ISOTROPIC and max(map(max, (side[1:] for side in slopes))) >= stiffness:
        return (
            f"rule {name} requires slopes below the initial stiffness {stiffness:.10g} N/m after "
            "the first point; use rule peak or origin for a curve that becomes steeper"
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
    """Return a warning if the line to the origin becomes steeper, which creates energy."""
    if values[0] != _ORIGIN:
        return None
    for points in _sides(values):
        secants = [force / drift for drift, force in points]
        slopes = _slopes(points, values[1])[1:]
        for slope, secant in zip(slopes, secants, strict=True):
            if slope > (1.0 + _SAME_SLOPE) * secant:
                return (
                    "the backbone curve of rule origin becomes steeper than its line to the "
                    "origin: unloading then releases more energy than was supplied; use rule peak"
                )
    return None


def _stiffens(values: Sequence[float]) -> bool:
    """Return True if a segment of the curve is steeper than the first one."""
    slopes = [slope for points in _sides(values) for slope in _slopes(points, values[1])]
    return max(slopes) > (1.0 + _SAME_SLOPE) * slopes[0]


def _is_symmetric(values: Sequence[float]) -> bool:
    """Return True if the law is elastic with the same curve on both sides."""
    positive, negative = _sides(values)
    return values[0] == _ELASTIC and positive == negative


def _yield_drift(stiffness: float, values: Sequence[float]) -> float:
    """Return the drift of the first point of both sides, m; nan for rule `elastic`."""
    if values[0] == _ELASTIC:
        return math.nan
    return min(points[0][0] for points in _sides(values))


def _last_line(
    stiffness: float, values: Sequence[float], side: float
) -> tuple[float, float] | None:
    """Return force at zero drift (N) and slope (N/m) after the last point of a side.

    The other rules fail at zero force.
    """
    rule, last_slope = values[:2]
    if rule not in (_KINEMATIC, _ELASTIC):
        return None
    drift, force = _sides(values)[0 if side > 0.0 else 1][-1]
    return force - last_slope * drift, last_slope


_CURVE = LawParameter("backbone", points=MAX_POINTS, least_points=1, open_ended=True)


def _falls(stiffness: float, values: Sequence[float]) -> bool:
    """Return True if a segment of a curve falls."""
    return min(slope for points in _sides(values) for slope in _slopes(points, 0.0)) < 0.0


LAW = DriftLaw(
    "multilinear",
    "backbone through any number of points, and the rule of unloading: kinematic (Iwan, Masing), "
    "isotropic, origin, peak (Clough) or elastic",
    _functions,
    parameters=(
        LawParameter("rule", choices=_RULES),
        LawParameter("last_slope", force=1, length=-1, default=0.0),
        _CURVE,
        replace(_CURVE, default="backbone", group="negative"),
    ),
    kinked=True,
    extra_rows=MAX_POINTS,
    stiffens=_stiffens,
    symmetric=_is_symmetric,
    initial_stiffness=_initial_stiffness,
    yield_drift=_yield_drift,
    fault=_fault,
    warning=_warning,
    falls=_falls,
    failed=_FAILED,
    last_line=_last_line,
)
