"""Response of all floors over a step of `impulse4`: the impulse-momentum step with the integrated
restoring force.

Displacement, velocity and acceleration of a floor are u0, v0, a0 at the start and u1, v1, a1 at the
end of the step of length h. The unknowns are u1 - u0 and v1 - v0 of each floor; a1 is eliminated by
equilibrium. The restoring force f is integrated over the step by a quadrature rule with an inner
point (suffix `_c`):

    kinematics    u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
    momentum      M (v1 - v0) + C (u1 - u0) + h (w0 f(u0) + wc f(uc) + w1 f(u1)) = I
    equilibrium   M a1 + C v1 + f(u1) = p1
    inner point   uc = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1)

with the impulse I of the load over the step and the load p1 at its end. `tdint.methods.impulse4`
contains the derivation and the coefficients.

If no law changes its branch in the step, f is linear and a complex linear system gives the response
(`solve_linear`); otherwise `newton` iterates. The force of a curved law has a kink at a reversal of
the drift, where its tangent changes suddenly. The caller divides the step at a reversal, unless row
KINK of the story states that its effect is negligible (`_evaluate_over_reversal`,
`keep_negligible_kinks`).

Docstrings use these symbols. `tdint.kernels.layout` describes the arguments; `factors` is the first
scratch row of a factorization (`_Block`, `factor_rows`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, copy_rows_within, inline, outlined
from tdint.kernels.equations import impulse_momentum as momentum
from tdint.kernels.equations.impulse_momentum import (
    correct,
    has_converged,
    residuals,
    store_first_guess,
)
from tdint.kernels.equations.iteration import (
    MAX_ITERATIONS,
    RESIDUAL_TOLERANCE,
    ROUNDING,
    TANGENT_TOLERANCE,
    UNDAMPED_ITERATIONS,
    add_rows,
    must_halve,
    squared_norm,
    tolerance_of_run,
    update_run_maxima,
)
from tdint.kernels.equations.tridiagonal import (
    COUPLING_ROWS,
    ModalBlocks,
    assemble_blocks,
    factor_blocks,
    factor_pairs,
    solve_pairs_damped,
)
from tdint.kernels.linear_terms import (
    above,
    add_inertance,
    add_modal_force,
    base_of,
    distribute,
    floor_impulse,
    floor_load,
    has_inerters,
    is_tree,
    power_damper,
    story_value,
    tie,
    upper_of,
)
from tdint.kernels.stepping import Factors
from tdint.kernels.stories import path
from tdint.kernels.stories.brace import BRACE_RESULT_ROWS, follow_brace
from tdint.kernels.stories.branches import find_sign_change, turns_at_reversal
from tdint.kernels.stories.impact import damping_potential, has_impact
from tdint.kernels.stories.law_state import (
    restoring_force_on_branches,
    restoring_force_outlined,
)

# Indices of the coefficients (`tdint.methods.impulse4.coefficients`)
THETA = 0  # coefficients th, al and be of the kinematic equation
ALPHA = 1
BETA = 2
# Weights w0, wc and w1 of the story forces at the start, at the inner point and at the end
WEIGHT_0 = 3
WEIGHT_C = 4
WEIGHT_1 = 5
# Displacement at the inner point: uc = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1)
BY_INCREMENT = 6  # coefficient gd
BY_VELOCITY_0 = 7  # coefficient g0
BY_VELOCITY_1 = 8  # coefficient g1
# Velocity at the inner point: vc = these three coefficients times (u1 - u0) / h, v0 and v1
RATE_BY_INCREMENT = 9
RATE_BY_VELOCITY_0 = 10
RATE_BY_VELOCITY_1 = 11
# Real and imaginary part of l / h with the complex root l of l^2 - th h l + be h^2 = 0
ROOT_RE = 12
ROOT_IM = 13


class _Rows(NamedTuple):
    """Number of scratch rows of each quantity, in addition to the rows of the momentum
    equations."""

    # Tangent stiffnesses of the laws at the inner point and at the end of the step, N/m
    TANGENT_C: int = 1
    TANGENT_1: int = 1
    # Derivatives of the forces of power-law dashpots with respect to the drift rate, at the inner
    # point and at the end of the step, N s/m
    SLOPE_C: int = 1
    SLOPE_1: int = 1
    LAST_CORRECTION: int = 2  # last corrections of DU (m) and DV (m/s)
    # Change of the force due to the kink at a reversal of a curved law within the step, relative to
    # the force at the reversal; 0 if there is no reversal, or if it must be located
    KINK: int = 1
    # First row of the trial state that precedes the state at the end of the step: the later of the
    # inner point and the reversal. It is used only if KINK is not 0.
    PREVIOUS_BLOCK: int = 1
    # Average of the force of a power-law dashpot or of a damper with a brace at the two endpoints
    # minus its mean over the step, N
    DASHPOT_MISMATCH: int = 1
    BRACE: int = BRACE_RESULT_ROWS  # results of `follow_brace`
    TANGENT_WORK: int = 1  # work of tangent damping in the step, J
    DAMPING_SLOPE: int = 1  # `damping_slope` at the end of the step
    # Real and imaginary part of the right side r1 + l r2, then of the solution w (`solve_linear`)
    COMPLEX: int = 2
    # State and law states at the start of a step that is divided into substeps, for its repetition
    SAVED: int = 4 + rows.LAW_STATE_ROWS
    SAVED_ADDED: int = rows.ADDED_STATE_ROWS
    SUBSTEP_START: int = 3  # displacement, velocity and acceleration at the start of a substep
    # Distance of the drift from the limit of the branch (m), story force (N) and floor acceleration
    # (m/s^2) at the end of a substep, for the peaks
    END_EXCESS: int = 1
    END_FORCE: int = 1
    END_ACCELERATION: int = 1
    # Maxima over the run, which `keep_negligible_kinks` updates: mismatch of the mean acceleration
    # (column 0) and squared norm of the accelerations (column 1)
    RUN_MAXIMA: int = 1
    # Largest absolute drift at the start of a step of the run, also before a restart
    LARGEST_DRIFT: int = 1
    LOCATED: int = rows.LOCATED_ROWS  # reversals and instants within the substep
    # Peaks within the substeps, then the largest acceleration of each floor at a substep end (with
    # its sign, m/s^2) and its time (s)
    PEAKS: int = 2 * rows.PEAK_ROWS + 2
    # DU and DV from the start of the substep to the end of the step: the solution before the
    # substep was shortened
    REMAINING: int = 2


class _Block(NamedTuple):
    """Rows of a factorization: of the complex matrix for linear branches, and of the matrix of
    Newton's method."""

    # Stiffnesses for which the complex matrix was factorized, N/m; the last column contains the
    # length of the step, s
    LINEAR_SLOPES: int = 1
    # Pivots and multipliers of the complex factorization: real and imaginary part
    PIVOT: int = 2
    MULTIPLIER: int = 2
    # Tangents at the inner point and at the end for which the matrix of Newton's method was
    # factorized, N/m; the last column of FACTORED_1 contains the length of the step, s
    FACTORED_C: int = 1
    FACTORED_1: int = 1
    FACTORED_SLOPE: int = 1  # SLOPE_1 of the factorized matrix, N s/m
    # Derivatives of mean and moment of the forces of dampers with braces, N/m
    FACTORED_BRACE: int = 4
    BLOCKS: int = 4  # 2 x 2 diagonal blocks of the factorization
    COUPLING: int = COUPLING_ROWS  # blocks between adjacent floors


# The following three values decide which reversals are not located (`keep_negligible_kinks`). They
# were determined with the problems with Bouc-Wen stories and power-law dashpots of `tdint chart`.

# Dimensionless. Maximum kink relative to the error of a step: condition 1 of
# `keep_negligible_kinks`.
_MAX_KINK = 15.0
# Dimensionless. Fraction of the dashpot force that is added to the kink of the law. Without it, the
# errors of small steps are ten times as large.
_DASHPOT_KINK = 0.003
# Fraction of the current peak drift: condition 2 of `keep_negligible_kinks`.
_NEAR_PEAK = 0.8

# Dimensionless. Tolerance of the residuals in Newton's method, divided by the relative mismatch of
# the mean acceleration in the run (`tolerance_of_run`), which is of order 4 in the time step. With
# 0.01, the errors of peak drifts change by less than 2 % in buildings with Bouc-Wen, tanh and
# stiffening stories and with power-law dashpots.
_TOLERANCE_PER_MISMATCH = 1e-2

ROW, FACTORS = rows.chained(_Rows, momentum.MOMENTUM_ROWS)
_BLOCK, _STORE = rows.chained(_Block)


@inline
def factor_rows(modes):
    """Return the number of rows of a factorization for a building with `modes` modally damped
    modes.

    The rows of `_Block` are followed by 6 modes + 1 rows for the matrix of Newton's method, and
    then by the same number of rows for the complex matrix of linear branches: the terms of the
    Woodbury formula for modal damping. Both matrices have a pair of unknowns per floor
    (displacement and velocity, or real and imaginary part). A mode therefore has

        four rows    two solutions of two rows. The right side of a solution is the mode vector,
                     in the equations of the first or of the second unknown of the pair.
        two rows     rows of the small inverse, with an order of 2 times the number of modes.

    The remaining row is a temporary row.
    """
    return _STORE + 2 * (6 * modes + 1)


@inline
def store_load(scene, t, h, ground, scratch):
    """Store the load at the end of the step, LOAD (N), and its exact impulse over [t, t + h],
    IMPULSE (N s).

    The load is -m ag + forces on floors. The ground acceleration ag is linear within the step,
    between the values in `ground`.
    """
    ground_0, ground_1 = ground
    linear_terms, _, _, forces, _ = scene
    floor_load(linear_terms, forces, t + h, ground_1, scratch, momentum.LOAD)
    floor_impulse(linear_terms, forces, t, h, ground_0, ground_1, scratch, momentum.IMPULSE)


@inline
def solve_linear(coefficients, scene, h, memory, factors):
    """Compute the response over a step without a branch change by a single linear solution.

    With the increments du = u1 - u0 and dv = v1 - v0, the stiffness matrix K of the branches and
    the damping matrix C, the equations of kinematics (times M) and momentum are

        (M - be h^2 K) du - (th h M + be h^2 C) dv = r1,   (C + th h K) du + (M - be h^2 K) dv = r2

    where r1 and r2 are the residuals for du = dv = 0 (`_right_side`). With a complex root l of l^2
    - th h l + be h^2 = 0, the first equation plus l times the second equation is a single complex
    equation,

        (M + l C + l^2 K) w = r1 + l r2,   w = du - conj(l) dv

    with a symmetric tridiagonal matrix.
    """
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    root_re = coefficients[ROOT_RE] * h
    root_im = coefficients[ROOT_IM] * h
    pivot, multiplier = factors + _BLOCK.PIVOT, factors + _BLOCK.MULTIPLIER
    store = factors + _STORE + 6 * modal.shape[0] + 1
    factorization = Factors(scratch, pivot, multiplier, store, linear_terms)
    # The modal part of l C multiplies a pair (real part, imaginary part) by l.
    damping = ModalBlocks(modal, root_re, -root_im, root_im, root_re)
    # `_right_side` compares the factorization with the stiffnesses and with h, because its loop
    # over the stories reads the stiffnesses.
    slopes_row = factors + _BLOCK.LINEAR_SLOPES
    is_stale = _right_side(coefficients, scene, h, memory, slopes_row)
    if is_stale:
        for i in range(n):
            scratch[slopes_row, i] = law_state[rows.SLOPE, i]
        scratch[slopes_row, n] = h
        factor_pairs(linear_terms, law_state, (root_re, root_im), factorization, damping, n)
    solve_pairs_damped(factorization, modal, ROW.COMPLEX, n)
    _store_response(linear_terms, modal, (root_re, root_im), state, law_state, scratch)


@inline
def _right_side(coefficients, scene, h, memory, slopes_row):
    """Store r1 + l r2 of `solve_linear` in the rows COMPLEX; return True if the matrix must be
    factorized again, because a stiffness in row `slopes_row` or the length of the step in its last
    column has changed.

        r1 = M (h v0 + h^2 (al a0 - be a1)),   M a1 = p1 - C v0 - f(u0)     kinematics
        r2 = I - h (f(u0) + wc K (uc - u0)),   uc - u0 = h (g0 + g1) v0     momentum

    f and K include P-delta. The sum of the weights w0, wc and w1 is 1.
    """
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    root_re = coefficients[ROOT_RE] * h
    root_im = coefficients[ROOT_IM] * h
    # Weight of the inner point times h (g0 + g1): change of the mean force per stiffness and drift
    # rate.
    by_rate = (
        coefficients[WEIGHT_C] * h * (coefficients[BY_VELOCITY_0] + coefficients[BY_VELOCITY_1])
    )
    by_a0 = coefficients[ALPHA] * h * h
    by_a1 = coefficients[BETA] * h * h
    is_stale = scratch[slopes_row, n] != h
    force_above = 0.0
    impulse_above = 0.0
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = n
    while i > 0:
        i -= 1
        is_stale |= law_state[rows.SLOPE, i] != scratch[slopes_row, i]
        link = linear_terms[rows.LINK, i]
        mass = linear_terms[rows.MASS, i]
        geometric = linear_terms[rows.GEOMETRIC, i]
        v = state[rows.VELOCITY, i]
        rate = v - link * state[rows.VELOCITY, base_of(linear_terms, i)]
        spring_force = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        # The story dampers do not contribute to the impulse for u1 = u0.
        force = spring_force + linear_terms[rows.STORY_DAMPER, i] * rate
        impulse = h * (spring_force + by_rate * (law_state[rows.SLOPE, i] + geometric) * rate)
        if FULL and is_tree(linear_terms):
            scratch[momentum.FORCE_1, i] = force
            scratch[momentum.FORCE_S, i] = impulse
            force_above = above(linear_terms, scratch, momentum.FORCE_1, i)
            impulse_above = above(linear_terms, scratch, momentum.FORCE_S, i)
        mass_times_a1 = (
            scratch[momentum.LOAD, i]
            - linear_terms[rows.FLOOR_DAMPER, i] * v
            - (force - force_above)
        )
        momentum_residual = scratch[momentum.IMPULSE, i] - (impulse - impulse_above)
        scratch[ROW.COMPLEX, i] = (
            mass * (h * v + by_a0 * state[rows.ACCELERATION, i])
            - by_a1 * mass_times_a1
            + root_re * momentum_residual
        )
        scratch[ROW.COMPLEX + 1, i] = root_im * momentum_residual
        force_above = link * force
        impulse_above = link * impulse
    # Modal damping is not included in `mass_times_a1`. Its force -C v0 adds be h^2 C v0 to r1.
    add_modal_force(modal, state, rows.VELOCITY, by_a1, scratch, ROW.COMPLEX, n)
    add_inertance(linear_terms, state, rows.VELOCITY, h, scratch, ROW.COMPLEX)
    add_inertance(linear_terms, state, rows.ACCELERATION, by_a0, scratch, ROW.COMPLEX)
    return is_stale


@inline
def _store_response(linear_terms, modal, root, state, law_state, scratch):
    """Compute the response at the end of the step from the solution w of `solve_linear`, in the
    rows COMPLEX.

    The increments follow from w = du - conj(l) dv, `root` = l (s), and the accelerations from
    equilibrium:

        dv = im(w) / im(l),   du = re(w) + re(l) dv,   a1 = (p1 - C v1 - f(u1)) / m
    """
    n = linear_terms.shape[1] - 1
    re, im = root
    by_im = 1.0 / im
    # The force of story `i` requires the increments of floors `i` and `i - 1`. `du_below` and
    # `dv_below` are the increments of the next pass; before the loop, they are the increments of
    # the roof.
    force_above = 0.0
    dv_below = scratch[ROW.COMPLEX + 1, n - 1] * by_im
    du_below = scratch[ROW.COMPLEX, n - 1] + re * dv_below
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = n
    while i > 0:
        i -= 1
        link = linear_terms[rows.LINK, i]
        base = base_of(linear_terms, i)
        du = du_below
        dv = dv_below
        if FULL and is_tree(linear_terms):
            dv = scratch[ROW.COMPLEX + 1, i] * by_im
            du = scratch[ROW.COMPLEX, i] + re * dv
        dv_below = scratch[ROW.COMPLEX + 1, base] * by_im
        du_below = scratch[ROW.COMPLEX, base] + re * dv_below
        v = state[rows.VELOCITY, i] + dv
        scratch[momentum.DU, i] = du
        scratch[momentum.DV, i] = dv
        scratch[momentum.U1, i] = state[rows.DISPLACEMENT, i] + du
        scratch[momentum.V1, i] = v
        geometric = linear_terms[rows.GEOMETRIC, i]
        force = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        force += (law_state[rows.SLOPE, i] + geometric) * (du - link * du_below)
        force += linear_terms[rows.STORY_DAMPER, i] * (
            v - link * (state[rows.VELOCITY, base] + dv_below)
        )
        if FULL and is_tree(linear_terms):
            scratch[momentum.FORCE_1, i] = force
            force_above = above(linear_terms, scratch, momentum.FORCE_1, i)
        floor_force = scratch[momentum.LOAD, i] - linear_terms[rows.FLOOR_DAMPER, i] * v
        scratch[momentum.A1, i] = linear_terms[rows.INVERSE_MASS, i] * (
            floor_force - (force - force_above)
        )
        force_above = link * force
    if FULL and modal.shape[0] > 0:
        _add_modal_acceleration(linear_terms, modal, scratch, n)
    distribute(linear_terms, scratch, momentum.A1)
    tie(linear_terms, scratch, momentum.A1)


@outlined
def _add_modal_acceleration(linear_terms, modal, scratch, n):
    """Add the effect of modal damping, -C v1 / m, to row A1. Row FORCE_1 is used for the forces."""
    for i in range(n):
        scratch[momentum.FORCE_1, i] = 0.0
    add_modal_force(modal, scratch, momentum.V1, -1.0, scratch, momentum.FORCE_1, n)
    for i in range(n):
        scratch[momentum.A1, i] += linear_terms[rows.INVERSE_MASS, i] * scratch[momentum.FORCE_1, i]


@outlined
def newton(keep_branches, has_guess, coefficients, scene, h, memory, factors):
    """Compute the response over a step by Newton's method for all stories together. Return the
    number of linear solutions (at least 1), or NOT_CONVERGED (negative) if the residuals are too
    large after MAX_ITERATIONS solutions.

    The iteration ends if all residuals are within the tolerance, or if the last correction of the
    displacements was of the order of rounding errors. The first UNDAMPED_ITERATIONS corrections are
    applied fully. A later correction is halved until it reduces the residuals, because the
    iteration could cycle without convergence at kinks of the laws.

    The tolerance of the residuals is proportional to a measure of the largest error of a step in
    the run (`tolerance_of_run`). Both are of order 4 in the time step. The order of the method
    therefore remains 4, and coarse steps need fewer iterations.

    With `keep_branches`, stories with a linear branch remain on this branch (`_evaluate_law`). With
    `has_guess`, the rows DU and DV contain the first estimate; otherwise it is the motion with
    constant acceleration.
    """
    linear_terms, modal, _, _, _ = scene
    state, _, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    kinematics = coefficients[THETA], coefficients[ALPHA], coefficients[BETA]
    if not has_guess:
        store_first_guess(1.0, h, state, scratch, n)
    # In the first step, the maxima in row RUN_MAXIMA are 0 and the tolerance is RESIDUAL_TOLERANCE,
    # its minimum.
    tolerance = tolerance_of_run(scratch, ROW.RUN_MAXIMA, _TOLERANCE_PER_MISMATCH)
    iterations = 0
    applied_fraction = 1.0
    previous_norm = math.inf
    is_correction_negligible = False
    # The forces of dampers with stiff braces require the line search from the first correction. At
    # the end of a step, they can exceed the mean forces by orders of magnitude, so that a relative
    # tolerance must be strict.
    undamped_iterations = UNDAMPED_ITERATIONS
    if FULL and scene.flags[rows.HAS_DAMPER_STATE] != 0.0:
        undamped_iterations = 0
        tolerance = RESIDUAL_TOLERANCE
    while True:
        is_stale = _evaluate_laws(keep_branches, coefficients, scene, h, memory, factors)
        residuals(kinematics, scene, h, memory)
        is_final = iterations == MAX_ITERATIONS
        is_balanced = has_converged(is_final, tolerance, kinematics, scene, h, memory)
        if is_balanced or is_correction_negligible:
            break
        # Line search. R1 (kg m) divided by h and R2 have the unit N s.
        if iterations >= undamped_iterations:
            norm = squared_norm(linear_terms, scratch, momentum.R1, n) / (h * h) + squared_norm(
                linear_terms, scratch, momentum.R2, n
            )
            if must_halve(norm, previous_norm, applied_fraction):
                applied_fraction *= 0.5
                add_rows(-applied_fraction, scratch, ROW.LAST_CORRECTION, momentum.DU, 2, n)
                continue
            previous_norm = norm
            applied_fraction = 1.0
        if is_final:
            return rows.NOT_CONVERGED
        if is_stale:
            _factor(coefficients, linear_terms, modal, h, scratch, factors)
        is_correction_negligible = correct(
            modal, _newton_factorization(linear_terms, scratch, factors), n
        )
        iterations += 1
        # `correct` has replaced the residuals in the rows R1 and R2 by the corrections of DU and
        # DV.
        if iterations > undamped_iterations:
            copy_rows_within(scratch, momentum.R1, ROW.LAST_CORRECTION, 2)
    return max(iterations, 1)


@inline
def _evaluate_laws(keep_branches, coefficients, scene, h, memory, factors):
    """Compute the story forces and their impulses for the increments in the rows DU and DV; return
    True if the matrix must be factorized again, because a tangent or the length of the step has
    changed.

        force   = f1 + c (drift rate at the end)                     row FORCE_1, N
        impulse = h (w0 f0 + wc fc + w1 f1) + c (d1 - d0)            row FORCE_S, N s

    with the force f of a story (law and P-delta), its damper c and its drift d. The rows U1, V1,
    TANGENT_C and TANGENT_1 (without P-delta) are also set, and SIZE: the force that corresponds to
    the rounding errors of the displacements, divided by RESIDUAL_TOLERANCE (N).
    """
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    is_stale = scratch[factors + _BLOCK.FACTORED_1, n] != h
    uc_below = 0.0
    u_below = 0.0
    v_below = 0.0
    du_below = 0.0
    for i in range(n):
        du = scratch[momentum.DU, i]
        u = state[rows.DISPLACEMENT, i] + du
        v = state[rows.VELOCITY, i] + scratch[momentum.DV, i]
        uc = _inner_displacement(coefficients, h, state, i, du, v)
        scratch[momentum.U1, i] = u
        scratch[momentum.V1, i] = v
        link = linear_terms[rows.LINK, i]
        if FULL and is_tree(linear_terms):
            base = base_of(linear_terms, i)
            u_below, v_below = scratch[momentum.U1, base], scratch[momentum.V1, base]
            du_below = scratch[momentum.DU, base]
            uc_below = _inner_displacement(coefficients, h, state, base, du_below, v_below)
        drift_c = uc - link * uc_below
        drift = u - link * u_below
        increment = du - link * du_below
        rate = v - link * v_below
        tangent_c, force_c, tangent, force = _evaluate_law(
            keep_branches, coefficients, scene, h, i, (drift_c, drift), memory
        )
        tangent_tolerance = TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        change = abs(tangent_c - scratch[factors + _BLOCK.FACTORED_C, i])
        is_stale = is_stale or change > tangent_tolerance
        change = abs(tangent - scratch[factors + _BLOCK.FACTORED_1, i])
        is_stale = is_stale or change > tangent_tolerance
        # A drift is a difference of displacements. Their rounding errors change the story force by
        # about ROUNDING times stiffness times displacements, so that residuals up to this force
        # must be accepted.
        rounding = ROUNDING / RESIDUAL_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        scratch[momentum.SIZE, i] = rounding * (abs(u) + abs(link * u_below))
        scratch[ROW.TANGENT_C, i] = tangent_c
        scratch[ROW.TANGENT_1, i] = tangent
        # Mean of restoring force and P-delta over the step, N
        geometric = linear_terms[rows.GEOMETRIC, i]
        mean = (
            coefficients[WEIGHT_0]
            * (law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i])
            + coefficients[WEIGHT_C] * (force_c + geometric * drift_c)
            + coefficients[WEIGHT_1] * (force + geometric * drift)
        )
        damper = linear_terms[rows.STORY_DAMPER, i]
        scratch[momentum.FORCE_1, i] = force + geometric * drift + damper * rate
        scratch[momentum.FORCE_S, i] = h * mean + damper * increment
        if linear_terms[rows.POWER_DAMPER, i] != 0.0:
            is_stale = (
                _add_damper(coefficients, linear_terms, i, h, increment, memory, factors)
                or is_stale
            )
        if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
            law_mean = mean - geometric * (
                coefficients[WEIGHT_0] * law_state[rows.DRIFT, i]
                + coefficients[WEIGHT_C] * drift_c
                + coefficients[WEIGHT_1] * drift
            )
            law = law_state[rows.FORCE, i], force, law_mean, tangent
            if has_impact(law_parameters, i):
                law = _impact_potential(
                    coefficients, law_parameters, law_state, i, (drift_c, drift), (force_c, force)
                )
            _add_tangent_damping(linear_terms, i, h, law, increment, memory)
        if FULL and linear_terms[rows.BRACE, i] != 0.0:
            dv_below = scratch[momentum.DV, base_of(linear_terms, i)]
            bend = h * (scratch[momentum.DV, i] - link * dv_below)
            is_stale = _add_brace(scene, i, h, increment, bend, memory, factors) or is_stale
        uc_below = uc
        u_below = u
        v_below = v
        du_below = du
    return is_stale


@inline
def _inner_displacement(coefficients, h, state, i, du, v):
    """Return the displacement of floor `i` at the inner point, m, for the increment `du` and the
    velocity `v` at the end."""
    velocities = (
        coefficients[BY_VELOCITY_0] * state[rows.VELOCITY, i] + coefficients[BY_VELOCITY_1] * v
    )
    return state[rows.DISPLACEMENT, i] + coefficients[BY_INCREMENT] * du + h * velocities


@inline
def _evaluate_law(keep_branches, coefficients, scene, h, i, drifts, memory):
    """Evaluate the law of story `i` at the inner point and at the end of the step (`drifts`, m).
    Return tangent stiffness (N/m) and force (N) at the inner point and at the end.

    There are three cases:

    1. `keep_branches` is True, and the story is on a linear branch: the branch is extended.
    2. `keep_branches` is True, and the drift of a curved law reverses within the step:
       `_evaluate_over_reversal` moves the law to the inner point, the reversal and the end in
       chronological order. If a law of the building has extra rows, case 3 replaces case 2.
    3. Otherwise the law moves from the start of the step to the inner point, and then to the end.

    In cases 2 and 3, FIRST_TRIAL receives the state at the inner point and SECOND_TRIAL the state
    at the end. `keep_branches` means that the caller divides the step at branch changes and
    reversals. A reversal with a negligible effect remains within the step (row KINK, which is set
    to 0 in cases 1 and 3). Otherwise the complete step is solved, no branch change or reversal is
    located, and row KINK is not changed.
    """
    _, law_state, scratch, _ = memory
    drift_c, drift = drifts
    if keep_branches and law_state[rows.SLOPE, i] < math.inf:
        tangent_c = tangent = law_state[rows.SLOPE, i]
        scratch[ROW.KINK, i] = 0.0
        force_c = law_state[rows.FORCE, i] + tangent * (drift_c - law_state[rows.DRIFT, i])
        force = law_state[rows.FORCE, i] + tangent * (drift - law_state[rows.DRIFT, i])
    else:
        is_reversed = False
        if keep_branches:
            tangent_c, tangent, is_reversed = _evaluate_over_reversal(
                coefficients, scene, h, i, drifts, memory
            )
        if not is_reversed:
            inner, end = rows.FIRST_TRIAL, rows.SECOND_TRIAL
            tangent_c = _force(keep_branches, scene, law_state, i, 0, inner, drift_c)
            tangent = _force(keep_branches, scene, law_state, i, inner, end, drift)
        if FULL and keep_branches and not is_reversed:
            tangent = _tangent_on_branch(scene, law_state, i, drift, tangent)
        force_c = law_state[rows.FIRST_TRIAL + rows.FORCE, i]
        force = law_state[rows.SECOND_TRIAL + rows.FORCE, i]
    return tangent_c, force_c, tangent, force


@outlined
def _tangent_on_branch(scene, law_state, i, drift, tangent):
    """Return the tangent stiffness at the end of a substep, or at the limit of the branch of a
    curved law, if `drift` is beyond it and the story has tangent damping (N/m).

    The force of tangent damping jumps where a loop closes. A substep ends at this drift, within a
    tolerance, and has the force before the jump; otherwise no drift satisfies its equations.
    """
    limited = min(max(drift, law_state[rows.LOWER, i]), law_state[rows.UPPER, i])
    if limited == drift or scene.linear_terms[rows.TANGENT_DAMPING, i] == 0.0:
        return tangent
    tangent = _force(True, scene, law_state, i, 0, rows.SECOND_TRIAL, limited)
    _force(True, scene, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL, drift)
    return tangent


@inline
def _force(keep_branches, scene, law_state, i, previous, trial, drift):
    """Compute the force of story `i`. With `keep_branches`, its elements remain on their linear
    branches."""
    if FULL and keep_branches:
        return restoring_force_on_branches(
            scene.law_parameters, law_state, i, previous, trial, drift
        )
    return restoring_force_outlined(scene.law_parameters, law_state, i, previous, trial, drift)


@outlined
def _evaluate_over_reversal(coefficients, scene, h, i, drifts, memory):
    """Evaluate a curved law of story `i` over a step within which its drift reverses.

    The drift reverses if its rate has the direction of loading at the start of the step and the
    opposite direction at the end. The law then moves to three drifts in chronological order. The
    reversal can be before or after the inner point:

        FIRST_TRIAL     inner point
        SECOND_TRIAL    end of the step
        THIRD_TRIAL     reversal

    Row PREVIOUS_BLOCK receives the block that precedes the end, in which order `_update_state`
    (`tdint.methods.impulse4`) later accumulates the dissipated energy.

    The law is not evaluated, and KINK is set to 0, if the story does not reverse, if a linear
    branch of one of its elements ends at the reversal, or if a law of the building has extra rows:
    THIRD_TRIAL then contains these rows at the start of the step (`_save_start` of impulse4).
    KINK 0 means that a reversal of the story must be located (`first_event`).

    The drift within the step is the cubic Hermite interpolant of the drifts d0, d1 and drift rates
    at both endpoints. The time s is 0 at the start and 1 at the end of the step. With r = 1 - s,
    and with h times the drift rates at the start, q0, and at the end, q1 (m),

        d(s)  = d0 + s^2 (3 - 2 s) (d1 - d0) + s r (r q0 - s q1)
        d'(s) = r^2 q0 + 2 s r (3 (d1 - d0) - q0 - q1) + s^2 q1

    The reversal is the zero of d'(s). At the kink, the quadrature has an additional error, which
    row KINK estimates as a fraction of the force f_r at the reversal:

        KINK = (|k1 - k_r| min(distance before, distance after) + dashpot) / |f_r|

    k_r and k1 are the tangent stiffnesses at the reversal, before it, and at the end of the step.
    The distances are the changes of drift from the start to the reversal and from the reversal to
    the end. `dashpot` is a fraction of the force of a power-law dashpot.

    Returns
    -------
    tangent_c, tangent : float
        Derivatives of the forces at the inner point and at the end with respect to the drifts at
        these points, N/m. `tangent` includes that a change of the drift at the end moves the
        reversal; `tangent_c` neglects this effect.
    is_reversed : bool
        True if the law was evaluated. Otherwise, `tangent_c` and `tangent` are 0.
    """
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    drift_c, drift = drifts
    sign = law_state[rows.RATE_SIGN, i]
    # q0 and q1 times the sign of the drift rate: positive in the direction of loading, m.
    scaled_rate_0 = sign * h * story_value(linear_terms, state, rows.VELOCITY, i)
    scaled_rate_1 = sign * h * story_value(linear_terms, scratch, momentum.V1, i)
    scratch[ROW.KINK, i] = 0.0
    if not (scaled_rate_0 > 0.0 and scaled_rate_1 < 0.0) or law_state.shape[0] > rows.EXTRA_ROWS:
        return 0.0, 0.0, False
    if (
        FULL
        and law_parameters[rows.CODE, i] <= rows.ELEMENTS
        and turns_at_reversal(law_parameters, law_state, i)
    ):
        return 0.0, 0.0, False
    start = law_state[rows.DRIFT, i]
    change = sign * (drift - start)
    # The arguments are the three Bezier points of d'(s). If rounding prevents a sign change, the
    # result is NONE, which is above 1; the end of the step is then used.
    middle = 3.0 * change - scaled_rate_0 - scaled_rate_1
    s = min(find_sign_change(scaled_rate_0, middle, scaled_rate_1), 1.0)
    r = 1.0 - s
    # Changes of drift up to the reversal, and after the reversal in the opposite direction, m.
    loading_change = s * s * (3.0 - 2.0 * s) * change + s * r * (
        r * scaled_rate_0 - s * scaled_rate_1
    )
    unloading_change = loading_change - change
    reversal_drift = start + sign * loading_change
    # Time of the inner point: the quadrature is exact for linear functions, wc c + w1 = 1/2.
    inner_fraction = (0.5 - coefficients[WEIGHT_1]) / coefficients[WEIGHT_C]
    inner, reversal = rows.FIRST_TRIAL, rows.THIRD_TRIAL
    if s < inner_fraction:  # reversal, inner point, end
        loading_tangent = _force(True, scene, law_state, i, 0, reversal, reversal_drift)
        tangent_c = _force(True, scene, law_state, i, reversal, inner, drift_c)
        last = inner
    else:  # inner point, reversal, end
        tangent_c = _force(True, scene, law_state, i, 0, inner, drift_c)
        loading_tangent = _force(True, scene, law_state, i, inner, reversal, reversal_drift)
        last = reversal
    tangent = _force(True, scene, law_state, i, last, rows.SECOND_TRIAL, drift)
    scratch[ROW.PREVIOUS_BLOCK, i] = last
    kink = abs(tangent - loading_tangent) * min(loading_change, unloading_change)
    if linear_terms[rows.POWER_DAMPER, i] != 0.0:
        force_0, _ = power_damper(linear_terms, i, scaled_rate_0 / h)
        force_1, _ = power_damper(linear_terms, i, scaled_rate_1 / h)
        kink += _DASHPOT_KINK * min(abs(force_0), abs(force_1))
    # If the force at the reversal is zero, the quotient is infinite or nan, without an exception.
    # Condition 1 of `keep_negligible_kinks` is then False, and the reversal is located.
    scratch[ROW.KINK, i] = kink / abs(law_state[rows.THIRD_TRIAL + rows.FORCE, i])
    # If the drift d1 at the end increases by a small amount e, the drift at the reversal increases
    # by `moved_fraction` e (the coefficient of d1 in d(s)), and the change of drift from there to
    # the end by the rest.
    moved_fraction = s * s * (3.0 - 2.0 * s)
    return tangent_c, tangent + moved_fraction * (loading_tangent - tangent), True


@outlined
def keep_negligible_kinks(scene, h, memory):
    """Decide which reversals can remain within the step; the other reversals must be located.

    The result is marked in row KINK of the scratch array:

        before the call    estimated error, the effect of the kink on the story force divided by the
                           force; 0 if the law was not evaluated over a reversal
        after the call     not 0 if the story has a reversal that can remain within the step (the
                           value is unchanged); otherwise 0

    A reversal can remain within the step if both conditions are satisfied:

        1. KINK <= _MAX_KINK Q_max / S.
        2. The story has no power-law dashpot, or the drift at the reversal is less than _NEAR_PEAK
           times the largest drift of the story at the start of a step until now.

    Q and S are sums over the floors:

        Q = sum of m ((a0 + a1) / 2 - (v1 - v0) / h)^2
        S = sum of m (a0^2 + a1^2) / 2

    Q_max is the largest Q of all steps of the run, including this step; S belongs to this step
    only. The function also updates the maxima of Q and S over the run in row RUN_MAXIMA; the
    maximum of S is only used by `tolerance_of_run`.

    Reasons:

    - Condition 1: Q_max / S is a measure of the largest error of a step in the run. A kink that is
      small in comparison does not reduce the accuracy. For a response with the circular frequency
      omega, Q / S is of the order of ((omega h)^2 / 12)^2, the fourth power of h; the effect of a
      kink is of order 2. Therefore, all reversals are located if the steps are small.
    - Condition 2: An inaccurate reversal near the peak drift would falsify the peak drift.
    - Dashpots: The forces of power-law dashpots change abruptly at a reversal and would increase Q.
      Their contribution to the accelerations is therefore removed in Q.
    """
    linear_terms = scene.linear_terms
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    # Q and S of this step
    mismatch = acceleration_norm = 0.0
    if FULL and has_inerters(linear_terms):
        _distribute_mismatch(linear_terms, scratch, n)
    for i in range(n):
        a0, a1 = state[rows.ACCELERATION, i], scratch[momentum.A1, i]
        dashpot_force = scratch[ROW.DASHPOT_MISMATCH, i] - above(
            linear_terms, scratch, ROW.DASHPOT_MISMATCH, i
        )
        difference = (
            0.5 * (a0 + a1)
            - scratch[momentum.DV, i] / h
            + linear_terms[rows.INVERSE_MASS, i] * dashpot_force
        )
        if FULL and has_inerters(linear_terms):
            difference = 0.5 * (a0 + a1) - scratch[momentum.DV, i] / h + scratch[ROW.COMPLEX, i]
        mismatch += linear_terms[rows.MASS, i] * difference * difference
        acceleration_norm += 0.5 * linear_terms[rows.MASS, i] * (a0 * a0 + a1 * a1)
    update_run_maxima(scratch, ROW.RUN_MAXIMA, mismatch, acceleration_norm)
    mismatch = scratch[ROW.RUN_MAXIMA, 0]  # Q_max
    # THIRD_TRIAL contains the drift at the reversal.
    for i in range(n):
        # The peaks of the run would make the motion depend on a restart.
        largest = max(scratch[ROW.LARGEST_DRIFT, i], abs(law_state[rows.DRIFT, i]))
        scratch[ROW.LARGEST_DRIFT, i] = largest
        is_near_peak = abs(law_state[rows.THIRD_TRIAL + rows.DRIFT, i]) >= _NEAR_PEAK * largest
        may_remain = linear_terms[rows.POWER_DAMPER, i] == 0.0 or not is_near_peak
        if not (may_remain and scratch[ROW.KINK, i] * acceleration_norm <= _MAX_KINK * mismatch):
            scratch[ROW.KINK, i] = 0.0


@outlined
def _distribute_mismatch(linear_terms, scratch, n):
    """Store the accelerations by DASHPOT_MISMATCH in row COMPLEX, in a building with inerters."""
    for i in range(n):
        scratch[ROW.COMPLEX, i] = scratch[ROW.DASHPOT_MISMATCH, i]
        scratch[ROW.COMPLEX, i] -= above(linear_terms, scratch, ROW.DASHPOT_MISMATCH, i)
    distribute(linear_terms, scratch, ROW.COMPLEX)


@inline
def accelerate(linear_terms, table, row, story, force, scratch):
    """Change the accelerations in a row of `table` by a decrease of the force of a story by
    `force`: that of its upper floor increases, that of its lower floor decreases."""
    upper, base = upper_of(linear_terms, story), base_of(linear_terms, story)
    by_upper = force * linear_terms[rows.INVERSE_MASS, upper]
    by_base = linear_terms[rows.LINK, story] * force * linear_terms[rows.INVERSE_MASS, base]
    if FULL and has_inerters(linear_terms):
        n = linear_terms.shape[1] - 1
        for i in range(n):
            scratch[ROW.COMPLEX, i] = 0.0
        scratch[ROW.COMPLEX, upper] += by_upper
        scratch[ROW.COMPLEX, base] -= by_base
        distribute(linear_terms, scratch, ROW.COMPLEX)
        for i in range(n):
            table[row, i] += scratch[ROW.COMPLEX, i]
    else:
        table[row, upper] += by_upper
        if story > 0:
            table[row, base] -= by_base


@outlined
def _add_damper(coefficients, linear_terms, i, h, increment, memory, factors):
    """Add the power-law dashpot of story `i` to its force FORCE_1 (N) and impulse FORCE_S (N s).

    The drift rate at the inner point is interpolated, with the factors q_d, q_0 and q_1 =
    RATE_BY_... in `coefficients` and the change of drift `increment` = d1 - d0:

        rc = q_d * (d1 - d0) / h + q_0 * r0 + q_1 * r1

    DASHPOT_MISMATCH is set to (f0 + f1) / 2 minus the mean, and SLOPE_C and SLOPE_1 to the
    derivatives of fc and f1 with respect to the drift rate. The result is True if the matrix must
    be factorized again, because SLOPE_1 has changed; SLOPE_C is not compared (see `_factor`).
    """
    state, _, scratch, _ = memory
    rate_0 = story_value(linear_terms, state, rows.VELOCITY, i)
    rate_1 = story_value(linear_terms, scratch, momentum.V1, i)
    rate_c = (
        coefficients[RATE_BY_INCREMENT] / h * increment
        + coefficients[RATE_BY_VELOCITY_0] * rate_0
        + coefficients[RATE_BY_VELOCITY_1] * rate_1
    )
    force_0, _ = power_damper(linear_terms, i, rate_0)
    force_c, derivative_c = power_damper(linear_terms, i, rate_c)
    force_1, derivative_1 = power_damper(linear_terms, i, rate_1)
    scratch[momentum.FORCE_1, i] += force_1
    mean_force = (
        coefficients[WEIGHT_0] * force_0
        + coefficients[WEIGHT_C] * force_c
        + coefficients[WEIGHT_1] * force_1
    )
    scratch[momentum.FORCE_S, i] += h * mean_force
    scratch[ROW.DASHPOT_MISMATCH, i] = 0.5 * (force_0 + force_1) - mean_force
    scratch[ROW.SLOPE_C, i] = derivative_c
    scratch[ROW.SLOPE_1, i] = derivative_1
    # In the matrix, h times the derivative is added to the mass of the floor.
    return (
        h * abs(derivative_1 - scratch[factors + _BLOCK.FACTORED_SLOPE, i])
        > TANGENT_TOLERANCE * linear_terms[rows.MASS, i]
    )


@outlined
def _impact_potential(coefficients, law_parameters, law_state, i, drifts, forces):
    """Return the potential of the damping of a contact of Hertz at the start and at the end of the
    step, its mean, and its derivative with respect to the drift at the end (N s/m). `drifts` (m)
    and `forces` (N) are those at the inner point and at the end.
    """
    drift_c, drift = drifts
    force_c, force = forces
    potential_0 = damping_potential(
        law_parameters, law_state, i, law_state[rows.FORCE, i], law_state[rows.DRIFT, i]
    )
    potential_c = damping_potential(law_parameters, law_state, i, force_c, drift_c)
    potential_1 = damping_potential(law_parameters, law_state, i, force, drift)
    mean = coefficients[WEIGHT_0] * potential_0 + coefficients[WEIGHT_C] * potential_c
    mean += coefficients[WEIGHT_1] * potential_1
    return potential_0, potential_1, mean, law_state[rows.INTERNAL, i] * abs(force)


@outlined
def _add_tangent_damping(linear_terms, i, h, law, increment, memory):
    """Add Rayleigh damping with the tangent stiffness to force and impulse of story `i`. `law` are
    the forces f0 and f1, the mean force and the tangent stiffness k1; or of a contact of Hertz
    these values of the potential of its damping.

    The force of the damping is a1 f' with the rate f' of the force of the law. Its impulse is a1
    (f1 - f0) for every law and every path, and its force at the end a1 k1 d'.
    """
    state, _, scratch, _ = memory
    force_0, force_1, mean, tangent = law
    coefficient = linear_terms[rows.TANGENT_DAMPING, i]
    rate_0 = story_value(linear_terms, state, rows.VELOCITY, i)
    rate_1 = story_value(linear_terms, scratch, momentum.V1, i)
    damping_1 = coefficient * tangent * rate_1
    impulse = coefficient * (force_1 - force_0)
    scratch[ROW.DAMPING_SLOPE, i] = tangent
    scratch[momentum.FORCE_1, i] += damping_1
    scratch[momentum.FORCE_S, i] += impulse
    # Work along a parabola of drift, with the first moment of the damping force by parts
    scratch[ROW.TANGENT_WORK, i] = impulse * increment / h + coefficient * (
        0.5 * (force_0 + force_1) - mean
    ) * (rate_1 - rate_0)
    mismatch = 0.5 * (state[rows.DAMPING_FORCE, i] + damping_1) - impulse / h
    if linear_terms[rows.POWER_DAMPER, i] != 0.0:
        mismatch += scratch[ROW.DASHPOT_MISMATCH, i]
    scratch[ROW.DASHPOT_MISMATCH, i] = mismatch


@outlined
def _add_brace(scene, i, h, rise, bend, memory, factors):
    """Add the damper with its brace to the force at the end and to the impulse of story `i`.

    The force is integrated along the parabola of drift with the change `rise` and the change `bend`
    of h times the drift rate (m). The return value is the same as for `_add_damper`.
    """
    linear_terms = scene.linear_terms
    state, _, scratch, _ = memory
    force_0 = state[rows.BRACE_FORCE, i]
    follow_brace(linear_terms, i, h, rise, bend, force_0, scratch, ROW.BRACE)
    mean = scratch[ROW.BRACE + path.MEAN, i]
    moment = scratch[ROW.BRACE + path.MOMENT, i]
    scratch[momentum.FORCE_1, i] += force_0 + moment
    scratch[momentum.FORCE_S, i] += h * mean
    mismatch = force_0 + 0.5 * moment - mean
    if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
        mismatch += scratch[ROW.DASHPOT_MISMATCH, i]
    scratch[ROW.DASHPOT_MISMATCH, i] = mismatch
    # The force of the brace depends on the change of drift in the step only.
    rounding = ROUNDING / RESIDUAL_TOLERANCE * linear_terms[rows.BRACE, i]
    du = scratch[momentum.DU, i]
    scratch[momentum.SIZE, i] += rounding * (abs(du) + abs(du - rise))
    is_stale = False
    tangent_tolerance = TANGENT_TOLERANCE * scene.law_parameters[rows.STIFFNESS, i]
    for row in range(4):
        tangent = scratch[ROW.BRACE + path.MEAN_BY_RISE + row, i]
        change = abs(tangent - scratch[factors + _BLOCK.FACTORED_BRACE + row, i])
        is_stale = is_stale or change > tangent_tolerance
    return is_stale


@inline
def _newton_factorization(linear_terms, scratch, factors):
    """Return the location of the factorization of Newton's method from row `factors` on."""
    blocks, coupling = factors + _BLOCK.BLOCKS, factors + _BLOCK.COUPLING
    return Factors(scratch, blocks, coupling, factors + _STORE, linear_terms)


@outlined
def _factor(coefficients, linear_terms, modal, h, scratch, factors):
    """Assemble and factorize the matrix of Newton's method for the current tangent stiffnesses.

    The matrix contains the derivatives of the kinematic equation (times M) and of the momentum
    equation with respect to u1 - u0 and v1 - v0. It is block tridiagonal, because a story couples
    adjacent floors only. Each story contributes one 2 x 2 block: the derivatives with respect to
    the changes of its drift and of its drift rate, in the four rows from `coupling` on:

        row             equation      with respect to    derivative
        coupling        kinematics    drift              -be h^2 k1
        coupling + 1    kinematics    drift rate         -be h^2 (c + s1)
        coupling + 2    momentum      drift              c + h (wc gd kc + w1 k1) + rd wc sc
        coupling + 3    momentum      drift rate         -be h^2 kc + h (rv wc sc + w1 s1)

    kc and k1 are the tangent stiffnesses at the inner point and at the end, including P-delta. c is
    the coefficient of a linear story damper. The force of a power-law dashpot has the derivatives
    sc and s1 with respect to the drift rate at these points. The derivatives of the drift rate at
    the inner point are rd / h with respect to the change of drift, and rv with respect to the
    change of drift rate (RATE_BY_INCREMENT and RATE_BY_VELOCITY_1 of `coefficients`). A damper with
    a brace adds h times the derivatives of its mean force to the momentum, and -be h^2 times the
    derivatives of its force at the end to the kinematics. The coefficients of the method satisfy wc
    gd = th - w1 and wc g1 = -be.
    """
    n = linear_terms.shape[1] - 1
    by_a = coefficients[BETA] * h * h
    by_tangent_c = h * (coefficients[THETA] - coefficients[WEIGHT_1])  # = h wc gd
    coupling = factors + _BLOCK.COUPLING
    # `_evaluate_laws` compares the rows FACTORED_... (tangents without P-delta, and s1) with the
    # new values, to decide whether the factorization is still valid. sc is not compared, because it
    # usually changes together with s1, and a comparison would save practically no iterations. The
    # sc of an earlier factorization only affects the rate of convergence.
    for i in range(n):
        tangent_c = scratch[ROW.TANGENT_C, i]
        tangent_1 = scratch[ROW.TANGENT_1, i]
        scratch[factors + _BLOCK.FACTORED_C, i] = tangent_c
        scratch[factors + _BLOCK.FACTORED_1, i] = tangent_1
        tangent_c += linear_terms[rows.GEOMETRIC, i]
        tangent_1 += linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i]
        if FULL:
            damper += linear_terms[rows.TANGENT_DAMPING, i] * scratch[ROW.DAMPING_SLOPE, i]
        slope_c = coefficients[WEIGHT_C] * scratch[ROW.SLOPE_C, i]
        slope_1 = scratch[ROW.SLOPE_1, i]
        scratch[factors + _BLOCK.FACTORED_SLOPE, i] = slope_1
        scratch[coupling, i] = -by_a * tangent_1
        scratch[coupling + 1, i] = -by_a * (damper + slope_1)
        scratch[coupling + 2, i] = (
            damper + by_tangent_c * tangent_c + h * coefficients[WEIGHT_1] * tangent_1
        )
        scratch[coupling + 2, i] += coefficients[RATE_BY_INCREMENT] * slope_c
        scratch[coupling + 3, i] = -by_a * tangent_c
        scratch[coupling + 3, i] += h * (
            coefficients[RATE_BY_VELOCITY_1] * slope_c + coefficients[WEIGHT_1] * slope_1
        )
        if FULL and linear_terms[rows.BRACE, i] != 0.0:
            # The unknown of the velocity is the change of the drift rate, the bend divided by h.
            for row in range(4):
                tangent = scratch[ROW.BRACE + path.MEAN_BY_RISE + row, i]
                scratch[factors + _BLOCK.FACTORED_BRACE + row, i] = tangent
                factor = (h if row < 2 else -by_a) * (h if row % 2 == 1 else 1.0)
                scratch[coupling + (row + 2) % 4, i] += factor * tangent
    scratch[factors + _BLOCK.FACTORED_1, n] = h
    factorization = _newton_factorization(linear_terms, scratch, factors)
    assemble_blocks(linear_terms, factorization, h * coefficients[THETA], by_a, n)
    # The factors of the modal part of C in the two equations are -be h^2 (M a1 contains -C v1) for
    # v1 and 1 for u1: the second and third number.
    factor_blocks(factorization, ModalBlocks(modal, 0.0, -by_a, 1.0, 0.0), n)
