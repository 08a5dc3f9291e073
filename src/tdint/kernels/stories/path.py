"""Drift laws along a parabola of drift: mean and first moment of the force, with their tangents.

    d(t) = d0 + rise t + bend (t^2 - t) / 2,   t in [0, 1], s = t - 1/2
    mean = int f dt,   moment = 12 int s f dt

The work along the path is rise * mean + bend * moment / 12. The tangents are the derivatives by rise and bend,
complete: where the path turns, what follows hangs on the drift at which it did.

A law that is linear branch by branch is integrated exactly: pieces end where a branch does, or where the path turns. An
elastic curved law is integrated by Gauss points, as many as it asks for; a curved law with a memory likewise, along the
way to the turning point and back from there.
"""

from __future__ import annotations

import math

import numpy as np

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.laws.choosing import CURVES, DISSIPATING, case_of_4, case_of_5, chosen
from tdint.kernels.laws.walking import copy_further
from tdint.kernels.stories.branches import advance, switch
from tdint.kernels.stories.springs import adopt, reach, restoring, settle

# Rows from `out` on
MEAN = 0
MOMENT = 1
MEAN_BY_RISE = 2
MEAN_BY_BEND = 3
MOMENT_BY_RISE = 4
MOMENT_BY_BEND = 5
_RESULTS = 6
_BACK = 6  # the same of the way back from a turning point
_SHIFTED = 12  # and with this point shifted
PATH_ROWS = 18

_MOST_BRANCHES = 16  # on the way to a turning point; a law has fewer
_SHIFT = 1e-6  # of a turning point over the path, to see what hangs on it
_MOST_POINTS = 16  # in one part of the path
_USUAL_POINTS = 16.0


def _gauss() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss and Legendre on [0, 1]; row n holds the rule with n points."""
    nodes = np.zeros((_MOST_POINTS + 1, _MOST_POINTS))
    weights = np.zeros_like(nodes)
    for n in range(1, _MOST_POINTS + 1):
        x, w = np.polynomial.legendre.leggauss(n)
        nodes[n, :n], weights[n, :n] = 0.5 * (x + 1.0), 0.5 * w
    return nodes, weights


NODES, WEIGHTS = _gauss()


@inlined
def _as_usual(laws, springs, i, way):
    return _USUAL_POINTS


_points = chosen("points", case_of_4, _as_usual)


@inlined
def _smooth(laws, springs, i, block, side):
    return math.inf


_kink = chosen("kink", case_of_5, _smooth)


@inlined
def stays(springs, i, rise, bend):
    """Whether story `i` keeps to its present linear branch all along the path."""
    if not springs[at.SLOPE, i] < math.inf:
        return False
    start = springs[at.DRIFT, i]
    turn = springs[at.TURN, i]
    first = rise - 0.5 * bend
    last = rise + 0.5 * bend
    if turn * first < 0.0 or turn * last < 0.0:
        return False
    # The parabola lies within its Bezier points.
    middle = start + 0.5 * first
    end = start + rise
    highest = max(start, middle, end)
    lowest = min(start, middle, end)
    if highest <= springs[at.UPPER, i] and lowest >= springs[at.LOWER, i]:
        return True
    if first * last < 0.0:
        t = 0.5 - rise / bend
        middle = start + rise * t + 0.5 * bend * (t * t - t)
    else:
        middle = start
    return max(start, middle, end) <= springs[at.UPPER, i] and min(start, middle, end) >= springs[at.LOWER, i]


@inlined
def keep_to_branch(springs, i, rise, bend, work, out):
    """The results of a story that keeps to its present linear branch."""
    slope = springs[at.SLOPE, i]
    work[out + MEAN, i] = springs[at.FORCE, i] + slope * (0.5 * rise - bend / 12.0)
    work[out + MOMENT, i] = slope * rise
    work[out + MEAN_BY_RISE, i] = 0.5 * slope
    work[out + MEAN_BY_BEND, i] = -slope / 12.0
    work[out + MOMENT_BY_RISE, i] = slope
    work[out + MOMENT_BY_BEND, i] = 0.0


@called
def follow(laws, springs, i, rise, bend, work, out):
    """The results of any story into the rows from `out` on; its state on the way is left to `arrive`."""
    _clear(work, out, i)
    if not CURVES or springs[at.SLOPE, i] < math.inf:
        _over_branches(laws, springs, i, rise, bend, work, out)
    elif laws[at.CODE, i] in DISSIPATING:
        _with_memory(laws, springs, i, rise, bend, work, out)
    else:
        _elastic(laws, springs, i, rise, bend, work, out)


@called
def arrive(laws, springs, i, rise):
    """Commit the end of the path that `follow` followed last."""
    if not CURVES or springs[at.SLOPE, i] < math.inf:
        _copy(springs, i, at.FIRST_TRIAL, 0)
        return
    past = at.FIRST_TRIAL if laws[at.CODE, i] in DISSIPATING else 0
    reach(laws, springs, i, past, at.SECOND_TRIAL, springs[at.DRIFT, i] + rise)
    settle(laws, springs, i, past, at.SECOND_TRIAL)
    adopt(laws, springs, i, at.SECOND_TRIAL)


@inlined
def _at(start, rise, bend, t):
    return start + t * (rise + 0.5 * bend * (t - 1.0))


@inlined
def _clear(work, out, i):
    for row in range(_RESULTS):
        work[out + row, i] = 0.0


@inlined
def _copy(springs, i, source, target):
    for row in range(at.SPRING_ROWS):
        springs[target + row, i] = springs[source + row, i]
    copy_further(springs, i, source, target)


@inlined
def _turning_point(rise, bend):
    """Where in (0, 1) the path turns; 1 if it does not."""
    if 2.0 * abs(rise) >= abs(bend):
        return 1.0
    t = 0.5 - rise / bend
    return t if 0.0 < t < 1.0 else 1.0


@inlined
def _add(work, out, i, weight, t, force, tangent):
    """Add a point of the path to the integrals."""
    by_bend = 0.5 * (t * t - t)
    moment = 12.0 * weight * (t - 0.5)
    work[out + MEAN, i] += weight * force
    work[out + MOMENT, i] += moment * force
    work[out + MEAN_BY_RISE, i] += weight * tangent * t
    work[out + MEAN_BY_BEND, i] += weight * tangent * by_bend
    work[out + MOMENT_BY_RISE, i] += moment * tangent * t
    work[out + MOMENT_BY_BEND, i] += moment * tangent * by_bend


@inlined
def _join(work, out, i, turn, shift):
    """Add the way back from a turning point. What hangs on that point is seen from the same way after a shift of it
    (no shift: nothing does)."""
    for row in range(_RESULTS):
        work[out + row, i] += work[out + _BACK + row, i]
    if shift != 0.0:
        mean = (work[out + _SHIFTED + MEAN, i] - work[out + _BACK + MEAN, i]) / shift
        moment = (work[out + _SHIFTED + MOMENT, i] - work[out + _BACK + MOMENT, i]) / shift
        by_bend = 0.5 * (turn * turn - turn)
        work[out + MEAN_BY_RISE, i] += mean * turn
        work[out + MEAN_BY_BEND, i] += mean * by_bend
        work[out + MOMENT_BY_RISE, i] += moment * turn
        work[out + MOMENT_BY_BEND, i] += moment * by_bend


# ---- Linear branch by branch


@called
def _over_branches(laws, springs, i, rise, bend, work, out):
    """Two-point Gauss on each piece: force times s is a cubic there."""
    start = springs[at.DRIFT, i]
    _copy(springs, i, 0, at.FIRST_TRIAL)
    turn = _turning_point(rise, bend)
    _go(laws, springs, i, at.FIRST_TRIAL, start, rise, bend, 0.0, turn, work, out)
    if turn == 1.0:
        return
    back = math.copysign(1.0, bend)
    shift = 0.0
    if springs[at.FIRST_TRIAL + at.TURN, i] * back < 0.0:  # else nothing happens at the turning point
        _copy(springs, i, at.FIRST_TRIAL, at.SECOND_TRIAL)
        shift = -back * _SHIFT * (abs(rise) + abs(bend))
        advance(laws, springs, i, at.SECOND_TRIAL, _at(start, rise, bend, turn) + shift)
        _clear(work, out + _SHIFTED, i)
        _go(laws, springs, i, at.SECOND_TRIAL, start, rise, bend, turn, 1.0, work, out + _SHIFTED)
    _clear(work, out + _BACK, i)
    _go(laws, springs, i, at.FIRST_TRIAL, start, rise, bend, turn, 1.0, work, out + _BACK)
    _join(work, out, i, turn, shift)


@called
def _go(laws, springs, i, block, start, rise, bend, begin, end, work, out):
    """From `begin` to `end` of the path, between which it does not turn, with the state in `block`."""
    target = _at(start, rise, bend, end)
    way = target - _at(start, rise, bend, begin)
    if way == 0.0:
        _piece(springs, i, block, start, rise, bend, begin, end, work, out)
        return
    side = math.copysign(1.0, way)
    if springs[block + at.TURN, i] * side < 0.0:
        switch(laws, springs, i, block, at.TURNED)
    here = begin
    for passed in range(_MOST_BRANCHES):
        limit = springs[block + at.UPPER, i] if side > 0.0 else springs[block + at.LOWER, i]
        ends = side * (target - limit) > 0.0 and passed < _MOST_BRANCHES - 1
        there = end
        if ends:
            there = min(here + _time_to(limit, start, rise, bend, here, side), end)
        _piece(springs, i, block, start, rise, bend, here, there, work, out)
        advance(laws, springs, i, block, limit if ends else target)
        if not ends:
            break
        switch(laws, springs, i, block, at.ABOVE if side > 0.0 else at.BELOW)
        here = there


@inlined
def _time_to(limit, start, rise, bend, here, side):
    """How long the path, moving to `side`, takes from `here` to the drift `limit`."""
    rate = side * (rise + bend * (here - 0.5))
    left = side * (limit - _at(start, rise, bend, here))
    if not left > 0.0:
        return 0.0
    root = math.sqrt(max(rate * rate + 2.0 * side * bend * left, 0.0))
    return 2.0 * left / (max(rate, 0.0) + root) if max(rate, 0.0) + root > 0.0 else 1.0


@inlined
def _piece(springs, i, block, start, rise, bend, begin, end, work, out):
    length = end - begin
    slope = springs[block + at.SLOPE, i]
    for point in range(2):
        t = begin + length * NODES[2, point]
        force = springs[block + at.FORCE, i] + slope * (_at(start, rise, bend, t) - springs[block + at.DRIFT, i])
        _add(work, out, i, 0.5 * length, t, force, slope)


# ---- Curved


@called
def _elastic(laws, springs, i, rise, bend, work, out):
    wanted = _points(laws, springs, i, abs(rise) + 0.5 * abs(bend))
    _integrate(laws, springs, i, 0, True, wanted, rise, bend, 0.0, 1.0, work, out)


@called
def _with_memory(laws, springs, i, rise, bend, work, out):
    """To the turning point, and from there to the last Gauss point: the state there is left in FIRST_TRIAL."""
    start = springs[at.DRIFT, i]
    turn = _turning_point(rise, bend)
    past = _pass(laws, springs, i, 0, start, rise, bend, 0.0, turn, work, out)
    if turn < 1.0:
        drift = _at(start, rise, bend, turn)
        reach(laws, springs, i, past, at.THIRD_TRIAL, drift)
        settle(laws, springs, i, past, at.THIRD_TRIAL)
        shift = -math.copysign(_SHIFT, bend) * (abs(rise) + abs(bend))
        reach(laws, springs, i, at.THIRD_TRIAL, at.FIRST_TRIAL, drift + shift)
        _clear(work, out + _SHIFTED, i)
        _pass(laws, springs, i, at.FIRST_TRIAL, start, rise, bend, turn, 1.0, work, out + _SHIFTED)
        _clear(work, out + _BACK, i)
        past = _pass(laws, springs, i, at.THIRD_TRIAL, start, rise, bend, turn, 1.0, work, out + _BACK)
        _join(work, out, i, turn, shift)
    if past != at.FIRST_TRIAL:
        _copy(springs, i, past, at.FIRST_TRIAL)


@called
def _pass(laws, springs, i, past, start, rise, bend, begin, end, work, out):
    """From `begin` to `end` of the path, between which it does not turn, from the state in `past`.

    In two parts where the force bends sharply between."""
    here = _at(start, rise, bend, begin)
    way = _at(start, rise, bend, end) - here
    side = math.copysign(1.0, way)
    way = abs(way)
    ahead = _kink(laws, springs, i, past, side)
    if ahead < way:
        wanted = _points(laws, springs, i, ahead)
        there = min(begin + _time_to(here + side * ahead, start, rise, bend, begin, side), end)
        past = _integrate(laws, springs, i, past, False, wanted, rise, bend, begin, there, work, out)
        begin = there
        way -= ahead
    return _integrate(laws, springs, i, past, False, _points(laws, springs, i, way), rise, bend, begin, end, work, out)


@called
def _integrate(laws, springs, i, past, elastic, wanted, rise, bend, begin, end, work, out):
    """Add the part of the path from `begin` to `end`, by at least `wanted` Gauss points; returns the block of the state
    at the last of them.

    An elastic law needs no state to start from; others go from point to point, from that in `past`.
    """
    start = springs[at.DRIFT, i]
    parts = math.ceil(wanted / _MOST_POINTS)
    points = math.ceil(wanted / parts)
    length = (end - begin) / parts
    mean = moment = 0.0
    mean_by_rise = mean_by_bend = moment_by_rise = moment_by_bend = 0.0
    trial = at.FIRST_TRIAL
    for part in range(parts):
        for point in range(points):
            t = begin + length * (part + NODES[points, point])
            if not elastic:
                trial = at.FIRST_TRIAL if past != at.FIRST_TRIAL else at.SECOND_TRIAL
            tangent = restoring(laws, springs, i, past, trial, _at(start, rise, bend, t))
            if not elastic:
                settle(laws, springs, i, past, trial)
                past = trial
            weight = length * WEIGHTS[points, point]
            by_moment = 12.0 * (t - 0.5)
            force = weight * springs[trial + at.FORCE, i]
            by_rise = weight * tangent * t
            by_bend = 0.5 * by_rise * (t - 1.0)
            mean += force
            moment += by_moment * force
            mean_by_rise += by_rise
            mean_by_bend += by_bend
            moment_by_rise += by_moment * by_rise
            moment_by_bend += by_moment * by_bend
    work[out + MEAN, i] += mean
    work[out + MOMENT, i] += moment
    work[out + MEAN_BY_RISE, i] += mean_by_rise
    work[out + MEAN_BY_BEND, i] += mean_by_bend
    work[out + MOMENT_BY_RISE, i] += moment_by_rise
    work[out + MOMENT_BY_BEND, i] += moment_by_bend
    return trial
