"""What the runs of one record say: its curve of drift over intensity, capacities, whether the building stands again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tdint.arrays import Array
from tdint.campaign.ida.levels import below_collapse, first_collapse, last_stable
from tdint.campaign.ida.runs import IdaRun
from tdint.ground_motion.record import Record


@dataclass(frozen=True)
class Capacity:
    """The intensity at which a building first exceeds a drift ratio under a record.

    Attributes
    ----------
    threshold : float
        The drift ratio; the collapse drift stands for collapse, by whatever cause.
    capacity : float
        The intensity; of a censored one what it is known to lie above; nan if nothing is known.
    lower, upper : float
        Levels next to it at which the building was run: below, not exceeded; above, exceeded (nan if censored).
    censored : bool
        Whether it was not exceeded up to the largest level.
    """

    threshold: float
    capacity: float
    lower: float
    upper: float
    censored: bool


@dataclass(frozen=True)
class IdaCurve:
    """The runs of a record.

    Attributes
    ----------
    record : Record
        As it was read; the runs scale it.
    runs : tuple of IdaRun
        From the lowest level.
    collapse_drift : float
        Drift ratio of collapse.
    damage, left : float
        Of a building that a mainshock has damaged: the drift ratio that it has reached, and that it is left with.
    """

    record: Record
    runs: tuple[IdaRun, ...]
    collapse_drift: float
    damage: float = 0.0
    left: float = 0.0

    @cached_property
    def stable(self) -> list[IdaRun]:
        """The runs below the first collapse at which the building stands."""
        return list(below_collapse(self.runs))

    @property
    def resurrection(self) -> bool:
        """Whether the building stands again at a level that was run above its first collapse.

        Two are tried for that, 1.25 and 1.5 times it, others are met in the search; of those between nothing is known.
        """
        collapse = first_collapse(self.runs)
        return collapse is not None and any(run.stable and run.im > collapse.im for run in self.runs)

    @cached_property
    def collapse(self) -> Capacity:
        """The capacity against collapse: the geometric mean of the last level that stands and the first that falls."""
        low, high = last_stable(self.runs), first_collapse(self.runs)
        lower = math.nan if low is None else low.im
        if high is None:
            return Capacity(self.collapse_drift, lower, lower, math.nan, censored=True)
        return Capacity(self.collapse_drift, math.sqrt(lower * high.im), lower, high.im, censored=False)

    def capacity(self, threshold: float) -> Capacity:
        """The capacity for a drift ratio: where the curve first reaches it, straight on logarithmic axes.

        A damaged building that is left with as much has none (nan).

        A building that collapses before has the capacity against collapse: no line leads to the drift of a run that
        ran away.
        """
        if threshold >= self.collapse_drift:
            return self.collapse
        for i, run in enumerate(self.stable):
            if run.drift_ratio < threshold:
                continue
            if threshold <= self.left:
                return Capacity(threshold, math.nan, math.nan, math.nan, censored=False)
            if i == 0:  # From the origin, or the drift that was left, a straight line.
                part = (threshold - self.left) / (run.drift_ratio - self.left)
                return Capacity(threshold, run.im * part, 0.0, run.im, censored=False)
            before = self.stable[i - 1]
            part = math.log(threshold / before.drift_ratio) / math.log(run.drift_ratio / before.drift_ratio)
            return Capacity(threshold, before.im * (run.im / before.im) ** part, before.im, run.im, censored=False)
        found = self.collapse
        return Capacity(threshold, found.capacity, found.lower, found.upper, found.censored)

    def intensity_at(self, drift_ratios: Array) -> Array:
        """The capacities for drift ratios, shape (k,): inf where censored, nan where nothing is known."""
        found = [self.capacity(drift) for drift in drift_ratios.tolist()]
        values = np.array([math.inf if one.censored and one.capacity > 0.0 else one.capacity for one in found])
        return np.where(drift_ratios <= self.left, 0.0, values)


def fractiles(curves: Sequence[IdaCurve], drift_ratios: Array, parts: Sequence[float] = (0.16, 0.5, 0.84)) -> Array:
    """Fractiles over the records of the intensity that leads to each drift ratio, shape (len(parts), k).

    A fractile is nan from where on it lies among censored capacities. Between two records lies a straight line of the
    logarithm.
    """
    known = [curve for curve in curves if curve.stable]
    result = np.full((len(parts), drift_ratios.size), math.nan)
    if not known:
        return result
    ranked = np.sort([curve.intensity_at(drift_ratios) for curve in known], axis=0)
    for row, part in zip(result, parts, strict=True):
        place = part * (len(known) - 1)
        low, high = ranked[math.floor(place)], ranked[math.ceil(place)]
        sure = np.isfinite(low) & np.isfinite(high)
        sure &= low > 0.0
        row[sure] = low[sure] * (high[sure] / low[sure]) ** (place - math.floor(place))
    return result
