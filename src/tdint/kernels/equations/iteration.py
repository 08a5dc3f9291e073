"""Newton's iteration, the same for all implicit steps: what ends it, and corrections that are halved until they bring
the equations closer to balance.

Kinks of the drift laws can make the iteration go round in a cycle at large steps. So after the first
`PATIENCE` of them each one must diminish what is out of balance; one that does not is halved, down to `LEAST` of it.
moment4 asks that of all.
"""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined

ITERATIONS = (
    30  # of Newton before a step counts as not converged; a correction that is halved counts as one
)
PATIENCE = 6  # corrections after which one that does not bring the step closer to balance is halved: kinks make cycles
LEAST = 1e-3  # part of a correction that is tried
CLOSE = 1e-11  # out of balance over the sum of the sizes of the terms
SMALL = 1e-14  # correction over the displacement: rounding
NOTHING = 1e-250  # N; far ahead of a wave forces are so small that their products underflow
SAME_TANGENT = (
    1e-3  # a tangent that changed by less, over the initial one, is kept in the factorization
)
_LESS = 1e-4  # of what is out of balance, by which a whole correction is to diminish it


@called
def squares(linear_terms, work, row, n):
    """Sum of the squares of a row of residuals over the masses."""
    total = 0.0
    for i in range(n):
        total += linear_terms[at.INVERSE_MASS, i] * work[row, i] * work[row, i]
    return total


@inlined
def too_far(size, before, part):
    """Whether so large a part of a correction is to be halved: the sum of squares was `before` and is now `size`."""
    return size > before * (1.0 - _LESS * part) and part > LEAST


@called
def copy_rows(work, source, target, rows, n):
    """Keep rows of corrections."""
    for row in range(rows):
        for i in range(n):
            work[target + row, i] = work[source + row, i]


@called
def add_rows(part, work, source, target, rows, n):
    """Add a part of rows of corrections to the rows of what they correct."""
    for row in range(rows):
        for i in range(n):
            work[target + row, i] += part * work[source + row, i]


@inlined
def balanced(noting, close, report, i, residual, scale):
    """Whether the terms of an equation, whose sizes add up to `scale`, balance; with `noting` the report keeps the
    worst of those that do not."""
    small = abs(residual) <= close * scale + NOTHING
    if noting and not small and not abs(residual) / scale <= report[at.RESIDUAL]:
        report[at.RESIDUAL] = abs(residual) / scale
        report[at.WORST_STORY] = i
    return small
