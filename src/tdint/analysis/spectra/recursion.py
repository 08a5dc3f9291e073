"""The table of the exact recursion of oscillators, and the shortest periods for which a spectrum takes it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tdint.errors import AnalysisError
from tdint.kernels.oscillators.recursion import A11, A12, A21, B10, B11, B20, B21, RECURSION_ROWS
from tdint.methods.exact import oscillator

Array = NDArray[np.float64]


def recursion_table(omega: Array, h: Array, damping: float, more: int) -> Array:
    """Exact steps h (s, shape (k,)) of oscillators with omega (rad/s, shape (k,)) and a damping ratio.

    Returns
    -------
    ndarray, shape (RECURSION_ROWS + more, k)
        The rows of `tdint.kernels.oscillators.recursion`, and room for so many `more`.
    """
    steps = oscillator(omega * h, np.full_like(omega, damping))
    table = np.empty((RECURSION_ROWS + more, omega.size))
    for row, first in ((0, A11), (1, A21)):
        table[first : first + 4] = steps[:, row].T
    table[A12] *= h
    table[A21] /= h
    table[[B10, B11]] *= h * h
    table[[B20, B21]] *= h
    return table


def check_shortest(periods: Array, dt: float, least: float, otherwise: str = "") -> None:
    """Refuse periods (s) that are not 0 and below `least` times the sampling interval dt (s).

    Raises
    ------
    AnalysisError
        Such a period; the message ends with what to do `otherwise`.
    """
    shortest = float(np.min(periods[periods > 0.0]))
    if shortest < least * dt:
        raise AnalysisError(
            f"the period {shortest:.6g} s is less than {least:g} sampling intervals of {dt:.6g} s; ask for periods "
            f"from {least * dt:.6g} s on{otherwise}"
        )
