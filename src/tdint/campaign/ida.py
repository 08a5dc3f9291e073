"""Incremental dynamic analysis of a building under many records: the work behind `tdint ida`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from tdint.analysis.given import AnyModel, AnyMotion, model_of, motion_of
from tdint.analysis.run.outcome import UNSTABLE
from tdint.analysis.run.prepared import Motions
from tdint.analysis.run.together import Subject
from tdint.campaign.batch import Batch, Done, Rows, Run, RunRow, RunSettings
from tdint.campaign.buildings import GivenBuilding
from tdint.campaign.ida_curve import (
    DamagedState,
    IdaCurve,
    IdaRun,
    LevelSearch,
    Mainshock,
    PairCurve,
    damaged,
)
from tdint.campaign.intensity import (
    GEOMETRIC_MEAN,
    IntensityMeasure,
    SpectralIntensity,
    factor_to,
    sa,
)
from tdint.campaign.pairs import LARGER, SEPARATE, check_pair_demand, join_pairs
from tdint.campaign.store import Identity, Store, as_json, open_or_begin
from tdint.campaign.store_schema import locked
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.reading.suites import SuiteMotion, components
from tdint.ground_motion.record import JoinedRecord, Record
from tdint.methods.catalogue import DEFAULT_METHOD
from tdint.model.building import Building
from tdint.model.definition import Model
from tdint.system import on_threads
from tdint.tabular import Progress, Tabular, told_progress
from tdint.units import OutputUnits
from tdint.written_numbers import how_many

THRESHOLDS = (0.01, 0.02, 0.04)
"""Drift ratios whose capacities are told beside that of collapse, where neither the settings nor
the model's damage states tell others."""

PRECISION = 0.05  # of a capacity: a tenth of the scatter between motions (beta .3 to .5)

_ELASTIC = 0.1
"""Part of the collapse drift that the first run stays below, where no story yields before."""

_ABOVE = 1.05
"""A threshold below so many times what a mainshock has left is not looked for."""

_BEFORE_YIELDING = 0.7
"""Part of the smallest yield drift that the first run is aimed at."""

RecordRuns = tuple[IdaRun, ...]
"""Of a record, from the lowest level."""


@dataclass(frozen=True)
class IdaSettings:
    """What an incremental dynamic analysis asks for.

    Attributes
    ----------
    precision : float
        Bracket of the capacity: upper over lower level, less 1.
    collapse_drift : float or None
        Drift ratio over which the building has collapsed; by default the model's.
    thresholds : tuple of float or None
        Drift ratios whose capacities are told beside that of collapse; by default the medians of
        the model's damage states, where they are drift ratios, else `THRESHOLDS`.
    max_im : float
        The largest intensity, in the measure's unit: capacities above it are censored.
    dt, duration : float or None
        Step and duration of the runs, s; by default the model's, else those of the record.
    until_rest : bool
        Go on after that with the ground at rest until the building is: residual drifts are at rest
        then.
    check : bool
        Estimate the errors of the demands of each run.
    """

    precision: float = PRECISION
    collapse_drift: float | None = None
    thresholds: tuple[float, ...] | None = None
    max_im: float = math.inf
    dt: float | None = None
    duration: float | None = None
    until_rest: bool = False
    check: bool = False


@dataclass(frozen=True, repr=False)
class IdaStudy(Tabular):
    """The curves of a building under many records.

    Attributes
    ----------
    model : Model
        The building, with the collapse drift of the study.
    measure : IntensityMeasure
        What the levels are levels of.
    method : str
        The method with all its parameters.
    thresholds : tuple of float
        Drift ratios whose capacities are asked for, rising, the collapse drift last.
    curves : tuple of IdaCurve
        One for each record, in the order given.
    pair : str or None
        What of a pair of components the levels are levels of: a name of `PAIRS`; None for those of
        each component.
    resumed : int
        Records whose runs were there already.
    remarks : tuple of str
        What is to be said of those, one sentence each.
    checked : bool
        Whether the errors of the demands were estimated.
    pair_demand : str
        How the two components of a pair count: one of `tdint.campaign.pairs.PAIR_DEMANDS`.
    partners : mapping of int to int
        The place of the first component for the place of each second one among the records.
    """

    model: Model
    measure: IntensityMeasure
    method: str
    thresholds: tuple[float, ...]
    curves: tuple[IdaCurve, ...]
    pair: str | None = None
    resumed: int = 0
    remarks: tuple[str, ...] = ()
    checked: bool = False
    pair_demand: str = LARGER
    partners: Mapping[int, int] = field(default_factory=dict)

    def _headline(self) -> str:
        return (
            f"of {self.model.name!r}: {how_many(len(self.curves), 'record')}, levels of "
            f"{self.im_name}, {self.method}"
        )

    @property
    def im_name(self) -> str:
        """The intensity measure, with what stands for a pair before it."""
        return self.measure.name if self.pair is None else f"{self.pair}-{self.measure.name}"

    @property
    def states(self) -> list[IdaStudy]:
        """The studies of the building in each of its states, the intact one first."""
        damages = dict.fromkeys(curve.damage for curve in self.curves)
        return [
            replace(self, curves=tuple(curve for curve in self.curves if curve.damage == state))
            for state in damages
        ]

    @property
    def motion_curves(self) -> tuple[IdaCurve, ...]:
        """A curve for each motion: of a pair one, unless its components count separately."""
        if self.pair_demand == SEPARATE or not self.partners:
            return self.curves
        seconds = {first: second for second, first in self.partners.items()}
        curves: list[IdaCurve] = []
        for state in self.states:
            for place, curve in enumerate(state.curves):
                if place in seconds:
                    other = state.curves[seconds[place]]
                    curves.append(PairCurve.of(curve, other, self.pair_demand))
                elif place not in self.partners:
                    curves.append(curve)
        return tuple(curves)

    def in_units(self, units: OutputUnits) -> IdaStudy:
        """The study with its intensities, and all that follows from them, in other units."""
        unit, factor = units.unit(self.measure.unit)
        if factor == 1.0:
            return self
        curves = (
            replace(curve, runs=tuple(replace(run, im=run.im / factor) for run in curve.runs))
            for curve in self.curves
        )
        return replace(self, measure=replace(self.measure, unit=unit), curves=tuple(curves))


def ida(
    model: AnyModel,
    motions: Sequence[AnyMotion],
    measure: IntensityMeasure | None = None,
    settings: IdaSettings | None = None,
    *,
    method: str | None = None,
    pair: str = GEOMETRIC_MEAN,
    jobs: int = 1,
    folder: Path | None = None,
    progress: bool | Progress = False,
    mainshock: Mainshock | None = None,
    pair_demand: str = LARGER,
) -> IdaStudy:
    """Run a building at levels of intensity until its collapse is bracketed, under each record for
    itself.

    Parameters
    ----------
    model : Model, str, Path or mapping
        What `run` takes; all stories have heights.
    motions : sequence of Record, of Horizontals, or of paths and traces
        Ground motions, none twice. Of a pair both components are run, each for itself, at levels of
        the pair's intensity.
    measure : IntensityMeasure, optional
        Sa at the building's first period with 5 % damping by default.
    settings : IdaSettings, optional
        Precision, thresholds, largest level, steps.
    method : str, optional
        In place of the model's.
    pair : str
        What the intensity of a pair is: a name of `PAIRS`.
    jobs : int
        Threads; the result does not depend on it.
    folder : Path, optional
        Where the runs are kept as they are done, and found again by the next call with the same
        arguments.
    progress : bool or callable
        A bar on a terminal or in a notebook, by tqdm, or what is told how much is done, of how
        much.
    mainshock : Mainshock, optional
        Do the same once more with the building damaged by it: drifts are then the largest under the
        motions of the study, counted from where the building stood at first.
    pair_demand : str
        How the two components of a recording count in capacities and fractiles: `larger`, `mean` or
        `separate`. Records that are one recording by their names are a pair unless they count
        separately.

    Returns
    -------
    IdaStudy
        A curve for each record, with its runs and capacities.

    Raises
    ------
    UsageError
        Settings that make no sense; a record twice; a folder with another study.
    ModelError
        A story has no height.
    RecordError
        A record is zero.
    AnalysisError
        The step is beyond the method's limit, or the period too short for a record.
    OutputError
        The folder cannot be written.
    """
    settings = settings or IdaSettings()
    if isinstance(motions, Record | Horizontals | str):
        motions = [motions]
    subject, settings = _prepared(model_of(model), settings, method)
    suite = [motion_of(motion) for motion in motions]
    if check_pair_demand(pair_demand) != SEPARATE:
        suite = join_pairs(suite)
    chosen = measure or sa(subject.period)
    # A pair is one motion of two records, with one intensity for both.
    parts = [(motion, record) for motion in suite for record in components(motion)]
    records = [record for _, record in parts]
    # Records are told apart by their names in the tables and in the folder.
    names = [record.name for record in records]
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if twice:
        raise UsageError(f"{twice[0]}: this record is given twice")
    if not names:
        raise UsageError("no record: an incremental dynamic analysis needs one at least")
    # Compiled before threads begin, which would all wait for it.
    subject.prepared.compile([subject.integrator])
    states = _states(subject, records, mainshock, settings)
    # A work is a record after a state of the building: its levels follow from its own runs alone.
    ordered = [
        (*part, before) for state in states for part, before in zip(parts, state, strict=True)
    ]
    works = [
        _Work.of(number, subject, record, chosen, chosen.of(motion, pair), settings, before)
        for number, (motion, record, before) in enumerate(ordered)
    ]
    paired = pair if len(parts) > len(suite) else None
    # What the runs depend on is kept with them: another study in the folder is refused.
    identity = _identity(subject, chosen, settings, [work.record for work in works], paired)
    with (
        _opened(folder, identity) as (store, remarks),
        told_progress(progress, len(works), "record") as told,
    ):
        runs_of_works, resumed = _done(works, store, jobs, told)
    collapse_drift = subject.model.collapse_drift
    # Curves in the order of the works: all records of a state, then those of the next.
    curves = [
        IdaCurve(record, runs, collapse_drift, *((before.drift, before.left) if before else ()))
        for (_, record, before), runs in zip(ordered, runs_of_works, strict=True)
    ]
    # Collapse is the last of the thresholds, whatever others are asked for.
    thresholds = (*sorted(set(settings.thresholds or ()) - {collapse_drift}), collapse_drift)
    of = subject.model, chosen, subject.integrator.label, thresholds
    partners = {
        place: place - 1
        for place, (motion, record) in enumerate(parts)
        if isinstance(motion, Horizontals) and record is motion.second
    }
    return IdaStudy(
        *of,
        tuple(curves),
        paired,
        resumed,
        tuple(remarks),
        settings.check,
        pair_demand,
        partners,
    )


STORE = "ida.sqlite"
"""The store in the folder of a study: a chunk of it is a record."""


@contextmanager
def _opened(folder: Path | None, identity: Identity) -> Iterator[tuple[Store, list[str]]]:
    """The store of a study in a folder that nobody else writes, and what to say of it; in memory
    without a folder."""
    with locked(folder) if folder else nullcontext():
        store, remarks = open_or_begin(folder / STORE if folder else None, identity, log=False)
        with store:
            yield store, remarks


@dataclass(frozen=True)
class _Work:
    """The runs of a record by its number: what does them, the measure of its intensity and its
    value for the record as it is, and what decides on the levels."""

    number: int
    batch: Batch
    measure: IntensityMeasure
    intensity: float
    levels: LevelSearch

    @property
    def record(self) -> Record:
        """What is scaled."""
        return self.batch.motions.records[self.number]

    @classmethod
    def of(
        cls,
        number: int,
        subject: Subject,
        record: Record,
        measure: IntensityMeasure,
        intensity: float,
        settings: IdaSettings,
        before: DamagedState | None = None,
    ) -> _Work:
        # Drifts that a mainshock has left tell nothing of the next shock: thresholds above them
        # alone count.
        left = before.left if before else 0.0
        elastic = _elastic_scale(subject.prepared.building, record, subject.model.collapse_drift)
        # The first level is below yield by the first mode, so that a curve begins elastic.
        levels = LevelSearch(
            start=intensity * elastic**measure.growth,
            precision=settings.precision,
            lowest_drift=min(
                (drift for drift in settings.thresholds or () if drift > _ABOVE * left),
                default=math.inf,
            ),
            most=settings.max_im,
        )
        how = RunSettings(settings.dt, settings.duration, settings.until_rest, check=settings.check)
        # The mainshock keeps its scale while that of the record grows.
        if before:
            record = JoinedRecord.of([before.record, record], before.rest, fixed=1)
        batch = Batch(0, subject, Motions({number: record}), {number: None}, how)
        return cls(number, batch, measure, intensity, levels)

    def done(self) -> tuple[Done, RecordRuns]:
        """Do all runs of the record; one that has no result is repeated with half the step.
        FailedRun where the step is beyond the method's limit."""
        began, rows = time.thread_time(), Rows()

        def run(scale: float) -> RunRow:
            (row,) = self.batch.results([Run(self.number, scale)]).runs
            if row.status == UNSTABLE:  # No level mends that; said as a single run says it.
                case, settings = self.batch.subject.case(self.record), self.batch.settings
                case.march(case.steps(settings.dt, settings.duration))
            rows.runs.append(row)
            return row

        runs = self._through(run)
        return Done(self.number, rows, time.thread_time() - began), runs

    def kept(self, rows: Sequence[RunRow]) -> RecordRuns | None:
        """The runs whose rows were kept; None if they are not those that `done` would do."""
        by_scale = {row.scale: row for row in rows}
        try:
            runs = self._through(by_scale.__getitem__)
        except KeyError:
            return None
        return runs if len(runs) == len(rows) else None

    def _through(self, run: Callable[[float], RunRow]) -> RecordRuns:
        """The runs from the lowest level; each level follows from the runs before."""
        runs: list[IdaRun] = []
        while (level := self.levels.next(runs)) is not None:
            runs.append(IdaRun.of(level, run(factor_to(level, self.measure, self.intensity))))
        return tuple(sorted(runs, key=lambda run: run.im))


def _done(
    works: Sequence[_Work], store: Store, jobs: int, progress: Progress
) -> tuple[list[RecordRuns], int]:
    """The runs of all records, and how many records were done before; the others are shared by
    threads."""
    results: dict[int, RecordRuns] = {}
    for number in sorted(store.done()):
        if runs := works[number].kept(store.runs_of(number)):
            results[number] = runs
        else:  # of a version with other levels
            store.remove({number})
    resumed = len(results)
    progress(resumed, len(works))
    for done, runs in on_threads(
        _Work.done, [work for work in works if work.number not in results], max(1, jobs)
    ):
        results[done.number] = runs
        store.add(done)
        progress(len(results), len(works))
    return [results[work.number] for work in works], resumed


def _prepared(
    model: Model, settings: IdaSettings, method: str | None
) -> tuple[Subject, IdaSettings]:
    """The building, put together, and settings that make sense."""
    collapse_drift = settings.collapse_drift or model.collapse_drift
    if not 0.0 < settings.precision <= 0.5:
        raise UsageError(
            "the precision of a capacity must be above 0 and at most 50 %, got "
            f"{settings.precision:g}"
        )
    # Without thresholds those of the model's own damage states, if these are drift ratios.
    states = model.damage if model.damage and model.damage.demand == "drift_ratio" else None
    medians = (
        tuple(median for median in states.medians if median <= collapse_drift)
        if states
        else THRESHOLDS
    )
    thresholds = medians if settings.thresholds is None else settings.thresholds
    for threshold in thresholds:
        if not 0.0 < threshold <= collapse_drift:
            raise UsageError(
                f"threshold {threshold:g}: a drift ratio above 0 and at most the collapse drift, "
                f"{collapse_drift:g}"
            )
    if not settings.max_im > 0.0:
        raise UsageError(f"the largest intensity must be positive, got {settings.max_im:g}")
    # An isolator has no drift ratio and needs no height; of isolators alone there would be none at
    # all.
    without = [
        i
        for i, story in enumerate(model.stories, start=1)
        if story.height is None and not story.isolator
    ]
    if all(story.isolator for story in model.stories):
        without = [1]
    if without:
        raise ModelError(
            f"{model.source}: an incremental dynamic analysis needs drift ratios: give story "
            f"{without[0]} a height"
        )
    subject = Subject(
        replace(model, collapse_drift=collapse_drift),
        method or model.analysis.method or DEFAULT_METHOD,
    )
    return subject, replace(settings, collapse_drift=collapse_drift, thresholds=thresholds)


def _states(
    subject: Subject, records: Sequence[Record], mainshock: Mainshock | None, settings: IdaSettings
) -> list[list[DamagedState | None]]:
    """For each state of the building what each record comes after: nothing first, then what damages
    it to some drifts.

    Raises
    ------
    UsageError
        A drift is none, or that of a collapse.
    """
    drift, damages = (
        subject.model.collapse_drift,
        sorted(set(mainshock.damages if mainshock else ())),
    )
    for damage in damages:
        if not 0.0 < damage < drift:
            raise UsageError(
                f"damage {damage:g}: a drift ratio above 0 and below the collapse drift, {drift:g}"
            )
    by_key: dict[tuple[str, float], DamagedState] = {}
    states: list[list[DamagedState | None]] = [[None] * len(records)]
    for damage in damages:
        state: list[DamagedState | None] = []
        for record in records:
            assert mainshock is not None
            main = mainshock.before(record)
            # Two records of a component share their mainshock: it is scaled once.
            key = (main.name, damage)
            if key not in by_key:
                first = _elastic_scale(subject.prepared.building, main, drift)
                by_key[key] = damaged(subject, main, damage, first=first, dt=settings.dt)
            state.append(by_key[key])
        states.append(state)
    return states


def _elastic_scale(building: Building, record: Record, collapse_drift: float) -> float:
    """The factor on a record with which its first mode alone, if it stayed linear, would not yet
    yield."""
    omega, shape = building.vibration.first
    tall = np.isfinite(building.heights)  # an isolator has no drift ratio
    heights = building.heights[tall]
    ratios = float(shape @ building.mass) * np.abs(np.diff(shape, prepend=0.0))[tall] / heights
    yielding = building.yield_drift[tall] / heights
    limits = np.where(np.isfinite(yielding), yielding * _BEFORE_YIELDING, math.inf)
    limits = np.minimum(limits, _ELASTIC * collapse_drift)
    spectral = sa(2.0 * math.pi / omega).of(record) / omega**2
    return float(np.min(limits / (ratios * spectral)))


def _identity(
    subject: Subject,
    measure: IntensityMeasure,
    settings: IdaSettings,
    records: Sequence[Record],
    paired: str | None,
) -> Identity:
    """What the runs depend on."""
    # Other measures have neither periods nor a damping ratio.
    spectral = measure if isinstance(measure, SpectralIntensity) else None
    about = {name.replace("_", " "): value for name, value in asdict(settings).items()} | {
        "study": "ida",
        "measure": measure.name,
        "periods": list(spectral.periods) if spectral else [],
        "damping": spectral.damping if spectral else None,
        "thresholds": sorted(settings.thresholds or ()),
        "pairs": paired,
    }
    name, count = subject.model.name, len(records)
    motions = [SuiteMotion(record, record.source, record.component, record) for record in records]
    return Identity(
        name, "study", as_json(about), [GivenBuilding(name, subject)], motions, chunks=count
    )
