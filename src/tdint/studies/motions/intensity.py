"""Intensity measures for the scaling of records: the pseudo-acceleration Sa at a period, its
average over periods, and measures of the ground motion such as PGA, PGV, Arias intensity and CAV.

The intensity of a pair of horizontal components is the geometric mean of both components, or a
percentile over all directions (RotD, Boore 2010). An intensity is proportional to a power of the
scale factor (`scale_exponent`): 1 for most measures, 2 for Arias intensity.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError, UsageError, did_you_mean
from tdint.grids import Grid
from tdint.ground_motion.measures import MEASURES
from tdint.ground_motion.reading.suites import GroundMotion
from tdint.ground_motion.record import Record
from tdint.response.arguments import AnyMotion, motion_of
from tdint.response.spectra.elastic import SA_DAMPING, spectrum
from tdint.response.spectra.rotated import rotated_spectrum

GEOMETRIC_MEAN = "geometric-mean"
LARGER_COMPONENT = "larger"
SRSS = "srss"
PAIRS: dict[str, int | None] = {
    GEOMETRIC_MEAN: None,
    "rotd50": 50,
    "rotd100": 100,
    LARGER_COMPONENT: None,
    SRSS: None,
}
"""Combinations of the components of a pair: percentile over all directions, or None for the
geometric mean, the larger value, or the square root of the sum of squares of both components."""

AVERAGE = Grid(0.2, 3.0, 50)
"""Default multiples of the period over which Sa is averaged (Eads et al. 2015)."""

_DIRECTIONS = 180  # number of directions of RotD, one per degree (Boore 2010)
_NO_PEAKS = (None, None)


@dataclass(frozen=True)
class SpectralIntensity:
    """Geometric mean of pseudo-accelerations at one or more periods. For one period it is Sa(T),
    and PGA at the period 0.
    """

    name: str
    periods: tuple[float, ...]
    damping: float
    unit: str = "m/s^2"
    scale_exponent: ClassVar[float] = 1.0

    def of(self, motion: GroundMotion, pair: str = GEOMETRIC_MEAN) -> float:
        """Return the intensity of a motion, m/s^2.

        Raises
        ------
        RecordError
            The motion is zero.
        AnalysisError
            A period is too short for the record.
        """
        values = pseudo_accelerations(motion, np.array(self.periods), self.damping, pair)
        return positive(geometric_mean(values), self.name, motion)


@dataclass(frozen=True)
class MotionIntensity:
    """Intensity measure that depends only on the ground motion, not on a period. The name is a key
    of `tdint.ground_motion.measures.MEASURES`; the default unit is that of the measure."""

    name: str
    unit: str = ""

    def __post_init__(self) -> None:
        # The class is frozen, so that an assignment to the attribute would raise an error.
        object.__setattr__(self, "unit", self.unit or MEASURES[self.name].unit)

    @property
    def scale_exponent(self) -> float:
        """Exponent of the scale factor in the intensity; NaN if the intensity is not proportional
        to a power of the scale factor."""
        return MEASURES[self.name].power or math.nan

    def of(self, motion: GroundMotion, pair: str = GEOMETRIC_MEAN) -> float:
        """Return the intensity of a motion, in its unit.

        Raises
        ------
        RecordError
            The motion is zero.
        """
        value = MEASURES[self.name].of
        if isinstance(motion, Record):
            return positive(value(motion), self.name, motion)
        percentile = percentile_of(pair)
        first, second = motion.first, motion.second
        if percentile is None:
            combined = _of_components(np.array(value(first)), np.array(value(second)), pair)
            return positive(float(combined), self.name, motion)
        # In the opposite direction only the sign of the motion differs.
        angles = np.arange(_DIRECTIONS) * (math.pi / _DIRECTIONS)
        x, y = (_to_peak_of_file(record, value) for record in (first, second))
        dt = first.dt
        # The rotated records have no names (empty texts).
        values = [
            value(Record(math.cos(angle) * x + math.sin(angle) * y, dt, "", "", "", ""))
            for angle in angles.tolist()
        ]
        return positive(float(np.percentile(values, percentile)), self.name, motion)


def _to_peak_of_file(record: Record, value: Callable[[Record], float]) -> Array:
    """Return the acceleration of a component, m/s^2. If `value` is a peak that the file states, it
    is scaled so that its integral has this peak: motions in other directions are integrated."""
    if record.peaks == _NO_PEAKS:
        return record.acceleration
    return record.acceleration * (value(record) / (value(replace(record, peaks=_NO_PEAKS)) or 1.0))


def scaling_obstacle(name: str) -> str:
    """Return the reason why motions cannot be scaled to levels of an intensity measure; an empty
    text if they can be scaled, or if the measure is unknown. `name` is the name of the measure
    without a period, such as `sa`."""
    if name == "sdi":
        return "it is not proportional to a power of the scale factor"
    return MEASURES[name].without_levels if name in MEASURES else ""


def scalable_measures() -> tuple[str, ...]:
    """Return the names of the intensity measures that permit scaling of motions to levels."""
    motion_measures = [name for name, measure in MEASURES.items() if not measure.without_levels]
    return (*motion_measures, *SPECTRAL)


IntensityMeasure = SpectralIntensity | MotionIntensity


def factor_to(value: float, measure: IntensityMeasure, unscaled: float) -> float:
    """Return the factor that scales a motion to a value of an intensity measure. The intensity is
    proportional to a power of the factor (`scale_exponent`).

    Parameters
    ----------
    unscaled : float
        Intensity of the motion without scaling, in the same unit.
    """
    return float((value / unscaled) ** (1.0 / measure.scale_exponent))


def pga() -> SpectralIntensity:
    """Return the intensity measure PGA, the maximum absolute acceleration of the samples."""
    return SpectralIntensity("pga", (0.0,), SA_DAMPING)


def sa(period: float, damping: float = SA_DAMPING) -> SpectralIntensity:
    """Return the intensity measure Sa(T), the pseudo-acceleration at a period (s). It is computed
    exactly for motions that are linear between samples."""
    check_period(period)
    return SpectralIntensity(f"sa({period:.6g})", (float(period),), damping)


def sa_average(
    period: float, damping: float = SA_DAMPING, multiples: Grid = AVERAGE
) -> SpectralIntensity:
    """Return the intensity measure average Sa: the geometric mean of pseudo-accelerations over
    several periods.

    Parameters
    ----------
    period : float
        Reference period, s.
    damping : float
        Damping ratio; default 5 %.
    multiples : Grid
        Periods of the average, divided by the reference period; by default 50 logarithmically
        spaced values from 0.2 to 3.

    Raises
    ------
    UsageError
        The period is not positive.
    """
    check_period(period)
    periods = tuple((period * multiples.values()).tolist())
    return SpectralIntensity(f"sa-avg({period:.6g})", periods, damping)


SPECTRAL: dict[str, Callable[[float, float], IntensityMeasure]] = {"sa": sa, "sa-avg": sa_average}
"""Function that returns the measure for a period and a damping ratio, by the name of the measure.
Only these measures depend on a period."""


def measure_at(name: str, damping: float, period: float) -> IntensityMeasure:
    """Return an intensity measure at a period.

    Parameters
    ----------
    name : str
        Name of the measure, one of `scalable_measures`.
    damping, period : float
        Damping ratio, and period in s; used only if the measure depends on these values.
    """
    if name in SPECTRAL:
        return SPECTRAL[name](period, damping)
    return pga() if name == "pga" else MotionIntensity(name)


def measure_of(name: str, damping: float = SA_DAMPING) -> IntensityMeasure:
    """Return the intensity measure with a name.

    Parameters
    ----------
    name : str
        Name as in tables: `sa(1.0)` or `sa-avg(1.0)` with a period in s, `pga`, or the name of
        another measure of the ground motion.
    damping : float
        Damping ratio of spectral measures; default 5 %.

    Raises
    ------
    UsageError
        The measure is unknown, or motions cannot be scaled to its levels.
    """
    # Split `sa(1.0)` into `sa` and `1.0`.
    base_name, _, period = name.strip().removesuffix(")").partition("(")
    if reason := scaling_obstacle(base_name):
        raise UsageError(f"{name} cannot be used for scaling: {reason}")
    if base_name in scalable_measures() and base_name not in SPECTRAL and not period:
        return measure_at(base_name, damping, 1.0)  # any period: the measure does not depend on it
    # The functions of SPECTRAL raise UsageError for a period that is not positive, infinite or nan.
    try:
        return SPECTRAL[base_name](float(period), damping)
    except (KeyError, ValueError):
        motion_measures = (known for known in scalable_measures() if known not in SPECTRAL)
        known_names = (*motion_measures, "sa(T)", "sa-avg(T) with T in s")
        raise unknown_measure(name, known_names) from None


def intensity(
    motion: AnyMotion, measure: str, *, damping: float = SA_DAMPING, pairs: str = GEOMETRIC_MEAN
) -> float:
    """Return an intensity measure of a ground motion.

    Parameters
    ----------
    motion : Record, Horizontals, str, Path, ObsPy trace, or pair of these
        Record in any form that `run` accepts, or both components of a motion.
    measure : str
        `sa(1.0)` or `sa-avg(1.0)` with a period in s, `pga`, `pgv`, `pgd`, `arias`, `cav`, `cav5`,
        `d5-75`, `d5-95`, or a measure of a plug-in.
    damping : float
        Damping ratio of spectral measures; default 5 %.
    pairs : str
        Combination of two components: `geometric-mean` (default), `rotd50`, `rotd100`, `larger` or
        `srss`.

    Returns
    -------
    float
        Intensity in SI units, such as m/s^2 of `sa`, m/s of `arias` and `cav`, s of durations.

    Raises
    ------
    UsageError
        The measure or the combination is unknown, or a number is out of range.
    RecordError
        The motion is invalid or zero.
    AnalysisError
        A period is too short for the record.
    """
    name = measure.strip()
    chosen = MotionIntensity(name) if name in MEASURES else measure_of(name, damping)
    return chosen.of(motion_of(motion), pairs)


def unknown_measure(name: str, known: Iterable[str], hint: str = "") -> UsageError:
    """Return the error for an unknown intensity measure.

    Parameters
    ----------
    known : iterable of str
        Forms of the known measures, such as `pga` and `sa(T)`.
    """
    return UsageError(f"unknown intensity measure {name!r:.60}{hint} (known: {', '.join(known)})")


def percentile_of(pair: str) -> int | None:
    """Return the percentile over all directions for a name of `PAIRS`: 50 for `rotd50`, 100 for
    `rotd100`, None for combinations of the values of both components.

    Raises
    ------
    UsageError
        The name is unknown.
    """
    if pair not in PAIRS:
        raise UsageError(
            f"pairs must be one of {', '.join(PAIRS)}, got {pair!r}{did_you_mean(pair, PAIRS)}"
        )
    return PAIRS[pair]


def geometric_mean(values: Array) -> float:
    """Return the geometric mean of nonnegative numbers; 0 if a number is zero."""
    return float(np.exp(np.mean(np.log(values)))) if np.all(values > 0.0) else 0.0


def pseudo_accelerations(
    motion: GroundMotion, periods: Array, damping: float, pair: str = GEOMETRIC_MEAN
) -> Array:
    """Return the pseudo-accelerations of a motion, m/s^2, shape (k,).

    Parameters
    ----------
    pair : str
        Combination of the components of a pair: a name of `PAIRS`. It is not used for a single
        record.

    Raises
    ------
    UsageError
        Periods or damping are out of range, or `pair` is unknown.
    AnalysisError
        A period is too short for the record.
    """
    if isinstance(motion, Record):
        return spectrum(motion, periods, damping).psa
    percentile = percentile_of(pair)
    if percentile is None:
        spectra = [
            spectrum(record, periods, damping).psa for record in (motion.first, motion.second)
        ]
        return _of_components(spectra[0], spectra[1], pair)
    return np.asarray(rotated_spectrum(motion, periods, damping, [percentile]).psa[0])


def _of_components(first: Array, second: Array, pair: str) -> Array:
    """Return the combination of the values of two components (`PAIRS`)."""
    if pair == LARGER_COMPONENT:
        return np.maximum(first, second)
    return np.hypot(first, second) if pair == SRSS else np.sqrt(first * second)


def check_period(period: float) -> None:
    """Raise UsageError if the period of an intensity measure is not positive, or infinite."""
    if period == math.inf:
        raise UsageError(
            "there is no first period for the intensity measure, because a story has no initial "
            "stiffness; give a period, or use a measure without a period, such as pga"
        )
    if not (math.isfinite(period) and period > 0.0):
        raise UsageError(
            "the period of an intensity measure must be a positive number of seconds, got "
            f"{period!r}"
        )


def positive(value: float, name: str, motion: GroundMotion) -> float:
    """Return the intensity `value` of a motion; raise RecordError if it is not positive, because
    the motion is zero and cannot be scaled."""
    if not (math.isfinite(value) and value > 0.0):
        raise RecordError(
            f"{motion.name or 'record'}: {name} is {value:g}; the motion cannot be scaled"
        )
    return value
