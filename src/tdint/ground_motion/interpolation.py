"""A ground motion between its samples: straight lines, or the band-limited motion.

The response of an oscillator is computed for straight lines. The band-limited motion, which has no frequency above half
the sampling rate (Shannon 1949) and is zero at the samples before and after the record, is therefore given by points so
close that lines between them will do. Lines through the points of a motion weaken its frequency f by sinc(f h)^2, where
h is the distance of the points; the points are raised by as much, so that up to half the sampling rate the lines hold
the motion itself. What remains are its images around 1/h, 2/h, ...: weaker than a thousandth, far above the frequencies
of the oscillators. Measured against a windowed sum of sines up to 0.8 of that rate, whose response is known in closed
form: all largest values within 1e-5 from T = dt / 2 on, most of them within 1e-6
(tests/analysis/spectra/test_band_limited.py).

Another sampling interval for such a motion: interpolation by sinc functions under a Kaiser window. Where the new
interval is longer, the sinc is stretched so that what lies above the new Nyquist frequency is gone (Crochiere and
Rabiner, 1983; Kaiser 1974 for the window).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.record import Record

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
        Samples (m/s^2, shape (points,)) and their interval (s), between which straight lines stand for the motion, from
        the record and the shortest period (s) of the oscillators.
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


def _straight_peak(record: Record) -> float:
    return record.pga


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


LINEAR = Interpolation("linear", _straight, _straight_peak, "straight lines")
BAND_LIMITED = Interpolation(
    "band-limited", _band_limited, _band_limited_peak, "free of frequencies above half its sampling rate"
)
INTERPOLATIONS = {interpolation.name: interpolation for interpolation in (LINEAR, BAND_LIMITED)}


MOST_SAMPLES = 50_000_000
_ATTENUATION = 100.0
"""Of what is to go, dB."""

_TRANSITION = 0.2
"""Width of the band between what stays and what goes, over the lower one of the two Nyquist frequencies."""

_BETA = 0.1102 * (_ATTENUATION - 8.7)
_AT_ONCE = 2**20


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
        As many as there are up to the last old sample. Old samples are kept where the new ones meet them, if the new
        interval is the shorter one.
    band : float
        Frequency, Hz, up to which amplitudes are kept to 2e-5.
    """
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
        result[start : start + rows] = np.sum(weights * padded[places[:, None] + taps + half], axis=1)
    return result, 0.5 / (dt * stretch) * (cutoff - 0.5 * _TRANSITION)
