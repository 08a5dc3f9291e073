"""A method for linear buildings by SciPy's matrix exponential. It is exact for a ground
acceleration that is linear between its samples (Van Loan 1978, IEEE Transactions on Automatic
Control 23)."""

import numpy as np
from scipy.linalg import expm

from tdint.plugin import Problem


def state_space(problem: Problem):
    """Return times and displacements at the samples."""
    building, h, n = problem.building, problem.interval, problem.building.stories
    # d/dt of (u, h v, ground, h ground') over a step as the unit of time
    matrix = np.zeros((2 * n + 2, 2 * n + 2))
    matrix[:n, n : 2 * n] = np.eye(n)
    matrix[n : 2 * n, :n] = -h * h * building.stiffness_matrix() / building.mass[:, None]
    matrix[n : 2 * n, n : 2 * n] = -h * building.damping_matrix() / building.mass[:, None]
    matrix[n : 2 * n, 2 * n] = -h * h
    matrix[2 * n, 2 * n + 1] = 1.0
    step = expm(matrix)[: 2 * n]
    states = np.zeros((problem.samples + 1, 2 * n))
    ground = np.zeros(problem.samples + 1)
    ground[: problem.ground.size] = problem.ground[: ground.size]
    for j, rise in enumerate(np.diff(ground)):
        states[j + 1] = step @ np.concatenate([states[j], [ground[j], rise]])
    return h * np.arange(problem.samples + 1), states[:, :n]


PEERS = (("state-space", state_space),)
