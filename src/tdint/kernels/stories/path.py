"""Drift laws along a parabola of drift: mean and first moment of the force, with their tangents.

    d(t) = d0 + rise t + bend (t^2 - t) / 2,   t in [0, 1], s = t - 1/2
    mean = int f dt,   moment = 12 int s f dt

The work along the path is rise * mean + bend * moment / 12. The tangents are the derivatives by
rise and bend, complete: where the path turns, what follows hangs on the drift at which it did.

A law that is linear branch by branch is integrated exactly: pieces end where a branch does, or
where the path turns. An elastic curved law is integrated by Gauss points, as many as it asks for; a
curved law with a memory likewise, along the way to the turning point and back from there.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.laws.branch_following import copy_extra_rows
from tdint.kernels.laws.choosing import CURVES, DISSIPATING, case_of_4, case_of_5, chosen
from tdint.kernels.stepping import Integrals, Stretch
from tdint.kernels.stories.branches import advance, switch
from tdint.kernels.stories.law_state import (
    accumulate_dissipation,
    commit_without_dissipation,
    restoring_force,
    restoring_force_outlined,
)

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
_ROOT = 1e-12  # of a step, by which a turn may be missed: rounding is some 1e-15 of it
_MOST_ROOT_STEPS = 60  # halving alone would need 40
# Of the rate to which a story comes in a step: what goes back by less has not turned. At rest the
# start's acceleration is what the floors' loads round, some 1e-16 of them, and drifts of upper
# stories are 1e-6 of what the floors move.
_ROUNDED = 1e-9
_GOES_BACK = (
    1e-12  # rate against the way over what it grows to: not rounding any more where a path turns
)
_SHIFT = 1e-6  # of a turning point over the path, to see what hangs on it
MOST_POINTS = 16  # in one part of the path
_USUAL_POINTS = 16.0  # of laws that say nothing: as many as a part has
_ENOUGH = 32e3  # points on any path: where an iteration runs away, laws would ask for millions


def _gauss() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss and Legendre on [0, 1]; row n holds the rule with n points.

    Of a table, so that they are the same numbers on all machines, and at once: on [-1, 1] by
    NumPy's `leggauss`, which asks LAPACK; a line holds the nodes of a rule and its weights.
    """
    nodes = np.zeros((MOST_POINTS + 1, MOST_POINTS))
    weights = np.zeros_like(nodes)
    lines = Path(__file__).with_name("gauss_legendre.txt").read_text(encoding="ascii").splitlines()
    for n, line in enumerate(lines, 1):
        numbers = np.array(list(map(float, line.split())))
        nodes[n, :n], weights[n, :n] = 0.5 * (numbers[:n] + 1.0), 0.5 * numbers[n:]
    return nodes, weights


NODES, WEIGHTS = _gauss()


@inline
def _as_usual(law_parameters, law_state, i, way):
    return _USUAL_POINTS


_points = chosen("points", case_of_4, _as_usual)


@inline
def points_wanted(law_parameters, law_state, i, way):
    """Gauss points on a path of drift that is `way` long."""
    return min(_points(law_parameters, law_state, i, way), _ENOUGH)


@inline
def _smooth(law_parameters, law_state, i, block, side):
    return math.inf


_kink = chosen("kink", case_of_5, _smooth)


@inline
def stays(law_state, i, rise, bend):
    """Whether story `i` keeps to its present linear branch all along the path."""
    if not law_state[rows.SLOPE, i] < math.inf:
        return False
    start = law_state[rows.DRIFT, i]
    turn = law_state[rows.RATE_SIGN, i]
    first = rise - 0.5 * bend
    last = rise + 0.5 * bend
    if turn * first < 0.0 or turn * last < 0.0:
        return False
    # The parabola lies within its Bezier points.
    middle = start + 0.5 * first
    end = start + rise
    highest = max(start, middle, end)
    lowest = min(start, middle, end)
    if highest <= law_state[rows.UPPER, i] and lowest >= law_state[rows.LOWER, i]:
        return True
    if first * last < 0.0:
        t = 0.5 - rise / bend
        middle = start + rise * t + 0.5 * bend * (t * t - t)
    else:
        middle = start
    return (
        max(start, middle, end) <= law_state[rows.UPPER, i]
        and min(start, middle, end) >= law_state[rows.LOWER, i]
    )


@outlined
def turns(rise, first, last, start):
    """Where a story turns within a step, as its rate tells: the cubic between `first` and `last`,
    those of the state, that has the rise for its mean and grows by `start` where it begins (all
    times the step). The one decision of a run and of what carries its error: the parabola's own
    rate misses the state's at both ends.

    Returns
    -------
    side, first turn, second turn, third turn, nearest : float
        The direction in which the story sets out; where in (0, 1) the rate changes its sign, 1 for
        no more; how near it comes to zero where it has an extreme.
    """
    rounded = _ROUNDED * (abs(rise) + abs(last))
    if abs(first) <= rounded and abs(start) <= rounded and rise * last > 0.0:
        # From rest, and not by its acceleration: of an upper story, whose rate grows faster than
        # any cubic tells.
        return math.copysign(1.0, rise), 1.0, 1.0, 1.0, math.inf
    change = last - first - start
    more = rise - first - 0.5 * start
    c2 = 12.0 * more - 3.0 * change
    c3 = 4.0 * change - 12.0 * more
    # Between its extremes, where start + 2 c2 t + 3 c3 t^2 = 0, the rate is monotone.
    early = late = 1.0
    discriminant = c2 * c2 - 3.0 * c3 * start
    if discriminant > 0.0:
        q = -(c2 + math.copysign(math.sqrt(discriminant), c2))
        early = max(q / (3.0 * c3), 0.0) if abs(q) < abs(3.0 * c3) else 1.0
        late = max(start / q, 0.0) if abs(start) < abs(q) else 1.0
        early, late = min(early, late), max(early, late)
    side = first if abs(first) > rounded else start if abs(start) > rounded else rise
    one = two = three = 1.0
    nearest = math.inf
    left, before = 0.0, side
    for piece in range(3):
        right = early if piece == 0 else late if piece == 1 else 1.0
        rate = first + right * (start + right * (c2 + right * c3))
        if piece < 2 and 0.0 < right < 1.0:
            nearest = min(nearest, abs(rate))
        if before * rate < 0.0 and abs(rate) > rounded:
            root = _where_zero((first, start, c2, c3), left, right, rate)
            one, two, three = (
                (root, 1.0, 1.0)
                if one == 1.0
                else (one, root, 1.0)
                if two == 1.0
                else (one, two, root)
            )
        left = right
        before = rate if abs(rate) > rounded else before
    return math.copysign(1.0, side), one, two, three, nearest


@inline
def turns_surely(rise, first, last):
    """Whether a rate at an end of the step goes against the rise, by more than rounds: `turns` then
    tells a turn, whatever the acceleration."""
    rounded = _ROUNDED * (abs(rise) + abs(last))
    return (rise * first < 0.0 and abs(first) > rounded) or (
        rise * last < 0.0 and abs(last) > rounded
    )


@inline
def _where_zero(cubic, left, right, at_right):
    """The zero of a cubic that is monotone between two places, by safeguarded Newton."""
    c0, c1, c2, c3 = cubic
    t = 0.5 * (left + right)
    for _ in range(_MOST_ROOT_STEPS):
        value = c0 + t * (c1 + t * (c2 + t * c3))
        if value * at_right < 0.0:
            left = t
        else:
            right = t
        slope = c1 + t * (2.0 * c2 + 3.0 * t * c3)
        new = t - value / slope if slope != 0.0 else left
        new = new if left < new < right else 0.5 * (left + right)
        if abs(new - t) < _ROOT:
            return new
        t = new
    return t


@inline
def keep_to_branch(law_state, i, rise, bend, scratch, out):
    """The results of a story that keeps to its present linear branch."""
    slope = law_state[rows.SLOPE, i]
    scratch[out + MEAN, i] = law_state[rows.FORCE, i] + slope * (0.5 * rise - bend / 12.0)
    scratch[out + MOMENT, i] = slope * rise
    scratch[out + MEAN_BY_RISE, i] = 0.5 * slope
    scratch[out + MEAN_BY_BEND, i] = -slope / 12.0
    scratch[out + MOMENT_BY_RISE, i] = slope
    scratch[out + MOMENT_BY_BEND, i] = 0.0


@outlined
def follow(law_parameters, law_state, i, rise, bend, steady, scratch, out):
    """The results of any story into the rows from `out` on; its state on the way is left to
    `arrive`. `steady`: the story does not turn, even if the parabola does; the force on each branch
    is that at the parabola's drift even so, and the work along the parabola what that from its
    start to its end is."""
    whole = Stretch(law_state[rows.DRIFT, i], rise, bend, 0.0, 1.0)
    results = Integrals(scratch, out)
    _clear(results, i)
    if not CURVES or law_state[rows.SLOPE, i] < math.inf:
        _over_branches(
            law_parameters, law_state, i, whole, 1.0 if steady else turning_point(whole), results
        )
    elif law_parameters[rows.CODE, i] in DISSIPATING:
        _with_memory(law_parameters, law_state, i, whole, results)
    else:
        count = points_wanted(law_parameters, law_state, i, abs(rise) + 0.5 * abs(bend))
        _integrate(law_parameters, law_state, i, 0, True, count, whole, results)


@outlined
def arrive(law_parameters, law_state, i, rise):
    """Commit the end of the path that `follow` followed last."""
    if not CURVES or law_state[rows.SLOPE, i] < math.inf:
        copy(law_state, i, rows.FIRST_TRIAL, 0)
        return
    previous = rows.FIRST_TRIAL if law_parameters[rows.CODE, i] in DISSIPATING else 0
    restoring_force_outlined(
        law_parameters, law_state, i, previous, rows.SECOND_TRIAL, law_state[rows.DRIFT, i] + rise
    )
    accumulate_dissipation(law_parameters, law_state, i, previous, rows.SECOND_TRIAL)
    commit_without_dissipation(law_parameters, law_state, i, rows.SECOND_TRIAL)


@inline
def drift_at(stretch, t):
    """The drift at t."""
    return stretch.start + t * (stretch.rise + 0.5 * stretch.bend * (t - 1.0))


@inline
def part_of(stretch, begin, end):
    """Another part of the same parabola."""
    return Stretch(stretch.start, stretch.rise, stretch.bend, begin, end)


@inline
def _clear(results, i):
    for row in range(_RESULTS):
        results.table[results.first + row, i] = 0.0


@inline
def copy(law_state, i, source, target):
    for row in range(rows.LAW_STATE_ROWS):
        law_state[target + row, i] = law_state[source + row, i]
    copy_extra_rows(law_state, i, source, target)


@inline
def turning_point(stretch):
    """Where in (0, 1) the path turns; 1 if it does not."""
    if 2.0 * abs(stretch.rise) >= abs(stretch.bend):
        return 1.0
    t = 0.5 - stretch.rise / stretch.bend
    return t if 0.0 < t < 1.0 else 1.0


@inline
def _add(results, i, weight, t, force, tangent):
    """Add a point of the path to the integrals."""
    scratch, out = results
    by_bend = 0.5 * (t * t - t)
    moment = 12.0 * weight * (t - 0.5)
    scratch[out + MEAN, i] += weight * force
    scratch[out + MOMENT, i] += moment * force
    scratch[out + MEAN_BY_RISE, i] += weight * tangent * t
    scratch[out + MEAN_BY_BEND, i] += weight * tangent * by_bend
    scratch[out + MOMENT_BY_RISE, i] += moment * tangent * t
    scratch[out + MOMENT_BY_BEND, i] += moment * tangent * by_bend


@inline
def _join(results, i, turn, shift):
    """Add the way back from a turning point. What hangs on that point is seen from the same way
    after a shift of it (no shift: nothing does)."""
    scratch, out = results
    for row in range(_RESULTS):
        scratch[out + row, i] += scratch[out + _BACK + row, i]
    if shift != 0.0:
        mean = (scratch[out + _SHIFTED + MEAN, i] - scratch[out + _BACK + MEAN, i]) / shift
        moment = (scratch[out + _SHIFTED + MOMENT, i] - scratch[out + _BACK + MOMENT, i]) / shift
        by_bend = 0.5 * (turn * turn - turn)
        scratch[out + MEAN_BY_RISE, i] += mean * turn
        scratch[out + MEAN_BY_BEND, i] += mean * by_bend
        scratch[out + MOMENT_BY_RISE, i] += moment * turn
        scratch[out + MOMENT_BY_BEND, i] += moment * by_bend


# ---- Linear branch by branch


@inline
def time_to(limit, stretch, here, side):
    """How long the path, moving to `side`, takes from `here` to the drift `limit`."""
    rate = side * (stretch.rise + stretch.bend * (here - 0.5))
    left = side * (limit - drift_at(stretch, here))
    if not left > 0.0:
        return 0.0
    root = math.sqrt(max(rate * rate + 2.0 * side * stretch.bend * left, 0.0))
    if -rate > _GOES_BACK * root and side * stretch.bend > 0.0:
        return (root - rate) / (side * stretch.bend)
    return 2.0 * left / (max(rate, 0.0) + root) if max(rate, 0.0) + root > 0.0 else 1.0


def along_branches(piece, note):
    """A function (law_parameters, law_state, i, block, stretch, side, target, results) that goes
    along a stretch in which the story goes to `side` all the time (0: it does not move), up to the
    drift `target`, branch by branch, with the state in `block`. `piece` adds to the results what
    lies on one branch, `note` is told where and with what force it ended."""

    @outlined
    def go(law_parameters, law_state, i, block, stretch, side, target, results):
        if side == 0.0:
            piece(law_state, i, block, stretch, results)
            return
        if law_state[block + rows.RATE_SIGN, i] * side < 0.0:
            switch(law_parameters, law_state, i, block, rows.REVERSED)
        here = stretch.begin
        for passed in range(_MOST_BRANCHES):
            limit = (
                law_state[block + rows.UPPER, i] if side > 0.0 else law_state[block + rows.LOWER, i]
            )
            ends = side * (target - limit) > 0.0 and passed < _MOST_BRANCHES - 1
            there = stretch.end
            if ends:
                there = min(here + time_to(limit, stretch, here, side), stretch.end)
            piece(law_state, i, block, part_of(stretch, here, there), results)
            advance(law_parameters, law_state, i, block, limit if ends else target)
            if not ends:
                break
            note(results, i, there, law_state[block + rows.FORCE, i])
            switch(law_parameters, law_state, i, block, rows.ABOVE if side > 0.0 else rows.BELOW)
            here = there

    return go


@inline
def _piece(law_state, i, block, stretch, results):
    length = stretch.end - stretch.begin
    slope = law_state[block + rows.SLOPE, i]
    for point in range(2):
        t = stretch.begin + length * NODES[2, point]
        force = law_state[block + rows.FORCE, i] + slope * (
            drift_at(stretch, t) - law_state[block + rows.DRIFT, i]
        )
        _add(results, i, 0.5 * length, t, force, slope)


@inline
def _nothing(results, i, t, force):
    pass


_go = along_branches(_piece, _nothing)


@inline
def _follow(law_parameters, law_state, i, block, stretch, results):
    """Along a stretch from its start straight to its end."""
    target = drift_at(stretch, stretch.end)
    way = target - drift_at(stretch, stretch.begin)
    side = math.copysign(1.0, way) if way != 0.0 else 0.0
    _go(law_parameters, law_state, i, block, stretch, side, target, results)


@outlined
def _over_branches(law_parameters, law_state, i, whole, turn, results):
    """Two-point Gauss on each piece: force times s is a cubic there."""
    copy(law_state, i, 0, rows.FIRST_TRIAL)
    _follow(law_parameters, law_state, i, rows.FIRST_TRIAL, part_of(whole, 0.0, turn), results)
    if turn == 1.0:
        return
    back = Integrals(results.table, results.first + _BACK)
    shifted = Integrals(results.table, results.first + _SHIFTED)
    way_back = part_of(whole, turn, 1.0)
    side = math.copysign(1.0, whole.bend)
    shift = 0.0
    if (
        law_state[rows.FIRST_TRIAL + rows.RATE_SIGN, i] * side < 0.0
    ):  # else nothing happens at the turning point
        copy(law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
        shift = -side * _SHIFT * (abs(whole.rise) + abs(whole.bend))
        advance(law_parameters, law_state, i, rows.SECOND_TRIAL, drift_at(whole, turn) + shift)
        _clear(shifted, i)
        _follow(law_parameters, law_state, i, rows.SECOND_TRIAL, way_back, shifted)
    _clear(back, i)
    _follow(law_parameters, law_state, i, rows.FIRST_TRIAL, way_back, back)
    _join(results, i, turn, shift)


# ---- Curved


def in_two_parts(integrate):
    """A function (law_parameters, law_state, i, past, stretch, results) that goes along a stretch
    in
    which the path does not turn by `integrate`, from the state in `previous`; in two parts where
    the
    force bends sharply between. It returns the block of the state at its last Gauss point."""

    @outlined
    def go(law_parameters, law_state, i, previous, stretch, results):
        here = drift_at(stretch, stretch.begin)
        way = drift_at(stretch, stretch.end) - here
        side = math.copysign(1.0, way)
        way = abs(way)
        begin = stretch.begin
        ahead = _kink(law_parameters, law_state, i, previous, side)
        if ahead < way:
            count = points_wanted(law_parameters, law_state, i, ahead)
            there = min(begin + time_to(here + side * ahead, stretch, begin, side), stretch.end)
            previous = integrate(
                law_parameters,
                law_state,
                i,
                previous,
                False,
                count,
                part_of(stretch, begin, there),
                results,
            )
            begin = there
            way -= ahead
        count = points_wanted(law_parameters, law_state, i, way)
        return integrate(
            law_parameters,
            law_state,
            i,
            previous,
            False,
            count,
            part_of(stretch, begin, stretch.end),
            results,
        )

    return go


@outlined
def _integrate(law_parameters, law_state, i, previous, elastic, count, stretch, results):
    """Add a stretch, by at least `count` Gauss points; returns the block of the state at the last
    of them.

    An elastic law needs no state to start from; others go from point to point, from that in
    `previous`.
    """
    scratch, out = results
    parts = math.ceil(count / MOST_POINTS)
    points = math.ceil(count / parts)
    length = (stretch.end - stretch.begin) / parts
    mean = moment = 0.0
    mean_by_rise = mean_by_bend = moment_by_rise = moment_by_bend = 0.0
    trial = rows.FIRST_TRIAL
    for part in range(parts):
        for point in range(points):
            t = stretch.begin + length * (part + NODES[points, point])
            if not elastic:
                trial = rows.FIRST_TRIAL if previous != rows.FIRST_TRIAL else rows.SECOND_TRIAL
            tangent = restoring_force(
                law_parameters, law_state, i, previous, trial, drift_at(stretch, t)
            )
            if not elastic:
                accumulate_dissipation(law_parameters, law_state, i, previous, trial)
                previous = trial
            weight = length * WEIGHTS[points, point]
            by_moment = 12.0 * (t - 0.5)
            force = weight * law_state[trial + rows.FORCE, i]
            by_rise = weight * tangent * t
            by_bend = 0.5 * by_rise * (t - 1.0)
            mean += force
            moment += by_moment * force
            mean_by_rise += by_rise
            mean_by_bend += by_bend
            moment_by_rise += by_moment * by_rise
            moment_by_bend += by_moment * by_bend
    scratch[out + MEAN, i] += mean
    scratch[out + MOMENT, i] += moment
    scratch[out + MEAN_BY_RISE, i] += mean_by_rise
    scratch[out + MEAN_BY_BEND, i] += mean_by_bend
    scratch[out + MOMENT_BY_RISE, i] += moment_by_rise
    scratch[out + MOMENT_BY_BEND, i] += moment_by_bend
    return trial


_pass = in_two_parts(_integrate)


@outlined
def _with_memory(law_parameters, law_state, i, whole, results):
    """To the turning point, and from there to the last Gauss point: the state there is left in
    FIRST_TRIAL."""
    turn = turning_point(whole)
    previous = _pass(law_parameters, law_state, i, 0, part_of(whole, 0.0, turn), results)
    if turn < 1.0:
        back = Integrals(results.table, results.first + _BACK)
        shifted = Integrals(results.table, results.first + _SHIFTED)
        way_back = part_of(whole, turn, 1.0)
        drift = drift_at(whole, turn)
        restoring_force_outlined(law_parameters, law_state, i, previous, rows.THIRD_TRIAL, drift)
        accumulate_dissipation(law_parameters, law_state, i, previous, rows.THIRD_TRIAL)
        shift = -math.copysign(_SHIFT, whole.bend) * (abs(whole.rise) + abs(whole.bend))
        restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.FIRST_TRIAL, drift + shift
        )
        _clear(shifted, i)
        _pass(law_parameters, law_state, i, rows.FIRST_TRIAL, way_back, shifted)
        _clear(back, i)
        previous = _pass(law_parameters, law_state, i, rows.THIRD_TRIAL, way_back, back)
        _join(results, i, turn, shift)
    if previous != rows.FIRST_TRIAL:
        copy(law_state, i, previous, rows.FIRST_TRIAL)
