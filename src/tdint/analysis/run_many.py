"""Many runs at once, their peaks and histories as arrays over the runs: the work behind `tdint.run_many`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from itertools import groupby, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.given import number_of, numbers_of, record_of
from tdint.analysis.run import run_totals
from tdint.analysis.run.case import Case, doubtful
from tdint.analysis.run.error_estimate import checked_run
from tdint.analysis.run.outcome import (
    STORY,
    Collapse,
    FailedRun,
    History,
    Response,
    StoryErrors,
    StoryPeaks,
    StoryValues,
)
from tdint.analysis.run.prepared import MarchedRuns, Motions, PreparedBuilding
from tdint.analysis.run.run import Subject
from tdint.analysis.run.steps import Steps
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError, did_you_mean
from tdint.ground_motion.joining import JoinedRecord
from tdint.ground_motion.record import Record
from tdint.kernels.march import many as lanes
from tdint.methods.catalogue import DEFAULT_METHOD
from tdint.model.config.model_file import model_of
from tdint.model.definition import Model
from tdint.quantity import quantities
from tdint.system import available_memory, on_threads, processors
from tdint.tabular import Tabular
from tdint.written_numbers import how_many

KEPT = {one.called or one.name: one.name for one in quantities(History) if one.name in run_totals.HISTORIES}
"""What may be kept of a history: its fields by the names of their columns, without the unit."""

_AT_ONCE = 64
"""Runs that a thread takes at a time."""


@dataclass(frozen=True, repr=False)
class Runs(Tabular):
    """Many runs; arrays have the runs first. Where a building has fewer stories than another one, what lies above it is
    nan.

    Attributes
    ----------
    models, records : tuple
        The buildings and ground motions, each once.
    methods : tuple of str
        The method of each building, with all its parameters.
    model, record : ndarray of int, shape (runs,)
        Which of them each run has.
    scale, dt : ndarray, shape (runs,)
        Factor on the ground motion; time step, s.
    steps : ndarray of int, shape (runs,)
        Steps that were taken.
    status : ndarray of str, shape (runs,)
        As of `Response`, or of `FailedRun` where there is no result; the run's numbers are nan then.
    energy_error : ndarray, shape (runs,)
        Imbalance of the energies over the largest input energy.
    stories : StoryPeaks
        Peaks of shape (runs, stories), SI units.
    history : mapping of str to ndarray, shape (runs, rows, stories)
        What was kept of the histories, SI units; nan after the end of a run.
    every : int
        Steps from one row to the next.
    failures : mapping of int to str
        What there is to say of the runs without a result, by their numbers.
    errors, corrected : StoryErrors and StoryPeaks, or None
        Estimated errors of the peaks, and the peaks by the error that the run carried along, if they were asked for:
        those of `ErrorEstimate`, of shape (runs, stories), nan where there is none.
    """

    models: tuple[Model, ...]
    records: tuple[Record, ...]
    methods: tuple[str, ...]
    model: NDArray[np.int64]
    record: NDArray[np.int64]
    scale: Array
    dt: Array
    steps: NDArray[np.int64]
    status: NDArray[np.str_]
    energy_error: Array
    stories: StoryPeaks
    history: dict[str, NDArray[np.floating[Any]]]
    every: int
    failures: dict[int, str]
    errors: StoryErrors | None = None
    corrected: StoryPeaks | None = None

    @property
    def time(self) -> Array:
        """Times of the rows, s, shape (1, rows) where all runs have one step, else (runs, rows)."""
        rows = max((kept.shape[1] for kept in self.history.values()), default=0)
        steps = self.dt[:1] if np.all(self.dt == self.dt[0]) else self.dt
        return np.asarray(np.multiply.outer(self.every * steps, np.arange(rows)))

    def of_building(self, number: int) -> tuple[NDArray[np.int64], StoryPeaks]:
        """The runs of a building by its number, and their peaks, shape (runs of it, its stories)."""
        runs = np.flatnonzero(self.model == number)
        n = len(self.models[number].stories)
        values = {one.name: getattr(self.stories, one.name)[runs, :n] for one in STORY}
        return runs, StoryPeaks(height=self.stories.height[runs, :n], **values)

    def _headline(self) -> str:
        buildings, records = how_many(len(self.models), "building"), how_many(len(self.records), "record")
        kept = f", histories of {', '.join(self.history)}" if self.history else ""
        lost = f", {len(self.failures)} without a result" if self.failures else ""
        return f"{len(self.model)} of {buildings} under {records}{kept}{lost}"


def run_many(
    models: Any,
    records: Any,
    *,
    scales: float | Iterable[float] = 1.0,
    paired: bool = False,
    method: str | None = None,
    dt: float | None = None,
    duration: float | None = None,
    history: str | Sequence[str] = (),
    every: int = 1,
    out: NDArray[Any] | Mapping[str, NDArray[Any]] | None = None,
    jobs: int | None = None,
    check: bool = False,
) -> Runs:
    """Integrate every building under every ground motion at every scale; in that order, the scales fastest.

    Each run is the one that `run` makes, to the last bit. The time loops run on threads without Python's lock; runs
    without a history go some dozens to a compiled call. A run that fails keeps no other from being done and is not
    repeated with a smaller step.

    Parameters
    ----------
    models, records : one or a sequence
        What `run` takes.
    scales : float or sequence of float
        Factors on the ground accelerations, not zero.
    paired : bool
        The first building under the first record at the first scale, the second under the second, ...: sequences of one
        length, or of one member that stands for all.
    method, dt, duration : optional
        In place of what each model says, as of `run`; dt and duration in s.
    history : str or sequence of str
        What to keep of each step: of `displacement`, `velocity` (relative to the ground), `absolute_acceleration` of
        the floors, `drift`, `shear`, `damper_force`, `total_shear` of the stories.
    every : int
        Keep every so many steps, from the start on.
    out : ndarray or mapping of str to ndarray, optional
        Where to put the histories, shape (runs, rows, stories) each: arrays of any floating-point type, or maps of
        files (`numpy.lib.format.open_memmap`); the rows are those of the longest run, the stories those of the tallest
        building. An array alone is for a single quantity. Without, arrays of float64 are made.
    jobs : int, optional
        Threads; one for each processor by default. The result does not depend on it.
    check : bool
        Estimate the errors of the peaks, as by `run`: moment4 carries them along, other methods run again twice.

    Returns
    -------
    Runs

    Raises
    ------
    UsageError
        An unknown method or quantity, a step that does not fit a record, an array of another shape.
    ModelError, RecordError
        A model or a record is none.
    AnalysisError
        A method does not integrate a building; the memory does not hold the histories.
    """
    work = _Wanted.of(models, records, method=method, dt=dt, duration=duration, check=check)
    plan = _planned(work, scales, paired)
    kept = _kept(history)
    if isinstance(every, bool) or not isinstance(every, int) or every < 1:
        raise UsageError(f"every must be a whole number of steps, 1 at least, got {every!r:.60}")
    threads = processors() if jobs is None else jobs
    if threads < 1:
        raise UsageError(f"the number of jobs must be at least 1, got {jobs}")
    found = _unfilled(work, plan, every, _room(work, plan, kept, every, out))
    parts = [plan[first : first + _AT_ONCE] for first in range(0, len(plan), _AT_ONCE)]
    for _ in on_threads(lambda part: _march(work, found, part), parts, threads):
        pass
    return replace(found, failures=dict(sorted(found.failures.items())))


class _Run(NamedTuple):
    """A run by its number: its building and record by theirs, the factor, the steps."""

    number: int
    model: int
    record: int
    scale: float
    steps: Steps


@dataclass(frozen=True)
class _Wanted:
    """Buildings with their methods, ground motions, and what is asked of the steps."""

    subjects: tuple[Subject, ...]
    methods: tuple[str, ...]
    records: tuple[Record, ...]
    dt: float | None
    duration: float | None
    check: bool

    @classmethod
    def of(
        cls, models: Any, records: Any, *, method: str | None, dt: float | None, duration: float | None, check: bool
    ) -> _Wanted:
        buildings = tuple(map(model_of, _several(models, "models")))
        motions = tuple(map(record_of, _several(records, "records")))
        if any(isinstance(one, JoinedRecord) for one in motions):
            raise UsageError("a sequence of shocks is run by run_sequence, one at a time")
        subjects = tuple(Subject(one, method or one.analysis.method or DEFAULT_METHOD) for one in buildings)
        methods = tuple(one.integrator.label for one in subjects)
        return cls(subjects, methods, motions, number_of(dt, "dt"), number_of(duration, "duration"), check)

    def case(self, run: _Run) -> Case:
        """A run as a single one."""
        return self.subjects[run.model].case(self.records[run.record], run.scale)

    @cached_property
    def stories(self) -> int:
        """Of the tallest building."""
        return max(len(one.model.stories) for one in self.subjects)


def _several(given: Any, name: str) -> Sequence[Any]:
    found = list(given) if isinstance(given, list | tuple) else [given]
    if not found:
        raise UsageError(f"no {name} are given")
    return found


def _planned(work: _Wanted, scales: float | Iterable[float], paired: bool) -> list[_Run]:
    factors = numbers_of(scales, "scales").tolist()
    if not factors or not all(math.isfinite(factor) and factor for factor in factors):
        raise UsageError(f"scales must be numbers other than zero, got {scales!r:.60}")
    if paired:
        sizes = {"models": len(work.subjects), "records": len(work.records), "scales": len(factors)}
        count = max(sizes.values())
        for name, size in sizes.items():
            if size not in (1, count):
                raise UsageError(f"paired: {size} {name} beside {count} of the others; give one, or as many")
        models, motions, which = (np.arange(count) % size for size in sizes.values())
        places = tuple(zip(models.tolist(), motions.tolist(), which.tolist(), strict=True))
    else:
        places = tuple(product(range(len(work.subjects)), range(len(work.records)), range(len(factors))))
    steps: dict[tuple[Any, ...], Steps] = {}
    plan = []
    for number, (model, record, scale) in enumerate(places):
        analysis, motion = work.subjects[model].model.analysis, work.records[record]
        key = (analysis.dt, analysis.duration, motion.dt, motion.duration)
        run = _Run(number, model, record, factors[scale], steps.get(key, _UNKNOWN))
        if run.steps is _UNKNOWN:
            steps[key] = work.case(run._replace(scale=1.0)).steps(work.dt, work.duration)
        plan.append(run._replace(steps=steps[key]))
    return plan


_UNKNOWN = Steps(0.0, 0)


def _kept(history: str | Sequence[str]) -> tuple[str, ...]:
    names = (history,) if isinstance(history, str) else tuple(history)
    for name in names:
        if name not in KEPT:
            raise UsageError(f"unknown quantity {name!r}{did_you_mean(str(name), KEPT)} (known: {', '.join(KEPT)})")
    return tuple(dict.fromkeys(names))


def _room(
    work: _Wanted, plan: Sequence[_Run], kept: tuple[str, ...], every: int, out: Any
) -> dict[str, NDArray[np.floating[Any]]]:
    """Where the histories go: arrays of the caller, or new ones."""
    rows = max(run.steps.count for run in plan) // every + 1
    shape = (len(plan), rows, work.stories)
    if out is None:
        wanted, free = 8.0 * len(kept) * math.prod(shape), available_memory()
        if wanted > free:
            raise AnalysisError(
                f"the histories of {len(plan)} runs take {wanted / 1e9:.3g} GB of memory, {free / 1e9:.3g} GB "
                "are free; keep fewer steps by every=, or give arrays by out= (float32, or maps of files)"
            )
        return {name: np.full(shape, math.nan) for name in kept}
    given = dict(out) if isinstance(out, Mapping) else dict.fromkeys(kept[:1], out)
    if tuple(sorted(given)) != tuple(sorted(kept)) or not kept:
        raise UsageError(f"out must have an array for each quantity of the history: {', '.join(kept) or 'none'}")
    for name, array in given.items():
        if not isinstance(array, np.ndarray) or array.shape != shape or array.dtype.kind != "f":
            found = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
            raise UsageError(f"out of {name} must be an array of floating-point numbers, shape {shape}, got {found}")
    return given


def _unfilled(work: _Wanted, plan: Sequence[_Run], every: int, history: dict[str, NDArray[np.floating[Any]]]) -> Runs:
    """The result, whose arrays each thread fills for the runs that it has."""
    peaks, errors, corrected = (
        {one.name: np.full((len(plan), work.stories), math.nan) for one in fields(kind)}
        for kind in (StoryPeaks, StoryErrors, StoryErrors)
    )
    return Runs(
        models=tuple(one.model for one in work.subjects),
        records=work.records,
        methods=work.methods,
        model=np.array([run.model for run in plan]),
        record=np.array([run.record for run in plan]),
        scale=np.array([run.scale for run in plan]),
        dt=np.array([run.steps.h for run in plan]),
        steps=np.zeros(len(plan), np.int64),
        status=np.full(len(plan), "done", "<U24"),
        energy_error=np.full(len(plan), math.nan),
        stories=StoryPeaks(**peaks),
        history=history,
        every=every,
        failures={},
        errors=StoryErrors(**errors) if work.check else None,
        corrected=StoryPeaks(height=peaks["height"], **corrected) if work.check else None,
    )


def _put(arrays: StoryValues | None, places: int | Sequence[int], found: StoryValues | None) -> None:
    """Write the values of runs where theirs are."""
    if arrays and found:
        for one in fields(arrays):
            values = getattr(found, one.name)
            getattr(arrays, one.name)[places, : values.shape[-1]] = values


def _take(found: Runs, runs: Sequence[_Run], prepared: PreparedBuilding, marched: MarchedRuns) -> None:
    """What was marched, but for the histories."""
    places = [run.number for run in runs]
    _put(found.stories, places, run_totals.peaks_of(prepared.building, marched.peaks, marched.drifts))
    found.energy_error[places] = run_totals.energy_errors(marched.totals)
    found.steps[places] = marched.ends[:, lanes.STEPS_TAKEN]


def _take_response(found: Runs, run: _Run, response: Response) -> None:
    """What came of a run by itself."""
    _put(found.stories, run.number, response.stories)
    if response.check:
        _put(found.errors, run.number, response.check.errors)
        _put(found.corrected, run.number, response.check.corrected)
    found.energy_error[run.number] = response.energy.error
    found.steps[run.number] = response.steps
    found.status[run.number] = response.status
    for name, kept in found.history.items():
        assert response.history is not None
        rows = getattr(response.history, KEPT[name])[:: found.every]
        kept[run.number] = math.nan
        kept[run.number, : len(rows), : rows.shape[1]] = rows


def _take_failure(found: Runs, run: _Run, failure: FailedRun) -> None:
    """That a run has no result."""
    peaks = (getattr(found.stories, one.name) for one in STORY)
    for values in (*peaks, found.energy_error, *found.history.values()):
        values[run.number] = math.nan
    found.steps[run.number] = 0
    found.status[run.number] = failure.status
    found.failures[run.number] = str(failure)


def _march(work: _Wanted, found: Runs, part: Sequence[_Run]) -> None:
    """Some runs, those of one building and one step together."""
    for (model, h), group in groupby(part, key=lambda run: (run.model, run.steps.h)):
        runs, subject = list(group), work.subjects[model]
        if work.check or subject.prepared.instability(subject.integrator, h):
            for run in runs:
                case, history = work.case(run), bool(found.history)
                _take_settled(found, run, partial(checked_run if work.check else Case.march, case, run.steps, history))
            continue
        marched = _kept_runs(work, found, runs) if found.history else _bare_runs(work, runs)
        _take(found, runs, subject.prepared, marched)
        for place in np.flatnonzero(doubtful(marched)).tolist():
            run = runs[place]
            settle = partial(work.case(run).settle, run.steps, marched, place, bool(found.history))
            _take_settled(found, run, settle)


def _bare_runs(work: _Wanted, runs: Sequence[_Run]) -> MarchedRuns:
    """Runs of one building and one step in one compiled call."""
    motions = Motions.of({run.record: work.records[run.record] for run in runs})
    return work.subjects[runs[0].model].march_many(motions, [(run.record, run.scale, run.steps) for run in runs])


def _kept_runs(work: _Wanted, found: Runs, runs: Sequence[_Run]) -> MarchedRuns:
    """The same with what is kept of the histories."""
    subject, h = work.subjects[runs[0].model], runs[0].steps.h
    prepared = subject.prepared
    time = found.every * h * np.arange(next(iter(found.history.values())).shape[1], dtype=np.float64)
    telling = [(kept, run_totals.HISTORIES[KEPT[name]]) for name, kept in found.history.items()]
    building, forces, n = prepared.building, prepared.forces, prepared.building.stories

    def see(r: int, rows: Array) -> None:
        for kept, told in telling:
            kept[runs[r].number, : len(rows), :n] = told(building, forces, time[: len(rows)], rows)
            if len(rows) < kept.shape[1] or n < kept.shape[2]:
                kept[runs[r].number, len(rows) :] = kept[runs[r].number, :, n:] = math.nan

    return prepared.march_each(
        subject.integrator,
        h,
        [(work.records[run.record].acceleration, run.scale, run.steps) for run in runs],
        every=found.every,
        see=see,
        collapse_drift=subject.model.collapse_drift,
    )


def _take_settled(found: Runs, run: _Run, settle: Callable[[], Response | Collapse]) -> None:
    """What came of a run that is settled by itself, or that it has no result."""
    try:
        settled = settle()
    except FailedRun as failure:
        _take_failure(found, run, failure)
        return
    if isinstance(settled, Collapse):
        found.status[run.number] = settled.status
    else:
        _take_response(found, run, settled)
