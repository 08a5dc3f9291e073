"""Direct solution of the linear systems of a step: tridiagonal or block tridiagonal matrices.

A story couples only adjacent floors. The matrices are therefore tridiagonal (real or complex, one
unknown per floor) or block tridiagonal with 2 x 2 blocks (two unknowns per floor).

Modal damping adds a multiple s of the matrix W^T W, with one row of W for each damped mode. The
Sherman-Morrison-Woodbury formula accounts for this part, so that no dense matrix with the size of
the building is needed:

    (T + s W^T W)^-1 = T^-1 - T^-1 W^T [s (I + s W T^-1 W^T)^-1] W T^-1

Here T is the matrix without modal damping. The matrix in brackets has one row for each mode. If
there are two unknowns per floor and most modes are damped, T + s W^T W is factorized as a full
matrix instead, because this requires fewer operations (`_is_full`).

Pivoting is not necessary: each leading block is the matrix of the part of the building below a
story, for which the same step has a unique solution.
"""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.linear_terms import count_masses, has_inerters, is_tree, tie
from tdint.kernels.stepping import Array

COUPLING_ROWS = 8
"""Number of scratch rows for the couplings between adjacent floors in `factor_blocks`: four entries
of each 2 x 2 block, which the caller stores, and four entries of each product A_i B_(i+1)."""


class Combination(NamedTuple):
    """Coefficients of the matrix by_m M + by_c C + by_k K.

    Attributes
    ----------
    by_m, by_c, by_k : float
        Coefficients of mass, damping and stiffness matrix.
    """

    by_m: float
    by_c: float
    by_k: float


class ModalBlocks(NamedTuple):
    """Modal damping in a matrix with two unknowns (x, y) per floor.

    The equations of x contain W^T W (xx x + xy y), and the equations of y W^T W (yx x + yy y).

    Attributes
    ----------
    modal : ndarray
        W, one row per damped mode.
    xx, xy, yx, yy : float
        Coefficients of x and y in the equations of x (xx, xy) and of y (yx, yy).
    """

    modal: Array
    xx: float
    xy: float
    yx: float
    yy: float


@inline
def factor(factors, n):
    """Compute the factorization T = L D L^T of a symmetric tridiagonal matrix in place.

    Each diagonal entry of L is 1, and D is diagonal. With the diagonal t_i and the entries c_i at
    (i, i - 1), L has the entries c_i / D_(i-1) and D_i = t_i - c_i^2 / D_(i-1).

    Parameters
    ----------
    factors : Factors
        Row `pivot` contains the diagonal of the matrix and receives the inverses of D. Row
        `coupling` contains in column i the matrix entry (i, i - 1) and receives the entry of L.
    n : int
        Number of floors.
    """
    scratch, pivot, coupling, _, linear_terms = factors
    if FULL and is_tree(linear_terms):
        # The floors are eliminated from the tips of the tree on: an attachment before its floor.
        for i in range(count_masses(linear_terms) - 1, -1, -1):
            inverse = 1.0 / scratch[pivot, i]
            scratch[pivot, i] = inverse
            if i > 0:
                base = int(linear_terms[rows.BASE, i])
                multiplier = scratch[coupling, i] * inverse
                scratch[pivot, base] -= multiplier * scratch[coupling, i]
                scratch[coupling, i] = multiplier
                _eliminate_entries(linear_terms, scratch, pivot, coupling, i)
        return
    scratch[pivot, 0] = 1.0 / scratch[pivot, 0]
    for i in range(1, n):
        multiplier = scratch[coupling, i] * scratch[pivot, i - 1]
        scratch[pivot, i] = 1.0 / (scratch[pivot, i] - multiplier * scratch[coupling, i])
        scratch[coupling, i] = multiplier


@inline
def _add_to_entry(linear_terms, scratch, row, i):
    """Move the coupling of link `i` to the column of its matrix entry."""
    entry = int(linear_terms[rows.ENTRY, i])
    if entry != i:
        scratch[row, entry] += scratch[row, i]
        scratch[row, i] = 0.0


@inline
def _entry_between(linear_terms, i, j):
    """Return the column with the matrix entry of the floors `i` and `j`.

    It exists, also if the entry is zero before the elimination (`tdint.model.topology`).
    """
    column, lower = max(i, j), min(i, j)
    while linear_terms[rows.BASE, column] != lower:
        column = int(linear_terms[rows.NEXT_ENTRY, column])
    return column


@outlined
def _eliminate_entries(linear_terms, scratch, pivot, coupling, i):
    """Eliminate floor `i` from the equations of the lower floors of its links, and replace their
    entries by those of L. Row `pivot` contains the inverse of D_i."""
    j = int(linear_terms[rows.NEXT_ENTRY, i])
    while j > 0:
        base, entry = int(linear_terms[rows.BASE, j]), scratch[coupling, j]
        multiplier = entry * scratch[pivot, i]
        scratch[pivot, base] -= multiplier * entry
        k = i
        while k != j:  # the pairs of this floor and the earlier floors of the list
            other = int(linear_terms[rows.BASE, k])
            column = _entry_between(linear_terms, base, other)
            scratch[coupling, column] -= entry * scratch[coupling, k]
            k = int(linear_terms[rows.NEXT_ENTRY, k])
        scratch[coupling, j] = multiplier
        j = int(linear_terms[rows.NEXT_ENTRY, j])


@inline
def solve(factors, x, n):
    """Solve the linear system L D L^T x = b with the factorization of `factor`.

    Parameters
    ----------
    factors : Factors
        Rows with the factorization.
    x : int
        Row of the right side b; it receives the solution x.
    n : int
        Number of floors.
    """
    scratch, pivot, coupling, _, linear_terms = factors
    if FULL and is_tree(linear_terms):
        last = count_masses(linear_terms) - 1
        for i in range(last, 0, -1):
            base = int(linear_terms[rows.BASE, i])
            scratch[x, base] -= scratch[coupling, i] * scratch[x, i]
            j = int(linear_terms[rows.NEXT_ENTRY, i])
            while j > 0:
                base = int(linear_terms[rows.BASE, j])
                scratch[x, base] -= scratch[coupling, j] * scratch[x, i]
                j = int(linear_terms[rows.NEXT_ENTRY, j])
        scratch[x, 0] *= scratch[pivot, 0]
        for i in range(1, last + 1):
            base = int(linear_terms[rows.BASE, i])
            value = scratch[x, i] * scratch[pivot, i] - scratch[coupling, i] * scratch[x, base]
            j = int(linear_terms[rows.NEXT_ENTRY, i])
            while j > 0:
                value -= scratch[coupling, j] * scratch[x, int(linear_terms[rows.BASE, j])]
                j = int(linear_terms[rows.NEXT_ENTRY, j])
            scratch[x, i] = value
        tie(linear_terms, scratch, x)
        return
    # Forward substitution with L
    partial = scratch[x, 0]
    for i in range(1, n):
        partial = scratch[x, i] - scratch[coupling, i] * partial
        scratch[x, i] = partial
    # Backward substitution with D L^T. Row `pivot` contains 1 / D: multiplication divides by D.
    partial = scratch[x, n - 1] * scratch[pivot, n - 1]
    scratch[x, n - 1] = partial
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = n - 1
    while i > 0:
        i -= 1
        partial = scratch[x, i] * scratch[pivot, i] - scratch[coupling, i + 1] * partial
        scratch[x, i] = partial


@outlined
def invert(scratch, first, size):
    """Invert a small dense matrix in place by Gauss-Jordan elimination without pivoting; `first` is
    its first row, `size` its order.

    The matrix of the Woodbury formula is the identity matrix plus a damping matrix and therefore
    well conditioned.
    """
    # The column that becomes a unit vector is not stored; its place receives the column of the
    # inverse.
    for pivot in range(size):
        inverse = 1.0 / scratch[first + pivot, pivot]
        scratch[first + pivot, pivot] = 1.0
        for j in range(size):
            scratch[first + pivot, j] *= inverse
        for i in range(size):
            if i != pivot:
                multiplier = scratch[first + i, pivot]
                scratch[first + i, pivot] = 0.0
                for j in range(size):
                    scratch[first + i, j] -= multiplier * scratch[first + pivot, j]


@outlined
def factor_damped(factors, modal, scale, n):
    """Factorize T + scale W^T W for `solve_damped`, with a symmetric tridiagonal matrix T.

    scale W^T W is modal damping, a dense matrix that is never assembled: only T is factorized, and
    the Woodbury formula corrects the solutions.

    Parameters
    ----------
    factors : Factors
        Row `pivot` contains the diagonal of T, and row `coupling` in column i the entry (i, i - 1).
        They receive the factorization. The rows from `store` on receive the terms of the Woodbury
        formula (`_store_woodbury`).
    modal : ndarray
        W, one row per damped mode.
    scale : float
        Factor of the modal damping matrix.
    n : int
        Number of floors.
    """
    factor(factors, n)
    if FULL:
        _store_woodbury(factors, modal, scale, n)


@outlined
def _store_woodbury(factors, modal, scale, n):
    """Store the terms of the Woodbury formula for s = `scale`: from row `store` on T^-1 W^T, one
    row per mode, then the matrix in brackets.
    """
    scratch, _, _, store, _ = factors
    modes = modal.shape[0]
    inverse_row = store + modes
    for j in range(modes):
        for i in range(n):
            scratch[store + j, i] = modal[j, i]
        solve(factors, store + j, n)
    for j in range(modes):
        for k in range(modes):
            product = 0.0
            for i in range(n):
                product += modal[j, i] * scratch[store + k, i]
            scratch[inverse_row + j, k] = scale * product + (1.0 if j == k else 0.0)
    invert(scratch, inverse_row, modes)
    for j in range(modes):
        for k in range(modes):
            scratch[inverse_row + j, k] *= scale


@inline
def solve_damped(factors, modal, x, n):
    """Solve (T + s W^T W) x = b with the factorization of `factor_damped`, including modal damping.

    Parameters
    ----------
    factors : Factors
        Rows with the factorization of T and the terms of modal damping.
    modal : ndarray
        W, one row per damped mode.
    x : int
        Row of the right side; it receives the solution.
    n : int
        Number of floors.
    """
    solve(factors, x, n)
    if FULL and modal.shape[0] > 0:
        _apply_woodbury(factors.table, modal, factors.store, x, n)


@outlined
def _apply_woodbury(scratch, modal, store, x, n):
    """Correct the solution of the tridiagonal system for modal damping by the Woodbury formula.

    `store` is the first row of T^-1 W^T; the matrix in brackets and one temporary row follow.
    """
    modes = modal.shape[0]
    inverse_row = store + modes
    temporary = inverse_row + modes
    # Row `temporary` receives W x; `amplitude` is an element of the matrix in brackets times W x.
    for j in range(modes):
        product = 0.0
        for i in range(n):
            product += modal[j, i] * scratch[x, i]
        scratch[temporary, j] = product
    for j in range(modes):
        amplitude = 0.0
        for k in range(modes):
            amplitude += scratch[inverse_row + j, k] * scratch[temporary, k]
        for i in range(n):
            scratch[x, i] -= amplitude * scratch[store + j, i]


@inline
def assemble_combination(linear_terms, law_state, row, combination, factors, n):
    """Assemble the tridiagonal matrix by_m M + by_c C + by_k K in the form that `factor` expects.

    M is the mass matrix, C contains floor and story dampers, and K is the sum of tangent and
    geometric stiffnesses of the stories. A story with the contribution k = by_k (stiffness) + by_c
    (damper) adds k to the diagonal entries of the floors above and below, and -k to the entry
    between them. Modal damping is not included in C.

    Parameters
    ----------
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses.
    law_state : ndarray
        Table with the tangent stiffness of each story.
    row : int
        Row of the tangent stiffness in `law_state`, N/m, without the geometric stiffness.
    combination : Combination
        Coefficients by_m, by_c and by_k.
    factors : Factors
        Table that receives the diagonal (row `pivot`) and the entries (i, i - 1) (row `coupling`).
    n : int
        Number of floors.
    """
    by_m, by_c, by_k = combination
    scratch, diagonal, coupling, _, _ = factors
    for i in range(n):
        # `story` is the contribution of story `i` to the floors above and below it.
        story = (
            by_k * (law_state[row, i] + linear_terms[rows.GEOMETRIC, i])
            + by_c * linear_terms[rows.STORY_DAMPER, i]
        )
        floor = by_m * linear_terms[rows.MASS, i] + by_c * linear_terms[rows.FLOOR_DAMPER, i]
        if FULL and has_inerters(linear_terms):
            story += by_m * linear_terms[rows.STORY_INERTANCE, i]
            floor += by_m * linear_terms[rows.FLOOR_INERTANCE, i]
        scratch[diagonal, i] = floor + story
        scratch[coupling, i] = -linear_terms[rows.LINK, i] * story
    # Add the story above to the diagonal entry of each floor; its coupling is the negative value.
    if FULL and is_tree(linear_terms):
        for i in range(1, n):
            scratch[diagonal, int(linear_terms[rows.BASE, i])] -= scratch[coupling, i]
        for i in range(count_masses(linear_terms), n):
            scratch[diagonal, int(linear_terms[rows.UPPER_FLOOR, i])] += scratch[diagonal, i]
            _add_to_entry(linear_terms, scratch, coupling, i)
        return
    for i in range(n - 1):
        scratch[diagonal, i] -= scratch[coupling, i + 1]


@outlined
def factor_combination(linear_terms, modal, law_state, row, combination, factors, n):
    """Assemble and factorize by_m M + by_c C + by_k K, including modal damping, for `solve_damped`.

    Parameters
    ----------
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses.
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T.
    law_state : ndarray
        Table with the tangent stiffness of each story.
    row : int
        Row of the tangent stiffness, N/m.
    combination : Combination
        Coefficients by_m, by_c and by_k.
    factors : Factors
        Rows that receive the factorization.
    n : int
        Number of floors.
    """
    assemble_combination(linear_terms, law_state, row, combination, factors, n)
    factor_damped(factors, modal, combination.by_c, n)


@inline
def assemble_blocks(linear_terms, factors, by_v, by_a, n):
    """Assemble the matrix of Newton's method for the unknowns (u1 - u0, v1 - v0) of each floor.

    Displacement, velocity and acceleration of a floor are u0, v0, a0 at the start and u1, v1, a1 at
    the end of the step. The kinematic equation of the method is u1 - u0 = by_v v1 - by_a a1 + terms
    of the start. It is multiplied by the mass m, and m a1 is replaced by equilibrium: load - c v1 -
    story forces, with the floor damper c. The second equation is the balance of momentum. Row i of
    the matrix then has the diagonal block

        m        -(by_v m + by_a c)        kinematics
        c                 m                momentum

    plus the blocks B_i and B_(i+1) of the stories below and above. The blocks next to the diagonal,
    for the floors below and above, are -B_i and -B_(i+1). They are not stored: the table contains
    B_i, and `factor_blocks` assumes the minus sign. A story on the ground has no floor below: its
    block is added to the diagonal, and is then set to zero in the table.

    Parameters
    ----------
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses.
    factors : Factors
        The first four rows from `coupling` on contain the block B_i of each story, row by row: the
        derivatives of its terms in both equations with respect to both unknowns. The four rows from
        `pivot` on receive the diagonal blocks, row by row.
    by_v, by_a : float
        Coefficients of v1 (s) and, with the opposite sign, of a1 (s^2) in the kinematic equation.
        by_a is positive in methods that subtract the acceleration at the end, such as h^2 / 12 in
        u1 - u0 = h (v0 + v1) / 2 + h^2 (a0 - a1) / 12.
    n : int
        Number of floors.
    """
    scratch, blocks, coupling, _, _ = factors  # `blocks` is the number of row `pivot`.
    for i in range(n):
        mass = linear_terms[rows.MASS, i]
        if FULL and has_inerters(linear_terms):
            mass += linear_terms[rows.FLOOR_INERTANCE, i]
            scratch[coupling, i] += linear_terms[rows.STORY_INERTANCE, i]
            scratch[coupling + 1, i] -= by_v * linear_terms[rows.STORY_INERTANCE, i]
            scratch[coupling + 3, i] += linear_terms[rows.STORY_INERTANCE, i]
        floor = linear_terms[rows.FLOOR_DAMPER, i]
        scratch[blocks, i] = mass + scratch[coupling, i]
        scratch[blocks + 1, i] = scratch[coupling + 1, i] - by_v * mass - by_a * floor
        scratch[blocks + 2, i] = floor + scratch[coupling + 2, i]
        scratch[blocks + 3, i] = mass + scratch[coupling + 3, i]
    # Set B_i of stories on the ground to zero, and add B_(i+1) to the diagonal block of floor i.
    link_blocks(linear_terms, factors, n)


@outlined
def link_blocks(linear_terms, factors, n):
    """Add the 2 x 2 block of each story to the diagonal block of the floor below.

    Story i, with the block B_i, connects floor i and floor i - 1. The caller has already added B_i
    to the diagonal block of floor i. B_i of stories on the ground, which have no floor below, is
    set to zero.

    Parameters
    ----------
    linear_terms : ndarray
        Row LINK is used: 0 for a story on the ground, otherwise 1.
    factors : Factors
        Table with the four entries of each block, row by row: the diagonal blocks from row `pivot`
        on, the blocks B_i from row `coupling` on. Their sign remains positive; `factor_blocks`
        assumes the blocks -B_i between both floors.
    n : int
        Number of floors.
    """
    scratch, blocks, coupling, _, _ = factors  # `blocks` is the number of row `pivot`.
    for i in range(n):
        for entry in range(4):
            scratch[coupling + entry, i] *= linear_terms[rows.LINK, i]
    if FULL and is_tree(linear_terms):
        for i in range(1, n):
            base = int(linear_terms[rows.BASE, i])
            for entry in range(4):
                scratch[blocks + entry, base] += scratch[coupling + entry, i]
        for i in range(count_masses(linear_terms), n):
            floor = int(linear_terms[rows.UPPER_FLOOR, i])
            for entry in range(4):
                scratch[blocks + entry, floor] += scratch[blocks + entry, i]
                _add_to_entry(linear_terms, scratch, coupling + entry, i)
        return
    for i in range(n - 1):
        for entry in range(4):
            scratch[blocks + entry, i] += scratch[coupling + entry, i + 1]


@outlined
def factor_blocks(factors, damping, n):
    """Factorize a block tridiagonal matrix T with 2 x 2 blocks, plus modal damping.

    Each floor i has a pair of unknowns z_i = (x, y). With the 2 x 2 block D_i of the floor and the
    block B_i of the story between the floors i - 1 and i, the equations of T z = b are

        -B_i z_(i-1) + D_i z_i - B_(i+1) z_(i+1) = b_i

    The elimination proceeds from the lowest floor upwards and stores, for `solve_blocks`:

        A_0 = D_0^-1,   A_i = (D_i - B_i A_(i-1) B_i)^-1
        B_i A_(i-1)     factor of floor i - 1 in the forward substitution, upwards
        A_i B_(i+1)     factor of floor i + 1 in the backward substitution, downwards

    Modal damping is added to T in two ways:

    - usually by the Woodbury formula, which needs solutions with T (`store_woodbury`),
    - if most modes are damped (`_is_full`), by a factorization of the sum of T and modal damping as
      a full matrix (`_factor_full`). The factorization of T described above is then omitted.

    Parameters
    ----------
    factors : Factors
        Table and its rows. The four entries of a block are in four rows, row by row of the block.

            rows                            before      after
            pivot to pivot + 3              D_i         A_i
            coupling to coupling + 3        B_i         B_i A_(i-1)
            coupling + 4 to coupling + 7                A_i B_(i+1)
            from store on                               terms of the Woodbury formula

        If most modes are damped, only the rows from `store` on change: they receive the full
        factorization.
    damping : ModalBlocks
        Modal damping.
    n : int
        Number of floors.
    """
    if FULL and _is_full(factors.linear_terms, damping.modal, n):
        _factor_full(factors, damping, n)
        return
    if FULL and is_tree(factors.linear_terms):
        _factor_tree_blocks(factors, n)
        _store_blocks_woodbury(factors, damping, n)
        return
    scratch, blocks, coupling, _, _ = factors  # `blocks` is the number of row `pivot`
    # The second half of the coupling rows is for the products A_i B_(i+1).
    upper = coupling + COUPLING_ROWS // 2
    for i in range(n):
        # The block pivot of floor `i` is D_i minus B_i A_(i-1) B_i, with the coupling block B_i to
        # the floor below and the inverse block pivot A_(i-1) of the floor below; x is A_(i-1) B_i.
        p, q, r, s = _block(scratch, blocks, i)
        if i > 0:
            coupling_block, inverse = _block(scratch, coupling, i), _block(scratch, blocks, i - 1)
            x = _product(inverse, coupling_block)
            reduction = _product(coupling_block, x)
            p -= reduction[0]
            q -= reduction[1]
            r -= reduction[2]
            s -= reduction[3]
            # A_(i-1) B_i is for the backward and B_i A_(i-1) for the forward substitution.
            _store_block(scratch, upper, i - 1, x)
            _store_block(scratch, coupling, i, _product(coupling_block, inverse))
        _store_block(scratch, blocks, i, _inverse((p, q, r, s)))
    # There is no floor above the roof.
    for entry in range(4):
        scratch[upper + entry, n - 1] = 0.0
    if FULL:
        _store_blocks_woodbury(factors, damping, n)


@inline
def _block(scratch, row, i, step=1):
    """Return the 2 x 2 block in column `i`, row by row. Its entries are in rows with the distance
    `step`."""
    return (
        scratch[row, i],
        scratch[row + step, i],
        scratch[row + 2 * step, i],
        scratch[row + 3 * step, i],
    )


@inline
def _store_block(scratch, row, i, block, step=1):
    """Store a 2 x 2 block in column `i`, in rows with the distance `step`."""
    for entry in range(4):
        scratch[row + entry * step, i] = block[entry]


@inline
def _inverse(block):
    """Return the inverse of a 2 x 2 block."""
    p, q, r, s = block
    inverse = 1.0 / (p * s - q * r)
    return s * inverse, -q * inverse, -r * inverse, p * inverse


@inline
def _product(a, b):
    """Return the product of two 2 x 2 blocks."""
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


@inline
def _add_block(scratch, row, i, factor, block, step=1):
    """Add `factor` times a 2 x 2 block to the block in column `i`."""
    for entry in range(4):
        scratch[row + entry * step, i] += factor * block[entry]


@outlined
def _factor_tree_blocks(factors, n):
    """Factorize the matrix of `factor_blocks` for a tree with links, from its tips on.

    With A_i = D_i^-1, the elimination of floor i with the entries -U in its equation and -L in the
    equation of a lower floor reduces D of this floor by L A_i U. For another lower floor with L'
    and U', the entries of both floors receive L A_i U' and L' A_i U. The rows of an entry receive
    L A_i (forward substitution) and A_i U (backward substitution). L and U are equal before the
    elimination.
    """
    scratch, blocks, coupling, _, linear_terms = factors
    upper = coupling + COUPLING_ROWS // 2
    for i in range(1, n):
        _store_block(scratch, upper, i, _block(scratch, coupling, i))
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = count_masses(linear_terms)
    while i > 0:
        i -= 1
        inverse = _inverse(_block(scratch, blocks, i))
        _store_block(scratch, blocks, i, inverse)
        j = i  # column of the entry; 0 after the last lower floor
        while j > 0:
            base = int(linear_terms[rows.BASE, j])
            lower_entry = _block(scratch, coupling, j)
            upper_entry = _block(scratch, upper, j)
            by_upper = _product(inverse, upper_entry)
            _store_block(scratch, upper, j, by_upper)
            _store_block(scratch, coupling, j, _product(lower_entry, inverse))
            _add_block(scratch, blocks, base, -1.0, _product(lower_entry, by_upper))
            k = i
            while k != j:  # the pairs of this floor and the earlier floors of the list
                other = int(linear_terms[rows.BASE, k])
                column = _entry_between(linear_terms, base, other)
                in_base = _product(lower_entry, _block(scratch, upper, k))
                in_other = _product(_block(scratch, coupling, k), upper_entry)
                if base > other:
                    in_base, in_other = in_other, in_base
                _add_block(scratch, coupling, column, 1.0, in_base)
                _add_block(scratch, upper, column, 1.0, in_other)
                k = int(linear_terms[rows.NEXT_ENTRY, k])
            j = int(linear_terms[rows.NEXT_ENTRY, j])


@inline
def _is_full(linear_terms, modal, n):
    """Return True if a matrix with two unknowns per floor is factorized as a full matrix.

    The full matrix of a building with n floors needs 4 n scratch rows, but for m damped modes only
    6 m + 1 rows are reserved (for the Woodbury formula). It can therefore be used if m is at least
    2 n / 3. For each such m it also needs fewer operations: about (2 n)^3 / 3 for the
    factorization, compared with about (2 m)^3 + 4 m^2 n + 32 m n for the terms of the Woodbury
    formula, which is at least 4 n^3. It is not used for trees, because their floors are not in the
    order of their neighbors.
    """
    if FULL and is_tree(linear_terms):
        return False
    return 3 * modal.shape[0] >= 2 * n


@outlined
def _factor_full(factors, damping, n):
    """Factorize a block tridiagonal matrix plus modal damping as a full matrix of 2 x 2 blocks.

    The factorization is a block L U factorization with a unit diagonal of L. The 4 n rows from
    `factors.store` on contain it: the entries xx of all blocks, one row per floor, then the entries
    xy, yx and yy. On the diagonal they contain the inverse pivots, below it L, and above it U.

    If a pivot were singular, the solution would be infinite or nan, and the step would report a
    failure.
    """
    scratch, blocks, coupling, xx, _ = factors
    modal = damping.modal
    xy, yx, yy = xx + n, xx + 2 * n, xx + 3 * n
    for i in range(n):
        for j in range(n):
            scratch[xx + i, j] = 0.0
        for mode in range(modal.shape[0]):
            amplitude = modal[mode, i]
            for j in range(n):
                scratch[xx + i, j] += amplitude * modal[mode, j]
        for j in range(n):
            product = scratch[xx + i, j]  # entry (i, j) of W^T W
            scratch[xx + i, j] = damping.xx * product
            scratch[xy + i, j] = damping.xy * product
            scratch[yx + i, j] = damping.yx * product
            scratch[yy + i, j] = damping.yy * product
        for entry in range(4):
            row = xx + entry * n + i
            scratch[row, i] += scratch[blocks + entry, i]
            if i > 0:
                scratch[row, i - 1] -= scratch[coupling + entry, i]
            if i + 1 < n:
                scratch[row, i + 1] -= scratch[coupling + entry, i + 1]
    # Elimination column by column: the block m of L is the block below the pivot times the inverse
    # pivot.
    for k in range(n):
        inverse = _inverse(_block(scratch, xx + k, k, n))
        _store_block(scratch, xx + k, k, inverse, n)
        for i in range(k + 1, n):
            m = _product(_block(scratch, xx + i, k, n), inverse)
            _store_block(scratch, xx + i, k, m, n)
            for j in range(k + 1, n):
                reduction = _product(m, _block(scratch, xx + k, j, n))
                _add_block(scratch, xx + i, j, -1.0, reduction, n)


@outlined
def _solve_full(scratch, xx, x, y, n):
    """Solve a linear system for two unknowns per floor with the factors of `_factor_full` from row
    `xx` on."""
    xy, yx, yy = xx + n, xx + 2 * n, xx + 3 * n
    # Forward substitution with L, which has a unit diagonal
    for i in range(1, n):
        x_i, y_i = scratch[x, i], scratch[y, i]
        for j in range(i):
            x_i -= scratch[xx + i, j] * scratch[x, j] + scratch[xy + i, j] * scratch[y, j]
            y_i -= scratch[yx + i, j] * scratch[x, j] + scratch[yy + i, j] * scratch[y, j]
        scratch[x, i] = x_i
        scratch[y, i] = y_i
    # Backward substitution; the diagonal blocks are inverse pivots.
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = n
    while i > 0:
        i -= 1
        x_i, y_i = scratch[x, i], scratch[y, i]
        for j in range(i + 1, n):
            x_i -= scratch[xx + i, j] * scratch[x, j] + scratch[xy + i, j] * scratch[y, j]
            y_i -= scratch[yx + i, j] * scratch[x, j] + scratch[yy + i, j] * scratch[y, j]
        scratch[x, i] = scratch[xx + i, i] * x_i + scratch[xy + i, i] * y_i
        scratch[y, i] = scratch[yx + i, i] * x_i + scratch[yy + i, i] * y_i


@inline
def solve_blocks(factors, x, y, n):
    """Solve a block tridiagonal system with the factorization of `factor_blocks`.

    With the symbols of `factor_blocks`, and without modal damping,

        forward, upwards        f_0 = b_0,   f_i = b_i + B_i A_(i-1) f_(i-1)
        backward, downwards     z_i = A_i f_i + A_i B_(i+1) z_(i+1)

    Parameters
    ----------
    factors : Factors
        Rows with the factorization.
    x, y : int
        Rows of the right side; they receive the solution.
    n : int
        Number of floors.
    """
    scratch, blocks, coupling, _, linear_terms = factors
    upper = coupling + COUPLING_ROWS // 2  # first row of the products A_i B_(i+1)
    if FULL and is_tree(linear_terms):
        last = count_masses(linear_terms) - 1
        for i in range(last, 0, -1):
            x0, y0, j = scratch[x, i], scratch[y, i], i
            while j > 0:
                base = int(linear_terms[rows.BASE, j])
                scratch[x, base] += scratch[coupling, j] * x0 + scratch[coupling + 1, j] * y0
                scratch[y, base] += scratch[coupling + 2, j] * x0 + scratch[coupling + 3, j] * y0
                j = int(linear_terms[rows.NEXT_ENTRY, j])
        for i in range(last + 1):
            x0, y0, j = scratch[x, i], scratch[y, i], i
            x1 = scratch[blocks, i] * x0 + scratch[blocks + 1, i] * y0
            y1 = scratch[blocks + 2, i] * x0 + scratch[blocks + 3, i] * y0
            while j > 0:
                base = int(linear_terms[rows.BASE, j])
                p, q = scratch[x, base], scratch[y, base]
                x1 += scratch[upper, j] * p + scratch[upper + 1, j] * q
                y1 += scratch[upper + 2, j] * p + scratch[upper + 3, j] * q
                j = int(linear_terms[rows.NEXT_ENTRY, j])
            scratch[x, i], scratch[y, i] = x1, y1
        tie(linear_terms, scratch, x)
        tie(linear_terms, scratch, y)
        return
    # Forward substitution: (x0, y0) is f of the floor below.
    x0 = scratch[x, 0]
    y0 = scratch[y, 0]
    for i in range(1, n):
        forward = scratch[x, i] + scratch[coupling, i] * x0 + scratch[coupling + 1, i] * y0
        y0 = scratch[y, i] + scratch[coupling + 2, i] * x0 + scratch[coupling + 3, i] * y0
        x0 = forward
        scratch[x, i] = x0
        scratch[y, i] = y0
    # Backward substitution: (p, q) is the solution z of the floor above, (x0, y0) is f of floor
    # `i`.
    p = 0.0
    q = 0.0
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = n
    while i > 0:
        i -= 1
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
    """Factorize the tridiagonal matrix M + l C + l^2 K with a complex number l.

    M are the masses, C the floor and story dampers, and K contains the stiffnesses of the current
    branches of all stories with P-delta. The complex unknown of a floor, x + i y, is stored as the
    pair of real numbers (x, y). The elimination proceeds from the ground upwards.

    No pivot is zero if 1 / l has a positive real part and is not real, even if stiffnesses are
    negative.

    Proof: If a pivot is zero, a leading block B of the matrix is singular, and B z = 0 for a
    complex vector z. Multiplication by the conjugate transpose z* and division by l^2 give

        z* B z / l^2 = m s^2 + c s + k = 0,   s = 1 / l

    m = z* M z > 0, c = z* C z >= 0 and k = z* K z are real numbers (M, C and K are the leading
    blocks of the same size here). If s is not real, its real part is -c / (2 m), which is not
    positive.

    Parameters
    ----------
    root : tuple of float
        Real and imaginary part of l, in s.
    factors : Factors
        Two rows from `pivot` on receive the inverse pivots (real and imaginary part), two rows from
        `coupling` on the multipliers of the elimination from the ground upwards. The rows from
        `store` on receive the terms of the Woodbury formula (`_woodbury_storing_function`).
    damping : ModalBlocks
        Modal part of l C. With l = re + i im, the coefficients of the real part x and of the
        imaginary part y of an unknown are xx = re, xy = -im, yx = im and yy = re.
    """
    if FULL and is_tree(linear_terms):
        _factor_tree_pairs(linear_terms, law_state, root, factors, n)
        _store_pairs_woodbury(factors, damping, n)
        return
    re, im = root
    scratch, pivot, coupling, _, _ = factors
    # l^2, and the contribution l C + l^2 K of the first story
    square_re = re * re - im * im
    square_im = 2.0 * re * im
    spring = law_state[rows.SLOPE, 0] + linear_terms[rows.GEOMETRIC, 0]
    damper = linear_terms[rows.STORY_DAMPER, 0]
    story_re = re * damper + square_re * spring
    story_im = im * damper + square_im * spring
    # `link`, `story_re` and `story_im` first describe story i, which is below floor i, and then
    # story i + 1. There is no floor below the first story.
    link = 0.0
    inverse_re = 0.0  # inverse of the pivot of the floor below
    inverse_im = 0.0
    for i in range(n):
        # The pivot p + i q is the diagonal entry minus b^2 / (pivot of the floor below), with the
        # entry -b between both floors.
        b_re = link * story_re
        b_im = link * story_im
        # The multiplier of the elimination has the opposite sign, because the entry of the matrix
        # is -b.
        by_re = b_re * inverse_re - b_im * inverse_im
        by_im = b_re * inverse_im + b_im * inverse_re
        p = linear_terms[rows.MASS, i] + re * linear_terms[rows.FLOOR_DAMPER, i] + story_re
        q = im * linear_terms[rows.FLOOR_DAMPER, i] + story_im
        p -= by_re * b_re - by_im * b_im
        q -= by_re * b_im + by_im * b_re
        scratch[coupling, i] = -by_re
        scratch[coupling + 1, i] = -by_im
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
    # `solve_pairs` reads the multiplier of the floor above, which does not exist above the roof.
    scratch[coupling, n] = 0.0
    scratch[coupling + 1, n] = 0.0
    if FULL:
        _store_pairs_woodbury(factors, damping, n)


@outlined
def _factor_tree_pairs(linear_terms, law_state, root, factors, n):
    """Factorize the matrix of `factor_pairs` for a tree with links, from its tips on."""
    re, im = root
    scratch, pivot, coupling, _, _ = factors
    square_re = re * re - im * im
    square_im = 2.0 * re * im
    for i in range(n):
        scratch[pivot, i] = linear_terms[rows.MASS, i] + re * linear_terms[rows.FLOOR_DAMPER, i]
        scratch[pivot + 1, i] = im * linear_terms[rows.FLOOR_DAMPER, i]
        scratch[coupling, i] = scratch[coupling + 1, i] = 0.0
    # The columns of links are first: their contributions are complete before the elimination.
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = n
    while i > 0:
        i -= 1
        spring = law_state[rows.SLOPE, i] + linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i]
        story_re = re * damper + square_re * spring
        story_im = im * damper + square_im * spring
        if FULL and has_inerters(linear_terms):
            story_re += linear_terms[rows.STORY_INERTANCE, i]
            scratch[pivot, i] += linear_terms[rows.FLOOR_INERTANCE, i]
        floor, entry = int(linear_terms[rows.UPPER_FLOOR, i]), int(linear_terms[rows.ENTRY, i])
        scratch[pivot, floor] += story_re
        scratch[pivot + 1, floor] += story_im
        if linear_terms[rows.LINK, i] != 0.0:
            base = int(linear_terms[rows.BASE, i])
            scratch[pivot, base] += story_re
            scratch[pivot + 1, base] += story_im
            scratch[coupling, entry] -= story_re
            scratch[coupling + 1, entry] -= story_im
        if floor == i:
            # All springs at floor `i` have been added to its pivot.
            _eliminate_pairs(linear_terms, scratch, pivot, coupling, i)


@inline
def _eliminate_pairs(linear_terms, scratch, pivot, coupling, i):
    """Invert the complex pivot of floor `i` and eliminate it from the equations of lower floors."""
    p, q = scratch[pivot, i], scratch[pivot + 1, i]
    squared = 1.0 / (p * p + q * q)
    inverse_re, inverse_im = p * squared, -q * squared
    scratch[pivot, i], scratch[pivot + 1, i] = inverse_re, inverse_im
    j = i  # column of the entry; 0 after the last lower floor
    while j > 0:
        base = int(linear_terms[rows.BASE, j])
        b_re, b_im = scratch[coupling, j], scratch[coupling + 1, j]
        by_re = b_re * inverse_re - b_im * inverse_im
        by_im = b_re * inverse_im + b_im * inverse_re
        scratch[coupling, j], scratch[coupling + 1, j] = by_re, by_im
        scratch[pivot, base] -= by_re * b_re - by_im * b_im
        scratch[pivot + 1, base] -= by_re * b_im + by_im * b_re
        k = i
        while k != j:  # the pairs of this floor and the earlier floors of the list
            column = _entry_between(linear_terms, base, int(linear_terms[rows.BASE, k]))
            k_re, k_im = scratch[coupling, k], scratch[coupling + 1, k]
            scratch[coupling, column] -= b_re * k_re - b_im * k_im
            scratch[coupling + 1, column] -= b_re * k_im + b_im * k_re
            k = int(linear_terms[rows.NEXT_ENTRY, k])
        j = int(linear_terms[rows.NEXT_ENTRY, j])


@inline
def solve_pairs(factors, x, y, n):
    """Solve a complex tridiagonal system with the factorization of `factor_pairs`, without modal
    damping.

    x and y are the rows of the real and the imaginary part of the right side, which receive the
    solution. With the right side b, the multipliers m and the inverse pivots g, forward
    substitution computes f_i = b_i - m_i f_(i-1), and backward substitution z_i = g_i f_i - m_(i+1)
    z_(i+1).
    """
    scratch, pivot, coupling, _, linear_terms = factors
    if FULL and is_tree(linear_terms):
        last = count_masses(linear_terms) - 1
        for i in range(last, 0, -1):
            x0, y0, j = scratch[x, i], scratch[y, i], i
            while j > 0:
                base = int(linear_terms[rows.BASE, j])
                by_re, by_im = scratch[coupling, j], scratch[coupling + 1, j]
                scratch[x, base] -= by_re * x0 - by_im * y0
                scratch[y, base] -= by_re * y0 + by_im * x0
                j = int(linear_terms[rows.NEXT_ENTRY, j])
        for i in range(last + 1):
            re, im = scratch[pivot, i], scratch[pivot + 1, i]
            x0, y0, j = scratch[x, i], scratch[y, i], i
            x1, y1 = re * x0 - im * y0, re * y0 + im * x0
            while j > 0:
                base = int(linear_terms[rows.BASE, j])
                by_re, by_im = scratch[coupling, j], scratch[coupling + 1, j]
                p, q = scratch[x, base], scratch[y, base]
                x1 -= by_re * p - by_im * q
                y1 -= by_re * q + by_im * p
                j = int(linear_terms[rows.NEXT_ENTRY, j])
            scratch[x, i], scratch[y, i] = x1, y1
        tie(linear_terms, scratch, x)
        tie(linear_terms, scratch, y)
        return
    # (x0, y0) is the value of the floor below.
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
    # (p, q) is the solution of the floor above.
    p = 0.0
    q = 0.0
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = n
    while i > 0:
        i -= 1
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


def _woodbury_storing_function(solve_undamped):
    """Return a compiled function that stores the terms of the Woodbury formula for two unknowns per
    floor.

    `solve_undamped` solves the system without modal damping: `solve_blocks` or `solve_pairs`.
    """

    @outlined
    def store_woodbury(factors, damping, n):
        """Compute and store the terms of the Woodbury formula for pairs of unknowns (x, y) per
        floor, after the factorization of the matrix T without modal damping.

        The inverse of the matrix with modal damping is

            (T + U^T D U)^-1 = T^-1 - T^-1 U^T (I + D U T^-1 U^T)^-1 D U T^-1

        For m damped modes with the mode vectors w_j (rows of `damping.modal`), U has 2 m rows and D
        is a matrix of 2 m rows and columns. I is an identity matrix:

            U    row j applies w_j to the unknowns x, row m + j applies w_j to the unknowns y
            D    ((xx I, xy I), (yx I, yy I)) with the coefficients of `damping`

        The terms that do not depend on the right side are stored in the scratch rows from
        `factors.store` on. The scratch array has at least 2 m columns (`tdint.methods.workspace`),
        also if the building has fewer floors.

            4 m rows    T^-1 U^T: the solution of T z = (row j of U)^T for each j, in row 2 j for x
                        and in row 2 j + 1 for y
            2 m rows    the inverse of the small matrix I + D U T^-1 U^T
        """
        scratch, _, _, store, _ = factors
        modal, xx, xy, yx, yy = damping
        modes = modal.shape[0]
        inverse_row = store + 4 * modes
        # The right side is replaced by the solution.
        for j in range(2 * modes):
            x = store + 2 * j
            for i in range(n):
                scratch[x, i] = modal[j, i] if j < modes else 0.0
                scratch[x + 1, i] = 0.0 if j < modes else modal[j - modes, i]
            solve_undamped(factors, x, x + 1, n)
        # Row j is the equation of mode j in x, and row modes + j is the equation of mode j in y.
        # `product_x` and `product_y` are the products of mode j with both parts of solution k.
        for j in range(modes):
            for k in range(2 * modes):
                product_x = 0.0
                product_y = 0.0
                for i in range(n):
                    product_x += modal[j, i] * scratch[store + 2 * k, i]
                    product_y += modal[j, i] * scratch[store + 2 * k + 1, i]
                scratch[inverse_row + j, k] = (
                    xx * product_x + xy * product_y + (1.0 if j == k else 0.0)
                )
                scratch[inverse_row + modes + j, k] = (
                    yx * product_x + yy * product_y + (1.0 if modes + j == k else 0.0)
                )
        invert(scratch, inverse_row, 2 * modes)

    return store_woodbury


_store_blocks_woodbury = _woodbury_storing_function(solve_blocks)
_store_pairs_woodbury = _woodbury_storing_function(solve_pairs)


@outlined
def _apply_pairs_woodbury(factors, damping, x, y, n):
    """Correct a solution without modal damping by the Woodbury formula (`store_woodbury`), for
    pairs of unknowns (x, y) per floor.
    """
    scratch, _, _, store, _ = factors
    modal, xx, xy, yx, yy = damping
    modes = modal.shape[0]
    inverse_row = store + 4 * modes
    temporary = inverse_row + 2 * modes
    # Row `temporary` receives D U z: the modes in x, then the modes in y.
    for j in range(modes):
        product_x = 0.0
        product_y = 0.0
        for i in range(n):
            product_x += modal[j, i] * scratch[x, i]
            product_y += modal[j, i] * scratch[y, i]
        scratch[temporary, j] = xx * product_x + xy * product_y
        scratch[temporary, modes + j] = yx * product_x + yy * product_y
    for j in range(2 * modes):
        amplitude = 0.0
        for k in range(2 * modes):
            amplitude += scratch[inverse_row + j, k] * scratch[temporary, k]
        for i in range(n):
            scratch[x, i] -= amplitude * scratch[store + 2 * j, i]
            scratch[y, i] -= amplitude * scratch[store + 2 * j + 1, i]


@inline
def solve_blocks_damped(factors, damping, x, y, n):
    """Solve a linear system with the factorization of `factor_blocks`, including modal damping.

    Parameters
    ----------
    factors : Factors
        Rows with the factorization: of the sum of both matrices as a full matrix if most modes are
        damped (`_is_full`), otherwise of the block tridiagonal matrix. The solution of the latter
        is corrected by the Woodbury formula.
    damping : ModalBlocks
        Modal damping, with the values for which the matrix was factorized.
    x, y : int
        Rows of the right side; they receive the solution.
    n : int
        Number of floors.
    """
    if FULL and _is_full(factors.linear_terms, damping.modal, n):
        _solve_full(factors.table, factors.store, x, y, n)
    else:
        solve_blocks(factors, x, y, n)
        if FULL and damping.modal.shape[0] > 0:
            _apply_pairs_woodbury(factors, damping, x, y, n)


@inline
def solve_pairs_damped(factors, damping, x, y, n):
    """Solve a complex linear system with the factorization of `factor_pairs`, including modal
    damping with the same `damping`.
    """
    solve_pairs(factors, x, y, n)
    if FULL and damping.modal.shape[0] > 0:
        _apply_pairs_woodbury(factors, damping, x, y, n)
