"""The truly explicit generalized-alpha method (Hulbert and Chung 1996, Computer Methods in Applied
Mechanics and Engineering 137): equilibrium with the damping and the restoring force at the start of
the step, no system to solve.

    (1 - alpha_m) M a1 + alpha_m M a0 = p0 - C v0 - f(u0)
    u1 = u0 + h v0 + h^2 ((1/2 - beta) a0 + beta a1),   v1 = v0 + h ((1 - gamma) a0 + gamma a1)
"""

import math

from tdint.plugin import (
    STEP,
    Family,
    Method,
    Parameter,
    commit,
    finite,
    floor_load,
    internal_forces,
    kernel,
    restoring_force,
    rows,
)

ALPHA, BETA, GAMMA = range(3)  # coefficients
LOAD, V, INNER, SUMS, ROWS = range(5)  # rows of work


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
    """Perform one step. The row ACCELERATION of the state is the acceleration of the method, which
    lags behind that of equilibrium."""
    n = linear_terms.shape[1] - 1
    alpha, beta, gamma = coefficients[ALPHA], coefficients[BETA], coefficients[GAMMA]
    for i in range(n):
        scratch[V, i] = state[rows.VELOCITY, i]
    floor_load(linear_terms, forces, load[rows.TIME], load[rows.GROUND_0], scratch, LOAD)
    internal_forces(linear_terms, modal, law_state, rows.COMMITTED, scratch, V, INNER, SUMS)
    below = 0.0
    for i in range(n):
        a0 = state[rows.ACCELERATION, i]
        balanced = linear_terms[rows.INVERSE_MASS, i] * (scratch[LOAD, i] - scratch[INNER, i])
        a1 = (balanced - alpha * a0) / (1.0 - alpha)
        u = state[rows.DISPLACEMENT, i] + h * (scratch[V, i] + h * ((0.5 - beta) * a0 + beta * a1))
        restoring_force(
            law_parameters,
            law_state,
            i,
            rows.COMMITTED,
            rows.FIRST_TRIAL,
            u - linear_terms[rows.LINK, i] * below,
        )
        commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        state[rows.DISPLACEMENT, i] = below = u
        state[rows.VELOCITY, i] = scratch[V, i] + h * ((1.0 - gamma) * a0 + gamma * a1)
        state[rows.ACCELERATION, i] = a1
    return 1 if finite(state, n) else rows.NOT_FINITE


def coefficients(rho_b):
    """Return the coefficients for a spectral radius at the bifurcation."""
    alpha = (2.0 * rho_b - 1.0) / (1.0 + rho_b)
    return alpha, (5.0 - 3.0 * rho_b) / ((1.0 + rho_b) ** 2 * (2.0 - rho_b)), 1.5 - alpha


def limit(rho_b):
    """Return the largest stable omega h without damping, at which a root of the amplification
    matrix is -1."""
    return math.sqrt(12.0 * (1.0 + rho_b) * (2.0 - rho_b) / (10.0 - 5.0 * rho_b + rho_b**2))


METHODS = (
    Method(
        name="explicit-alpha",
        family=Family("explicit-alpha", step, lambda modes: ROWS),
        parameters=(Parameter("rho_b", 0.8, 0.0, 1.0),),
        coefficients=coefficients,
        implicit=lambda rho_b: False,
        stability_limit=limit,
        rho_inf=lambda rho_b: math.nan,
        source="Hulbert and Chung (1996), explicit in damping and force",
    ),
)
