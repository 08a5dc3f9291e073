"""Incremental dynamic analysis: runs of a building under several records, each scaled to increasing
levels of intensity until the building collapses."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from tdint.errors import ModelError, UsageError
from tdint.ground_motion.axes import PairRecord
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.joined import JoinedRecord
from tdint.ground_motion.measures import integrate
from tdint.ground_motion.reading.suites import GroundMotion, SuiteMotion, components, suite_motions
from tdint.ground_motion.record import Record, named_components
from tdint.methods.catalogue import method_of
from tdint.model.building import Building
from tdint.model.definition import Model
from tdint.model.limits import QUANTITIES, Limit
from tdint.number_parsing import pluralize
from tdint.response import pairs
from tdint.response.arguments import AnyModel, AnyMotion, model_of, motion_of
from tdint.response.pairs import Run
from tdint.response.runs.batch import Subject
from tdint.response.runs.outcome import UNSTABLE
from tdint.response.runs.settings import RunSettings, settings_from
from tdint.studies.campaign.buildings import ModelBuilding
from tdint.studies.campaign.chunks import Batch, CampaignSettings, ChunkResult, Rows, RunRow
from tdint.studies.campaign.story_profiles import device_values
from tdint.studies.ida.ida_curve import (
    DamagedState,
    IdaCurve,
    IdaRun,
    LevelSearch,
    Mainshock,
    PairCurve,
    damaged,
)
from tdint.studies.motions.intensity import (
    GEOMETRIC_MEAN,
    IntensityMeasure,
    SpectralIntensity,
    factor_to,
    measure_of,
    sa,
)
from tdint.studies.store.opening import open_or_create, open_replacement
from tdint.studies.store.result_store import Identity, Store, as_json
from tdint.studies.store.schema import locked
from tdint.system import on_threads, processors
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
class IdaSettings(RunSettings):
    """Settings of an incremental dynamic analysis.

    Attributes
    ----------
    precision : float, default 0.05
        Relative width of the bracket of the capacity: upper level divided by lower level, less 1.
    collapse_drift : float | None
        Drift ratio above which the building has collapsed; by default the value of the model.
    thresholds : tuple of float | None
        Drift ratios for which capacities are reported in addition to collapse. The default are the
        medians of the damage states of the model if they are drift ratios, otherwise 1, 2 and 4 %.
    max_im : float, default inf
        Maximum intensity, in the unit of the measure. Capacities above this value are censored.
    dt, duration, until_rest, check : optional
        Settings of each run, as for `run`; `check` is False by default.
    """

    precision: float = PRECISION
    collapse_drift: float | None = None
    thresholds: tuple[float, ...] | None = None
    max_im: float = math.inf


@dataclass(frozen=True, repr=False)
class IdaStudy(Tabular):
    """Result of an incremental dynamic analysis: curves of a building under several records.

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
    pair : str | None
        Combination of the components of a pair in the intensity measure: a name of `PAIRS`; None:
        the intensity of each component.
    resumed : int
        Number of records that were completed by an earlier call.
    remarks : tuple of str
        Messages about these records.
    checked : bool
        True if the errors of the demands were estimated.
    pair_demand : str
        Rule that combines the demands of the two components of a pair: an item of
        `tdint.response.pairs.PAIR_DEMANDS`.
    partners : mapping of int to int
        Pairs of components. The key is the index of the second component in the records; the value
        is the index of the first component.
    limits : tuple of Limit
        Limits of attachments and links in the model, for which capacities of the undamaged building
        are reported, in the order of `IdaRun.limit_ratios`.
    mainshocks : tuple of (str, float, float)
        Name of each mainshock, drift ratio that it causes, and its scale factor.
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
    pair_demand: str = pairs.LARGER
    partners: Mapping[int, int] = field(default_factory=dict)
    limits: tuple[Limit, ...] = ()
    mainshocks: tuple[tuple[str, float, float], ...] = ()

    def _headline(self) -> str:
        """Return the building, number of records, intensity measure and method."""
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
    def motions_text(self) -> str:
        """Numbers of components, recordings and pairs (`suite_text`)."""
        curves = self.states[0].curves
        numbers = [self.partners.get(record, record) for record in range(len(curves))]
        # The records of a building in two directions have two components.
        counts = [1 + isinstance(curve.record, PairRecord) for curve in curves]
        return pairs.suite_text(np.repeat(numbers, counts).tolist())

    @property
    def states(self) -> list[IdaStudy]:
        """One study for each state of damage before the records. Each study contains the curves of
        its state. The order is the order of the first curves of the states; `ida` computes the
        curves of the undamaged state first."""
        damages = dict.fromkeys(curve.damage for curve in self.curves)
        return [
            replace(self, curves=tuple(curve for curve in self.curves if curve.damage == damage))
            for damage in damages
        ]

    @property
    def motion_curves(self) -> tuple[IdaCurve, ...]:
        """Curve of each ground motion, for all states of damage. The two components of a pair have
        a common curve, unless they count separately."""
        if self.pair_demand == pairs.SEPARATE or not self.partners:
            return self.curves
        # Index of the second component by the index of the first component
        second_of_first = {first: second for second, first in self.partners.items()}
        curves: list[IdaCurve] = []
        for state in self.states:
            for index, curve in enumerate(state.curves):
                if index in self.partners:
                    continue  # the curve of a second component was combined with the first curve
                if index in second_of_first:
                    second_curve = state.curves[second_of_first[index]]
                    curve = PairCurve.combine_components(curve, second_curve, self.pair_demand)
                curves.append(curve)
        return tuple(curves)

    def in_units(self, units: OutputUnits) -> IdaStudy:
        """Return the study with the intensities in another unit.

        The intensities of the runs and the unit of the measure are changed. Capacities and
        fractiles are computed from the runs, so that they have the new unit also.

        Parameters
        ----------
        units : OutputUnits
            Units of the result.
        """
        # `factor` is the size of the new unit in SI. It is 1 only for an SI unit; in this case, the
        # name of the unit does not change.
        unit, factor = units.unit(self.measure.unit)
        if factor == 1.0:
            return self

        def convert(curve: IdaCurve) -> IdaCurve:
            """Return a curve with intensities in the new unit."""
            runs = tuple(replace(run, im=run.im / factor) for run in curve.runs)
            return replace(curve, runs=runs)

        curves = tuple(convert(curve) for curve in self.curves)
        return replace(self, measure=replace(self.measure, unit=unit), curves=curves)


def ida(
    model: AnyModel,
    motions: Sequence[AnyMotion],
    measure: IntensityMeasure | str | None = None,
    settings: IdaSettings | None = None,
    *,
    method: str | None = None,
    pair: str = GEOMETRIC_MEAN,
    jobs: int | None = None,
    folder: str | Path | None = None,
    overwrite: bool = False,
    progress: bool | Progress = False,
    mainshock: Mainshock | None = None,
    pair_demand: str | None = None,
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
    pair : str, default "geometric-mean"
        Combination of the components of a pair in the intensity measure: `geometric-mean`,
        `rotd50`, `rotd100`, `larger` or `srss`.
    jobs : int, optional
        Number of threads, by default one per processor; it does not affect the results.
    folder : str or Path, optional
        Directory for the results of completed runs. The next call with the same arguments continues
        from these results.
    overwrite : bool, default False
        True to replace another study in the directory. Its store remains until the results of the
        new study are written (`tdint.studies.store.opening.write_from_store`).
    progress : bool or callable, default False
        True for a progress bar by tqdm on a terminal or in a notebook, or a function that is called
        with the number of completed records and of all records.
    mainshock : Mainshock, optional
        Repeat the study with the building damaged by a mainshock. Drifts are then maximum values
        under the motions of the study, measured from the undeformed position.
    pair_demand : str, optional
        Rule that combines the two components of a recording in capacities and fractiles: `larger`
        (default), `mean` or `separate`. Records of the same recording, by their names, are a pair
        unless they count separately. For a building in two directions, resultants by default, or
        `larger`.

    Returns
    -------
    IdaStudy
        Curve of each record, with its runs and capacities.

    Raises
    ------
    UsageError
        Settings are invalid; a record is given twice.
    ModelError
        A story has no height.
    RecordError
        A record is zero.
    AnalysisError
        The time step exceeds the limit of the method, or the period is too short for a record.
    OutputError
        The directory contains another study, or cannot be written.
    """
    settings = settings or IdaSettings()
    if isinstance(motions, Record | Horizontals | str):
        motions = [motions]
    subject, settings = _prepare(model_of(model), settings, method)
    # The rule for the demand of a pair does not change its intensity.
    given_demand, pair_demand = pair_demand, pair_demand or pairs.LARGER
    pairs.check_pair_demand(pair_demand)
    suite = pairs.join_pairs([motion_of(motion) for motion in motions])
    measure = measure_of(measure) if isinstance(measure, str) else measure or sa(subject.period)
    # A pair is a motion with two records, which have the same intensity; of a building in two
    # directions, it is one record with two components.
    if subject.across is None:
        motions_and_records = [(motion, part) for motion in suite for part in components(motion)]
    else:
        if mainshock is not None:
            raise UsageError("a study after a main shock requires a building with one direction")
        along = pairs.motions_along_axes(suite_motions(suite), [subject.model], "ida", given_demand)
        motions_and_records = [(motion.ground_motion, motion.record) for motion in along]
    records = [record for _, record in motions_and_records]
    _check_record_names([" ".join(filter(None, names)) for names in named_components(records)])
    # Compile before the threads start, because each thread would wait for the compilation.
    subject.prepared.compile([subject.integrator])
    states = _damaged_states(subject, records, mainshock, settings)
    intensities = [measure.of(motion, pair) for motion, _ in motions_and_records]
    # For each state of the building, there is one work item per record.
    cases = [
        case
        for damage_before_records in states
        for case in zip(records, intensities, damage_before_records, strict=True)
    ]
    work_items = [
        _WorkItem(number, subject, measure, settings, *case) for number, case in enumerate(cases)
    ]
    has_pairs = any(isinstance(motion, Horizontals) for motion, _ in motions_and_records)
    pair_intensity = pair if has_pairs else None
    # The input of the runs is stored with the runs, so that another study in the directory is
    # refused.
    run_records = [item.record for item in work_items]
    identity = _identity(subject, measure, settings, run_records, pair_intensity)
    with (
        _open_locked(Path(folder) if folder else None, identity, overwrite=overwrite) as (
            store,
            remarks,
        ),
        progress_reporter(progress, len(work_items), "record") as report_progress,
    ):
        runs_by_item, resumed = _run_work_items(
            work_items, store, jobs or processors(), report_progress
        )
        limits = device_limits(subject.model)
        if limits:
            runs_by_item = _with_limit_ratios(runs_by_item, store, limits)
    collapse_drift = subject.model.collapse_drift
    # Curves are in the order of the work items: all records of a state, then of the next state.
    curves = tuple(
        item.curve(runs, collapse_drift)
        for item, runs in zip(work_items, runs_by_item, strict=True)
    )
    # The collapse drift is always the last threshold.
    thresholds = (*sorted(set(settings.thresholds or ()) - {collapse_drift}), collapse_drift)
    return IdaStudy(
        subject.model,
        measure,
        subject.integrator.label,
        thresholds,
        curves,
        pair=pair_intensity,
        resumed=resumed,
        remarks=tuple(remarks),
        checked=settings.check,
        pair_demand=pair_demand,
        partners=_partners(motions_and_records),
        limits=limits,
        mainshocks=tuple(
            dict.fromkeys(
                (state.record.name, state.drift, state.factor)
                for before_records in states
                for state in before_records
                if state is not None
            )
        ),
    )


def device_limits(model: Model) -> tuple[Limit, ...]:
    """Return the limits of attachments and links of a model."""
    return tuple(limit for limit in model.limits if QUANTITIES[limit.quantity].of_device)


def _with_limit_ratios(
    runs_by_item: Sequence[RecordRuns], store: Store, limits: Sequence[Limit]
) -> list[RecordRuns]:
    """Return the runs of all work items with the ratios of their demands to limits, from the
    attachments and links in the store; NaN for runs without a result and of damaged buildings."""
    demands = device_values(store, 0, limits)

    def limit_ratios(record: int, scale: float) -> Iterator[float]:
        """Yield the maximum ratio of demand to limit for each limit."""
        for limit in limits:
            values = demands[limit.quantity].get(Run(record, scale))
            if values is None:
                yield math.nan
            else:
                limited, _, limit_values = limit.applies_to(np.array(values))
                yield float(np.max(limited / limit_values))

    return [
        tuple(replace(run, limit_ratios=tuple(limit_ratios(item, run.scale))) for run in runs)
        for item, runs in enumerate(runs_by_item)
    ]


def _partners(motions_and_records: Sequence[tuple[GroundMotion, Record]]) -> dict[int, int]:
    """Return the pairs of components: the key is the index of the second component in the list of
    records, and the value is the index of the first component, which precedes it.
    """
    return {
        index: index - 1
        for index, (motion, record) in enumerate(motions_and_records)
        if isinstance(motion, Horizontals) and record is motion.second
    }


def _check_record_names(names: Sequence[str]) -> None:
    """Raise UsageError if the list of names of records is empty or contains a name twice. Records
    are identified by their names in the tables and in the directory of the study."""
    duplicates = [name for i, name in enumerate(names) if name in names[:i]]
    if duplicates:
        raise UsageError(f"{duplicates[0]}: the record is specified twice; remove one of them")
    if not names:
        raise UsageError("an incremental dynamic analysis requires at least one record, got none")


STORE = "ida.sqlite"
"""File name of the store in the directory of a study. Each chunk is a record."""


@contextmanager
def _open_locked(
    folder: Path | None, identity: Identity, *, overwrite: bool
) -> Iterator[tuple[Store, list[str]]]:
    """Lock the directory of a study and open its store, in memory without a directory. An existing
    store must match the complete input of the study (`identity`), unless another store will replace
    it (`overwrite`). The texts are messages for the user about the store.
    """
    with locked(folder) if folder else nullcontext():
        if folder and overwrite:
            store, remarks = open_replacement(folder / STORE, identity)
        else:
            store, remarks = open_or_create(folder / STORE if folder else None, identity)
        with store:
            yield store, remarks


class _WorkItem:
    """All runs of a building, in a state of damage, under a record.

    Work items can be run in parallel, because the levels of an item depend only on the runs of the
    same item.

    Attributes
    ----------
    number : int
        Number of the work item in the study, which is also the number of its record in `batch`.
    intensity : float
        Intensity of the unscaled record.
    unscaled : Record
        Record of the study, without the mainshock.
    damaged_state : DamagedState | None
        State of the building before the record; None: undamaged.
    """

    def __init__(
        self,
        number: int,
        subject: Subject,
        measure: IntensityMeasure,
        settings: IdaSettings,
        record: Record,
        intensity: float,
        damaged_state: DamagedState | None,
    ) -> None:
        self.number = number
        self.measure = measure
        self.intensity = intensity
        self.unscaled = record
        self.damaged_state = damaged_state
        # Thresholds below the residual drift of the mainshock are exceeded before the record
        # starts, so they are not searched.
        residual_drift = damaged_state.residual_drift_ratio if damaged_state else 0.0
        searched_thresholds = [
            drift
            for drift in settings.thresholds or ()
            if drift > _MIN_RESIDUAL_MULTIPLE * residual_drift
        ]
        # The first level is below yield in the first mode, so that the curve starts elastic.
        parts, motions = (subject, subject.across), getattr(record, "components", (record,))
        elastic_scale = min(
            _elastic_scale(part.prepared.building, component, subject.model.collapse_drift)
            for part, component in zip(parts, motions, strict=False)
            if part is not None
        )
        self.levels = LevelSearch(
            start=intensity * elastic_scale**measure.scale_exponent,
            precision=settings.precision,
            lowest_drift=min(searched_thresholds, default=math.inf),
            max_level=settings.max_im,
        )
        # The scale factor of the mainshock is constant (`fixed`: one event that is not scaled); the
        # factor of the record increases.
        run_record = record
        if damaged_state:
            mainshock = damaged_state.record
            run_record = JoinedRecord.of([mainshock, record], damaged_state.rest, fixed=1)
        # The levels are values of `measure`, so that Sa(T1) of the record is not needed (None).
        self.batch = Batch(
            0,
            subject,
            {number: run_record},
            {number: None},
            # The peaks of attachments and links are stored with those of stories. After a mainshock
            # they would include it.
            settings_from(
                settings,
                CampaignSettings,
                profiles=damaged_state is None and bool(device_limits(subject.model)),
            ),
        )

    @property
    def record(self) -> Record:
        """Record of the runs. It includes the mainshock if a mainshock has damaged the building."""
        return self.batch.motions[self.number]

    def curve(self, runs: RecordRuns, collapse_drift: float) -> IdaCurve:
        """Return the IDA curve of the record.

        `runs` contains the runs of the record, in ascending order of their levels.
        """
        state = self.damaged_state
        damage, residual = (state.drift, state.residual_drift_ratio) if state else (0.0, 0.0)
        return IdaCurve(self.unscaled, runs, collapse_drift, damage, residual)

    def integrate(self) -> tuple[ChunkResult, RecordRuns]:
        """Integrate the building under the record at increasing levels until the search for its
        capacities is complete. Return the rows for the store, and the runs in ascending order of
        their levels.

        Raises
        ------
        FailedRun
            The time step exceeds the limit of the method.
        """
        start_time, rows = time.thread_time(), Rows()

        def run(scale: float) -> RunRow:
            """Integrate the building under the record multiplied by `scale`, and return the
            results."""
            results = self.batch.results([Run(self.number, scale)])
            (row,) = results.runs
            # The time step is unstable at every level. Integrate the record again to raise the
            # error, which states the stability limit.
            if row.status == UNSTABLE:
                case, settings = self.batch.subject.case(self.record), self.batch.settings
                case.integrate(case.steps(settings.dt, settings.duration))
            rows.extend(replace(results, stories=[], elements=[], shocks=[]))
            return row

        runs = self._search_levels(run)
        return ChunkResult(self.number, rows, time.thread_time() - start_time), runs

    def stored_runs(self, rows: Sequence[RunRow]) -> RecordRuns | None:
        """Return the runs of the record from rows of the store.

        None is the result if the search for capacities would select other levels than the levels of
        the rows. In this case the record must be run again.
        """
        row_by_scale = {row.scale: row for row in rows}
        # Repeat the search with the stored rows instead of new runs. If the search selects a level
        # that is not stored, the lookup raises a KeyError.
        try:
            runs = self._search_levels(row_by_scale.__getitem__)
        except KeyError:
            return None
        return runs if len(runs) == len(rows) else None

    def _search_levels(self, run: Callable[[float], RunRow]) -> RecordRuns:
        """Search the capacities of the building under the record, and return the runs of this
        search in ascending order of their levels.

        `run` is the function that returns the results of the run at a scale factor.
        """
        runs: list[IdaRun] = []
        while (level := self.levels.next(runs)) is not None:
            runs.append(IdaRun.from_row(level, run(factor_to(level, self.measure, self.intensity))))
        return tuple(sorted(runs, key=lambda run: run.im))


def _run_work_items(
    items: Sequence[_WorkItem], store: Store, jobs: int, progress: Progress
) -> tuple[list[RecordRuns], int]:
    """Return the runs of all work items and the number of items that were stored before; store the
    results of new runs.

    Items with complete results in the store are not run again. All other items are distributed over
    threads.
    """
    runs_by_number: dict[int, RecordRuns] = {}
    for number in sorted(store.completed_chunks()):
        if stored_runs := items[number].stored_runs(store.runs_of(number)):
            runs_by_number[number] = stored_runs
        else:  # the runs were stored by a version of tdint that selected other levels
            store.remove({number})
    resumed = len(runs_by_number)
    progress(resumed, len(items))
    remaining = [item for item in items if item.number not in runs_by_number]
    for result, runs in on_threads(_WorkItem.integrate, remaining, max(1, jobs)):
        runs_by_number[result.number] = runs
        store.add(result)
        progress(len(runs_by_number), len(items))
    return [runs_by_number[item.number] for item in items], resumed


def _prepare(
    model: Model, settings: IdaSettings, method: str | None
) -> tuple[Subject, IdaSettings]:
    """Check the model and the settings of a study, and replace all defaults by values. UsageError
    is raised if a setting is out of range; ModelError, if a story that is not an isolator has no
    height.
    """
    collapse_drift = (
        model.collapse_drift if settings.collapse_drift is None else settings.collapse_drift
    )
    if not collapse_drift > 0.0:
        raise UsageError(f"the collapse drift must be positive, got {collapse_drift:g}")
    if not 0.0 < settings.precision <= 0.5:
        raise UsageError(
            "the precision of a capacity must be above 0 and at most 50 %, got "
            f"{100.0 * settings.precision:g} %"
        )
    thresholds = settings.thresholds
    if thresholds is None:
        # The medians of the damage states of the model, if these are drift ratios
        is_by_drift = model.damage is not None and model.damage.demand == "drift_ratio"
        drifts = model.damage.medians if is_by_drift and model.damage else THRESHOLDS
        thresholds = tuple(drift for drift in drifts if drift <= collapse_drift)
    for threshold in thresholds:
        if not 0.0 < threshold <= collapse_drift:
            raise UsageError(
                f"threshold {threshold:g}: must be a drift ratio above 0 and at most the collapse "
                f"drift, {collapse_drift:g}"
            )
    if not settings.max_im > 0.0:
        raise UsageError(f"the maximum intensity must be positive, got {settings.max_im:g}")
    _check_heights(model)
    subject = Subject(model.in_directions(collapse_drift=collapse_drift), method_of(model, method))
    return subject, replace(settings, collapse_drift=collapse_drift, thresholds=thresholds)


def _check_heights(model: Model) -> None:
    """Raise ModelError if a story that is not an isolator has no height, or if all stories are
    isolators.

    The study requires the drift ratio of at least one story. An isolator has no drift ratio, so its
    height is not needed.
    """
    if all(story.isolator for story in model.stories):
        raise ModelError(
            f"{model.source}: an incremental dynamic analysis requires drift ratios, but all "
            "stories are isolators, which have no drift ratio; add a story with a height that is "
            "not an isolator"
        )
    stories_without_height = [
        number
        for number, story in enumerate(model.stories, start=1)
        if story.height is None and not story.isolator
    ]
    if stories_without_height:
        raise ModelError(
            f"{model.source}: an incremental dynamic analysis requires drift ratios; add the "
            f"height of story {stories_without_height[0]}"
        )


def _damaged_states(
    subject: Subject, records: Sequence[Record], mainshock: Mainshock | None, settings: IdaSettings
) -> list[list[DamagedState | None]]:
    """Return the states of the building before the records.

    Each item of the result is a list with the state before each record. In the first item, the
    building is undamaged (None). In each other item, a mainshock has caused one of the specified
    drift ratios.

    Raises
    ------
    UsageError
        A drift is not positive, or not below the collapse drift.
    AnalysisError
        The building collapses before it reaches one of the drifts.
    """
    states: list[list[DamagedState | None]] = [[None] * len(records)]
    if mainshock is None:
        return states
    collapse_drift = subject.model.collapse_drift
    damages = sorted(set(mainshock.damages))
    for damage in damages:
        if not 0.0 < damage < collapse_drift:
            raise UsageError(
                f"damage {damage:g}: must be a drift ratio above 0 and below the collapse drift, "
                f"{collapse_drift:g}"
            )
    for damage in damages:
        # Records of the same component have the same mainshock. The search for its scale factor
        # requires many runs, so it is performed a single time.
        main_records = [mainshock.before(record) for record in records]
        state_of_mainshock: dict[str, DamagedState] = {}
        for main in {main.name: main for main in main_records}.values():
            first_factor = _elastic_scale(subject.prepared.building, main, collapse_drift)
            state_of_mainshock[main.name] = damaged(
                subject, main, damage, first_factor=first_factor, dt=settings.dt
            )
        states.append([state_of_mainshock[main.name] for main in main_records])
    return states


def _elastic_scale(building: Building, record: Record, collapse_drift: float) -> float:
    """Return the maximum scale factor of a record for which the drift of each story in the first
    elastic mode is at most 0.7 times its yield drift and at most a tenth of the collapse drift.
    """
    # Circular frequency (rad/s) and mode shape at the floors
    omega, shape = building.vibration.first
    has_height = np.isfinite(building.heights)  # an isolator has no drift ratio
    heights = building.heights[has_height]
    # Drift ratios of the first mode for a spectral displacement of 1 m. The mode shape is
    # normalized (shape^2 @ mass = 1), so that `shape @ mass` is the participation factor.
    participation = float(shape @ building.mass)
    story_shape = np.abs(building.deformations @ shape)[has_height]
    unit_drift_ratios = participation * story_shape / heights
    # The yield drift is infinite if a story does not yield.
    yield_ratios = building.yield_drift[has_height] / heights
    limits = np.where(np.isfinite(yield_ratios), yield_ratios * _YIELD_FRACTION, math.inf)
    limits = np.minimum(limits, _MAX_FIRST_DRIFT * collapse_drift)
    # Without initial stiffness the floors do not move with the ground.
    spectral_displacement = (
        sa(2.0 * math.pi / omega).of(record) / omega**2 if omega else integrate(record).pgd
    )
    return float(np.min(limits / (unit_drift_ratios * spectral_displacement)))


def _identity(
    subject: Subject,
    measure: IntensityMeasure,
    settings: IdaSettings,
    records: Sequence[Record],
    pair_intensity: str | None,
) -> Identity:
    """Return the complete input of the runs. It is stored with the runs, so that runs of another
    study in the directory are recognized.

    `pair_intensity` is the combination of the components of pairs in the intensity measure; None
    without pairs.
    """
    # Only spectral measures have periods and a damping ratio.
    spectral = measure if isinstance(measure, SpectralIntensity) else None
    description = {name.replace("_", " "): value for name, value in asdict(settings).items()} | {
        "study": "ida",
        "measure": measure.name,
        "periods": list(spectral.periods) if spectral else [],
        "damping": spectral.damping if spectral else None,
        "thresholds": sorted(settings.thresholds or ()),
        "pairs": pair_intensity,
        # The store contains attachments and links only if the model limits them.
        **({"attachments and links": True} if device_limits(subject.model) else {}),
    }
    name, count = subject.model.name, len(records)
    motions = [SuiteMotion(record, record.source, record.component, record) for record in records]
    return Identity(
        name, "study", as_json(description), [ModelBuilding(name, subject)], motions, chunks=count
    )
