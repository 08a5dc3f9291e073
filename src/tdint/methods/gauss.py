"""Runge-Kutta method gauss4, implicit with two stages.

`tdint.methods.runge_kutta` describes the equations, the path of the hysteretic laws and Rayleigh
damping with the tangent stiffness.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, copy_rows_within, inline, outlined
from tdint.kernels.equations.iteration import (
    MAX_ITERATIONS,
    RESIDUAL_TOLERANCE,
    ROUNDING,
    TANGENT_TOLERANCE,
    UNDAMPED_ITERATIONS,
    add_rows,
    is_balanced,
    must_halve,
    squared_norm,
    tolerance_of_run,
    update_run_maxima,
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
    add_inertance,
    add_modal_force,
    below,
    finite,
    floor_load,
    has_inerters,
    power_damper,
    size_above,
    tie,
)
from tdint.kernels.stepping import Factors, step_kernel
from tdint.kernels.stories import path
from tdint.kernels.stories.brace import BRACE_RESULT_ROWS, commit_brace, follow_brace
from tdint.kernels.stories.law_state import (
    accumulate_dissipation,
    commit,
    restoring_force,
    restoring_force_outlined,
)
from tdint.methods.method import GAUSS_MEAN, Family, Method

Table = tuple[tuple[float, ...], ...]

# ---- Implicit methods with two stages
#
# The unknowns are the accelerations a_1 and a_2 of the stages: no differences of nearly equal
# displacements occur if h is small. Without the stage velocities, and because the row sums of A are
# c,
#
#     u_i = u0 + c_i h v0 + h^2 sum_j (A^2)_ij a_j
#
# The matrix of Newton's method has a 2 x 2 block per floor.

# Offsets in the coefficients of `implicit_step`
_C = 0  # nodes c_1, c_2
_A = 2  # matrix A, row by row
_A_SQUARED = 6  # A^2, row by row
_B = 10  # weights b of the velocity
_B_A = 12  # row vector b A, the weights of the displacement


class _ImplicitRows(NamedTuple):
    """Number of rows of the scratch array for each quantity; the columns are floors or stories.

    Quantities with two rows have one row per stage.
    """

    STAGE_LOAD: int = 2  # load p, N
    STAGE_A: int = 2  # accelerations a_1 and a_2: the unknowns, m/s^2
    STAGE_U: int = 2  # displacements, m
    STAGE_V: int = 2  # velocities, m/s
    STORY_FORCE: int = 2  # story forces including P-delta and dashpots, N
    FORCE_SCALE: int = 2  # absolute story force plus a bound of rounding errors, N
    RESIDUAL: int = 2  # residuals (N), overwritten by the corrections of the unknowns (m/s^2)
    TANGENT: int = 2  # tangent stiffness of the hysteretic laws, N/m
    DAMPER_TANGENT: int = 2  # tangent damping coefficient of the power-law dashpots, N s/m
    FACTORED_TANGENT: int = 2  # TANGENT in the current factorization
    FACTORED_DAMPER_TANGENT: int = 2  # DAMPER_TANGENT in the current factorization
    CORRECTION: int = 2  # copy of the last correction, which the line search may halve, m/s^2
    # Load minus inertia of each floor at both stages of the last step, N. The last column of the
    # first row contains the length of that step, s. INTERNAL_FORCE, PREDICTED_FORCE and RUN_MAXIMA
    # are used for curved laws only (`_is_curved`).
    INTERNAL_FORCE: int = 2
    PREDICTED_FORCE: int = 2  # INTERNAL_FORCE extrapolated to the stages of the present step, N
    # Maxima over the steps of the run. Column 0: sum over floors and stages of
    # (INTERNAL_FORCE - PREDICTED_FORCE)^2 / mass. Column 1: sum of mass times acceleration^2.
    RUN_MAXIMA: int = 1
    BRACE: int = BRACE_RESULT_ROWS  # results of `follow_brace`
    # Derivatives of mean and moment of the forces of dampers with braces in the factorization, N/m
    FACTORED_BRACE: int = 4
    # Impulse of tangent damping in the equations of the stages minus the exact impulse, N s
    EXCESS_IMPULSE: int = 1
    BLOCKS: int = 4  # 2 x 2 diagonal blocks of the factorization, row by row
    COUPLING: int = COUPLING_ROWS  # off-diagonal blocks of the factorization


# Dimensionless. Tolerance of the residuals for curved laws, divided by the relative mismatch of the
# run (`_store_internal_forces`), which is of order 4 in the time step. Errors of peaks change by
# less than 2 % in the problems with Bouc-Wen, tanh and stiffening stories of `tdint chart`.
_TOLERANCE_PER_MISMATCH = 2e-4

_GAUSS_SHIFT = math.sqrt(3.0) / 6.0  # distance of the nodes of gauss4 from the middle of the step

_IMPLICIT, _MODAL_STORE = rows.chained(_ImplicitRows)


@step_kernel
def implicit_step(coefficients, scene, h, load, memory):
    """Advance the state by one step of an implicit Runge-Kutta method with two stages.

    Newton's method solves the equations of all floors and both stages together. The factorization
    is reused while the time step is the same and no tangent changes by more than TANGENT_TOLERANCE.

    In a building with curved laws and without power-law dashpots (`_is_curved`), the first estimate
    is extrapolated from the stages of the last step, and the tolerance of the residuals is
    _TOLERANCE_PER_MISMATCH times the relative mismatch Q_max / S_max (`tolerance_of_run`). Q_max
    and S_max, in row RUN_MAXIMA of the scratch array, are the maxima over the steps of the run of
    two sums over floors and stages,

        Q = sum of (F - F_x)^2 / m,   S = sum of m a^2

    with the mass m of a floor, its acceleration a, its internal force F = p - m a and the value F_x
    of this force that is extrapolated from the last step. Q_max / S_max measures the error of the
    steps. One correction is then sufficient in most steps. Both the tolerance and the error are of
    order 4 in the time step, so the order of the method remains 4.

    The state row ACCELERATION is only the first estimate of the next step. The result, the number
    of linear solutions, is also 1 if the first estimate is within the tolerance.
    """
    linear_terms, modal, law_parameters, _, flags = scene
    state, _, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    factors = Factors(scratch, _IMPLICIT.BLOCKS, _IMPLICIT.COUPLING, _MODAL_STORE, linear_terms)
    a_11, a_12 = h * coefficients[_A], h * coefficients[_A + 1]
    damping = ModalBlocks(modal, a_11, a_12, h * coefficients[_A + 2], h * coefficients[_A + 3])
    _predict_stages(coefficients, scene, h, load, memory)
    tolerance = RESIDUAL_TOLERANCE
    # RUN_MAXIMA is zero, and the tolerance RESIDUAL_TOLERANCE, before the second step of a run is
    # complete, because the first step has no extrapolation, and in buildings without curved laws.
    tolerance = tolerance_of_run(scratch, _IMPLICIT.RUN_MAXIMA, _TOLERANCE_PER_MISMATCH)
    iterations = 0
    applied_fraction = 1.0  # fraction of the last correction that is applied
    previous_norm = math.inf
    # The forces of dampers with stiff braces require the line search from the first correction.
    undamped_iterations = UNDAMPED_ITERATIONS
    if FULL and flags[rows.HAS_DAMPER_STATE] != 0.0:
        undamped_iterations = 0
    while True:
        is_stale = _evaluate_stages(coefficients, linear_terms, law_parameters, h, memory)
        is_final = iterations == MAX_ITERATIONS
        # In the final evaluation, the largest residual is stored for the error message.
        if _compute_residuals(is_final, tolerance, linear_terms, modal, scratch, step_status):
            break
        if iterations >= undamped_iterations:
            norm = squared_norm(linear_terms, scratch, _IMPLICIT.RESIDUAL, n) + squared_norm(
                linear_terms, scratch, _IMPLICIT.RESIDUAL + 1, n
            )
            if must_halve(norm, previous_norm, applied_fraction):
                # Half of the part of the correction that is currently applied
                applied_fraction *= 0.5
                add_rows(-applied_fraction, scratch, _IMPLICIT.CORRECTION, _IMPLICIT.STAGE_A, 2, n)
                continue
            previous_norm = norm
            applied_fraction = 1.0
        if iterations == MAX_ITERATIONS:
            return rows.NOT_CONVERGED
        if is_stale:
            _factor_jacobian(coefficients, linear_terms, h, factors, damping)
            step_status[rows.FACTORED_STEP] = h
        # The corrections of the accelerations replace the residuals.
        solve_blocks_damped(factors, modal, _IMPLICIT.RESIDUAL, n)
        iterations += 1
        for stage in range(2):
            for i in range(n):
                scratch[_IMPLICIT.STAGE_A + stage, i] += scratch[_IMPLICIT.RESIDUAL + stage, i]
        if iterations > undamped_iterations:
            copy_rows_within(scratch, _IMPLICIT.RESIDUAL, _IMPLICIT.CORRECTION, 2)
        if flags[rows.LINEAR] != 0.0:
            break  # one solve is exact in a linear building
    if _is_curved(flags):
        _store_internal_forces(linear_terms, h, scratch)
    has_tangent_damping = flags[rows.HAS_TANGENT_DAMPING] != 0.0
    if FULL and has_tangent_damping:
        _commit_tangent_damping(coefficients, scene, h, memory)
    _commit_step(has_tangent_damping, coefficients, linear_terms, law_parameters, h, memory)
    return max(iterations, 1) if finite(state, n) else rows.NOT_FINITE


@inline
def _predict_stages(coefficients, scene, h, load, memory):
    """Compute the loads at both stages and the first estimate of the stage accelerations.

    The estimate depends on the building:

    - Linear building: zero. One solve is exact for any estimate, and zero leads to the smallest
      rounding errors.
    - Curved laws (`_is_curved`), last step of the same length h: load minus internal force, divided
      by the mass. The internal force is extrapolated linearly from the stages of the last step. The
      loads are not extrapolated, because they have kinks at the samples.
    - Otherwise: the acceleration at the start of the step.
    """
    linear_terms, _, _, forces, flags = scene
    state, _, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    use_acceleration = 0.0 if flags[rows.LINEAR] != 0.0 else 1.0
    has_last_step = _is_curved(flags) and scratch[_IMPLICIT.INTERNAL_FORCE, n] == h
    for stage in range(2):
        c = coefficients[_C + stage]
        load_row = _IMPLICIT.STAGE_LOAD + stage
        ground = load[rows.GROUND_0] + c * (load[rows.GROUND_1] - load[rows.GROUND_0])
        floor_load(linear_terms, forces, load[rows.TIME] + c * h, ground, scratch, load_row)
        for i in range(n):
            scratch[_IMPLICIT.STAGE_A + stage, i] = use_acceleration * state[rows.ACCELERATION, i]
        if has_last_step:
            # The second stage of the last step is 1 - c_2 before the start of the present step;
            # `distance` is the distance from this stage, divided by the distance c_2 - c_1 of the
            # stages.
            distance = (c + 1.0 - coefficients[_C + 1]) / (coefficients[_C + 1] - coefficients[_C])
            for i in range(n):
                force = scratch[_IMPLICIT.INTERNAL_FORCE + 1, i]
                force += distance * (force - scratch[_IMPLICIT.INTERNAL_FORCE, i])
                scratch[_IMPLICIT.PREDICTED_FORCE + stage, i] = force
                scratch[_IMPLICIT.STAGE_A + stage, i] = linear_terms[rows.INVERSE_MASS, i] * (
                    scratch[load_row, i] - force
                )
            tie(linear_terms, scratch, _IMPLICIT.STAGE_A + stage)


@inline
def _is_curved(flags):
    """Return True if a story has a curved law and no story has a power-law dashpot.

    A law is curved if its force between branch changes is a nonlinear function of the drift. The
    forces of power-law dashpots change suddenly when a story reverses: extrapolated forces are then
    a worse estimate, and the mismatch of a run does not measure its errors. With such dashpots, the
    flag BRANCHES does not show whether all laws are piecewise linear.
    """
    return (
        flags[rows.LINEAR] == 0.0
        and flags[rows.BRANCHES] != rows.ALL_BRANCHES
        and flags[rows.POWER_DAMPERS] == 0.0
    )


@inline
def _store_internal_forces(linear_terms, h, scratch):
    """Store the internal forces of both stages for the next step, and update the mismatch of the
    run (Q and S of `implicit_step`).

    The length of the step is stored in the last column of row INTERNAL_FORCE.
    """
    n = linear_terms.shape[1] - 1
    mismatch = size = 0.0
    for stage in range(2):
        for i in range(n):
            a = scratch[_IMPLICIT.STAGE_A + stage, i]
            force = scratch[_IMPLICIT.STAGE_LOAD + stage, i] - linear_terms[rows.MASS, i] * a
            difference = force - scratch[_IMPLICIT.PREDICTED_FORCE + stage, i]
            scratch[_IMPLICIT.INTERNAL_FORCE + stage, i] = force
            mismatch += linear_terms[rows.INVERSE_MASS, i] * difference * difference
            size += linear_terms[rows.MASS, i] * a * a
    # Without a last step of the same length there is no prediction.
    if scratch[_IMPLICIT.INTERNAL_FORCE, n] == h:
        update_run_maxima(scratch, _IMPLICIT.RUN_MAXIMA, mismatch, size)
    scratch[_IMPLICIT.INTERNAL_FORCE, n] = h


@inline
def _evaluate_stages(coefficients, linear_terms, law_parameters, h, memory):
    """Compute motion, story forces and tangents at both stages; return True if the factorization
    must be computed again.

    The story force includes P-delta, story damper and power-law dashpot. A change of the damping
    coefficient of a dashpot is compared with TANGENT_TOLERANCE times mass / (h |A_11|).
    """
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    is_stale = step_status[rows.FACTORED_STEP] != h
    for stage in range(2):
        # The law moves from the committed state to FIRST_TRIAL at the first stage, and from there
        # to SECOND_TRIAL. The blocks are consecutive and of equal size, so that FIRST_TRIAL is also
        # the number of rows of a block.
        previous = rows.COMMITTED + stage * rows.FIRST_TRIAL
        trial = previous + rows.FIRST_TRIAL
        elapsed = h * coefficients[_C + stage]
        v_by_a1 = h * coefficients[_A + 2 * stage]
        v_by_a2 = h * coefficients[_A + 2 * stage + 1]
        u_by_a1 = h * h * coefficients[_A_SQUARED + 2 * stage]
        u_by_a2 = h * h * coefficients[_A_SQUARED + 2 * stage + 1]
        u_below = 0.0
        v_below = 0.0
        for i in range(n):
            a1 = scratch[_IMPLICIT.STAGE_A, i]
            a2 = scratch[_IMPLICIT.STAGE_A + 1, i]
            v0 = state[rows.VELOCITY, i]
            u = state[rows.DISPLACEMENT, i] + elapsed * v0 + (u_by_a1 * a1 + u_by_a2 * a2)
            v = v0 + (v_by_a1 * a1 + v_by_a2 * a2)
            u_below = below(linear_terms, scratch, _IMPLICIT.STAGE_U + stage, i, u_below)
            v_below = below(linear_terms, scratch, _IMPLICIT.STAGE_V + stage, i, v_below)
            drift = u - linear_terms[rows.LINK, i] * u_below
            drift_rate = v - linear_terms[rows.LINK, i] * v_below
            u_below = u
            v_below = v
            scratch[_IMPLICIT.STAGE_U + stage, i] = u
            scratch[_IMPLICIT.STAGE_V + stage, i] = v
            stiffness = law_parameters[rows.STIFFNESS, i]
            tangent = restoring_force(law_parameters, law_state, i, previous, trial, drift)
            scratch[_IMPLICIT.TANGENT + stage, i] = tangent
            tangent_change = abs(tangent - scratch[_IMPLICIT.FACTORED_TANGENT + stage, i])
            is_stale = is_stale or tangent_change > TANGENT_TOLERANCE * stiffness
            damper_force, damper_tangent = power_damper(linear_terms, i, drift_rate)
            scratch[_IMPLICIT.DAMPER_TANGENT + stage, i] = damper_tangent
            # In the diagonal entries of the matrix, damping coefficients are multiplied by h A_ii
            # and added to masses. A_22 is equal to A_11 in gauss4, the only implicit method.
            change = abs(damper_tangent - scratch[_IMPLICIT.FACTORED_DAMPER_TANGENT + stage, i])
            is_stale = is_stale or (
                change * h * abs(coefficients[_A]) > TANGENT_TOLERANCE * linear_terms[rows.MASS, i]
            )
            story_force = (
                law_state[trial + rows.FORCE, i]
                + linear_terms[rows.GEOMETRIC, i] * drift
                + linear_terms[rows.STORY_DAMPER, i] * drift_rate
                + damper_force
            )
            scratch[_IMPLICIT.STORY_FORCE + stage, i] = story_force
            # Rounding errors of the displacements appear as story forces and must not prevent
            # convergence. The scale includes them divided by RESIDUAL_TOLERANCE, because the
            # convergence test multiplies the scale by a tolerance of at least this value. u - drift
            # is the displacement of the floor below.
            rounding = ROUNDING / RESIDUAL_TOLERANCE * stiffness
            scale = abs(story_force) + rounding * (abs(u) + abs(u - drift))
            scratch[_IMPLICIT.FORCE_SCALE + stage, i] = scale
    if FULL:
        for i in range(n):
            if linear_terms[rows.BRACE, i] != 0.0:
                is_stale = _add_brace(linear_terms, law_parameters, i, h, memory) or is_stale
    if FULL:
        for i in range(n):
            if linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
                _add_tangent_damping_at_stages(coefficients, linear_terms, i, h, memory)
    return is_stale


@inline
def _inverse_entry(coefficients, entry):
    """Return an entry of the inverse of the Butcher matrix, row by row."""
    determinant = (
        coefficients[_A] * coefficients[_A + 3] - coefficients[_A + 1] * coefficients[_A + 2]
    )
    cofactor = coefficients[_A + (3 - entry if entry == 0 or entry == 3 else entry)]
    return (cofactor if entry == 0 or entry == 3 else -cofactor) / determinant


@outlined
def _add_tangent_damping_at_stages(coefficients, linear_terms, i, h, memory):
    """Add the forces of tangent damping of story `i` to the story forces at both stages.

    The momentum w at stage i is w0 + h sum_j A_ij w'_j. With M v = w - b f, the equation of a stage
    contains the damping force (b / h) sum_j (A^-1)_ij (f_j - f0): b times the rate, at the stage,
    of the parabola of the law's force through the start and both stages.
    """
    _, law_state, scratch, _ = memory
    factor = linear_terms[rows.TANGENT_DAMPING, i] / h
    force_0 = law_state[rows.FORCE, i]
    change_1 = law_state[rows.FIRST_TRIAL + rows.FORCE, i] - force_0
    change_2 = law_state[rows.SECOND_TRIAL + rows.FORCE, i] - force_0
    rounding_1 = scratch[_IMPLICIT.FORCE_SCALE, i] - abs(scratch[_IMPLICIT.STORY_FORCE, i])
    rounding_2 = scratch[_IMPLICIT.FORCE_SCALE + 1, i] - abs(scratch[_IMPLICIT.STORY_FORCE + 1, i])
    for stage in range(2):
        by_1 = factor * _inverse_entry(coefficients, 2 * stage)
        by_2 = factor * _inverse_entry(coefficients, 2 * stage + 1)
        force = by_1 * change_1 + by_2 * change_2
        scratch[_IMPLICIT.STORY_FORCE + stage, i] += force
        scratch[_IMPLICIT.FORCE_SCALE + stage, i] += (
            abs(force) + abs(by_1) * rounding_1 + abs(by_2) * rounding_2
        )


@outlined
def _tangent_damping_entry(coefficients, linear_terms, h, scratch, i, entry):
    """Return the derivative of the force of tangent damping at a stage with respect to the drift
    acceleration of a stage, kg; `entry` is the index in the 2 x 2 block, row by row."""
    row, column = 2 * (entry // 2), entry % 2
    total = 0.0
    for stage in range(2):
        tangent = scratch[_IMPLICIT.TANGENT + stage, i]
        by_acceleration = coefficients[_A_SQUARED + 2 * stage + column]
        total += _inverse_entry(coefficients, row + stage) * tangent * by_acceleration
    return h * linear_terms[rows.TANGENT_DAMPING, i] * total


@outlined
def _commit_tangent_damping(coefficients, scene, h, memory):
    """Store force and work of tangent damping at the end of the step, and in row EXCESS_IMPULSE the
    excess of its impulse in the equations of the stages.

    The velocity at the end follows from the momentum at the end and the force of the law at the
    end: it receives the excess in addition. The work is the sum over both stages minus the work of
    the excess.
    """
    linear_terms = scene.linear_terms
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    b_1, b_2 = coefficients[_B], coefficients[_B + 1]
    by_1 = b_1 * _inverse_entry(coefficients, 0) + b_2 * _inverse_entry(coefficients, 2)
    by_2 = b_1 * _inverse_entry(coefficients, 1) + b_2 * _inverse_entry(coefficients, 3)
    u_below = 0.0
    for i in range(n):
        a1, a2 = scratch[_IMPLICIT.STAGE_A, i], scratch[_IMPLICIT.STAGE_A + 1, i]
        u = state[rows.DISPLACEMENT, i] + h * state[rows.VELOCITY, i]
        u += h * h * (coefficients[_B_A] * a1 + coefficients[_B_A + 1] * a2)
        drift = u - linear_terms[rows.LINK, i] * u_below
        u_below = u
        # The slope at the end, N/m, until the velocities at the end are known
        state[rows.DAMPING_FORCE, i] = restoring_force_outlined(
            scene.law_parameters, law_state, i, rows.SECOND_TRIAL, rows.THIRD_TRIAL, drift
        )
        force_0 = law_state[rows.FORCE, i]
        change_1 = law_state[rows.FIRST_TRIAL + rows.FORCE, i] - force_0
        change_2 = law_state[rows.SECOND_TRIAL + rows.FORCE, i] - force_0
        change = law_state[rows.THIRD_TRIAL + rows.FORCE, i] - force_0
        scratch[_IMPLICIT.EXCESS_IMPULSE, i] = linear_terms[rows.TANGENT_DAMPING, i] * (
            by_1 * change_1 + by_2 * change_2 - change
        )
    scratch[_IMPLICIT.EXCESS_IMPULSE, n] = 0.0
    rate_end_below = last_rate_below = 0.0
    for i in range(n):
        link, below = linear_terms[rows.LINK, i], max(i - 1, 0)
        a1, a2 = scratch[_IMPLICIT.STAGE_A, i], scratch[_IMPLICIT.STAGE_A + 1, i]
        v_stages = state[rows.VELOCITY, i] + h * (b_1 * a1 + b_2 * a2)
        v = v_stages + _excess_velocity(linear_terms, scratch, i)
        coefficient = linear_terms[rows.TANGENT_DAMPING, i]
        if coefficient != 0.0:
            excess = scratch[_IMPLICIT.EXCESS_IMPULSE, i]
            rate = v - link * rate_end_below
            mean_rate = 0.5 * (rate + v_stages - link * last_rate_below)
            state[rows.DAMPING_FORCE, i] *= coefficient * rate
            work = 0.0
            for stage in range(2):
                force = 0.0
                for other in range(2):
                    change = (
                        law_state[(other + 1) * rows.FIRST_TRIAL + rows.FORCE, i]
                        - law_state[rows.FORCE, i]
                    )
                    force += _inverse_entry(coefficients, 2 * stage + other) * change
                stage_rate = scratch[_IMPLICIT.STAGE_V + stage, i]
                stage_rate -= link * scratch[_IMPLICIT.STAGE_V + stage, below]
                work += coefficients[_B + stage] * coefficient * force * stage_rate
            state[rows.DAMPING_WORK, i] += work - excess * mean_rate
        else:
            state[rows.DAMPING_FORCE, i] = 0.0
        rate_end_below, last_rate_below = v, v_stages


@inline
def _excess_velocity(linear_terms, scratch, i):
    """Return the velocity of floor `i` by the row EXCESS_IMPULSE, m/s."""
    excess = scratch[_IMPLICIT.EXCESS_IMPULSE, i]
    excess -= linear_terms[rows.LINK, i + 1] * scratch[_IMPLICIT.EXCESS_IMPULSE, i + 1]
    return linear_terms[rows.INVERSE_MASS, i] * excess


@outlined
def _add_brace(linear_terms, law_parameters, i, h, memory):
    """Add the damper with its brace to the forces of story `i` at both stages.

    The stages are the Gauss points of `follow_brace`. The rates r_1 and r_2 at the stages determine
    the parabola of drift, rise = h (r_1 + r_2) / 2 and bend = h (r_2 - r_1) / (2 S) with S =
    _GAUSS_SHIFT, and the forces are mean -+ moment / (12 S). The return value is the same as for
    `_evaluate_stages`.
    """
    state, _, scratch, _ = memory
    link, below = linear_terms[rows.LINK, i], max(i - 1, 0)
    v_1, v_2 = scratch[_IMPLICIT.STAGE_V, i], scratch[_IMPLICIT.STAGE_V + 1, i]
    rate_1 = v_1 - link * scratch[_IMPLICIT.STAGE_V, below]
    rate_2 = v_2 - link * scratch[_IMPLICIT.STAGE_V + 1, below]
    rise, bend = 0.5 * h * (rate_1 + rate_2), 0.5 * h * (rate_2 - rate_1) / _GAUSS_SHIFT
    force_0 = state[rows.BRACE_FORCE, i]
    follow_brace(linear_terms, i, h, rise, bend, force_0, scratch, _IMPLICIT.BRACE)
    rounding = h * ROUNDING / RESIDUAL_TOLERANCE * linear_terms[rows.BRACE, i]
    for stage in range(2):
        sign = 2.0 * stage - 1.0
        force = scratch[_IMPLICIT.BRACE + path.MEAN, i]
        force += sign / (12.0 * _GAUSS_SHIFT) * scratch[_IMPLICIT.BRACE + path.MOMENT, i]
        v, rate = (v_1, rate_1) if stage == 0 else (v_2, rate_2)
        scratch[_IMPLICIT.STORY_FORCE + stage, i] += force
        # The force of the brace depends on the change of drift in the step only.
        scratch[_IMPLICIT.FORCE_SCALE + stage, i] += abs(force) + rounding * (
            abs(v) + abs(v - rate)
        )
    is_stale = False
    for row in range(4):
        change = abs(
            scratch[_IMPLICIT.BRACE + path.MEAN_BY_RISE + row, i]
            - scratch[_IMPLICIT.FACTORED_BRACE + row, i]
        )
        is_stale = is_stale or change > TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
    return is_stale


@outlined
def _brace_entry(coefficients, h, scratch, i, entry):
    """Return the derivative of the force of a brace at a stage with respect to the drift
    acceleration of a stage, kg; `entry` is the index in the 2 x 2 block, row by row.

    The derivatives with respect to the drift rates r_k follow from the derivatives of mean and
    moment (`_add_brace`). r_k has the derivative h A_kj with respect to the acceleration of stage
    j.
    """
    sign = 2.0 * (entry // 2) - 1.0
    first = _IMPLICIT.BRACE
    by_rise = scratch[first + path.MEAN_BY_RISE, i]
    by_rise += sign / (12.0 * _GAUSS_SHIFT) * scratch[first + path.MOMENT_BY_RISE, i]
    by_bend = scratch[first + path.MEAN_BY_BEND, i]
    by_bend += sign / (12.0 * _GAUSS_SHIFT) * scratch[first + path.MOMENT_BY_BEND, i]
    by_rate_1 = 0.5 * h * (by_rise - by_bend / _GAUSS_SHIFT)
    by_rate_2 = 0.5 * h * (by_rise + by_bend / _GAUSS_SHIFT)
    column = entry % 2
    return h * (by_rate_1 * coefficients[_A + column] + by_rate_2 * coefficients[_A + 2 + column])


@inline
def _compute_residuals(is_last, tolerance, linear_terms, modal, scratch, step_status):
    """Compute the residuals p - M a - C v - f(u) at both stages (N); return True if all are at most
    `tolerance` times the sum of the absolute values of their terms.

    If `is_last`, the largest relative residual above the tolerance and the index of its floor are
    stored in `step_status`.
    """
    n = linear_terms.shape[1] - 1
    step_status[rows.RESIDUAL] = 0.0
    has_converged = True
    for stage in range(2):
        velocity = _IMPLICIT.STAGE_V + stage
        residuals = _IMPLICIT.RESIDUAL + stage
        story_force = _IMPLICIT.STORY_FORCE + stage
        force_scale = _IMPLICIT.FORCE_SCALE + stage
        # The row first receives the forces of modal damping and inerters.
        for i in range(n):
            scratch[residuals, i] = 0.0
        add_modal_force(modal, scratch, velocity, 1.0, scratch, residuals, n)
        add_inertance(linear_terms, scratch, _IMPLICIT.STAGE_A + stage, 1.0, scratch, residuals)
        for i in range(n):
            load = scratch[_IMPLICIT.STAGE_LOAD + stage, i]
            inertia = linear_terms[rows.MASS, i] * scratch[_IMPLICIT.STAGE_A + stage, i]
            damping = (
                linear_terms[rows.FLOOR_DAMPER, i] * scratch[velocity, i] + scratch[residuals, i]
            )
            residual = (
                load
                - inertia
                - damping
                - scratch[story_force, i]
                + above(linear_terms, scratch, story_force, i)
            )
            scratch[residuals, i] = residual
            scale = abs(load) + abs(inertia) + abs(damping)
            scale += scratch[force_scale, i] + size_above(linear_terms, scratch, force_scale, i)
            has_converged &= is_balanced(is_last, tolerance, step_status, i, residual, scale)
    return has_converged


@inline
def _factor_jacobian(coefficients, linear_terms, h, factors, damping):
    """Factor the matrix of Newton's method for the stage accelerations.

    The matrix is I (x) M + h A (x) C + h^2 A^2 (x) K with the 2 x 2 identity matrix I, the
    Kronecker product (x) and the tangent stiffness matrix K. Each stage i uses the tangent
    stiffness and the damping coefficient of the same stage.
    """
    scratch = factors.table
    n = linear_terms.shape[1] - 1
    for entry in range(4):  # entries of a 2 x 2 block, row by row; the row is the stage
        stage = entry // 2
        m_factor = 1.0 if entry == 0 or entry == 3 else 0.0
        c_factor = h * coefficients[_A + entry]
        k_factor = h * h * coefficients[_A_SQUARED + entry]
        for i in range(n):
            damper = (
                linear_terms[rows.STORY_DAMPER, i] + scratch[_IMPLICIT.DAMPER_TANGENT + stage, i]
            )
            stiffness = scratch[_IMPLICIT.TANGENT + stage, i] + linear_terms[rows.GEOMETRIC, i]
            # `story` is the entry in the block of the story between floor i and the floor below. It
            # is added to the diagonal block of floor i here, and by `link_blocks` to that of the
            # floor below. `factor_blocks` assumes the opposite sign of the blocks between both
            # floors.
            story = k_factor * stiffness + c_factor * damper
            if FULL and linear_terms[rows.BRACE, i] != 0.0:
                story += _brace_entry(coefficients, h, scratch, i, entry)
            if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
                story += _tangent_damping_entry(coefficients, linear_terms, h, scratch, i, entry)
            mass = linear_terms[rows.MASS, i]
            if FULL and has_inerters(linear_terms):
                story += m_factor * linear_terms[rows.STORY_INERTANCE, i]
                mass += linear_terms[rows.FLOOR_INERTANCE, i]
            scratch[_IMPLICIT.COUPLING + entry, i] = story
            scratch[_IMPLICIT.BLOCKS + entry, i] = (
                m_factor * mass + c_factor * linear_terms[rows.FLOOR_DAMPER, i] + story
            )
    copy_rows_within(scratch, _IMPLICIT.TANGENT, _IMPLICIT.FACTORED_TANGENT, 2)
    copy_rows_within(scratch, _IMPLICIT.DAMPER_TANGENT, _IMPLICIT.FACTORED_DAMPER_TANGENT, 2)
    if FULL:
        tangents = _IMPLICIT.BRACE + path.MEAN_BY_RISE
        copy_rows_within(scratch, tangents, _IMPLICIT.FACTORED_BRACE, 4)
    link_blocks(linear_terms, factors, n)
    factor_blocks(factors, damping, n)


@inline
def _commit_step(has_tangent_damping, coefficients, linear_terms, law_parameters, h, memory):
    """Update the state and commit the hysteretic laws at the end of the step, on the path through
    both stages.

    The acceleration, the first estimate of the next step, is extrapolated linearly from both
    stages.
    """
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    # Distance of the end of the step from the second stage, divided by the distance of both stages
    extrapolation = (1.0 - coefficients[_C + 1]) / (coefficients[_C + 1] - coefficients[_C])
    u_below = v0_below = u0_below = 0.0
    for i in range(n):
        a1 = scratch[_IMPLICIT.STAGE_A, i]
        a2 = scratch[_IMPLICIT.STAGE_A + 1, i]
        u0 = state[rows.DISPLACEMENT, i]
        v0 = state[rows.VELOCITY, i]
        u1 = u0 + h * v0 + h * h * (coefficients[_B_A] * a1 + coefficients[_B_A + 1] * a2)
        state[rows.DISPLACEMENT, i] = u1
        state[rows.VELOCITY, i] = v0 + h * (coefficients[_B] * a1 + coefficients[_B + 1] * a2)
        if FULL and has_tangent_damping:
            state[rows.VELOCITY, i] += _excess_velocity(linear_terms, scratch, i)
        state[rows.ACCELERATION, i] = a2 + extrapolation * (a2 - a1)
        accumulate_dissipation(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        accumulate_dissipation(law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
        u_below = below(linear_terms, state, rows.DISPLACEMENT, i, u_below)
        drift = u1 - linear_terms[rows.LINK, i] * u_below
        restoring_force(law_parameters, law_state, i, rows.SECOND_TRIAL, rows.THIRD_TRIAL, drift)
        commit(law_parameters, law_state, i, rows.SECOND_TRIAL, rows.THIRD_TRIAL)
        u_below = u1
        if FULL:
            if linear_terms[rows.BRACE, i] != 0.0:
                link = linear_terms[rows.LINK, i]
                first_rate = v0 - link * v0_below
                last_rate = state[rows.VELOCITY, i] - link * state[rows.VELOCITY, max(i - 1, 0)]
                rates = (first_rate, last_rate, last_rate, (drift - u0 + link * u0_below) / h)
                commit_brace(linear_terms, i, h, rates, state, scratch, _IMPLICIT.BRACE)
            v0_below, u0_below = v0, u0


def implicit_coefficients(table: Table, weights: tuple[float, ...]) -> tuple[float, ...]:
    """Return the coefficients of `implicit_step`: nodes c, A, A^2, weights b and b A.

    Parameters
    ----------
    table : tuple of tuple of float
        Butcher matrix A, 2 x 2. The nodes are the sums of its rows.
    weights : tuple of float
        Weights b of both stages.

    Returns
    -------
    tuple of float
        c, A, A^2, b and b A in this order; matrices row by row (14 values).
    """
    a, b = np.array(table), np.array(weights)
    groups = (a.sum(axis=1), a, a @ a, b, b @ a)
    return tuple(float(number) for group in groups for number in group.ravel())


# Gauss method with two stages: nodes 1/2 -+ sqrt(3) / 6, weights 1/2
GAUSS: Table = ((0.25, 0.25 - _GAUSS_SHIFT), (0.25 + _GAUSS_SHIFT, 0.25))


# The acceleration is only a first estimate.
IMPLICIT = Family(
    "runge-kutta",
    implicit_step,
    lambda modes: _MODAL_STORE + 6 * modes + 1,  # rows for modal damping: see `factor_blocks`
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
    mean_rule=GAUSS_MEAN,
    devices=True,
    inertance=True,
)

METHODS = (
    Method(
        name="gauss4",
        family=IMPLICIT,
        coefficients=lambda: implicit_coefficients(GAUSS, (0.5, 0.5)),
        order=lambda: 4,
        rho_inf=lambda: 1.0,
        braces=True,
        tangent_damping=lambda: True,
        source="two-stage Gauss method, Kuntzmann (1961) and Butcher (1964)",
    ),
)
