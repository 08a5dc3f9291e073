"""Largest response of many oscillators to one ground motion: the exact recursion in steps as short as each needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.defaults import STEPS_PER_PERIOD
from tdint.arrays import Array
from tdint.errors import AnalysisError
from tdint.kernels.oscillators import elastic as spectra
from tdint.kernels.oscillators.between import A11, A12, A21, B10, B11, B20, B21, RECURSION_ROWS
from tdint.methods.exact import oscillator

Parts = NDArray[np.int64]

_LANES = 56  # oscillators marched together at most: their numbers stay in the processor's first cache
_REGISTER = 8  # numbers that the processor handles at once
_ROUNDING = 1e-9


def recursion_table(omega: Array, h: Array, damping: float, more: int) -> Array:
    """Exact steps h (s, shape (k,)) of oscillators with omega (rad/s, shape (k,)) and a damping ratio.

    Returns
    -------
    ndarray, shape (RECURSION_ROWS + more, k)
        The rows of `tdint.kernels.oscillators.between`, and room for so many `more`.
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


@dataclass(frozen=True)
class Maxima:
    """Where the largest values are looked for.

    Attributes
    ----------
    name : str
        Its name on the command line and in tables.
    parts : callable
        Parts into which the sampling interval is divided, shape (k,), from omega (rad/s, shape (k,)) and the interval
        (s).
    between : bool
        Whether also between the ends of these parts.
    words : str
        Where that is, for a sentence.
    """

    name: str
    parts: Callable[[Array, float], Parts]
    between: bool
    words: str


def _resolving(omega: Array, dt: float) -> Parts:
    """omega h <= 1, which the search between the steps' ends relies on; powers of two, so that many march together."""
    return 2 ** np.ceil(np.log2(np.maximum(1.0, omega * dt * (1.0 - _ROUNDING)))).astype(np.int64)


def _ten_per_period(omega: Array, dt: float) -> Parts:
    periods = 2.0 * math.pi / omega
    return np.ceil(STEPS_PER_PERIOD * dt / periods * (1.0 - _ROUNDING)).astype(np.int64)


def _whole(omega: Array, dt: float) -> Parts:
    return np.ones(omega.shape, dtype=np.int64)


EXACT = Maxima("exact", _resolving, between=True, words="between them, too")
PEER = Maxima("peer", _ten_per_period, between=False, words=f"at {STEPS_PER_PERIOD} or more steps per period")
SAMPLES = Maxima("samples", _whole, between=False, words="at the samples only")
INTERPOLATED = Maxima("interpolated", _whole, between=True, words="between them, too, on the method's own motion")
MAXIMA = {maxima.name: maxima for maxima in (EXACT, PEER, SAMPLES)}


def largest(ground: Array, dt: float, omega: Array, damping: float, maxima: Maxima) -> Array:
    """Largest relative displacement (m) and velocity (m/s) and absolute acceleration (m/s^2), shape (3, k).

    Parameters
    ----------
    ground : ndarray, shape (samples,)
        Ground acceleration, m/s^2, linear between samples dt (s) apart; the oscillators are at rest at the first one
        and watched until the last.
    omega : ndarray, shape (k,)
        Natural circular frequencies, rad/s.
    damping : float
        Damping ratio, in [0, 1).
    """
    result = np.empty((spectra.PEAKS, omega.size))
    for chosen, parts, table in groups(omega, damping, dt, maxima, _lanes):
        lanes = _lanes(chosen.size)
        found = np.empty((spectra.PEAKS, chosen.size))
        scratch = spectra.scratch(ground.size, parts, lanes)
        spectra.peaks.compiled(ground, dt, parts, table, lanes, int(maxima.between), found, *scratch)
        result[:, chosen] = found
    return result


def groups(
    omega: Array, damping: float, dt: float, maxima: Maxima, lanes: Callable[[int], int]
) -> Iterator[tuple[NDArray[np.intp], int, Array]]:
    """Oscillators whose sampling interval is divided into the same number of parts: their places, that number, a table.

    The table is the kernel's, the last oscillator repeated to fill a multiple of `lanes` columns: that many of so many
    oscillators march together.
    """
    parts = maxima.parts(omega, dt)
    table = _table(omega, damping, dt / parts)
    for count in np.unique(parts).tolist():
        chosen = np.flatnonzero(parts == count)
        columns = np.append(chosen, np.full(-chosen.size % lanes(chosen.size), chosen[-1]))
        yield chosen, count, table.take(columns, axis=1)


def _lanes(count: int) -> int:
    """How many of `count` oscillators march together: whole registers, in equal groups."""
    alike = -(-count // _LANES)
    return -(-count // (alike * _REGISTER)) * _REGISTER


def _table(omega: Array, damping: float, h: Array) -> Array:
    """The kernel's table of oscillators for steps h (s), shape (COEFFICIENTS, k)."""
    table = recursion_table(omega, h, damping, more=2)
    table[spectra.BY_DISPLACEMENT] = omega**2
    table[spectra.BY_VELOCITY] = 2.0 * damping * omega
    return table
