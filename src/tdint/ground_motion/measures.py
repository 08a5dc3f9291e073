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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from typing import NamedTuple

import numpy as np

from tdint.arrays import Array, bisect_interval, max_absolute
from tdint.files import declared_rows
from tdint.ground_motion.record import UNITS_BY_LOCATION, Record
from tdint.items import grouped
from tdint.number_parsing import abbreviate
from tdint.units import STANDARD_GRAVITY

HOUSNER_PERIODS = (0.1, 2.5)
"""Period range of the spectrum intensity, s; the spectrum has 5 % damping (Housner 1952)."""

CAV5 = 0.05
"""Acceleration threshold of CAV5, m/s^2; lower values are ignored (Kramer and Mitchell 2006)."""

BRACKET = 0.05 * STANDARD_GRAVITY
"""Acceleration threshold of the bracketed duration, m/s^2 (Bolt 1969)."""

_A95 = 0.95  # fraction of the Arias intensity below the level A95 (Sarma and Yang 1987)

_MEAN_PERIOD_BAND = (0.25, 20.0)
_MEAN_PERIOD_STEP = 0.05
"""Frequency range and maximum frequency interval of the mean period, Hz (Rathje, Faraj, Russell and
Bray 2004, Earthquake Spectra 20(1))."""

_ROUNDING = 1e-9
"""Relative rounding error of a frequency, with a margin: the limits belong to the band."""

_MAX_FOURIER_SAMPLES = 10_000_000
"""Maximum number of samples of the Fourier transform, with added zeros, for the mean period; limits
time and memory."""

_BLOCK = 2**16
"""Number of sampling intervals that are evaluated together, which limits the memory for a long
record. Most records have fewer."""

_CODES = r"[A-Z0-9]{0,2}\.[A-Z0-9]{1,5}\.[^.]*\.[A-Z0-9]N[A-Z0-9]"
"""Pattern of the id of an accelerometer channel that MiniSEED can store (SEED manual 2.4)."""

_MAX_BISECTIONS = 60
"""Maximum number of bisections of an interval of length 1; the final interval is then shorter than
the resolution of floats."""

_ZERO_FRACTION = 0.05
"""Fraction of the number of samples; more zeros at an end of the record are reported."""

_MIN_REPORTED_ZEROS = 10  # up to this number of samples, zeros at an end are not reported

_MAX_FIRST_SAMPLE = 0.1
"""Fraction of the peak acceleration; a larger first sample is reported."""

_MAX_FINAL_DISPLACEMENT = 0.5
"""Fraction of the peak displacement; a larger final displacement is reported."""

_MAX_FINAL_VELOCITY = 0.1
"""Fraction of the peak velocity; a larger final velocity is reported."""

_without_warnings = partial(np.errstate, over="ignore", invalid="ignore")
"""Context in which numbers outside the range of double precision give no warnings."""


class Motion(NamedTuple):
    """Velocity and displacement of the ground, computed by integration of the acceleration.

    Attributes
    ----------
    velocity, displacement : ndarray, shape (samples,)
        Velocity (m/s) and displacement (m) at the samples.
    pgv, pgd : float
        Maximum absolute velocity (m/s) and displacement (m) at and between the samples.
    """

    velocity: Array
    displacement: Array
    pgv: float
    pgd: float


class Measures(NamedTuple):
    """Intensity measures of a record, SI units.

    Attributes
    ----------
    pga, pgv, pgd : float
        Peak acceleration (m/s^2), velocity (m/s) and displacement (m) of the ground. The peaks of
        velocity and displacement are read from the file; if the file does not state them, they are
        computed by integration from rest at the first sample.
    arias : float
        Arias intensity, pi / (2 g) times the integral of the squared acceleration, m/s.
    cav : float
        Cumulative absolute velocity, the integral of the absolute acceleration, m/s.
    cav5 : float
        Integral of the absolute acceleration while it is at least 0.05 m/s^2
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
    added : dict of str to float
        Measures of plug-ins by name, in their units.
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
    added: Mapping[str, float]

    def value(self, name: str) -> float:
        """Return a measure of `MEASURES` by its name, in its unit."""
        if name in self.added:
            return self.added[name]
        return float(getattr(self, name.replace("-", "_")))


def measure(record: Record) -> Measures:
    """Compute the intensity measures of a record that do not require a response spectrum.

    Returns
    -------
    Measures
        Intensity measures in SI units; infinite or nan if a value exceeds the range of floats.
    """
    # As a decorator, errstate would share its saved state between threads (numpy before 2).
    with _without_warnings():
        motion = integrate(record)
        leading, trailing = zeros_at_ends(record.acceleration)
        doubts = _doubts(record, motion)
    stored_pgv, stored_pgd = _stored_peaks(record, motion)
    pgv, pgd = motion.pgv, motion.pgd
    # Peaks that are stored in the file are used instead of the integrated peaks, because they are
    # more accurate. The notes state the integrated peaks for comparison.
    peaks = (
        ("velocity", stored_pgv, pgv, "m/s"),
        ("displacement", stored_pgd, pgd, "m"),
    )
    del motion  # its arrays are as large as the record
    # Integrals that several measures need are computed once.
    with _without_warnings():
        energy = cumulative_energy(record)
        from_integrals = {
            "pgv": pgv if stored_pgv is None else stored_pgv,
            "pgd": pgd if stored_pgd is None else stored_pgd,
            "arias": _ARIAS_FACTOR * float(energy[-1]),
            "d5-75": _significant_duration(record, energy, 0.75),
            "d5-95": _significant_duration(record, energy, 0.95),
        }
    del energy
    values = {
        name: from_integrals[name] if name in from_integrals else MEASURES[name].of(record)
        for name in BUILTIN_MEASURES
    }
    size = record.acceleration.size
    peak_notes = [
        f"the peak {name} is from the {name} in the file; integration from rest gives "
        f"{integrated_peak:.4g} {unit}"
        for name, stored_peak, integrated_peak, unit in peaks
        if stored_peak is not None
    ]
    return Measures(
        **{name.replace("-", "_"): value for name, value in values.items()},
        mean_period=mean_period(record),
        a95=a95(record),
        bracketed_duration=bracketed_duration(record, BRACKET),
        mean=float(np.mean(record.acceleration)),
        leading_zeros=leading,
        trailing_zeros=trailing,
        notes=(
            *peak_notes,
            *(
                f"the {position} {zeros} of {size} samples are zero; check whether zeros were added"
                for position, zeros in (("first", leading), ("last", trailing))
                if max(_ZERO_FRACTION * size, _MIN_REPORTED_ZEROS) < zeros < size
            ),
            *map(str, doubts),
        ),
        added={
            name: measure.of(record)
            for name, measure in MEASURES.items()
            if name not in BUILTIN_MEASURES
        },
    )


def integrate(record: Record) -> Motion:
    """Integrate the acceleration of a record to velocity and displacement.

    The ground is at rest at the first sample, and the acceleration is linear between samples. The
    integrals and the maxima between samples are exact for this acceleration. The baseline is not
    corrected.
    """
    h, samples = record.dt, record.acceleration.size
    velocity, displacement = np.zeros(samples), np.zeros(samples)
    pgv = pgd = 0.0
    for block, a, b in _intervals(record):
        # Within an interval h, the acceleration changes linearly from a to b, the velocity changes
        # by h (a + b) / 2, and the displacement by h v plus h^2 (2 a + b) / 6.
        v = _accumulate(velocity, block, 0.5 * h * (a + b))
        u = _accumulate(displacement, block, h * v + h * h / 6.0 * (2.0 * a + b))
        block_pgv, block_pgd = _maxima_between(u, v, a, b, h)
        pgv, pgd = max(pgv, block_pgv), max(pgd, block_pgd)
    return Motion(
        velocity,
        displacement,
        max(pgv, max_absolute(velocity)),
        max(pgd, max_absolute(displacement)),
    )


_SAME_PEAK = 1e-6
"""Maximum relative difference of the same peak in a file and in the integrated motion; files
contain rounded numbers."""


def _stored_peaks(record: Record, motion: Motion) -> tuple[float | None, float | None]:
    """Return the peak velocity and displacement of the file of a record; None for a peak that the
    file does not contain, or that is the largest sample of the integrated motion, as in a table
    that tdint has written. The integration includes peaks between samples.
    """
    pgv, pgd = (
        None
        if stored is None or math.isclose(stored, max_absolute(samples), rel_tol=_SAME_PEAK)
        else stored
        for stored, samples in zip(
            record.peaks, (motion.velocity, motion.displacement), strict=True
        )
    )
    return pgv, pgd


def _intervals(record: Record) -> Iterator[tuple[slice, Array, Array]]:
    """Yield blocks of sampling intervals: the slice of the samples at their starts, and the
    accelerations at their starts and at their ends."""
    acceleration = record.acceleration
    for start in range(0, acceleration.size - 1, _BLOCK):
        block = slice(start, min(start + _BLOCK, acceleration.size - 1))
        yield block, acceleration[block], acceleration[start + 1 : block.stop + 1]


def _accumulate(integral: Array, block: slice, changes: Array) -> Array:
    """Add the changes in a block of sampling intervals to an integral over time, shape (samples,),
    and return the values at the starts of the intervals."""
    # The first value of a record is not added, because 0.0 would change the sign of -0.0.
    if block.start:
        changes[0] += integral[block.start]
    np.cumsum(changes, out=integral[block.start + 1 : block.stop + 1])
    return integral[block]


def _maxima_between(u: Array, v: Array, a: Array, b: Array, h: float) -> tuple[float, float]:
    """Return the maximum absolute velocity and displacement between samples.

    Parameters
    ----------
    u, v, a, b : ndarray, shape (intervals,)
        Displacement (m), velocity (m/s) and acceleration (m/s^2) at the starts of the sampling
        intervals, and acceleration at their ends.
    h : float
        Sampling interval, s.
    """
    # The velocity may have its maximum between samples, at a zero of the acceleration.
    i = np.flatnonzero(a * b < 0.0)
    time = h * a[i] / (a[i] - b[i])
    pgv = max_absolute(v[i] + 0.5 * a[i] * time)

    # The displacement may have its maximum at a zero of the velocity v + start t + slope t^2 / 2,
    # where v is the velocity at the sample and t the time after it. Both roots are computed from q,
    # which avoids cancellation. A root that does not exist is nan or infinite, and is excluded by
    # the comparison with h.
    slope = (b - a) / h
    with np.errstate(divide="ignore", invalid="ignore"):
        discriminant = a * a - 2.0 * slope * v
        q = -0.5 * (a + np.copysign(np.sqrt(discriminant), a))
        roots = np.stack([2.0 * q / slope, v / q])
    row, i = np.nonzero((roots > 0.0) & (roots < h))
    t = roots[row, i]
    return pgv, max_absolute(u[i] + t * (v[i] + t * (0.5 * a[i] + t * slope[i] / 6.0)))


def channels_of(records: Sequence[Record]) -> list[Record]:
    """Return acceleration, velocity and displacement of records as channels for `to_mseed`.

    The three channels of a record differ only in their location codes, which identify the units
    (`UNITS_BY_LOCATION`). The network, station and channel codes of the records are used if they
    are different accelerometer channels. Otherwise the stations are R01, R02, ... with the channel
    HN1, or HNZ for a vertical component. The two horizontal components of a recording are the
    channels HNN and HNE, or HNX and HNY, of a station.

    Returns
    -------
    list of Record
        Three records for each ground motion, with ids NET.STA.LOC.CHA. The attribute `acceleration`
        contains m/s^2, m/s and m, respectively.
    """
    codes = [record.id.split(".") for record in records]
    are_accelerometers = all(re.fullmatch(_CODES, record.id) for record in records)
    # The ids are distinct without their locations, because the locations are replaced.
    are_distinct = are_accelerometers and len(
        {(network, station, channel) for network, station, _, channel in codes}
    ) == len(codes)
    if not are_distinct:
        codes = _new_codes(records)
    channels = []
    for record, (network, station, _, channel) in zip(records, codes, strict=True):
        motion = integrate(record)
        quantities = (record.acceleration, motion.velocity, motion.displacement)
        for location, samples in zip(UNITS_BY_LOCATION, quantities, strict=True):
            channels.append(
                replace(
                    record, acceleration=samples, id=f"{network}.{station}.{location}.{channel}"
                )
            )
    return channels


def _new_codes(records: Sequence[Record]) -> list[list[str]]:
    """Return network, station, location and channel of records without distinct codes, as described
    in `channels_of`."""
    # Imported here, because a run does not need the module.
    from tdint.ground_motion.horizontals import (
        at_right_angles,
        azimuth,
        is_vertical,
        motion_names,
        with_component,
    )

    components = [with_component(record, in_degrees=True).component for record in records]
    motions = motion_names([record.source for record in records])
    by_motion = grouped((name, index) for index, name in enumerate(motions))
    codes: dict[int, list[str]] = {}
    numbers = count(1)
    for indices in by_motion.values():
        names = [components[index] for index in indices]
        channels = ["HNZ" if is_vertical(name) else "HN1" for name in names]
        horizontal = [name for name in names if not is_vertical(name)]
        # With a horizontal pair, all components are channels of the same station.
        common_number = 0
        if channels.count("HNZ") < 2 and len(horizontal) == 2 and at_right_angles(*horizontal):
            common_number = next(numbers)
            first, second = map(azimuth, horizontal)
            axes = ["HNN", "HNE"] if {first, second} == {0.0, 90.0} else ["HNX", "HNY"]
            # The second axis is clockwise from the first.
            is_clockwise = ((second or 0.0) - (first or 0.0)) % 360.0 <= 180.0
            pair = iter(axes if is_clockwise else axes[::-1])
            channels = [next(pair) if channel == "HN1" else channel for channel in channels]
        for index, channel in zip(indices, channels, strict=True):
            codes[index] = ["", f"R{common_number or next(numbers):02d}", "", channel]
    return [codes[index] for index in range(len(records))]


def cumulative_energy(record: Record) -> Array:
    """Return the integral of the squared acceleration from the first sample to each sample,
    m^2/s^3, shape (samples,). It is exact for an acceleration that is linear between samples."""
    energy = np.zeros(record.acceleration.size)
    for block, a, b in _intervals(record):
        _accumulate(energy, block, record.dt / 3.0 * (a * a + a * b + b * b))
    return energy


_MAX_OMITTED_ENERGY = 0.05
"""Fraction of the Arias intensity that an analysis may omit without a warning; it is the fraction
after the end of the significant duration D5-95."""

_MAX_LISTED_RECORDS = 5  # maximum number of records listed in a message

_ARIAS_FACTOR = math.pi / (2.0 * STANDARD_GRAVITY)
"""Ratio of the Arias intensity to the integral of the squared acceleration, s^2/m."""


def arias_intensity(record: Record) -> float:
    """Return the Arias intensity (Arias 1970), m/s: pi / (2 g) times the integral of the squared
    acceleration."""
    return _ARIAS_FACTOR * float(cumulative_energy(record)[-1])


def cut_off(records: Iterable[Record], end: float) -> list[str]:
    """Return a warning if an analysis ends before the strong part of a ground motion does.

    The criterion is that more than 5 % of the Arias intensity of a record follows the end of the
    analysis. This happens if the duration in a model file was selected for another record.

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
            if omitted > _MAX_OMITTED_ENERGY * energy[-1]:
                omitted_parts.append(f"{record.name} {100.0 * omitted / energy[-1]:.2g} %")
    warning = (
        f"the analysis ends at {end:.6g} s and omits a part of the Arias intensity: "
        f"{abbreviate(omitted_parts, _MAX_LISTED_RECORDS)}; increase the duration"
    )
    return [warning] if omitted_parts else []


def time_of_energy(record: Record, energy: Array, fraction: float) -> float:
    """Return the time from the first sample when the integral of the squared acceleration
    reaches a fraction of its final value.

    Within a sampling interval, the integral is a non-decreasing cubic function of time. The time is
    therefore computed by bisection.

    Parameters
    ----------
    energy : ndarray, shape (samples,)
        Result of `cumulative_energy`.
    fraction : float
        Fraction of the final value, greater than 0 and at most 1.

    Returns
    -------
    float
        Time, s; nan if the final value is zero or infinite.
    """
    target = fraction * float(energy[-1])
    if not 0.0 < target < math.inf:
        return math.nan
    # The target is reached in the interval from sample i to sample i + 1, where the acceleration
    # changes linearly from a to b.
    i = int(np.searchsorted(energy, target)) - 1
    a, b = record.acceleration[i : i + 2].tolist()
    remaining_energy = (target - float(energy[i])) / record.dt

    def is_before_target(x: float) -> bool:
        """Return True if the integral over the first part `x` of the interval (0 to 1) is less than
        the remaining energy, both divided by the length of the interval."""
        integral: float = x * (a * a + a * (b - a) * x + (b - a) ** 2 * x * x / 3.0)
        return integral < remaining_energy

    _, fraction_of_interval = bisect_interval(is_before_target, 0.0, 1.0, _MAX_BISECTIONS)
    return (i + fraction_of_interval) * record.dt


def cumulative_absolute_velocity(record: Record) -> float:
    """Return the cumulative absolute velocity, m/s: the integral of the absolute acceleration."""

    def area(a: Array, b: Array) -> float:
        """Return the area below the absolute acceleration, without the common factor dt / 2."""
        total = np.abs(a) + np.abs(b)
        changes_sign = a * b < 0.0
        # If the acceleration changes its sign in an interval, the area is two triangles, otherwise
        # a trapezoid.
        denominator = np.where(changes_sign, total, 1.0)
        return float(np.sum(np.where(changes_sign, (a * a + b * b) / denominator, total)))

    return 0.5 * record.dt * sum(area(a, b) for _, a, b in _intervals(record))


def cumulative_absolute_velocity_above(record: Record, threshold: float) -> float:
    """Return the integral over time of the absolute acceleration, while it is at least a threshold.

    Returns
    -------
    float
        Integral, m/s.
    """

    def integral_from_zero(value: Array) -> Array:
        """Return the integral of |x| over the accelerations x from 0 to `value` that reach the
        threshold, m^2/s^4."""
        size = np.abs(value)
        return np.copysign(np.maximum(0.5 * (size - threshold) * (size + threshold), 0.0), value)

    def sum_of_means(a: Array, b: Array) -> float:
        """Return the sum of the mean counted absolute accelerations of sampling intervals."""
        low, high = np.minimum(a, b), np.maximum(a, b)
        # The value 1 avoids a division by zero in intervals with a constant acceleration.
        change = np.where(high > low, high - low, 1.0)
        # An interval is counted completely if both samples reach the threshold with the same sign.
        # In the other intervals, the integral over time is an integral over acceleration, because
        # the acceleration is linear in time.
        is_counted = (np.minimum(np.abs(a), np.abs(b)) >= threshold) & (a * b > 0.0)
        means = np.where(
            is_counted,
            0.5 * (np.abs(a) + np.abs(b)),
            (integral_from_zero(high) - integral_from_zero(low)) / change,
        )
        return float(np.sum(means))

    return record.dt * sum(sum_of_means(a, b) for _, a, b in _intervals(record))


def significant_duration(record: Record, fraction: float) -> float:
    """Return the time, s, from 5 % of the Arias intensity to the fraction `fraction` of the
    intensity, such as 0.95 (Trifunac and Brady 1975); nan if all samples are zero."""
    return _significant_duration(record, cumulative_energy(record), fraction)


def _significant_duration(record: Record, energy: Array, fraction: float) -> float:
    """Return the result of `significant_duration` from that of `cumulative_energy`."""
    return time_of_energy(record, energy, fraction) - time_of_energy(record, energy, 0.05)


def a95(record: Record) -> float:
    """Return A95, the acceleration level below which 95 % of the Arias intensity is contained
    (Sarma and Yang 1987).

    Returns
    -------
    float
        Level, m/s^2; 0 if all samples are zero.
    """
    peak = record.pga
    if not 0.0 < peak < math.inf:
        return 0.0 if peak == 0.0 else math.nan

    def energies_below(level: float, a: Array, b: Array) -> Array:
        """Return the integrals of the squared accelerations with absolute values up to `level` in
        sampling intervals, up to a constant factor. Accelerations and level are fractions of the
        peak."""
        low, high = np.clip(a, -level, level), np.clip(b, -level, level)
        # This is the fraction of an interval where the acceleration is below the level. It is 0
        # or 1 if the acceleration is constant.
        change = np.where(a == b, 1.0, b - a)
        time_fraction = np.where(a == b, np.abs(a) <= level, (high - low) / change)
        return time_fraction * (low * low + low * high + high * high)

    blocks = [(a / peak, b / peak) for _, a, b in _intervals(record)]
    target = _A95 * sum(float(np.sum(energies_below(1.0, a, b))) for a, b in blocks)
    # The energy of the intervals that no longer depend on the level, because they are below it.
    complete = 0.0

    def is_too_low(level: float) -> bool:
        """Return True if the energy below a level is less than the target, and omit the intervals
        that are above or below all later levels."""
        nonlocal complete
        energies = [energies_below(level, a, b) for a, b in blocks]
        is_less = complete + sum(float(np.sum(block)) for block in energies) < target
        for i, (a, b) in enumerate(blocks):
            if is_less:
                remain = np.maximum(np.abs(a), np.abs(b)) > level
                complete += float(np.sum(energies[i][~remain]))
            else:
                remain = (np.minimum(a, b) < level) & (np.maximum(a, b) > -level)
            blocks[i] = a[remain], b[remain]
        return is_less

    # The energy below a level does not decrease with the level, so that bisection is possible.
    _, level = bisect_interval(is_too_low, 0.0, 1.0, _MAX_BISECTIONS)
    return peak * level


def bracketed_duration(record: Record, threshold: float) -> float:
    """Return the time from the first to the last crossing of a threshold by the absolute
    acceleration (Bolt 1969).

    Parameters
    ----------
    threshold : float
        Acceleration threshold, m/s^2, positive.

    Returns
    -------
    float
        Bracketed duration, s; 0 if the threshold is not reached.
    """
    size = np.abs(record.acceleration)
    reached = np.flatnonzero(size >= threshold)
    if not reached.size:
        return 0.0

    def crossing(outside: int, inside: int) -> float:
        """Return the time, in sampling intervals, when the acceleration crosses the threshold.

        The acceleration is linear between two neighboring samples: `outside` is the index of the
        sample below the threshold, `inside` that of the sample at or above the threshold.
        """
        # If the record starts or ends above the threshold, its first or last sample is used instead
        # of a crossing.
        if not 0 <= outside < size.size:
            return float(inside)
        # The signs are changed so that the inner sample is positive.
        sign = math.copysign(1.0, float(record.acceleration[inside]))
        value_inside = sign * float(record.acceleration[inside])
        value_outside = sign * float(record.acceleration[outside])
        fraction = (threshold - value_outside) / (value_inside - value_outside)
        return outside + (inside - outside) * fraction

    first, last = int(reached[0]), int(reached[-1])
    return record.dt * (crossing(last + 1, last) - crossing(first - 1, first))


def mean_period(record: Record) -> float:
    """Return the mean period of the Fourier spectrum (Rathje, Abrahamson and Bray 1998).

    It is the mean of the periods at frequencies from 0.25 to 20 Hz, weighted by the squared Fourier
    amplitudes.

    Returns
    -------
    float
        Mean period, s; nan if no frequency of the transform is in the band, if all amplitudes in
        the band are zero, if the sampling interval is longer than 2 s, or if the Fourier transform
        would require too many samples.
    """
    low, high = _MEAN_PERIOD_BAND
    # Zeros are added to a short record, so that the frequency interval is at most 0.05 Hz.
    min_samples = 1.0 / (_MEAN_PERIOD_STEP * record.dt)
    is_below_nyquist = 2.0 * low * record.dt <= 1.0
    if not is_below_nyquist or min_samples > _MAX_FOURIER_SAMPLES:
        return math.nan
    count = max(record.acceleration.size, math.ceil(min_samples * (1.0 - _ROUNDING)))
    frequencies = np.fft.rfftfreq(count, record.dt)
    band = (frequencies >= low * (1.0 - _ROUNDING)) & (frequencies <= high * (1.0 + _ROUNDING))
    # Division by the peak prevents overflow of the squares.
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
    power : float | None
        Exponent of the scale factor of the ground motion in the measure; 0 if the measure does not
        depend on the factor. None if the dependence is not a power; the measure is then recomputed.
    column : str
        Name in tables if it differs from `name`.
    symbol : str
        Name in figures and reports if it differs from `name`.
    """

    name: str
    unit: str
    meaning: str
    value: Callable[[Record], float]
    power: float | None = 1.0
    column: str = ""
    symbol: str = ""

    def of(self, record: Record) -> float:
        """Return the intensity measure of a record, in `unit`; infinite or nan if it exceeds the
        range of floats.

        Parameters
        ----------
        record : Record
            Ground motion.
        """
        with _without_warnings():
            return float(self.value(record))

    @property
    def head(self) -> str:
        """Name of the table column, without the unit."""
        return self.column or self.name.replace("-", "_")

    @property
    def without_levels(self) -> str:
        """Reason why no scale factor can be computed for a requested value of the measure; empty if
        a factor can be computed."""
        if self.power is None:
            return "its value is not proportional to a power of the scale factor"
        subject = "a duration" if self.unit == "s" else "it"
        return "" if self.power else f"{subject} does not change with a factor"


_FUNCTIONS: dict[str, Callable[[Record], float]] = {
    "pga": lambda record: record.pga,
    "pgv": lambda record: _peak(record, 0, "pgv"),
    "pgd": lambda record: _peak(record, 1, "pgd"),
    "arias": arias_intensity,
    "cav": cumulative_absolute_velocity,
    "cav5": lambda record: cumulative_absolute_velocity_above(record, CAV5),
    "d5-75": partial(significant_duration, fraction=0.75),
    "d5-95": partial(significant_duration, fraction=0.95),
}
MEASURES = {
    row["name"]: Measure(
        row["name"],
        row["unit"],
        row["meaning"],
        _FUNCTIONS[row["name"]],
        float(row["power"]) if row["power"] else None,
        row["column"],
        row["symbol"],
    )
    for row in declared_rows(__file__)
}
"""Intensity measures of ground motions by name: the measures of tdint, then the measures of
plug-ins (`tdint.load_plugin`)."""

BUILTIN_MEASURES = tuple(MEASURES)
"""Names of the measures of tdint, which are attributes of `Measures`; plug-ins add measures to
`MEASURES` later."""


def _peak(record: Record, column: int, name: str) -> float:
    """Return the peak velocity or displacement of the ground: the value stored in the record file
    if it has one, otherwise the peak of the integrated acceleration.

    `column` is the index of the peak in `record.peaks`: 0 for the velocity, 1 for the displacement.
    """
    motion = integrate(record)
    peak = _stored_peaks(record, motion)[column]
    return float(getattr(motion, name)) if peak is None else peak


def spectrum_intensity(periods: Array, psv: Array) -> float:
    """Return the spectrum intensity of Housner, m: the integral of the pseudo-velocity over the
    period by the trapezoidal rule.

    Parameters
    ----------
    periods : ndarray, shape (k,)
        Periods in increasing order, s.
    """
    return float(np.sum(0.5 * np.diff(periods) * (psv[:-1] + psv[1:])))


def zeros_at_ends(samples: Array) -> tuple[int, int]:
    """Return the number of zeros at the start and the number of zeros at the end of the samples,
    shape (samples,). If all samples are zero, all are counted at the start."""
    nonzero = np.flatnonzero(samples)
    if not nonzero.size:
        return samples.size, 0
    return int(nonzero[0]), samples.size - 1 - int(nonzero[-1])


def baseline_notes(record: Record) -> tuple[str, ...]:
    """Return notes if the start of a motion may be missing, or if its baseline may drift.

    These are the notes of `measure` about a large first sample, and about a velocity or a
    displacement that ends far from zero.
    """
    with _without_warnings():
        return tuple(map(str, _doubts(record, integrate(record))))


def baseline_notes_of_suite(records: Iterable[Record]) -> list[str]:
    """Return the notes of `baseline_notes` for a suite, with a single note for each property that
    names the first records with this property.
    """
    doubts_by_subject: dict[str, list[tuple[Record, _Doubt]]] = {}
    for record in records:
        with _without_warnings():
            doubts = _doubts(record, integrate(record))
        for doubt in doubts:
            doubts_by_subject.setdefault(doubt.subject, []).append((record, doubt))
    notes = []
    for subject, members in doubts_by_subject.items():
        first_record, first = members[0]
        listed = [
            f"{record.name} ({doubt.value}, {100.0 * doubt.share:.0f} %)"
            for record, doubt in members
        ]
        notes.append(
            f"{first_record.name}: {first}"
            if len(members) == 1
            else f"{subject} is a large part of {first.reference}: "
            f"{abbreviate(listed, _MAX_LISTED_RECORDS)}; {first.remedy}"
        )
    return notes


class _Doubt(NamedTuple):
    """Property that a complete and corrected ground motion does not have.

    `share` is the fraction of `reference` that `value`, with its unit, amounts to.
    """

    subject: str
    value: str
    share: float
    reference: str
    remedy: str

    def __str__(self) -> str:
        """Return the note about one record."""
        share = f"{100.0 * self.share:.0f} % of {self.reference}"
        return f"{self.subject} is {self.value}, {share}; {self.remedy}"


def _doubts(record: Record, motion: Motion) -> list[_Doubt]:
    """Return the properties of a record that indicate a missing start or a baseline drift; `motion`
    is the velocity and displacement of the same ground motion."""
    first_sample = float(record.acceleration[0])
    final_velocity = float(motion.velocity[-1])
    final_displacement = float(motion.displacement[-1])
    doubts = []
    if abs(first_sample) > _MAX_FIRST_SAMPLE * record.pga:
        doubts.append(
            _Doubt(
                "the first sample",
                f"{first_sample:.3g} m/s^2",
                abs(first_sample) / record.pga,
                "the peak",
                "check whether the start of the motion is missing",
            )
        )
    # A baseline drift is visible in the velocity first. The displacement is checked only if the
    # velocity is not suspicious.
    if abs(final_velocity) > _MAX_FINAL_VELOCITY * motion.pgv:
        doubts.append(
            _Doubt(
                "the velocity at the end",
                f"{final_velocity:.3g} m/s",
                abs(final_velocity) / motion.pgv,
                "its peak",
                "check for baseline drift",
            )
        )
    elif (
        abs(final_displacement) > _MAX_FINAL_DISPLACEMENT * motion.pgd
        and _stored_peaks(record, motion)[1] is None
    ):
        doubts.append(
            _Doubt(
                "the displacement at the end",
                f"{abs(final_displacement):.3g} m",
                abs(final_displacement) / motion.pgd,
                "its peak",
                "check for baseline drift or permanent displacement",
            )
        )
    return doubts
