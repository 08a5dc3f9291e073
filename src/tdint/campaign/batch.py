"""A chunk of runs, what one thread or a worker far away does without asking for anything more: all
runs of one building and one step together (`tdint.analysis.run.together`), and what failed again
with half of the step."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice, repeat, zip_longest
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

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
from tdint.analysis.run.sequence import sequence_of, shocks_of
from tdint.analysis.run.step_choice import step_within
from tdint.analysis.run.together import Subject, run_together
from tdint.analysis.run.workspace import Steps, finer
from tdint.analysis.spectra.elastic import SA_DAMPING, spectrum
from tdint.errors import AnalysisError
from tdint.ground_motion.record import JoinedRecord, Record

# ---- What is run, a building with its method under ground motions, and what is kept of it: a row
# of numbers for each run, and one for each story if that is asked for

REPEATS = 3
"""How often a run that diverged or did not converge is repeated, each time with half of the step
before; in each of them single steps are halved, too (`tdint.analysis.run.workspace.HALVINGS`)."""


@dataclass(frozen=True)
class RunSettings:
    """What is the same for all runs of a campaign.

    Attributes
    ----------
    dt, duration : float or None
        Time step and duration, s; None: those of the building's model, else those of the record.
    until_rest : bool
        Go on after that with the ground at rest until the building is (`tdint.analysis.run.case`).
    stories, profiles : bool
        Keep the peaks of every story, too: to write them, or what they are over the motions.
    check : bool
        Estimate the errors of the demands of each run, as `tdint.run` does.
    tolerance : float or None
        The step of a building is such that the estimated errors of its peak drifts are within this
        part of them.
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
        """Whether the peaks of stories are kept."""
        return self.stories or self.profiles


class Source(Protocol):
    """What makes a building: the building itself, or a row of an inventory with its rules."""

    def subject(self) -> Subject:
        """The building."""


class Run(NamedTuple):
    """A ground motion by its number, the factor on it, and which of a building's draws it is (0:
    none was drawn)."""

    motion: int
    scale: float
    sample: int = 0


class BuildingRuns(NamedTuple):
    """Runs of one building.

    Attributes
    ----------
    number : int
        Of the building in its campaign.
    source : Source
        What makes it.
    runs : tuple of Run
        The runs.
    largest : float or None
        Their largest step for a tolerance, s; None if no step is within it.
    """

    number: int
    source: Source
    runs: tuple[Run, ...]
    largest: float | None = math.inf


class RunRow(NamedTuple):
    """The values of a run, those of `RUN` in their order, None or nan where there is none; the
    errors of the demands in `RUN_WITH_ERROR`, where these were estimated. A value is found by its
    name, too: `row.status`."""

    building: int
    motion: int
    scale: float
    sample: int
    values: tuple[Any, ...]
    errors: tuple[float | None, ...] = ()

    def __getattr__(self, name: str) -> Any:
        if name not in _PLACES:
            raise AttributeError(name)
        return self.values[_PLACES[name]]

    def but(self, **values: Any) -> RunRow:
        """The same with other values."""
        return self._replace(
            values=tuple(values.get(name, self.values[place]) for name, place in _PLACES.items())
        )


_PLACES = {quantity.name: place for place, quantity in enumerate(RUN)}


class ShockRow(NamedTuple):
    """The values of a shock in a run of several, those of `DEMANDED` in their order; from 1, with
    the time (s) of its first sample and its peak ground acceleration (m/s^2)."""

    building: int
    motion: int
    scale: float
    sample: int
    shock: int
    start: float
    pga: float
    values: tuple[Any, ...]


class StoryRow(NamedTuple):
    """The values of a story in a run, those of `STORY` in their order, and their errors where these
    were estimated."""

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
    """The rows of some runs; those of stories only if they are asked for."""

    runs: list[RunRow] = field(default_factory=list)
    stories: list[StoryRow] = field(default_factory=list)
    shocks: list[ShockRow] = field(default_factory=list)

    def extend(self, others: Rows) -> None:
        """Take in other rows."""
        self.runs += others.runs
        self.stories += others.stories
        self.shocks += others.shocks


def demand_cells(stories: StoryPeaks) -> list[dict[str, Any]]:
    """Of each run, whose peaks have the shape (runs, n), the values that follow from its
    demands."""
    columns = {name: column.tolist() for name, column in demand_columns(stories).items()}
    return [dict(zip(columns, cells, strict=True)) for cells in zip(*columns.values(), strict=True)]


def story_rows(
    building: int, run: Run, stories: StoryPeaks, check: ErrorEstimate | None = None
) -> list[StoryRow]:
    """The rows of the stories of a run, from the ground up."""
    by_story: list[Iterable[tuple[float, ...]]] = [
        zip(*(getattr(values, quantity.name).tolist() for quantity in STORY), strict=True)
        if values
        else repeat(())
        for values in (stories, check and check.errors)
    ]
    cells = zip(stories.height.tolist(), *by_story, strict=False)
    return [StoryRow(building, *run, story, *row) for story, row in enumerate(cells, start=1)]


def shock_rows(building: int, run: Run, shocks: Sequence[Shock]) -> list[ShockRow]:
    """The rows of the shocks of a run, in their order."""
    return [
        ShockRow(building, *run, number, shock.start, shock.record.pga, tuple(cells.values()))
        for number, shock in enumerate(shocks, start=1)
        for cells in demand_cells(shock.stories)
    ]


# ---- Batch

Item = TypeVar("Item")

_FEWEST, _MOST = 4, 8
"""Runs whose errors are looked at: a quarter of them, within these bounds."""

_TRIED = 24
"""Runs that are tried for that: where the building collapses nothing says how far off a step is."""


def building_step(
    subject: Subject,
    records: Mapping[int, Record],
    runs: Sequence[Run],
    settings: RunSettings,
    tolerance: float,
) -> float | None:
    """The largest step (s) with which the peak drifts of a building are within a tolerance under
    some of its runs, by the estimate of `tdint.analysis.run.step_choice`; None if there is none. It
    is chosen once for all of its runs.

    What a step errs by hangs on the motion as much as on the building: one motion, be it the
    strongest, tells little of the others. So the runs that are looked at are spread over motions
    and scales, and the smallest of their steps is taken.

    Parameters
    ----------
    runs : sequence of Run
        All runs of the building.
    """
    # All runs, of any beginning of them as many as can be under motions of their own, at scales in
    # the middle.
    of_motion: dict[int, list[Run]] = {}
    for run in sorted(runs, key=lambda run: abs(run.scale)):
        of_motion.setdefault(run.motion, []).append(run)
    ranked = sorted(
        of_motion, key=lambda motion: abs(of_motion[motion][-1].scale) * records[motion].pga
    )
    rounds = zip_longest(*(_spread(of_motion[motion]) for motion in _spread(ranked)))
    spread = (run for run in chain.from_iterable(rounds) if run is not None)

    # What collapses or fails tells no step: others are tried in its place.
    step, looked_at = math.inf, 0
    enough = min(max(_FEWEST, len(runs) // 4), _MOST)
    for run in islice(spread, _TRIED):
        record = records[run.motion].scaled(run.scale)
        case = subject.case(record)
        if isinstance(record, JoinedRecord):
            case = case.under(
                sequence_of(case, record.shocks, rest=record.rest, dt=settings.dt).whole
            )
        first = attempt(case, case.steps(settings.dt, settings.duration))
        if isinstance(first, Response) and first.collapse:
            continue
        try:
            step = step_within(
                case, tolerance, dt=settings.dt, duration=settings.duration, largest=step
            )
        except FailedRun:
            continue
        looked_at += 1
        if looked_at == enough:
            break
    return step if looked_at else None


def _spread(items: Sequence[Item]) -> Iterator[Item]:
    """The item in the middle, those in the middle of either half, and so on."""
    parts = deque([items])
    while parts:
        part = parts.popleft()
        if part:
            middle = len(part) // 2
            yield part[middle]
            parts += [part[:middle], part[middle + 1 :]]


_SAME = 1e-9  # steps that differ by less than about this part are the same


@dataclass(frozen=True)
class _Job:
    """A run with its steps and how often it was repeated."""

    run: Run
    steps: Steps
    repeats: int = 0


@dataclass(frozen=True)
class Batch:
    """Runs of one building.

    Attributes
    ----------
    number : int
        The building's number in the campaign.
    subject : Subject
        The building and its method.
    motions : Motions
        The ground motions, those of `spectral` among them.
    spectral : mapping of int to float or None
        Sa(T1) of each motion at the scale 1, m/s^2.
    """

    number: int
    subject: Subject
    motions: Motions
    spectral: dict[int, float | None]
    settings: RunSettings

    def results(self, runs: Sequence[Run], largest: float | None = math.inf) -> Rows:
        """Integrate the runs.

        Parameters
        ----------
        runs : sequence of Run
            The runs.
        largest : float or None
            The step chosen for a tolerance, s: of a record's step, halved or doubled, the largest
            within it is taken. None: no step keeps the tolerance. By default steps are those of the
            settings.

        Raises
        ------
        UsageError
            A step that does not fit a record.
        AnalysisError
            The method does not integrate this building.
        """
        # A sequence depends on when the building has come to rest: each is made by itself.
        results = Rows()
        for run in runs:
            if isinstance(self.motions.records[run.motion], JoinedRecord):
                results.extend(self._sequence(run, largest))
        runs = [
            run for run in runs if not isinstance(self.motions.records[run.motion], JoinedRecord)
        ]
        # Steps are those of a motion: all of its runs share them, whatever their factors.
        chosen = math.inf if largest is None else largest
        steps = {
            motion: self._steps(motion, chosen)
            for motion in dict.fromkeys(run.motion for run in runs)
        }
        jobs = [_Job(run, steps[run.motion]) for run in runs]
        # Without a step within the tolerance no run is worth its time; the rows tell why.
        if largest is None:
            results.runs += [self._row(job, NO_STEP) for job in jobs]
            return results
        # What failed comes back with a finer step, until nothing is left to be repeated.
        while jobs:
            failed: list[_Job] = []
            for h in dict.fromkeys(job.steps.h for job in jobs):
                failed += self._at_step([job for job in jobs if job.steps.h == h], results)
            jobs = failed
        return results

    def _sequence(self, run: Run, largest: float | None) -> Rows:
        """A run of shocks one after the other: that of the record that they make on this building,
        and its parts."""
        case, dt = self._case(run), self.settings.dt
        record = case.record
        assert isinstance(record, JoinedRecord)
        # Where the shocks stand may hang on how long the building swings after each, at this scale.
        sequence = sequence_of(case, record.shocks, rest=record.rest, dt=dt)
        joined = case.under(sequence.whole)
        # The joined record has the factor in it: it is one run at the scale 1, with intensities
        # that are scaled before.
        spectral = self.spectral[run.motion]
        alone = replace(
            self,
            motions=Motions({run.motion: sequence.whole}),
            spectral={run.motion: None if spectral is None else spectral * abs(run.scale)},
            settings=replace(self.settings, duration=sequence.whole.duration),
        )
        rows = alone.results([run._replace(scale=1.0)], largest)
        (row,) = rows.runs
        # Demands of each shock by itself; a run without a result has none to be divided.
        if row.steps is not None:
            steps = replace(joined.steps(row.dt, sequence.whole.duration), count=row.steps)
            shocks = shocks_of(
                joined, sequence, steps, check=self.settings.check and bool(record.fixed)
            )
            rows.shocks = shock_rows(self.number, run, shocks)
            # Behind shocks that only damage the building the demands of the last one alone are
            # those of the run.
            if record.fixed and len(shocks) > record.fixed:
                last = shocks[-1]
                errors = (
                    demand_errors(last.stories, last.errors) if row.errors and last.errors else ()
                )
                row = row.but(**demand_cells(last.stories)[0])._replace(errors=errors)
        stories = [of_story._replace(scale=run.scale) for of_story in rows.stories]
        return Rows([row._replace(scale=run.scale)], stories, rows.shocks)

    def _steps(self, motion: int, largest: float) -> Steps:
        """Steps on a motion as the settings want them, halved or doubled to the largest within
        `largest`."""
        case, duration = self._case(Run(motion, 1.0)), self.settings.duration
        steps = case.steps(self.settings.dt, duration)
        if largest == math.inf:
            return steps
        # Halved and doubled steps keep times in common with the samples.
        doublings = math.floor(math.log2(largest / steps.h) + _SAME)
        if doublings > 0:
            return case.steps(steps.h * 2.0**doublings, duration)
        for _ in range(-doublings):
            steps = finer(steps)
        return steps

    def _case(self, run: Run) -> Case:
        return self.subject.case(self.motions.records[run.motion], run.scale)

    def _at_step(self, jobs: list[_Job], results: Rows) -> list[_Job]:
        """Integrate runs of one step; the rows of those that are done join the results, the others
        are returned with a finer step."""
        runs, settings = [(job.run.motion, job.run.scale, job.steps) for job in jobs], self.settings
        outcomes = run_together(
            self.subject, self.motions, runs, check=settings.check, to_rest=settings.until_rest
        )
        again = []
        for i, failure in outcomes.failures.items():
            job = jobs[i]
            # A refused step, beyond the method's limit, is told and not repeated.
            if failure.finer_may_help and job.repeats < REPEATS:
                again.append(_Job(job.run, finer(job.steps), job.repeats + 1))
            else:
                results.runs.append(self._row(job, failure.status))
        # Demands of all runs at once, as arrays; rows then one by one.
        demanded, statuses = demand_cells(outcomes.stories), outcomes.status
        for i, job in enumerate(jobs):
            if i in outcomes.failures:
                continue
            peaks = outcomes.stories_of(i)
            # A run that was made by itself brings the estimate of its errors.
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
        return again

    def _row(
        self, job: _Job, status: str, collapse: Collapse | None = None, **values: Any
    ) -> RunRow:
        """The row of a run; of one without a result its step, status, PGA, Sa(T1) and repeats
        alone."""
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
    """Some runs, with all that they need.

    Attributes
    ----------
    number : int
        Of the chunk in its campaign.
    buildings : tuple of BuildingRuns
        The buildings with their runs.
    records : mapping of int to Record
        The ground motions by their numbers.
    """

    number: int
    buildings: tuple[BuildingRuns, ...]
    records: Mapping[int, Record]
    settings: RunSettings


@dataclass(frozen=True)
class Done:
    """A chunk that is done: its rows, and the processor time that it took, s."""

    number: int
    rows: Rows
    seconds: float


def do(chunk: Chunk) -> Done:
    """Integrate the runs of a chunk. Errors are those of `Batch.results`."""
    # Time of this thread alone: chunks are done side by side.
    began = time.thread_time()
    motions = Motions(chunk.records)
    subjects = [part.source.subject() for part in chunk.buildings]

    # Sa(T1) of each building's motions: of one motion the periods of all buildings at once.
    spectral: list[dict[int, float | None]] = [{} for _ in subjects]
    users: dict[int, list[int]] = {}
    for place, part in enumerate(chunk.buildings):
        for motion in dict.fromkeys(run.motion for run in part.runs):
            users.setdefault(motion, []).append(place)
    for motion, places in users.items():
        values = spectral_accelerations(
            chunk.records[motion], [subjects[place].period for place in places]
        )
        for place, value in zip(places, values, strict=True):
            spectral[place][motion] = value
    rows = Rows()
    # All runs of a building go through one compiled call, where its steps are the same.
    for part, subject, sa in zip(chunk.buildings, subjects, spectral, strict=True):
        batch = Batch(part.number, subject, motions, sa, chunk.settings)
        rows.extend(batch.results(part.runs, part.largest))
    return Done(chunk.number, rows, time.thread_time() - began)


def spectral_accelerations(record: Record, periods: list[float]) -> list[float | None]:
    """Sa of a record at some periods, m/s^2, 5 % damping; None for a period that is too short for
    it. Of shocks the largest."""
    if isinstance(record, JoinedRecord):
        of_all = zip(
            *(spectral_accelerations(shock, periods) for shock in record.shocks), strict=True
        )
        return [
            None if None in values else max(filter(None, values), default=0.0) for values in of_all
        ]
    try:
        return list(spectrum(record, np.array(periods), SA_DAMPING).psa.tolist())
    except AnalysisError:
        if len(periods) == 1:
            return [None]
    # One period too short spoils the call for all: then each is asked for alone.
    return [value for period in periods for value in spectral_accelerations(record, [period])]
