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

from tdint.kernels import layout as at
from tdint.kernels.compiling import inlined, kernel
from tdint.kernels.equations.newton import BALANCE_ROWS, ROW, balance, factor_rows, forget
from tdint.kernels.linear_terms import finite, floor_load
from tdint.kernels.stepping import STEP, Memory, Scene, Weights
from tdint.kernels.stories.law_state import commit, settle
from tdint.methods.method import Family, Method, Parameter

# Coefficients
GAMMA = 0
Q0 = 1
Q1 = 2
Q2 = 3

_FACTORS = BALANCE_ROWS  # rows of work of the first sub-step, then of the second


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
    """One step: two sub-steps, each in equilibrium at its end."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, springs, work, report)
    n = linear_terms.shape[1] - 1
    # Where both sub-steps weigh alike they share a matrix, which is factored once.
    one_matrix = coefficients[Q2] == 0.5 * coefficients[GAMMA]
    second_factors = _FACTORS if one_matrix else (_FACTORS + work.shape[0]) // 2
    if report[at.FACTORED_STEP] != h:
        forget(work, _FACTORS, n)
        forget(work, second_factors, n)
        report[at.FACTORED_STEP] = h
    iterations = 0
    for second in range(2):
        if second == 0:
            part = coefficients[GAMMA]
            by_v = 0.5 * part * h
            factors = _FACTORS
            past = at.COMMITTED
            trial = at.FIRST_TRIAL
            _guess_inner(by_v, state, work, n)
        else:
            part = 1.0
            by_v = coefficients[Q2] * h
            factors = second_factors
            past = at.FIRST_TRIAL
            trial = at.SECOND_TRIAL
            _guess_end(coefficients, h, state, work, n)
        ground = load[at.GROUND_0] + part * (load[at.GROUND_1] - load[at.GROUND_0])
        floor_load(linear_terms, forces, load[at.TIME] + part * h, ground, work, ROW.LOAD)
        code = balance(Weights(by_v * by_v, by_v, 1.0), factors, past, trial, scene, memory)
        if code < 0:
            return code
        iterations += code
    for i in range(n):
        state[at.DISPLACEMENT, i] = work[ROW.U, i]
        state[at.VELOCITY, i] = work[ROW.V, i]
        state[at.ACCELERATION, i] = work[ROW.A, i]
        settle(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL)
        commit(law_parameters, springs, i, at.FIRST_TRIAL, at.SECOND_TRIAL)
    return iterations if finite(state, n) else at.NOT_FINITE


@inlined
def _guess_inner(half, state, work, n):
    """First guess: the acceleration stays over the first sub-step, of length 2 `half`; x is its
    change."""
    for i in range(n):
        v = state[at.VELOCITY, i] + 2.0 * half * state[at.ACCELERATION, i]
        work[ROW.U, i] = state[at.DISPLACEMENT, i] + half * (state[at.VELOCITY, i] + v)
        work[ROW.V, i] = v
        work[ROW.A, i] = state[at.ACCELERATION, i]


@inlined
def _guess_end(coefficients, h, state, work, n):
    """First guess: the acceleration of the inner point, left in work, stays over the second
    sub-step."""
    q0 = coefficients[Q0]
    q1 = coefficients[Q1]
    q2 = coefficients[Q2]
    for i in range(n):
        v = state[at.VELOCITY, i] + h * (
            q0 * state[at.ACCELERATION, i] + (q1 + q2) * work[ROW.A, i]
        )
        work[ROW.U, i] = state[at.DISPLACEMENT, i] + h * (
            q0 * state[at.VELOCITY, i] + q1 * work[ROW.V, i] + q2 * v
        )
        work[ROW.V, i] = v


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
