"""ROS2, a Rosenbrock method without iterations (Verwer, Spee, Blom and Hundsdorfer 1999, SIAM J.
Sci. Comput. 20): of order 2 whatever matrix stands for the Jacobian, here that of the tangents at
the start of the step.

With y = (u, v), y' = F(t, y), J its Jacobian and g = 1 - 1 / sqrt(2), which damps what is
infinitely stiff at once:

    (1 - g h J) k1 = h F(t0, y0) + g h^2 F_t,   (1 - g h J) k2 = h F(t1, y0 + k1) - 2 k1 - g h^2 F_t
    y1 = y0 + 3/2 k1 + 1/2 k2

Of each k the velocity part comes from (M + g h C + (g h)^2 K) kv = r - g h K s, the displacement
part is s + g h kv.
"""

import math
from typing import NamedTuple

from tdint.plugin import (
    STEP,
    Combination,
    Factors,
    Family,
    Method,
    at,
    chained,
    commit,
    factor_combination,
    finite,
    floor_load,
    inlined,
    internal_forces,
    kernel,
    restoring,
    solve_damped,
)

G = 1.0 - math.sqrt(0.5)


class _Rows(NamedTuple):
    """Rows of work."""

    LOAD: int = 2  # at the start and at the end
    V: int = 1
    INNER: int = 1
    SUMS: int = 1
    TANGENT: int = 1
    KU: int = 2  # of both stages
    KV: int = 2
    PIVOT: int = 1
    COUPLING: int = 1


ROW, STORE = chained(_Rows)


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
    """One step: one factorization, two solves."""
    n = linear_terms.shape[1] - 1
    by = G * h
    factors = Factors(work, ROW.PIVOT, ROW.COUPLING, STORE)
    floor_load(linear_terms, forces, load[at.TIME], load[at.GROUND_0], work, ROW.LOAD)
    floor_load(linear_terms, forces, load[at.TIME] + h, load[at.GROUND_1], work, ROW.LOAD + 1)
    # The matrix, by the tangents at the start
    for i in range(n):
        drift = springs[at.DRIFT, i]
        work[ROW.TANGENT, i] = restoring(
            law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL, drift
        )
    factor_combination(
        linear_terms, modal, work, ROW.TANGENT, Combination(1.0, by, by * by), factors, n
    )
    # The first stage, from the start
    for i in range(n):
        work[ROW.V, i] = state[at.VELOCITY, i]
        work[ROW.KU, i] = h * work[ROW.V, i]
    internal_forces(linear_terms, modal, springs, at.COMMITTED, work, ROW.V, ROW.INNER, ROW.SUMS)
    for i in range(n):
        change = by * (work[ROW.LOAD + 1, i] - work[ROW.LOAD, i])
        work[ROW.KV, i] = h * (work[ROW.LOAD, i] - work[ROW.INNER, i]) + change
    _stage(linear_terms, modal, by, factors, ROW.KU, ROW.KV, n)
    # The second, from the end of the first
    below = 0.0
    for i in range(n):
        u = state[at.DISPLACEMENT, i] + work[ROW.KU, i]
        restoring(
            law_parameters,
            springs,
            i,
            at.COMMITTED,
            at.FIRST_TRIAL,
            u - linear_terms[at.LINK, i] * below,
        )
        below = u
        work[ROW.V, i] = state[at.VELOCITY, i] + work[ROW.KV, i]
        work[ROW.KU + 1, i] = h * work[ROW.V, i] - 2.0 * work[ROW.KU, i]
    internal_forces(linear_terms, modal, springs, at.FIRST_TRIAL, work, ROW.V, ROW.INNER, ROW.SUMS)
    for i in range(n):
        change = by * (work[ROW.LOAD + 1, i] - work[ROW.LOAD, i])
        taken = 2.0 * linear_terms[at.MASS, i] * work[ROW.KV, i]
        work[ROW.KV + 1, i] = h * (work[ROW.LOAD + 1, i] - work[ROW.INNER, i]) - taken - change
    _stage(linear_terms, modal, by, factors, ROW.KU + 1, ROW.KV + 1, n)
    below = 0.0
    for i in range(n):
        u = state[at.DISPLACEMENT, i] + 1.5 * work[ROW.KU, i] + 0.5 * work[ROW.KU + 1, i]
        state[at.DISPLACEMENT, i] = u
        state[at.VELOCITY, i] += 1.5 * work[ROW.KV, i] + 0.5 * work[ROW.KV + 1, i]
        restoring(
            law_parameters,
            springs,
            i,
            at.COMMITTED,
            at.FIRST_TRIAL,
            u - linear_terms[at.LINK, i] * below,
        )
        commit(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL)
        below = u
    return 1 if finite(state, n) else at.NOT_FINITE


@inlined
def _stage(linear_terms, modal, by, factors, ku, kv, n):
    """Rows `ku` and `kv` of work hold s and r, and become the stage."""
    work = factors.table
    below = 0.0
    for i in range(n):
        story = work[ROW.TANGENT, i] + linear_terms[at.GEOMETRIC, i]
        work[ROW.SUMS, i] = by * story * (work[ku, i] - linear_terms[at.LINK, i] * below)
        below = work[ku, i]
    work[ROW.SUMS, n] = 0.0
    for i in range(n):
        work[kv, i] -= work[ROW.SUMS, i] - linear_terms[at.LINK, i + 1] * work[ROW.SUMS, i + 1]
    solve_damped(factors, modal, kv, n)
    for i in range(n):
        work[ku, i] += by * work[kv, i]


METHODS = (
    Method(
        name="ros2",
        family=Family(
            "rosenbrock",
            step,
            lambda modes: STORE + 2 * modes + 1,
            memory=(at.DISPLACEMENT, at.VELOCITY),
        ),
        coefficients=lambda: (),
        rho_inf=lambda: 0.0,
        source="ROS2, Verwer, Spee, Blom and Hundsdorfer (1999); no iterations",
    ),
)
