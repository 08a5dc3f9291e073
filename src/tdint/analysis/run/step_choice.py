"""The cheapest step of a run whose peak drifts are within a tolerance.

It is looked for among steps that are halves of one another, from four sampling intervals of the record on, or from the
step that was asked for. Of `impulse4` the next run in the row tells the errors, and is the one that is taken: a third
of what the pair tells is to be within the tolerance, or two thirds until pairs come closer. A run of another method is
taken itself, and one of `impulse4` with half of the step tells its errors (`tdint.analysis.run.error_estimate`).
"""

from __future__ import annotations

import math
from dataclasses import field, replace

import numpy as np

from tdint.analysis.run.case import Case
from tdint.analysis.run.error_estimate import attempt, reference, story_errors, told
from tdint.analysis.run.outcome import NO_STEP, ErrorEstimate, FailedRun, Response, StepChoice
from tdint.analysis.run.workspace import Steps, finer
from tdint.data import dataclass
from tdint.errors import UsageError

_COARSEST = 2
"""Of the sampling interval the power of 2 that is tried first: four of them. With eight, the first runs of most
buildings tell nothing; with two, those that four would do for take twice as long."""

_MOST_HALVINGS = 8
"""Halvings of the record's step, or of the one that was asked for, after which the search ends."""

_OF_FINER, _AT_FIRST = 4.0 / 9.0, 8.0 / 9.0
"""Error of the finer run of a pair over their difference, a third of the coarser one's as it is told, where order 2
leaves a quarter; and two thirds where the pair before has differed by less than `_CLOSER` times as much. Of 148 random
buildings, twice each, none is then beyond 1 or .1 %, for 5 to 10 % more steps in the mean than with a third, by which
two are: buildings that degrade may go another way with finer steps."""

_CLOSER = 4.0
"""Of order 2 the differences of pairs."""

_SAME = 1e-9
"""Numbers of steps that differ by less than this part are the same."""


def choose_step(
    case: Case,
    tolerance: float,
    *,
    dt: float | None = None,
    duration: float | None = None,
    history: bool = False,
) -> Response:
    """The response, with its errors, with the largest step in the row that keeps to a tolerance.

    Parameters
    ----------
    tolerance : float
        Largest estimated error of any peak drift over that drift.
    dt : float, optional
        The largest step to be tried, s; by default four sampling intervals of the record.
    duration : float, optional
        As for `Case.steps`.
    history : bool
        Keep the whole response.

    Raises
    ------
    UsageError
        A tolerance that is none; a step that does not fit.
    FailedRun
        No step down to a 256th of the record's, or of `dt`, is within it, or none gives a response.
    """
    search = _Search.of(case, tolerance, dt, duration)
    level, response = search.within(math.inf)
    assert response.check is not None
    usual = search.runs.get(search.power)  # with the record's step
    choice = StepChoice(
        tolerance=tolerance,
        runs=search.count,
        samples=search.steps(level).stride / search.steps(level).per_sample
        if case.record
        else None,
        solves_at_record=usual.iterations if isinstance(usual, Response) else None,
    )
    check = replace(response.check, choice=choice)
    return replace(case.march(search.steps(level), history) if history else response, check=check)


def step_within(
    case: Case,
    tolerance: float,
    *,
    dt: float | None = None,
    duration: float | None = None,
    largest: float = math.inf,
) -> float:
    """The step that `choose_step` takes, s, or the first one in its row that is no larger than `largest` and will do.

    Errors are those of `choose_step`.
    """
    search = _Search.of(case, tolerance, dt, duration)
    return search.steps(search.within(largest)[0]).h


@dataclass
class _Search:
    """Runs with steps that are halves of one another: of level 0 `coarsest`, 2^power times the record's or asked one.

    Each ends at the time that was asked for, or less than a step after it.
    """

    case: Case
    tolerance: float
    coarsest: Steps
    power: int
    runs: dict[int, Response | FailedRun] = field(default_factory=dict)
    count: int = 0

    @classmethod
    def of(cls, case: Case, tolerance: float, dt: float | None, duration: float | None) -> _Search:
        """Checked, and what it calls compiled."""
        if not 0.0 < tolerance < 1.0:
            raise UsageError(f"a tolerance lies between 0 and 1 (100 %), got {tolerance:g}")
        asked = case.steps(dt, duration)
        case.prepared.compile([case.method, reference(case).method])
        if dt is not None or case.model.analysis.dt is not None or case.record is None:
            return cls(case, tolerance, asked, 0)
        return cls(case, tolerance, case.steps(2**_COARSEST * asked.h, duration), _COARSEST)

    def steps(self, level: int) -> Steps:
        """The steps of a level."""
        steps = self.coarsest
        for _ in range(level):
            steps = finer(steps)
        return replace(steps, count=max(1, math.ceil(steps.end / steps.h * (1.0 - _SAME))))

    def run(self, level: int) -> Response | FailedRun:
        """The run of a level, made once."""
        if level not in self.runs:
            self.runs[level] = attempt(self.case, self.steps(level))
            self.count += 1
        return self.runs[level]

    def within(self, largest: float) -> tuple[int, Response]:
        """The first level with a step up to `largest` (s) that is within the tolerance, and its run with its errors."""
        by_itself = reference(self.case).method.label == self.case.method.label
        first = (
            max(0, math.ceil(math.log2(self.coarsest.h / largest) - _SAME))
            if largest < math.inf
            else 0
        )
        first = max(first, 1) if by_itself else first  # the finer one of a pair
        last = max(self.power + _MOST_HALVINGS, first)
        for level in range(first, last + 1):
            response = self._of_pair(level) if by_itself else self._told(level)
            check = response.check if isinstance(response, Response) else None
            off = check.drift_error if check else None
            if isinstance(response, Response) and off is not None and off <= self.tolerance:
                return level, response
        # None is: the last one says how far off it still is, or why there is none.
        if isinstance(response, FailedRun):
            raise response
        label, reached, story = self.case.method.label, "no error could be told", None
        if check is not None and off is not None:
            story = check.drift_story
            reached = f"the estimated error of the peak drift of story {story} is still {100.0 * off:.2g} %"
        message = (
            f"{label} does not come within {100.0 * self.tolerance:g} %: with dt {response.dt:.6g} s {reached}; "
            "allow a larger tolerance or use a method of higher order, such as impulse4"
        )
        raise FailedRun(message, NO_STEP, label, response.dt, story=story)

    def _of_pair(self, level: int) -> Response | FailedRun:
        """The run of a level with what the one before it, with twice the step, tells of its errors."""
        coarse, response = self.run(level - 1), self.run(level)
        if isinstance(response, FailedRun) or isinstance(coarse, FailedRun):
            return response
        if abs(coarse.steps * coarse.dt - response.steps * response.dt) > coarse.dt:
            return response  # a collapse ended one of them earlier
        before = self.runs.get(level - 2)
        closer = isinstance(before, Response) and _apart(before, coarse) > _CLOSER * _apart(
            coarse, response
        )
        errors = story_errors(response, coarse, _OF_FINER if closer else _AT_FIRST)
        dts = (coarse.dt, response.dt)
        return replace(
            response,
            check=ErrorEstimate.of(response.stories, errors, dts=dts, method=response.method),
        )

    def _told(self, level: int) -> Response | FailedRun:
        """The run of a level with the errors that one of the reference method tells."""
        response = self.run(level)
        if isinstance(response, FailedRun):
            return response
        self.count += 1
        return told(self.case, self.steps(level), response)


def _apart(response: Response, other: Response) -> float:
    """The largest difference of two runs' peak drifts over those of the other one."""
    size = np.maximum(other.stories.peak_drift, np.finfo(float).tiny)
    return float(np.max(np.abs(response.stories.peak_drift - other.stories.peak_drift) / size))
