"""Response history of a building: the work behind `tdint run`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tdint.analysis.given import (
    AnyModel,
    AnyRecord,
    model_of,
    model_record,
    number_of,
    ratio_of,
    record_of,
)
from tdint.analysis.run.case import Case, case_of
from tdint.analysis.run.case import until_rest as go_on
from tdint.analysis.run.error_estimate import ended_at_rest, told_run
from tdint.analysis.run.outcome import FailedRun as FailedRun
from tdint.analysis.run.outcome import Response
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.errors import UsageError
from tdint.methods.catalogue import DEFAULT_METHOD, parse
from tdint.tabular import ResultList


def run(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: str | None = None,
    dt: float | None = None,
    duration: float | None = None,
    history: bool = False,
    allow_unstable: bool = False,
    check: bool | None = None,
    tolerance: float | str | None = None,
    until_rest: bool = False,
    gradient: str | Sequence[str] = (),
) -> Response:
    """Integrate a model in time.

    Parameters
    ----------
    model : Model, str, Path or mapping
        From `load_model`, or what that takes.
    record : Record, str, Path or ObsPy trace, optional
        Ground motion in place of the one that the model names; a file's needs to tell its units and
        one component.
    method, dt, duration : optional
        In place of what the model's analysis says: a specification such as `hht:alpha=-0.1`, s, s.
        Without either the method is `tdint.methods.catalogue.DEFAULT_METHOD` (a note says so), step
        and duration those of the record. Of lists of methods or steps there are `ResultList`
        responses, each method with each step.
    history : bool
        Keep the whole response, not the peaks alone.
    allow_unstable : bool
        Run a conditionally stable method beyond its limit, and take a motion on energy that the
        method made for a result.
    check : bool or None
        Tell the errors of the peaks (`Response.check`), by one more run of impulse4 with half of
        the step; a failure of that leaves them unknown. True: those of the history, too. False:
        none, in a third of the time.
    tolerance : float or str, optional
        Take the largest step with which the told error of every peak drift is within this part of
        it: from four sampling intervals of the record, or from dt where one is given, down to a
        256th of the record's step or of dt (`tdint.analysis.run.step_choice`).
    until_rest : bool
        Go on after that with the ground at rest until the building is (`tdint.analysis.run.case`):
        residual drifts are at rest then.
    gradient : str or sequence of str
        Names as those of `vary` of `run_many`: `stories[1].stiffness`, `damping`, `record.scale`.
        The derivatives of the peaks, and of a history that is kept, by these numbers, of factors at
        1, in `Response.gradient`: by differences of two neighbors each, in one call of all.

    Returns
    -------
    Response

    Raises
    ------
    UsageError
        An unknown method, a step that does not fit, or a tolerance that is none; no number of that
        name.
    ModelError
        The model is none.
    RecordError
        The record is none, or cannot be read.
    AnalysisError
        The step is beyond the method's limit; the run diverged or did not converge; no step is
        within the tolerance (`FailedRun`).
    """
    if isinstance(method, list | tuple) or isinstance(dt, list | tuple):
        # As other functions of methods and steps one or several: each method with each step.
        options = locals()
        every = [options.pop(name) for name in ("method", "dt")]
        methods, steps = (one if isinstance(one, list | tuple) else (one,) for one in every)
        return ResultList(run(**options, method=name, dt=h) for name in methods for h in steps)
    case = prepare(model, record, method=method, allow_unstable=allow_unstable)
    names = [gradient] if isinstance(gradient, str) else list(dict.fromkeys(gradient))
    response = run_case(
        case,
        dt=dt,
        duration=duration,
        history=history,
        check=check,
        tolerance=tolerance,
        until_rest=until_rest,
    )
    if not names:
        return response
    from tdint.analysis.run.run_many import gradient_of

    return replace(response, gradient=gradient_of(case, response, names))


def prepare(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: str | None = None,
    allow_unstable: bool = False,
) -> Case:
    """Put a model together for any number of runs: `run_case(case)`, `run_case(case.scaled(2.0))`,
    ...

    The building is assembled, and what a method needs of it found, once for all cases that are made
    of this one by `Case.scaled` and `Case.under`.

    Parameters
    ----------
    model, record, method, allow_unstable
        As of `run`.

    Returns
    -------
    Case

    Raises
    ------
    UsageError
        An unknown method.
    ModelError, RecordError
        The model or the record is none.
    """
    model = model_of(model)
    if not isinstance(method, str | None):
        raise UsageError(f"a method is a text such as 'hht:alpha=-0.1', got {method!r:.60}")
    specification = method or model.analysis.method
    remarks = () if specification else (f"no method is named: it is {DEFAULT_METHOD}",)
    integrator = parse(specification or DEFAULT_METHOD)
    ground = model_record(model) if record is None else record_of(record)
    return Case(model, PreparedBuilding.of(model), ground, integrator, allow_unstable, remarks)


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
        From `prepare`.
    dt, duration, history, check, tolerance, until_rest
        As of `run`.

    Returns
    -------
    Response

    Raises
    ------
    UsageError
        No case; a step that does not fit, or a tolerance that is none.
    AnalysisError
        As by `run` (`FailedRun`).
    """
    case = case_of(case)
    dt, duration, tolerance = (
        number_of(dt, "dt"),
        number_of(duration, "duration"),
        ratio_of(tolerance, "tolerance"),
    )
    # How long that takes a run without history tells; the steps of a tolerance are chosen over the
    # whole of it.
    if until_rest:
        steps, at_rest = go_on(case, case.steps(dt, duration))
        end = steps.count * steps.h
        response = run_case(
            case, dt=dt, duration=end, history=history, check=check, tolerance=tolerance
        )
        response = ended_at_rest(response)
        return replace(response, time_at_rest=response.steps * response.dt) if at_rest else response
    if tolerance is not None:
        from tdint.analysis.run.step_choice import choose_step

        return choose_step(case, tolerance, dt=dt, duration=duration, history=history)
    steps = case.steps(dt, duration)
    return (
        case.march(steps, history)
        if check is False
        else told_run(case, steps, history, of_history=bool(check))
    )
