"""Motion of all floors over a step of impulse4: the impulse-momentum step with the restoring force
integrated.

Unknowns are u1 - u0 and v1 - v0 per floor, with a1 eliminated by equilibrium. The restoring force
is integrated over the step by a quadrature with one point inside it; `tdint.methods.impulse4` gives
the formulas and the coefficients.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.equations import impulse_momentum as momentum
from tdint.kernels.equations.impulse_momentum import correct, guess, in_balance, residuals
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
from tdint.kernels.laws.choosing import CURVES
from tdint.kernels.linear_terms import (
    MODAL,
    add_modal_force,
    floor_impulse,
    floor_load,
    power_damper,
)
from tdint.kernels.stepping import Factors
from tdint.kernels.stories.branches import turning
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
    """Rows of work beyond those of the momentum equations."""

    TANGENT_C: int = 1
    TANGENT_1: int = 1
    SLOPE_C: int = 1  # of the power-law dashpots
    SLOPE_1: int = 1
    LAST_CORRECTION: int = 2  # of DU and DV
    KINK: int = (
        1  # where a story turns in the step: what its force bends there over its size; else 0
    )
    BEFORE: int = 1  # the block of springs that its state at the end is reached from
    MISSED: int = (
        1  # what the mean force of a power-law dashpot misses the mean of those at both ends by
    )
    PAIR: int = 2  # r1 + l r2, which becomes w: real and imaginary part
    SAVED: int = (
        3 + rows.LAW_STATE_ROWS
    )  # state and springs at the start of a step that is done in pieces
    PIECE: int = 3  # motion at the start of a piece
    WORST: int = 1  # maxima over the run of `missed` and `size` in `join`: columns 0 and 1
    TURNS: int = 1  # drifts where stories turned in it
    PEAKS: int = 2 * rows.PEAK_ROWS  # within such pieces
    REMAINING: int = 2  # DU and DV from the start of the substep to the end of the step, as solved


class _Block(NamedTuple):
    """Rows of a block of factors: of the complex matrix for straight branches, and of Newton's
    iteration."""

    STRAIGHT: int = 1  # the slopes of the complex one; the step stands in the last column
    PIVOT: int = 2
    MULTIPLIER: int = 2
    FACTORED_C: int = (
        1  # the tangents of Newton's; the step stands in the last column of the next row
    )
    FACTORED_1: int = 1
    FACTORED_SLOPE: int = 1  # the one at the end
    BLOCKS: int = 4
    COUPLING: int = COUPLING_ROWS


# Turns that a step goes over, measured on the problems with Bouc-Wen stories and power-law dashpots
# of `tdint chart`
# a kink over the square of what the step misses: with 5 to 50 errors and costs hardly change
_WEAK = 15.0
_BY_DASHPOT = (
    0.003  # part of a dashpot's force that counts as a kink: without it small steps err tenfold
)
# over the peak drift so far: where a dashpot's force jumps, steps tell less well how far the story
# went
_FAR = 0.8

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
    """Rows of a block of factors for a building with `modes` modally damped modes: behind those of
    `_Block` come what each of both matrices keeps of the modes."""
    return _STORE + 2 * (6 * modes + 1)


@inline
def loads(linear_terms, forces, t, h, ground_0, ground_1, scratch):
    """Load at the end and exact impulse over [t, t + h]."""
    floor_load(linear_terms, forces, t + h, ground_1, scratch, momentum.LOAD)
    floor_impulse(linear_terms, forces, t, h, ground_0, ground_1, scratch, momentum.IMPULSE)


@inline
def solve_linear(coefficients, scene, h, memory, factors):
    """Motion over a step in which no story leaves its branch: linear, so one solve, from no motion
    at all.

    Kinematics (times M) and momentum are then

        (M - be h^2 K) du - (th h M + be h^2 C) dv = r1,   (C + th h K) du + (M - be h^2 K) dv = r2

    With l^2 - th h l + be h^2 = 0 the first one plus l times the second one is a single complex
    equation,

        (M + l C + l^2 K) w = r1 + l r2,   w = du - conj(l) dv

    whose matrix is symmetric and tridiagonal.
    """
    linear_terms, modal, _, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    re = coefficients[ROOT_RE] * h
    im = coefficients[ROOT_IM] * h
    kept = Factors(
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
        factor_pairs(linear_terms, law_state, (re, im), kept, damping, n)
    solve_pairs_damped(kept, damping, ROW.PAIR, ROW.PAIR + 1, n)
    _motion(linear_terms, modal, (re, im), state, law_state, scratch)


@inline
def _right_side(coefficients, scene, h, memory, straight):
    """What is out of balance without any motion, r1 + l r2, into the rows PAIR. True if the slopes
    in row `straight` of work, for which the matrix was factored, are not those of the present
    branches, or the step is another one."""
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
    stale = scratch[straight, n] != h
    force_above = 0.0
    impulse_above = 0.0
    for i in range(n - 1, -1, -1):
        stale |= law_state[rows.SLOPE, i] != scratch[straight, i]
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
        balance = scratch[momentum.IMPULSE, i] - (impulse - impulse_above)
        scratch[ROW.PAIR, i] = (
            mass * (h * v + by_a0 * state[rows.ACCELERATION, i]) - by_a1 * inertia + re * balance
        )
        scratch[ROW.PAIR + 1, i] = im * balance
        force_above = link * force
        impulse_above = link * impulse
    add_modal_force(modal, state, rows.VELOCITY, by_a1, scratch, ROW.PAIR, n)
    return stale


@inline
def _motion(linear_terms, modal, root, state, law_state, scratch):
    """Motion at the end of the step from w in the rows PAIR: dv = im(w) / im(l), du = re(w) + re(l)
    dv."""
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
    for i in range(n):
        scratch[momentum.FORCE_1, i] = 0.0
    add_modal_force(modal, scratch, momentum.V1, -1.0, scratch, momentum.FORCE_1, n)
    for i in range(n):
        scratch[momentum.A1, i] += linear_terms[rows.INVERSE_MASS, i] * scratch[momentum.FORCE_1, i]


@outlined
def newton(frozen, has_guess, coefficients, scene, h, memory, factors):
    """Find the motion over a step by Newton's method for all stories together.

    The unknowns are u1 - u0 and v1 - v0 of each floor; a1 is eliminated by equilibrium. If the
    iteration cycles, corrections are halved until they reduce the residuals.

    The residuals must fall below a small part of what the steps of the run err by. Both are of
    order 4 in the time step, so the order of the method remains 4, and coarse steps need fewer
    iterations.

    Parameters
    ----------
    frozen : bool
        True if stories that are linear on their branches stay on them.
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
        State, law states, work array and report.
    factors : int
        First row of the block of factors in the work array.

    Returns
    -------
    int
        Number of linear solves, at least 1, or NOT_CONVERGED.
    """
    linear_terms, modal, _, _, _ = scene
    state, _, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    if not has_guess:
        guess(1.0, h, state, scratch, n)
    tolerance = RESIDUAL_TOLERANCE
    if scratch[ROW.WORST, 1] > 0.0:
        missed = scratch[ROW.WORST, 0] / scratch[ROW.WORST, 1]
        tolerance = min(_MAX_TOLERANCE, max(RESIDUAL_TOLERANCE, _TOLERANCE_PER_MISS * missed))
    iterations = 0
    part = 1.0
    before = math.inf
    last = False
    while True:
        stale = _path(frozen, coefficients, scene, h, memory, factors)
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
            in_balance(
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
            size = squared_norm(linear_terms, scratch, momentum.R1, n) / (h * h) + squared_norm(
                linear_terms, scratch, momentum.R2, n
            )
            if must_halve(size, before, part):
                part *= 0.5
                add_rows(-part, scratch, ROW.LAST_CORRECTION, momentum.DU, 2, n)
                continue
            before = size
            part = 1.0
        if iterations == MAX_ITERATIONS:
            return rows.NOT_CONVERGED
        if stale:
            _factor(coefficients, linear_terms, modal, h, scratch, factors)
        last = correct(coefficients[BETA], modal, h, _kept(scratch, factors), n)
        iterations += 1
        if iterations > UNDAMPED_ITERATIONS:
            copy_rows(scratch, momentum.R1, ROW.LAST_CORRECTION, 2, n)
    return max(iterations, 1)


@inline
def _path(frozen, coefficients, scene, h, memory, factors):
    """Drift laws along the step: at the inner point and from there to the end.

    With `frozen`, stories that are linear on their branches stay on them. Leaves the story forces
    at the end and the story impulses. True if the factorization does not fit the tangents.
    """
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    stale = scratch[factors + _BLOCK.FACTORED_1, n] != h
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
            turned = False
            if CURVES and frozen:
                tangent_c, tangent, turned = _over_turn(
                    coefficients, scene, h, i, (drift_c, drift), memory
                )
            if not turned:
                tangent_c = restoring_force_outlined(
                    law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift_c
                )
                tangent = restoring_force_outlined(
                    law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL, drift
                )
            force_c = law_state[rows.FIRST_TRIAL + rows.FORCE, i]
            force = law_state[rows.SECOND_TRIAL + rows.FORCE, i]
        same = TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        stale = stale or abs(tangent_c - scratch[factors + _BLOCK.FACTORED_C, i]) > same
        stale = stale or abs(tangent - scratch[factors + _BLOCK.FACTORED_1, i]) > same
        # A drift is a difference: what the displacements round is not out of balance.
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
            stale = (
                _add_damper(coefficients, linear_terms, i, h, increment, memory, factors) or stale
            )
        uc_below = uc
        u_below = u
        v_below = v
        du_below = du
    return stale


@outlined
def _over_turn(coefficients, scene, h, i, drifts, memory):
    """Go with story `i`, whose law is curved, over the drift at which it turns: to the inner point
    and to the end.

    Between the ends of the step the drift is a cubic. Returns the tangents of the forces at both
    points, the way of the turn with them included, and whether there is a turn; else nothing is
    done.
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
    s = min(turning(before, 3.0 * change - before - after, after), 1.0)
    r = 1.0 - s
    peak = s * s * (3.0 - 2.0 * s) * change + s * r * (r * before - s * after)
    top = start + turn * peak
    c = (0.5 - coefficients[WEIGHT_1]) / coefficients[WEIGHT_C]
    if s < c:
        loading = restoring_force_outlined(law_parameters, law_state, i, 0, rows.THIRD_TRIAL, top)
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
            law_parameters, law_state, i, rows.FIRST_TRIAL, rows.THIRD_TRIAL, top
        )
        tangent = restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.SECOND_TRIAL, drift
        )
        scratch[ROW.BEFORE, i] = rows.THIRD_TRIAL
    bend = abs(tangent - loading) * min(peak, peak - change)
    if linear_terms[rows.POWER_DAMPER, i] != 0.0:
        force_0, _ = power_damper(linear_terms, i, before / h)
        force_1, _ = power_damper(linear_terms, i, after / h)
        bend += _BY_DASHPOT * min(abs(force_0), abs(force_1))
    scratch[ROW.KINK, i] = bend / abs(law_state[rows.THIRD_TRIAL + rows.FORCE, i])
    # The drift at the turn takes a part of the change of that at the end, and its force with it.
    part = s * s * (3.0 - 2.0 * s)
    return tangent_c, tangent + part * (loading - tangent), True


@outlined
def join(scene, h, memory):
    """Keep in the row KINK the stories that go over their turn within the motion that has been
    found; of the others the turn is to be located.

    A kink may be no stronger than what the worst step of the run so far errs by anyhow. With one
    frequency omega a step's accelerations miss the mean by (omega h)^2 / 12 of them, and its mean
    force errs by about the square of that, of order 4. What a kink bends is of order 2, so that
    small steps locate all of them. Dashpots are left out: their forces jump where a story turns.
    """
    linear_terms = scene.linear_terms
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    missed = size = 0.0
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
        size += 0.5 * linear_terms[rows.MASS, i] * (a0 * a0 + a1 * a1)
    missed = max(missed, scratch[ROW.WORST, 0])
    scratch[ROW.WORST, 0] = missed
    scratch[ROW.WORST, 1] = max(size, scratch[ROW.WORST, 1])
    for i in range(n):
        near = (
            abs(law_state[rows.THIRD_TRIAL + rows.DRIFT, i])
            >= _FAR * scratch[ROW.PEAKS + rows.PEAK_DRIFT, i]
        )
        tells = linear_terms[rows.POWER_DAMPER, i] == 0.0 or not near
        if not (tells and scratch[ROW.KINK, i] * size <= _WEAK * missed):
            scratch[ROW.KINK, i] = 0.0


@outlined
def _add_damper(coefficients, linear_terms, i, h, increment, memory, factors):
    """Add the power-law dashpot of story `i` to its force and impulse. True if the factorization
    does not fit its slope."""
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
def _kept(scratch, factors):
    """The factorization in a block of rows."""
    return Factors(scratch, factors + _BLOCK.BLOCKS, factors + _BLOCK.COUPLING, factors + _STORE)


@outlined
def _factor(coefficients, linear_terms, modal, h, scratch, factors):
    """Factor the Newton matrix for the present tangents."""
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
    assemble_blocks(linear_terms, _kept(scratch, factors), h * coefficients[THETA], by_a, n)
    factor_blocks(_kept(scratch, factors), ModalBlocks(modal, 0.0, -by_a, 1.0, 0.0), n)
