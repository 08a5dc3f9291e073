"""Backward Euler method, of order 1, for u' = v, M v' = p - C v - f(u). Its numerical damping is
strong with any time step, and the energy that it removes is halved with the time step.

    v1 = v0 + h a1,   u1 = u0 + h v1,   M a1 + C v1 + f(u1) = p1
"""

import math

from tdint.plugin import (
    EQUILIBRIUM_ROWS,
    ROW,
    STEP,
    EffectiveCoefficients,
    Family,
    Memory,
    Method,
    Scene,
    commit,
    factor_rows,
    finite,
    floor_load,
    invalidate,
    kernel,
    rows,
    solve_equilibrium,
)

FACTORS = EQUILIBRIUM_ROWS


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
    """Take one step: equilibrium at its end, with the acceleration as unknown."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    n = linear_terms.shape[1] - 1
    if step_status[rows.FACTORED_STEP] != h:
        invalidate(scratch, FACTORS, n)
        step_status[rows.FACTORED_STEP] = h
    for i in range(n):
        scratch[ROW.A, i] = 0.0
        scratch[ROW.V, i] = state[rows.VELOCITY, i]
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + h * state[rows.VELOCITY, i]
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, ROW.LOAD)
    code = solve_equilibrium(
        EffectiveCoefficients(h * h, h, 1.0),
        FACTORS,
        rows.COMMITTED,
        rows.FIRST_TRIAL,
        scene,
        memory,
    )
    if code < 0:
        return code
    for i in range(n):
        state[rows.DISPLACEMENT, i] = scratch[ROW.U, i]
        state[rows.VELOCITY, i] = scratch[ROW.V, i]
        state[rows.ACCELERATION, i] = scratch[ROW.A, i]
        commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
    return code if finite(state, n) else rows.NOT_FINITE


METHODS = (
    Method(
        name="backward-euler",
        family=Family("backward-euler", step, lambda modes: FACTORS + factor_rows(modes)),
        parameters=(),
        coefficients=lambda: (),
        order=lambda: 1,
        rho_inf=lambda: 0.0,
        source="Hairer and Wanner (1996), chapter IV.1",
        stability_limit=lambda: math.inf,
    ),
)
