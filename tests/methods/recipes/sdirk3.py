"""L-stable diagonally implicit Runge-Kutta method of order 3 with three stages (Alexander 1977,
SIAM J. Numer. Anal. 14) for u' = v, M v' = p - C v - f(u). Its last stage is the end of the step.

    vi = v0 + h sum Aij aj,   ui = u0 + h sum Aij vj,   M ai + C vi + f(ui) = pi

The stages are in chronological order, so that each stage continues the laws of the previous stage.
"""

import numpy as np

from tdint.plugin import (
    EQUILIBRIUM_ROWS,
    ROW,
    STEP,
    EffectiveCoefficients,
    Family,
    Memory,
    Method,
    Scene,
    accumulate_dissipation,
    commit,
    factor_rows,
    finite,
    floor_load,
    invalidate,
    kernel,
    rows,
    solve_equilibrium,
)

G = 0.43586652150845967  # the root of x^3 - 3 x^2 + 3/2 x - 1/6 between 1/6 and 1/2
B1, B2 = -0.25 * (6.0 * G * G - 16.0 * G + 1.0), 0.25 * (6.0 * G * G - 20.0 * G + 5.0)
A = np.array([[G, 0.0, 0.0], [0.5 * (1.0 - G), G, 0.0], [B1, B2, G]])
STAGE_V, STAGE_A = (
    EQUILIBRIUM_ROWS,
    EQUILIBRIUM_ROWS + 3,
)  # rows of work: velocities and accelerations of the stages
FACTORS = STAGE_A + 3


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
    """Take one step: three equilibrium equations with the same matrix, with the accelerations of
    the stages as unknowns."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    n = linear_terms.shape[1] - 1
    by = G * h
    if step_status[rows.FACTORED_STEP] != h:
        invalidate(scratch, FACTORS, n)
        step_status[rows.FACTORED_STEP] = h
    iterations = 0
    for stage in range(3):
        # Contributions of the earlier stages, whose accelerations are also the first estimate
        part = 0.0
        for earlier in range(stage + 1):
            part += A[stage, earlier]
        for i in range(n):
            u = state[rows.DISPLACEMENT, i]
            v = state[rows.VELOCITY, i]
            for earlier in range(stage):
                u += h * A[stage, earlier] * scratch[STAGE_V + earlier, i]
                v += h * A[stage, earlier] * scratch[STAGE_A + earlier, i]
            a = scratch[STAGE_A + stage - 1, i] if stage > 0 else 0.0
            scratch[ROW.A, i] = a
            scratch[ROW.V, i] = v + by * a
            scratch[ROW.U, i] = u + by * scratch[ROW.V, i]
        ground = load[rows.GROUND_0] + part * (load[rows.GROUND_1] - load[rows.GROUND_0])
        floor_load(linear_terms, forces, load[rows.TIME] + part * h, ground, scratch, ROW.LOAD)
        previous = stage * rows.FIRST_TRIAL  # blocks of springs follow each other
        code = solve_equilibrium(
            EffectiveCoefficients(by * by, by, 1.0),
            FACTORS,
            previous,
            previous + rows.FIRST_TRIAL,
            scene,
            memory,
        )
        if code < 0:
            return code
        iterations += code
        for i in range(n):
            scratch[STAGE_V + stage, i] = scratch[ROW.V, i]
            scratch[STAGE_A + stage, i] = scratch[ROW.A, i]
    for i in range(n):
        state[rows.DISPLACEMENT, i] = scratch[ROW.U, i]
        state[rows.VELOCITY, i] = scratch[ROW.V, i]
        accumulate_dissipation(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        accumulate_dissipation(law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
        commit(law_parameters, law_state, i, rows.SECOND_TRIAL, rows.THIRD_TRIAL)
    return iterations if finite(state, n) else rows.NOT_FINITE


METHODS = (
    Method(
        name="sdirk3",
        family=Family(
            "sdirk",
            step,
            lambda modes: FACTORS + factor_rows(modes),
            memory=(rows.DISPLACEMENT, rows.VELOCITY),
        ),
        coefficients=lambda: (),
        order=lambda: 3,
        rho_inf=lambda: 0.0,
        source="Alexander (1977), three stages, order 3, L-stable",
    ),
)
