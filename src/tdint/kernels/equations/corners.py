"""Peaks that a step of moment4 has where stories change their branches or turn.

There forces have corners, and so have accelerations: a quintic through the ends of the step does
not know of them. The paths of the stories tell when (`tdint.kernels.stories.path`), their forces
there, and equilibrium the accelerations.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.equations.moment4 import MOST_CORNERS, ROW
from tdint.kernels.laws.choosing import CURVES
from tdint.kernels.linear_terms import FORCES, add_modal_force, force_value, power_damper
from tdint.kernels.peaks_between_steps import raise_peak, raise_peak_at_nodes
from tdint.kernels.stepping import Integrals, Stretch
from tdint.kernels.stories import path

# Of a story's stiffness times the way of its drift: what its force goes beyond the straight line
# that is closest to it in the step (least squares, as the acceleration A0 + A1 s) where it bends by
# all of the stiffness at mid-step.
_CORNER = 0.125
_PASSES = 2  # the second one leaves less than the step errs by
_APART = 1e-6  # of the step: corners that are no farther from each other, or from its ends, are one


@inline
def _of_story(linear_terms, scratch, row, i):
    """What story `i` has of a row of the floors."""
    return scratch[row, i] - linear_terms[rows.LINK, i] * scratch[row, max(i - 1, 0)]


@inline
def _followed(linear_terms, law_state, scratch, i):
    """The parabola that a story has followed."""
    rise, bend = (
        _of_story(linear_terms, scratch, ROW.RISE, i),
        _of_story(linear_terms, scratch, ROW.BEND, i),
    )
    return Stretch(law_state[rows.DRIFT, i], rise, bend, 0.0, 1.0)


# ---- Along the path of a story


@inline
def _pass_on(law_state, i, block, stretch, results):
    pass


@inline
def _ignore(results, i, t, force):
    pass


@inline
def _note(results, i, t, force):
    """Keep the time of a corner in column 0, behind the number of them; its force may be the
    story's largest."""
    scratch, first = results
    raise_peak(scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, force)
    count = int(scratch[first, 0])
    if _APART < t < 1.0 - _APART and count < MOST_CORNERS:
        place = count
        while place > 0 and scratch[first + place, 0] > t:
            scratch[first + place + 1, 0] = scratch[first + place, 0]
            place -= 1
        scratch[first + place + 1, 0] = t
        scratch[first, 0] = count + 1.0


_go_noting = path.along_branches(_pass_on, _note)
_go = path.along_branches(_pass_on, _ignore)


@inline
def _sense(stretch, steady):
    """The direction in which a story goes along a stretch; of one that does not turn in the step
    that of its way."""
    way = (
        stretch.rise
        if steady
        else path.drift_at(stretch, stretch.end) - path.drift_at(stretch, stretch.begin)
    )
    return math.copysign(1.0, way) if way != 0.0 else 0.0


@outlined
def _find_corners(law_parameters, law_state, i, whole, steady, corners):
    """Note the corners on the way of a story, the one where it turns among them."""
    path.copy(law_state, i, 0, rows.SECOND_TRIAL)
    turn = 1.0 if steady else path.turning_point(whole)
    there, drift = path.part_of(whole, 0.0, turn), path.drift_at(whole, turn)
    _go_noting(
        law_parameters,
        law_state,
        i,
        rows.SECOND_TRIAL,
        there,
        _sense(there, steady),
        drift,
        corners,
    )
    if turn < 1.0:
        _note(corners, i, turn, law_state[rows.SECOND_TRIAL + rows.FORCE, i])
        back, drift = path.part_of(whole, turn, 1.0), path.drift_at(whole, 1.0)
        _go_noting(
            law_parameters,
            law_state,
            i,
            rows.SECOND_TRIAL,
            back,
            _sense(back, False),
            drift,
            corners,
        )


@outlined
def _place(scratch, n):
    """Times of the nodes into column n of the rows of forces: both ends of the step, the corners,
    and the middles between these. Returns how many there are."""
    scratch[ROW.FORCES, n] = 0.0
    count = 1
    corners = int(scratch[ROW.CORNERS, 0])
    for k in range(corners + 1):
        before = scratch[ROW.FORCES + count - 1, n]
        t = scratch[ROW.CORNERS + 1 + k, 0] if k < corners else 1.0
        if t - before > _APART:
            scratch[ROW.FORCES + count, n] = 0.5 * (before + t)
            scratch[ROW.FORCES + count + 1, n] = t
            count += 2
    return count


@outlined
def _force(scene, h, memory, i, count):
    """Force of story `i` at the nodes, P-delta included and dampers left out."""
    _, law_state, scratch, _ = memory
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    whole = _followed(linear_terms, law_state, scratch, i)
    geometric = linear_terms[rows.GEOMETRIC, i]
    left = scratch[ROW.LEFT, i] != 0.0
    curved = CURVES and not law_state[rows.SLOPE, i] < math.inf
    mean = moment = 0.0
    if curved:
        # Mean and moment of its force and that at the start tell a parabola.
        mean = scratch[ROW.PATH + path.MEAN, i] - geometric * (
            whole.start + 0.5 * whole.rise - whole.bend / 12.0
        )
        mean -= linear_terms[rows.STORY_DAMPER, i] / h * whole.rise + scratch[ROW.DASHPOT, i]
        moment = scratch[ROW.PATH + path.MOMENT, i] - geometric * whole.rise
        moment -= linear_terms[rows.STORY_DAMPER, i] / h * whole.bend + scratch[ROW.DASHPOT + 1, i]
    elif left:
        path.copy(law_state, i, 0, rows.SECOND_TRIAL)
    before = 0.0
    for k in range(count):
        t = scratch[ROW.FORCES + k, n]
        s = t - 0.5
        drift = whole.start + _of_story(linear_terms, scratch, ROW.WAYS + k, i)
        force = law_state[rows.FORCE, i]
        if curved:
            force = mean + s * moment + (6.0 * s * s - 0.5) * (force - mean + 0.5 * moment)
        elif not left:
            force += law_state[rows.SLOPE, i] * (drift - whole.start)
        elif t > 0.0:
            part = path.part_of(whole, before, t)
            side, reached = _sense(part, scratch[ROW.STEADY, i] != 0.0), path.drift_at(whole, t)
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
            off = drift - law_state[rows.SECOND_TRIAL + rows.DRIFT, i]
            force = (
                law_state[rows.SECOND_TRIAL + rows.FORCE, i]
                + law_state[rows.SECOND_TRIAL + rows.SLOPE, i] * off
            )
            before = t
        scratch[ROW.FORCES + k, i] = force + geometric * drift


@outlined
def _accelerate(scene, h, load, scratch, k):
    """Absolute accelerations of the floors at node `k` from equilibrium; total shears in place of
    forces."""
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
        rate = by_h * _of_story(linear_terms, scratch, ROW.RATES + k, i)
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
def _move(h, load, memory, i, count):
    """Ways and rates of floor `i` at the nodes from its accelerations there: parabolas over each
    two parts, and a line that brings the floor to where the step does."""
    state, _, scratch, _ = memory
    n = state.shape[1] - 1
    v = h * state[rows.VELOCITY, i]
    way, rate, a2 = 0.0, v, _relative(h, load, scratch, 0, i, n)
    for k in range(0, count - 2, 2):
        d = scratch[ROW.FORCES + k + 1, n] - scratch[ROW.FORCES + k, n]
        a0, a1, a2 = (
            a2,
            _relative(h, load, scratch, k + 1, i, n),
            _relative(h, load, scratch, k + 2, i, n),
        )
        scratch[ROW.WAYS + k + 1, i] = (
            way + d * rate + d * d * (3.5 * a0 + 3.0 * a1 - 0.5 * a2) / 12.0
        )
        scratch[ROW.RATES + k + 1, i] = rate + d * (5.0 * a0 + 8.0 * a1 - a2) / 12.0
        way += 2.0 * d * rate + d * d * (2.0 * a0 + 4.0 * a1) / 3.0
        rate += d * (a0 + 4.0 * a1 + a2) / 3.0
        scratch[ROW.WAYS + k + 2, i], scratch[ROW.RATES + k + 2, i] = way, rate
    level = v + scratch[ROW.A0, i] - rate
    tilt = 12.0 * (0.5 * level - (scratch[ROW.RISE, i] - way))
    for k in range(1, count):
        t = scratch[ROW.FORCES + k, n]
        scratch[ROW.WAYS + k, i] += t * t * (0.5 * level + tilt * (t / 6.0 - 0.25))
        scratch[ROW.RATES + k, i] += t * (level + 0.5 * tilt * (t - 1.0))


@inline
def _relative(h, load, scratch, k, i, n):
    """h^2 times the acceleration of floor `i` at node `k`, relative to the ground."""
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
def _may_pass_shear(law_state, scratch, i, rise, bend):
    """Whether the force of a story that left a linear branch may pass its peak where it turns or
    the branch ends."""
    way = abs(rise) + 0.5 * abs(bend)
    most = abs(law_state[rows.FORCE, i]) + abs(law_state[rows.SLOPE, i]) * way
    peak = scratch[ROW.PEAKS + rows.PEAK_SHEAR, i]
    near = (2.0 * abs(rise) < abs(bend)) & (most > peak)
    for row in (rows.UPPER, rows.LOWER):
        ahead = law_state[row, i] - law_state[rows.DRIFT, i]
        near |= (abs(ahead) <= way) & (
            abs(law_state[rows.FORCE, i] + law_state[rows.SLOPE, i] * ahead) > peak
        )
    return near


@inline
def _comes_near(scene, h, load, memory):
    """Whether the force of a story that has left a linear branch, an acceleration or a total shear
    may pass its peak; with forces on floors the last is not asked."""
    linear_terms, _, law_parameters, forces, _ = scene
    _, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    by_h = 1.0 / (h * h)
    leaves = False
    near = FORCES and forces.shape[0] > 0
    corner_above = moved_0 = moved_1 = 0.0
    for i in range(n - 1, -1, -1):
        corner = 0.0
        if scratch[ROW.LEFT, i] != 0.0 and law_state[rows.SLOPE, i] < math.inf:
            leaves = True
            rise, bend = (
                _of_story(linear_terms, scratch, ROW.RISE, i),
                _of_story(linear_terms, scratch, ROW.BEND, i),
            )
            near |= _may_pass_shear(law_state, scratch, i, rise, bend)
            corner = _CORNER * law_parameters[rows.STIFFNESS, i] * (abs(rise) + 0.5 * abs(bend))
        half = 0.5 * by_h * scratch[ROW.A1, i]
        a_0 = by_h * scratch[ROW.A0, i] - half + load[rows.GROUND_0]
        a_1 = by_h * scratch[ROW.A0, i] + half + load[rows.GROUND_1]
        more = linear_terms[rows.INVERSE_MASS, i] * (corner + corner_above)
        near |= max(abs(a_0), abs(a_1)) + more > scratch[ROW.PEAKS + rows.PEAK_ACCELERATION, i]
        moved_0 = linear_terms[rows.LINK, i + 1] * moved_0 + linear_terms[rows.MASS, i] * a_0
        moved_1 = linear_terms[rows.LINK, i + 1] * moved_1 + linear_terms[rows.MASS, i] * a_1
        near |= (
            max(abs(moved_0), abs(moved_1)) + corner > scratch[ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i]
        )
        corner_above = linear_terms[rows.LINK, i] * corner
    return near & leaves


@inline
def look_at_corners(scene, h, load, memory):
    """Raise the peaks that the step has at corners and between them, before its end is committed.
    In most steps no story leaves its branch."""
    if memory.scratch[ROW.LEFT, scene.linear_terms.shape[1] - 1] != 0.0:
        _look(scene, h, load, memory)


@outlined
def _look(scene, h, load, memory):
    """The forces of stories at their corners, accelerations and total shears there and between: who
    looks behind this (`time_loop.observer`) takes all of them for looked at."""
    _, law_state, scratch, step_status = memory
    n = scene.linear_terms.shape[1] - 1
    if not _comes_near(scene, h, load, memory):
        return
    scratch[ROW.CORNERS, 0] = 0.0
    for i in range(n):
        if scratch[ROW.LEFT, i] != 0.0 and law_state[rows.SLOPE, i] < math.inf:
            whole = _followed(scene.linear_terms, law_state, scratch, i)
            steady = scratch[ROW.STEADY, i] != 0.0
            _find_corners(
                scene.law_parameters, law_state, i, whole, steady, Integrals(scratch, ROW.CORNERS)
            )
    if scratch[ROW.CORNERS, 0] == 0.0:
        return
    step_status[rows.STEP_PEAKS] = step_status[rows.RUN_PEAKS] = ROW.PEAKS
    _look_between(scene, h, load, memory)


@outlined
def _look_between(scene, h, load, memory):
    """Peaks of accelerations and total shears at the corners and between them."""
    state, _, scratch, _ = memory
    n = scene.linear_terms.shape[1] - 1
    count = _place(scratch, n)
    # On cubics at first, then on what the accelerations make of them
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
            _move(h, load, memory, i, count)
        for i in range(n):
            _force(scene, h, memory, i, count)
        for k in range(count):
            _accelerate(scene, h, load, scratch, k)
    for i in range(n):
        raise_peak_at_nodes(scratch, ROW.MOTION, i, count, ROW.PEAKS + rows.PEAK_ACCELERATION, i)
        raise_peak_at_nodes(scratch, ROW.FORCES, i, count, ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i)
