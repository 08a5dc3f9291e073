"""Runge-Kutta methods: the equations, and the explicit method rk5.

`tdint.methods.gauss` contains the implicit method gauss4.

The equations of motion are written as a first-order system of displacement u and velocity v:

    u' = v
    v' = a(t, u, v) = M^-1 (p(t) - C v - f(u))

M, C are the mass and damping matrices, f(u) the restoring forces of the stories including P-delta,
and p(t) = -M 1 ag(t) plus the forces on floors. Forces of power-law dashpots depend nonlinearly on
v and are added to C v. A method with s stages is defined by its Butcher table: nodes c (c_i is the
sum of row i of A), matrix A and weights b. With the step h from t0,

    u_i = u0 + h sum_j A_ij v_j,     v_i = v0 + h sum_j A_ij a_j,     a_i = a(t0 + c_i h, u_i, v_i)
    u1  = u0 + h sum_j b_j v_j,      v1  = v0 + h sum_j b_j a_j

The ground acceleration ag is linear within the step. Forces on floors are evaluated at the time of
each stage.

Hysteretic laws depend on the path of the drift. The stages of rk5 are not in chronological order,
so the law evaluates each stage, and the end of the step, directly from the start of the step. The
stages of gauss4 are ordered in time, so the path leads from the start through both stages to the
end of the step.

With Rayleigh damping with the tangent stiffness, the force b f' of a story is the rate of b times
the force f of its law, with the coefficient b of the stiffness. The methods integrate the momentum
w = M v + b f(u) instead of the velocity:

    u' = M^-1 (w - b f(u)),    w' = p(t) - C v - f(u)

The impulse of the damping over a step is therefore b (f1 - f0) exactly, and no tangent enters the
equations. The force is continuous at branch changes, the damping force is not.

References
----------
Dormand, J. R., Prince, P. J. (1980). A family of embedded Runge-Kutta formulae. Journal of
Computational and Applied Mathematics 6, 19-26: table 2, fifth-order weights, used with fixed steps.

Kuntzmann, J. (1961) and Butcher, J. C. (1964): implicit Runge-Kutta methods with Gauss nodes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, outlined
from tdint.kernels.linear_terms import finite, floor_load, internal_forces, story_value
from tdint.kernels.stepping import step_kernel
from tdint.kernels.stories.law_state import (
    commit,
    restoring_force,
    restoring_force_outlined,
)
from tdint.methods.method import SIMPSON_MEAN, Family, Method

Table = tuple[tuple[float, ...], ...]

# ---- Explicit methods

_MAX_STAGES = 6  # number of stages of rk5, the only explicit method in this module


class _ExplicitRows(NamedTuple):
    """Number of rows of the scratch array for each quantity; the columns are floors or stories."""

    LOAD: int = 1  # load p at the time of the current stage, N
    STORY_FORCE: int = 1  # story force including P-delta and dashpots, N
    U: int = 1  # displacement of the current stage, m
    V: int = _MAX_STAGES + 1  # velocities of all stages and of the end of the step, m/s
    # Accelerations of all stages and of the end of the step without tangent damping, m/s^2
    A: int = _MAX_STAGES + 1


_EXPLICIT, _EXPLICIT_ROWS = rows.chained(_ExplicitRows)


@step_kernel
def explicit_step(coefficients, scene, h, load, memory):
    """Advance the state by one step of an explicit Runge-Kutta method.

    The first stage is the start of the step. Its acceleration is taken from the state, because it
    was computed from equilibrium at the end of the previous step. The end of the step is treated
    like a further stage with the node 1 and the weights b as row of A. The result is 1 iteration.
    """
    linear_terms, modal, law_parameters, forces, flags = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    for i in range(n):
        scratch[_EXPLICIT.V, i] = state[rows.VELOCITY, i]
        scratch[_EXPLICIT.A, i] = state[rows.ACCELERATION, i]
    if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
        _add_tangent_damping(1.0, linear_terms, state, scratch, _EXPLICIT.A)
    stages = int(coefficients[0])
    node_index = 1  # index of the node c of the current stage in `coefficients`
    for stage in range(1, stages + 1):
        for i in range(n):
            scratch[_EXPLICIT.U, i] = state[rows.DISPLACEMENT, i]
            scratch[_EXPLICIT.V + stage, i] = state[rows.VELOCITY, i]
        for previous_stage in range(stage):
            weight = h * coefficients[node_index + 1 + previous_stage]
            for i in range(n):
                scratch[_EXPLICIT.U, i] += weight * scratch[_EXPLICIT.V + previous_stage, i]
                scratch[_EXPLICIT.V + stage, i] += weight * scratch[_EXPLICIT.A + previous_stage, i]
        u_below = 0.0
        for i in range(n):
            drift = scratch[_EXPLICIT.U, i] - linear_terms[rows.LINK, i] * u_below
            restoring_force(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL, drift)
            u_below = scratch[_EXPLICIT.U, i]
        if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
            _subtract_damping_impulse(linear_terms, law_state, scratch, _EXPLICIT.V + stage)
        c = coefficients[node_index]
        ground = load[rows.GROUND_0] + c * (load[rows.GROUND_1] - load[rows.GROUND_0])
        floor_load(linear_terms, forces, load[rows.TIME] + c * h, ground, scratch, _EXPLICIT.LOAD)
        # The row of the acceleration first receives the internal forces C v + f(u).
        velocity, acceleration = _EXPLICIT.V + stage, _EXPLICIT.A + stage
        trial, sums = rows.FIRST_TRIAL, _EXPLICIT.STORY_FORCE
        internal_forces(
            linear_terms, modal, law_state, trial, scratch, velocity, acceleration, sums
        )
        for i in range(n):
            unbalanced = scratch[_EXPLICIT.LOAD, i] - scratch[acceleration, i]
            scratch[acceleration, i] = linear_terms[rows.INVERSE_MASS, i] * unbalanced
        node_index += stage + 1
    if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
        _store_explicit_damping(linear_terms, law_parameters, h, memory, stages)
    for i in range(n):
        state[rows.DISPLACEMENT, i] = scratch[_EXPLICIT.U, i]
        state[rows.VELOCITY, i] = scratch[_EXPLICIT.V + stages, i]
        state[rows.ACCELERATION, i] = scratch[_EXPLICIT.A + stages, i]
        commit(law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL)
    return 1 if finite(state, n) else rows.NOT_FINITE


@outlined
def _add_tangent_damping(factor, linear_terms, state, scratch, row):
    """Add `factor` times the accelerations that the forces of tangent damping at the end of a step
    require (DAMPING_FORCE divided by the masses) to a row, m/s^2."""
    for i in range(linear_terms.shape[1] - 1):
        force = state[rows.DAMPING_FORCE, i]
        force -= linear_terms[rows.LINK, i + 1] * state[rows.DAMPING_FORCE, i + 1]
        scratch[row, i] += factor * linear_terms[rows.INVERSE_MASS, i] * force


@outlined
def _subtract_damping_impulse(linear_terms, law_state, scratch, velocity):
    """Subtract the impulses of tangent damping from the start of the step to a stage, divided by
    the masses, from the velocities of the stage. The laws are at the stage in block FIRST_TRIAL."""
    impulse_above = 0.0
    for i in range(linear_terms.shape[1] - 2, -1, -1):
        change = law_state[rows.FIRST_TRIAL + rows.FORCE, i] - law_state[rows.FORCE, i]
        impulse = linear_terms[rows.TANGENT_DAMPING, i] * change
        scratch[velocity, i] -= linear_terms[rows.INVERSE_MASS, i] * (impulse - impulse_above)
        impulse_above = linear_terms[rows.LINK, i] * impulse


@outlined
def _store_explicit_damping(linear_terms, law_parameters, h, memory, stages):
    """Store force and work of tangent damping at the end of the step, and subtract the force from
    the accelerations of the last stage.

    The work is the integral of b f' d' for parabolas of f' and d' with their values at both
    endpoints and their means. A parabola with the mean m, the change c and the mean of both ends m
    + e has the product m m' + c c' / 12 + e e' / 5 with a second parabola, on average.
    """
    state, law_state, scratch, _ = memory
    velocity = _EXPLICIT.V + stages
    for i in range(linear_terms.shape[1] - 1):
        coefficient = linear_terms[rows.TANGENT_DAMPING, i]
        if coefficient == 0.0:
            continue
        drift = story_value(linear_terms, scratch, _EXPLICIT.U, i)
        rate_0 = story_value(linear_terms, scratch, _EXPLICIT.V, i)
        rate_1 = story_value(linear_terms, scratch, velocity, i)
        tangent = restoring_force_outlined(
            law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL, drift
        )
        force_0 = state[rows.DAMPING_FORCE, i]
        force_1 = coefficient * tangent * rate_1
        mean = coefficient / h
        mean *= law_state[rows.FIRST_TRIAL + rows.FORCE, i] - law_state[rows.FORCE, i]
        mean_rate = (drift - law_state[rows.DRIFT, i]) / h
        power = mean * mean_rate + (force_1 - force_0) * (rate_1 - rate_0) / 12.0
        power += 0.2 * (0.5 * (force_0 + force_1) - mean) * (0.5 * (rate_0 + rate_1) - mean_rate)
        state[rows.DAMPING_FORCE, i] = force_1
        state[rows.DAMPING_WORK, i] += h * power
    _add_tangent_damping(-1.0, linear_terms, state, scratch, _EXPLICIT.A + stages)


def explicit_coefficients(table: Table) -> tuple[float, ...]:
    """Return the Butcher table as coefficients of `explicit_step`: number of stages, then for each
    row of `table` its node and the row.

    `table` contains the rows of the Butcher matrix from the second stage on, without zeros on and
    above the diagonal; the last row contains the weights b. The node is the sum of the row; for the
    weights it is 1, the end of the step.
    """
    flattened = (number for row in table for number in (math.fsum(row), *row))
    return (float(len(table)), *flattened)


# Dormand and Prince (1980), table 2: rows of A for the stages 2 to 6, then the fifth-order weights
DORMAND_PRINCE: Table = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)


# Largest stable omega h without damping, dimensionless: the smallest positive root of
# |R(i omega h)| = 1, with the stability polynomial R of the method
# (tests/methods/test_runge_kutta.py).
_STABILITY_LIMIT = 0.9971890086325534


# The acceleration follows from displacement and velocity.
EXPLICIT = Family(
    "runge-kutta",
    explicit_step,
    lambda modes: _EXPLICIT_ROWS,
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
    halvable=False,  # an explicit step never returns NOT_CONVERGED
    mean_rule=SIMPSON_MEAN,
)

METHODS = (
    Method(
        name="rk5",
        family=EXPLICIT,
        coefficients=lambda: explicit_coefficients(DORMAND_PRINCE),
        order=lambda: 5,
        implicit=lambda: False,
        stability_limit=lambda: _STABILITY_LIMIT,
        rho_inf=lambda: math.nan,  # unstable for large omega h
        tangent_damping=lambda: True,
        source="Dormand and Prince (1980), the fifth-order weights at a fixed step",
    ),
)
