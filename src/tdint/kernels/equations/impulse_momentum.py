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
from tdint.kernels.compiling import inline
from tdint.kernels.equations.iteration import ROUNDING, is_balanced
from tdint.kernels.equations.tridiagonal import ModalBlocks, solve_blocks_damped
from tdint.kernels.linear_terms import add_modal_force

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
    """Store the first guess of the increments u1 - u0 and v1 - v0 of the floors over the step.

    The guess is the motion with constant acceleration a0 if `factor` is 1,

        u1 - u0 = h v0 + h^2 a0 / 2,   v1 - v0 = h a0

    and zero if `factor` is 0. In a linear building, a single solution of the linear system of
    Newton's method gives the exact increments for any guess. Zero is then used, because it leads to
    the smallest rounding errors if the time step is large in comparison with the periods of the
    highest modes.

    Parameters
    ----------
    factor : float
        1 for the motion with constant acceleration, 0 for zero.
    """
    for i in range(n):
        a = factor * state[rows.ACCELERATION, i]
        scratch[DU, i] = factor * h * state[rows.VELOCITY, i] + 0.5 * h * h * a
        scratch[DV, i] = h * a


@inline
def residuals(theta, alpha, beta, linear_terms, modal, h, state, scratch):
    """Compute the negative residuals of an impulse-momentum step, and the acceleration at its end.

    Displacement, velocity and acceleration of the floors are u0, v0, a0 at the start and u1, v1, a1
    at the end of the step. The acceleration a1 follows from equilibrium (row A1), and

        M a1 = p1 - C v1 - f(u1)
        R1   = M (h ((1 - theta) v0 + theta v1) + h^2 (alpha a0 - beta a1) - (u1 - u0))   kinematics
        R2   = I - M (v1 - v0) - C (u1 - u0) - S                                          momentum

    with the load p1 at the end, its impulse I over the step, the restoring force f and its impulse
    S. C contains the floor dampers and modal damping; the forces of story dampers are part of f and
    S.

    Parameters
    ----------
    theta, alpha, beta : float
        Coefficients of the kinematic equation.
    scratch : ndarray
        The following rows are used: LOAD, p1 (N); IMPULSE, I (N s); DU, u1 - u0 (m); DV, v1 - v0
        (m/s); V1, v1 (m/s); FORCE_1 and FORCE_S, force at the end (N) and impulse (N s) of each
        story. Rows R1 (kg m), R2 (N s) and A1 (m/s^2) are set.
    """
    n = linear_terms.shape[1] - 1
    # Compute M a1 (row A1) and R2 without modal damping.
    for i in range(n):
        link = linear_terms[rows.LINK, i + 1]  # 1 if there is a story on floor `i`
        # The net force and the net impulse on the floor are the differences between the stories
        # below and above.
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
    # Add modal damping to M a1 and R2. Then compute a1 and R1.
    add_modal_force(modal, scratch, V1, -1.0, scratch, A1, n)
    add_modal_force(modal, scratch, DU, -1.0, scratch, R2, n)
    for i in range(n):
        scratch[A1, i] *= linear_terms[rows.INVERSE_MASS, i]
        # Compute the terms of the kinematic equation with velocities and accelerations, m.
        velocity_terms = h * ((1.0 - theta) * state[rows.VELOCITY, i] + theta * scratch[V1, i])
        acceleration_terms = h * h * (alpha * state[rows.ACCELERATION, i] - beta * scratch[A1, i])
        scratch[R1, i] = linear_terms[rows.MASS, i] * (
            velocity_terms + acceleration_terms - scratch[DU, i]
        )


@inline
def has_converged(is_last, tolerance, beta, linear_terms, h, state, scratch, step_status):
    """Return True if the residuals of kinematics and momentum of all floors are small enough.

    A residual is small enough if it is at most `tolerance` times the sum of the absolute values of
    the terms of its equation. Each floor has two equations: kinematics, multiplied by its mass,

        M (u1 - u0) = M (h ((1 - theta) v0 + theta v1) + h^2 (alpha a0 - beta a1))

    and momentum,

        M (v1 - v0) + C (u1 - u0) + S = I

    Displacement, velocity and acceleration are u0, v0, a0 at the start and u1, v1, a1 at the end of
    the step. I is the impulse of the load and S the impulse of the stories, including story
    dampers. The sums differ from the equations in two points:

    - The coefficients 1 - theta, theta and alpha are replaced by 1.
    - C (floor dampers and modal damping) is omitted, so that the requirement is slightly stricter.

    In addition, residuals below the effect of the rounding errors of the displacements are always
    small enough. These errors change a story force by F_r; row SIZE contains F_r divided by
    RESIDUAL_TOLERANCE. A force has the factor beta h^2 in the kinematic equation and h in the
    momentum equation. Row SIZE is therefore added to the sums with these factors. The sums are
    multiplied by `tolerance`, which is at least RESIDUAL_TOLERANCE, so that at least the effect of
    F_r is admitted.

    Parameters
    ----------
    is_last : bool
        True if no further iteration is allowed. The largest relative residual above the tolerance
        is then stored in `step_status`.
    tolerance : float
        Maximum relative residual, at least RESIDUAL_TOLERANCE.
    beta : float
        Coefficient of a1 in the kinematic equation, positive: 1/12 to 1/6.
    scratch : ndarray
        The following rows are used: residuals R1 (kinematics, kg m) and R2 (momentum, N s); DU,
        u1 - u0 (m); DV, v1 - v0 (m/s); V1, v1 (m/s); A1, a1 (m/s^2); IMPULSE, I (N s); FORCE_S, the
        part of S of each story (N s); SIZE (N).
    step_status : ndarray
        Row RESIDUAL is set to 0, or to the largest relative residual if `is_last` is True and a
        residual is too large; row WORST_STORY then receives its floor.
    """
    n = linear_terms.shape[1] - 1
    by_a = beta * h * h
    step_status[rows.RESIDUAL] = 0.0
    is_small = True
    for i in range(n):
        link = linear_terms[rows.LINK, i + 1]  # 1 if there is a story on floor `i`
        mass = linear_terms[rows.MASS, i]
        # `rounding` is the effect of the rounding errors of the displacements on the forces of the
        # stories below and above the floor, divided by RESIDUAL_TOLERANCE, N.
        rounding = scratch[SIZE, i] + link * scratch[SIZE, i + 1]
        # `scale` is the sum of the absolute values of the terms: first of the kinematic equation
        # (m, without the factor mass), then of the momentum equation (N s).
        scale = abs(scratch[DU, i]) + h * (abs(state[rows.VELOCITY, i]) + abs(scratch[V1, i]))
        scale += h * h * abs(state[rows.ACCELERATION, i]) + by_a * abs(scratch[A1, i])
        is_small &= is_balanced(
            is_last, tolerance, step_status, i, scratch[R1, i], mass * scale + by_a * rounding
        )
        scale = abs(scratch[IMPULSE, i]) + abs(mass * scratch[DV, i]) + h * rounding
        scale += abs(scratch[FORCE_S, i]) + link * abs(scratch[FORCE_S, i + 1])
        is_small &= is_balanced(is_last, tolerance, step_status, i, scratch[R2, i], scale)
    return is_small


@inline
def correct(beta, modal, h, factors, n):
    """Solve for the corrections of Newton's method and add them to the increments u1 - u0 and v1 -
    v0.

    Rows R1 and R2 of the scratch array contain the negative residuals of kinematics and momentum,
    and receive the corrections of rows DU (m) and DV (m/s). The kinematic equation of a floor with
    the mass M is

        M (u1 - u0) = M (h ((1 - theta) v0 + theta v1) + h^2 (alpha a0 - beta a1))
        M a1 = p1 - C v1 - f(u1)

    and its momentum equation, with the impulses S of the story forces and I of the load, is

        M (v1 - v0) + C (u1 - u0) + S = I

    with displacement, velocity and acceleration u0, v0, a0 at the start and u1, v1, a1 at the end
    of the step, the load p1 at the end and the restoring force f. The damping matrix C contains the
    floor dampers and modal damping.

    Parameters
    ----------
    beta : float
        Coefficient of a1 in the kinematic equation.
    factors : Factors
        Scratch array and the rows of the factorization of the matrix (`factor_blocks`). Row U1
        contains the displacements u1 before the correction, m.

    Returns
    -------
    bool
        True if the corrections of the displacements are of the order of rounding errors, relative
        to u1 of each floor. This test supplements the test of the residuals (`has_converged`): if
        u1 of a floor is zero, only the test of the residuals ends the iteration.
    """
    scratch = factors.table
    # If all terms with unknowns are on the left side, the kinematic equation contains
    # +beta h^2 M a1 and therefore -beta h^2 C v1. The momentum equation contains C (u1 - u0). The
    # modal part of C has the factor -beta h^2 for v1 in the first equation, and the factor 1 for u1
    # in the second equation.
    solve_blocks_damped(factors, ModalBlocks(modal, 0.0, -beta * h * h, 1.0, 0.0), R1, R2, n)
    is_small = True
    for i in range(n):
        scratch[DU, i] += scratch[R1, i]
        scratch[DV, i] += scratch[R2, i]
        is_small = is_small and abs(scratch[R1, i]) <= ROUNDING * abs(scratch[U1, i])
    return is_small
