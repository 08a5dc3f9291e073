"""A chunk of runs, what one thread or a worker far away does without asking for anything more: all runs of one building
and one step in one compiled call, and what becomes of each of them.

What comes to its end without a collapse is taken from the arrays as it is. All else is judged by
`tdint.analysis.run.case.Case`, as a single run is; and what fails there is repeated with half of the step.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, zip_longest
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run import run_totals
from tdint.analysis.run.case import Case, doubtful, until_rest, windows
from tdint.analysis.run.error_estimate import attempt, checked_run
from tdint.analysis.run.outcome import Collapse, FailedRun, Response
from tdint.analysis.run.prepared import MarchedRuns, Motions
from tdint.analysis.run.run import Subject
from tdint.analysis.run.step_choice import step_within
from tdint.analysis.run.steps import Steps, finer
from tdint.analysis.sequence import sequence_of, shocks_of
from tdint.analysis.spectra.elastic import SA_DAMPING, spectrum
from tdint.campaign.engine.runs import (
    REPEATS,
    BuildingRuns,
    Rows,
    Run,
    RunRow,
    RunSettings,
    demand_cells,
    demand_errors,
    demand_values,
    shock_rows,
    story_rows,
)
from tdint.errors import AnalysisError
from tdint.ground_motion.joining import JoinedRecord
from tdint.ground_motion.record import Record
from tdint.kernels.march import many as lanes

Item = TypeVar("Item")

_FEWEST, _MOST = 4, 8
"""Runs whose errors are looked at: a quarter of them, within these bounds."""

_TRIED = 24
"""Runs that are tried for that: where the building collapses nothing says how far off a step is."""


def building_step(
    subject: Subject, records: Mapping[int, Record], runs: Sequence[Run], settings: RunSettings, tolerance: float
) -> float | None:
    """The largest step (s) with which the peak drifts of a building are within a tolerance under some of its runs, by
    the estimate of `tdint.analysis.run.step_choice`; None if there is none. It is chosen once for all of its runs.

    What a step errs by hangs on the motion as much as on the building: one motion, be it the strongest, tells little of
    the others. So the runs that are looked at are spread over motions and scales, and the smallest of their steps is
    taken.

    Parameters
    ----------
    runs : sequence of Run
        All runs of the building.
    """
    step, looked_at = math.inf, 0
    enough = min(max(_FEWEST, len(runs) // 4), _MOST)
    for run in islice(_spread_runs(records, runs), _TRIED):
        record = records[run.motion].scaled(run.scale)
        case = subject.case(record)
        if isinstance(record, JoinedRecord):
            case = case.under(sequence_of(case, record.shocks, rest=record.rest, dt=settings.dt).whole)
        first = attempt(case, case.steps(settings.dt, settings.duration))
        if isinstance(first, Response) and first.collapse:
            continue
        try:
            step = step_within(case, tolerance, dt=settings.dt, duration=settings.duration, largest=step)
        except FailedRun:
            continue
        looked_at += 1
        if looked_at == enough:
            break
    return step if looked_at else None


def _spread_runs(records: Mapping[int, Record], runs: Sequence[Run]) -> Iterator[Run]:
    """All runs, of any beginning of them as many as can be under motions of their own, at scales in the middle."""
    of_motion: dict[int, list[Run]] = {}
    for run in sorted(runs, key=lambda run: abs(run.scale)):
        of_motion.setdefault(run.motion, []).append(run)
    ranked = sorted(of_motion, key=lambda motion: abs(of_motion[motion][-1].scale) * records[motion].pga)
    rounds = zip_longest(*(_spread(of_motion[motion]) for motion in _spread(ranked)))
    return (run for run in chain.from_iterable(rounds) if run is not None)


def _spread(items: Sequence[Item]) -> Iterator[Item]:
    """The item in the middle, those in the middle of either half, and so on."""
    parts = deque([items])
    while parts:
        part = parts.popleft()
        if part:
            middle = len(part) // 2
            yield part[middle]
            parts += [part[:middle], part[middle + 1 :]]


_REPEATED = ("not-converged", "diverged")

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
            The step chosen for a tolerance, s: of a record's step, halved or doubled, the largest within it is taken.
            None: no step keeps the tolerance. By default steps are those of the settings.

        Raises
        ------
        UsageError
            A step that does not fit a record.
        AnalysisError
            The method does not integrate this building.
        """
        results = Rows()
        for run in runs:
            if isinstance(self.motions.records[run.motion], JoinedRecord):
                results.extend(self._sequence(run, largest))
        runs = [run for run in runs if not isinstance(self.motions.records[run.motion], JoinedRecord)]
        chosen = math.inf if largest is None else largest
        steps = {motion: self._steps(motion, chosen) for motion in dict.fromkeys(run.motion for run in runs)}
        jobs = [_Job(run, steps[run.motion]) for run in runs]
        if largest is None:
            results.runs += [self._row(job, "not-within-tolerance") for job in jobs]
            return results
        integrate = self._checked if self.settings.check else self._at_step
        while jobs:
            failed: list[_Job] = []
            for h in dict.fromkeys(job.steps.h for job in jobs):
                failed += integrate([job for job in jobs if job.steps.h == h], results)
            jobs = failed
        return results

    def _sequence(self, run: Run, largest: float | None) -> Rows:
        """A run of shocks one after the other: that of the record that they make on this building, and its parts."""
        case, dt = self._case(run), self.settings.dt
        record = case.record
        assert isinstance(record, JoinedRecord)
        sequence = sequence_of(case, record.shocks, rest=record.rest, dt=dt)
        joined = case.under(sequence.whole)
        spectral = self.spectral[run.motion]
        alone = replace(
            self,
            motions=Motions.of({run.motion: sequence.whole}),
            spectral={run.motion: None if spectral is None else spectral * abs(run.scale)},
            settings=replace(self.settings, duration=sequence.whole.duration),
        )
        rows = alone.results([run._replace(scale=1.0)], largest)
        (row,) = rows.runs
        if row.steps is not None:
            steps = replace(joined.steps(row.dt, sequence.whole.duration), count=row.steps)
            shocks = shocks_of(joined, sequence, steps, check=self.settings.check and bool(record.fixed))
            rows.shocks = shock_rows(self.number, run, shocks)
            if record.fixed and len(shocks) > record.fixed:
                last = shocks[-1]
                errors = demand_errors(last.stories, last.errors) if row.errors and last.errors else ()
                row = row._replace(**demand_cells(last.stories)[0], errors=errors, corrected=())
        return Rows(
            [row._replace(scale=run.scale)], [one._replace(scale=run.scale) for one in rows.stories], rows.shocks
        )

    def _steps(self, motion: int, largest: float) -> Steps:
        """Steps on a motion as the settings want them, halved or doubled to the largest within `largest`."""
        case, duration = self._case(Run(motion, 1.0)), self.settings.duration
        steps = case.steps(self.settings.dt, duration)
        if largest == math.inf:
            return steps
        doublings = math.floor(math.log2(largest / steps.h) + _SAME)
        if doublings > 0:
            return case.steps(steps.h * 2.0**doublings, duration)
        for _ in range(-doublings):
            steps = finer(steps)
        return steps

    def _case(self, run: Run) -> Case:
        return self.subject.case(self.motions.records[run.motion], run.scale)

    def _at_step(self, jobs: list[_Job], results: Rows) -> list[_Job]:
        """Integrate runs of one step; the rows of those that are done join the results, the others are returned with a
        finer step."""
        if self.subject.prepared.instability(self.subject.integrator, jobs[0].steps.h):
            results.runs += [self._row(job, "unstable-step") for job in jobs]
            return []
        rest = windows(self.subject.prepared, jobs[0].steps.h) if self.settings.until_rest else None
        runs = [(job.run.motion, job.run.scale, job.steps) for job in jobs]
        marched = self.subject.march_many(self.motions, runs, rest)
        ended, again = ~doubtful(marched), list[_Job]()
        collapses: dict[int, Collapse] = {}
        for i in np.flatnonzero(~ended).tolist():
            try:
                settled = self._case(jobs[i].run).settle(jobs[i].steps, marched, i)
            except FailedRun as failure:
                again += self._again(jobs[i], failure, results)
                continue
            if isinstance(settled, Collapse):
                collapses[i], ended[i] = settled, True
            else:
                self._take_response(jobs[i], settled, results)
        self._take(jobs, marched, np.flatnonzero(ended), collapses, results)
        return again

    def _checked(self, jobs: list[_Job], results: Rows) -> list[_Job]:
        """Integrate runs with their errors, as single ones are; results are those of `_at_step`."""
        again: list[_Job] = []
        for job in jobs:
            case, steps, at_rest = self._case(job.run), job.steps, True
            try:
                if self.settings.until_rest:
                    steps, at_rest = until_rest(case, steps)
                    steps = case.steps(steps.h, steps.count * steps.h)  # all of them are asked for now
                self._take_response(job, checked_run(case, steps), results, at_rest=int(at_rest))
            except FailedRun as failure:
                again += self._again(job, failure, results)
        return again

    def _again(self, job: _Job, failure: FailedRun, results: Rows) -> list[_Job]:
        """The run with half of the step; where that is of no use its row joins the results."""
        if failure.status in _REPEATED and job.repeats < REPEATS:
            return [_Job(job.run, finer(job.steps), job.repeats + 1)]
        results.runs.append(self._row(job, failure.status))
        return []

    def _take(
        self,
        jobs: list[_Job],
        marched: MarchedRuns,
        places: NDArray[np.intp],
        collapses: Mapping[int, Collapse],
        results: Rows,
    ) -> None:
        """Rows of runs that came to their end, by their places, some of them after a collapse."""
        building = self.subject.prepared.building
        demanded = demand_cells(run_totals.peaks_of(building, marched.peaks[places], marched.drifts[places]))
        errors = run_totals.energy_errors(marched.totals[places]).tolist()
        ends = marched.ends[places].astype(int)
        for i, cells, error, end in zip(places.tolist(), demanded, errors, ends, strict=True):
            cells |= {"energy_error": error, "steps": int(end[lanes.STEPS_TAKEN]), "at_rest": int(end[lanes.AT_REST])}
            results.runs.append(self._row(jobs[i], "done", collapses.get(i), **cells))
            if self.settings.keeps_stories:
                peaks = run_totals.peaks_of(building, marched.peaks[i], marched.drifts[i])
                results.stories += story_rows(self.number, jobs[i].run, peaks)

    def _row(self, job: _Job, status: str, collapse: Collapse | None = None, **cells: Any) -> RunRow:
        """The row of a run; without cells of one without a result."""
        if collapse:
            status = collapse.status
            cells |= {"collapse_time": collapse.time, "collapse_story": collapse.story}
        spectral, factor = self.spectral[job.run.motion], abs(job.run.scale)
        cells["pga"] = self.motions.records[job.run.motion].pga * factor
        cells["sa_t1"] = None if spectral is None else spectral * factor
        return RunRow(self.number, *job.run, job.steps.h, status, repeats=job.repeats, **cells)

    def _take_response(self, job: _Job, response: Response, results: Rows, **more: Any) -> None:
        """Rows of a run."""
        (cells,) = demand_cells(response.stories)
        cells |= {"energy_error": response.energy.error, "steps": response.steps, **more}
        check = response.check
        if check:
            cells["errors"] = demand_errors(response.stories, check.errors)
            cells["corrected"] = demand_values(check.corrected) if check.corrected else ()
        results.runs.append(self._row(job, response.status, response.collapse, **cells))
        if self.settings.keeps_stories:
            results.stories += story_rows(self.number, job.run, response.stories, check)


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
    began = time.thread_time()
    motions = Motions.of(chunk.records)
    subjects = [part.source.subject() for part in chunk.buildings]
    spectral = _spectral(chunk.records, [(s, p.runs) for s, p in zip(subjects, chunk.buildings, strict=True)])
    rows = Rows()
    for part, subject, sa in zip(chunk.buildings, subjects, spectral, strict=True):
        batch = Batch(part.number, subject, motions, sa, chunk.settings)
        rows.extend(batch.results(part.runs, part.largest))
    return Done(chunk.number, rows, time.thread_time() - began)


def _spectral(
    records: Mapping[int, Record], wanted: list[tuple[Subject, tuple[Run, ...]]]
) -> list[dict[int, float | None]]:
    """Sa(T1) of each building's motions: of one motion the periods of all buildings at once."""
    found: list[dict[int, float | None]] = [{} for _ in wanted]
    users: dict[int, list[int]] = {}
    for place, (_, runs) in enumerate(wanted):
        for motion in dict.fromkeys(run.motion for run in runs):
            users.setdefault(motion, []).append(place)
    for motion, places in users.items():
        values = spectral_accelerations(records[motion], [wanted[place][0].period for place in places])
        for place, value in zip(places, values, strict=True):
            found[place][motion] = value
    return found


def spectral_accelerations(record: Record, periods: list[float]) -> list[float | None]:
    """Sa of a record at some periods, m/s^2, 5 % damping; None for a period that is too short for it. Of shocks the
    largest."""
    if isinstance(record, JoinedRecord):
        of_all = zip(*(spectral_accelerations(shock, periods) for shock in record.shocks), strict=True)
        return [None if None in values else max(filter(None, values), default=0.0) for values in of_all]
    try:
        return list(spectrum(record, np.array(periods), SA_DAMPING).psa.tolist())
    except AnalysisError:
        if len(periods) == 1:
            return [None]
    return [value for period in periods for value in spectral_accelerations(record, [period])]
