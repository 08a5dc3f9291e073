"""How far off the peaks of a run are: the run is repeated with smaller steps, or the step chosen by what they say.

With the peaks P0, P1, P2 of runs with the steps h, h/2 and h/4 the error of P0 is estimated as

    max(4/3 |P0 - P1|, |P0 - P2| + |P1 - P2|)

The first is Richardson's extrapolation for order 2, the lowest order of the catalogue. The second is a bound where P2
is off by no more than its own last change, which holds for every order from 1; it catches a P1 that agrees with P0 by
accident, as happens where yielding leaves no order to observe, or where a peak is only seen at the steps. Accidents of
all three are caught by the stories beside: no error is taken for less than a part of their root mean square, relative
to the peaks. A peak that is only seen at the steps may lie h/8 beside one of P2, where an oscillation with omega is
less by (omega h)^2 / 128 of it; no smaller error is taken for such a peak. Higher orders are not counted on: a declared
order 4 is lost at the first kink that is not located.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import ErrorEstimate, FailedRun, Response, StoryErrors
from tdint.analysis.run.steps import Steps, finer
from tdint.errors import UsageError

Array = NDArray[np.float64]

_FINER = 2
"""Repetitions with smaller steps."""

_COMMON = 0.3
"""Part of the stories' root mean square error below which none is estimated."""

_UNSEEN = 1.0 / 128.0
"""Part of a peak that may lie between the steps of all runs, over (omega h)^2; up to omega h = 1."""

_AT_STEPS = ("peak_velocity", "peak_acceleration")
"""Peaks that are those at the steps."""

_ROUNDING = 1e-12
"""Error over the peak that is always there."""

_MOST_HALVINGS = 8
"""How often a tolerance may halve the step; the finest run then has a thousandth of the first step."""


def checked(case: Case, steps: Steps, response: Response) -> Response:
    """The response to `steps`, with the estimated errors of its peaks."""
    # A run that ended with a collapse is compared up to there.
    return _with_check(response, list(_repetitions(case, replace(steps, count=response.steps))))


def _repetitions(case: Case, steps: Steps) -> Iterator[Response | FailedRun]:
    for _ in range(_FINER):
        steps = finer(steps)
        yield _attempt(case, steps)


def _attempt(case: Case, steps: Steps) -> Response | FailedRun:
    try:
        return case.march(steps)
    except FailedRun as failure:
        return failure


def within(case: Case, steps: Steps, tolerance: float, history: bool = False) -> Response:
    """The response with the first step, from `steps` on by halves, whose peak drifts are within a tolerance.

    Parameters
    ----------
    tolerance : float
        Largest estimated error of any peak drift over that drift.

    Raises
    ------
    FailedRun
        No step down to a 256th is within it, or none gives a response.
    """
    if not 0.0 < tolerance < 1.0:
        raise UsageError(f"a tolerance lies between 0 and 1 (100 %), got {tolerance:g}")
    ladder = [steps]
    runs = [_attempt(case, steps)]
    failure: FailedRun | None = None
    for level in range(_MOST_HALVINGS + 1):
        while len(runs) <= level + _FINER:
            ladder.append(finer(ladder[-1]))
            runs.append(_attempt(case, ladder[-1]))
        reached = runs[level]
        if isinstance(reached, FailedRun):
            failure = reached
            continue
        response = _with_check(reached, runs[level + 1 :])
        check = response.check
        assert check is not None
        if check.drift_error is not None and check.drift_error <= tolerance:
            kept = case.march(ladder[level], True) if history else response
            return replace(kept, check=replace(check, tolerance=tolerance))
        failure = _not_reached(case, ladder[level], tolerance, check)
    assert failure is not None
    raise failure


def _not_reached(case: Case, steps: Steps, tolerance: float, check: ErrorEstimate) -> FailedRun:
    reached = "no error could be estimated"
    if check.drift_error is not None:
        reached = (
            f"the estimated error of the peak drift of story {check.drift_story} is still "
            f"{100.0 * check.drift_error:.2g} %"
        )
    message = (
        f"{case.integrator.label} does not come within {100.0 * tolerance:g} %: with dt {steps.h:.6g} s {reached}; "
        "allow a larger tolerance or use a method of higher order, such as impulse4"
    )
    return FailedRun(message, "not-within-tolerance", case.integrator.label, steps.h, story=check.drift_story)


def _with_check(response: Response, finer_runs: list[Response | FailedRun]) -> Response:
    """The response with the errors that finer runs tell; unknown ones, and a note, where one of them failed."""
    end = response.steps * response.dt
    others: list[Response] = []
    for other in finer_runs[:_FINER]:
        if isinstance(other, FailedRun):
            return _unknown(response, f"the run with dt {other.dt:.6g} s failed ({other.status})")
        if abs(other.steps * other.dt - end) > 0.5 * other.dt:
            return _unknown(response, f"the run with dt {other.dt:.6g} s ends at another time")
        others.append(other)
    errors = _errors(response, others)
    drift = response.stories.peak_drift
    relative = np.divide(errors.peak_drift, drift, out=np.zeros_like(drift), where=drift > 0.0)
    worst = int(np.argmax(relative))
    return replace(
        response, check=ErrorEstimate(errors, tuple(other.dt for other in others), float(relative[worst]), worst + 1)
    )


def _unknown(response: Response, reason: str) -> Response:
    nothing = np.full_like(response.stories.peak_drift, np.nan)
    errors = StoryErrors(*(nothing for _ in fields(StoryErrors)))
    notes = (*response.notes, f"no error is estimated: {reason}")
    return replace(response, check=ErrorEstimate(errors, (), None, None), notes=notes)


def _errors(response: Response, others: list[Response]) -> StoryErrors:
    runs = [response.stories, *(other.stories for other in others)]
    velocity, acceleration = response.stories.peak_velocity, response.stories.peak_acceleration
    advance = np.divide(response.dt * acceleration, velocity, out=np.zeros_like(velocity), where=velocity > 0.0)
    unseen = _UNSEEN * np.minimum(advance, 1.0) ** 2  # omega is about that of the floor

    def estimated(name: str) -> Array:
        coarse, half, quarter = (getattr(stories, name) for stories in runs)
        size = response.stories.peak_drift if name == "residual_drift" else coarse
        found = estimate(coarse, half, quarter, size)
        return np.maximum(found, unseen * coarse) if name in _AT_STEPS else found

    return StoryErrors(**{field.name: estimated(field.name) for field in fields(StoryErrors)})


def estimate(coarse: Array, half: Array, quarter: Array, size: Array) -> Array:
    """Estimated error of `coarse` from the same values with a half and a quarter of the step, arrays over the stories.

    `size` is what the errors are compared with between stories; where it is nan there is no estimate.
    """
    own = np.maximum(4.0 / 3.0 * np.abs(coarse - half), np.abs(coarse - quarter) + np.abs(half - quarter))
    known = size > 0.0
    relative = np.divide(own, size, out=np.zeros_like(own), where=known)
    common = np.sqrt(np.sum(relative**2) / max(np.count_nonzero(known), 1))
    return np.asarray(np.maximum(own, (_COMMON * common + _ROUNDING) * size))
