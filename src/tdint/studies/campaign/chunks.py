"""Integrate the runs of a campaign in chunks.

A campaign runs many buildings under many scaled ground motions. A chunk is a part of its runs
together with all their input, so that a thread or a remote worker can process it without reading
files. All runs of a building with the same time step are integrated by a single compiled call;
sequences, load cases and runs with error estimates are integrated individually. Failed runs are
repeated with half the time step.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain, islice, zip_longest
from typing import Any, NamedTuple, Protocol, Self, TypeVar

import numpy as np

from tdint.errors import AnalysisError
from tdint.ground_motion.axes import intensity_of, pga_of
from tdint.ground_motion.joined import JoinedRecord
from tdint.ground_motion.record import Record
from tdint.items import grouped
from tdint.output.tables.devices import device_rows
from tdint.output.tables.elements import ELEMENT_COLUMNS, ELEMENT_ERROR
from tdint.output.tables.responses import STORY_COLUMNS, STORY_ERROR
from tdint.output.tables.table import Cell, joined_rows
from tdint.response.pairs import Place, Run
from tdint.response.runs.batch import Subject, run_batch
from tdint.response.runs.case import Case
from tdint.response.runs.error_estimate import attempt
from tdint.response.runs.load_case import LoadCase
from tdint.response.runs.outcome import NO_STEP, Collapse, EventResponse, FailedRun, Response
from tdint.response.runs.run_values import RUN, demand_cells, demand_errors
from tdint.response.runs.sequence import event_responses, sequence_of
from tdint.response.runs.settings import RunSettings
from tdint.response.runs.step_choice import step_within
from tdint.response.spectra.elastic import SA_DAMPING, spectrum
from tdint.response.time_steps import Steps, finer

# ---- Input of runs, and rows of results: one for each run and, if requested, one for each story

REPEATS = 3
"""Maximum number of repetitions of a run that diverged or did not converge, each with half the time
step of the preceding run. Single steps of each run are also halved
(`tdint.methods.workspace.HALVINGS`)."""


@dataclass(frozen=True, kw_only=True)
class CampaignSettings(RunSettings):
    """Settings of all runs of a campaign.

    Attributes
    ----------
    stories : bool
        Store the peaks of every story, because the table of stories is written.
    profiles : bool
        Store the peaks of every story, because the table with their statistics over the motions is
        written.
    tolerance : float | None
        Maximum estimated error of the peak drifts, relative to these drifts. The time step of each
        building is chosen to meet this tolerance. None: the time step is not chosen by errors.
    """

    stories: bool = False
    profiles: bool = False
    tolerance: float | None = None

    @property
    def keeps_stories(self) -> bool:
        """True if the peaks of stories are stored."""
        return self.stories or self.profiles


class Source(Protocol):
    """Interface of the objects that provide a building: a building that exists already, or a row of
    an inventory, from which rules derive the building when `subject` is called."""

    def subject(self) -> Subject:
        """Return the building with its time integration method."""


class BuildingRuns(NamedTuple):
    """Runs of one building.

    Attributes
    ----------
    runs : mapping of Run to Place
        Runs in their order, with ground motion and level of each run.
    max_step : float | None
        Maximum time step that meets the tolerance of the campaign, s; None if no time step meets
        the tolerance; infinity if the campaign has no tolerance.
    """

    number: int
    source: Source
    runs: Mapping[Run, Place]
    max_step: float | None = math.inf

    def without(self, runs: Collection[tuple[Any, ...]]) -> Self:
        """Return the runs that are not in a collection of keys (building, and fields of `Run`)."""
        kept = {run: place for run, place in self.runs.items() if (self.number, *run) not in runs}
        return self._replace(runs=kept)

    def first(self, count: int) -> Self:
        """Return the first runs, at most `count`."""
        return self._replace(runs=dict(islice(self.runs.items(), count)))


class RunRow(NamedTuple):
    """Results of one run, as a row of the table of runs.

    Attributes
    ----------
    motion, scale, sample : int, float, int
        Ground motion, scale factor and sample, as in `Run`.
    place : Place
        Ground motion and level in the suite; empty for runs outside of campaigns.
    values : tuple
        One value per quantity of `RUN`, in that order. Missing values are None or NaN. Values are
        also available by name, for example `row.status`.
    errors : tuple of float | None
        Estimated errors of the demands in the order of `RUN_WITH_ERROR`; empty if errors were not
        estimated.
    """

    building: int
    motion: int
    scale: float
    sample: int
    place: Place
    values: tuple[Any, ...]
    errors: tuple[float | None, ...] = ()

    def __getattr__(self, name: str) -> Any:
        """Return the value of the quantity with this name; raise AttributeError if `RUN` does not
        contain the quantity."""
        if name not in _INDICES:
            raise AttributeError(name)
        return self.values[_INDICES[name]]

    def changed(self, **changes: Any) -> RunRow:
        """Return a copy of the row with some new values. `changes` contains the new values by the
        name of their quantity in `RUN`; other names are ignored."""
        return self._replace(
            values=tuple(changes.get(name, self.values[index]) for name, index in _INDICES.items())
        )


_INDICES = {quantity.name: index for index, quantity in enumerate(RUN)}
"""Index of each quantity in `RunRow.values`, by the name of the quantity."""


class PartRow(NamedTuple):
    """Results of a story, an element, an attachment, a link or an event in one run.

    The run is identified by `building`, `motion`, `scale` and `sample`, as in `RunRow`. `cells` are
    the cells of its table, without errors if these were not estimated. Rows of elements,
    attachments and links start with their number in the model, from 1.
    """

    building: int
    motion: int
    scale: float
    sample: int
    cells: tuple[Cell, ...]


@dataclass
class Rows:
    """Results of runs: rows of runs; rows of stories and of elements, attachments and links (only
    if stories are stored); rows of events (only of runs under sequences of earthquakes)."""

    runs: list[RunRow] = field(default_factory=list)
    stories: list[PartRow] = field(default_factory=list)
    shocks: list[PartRow] = field(default_factory=list)
    elements: list[PartRow] = field(default_factory=list)
    attachments: list[PartRow] = field(default_factory=list)
    links: list[PartRow] = field(default_factory=list)

    def extend(self, added: Rows) -> None:
        """Append the rows of another object."""
        for name, rows in vars(added).items():
            getattr(self, name).extend(rows)

    def extend_parts(
        self,
        building: int,
        run: Run,
        stories: Iterable[tuple[Cell, ...]],
        *others: Iterable[tuple[Cell, ...]],
    ) -> None:
        """Append rows of the stories, elements, attachments and links of a run.

        `stories` and `others` contain the rows of their tables.
        """
        self.stories += (PartRow(building, *run, cells) for cells in stories)
        parts = self.elements, self.attachments, self.links
        for part, rows in zip(parts, others, strict=True):
            part += (
                PartRow(building, *run, (number, *cells))
                for number, cells in enumerate(rows, start=1)
            )

    def with_scale(self, scale: float) -> Self:
        """Return the rows of runs and their parts with another scale factor."""
        rows_by_name = {
            name: [row._replace(scale=scale) for row in rows] for name, rows in vars(self).items()
        }
        return replace(self, **rows_by_name)


def event_rows(building: int, run: Run, events: Sequence[EventResponse]) -> list[PartRow]:
    """Return the rows of the events of a run under a sequence of earthquakes, in chronological
    order: number, start time (s), peak ground acceleration (m/s^2), and demands."""
    # The peaks of an event have one run on their first axis, so there is one dictionary of demands.
    return [
        PartRow(building, *run, (number, event.start, pga_of(event.record), *demands.values()))
        for number, event in enumerate(events, start=1)
        for demands in demand_cells(event.stories)
    ]


# ---- Time step of a building from a tolerance

Item = TypeVar("Item")

_MIN_EVALUATED, _MAX_EVALUATED = 4, 8
"""Minimum and maximum number of runs of a building from which `building_step` chooses its time
step. Between these limits it is a quarter of the runs of the building."""

_MAX_TRIALS = 24
"""Maximum number of runs that `building_step` tries. The limit bounds its cost, because a run in
which the building collapses provides no error estimate and another run is tried instead."""


def building_step(
    subject: Subject,
    records: Mapping[int, Record],
    runs: Sequence[Run],
    settings: RunSettings,
    tolerance: float,
) -> float | None:
    """Return the time step for all runs of a building, s: the maximum time step that keeps the
    estimated errors of the peak drifts below a tolerance.

    The errors are estimated for a quarter of the runs, but for at least 4 and at most 8 runs. The
    result is the minimum of the time steps of these runs.

    Parameters
    ----------
    tolerance : float
        Maximum estimated error, relative to the peak drifts.

    Returns
    -------
    float | None
        Time step, s. None if no run that was tried provides a time step.
    """
    step, evaluated_count = math.inf, 0
    required_count = min(max(_MIN_EVALUATED, len(runs) // 4), _MAX_EVALUATED)
    for run in islice(_representative_first(runs, records), _MAX_TRIALS):
        record = records[run.motion].scaled(run.scale)
        case = subject.case(record)
        if isinstance(record, JoinedRecord):
            sequence = sequence_of(case, record.events, rest=record.rest, dt=settings.dt)
            case = case.under(sequence.joined)
        # A run that collapses provides no time step: try other runs instead.
        outcome = attempt(case, case.steps(settings.dt, settings.duration))
        if isinstance(outcome, Response) and outcome.collapse:
            continue
        # `largest` limits the time step of each run to the minimum of the previous runs.
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
    """Return the runs of a building, ordered so that the first few runs represent all runs.

    The discretization error depends on the ground motion as strongly as on the building, so a
    single motion, even the strongest, is not representative. The first runs therefore use
    different motions if possible. The motion of medium intensity is first, and the first run of
    each motion has its median scale factor.
    """
    runs_by_motion = grouped(
        (run.motion, run) for run in sorted(runs, key=lambda run: abs(run.scale))
    )

    def strongest_pga(motion: int) -> float:
        """Return the PGA of a motion at its maximum scale factor, m/s^2."""
        strongest_run = runs_by_motion[motion][-1]
        return abs(strongest_run.scale) * pga_of(records[motion])

    motions_by_pga = sorted(runs_by_motion, key=strongest_pga)
    rounds = zip_longest(
        *(_middle_first(runs_by_motion[motion]) for motion in _middle_first(motions_by_pga))
    )
    return (run for run in chain.from_iterable(rounds) if run is not None)


def _middle_first(items: Sequence[Item]) -> Iterator[Item]:
    """Yield the middle item of a sequence, then the middle items of its two halves, then the middle
    items of the quarters, and so on until every item has been yielded one time."""
    segments = deque([items])
    while segments:
        segment = segments.popleft()
        if segment:
            middle = len(segment) // 2
            yield segment[middle]
            segments += [segment[:middle], segment[middle + 1 :]]


# ---- Integration of the runs of a building

_EQUAL_STEPS = 1e-9
"""Number of doublings by which a time step may exceed its limit, so that a step that equals the
limit except for rounding is allowed."""


@dataclass(frozen=True)
class _Job:
    """Run with its time steps and the number of times it was repeated after a failure."""

    run: Run
    steps: Steps
    repeats: int = 0


@dataclass(frozen=True)
class Batch:
    """Building and ground motions of a campaign. `results` integrates runs of the building.

    Attributes
    ----------
    motions : mapping of int to Record
        Ground motions with their numbers in the campaign.
    spectral : mapping of int to float | None
        Sa(T1) of each motion at the scale factor 1, m/s^2.
    """

    number: int
    subject: Subject
    motions: Mapping[int, Record]
    spectral: dict[int, float | None]
    settings: CampaignSettings

    def results(self, runs: Sequence[Run], max_step: float | None = math.inf) -> Rows:
        """Integrate runs and return their rows, with stories and elements if they are stored, and
        the events of sequences.

        The time step of the settings is halved or doubled to obtain the longest step up to
        `max_step` (s); with infinity it is used unchanged. None: no time step meets the tolerance;
        the runs are not integrated, and the status in their rows states this reason.
        """
        # The start times of the events of a sequence depend on the decay of free vibration, which
        # differs between runs. Sequences are therefore integrated individually.
        results = Rows()
        single_runs = []
        for run in runs:
            record = self.motions[run.motion]
            if isinstance(record, JoinedRecord):
                results.extend(self._run_sequence(run, max_step))
            elif isinstance(record, LoadCase):
                # The forces are part of the building, so that each load case is a building.
                loaded = replace(self, subject=self.subject.loaded(record, run.scale))
                results.extend(loaded._run_together([run], max_step))
            else:
                single_runs.append(run)
        results.extend(self._run_together(single_runs, max_step))
        return results

    def _run_together(self, single_runs: Sequence[Run], max_step: float | None) -> Rows:
        """Integrate runs that are not sequences, as `results`. The runs of a load case must be runs
        of the building under this load case."""
        results = Rows()
        # The time step depends on the sampling interval of the motion, but not on the scale factor:
        # compute it one time for each motion.
        step_limit = math.inf if max_step is None else max_step
        motions = dict.fromkeys(run.motion for run in single_runs)
        steps_of_motion = {motion: self._time_steps(motion, step_limit) for motion in motions}
        jobs = [_Job(run, steps_of_motion[run.motion]) for run in single_runs]
        if max_step is None:
            results.runs += [self._row(job, NO_STEP) for job in jobs]
            return results
        # Failed jobs are kept, with half the time step, for the next pass.
        while jobs:
            jobs_to_repeat: list[_Job] = []
            for h in dict.fromkeys(job.steps.h for job in jobs):
                same_step_jobs = [job for job in jobs if job.steps.h == h]
                jobs_to_repeat += self._integrate_together(same_step_jobs, results)
            jobs = jobs_to_repeat
        return results

    def _run_sequence(self, run: Run, max_step: float | None) -> Rows:
        """Run a building under a sequence of earthquakes, for example a main shock and aftershocks.

        The events of the sequence are joined to a single record. The time between two events
        depends on the building if each event starts after the free vibration of the previous event.
        Rows of stories and elements contain the peaks over all events. A run that did not fail also
        has a row per event.
        """
        case, dt = self._case(run), self.settings.dt
        record = case.record
        assert isinstance(record, JoinedRecord)
        sequence = sequence_of(case, record.events, rest=record.rest, dt=dt)
        # The joined record includes the scale factor, so it is run at the scale factor 1 with
        # scaled intensities.
        spectral = self.spectral[run.motion]
        single_run_batch = replace(
            self,
            motions={run.motion: sequence.joined},
            spectral={run.motion: None if spectral is None else spectral * abs(run.scale)},
            subject=self.subject.throughout(),
            settings=replace(self.settings, duration=None),
        )
        joined_results = single_run_batch.results([run._replace(scale=1.0)], max_step)
        (run_row,) = joined_results.runs
        # A failed run has no number of steps, and no demands of its events.
        rows_of_events: list[PartRow] = []
        if run_row.steps is not None:
            # The demands of the events require the response history: the run is repeated with the
            # same time step and the same number of steps.
            joined_case = case.throughout(sequence.joined)
            joined_steps = replace(joined_case.steps(run_row.dt), count=run_row.steps)
            events = event_responses(
                joined_case,
                sequence,
                joined_steps,
                check=self.settings.check and bool(record.fixed),
                collapse_time=run_row.collapse_time or math.inf,
            )
            rows_of_events = event_rows(self.number, run, events)
            # The first `fixed` events of the record are not scaled; they only damage the building
            # before the event of interest. In this case, report the demands of the last event. Only
            # studies of `tdint ida` have such records, and they do not store rows of stories.
            if record.fixed and len(events) > record.fixed:
                stories, errors = events[-1].stories, events[-1].errors
                (demands,) = demand_cells(stories)
                run_errors = demand_errors(stories, errors) if run_row.errors and errors else ()
                run_row = run_row.changed(**demands)._replace(errors=run_errors)
        rows = replace(joined_results, runs=[run_row], shocks=rows_of_events)
        return rows.with_scale(run.scale)

    def _time_steps(self, motion: int, max_step: float) -> Steps:
        """Return the time steps for a ground motion: the longest steps of at most `max_step` (s)
        that are obtained from the time step of the settings by repeated doubling or halving; with
        infinity, the steps of the settings.
        """
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
        return self.subject.case(self.motions[run.motion], run.scale)

    def _integrate_together(self, jobs: list[_Job], results: Rows) -> list[_Job]:
        """Integrate runs that have the same time step, without error estimates in a single call.
        Return the failed runs that must be repeated with half the time step; the rows of all
        others are appended to `results`.
        """
        settings = self.settings
        run_requests = [(self.motions[job.run.motion], job.run.scale, job.steps) for job in jobs]
        outcomes = run_batch(
            self.subject,
            run_requests,
            check=settings.check,
            to_rest=settings.until_rest,
            status_only=True,
        )
        jobs_to_repeat = []
        for index, failure in outcomes.failures.items():
            job = jobs[index]
            # A run that would fail again with half the time step is not repeated.
            if failure.finer_may_help and job.repeats < REPEATS:
                jobs_to_repeat.append(_Job(job.run, finer(job.steps), job.repeats + 1))
            else:
                results.runs.append(self._row(job, failure.status))
        demands, statuses = demand_cells(outcomes.stories), outcomes.status
        for index, job in enumerate(jobs):
            if index in outcomes.failures:
                continue
            peaks = outcomes.stories_of(index)
            # Only runs that were integrated individually, for example because errors are estimated,
            # have a response.
            response = outcomes.responses.get(index)
            check = None if response is None else response.check
            values = demands[index] | {
                "energy_error": float(outcomes.energy_error[index]),
                "steps": int(outcomes.steps[index]),
                "at_rest": outcomes.at_rest[index],
            }
            row = self._row(
                job, statuses.get(index, "done"), outcomes.collapses.get(index), **values
            )
            if check:
                row = row._replace(errors=demand_errors(peaks, check.errors))
            results.runs.append(row)
            if settings.keeps_stories:
                elements = outcomes.elements_of(index, self.subject.model)
                results.extend_parts(
                    self.number,
                    job.run,
                    joined_rows(((STORY_COLUMNS, peaks), (STORY_ERROR, check and check.errors))),
                    joined_rows(
                        ((ELEMENT_COLUMNS, elements), (ELEMENT_ERROR, check and check.elements))
                    ),
                    *device_rows(self.subject.model, outcomes.devices_of(index)),
                )
        return jobs_to_repeat

    def _row(
        self, job: _Job, status: str, collapse: Collapse | None = None, **values: Any
    ) -> RunRow:
        """Return the row of a run with its time step, status, PGA, Sa(T1), number of repetitions
        and collapse.

        The further values by the name of their quantity in `RUN`, such as demands, are omitted for
        a failed run: these quantities are then None.
        """
        if collapse:
            values |= {"collapse_time": collapse.time, "collapse_story": collapse.story}
        # A negative scale factor reverses the motion; intensities are positive.
        spectral, factor = self.spectral[job.run.motion], abs(job.run.scale)
        values |= {
            "dt": job.steps.h,
            "status": status,
            "pga": pga_of(self.motions[job.run.motion]) * factor,
            "sa_t1": None if spectral is None else spectral * factor,
            "repeats": job.repeats,
        }
        cells = tuple(values.get(quantity.name) for quantity in RUN)
        return RunRow(self.number, *job.run, Place(), cells)


# ---- Chunks


@dataclass(frozen=True)
class Chunk:
    """Part of the runs of a campaign, with their complete input."""

    number: int
    buildings: tuple[BuildingRuns, ...]
    records: Mapping[int, Record]
    settings: CampaignSettings


@dataclass(frozen=True)
class ChunkResult:
    """Results of the runs of a chunk.

    Attributes
    ----------
    seconds : float
        Processor time, s.
    """

    number: int
    rows: Rows
    seconds: float


def run_chunk(chunk: Chunk) -> ChunkResult:
    """Integrate the runs of a chunk.

    Raises
    ------
    UsageError
        A time step does not fit a record.
    AnalysisError
        A method does not integrate a building.
    """
    # Measure the time of this thread: the time of the process includes chunks of other threads.
    start_time = time.thread_time()
    # A subject is a building with its time integration method. `Sa(T1)` of a motion is computed
    # together for the first periods of all buildings.
    subjects = [building_runs.source.subject() for building_runs in chunk.buildings]
    spectral = values_by_motion(
        [[run.motion for run in building_runs.runs] for building_runs in chunk.buildings],
        [subject.period for subject in subjects],
        lambda motion, periods: spectral_accelerations(chunk.records[motion], periods),
    )
    rows = Rows()
    for building_runs, subject, sa_t1 in zip(chunk.buildings, subjects, spectral, strict=True):
        batch = Batch(building_runs.number, subject, chunk.records, sa_t1, chunk.settings)
        results = batch.results([*building_runs.runs], building_runs.max_step)
        places = building_runs.runs
        results.runs = [row._replace(place=places[Run(*row[1:4])]) for row in results.runs]
        rows.extend(results)
    return ChunkResult(chunk.number, rows, time.thread_time() - start_time)


def values_by_motion(
    motions: Sequence[Iterable[int]],
    periods: Sequence[float],
    values_at: Callable[[int, list[float]], Sequence[Item]],
) -> list[dict[int, Item]]:
    """Return for each building a dictionary from the number of each of its ground motions to a
    value that depends on the first period of the building. A motion is evaluated one time, for the
    periods of all its buildings.

    Parameters
    ----------
    motions : sequence of iterables of int
        Numbers of the ground motions of each building.
    periods : sequence of float
        First period of each building, s.
    values_at : callable
        Function that returns the values of a motion, by its number, at several periods.
    """
    buildings_of_motion = grouped(
        (motion, building)
        for building, motions_of_building in enumerate(motions)
        for motion in dict.fromkeys(motions_of_building)
    )
    result: list[dict[int, Item]] = [{} for _ in periods]
    for motion, buildings in buildings_of_motion.items():
        values = values_at(motion, [periods[building] for building in buildings])
        for building, value in zip(buildings, values, strict=True):
            result[building][motion] = value
    return result


def spectral_accelerations(record: Record, periods: list[float]) -> list[float | None]:
    """Return the spectral accelerations of a record at periods, m/s^2, for 5 % damping.

    Parameters
    ----------
    record : Record
        Ground motion. The result for a sequence is the maximum over its events; a load case has no
        spectral acceleration (None).

    Returns
    -------
    list of float | None
        Spectral accelerations; None for a period that is too short for the sampling interval of the
        record, or infinite.
    """
    if isinstance(record, LoadCase):
        return [None] * len(periods)
    if isinstance(record, JoinedRecord):
        values_by_period = zip(
            *(spectral_accelerations(event, periods) for event in record.events), strict=True
        )
        # A period that is too short for an event (None) has no result. `filter` omits values of
        # zero, so that 0.0 is the result (`default`) if all events have the value zero.
        return [
            None if None in values else max(filter(None, values), default=0.0)
            for values in values_by_period
        ]
    # The call fails if one of the periods is too short for the record, or infinite. In this case,
    # compute each period separately, so that only this period has no result.
    if math.inf not in periods:
        with suppress(AnalysisError):
            ends = np.array(periods)
            psa = intensity_of(record, lambda part: spectrum(part, ends, SA_DAMPING).psa)
            return list(psa.tolist())
    if len(periods) == 1:
        return [None]
    return [value for period in periods for value in spectral_accelerations(record, [period])]
