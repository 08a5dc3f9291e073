"""Motion of all floors over a step of moment4: impulse and first moment of the equation of motion.

Unknowns are the floors' rise D0 = h U0 = u1 - u0 and bend D1 = h U1 of their parabolas;
`tdint.methods.moment4` gives the equations. Times h^2 they read

    M a0 + h C D0 + h^2 (F0 - P0) = 0                          impulse
    M a1 + h C D1 + h^2 (F1 - P1) + h^2 r K D1 = 0             first moment
    a1 = (D1 / 2 - D0 + h v0) 12 / (1 + 6 r),   a0 = D1 - r a1

with the means F0 and moments F1 of `tdint.kernels.stories.path`, and K the initial stiffness.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.iteration import (
    MAX_ITERATIONS,
    ROUNDING,
    TANGENT_TOLERANCE,
    add_rows,
    is_balanced,
    must_halve,
)
from tdint.kernels.equations.tridiagonal import (
    COUPLING_ROWS,
    ModalBlocks,
    factor_blocks,
    link_blocks,
    solve_blocks_damped,
)
from tdint.kernels.laws.choosing import BENDING
from tdint.kernels.linear_terms import DASHPOTS, MODAL, add_modal_force, power_damper
from tdint.kernels.stepping import Factors
from tdint.kernels.stories import path
from tdint.kernels.stories.branches import advance
from tdint.kernels.stories.dashpot_path import follow_dashpot
from tdint.kernels.stories.path import arrive, follow, keep_to_branch, stays, turns, turns_surely

# Coefficients
R = 0  # of dissipation
BY_RISE = 1  # 12 / (1 + 6 r)


MOST_CORNERS = 6  # in a step, at which it is looked closely
_NODES = 2 * MOST_CORNERS + 3


class _Rows(NamedTuple):
    """Rows of work."""

    LOAD: int = 2  # P0, then P1
    RISE: int = 1
    BEND: int = 1
    A0: int = 1  # a0 and a1 as in the equations above
    A1: int = 1
    X: int = 2  # residuals, then corrections, of the rises, then the bends
    CORRECTION: int = 2  # likewise
    SIZE: int = 1  # of what the displacements round, as a force
    LEFT: int = 1  # 1 if the story leaves its branch; in the last column if any does
    STEADY: int = 1  # 1 if the story does not turn in the step, even if its parabola does
    PATH: int = path.PATH_ROWS
    DASHPOT: int = 2  # mean and moment of the power-law dashpot's force
    FACTORED: int = 4  # tangents; the step stands in the last column
    BLOCKS: int = 4
    COUPLING: int = COUPLING_ROWS
    CORNERS: int = 1 + MOST_CORNERS  # how many the stories' forces have in the step, and when
    # of the stories at the nodes of `corners`, then total shears; their times in column n
    FORCES: int = _NODES
    MOTION: int = _NODES  # absolute accelerations of the floors there
    WAYS: int = _NODES  # of the floors from the start of the step
    RATES: int = _NODES  # h times their velocities
    OTHER: int = 1  # modal damping
    PEAKS: int = 2 * at.PEAK_ROWS  # of the run, beside which those at corners are looked for


ROW, STORE = at.chained(_Rows)

_BY_SLOPE = (
    0.5,
    -1.0 / 12.0,
    1.0,
    0.0,
)  # tangents of a linear branch over its slope: of mean and moment

# solves until what stories have decided is kept: one that goes on changing it would never balance
_DECIDING = 4

CLOSE = 1e-13
"""Out of balance over the sum of the sizes of the terms: the energy balance is to close."""


def work_rows(modes: int) -> int:
    """Rows of work that the step needs for a building with `modes` modally damped modes."""
    return STORE + 6 * modes + 1


@inlined
def move(coefficients, scene, h, memory):
    """Motion over the step; returns the number of solves, or NOT_CONVERGED.

    Where all laws are linear on their branches, the first solve is that of the branches on which
    the stories are: in a linear building the only one. Otherwise Newton's iteration with the
    complete tangents. A correction that does not bring the equations closer to balance is halved.
    """
    linear_terms, modal, law_parameters, _, flags = scene
    state, _, work, report = memory
    n = linear_terms.shape[1] - 1
    iterations = 0
    part = 1.0
    before = math.inf
    last = False
    if flags[at.BRANCHES] == at.ALL_BRANCHES:
        before = _keep_to_branches(coefficients, scene, h, memory)
        iterations = 1
        if not BENDING or flags[at.LINEAR] != 0.0:
            return iterations
    else:
        _guess(h, state, work, n)
    while BENDING:
        stale = _stories(coefficients, scene, h, memory, iterations <= _DECIDING)
        size = _residuals(coefficients, linear_terms, modal, h, state, work)
        failing = iterations == MAX_ITERATIONS or not size < math.inf
        if last or _in_balance(failing, coefficients, linear_terms, h, state, work, report):
            break
        if must_halve(size, before, part):
            part *= 0.5
            add_rows(-part, work, ROW.CORRECTION, ROW.RISE, 2, n)
            continue
        if failing:
            return at.NOT_CONVERGED
        if stale:
            _factor(coefficients, linear_terms, modal, law_parameters, h, work)
        solve(modal, h, work, ROW.X, n)
        last = _correct(state, work, n)
        iterations += 1
        before = size
        part = 1.0
    return iterations


@inlined
def _keep_to_branches(coefficients, scene, h, memory):
    """Motion with all stories on their present linear branches: one solve, from no motion at all,
    which is also the correction. Returns the size of what that left out of balance."""
    linear_terms, modal, law_parameters, _, _ = scene
    state, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    stale = work[ROW.FACTORED, n] != h
    for i in range(n):
        slope = springs[at.SLOPE, i]
        same = TANGENT_TOLERANCE * law_parameters[at.STIFFNESS, i]
        for row in range(4):
            stale |= abs(work[ROW.FACTORED + row, i] - _BY_SLOPE[row] * slope) > same
        work[ROW.PATH + path.MEAN, i] = (
            springs[at.FORCE, i] + linear_terms[at.GEOMETRIC, i] * springs[at.DRIFT, i]
        )
        work[ROW.LEFT, i] = 0.0
    size = 0.0
    for i in range(n):
        mean = (
            work[ROW.PATH + path.MEAN, i]
            - linear_terms[at.LINK, i + 1] * work[ROW.PATH + path.MEAN, i + 1]
            - work[ROW.LOAD, i]
        )
        inertia = linear_terms[at.MASS, i] * coefficients[BY_RISE] * h * state[at.VELOCITY, i]
        by_rise = coefficients[R] * inertia - h * h * mean
        by_bend = h * h * work[ROW.LOAD + 1, i] - inertia
        work[ROW.X, i] = by_rise
        work[ROW.X + 1, i] = by_bend
        if BENDING:
            size += linear_terms[at.INVERSE_MASS, i] * (
                by_rise * by_rise + by_bend * by_bend / 12.0
            )
    if stale:
        for i in range(n):
            for row in range(4):
                work[ROW.PATH + path.MEAN_BY_RISE + row, i] = _BY_SLOPE[row] * springs[at.SLOPE, i]
        _factor(coefficients, linear_terms, modal, law_parameters, h, work)
    solve(modal, h, work, ROW.X, n)
    for row in range(2):
        for i in range(n):
            work[ROW.CORRECTION + row, i] = work[ROW.X + row, i]
            work[ROW.RISE + row, i] = work[ROW.X + row, i]
    return size


@inlined
def _guess(h, state, work, n):
    """Constant acceleration, that of the end of the step before."""
    for i in range(n):
        work[ROW.BEND, i] = h * h * state[at.ACCELERATION, i]
        work[ROW.RISE, i] = h * state[at.VELOCITY, i] + 0.5 * work[ROW.BEND, i]


@inlined
def _stories(coefficients, scene, h, memory, deciding):
    """Means, moments and tangents of the stories, dampers included, for the present motion. True if
    the factorization does not fit the tangents. Whether a story turns is decided anew only if
    `deciding`."""
    linear_terms, _, law_parameters, _, _ = scene
    state, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    stale = work[ROW.FACTORED, n] != h
    rise_below = 0.0
    bend_below = 0.0
    size_below = 0.0
    work[ROW.LEFT, n] = 0.0
    for i in range(n):
        link = linear_terms[at.LINK, i]
        rise = work[ROW.RISE, i] - link * rise_below
        bend = work[ROW.BEND, i] - link * bend_below
        rise_below = work[ROW.RISE, i]
        bend_below = work[ROW.BEND, i]
        if stays(springs, i, rise, bend):
            work[ROW.LEFT, i] = 0.0
            work[ROW.STEADY, i] = 0.0
            keep_to_branch(springs, i, rise, bend, work, ROW.PATH)
        else:
            work[ROW.LEFT, i] = 1.0
            work[ROW.LEFT, n] = 1.0
            if deciding:
                doubtful = 2.0 * abs(rise) < abs(bend) and springs[at.SLOPE, i] < math.inf
                work[ROW.STEADY, i] = (
                    1.0 if doubtful and _steady(coefficients, scene, h, memory, i) else 0.0
                )
            follow(
                law_parameters, springs, i, rise, bend, work[ROW.STEADY, i] != 0.0, work, ROW.PATH
            )
        if DASHPOTS and linear_terms[at.POWER_DAMPER, i] != 0.0:
            follow_dashpot(linear_terms, i, h, rise, bend, work, ROW.PATH, ROW.DASHPOT)
        same = TANGENT_TOLERANCE * law_parameters[at.STIFFNESS, i]
        for row in range(4):
            change = abs(work[ROW.PATH + path.MEAN_BY_RISE + row, i] - work[ROW.FACTORED + row, i])
            stale |= change > same
        geometric = linear_terms[at.GEOMETRIC, i]
        damper = linear_terms[at.STORY_DAMPER, i] / h
        drift = springs[at.DRIFT, i]
        stiffness = coefficients[R] * (law_parameters[at.STIFFNESS, i] + geometric)
        work[ROW.PATH + path.MEAN, i] += (
            geometric * (drift + 0.5 * rise - bend / 12.0) + damper * rise
        )
        work[ROW.PATH + path.MOMENT, i] += geometric * rise + (damper + stiffness) * bend
        # A drift is a difference: what the displacements round is not out of balance.
        size = abs(state[at.DISPLACEMENT, i]) + abs(rise_below)
        work[ROW.SIZE, i] = (
            ROUNDING / CLOSE * law_parameters[at.STIFFNESS, i] * (size + link * size_below)
        )
        size_below = size
    return stale


@called
def _steady(coefficients, scene, h, memory, i):
    """Whether story `i`, whose parabola turns, does not by its rate: that of the state at both
    ends, and what the equations of motion tell it to gain at the start. Without that the upper
    stories of a building at rest, whose rates grow with the third power of time, would seem to set
    out backwards."""
    linear_terms = scene.linear_terms
    state, _, work, _ = memory
    rise = first = last = 0.0
    floors = 2 if i > 0 and linear_terms[at.LINK, i] != 0.0 else 1
    for below in range(floors):
        j = i - below
        sign = 1.0 - 2.0 * below
        rate = h * state[at.VELOCITY, j]
        a1 = coefficients[BY_RISE] * (0.5 * work[ROW.BEND, j] - work[ROW.RISE, j] + rate)
        rise += sign * work[ROW.RISE, j]
        first += sign * rate
        last += sign * (rate + work[ROW.BEND, j] - coefficients[R] * a1)
    if turns_surely(rise, first, last):
        return False
    start = (
        h
        * h
        * (
            _acceleration(scene, memory, i)
            - (_acceleration(scene, memory, i - 1) if floors == 2 else 0.0)
        )
    )
    side, turn, _, _, _ = turns(rise, first, last, start)
    return turn == 1.0 and rise * side > 0.0


@inlined
def _acceleration(scene, memory, i):
    """Acceleration of floor `i` at the start of the step, relative to the ground."""
    linear_terms, modal, _, _, _ = scene
    state, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    force = work[ROW.LOAD, i] - 0.5 * work[ROW.LOAD + 1, i]
    force -= linear_terms[at.FLOOR_DAMPER, i] * state[at.VELOCITY, i]
    for j in range(modal.shape[0] if MODAL else 0):
        amplitude = 0.0
        for k in range(n):
            amplitude += modal[j, k] * state[at.VELOCITY, k]
        force -= amplitude * modal[j, i]
    for above in range(2):
        j = i + above
        if j < n:
            link = linear_terms[at.LINK, j]
            rate = state[at.VELOCITY, j] - link * state[at.VELOCITY, max(j - 1, 0)]
            story = springs[at.FORCE, j] + linear_terms[at.GEOMETRIC, j] * springs[at.DRIFT, j]
            story += (
                linear_terms[at.STORY_DAMPER, j] * rate + power_damper(linear_terms, j, rate)[0]
            )
            force += story * link if above else -story
    return linear_terms[at.INVERSE_MASS, i] * force


@inlined
def _residuals(coefficients, linear_terms, modal, h, state, work):
    """Minus the residuals of both equations into their rows; returns their size."""
    n = linear_terms.shape[1] - 1
    for i in range(n):
        work[ROW.X, i] = 0.0
        work[ROW.X + 1, i] = 0.0
    add_modal_force(modal, work, ROW.RISE, -h, work, ROW.X, n)
    add_modal_force(modal, work, ROW.BEND, -h, work, ROW.X + 1, n)
    total = 0.0
    for i in range(n):
        link = linear_terms[at.LINK, i + 1]
        rise = work[ROW.RISE, i]
        bend = work[ROW.BEND, i]
        a1 = coefficients[BY_RISE] * (0.5 * bend - rise + h * state[at.VELOCITY, i])
        a0 = bend - coefficients[R] * a1
        work[ROW.A0, i] = a0
        work[ROW.A1, i] = a1
        floor = h * linear_terms[at.FLOOR_DAMPER, i]
        mean = (
            work[ROW.PATH + path.MEAN, i]
            - link * work[ROW.PATH + path.MEAN, i + 1]
            - work[ROW.LOAD, i]
        )
        moment = (
            work[ROW.PATH + path.MOMENT, i]
            - link * work[ROW.PATH + path.MOMENT, i + 1]
            - work[ROW.LOAD + 1, i]
        )
        work[ROW.X, i] -= linear_terms[at.MASS, i] * a0 + floor * rise + h * h * mean
        work[ROW.X + 1, i] -= linear_terms[at.MASS, i] * a1 + floor * bend + h * h * moment
        squares = work[ROW.X, i] * work[ROW.X, i] + work[ROW.X + 1, i] * work[ROW.X + 1, i] / 12.0
        total += linear_terms[at.INVERSE_MASS, i] * squares
    return total


@inlined
def _in_balance(last, coefficients, linear_terms, h, state, work, report):
    """Whether the residuals are small beside the terms of their equations. At the last of them the
    worst is noted."""
    report[at.RESIDUAL] = 0.0
    small = True
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[at.LINK, i + 1]
        mass = linear_terms[at.MASS, i]
        rounding = work[ROW.SIZE, i] + link * work[ROW.SIZE, i + 1]
        forces = (
            abs(work[ROW.PATH + path.MEAN, i])
            + link * abs(work[ROW.PATH + path.MEAN, i + 1])
            + abs(work[ROW.LOAD, i])
        )
        inner = abs(work[ROW.BEND, i]) + coefficients[R] * abs(work[ROW.A1, i])
        small &= is_balanced(
            last, CLOSE, report, i, work[ROW.X, i], mass * inner + h * h * (forces + rounding)
        )
        forces = (
            abs(work[ROW.PATH + path.MOMENT, i])
            + link * abs(work[ROW.PATH + path.MOMENT, i + 1])
            + abs(work[ROW.LOAD + 1, i])
        )
        inner = abs(work[ROW.BEND, i]) + abs(work[ROW.RISE, i]) + h * abs(state[at.VELOCITY, i])
        inner *= coefficients[BY_RISE]
        small &= is_balanced(
            last, CLOSE, report, i, work[ROW.X + 1, i], mass * inner + h * h * (forces + rounding)
        )
    return small


@inlined
def _correct(state, work, n):
    """Add the corrections. True if they are rounding."""
    small = True
    for i in range(n):
        for row in range(2):
            work[ROW.CORRECTION + row, i] = work[ROW.X + row, i]
            work[ROW.RISE + row, i] += work[ROW.X + row, i]
        size = abs(state[at.DISPLACEMENT, i]) + abs(work[ROW.RISE, i]) + abs(work[ROW.BEND, i])
        small = small and abs(work[ROW.X, i]) + abs(work[ROW.X + 1, i]) <= ROUNDING * size
    return small


@called
def _factor(coefficients, linear_terms, modal, law_parameters, h, work):
    """Factor the Newton matrix for the present tangents."""
    n = linear_terms.shape[1] - 1
    square = h * h
    for i in range(n):
        mass = linear_terms[at.MASS, i]
        floor = h * linear_terms[at.FLOOR_DAMPER, i]
        geometric = linear_terms[at.GEOMETRIC, i]
        damper = h * linear_terms[at.STORY_DAMPER, i]
        numerical = coefficients[R] * (law_parameters[at.STIFFNESS, i] + geometric)
        for row in range(4):
            work[ROW.FACTORED + row, i] = work[ROW.PATH + path.MEAN_BY_RISE + row, i]
        work[ROW.COUPLING, i] = (
            square * (work[ROW.PATH + path.MEAN_BY_RISE, i] + 0.5 * geometric) + damper
        )
        work[ROW.COUPLING + 1, i] = square * (
            work[ROW.PATH + path.MEAN_BY_BEND, i] - geometric / 12.0
        )
        work[ROW.COUPLING + 2, i] = square * (work[ROW.PATH + path.MOMENT_BY_RISE, i] + geometric)
        work[ROW.COUPLING + 3, i] = (
            square * (work[ROW.PATH + path.MOMENT_BY_BEND, i] + numerical) + damper
        )
        by_rise = mass * coefficients[BY_RISE]
        work[ROW.BLOCKS, i] = coefficients[R] * by_rise + floor + work[ROW.COUPLING, i]
        work[ROW.BLOCKS + 1, i] = mass - 0.5 * coefficients[R] * by_rise + work[ROW.COUPLING + 1, i]
        work[ROW.BLOCKS + 2, i] = work[ROW.COUPLING + 2, i] - by_rise
        work[ROW.BLOCKS + 3, i] = 0.5 * by_rise + floor + work[ROW.COUPLING + 3, i]
    work[ROW.FACTORED, n] = h
    factors = Factors(work, ROW.BLOCKS, ROW.COUPLING, STORE)
    link_blocks(linear_terms, factors, n)
    factor_blocks(factors, ModalBlocks(modal, h, 0.0, 0.0, h), n)


@inlined
def solve(modal, h, work, x, n):
    """Corrections, or the motion, from the residuals, in their place: rows `x` and `x` + 1."""
    factors = Factors(work, ROW.BLOCKS, ROW.COUPLING, STORE)
    solve_blocks_damped(factors, ModalBlocks(modal, h, 0.0, 0.0, h), x, x + 1, n)


@inlined
def finish(coefficients, scene, h, memory):
    """Update the state, and the work done by the load and the dampers along the paths."""
    linear_terms, modal, law_parameters, _, flags = scene
    state, springs, work, report = memory
    n = linear_terms.shape[1] - 1
    by_h = 1.0 / h
    by_rise = 0.0
    by_bend = 0.0
    damped_rise = 0.0
    damped_bend = 0.0
    rise_below = 0.0
    bend_below = 0.0
    for i in range(n):
        rise = work[ROW.RISE, i]
        bend = work[ROW.BEND, i]
        a1 = coefficients[BY_RISE] * (0.5 * bend - rise + h * state[at.VELOCITY, i])
        a0 = bend - coefficients[R] * a1
        by_rise += rise * work[ROW.LOAD, i]
        by_bend += bend * work[ROW.LOAD + 1, i]
        damped_rise += linear_terms[at.FLOOR_DAMPER, i] * rise * rise
        damped_bend += linear_terms[at.FLOOR_DAMPER, i] * bend * bend
        state[at.DISPLACEMENT, i] += rise
        state[at.VELOCITY, i] += by_h * a0
        state[at.ACCELERATION, i] = by_h * by_h * (a0 + 0.5 * a1)
        rise -= linear_terms[at.LINK, i] * rise_below
        bend -= linear_terms[at.LINK, i] * bend_below
        rise_below = work[ROW.RISE, i]
        bend_below = work[ROW.BEND, i]
        damped_rise += linear_terms[at.STORY_DAMPER, i] * rise * rise
        damped_bend += linear_terms[at.STORY_DAMPER, i] * bend * bend
        if not BENDING or work[ROW.LEFT, i] == 0.0:
            advance(law_parameters, springs, i, 0, springs[at.DRIFT, i] + rise)
        else:
            arrive(law_parameters, springs, i, rise)
    damped = by_h * (damped_rise + damped_bend / 12.0)
    if MODAL and modal.shape[0] > 0:
        damped += _modal_work(modal, h, work, n)
    if DASHPOTS and flags[at.POWER_DAMPERS] != 0.0:
        damped += _dashpot_work(linear_terms, work, n)
    report[at.WORK_INPUT] = by_rise + by_bend / 12.0
    report[at.WORK_DAMPED] = damped


@called
def _modal_work(modal, h, work, n):
    """Work of modal damping along the paths."""
    total = 0.0
    for j in range(modal.shape[0]):
        rise = 0.0
        bend = 0.0
        for i in range(n):
            rise += modal[j, i] * work[ROW.RISE, i]
            bend += modal[j, i] * work[ROW.BEND, i]
        total += (rise * rise + bend * bend / 12.0) / h
    return total


@called
def _dashpot_work(linear_terms, work, n):
    """Work of the power-law dashpots along the paths."""
    total = 0.0
    rise_below = 0.0
    bend_below = 0.0
    for i in range(n):
        rise = work[ROW.RISE, i] - linear_terms[at.LINK, i] * rise_below
        bend = work[ROW.BEND, i] - linear_terms[at.LINK, i] * bend_below
        rise_below = work[ROW.RISE, i]
        bend_below = work[ROW.BEND, i]
        if linear_terms[at.POWER_DAMPER, i] != 0.0:
            total += rise * work[ROW.DASHPOT, i] + bend * work[ROW.DASHPOT + 1, i] / 12.0
    return total
