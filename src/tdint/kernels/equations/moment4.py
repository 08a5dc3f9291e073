"""Solution of the equations of a step of `moment4` for all floors.

The displacement of each floor within the step is the parabola u0 + D0 t + D1 (t^2 - t) / 2 of the
time t, which increases from 0 to 1. The unknowns are its rise D0 = h U0 = u1 - u0 and its bend
D1 = h U1. The equations are the impulse and the first moment of the equation of motion
(`tdint.methods.moment4`). Multiplied by h^2, they are

    M a0 + h C D0 + h^2 (F0 - P0) = 0                          impulse
    M a1 + h C D1 + h^2 (F1 - P1) + h^2 r K D1 = 0             first moment
    a1 = (D1 / 2 - D0 + h v0) 12 / (1 + 6 r),   a0 = D1 - r a1

with the velocity v0 at the start, the means F0 = int f dt and first moments F1 = 12 int (t - 1/2) f
dt of the story forces f (`tdint.kernels.stories.path`), the corresponding integrals P0 and P1 of
the loads, the matrices M, C and K of mass, damping and initial stiffness, and the coefficient r of
numerical dissipation. a0 and a1 (m) are h^2 times the mean and the change of the acceleration over
the step. The drift of a story is d0 + rise t + bend (t^2 - t) / 2. Docstrings use these symbols.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
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
from tdint.kernels.linear_terms import (
    above,
    add_modal_force,
    base_of,
    below,
    is_tree,
    power_damper,
    size_above,
    story_value,
    upper_of,
)
from tdint.kernels.stepping import Factors
from tdint.kernels.stories import path
from tdint.kernels.stories.brace import BRACE_RESULT_ROWS, commit_brace, follow_brace
from tdint.kernels.stories.branches import advance
from tdint.kernels.stories.dashpot_path import follow_dashpot
from tdint.kernels.stories.path import (
    commit_path_end,
    follow,
    has_certain_reversal,
    integrate_on_branch,
    is_piecewise_linear,
    locate_reversals,
    remains_on_branch,
)

# Indices of the coefficients of the step (`tdint.methods.moment4.coefficients`)
R = 0  # r, coefficient of numerical dissipation
BY_RISE = 1  # 12 / (1 + 6 r)
TOLERANCE = 2  # maximum residual relative to the sum of the absolute values of its terms


# Maximum number of discontinuities of the story forces within a step that are considered for peaks
MAX_CORNERS = 8
# Maximum number of nodes: the endpoints, the discontinuities, and the midpoints between them
_MAX_NODES = 2 * MAX_CORNERS + 3


class _Rows(NamedTuple):
    """Number of scratch rows for each quantity; the columns are floors or stories."""

    LOAD: int = 2  # mean P0 and first moment P1 of the load, N
    RISE: int = 1  # D0 in u0 + D0 t + D1 (t^2 - t) / 2, the displacement in the step, m
    BEND: int = 1  # D1, m
    A0: int = 1  # h^2 times the mean acceleration, m
    A1: int = 1  # h^2 times the change of the acceleration over the step, m
    # Residuals of the impulse and of the first moment (kg m); replaced by the corrections of D0 and
    # D1 (m) when the equations are solved
    X: int = 2
    CORRECTION: int = 2  # corrections of D0 and D1 in the last iteration of Newton's method, m
    # Rounding errors of the displacements, as a force, divided by the tolerance of the residuals, N
    ROUNDING_FORCE: int = 1
    # 1 if the story changes its branch in the step; the last column is 1 if any story changes its
    # branch
    LEAVES_BRANCH: int = 1
    NO_REVERSAL: int = 1  # 1 if the story has no reversal in the step, even if its parabola has one
    PATH: int = path.PATH_ROWS  # means and moments of the story forces, and their derivatives
    # Mean and first moment of the force of the power-law dashpot or of the damper with a brace, N
    DASHPOT: int = 2
    BRACE: int = BRACE_RESULT_ROWS  # results of `follow_brace`
    # Mean and first moment of the force of tangent damping, N, and the tangent stiffness of the law
    # at the end of the step, N/m
    TANGENT: int = 3
    # Derivatives of means and moments for which the matrix was factorized, N/m; the last column
    # contains the length of the step, s
    FACTORED: int = 4
    BLOCKS: int = 4  # 2 x 2 diagonal blocks of the factorization
    COUPLING: int = COUPLING_ROWS  # blocks between adjacent floors
    # Number of discontinuities of the story forces in the step, and their times, in column 0
    CORNERS: int = 1 + MAX_CORNERS
    # Forces of the stories at the nodes of `corners`, then total shears, N; column n contains the
    # times of the nodes.
    NODE_FORCE: int = _MAX_NODES
    NODE_ACCELERATION: int = _MAX_NODES  # absolute accelerations of the floors at the nodes, m/s^2
    # Displacements of the floors at the nodes, relative to the start of the step, m; in the columns
    # of elements, their forces on the parabola of the step, N
    NODE_DISPLACEMENT: int = _MAX_NODES
    NODE_VELOCITY: int = _MAX_NODES  # h times the velocities of the floors, m
    NODE_BRACE: int = BRACE_RESULT_ROWS  # results of `follow_brace` until a node
    MODAL_FORCE: int = 1  # modal damping forces, N
    # Peaks of the run and of the step, then the corner of `keep_corner`
    PEAKS: int = 2 * rows.PEAK_ROWS + 2


ROW, STORE = rows.chained(_Rows)

# Derivatives on a linear branch, divided by its stiffness: of the mean force with respect to rise
# and bend, then of the first moment with respect to rise and bend
_TANGENTS_PER_SLOPE = (0.5, -1.0 / 12.0, 1.0, 0.0)

# Number of solutions after which the decision about a reversal is kept. A story that changes its
# decision in each iteration would prevent convergence.
_DECIDING_ITERATIONS = 4

MAX_RESIDUAL = 1e-13
"""Dimensionless. Coefficient TOLERANCE of the method. It is small because the energy balance of the
method must be closed.
"""


def scratch_rows(modes: int) -> int:
    """Return the number of scratch rows of a step of moment4 for `modes` modally damped modes.

    The rows of `_Rows` are followed by 6 rows for each mode and a temporary row (terms of the
    Woodbury formula of `factor_blocks`).
    """
    return STORE + 6 * modes + 1


@inline
def solve_step(coefficients, scene, h, memory):
    """Solve the equations of a step for the rises D0 and bends D1 of all floors. Return the number
    of linear solutions, or NOT_CONVERGED (negative) if the residuals are too large after
    MAX_ITERATIONS solutions or not finite. The state is not changed.

    If all laws are piecewise linear, the first solution assumes that all stories remain on their
    branches. In a linear building it is exact. Otherwise Newton's method follows, with the
    derivatives of the means and moments along the current paths. A correction that does not reduce
    the residual is halved. The iteration ends if all residuals are within the tolerance, or if the
    last correction was of the order of rounding errors.

    Until _DECIDING_ITERATIONS linear solutions, each evaluation also decides whether a story
    reverses within the step. Later, this decision is kept, because a change in each iteration would
    prevent convergence.
    """
    linear_terms, modal, law_parameters, _, flags = scene
    state, _, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    iterations = 0
    applied_fraction = 1.0
    previous_norm = math.inf
    is_correction_negligible = False
    # First estimate: exact linear solution if all laws have linear branches and there are no
    # power-law dashpots (ALL_BRANCHES), otherwise a guess.
    if flags[rows.BRANCHES] == rows.ALL_BRANCHES:
        previous_norm = _solve_on_branches(coefficients, scene, h, memory)
        iterations = 1
        if flags[rows.LINEAR] != 0.0:
            return iterations
    else:
        _store_first_guess(h, state, scratch, n)
    # Newton's method
    while True:
        # `is_stale` is True if the existing factorization is for other derivatives of means and
        # moments, or for another length of the step. The last argument of `_evaluate_stories` is
        # True if the decision about reversals may change.
        is_stale = _evaluate_stories(
            coefficients, scene, h, memory, iterations <= _DECIDING_ITERATIONS
        )
        norm = _residuals(coefficients, linear_terms, modal, h, state, scratch)
        # No further correction is possible after the last iteration or if a value is not finite.
        # `is_final` does not change the convergence test; if the test fails, `_is_converged` stores
        # the largest relative residual for the error message.
        is_final = iterations == MAX_ITERATIONS or not norm < math.inf
        if is_correction_negligible or _is_converged(
            is_final, coefficients, linear_terms, h, state, scratch, step_status
        ):
            break
        # Line search: halve the applied fraction of a correction that does not reduce the norm.
        if must_halve(norm, previous_norm, applied_fraction):
            applied_fraction *= 0.5
            add_rows(-applied_fraction, scratch, ROW.CORRECTION, ROW.RISE, 2, n)
            continue
        if is_final:
            return rows.NOT_CONVERGED
        # `_correct` returns True if the correction is of the order of rounding errors.
        if is_stale:
            _factor(coefficients, linear_terms, modal, law_parameters, h, scratch)
        solve(linear_terms, modal, scratch, ROW.X, n)
        is_correction_negligible = _correct(state, scratch, n)
        iterations += 1
        previous_norm = norm
        applied_fraction = 1.0
    return iterations


@inline
def _solve_on_branches(coefficients, scene, h, memory):
    """Solve the equations under the assumption that all stories remain on their linear branches.
    Return the squared norm of the residuals for D0 = D1 = 0 (formula in `_residuals`).

    For the drift d0 + D t + E (t^2 - t) / 2 of a story with the force f0 at the start (with
    P-delta) and the sum k of the stiffness of its branch and the geometric stiffness, F0 = f0 + k
    (D / 2 - E / 12) and F1 = k D. The equations are then linear, and a single Newton correction
    from D0 = D1 = 0 is exact. `_factor` adds the geometric stiffness, the dampers and r K to the
    matrix. The function is only called if the flag BRANCHES is ALL_BRANCHES, which excludes curved
    laws and power-law dashpots.

    Rows RISE, BEND and CORRECTION receive D0 and D1. Row LEAVES_BRANCH is set to 0. The stored
    factorization is replaced if it is for other tangents or another length of the step.
    """
    linear_terms, modal, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    # Store the story forces f0 for zero rise and bend, including P-delta, in row PATH + MEAN. The
    # existing factorization is valid if it is for the same step length (column n of row FACTORED)
    # and for nearly equal derivatives. The four rows FACTORED contain its derivatives. The new
    # derivatives are the four numbers of _TANGENTS_PER_SLOPE times the stiffness `slope` (without
    # P-delta): of F0 with respect to rise (1/2) and bend (-1/12), then of F1 with respect to rise
    # (1) and bend (0).
    is_stale = scratch[ROW.FACTORED, n] != h
    for i in range(n):
        slope = law_state[rows.SLOPE, i]
        tangent_tolerance = TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        for row in range(4):
            is_stale |= (
                abs(scratch[ROW.FACTORED + row, i] - _TANGENTS_PER_SLOPE[row] * slope)
                > tangent_tolerance
            )
        scratch[ROW.PATH + path.MEAN, i] = (
            law_state[rows.FORCE, i] + linear_terms[rows.GEOMETRIC, i] * law_state[rows.DRIFT, i]
        )
        scratch[ROW.LEAVES_BRANCH, i] = 0.0
    norm = 0.0
    for i in range(n):
        # The last column of row PATH + MEAN is not set and has no effect.
        mean = (
            scratch[ROW.PATH + path.MEAN, i]
            - above(linear_terms, scratch, ROW.PATH + path.MEAN, i)
            - scratch[ROW.LOAD, i]
        )
        # Both residuals have the opposite sign, as the right side of the linear system. For
        # D0 = D1 = 0 the equations of the docstring give a1 = 12 h v0 / (1 + 6 r), a0 = -r a1,
        # F0 = f0 and F1 = 0. `mean` is F0 - P0, `inertia` is M a1, and BY_RISE is the coefficient
        # 12 / (1 + 6 r).
        inertia = linear_terms[rows.MASS, i] * coefficients[BY_RISE] * h * state[rows.VELOCITY, i]
        impulse_residual = coefficients[R] * inertia - h * h * mean
        moment_residual = h * h * scratch[ROW.LOAD + 1, i] - inertia
        scratch[ROW.X, i] = impulse_residual
        scratch[ROW.X + 1, i] = moment_residual
        norm += linear_terms[rows.INVERSE_MASS, i] * (
            impulse_residual * impulse_residual + moment_residual * moment_residual / 12.0
        )
    # Factorize if necessary, and solve. `_factor` reads the four derivatives from the rows PATH.
    # The correction starts from zero: the solution in rows X is the complete rise and bend.
    if is_stale:
        for i in range(n):
            for row in range(4):
                scratch[ROW.PATH + path.MEAN_BY_RISE + row, i] = (
                    _TANGENTS_PER_SLOPE[row] * law_state[rows.SLOPE, i]
                )
        _factor(coefficients, linear_terms, modal, law_parameters, h, scratch)
    solve(linear_terms, modal, scratch, ROW.X, n)
    for row in range(2):
        for i in range(n):
            scratch[ROW.CORRECTION + row, i] = scratch[ROW.X + row, i]
            scratch[ROW.RISE + row, i] = scratch[ROW.X + row, i]
    return norm


@inline
def _store_first_guess(h, state, scratch, n):
    """Store the first guess of the rise and bend of each floor: constant acceleration a, with D1 =
    h^2 a and D0 = h v0 + D1 / 2.
    """
    for i in range(n):
        scratch[ROW.BEND, i] = h * h * state[rows.ACCELERATION, i]
        scratch[ROW.RISE, i] = h * state[rows.VELOCITY, i] + 0.5 * scratch[ROW.BEND, i]


@inline
def _evaluate_stories(coefficients, scene, h, memory, is_deciding):
    """Compute mean F0 and first moment F1 of the force of each story along its current path. Return
    True if the existing factorization is for other tangents or another length of the step, and must
    be computed again.

    The rise and the bend of the drift are differences between the floors above and below. To the
    integrals of the restoring force are added

        P-delta, stiffness g    F0: g (d0 + rise / 2 - bend / 12)   F1: g rise
        damper c                F0: c rise / h                      F1: c bend / h
        numerical dissipation                                       F1: r (k + g) bend

    with the initial stiffness k. The derivatives of the integrals of the restoring force and of the
    power-law dashpot with respect to rise and bend are computed as well.

    Rows PATH receive F0, F1 and their four derivatives. Row ROUNDING_FORCE receives the rounding
    errors of the displacements as a force, divided by the tolerance of the residuals. Row
    LEAVES_BRANCH is set to 0 for a story that remains on its linear branch, otherwise to 1; its
    column n is 1 if the row is 1 for any story. `is_deciding` and row NO_REVERSAL are described in
    `_integrate_restoring_force`.
    """
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    is_stale = scratch[ROW.FACTORED, n] != h
    rounding = ROUNDING / coefficients[TOLERANCE]
    rise_below = 0.0
    bend_below = 0.0
    displacement_scale_below = 0.0
    # Column n of row LEAVES_BRANCH is a summary of the row. For each story, the function
    # `_integrate_restoring_force` sets column i to 0 or 1, and with 1 it also sets column n to 1.
    scratch[ROW.LEAVES_BRANCH, n] = 0.0
    for i in range(n):
        link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
        # `rise` and `bend` belong to the drift of story `i`: floor `i` minus the floor below.
        # `rise_below` and `bend_below` are afterwards set to the values of floor `i`, which is the
        # floor below in the next pass of a chain.
        rise_below = below(linear_terms, scratch, ROW.RISE, i, rise_below)
        bend_below = below(linear_terms, scratch, ROW.BEND, i, bend_below)
        rise = scratch[ROW.RISE, i] - link * rise_below
        bend = scratch[ROW.BEND, i] - link * bend_below
        rise_below = scratch[ROW.RISE, i]
        bend_below = scratch[ROW.BEND, i]
        # Compute the integrals of the restoring force, and add the integrals of the force of a
        # power-law dashpot.
        _integrate_restoring_force(coefficients, scene, h, memory, i, rise, bend, is_deciding)
        if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
            _add_tangent_damping(scene, i, h, rise, bend, memory)
        if FULL and linear_terms[rows.POWER_DAMPER, i] != 0.0:
            follow_dashpot(linear_terms, i, h, rise, bend, scratch, ROW.PATH, ROW.DASHPOT)
        if FULL and linear_terms[rows.BRACE, i] != 0.0:
            _add_brace(linear_terms, i, h, rise, bend, state, scratch)
        # The factorization is kept if no derivative has changed by more than the tolerance.
        tangent_tolerance = TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        for row in range(4):
            change = abs(
                scratch[ROW.PATH + path.MEAN_BY_RISE + row, i] - scratch[ROW.FACTORED + row, i]
            )
            is_stale |= change > tangent_tolerance
        # Add P-delta and the story damper to the mean F0 and to the first moment F1, and the
        # numerical dissipation r (k + g) bend to F1. The mean of the drift is drift + rise / 2 -
        # bend / 12, and its first moment is the rise.
        geometric = linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i] / h
        drift = law_state[rows.DRIFT, i]
        dissipative_stiffness = coefficients[R] * (law_parameters[rows.STIFFNESS, i] + geometric)
        scratch[ROW.PATH + path.MEAN, i] += (
            geometric * (drift + 0.5 * rise - bend / 12.0) + damper * rise
        )
        scratch[ROW.PATH + path.MOMENT, i] += (
            geometric * rise + (damper + dissipative_stiffness) * bend
        )
        # A drift is a difference of displacements. Their rounding errors, as a force, are
        # ROUNDING times stiffness times displacements. This force is divided by the tolerance,
        # because the convergence test multiplies it by the tolerance. `displacement_scale` is |u0|
        # plus the absolute rise of floor `i` (now in `rise_below`).
        displacement_scale = abs(state[rows.DISPLACEMENT, i]) + abs(rise_below)
        if FULL and is_tree(linear_terms):
            base = base_of(linear_terms, i)
            displacement_scale_below = abs(state[rows.DISPLACEMENT, base])
            displacement_scale_below += abs(scratch[ROW.RISE, base])
        scratch[ROW.ROUNDING_FORCE, i] = (
            rounding
            * law_parameters[rows.STIFFNESS, i]
            * (displacement_scale + link * displacement_scale_below)
        )
        if FULL and linear_terms[rows.BRACE, i] != 0.0:
            # The force of the brace depends only on changes of drift and rate within the step.
            change = abs(rise_below) + abs(rise_below - rise) + abs(bend)
            scratch[ROW.ROUNDING_FORCE, i] += rounding * (
                linear_terms[rows.BRACE, i] * change + abs(state[rows.BRACE_FORCE, i])
            )
        displacement_scale_below = displacement_scale
    return is_stale


@outlined
def _add_tangent_damping(scene, i, h, rise, bend, memory):
    """Add Rayleigh damping with the tangent stiffness to the rows PATH of story `i`.

    Its force is a1 f', with the rate f' of the force of the law. Over the step, the force has the
    mean a1 (f1 - f0) / h and, by partial integration, the first moment
    12 a1 ((f0 + f1) / 2 - mean f) / h. Both are exact for every law and every path.
    """
    law_parameters = scene.law_parameters
    _, law_state, scratch, _ = memory
    by_h = scene.linear_terms[rows.TANGENT_DAMPING, i] / h
    force_0 = law_state[rows.FORCE, i]
    first_slope = law_state[rows.SLOPE, i]
    if scratch[ROW.LEAVES_BRANCH, i] == 0.0:
        slope = first_slope
        force_1 = force_0 + slope * rise
    else:
        force_1, slope = path.force_at_path_end(law_parameters, law_state, i, rise)
    mean, mean_by_rise = scratch[ROW.PATH + path.MEAN, i], scratch[ROW.PATH + path.MEAN_BY_RISE, i]
    mean_by_bend = scratch[ROW.PATH + path.MEAN_BY_BEND, i]
    # After a reversal, f1 also depends on the drift at the reversal, d0 + rise t + bend (t^2 - t) /
    # 2, where the stiffness changes. For a curved law, with an infinite slope, this is neglected.
    by_rise, by_bend = slope, 0.0
    if 2.0 * abs(rise) < abs(bend) and first_slope < math.inf:
        t = 0.5 - rise / bend
        by_rise += (first_slope - slope) * t
        by_bend = 0.5 * (first_slope - slope) * (t * t - t)
    scratch[ROW.TANGENT, i] = by_h * (force_1 - force_0)
    scratch[ROW.TANGENT + 1, i] = 12.0 * by_h * (0.5 * (force_0 + force_1) - mean)
    scratch[ROW.TANGENT + 2, i] = slope
    scratch[ROW.PATH + path.MEAN, i] += scratch[ROW.TANGENT, i]
    scratch[ROW.PATH + path.MOMENT, i] += scratch[ROW.TANGENT + 1, i]
    scratch[ROW.PATH + path.MEAN_BY_RISE, i] += by_h * by_rise
    scratch[ROW.PATH + path.MEAN_BY_BEND, i] += by_h * by_bend
    scratch[ROW.PATH + path.MOMENT_BY_RISE, i] += 12.0 * by_h * (0.5 * by_rise - mean_by_rise)
    scratch[ROW.PATH + path.MOMENT_BY_BEND, i] += 12.0 * by_h * (0.5 * by_bend - mean_by_bend)


@outlined
def _commit_tangent_damping(linear_terms, h, state, scratch):
    """Store force and work of tangent damping at the end of the step; `state` contains the new
    velocities."""
    for i in range(linear_terms.shape[1] - 1):
        coefficient = linear_terms[rows.TANGENT_DAMPING, i]
        if coefficient != 0.0:
            rise = story_value(linear_terms, scratch, ROW.RISE, i)
            bend = story_value(linear_terms, scratch, ROW.BEND, i)
            rate = story_value(linear_terms, state, rows.VELOCITY, i)
            state[rows.DAMPING_FORCE, i] = coefficient * scratch[ROW.TANGENT + 2, i] * rate
            state[rows.DAMPING_WORK, i] += (
                rise * scratch[ROW.TANGENT, i] + bend * scratch[ROW.TANGENT + 1, i] / 12.0
            )


@outlined
def _add_brace(linear_terms, i, h, rise, bend, state, scratch):
    """Add mean and first moment of the force of damper and brace, and their derivatives, to the
    rows PATH of story `i`. Rows DASHPOT receive only mean and moment."""
    force_0 = state[rows.BRACE_FORCE, i]
    follow_brace(linear_terms, i, h, rise, bend, force_0, scratch, ROW.BRACE)
    # The first six rows of the results have the order of the rows PATH.
    for row in range(6):
        scratch[ROW.PATH + row, i] += scratch[ROW.BRACE + row, i]
    scratch[ROW.DASHPOT, i] = scratch[ROW.BRACE + path.MEAN, i]
    scratch[ROW.DASHPOT + 1, i] = scratch[ROW.BRACE + path.MOMENT, i]


@inline
def _integrate_restoring_force(coefficients, scene, h, memory, i, rise, bend, is_deciding):
    """Compute mean and first moment of the restoring force of story `i`, and their derivatives. A
    story that remains on its linear branch has closed formulas. Otherwise the law follows the path.

    With `is_deciding` (the first iterations of Newton's method), the function decides again whether
    the story reverses within the step; otherwise the decision of the last iteration is kept. It is
    stored in row NO_REVERSAL: 1 if the story has no reversal although its parabola of drift has an
    extremum, otherwise 0. For a story that remains on its branch, the row is 0 in both cases, and
    row LEAVES_BRANCH is 0; otherwise this row and its last column are 1.
    """
    _, law_state, scratch, _ = memory
    if remains_on_branch(law_state, i, rise, bend):
        scratch[ROW.LEAVES_BRANCH, i] = 0.0
        scratch[ROW.NO_REVERSAL, i] = 0.0
        integrate_on_branch(law_state, i, rise, bend, scratch, ROW.PATH)
    else:
        scratch[ROW.LEAVES_BRANCH, i] = 1.0
        scratch[ROW.LEAVES_BRANCH, scene.linear_terms.shape[1] - 1] = 1.0
        if is_deciding:
            # An extremum of the parabola within the step can be an error of the approximation of
            # the drift (`_has_no_reversal`). Curved laws always follow the
            # parabola, including its extremum.
            may_be_steady = 2.0 * abs(rise) < abs(bend) and is_piecewise_linear(
                scene.law_parameters, i
            )
            scratch[ROW.NO_REVERSAL, i] = (
                1.0
                if may_be_steady and _has_no_reversal(coefficients, scene, h, memory, i)
                else 0.0
            )
        no_reversal = scratch[ROW.NO_REVERSAL, i] != 0.0
        follow(scene.law_parameters, law_state, i, rise, bend, no_reversal, scratch, ROW.PATH)


@outlined
def _has_no_reversal(coefficients, scene, h, memory, i):
    """Return True if story `i` moves in the direction of `rise` during the complete step although
    its parabola of drift has an extremum. The result is False if the drift rate at an endpoint is
    opposite to `rise`.

    The parabola can have an extremum because it only approximates the drift. A more accurate drift
    rate (times h) is a cubic w(t), which is determined by four values:

        w(0)               h times the drift rate at the start (state)
        w(1)               h times the drift rate at the end, from the velocities h v0 + a0
        mean of w          `rise`, the change of drift over the step
        derivative w'(0)   h^2 times the second derivative of the drift, from the equation of motion

    The derivative w'(0) is necessary for upper stories of a building at rest. Their rates increase
    with the third power of time, and without this value they would seem to move backwards at first.
    """
    linear_terms = scene.linear_terms
    state, _, scratch, _ = memory
    # Values of the story are differences between floor `i` and the floor below. For a story on the
    # ground there is only floor `i`. `first_rate` is w(0) and `last_rate` is w(1) of the docstring.
    rise = first_rate = last_rate = 0.0
    floor_count = 2 if i > 0 and linear_terms[rows.LINK, i] != 0.0 else 1
    base = base_of(linear_terms, i)
    for end in range(floor_count):
        j = i if end == 0 else base
        sign = 1.0 - 2.0 * end
        rate = h * state[rows.VELOCITY, j]
        a1 = coefficients[BY_RISE] * (0.5 * scratch[ROW.BEND, j] - scratch[ROW.RISE, j] + rate)
        rise += sign * scratch[ROW.RISE, j]
        first_rate += sign * rate
        last_rate += sign * (rate + scratch[ROW.BEND, j] - coefficients[R] * a1)
    if has_certain_reversal(rise, first_rate, last_rate):
        return False
    acceleration = _acceleration(scene, memory, upper_of(linear_terms, i))
    if floor_count == 2:
        acceleration -= _acceleration(scene, memory, base)
    initial_slope = h * h * acceleration
    direction, reversal_time, _, _, _ = locate_reversals(rise, first_rate, last_rate, initial_slope)
    # The story has no reversal if the cubic has no reversal in the step, and if the story initially
    # moves in the direction of the change of drift.
    return reversal_time == 1.0 and rise * direction > 0.0


@inline
def _acceleration(scene, memory, i):
    """Return the acceleration of floor `i` at the start of the step, relative to the ground, m/s^2.

    It follows from equilibrium of the floor, m a = p - c v - (modal damping force) - V_i + V_(i+1),
    with the floor damper c, and the forces V_i and V_(i+1) (restoring force, P-delta and dampers)
    of the stories below and above the floor. Without a story above, or if that story is on the
    ground, V_(i+1) is 0. For a load that is linear in time, P1 is its change over the step, and the
    load at the start is p = P0 - P1 / 2.
    """
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    force = scratch[ROW.LOAD, i] - 0.5 * scratch[ROW.LOAD + 1, i]
    force -= linear_terms[rows.FLOOR_DAMPER, i] * state[rows.VELOCITY, i]
    for j in range(modal.shape[0] if FULL else 0):
        amplitude = 0.0
        for k in range(n):
            amplitude += modal[j, k] * state[rows.VELOCITY, k]
        force -= amplitude * modal[j, i]
    force -= _story_force_at_start(linear_terms, state, law_state, i)
    if FULL and is_tree(linear_terms):
        j = int(linear_terms[rows.FIRST_ON, i])
        while j > 0:
            force += _story_force_at_start(linear_terms, state, law_state, j)
            j = int(linear_terms[rows.NEXT_ON, j])
        j = int(linear_terms[rows.FIRST_TIED, i]) if FULL else 0
        while j > 0:
            force -= _story_force_at_start(linear_terms, state, law_state, j)
            j = int(linear_terms[rows.NEXT_TIED, j])
    elif i + 1 < n:
        link = linear_terms[rows.LINK, i + 1]
        force += _story_force_at_start(linear_terms, state, law_state, i + 1) * link
    return linear_terms[rows.INVERSE_MASS, i] * force


@inline
def _story_force_at_start(linear_terms, state, law_state, j):
    """Return the force of story `j` at the start of the step, with P-delta and dampers, N."""
    rate = story_value(linear_terms, state, rows.VELOCITY, j)
    story_force = (
        law_state[rows.FORCE, j] + linear_terms[rows.GEOMETRIC, j] * law_state[rows.DRIFT, j]
    )
    story_force += (
        linear_terms[rows.STORY_DAMPER, j] * rate + power_damper(linear_terms, j, rate)[0]
    )
    if FULL and linear_terms[rows.BRACE, j] != 0.0:
        story_force += state[rows.BRACE_REPORTED, j]
    if FULL and linear_terms[rows.TANGENT_DAMPING, j] != 0.0:
        story_force += state[rows.DAMPING_FORCE, j]
    return story_force


@inline
def _residuals(coefficients, linear_terms, modal, h, state, scratch):
    """Compute the negative residuals X_0 of the impulse and X_1 of the first moment of all floors.
    Return their squared norm: sum over the floors of (X_0^2 + X_1^2 / 12) / mass, kg m^2.

    C contains the floor dampers and modal damping; the forces of story dampers are part of F0 and
    F1, and the numerical dissipation is part of F1.
    """
    n = linear_terms.shape[1] - 1
    for i in range(n):
        scratch[ROW.X, i] = 0.0
        scratch[ROW.X + 1, i] = 0.0
    add_modal_force(modal, scratch, ROW.RISE, -h, scratch, ROW.X, n)
    add_modal_force(modal, scratch, ROW.BEND, -h, scratch, ROW.X + 1, n)
    norm = 0.0
    for i in range(n):
        rise = scratch[ROW.RISE, i]
        bend = scratch[ROW.BEND, i]
        a1 = coefficients[BY_RISE] * (0.5 * bend - rise + h * state[rows.VELOCITY, i])
        a0 = bend - coefficients[R] * a1
        scratch[ROW.A0, i] = a0
        scratch[ROW.A1, i] = a1
        floor_damping = h * linear_terms[rows.FLOOR_DAMPER, i]
        # F0 - P0 and F1 - P1 of the floor are story below minus story above minus load, N.
        mean = (
            scratch[ROW.PATH + path.MEAN, i]
            - above(linear_terms, scratch, ROW.PATH + path.MEAN, i)
            - scratch[ROW.LOAD, i]
        )
        moment = (
            scratch[ROW.PATH + path.MOMENT, i]
            - above(linear_terms, scratch, ROW.PATH + path.MOMENT, i)
            - scratch[ROW.LOAD + 1, i]
        )
        scratch[ROW.X, i] -= linear_terms[rows.MASS, i] * a0 + floor_damping * rise + h * h * mean
        scratch[ROW.X + 1, i] -= (
            linear_terms[rows.MASS, i] * a1 + floor_damping * bend + h * h * moment
        )
        squares = (
            scratch[ROW.X, i] * scratch[ROW.X, i]
            + scratch[ROW.X + 1, i] * scratch[ROW.X + 1, i] / 12.0
        )
        norm += linear_terms[rows.INVERSE_MASS, i] * squares
    return norm


@inline
def _is_converged(is_last, coefficients, linear_terms, h, state, scratch, step_status):
    """Return True if the residuals of impulse and first moment of all floors are small enough: at
    most TOLERANCE times the sum of the absolute values of the terms of the equation, without those
    of C.

    Residuals up to the effect of the rounding errors of the displacements are always small enough.
    Row ROUNDING_FORCE contains this effect as a force, already divided by TOLERANCE. It is added to
    the sums, which are then multiplied by TOLERANCE.

    The sum of the first moment contains the large terms of a1, which nearly cancel if h is small.
    The test then restricts the error of D0 relative to h v0, and not the error of a1.

    If `is_last`, no further iteration is allowed: the largest relative residual above the tolerance
    is then stored in row RESIDUAL of `step_status`, and its floor in row WORST_STORY. Row RESIDUAL
    is 0 otherwise.
    """
    tolerance = coefficients[TOLERANCE]
    step_status[rows.RESIDUAL] = 0.0
    is_small = True
    for i in range(linear_terms.shape[1] - 1):
        mass = linear_terms[rows.MASS, i]
        # `force_scale` and `inertia_scale` are the parts of the sum of absolute values with forces
        # and with accelerations, first for the impulse, later for the first moment. `rounding` is
        # the effect of the rounding errors of the displacements, divided by the tolerance, N.
        rounding = scratch[ROW.ROUNDING_FORCE, i]
        rounding += size_above(linear_terms, scratch, ROW.ROUNDING_FORCE, i)
        force_scale = (
            abs(scratch[ROW.PATH + path.MEAN, i])
            + abs(above(linear_terms, scratch, ROW.PATH + path.MEAN, i))
            + abs(scratch[ROW.LOAD, i])
        )
        # M a0 has the terms M D1 and M r a1.
        inertia_scale = abs(scratch[ROW.BEND, i]) + coefficients[R] * abs(scratch[ROW.A1, i])
        scale = mass * inertia_scale + h * h * (force_scale + rounding)
        is_small &= is_balanced(is_last, tolerance, step_status, i, scratch[ROW.X, i], scale)
        # M a1 has the terms D1 / 2, D0 and h v0, times 12 M / (1 + 6 r). For simplicity, the sum
        # contains |D1| instead of |D1| / 2.
        force_scale = (
            abs(scratch[ROW.PATH + path.MOMENT, i])
            + abs(above(linear_terms, scratch, ROW.PATH + path.MOMENT, i))
            + abs(scratch[ROW.LOAD + 1, i])
        )
        inertia_scale = (
            abs(scratch[ROW.BEND, i]) + abs(scratch[ROW.RISE, i]) + h * abs(state[rows.VELOCITY, i])
        )
        inertia_scale *= coefficients[BY_RISE]
        scale = mass * inertia_scale + h * h * (force_scale + rounding)
        is_small &= is_balanced(is_last, tolerance, step_status, i, scratch[ROW.X + 1, i], scale)
    return is_small


@inline
def _correct(state, scratch, n):
    """Add the corrections of Newton's method (rows X) to rises and bends. Return True if all
    corrections are of the order of rounding errors, so that a further iteration would not change
    the solution.
    """
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
    """Assemble and factorize the matrix of Newton's method for the current paths of the stories.

    The 2 x 2 block of a floor contains the derivatives of its two equations with respect to D0 and
    D1. Rows PATH contain the derivatives of F0 and F1 with respect to the rise and to the bend of
    the drift, without P-delta and linear dampers; the geometric stiffness and the dampers are added
    as in `_evaluate_stories`. The initial stiffness K contains the geometric stiffness. Rows
    FACTORED, BLOCKS and COUPLING and the rows from STORE on are set.
    """
    n = linear_terms.shape[1] - 1
    h_squared = h * h
    # Rows COUPLING to COUPLING + 3 receive the 2 x 2 block of each story (derivatives of its mean
    # and moment), rows BLOCKS to BLOCKS + 3 the diagonal block of each floor, row by row.
    for i in range(n):
        mass = linear_terms[rows.MASS, i]
        floor_damping = h * linear_terms[rows.FLOOR_DAMPER, i]
        geometric = linear_terms[rows.GEOMETRIC, i]
        damper = h * linear_terms[rows.STORY_DAMPER, i]
        numerical = coefficients[R] * (law_parameters[rows.STIFFNESS, i] + geometric)
        # `_evaluate_stories` and `_solve_on_branches` later compare them with the new derivatives,
        # to decide whether the factorization is still valid.
        for row in range(4):
            scratch[ROW.FACTORED + row, i] = scratch[ROW.PATH + path.MEAN_BY_RISE + row, i]
        # `damper` is h c, and `numerical` is the contribution to r K.
        scratch[ROW.COUPLING, i] = (
            h_squared * (scratch[ROW.PATH + path.MEAN_BY_RISE, i] + 0.5 * geometric) + damper
        )
        scratch[ROW.COUPLING + 1, i] = h_squared * (
            scratch[ROW.PATH + path.MEAN_BY_BEND, i] - geometric / 12.0
        )
        scratch[ROW.COUPLING + 2, i] = h_squared * (
            scratch[ROW.PATH + path.MOMENT_BY_RISE, i] + geometric
        )
        scratch[ROW.COUPLING + 3, i] = (
            h_squared * (scratch[ROW.PATH + path.MOMENT_BY_BEND, i] + numerical) + damper
        )
        # The diagonal block contains the derivatives of M a0 (first row) and M a1 (second row) with
        # respect to D0 and D1, the floor damping, and the story below. The derivatives of M a1 are
        # -by_rise and by_rise / 2. `link_blocks` adds the story above.
        by_rise = mass * coefficients[BY_RISE]
        scratch[ROW.BLOCKS, i] = (
            coefficients[R] * by_rise + floor_damping + scratch[ROW.COUPLING, i]
        )
        scratch[ROW.BLOCKS + 1, i] = (
            mass - 0.5 * coefficients[R] * by_rise + scratch[ROW.COUPLING + 1, i]
        )
        scratch[ROW.BLOCKS + 2, i] = scratch[ROW.COUPLING + 2, i] - by_rise
        scratch[ROW.BLOCKS + 3, i] = 0.5 * by_rise + floor_damping + scratch[ROW.COUPLING + 3, i]
    scratch[ROW.FACTORED, n] = h
    # Modal damping adds h C to the derivatives of the first equation with respect to D0, and of the
    # second equation with respect to D1.
    factors = Factors(scratch, ROW.BLOCKS, ROW.COUPLING, STORE, linear_terms)
    link_blocks(linear_terms, factors, n)
    factor_blocks(factors, ModalBlocks(modal, h, 0.0, 0.0, h), n)


@inline
def solve(linear_terms, modal, scratch, x, n):
    """Solve the linear system of Newton's method, factorized by `_factor`, for the rises and bends
    of all floors.

    Modal damping is included: it adds h C to the derivative of the first equation (impulse) with
    respect to D0, and of the second equation (first moment) with respect to D1. The rows `x` and
    `x` + 1 contain the right side (negative residuals, kg m) and receive D0 and D1.
    """
    factors = Factors(scratch, ROW.BLOCKS, ROW.COUPLING, STORE, linear_terms)
    solve_blocks_damped(factors, modal, x, n)


@inline
def update_state(coefficients, scene, h, memory):
    """Move state and law states to the end of the step, and compute the work within the step.

        u1 = u0 + D0,   v1 = v0 + a0 / h,   acceleration at the end = (a0 + a1 / 2) / h^2

    The law of a story that remained on its linear branch (row LEAVES_BRANCH is 0) moves along this
    branch. For other stories, the state at the end of the path of the last iteration is committed.

    The work of a force with the mean F0 and the first moment F1 over the step is D0 F0 + D1 F1 /
    12. A damper with the coefficient c has F0 = c D0 / h and F1 = c D1 / h. The work of the load
    and of the dampers is stored in the rows WORK_INPUT and WORK_VISCOUS of the status, J.
    """
    linear_terms, modal, law_parameters, _, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    inverse_h = 1.0 / h
    work_of_mean = 0.0
    work_of_moment = 0.0
    damper_times_rise_squared = 0.0
    damper_times_bend_squared = 0.0
    rise_below = 0.0
    bend_below = 0.0
    for i in range(n):
        rise = scratch[ROW.RISE, i]
        bend = scratch[ROW.BEND, i]
        # `rise` and `bend` describe the displacement of the floor.
        a1 = coefficients[BY_RISE] * (0.5 * bend - rise + h * state[rows.VELOCITY, i])
        a0 = bend - coefficients[R] * a1
        work_of_mean += rise * scratch[ROW.LOAD, i]
        work_of_moment += bend * scratch[ROW.LOAD + 1, i]
        damper_times_rise_squared += linear_terms[rows.FLOOR_DAMPER, i] * rise * rise
        damper_times_bend_squared += linear_terms[rows.FLOOR_DAMPER, i] * bend * bend
        state[rows.DISPLACEMENT, i] += rise
        state[rows.VELOCITY, i] += inverse_h * a0
        state[rows.ACCELERATION, i] = inverse_h * inverse_h * (a0 + 0.5 * a1)
        # From here on, rise and bend describe the drift of story `i`.
        rise_below = below(linear_terms, scratch, ROW.RISE, i, rise_below)
        bend_below = below(linear_terms, scratch, ROW.BEND, i, bend_below)
        rise -= linear_terms[rows.LINK, i] * rise_below
        bend -= linear_terms[rows.LINK, i] * bend_below
        rise_below = scratch[ROW.RISE, i]
        bend_below = scratch[ROW.BEND, i]
        damper_times_rise_squared += linear_terms[rows.STORY_DAMPER, i] * rise * rise
        damper_times_bend_squared += linear_terms[rows.STORY_DAMPER, i] * bend * bend
        # The argument 0 is the first row of the committed state.
        if scratch[ROW.LEAVES_BRANCH, i] == 0.0:
            advance(law_parameters, law_state, i, 0, law_state[rows.DRIFT, i] + rise)
        else:
            commit_path_end(law_parameters, law_state, i, rise)
    viscous_work = inverse_h * (damper_times_rise_squared + damper_times_bend_squared / 12.0)
    if FULL and modal.shape[0] > 0:
        viscous_work += _modal_work(modal, h, scratch, n)
    if FULL and flags[rows.POWER_DAMPERS] != 0.0:
        viscous_work += _dashpot_work(linear_terms, scratch, n)
    if FULL and flags[rows.HAS_BRACES] != 0.0:
        _commit_braces(linear_terms, h, state, scratch)
    if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
        _commit_tangent_damping(linear_terms, h, state, scratch)
    step_status[rows.WORK_INPUT] = work_of_mean + work_of_moment / 12.0
    step_status[rows.WORK_VISCOUS] = viscous_work


@outlined
def _modal_work(modal, h, scratch, n):
    """Return the work of modal damping in the step, J. With the row w of a mode, C = sum of w w^T,
    and the mode does the work ((w^T D0)^2 + (w^T D1)^2 / 12) / h.
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
    """Return the work of the power-law dashpots in the step, J: rise F0 + bend F1 / 12 for the rise
    and bend of the drift.
    """
    total = 0.0
    for i in range(n):
        if linear_terms[rows.POWER_DAMPER, i] != 0.0:
            rise = story_value(linear_terms, scratch, ROW.RISE, i)
            bend = story_value(linear_terms, scratch, ROW.BEND, i)
            total += rise * scratch[ROW.DASHPOT, i] + bend * scratch[ROW.DASHPOT + 1, i] / 12.0
    return total


@outlined
def _commit_braces(linear_terms, h, state, scratch):
    """Move all dampers with braces to the end of the step; `state` contains the new velocities."""
    for i in range(linear_terms.shape[1] - 1):
        if linear_terms[rows.BRACE, i] != 0.0:
            link, base = linear_terms[rows.LINK, i], base_of(linear_terms, i)
            v, v_below = state[rows.VELOCITY, i], state[rows.VELOCITY, base]
            # A0 is h times the change of the velocity.
            v_0, v_0_below = v - scratch[ROW.A0, i] / h, v_below - scratch[ROW.A0, base] / h
            first_rate, last_rate = v_0 - link * v_0_below, v - link * v_below
            mean_rate = story_value(linear_terms, scratch, ROW.RISE, i) / h
            rates = (first_rate, last_rate, last_rate, mean_rate)
            commit_brace(linear_terms, i, h, rates, state, scratch, ROW.BRACE)
