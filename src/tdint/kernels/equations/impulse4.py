"""Motion of all floors over a step of impulse4: the impulse-momentum step with the restoring force integrated.

Unknowns are u1 - u0 and v1 - v0 per floor, with a1 eliminated by equilibrium. The restoring force is integrated over
the step by a quadrature with one point inside it; `tdint.methods.impulse4` gives the formulas and the coefficients.
"""

from __future__ import annotations

import math

from tdint.kernels.chain import MODAL, add_modal_force, floor_impulse, floor_load, power_damper
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.halving import add_rows, copy_rows, squares, too_far
from tdint.kernels.equations.impulse_momentum import (
    A1,
    DU,
    DV,
    FORCE_1,
    FORCE_S,
    IMPULSE,
    LOAD,
    MOMENTUM_ROWS,
    R1,
    R2,
    SIZE,
    U1,
    V1,
    correct,
    guess,
    in_balance,
    residuals,
    solve,
)
from tdint.kernels.equations.tridiagonal import COUPLING_ROWS, assemble_blocks, factor_blocks
from tdint.kernels.layout import (
    ACCELERATION,
    DISPLACEMENT,
    DRIFT,
    FIRST_TRIAL,
    FLOOR_DAMPER,
    FORCE,
    GEOMETRIC,
    INVERSE_MASS,
    LINK,
    MASS,
    NOT_CONVERGED,
    PEAK_ROWS,
    POWER_DAMPER,
    SECOND_TRIAL,
    SLOPE,
    SPRING_ROWS,
    STIFFNESS,
    STORY_DAMPER,
    VELOCITY,
)
from tdint.kernels.stepping import CLOSE, ITERATIONS, PATIENCE, SAME_TANGENT, SMALL
from tdint.kernels.stories.springs import reach

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

# Rows of work beyond those of the momentum equations
_TANGENT_C = MOMENTUM_ROWS
_TANGENT_1 = MOMENTUM_ROWS + 1
_SLOPE_C = MOMENTUM_ROWS + 2  # of the power-law dashpots
_SLOPE_1 = MOMENTUM_ROWS + 3
_LAST_CORRECTION = MOMENTUM_ROWS + 4  # of DU and DV
SAVED = MOMENTUM_ROWS + 6  # state and springs at the start of a step that is done in pieces
PIECE = SAVED + 3 + SPRING_ROWS  # motion at the start of a piece
TURNS = PIECE + 3  # drifts where stories turned in it
PEAKS = TURNS + 1  # within such pieces
FACTORS = PEAKS + 2 * PEAK_ROWS

# Rows of a block of factors
_FACTORED_C = 0  # its tangents; the step stands in the last column
_FACTORED_1 = 1
_FACTORED_SLOPE = 2  # the one at the end
_BLOCKS = 3
_COUPLING = 7
STORE = _COUPLING + COUPLING_ROWS


def factor_rows(modes: int) -> int:
    return STORE + 6 * modes + 1


@inlined
def loads(chain, forces, t, h, ground_0, ground_1, work):
    """Load at the end and exact impulse over [t, t + h]."""
    floor_load(chain, forces, t + h, ground_1, work, LOAD)
    floor_impulse(chain, forces, t, h, ground_0, ground_1, work, IMPULSE)


@inlined
def solve_linear(coefficients, chain, modal, h, state, springs, work, factors):
    """Motion over a step in which no story leaves its branch: linear, so one solve, from no motion at all."""
    n = chain.shape[1] - 1
    if _right_side(coefficients, chain, modal, h, state, springs, work, factors):
        for i in range(n):
            work[_TANGENT_C, i] = springs[SLOPE, i]
            work[_TANGENT_1, i] = springs[SLOPE, i]
        _factor(coefficients, chain, modal, h, work, factors)
    _solve(coefficients, modal, h, work, factors, n)
    _motion(chain, modal, state, springs, work)


@inlined
def _right_side(coefficients, chain, modal, h, state, springs, work, factors):
    """What is out of balance without any motion into the rows of residuals. True if the factorization does not fit the
    branches."""
    n = chain.shape[1] - 1
    by_rate = coefficients[WEIGHT_C] * h * (coefficients[BY_VELOCITY_0] + coefficients[BY_VELOCITY_1])
    by_a0 = coefficients[ALPHA] * h * h
    by_a1 = coefficients[BETA] * h * h
    stale = work[factors + _FACTORED_1, n] != h
    force_above = 0.0
    impulse_above = 0.0
    for i in range(n - 1, -1, -1):
        stale |= springs[SLOPE, i] != work[factors + _FACTORED_1, i]
        link = chain[LINK, i]
        mass = chain[MASS, i]
        geometric = chain[GEOMETRIC, i]
        v = state[VELOCITY, i]
        rate = v - link * state[VELOCITY, max(i - 1, 0)]
        spring = springs[FORCE, i] + geometric * springs[DRIFT, i]
        force = spring + chain[STORY_DAMPER, i] * rate
        impulse = h * (spring + by_rate * (springs[SLOPE, i] + geometric) * rate)
        inertia = work[LOAD, i] - chain[FLOOR_DAMPER, i] * v - (force - force_above)
        work[R1, i] = mass * (h * v + by_a0 * state[ACCELERATION, i]) - by_a1 * inertia
        work[R2, i] = work[IMPULSE, i] - (impulse - impulse_above)
        force_above = link * force
        impulse_above = link * impulse
    add_modal_force(modal, state, VELOCITY, by_a1, work, R1, n)
    return stale


@inlined
def _motion(chain, modal, state, springs, work):
    """Motion at the end of the step from the increments in the rows of residuals."""
    n = chain.shape[1] - 1
    force_above = 0.0
    for i in range(n - 1, -1, -1):
        link = chain[LINK, i]
        below = max(i - 1, 0)
        du = work[R1, i]
        dv = work[R2, i]
        v = state[VELOCITY, i] + dv
        work[DU, i] = du
        work[DV, i] = dv
        work[U1, i] = state[DISPLACEMENT, i] + du
        work[V1, i] = v
        geometric = chain[GEOMETRIC, i]
        force = springs[FORCE, i] + geometric * springs[DRIFT, i]
        force += (springs[SLOPE, i] + geometric) * (du - link * work[R1, below])
        force += chain[STORY_DAMPER, i] * (v - link * (state[VELOCITY, below] + work[R2, below]))
        outer = work[LOAD, i] - chain[FLOOR_DAMPER, i] * v
        work[A1, i] = chain[INVERSE_MASS, i] * (outer - (force - force_above))
        force_above = link * force
    if MODAL and modal.shape[0] > 0:
        _add_modal_acceleration(chain, modal, work, n)


@called
def _add_modal_acceleration(chain, modal, work, n):
    for i in range(n):
        work[FORCE_1, i] = 0.0
    add_modal_force(modal, work, V1, -1.0, work, FORCE_1, n)
    for i in range(n):
        work[A1, i] += chain[INVERSE_MASS, i] * work[FORCE_1, i]


@called
def newton(frozen, coefficients, chain, modal, laws, h, state, springs, work, memo, factors):
    """Motion over a step by Newton on all stories at once, unknowns (u1 - u0, v1 - v0) per floor, a1 eliminated by
    equilibrium.

    With `frozen`, stories that are linear on their branches stay on them. Where it goes round in a cycle, corrections
    are halved until they bring the equations closer to balance.
    """
    n = chain.shape[1] - 1
    guess(1.0, h, state, work, n)
    iterations = 0
    part = 1.0
    before = math.inf
    last = False
    while True:
        stale = _path(frozen, coefficients, chain, laws, h, state, springs, work, factors)
        _residuals(coefficients, chain, modal, h, state, work)
        if in_balance(iterations == ITERATIONS, coefficients[BETA], chain, h, state, work, memo) or last:
            break
        if iterations >= PATIENCE:
            size = squares(chain, work, R1, n) / (h * h) + squares(chain, work, R2, n)
            if too_far(size, before, part):
                part *= 0.5
                add_rows(-part, work, _LAST_CORRECTION, DU, 2, n)
                continue
            before = size
            part = 1.0
        if iterations == ITERATIONS:
            return NOT_CONVERGED
        if stale:
            _factor(coefficients, chain, modal, h, work, factors)
        last = _correct(coefficients, modal, h, work, factors, n)
        iterations += 1
        if iterations > PATIENCE:
            copy_rows(work, R1, _LAST_CORRECTION, 2, n)
    return max(iterations, 1)


@inlined
def _path(frozen, coefficients, chain, laws, h, state, springs, work, factors):
    """Drift laws along the step: at the inner point and from there to the end.

    With `frozen`, stories that are linear on their branches stay on them. Leaves the story forces at the end and the
    story impulses. True if the factorization does not fit the tangents.
    """
    n = chain.shape[1] - 1
    stale = work[factors + _FACTORED_1, n] != h
    uc_below = 0.0
    u_below = 0.0
    v_below = 0.0
    du_below = 0.0
    for i in range(n):
        du = work[DU, i]
        u = state[DISPLACEMENT, i] + du
        v = state[VELOCITY, i] + work[DV, i]
        uc = (
            state[DISPLACEMENT, i]
            + coefficients[BY_INCREMENT] * du
            + h * (coefficients[BY_VELOCITY_0] * state[VELOCITY, i] + coefficients[BY_VELOCITY_1] * v)
        )
        work[U1, i] = u
        work[V1, i] = v
        link = chain[LINK, i]
        drift_c = uc - link * uc_below
        drift = u - link * u_below
        increment = du - link * du_below
        rate = v - link * v_below
        if frozen and springs[SLOPE, i] < math.inf:
            tangent_c = tangent = springs[SLOPE, i]
            force_c = springs[FORCE, i] + tangent * (drift_c - springs[DRIFT, i])
            force = springs[FORCE, i] + tangent * (drift - springs[DRIFT, i])
        else:
            tangent_c = reach(laws, springs, i, 0, FIRST_TRIAL, drift_c)
            tangent = reach(laws, springs, i, FIRST_TRIAL, SECOND_TRIAL, drift)
            force_c = springs[FIRST_TRIAL + FORCE, i]
            force = springs[SECOND_TRIAL + FORCE, i]
        same = SAME_TANGENT * laws[STIFFNESS, i]
        stale = stale or abs(tangent_c - work[factors + _FACTORED_C, i]) > same
        stale = stale or abs(tangent - work[factors + _FACTORED_1, i]) > same
        # A drift is a difference: what the displacements round is not out of balance.
        work[SIZE, i] = SMALL / CLOSE * laws[STIFFNESS, i] * (abs(u) + abs(link * u_below))
        work[_TANGENT_C, i] = tangent_c
        work[_TANGENT_1, i] = tangent
        geometric = chain[GEOMETRIC, i]
        mean = (
            coefficients[WEIGHT_0] * (springs[FORCE, i] + geometric * springs[DRIFT, i])
            + coefficients[WEIGHT_C] * (force_c + geometric * drift_c)
            + coefficients[WEIGHT_1] * (force + geometric * drift)
        )
        damper = chain[STORY_DAMPER, i]
        work[FORCE_1, i] = force + geometric * drift + damper * rate
        work[FORCE_S, i] = h * mean + damper * increment
        if chain[POWER_DAMPER, i] != 0.0:
            stale = _add_damper(coefficients, chain, i, h, increment, state, work, factors) or stale
        uc_below = uc
        u_below = u
        v_below = v
        du_below = du
    return stale


@called
def _add_damper(coefficients, chain, i, h, increment, state, work, factors):
    """Add the power-law dashpot of story `i` to its force and impulse. True if the factorization does not fit its
    slope."""
    link = chain[LINK, i]
    rate_0 = state[VELOCITY, i] - link * state[VELOCITY, i - 1]
    rate_1 = work[V1, i] - link * work[V1, i - 1]
    rate_c = (
        coefficients[RATE_BY_INCREMENT] / h * increment
        + coefficients[RATE_BY_VELOCITY_0] * rate_0
        + coefficients[RATE_BY_VELOCITY_1] * rate_1
    )
    force_0, _ = power_damper(chain, i, rate_0)
    force_c, slope_c = power_damper(chain, i, rate_c)
    force_1, slope_1 = power_damper(chain, i, rate_1)
    work[FORCE_1, i] += force_1
    work[FORCE_S, i] += h * (
        coefficients[WEIGHT_0] * force_0 + coefficients[WEIGHT_C] * force_c + coefficients[WEIGHT_1] * force_1
    )
    work[_SLOPE_C, i] = slope_c
    work[_SLOPE_1, i] = slope_1
    return h * abs(slope_1 - work[factors + _FACTORED_SLOPE, i]) > SAME_TANGENT * chain[MASS, i]


@inlined
def _residuals(coefficients, chain, modal, h, state, work):
    residuals(coefficients[THETA], coefficients[ALPHA], coefficients[BETA], chain, modal, h, state, work)


@inlined
def _solve(coefficients, modal, h, work, factors, n):
    """Corrections, or increments, from the rows of residuals, in their place."""
    blocks = factors + _BLOCKS
    solve(coefficients[BETA], modal, h, work, blocks, factors + _COUPLING, factors + STORE, n)


@inlined
def _correct(coefficients, modal, h, work, factors, n):
    blocks = factors + _BLOCKS
    return correct(coefficients[BETA], modal, h, work, blocks, factors + _COUPLING, factors + STORE, n)


@called
def _factor(coefficients, chain, modal, h, work, factors):
    """Factor the Newton matrix for the present tangents."""
    n = chain.shape[1] - 1
    by_a = coefficients[BETA] * h * h
    inner = h * (coefficients[THETA] - coefficients[WEIGHT_1])  # = h wc gd
    coupling = factors + _COUPLING
    for i in range(n):
        tangent_c = work[_TANGENT_C, i]
        tangent_1 = work[_TANGENT_1, i]
        work[factors + _FACTORED_C, i] = tangent_c
        work[factors + _FACTORED_1, i] = tangent_1
        tangent_c += chain[GEOMETRIC, i]
        tangent_1 += chain[GEOMETRIC, i]
        damper = chain[STORY_DAMPER, i]
        slope_c = coefficients[WEIGHT_C] * work[_SLOPE_C, i]
        slope_1 = work[_SLOPE_1, i]
        work[factors + _FACTORED_SLOPE, i] = slope_1
        work[coupling, i] = -by_a * tangent_1
        work[coupling + 1, i] = -by_a * (damper + slope_1)
        work[coupling + 2, i] = damper + inner * tangent_c + h * coefficients[WEIGHT_1] * tangent_1
        work[coupling + 2, i] += coefficients[RATE_BY_INCREMENT] * slope_c
        work[coupling + 3, i] = -by_a * tangent_c
        work[coupling + 3, i] += h * (coefficients[RATE_BY_VELOCITY_1] * slope_c + coefficients[WEIGHT_1] * slope_1)
    work[factors + _FACTORED_1, n] = h
    assemble_blocks(chain, work, factors + _BLOCKS, coupling, h * coefficients[THETA], by_a, n)
    factor_blocks(factors + _BLOCKS, coupling, work, modal, 0.0, -by_a, 1.0, 0.0, factors + STORE, n)
