"""Response history analysis of a building: `tdint.run`, `tdint.prepare` and `tdint.run_case`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, TypedDict, Unpack, cast, overload

import numpy as np

from tdint.arrays import Numbers
from tdint.errors import UsageError
from tdint.ground_motion.axes import components_of
from tdint.methods.catalogue import method_of, parse
from tdint.response.arguments import (
    AnyModel,
    AnyRecord,
    for_each_method,
    is_list,
    model_of,
    model_record,
    pair_of,
    ratio_of,
    record_of,
)
from tdint.response.defaults import NO_METHOD
from tdint.response.runs.case import Case
from tdint.response.runs.error_estimate import (
    run_until_rest,
    run_with_error_estimate,
    without_additional_history,
)
from tdint.response.runs.outcome import FailedRun as FailedRun
from tdint.response.runs.outcome import Response, ResponseWithHistory
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.runs.run_state import RunState
from tdint.response.runs.settings import RunSettings
from tdint.tabular import ResultList


class _CaseOptions(TypedDict, total=False):
    """Arguments of `run_case` with the same types in all overloads."""

    duration: float | None
    check: bool | None
    tolerance: float | str | None
    until_rest: bool


class _Options(_CaseOptions, total=False):
    """Arguments of `run` with the same types in all overloads."""

    allow_unstable: bool
    gradient: str | Sequence[str]
    initial: RunState | None


@overload
def run(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: str | None = None,
    dt: float | None = None,
    history: Literal[True],
    **options: Unpack[_Options],
) -> ResponseWithHistory: ...


@overload
def run(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: str | None = None,
    dt: float | None = None,
    history: bool = False,
    **options: Unpack[_Options],
) -> Response: ...


@overload
def run(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: list[str] | tuple[str, ...],
    dt: float | Numbers | None = None,
    history: bool = False,
    **options: Unpack[_Options],
) -> ResultList[Response]: ...  # Several methods: one response for each method and time step.


@overload
def run(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: str | None = None,
    dt: Numbers,
    history: bool = False,
    **options: Unpack[_Options],
) -> ResultList[Response]: ...  # A list or an array of time steps: one response per step.


def run(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: str | Sequence[str] | None = None,
    dt: float | Numbers | None = None,
    duration: float | None = None,
    history: bool = False,
    allow_unstable: bool = False,
    check: bool | None = None,
    tolerance: float | str | None = None,
    until_rest: bool = False,
    gradient: str | Sequence[str] = (),
    initial: RunState | None = None,
) -> Response | ResultList[Response]:
    """Integrate a model in time.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Result of `load_model`, or an argument that `load_model` accepts.
    record : Record, str, Path or ObsPy trace, optional
        Ground motion; by default the record specified in the model. A file must specify its units
        and contain one component.
    method, dt, duration : optional
        Method specification such as `hht:alpha=-0.1`, time step (s) and duration (s). By default
        the values of the model's analysis section; otherwise the method is
        `impulse4` (reported in a note), and the time step is that of
        the record. Without a duration, a run covers the record and continues with the ground at
        rest while a peak could still grow. A list of methods or time steps returns a `ResultList`
        with the responses of each method with each time step.
    history : bool, default False
        Keep the response history in addition to the peaks: all rows to the end of the run, also
        after the record (`Response.record_rows` is the number of rows up to the end of the record).
        Of a building in two directions, the histories are those of `Response.directions`; its own
        `history` is None.
    allow_unstable : bool, default False
        Run a conditionally stable method above its stability limit, and accept a response with
        energy that was produced by the method.
    check : bool or None, default None
        Estimate the errors of the peaks (`Response.check`) by an additional run, usually of
        impulse4 with a shorter time step (`Response.check.method` and `time_steps`). If this run
        fails, the errors are unknown. True estimates the errors of the history also. False omits
        the estimates; the run then needs about one third of the time.
    tolerance : float or str, optional
        Choose a time step for which the estimated error of every peak drift, divided by that drift,
        does not exceed this value. The search starts with four sampling intervals of the record
        (two for tolerances below 0.3 %), or with `dt` if it is specified, and halves the time step
        down to 1/256 of the sampling interval or of `dt`. It predicts the number of halvings, and
        may therefore skip a larger time step that would suffice
        (`tdint.response.runs.step_choice`).
    until_rest : bool, default False
        Continue with the ground at rest until free vibration has decayed
        (`tdint.response.runs.case`), so that residual drifts are the drifts at rest.
    gradient : str or sequence of str
        Names of parameters as in `vary` of `run_many`: `stories[1].stiffness`, `damping`,
        `record.scale`. `Response.gradient` contains the derivatives of the peaks, and of the
        history if it is kept, with respect to these parameters; factors have the value 1. Each
        derivative is the difference between two neighboring runs. All neighboring runs are
        integrated in a single batch. An additional set of runs with half the time step estimates
        the errors of the derivatives (`Gradient.errors`), unless `check` is False.
    initial : RunState, optional
        State from which the run continues instead of from the initial motion of the model:
        `Response.final_state` of a run of the same building, or `Stepper.state`. By default, method
        and time step are those of that run. The first sample of the record is at the time of the
        state; the ground acceleration of the state replaces it. The response then equals that of an
        uninterrupted run, bit for bit (with matrices or flexural stories, within rounding), and its
        times continue. Peaks refer to this run only, energies start at zero, and errors are not
        estimated.

    Returns
    -------
    Response
        With `history=True`, its history is not None.

    Raises
    ------
    UsageError
        The method is unknown, the time step or the tolerance is invalid, a parameter of `gradient`
        does not exist, or `initial` is the state of another building, method or time step.
    ModelError
        The model is invalid.
    RecordError
        The record is invalid or cannot be read.
    AnalysisError
        The time step is above the stability limit of the method, the run diverged or did not
        converge, or no time step meets the tolerance (`FailedRun`).
    """
    if is_list(method) or is_list(dt):
        return for_each_method(run, locals())
    if not isinstance(history, bool | np.bool_):
        raise UsageError(
            f"history must be True or False, got {history!r:.60}: run keeps all quantities, and "
            "run_many selected quantities"
        )
    case = prepare(
        model,
        record,
        method=cast("str | None", method),
        allow_unstable=allow_unstable,
        initial=initial,
    )
    names = [gradient] if isinstance(gradient, str) else list(dict.fromkeys(gradient))
    if initial is not None and names:
        raise UsageError("gradient cannot be used with initial; omit one")
    if names and case.across is not None:
        raise UsageError("gradient requires a model with one direction; omit it")
    response = run_case(
        case,
        dt=cast("float | None", dt),
        duration=duration,
        history=history,
        check=check,
        tolerance=tolerance,
        until_rest=until_rest,
    )
    if not names:
        return response
    from tdint.response.runs.gradient import gradient_of
    from tdint.response.runs.run_many import integrated

    return replace(response, gradient=gradient_of(case, response, names, integrated))


def prepare(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: str | None = None,
    allow_unstable: bool = False,
    initial: RunState | None = None,
) -> Case:
    """Assemble a model for any number of runs: `run_case(case)`, `run_case(case.scaled(2.0))`, ...

    The building and the coefficients of the method are computed one time and shared by all cases
    that `Case.scaled` and `Case.under` derive from the result.

    Parameters
    ----------
    model, record, method, allow_unstable, initial
        As for `run`.

    Returns
    -------
    Case

    Raises
    ------
    UsageError
        The method is unknown, or `initial` is the state of another building or method.
    ModelError, RecordError
        The model or the record is invalid.
    """
    model = model_of(model)
    if not (initial is None or isinstance(initial, RunState)):
        raise UsageError(
            "initial must be RunState or None (Response.final_state, Stepper.state), got "
            f"{initial!r:.60}"
        )
    specification = method_of(model, method)
    is_chosen = not (method or model.analysis.method or initial)
    remarks = [f"{NO_METHOD}; using {specification}"] if is_chosen else []
    integrator = initial.method if initial and not method else parse(specification)
    if model.across is not None:
        if initial:
            raise UsageError("initial: a run in two directions cannot continue another run")
        pair = pair_of(model, record)
        x, y = (
            Case(
                part, PreparedBuilding.of(part), ground, integrator, allow_unstable, tuple(remarks)
            )
            for part, ground in zip(model.directions, components_of(pair), strict=True)
        )
        return replace(x, record=pair, across=y)
    ground = model_record(model) if record is None else record_of(record)
    prepared = PreparedBuilding.of(model)
    if initial:
        prepared = prepared.continued_from(initial, integrator)
        remarks += ["no error estimate: the run continues from the state of another run"]
        first = 0.0 if ground is None else float(ground.acceleration[0])
        if first != initial.ground_acceleration:
            remarks.append(
                f"the ground acceleration starts at {initial.ground_acceleration:.4g} m/s^2, the "
                f"value of the state, instead of {first:.4g} m/s^2"
            )
    return Case(model, prepared, ground, integrator, allow_unstable, tuple(remarks))


@overload
def run_case(
    case: Case,
    *,
    dt: float | None = None,
    history: Literal[True],
    **options: Unpack[_CaseOptions],
) -> ResponseWithHistory: ...


@overload
def run_case(
    case: Case,
    *,
    dt: float | None = None,
    history: bool = False,
    **options: Unpack[_CaseOptions],
) -> Response: ...


def run_case(
    case: Case,
    *,
    dt: float | None = None,
    duration: float | None = None,
    history: bool = False,
    check: bool | None = None,
    tolerance: float | str | None = None,
    until_rest: bool = False,
) -> Response:
    """Integrate a case in time.

    Parameters
    ----------
    case : Case
        Result of `prepare`.
    dt, duration, history, check, tolerance, until_rest
        As for `run`.

    Returns
    -------
    Response

    Raises
    ------
    UsageError
        `case` is not a Case, or the time step or the tolerance is invalid.
    AnalysisError
        As by `run` (`FailedRun`).
    """
    is_continued = case.prepared.initial is not None
    for name, value in (("check", check), ("tolerance", tolerance)):
        if is_continued and value:
            raise UsageError(
                f"{name} cannot be used with initial, because the errors of the runs before are "
                f"unknown; omit {name}"
            )
    settings = RunSettings(
        dt=dt,
        duration=duration,
        until_rest=until_rest,
        check=not (check is False or is_continued),
    )
    response = integrate_case(
        case,
        settings,
        history=history,
        history_errors=bool(check),
        tolerance=ratio_of(tolerance, "tolerance"),
    )
    return without_additional_history(response)


def integrate_case(
    case: Case,
    settings: RunSettings,
    *,
    history: bool = False,
    history_errors: bool = False,
    tolerance: float | None = None,
    begin: Callable[..., Callable[[], Any]] | None = None,
) -> Response:
    """Integrate a case in time, as `run_case` with checked arguments.

    Parameters
    ----------
    history_errors : bool, default False
        With error estimates of the peaks, also estimate the errors of the history.
    begin : callable, optional
        As for `run_with_error_estimate`.

    Raises
    ------
    UsageError
        The time step or the tolerance is invalid.
    FailedRun
        As by `run`.
    """
    if case.across is not None:
        # Imported here, because few models have two directions.
        from tdint.response.runs.batch import integrate_directions

        return integrate_directions(case, settings, integrate_case, tolerance=tolerance)
    if settings.until_rest:
        return run_until_rest(
            case,
            case.steps(settings.dt, settings.duration),
            lambda duration: integrate_case(
                case,
                replace(settings, duration=duration, until_rest=False),
                history=history,
                history_errors=history_errors,
                tolerance=tolerance,
            ),
        )
    if tolerance is not None:
        from tdint.response.runs.step_choice import choose_step

        return choose_step(
            case, tolerance, dt=settings.dt, duration=settings.duration, history=history
        )
    steps = case.steps(settings.dt, settings.duration)
    return (
        run_with_error_estimate(case, steps, history, history_errors=history_errors, begin=begin)
        if settings.check
        else case.integrate(steps, history)
    )
