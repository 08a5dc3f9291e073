"""Profiles: peaks in each story of a building under a suite of ground motions, as values of each
motion, mean, fractiles and maximum. Also floor response spectra under a suite.

The order of operations is that of design codes: maximum of each motion over time, in each story;
mean over the motions; maximum over the stories. The two components of a pair are combined to a
single motion, unless they count separately. Mean and maximum include only the motions with a result
and without collapse. In the median and the fractiles a collapse counts as larger than every value,
so that they do not fall when more motions cause collapse. Motions without a result are only
counted.

Comparison of buildings, such as variants of a retrofit, with a baseline under the same suite of
ground motions.

A mean over the motions that a building survives cannot be compared with a mean over other motions:
a weak building that survives only the mild motions would appear better than a strong building. A
ratio to the baseline therefore uses the motions that the building and the baseline both complete;
other buildings do not change it. The numbers of collapses are stated separately, because they are a
result that no mean contains.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property
from tdint.errors import ModelError, UsageError, did_you_mean
from tdint.fractiles import fractiles
from tdint.ground_motion.horizontals import pair_name
from tdint.items import grouped
from tdint.model.limits import (
    LINK_DEFORMATION,
    LINK_FORCE,
    STROKE,
    Limit,
    LimitCheck,
    check_demands,
    isolator_check,
)
from tdint.number_parsing import abbreviate, pluralize, quoted_names
from tdint.response.pairs import (
    COMPLETED,
    Counts,
    Indices,
    Outcomes,
    PairRule,
    Run,
    counts,
    demands_of_motions,
    first_runs,
    indices_of,
    last_runs,
    outcomes_of,
    outcomes_of_motions,
    with_outcomes,
)
from tdint.response.runs.batch import Subject
from tdint.response.runs.outcome import STORY_QUANTITIES, Response
from tdint.response.runs.run import integrate_case
from tdint.response.spectra.elastic import SA_DAMPING
from tdint.response.spectra.floor_motions import FloorSpectrum, floor_spectra, floors_of
from tdint.studies.campaign.plan import Plan
from tdint.studies.motions.intensity import SPECTRAL, measure_at
from tdint.studies.store import schema
from tdint.studies.store.result_store import Store
from tdint.system import on_threads
from tdint.units import Quantity

DRIFT_RATIO = "peak_drift_ratio"
_NUMBERED_LEVEL = ("level", "")
"""Name and unit of levels that are numbered, because each motion has individual scale factors."""


class Statistics(NamedTuple):
    """Statistics of a quantity over the motions, in each of n stories: mean, median, 16 % and 84 %
    fractiles, and maximum. Each array has the shape (n,). Mean and maximum are NaN without motions
    that the building survives; a fractile is infinite if it is a collapse."""

    mean: Array
    median: Array
    p16: Array
    p84: Array
    max: Array

    @classmethod
    def of(cls, values: Array) -> Statistics:
        """Return the statistics of values of shape (motions, n), by the rules of `fractiles`:
        infinity is a collapse, NaN is a motion without a result."""
        p16, median, p84 = fractiles(values)
        completed = values[np.isfinite(values).any(axis=1)]
        if not len(completed):
            missing = np.full(values.shape[1], math.nan)
            return cls(missing, median, p16, p84, missing)
        return cls(np.mean(completed, axis=0), median, p16, p84, np.max(completed, axis=0))

    @classmethod
    def errors(cls, values: Array, errors: Array) -> Statistics:
        """Return the maximum errors of the statistics that result from errors of the values.

        All statistics increase with the values, so that their error is maximum if all errors have
        the same sign.

        Parameters
        ----------
        values, errors : ndarray, shape (motions, n)
            Values in n stories and their estimated absolute errors.

        Returns
        -------
        Statistics
            Error of each statistic, in the attribute of the statistic; NaN for a collapse.
        """

        def statistics_of(samples: Array) -> Array:
            """Return the statistics of samples in the order of the fields of the class."""
            statistics = np.array(cls.of(samples))
            return np.where(np.isinf(statistics), math.nan, statistics)

        result = statistics_of(values)
        increase = statistics_of(values + errors) - result
        decrease = result - statistics_of(values - errors)
        return cls(*np.maximum(increase, decrease))


@dataclass(frozen=True)
class SuiteLevel:
    """Outcome of the runs of a building under a suite at a single level of intensity.

    Attributes
    ----------
    scale : float
        Scale factor of all motions; NaN if motions have different factors.
    level : float
        Value of the intensity measure, SI units. If each motion has several individual factors,
        number of the factor, from 1. NaN if the level is a factor (`scale`).
    runs : list of Run
        All runs at the level.
    motion : ndarray of int
        Index of the motion of each run.
    outcome, run_outcome : ndarray of int
        Outcome of each motion and of each run (`tdint.response.pairs`).
    measure : tuple of str
        Name and unit of the level.
    pair_demand : str
        Rule that combines the components of pairs (`tdint.response.pairs`); empty if the
        suite has no pairs.
    """

    scale: float
    level: float
    runs: list[Run]
    motion: Indices
    outcome: Outcomes
    run_outcome: Outcomes
    measure: tuple[str, str]
    pair_demand: str
    building: str

    @property
    def level_text(self) -> str:
        """Text of the level, such as `scale 2` or `sa(T1) 2.94 m/s^2`."""
        return level_text(self.scale, self.level, self.measure)

    @property
    def counts(self) -> Counts:
        """Numbers of motions; a pair is one motion."""
        return counts(self.outcome)

    @property
    def pairs(self) -> int:
        """Number of motions that are pairs of components."""
        return len(self.runs) - len(self.outcome)

    @property
    def lost_text(self) -> str:
        """Numbers of lost motions, such as `of 7 ground motions, 2 collapsed and 1 failed`; empty
        if all runs are completed without collapse. The worse component decides for its pair."""
        if not self.counts.lost:
            return ""
        components = ""
        if self.pairs:
            done = int(np.count_nonzero(self.run_outcome == COMPLETED))
            components = f" under a component, {done} of {len(self.runs)} components completed"
        return (
            f"of {pluralize(self.counts.motions, 'ground motion')}, {self.counts.text}{components}"
        )

    def demands(self, values: Mapping[Run, Any]) -> Array:
        """Return the demand of each motion, which combines the values of its runs, as an array with
        the motions on the first axis: infinity for a collapse, NaN without a result."""
        missing = np.full(np.shape(next(iter(values.values()), ())), math.nan)
        of_runs = np.array([values.get(run, missing) for run in self.runs], float)
        demands = demands_of_motions(self.motion, of_runs, self.pair_demand)
        return with_outcomes(demands, self.outcome)


@dataclass(frozen=True)
class Profile(SuiteLevel):
    """Peaks of a building under a suite at a single level of intensity.

    Attributes
    ----------
    motions : tuple of str
        Name of each motion.
    height : ndarray, shape (n,)
        Story heights, m; NaN if not specified.
    peaks : mapping of str to ndarray, shape (motions, n)
        Maximum absolute values of each quantity of `tdint.response.runs.outcome.STORY_QUANTITIES`,
        by its name; infinity for a collapse, NaN without a result.
    peak_errors : mapping of str to ndarray, shape (motions, n)
        Their estimated errors, NaN if missing; empty if not requested.
    isolators : tuple of int
        Stories with isolators, from 1.
    """

    motions: tuple[str, ...]
    height: Array
    peaks: Mapping[str, Array]
    peak_errors: Mapping[str, Array]
    limits: tuple[Limit, ...] = ()
    isolators: tuple[int, ...] = ()

    @property
    def keys(self) -> list[tuple[int, float, int]]:
        """First record of each motion, its factor and its sample, which identify it in all
        buildings at the level."""
        return [tuple(self.runs[index]) for index in first_runs(self.motion)]

    def restricted_to(self, kept: NDArray[np.bool_]) -> Self:
        """Return the profile of some of the motions (a mask)."""
        indices = np.flatnonzero(kept)
        is_of_kept = kept[self.motion]
        return replace(
            self,
            runs=[run for run, is_kept in zip(self.runs, is_of_kept, strict=True) if is_kept],
            motion=np.searchsorted(indices, self.motion[is_of_kept]),
            outcome=self.outcome[kept],
            run_outcome=self.run_outcome[is_of_kept],
            motions=tuple(self.motions[index] for index in indices),
            peaks={name: values[kept] for name, values in self.peaks.items()},
            peak_errors={name: values[kept] for name, values in self.peak_errors.items()},
        )

    @cached_property
    def completed(self) -> Self:
        """The profile of the completed motions."""
        return self.restricted_to(self.outcome == COMPLETED)

    def limit_checks(
        self, limit: float | str | None = None, *, accepted: int = 0
    ) -> tuple[LimitCheck, ...]:
        """Compare the mean demands over the motions with limits: by default all limits of the
        model, otherwise a drift limit or a performance level of the model.

        The mean is computed in each story, and the comparison uses the story with the maximum ratio
        of mean demand to limit, as in design codes. A building that collapsed or failed under a
        motion does not meet any limit. Without a completed run, the result is empty.

        Parameters
        ----------
        accepted : int
            Number of motions with a collapse or without a result that are accepted as unacceptable
            responses (`tdint.model.limits.design_demands`); default 0.

        Raises
        ------
        UsageError
            No story has a height, or the model does not have the performance level.
        """
        return check_demands(
            self.limits,
            limit,
            self.completed.peaks,
            self.height,
            self.completed.motions,
            name=self.building,
            has_failure=self.counts.lost > accepted,
            unacceptable=self.counts.lost if self.counts.lost <= accepted else 0,
        )

    @property
    def isolator_check(self) -> LimitCheck | None:
        """Comparison that reports the displacement of the isolators; its limit is infinite. None
        without isolators."""
        completed = self.completed
        return isolator_check(self.isolators, completed.peaks, self.height, completed.motions)

    def statistics(self, quantity: Quantity) -> Statistics:
        """Return the statistics of a quantity of `STORY_QUANTITIES` in each story, SI units."""
        return Statistics.of(self.peaks[quantity.name])

    def errors(self, quantity: Quantity) -> Statistics | None:
        """Return the errors of the statistics of a quantity in each story, which result from the
        estimated errors of the runs; None if these errors were not estimated. The uncertainty due
        to the selection of motions is not included."""
        if not self.peak_errors:
            return None
        values = self.peaks[quantity.name]
        return Statistics.errors(values, self.peak_errors[quantity.name])


def profiles(store: Store) -> Iterator[Profile]:
    """Yield the profiles of a campaign: for each building, one per intensity level, in ascending
    order of the levels without sign. Nothing is yielded if no peaks of stories are stored."""
    if not store.has_stories:
        return
    records, rules = store.records(), SuiteRules.of(store)
    story_counts = dict(store.connection.execute("SELECT id, stories FROM buildings"))
    quantities = [quantity.column for quantity in STORY_QUANTITIES]
    errors = [f"{quantity}_error" for quantity in quantities] if store.checked else []
    columns = ["height_m", *quantities, *errors]
    name_of_motion = lru_cache(maxsize=None)(pair_name)
    for number, (name, _) in store.buildings().items():
        limits = store.limits(number)
        # The first entry gives the shape of buildings without a result.
        values = {Run(-1, 0.0): np.zeros((story_counts[number], len(columns)))}
        values |= store.values_of_runs(schema.STORIES, ", ".join(columns), number)
        devices = device_values(store, number, limits.limits)
        for level in rules.levels_of(store, number, name):
            files = np.array([records[run.motion][0] for run in level.runs], object)
            ends = (files[first_runs(level.motion)], files[last_runs(level.motion)])
            height, peaks, errors_of_peaks = _peaks(level, values)
            peaks |= {quantity: level.demands(of_runs) for quantity, of_runs in devices.items()}
            yield Profile(
                **vars(level),
                motions=tuple(map(name_of_motion, *ends)),
                height=height,
                peaks=peaks,
                peak_errors=errors_of_peaks,
                limits=limits.limits,
                isolators=limits.isolators,
            )


_DEVICE_VALUES = {
    STROKE: (schema.ATTACHMENTS, "peak_drift_m"),
    LINK_DEFORMATION: (schema.LINKS, "peak_deformation_m"),
    LINK_FORCE: (schema.LINKS, "max(peak_force_N, peak_damper_force_N)"),
}
"""Table and value of the limited quantities of attachments and links, as in `device_demands`."""


def device_values(
    store: Store, building: int, limits: Iterable[Limit]
) -> dict[str, dict[Run, Array]]:
    """Read the demands of attachments and links in all runs of a building: for each limited
    quantity, the values of each run in the order of the model."""
    return {
        quantity: {
            run: values[:, 0]
            for run, values in store.values_of_runs(*_DEVICE_VALUES[quantity], building).items()
        }
        for quantity in {limit.quantity for limit in limits} & _DEVICE_VALUES.keys()
    }


def level_text(scale: float, level: float, measure: tuple[str, str]) -> str:
    """Return the text of an intensity level.

    The text is `scale 2` if all motions have the same factor. Otherwise it is the intensity measure
    and its value, such as `sa(T1) 2.94 m/s^2`, or the number of the level, `level 2`, if motions
    have individual factors. It is empty if both `scale` and `level` are unknown.

    Parameters
    ----------
    measure : tuple of (str, str)
        Name and unit of the intensity measure; `level` without a unit for numbered levels.
    """
    if not math.isnan(scale):
        return f"scale {scale:g}"
    name, unit = measure
    return "" if math.isnan(level) else f"{name} {level:.4g} {unit}".rstrip()


SuiteRun = tuple[Run, str, float | None, str]
"""Run of a store with its ground motion and its level (`tdint.response.pairs.Place`; None
without a level), and its status."""


@dataclass(frozen=True)
class SuiteRules:
    """Rules that group the runs of a building by intensity level and ground motion.

    Attributes
    ----------
    has_levels : bool
        True if levels are not common scale factors of all motions (`level_measure`).
    measure : tuple of str
        Name and unit of the levels.
    """

    pairs: PairRule
    has_levels: bool
    measure: tuple[str, str]

    @classmethod
    def of(cls, store: Store) -> SuiteRules:
        """Return the rules of a campaign from its store."""
        measure = level_measure(store)
        return cls(store.pair_rule(), measure is not None, measure or ("", ""))

    def levels_of(self, store: Store, number: int, building: str = "") -> Iterator[SuiteLevel]:
        """Group the runs of the building with this number by intensity level, and yield the levels
        as `levels`."""
        return self.levels(
            store.rows_of_runs(schema.RUNS, "motion, level, status", number), building
        )

    def levels(self, rows: Iterable[SuiteRun], building: str = "") -> Iterator[SuiteLevel]:
        """Group runs of a building by intensity level, and yield the levels in ascending order of
        their magnitude (without sign). `building` is the name of the building."""
        rows_of_level = grouped((row[2], row) for row in rows)
        for value in sorted(rows_of_level, key=lambda level: abs(level or 0.0)):
            runs, names, _, statuses = zip(*rows_of_level[value], strict=True)
            motion, run_outcome = (
                indices_of(map(self.pairs.motion_key, runs, names)),
                outcomes_of(statuses),
            )
            has_common_scale = not self.has_levels and len({run.scale for run in runs}) == 1
            yield SuiteLevel(
                runs[0].scale if has_common_scale else math.nan,
                value if self.has_levels and value is not None else math.nan,
                list(runs),
                motion,
                outcomes_of_motions(motion, run_outcome),
                run_outcome,
                self.measure,
                self.pairs.demand_if_pairs,
                building,
            )


def level_measure(store: Store) -> tuple[str, str] | None:
    """Return name and SI unit of the levels of a campaign, such as `sa(T1)` and `m/s^2`; None if
    its levels are common scale factors, or all motions are one suite.

    The levels are values of an intensity measure to which the motions were scaled, the column
    `level` of a table of factors, or the numbers of several factors of motions at sites, which
    already have individual factors.
    """
    settings = store.parameters()
    if "levels" in settings:
        name, period = settings["measure"], settings["period"]
        unit = measure_at(name, SA_DAMPING, 1.0).unit
        period_text = period if isinstance(period, str) else f"{period:g}"
        return f"{name}({period_text})" if name in SPECTRAL else name, unit
    if "factor_levels" in settings:
        return "level", settings["level_unit"]
    # The settings contain the SHA-256 of a grid or of ground motion fields if the campaign has
    # them.
    has_sites = "grid_sha256" in settings or "field_sha256" in settings
    return _NUMBERED_LEVEL if has_sites and len(settings.get("scales", ())) > 1 else None


def _peaks(
    level: SuiteLevel, values_of_run: Mapping[Run, Array]
) -> tuple[Array, dict[str, Array], dict[str, Array]]:
    """Return the heights of the stories, and the peaks of the motions with their estimated errors
    by quantity; inf after a collapse, and nan without a result.

    The error of a pair is the larger change of its demand if the peaks of both components are
    increased, or decreased, by their errors. Errors are absolute values.
    """
    absolute = {run: np.abs(values) for run, values in values_of_run.items()}
    values = level.demands(absolute)
    middle, is_completed = values[:, :, 1:_FIRST_ERROR], level.outcome == COMPLETED
    heights = (
        values[is_completed.argmax(), :, 0]
        if is_completed.any()
        else np.full(middle.shape[1], math.nan)
    )
    if values.shape[2] == _FIRST_ERROR:
        return heights, _by_quantity(middle), {}
    up, down = (
        level.demands(
            {
                run: item[:, 1:_FIRST_ERROR] + sign * item[:, _FIRST_ERROR:]
                for run, item in absolute.items()
            }
        )
        for sign in (1.0, -1.0)
    )
    with np.errstate(invalid="ignore"):
        errors = np.maximum(up - middle, middle - down)
    errors[~is_completed] = 0.0
    return heights, _by_quantity(middle), _by_quantity(errors)


def _by_quantity(values: Array) -> dict[str, Array]:
    """Return the values of each quantity of `STORY_QUANTITIES`, by name, shape (motions, stories).

    `values` is an array of shape (motions, stories, quantities).
    """
    return {quantity.name: values[:, :, i] for i, quantity in enumerate(STORY_QUANTITIES)}


_FIRST_ERROR = 1 + len(STORY_QUANTITIES)
"""Index of the first error in the columns of a story, after its height and its quantities."""


# ---- Floor response spectra under a suite: spectra of each run, mean and envelope over the motions


SpectraOfRuns = Mapping[int, Mapping[Run, tuple[FloorSpectrum, ...]]]
"""Floor spectra of each run, by the number of the building and by the run."""


@dataclass(frozen=True)
class FloorSuite(SuiteLevel):
    """Pseudo-accelerations on a floor of a building under a suite at a single level.

    Attributes
    ----------
    damping : float
        Damping ratio of the oscillators on the floor.
    psa : ndarray, shape (motions, k)
        Pseudo-acceleration of each completed motion, m/s^2; demand of a pair at each period.
    base : int
        Number of isolators below the first story.
    """

    floor: int | str
    damping: float
    periods: Array
    psa: Array
    base: int = 0

    def place(self, lowest: int) -> str:
        """Return the floor as text, counted from the isolators of the building with the fewest
        isolators (`lowest`) below its first story; or the name of an attachment."""
        if isinstance(self.floor, str):
            return self.floor
        return f"floor {self.floor - self.base + lowest}"

    @property
    def mean(self) -> Array:
        """Mean over the motions."""
        return np.asarray(np.mean(self.psa, axis=0))

    @property
    def envelope(self) -> Array:
        """Maximum over the motions."""
        return np.asarray(np.max(self.psa, axis=0))


def isolated_base(isolators: Collection[int]) -> int:
    """Return the number of isolators below the first other story; isolators are numbered from 1."""
    base = 0
    while base + 1 in isolators:
        base += 1
    return base


def run_floors(
    plan: Plan,
    store: Store,
    floors: Sequence[str],
    periods: Array,
    damping: Sequence[float],
    jobs: int,
) -> SpectraOfRuns:
    """Return the floor spectra of all completed runs of a campaign. The store contains no response
    histories, so each run is repeated with the stored time step.

    Parameters
    ----------
    floors : sequence of str
        Names of the floors: numbers, or `roof`.
    periods : ndarray
        Periods of the oscillators on the floors, s.
    damping : sequence of float
        Damping ratios of the oscillators.

    Returns
    -------
    mapping
        Floor spectra in the order of the buildings and their runs.

    Raises
    ------
    UsageError
        A building does not have one of the floors.
    """
    run_rows = store.connection.execute(
        "SELECT building, record, scale, sample, dt_s FROM run_rows WHERE status = 'done' ORDER BY "
        "1, 2, 3, 4"
    ).fetchall()
    # Create each building one time, and integrate its runs in parallel.
    buildings: dict[int, dict[Run, float]] = defaultdict(dict)
    for building, record, scale, sample, dt in run_rows:
        buildings[building][Run(record, scale, sample)] = dt
    # Floors are counted from the isolators at the base that only some buildings have, so that the
    # same floor of all buildings is requested by one number.
    bases = {building: isolated_base(store.limits(building).isolators) for building in buildings}
    lowest = min(bases.values(), default=0)
    result: dict[int, dict[Run, tuple[FloorSpectrum, ...]]] = {}
    for building, steps in buildings.items():
        shift = bases[building] - lowest
        names = tuple(
            str(int(name) + shift) if name.isdecimal() and len(name) < 9 else name
            for name in floors
        )
        subject = plan.buildings[building].subject()
        # Raise the error of an invalid floor before the runs.
        floors_of(names, subject.model)
        spectra_of = partial(floor_spectra, floors=names, periods=periods, damping=damping)
        integrate = partial(_spectra_of_run, plan, subject, spectra_of)
        spectra = dict(on_threads(integrate, list(steps.items()), jobs))
        result[building] = {run: spectra[run] for run in steps}
    return result


def _spectra_of_run(
    plan: Plan,
    subject: Subject,
    spectra_of: Callable[[Response], tuple[FloorSpectrum, ...]],
    run_and_step: tuple[Run, float],
) -> tuple[Run, tuple[FloorSpectrum, ...]]:
    """Return a run with its floor spectra. `run_and_step` is the run and its time step, s."""
    run, dt = run_and_step
    case = subject.case(plan.motions[run.motion].record, run.scale)
    response = integrate_case(case, replace(plan.settings, dt=dt, check=False), history=True)
    return run, spectra_of(response)


def floor_suites(store: Store, floors: SpectraOfRuns) -> Iterator[FloorSuite]:
    """Yield the floor spectra under a suite: one object for each building, level, floor and damping
    ratio. Levels without completed runs are omitted.

    Parameters
    ----------
    floors : mapping
        Floor spectra of all completed runs of the campaign.
    """
    names, rules = store.buildings(), SuiteRules.of(store)
    for number, spectra_of_run in floors.items():
        # Collapsed and failed runs have no response history and are excluded.
        for level in rules.levels_of(store, number, names[number][0]):
            is_completed = level.outcome == COMPLETED
            if not is_completed.any():
                continue
            # All runs have the spectra of the same floors and damping ratios in the same order:
            # use these from the first run, and the pseudo-accelerations from all runs.
            for index, floor_spectrum in enumerate(next(iter(spectra_of_run.values()))):
                spectrum = floor_spectrum.spectrum
                psa = level.demands(
                    {run: spectra[index].spectrum.psa for run, spectra in spectra_of_run.items()}
                )[is_completed]
                yield FloorSuite(
                    **vars(level),
                    floor=floor_spectrum.floor,
                    damping=spectrum.damping,
                    periods=spectrum.periods,
                    psa=psa,
                    base=isolated_base(store.limits(number).isolators),
                )


# ---- Comparison of buildings with a baseline under the same suite

MIN_COMMON = 3
"""Minimum number of common motions for a ratio if a motion of one of the buildings is lost: the
mean of two motions of eleven says nothing about the suite."""


class MotionRatios(NamedTuple):
    """Ratios of a building to a baseline: of the maxima over the stories of each building, then of
    each story of the baseline. NaN if too few motions are common; infinity for a collapse.

    Attributes
    ----------
    motions : int
        Number of motions of the mean and of the maximum; the median is over all motions.
    """

    mean: Array
    median: Array
    max: Array
    motions: int


def ratios_to(
    base: Array,
    variant: Array,
    stories: Sequence[tuple[int, int]] = (),
    apart: tuple[Sequence[int], Sequence[int]] = ((), ()),
) -> MotionRatios:
    """Return the ratios of the demands of a building to those of a baseline, over the motions that
    both completed; the medians are over all motions, a collapse above every value.

    Parameters
    ----------
    base, variant : ndarray, shape (motions, stories)
        Demands under the same motions, infinite for a collapse and NaN without a result.
    stories : sequence of (int, int)
        Indices of corresponding stories of the building and of the baseline.
    apart : tuple of two sequences of int
        Indices of the stories of the baseline, and of the building, that the maxima omit.
    """
    is_common = np.asarray(np.isfinite(base).any(axis=1) & np.isfinite(variant).any(axis=1))
    motions = int(is_common.sum())
    has_collapse = bool(np.isinf(base).any() or np.isinf(variant).any())
    if motions < (MIN_COMMON if has_collapse else 1):
        is_common[:] = False
    numerator, denominator = np.full((2, 3, 1 + base.shape[1]), np.nan)
    statistics = []
    for values, omitted, quotients in zip(
        (base, variant), apart, (denominator, numerator), strict=True
    ):
        common = values[is_common] if is_common.any() else np.full((1, values.shape[1]), np.nan)
        median = fractiles(values, (0.5,))[0]
        of_stories = np.array([common.mean(axis=0), median, common.max(axis=0)])
        # A story without a height has no drift ratio (NaN), which `fmax` omits.
        counted = np.delete(of_stories, omitted, axis=1)
        quotients[:, 0] = np.fmax.reduce(counted, axis=1, initial=-np.inf)
        statistics.append(of_stories)
    denominator[:, 1:] = statistics[0]
    for story, base_story in stories:
        numerator[:, 1 + base_story] = statistics[1][:, story]
    mean, median, largest = quotient(numerator, denominator)
    return MotionRatios(mean, median, largest, motions)


def quotient(numerator: Array, denominator: Array) -> Array:
    """Return a quotient; NaN if the denominator is zero or a number is missing, infinity if the
    numerator is a collapse and the denominator is not."""
    is_known = (denominator > 0.0) & np.isfinite(denominator) & (numerator >= 0.0)
    result = np.full(np.broadcast(numerator, denominator).shape, np.nan)
    return np.asarray(np.divide(numerator, denominator, out=result, where=is_known))


def at_levels(profiles: Iterable[Profile]) -> list[list[Profile]]:
    """Group profiles by their level of intensity."""
    # The keys are texts, because scale or level may be NaN, which is not equal to NaN.
    levels = grouped(((repr(profile.scale), repr(profile.level)), profile) for profile in profiles)
    return list(levels.values())


class Ratios(NamedTuple):
    """Ratio of a quantity of a building to the quantity of the baseline at the same level: of the
    maxima over all stories of each building, without isolators for drifts; then of each story of
    the baseline from the ground up (`story_pairs`)."""

    compared: Profile
    base: Profile
    quantity: str
    ratios: MotionRatios

    @property
    def scale(self) -> float:
        """Scale factor of all motions; NaN if motions have different factors."""
        return self.compared.scale

    @property
    def level(self) -> float:
        """Value of the intensity measure or number of the level; NaN if the level is a factor."""
        return self.compared.level


def check_baseline(
    baseline: str, buildings: Iterable[str], own_periods: Mapping[str, float] | None = None
) -> None:
    """Raise UsageError if a baseline is not one of the buildings, or is the only building; and
    ModelError if the motions were scaled to levels at `own_periods`, different first periods of the
    buildings by name, s: then no motion is common."""
    names = list(dict.fromkeys(buildings))
    if baseline not in names:
        suggestion = did_you_mean(baseline, names)
        raise UsageError(
            f"building {baseline!r} not found{suggestion}; available buildings: "
            f"{abbreviate(quoted_names(names), 10)}"
        )
    if len(names) == 1:
        raise UsageError(f"no other building to compare with {baseline!r}; add a building")
    if own_periods:
        period = own_periods[baseline]
        raise ModelError(
            f"--baseline {baseline}: the factors of a motion differ between the buildings, because "
            "the levels are at the first period of each building (period: T1); use levels at one "
            f"period in the campaign file, such as that of the baseline: `period: {period:.4g}`"
        )


def ratios(
    profiles: Sequence[Profile], baseline: str, own_periods: Mapping[str, float] | None = None
) -> list[Ratios]:
    """Divide the statistics of each building by the statistics of a baseline building, at each
    level of intensity, over the motions that the building and the baseline complete.

    Returns
    -------
    list of Ratios
        One item for each other building, level and quantity of `STORY_QUANTITIES`, and for the base
        shear, the restoring force of the first story. Levels without a profile of the baseline are
        omitted. The ratios of a level with too few common motions are NaN, except the medians.

    Raises
    ------
    UsageError, ModelError
        As by `check_baseline`.
    """
    check_baseline(baseline, (profile.building for profile in profiles), own_periods)
    result = []
    for level in at_levels(profiles):
        base = next((profile for profile in level if profile.building == baseline), None)
        if base is None:
            continue
        for compared in level:
            if compared is not base:
                names = (*(quantity.name for quantity in STORY_QUANTITIES), BASE_SHEAR)
                result += [ratios_of(compared, base, name) for name in names]
    return result


BASE_SHEAR = "base_shear"
"""Quantity of ratios: the restoring force of the first story of each building."""

_CALLED = {quantity.name: quantity.called or quantity.name for quantity in STORY_QUANTITIES}


def ratios_of(compared: Profile, base: Profile, quantity: str) -> Ratios:
    """Return the ratios of a quantity of `STORY_QUANTITIES`, or of the base shear, of a building to
    a baseline at the same level."""
    is_base_shear = quantity == BASE_SHEAR
    # Demands under the same motions, with the same factors, in both buildings
    rows_of_key = [{key: i for i, key in enumerate(item.keys)} for item in (base, compared)]
    keys = [key for key in rows_of_key[0] if key in rows_of_key[1]]
    values = []
    for profile, row_of_key in zip((base, compared), rows_of_key, strict=True):
        peaks = profile.peaks["peak_shear" if is_base_shear else quantity]
        of_motions = np.full((max(len(keys), 1), peaks.shape[1]), math.nan)
        of_motions[: len(keys)] = peaks[[row_of_key[key] for key in keys]]
        values.append(of_motions[:, :1] if is_base_shear else of_motions)
    is_drift = "drift" in quantity  # the drift of an isolator is its displacement
    apart = [[i - 1 for i in item.isolators] if is_drift else [] for item in (base, compared)]
    stories = [] if is_base_shear else story_pairs(compared, base)
    found = ratios_to(values[0], values[1], stories, (apart[0], apart[1]))
    if is_base_shear:  # one row, without a story
        found = found._replace(mean=found.mean[:1], median=found.median[:1], max=found.max[:1])
    return Ratios(compared, base, _CALLED.get(quantity, quantity), found)


def story_pairs(compared: Profile, base: Profile) -> list[tuple[int, int]]:
    """Return the indices of the stories of two buildings that correspond to each other.

    Isolators correspond to isolators if both buildings have the same number. The other stories
    correspond from the roof downwards, so that an additional story at the base shifts no number;
    but from the ground upwards if only then the heights are equal, as with a story on the roof.
    """
    isolators, stories = [], []
    for profile in (compared, base):
        numbers = range(profile.height.size)
        isolators.append([i for i in numbers if i + 1 in profile.isolators])
        stories.append([i for i in numbers if i + 1 not in profile.isolators])
    count = min(map(len, stories))

    def have_equal_heights(part: slice) -> bool:
        """Return True if the heights of a part of the stories of both buildings are equal."""
        heights = (compared.height[stories[0][part]], base.height[stories[1][part]])
        return bool(np.allclose(*heights, rtol=1e-6, equal_nan=True))

    from_roof, from_ground = slice(-count, None), slice(0, count)
    from_ground_only = have_equal_heights(from_ground) and not have_equal_heights(from_roof)
    part = from_ground if from_ground_only else from_roof
    pairs = list(zip(stories[0][part], stories[1][part], strict=True)) if count else []
    if len(isolators[0]) == len(isolators[1]):
        pairs += zip(*isolators, strict=True)
    return sorted(pairs)
