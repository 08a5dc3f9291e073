"""Drift laws along a parabola of drift as the error of a step asks for them (`tdint.kernels.equations.carried.error`).

Beside mean and first moment of the force, its second and third moment beyond these, and what mean and moment gain by
motions that start and end where they are ("bubbles"), s = t - 1/2:

    even   w0 b0(s),  b0 = 30 (s^2 - 1/4)^2      of mean w0
    odd    w1 b1(s),  b1 = -10 s (s^2 - 1/4)     of moment 12 mean(s w) = w1

linearized on the pieces of the path; the point where it turns is moved by them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.laws.choosing import CURVES, DISSIPATING
from tdint.kernels.linear_terms import power_damper
from tdint.kernels.stepping import Integrals
from tdint.kernels.stories import path
from tdint.kernels.stories.dashpot_path import POINTS, STEADY, STEADY_POINTS, cut_at_rest
from tdint.kernels.stories.law_state import reach, restoring, settle


class _Results(NamedTuple):
    """Rows from the first one on."""

    MEAN: int = 1
    MOMENT: int = 1
    SECOND: int = 1  # 180 mean((s^2 - 1/12) f)
    THIRD: int = 1  # mean(s (s^2 - 3/20) f)
    MEAN_BY_EVEN: int = 1
    MEAN_BY_ODD: int = 1
    MOMENT_BY_EVEN: int = 1
    MOMENT_BY_ODD: int = 1
    EVENT: int = 1  # when the story first reached the end of a branch, in (0, 1); 0 if it has not
    LAST_EVENT: int = 1  # the same of the last time
    LARGEST: int = 1  # force at an event or a turning point


RESULT, ERROR_PATH_ROWS = at.chained(_Results)

_PIECE_POINTS = 3  # force times s^3 is of degree 5 on a piece


@inlined
def even(s):
    """The bubble b0."""
    e = s * s - 0.25
    return 30.0 * e * e


@inlined
def odd(s):
    """The bubble b1."""
    return -10.0 * s * (s * s - 0.25)


@inlined
def bubble(bubbles, s):
    """What the bubbles, factors of b0 and b1, are together."""
    return bubbles[0] * even(s) + bubbles[1] * odd(s)


@called
def keeps(springs, i, whole, bubbles, turned):
    """Whether story `i` keeps to its present linear branch on a path whose rate turns as `turned` (`path.turns`) says:
    where it does not turn, the end tells."""
    side, first, _, _, _ = turned
    turn = springs[at.TURN, i]
    end = whole.start + whole.rise
    reached = path.drift_at(whole, first) + bubble(bubbles, first - 0.5)
    stays = (turn * side >= 0.0) & ((turn == 0.0) | (first == 1.0)) & (springs[at.SLOPE, i] < math.inf)
    return stays & (max(end, reached) <= springs[at.UPPER, i]) & (min(end, reached) >= springs[at.LOWER, i])


@called
def follow(law_parameters, springs, i, whole, bubbles, turned, results):
    """The results of any story along a whole parabola; its state on the way is left to `path.arrive`.

    A story that is linear branch by branch turns where `turned` (`path.turns`) says, at the drift that the bubbles have
    led it to; a curved one where the parabola does, likewise.
    """
    for row in range(ERROR_PATH_ROWS):
        results.table[results.first + row, i] = 0.0
    if not CURVES or springs[at.SLOPE, i] < math.inf:
        path.copy(springs, i, 0, at.FIRST_TRIAL)
        _over_branches(law_parameters, springs, i, whole, bubbles, turned, results)
    elif law_parameters[at.CODE, i] in DISSIPATING:
        _with_memory(law_parameters, springs, i, whole, bubbles, results)
    else:
        count = path.points_wanted(law_parameters, springs, i, abs(whole.rise) + 0.5 * abs(whole.bend))
        _integrate(law_parameters, springs, i, 0, True, count, whole, results)


@inlined
def _add(results, i, weight, s, force, tangent):
    """Add a point of the path to the integrals."""
    weighted = weight * force
    _sum_up(results, i, s, weighted, weighted, weight * tangent * even(s), weight * tangent * odd(s))


@inlined
def _sum_up(results, i, s, force, beyond, by_even, by_odd):
    """Add the force at a point, `beyond` of which counts for second and third moment, and what it gains by the
    bubbles, all times the point's weight."""
    work, out = results
    work[out + RESULT.MEAN, i] += force
    work[out + RESULT.MOMENT, i] += 12.0 * s * force
    work[out + RESULT.SECOND, i] += (180.0 * s * s - 15.0) * beyond
    work[out + RESULT.THIRD, i] += s * (s * s - 0.15) * beyond
    work[out + RESULT.MEAN_BY_EVEN, i] += by_even
    work[out + RESULT.MEAN_BY_ODD, i] += by_odd
    work[out + RESULT.MOMENT_BY_EVEN, i] += 12.0 * s * by_even
    work[out + RESULT.MOMENT_BY_ODD, i] += 12.0 * s * by_odd


@inlined
def _note(results, i, t, force):
    """Keep an event."""
    work, out = results
    work[out + RESULT.LARGEST, i] = max(work[out + RESULT.LARGEST, i], abs(force))
    if t < 1.0:
        if work[out + RESULT.EVENT, i] == 0.0:
            work[out + RESULT.EVENT, i] = t
        work[out + RESULT.LAST_EVENT, i] = t


@inlined
def _piece(springs, i, block, stretch, results):
    length = stretch.end - stretch.begin
    slope = springs[block + at.SLOPE, i]
    for point in range(_PIECE_POINTS):
        t = stretch.begin + length * path.NODES[_PIECE_POINTS, point]
        force = springs[block + at.FORCE, i]
        force += slope * (path.drift_at(stretch, t) - springs[block + at.DRIFT, i])
        _add(results, i, length * path.WEIGHTS[_PIECE_POINTS, point], t - 0.5, force, slope)


_go = path.along_branches(_piece, _note)


@called
def _over_branches(law_parameters, springs, i, stretch, bubbles, turned, results):
    """From turn to turn; one on the way is that of the motion, also where the parabola goes on."""
    side, first, second, third, _ = turned
    here = stretch.begin
    for turn in (first, second, third):
        if turn <= here and turn < 1.0:
            side = -side  # before this stretch
        elif turn < stretch.end:
            reached = path.drift_at(stretch, turn) + bubble(bubbles, turn - 0.5)
            _go(law_parameters, springs, i, at.FIRST_TRIAL, path.part_of(stretch, here, turn), side, reached, results)
            _note(results, i, 1.0, springs[at.FIRST_TRIAL + at.FORCE, i])
            here = turn
            side = -side
    end = path.drift_at(stretch, stretch.end) + bubble(bubbles, stretch.end - 0.5)
    _go(law_parameters, springs, i, at.FIRST_TRIAL, path.part_of(stretch, here, stretch.end), side, end, results)


@called
def _integrate(law_parameters, springs, i, past, elastic, count, stretch, results):
    """As in `path`."""
    parts = math.ceil(count / path.MOST_POINTS)
    points = max(math.ceil(count / parts), _PIECE_POINTS)
    length = (stretch.end - stretch.begin) / parts
    trial = at.FIRST_TRIAL
    for part in range(parts):
        for point in range(points):
            t = stretch.begin + length * (part + path.NODES[points, point])
            if not elastic:
                trial = at.FIRST_TRIAL if past != at.FIRST_TRIAL else at.SECOND_TRIAL
            tangent = restoring(law_parameters, springs, i, past, trial, path.drift_at(stretch, t))
            if not elastic:
                settle(law_parameters, springs, i, past, trial)
                past = trial
            weight = length * path.WEIGHTS[points, point]
            _add(results, i, weight, t - 0.5, springs[trial + at.FORCE, i], tangent)
    return trial


_pass = path.in_two_parts(_integrate)


@called
def _with_memory(law_parameters, springs, i, whole, bubbles, results):
    """To the turning point, and from there to the last Gauss point: the state there is left in FIRST_TRIAL.

    The bubbles may have the story turn before the last Gauss point: it is led there from the start."""
    turn = path.turning_point(whole)
    moved = bubble(bubbles, turn - 0.5)
    past = _pass(law_parameters, springs, i, 0, path.part_of(whole, 0.0, turn), results)
    if turn < 1.0:
        reach(law_parameters, springs, i, 0, at.THIRD_TRIAL, path.drift_at(whole, turn) + moved)
        settle(law_parameters, springs, i, 0, at.THIRD_TRIAL)
        _note(results, i, 1.0, springs[at.THIRD_TRIAL + at.FORCE, i])
        past = _pass(law_parameters, springs, i, at.THIRD_TRIAL, path.part_of(whole, turn, 1.0), results)
    if past != at.FIRST_TRIAL:
        path.copy(springs, i, past, at.FIRST_TRIAL)


# ---- From node to node


@called
def go_on(law_parameters, springs, i, stretch, bubbles, turned, past, results):
    """Go on along a stretch of the path; returns the force at its end, bubbles included, and the block of the state.
    `past` is the block at its beginning; begin with `set_out`. The results are used up."""
    here, there = stretch.begin, stretch.end
    drift = path.drift_at(stretch, there) + bubble(bubbles, there - 0.5)
    if not CURVES or springs[at.SLOPE, i] < math.inf:
        _over_branches(law_parameters, springs, i, stretch, bubbles, turned, results)
        return springs[at.FIRST_TRIAL + at.FORCE, i], past
    if law_parameters[at.CODE, i] not in DISSIPATING:
        reach(law_parameters, springs, i, 0, at.FIRST_TRIAL, drift)
        return springs[at.FIRST_TRIAL + at.FORCE, i], past
    turn = path.turning_point(stretch)
    if here <= turn < there:
        moved = path.drift_at(stretch, turn) + bubble(bubbles, turn - 0.5)
        reach(law_parameters, springs, i, past, at.THIRD_TRIAL, moved)
        settle(law_parameters, springs, i, past, at.THIRD_TRIAL)
        past = at.THIRD_TRIAL
        here = turn
    past = _pass(law_parameters, springs, i, past, path.part_of(stretch, here, there), results)
    reach(law_parameters, springs, i, past, at.THIRD_TRIAL, drift)
    return springs[at.THIRD_TRIAL + at.FORCE, i], past


@inlined
def set_out(springs, i):
    """Begin to go on from node to node."""
    path.copy(springs, i, 0, at.FIRST_TRIAL)


# ---- Power-law dashpots


class _Dashpot(NamedTuple):
    """The motion of a dashpot, and where its results go, and in which column."""

    rise: float
    bend: float
    cubic: float
    h: float
    results: Integrals
    column: int


@inlined
def _add_rate(linear_terms, i, move, s, weight):
    rise, bend, cubic, h, results, column = move
    force, slope = power_damper(linear_terms, i, (rise + bend * s) / h)
    slope *= weight / h
    force *= weight
    by_even = slope * 120.0 * s * (s * s - 0.25)
    by_odd = slope * (2.5 - 30.0 * s * s)
    _sum_up(results, column, s, force, force - by_odd * cubic / 60.0, by_even, by_odd)


@called
def _part(linear_terms, i, move, slow, fast):
    least = abs(move.rise + move.bend * slow)
    largest = abs(move.rise + move.bend * fast)
    length = abs(fast - slow)
    steady = least >= STEADY * largest
    points = STEADY_POINTS if steady else POINTS
    root = (least / largest) ** (1.0 / 3.0) if least > 0.0 else 0.0
    whole = 1.0 - root * root * root
    for point in range(points):
        x = path.NODES[points, point]
        weight = length * path.WEIGHTS[points, point]
        if not steady:
            x = root + (1.0 - root) * x
            weight *= 3.0 * x * x / whole * (1.0 - root)
            x = (x * x * x - root * root * root) / whole
        _add_rate(linear_terms, i, move, slow + (fast - slow) * x, weight)


_over_parts = cut_at_rest(_part)


@called
def add_dashpot(linear_terms, i, h, whole, cubic, results, column):
    """Add a power-law dashpot along the same path; its rate has `cubic` (3 s^2 - 1/4) / 6 beside that of the
    parabola."""
    _over_parts(linear_terms, i, _Dashpot(whole.rise, whole.bend, cubic, h, results, column))
