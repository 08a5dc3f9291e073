"""Fourier amplitude spectra of ground motions, smoothed by the window of Konno and Ohmachi
(1998)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from tdint.analysis.given import AnyRecord, record_of
from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.ground_motion.record import Record
from tdint.tabular import Tabular
from tdint.units import Quantity

BANDWIDTH = 40.0
"""Of the window, that of Geopsy and ObsPy: half the weight at 6 % of the frequency either side,
none at 20 %."""

_BOUNDS = (1.0, 1000.0)
_FREQUENCIES = 300
"""At most, of a smoothed spectrum: over four decades 3 % apart, half the way to half the weight of
b = 40."""


@dataclass(frozen=True, repr=False)
class FourierSpectrum(Tabular):
    """Amplitudes of the Fourier transform of a ground acceleration.

    Attributes
    ----------
    record : Record
        The motion.
    frequencies : ndarray, shape (k,)
        Hz: of the transform, without zero; of a smoothed spectrum those of them nearest to equal
        ratios.
    amplitude : ndarray, shape (k,)
        dt |sum of a_j exp(-2 pi i f j dt)|, m/s: of the samples as they are, without taper and
        zeros behind them.
    bandwidth : float
        Of the smoothing; nan for none.
    """

    record: Record
    bandwidth: Annotated[
        float, Quantity("1", "bandwidth b of the smoothing (Konno and Ohmachi 1998)")
    ]
    frequencies: Annotated[Array, Quantity("Hz", "frequency", called="frequency")]
    amplitude: Annotated[
        Array,
        Quantity(
            "m/s", "amplitude of the acceleration's Fourier transform", called="fourier_amplitude"
        ),
    ]

    def _headline(self) -> str:
        smoothed = (
            "not smoothed"
            if math.isnan(self.bandwidth)
            else f"smoothed with b = {self.bandwidth:g}"
        )
        return f"of {self.record.name}, {self.frequencies.size} frequencies, {smoothed}"


def fourier_spectrum(record: AnyRecord, smoothing: float | None = BANDWIDTH) -> FourierSpectrum:
    """Fourier amplitude spectrum of a ground motion.

    Parameters
    ----------
    record : Record, path or trace
        The motion.
    smoothing : float or None
        Bandwidth b of the window (sin x / x)^4, x = b log10(f / f_c), by which amplitudes are
        averaged (Konno and Ohmachi 1998, Bulletin of the Seismological Society of America 88(1));
        the weights sum to 1. None: no smoothing.

    Returns
    -------
    FourierSpectrum

    Raises
    ------
    UsageError
        The bandwidth is not from 1 to 1000.
    """
    record = record_of(record)
    if smoothing is not None and not _BOUNDS[0] <= smoothing <= _BOUNDS[1]:
        raise UsageError(
            f"smoothing: the bandwidth is from {_BOUNDS[0]:g} to {_BOUNDS[1]:g}, got "
            f"{smoothing!r:.40}"
        )
    amplitude = record.dt * np.abs(np.fft.rfft(record.acceleration))[1:]
    size = record.acceleration.size
    frequencies: Array = np.arange(1, size // 2 + 1) / (size * record.dt)
    if smoothing is None:
        return FourierSpectrum(record, math.nan, frequencies, amplitude)
    # ObsPy's smoothing has the same window, not normalized by default, but makes it for each
    # frequency of the transform: so many times more than are asked for, or a matrix of their
    # square.
    centers = np.unique(np.rint(np.geomspace(1, frequencies.size, _FREQUENCIES)).astype(int)) - 1
    logarithms = smoothing * np.log10(frequencies)
    smooth = np.empty(centers.size)
    for i, center in enumerate(centers):
        weights = np.sinc((logarithms - logarithms[center]) / math.pi) ** 4
        smooth[i] = weights @ amplitude / np.sum(weights)
    return FourierSpectrum(record, smoothing, frequencies[centers], smooth)
