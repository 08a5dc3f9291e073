"""The sampling interval of times that a file prints beside its samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError

_MOST_DECIMALS = 9
_FINEST = 40
"""Parts that an interval between printed times is divided into at most."""

_SHORTEST, _LATEST = 1e-6, 1e9
_SLIP = 0.02
"""Part of an interval by which a time may be off, beside its rounding."""


@dataclass(frozen=True)
class SamplingInterval:
    """Sampling interval, s, and how far the times are from equal steps, s; 0 if rounding explains it."""

    dt: float
    departure: float


def equal_steps(times: NDArray[np.float64], slack: float = 0.0) -> SamplingInterval:
    """Find the sampling interval of printed times.

    Parameters
    ----------
    times : ndarray, shape (samples,)
        s, rounded to some decimal.
    slack : float
        Part of the duration by which a time may depart from equal steps: film turned unevenly.

    Raises
    ------
    RecordError
        The times do not grow, or not in equal steps.
    """
    if times.size < 2:
        raise RecordError("one sample only; a record needs two at least")
    if np.max(np.abs(times)) > _LATEST:
        raise RecordError(f"the times go up to {np.max(np.abs(times)):g} s")
    intervals = np.diff(times)
    if not np.all(intervals > 0.0):
        place = int(np.argmin(intervals > 0.0))
        raise RecordError(f"the times do not grow after sample {place} (counted from 0) at {times[place]:g} s")
    duration = float(times[-1] - times[0])
    rounding = _rounding(times)
    dt = duration / (times.size - 1)
    # A whole number of samples per second, if there is one within the rounding of the times.
    rate = round(1.0 / dt) if dt > _SHORTEST else 0
    is_whole = rate and abs(1.0 / rate - dt) <= rounding / (times.size - 1)
    dt = 1.0 / rate if is_whole else float(f"{dt:.12g}")
    allowed = max(min(1.5 * rounding, 0.5 * dt), _SLIP * dt)
    off_interval = np.abs(intervals - dt)
    off_grid = np.abs(times - times[0] - dt * np.arange(times.size))
    departure = float(max(np.max(off_grid), np.max(off_interval)))
    if departure <= allowed * (1.0 + 1e-6):
        return SamplingInterval(dt, 0.0)
    if departure <= slack * duration:
        return SamplingInterval(dt, departure)
    place = int(np.argmax(off_interval))
    raise RecordError(
        f"the samples are not at equal steps of {dt:.6g} s: they are {intervals[place]:.6g} s apart "
        f"after {times[place]:g} s, and up to {np.max(off_grid):.3g} s off; resample the record to equal steps first"
    )


def finest_step(times: NDArray[np.float64], mean: float) -> float:
    """A step on which all of printed times lie, s: their last decimal, or a small part of their mean interval."""
    return max(_rounding(times), mean / _FINEST)


def _rounding(times: NDArray[np.float64]) -> float:
    """Value of the last decimal that the times need, s."""
    scale = float(np.max(np.abs(times)))
    for decimals in range(_MOST_DECIMALS):
        if np.max(np.abs(times - np.round(times, decimals))) <= 1e-14 * scale:
            return float(10.0**-decimals)
    return float(10.0**-_MOST_DECIMALS)
