"""Copies of a ground motion in a suite: the same motion in another format, unit or file, with
another sign or order of its components, scaled, resampled, trimmed or filtered.

Two components are copies if the maximum of their normalized cross-correlation, over all delays and
for either sign, exceeds `SAME_CORRELATION`. It is computed from the frequencies that the usual
filters keep (`_BAND`). Of the components of 43 records, filtered copies (Butterworth of order 4,
0.1 to 25 Hz, 0.25 to 20 Hz, from 0.5 Hz or up to 10 Hz, causal or of zero phase) have at least
0.978; of different components, parallel sensors of one building have up to 0.914, all other pairs
up to 0.59. Pulses and modulated sines are similar for any duration or phase; they are copies only
if they are equal within `_EQUAL_CORRELATION`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.ground_motion.record import Record

SAME_CORRELATION, _EQUAL_CORRELATION = 0.97, 1.0 - 1e-6
"""Correlation of two components above which they are copies (see the docstring of the module): in
the band, and at all frequencies for components that the band does not describe. Pulses with
durations that differ by a tenth have 0.998, modulated sines of different phase 0.9999."""

_BAND = (0.7, 6.0)  # Hz, between the corners of the filters that processed records usually have

_MIN_BAND_ENERGY = 0.1
"""Fraction of the energy of a component in the band, below which all frequencies are compared: a
slow pulse has little more than rounding errors in the band."""

_MIN_INFORMATION = 4.0
"""Product of effective duration and effective bandwidth in the band, below which all frequencies
are compared. Pulses, sines, modulated sines and trains of pulses have 1.1 to 2.9, recorded motions
at least 5.5."""

_MAX_AMPLITUDE_RATIO = 1.25
"""Ratio of the amplitudes of two components above which they are not the same motion, unless scaled
copies are searched. The usual filters change the amplitude in the band by less."""

_ENERGY_BANDS = 12  # number of parts of the band; their energies are compared first

_MAX_ENERGY_DIFFERENCE = 0.25
"""Sum of the differences of the energy fractions above which two components are not correlated. The
filtered copies above differ by up to 0.05, copies that are trimmed to 98 % of their energy by up to
0.16, and 99.7 % of different components by more."""


def first_copies(motions: Sequence[Sequence[Record]], *, scaled: bool = True) -> list[int]:
    """Return, for each motion, the index of the first motion that it copies; the index of the
    motion if it is not a copy of an earlier motion.

    Parameters
    ----------
    motions : sequence of sequence of Record
        One or two components of each motion. Motions with different numbers of components are not
        copies. A motion with a component that is zero is not a copy.
    scaled : bool
        Motions that differ in the amplitude are copies.
    """
    first = list(range(len(motions)))
    if len(motions) < 2:
        return first
    most = max(map(len, motions))
    energies = np.full((len(motions), most, _ENERGY_BANDS), np.nan)
    for index, components in enumerate(motions):
        for row, record in enumerate(components):
            energies[index, row] = _energy_fractions(record)
    # The sum over the components does not depend on their order. Missing components have no
    # contribution.
    totals = np.where(np.isnan(energies), 0.0, energies).sum(axis=1)
    is_comparable = np.array(
        [not np.isnan(energies[i, : len(motions[i])]).any() for i in range(len(motions))]
    )
    for index, components in enumerate(motions):
        if not is_comparable[index]:
            continue
        # Energies are compared first, because a correlation of all pairs of motions is slow.
        distances = np.abs(totals[:index] - totals[index]).sum(axis=1)
        near = (distances <= _MAX_ENERGY_DIFFERENCE * len(components)) & is_comparable[:index]
        for other in np.flatnonzero(near).tolist():
            # Each component must be a copy of another component of the other motion.
            if (
                first[other] == other
                and len(components) == len(motions[other])
                and any(
                    all(_is_copy(*pair, scaled) for pair in zip(components, order, strict=True))
                    for order in permutations(motions[other])
                )
            ):
                first[index] = other
                break
    return first


def _energy_fractions(record: Record) -> Array:
    """Return the fractions of the energy of a component in the parts of the band; nan if the
    component is zero."""
    samples = record.acceleration
    scale = record.pga  # prevents overflow and underflow of the squares
    if not 0.0 < scale < np.inf:
        return np.full(_ENERGY_BANDS, np.nan)
    # At least 20 s, so that each part of the band contains frequencies.
    count = max(samples.size, round(20.0 / record.dt))
    squares = np.abs(np.fft.rfft(samples / scale, count)) ** 2
    edges = np.geomspace(*_BAND, _ENERGY_BANDS + 1)
    energies, _ = np.histogram(np.fft.rfftfreq(count, record.dt), edges, weights=squares)
    total = float(energies.sum())
    # Components without energy in the band are compared with each other.
    if total < _MIN_BAND_ENERGY * float(squares.sum()):
        return np.zeros(_ENERGY_BANDS)
    return energies / total


def _is_copy(component: Record, other: Record, scaled: bool) -> bool:
    """Return True if the maximum of the normalized cross-correlation of two components over all
    delays, for either sign, exceeds the limit; without `scaled`, only for similar amplitudes."""
    step = max(component.dt, other.dt)
    samples = [_resampled(record, step) for record in (component, other)]
    count = 1 << int(np.ceil(np.log2(sum(values.size for values in samples))))
    frequencies = np.fft.rfftfreq(count, step)
    is_in_band = (frequencies >= _BAND[0]) & (frequencies <= _BAND[1])
    transforms = [np.fft.rfft(values, count) for values in samples]
    filtered = [np.where(is_in_band, transform, 0.0) for transform in transforms]
    limit = _EQUAL_CORRELATION
    if all(map(_is_described, filtered, transforms)):
        limit, transforms = SAME_CORRELATION, filtered
    first, second = transforms
    norms = [float(np.sum(np.fft.irfft(transform, count) ** 2)) for transform in transforms]
    amplitude_ratio = np.sqrt(norms[0] / norms[1]) * component.pga / other.pga
    if not scaled and not 1.0 / _MAX_AMPLITUDE_RATIO < amplitude_ratio < _MAX_AMPLITUDE_RATIO:
        return False
    correlation = np.fft.irfft(first * np.conj(second), count)
    return bool(np.max(np.abs(correlation)) > limit * np.sqrt(norms[0] * norms[1]))


def _is_described(filtered: NDArray[np.complex128], transform: NDArray[np.complex128]) -> bool:
    """Return True if the band contains enough energy and information to recognize a component."""
    energies = np.abs(filtered) ** 2
    squares = np.fft.irfft(filtered) ** 2
    is_strong = energies.sum() >= _MIN_BAND_ENERGY * np.sum(np.abs(transform) ** 2)
    information = _effective_number(energies) * _effective_number(squares) / squares.size
    return bool(is_strong and information >= _MIN_INFORMATION)


def _effective_number(values: Array) -> float:
    """Return the number of equal values that have the same entropy as the given values; 0 if all
    values are zero."""
    fractions = values[values > 0.0] / max(np.sum(values), np.finfo(float).tiny)
    return float(np.exp(-np.sum(fractions * np.log(fractions)))) if fractions.size else 0.0


def _resampled(record: Record, step: float) -> Array:
    """Return the samples of a component divided by the peak, at an equal or a longer sampling
    interval; linear between its samples."""
    samples = record.acceleration / record.pga
    if np.isclose(step, record.dt, rtol=1e-6, atol=0.0):
        return samples
    times = step * np.arange(int(record.duration / step + 1e-6) + 1)  # with the last sample
    return np.asarray(np.interp(times, np.arange(samples.size) * record.dt, samples))
