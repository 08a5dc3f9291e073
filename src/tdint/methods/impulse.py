"""Method impulse: the impulse-momentum method as published in 2022, with its parameter beta.

Equation numbers in this module refer to the publication. The equations of a step of length h
from the state u0, v0, a0 to u1, v1, a1 are

    eqs. 11, 12   M (u1 - u0) - h/2 M (v0 + v1) = h^2/12 M (a0 - a1)                 displacement quartic over the step
    eq. 13        M (v1 - v0) + C (u1 - u0) + K q = I                                impulse is change of momentum
    eq. 14        q = h [72 beta u0 + (1 - 72 beta) u1 + h (48 beta - 1/4) v0 + h (24 beta - 1/4) v1
                         + h^2 (12 beta - 1/12) a0]                                  integral of u over the step
    eqs. 15-23    these lines and equilibrium at the end, M a1 + C v1 + K u1 = p1, solved for u1, v1 and a1
    eqs. 46-54    K q is f0 h + K_T(u1) (q - u0 h), on the drift of each story; equilibrium with f(u1)

| paper | here |
|---|---|
| q, eq. 14 | `q` in `_evaluate_laws`, without the term u0 h |
| I, eq. 13 | `scratch[IMPULSE]`: h/2 (p0 + p1), as published (`_store_load`) |
| beta, 1/144 | `coefficients[BETA]` |
| k_T, eq. 46 | `tangent` in `_evaluate_laws`, at the end of the step |
| k_x u1 = p_x, eqs. 17-21 | matrix of Newton's method (`_factor`) and minus the residuals (`residuals`), for u1 and v1 together |
| a1, eq. 16 | not used: the coefficient m h^2/6 - k h^4/72, by which the paper divides to eliminate the jerk |

This coefficient is zero at omega h = sqrt(12). The equations above are solved for u1 and v1 without
such a division. The printed equations, with the division, are implemented in `tests/as_printed.py`;
the results agree up to rounding.

Misprints of the paper. In each line, the correction precedes the printed form:

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
)
from tdint.kernels.equations.tridiagonal import (
    COUPLING_ROWS,
    ModalBlocks,
    assemble_blocks,
    factor_blocks,
)
from tdint.kernels.linear_terms import finite, floor_load
from tdint.kernels.stepping import Factors, step_kernel
from tdint.kernels.stories.law_state import commit, restoring_force
from tdint.methods.method import Family, Method, Parameter

# Index of the parameter beta in the coefficients of the step
BETA = 0

# Weights in the kinematic equation (eqs. 11, 12), u1 - u0 = h _THETA (v0 + v1) + h^2 _BY_A (a0 -
# a1)
_THETA = 0.5
_BY_A = 1.0 / 12.0
_KINEMATICS = (_THETA, _BY_A, _BY_A)


class _TangentRows(NamedTuple):
    """Number of scratch rows for each quantity, in addition to the rows of the momentum
    equations."""

    TANGENT: int = 1  # tangent stiffness at the end of the step, N/m
    FACTORED: int = 1  # tangent stiffness in the factorization, N/m
    BLOCKS: int = 4  # 2 x 2 diagonal blocks of the factorization
    COUPLING: int = COUPLING_ROWS  # blocks between adjacent floors


_ROW, _STORE = rows.chained(_TangentRows, momentum.MOMENTUM_ROWS)


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Integrate the equations of motion over one time step of the published method.

    Newton's method solves kinematics and momentum for u1 - u0 and v1 - v0 of each floor; a1 follows
    from equilibrium. The derivative of k_T is omitted from the matrix.
    """
    linear_terms, modal, law_parameters, forces, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    factors = Factors(scratch, _ROW.BLOCKS, _ROW.COUPLING, _STORE, linear_terms)
    _store_load(linear_terms, forces, h, load, scratch)
    # The guess is zero in a linear building.
    store_first_guess(0.0 if flags[rows.LINEAR] != 0.0 else 1.0, h, state, scratch, n)
    iterations = 0
    # The final pass of the loop computes forces and acceleration of the corrected increments.
    is_last = False
    while True:
        is_stale = _evaluate_laws(coefficients, linear_terms, law_parameters, h, memory)
        residuals(_KINEMATICS, scene, h, memory)
        is_final = iterations == MAX_ITERATIONS
        is_balanced = has_converged(is_final, RESIDUAL_TOLERANCE, _KINEMATICS, scene, h, memory)
        if is_last or (is_balanced and is_final):
            break
        if is_final:
            return rows.NOT_CONVERGED
        if is_stale:
            _factor(coefficients, linear_terms, modal, h, factors)
            step_status[rows.FACTORED_STEP] = h
        # No further correction follows if the correction is of the order of rounding errors, if the
        # residuals were already within RESIDUAL_TOLERANCE (this correction satisfies the published
        # equations up to rounding), or if the building is linear. The residuals of the final pass
        # then consist of rounding errors and are not tested again.
        is_last = correct(modal, factors, n) or is_balanced or flags[rows.LINEAR] != 0.0
        iterations += 1
    for i in range(n):
        state[rows.DISPLACEMENT, i] += scratch[momentum.DU, i]
        state[rows.VELOCITY, i] += scratch[momentum.DV, i]
        state[rows.ACCELERATION, i] = scratch[momentum.A1, i]
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
    return max(iterations, 1) if finite(state, n) else rows.NOT_FINITE


@inline
def _store_load(linear_terms, forces, h, load, scratch):
    """Store the load at the end of the step, and the impulse of the load by the trapezoidal rule
    (eq. 13).
    """
    # Row IMPULSE first receives the load p0.
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
def _evaluate_laws(coefficients, linear_terms, law_parameters, h, memory):
    """Compute the story forces at the end of the step and their impulses over the step; return True
    if the factorization must be computed again.

    The impulse of a story (eq. 46) is h f0 + k_T (q of the floor above - q of the floor below),
    where q is the integral of u - u0 (eq. 14 without the term u0 h). P-delta and the story damper
    are added.

    Row SIZE receives the force that corresponds to the rounding errors of the displacements,
    divided by RESIDUAL_TOLERANCE.
    """
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    beta = coefficients[BETA]
    is_stale = step_status[rows.FACTORED_STEP] != h
    u_below = 0.0
    v_below = 0.0
    du_below = 0.0
    q_below = 0.0
    for i in range(n):
        du = scratch[momentum.DU, i]
        u = state[rows.DISPLACEMENT, i] + du
        v = state[rows.VELOCITY, i] + scratch[momentum.DV, i]
        q = h * (  # eq. 14 without the term u0 h
            (1.0 - 72.0 * beta) * du
            + h * ((48.0 * beta - 0.25) * state[rows.VELOCITY, i] + (24.0 * beta - 0.25) * v)
            + h * h * (12.0 * beta - 1.0 / 12.0) * state[rows.ACCELERATION, i]
        )
        scratch[momentum.U1, i] = u
        scratch[momentum.V1, i] = v
        link = linear_terms[rows.LINK, i]
        drift = u - link * u_below
        rate = v - link * v_below
        drift_change = du - link * du_below
        q_of_drift = q - link * q_below
        u_below = u
        v_below = v
        du_below = du
        q_below = q
        # The tangent at the end of the step approximates the integral of the force (eq. 46).
        tangent = restoring_force(law_parameters, law_state, i, 0, rows.FIRST_TRIAL, drift)
        scratch[_ROW.TANGENT, i] = tangent
        # The rounding errors of the displacements appear in the drift. u - drift is the
        # displacement of the floor below.
        rounding = ROUNDING / RESIDUAL_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        scratch[momentum.SIZE, i] = rounding * (abs(u) + abs(u - drift))
        is_stale = (
            is_stale
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
            + (tangent + geometric) * q_of_drift
            + damper * drift_change
        )
    return is_stale


@outlined
def _factor(coefficients, linear_terms, modal, h, factors):
    """Assemble and factorize the matrix of Newton's method for the current tangents.

    The unknowns are u1 - u0 and v1 - v0. Equilibrium eliminates a1. The matrix contains these
    derivatives of two terms (eq. 14 for q):

        term           with respect to u1    with respect to v1
        h^2/12 M a1    -h^2/12 k_T           -h^2/12 C
        q              h (1 - 72 beta)       h^2 (24 beta - 1/4)

    The derivative of k_T is omitted. Row TANGENT contains k_T without P-delta.
    """
    scratch = factors.table
    n = linear_terms.shape[1] - 1
    beta = coefficients[BETA]
    by_a = _BY_A * h * h
    for i in range(n):
        # Later iterations compare their tangents with row FACTORED.
        scratch[_ROW.FACTORED, i] = scratch[_ROW.TANGENT, i]
        tangent = scratch[_ROW.TANGENT, i] + linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i]
        # 2 x 2 block of a story: derivatives of the kinematic equation, from the term h^2/12 M a1
        scratch[_ROW.COUPLING, i] = -by_a * tangent
        scratch[_ROW.COUPLING + 1, i] = -by_a * damper
        # Derivatives of the momentum equation, from C (u1 - u0) and from k_T times the derivatives
        # of q
        scratch[_ROW.COUPLING + 2, i] = damper + h * (1.0 - 72.0 * beta) * tangent
        scratch[_ROW.COUPLING + 3, i] = h * h * (24.0 * beta - 0.25) * tangent
    assemble_blocks(linear_terms, factors, _THETA * h, by_a, n)
    # The four numbers are the factors of C: kinematic equation by u1 and v1, momentum equation by
    # u1 and v1.
    factor_blocks(factors, ModalBlocks(modal, 0.0, -by_a, 1.0, 0.0), n)


def _limit(beta: float) -> float:
    """Return the omega h from which an undamped oscillator is unstable; inf for beta = 1/144.

    The amplification matrix has the determinant 1, and the method is unstable if its trace is less
    than -2. With W = omega h, trace + 2 has the sign of the product (W^2 - 12) (12 beta W^2 - 1)
    from W = 0 until the product becomes negative, at its smallest root. For beta <= 0 the second
    factor is negative for any W; for beta = 1/144 (PUBLISHED) both roots are equal.
    """
    if beta == PUBLISHED:
        return math.inf
    roots = [12.0] if beta <= 0.0 else [12.0, 1.0 / (12.0 * beta)]
    return math.sqrt(min(roots))


PUBLISHED = 1.0 / 144.0  # the only value without an unstable band (`_limit`)

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
