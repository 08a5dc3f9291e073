"""Kinematics, momentum and equilibrium over a step, shared by the two impulse-momentum families.

    kinematics  u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
    momentum    M (v1 - v0) + C (u1 - u0) + S = I
    equilibrium M a1 + C v1 + f(u1) = p1

Displacement, velocity and acceleration are u0, v0, a0 at the start and u1, v1, a1 at the end of the
step of length h; th, al and be are coefficients of the method, p1 is the load at the end, I its
impulse and S the impulse of the restoring forces. The unknowns are u1 - u0 and v1 - v0 of each
floor; a1 follows from equilibrium. Each family provides the story forces at the end of the step,
the story impulses S, and the matrix of Newton's method.
"""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline
from tdint.kernels.equations.iteration import ROUNDING, is_balanced
from tdint.kernels.equations.tridiagonal import solve_blocks_damped
from tdint.kernels.linear_terms import (
    above,
    add_inertance,
    add_modal_force,
    distribute,
    has_inerters,
    size_above,
    tie,
)

# Scratch rows: load (N) and its impulse (N s), increments of displacement (m) and velocity (m/s),
# response at the end of the step, and the following rows.
LOAD = 0
IMPULSE = 1
DU = 2
DV = 3
U1 = 4
V1 = 5
A1 = 6
FORCE_1 = 7  # story force at the end of the step, including dampers, N
FORCE_S = 8  # story impulse, including dampers, N s
R1 = 9  # residuals, then corrections, of DU and DV
R2 = 10
# Force that corresponds to the rounding errors of the displacements of a story, divided by the
# relative tolerance RESIDUAL_TOLERANCE of the residuals, N
SIZE = 11
MOMENTUM_ROWS = 12


@inline
def store_first_guess(factor, h, state, scratch, n):
    """Store the first guess of the increments: the motion with constant acceleration (`factor` 1),
    or zero (`factor` 0).

    In a linear building, a single solution gives the exact increments for any guess. Zero is then
    used, because it leads to the smallest rounding errors if the time step is large in comparison
    with the periods of the highest modes.
    """
    for i in range(n):
        a = factor * state[rows.ACCELERATION, i]
        scratch[DU, i] = factor * h * state[rows.VELOCITY, i] + 0.5 * h * h * a
        scratch[DV, i] = h * a


@inline
def residuals(kinematics, scene, h, memory):
    """Compute the negative residuals of an impulse-momentum step, and the acceleration at its end
    (row A1).

        R1 = M (h ((1 - theta) v0 + theta v1) + h^2 (alpha a0 - beta a1) - (u1 - u0)) kinematics
        R2 = I - M (v1 - v0) - C (u1 - u0) - S momentum

    `kinematics` is (theta, alpha, beta). C contains the floor dampers and modal damping; the forces
    of story dampers are part of f and S.
    """
    theta, alpha, beta = kinematics
    linear_terms, modal, _, _, _ = scene
    state, _, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    # M a1 (row A1) and R2 without modal damping
    for i in range(n):
        force = scratch[FORCE_1, i] - above(linear_terms, scratch, FORCE_1, i)
        scratch[A1, i] = (
            scratch[LOAD, i] - linear_terms[rows.FLOOR_DAMPER, i] * scratch[V1, i] - force
        )
        impulse = scratch[FORCE_S, i] - above(linear_terms, scratch, FORCE_S, i)
        scratch[R2, i] = (
            scratch[IMPULSE, i]
            - linear_terms[rows.MASS, i] * scratch[DV, i]
            - linear_terms[rows.FLOOR_DAMPER, i] * scratch[DU, i]
            - impulse
        )
    add_modal_force(modal, scratch, V1, -1.0, scratch, A1, n)
    add_modal_force(modal, scratch, DU, -1.0, scratch, R2, n)
    add_inertance(linear_terms, scratch, DV, -1.0, scratch, R2)
    distribute(linear_terms, scratch, A1)
    for i in range(n):
        scratch[A1, i] *= linear_terms[rows.INVERSE_MASS, i]
        # Terms of the kinematic equation, m
        velocity_terms = h * ((1.0 - theta) * state[rows.VELOCITY, i] + theta * scratch[V1, i])
        acceleration_terms = h * h * (alpha * state[rows.ACCELERATION, i] - beta * scratch[A1, i])
        scratch[R1, i] = linear_terms[rows.MASS, i] * (
            velocity_terms + acceleration_terms - scratch[DU, i]
        )
    add_inertance(linear_terms, state, rows.VELOCITY, h * (1.0 - theta), scratch, R1)
    add_inertance(linear_terms, scratch, V1, h * theta, scratch, R1)
    add_inertance(linear_terms, state, rows.ACCELERATION, h * h * alpha, scratch, R1)
    add_inertance(linear_terms, scratch, A1, -h * h * beta, scratch, R1)
    add_inertance(linear_terms, scratch, DU, -1.0, scratch, R1)
    tie(linear_terms, scratch, A1)


@inline
def has_converged(is_last, tolerance, kinematics, scene, h, memory):
    """Return True if the residuals of kinematics and momentum of all floors are small enough.

    A residual is small enough if it is at most `tolerance` (at least RESIDUAL_TOLERANCE) times the
    sum of the absolute values of the terms of its equation. The sums differ from the equations in
    two points:

    - The coefficients 1 - theta, theta and alpha are replaced by 1.
    - C (floor dampers and modal damping) is omitted, so that the requirement is slightly stricter.

    In addition, residuals below the effect of the rounding errors of the displacements are always
    small enough. A force has the factor beta h^2 in the kinematic equation and h in the momentum
    equation. Row SIZE is therefore added to the sums with these factors.

    If `is_last`, no further iteration is allowed: the largest relative residual above the tolerance
    and its floor are stored in the status of the step.
    """
    linear_terms = scene.linear_terms
    state, _, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    by_a = kinematics[2] * h * h
    step_status[rows.RESIDUAL] = 0.0
    is_small = True
    for i in range(n):
        mass = linear_terms[rows.MASS, i]
        if FULL and has_inerters(linear_terms):
            mass += linear_terms[rows.STORY_INERTANCE, i] + linear_terms[rows.FLOOR_INERTANCE, i]
        rounding = scratch[SIZE, i] + size_above(linear_terms, scratch, SIZE, i)
        # Sum of the terms: first of the kinematic equation (m, without the factor mass), then of
        # the momentum equation (N s)
        scale = abs(scratch[DU, i]) + h * (abs(state[rows.VELOCITY, i]) + abs(scratch[V1, i]))
        scale += h * h * abs(state[rows.ACCELERATION, i]) + by_a * abs(scratch[A1, i])
        is_small &= is_balanced(
            is_last, tolerance, step_status, i, scratch[R1, i], mass * scale + by_a * rounding
        )
        scale = abs(scratch[IMPULSE, i]) + abs(mass * scratch[DV, i]) + h * rounding
        scale += abs(scratch[FORCE_S, i]) + abs(above(linear_terms, scratch, FORCE_S, i))
        is_small &= is_balanced(is_last, tolerance, step_status, i, scratch[R2, i], scale)
    return is_small


@inline
def correct(modal, factors, n):
    """Solve for the corrections of Newton's method and add them to the increments; return True if
    the corrections of the displacements are of the order of rounding errors.

    Rows R1 and R2 contain the negative residuals and receive the corrections. This test supplements
    the test of the residuals (`has_converged`): if u1 of a floor is zero, only the test of the
    residuals ends the iteration. Row U1 contains the displacements before the correction.
    """
    scratch = factors.table
    solve_blocks_damped(factors, modal, R1, n)
    is_small = True
    for i in range(n):
        scratch[DU, i] += scratch[R1, i]
        scratch[DV, i] += scratch[R2, i]
        is_small = is_small and abs(scratch[R1, i]) <= ROUNDING * abs(scratch[U1, i])
    return is_small
