"""Many runs with peaks and histories as arrays over the runs: `tdint.run_many`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from itertools import groupby
from itertools import product as combined
from pathlib import Path
from threading import Event, Semaphore
from typing import Any, TypedDict, Unpack, cast, overload

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, Numbers
from tdint.errors import UsageError
from tdint.ground_motion.record import JoinedRecord, Record
from tdint.methods.catalogue import method_of
from tdint.model.building_samples import draw_buildings
from tdint.model.plausibility import study_plausibility_warnings
from tdint.response.arguments import (
    AnyModel,
    AnyRecord,
    as_sequence,
    is_list,
    model_of,
    number_of,
    numbers_of,
    record_of,
)
from tdint.response.run_plan import RunsRequest, plan_runs
from tdint.response.runs import loop_results
from tdint.response.runs.batch import Subject, run_batch, run_sampled, samples_of
from tdint.response.runs.case import Case
from tdint.response.runs.error_estimate import default_reference, factors, shorter_steps
from tdint.response.runs.gradient import (
    SCALE,
    neighbor_samples,
    neighbors,
    number_at,
    slope_errors,
    slopes,
)
from tdint.response.runs.many_results import (
    HISTORY_FIELDS,
    Runs,
    RunSpec,
    history_arrays,
    kept_quantities,
    store_history,
    store_values,
)
from tdint.response.runs.outcome import (
    Gradient,
    Response,
    StoryErrors,
    StoryPeaks,
)
from tdint.response.runs.prepared import BatchResult, Motions
from tdint.system import on_threads, processors
from tdint.tabular import Progress, ResultList, import_optional, progress_reporter

_RUNS_PER_BATCH = 64
"""Number of runs that a thread integrates in one batch."""


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
    vary: Mapping[str, Numbers | float] | None
    product: bool
    progress: bool | Progress
    partial: bool
    gradient: str | Sequence[str]
    errors: str


@overload
def run_many(
    models: AnyModel | Sequence[AnyModel],
    records: AnyRecord | Sequence[AnyRecord],
    *,
    method: str | None = None,
    dt: float | None = None,
    **options: Unpack[_Options],
) -> Runs: ...


@overload
def run_many(
    models: AnyModel | Sequence[AnyModel],
    records: AnyRecord | Sequence[AnyRecord],
    *,
    method: list[str] | tuple[str, ...],
    dt: float | Numbers | None = None,
    **options: Unpack[_Options],
) -> ResultList[Runs]: ...


@overload
def run_many(
    models: AnyModel | Sequence[AnyModel],
    records: AnyRecord | Sequence[AnyRecord],
    *,
    method: str | None = None,
    dt: Numbers,
    **options: Unpack[_Options],
) -> ResultList[Runs]: ...


def run_many(
    models: AnyModel | Sequence[AnyModel],
    records: AnyRecord | Sequence[AnyRecord],
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
    vary: Mapping[str, Numbers | float] | None = None,
    product: bool = False,
    progress: bool | Progress = False,
    partial: bool = False,
    gradient: str | Sequence[str] = (),
    errors: str = "raise",
) -> Runs | ResultList[Runs]:
    """Integrate every building, in every sample of its parameters, under every ground motion at
    every scale.

    The runs are in this order, and the scale varies fastest. Each run equals that of `run`, bit for
    bit. The time loops run on threads without the Python lock; runs without a history are
    integrated in batches of some dozens per compiled call. A failed run does not stop the other
    runs and is not repeated with a smaller time step.

    Parameters
    ----------
    models, records : one or a sequence
        Arguments that `run` accepts.
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
        `total_shear` of the stories. True keeps all quantities.
    every : int, default 1
        Keep every N-th step, from the start.
    out : ndarray or mapping of str to ndarray, or str or Path, optional
        Arrays for the histories, shape (runs, rows, stories), of any floating-point type, or
        memory-mapped files (`numpy.lib.format.open_memmap`). The arrays have the rows of the
        longest run and the stories of the tallest building. A single array is for a single
        quantity. By default, arrays of float64 are allocated. A path NAME.parquet is the file for
        the table of the runs (`Runs.to_parquet`).
    jobs : int, optional
        Number of threads; by default the number of processors. The result does not depend on the
        number of threads.
    check : bool, default False
        Estimate the errors of the peaks as `run` does: by an additional run of `impulse4` for each
        run (of `exact` if the method is `exact` and no forces act on floors), with half the time
        step, or with the sampling interval if a step covers at least five intervals.
    vary : mapping of str to array, optional
        Parameters of the buildings to change, in SI units, with a single value per sample; all
        arrays have the same length. Names: `damping`, `mass_factor`, `stiffness_factor`,
        `strength_factor`; for story 3 (counted from 1; without a number, for all stories)
        `stories[3].mass`, `.height`, `.stiffness`, `.dashpot` (or `.dashpot.coefficient`,
        `.dashpot.exponent`, `.dashpot.linear_below`), `.law.KEY` with a key of its law, and the
        three factors; and `record.scale`, a factor on the scales. Each building is assembled one
        time and its arrays are changed from run to run. `Runs.varied` contains the values of each
        run.
    product : bool, default False
        Use all combinations of the values of `vary`, with the last name varying fastest, instead of
        samples.
    progress : bool or callable
        True shows a progress bar by tqdm on a terminal or in a notebook. A callable receives the
        number of completed runs and the total number.
    partial : bool, default False
        After an interrupt (Ctrl-C), return the completed runs; the status of the other runs is
        `interrupted`. The result is empty if no run was planned before the interrupt.
    gradient : str or sequence of str
        Names as in `vary`: parameters for derivatives of the peaks, and of the histories that are
        kept, of each run at its sample (`Runs.gradient`); factors have the value 1. Each name
        needs two additional runs per run. With `check`, an additional set of runs with half the
        time step estimates the errors of the derivatives (`Gradient.errors`).
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
        return _run_each_method(locals())
    if not isinstance(method, str | None):
        raise UsageError(f"method must be a string such as 'hht:alpha=-0.1', got {method!r:.60}")
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
        empty_request = RunsRequest((), (), (), None, None, False, {})
        return _empty_result(empty_request, [], every, {})
    _integrate_plan(request, result, plan, threads, progress, partial=partial)
    runs = replace(result, failures=dict(sorted(result.failures.items())))
    names = [gradient] if isinstance(gradient, str) else list(dict.fromkeys(gradient))
    plan = [run for run in plan if result.status[run.number] != INTERRUPTED]
    if names and plan:
        try:
            derivatives = _gradient(
                request, plan, runs.stories, runs.history, every, names, threads
            )
        except KeyboardInterrupt:
            if not partial:
                raise
        else:
            runs = replace(runs, gradient=derivatives)
    if file:
        runs.to_parquet(file)
    return runs


def _run_each_method(arguments: dict[str, Any]) -> ResultList[Runs]:
    """Return the runs of each method with each time step, one result for each combination; `method`
    and `dt` are removed from `arguments`.

    Raises
    ------
    UsageError
        `out` is specified: one array cannot store several results.
    """
    if arguments["out"] is not None:
        raise UsageError(
            "run_many: out cannot be used with a list of methods or time steps; omit out, or call "
            "run_many for each method and time step"
        )
    method, dt = arguments.pop("method"), arguments.pop("dt")
    methods = method if isinstance(method, list | tuple) else (method,)
    steps = numbers_of(dt, "dt").tolist() if is_list(dt) else (dt,)
    return ResultList(
        cast("Runs", run_many(**arguments, method=name, dt=h)) for name in methods for h in steps
    )


def _requested(
    inputs: tuple[Any, Any, Any, bool],
    analysis: tuple[str | None, Any, Any, bool],
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
    parameters = samples_of(vary, product)
    buildings = [model_of(model) for model in as_sequence(models, "models")]
    motions = tuple(map(record_of, as_sequence(records, "records")))
    if any(isinstance(record, JoinedRecord) for record in motions):
        raise UsageError("run_many does not support sequences: use run_sequence")
    subjects = tuple(Subject(model, method_of(model, method)) for model in buildings)
    request = RunsRequest(
        subjects,
        tuple(subject.integrator.label for subject in subjects),
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
    quantities_kept = kept_quantities(history)
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
    result = _empty_result(
        request,
        plan,
        every,
        history_arrays(_shape(request, plan, every), quantities_kept, None if file else out),
    )
    for run in plan if invalid else ():
        if (run.model, run.draw) in invalid:
            result.status[run.number] = OUT_OF_RANGE
            result.failures[run.number] = invalid[run.model, run.draw]
    plan = [run for run in plan if (run.model, run.draw) not in invalid]
    return request, plan, result, threads, file


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
    # The threads share the runs in small parts, so that they finish at about the same time.
    parts = [
        plan[first : first + _RUNS_PER_BATCH] for first in range(0, len(plan), _RUNS_PER_BATCH)
    ]
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


def _shape(request: RunsRequest, plan: Sequence[RunSpec], every: int) -> tuple[int, int, int]:
    """Return the shape of the histories: number of runs, number of rows of the longest run, number
    of stories of the tallest building.
    """
    return len(plan), max(run.steps.count for run in plan) // every + 1, request.stories


def _empty_result(
    request: RunsRequest,
    plan: Sequence[RunSpec],
    every: int,
    history: dict[str, NDArray[np.floating[Any]]],
) -> Runs:
    """Return a result whose arrays contain nan, 0 or "interrupted" until threads fill their rows.

    `plan` contains all runs, one row per run.
    """
    peaks, errors, corrected = (
        {
            field.name: np.full((len(plan), request.stories), math.nan)
            for field in fields(value_class)
        }
        for value_class in (StoryPeaks, StoryErrors, StoryErrors)
    )
    return Runs(
        models=tuple(subject.model for subject in request.subjects),
        records=request.records,
        methods=request.methods,
        model=np.array([run.model for run in plan], np.int64),
        record=np.array([run.record for run in plan], np.int64),
        scale=np.array([run.scale for run in plan]),
        dt=np.array([run.steps.h for run in plan]),
        steps=np.zeros(len(plan), np.int64),
        status=np.full(len(plan), INTERRUPTED, "<U24"),
        energy_error=np.full(len(plan), math.nan),
        stories=StoryPeaks(**peaks),
        history=history,
        every=every,
        failures={},
        varied={name: values[[run.draw for run in plan]] for name, values in request.vary.items()},
        errors=StoryErrors(**errors) if request.check else None,
        corrected=StoryPeaks(height=peaks["height"], **corrected) if request.check else None,
        warnings=study_plausibility_warnings(
            (subject.model, subject.prepared.building) for subject in request.subjects
        ),
    )


def _integrate_part(request: RunsRequest, result: Runs, part: Sequence[RunSpec]) -> None:
    """Integrate some runs in batches of one building and one time step, and write their results to
    their rows of `result`.
    """
    # `individual` is the sample of a run that needs a separate assembled building, otherwise -1.
    for (model, _, individual), group in groupby(
        part,
        key=lambda run: (
            run.model,
            run.steps.h,
            request.individual_sample(run, bool(result.history)),
        ),
    ):
        runs, subject = list(group), request.subjects[model]
        numbers = [run.number for run in runs]
        motions = Motions({run.record: request.records[run.record] for run in runs})
        specs = [(run.record, run.scale, run.steps) for run in runs]
        # If parameters vary, the arrays of one building are changed from run to run, except for
        # runs that need an individually assembled building (`individual_sample`).
        if request.building_parameters and individual < 0:
            sample_indices = {
                draw: index for index, draw in enumerate(dict.fromkeys(run.draw for run in runs))
            }
            values = {
                name: column[list(sample_indices)]
                for name, column in request.building_parameters.items()
            }
            drawn = draw_buildings(subject.model, subject.prepared.building, values)
            sampled_runs = [
                (sample_indices[run.draw], spec) for run, spec in zip(runs, specs, strict=True)
            ]
            sampled_subjects = [partial(request.varied, model, draw) for draw in sample_indices]
            outcomes = run_sampled(subject, motions, sampled_runs, drawn, sampled_subjects)
        else:
            subject = (
                request.varied(model, runs[0].draw) if request.building_parameters else subject
            )
            outcomes = run_batch(
                subject,
                motions,
                specs,
                check=request.check,
                history=bool(result.history),
                integrate=partial(_integrate_with_histories, subject, request, result, runs)
                if result.history
                else None,
            )
        result.status[numbers] = "done"
        store_values(result.stories, numbers, outcomes.stories)
        result.energy_error[numbers] = outcomes.energy_error
        result.steps[numbers] = outcomes.steps
        for i, status in outcomes.status.items():
            result.status[numbers[i]] = status
        for i, response in outcomes.responses.items():
            if response.check:
                store_values(result.errors, numbers[i], response.check.errors)
                store_values(result.corrected, numbers[i], response.check.corrected)
            store_history(result, numbers[i], response.history)
        for i, failure in outcomes.failures.items():
            store_history(result, numbers[i], None)
            result.failures[numbers[i]] = str(failure)


def _integrate_with_histories(
    subject: Subject, request: RunsRequest, result: Runs, runs: Sequence[RunSpec]
) -> BatchResult:
    """Integrate runs of one building with one time step, and write the requested histories to
    `result`; return the peaks and energies.
    """
    prepared, h = subject.prepared, runs[0].steps.h
    time = (
        result.every * h * np.arange(next(iter(result.history.values())).shape[1], dtype=np.float64)
    )
    # The functions compute a quantity from the rows of a history and write it to an array of the
    # result, because the next run overwrites the rows.
    targets = [
        (array, loop_results.HISTORIES[HISTORY_FIELDS[name]])
        for name, array in result.history.items()
    ]
    building, loads, n = prepared.building, prepared.loads, prepared.building.stories

    def on_history(i: int, rows: Array) -> None:
        """Write the history of run `i`; nan after its end and for stories above its roof."""
        for array, compute in targets:
            history = array[runs[i].number]
            history[: len(rows), :n] = compute(building, loads, time[: len(rows)], rows)
            if len(rows) < array.shape[1] or n < array.shape[2]:
                history[len(rows) :] = history[:, n:] = math.nan

    return prepared.integrate_with_histories(
        subject.integrator,
        h,
        [(request.records[run.record].acceleration, run.scale, run.steps) for run in runs],
        every=result.every,
        on_history=on_history,
    )


# ---- Derivatives: two neighboring runs for each parameter, as additional samples


def gradient_of(case: Case, response: Response, names: Sequence[str]) -> Gradient:
    """Return the derivatives of the peaks of an individual run, and of its history if it was kept.

    Parameters
    ----------
    response : Response
        Result of the run. Errors of the derivatives are estimated if it has error estimates.

    Raises
    ------
    UsageError
        The case allows an unstable time step, or a parameter does not exist.
    """
    if case.allow_unstable:
        raise UsageError(
            "gradient cannot be used with allow_unstable: results of an unstable time step have no "
            "derivative"
        )
    label, dt = case.method.label, response.dt
    # Many runs require a record: without a ground motion, it is a record of zeros.
    record = case.record or Record(np.zeros(response.steps + 1), dt, "", "", "", "")
    subject = Subject(case.model, label)
    check = response.check is not None
    request = RunsRequest((subject,), (label,), (record,), None, None, check, {})
    plan = [RunSpec(0, 0, 0, 0, 1.0, subject.case(record).steps(dt, response.steps * dt))]
    # The index None adds the axis of the runs, with a single run.
    peaks = StoryPeaks(
        **{field.name: getattr(response.stories, field.name)[None] for field in fields(StoryPeaks)}
    )
    history = (
        {name: getattr(response.history, field)[None] for name, field in HISTORY_FIELDS.items()}
        if response.history
        else {}
    )
    return _gradient(request, plan, peaks, history, 1, names, processors()).select_run(0)


def _gradient(
    request: RunsRequest,
    plan: Sequence[RunSpec],
    peaks: StoryPeaks,
    history: Mapping[str, NDArray[np.floating[Any]]],
    every: int,
    names: Sequence[str],
    threads: int,
) -> Gradient:
    """Return the derivatives of completed runs, with error estimates if `request.check` is true.

    The errors are estimated by computing the derivatives again from a second set of runs with half
    the time step. `default_reference` selects the method of these runs.
    """
    gradient = _differentiated(request, plan, peaks, history, every, names, threads)
    if not request.check:
        return gradient
    subjects = tuple(
        Subject(subject.model, default_reference(subject.case(None)).method.label)
        for subject in request.subjects
    )
    labels = tuple(subject.method for subject in subjects)
    other_request = replace(request, subjects=subjects, methods=labels, check=False)
    others = [run._replace(number=i, steps=shorter_steps(run.steps)) for i, run in enumerate(plan)]
    base = _empty_result(other_request, others, 1, {})
    _integrate_all(other_request, base, others, threads)
    other = _differentiated(other_request, others, base.stories, {}, 1, names, threads)
    errors = {}
    model_factors = [factors(subject.integrator) for subject in request.subjects]
    for field in fields(StoryErrors):
        derivatives, other_derivatives = getattr(gradient, field.name), getattr(other, field.name)
        errors[field.name] = np.full_like(derivatives, math.nan)
        for run, with_half_step in zip(plan, other_derivatives, strict=True):
            errors[field.name][run.number] = slope_errors(
                derivatives[run.number], with_half_step, model_factors[run.model]
            )
    return replace(gradient, errors=StoryErrors(**errors))


def _integrate_all(
    request: RunsRequest, result: Runs, plan: Sequence[RunSpec], threads: int
) -> None:
    """Integrate all runs of a plan on threads, and write them to the result."""
    # Each thread receives at least one part if there are enough runs.
    size = max(1, min(_RUNS_PER_BATCH, math.ceil(len(plan) / threads)))
    parts = [plan[first : first + size] for first in range(0, len(plan), size)]
    for _ in on_threads(partial(_integrate_part, request, result), parts, threads):
        pass


def _differentiated(
    request: RunsRequest,
    plan: Sequence[RunSpec],
    peaks: StoryPeaks,
    history: Mapping[str, NDArray[np.floating[Any]]],
    every: int,
    names: Sequence[str],
    threads: int,
) -> Gradient:
    """Return the derivatives of the results of completed runs (`plan`) with respect to parameters
    (`names`), with a row for each of all runs; nan for runs that are not in `plan`.

    For each run and parameter, two neighboring runs are integrated with another value of only this
    parameter (`neighbors`). The derivative follows from the three results (`slopes`).
    """
    # Derivatives are computed at the values in `numbers`: the value of the sample if a parameter is
    # varied (never nan), otherwise the value of the model, or 1 for a factor such as
    # `record.scale`. `near` contains the two neighbors of each value. The keys
    # of both dictionaries are the indices of building and sample.
    numbers = dict[tuple[int, int], list[float]]()
    near = dict[tuple[int, int], list[tuple[float, float]]]()
    for key in dict.fromkeys((run.model, run.draw) for run in plan):
        model = request.varied(*key).model
        numbers[key] = [
            float(request.vary[name][key[1]]) if name in request.vary else number_at(model, name)
            for name in names
        ]
        near[key] = [
            neighbors(model, name, number) for name, number in zip(names, numbers[key], strict=True)
        ]
    neighbor_request, neighbor_plan = _neighbor_runs(request, plan, names, numbers, near)
    arrays = history_arrays(_shape(neighbor_request, neighbor_plan, every), tuple(history), None)
    result = _empty_result(neighbor_request, neighbor_plan, every, arrays)
    _integrate_all(neighbor_request, result, neighbor_plan, threads)

    # Rows of runs that were not integrated remain nan. `values` has the shape (runs of the plan,
    # names), `offsets` the shape (runs of the plan, names, 2).
    rows = [run.number for run in plan]
    values = np.array([numbers[run.model, run.draw] for run in plan])
    offsets = np.array([near[run.model, run.draw] for run in plan]) - values[:, :, None]

    def with_all_rows(run_values: NDArray[Any]) -> NDArray[Any]:
        """Return an array with a row for each run, from the rows of the integrated runs."""
        filled = np.full((len(peaks.peak_drift), *run_values.shape[1:]), math.nan)
        filled[rows] = run_values
        return filled

    def differences(base: NDArray[Any], neighboring: NDArray[Any]) -> list[NDArray[Any]]:
        """Return the derivatives of a quantity, and half the differences of its one-sided
        derivatives (`slopes`), from its values `base` in the runs and `neighboring` in their
        neighbors.
        """
        # The neighboring runs are in the order of the runs, then of the names, then of the two
        # neighbors, as the axes of `offsets`.
        neighbor_values = neighboring.reshape(*offsets.shape, *base.shape[1:])
        return [with_all_rows(array) for array in slopes(base[rows], neighbor_values, offsets)]

    peak_derivatives: dict[str, Any] = {
        field.name: differences(getattr(peaks, field.name), getattr(result.stories, field.name))
        for field in fields(StoryErrors)
    }
    return Gradient(
        **{name: derivative for name, (derivative, _) in peak_derivatives.items()},
        parameters=tuple(names),
        values=with_all_rows(values),
        kink=StoryErrors(**{name: kink for name, (_, kink) in peak_derivatives.items()}),
        history={
            name: differences(array, result.history[name])[0] for name, array in history.items()
        },
    )


def _neighbor_runs(
    request: RunsRequest,
    plan: Sequence[RunSpec],
    names: Sequence[str],
    numbers: Mapping[tuple[int, int], list[float]],
    near: Mapping[tuple[int, int], list[tuple[float, float]]],
) -> tuple[RunsRequest, list[RunSpec]]:
    """Return a request with the samples of the neighbors, without error estimates, and the
    neighboring runs, in the order of `plan`, then of the parameters, then of the two neighbors.

    `numbers` contains the values of the parameters, by the indices of building and sample.
    """
    draws, columns = neighbor_samples(near, names, request.building_parameters)
    # A neighbor of the factor on the ground motion changes the scale of the run, not the building.
    neighbor_plan = list[RunSpec]()
    for run, i, side in combined(plan, range(len(names)), range(2)):
        key = run.model, run.draw
        factor = near[key][i][side] / numbers[key][i] if names[i] == SCALE else 1.0
        neighbor_plan.append(
            run._replace(
                number=len(neighbor_plan), draw=draws[key, i, side], scale=run.scale * factor
            )
        )
    return replace(request, vary=columns, check=False), neighbor_plan
