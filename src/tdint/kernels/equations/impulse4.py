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
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
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
    copy_rows,
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
from tdint.kernels.laws.selection import HAS_CURVED_LAW
from tdint.kernels.linear_terms import (
    MODAL,
    add_modal_force,
    floor_impulse,
    floor_load,
    power_damper,
)
from tdint.kernels.stepping import Factors
from tdint.kernels.stories.branches import find_sign_change
from tdint.kernels.stories.law_state import restoring_force_outlined

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
    # Average of the dashpot force at the two endpoints minus its mean over the step, N
    DASHPOT_MISMATCH: int = 1
    # Real and imaginary part of the right side r1 + l r2, then of the solution w (`solve_linear`)
    COMPLEX: int = 2
    # State and law states at the start of a step that is divided into substeps, for its repetition
    SAVED: int = 3 + rows.LAW_STATE_ROWS
    SUBSTEP_START: int = 3  # displacement, velocity and acceleration at the start of a substep
    # Maxima over the run, which `keep_negligible_kinks` updates: mismatch of the mean acceleration
    # (column 0) and squared norm of the accelerations (column 1)
    RUN_MAXIMA: int = 1
    REVERSAL_DRIFTS: int = 1  # drift at the reversal of each story within the substep, m
    PEAKS: int = 2 * rows.PEAK_ROWS  # peaks within the substeps
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
    BLOCKS: int = 4  # 2 x 2 diagonal blocks of the factorization
    COUPLING: int = COUPLING_ROWS  # blocks between adjacent floors


# The following three values decide which reversals are not located (`keep_negligible_kinks`). They
# were determined with the problems with Bouc-Wen stories and power-law dashpots of `tdint chart`.

# Dimensionless. A reversal is not located if its estimated effect on the story force (row KINK, a
# fraction of the force) is at most this value times the relative mismatch of the accelerations,
# which estimates the largest error of a step (see `keep_negligible_kinks`).
_MAX_KINK = 15.0
# Dimensionless. Fraction of the dashpot force that is added to the kink of the law. Without it, the
# errors of small steps are ten times as large.
_DASHPOT_KINK = 0.003
# Fraction of the current peak drift. In a story with a power-law dashpot, a reversal above this
# drift is always located, because an inaccurate reversal would falsify the peak drift.
_NEAR_PEAK = 0.8

# Dimensionless. Tolerance of the residuals in Newton's method, divided by the relative mismatch of
# the mean acceleration in the run (`keep_negligible_kinks`), which is of order 4 in the time step.
# With 0.01, the errors of peak drifts change by less than 2 % in buildings with Bouc-Wen, tanh and
# stiffening stories and with power-law dashpots.
_TOLERANCE_PER_MISMATCH = 1e-2

ROW, FACTORS = rows.chained(_Rows, momentum.MOMENTUM_ROWS)
_BLOCK, _STORE = rows.chained(_Block)


@inline
def factor_rows(modes):
    """Return the number of rows of a factorization for a building with `modes` modally damped
    modes.

    The rows of `_Block` are followed by 6 modes + 1 rows for each of the two matrices: first for
    the matrix of Newton's method, then for the complex matrix for linear branches. These rows
    contain the terms of the Woodbury formula for modal damping. Both matrices have a pair of
    unknowns per floor: displacement and velocity, or real and imaginary part. For each of the two
    matrices, a mode therefore has

        four rows    two solutions of two rows. The right side of a solution is the mode vector,
                     in the equations of the first or of the second unknown of the pair. The two
                     rows of the solution contain the first and the second unknown.
        two rows     rows of the small inverse. Its order is 2 (unknowns per floor) times the number
                     of modes.

    The remaining row is a temporary row.
    """
    return _STORE + 2 * (6 * modes + 1)


@inline
def store_load(linear_terms, forces, t, h, ground_0, ground_1, scratch):
    """Store the load at the end of the step and the exact impulse of the load over [t, t + h].

    The load is p = -m ag + forces on floors, with the ground acceleration ag, linear within the
    step.

    Parameters
    ----------
    linear_terms, forces : ndarray
        Masses, dampers and geometric stiffnesses of the building; forces on its floors.
    t, h : float
        Start and length of the step, s.
    ground_0, ground_1 : float
        Ground acceleration at both endpoints, m/s^2.
    scratch : ndarray
        Rows LOAD (N) and IMPULSE (N s) are set.
    """
    floor_load(linear_terms, forces, t + h, ground_1, scratch, momentum.LOAD)
    floor_impulse(linear_terms, forces, t, h, ground_0, ground_1, scratch, momentum.IMPULSE)


@inline
def solve_linear(coefficients, scene, h, memory, factors):
    """Compute the response over a step without a branch change by a single linear solution.

    The unknowns are the increments du = u1 - u0 and dv = v1 - v0 of the floors over the step of
    length h, from the displacement u0 and velocity v0 to u1 and v1. With the mass matrix M, the
    equations of kinematics (times M) and momentum are

        (M - be h^2 K) du - (th h M + be h^2 C) dv = r1,   (C + th h K) du + (M - be h^2 K) dv = r2

    where C is the damping matrix, K the stiffness matrix of the branches, and th and be are
    coefficients of the method. The right sides r1 and r2 are the residuals for du = dv = 0
    (`_right_side`). With a complex root l of l^2 - th h l + be h^2 = 0, the first equation plus l
    times the second equation is a single complex equation,

        (M + l C + l^2 K) w = r1 + l r2,   w = du - conj(l) dv

    with a symmetric tridiagonal matrix. The step has three stages: right side (`_right_side`),
    solution for w (`solve_pairs_damped`), and increments and accelerations (`_store_response`). The
    last stage sets the rows DU, DV, U1, V1 and A1 of the scratch array.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method: th, al, be (kinematics), weights of the impulse, and real and
        imaginary part of l / h.
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array.
    factors : int
        First scratch row of the factorization.
    """
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    root_re = coefficients[ROOT_RE] * h
    root_im = coefficients[ROOT_IM] * h
    # First rows of the pivots, of the multipliers and of the terms of modal damping. The 6 modes +
    # 1 rows from `factors` + _STORE on contain the terms of modal damping for the matrix of
    # Newton's method. The terms for the complex matrix are in the rows after these rows
    # (`factor_rows`).
    factorization = Factors(
        scratch,
        factors + _BLOCK.PIVOT,
        factors + _BLOCK.MULTIPLIER,
        factors + _STORE + 6 * modal.shape[0] + 1,
    )
    # The modal part of l C multiplies a pair (real part, imaginary part) by the complex number l.
    damping = ModalBlocks(modal, root_re, -root_im, root_im, root_re)
    # `_right_side` also compares the factorization with the stiffnesses of the branches and with h,
    # because its loop over the stories reads the stiffnesses. If they differ, factorize again.
    slopes_row = factors + _BLOCK.LINEAR_SLOPES
    is_stale = _right_side(coefficients, scene, h, memory, slopes_row)
    if is_stale:
        for i in range(n):
            scratch[slopes_row, i] = law_state[rows.SLOPE, i]
        scratch[slopes_row, n] = h
        factor_pairs(linear_terms, law_state, (root_re, root_im), factorization, damping, n)
    solve_pairs_damped(factorization, damping, ROW.COMPLEX, ROW.COMPLEX + 1, n)
    _store_response(linear_terms, modal, (root_re, root_im), state, law_state, scratch)


@inline
def _right_side(coefficients, scene, h, memory, slopes_row):
    """Store the right side r1 + l r2 of the linear equations of a step; return True if their matrix
    must be factorized again.

    The unknowns are the increments du = u1 - u0 and dv = v1 - v0 of the floors, from the
    displacement u0 and velocity v0 at the start to u1 and v1 at the end of the step of length h.
    They are combined to a complex unknown w (see `solve_linear`):

        (M + l C + l^2 K) w = r1 + l r2,   w = du - conj(l) dv

    l = h (ROOT_RE + i ROOT_IM) is a root of l^2 - th h l + be h^2 = 0, with the coefficients th, al
    and be of the kinematic equation

        u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)

    M, C and K are the matrices of mass, damping (floor dampers, story dampers and modal damping)
    and stiffness. r1 and r2 are the residuals of kinematics (times M) and momentum for zero
    increments, u1 = u0 and v1 = v0:

        r1 = M (h v0 + h^2 (al a0 - be a1)),   M a1 = p1 - C v0 - f(u0)     kinematics
        r2 = I - h (f(u0) + wc K (uc - u0)),   uc - u0 = h (g0 + g1) v0     momentum

    with the acceleration a0 at the start, the restoring force f with P-delta, the load p1 at the
    end of the step and the impulse I of the load. uc is the displacement at the inner point of the
    quadrature for the impulse of f, and wc is the weight of this point; the sum of all weights is
    1. Real and imaginary part of r1 + l r2 are stored in the two scratch rows COMPLEX.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method. The following elements are used: ALPHA (al), BETA (be), WEIGHT_C
        (wc), BY_VELOCITY_0 (g0), BY_VELOCITY_1 (g1), ROOT_RE and ROOT_IM (l / h).
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array. Rows LOAD and IMPULSE of the scratch array contain p1
        (N) and I (N s).
    slopes_row : int
        Scratch row with the stiffnesses of the existing factorization; its last column contains the
        length of the step.

    Returns
    -------
    bool
        True if the existing factorization is for other stiffnesses or another length of the step,
        and must be computed again.
    """
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    root_re = coefficients[ROOT_RE] * h
    root_im = coefficients[ROOT_IM] * h
    # With zero increments, the drift at the inner point differs from the drift at the start by
    # h (BY_VELOCITY_0 + BY_VELOCITY_1) times the drift rate. `by_rate` is this factor times the
    # weight of the inner point in the impulse.
    by_rate = (
        coefficients[WEIGHT_C] * h * (coefficients[BY_VELOCITY_0] + coefficients[BY_VELOCITY_1])
    )
    by_a0 = coefficients[ALPHA] * h * h
    by_a1 = coefficients[BETA] * h * h
    is_stale = scratch[slopes_row, n] != h
    # From the roof downwards, because the force on a floor includes the story above.
    force_above = 0.0
    impulse_above = 0.0
    for i in range(n - 1, -1, -1):
        is_stale |= law_state[rows.SLOPE, i] != scratch[slopes_row, i]
        link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
        mass = linear_terms[rows.MASS, i]
        geometric = linear_terms[rows.GEOMETRIC, i]
        v = state[rows.VELOCITY, i]
        rate = v - link * state[rows.VELOCITY, max(i - 1, 0)]
        spring_force = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        # Force and impulse of story `i` for u1 = u0 and v1 = v0. The story dampers do not
        # contribute to the impulse, because the drift does not change.
        force = spring_force + linear_terms[rows.STORY_DAMPER, i] * rate
        impulse = h * (spring_force + by_rate * (law_state[rows.SLOPE, i] + geometric) * rate)
        mass_times_a1 = (
            scratch[momentum.LOAD, i]
            - linear_terms[rows.FLOOR_DAMPER, i] * v
            - (force - force_above)
        )
        # Compute r2, then real and imaginary part of r1 + l r2.
        momentum_residual = scratch[momentum.IMPULSE, i] - (impulse - impulse_above)
        scratch[ROW.COMPLEX, i] = (
            mass * (h * v + by_a0 * state[rows.ACCELERATION, i])
            - by_a1 * mass_times_a1
            + root_re * momentum_residual
        )
        scratch[ROW.COMPLEX + 1, i] = root_im * momentum_residual
        force_above = link * force
        impulse_above = link * impulse
    # Modal damping is not included in `mass_times_a1`. Its force -C v0 adds be h^2 C v0 to the real
    # part of the right side.
    add_modal_force(modal, state, rows.VELOCITY, by_a1, scratch, ROW.COMPLEX, n)
    return is_stale


@inline
def _store_response(linear_terms, modal, root, state, law_state, scratch):
    """Compute the response at the end of the step from the solution w of `solve_linear`.

    In the equations of `solve_linear`, l (s) is a complex root of a quadratic equation with the
    coefficients of the method and the step length; conj(l) is its complex conjugate. The increments
    du = u1 - u0 and dv = v1 - v0 of the floors follow from w = du - conj(l) dv:

        dv = im(w) / im(l),   du = re(w) + re(l) dv

    The accelerations at the end follow from equilibrium, a1 = (p1 - C v1 - f(u1)) / m, with the
    load p1 at the end of the step and the linear restoring force f. The rows DU, DV, U1, V1 and A1
    are set.

    Parameters
    ----------
    linear_terms, modal : ndarray
        Masses, dampers and geometric stiffnesses of the building; rows w_j of the modal damping
        matrix C = sum of w_j w_j^T.
    root : tuple of float
        Real and imaginary part of l, s.
    state, law_state : ndarray
        State and law states at the start of the step.
    scratch : ndarray
        Scratch array; rows COMPLEX contain real and imaginary part of w (m), row LOAD contains p1
        (N).
    """
    n = linear_terms.shape[1] - 1
    re, im = root
    by_im = 1.0 / im
    # The loop proceeds from the roof downwards. The force of story `i` requires the increments of
    # floor `i` (`du`, `dv`) and of floor `i - 1` (`du_below`, `dv_below`). The next pass belongs to
    # floor `i - 1`, and starts by copying `du_below` and `dv_below` to `du` and `dv`. The values
    # before the loop are the increments of the roof.
    force_above = 0.0
    dv_below = scratch[ROW.COMPLEX + 1, n - 1] * by_im
    du_below = scratch[ROW.COMPLEX, n - 1] + re * dv_below
    for i in range(n - 1, -1, -1):
        link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
        below = max(i - 1, 0)
        du = du_below
        dv = dv_below
        dv_below = scratch[ROW.COMPLEX + 1, below] * by_im
        du_below = scratch[ROW.COMPLEX, below] + re * dv_below
        v = state[rows.VELOCITY, i] + dv
        scratch[momentum.DU, i] = du
        scratch[momentum.DV, i] = dv
        scratch[momentum.U1, i] = state[rows.DISPLACEMENT, i] + du
        scratch[momentum.V1, i] = v
        geometric = linear_terms[rows.GEOMETRIC, i]
        # Sum up the force of story `i` at the end of the step: law, P-delta and story damper.
        force = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        force += (law_state[rows.SLOPE, i] + geometric) * (du - link * du_below)
        force += linear_terms[rows.STORY_DAMPER, i] * (
            v - link * (state[rows.VELOCITY, below] + dv_below)
        )
        floor_force = scratch[momentum.LOAD, i] - linear_terms[rows.FLOOR_DAMPER, i] * v
        scratch[momentum.A1, i] = linear_terms[rows.INVERSE_MASS, i] * (
            floor_force - (force - force_above)
        )
        force_above = link * force
    if MODAL and modal.shape[0] > 0:
        _add_modal_acceleration(linear_terms, modal, scratch, n)


@outlined
def _add_modal_acceleration(linear_terms, modal, scratch, n):
    """Add the effect of modal damping to the acceleration at the end of the step: -C v1 / m.

    The velocities v1 are in row V1, the accelerations in row A1. Row FORCE_1 is used for the
    forces.

    Parameters
    ----------
    linear_terms, modal : ndarray
        Masses, dampers and geometric stiffnesses of the building; rows w of the modal damping
        matrix C = sum of w w^T.
    scratch : ndarray
        Scratch array: one row per quantity, one column per floor or story.
    n : int
        Number of floors.
    """
    for i in range(n):
        scratch[momentum.FORCE_1, i] = 0.0
    add_modal_force(modal, scratch, momentum.V1, -1.0, scratch, momentum.FORCE_1, n)
    for i in range(n):
        scratch[momentum.A1, i] += linear_terms[rows.INVERSE_MASS, i] * scratch[momentum.FORCE_1, i]


@outlined
def newton(keep_branches, has_guess, coefficients, scene, h, memory, factors):
    """Compute the response over a step by Newton's method for all stories together.

    The unknowns are u1 - u0 and v1 - v0 of each floor; a1 is eliminated by equilibrium:

        kinematics    u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
        momentum      M (v1 - v0) + C (u1 - u0) + h (w0 f(u0) + wc f(uc) + w1 f(u1)) = I
        equilibrium   M a1 + C v1 + f(u1) = p1

    with mass matrix M, damping matrix C, restoring force f, and the coefficients th, al and be of
    the method. The impulse of f is a quadrature with the weights w0, wc, w1 and an inner point with
    the displacement uc. I is the impulse of the load and p1 the load at the end.

    The iteration ends if all residuals are within the tolerance, or if the last correction of the
    displacements was of the order of rounding errors. The first UNDAMPED_ITERATIONS corrections are
    applied fully. A later correction is halved until it reduces the residuals, because the
    iteration could cycle without convergence at kinks of the laws.

    The tolerance of the residuals is proportional to a measure of the largest error of a step in
    the run (`tolerance_of_run`). Both are of order 4 in the time step. The order of the method
    therefore remains 4, and coarse steps need fewer iterations.

    Parameters
    ----------
    keep_branches : bool
        True if stories with a linear branch remain on this branch.
    has_guess : bool
        True if the rows DU and DV contain the first estimate of u1 - u0 and v1 - v0; otherwise it
        is the motion with constant acceleration.
    coefficients : ndarray
        Coefficients of the method: th, al, be, weights of the impulse, and the inner point.
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    h : float
        Length of the step or substep, s.
    memory : Memory
        State, law states, scratch array and status of the step.
    factors : int
        First row of the factorization in the scratch array.

    Returns
    -------
    int
        Number of linear solutions, but at least 1. NOT_CONVERGED (negative) if the residuals are
        too large after MAX_ITERATIONS solutions.
    """
    linear_terms, modal, _, _, _ = scene
    state, _, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    if not has_guess:
        store_first_guess(1.0, h, state, scratch, n)
    # Row RUN_MAXIMA contains two maxima over the run until now: of the squared mismatch of the mean
    # acceleration, and of the squared acceleration. Their quotient measures the error of a step.
    # Both are 0 in the first step; the tolerance is then RESIDUAL_TOLERANCE, the minimum.
    tolerance = tolerance_of_run(scratch, ROW.RUN_MAXIMA, _TOLERANCE_PER_MISMATCH)
    iterations = 0
    applied_fraction = 1.0
    previous_norm = math.inf
    is_correction_negligible = False
    while True:
        # Compute story forces, residuals and convergence for the current increments. `is_stale` is
        # True if the factorization does not fit the current tangents. The first argument of
        # `has_converged` is True if no further solution is allowed; if the test fails, the largest
        # relative residual is then stored for the error message.
        is_stale = _evaluate_laws(keep_branches, coefficients, scene, h, memory, factors)
        residuals(
            coefficients[THETA],
            coefficients[ALPHA],
            coefficients[BETA],
            linear_terms,
            modal,
            h,
            state,
            scratch,
        )
        if (
            has_converged(
                iterations == MAX_ITERATIONS,
                tolerance,
                coefficients[BETA],
                linear_terms,
                h,
                state,
                scratch,
                step_status,
            )
            or is_correction_negligible
        ):
            break
        # Line search, after the first UNDAMPED_ITERATIONS corrections: halve the applied fraction
        # of a correction that does not reduce the norm of the residuals. R1 (kg m) divided by h and
        # R2 have the unit N s.
        if iterations >= UNDAMPED_ITERATIONS:
            norm = squared_norm(linear_terms, scratch, momentum.R1, n) / (h * h) + squared_norm(
                linear_terms, scratch, momentum.R2, n
            )
            if must_halve(norm, previous_norm, applied_fraction):
                applied_fraction *= 0.5
                add_rows(-applied_fraction, scratch, ROW.LAST_CORRECTION, momentum.DU, 2, n)
                continue
            previous_norm = norm
            applied_fraction = 1.0
        if iterations == MAX_ITERATIONS:
            return rows.NOT_CONVERGED
        # Solve for the next correction and apply it fully. `correct` returns True if the correction
        # of the displacements is of the order of rounding errors.
        if is_stale:
            _factor(coefficients, linear_terms, modal, h, scratch, factors)
        is_correction_negligible = correct(
            coefficients[BETA], modal, h, _newton_factorization(scratch, factors), n
        )
        iterations += 1
        # Keep the correction for the line search. `correct` has replaced the residuals in the rows
        # R1 and R2 by the corrections of DU and DV.
        if iterations > UNDAMPED_ITERATIONS:
            copy_rows(scratch, momentum.R1, ROW.LAST_CORRECTION, 2, n)
    return max(iterations, 1)


@inline
def _evaluate_laws(keep_branches, coefficients, scene, h, memory, factors):
    """Compute the story forces and their impulses for the current estimate of the increments.

    The laws are evaluated at the inner point (suffix `_c`), with the displacement uc, and at the
    end of the step. With the force f of a story (law and P-delta), its damper c and its drift d,

        uc      = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1)
        force   = f1 + c (drift rate at the end)                     row FORCE_1
        impulse = h (w0 f0 + wc fc + w1 f1) + c (d1 - d0)            row FORCE_S

    where the indices 0, c and 1 denote the start, the inner point and the end. A power-law dashpot
    adds its force and impulse. The following scratch rows are set: U1 (m), V1 (m/s), FORCE_1 (N),
    FORCE_S (N s), the tangent stiffnesses TANGENT_C and TANGENT_1 (N/m, without P-delta), and SIZE.
    Row SIZE contains the force that corresponds to the rounding errors of the displacements,
    divided by RESIDUAL_TOLERANCE (N).

    Parameters
    ----------
    keep_branches : bool
        True if stories with a linear branch remain on this branch; see `_evaluate_law`.
    coefficients : ndarray
        Coefficients of the method: weights w0, wc, w1, and gd, g0, g1 of the inner point.
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array: rows DU (m) and DV (m/s) contain the increments.
    factors : int
        First scratch row of the factorization.

    Returns
    -------
    bool
        True if the existing factorization is for other tangents or another length of the step, and
        must be computed again.
    """
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    # Column n of row FACTORED_1 contains the step length of the existing factorization; the columns
    # of the stories contain its tangents.
    is_stale = scratch[factors + _BLOCK.FACTORED_1, n] != h
    uc_below = 0.0
    u_below = 0.0
    v_below = 0.0
    du_below = 0.0
    for i in range(n):
        du = scratch[momentum.DU, i]
        u = state[rows.DISPLACEMENT, i] + du
        v = state[rows.VELOCITY, i] + scratch[momentum.DV, i]
        # The displacement at the inner point is uc = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1).
        uc = (
            state[rows.DISPLACEMENT, i]
            + coefficients[BY_INCREMENT] * du
            + h
            * (
                coefficients[BY_VELOCITY_0] * state[rows.VELOCITY, i]
                + coefficients[BY_VELOCITY_1] * v
            )
        )
        scratch[momentum.U1, i] = u
        scratch[momentum.V1, i] = v
        # Compute the drifts of story `i` at the inner point and at the end of the step, the change
        # of drift in the step, and the drift rate at the end.
        link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
        drift_c = uc - link * uc_below
        drift = u - link * u_below
        increment = du - link * du_below
        rate = v - link * v_below
        tangent_c, force_c, tangent, force = _evaluate_law(
            keep_branches, coefficients, scene, h, i, (drift_c, drift), memory
        )
        # The existing factorization is kept if its tangents are nearly equal to the new tangents.
        tangent_tolerance = TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        is_stale = (
            is_stale or abs(tangent_c - scratch[factors + _BLOCK.FACTORED_C, i]) > tangent_tolerance
        )
        is_stale = (
            is_stale or abs(tangent - scratch[factors + _BLOCK.FACTORED_1, i]) > tangent_tolerance
        )
        # A drift is a difference of displacements. Their rounding errors change the story force by
        # about ROUNDING times stiffness times displacements. Residuals up to this force must be
        # accepted. The convergence test multiplies row SIZE by a tolerance of at least
        # RESIDUAL_TOLERANCE; the force is therefore divided by RESIDUAL_TOLERANCE.
        rounding = ROUNDING / RESIDUAL_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        scratch[momentum.SIZE, i] = rounding * (abs(u) + abs(link * u_below))
        scratch[ROW.TANGENT_C, i] = tangent_c
        scratch[ROW.TANGENT_1, i] = tangent
        # Compute the force at the end and the impulse of the story. `mean` is the mean of restoring
        # force and P-delta over the step, N.
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
        # `_add_damper` returns True if the factorization is for another derivative of the dashpot.
        if linear_terms[rows.POWER_DAMPER, i] != 0.0:
            is_stale = (
                _add_damper(coefficients, linear_terms, i, h, increment, memory, factors)
                or is_stale
            )
        uc_below = uc
        u_below = u
        v_below = v
        du_below = du
    return is_stale


@inline
def _evaluate_law(keep_branches, coefficients, scene, h, i, drifts, memory):
    """Evaluate the law of story `i` at the inner point (suffix `_c`) and at the end of the step.

    There are three cases:

    1. `keep_branches` is True, and the story is on a linear branch with the stiffness k: the force
       is f0 + k (d - d0) with the force f0 and the drift d0 at the start.
    2. `keep_branches` is True, and the drift of a curved law reverses within the step:
       `_evaluate_over_reversal` moves the law to the inner point, the reversal and the end in
       chronological order.
    3. Otherwise the law moves from the start of the step to the inner point, and then to the end.

    In cases 2 and 3, block FIRST_TRIAL of the law states receives the state at the inner point and
    block SECOND_TRIAL the state at the end. `_evaluate_over_reversal` tests whether the drift
    reverses. If a law of the building has extra rows, it does not evaluate a reversal, and case 3
    replaces case 2.

    Parameters
    ----------
    keep_branches : bool
        True if the caller divides the step at branch changes and reversals. A reversal with a
        negligible effect remains within the step. `keep_negligible_kinks` later makes this decision
        from the error estimates in row KINK. False if the complete step is solved and no branch
        change or reversal is located.
    coefficients : ndarray
        Coefficients of the method: the weights wc and w1 of the quadrature are used.
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    h : float
        Length of the step, s.
    i : int
        Index of the story.
    drifts : tuple of float
        Drifts at the inner point and at the end, m.
    memory : Memory
        State, law states and scratch array. Row KINK of the scratch array is set if `keep_branches`
        is True: to 0 in cases 1 and 3, and to the estimated error of the evaluation over the
        reversal in case 2 (by `_evaluate_over_reversal`). If `keep_branches` is False, row KINK is
        not changed.

    Returns
    -------
    tangent_c, force_c, tangent, force : float
        Tangent stiffness (N/m) and force (N) at the inner point and at the end.
    """
    law_parameters = scene.law_parameters
    _, law_state, scratch, _ = memory
    drift_c, drift = drifts
    # SLOPE is finite on a linear branch and infinite on a curved branch. Curved branches only exist
    # if HAS_CURVED_LAW, a constant of the compiled variant, is True.
    if keep_branches and law_state[rows.SLOPE, i] < math.inf:
        tangent_c = tangent = law_state[rows.SLOPE, i]
        scratch[ROW.KINK, i] = 0.0
        force_c = law_state[rows.FORCE, i] + tangent * (drift_c - law_state[rows.DRIFT, i])
        force = law_state[rows.FORCE, i] + tangent * (drift - law_state[rows.DRIFT, i])
    else:
        # `_evaluate_over_reversal` returns True as the last value if it has evaluated the law.
        is_reversed = False
        if HAS_CURVED_LAW and keep_branches:
            tangent_c, tangent, is_reversed = _evaluate_over_reversal(
                coefficients, scene, h, i, drifts, memory
            )
        # The argument 0 is the first row of the committed state, the start of the step.
        if not is_reversed:
            tangent_c = restoring_force_outlined(
                law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift_c
            )
            tangent = restoring_force_outlined(
                law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL, drift
            )
        force_c = law_state[rows.FIRST_TRIAL + rows.FORCE, i]
        force = law_state[rows.SECOND_TRIAL + rows.FORCE, i]
    return tangent_c, force_c, tangent, force


@outlined
def _evaluate_over_reversal(coefficients, scene, h, i, drifts, memory):
    """Evaluate a curved law of story `i` over a step within which its drift reverses.

    The drift reverses if its rate has the direction of loading at the start of the step and the
    opposite direction at the end. The law then moves to three drifts in chronological order. The
    reversal can be before or after the inner point of the quadrature (suffix `_c`). The states of
    the law are stored in three trial blocks of `law_state`:

        FIRST_TRIAL     inner point
        SECOND_TRIAL    end of the step
        THIRD_TRIAL     reversal

    The law is not evaluated, and row KINK of the scratch array is set to 0, in two cases:

    - The story does not reverse.
    - A law of the building has extra rows in `law_state`, so that block THIRD_TRIAL is not
      available. A reversal of the story must then be located.

    In both cases, the caller evaluates the law at the inner point and at the end only. KINK 0
    therefore means: if the story reverses, the step must be divided at the reversal. The later
    search for branch changes (`first_event`) only considers reversals of stories with KINK 0.

    If the law is evaluated, row PREVIOUS_BLOCK receives the first row of the trial block that
    precedes the end: FIRST_TRIAL or THIRD_TRIAL, depending on the order of the inner point and the
    reversal. `_update_state` (`tdint.methods.impulse4`) later accumulates the dissipated energy
    in this order.

    The drift within the step is the cubic Hermite interpolant of the drifts d0, d1 and drift rates
    at both endpoints. The time s is 0 at the start and 1 at the end of the step. With r = 1 - s,
    and with h times the drift rates at the start, q0, and at the end, q1 (m),

        d(s)  = d0 + s^2 (3 - 2 s) (d1 - d0) + s r (r q0 - s q1)
        d'(s) = r^2 q0 + 2 s r (3 (d1 - d0) - q0 - q1) + s^2 q1

    The reversal is the zero of d'(s). The tangent stiffness changes suddenly there (kink of the
    force), and the quadrature has an additional error. Row KINK receives an estimate of the error
    as a fraction of the force f_r at the reversal:

        KINK = (|k1 - k_r| min(distance before, distance after) + dashpot) / |f_r|

    k_r and k1 are the tangent stiffnesses at the reversal, before it, and at the end of the step.
    The distances are the changes of drift from the start to the reversal and from the reversal to
    the end. `dashpot` is a fraction of the force of a power-law dashpot, if the story has such a
    dashpot. From KINK, `keep_negligible_kinks` later decides whether the reversal can remain within
    the step.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method: the weights wc and w1 of the quadrature are used.
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    h : float
        Length of the step, s.
    i : int
        Index of the story.
    drifts : tuple of float
        Drifts at the inner point and at the end, m.
    memory : Memory
        State, law states and scratch array.

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
    link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
    below = max(i - 1, 0)
    sign = law_state[rows.RATE_SIGN, i]
    # q0 and q1 of the docstring (m), multiplied by the sign of the drift rate: positive in the
    # direction of loading. The story reverses if the first is positive and the second negative.
    scaled_rate_0 = sign * h * (state[rows.VELOCITY, i] - link * state[rows.VELOCITY, below])
    scaled_rate_1 = sign * h * (scratch[momentum.V1, i] - link * scratch[momentum.V1, below])
    # KINK 0 means that a reversal of the story, if it has a reversal, cannot remain within the
    # step. If a law of the building has extra rows, THIRD_TRIAL contains these rows at the start of
    # the step (`_save_start` of impulse4) and is not available for the reversal.
    scratch[ROW.KINK, i] = 0.0
    if not (scaled_rate_0 > 0.0 and scaled_rate_1 < 0.0) or law_state.shape[0] > rows.EXTRA_ROWS:
        return 0.0, 0.0, False
    start = law_state[rows.DRIFT, i]
    change = sign * (drift - start)
    # The reversal is at the fraction s of the step, the zero of the quadratic d'(s). The arguments
    # are its three Bezier points. If rounding prevents a sign change, the result is NONE, which is
    # above 1; the end of the step is then used.
    s = min(
        find_sign_change(
            scaled_rate_0, 3.0 * change - scaled_rate_0 - scaled_rate_1, scaled_rate_1
        ),
        1.0,
    )
    r = 1.0 - s
    # The drift changes by `loading_change` from the start to the reversal (Hermite cubic at s), and
    # by `unloading_change` from the reversal to the end in the opposite direction, m.
    loading_change = s * s * (3.0 - 2.0 * s) * change + s * r * (
        r * scaled_rate_0 - s * scaled_rate_1
    )
    unloading_change = loading_change - change
    reversal_drift = start + sign * loading_change
    # The time of the inner point, as a fraction of the step, follows from the condition that the
    # quadrature is exact for linear functions: wc c + w1 = 1/2.
    inner_fraction = (0.5 - coefficients[WEIGHT_1]) / coefficients[WEIGHT_C]
    # Each call moves the law from the state in the first block (0: start of the step) to a drift,
    # stores the new state in the second block, and returns the tangent stiffness there. The inner
    # point is stored in FIRST_TRIAL, the end in SECOND_TRIAL and the reversal in THIRD_TRIAL.
    if s < inner_fraction:  # reversal, inner point, end
        loading_tangent = restoring_force_outlined(
            law_parameters, law_state, i, 0, rows.THIRD_TRIAL, reversal_drift
        )
        tangent_c = restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.FIRST_TRIAL, drift_c
        )
        tangent = restoring_force_outlined(
            law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL, drift
        )
        scratch[ROW.PREVIOUS_BLOCK, i] = rows.FIRST_TRIAL
    else:  # inner point, reversal, end
        tangent_c = restoring_force_outlined(
            law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift_c
        )
        loading_tangent = restoring_force_outlined(
            law_parameters, law_state, i, rows.FIRST_TRIAL, rows.THIRD_TRIAL, reversal_drift
        )
        tangent = restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.SECOND_TRIAL, drift
        )
        scratch[ROW.PREVIOUS_BLOCK, i] = rows.THIRD_TRIAL
    # Estimate the effect of the kink on the force, N: the numerator of KINK in the docstring.
    kink = abs(tangent - loading_tangent) * min(loading_change, unloading_change)
    if linear_terms[rows.POWER_DAMPER, i] != 0.0:
        force_0, _ = power_damper(linear_terms, i, scaled_rate_0 / h)
        force_1, _ = power_damper(linear_terms, i, scaled_rate_1 / h)
        kink += _DASHPOT_KINK * min(abs(force_0), abs(force_1))
    # If the force at the reversal is zero, the quotient is infinite or nan, without an exception.
    # Condition 1 of `keep_negligible_kinks` is then False, and the reversal is located.
    scratch[ROW.KINK, i] = kink / abs(law_state[rows.THIRD_TRIAL + rows.FORCE, i])
    # Derivative of the force at the end with respect to the drift d1 at the end: if d1 increases by
    # a small amount e, the drift at the reversal increases by `moved_fraction` e, where
    # `moved_fraction` is the coefficient of d1 in d(s). The force at the reversal then increases by
    # `loading_tangent` `moved_fraction` e. From the reversal to the end, the change of drift
    # increases by the rest, (1 - `moved_fraction`) e, which changes the force by `tangent` times
    # this amount.
    moved_fraction = s * s * (3.0 - 2.0 * s)
    return tangent_c, tangent + moved_fraction * (loading_tangent - tangent), True


@outlined
def keep_negligible_kinks(scene, h, memory):
    """Decide which reversals can remain within the step; the other reversals must be located.

    The force of a curved law has a kink at a reversal of the drift: the tangent stiffness changes
    suddenly. A step that extends over a kink has an additional error. To avoid this error, the
    caller locates the reversal and divides the step at its time. If the error is negligible, the
    reversal can remain within the step. This function makes the decision for each story and marks
    the result in row KINK of the scratch array:

        before the call    estimated error, the effect of the kink on the story force divided by the
                           force; 0 if the law was not evaluated over a reversal
        after the call     not 0 if the story has a reversal that can remain within the step (the
                           value is unchanged); otherwise 0

    If the drift rate of a story with the value 0 has changed its sign, the caller divides the step
    at the reversal.

    A reversal can remain within the step if both conditions are satisfied:

        1. KINK <= _MAX_KINK Q_max / S.
        2. The story has no power-law dashpot, or the drift at the reversal is less than _NEAR_PEAK
           times the peak drift of the story until now.

    Q and S are sums over the floors with the masses m, the velocities v0, v1 and the accelerations
    a0, a1 at the start and at the end of the step of length h:

        Q = sum of m ((a0 + a1) / 2 - (v1 - v0) / h)^2
        S = sum of m (a0^2 + a1^2) / 2

    Q compares the average of the accelerations at both endpoints with the mean acceleration over
    the step. Q_max is the largest Q of all steps of the run, including this step; S belongs to this
    step only. The function also updates the maxima of Q and S over the run in row RUN_MAXIMA; the
    maximum of S is only used by `tolerance_of_run`.

    Reasons:

    - Condition 1: Q_max / S is a measure of the largest error of a step in the run. A kink that is
      small in comparison does not reduce the accuracy. For a response with the circular frequency
      omega, Q / S is of the order of ((omega h)^2 / 12)^2, the fourth power of h; the effect of a
      kink is of order 2. Therefore, all reversals are located if the steps are small.
    - Condition 2: An inaccurate reversal near the peak drift would falsify the peak drift.
    - Dashpots: The forces of power-law dashpots change abruptly at a reversal and would increase Q.
      Their contribution to the accelerations is therefore removed in Q.

    Parameters
    ----------
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array.
    """
    linear_terms = scene.linear_terms
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    # `mismatch` is Q and `acceleration_norm` is S of this step.
    mismatch = acceleration_norm = 0.0
    for i in range(n):
        a0, a1 = state[rows.ACCELERATION, i], scratch[momentum.A1, i]
        # `difference` is the average of the endpoint accelerations of floor `i` minus the mean
        # acceleration in the step. `dashpot_force` is the same difference of the dashpot forces on
        # the floor; its contribution to the acceleration is removed.
        dashpot_force = (
            scratch[ROW.DASHPOT_MISMATCH, i]
            - linear_terms[rows.LINK, i + 1] * scratch[ROW.DASHPOT_MISMATCH, i + 1]
        )
        difference = (
            0.5 * (a0 + a1)
            - scratch[momentum.DV, i] / h
            + linear_terms[rows.INVERSE_MASS, i] * dashpot_force
        )
        mismatch += linear_terms[rows.MASS, i] * difference * difference
        acceleration_norm += 0.5 * linear_terms[rows.MASS, i] * (a0 * a0 + a1 * a1)
    update_run_maxima(scratch, ROW.RUN_MAXIMA, mismatch, acceleration_norm)
    mismatch = scratch[ROW.RUN_MAXIMA, 0]  # maximum Q in the run
    # `may_remain` is condition 2 of the docstring: the reversal may remain within the step. Block
    # THIRD_TRIAL of the law state contains the drift at the reversal.
    for i in range(n):
        is_near_peak = (
            abs(law_state[rows.THIRD_TRIAL + rows.DRIFT, i])
            >= _NEAR_PEAK * scratch[ROW.PEAKS + rows.PEAK_DRIFT, i]
        )
        may_remain = linear_terms[rows.POWER_DAMPER, i] == 0.0 or not is_near_peak
        if not (may_remain and scratch[ROW.KINK, i] * acceleration_norm <= _MAX_KINK * mismatch):
            scratch[ROW.KINK, i] = 0.0


@outlined
def _add_damper(coefficients, linear_terms, i, h, increment, memory, factors):
    """Add the power-law dashpot of story `i` to its force and impulse.

    f0, fc and f1 are the dashpot forces at the start, at the inner point (suffix `_c`) and at the
    end of the step. r0, rc and r1 are the drift rates at these points. The mean of the dashpot
    force over the step is w0 f0 + wc fc + w1 f1, and its impulse is h times the mean. The drift
    rate at the inner point is interpolated, with the factors q_d = RATE_BY_INCREMENT,
    q_0 = RATE_BY_VELOCITY_0 and q_1 = RATE_BY_VELOCITY_1 in `coefficients`:

        rc = q_d * (d1 - d0) / h + q_0 * r0 + q_1 * r1

    These scratch rows change:

        FORCE_1             force of the story at the end of the step, N: f1 is added
        FORCE_S             impulse of the story over the step, N s: the dashpot impulse is added
        DASHPOT_MISMATCH    set to (f0 + f1) / 2 minus the mean, N
        SLOPE_C, SLOPE_1    set to the derivatives of fc and f1 with respect to the drift rate,
                            N s/m

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method: the weights w0, wc, w1 and the coefficients RATE_BY_... are
        used.
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses: one row per property, one column per floor.
    i : int
        Index of the story.
    h : float
        Length of the step, s.
    increment : float
        Change of drift d1 - d0 in the step, m.
    memory : Memory
        State and scratch array.
    factors : int
        First scratch row of the factorization.

    Returns
    -------
    bool
        True if the existing factorization must be computed again, because it is for another
        derivative of f1. The derivative of fc is not compared.
    """
    state, _, scratch, _ = memory
    # Compute the drift rates at the start, at the end and at the inner point of the step. For the
    # first story, column i - 1 is the last column of the tables, and link is 0.
    link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
    rate_0 = state[rows.VELOCITY, i] - link * state[rows.VELOCITY, i - 1]
    rate_1 = scratch[momentum.V1, i] - link * scratch[momentum.V1, i - 1]
    rate_c = (
        coefficients[RATE_BY_INCREMENT] / h * increment
        + coefficients[RATE_BY_VELOCITY_0] * rate_0
        + coefficients[RATE_BY_VELOCITY_1] * rate_1
    )
    force_0, _ = power_damper(linear_terms, i, rate_0)
    force_c, derivative_c = power_damper(linear_terms, i, rate_c)
    force_1, derivative_1 = power_damper(linear_terms, i, rate_1)
    # Add the dashpot to the force at the end and to the impulse of the story.
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
    # In the matrix, h times the derivative is added to the mass of the floor. Its change is
    # therefore compared with the mass.
    return (
        h * abs(derivative_1 - scratch[factors + _BLOCK.FACTORED_SLOPE, i])
        > TANGENT_TOLERANCE * linear_terms[rows.MASS, i]
    )


@inline
def _newton_factorization(scratch, factors):
    """Return the location of the factorization of Newton's method in the scratch array.

    `factors` is the first row of a block of rows that contains two factorizations: of the complex
    matrix for linear branches and of the matrix of Newton's method. BLOCKS and COUPLING (`_Block`)
    and _STORE are row numbers relative to `factors`; _STORE is the number of the first row after
    the rows of `_Block`. The result has four fields:

        table       the scratch array
        pivot       first row of the 2 x 2 diagonal blocks
        coupling    first row of the blocks between adjacent floors
        store       first row of the terms of modal damping: 6 rows per damped mode and a temporary
                    row (`factor_rows`)
    """
    return Factors(scratch, factors + _BLOCK.BLOCKS, factors + _BLOCK.COUPLING, factors + _STORE)


@outlined
def _factor(coefficients, linear_terms, modal, h, scratch, factors):
    """Assemble and factorize the matrix of Newton's method for the current tangent stiffnesses.

    The step of length h starts with displacement u0, velocity v0 and acceleration a0 of each floor,
    and ends with u1, v1 and a1. The two unknowns of a floor are u1 - u0 and v1 - v0. Its two
    equations, with the mass M, the dampers C, the story forces f and the impulse I of the load, are

        kinematics    M (u1 - u0) = M (h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1))
        momentum      M (v1 - v0) + C (u1 - u0) + h (w0 f(u0) + wc f(uc) + w1 f(u1)) = I

    The acceleration at the end is eliminated by equilibrium with the load p1, and uc is the
    displacement at the inner point of the quadrature:

        M a1 = p1 - C v1 - f(u1),   uc = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1)

    All other symbols (th, al, be, w0, wc, w1, gd, g0, g1) are coefficients of the method.

    The matrix contains the derivatives of the equations with respect to the unknowns. It has 2 x 2
    blocks and is block tridiagonal, because a story couples adjacent floors only. Each story
    contributes one 2 x 2 block. The four rows from `coupling` on receive its entries, the
    derivatives with respect to the changes of the drift and of the drift rate in the step:

        row             equation      with respect to    derivative
        coupling        kinematics    drift              -be h^2 k1
        coupling + 1    kinematics    drift rate         -be h^2 (c + s1)
        coupling + 2    momentum      drift              c + h (wc gd kc + w1 k1) + rd wc sc
        coupling + 3    momentum      drift rate         -be h^2 kc + h (rv wc sc + w1 s1)

    kc and k1 are the tangent stiffnesses at the inner point and at the end, including P-delta. c is
    the coefficient of a linear story damper. The force of a power-law dashpot has the derivatives
    sc and s1 with respect to the drift rate at these points. The derivatives of the drift rate at
    the inner point are rd / h with respect to the change of drift, and rv with respect to the
    change of drift rate (RATE_BY_INCREMENT and RATE_BY_VELOCITY_1 of `coefficients`). The impulse
    contains h times the dashpot force; the term h wc sc rd / h is therefore rd wc sc. The
    coefficients of the method satisfy wc gd = th - w1 and wc g1 = -be.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method: th, be, weights of the impulse, and the coefficients of the
        drift rate at the inner point.
    linear_terms, modal : ndarray
        Masses, dampers and geometric stiffnesses of the building; rows w of the modal damping
        matrix C = sum of w w^T.
    h : float
        Length of the step, s.
    scratch : ndarray
        Rows TANGENT_C, TANGENT_1 (N/m), SLOPE_C and SLOPE_1 (N s/m) are used. The rows from
        `factors` on receive the factorization.
    factors : int
        First scratch row of the factorization.
    """
    n = linear_terms.shape[1] - 1
    by_a = coefficients[BETA] * h * h
    by_tangent_c = h * (coefficients[THETA] - coefficients[WEIGHT_1])  # = h wc gd
    coupling = factors + _BLOCK.COUPLING
    # For each story, store the tangents without P-delta and s1 in the rows FACTORED_..., and the
    # four derivatives of the table above in the rows from `coupling` on. `slope_c` is wc sc, and
    # `slope_1` is s1. Later, `_evaluate_laws` compares the rows FACTORED_... with the new tangents
    # and the step length, to decide whether the factorization is still valid. sc is not compared,
    # because it usually changes together with s1, and a comparison would save practically no
    # iterations. The sc of an earlier factorization only affects the rate of convergence.
    for i in range(n):
        tangent_c = scratch[ROW.TANGENT_C, i]
        tangent_1 = scratch[ROW.TANGENT_1, i]
        scratch[factors + _BLOCK.FACTORED_C, i] = tangent_c
        scratch[factors + _BLOCK.FACTORED_1, i] = tangent_1
        tangent_c += linear_terms[rows.GEOMETRIC, i]
        tangent_1 += linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i]
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
    # The last column of row FACTORED_1 contains the step length of the factorization.
    scratch[factors + _BLOCK.FACTORED_1, n] = h
    # Add the masses and the floor dampers, and connect the blocks of adjacent floors.
    assemble_blocks(
        linear_terms, _newton_factorization(scratch, factors), h * coefficients[THETA], by_a, n
    )
    # Modal damping is a part of C. In the kinematic equation, M a1 contains -C v1: the derivative
    # with respect to v1 is -be h^2 C. In the momentum equation, C (u1 - u0) has the derivative C
    # with respect to u1. These factors are the second and third number below.
    factor_blocks(
        _newton_factorization(scratch, factors), ModalBlocks(modal, 0.0, -by_a, 1.0, 0.0), n
    )
