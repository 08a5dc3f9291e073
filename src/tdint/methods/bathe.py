"""Composite methods of Bathe: each step of length h consists of two implicit substeps.

The first substep, of length gamma h, uses average acceleration. The second substep uses a formula
over the start, the inner point (suffix g) and the end of the step:

    t0 + gamma h:  vg = v0 + gamma h (a0 + ag) / 2            ug = u0 + gamma h (v0 + vg) / 2
    t0 + h:        v1 = v0 + h (q0 a0 + q1 ag + q2 a1)        u1 = u0 + h (q0 v0 + q1 vg + q2 v1)

Equilibrium is satisfied at the inner point and at the end (Noh and Bathe 2019). For rho_inf = 0,
the coefficients are equal to the coefficients of Bathe and Baig (2005) and Bathe (2007), with the
three-point backward difference q0 = q1 = 1 / (2 (2 - gamma)), q2 = (1 - gamma) / (2 - gamma). With
the default gamma, both substeps have the same matrix, which is factorized one time.

Another method of this type is a function that returns its `ImplicitTableau` (`composite_method`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.equations.newton import (
    EQUILIBRIUM_ROWS,
    ROW,
    DamperStep,
    commit_tangent_damping,
    factor_rows,
    invalidate,
    solve_equilibrium_with_dampers,
)
from tdint.kernels.linear_terms import finite, floor_load
from tdint.kernels.stepping import EffectiveCoefficients, step_kernel
from tdint.kernels.stories.law_state import (
    accumulate_dissipation,
    commit,
    restoring_force_outlined,
)
from tdint.methods.method import Family, Method, Parameter


class ImplicitTableau(NamedTuple):
    """Tableau of a composite method with two implicit substeps.

    The first substep is the trapezoidal rule over `inner` h. Over the complete step, the mean
    velocity and the mean acceleration are weighted sums of their values at the start, at the inner
    point and at the end.

    Attributes
    ----------
    inner : float
        Length gamma of the first substep divided by the length h of the step, between 0 and 1.
    by_start, by_inner, by_end : float
        Weights q0, q1 and q2 of the values at the start, at the inner point and at the end. Their
        sum is 1; q2 is positive.
    """

    inner: float
    by_start: float
    by_inner: float
    by_end: float

    @property
    def order(self) -> int:
        """Order of displacement and velocity: 2 if gamma q1 + q2 = 1/2, otherwise 1."""
        mean_time = self.inner * self.by_inner + self.by_end
        return 2 if math.isclose(mean_time, 0.5, rel_tol=1e-12) else 1

    @property
    def rho_inf(self) -> float:
        """Spectral radius at infinite frequency: abs(q1 - q0) / q2.

        In this limit the first substep changes the sign of the displacement, and the weighted sum
        of the accelerations is zero: q0 u0 - q1 u0 + q2 u1 = 0.
        """
        return abs(self.by_inner - self.by_start) / self.by_end

    @property
    def coefficients(self) -> ImplicitTableau:
        """Tableau for `step`, which recognizes equal matrices of both substeps by q2 = gamma / 2:
        if q2 equals gamma / 2 up to rounding, it is set to exactly this value."""
        half_length = self.inner / 2.0
        has_equal_matrices = math.isclose(self.by_end, half_length, rel_tol=1e-14)
        return self._replace(by_end=half_length) if has_equal_matrices else self


AT = ImplicitTableau(0, 1, 2, 3)
"""Indices of the coefficients of the step."""

# First scratch row of the factorization of the first substep; the factorization of the second
# substep follows.
_FACTORS = EQUILIBRIUM_ROWS


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Integrate the equations of motion over one time step of the Bathe method.

    The unknown of a substep is the change of the acceleration of each floor from its first guess.
    The hysteretic laws follow the path from the committed state to the inner point (FIRST_TRIAL)
    and from this state to the end (SECOND_TRIAL).
    """
    linear_terms, _, law_parameters, forces, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    # The matrix of a substep depends only on the weight of the acceleration at its end.
    has_equal_matrices = coefficients[AT.by_end] == 0.5 * coefficients[AT.inner]
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
            fraction = coefficients[AT.inner]
            by_v = 0.5 * fraction * h
            factors = _FACTORS
            previous = rows.COMMITTED
            trial = rows.FIRST_TRIAL
            _guess_inner(by_v, state, scratch, n)
        else:
            fraction = 1.0
            by_v = coefficients[AT.by_end] * h
            factors = second_factors
            previous = rows.FIRST_TRIAL
            trial = rows.SECOND_TRIAL
            _guess_end(coefficients, h, state, scratch, n)
        ground = load[rows.GROUND_0] + fraction * (load[rows.GROUND_1] - load[rows.GROUND_0])
        floor_load(linear_terms, forces, load[rows.TIME] + fraction * h, ground, scratch, ROW.LOAD)
        damper_step = DamperStep(h, 1.0, 0.0, 1.0 / by_v)
        if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
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
        if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
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
    q0 = coefficients[AT.by_start]
    q1 = coefficients[AT.by_inner]
    q2 = coefficients[AT.by_end]
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
    q0, q1, q2 = coefficients[AT.by_start], coefficients[AT.by_inner], coefficients[AT.by_end]
    half_length = 0.5 * coefficients[AT.inner] * h
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
    length = coefficients[AT.inner] * damper_step.h
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


def published_tableau(rho_inf: float, gamma: float) -> ImplicitTableau:
    """Return the tableau of Noh and Bathe (2019) for a spectral radius `rho_inf` at infinite
    frequency."""
    q1 = (1.0 + rho_inf) / (4.0 - 2.0 * gamma * (1.0 - rho_inf))
    return ImplicitTableau(gamma, 0.5 - (1.0 - gamma) * q1, q1, 0.5 - gamma * q1)


FAMILY = Family("bathe", step, lambda modes: _FACTORS + 2 * factor_rows(modes), devices=True)


def composite_method(
    name: str,
    tableau: Callable[..., ImplicitTableau],
    parameters: tuple[Parameter, ...],
    source: str,
) -> Method:
    """Return a method with two implicit substeps, which is defined by its tableau.

    The compiled step, the order and the spectral radius at infinite frequency follow from the
    tableau. The method must be stable for any time step.

    Parameters
    ----------
    name : str
        Name in a method specification.
    tableau : callable
        Parameter values -> `ImplicitTableau`.
    parameters : tuple of Parameter
        Parameters; `tableau` receives their values in this order.
    source : str
        Publication of the method.

    Returns
    -------
    Method
        Entry of the catalogue of methods.
    """
    return Method(
        name=name,
        family=FAMILY,
        parameters=parameters,
        coefficients=lambda *values: tableau(*values).coefficients,
        order=lambda *values: tableau(*values).order,
        rho_inf=lambda *values: tableau(*values).rho_inf,
        source=source,
    )


METHODS = (
    replace(
        composite_method(
            "bathe",
            published_tableau,
            (
                Parameter("rho_inf", 0.0, 0.0, 1.0),
                Parameter(
                    "gamma",
                    gamma_with_equal_matrices,
                    0.0,
                    1.0,
                    low_allowed=False,
                    high_allowed=False,
                ),
            ),
            "Bathe and Baig (2005), Bathe (2007); rho_inf: Noh and Bathe (2019)",
        ),
        rho_inf=lambda rho_inf, gamma: rho_inf,  # without rounding
        tangent_damping=lambda rho_inf, gamma: True,
    ),
)
