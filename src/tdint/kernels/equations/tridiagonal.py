"""Direct solution of the linear systems of a step: tridiagonal or block tridiagonal matrices.

A story couples only adjacent floors. The matrices are therefore tridiagonal. An entry is a number
(one unknown per floor), a complex number, or a 2 x 2 block (two unknowns per floor); `Entries`
contains the arithmetic of an entry, and `_elimination` the elimination for any entries. With the
entry D_i of a floor and the entry B_i of the story between the floors i - 1 and i, the equations
of T z = b are

    -B_i z_(i-1) + D_i z_i - B_(i+1) z_(i+1) = b_i

In a building with attachments or links, the lower floor of a story is any floor.

Modal damping adds W^T W, with one row of W for each damped mode, in place of each number of a
coefficient matrix D of the unknowns of a floor. With U, which contains W once for each unknown, the
Sherman-Morrison-Woodbury formula accounts for this part (`_woodbury`), so that no dense matrix with
the size of the building is needed:

    (T + U^T D U)^-1 = T^-1 - T^-1 U^T [(I + D U T^-1 U^T)^-1 D] U T^-1

The matrix in brackets has one row for each mode and unknown. If there are two unknowns per floor
and most modes are damped, T + U^T D U is factorized as a full matrix instead, because this requires
fewer operations (`_is_full`).

Pivoting is not necessary: each leading block is the matrix of the part of the building below a
story, for which the same step has a unique solution.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.linear_terms import count_masses, has_inerters, is_tree, tie
from tdint.kernels.stepping import Array

COUPLING_ROWS = 8
"""Number of scratch rows for the couplings between adjacent floors in `factor_blocks`: four numbers
of each block B_i, which the caller stores, and four numbers of each product A_(i-1) B_i."""


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


# ---- Arithmetic of the entries of a matrix


class Entries(NamedTuple):
    """Arithmetic of the entries of a matrix: compiled functions, and a number of rows.

    Attributes
    ----------
    load, store : function
        (table, row, i) and (table, row, i, entry): the entry in column `i`, in successive rows.
    product, reduced, increased, inverse : function
        a b, a - b c, a + b c and 1 / a of entries.
    load_unknowns, store_unknowns : function
        (table, row, i) and (table, row, i, v): the unknowns v of floor `i`.
    applied, added, combined : function
        a v, v + a w and a v + b w, with entries a, b and unknowns v, w.
    upper : int
        Rows from an entry of the lower triangle to that of the upper triangle; 0 if the product of
        entries is commutative, because the matrix and its factors are then symmetric.
    unknowns : int
        Number of unknowns per floor.
    """

    load: Any
    store: Any
    product: Any
    reduced: Any
    increased: Any
    inverse: Any
    load_unknowns: Any
    store_unknowns: Any
    applied: Any
    added: Any
    combined: Any
    upper: int
    unknowns: int


@inline
def _product(a, b):
    """Return a b."""
    return a * b


@inline
def _reduced(a, b, c):
    """Return a - b c."""
    return a - b * c


@inline
def _added(v, a, w):
    """Return v + a w."""
    return v + a * w


@inline
def _combined(a, v, b, w):
    """Return a v + b w."""
    return a * v + b * w


@inline
def _number(table, row, i):
    """Return a number."""
    return table[row, i]


@inline
def _store_number(table, row, i, number):
    """Store a number."""
    table[row, i] = number


@inline
def _inverse_number(number):
    """Return 1 / number."""
    return 1.0 / number


@inline
def _complex(table, row, i):
    """Return the complex number with its parts in two rows."""
    return complex(table[row, i], table[row + 1, i])


@inline
def _store_complex(table, row, i, number):
    """Store real and imaginary part."""
    table[row, i], table[row + 1, i] = number.real, number.imag


@inline
def _inverse_complex(number):
    """Return 1 / number."""
    squared = 1.0 / (number.real * number.real + number.imag * number.imag)
    return complex(number.real * squared, -number.imag * squared)


@inline
def _block(table, row, i, step=1):
    """Return the 2 x 2 block in column `i`, row by row. Its entries are in rows with the distance
    `step`."""
    return (
        table[row, i],
        table[row + step, i],
        table[row + 2 * step, i],
        table[row + 3 * step, i],
    )


@inline
def _store_block(table, row, i, block, step=1):
    """Store a 2 x 2 block in column `i`, in rows with the distance `step`."""
    for entry in range(4):
        table[row + entry * step, i] = block[entry]


@inline
def _product_of_blocks(a, b):
    """Return the product of two 2 x 2 blocks."""
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


@inline
def _reduced_block(a, b, c):
    """Return a - b c."""
    p, q, r, s = _product_of_blocks(b, c)
    return a[0] - p, a[1] - q, a[2] - r, a[3] - s


@inline
def _increased_block(a, b, c):
    """Return a + b c."""
    p, q, r, s = _product_of_blocks(b, c)
    return a[0] + p, a[1] + q, a[2] + r, a[3] + s


@inline
def _inverse_block(block):
    """Return the inverse of a 2 x 2 block."""
    p, q, r, s = block
    inverse = 1.0 / (p * s - q * r)
    return s * inverse, -q * inverse, -r * inverse, p * inverse


@inline
def _pair(table, row, i):
    """Return the two unknowns of a floor."""
    return table[row, i], table[row + 1, i]


@inline
def _store_pair(table, row, i, pair):
    """Store the two unknowns of a floor."""
    table[row, i], table[row + 1, i] = pair


@inline
def _applied_block(a, v):
    """Return a v."""
    return a[0] * v[0] + a[1] * v[1], a[2] * v[0] + a[3] * v[1]


@inline
def _added_block(v, a, w):
    """Return v + a w."""
    return v[0] + a[0] * w[0] + a[1] * w[1], v[1] + a[2] * w[0] + a[3] * w[1]


@inline
def _combined_blocks(a, v, b, w):
    """Return a v + b w."""
    return (
        a[0] * v[0] + a[1] * v[1] + b[0] * w[0] + b[1] * w[1],
        a[2] * v[0] + a[3] * v[1] + b[2] * w[0] + b[3] * w[1],
    )


_NUMBERS = Entries(
    _number, _store_number, _product, _reduced, _added, _inverse_number,
    _number, _store_number, _product, _added, _combined, 0, 1,
)  # fmt: skip
_COMPLEX = Entries(
    _complex, _store_complex, _product, _reduced, _added, _inverse_complex,
    _complex, _store_complex, _product, _added, _combined, 0, 2,
)  # fmt: skip
_BLOCKS = Entries(
    _block, _store_block, _product_of_blocks, _reduced_block, _increased_block, _inverse_block,
    _pair, _store_pair, _applied_block, _added_block, _combined_blocks,
    COUPLING_ROWS // 2, 2,
)  # fmt: skip


# ---- Elimination


@inline
def _entry_between(linear_terms, i, j):
    """Return the column with the matrix entry of the floors `i` and `j`.

    It exists, also if the entry is zero before the elimination (`tdint.model.topology`).
    """
    column, lower = max(i, j), min(i, j)
    while linear_terms[rows.BASE, column] != lower:
        column = int(linear_terms[rows.NEXT_ENTRY, column])
    return column


def _elimination(entries: Entries) -> tuple[Any, Any]:
    """Return the compiled functions `factor` and `solve` of matrices with these entries.

    `factor` (factors, n) replaces T by its factorization, from the lowest floor upwards:

        A_0 = D_0^-1,   A_i = (D_i - B_i A_(i-1) B_i)^-1

        rows                 before      after
        pivot                D_i         A_i
        coupling             B_i         B_i A_(i-1)
        coupling + upper                 A_(i-1) B_i

    `solve` (factors, x, n) replaces the right side b in row `x` by the solution z:

        forward, upwards        f_0 = b_0,   f_i = b_i + B_i A_(i-1) f_(i-1)
        backward, downwards     z_i = A_i f_i + A_i B_(i+1) z_(i+1)

    In a tree with links, the floors are eliminated from the tips on: an attachment before its
    floor. The elimination of floor i with the entries -U in its equation and -L in the equation of
    a lower floor reduces D of this floor by L A_i U. For another lower floor with L' and U', the
    entries of both floors receive L A_i U' and L' A_i U. L and U are equal before the elimination.
    """
    load, store, product, reduced, increased, inverse, *others, upper, unknowns = entries
    load_unknowns, store_unknowns, applied, added, combined = others

    @outlined
    def factor_tree(factors, n):
        """Factorize the matrix of a tree with links."""
        scratch, pivot, coupling, _, linear_terms = factors
        for i in range(1, n if upper > 0 else 0):
            store(scratch, coupling + upper, i, load(scratch, coupling, i))
        # `while` as in `tdint.kernels.time_loop.observer.observe`
        i = count_masses(linear_terms)
        while i > 0:
            i -= 1
            own = inverse(load(scratch, pivot, i))
            store(scratch, pivot, i, own)
            j = i  # column of the entry; 0 after the last lower floor
            while j > 0:
                base = int(linear_terms[rows.BASE, j])
                in_lower, in_upper = load(scratch, coupling, j), load(scratch, coupling + upper, j)
                by_upper = product(own, in_upper)
                of_base = reduced(load(scratch, pivot, base), in_lower, by_upper)
                store(scratch, pivot, base, of_base)
                store(scratch, coupling + upper, j, by_upper)
                store(scratch, coupling, j, product(in_lower, own))
                k = i
                while k != j:  # the pairs of this floor and the earlier floors of the list
                    other = int(linear_terms[rows.BASE, k])
                    column = _entry_between(linear_terms, base, other)
                    # The lower floor of a column has its entry in the row `coupling`.
                    in_base, in_other = coupling, coupling + upper
                    if base > other:
                        in_base, in_other = in_other, in_base
                    of_entry = load(scratch, in_base, column)
                    by_upper = load(scratch, coupling + upper, k)
                    store(scratch, in_base, column, increased(of_entry, in_lower, by_upper))
                    if upper > 0:
                        of_entry = load(scratch, in_other, column)
                        by_lower = load(scratch, coupling, k)
                        store(scratch, in_other, column, increased(of_entry, by_lower, in_upper))
                    k = int(linear_terms[rows.NEXT_ENTRY, k])
                j = int(linear_terms[rows.NEXT_ENTRY, j])

    @inline
    def factor(factors, n):
        """Factorize the matrix in place."""
        scratch, pivot, coupling, _, linear_terms = factors
        if FULL and is_tree(linear_terms):
            factor_tree(factors, n)
            return
        below = inverse(load(scratch, pivot, 0))
        store(scratch, pivot, 0, below)
        for i in range(1, n):
            story = load(scratch, coupling, i)
            by_story = product(below, story)
            own = reduced(load(scratch, pivot, i), story, by_story)
            store(scratch, coupling + upper, i, by_story)
            store(scratch, coupling, i, product(story, below))
            below = inverse(own)
            store(scratch, pivot, i, below)

    @inline
    def solve(factors, x, n):
        """Solve the system for the right side in row `x`, without modal damping."""
        scratch, pivot, coupling, _, linear_terms = factors
        if FULL and is_tree(linear_terms):
            solve_tree(factors, x)
            return
        value = load_unknowns(scratch, x, 0)
        for i in range(1, n):
            value = added(load_unknowns(scratch, x, i), load(scratch, coupling, i), value)
            store_unknowns(scratch, x, i, value)
        value = applied(load(scratch, pivot, n - 1), load_unknowns(scratch, x, n - 1))
        store_unknowns(scratch, x, n - 1, value)
        # `while` as in `tdint.kernels.time_loop.observer.observe`
        i = n - 1
        while i > 0:
            i -= 1
            own, above = load(scratch, pivot, i), load(scratch, coupling + upper, i + 1)
            value = combined(own, load_unknowns(scratch, x, i), above, value)
            store_unknowns(scratch, x, i, value)

    @outlined
    def solve_tree(factors, x):
        """Solve the system of a tree with links, from its tips on."""
        scratch, pivot, coupling, _, linear_terms = factors
        last = count_masses(linear_terms) - 1
        for i in range(last, 0, -1):
            value, j = load_unknowns(scratch, x, i), i
            while j > 0:
                base = int(linear_terms[rows.BASE, j])
                in_base = added(load_unknowns(scratch, x, base), load(scratch, coupling, j), value)
                store_unknowns(scratch, x, base, in_base)
                j = int(linear_terms[rows.NEXT_ENTRY, j])
        for i in range(last + 1):
            value, j = applied(load(scratch, pivot, i), load_unknowns(scratch, x, i)), i
            while j > 0:
                of_base = load_unknowns(scratch, x, int(linear_terms[rows.BASE, j]))
                value = added(value, load(scratch, coupling + upper, j), of_base)
                j = int(linear_terms[rows.NEXT_ENTRY, j])
            store_unknowns(scratch, x, i, value)
        for row in range(unknowns):
            tie(linear_terms, scratch, x + row)

    return factor, solve


# ---- Modal damping


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


def _woodbury(solve: Any, unknowns: int) -> tuple[Any, Any]:
    """Return the compiled functions that store the terms of the Woodbury formula, and that correct
    the solution of `solve`, for a number of unknowns per floor.

    `store` (factors, damping, n) stores the terms that do not depend on the right side in the rows
    from `factors.store` on; the matrix T must be factorized. For u unknowns and m modes,

        u^2 m rows    T^-1 U^T: u rows for each of the u m right sides. Right side j is the mode
                      j % m in the equations of unknown j // m.
        u m rows      the matrix in brackets

    A temporary row follows. The table has at least u m columns (`tdint.methods.workspace`).
    `correct` (factors, modal, x, n) subtracts the effect of modal damping from the solution in row
    `x`.
    """

    @outlined
    def store(factors, damping, n):
        """Store the terms of the Woodbury formula."""
        scratch, _, _, first, _ = factors
        modal = damping.modal
        modes = modal.shape[0]
        count = unknowns * modes
        inverse_row = first + unknowns * count
        for j in range(count):
            x = first + unknowns * j
            for part in range(unknowns):
                is_own = part == j // modes
                for i in range(n):
                    scratch[x + part, i] = modal[j % modes, i] if is_own else 0.0
            solve(factors, x, n)
        # The mode `j` in the unknown `part` of the solution k, in the equations of each unknown
        for j in range(modes):
            for k in range(count):
                for own in range(unknowns):
                    is_unit = own * modes + j == k
                    scratch[inverse_row + own * modes + j, k] = 1.0 if is_unit else 0.0
                for part in range(unknowns):
                    product = 0.0
                    for i in range(n):
                        product += modal[j, i] * scratch[first + unknowns * k + part, i]
                    for own in range(unknowns):
                        scratch[inverse_row + own * modes + j, k] += (
                            _coefficient(damping, unknowns, own, part) * product
                        )
        invert(scratch, inverse_row, count)
        for j in range(count):
            for k in range(modes):
                x, y = scratch[inverse_row + j, k], scratch[inverse_row + j, count - modes + k]
                for part in range(unknowns):
                    product = x * _coefficient(damping, unknowns, 0, part)
                    if unknowns > 1:
                        product += y * _coefficient(damping, unknowns, 1, part)
                    scratch[inverse_row + j, part * modes + k] = product

    @outlined
    def correct(factors, modal, x, n):
        """Subtract the effect of modal damping from the solution."""
        scratch, _, _, first, _ = factors
        modes = modal.shape[0]
        count = unknowns * modes
        inverse_row = first + unknowns * count
        temporary = inverse_row + count
        for part in range(unknowns):
            for j in range(modes):
                product = 0.0
                for i in range(n):
                    product += modal[j, i] * scratch[x + part, i]
                scratch[temporary, part * modes + j] = product
        for j in range(count):
            amplitude = 0.0
            for k in range(count):
                amplitude += scratch[inverse_row + j, k] * scratch[temporary, k]
            for part in range(unknowns):
                for i in range(n):
                    scratch[x + part, i] -= amplitude * scratch[first + unknowns * j + part, i]

    return store, correct


@inline
def _coefficient(damping, unknowns, part, other):
    """Return the coefficient of an unknown (0 or 1) in the equations of an unknown."""
    if unknowns == 1:
        return damping.xx
    if part == 0:
        return damping.xx if other == 0 else damping.xy
    return damping.yx if other == 0 else damping.yy


_factor_numbers, _solve_numbers = _elimination(_NUMBERS)
_factor_complex, _solve_complex = _elimination(_COMPLEX)
_factor_blocks, _solve_blocks = _elimination(_BLOCKS)
_store_woodbury, _correct = _woodbury(_solve_numbers, 1)
_store_complex_woodbury, _correct_complex = _woodbury(_solve_complex, 2)
_store_blocks_woodbury, _correct_blocks = _woodbury(_solve_blocks, 2)


@inline
def factor(factors, n):
    """Factorize a symmetric tridiagonal matrix T in place, for `solve`.

    Parameters
    ----------
    factors : Factors
        Rows of the entries D_i (`pivot`) and B_i (`coupling`), which receive the factors. The sign
        of B_i is opposite to that of the matrix entry.
    n : int
        Number of floors.
    """
    _factor_numbers(factors, n)


@inline
def solve(factors, x, n):
    """Replace the right side in row `x` by the solution, with the factorization of `factor`.

    Parameters
    ----------
    factors : Factors
        Rows with the factorization.
    x : int
        Row of the right side; it receives the solution.
    n : int
        Number of floors.
    """
    _solve_numbers(factors, x, n)


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
        inverse = _inverse_block(_block(scratch, xx + k, k, n))
        _store_block(scratch, xx + k, k, inverse, n)
        for i in range(k + 1, n):
            m = _product_of_blocks(_block(scratch, xx + i, k, n), inverse)
            _store_block(scratch, xx + i, k, m, n)
            for j in range(k + 1, n):
                own, above = _block(scratch, xx + i, j, n), _block(scratch, xx + k, j, n)
                _store_block(scratch, xx + i, j, _reduced_block(own, m, above), n)


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


# ---- Matrices of the steps


@inline
def _add_to_entry(linear_terms, scratch, row, i):
    """Move the coupling of link `i` to the column of its matrix entry."""
    entry = int(linear_terms[rows.ENTRY, i])
    if entry != i:
        scratch[row, entry] += scratch[row, i]
        scratch[row, i] = 0.0


@inline
def link(linear_terms, factors, count, n):
    """Add the entry of each story to the diagonal entry of its lower floor. The caller has already
    added it to that of its upper floor. Entries of stories on the ground, which have no lower
    floor, are set to zero. `count` is the number of rows of an entry.
    """
    scratch, pivot, coupling, _, _ = factors
    for i in range(n):
        for row in range(count):
            scratch[coupling + row, i] *= linear_terms[rows.LINK, i]
    if FULL and is_tree(linear_terms):
        for i in range(1, n):
            base = int(linear_terms[rows.BASE, i])
            for row in range(count):
                scratch[pivot + row, base] += scratch[coupling + row, i]
        for i in range(count_masses(linear_terms), n):
            floor = int(linear_terms[rows.UPPER_FLOOR, i])
            for row in range(count):
                scratch[pivot + row, floor] += scratch[pivot + row, i]
                _add_to_entry(linear_terms, scratch, coupling + row, i)
        return
    for i in range(n - 1):
        for row in range(count):
            scratch[pivot + row, i] += scratch[coupling + row, i + 1]


@outlined
def link_blocks(linear_terms, factors, n):
    """Add the 2 x 2 block of each story to the diagonal block of its lower floor (`link`), for
    `factor_blocks`.

    Parameters
    ----------
    linear_terms : ndarray
        Linear terms of the building; row LINK is 0 for a story on the ground, otherwise 1.
    factors : Factors
        Four rows from `pivot` on contain the diagonal blocks, row by row of the block, and four
        rows from `coupling` on the blocks of the stories, which the caller has already added to
        the diagonal blocks of their upper floors.
    n : int
        Number of floors.
    """
    link(linear_terms, factors, 4, n)


@outlined
def factor_damped(factors, modal, scale, n):
    """Factorize T + scale W^T W for `solve_damped`, with a symmetric tridiagonal matrix T.

    Parameters
    ----------
    factors : Factors
        Row `pivot` contains the diagonal of T, and row `coupling` in column i minus the number
        between the floors i - 1 and i. The rows from `store` on receive the terms of the Woodbury
        formula.
    modal : ndarray
        W, one row per damped mode.
    scale : float
        Factor of the modal damping matrix.
    n : int
        Number of floors.
    """
    factor(factors, n)
    if FULL:
        _store_woodbury(factors, ModalBlocks(modal, scale, 0.0, 0.0, 0.0), n)


@inline
def solve_damped(factors, modal, x, n):
    """Replace the right side in row `x` by the solution, with the factorization of `factor_damped`,
    including modal damping.

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
        _correct(factors, modal, x, n)


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
        Table that receives the diagonal (row `pivot`) and the stories (row `coupling`).
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
        scratch[coupling, i] = story
    link(linear_terms, factors, 1, n)


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
def factor_blocks(factors, damping, n):
    """Factorize a matrix with 2 x 2 blocks, plus modal damping, for `solve_blocks_damped`.

    Parameters
    ----------
    factors : Factors
        Four rows from `pivot` and from `coupling` on contain the blocks D_i and B_i, row by row of
        the block. The rows from `store` on receive the terms of the Woodbury formula or, if most
        modes are damped (`_is_full`), the full factorization; the other rows then do not change.
    damping : ModalBlocks
        Modal damping.
    n : int
        Number of floors.
    """
    if FULL and _is_full(factors.linear_terms, damping.modal, n):
        _factor_full(factors, damping, n)
        return
    _factor_blocks(factors, n)
    if FULL:
        _store_blocks_woodbury(factors, damping, n)


@inline
def solve_blocks_damped(factors, modal, x, n):
    """Replace the right side in the rows `x` and `x` + 1 by the solution, with the factorization of
    `factor_blocks`, including modal damping.

    Parameters
    ----------
    factors : Factors
        Rows with the factorization.
    modal : ndarray
        W, one row per damped mode.
    x : int
        First of the two rows of the right side, which receive the solution.
    n : int
        Number of floors.
    """
    if FULL and _is_full(factors.linear_terms, modal, n):
        _solve_full(factors.table, factors.store, x, x + 1, n)
    else:
        _solve_blocks(factors, x, n)
        if FULL and modal.shape[0] > 0:
            _correct_blocks(factors, modal, x, n)


@outlined
def factor_pairs(linear_terms, law_state, root, factors, damping, n):
    """Factorize the complex tridiagonal matrix M + l C + l^2 K, plus modal damping, for
    `solve_pairs_damped`.

    M are the masses, C the floor and story dampers, and K contains the stiffnesses of the current
    branches of all stories with P-delta. Two rows from `pivot` and from `coupling` on contain real
    and imaginary part of an entry.

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
    damping : ModalBlocks
        Modal part of l C. With l = re + i im, the coefficients of the real part x and of the
        imaginary part y of an unknown are xx = re, xy = -im, yx = im and yy = re.
    """
    re, im = root
    # l^2
    square_re = re * re - im * im
    square_im = 2.0 * re * im
    scratch, pivot, coupling, _, _ = factors
    for i in range(n):
        spring = law_state[rows.SLOPE, i] + linear_terms[rows.GEOMETRIC, i]
        damper = linear_terms[rows.STORY_DAMPER, i]
        story_re = re * damper + square_re * spring
        story_im = im * damper + square_im * spring
        floor = linear_terms[rows.MASS, i]
        if FULL and has_inerters(linear_terms):
            story_re += linear_terms[rows.STORY_INERTANCE, i]
            floor += linear_terms[rows.FLOOR_INERTANCE, i]
        scratch[pivot, i] = floor + re * linear_terms[rows.FLOOR_DAMPER, i] + story_re
        scratch[pivot + 1, i] = im * linear_terms[rows.FLOOR_DAMPER, i] + story_im
        scratch[coupling, i], scratch[coupling + 1, i] = story_re, story_im
    link(linear_terms, factors, 2, n)
    _factor_complex(factors, n)
    if FULL:
        _store_complex_woodbury(factors, damping, n)


@inline
def solve_pairs_damped(factors, modal, x, n):
    """Replace the right side in the rows `x` and `x` + 1 (real and imaginary part) by the solution,
    with the factorization of `factor_pairs`, including modal damping."""
    _solve_complex(factors, x, n)
    if FULL and modal.shape[0] > 0:
        _correct_complex(factors, modal, x, n)
