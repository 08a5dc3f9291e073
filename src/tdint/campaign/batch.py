"""Chunks of runs. A chunk contains all input of its runs, so that a thread or a remote worker can
process it without reading files.

All runs of a building with the same time step are integrated by one compiled call. Failed runs are
repeated with half the time step.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice, repeat, zip_longest
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from tdint.analysis.run.batch import Subject, run_batch
from tdint.analysis.run.case import Case
from tdint.analysis.run.demands import RUN, demand_columns, demand_errors
from tdint.analysis.run.error_estimate import attempt
from tdint.analysis.run.outcome import (
    NO_STEP,
    STORY,
    Collapse,
    ErrorEstimate,
    FailedRun,
    Response,
    Shock,
    StoryPeaks,
)
from tdint.analysis.run.prepared import Motions
from tdint.analysis.run.sequence import event_responses, sequence_of
from tdint.analysis.run.step_choice import step_within
from tdint.analysis.spectra.elastic import SA_DAMPING, spectrum
from tdint.analysis.time_steps import Steps, finer
from tdint.errors import AnalysisError
from tdint.ground_motion.record import JoinedRecord, Record

# ---- Runs of a building with its method under ground motions, and rows of results: one for each
# run and, if requested, one for each story

REPEATS = 3
"""Maximum number of repetitions of a run that diverged or did not converge, each with half the time
step of the preceding run. Single steps of each run are also halved
(`tdint.methods.workspace.HALVINGS`)."""


@dataclass(frozen=True)
class RunSettings:
    """Settings of all runs of a campaign.

    Attributes
    ----------
    dt, duration : float or None
        Time step and duration, s; None: values of the model, otherwise of the record.
    until_rest : bool
        Continue after the record until free vibration has decayed (`tdint.analysis.run.case`).
    stories : bool
        Store the peaks of every story, because the table of stories is written.
    profiles : bool
        Store the peaks of every story, because the table with their statistics over the motions is
        written.
    check : bool
        Estimate the errors of the demands of each run, as `tdint.run` does.
    tolerance : float or None
        Relative tolerance of the estimated errors of peak drifts, by which the time step of a
        building is chosen.
    """

    dt: float | None = None
    duration: float | None = None
    until_rest: bool = False
    stories: bool = False
    tolerance: float | None = None
    profiles: bool = False
    check: bool = False

    @property
    def keeps_stories(self) -> bool:
        """True if the peaks of stories are stored."""
        return self.stories or self.profiles


class Source(Protocol):
    """Object that provides a building: a building that exists already, or a row of an inventory,
    from which rules derive the building when `subject` is called."""

    def subject(self) -> Subject:
        """Return the building with its method."""


class Run(NamedTuple):
    """Run of a building: number of the ground motion, scale factor, and number of the sample of the
    building (0: not sampled)."""

    motion: int
    scale: float
    sample: int = 0


class BuildingRuns(NamedTuple):
    """Runs of one building.

    Attributes
    ----------
    number : int
        Number of the building in its campaign.
    source : Source
        Object that creates the building.
    runs : tuple of Run
        The runs.
    max_step : float or None
        Maximum time step that meets the tolerance of the campaign, s; None if no time step meets
        the tolerance; infinity if the campaign has no tolerance.
    """

    number: int
    source: Source
    runs: tuple[Run, ...]
    max_step: float | None = math.inf


class RunRow(NamedTuple):
    """Values of a run in the order of `RUN`; missing values are None or NaN.

    If errors were estimated, `errors` contains the errors of the demands in the order of
    `RUN_WITH_ERROR`; otherwise it is empty. Values are also available by name: `row.status`.
    """

    building: int
    motion: int
    scale: float
    sample: int
    values: tuple[Any, ...]
    errors: tuple[float | None, ...] = ()

    def __getattr__(self, name: str) -> Any:
        if name not in _INDICES:
            raise AttributeError(name)
        return self.values[_INDICES[name]]

    def changed(self, **changes: Any) -> RunRow:
        """Return a copy of the row in which some values, given by name, are replaced."""
        return self._replace(
            values=tuple(changes.get(name, self.values[index]) for name, index in _INDICES.items())
        )


_INDICES = {quantity.name: index for index, quantity in enumerate(RUN)}
"""Index in `RunRow.values` by the name of the quantity."""


class ShockRow(NamedTuple):
    """Demands of one event in a run of a sequence of earthquakes.

    `shock` is the number of the event, from 1; `start` is the time of its first sample, s; `pga` is
    its peak ground acceleration, m/s^2. `values` contains the demands in the order of `DEMANDED`.
    """

    building: int
    motion: int
    scale: float
    sample: int
    shock: int
    start: float
    pga: float
    values: tuple[Any, ...]


class StoryRow(NamedTuple):
    """Values of a story in a run, in the order of `STORY`, and their errors if these were
    estimated."""

    building: int
    motion: int
    scale: float
    sample: int
    story: int
    height: float
    values: tuple[float, ...]
    errors: tuple[float, ...] = ()


@dataclass
class Rows:
    """Rows of runs, stories and events. Rows of stories exist only if requested."""

    runs: list[RunRow] = field(default_factory=list)
    stories: list[StoryRow] = field(default_factory=list)
    shocks: list[ShockRow] = field(default_factory=list)

    def extend(self, others: Rows) -> None:
        """Append other rows."""
        self.runs += others.runs
        self.stories += others.stories
        self.shocks += others.shocks


def demand_cells(stories: StoryPeaks) -> list[dict[str, Any]]:
    """Return one dictionary per run: the demands, such as the peak drift ratio, by name. They are
    computed from the peaks of the stories, which have the shape (runs, stories)."""
    columns = {name: column.tolist() for name, column in demand_columns(stories).items()}
    return [
        dict(zip(columns, run_values, strict=True))
        for run_values in zip(*columns.values(), strict=True)
    ]


def story_rows(
    building: int, run: Run, stories: StoryPeaks, check: ErrorEstimate | None = None
) -> list[StoryRow]:
    """Return the rows of the stories of a run, from the ground up.

    Parameters
    ----------
    building : int
        Number of the building.
    run : Run
        The run.
    stories : StoryPeaks
        Peaks of the stories.
    check : ErrorEstimate, optional
        Error estimate of the run. Without it, the errors in the rows are empty.
    """
    values = _values_by_story(stories)
    errors = _values_by_story(check.errors) if check else repeat(())
    # `repeat` does not end, so the iterables may have different lengths.
    cells = zip(stories.height.tolist(), values, errors, strict=False)
    return [StoryRow(building, *run, story, *row) for story, row in enumerate(cells, start=1)]


def _values_by_story(peaks: Any) -> Iterable[tuple[float, ...]]:
    """Return one tuple per story with its values, or their errors, in the order of `STORY`."""
    return zip(*(getattr(peaks, quantity.name).tolist() for quantity in STORY), strict=True)


def shock_rows(building: int, run: Run, shocks: Sequence[Shock]) -> list[ShockRow]:
    """Return the rows of the events of a run of a sequence, in chronological order."""
    rows = []
    for number, shock in enumerate(shocks, start=1):
        # The peaks of an event belong to one run.
        (demands,) = demand_cells(shock.stories)
        rows.append(
            ShockRow(building, *run, number, shock.start, shock.record.pga, tuple(demands.values()))
        )
    return rows


# ---- Batch

Item = TypeVar("Item")

_MIN_EVALUATED, _MAX_EVALUATED = 4, 8
"""Minimum and maximum number of runs with an error estimate; in between, a quarter of the runs."""

_MAX_TRIALS = 24
"""Maximum number of runs tried. Runs in which the building collapses provide no error estimate."""


def building_step(
    subject: Subject,
    records: Mapping[int, Record],
    runs: Sequence[Run],
    settings: RunSettings,
    tolerance: float,
) -> float | None:
    """Return the maximum time step (s) at which the estimated errors of the peak drifts of a
    building stay below a tolerance.

    The errors are estimated for a quarter of the runs, but for at least 4 and at most 8 runs. The
    minimum of their time steps is used for all runs of the building. The result is None if no run
    that was tried provides a time step.

    Parameters
    ----------
    subject : Subject
        The building and its method.
    records : mapping of int to Record
        Ground motions by number.
    runs : sequence of Run
        All runs of the building.
    settings : RunSettings
        Settings of the runs.
    tolerance : float
        Maximum estimated error, relative to the peak drifts.
    """
    step, evaluated_count = math.inf, 0
    required_count = min(max(_MIN_EVALUATED, len(runs) // 4), _MAX_EVALUATED)
    for run in islice(_representative_first(runs, records), _MAX_TRIALS):
        record = records[run.motion].scaled(run.scale)
        case = subject.case(record)
        if isinstance(record, JoinedRecord):
            sequence = sequence_of(case, record.shocks, rest=record.rest, dt=settings.dt)
            case = case.under(sequence.whole)
        # Runs that collapse or fail provide no time step: try other runs instead.
        outcome = attempt(case, case.steps(settings.dt, settings.duration))
        if isinstance(outcome, Response) and outcome.collapse:
            continue
        # With `largest`, the step of each run is at most the step of the previous runs.
        try:
            step = step_within(
                case, tolerance, dt=settings.dt, duration=settings.duration, largest=step
            )
        except FailedRun:
            continue
        evaluated_count += 1
        if evaluated_count == required_count:
            break
    return step if evaluated_count else None


def _representative_first(runs: Sequence[Run], records: Mapping[int, Record]) -> Iterator[Run]:
    """Yield the runs of a building in an order in which the first N are representative.

    The discretization error depends on the motion as much as on the building, so a single motion,
    even the strongest, is not representative. The first N runs therefore use as many different
    motions as possible, beginning with medium ones, with scale factors from the middle of the
    range.

    Parameters
    ----------
    runs : sequence of Run
        All runs of the building.
    records : mapping of int to Record
        Ground motions by number.
    """
    runs_by_motion: dict[int, list[Run]] = {}
    for run in sorted(runs, key=lambda run: abs(run.scale)):
        runs_by_motion.setdefault(run.motion, []).append(run)
    motions_by_pga = sorted(
        runs_by_motion,
        key=lambda motion: abs(runs_by_motion[motion][-1].scale) * records[motion].pga,
    )
    # Each round has one run of every motion; None if the motion has no more runs.
    rounds = zip_longest(
        *(_middle_first(runs_by_motion[motion]) for motion in _middle_first(motions_by_pga))
    )
    return (run for run in chain.from_iterable(rounds) if run is not None)


def _middle_first(items: Sequence[Item]) -> Iterator[Item]:
    """Yield the middle item, then the middle items of both halves, and so on."""
    segments = deque([items])
    while segments:
        segment = segments.popleft()
        if segment:
            middle = len(segment) // 2
            yield segment[middle]
            segments += [segment[:middle], segment[middle + 1 :]]


_EQUAL_STEPS = 1e-9  # relative difference up to which time steps are equal


@dataclass(frozen=True)
class _Job:
    """Run with its time steps and the number of repetitions so far."""

    run: Run
    steps: Steps
    repeats: int = 0


@dataclass(frozen=True)
class Batch:
    """Input of the runs of one building, which are integrated by `results`.

    Attributes
    ----------
    number : int
        Number of the building in the campaign.
    subject : Subject
        The building and its method.
    motions : Motions
        Ground motions with their numbers in the campaign.
    spectral : mapping of int to float or None
        Sa(T1) of each motion at the scale factor 1, m/s^2.
    settings : RunSettings
        Settings of the runs.
    """

    number: int
    subject: Subject
    motions: Motions
    spectral: dict[int, float | None]
    settings: RunSettings

    def results(self, runs: Sequence[Run], max_step: float | None = math.inf) -> Rows:
        """Integrate runs and return their rows.

        Parameters
        ----------
        runs : sequence of Run
            The runs.
        max_step : float or None
            Maximum time step that meets the tolerance, s. The time step of each record is halved or
            doubled to the maximum value up to this limit. None: no time step meets the tolerance;
            the runs are not integrated, and the status in their rows states this reason. By default
            (infinity) the time steps of the settings are used.

        Raises
        ------
        UsageError
            A time step does not fit a record.
        AnalysisError
            The method does not integrate this building.
        """
        # The start times of the events of a sequence depend on the decay of free vibration, which
        # differs between runs. Sequences are therefore integrated individually.
        results = Rows()
        for run in runs:
            if isinstance(self.motions.records[run.motion], JoinedRecord):
                results.extend(self._sequence(run, max_step))
        runs = [
            run for run in runs if not isinstance(self.motions.records[run.motion], JoinedRecord)
        ]
        # The time step depends on the sampling interval of the motion, but not on the scale factor:
        # compute it once for each motion. Without a step within the tolerance, the rows contain the
        # time steps of the settings.
        step_limit = math.inf if max_step is None else max_step
        steps_of_motion = {
            motion: self._steps(motion, step_limit)
            for motion in dict.fromkeys(run.motion for run in runs)
        }
        jobs = [_Job(run, steps_of_motion[run.motion]) for run in runs]
        if max_step is None:
            results.runs += [self._row(job, NO_STEP) for job in jobs]
            return results
        # `_at_step` appends the rows of the other runs to the results, and returns the failed runs
        # with half the time step until the maximum number of repetitions is reached.
        while jobs:
            failed: list[_Job] = []
            for h in dict.fromkeys(job.steps.h for job in jobs):
                failed += self._at_step([job for job in jobs if job.steps.h == h], results)
            jobs = failed
        return results

    def _sequence(self, run: Run, max_step: float | None) -> Rows:
        """Integrate a sequence of events and return its rows: the row of the run, the rows of its
        stories, and one row per event.

        The events are joined to one record. The time between two events depends on the building if
        each event starts after the free vibration of the previous event.

        Parameters
        ----------
        run : Run
            Run with a JoinedRecord as ground motion.
        max_step : float or None
            Maximum time step, as for `results`.
        """
        case, dt = self._case(run), self.settings.dt
        record = case.record
        assert isinstance(record, JoinedRecord)
        # The start times of events may depend on the decay of free vibration at this scale factor.
        sequence = sequence_of(case, record.shocks, rest=record.rest, dt=dt)
        joined_case = case.under(sequence.whole)
        # The joined record includes the scale factor, so it is run at the scale factor 1 with
        # scaled intensities.
        spectral = self.spectral[run.motion]
        single_run_batch = replace(
            self,
            motions=Motions({run.motion: sequence.whole}),
            spectral={run.motion: None if spectral is None else spectral * abs(run.scale)},
            settings=replace(self.settings, duration=sequence.whole.duration),
        )
        joined_rows = single_run_batch.results([run._replace(scale=1.0)], max_step)
        (run_row,) = joined_rows.runs
        # Compute the demands of each event, if the run has a result (a number of steps).
        if run_row.steps is not None:
            joined_steps = replace(
                joined_case.steps(run_row.dt, sequence.whole.duration), count=run_row.steps
            )
            shocks = event_responses(
                joined_case,
                sequence,
                joined_steps,
                check=self.settings.check and bool(record.fixed),
            )
            joined_rows.shocks = shock_rows(self.number, run, shocks)
            # The first `fixed` events of the record are not scaled; they only damage the building
            # before the event of interest. Then the demands of the run are those of the last event.
            if record.fixed and len(shocks) > record.fixed:
                last = shocks[-1]
                last_errors = (
                    demand_errors(last.stories, last.errors)
                    if run_row.errors and last.errors
                    else ()
                )
                run_row = run_row.changed(**demand_cells(last.stories)[0])._replace(
                    errors=last_errors
                )
        stories = [story._replace(scale=run.scale) for story in joined_rows.stories]
        return Rows([run_row._replace(scale=run.scale)], stories, joined_rows.shocks)

    def _steps(self, motion: int, max_step: float) -> Steps:
        """Return the time steps for a motion: the time step of the settings, doubled or halved as
        often as necessary to be the longest one that does not exceed `max_step` (s)."""
        case, duration = self._case(Run(motion, 1.0)), self.settings.duration
        steps = case.steps(self.settings.dt, duration)
        if max_step == math.inf:
            return steps
        # Time steps that are halved or doubled still end at samples of the record. A negative
        # number of doublings is a number of halvings. Steps that equal the limit are allowed.
        doublings = math.floor(math.log2(max_step / steps.h) + _EQUAL_STEPS)
        if doublings > 0:
            return case.steps(steps.h * 2.0**doublings, duration)
        for _ in range(-doublings):
            steps = finer(steps)
        return steps

    def _case(self, run: Run) -> Case:
        """Return the analysis case of a run."""
        return self.subject.case(self.motions.records[run.motion], run.scale)

    def _at_step(self, jobs: list[_Job], results: Rows) -> list[_Job]:
        """Integrate runs with the same time step.

        Parameters
        ----------
        jobs : list of _Job
            The runs.
        results : Rows
            Rows; the rows of completed runs are appended.

        Returns
        -------
        list of _Job
            Failed runs that must be repeated, with half the time step.
        """
        settings = self.settings
        run_requests = [(job.run.motion, job.run.scale, job.steps) for job in jobs]
        outcomes = run_batch(
            self.subject,
            self.motions,
            run_requests,
            check=settings.check,
            to_rest=settings.until_rest,
            status_only=True,
        )
        jobs_to_repeat = []
        for index, failure in outcomes.failures.items():
            job = jobs[index]
            # A time step above the limit of the method is reported and not repeated.
            if failure.finer_may_help and job.repeats < REPEATS:
                jobs_to_repeat.append(_Job(job.run, finer(job.steps), job.repeats + 1))
            else:
                results.runs.append(self._row(job, failure.status))
        # Compute the demands of all runs as arrays, then create the rows.
        demands, statuses = demand_cells(outcomes.stories), outcomes.status
        for index, job in enumerate(jobs):
            if index in outcomes.failures:
                continue
            peaks = outcomes.stories_of(index)
            # A run that was integrated separately includes its error estimate.
            response = outcomes.responses.get(index)
            error_estimate = None if response is None else response.check
            values = demands[index] | {
                "energy_error": float(outcomes.energy_error[index]),
                "steps": int(outcomes.steps[index]),
                "at_rest": outcomes.at_rest[index],
            }
            row = self._row(
                job, statuses.get(index, "done"), outcomes.collapses.get(index), **values
            )
            if error_estimate:
                row = row._replace(errors=demand_errors(peaks, error_estimate.errors))
            results.runs.append(row)
            if settings.keeps_stories:
                results.stories += story_rows(self.number, job.run, peaks, error_estimate)
        return jobs_to_repeat

    def _row(
        self, job: _Job, status: str, collapse: Collapse | None = None, **values: Any
    ) -> RunRow:
        """Return the row of a run. If a run has no result, its row contains only time step, status,
        PGA, Sa(T1) and number of repetitions.

        Parameters
        ----------
        job : _Job
            The run.
        status : str
            Status of the run.
        collapse : Collapse, optional
            Collapse of the building.
        **values : Any
            Further values by name.
        """
        if collapse:
            values |= {"collapse_time": collapse.time, "collapse_story": collapse.story}
        # A negative scale factor reverses the motion; intensities are positive.
        spectral, factor = self.spectral[job.run.motion], abs(job.run.scale)
        values |= {
            "dt": job.steps.h,
            "status": status,
            "pga": self.motions.records[job.run.motion].pga * factor,
            "sa_t1": None if spectral is None else spectral * factor,
            "repeats": job.repeats,
        }
        return RunRow(self.number, *job.run, tuple(values.get(quantity.name) for quantity in RUN))


@dataclass(frozen=True)
class Chunk:
    """Runs with their complete input.

    Attributes
    ----------
    number : int
        Number of the chunk in its campaign.
    buildings : tuple of BuildingRuns
        The buildings with their runs.
    records : mapping of int to Record
        Ground motions by number.
    settings : RunSettings
        Settings of the runs.
    """

    number: int
    buildings: tuple[BuildingRuns, ...]
    records: Mapping[int, Record]
    settings: RunSettings


@dataclass(frozen=True)
class Done:
    """Results of a chunk: its number, its rows and the processor time, s."""

    number: int
    rows: Rows
    seconds: float


def do(chunk: Chunk) -> Done:
    """Integrate the runs of a chunk and return their rows.

    Raises
    ------
    UsageError
        A time step does not fit a record.
    AnalysisError
        A method does not integrate a building.
    """
    # Measure the time of this thread: the time of the process includes chunks of other threads.
    began = time.thread_time()
    motions = Motions(chunk.records)
    subjects = [building_runs.source.subject() for building_runs in chunk.buildings]

    # Compute Sa(T1) for each motion at the periods of all buildings in one call.
    # `spectral` has one dictionary per building, from the number of the motion to Sa(T1).
    spectral: list[dict[int, float | None]] = [{} for _ in subjects]
    subjects_of_motion: dict[int, list[int]] = {}
    for index, building_runs in enumerate(chunk.buildings):
        for motion in dict.fromkeys(run.motion for run in building_runs.runs):
            subjects_of_motion.setdefault(motion, []).append(index)
    for motion, indices in subjects_of_motion.items():
        values = spectral_accelerations(
            chunk.records[motion], [subjects[index].period for index in indices]
        )
        for index, value in zip(indices, values, strict=True):
            spectral[index][motion] = value
    rows = Rows()
    # All runs of a building with the same time step are integrated by one compiled call.
    for building_runs, subject, sa in zip(chunk.buildings, subjects, spectral, strict=True):
        batch = Batch(building_runs.number, subject, motions, sa, chunk.settings)
        rows.extend(batch.results(building_runs.runs, building_runs.max_step))
    return Done(chunk.number, rows, time.thread_time() - began)


def spectral_accelerations(record: Record, periods: list[float]) -> list[float | None]:
    """Return the spectral accelerations of a record at periods, m/s^2, for 5 % damping.

    Parameters
    ----------
    record : Record
        Ground motion. The result for a sequence is the maximum over its events.
    periods : list of float
        Periods, s.

    Returns
    -------
    list of float or None
        Spectral accelerations; None for a period that is too short for the record.
    """
    if isinstance(record, JoinedRecord):
        values_by_period = zip(
            *(spectral_accelerations(shock, periods) for shock in record.shocks), strict=True
        )
        # `filter` removes zeros, too; the maximum of zeros alone is 0.
        return [
            None if None in values else max(filter(None, values), default=0.0)
            for values in values_by_period
        ]
    # The call fails if one of the periods is too short for the record. Then compute each period
    # separately, so that only this period has no result.
    try:
        return list(spectrum(record, np.array(periods), SA_DAMPING).psa.tolist())
    except AnalysisError:
        if len(periods) == 1:
            return [None]
    return [value for period in periods for value in spectral_accelerations(record, [period])]
