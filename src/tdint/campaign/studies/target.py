"""Target spectra: what a suite of ground motions is scaled to, read from a CSV file."""

from __future__ import annotations

import csv
import io
import math
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdint.errors import ModelError, UsageError
from tdint.units import ACCELERATION

Array = NDArray[np.float64]

_PERIOD = ("period_s", "period", "t")
_ENDS = {"_m_s2": "m/s^2", "_cm_s2": "cm/s^2", "_gal": "gal", "_g": "g"}
_VALUE = re.compile(r"(?:(?:rotd\d+|geometric_mean)_)?(?:psa|sa)", re.IGNORECASE)
_MOST_BYTES = 64 * 1024 * 1024


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
    rows = list(csv.reader(io.StringIO(_text(source))))
    if not rows:
        raise ModelError(f"{source}: is empty; its first line must name the columns period_s and sa_g or sa_m_s2")
    header = [cell.strip() for cell in rows[0]]
    period, value, factor = _places(source, header)
    points: list[tuple[float, float]] = []
    for number, row in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in row):
            continue
        x, y = (_number(source, number, header, row, place) for place in (period, value))
        if x < 0.0 or y <= 0.0:
            raise ModelError(f"{source}:{number}: periods must be 0 or positive and accelerations positive")
        if points and not x > points[-1][0]:
            raise ModelError(
                f"{source}:{number}: period {x:g} does not follow {points[-1][0]:g}; a target is one spectrum with "
                "rising periods"
            )
        points.append((x, y * factor))
    points = [point for point in points if point[0] > 0.0]
    if len(points) < 2:
        raise ModelError(f"{source}: a spectrum needs two periods at least")
    periods, psa = np.array(points).T
    return TargetSpectrum(source, periods, psa)


def _text(source: str) -> str:
    try:
        data = sys.stdin.buffer.read(_MOST_BYTES) if source == "-" else Path(source).read_bytes()
        return data.decode("utf-8-sig")
    except FileNotFoundError:
        raise ModelError(f"{source}: no such file; give a CSV file with the columns period_s and sa_g") from None
    except UnicodeDecodeError:
        raise ModelError(f"{source}: not UTF-8 text") from None
    except (OSError, ValueError) as error:
        raise ModelError(f"{source}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def _places(source: str, header: list[str]) -> tuple[int, int, float]:
    """The places of period and acceleration, and the factor of the latter to m/s^2."""
    period = next((i for i, name in enumerate(header) if name.lower() in _PERIOD), None)
    values = [(i, name, end) for i, name in enumerate(header) for end in _ENDS if _names(name, end)]
    pseudo = [found for found in values if "psa" in found[1].lower()]
    values = pseudo or values
    if period is None or not values:
        missing = "period_s" if period is None else "sa_g or sa_m_s2: an acceleration with its unit"
        raise ModelError(f"{source}:1: no column {missing}; there are {', '.join(header)[:120]}")
    if len(values) > 1:
        raise ModelError(f"{source}:1: several spectra, {', '.join(name for _, name, _ in values)}; leave one of them")
    return period, values[0][0], ACCELERATION[_ENDS[values[0][2]]]


def _names(name: str, end: str) -> bool:
    return name.lower().endswith(end) and bool(_VALUE.fullmatch(name[: -len(end)]))


def _number(source: str, line: int, header: list[str], row: list[str], place: int) -> float:
    text = row[place].strip() if place < len(row) else ""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ModelError(f"{source}:{line}: {header[place]} must be a number, got {text[:40]!r}")
    return number
