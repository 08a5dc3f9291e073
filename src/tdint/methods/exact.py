"""Method exact: the exact response of a linear building to a load that is linear within each step.

The response at the end of a step is a linear function of the state and of the loads p at both
endpoints (Nigam and Jennings 1969),

    (u1, v1) = A (u0, v0) + B0 p0 + B1 p1

with constant matrices A, B0 and B1. For classical damping, they are computed in closed form for
each mode; otherwise from the matrix exponential of a block matrix (Van Loan 1978). Harmonic forces
on floors are approximated as linear within each step.

Forces from tables are integrated exactly, with their kinks and jumps inside the step. Over a step,
a table is its line plus a sum of Legendre polynomials. The response to each polynomial is a column
of the matrix, computed by Gauss quadrature of the impulse response. The response to the degrees
above `moments` is less than the rounding error, because the impulse response is a smooth function
of time.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.kernels.linear_terms import below, count_masses, finite, force_value, tie
from tdint.kernels.stepping import step_kernel
from tdint.kernels.stories.law_state import commit, restoring_force
from tdint.methods.exact_step import oscillator, van_loan
from tdint.methods.method import Family, Method

if TYPE_CHECKING:
    from tdint.model.building import Building

Array = Array


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Compute the exact response of a linear building at the end of one time step; the result is 1.

    The matrix of `prepare` is multiplied by the displacements and velocities at the start, the
    loads at the start, and the loads at the end. The loads are the ground acceleration and the
    forces on floors.
    """
    linear_terms, _, law_parameters, forces, _ = scene
    state, law_state, scratch, _ = memory
    n = count_masses(linear_terms)
    loads = 1 + forces.shape[0]  # ground acceleration and forces on floors
    moments = forces.shape[1] - rows.FORCE_COLUMNS  # Legendre coefficients of each force
    for i in range(n):
        scratch[0, i] = 0.0
        scratch[1, i] = 0.0
    for j in range(2 * n + 2 * loads):
        if j < n:
            factor = state[rows.DISPLACEMENT, j]
        elif j < 2 * n:
            factor = state[rows.VELOCITY, j - n]
        elif j == 2 * n:
            factor = load[rows.GROUND_0]
        elif j < 2 * n + loads:
            factor = force_value(forces, j - 2 * n - 1, load[rows.TIME])
        elif j == 2 * n + loads:
            factor = load[rows.GROUND_1]
        else:
            factor = force_value(forces, j - 2 * n - loads - 1, load[rows.TIME] + h)
        column_start = 2 * n * j
        for i in range(n):
            scratch[0, i] += factor * coefficients[column_start + i]
        for i in range(n):
            scratch[1, i] += factor * coefficients[column_start + n + i]
    # Deviations of the tables from their lines
    column_start = 4 * n * (n + loads)
    for j in range(forces.shape[0]):
        for k in range(moments):
            factor = forces[j, rows.FORCE_COLUMNS + k]
            if factor != 0.0:
                for i in range(n):
                    scratch[0, i] += factor * coefficients[column_start + i]
                    scratch[1, i] += factor * coefficients[column_start + n + i]
            column_start += 2 * n
    tie(linear_terms, scratch, 0)
    tie(linear_terms, scratch, 1)
    u_below = 0.0
    n = linear_terms.shape[1] - 1
    for i in range(n):
        u = scratch[0, i]
        state[rows.DISPLACEMENT, i] = u
        state[rows.VELOCITY, i] = scratch[1, i]
        restoring_force(
            law_parameters,
            law_state,
            i,
            0,
            rows.FIRST_TRIAL,
            u
            - linear_terms[rows.LINK, i]
            * below(linear_terms, state, rows.DISPLACEMENT, i, u_below),
        )
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
        u_below = u
    return 1 if finite(state, n) else rows.NOT_FINITE


def prepare(building: Building, forces: Array, h: float) -> Array:
    """Return the matrix of one step of a linear building, column by column, for the coefficients of
    `step`.

    If the damping is classical (the modes are not coupled by C), the steps of the modes are
    superposed (`oscillator`). Otherwise `van_loan` computes the matrix.
    """
    n = building.masses
    patterns = np.zeros((n, 1 + len(forces)))
    # Acceleration of each floor per unit of each load
    patterns[:, 0] = -1.0  # -M ag
    for j, floor in enumerate(forces[:, rows.FLOOR].astype(int)):
        patterns[floor, 1 + j] = 1.0 / building.mass[floor]
    modes = building.modes()
    # None if the damping is not classical
    classical = modes.damping_ratios(building.damping_matrix())
    if classical is None:
        k, c = building.stiffness_matrix(), building.damping_matrix()
        per_mass = 1.0 / building.mass[:, None]
        matrix = van_loan(h * h * per_mass * k, h * per_mass * c, patterns)
    else:
        # The columns of `shapes` are mass-normalized mode shapes; their transpose times the mass is
        # the projection on the modes. The matrix has 2 x 4 blocks, with the rows u1, v1 and the
        # columns u0, v0, p0, p1.
        steps, shapes = oscillator(modes.omega * h, classical), modes.shapes
        modal_projection = shapes.T * building.mass
        modal_load = modal_projection @ patterns
        projections = (modal_projection, modal_projection, modal_load, modal_load)
        blocks = [
            [shapes @ (steps[:, row, column, None] * projections[column]) for column in range(4)]
            for row in range(2)
        ]
        matrix = np.block(blocks)
    loads = patterns.shape[1]
    # Both branches compute with the time divided by h: the matrix maps (u0, h v0, h^2 p0, h^2 p1)
    # to (u1, h v1).
    matrix[n:] /= h
    matrix[:, n : 2 * n] *= h
    matrix[:, 2 * n : 2 * n + 2 * loads] *= h * h
    # The transpose, row by row, is the matrix column by column.
    columns = [matrix.T]
    if forces[:, rows.POINTS].any():
        columns += _moment_columns(building, patterns[:, 1:], h)
    return np.concatenate(columns).ravel()


def moments(building: Building, h: float) -> int:
    """Return the number of Legendre coefficients, from degree 2 on, for a step `h` (s).

    The coefficients of exp(i omega t) over the step are spherical Bessel functions of omega h / 2.
    They fall below 1e-16 at this degree.
    """
    x = 0.5 * h * float(np.max(building.modes().omega))
    return math.ceil(x + 6.0 * math.cbrt(x) + 12.0)


def _moment_columns(building: Building, patterns: Array, h: float) -> list[Array]:
    """Return the responses at the end of a step to Legendre polynomials of degree 2 and above: for
    each force the displacements (m) and velocities (m/s) per N, shape (moments, 2 n).

    With x from -1 to 1 over the step, the response to the load P_k(x) is the integral of the
    impulse response g(h (1 - x) / 2) times P_k(x) h / 2.
    """
    count = moments(building, h)
    nodes, weights = np.polynomial.legendre.leggauss(count + 24)
    polynomials = np.polynomial.legendre.legvander(nodes, count + 1)[:, 2:]
    k, c = building.stiffness_matrix(), building.damping_matrix()
    modes = building.modes()
    classical = modes.damping_ratios(c)
    per_mass = 1.0 / building.mass[:, None]
    responses = []  # Displacements and velocities after a unit force impulse at each node
    for node in nodes:
        time = 0.5 * h * (1.0 - node)
        if classical is None:
            # The column of the initial velocity, with the time divided by `time`
            matrix = van_loan(time * time * per_mass * k, time * per_mass * c, patterns)
            after = matrix[:, building.masses : 2 * building.masses] @ patterns
        else:
            steps = oscillator(modes.omega * time, classical)
            modal = (modes.shapes.T * building.mass) @ patterns
            after = np.vstack([modes.shapes @ (steps[:, row, 1, None] * modal) for row in range(2)])
        # Displacement / time, and velocity
        after[: building.masses] *= time
        responses.append(after)
    weighted = (0.5 * h * weights)[:, None] * polynomials
    return list(np.einsum("qk,qif->fki", weighted, np.array(responses)))


FAMILY = Family(
    "exact",
    step,
    lambda modes: 2,
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
    halvable=False,
    linear_only=True,
    prepare=prepare,
    moments=moments,
    devices=True,
)

METHODS = (
    Method(
        name="exact",
        family=FAMILY,
        coefficients=tuple,
        implicit=lambda: False,
        rho_inf=lambda: 1.0,
        source="Nigam and Jennings (1969); exact for a load linear over the step, order 2 for a "
        "smooth one",
    ),
)
