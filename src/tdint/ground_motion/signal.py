"""Signal of a single sensor (acceleration, velocity or displacement): offset, filters and
resampling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.choice import DEFAULT_FILTER_ORDER
from tdint.ground_motion.record import Input

_PRE_EVENT_FRACTION = 1e-6
"""Fraction of the sum of squared increments of a displacement. The shaking starts when the sum from
the first sample reaches this fraction of the total."""

_MAX_STANDARD_ERRORS = 3.0
"""Ratio of the mean sign of samples to its standard error above which an offset is reported. Chance
exceeds it once in 370 cases."""

_INTERVAL_TOLERANCE = 1e-9
"""Maximum relative difference of two sampling intervals that count as equal; it exceeds rounding
errors."""

_OUTSIDE = 1e-6
"""Sampling intervals; larger distances from the first or last sample are not rounding errors of
times."""


@dataclass(frozen=True)
class Signal:
    """One recorded channel in SI units.

    Attributes
    ----------
    samples : ndarray, shape (samples,)
        Samples, m, m/s or m/s^2.
    quantity : str
        `acceleration`, `velocity` or `displacement`.
    start : float | None
        Time of the first sample, s, on the `clock`; None if the file does not state it.
    clock : str
        `UTC`, or `table` for the times of a table; empty without a start.
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
        """Return a copy of the channel with other samples.

        Parameters
        ----------
        quantity : str, optional
            Quantity of these samples, `acceleration`, `velocity` or `displacement`. The default is
            the quantity of the channel.
        """
        return replace(self, samples=samples, quantity=quantity or self.quantity)

    def centered(self) -> Signal:
        """Return a copy of the channel without the offset of the sensor, its value at rest."""
        return self.with_samples(without_offset(self.samples, self.quantity))

    def times(self, factor: float) -> Signal:
        """Return a copy of the channel with the samples multiplied by a factor."""
        return self.with_samples(factor * self.samples)


def without_offset(samples: Array, quantity: str) -> Array:
    """Subtract the value at rest from samples.

    The value at rest of an acceleration or a velocity is the median. A displacement may be
    permanent after the shaking; its value at rest is therefore the median before the shaking.

    Parameters
    ----------
    quantity : str
        `acceleration`, `velocity` or `displacement`.
    """
    if quantity != "displacement":
        return samples - np.median(samples)
    # The sum of squared increments remains small until the shaking starts.
    sums = np.cumsum(np.diff(samples) ** 2)
    if sums.size:
        quiet_samples = int(np.searchsorted(sums, _PRE_EVENT_FRACTION * sums[-1])) + 1
    else:
        quiet_samples = samples.size
    return samples - np.median(samples[:quiet_samples])


def has_offset(acceleration: Array) -> bool:
    """Return True if an acceleration has an offset: it is on one side of zero more often
    than chance explains.

    The offset must be tested before it is subtracted. The median of a motion without an offset is
    not exactly zero, and subtracting it would add a step to the ground acceleration, which would
    excite the building.

    Parameters
    ----------
    acceleration : ndarray, shape (samples,)
        Acceleration in any unit.
    """
    # This is a sign test. Neighboring samples are not independent, so that each interval between
    # crossings of the median counts as a single independent sample.
    centered = acceleration - np.median(acceleration)
    independent_samples = 1 + np.count_nonzero(np.diff(np.sign(centered)))
    mean_sign = abs(np.mean(np.sign(acceleration)))
    return bool(mean_sign > _MAX_STANDARD_ERRORS / math.sqrt(independent_samples))


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
    band : tuple of float | None
        Lower and upper frequency, Hz; None returns the samples unchanged.
    quantity : str
        Quantity of the samples, which determines the motion after the end: a `displacement` keeps
        its last value; other quantities are zero. The default is `acceleration`.

    Raises
    ------
    RecordError
        The band cannot be represented at this sampling interval.
    """
    if band is None:
        return samples
    is_held = quantity == "displacement"
    from tdint.ground_motion.processing_steps import zero_phase

    corners = dict(zip(("highpass", "lowpass"), band, strict=True))
    return zero_phase(samples, dt, corners, DEFAULT_FILTER_ORDER, label, held=is_held)


def at_times(samples: Array, dt: float, first: float, interval: float, count: int) -> Array:
    """Evaluate the band-limited motion through samples at the times 0, interval, ..., (count - 1)
    interval.

    Parameters
    ----------
    first : float
        Time of the first sample, s.

    Returns
    -------
    ndarray, shape (count,)
        Values of the motion; nan before the first and after the last sample, except for rounding.
    """
    if not math.isclose(dt, interval, rel_tol=_INTERVAL_TOLERANCE):
        from tdint.ground_motion.processing_steps import resampled

        samples, _ = resampled(samples, dt, interval)
    # The time of the first sample is a whole number of intervals (`offset`) and a fraction from
    # -0.5 to 0.5.
    offset = math.floor(first / interval + 0.5)
    fraction = first / interval - offset
    # The two intervals may differ by the tolerance. Over `count` intervals the difference of the
    # times adds up to `count` tolerances, so that a smaller fraction has no meaning.
    if abs(fraction) > _INTERVAL_TOLERANCE * max(1, count):
        # The samples are shifted by the fraction through a change of phase of their Fourier
        # transform. Zeros are added, because the transform is periodic: without zeros, the end of
        # the motion would appear at its start.
        size = 2 * samples.size
        phase = np.exp(-2j * math.pi * fraction * np.fft.rfftfreq(size))
        samples = np.fft.irfft(np.fft.rfft(samples, size) * phase, size)[: samples.size]
        # Shifted value k is at the requested time offset + k. With a positive fraction, the first
        # of these times is before the first sample. With a negative fraction, the last of them is
        # after the last sample.
        if abs(fraction) > _OUTSIDE:
            samples[0 if fraction > 0.0 else -1] = np.nan
    result = np.full(count, np.nan)
    begin, end = max(0, offset), min(count, offset + samples.size)
    if begin < end:
        result[begin:end] = samples[begin - offset : end - offset]
    return result
