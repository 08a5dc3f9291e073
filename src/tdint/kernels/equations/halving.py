"""Corrections of Newton's iteration that are halved until they bring the equations closer to balance.

Kinks of the drift laws can make the iteration go round in a cycle at large steps. So after the first
`PATIENCE` of them each one must diminish what is out of balance; one that does not is halved, down to `LEAST` of it.
moment4 asks that of all.
"""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.stepping import LEAST

_LESS = 1e-4  # of what is out of balance, by which a whole correction is to diminish it


@called
def squares(chain, work, row, n):
    """Sum of the squares of a row of residuals over the masses."""
    total = 0.0
    for i in range(n):
        total += chain[at.INVERSE_MASS, i] * work[row, i] * work[row, i]
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
