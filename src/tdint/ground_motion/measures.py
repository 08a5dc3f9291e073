"""Intensity measures of ground motions, exact for an acceleration that is linear between samples.

Peak velocity and displacement (from rest at the first sample), Arias intensity (Arias 1970) with
its significant durations (Trifunac and Brady 1975), cumulative absolute velocity (EPRI NP-5930,
1988; CAV5: Kramer and Mitchell 2006, Earthquake Spectra 22(2)), the spectrum intensity of Housner
(1952), the mean period (Rathje, Abrahamson and Bray 1998), A95 (Sarma and Yang 1987) and the
bracketed duration (Bolt 1969). The mean period is a sum over discrete frequencies.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tdint.arrays import Array, bisect_interval
from tdint.ground_motion.record import UNITS_BY_LOCATION, Record
from tdint.number_parsing import abbreviate
from tdint.units import STANDARD_GRAVITY

HOUSNER_PERIODS = (0.1, 2.5)
"""Period range of the spectrum intensity, s; the spectrum has 5 % damping (Housner 1952)."""

CAV5 = 0.05
"""Acceleration threshold of CAV5, m/s^2; lower values are ignored (Kramer and Mitchell 2006)."""

BRACKET = 0.05 * STANDARD_GRAVITY
"""Acceleration threshold of the bracketed duration, m/s^2 (Bolt 1969)."""

_A95 = 0.95  # fraction of the Arias intensity at accelerations up to A95

_MEAN_PERIOD_BAND = (0.25, 20.0)
_MEAN_PERIOD_STEP = 0.05
"""Frequency range and maximum frequency interval of the mean period, Hz (Rathje, Faraj, Russell and
Bray 2004, Earthquake Spectra 20(1))."""

_MOST_POINTS = 10_000_000  # samples with zeros behind the record; limits time and memory

_CODES = re.compile(r"[A-Z0-9]{0,2}\.[A-Z0-9]{1,5}\.[^.]*\.[A-Z0-9]N[A-Z0-9]")
"""Pattern of the id of an accelerometer channel that MiniSEED can store (SEED manual 2.4)."""

_HALVINGS = 60  # bisection steps; the interval is then below the resolution of floats
_PADDING = 0.05
"""Fraction of the record length; more zeros at an end are reported."""

_FEW_ZEROS = 10  # samples; up to this number, zeros at an end are not reported

_JUMP = 0.1
"""Fraction of the peak acceleration; a larger first sample is reported."""

_LEFT = 0.5
"""Fraction of the peak displacement; a larger final displacement is reported."""

_DRIFT = 0.1
"""Fraction of the peak velocity; a larger final velocity is reported."""


@dataclass(frozen=True)
class Motion:
    """Velocity (m/s) and displacement (m) of the ground at the samples, shape (samples,), and their
    peaks, including maxima between samples."""

    velocity: Array
    displacement: Array
    pgv: float
    pgd: float


@dataclass(frozen=True)
class Measures:
    """Intensity measures of a record, SI units.

    Attributes
    ----------
    pga, pgv, pgd : float
        Peak acceleration (m/s^2), velocity (m/s) and displacement (m) of the ground. The peaks of
        velocity and displacement are those in the file; if the file has none, they are computed by
        integration from rest at the first sample.
    arias : float
        Arias intensity, pi / (2 g) times the integral of the squared acceleration, m/s.
    cav : float
        Cumulative absolute velocity, the integral of the absolute acceleration, m/s.
    cav5 : float
        Integral of the absolute acceleration over the times at which it is at least 0.05 m/s^2
        (Kramer and Mitchell 2006), m/s.
    d5_75, d5_95 : float
        Time between 5 and 75 or 95 % of the Arias intensity, s; nan if all samples are zero.
    mean_period : float
        Mean period of the Fourier amplitudes from 0.25 to 20 Hz, s; nan without amplitudes.
    a95 : float
        Acceleration level below which 95 % of the Arias intensity is contained, m/s^2.
    bracketed_duration : float
        Time between the first and the last acceleration of 0.05 g, s; 0 if it is not reached.
    mean : float
        Mean of the samples, m/s^2.
    leading_zeros, trailing_zeros : int
        Number of zero samples at the start and at the end.
    notes : tuple of str
        Unusual properties of the record.
    """

    pga: float
    pgv: float
    pgd: float
    arias: float
    cav: float
    cav5: float
    d5_75: float
    d5_95: float
    mean_period: float
    a95: float
    bracketed_duration: float
    mean: float
    leading_zeros: int
    trailing_zeros: int
    notes: tuple[str, ...]


def measure(record: Record) -> Measures:
    """Compute the intensity measures of a record, except the spectrum intensity; infinite or nan
    if they exceed the range of floats."""
    # As a decorator, errstate would share its saved state between threads (numpy before 2).
    with np.errstate(over="ignore", invalid="ignore"):
        motion = integrate(record)
        leading, trailing = zeros_at_ends(record.acceleration)
        doubts = _doubts(record, motion, leading, trailing)
    # Peaks of the velocity and the displacement in a file are more accurate than integration.
    both = (
        ("velocity", record.peaks[0], motion.pgv, "m/s"),
        ("displacement", record.peaks[1], motion.pgd, "m"),
    )
    of_file = [
        f"the peak {name} is from the {name} in the file; integration from rest gives "
        f"{integrated:.4g} {unit}"
        for name, column, integrated, unit in both
        if column is not None
    ]
    return Measures(
        **{name.replace("-", "_"): MEASURES[name].of(record) for name in _OURS},
        mean_period=mean_period(record),
        a95=a95(record),
        bracketed_duration=bracketed_duration(record, BRACKET),
        mean=float(np.mean(record.acceleration)),
        leading_zeros=leading,
        trailing_zeros=trailing,
        notes=(*of_file, *doubts),
    )


def integrate(record: Record) -> Motion:
    """Integrate the acceleration of a record from rest at the first sample, without baseline
    correction."""
    a, h = record.acceleration, record.dt
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * h * (a[:-1] + a[1:]))])
    displacement = np.concatenate(
        [[0.0], np.cumsum(h * velocity[:-1] + h * h / 6.0 * (2.0 * a[:-1] + a[1:]))]
    )

    # The velocity may have its maximum between samples, at a zero of the acceleration.
    i = np.flatnonzero(a[:-1] * a[1:] < 0.0)
    time = h * a[i] / (a[i] - a[i + 1])
    pgv = max(_largest(velocity), _largest(velocity[i] + 0.5 * a[i] * time))

    # The displacement may have its maximum at a zero of the velocity, a parabola between samples.
    start, slope = a[:-1], np.diff(a) / h
    with np.errstate(
        divide="ignore", invalid="ignore"
    ):  # Without a root, or with a root at infinity, no maximum is within the interval.
        q = -0.5 * (
            start + np.copysign(np.sqrt(start * start - 2.0 * slope * velocity[:-1]), start)
        )
        roots = np.stack([2.0 * q / slope, velocity[:-1] / q])
    row, i = np.nonzero((roots > 0.0) & (roots < h))
    t = roots[row, i]
    between = displacement[i] + t * (velocity[i] + t * (0.5 * start[i] + t * slope[i] / 6.0))
    return Motion(velocity, displacement, pgv, max(_largest(displacement), _largest(between)))


def channels_of(records: Sequence[Record]) -> list[Record]:
    """Return acceleration, velocity and displacement of records as channels for `to_mseed`.

    The three channels of a record have the same codes, with the location codes of
    `UNITS_BY_LOCATION`. The codes of the records are used if all are different accelerometer
    channels. Otherwise the stations are R01, R02, ... with the channel HN1.
    """
    codes = [record.id.split(".") for record in records]
    are_accelerometers = all(_CODES.fullmatch(record.id) for record in records)
    if not are_accelerometers or len(
        {(network, station, channel) for network, station, _, channel in codes}
    ) < len(codes):
        codes = [["", f"R{number:02d}", "", "HN1"] for number in range(1, len(records) + 1)]
    channels = []
    for record, (network, station, _, channel) in zip(records, codes, strict=True):
        motion = integrate(record)
        of_each = (record.acceleration, motion.velocity, motion.displacement)
        for location, samples in zip(UNITS_BY_LOCATION, of_each, strict=True):
            channels.append(
                replace(
                    record, acceleration=samples, id=f"{network}.{station}.{location}.{channel}"
                )
            )
    return channels


def cumulative_energy(record: Record) -> Array:
    """Return the integral of the squared acceleration from the first sample to each sample,
    m^2/s^3, shape (samples,)."""
    a, b = record.acceleration[:-1], record.acceleration[1:]
    return np.concatenate([[0.0], np.cumsum(record.dt / 3.0 * (a * a + a * b + b * b))])


_BEHIND = 0.05  # fraction of the Arias intensity after the end of D5-95
_MOST_NAMES = 5  # maximum number of records named in a message

_ARIAS = math.pi / (2.0 * STANDARD_GRAVITY)


def arias_intensity(record: Record) -> float:
    """Return the Arias intensity (Arias 1970), m/s: pi / (2 g) times the integral of the squared
    acceleration."""
    return _ARIAS * float(cumulative_energy(record)[-1])


def cut_off(records: Iterable[Record], end: float) -> list[str]:
    """Return a warning if an analysis ends too early for its records.

    The warning is given if more than 5 % of the Arias intensity of a record, the fraction after
    D5-95, follows the end of the analysis. The duration in a model may have been chosen for another
    record.

    Parameters
    ----------
    records : iterable of Record
        Ground motions of the analysis.
    end : float
        End of the analysis, s.

    Returns
    -------
    list of str
        The warning; empty if the analysis is long enough.
    """
    omitted_parts = []
    for record in records:
        if end < record.duration:
            energy = cumulative_energy(record)
            omitted = float(energy[-1] - energy[round(end / record.dt)])
            if omitted > _BEHIND * energy[-1]:
                omitted_parts.append(f"{record.name} {100.0 * omitted / energy[-1]:.2g} %")
    warning = (
        f"the analysis ends at {end:.6g} s and omits a part of the Arias intensity: "
        f"{abbreviate(omitted_parts, _MOST_NAMES)}; increase the duration"
    )
    return [warning] if omitted_parts else []


def time_of_energy(record: Record, energy: Array, fraction: float) -> float:
    """Return the time from the first sample at which a fraction of the energy is reached.

    Within a sampling interval, the energy is a non-decreasing cubic function of time; the time is
    computed by bisection.

    Parameters
    ----------
    record : Record
        Ground motion.
    energy : ndarray, shape (samples,)
        Result of `cumulative_energy`.
    fraction : float
        Fraction of the final energy.

    Returns
    -------
    float
        Time, s; nan if the final energy is zero or infinite.
    """
    target = fraction * float(energy[-1])
    if not 0.0 < target < math.inf:
        return math.nan
    i = int(np.searchsorted(energy, target)) - 1
    a, b = record.acceleration[i : i + 2].tolist()
    missing = (target - float(energy[i])) / record.dt
    _, part_of_interval = bisect_interval(
        lambda x: x * (a * a + a * (b - a) * x + (b - a) ** 2 * x * x / 3.0) < missing,
        0.0,
        1.0,
        _HALVINGS,
    )
    return (i + part_of_interval) * record.dt


def cumulative_absolute_velocity(record: Record) -> float:
    """Return the integral of the absolute acceleration, m/s."""
    a, b = record.acceleration[:-1], record.acceleration[1:]
    total = np.abs(a) + np.abs(b)
    crosses = a * b < 0.0
    # If the acceleration changes its sign, the area is two triangles, otherwise a trapezoid.
    means = np.where(crosses, (a * a + b * b) / np.where(crosses, total, 1.0), total)
    return 0.5 * record.dt * float(np.sum(means))


def cumulative_absolute_velocity_above(record: Record, threshold: float) -> float:
    """Return the integral of the absolute acceleration (m/s) while it is at least
    `threshold` (m/s^2)."""
    a, b = record.acceleration[:-1], record.acceleration[1:]
    low, high = np.minimum(a, b), np.maximum(a, b)
    change = np.where(high > low, high - low, 1.0)

    def integral_up_to(value: Array) -> Array:
        """Return the integral of the counted values with respect to acceleration, up to `value`."""
        size = np.abs(value)
        return np.asarray(
            np.copysign(np.maximum(0.5 * (size - threshold) * (size + threshold), 0.0), value)
        )

    # An interval is counted completely if both samples reach the threshold with the same sign.
    is_counted = (np.minimum(np.abs(a), np.abs(b)) >= threshold) & (a * b > 0.0)
    means = np.where(
        is_counted,
        0.5 * (np.abs(a) + np.abs(b)),
        (integral_up_to(high) - integral_up_to(low)) / change,
    )
    return record.dt * float(np.sum(means))


def significant_duration(record: Record, fraction: float) -> float:
    """Return the time between 5 % and the fraction `fraction` of the Arias intensity (Trifunac and
    Brady 1975), s; nan if all samples are zero."""
    energy = cumulative_energy(record)
    return time_of_energy(record, energy, fraction) - time_of_energy(record, energy, 0.05)


def a95(record: Record) -> float:
    """Return the acceleration level (m/s^2) below which 95 % of the Arias intensity is contained
    (Sarma and Yang 1987); 0 if all samples are zero, nan if they exceed the range of floats."""
    largest = record.pga
    if not 0.0 < largest < math.inf:
        return 0.0 if largest == 0.0 else math.nan
    samples = record.acceleration / largest
    a, b = samples[:-1], samples[1:]
    change = np.where(a == b, 1.0, b - a)

    def energy_below(level: float) -> float:
        """Return the integral of the squares at absolute values up to `level`, in intervals."""
        low, high = np.clip(a, -level, level), np.clip(b, -level, level)
        # Fraction of the interval below the level: all or nothing if the acceleration is constant.
        part = np.where(a == b, np.abs(a) <= level, (high - low) / change)
        return float(np.sum(part * (low * low + low * high + high * high)))

    target = _A95 * energy_below(1.0)
    _, level = bisect_interval(lambda level: energy_below(level) < target, 0.0, 1.0, _HALVINGS)
    return largest * level


def bracketed_duration(record: Record, threshold: float) -> float:
    """Return the time (s) between the first and the last absolute acceleration of `threshold`
    (m/s^2, positive); 0 if it is not reached (Bolt 1969)."""
    size = np.abs(record.acceleration)
    reached = np.flatnonzero(size >= threshold)
    if not reached.size:
        return 0.0

    def crossing(outside: int, inside: int) -> float:
        """Return the time, in sampling intervals, where the line from the sample `outside`, below
        the threshold, to its neighbor `inside`, at or above, crosses the threshold."""
        if not 0 <= outside < size.size:
            return float(inside)
        # Both values are positive in the direction of the inner sample.
        sign = math.copysign(1.0, float(record.acceleration[inside]))
        value_inside = sign * float(record.acceleration[inside])
        value_outside = sign * float(record.acceleration[outside])
        fraction = (threshold - value_outside) / (value_inside - value_outside)
        return outside + (inside - outside) * fraction

    first, last = int(reached[0]), int(reached[-1])
    return record.dt * (crossing(last + 1, last) - crossing(first - 1, first))


def mean_period(record: Record) -> float:
    """Return the mean period, s (Rathje, Abrahamson and Bray 1998): the mean of the periods from
    0.25 to 20 Hz, weighted by the squared Fourier amplitudes; nan without amplitudes.

    Zeros behind the record limit the frequency interval to 0.05 Hz.
    """
    least = 1.0 / (_MEAN_PERIOD_STEP * record.dt)
    if not 2.0 * _MEAN_PERIOD_BAND[0] * record.dt <= 1.0 or least > _MOST_POINTS:
        return math.nan
    count = max(record.acceleration.size, math.ceil(least))
    frequencies = np.fft.rfftfreq(count, record.dt)
    low, high = _MEAN_PERIOD_BAND
    band = (frequencies >= low) & (frequencies <= high)
    scale = record.pga or 1.0
    squares = np.abs(np.fft.rfft(record.acceleration / scale, count)[band]) ** 2
    total = float(np.sum(squares))
    return float(np.sum(squares / frequencies[band])) / total if total > 0.0 else math.nan


@dataclass(frozen=True)
class Measure:
    """Intensity measure that depends only on the ground motion.

    Attributes
    ----------
    name : str
        Name in commands (`d5-75`); tables use `_` instead of `-`.
    unit, meaning : str
        SI unit and description.
    value : callable
        Function of a Record; returns the measure in `unit`.
    power : float or None
        Exponent of the scale factor of the ground motion in the measure; 0 if the measure does not
        depend on the factor. None if the dependence is not a power; the measure is then recomputed.
    column : str
        Name in tables if it differs from `name`.
    """

    name: str
    unit: str
    meaning: str
    value: Callable[[Record], float]
    power: float | None = 1.0
    column: str = ""

    def of(self, record: Record) -> float:
        """Return the measure of a record; infinite or nan if it exceeds the range of floats.

        Parameters
        ----------
        record : Record
            Ground motion.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            return float(self.value(record))

    @property
    def head(self) -> str:
        """Name of the table column, without the unit."""
        return self.column or self.name.replace("-", "_")

    @property
    def without_levels(self) -> str:
        """Reason why a motion cannot be scaled to a level of the measure; empty if it can."""
        if self.power is None:
            return "its value is not proportional to a power of the scale factor"
        changes = "a duration" if self.unit == "s" else "it"
        return "" if self.power else f"{changes} does not change with a factor"


MEASURES = {
    measure.name: measure
    for measure in (
        Measure("pga", "m/s^2", "peak ground acceleration", lambda record: record.pga),
        Measure("pgv", "m/s", "peak ground velocity", lambda record: _peak(record, 0, "pgv")),
        Measure("pgd", "m", "peak ground displacement", lambda record: _peak(record, 1, "pgd")),
        Measure("arias", "m/s", "Arias intensity", arias_intensity, 2.0, "arias_intensity"),
        Measure("cav", "m/s", "cumulative absolute velocity", cumulative_absolute_velocity),
        Measure(
            "cav5",
            "m/s",
            "cumulative absolute velocity of accelerations of at least 0.05 m/s^2",
            lambda record: cumulative_absolute_velocity_above(record, CAV5),
            None,
        ),
        *(
            Measure(
                f"d5-{percent}",
                "s",
                f"time between 5 and {percent} % of the Arias intensity",
                partial(significant_duration, fraction=percent / 100.0),
                0.0,
            )
            for percent in (75, 95)
        ),
    )
}
"""Intensity measures of ground motions by name: those of tdint, then those of plug-ins
(`tdint.load_plugin`)."""

_OURS = tuple(MEASURES)


def _peak(record: Record, column: int, name: str) -> float:
    """Return the peak velocity or displacement in the file, otherwise the peak of the integration
    from rest at the first sample.

    Parameters
    ----------
    record : Record
        Ground motion record.
    column : int
        Index of the peak in `record.peaks`: 0 for the velocity, 1 for the displacement.
    name : str
        Attribute with the peak in the result of `integrate`.
    """
    peak = record.peaks[column]
    return float(getattr(integrate(record), name)) if peak is None else peak


def spectrum_intensity(periods: Array, psv: Array) -> float:
    """Return the spectrum intensity of Housner, m: the integral of pseudo-velocities (m/s) over
    periods (s), both of shape (k,)."""
    return float(np.sum(0.5 * np.diff(periods) * (psv[:-1] + psv[1:])))


def zeros_at_ends(samples: Array) -> tuple[int, int]:
    """Return the numbers of samples before the first and after the last non-zero sample; if all
    samples are zero, their number and 0."""
    nonzero = np.flatnonzero(samples)
    if not nonzero.size:
        return samples.size, 0
    return int(nonzero[0]), samples.size - 1 - int(nonzero[-1])


def _largest(values: Array) -> float:
    """Return the maximum absolute value; 0 for an empty array."""
    return float(np.max(np.abs(values), initial=0.0))


def _doubts(record: Record, motion: Motion, leading: int, trailing: int) -> tuple[str, ...]:
    """Return notes about zeros at the ends, a start within the motion and a baseline drift.

    Parameters
    ----------
    record : Record
        Ground motion.
    motion : Motion
        Result of `integrate`.
    leading, trailing : int
        Numbers of zeros at the start and at the end.
    """
    samples, size = record.acceleration, record.acceleration.size
    first, last = float(samples[0]), float(motion.velocity[-1])
    notes = [
        f"the {where} {zeros} of {size} samples are zero; check whether zeros were added"
        for where, zeros in (("first", leading), ("last", trailing))
        if max(_PADDING * size, _FEW_ZEROS) < zeros < size
    ]
    if abs(first) > _JUMP * record.pga:
        share = abs(first) / record.pga
        notes.append(
            f"the first sample is {first:.3g} m/s^2, {share:.0%} of the peak; check whether the "
            "start of the motion is missing"
        )
    # A baseline drift is visible in the velocity first. The displacement is checked only if the
    # velocity is not suspicious.
    end = abs(float(motion.displacement[-1]))
    if abs(last) > _DRIFT * motion.pgv:
        share = abs(last) / motion.pgv
        notes.append(
            f"the velocity at the end is {last:.3g} m/s, {share:.0%} of its peak; check for "
            "baseline drift"
        )
    elif end > _LEFT * motion.pgd and record.peaks[1] is None:
        share = end / motion.pgd
        notes.append(
            f"the displacement at the end is {end:.3g} m, {share:.0%} of its peak; check for "
            "baseline drift (permanent ground displacement is also possible)"
        )
    return tuple(notes)
