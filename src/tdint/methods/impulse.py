"""The impulse-momentum method as published in 2022, with its free number beta, line by line as the
paper has it.

    eqs. 11, 12   M (u1 - u0) - h/2 M (v0 + v1) = h^2/12 M (a0 - a1)                 displacement quartic over the step
    eq. 13        M (v1 - v0) + C (u1 - u0) + K q = I                                impulse is change of momentum
    eq. 14        q = h [72 beta u0 + (1 - 72 beta) u1 + h (48 beta - 1/4) v0 + h (24 beta - 1/4) v1
                         + h^2 (12 beta - 1/12) a0]                                  integral of u over the step
    eqs. 15-23    these lines and equilibrium at the end, M a1 + C v1 + K u1 = p1, solved for u1, v1 and a1
    eqs. 46-54    K q is f0 h + K_T(u1) (q - u0 h), on the drift of each story; equilibrium with f(u1)

| paper | here |
|---|---|
| q, eq. 14 | `q` in `_end`; here less u0 h |
| I, eq. 13 | `work[IMPULSE]`: h/2 (p0 + p1), as published (`_loads`) |
| beta, 1/144 | `coefficients[BETA]` |
| k_T, eq. 46 | `tangent` in `_end`, at the end of the step |
| k_x u1 = p_x, eqs. 17-21 | the Newton matrix (`_factor`) and minus the residuals (`residuals`): u1 and v1 together |
| a1, eq. 16 | none: the number m h^2/6 - k h^4/72, which the paper divides by to eliminate the jerk |

That number is zero at omega h = sqrt(12); the lines above, solved for u1 and v1, have no such
division. The paper as printed, with the division, is `tests/as_printed.py`: the same motion to
rounding.

Misprints of the paper, with the correction before the printed form:

    eq. 11        holds for the increment of the jerk, and misses powers of dt
    eq. 12        12 du/dt^2 for 2 du/dt^2
    eq. 14        a0 h^3/6, j0 h^4/24 and v0 h^2/2
    eq. 16        a1 = -(-m h^2/6 + k h^4/24 - 4 k beta h^4)
    eq. 20        I h^2/(6 a1) in its second block
    eq. 29        wrong powers; its denominator is W^4 + 12 xi W^3 + (12 + 48 xi^2) W^2 + 144 xi W + 144, W = omega dt
    eq. 33        96 beta dt^4 - dt^4 for 96 beta dt^3 - dt^4
                  + ((-48) dt xi) omega for - ((-48) dt xi) omega
    eqs. 36, 37   miss the 2 of eq. 31
    eq. 40        half of the numerical damping
    eqs. 44, 45   hold for xi = 1 only, with 288 dt v for 228 dt v
    eq. 49        the second m is c
    eq. 54        is eq. 16 with k_T
    eq. 57        -16 dt^2 xi^2 + 576 beta dt^2 + 12 dt^2) for -16 xi^2 + 576 beta xi dt^2 + 12)
                  + 8 dt^3 xi omega^3 for + 576 beta dt^3 xi omega^3
                  + 16 dt^2 xi^2 omega^2 for - 16 dt^2 xi^2 omega^2
    eq. 58        384 beta dt^4 - 2 dt^4 for 384 dt^4 - 2 dt^4
                  - 8 dt^2 omega) for - dt^2 omega)
    eq. 59        288 beta dt^5 xi - 2 dt^5 xi) for 2 dt^3 xi^2 - 2 dt^3 xi)
    eq. 60        the opposite sign
    eq. 61        the opposite sign
                  + ((-48) dt xi) omega for - ((-48) dt xi) omega
    section 3.4   refers to eqs. 43 and 44; eqs. 44 and 45 are meant

Eqs. 31, 32, 34, 35 and 62 to 65 hold as printed. The conclusions state order 1 for Wilson's method; its
order is 2.
"""  # noqa: E501

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, kernel, outlined
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
)
from tdint.kernels.equations.tridiagonal import (
    COUPLING_ROWS,
    ModalBlocks,
    assemble_blocks,
    factor_blocks,
)
from tdint.kernels.linear_terms import finite, floor_load
from tdint.kernels.stepping import STEP, Factors, Memory
from tdint.kernels.stories.law_state import commit, restoring_force
from tdint.methods.method import Family, Method, Parameter

# Coefficients
BETA = 0

_THETA = 0.5  # of both ends alike
_BY_A = 1.0 / 12.0  # weight of a0 and -a1 in the kinematic line


class _TangentRows(NamedTuple):
    """Rows of work beyond those of the momentum equations."""

    TANGENT: int = 1
    FACTORED: int = 1
    BLOCKS: int = 4
    COUPLING: int = COUPLING_ROWS


_ROW, _STORE = rows.chained(_TangentRows, momentum.MOMENTUM_ROWS)


@kernel(STEP)
def step(
    coefficients,
    linear_terms,
    modal,
    law_parameters,
    forces,
    flags,
    h,
    load,
    state,
    law_state,
    scratch,
    step_status,
):
    """One step (eqs. 15-23, nonlinear 46-54); Newton with unknowns (u1 - u0, v1 - v0) per floor,
    the change of the tangent left out of the matrix."""
    n = linear_terms.shape[1] - 1
    memory = Memory(state, law_state, scratch, step_status)
    factors = Factors(scratch, _ROW.BLOCKS, _ROW.COUPLING, _STORE)
    _loads(linear_terms, forces, h, load, scratch)
    store_first_guess(0.0 if flags[rows.LINEAR] != 0.0 else 1.0, h, state, scratch, n)
    iterations = 0
    last = False
    while True:
        stale = _end(coefficients, linear_terms, law_parameters, h, memory)  # eqs. 14 and 46
        # Eqs. 11, 12 (kinematics), 13 (momentum) and equilibrium at the end: what they are out of
        # balance
        residuals(_THETA, _BY_A, _BY_A, linear_terms, modal, h, state, scratch)
        balanced = has_converged(
            iterations == MAX_ITERATIONS,
            RESIDUAL_TOLERANCE,
            _BY_A,
            linear_terms,
            h,
            state,
            scratch,
            step_status,
        )
        if last or (balanced and iterations == MAX_ITERATIONS):
            break
        if iterations == MAX_ITERATIONS:
            return rows.NOT_CONVERGED
        if stale:
            _factor(coefficients, linear_terms, modal, h, factors)
            step_status[rows.FACTORED_STEP] = h
        # One correction beyond balance: the published equations to rounding, where balance alone
        # leaves 1e-11.
        last = correct(_BY_A, modal, h, factors, n) or balanced or flags[rows.LINEAR] != 0.0
        iterations += 1
    for i in range(n):
        state[rows.DISPLACEMENT, i] += scratch[momentum.DU, i]
        state[rows.VELOCITY, i] += scratch[momentum.DV, i]
        state[rows.ACCELERATION, i] = scratch[momentum.A1, i]
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
    return max(iterations, 1) if finite(state, n) else rows.NOT_FINITE


@inline
def _loads(linear_terms, forces, h, load, scratch):
    """Load at the end of the step, and its impulse I by the trapezoidal rule, as published (eq.
    13)."""
    floor_load(
        linear_terms, forces, load[rows.TIME], load[rows.GROUND_0], scratch, momentum.IMPULSE
    )
    floor_load(
        linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, momentum.LOAD
    )
    for i in range(linear_terms.shape[1] - 1):
        scratch[momentum.IMPULSE, i] = (
            0.5 * h * (scratch[momentum.IMPULSE, i] + scratch[momentum.LOAD, i])
        )


@inline
def _end(coefficients, linear_terms, law_parameters, h, memory):
    """Story forces at the end of the step and story impulses. True if the factorization does not
    fit the tangents."""
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    beta = coefficients[BETA]
    stale = step_status[rows.FACTORED_STEP] != h
    u_below = 0.0
    v_below = 0.0
    du_below = 0.0
    q_below = 0.0
    for i in range(n):
        du = scratch[momentum.DU, i]
        u = state[rows.DISPLACEMENT, i] + du
        v = state[rows.VELOCITY, i] + scratch[momentum.DV, i]
        q = h * (  # eq. 14 less u0 h
            (1.0 - 72.0 * beta) * du
            + h * ((48.0 * beta - 0.25) * state[rows.VELOCITY, i] + (24.0 * beta - 0.25) * v)
            + h * h * (12.0 * beta - 1.0 / 12.0) * state[rows.ACCELERATION, i]
        )
        scratch[momentum.U1, i] = u
        scratch[momentum.V1, i] = v
        link = linear_terms[rows.LINK, i]
        drift = u - link * u_below
        rate = v - link * v_below
        increment = du - link * du_below
        q_drift = q - link * q_below
        u_below = u
        v_below = v
        du_below = du
        q_below = q
        # Equilibrium has f(u1); the momentum f0 h + k_T (q - u0 h), eq. 46.
        tangent = restoring_force(law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift)
        scratch[_ROW.TANGENT, i] = tangent
        # A drift is a difference: what the displacements round is not out of balance.
        rounding = ROUNDING / RESIDUAL_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        scratch[momentum.SIZE, i] = rounding * (abs(u) + abs(u - drift))
        stale = (
            stale
            or abs(tangent - scratch[_ROW.FACTORED, i])
            > TANGENT_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        )
        geometric = linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i]
        scratch[momentum.FORCE_1, i] = (
            law_state[rows.FIRST_TRIAL + rows.FORCE, i] + geometric * drift + damper * rate
        )
        scratch[momentum.FORCE_S, i] = (
            h * (law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i])
            + (tangent + geometric) * q_drift
            + damper * increment
        )
    return stale


@outlined
def _factor(coefficients, linear_terms, modal, h, factors):
    """Factor the Newton matrix for the present tangents."""
    scratch = factors.table
    n = linear_terms.shape[1] - 1
    beta = coefficients[BETA]
    by_a = _BY_A * h * h
    for i in range(n):
        scratch[_ROW.FACTORED, i] = scratch[_ROW.TANGENT, i]
        tangent = scratch[_ROW.TANGENT, i] + linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i]
        # Kinematics by u1 and v1, with a1 from equilibrium (eqs. 11, 12)
        scratch[_ROW.COUPLING, i] = -by_a * tangent
        scratch[_ROW.COUPLING + 1, i] = -by_a * damper
        # Momentum by u1 and v1: C and k_T times the derivatives of q (eqs. 13, 14)
        scratch[_ROW.COUPLING + 2, i] = damper + h * (1.0 - 72.0 * beta) * tangent
        scratch[_ROW.COUPLING + 3, i] = h * h * (24.0 * beta - 0.25) * tangent
    assemble_blocks(linear_terms, factors, _THETA * h, by_a, n)
    factor_blocks(factors, ModalBlocks(modal, 0.0, -by_a, 1.0, 0.0), n)


def _limit(beta: float) -> float:
    """Lower end of the unstable band of an undamped oscillator; none for beta = 1/144.

    The determinant of the amplification matrix is 1, and trace + 2 is proportional to (W^2 - 12)(12
    beta W^2 - 1): it is negative between the two roots.
    """
    if beta == PUBLISHED:
        return math.inf
    roots = [12.0] if beta <= 0.0 else [12.0, 1.0 / (12.0 * beta)]
    return math.sqrt(min(roots))


PUBLISHED = 1.0 / 144.0  # of the paper: no unstable band (`_limit`)

FAMILY = Family(
    "impulse",
    step,
    lambda modes: _STORE + 6 * modes + 1,
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
    power_dampers=False,
)

METHODS = (
    Method(
        name="impulse",
        family=FAMILY,
        parameters=(Parameter("beta", PUBLISHED, 0.0, 0.25, low_allowed=False),),
        coefficients=lambda beta: (beta,),
        stability_limit=_limit,
        rho_inf=lambda beta: 1.0 if beta == PUBLISHED else math.nan,
        source="the impulse-momentum method of 2022 as published, eqs. 11-23 and 46-54",
    ),
)
