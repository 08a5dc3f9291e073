"""Model-based explicit methods KR-alpha, CR and Chang: no iteration for nonlinear hysteretic laws.

The matrices of these methods contain the initial stiffness K0. The restoring forces f(u) are
evaluated once per step.

KR-alpha (Kolay and Ricles 2014), with its velocity w, X = gamma h C + beta h^2 K0, A = M + X,
q = A^-1 M a and g = p - C w - f(u):

    u1 = u0 + h w0 + (1/2 + gamma) h^2 q0,   w1 = w0 + h q0
    [(1 - alpha_m) M + (1 - alpha_f) X] q1 + (alpha_m M + alpha_f X) q0
        = (1 - alpha_f) g1 + alpha_f g0

The publication uses a instead of q. The velocity w lags behind: it approximates the velocity at
t - gamma h. With the initial value w0 = v0, displacements and velocities have order 1 only. Here
v = w + gamma h q is used and reported instead. The same equations become

    u1 = u0 + h v0 + h^2/2 q0,   v1 = v0 + h ((1 - gamma) q0 + gamma q1)
    (1 - alpha_m) M q1 + alpha_m M q0 = (1 - alpha_f) r1 + alpha_f r0,   r = p - C v - f(u) - beta h^2 K0 q

which have order 2 for any initial state. They are the generalized-alpha method for the displacement
u + beta h^2 q, where the force due to the second term is computed with the initial stiffness K0. CR
(Chen and Ricles 2008) is the special case alpha_m = alpha_f = 0. Row ACCELERATION of the state
contains q, which is initialized from M q0 = r0.

The method of Chang (2002) needs no such modification. Its acceleration is the acceleration from
equilibrium at each step.

All methods are stable for any step in linear buildings and with softening stories, but not if a
story becomes stiffer than its initial stiffness.
"""  # noqa: E501

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline
from tdint.kernels.equations.tridiagonal import (
    Combination,
    assemble_combination,
    factor,
    factor_combination,
    solve,
    solve_damped,
)
from tdint.kernels.linear_terms import add_modal_force, finite, floor_load, internal_forces
from tdint.kernels.stepping import Factors, step_kernel
from tdint.kernels.stories.law_state import commit, restoring_force
from tdint.methods.method import Family, Method, Parameter

# Indices of the coefficients of KR-alpha
ALPHA_M = 0
ALPHA_F = 1
BETA = 2
GAMMA = 3


class _StepRows(NamedTuple):
    """Number of scratch rows for each quantity; the columns are floors or stories."""

    LOAD: int = 1  # load at the weighted point; Chang: at the end of the step, N
    SUM: int = 1  # story forces including P-delta and dampers, N
    V: int = 1  # velocity at the weighted point; Chang: predicted velocity, m/s
    X: int = 1  # right side, then solution of the linear system
    LOAD_0: int = 1  # load at the start of the step, N
    PIVOT: int = 1  # factorization of the matrix: inverse pivots, then multipliers
    COUPLING: int = 1
    SECOND_PIVOT: int = 1  # Chang: factorization of the second matrix, M + h/2 C
    SECOND_COUPLING: int = 1


_ROW, _STORE = rows.chained(_StepRows)


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Integrate the equations of motion over one time step of KR-alpha or CR; the result is 1
    iteration.

    The change q1 - q0 follows from a linear system with the matrix (1 - alpha_m) M + (1 - alpha_f)
    (gamma h C + beta h^2 K0). Its right side is the residual for q1 = q0. Loads, forces and
    velocities in this residual are weighted means of start and end with the weights alpha_f and 1 -
    alpha_f: values at the weighted point. Row ACCELERATION of the state contains q.
    """
    linear_terms, modal, law_parameters, forces, _ = scene
    state, _, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    factors = Factors(scratch, _ROW.PIVOT, _ROW.COUPLING, _STORE, linear_terms)
    end_weight = 1.0 - coefficients[ALPHA_F]
    by_c = coefficients[GAMMA] * h  # factor of C in the matrix, s
    by_k = coefficients[BETA] * h * h  # factor of K0 in the matrix, s^2
    if step_status[rows.STEPS_DONE] == 0.0:  # first step of a run
        _initialize_q(linear_terms, law_parameters, by_k, state, factors, n)
        step_status[rows.FACTORED_STEP] = 0.0
    if step_status[rows.FACTORED_STEP] != h:
        combination = Combination(1.0 - coefficients[ALPHA_M], end_weight * by_c, end_weight * by_k)
        factor_combination(
            linear_terms, modal, law_parameters, rows.STIFFNESS, combination, factors, n
        )
        step_status[rows.FACTORED_STEP] = h
    _weighted_load(linear_terms, forces, end_weight, h, load, scratch, n)
    _advance_displacements(linear_terms, law_parameters, end_weight, by_k, h, memory)
    for i in range(n):
        floor_force = (
            scratch[_ROW.SUM, i] - linear_terms[rows.LINK, i + 1] * scratch[_ROW.SUM, i + 1]
        )
        scratch[_ROW.X, i] = (
            scratch[_ROW.LOAD, i]
            - linear_terms[rows.MASS, i] * state[rows.ACCELERATION, i]
            - linear_terms[rows.FLOOR_DAMPER, i] * scratch[_ROW.V, i]
            - floor_force
        )
    add_modal_force(modal, scratch, _ROW.V, -1.0, scratch, _ROW.X, n)
    solve_damped(factors, modal, _ROW.X, n)
    # Row X now contains q1 - q0.
    for i in range(n):
        q = state[rows.ACCELERATION, i]
        state[rows.VELOCITY, i] += h * q + by_c * scratch[_ROW.X, i]
        state[rows.ACCELERATION, i] = q + scratch[_ROW.X, i]
    return 1 if finite(state, n) else rows.NOT_FINITE


@inline
def _initialize_q(linear_terms, law_parameters, by_k, state, factors, n):
    """Replace the initial acceleration a0 in the state by q0, from (M + beta h^2 K0) q0 = M a0
    (`by_k` is beta h^2).

    This is the difference of M q0 = r0 and of equilibrium. The factorization is overwritten.
    """
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
def _weighted_load(linear_terms, forces, end_weight, h, load, scratch, n):
    """Store the load at the weighted point of the step in row LOAD, N: (1 - alpha_f) p1 + alpha_f
    p0, with `end_weight` = 1 - alpha_f.
    """
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, _ROW.LOAD)
    if end_weight != 1.0:
        floor_load(linear_terms, forces, load[rows.TIME], load[rows.GROUND_0], scratch, _ROW.LOAD_0)
        for i in range(n):
            scratch[_ROW.LOAD, i] = (
                end_weight * scratch[_ROW.LOAD, i] + (1.0 - end_weight) * scratch[_ROW.LOAD_0, i]
            )


@inline
def _advance_displacements(linear_terms, law_parameters, end_weight, by_k, h, memory):
    """Move displacements and laws to the end of the step, and compute two parts of the residual for
    q1 = q0: velocities at the weighted point and story forces.

    With q1 = q0, the velocity at the end is v1 = v0 + h q0, and the weighted mean of beta h^2 K0 q
    is beta h^2 K0 q0. `step` adds the load, the inertia, and the forces of floor dampers and modal
    damping.

        row V, for each floor      v = (1 - alpha_f) v1 + alpha_f v0 = v0 + (1 - alpha_f) h q0
        row SUM, for each story    (1 - alpha_f) f1 + alpha_f f0 + beta h^2 k0 dq + c dv

    f0, f1 and k0 include P-delta; dq and dv are the differences of q0 and v between the floors
    above and below the story.
    """
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    u_below = 0.0
    v_below = 0.0
    q_below = 0.0
    for i in range(n):
        q = state[rows.ACCELERATION, i]
        u = state[rows.DISPLACEMENT, i] + h * state[rows.VELOCITY, i] + 0.5 * h * h * q
        v = state[rows.VELOCITY, i] + end_weight * h * q
        link = linear_terms[rows.LINK, i]
        geometric = linear_terms[rows.GEOMETRIC, i]
        force_0 = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        restoring_force(law_parameters, law_state, i, 0, rows.FIRST_TRIAL, u - link * u_below)
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
        force_1 = law_state[rows.FORCE, i] + geometric * law_state[rows.DRIFT, i]
        scratch[_ROW.SUM, i] = (
            end_weight * force_1
            + (1.0 - end_weight) * force_0
            + by_k * (law_parameters[rows.STIFFNESS, i] + geometric) * (q - link * q_below)
            + linear_terms[rows.STORY_DAMPER, i] * (v - link * v_below)
        )
        state[rows.DISPLACEMENT, i] = u
        scratch[_ROW.V, i] = v
        u_below = u
        v_below = v
        q_below = q


@step_kernel
def chang_step(coefficients, scene, h, load, memory):
    """Integrate the equations of motion over one time step of the method of Chang (2002); the
    result is 1 iteration.

    The displacement at the end depends only on the start of the step:

        u1 = u0 + h v0 + h^2/2 D^-1 (M a0 - h/2 K0 v0),   D = M + h/2 C + h^2/4 K0

    This is the published equation, rearranged so that C does not occur on the right side. Velocity
    and acceleration then follow from equilibrium at u1 with average acceleration,

        (M + h/2 C) a1 = p1 - C (v0 + h/2 a0) - f(u1),   v1 = v0 + h/2 (a0 + a1)

    K0 and f(u1) include P-delta.
    """
    linear_terms, modal, law_parameters, forces, _ = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    half_h = 0.5 * h
    displacement_factors = Factors(scratch, _ROW.PIVOT, _ROW.COUPLING, _STORE, linear_terms)
    # For modal damping, each factorization needs two rows per damped mode and a temporary row.
    store = _STORE + 2 * modal.shape[0] + 1
    acceleration_factors = Factors(
        scratch, _ROW.SECOND_PIVOT, _ROW.SECOND_COUPLING, store, linear_terms
    )
    # Both factorizations remain valid while h is the same.
    if step_status[rows.FACTORED_STEP] != h:
        factorizations = displacement_factors, acceleration_factors
        _factor_chang(linear_terms, modal, law_parameters, half_h, factorizations, n)
        step_status[rows.FACTORED_STEP] = h
    _displacement_right_side(linear_terms, law_parameters, half_h, state, scratch, n)
    solve_damped(displacement_factors, modal, _ROW.X, n)
    u_below = 0.0
    for i in range(n):
        v = state[rows.VELOCITY, i]
        u = state[rows.DISPLACEMENT, i] + h * v + half_h * h * scratch[_ROW.X, i]
        restoring_force(
            law_parameters,
            law_state,
            i,
            0,
            rows.FIRST_TRIAL,
            u - linear_terms[rows.LINK, i] * u_below,
        )
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
        u_below = u
        state[rows.DISPLACEMENT, i] = u
        scratch[_ROW.V, i] = v + half_h * state[rows.ACCELERATION, i]
    # Row X first receives the internal forces, then the right side, then a1.
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, _ROW.LOAD)
    internal_forces(linear_terms, modal, law_state, 0, scratch, _ROW.V, _ROW.X, _ROW.SUM)
    for i in range(n):
        scratch[_ROW.X, i] = scratch[_ROW.LOAD, i] - scratch[_ROW.X, i]
    solve_damped(acceleration_factors, modal, _ROW.X, n)
    for i in range(n):
        state[rows.VELOCITY, i] = scratch[_ROW.V, i] + half_h * scratch[_ROW.X, i]
        state[rows.ACCELERATION, i] = scratch[_ROW.X, i]
    return 1 if finite(state, n) else rows.NOT_FINITE


@inline
def _displacement_right_side(linear_terms, law_parameters, half_h, state, scratch, n):
    """Store the right side M a0 - h/2 K0 v0 of Chang's equation for the displacement in row X, N.

    The forces h/2 k0 (drift rate) of the stories are stored in row SUM.
    """
    v_below = 0.0
    for i in range(n):
        v = state[rows.VELOCITY, i]
        scratch[_ROW.SUM, i] = (
            half_h
            * (law_parameters[rows.STIFFNESS, i] + linear_terms[rows.GEOMETRIC, i])
            * (v - linear_terms[rows.LINK, i] * v_below)
        )
        v_below = v
    # The last column of row SUM always contains 0.
    for i in range(n):
        floor_force = (
            scratch[_ROW.SUM, i] - linear_terms[rows.LINK, i + 1] * scratch[_ROW.SUM, i + 1]
        )
        scratch[_ROW.X, i] = linear_terms[rows.MASS, i] * state[rows.ACCELERATION, i] - floor_force


@inline
def _factor_chang(linear_terms, modal, law_parameters, half_h, factorizations, n):
    """Factorize the two matrices of Chang's method, D = M + h/2 C + h^2/4 K0 and M + h/2 C."""
    displacement_factors, acceleration_factors = factorizations
    factor_combination(
        linear_terms,
        modal,
        law_parameters,
        rows.STIFFNESS,
        Combination(1.0, half_h, half_h * half_h),
        displacement_factors,
        n,
    )
    factor_combination(
        linear_terms,
        modal,
        law_parameters,
        rows.STIFFNESS,
        Combination(1.0, half_h, 0.0),
        acceleration_factors,
        n,
    )


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
    """Return the coefficients alpha_m, alpha_f, beta and gamma of KR-alpha (Kolay and Ricles 2014).

    They are the coefficients of the generalized-alpha method with the spectral radius `rho_inf` at
    infinite frequency. The inertial force is evaluated at the fraction alpha_m of the step before
    its end, all other forces at the fraction alpha_f before its end. beta and gamma are the
    parameters of Newmark's formulas.
    """
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
        # This is the default of generalized-alpha, which has the same eigenvalues.
        parameters=(Parameter("rho_inf", 0.8, 0.0, 1.0),),
        implicit=lambda rho_inf: False,
    ),
)
