"""Fourier amplitude spectra of ground motions with the smoothing window of Konno and Ohmachi
(1998)."""

import math
from typing import Annotated

import numpy as np

from tdint.arrays import Array, immutable
from tdint.errors import UsageError
from tdint.ground_motion.record import Record
from tdint.response.arguments import AnyRecord, record_of
from tdint.tabular import Tabular
from tdint.units import Quantity

BANDWIDTH = 40.0
"""Default bandwidth of the window, as in Geopsy and ObsPy. The weight is 0.5 at a distance of
6 % of the frequency, and zero at 20 %."""

_BANDWIDTH_RANGE = (1.0, 1000.0)
"""Allowed bandwidths, dimensionless. Smaller bandwidths average over more than a decade of
frequencies."""

_MAX_FREQUENCIES = 300
"""Maximum number of frequencies of a smoothed spectrum. Over four decades their steps are 3 %, half
the distance to half the weight for b = 40."""


@immutable
class FourierSpectrum(Tabular):
    """Amplitudes of the Fourier transform of a ground acceleration.

    Attributes
    ----------
    record : Record
        The ground motion.
    frequencies : ndarray, shape (k,)
        Frequencies of the discrete Fourier transform without zero, Hz. A smoothed spectrum contains
        only the frequencies that are nearest to a geometric sequence.
    amplitude : ndarray, shape (k,)
        Amplitudes dt |sum of a_j exp(-2 pi i f j dt)|, m/s, of the samples a_j without taper or
        zero padding; smoothed if `bandwidth` is not nan.
    bandwidth : float
        Bandwidth b of the smoothing, dimensionless; nan without smoothing.
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
    """Compute the Fourier amplitude spectrum of a ground motion.

    Parameters
    ----------
    record : Record, path or trace
        The ground motion.
    smoothing : float | None
        Bandwidth b of the window (sin x / x)^4, x = b log10(f / f_c), for averaging the amplitudes
        (Konno and Ohmachi 1998, Bulletin of the Seismological Society of America 88(1)). The
        weights are normalized to the sum 1. None disables smoothing. The default is 40.

    Returns
    -------
    FourierSpectrum
        Amplitudes from the frequency interval 1 / (samples dt) to the Nyquist frequency. With
        smoothing, there are at most 300 frequencies.

    Raises
    ------
    UsageError
        The bandwidth is not between 1 and 1000.
    RecordError
        The record is invalid or cannot be read.
    """
    record = record_of(record)
    min_bandwidth, max_bandwidth = _BANDWIDTH_RANGE
    if smoothing is not None and not min_bandwidth <= smoothing <= max_bandwidth:
        raise UsageError(
            f"smoothing: the bandwidth must be from {min_bandwidth:g} to {max_bandwidth:g}, got "
            f"{smoothing!r:.40}"
        )
    # The amplitude at frequency zero is omitted, because it has no place on a logarithmic axis.
    amplitude = record.dt * np.abs(np.fft.rfft(record.acceleration))[1:]
    size = record.acceleration.size
    frequencies: Array = np.arange(1, size // 2 + 1) / (size * record.dt)
    if smoothing is None:
        return FourierSpectrum(record, math.nan, frequencies, amplitude)
    # ObsPy's smoothing is not used, because it evaluates the window at every frequency of the
    # transform, which needs much more time or a large matrix, and because its window is not
    # normalized by default.
    sequence = np.geomspace(1, frequencies.size, _MAX_FREQUENCIES)
    centers = np.unique(np.rint(sequence).astype(int)) - 1  # indices of frequencies, from 0
    scaled_logarithms = smoothing * np.log10(frequencies)
    smoothed = np.empty(centers.size)
    for i, center in enumerate(centers):
        x = scaled_logarithms - scaled_logarithms[center]
        # np.sinc contains the factor pi, so that this is (sin x / x)^4.
        weights = np.sinc(x / math.pi) ** 4
        smoothed[i] = weights @ amplitude / np.sum(weights)
    return FourierSpectrum(record, smoothing, frequencies[centers], smoothed)
