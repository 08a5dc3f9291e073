"""The exact response of a linear building to a load that is linear over each step (Nigam and
Jennings 1969).

(u1, v1) = A (u0, v0) + B0 p0 + B1 p1 with the matrix exponential of the step. Where the damping is
classical the matrices come from the modes, each in closed form; otherwise from the exponential of
the block matrix of Van Loan (1978). Harmonic forces are taken as linear between the steps' ends.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdint.kernels import layout as rows
from tdint.kernels.compiling import kernel
from tdint.kernels.linear_terms import finite, force_value
from tdint.kernels.stepping import STEP
from tdint.kernels.stories.law_state import commit, restoring_force
from tdint.methods.method import Family, Method
from tdint.model.building import Building

Array = NDArray[np.float64]

_SERIES_BELOW = 4.0  # omega h: the closed form cancels below, 42 terms and more are needed above
_TERMS = 18, 6.0  # and these times the largest omega h


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
    """One step: a matrix times (u0, v0, loads at the start, loads at the end), column by column.

    A column is 2 n numbers. The loads are the ground acceleration and the floor forces, one column
    each per end.
    """
    n = linear_terms.shape[1] - 1
    loads = 1 + forces.shape[0]
    for i in range(n):
        scratch[0, i] = 0.0
        scratch[1, i] = 0.0
    # What each number of the state and of the loads at both ends adds.
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
        start = 2 * n * j
        for i in range(n):
            scratch[0, i] += factor * coefficients[start + i]
        for i in range(n):
            scratch[1, i] += factor * coefficients[start + n + i]
    below = 0.0
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
            u - linear_terms[rows.LINK, i] * below,
        )
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
        below = u
    return 1 if finite(state, n) else rows.NOT_FINITE


def oscillator(omega_h: Array, damping: Array) -> Array:
    """Exact step of oscillators u'' + 2 xi omega u' + omega^2 u = p with p linear over the step.

    Parameters
    ----------
    omega_h, damping : ndarray, shape (k,)
        omega h (not negative) and damping ratio xi (not negative).

    Returns
    -------
    ndarray, shape (k, 2, 4)
        Matrix from (u0, h v0, h^2 p0, h^2 p1) to (u1, h v1). By power series for small omega h,
        where the closed form cancels; in closed form for underdamped oscillators; from Van Loan's
        block matrix otherwise.
    """
    omega_h, damping = np.broadcast_arrays(np.asarray(omega_h, float), np.asarray(damping, float))
    result = np.empty((*omega_h.shape, 2, 4))
    series = np.maximum(omega_h, 2.0 * damping * omega_h) < _SERIES_BELOW
    closed = ~series & (damping < 1.0)
    if series.any():
        # Taylor series of the impulse response and its first two integrals; exact at omega = 0.
        w, xi = omega_h[series], damping[series]
        count = _TERMS[0] + math.ceil(_TERMS[1] * np.max(np.maximum(w, 2.0 * xi * w)))
        terms = np.empty((count, *w.shape))
        terms[0], terms[1] = 1.0, -2.0 * xi * w
        for n in range(2, count):
            terms[n] = terms[1] * terms[n - 1] - w * w * terms[n - 2]
        inverse = 1.0 / np.cumprod(np.arange(1.0, count + 3.0))  # of the factorials from 1! on
        g, i1, i2 = (np.tensordot(inverse[k : k + count], terms, 1) for k in range(3))
        a11 = 1.0 - w * w * i1
        result[series] = _fill(w, g, i1, i2, a11, a11 - 2.0 * xi * w * g)
    if closed.any():
        w, xi = omega_h[closed], damping[closed]
        damped, decay = w * np.sqrt((1.0 - xi) * (1.0 + xi)), np.exp(-xi * w)
        c, g = decay * np.cos(damped), decay * np.sin(damped) / damped
        a11 = c + xi * w * g
        i1 = (1.0 - a11) / w**2
        i2 = (1.0 - g - 2.0 * xi * w * i1) / w**2
        result[closed] = _fill(w, g, i1, i2, a11, c - xi * w * g)
    for index in np.argwhere(~series & ~closed):
        w, xi = omega_h[tuple(index)], damping[tuple(index)]
        result[tuple(index)] = _van_loan(np.array([[w * w]]), np.array([[2.0 * xi * w]]), np.eye(1))
    return result


def _fill(w: Array, g: Array, i1: Array, i2: Array, a11: Array, a22: Array) -> Array:
    coefficient_rows = np.array([[a11, g, i1 - i2, i2], [-w * w * g, a22, g - i1, i1]])
    return np.moveaxis(coefficient_rows, (0, 1), (-2, -1))


def _van_loan(k: Array, c: Array, patterns: Array) -> Array:
    """Step of u'' + c u' + k u = P p(t) over unit time, from (u0, v0, p0, p1); k and c are divided
    by the mass."""
    from scipy.linalg import expm

    n, loads = patterns.shape
    block = np.zeros((2 * n + 2 * loads, 2 * n + 2 * loads))
    block[:n, n : 2 * n] = np.eye(n)
    block[n : 2 * n, :n] = -k
    block[n : 2 * n, n : 2 * n] = -c
    block[n : 2 * n, 2 * n : 2 * n + loads] = patterns
    block[2 * n : 2 * n + loads, 2 * n + loads :] = np.eye(loads)
    # The load starts at p0 and grows by p1 - p0.
    whole = expm(block)[: 2 * n]
    by_growth = whole[:, 2 * n + loads :]
    return np.hstack([whole[:, : 2 * n], whole[:, 2 * n : 2 * n + loads] - by_growth, by_growth])


def prepare(building: Building, forces: Array, h: float) -> Array:
    """The step's matrix for one building and step, column by column (shape (2 n (2 n + 2
    loads),))."""
    n = building.stories
    patterns = np.zeros((n, 1 + len(forces)))
    patterns[:, 0] = -1.0
    for j, floor in enumerate(forces[:, rows.FLOOR].astype(int)):
        patterns[floor, 1 + j] = 1.0 / building.mass[floor]
    modes = building.modes()
    classical = modes.damping_ratios(building.damping_matrix())
    if classical is None:
        k, c = building.stiffness_matrix(), building.damping_matrix()
        per_mass = 1.0 / building.mass[:, None]
        matrix = _van_loan(h * h * per_mass * k, h * per_mass * c, patterns)
    else:
        # The steps of the modes, put together; their shapes are mass-normalized columns.
        steps, shapes = oscillator(modes.omega * h, classical), modes.shapes
        to_modes = shapes.T * building.mass
        load_to_modes = to_modes @ patterns
        of_columns = (to_modes, to_modes, load_to_modes, load_to_modes)
        blocks = [
            [shapes @ (steps[:, row, column, None] * of_columns[column]) for column in range(4)]
            for row in range(2)
        ]
        matrix = np.block(blocks)
    loads = patterns.shape[1]
    # From unit step to h: rows v / h; columns h v0, h^2 p.
    matrix[n:] /= h
    matrix[:, n : 2 * n] *= h
    matrix[:, 2 * n : 2 * n + 2 * loads] *= h * h
    return np.ascontiguousarray(matrix.T).ravel()


FAMILY = Family(
    "exact",
    step,
    lambda modes: 2,
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
    halvable=False,
    linear_only=True,
    prepare=prepare,
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
