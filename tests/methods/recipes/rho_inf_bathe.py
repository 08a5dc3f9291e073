"""The rho_inf-Bathe method with both parameters (Noh and Bathe 2019, Computers and Structures 212,
eqs. 1 to 8).

To t + gamma h by average acceleration, then over three points, each in equilibrium at its end:

    v1 = v0 + h (q0 a0 + q1 ag + q2 a1)        u1 = u0 + h (q0 v0 + q1 vg + q2 v1)
"""

from tdint.plugin import (
    BALANCE_ROWS,
    ROW,
    STEP,
    Family,
    Memory,
    Method,
    Parameter,
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

GAMMA, Q0, Q1, Q2 = range(4)  # coefficients
# rows of work: of the first part; those of the second begin in the middle of what is left
FACTORS = BALANCE_ROWS


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
    """One step; the unknown of each balance is the acceleration at its end."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, springs, work, report)
    n = linear_terms.shape[1] - 1
    second = (FACTORS + work.shape[0]) // 2
    if report[at.FACTORED_STEP] != h:
        forget(work, FACTORS, n)
        forget(work, second, n)
        report[at.FACTORED_STEP] = h
    # To the inner point, from a guess of its acceleration: that of the start
    gamma = coefficients[GAMMA]
    half = 0.5 * gamma * h
    for i in range(n):
        v = state[at.VELOCITY, i]
        a = state[at.ACCELERATION, i]
        work[ROW.A, i] = a
        work[ROW.V, i] = v + 2.0 * half * a
        work[ROW.U, i] = state[at.DISPLACEMENT, i] + half * (v + work[ROW.V, i])
    ground = load[at.GROUND_0] + gamma * (load[at.GROUND_1] - load[at.GROUND_0])
    floor_load(linear_terms, forces, load[at.TIME] + gamma * h, ground, work, ROW.LOAD)
    first = balance(
        Weights(half * half, half, 1.0), FACTORS, at.COMMITTED, at.FIRST_TRIAL, scene, memory
    )
    if first < 0:
        return first
    # To the end, from a guess of its acceleration: that of the inner point
    q0, q1, q2 = coefficients[Q0], coefficients[Q1], coefficients[Q2]
    for i in range(n):
        inner = work[ROW.V, i]
        v = state[at.VELOCITY, i] + h * (
            q0 * state[at.ACCELERATION, i] + (q1 + q2) * work[ROW.A, i]
        )
        work[ROW.U, i] = state[at.DISPLACEMENT, i] + h * (
            q0 * state[at.VELOCITY, i] + q1 * inner + q2 * v
        )
        work[ROW.V, i] = v
    by_v = q2 * h
    floor_load(linear_terms, forces, load[at.TIME] + h, load[at.GROUND_1], work, ROW.LOAD)
    last = balance(
        Weights(by_v * by_v, by_v, 1.0), second, at.FIRST_TRIAL, at.SECOND_TRIAL, scene, memory
    )
    if last < 0:
        return last
    for i in range(n):
        state[at.DISPLACEMENT, i] = work[ROW.U, i]
        state[at.VELOCITY, i] = work[ROW.V, i]
        state[at.ACCELERATION, i] = work[ROW.A, i]
        settle(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL)
        commit(law_parameters, springs, i, at.FIRST_TRIAL, at.SECOND_TRIAL)
    return first + last if finite(state, n) else at.NOT_FINITE


def coefficients(rho_inf, gamma):
    """Noh and Bathe (2019), eqs. 6 to 8."""
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
