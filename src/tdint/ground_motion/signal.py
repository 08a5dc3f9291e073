"""What one sensor recorded: samples of an acceleration, a velocity or a displacement, brought to
other times."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.choice import CORNERS
from tdint.ground_motion.processing_steps import resampled, zero_phase
from tdint.ground_motion.record import Input

_QUIET = 1e-6
"""Part of the squared velocities of a displacement that comes before the shaking."""

_TOLD = 3.0
"""Standard errors from which an offset is told: chance is beyond them once in 370 times."""

_SAME = 1e-9
"""Relative difference up to which two sampling intervals are one."""


@dataclass(frozen=True)
class Signal:
    """One channel as it was recorded, in SI units.

    Attributes
    ----------
    samples : ndarray, shape (samples,)
        m, m/s or m/s^2.
    dt : float
        Sampling interval, s.
    quantity : str
        `acceleration`, `velocity` or `displacement`.
    label : str
        File and channel, for messages.
    start : float or None
        Time of the first sample, s, on the `clock`; None if the file does not tell.
    clock : str
        `UTC`, or `table` for the times of a table; empty without a start.
    notes, warnings : tuple of str
        What the reader assumed or did.
    input : Input
        The file that it was read from.
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
        """The same channel with other samples, of another quantity if one is named."""
        return replace(self, samples=samples, quantity=quantity or self.quantity)

    def centered(self) -> Signal:
        """Without the sensor's offset."""
        return self.with_samples(without_offset(self.samples, self.quantity))

    def times(self, factor: float) -> Signal:
        """Multiplied by a factor."""
        return self.with_samples(factor * self.samples)


def without_offset(samples: Array, quantity: str) -> Array:
    """Samples less what they are at rest: an acceleration its median; a displacement, which may
    remain when all is over, the median of what it is before the shaking."""
    if quantity != "displacement":
        return np.asarray(samples - np.median(samples))
    moved = np.cumsum(np.diff(samples) ** 2)
    before = int(np.searchsorted(moved, _QUIET * moved[-1])) + 1 if moved.size else samples.size
    return np.asarray(samples - np.median(samples[:before]))


def has_offset(acceleration: Array) -> bool:
    """Whether samples tell an offset: they lie on one side of zero more often than chance lets
    them.

    By the sign test: the mean of the signs is beyond three times its standard error, 1 /
    sqrt(stays), where a stay on one side of the median is one draw. The median of a motion without
    an offset is not zero; who takes it off adds a step to the ground, which the building answers.
    """
    centered = acceleration - np.median(acceleration)
    stays = 1 + np.count_nonzero(np.diff(np.sign(centered)))
    return bool(abs(np.mean(np.sign(acceleration))) > _TOLD / math.sqrt(stays))


def in_band(
    samples: Array,
    dt: float,
    band: tuple[float, float] | None,
    label: str,
    quantity: str = "acceleration",
) -> Array:
    """Samples (along the first axis) between two frequencies, Hz, by filters without shift of
    phase; as they are without a band. A displacement stays where it ends.

    Raises
    ------
    RecordError
        The band is out of the reach of such samples; `label` names them.
    """
    if band is None:
        return samples
    held = quantity == "displacement"
    lower = zero_phase(samples, dt, "highpass", band[0], CORNERS, label, held=held)
    return zero_phase(lower, dt, "lowpass", band[1], CORNERS, label)


def at_times(samples: Array, dt: float, first: float, interval: float, count: int) -> Array:
    """The band-limited motion through samples dt (s) apart, at the times 0, interval, ..., (count -
    1) interval.

    Parameters
    ----------
    first : float
        Time of the first sample, s.

    Returns
    -------
    ndarray, shape (count,)
        nan before the first sample and after the last one.
    """
    if not math.isclose(dt, interval, rel_tol=_SAME):
        samples, _ = resampled(samples, dt, interval)
    whole = math.floor(first / interval + 0.5)
    rest = first / interval - whole
    if abs(rest) > _SAME * max(1, count):
        # The band-limited motion a part of the sampling interval later; it is zero outside its
        # samples.
        size = 2 * samples.size
        phase = np.exp(-2j * math.pi * rest * np.fft.rfftfreq(size))
        samples = np.fft.irfft(np.fft.rfft(samples, size) * phase, size)[: samples.size]
    result = np.full(count, np.nan)
    begin, end = max(0, whole), min(count, whole + samples.size)
    if begin < end:
        result[begin:end] = samples[begin - whole : end - whole]
    return result
