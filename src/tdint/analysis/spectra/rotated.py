"""Spectra over all directions of the two horizontal components of a motion: RotD (Boore 2010)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tdint.analysis.arguments import AnyRecord, damping_of, horizontals_of
from tdint.analysis.spectra.elastic import (
    OR_ZERO,
    SHORTEST,
    SpectrumSettings,
    check_shortest,
    checked_periods,
    choose_settings,
    groups,
)
from tdint.arrays import Array, Numbers
from tdint.errors import UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.kernels.oscillators import rotated as rotation
from tdint.number_parsing import pluralize
from tdint.tabular import Tabular


@dataclass(frozen=True, repr=False)
class RotatedSpectrum(Tabular):
    """Pseudo-acceleration spectra of two horizontal components over all directions, for one damping
    ratio.

    Attributes
    ----------
    damping : float
        Damping ratio.
    motion : Horizontals
        The two components.
    periods : ndarray, shape (k,)
        Periods, s.
    percentiles : tuple of int
        The percentiles that were asked for.
    psa : ndarray, shape (len(percentiles), k)
        RotDnn: percentiles of the pseudo-accelerations (m/s^2) in 180 directions one degree apart.
    geometric_mean : ndarray, shape (k,)
        Geometric mean of the pseudo-accelerations of the two components as they are, m/s^2.
    angle : ndarray, shape (k,)
        Direction of the largest pseudo-acceleration, degrees from the first component towards the
        second, below 180.
    maxima, interpolation : str
        As for `tdint.analysis.spectra.elastic.Spectrum`.
    """

    motion: Horizontals
    damping: float
    periods: Array
    percentiles: tuple[int, ...]
    psa: Array
    geometric_mean: Array
    angle: Array
    maxima: str
    interpolation: str

    def _headline(self) -> str:
        """Return the description of the result in one line, without the class name."""
        return (
            f"of {self.motion.source}, damping {self.damping:g}, "
            f"{pluralize(self.periods.size, 'period')}"
        )


def rotated_spectrum(
    motion: Horizontals | Sequence[AnyRecord],
    periods: Numbers,
    damping: float | str = 0.05,
    percentiles: Sequence[int] = (0, 50, 100),
    *,
    maxima: str | None = None,
    interpolation: str | None = None,
) -> RotatedSpectrum:
    """Compute percentiles of the pseudo-acceleration over all directions: RotD (Boore 2010, doi
    10.1785/0120090400).

    The angle between two directions is at most half a degree, so that RotD100 is at most 4e-5
    (relative) below the maximum over all directions. Percentiles are interpolated linearly between
    the values of the directions.

    Parameters
    ----------
    motion : Horizontals or sequence of two Records
        Two components at right angles.
    percentiles : sequence of int
        From 0 to 100.
    periods, damping, maxima, interpolation
        As for `tdint.analysis.spectra.elastic.spectrum`.

    Returns
    -------
    RotatedSpectrum
        Pseudo-accelerations, shape (percentiles, k).

    Raises
    ------
    UsageError
        As there; percentiles out of range.
    AnalysisError
        A period is too short for the record.
    """
    if not percentiles or not all(0 <= percentile <= 100 for percentile in percentiles):
        raise UsageError(
            f"percentiles must be from 0 to 100, got {', '.join(map(str, percentiles)) or 'none'}"
        )
    motion = horizontals_of(motion)
    damping = damping_of(damping)
    periods = checked_periods(periods)
    settings = choose_settings(None, maxima, interpolation)
    positive = periods > 0.0
    psa = np.empty((periods.size, rotation.ANGLES))
    if np.any(positive):
        check_shortest(periods, motion.first.dt, SHORTEST, OR_ZERO)
        omega = 2.0 * math.pi / periods[positive]
        psa[positive] = omega[:, None] ** 2 * _displacements(motion, omega, damping, settings)
    if not np.all(positive):
        # A rigid oscillator has the peak ground acceleration in each direction.
        first, second = motion.first.acceleration, motion.second.acceleration
        rotated = (
            replace(motion.first, acceleration=c * first + s * second) for c, s in _directions().T
        )
        psa[~positive] = [settings.interpolation.peak(record) for record in rotated]
    return RotatedSpectrum(
        motion=motion,
        damping=damping,
        periods=periods,
        percentiles=tuple(percentiles),
        psa=np.percentile(psa, percentiles, axis=1),
        geometric_mean=np.sqrt(psa[:, 0] * psa[:, rotation.ANGLES // 2]),
        angle=np.argmax(psa, axis=1) * (180.0 / rotation.ANGLES),
        maxima=settings.maxima.name,
        interpolation=settings.interpolation.name,
    )


def _displacements(
    motion: Horizontals, omega: Array, damping: float, settings: SpectrumSettings
) -> Array:
    """Return the maximum displacement (m) of each oscillator in each direction, shape
    (k, ANGLES)."""
    shortest = 2.0 * math.pi / float(np.max(omega))
    components = (
        settings.interpolation.resample(record, shortest)
        for record in (motion.first, motion.second)
    )
    (first, dt), (second, _) = components
    result, between = np.empty((omega.size, rotation.ANGLES)), int(settings.maxima.between)
    for chosen, parts, table in groups(
        omega, damping, dt, settings.maxima, lambda count: rotation.LANES
    ):
        peaks = np.empty((chosen.size, rotation.ANGLES))
        scratch = rotation.scratch(first.size, parts)
        rotation.rotated_peaks.compiled(
            first, second, dt, parts, table, _directions(), between, peaks, *scratch
        )
        result[chosen] = peaks
    return result


def _directions() -> Array:
    """Return cosine and sine of each direction, shape (2, ANGLES); exact along both components."""
    angles = np.arange(rotation.ANGLES) * (math.pi / rotation.ANGLES)
    cosine = np.where(np.arange(rotation.ANGLES) == rotation.ANGLES // 2, 0.0, np.cos(angles))
    return np.array([cosine, np.sin(angles)])
