"""The curve of a building under one record in an incremental dynamic analysis: its runs, which
level comes next, its capacities; and a building that a mainshock has damaged before."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from tdint.analysis.run.demands import RUN_WITH_ERROR, demands
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.sequence import ShockSequence, sequence_of, shocks_of
from tdint.analysis.run.together import Subject
from tdint.arrays import Array, cached_property
from tdint.campaign.batch import RunRow
from tdint.campaign.pairs import LARGER, MEAN, combine
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record
from tdint.model.damage_states import DONE, FALLEN

# ---- The curve of a building under one record: its runs at levels of intensity, which level comes
# next, and what they say
#
# A level is a function of the runs so far alone, so that a study goes on where it ended: hunt,
# bisect, fill (Vamvatsikos and Cornell 2002, doi 10.1002/eqe.141; 2004, doi 10.1193/1.1737737), and
# then look above the capacity, where a building may stand again (structural resurrection).

_OF_ROW = {
    "drift_ratio": "peak_drift_ratio",
    "acceleration": "peak_absolute_acceleration",
    "residual_drift_ratio": "residual_drift_ratio",
}
"""Demands of an `IdaRun`, and what `RunRow` calls them."""


@dataclass(frozen=True)
class IdaRun:
    """A run of an incremental dynamic analysis.

    Attributes
    ----------
    im : float
        Intensity, in the unit of its measure.
    scale : float
        Factor on the record.
    status : str
        As of `tdint run`; one that is neither `done` nor a collapse has no result, also with a
        finer step.
    drift_ratio, acceleration, residual_drift_ratio : float
        Largest drift ratio, absolute acceleration (m/s^2) and drift ratio at the end; nan without a
        result.
    finer : int
        How often the step was halved, for the run had no result.
    energy_error : float
        Imbalance over the largest input energy; nan without a result.
    drift_ratio_error, acceleration_error, residual_drift_ratio_error : float
        Estimated errors; nan where there are none.
    """

    im: float
    scale: float
    status: str
    drift_ratio: float = math.nan
    acceleration: float = math.nan
    residual_drift_ratio: float = math.nan
    finer: int = 0
    energy_error: float = math.nan
    drift_ratio_error: float = math.nan
    acceleration_error: float = math.nan
    residual_drift_ratio_error: float = math.nan

    @classmethod
    def of(cls, im: float, row: RunRow) -> IdaRun:
        """What the row of a run at a level says."""
        names = [column.name for column in RUN_WITH_ERROR]
        errors = dict(zip(names, row.errors, strict=False))
        values: dict[str, float | None] = {"energy_error": row.energy_error}
        for demand, name in _OF_ROW.items():
            values |= {demand: getattr(row, name), f"{demand}_error": errors.get(name)}
        numbers = {
            name: math.nan if value is None else float(value) for name, value in values.items()
        }
        return cls(im, row.scale, row.status, finer=row.repeats, **numbers)

    @property
    def stable(self) -> bool:
        """Whether the building stood."""
        return self.status == DONE

    @property
    def collapsed(self) -> bool:
        """Whether the building collapsed, by its own motion; every other status but `done` says
        nothing of it."""
        return self.status in FALLEN


_HUNT = 1.5
"""Ratio of neighbouring levels while no collapse is known."""

_MOST_HUNTS = 40
_FILL = 1.2
"""Ratio of drifts of neighbouring levels up to which nothing is put between them."""

_PROBES = (1.25, 1.5)
"""Levels above the first collapse at which the building may stand again, over its level."""

_NEAR = 0.01
"""Levels that differ by less than this part, of themselves or of their bracket, are the same."""

_PLACES = (0.5, 0.25, 0.75, 0.375, 0.625)
"""Where between two levels, in the logarithm, a run is tried; the next one where the run before had
no result."""

MOST_RUNS = 300  # a curve takes 10 to 40; more means that it does not end


@dataclass(frozen=True)
class LevelSearch:
    """What decides on the levels.

    Attributes
    ----------
    start : float
        The first level: the building should remain elastic.
    precision : float
        Bracket of the capacity, upper over lower level less 1.
    lowest_drift : float
        A drift ratio that one run at least stays below: the lowest threshold.
    most : float
        The largest level; capacities above it are censored.
    """

    start: float
    precision: float = 0.05
    lowest_drift: float = math.inf
    most: float = math.inf

    def next(self, runs: Sequence[IdaRun]) -> float | None:
        """The next level, None if all is known; `runs` in any order.

        The hunt and fill of Vamvatsikos and Cornell (2004): up to the first collapse, then between
        the levels that bracket it, below until one run stays under the lowest threshold, between
        drifts that differ by much, and last above the first collapse, where the building may stand
        again.
        """
        if not runs:
            return min(self.start, self.most)
        if len(runs) >= MOST_RUNS:
            return None
        runs = sorted(runs, key=lambda run: run.im)
        standing, collapse = list(below_collapse(runs)), first_collapse(runs)
        lowest, highest = runs[0].im, runs[-1].im
        least, largest = self.start / _HUNT**_MOST_HUNTS, self.start * _HUNT**_MOST_HUNTS

        # Hunt: up until it collapses; down until it stands.
        if collapse is None and highest < self.most and highest <= largest:
            return min(highest * _HUNT, self.most)
        if collapse and not standing and lowest > least:
            return lowest / _HUNT
        # Bisect the capacity.
        if collapse and standing and collapse.im > standing[-1].im * (1.0 + self.precision):
            level = _between(standing[-1].im, collapse.im, runs)
            if level is not None:
                return level
        # Descend until a drift is below the lowest threshold: in proportion, but by no more than a
        # tenth at once.
        if standing and standing[0].drift_ratio >= self.lowest_drift and lowest >= least:
            return lowest * max(
                0.1, min(1.0 / _HUNT, 0.8 * self.lowest_drift / standing[0].drift_ratio)
            )
        # Fill between neighbours whose drifts differ by much.
        for low, high in pairwise(standing):
            small, large = sorted((low.drift_ratio, high.drift_ratio))
            if large > _FILL * small and high.im > low.im * (1.0 + self.precision):
                level = _between(low.im, high.im, runs)
                if level is not None:
                    return level
        # Probe above the first collapse.
        for level in (probe * collapse.im for probe in _PROBES) if collapse else ():
            if level <= self.most and all(abs(run.im - level) > _NEAR * level for run in runs):
                return level
        return None


def first_collapse(runs: Sequence[IdaRun]) -> IdaRun | None:
    """The lowest level at which the building collapses."""
    return min((run for run in runs if run.collapsed), key=lambda run: run.im, default=None)


def below_collapse(runs: Sequence[IdaRun]) -> Iterator[IdaRun]:
    """The levels below the first collapse at which the building stands, from the lowest."""
    collapse = first_collapse(runs)
    limit = math.inf if collapse is None else collapse.im
    return (run for run in sorted(runs, key=lambda run: run.im) if run.stable and run.im < limit)


def _between(low: float, high: float, runs: Sequence[IdaRun]) -> float | None:
    """A level between two neighbours that was not tried without a result."""
    tried = [run.im for run in runs if low < run.im < high]
    near = _NEAR * math.log(high / low)
    levels = (low * (high / low) ** place for place in _PLACES)
    return next(
        (level for level in levels if all(abs(math.log(im / level)) > near for im in tried)), None
    )


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
        Levels next to it at which the building was run: below, not exceeded; above, exceeded (nan
        if censored).
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
        Of a building that a mainshock has damaged: the drift ratio that it has reached, and that it
        is left with.
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

        Two are tried for that, 1.25 and 1.5 times it, others are met in the search; of those
        between nothing is known.
        """
        collapse = first_collapse(self.runs)
        return collapse is not None and any(
            run.stable and run.im > collapse.im for run in self.runs
        )

    @cached_property
    def collapse(self) -> Capacity:
        """The capacity against collapse: the geometric mean of the last level that stands and the
        first that falls."""
        lower, high = self.stable[-1].im if self.stable else math.nan, first_collapse(self.runs)
        if high is None:
            return Capacity(self.collapse_drift, lower, lower, math.nan, censored=True)
        return Capacity(
            self.collapse_drift, math.sqrt(lower * high.im), lower, high.im, censored=False
        )

    def capacity(self, threshold: float) -> Capacity:
        """The capacity for a drift ratio: where the curve first reaches it, straight on logarithmic
        axes.

        A damaged building that is left with as much has none (nan).

        A building that collapses before has the capacity against collapse: no line leads to the
        drift of a run that ran away.
        """
        if threshold >= self.collapse_drift:
            return self.collapse
        # The first crossing counts: a curve may come back below a drift at a higher level.
        for i, run in enumerate(self.stable):
            if run.drift_ratio < threshold:
                continue
            if threshold <= self.left:
                return Capacity(threshold, math.nan, math.nan, math.nan, censored=False)
            if i == 0:  # From the origin, or the drift that was left, a straight line.
                part = (threshold - self.left) / (run.drift_ratio - self.left)
                return Capacity(threshold, run.im * part, 0.0, run.im, censored=False)
            before = self.stable[i - 1]
            part = math.log(threshold / before.drift_ratio) / math.log(
                run.drift_ratio / before.drift_ratio
            )
            return Capacity(
                threshold,
                before.im * (run.im / before.im) ** part,
                before.im,
                run.im,
                censored=False,
            )
        collapse = self.collapse
        return Capacity(
            threshold, collapse.capacity, collapse.lower, collapse.upper, collapse.censored
        )

    def intensity_at(self, drift_ratios: Array) -> Array:
        """The capacities for drift ratios, shape (k,): inf where censored, nan where nothing is
        known."""
        capacities = [self.capacity(drift) for drift in drift_ratios.tolist()]
        values = np.array(
            [
                math.inf if limit.censored and limit.capacity > 0.0 else limit.capacity
                for limit in capacities
            ]
        )
        return np.where(drift_ratios <= self.left, 0.0, values)


@dataclass(frozen=True)
class PairCurve(IdaCurve):
    """The curve of a pair, made from the curves of its two components.

    Its runs are at the levels of both components up to the first collapse of one of them, with the
    larger or the mean drift ratio; between its levels a component's drift ratio is interpolated on
    logarithmic axes. The building collapses under the pair where it first does under a component.

    Attributes
    ----------
    parts : tuple of two IdaCurve
        The components.
    demand : str
        `larger` or `mean` (`tdint.campaign.pairs`).
    """

    parts: tuple[IdaCurve, IdaCurve] | tuple[()] = ()
    demand: str = LARGER

    @classmethod
    def of(cls, first: IdaCurve, second: IdaCurve, demand: str) -> Self:
        """Return the curve of two components."""
        parts = first, second
        highest = min(part.stable[-1].im if part.stable else 0.0 for part in parts)
        levels = sorted({run.im for part in parts for run in part.stable if run.im <= highest})
        drifts = combine(np.array([_drifts_at(part, levels) for part in parts]), demand)
        runs = (
            IdaRun(im, math.nan, DONE, drift)
            for im, drift in zip(levels, drifts.tolist(), strict=True)
        )
        left = float(combine(np.array([part.left for part in parts]), demand))
        return cls(
            first.record,
            tuple(runs),
            first.collapse_drift,
            first.damage,
            left,
            parts=parts,
            demand=demand,
        )

    @property
    def resurrection(self) -> bool:
        """Whether the building stands again above its first collapse under a component."""
        return any(part.resurrection for part in self.parts)

    @cached_property
    def collapse(self) -> Capacity:
        """The smaller capacity of the two components against collapse."""
        return min((part.collapse for part in self.parts), key=lambda limit: limit.capacity)

    def capacity(self, threshold: float) -> Capacity:
        """The capacity for a drift ratio: with the larger demand the smaller one of the
        components, with the mean demand the one of the mean curve."""
        if threshold >= self.collapse_drift:
            return self.collapse
        if self.demand == MEAN:
            return super().capacity(threshold)
        limits = [part.capacity(threshold) for part in self.parts]
        unknown = [limit for limit in limits if math.isnan(limit.capacity)]
        return unknown[0] if unknown else min(limits, key=lambda limit: limit.capacity)


def _drifts_at(curve: IdaCurve, levels: Sequence[float]) -> Array:
    """Return the drift ratios of a curve at levels up to its last stable one, shape (k,)."""
    if not levels:
        return np.empty(0)
    im = np.array([run.im for run in curve.stable])
    drift = np.array([run.drift_ratio for run in curve.stable])
    at = np.asarray(levels)
    # From the drift that was left a straight line to the first run, then logarithmic axes.
    first = curve.left + (drift[0] - curve.left) * at / im[0]
    beyond = np.exp(np.interp(np.log(at), np.log(im), np.log(drift)))
    return np.asarray(np.where(at < im[0], first, beyond))


def fractiles(
    curves: Sequence[IdaCurve], drift_ratios: Array, parts: Sequence[float] = (0.16, 0.5, 0.84)
) -> Array:
    """Fractiles over the records of the intensity that leads to each drift ratio, shape
    (len(parts), k).

    A fractile is nan from where on it lies among censored capacities. Between two records lies a
    straight line of the logarithm.
    """
    standing = [curve for curve in curves if curve.stable]
    result = np.full((len(parts), drift_ratios.size), math.nan)
    if not standing:
        return result
    ranked = np.sort([curve.intensity_at(drift_ratios) for curve in standing], axis=0)
    for row, part in zip(result, parts, strict=True):
        place = part * (len(standing) - 1)
        low, high = ranked[math.floor(place)], ranked[math.ceil(place)]
        sure = np.isfinite(low) & np.isfinite(high)
        sure &= low > 0.0
        row[sure] = low[sure] * (high[sure] / low[sure]) ** (place - math.floor(place))
    return result


# ---- Damage

_DAMAGE_HUNT = 1.3
_HUNTS = 60
_EXACT = 1e-4
"""Part of the drift that is asked for by which it may be missed."""

_HALVINGS = 60  # 2^-60: rounding alone is left


@dataclass(frozen=True)
class Mainshock:
    """A ground motion before each of a study's, scaled so that the building reaches some drift
    ratios.

    Attributes
    ----------
    records : tuple of Record
        Its horizontal components; one goes with all records, of several the one of a record's own
        component.
    damages : tuple of float
        The drift ratios.
    """

    records: tuple[Record, ...]
    damages: tuple[float, ...]

    def before(self, record: Record) -> Record:
        """The component that goes with a record.

        Raises
        ------
        UsageError
            There is none.
        """
        if len(self.records) == 1:
            return self.records[0]
        for main in self.records:
            if main.component == record.component:
                return main
        names = ", ".join(main.component for main in self.records)
        raise UsageError(
            f"{self.records[0].source}: no component {record.component or 'of that kind'} to go "
            f"with {record.name}; it has {names}: name one with --component"
        )


@dataclass(frozen=True)
class DamagedState:
    """What a mainshock does to a building.

    Attributes
    ----------
    record : Record
        The mainshock, scaled.
    drift : float
        The drift ratio that it is scaled to.
    left : float
        The largest drift ratio that it leaves.
    rest : float
        Time from its last sample until the building is at rest, s.
    """

    record: Record
    drift: float
    left: float
    rest: float


def damaged(
    subject: Subject, main: Record, drift: float, *, first: float, dt: float | None
) -> DamagedState:
    """Scale a mainshock so that the largest drift ratio of a building first reaches a value.

    Parameters
    ----------
    first : float
        Factor from which on it is looked for upwards.

    Raises
    ------
    AnalysisError
        The building collapses before.
    """

    # A failed run and a collapse count as beyond any drift: the factor lies below theirs.
    def reached(factor: float) -> float:
        case = subject.case(main, factor)
        try:
            response = case.march(case.steps(dt, main.duration))
        except FailedRun:
            return math.inf
        return math.inf if response.collapse else demands(response.stories).drift_ratio.value

    # Hunt upwards until the drift is reached, then halve; a drift that is passed by is that of no
    # factor.
    low, high = 0.0, first
    for _ in range(_HUNTS):
        if reached(high) >= drift:
            break
        low, high = high, _DAMAGE_HUNT * high
    for _ in range(_HALVINGS):
        factor = 0.5 * (low + high)
        reached_drift = reached(factor)
        if abs(reached_drift - drift) <= _EXACT * drift:
            break
        low, high = (factor, high) if reached_drift < drift else (low, factor)
    else:
        raise AnalysisError(
            f"{main.name}: the building does not reach a drift of {100.0 * drift:g} % under any "
            "factor on it without collapse"
        )

    # The mainshock by itself, until the building is at rest: what it leaves.
    scaled = main.scaled(factor)
    case = subject.case(scaled)
    sequence = sequence_of(case, [scaled, scaled], dt=dt)
    alone = ShockSequence(sequence.records[:1], (0,))
    joined = case.under(alone.whole)
    # The second one stands where the building has come to rest: that is how long it takes.
    rest = (sequence.starts[1] - scaled.acceleration.size + 1) * scaled.dt
    (shock,) = shocks_of(joined, alone, joined.steps(dt, scaled.duration + rest))
    return DamagedState(scaled, drift, demands(shock.stories).residual_drift_ratio.value, rest)
