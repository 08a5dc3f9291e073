"""Changes to a record, made only when asked for (`tdint.ground_motion.processing`), each told in
its notes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import lru_cache
from operator import attrgetter

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.choice import CORNERS, Processing
from tdint.ground_motion.record import Record

# ---- A ground motion between its samples: straight lines, or the band-limited motion
#
# The response of an oscillator is computed for straight lines. The band-limited motion, which has
# no frequency above half the sampling rate (Shannon 1949) and is zero at the samples before and
# after the record, is therefore given by points so close that lines between them will do. Lines
# through the points of a motion weaken its frequency f by sinc(f h)^2, where h is the distance of
# the points; the points are raised by as much, so that up to half the sampling rate the lines hold
# the motion itself. What remains are its images around 1/h, 2/h, ...: weaker than a thousandth, far
# above the frequencies of the oscillators. Measured against a windowed sum of sines up to 0.8 of
# that rate, whose response is known in closed form: all largest values within 1e-5 from T = dt / 2
# on, most of them within 1e-6 (tests/analysis/spectra/test_band_limited.py).
#
# Another sampling interval for such a motion: interpolation by sinc functions under a Kaiser
# window. Where the new interval is longer, the sinc is stretched so that what lies above the new
# Nyquist frequency is gone (Crochiere and Rabiner, 1983; Kaiser 1974 for the window).

_POINTS = 16
"""Points per sampling interval, and per period of the stiffest oscillator."""


@dataclass(frozen=True)
class Interpolation:
    """A way to know the motion between the samples of a record.

    Attributes
    ----------
    name : str
        Its name on the command line and in tables.
    resample : callable
        Samples (m/s^2, shape (points,)) and their interval (s), between which straight lines stand
        for the motion, from the record and the shortest period (s) of the oscillators.
    peak : callable
        Peak ground acceleration (m/s^2) of a record.
    words : str
        What it makes of the motion between the samples, for a sentence.
    """

    name: str
    resample: Callable[[Record, float], tuple[Array, float]]
    peak: Callable[[Record], float]
    words: str


def _straight(record: Record, shortest: float) -> tuple[Array, float]:
    return record.acceleration.copy(), record.dt


def _band_limited(record: Record, shortest: float) -> tuple[Array, float]:
    parts = _POINTS * math.ceil(max(1.0, record.dt / shortest))
    return band_limited(record.acceleration, parts, for_lines=True), record.dt / parts


def _band_limited_peak(record: Record) -> float:
    """Largest value at the vertices of the parabolas through each three points."""
    points = band_limited(record.acceleration, _POINTS)
    before, here, after = points[:-2], points[1:-1], points[2:]
    slope, bend = 0.5 * (after - before), after - 2.0 * here + before
    inside = np.abs(slope) < np.abs(bend)
    vertices = here[inside] - 0.5 * slope[inside] ** 2 / bend[inside]
    return float(max(np.max(np.abs(points)), np.max(np.abs(vertices), initial=0.0)))


def band_limited(samples: Array, parts: int, *, for_lines: bool = False) -> Array:
    """The band-limited motion at the samples and at `parts` - 1 points between each two.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        The motion; it is zero at the samples before and after them.
    parts : int
        Parts of each interval.
    for_lines : bool
        Raise what straight lines between the points would weaken.

    Returns
    -------
    ndarray, shape ((n - 1) parts + 1,)
    """
    from scipy.fft import next_fast_len

    size = 2 * next_fast_len(samples.size, real=True)  # even, with no prime factors above 5
    spectrum = np.fft.rfft(samples, size)
    spectrum[-1] *= 0.5  # half the sampling rate, which now has a mirror of its own
    if for_lines:
        spectrum /= np.sinc(np.arange(spectrum.size) / (size * parts)) ** 2
    return parts * np.fft.irfft(spectrum, size * parts)[: (samples.size - 1) * parts + 1]


LINEAR = Interpolation("linear", _straight, attrgetter("pga"), "straight lines")
BAND_LIMITED = Interpolation(
    "band-limited",
    _band_limited,
    _band_limited_peak,
    "free of frequencies above half its sampling rate",
)
INTERPOLATIONS = {interpolation.name: interpolation for interpolation in (LINEAR, BAND_LIMITED)}


MOST_SAMPLES = 50_000_000
_ATTENUATION = 100.0
"""Of what is to go, dB."""

_TRANSITION = 0.2
"""Width of the band between what stays and what goes, over the lower one of the two Nyquist
frequencies."""

_BETA = 0.1102 * (_ATTENUATION - 8.7)
_AT_ONCE = 2**20  # numbers, 8 MB


def resampled(samples: Array, dt: float, new: float) -> tuple[Array, float]:
    """Samples at another interval, the first one at the same time.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        At the interval `dt`, s.
    new : float
        The new interval, s, at most (n - 1) dt.

    Returns
    -------
    samples : ndarray, shape (m,)
        As many as there are up to the last old sample. Old samples are kept where the new ones meet
        them, if the new interval is the shorter one.
    band : float
        Frequency, Hz, up to which amplitudes are kept to 2e-5.
    """
    # A longer interval stretches the sinc, so that what the new samples cannot hold is gone.
    stretch = max(1.0, new / dt)
    cutoff = 1.0 - 0.5 * _TRANSITION if new > dt else 1.0
    half = math.ceil(stretch * (_ATTENUATION - 7.95) / (2.0 * 2.285 * math.pi * _TRANSITION))
    count = math.floor((samples.size - 1) * dt / new * (1.0 + 1e-12) + 1e-9) + 1
    padded = np.pad(samples, half)
    taps = np.arange(1 - half, half + 1)
    result = np.empty(count)
    rows = max(1, _AT_ONCE // taps.size)
    for start in range(0, count, rows):
        times = np.arange(start, min(start + rows, count)) * (new / dt)
        places = np.minimum(np.floor(times).astype(np.int64), samples.size - 1)
        distance = (times - places)[:, None] - taps
        weights = np.sinc(cutoff / stretch * distance) * np.i0(
            _BETA * np.sqrt(np.maximum(0.0, 1.0 - (distance / half) ** 2))
        )
        weights /= weights.sum(axis=1, keepdims=True)
        result[start : start + rows] = np.sum(
            weights * padded[places[:, None] + taps + half], axis=1
        )
    return result, 0.5 / (dt * stretch) * (cutoff - 0.5 * _TRANSITION)


# ---- Processing steps

_NARROWEST = 1e-5
"""Least distance of a filter's corner from zero and from the Nyquist frequency, over the sampling
rate: closer, rounding and the time to settle get out of hand."""

_SETTLED = 1e-13  # what is left of the filter's own motion
_ROUNDING = 1e-6  # of a sample: times are written with six digits or more


def process(
    record: Record,
    *,
    trim: tuple[float | None, float | None] | None = None,
    baseline: str | None = None,
    pad: float | tuple[float, float] | None = None,
    highpass: float | None = None,
    lowpass: float | None = None,
    filter_order: int | None = None,
    resample: float | None = None,
) -> Record:
    """Change a record in the steps asked for, in this order whatever that of the arguments.

    Parameters
    ----------
    record : Record
        Left as it is.
    trim, baseline, pad, highpass, lowpass, filter_order, resample
        As in `Processing`; a single number for `pad` stands for both ends.

    Returns
    -------
    Record
        Its notes and its `processing` tell what was done.

    Raises
    ------
    UsageError
        Values that make no sense for any record; what is none.
    RecordError
        A step does not fit this record: a trim outside it, a corner above its Nyquist frequency.
    """
    if not isinstance(record, Record):
        raise UsageError(f"process takes a record, as read_record gives it, got {record!r:.60}")
    both = (float(pad), float(pad)) if isinstance(pad, int | float) else pad
    return processed(
        record, Processing(trim, baseline, both, highpass, lowpass, filter_order, resample)
    )


def processed(record: Record, steps: Processing) -> Record:
    """The record after all steps; itself if there is none.

    Raises
    ------
    RecordError
        A step does not fit the record.
    """
    if steps.trim is not None:
        record = trim(record, *steps.trim)
    if steps.baseline is not None:
        record = remove_baseline(record, steps.baseline)
    if steps.pad is not None:
        record = pad(record, *steps.pad)
    for kind, corner in (("highpass", steps.highpass), ("lowpass", steps.lowpass)):
        if corner is not None:
            record = butterworth(record, kind, corner, steps.filter_order or CORNERS)
    if steps.resample is not None:
        record = resample(record, steps.resample)
    return record


def _label(record: Record) -> str:
    return f"{record.source}: {record.id}" if record.id.strip(".") else record.source


def _done(
    record: Record, samples: Array, note: str, *, dt: float | None = None, later: float = 0.0
) -> Record:
    """The record with new samples, beginning some seconds later, and a note of what was done."""
    start = record.start
    if start and later:
        try:
            start = (datetime.fromisoformat(start) + timedelta(seconds=later)).strftime(
                "%Y-%m-%dT%H:%M:%S.%fZ"
            )
        except (ValueError, OverflowError):  # Not a date that Python's calendar has.
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
    """The samples from `start` to `end`, s from the first one, both included; None is an end of the
    record."""
    start = start or 0.0
    end = record.duration if end is None else end
    if end > record.duration + _ROUNDING * record.dt or start >= record.duration:
        raise RecordError(
            f"{_label(record)}: trim {start:g}:{end:g} s leaves the record, which ends at "
            f"{record.duration:.6g} s"
        )
    # Ends between samples are taken inwards: nothing is made up.
    first = math.ceil(start / record.dt - _ROUNDING)
    last = math.floor(end / record.dt + _ROUNDING)
    if last <= first:
        raise RecordError(
            f"{_label(record)}: trim {start:g}:{end:g} s leaves fewer than two samples, which are "
            f"{record.dt:g} s apart"
        )
    note = f"trimmed to the part from {first * record.dt:.6g} to {last * record.dt:.6g} s"
    return _done(record, record.acceleration[first : last + 1], note, later=first * record.dt)


def remove_baseline(record: Record, kind: str) -> Record:
    """The record without its mean (`constant`) or its least-squares line (`linear`)."""
    samples = record.acceleration
    mean = float(np.mean(samples))
    if kind == "constant":
        return _done(record, samples - mean, f"the mean of {mean:.4g} m/s^2 is removed")
    place = np.linspace(-1.0, 1.0, samples.size)
    slope = float(np.dot(place, samples) / np.dot(place, place))
    note = f"a line from {mean - slope:.4g} to {mean + slope:.4g} m/s^2 is removed"
    return _done(record, samples - (mean + slope * place), note)


def pad(record: Record, *seconds: float) -> Record:
    """Zeros for so many seconds before and after, to whole samples."""
    before, after = (math.ceil(min(part / record.dt, 1e18) - _ROUNDING) for part in seconds)
    if before + after > MOST_SAMPLES:
        raise RecordError(
            f"{_label(record)}: pad would add {before + after} samples; take fewer seconds"
        )
    note = (
        f"padded with zeros, {before * record.dt:.6g} s before and {after * record.dt:.6g} s after"
    )
    return _done(
        record, np.pad(record.acceleration, (before, after)), note, later=-before * record.dt
    )


def butterworth(record: Record, kind: str, corner: float, corners: int) -> Record:
    """A Butterworth filter of order `corners` run forwards and, from where it has settled after the
    end, backwards.

    The motion is zero outside its samples. `kind` is highpass or lowpass, `corner` in Hz.
    """
    samples = zero_phase(record.acceleration, record.dt, kind, corner, corners, _label(record))
    note = f"{kind} {corner:g} Hz: Butterworth filter of order {corners}, forwards and backwards"
    return _done(record, samples, note)


def zero_phase(
    samples: Array,
    dt: float,
    kind: str,
    corner: float,
    corners: int,
    label: str,
    *,
    held: bool = False,
) -> Array:
    """The samples (along the first axis, dt seconds apart) after the filter of `butterworth`;
    `label` names them.

    Before and after them is rest, or with `held` their last value after them.

    Raises
    ------
    RecordError
        The corner is out of the reach of such samples.
    """
    if not corner * dt < 0.5 - _NARROWEST:
        raise RecordError(
            f"{label}: {kind} {corner:g} Hz is not below the Nyquist frequency, {0.5 / dt:.6g} Hz"
        )
    if corner * dt < _NARROWEST:
        raise RecordError(f"{label}: {kind} {corner:g} Hz is too low for samples {dt:g} s apart")
    from scipy.signal import sosfilt  # 0.8 s, for filters only

    sections, settling = _designed(kind, corner, corners, dt)
    after = [(0, settling), *[(0, 0)] * (samples.ndim - 1)]
    forwards = sosfilt(
        sections, np.pad(samples, after, mode="edge" if held else "constant"), axis=0
    )
    return np.asarray(sosfilt(sections, forwards[::-1], axis=0)[::-1][: len(samples)])


@lru_cache(maxsize=64)  # a fit runs the same two filters a thousand times
def _designed(kind: str, corner: float, corners: int, dt: float) -> tuple[Array, int]:
    """Second-order sections of a Butterworth filter, and the samples after which it has settled."""
    from scipy.signal import butter, zpk2sos

    zeros, poles, gain = butter(corners, corner, kind, fs=1.0 / dt, output="zpk")
    settling = math.ceil(math.log(_SETTLED) / math.log(float(np.max(np.abs(poles)))))
    return zpk2sos(zeros, poles, gain), settling


def resample(record: Record, dt: float) -> Record:
    """The band-limited motion at another sampling interval, s."""
    if math.isclose(dt, record.dt, rel_tol=1e-12):
        return record
    if record.duration / dt > MOST_SAMPLES:
        raise RecordError(
            f"{_label(record)}: resampled at {dt:g} s it would have more than {MOST_SAMPLES} "
            "samples"
        )
    if dt > record.duration:
        raise RecordError(
            f"{_label(record)}: resampled at {dt:g} s it would have less than two samples"
        )
    samples, band = resampled(record.acceleration, record.dt, dt)
    note = f"resampled from {record.dt:.6g} s to {dt:.6g} s, frequencies up to {band:.4g} Hz kept"
    return _done(record, samples, note, dt=dt)
