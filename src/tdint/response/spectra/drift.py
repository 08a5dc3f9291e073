"""Drift spectra: maximum story drift of uniform shear buildings as a function of their fundamental
period.

Iwan (1997) proposed the drift spectrum for a continuous shear beam. A uniform shear building
approaches this beam for a large number of stories. With one story, it is the oscillator of an
ordinary response spectrum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, Numbers, immutable
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record
from tdint.kernels.oscillators import modal_sums as drifts
from tdint.response.arguments import AnyRecord, damping_of, record_of
from tdint.response.defaults import HEIGHT_PERIOD, STORY_HEIGHT
from tdint.response.spectra import elastic
from tdint.response.spectra.inelastic import SHORTEST
from tdint.units import Quantity

# Maximum number of stories. Buildings have fewer; the story height or the period is probably wrong.
MAX_STORIES = 1000
# Maximum number of modes of a beam, 160 kB per period. More are only requested by mistake.
MAX_BEAM_MODES = 20_000

# Multiple of the fundamental frequency. Modes up to this frequency have omega h <= 1 for the time
# step h, which the search for maxima within a step requires.
_RESOLVED_FREQUENCY_RATIO = 20.0
# Minimum number of modes of a beam. All modes with periods above half a sampling interval are
# included in any case.
_MIN_BEAM_MODES = 64
# Maximum duration of the free vibration after a record, in fundamental periods. The sum of the
# amplitudes of the modes falls below the maximum earlier if the building is damped. Without
# damping, it does not decay, and most maxima occur in the first periods.
_LONGEST_VIBRATION = 10.0


@dataclass(frozen=True)
class HeightPeriod:
    """Relation of the fundamental period T (s) and the height H (m) of buildings, T = a H^b.

    The default, 0.0731 H^0.75, applies to moment frames of reinforced concrete and eccentrically
    braced steel frames in the Uniform Building Code of 1997 (Ct 0.0731), and to eccentrically
    braced and buckling-restrained steel frames in ASCE 7, table 12.8-2. Other rows of the table:
    0.0724 H^0.8 (steel moment frames), 0.0466 H^0.9 (concrete moment frames), 0.0488 H^0.75 (other
    systems).

    Attributes
    ----------
    a : float, default 0.0731
        Period of a building of height 1 m, s.
    b : float, default 0.75
        Exponent of the height, dimensionless.
    """

    a: float = HEIGHT_PERIOD[0]
    b: float = HEIGHT_PERIOD[1]

    def height(self, period: Array) -> Array:
        """Return the heights of buildings with fundamental periods (s), m.

        Parameters
        ----------
        period : ndarray
            Fundamental periods, s.

        Raises
        ------
        UsageError
            A height is zero or exceeds the range of floating-point numbers.
        """
        with np.errstate(all="ignore"):
            height = np.asarray((period / self.a) ** (1.0 / self.b))
        if not np.all(np.isfinite(height) & (height > 0.0)):
            raise UsageError(
                f"the relation T = {self.a:g} H^{self.b:g} leads to a height that is zero or too "
                "large for a floating-point number; use other coefficients or periods"
            )
        return height


@immutable
class DriftSpectrum(elastic.RecordSpectrum):
    """Drift spectrum of one record for a single damping ratio; arrays of shape (k,).

    For the continuous shear beam, `stories` and `story` are 0, and the peak is the drift at its
    base.

    Attributes
    ----------
    record : Record
        Ground motion.
    damping : float
        Damping ratio.
    periods : ndarray
        Fundamental periods, s.
    heights : ndarray
        Heights of the buildings, m.
    stories : ndarray of int
        Numbers of stories.
    peak_drift_ratio : ndarray
        Maximum story drift divided by the story height.
    story : ndarray of int
        Story with this maximum, from 1.
    roof_drift_ratio : ndarray
        Maximum roof displacement relative to the ground, divided by the height.
    """

    record: Record
    damping: elastic.DampingRatio
    periods: Annotated[Array, Quantity("s", "fundamental period", called="period")]
    heights: Annotated[Array, Quantity("m", "height of the building", called="height")]
    stories: NDArray[np.int64]
    peak_drift_ratio: Annotated[Array, Quantity("1", "largest story drift over story height")]
    story: Annotated[
        NDArray[np.int64],
        Quantity(
            "1",
            "story of the largest drift, from 1",
            lambda spectrum: np.where(spectrum.story > 0, spectrum.story, None),
        ),
    ]
    roof_drift_ratio: Annotated[
        Array, Quantity("1", "largest roof displacement relative to the ground, over the height")
    ]


def drift_spectrum(
    record: AnyRecord,
    periods: Numbers,
    damping: float | str = 0.05,
    *,
    stories: int | None = None,
    story_height: float = STORY_HEIGHT,
    height_period: HeightPeriod = HeightPeriod(),
    beam: bool = False,
) -> DriftSpectrum:
    """Compute the drift spectrum of a record.

    The buildings are linear. They have equal masses, story stiffnesses and story heights, and the
    same damping ratio in all modes. Their response is the sum of the modal responses, which are
    exact for a ground motion that is linear between its samples. Maxima between the samples are
    included, and the maxima of the free vibration after the last sample while it can exceed them,
    without damping for ten fundamental periods.

    Parameters
    ----------
    record : Record, str, Path or ObsPy trace
        Ground motion; the buildings are at rest at its first sample.
    periods : ndarray, shape (k,)
        Fundamental periods, s, positive.
    damping : float, default 0.05
        Damping ratio of every mode, in [0, 1).
    stories : int, optional
        Number of stories of every building. By default, it follows from the height and
        `story_height`.
    story_height : float, default 3.5
        Approximate story height, m, if `stories` is `None`. The number of stories is the height of
        the building divided by this value, rounded, at least 1. All stories have equal heights.
    height_period : HeightPeriod, optional
        Relation that determines the height of a building from its period. The default is that of
        `HeightPeriod`.
    beam : bool, default False
        True for the drift at the base of a continuous shear beam (Iwan 1997) instead of stories,
        with the same damping ratio in all modes. Without damping, this is Iwan's sum of waves,
        |v(t) - 2 v(t - T/2) + 2 v(t - T) - ...| / (4 H / T), with the ground velocity v, the
        period T and the height H.

    Returns
    -------
    DriftSpectrum
        Largest drift ratios of the stories at each period, shape (k,).

    Raises
    ------
    UsageError
        A parameter is out of range.
    RecordError
        The record is invalid or cannot be read.
    AnalysisError
        A period is too short or, for a beam, too long for the sampling interval of the record.
    """
    record, damping = record_of(record), damping_of(damping)
    periods = elastic.checked_periods(periods, zero=False)
    elastic.check_shortest(periods, record.dt, SHORTEST)
    heights = height_period.height(periods)
    pairs = list(zip(periods.tolist(), heights.tolist(), strict=True))
    buildings: Sequence[_Stories | _Beam]
    if beam:
        numbers = np.zeros(periods.size, dtype=np.int64)
        buildings = [
            _Beam(period, height, _beam_mode_count(period, record.dt)) for period, height in pairs
        ]
    else:
        numbers = number_of_stories(heights, stories, story_height)
        buildings = [_Stories(*pair, n) for pair, n in zip(pairs, numbers.tolist(), strict=True)]
    peak, story, roof = _evaluate(record, buildings, damping).T
    story_number = np.zeros_like(numbers) if beam else story.astype(np.int64) + 1
    return DriftSpectrum(record, damping, periods, heights, numbers, peak, story_number, roof)


def number_of_stories(
    heights: Array, stories: int | None, story_height: float
) -> NDArray[np.int64]:
    """Return the number of stories of each building.

    Parameters
    ----------
    stories : int | None
        Number of stories of all buildings; None to divide the heights by `story_height`.
    story_height : float
        Approximate story height, m.

    Raises
    ------
    UsageError
        The story height is not positive, or a building would have more than MAX_STORIES.
    """
    if stories is None:
        if not 0.0 < story_height < math.inf:
            raise UsageError(
                f"the story height must be a positive number of meters, got {story_height!r}"
            )
        counts = np.maximum(np.floor(heights / story_height + 0.5), 1.0)
    else:
        counts = np.full(heights.size, float(stories))
    if not (counts.min() >= 1.0 and counts.max() <= MAX_STORIES):
        raise UsageError(
            f"the number of stories must be from 1 to {MAX_STORIES}, got {counts.max():.6g} for a "
            f"building of {heights.max():.6g} m; use shorter periods, a larger story height or "
            "`stories`"
        )
    return counts.astype(np.int64)


@dataclass(frozen=True)
class _Stories:
    """Building with n equal stories.

    The ordinate of mode j at floor s is sin(s theta_j), with theta_j = (2j - 1) pi / (2n + 1). The
    modes are computed on access, because the modes of all buildings together would need an
    excessive amount of memory.

    Attributes
    ----------
    period, height : float
        Fundamental period, s, and height, m.
    """

    period: float
    height: float
    n: int

    @property
    def theta(self) -> Array:
        """Angles theta_j of the modes, rad, shape (n,)."""
        return (2.0 * np.arange(1, self.n + 1) - 1.0) * math.pi / (2 * self.n + 1)

    @property
    def omega(self) -> Array:
        """Circular frequencies 2 sqrt(k/m) sin(theta_j / 2), rad/s, with k/m from the period."""
        sine = np.sin(0.5 * self.theta)
        return np.asarray(2.0 * math.pi / self.period * sine / sine[0])

    @property
    def shapes(self) -> Array:
        """Contributions of the modes to the drift ratios of the stories and, in the last column, to
        the roof drift ratio, 1/m, shape (modes, n + 1).

        A contribution is multiplied by the displacement of the oscillator of the mode, m.
        """
        # Ordinates of the modes at the ground and all floors.
        floors = np.sin(np.outer(self.theta, np.arange(self.n + 1)))
        participation = floors.sum(axis=1) / np.square(floors).sum(axis=1)
        drift_ratios = np.diff(floors, axis=1) * (self.n / self.height)
        return np.asarray(
            participation[:, None] * np.column_stack([drift_ratios, floors[:, -1] / self.height])
        )

    @property
    def static(self) -> Array:
        """Static contribution of omitted modes, shape (columns,); zero, because no mode is
        omitted."""
        return np.zeros(self.n + 1)


@dataclass(frozen=True)
class _Beam:
    """Shear beam with the modes sin((2j - 1) pi x / 2H) at the height x; its responses are the
    drift ratio at the base and the roof drift ratio.

    Attributes
    ----------
    period, height : float
        Fundamental period, s, and height H, m.
    """

    period: float
    height: float
    modes: int

    @property
    def odd_numbers(self) -> Array:
        """Numbers 2j - 1 of the modes, shape (modes,)."""
        return np.arange(1.0, 2.0 * self.modes, 2.0)

    @property
    def omega(self) -> Array:
        """Circular frequencies of the modes, rad/s."""
        return 2.0 * math.pi / self.period * self.odd_numbers

    @property
    def shapes(self) -> Array:
        """Contributions of the modes to the drift ratio at the base and to the roof drift ratio,
        1/m, shape (modes, 2).
        """
        # The participation factor of mode j is 4 / ((2j - 1) pi), the slope of its shape at the
        # base (2j - 1) pi / 2H, and its ordinate at the roof +1 or -1, alternating.
        signs = np.where(np.arange(self.modes) % 2 == 0, 1.0, -1.0)
        return (
            np.column_stack([np.full(self.modes, 2.0), 4.0 / math.pi * signs / self.odd_numbers])
            / self.height
        )

    @property
    def static(self) -> Array:
        """Static contribution of the omitted modes for a unit acceleration, s^2/m, shape (2,).

        The static responses of the complete beam are the drift ratio H / c^2 at the base and the
        roof drift ratio H / (2 c^2), with the height H and the wave velocity c. The contributions
        of the included modes are subtracted.
        """
        velocity = 4.0 * self.height / self.period  # the period is 4 H / c
        all_modes = np.array([self.height, 0.5 * self.height]) / velocity**2
        return np.asarray(all_modes - (self.shapes / np.square(self.omega)[:, None]).sum(axis=0))


def _beam_mode_count(period: float, dt: float) -> int:
    """Return the number of modes of a beam that are included, at least `_MIN_BEAM_MODES`;
    AnalysisError if more than MAX_BEAM_MODES are required.

    All modes with periods of at least half a sampling interval are included. Modes with shorter
    periods follow the ground acceleration statically (`_Beam.static`).
    """
    # The period of mode j is period / (2 j - 1).
    count = max(_MIN_BEAM_MODES, math.ceil(period / dt + 0.5))
    if count > MAX_BEAM_MODES:
        raise AnalysisError(
            f"a beam with the period {period:.6g} s has too many modes for the sampling interval "
            f"of {dt:.6g} s; use periods up to {MAX_BEAM_MODES * dt:.6g} s"
        )
    return count


def _evaluate(record: Record, buildings: Sequence[_Stories | _Beam], damping: float) -> Array:
    """Return the maximum drift ratio, the index of its story from 0, and the maximum roof drift
    ratio of each building under a ground motion, shape (buildings, 3).
    """
    omegas = [building.omega for building in buildings]
    # Divide the sampling interval into parts, so that omega h <= 1 for the resolved modes.
    parts = [
        max(1, math.ceil(min(omega[-1], _RESOLVED_FREQUENCY_RATIO * omega[0]) * record.dt))
        for omega in omegas
    ]
    steps = [np.full(omega.size, record.dt / p) for omega, p in zip(omegas, parts, strict=True)]
    boundaries = np.cumsum([omega.size for omega in omegas])[:-1]  # between the buildings
    # Compute the table of modes for all buildings together, because one call for each building is
    # slower.
    omega = np.concatenate(omegas)
    all_modes = elastic.recursion_table(omega, np.concatenate(steps), damping, more=2)
    all_modes[drifts.OMEGA], all_modes[drifts.DAMPING] = omega, damping
    tables = np.split(all_modes, boundaries, axis=1)
    ground = record.acceleration.copy()
    results = np.empty((len(buildings), drifts.RESULTS))
    for building, p, table, result in zip(buildings, parts, tables, results, strict=True):
        # The kernel processes BLOCK modes together. Modes of zeros complete the last block.
        padding = -table.shape[1] % drifts.BLOCK
        drifts.largest_drifts.compiled(
            ground,
            p,
            record.dt / p,
            np.pad(table, ((0, 0), (0, padding))),
            np.pad(building.shapes, ((0, padding), (0, 0))),
            building.static,
            result,
            *drifts.scratch(
                ground.size * p + math.ceil(_LONGEST_VIBRATION * building.period * p / record.dt),
                table.shape[1] + padding,
                building.shapes.shape[1],
            ),
        )
    return results


def parse_height_period(text: str) -> HeightPeriod:
    """Parse the coefficients of T = a H^b from `a,b`.

    Raises
    ------
    UsageError
        The text is not two positive numbers.
    """
    try:
        a, b = (float(part) for part in text.split(","))
    except ValueError:
        a = b = math.nan
    if not (0.0 < a < math.inf and 0.0 < b < math.inf):
        raise UsageError(
            "a height-period relation must be two positive numbers, such as 0.0731,0.75, got "
            f"{text!r}"
        )
    return HeightPeriod(a, b)
