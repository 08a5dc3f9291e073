"""The error of a run of moment4, carried along in the run.

The impulse and the first moment of `tdint.kernels.equations.moment4` hold for the true motion as well. What is not true
is the path along which the story forces are taken: the true one is a parabola plus motions that start and end where
they are. With r what the acceleration (p - f - C u') / M on the path has beyond its line A0 + A1 s, these have

    mean w = h^2 r2 / 360,  r2 = 180 mean((s^2 - 1/12) r)          (even, 30 (s^2 - 1/4)^2)
    12 mean(s w) = -h^2 A1 / 60 + 2 h^2 mean(s^3 r)                (odd, -10 s (s^2 - 1/4))

("bubbles"), so that the second moment, the first one that the step leaves unbalanced, is its local error: in one mode of a linear
building h^5 omega^2 u'''' / 720.

A second state of the drift laws, the companion's, follows the run's parabolas plus those of the error, and the
bubbles. That the companion fulfills impulse and moment gives rise and bend of the error: in a linear building by one
solve with the matrix of the run's step, which is factored; where stories change their branch, or are curved, by further
Newton steps with that matrix. A story that yields only with the error, or unloads earlier with it, does so in the
companion.

The companion's story `i` has column n + 1 + i of `laws`, `springs` and `work`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.bundles import Array, Integrals, Memory, Scene, Stretch
from tdint.kernels.chain import DASHPOTS, FORCES, MODAL, add_modal_force, force_second, force_third, force_value
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.moment4 import ROW, STORE, solve
from tdint.kernels.laws.choosing import BENDING
from tdint.kernels.stories import error_path, path
from tdint.kernels.stories.branches import advance
from tdint.kernels.stories.error_path import RESULT
from tdint.kernels.stories.path import arrive, stays

STATE_ROWS = 5


class _Rows(NamedTuple):
    """Rows of work behind those of the run's step."""

    RISE: int = 1  # of the error
    BEND: int = 1
    EVEN: int = 1  # bubbles of the floors
    ODD: int = 1
    A1: int = 1  # h^2 A1
    SECOND: int = 1  # moments of the story forces
    THIRD: int = 1
    MEAN: int = 1  # what mean and first moment of a story's force are more than the run's
    MOMENT: int = 1
    CALM: int = 1  # 1 if the story is on the same linear branch in both motions
    PATH: int = error_path.ERROR_PATH_ROWS
    SEEN: int = 10  # twice displacement, velocity, absolute acceleration of the corrected motion, then both one before
    OTHER: int = 1  # forces on floors less modal damping
    BEFORE: int = 1  # the run's acceleration at the end of the step before
    STORY: int = 2  # drift and force
    TURN: int = 1
    PEAKS: int = 2 * at.PEAK_ROWS  # of the corrected motion


OWN, ERROR_ROWS = at.chained(_Rows)

PASSES = 3  # Newton steps where stories change their branches
_SETTLED = 1e-3  # correction over the error after which there is none more


class Carried(NamedTuple):
    """What the error's step works on; `base` is the first of its own rows of work."""

    scene: Scene
    memory: Memory
    load: Array
    h: float
    base: int


def error_peaks(modes: int) -> int:
    """The first of the rows of work with the peaks of the corrected motion, rows as of `Workspace.peaks`."""
    return STORE + 6 * modes + 1 + OWN.PEAKS


@inlined
def first_row(modal):
    """The first of the error's rows of work."""
    return STORE + 6 * modal.shape[0] + 1


@called
def begin_error(scene, load, memory):
    """Start the companion from the run's state."""
    springs = memory.springs
    n = scene.chain.shape[1] - 1
    for row in range(springs.shape[0]):
        for i in range(n):
            springs[row, n + 1 + i] = springs[row, i]
    memory.report[at.ERROR_BEGUN] = 1.0


@inlined
def carry_error(scene, h, load, memory):
    """Rise and bend of the error over the step of which the rows RISE and BEND tell, and the companion's new state."""
    base = first_row(scene.modal)
    carried = Carried(scene, memory, load, h, base)
    state, springs, work, _ = memory
    linear = not BENDING or scene.flags[at.LINEAR] != 0.0
    calm = linear or _same_branches(scene.chain, springs, work)
    if calm:
        _calm_bubbles(carried)
        _add_loads(carried)
        _calm_unbalanced(carried)
        _solve(carried, True)
        calm = linear or _still(scene.chain, springs, work, base)
    else:
        for i in range(scene.chain.shape[1] - 1):
            work[base + OWN.RISE, i] = h * state[at.ERROR_VELOCITY, i]
            work[base + OWN.BEND, i] = 0.0
    if calm:
        _commit(carried)
    else:
        _follow(scene, h, load, memory, base)


# ---- All stories on the same linear branches in both motions


@inlined
def _same_branches(chain, springs, work):
    """Whether all stories have kept to linear branches that are the companion's, too."""
    n = chain.shape[1] - 1
    same = True
    for i in range(n):
        same &= (work[ROW.LEFT, i] == 0.0) & (springs[at.SLOPE, i] == springs[at.SLOPE, n + 1 + i])
        if DASHPOTS:
            same &= chain[at.POWER_DAMPER, i] == 0.0
    return same


@inlined
def _calm_bubbles(carried):
    """Bubbles, but for modal damping and floor forces."""
    scene, memory, load, h, base = carried
    chain = scene.chain
    state, springs, work, _ = memory
    n = chain.shape[1] - 1
    by_h = 1.0 / h
    square = h * h / 360.0
    ground = 180.0 * load[at.GROUND_2] * square
    third = 2.0 * h * h * load[at.GROUND_3]
    a1_below = bend_below = before = floor = inverse = 0.0
    for i in range(n + 1):
        link = chain[at.LINK, i]
        bend = work[ROW.BEND, i]
        a1 = 12.0 * (0.5 * bend - work[ROW.RISE, i] + h * state[at.VELOCITY, i])
        second = 0.5 * by_h * chain[at.STORY_DAMPER, i] * (a1 - link * a1_below)
        second += 0.5 * (chain[at.GEOMETRIC, i] + springs[at.SLOPE, i]) * (bend - link * bend_below)
        if i > 0:
            work[base + OWN.EVEN, i - 1] = -square * inverse * (before - link * second + floor * a1_below) - ground
        work[base + OWN.A1, i] = a1
        if i < n:
            work[base + OWN.ODD, i] = -a1 / 60.0 - third
        inverse = chain[at.INVERSE_MASS, i]
        floor = 0.5 * by_h * chain[at.FLOOR_DAMPER, i]
        a1_below = a1
        bend_below = bend
        before = second


@inlined
def _calm_unbalanced(carried):
    """Minus what the companion's motion leaves out of balance without rise and bend of the error."""
    scene, memory, _, h, base = carried
    chain = scene.chain
    state, springs, work, _ = memory
    n = chain.shape[1] - 1
    square = h * h
    by_h = 12.0 / h
    u_below = even_below = odd_below = mean_below = moment_below = 0.0
    for i in range(n + 1):
        link = chain[at.LINK, i]
        mean = moment = u = even = odd = 0.0
        if i < n:
            u = state[at.ERROR_DISPLACEMENT, i]
            even = work[base + OWN.EVEN, i]
            odd = work[base + OWN.ODD, i]
            geometric = chain[at.GEOMETRIC, i]
            stiffness = geometric + springs[at.SLOPE, i]
            bubble = even - link * even_below
            mean = springs[at.FORCE, n + 1 + i] - springs[at.FORCE, i]
            mean += geometric * (u - link * u_below) + stiffness * bubble
            moment = stiffness * (odd - link * odd_below) - by_h * chain[at.STORY_DAMPER, i] * bubble
        if i > 0:
            speed = chain[at.FLOOR_DAMPER, i - 1] * even_below
            speed -= chain[at.MASS, i - 1] * state[at.ERROR_VELOCITY, i - 1]
            work[ROW.X, i - 1] = -square * (mean_below - link * mean)
            work[ROW.X + 1, i - 1] = 12.0 * h * speed - square * (moment_below - link * moment)
        u_below, even_below, odd_below = u, even, odd
        mean_below, moment_below = mean, moment
    if MODAL and scene.modal.shape[0] > 0:
        add_modal_force(scene.modal, work, base + OWN.EVEN, 12.0 * h, work, ROW.X + 1, n)


@inlined
def _still(chain, springs, work, base):
    """Whether all stories of the companion keep to their branches."""
    n = chain.shape[1] - 1
    rise_below = bend_below = 0.0
    still = True
    for i in range(n):
        rise = work[ROW.RISE, i] + work[base + OWN.RISE, i]
        bend = work[ROW.BEND, i] + work[base + OWN.BEND, i]
        link = chain[at.LINK, i]
        still = still and stays(springs, n + 1 + i, rise - link * rise_below, bend - link * bend_below)
        rise_below, bend_below = rise, bend
    return still


@inlined
def _commit(carried):
    """The state at the end of the step, all stories on the branches where they are."""
    scene, memory, _, h, base = carried
    state, springs, work, _ = memory
    n = scene.chain.shape[1] - 1
    by_h = 1.0 / h
    below = 0.0
    for i in range(n):
        c = n + 1 + i
        rise = work[ROW.RISE, i] + work[base + OWN.RISE, i]
        advance(scene.laws, springs, c, 0, springs[at.DRIFT, c] + rise - scene.chain[at.LINK, i] * below)
        below = rise
        state[at.ERROR_DISPLACEMENT, i] += work[base + OWN.RISE, i]
        state[at.ERROR_VELOCITY, i] += by_h * work[base + OWN.BEND, i]


# ---- Any stories


@called
def _follow(scene, h, load, memory, base):
    """Rise and bend of the error by Newton's iteration from those that are there, and the companion's new state."""
    carried = Carried(scene, memory, load, h, base)
    chain, _, laws, _, _ = scene
    state, springs, work, _ = memory
    n = chain.shape[1] - 1
    for i in range(n):
        work[base + OWN.A1, i] = 12.0 * (0.5 * work[ROW.BEND, i] - work[ROW.RISE, i] + h * state[at.VELOCITY, i])
    for passed in range(PASSES):
        _paths(carried, passed > 0)
        _moments(carried)
        _bubbles(carried)
        _add_loads(carried)
        _story_forces(carried)
        _unbalanced(carried)
        if _solve(carried, False) and passed > 0:
            break
    _shake_at_events(carried)
    below = 0.0
    for i in range(n):
        c = n + 1 + i
        rise = work[ROW.RISE, i] + work[base + OWN.RISE, i]
        gain = rise - chain[at.LINK, i] * below
        below = rise
        if work[base + OWN.CALM, i] != 0.0:
            advance(laws, springs, c, 0, springs[at.DRIFT, c] + gain)
        else:
            if springs[at.SLOPE, c] < math.inf:
                advance(laws, springs, c, at.FIRST_TRIAL, springs[at.DRIFT, c] + gain)
            arrive(laws, springs, c, gain)
        state[at.ERROR_DISPLACEMENT, i] += work[base + OWN.RISE, i]
        state[at.ERROR_VELOCITY, i] += work[base + OWN.BEND, i] / h


@inlined
def _whole_path(carried, i):
    """The companion's parabola of story `i`, without its bubbles."""
    link = carried.scene.chain[at.LINK, i]
    _, springs, work, _ = carried.memory
    base = carried.base
    rise = work[ROW.RISE, i] + work[base + OWN.RISE, i]
    bend = work[ROW.BEND, i] + work[base + OWN.BEND, i]
    if i > 0:
        rise -= link * (work[ROW.RISE, i - 1] + work[base + OWN.RISE, i - 1])
        bend -= link * (work[ROW.BEND, i - 1] + work[base + OWN.BEND, i - 1])
    n = carried.scene.chain.shape[1] - 1
    return Stretch(springs[at.DRIFT, n + 1 + i], rise, bend, 0.0, 1.0)


@inlined
def _of_story(carried, row, i):
    """What story `i` has of a row of the floors."""
    below = carried.memory.work[row, i - 1] if i > 0 else 0.0
    return carried.memory.work[row, i] - carried.scene.chain[at.LINK, i] * below


@inlined
def _paths(carried, knowing):
    """Find the stories that are on the same linear branch in both motions, and follow the others, with their bubbles
    once these are known."""
    scene, memory, _, h, base = carried
    _, springs, work, _ = memory
    n = scene.chain.shape[1] - 1
    for i in range(n):
        c = n + 1 + i
        whole = _whole_path(carried, i)
        damped = DASHPOTS and scene.chain[at.POWER_DAMPER, i] != 0.0
        calm = work[ROW.LEFT, i] == 0.0 and springs[at.SLOPE, i] == springs[at.SLOPE, c] and not damped
        if calm and stays(springs, c, whole.rise, whole.bend):
            work[base + OWN.CALM, i] = 1.0
            continue
        work[base + OWN.CALM, i] = 0.0
        bubbles = (0.0, 0.0)
        if knowing:
            bubbles = (_of_story(carried, base + OWN.EVEN, i), _of_story(carried, base + OWN.ODD, i))
        results = Integrals(work, base + OWN.PATH)
        error_path.follow(scene.laws, springs, c, whole, bubbles, results)
        if damped:
            error_path.add_dashpot(scene.chain, i, h, whole, _of_story(carried, base + OWN.A1, i), results, c)


@inlined
def _moments(carried):
    """Second and third moment of the story forces, dampers included."""
    scene, memory, _, h, base = carried
    _, springs, work, _ = memory
    chain = scene.chain
    n = chain.shape[1] - 1
    for i in range(n):
        bend = _of_story(carried, ROW.BEND, i)
        second = chain[at.STORY_DAMPER, i] / h * _of_story(carried, base + OWN.A1, i) + chain[at.GEOMETRIC, i] * bend
        third = 0.0
        if work[base + OWN.CALM, i] != 0.0:
            second += springs[at.SLOPE, i] * bend
        second *= 0.5
        if work[base + OWN.CALM, i] == 0.0:
            second += work[base + OWN.PATH + RESULT.SECOND, n + 1 + i]
            third = work[base + OWN.PATH + RESULT.THIRD, n + 1 + i]
        work[base + OWN.SECOND, i] = second
        work[base + OWN.THIRD, i] = third


@inlined
def _bubbles(carried):
    """Bubbles of the floors, but for modal damping and floor forces."""
    scene, memory, load, h, base = carried
    work = memory.work
    chain = scene.chain
    n = chain.shape[1] - 1
    square = h * h
    work[base + OWN.SECOND, n] = 0.0
    work[base + OWN.THIRD, n] = 0.0
    for i in range(n):
        link = chain[at.LINK, i + 1]
        a1 = work[base + OWN.A1, i]
        inverse = chain[at.INVERSE_MASS, i]
        second = work[base + OWN.SECOND, i] - link * work[base + OWN.SECOND, i + 1]
        second += 0.5 / h * chain[at.FLOOR_DAMPER, i] * a1
        third = work[base + OWN.THIRD, i] - link * work[base + OWN.THIRD, i + 1]
        work[base + OWN.EVEN, i] = -square / 360.0 * (second * inverse + 180.0 * load[at.GROUND_2])
        work[base + OWN.ODD, i] = -a1 / 60.0 - 2.0 * square * (third * inverse + load[at.GROUND_3])


@inlined
def _add_loads(carried):
    """What modal damping and floor forces add to the bubbles."""
    scene, memory, load, h, base = carried
    modal, forces = scene.modal, scene.forces
    work = memory.work
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        n = scene.chain.shape[1] - 1
        for i in range(n):
            work[base + OWN.SECOND, i] = 0.0
            work[base + OWN.THIRD, i] = 0.0
        add_modal_force(modal, work, base + OWN.A1, 0.5 / h, work, base + OWN.SECOND, n)
        for j in range(forces.shape[0]):
            floor = int(forces[j, at.FLOOR])
            work[base + OWN.SECOND, floor] -= force_second(forces, j, load[at.TIME], h)
            work[base + OWN.THIRD, floor] -= force_third(forces, j, load[at.TIME], h)
        for i in range(n):
            inverse = h * h * scene.chain[at.INVERSE_MASS, i]
            work[base + OWN.EVEN, i] -= inverse / 360.0 * work[base + OWN.SECOND, i]
            work[base + OWN.ODD, i] -= 2.0 * inverse * work[base + OWN.THIRD, i]


@inlined
def _story_forces(carried):
    """What mean and moment of the stories' forces, dampers included, are more than the run's."""
    scene, memory, _, h, base = carried
    state, springs, work, _ = memory
    chain = scene.chain
    n = chain.shape[1] - 1
    below = 0.0
    for i in range(n):
        c = n + 1 + i
        u = state[at.ERROR_DISPLACEMENT, i]
        rise, bend = _of_story(carried, base + OWN.RISE, i), _of_story(carried, base + OWN.BEND, i)
        even, odd = _of_story(carried, base + OWN.EVEN, i), _of_story(carried, base + OWN.ODD, i)
        geometric = chain[at.GEOMETRIC, i]
        damper = chain[at.STORY_DAMPER, i] / h
        mean = geometric * (u - chain[at.LINK, i] * below + 0.5 * rise - bend / 12.0 + even) + damper * rise
        moment = geometric * (rise + odd) + damper * (bend - 12.0 * even)
        if work[base + OWN.CALM, i] != 0.0:
            slope = springs[at.SLOPE, i]
            mean += springs[at.FORCE, c] - springs[at.FORCE, i] + slope * (0.5 * rise - bend / 12.0 + even)
            moment += slope * (rise + odd)
        else:
            out = base + OWN.PATH
            run_mean, run_moment = _of_run(carried, i)
            mean += work[out + RESULT.MEAN, c] - run_mean
            mean += work[out + RESULT.MEAN_BY_EVEN, c] * even + work[out + RESULT.MEAN_BY_ODD, c] * odd
            moment += work[out + RESULT.MOMENT, c] - run_moment
            moment += work[out + RESULT.MOMENT_BY_EVEN, c] * even + work[out + RESULT.MOMENT_BY_ODD, c] * odd
        work[base + OWN.MEAN, i] = mean
        work[base + OWN.MOMENT, i] = moment
        below = u


@inlined
def _of_run(carried, i):
    """Mean and moment of story `i` in the run, power-law dashpot included."""
    scene, memory, _, h, _ = carried
    _, springs, work, _ = memory
    chain = scene.chain
    rise, bend = _of_story(carried, ROW.RISE, i), _of_story(carried, ROW.BEND, i)
    if work[ROW.LEFT, i] == 0.0 and not (DASHPOTS and chain[at.POWER_DAMPER, i] != 0.0):
        slope = springs[at.SLOPE, i]
        return springs[at.FORCE, i] + slope * (0.5 * rise - bend / 12.0), slope * rise
    geometric = chain[at.GEOMETRIC, i]
    damper = chain[at.STORY_DAMPER, i] / h
    middle = springs[at.DRIFT, i] + 0.5 * rise - bend / 12.0
    mean = work[ROW.PATH + path.MEAN, i] - geometric * middle - damper * rise
    return mean, work[ROW.PATH + path.MOMENT, i] - geometric * rise - damper * bend


@inlined
def _unbalanced(carried):
    """Minus what the companion's motion leaves out of balance."""
    scene, memory, _, h, base = carried
    state, _, work, _ = memory
    chain, modal = scene.chain, scene.modal
    n = chain.shape[1] - 1
    square = h * h
    work[base + OWN.MEAN, n] = 0.0
    work[base + OWN.MOMENT, n] = 0.0
    for i in range(n):
        link = chain[at.LINK, i + 1]
        mass = chain[at.MASS, i]
        floor = h * chain[at.FLOOR_DAMPER, i]
        rise = work[base + OWN.RISE, i]
        bend = work[base + OWN.BEND, i]
        mean = work[base + OWN.MEAN, i] - link * work[base + OWN.MEAN, i + 1]
        moment = work[base + OWN.MOMENT, i] - link * work[base + OWN.MOMENT, i + 1]
        inertia = 12.0 * mass * (0.5 * bend - rise + h * state[at.ERROR_VELOCITY, i])
        work[ROW.X, i] = -mass * bend - floor * rise - square * mean
        work[ROW.X + 1, i] = -inertia - floor * (bend - 12.0 * work[base + OWN.EVEN, i]) - square * moment
    if MODAL and modal.shape[0] > 0:
        add_modal_force(modal, work, base + OWN.RISE, -h, work, ROW.X, n)
        add_modal_force(modal, work, base + OWN.BEND, -h, work, ROW.X + 1, n)
        add_modal_force(modal, work, base + OWN.EVEN, 12.0 * h, work, ROW.X + 1, n)


@inlined
def _solve(carried, anew):
    """Rise and bend of the error, or their corrections. Returns whether these are small."""
    scene, memory, _, h, base = carried
    work = memory.work
    n = scene.chain.shape[1] - 1
    solve(scene.modal, h, work, n)
    change = 0.0
    size = 0.0
    for i in range(n):
        for row in range(2):
            if anew:
                work[base + OWN.RISE + row, i] = work[ROW.X + row, i]
            else:
                work[base + OWN.RISE + row, i] += work[ROW.X + row, i]
                change += abs(work[ROW.X + row, i])
                size += abs(work[base + OWN.RISE + row, i])
    return change <= _SETTLED * size


# ---- Accelerations and shears where stories change their branches


@inlined
def _shake_at_events(carried):
    """Raise the peaks of shears, and of accelerations of the floors at both ends of a story, by those at which it turns
    or changes its branch."""
    scene, memory, _, _, base = carried
    work = memory.work
    n = scene.chain.shape[1] - 1
    for i in range(n):
        if work[base + OWN.CALM, i] != 0.0:
            continue
        row = base + OWN.PEAKS + at.PEAK_SHEAR
        work[row, i] = max(work[row, i], work[base + OWN.PATH + RESULT.LARGEST, n + 1 + i])
        first = work[base + OWN.PATH + RESULT.EVENT, n + 1 + i]
        last = work[base + OWN.PATH + RESULT.LAST_EVENT, n + 1 + i]
        if first > 0.0:
            _shake(scene, carried.h, carried.load, memory, base, i, first)
        if last > first:
            _shake(scene, carried.h, carried.load, memory, base, i, last)


@called
def _shake(scene, h, load, memory, base, i, t):
    """Raise the peak accelerations of the floors at both ends of story `i` by those at t."""
    carried = Carried(scene, memory, load, h, base)
    chain, modal, _, forces, _ = scene
    work = memory.work
    n = chain.shape[1] - 1
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        for floor in range(n):
            work[base + OWN.TURN, floor] = _rate_at(work, base, t, floor) / h
            work[base + OWN.OTHER, floor] = 0.0
        for j in range(forces.shape[0]):
            work[base + OWN.OTHER, int(forces[j, at.FLOOR])] += force_value(forces, j, load[at.TIME] + t * h)
        add_modal_force(modal, work, base + OWN.TURN, -1.0, work, base + OWN.OTHER, n)
    for floor in range(max(i - 1, 0), i + 1):
        above = _story_at(carried, t, floor + 1) if floor + 1 < n else 0.0
        damped = chain[at.FLOOR_DAMPER, floor] * _rate_at(work, base, t, floor) / h
        force = (
            chain[at.LINK, floor + 1] * above - _story_at(carried, t, floor) - damped + work[base + OWN.OTHER, floor]
        )
        row = base + OWN.PEAKS + at.PEAK_ACCELERATION
        work[row, floor] = max(work[row, floor], abs(chain[at.INVERSE_MASS, floor] * force))


@inlined
def _rate_at(work, base, t, i):
    """h times the velocity of a floor on the companion's path."""
    s = t - 0.5
    parabola = work[ROW.RISE, i] + work[base + OWN.RISE, i] + s * (work[ROW.BEND, i] + work[base + OWN.BEND, i])
    even = 120.0 * s * (s * s - 0.25) * work[base + OWN.EVEN, i]
    return parabola + even + (2.5 - 30.0 * s * s) * work[base + OWN.ODD, i]


@called
def _story_at(carried, t, i):
    """Force of story `i` and its linear damper at t; between changes of branch it is taken as linear."""
    scene, memory, _, h, base = carried
    _, springs, work, _ = memory
    chain = scene.chain
    c = chain.shape[1] + i
    whole = _whole_path(carried, i)
    even, odd = _of_story(carried, base + OWN.EVEN, i), _of_story(carried, base + OWN.ODD, i)
    drift = path.drift_at(whole, t) + error_path.even(t - 0.5) * even + error_path.odd(t - 0.5) * odd
    rate = _rate_at(work, base, t, i)
    if i > 0:
        rate -= chain[at.LINK, i] * _rate_at(work, base, t, i - 1)
    force = springs[at.FORCE, c]
    if work[base + OWN.CALM, i] != 0.0:
        force += springs[at.SLOPE, c] * (drift - whole.start)
    else:
        out = base + OWN.PATH
        first, last = work[out + RESULT.EVENT, c], work[out + RESULT.LAST_EVENT, c]
        begin, end, following = 0.0, 1.0, springs[at.FIRST_TRIAL + at.FORCE, c]
        if first > 0.0 and t <= first:
            end, following = first, work[out + RESULT.EVENT_FORCE, c]
        elif first > 0.0:
            begin, force = first, work[out + RESULT.EVENT_FORCE, c]
            if t <= last and last > first:
                end, following = last, work[out + RESULT.LAST_EVENT_FORCE, c]
            elif last > first:
                begin, force = last, work[out + RESULT.LAST_EVENT_FORCE, c]
        force += (t - begin) / (end - begin) * (following - force)
    return force + chain[at.GEOMETRIC, i] * drift + chain[at.STORY_DAMPER, i] * rate / h
