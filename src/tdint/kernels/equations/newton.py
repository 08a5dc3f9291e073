"""Equilibrium of all floors at one instant, by Newton's iteration.

For the families whose motion at that instant is linear in one unknown x per floor, an acceleration:

    u = U + by_u x,   v = V + by_v x,   a = A + by_a x,   M a + C v + f(u) = p

U, V, A are the first guess. The corrections are found by tridiagonal solves, and the factors are kept for the next
step: they are made anew only when a tangent changed. Where large steps over kinks make the iteration go round in a
cycle, corrections are halved until they bring the floors closer to equilibrium.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.bundles import Factors
from tdint.kernels.chain import add_modal_force, power_damper
from tdint.kernels.compiling import inlined
from tdint.kernels.equations.halving import copy_rows, squares, too_far
from tdint.kernels.equations.tridiagonal import Combination, factor_combination, solve_damped
from tdint.kernels.stepping import CLOSE, ITERATIONS, PATIENCE, SAME_TANGENT, SMALL, balanced
from tdint.kernels.stories.springs import restoring

# Rows of work: the load and the first guess come in, the motion in equilibrium goes out
LOAD = 0
U = 1
V = 2
A = 3
X = 4
_SUM = 5  # story forces
_RESIDUAL = 6  # unbalanced forces, then the correction of x
_TANGENT = 7
_SIZE = 8  # of the story forces, with what the displacements round
_CORRECTION = 9  # of x, the last one
BALANCE_ROWS = 10

# Rows of a block of factors
_FACTORED = 0  # its tangents
_PIVOT = 1
_COUPLING = 2
_STORE = 3


def factor_rows(modes: int) -> int:
    """Rows of work in a block of factors for a building with `modes` modally damped modes."""
    return _STORE + 2 * modes + 1


@inlined
def forget(work, factors, n):
    """Mark the factors in the block at row `factors` as fitting no tangent."""
    for i in range(n):
        work[factors + _FACTORED, i] = math.inf


@inlined
def balance(weights, factors, past, trial, scene, memory):
    """Bring the floors into equilibrium; returns the number of solves, or a negative code.

    The drift laws go from the state in block `past` of springs to block `trial`. Rows `factors` and following of work
    hold the factors of by_a M + by_v C + by_u K for the weights of this call, or are marked by `forget`.
    """
    by_u, by_v, by_a = weights
    chain, modal, _, _, flags = scene
    work, report = memory.work, memory.report
    n = chain.shape[1] - 1
    tangents = factors + _FACTORED
    kept = Factors(work, factors + _PIVOT, factors + _COUPLING, factors + _STORE)
    combination = Combination(by_a, by_v, by_u if by_u != 0.0 else 1.0)
    for i in range(n):
        work[X, i] = 0.0
    iterations = 0
    part = 1.0
    before = math.inf
    while True:
        stale = _story_forces(weights, factors, past, trial, scene, memory)
        if _in_balance(iterations == ITERATIONS, chain, modal, work, report):
            break
        if iterations >= PATIENCE:
            size = squares(chain, work, _RESIDUAL, n)
            if too_far(size, before, part):
                part *= 0.5
                _correct(-part, _CORRECTION, weights, work, n)
                continue
            before = size
            part = 1.0
        if iterations == ITERATIONS:
            return at.NOT_CONVERGED
        if stale:
            for i in range(n):
                work[tangents, i] = work[_TANGENT, i]
            factor_combination(chain, modal, work, tangents, combination, kept, n)
        solve_damped(kept, modal, _RESIDUAL, n)
        iterations += 1
        if iterations > PATIENCE:
            copy_rows(work, _RESIDUAL, _CORRECTION, 1, n)
        done = flags[at.LINEAR] != 0.0 or (by_u == 0.0 and flags[at.POWER_DAMPERS] == 0.0)
        if _correct(1.0, _RESIDUAL, weights, work, n) or done:
            _drift_laws(past, trial, scene, memory)
            break
    return max(iterations, 1)


@inlined
def _story_forces(weights, factors, past, trial, scene, memory):
    """Story forces of the present motion. True if the factors do not fit its tangents.

    The tangent of a power-law dashpot is a stiffness by_v / by_u times as large. Where by_u is 0 no stiffness matters,
    and the factors are made with 1 in its place.
    """
    by_u, by_v, _ = weights
    chain, _, laws, _, _ = scene
    _, springs, work, _ = memory
    stale = False
    u_below = 0.0
    v_below = 0.0
    for i in range(chain.shape[1] - 1):
        drift = work[U, i] - chain[at.LINK, i] * u_below
        rate = work[V, i] - chain[at.LINK, i] * v_below
        u_below = work[U, i]
        v_below = work[V, i]
        tangent = restoring(laws, springs, i, past, trial, drift)
        damper, slope = power_damper(chain, i, rate)
        scale = laws[at.STIFFNESS, i]
        if by_u == 0.0:
            tangent = by_v * slope - chain[at.GEOMETRIC, i]
            scale = chain[at.MASS, i]
        elif slope != 0.0:
            tangent += by_v / by_u * slope
        work[_TANGENT, i] = tangent
        stale = stale or abs(tangent - work[factors + _FACTORED, i]) > SAME_TANGENT * scale
        total = (
            springs[trial + at.FORCE, i] + chain[at.GEOMETRIC, i] * drift + chain[at.STORY_DAMPER, i] * rate + damper
        )
        work[_SUM, i] = total
        # A drift is a difference: what the displacements round is not out of balance.
        rounding = SMALL / CLOSE * laws[at.STIFFNESS, i]
        work[_SIZE, i] = abs(total) + rounding * (abs(work[U, i]) + abs(work[U, i] - drift))
    return stale


@inlined
def _in_balance(last, chain, modal, work, report):
    """Unbalanced forces into their row, N; whether all are small. At the last of them the worst is noted."""
    n = chain.shape[1] - 1
    for i in range(n):
        work[_RESIDUAL, i] = chain[at.FLOOR_DAMPER, i] * work[V, i]
    add_modal_force(modal, work, V, 1.0, work, _RESIDUAL, n)
    report[at.RESIDUAL] = 0.0
    small = True
    for i in range(n):
        load = work[LOAD, i]
        inertia = chain[at.MASS, i] * work[A, i]
        damping = work[_RESIDUAL, i]
        link = chain[at.LINK, i + 1]
        residual = load - inertia - damping - work[_SUM, i] + link * work[_SUM, i + 1]
        work[_RESIDUAL, i] = residual
        scale = abs(load) + abs(inertia) + abs(damping) + work[_SIZE, i] + link * work[_SIZE, i + 1]
        small &= balanced(last, CLOSE, report, i, residual, scale)
    return small


@inlined
def _drift_laws(past, trial, scene, memory):
    """Drift laws at the present displacements."""
    chain, _, laws, _, _ = scene
    _, springs, work, _ = memory
    below = 0.0
    for i in range(chain.shape[1] - 1):
        restoring(laws, springs, i, past, trial, work[U, i] - chain[at.LINK, i] * below)
        below = work[U, i]


@inlined
def _correct(part, row, weights, work, n):
    """Add a part of the correction of x in `row` to x and to the motion. True if it was rounding."""
    by_u, by_v, by_a = weights
    small = True
    for i in range(n):
        dx = part * work[row, i]
        work[X, i] += dx
        work[V, i] += by_v * dx
        work[A, i] += by_a * dx
        work[U, i] += by_u * dx
        small = small and abs(by_u * dx) <= SMALL * abs(work[U, i])
    return small
