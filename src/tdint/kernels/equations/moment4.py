"""Response of all floors over a step of `moment4`: impulse and first moment of the equation of
motion.

The unknowns are the rise D0 = h U0 = u1 - u0 and the bend D1 = h U1 of the parabolas of the floors.
`tdint.methods.moment4` contains the equations. Multiplied by h^2 they are

    M a0 + h C D0 + h^2 (F0 - P0) = 0                          impulse
    M a1 + h C D1 + h^2 (F1 - P1) + h^2 r K D1 = 0             first moment
    a1 = (D1 / 2 - D0 + h v0) 12 / (1 + 6 r),   a0 = D1 - r a1

with the means F0 and moments F1 of `tdint.kernels.stories.path` and the initial stiffness K.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
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
from tdint.kernels.laws.selection import HAS_NONLINEAR_FORCE
from tdint.kernels.linear_terms import DASHPOTS, MODAL, add_modal_force, power_damper
from tdint.kernels.stepping import Factors
from tdint.kernels.stories import path
from tdint.kernels.stories.branches import advance
from tdint.kernels.stories.dashpot_path import follow_dashpot
from tdint.kernels.stories.path import (
    commit_path_end,
    follow,
    has_certain_reversal,
    integrate_on_branch,
    locate_reversals,
    remains_on_branch,
)

# Coefficients
R = 0  # r, coefficient of numerical dissipation
BY_RISE = 1  # 12 / (1 + 6 r)


# maximum number of discontinuities within a step for which accelerations are computed
MAX_CORNERS = 6
_NODES = 2 * MAX_CORNERS + 3


class _Rows(NamedTuple):
    """Scratch rows."""

    LOAD: int = 2  # P0, then P1
    RISE: int = 1
    BEND: int = 1
    A0: int = 1  # a0 and a1 of the equations above, m
    A1: int = 1
    X: int = 2  # residuals, then corrections, of the rises and of the bends
    CORRECTION: int = 2  # last corrections
    SIZE: int = 1  # rounding errors of the displacements, as a force, N
    LEFT: int = 1  # 1 if the story leaves its branch; the last column is 1 if any story does
    STEADY: int = 1  # 1 if the story has no reversal in the step, even if its parabola has one
    PATH: int = path.PATH_ROWS
    DASHPOT: int = 2  # mean and first moment of the force of the power-law dashpot, N
    # tangents of the factorization; the last column contains the length of the step
    FACTORED: int = 4
    BLOCKS: int = 4
    COUPLING: int = COUPLING_ROWS
    # number of discontinuities of the story forces in the step, and their times
    CORNERS: int = 1 + MAX_CORNERS
    # Forces of the stories at the nodes of `corners`, then total shears, N; column n contains the
    # times of the nodes.
    FORCES: int = _NODES
    MOTION: int = _NODES  # absolute accelerations of the floors at the nodes, m/s^2
    WAYS: int = _NODES  # displacements of the floors relative to the start of the step, m
    RATES: int = _NODES  # h times the velocities of the floors, m
    OTHER: int = 1  # modal damping forces, N
    PEAKS: int = 2 * rows.PEAK_ROWS  # peaks of the run and of the step


ROW, STORE = rows.chained(_Rows)

_BY_SLOPE = (
    0.5,
    -1.0 / 12.0,
    1.0,
    0.0,
)  # derivatives of mean and moment on a linear branch, divided by its slope

# Number of solutions after which the decision about a reversal is kept. A story that changes its
# decision in each iteration would prevent convergence.
_DECIDING_ITERATIONS = 4

CLOSE = 1e-13
"""Maximum residual relative to the sum of the absolute values of its terms. It is small because the
energy balance of the method must be closed."""


def scratch_rows(modes: int) -> int:
    """Return the number of scratch rows of the step for a building with `modes` modally damped
    modes."""
    return STORE + 6 * modes + 1


@inline
def move(coefficients, scene, h, memory):
    """Compute the response over the step.

    If all laws are piecewise linear, the first solution assumes that all stories remain on their
    branches. For a linear building it is the only solution. Otherwise Newton's method with the
    complete tangents is used. A correction that does not reduce the residual is halved.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states, scratch array and status of the step.

    Returns
    -------
    int
        Number of linear solutions, or NOT_CONVERGED.
    """
    linear_terms, modal, law_parameters, _, flags = scene
    state, _, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    iterations = 0
    fraction = 1.0
    previous_norm = math.inf
    is_last = False
    if flags[rows.BRANCHES] == rows.ALL_BRANCHES:
        previous_norm = _keep_to_branches(coefficients, scene, h, memory)
        iterations = 1
        if not HAS_NONLINEAR_FORCE or flags[rows.LINEAR] != 0.0:
            return iterations
    else:
        _guess(h, state, scratch, n)
    while HAS_NONLINEAR_FORCE:
        is_stale = _stories(coefficients, scene, h, memory, iterations <= _DECIDING_ITERATIONS)
        size = _residuals(coefficients, linear_terms, modal, h, state, scratch)
        failing = iterations == MAX_ITERATIONS or not size < math.inf
        if is_last or _in_balance(
            failing, coefficients, linear_terms, h, state, scratch, step_status
        ):
            break
        if must_halve(size, previous_norm, fraction):
            fraction *= 0.5
            add_rows(-fraction, scratch, ROW.CORRECTION, ROW.RISE, 2, n)
            continue
        if failing:
            return rows.NOT_CONVERGED
        if is_stale:
            _factor(coefficients, linear_terms, modal, law_parameters, h, scratch)
        solve(modal, h, scratch, ROW.X, n)
        is_last = _correct(state, scratch, n)
        iterations += 1
        previous_norm = size
        fraction = 1.0
    return iterations


@inline
def _keep_to_branches(coefficients, scene, h, memory):
    """Compute the response with all stories on their current linear branches, by one solution from
    zero increments.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array.

    Returns
    -------
    float
        Squared norm of the residual for zero increments.
    """
    linear_terms, modal, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    is_stale = scratch[ROW.FACTORED, n] != h
    for i in range(n):
        slope = law_state[rows.SLOPE, i]
        tangent_tolerance = TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        for row in range(4):
            is_stale |= (
                abs(scratch[ROW.FACTORED + row, i] - _BY_SLOPE[row] * slope) > tangent_tolerance
            )
        scratch[ROW.PATH + path.MEAN, i] = (
            law_state[rows.FORCE, i] + linear_terms[rows.GEOMETRIC, i] * law_state[rows.DRIFT, i]
        )
        scratch[ROW.LEFT, i] = 0.0
    size = 0.0
    for i in range(n):
        mean = (
            scratch[ROW.PATH + path.MEAN, i]
            - linear_terms[rows.LINK, i + 1] * scratch[ROW.PATH + path.MEAN, i + 1]
            - scratch[ROW.LOAD, i]
        )
        inertia = linear_terms[rows.MASS, i] * coefficients[BY_RISE] * h * state[rows.VELOCITY, i]
        by_rise = coefficients[R] * inertia - h * h * mean
        by_bend = h * h * scratch[ROW.LOAD + 1, i] - inertia
        scratch[ROW.X, i] = by_rise
        scratch[ROW.X + 1, i] = by_bend
        if HAS_NONLINEAR_FORCE:
            size += linear_terms[rows.INVERSE_MASS, i] * (
                by_rise * by_rise + by_bend * by_bend / 12.0
            )
    if is_stale:
        for i in range(n):
            for row in range(4):
                scratch[ROW.PATH + path.MEAN_BY_RISE + row, i] = (
                    _BY_SLOPE[row] * law_state[rows.SLOPE, i]
                )
        _factor(coefficients, linear_terms, modal, law_parameters, h, scratch)
    solve(modal, h, scratch, ROW.X, n)
    for row in range(2):
        for i in range(n):
            scratch[ROW.CORRECTION + row, i] = scratch[ROW.X + row, i]
            scratch[ROW.RISE + row, i] = scratch[ROW.X + row, i]
    return size


@inline
def _guess(h, state, scratch, n):
    """Store the first guess of the response: constant acceleration, equal to the acceleration at
    the end of the previous step.

    Parameters
    ----------
    h : float
        Length of the step, s.
    state : ndarray
        State at the start of the step.
    scratch : ndarray
        Rows RISE and BEND are set.
    n : int
        Number of floors.
    """
    for i in range(n):
        scratch[ROW.BEND, i] = h * h * state[rows.ACCELERATION, i]
        scratch[ROW.RISE, i] = h * state[rows.VELOCITY, i] + 0.5 * scratch[ROW.BEND, i]


@inline
def _stories(coefficients, scene, h, memory, is_deciding):
    """Compute means, moments and tangents of the stories for the current response, including
    dampers.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array.
    is_deciding : bool
        True if the decision about reversals of the stories is updated.

    Returns
    -------
    bool
        True if the factorization does not match the tangents.
    """
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    is_stale = scratch[ROW.FACTORED, n] != h
    rise_below = 0.0
    bend_below = 0.0
    size_below = 0.0
    scratch[ROW.LEFT, n] = 0.0
    for i in range(n):
        link = linear_terms[rows.LINK, i]
        rise = scratch[ROW.RISE, i] - link * rise_below
        bend = scratch[ROW.BEND, i] - link * bend_below
        rise_below = scratch[ROW.RISE, i]
        bend_below = scratch[ROW.BEND, i]
        if remains_on_branch(law_state, i, rise, bend):
            scratch[ROW.LEFT, i] = 0.0
            scratch[ROW.STEADY, i] = 0.0
            integrate_on_branch(law_state, i, rise, bend, scratch, ROW.PATH)
        else:
            scratch[ROW.LEFT, i] = 1.0
            scratch[ROW.LEFT, n] = 1.0
            if is_deciding:
                may_be_steady = 2.0 * abs(rise) < abs(bend) and law_state[rows.SLOPE, i] < math.inf
                scratch[ROW.STEADY, i] = (
                    1.0 if may_be_steady and _steady(coefficients, scene, h, memory, i) else 0.0
                )
            follow(
                law_parameters,
                law_state,
                i,
                rise,
                bend,
                scratch[ROW.STEADY, i] != 0.0,
                scratch,
                ROW.PATH,
            )
        if DASHPOTS and linear_terms[rows.POWER_DAMPER, i] != 0.0:
            follow_dashpot(linear_terms, i, h, rise, bend, scratch, ROW.PATH, ROW.DASHPOT)
        tangent_tolerance = TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        for row in range(4):
            change = abs(
                scratch[ROW.PATH + path.MEAN_BY_RISE + row, i] - scratch[ROW.FACTORED + row, i]
            )
            is_stale |= change > tangent_tolerance
        geometric = linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i] / h
        drift = law_state[rows.DRIFT, i]
        stiffness = coefficients[R] * (law_parameters[rows.STIFFNESS, i] + geometric)
        scratch[ROW.PATH + path.MEAN, i] += (
            geometric * (drift + 0.5 * rise - bend / 12.0) + damper * rise
        )
        scratch[ROW.PATH + path.MOMENT, i] += geometric * rise + (damper + stiffness) * bend
        # A drift is a difference of displacements. The rounding errors of the displacements are not
        # part of the residual.
        size = abs(state[rows.DISPLACEMENT, i]) + abs(rise_below)
        scratch[ROW.SIZE, i] = (
            ROUNDING / CLOSE * law_parameters[rows.STIFFNESS, i] * (size + link * size_below)
        )
        size_below = size
    return is_stale


@outlined
def _steady(coefficients, scene, h, memory, i):
    """Return True if story `i`, with a parabola that has an extremum, has no reversal according to
    its drift rate.

    The rate is that of the state at both endpoints; its slope at the start follows from the
    equation of motion. Without this slope the upper stories of a building at rest, with rates that
    increase with the third power of time, would seem to start backwards.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array.
    i : int
        Index of the story.
    """
    linear_terms = scene.linear_terms
    state, _, scratch, _ = memory
    rise = first_rate = last_rate = 0.0
    floors = 2 if i > 0 and linear_terms[rows.LINK, i] != 0.0 else 1
    for below in range(floors):
        j = i - below
        sign = 1.0 - 2.0 * below
        rate = h * state[rows.VELOCITY, j]
        a1 = coefficients[BY_RISE] * (0.5 * scratch[ROW.BEND, j] - scratch[ROW.RISE, j] + rate)
        rise += sign * scratch[ROW.RISE, j]
        first_rate += sign * rate
        last_rate += sign * (rate + scratch[ROW.BEND, j] - coefficients[R] * a1)
    if has_certain_reversal(rise, first_rate, last_rate):
        return False
    start = (
        h
        * h
        * (
            _acceleration(scene, memory, i)
            - (_acceleration(scene, memory, i - 1) if floors == 2 else 0.0)
        )
    )
    side, turn, _, _, _ = locate_reversals(rise, first_rate, last_rate, start)
    return turn == 1.0 and rise * side > 0.0


@inline
def _acceleration(scene, memory, i):
    """Return the acceleration of floor `i` at the start of the step, relative to the ground,
    m/s^2."""
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    force = scratch[ROW.LOAD, i] - 0.5 * scratch[ROW.LOAD + 1, i]
    force -= linear_terms[rows.FLOOR_DAMPER, i] * state[rows.VELOCITY, i]
    for j in range(modal.shape[0] if MODAL else 0):
        amplitude = 0.0
        for k in range(n):
            amplitude += modal[j, k] * state[rows.VELOCITY, k]
        force -= amplitude * modal[j, i]
    for above in range(2):
        j = i + above
        if j < n:
            link = linear_terms[rows.LINK, j]
            rate = state[rows.VELOCITY, j] - link * state[rows.VELOCITY, max(j - 1, 0)]
            story = (
                law_state[rows.FORCE, j]
                + linear_terms[rows.GEOMETRIC, j] * law_state[rows.DRIFT, j]
            )
            story += (
                linear_terms[rows.STORY_DAMPER, j] * rate + power_damper(linear_terms, j, rate)[0]
            )
            force += story * link if above else -story
    return linear_terms[rows.INVERSE_MASS, i] * force


@inline
def _residuals(coefficients, linear_terms, modal, h, state, scratch):
    """Store minus the residuals of both equations and return their squared norm.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    linear_terms : ndarray
        Linear terms of the building (`tdint.kernels.layout`).
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T.
    h : float
        Length of the step, s.
    state : ndarray
        State at the start of the step.
    scratch : ndarray
        Scratch rows; X, A0 and A1 are set.
    """
    n = linear_terms.shape[1] - 1
    for i in range(n):
        scratch[ROW.X, i] = 0.0
        scratch[ROW.X + 1, i] = 0.0
    add_modal_force(modal, scratch, ROW.RISE, -h, scratch, ROW.X, n)
    add_modal_force(modal, scratch, ROW.BEND, -h, scratch, ROW.X + 1, n)
    total = 0.0
    for i in range(n):
        link = linear_terms[rows.LINK, i + 1]
        rise = scratch[ROW.RISE, i]
        bend = scratch[ROW.BEND, i]
        a1 = coefficients[BY_RISE] * (0.5 * bend - rise + h * state[rows.VELOCITY, i])
        a0 = bend - coefficients[R] * a1
        scratch[ROW.A0, i] = a0
        scratch[ROW.A1, i] = a1
        floor = h * linear_terms[rows.FLOOR_DAMPER, i]
        mean = (
            scratch[ROW.PATH + path.MEAN, i]
            - link * scratch[ROW.PATH + path.MEAN, i + 1]
            - scratch[ROW.LOAD, i]
        )
        moment = (
            scratch[ROW.PATH + path.MOMENT, i]
            - link * scratch[ROW.PATH + path.MOMENT, i + 1]
            - scratch[ROW.LOAD + 1, i]
        )
        scratch[ROW.X, i] -= linear_terms[rows.MASS, i] * a0 + floor * rise + h * h * mean
        scratch[ROW.X + 1, i] -= linear_terms[rows.MASS, i] * a1 + floor * bend + h * h * moment
        squares = (
            scratch[ROW.X, i] * scratch[ROW.X, i]
            + scratch[ROW.X + 1, i] * scratch[ROW.X + 1, i] / 12.0
        )
        total += linear_terms[rows.INVERSE_MASS, i] * squares
    return total


@inline
def _in_balance(is_last, coefficients, linear_terms, h, state, scratch, step_status):
    """Return True if all residuals are within the tolerance CLOSE.

    Parameters
    ----------
    is_last : bool
        True if no further iteration is allowed. The largest relative residual is then stored in
        `step_status`.
    coefficients : ndarray
        Coefficients of the method.
    linear_terms : ndarray
        Linear terms of the building.
    h : float
        Length of the step, s.
    state : ndarray
        State at the start of the step.
    scratch : ndarray
        Scratch rows.
    step_status : ndarray
        Rows RESIDUAL and WORST_STORY are updated.
    """
    step_status[rows.RESIDUAL] = 0.0
    is_small = True
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i + 1]
        mass = linear_terms[rows.MASS, i]
        rounding = scratch[ROW.SIZE, i] + link * scratch[ROW.SIZE, i + 1]
        forces = (
            abs(scratch[ROW.PATH + path.MEAN, i])
            + link * abs(scratch[ROW.PATH + path.MEAN, i + 1])
            + abs(scratch[ROW.LOAD, i])
        )
        inner = abs(scratch[ROW.BEND, i]) + coefficients[R] * abs(scratch[ROW.A1, i])
        is_small &= is_balanced(
            is_last,
            CLOSE,
            step_status,
            i,
            scratch[ROW.X, i],
            mass * inner + h * h * (forces + rounding),
        )
        forces = (
            abs(scratch[ROW.PATH + path.MOMENT, i])
            + link * abs(scratch[ROW.PATH + path.MOMENT, i + 1])
            + abs(scratch[ROW.LOAD + 1, i])
        )
        inner = (
            abs(scratch[ROW.BEND, i]) + abs(scratch[ROW.RISE, i]) + h * abs(state[rows.VELOCITY, i])
        )
        inner *= coefficients[BY_RISE]
        is_small &= is_balanced(
            is_last,
            CLOSE,
            step_status,
            i,
            scratch[ROW.X + 1, i],
            mass * inner + h * h * (forces + rounding),
        )
    return is_small


@inline
def _correct(state, scratch, n):
    """Add the corrections to rises and bends, and return True if they are of the order of rounding
    errors."""
    is_small = True
    for i in range(n):
        for row in range(2):
            scratch[ROW.CORRECTION + row, i] = scratch[ROW.X + row, i]
            scratch[ROW.RISE + row, i] += scratch[ROW.X + row, i]
        size = (
            abs(state[rows.DISPLACEMENT, i]) + abs(scratch[ROW.RISE, i]) + abs(scratch[ROW.BEND, i])
        )
        is_small = (
            is_small and abs(scratch[ROW.X, i]) + abs(scratch[ROW.X + 1, i]) <= ROUNDING * size
        )
    return is_small


@outlined
def _factor(coefficients, linear_terms, modal, law_parameters, h, scratch):
    """Assemble and factorize the matrix of Newton's method for the current tangents.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    linear_terms : ndarray
        Linear terms of the building (`tdint.kernels.layout`).
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T.
    law_parameters : ndarray
        Parameters of the laws.
    h : float
        Length of the step, s.
    scratch : ndarray
        Scratch array.
    """
    n = linear_terms.shape[1] - 1
    square = h * h
    for i in range(n):
        mass = linear_terms[rows.MASS, i]
        floor = h * linear_terms[rows.FLOOR_DAMPER, i]
        geometric = linear_terms[rows.GEOMETRIC, i]
        damper = h * linear_terms[rows.STORY_DAMPER, i]
        numerical = coefficients[R] * (law_parameters[rows.STIFFNESS, i] + geometric)
        for row in range(4):
            scratch[ROW.FACTORED + row, i] = scratch[ROW.PATH + path.MEAN_BY_RISE + row, i]
        scratch[ROW.COUPLING, i] = (
            square * (scratch[ROW.PATH + path.MEAN_BY_RISE, i] + 0.5 * geometric) + damper
        )
        scratch[ROW.COUPLING + 1, i] = square * (
            scratch[ROW.PATH + path.MEAN_BY_BEND, i] - geometric / 12.0
        )
        scratch[ROW.COUPLING + 2, i] = square * (
            scratch[ROW.PATH + path.MOMENT_BY_RISE, i] + geometric
        )
        scratch[ROW.COUPLING + 3, i] = (
            square * (scratch[ROW.PATH + path.MOMENT_BY_BEND, i] + numerical) + damper
        )
        by_rise = mass * coefficients[BY_RISE]
        scratch[ROW.BLOCKS, i] = coefficients[R] * by_rise + floor + scratch[ROW.COUPLING, i]
        scratch[ROW.BLOCKS + 1, i] = (
            mass - 0.5 * coefficients[R] * by_rise + scratch[ROW.COUPLING + 1, i]
        )
        scratch[ROW.BLOCKS + 2, i] = scratch[ROW.COUPLING + 2, i] - by_rise
        scratch[ROW.BLOCKS + 3, i] = 0.5 * by_rise + floor + scratch[ROW.COUPLING + 3, i]
    scratch[ROW.FACTORED, n] = h
    factors = Factors(scratch, ROW.BLOCKS, ROW.COUPLING, STORE)
    link_blocks(linear_terms, factors, n)
    factor_blocks(factors, ModalBlocks(modal, h, 0.0, 0.0, h), n)


@inline
def solve(modal, h, scratch, x, n):
    """Solve the linear system with the right side in the rows `x` and `x` + 1, which receive the
    solution.

    Parameters
    ----------
    modal : ndarray
        Rows of the modal damping matrix.
    h : float
        Length of the step, s.
    scratch : ndarray
        Scratch array with the factorization.
    x : int
        First row of the right side.
    n : int
        Number of floors.
    """
    factors = Factors(scratch, ROW.BLOCKS, ROW.COUPLING, STORE)
    solve_blocks_damped(factors, ModalBlocks(modal, h, 0.0, 0.0, h), x, x + 1, n)


@inline
def finish(coefficients, scene, h, memory):
    """Update the state and the law states, and store the work of the load and of the dampers along
    the paths.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states, scratch array and status of the step.
    """
    linear_terms, modal, law_parameters, _, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    by_h = 1.0 / h
    by_rise = 0.0
    by_bend = 0.0
    damped_rise = 0.0
    damped_bend = 0.0
    rise_below = 0.0
    bend_below = 0.0
    for i in range(n):
        rise = scratch[ROW.RISE, i]
        bend = scratch[ROW.BEND, i]
        a1 = coefficients[BY_RISE] * (0.5 * bend - rise + h * state[rows.VELOCITY, i])
        a0 = bend - coefficients[R] * a1
        by_rise += rise * scratch[ROW.LOAD, i]
        by_bend += bend * scratch[ROW.LOAD + 1, i]
        damped_rise += linear_terms[rows.FLOOR_DAMPER, i] * rise * rise
        damped_bend += linear_terms[rows.FLOOR_DAMPER, i] * bend * bend
        state[rows.DISPLACEMENT, i] += rise
        state[rows.VELOCITY, i] += by_h * a0
        state[rows.ACCELERATION, i] = by_h * by_h * (a0 + 0.5 * a1)
        rise -= linear_terms[rows.LINK, i] * rise_below
        bend -= linear_terms[rows.LINK, i] * bend_below
        rise_below = scratch[ROW.RISE, i]
        bend_below = scratch[ROW.BEND, i]
        damped_rise += linear_terms[rows.STORY_DAMPER, i] * rise * rise
        damped_bend += linear_terms[rows.STORY_DAMPER, i] * bend * bend
        if not HAS_NONLINEAR_FORCE or scratch[ROW.LEFT, i] == 0.0:
            advance(law_parameters, law_state, i, 0, law_state[rows.DRIFT, i] + rise)
        else:
            commit_path_end(law_parameters, law_state, i, rise)
    damped = by_h * (damped_rise + damped_bend / 12.0)
    if MODAL and modal.shape[0] > 0:
        damped += _modal_work(modal, h, scratch, n)
    if DASHPOTS and flags[rows.POWER_DAMPERS] != 0.0:
        damped += _dashpot_work(linear_terms, scratch, n)
    step_status[rows.WORK_INPUT] = by_rise + by_bend / 12.0
    step_status[rows.WORK_VISCOUS] = damped


@outlined
def _modal_work(modal, h, scratch, n):
    """Return the work of modal damping along the paths, J.

    Parameters
    ----------
    modal : ndarray
        Rows of the modal damping matrix.
    h : float
        Length of the step, s.
    scratch : ndarray
        Scratch rows with rises and bends.
    n : int
        Number of floors.
    """
    total = 0.0
    for j in range(modal.shape[0]):
        rise = 0.0
        bend = 0.0
        for i in range(n):
            rise += modal[j, i] * scratch[ROW.RISE, i]
            bend += modal[j, i] * scratch[ROW.BEND, i]
        total += (rise * rise + bend * bend / 12.0) / h
    return total


@outlined
def _dashpot_work(linear_terms, scratch, n):
    """Return the work of the power-law dashpots along the paths, J."""
    total = 0.0
    rise_below = 0.0
    bend_below = 0.0
    for i in range(n):
        rise = scratch[ROW.RISE, i] - linear_terms[rows.LINK, i] * rise_below
        bend = scratch[ROW.BEND, i] - linear_terms[rows.LINK, i] * bend_below
        rise_below = scratch[ROW.RISE, i]
        bend_below = scratch[ROW.BEND, i]
        if linear_terms[rows.POWER_DAMPER, i] != 0.0:
            total += rise * scratch[ROW.DASHPOT, i] + bend * scratch[ROW.DASHPOT + 1, i] / 12.0
    return total
