"""Explicit method of Noh and Bathe (2013) with two substeps: the restoring forces are evaluated
twice per step, and no equations are solved.

The equations of motion are M a = p(t) - C v - f(u) with the masses M, the damping matrix C, the
restoring forces f of the stories including P-delta, and the loads p. A step of size h from t0
consists of the substeps p h and r h with r = 1 - p, p = 0.54. With the accelerations a0 at the
start, ac at t0 + p h and a1 at the end,

    uc = u0 + p h v0 + (p h)^2 / 2 a0
    M ac = p(t0 + p h) - C (v0 + p h a0) - f(uc)
    u1 = u0 + h v0 + h^2 (p / 2 a0 + r / 2 ac)
    M a1 = p(t0 + h) - C w1 - f(u1),   w1 = v0 + h ((1 - 1 / (2 p)) a0 + 1 / (2 p) ac)
    v1 = v0 + p h / 2 (a0 + ac) + r h (q0 a0 + (1/2 + q1) ac + q2 a1)
    q1 = (1 - 2 p) / (2 p r),   q2 = 1/2 - p q1,   q0 = 1/2 - q1 - q2

The publication predicts the velocity of the damping forces at the end of the step as w1 = vc + r h
ac. Here w1 is extrapolated linearly from both accelerations, which is of order 2. Without damping
the two are identical.

The damping forces use predicted velocities, so the acceleration a1 in the state is not exactly the
acceleration from equilibrium. The step is stable up to a limit of omega h, and not in a story that
becomes stiffer than this limit permits. Power-law dashpots are not supported: the derivative of
their force is not bounded, and therefore there is no stable step.

References
----------
Noh, G., Bathe, K. J. (2013). An explicit time integration scheme for the analysis of wave
propagations. Computers and Structures 129, 178-193.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline
from tdint.kernels.linear_terms import finite, floor_load, internal_forces
from tdint.kernels.stepping import step_kernel
from tdint.kernels.stories.law_state import accumulate_dissipation, commit, restoring_force
from tdint.methods.method import Family, Method


class ExplicitTableau(NamedTuple):
    """Tableau of a method with two explicit substeps: weights of the accelerations a0 at the start,
    ac at the end of the first substep and a1 at the end.

    Attributes
    ----------
    inner : float
        Length p of the first substep divided by the length of the step.
    u_by_a0, u_by_ac : float
        Weights in the displacement at the end, divided by h^2.
    w_by_a0, w_by_ac : float
        Weights in the velocity of the damping forces at the end, divided by h.
    v_by_a0, v_by_ac, v_by_a1 : float
        Weights in the velocity at the end, divided by h.
    """

    inner: float
    u_by_a0: float
    u_by_ac: float
    w_by_a0: float
    w_by_ac: float
    v_by_a0: float
    v_by_ac: float
    v_by_a1: float


_AT = ExplicitTableau(*range(8))
"""Indices of the coefficients of the step."""

_FIRST_SUBSTEP = 0.54  # recommended by the publication: dissipates modes near the stability limit


class _StepRows(NamedTuple):
    """Number of scratch rows for each quantity; the columns are floors or stories."""

    LOAD: int = 1  # load p at the time of the evaluation, N
    STORY_FORCE: int = 1  # story force including P-delta and dashpots, N
    U: int = 1  # displacement at the end of the first substep, m
    V: int = 1  # predicted velocity of the damping forces, m/s
    INNER_FORCE: int = 1  # internal force C v + f(u), N; then the acceleration, m/s^2
    AC: int = 1  # acceleration at the end of the first substep, m/s^2


_ROW, _ROWS = rows.chained(_StepRows)


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Advance the state by one step of two explicit substeps; the result is 1.

    The hysteretic laws follow the path from the committed state to the end of the first substep
    (FIRST_TRIAL) and from this state to the end of the step (SECOND_TRIAL).
    """
    linear_terms, modal, law_parameters, forces, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    elapsed = coefficients[_AT.inner] * h
    u_below = 0.0
    for i in range(n):
        v0 = state[rows.VELOCITY, i]
        a0 = state[rows.ACCELERATION, i]
        u = state[rows.DISPLACEMENT, i] + elapsed * v0 + 0.5 * elapsed * elapsed * a0
        scratch[_ROW.V, i] = v0 + elapsed * a0
        drift = u - linear_terms[rows.LINK, i] * u_below
        restoring_force(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL, drift)
        u_below = u
    ground = load[rows.GROUND_0] + coefficients[_AT.inner] * (
        load[rows.GROUND_1] - load[rows.GROUND_0]
    )
    floor_load(linear_terms, forces, load[rows.TIME] + elapsed, ground, scratch, _ROW.LOAD)
    _accelerate(linear_terms, modal, law_state, rows.FIRST_TRIAL, scratch)
    u_by_a0 = coefficients[_AT.u_by_a0] * h * h
    u_by_ac = coefficients[_AT.u_by_ac] * h * h
    w_by_a0 = coefficients[_AT.w_by_a0] * h
    w_by_ac = coefficients[_AT.w_by_ac] * h
    u_below = 0.0
    for i in range(n):
        v0 = state[rows.VELOCITY, i]
        a0 = state[rows.ACCELERATION, i]
        ac = scratch[_ROW.INNER_FORCE, i]  # stored by `_accelerate`
        scratch[_ROW.AC, i] = ac
        u = state[rows.DISPLACEMENT, i] + h * v0 + u_by_a0 * a0 + u_by_ac * ac
        scratch[_ROW.V, i] = v0 + w_by_a0 * a0 + w_by_ac * ac
        drift = u - linear_terms[rows.LINK, i] * u_below
        restoring_force(law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL, drift)
        state[rows.DISPLACEMENT, i] = u
        u_below = u
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, _ROW.LOAD)
    _accelerate(linear_terms, modal, law_state, rows.SECOND_TRIAL, scratch)
    # The energy is dissipated on both parts of the path.
    v_by_a0 = coefficients[_AT.v_by_a0] * h
    v_by_ac = coefficients[_AT.v_by_ac] * h
    v_by_a1 = coefficients[_AT.v_by_a1] * h
    for i in range(n):
        a0 = state[rows.ACCELERATION, i]
        a1 = scratch[_ROW.INNER_FORCE, i]
        state[rows.VELOCITY, i] += v_by_a0 * a0 + v_by_ac * scratch[_ROW.AC, i] + v_by_a1 * a1
        state[rows.ACCELERATION, i] = a1
        accumulate_dissipation(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
        commit(law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
    return 1 if finite(state, n) else rows.NOT_FINITE


@inline
def _accelerate(linear_terms, modal, law_state, trial, scratch):
    """Compute the accelerations M^-1 (p - C v - f) of all floors from equilibrium, m/s^2; they
    replace the internal forces C v + f in row INNER_FORCE.
    """
    force_row = _ROW.INNER_FORCE
    internal_forces(
        linear_terms, modal, law_state, trial, scratch, _ROW.V, force_row, _ROW.STORY_FORCE
    )
    for i in range(linear_terms.shape[1] - 1):
        unbalanced = scratch[_ROW.LOAD, i] - scratch[force_row, i]
        scratch[force_row, i] = linear_terms[rows.INVERSE_MASS, i] * unbalanced


def tableau(p: float) -> ExplicitTableau:
    """Return the tableau of Noh and Bathe (2013) with the first substep `p`."""
    r = 1.0 - p
    q1 = (1.0 - 2.0 * p) / (2.0 * p * r)
    q2 = 0.5 - p * q1
    q0 = 0.5 - q1 - q2
    # w1 is v0 plus h times the mean of an acceleration that is linear in time, with the values a0
    # and ac at t0 and t0 + p h.
    w_by_ac = 0.5 / p
    return ExplicitTableau(
        inner=p,
        u_by_a0=0.5 * p,
        u_by_ac=0.5 * r,
        w_by_a0=1.0 - w_by_ac,
        w_by_ac=w_by_ac,
        v_by_a0=0.5 * p + r * q0,
        v_by_ac=0.5 * p + r * (0.5 + q1),
        v_by_a1=r * q2,
    )


# Largest stable omega h without damping, dimensionless: there an eigenvalue of the amplification
# matrix is 1 (tests/methods/test_noh_bathe.py).
_STABILITY_LIMIT = 3.7450294313656904

FAMILY = Family(
    "noh-bathe",
    step,
    lambda modes: _ROWS,
    halvable=False,  # an explicit step never returns NOT_CONVERGED
    power_dampers=False,
    limited_by_stiffening=True,
)

METHODS = (
    Method(
        name="noh-bathe",
        family=FAMILY,
        coefficients=lambda: tableau(_FIRST_SUBSTEP),
        implicit=lambda: False,
        stability_limit=lambda: _STABILITY_LIMIT,
        rho_inf=lambda: math.nan,  # unstable for large omega h
        source="Noh and Bathe (2013), two explicit substeps, p 0.54; not for stories that stiffen",
    ),
)
