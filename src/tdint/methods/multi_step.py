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

from tdint.kernels import layout as at
from tdint.kernels.compiling import inlined, kernel
from tdint.kernels.equations.newton import BALANCE_ROWS, ROW, balance, factor_rows, forget
from tdint.kernels.linear_terms import finite, floor_load
from tdint.kernels.stepping import STEP, Memory, Scene, Weights
from tdint.kernels.stories.law_state import commit
from tdint.methods.method import Family, Method

# Coefficients: V, W, B, three each
V_BY_W = 0
A_BY_W = 3
A_BY_B = 6

# Rows of the state beyond u, v, a: means over the last step and over the one before it
MEAN_VELOCITY = at.FIRST_OLDER
OLDER_MEAN_VELOCITY = at.FIRST_OLDER + 1
MEAN_ACCELERATION = at.FIRST_OLDER + 2
OLDER_MEAN_ACCELERATION = at.FIRST_OLDER + 3

# Rows of work behind those of the balance
_W = BALANCE_ROWS  # first guess of the mean velocity
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
    springs,
    work,
    report,
):
    """One step of the family, of average acceleration for the first two."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, springs, work, report)
    n = linear_terms.shape[1] - 1
    c = coefficients
    if report[at.STEPS_DONE] < START:
        by_w = 0.25 * h
        by_v = 0.5 * h
        by_a = 1.0
        _guess_start(h, state, work, n)
    else:
        by_w = h
        by_v = c[V_BY_W] * h
        by_a = c[A_BY_W] + c[A_BY_B] * c[V_BY_W]
        _guess(c, h, state, work, n)
    if report[at.FACTORED_STEP] != by_v:  # tells h, and the start from what follows
        forget(work, _FACTORS, n)
        report[at.FACTORED_STEP] = by_v
    floor_load(linear_terms, forces, load[at.TIME] + h, load[at.GROUND_1], work, ROW.LOAD)
    code = balance(Weights(h * by_w, by_v, by_a), _FACTORS, 0, at.FIRST_TRIAL, scene, memory)
    if code < 0:
        return code
    for i in range(n):
        state[OLDER_MEAN_VELOCITY, i] = state[MEAN_VELOCITY, i]
        state[OLDER_MEAN_ACCELERATION, i] = state[MEAN_ACCELERATION, i]
        state[MEAN_VELOCITY, i] = work[_W, i] + by_w * work[ROW.X, i]
        state[MEAN_ACCELERATION, i] = (work[ROW.V, i] - state[at.VELOCITY, i]) / h
        state[at.DISPLACEMENT, i] = work[ROW.U, i]
        state[at.VELOCITY, i] = work[ROW.V, i]
        state[at.ACCELERATION, i] = work[ROW.A, i]
        commit(law_parameters, springs, i, 0, at.FIRST_TRIAL)
    return code if finite(state, n) else at.NOT_FINITE


@inlined
def _guess_start(h, state, work, n):
    """First guess of average acceleration: the acceleration stays; x is its change."""
    for i in range(n):
        v = state[at.VELOCITY, i]
        a = state[at.ACCELERATION, i]
        work[_W, i] = v + 0.5 * h * a
        work[ROW.U, i] = state[at.DISPLACEMENT, i] + h * work[_W, i]
        work[ROW.V, i] = v + h * a
        work[ROW.A, i] = a


@inlined
def _guess(c, h, state, work, n):
    """First guess: the mean velocity goes on changing as it did; x is its further change over h."""
    for i in range(n):
        w0 = state[MEAN_VELOCITY, i]
        older = state[OLDER_MEAN_VELOCITY, i]
        w = 2.0 * w0 - older
        v = c[V_BY_W] * w + c[V_BY_W + 1] * w0 + c[V_BY_W + 2] * older
        b = (v - state[at.VELOCITY, i]) / h
        work[_W, i] = w
        work[ROW.U, i] = state[at.DISPLACEMENT, i] + h * w
        work[ROW.V, i] = v
        work[ROW.A, i] = (
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
        family=_family(at.DISPLACEMENT, *_OF_VELOCITY),
        coefficients=lambda: (*_BACKWARD, *_SECOND, *_NONE),
        rho_inf=lambda: 0.0,
        source="Houbolt (1950), started by two steps of average acceleration",
    ),
    Method(
        name="park",
        family=_family(at.DISPLACEMENT, *_OF_VELOCITY, at.VELOCITY, *_OF_ACCELERATION),
        coefficients=lambda: (*_PARK, *_NONE, *_PARK),
        rho_inf=lambda: 0.0,
        source="Park (1975), started by two steps of average acceleration",
    ),
)
