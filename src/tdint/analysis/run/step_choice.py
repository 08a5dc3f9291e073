"""Choose a large time step for which the estimated error of all peak drifts is within a tolerance.

Time steps are the requested time step or a few sampling intervals of the record, halved once or
several times. The search predicts how many halvings are needed from the ratio of the estimated
error to the tolerance and from the order that previous runs show. With `impulse4`, each run is
compared with the previous run, which has a longer time step, and the finer run is returned. With
any other method, the error is estimated by one run of `impulse4` with half the time step (see
`tdint.analysis.run.error_estimate`), and the run of the chosen method is returned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tdint.analysis.run.case import Case
from tdint.analysis.run.error_estimate import (
    EstimateFactors,
    attempt,
    reference,
    start_peaks,
    story_errors,
    with_error_estimate,
)
from tdint.analysis.run.outcome import NO_STEP, ErrorEstimate, FailedRun, Response, StepChoice
from tdint.analysis.time_steps import Steps, finer
from tdint.errors import UsageError

_FIRST_POWER, _FIRST_POWER_TIGHT = 2, 1
"""The first time step is 2**_FIRST_POWER sampling intervals, or 2**_FIRST_POWER_TIGHT for
tolerances below `_TIGHT`. With eight intervals, pairs of runs may agree by accident: of 181 random
buildings, six were beyond a tolerance of 3 %. With two, runs for large tolerances take longer."""

_TIGHT = 0.003
"""Tolerance below which the search starts with a shorter time step."""

_MAX_HALVINGS = 8
"""Maximum number of times that the sampling interval, or the requested time step, is halved."""

_FIRST_PAIR, _LATER_PAIR = 8.0 / 3.0, 2.0
"""Factors of the difference of a pair of runs, divided by its Richardson factor at second order,
r^2 - 1 for time steps with the ratio r. The result is the error of the finer run. The first factor
is used for the first pair, the second factor for pairs whose differences decrease."""

_SLOW_DECREASE = 4.0 / 3.0
"""If successive differences decrease by the factor R, the error is at least `_SLOW_DECREASE`
times the difference over R - 1, the Richardson factor at the observed order."""

_MIN_DECREASE = 4.0 / 3.0
"""Minimum value of R. Without a minimum, differences at the level of rounding errors would never be
accepted."""

_ORDERS = (1.0, 3.0)
"""Range of the order that predicts the next time step. `impulse4` and other methods of order 4 show
a lower order with long time steps."""

_MAX_JUMP, _MAX_JUMP_OF_PAIRS = 3, 2
"""Maximum number of halvings between two runs, without and with comparison to the previous run."""

_STEP_TOLERANCE = 1e-9
"""Relative tolerance for comparing numbers of steps."""


def choose_step(
    case: Case,
    tolerance: float,
    *,
    dt: float | None = None,
    duration: float | None = None,
    history: bool = False,
) -> Response:
    """Run the case with a large time step within the tolerance, and estimate the peak errors.

    Parameters
    ----------
    tolerance : float
        Maximum relative error of any peak drift.
    dt : float, optional
        Largest time step to try, s. Default: four sampling intervals of the record, or two for
        tolerances below 0.3 %.
    duration : float, optional
        Duration of the run, as in `Case.steps`.
    history : bool
        Keep the complete response history.

    Raises
    ------
    UsageError
        The tolerance is not between 0 and 1, or the time step is invalid.
    FailedRun
        No time step down to 1/256 of the sampling interval (or of `dt`) meets the tolerance, or all
        runs failed.
    """
    search = _Search.of(case, tolerance, dt, duration)
    level, response = search.within(math.inf)
    assert response.check is not None
    at_sampling_interval = search.runs.get(search.power)
    choice = StepChoice(
        tolerance=tolerance,
        runs=search.count,
        samples=search.steps(level).stride / search.steps(level).per_sample
        if case.record
        else None,
        solves_at_record=at_sampling_interval.iterations
        if isinstance(at_sampling_interval, Response)
        else None,
    )
    check = replace(response.check, step_choice=choice)
    return replace(
        case.integrate(search.steps(level), history) if history else response, check=check
    )


def step_within(
    case: Case,
    tolerance: float,
    *,
    dt: float | None = None,
    duration: float | None = None,
    largest: float = math.inf,
) -> float:
    """Return the time step of the search, s, that meets the tolerance and is at most `largest`.

    The other parameters and the exceptions are those of `choose_step`.
    """
    search = _Search.of(case, tolerance, dt, duration)
    return search.steps(search.within(largest)[0]).h


@dataclass
class _Search:
    """Runs with time steps that are halved once or several times.

    Level 0 has the time step `coarsest.h`, which is 2**power times the sampling interval or the
    requested time step. Each run ends at the requested end time, or less than one time step after
    it. `errors` contains the estimated errors by level, `pairs` the differences of pairs of runs
    with the numbers of halvings between the two runs.
    """

    case: Case
    tolerance: float
    coarsest: Steps
    power: int
    runs: dict[int, Response | FailedRun] = field(default_factory=dict)
    count: int = 0
    errors: dict[int, float] = field(default_factory=dict)
    pairs: list[tuple[float, int]] = field(default_factory=list)

    @classmethod
    def of(cls, case: Case, tolerance: float, dt: float | None, duration: float | None) -> _Search:
        """Validate the tolerance and the time step, and compile the time loops that the search
        needs."""
        if not 0.0 < tolerance < 1.0:
            raise UsageError(f"the tolerance must be between 0 and 1 (100 %), got {tolerance:g}")
        requested = case.steps(dt, duration)
        case.prepared.compile([case.method, reference(case).method])
        if dt is not None or case.model.analysis.dt is not None or case.record is None:
            return cls(case, tolerance, requested, 0)
        power = _FIRST_POWER if tolerance >= _TIGHT else _FIRST_POWER_TIGHT
        return cls(case, tolerance, case.steps(2**power * requested.h, duration), power)

    def steps(self, level: int) -> Steps:
        """Return the time steps of a level."""
        steps = self.coarsest
        for _ in range(level):
            steps = finer(steps)
        return replace(
            steps, count=max(1, math.ceil(steps.end / steps.h * (1.0 - _STEP_TOLERANCE)))
        )

    def run(self, level: int) -> Response | FailedRun:
        """Return the run of a level; each level is run at most once."""
        if level not in self.runs:
            self.runs[level] = attempt(self.case, self.steps(level))
            self.count += 1
        return self.runs[level]

    def within(self, largest: float) -> tuple[int, Response]:
        """Find the first level that meets the tolerance with a time step of at most `largest` (s).

        Returns the level and its run, with error estimates.
        """
        is_reference = reference(self.case).method == self.case.method
        first = (
            max(0, math.ceil(math.log2(self.coarsest.h / largest) - _STEP_TOLERANCE))
            if largest < math.inf
            else 0
        )
        # With the reference method, each run is compared with a run with a longer time step.
        first = max(first, 1) if is_reference else first
        last = max(self.power + _MAX_HALVINGS, first)
        previous, level = first - 1, first
        while True:
            response = (
                self._with_coarser_run(previous, level)
                if is_reference
                else self._with_reference(level)
            )
            check = response.check if isinstance(response, Response) else None
            error = check.drift_error if check else None
            if isinstance(response, Response) and error is not None and error <= self.tolerance:
                return level, response
            if level == last:
                break
            jump = self._halvings(level, error, is_reference)
            previous, level = level, min(level + jump, last)
        # No level meets the tolerance. Report the error of the run with the smallest time step, or
        # the reason why this run failed.
        if isinstance(response, FailedRun):
            raise response
        label, reached, story = self.case.method.label, "the error could not be estimated", None
        if check is not None and error is not None:
            story = check.drift_story
            reached = (
                f"the estimated error of the peak drift of story {story} is still "
                f"{100.0 * error:.2g} %"
            )
        message = (
            f"{label} does not reach the tolerance of {100.0 * self.tolerance:g} %: with dt = "
            f"{response.dt:.6g} s {reached}; increase the tolerance or use a higher-order method "
            "such as impulse4"
        )
        raise FailedRun(message, NO_STEP, label, response.dt, story=story)

    def _halvings(self, level: int, error: float | None, is_reference: bool) -> int:
        """Predict the number of halvings from a level to a level that meets the tolerance.

        Parameters
        ----------
        level : int
            Level that does not meet the tolerance.
        error : float or None
            Estimated error of this level; None leads to one halving.
        is_reference : bool
            True if runs are compared with the previous run. Jumps are then shorter, because the
            time steps of the two runs should be similar.
        """
        if error is None or not math.isfinite(error):
            return 1
        min_order, max_order = _ORDERS
        order = min(float(self.case.method.order), max_order)
        coarser = max((other for other in self.errors if other < level), default=None)
        if coarser is not None and self.errors[coarser] > error > 0.0:
            observed = math.log2(self.errors[coarser] / error) / (level - coarser)
            order = min(max(observed, min_order), max_order)
        self.errors[level] = error
        needed = math.ceil(math.log2(error / self.tolerance) / order)
        return min(max(needed, 1), _MAX_JUMP_OF_PAIRS if is_reference else _MAX_JUMP)

    def _with_coarser_run(self, previous: int, level: int) -> Response | FailedRun:
        """Run a level and estimate its errors from the run of the previous level, which has a
        longer time step."""
        coarse, response = self.run(previous), self.run(level)
        if isinstance(response, FailedRun) or isinstance(coarse, FailedRun):
            return response
        if abs(coarse.steps * coarse.dt - response.steps * response.dt) > coarse.dt:
            return response  # not comparable: one of the two runs ended early, by collapse
        difference = _difference(response, coarse)
        by = EstimateFactors(self._factor(difference, level - previous))
        start = start_peaks(self.case, self.steps(level))
        errors = story_errors(response, coarse, by, start=start, other_is_finer=False)
        self.pairs.append((difference, level - previous))
        dts = (coarse.dt, response.dt)
        return replace(
            response,
            check=ErrorEstimate.of(
                response.stories, errors, time_steps=dts, method=response.method
            ),
        )

    def _factor(self, difference: float, halvings: int) -> float:
        """Return the error of the finer run of a pair over the difference of the two runs.

        Parameters
        ----------
        difference : float
            Largest relative difference of the peak drifts of the pair.
        halvings : int
            Number of halvings between the two time steps.
        """
        richardson = 4.0**halvings - 1.0
        if not self.pairs:
            return _FIRST_PAIR / richardson
        earlier_difference, earlier_halvings = self.pairs[-1]
        decrease = math.pow(
            earlier_difference / max(difference, float(np.finfo(float).tiny)),
            halvings / earlier_halvings,
        )
        slow = _SLOW_DECREASE / (max(decrease, _MIN_DECREASE) - 1.0)
        return max(_LATER_PAIR / richardson, slow)

    def _with_reference(self, level: int) -> Response | FailedRun:
        """Run a level and estimate its errors by a run of the reference method."""
        response = self.run(level)
        if isinstance(response, FailedRun):
            return response
        self.count += 1
        return with_error_estimate(self.case, self.steps(level), response)


def _difference(response: Response, other: Response) -> float:
    """Return the largest relative difference of the peak drifts of two runs."""
    size = np.maximum(other.stories.peak_drift, np.finfo(float).tiny)
    return float(np.max(np.abs(response.stories.peak_drift - other.stories.peak_drift) / size))
