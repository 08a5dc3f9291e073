"""IDA curves: responses of a building under one record at increasing levels of intensity.

This module contains the runs of a curve, the search for the levels of the next runs, and the
capacities of a curve: the intensities where the building reaches drift ratios or collapses. It also
computes the state of a building that a mainshock has damaged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np

from tdint.arrays import Array, cached_property
from tdint.errors import AnalysisError, UsageError
from tdint.fractiles import fractiles
from tdint.ground_motion.record import Record
from tdint.model.status import DONE, FALLEN
from tdint.response.pairs import LARGER, MEAN, demands_of_motions
from tdint.response.runs.batch import Subject
from tdint.response.runs.case import extend_to_rest
from tdint.response.runs.demands import demands
from tdint.response.runs.outcome import FailedRun
from tdint.response.runs.run_values import RUN_WITH_ERROR
from tdint.response.runs.sequence import EventSequence, event_responses, sequence_of
from tdint.studies.campaign.chunks import RunRow

# ---- Curve of a building under one record: runs at levels of intensity, and search for levels
#
# A level depends only on the preceding runs, so that an interrupted study can continue. The search
# increases the level to collapse (hunt), bisects the bracket of the collapse, fills gaps
# (Vamvatsikos and Cornell 2002, doi 10.1002/eqe.141; 2004, doi 10.1193/1.1737737), and then tries
# levels above the capacity, where a building may not collapse (structural resurrection).

_ROW_NAMES = {
    "drift_ratio": "peak_drift_ratio",
    "acceleration": "peak_absolute_acceleration",
    "residual_drift_ratio": "residual_drift_ratio",
}
"""Name of a value in `RunRow` by the name of the same demand in `IdaRun`."""


@dataclass(frozen=True)
class IdaRun:
    """Run of an incremental dynamic analysis.

    Attributes
    ----------
    im : float
        Intensity, in the unit of its measure.
    status : str
        Status as for `tdint run`. If it is not `done` and not a collapse, the run has no result,
        even with a smaller time step.
    drift_ratio, acceleration, residual_drift_ratio : float
        Maximum drift ratio, maximum absolute acceleration (m/s^2) and residual drift ratio; NaN
        without a result.
    finer : int
        Number of times that the run was repeated with half the time step because it failed.
    energy_error : float
        Energy imbalance divided by the maximum input energy; NaN without a result.
    drift_ratio_error, acceleration_error, residual_drift_ratio_error : float
        Estimated errors; NaN if not estimated.
    limit_ratios : tuple of float
        Maximum ratio of demand to limit over the attachments or links, for each limit of the study;
        empty without limits.
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
    limit_ratios: tuple[float, ...] = ()

    @classmethod
    def from_row(cls, im: float, row: RunRow) -> IdaRun:
        """Return the run from a row of the table of runs."""
        # `row.errors` is empty if errors were not estimated.
        error_names = [column.name for column in RUN_WITH_ERROR]
        errors = dict(zip(error_names, row.errors, strict=False))
        values: dict[str, float | None] = {"energy_error": row.energy_error}
        for demand, row_name in _ROW_NAMES.items():
            values[demand] = getattr(row, row_name)
            values[f"{demand}_error"] = errors.get(row_name)
        float_values: dict[str, Any] = {
            name: math.nan if value is None else float(value) for name, value in values.items()
        }
        return cls(im, row.scale, row.status, finer=row.repeats, **float_values)

    @property
    def stable(self) -> bool:
        """True if the analysis was completed without collapse. False after a collapse and for a run
        without a result."""
        return self.status == DONE

    @property
    def collapsed(self) -> bool:
        """True if the building collapsed. False if it did not collapse, and for a run without a
        result."""
        return self.status in FALLEN


_HUNT = 1.5
"""Ratio of successive levels until the first collapse is bracketed."""

_MAX_HUNTS = 40
"""Maximum number of increases, or decreases, of the level by the ratio `_HUNT`."""

_GAP_RATIO = 1.2
"""Maximum ratio of the drifts of adjacent levels; above it, a level is added between them."""

_PROBES = (1.25, 1.5)
"""Levels above the first collapse, divided by the level of this collapse, at which the search
checks if the building survives again (structural resurrection)."""

_EQUAL_LEVELS = 0.01
"""Relative difference below which two levels are considered equal, so that the building is not run
two times at almost the same level."""

_POSITIONS = (0.5, 0.25, 0.75, 0.375, 0.625)
"""Positions between two levels on a logarithmic scale at which a run is tried, in order. The next
position is used if the preceding run had no result."""

MOST_RUNS = 300
"""Maximum number of runs of a curve. A curve usually needs 10 to 40 runs."""


@dataclass(frozen=True)
class LevelSearch:
    """Search for the levels of intensity where a building is run under one record.

    Attributes
    ----------
    start : float
        First level, where the building should remain elastic.
    precision : float
        As in `tdint.studies.ida.ida.IdaSettings`.
    lowest_drift : float
        Lowest drift ratio for which a capacity is computed. The search decreases the level until
        the drift ratio of a run is smaller. Infinity: no such drift ratio.
    max_level : float
        Maximum level. Capacities above this level are censored.
    """

    start: float
    precision: float = 0.05
    lowest_drift: float = math.inf
    max_level: float = math.inf

    def next(self, runs: Sequence[IdaRun]) -> float | None:
        """Return the level of the next run; None if the search is complete.

        The levels follow the hunt and fill algorithm of Vamvatsikos and Cornell (2004). They
        increase up to the first collapse and then bisect the bracket of the collapse. They decrease
        until a run is below the lowest threshold, fill gaps between drifts, and finally probe above
        the first collapse for resurrection. The number of levels in each direction is limited, also
        if the building never collapses or always collapses.

        Parameters
        ----------
        runs : sequence of IdaRun
            Completed runs, in any order.
        """
        if not runs:
            return min(self.start, self.max_level)
        if len(runs) >= MOST_RUNS:
            return None
        runs = sorted(runs, key=lambda run: run.im)
        # `stable` are the runs without collapse below the first collapse.
        stable, collapse = list(below_collapse(runs)), first_collapse(runs)
        lowest, highest = runs[0].im, runs[-1].im
        # Range of the levels, relative to the first level. A step is allowed while the present
        # highest (lowest) level is within this range; the last step may leave it.
        hunt_range: float = _HUNT**_MAX_HUNTS

        # Hunt: increase the level until collapse, or decrease it until there is no collapse.
        if collapse is None and highest < self.max_level and highest <= self.start * hunt_range:
            return min(highest * _HUNT, self.max_level)
        if collapse and not stable and lowest > self.start / hunt_range:
            return lowest / _HUNT
        # Bisect the bracket of the collapse capacity. `_between` returns None if runs at all
        # positions in the bracket had no result; then the search continues with the next task.
        if collapse and stable and collapse.im > stable[-1].im * (1.0 + self.precision):
            level = _between(stable[-1].im, collapse.im, runs)
            if level is not None:
                return level
        # Decrease the level until a drift is below the lowest threshold. If the drift is
        # proportional to the level, the next drift is 0.8 times the threshold; the level decreases
        # at least by the ratio of the hunt and at most to a tenth. The lowest level is multiplied,
        # not the level of `stable[0]`, so that the level is new if the lowest runs had no result.
        if (
            stable
            and stable[0].drift_ratio >= self.lowest_drift
            and lowest >= self.start / hunt_range
        ):
            proportional = 0.8 * self.lowest_drift / stable[0].drift_ratio
            return lowest * max(0.1, min(1.0 / _HUNT, proportional))
        return self._level_in_gap(stable, runs) or self._probe_level(collapse, runs)

    def _level_in_gap(self, stable: Sequence[IdaRun], runs: Sequence[IdaRun]) -> float | None:
        """Return a level between two adjacent levels where the drift ratios differ by more than
        a factor of 1.2; None if no such gap remains.

        `stable` contains the runs below the first collapse in ascending order of levels.
        """
        for low, high in pairwise(stable):
            small, large = sorted((low.drift_ratio, high.drift_ratio))
            if large > _GAP_RATIO * small and high.im > low.im * (1.0 + self.precision):
                level = _between(low.im, high.im, runs)
                if level is not None:
                    return level
        return None

    def _probe_level(self, collapse: IdaRun | None, runs: Sequence[IdaRun]) -> float | None:
        """Return a level above the first collapse where the building may survive again: 1.25 or 1.5
        times the level of this collapse (`_PROBES`). None if the building has been run at both
        levels, or has not collapsed.
        """
        if collapse is None:
            return None
        for level in (probe * collapse.im for probe in _PROBES):
            is_new = all(abs(run.im - level) > _EQUAL_LEVELS * level for run in runs)
            if level <= self.max_level and is_new:
                return level
        return None


def first_collapse(runs: Sequence[IdaRun]) -> IdaRun | None:
    """Return the run with the lowest level where the building collapses; None if it does not
    collapse in any of the runs."""
    return min((run for run in runs if run.collapsed), key=lambda run: run.im, default=None)


def below_collapse(runs: Sequence[IdaRun]) -> Iterator[IdaRun]:
    """Return the runs without collapse at levels below the first collapse, in ascending order of
    the levels."""
    collapse = first_collapse(runs)
    limit = math.inf if collapse is None else collapse.im
    return (run for run in sorted(runs, key=lambda run: run.im) if run.stable and run.im < limit)


def _between(low: float, high: float, runs: Sequence[IdaRun]) -> float | None:
    """Return a new level between two adjacent levels of runs with a result, at one of the positions
    `_POSITIONS`; None if runs at all these positions exist. There may be runs without a result
    between the two levels.
    """
    # A level has been tried if its distance from a run is less than 1 % of the interval between the
    # two levels, on a logarithmic scale.
    tried_levels = [run.im for run in runs if low < run.im < high]
    tolerance = _EQUAL_LEVELS * math.log(high / low)
    for position in _POSITIONS:
        level: float = low * (high / low) ** position
        if all(abs(math.log(tried / level)) > tolerance for tried in tried_levels):
            return level
    return None


@dataclass(frozen=True)
class Capacity:
    """Intensity where a building first exceeds a drift ratio, or a limit of its attachments or
    links, under a record.

    Attributes
    ----------
    threshold : float
        Drift ratio. The collapse drift represents collapse of any cause. NaN for a limit.
    capacity : float
        Intensity. It is a lower bound if censored, and NaN if unknown.
    lower, upper : float
        Levels of the two adjacent runs: the drift ratio is not exceeded at `lower`, and exceeded at
        `upper` (NaN if censored).
    censored : bool
        True if the drift ratio was not exceeded up to the maximum level.
    limit : str
        Name of the limit; empty for a drift ratio.
    """

    threshold: float
    capacity: float
    lower: float
    upper: float
    censored: bool
    limit: str = ""

    @property
    def intensity(self) -> float:
        """Intensity; infinity if censored. If no run is below collapse, a censored capacity is NaN
        and remains NaN (unknown)."""
        return math.inf if self.censored and self.capacity > 0.0 else self.capacity


@dataclass(frozen=True)
class IdaCurve:
    """Runs of a building under one record at increasing levels of intensity.

    Attributes
    ----------
    runs : tuple of IdaRun
        Runs in ascending order of levels.
    damage, residual_drift_ratio : float
        For a building damaged by a mainshock: maximum drift ratio and residual drift ratio after
        the mainshock; 0 for an undamaged building.
    """

    record: Record
    runs: tuple[IdaRun, ...]
    collapse_drift: float
    damage: float = 0.0
    residual_drift_ratio: float = 0.0

    @cached_property
    def stable(self) -> list[IdaRun]:
        """Runs without collapse below the first collapse."""
        return list(below_collapse(self.runs))

    @property
    def resurrection(self) -> bool:
        """True if the building does not collapse at a level above its first collapse.

        The search runs the building at 1.25 and 1.5 times the level of the first collapse.
        Resurrection between the levels of the runs is not detected.
        """
        collapse = first_collapse(self.runs)
        return collapse is not None and any(
            run.stable and run.im > collapse.im for run in self.runs
        )

    @cached_property
    def collapse(self) -> Capacity:
        """Collapse capacity: geometric mean of the last level without collapse and the first level
        with collapse."""
        lower = self.stable[-1].im if self.stable else math.nan
        first = first_collapse(self.runs)
        # Without a collapse, the capacity is only known to be above the last level.
        if first is None:
            return Capacity(self.collapse_drift, lower, lower, math.nan, censored=True)
        capacity = math.sqrt(lower * first.im)
        return Capacity(self.collapse_drift, capacity, lower, first.im, censored=False)

    def capacity(self, threshold: float) -> Capacity:
        """Return the intensity where the curve first reaches a drift ratio, by linear
        interpolation on logarithmic axes.

        The capacity of a damaged building is unknown (NaN) if its residual drift is at least the
        drift ratio.

        If the building collapses before it reaches the drift ratio, the collapse capacity is
        returned, because drifts of collapsed runs cannot be interpolated.

        Parameters
        ----------
        threshold : float
            Drift ratio. The capacity for the collapse drift ratio or a larger value is the collapse
            capacity.
        """
        if threshold >= self.collapse_drift:
            return self.collapse
        drifts = [run.drift_ratio for run in self.stable]
        return self._first_crossing(drifts, threshold, self.residual_drift_ratio)

    def limit_capacity(self, index: int, name: str) -> Capacity:
        """Return the intensity where a demand first reaches its limit, by the rules of `capacity`.

        Parameters
        ----------
        index : int
            Index of the limit in `IdaRun.limit_ratios`.
        """
        ratios = [run.limit_ratios[index] for run in self.stable]
        capacity = self._first_crossing(ratios, 1.0, 0.0)
        return replace(capacity, threshold=math.nan, limit=name)

    def _first_crossing(
        self, demands: Sequence[float], threshold: float, residual: float
    ) -> Capacity:
        """Return the intensity where a demand first reaches a threshold.

        `demands` are the demands of the runs in `stable`, and `residual` the demand before the
        record.
        """
        # A curve may reach the threshold several times, because demands can decrease at a higher
        # level. Use the first crossing.
        for i, demand in enumerate(demands):
            if demand < threshold:
                continue
            if threshold <= residual:
                return Capacity(threshold, math.nan, math.nan, math.nan, censored=False)
            # Below the first run, interpolate linearly from intensity 0, where the demand is the
            # residual demand (0 if undamaged). A link with slack has no force in weak motions, and
            # zero has no logarithm: interpolate linearly from such a run also.
            run = self.stable[i]
            lower_im, lower_demand = (
                (self.stable[i - 1].im, demands[i - 1]) if i else (0.0, residual)
            )
            if i == 0 or lower_demand == 0.0:
                fraction = (threshold - lower_demand) / (demand - lower_demand)
                capacity = lower_im + (run.im - lower_im) * fraction
            else:
                fraction = math.log(threshold / lower_demand) / math.log(demand / lower_demand)
                capacity = lower_im * (run.im / lower_im) ** fraction
            return Capacity(threshold, capacity, lower_im, run.im, censored=False)
        return replace(self.collapse, threshold=threshold)

    def intensity_at(self, drift_ratios: Array) -> Array:
        """Return the intensities where the curve reaches drift ratios.

        Returns
        -------
        ndarray, shape (k,)
            Intensities: infinity if censored, NaN if unknown, and 0 if the residual drift of a
            damaged building is at least the drift ratio.
        """
        intensities = [self.capacity(drift).intensity for drift in drift_ratios.tolist()]
        return np.where(drift_ratios <= self.residual_drift_ratio, 0.0, np.array(intensities))


@dataclass(frozen=True)
class PairCurve(IdaCurve):
    """Curve of a pair, computed from the curves of its two components.

    The runs are at the levels of both components up to the first collapse of a component. Their
    drift ratio is the maximum or the mean of both components. Between the levels of a component,
    its drift ratio is interpolated on logarithmic axes. The building collapses under the pair at
    the level where it first collapses under a component.

    Attributes
    ----------
    parts : tuple of two IdaCurve
        Curves of the components.
    demand : str
        `larger` or `mean` (`tdint.response.pairs`).
    """

    parts: tuple[IdaCurve, IdaCurve] | tuple[()] = ()
    demand: str = LARGER

    @classmethod
    def combine_components(cls, first: IdaCurve, second: IdaCurve, demand: str) -> Self:
        """Return the curve of a pair from the curves of its two components."""
        curves = first, second
        # Drifts are known up to the smaller of the last levels below collapse.
        last_common_level = min(curve.stable[-1].im if curve.stable else 0.0 for curve in curves)
        levels = sorted(
            {run.im for curve in curves for run in curve.stable if run.im <= last_common_level}
        )
        motion = np.zeros(len(curves), np.intp)
        of_curves = np.array([_demands_at(curve, levels) for curve in curves])
        (demands,) = demands_of_motions(motion, of_curves, demand)
        runs = (
            IdaRun(im, math.nan, DONE, drift, limit_ratios=tuple(limit_ratios))
            for im, (drift, *limit_ratios) in zip(levels, demands.tolist(), strict=True)
        )
        residuals = np.array([curve.residual_drift_ratio for curve in curves])
        residual = float(demands_of_motions(motion, residuals, demand)[0])
        return cls(
            first.record,
            tuple(runs),
            first.collapse_drift,
            first.damage,
            residual,
            parts=curves,
            demand=demand,
        )

    @property
    def resurrection(self) -> bool:
        """True if the building does not collapse above its first collapse under a component."""
        return any(part.resurrection for part in self.parts)

    @cached_property
    def collapse(self) -> Capacity:
        """Smaller collapse capacity of the two components."""
        return _smallest([part.collapse for part in self.parts])

    def capacity(self, threshold: float) -> Capacity:
        """Return the intensity where the pair first reaches the drift ratio `threshold`: the
        smaller capacity of the two components for the rule `larger`, or the capacity of the mean
        curve for the rule `mean`."""
        if self.demand == MEAN or threshold >= self.collapse_drift:
            return super().capacity(threshold)
        return _smallest([part.capacity(threshold) for part in self.parts])

    def limit_capacity(self, index: int, name: str) -> Capacity:
        """Return the intensity where a demand of the pair first reaches its limit, by the rules of
        `capacity`."""
        if self.demand == MEAN:
            return super().limit_capacity(index, name)
        return _smallest([part.limit_capacity(index, name) for part in self.parts])


def _smallest(capacities: Sequence[Capacity]) -> Capacity:
    """Return the smallest capacity; an unknown capacity, if there is one."""
    unknown = [item for item in capacities if math.isnan(item.capacity)]
    return unknown[0] if unknown else min(capacities, key=lambda item: item.capacity)


def _demands_at(curve: IdaCurve, levels: Sequence[float]) -> Array:
    """Return the drift ratio, and the ratios of demand to limit, of a curve at levels below its
    first collapse, by interpolation, shape (levels, 1 + limits)."""
    if not levels:
        return np.empty((0, 1))
    im = np.array([run.im for run in curve.stable])
    intensities = np.asarray(levels)
    columns = []
    for index, values in enumerate(
        zip(*((run.drift_ratio, *run.limit_ratios) for run in curve.stable), strict=True)
    ):
        # Interpolate linearly from the residual demand at intensity 0 to the first run, then on
        # logarithmic axes. A run without demand (`_first_crossing`) has no logarithm: interpolate
        # linearly next to it.
        residual = 0.0 if index else curve.residual_drift_ratio
        below_first_run = residual + (values[0] - residual) * intensities / im[0]
        is_zero = np.equal(values, 0.0)
        logarithms = np.log(np.where(is_zero, 1.0, values))
        between_runs = np.where(
            np.interp(intensities, im, is_zero) > 0.0,
            np.interp(intensities, im, values),
            np.exp(np.interp(np.log(intensities), np.log(im), logarithms)),
        )
        columns.append(np.where(intensities < im[0], below_first_run, between_runs))
    return np.stack(columns, axis=-1)


_DRIFTS = 240  # number of points of a curve, which is smooth at a width of 180 mm


def fractile_drifts(limit: float) -> Array:
    """Return the drift ratios of the points of fractile curves, up to `limit`."""
    return np.linspace(0.0, limit, _DRIFTS)[1:]


def capacity_fractiles(curves: Sequence[IdaCurve], drift_ratios: Array) -> Array:
    """Return fractiles, over the motions, of the intensity where the building reaches each drift
    ratio, shape (3, k), by the rules of `fractiles`: a censored intensity is above every value.
    Motions without a run below collapse are omitted.
    """
    used = [curve.intensity_at(drift_ratios) for curve in curves if curve.stable]
    return fractiles(np.array(used).reshape(-1, drift_ratios.size))


# ---- Damage

_DAMAGE_HUNT = 1.3
"""Ratio of successive scale factors of a mainshock until the specified drift ratio is reached."""

_MAX_DAMAGE_HUNTS = 60
"""Maximum number of these scale factors."""

_DRIFT_TOLERANCE = 1e-4
"""Relative tolerance of the drift ratio to which a mainshock is scaled."""

_MAX_BISECTIONS = 60
"""Maximum number of bisections of the scale factor; 2^-60 is below rounding errors."""


@dataclass(frozen=True)
class Mainshock:
    """Ground motion before each motion of a study, scaled so that the building reaches specified
    drift ratios.

    Attributes
    ----------
    records : tuple of Record
        Horizontal components. A single component precedes all records; otherwise each record is
        preceded by the component with the same name.
    damages : tuple of float
        Drift ratios.
    """

    records: tuple[Record, ...]
    damages: tuple[float, ...]

    def before(self, record: Record) -> Record:
        """Return the component that precedes a record.

        Parameters
        ----------
        record : Record
            Component of the aftershock.

        Raises
        ------
        UsageError
            No component has the name of the component of the record.
        """
        if len(self.records) == 1:
            return self.records[0]
        for main in self.records:
            if main.component == record.component:
                return main
        names = ", ".join(main.component for main in self.records)
        raise UsageError(
            f"{self.records[0].source}: the mainshock has no component "
            f"{record.component or '(unnamed)'} for the aftershock {record.name}; available "
            f"components: {names}; select one with --component"
        )


@dataclass(frozen=True)
class DamagedState:
    """Damage of a building by a mainshock.

    Attributes
    ----------
    record : Record
        Scaled mainshock.
    drift, factor : float
        Drift ratio that the scaled mainshock causes, and its scale factor.
    rest : float
        Time from the last sample of the mainshock until free vibration has decayed, s.
    """

    record: Record
    drift: float
    residual_drift_ratio: float
    rest: float
    factor: float = 1.0


def damaged(
    subject: Subject, mainshock: Record, drift: float, *, first_factor: float, dt: float | None
) -> DamagedState:
    """Scale a mainshock so that the maximum drift ratio of a building reaches a specified value,
    and return the damaged state of the building.

    The search increases the scale factor from a first value, so that its result is usually the
    smallest suitable factor.

    Parameters
    ----------
    first_factor : float
        First scale factor of the search; it continues with larger factors.
    dt : float | None
        Time step, s; None: the default of the building.

    Raises
    ------
    AnalysisError
        The building collapses before it reaches the drift ratio.
    """

    factor = _factor_for_drift(subject, mainshock, drift, first_factor=first_factor, dt=dt)
    # Run only the mainshock, until free vibration has decayed, to compute the residual drift.
    scaled = mainshock.scaled(factor)
    case = subject.case(scaled)
    # In this sequence of two events, the second event starts when free vibration has decayed.
    sequence = sequence_of(case, [scaled, scaled], dt=dt)
    # `starts[1]` is the index of the first sample of the second event. The last sample of the first
    # event has the index size - 1; the difference is the time at rest.
    rest = (sequence.starts[1] - scaled.acceleration.size + 1) * scaled.dt
    # The residual drift is the drift at the end of the first event, after this time.
    single_event = EventSequence(sequence.records[:1], (0,))
    single_case = case.under(single_event.joined)
    steps = single_case.steps(dt, scaled.duration + rest)
    (event,) = event_responses(single_case, single_event, steps)
    residual = demands(event.stories).residual_drift_ratio.value
    return DamagedState(scaled, drift, residual, rest, factor)


def _factor_for_drift(
    subject: Subject, mainshock: Record, drift: float, *, first_factor: float, dt: float | None
) -> float:
    """Return the scale factor of a mainshock at which the maximum drift ratio of a building equals
    a specified value within 0.01 % (`_DRIFT_TOLERANCE`). AnalysisError is raised if the building
    collapses at a smaller drift ratio.
    """

    def max_drift_ratio(factor: float) -> float:
        """Return the maximum drift ratio at a scale factor; infinity if the run fails or the
        building collapses, because the suitable factor is smaller in both cases."""
        case = subject.case(mainshock, factor)
        # The maximum can follow the end of a short record, in free vibration.
        steps, _ = extend_to_rest(case, case.steps(dt, mainshock.duration))
        try:
            response = case.integrate(steps)
        except FailedRun:
            return math.inf
        return math.inf if response.collapse else demands(response.stories).drift_ratio.value

    # Increase the factor until the drift is reached, then bisect. If the building collapses before
    # it reaches the drift, no suitable factor exists and the bisection does not converge.
    low, high = 0.0, first_factor
    for _ in range(_MAX_DAMAGE_HUNTS):
        if max_drift_ratio(high) >= drift:
            break
        low, high = high, _DAMAGE_HUNT * high
    for _ in range(_MAX_BISECTIONS):
        factor = 0.5 * (low + high)
        reached_drift = max_drift_ratio(factor)
        if abs(reached_drift - drift) <= _DRIFT_TOLERANCE * drift:
            return factor
        if reached_drift < drift:
            low = factor
        else:
            high = factor
    raise AnalysisError(
        f"{mainshock.name}: no scale factor leads to a drift ratio of {100.0 * drift:g} % "
        "without collapse; specify a smaller drift, or another mainshock"
    )
