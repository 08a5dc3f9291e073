"""Target spectra: what a suite of ground motions is scaled to, read from a CSV file."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.csv_table import CsvTable, read_table
from tdint.errors import ModelError, UsageError
from tdint.units import ACCELERATION

Array = NDArray[np.float64]

_PERIOD = ("period_s", "period", "t")
_ENDS = {"_m_s2": "m/s^2", "_cm_s2": "cm/s^2", "_gal": "gal", "_g": "g"}
_VALUE = re.compile(r"(?:(?:rotd\d+|geometric_mean)_)?(?:psa|sa)")


@dataclass(frozen=True)
class TargetSpectrum:
    """Pseudo-accelerations over the period; between two points a straight line on logarithmic axes.

    Attributes
    ----------
    source : str
        The file as the user named it.
    periods : ndarray, shape (k,)
        Rising, positive, s.
    psa : ndarray, shape (k,)
        Positive, m/s^2.
    """

    source: str
    periods: Array
    psa: Array

    def at(self, periods: Array) -> Array:
        """Its values at periods (s), m/s^2, shape (k,).

        Raises
        ------
        UsageError
            A period is outside its own.
        """
        low, high = float(self.periods[0]), float(self.periods[-1])
        periods = np.atleast_1d(np.asarray(periods, float))
        if np.min(periods) < low * (1.0 - 1e-9) or np.max(periods) > high * (1.0 + 1e-9):
            raise UsageError(
                f"{self.source}: has periods from {low:g} to {high:g} s; asked for are {np.min(periods):.6g} to "
                f"{np.max(periods):.6g} s"
            )
        return np.asarray(np.exp(np.interp(np.log(periods), np.log(self.periods), np.log(self.psa))))


def read_target(source: str) -> TargetSpectrum:
    """Read a target spectrum: CSV with the columns `period_s` and `sa_g` or `sa_m_s2` (psa, cm_s2 and gal, too).

    A period of 0 is left out: it has no place on a logarithmic axis.

    Raises
    ------
    ModelError
        It cannot be read, lacks a column, or holds what is no spectrum.
    """
    table = read_table(source, "a target spectrum is a CSV file with the columns period_s and sa_g or sa_m_s2")
    period = next((name for name in table.header if name in _PERIOD), "period_s")
    value, factor = _acceleration(table)
    periods, psa = np.array(table.numbers(period)), factor * np.array(table.numbers(value, positive=True))
    falls = np.flatnonzero(np.diff(periods, prepend=-1.0) <= 0.0)
    if falls.size or periods[0] < 0.0:
        place = int(falls[0]) if falls.size else 0
        raise ModelError(
            f"{source}:{table.rows[place][0]}: period {periods[place]:g} s: the periods of one spectrum must rise, "
            "from 0 or more"
        )
    positive = periods > 0.0
    if np.sum(positive) < 2:
        raise ModelError(f"{source}: a spectrum needs two periods at least")
    return TargetSpectrum(source, periods[positive], psa[positive])


def _acceleration(table: CsvTable) -> tuple[str, float]:
    """The column of accelerations, and its factor to m/s^2; pseudo-accelerations before others."""
    values = [(name, end) for name in table.header for end in _ENDS if _names(name, end)]
    values = [(name, end) for name, end in values if "psa" in name] or values
    if not values:
        raise ModelError(
            f"{table.source}:1: no column sa_g or sa_m_s2, an acceleration with its unit; there are "
            f"{', '.join(table.header)[:200]}"
        )
    if len(values) > 1:
        raise ModelError(
            f"{table.source}:1: several spectra, {', '.join(name for name, _ in values)}; leave one of them"
        )
    ((name, end),) = values
    return name, ACCELERATION[_ENDS[end]]


def _names(name: str, end: str) -> bool:
    return name.endswith(end) and bool(_VALUE.fullmatch(name[: -len(end)]))
