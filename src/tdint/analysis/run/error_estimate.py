"""How far off the peaks of a run are.

A run of moment4 carries its error along (`tdint.kernels.equations.carried.error`). Below 1e-3 of the peak drift the
run's own peaks are off by no more than 1.25 times the estimate in 97 of 100 runs, and the corrected ones by less than
the estimate in 99; up to 1e-2 by no more than 3 times the estimate in 99 (`tests/benchmarks/carried_error.py`, 952
runs); above, the step is too long for it to tell. A peak whose correction is not all of its told error stays as
computed, but in linear buildings.

It is in doubt, too, where the drifts' error is small beside that of the other motions: where it passes zero at the
peaks, what the run does not know of it is what is left. And where a law decides something for good by less than the
error: whether a story turns, if each turn counts, or fails.

There a run with a half of the step carries its error along, with a quarter where that is too long still: what its
corrected peaks differ by is the error, and what these may be off by is added. They are the corrected ones of the run,
too.

Where no run can carry it along, or none of these does, the run is repeated with smaller steps.

With the peaks P0, P1, P2 of runs with the steps h, h/2 and h/4 the error of P0 is estimated as

    max(4/3 |P0 - P1|, |P0 - P2| + |P1 - P2|)

The first is Richardson's extrapolation for order 2, the lowest order of the catalogue. The second is a bound where P2
is off by no more than its own last change, which holds for every order from 1; it catches a P1 that agrees with P0 by
accident, as happens where yielding leaves no order to observe. Accidents of all three are caught by the stories beside:
no error is taken for less than a part of their root mean square, relative to the peaks, nor for less than what a peak
may be larger by between steps that do not resolve the motion. Higher orders are not counted on: a declared order 4 is
lost at the first kink that is not located.

A run that goes on until rest ends while a little of its motion is left: that is added to the errors of residual drifts.
A run of long steps ends after the time that was asked for, the record's end as a rule: what the drifts have changed by
since then is added to the errors of residual drifts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from functools import partial

import numpy as np

from tdint.analysis.run.case import Case, not_by_accident
from tdint.analysis.run.outcome import ErrorEstimate, ErrorHistory, FailedRun, History, Response, Shock, StoryErrors
from tdint.analysis.run.workspace import Steps, finer
from tdint.arrays import Array
from tdint.model.building import Building

FINER = 2
"""Repetitions with smaller steps."""

_COMMON = 0.3
"""Part of the stories' root mean square error below which none is estimated."""

TOLD = 1e-2
"""Error over the peak drift up to which the error that a run carries along is taken at its word."""

_OF_MOTION = ("peak_drift", "residual_drift", "peak_displacement", "peak_velocity")
_BESIDE = 20.0
"""How many times the error of the drifts, over their peaks, that of another motion may be: beyond, theirs is small by
chance, and what the run does not know of its error is more."""

_SURELY = 2.0
"""How many times what a run with a smaller step may itself be off by its corrected peaks are to differ by from those of
the run: by less these are not corrected. Of 384 velocities in frames ten got worse where once was enough, of
the drifts, by which it is told whether that run will do, one."""

_OF_DRIFT = ("peak_drift", "peak_drift_ratio", "ductility")

_TINY = np.finfo(float).tiny

_ROUNDING = 1e-12
"""Error over the peak that is always there."""


def checked_run(case: Case, steps: Steps, history: bool = False, *, repeat: bool = True) -> Response:
    """The response to `steps` with its error: the one that the run has carried along where the method does so, else by
    repetition. A note says why where it does not do for a method that could.

    Without `repeat` nothing is run again: errors that are not carried along are unknown, and there is no estimate for
    a method that never does.

    Raises
    ------
    FailedRun
        As from `Case.march`.
    """
    carrying, reason = case.carrying_error()
    response = _noted((carrying or case).march(steps, history))
    if response.check is not None:
        reason = doubt(response, case.building)
        if not reason:
            return response
        response = replace(
            response,
            check=None,
            history=response.history and response.history.without_error(),
            pieces=response.pieces and partial(_without_error, response.pieces),
        )
    if not repeat:
        return _unknown(response, f"{reason}; --check repeats the run") if carrying is not None else response
    if carrying is None:
        return checked(case, steps, _with_note(response, reason))
    return told_by_finer(response, _repetitions(carrying, replace(steps, count=response.steps)), reason)


def ended_at_rest(response: Response) -> Response:
    """The response of a run that has gone on until rest: its residual drifts are those at rest, from which what is left
    of the motion keeps them."""
    check = response.check
    if check is None:
        return response

    def with_rest(errors: StoryErrors) -> StoryErrors:
        moving = np.maximum(response.moving_drift, _COMMON * common(response.moving_drift, response.stories.peak_drift))
        return replace(errors, residual_drift=errors.residual_drift + moving)

    left = with_rest(check.left) if check.left else None
    return replace(response, check=replace(check, errors=with_rest(check.errors), left=left))


def told_by_finer(response: Response, finer_runs: Iterable[Response | FailedRun], reason: str) -> Response:
    """The response with the error that finer runs tell, for the `reason` that its own does not: the first one that
    carries its error along and whose step is not too long for that, else all of them as repetitions."""
    others: list[Response | FailedRun] = []
    for other in finer_runs:
        others.append(other)
        if isinstance(other, Response) and not _too_coarse(other) and _alike(response, other):
            note = f"the error comes from a run with dt {other.dt:.6g} s: {reason}"
            told = replace(response, notes=(*response.notes, note), check=_from_corrected(response, other))
            # The response with the errors of its history that a run with smaller steps tells.
            if told.pieces is None or other.pieces is None:
                return told
            ratio = round(told.dt / other.dt)
            history = told.history and _corrected_by(told.history, History.joined(other.pieces(ratio)))
            return replace(told, history=history, pieces=partial(_corrected_pieces, told.pieces, other.pieces, ratio))
    return with_check(_with_note(response, reason), others)


def _corrected_pieces(
    pieces: Callable[[int], Iterator[History]], others: Callable[[int], Iterator[History]], ratio: int, every: int = 1
) -> Iterator[History]:
    return map(_corrected_by, pieces(every), others(every * ratio))


def _corrected_by(history: History, other: History) -> History:
    """A history with its error, true less computed, where that which another run corrects to is true; at the same
    times."""
    assert other.error is not None
    errors = {
        quantity.name: getattr(other, quantity.name)
        + getattr(other.error, quantity.name)
        - getattr(history, quantity.name)
        for quantity in fields(ErrorHistory)
    }
    return replace(history, error=ErrorHistory(**errors))


def _with_note(response: Response, reason: str) -> Response:
    note = f"the error comes from repetitions of the run: {reason}"
    return replace(response, notes=(*response.notes, note)) if reason else response


def _from_corrected(response: Response, finer_run: Response) -> ErrorEstimate:
    """What the peaks of a run differ by from the corrected ones of a run with a smaller step, and what these may be off
    by: what they are corrected by. Where both end with a collapse, each at a step of its own, they are none of the
    first one's."""
    assert finer_run.check is not None and finer_run.check.corrected is not None and finer_run.check.left is not None
    errors, taken, off = {}, {}, {}
    for name in (field.name for field in fields(StoryErrors)):
        peaks, true, left = (
            getattr(of, name) for of in (response.stories, finer_run.check.corrected, finer_run.check.left)
        )
        size, shift = np.abs(_size(response, name)), np.abs(peaks - true)
        errors[name] = _with_unresolved(response, name, not_by_accident(shift + left, size) + _ROUNDING * size)
        surely = shift > (1.0 if name in _OF_DRIFT else _SURELY) * left
        taken[name] = np.where(surely, true, peaks)
        off[name] = np.where(surely, left, shift + left)
    told = ErrorEstimate.of(response.stories, StoryErrors(**errors), dts=(finer_run.dt,))
    if response.collapse is not None and response.collapse.ended:
        return told
    corrected = replace(finer_run.check.corrected, **taken)
    return replace(told, corrected=corrected, left=StoryErrors(**off))


def _noted(response: Response) -> Response:
    """With a note where the run ends with a collapse: at a step, and what grows until then goes by that."""
    if response.collapse is None or not response.collapse.ended:
        return response
    note = (
        f"the run ends with the step to {response.collapse.time:.6g} s, in which it collapses: what that adds to peaks "
        "that grow until then is no part of their errors"
    )
    return replace(response, notes=(*response.notes, note))


def _without_error(pieces: Callable[..., Iterator[History]], every: int = 1) -> Iterator[History]:
    return (piece.without_error() for piece in pieces(every))


def doubt(response: Response, building: Building) -> str:
    """Why the error that a run has carried along does not do, in words; empty if it does."""
    if reason := _too_coarse(response):
        return reason
    assert response.check is not None
    if response.check.doubtful is not None:
        story, time = response.check.doubtful
        return f"whether story {story} turns or fails about {time:.6g} s is within the one that it carries along"
    # After the peaks strides are long: the error of what is left says nothing of theirs.
    others = [name for name in _OF_MOTION if response.step_range is None or name != "residual_drift"]
    if not building.linear and _off(response, *others) > _BESIDE * _off(response, "peak_drift"):
        return "the one that it carries along all but vanishes where the drifts have their peaks"
    return ""


def _too_coarse(response: Response) -> str:
    """Why the step is too long for the error that a run has carried along to be told, in words."""
    check = response.check
    assert check is not None and check.drift_error is not None
    values = [getattr(check.errors, name) for name in ("peak_drift", "peak_shear", "peak_acceleration")]
    if not all(np.isfinite(value).all() for value in values):
        return "the one that it carries along ran away"
    if check.drift_error > TOLD:
        return f"the one that it carries along, {100.0 * check.drift_error:.2g} %, says only that the step is too long"
    return ""


def _off(response: Response, *names: str) -> float:
    """The largest error over the peak that a run has carried along to peaks of these names."""
    assert response.check is not None and response.check.shifts is not None
    shifts = response.check.shifts
    return max(float(np.max(getattr(shifts, name) / np.maximum(_size(response, name), _TINY))) for name in names)


def checked(case: Case, steps: Steps, response: Response) -> Response:
    """The response to `steps`, with the estimated errors of its peaks."""
    # A run that ended with a collapse is compared up to there.
    return with_check(response, list(_repetitions(case, replace(steps, count=response.steps))))


def _repetitions(case: Case, steps: Steps) -> Iterator[Response | FailedRun]:
    for _ in range(FINER):
        steps = finer(steps)
        yield attempt(case, steps)


def attempt(case: Case, steps: Steps) -> Response | FailedRun:
    """The response to `steps`, or why there is none."""
    try:
        return case.march(steps)
    except FailedRun as failure:
        return failure


def with_check(response: Response, finer_runs: list[Response | FailedRun]) -> Response:
    """The response with the errors that finer runs tell; unknown ones, and a note, where one of them failed."""
    others: list[Response] = []
    for other in finer_runs[:FINER]:
        if isinstance(other, FailedRun):
            return _unknown(response, f"the run with dt {other.dt:.6g} s failed ({other.status})")
        if not _alike(response, other):
            return _unknown(response, f"the run with dt {other.dt:.6g} s ends at another time")
        others.append(other)
    errors = story_errors(response, others)
    return replace(response, check=ErrorEstimate.of(response.stories, errors, dts=tuple(other.dt for other in others)))


def _alike(response: Response, other: Response) -> bool:
    """Whether a run with smaller steps ends when the other one does."""
    return abs(other.steps * other.dt - response.steps * response.dt) <= 0.5 * other.dt


def _unknown(response: Response, reason: str) -> Response:
    nothing = np.full_like(response.stories.peak_drift, np.nan)
    errors = StoryErrors(*(nothing for _ in fields(StoryErrors)))
    notes = (*response.notes, f"no error is estimated: {reason}")
    return replace(response, check=ErrorEstimate(errors, (), None, None), notes=notes)


def story_errors(response: Response | Shock, others: Sequence[Response | Shock]) -> StoryErrors:
    """The errors of the peaks of a run, or of a shock in it, that those with a half and a quarter of the step tell."""
    runs = [response.stories, *(other.stories for other in others)]

    def estimated(name: str) -> Array:
        coarse, half, quarter = (getattr(stories, name) for stories in runs)
        return _with_unresolved(response, name, estimate(coarse, half, quarter, _size(response, name)))

    return StoryErrors(**{field.name: estimated(field.name) for field in fields(StoryErrors)})


def _size(response: Response | Shock, name: str) -> Array:
    """What an error of a peak is compared with: the peak itself, of residual drifts that of the drift."""
    size: Array = getattr(response.stories, "peak_drift" if name == "residual_drift" else name)
    return size


def _with_unresolved(response: Response | Shock, name: str, error: Array) -> Array:
    """The error with what the steps do not resolve of a peak, or leave to a drift that is told later."""
    unresolved: Array = getattr(response.unresolved, name)
    return error + unresolved if name == "residual_drift" else np.maximum(error, unresolved)


def estimate(coarse: Array, half: Array, quarter: Array, size: Array) -> Array:
    """Estimated error of `coarse` from the same values with a half and a quarter of the step, arrays over the stories.

    `size` is what the errors are compared with between stories; where it is nan there is no estimate.
    """
    errors = np.maximum(4.0 / 3.0 * np.abs(coarse - half), np.abs(coarse - quarter) + np.abs(half - quarter))
    return np.asarray(np.maximum(errors, _COMMON * common(errors, size) + _ROUNDING * size))


def common(errors: Array, size: Array) -> Array:
    """The root mean square over the stories of errors relative to a size, times that size."""
    moved = size > 0.0
    relative = np.divide(errors, size, out=np.zeros_like(errors), where=moved)
    return np.asarray(np.sqrt(np.sum(relative**2) / max(np.count_nonzero(moved), 1)) * size)
