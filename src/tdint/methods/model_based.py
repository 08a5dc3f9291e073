"""Explicit methods with the initial stiffness K0 in their matrices: one pass per step, whatever the
drift laws.

KR-alpha (Kolay and Ricles 2014), with w for its velocity, X = gamma h C + beta h^2 K0, A = M + X, q
= A^-1 M a and g = p - C w - f(u):

    u1 = u0 + h w0 + (1/2 + gamma) h^2 q0,   w1 = w0 + h q0
    [(1 - alpha_m) M + (1 - alpha_f) X] q1 + (alpha_m M + alpha_f X) q0 = (1 - alpha_f) g1 + alpha_f
    g0

(Published with a for q.) w lags: it is the velocity at t - gamma h, and a start from w0 = v0 makes
u and v order 1. Here v = w + gamma h q is carried and reported instead; the same lines become

    u1 = u0 + h v0 + h^2/2 q0,   v1 = v0 + h ((1 - gamma) q0 + gamma q1)
    (1 - alpha_m) M q1 + alpha_m M q0 = (1 - alpha_f) r1 + alpha_f r0,   r = p - C v - f(u) - beta h^2 K0 q

and are order 2 from any initial state. They are generalized-alpha for the displacement u + beta h^2
q, whose last part is left to K0. CR (Chen and Ricles 2008) is the member alpha_m = alpha_f = 0.
State row ACCELERATION holds q, which starts from M q0 = r0.

Chang (2002) needs no such shift; its acceleration is that of equilibrium at every step.

All are stable for every step in a linear building and where stories soften, but not where one
stiffens above K0.
"""  # noqa: E501

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, kernel
from tdint.kernels.equations.tridiagonal import (
    Combination,
    assemble_combination,
    factor,
    factor_combination,
    solve,
    solve_damped,
)
from tdint.kernels.linear_terms import add_modal_force, finite, floor_load, internal_forces
from tdint.kernels.stepping import STEP, Factors, Memory
from tdint.kernels.stories.law_state import commit, restoring_force
from tdint.methods.method import Family, Method, Parameter

# Coefficients of the KR-alpha step
ALPHA_M = 0
ALPHA_F = 1
BETA = 2
GAMMA = 3


class _StepRows(NamedTuple):
    """Rows of work."""

    LOAD: int = 1
    SUM: int = 1  # story forces
    V: int = 1  # velocity at the weighted point; Chang: predicted
    X: int = 1  # right side and solution
    LOAD_0: int = 1
    PIVOT: int = 1
    COUPLING: int = 1
    SECOND_PIVOT: int = 1  # Chang: of the second matrix, M + h/2 C
    SECOND_COUPLING: int = 1


_ROW, _STORE = rows.chained(_StepRows)


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
    """One step of KR-alpha or CR: one solve with (1 - alpha_m) M + (1 - alpha_f) X for the change
    of q."""
    n = linear_terms.shape[1] - 1
    memory = Memory(state, law_state, scratch, step_status)
    factors = Factors(scratch, _ROW.PIVOT, _ROW.COUPLING, _STORE)
    weight = 1.0 - coefficients[ALPHA_F]
    by_c = coefficients[GAMMA] * h
    by_k = coefficients[BETA] * h * h
    if step_status[rows.STEPS_DONE] == 0.0:
        _start(linear_terms, law_parameters, by_k, state, factors, n)
        step_status[rows.FACTORED_STEP] = 0.0
    if step_status[rows.FACTORED_STEP] != h:
        combination = Combination(1.0 - coefficients[ALPHA_M], weight * by_c, weight * by_k)
        factor_combination(
            linear_terms, modal, law_parameters, rows.STIFFNESS, combination, factors, n
        )
        step_status[rows.FACTORED_STEP] = h
    # The weighted point for q1 = q0: what is out of balance there gives the change of q.
    _weighted_load(linear_terms, forces, weight, h, load, scratch, n)
    _advance(linear_terms, law_parameters, weight, by_k, h, memory)
    for i in range(n):
        inner = scratch[_ROW.SUM, i] - linear_terms[rows.LINK, i + 1] * scratch[_ROW.SUM, i + 1]
        scratch[_ROW.X, i] = (
            scratch[_ROW.LOAD, i]
            - linear_terms[rows.MASS, i] * state[rows.ACCELERATION, i]
            - linear_terms[rows.FLOOR_DAMPER, i] * scratch[_ROW.V, i]
            - inner
        )
    add_modal_force(modal, scratch, _ROW.V, -1.0, scratch, _ROW.X, n)
    solve_damped(factors, modal, _ROW.X, n)
    for i in range(n):
        q = state[rows.ACCELERATION, i]
        state[rows.VELOCITY, i] += h * q + by_c * scratch[_ROW.X, i]
        state[rows.ACCELERATION, i] = q + scratch[_ROW.X, i]
    return 1 if finite(state, n) else rows.NOT_FINITE


@inline
def _start(linear_terms, law_parameters, by_k, state, factors, n):
    """q0 from the acceleration of equilibrium: (M + beta h^2 K0) q0 = M a0."""
    scratch = factors.table
    assemble_combination(
        linear_terms, law_parameters, rows.STIFFNESS, Combination(1.0, 0.0, by_k), factors, n
    )
    factor(factors, n)
    for i in range(n):
        scratch[_ROW.X, i] = linear_terms[rows.MASS, i] * state[rows.ACCELERATION, i]
    solve(factors, _ROW.X, n)
    for i in range(n):
        state[rows.ACCELERATION, i] = scratch[_ROW.X, i]


@inline
def _weighted_load(linear_terms, forces, weight, h, load, scratch, n):
    """Load at the weighted point, N."""
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, _ROW.LOAD)
    if weight != 1.0:
        floor_load(linear_terms, forces, load[rows.TIME], load[rows.GROUND_0], scratch, _ROW.LOAD_0)
        for i in range(n):
            scratch[_ROW.LOAD, i] = (
                weight * scratch[_ROW.LOAD, i] + (1.0 - weight) * scratch[_ROW.LOAD_0, i]
            )


@inline
def _advance(linear_terms, law_parameters, weight, by_k, h, memory):
    """Displacement and drift laws to the end of the step; weighted velocity and story forces for q1
    = q0."""
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    u_below = 0.0
    v_below = 0.0
    q_below = 0.0
    for i in range(n):
        q = state[rows.ACCELERATION, i]
        u = state[rows.DISPLACEMENT, i] + h * state[rows.VELOCITY, i] + 0.5 * h * h * q
        v = state[rows.VELOCITY, i] + weight * h * q
        link = linear_terms[rows.LINK, i]
        geometric = linear_terms[rows.GEOMETRIC, i]
        force_0 = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        restoring_force(law_parameters, law_state, i, 0, rows.FIRST_TRIAL, u - link * u_below)
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
        force_1 = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        scratch[_ROW.SUM, i] = (
            weight * force_1
            + (1.0 - weight) * force_0
            + by_k * (law_parameters[rows.STIFFNESS, i] + geometric) * (q - link * q_below)
            + linear_terms[rows.STORY_DAMPER, i] * (v - link * v_below)
        )
        state[rows.DISPLACEMENT, i] = u
        scratch[_ROW.V, i] = v
        u_below = u
        v_below = v
        q_below = q


@kernel(STEP)
def chang_step(
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
    """One step of Chang (2002): u1 = u0 + h v0 + h^2/2 D^-1 (M a0 - h/2 K0 v0) with D = M + h/2 C +
    h^2/4 K0, which is the published line without the matrix C on its right; then average
    acceleration with equilibrium at u1."""
    n = linear_terms.shape[1] - 1
    half = 0.5 * h
    first = Factors(scratch, _ROW.PIVOT, _ROW.COUPLING, _STORE)
    second = Factors(
        scratch, _ROW.SECOND_PIVOT, _ROW.SECOND_COUPLING, _STORE + 2 * modal.shape[0] + 1
    )
    if step_status[rows.FACTORED_STEP] != h:
        factor_combination(
            linear_terms,
            modal,
            law_parameters,
            rows.STIFFNESS,
            Combination(1.0, half, half * half),
            first,
            n,
        )
        factor_combination(
            linear_terms,
            modal,
            law_parameters,
            rows.STIFFNESS,
            Combination(1.0, half, 0.0),
            second,
            n,
        )
        step_status[rows.FACTORED_STEP] = h
    v_below = 0.0
    for i in range(n):
        v = state[rows.VELOCITY, i]
        scratch[_ROW.SUM, i] = (
            half
            * (law_parameters[rows.STIFFNESS, i] + linear_terms[rows.GEOMETRIC, i])
            * (v - linear_terms[rows.LINK, i] * v_below)
        )
        v_below = v
    for i in range(n):
        inner = scratch[_ROW.SUM, i] - linear_terms[rows.LINK, i + 1] * scratch[_ROW.SUM, i + 1]
        scratch[_ROW.X, i] = linear_terms[rows.MASS, i] * state[rows.ACCELERATION, i] - inner
    # The displacement at the end follows from the start alone.
    solve_damped(first, modal, _ROW.X, n)
    below = 0.0
    for i in range(n):
        v = state[rows.VELOCITY, i]
        u = state[rows.DISPLACEMENT, i] + h * v + half * h * scratch[_ROW.X, i]
        restoring_force(
            law_parameters,
            law_state,
            i,
            0,
            rows.FIRST_TRIAL,
            u - linear_terms[rows.LINK, i] * below,
        )
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
        below = u
        state[rows.DISPLACEMENT, i] = u
        scratch[_ROW.V, i] = v + half * state[rows.ACCELERATION, i]
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, _ROW.LOAD)
    internal_forces(linear_terms, modal, law_state, 0, scratch, _ROW.V, _ROW.X, _ROW.SUM)
    for i in range(n):
        scratch[_ROW.X, i] = scratch[_ROW.LOAD, i] - scratch[_ROW.X, i]
    solve_damped(second, modal, _ROW.X, n)
    for i in range(n):
        state[rows.VELOCITY, i] = scratch[_ROW.V, i] + half * scratch[_ROW.X, i]
        state[rows.ACCELERATION, i] = scratch[_ROW.X, i]
    return 1 if finite(state, n) else rows.NOT_FINITE


FAMILY = Family(
    "model-based",
    step,
    lambda modes: _STORE + 2 * modes + 1,
    halvable=False,
    power_dampers=False,
    limited_by_stiffening=True,
)

CHANG = replace(
    FAMILY,
    step=chang_step,
    scratch_rows=lambda modes: _STORE + 2 * (2 * modes + 1),
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
)


def kr_alpha(rho_inf: float) -> tuple[float, ...]:
    """Kolay and Ricles (2014): alpha_m, alpha_f, beta and gamma of generalized-alpha."""
    alpha_m = (2.0 * rho_inf - 1.0) / (1.0 + rho_inf)
    alpha_f = rho_inf / (1.0 + rho_inf)
    gamma = 0.5 - alpha_m + alpha_f
    return (alpha_m, alpha_f, 0.25 * (0.5 + gamma) ** 2, gamma)


_LIMITED = "explicit; not for stories that stiffen"

METHODS = (
    Method(
        name="chang",
        family=CHANG,
        coefficients=tuple,
        rho_inf=lambda: 1.0,
        source=f"Chang (2002); {_LIMITED}",
        implicit=lambda: False,
    ),
    Method(
        name="cr",
        family=FAMILY,
        coefficients=lambda: (0.0, 0.0, 0.25, 0.5),
        rho_inf=lambda: 1.0,
        source=f"Chen and Ricles (2008); {_LIMITED}",
        implicit=lambda: False,
    ),
    Method(
        name="kr-alpha",
        family=FAMILY,
        coefficients=kr_alpha,
        rho_inf=lambda rho_inf: rho_inf,
        source=f"Kolay and Ricles (2014); {_LIMITED}",
        parameters=(
            Parameter("rho_inf", 0.8, 0.0, 1.0),
        ),  # as generalized-alpha, whose spectrum it has
        implicit=lambda rho_inf: False,
    ),
)
