"""Incremental dynamic analysis of a building under several records, as in `tdint ida`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from tdint.analysis.arguments import AnyModel, AnyMotion, model_of, motion_of
from tdint.analysis.run.batch import Subject
from tdint.analysis.run.outcome import UNSTABLE
from tdint.analysis.run.prepared import Motions
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
    measure_of,
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
from tdint.number_parsing import pluralize
from tdint.system import on_threads
from tdint.tabular import Progress, Tabular, progress_reporter
from tdint.units import OutputUnits

THRESHOLDS = (0.01, 0.02, 0.04)
"""Drift ratios for which capacities are reported in addition to collapse, if neither the settings
nor the damage states of the model specify others."""

# Relative width of the bracket of a capacity; a tenth of the dispersion between motions, which is
# 0.3 to 0.5.
PRECISION = 0.05

_MAX_FIRST_DRIFT = 0.1
"""Upper limit of the drift in the first run, as a fraction of the collapse drift; used if no story
yields before."""

_MIN_RESIDUAL_MULTIPLE = 1.05
"""Thresholds below this multiple of the residual drift of a mainshock are not searched."""

_YIELD_FRACTION = 0.7
"""Target drift of the first run, as a fraction of the smallest yield drift."""

RecordRuns = tuple[IdaRun, ...]
"""Runs of a record in ascending order of their levels."""


@dataclass(frozen=True)
class IdaSettings:
    """Settings of an incremental dynamic analysis.

    Attributes
    ----------
    precision : float
        Relative width of the bracket of the capacity: upper level divided by lower level, less 1.
    collapse_drift : float or None
        Drift ratio above which the building has collapsed; by default the value of the model.
    thresholds : tuple of float or None
        Drift ratios for which capacities are reported in addition to collapse. The default are the
        medians of the damage states of the model if they are drift ratios, otherwise `THRESHOLDS`.
    max_im : float
        Maximum intensity, in the unit of the measure. Capacities above this value are censored.
    dt, duration : float or None
        Time step and duration of the runs, s; by default the values of the model, otherwise of the
        record.
    until_rest : bool
        Continue after the record until free vibration has decayed, which residual drifts require.
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
    """Curves of a building under several records.

    Attributes
    ----------
    model : Model
        The building, with the collapse drift of the study.
    measure : IntensityMeasure
        Intensity measure of the levels.
    method : str
        Method with all parameters.
    thresholds : tuple of float
        Drift ratios of the capacities in ascending order; the last is the collapse drift.
    curves : tuple of IdaCurve
        Curve of each record, in the order of the records.
    pair : str or None
        Combination of the components of a pair in the intensity measure: a name of `PAIRS`; None:
        the intensity of each component.
    resumed : int
        Number of records that were completed by an earlier call.
    remarks : tuple of str
        Messages about these records, one sentence each.
    checked : bool
        True if the errors of the demands were estimated.
    pair_demand : str
        Rule that combines the demands of the two components of a pair: an item of
        `tdint.campaign.pairs.PAIR_DEMANDS`.
    partners : mapping of int to int
        Index of the first component of a pair for the index of each second component in the
        records.
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
            f"of {self.model.name!r}: {pluralize(len(self.curves), 'record')}, levels of "
            f"{self.im_name}, {self.method}"
        )

    @property
    def im_name(self) -> str:
        """Name of the intensity measure, preceded by the combination of the components of a
        pair."""
        return self.measure.name if self.pair is None else f"{self.pair}-{self.measure.name}"

    @property
    def states(self) -> list[IdaStudy]:
        """Studies of the building in each state, beginning with the intact state."""
        damages = dict.fromkeys(curve.damage for curve in self.curves)
        return [
            replace(self, curves=tuple(curve for curve in self.curves if curve.damage == state))
            for state in damages
        ]

    @property
    def motion_curves(self) -> tuple[IdaCurve, ...]:
        """Curve of each motion. A pair has one curve, unless its components count separately."""
        if self.pair_demand == SEPARATE or not self.partners:
            return self.curves
        seconds = {first: second for second, first in self.partners.items()}
        curves: list[IdaCurve] = []
        for state in self.states:
            for index, curve in enumerate(state.curves):
                if index in seconds:
                    other = state.curves[seconds[index]]
                    curves.append(PairCurve.of(curve, other, self.pair_demand))
                elif index not in self.partners:
                    curves.append(curve)
        return tuple(curves)

    def in_units(self, units: OutputUnits) -> IdaStudy:
        """Return the study with intensities and all dependent values in other units.

        Parameters
        ----------
        units : OutputUnits
            Units of the result.
        """
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
    measure: IntensityMeasure | str | None = None,
    settings: IdaSettings | None = None,
    *,
    method: str | None = None,
    pair: str = GEOMETRIC_MEAN,
    jobs: int = 1,
    folder: str | Path | None = None,
    progress: bool | Progress = False,
    mainshock: Mainshock | None = None,
    pair_demand: str = LARGER,
) -> IdaStudy:
    """Run a building at increasing levels of intensity until its collapse is bracketed, separately
    for each record.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model as for `run`; all stories have heights.
    motions : sequence of Record, of Horizontals, or of paths and traces
        Ground motions without duplicates. Both components of a pair are run separately, at levels
        of the intensity of the pair.
    measure : str or IntensityMeasure, optional
        Intensity measure as for `scale`: `sa(1.0)`, `sa-avg(1.0)` with periods in s, `pga`, `pgv`,
        ...; by default Sa at the first period of the building with 5 % damping.
    settings : IdaSettings, optional
        Precision, thresholds, maximum level, time steps.
    method : str, optional
        Method; by default the method of the model.
    pair : str
        Combination of the components of a pair in the intensity measure: a name of `PAIRS`; by
        default the geometric mean.
    jobs : int
        Number of threads; results do not depend on it.
    folder : str or Path, optional
        Directory in which completed runs are stored, from which the next call with the same
        arguments continues.
    progress : bool or callable
        True for a progress bar by tqdm on a terminal or in a notebook, or a function that is called
        with the number of completed records and of all records.
    mainshock : Mainshock, optional
        Repeat the study with the building damaged by a mainshock. Drifts are then maximum values
        under the motions of the study, measured from the undeformed position.
    pair_demand : str
        Rule that combines the two components of a recording in capacities and fractiles: `larger`,
        `mean` or `separate`. Records of the same recording, by their names, are a pair unless they
        count separately.

    Returns
    -------
    IdaStudy
        Curve of each record, with its runs and capacities.

    Raises
    ------
    UsageError
        Settings are invalid; a record is given twice; the directory contains another study.
    ModelError
        A story has no height.
    RecordError
        A record is zero.
    AnalysisError
        The time step exceeds the limit of the method, or the period is too short for a record.
    OutputError
        The directory cannot be written.
    """
    settings = settings or IdaSettings()
    if isinstance(motions, Record | Horizontals | str):
        motions = [motions]
    subject, settings = _prepared(model_of(model), settings, method)
    suite = [motion_of(motion) for motion in motions]
    if check_pair_demand(pair_demand) != SEPARATE:
        suite = join_pairs(suite)
    chosen = measure_of(measure) if isinstance(measure, str) else measure or sa(subject.period)
    # A pair is a motion with two records, which have the same intensity.
    parts = [(motion, record) for motion in suite for record in components(motion)]
    records = [record for _, record in parts]
    # Records are identified by name in the tables and in the directory.
    names = [record.name for record in records]
    duplicates = [name for i, name in enumerate(names) if name in names[:i]]
    if duplicates:
        raise UsageError(f"{duplicates[0]}: the record is specified twice; remove one of them")
    if not names:
        raise UsageError("no record: an incremental dynamic analysis requires at least one record")
    # Compile before the threads start, because each thread would wait for the compilation.
    subject.prepared.compile([subject.integrator])
    states = _states(subject, records, mainshock, settings)
    # A work item is a record and a state of the building. Its levels depend only on its runs.
    ordered = [
        (*part, damaged_state)
        for state in states
        for part, damaged_state in zip(parts, state, strict=True)
    ]
    works = [
        _Work.of(number, subject, record, chosen, chosen.of(motion, pair), settings, damaged_state)
        for number, (motion, record, damaged_state) in enumerate(ordered)
    ]
    paired = pair if len(parts) > len(suite) else None
    # The input of the runs is stored with them, so that another study in the directory is refused.
    identity = _identity(subject, chosen, settings, [work.record for work in works], paired)
    with (
        _open_locked(Path(folder) if folder else None, identity) as (store, remarks),
        progress_reporter(progress, len(works), "record") as report_progress,
    ):
        runs_of_works, resumed = _run_all(works, store, jobs, report_progress)
    collapse_drift = subject.model.collapse_drift
    # Curves are in the order of the work items: all records of a state, then of the next state.
    curves = [
        IdaCurve(
            record,
            runs,
            collapse_drift,
            *((state.drift, state.residual_drift_ratio) if state else ()),
        )
        for (_, record, state), runs in zip(ordered, runs_of_works, strict=True)
    ]
    # The collapse drift is always the last threshold.
    thresholds = (*sorted(set(settings.thresholds or ()) - {collapse_drift}), collapse_drift)
    common = subject.model, chosen, subject.integrator.label, thresholds
    partners = {
        index: index - 1
        for index, (motion, record) in enumerate(parts)
        if isinstance(motion, Horizontals) and record is motion.second
    }
    return IdaStudy(
        *common,
        tuple(curves),
        paired,
        resumed,
        tuple(remarks),
        settings.check,
        pair_demand,
        partners,
    )


STORE = "ida.sqlite"
"""File name of the store in the directory of a study. Each chunk is a record."""


@contextmanager
def _open_locked(folder: Path | None, identity: Identity) -> Iterator[tuple[Store, list[str]]]:
    """Lock the directory of a study and open its store, or a store in memory without a directory.
    The context is the store and messages about it."""
    with locked(folder) if folder else nullcontext():
        store, remarks = open_or_begin(folder / STORE if folder else None, identity, log=False)
        with store:
            yield store, remarks


@dataclass(frozen=True)
class _Work:
    """Runs of a record.

    Attributes
    ----------
    number : int
        Number of the record.
    batch : Batch
        Object that integrates the runs.
    measure : IntensityMeasure
        Intensity measure of the levels.
    intensity : float
        Intensity of the unscaled record.
    levels : LevelSearch
        Search that determines the levels.
    """

    number: int
    batch: Batch
    measure: IntensityMeasure
    intensity: float
    levels: LevelSearch

    @property
    def record(self) -> Record:
        """Record that is scaled."""
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
        damaged_state: DamagedState | None = None,
    ) -> _Work:
        """Return the work item of a record.

        Parameters
        ----------
        number : int
            Number of the record.
        subject : Subject
            The building and its method.
        record : Record
            The record.
        measure : IntensityMeasure
            Intensity measure of the levels.
        intensity : float
            Intensity of the unscaled record.
        settings : IdaSettings
            Settings of the study.
        damaged_state : DamagedState, optional
            State of the building before the record; by default undamaged.
        """
        # A drift threshold must exceed the residual drift of the mainshock. Otherwise it is
        # exceeded before the record starts.
        residual_drift = damaged_state.residual_drift_ratio if damaged_state else 0.0
        elastic = _elastic_scale(subject.prepared.building, record, subject.model.collapse_drift)
        # The first level is below yield in the first mode, so that the curve starts elastic.
        levels = LevelSearch(
            start=intensity * elastic**measure.growth,
            precision=settings.precision,
            lowest_drift=min(
                (
                    drift
                    for drift in settings.thresholds or ()
                    if drift > _MIN_RESIDUAL_MULTIPLE * residual_drift
                ),
                default=math.inf,
            ),
            most=settings.max_im,
        )
        run_settings = RunSettings(
            settings.dt, settings.duration, settings.until_rest, check=settings.check
        )
        # The scale factor of the mainshock is constant; the factor of the record increases.
        if damaged_state:
            mainshock = damaged_state.record
            record = JoinedRecord.of([mainshock, record], damaged_state.rest, fixed=1)
        batch = Batch(0, subject, Motions({number: record}), {number: None}, run_settings)
        return cls(number, batch, measure, intensity, levels)

    def done(self) -> tuple[Done, RecordRuns]:
        """Integrate all runs of the record. A run without a result is repeated with half the time
        step.

        Raises
        ------
        FailedRun
            The time step exceeds the limit of the method.
        """
        began, rows = time.thread_time(), Rows()

        def run(scale: float) -> RunRow:
            """Integrate the run of a scale factor."""
            (row,) = self.batch.results([Run(self.number, scale)]).runs
            # The time step is unstable at every level. Integrate the record again to raise the
            # error, which states the stability limit.
            if row.status == UNSTABLE:
                case, settings = self.batch.subject.case(self.record), self.batch.settings
                case.integrate(case.steps(settings.dt, settings.duration))
            rows.runs.append(row)
            return row

        runs = self._runs_at_levels(run)
        return Done(self.number, rows, time.thread_time() - began), runs

    def kept(self, rows: Sequence[RunRow]) -> RecordRuns | None:
        """Return the stored runs, or None if they differ from the runs that `done` would
        execute."""
        by_scale = {row.scale: row for row in rows}
        try:
            runs = self._runs_at_levels(by_scale.__getitem__)
        except KeyError:
            return None
        return runs if len(runs) == len(rows) else None

    def _runs_at_levels(self, run: Callable[[float], RunRow]) -> RecordRuns:
        """Return the runs at all levels in ascending order of the levels.

        `run` returns the run of a scale factor. Each level depends on the preceding runs.
        """
        runs: list[IdaRun] = []
        while (level := self.levels.next(runs)) is not None:
            runs.append(IdaRun.of(level, run(factor_to(level, self.measure, self.intensity))))
        return tuple(sorted(runs, key=lambda run: run.im))


def _run_all(
    works: Sequence[_Work], store: Store, jobs: int, progress: Progress
) -> tuple[list[RecordRuns], int]:
    """Return the runs of all records. Records that are not stored are distributed over threads.

    Parameters
    ----------
    works : sequence of _Work
        Work items.
    store : Store
        Store of the study.
    jobs : int
        Number of threads.
    progress : callable
        Function that reports progress.

    Returns
    -------
    list of RecordRuns, int
        Runs of each work item, and number of work items that were stored before.
    """
    results: dict[int, RecordRuns] = {}
    for number in sorted(store.done()):
        if runs := works[number].kept(store.runs_of(number)):
            results[number] = runs
        else:  # the runs were stored by a version of tdint that selected other levels
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
    """Return the assembled building and validated settings."""
    collapse_drift = settings.collapse_drift or model.collapse_drift
    if not 0.0 < settings.precision <= 0.5:
        raise UsageError(
            "the precision of a capacity must be above 0 and at most 50 %, got "
            f"{settings.precision:g}"
        )
    # Default thresholds are the damage states of the model, if these are drift ratios.
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
                f"threshold {threshold:g}: must be a drift ratio above 0 and at most the collapse "
                f"drift, {collapse_drift:g}"
            )
    if not settings.max_im > 0.0:
        raise UsageError(f"the maximum intensity must be positive, got {settings.max_im:g}")
    # An isolator has no drift ratio and needs no height, but at least one story must have a drift
    # ratio.
    without_height = [
        i
        for i, story in enumerate(model.stories, start=1)
        if story.height is None and not story.isolator
    ]
    if all(story.isolator for story in model.stories):
        without_height = [1]
    if without_height:
        raise ModelError(
            f"{model.source}: an incremental dynamic analysis requires drift ratios; add the "
            f"height of story {without_height[0]}"
        )
    subject = Subject(
        replace(model, collapse_drift=collapse_drift),
        method or model.analysis.method or DEFAULT_METHOD,
    )
    return subject, replace(settings, collapse_drift=collapse_drift, thresholds=thresholds)


def _states(
    subject: Subject, records: Sequence[Record], mainshock: Mainshock | None, settings: IdaSettings
) -> list[list[DamagedState | None]]:
    """Return the state of the building before each record, for each state of the study.

    The first state is undamaged (None). In the other states a mainshock has caused a specified
    drift.

    Parameters
    ----------
    subject : Subject
        The building and its method.
    records : sequence of Record
        Records of the study.
    mainshock : Mainshock or None
        Mainshocks and the drifts that they cause.
    settings : IdaSettings
        Settings of the study.

    Raises
    ------
    UsageError
        A drift is not positive, or not below the collapse drift.
    """
    drift = subject.model.collapse_drift
    damages = sorted(set(mainshock.damages if mainshock else ()))
    for damage in damages:
        if not 0.0 < damage < drift:
            raise UsageError(
                f"damage {damage:g}: must be a drift ratio above 0 and below the collapse drift, "
                f"{drift:g}"
            )
    by_key: dict[tuple[str, float], DamagedState] = {}
    states: list[list[DamagedState | None]] = [[None] * len(records)]
    for damage in damages:
        state: list[DamagedState | None] = []
        for record in records:
            assert mainshock is not None
            main = mainshock.before(record)
            # Records of the same component have the same mainshock, which is scaled once.
            key = (main.name, damage)
            if key not in by_key:
                first = _elastic_scale(subject.prepared.building, main, drift)
                by_key[key] = damaged(subject, main, damage, first=first, dt=settings.dt)
            state.append(by_key[key])
        states.append(state)
    return states


def _elastic_scale(building: Building, record: Record, collapse_drift: float) -> float:
    """Return the scale factor of a record at which no story yields in the first mode of the elastic
    building."""
    omega, shape = building.vibration.first
    has_height = np.isfinite(building.heights)  # an isolator has no drift ratio
    heights = building.heights[has_height]
    # Drift ratios of the first mode for a unit spectral displacement, in which `shape @ mass` is
    # the participation factor
    ratios = (
        float(shape @ building.mass) * np.abs(np.diff(shape, prepend=0.0))[has_height] / heights
    )
    yield_ratios = building.yield_drift[has_height] / heights
    limits = np.where(np.isfinite(yield_ratios), yield_ratios * _YIELD_FRACTION, math.inf)
    limits = np.minimum(limits, _MAX_FIRST_DRIFT * collapse_drift)
    spectral_displacement = sa(2.0 * math.pi / omega).of(record) / omega**2
    return float(np.min(limits / (ratios * spectral_displacement)))


def _identity(
    subject: Subject,
    measure: IntensityMeasure,
    settings: IdaSettings,
    records: Sequence[Record],
    paired: str | None,
) -> Identity:
    """Return the input that the runs depend on.

    Parameters
    ----------
    subject : Subject
        The building and its method.
    measure : IntensityMeasure
        Intensity measure of the levels.
    settings : IdaSettings
        Settings of the study.
    records : sequence of Record
        Record of each work item.
    paired : str or None
        Combination of the components of pairs.
    """
    # Only spectral measures have periods and a damping ratio.
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
