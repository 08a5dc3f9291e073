"""What the two impulse-momentum families have in common: kinematics, momentum and equilibrium over
a step.

    kinematics  u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
    momentum    M (v1 - v0) + C (u1 - u0) + S = I
    equilibrium M a1 + C v1 + f(u1) = p1

Unknowns are u1 - u0 and v1 - v0 of each floor; a1 follows from equilibrium. A family brings the
story forces at the end of the step, the story impulses S and the matrix of Newton's iteration.
"""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import inlined
from tdint.kernels.equations.iteration import ROUNDING, is_balanced
from tdint.kernels.equations.tridiagonal import ModalBlocks, solve_blocks_damped
from tdint.kernels.linear_terms import add_modal_force

# Rows of work
LOAD = 0
IMPULSE = 1
DU = 2
DV = 3
U1 = 4
V1 = 5
A1 = 6
FORCE_1 = 7  # story force at the end, damper included
FORCE_S = 8  # story impulse, damper included
R1 = 9  # residuals, then corrections, of DU and DV
R2 = 10
SIZE = 11  # what the displacements round, as a force
MOMENTUM_ROWS = 12


@inlined
def guess(factor, h, state, work, n):
    """Constant acceleration as the first guess with factor 1; no increment with 0.

    In a linear building any guess will do, and no increment is the one that rounds least where
    omega h is large.
    """
    for i in range(n):
        a = factor * state[at.ACCELERATION, i]
        work[DU, i] = factor * h * state[at.VELOCITY, i] + 0.5 * h * h * a
        work[DV, i] = h * a


@inlined
def residuals(theta, alpha, beta, linear_terms, modal, h, state, work):
    """Minus the residuals of kinematics (times M) and momentum into their rows, and the
    acceleration at the end."""
    n = linear_terms.shape[1] - 1
    for i in range(n):
        link = linear_terms[at.LINK, i + 1]
        force = work[FORCE_1, i] - link * work[FORCE_1, i + 1]
        work[A1, i] = work[LOAD, i] - linear_terms[at.FLOOR_DAMPER, i] * work[V1, i] - force
        impulse = work[FORCE_S, i] - link * work[FORCE_S, i + 1]
        work[R2, i] = (
            work[IMPULSE, i]
            - linear_terms[at.MASS, i] * work[DV, i]
            - linear_terms[at.FLOOR_DAMPER, i] * work[DU, i]
            - impulse
        )
    add_modal_force(modal, work, V1, -1.0, work, A1, n)
    add_modal_force(modal, work, DU, -1.0, work, R2, n)
    for i in range(n):
        work[A1, i] *= linear_terms[at.INVERSE_MASS, i]
        by_v = h * ((1.0 - theta) * state[at.VELOCITY, i] + theta * work[V1, i])
        by_a = h * h * (alpha * state[at.ACCELERATION, i] - beta * work[A1, i])
        work[R1, i] = linear_terms[at.MASS, i] * (by_v + by_a - work[DU, i])


@inlined
def in_balance(last, tolerance, beta, linear_terms, h, state, work, report):
    """Return True if the residuals of all floors are within `tolerance` times their terms. In the
    last iteration the largest relative residual is stored in `report`."""
    n = linear_terms.shape[1] - 1
    by_a = beta * h * h
    report[at.RESIDUAL] = 0.0
    small = True
    for i in range(n):
        link = linear_terms[at.LINK, i + 1]
        mass = linear_terms[at.MASS, i]
        rounding = work[SIZE, i] + link * work[SIZE, i + 1]
        scale = abs(work[DU, i]) + h * (abs(state[at.VELOCITY, i]) + abs(work[V1, i]))
        scale += h * h * abs(state[at.ACCELERATION, i]) + by_a * abs(work[A1, i])
        small &= is_balanced(
            last, tolerance, report, i, work[R1, i], mass * scale + by_a * rounding
        )
        scale = abs(work[IMPULSE, i]) + abs(mass * work[DV, i]) + h * rounding
        scale += abs(work[FORCE_S, i]) + link * abs(work[FORCE_S, i + 1])
        small &= is_balanced(last, tolerance, report, i, work[R2, i], scale)
    return small


@inlined
def correct(beta, modal, h, factors, n):
    """Solve for the corrections with the factors in work and add them. True if they are
    rounding."""
    work = factors.table
    solve_blocks_damped(factors, ModalBlocks(modal, 0.0, -beta * h * h, 1.0, 0.0), R1, R2, n)
    small = True
    for i in range(n):
        work[DU, i] += work[R1, i]
        work[DV, i] += work[R2, i]
        small = small and abs(work[R1, i]) <= ROUNDING * abs(work[U1, i])
    return small
