"""The error of a run of moment4, carried along in the run.

The impulse and the first moment of `tdint.kernels.equations.moment4` hold for the true motion as well. What is not true
is the path along which the story forces are taken: the true one is a parabola plus motions that start and end where
they are. With r what the acceleration (p - f - C u') / M on the path has beyond its line A0 + A1 s, these have

    mean w = h^2 r2 / 360,  r2 = 180 mean((s^2 - 1/12) r)          (even, 30 (s^2 - 1/4)^2)
    12 mean(s w) = -h^2 A1 / 60 + 2 h^2 mean(s^3 r)                (odd, -10 s (s^2 - 1/4))

("bubbles"). So the second moment, the first one that the step leaves unbalanced, is its local error: in one mode of a
linear building h^5 omega^2 u'''' / 720.

A second state of the drift laws, the companion's, follows the run's parabolas plus those of the error, and the
bubbles. That the companion fulfills impulse and moment gives rise and bend of the error: in a linear building by one
solve with the matrix of the run's step, which is factored; where stories change their branch, or are curved, by further
Newton steps with that matrix. A story that yields only with the error, or unloads earlier with it, does so in the
companion.

The companion's story `i` has column n + 1 + i of `law_parameters`, `springs` and `work`.
"""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.carried.companion import follow_anew
from tdint.kernels.equations.carried.rows import (
    OWN,
    Carried,
    add_loads,
    bubbles_of,
    first_row,
    note_doubt,
    of_slopes,
    same_slope,
    story_of,
    surely_keeps,
    turns_of,
    whole_path,
)
from tdint.kernels.equations.carried.within import comes_near, look_within, passes, raise_end
from tdint.kernels.equations.moment4 import ROW, solve
from tdint.kernels.laws.choosing import ANY_APART, BENDING, COUNTS_TURNS
from tdint.kernels.linear_terms import DASHPOTS, MODAL, add_modal_force
from tdint.kernels.stories import error_path
from tdint.kernels.stories.branches import advance


@inlined
def carry_error(scene, h, load, memory):
    """Rise and bend of the error over the step of which the rows RISE and BEND tell, and the companion's new state."""
    base = first_row(scene.modal)
    carried = Carried(scene, memory, load, h, base)
    state, work = memory.state, memory.work
    linear = not BENDING or scene.flags[at.LINEAR] != 0.0
    n = scene.linear_terms.shape[1] - 1
    near = False
    calm = _calm_bubbles(carried) or linear
    if calm:
        add_loads(carried)
        _calm_unbalanced(carried)
        solve(scene.modal, h, work, base + OWN.RISE, n)
        near, still = comes_near(carried, True)
        calm = still or linear or _stays_still(scene, h, load, memory, base)
    else:
        for i in range(n):
            work[base + OWN.RISE, i] = h * state[at.ERROR_VELOCITY, i]
            work[base + OWN.BEND, i] = 0.0
    if calm:
        if near:
            passing = passes(scene, h, load, memory, base, True)
            if passing[0] > 0:
                look_within(scene, h, load, memory, base, True, passing)
        _commit(carried)
    else:
        follow_anew(scene, h, load, memory, base)


# ---- All stories on the same linear branches in both motions


@inlined
def _calm_bubbles(carried):
    """Bubbles, but for modal damping and floor forces, of stories on linear branches. Returns whether all have kept to
    such, and to those of the companion."""
    scene, memory, load, h, base = carried
    linear_terms = scene.linear_terms
    state, springs, work, _ = memory
    same = True
    n = linear_terms.shape[1] - 1
    by_h = 1.0 / h
    square = h * h / 360.0
    ground = 180.0 * load[at.GROUND_2] * square
    third = 2.0 * h * h * load[at.GROUND_3]
    a1_below = bend_below = before = floor = inverse = 0.0
    for i in range(n + 1):
        link = linear_terms[at.LINK, i]
        bend = work[ROW.BEND, i]
        a1 = 12.0 * (0.5 * bend - work[ROW.RISE, i] + h * state[at.VELOCITY, i])
        second = 0.5 * by_h * linear_terms[at.STORY_DAMPER, i] * (a1 - link * a1_below)
        second += 0.5 * (linear_terms[at.GEOMETRIC, i] + springs[at.SLOPE, n + 1 + i]) * (bend - link * bend_below)
        if i > 0:
            work[base + OWN.EVEN, i - 1] = -square * inverse * (before - link * second + floor * a1_below) - ground
        work[base + OWN.A1, i] = a1
        if i < n:
            work[base + OWN.ODD, i] = -a1 / 60.0 - third
            if BENDING:
                same &= (work[ROW.LEFT, i] == 0.0) & same_slope(carried, i)
            if DASHPOTS:
                same &= linear_terms[at.POWER_DAMPER, i] == 0.0
        inverse = linear_terms[at.INVERSE_MASS, i]
        floor = 0.5 * by_h * linear_terms[at.FLOOR_DAMPER, i]
        a1_below = a1
        bend_below = bend
        before = second
    return same


@inlined
def _calm_unbalanced(carried):
    """Minus what the companion's motion leaves out of balance without rise and bend of the error."""
    scene, memory, _, h, base = carried
    linear_terms = scene.linear_terms
    state, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    square = h * h
    by_h = 12.0 / h
    u_below = even_below = odd_below = mean_below = moment_below = 0.0
    for i in range(n + 1):
        link = linear_terms[at.LINK, i]
        mean = moment = u = even = odd = 0.0
        if i < n:
            u = state[at.ERROR_DISPLACEMENT, i]
            even = work[base + OWN.EVEN, i]
            odd = work[base + OWN.ODD, i]
            geometric = linear_terms[at.GEOMETRIC, i]
            stiffness = geometric + springs[at.SLOPE, n + 1 + i]
            bubble = even - link * even_below
            mean = springs[at.FORCE, n + 1 + i] - springs[at.FORCE, i]
            mean += geometric * (u - link * u_below) + stiffness * bubble
            moment = stiffness * (odd - link * odd_below) - by_h * linear_terms[at.STORY_DAMPER, i] * bubble
            if ANY_APART:
                more_mean, more_moment = of_slopes(carried, i)
                mean += more_mean
                moment += more_moment
        if i > 0:
            speed = linear_terms[at.FLOOR_DAMPER, i - 1] * even_below
            speed -= linear_terms[at.MASS, i - 1] * state[at.ERROR_VELOCITY, i - 1]
            work[base + OWN.RISE, i - 1] = -square * (mean_below - link * mean)
            work[base + OWN.BEND, i - 1] = 12.0 * h * speed - square * (moment_below - link * moment)
        u_below, even_below, odd_below = u, even, odd
        mean_below, moment_below = mean, moment
    if MODAL and scene.modal.shape[0] > 0:
        add_modal_force(scene.modal, work, base + OWN.EVEN, 12.0 * h, work, base + OWN.BEND, n)


@called
def _stays_still(scene, h, load, memory, base):
    """Whether all stories of the companion keep to their branches."""
    carried = Carried(scene, memory, load, h, base)
    n = scene.linear_terms.shape[1] - 1
    for i in range(n):
        if surely_keeps(carried, i, story_of(carried, i)):
            continue
        bubbles = bubbles_of(carried, i)
        turned = turns_of(carried, i, bubbles[0])
        if not error_path.keeps(memory.springs, n + 1 + i, whole_path(carried, i), bubbles, turned):
            return False
        if COUNTS_TURNS:
            note_doubt(carried, i, turned, False)
    return True


@inlined
def _commit(carried):
    """The state at the end of the step, all stories on the branches where they are."""
    scene, memory, _, h, base = carried
    state, springs, work, _ = memory
    n = scene.linear_terms.shape[1] - 1
    by_h = 1.0 / h
    below = 0.0
    for i in range(n):
        c = n + 1 + i
        rise = work[ROW.RISE, i] + work[base + OWN.RISE, i]
        advance(
            scene.law_parameters, springs, c, 0, springs[at.DRIFT, c] + rise - scene.linear_terms[at.LINK, i] * below
        )
        below = rise
        state[at.ERROR_DISPLACEMENT, i] += work[base + OWN.RISE, i]
        state[at.ERROR_VELOCITY, i] += by_h * work[base + OWN.BEND, i]
        raise_end(carried, i)
