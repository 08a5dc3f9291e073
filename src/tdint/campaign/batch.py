"""Chunks of runs: units of work that a thread or a remote worker processes with its input only.

All runs of a building with the same time step are integrated together
(`tdint.analysis.run.batch`). Failed runs are repeated with half the time step.
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
        Store the peaks of every story, to write them.
    profiles : bool
        Store the peaks of every story, for their statistics over the motions.
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
    """Object that creates a building: the building, or a row of an inventory with its rules."""

    def subject(self) -> Subject:
        """Return the building."""


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
    largest : float or None
        Maximum time step for a tolerance, s; None if no time step meets the tolerance.
    """

    number: int
    source: Source
    runs: tuple[Run, ...]
    largest: float | None = math.inf


class RunRow(NamedTuple):
    """Values of a run in the order of `RUN`; missing values are None or NaN.

    If errors were estimated, `errors` contains the errors of the demands in the order of
    `RUN_WITH_ERROR`. Values are also available by name: `row.status`.
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

    def but(self, **values: Any) -> RunRow:
        """Return a copy of the row with other values."""
        return self._replace(
            values=tuple(values.get(name, self.values[index]) for name, index in _INDICES.items())
        )


_INDICES = {quantity.name: index for index, quantity in enumerate(RUN)}


class ShockRow(NamedTuple):
    """Values of an event in a run of a sequence, in the order of `DEMANDED`.

    Events are numbered from 1. The row contains the time (s) of the first sample and the peak
    ground acceleration (m/s^2).
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
    """Return the values that follow from the demands of each run, by name. The peaks have the shape
    (runs, n)."""
    columns = {name: column.tolist() for name, column in demand_columns(stories).items()}
    return [dict(zip(columns, cells, strict=True)) for cells in zip(*columns.values(), strict=True)]


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
        Error estimate of the run.
    """
    by_story: list[Iterable[tuple[float, ...]]] = [
        zip(*(getattr(values, quantity.name).tolist() for quantity in STORY), strict=True)
        if values
        else repeat(())
        for values in (stories, check and check.errors)
    ]
    cells = zip(stories.height.tolist(), *by_story, strict=False)
    return [StoryRow(building, *run, story, *row) for story, row in enumerate(cells, start=1)]


def shock_rows(building: int, run: Run, shocks: Sequence[Shock]) -> list[ShockRow]:
    """Return the rows of the events of a run of a sequence, in chronological order."""
    return [
        ShockRow(building, *run, number, shock.start, shock.record.pga, tuple(cells.values()))
        for number, shock in enumerate(shocks, start=1)
        for cells in demand_cells(shock.stories)
    ]


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
    """Return the maximum time step (s) that meets a tolerance of the peak drifts of a building, or
    None if no time step does.

    The errors are estimated for some of the runs by `tdint.analysis.run.step_choice`. The time step
    is chosen once and used for all runs of the building.

    The discretization error depends on the motion as much as on the building, so a single motion,
    even the strongest, is not representative. The runs are therefore distributed over motions and
    scale factors, and the minimum of their time steps is used.

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
    # Order the runs so that the first N use as many different motions as possible, with scale
    # factors from the middle of the range.
    runs_by_motion: dict[int, list[Run]] = {}
    for run in sorted(runs, key=lambda run: abs(run.scale)):
        runs_by_motion.setdefault(run.motion, []).append(run)
    motions_by_pga = sorted(
        runs_by_motion,
        key=lambda motion: abs(runs_by_motion[motion][-1].scale) * records[motion].pga,
    )
    rounds = zip_longest(
        *(_middle_first(runs_by_motion[motion]) for motion in _middle_first(motions_by_pga))
    )
    ordered = (run for run in chain.from_iterable(rounds) if run is not None)

    # Runs that collapse or fail provide no time step: try other runs instead.
    step, evaluated = math.inf, 0
    required = min(max(_MIN_EVALUATED, len(runs) // 4), _MAX_EVALUATED)
    for run in islice(ordered, _MAX_TRIALS):
        record = records[run.motion].scaled(run.scale)
        case = subject.case(record)
        if isinstance(record, JoinedRecord):
            case = case.under(
                sequence_of(case, record.shocks, rest=record.rest, dt=settings.dt).whole
            )
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
        evaluated += 1
        if evaluated == required:
            break
    return step if evaluated else None


def _middle_first(items: Sequence[Item]) -> Iterator[Item]:
    """Yield the middle item, then the middle items of both halves, and so on."""
    parts = deque([items])
    while parts:
        part = parts.popleft()
        if part:
            middle = len(part) // 2
            yield part[middle]
            parts += [part[:middle], part[middle + 1 :]]


_EQUAL_STEPS = 1e-9  # relative difference up to which time steps are equal


@dataclass(frozen=True)
class _Job:
    """Run with its time steps and the number of repetitions so far."""

    run: Run
    steps: Steps
    repeats: int = 0


@dataclass(frozen=True)
class Batch:
    """Runs of one building.

    Attributes
    ----------
    number : int
        Number of the building in the campaign.
    subject : Subject
        The building and its method.
    motions : Motions
        Ground motions; all motions of `spectral` are included.
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

    def results(self, runs: Sequence[Run], largest: float | None = math.inf) -> Rows:
        """Integrate runs and return their rows.

        Parameters
        ----------
        runs : sequence of Run
            The runs.
        largest : float or None
            Maximum time step for a tolerance, s. The time step of each record is halved or doubled
            to the maximum value up to this limit. None: no time step meets the tolerance. By
            default the time steps of the settings are used.

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
                results.extend(self._sequence(run, largest))
        runs = [
            run for run in runs if not isinstance(self.motions.records[run.motion], JoinedRecord)
        ]
        # The time step depends on the sampling interval of the motion, but not on the scale factor:
        # compute it once for each motion.
        chosen = math.inf if largest is None else largest
        steps = {
            motion: self._steps(motion, chosen)
            for motion in dict.fromkeys(run.motion for run in runs)
        }
        jobs = [_Job(run, steps[run.motion]) for run in runs]
        # If no time step meets the tolerance, do not run; the status of the rows is the reason.
        if largest is None:
            results.runs += [self._row(job, NO_STEP) for job in jobs]
            return results
        # `_at_step` returns failed runs with a smaller time step, until no repetition is left.
        while jobs:
            failed: list[_Job] = []
            for h in dict.fromkeys(job.steps.h for job in jobs):
                failed += self._at_step([job for job in jobs if job.steps.h == h], results)
            jobs = failed
        return results

    def _sequence(self, run: Run, largest: float | None) -> Rows:
        """Run a sequence of events: integrate the joined record of this building, and evaluate
        its parts."""
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
        rows = single_run_batch.results([run._replace(scale=1.0)], largest)
        (row,) = rows.runs
        # Compute the demands of each event, if the run has a result.
        if row.steps is not None:
            steps = replace(joined_case.steps(row.dt, sequence.whole.duration), count=row.steps)
            shocks = event_responses(
                joined_case, sequence, steps, check=self.settings.check and bool(record.fixed)
            )
            rows.shocks = shock_rows(self.number, run, shocks)
            # After events that only damage the building, the demands of the run are the demands of
            # the last event.
            if record.fixed and len(shocks) > record.fixed:
                last = shocks[-1]
                errors = (
                    demand_errors(last.stories, last.errors) if row.errors and last.errors else ()
                )
                row = row.but(**demand_cells(last.stories)[0])._replace(errors=errors)
        stories = [story._replace(scale=run.scale) for story in rows.stories]
        return Rows([row._replace(scale=run.scale)], stories, rows.shocks)

    def _steps(self, motion: int, largest: float) -> Steps:
        """Return the time steps for a motion: the time step of the settings, doubled or halved as
        often as necessary to be the longest one that does not exceed `largest` (s)."""
        case, duration = self._case(Run(motion, 1.0)), self.settings.duration
        steps = case.steps(self.settings.dt, duration)
        if largest == math.inf:
            return steps
        # Time steps that are halved or doubled still end at samples of the record.
        doublings = math.floor(math.log2(largest / steps.h) + _EQUAL_STEPS)
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
            Failed runs, with a smaller time step.
        """
        runs, settings = [(job.run.motion, job.run.scale, job.steps) for job in jobs], self.settings
        outcomes = run_batch(
            self.subject,
            self.motions,
            runs,
            check=settings.check,
            to_rest=settings.until_rest,
            status_only=True,
        )
        repeated = []
        for i, failure in outcomes.failures.items():
            job = jobs[i]
            # A time step above the limit of the method is reported and not repeated.
            if failure.finer_may_help and job.repeats < REPEATS:
                repeated.append(_Job(job.run, finer(job.steps), job.repeats + 1))
            else:
                results.runs.append(self._row(job, failure.status))
        # Compute the demands of all runs as arrays, then create the rows.
        demanded, statuses = demand_cells(outcomes.stories), outcomes.status
        for i, job in enumerate(jobs):
            if i in outcomes.failures:
                continue
            peaks = outcomes.stories_of(i)
            # A run that was integrated separately includes its error estimate.
            check = outcomes.responses[i].check if i in outcomes.responses else None
            values = demanded[i] | {
                "energy_error": float(outcomes.energy_error[i]),
                "steps": int(outcomes.steps[i]),
                "at_rest": outcomes.at_rest[i],
            }
            row = self._row(job, statuses.get(i, "done"), outcomes.collapses.get(i), **values)
            if check:
                row = row._replace(errors=demand_errors(peaks, check.errors))
            results.runs.append(row)
            if settings.keeps_stories:
                results.stories += story_rows(self.number, job.run, peaks, check)
        return repeated

    def _row(
        self, job: _Job, status: str, collapse: Collapse | None = None, **values: Any
    ) -> RunRow:
        """Return the row of a run. Without a result it contains only time step, status, PGA, Sa(T1)
        and number of repetitions.

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
    """Integrate the runs of a chunk. Errors are those of `Batch.results`."""
    # Chunks run in parallel on threads, so that the time of the process would count all of them.
    began = time.thread_time()
    motions = Motions(chunk.records)
    subjects = [part.source.subject() for part in chunk.buildings]

    # Compute Sa(T1) for each motion at the periods of all buildings in one call.
    spectral: list[dict[int, float | None]] = [{} for _ in subjects]
    subjects_of_motion: dict[int, list[int]] = {}
    for index, part in enumerate(chunk.buildings):
        for motion in dict.fromkeys(run.motion for run in part.runs):
            subjects_of_motion.setdefault(motion, []).append(index)
    for motion, indices in subjects_of_motion.items():
        values = spectral_accelerations(
            chunk.records[motion], [subjects[index].period for index in indices]
        )
        for index, value in zip(indices, values, strict=True):
            spectral[index][motion] = value
    rows = Rows()
    # All runs of a building with the same time step are integrated by one compiled call.
    for part, subject, sa in zip(chunk.buildings, subjects, spectral, strict=True):
        batch = Batch(part.number, subject, motions, sa, chunk.settings)
        rows.extend(batch.results(part.runs, part.largest))
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
        by_event = zip(
            *(spectral_accelerations(shock, periods) for shock in record.shocks), strict=True
        )
        return [
            None if None in values else max(filter(None, values), default=0.0)
            for values in by_event
        ]
    try:
        return list(spectrum(record, np.array(periods), SA_DAMPING).psa.tolist())
    except AnalysisError:
        if len(periods) == 1:
            return [None]
    # The call fails if one of the periods is too short for the record. Compute each period
    # separately, so that only this period has no result.
    return [value for period in periods for value in spectral_accelerations(record, [period])]
