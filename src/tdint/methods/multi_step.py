"""Multi-step methods: velocity and acceleration from differences over three steps, equilibrium at
the end.

With the mean velocity w1 = (u1 - u0) / h and the mean acceleration b1 = (v1 - v0) / h of the step,
and those of the two steps before it, w0, w_ and b0, b_, the formulas of Houbolt (1950) and Park
(1975) are sums with three weights each:

    v1 = V . (w1, w0, w_)
    a1 = W . (w1, w0, w_) / h + B . (b1, b0, b_)
    M a1 + C v1 + f(u1) = p1

The state keeps the means in the place of older displacements and velocities. That is the same
memory, but small steps do not drown in rounding: differences of displacements would put an error of
rounding(u) / h^2 into each acceleration. Where the ground's acceleration jumps by j between two
steps, the means become those of a past under the new one, which is u + j t^2 / 2 before the jump at
t = 0. The first two steps are average acceleration (Newmark 1959), which keeps order 2 in u, v and
a; so are the pieces of a step that was halved because it did not converge, and the two steps after
it.
"""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, kernel
from tdint.kernels.equations.newton import (
    EQUILIBRIUM_ROWS,
    ROW,
    factor_rows,
    invalidate,
    solve_equilibrium,
)
from tdint.kernels.linear_terms import finite, floor_load
from tdint.kernels.stepping import STEP, EffectiveCoefficients, Memory, Scene
from tdint.kernels.stories.law_state import commit
from tdint.methods.method import Family, Method

# Coefficients: V, W, B, three each
V_BY_W = 0
A_BY_W = 3
A_BY_B = 6

# Rows of the state beyond u, v, a: means over the last step and over the one before it
MEAN_VELOCITY = rows.FIRST_OLDER
OLDER_MEAN_VELOCITY = rows.FIRST_OLDER + 1
MEAN_ACCELERATION = rows.FIRST_OLDER + 2
OLDER_MEAN_ACCELERATION = rows.FIRST_OLDER + 3

# Rows of work behind those of the balance
_W = EQUILIBRIUM_ROWS  # first guess of the mean velocity
_FACTORS = _W + 1

START = 2
"""Steps of average acceleration before the first multi-step."""


@kernel(STEP)
def step(
    coefficients,
    linear_terms,
    modal,
    law_parameters,
    forces,
    flags,
    h,
    load,
    state,
    law_state,
    scratch,
    step_status,
):
    """One step of the family, of average acceleration for the first two."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    n = linear_terms.shape[1] - 1
    c = coefficients
    if step_status[rows.STEPS_DONE] < START:
        by_w = 0.25 * h
        by_v = 0.5 * h
        by_a = 1.0
        _guess_start(h, state, scratch, n)
    else:
        by_w = h
        by_v = c[V_BY_W] * h
        by_a = c[A_BY_W] + c[A_BY_B] * c[V_BY_W]
        _guess(c, h, state, scratch, n)
    if step_status[rows.FACTORED_STEP] != by_v:  # tells h, and the start from what follows
        invalidate(scratch, _FACTORS, n)
        step_status[rows.FACTORED_STEP] = by_v
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, ROW.LOAD)
    code = solve_equilibrium(
        EffectiveCoefficients(h * by_w, by_v, by_a), _FACTORS, 0, rows.FIRST_TRIAL, scene, memory
    )
    if code < 0:
        return code
    for i in range(n):
        state[OLDER_MEAN_VELOCITY, i] = state[MEAN_VELOCITY, i]
        state[OLDER_MEAN_ACCELERATION, i] = state[MEAN_ACCELERATION, i]
        state[MEAN_VELOCITY, i] = scratch[_W, i] + by_w * scratch[ROW.X, i]
        state[MEAN_ACCELERATION, i] = (scratch[ROW.V, i] - state[rows.VELOCITY, i]) / h
        state[rows.DISPLACEMENT, i] = scratch[ROW.U, i]
        state[rows.VELOCITY, i] = scratch[ROW.V, i]
        state[rows.ACCELERATION, i] = scratch[ROW.A, i]
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
    return code if finite(state, n) else rows.NOT_FINITE


@inline
def _guess_start(h, state, scratch, n):
    """First guess of average acceleration: the acceleration stays; x is its change."""
    for i in range(n):
        v = state[rows.VELOCITY, i]
        a = state[rows.ACCELERATION, i]
        scratch[_W, i] = v + 0.5 * h * a
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + h * scratch[_W, i]
        scratch[ROW.V, i] = v + h * a
        scratch[ROW.A, i] = a


@inline
def _guess(c, h, state, scratch, n):
    """First guess: the mean velocity goes on changing as it did; x is its further change over h."""
    for i in range(n):
        w0 = state[MEAN_VELOCITY, i]
        older = state[OLDER_MEAN_VELOCITY, i]
        w = 2.0 * w0 - older
        v = c[V_BY_W] * w + c[V_BY_W + 1] * w0 + c[V_BY_W + 2] * older
        b = (v - state[rows.VELOCITY, i]) / h
        scratch[_W, i] = w
        scratch[ROW.U, i] = state[rows.DISPLACEMENT, i] + h * w
        scratch[ROW.V, i] = v
        scratch[ROW.A, i] = (
            (c[A_BY_W] * w + c[A_BY_W + 1] * w0 + c[A_BY_W + 2] * older) / h
            + c[A_BY_B] * b
            + c[A_BY_B + 1] * state[MEAN_ACCELERATION, i]
            + c[A_BY_B + 2] * state[OLDER_MEAN_ACCELERATION, i]
        )


def _family(*memory: int) -> Family:
    return Family(
        "multi-step",
        step,
        lambda modes: _FACTORS + factor_rows(modes),
        memory=memory,
        state_rows=OLDER_MEAN_ACCELERATION + 1,
        derivatives=(0, 1, 2, 1, 1, 2, 2),
        shifts=(0.0, 0.0, 1.0, -0.5, -1.5, 1.0, 1.0),
    )


_BACKWARD = (11.0 / 6.0, -7.0 / 6.0, 2.0 / 6.0)  # the derivative of the cubic through four points
_SECOND = (2.0, -3.0, 1.0)  # its second derivative
_PARK = (
    10.0 / 6.0,
    -5.0 / 6.0,
    1.0 / 6.0,
)  # the mean of _BACKWARD and of the parabola through three points
_NONE = (0.0, 0.0, 0.0)
_OF_VELOCITY = (MEAN_VELOCITY, OLDER_MEAN_VELOCITY)
_OF_ACCELERATION = (MEAN_ACCELERATION, OLDER_MEAN_ACCELERATION)

METHODS = (
    Method(
        name="houbolt",
        family=_family(rows.DISPLACEMENT, *_OF_VELOCITY),
        coefficients=lambda: (*_BACKWARD, *_SECOND, *_NONE),
        rho_inf=lambda: 0.0,
        source="Houbolt (1950), started by two steps of average acceleration",
    ),
    Method(
        name="park",
        family=_family(rows.DISPLACEMENT, *_OF_VELOCITY, rows.VELOCITY, *_OF_ACCELERATION),
        coefficients=lambda: (*_PARK, *_NONE, *_PARK),
        rho_inf=lambda: 0.0,
        source="Park (1975), started by two steps of average acceleration",
    ),
)
