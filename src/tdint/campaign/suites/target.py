"""Target spectra: what a suite of ground motions is scaled to, a design spectrum by name or a CSV file."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.campaign.suites.design_spectra import design_spectrum
from tdint.csv_table import CsvTable, read_table
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.formats.table_columns import name_and_units
from tdint.units import ACCELERATION, canonical

Array = NDArray[np.float64]

_PERIOD = ("t", "period", "periods")
_VALUE = re.compile(r"(?:(?:rotd\d+|geometric mean) )?(?:psa|sa)")
_NEEDS = (
    "a target spectrum is a CSV file with the columns period_s and sa_g or sa_m_s2, or a design spectrum by name, such "
    "as asce7:sds=1.0,sd1=0.6,tl=8"
)
_GRID = (0.01, 10.0, 241)  # s; periods at which a named spectrum is drawn and written, beside its corners


@dataclass(frozen=True)
class TargetSpectrum:
    """Pseudo-accelerations over the period: a code's formula, or straight lines between points on logarithmic axes.

    Attributes
    ----------
    source : str
        The file, or the code's name and parameters, as the user wrote them.
    periods : ndarray, shape (k,)
        Rising, positive, s.
    psa : ndarray, shape (k,)
        Positive, m/s^2.
    zero : float or None
        Its value at the period 0, m/s^2, as far as known.
    damping : float or None
        Damping ratio that it is for, as far as known.
    curve : callable or None
        The formula of a code; None of a table.
    """

    source: str
    periods: Array
    psa: Array
    zero: float | None = None
    damping: float | None = None
    curve: Callable[[Array], Array] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        if self.curve is not None:  # a formula is found again by its name
            return read_target, (self.source,)
        return TargetSpectrum, (self.source, self.periods, self.psa, self.zero, self.damping)

    @property
    def sd(self) -> Array:
        """Displacements Sa (T/2 pi)^2, m, shape (k,)."""
        return self.psa * (self.periods / (2.0 * np.pi)) ** 2

    @property
    def psv(self) -> Array:
        """Pseudo-velocities Sa T/2 pi, m/s, shape (k,)."""
        return self.psa * self.periods / (2.0 * np.pi)

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
        if self.curve is not None:
            return self.curve(periods)
        return np.asarray(np.exp(np.interp(np.log(periods), np.log(self.periods), np.log(self.psa))))


def read_target(source: str) -> TargetSpectrum:
    """A target spectrum: a design spectrum by name (`design_spectra`), or a CSV file with a column of periods
    (`period_s`, `T (s)`) and one of accelerations (`sa_g`, `psa_m_s2`, `Sa (g)`).

    A period of 0 is left out of the points: it has no place on a logarithmic axis.

    Raises
    ------
    ModelError
        It cannot be read, lacks a column, or holds what is no spectrum.
    UsageError
        An unknown name, or wrong parameters.
    """
    design = design_spectrum(source)
    if design is None:
        return _read_points(source)
    low, high, count = _GRID
    grid = np.geomspace(low, min(high, design.longest), int(count))
    periods = np.unique([*grid, *(corner for corner in design.corners if grid[0] < corner < grid[-1])])
    zero = float(design.curve(np.zeros(1))[0])
    return TargetSpectrum(source, periods, design.curve(periods), zero, design.damping, design.curve)


def _read_points(source: str) -> TargetSpectrum:
    table = read_table(source, _NEEDS)
    period = next((name for name in table.header if _is_period(name)), "period_s")
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
    zero = None if positive[0] else float(psa[0])
    return TargetSpectrum(source, periods[positive], psa[positive], zero)


def _is_period(name: str) -> bool:
    what, unit = name_and_units(name)
    return what in _PERIOD and unit in ("", "s", "sec")


def _acceleration(table: CsvTable) -> tuple[str, float]:
    """The column of accelerations, and its factor to m/s^2; pseudo-accelerations before others."""
    values = [name for name in table.header if _is_acceleration(name)]
    values = [name for name in values if "psa" in name] or values
    if not values:
        raise ModelError(
            f"{table.source}:1: no column sa_g or sa_m_s2, an acceleration with its unit; there are "
            f"{', '.join(table.header)[:200]}"
        )
    if len(values) > 1:
        raise ModelError(f"{table.source}:1: several spectra, {', '.join(values)}; leave one of them")
    return values[0], ACCELERATION[canonical(name_and_units(values[0])[1])]


def _is_acceleration(name: str) -> bool:
    what, unit = name_and_units(name)
    return bool(_VALUE.fullmatch(what)) and canonical(unit) in ACCELERATION
