"""Processing steps for a record, applied only on request (`tdint.ground_motion.choice.Processing`);
each step is reported in the notes of the record."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from functools import lru_cache
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.choice import DEFAULT_FILTER_ORDER, Processing, parse_pad, parse_trim
from tdint.ground_motion.record import Record

# ---- Interpolation of a ground motion between its samples: linear or band-limited
#
# The response of an oscillator is computed for a piecewise linear ground motion. The band-limited
# motion has no frequency above half the sampling rate (Shannon 1949) and is zero at the samples
# before and after the record. It is represented by points that are close enough for linear
# interpolation. Linear interpolation between points at an interval h multiplies the amplitude of a
# frequency f by sinc(f h)^2. The points are therefore divided by this factor, so that the piecewise
# linear motion is correct up to half the sampling rate. The remaining error is its images around
# 1/h, 2/h, ...: their amplitudes are below 0.001, and their frequencies are far above the
# frequencies of the oscillators. The reference for the test is a windowed sum of sines up to 0.8 of
# half the sampling rate, with a response in closed form: all maxima agree to 1e-5 for T >= dt / 2,
# and most maxima agree to 1e-6 (tests/response/spectra/test_band_limited.py).
#
# The sampling interval of such a motion is changed by sinc interpolation with a Kaiser window. If
# the new interval is longer, the sinc is stretched to remove frequencies above the new Nyquist
# frequency (Crochiere and Rabiner, 1983; Kaiser 1974 for the window).

_POINTS = 16
"""Points per sampling interval, and per period of the stiffest oscillator."""


class Interpolation(NamedTuple):
    """Interpolation of a ground motion between the samples of a record.

    Attributes
    ----------
    name : str
        Name on the command line and in tables.
    resample : callable
        Function of a record and the shortest period (s) of the oscillators; returns samples (m/s^2,
        shape (points,)) for linear interpolation and their interval (s).
    peak : callable
        Function of a record; returns the peak ground acceleration (m/s^2).
    description : str
        Description of the motion between the samples, for use in a sentence.
    """

    name: str
    resample: Callable[[Record, float], tuple[Array, float]]
    peak: Callable[[Record], float]
    description: str


def _samples_of_record(record: Record, shortest_period: float) -> tuple[Array, float]:
    """Return the samples (m/s^2, shape (samples,), read-only) and the sampling interval (s) of
    a record. This is `Interpolation.resample` for linear interpolation; the shortest period of the
    oscillators has no effect."""
    return record.acceleration, record.dt


def _band_limited_points(record: Record, shortest_period: float) -> tuple[Array, float]:
    """Return accelerations (m/s^2) of the band-limited motion of a record at points for linear
    interpolation, and the interval of the points, s: at most 1/16 of the shortest period of the
    oscillators.
    """
    part_count = _POINTS * math.ceil(max(1.0, record.dt / shortest_period))
    return band_limited(record.acceleration, part_count, for_lines=True), record.dt / part_count


def _band_limited_peak(record: Record) -> float:
    """Return the peak ground acceleration of the band-limited motion of a record, m/s^2.

    It is the maximum absolute value of the parabolas through each three successive points.
    """
    points = band_limited(record.acceleration, _POINTS)
    before, middle, after = points[:-2], points[1:-1], points[2:]
    # The parabola is middle + slope x + bend x^2 / 2, where x is -1, 0 and 1 at the three points.
    slope, bend = 0.5 * (after - before), after - 2.0 * middle + before
    has_vertex = np.abs(slope) < np.abs(bend)  # the vertex at x = -slope / bend is between them
    vertices = middle[has_vertex] - 0.5 * slope[has_vertex] ** 2 / bend[has_vertex]
    return float(max(np.max(np.abs(points)), np.max(np.abs(vertices), initial=0.0)))


def band_limited(samples: Array, parts: int, *, for_lines: bool = False) -> Array:
    """Return the band-limited motion at the samples and at `parts` - 1 points in each interval.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples of the motion, which is zero at all samples before and after them.
    for_lines : bool
        Compensate the attenuation of linear interpolation between the points. Default False.

    Returns
    -------
    ndarray, shape ((n - 1) parts + 1,)
        Motion from the first to the last sample, in the unit of the samples.
    """
    from scipy.fft import next_fast_len

    # The Fourier transform is periodic. Zeros for at least the duration of the record separate its
    # end from the next period.
    size = 2 * next_fast_len(samples.size, real=True)  # even, with no prime factors above 5
    spectrum = np.fft.rfft(samples, size)
    # At the highest frequency, the spectrum contains the sum of a positive and a negative
    # frequency. They are separate in the longer transform below, which adds the negative frequency.
    spectrum[-1] *= 0.5
    if for_lines:
        # Linear interpolation multiplies the amplitude by sinc(f h)^2, where f is the frequency
        # and h the interval of the points; f h is index / (size parts).
        spectrum /= np.sinc(np.arange(spectrum.size) / (size * parts)) ** 2
    return parts * np.fft.irfft(spectrum, size * parts)[: (samples.size - 1) * parts + 1]


LINEAR = Interpolation("linear", _samples_of_record, attrgetter("pga"), "straight lines")
BAND_LIMITED = Interpolation(
    "band-limited",
    _band_limited_points,
    _band_limited_peak,
    "free of frequencies above half its sampling rate",
)
INTERPOLATIONS = {interpolation.name: interpolation for interpolation in (LINEAR, BAND_LIMITED)}


MOST_SAMPLES = 50_000_000  # samples; maximum size of a processed record
_ATTENUATION = 100.0
"""Attenuation of the stop band, dB."""

_TRANSITION = 0.2
"""Width of the transition band, as a fraction of the lower of the two Nyquist frequencies."""

_BETA = 0.1102 * (_ATTENUATION - 8.7)  # shape parameter of the Kaiser window
_AT_ONCE = 2**20  # numbers; maximum size of the weights computed together, 8 MB


def resampled(samples: Array, dt: float, new: float) -> tuple[Array, float]:
    """Return the samples of the band-limited motion at another interval.

    Parameters
    ----------
    new : float
        New sampling interval, s, at most (n - 1) dt.

    Returns
    -------
    samples : ndarray, shape (m,)
        New samples, from the first old sample up to the last. If the new interval is shorter, the
        values at the times of old samples do not change.
    band : float
        Frequency, Hz; up to this frequency, amplitudes are kept with an error of 2e-5.
    """
    stretch = max(1.0, new / dt)
    # The transition band then ends at the new Nyquist frequency, which is 1 here.
    cutoff = 1.0 - 0.5 * _TRANSITION if new > dt else 1.0
    # Half the number of weights, by the formula of Kaiser (1974): (A - 7.95) / (2.285 w), where A
    # is the attenuation in dB and w the width of the transition band in radians per sample.
    half = math.ceil(stretch * (_ATTENUATION - 7.95) / (2.0 * 2.285 * math.pi * _TRANSITION))
    # The two small numbers keep a last sample that rounding would otherwise remove.
    count = math.floor((samples.size - 1) * dt / new * (1.0 + 1e-12) + 1e-9) + 1
    padded = np.pad(samples, half)
    # A new sample is a weighted sum of the old samples with these indices relative to the last old
    # sample before the new sample.
    taps = np.arange(1 - half, half + 1)
    result = np.empty(count)
    rows = max(1, _AT_ONCE // taps.size)
    for start in range(0, count, rows):
        times = np.arange(start, min(start + rows, count)) * (new / dt)
        # Each new sample is at or after the old sample with this index.
        indices = np.minimum(np.floor(times).astype(np.int64), samples.size - 1)
        distance = (times - indices)[:, None] - taps
        weights = np.sinc(cutoff / stretch * distance) * np.i0(
            _BETA * np.sqrt(np.maximum(0.0, 1.0 - (distance / half) ** 2))
        )
        weights /= weights.sum(axis=1, keepdims=True)
        result[start : start + rows] = np.sum(
            weights * padded[indices[:, None] + taps + half], axis=1
        )
    return result, 0.5 / (dt * stretch) * (cutoff - 0.5 * _TRANSITION)


# ---- Processing steps

_NARROWEST = 1e-5
"""Minimum distance of a corner frequency from zero and from the Nyquist frequency, divided by the
sampling rate. Below it, rounding errors and the settling time of the filter become too large."""

_SETTLED = 1e-13  # relative amplitude of the filter transient after the settling time
# Relative amplitude of the transients at the start and end of the padding. The peaks of the
# velocity and of the displacement then differ by less than 1e-4 from the peaks of a record between
# long zeros; with 1e-4, the displacement differs by up to 1e-3 (orders 2 to 8, corners 0.05 to 0.5
# Hz). For order 4, the padding has 4.8 periods of the corner frequency on either side.
_TAIL = 1e-5
_ROUNDING = 1e-6  # fraction of the sampling interval; times are written with at least six digits


def process(
    record: Record,
    *,
    trim: str | tuple[float | None, float | None] | None = None,
    baseline: str | None = None,
    pad: str | float | tuple[float, float] | None = None,
    highpass: float | None = None,
    lowpass: float | None = None,
    filter_order: int | None = None,
    resample: float | None = None,
    time_scale: float | None = None,
) -> Record:
    """Apply the requested processing steps to a record.

    The steps are applied in the order of the parameters below.

    Parameters
    ----------
    record : Record
        Record to process; it is not changed.
    trim, baseline, pad, highpass, lowpass, filter_order, resample, time_scale
        Same as in `Processing`, or the texts of a model file, such as `trim="2:30"`. A single
        number for `pad` applies to the start and the end.

    Returns
    -------
    Record
        Processed record; its `notes` and `processing` report the steps.

    Raises
    ------
    UsageError
        A value is invalid for any record, or `record` is not a Record.
    RecordError
        A step cannot be applied to this record: a trim outside the record, or a corner frequency
        above its Nyquist frequency.
    """
    if not isinstance(record, Record):
        raise UsageError(
            f"process requires a Record, as returned by read_record, got {record!r:.60}"
        )
    steps = Processing(
        parse_trim(trim) if isinstance(trim, str) else trim,
        baseline,
        parse_pad(str(pad)) if isinstance(pad, str | int | float) else pad,
        highpass,
        lowpass,
        filter_order,
        resample,
        time_scale,
    )
    return processed(record, steps)


def processed(record: Record, steps: Processing) -> Record:
    """Return a record after the requested processing steps; without steps, the same object.

    Raises
    ------
    RecordError
        A step cannot be applied to the record.
    """
    if steps.trim is not None:
        record = trim(record, *steps.trim)
    if steps.baseline is not None:
        record = remove_baseline(record, steps.baseline)
    if steps.pad is not None:
        record = pad(record, *steps.pad)
    corners = {"highpass": steps.highpass, "lowpass": steps.lowpass}
    requested = {name: corner for name, corner in corners.items() if corner is not None}
    if requested:
        order = steps.filter_order or DEFAULT_FILTER_ORDER
        record = butterworth(record, requested, order, pads=steps.pad is None)
    if steps.resample is not None:
        record = resample(record, steps.resample)
    if steps.time_scale is not None:
        dt = record.dt * steps.time_scale
        note = f"times multiplied by {steps.time_scale:g}: the sampling interval is {dt:.6g} s"
        record = _replace_samples(record, record.acceleration, note, dt=dt)
    return record


def _label(record: Record) -> str:
    """Return source and id of a record for error messages."""
    return f"{record.source}: {record.id}" if record.id.strip(".") else record.source


def _replace_samples(
    record: Record, samples: Array, note: str, *, dt: float | None = None, later: float = 0.0
) -> Record:
    """Return a record with the samples that result from a processing step.

    The step is added to the notes and to the processing steps of the record. The peak velocity and
    displacement in the file are removed, because they belong to the unprocessed record. The start
    time changes by `later`, s.
    """
    start = record.start
    if start and later:
        try:
            start = (datetime.fromisoformat(start) + timedelta(seconds=later)).strftime(
                "%Y-%m-%dT%H:%M:%S.%fZ"
            )
        except (ValueError, OverflowError):  # the date is outside the range of datetime
            start = ""
    return replace(
        record,
        acceleration=samples,
        dt=dt or record.dt,
        start=start,
        notes=(*record.notes, note),
        processing=(*record.processing, note),
        peaks=(None, None),
    )


def trim(record: Record, start: float | None, end: float | None) -> Record:
    """Return the part of a record from `start` to `end`.

    Parameters
    ----------
    start, end : float | None
        Times from the first sample, s. `Processing` has checked that `start` is not negative.
        Samples at these times are included. None means the first sample for `start` and the last
        sample for `end`.

    Raises
    ------
    RecordError
        The part ends after the record, starts at or after its end, or has fewer than two samples.
    """
    start = start or 0.0
    end = record.duration if end is None else end
    if end > record.duration + _ROUNDING * record.dt or start >= record.duration:
        raise RecordError(
            f"{_label(record)}: trim must be within the record, which ends at "
            f"{record.duration:.6g} s, got {start:g}:{end:g} s"
        )
    # Bounds between samples are moved inwards, so that no samples are added.
    first = math.ceil(start / record.dt - _ROUNDING)
    last = math.floor(end / record.dt + _ROUNDING)
    if last <= first:
        raise RecordError(
            f"{_label(record)}: trim must keep at least two samples at the interval of "
            f"{record.dt:g} s, got {start:g}:{end:g} s"
        )
    note = f"trimmed to the part from {first * record.dt:.6g} to {last * record.dt:.6g} s"
    return _replace_samples(
        record, record.acceleration[first : last + 1], note, later=first * record.dt
    )


def remove_baseline(record: Record, shape: str) -> Record:
    """Return the record without its mean (`constant`), its least-squares line (`linear`) or its
    least-squares parabola (`quadratic`)."""
    samples = record.acceleration
    mean = float(np.mean(samples))
    if shape == "constant":
        note = f"the mean of {mean:.4g} m/s^2 is removed"
        return _replace_samples(record, samples - mean, note)
    # The time is normalized: it is -1 at the first and 1 at the last sample, and its mean is zero.
    time = np.linspace(-1.0, 1.0, samples.size)
    slope = float(np.dot(time, samples) / np.dot(time, time))
    line = mean + slope * time
    if shape == "linear":
        note = f"a line from {mean - slope:.4g} to {mean + slope:.4g} m/s^2 is removed"
        return _replace_samples(record, samples - line, note)
    # The quadratic term without its mean is orthogonal to the line at equidistant samples. It is
    # zero for two samples.
    time_squared = time * time
    bend = time_squared - float(np.mean(time_squared))
    bend_norm = float(np.dot(bend, bend))
    parabola = line + (float(np.dot(bend, samples)) / bend_norm if samples.size > 2 else 0.0) * bend
    first, middle, last = (parabola[i] for i in (0, samples.size // 2, -1))
    note = f"a parabola through {first:.4g}, {middle:.4g} and {last:.4g} m/s^2 is removed"
    return _replace_samples(record, samples - parabola, note)


def pad(record: Record, *seconds: float) -> Record:
    """Return a record with zeros added before and after it.

    Parameters
    ----------
    *seconds : float
        Two durations, s: before and after the record. They are rounded up to whole samples.

    Raises
    ------
    RecordError
        More than `MOST_SAMPLES` zeros would be added.
    """
    # The limit of 1e18 samples prevents an overflow of the quotient; it is far above MOST_SAMPLES.
    before, after = (math.ceil(min(duration / record.dt, 1e18) - _ROUNDING) for duration in seconds)
    if before + after > MOST_SAMPLES:
        raise RecordError(
            f"{_label(record)}: pad must add at most {MOST_SAMPLES} samples, got "
            f"{before + after}; reduce the duration"
        )
    note = (
        f"padded with zeros, {before * record.dt:.6g} s before and {after * record.dt:.6g} s after"
    )
    return _replace_samples(
        record, np.pad(record.acceleration, (before, after)), note, later=-before * record.dt
    )


def butterworth(
    record: Record, corners: Mapping[str, float], order: int, *, pads: bool = True
) -> Record:
    """Apply zero-phase Butterworth filters to a record, which is zero outside its samples.

    The filters are applied together, forwards and, from the time when they have settled after the
    end of the record, backwards. Both passes spread the motion outside the record: without the
    tails, the filtered motion has the drift that the filter should remove (Boore 2005, doi
    10.1785/0120040160).

    Parameters
    ----------
    corners : mapping of str to float
        Corner frequencies, Hz, of the filters `highpass` and `lowpass`.
    pads : bool
        Add zeros before and after the record until the transients have decayed to `_TAIL`. False
        keeps the ends of the record. Default True.

    Raises
    ------
    RecordError
        A corner frequency cannot be represented at the sampling interval of the record, or the
        padded record would exceed the maximum length.
    """
    label = _label(record)
    if pads:
        _, settling = _design_filters(corners, order, record.dt, label)
        # The transients decay exponentially, to `_SETTLED` within the settling time.
        duration = settling * record.dt * math.log(_TAIL) / math.log(_SETTLED)
        record = pad(record, duration, duration)
    samples = zero_phase(record.acceleration, record.dt, corners, order, label)
    names = ", ".join(f"{name} {corner:g} Hz" for name, corner in corners.items())
    filters = "filter" if len(corners) == 1 else "filters"
    note = f"{names}: Butterworth {filters} of order {order}, forwards and backwards"
    return _replace_samples(record, samples, note)


def zero_phase(
    samples: Array,
    dt: float,
    corners: Mapping[str, float],
    order: int,
    label: str,
    *,
    held: bool = False,
) -> Array:
    """Apply Butterworth filters to samples, forwards and then backwards, so that no phase shift
    remains. The motion before the first sample is zero.

    Parameters
    ----------
    samples : ndarray
        Samples along the first axis.
    corners : mapping of str to float
        Corner frequencies, Hz, of the filters `highpass` and `lowpass`.
    held : bool
        Continue with the last value after the end instead of zeros. Default False.

    Raises
    ------
    RecordError
        A corner frequency cannot be represented at this sampling interval.
    """
    from scipy.signal import sosfilt  # imported late: needs 0.8 s

    sections, settling = _design_filters(corners, order, dt, label)
    # The backward pass starts after the settling time. Only the first axis, which is the time, is
    # extended.
    after = [(0, settling), *[(0, 0)] * (samples.ndim - 1)]
    forwards = sosfilt(
        sections, np.pad(samples, after, mode="edge" if held else "constant"), axis=0
    )
    return np.asarray(sosfilt(sections, forwards[::-1], axis=0)[::-1][: len(samples)])


def _design_filters(
    corners: Mapping[str, float], order: int, dt: float, label: str
) -> tuple[Array, int]:
    """Return the second-order sections of successive filters and their longest settling time, in
    samples (`_design_filter`); RecordError if a corner frequency cannot be represented.
    """
    for filter_type, corner in corners.items():
        if not corner * dt < 0.5 - _NARROWEST:
            raise RecordError(
                f"{label}: {filter_type} must be below the Nyquist frequency of {0.5 / dt:.6g} Hz, "
                f"got {corner:g} Hz"
            )
        if corner * dt < _NARROWEST:
            raise RecordError(
                f"{label}: {filter_type} must be at least {_NARROWEST / dt:.3g} Hz for a sampling "
                f"interval of {dt:g} s, got {corner:g} Hz"
            )
    designs = [_design_filter(*item, order, dt) for item in corners.items()]
    return np.concatenate([sections for sections, _ in designs]), max(
        settling for _, settling in designs
    )


@lru_cache(maxsize=64)  # a fit applies the same two filters a thousand times
def _design_filter(filter_type: str, corner: float, order: int, dt: float) -> tuple[Array, int]:
    """Return the coefficients of the second-order sections of a Butterworth filter for
    `scipy.signal.sosfilt`, and the number of samples after which the transient has decayed to the
    fraction `_SETTLED`.
    """
    from scipy.signal import butter, zpk2sos

    zeros, poles, gain = butter(order, corner, filter_type, fs=1.0 / dt, output="zpk")
    # After n samples, the transient has the amplitude |p|^n, where p is the pole of largest
    # absolute value.
    settling = math.ceil(math.log(_SETTLED) / math.log(float(np.max(np.abs(poles)))))
    return zpk2sos(zeros, poles, gain), settling


def resample(record: Record, dt: float) -> Record:
    """Return the band-limited motion of a record at another sampling interval.

    Parameters
    ----------
    record : Record
        Record to resample; it is returned unchanged if it already has the interval.

    Raises
    ------
    RecordError
        The resampled record would have fewer than two or more than `MOST_SAMPLES` samples.
    """
    if math.isclose(dt, record.dt, rel_tol=1e-12):
        return record
    if record.duration / dt > MOST_SAMPLES:
        raise RecordError(
            f"{_label(record)}: the resampled record must have at most {MOST_SAMPLES} samples; an "
            f"interval of {dt:g} s is too short"
        )
    if dt > record.duration:
        raise RecordError(
            f"{_label(record)}: the resampled record must have at least two samples; an interval "
            f"of {dt:g} s is too long"
        )
    samples, band = resampled(record.acceleration, record.dt, dt)
    note = f"resampled from {record.dt:.6g} s to {dt:.6g} s, frequencies up to {band:.4g} Hz kept"
    return _replace_samples(record, samples, note, dt=dt)
