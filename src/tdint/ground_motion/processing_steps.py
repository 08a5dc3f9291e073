"""Changes to a record, made only when asked for (`tdint.ground_motion.processing`), each told in its notes."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.interpolation import MOST_SAMPLES, resampled
from tdint.ground_motion.processing import CORNERS, Processing
from tdint.ground_motion.record import Record

_NARROWEST = 1e-5
"""Least distance of a filter's corner from zero and from the Nyquist frequency, over the sampling rate: closer,
rounding and the time to settle get out of hand."""

_SETTLED = 1e-13
_ROUNDING = 1e-6


def process(
    record: Record,
    *,
    trim: tuple[float | None, float | None] | None = None,
    baseline: str | None = None,
    pad: float | tuple[float, float] | None = None,
    highpass: float | None = None,
    lowpass: float | None = None,
    corners: int | None = None,
    resample: float | None = None,
) -> Record:
    """Change a record in the steps asked for, in this order whatever that of the arguments.

    Parameters
    ----------
    record : Record
        Left as it is.
    trim, baseline, pad, highpass, lowpass, corners, resample
        As in `Processing`; a single number for `pad` stands for both ends.

    Returns
    -------
    Record
        Its notes and its `processing` tell what was done.

    Raises
    ------
    UsageError
        Values that make no sense for any record.
    RecordError
        A step does not fit this record: a trim outside it, a corner above its Nyquist frequency.
    """
    both = (float(pad), float(pad)) if isinstance(pad, int | float) else pad
    return processed(record, Processing(trim, baseline, both, highpass, lowpass, corners, resample))


def processed(record: Record, wanted: Processing) -> Record:
    """The record after all steps; itself if there is none.

    Raises
    ------
    RecordError
        A step does not fit the record.
    """
    corners = wanted.corners or CORNERS
    if wanted.trim is not None:
        record = trim(record, *wanted.trim)
    if wanted.baseline is not None:
        record = remove_baseline(record, wanted.baseline)
    if wanted.pad is not None:
        record = pad(record, *wanted.pad)
    if wanted.highpass is not None:
        record = butterworth(record, "highpass", wanted.highpass, corners)
    if wanted.lowpass is not None:
        record = butterworth(record, "lowpass", wanted.lowpass, corners)
    if wanted.resample is not None:
        record = resample(record, wanted.resample)
    return record


def _label(record: Record) -> str:
    return f"{record.source}: {record.id}" if record.id.strip(".") else record.source


def _done(record: Record, samples: Array, note: str, *, dt: float | None = None, later: float = 0.0) -> Record:
    """The record with new samples, beginning some seconds later, and a note of what was done."""
    return replace(
        record,
        acceleration=samples,
        dt=dt or record.dt,
        start=_shifted(record.start, later),
        notes=(*record.notes, note),
        processing=(*record.processing, note),
        peaks=(None, None),
    )


def _shifted(start: str, seconds: float) -> str:
    if not start or seconds == 0.0:
        return start
    try:
        return (datetime.fromisoformat(start) + timedelta(seconds=seconds)).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    except (ValueError, OverflowError):  # Not a date that Python's calendar has.
        return ""


def trim(record: Record, start: float | None, end: float | None) -> Record:
    """The samples from `start` to `end`, s from the first one, both included; None is an end of the record."""
    start = start or 0.0
    end = record.duration if end is None else end
    if end > record.duration + _ROUNDING * record.dt or start >= record.duration:
        raise RecordError(
            f"{_label(record)}: trim {start:g}:{end:g} s leaves the record, which ends at {record.duration:.6g} s"
        )
    first = math.ceil(start / record.dt - _ROUNDING)
    last = math.floor(end / record.dt + _ROUNDING)
    if last <= first:
        raise RecordError(
            f"{_label(record)}: trim {start:g}:{end:g} s leaves fewer than two samples, which are {record.dt:g} s apart"
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
        raise RecordError(f"{_label(record)}: pad would add {before + after} samples; take fewer seconds")
    note = f"padded with zeros, {before * record.dt:.6g} s before and {after * record.dt:.6g} s after"
    return _done(record, np.pad(record.acceleration, (before, after)), note, later=-before * record.dt)


def butterworth(record: Record, kind: str, corner: float, corners: int) -> Record:
    """A Butterworth filter of order `corners` run forwards and, from where it has settled after the end, backwards.

    The motion is zero outside its samples. `kind` is highpass or lowpass, `corner` in Hz.
    """
    samples = zero_phase(record.acceleration, record.dt, kind, corner, corners, _label(record))
    note = f"{kind} {corner:g} Hz: Butterworth filter of order {corners}, forwards and backwards"
    return _done(record, samples, note)


def zero_phase(
    samples: Array, dt: float, kind: str, corner: float, corners: int, label: str, *, held: bool = False
) -> Array:
    """The samples (along the first axis, dt seconds apart) after the filter of `butterworth`; `label` names them.

    Before and after them is rest, or with `held` their last value after them.

    Raises
    ------
    RecordError
        The corner is out of the reach of such samples.
    """
    if not corner * dt < 0.5 - _NARROWEST:
        raise RecordError(f"{label}: {kind} {corner:g} Hz is not below the Nyquist frequency, {0.5 / dt:.6g} Hz")
    if corner * dt < _NARROWEST:
        raise RecordError(f"{label}: {kind} {corner:g} Hz is too low for samples {dt:g} s apart")
    from scipy.signal import butter, sosfilt, zpk2sos  # 0.8 s, for filters only

    zeros, poles, gain = butter(corners, corner, kind, fs=1.0 / dt, output="zpk")
    sections = zpk2sos(zeros, poles, gain)
    settling = math.ceil(math.log(_SETTLED) / math.log(float(np.max(np.abs(poles)))))
    after = [(0, settling), *[(0, 0)] * (samples.ndim - 1)]
    forwards = sosfilt(sections, np.pad(samples, after, mode="edge" if held else "constant"), axis=0)
    return np.asarray(sosfilt(sections, forwards[::-1], axis=0)[::-1][: len(samples)])


def resample(record: Record, dt: float) -> Record:
    """The band-limited motion at another sampling interval, s."""
    if math.isclose(dt, record.dt, rel_tol=1e-12):
        return record
    if record.duration / dt > MOST_SAMPLES:
        raise RecordError(f"{_label(record)}: resampled at {dt:g} s it would have more than {MOST_SAMPLES} samples")
    if dt > record.duration:
        raise RecordError(f"{_label(record)}: resampled at {dt:g} s it would have less than two samples")
    samples, band = resampled(record.acceleration, record.dt, dt)
    note = f"resampled from {record.dt:.6g} s to {dt:.6g} s, frequencies up to {band:.4g} Hz kept"
    return _done(record, samples, note, dt=dt)
