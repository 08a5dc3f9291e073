"""The direct solves of `tdint.kernels.equations.tridiagonal` against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest

from tdint.kernels.bundles import Factors
from tdint.kernels.equations.tridiagonal import (
    COUPLING_ROWS,
    ModalBlocks,
    factor_blocks,
    factor_damped,
    solve_blocks_damped,
    solve_damped,
)


@pytest.mark.parametrize("modes", [0, 1, 3, 8])
@pytest.mark.parametrize("n", [1, 2, 8])
def test_tridiagonal_with_low_rank(n, modes):
    modes = min(modes, n)
    generator = np.random.default_rng(n * 10 + modes)
    springs = generator.uniform(1.0, 2.0, n)
    coupling = np.append(0.0, -springs[1:])
    diagonal = springs + np.append(springs[1:], 0.0) + generator.uniform(0.1, 1.0, n)
    w = np.hstack([generator.normal(size=(modes, n)), np.zeros((modes, 1))])
    right = generator.normal(size=n)
    scale = 0.3
    dense = np.diag(diagonal) + np.diag(coupling[1:], 1) + np.diag(coupling[1:], -1) + scale * w[:, :n].T @ w[:, :n]
    work = np.zeros((3 + 2 * modes + 1, max(n, 2 * modes) + 1))
    work[0, :n], work[1, :n], work[2, :n] = diagonal, coupling, right
    factors = Factors(work, 0, 1, 3)
    factor_damped(factors, w, scale, n)
    solve_damped(factors, w, 2, n)
    assert work[2, :n] == pytest.approx(np.linalg.solve(dense, right), rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("modes", [0, 1, 5])
@pytest.mark.parametrize("n", [1, 2, 5])
def test_blocks_with_low_rank(n, modes):
    modes = min(modes, n)
    generator = np.random.default_rng(n * 10 + modes)
    b = generator.uniform(-0.3, 0.3, (4, n))
    b[:, 0] = 0.0
    blocks = generator.uniform(-0.5, 0.5, (4, n)) + np.array([[3.0], [0.0], [0.0], [3.0]])
    s = generator.uniform(-0.4, 0.4, 4)
    w = np.hstack([generator.normal(size=(modes, n)), np.zeros((modes, 1))])
    right = generator.normal(size=(2, n))
    dense = np.zeros((n, 2, n, 2))
    for i in range(n):
        dense[i, :, i, :] = blocks[:, i].reshape(2, 2)
        if i:
            dense[i, :, i - 1, :] = dense[i - 1, :, i, :] = -b[:, i].reshape(2, 2)
    dense += np.einsum("pq,ij->ipjq", s.reshape(2, 2), w[:, :n].T @ w[:, :n])
    expected = np.linalg.solve(dense.reshape(2 * n, 2 * n), right.T.ravel()).reshape(n, 2).T
    x = 4 + COUPLING_ROWS
    work = np.zeros((x + 2 + 6 * modes + 1, max(n, 2 * modes) + 1))
    work[:4, :n], work[4:8, :n], work[x : x + 2, :n] = blocks, b, right
    factors, damping = Factors(work, 0, 4, x + 2), ModalBlocks(w, *s)
    factor_blocks(factors, damping, n)
    solve_blocks_damped(factors, damping, x, x + 1, n)
    assert work[x : x + 2, :n] == pytest.approx(expected, rel=1e-11, abs=1e-12)
