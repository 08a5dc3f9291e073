"""Design spectra of codes by name and parameters: `asce7:sds=1.0,sd1=0.6,tl=8`, `ec8:type=1,soil=B,ag=0.25g`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.errors import UsageError
from tdint.units import STANDARD_GRAVITY, parse_acceleration
from tdint.written_numbers import parse_named, parse_positive, parse_ratio

Array = NDArray[np.float64]
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


def _asce7(given: Texts) -> DesignSpectrum:
    """The two-period design spectrum (ASCE 7-10, 7-16, 11.4)."""
    return _two_period(given, 1.0)


def _mcer(given: Texts) -> DesignSpectrum:
    """One and a half times the design spectrum."""
    return _two_period(given, _MCER)


def _two_period(given: Texts, factor: float) -> DesignSpectrum:
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
    "asce7": (_asce7, _TWO_PERIOD),
    "mcer": (_mcer, _TWO_PERIOD),
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
