"""Measures of a ground motion's intensity, by which records are scaled: Sa at a period, its
average, and what a motion has by itself, as PGA, PGV, Arias intensity, CAV
(`tdint.ground_motion.measures`).

Of a pair of horizontal components the geometric mean of both, or a percentile over all directions
(RotD, Boore 2010). They grow in proportion to a power of a factor on the motion, Arias intensity to
its square.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tdint.analysis.spectra.elastic import SA_DAMPING, spectrum
from tdint.analysis.spectra.rotated import rotated_spectrum
from tdint.arrays import Array
from tdint.errors import RecordError, UsageError, did_you_mean
from tdint.ground_motion.measures import MEASURES
from tdint.ground_motion.reading.suites import GroundMotion
from tdint.ground_motion.record import Record
from tdint.written_numbers import Grid

GEOMETRIC_MEAN = "geometric-mean"
PAIRS: dict[str, int | None] = {GEOMETRIC_MEAN: None, "rotd50": 50, "rotd100": 100}
"""What stands for a pair: the percentile over all directions, or None for the geometric mean of
both components."""

AVERAGE = Grid(0.2, 3.0, 50)
"""Multiples of the period over which Sa is averaged, where nothing else is asked for (Eads et al.
2015)."""

_DIRECTIONS = 180  # every degree, as RotD is defined by (Boore 2010)


@dataclass(frozen=True)
class SpectralIntensity:
    """The geometric mean of pseudo-accelerations at some periods; of a single one it is Sa(T), at
    period 0 the PGA.

    Attributes
    ----------
    name : str
        As tables name it.
    periods : tuple of float
        Periods, s.
    damping : float
        Damping ratio.
    """

    name: str
    periods: tuple[float, ...]
    damping: float
    unit: str = "m/s^2"
    growth: ClassVar[float] = 1.0

    def of(self, motion: GroundMotion, pair: str = GEOMETRIC_MEAN) -> float:
        """The intensity of a motion, m/s^2; of two components that which `pair` names.

        Raises
        ------
        RecordError
            The motion has none: it is zero.
        AnalysisError
            A period is too short for the record.
        """
        values = pseudo_accelerations(motion, np.array(self.periods), self.damping, pair)
        return _positive(geometric_mean(values), self.name, motion)


@dataclass(frozen=True)
class MotionIntensity:
    """A measure of the motion of the ground alone, of `tdint.ground_motion.measures.MEASURES` by
    its name."""

    name: str
    unit: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", self.unit or MEASURES[self.name].unit)

    @property
    def growth(self) -> float:
        """The power of a factor with which it grows."""
        return MEASURES[self.name].power or math.nan

    def of(self, motion: GroundMotion, pair: str = GEOMETRIC_MEAN) -> float:
        """The intensity of a motion, in its unit; of two components that which `pair` names.

        Raises
        ------
        RecordError
            The motion has none: it is zero.
        """
        value = MEASURES[self.name].of
        if isinstance(motion, Record):
            return _positive(value(motion), self.name, motion)
        percentile = percentile_of(pair)
        first, second = motion.first, motion.second
        if percentile is None:
            return _positive(math.sqrt(value(first) * value(second)), self.name, motion)
        # Each direction has a record of its own: half a turn, for the other half differs in sign
        # alone.
        angles = np.arange(_DIRECTIONS) * (math.pi / _DIRECTIONS)
        x, y, dt = first.acceleration, second.acceleration, first.dt
        values = [
            value(Record(math.cos(a) * x + math.sin(a) * y, dt, "", "", "", ""))
            for a in angles.tolist()
        ]
        return _positive(float(np.percentile(values, percentile)), self.name, motion)


def without_levels(name: str) -> str:
    """Why no factor brings a motion to a level of a measure; empty where one does, or there is none
    of that name."""
    if name == "sdi":
        return "it does not grow by a power of the factor"
    return MEASURES[name].without_levels if name in MEASURES else ""


def levelled() -> tuple[str, ...]:
    """The names of the measures that motions are brought to levels of."""
    return (*(name for name, measure in MEASURES.items() if not measure.without_levels), *SPECTRAL)


IntensityMeasure = SpectralIntensity | MotionIntensity


def factor_to(value: float, measure: IntensityMeasure, measured: float) -> float:
    """The factor that brings a motion from what was measured to a value."""
    return float((value / measured) ** (1.0 / measure.growth))


def pga() -> SpectralIntensity:
    """Peak ground acceleration, at the samples."""
    return SpectralIntensity("pga", (0.0,), SA_DAMPING)


def sa(period: float, damping: float = SA_DAMPING) -> SpectralIntensity:
    """Pseudo-acceleration at a period (s), exact for a motion that is linear between its
    samples."""
    _check_period(period)
    return SpectralIntensity(f"sa({period:.6g})", (float(period),), damping)


def sa_average(
    period: float, damping: float = SA_DAMPING, multiples: Grid = AVERAGE
) -> SpectralIntensity:
    """The geometric mean of pseudo-accelerations over multiples of a period (s), in equal
    ratios."""
    _check_period(period)
    periods = tuple((period * multiples.values()).tolist())
    return SpectralIntensity(f"sa-avg({period:.6g})", periods, damping)


SPECTRAL: dict[str, Callable[[float, float], IntensityMeasure]] = {"sa": sa, "sa-avg": sa_average}
"""Measures that have a period."""


def measure_at(name: str, damping: float, period: float) -> IntensityMeasure:
    """The measure of a name of `levelled`, at a period (s) if it has one."""
    if name in SPECTRAL:
        return SPECTRAL[name](period, damping)
    return pga() if name == "pga" else MotionIntensity(name)


def measure_of(name: str, damping: float = SA_DAMPING) -> IntensityMeasure:
    """The measure of a name as tables have it: `sa(1.0)`, `sa-avg(1.0)`, periods in s, `pga`, or
    another of a motion.

    Raises
    ------
    UsageError
        There is none of that name, or no factor brings a motion to a level of it.
    """
    kind, _, period = name.strip().removesuffix(")").partition("(")
    if reason := without_levels(kind):
        raise UsageError(f"{name}: {reason}; nothing can be scaled to it")
    if kind in levelled() and kind not in SPECTRAL and not period:
        return measure_at(kind, damping, 1.0)
    try:
        return SPECTRAL[kind](float(period), damping)
    except (KeyError, ValueError):
        plain = ", ".join(known for known in levelled() if known not in SPECTRAL)
        raise UsageError(
            f"unknown measure {name!r:.60}; known: {plain}, sa(T), sa-avg(T) with T in s"
        ) from None


def percentile_of(pair: str) -> int | None:
    """The percentile over all directions that a name of `PAIRS` stands for; None for the geometric
    mean.

    Raises
    ------
    UsageError
        There is no such name.
    """
    if pair not in PAIRS:
        raise UsageError(
            f"pairs must be one of {', '.join(PAIRS)}, got {pair!r}{did_you_mean(pair, PAIRS)}"
        )
    return PAIRS[pair]


def geometric_mean(values: Array) -> float:
    """Of numbers none of which is negative; 0 if one is zero."""
    return float(np.exp(np.mean(np.log(values)))) if np.all(values > 0.0) else 0.0


def pseudo_accelerations(
    motion: GroundMotion, periods: Array, damping: float, pair: str = GEOMETRIC_MEAN
) -> Array:
    """Pseudo-accelerations of a motion at periods (s), m/s^2, shape (k,); of two components that
    which `pair` names.

    Raises
    ------
    UsageError
        Periods or damping out of range.
    AnalysisError
        A period is too short for the record.
    """
    if isinstance(motion, Record):
        return spectrum(motion, periods, damping).psa
    percentile = percentile_of(pair)
    if percentile is None:
        both = [spectrum(record, periods, damping).psa for record in (motion.first, motion.second)]
        return np.asarray(np.sqrt(both[0] * both[1]))
    return np.asarray(rotated_spectrum(motion, periods, damping, [percentile]).psa[0])


def _check_period(period: float) -> None:
    if not (math.isfinite(period) and period > 0.0):
        raise UsageError(
            "the period of an intensity measure must be a positive number of seconds, got "
            f"{period!r}"
        )


def _positive(value: float, name: str, motion: GroundMotion) -> float:
    if not (math.isfinite(value) and value > 0.0):
        whose = f"{motion.source} {motion.component}".strip() or "record"
        raise RecordError(f"{whose}: its {name} is {value:g}; there is nothing to scale")
    return value
