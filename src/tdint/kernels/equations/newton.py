"""Equilibrium of all floors at one instant, by Newton's iteration.

For the families whose motion at that instant is linear in one unknown x per floor, an acceleration:

    u = U + by_u x,   v = V + by_v x,   a = A + by_a x,   M a + C v + f(u) = p

U, V, A are the first guess. The corrections are found by tridiagonal solves, and the factors are
kept for the next step: they are made anew only when a tangent changed. Where large steps over kinks
make the iteration go round in a cycle, corrections are halved until they bring the floors closer to
equilibrium.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline
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
from tdint.kernels.linear_terms import add_modal_force, power_damper
from tdint.kernels.stepping import Factors
from tdint.kernels.stories.law_state import restoring_force


class _Rows(NamedTuple):
    """Rows of work: the load and the first guess come in, the motion in equilibrium goes out."""

    LOAD: int = 1
    U: int = 1
    V: int = 1
    A: int = 1
    X: int = 1
    SUM: int = 1  # story forces
    RESIDUAL: int = 1  # unbalanced forces, then the correction of x
    TANGENT: int = 1
    SIZE: int = 1  # of the story forces, with what the displacements round
    CORRECTION: int = 1  # of x, the last one


class _Factors(NamedTuple):
    """Rows of a block of factors."""

    FACTORED: int = 1  # its tangents
    PIVOT: int = 1
    COUPLING: int = 1


ROW, EQUILIBRIUM_ROWS = rows.chained(_Rows)
_FACTOR, _STORE = rows.chained(_Factors)


def factor_rows(modes: int) -> int:
    """Rows of work in a block of factors for a building with `modes` modally damped modes."""
    return _STORE + 2 * modes + 1


@inline
def invalidate(scratch, factors, n):
    """Mark the factors in the block at row `factors` as fitting no tangent."""
    for i in range(n):
        scratch[factors + _FACTOR.FACTORED, i] = math.inf


@inline
def solve_equilibrium(weights, factors, previous, trial, scene, memory):
    """Bring the floors into equilibrium; returns the number of solves, or a negative code.

    The drift laws go from the state in block `previous` of springs to block `trial`. Rows
    `factors` and
    following of work hold the factors of by_a M + by_v C + by_u K for the weights of this call, or
    are marked by `invalidate`.
    """
    by_u, by_v, by_a = weights
    linear_terms, modal, _, _, flags = scene
    scratch, step_status = memory.scratch, memory.step_status
    n = linear_terms.shape[1] - 1
    tangents = factors + _FACTOR.FACTORED
    kept = Factors(scratch, factors + _FACTOR.PIVOT, factors + _FACTOR.COUPLING, factors + _STORE)
    combination = Combination(by_a, by_v, by_u if by_u != 0.0 else 1.0)
    for i in range(n):
        scratch[ROW.X, i] = 0.0
    iterations = 0
    part = 1.0
    before = math.inf
    while True:
        stale = _story_forces(weights, factors, previous, trial, scene, memory)
        if _in_balance(iterations == MAX_ITERATIONS, linear_terms, modal, scratch, step_status):
            break
        if iterations >= UNDAMPED_ITERATIONS:
            size = squared_norm(linear_terms, scratch, ROW.RESIDUAL, n)
            if must_halve(size, before, part):
                part *= 0.5
                _correct(-part, ROW.CORRECTION, weights, scratch, n)
                continue
            before = size
            part = 1.0
        if iterations == MAX_ITERATIONS:
            return rows.NOT_CONVERGED
        if stale:
            for i in range(n):
                scratch[tangents, i] = scratch[ROW.TANGENT, i]
            factor_combination(linear_terms, modal, scratch, tangents, combination, kept, n)
        solve_damped(kept, modal, ROW.RESIDUAL, n)
        iterations += 1
        if iterations > UNDAMPED_ITERATIONS:
            copy_rows(scratch, ROW.RESIDUAL, ROW.CORRECTION, 1, n)
        done = flags[rows.LINEAR] != 0.0 or (by_u == 0.0 and flags[rows.POWER_DAMPERS] == 0.0)
        if _correct(1.0, ROW.RESIDUAL, weights, scratch, n) or done:
            _drift_laws(previous, trial, scene, memory)
            break
    return max(iterations, 1)


@inline
def _story_forces(weights, factors, previous, trial, scene, memory):
    """Story forces of the present motion. True if the factors do not fit its tangents.

    The tangent of a power-law dashpot is a stiffness by_v / by_u times as large. Where by_u is 0 no
    stiffness matters, and the factors are made with 1 in its place.
    """
    by_u, by_v, _ = weights
    linear_terms, _, law_parameters, _, _ = scene
    _, law_state, scratch, _ = memory
    stale = False
    u_below = 0.0
    v_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        drift = scratch[ROW.U, i] - linear_terms[rows.LINK, i] * u_below
        rate = scratch[ROW.V, i] - linear_terms[rows.LINK, i] * v_below
        u_below = scratch[ROW.U, i]
        v_below = scratch[ROW.V, i]
        tangent = restoring_force(law_parameters, law_state, i, previous, trial, drift)
        damper, slope = power_damper(linear_terms, i, rate)
        scale = law_parameters[rows.STIFFNESS, i]
        if by_u == 0.0:
            tangent = by_v * slope - linear_terms[rows.GEOMETRIC, i]
            scale = linear_terms[rows.MASS, i]
        elif slope != 0.0:
            tangent += by_v / by_u * slope
        scratch[ROW.TANGENT, i] = tangent
        stale = (
            stale
            or abs(tangent - scratch[factors + _FACTOR.FACTORED, i]) > TANGENT_TOLERANCE * scale
        )
        total = (
            law_state[trial + rows.FORCE, i]
            + linear_terms[rows.GEOMETRIC, i] * drift
            + linear_terms[rows.STORY_DAMPER, i] * rate
            + damper
        )
        scratch[ROW.SUM, i] = total
        # A drift is a difference: what the displacements round is not out of balance.
        rounding = ROUNDING / RESIDUAL_TOLERANCE * law_parameters[rows.STIFFNESS, i]
        scratch[ROW.SIZE, i] = abs(total) + rounding * (
            abs(scratch[ROW.U, i]) + abs(scratch[ROW.U, i] - drift)
        )
    return stale


@inline
def _in_balance(last, linear_terms, modal, scratch, step_status):
    """Unbalanced forces into their row, N; whether all are small. At the last of them the worst is
    noted."""
    n = linear_terms.shape[1] - 1
    for i in range(n):
        scratch[ROW.RESIDUAL, i] = linear_terms[rows.FLOOR_DAMPER, i] * scratch[ROW.V, i]
    add_modal_force(modal, scratch, ROW.V, 1.0, scratch, ROW.RESIDUAL, n)
    step_status[rows.RESIDUAL] = 0.0
    small = True
    for i in range(n):
        load = scratch[ROW.LOAD, i]
        inertia = linear_terms[rows.MASS, i] * scratch[ROW.A, i]
        damping = scratch[ROW.RESIDUAL, i]
        link = linear_terms[rows.LINK, i + 1]
        residual = load - inertia - damping - scratch[ROW.SUM, i] + link * scratch[ROW.SUM, i + 1]
        scratch[ROW.RESIDUAL, i] = residual
        scale = (
            abs(load)
            + abs(inertia)
            + abs(damping)
            + scratch[ROW.SIZE, i]
            + link * scratch[ROW.SIZE, i + 1]
        )
        small &= is_balanced(last, RESIDUAL_TOLERANCE, step_status, i, residual, scale)
    return small


@inline
def _drift_laws(previous, trial, scene, memory):
    """Drift laws at the present displacements."""
    linear_terms, _, law_parameters, _, _ = scene
    _, law_state, scratch, _ = memory
    below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        restoring_force(
            law_parameters,
            law_state,
            i,
            previous,
            trial,
            scratch[ROW.U, i] - linear_terms[rows.LINK, i] * below,
        )
        below = scratch[ROW.U, i]


@inline
def _correct(part, row, weights, scratch, n):
    """Add a part of the correction of x in `row` to x and to the motion. True if it was
    rounding."""
    by_u, by_v, by_a = weights
    small = True
    for i in range(n):
        dx = part * scratch[row, i]
        scratch[ROW.X, i] += dx
        scratch[ROW.V, i] += by_v * dx
        scratch[ROW.A, i] += by_a * dx
        scratch[ROW.U, i] += by_u * dx
        small = small and abs(by_u * dx) <= ROUNDING * abs(scratch[ROW.U, i])
    return small
