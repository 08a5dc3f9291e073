"""The third-order diagonally implicit Runge-Kutta method with three stages (Alexander 1977, SIAM J.
Numer. Anal. 14), L-stable, on u' = v, M v' = p - C v - f(u). Its last stage is the end of the step.

    vi = v0 + h sum Aij aj,   ui = u0 + h sum Aij vj,   M ai + C vi + f(ui) = pi

The stages lie one after the other in time, so each takes the drift laws on from the stage before.
"""

import numpy as np

from tdint.plugin import (
    BALANCE_ROWS,
    ROW,
    STEP,
    Family,
    Memory,
    Method,
    Scene,
    Weights,
    at,
    balance,
    commit,
    factor_rows,
    finite,
    floor_load,
    forget,
    kernel,
    settle,
)

G = 0.43586652150845967  # the root of x^3 - 3 x^2 + 3/2 x - 1/6 between 1/6 and 1/2
B1, B2 = -0.25 * (6.0 * G * G - 16.0 * G + 1.0), 0.25 * (6.0 * G * G - 20.0 * G + 5.0)
A = np.array([[G, 0.0, 0.0], [0.5 * (1.0 - G), G, 0.0], [B1, B2, G]])
STAGE_V, STAGE_A = (
    BALANCE_ROWS,
    BALANCE_ROWS + 3,
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
    springs,
    work,
    report,
):
    """One step: three balances with one matrix; the unknown of each is the acceleration of its
    stage."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, springs, work, report)
    n = linear_terms.shape[1] - 1
    by = G * h
    if report[at.FACTORED_STEP] != h:
        forget(work, FACTORS, n)
        report[at.FACTORED_STEP] = h
    iterations = 0
    for stage in range(3):
        # What the stages before it add; the guess of its acceleration is theirs
        part = 0.0
        for earlier in range(stage + 1):
            part += A[stage, earlier]
        for i in range(n):
            u = state[at.DISPLACEMENT, i]
            v = state[at.VELOCITY, i]
            for earlier in range(stage):
                u += h * A[stage, earlier] * work[STAGE_V + earlier, i]
                v += h * A[stage, earlier] * work[STAGE_A + earlier, i]
            a = work[STAGE_A + stage - 1, i] if stage > 0 else 0.0
            work[ROW.A, i] = a
            work[ROW.V, i] = v + by * a
            work[ROW.U, i] = u + by * work[ROW.V, i]
        ground = load[at.GROUND_0] + part * (load[at.GROUND_1] - load[at.GROUND_0])
        floor_load(linear_terms, forces, load[at.TIME] + part * h, ground, work, ROW.LOAD)
        past = stage * at.FIRST_TRIAL  # blocks of springs follow each other
        code = balance(
            Weights(by * by, by, 1.0), FACTORS, past, past + at.FIRST_TRIAL, scene, memory
        )
        if code < 0:
            return code
        iterations += code
        for i in range(n):
            work[STAGE_V + stage, i] = work[ROW.V, i]
            work[STAGE_A + stage, i] = work[ROW.A, i]
    for i in range(n):
        state[at.DISPLACEMENT, i] = work[ROW.U, i]
        state[at.VELOCITY, i] = work[ROW.V, i]
        settle(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL)
        settle(law_parameters, springs, i, at.FIRST_TRIAL, at.SECOND_TRIAL)
        commit(law_parameters, springs, i, at.SECOND_TRIAL, at.THIRD_TRIAL)
    return iterations if finite(state, n) else at.NOT_FINITE


METHODS = (
    Method(
        name="sdirk3",
        family=Family(
            "sdirk",
            step,
            lambda modes: FACTORS + factor_rows(modes),
            memory=(at.DISPLACEMENT, at.VELOCITY),
        ),
        coefficients=lambda: (),
        order=lambda: 3,
        rho_inf=lambda: 0.0,
        source="Alexander (1977), three stages, order 3, L-stable",
    ),
)
