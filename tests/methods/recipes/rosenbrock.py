"""ROS2, a Rosenbrock method without iterations (Verwer, Spee, Blom and Hundsdorfer 1999, SIAM J.
Sci. Comput. 20). It is of order 2 for any approximation of the Jacobian; here, the Jacobian follows
from the tangents at the start of the step.

The equations use y = (u, v), y' = F(t, y), its Jacobian J, and g = 1 - 1 / sqrt(2), which makes the
method L-stable:

    (1 - g h J) k1 = h F(t0, y0) + g h^2 F_t,   (1 - g h J) k2 = h F(t1, y0 + k1) - 2 k1 - g h^2 F_t
    y1 = y0 + 3/2 k1 + 1/2 k2

The velocity part of each k follows from (M + g h C + (g h)^2 K) kv = r - g h K s, and its
displacement part is s + g h kv.
"""

import math
from typing import NamedTuple

from tdint.plugin import (
    STEP,
    Combination,
    Factors,
    Family,
    Method,
    chained,
    commit,
    factor_combination,
    finite,
    floor_load,
    inline,
    internal_forces,
    kernel,
    restoring_force,
    rows,
    solve_damped,
)

G = 1.0 - math.sqrt(0.5)


class _Rows(NamedTuple):
    """Rows of the scratch array."""

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
    law_state,
    scratch,
    step_status,
):
    """Perform one step, with one factorization and two solutions."""
    n = linear_terms.shape[1] - 1
    by = G * h
    factors = Factors(scratch, ROW.PIVOT, ROW.COUPLING, STORE, linear_terms)
    floor_load(linear_terms, forces, load[rows.TIME], load[rows.GROUND_0], scratch, ROW.LOAD)
    floor_load(
        linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, ROW.LOAD + 1
    )
    # The matrix, by the tangents at the start
    for i in range(n):
        drift = law_state[rows.DRIFT, i]
        scratch[ROW.TANGENT, i] = restoring_force(
            law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL, drift
        )
    factor_combination(
        linear_terms, modal, scratch, ROW.TANGENT, Combination(1.0, by, by * by), factors, n
    )
    # The first stage, from the start
    for i in range(n):
        scratch[ROW.V, i] = state[rows.VELOCITY, i]
        scratch[ROW.KU, i] = h * scratch[ROW.V, i]
    internal_forces(
        linear_terms, modal, law_state, rows.COMMITTED, scratch, ROW.V, ROW.INNER, ROW.SUMS
    )
    for i in range(n):
        change = by * (scratch[ROW.LOAD + 1, i] - scratch[ROW.LOAD, i])
        scratch[ROW.KV, i] = h * (scratch[ROW.LOAD, i] - scratch[ROW.INNER, i]) + change
    _stage(linear_terms, modal, by, factors, ROW.KU, ROW.KV, n)
    # The second, from the end of the first
    below = 0.0
    for i in range(n):
        u = state[rows.DISPLACEMENT, i] + scratch[ROW.KU, i]
        restoring_force(
            law_parameters,
            law_state,
            i,
            rows.COMMITTED,
            rows.FIRST_TRIAL,
            u - linear_terms[rows.LINK, i] * below,
        )
        below = u
        scratch[ROW.V, i] = state[rows.VELOCITY, i] + scratch[ROW.KV, i]
        scratch[ROW.KU + 1, i] = h * scratch[ROW.V, i] - 2.0 * scratch[ROW.KU, i]
    internal_forces(
        linear_terms, modal, law_state, rows.FIRST_TRIAL, scratch, ROW.V, ROW.INNER, ROW.SUMS
    )
    for i in range(n):
        change = by * (scratch[ROW.LOAD + 1, i] - scratch[ROW.LOAD, i])
        impulse = 2.0 * linear_terms[rows.MASS, i] * scratch[ROW.KV, i]
        scratch[ROW.KV + 1, i] = (
            h * (scratch[ROW.LOAD + 1, i] - scratch[ROW.INNER, i]) - impulse - change
        )
    _stage(linear_terms, modal, by, factors, ROW.KU + 1, ROW.KV + 1, n)
    below = 0.0
    for i in range(n):
        u = state[rows.DISPLACEMENT, i] + 1.5 * scratch[ROW.KU, i] + 0.5 * scratch[ROW.KU + 1, i]
        state[rows.DISPLACEMENT, i] = u
        state[rows.VELOCITY, i] += 1.5 * scratch[ROW.KV, i] + 0.5 * scratch[ROW.KV + 1, i]
        restoring_force(
            law_parameters,
            law_state,
            i,
            rows.COMMITTED,
            rows.FIRST_TRIAL,
            u - linear_terms[rows.LINK, i] * below,
        )
        commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        below = u
    return 1 if finite(state, n) else rows.NOT_FINITE


@inline
def _stage(linear_terms, modal, by, factors, ku, kv, n):
    """Solve for a stage: the rows `ku` and `kv` of scratch contain s and r, and are replaced by the
    stage."""
    scratch = factors.table
    below = 0.0
    for i in range(n):
        story = scratch[ROW.TANGENT, i] + linear_terms[rows.GEOMETRIC, i]
        scratch[ROW.SUMS, i] = by * story * (scratch[ku, i] - linear_terms[rows.LINK, i] * below)
        below = scratch[ku, i]
    scratch[ROW.SUMS, n] = 0.0
    for i in range(n):
        scratch[kv, i] -= (
            scratch[ROW.SUMS, i] - linear_terms[rows.LINK, i + 1] * scratch[ROW.SUMS, i + 1]
        )
    solve_damped(factors, modal, kv, n)
    for i in range(n):
        scratch[ku, i] += by * scratch[kv, i]


METHODS = (
    Method(
        name="ros2",
        family=Family(
            "rosenbrock",
            step,
            lambda modes: STORE + 2 * modes + 1,
            memory=(rows.DISPLACEMENT, rows.VELOCITY),
        ),
        coefficients=lambda: (),
        rho_inf=lambda: 0.0,
        source="ROS2, Verwer, Spee, Blom and Hundsdorfer (1999); no iterations",
    ),
)
