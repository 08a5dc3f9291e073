"""Direct solves with the matrices of a chain: tridiagonal, real or complex, and block tridiagonal
with 2 x 2 blocks.

Modal damping adds C = W^T W with one row of W per damped mode; it enters by the
Sherman-Morrison-Woodbury formula, so no dense matrix of the size of the building is made. No
pivoting: the leading blocks are those of the building cut off above a story, for which the same
step is solvable.
"""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.compiling import VARIANT, called, inlined
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


@inlined
def factor(factors, n):
    """L D L^T of a symmetric tridiagonal matrix in place.

    The row of pivots, which holds the diagonal, becomes the inverse pivots; that of couplings,
    entry i the coupling of i with i - 1, the multipliers.
    """
    work, diagonal, coupling, _ = factors
    work[diagonal, 0] = 1.0 / work[diagonal, 0]
    for i in range(1, n):
        multiplier = work[coupling, i] * work[diagonal, i - 1]
        work[diagonal, i] = 1.0 / (work[diagonal, i] - multiplier * work[coupling, i])
        work[coupling, i] = multiplier


@inlined
def solve(factors, x, n):
    """Solve with the factors of `factor`; row `x` of their table holds the right side and becomes
    the solution."""
    work, diagonal, coupling, _ = factors
    carried = work[x, 0]
    for i in range(1, n):
        carried = work[x, i] - work[coupling, i] * carried
        work[x, i] = carried
    carried = work[x, n - 1] * work[diagonal, n - 1]
    work[x, n - 1] = carried
    for i in range(n - 2, -1, -1):
        carried = work[x, i] * work[diagonal, i] - work[coupling, i + 1] * carried
        work[x, i] = carried


@called
def invert(work, first, size):
    """Invert a dense matrix in place by Gauss-Jordan elimination.

    Rows `first` .. `first + size - 1` of `work` hold it in their first `size` columns. The matrices
    are those of Woodbury's formula, identity plus a damping matrix: well conditioned, so no
    pivoting is needed.
    """
    for p in range(size):
        inverse = 1.0 / work[first + p, p]
        work[first + p, p] = 1.0
        for j in range(size):
            work[first + p, j] *= inverse
        for i in range(size):
            if i != p:
                multiplier = work[first + i, p]
                work[first + i, p] = 0.0
                for j in range(size):
                    work[first + i, j] -= multiplier * work[first + p, j]


@called
def factor_damped(factors, modal, scale, n):
    """Factor T + scale * W^T W, T as for `factor`.

    Rows from `factors.store` on are kept for `solve_damped`: T^-1 W^T (one row per mode), then
    scale * (I + scale W T^-1 W^T)^-1, then one row of scratch.
    """
    factor(factors, n)
    if _MODAL:
        _store_damped(factors, modal, scale, n)


@called
def _store_damped(factors, modal, scale, n):
    """What `factor_damped` keeps of the modes."""
    work, _, _, store = factors
    modes = modal.shape[0]
    small = store + modes
    for j in range(modes):
        for i in range(n):
            work[store + j, i] = modal[j, i]
        solve(factors, store + j, n)
    for j in range(modes):
        for k in range(modes):
            product = 0.0
            for i in range(n):
                product += modal[j, i] * work[store + k, i]
            work[small + j, k] = scale * product + (1.0 if j == k else 0.0)
    invert(work, small, modes)
    for j in range(modes):
        for k in range(modes):
            work[small + j, k] *= scale


@inlined
def solve_damped(factors, modal, x, n):
    """Solve with the factors of `factor_damped`; row `x` holds the right side and becomes the
    solution."""
    solve(factors, x, n)
    if _MODAL and modal.shape[0] > 0:
        _correct_damped(factors.table, modal, factors.store, x, n)


@called
def _correct_damped(work, modal, store, x, n):
    """Woodbury's correction of `solve_damped`."""
    modes = modal.shape[0]
    small = store + modes
    scratch = small + modes
    for j in range(modes):
        product = 0.0
        for i in range(n):
            product += modal[j, i] * work[x, i]
        work[scratch, j] = product
    for j in range(modes):
        amplitude = 0.0
        for k in range(modes):
            amplitude += work[small + j, k] * work[scratch, k]
        for i in range(n):
            work[x, i] -= amplitude * work[store + j, i]


@inlined
def assemble_combination(linear_terms, springs, row, combination, factors, n):
    """by_m M + by_c C + by_k K for `factor`, without the modal part of C; row `row` of `springs` is
    the stiffness of each story, to which the geometric one is added."""
    by_m, by_c, by_k = combination
    work, diagonal, coupling, _ = factors
    for i in range(n):
        story = (
            by_k * (springs[row, i] + linear_terms[at.GEOMETRIC, i])
            + by_c * linear_terms[at.STORY_DAMPER, i]
        )
        work[diagonal, i] = (
            by_m * linear_terms[at.MASS, i] + by_c * linear_terms[at.FLOOR_DAMPER, i] + story
        )
        work[coupling, i] = -linear_terms[at.LINK, i] * story
    for i in range(n - 1):
        work[diagonal, i] -= work[coupling, i + 1]


@called
def factor_combination(linear_terms, modal, springs, row, combination, factors, n):
    """Factor by_m M + by_c C + by_k K as `factor_damped` does; `springs` as for
    `assemble_combination`."""
    assemble_combination(linear_terms, springs, row, combination, factors, n)
    factor_damped(factors, modal, combination.by_c, n)


@inlined
def assemble_blocks(linear_terms, factors, by_v, by_a, n):
    """Newton matrix of a step with the unknowns (u1 - u0, v1 - v0) per floor and a1 eliminated by
    equilibrium.

    The rows of couplings hold the four entries that each story brings, springs and dampers; by_v
    and by_a are the weights of v1 and -a1 in the kinematic line u1 - u0 = ... The couplings are cut
    where a story stands on the ground.
    """
    work, blocks, coupling, _ = factors
    for i in range(n):
        mass = linear_terms[at.MASS, i]
        floor = linear_terms[at.FLOOR_DAMPER, i]
        work[blocks, i] = mass + work[coupling, i]
        work[blocks + 1, i] = work[coupling + 1, i] - by_v * mass - by_a * floor
        work[blocks + 2, i] = floor + work[coupling + 2, i]
        work[blocks + 3, i] = mass + work[coupling + 3, i]
    link_blocks(linear_terms, factors, n)


@called
def link_blocks(linear_terms, factors, n):
    """Add what each story brings to the block of the floor below it, and cut the coupling where
    there is none."""
    work, blocks, coupling, _ = factors
    for i in range(n):
        for entry in range(4):
            work[coupling + entry, i] *= linear_terms[at.LINK, i]
    for i in range(n - 1):
        for entry in range(4):
            work[blocks + entry, i] += work[coupling + entry, i + 1]


@called
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
    work, blocks, coupling, _ = factors
    upper = coupling + COUPLING_ROWS // 2
    for i in range(n):
        p = work[blocks, i]
        q = work[blocks + 1, i]
        r = work[blocks + 2, i]
        s = work[blocks + 3, i]
        if i > 0:
            b0, b1, b2, b3 = (
                work[coupling, i],
                work[coupling + 1, i],
                work[coupling + 2, i],
                work[coupling + 3, i],
            )
            i0, i1 = work[blocks, i - 1], work[blocks + 1, i - 1]
            i2, i3 = work[blocks + 2, i - 1], work[blocks + 3, i - 1]
            x0 = i0 * b0 + i1 * b2
            x1 = i0 * b1 + i1 * b3
            x2 = i2 * b0 + i3 * b2
            x3 = i2 * b1 + i3 * b3
            p -= b0 * x0 + b1 * x2
            q -= b0 * x1 + b1 * x3
            r -= b2 * x0 + b3 * x2
            s -= b2 * x1 + b3 * x3
            work[upper, i - 1] = x0
            work[upper + 1, i - 1] = x1
            work[upper + 2, i - 1] = x2
            work[upper + 3, i - 1] = x3
            work[coupling, i] = b0 * i0 + b1 * i2
            work[coupling + 1, i] = b0 * i1 + b1 * i3
            work[coupling + 2, i] = b2 * i0 + b3 * i2
            work[coupling + 3, i] = b2 * i1 + b3 * i3
        inverse = 1.0 / (p * s - q * r)
        work[blocks, i] = s * inverse
        work[blocks + 1, i] = -q * inverse
        work[blocks + 2, i] = -r * inverse
        work[blocks + 3, i] = p * inverse
    for entry in range(4):
        work[upper + entry, n - 1] = 0.0
    if _MODAL:
        _store_blocks_damped(factors, damping, n)


@inlined
def solve_blocks(factors, x, y, n):
    """Solve with the blocks of `factor_blocks`, without the modal part; rows `x` and `y` become the
    solution."""
    work, blocks, coupling, _ = factors
    upper = coupling + COUPLING_ROWS // 2
    x0 = work[x, 0]
    y0 = work[y, 0]
    for i in range(1, n):
        forward = work[x, i] + work[coupling, i] * x0 + work[coupling + 1, i] * y0
        y0 = work[y, i] + work[coupling + 2, i] * x0 + work[coupling + 3, i] * y0
        x0 = forward
        work[x, i] = x0
        work[y, i] = y0
    p = 0.0
    q = 0.0
    for i in range(n - 1, -1, -1):
        x0 = work[x, i]
        y0 = work[y, i]
        backward = (
            work[blocks, i] * x0
            + work[blocks + 1, i] * y0
            + work[upper, i] * p
            + work[upper + 1, i] * q
        )
        q = (
            work[blocks + 2, i] * x0
            + work[blocks + 3, i] * y0
            + work[upper + 2, i] * p
            + work[upper + 3, i] * q
        )
        p = backward
        work[x, i] = p
        work[y, i] = q


@called
def factor_pairs(linear_terms, springs, root, factors, damping, n):
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
    work, pivot, coupling, _ = factors
    square_re = re * re - im * im
    square_im = 2.0 * re * im
    spring = springs[at.SLOPE, 0] + linear_terms[at.GEOMETRIC, 0]
    damper = linear_terms[at.STORY_DAMPER, 0]
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
        p = linear_terms[at.MASS, i] + re * linear_terms[at.FLOOR_DAMPER, i] + story_re
        q = im * linear_terms[at.FLOOR_DAMPER, i] + story_im
        p -= by_re * b_re - by_im * b_im
        q -= by_re * b_im + by_im * b_re
        work[coupling, i] = -by_re
        work[coupling + 1, i] = -by_im
        # What the story above brings
        link = linear_terms[at.LINK, i + 1]
        spring = springs[at.SLOPE, i + 1] + linear_terms[at.GEOMETRIC, i + 1]
        damper = linear_terms[at.STORY_DAMPER, i + 1]
        story_re = re * damper + square_re * spring
        story_im = im * damper + square_im * spring
        p += link * story_re
        q += link * story_im
        inverse = 1.0 / (p * p + q * q)
        inverse_re = p * inverse
        inverse_im = -q * inverse
        work[pivot, i] = inverse_re
        work[pivot + 1, i] = inverse_im
    work[coupling, n] = 0.0
    work[coupling + 1, n] = 0.0
    if _MODAL:
        _store_pairs_damped(factors, damping, n)


@inlined
def solve_pairs(factors, x, y, n):
    """Solve with the factors of `factor_pairs`, without the modal part; rows `x` and `y`, real and
    imaginary part of the right side, become the solution."""
    work, pivot, coupling, _ = factors
    x0 = work[x, 0]
    y0 = work[y, 0]
    for i in range(1, n):
        by_re = work[coupling, i]
        by_im = work[coupling + 1, i]
        forward = work[x, i] - by_re * x0 + by_im * y0
        y0 = work[y, i] - by_re * y0 - by_im * x0
        x0 = forward
        work[x, i] = x0
        work[y, i] = y0
    p = 0.0
    q = 0.0
    for i in range(n - 1, -1, -1):
        by_re = work[coupling, i + 1]
        by_im = work[coupling + 1, i + 1]
        re = work[pivot, i]
        im = work[pivot + 1, i]
        x0 = work[x, i]
        y0 = work[y, i]
        backward = re * x0 - im * y0 - by_re * p + by_im * q
        q = re * y0 + im * x0 - by_re * q - by_im * p
        p = backward
        work[x, i] = p
        work[y, i] = q


def _storing(solve_undamped):
    """A function that keeps what Woodbury's formula needs of the modes, with `solve_blocks` or
    `solve_pairs`."""

    @called
    def store_damped(factors, damping, n):
        work, _, _, store = factors
        modal, xx, xy, yx, yy = damping
        modes = modal.shape[0]
        small = store + 4 * modes
        for j in range(2 * modes):
            x = store + 2 * j
            for i in range(n):
                work[x, i] = modal[j, i] if j < modes else 0.0
                work[x + 1, i] = 0.0 if j < modes else modal[j - modes, i]
            solve_undamped(factors, x, x + 1, n)
        for j in range(modes):
            for k in range(2 * modes):
                in_x = 0.0
                in_y = 0.0
                for i in range(n):
                    in_x += modal[j, i] * work[store + 2 * k, i]
                    in_y += modal[j, i] * work[store + 2 * k + 1, i]
                work[small + j, k] = xx * in_x + xy * in_y + (1.0 if j == k else 0.0)
                work[small + modes + j, k] = (
                    yx * in_x + yy * in_y + (1.0 if modes + j == k else 0.0)
                )
        invert(work, small, 2 * modes)

    return store_damped


_store_blocks_damped = _storing(solve_blocks)
_store_pairs_damped = _storing(solve_pairs)


@called
def _correct_pairs(factors, damping, x, y, n):
    """Woodbury's correction of what was solved without the modes."""
    work, _, _, store = factors
    modal, xx, xy, yx, yy = damping
    modes = modal.shape[0]
    small = store + 4 * modes
    scratch = small + 2 * modes
    for j in range(modes):
        in_x = 0.0
        in_y = 0.0
        for i in range(n):
            in_x += modal[j, i] * work[x, i]
            in_y += modal[j, i] * work[y, i]
        work[scratch, j] = xx * in_x + xy * in_y
        work[scratch, modes + j] = yx * in_x + yy * in_y
    for j in range(2 * modes):
        amplitude = 0.0
        for k in range(2 * modes):
            amplitude += work[small + j, k] * work[scratch, k]
        for i in range(n):
            work[x, i] -= amplitude * work[store + 2 * j, i]
            work[y, i] -= amplitude * work[store + 2 * j + 1, i]


def _solving(solve_undamped):
    """A function that solves with `solve_blocks` or `solve_pairs` and adds the modal part."""

    @inlined
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
