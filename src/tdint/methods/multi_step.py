"""Multi-step methods of Houbolt (1950) and Park (1975): backward differences over three steps.

The unknowns of a step of length h are the displacement u1, velocity v1 and acceleration a1 at its
end. Let w1 = (u1 - u0) / h be the mean velocity and b1 = (v1 - v0) / h the mean acceleration of the
step; w0, b0 the means of the previous step, and w_, b_ of the step before. Both methods are

    v1 = V . (w1, w0, w_)
    a1 = W . (w1, w0, w_) / h + B . (b1, b0, b_)
    M a1 + C v1 + f(u1) = p1

with three weights in each of V, W and B.

The state contains the means instead of displacements and velocities of previous steps. Differences
of displacements would cause an error of the order of rounding(u) / h^2 in each acceleration, which
dominates for small steps.

If the ground acceleration jumps by j between two steps (a step that is longer than the sampling
interval), the means are replaced by the means of a motion that had the new acceleration before the
jump, u + j t^2 / 2 with the jump at t = 0.

The first two steps use average acceleration (Newmark 1959), which preserves order 2 in u, v and a.
The parts of a step that was halved because it did not converge, and the two steps after it, use
average acceleration as well.
"""

from __future__ import annotations

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
from tdint.kernels.stories.law_state import commit, restoring_force_outlined
from tdint.methods.method import Family, Method

# Index of the first of the three coefficients of V, W and B: the weights of the mean velocities in
# the velocity and in the acceleration, and of the mean accelerations in the acceleration
V_BY_W = 0
A_BY_W = 3
A_BY_B = 6

# Rows of the state after displacement, velocity and acceleration: mean velocity (m/s) and mean
# acceleration (m/s^2) over the last step, and over the step before it (OLDER)
MEAN_VELOCITY = rows.FIRST_OLDER
OLDER_MEAN_VELOCITY = rows.FIRST_OLDER + 1
MEAN_ACCELERATION = rows.FIRST_OLDER + 2
OLDER_MEAN_ACCELERATION = rows.FIRST_OLDER + 3

# Scratch rows that follow the rows of `solve_equilibrium`
_GUESSED_MEAN_VELOCITY = EQUILIBRIUM_ROWS  # first guess of the mean velocity, m/s
_FACTORS = _GUESSED_MEAN_VELOCITY + 1  # first row of the factorization

START = 2
"""Number of steps with average acceleration before the first step with the multi-step formulas."""


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Integrate the equations of motion over one time step of Houbolt's or Park's method.

    `solve_equilibrium` computes an unknown x (m/s^2) for each floor. The response at the end is a
    first guess plus x times constants. With average acceleration, x is the change of the
    acceleration over the step. With the multi-step formulas, h x is the correction of the guessed
    mean velocity w1.
    """
    linear_terms, _, law_parameters, forces, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    weights = coefficients
    # by_w, by_v and by_a are the changes of mean velocity, velocity and acceleration per unit of x.
    if step_status[rows.STEPS_DONE] < START:
        by_w = 0.25 * h  # u1 changes by h^2 x / 4
        by_v = 0.5 * h
        by_a = 1.0
        by_force = 2.0 / h
        _guess_average_acceleration(h, state, scratch, n)
    else:
        # With the first weights V_1, W_1, B_1 of V, W and B, x changes w1 by h x, v1 by V_1 h x, b1
        # by V_1 x and a1 by (W_1 + B_1 V_1) x.
        by_w = h
        by_v = weights[V_BY_W] * h
        by_a = weights[A_BY_W] + weights[A_BY_B] * weights[V_BY_W]
        by_force = weights[V_BY_W] / h
        _guess_multi_step(weights, h, state, scratch, n)
    if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
        _predict_tangent_damping(weights, by_force, linear_terms, memory)
    if step_status[rows.FACTORED_STEP] != by_v:
        # by_v identifies the matrix: its value changes with h, and between average acceleration and
        # the multi-step formulas.
        invalidate(scratch, _FACTORS, n)
        step_status[rows.FACTORED_STEP] = by_v
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, ROW.LOAD)
    damper_step = DamperStep(h, 1.0, 0.0, by_force)
    code = solve_equilibrium_with_dampers(
        damper_step,
        EffectiveCoefficients(h * by_w, by_v, by_a),
        _FACTORS,
        0,
        rows.FIRST_TRIAL,
        scene,
        memory,
    )
    if code < 0:
        return code
    for i in range(n):
        state[OLDER_MEAN_VELOCITY, i] = state[MEAN_VELOCITY, i]
        state[OLDER_MEAN_ACCELERATION, i] = state[MEAN_ACCELERATION, i]
        state[MEAN_VELOCITY, i] = scratch[_GUESSED_MEAN_VELOCITY, i] + by_w * scratch[ROW.X, i]
        state[MEAN_ACCELERATION, i] = (scratch[ROW.V, i] - state[rows.VELOCITY, i]) / h
        state[rows.DISPLACEMENT, i] = scratch[ROW.U, i]
        state[rows.VELOCITY, i] = scratch[ROW.V, i]
        state[rows.ACCELERATION, i] = scratch[ROW.A, i]
        if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
            _commit_with_tangent_damping(damper_step, i, scene, memory)
        else:
            commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
    return code if finite(state, n) else rows.NOT_FINITE


@inline
def _guess_average_acceleration(h, state, scratch, n):
    """Store the first guess of a step with average acceleration: a constant acceleration."""
    for i in range(n):
        v = state[rows.VELOCITY, i]
        a = state[rows.ACCELERATION, i]
        scratch[_GUESSED_MEAN_VELOCITY, i] = v + 0.5 * h * a
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + h * scratch[_GUESSED_MEAN_VELOCITY, i]
        scratch[ROW.V, i] = v + h * a
        scratch[ROW.A, i] = a


@inline
def _guess_multi_step(coefficients, h, state, scratch, n):
    """Store the first guess of a multi-step method: the mean velocity is extrapolated linearly, w1
    = 2 w0 - w_.
    """
    for i in range(n):
        w0 = state[MEAN_VELOCITY, i]
        older_w = state[OLDER_MEAN_VELOCITY, i]
        w = 2.0 * w0 - older_w
        v = (
            coefficients[V_BY_W] * w
            + coefficients[V_BY_W + 1] * w0
            + coefficients[V_BY_W + 2] * older_w
        )
        b = (v - state[rows.VELOCITY, i]) / h
        scratch[_GUESSED_MEAN_VELOCITY, i] = w
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + h * w
        scratch[ROW.V, i] = v
        scratch[ROW.A, i] = (
            (
                coefficients[A_BY_W] * w
                + coefficients[A_BY_W + 1] * w0
                + coefficients[A_BY_W + 2] * older_w
            )
            / h
            + coefficients[A_BY_B] * b
            + coefficients[A_BY_B + 1] * state[MEAN_ACCELERATION, i]
            + coefficients[A_BY_B + 2] * state[OLDER_MEAN_ACCELERATION, i]
        )


@outlined
def _predict_tangent_damping(weights, by_force, linear_terms, memory):
    """Store the part of the forces of tangent damping at the end of the step that is known (row
    DAMPING_BASE, N).

    With average acceleration, the forces D of the damping and f of the law satisfy a1 (f1 - f0) = h
    (D0 + D1) / 2. With the multi-step formulas, D1 = a1 V . (g1, g0, g_) with the mean rates g of f
    over the last three steps, as the velocity follows from the mean velocities. In both cases, the
    impulses of the damping are exact (see `tdint.methods.bathe`).
    """
    state = memory.state
    for i in range(linear_terms.shape[1] - 1):
        coefficient = linear_terms[rows.TANGENT_DAMPING, i]
        if memory.step_status[rows.STEPS_DONE] < START:
            known = -state[rows.DAMPING_STATE, i]
        else:
            known = weights[V_BY_W + 1] * state[rows.FORCE_RATE, i]
            known += weights[V_BY_W + 2] * state[rows.OLDER_FORCE_RATE, i]
            known *= coefficient
        memory.scratch[ROW.DAMPING_BASE, i] = (
            known - by_force * coefficient * memory.law_state[rows.FORCE, i]
        )


@outlined
def _commit_with_tangent_damping(damper_step, i, scene, memory):
    """Commit the law of story `i` with its tangent damping, and shift the rates of its force."""
    law_parameters, law_state, state = scene.law_parameters, memory.law_state, memory.state
    trial = rows.FIRST_TRIAL
    # The law is evaluated again, because its tangent has not been stored.
    slope = restoring_force_outlined(
        law_parameters, law_state, i, 0, trial, law_state[trial + rows.DRIFT, i]
    )
    rate = (law_state[trial + rows.FORCE, i] - law_state[rows.FORCE, i]) / damper_step.h
    work = rate * (law_state[trial + rows.DRIFT, i] - law_state[rows.DRIFT, i])
    commit(law_parameters, law_state, i, 0, trial)
    state[rows.OLDER_FORCE_RATE, i] = state[rows.FORCE_RATE, i]
    state[rows.FORCE_RATE, i] = rate
    commit_tangent_damping(damper_step, 1.0, work, slope, i, scene.linear_terms, memory)


def _family(*memory: int) -> Family:
    """Return the family of the multi-step methods, with the independent rows of the state
    (`memory`).

    The independent rows are the rows that the formulas of the method use: Houbolt's method does not
    use the velocity and the mean accelerations. `derivatives` contains the order of the
    displacement derivative in each row of the state. `shifts` is its change at a jump of 1 of the
    acceleration, divided by h^(2 - derivative):

        row of the state                      change    shifts
        displacement, velocity at t = 0       0         0
        acceleration at t = 0                 1         1
        mean velocity of the last step        -h/2      -1/2
        mean velocity of the step before      -3 h/2    -3/2
        mean accelerations of both steps      1         1

    The motion t^2 / 2 is added to the previous two steps (t < 0) as if the new acceleration had
    already acted (`state_jumps`).
    """
    return Family(
        "multi-step",
        step,
        lambda modes: _FACTORS + factor_rows(modes),
        memory=memory,
        state_rows=OLDER_MEAN_ACCELERATION + 1,
        derivatives=(0, 1, 2, 1, 1, 2, 2),
        shifts=(0.0, 0.0, 1.0, -0.5, -1.5, 1.0, 1.0),
    )


# Weights of the mean slopes over the last three steps, the last step first, in a derivative at the
# end: the first and second derivative of the cubic through the last four points (Houbolt), and the
# average of the first derivatives of the cubic and of the parabola through three points (Park)
_BACKWARD = (11.0 / 6.0, -7.0 / 6.0, 2.0 / 6.0)
_SECOND_BACKWARD = (2.0, -3.0, 1.0)
_PARK = (10.0 / 6.0, -5.0 / 6.0, 1.0 / 6.0)
_NO_COEFFICIENTS = (0.0, 0.0, 0.0)
_VELOCITY_ROWS = (MEAN_VELOCITY, OLDER_MEAN_VELOCITY)
_ACCELERATION_ROWS = (MEAN_ACCELERATION, OLDER_MEAN_ACCELERATION)

METHODS = (
    Method(
        name="houbolt",
        family=_family(rows.DISPLACEMENT, *_VELOCITY_ROWS),
        coefficients=lambda: (*_BACKWARD, *_SECOND_BACKWARD, *_NO_COEFFICIENTS),
        rho_inf=lambda: 0.0,
        source="Houbolt (1950), started by two steps of average acceleration",
        tangent_damping=lambda: True,
    ),
    Method(
        name="park",
        family=_family(rows.DISPLACEMENT, *_VELOCITY_ROWS, rows.VELOCITY, *_ACCELERATION_ROWS),
        coefficients=lambda: (*_PARK, *_NO_COEFFICIENTS, *_PARK),
        rho_inf=lambda: 0.0,
        source="Park (1975), started by two steps of average acceleration",
        tangent_damping=lambda: True,
    ),
)
