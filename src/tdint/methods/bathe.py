"""Composite methods of Bathe: each step of length h consists of two implicit substeps.

The first substep, of length gamma h, uses average acceleration. The second substep uses a formula
over the start, the inner point (suffix g) and the end of the step:

    t0 + gamma h:  vg = v0 + gamma h (a0 + ag) / 2            ug = u0 + gamma h (v0 + vg) / 2
    t0 + h:        v1 = v0 + h (q0 a0 + q1 ag + q2 a1)        u1 = u0 + h (q0 v0 + q1 vg + q2 v1)

Equilibrium is satisfied at the inner point and at the end (Noh and Bathe 2019). For rho_inf = 0,
the coefficients are those of Bathe and Baig (2005) and Bathe (2007), with the three-point backward
difference q0 = q1 = 1 / (2 (2 - gamma)), q2 = (1 - gamma) / (2 - gamma). With the default gamma,
both substeps have the same matrix, which is factorized once.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, kernel, outlined
from tdint.kernels.equations.newton import (
    EQUILIBRIUM_ROWS,
    ROW,
    DamperStep,
    commit_tangent_damping,
    factor_rows,
    invalidate,
    solve_equilibrium_with_dampers,
)
from tdint.kernels.linear_terms import TANGENT_DAMPING, finite, floor_load
from tdint.kernels.stepping import STEP, EffectiveCoefficients, Memory, Scene
from tdint.kernels.stories.law_state import (
    accumulate_dissipation,
    commit,
    restoring_force_outlined,
)
from tdint.methods.method import Family, Method, Parameter

# Indices of the coefficients of the step, the results of `coefficients`
GAMMA = 0
Q0 = 1
Q1 = 2
Q2 = 3

# First scratch row of the factorization of the first substep; the factorization of the second
# substep follows.
_FACTORS = EQUILIBRIUM_ROWS


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
    """Integrate the equations of motion over one time step of the Bathe method.

    The unknown of a substep is the change of the acceleration of each floor from its first guess.
    The hysteretic laws follow the path from the committed state to the inner point (FIRST_TRIAL)
    and from this state to the end (SECOND_TRIAL).
    """
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    n = linear_terms.shape[1] - 1
    # The matrix of a substep depends only on the weight of the acceleration at its end.
    has_equal_matrices = coefficients[Q2] == 0.5 * coefficients[GAMMA]
    # Otherwise, the rows after _FACTORS contain two factorizations of equal size.
    second_factors = _FACTORS if has_equal_matrices else (_FACTORS + scratch.shape[0]) // 2
    if step_status[rows.FACTORED_STEP] != h:
        invalidate(scratch, _FACTORS, n)
        invalidate(scratch, second_factors, n)
        step_status[rows.FACTORED_STEP] = h
    iterations = 0
    for substep in range(2):
        if substep == 0:
            # Time of equilibrium as a fraction of the step, and change of the velocity for a unit
            # change of the acceleration, s
            fraction = coefficients[GAMMA]
            by_v = 0.5 * fraction * h
            factors = _FACTORS
            previous = rows.COMMITTED
            trial = rows.FIRST_TRIAL
            _guess_inner(by_v, state, scratch, n)
        else:
            fraction = 1.0
            by_v = coefficients[Q2] * h
            factors = second_factors
            previous = rows.FIRST_TRIAL
            trial = rows.SECOND_TRIAL
            _guess_end(coefficients, h, state, scratch, n)
        ground = load[rows.GROUND_0] + fraction * (load[rows.GROUND_1] - load[rows.GROUND_0])
        floor_load(linear_terms, forces, load[rows.TIME] + fraction * h, ground, scratch, ROW.LOAD)
        damper_step = DamperStep(h, 1.0, 0.0, 1.0 / by_v)
        if TANGENT_DAMPING and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
            _predict_tangent_damping(coefficients, substep, h, linear_terms, memory)
        code = solve_equilibrium_with_dampers(
            damper_step,
            EffectiveCoefficients(by_v * by_v, by_v, 1.0),
            factors,
            previous,
            trial,
            scene,
            memory,
        )
        if code < 0:
            return code  # NOT_CONVERGED
        iterations += code
    # The energy is dissipated on both parts of the path.
    for i in range(n):
        state[rows.DISPLACEMENT, i] = scratch[ROW.U, i]
        state[rows.VELOCITY, i] = scratch[ROW.V, i]
        state[rows.ACCELERATION, i] = scratch[ROW.A, i]
        accumulate_dissipation(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        if TANGENT_DAMPING and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
            _commit_with_tangent_damping(coefficients, damper_step, i, scene, memory)
        else:
            commit(law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
    return iterations if finite(state, n) else rows.NOT_FINITE


@inline
def _guess_inner(half_length, state, scratch, n):
    """Store the first guess of the first substep: a constant acceleration a0."""
    for i in range(n):
        v = state[rows.VELOCITY, i] + 2.0 * half_length * state[rows.ACCELERATION, i]
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + half_length * (
            state[rows.VELOCITY, i] + v
        )
        scratch[ROW.V, i] = v
        scratch[ROW.A, i] = state[rows.ACCELERATION, i]


@inline
def _guess_end(coefficients, h, state, scratch, n):
    """Store the first guess at the end of the second substep: the acceleration at the inner
    point.
    """
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


@outlined
def _predict_tangent_damping(coefficients, substep, h, linear_terms, memory):
    """Store the part of the forces of tangent damping at the end of a substep that is known (row
    DAMPING_BASE, N).

    The forces D of the damping satisfy the formulas of the velocities, with the forces f of the
    law: a1 fg = a1 f0 + gamma h (D0 + Dg) / 2 and a1 f1 = a1 f0 + h (q0 D0 + q1 Dg + q2 D1). The
    impulse a1 (f1 - f0) of the step is therefore exact. With D = a1 k v, the order would be 1 if a
    law changes its stiffness.
    """
    scratch = memory.scratch
    q0, q1, q2 = coefficients[Q0], coefficients[Q1], coefficients[Q2]
    half_length = 0.5 * coefficients[GAMMA] * h
    for i in range(linear_terms.shape[1] - 1):
        coefficient = linear_terms[rows.TANGENT_DAMPING, i]
        force_0 = memory.state[rows.DAMPING_STATE, i]
        impulse_0 = coefficient * memory.law_state[rows.FORCE, i]
        if substep == 0:
            scratch[ROW.DAMPING_BASE, i] = -force_0 - impulse_0 / half_length
        else:
            inner_impulse = coefficient * memory.law_state[rows.FIRST_TRIAL + rows.FORCE, i]
            inner_force = scratch[ROW.DAMPING_BASE, i] + inner_impulse / half_length
            known = q0 * force_0 + q1 * inner_force + impulse_0 / h
            scratch[ROW.DAMPING_BASE, i] = -known / q2


@outlined
def _commit_with_tangent_damping(coefficients, damper_step, i, scene, memory):
    """Commit the law of story `i`, and its tangent damping with the work of both substeps."""
    law_parameters, law_state = scene.law_parameters, memory.law_state
    first, second = rows.FIRST_TRIAL, rows.SECOND_TRIAL
    # The law is evaluated again, because its tangent has not been stored.
    slope = restoring_force_outlined(
        law_parameters, law_state, i, first, second, law_state[second + rows.DRIFT, i]
    )
    length = coefficients[GAMMA] * damper_step.h
    inner_force, inner_drift = law_state[first + rows.FORCE, i], law_state[first + rows.DRIFT, i]
    work = (inner_force - law_state[rows.FORCE, i]) * (inner_drift - law_state[rows.DRIFT, i])
    work /= length
    commit(law_parameters, law_state, i, first, second)
    change = (law_state[rows.FORCE, i] - inner_force) * (law_state[rows.DRIFT, i] - inner_drift)
    work += change / (damper_step.h - length)
    commit_tangent_damping(damper_step, 1.0, work, slope, i, scene.linear_terms, memory)


def gamma_with_equal_matrices(rho_inf: float) -> float:
    """Return the length gamma of the first substep, as a fraction of the step, for which both
    substeps have the same matrix.

    It is (2 - sqrt(2 + 2 rho_inf)) / (1 - rho_inf), with the spectral radius `rho_inf` at infinite
    frequency, written without the division 0 / 0 for rho_inf = 1.
    """
    return 2.0 / (2.0 + math.sqrt(2.0 + 2.0 * rho_inf))


def coefficients(rho_inf: float, gamma: float) -> tuple[float, ...]:
    """Return the coefficients gamma, q0, q1 and q2 of Noh and Bathe (2019) for a spectral radius
    `rho_inf` at infinite frequency.

    `step` compares q2 with gamma / 2 to recognize that both substeps have the same matrix. If q2
    equals gamma / 2 up to rounding, it is therefore set to exactly this value.
    """
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
                "gamma", gamma_with_equal_matrices, 0.0, 1.0, low_allowed=False, high_allowed=False
            ),
        ),
        coefficients=coefficients,
        rho_inf=lambda rho_inf, gamma: rho_inf,
        source="Bathe and Baig (2005), Bathe (2007); rho_inf: Noh and Bathe (2019)",
        tangent_damping=lambda rho_inf, gamma: True,
    ),
)
