"""Target spectra: what a suite of ground motions is scaled to, a CSV file, or a design spectrum of a code by name and
parameters: `asce7:sds=1.0,sd1=0.6,tl=8`, `ec8:type=1,soil=B,ag=0.25g`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tdint.arrays import Array
from tdint.csv_table import CsvTable, read_table
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.formats.table_columns import name_and_units
from tdint.units import ACCELERATION, STANDARD_GRAVITY, canonical, parse_acceleration
from tdint.written_numbers import parse_named, parse_positive, parse_ratio

Texts = Mapping[str, str]

_NAMED = re.compile(r"([A-Za-z]\w*)(?::(\w+=.*)?)?", re.DOTALL)

_MCER = 1.5
"""The risk-targeted maximum considered earthquake over the design spectrum (ASCE 7-16, 11.4.7)."""

_GROUND = {
    "1": {
        "A": (1.0, 0.15, 0.4, 2.0),
        "B": (1.2, 0.15, 0.5, 2.0),
        "C": (1.15, 0.2, 0.6, 2.0),
        "D": (1.35, 0.2, 0.8, 2.0),
        "E": (1.4, 0.15, 0.5, 2.0),
    },
    "2": {
        "A": (1.0, 0.05, 0.25, 1.2),
        "B": (1.35, 0.05, 0.25, 1.2),
        "C": (1.5, 0.1, 0.25, 1.2),
        "D": (1.8, 0.1, 0.3, 1.2),
        "E": (1.6, 0.05, 0.25, 1.2),
    },
}
"""S, TB, TC, TD of types and grounds: the values that EN 1998-1:2004 recommends (tables 3.2 and 3.3)."""

_LEAST_ETA = 0.55
_EC8_END = 4.0  # s; beyond it stands Annex A


@dataclass(frozen=True)
class DesignSpectrum:
    """A design spectrum as its code writes it.

    Attributes
    ----------
    curve : callable
        Pseudo-accelerations, m/s^2, shape (k,), at periods (s, 0 or more), shape (k,).
    corners : tuple of float
        Periods at which its branches meet, s.
    damping : float
        Damping ratio that it is for.
    longest : float
        Period up to which the code has it, s.
    """

    curve: Callable[[Array], Array]
    corners: tuple[float, ...]
    damping: float
    longest: float = math.inf


def design_spectrum(text: str) -> DesignSpectrum | None:
    """The design spectrum that a text names with its parameters; None for a text that has no such form.

    Raises
    ------
    UsageError
        An unknown name; a parameter that is missing, unknown or wrong.
    """
    match = _NAMED.fullmatch(text.strip())
    if match is None:
        return None
    name, words = match[1].lower(), match[2]
    if name not in CODES:
        if words is None:
            return None
        raise UsageError(f"{text[:60]!r}: no design spectrum {name!r}; there are {', '.join(CODES)}")
    make, known = CODES[name]
    try:
        return make(parse_named(name, words or "", known, EXAMPLES[name]))
    except UsageError as error:
        raise UsageError(f"{text[:60]!r}: {error}") from None


def _two_period(given: Texts, factor: float = 1.0) -> DesignSpectrum:
    """The two-period design spectrum (ASCE 7-10, 7-16, 11.4), times a factor."""
    sds, sd1, tl = (parse_positive(key, given[key]) for key in ("sds", "sd1", "tl"))
    ts = sd1 / sds
    if not ts < tl:
        raise UsageError(f"tl = {tl:g} s must be longer than TS = sd1/sds = {ts:.4g} s")
    t0 = 0.2 * ts

    def curve(periods: Array) -> Array:
        t = np.maximum(periods, t0)  # no branch divides by 0
        shape = np.where(t <= ts, sds, np.where(t <= tl, sd1 / t, sd1 * tl / t**2))
        return factor * STANDARD_GRAVITY * np.where(periods < t0, sds * (0.4 + 0.6 * periods / t0), shape)

    return DesignSpectrum(curve, (t0, ts, tl), 0.05)


def _ec8(given: Texts) -> DesignSpectrum:
    """The elastic spectrum Se (EN 1998-1:2004, 3.2.2.2), with the recommended values or those of a National Annex."""
    soils = _GROUND.get(given["type"])
    if soils is None:
        raise UsageError(f"type must be 1 or 2, got {given['type']!r}")
    if given["soil"].upper() not in soils:
        raise UsageError(f"soil must be one of {', '.join(soils)}, got {given['soil']!r}")
    recommended = dict(zip(("s", "tb", "tc", "td"), soils[given["soil"].upper()], strict=True))
    s, tb, tc, td = (parse_positive(key, given[key]) if key in given else value for key, value in recommended.items())
    if not tb < tc < td < _EC8_END:
        raise UsageError(f"tb, tc, td must rise, below {_EC8_END:g} s, got {tb:g}, {tc:g}, {td:g} s")
    ag = parse_acceleration("ag", given["ag"], "0.25g")
    damping = parse_ratio(given.get("damping", "5%"))
    if not 0.0 < damping < 1.0:
        raise UsageError(f"damping must lie between 0 and 100 %, got {given['damping']!r}")
    plateau = 2.5 * max(math.sqrt(10.0 / (5.0 + 100.0 * damping)), _LEAST_ETA)

    def curve(periods: Array) -> Array:
        t = np.maximum(periods, tb)  # no branch divides by 0
        shape = plateau * np.where(t <= tc, 1.0, np.where(t <= td, tc / t, tc * td / t**2))
        return ag * s * np.where(periods < tb, 1.0 + periods / tb * (plateau - 1.0), shape)

    return DesignSpectrum(curve, (tb, tc, td), damping, _EC8_END)


_TWO_PERIOD = {"sds": True, "sd1": True, "tl": True}
CODES: Mapping[str, tuple[Callable[[Texts], DesignSpectrum], Mapping[str, bool]]] = {
    "asce7": (_two_period, _TWO_PERIOD),
    "mcer": (partial(_two_period, factor=_MCER), _TWO_PERIOD),
    "ec8": (
        _ec8,
        {"type": True, "soil": True, "ag": True, "damping": False, "s": False, "tb": False, "tc": False, "td": False},
    ),
}
"""By name what makes the spectrum, and its parameters: whether each must be given."""

EXAMPLES = {
    "asce7": "asce7:sds=1.0,sd1=0.6,tl=8",
    "mcer": "mcer:sds=1.0,sd1=0.6,tl=8",
    "ec8": "ec8:type=1,soil=B,ag=0.25g",
}


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
