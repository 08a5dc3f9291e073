"""Spectra over all directions of the two horizontal components of a motion: RotD (Boore 2010)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tdint.arrays import Array, Numbers, immutable
from tdint.errors import UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.kernels.oscillators import rotated as rotation
from tdint.number_parsing import pluralize
from tdint.response.arguments import AnyRecord, damping_of, horizontals_of
from tdint.response.spectra import elastic
from tdint.tabular import Tabular


@immutable
class RotatedSpectrum(Tabular):
    """Pseudo-acceleration spectra of two horizontal components over all directions, for a single
    damping ratio.

    Attributes
    ----------
    damping : float
        Damping ratio.
    motion : Horizontals
        The two components.
    periods : ndarray, shape (k,)
        Periods, s.
    percentiles : tuple of int
        Requested percentiles.
    psa : ndarray, shape (len(percentiles), k)
        RotDnn: percentiles of the pseudo-accelerations (m/s^2) in 180 directions at intervals of
        one degree.
    geometric_mean : ndarray, shape (k,)
        Geometric mean of the pseudo-accelerations of the two components without rotation, m/s^2.
    angle : ndarray, shape (k,)
        Direction of the maximum pseudo-acceleration, degrees from the first component towards the
        second component, less than 180.
    maxima : str
        Method that determined the maximum of each oscillator, as in
        `tdint.response.spectra.elastic.Spectrum`.
    interpolation : str
        Interpolation of the acceleration between samples, as in `Spectrum`.
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
    periods : ndarray, shape (k,)
        Periods, s; 0 gives the peak ground acceleration.
    damping : float or str, default 0.05
        Damping ratio.
    percentiles : sequence of int
        Percentiles over the directions, from 0 to 100. The default is the minimum, the median and
        the maximum.
    maxima, interpolation : str, optional
        Determination of the maximum of each oscillator, and interpolation of the acceleration
        between samples, with the values and defaults of `tdint.response.spectra.elastic.spectrum`.

    Returns
    -------
    RotatedSpectrum
        Pseudo-accelerations, shape (percentiles, k).

    Raises
    ------
    UsageError
        A parameter is invalid, for example a percentile below 0 or above 100.
    RecordError
        A record cannot be read, or the components are not a pair.
    AnalysisError
        A period is too short for the sampling interval of the record.
    """
    if not percentiles or not all(0 <= percentile <= 100 for percentile in percentiles):
        raise UsageError(
            f"percentiles must be from 0 to 100, got {', '.join(map(str, percentiles)) or 'none'}"
        )
    motion = horizontals_of(motion)
    damping = damping_of(damping)
    periods = elastic.checked_periods(periods)
    settings = elastic.choose_settings(None, maxima, interpolation)
    is_positive = periods > 0.0
    psa = np.empty((periods.size, rotation.ANGLES))
    if np.any(is_positive):
        elastic.check_shortest(periods, motion.first.dt, elastic.SHORTEST, elastic.OR_ZERO)
        omega = 2.0 * math.pi / periods[is_positive]
        displacements = _directional_displacements(motion, omega, damping, settings)
        psa[is_positive] = omega[:, None] ** 2 * displacements
    if not np.all(is_positive):
        # The pseudo-acceleration of a rigid oscillator (period 0) is the peak ground acceleration
        # in each direction.
        first, second = motion.first.acceleration, motion.second.acceleration
        rotated_records = (
            replace(motion.first, acceleration=cosine * first + sine * second)
            for cosine, sine in _directions().T
        )
        psa[~is_positive] = [settings.interpolation.peak(record) for record in rotated_records]
    return RotatedSpectrum(
        motion=motion,
        damping=damping,
        periods=periods,
        percentiles=tuple(percentiles),
        psa=np.percentile(psa, percentiles, axis=1),
        # The components are the directions 0 and 90 degrees, of ANGLES directions up to 180.
        geometric_mean=np.sqrt(psa[:, 0] * psa[:, rotation.ANGLES // 2]),
        angle=np.argmax(psa, axis=1) * (180.0 / rotation.ANGLES),
        maxima=settings.maxima.name,
        interpolation=settings.interpolation.name,
    )


def _directional_displacements(
    motion: Horizontals, omega: Array, damping: float, settings: elastic.SpectrumSettings
) -> Array:
    """Compute the maximum absolute relative displacements of linear oscillators in all directions,
    m, shape (k, ANGLES).
    """
    shortest_period = 2.0 * math.pi / float(np.max(omega))
    components = (
        settings.interpolation.resample(record, shortest_period)
        for record in (motion.first, motion.second)
    )
    (first, dt), (second, _) = components
    result = np.empty((omega.size, rotation.ANGLES))
    # After the last sample, the ground acceleration decreases to zero. The arrays are copied,
    # because kernels have no read-only arguments.
    end = [0.0] if settings.maxima.between else []
    first, second = np.append(first, end), np.append(second, end)
    # Each group contains oscillators with the same number of parts of a sampling interval. The
    # compiled kernel computes one group at a time.
    for indices, parts, table in elastic.groups(
        omega, damping, dt, settings.maxima, rotation.LANES
    ):
        peaks = np.empty((indices.size, rotation.ANGLES))
        scratch = rotation.scratch(first.size, parts)
        rotation.rotated_peaks.compiled(
            first,
            second,
            dt,
            parts,
            table,
            _directions(),
            int(settings.maxima.between),
            peaks,
            *scratch,
        )
        result[indices] = peaks
    return result


def _directions() -> Array:
    """Return the cosine and sine of each direction, measured from the first component, shape
    (2, ANGLES)."""
    angles = np.arange(rotation.ANGLES) * (math.pi / rotation.ANGLES)
    # The cosine of 90 degrees is set to 0 exactly, because np.cos(pi / 2) is 6e-17. The direction
    # is then exactly the second component.
    cosine = np.where(np.arange(rotation.ANGLES) == rotation.ANGLES // 2, 0.0, np.cos(angles))
    return np.array([cosine, np.sin(angles)])
