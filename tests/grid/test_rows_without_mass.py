"""Random models of `matrices` with rows without mass against a separate solver.

Rows without mass are nodes between springs and dashpots. The separate solver integrates E x' = A x
+ f with the three-stage Radau IIA method: E is singular where a row has neither mass nor dashpot.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import lu_factor, lu_solve

import tdint
from selection import every

STEP, SUBSTEPS = 0.01, 4  # sampling interval, s; steps of the separate solver in each interval
ROOT = np.sqrt(6.0)
WEIGHTS = np.array(
    [
        [(88 - 7 * ROOT) / 360, (296 - 169 * ROOT) / 1800, (-2 + 3 * ROOT) / 225],
        [(296 + 169 * ROOT) / 1800, (88 + 7 * ROOT) / 360, (-2 - 3 * ROOT) / 225],
        [(16 - ROOT) / 36, (16 + ROOT) / 36, 1 / 9],
    ]
)
TIMES = np.array([(4 - ROOT) / 10, (4 + ROOT) / 10, 1.0])


def random_model(seed):
    """Return mass, stiffness and damping of a chain of masses with one to four further rows.

    Each row without mass has a spring to one row and a spring or a dashpot to another one or to the
    ground; a row without mass may be the neighbor of another."""
    random = np.random.default_rng(seed)
    masses, free = random.integers(1, 6), random.integers(1, 5)
    n = int(masses + free)
    mass = np.append(random.uniform(0.8e5, 2e5, masses), np.zeros(free))
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))

    def connect(matrix, i, j, value):
        ends = np.zeros(n)
        ends[i] = 1.0
        if j >= 0:
            ends[j] = -1.0
        matrix += value * np.outer(ends, ends)

    for i in range(masses):
        connect(stiffness, i, i - 1, random.uniform(2e7, 8e7))
        connect(damping, i, i - 1, random.uniform(0.0, 2e5))
    for i in range(masses, n):
        first, second = random.choice([-1, *range(i)], 2, replace=False)
        connect(stiffness, i, first, random.uniform(1e7, 6e7))
        if random.random() < 0.75:
            connect(damping, i, second, random.uniform(2e5, 3e6))
        else:
            connect(stiffness, i, second, random.uniform(1e7, 6e7))
    return mass, stiffness, damping


def separate(mass, stiffness, damping, motion):
    """Return the displacements of all rows at the samples of the ground acceleration, m."""
    n, m = len(mass), int(np.count_nonzero(mass))
    E, A = np.zeros((n + m, n + m)), np.zeros((n + m, n + m))
    E[:m, :m] = np.eye(m)  # u' = v of the rows with mass
    A[:m, n:] = np.eye(m)
    E[m : 2 * m, n:] = np.diag(mass[:m])
    E[m:, m:n] = damping[:, m:]
    A[m:, n:] = -damping[:, :m]
    A[m:, :n] = -stiffness
    load = np.zeros(n + m)
    load[m : 2 * m] = -mass[:m]
    h = STEP / SUBSTEPS
    factors = lu_factor(np.kron(np.eye(3), E) - h * np.kron(WEIGHTS, A))
    state, rows = np.zeros(n + m), [np.zeros(n)]
    for start, end in pairwise(motion):
        for k in range(SUBSTEPS):
            ground = start + (end - start) * (k + TIMES) / SUBSTEPS
            right = np.concatenate([A @ state + load * value for value in ground])
            state = state + h * WEIGHTS[2] @ lu_solve(factors, right).reshape(3, -1)
        rows.append(state[:n])
    return np.array(rows)


@pytest.mark.parametrize("seed", every(4, range(40)))
def test_rows_without_mass_agree_with_the_separate_solver(seed):
    mass, stiffness, damping = random_model(seed)
    motion = np.random.default_rng(1000 + seed).normal(0.0, 2.0, 201).cumsum()
    motion *= 3.0 / np.abs(motion).max()  # peak 3 m/s^2
    model = {
        "matrices": {
            "mass": mass.tolist(),
            "stiffness": stiffness.tolist(),
            "damping": damping.tolist(),
        },
        "plausibility": "off, random numbers",
    }
    record = tdint.make_record(motion, dt=STEP, units="m/s^2")
    response = tdint.run(model, record, duration=2.0, history=True, check=False)
    expected = separate(mass, stiffness, damping, motion)
    size = np.abs(expected).max()
    np.testing.assert_allclose(
        response.history.displacement[: len(expected)], expected, atol=1e-8 * size
    )
    peaks = response.stories.peak_displacement
    assert np.all(peaks >= np.abs(expected).max(axis=0) - 1e-8 * size)
