"""What the two impulse-momentum families have in common: kinematics, momentum and equilibrium over
a step.

    kinematics  u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
    momentum    M (v1 - v0) + C (u1 - u0) + S = I
    equilibrium M a1 + C v1 + f(u1) = p1

Unknowns are u1 - u0 and v1 - v0 of each floor; a1 follows from equilibrium. A family brings the
story forces at the end of the step, the story impulses S and the matrix of Newton's iteration.
"""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline
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


@inline
def guess(factor, h, state, scratch, n):
    """Constant acceleration as the first guess with factor 1; no increment with 0.

    In a linear building any guess will do, and no increment is the one that rounds least where
    omega h is large.
    """
    for i in range(n):
        a = factor * state[rows.ACCELERATION, i]
        scratch[DU, i] = factor * h * state[rows.VELOCITY, i] + 0.5 * h * h * a
        scratch[DV, i] = h * a


@inline
def residuals(theta, alpha, beta, linear_terms, modal, h, state, scratch):
    """Minus the residuals of kinematics (times M) and momentum into their rows, and the
    acceleration at the end."""
    n = linear_terms.shape[1] - 1
    for i in range(n):
        link = linear_terms[rows.LINK, i + 1]
        force = scratch[FORCE_1, i] - link * scratch[FORCE_1, i + 1]
        scratch[A1, i] = (
            scratch[LOAD, i] - linear_terms[rows.FLOOR_DAMPER, i] * scratch[V1, i] - force
        )
        impulse = scratch[FORCE_S, i] - link * scratch[FORCE_S, i + 1]
        scratch[R2, i] = (
            scratch[IMPULSE, i]
            - linear_terms[rows.MASS, i] * scratch[DV, i]
            - linear_terms[rows.FLOOR_DAMPER, i] * scratch[DU, i]
            - impulse
        )
    add_modal_force(modal, scratch, V1, -1.0, scratch, A1, n)
    add_modal_force(modal, scratch, DU, -1.0, scratch, R2, n)
    for i in range(n):
        scratch[A1, i] *= linear_terms[rows.INVERSE_MASS, i]
        by_v = h * ((1.0 - theta) * state[rows.VELOCITY, i] + theta * scratch[V1, i])
        by_a = h * h * (alpha * state[rows.ACCELERATION, i] - beta * scratch[A1, i])
        scratch[R1, i] = linear_terms[rows.MASS, i] * (by_v + by_a - scratch[DU, i])


@inline
def in_balance(last, tolerance, beta, linear_terms, h, state, scratch, step_status):
    """Return True if the residuals of all floors are within `tolerance` times their terms. In the
    last iteration the largest relative residual is stored in `report`."""
    n = linear_terms.shape[1] - 1
    by_a = beta * h * h
    step_status[rows.RESIDUAL] = 0.0
    small = True
    for i in range(n):
        link = linear_terms[rows.LINK, i + 1]
        mass = linear_terms[rows.MASS, i]
        rounding = scratch[SIZE, i] + link * scratch[SIZE, i + 1]
        scale = abs(scratch[DU, i]) + h * (abs(state[rows.VELOCITY, i]) + abs(scratch[V1, i]))
        scale += h * h * abs(state[rows.ACCELERATION, i]) + by_a * abs(scratch[A1, i])
        small &= is_balanced(
            last, tolerance, step_status, i, scratch[R1, i], mass * scale + by_a * rounding
        )
        scale = abs(scratch[IMPULSE, i]) + abs(mass * scratch[DV, i]) + h * rounding
        scale += abs(scratch[FORCE_S, i]) + link * abs(scratch[FORCE_S, i + 1])
        small &= is_balanced(last, tolerance, step_status, i, scratch[R2, i], scale)
    return small


@inline
def correct(beta, modal, h, factors, n):
    """Solve for the corrections with the factors in work and add them. True if they are
    rounding."""
    scratch = factors.table
    solve_blocks_damped(factors, ModalBlocks(modal, 0.0, -beta * h * h, 1.0, 0.0), R1, R2, n)
    small = True
    for i in range(n):
        scratch[DU, i] += scratch[R1, i]
        scratch[DV, i] += scratch[R2, i]
        small = small and abs(scratch[R1, i]) <= ROUNDING * abs(scratch[U1, i])
    return small
