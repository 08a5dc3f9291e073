"""Peaks over the height of a building under a suite of motions: each motion's, and their mean,
fractiles and largest.

The order of operations is that of codes: the largest value of each motion over time, in each story;
the mean of it over the motions; then the worst story. The demand of a pair of horizontal components
is the one of `tdint.campaign.pairs`. What collapsed or failed is counted and has no part in any
number: a mean is that of the motions under which the building stood.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import NamedTuple

import numpy as np

from tdint.analysis.run.outcome import STORY
from tdint.analysis.run.run import run_case
from tdint.analysis.run.together import Subject
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
from tdint.system import on_threads
from tdint.units import Quantity
from tdint.written_numbers import first_few

DRIFT_RATIO = "peak_drift_ratio"
_RANK = ("level", "")
"""Of levels that are factors of the motions' own."""


@dataclass(frozen=True)
class Statistics:
    """Of a quantity over the motions, in each story; arrays of shape (n,), nan without a motion."""

    mean: Array
    median: Array
    p16: Array
    p84: Array
    max: Array

    @classmethod
    def of(cls, values: Array) -> Statistics:
        """Of values of shape (motions, n); fractiles lie on straight lines between the values in
        order."""
        if not len(values):
            return cls(*(np.full(values.shape[1], math.nan) for _ in fields(cls)))
        p16, median, p84 = np.percentile(values, (16.0, 50.0, 84.0), axis=0)
        return cls(np.mean(values, axis=0), median, p16, p84, np.max(values, axis=0))

    @classmethod
    def errors(cls, values: Array, errors: Array) -> Statistics:
        """By how much these may be off where values, shape (motions, n), are off by their errors:
        none of them falls where a value grows, so they are off most where all are to one side."""
        return cls(
            *_may_add(lambda those: np.array(list(vars(cls.of(those)).values())), values, errors)
        )


def _may_add(rising: Callable[[Array], Array], values: Array, errors: Array) -> Array:
    """By how much what rises with all values may be off where they are off by their errors, to one
    side."""
    told = rising(values)
    return np.asarray(np.maximum(rising(values + errors) - told, told - rising(values - errors)))


@dataclass(frozen=True)
class SuiteLevel:
    """A building under a suite at one level of intensity: what became of it.

    Attributes
    ----------
    scale : float
        The factor on all motions; nan where each has its own.
    level : float
        The value of the intensity measure, SI units, or where motions have several factors of their
        own the number of the factor, from 1; nan where the scale says all.
    stood : list of list of Run
        The runs of each motion that came to its end, two of a pair.
    pairs : int
        How many of the motions, whatever became of them, are pairs of components.
    collapsed, failed : int
        Motions under which the building collapsed, and whose run has no result.
    measure : tuple of str
        What the level is a value of, and its unit.
    pair_demand : str
        How the components of pairs count (`tdint.campaign.pairs`); empty if the suite has no pairs.
    """

    scale: float
    level: float
    stood: list[list[Run]]
    pairs: int
    collapsed: int
    failed: int
    measure: tuple[str, str]
    pair_demand: str

    @property
    def level_text(self) -> str:
        """The level in words, as `level_text` has it."""
        return level_text(self.scale, self.level, self.measure)

    @property
    def runs(self) -> int:
        """How many motions there were; a pair is one."""
        return len(self.stood) + self.collapsed + self.failed


@dataclass(frozen=True)
class Profile(SuiteLevel):
    """The peaks of a building under a suite at one level of intensity.

    Attributes
    ----------
    building : str
        Its name.
    motions : tuple of str
        Those that came to their end.
    height : ndarray, shape (n,)
        Story heights, m; nan where there is none.
    peaks : mapping of str to ndarray, shape (motions, n)
        The largest absolute values of each quantity of `tdint.analysis.run.outcome.STORY`, by its
        name.
    peak_errors : mapping of str to ndarray, shape (motions, n)
        Their estimated errors, nan where there is none; empty where they were not asked for.
    """

    building: str
    motions: tuple[str, ...]
    height: Array
    peaks: Mapping[str, Array]
    peak_errors: Mapping[str, Array]

    def statistics(self, quantity: Quantity) -> Statistics:
        """Of a quantity, in each story."""
        return Statistics.of(self.peaks[quantity.name])

    def errors(self, quantity: Quantity) -> Statistics | None:
        """What errors of the runs may add to these, in each story; nothing is said of the choice of
        the motions."""
        if not self.peak_errors:
            return None
        return Statistics.errors(self.peaks[quantity.name], self.peak_errors[quantity.name])


@dataclass(frozen=True)
class Ratios:
    """A quantity of a building over that of another one at the same level, in each story that both
    have.

    Attributes
    ----------
    building, baseline : str
        Their names.
    scale, level : float
        As in `Profile`.
    quantity : Quantity
        What is compared.
    mean, median, max : ndarray, shape (1 + stories,)
        First that of the largest value of all stories, then that of each story, from the ground up;
        nan where the baseline has none, or nothing.
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
    """Refuse a baseline that is none of the buildings of these names, or the only one
    (UsageError)."""
    names = list(dict.fromkeys(buildings))
    if baseline not in names:
        near = did_you_mean(baseline, names)
        raise UsageError(
            f"there is no building {baseline!r}{near}; there are {first_few(names, 10)}"
        )
    if len(names) == 1:
        raise UsageError(f"there is no building beside {baseline!r} to be compared with it")


def ratios(profiles: Sequence[Profile], baseline: str) -> list[Ratios]:
    """Of all buildings over the one of this name, level by level; without that one itself.

    Raises
    ------
    UsageError
        There is no such building, or it is the only one.
    """
    check_baseline(baseline, (other.building for other in profiles))
    # By the texts of scale and level: nan is a key then, too.
    bases = {
        (repr(other.scale), repr(other.level)): other
        for other in profiles
        if other.building == baseline
    }
    compared = []
    for profile in profiles:
        base = bases.get((repr(profile.scale), repr(profile.level)))
        if base is None or profile.building == baseline:
            continue
        for quantity in STORY:
            ours, theirs = profile.statistics(quantity), base.statistics(quantity)
            values = {
                name: _over(getattr(ours, name), getattr(theirs, name))
                for name in ("mean", "median", "max")
            }
            compared.append(
                Ratios(profile.building, baseline, profile.scale, profile.level, quantity, **values)
            )
    return compared


def _over(ours: Array, theirs: Array) -> Array:
    common = min(ours.size, theirs.size)
    # First the largest of all stories, which a building may have in another story than the
    # baseline.
    tops = [np.max(values[np.isfinite(values)], initial=-math.inf) for values in (ours, theirs)]
    over, under = (
        np.concatenate([[tops[0]], ours[:common]]),
        np.concatenate([[tops[1]], theirs[:common]]),
    )
    positive = (under > 0.0) & np.isfinite(over)
    return np.asarray(np.divide(over, under, out=np.full(over.size, math.nan), where=positive))


class DriftCheck(NamedTuple):
    """The mean drift ratios of a building beside a limit.

    `mean` and `story` (from 1) are those of the story with the largest mean, `largest` is that of
    any motion and story. It is `within` if that mean is, and the building stood under every motion.
    """

    mean: float
    story: int
    largest: float
    within: bool


def check_drift(profile: Profile, limit: float) -> DriftCheck | None:
    """Compare mean drift ratios with a limit; None where no motion came to its end.

    Raises
    ------
    UsageError
        The building has no story with a height.
    """
    if not profile.motions:
        return None
    ratios = profile.peaks[DRIFT_RATIO]
    if np.isnan(ratios).all():
        raise UsageError(
            f"{profile.building}: a limit of drift ratios needs story heights, and the model gives "
            "none"
        )
    # The story with the largest mean, not the mean of the largest: as codes check drifts of a
    # suite.
    mean = np.mean(ratios, axis=0)
    worst = int(np.nanargmax(mean))
    stood = not (profile.collapsed or profile.failed)
    return DriftCheck(
        float(mean[worst]),
        worst + 1,
        float(np.nanmax(ratios)),
        stood and bool(mean[worst] <= limit),
    )


def profiles(store: Store) -> Iterator[Profile]:
    """Of each building and level, in their order; one building is held at a time. None where no
    stories are kept."""
    if store.connection.execute("SELECT 1 FROM story_rows LIMIT 1").fetchone() is None:
        return
    # What is the same for all buildings is found once: there may be a million.
    records, counts = (
        store.records(),
        dict(store.connection.execute("SELECT id, stories FROM buildings")),
    )
    rules, checked = SuiteRules.of(store), store.checked
    named = motion_names([name for name, _, _ in records.values()])
    motion_of = dict(zip(records, named, strict=True))
    for number, (name, _) in store.buildings().items():
        # The values of the stories of each run, with their errors where the campaign has estimated
        # them.
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
        kept = {key: np.array(rows, dtype=np.float64) for key, rows in by_run.items()}
        for level in rules.levels_of(store, number):
            motions = tuple(motion_of[keys[0].motion] for keys in level.stood)
            height, peaks, errors = _peaks(level, kept, counts[number], checked)
            yield Profile(
                **vars(level),
                building=name,
                motions=motions,
                height=height,
                peaks=peaks,
                peak_errors=errors,
            )


def level_text(scale: float, level: float, measure: tuple[str, str]) -> str:
    """The level of a `Profile` in words: `scale 2`, `sa(T1) 2.94 m/s^2`, or of motions' own factors
    `level 2`."""
    if not math.isnan(scale):
        return f"scale {scale:g}"
    name, unit = measure
    return "" if math.isnan(level) else f"{name} {level:.4g} {unit}".rstrip()


@dataclass(frozen=True)
class SuiteRules:
    """How the runs of a building are taken together: the rule for pairs,
    the values of the levels and their `measure`, if one has them, and whether there are `several`
    (`has_levels`)."""

    pairs: PairRule
    values: Sequence[float]
    several: bool
    measure: tuple[str, str]

    @classmethod
    def of(cls, store: Store) -> SuiteRules:
        """Those of a campaign."""
        settings = store.parameters()
        values = sorted(settings.get("levels", ()), key=abs)
        measure = _RANK
        if values:
            name, period = settings["measure"], settings["period"]
            unit = measure_at(name, SA_DAMPING, 1.0).unit
            measure = (f"{name}({period})" if name in SPECTRAL else name, unit)
        return cls(store.pair_rule(), values, has_levels(store), measure)

    def levels_of(self, store: Store, building: int) -> Iterator[SuiteLevel]:
        """The levels of a building of the store by its number, from the smallest factor."""
        query = (
            "SELECT record, scale, sample, status FROM run_rows WHERE building = ? ORDER BY "
            "record, scale, sample"
        )
        return self.levels(
            {Run(*key): told for *key, told in store.connection.execute(query, (building,))}
        )

    def levels(self, status: Mapping[Run, str]) -> Iterator[SuiteLevel]:
        """The levels of a building, from the smallest factor, by the statuses of its runs."""
        by_rank: dict[int, list[Run]] = defaultdict(list)
        # Levels by rank of the factors, for motions may have factors of their own.
        for key, rank in level_ranks(status).items():
            by_rank[rank].append(key)
        for rank, keys in sorted(by_rank.items()):
            scales = {key.scale for key in keys}
            grouped: dict[tuple[int, int], list[Run]] = defaultdict(list)
            for key in keys:
                grouped[self.pairs.motion(key.motion), key.sample].append(key)
            # A pair that is one motion failed or fell if one of its components did.
            failed = [
                runs
                for runs in grouped.values()
                if any(status[key] not in (DONE, *FALLEN) for key in runs)
            ]
            fell = [runs for runs in grouped.values() if any(status[key] in FALLEN for key in runs)]
            yield SuiteLevel(
                math.nan if self.several or len(scales) > 1 else scales.pop(),
                self.values[rank] if self.values else rank + 1.0 if self.several else math.nan,
                [runs for runs in grouped.values() if runs not in failed and runs not in fell],
                sum(len(runs) > 1 for runs in grouped.values()),
                sum(runs not in failed for runs in fell),
                len(failed),
                self.measure,
                self.pairs.stated,
            )


def has_levels(store: Store) -> bool:
    """Whether a level is more than one factor on all motions, or one on each."""
    settings = store.parameters()
    several = any(len(values) > 1 for values in settings.get("factors", {}).values())
    placed = "grid_sha256" in settings or "field_sha256" in settings
    return "levels" in settings or several or (placed and len(settings.get("scales", ())) > 1)


def _peaks(
    level: SuiteLevel, kept: Mapping[Run, Array], stories: int, checked: bool
) -> tuple[Array, dict[str, Array], dict[str, Array]]:
    """Story heights, shape (n,), the quantities by their names, shape (motions, n), and their
    errors, if they were `checked`, from the rows of the runs."""
    if not level.stood:
        nothing = {quantity.name: np.empty((0, stories)) for quantity in STORY}
        return np.full(stories, math.nan), nothing, nothing if checked else {}
    # A residual drift has a sign.
    stood = [np.abs([kept[key] for key in keys]) for keys in level.stood]
    values, errors = (
        [block[:, :, part] for block in stood] for part in (slice(1, _OWN), slice(_OWN, None))
    )
    # The demand of a pair, from both components.
    of_motion = partial(combine, demand=level.pair_demand)
    peaks = np.stack([of_motion(block) for block in values], axis=-1)
    off = (
        [_may_add(of_motion, *block) for block in zip(values, errors, strict=True)]
        if checked
        else []
    )
    return stood[0][0, :, 0], _by_name(peaks), _by_name(np.stack(off, axis=-1)) if off else {}


def _by_name(values: Array) -> dict[str, Array]:
    """The quantities, shape (motions, n), from values of shape (n, quantities, motions)."""
    return {quantity.name: values[:, i].T for i, quantity in enumerate(STORY)}


_OWN = 1 + len(STORY)
"""Where errors begin among the columns of a story: behind its height and its quantities."""


def level_ranks(runs: Iterable[Run]) -> dict[Run, int]:
    """The level of each run, from 0: the smallest factor of every motion and draw, the next one,
    and so on."""
    factors: dict[tuple[int, int], list[Run]] = defaultdict(list)
    for key in runs:
        factors[key.motion, key.sample].append(key)
    return {
        key: rank
        for keys in factors.values()
        for rank, key in enumerate(sorted(keys, key=lambda key: abs(key.scale)))
    }


# ---- Response spectra of floors under a suite: of every run, and their mean and envelope over the
# motions


@dataclass(frozen=True)
class FloorChoice:
    """Floors by their names (numbers, or roof), periods (s) and damping ratios of their spectra."""

    floors: tuple[str, ...]
    periods: Array
    damping: tuple[float, ...]


@dataclass(frozen=True)
class RunFloors:
    """The spectra of the floors of a run.

    Attributes
    ----------
    building : int
        Its number in the store.
    run : Run
        The run.
    spectra : tuple of FloorSpectrum
        By floor, then damping.
    """

    building: int
    run: Run
    spectra: tuple[FloorSpectrum, ...]


@dataclass(frozen=True)
class FloorSuite(SuiteLevel):
    """Pseudo-accelerations of a floor of a building under a suite at one level.

    Attributes
    ----------
    building : str
        Its name.
    floor : int
        From 1 at the bottom.
    damping : float
        Of the oscillators on it.
    periods : ndarray, shape (k,)
        Natural periods, s.
    psa : ndarray, shape (motions, k)
        Of each motion that came to its end, m/s^2; of a pair its demand at each period.
    """

    building: str
    floor: int
    damping: float
    periods: Array
    psa: Array

    @property
    def mean(self) -> Array:
        """Over the motions."""
        return np.asarray(np.mean(self.psa, axis=0))

    @property
    def envelope(self) -> Array:
        """The largest of any motion."""
        return np.asarray(np.max(self.psa, axis=0))


def run_floors(plan: Plan, store: Store, choice: FloorChoice, jobs: int) -> list[RunFloors]:
    """The spectra of the floors of all runs of a campaign that came to their end: each run is done
    once more, with its history, over the steps that the store tells.

    Raises
    ------
    UsageError
        A building has no such floor.
    """
    done = store.connection.execute(
        "SELECT building, record, scale, sample, dt_s FROM run_rows WHERE status = 'done' ORDER BY "
        "1, 2, 3, 4"
    ).fetchall()
    floors: list[RunFloors] = []
    # Building by building, so that each is made once, its runs then side by side.
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
    """The spectra over the motions of each building, level, floor and damping ratio; none where no
    motion came to its end."""
    of_buildings: dict[int, dict[Run, tuple[FloorSpectrum, ...]]] = defaultdict(dict)
    for floor_run in floors:
        of_buildings[floor_run.building][floor_run.run] = floor_run.spectra
    names, rules = store.buildings(), SuiteRules.of(store)
    for number, spectra in of_buildings.items():
        # A motion that fell or failed has no history: the others alone are taken together.
        for level in rules.levels_of(store, number):
            if not level.stood:
                continue
            for i, shown in enumerate(spectra[level.stood[0][0]]):
                of, name = shown.spectrum, names[number][0]
                psa = np.array(
                    [
                        combine(
                            np.array([spectra[run][i].spectrum.psa for run in runs]),
                            level.pair_demand,
                        )
                        for runs in level.stood
                    ]
                )
                yield FloorSuite(
                    **vars(level),
                    building=name,
                    floor=shown.floor,
                    damping=of.damping,
                    periods=of.periods,
                    psa=psa,
                )
