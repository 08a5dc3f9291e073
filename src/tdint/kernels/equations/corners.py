"""Peaks within a step of `moment4` in which stories change their branches or reverse.

At these points the derivatives of the forces are discontinuous (corners), and so are those of the
accelerations. A quintic through the endpoints of the step does not represent them. The paths of the
stories (`tdint.kernels.stories.path`) determine the times of the corners and the forces, and
equilibrium determines the accelerations.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.equations.moment4 import MAX_CORNERS, ROW
from tdint.kernels.laws.selection import HAS_CURVED_LAW
from tdint.kernels.linear_terms import FORCES, add_modal_force, force_value, power_damper
from tdint.kernels.peaks_between_steps import raise_peak, raise_peak_at_nodes
from tdint.kernels.stepping import Integrals, PathSegment
from tdint.kernels.stories import path

# Relative to the stiffness of a story times its change of drift: maximum difference between its
# force and the linear least-squares fit in the step (the acceleration is A0 + A1 s), for a force
# that loses all stiffness at the middle of the step.
_CORNER = 0.125
_PASSES = 2  # number of passes; after the second pass the error is below the error of the step
# fraction of the step; corners with a smaller distance from each other or from an endpoint are
# regarded as one corner
_MIN_DISTANCE = 1e-6


@inline
def _story_value(linear_terms, scratch, row, i):
    """Return the value of story `i` from a row with values of floors: the value of its floor minus
    the value of the floor below.

    Parameters
    ----------
    linear_terms : ndarray
        Linear terms of the building (`tdint.kernels.layout`).
    scratch : ndarray
        Scratch array of the step.
    row : int
        Row of the table.
    i : int
        Index of the story.
    """
    return scratch[row, i] - linear_terms[rows.LINK, i] * scratch[row, max(i - 1, 0)]


@inline
def _story_path(linear_terms, law_state, scratch, i):
    """Return the parabola of drift of story `i`.

    Parameters
    ----------
    linear_terms : ndarray
        Linear terms of the building (`tdint.kernels.layout`).
    law_state : ndarray
        States of the laws.
    scratch : ndarray
        Scratch array of the step.
    i : int
        Index of the story.
    """
    rise, bend = (
        _story_value(linear_terms, scratch, ROW.RISE, i),
        _story_value(linear_terms, scratch, ROW.BEND, i),
    )
    return PathSegment(law_state[rows.DRIFT, i], rise, bend, 0.0, 1.0)


# ---- Path of a story


@inline
def _skip_branch(law_state, i, block, segment, results):
    """Do nothing on a branch.

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
    pass


@inline
def _ignore(results, i, t, force):
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


@inline
def _store_corner(results, i, t, force):
    """Store the time of a corner in column 0 of the rows CORNERS, in increasing order, and update
    the peak shear.

    Parameters
    ----------
    results : Integrals
        Rows CORNERS of the scratch array; the first row contains the number of corners.
    i : int
        Index of the story.
    t : float
        Time of the corner, between 0 and 1.
    force : float
        Force of the story, N.
    """
    scratch, first = results
    raise_peak(scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, force)
    count = int(scratch[first, 0])
    if _MIN_DISTANCE < t < 1.0 - _MIN_DISTANCE and count < MAX_CORNERS:
        position = count
        while position > 0 and scratch[first + position, 0] > t:
            scratch[first + position + 1, 0] = scratch[first + position, 0]
            position -= 1
        scratch[first + position + 1, 0] = t
        scratch[first, 0] = count + 1.0


_go_storing_corners = path.along_branches(_skip_branch, _store_corner)
_go = path.along_branches(_skip_branch, _ignore)


@inline
def _direction(segment, steady):
    """Return the direction in which a story moves along a part of its path: 1, -1 or 0.

    Parameters
    ----------
    segment : PathSegment
        Part of the path.
    steady : bool
        True if the story has no reversal in the step; the direction is then that of its complete
        path.
    """
    drift_change = (
        segment.rise
        if steady
        else path.drift_at(segment, segment.end) - path.drift_at(segment, segment.begin)
    )
    return math.copysign(1.0, drift_change) if drift_change != 0.0 else 0.0


@outlined
def _find_corners(law_parameters, law_state, i, complete, steady, corners):
    """Store the corners on the path of story `i`, including its reversal.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the laws.
    i : int
        Index of the story.
    complete : PathSegment
        Complete path.
    steady : bool
        True if the story has no reversal in the step.
    corners : Integrals
        Rows of the corners.
    """
    path.copy(law_state, i, 0, rows.SECOND_TRIAL)
    turn = 1.0 if steady else path.time_of_extremum(complete)
    path_forth, drift = path.path_segment(complete, 0.0, turn), path.drift_at(complete, turn)
    _go_storing_corners(
        law_parameters,
        law_state,
        i,
        rows.SECOND_TRIAL,
        path_forth,
        _direction(path_forth, steady),
        drift,
        corners,
    )
    if turn < 1.0:
        _store_corner(corners, i, turn, law_state[rows.SECOND_TRIAL + rows.FORCE, i])
        path_back, drift = path.path_segment(complete, turn, 1.0), path.drift_at(complete, 1.0)
        _go_storing_corners(
            law_parameters,
            law_state,
            i,
            rows.SECOND_TRIAL,
            path_back,
            _direction(path_back, False),
            drift,
            corners,
        )


@outlined
def _store_nodes(scratch, n):
    """Store the times of the nodes in column n of the rows FORCES and return their number.

    The nodes are the endpoints of the step, the corners, and the midpoints between them.
    """
    scratch[ROW.FORCES, n] = 0.0
    count = 1
    corners = int(scratch[ROW.CORNERS, 0])
    for k in range(corners + 1):
        previous = scratch[ROW.FORCES + count - 1, n]
        t = scratch[ROW.CORNERS + 1 + k, 0] if k < corners else 1.0
        if t - previous > _MIN_DISTANCE:
            scratch[ROW.FORCES + count, n] = 0.5 * (previous + t)
            scratch[ROW.FORCES + count + 1, n] = t
            count += 2
    return count


@outlined
def _store_forces(scene, h, memory, i, count):
    """Compute the force of story `i` at the nodes, including P-delta and without dampers, N.

    Parameters
    ----------
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    memory : Memory
        Law states and scratch array.
    i : int
        Index of the story.
    count : int
        Number of nodes.
    """
    _, law_state, scratch, _ = memory
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    complete = _story_path(linear_terms, law_state, scratch, i)
    geometric = linear_terms[rows.GEOMETRIC, i]
    has_left = scratch[ROW.LEFT, i] != 0.0
    curved = HAS_CURVED_LAW and not law_state[rows.SLOPE, i] < math.inf
    mean = moment = 0.0
    if curved:
        # The force is approximated by a parabola with its mean, its moment and its value at the
        # start.
        mean = scratch[ROW.PATH + path.MEAN, i] - geometric * (
            complete.start + 0.5 * complete.rise - complete.bend / 12.0
        )
        mean -= linear_terms[rows.STORY_DAMPER, i] / h * complete.rise + scratch[ROW.DASHPOT, i]
        moment = scratch[ROW.PATH + path.MOMENT, i] - geometric * complete.rise
        moment -= (
            linear_terms[rows.STORY_DAMPER, i] / h * complete.bend + scratch[ROW.DASHPOT + 1, i]
        )
    elif has_left:
        path.copy(law_state, i, 0, rows.SECOND_TRIAL)
    previous = 0.0
    for k in range(count):
        t = scratch[ROW.FORCES + k, n]
        s = t - 0.5
        drift = complete.start + _story_value(linear_terms, scratch, ROW.WAYS + k, i)
        force = law_state[rows.FORCE, i]
        if curved:
            force = mean + s * moment + (6.0 * s * s - 0.5) * (force - mean + 0.5 * moment)
        elif not has_left:
            force += law_state[rows.SLOPE, i] * (drift - complete.start)
        elif t > 0.0:
            part = path.path_segment(complete, previous, t)
            side, reached = (
                _direction(part, scratch[ROW.STEADY, i] != 0.0),
                path.drift_at(complete, t),
            )
            _go(
                scene.law_parameters,
                law_state,
                i,
                rows.SECOND_TRIAL,
                part,
                side,
                reached,
                Integrals(scratch, ROW.CORNERS),
            )
            distance = drift - law_state[rows.SECOND_TRIAL + rows.DRIFT, i]
            force = (
                law_state[rows.SECOND_TRIAL + rows.FORCE, i]
                + law_state[rows.SECOND_TRIAL + rows.SLOPE, i] * distance
            )
            previous = t
        scratch[ROW.FORCES + k, i] = force + geometric * drift


@outlined
def _store_accelerations(scene, h, load, scratch, k):
    """Compute the absolute accelerations of the floors at node `k` from equilibrium, and replace
    the story forces by total shears.

    Parameters
    ----------
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    load : ndarray
        Load of the step.
    scratch : ndarray
        Scratch array.
    k : int
        Index of the node.
    """
    linear_terms, modal, _, forces, _ = scene
    n = linear_terms.shape[1] - 1
    t = scratch[ROW.FORCES + k, n]
    by_h = 1.0 / h
    for i in range(n):
        scratch[ROW.OTHER, i] = 0.0
    add_modal_force(modal, scratch, ROW.RATES + k, -by_h, scratch, ROW.OTHER, n)
    damped = above = 0.0
    for i in range(n - 1, -1, -1):
        link = linear_terms[rows.LINK, i]
        rate = by_h * _story_value(linear_terms, scratch, ROW.RATES + k, i)
        story = scratch[ROW.FORCES + k, i] + linear_terms[rows.STORY_DAMPER, i] * rate
        story += power_damper(linear_terms, i, rate)[0]
        outer = (
            scratch[ROW.OTHER, i]
            - by_h * linear_terms[rows.FLOOR_DAMPER, i] * scratch[ROW.RATES + k, i]
        )
        damped -= outer
        scratch[ROW.FORCES + k, i] = story + damped
        scratch[ROW.MOTION + k, i] = linear_terms[rows.INVERSE_MASS, i] * (above - story + outer)
        above = link * story
        damped *= link
    if FORCES:
        for j in range(forces.shape[0]):
            i = int(forces[j, rows.FLOOR])
            scratch[ROW.MOTION + k, i] += linear_terms[rows.INVERSE_MASS, i] * force_value(
                forces, j, load[rows.TIME] + t * h
            )


@outlined
def _integrate_accelerations(h, load, memory, i, count):
    """Integrate the accelerations of floor `i` at the nodes to displacements and rates.

    The acceleration is a parabola over each pair of intervals. A linear term is added so that the
    floor has the response of the step at its end.

    Parameters
    ----------
    h : float
        Length of the step, s.
    load : ndarray
        Load of the step.
    memory : Memory
        State and scratch array.
    i : int
        Index of the floor.
    count : int
        Number of nodes.
    """
    state, _, scratch, _ = memory
    n = state.shape[1] - 1
    v = h * state[rows.VELOCITY, i]
    drift_change, rate, a2 = 0.0, v, _relative(h, load, scratch, 0, i, n)
    for k in range(0, count - 2, 2):
        d = scratch[ROW.FORCES + k + 1, n] - scratch[ROW.FORCES + k, n]
        a0, a1, a2 = (
            a2,
            _relative(h, load, scratch, k + 1, i, n),
            _relative(h, load, scratch, k + 2, i, n),
        )
        scratch[ROW.WAYS + k + 1, i] = (
            drift_change + d * rate + d * d * (3.5 * a0 + 3.0 * a1 - 0.5 * a2) / 12.0
        )
        scratch[ROW.RATES + k + 1, i] = rate + d * (5.0 * a0 + 8.0 * a1 - a2) / 12.0
        drift_change += 2.0 * d * rate + d * d * (2.0 * a0 + 4.0 * a1) / 3.0
        rate += d * (a0 + 4.0 * a1 + a2) / 3.0
        scratch[ROW.WAYS + k + 2, i], scratch[ROW.RATES + k + 2, i] = drift_change, rate
    level = v + scratch[ROW.A0, i] - rate
    tilt = 12.0 * (0.5 * level - (scratch[ROW.RISE, i] - drift_change))
    for k in range(1, count):
        t = scratch[ROW.FORCES + k, n]
        scratch[ROW.WAYS + k, i] += t * t * (0.5 * level + tilt * (t / 6.0 - 0.25))
        scratch[ROW.RATES + k, i] += t * (level + 0.5 * tilt * (t - 1.0))


@inline
def _relative(h, load, scratch, k, i, n):
    """Return h^2 times the acceleration of floor `i` at node `k`, relative to the ground, m.

    Parameters
    ----------
    h : float
        Length of the step, s.
    load : ndarray
        Load of the step.
    scratch : ndarray
        Scratch array.
    k, i, n : int
        Node, floor and number of floors.
    """
    t = scratch[ROW.FORCES + k, n]
    return (
        h
        * h
        * (
            scratch[ROW.MOTION + k, i]
            - load[rows.GROUND_0]
            - t * (load[rows.GROUND_1] - load[rows.GROUND_0])
        )
    )


@inline
def _may_exceed_shear_peak(law_state, scratch, i, rise, bend):
    """Return True if the force of a story can exceed its peak at a reversal or at the end of its
    linear branch.

    Parameters
    ----------
    law_state : ndarray
        States of the laws.
    scratch : ndarray
        Scratch array with the peaks.
    i : int
        Index of the story.
    rise, bend : float
        Coefficients of the parabola of drift, m.
    """
    drift_change = abs(rise) + 0.5 * abs(bend)
    max_force = abs(law_state[rows.FORCE, i]) + abs(law_state[rows.SLOPE, i]) * drift_change
    peak = scratch[ROW.PEAKS + rows.PEAK_SHEAR, i]
    may_exceed = (2.0 * abs(rise) < abs(bend)) & (max_force > peak)
    for row in (rows.UPPER, rows.LOWER):
        ahead = law_state[row, i] - law_state[rows.DRIFT, i]
        may_exceed |= (abs(ahead) <= drift_change) & (
            abs(law_state[rows.FORCE, i] + law_state[rows.SLOPE, i] * ahead) > peak
        )
    return may_exceed


@inline
def _may_exceed_peaks(scene, h, load, memory):
    """Return True if the force of a story that has left a linear branch, an acceleration or a total
    shear can exceed its peak.

    With forces on floors the result is True for each step in which a story leaves a linear branch.

    Parameters
    ----------
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    load : ndarray
        Load of the step.
    memory : Memory
        State, law states and scratch array.
    """
    linear_terms, _, law_parameters, forces, _ = scene
    _, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    by_h = 1.0 / (h * h)
    any_leaves = False
    may_exceed = FORCES and forces.shape[0] > 0
    corner_above = moved_0 = moved_1 = 0.0
    for i in range(n - 1, -1, -1):
        corner = 0.0
        if scratch[ROW.LEFT, i] != 0.0 and law_state[rows.SLOPE, i] < math.inf:
            any_leaves = True
            rise, bend = (
                _story_value(linear_terms, scratch, ROW.RISE, i),
                _story_value(linear_terms, scratch, ROW.BEND, i),
            )
            may_exceed |= _may_exceed_shear_peak(law_state, scratch, i, rise, bend)
            corner = _CORNER * law_parameters[rows.STIFFNESS, i] * (abs(rise) + 0.5 * abs(bend))
        half = 0.5 * by_h * scratch[ROW.A1, i]
        a_0 = by_h * scratch[ROW.A0, i] - half + load[rows.GROUND_0]
        a_1 = by_h * scratch[ROW.A0, i] + half + load[rows.GROUND_1]
        more = linear_terms[rows.INVERSE_MASS, i] * (corner + corner_above)
        may_exceed |= (
            max(abs(a_0), abs(a_1)) + more > scratch[ROW.PEAKS + rows.PEAK_ACCELERATION, i]
        )
        moved_0 = linear_terms[rows.LINK, i + 1] * moved_0 + linear_terms[rows.MASS, i] * a_0
        moved_1 = linear_terms[rows.LINK, i + 1] * moved_1 + linear_terms[rows.MASS, i] * a_1
        may_exceed |= (
            max(abs(moved_0), abs(moved_1)) + corner > scratch[ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i]
        )
        corner_above = linear_terms[rows.LINK, i] * corner
    return may_exceed & any_leaves


@inline
def update_peaks_at_corners(scene, h, load, memory):
    """Update the peaks of the step at corners and between them, before the end of the step is
    committed.

    In most steps no story leaves its branch.

    Parameters
    ----------
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    load : ndarray
        Load of the step.
    memory : Memory
        State, law states, scratch array and status of the step.
    """
    if memory.scratch[ROW.LEFT, scene.linear_terms.shape[1] - 1] != 0.0:
        _update_peaks_at_corners(scene, h, load, memory)


@outlined
def _update_peaks_at_corners(scene, h, load, memory):
    """Update the peaks of story forces at the corners, and of accelerations and total shears at and
    between the corners.

    The observer (`tdint.kernels.time_loop.observer`) then computes no other peaks of these
    quantities within the step.

    Parameters
    ----------
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    load : ndarray
        Load of the step.
    memory : Memory
        State, law states, scratch array and status of the step.
    """
    _, law_state, scratch, step_status = memory
    n = scene.linear_terms.shape[1] - 1
    if not _may_exceed_peaks(scene, h, load, memory):
        return
    scratch[ROW.CORNERS, 0] = 0.0
    for i in range(n):
        if scratch[ROW.LEFT, i] != 0.0 and law_state[rows.SLOPE, i] < math.inf:
            complete = _story_path(scene.linear_terms, law_state, scratch, i)
            steady = scratch[ROW.STEADY, i] != 0.0
            _find_corners(
                scene.law_parameters,
                law_state,
                i,
                complete,
                steady,
                Integrals(scratch, ROW.CORNERS),
            )
    if scratch[ROW.CORNERS, 0] == 0.0:
        return
    step_status[rows.STEP_PEAKS] = step_status[rows.RUN_PEAKS] = ROW.PEAKS
    _update_peaks_between_corners(scene, h, load, memory)


@outlined
def _update_peaks_between_corners(scene, h, load, memory):
    """Update the peaks of accelerations and total shears at the corners and between them.

    Parameters
    ----------
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    load : ndarray
        Load of the step.
    memory : Memory
        State and scratch array.
    """
    state, _, scratch, _ = memory
    n = scene.linear_terms.shape[1] - 1
    count = _store_nodes(scratch, n)
    # The first pass uses cubics, the second pass the integrated accelerations.
    for i in range(n):
        rise, change = scratch[ROW.RISE, i], scratch[ROW.A0, i]
        cubic = 0.2 * (rise - h * state[rows.VELOCITY, i]) - 0.1 * change
        for k in range(count):
            s = scratch[ROW.FORCES + k, n] - 0.5
            t = s + 0.5
            scratch[ROW.WAYS + k, i] = (
                t * (rise + 0.5 * change * (t - 1.0)) - 10.0 * s * (s * s - 0.25) * cubic
            )
            scratch[ROW.RATES + k, i] = rise + s * change + (2.5 - 30.0 * s * s) * cubic
    for passed in range(_PASSES):
        for i in range(n if passed > 0 else 0):
            _integrate_accelerations(h, load, memory, i, count)
        for i in range(n):
            _store_forces(scene, h, memory, i, count)
        for k in range(count):
            _store_accelerations(scene, h, load, scratch, k)
    for i in range(n):
        raise_peak_at_nodes(scratch, ROW.MOTION, i, count, ROW.PEAKS + rows.PEAK_ACCELERATION, i)
        raise_peak_at_nodes(scratch, ROW.FORCES, i, count, ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i)
