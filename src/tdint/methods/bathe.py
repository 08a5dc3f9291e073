"""The composite methods of Bathe: average acceleration to a point inside the step, then a formula
over three points.

    t0 + gamma h:  vg = v0 + gamma h (a0 + ag) / 2            ug = u0 + gamma h (v0 + vg) / 2
    t0 + h:        v1 = v0 + h (q0 a0 + q1 ag + q2 a1)        u1 = u0 + h (q0 v0 + q1 vg + q2 v1)

with equilibrium at both points (Noh and Bathe 2019). For rho_inf = 0 this is, for every gamma, the
method of Bathe and Baig (2005) and Bathe (2007): q0 = q1 = 1 / (2 (2 - gamma)) and q2 = (1 - gamma)
/ (2 - gamma) are its three-point backward difference. The default gamma gives both sub-steps the
same matrix.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, kernel
from tdint.kernels.equations.newton import (
    EQUILIBRIUM_ROWS,
    ROW,
    factor_rows,
    invalidate,
    solve_equilibrium,
)
from tdint.kernels.linear_terms import finite, floor_load
from tdint.kernels.stepping import STEP, EffectiveCoefficients, Memory, Scene
from tdint.kernels.stories.law_state import accumulate_dissipation, commit
from tdint.methods.method import Family, Method, Parameter

# Coefficients
GAMMA = 0
Q0 = 1
Q1 = 2
Q2 = 3

_FACTORS = EQUILIBRIUM_ROWS  # rows of work of the first sub-step, then of the second


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
    """One step: two sub-steps, each in equilibrium at its end."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    n = linear_terms.shape[1] - 1
    # Where both sub-steps weigh alike they share a matrix, which is factored once.
    one_matrix = coefficients[Q2] == 0.5 * coefficients[GAMMA]
    second_factors = _FACTORS if one_matrix else (_FACTORS + scratch.shape[0]) // 2
    if step_status[rows.FACTORED_STEP] != h:
        invalidate(scratch, _FACTORS, n)
        invalidate(scratch, second_factors, n)
        step_status[rows.FACTORED_STEP] = h
    iterations = 0
    for second in range(2):
        if second == 0:
            part = coefficients[GAMMA]
            by_v = 0.5 * part * h
            factors = _FACTORS
            previous = rows.COMMITTED
            trial = rows.FIRST_TRIAL
            _guess_inner(by_v, state, scratch, n)
        else:
            part = 1.0
            by_v = coefficients[Q2] * h
            factors = second_factors
            previous = rows.FIRST_TRIAL
            trial = rows.SECOND_TRIAL
            _guess_end(coefficients, h, state, scratch, n)
        ground = load[rows.GROUND_0] + part * (load[rows.GROUND_1] - load[rows.GROUND_0])
        floor_load(linear_terms, forces, load[rows.TIME] + part * h, ground, scratch, ROW.LOAD)
        code = solve_equilibrium(
            EffectiveCoefficients(by_v * by_v, by_v, 1.0), factors, previous, trial, scene, memory
        )
        if code < 0:
            return code
        iterations += code
    for i in range(n):
        state[rows.DISPLACEMENT, i] = scratch[ROW.U, i]
        state[rows.VELOCITY, i] = scratch[ROW.V, i]
        state[rows.ACCELERATION, i] = scratch[ROW.A, i]
        accumulate_dissipation(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        commit(law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
    return iterations if finite(state, n) else rows.NOT_FINITE


@inline
def _guess_inner(half, state, scratch, n):
    """First guess: the acceleration stays over the first sub-step, of length 2 `half`; x is its
    change."""
    for i in range(n):
        v = state[rows.VELOCITY, i] + 2.0 * half * state[rows.ACCELERATION, i]
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + half * (state[rows.VELOCITY, i] + v)
        scratch[ROW.V, i] = v
        scratch[ROW.A, i] = state[rows.ACCELERATION, i]


@inline
def _guess_end(coefficients, h, state, scratch, n):
    """First guess: the acceleration of the inner point, left in work, stays over the second
    sub-step."""
    q0 = coefficients[Q0]
    q1 = coefficients[Q1]
    q2 = coefficients[Q2]
    for i in range(n):
        v = state[rows.VELOCITY, i] + h * (
            q0 * state[rows.ACCELERATION, i] + (q1 + q2) * scratch[ROW.A, i]
        )
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + h * (
            q0 * state[rows.VELOCITY, i] + q1 * scratch[ROW.V, i] + q2 * v
        )
        scratch[ROW.V, i] = v


def gamma_of_one_matrix(rho_inf: float) -> float:
    """The gamma for which both sub-steps have the same matrix, (2 - sqrt(2 + 2 r)) / (1 - r),
    without its 0 / 0."""
    return 2.0 / (2.0 + math.sqrt(2.0 + 2.0 * rho_inf))


def coefficients(rho_inf: float, gamma: float) -> tuple[float, ...]:
    """Noh and Bathe (2019); q2 is rid of the rounding that would hide from the step that it is
    gamma / 2."""
    q1 = (1.0 + rho_inf) / (4.0 - 2.0 * gamma * (1.0 - rho_inf))
    q0 = 0.5 - (1.0 - gamma) * q1
    q2 = 0.5 - gamma * q1
    return (gamma, q0, q1, gamma / 2.0 if math.isclose(q2, gamma / 2.0, rel_tol=1e-14) else q2)


FAMILY = Family("bathe", step, lambda modes: _FACTORS + 2 * factor_rows(modes))

METHODS = (
    Method(
        name="bathe",
        family=FAMILY,
        parameters=(
            Parameter("rho_inf", 0.0, 0.0, 1.0),
            Parameter(
                "gamma", gamma_of_one_matrix, 0.0, 1.0, low_allowed=False, high_allowed=False
            ),
        ),
        coefficients=coefficients,
        rho_inf=lambda rho_inf, gamma: rho_inf,
        source="Bathe and Baig (2005), Bathe (2007); rho_inf: Noh and Bathe (2019)",
    ),
)
