"""Another sampling interval for a band-limited motion: interpolation by sinc functions under a Kaiser window.

The motion is zero outside its samples. Where the new interval is longer, the sinc is stretched so that what lies above
the new Nyquist frequency is gone (Crochiere and Rabiner, 1983; Kaiser 1974 for the window).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
