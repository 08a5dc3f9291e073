"""Drift laws along a parabola of drift as the error of a step asks for them (`tdint.kernels.equations.moment4_error`).

Beside mean and first moment of the force, its second and third moment beyond these, and what mean and moment gain by
motions that start and end where they are ("bubbles"), s = t - 1/2:

    even   w0 b0(s),  b0 = 30 (s^2 - 1/4)^2      of mean w0
    odd    w1 b1(s),  b1 = -10 s (s^2 - 1/4)     of moment 12 mean(s w) = w1

linearized on the pieces of the path; the turning point moves with them.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.chain import power_damper
from tdint.kernels.compiling import called, inlined
from tdint.kernels.laws.choosing import CURVES, DISSIPATING
from tdint.kernels.laws.walking import copy_further
from tdint.kernels.stories.branches import advance, switch
from tdint.kernels.stories.path import NODES, WEIGHTS, _at, _kink, _points, _time_to, _turning_point
from tdint.kernels.stories.springs import reach, restoring, settle

# Rows from `out` on
MEAN = 0
MOMENT = 1
SECOND = 2  # 180 mean((s^2 - 1/12) f)
THIRD = 3  # mean(s (s^2 - 3/20) f)
MEAN_BY_EVEN = 4
MEAN_BY_ODD = 5
MOMENT_BY_EVEN = 6
MOMENT_BY_ODD = 7
EVENT = 8  # when the story last reached the end of a branch, in (0, 1), 0 if it has not; and its force then
ERROR_PATH_ROWS = 10

_MOST_BRANCHES = 16
_MOST_POINTS = 16
_PIECE_POINTS = 3  # force times s^3 is of degree 5 on a piece
_STEADY_POINTS = 6


@inlined
def even(s):
    """The bubble b0."""
    e = s * s - 0.25
    return 30.0 * e * e


@inlined
def odd(s):
    """The bubble b1."""
    return -10.0 * s * (s * s - 0.25)


@called
def walk(laws, springs, i, rise, bend, by_even, by_odd, work, out):
    """The results of any story into the rows from `out` on; its state on the way is left to `path.arrive`.

    At a turning point inside the story turns where the bubbles `by_even` b0 + `by_odd` b1 have led it.
    """
    for row in range(ERROR_PATH_ROWS):
        work[out + row, i] = 0.0
    turn = _turning_point(rise, bend)
    moved = 0.0
    if turn < 1.0:
        moved = by_even * even(turn - 0.5) + by_odd * odd(turn - 0.5)
    if not CURVES or springs[at.SLOPE, i] < math.inf:
        _over_branches(laws, springs, i, rise, bend, turn, moved, work, out)
    elif laws[at.CODE, i] in DISSIPATING:
        _with_memory(laws, springs, i, rise, bend, turn, moved, work, out)
    else:
        wanted = _points(laws, springs, i, abs(rise) + 0.5 * abs(bend))
        _integrate(laws, springs, i, 0, True, wanted, rise, bend, 0.0, 1.0, work, out)


@inlined
def _add(work, out, i, weight, s, force, tangent):
    by_even = weight * tangent * even(s)
    by_odd = weight * tangent * odd(s)
    weighted = weight * force
    work[out + MEAN, i] += weighted
    work[out + MOMENT, i] += 12.0 * s * weighted
    work[out + SECOND, i] += (180.0 * s * s - 15.0) * weighted
    work[out + THIRD, i] += s * (s * s - 0.15) * weighted
    work[out + MEAN_BY_EVEN, i] += by_even
    work[out + MEAN_BY_ODD, i] += by_odd
    work[out + MOMENT_BY_EVEN, i] += 12.0 * s * by_even
    work[out + MOMENT_BY_ODD, i] += 12.0 * s * by_odd


@called
def _over_branches(laws, springs, i, rise, bend, turn, moved, work, out):
    start = springs[at.DRIFT, i]
    for row in range(at.SPRING_ROWS):
        springs[at.FIRST_TRIAL + row, i] = springs[row, i]
    copy_further(springs, i, 0, at.FIRST_TRIAL)
    _go(laws, springs, i, start, rise, bend, 0.0, turn, work, out)
    if turn == 1.0:
        return
    if springs[at.FIRST_TRIAL + at.TURN, i] * bend < 0.0:
        advance(laws, springs, i, at.FIRST_TRIAL, _at(start, rise, bend, turn) + moved)
    _go(laws, springs, i, start, rise, bend, turn, 1.0, work, out)


@called
def _go(laws, springs, i, start, rise, bend, begin, end, work, out):
    target = _at(start, rise, bend, end)
    way = target - _at(start, rise, bend, begin)
    if way == 0.0:
        _piece(springs, i, start, rise, bend, begin, end, work, out)
        return
    side = math.copysign(1.0, way)
    if springs[at.FIRST_TRIAL + at.TURN, i] * side < 0.0:
        switch(laws, springs, i, at.FIRST_TRIAL, at.TURNED)
    here = begin
    for passed in range(_MOST_BRANCHES):
        limit = springs[at.FIRST_TRIAL + at.UPPER, i] if side > 0.0 else springs[at.FIRST_TRIAL + at.LOWER, i]
        ends = side * (target - limit) > 0.0 and passed < _MOST_BRANCHES - 1
        there = end
        if ends:
            there = min(here + _time_to(limit, start, rise, bend, here, side), end)
        _piece(springs, i, start, rise, bend, here, there, work, out)
        advance(laws, springs, i, at.FIRST_TRIAL, limit if ends else target)
        if not ends:
            break
        if there < 1.0:
            work[out + EVENT, i] = there
            work[out + EVENT + 1, i] = springs[at.FIRST_TRIAL + at.FORCE, i]
        switch(laws, springs, i, at.FIRST_TRIAL, at.ABOVE if side > 0.0 else at.BELOW)
        here = there


@inlined
def _piece(springs, i, start, rise, bend, begin, end, work, out):
    length = end - begin
    slope = springs[at.FIRST_TRIAL + at.SLOPE, i]
    for point in range(_PIECE_POINTS):
        t = begin + length * NODES[_PIECE_POINTS, point]
        force = springs[at.FIRST_TRIAL + at.FORCE, i]
        force += slope * (_at(start, rise, bend, t) - springs[at.FIRST_TRIAL + at.DRIFT, i])
        _add(work, out, i, length * WEIGHTS[_PIECE_POINTS, point], t - 0.5, force, slope)


@called
def _with_memory(laws, springs, i, rise, bend, turn, moved, work, out):
    """To the turning point, and from there to the last Gauss point: the state there is left in FIRST_TRIAL."""
    start = springs[at.DRIFT, i]
    past = _pass(laws, springs, i, 0, start, rise, bend, 0.0, turn, work, out)
    if turn < 1.0:
        reach(laws, springs, i, past, at.THIRD_TRIAL, _at(start, rise, bend, turn) + moved)
        settle(laws, springs, i, past, at.THIRD_TRIAL)
        past = _pass(laws, springs, i, at.THIRD_TRIAL, start, rise, bend, turn, 1.0, work, out)
    if past != at.FIRST_TRIAL:
        for row in range(at.SPRING_ROWS):
            springs[at.FIRST_TRIAL + row, i] = springs[past + row, i]
        copy_further(springs, i, past, at.FIRST_TRIAL)


@called
def _pass(laws, springs, i, past, start, rise, bend, begin, end, work, out):
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
    start = springs[at.DRIFT, i]
    parts = math.ceil(wanted / _MOST_POINTS)
    points = max(math.ceil(wanted / parts), _PIECE_POINTS)
    length = (end - begin) / parts
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
            _add(work, out, i, length * WEIGHTS[points, point], t - 0.5, springs[trial + at.FORCE, i], tangent)
    return trial


@called
def add_dashpot(chain, i, h, rise, bend, cubic, work, column, out):
    """Add a power-law dashpot along the same path; its rate follows `cubic` (3 s^2 - 1/4) / 6 beside the parabola's."""
    rest = 2.0
    if abs(rise) < 0.5 * abs(bend):
        rest = -rise / bend
    if abs(rest) < 0.5:
        _part(chain, i, h, rise, bend, cubic, rest, -0.5, work, column, out)
        _part(chain, i, h, rise, bend, cubic, rest, 0.5, work, column, out)
    elif abs(rise - 0.5 * bend) < abs(rise + 0.5 * bend):
        _part(chain, i, h, rise, bend, cubic, -0.5, 0.5, work, column, out)
    else:
        _part(chain, i, h, rise, bend, cubic, 0.5, -0.5, work, column, out)


@called
def _part(chain, i, h, rise, bend, cubic, slow, fast, work, column, out):
    """As in `dashpot_path`."""
    least = abs(rise + bend * slow)
    largest = abs(rise + bend * fast)
    length = abs(fast - slow)
    steady = least >= 0.5 * largest
    points = _STEADY_POINTS if steady else 12
    root = (least / largest) ** (1.0 / 3.0) if least > 0.0 else 0.0
    whole = 1.0 - root * root * root
    for point in range(points):
        x = NODES[points, point]
        weight = length * WEIGHTS[points, point]
        if not steady:
            x = root + (1.0 - root) * x
            weight *= 3.0 * x * x / whole * (1.0 - root)
            x = (x * x * x - root * root * root) / whole
        s = slow + (fast - slow) * x
        force, slope = power_damper(chain, i, (rise + bend * s) / h)
        slope /= h
        e = s * s - 0.25
        by_even = weight * slope * 120.0 * s * e
        by_odd = -weight * slope * (30.0 * s * s - 2.5)
        force *= weight
        work[out + MEAN, column] += force
        work[out + MOMENT, column] += 12.0 * s * force
        beyond = force - by_odd * cubic / 60.0
        work[out + SECOND, column] += (180.0 * s * s - 15.0) * beyond
        work[out + THIRD, column] += s * (s * s - 0.15) * beyond
        work[out + MEAN_BY_EVEN, column] += by_even
        work[out + MEAN_BY_ODD, column] += by_odd
        work[out + MOMENT_BY_EVEN, column] += 12.0 * s * by_even
        work[out + MOMENT_BY_ODD, column] += 12.0 * s * by_odd
