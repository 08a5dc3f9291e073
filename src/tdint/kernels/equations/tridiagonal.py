"""Direct solves with the matrices of a chain: tridiagonal, real or complex, and block tridiagonal
with 2 x 2 blocks.

Modal damping adds C = W^T W with one row of W per damped mode; it enters by the
Sherman-Morrison-Woodbury formula, so no dense matrix of the size of the building is made. No
pivoting: the leading blocks are those of the building cut off above a story, for which the same
step is solvable.
"""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import VARIANT, inline, outlined
from tdint.kernels.stepping import Array

_MODAL = VARIANT.modal

COUPLING_ROWS = 8
"""Rows that the factors of `factor_blocks` have for the couplings, of which the first half is given
to it."""


class Combination(NamedTuple):
    """by_m M + by_c C + by_k K."""

    by_m: float
    by_c: float
    by_k: float


class ModalBlocks(NamedTuple):
    """[[xx, xy], [yx, yy]] (x) W^T W: modal damping where unknowns are pairs (x, y) per floor."""

    modal: Array
    xx: float
    xy: float
    yx: float
    yy: float


@inline
def factor(factors, n):
    """L D L^T of a symmetric tridiagonal matrix in place.

    The row of pivots, which holds the diagonal, becomes the inverse pivots; that of couplings,
    entry i the coupling of i with i - 1, the multipliers.
    """
    scratch, diagonal, coupling, _ = factors
    scratch[diagonal, 0] = 1.0 / scratch[diagonal, 0]
    for i in range(1, n):
        multiplier = scratch[coupling, i] * scratch[diagonal, i - 1]
        scratch[diagonal, i] = 1.0 / (scratch[diagonal, i] - multiplier * scratch[coupling, i])
        scratch[coupling, i] = multiplier


@inline
def solve(factors, x, n):
    """Solve with the factors of `factor`; row `x` of their table holds the right side and becomes
    the solution."""
    scratch, diagonal, coupling, _ = factors
    carried = scratch[x, 0]
    for i in range(1, n):
        carried = scratch[x, i] - scratch[coupling, i] * carried
        scratch[x, i] = carried
    carried = scratch[x, n - 1] * scratch[diagonal, n - 1]
    scratch[x, n - 1] = carried
    for i in range(n - 2, -1, -1):
        carried = scratch[x, i] * scratch[diagonal, i] - scratch[coupling, i + 1] * carried
        scratch[x, i] = carried


@outlined
def invert(scratch, first, size):
    """Invert a dense matrix in place by Gauss-Jordan elimination.

    Rows `first` .. `first + size - 1` of `scratch` hold it in their first `size` columns. The
    matrices
    are those of Woodbury's formula, identity plus a damping matrix: well conditioned, so no
    pivoting is needed.
    """
    for p in range(size):
        inverse = 1.0 / scratch[first + p, p]
        scratch[first + p, p] = 1.0
        for j in range(size):
            scratch[first + p, j] *= inverse
        for i in range(size):
            if i != p:
                multiplier = scratch[first + i, p]
                scratch[first + i, p] = 0.0
                for j in range(size):
                    scratch[first + i, j] -= multiplier * scratch[first + p, j]


@outlined
def factor_damped(factors, modal, scale, n):
    """Factor T + scale * W^T W, T as for `factor`.

    Rows from `factors.store` on are kept for `solve_damped`: T^-1 W^T (one row per mode), then
    scale * (I + scale W T^-1 W^T)^-1, then one row of scratch.
    """
    factor(factors, n)
    if _MODAL:
        _store_damped(factors, modal, scale, n)


@outlined
def _store_damped(factors, modal, scale, n):
    """What `factor_damped` keeps of the modes."""
    scratch, _, _, store = factors
    modes = modal.shape[0]
    small = store + modes
    for j in range(modes):
        for i in range(n):
            scratch[store + j, i] = modal[j, i]
        solve(factors, store + j, n)
    for j in range(modes):
        for k in range(modes):
            product = 0.0
            for i in range(n):
                product += modal[j, i] * scratch[store + k, i]
            scratch[small + j, k] = scale * product + (1.0 if j == k else 0.0)
    invert(scratch, small, modes)
    for j in range(modes):
        for k in range(modes):
            scratch[small + j, k] *= scale


@inline
def solve_damped(factors, modal, x, n):
    """Solve with the factors of `factor_damped`; row `x` holds the right side and becomes the
    solution."""
    solve(factors, x, n)
    if _MODAL and modal.shape[0] > 0:
        _correct_damped(factors.table, modal, factors.store, x, n)


@outlined
def _correct_damped(scratch, modal, store, x, n):
    """Woodbury's correction of `solve_damped`."""
    modes = modal.shape[0]
    small = store + modes
    temporary = small + modes
    for j in range(modes):
        product = 0.0
        for i in range(n):
            product += modal[j, i] * scratch[x, i]
        scratch[temporary, j] = product
    for j in range(modes):
        amplitude = 0.0
        for k in range(modes):
            amplitude += scratch[small + j, k] * scratch[temporary, k]
        for i in range(n):
            scratch[x, i] -= amplitude * scratch[store + j, i]


@inline
def assemble_combination(linear_terms, law_state, row, combination, factors, n):
    """by_m M + by_c C + by_k K for `factor`, without the modal part of C; row `row` of `law_state`
    is
    the stiffness of each story, to which the geometric one is added."""
    by_m, by_c, by_k = combination
    scratch, diagonal, coupling, _ = factors
    for i in range(n):
        story = (
            by_k * (law_state[row, i] + linear_terms[rows.GEOMETRIC, i])
            + by_c * linear_terms[rows.STORY_DAMPER, i]
        )
        scratch[diagonal, i] = (
            by_m * linear_terms[rows.MASS, i] + by_c * linear_terms[rows.FLOOR_DAMPER, i] + story
        )
        scratch[coupling, i] = -linear_terms[rows.LINK, i] * story
    for i in range(n - 1):
        scratch[diagonal, i] -= scratch[coupling, i + 1]


@outlined
def factor_combination(linear_terms, modal, law_state, row, combination, factors, n):
    """Factor by_m M + by_c C + by_k K as `factor_damped` does; `law_state` as for
    `assemble_combination`."""
    assemble_combination(linear_terms, law_state, row, combination, factors, n)
    factor_damped(factors, modal, combination.by_c, n)


@inline
def assemble_blocks(linear_terms, factors, by_v, by_a, n):
    """Newton matrix of a step with the unknowns (u1 - u0, v1 - v0) per floor and a1 eliminated by
    equilibrium.

    The rows of couplings hold the four entries that each story brings, springs and dampers; by_v
    and by_a are the weights of v1 and -a1 in the kinematic line u1 - u0 = ... The couplings are cut
    where a story stands on the ground.
    """
    scratch, blocks, coupling, _ = factors
    for i in range(n):
        mass = linear_terms[rows.MASS, i]
        floor = linear_terms[rows.FLOOR_DAMPER, i]
        scratch[blocks, i] = mass + scratch[coupling, i]
        scratch[blocks + 1, i] = scratch[coupling + 1, i] - by_v * mass - by_a * floor
        scratch[blocks + 2, i] = floor + scratch[coupling + 2, i]
        scratch[blocks + 3, i] = mass + scratch[coupling + 3, i]
    link_blocks(linear_terms, factors, n)


@outlined
def link_blocks(linear_terms, factors, n):
    """Add what each story brings to the block of the floor below it, and cut the coupling where
    there is none."""
    scratch, blocks, coupling, _ = factors
    for i in range(n):
        for entry in range(4):
            scratch[coupling + entry, i] *= linear_terms[rows.LINK, i]
    for i in range(n - 1):
        for entry in range(4):
            scratch[blocks + entry, i] += scratch[coupling + entry, i + 1]


@outlined
def factor_blocks(factors, damping, n):
    """Factor a block tridiagonal matrix with 2 x 2 blocks, plus a `ModalBlocks`.

    Four rows from `factors.pivot` on: the entries of each diagonal block, row by row; they become
    the inverses A of the block pivots. Rows from `factors.coupling` on: the four entries of B,
    where -B is both the block left of the diagonal in row i and, in row i - 1, the one right of it;
    they become those of B_i A_(i-1), and the next COUPLING_ROWS / 2 rows those of A_i B_(i+1), so
    that a solve waits for one product a floor. Unknowns are pairs (x, y) per floor. From
    `factors.store` on, four rows for each mode (both columns of T^-1 (I2 (x) W^T), x then y), the
    small inverse in 2 modes rows, one row of scratch.
    """
    scratch, blocks, coupling, _ = factors
    upper = coupling + COUPLING_ROWS // 2
    for i in range(n):
        p = scratch[blocks, i]
        q = scratch[blocks + 1, i]
        r = scratch[blocks + 2, i]
        s = scratch[blocks + 3, i]
        if i > 0:
            b0, b1, b2, b3 = (
                scratch[coupling, i],
                scratch[coupling + 1, i],
                scratch[coupling + 2, i],
                scratch[coupling + 3, i],
            )
            i0, i1 = scratch[blocks, i - 1], scratch[blocks + 1, i - 1]
            i2, i3 = scratch[blocks + 2, i - 1], scratch[blocks + 3, i - 1]
            x0 = i0 * b0 + i1 * b2
            x1 = i0 * b1 + i1 * b3
            x2 = i2 * b0 + i3 * b2
            x3 = i2 * b1 + i3 * b3
            p -= b0 * x0 + b1 * x2
            q -= b0 * x1 + b1 * x3
            r -= b2 * x0 + b3 * x2
            s -= b2 * x1 + b3 * x3
            scratch[upper, i - 1] = x0
            scratch[upper + 1, i - 1] = x1
            scratch[upper + 2, i - 1] = x2
            scratch[upper + 3, i - 1] = x3
            scratch[coupling, i] = b0 * i0 + b1 * i2
            scratch[coupling + 1, i] = b0 * i1 + b1 * i3
            scratch[coupling + 2, i] = b2 * i0 + b3 * i2
            scratch[coupling + 3, i] = b2 * i1 + b3 * i3
        inverse = 1.0 / (p * s - q * r)
        scratch[blocks, i] = s * inverse
        scratch[blocks + 1, i] = -q * inverse
        scratch[blocks + 2, i] = -r * inverse
        scratch[blocks + 3, i] = p * inverse
    for entry in range(4):
        scratch[upper + entry, n - 1] = 0.0
    if _MODAL:
        _store_blocks_damped(factors, damping, n)


@inline
def solve_blocks(factors, x, y, n):
    """Solve with the blocks of `factor_blocks`, without the modal part; rows `x` and `y` become the
    solution."""
    scratch, blocks, coupling, _ = factors
    upper = coupling + COUPLING_ROWS // 2
    x0 = scratch[x, 0]
    y0 = scratch[y, 0]
    for i in range(1, n):
        forward = scratch[x, i] + scratch[coupling, i] * x0 + scratch[coupling + 1, i] * y0
        y0 = scratch[y, i] + scratch[coupling + 2, i] * x0 + scratch[coupling + 3, i] * y0
        x0 = forward
        scratch[x, i] = x0
        scratch[y, i] = y0
    p = 0.0
    q = 0.0
    for i in range(n - 1, -1, -1):
        x0 = scratch[x, i]
        y0 = scratch[y, i]
        backward = (
            scratch[blocks, i] * x0
            + scratch[blocks + 1, i] * y0
            + scratch[upper, i] * p
            + scratch[upper + 1, i] * q
        )
        q = (
            scratch[blocks + 2, i] * x0
            + scratch[blocks + 3, i] * y0
            + scratch[upper + 2, i] * p
            + scratch[upper + 3, i] * q
        )
        p = backward
        scratch[x, i] = p
        scratch[y, i] = q


@outlined
def factor_pairs(linear_terms, law_state, root, factors, damping, n):
    """Factor M + l C + l^2 K with a complex number l, real and imaginary part `root`, for the
    branches that the stories are on; `damping` is l C of the modes.

    Two rows from `factors.pivot` on become the inverse pivots, two from `factors.coupling` on the
    multipliers of the elimination from the ground up, real and imaginary part each; from
    `factors.store` on rows as of `factor_blocks`.

    No pivot vanishes where 1 / l has a positive real part and is not real, whatever the signs of
    the slopes: of a leading block that is singular, x* times it x = 0 would make 1 / l a root s of
    m s^2 + c s + k, with real k, m > 0 and c >= 0, and no such root has a positive real part unless
    it is real.
    """
    re, im = root
    scratch, pivot, coupling, _ = factors
    square_re = re * re - im * im
    square_im = 2.0 * re * im
    spring = law_state[rows.SLOPE, 0] + linear_terms[rows.GEOMETRIC, 0]
    damper = linear_terms[rows.STORY_DAMPER, 0]
    story_re = re * damper + square_re * spring
    story_im = im * damper + square_im * spring
    link = 0.0  # of the story to what is eliminated
    inverse_re = 0.0  # of the pivot below
    inverse_im = 0.0
    for i in range(n):
        # The diagonal less what the elimination of the floor below takes: -b stands on both sides
        # of it.
        b_re = link * story_re
        b_im = link * story_im
        by_re = b_re * inverse_re - b_im * inverse_im
        by_im = b_re * inverse_im + b_im * inverse_re
        p = linear_terms[rows.MASS, i] + re * linear_terms[rows.FLOOR_DAMPER, i] + story_re
        q = im * linear_terms[rows.FLOOR_DAMPER, i] + story_im
        p -= by_re * b_re - by_im * b_im
        q -= by_re * b_im + by_im * b_re
        scratch[coupling, i] = -by_re
        scratch[coupling + 1, i] = -by_im
        # What the story above brings
        link = linear_terms[rows.LINK, i + 1]
        spring = law_state[rows.SLOPE, i + 1] + linear_terms[rows.GEOMETRIC, i + 1]
        damper = linear_terms[rows.STORY_DAMPER, i + 1]
        story_re = re * damper + square_re * spring
        story_im = im * damper + square_im * spring
        p += link * story_re
        q += link * story_im
        inverse = 1.0 / (p * p + q * q)
        inverse_re = p * inverse
        inverse_im = -q * inverse
        scratch[pivot, i] = inverse_re
        scratch[pivot + 1, i] = inverse_im
    scratch[coupling, n] = 0.0
    scratch[coupling + 1, n] = 0.0
    if _MODAL:
        _store_pairs_damped(factors, damping, n)


@inline
def solve_pairs(factors, x, y, n):
    """Solve with the factors of `factor_pairs`, without the modal part; rows `x` and `y`, real and
    imaginary part of the right side, become the solution."""
    scratch, pivot, coupling, _ = factors
    x0 = scratch[x, 0]
    y0 = scratch[y, 0]
    for i in range(1, n):
        by_re = scratch[coupling, i]
        by_im = scratch[coupling + 1, i]
        forward = scratch[x, i] - by_re * x0 + by_im * y0
        y0 = scratch[y, i] - by_re * y0 - by_im * x0
        x0 = forward
        scratch[x, i] = x0
        scratch[y, i] = y0
    p = 0.0
    q = 0.0
    for i in range(n - 1, -1, -1):
        by_re = scratch[coupling, i + 1]
        by_im = scratch[coupling + 1, i + 1]
        re = scratch[pivot, i]
        im = scratch[pivot + 1, i]
        x0 = scratch[x, i]
        y0 = scratch[y, i]
        backward = re * x0 - im * y0 - by_re * p + by_im * q
        q = re * y0 + im * x0 - by_re * q - by_im * p
        p = backward
        scratch[x, i] = p
        scratch[y, i] = q


def _storing(solve_undamped):
    """A function that keeps what Woodbury's formula needs of the modes, with `solve_blocks` or
    `solve_pairs`."""

    @outlined
    def store_damped(factors, damping, n):
        scratch, _, _, store = factors
        modal, xx, xy, yx, yy = damping
        modes = modal.shape[0]
        small = store + 4 * modes
        for j in range(2 * modes):
            x = store + 2 * j
            for i in range(n):
                scratch[x, i] = modal[j, i] if j < modes else 0.0
                scratch[x + 1, i] = 0.0 if j < modes else modal[j - modes, i]
            solve_undamped(factors, x, x + 1, n)
        for j in range(modes):
            for k in range(2 * modes):
                in_x = 0.0
                in_y = 0.0
                for i in range(n):
                    in_x += modal[j, i] * scratch[store + 2 * k, i]
                    in_y += modal[j, i] * scratch[store + 2 * k + 1, i]
                scratch[small + j, k] = xx * in_x + xy * in_y + (1.0 if j == k else 0.0)
                scratch[small + modes + j, k] = (
                    yx * in_x + yy * in_y + (1.0 if modes + j == k else 0.0)
                )
        invert(scratch, small, 2 * modes)

    return store_damped


_store_blocks_damped = _storing(solve_blocks)
_store_pairs_damped = _storing(solve_pairs)


@outlined
def _correct_pairs(factors, damping, x, y, n):
    """Woodbury's correction of what was solved without the modes."""
    scratch, _, _, store = factors
    modal, xx, xy, yx, yy = damping
    modes = modal.shape[0]
    small = store + 4 * modes
    temporary = small + 2 * modes
    for j in range(modes):
        in_x = 0.0
        in_y = 0.0
        for i in range(n):
            in_x += modal[j, i] * scratch[x, i]
            in_y += modal[j, i] * scratch[y, i]
        scratch[temporary, j] = xx * in_x + xy * in_y
        scratch[temporary, modes + j] = yx * in_x + yy * in_y
    for j in range(2 * modes):
        amplitude = 0.0
        for k in range(2 * modes):
            amplitude += scratch[small + j, k] * scratch[temporary, k]
        for i in range(n):
            scratch[x, i] -= amplitude * scratch[store + 2 * j, i]
            scratch[y, i] -= amplitude * scratch[store + 2 * j + 1, i]


def _solving(solve_undamped):
    """A function that solves with `solve_blocks` or `solve_pairs` and adds the modal part."""

    @inline
    def solve_both(factors, damping, x, y, n):
        solve_undamped(factors, x, y, n)
        if _MODAL and damping.modal.shape[0] > 0:
            _correct_pairs(factors, damping, x, y, n)

    return solve_both


solve_blocks_damped = _solving(solve_blocks)
"""(factors, damping, x, y, n): solve with the factors of `factor_blocks`; rows `x` and `y` hold the
right side and become the solution."""

solve_pairs_damped = _solving(solve_pairs)
"""The same with the factors of `factor_pairs`."""
