"""Equilibrium of all floors at one time, by Newton's method.

The module is used by the families with a response at that time that is linear in a single unknown x
for each floor, an acceleration:

    u = U + by_u x,   v = V + by_v x,   a = A + by_a x,   M a + C v + f(u) = p

U, V and A are the first guess. The corrections are solutions of tridiagonal systems. The
factorization is reused in the next step and is recomputed only if a tangent has changed. At kinks
of the laws, large steps can make the iteration cycle. In this case corrections are halved until the
residual decreases (see `tdint.kernels.equations.iteration`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.equations.iteration import (
    MAX_ITERATIONS,
    RESIDUAL_TOLERANCE,
    ROUNDING,
    TANGENT_TOLERANCE,
    UNDAMPED_ITERATIONS,
    copy_rows,
    is_balanced,
    must_halve,
    squared_norm,
)
from tdint.kernels.equations.tridiagonal import Combination, factor_combination, solve_damped
from tdint.kernels.linear_terms import (
    above,
    add_inertance,
    add_modal_force,
    base_of,
    below,
    power_damper,
    size_above,
    story_value,
)
from tdint.kernels.stepping import Factors
from tdint.kernels.stories import path
from tdint.kernels.stories.brace import BRACE_RESULT_ROWS, follow_brace_at_midpoint
from tdint.kernels.stories.law_state import restoring_force, restoring_force_outlined


class _Rows(NamedTuple):
    """Number of scratch rows for each quantity; the columns are floors or stories.

    The caller stores LOAD and the first guess in U, V and A; these rows then receive the solution.
    """

    LOAD: int = 1  # load p at the time of equilibrium, N
    U: int = 1  # displacement, m
    V: int = 1  # velocity, m/s
    A: int = 1  # acceleration, m/s^2
    X: int = 1  # unknown x, an acceleration, m/s^2
    SUM: int = 1  # story forces, N
    RESIDUAL: int = 1  # residual, N, then the correction of x
    TANGENT: int = 1  # tangent stiffness including that of a power-law dashpot, N/m
    # Scale of the residual, N: absolute story force + (force that corresponds to the rounding
    # errors of the displacements) / RESIDUAL_TOLERANCE
    SIZE: int = 1
    CORRECTION: int = 1  # last correction of x, which the line search may halve, m/s^2
    # Change of the displacement over the complete step for x = 0, m; used with braces and tangent
    # damping only
    RISE: int = 1
    BRACE: int = BRACE_RESULT_ROWS  # results of `follow_brace_at_midpoint`
    DAMPING_BASE: int = 1  # part of the force of tangent damping that does not depend on x, N


class DamperStep(NamedTuple):
    """Step of the dampers whose forces depend on the response over the complete step.

    For dampers with braces, equilibrium contains F0 + weight (F1 - F0) with their forces at the
    start (0) and at the end (1) of the step. For Rayleigh damping with the tangent stiffness, it
    contains B + by_force a1 f1 with the force f1 of the law at the end of the step, the coefficient
    a1 (s) of the story and a part B that does not depend on x (row DAMPING_BASE).

    Attributes
    ----------
    weight : float
        Position of equilibrium within the step, from 0 to 1.
    by_rise : float
        Change of the displacement over the step for a unit change of x, s^2.
    by_force : float
        Factor of a1 f1, 1/s.
    """

    h: float
    weight: float
    by_rise: float
    by_force: float


_NO_DAMPERS = DamperStep(0.0, 0.0, 0.0, 0.0)


class _Factors(NamedTuple):
    """Number of scratch rows for each part of a factorization."""

    FACTORED: int = 1  # tangents for which the matrix was factorized, N/m
    PIVOT: int = 1  # inverse pivots of the factorization
    COUPLING: int = 1  # multipliers of the factorization, entries of L


ROW, EQUILIBRIUM_ROWS = rows.chained(_Rows)
_FACTOR, _STORE = rows.chained(_Factors)


def factor_rows(modes: int) -> int:
    """Return the number of scratch rows of a factorization for `modes` modally damped modes.

    The rows of `_Factors` are followed by 2 rows for each mode and a temporary row (terms of the
    Woodbury formula of `factor_damped`).

    Parameters
    ----------
    modes : int
        Number of modes with modal damping.
    """
    return _STORE + 2 * modes + 1


@inline
def invalidate(scratch, factors, n):
    """Mark a factorization in the scratch array as invalid: its tangents are set to infinity.

    Parameters
    ----------
    scratch : ndarray
        Scratch array.
    factors : int
        First row of the factorization.
    n : int
        Number of floors.
    """
    for i in range(n):
        scratch[factors + _FACTOR.FACTORED, i] = math.inf


@inline
def solve_equilibrium(effective, factors, previous, trial, scene, memory):
    """Solve M a + C v + f(u) = p for the unknown x of each floor by Newton's method.

    The response is the linear function of x in the docstring of the module, with the first iterate
    x = 0. A correction dx is the solution of

        (by_a M + by_v C + by_u K) dx = p - M a - C v - f(u)

    with the tangent stiffness K of the stories, including P-delta. f includes the forces of
    power-law dashpots; the matrix also contains by_v times their derivatives with respect to the
    drift rates. The factorization of the matrix is reused, also in later steps, until a tangent has
    changed by more than a tolerance. The iteration ends

    - if all residuals are within the tolerance,
    - after a correction of the order of rounding errors (displacements, or velocities if by_u is
      0),
    - or after the first correction if all forces are linear functions of x.

    In the last two cases, the residuals are not tested again.

    Parameters
    ----------
    effective : EffectiveCoefficients
        Change of displacement, velocity and acceleration for a unit change of x.
    factors : int
        First scratch row of the factorization of by_a M + by_v C + by_u K for these coefficients,
        valid or marked by `invalidate`.
    previous : int
        First row of the law states at the start of the path.
    trial : int
        First row of the law states at the solution.
    scene : Scene
        Building and forces on its floors.
    memory : Memory
        Rows `ROW` of the scratch array: LOAD contains p (N), U, V and A contain the first iterate
        (m, m/s, m/s^2) and receive the response. Row X receives x (m/s^2). The status of the step
        receives the largest relative residual and its floor if the iteration fails
        (`_update_residuals`).

    Returns
    -------
    int
        Number of solutions of the linear system, or 1 if the first iterate is already in
        equilibrium and no system is solved. NOT_CONVERGED (negative) if the residuals are too large
        after MAX_ITERATIONS solutions.
    """
    return solve_equilibrium_with_dampers(
        _NO_DAMPERS, effective, factors, previous, trial, scene, memory
    )


@inline
def solve_equilibrium_with_dampers(damper_step, effective, factors, previous, trial, scene, memory):
    """Solve the equilibrium of `solve_equilibrium` with the forces of dampers with braces and of
    tangent damping.

    Row RISE contains the changes of the displacements over the step for x = 0, row DAMPING_BASE a
    part of the force of tangent damping. Rows BRACE receive the forces of the braces.
    """
    by_u, by_v, by_a = effective
    linear_terms, modal, _, _, flags = scene
    scratch, step_status = memory.scratch, memory.step_status
    n = linear_terms.shape[1] - 1
    tangents = factors + _FACTOR.FACTORED
    pivot, coupling = factors + _FACTOR.PIVOT, factors + _FACTOR.COUPLING
    factorization = Factors(scratch, pivot, coupling, factors + _STORE, linear_terms)
    # `factor_combination` assembles by_a M + by_v (linear dampers) + by_k (row TANGENT + geometric
    # stiffness). If by_u is 0, the displacements are known and the stiffness does not contribute;
    # row TANGENT then contains the other terms for by_k = 1 (`_story_forces`).
    combination = Combination(by_a, by_v, by_u if by_u != 0.0 else 1.0)
    for i in range(n):
        scratch[ROW.X, i] = 0.0
    iterations = 0
    applied_fraction = 1.0
    previous_norm = math.inf
    # The forces of dampers with stiff braces require the line search from the first correction.
    undamped_iterations = UNDAMPED_ITERATIONS
    if FULL and flags[rows.HAS_DAMPER_STATE] != 0.0:
        undamped_iterations = 0
    while True:
        # If no further solution is allowed, the largest relative residual is stored for the error
        # message.
        is_stale = _story_forces(damper_step, effective, factors, previous, trial, scene, memory)
        if _update_residuals(
            iterations == MAX_ITERATIONS, linear_terms, modal, scratch, step_status
        ):
            break
        if iterations >= undamped_iterations:
            norm = squared_norm(linear_terms, scratch, ROW.RESIDUAL, n)
            if must_halve(norm, previous_norm, applied_fraction):
                applied_fraction *= 0.5
                _correct(-applied_fraction, ROW.CORRECTION, effective, scratch, n)
                continue
            previous_norm = norm
            applied_fraction = 1.0
        if iterations == MAX_ITERATIONS:
            return rows.NOT_CONVERGED
        if is_stale:
            copy_rows(scratch, ROW.TANGENT, scratch, tangents, 1, n)
            factor_combination(
                linear_terms, modal, scratch, tangents, combination, factorization, n
            )
        # `solve_damped` replaces the residuals by the correction.
        solve_damped(factorization, modal, ROW.RESIDUAL, n)
        iterations += 1
        if iterations > undamped_iterations:
            copy_rows(scratch, ROW.RESIDUAL, scratch, ROW.CORRECTION, 1, n)
        # If all forces are linear functions of x, one solution is exact.
        is_linear_in_x = flags[rows.LINEAR] != 0.0 or (
            by_u == 0.0 and flags[rows.POWER_DAMPERS] == 0.0
        )
        # Without a further iteration, only the laws must be evaluated at the final displacements.
        if _correct(1.0, ROW.RESIDUAL, effective, scratch, n) or is_linear_in_x:
            _evaluate_laws(previous, trial, scene, memory)
            break
    return max(iterations, 1)


@inline
def _story_forces(damper_step, effective, factors, previous, trial, scene, memory):
    """Compute story forces and tangents for the current displacements and velocities; return True
    if the factorization must be computed again.

    The derivative of the force of a story with respect to the change of x over the story is by_u (k
    + g) + by_v (c + s). k is the tangent stiffness of the restoring force, g the geometric
    stiffness, c the linear damper, and s the derivative of the force of a power-law dashpot with
    respect to the drift rate (N s/m). `factor_combination` computes it from row TANGENT and adds
    the parts with g and c:

                            derivative                       row TANGENT
        if by_u is not 0    by_u (TANGENT + g) + by_v c    k + (by_v / by_u) s, N/m
        if by_u is 0        TANGENT + g + by_v c           by_v s - g, numerically in kg

    Row SIZE is multiplied by RESIDUAL_TOLERANCE, so that residuals up to the force of the rounding
    errors of the displacements are accepted.
    """
    by_u, by_v, _ = effective
    linear_terms, _, law_parameters, _, _ = scene
    _, law_state, scratch, _ = memory
    is_stale = False
    u_below = 0.0
    v_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        u_below = below(linear_terms, scratch, ROW.U, i, u_below)
        v_below = below(linear_terms, scratch, ROW.V, i, v_below)
        drift = scratch[ROW.U, i] - linear_terms[rows.LINK, i] * u_below
        rate = scratch[ROW.V, i] - linear_terms[rows.LINK, i] * v_below
        u_below = scratch[ROW.U, i]
        v_below = scratch[ROW.V, i]
        # without P-delta
        tangent = restoring_force(law_parameters, law_state, i, previous, trial, drift)
        law_tangent = tangent
        dashpot_force, dashpot_tangent = power_damper(linear_terms, i, rate)
        # The comparison is False for nan: the force is then also invalid, and the residual test
        # reports the failure.
        tangent_scale = law_parameters[rows.STIFFNESS, i]
        if by_u == 0.0:
            # by_v s - g is added to the mass by_a M in the matrix (by_a is dimensionless).
            tangent = by_v * dashpot_tangent - linear_terms[rows.GEOMETRIC, i]
            tangent_scale = linear_terms[rows.MASS, i]
        elif dashpot_tangent != 0.0:
            tangent += by_v / by_u * dashpot_tangent
        if FULL and linear_terms[rows.BRACE, i] != 0.0:
            # The dashpot force of a story with a brace is 0. The derivative with respect to x has
            # the unit of a mass.
            dashpot_force, by_x = _brace_force(damper_step, linear_terms, i, memory)
            tangent += by_x if by_u == 0.0 else by_x / by_u
        if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
            # Methods with by_u = 0 refuse tangent damping.
            damping_force, by_x = _tangent_damping_force(
                damper_step, by_u * law_tangent, trial, scene, i, memory
            )
            dashpot_force += damping_force
            tangent += by_x / by_u
        scratch[ROW.TANGENT, i] = tangent
        change = abs(tangent - scratch[factors + _FACTOR.FACTORED, i])
        is_stale = is_stale or change > TANGENT_TOLERANCE * tangent_scale
        story_force = (
            law_state[trial + rows.FORCE, i]
            + linear_terms[rows.GEOMETRIC, i] * drift
            + linear_terms[rows.STORY_DAMPER, i] * rate
            + dashpot_force
        )
        scratch[ROW.SUM, i] = story_force
        # The rounding errors of both displacements appear in the drift; U - drift is the
        # displacement of the floor below.
        rounding = ROUNDING / RESIDUAL_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        scratch[ROW.SIZE, i] = abs(story_force) + rounding * (
            abs(scratch[ROW.U, i]) + abs(scratch[ROW.U, i] - drift)
        )
        if FULL and linear_terms[rows.BRACE, i] != 0.0:
            # The force of the brace depends on the change of drift in the step only.
            rise = abs(scratch[ROW.RISE, i]) + abs(damper_step.by_rise * scratch[ROW.X, i])
            scratch[ROW.SIZE, i] += (
                2.0 * ROUNDING / RESIDUAL_TOLERANCE * linear_terms[rows.BRACE, i] * rise
            )
        if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
            by_law = damper_step.by_force * linear_terms[rows.TANGENT_DAMPING, i]
            scratch[ROW.SIZE, i] += (
                by_law * rounding * (abs(scratch[ROW.U, i]) + abs(scratch[ROW.U, i] - drift))
            )
    return is_stale


@outlined
def _tangent_damping_force(damper_step, by_x, trial, scene, i, memory):
    """Return the force of tangent damping of story `i` at the time of equilibrium, N, and its
    derivative with respect to x, kg.

    `by_x` is the derivative of the force of the law in block `trial` with respect to x, kg. If
    equilibrium is not at the end of the step, the law moves to the end in block SECOND_TRIAL.
    """
    linear_terms, law_state, scratch = scene.linear_terms, memory.law_state, memory.scratch
    factor = damper_step.by_force * linear_terms[rows.TANGENT_DAMPING, i]
    if damper_step.weight != 1.0:
        trial, link, below = rows.SECOND_TRIAL, linear_terms[rows.LINK, i], base_of(linear_terms, i)
        drift = memory.state[rows.DISPLACEMENT, i] + scratch[ROW.RISE, i]
        drift += damper_step.by_rise * scratch[ROW.X, i]
        drift -= link * (
            memory.state[rows.DISPLACEMENT, below]
            + scratch[ROW.RISE, below]
            + damper_step.by_rise * scratch[ROW.X, below]
        )
        by_x = damper_step.by_rise * restoring_force_outlined(
            scene.law_parameters, law_state, i, rows.COMMITTED, trial, drift
        )
    force = scratch[ROW.DAMPING_BASE, i] + factor * law_state[trial + rows.FORCE, i]
    return force, factor * by_x


@outlined
def commit_tangent_damping(damper_step, inertia_weight, work, slope, i, linear_terms, memory):
    """Store force and work of tangent damping of story `i` at the end of a step.

    The law is committed and the velocities of the floor and of the floor below are updated.
    Equilibrium contains D0 + inertia_weight (D1 - D0), with the forces D of the equations of the
    method at the start (0) and at the end (1) of the step. `slope` is the stiffness of the law at
    the end, N/m. `work` is the change of the force times the change of the drift, divided by the
    length (W), summed over the substeps.
    """
    state, law_state, scratch, _ = memory
    coefficient = linear_terms[rows.TANGENT_DAMPING, i]
    force = scratch[ROW.DAMPING_BASE, i]
    force += damper_step.by_force * coefficient * law_state[rows.FORCE, i]
    state[rows.DAMPING_STATE, i] += (force - state[rows.DAMPING_STATE, i]) / inertia_weight
    rate = story_value(linear_terms, state, rows.VELOCITY, i)
    state[rows.DAMPING_FORCE, i] = coefficient * slope * rate
    state[rows.DAMPING_WORK, i] += coefficient * work


@outlined
def _brace_force(damper_step, linear_terms, i, memory):
    """Return the force of the brace of story `i` at the time of equilibrium, N, and its derivative
    with respect to x, kg."""
    h, weight, by_rise, _ = damper_step
    scratch = memory.scratch
    link, below = linear_terms[rows.LINK, i], base_of(linear_terms, i)
    rise = scratch[ROW.RISE, i] + by_rise * scratch[ROW.X, i]
    rise -= link * (scratch[ROW.RISE, below] + by_rise * scratch[ROW.X, below])
    force_0 = memory.state[rows.BRACE_FORCE, i]
    follow_brace_at_midpoint(linear_terms, i, h, rise, force_0, scratch, ROW.BRACE)
    return (
        force_0 + weight * scratch[ROW.BRACE + path.MOMENT, i],
        weight * by_rise * scratch[ROW.BRACE + path.MOMENT_BY_RISE, i],
    )


@inline
def _update_residuals(is_last, linear_terms, modal, scratch, step_status):
    """Compute the residuals p - M a - C v - f(u) of all floors (row RESIDUAL, N); return True if
    each is at most RESIDUAL_TOLERANCE times the sum of the absolute values of its terms (with row
    SIZE for the stories).

    If `is_last`, no further iteration is allowed: the largest relative residual above the tolerance
    and its floor are stored in `step_status`. P-delta and story dampers are included in the story
    forces (row SUM).
    """
    n = linear_terms.shape[1] - 1
    for i in range(n):
        scratch[ROW.RESIDUAL, i] = linear_terms[rows.FLOOR_DAMPER, i] * scratch[ROW.V, i]
    add_modal_force(modal, scratch, ROW.V, 1.0, scratch, ROW.RESIDUAL, n)
    add_inertance(linear_terms, scratch, ROW.A, 1.0, scratch, ROW.RESIDUAL)
    step_status[rows.RESIDUAL] = 0.0
    is_small = True
    for i in range(n):
        load = scratch[ROW.LOAD, i]
        inertia = linear_terms[rows.MASS, i] * scratch[ROW.A, i]
        damping = scratch[ROW.RESIDUAL, i]
        residual = load - inertia - damping - scratch[ROW.SUM, i]
        residual += above(linear_terms, scratch, ROW.SUM, i)
        scratch[ROW.RESIDUAL, i] = residual
        scale = (
            abs(load)
            + abs(inertia)
            + abs(damping)
            + scratch[ROW.SIZE, i]
            + size_above(linear_terms, scratch, ROW.SIZE, i)
        )
        is_small &= is_balanced(is_last, RESIDUAL_TOLERANCE, step_status, i, residual, scale)
    return is_small


@inline
def _evaluate_laws(previous, trial, scene, memory):
    """Evaluate the laws of all stories at the current displacements (row U, m).

    The states move from block `previous` to block `trial` of the law states. The story forces in
    row SUM are not updated.
    """
    linear_terms, _, law_parameters, _, _ = scene
    _, law_state, scratch, _ = memory
    u_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        restoring_force(
            law_parameters,
            law_state,
            i,
            previous,
            trial,
            scratch[ROW.U, i]
            - linear_terms[rows.LINK, i] * below(linear_terms, scratch, ROW.U, i, u_below),
        )
        u_below = scratch[ROW.U, i]


@inline
def _correct(fraction, row, effective, scratch, n):
    """Add a fraction of the correction of x (scratch row `row`) to x and to the response of all
    floors; return True if the change of the displacements is of the order of rounding errors.

    If by_u is 0, the displacements do not change, and the change of the velocities is tested
    instead. In very short steps, the displacements change by less than rounding errors, although
    velocities and accelerations still change. The remaining error is then much smaller than this
    last correction, because the tangents hardly change within such a step.
    """
    by_u, by_v, by_a = effective
    tested, by_tested = (ROW.U, by_u) if by_u != 0.0 else (ROW.V, by_v)
    is_small = True
    for i in range(n):
        dx = fraction * scratch[row, i]
        scratch[ROW.X, i] += dx
        scratch[ROW.V, i] += by_v * dx
        scratch[ROW.A, i] += by_a * dx
        scratch[ROW.U, i] += by_u * dx
        is_small = is_small and abs(by_tested * dx) <= ROUNDING * abs(scratch[tested, i])
    return is_small
