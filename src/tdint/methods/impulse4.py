"""The impulse-momentum step with the restoring force and the load integrated: order 4, dissipation by rho_inf.

    kinematics  u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
    momentum    M (v1 - v0) + C (u1 - u0) + S = I
    equilibrium M a1 + C v1 + f(u1) = p1

I is the exact impulse of the load. S = h (w0 f0 + wc f(uc) + w1 f1) integrates the restoring force with a point inside
the step, uc = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1) at the fraction c. In a linear building the step is the Pade
approximation of the exponential with denominator of degree 2: (2,2) for rho_inf = 1, order 4; (1,2), that is Radau IIA,
for rho_inf = 0; order 3 in between. The tests derive the coefficients again.
"""

from __future__ import annotations

import math

from tdint.kernels.chain import add_modal_force, finite, floor_impulse, floor_load
from tdint.kernels.compiling import inlined, kernel
from tdint.kernels.layout import (
    ACCELERATION,
    DISPLACEMENT,
    DRIFT,
    FACTORED_STEP,
    FIRST_TRIAL,
    FLOOR_DAMPER,
    FORCE,
    GEOMETRIC,
    GROUND_0,
    GROUND_1,
    INVERSE_MASS,
    LINEAR,
    LINK,
    MASS,
    NOT_FINITE,
    RESIDUAL,
    SECOND_TRIAL,
    STIFFNESS,
    STORY_DAMPER,
    TIME,
    VELOCITY,
)
from tdint.kernels.springs import commit, restoring, settle
from tdint.kernels.stepping import ITERATIONS, SAME_TANGENT, SMALL, STEP, balanced, give_up
from tdint.kernels.tridiagonal import assemble_blocks, factor_blocks, solve_blocks_damped
from tdint.methods.method import Family, Method, Parameter

# Coefficients
THETA = 0
ALPHA = 1
BETA = 2
WEIGHT_0 = 3
WEIGHT_C = 4
WEIGHT_1 = 5
BY_INCREMENT = 6  # gd
BY_VELOCITY_0 = 7  # g0
BY_VELOCITY_1 = 8  # g1

# Rows of work
_LOAD = 0
_IMPULSE = 1
_DU = 2
_DV = 3
_U1 = 4
_V1 = 5
_A1 = 6
_FORCE_1 = 7  # story force at the end, damper included
_FORCE_S = 8  # story impulse, damper included
_R1 = 9
_R2 = 10
_TANGENT_C = 11
_TANGENT_1 = 12
_FACTORED_C = 13
_FACTORED_1 = 14
_BLOCKS = 15
_COUPLING = 19
_STORE = 23


def work_rows(modes: int) -> int:
    """Rows of work that the step needs for a building with `modes` modally damped modes."""
    return _STORE + 6 * modes + 1


@kernel(STEP)
def step(coefficients, chain, modal, laws, forces, h, load, state, springs, work, memo):
    """One step; Newton on all stories at once, unknowns (u1 - u0, v1 - v0) per floor, a1 eliminated by equilibrium."""
    n = chain.shape[1] - 1
    by_a = coefficients[BETA] * h * h
    _predict(chain, forces, h, load, state, work, memo)
    iterations = 0
    while True:
        stale = _path(coefficients, chain, laws, h, state, springs, work, memo)
        if _in_balance(coefficients, chain, modal, h, state, work, memo):
            break
        if iterations == ITERATIONS:
            return give_up(memo)
        if stale:
            _factor(coefficients, chain, modal, h, work)
            memo[FACTORED_STEP] = h
        solve_blocks_damped(work, _BLOCKS, _COUPLING, modal, 0.0, -by_a, 1.0, 0.0, _STORE, _R1, _R2, n)
        iterations += 1
        small = True
        for i in range(n):
            work[_DU, i] += work[_R1, i]
            work[_DV, i] += work[_R2, i]
            small = small and abs(work[_R1, i]) <= SMALL * abs(work[_U1, i])
        if small or (memo[LINEAR] != 0.0 and iterations > 0):
            _path(coefficients, chain, laws, h, state, springs, work, memo)
            _in_balance(coefficients, chain, modal, h, state, work, memo)
            break
    return _finish(chain, laws, state, springs, work, max(iterations, 1))


@inlined
def _predict(chain, forces, h, load, state, work, memo):
    """Load and impulse of the step; constant acceleration as the first guess.

    In a linear building any guess will do; no increment is the one that rounds least where omega h is large.
    """
    floor_load(chain, forces, load[TIME] + h, load[GROUND_1], work, _LOAD)
    floor_impulse(chain, forces, load[TIME], h, load[GROUND_0], load[GROUND_1], work, _IMPULSE)
    guess = 0.0 if memo[LINEAR] != 0.0 else 1.0
    for i in range(chain.shape[1] - 1):
        a = guess * state[ACCELERATION, i]
        work[_DU, i] = guess * h * state[VELOCITY, i] + 0.5 * h * h * a
        work[_DV, i] = h * a


@inlined
def _path(coefficients, chain, laws, h, state, springs, work, memo):
    """Drift laws along the step: at the inner point and from there to the end.

    Leaves the story forces at the end and the story impulses. True if the factorization does not fit the tangents.
    """
    n = chain.shape[1] - 1
    stale = memo[FACTORED_STEP] != h
    uc_below = 0.0
    u_below = 0.0
    v_below = 0.0
    du_below = 0.0
    for i in range(n):
        du = work[_DU, i]
        u = state[DISPLACEMENT, i] + du
        v = state[VELOCITY, i] + work[_DV, i]
        uc = (
            state[DISPLACEMENT, i]
            + coefficients[BY_INCREMENT] * du
            + h * (coefficients[BY_VELOCITY_0] * state[VELOCITY, i] + coefficients[BY_VELOCITY_1] * v)
        )
        work[_U1, i] = u
        work[_V1, i] = v
        link = chain[LINK, i]
        drift_c = uc - link * uc_below
        drift = u - link * u_below
        increment = du - link * du_below
        rate = v - link * v_below
        uc_below = uc
        u_below = u
        v_below = v
        du_below = du
        tangent_c = restoring(laws, springs, i, 0, FIRST_TRIAL, drift_c)
        tangent = restoring(laws, springs, i, FIRST_TRIAL, SECOND_TRIAL, drift)
        work[_TANGENT_C, i] = tangent_c
        work[_TANGENT_1, i] = tangent
        same = SAME_TANGENT * laws[STIFFNESS, i]
        stale = stale or abs(tangent_c - work[_FACTORED_C, i]) > same or abs(tangent - work[_FACTORED_1, i]) > same
        geometric = chain[GEOMETRIC, i]
        mean = (
            coefficients[WEIGHT_0] * (springs[FORCE, i] + geometric * springs[DRIFT, i])
            + coefficients[WEIGHT_C] * (springs[FIRST_TRIAL + FORCE, i] + geometric * drift_c)
            + coefficients[WEIGHT_1] * (springs[SECOND_TRIAL + FORCE, i] + geometric * drift)
        )
        damper = chain[STORY_DAMPER, i]
        work[_FORCE_1, i] = springs[SECOND_TRIAL + FORCE, i] + geometric * drift + damper * rate
        work[_FORCE_S, i] = h * mean + damper * increment
    return stale


@inlined
def _in_balance(coefficients, chain, modal, h, state, work, memo):
    """Minus the residuals of kinematics (times M) and momentum into their rows. Whether all are small."""
    n = chain.shape[1] - 1
    theta = coefficients[THETA]
    for i in range(n):
        link = chain[LINK, i + 1]
        force = work[_FORCE_1, i] - link * work[_FORCE_1, i + 1]
        work[_A1, i] = work[_LOAD, i] - chain[FLOOR_DAMPER, i] * work[_V1, i] - force
        impulse = work[_FORCE_S, i] - link * work[_FORCE_S, i + 1]
        work[_R2, i] = (
            work[_IMPULSE, i] - chain[MASS, i] * work[_DV, i] - chain[FLOOR_DAMPER, i] * work[_DU, i] - impulse
        )
    add_modal_force(modal, work, _V1, -1.0, work, _A1, n)
    add_modal_force(modal, work, _DU, -1.0, work, _R2, n)
    memo[RESIDUAL] = 0.0
    small = True
    for i in range(n):
        work[_A1, i] *= chain[INVERSE_MASS, i]
        by_v = h * ((1.0 - theta) * state[VELOCITY, i] + theta * work[_V1, i])
        by_a = h * h * (coefficients[ALPHA] * state[ACCELERATION, i] - coefficients[BETA] * work[_A1, i])
        gap = by_v + by_a - work[_DU, i]
        work[_R1, i] = chain[MASS, i] * gap
        small = balanced(memo, i, gap, abs(by_v) + abs(by_a) + abs(work[_DU, i])) and small
        scale = abs(work[_IMPULSE, i]) + abs(chain[MASS, i] * work[_DV, i])
        scale += abs(work[_FORCE_S, i]) + abs(chain[LINK, i + 1] * work[_FORCE_S, i + 1])
        small = balanced(memo, i, work[_R2, i], scale) and small
    return small


@inlined
def _factor(coefficients, chain, modal, h, work):
    """Factor the Newton matrix for the present tangents."""
    n = chain.shape[1] - 1
    by_a = coefficients[BETA] * h * h
    inner = h * (coefficients[THETA] - coefficients[WEIGHT_1])  # = h wc gd
    for i in range(n):
        tangent_c = work[_TANGENT_C, i]
        tangent_1 = work[_TANGENT_1, i]
        work[_FACTORED_C, i] = tangent_c
        work[_FACTORED_1, i] = tangent_1
        tangent_c += chain[GEOMETRIC, i]
        tangent_1 += chain[GEOMETRIC, i]
        damper = chain[STORY_DAMPER, i]
        work[_COUPLING, i] = -by_a * tangent_1
        work[_COUPLING + 1, i] = -by_a * damper
        work[_COUPLING + 2, i] = damper + inner * tangent_c + h * coefficients[WEIGHT_1] * tangent_1
        work[_COUPLING + 3, i] = -by_a * tangent_c
    assemble_blocks(chain, work, _BLOCKS, _COUPLING, h * coefficients[THETA], by_a, n)
    factor_blocks(_BLOCKS, _COUPLING, work, modal, 0.0, -by_a, 1.0, 0.0, _STORE, n)


@inlined
def _finish(chain, laws, state, springs, work, iterations):
    """Update the state and commit the drift laws; work holds them at the end of the step."""
    n = chain.shape[1] - 1
    for i in range(n):
        state[DISPLACEMENT, i] += work[_DU, i]
        state[VELOCITY, i] += work[_DV, i]
        state[ACCELERATION, i] = work[_A1, i]
        settle(laws, springs, i, 0, FIRST_TRIAL)
        commit(laws, springs, i, FIRST_TRIAL, SECOND_TRIAL)
    return iterations if finite(state, n) else NOT_FINITE


def coefficients(rho_inf: float) -> tuple[float, ...]:
    """Coefficients of the step for a spectral radius rho_inf at infinity.

    theta, alpha and beta make the linear step the Pade approximation that tends to rho_inf. Any inner point c would do
    for order 3: quadratics are integrated exactly by (w0, wc, w1), and uc is exact for quadratics. c runs from 1/3,
    where the step is Radau IIA for nonlinear laws too, to 1/2, where it is Simpson's rule on the cubic Hermite
    interpolant.
    """
    theta = (2.0 + rho_inf) / (3.0 * (1.0 + rho_inf))
    alpha = 1.0 / 3.0 - theta / 2.0
    beta = theta / 2.0 - 1.0 / 6.0
    c = 1.0 / (3.0 - rho_inf)
    weight_c = 1.0 / (6.0 * c * (1.0 - c))
    weight_1 = 0.5 - weight_c * c
    weight_0 = 1.0 - weight_c - weight_1
    return (
        theta,
        alpha,
        beta,
        weight_0,
        weight_c,
        weight_1,
        (theta - weight_1) / weight_c,
        alpha / weight_c,
        -beta / weight_c,
    )


FAMILY = Family("impulse4", step, work_rows, memory=(DISPLACEMENT, VELOCITY))

METHODS = (
    Method(
        name="impulse4",
        family=FAMILY,
        parameters=(Parameter("rho_inf", 1.0, 0.0, 1.0),),
        coefficients=coefficients,
        order=lambda rho_inf: 4 if rho_inf == 1.0 else 3,
        implicit=lambda rho_inf: True,
        stability_limit=lambda rho_inf: math.inf,
        rho_inf=lambda rho_inf: rho_inf,
        source="tdint: the impulse-momentum method of 2022 with exact impulses; rho_inf = 0 is Radau IIA (Ehle 1969)",
    ),
)
