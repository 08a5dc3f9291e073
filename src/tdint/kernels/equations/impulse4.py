"""Response of all floors over a step of `impulse4`: the impulse-momentum step with the integrated
restoring force.

The unknowns are u1 - u0 and v1 - v0 of each floor; a1 is eliminated by equilibrium. The restoring
force is integrated over the step by a quadrature rule with one inner point.
`tdint.methods.impulse4` contains the formulas and the coefficients.
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

# Coefficients
THETA = 0
ALPHA = 1
BETA = 2
WEIGHT_0 = 3
WEIGHT_C = 4
WEIGHT_1 = 5
BY_INCREMENT = 6  # gd
BY_VELOCITY_0 = 7  # g0
BY_VELOCITY_1 = 8  # g1
RATE_BY_INCREMENT = 9  # vc = these times (u1 - u0) / h, v0 and v1
RATE_BY_VELOCITY_0 = 10
RATE_BY_VELOCITY_1 = 11
ROOT_RE = 12  # l / h, l^2 - th h l + be h^2 = 0
ROOT_IM = 13


class _Rows(NamedTuple):
    """Scratch rows in addition to those of the momentum equations."""

    TANGENT_C: int = 1
    TANGENT_1: int = 1
    # derivatives of the power-law dashpots at the inner point and at the end, N s/m
    SLOPE_C: int = 1
    SLOPE_1: int = 1
    LAST_CORRECTION: int = 2  # last corrections of DU and DV
    KINK: int = (
        # relative change of the force by the kink at a reversal of the story within the step; 0
        # otherwise
        1
    )
    BEFORE: int = 1  # block of the law state from which the state at the end is reached
    MISSED: int = (
        # difference between the average of the dashpot forces at both endpoints and the mean
        # dashpot force, N
        1
    )
    PAIR: int = 2  # r1 + l r2, then w: real and imaginary part
    SAVED: int = (
        3 + rows.LAW_STATE_ROWS
    )  # state and law states at the start of a step that is divided into substeps
    PIECE: int = 3  # response at the start of a substep
    WORST: int = 1  # maxima over the run of `missed` and `norm` in `join`: columns 0 and 1
    TURNS: int = 1  # drifts at the reversals of the stories
    PEAKS: int = 2 * rows.PEAK_ROWS  # peaks within the substeps
    REMAINING: int = 2  # DU and DV from the start of the substep to the end of the step, as solved


class _Block(NamedTuple):
    """Rows of a factorization: of the complex matrix for linear branches, and of the matrix of
    Newton's method."""

    # slopes of the complex matrix; the last column contains the length of the step
    STRAIGHT: int = 1
    PIVOT: int = 2
    MULTIPLIER: int = 2
    FACTORED_C: int = (
        # tangents of the matrix of Newton's method; the last column of the next row contains the
        # length of the step
        1
    )
    FACTORED_1: int = 1
    FACTORED_SLOPE: int = 1  # derivative of the dashpot force at the end
    BLOCKS: int = 4
    COUPLING: int = COUPLING_ROWS


# Reversals that are not located. The values were determined with the problems with Bouc-Wen stories
# and power-law dashpots of `tdint chart`.
_MAX_KINK = 15.0
# Fraction of the dashpot force that is regarded as a kink. Without it, the errors of small steps
# are ten times as large.
_DASHPOT_KINK = 0.003
# Relative to the current peak drift. If the dashpot force is discontinuous near the peak drift, the
# steps estimate the peak less reliably.
_NEAR_PEAK = 0.8

# Dimensionless. Tolerance of the residuals over the squared relative amount by which the steps of
# the run miss the mean acceleration (`join`), a quantity of order 4 in the time step. With 0.01 the
# errors of peak drifts change by less than 2 % in buildings with Bouc-Wen, tanh and stiffening
# stories and with power-law dashpots.
_TOLERANCE_PER_MISS = 1e-2
# Dimensionless. Upper limit of that tolerance. As a fixed tolerance it would limit the accuracy of
# peak drifts to about 5e-5.
_MAX_TOLERANCE = 1e-4

ROW, FACTORS = rows.chained(_Rows, momentum.MOMENTUM_ROWS)
_BLOCK, _STORE = rows.chained(_Block)


@inline
def factor_rows(modes):
    """Return the number of rows of a factorization for a building with `modes` modally damped
    modes.

    The rows of `_Block` are followed by the rows for the modes of both matrices.
    """
    return _STORE + 2 * (6 * modes + 1)


@inline
def loads(linear_terms, forces, t, h, ground_0, ground_1, scratch):
    """Store the load at the end of the step and the exact impulse over [t, t + h].

    Parameters
    ----------
    linear_terms, forces : ndarray
        Linear terms of the building and forces on floors.
    t, h : float
        Start and length of the step, s.
    ground_0, ground_1 : float
        Ground acceleration at both endpoints, m/s^2.
    scratch : ndarray
        Rows LOAD and IMPULSE are set.
    """
    floor_load(linear_terms, forces, t + h, ground_1, scratch, momentum.LOAD)
    floor_impulse(linear_terms, forces, t, h, ground_0, ground_1, scratch, momentum.IMPULSE)


@inline
def solve_linear(coefficients, scene, h, memory, factors):
    """Compute the response over a step in which no story leaves its branch, by one linear solution.

    The first guess has zero increments. Kinematics (times M) and momentum are then

        (M - be h^2 K) du - (th h M + be h^2 C) dv = r1,   (C + th h K) du + (M - be h^2 K) dv = r2

    With l^2 - th h l + be h^2 = 0, the first equation plus l times the second equation is a single
    complex equation,

        (M + l C + l^2 K) w = r1 + l r2,   w = du - conj(l) dv

    with a symmetric tridiagonal matrix.

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
    factors : int
        First scratch row of the factorization.
    """
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    re = coefficients[ROOT_RE] * h
    im = coefficients[ROOT_IM] * h
    factorization = Factors(
        scratch,
        factors + _BLOCK.PIVOT,
        factors + _BLOCK.MULTIPLIER,
        factors + _STORE + 6 * modal.shape[0] + 1,
    )
    damping = ModalBlocks(modal, re, -im, im, re)
    straight = factors + _BLOCK.STRAIGHT
    if _right_side(coefficients, scene, h, memory, straight):
        for i in range(n):
            scratch[straight, i] = law_state[rows.SLOPE, i]
        scratch[straight, n] = h
        factor_pairs(linear_terms, law_state, (re, im), factorization, damping, n)
    solve_pairs_damped(factorization, damping, ROW.PAIR, ROW.PAIR + 1, n)
    _store_response(linear_terms, modal, (re, im), state, law_state, scratch)


@inline
def _right_side(coefficients, scene, h, memory, straight):
    """Store the residual for zero increments, r1 + l r2, in the rows PAIR.

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
    straight : int
        Scratch row with the slopes of the existing factorization.

    Returns
    -------
    bool
        True if the factorization is not valid for the current slopes and the length of the step.
    """
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    re = coefficients[ROOT_RE] * h
    im = coefficients[ROOT_IM] * h
    by_rate = (
        coefficients[WEIGHT_C] * h * (coefficients[BY_VELOCITY_0] + coefficients[BY_VELOCITY_1])
    )
    by_a0 = coefficients[ALPHA] * h * h
    by_a1 = coefficients[BETA] * h * h
    is_stale = scratch[straight, n] != h
    force_above = 0.0
    impulse_above = 0.0
    for i in range(n - 1, -1, -1):
        is_stale |= law_state[rows.SLOPE, i] != scratch[straight, i]
        link = linear_terms[rows.LINK, i]
        mass = linear_terms[rows.MASS, i]
        geometric = linear_terms[rows.GEOMETRIC, i]
        v = state[rows.VELOCITY, i]
        rate = v - link * state[rows.VELOCITY, max(i - 1, 0)]
        spring = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        force = spring + linear_terms[rows.STORY_DAMPER, i] * rate
        impulse = h * (spring + by_rate * (law_state[rows.SLOPE, i] + geometric) * rate)
        inertia = (
            scratch[momentum.LOAD, i]
            - linear_terms[rows.FLOOR_DAMPER, i] * v
            - (force - force_above)
        )
        imbalance = scratch[momentum.IMPULSE, i] - (impulse - impulse_above)
        scratch[ROW.PAIR, i] = (
            mass * (h * v + by_a0 * state[rows.ACCELERATION, i]) - by_a1 * inertia + re * imbalance
        )
        scratch[ROW.PAIR + 1, i] = im * imbalance
        force_above = link * force
        impulse_above = link * impulse
    add_modal_force(modal, state, rows.VELOCITY, by_a1, scratch, ROW.PAIR, n)
    return is_stale


@inline
def _store_response(linear_terms, modal, root, state, law_state, scratch):
    """Compute the response at the end of the step from w: dv = im(w) / im(l), du = re(w) + re(l)
    dv.

    Parameters
    ----------
    linear_terms, modal : ndarray
        Linear terms of the building and rows of the modal damping matrix.
    root : tuple of float
        Real and imaginary part of l, s.
    state, law_state : ndarray
        State and law states at the start of the step.
    scratch : ndarray
        Scratch rows; PAIR contains w.
    """
    n = linear_terms.shape[1] - 1
    re, im = root
    by_im = 1.0 / im
    force_above = 0.0
    dv_below = scratch[ROW.PAIR + 1, n - 1] * by_im
    du_below = scratch[ROW.PAIR, n - 1] + re * dv_below
    for i in range(n - 1, -1, -1):
        link = linear_terms[rows.LINK, i]
        below = max(i - 1, 0)
        du = du_below
        dv = dv_below
        dv_below = scratch[ROW.PAIR + 1, below] * by_im
        du_below = scratch[ROW.PAIR, below] + re * dv_below
        v = state[rows.VELOCITY, i] + dv
        scratch[momentum.DU, i] = du
        scratch[momentum.DV, i] = dv
        scratch[momentum.U1, i] = state[rows.DISPLACEMENT, i] + du
        scratch[momentum.V1, i] = v
        geometric = linear_terms[rows.GEOMETRIC, i]
        force = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        force += (law_state[rows.SLOPE, i] + geometric) * (du - link * du_below)
        force += linear_terms[rows.STORY_DAMPER, i] * (
            v - link * (state[rows.VELOCITY, below] + dv_below)
        )
        outer = scratch[momentum.LOAD, i] - linear_terms[rows.FLOOR_DAMPER, i] * v
        scratch[momentum.A1, i] = linear_terms[rows.INVERSE_MASS, i] * (
            outer - (force - force_above)
        )
        force_above = link * force
    if MODAL and modal.shape[0] > 0:
        _add_modal_acceleration(linear_terms, modal, scratch, n)


@outlined
def _add_modal_acceleration(linear_terms, modal, scratch, n):
    """Add the effect of modal damping to the acceleration at the end of the step.

    Parameters
    ----------
    linear_terms, modal : ndarray
        Linear terms of the building and rows of the modal damping matrix.
    scratch : ndarray
        Scratch rows.
    n : int
        Number of floors.
    """
    for i in range(n):
        scratch[momentum.FORCE_1, i] = 0.0
    add_modal_force(modal, scratch, momentum.V1, -1.0, scratch, momentum.FORCE_1, n)
    for i in range(n):
        scratch[momentum.A1, i] += linear_terms[rows.INVERSE_MASS, i] * scratch[momentum.FORCE_1, i]


@outlined
def newton(frozen, has_guess, coefficients, scene, h, memory, factors):
    """Compute the response over a step by Newton's method for all stories together.

    The unknowns are u1 - u0 and v1 - v0 of each floor; a1 is eliminated by equilibrium. If the
    iteration cycles, corrections are halved until they reduce the residuals.

    The tolerance of the residuals is a small fraction of the error of the steps of the run. Both
    are of order 4 in the time step. The order of the method therefore remains 4, and coarse steps
    need fewer iterations.

    Parameters
    ----------
    frozen : bool
        True if stories with a linear branch remain on this branch.
    has_guess : bool
        True if the rows DU and DV contain the first estimate; otherwise it is the motion with
        constant acceleration.
    coefficients : ndarray
        Coefficients of the method.
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step or substep, s.
    memory : Memory
        State, law states, scratch array and status of the step.
    factors : int
        First row of the factorization in the scratch array.

    Returns
    -------
    int
        Number of linear solves, at least 1, or NOT_CONVERGED.
    """
    linear_terms, modal, _, _, _ = scene
    state, _, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    if not has_guess:
        store_first_guess(1.0, h, state, scratch, n)
    tolerance = RESIDUAL_TOLERANCE
    if scratch[ROW.WORST, 1] > 0.0:
        missed = scratch[ROW.WORST, 0] / scratch[ROW.WORST, 1]
        tolerance = min(_MAX_TOLERANCE, max(RESIDUAL_TOLERANCE, _TOLERANCE_PER_MISS * missed))
    iterations = 0
    fraction = 1.0
    before = math.inf
    last = False
    while True:
        is_stale = _evaluate_laws(frozen, coefficients, scene, h, memory, factors)
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
            or last
        ):
            break
        if iterations >= UNDAMPED_ITERATIONS:
            norm = squared_norm(linear_terms, scratch, momentum.R1, n) / (h * h) + squared_norm(
                linear_terms, scratch, momentum.R2, n
            )
            if must_halve(norm, before, fraction):
                fraction *= 0.5
                add_rows(-fraction, scratch, ROW.LAST_CORRECTION, momentum.DU, 2, n)
                continue
            before = norm
            fraction = 1.0
        if iterations == MAX_ITERATIONS:
            return rows.NOT_CONVERGED
        if is_stale:
            _factor(coefficients, linear_terms, modal, h, scratch, factors)
        last = correct(coefficients[BETA], modal, h, _newton_factorization(scratch, factors), n)
        iterations += 1
        if iterations > UNDAMPED_ITERATIONS:
            copy_rows(scratch, momentum.R1, ROW.LAST_CORRECTION, 2, n)
    return max(iterations, 1)


@inline
def _evaluate_laws(frozen, coefficients, scene, h, memory, factors):
    """Evaluate the laws at the inner point and at the end of the step.

    The story forces at the end and the story impulses are stored.

    Parameters
    ----------
    frozen : bool
        True if stories with a linear branch remain on it.
    coefficients : ndarray
        Coefficients of the method.
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array.
    factors : int
        First scratch row of the factorization.

    Returns
    -------
    bool
        True if the factorization does not match the tangents.
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
        link = linear_terms[rows.LINK, i]
        drift_c = uc - link * uc_below
        drift = u - link * u_below
        increment = du - link * du_below
        rate = v - link * v_below
        if frozen and law_state[rows.SLOPE, i] < math.inf:
            tangent_c = tangent = law_state[rows.SLOPE, i]
            scratch[ROW.KINK, i] = 0.0
            force_c = law_state[rows.FORCE, i] + tangent * (drift_c - law_state[rows.DRIFT, i])
            force = law_state[rows.FORCE, i] + tangent * (drift - law_state[rows.DRIFT, i])
        else:
            is_reversed = False
            if HAS_CURVED_LAW and frozen:
                tangent_c, tangent, is_reversed = _evaluate_over_reversal(
                    coefficients, scene, h, i, (drift_c, drift), memory
                )
            if not is_reversed:
                tangent_c = restoring_force_outlined(
                    law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift_c
                )
                tangent = restoring_force_outlined(
                    law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL, drift
                )
            force_c = law_state[rows.FIRST_TRIAL + rows.FORCE, i]
            force = law_state[rows.SECOND_TRIAL + rows.FORCE, i]
        tangent_tolerance = TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        is_stale = (
            is_stale or abs(tangent_c - scratch[factors + _BLOCK.FACTORED_C, i]) > tangent_tolerance
        )
        is_stale = (
            is_stale or abs(tangent - scratch[factors + _BLOCK.FACTORED_1, i]) > tangent_tolerance
        )
        # A drift is a difference of displacements. The rounding errors of the displacements are not
        # part of the residual.
        rounding = ROUNDING / RESIDUAL_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        scratch[momentum.SIZE, i] = rounding * (abs(u) + abs(link * u_below))
        scratch[ROW.TANGENT_C, i] = tangent_c
        scratch[ROW.TANGENT_1, i] = tangent
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
        uc_below = uc
        u_below = u
        v_below = v
        du_below = du
    return is_stale


@outlined
def _evaluate_over_reversal(coefficients, scene, h, i, drifts, memory):
    """Evaluate a curved law of story `i` over a reversal within the step.

    The drift within the step is a cubic.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    scene : Scene
        Building and forces on floors.
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
        Derivatives of the forces at the inner point and at the end, including the change of the
        drift at the reversal, N/m.
    is_reversed : bool
        True if the story reverses. Otherwise nothing is stored.
    """
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    drift_c, drift = drifts
    link = linear_terms[rows.LINK, i]
    below = max(i - 1, 0)
    turn = law_state[rows.RATE_SIGN, i]
    before = turn * h * (state[rows.VELOCITY, i] - link * state[rows.VELOCITY, below])
    after = turn * h * (scratch[momentum.V1, i] - link * scratch[momentum.V1, below])
    scratch[ROW.KINK, i] = 0.0
    if not (before > 0.0 and after < 0.0) or law_state.shape[0] > rows.EXTRA_ROWS:
        return 0.0, 0.0, False
    start = law_state[rows.DRIFT, i]
    change = turn * (drift - start)
    s = min(find_sign_change(before, 3.0 * change - before - after, after), 1.0)
    r = 1.0 - s
    peak = s * s * (3.0 - 2.0 * s) * change + s * r * (r * before - s * after)
    reversal_drift = start + turn * peak
    c = (0.5 - coefficients[WEIGHT_1]) / coefficients[WEIGHT_C]
    if s < c:
        loading = restoring_force_outlined(
            law_parameters, law_state, i, 0, rows.THIRD_TRIAL, reversal_drift
        )
        tangent_c = restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.FIRST_TRIAL, drift_c
        )
        tangent = restoring_force_outlined(
            law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL, drift
        )
        scratch[ROW.BEFORE, i] = rows.FIRST_TRIAL
    else:
        tangent_c = restoring_force_outlined(
            law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift_c
        )
        loading = restoring_force_outlined(
            law_parameters, law_state, i, rows.FIRST_TRIAL, rows.THIRD_TRIAL, reversal_drift
        )
        tangent = restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.SECOND_TRIAL, drift
        )
        scratch[ROW.BEFORE, i] = rows.THIRD_TRIAL
    kink = abs(tangent - loading) * min(peak, peak - change)
    if linear_terms[rows.POWER_DAMPER, i] != 0.0:
        force_0, _ = power_damper(linear_terms, i, before / h)
        force_1, _ = power_damper(linear_terms, i, after / h)
        kink += _DASHPOT_KINK * min(abs(force_0), abs(force_1))
    scratch[ROW.KINK, i] = kink / abs(law_state[rows.THIRD_TRIAL + rows.FORCE, i])
    # A change of the drift at the end changes the drift at the reversal by this fraction, and
    # therefore its force.
    fraction = s * s * (3.0 - 2.0 * s)
    return tangent_c, tangent + fraction * (loading - tangent), True


@outlined
def join(scene, h, memory):
    """Determine the stories with a reversal that does not have to be located; row KINK of the other
    stories is set to 0.

    A kink must not exceed the error of the worst step of the run until now. With one frequency
    omega, the accelerations at the endpoints of a step differ from the mean by (omega h)^2 / 12 of
    their value, and the error of the mean force is about the square of this value, which is of
    order 4. The effect of a kink is of order 2, so that for small steps all reversals are located.
    The dashpots are not included because their forces are discontinuous at a reversal.

    Parameters
    ----------
    scene : Scene
        Building and forces on floors.
    h : float
        Length of the step, s.
    memory : Memory
        State, law states and scratch array.
    """
    linear_terms = scene.linear_terms
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    missed = norm = 0.0
    for i in range(n):
        a0, a1 = state[rows.ACCELERATION, i], scratch[momentum.A1, i]
        dashpots = (
            scratch[ROW.MISSED, i] - linear_terms[rows.LINK, i + 1] * scratch[ROW.MISSED, i + 1]
        )
        miss = (
            0.5 * (a0 + a1)
            - scratch[momentum.DV, i] / h
            + linear_terms[rows.INVERSE_MASS, i] * dashpots
        )
        missed += linear_terms[rows.MASS, i] * miss * miss
        norm += 0.5 * linear_terms[rows.MASS, i] * (a0 * a0 + a1 * a1)
    missed = max(missed, scratch[ROW.WORST, 0])
    scratch[ROW.WORST, 0] = missed
    scratch[ROW.WORST, 1] = max(norm, scratch[ROW.WORST, 1])
    for i in range(n):
        is_near_peak = (
            abs(law_state[rows.THIRD_TRIAL + rows.DRIFT, i])
            >= _NEAR_PEAK * scratch[ROW.PEAKS + rows.PEAK_DRIFT, i]
        )
        is_reliable = linear_terms[rows.POWER_DAMPER, i] == 0.0 or not is_near_peak
        if not (is_reliable and scratch[ROW.KINK, i] * norm <= _MAX_KINK * missed):
            scratch[ROW.KINK, i] = 0.0


@outlined
def _add_damper(coefficients, linear_terms, i, h, increment, memory, factors):
    """Add the power-law dashpot of story `i` to its force and impulse.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    linear_terms : ndarray
        Linear terms of the building.
    i : int
        Index of the story.
    h : float
        Length of the step, s.
    increment : float
        Change of drift in the step, m.
    memory : Memory
        State and scratch array.
    factors : int
        First scratch row of the factorization.

    Returns
    -------
    bool
        True if the factorization does not match the derivative of the dashpot force.
    """
    state, _, scratch, _ = memory
    link = linear_terms[rows.LINK, i]
    rate_0 = state[rows.VELOCITY, i] - link * state[rows.VELOCITY, i - 1]
    rate_1 = scratch[momentum.V1, i] - link * scratch[momentum.V1, i - 1]
    rate_c = (
        coefficients[RATE_BY_INCREMENT] / h * increment
        + coefficients[RATE_BY_VELOCITY_0] * rate_0
        + coefficients[RATE_BY_VELOCITY_1] * rate_1
    )
    force_0, _ = power_damper(linear_terms, i, rate_0)
    force_c, slope_c = power_damper(linear_terms, i, rate_c)
    force_1, slope_1 = power_damper(linear_terms, i, rate_1)
    scratch[momentum.FORCE_1, i] += force_1
    mean = (
        coefficients[WEIGHT_0] * force_0
        + coefficients[WEIGHT_C] * force_c
        + coefficients[WEIGHT_1] * force_1
    )
    scratch[momentum.FORCE_S, i] += h * mean
    scratch[ROW.MISSED, i] = 0.5 * (force_0 + force_1) - mean
    scratch[ROW.SLOPE_C, i] = slope_c
    scratch[ROW.SLOPE_1, i] = slope_1
    return (
        h * abs(slope_1 - scratch[factors + _BLOCK.FACTORED_SLOPE, i])
        > TANGENT_TOLERANCE * linear_terms[rows.MASS, i]
    )


@inline
def _newton_factorization(scratch, factors):
    """Return the rows of the factorization of Newton's method."""
    return Factors(scratch, factors + _BLOCK.BLOCKS, factors + _BLOCK.COUPLING, factors + _STORE)


@outlined
def _factor(coefficients, linear_terms, modal, h, scratch, factors):
    """Assemble and factorize the matrix of Newton's method for the current tangents.

    Parameters
    ----------
    coefficients : ndarray
        Coefficients of the method.
    linear_terms, modal : ndarray
        Linear terms of the building and rows of the modal damping matrix.
    h : float
        Length of the step, s.
    scratch : ndarray
        Scratch array.
    factors : int
        First scratch row of the factorization.
    """
    n = linear_terms.shape[1] - 1
    by_a = coefficients[BETA] * h * h
    inner = h * (coefficients[THETA] - coefficients[WEIGHT_1])  # = h wc gd
    coupling = factors + _BLOCK.COUPLING
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
            damper + inner * tangent_c + h * coefficients[WEIGHT_1] * tangent_1
        )
        scratch[coupling + 2, i] += coefficients[RATE_BY_INCREMENT] * slope_c
        scratch[coupling + 3, i] = -by_a * tangent_c
        scratch[coupling + 3, i] += h * (
            coefficients[RATE_BY_VELOCITY_1] * slope_c + coefficients[WEIGHT_1] * slope_1
        )
    scratch[factors + _BLOCK.FACTORED_1, n] = h
    assemble_blocks(
        linear_terms, _newton_factorization(scratch, factors), h * coefficients[THETA], by_a, n
    )
    factor_blocks(
        _newton_factorization(scratch, factors), ModalBlocks(modal, 0.0, -by_a, 1.0, 0.0), n
    )
