"""Integrals of the force of a drift law along a parabola of drift.

The path and the integrals are

    d(t) = d0 + rise t + bend (t^2 - t) / 2,   t in [0, 1], s = t - 1/2
    mean = int f dt,   moment = 12 int s f dt

The work along the path is rise * mean + bend * moment / 12. The tangents are the complete
derivatives with respect to rise and bend: after a reversal of the path, the force also depends on
the drift at the reversal.

The integrals of a piecewise-linear law are exact. The path is divided at each change of branch and
at the reversal. A curved elastic law is integrated with the number of Gauss points that the law
requests. A curved law with a memory is integrated in the same way, first to the reversal and then
from the reversal to the end.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.laws.branch_following import copy_extra_rows
from tdint.kernels.laws.selection import (
    DISSIPATING_LAWS,
    HAS_CURVED_LAW,
    case_with_4_arguments,
    case_with_5_arguments,
    select_function,
)
from tdint.kernels.stepping import Integrals, PathSegment
from tdint.kernels.stories.branches import advance, switch
from tdint.kernels.stories.law_state import (
    accumulate_dissipation,
    commit_without_dissipation,
    restoring_force,
    restoring_force_outlined,
)

# Rows of the results, relative to `out`: mean and moment (N) and their derivatives with respect to
# rise and bend (N/m).
MEAN = 0
MOMENT = 1
MEAN_BY_RISE = 2
MEAN_BY_BEND = 3
MOMENT_BY_RISE = 4
MOMENT_BY_BEND = 5
_RESULTS = 6
_BACK = 6  # the same results for the path after a reversal
_SHIFTED = 12  # the same results for the path after a reversal at a shifted drift
PATH_ROWS = 18

_MAX_BRANCHES = 16  # maximum number of branches up to a reversal; every law has fewer
# Fraction of the step. Tolerance of the time of a reversal; rounding errors are about 1e-15.
_ROOT = 1e-12
_MAX_ROOT_ITERATIONS = 60  # bisection alone would need 40 iterations
# Relative to the rate that a story reaches within the step. A smaller rate in the opposite
# direction is not a reversal. If the building is at rest, the initial acceleration is the rounding
# error of the floor loads, about 1e-16 of them, and the drifts of upper stories are 1e-6 of the
# displacements of the floors.
_RATE_ROUNDING = 1e-9
_OPPOSITE_RATE = (
    # Rate opposite to the direction of the path, relative to the rate that it reaches. Larger
    # values are not rounding errors of a path that starts at a reversal.
    1e-12
)
# Shift of the drift at a reversal relative to the path, for the derivative with respect to this
# drift.
_SHIFT = 1e-6
MAX_POINTS = 16  # maximum number of Gauss points in one part of the path
# number of Gauss points for laws that do not specify a number; one complete part
_DEFAULT_POINTS = 16.0
# Maximum number of Gauss points on a path. In a diverging iteration, laws would request millions.
_MAX_POINTS = 32e3


def _gauss() -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights of the Gauss-Legendre rules on [0, 1]; row n contains the rule with
    n points.

    The rules are read from a table, so that all machines use equal numbers and no LAPACK call is
    needed at import. The table contains the result of NumPy's `leggauss` on [-1, 1]; each line
    contains the nodes and the weights of one rule.
    """
    nodes = np.zeros((MAX_POINTS + 1, MAX_POINTS))
    weights = np.zeros_like(nodes)
    lines = Path(__file__).with_name("gauss_legendre.txt").read_text(encoding="ascii").splitlines()
    for n, line in enumerate(lines, 1):
        numbers = np.array(list(map(float, line.split())))
        nodes[n, :n], weights[n, :n] = 0.5 * (numbers[:n] + 1.0), 0.5 * numbers[n:]
    return nodes, weights


NODES, WEIGHTS = _gauss()


@inline
def _default_points(law_parameters, law_state, i, drift_change):
    """Return the default number of Gauss points.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    drift_change : float
        Change of drift along the path, m.
    """
    return _DEFAULT_POINTS


_points = select_function("points", case_with_4_arguments, _default_points)


@inline
def required_points(law_parameters, law_state, i, drift_change):
    """Return the number of Gauss points on a path with a drift change of `drift_change` (m).

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    drift_change : float
        Change of drift along the path, m.
    """
    return min(_points(law_parameters, law_state, i, drift_change), _MAX_POINTS)


@inline
def _smooth(law_parameters, law_state, i, block, side):
    """Return infinity, for laws without a sharp bend.

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
    return math.inf


_kink = select_function("kink", case_with_5_arguments, _smooth)


@inline
def remains_on_branch(law_state, i, rise, bend):
    """Return True if story `i` remains on its current linear branch along the complete path.

    Parameters
    ----------
    law_state : ndarray
        States of the laws.
    i : int
        Index of the story.
    rise, bend : float
        Coefficient of the parabola of drift, m.
    """
    if not law_state[rows.SLOPE, i] < math.inf:
        return False
    start = law_state[rows.DRIFT, i]
    turn = law_state[rows.RATE_SIGN, i]
    first = rise - 0.5 * bend
    last = rise + 0.5 * bend
    if turn * first < 0.0 or turn * last < 0.0:
        return False
    # The parabola is between the minimum and the maximum of its Bezier points.
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
def locate_reversals(rise, first, last, start):
    """Locate the reversals of a story within a step from its drift rate.

    The rate is the cubic with the rates `first` and `last` of the state at both endpoints, the mean
    `rise` and the initial slope `start`. The rate of the parabola is not used because it differs
    from the rate of the state at both endpoints.

    Parameters
    ----------
    rise : float
        Change of drift in the step, m.
    first, last : float
        Drift rates at both endpoints times the step, m.
    start : float
        Rate of change of the drift rate at the start times the squared step, m.

    Returns
    -------
    side : float
        Direction of the initial movement, 1 or -1.
    first, second, third : float
        Fractions of the step in (0, 1) at which the rate changes its sign; 1 for no further
        reversal.
    nearest : float
        Minimum absolute rate at an extremum within the step, m; infinite if there is no extremum.
    """
    rounded = _RATE_ROUNDING * (abs(rise) + abs(last))
    if abs(first) <= rounded and abs(start) <= rounded and rise * last > 0.0:
        # The story starts at rest, and not by its acceleration. This applies to an upper story with
        # a rate that increases faster than a cubic can represent.
        return math.copysign(1.0, rise), 1.0, 1.0, 1.0, math.inf
    change = last - first - start
    excess = rise - first - 0.5 * start
    c2 = 12.0 * excess - 3.0 * change
    c3 = 4.0 * change - 12.0 * excess
    # Between its extrema, where start + 2 c2 t + 3 c3 t^2 = 0, the rate is monotonic.
    first_extremum = last_extremum = 1.0
    discriminant = c2 * c2 - 3.0 * c3 * start
    if discriminant > 0.0:
        q = -(c2 + math.copysign(math.sqrt(discriminant), c2))
        first_extremum = max(q / (3.0 * c3), 0.0) if abs(q) < abs(3.0 * c3) else 1.0
        last_extremum = max(start / q, 0.0) if abs(start) < abs(q) else 1.0
        first_extremum, last_extremum = (
            min(first_extremum, last_extremum),
            max(first_extremum, last_extremum),
        )
    side = first if abs(first) > rounded else start if abs(start) > rounded else rise
    first_turn = second_turn = third_turn = 1.0
    nearest = math.inf
    lower, previous_rate = 0.0, side
    for add_part in range(3):
        upper = first_extremum if add_part == 0 else last_extremum if add_part == 1 else 1.0
        rate = first + upper * (start + upper * (c2 + upper * c3))
        if add_part < 2 and 0.0 < upper < 1.0:
            nearest = min(nearest, abs(rate))
        if previous_rate * rate < 0.0 and abs(rate) > rounded:
            root = _find_zero((first, start, c2, c3), lower, upper, rate)
            first_turn, second_turn, third_turn = (
                (root, 1.0, 1.0)
                if first_turn == 1.0
                else (first_turn, root, 1.0)
                if second_turn == 1.0
                else (first_turn, second_turn, root)
            )
        lower = upper
        previous_rate = rate if abs(rate) > rounded else previous_rate
    return math.copysign(1.0, side), first_turn, second_turn, third_turn, nearest


@inline
def has_certain_reversal(rise, first, last):
    """Return True if a rate at an endpoint of the step is opposite to the change of drift.

    The tolerance is the rounding error. `locate_reversals` then returns a reversal for any
    acceleration.
    """
    rounded = _RATE_ROUNDING * (abs(rise) + abs(last))
    return (rise * first < 0.0 and abs(first) > rounded) or (
        rise * last < 0.0 and abs(last) > rounded
    )


@inline
def _find_zero(cubic, lower, upper, at_right):
    """Return the zero of a cubic that is monotonic between `lower` and `upper`, by safeguarded
    Newton's method.

    Parameters
    ----------
    cubic : tuple of float
        Coefficients of 1, t, t^2 and t^3.
    lower, upper : float
        Interval of the zero.
    at_right : float
        Value with the sign of the cubic at `upper`.
    """
    c0, c1, c2, c3 = cubic
    t = 0.5 * (lower + upper)
    for _ in range(_MAX_ROOT_ITERATIONS):
        value = c0 + t * (c1 + t * (c2 + t * c3))
        if value * at_right < 0.0:
            lower = t
        else:
            upper = t
        slope = c1 + t * (2.0 * c2 + 3.0 * t * c3)
        new = t - value / slope if slope != 0.0 else lower
        new = new if lower < new < upper else 0.5 * (lower + upper)
        if abs(new - t) < _ROOT:
            return new
        t = new
    return t


@inline
def integrate_on_branch(law_state, i, rise, bend, scratch, out):
    """Compute the results of a story that remains on its current linear branch.

    Parameters
    ----------
    law_state : ndarray
        States of the laws.
    i : int
        Index of the story.
    rise, bend : float
        Coefficients of the parabola, m.
    scratch : ndarray
        Scratch array of the step.
    out : int
        First row of the results.
    """
    slope = law_state[rows.SLOPE, i]
    scratch[out + MEAN, i] = law_state[rows.FORCE, i] + slope * (0.5 * rise - bend / 12.0)
    scratch[out + MOMENT, i] = slope * rise
    scratch[out + MEAN_BY_RISE, i] = 0.5 * slope
    scratch[out + MEAN_BY_BEND, i] = -slope / 12.0
    scratch[out + MOMENT_BY_RISE, i] = slope
    scratch[out + MOMENT_BY_BEND, i] = 0.0


@outlined
def follow(law_parameters, law_state, i, rise, bend, steady, scratch, out):
    """Compute the results of a story along its path.

    `commit_path_end` commits the state at the end of the path.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    rise, bend : float
        Coefficients of the parabola, m.
    steady : bool
        True if the story has no reversal in the step, even if the parabola has one. The force on
        each branch is nevertheless the force at the drift of the parabola. The work along the
        parabola is then the work from its start to its end.
    scratch : ndarray
        Scratch array of the step.
    out : int
        First row of the results.
    """
    complete = PathSegment(law_state[rows.DRIFT, i], rise, bend, 0.0, 1.0)
    results = Integrals(scratch, out)
    _clear(results, i)
    if not HAS_CURVED_LAW or law_state[rows.SLOPE, i] < math.inf:
        _over_branches(
            law_parameters,
            law_state,
            i,
            complete,
            1.0 if steady else time_of_extremum(complete),
            results,
        )
    elif law_parameters[rows.CODE, i] in DISSIPATING_LAWS:
        _with_memory(law_parameters, law_state, i, complete, results)
    else:
        count = required_points(law_parameters, law_state, i, abs(rise) + 0.5 * abs(bend))
        _integrate(law_parameters, law_state, i, 0, True, count, complete, results)


@outlined
def commit_path_end(law_parameters, law_state, i, rise):
    """Commit the state at the end of the path of the last call of `follow`.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    rise : float
        Change of drift along the path, m.
    """
    if not HAS_CURVED_LAW or law_state[rows.SLOPE, i] < math.inf:
        copy(law_state, i, rows.FIRST_TRIAL, 0)
        return
    previous = rows.FIRST_TRIAL if law_parameters[rows.CODE, i] in DISSIPATING_LAWS else 0
    restoring_force_outlined(
        law_parameters, law_state, i, previous, rows.SECOND_TRIAL, law_state[rows.DRIFT, i] + rise
    )
    accumulate_dissipation(law_parameters, law_state, i, previous, rows.SECOND_TRIAL)
    commit_without_dissipation(law_parameters, law_state, i, rows.SECOND_TRIAL)


@inline
def drift_at(segment, t):
    """Return the drift at time t of the parabola, m."""
    return segment.start + t * (segment.rise + 0.5 * segment.bend * (t - 1.0))


@inline
def path_segment(segment, begin, end):
    """Return another part of the same parabola."""
    return PathSegment(segment.start, segment.rise, segment.bend, begin, end)


@inline
def _clear(results, i):
    """Set the results of story `i` to zero."""
    for row in range(_RESULTS):
        results.table[results.first + row, i] = 0.0


@inline
def copy(law_state, i, source, target):
    """Copy the state of story `i` from block `source` to block `target`.

    Parameters
    ----------
    law_state : ndarray
        States of the laws.
    i : int
        Index of the story.
    source : int
        First row of the source.
    target : int
        First row of the target.
    """
    for row in range(rows.LAW_STATE_ROWS):
        law_state[target + row, i] = law_state[source + row, i]
    copy_extra_rows(law_state, i, source, target)


@inline
def time_of_extremum(segment):
    """Return the time in (0, 1) at which the parabola has its extremum; 1 if there is none."""
    if 2.0 * abs(segment.rise) >= abs(segment.bend):
        return 1.0
    t = 0.5 - segment.rise / segment.bend
    return t if 0.0 < t < 1.0 else 1.0


@inline
def _add(results, i, weight, t, force, tangent):
    """Add a point of the path to the integrals and their tangents.

    Parameters
    ----------
    results : Integrals
        Rows of the results.
    i : int
        Index of the story.
    weight : float
        Integration weight.
    t : float
        Time of the point.
    force, tangent : float
        Force, N, and tangent stiffness, N/m, at the point.
    """
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
    """Add the results of the path after a reversal.

    The derivative with respect to the drift at the reversal is the difference between the results
    with and without a shift of this drift.

    Parameters
    ----------
    results : Integrals
        Rows of the results.
    i : int
        Index of the story.
    turn : float
        Time of the reversal.
    shift : float
        Shift of the drift, m; 0 if the results do not depend on the drift at the reversal.
    """
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


# ---- Piecewise-linear laws


@inline
def time_to(limit, segment, t_now, side):
    """Return the time that the path needs from time `t_now` to the drift `limit`.

    Parameters
    ----------
    limit : float
        Drift, m.
    segment : PathSegment
        Path.
    t_now : float
        Time on the path.
    side : float
        Direction of the movement, 1 or -1.
    """
    rate = side * (segment.rise + segment.bend * (t_now - 0.5))
    lower = side * (limit - drift_at(segment, t_now))
    if not lower > 0.0:
        return 0.0
    root = math.sqrt(max(rate * rate + 2.0 * side * segment.bend * lower, 0.0))
    if -rate > _OPPOSITE_RATE * root and side * segment.bend > 0.0:
        return (root - rate) / (side * segment.bend)
    return 2.0 * lower / (max(rate, 0.0) + root) if max(rate, 0.0) + root > 0.0 else 1.0


def along_branches(add_part, note_end):
    """Return a function that integrates along a part of a path without reversal, branch by branch.

    Parameters
    ----------
    add_part : function
        (law_state, i, block, stretch, results). Adds a part on one branch to the results.
    note_end : function
        (results, i, t, force). Is called at the end of each branch, with its time and force (N).

    Returns
    -------
    function
        (law_parameters, law_state, i, block, stretch, side, target, results). The state in `block`
        moves in the direction `side` (0 for no movement) to the drift `target`, m.
    """

    @outlined
    def go(law_parameters, law_state, i, block, segment, side, target, results):
        if side == 0.0:
            add_part(law_state, i, block, segment, results)
            return
        if law_state[block + rows.RATE_SIGN, i] * side < 0.0:
            switch(law_parameters, law_state, i, block, rows.REVERSED)
        t_now = segment.begin
        for branch_count in range(_MAX_BRANCHES):
            limit = (
                law_state[block + rows.UPPER, i] if side > 0.0 else law_state[block + rows.LOWER, i]
            )
            leaves_branch = side * (target - limit) > 0.0 and branch_count < _MAX_BRANCHES - 1
            t_end = segment.end
            if leaves_branch:
                t_end = min(t_now + time_to(limit, segment, t_now, side), segment.end)
            add_part(law_state, i, block, path_segment(segment, t_now, t_end), results)
            advance(law_parameters, law_state, i, block, limit if leaves_branch else target)
            if not leaves_branch:
                break
            note_end(results, i, t_end, law_state[block + rows.FORCE, i])
            switch(law_parameters, law_state, i, block, rows.ABOVE if side > 0.0 else rows.BELOW)
            t_now = t_end

    return go


@inline
def _piece(law_state, i, block, segment, results):
    """Add a part on one linear branch to the results, by two Gauss points.

    The rule is exact because the force times s is a cubic in t.

    Parameters
    ----------
    law_state : ndarray
        States of the laws.
    i : int
        Index of the story.
    block : int
        First row of the state.
    segment : PathSegment
        Part of the path.
    results : Integrals
        Rows of the results.
    """
    length = segment.end - segment.begin
    slope = law_state[block + rows.SLOPE, i]
    for point in range(2):
        t = segment.begin + length * NODES[2, point]
        force = law_state[block + rows.FORCE, i] + slope * (
            drift_at(segment, t) - law_state[block + rows.DRIFT, i]
        )
        _add(results, i, 0.5 * length, t, force, slope)


@inline
def _ignore_end(results, i, t, force):
    """Ignore the end of a branch.

    Parameters
    ----------
    results : Integrals
        Rows of the results.
    i : int
        Index of the story.
    t : float
        Time of the end of the branch.
    force : float
        Force, N.
    """
    pass


_go = along_branches(_piece, _ignore_end)


@inline
def _follow(law_parameters, law_state, i, block, segment, results):
    """Integrate along a part of a path without reversal.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    block : int
        First row of the state.
    segment : PathSegment
        Part of the path.
    results : Integrals
        Rows of the results.
    """
    target = drift_at(segment, segment.end)
    drift_change = target - drift_at(segment, segment.begin)
    side = math.copysign(1.0, drift_change) if drift_change != 0.0 else 0.0
    _go(law_parameters, law_state, i, block, segment, side, target, results)


@outlined
def _over_branches(law_parameters, law_state, i, complete, turn, results):
    """Compute the results of a piecewise-linear law.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    complete : PathSegment
        Complete path.
    turn : float
        Time of the reversal; 1 for no reversal.
    results : Integrals
        Rows of the results.
    """
    copy(law_state, i, 0, rows.FIRST_TRIAL)
    _follow(
        law_parameters, law_state, i, rows.FIRST_TRIAL, path_segment(complete, 0.0, turn), results
    )
    if turn == 1.0:
        return
    back = Integrals(results.table, results.first + _BACK)
    shifted = Integrals(results.table, results.first + _SHIFTED)
    path_back = path_segment(complete, turn, 1.0)
    side = math.copysign(1.0, complete.bend)
    shift = 0.0
    if (
        law_state[rows.FIRST_TRIAL + rows.RATE_SIGN, i] * side < 0.0
    ):  # otherwise the branch does not change at the reversal
        copy(law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
        shift = -side * _SHIFT * (abs(complete.rise) + abs(complete.bend))
        advance(law_parameters, law_state, i, rows.SECOND_TRIAL, drift_at(complete, turn) + shift)
        _clear(shifted, i)
        _follow(law_parameters, law_state, i, rows.SECOND_TRIAL, path_back, shifted)
    _clear(back, i)
    _follow(law_parameters, law_state, i, rows.FIRST_TRIAL, path_back, back)
    _join(results, i, turn, shift)


# ---- Curved laws


def in_two_parts(integrate):
    """Return a function that integrates a curved law along a part of a path without reversal.

    The path is divided at a sharp bend of the force.

    Parameters
    ----------
    integrate : function
        Integrates along one part, see `_integrate`.

    Returns
    -------
    function
        (law_parameters, law_state, i, previous, stretch, results) -> block of the state at the last
        Gauss point. The path starts from the state in block `previous`.
    """

    @outlined
    def go(law_parameters, law_state, i, previous, segment, results):
        t_now = drift_at(segment, segment.begin)
        drift_change = drift_at(segment, segment.end) - t_now
        side = math.copysign(1.0, drift_change)
        drift_change = abs(drift_change)
        begin = segment.begin
        ahead = _kink(law_parameters, law_state, i, previous, side)
        if ahead < drift_change:
            count = required_points(law_parameters, law_state, i, ahead)
            t_end = min(begin + time_to(t_now + side * ahead, segment, begin, side), segment.end)
            previous = integrate(
                law_parameters,
                law_state,
                i,
                previous,
                False,
                count,
                path_segment(segment, begin, t_end),
                results,
            )
            begin = t_end
            drift_change -= ahead
        count = required_points(law_parameters, law_state, i, drift_change)
        return integrate(
            law_parameters,
            law_state,
            i,
            previous,
            False,
            count,
            path_segment(segment, begin, segment.end),
            results,
        )

    return go


@outlined
def _integrate(law_parameters, law_state, i, previous, elastic, count, segment, results):
    """Add a part of a path to the results, by at least `count` Gauss points.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    previous : int
        Block of the state at the start. An elastic law does not use it.
    elastic : bool
        True for an elastic law. Other laws advance from each Gauss point to the next.
    count : float
        Minimum number of Gauss points.
    segment : PathSegment
        Part of the path.
    results : Integrals
        Rows of the results.

    Returns
    -------
    int
        Block of the state at the last Gauss point.
    """
    scratch, out = results
    parts = math.ceil(count / MAX_POINTS)
    points = math.ceil(count / parts)
    length = (segment.end - segment.begin) / parts
    mean = moment = 0.0
    mean_by_rise = mean_by_bend = moment_by_rise = moment_by_bend = 0.0
    trial = rows.FIRST_TRIAL
    for part in range(parts):
        for point in range(points):
            t = segment.begin + length * (part + NODES[points, point])
            if not elastic:
                trial = rows.FIRST_TRIAL if previous != rows.FIRST_TRIAL else rows.SECOND_TRIAL
            tangent = restoring_force(
                law_parameters, law_state, i, previous, trial, drift_at(segment, t)
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
def _with_memory(law_parameters, law_state, i, complete, results):
    """Compute the results of a curved law with a memory.

    The path is integrated to the reversal and from there to the end. FIRST_TRIAL then contains the
    state at the last Gauss point.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    complete : PathSegment
        Complete path.
    results : Integrals
        Rows of the results.
    """
    turn = time_of_extremum(complete)
    previous = _pass(law_parameters, law_state, i, 0, path_segment(complete, 0.0, turn), results)
    if turn < 1.0:
        back = Integrals(results.table, results.first + _BACK)
        shifted = Integrals(results.table, results.first + _SHIFTED)
        path_back = path_segment(complete, turn, 1.0)
        drift = drift_at(complete, turn)
        restoring_force_outlined(law_parameters, law_state, i, previous, rows.THIRD_TRIAL, drift)
        accumulate_dissipation(law_parameters, law_state, i, previous, rows.THIRD_TRIAL)
        shift = -math.copysign(_SHIFT, complete.bend) * (abs(complete.rise) + abs(complete.bend))
        restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.FIRST_TRIAL, drift + shift
        )
        _clear(shifted, i)
        _pass(law_parameters, law_state, i, rows.FIRST_TRIAL, path_back, shifted)
        _clear(back, i)
        previous = _pass(law_parameters, law_state, i, rows.THIRD_TRIAL, path_back, back)
        _join(results, i, turn, shift)
    if previous != rows.FIRST_TRIAL:
        copy(law_state, i, previous, rows.FIRST_TRIAL)
