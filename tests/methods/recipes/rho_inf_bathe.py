"""The rho_inf-Bathe method with both parameters (Noh and Bathe 2019, Computers and Structures 212,
eqs. 1 to 8).

To t + gamma h by average acceleration, then over three points, each in equilibrium at its end:

    v1 = v0 + h (q0 a0 + q1 ag + q2 a1)        u1 = u0 + h (q0 v0 + q1 vg + q2 v1)
"""

from tdint.plugin import (
    EQUILIBRIUM_ROWS,
    ROW,
    STEP,
    EffectiveCoefficients,
    Family,
    Memory,
    Method,
    Parameter,
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

GAMMA, Q0, Q1, Q2 = range(4)  # coefficients
# Rows of scratch of the first substep; rows of the second substep start in the middle of the
# remaining rows
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
    """Perform one step; the unknown of each equilibrium is the acceleration at its end."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    n = linear_terms.shape[1] - 1
    second = (FACTORS + scratch.shape[0]) // 2
    if step_status[rows.FACTORED_STEP] != h:
        invalidate(scratch, FACTORS, n)
        invalidate(scratch, second, n)
        step_status[rows.FACTORED_STEP] = h
    # To the inner point, from a guess of its acceleration: that of the start
    gamma = coefficients[GAMMA]
    half = 0.5 * gamma * h
    for i in range(n):
        v = state[rows.VELOCITY, i]
        a = state[rows.ACCELERATION, i]
        scratch[ROW.A, i] = a
        scratch[ROW.V, i] = v + 2.0 * half * a
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + half * (v + scratch[ROW.V, i])
    ground = load[rows.GROUND_0] + gamma * (load[rows.GROUND_1] - load[rows.GROUND_0])
    floor_load(linear_terms, forces, load[rows.TIME] + gamma * h, ground, scratch, ROW.LOAD)
    first = solve_equilibrium(
        EffectiveCoefficients(half * half, half, 1.0),
        FACTORS,
        rows.COMMITTED,
        rows.FIRST_TRIAL,
        scene,
        memory,
    )
    if first < 0:
        return first
    # To the end, from a guess of its acceleration: that of the inner point
    q0, q1, q2 = coefficients[Q0], coefficients[Q1], coefficients[Q2]
    for i in range(n):
        inner = scratch[ROW.V, i]
        v = state[rows.VELOCITY, i] + h * (
            q0 * state[rows.ACCELERATION, i] + (q1 + q2) * scratch[ROW.A, i]
        )
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + h * (
            q0 * state[rows.VELOCITY, i] + q1 * inner + q2 * v
        )
        scratch[ROW.V, i] = v
    by_v = q2 * h
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, ROW.LOAD)
    last = solve_equilibrium(
        EffectiveCoefficients(by_v * by_v, by_v, 1.0),
        second,
        rows.FIRST_TRIAL,
        rows.SECOND_TRIAL,
        scene,
        memory,
    )
    if last < 0:
        return last
    for i in range(n):
        state[rows.DISPLACEMENT, i] = scratch[ROW.U, i]
        state[rows.VELOCITY, i] = scratch[ROW.V, i]
        state[rows.ACCELERATION, i] = scratch[ROW.A, i]
        accumulate_dissipation(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        commit(law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
    return first + last if finite(state, n) else rows.NOT_FINITE


def coefficients(rho_inf, gamma):
    """Return the coefficients by eqs. 6 to 8 of Noh and Bathe (2019)."""
    q1 = (rho_inf + 1.0) / (2.0 * gamma * (rho_inf - 1.0) + 4.0)
    q2 = 0.5 - gamma * q1
    return gamma, 1.0 - q1 - q2, q1, q2


METHODS = (
    Method(
        name="rho-inf-bathe",
        family=Family("rho-inf-bathe", step, lambda modes: FACTORS + 2 * factor_rows(modes)),
        parameters=(
            Parameter("rho_inf", 0.5, 0.0, 1.0),
            Parameter("gamma", 0.5, 0.0, 1.0, low_allowed=False, high_allowed=False),
        ),
        coefficients=coefficients,
        rho_inf=lambda rho_inf, gamma: rho_inf,
        source="Noh and Bathe (2019), both parameters",
    ),
)
