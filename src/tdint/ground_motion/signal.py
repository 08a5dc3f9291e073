"""Signal of one sensor (acceleration, velocity or displacement): offset, filters and resampling."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.choice import DEFAULT_FILTER_ORDER
from tdint.ground_motion.record import Input

_QUIET = 1e-6
"""Fraction of the sum of squared velocities of a displacement that belongs to the time before the
shaking."""

_MAX_STANDARD_ERRORS = 3.0
"""Standard errors; an offset is reported above this value, which chance exceeds once in 370
cases."""

_SAME = 1e-9
"""Relative difference up to which two sampling intervals are considered equal."""


@dataclass(frozen=True)
class Signal:
    """One recorded channel in SI units.

    Attributes
    ----------
    samples : ndarray, shape (samples,)
        Samples, m, m/s or m/s^2.
    dt : float
        Sampling interval, s.
    quantity : str
        `acceleration`, `velocity` or `displacement`.
    label : str
        File and channel, for messages.
    start : float or None
        Time of the first sample, s, on the `clock`; None if the file does not state it.
    clock : str
        `UTC`, or `table` for the times of a table; empty without a start.
    notes, warnings : tuple of str
        Assumptions and changes made by the reader.
    input : Input
        File from which the channel was read.
    """

    samples: Array
    dt: float
    quantity: str
    label: str
    start: float | None
    clock: str
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    input: Input

    def with_samples(self, samples: Array, quantity: str | None = None) -> Signal:
        """Return the channel with other samples and, if specified, another quantity."""
        return replace(self, samples=samples, quantity=quantity or self.quantity)

    def centered(self) -> Signal:
        """Return the channel without the offset of the sensor."""
        return self.with_samples(without_offset(self.samples, self.quantity))

    def times(self, factor: float) -> Signal:
        """Return the channel multiplied by a factor."""
        return self.with_samples(factor * self.samples)


def without_offset(samples: Array, quantity: str) -> Array:
    """Subtract the value at rest from samples.

    The value at rest of an acceleration or a velocity is the median. A displacement may be
    permanent after the shaking; its value at rest is therefore the median before the shaking.

    Parameters
    ----------
    samples : ndarray, shape (samples,)
        Samples of the quantity.
    quantity : str
        `acceleration`, `velocity` or `displacement`.
    """
    if quantity != "displacement":
        return np.asarray(samples - np.median(samples))
    moved = np.cumsum(np.diff(samples) ** 2)
    before = int(np.searchsorted(moved, _QUIET * moved[-1])) + 1 if moved.size else samples.size
    return np.asarray(samples - np.median(samples[:before]))


def has_offset(acceleration: Array) -> bool:
    """Return True if samples have an offset: they are on one side of zero more often than explained
    by chance.

    The sign test is used: the mean of the signs exceeds three times its standard error,
    1 / sqrt(stays). A stay is an interval on one side of the median and counts as one sample. The
    median of a motion without an offset is not exactly zero. Subtracting it would add a step to the
    ground acceleration, which would excite the building.
    """
    centered = acceleration - np.median(acceleration)
    stays = 1 + np.count_nonzero(np.diff(np.sign(centered)))
    return bool(abs(np.mean(np.sign(acceleration))) > _MAX_STANDARD_ERRORS / math.sqrt(stays))


def in_band(
    samples: Array,
    dt: float,
    band: tuple[float, float] | None,
    label: str,
    quantity: str = "acceleration",
) -> Array:
    """Filter samples to a frequency band with zero-phase filters.

    Parameters
    ----------
    samples : ndarray
        Samples along the first axis.
    dt : float
        Sampling interval, s.
    band : tuple of float or None
        Lower and upper frequency, Hz; None returns the samples unchanged.
    label : str
        Name of the samples in error messages.
    quantity : str
        A `displacement` keeps its last value after the end; other quantities are zero after the
        end. Default `acceleration`.

    Raises
    ------
    RecordError
        The band cannot be represented at this sampling interval.
    """
    if band is None:
        return samples
    held = quantity == "displacement"
    from tdint.ground_motion.processing_steps import zero_phase

    lower = zero_phase(samples, dt, "highpass", band[0], DEFAULT_FILTER_ORDER, label, held=held)
    return zero_phase(lower, dt, "lowpass", band[1], DEFAULT_FILTER_ORDER, label)


def at_times(samples: Array, dt: float, first: float, interval: float, count: int) -> Array:
    """Evaluate the band-limited motion through samples at the times 0, interval, ...,
    (count - 1) interval.

    Parameters
    ----------
    samples : ndarray, shape (samples,)
        Samples of the motion.
    dt : float
        Sampling interval, s.
    first : float
        Time of the first sample, s.
    interval : float
        Interval of the requested times, s.
    count : int
        Number of requested times.

    Returns
    -------
    ndarray, shape (count,)
        Values of the motion; nan before the first and after the last sample.
    """
    if not math.isclose(dt, interval, rel_tol=_SAME):
        from tdint.ground_motion.processing_steps import resampled

        samples, _ = resampled(samples, dt, interval)
    whole = math.floor(first / interval + 0.5)
    fraction = first / interval - whole
    if abs(fraction) > _SAME * max(1, count):
        # Shift the band-limited motion, which is zero outside its samples, by a fraction of the
        # sampling interval.
        size = 2 * samples.size
        phase = np.exp(-2j * math.pi * fraction * np.fft.rfftfreq(size))
        samples = np.fft.irfft(np.fft.rfft(samples, size) * phase, size)[: samples.size]
    result = np.full(count, np.nan)
    begin, end = max(0, whole), min(count, whole + samples.size)
    if begin < end:
        result[begin:end] = samples[begin - whole : end - whole]
    return result
