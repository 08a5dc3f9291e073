"""Tests of the direct solvers of `tdint.kernels.equations.tridiagonal` against dense matrices."""

import numpy as np
import pytest

from tdint.kernels import layout as rows
from tdint.kernels.equations import impulse_momentum as momentum
from tdint.kernels.equations.impulse4 import FACTORS, factor_rows, newton, solve_linear
from tdint.kernels.equations.tridiagonal import (
    COUPLING_ROWS,
    ModalBlocks,
    assemble_blocks,
    factor_blocks,
    factor_damped,
    factor_pairs,
    solve_blocks_damped,
    solve_damped,
    solve_pairs_damped,
)
from tdint.kernels.stepping import Factors, Memory, Scene
from tdint.methods.impulse4 import coefficients


@pytest.mark.parametrize("modes", [0, 1, 3, 8])
@pytest.mark.parametrize("n", [1, 2, 8])
def test_tridiagonal_solution_with_low_rank_term(n, modes):
    modes = min(modes, n)
    generator = np.random.default_rng(n * 10 + modes)
    law_state = generator.uniform(1.0, 2.0, n)
    coupling = np.append(0.0, law_state[1:])
    diagonal = law_state + np.append(law_state[1:], 0.0) + generator.uniform(0.1, 1.0, n)
    w = np.hstack([generator.normal(size=(modes, n)), np.zeros((modes, 1))])
    right = generator.normal(size=n)
    scale = 0.3
    dense = (
        np.diag(diagonal)
        - np.diag(coupling[1:], 1)
        - np.diag(coupling[1:], -1)
        + scale * w[:, :n].T @ w[:, :n]
    )
    scratch = np.zeros((3 + 2 * modes + 1, max(n, 2 * modes) + 1))
    scratch[0, :n], scratch[1, :n], scratch[2, :n] = diagonal, coupling, right
    factors = Factors(scratch, 0, 1, 3, np.zeros((rows.LINEAR_TERM_ROWS, n + 1)))
    factor_damped(factors, w, scale, n)
    solve_damped(factors, w, 2, n)
    assert scratch[2, :n] == pytest.approx(np.linalg.solve(dense, right), rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("modes", [0, 1, 3, 4, 5])
@pytest.mark.parametrize("n", [1, 2, 5, 8])
def test_block_solution_with_low_rank_term(n, modes):
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
    scratch = np.zeros((x + 2 + 6 * modes + 1, max(n, 2 * modes) + 1))
    scratch[:4, :n], scratch[4:8, :n], scratch[x : x + 2, :n] = blocks, b, right
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, n + 1))
    factors, damping = Factors(scratch, 0, 4, x + 2, linear_terms), ModalBlocks(w, *s)
    factor_blocks(factors, damping, n)
    solve_blocks_damped(factors, w, x, n)
    assert scratch[x : x + 2, :n] == pytest.approx(expected, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("inerters", [False, True])
@pytest.mark.parametrize("n", [1, 2, 6])
def test_blocks_of_both_equations_with_inerters(n, inerters):
    """Kinematics M u - (by_v M + by_a C) v and momentum C u + M v, with the inerters of floors and
    stories in M, plus the derivatives of the story terms. The fourth story stands on the ground."""
    generator = np.random.default_rng(90 + n)
    by_v, by_a = 0.7, 0.2
    linear_terms = np.zeros((rows.MASS_FACTORS, n + 1))
    mass, damper, on_floor, in_story = generator.uniform(0.5, 2.0, (4, n))
    linear_terms[rows.MASS, :n], linear_terms[rows.FLOOR_DAMPER, :n] = mass, damper
    linear_terms[rows.LINK, 1:n] = 1.0
    linear_terms[rows.LINK, 3:4] = 0.0
    difference = np.eye(n) - np.diag(linear_terms[rows.LINK, 1:n], -1)
    total = np.diag(mass)
    if inerters:
        linear_terms[[rows.FLOOR_INERTANCE, rows.STORY_INERTANCE], :n] = on_floor, in_story
        total = total + np.diag(on_floor) + difference.T @ np.diag(in_story) @ difference
    else:
        linear_terms = linear_terms[: rows.LINEAR_TERM_ROWS]
    of_stories = generator.uniform(-0.2, 0.2, (4, n))
    dense = np.zeros((2, n, 2, n))
    blocks = (total, -by_v * total - by_a * np.diag(damper), np.diag(damper), total)
    for entry, block in enumerate(blocks):
        dense[entry // 2, :, entry % 2, :] = (
            block + difference.T @ np.diag(of_stories[entry]) @ difference
        )
    right = generator.normal(size=(2, n))
    expected = np.linalg.solve(dense.reshape(2 * n, 2 * n), right.ravel()).reshape(2, n)
    x = 5 + COUPLING_ROWS
    scratch = np.zeros((x + 3, n + 1))
    scratch[5:9, :n], scratch[x : x + 2, :n], scratch[4] = of_stories, right, 9.0
    factors = Factors(scratch, 0, 5, x + 2, linear_terms)
    assemble_blocks(linear_terms, factors, by_v, by_a, n)
    factor_blocks(factors, ModalBlocks(np.zeros((0, n + 1)), 0.0, 0.0, 0.0, 0.0), n)
    solve_blocks_damped(factors, np.zeros((0, n + 1)), x, n)
    assert scratch[x : x + 2, :n] == pytest.approx(expected, rel=1e-11, abs=1e-12)
    assert np.all(scratch[4] == 9.0)


def chain(n, modes, generator):
    """Return the columns of the solver and the dense matrices M, C and K of a chain with dampers, a
    softening story, and one story that stands separately on the ground."""
    linear_terms, law_state = (
        np.zeros((rows.LINEAR_TERM_ROWS, n + 1)),
        np.zeros((rows.EXTRA_ROWS, n + 1)),
    )
    linear_terms[[rows.MASS, rows.FLOOR_DAMPER, rows.STORY_DAMPER], :n] = generator.uniform(
        0.1, 1.0, (3, n)
    )
    linear_terms[rows.INVERSE_MASS, :n] = 1.0 / linear_terms[rows.MASS, :n]
    linear_terms[rows.GEOMETRIC, :n] = -generator.uniform(0.0, 0.5, n)
    linear_terms[rows.LINK, 1:n] = 1.0
    linear_terms[rows.LINK, 3:4] = 0.0
    law_state[rows.SLOPE, :n] = 10.0 ** generator.uniform(0.0, 2.0, n)
    law_state[rows.SLOPE, n // 2] *= -0.2
    modal = np.hstack([generator.normal(size=(modes, n)), np.zeros((modes, 1))])
    differences = np.eye(n) - np.diag(linear_terms[rows.LINK, 1:n], -1)
    stiffness = law_state[rows.SLOPE, :n] + linear_terms[rows.GEOMETRIC, :n]
    damping = np.diag(linear_terms[rows.FLOOR_DAMPER, :n]) + modal[:, :n].T @ modal[:, :n]
    return (
        (linear_terms, law_state, modal),
        np.diag(linear_terms[rows.MASS, :n]),
        damping + differences.T @ np.diag(linear_terms[rows.STORY_DAMPER, :n]) @ differences,
        differences.T @ np.diag(stiffness) @ differences,
    )


@pytest.mark.parametrize("modes", range(6))
@pytest.mark.parametrize("n", [1, 2, 5, 8])
def test_complex_solution_with_low_rank_term(n, modes):
    """The dense complex system is (M + l C + l^2 K) w = r, for l from very short steps to steps
    with negligible mass."""
    modes = min(modes, n)
    generator = np.random.default_rng(n * 10 + modes)
    for size in (1e-3, 1.0, 1e3):
        (linear_terms, law_state, modal), mass, damping, stiffness = chain(n, modes, generator)
        root = size * complex(generator.uniform(0.2, 1.0), generator.uniform(0.2, 1.0))
        right = generator.normal(size=n) + 1j * generator.normal(size=n)
        dense = mass + root * damping + root**2 * stiffness
        scratch = np.zeros((6 + 6 * modes + 1, max(n, 2 * modes) + 1))
        scratch[:2, :n] = right.real, right.imag
        factors = Factors(scratch, 2, 4, 6, linear_terms)
        by_modes = ModalBlocks(modal, root.real, -root.imag, root.imag, root.real)
        factor_pairs(linear_terms, law_state, (root.real, root.imag), factors, by_modes, n)
        solve_pairs_damped(factors, modal, 0, n)
        out_of_balance = np.abs(dense @ (scratch[0, :n] + 1j * scratch[1, :n]) - right)
        assert np.all(out_of_balance <= 1e-13 * np.linalg.cond(dense) * np.abs(right).max())
        assert scratch[0, :n] + 1j * scratch[1, :n] == pytest.approx(
            np.linalg.solve(dense, right), rel=1e-9, abs=1e-13
        )


@pytest.mark.parametrize("omega_h", [1e-2, 1.0, 30.0, 1e4])
@pytest.mark.parametrize("rho_inf", [0.0, 0.5, 1.0])
def test_direct_step_of_impulse4_equals_newton_step(rho_inf, omega_h):
    """One complex solve replaces two unknowns per floor, for any state. The rounding error of the
    motion is proportional to omega h, because of the stiffness relative to the mass. In the
    acceleration, which is a difference of forces, it is larger by this factor again."""
    for modes in (0, 3):
        generator = np.random.default_rng(modes)
        n = 6
        (linear_terms, law_state, modal), mass, _, stiffness = chain(n, modes, generator)
        h = omega_h / np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(mass, stiffness))).max())
        state = np.hstack([generator.normal(size=(3, n)), np.zeros((3, 1))])
        law_state[rows.DRIFT] = state[0] - linear_terms[rows.LINK] * np.roll(state[0], 1)
        law_state[rows.FORCE] = generator.normal(size=n + 1)
        laws = np.vstack([np.zeros(n + 1), np.abs(law_state[rows.SLOPE])])
        scene = Scene(
            linear_terms, modal, laws, np.zeros((0, rows.FORCE_COLUMNS)), np.zeros(rows.FLAGS_SIZE)
        )
        scratch = np.zeros((FACTORS + factor_rows(modes), n + 1))
        scratch[[momentum.LOAD, momentum.IMPULSE], :n] = generator.normal(size=(2, n))
        memory = Memory(state, law_state, scratch, np.zeros(rows.STEP_STATUS_SIZE))
        motion = (momentum.DU, momentum.DV, momentum.A1)
        solve_linear(coefficients(rho_inf), scene, h, memory, FACTORS)
        straight = scratch[motion, :n].copy()
        assert newton(True, False, coefficients(rho_inf), scene, h, memory, FACTORS) > 0
        difference = np.abs(straight - scratch[motion, :n]).max(axis=1) / np.abs(straight).max(
            axis=1
        )
        rounding = 32.0 * np.finfo(float).eps * (1.0 + omega_h)
        assert np.all(difference <= [rounding, rounding, rounding * (1.0 + omega_h)])
