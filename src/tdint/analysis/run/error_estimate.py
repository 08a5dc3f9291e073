"""How far off the peaks of a run are: by one more run, of `impulse4` with half of the step,
whatever the method.

With the peaks P of a run and P1 of the other one the error of P is told as

    max(4/3 |P - P1|, a fifth of the stories' root mean square of that over the peaks, times P, 1e-5
    P)

The factor is that of Richardson's extrapolation for order 2: what the other run errs by itself is
less than a third of the difference, for it locates yielding inside its steps and keeps order 4
there. It is no bound: how often it is too small stands in tests/README.md, "How honest told errors
are". Where P1 agrees with P by accident the stories beside tell; and no error is told to be less
than what a peak may be larger by between steps that do not resolve the motion. `exact` is told by
itself, under a record without floor forces, where it errs by what its peaks have between steps.

A run that goes on until rest ends while a little of its motion is left: that is added to the errors
of residual drifts. A run of long steps ends after the time that was asked for, the record's end as
a rule: what the drifts have changed by since then is added to the errors of residual drifts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial

import numpy as np

from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import (
    ErrorEstimate,
    ErrorHistory,
    FailedRun,
    History,
    Response,
    Shock,
    StoryErrors,
)
from tdint.analysis.run.workspace import Steps, finer
from tdint.arrays import Array
from tdint.methods.catalogue import DEFAULT_METHOD, parse

REFERENCE, _EXACT = parse(DEFAULT_METHOD), parse("exact")
"""The method of the run that tells the errors, and the one that tells its own."""

_OF_DIFFERENCE = 4.0 / 3.0
"""Error over the difference from a run with half of the step, for order 2: 1 / (1 - 2^-2)."""

_COMMON = 0.2
"""Part of the stories' root mean square error, over the peaks, below which none is told. Of 100
random buildings with eight methods .1 % of told drifts and .3 % of damper forces are then less than
a half of the true error, and 2 to 6 % of a column more than ten times as large; with all of it .03
and .05 %, and 7 to 20 %; with nothing .26 and .35 %."""

_FLOOR = 1e-5
"""Error over the peak that is told at least: below it iterations' tolerances, and what both runs
miss alike between steps, are part of it."""

_LONG = 2.0
"""Processor time of time loops, s, from which a run says what its errors take."""


def told_run(
    case: Case, steps: Steps, history: bool = False, *, of_history: bool = False
) -> Response:
    """The response to `steps` with its errors; `of_history`: with those of its history, too.

    Raises
    ------
    FailedRun
        As from `Case.march`.
    """
    case.prepared.compile(
        [case.method, reference(case).method]
    )  # both side by side, where they are not yet
    return told(case, steps, case.march(steps, history), of_history=of_history)


def reference(case: Case) -> Case:
    """The case whose run tells the errors of another one's: the same with `impulse4`; of `exact`
    itself."""
    itself = case.method.label == _EXACT.label and not case.model.excitation.forces
    return replace(case, method=_EXACT if itself else REFERENCE, remarks=())


def told(case: Case, steps: Steps, response: Response, *, of_history: bool = False) -> Response:
    """A response to `steps` with the errors that one more run tells, unknown ones and a note where
    that fails or ends at another time.

    A run that ended with a collapse is compared up to there.
    """
    other = attempt(reference(case), finer(replace(steps, count=response.steps)))
    if isinstance(other, FailedRun):
        return _unknown(response, f"the run with dt {other.dt:.6g} s failed ({other.status})")
    if abs(other.steps * other.dt - response.steps * response.dt) > 0.5 * other.dt:
        return _unknown(response, f"the run with dt {other.dt:.6g} s ends at another time")
    check = ErrorEstimate.of(
        response.stories,
        story_errors(response, other),
        time_steps=(other.dt,),
        method=other.method,
        corrected=other.stories,
    )
    # What goes on to grow when a run ends is not corrected: the other one may have ended a step
    # before.
    if response.collapse is not None and response.collapse.ended:
        note = (
            f"the run ends with the step to {response.collapse.time:.6g} s, in which it collapses: "
            "what that adds to peaks that grow until then is no part of their errors"
        )
        response, check = (
            replace(response, notes=(*response.notes, note)),
            replace(check, corrected=None),
        )
    if (spent := response.solver_time + other.solver_time) > _LONG:
        note = (
            f"{other.solver_time:.2g} of {spent:.2g} s of the time loops tell the errors; "
            "--no-check leaves them out"
        )
        response = replace(response, notes=(*response.notes, note))
    if of_history and response.history_chunks is not None and other.history_chunks is not None:
        rows = response.history and _with_error(
            response.history, History.joined(other.history_chunks(2))
        )
        pieces = partial(_chunks_with_error, response.history_chunks, other.history_chunks)
        response = replace(response, history=rows, history_chunks=pieces)
    return replace(response, check=check)


def story_errors(
    response: Response | Shock, other: Response | Shock, of_difference: float = _OF_DIFFERENCE
) -> StoryErrors:
    """The errors of the peaks of a run, or of a shock in it, that another one tells: so much of
    their difference, and no less than the module says."""

    def errors(name: str) -> Array:
        size = getattr(response.stories, "peak_drift" if name == "residual_drift" else name)
        off = of_difference * np.abs(getattr(response.stories, name) - getattr(other.stories, name))
        error: Array = np.maximum(off, np.maximum(_COMMON * common(off, size), _FLOOR * size))
        # What the steps do not resolve of a peak, or leave to a drift that is told later
        bound: Array = getattr(response.interstep_bound, name)
        return error + bound if name == "residual_drift" else np.maximum(error, bound)

    return StoryErrors(**{field.name: errors(field.name) for field in fields(StoryErrors)})


def common(errors: Array, size: Array) -> Array:
    """The root mean square over the stories of errors relative to a size, times that size."""
    moved = size > 0.0
    relative = np.divide(errors, size, out=np.zeros_like(errors), where=moved)
    return np.asarray(np.sqrt(np.sum(relative**2) / max(np.count_nonzero(moved), 1)) * size)


def ended_at_rest(response: Response) -> Response:
    """The response of a run that has gone on until rest: its residual drifts are those at rest,
    from which what is left of the motion keeps them."""
    if response.check is None:
        return response
    moving = np.maximum(
        response.residual_oscillation,
        _COMMON * common(response.residual_oscillation, response.stories.peak_drift),
    )
    errors = response.check.errors
    errors = replace(errors, residual_drift=errors.residual_drift + moving)
    return replace(response, check=replace(response.check, errors=errors))


def attempt(case: Case, steps: Steps, history: bool = False) -> Response | FailedRun:
    """The response to `steps`, or why there is none."""
    try:
        return case.march(steps, history)
    except FailedRun as failure:
        return failure


def _unknown(response: Response, reason: str) -> Response:
    nothing = np.full_like(response.stories.peak_drift, np.nan)
    errors = StoryErrors(*(nothing for _ in fields(StoryErrors)))
    notes = (*response.notes, f"no error is told: {reason}")
    return replace(response, check=ErrorEstimate(errors, (), None, None), notes=notes)


def _chunks_with_error(
    pieces: Callable[[int], Iterator[History]],
    others: Callable[[int], Iterator[History]],
    every: int = 1,
) -> Iterator[History]:
    return map(_with_error, pieces(every), others(2 * every))


def _with_error(history: History, other: History) -> History:
    """A history with its error, true less computed, where another run's at the same times is
    true."""
    errors = {
        one.name: getattr(other, one.name) - getattr(history, one.name)
        for one in fields(ErrorHistory)
    }
    return replace(history, error=ErrorHistory(**errors))
