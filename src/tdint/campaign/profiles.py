"""Peaks over the height of a building under a suite of ground motions: values of each motion, and
mean, fractiles and maximum.

The order of operations is that of design codes: maximum of each motion over time, in each story;
mean over the motions; maximum over the stories. The demand of a pair of horizontal components is
computed by the rule of `tdint.campaign.pairs`. Runs with collapse or without a result are counted,
but excluded from all statistics.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from tdint.analysis.run.batch import Subject
from tdint.analysis.run.outcome import STORY
from tdint.analysis.run.run import run_case
from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.analysis.spectra.floors import FloorSpectrum, floor_numbers, floor_spectra
from tdint.arrays import Array
from tdint.campaign.batch import Run
from tdint.campaign.intensity import SPECTRAL, measure_at
from tdint.campaign.pairs import PairRule, combine
from tdint.campaign.plan import Plan
from tdint.campaign.store import Store
from tdint.errors import UsageError, did_you_mean
from tdint.ground_motion.horizontals import motion_names
from tdint.model.damage_states import DONE, FALLEN
from tdint.model.limits import Limit, LimitCheck, check_demands, check_limits, isolator_limits
from tdint.number_parsing import abbreviate
from tdint.system import on_threads
from tdint.units import Quantity

DRIFT_RATIO = "peak_drift_ratio"
_NUMBERED_LEVEL = ("level", "")
"""Name and unit of levels that are individual factors of the motions."""


@dataclass(frozen=True)
class Statistics:
    """Statistics of a quantity over the motions, in each story; arrays of shape (n,), NaN without a
    motion."""

    mean: Array
    median: Array
    p16: Array
    p84: Array
    max: Array

    @classmethod
    def of(cls, values: Array) -> Statistics:
        """Return the statistics of values of shape (motions, n). Fractiles are interpolated
        linearly between the sorted values."""
        if not len(values):
            return cls(*(np.full(values.shape[1], math.nan) for _ in fields(cls)))
        p16, median, p84 = np.percentile(values, (16.0, 50.0, 84.0), axis=0)
        return cls(np.mean(values, axis=0), median, p16, p84, np.max(values, axis=0))

    @classmethod
    def errors(cls, values: Array, errors: Array) -> Statistics:
        """Return the maximum errors of the statistics.

        All statistics increase with the values, so that their error is maximum if all errors have
        the same sign.

        Parameters
        ----------
        values, errors : ndarray, shape (motions, n)
            Values and their errors.
        """
        return cls(
            *_maximum_error(
                lambda samples: np.array(list(vars(cls.of(samples)).values())), values, errors
            )
        )


def _maximum_error(rising: Callable[[Array], Array], values: Array, errors: Array) -> Array:
    """Return the maximum error of a function that increases with all values, for errors of the same
    sign.

    Parameters
    ----------
    rising : callable
        Function.
    values, errors : ndarray
        Values and their errors.
    """
    result = rising(values)
    upper, lower = rising(values + errors) - result, result - rising(values - errors)
    return np.asarray(np.maximum(upper, lower))


@dataclass(frozen=True)
class SuiteLevel:
    """Outcome of the runs of a building under a suite at one level of intensity.

    Attributes
    ----------
    scale : float
        Scale factor of all motions; NaN if motions have different factors.
    level : float
        Value of the intensity measure, SI units; if motions have several individual factors, number
        of the factor, from 1; NaN if `scale` is sufficient.
    completed : list of list of Run
        Completed runs of each motion, two for a pair.
    pairs : int
        Number of motions that are pairs of components, including collapsed and failed runs.
    collapsed, failed : int
        Number of motions with collapse, and number of motions without a result.
    measure : tuple of str
        Name and unit of the level.
    pair_demand : str
        Rule that combines the components of pairs (`tdint.campaign.pairs`); empty if the suite has
        no pairs.
    """

    scale: float
    level: float
    completed: list[list[Run]]
    pairs: int
    collapsed: int
    failed: int
    measure: tuple[str, str]
    pair_demand: str

    @property
    def level_text(self) -> str:
        """Text of the level, as in `level_text`."""
        return level_text(self.scale, self.level, self.measure)

    @property
    def runs(self) -> int:
        """Number of motions; a pair is one motion."""
        return len(self.completed) + self.collapsed + self.failed


@dataclass(frozen=True)
class Profile(SuiteLevel):
    """Peaks of a building under a suite at one level of intensity.

    Attributes
    ----------
    building : str
        Name of the building.
    motions : tuple of str
        Motions of completed runs.
    height : ndarray, shape (n,)
        Story heights, m; NaN if not specified.
    peaks : mapping of str to ndarray, shape (motions, n)
        Maximum absolute values of each quantity of `tdint.analysis.run.outcome.STORY`, by its name.
    peak_errors : mapping of str to ndarray, shape (motions, n)
        Their estimated errors, NaN if missing; empty if not requested.
    limits : tuple of Limit
        Limits of the model of the building.
    isolators : tuple of int
        Stories with isolators, from 1.
    """

    building: str
    motions: tuple[str, ...]
    height: Array
    peaks: Mapping[str, Array]
    peak_errors: Mapping[str, Array]
    limits: tuple[Limit, ...] = ()
    isolators: tuple[int, ...] = ()

    def limit_checks(self, limit: float | str | None = None) -> tuple[LimitCheck, ...]:
        """Compare the mean demands over the motions with limits.

        The mean is computed in each story, and the comparison uses the story with the maximum
        ratio of mean demand to limit, as in design codes. A building that collapsed or failed under
        a motion does not meet any limit.

        Parameters
        ----------
        limit : float or str, optional
            Drift limit that is used instead of the limits of the model, or the name of a
            performance level of the model. By default, all limits of the model.

        Returns
        -------
        tuple of LimitCheck
            One comparison for each limit; empty if no run is completed.

        Raises
        ------
        UsageError
            No story has a height, or the model does not have the performance level.
        """
        return check_demands(
            self.limits,
            limit,
            self.peaks,
            self.height,
            self.motions,
            name=self.building,
            lost=bool(self.collapsed or self.failed),
        )

    @property
    def isolator_check(self) -> LimitCheck | None:
        """Displacement of the isolators with an infinite limit; None without isolators."""
        limits = isolator_limits(self.isolators, len(self.height))
        return next(iter(check_limits(limits, self.peaks, self.height, self.motions)), None)

    def statistics(self, quantity: Quantity) -> Statistics:
        """Return the statistics of a quantity in each story."""
        return Statistics.of(self.peaks[quantity.name])

    def errors(self, quantity: Quantity) -> Statistics | None:
        """Return the effect of the errors of the runs on the statistics in each story, or None. The
        uncertainty due to the selection of motions is not included."""
        if not self.peak_errors:
            return None
        return Statistics.errors(self.peaks[quantity.name], self.peak_errors[quantity.name])


@dataclass(frozen=True)
class Ratios:
    """Ratio of a quantity of a building to the quantity of the baseline at the same level, in each
    story that both buildings have.

    Attributes
    ----------
    building, baseline : str
        Names of the buildings.
    scale, level : float
        As in `Profile`.
    quantity : Quantity
        Quantity that is compared.
    mean, median, max : ndarray, shape (1 + stories,)
        Ratio of the maximum over all stories, then ratio of each story from the ground up; NaN if
        the baseline has no value, or zero.
    """

    building: str
    baseline: str
    scale: float
    level: float
    quantity: Quantity
    mean: Array
    median: Array
    max: Array


def check_baseline(baseline: str, buildings: Iterable[str]) -> None:
    """Raise UsageError if a baseline is not one of the buildings, or is the only building."""
    names = list(dict.fromkeys(buildings))
    if baseline not in names:
        suggestion = did_you_mean(baseline, names)
        raise UsageError(
            f"building {baseline!r} not found{suggestion}; available buildings: "
            f"{abbreviate(names, 10)}"
        )
    if len(names) == 1:
        raise UsageError(f"no other building to compare with {baseline!r}; add a building")


def ratios(profiles: Sequence[Profile], baseline: str) -> list[Ratios]:
    """Return the ratios of all other buildings to a baseline, level by level.

    Parameters
    ----------
    profiles : sequence of Profile
        Profiles of all buildings.
    baseline : str
        Name of the baseline.

    Raises
    ------
    UsageError
        The baseline does not exist, or is the only building.
    """
    check_baseline(baseline, (other.building for other in profiles))
    # The keys are texts, because scale or level may be NaN, which is not equal to NaN.
    baseline_profiles = {
        (repr(other.scale), repr(other.level)): other
        for other in profiles
        if other.building == baseline
    }
    compared = []
    for profile in profiles:
        base = baseline_profiles.get((repr(profile.scale), repr(profile.level)))
        if base is None or profile.building == baseline:
            continue
        for quantity in STORY:
            compared_values, base_values = profile.statistics(quantity), base.statistics(quantity)
            values = {
                name: _story_ratios(getattr(compared_values, name), getattr(base_values, name))
                for name in ("mean", "median", "max")
            }
            compared.append(
                Ratios(profile.building, baseline, profile.scale, profile.level, quantity, **values)
            )
    return compared


def _story_ratios(compared_values: Array, base_values: Array) -> Array:
    """Return the ratios of the maxima over all stories, and of each common story."""
    common = min(compared_values.size, base_values.size)
    # The first ratio is that of the maxima over all stories, which may occur in different stories
    # of the two buildings.
    maxima = [
        np.max(values[np.isfinite(values)], initial=-math.inf)
        for values in (compared_values, base_values)
    ]
    numerator = np.concatenate([[maxima[0]], compared_values[:common]])
    denominator = np.concatenate([[maxima[1]], base_values[:common]])
    is_known = (denominator > 0.0) & np.isfinite(numerator)
    result = np.full(numerator.size, math.nan)
    return np.asarray(np.divide(numerator, denominator, out=result, where=is_known))


def profiles(store: Store) -> Iterator[Profile]:
    """Yield the profiles of each building and level in order. Only one building is in memory at a
    time. Without stored peaks of stories, there are no profiles."""
    if store.connection.execute("SELECT 1 FROM story_rows LIMIT 1").fetchone() is None:
        return
    # Query the tables before the loop, because there may be a million buildings.
    records = store.records()
    counts = dict(store.connection.execute("SELECT id, stories FROM buildings"))
    rules, checked = SuiteRules.of(store), store.checked
    names = motion_names([name for name, _, _ in records.values()])
    name_of_record = dict(zip(records, names, strict=True))
    for number, (name, _) in store.buildings().items():
        # Read the values of the stories of each run, with their errors if these were estimated.
        quantities = [quantity.column for quantity in STORY]
        columns = ", ".join(
            ("height_m", *quantities, *(f"{name}_error" for name in quantities if checked))
        )
        query = (
            f"SELECT record, scale, sample, {columns} FROM story_rows WHERE building = ? ORDER BY "
            "1, 2, 3, story"
        )
        by_run: dict[Run, list[list[float]]] = defaultdict(list)
        for record, scale, sample, *values in store.connection.execute(query, (number,)):
            by_run[Run(record, scale, sample)].append(values)
        values_of_run = {key: np.array(rows, dtype=np.float64) for key, rows in by_run.items()}
        for level in rules.levels_of(store, number):
            motions = tuple(name_of_record[keys[0].motion] for keys in level.completed)
            height, peaks, errors = _peaks(level, values_of_run, counts[number], checked)
            yield Profile(
                **vars(level),
                building=name,
                motions=motions,
                height=height,
                peaks=peaks,
                peak_errors=errors,
                limits=store.limits(number).limits,
                isolators=store.limits(number).isolators,
            )


def level_text(scale: float, level: float, measure: tuple[str, str]) -> str:
    """Return the text of an intensity level.

    The text is `scale 2` if all motions have the same factor. Otherwise it is the intensity measure
    and its value, such as `sa(T1) 2.94 m/s^2`, or the number of the level, `level 2`, if
    motions have individual factors. It is empty if both `scale` and `level` are unknown.

    Parameters
    ----------
    scale : float
        Factor of all motions; NaN if they have different factors.
    level : float
        Value of the intensity measure, or number of the level; NaN if there is neither.
    measure : tuple of (str, str)
        Name and unit of the intensity measure; `level` without a unit for numbered levels.
    """
    if not math.isnan(scale):
        return f"scale {scale:g}"
    name, unit = measure
    return "" if math.isnan(level) else f"{name} {level:.4g} {unit}".rstrip()


@dataclass(frozen=True)
class SuiteRules:
    """Rules that combine the runs of a building.

    Attributes
    ----------
    pairs : PairRule
        Rule for pairs.
    values : sequence of float
        Values of the levels of an intensity measure; empty without a measure.
    has_several_levels : bool
        True if there are several levels (`has_levels`).
    measure : tuple of str
        Name and unit of the levels.
    """

    pairs: PairRule
    values: Sequence[float]
    has_several_levels: bool
    measure: tuple[str, str]

    @classmethod
    def of(cls, store: Store) -> SuiteRules:
        """Return the rules of a campaign."""
        settings = store.parameters()
        values = sorted(settings.get("levels", ()), key=abs)
        measure = _NUMBERED_LEVEL
        if values:
            name, period = settings["measure"], settings["period"]
            unit = measure_at(name, SA_DAMPING, 1.0).unit
            measure = (f"{name}({period})" if name in SPECTRAL else name, unit)
        return cls(store.pair_rule(), values, has_levels(store), measure)

    def levels_of(self, store: Store, building: int) -> Iterator[SuiteLevel]:
        """Yield the levels of a building of the store in ascending order of factors."""
        query = (
            "SELECT record, scale, sample, status FROM run_rows WHERE building = ? ORDER BY "
            "record, scale, sample"
        )
        return self.levels(
            {Run(*key): status for *key, status in store.connection.execute(query, (building,))}
        )

    def levels(self, status: Mapping[Run, str]) -> Iterator[SuiteLevel]:
        """Yield the levels of a building in ascending order of factors, from the statuses of its
        runs."""
        by_rank: dict[int, list[Run]] = defaultdict(list)
        # Motions may have different factors for the same level. The level of a run is therefore the
        # rank of its factor.
        for key, rank in level_ranks(status).items():
            by_rank[rank].append(key)
        for rank, keys in sorted(by_rank.items()):
            scales = {key.scale for key in keys}
            grouped: dict[tuple[int, int], list[Run]] = defaultdict(list)
            for key in keys:
                grouped[self.pairs.motion(key.motion), key.sample].append(key)
            # A motion failed or collapsed if the run of one of its components did. A motion with a
            # failed and a collapsed component counts as failed.
            failed = [
                runs
                for runs in grouped.values()
                if any(status[key] not in (DONE, *FALLEN) for key in runs)
            ]
            collapsed = [
                runs for runs in grouped.values() if any(status[key] in FALLEN for key in runs)
            ]
            yield SuiteLevel(
                math.nan if self.has_several_levels or len(scales) > 1 else scales.pop(),
                self.values[rank]
                if self.values
                else rank + 1.0
                if self.has_several_levels
                else math.nan,
                [runs for runs in grouped.values() if runs not in failed and runs not in collapsed],
                sum(len(runs) > 1 for runs in grouped.values()),
                sum(runs not in failed for runs in collapsed),
                len(failed),
                self.measure,
                self.pairs.stated,
            )


def has_levels(store: Store) -> bool:
    """Return True if levels are not a single factor for all motions, or for each motion."""
    settings = store.parameters()
    several = any(len(values) > 1 for values in settings.get("factors", {}).values())
    placed = "grid_sha256" in settings or "field_sha256" in settings
    return "levels" in settings or several or (placed and len(settings.get("scales", ())) > 1)


def _peaks(
    level: SuiteLevel, values_of_run: Mapping[Run, Array], stories: int, checked: bool
) -> tuple[Array, dict[str, Array], dict[str, Array]]:
    """Return the peaks of the completed runs of a level.

    Parameters
    ----------
    level : SuiteLevel
        Level.
    values_of_run : mapping of Run to ndarray
        Rows of the stories of each run.
    stories : int
        Number of stories.
    checked : bool
        True if errors were estimated.

    Returns
    -------
    height : ndarray, shape (n,)
        Story heights, m.
    peaks, errors : dict of str to ndarray, shape (motions, n)
        Quantities by name, and their errors; empty if not estimated.
    """
    if not level.completed:
        no_values = {quantity.name: np.empty((0, stories)) for quantity in STORY}
        return np.full(stories, math.nan), no_values, no_values if checked else {}
    # Residual drifts are signed: use absolute values.
    # Each block has the axes component, story, and column (height, quantities, errors).
    blocks = [np.abs([values_of_run[key] for key in keys]) for keys in level.completed]
    values, errors = (
        [block[:, :, part] for block in blocks]
        for part in (slice(1, _FIRST_ERROR), slice(_FIRST_ERROR, None))
    )
    # Combine the components of pairs.
    combine_pair = partial(combine, demand=level.pair_demand)
    peaks = np.stack([combine_pair(block) for block in values], axis=-1)
    peak_errors = (
        [_maximum_error(combine_pair, *block) for block in zip(values, errors, strict=True)]
        if checked
        else []
    )
    return (
        blocks[0][0, :, 0],
        _by_name(peaks),
        _by_name(np.stack(peak_errors, axis=-1)) if peak_errors else {},
    )


def _by_name(values: Array) -> dict[str, Array]:
    """Return the quantities, shape (motions, n), from values of shape (n, quantities, motions)."""
    return {quantity.name: values[:, i].T for i, quantity in enumerate(STORY)}


_FIRST_ERROR = 1 + len(STORY)
"""Index of the first error in the columns of a story, after its height and its quantities."""


def level_ranks(runs: Iterable[Run]) -> dict[Run, int]:
    """Return the level of each run, from 0: the rank of its factor for the same motion and
    sample."""
    factors: dict[tuple[int, int], list[Run]] = defaultdict(list)
    for key in runs:
        factors[key.motion, key.sample].append(key)
    return {
        key: rank
        for keys in factors.values()
        for rank, key in enumerate(sorted(keys, key=lambda key: abs(key.scale)))
    }


# ---- Floor response spectra under a suite: spectra of each run, mean and envelope over the motions


@dataclass(frozen=True)
class FloorChoice:
    """Floors by their names (numbers, or roof), and periods (s) and damping ratios of their
    spectra."""

    floors: tuple[str, ...]
    periods: Array
    damping: tuple[float, ...]


@dataclass(frozen=True)
class RunFloors:
    """Floor spectra of a run.

    Attributes
    ----------
    building : int
        Number of the building in the store.
    run : Run
        The run.
    spectra : tuple of FloorSpectrum
        Spectra by floor, then damping ratio.
    """

    building: int
    run: Run
    spectra: tuple[FloorSpectrum, ...]


@dataclass(frozen=True)
class FloorSuite(SuiteLevel):
    """Pseudo-accelerations on a floor of a building under a suite at one level.

    Attributes
    ----------
    building : str
        Name of the building.
    floor : int
        Number of the floor, from 1 at the bottom.
    damping : float
        Damping ratio of the oscillators on the floor.
    periods : ndarray, shape (k,)
        Natural periods, s.
    psa : ndarray, shape (motions, k)
        Pseudo-acceleration of each completed motion, m/s^2; demand of a pair at each period.
    """

    building: str
    floor: int
    damping: float
    periods: Array
    psa: Array

    @property
    def mean(self) -> Array:
        """Mean over the motions."""
        return np.asarray(np.mean(self.psa, axis=0))

    @property
    def envelope(self) -> Array:
        """Maximum over the motions."""
        return np.asarray(np.max(self.psa, axis=0))


def run_floors(plan: Plan, store: Store, choice: FloorChoice, jobs: int) -> list[RunFloors]:
    """Return the floor spectra of all completed runs of a campaign. Each run is repeated with its
    response history and with the stored time step.

    Parameters
    ----------
    plan : Plan
        Plan of the campaign.
    store : Store
        Store of the campaign.
    choice : FloorChoice
        Floors, periods and damping ratios.
    jobs : int
        Number of threads.

    Raises
    ------
    UsageError
        A building does not have the floor.
    """
    done = store.connection.execute(
        "SELECT building, record, scale, sample, dt_s FROM run_rows WHERE status = 'done' ORDER BY "
        "1, 2, 3, 4"
    ).fetchall()
    floors: list[RunFloors] = []
    # Create each building once, and integrate its runs in parallel.
    buildings: dict[int, list[tuple[Run, float]]] = defaultdict(list)
    for building, record, scale, sample, dt in done:
        buildings[building].append((Run(record, scale, sample), dt))
    for building, runs in buildings.items():
        subject = plan.buildings[building].subject()
        floor_numbers(choice.floors, plan.buildings[building].stories)
        floors += on_threads(partial(_spectra, plan, building, subject, choice), runs, jobs)
    return sorted(floors, key=lambda floors_of_run: (floors_of_run.building, floors_of_run.run))


def _spectra(
    plan: Plan, building: int, subject: Subject, choice: FloorChoice, run: tuple[Run, float]
) -> RunFloors:
    """Return the floor spectra of a run.

    Parameters
    ----------
    plan : Plan
        Plan of the campaign.
    building : int
        Number of the building.
    subject : Subject
        The building and its method.
    choice : FloorChoice
        Floors, periods and damping ratios.
    run : tuple of (Run, float)
        The run and its time step, s.
    """
    key, dt = run
    settings, case = plan.settings, subject.case(plan.motions[key.motion].record, key.scale)
    response = run_case(
        case,
        dt=dt,
        duration=settings.duration,
        history=True,
        check=False,
        until_rest=settings.until_rest,
    )
    return RunFloors(
        building, key, floor_spectra(response, choice.floors, choice.periods, choice.damping)
    )


def floor_suites(store: Store, floors: Sequence[RunFloors]) -> Iterator[FloorSuite]:
    """Yield the floor spectra over the motions for each building, level, floor and damping ratio.
    Levels without completed runs are omitted."""
    spectra_by_building: dict[int, dict[Run, tuple[FloorSpectrum, ...]]] = defaultdict(dict)
    for floor_run in floors:
        spectra_by_building[floor_run.building][floor_run.run] = floor_run.spectra
    names, rules = store.buildings(), SuiteRules.of(store)
    for number, spectra in spectra_by_building.items():
        # Collapsed and failed runs have no response history and are excluded.
        for level in rules.levels_of(store, number):
            if not level.completed:
                continue
            for i, shown in enumerate(spectra[level.completed[0][0]]):
                spectrum, name = shown.spectrum, names[number][0]
                psa = np.array(
                    [
                        combine(
                            np.array([spectra[run][i].spectrum.psa for run in runs]),
                            level.pair_demand,
                        )
                        for runs in level.completed
                    ]
                )
                yield FloorSuite(
                    **vars(level),
                    building=name,
                    floor=shown.floor,
                    damping=spectrum.damping,
                    periods=spectrum.periods,
                    psa=psa,
                )
