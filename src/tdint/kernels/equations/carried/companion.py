"""A step of the companion (`tdint.kernels.equations.carried.error`) where stories change their branches, or are curved:
Newton's iteration with the matrix of the run's step."""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.carried.rows import (
    OWN,
    Carried,
    add_loads,
    bubbles_of,
    correct,
    note_doubt,
    of_slopes,
    of_story,
    same_slope,
    story_of,
    surely_keeps,
    turns_of,
    whole_path,
)
from tdint.kernels.equations.carried.within import comes_near, look_within, passes, raise_end, raise_forces
from tdint.kernels.equations.moment4 import ROW
from tdint.kernels.laws.choosing import ANY_APART, COUNTS_TURNS, CURVES
from tdint.kernels.linear_terms import DASHPOTS, MODAL, add_modal_force
from tdint.kernels.march.peaks_between_steps import raise_peak
from tdint.kernels.stepping import Integrals
from tdint.kernels.stories import error_path, path
from tdint.kernels.stories.branches import advance
from tdint.kernels.stories.error_path import RESULT
from tdint.kernels.stories.path import arrive

PASSES = 8  # Newton steps at most
_USUAL = 3  # after these kinks and curves have settled, but dashpots that are all but at rest: tangents change by far


@called
def follow_anew(scene, h, load, memory, base):
    """Rise and bend of the error by Newton's iteration from those that are there, and the companion's new state."""
    carried = Carried(scene, memory, load, h, base)
    linear_terms, _, law_parameters, _, _ = scene
    state, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    for i in range(n):
        work[base + OWN.A1, i] = 12.0 * (0.5 * work[ROW.BEND, i] - work[ROW.RISE, i] + h * state[at.VELOCITY, i])
    left = 0.0
    for passed in range(PASSES):
        _paths(carried, passed > 0 or not CURVES)
        _moments(carried)
        _bubbles(carried)
        add_loads(carried)
        _story_forces(carried)
        _unbalanced(carried)
        left = correct(carried)
        if passed + 1 == _USUAL:
            work[base + OWN.RISE, n] += left
        if left == 0.0 and passed > 0:
            break
    work[base + OWN.CALM, n] += left
    for i in range(n if COUNTS_TURNS else 0):
        if not springs[at.SLOPE, n + 1 + i] < math.inf:
            continue
        c = n + 1 + i
        trial = at.FIRST_TRIAL if work[base + OWN.CALM, i] == 0.0 else 0
        failed = springs[trial + at.SLOPE, c] == 0.0 and springs[trial + at.FORCE, c] == 0.0
        failed = failed and springs[trial + at.TURN, c] == 0.0 and springs[at.FORCE, c] != 0.0
        note_doubt(carried, i, turns_of(carried, i, bubbles_of(carried, i)[0]), failed)
    for i in range(n):
        if work[base + OWN.CALM, i] == 0.0:
            raise_peak(work, base + OWN.PEAKS + at.PEAK_SHEAR, i, work[base + OWN.PATH + RESULT.LARGEST, n + 1 + i])
    if comes_near(carried, False)[0]:
        kind, low, high = passes(scene, h, load, memory, base, False)
        if kind > 0:
            look_within(scene, h, load, memory, base, False, (2 if kind == 2 else 3, low, high))
    below = 0.0
    for i in range(n):
        c = n + 1 + i
        rise = work[ROW.RISE, i] + work[base + OWN.RISE, i]
        gain = rise - linear_terms[at.LINK, i] * below
        below = rise
        if work[base + OWN.CALM, i] != 0.0:
            advance(law_parameters, springs, c, 0, springs[at.DRIFT, c] + gain)
        else:
            if springs[at.SLOPE, c] < math.inf:
                advance(law_parameters, springs, c, at.FIRST_TRIAL, springs[at.DRIFT, c] + gain)
            arrive(law_parameters, springs, c, gain)
        state[at.ERROR_DISPLACEMENT, i] += work[base + OWN.RISE, i]
        state[at.ERROR_VELOCITY, i] += work[base + OWN.BEND, i] / h
        raise_end(carried, i)
    # Where a story leaves its branch its force has a corner, which the moments of the step do not tell.
    raise_forces(scene, h, load, memory, base)


@inlined
def _paths(carried, knowing):
    """Find the stories that are on the same linear branch in both motions, and follow the others, with their bubbles
    where these are known: at first those of linear branches."""
    scene, memory, _, h, base = carried
    _, springs, work, _ = memory
    n = scene.linear_terms.shape[1] - 1
    for i in range(n):
        c = n + 1 + i
        damped = DASHPOTS and scene.linear_terms[at.POWER_DAMPER, i] != 0.0
        calm = work[ROW.LEFT, i] == 0.0 and same_slope(carried, i) and not damped
        if calm and surely_keeps(carried, i, story_of(carried, i)):
            work[base + OWN.CALM, i] = 1.0
            continue
        bubbles = bubbles_of(carried, i) if knowing else (0.0, 0.0)
        turned = turns_of(carried, i, bubbles[0])
        whole = whole_path(carried, i)
        if calm and error_path.keeps(springs, c, whole, bubbles, turned):
            work[base + OWN.CALM, i] = 1.0
            continue
        work[base + OWN.CALM, i] = 0.0
        results = Integrals(work, base + OWN.PATH)
        error_path.follow(scene.law_parameters, springs, c, whole, bubbles, turned, results)
        if damped:
            error_path.add_dashpot(scene.linear_terms, i, h, whole, of_story(carried, base + OWN.A1, i), results, c)


@inlined
def _moments(carried):
    """Second and third moment of the story forces, dampers included."""
    scene, memory, _, h, base = carried
    _, springs, work, _ = memory
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    for i in range(n):
        bend = of_story(carried, ROW.BEND, i)
        second = (
            linear_terms[at.STORY_DAMPER, i] / h * of_story(carried, base + OWN.A1, i)
            + linear_terms[at.GEOMETRIC, i] * bend
        )
        third = 0.0
        if work[base + OWN.CALM, i] != 0.0:
            second += springs[at.SLOPE, n + 1 + i] * bend
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
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    square = h * h
    work[base + OWN.SECOND, n] = 0.0
    work[base + OWN.THIRD, n] = 0.0
    for i in range(n):
        link = linear_terms[at.LINK, i + 1]
        a1 = work[base + OWN.A1, i]
        inverse = linear_terms[at.INVERSE_MASS, i]
        second = work[base + OWN.SECOND, i] - link * work[base + OWN.SECOND, i + 1]
        second += 0.5 / h * linear_terms[at.FLOOR_DAMPER, i] * a1
        third = work[base + OWN.THIRD, i] - link * work[base + OWN.THIRD, i + 1]
        work[base + OWN.EVEN, i] = -square / 360.0 * (second * inverse + 180.0 * load[at.GROUND_2])
        work[base + OWN.ODD, i] = -a1 / 60.0 - 2.0 * square * (third * inverse + load[at.GROUND_3])


@inlined
def _story_forces(carried):
    """What mean and moment of the stories' forces, dampers included, are more than the run's."""
    scene, memory, _, h, base = carried
    state, springs, work, _ = memory
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    below = 0.0
    for i in range(n):
        c = n + 1 + i
        u = state[at.ERROR_DISPLACEMENT, i]
        rise, bend = of_story(carried, base + OWN.RISE, i), of_story(carried, base + OWN.BEND, i)
        even, odd = of_story(carried, base + OWN.EVEN, i), of_story(carried, base + OWN.ODD, i)
        geometric = linear_terms[at.GEOMETRIC, i]
        damper = linear_terms[at.STORY_DAMPER, i] / h
        mean = geometric * (u - linear_terms[at.LINK, i] * below + 0.5 * rise - bend / 12.0 + even) + damper * rise
        moment = geometric * (rise + odd) + damper * (bend - 12.0 * even)
        if work[base + OWN.CALM, i] != 0.0:
            slope = springs[at.SLOPE, c]
            mean += springs[at.FORCE, c] - springs[at.FORCE, i] + slope * (0.5 * rise - bend / 12.0 + even)
            moment += slope * (rise + odd)
            if ANY_APART:
                more_mean, more_moment = of_slopes(carried, i)
                mean += more_mean
                moment += more_moment
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
    linear_terms = scene.linear_terms
    rise, bend = of_story(carried, ROW.RISE, i), of_story(carried, ROW.BEND, i)
    if work[ROW.LEFT, i] == 0.0 and not (DASHPOTS and linear_terms[at.POWER_DAMPER, i] != 0.0):
        slope = springs[at.SLOPE, i]
        return springs[at.FORCE, i] + slope * (0.5 * rise - bend / 12.0), slope * rise
    geometric = linear_terms[at.GEOMETRIC, i]
    damper = linear_terms[at.STORY_DAMPER, i] / h
    middle = springs[at.DRIFT, i] + 0.5 * rise - bend / 12.0
    mean = work[ROW.PATH + path.MEAN, i] - geometric * middle - damper * rise
    return mean, work[ROW.PATH + path.MOMENT, i] - geometric * rise - damper * bend


@inlined
def _unbalanced(carried):
    """Minus what the companion's motion leaves out of balance."""
    scene, memory, _, h, base = carried
    state, _, work, _ = memory
    linear_terms, modal = scene.linear_terms, scene.modal
    n = linear_terms.shape[1] - 1
    square = h * h
    work[base + OWN.MEAN, n] = 0.0
    work[base + OWN.MOMENT, n] = 0.0
    for i in range(n):
        link = linear_terms[at.LINK, i + 1]
        mass = linear_terms[at.MASS, i]
        floor = h * linear_terms[at.FLOOR_DAMPER, i]
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
