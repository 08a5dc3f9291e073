"""Motion of all floors over a step of moment4: impulse and first moment of the equation of motion.

Unknowns are the floors' rise D0 = h U0 = u1 - u0 and bend D1 = h U1 of their parabolas; `tdint.methods.moment4` gives
the equations. Times h^2 they read

    M a0 + h C D0 + h^2 (F0 - P0) = 0                          impulse
    M a1 + h C D1 + h^2 (F1 - P1) + h^2 r K D1 = 0             first moment
    a1 = (D1 / 2 - D0 + h v0) 12 / (1 + 6 r),   a0 = D1 - r a1

with the means F0 and moments F1 of `tdint.kernels.stories.path`, and K the initial stiffness.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.chain import DASHPOTS, MODAL, add_modal_force
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.halving import add_rows, too_far
from tdint.kernels.equations.tridiagonal import COUPLING_ROWS, factor_blocks, link_blocks, solve_blocks_damped
from tdint.kernels.laws.choosing import BENDING
from tdint.kernels.stepping import ITERATIONS, SAME_TANGENT, SMALL, balanced
from tdint.kernels.stories.branches import advance
from tdint.kernels.stories.dashpot_path import follow_dashpot
from tdint.kernels.stories.path import (
    MEAN,
    MEAN_BY_BEND,
    MEAN_BY_RISE,
    MOMENT,
    MOMENT_BY_BEND,
    MOMENT_BY_RISE,
    PATH_ROWS,
    arrive,
    follow,
    keep_to_branch,
    stays,
)

# Coefficients
R = 0  # of dissipation
BY_RISE = 1  # 12 / (1 + 6 r)

# Rows of work
LOAD = 0  # P0, then P1
RISE = 2
BEND = 3
A0 = 4  # a0 and a1 as in the equations above
A1 = 5
_X = 6  # residuals, then corrections, of the rises, then the bends
_CORRECTION = 8  # likewise
_SIZE = 10  # of what the displacements round, as a force
_LEFT = 11  # 1 if the story leaves its branch
_PATH = 12
_DASHPOT = _PATH + PATH_ROWS  # mean and moment of the power-law dashpot's force
_FACTORED = _DASHPOT + 2  # tangents; the step stands in the last column
_BLOCKS = _FACTORED + 4
_COUPLING = _BLOCKS + 4
_STORE = _COUPLING + COUPLING_ROWS

_BY_SLOPE = (0.5, -1.0 / 12.0, 1.0, 0.0)  # tangents of a linear branch over its slope: of mean and moment

CLOSE = 1e-13
"""Out of balance over the sum of the sizes of the terms: the energy balance is to close."""


def work_rows(modes: int) -> int:
    """Rows of work that the step needs for a building with `modes` modally damped modes."""
    return _STORE + 6 * modes + 1


@inlined
def move(coefficients, chain, modal, laws, h, state, springs, work, memo):
    """Motion over the step; returns the number of solves, or NOT_CONVERGED.

    Where all laws are linear on their branches, the first solve is that of the branches on which the stories are: in a
    linear building the only one. Otherwise Newton's iteration with the complete tangents. A correction that does not
    bring the equations closer to balance is halved.
    """
    n = chain.shape[1] - 1
    iterations = 0
    part = 1.0
    before = math.inf
    last = False
    if memo[at.BRANCHES] == at.ALL_BRANCHES:
        before = _keep_to_branches(coefficients, chain, modal, laws, h, state, springs, work)
        iterations = 1
        if not BENDING or memo[at.LINEAR] != 0.0:
            return iterations
    else:
        _guess(h, state, work, n)
    while BENDING:
        stale = _stories(coefficients, chain, laws, h, state, springs, work)
        size = _residuals(coefficients, chain, modal, h, state, work)
        failing = iterations == ITERATIONS or not size < math.inf
        if last or _in_balance(failing, coefficients, chain, h, state, work, memo):
            break
        if too_far(size, before, part):
            part *= 0.5
            add_rows(-part, work, _CORRECTION, RISE, 2, n)
            continue
        if failing:
            return at.NOT_CONVERGED
        if stale:
            _factor(coefficients, chain, modal, laws, h, work)
        solve_blocks_damped(work, _BLOCKS, _COUPLING, modal, h, 0.0, 0.0, h, _STORE, _X, _X + 1, n)
        last = _correct(state, work, n)
        iterations += 1
        before = size
        part = 1.0
    return iterations


@inlined
def _keep_to_branches(coefficients, chain, modal, laws, h, state, springs, work):
    """Motion with all stories on their present linear branches: one solve, from no motion at all, which is also the
    correction. Returns the size of what that left out of balance."""
    n = chain.shape[1] - 1
    stale = work[_FACTORED, n] != h
    for i in range(n):
        slope = springs[at.SLOPE, i]
        same = SAME_TANGENT * laws[at.STIFFNESS, i]
        for row in range(4):
            stale |= abs(work[_FACTORED + row, i] - _BY_SLOPE[row] * slope) > same
        work[_PATH + MEAN, i] = springs[at.FORCE, i] + chain[at.GEOMETRIC, i] * springs[at.DRIFT, i]
        work[_LEFT, i] = 0.0
    size = 0.0
    for i in range(n):
        mean = work[_PATH + MEAN, i] - chain[at.LINK, i + 1] * work[_PATH + MEAN, i + 1] - work[LOAD, i]
        inertia = chain[at.MASS, i] * coefficients[BY_RISE] * h * state[at.VELOCITY, i]
        by_rise = coefficients[R] * inertia - h * h * mean
        by_bend = h * h * work[LOAD + 1, i] - inertia
        work[_X, i] = by_rise
        work[_X + 1, i] = by_bend
        if BENDING:
            size += chain[at.INVERSE_MASS, i] * (by_rise * by_rise + by_bend * by_bend / 12.0)
    if stale:
        for i in range(n):
            for row in range(4):
                work[_PATH + MEAN_BY_RISE + row, i] = _BY_SLOPE[row] * springs[at.SLOPE, i]
        _factor(coefficients, chain, modal, laws, h, work)
    solve_blocks_damped(work, _BLOCKS, _COUPLING, modal, h, 0.0, 0.0, h, _STORE, _X, _X + 1, n)
    for row in range(2):
        for i in range(n):
            work[_CORRECTION + row, i] = work[_X + row, i]
            work[RISE + row, i] = work[_X + row, i]
    return size


@inlined
def _guess(h, state, work, n):
    """Constant acceleration, that of the end of the step before."""
    for i in range(n):
        work[BEND, i] = h * h * state[at.ACCELERATION, i]
        work[RISE, i] = h * state[at.VELOCITY, i] + 0.5 * work[BEND, i]


@inlined
def _stories(coefficients, chain, laws, h, state, springs, work):
    """Means, moments and tangents of the stories, dampers included, for the present motion. True if the factorization
    does not fit the tangents."""
    n = chain.shape[1] - 1
    stale = work[_FACTORED, n] != h
    rise_below = 0.0
    bend_below = 0.0
    size_below = 0.0
    for i in range(n):
        link = chain[at.LINK, i]
        rise = work[RISE, i] - link * rise_below
        bend = work[BEND, i] - link * bend_below
        rise_below = work[RISE, i]
        bend_below = work[BEND, i]
        if stays(springs, i, rise, bend):
            work[_LEFT, i] = 0.0
            keep_to_branch(springs, i, rise, bend, work, _PATH)
        else:
            work[_LEFT, i] = 1.0
            follow(laws, springs, i, rise, bend, work, _PATH)
        if DASHPOTS and chain[at.POWER_DAMPER, i] != 0.0:
            follow_dashpot(chain, i, h, rise, bend, work, _PATH, _DASHPOT)
        same = SAME_TANGENT * laws[at.STIFFNESS, i]
        for row in range(4):
            change = abs(work[_PATH + MEAN_BY_RISE + row, i] - work[_FACTORED + row, i])
            stale |= change > same
        geometric = chain[at.GEOMETRIC, i]
        damper = chain[at.STORY_DAMPER, i] / h
        drift = springs[at.DRIFT, i]
        stiffness = coefficients[R] * (laws[at.STIFFNESS, i] + geometric)
        work[_PATH + MEAN, i] += geometric * (drift + 0.5 * rise - bend / 12.0) + damper * rise
        work[_PATH + MOMENT, i] += geometric * rise + (damper + stiffness) * bend
        # A drift is a difference: what the displacements round is not out of balance.
        size = abs(state[at.DISPLACEMENT, i]) + abs(rise_below)
        work[_SIZE, i] = SMALL / CLOSE * laws[at.STIFFNESS, i] * (size + link * size_below)
        size_below = size
    return stale


@inlined
def _residuals(coefficients, chain, modal, h, state, work):
    """Minus the residuals of both equations into their rows; returns their size."""
    n = chain.shape[1] - 1
    for i in range(n):
        work[_X, i] = 0.0
        work[_X + 1, i] = 0.0
    add_modal_force(modal, work, RISE, -h, work, _X, n)
    add_modal_force(modal, work, BEND, -h, work, _X + 1, n)
    total = 0.0
    for i in range(n):
        link = chain[at.LINK, i + 1]
        rise = work[RISE, i]
        bend = work[BEND, i]
        a1 = coefficients[BY_RISE] * (0.5 * bend - rise + h * state[at.VELOCITY, i])
        a0 = bend - coefficients[R] * a1
        work[A0, i] = a0
        work[A1, i] = a1
        floor = h * chain[at.FLOOR_DAMPER, i]
        mean = work[_PATH + MEAN, i] - link * work[_PATH + MEAN, i + 1] - work[LOAD, i]
        moment = work[_PATH + MOMENT, i] - link * work[_PATH + MOMENT, i + 1] - work[LOAD + 1, i]
        work[_X, i] -= chain[at.MASS, i] * a0 + floor * rise + h * h * mean
        work[_X + 1, i] -= chain[at.MASS, i] * a1 + floor * bend + h * h * moment
        squares = work[_X, i] * work[_X, i] + work[_X + 1, i] * work[_X + 1, i] / 12.0
        total += chain[at.INVERSE_MASS, i] * squares
    return total


@inlined
def _in_balance(last, coefficients, chain, h, state, work, memo):
    """Whether the residuals are small beside the terms of their equations. At the last of them the worst is noted."""
    memo[at.RESIDUAL] = 0.0
    small = True
    for i in range(chain.shape[1] - 1):
        link = chain[at.LINK, i + 1]
        mass = chain[at.MASS, i]
        rounding = work[_SIZE, i] + link * work[_SIZE, i + 1]
        forces = abs(work[_PATH + MEAN, i]) + link * abs(work[_PATH + MEAN, i + 1]) + abs(work[LOAD, i])
        inner = abs(work[BEND, i]) + coefficients[R] * abs(work[A1, i])
        small &= balanced(last, CLOSE, memo, i, work[_X, i], mass * inner + h * h * (forces + rounding))
        forces = abs(work[_PATH + MOMENT, i]) + link * abs(work[_PATH + MOMENT, i + 1]) + abs(work[LOAD + 1, i])
        inner = abs(work[BEND, i]) + abs(work[RISE, i]) + h * abs(state[at.VELOCITY, i])
        inner *= coefficients[BY_RISE]
        small &= balanced(last, CLOSE, memo, i, work[_X + 1, i], mass * inner + h * h * (forces + rounding))
    return small


@inlined
def _correct(state, work, n):
    """Add the corrections. True if they are rounding."""
    small = True
    for i in range(n):
        for row in range(2):
            work[_CORRECTION + row, i] = work[_X + row, i]
            work[RISE + row, i] += work[_X + row, i]
        size = abs(state[at.DISPLACEMENT, i]) + abs(work[RISE, i]) + abs(work[BEND, i])
        small = small and abs(work[_X, i]) + abs(work[_X + 1, i]) <= SMALL * size
    return small


@called
def _factor(coefficients, chain, modal, laws, h, work):
    """Factor the Newton matrix for the present tangents."""
    n = chain.shape[1] - 1
    square = h * h
    for i in range(n):
        mass = chain[at.MASS, i]
        floor = h * chain[at.FLOOR_DAMPER, i]
        geometric = chain[at.GEOMETRIC, i]
        damper = h * chain[at.STORY_DAMPER, i]
        numerical = coefficients[R] * (laws[at.STIFFNESS, i] + geometric)
        for row in range(4):
            work[_FACTORED + row, i] = work[_PATH + MEAN_BY_RISE + row, i]
        work[_COUPLING, i] = square * (work[_PATH + MEAN_BY_RISE, i] + 0.5 * geometric) + damper
        work[_COUPLING + 1, i] = square * (work[_PATH + MEAN_BY_BEND, i] - geometric / 12.0)
        work[_COUPLING + 2, i] = square * (work[_PATH + MOMENT_BY_RISE, i] + geometric)
        work[_COUPLING + 3, i] = square * (work[_PATH + MOMENT_BY_BEND, i] + numerical) + damper
        by_rise = mass * coefficients[BY_RISE]
        work[_BLOCKS, i] = coefficients[R] * by_rise + floor + work[_COUPLING, i]
        work[_BLOCKS + 1, i] = mass - 0.5 * coefficients[R] * by_rise + work[_COUPLING + 1, i]
        work[_BLOCKS + 2, i] = work[_COUPLING + 2, i] - by_rise
        work[_BLOCKS + 3, i] = 0.5 * by_rise + floor + work[_COUPLING + 3, i]
    work[_FACTORED, n] = h
    link_blocks(chain, work, _BLOCKS, _COUPLING, n)
    factor_blocks(_BLOCKS, _COUPLING, work, modal, h, 0.0, 0.0, h, _STORE, n)


@inlined
def finish(coefficients, chain, modal, laws, h, state, springs, work, memo):
    """Update the state, and the work done by the load and the dampers along the paths."""
    n = chain.shape[1] - 1
    by_h = 1.0 / h
    by_rise = 0.0
    by_bend = 0.0
    damped_rise = 0.0
    damped_bend = 0.0
    rise_below = 0.0
    bend_below = 0.0
    for i in range(n):
        rise = work[RISE, i]
        bend = work[BEND, i]
        a1 = coefficients[BY_RISE] * (0.5 * bend - rise + h * state[at.VELOCITY, i])
        a0 = bend - coefficients[R] * a1
        by_rise += rise * work[LOAD, i]
        by_bend += bend * work[LOAD + 1, i]
        damped_rise += chain[at.FLOOR_DAMPER, i] * rise * rise
        damped_bend += chain[at.FLOOR_DAMPER, i] * bend * bend
        state[at.DISPLACEMENT, i] += rise
        state[at.VELOCITY, i] += by_h * a0
        state[at.ACCELERATION, i] = by_h * by_h * (a0 + 0.5 * a1)
        rise -= chain[at.LINK, i] * rise_below
        bend -= chain[at.LINK, i] * bend_below
        rise_below = work[RISE, i]
        bend_below = work[BEND, i]
        damped_rise += chain[at.STORY_DAMPER, i] * rise * rise
        damped_bend += chain[at.STORY_DAMPER, i] * bend * bend
        if not BENDING or work[_LEFT, i] == 0.0:
            advance(laws, springs, i, 0, springs[at.DRIFT, i] + rise)
        else:
            arrive(laws, springs, i, rise)
    damped = by_h * (damped_rise + damped_bend / 12.0)
    if MODAL and modal.shape[0] > 0:
        damped += _modal_work(modal, h, work, n)
    if DASHPOTS and memo[at.POWER_DAMPERS] != 0.0:
        damped += _dashpot_work(chain, work, n)
    memo[at.WORK_INPUT] = by_rise + by_bend / 12.0
    memo[at.WORK_DAMPED] = damped


@called
def _modal_work(modal, h, work, n):
    """Work of modal damping along the paths."""
    total = 0.0
    for j in range(modal.shape[0]):
        rise = 0.0
        bend = 0.0
        for i in range(n):
            rise += modal[j, i] * work[RISE, i]
            bend += modal[j, i] * work[BEND, i]
        total += (rise * rise + bend * bend / 12.0) / h
    return total


@called
def _dashpot_work(chain, work, n):
    """Work of the power-law dashpots along the paths."""
    total = 0.0
    rise_below = 0.0
    bend_below = 0.0
    for i in range(n):
        rise = work[RISE, i] - chain[at.LINK, i] * rise_below
        bend = work[BEND, i] - chain[at.LINK, i] * bend_below
        rise_below = work[RISE, i]
        bend_below = work[BEND, i]
        if chain[at.POWER_DAMPER, i] != 0.0:
            total += rise * work[_DASHPOT, i] + bend * work[_DASHPOT + 1, i] / 12.0
    return total
