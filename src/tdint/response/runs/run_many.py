"""Many runs with peaks and histories as arrays over the runs: `tdint.run_many`."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from itertools import groupby
from pathlib import Path
from threading import Event, Semaphore
from typing import Any, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, Numbers
from tdint.errors import UsageError
from tdint.ground_motion.joined import JoinedRecord
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import method_of
from tdint.model.definition import Model
from tdint.model.plausibility import study_plausibility_warnings
from tdint.response.arguments import (
    AnyModel,
    AnyRecord,
    as_sequence,
    for_each_method,
    is_list,
    model_of,
    model_record,
    number_of,
    pair_of,
    record_of,
)
from tdint.response.run_plan import RunsRequest, plan_runs
from tdint.response.runs.batch import NO_MOTION, Subject, run_batch, samples_of
from tdint.response.runs.gradient import differentiate
from tdint.response.runs.history import DEVICE, HISTORIES, HISTORIES_OF_MANY
from tdint.response.runs.many_results import (
    HistoryArrays,
    Runs,
    RunSpec,
    history_arrays,
    kept_quantities,
    store_values,
)
from tdint.response.runs.outcome import StoryErrors, StoryPeaks
from tdint.response.runs.prepared import SampleTables
from tdint.system import on_threads, processors
from tdint.tabular import Progress, ResultList, import_optional, progress_reporter

_RUNS_PER_BATCH, _STEPS_PER_BATCH = 256, 200_000
"""Largest number of runs, and of time steps of the longest run times runs, of a batch of a thread.
An interrupt waits for the end of a batch."""


class _Options(TypedDict, total=False):
    """Arguments of `run_many` with the same types in all overloads."""

    scales: float | Numbers | Iterable[float]
    zip_records: bool
    duration: float | None
    history: bool | str | Sequence[str]
    every: int
    out: NDArray[Any] | Mapping[str, NDArray[Any]] | str | Path | None
    jobs: int | None
    check: bool
    vary: Mapping[str, Numbers | float | str | Sequence[str]] | None
    product: bool
    progress: bool | Progress
    partial: bool
    gradient: str | Sequence[str]
    errors: str


@overload
def run_many(
    models: AnyModel | Sequence[AnyModel],
    records: AnyRecord | Sequence[AnyRecord] | None = None,
    *,
    method: str | None = None,
    dt: float | None = None,
    **options: Unpack[_Options],
) -> Runs: ...


@overload
def run_many(
    models: AnyModel | Sequence[AnyModel],
    records: AnyRecord | Sequence[AnyRecord] | None = None,
    *,
    method: list[str] | tuple[str, ...],
    dt: float | Numbers | None = None,
    **options: Unpack[_Options],
) -> ResultList[Runs]: ...


@overload
def run_many(
    models: AnyModel | Sequence[AnyModel],
    records: AnyRecord | Sequence[AnyRecord] | None = None,
    *,
    method: str | None = None,
    dt: Numbers,
    **options: Unpack[_Options],
) -> ResultList[Runs]: ...


def run_many(
    models: AnyModel | Sequence[AnyModel],
    records: AnyRecord | Sequence[AnyRecord] | None = None,
    *,
    scales: float | Numbers | Iterable[float] = 1.0,
    zip_records: bool = False,
    method: str | Sequence[str] | None = None,
    dt: float | Numbers | None = None,
    duration: float | None = None,
    history: bool | str | Sequence[str] = (),
    every: int = 1,
    out: NDArray[Any] | Mapping[str, NDArray[Any]] | str | Path | None = None,
    jobs: int | None = None,
    check: bool = False,
    vary: Mapping[str, Numbers | float | str | Sequence[str]] | None = None,
    product: bool = False,
    progress: bool | Progress = False,
    partial: bool = False,
    gradient: str | Sequence[str] = (),
    errors: str = "raise",
) -> Runs | ResultList[Runs]:
    """Integrate every building, in every sample of its parameters, under every ground motion at
    every scale.

    The runs are in this order, and the scale varies fastest. Each run equals that of `run`, bit for
    bit. The time loops run on threads without the Python lock, in batches of runs that share their
    arrays. Samples of one building are prepared together, unless it has attachments, links,
    isolators, elements, fractures, tangent damping or matrices. A failed run does not stop the
    other runs and is not repeated with a smaller time step.

    Parameters
    ----------
    models, records : one or a sequence
        Arguments that `run` accepts; the item for a building in two directions is a pair of
        components. Without records, the model's record is used; a model without a record runs under
        its forces or from its initial motion.
    scales : float or sequence of float, default 1
        Factors on the ground accelerations, not zero.
    zip_records : bool, default False
        Combine the first building with the first record and the first scale, the second with the
        second, and so on. The sequences must have the same length or a single item, which applies
        to all runs.
    method, dt, duration : optional
        Values that replace the values of each model, as in `run`; dt and duration in s. A list of
        methods or time steps returns a `ResultList` with the runs of each method with each time
        step.
    history : bool, str or sequence of str
        Quantities to keep at each time step: `displacement`, `velocity` (relative to the ground)
        and `absolute_acceleration` of the floors; `drift`, `shear`, `damper_force` and
        `total_shear` of the stories, `element_force` of stories with several elements (arrays over
        the elements, in the order of `History.element_labels`), and of attachments and then links
        the fields of `History.devices` with the prefix device_. True keeps all quantities. As in
        `run`, a history has all rows to the end of the run, which continues after the record while
        a peak could grow (`Runs.record_rows` is the number of rows up to the end of the record).
    every : int, default 1
        Keep every N-th step, from the start.
    out : ndarray or mapping of str to ndarray, or str or Path, optional
        Arrays for the histories, shape (runs, rows, stories), of any floating-point type, or
        memory-mapped files (`numpy.lib.format.open_memmap`). The arrays have the rows of the
        longest record, without the motion after it, and the stories of the tallest building. A
        single array is for a single quantity. By default, arrays of float64 are allocated. A path
        NAME.parquet is the file for the table of the runs (`Runs.to_parquet`).
    jobs : int, optional
        Number of threads; by default the number of processors. The result does not depend on the
        number of threads.
    check : bool, default False
        Estimate the errors of the peaks as `run` does: by an additional run of `impulse4` for each
        run (of `exact` if the method is `exact` and no forces act on floors), with half the time
        step, or with the sampling interval if a step covers at least five intervals.
    vary : mapping of str to array, optional
        Parameters of the buildings to change, with a single value per sample; all arrays have the
        same length. Numbers are in SI units, also if the model file has other units; texts have a
        unit, such as `500 kN/cm` for a stiffness or `2%` for a ratio. Names: `damping`,
        `mass_factor`, `stiffness_factor`, `strength_factor`; for story 3 (counted from 1; without a
        number, for all stories) `stories[3].mass`, `.height`, `.stiffness`, `.dashpot` (or
        `.dashpot.coefficient`, `.dashpot.exponent`, `.dashpot.linear_below`), `.law.KEY` with a key
        of its law, and the three factors; the same keys of an attachment or a link by its name,
        `attachments[tmd].mass` or `links[damper].dashpot`; and `record.scale`, a factor on the
        scales. `Runs.varied` contains the values of each run.
    product : bool, default False
        Use all combinations of the values of `vary`, with the last name varying fastest, instead of
        samples.
    progress : bool or callable, default False
        True shows a progress bar by tqdm on a terminal or in a notebook. A callable receives the
        number of completed runs and the total number.
    partial : bool, default False
        After an interrupt (Ctrl-C), return the completed runs; the status of the other runs is
        `interrupted`. The result is empty if no run was planned before the interrupt.
    gradient : str or sequence of str
        Names as in `vary`: parameters for derivatives of the peaks, also of attachments and links,
        and of the histories that are kept, of each run at its sample (`Runs.gradient`); factors
        have the value 1. Each name needs two additional runs per run. With `check`, an additional
        set of runs with half the time step estimates the errors of the derivatives
        (`Gradient.errors`).
    errors : str, default "raise"
        `raise`, or `keep`: a sample that is out of range keeps its row without values, with the
        status `out-of-range`.

    Returns
    -------
    Runs

    Raises
    ------
    UsageError
        A method, quantity or parameter name is unknown, a time step is not compatible with a
        record, an array has another shape, or a value is out of range.
    ModelError, RecordError
        A model or a record is invalid.
    AnalysisError
        A method does not support a building, or the memory is too small for the histories.
    """
    if is_list(method) or is_list(dt):
        if out is not None:
            raise UsageError(
                "run_many: out cannot be used with a list of methods or time steps; omit out, or "
                "call run_many for each method and time step"
            )
        return for_each_method(run_many, locals())
    try:
        request, plan, result, threads, file = _requested(
            (models, records, scales, zip_records),
            (method, dt, duration, check),
            (vary or {}, product, errors),
            (history, every, out),
            jobs,
        )
    except KeyboardInterrupt:
        if not partial:
            raise
        empty_request = RunsRequest((), (), None, None, False, {})
        return _empty_result(empty_request, [], every, ())
    _integrate_plan(request, result, plan, threads, progress, partial=partial)
    failures = dict(sorted(result.failures.items()))
    runs = replace(result, failures=failures, history=_histories(result).joined())
    names = [gradient] if isinstance(gradient, str) else list(dict.fromkeys(gradient))
    plan = [run for run in plan if result.status[run.number] != INTERRUPTED]
    if names and plan:
        try:
            integrate = functools.partial(integrated, threads=threads)
            peaks = runs.stories, runs.devices
            derivatives = differentiate(request, plan, peaks, runs.history, every, names, integrate)
        except KeyboardInterrupt:
            if not partial:
                raise
        else:
            runs = replace(runs, gradient=derivatives)
    if file:
        runs.to_parquet(file)
    return runs


def _requested(
    inputs: tuple[Any, Any, Any, bool],
    analysis: tuple[Any, Any, Any, bool],
    samples: tuple[Mapping[str, Any], bool, str],
    kept: tuple[Any, Any, Any],
    jobs: int | None,
) -> tuple[RunsRequest, list[RunSpec], Runs, int, Path | None]:
    """Check the arguments of `run_many`, plan its runs, and allocate its result.

    The tuples contain arguments of `run_many`: `models`, `records`, `scales`, `zip_records`;
    `method`, `dt`, `duration`, `check`; `vary`, `product`, `errors`; `history`, `every`, `out`. The
    result contains the checked arguments, the runs to integrate (without the runs of an invalid
    sample), the result with a row for each run, the number of threads, and the Parquet file for the
    table or None. Only the rows of invalid samples are complete: their status is `OUT_OF_RANGE`,
    and their failure states the reason.
    """
    models, records, scales, zip_records = inputs
    method, dt, duration, check = analysis
    vary, product, errors = samples
    history, every, out = kept
    buildings = [model_of(model) for model in as_sequence(models, "models")]
    parameters = samples_of(
        {name: _without_units(buildings[0], name, values) for name, values in vary.items()}, product
    )
    motions = _motions(buildings, records)
    if any(isinstance(record, JoinedRecord) for record in motions):
        raise UsageError("run_many does not support sequences: use run_sequence")
    subjects = tuple(Subject(model, method_of(model, method)) for model in buildings)
    request = RunsRequest(
        subjects,
        motions,
        number_of(dt, "dt"),
        number_of(duration, "duration"),
        check,
        parameters,
    )
    if errors not in ("raise", "keep"):
        raise UsageError(f"errors must be 'raise' or 'keep', got {errors!r:.60}")
    # `invalid` has the keys (index of the building, sample), because a value can be valid for some
    # buildings only. `plan_runs` does not check these samples again: `out_of_range`
    # has checked every pair of building and sample. With `raise`, it checks all samples.
    invalid = request.out_of_range() if errors == "keep" else {}
    plan = plan_runs(request, scales, zip_records, {draw for _, draw in invalid})
    quantities_kept = kept_quantities(history, request.width)
    if quantities_kept and any(model.across for model in buildings):
        raise UsageError(
            "history: a run in two directions has a history for each direction; use "
            "run(..., history=True).directions"
        )
    if isinstance(every, bool) or not isinstance(every, int) or every < 1:
        raise UsageError(f"every must be a positive integer number of steps, got {every!r:.60}")
    threads = processors() if jobs is None else jobs
    if threads < 1:
        raise UsageError(f"the number of jobs must be at least 1, got {jobs}")
    file = Path(out) if isinstance(out, str | Path) else None
    if file and file.suffix != ".parquet":
        raise UsageError(f"out: the file name must end with .parquet, got {str(out)!r:.60}")
    if file:
        import_optional("pyarrow", "a Parquet file", "parquet")
    result = _empty_result(request, plan, every, quantities_kept, None if file else out)
    for run in plan if invalid else ():
        if (run.model, run.draw) in invalid:
            result.status[run.number] = OUT_OF_RANGE
            result.failures[run.number] = invalid[run.model, run.draw]
    plan = [run for run in plan if (run.model, run.draw) not in invalid]
    return request, plan, result, threads, file


def _without_units(model: Model, name: str, values: Any) -> Any:
    """Return the values of a parameter with numbers in SI units instead of texts."""
    if isinstance(values, str):
        return model.si_value(name, values)
    if isinstance(values, (list, tuple)) and any(isinstance(value, str) for value in values):
        return [model.si_value(name, value) for value in values]
    return values


def _motions(models: Sequence[Model], records: Any) -> tuple[Record, ...]:
    """Return the ground motions of the argument `records` of `run_many`: without records, the
    record of the model, or the ground at rest."""
    if records is not None:
        items = as_sequence(records, "records")
        if not any(model.across for model in models):
            return tuple(map(record_of, items))
        # Imported here, because most buildings have one direction.
        from tdint.response.pairs import common_axis

        common_axis(models, "run_many")
        return tuple(pair for item in items if (pair := pair_of(models[0], item)))
    if any(model.excitation.record for model in models):
        if len(models) > 1:
            raise UsageError("run_many: several models with records need the argument records")
        return (model_record(models[0]) or NO_MOTION,)
    return (NO_MOTION,)


INTERRUPTED = "interrupted"
"""Status of a run that was not integrated because of an interrupt."""

OUT_OF_RANGE = "out-of-range"
"""Status of a run with an invalid sample."""

_NOT_RUN = "interrupted before it was run"


def _integrate_plan(
    request: RunsRequest,
    result: Runs,
    plan: Sequence[RunSpec],
    threads: int,
    progress: bool | Progress,
    *,
    partial: bool,
) -> None:
    """Integrate the runs of a plan on threads and write them to the result.

    `partial` is True to return after an interrupt (Ctrl-C); the runs that were not integrated are
    recorded as failures. Otherwise KeyboardInterrupt is raised.
    """
    # The threads share the runs in small parts, so that they finish at about the same time. Each
    # thread receives at least one part if there are enough runs.
    most_steps = max((run.steps.count for run in plan), default=1)
    size = min(_RUNS_PER_BATCH, _STEPS_PER_BATCH // most_steps, math.ceil(len(plan) / threads))
    size = max(1, size)
    parts = [plan[first : first + size] for first in range(0, len(plan), size)]
    stop, running = Event(), Semaphore(threads)
    completed = 0

    def integrate_part(part: Sequence[RunSpec]) -> int:
        """Integrate some runs, unless an interrupt has occurred, and return their number."""
        # The semaphore counts the parts that are running; after an interrupt, the main thread waits
        # for these parts.
        with running:
            if not stop.is_set():
                _integrate_part(request, result, part)
            return len(part)

    try:
        with progress_reporter(progress, len(plan), "run") as report_progress:
            for count in on_threads(integrate_part, parts, threads):
                report_progress(completed := completed + count, len(plan))
    except KeyboardInterrupt:
        if not partial:
            raise
        stop.set()
        for _ in range(threads):
            running.acquire()
        result.failures.update(
            dict.fromkeys(np.flatnonzero(result.status == INTERRUPTED).tolist(), _NOT_RUN)
        )


def integrated(
    request: RunsRequest,
    plan: Sequence[RunSpec],
    every: int,
    kept: tuple[str, ...],
    threads: int | None = None,
) -> Runs:
    """Return the result of the runs of a plan, for neighboring runs (`gradient.differentiate`).

    Parameters
    ----------
    request : RunsRequest
        Buildings, ground motions and samples.
    plan : sequence of RunSpec
        The runs, with the numbers 0, 1, ...
    every : int
        Interval of the rows of the histories in time steps.
    kept : tuple of str
        Histories to keep, by the names of `HISTORIES_OF_MANY`, in new arrays.
    threads : int, optional
        Number of threads; by default the number of processors.

    Returns
    -------
    Runs

    Raises
    ------
    AnalysisError
        There is not enough memory for the histories.
    """
    result = _empty_result(request, plan, every, kept)
    _integrate_plan(request, result, plan, threads or processors(), False, partial=False)
    return replace(result, history=_histories(result).joined())


def _empty_result(
    request: RunsRequest,
    plan: Sequence[RunSpec],
    every: int,
    kept: tuple[str, ...],
    out: Any = None,
) -> Runs:
    """Return the result with a row of nan for each run, which is replaced by the values of the run.

    The quantities `kept` have histories with a row for each `every` steps of the longest run, in
    the arrays `out` of the caller (`history_arrays`) if there are any.
    """
    most_steps = max((run.steps.count for run in plan), default=0)
    shapes = {name: (len(plan), most_steps // every + 1, request.width(name)) for name in kept}
    peaks, errors, corrected = (
        {
            field.name: np.full((len(plan), request.stories), math.nan)
            for field in fields(value_class)
        }
        for value_class in (StoryPeaks, StoryErrors, StoryErrors)
    )
    attached = request.width(DEVICE)
    devices = {field.name: np.full((len(plan), attached), math.nan) for field in fields(StoryPeaks)}
    return Runs(
        models=tuple(subject.model for subject in request.subjects),
        records=request.records,
        methods=tuple(subject.integrator.label for subject in request.subjects),
        model=np.array([run.model for run in plan], np.int64),
        record=np.array([run.record for run in plan], np.int64),
        scale=np.array([run.scale for run in plan]),
        dt=np.array([run.steps.h for run in plan]),
        steps=np.zeros(len(plan), np.int64),
        status=np.full(len(plan), INTERRUPTED, "<U24"),
        energy_error=np.full(len(plan), math.nan),
        stories=StoryPeaks(**peaks),
        devices=StoryPeaks(**devices) if attached else None,
        history=history_arrays(shapes, out),
        every=every,
        failures={},
        varied={name: values[[run.draw for run in plan]] for name, values in request.vary.items()},
        errors=StoryErrors(**errors) if request.check else None,
        corrected=StoryPeaks(**peaks | corrected) if request.check else None,
        record_rows=1 + np.array([request.record_steps(run) for run in plan], np.int64) // every,
        warnings=study_plausibility_warnings(
            (subject.model, subject.prepared.building) for subject in request.subjects
        ),
    )


def _integrate_part(request: RunsRequest, result: Runs, part: Sequence[RunSpec]) -> None:
    """Integrate some runs in batches of one building and one time step, and write their results to
    their rows of `result`.
    """
    histories = _histories(result)
    for runs, subject, samples in _batches(request, part):
        numbers = [run.number for run in runs]
        specs = [(request.records[run.record], run.scale, run.steps) for run in runs]
        outcomes = run_batch(
            subject,
            specs,
            check=request.check,
            histories=(result.every, _history_writer(subject, result, runs))
            if result.history
            else None,
            samples=samples,
        )
        result.status[numbers] = "done"
        store_values(result.stories, numbers, outcomes.stories)
        for i, number in enumerate(numbers) if subject.model.devices else ():
            if i not in outcomes.failures and (peaks := outcomes.devices_of(i)):
                store_values(result.devices, number, peaks.stories)
        result.energy_error[numbers] = outcomes.energy_error
        result.steps[numbers] = outcomes.steps
        for i, status in outcomes.status.items():
            result.status[numbers[i]] = status
        for i, response in outcomes.responses.items():
            if response.check:
                store_values(result.errors, numbers[i], response.check.errors)
                store_values(result.corrected, numbers[i], response.check.corrected)
            histories.store_history(numbers[i], response.history, result.every)
        for i, failure in outcomes.failures.items():
            histories.store_history(numbers[i], None, result.every)
            result.failures[numbers[i]] = str(failure)


def _batches(
    request: RunsRequest, part: Sequence[RunSpec]
) -> Iterator[tuple[list[RunSpec], Subject, SampleTables | None]]:
    """Yield the runs of each batch with its building, and the tables of its samples if it has
    several: the arrays of the building are then the arrays of the first sample."""
    is_varied = bool(request.building_parameters)
    for (model, _), group in groupby(part, key=lambda run: (run.model, run.steps.h)):
        runs = list(group)
        if not is_varied:
            yield runs, request.subjects[model], None
        elif samples := request.samples(model, [run.draw for run in runs]):
            yield runs, request.varied(model, runs[0].draw), samples
        else:
            for draw, runs_of_draw in groupby(runs, key=lambda run: run.draw):
                yield list(runs_of_draw), request.varied(model, draw), None


def _histories(result: Runs) -> HistoryArrays:
    """Return the history arrays of a result with incomplete runs."""
    assert isinstance(result.history, HistoryArrays)
    return result.history


def _history_writer(
    subject: Subject, result: Runs, runs: Sequence[RunSpec]
) -> Callable[[int, Array], None]:
    """Return the function that writes the requested histories of runs of the same building and time
    step to `result`.
    """
    prepared, h = subject.prepared, runs[0].steps.h
    # The functions compute a quantity from the rows of a history and write it to an array of the
    # result, because the next run overwrites the rows.
    targets = [(name, HISTORIES_OF_MANY[name]) for name in result.history]
    building, loads, n = prepared.building, prepared.loads, prepared.building.floors
    histories = _histories(result)

    def on_history(i: int, rows: Array) -> None:
        """Write the history of run `i`."""
        time = result.every * h * np.arange(len(rows), dtype=np.float64)
        for name, compute in targets:
            values = compute(building, loads, time, rows)
            if name in HISTORIES:  # with columns of attachments and links
                values = values[:, :n]
            histories.store(runs[i].number, name, values)

    return on_history
