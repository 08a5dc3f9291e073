"""Choose a large time step for which the estimated error of all peak drifts is within a tolerance.

Time steps are the requested time step or a few sampling intervals of the record, halved once or
several times. The search predicts how many halvings are needed from the ratio of the estimated
error to the tolerance and from the order that previous runs show. With `impulse4`, each run is
compared with the previous run, which has a longer time step, and the finer run is returned. With
any other method, the error is estimated by one run of `impulse4` with a shorter time step (see
`tdint.response.runs.error_estimate`), and the run of the chosen method is returned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tdint.errors import UsageError
from tdint.response.runs import error_estimate
from tdint.response.runs.case import Case
from tdint.response.runs.outcome import NO_STEP, ErrorEstimate, FailedRun, Response, StepChoice
from tdint.response.time_steps import Steps, finer

_FIRST_POWER, _FIRST_POWER_TIGHT = 2, 1
"""Exponents of the first time step: it is 2**_FIRST_POWER sampling intervals, or
2**_FIRST_POWER_TIGHT for tolerances below `_TIGHT`. With eight intervals, two
coarse runs may agree although both are wrong, and twice the number of results exceed the tolerance.
With two intervals, runs for tolerances of 1 % and more need 1.1 to 1.4 times the solves (566 random
buildings, see "Reliability of error estimates" in tests/MEASUREMENTS.md)."""

_TIGHT = 0.003
"""Tolerance below which the first time step is 2**_FIRST_POWER_TIGHT sampling intervals. At .3 %
itself, the first time step is four intervals."""

_MAX_HALVINGS = 8
"""Maximum number of times that the sampling interval, or the requested time step, is halved."""

_FIRST_PAIR, _LATER_PAIR = 8.0 / 3.0, 2.0
"""Safety factors of Richardson extrapolation at second order. The error of the finer run of a pair
is estimated as the difference of the two runs times the safety factor over r^2 - 1, where r is the
ratio of the time steps. `_FIRST_PAIR` applies to the first pair, for which the order is unknown,
and `_LATER_PAIR` to later pairs whose differences decrease fast (see `_SLOW_DECREASE`)."""

_SLOW_DECREASE = 4.0 / 3.0
"""Safety factor of Richardson extrapolation at the observed order. If the differences of successive
pairs decrease by the factor R, the error is at least `_SLOW_DECREASE` times the last difference
over R - 1."""

_MIN_DECREASE = 4.0 / 3.0
"""Minimum of R in the error estimate. Differences that consist of rounding errors do not decrease;
without a minimum, no run with such differences would be accepted."""

_ORDERS = (1.0, 3.0)
"""Minimum and maximum of the order of convergence that predicts the next time step. The observed
order of `impulse4` and of other fourth-order methods is lower with long time steps."""

_MAX_JUMP, _MAX_JUMP_OF_PAIRS = 3, 2
"""Maximum number of halvings from one run to the next. `_MAX_JUMP_OF_PAIRS` applies if a run is
compared with the previous run, because the time steps of a pair should be similar."""

_STEP_TOLERANCE = 1e-9
"""Relative tolerance for rounding errors in ratios of times and time steps."""


def choose_step(
    case: Case,
    tolerance: float,
    *,
    dt: float | None = None,
    duration: float | None = None,
    history: bool = False,
) -> Response:
    """Integrate a case with a large time step for which the estimated errors are small enough.

    Parameters
    ----------
    tolerance : float
        Maximum estimated error of the peak drift of any story, divided by this peak drift.
    dt : float, optional
        Largest time step to try, s. Default: four sampling intervals of the record, or two for
        tolerances below 0.3 %.
    history : bool, default False
        Keep the complete response history. The run with the selected time step is then repeated.

    Returns
    -------
    Response
        Response with the selected time step. Its `check` contains the estimated errors, and the
        selection as `check.step_choice`.

    Raises
    ------
    UsageError
        The tolerance is not between 0 and 1, or the time step is invalid.
    FailedRun
        No time step down to 1/256 of the sampling interval (or of `dt`) meets the tolerance, or the
        run with the smallest time step failed.
    """
    search = _Search.of(case, tolerance, dt, duration)
    level, response = search.within(math.inf)
    assert response.check is not None
    steps = search.steps(level)
    # The level `power` has the sampling interval (or the requested time step) as its time step. If
    # it was run, its number of equation solutions is reported for comparison.
    at_sampling_interval = search.runs.get(search.power)
    choice = StepChoice(
        tolerance=tolerance,
        runs=search.count,
        # Selected time step, in sampling intervals.
        samples=steps.stride / steps.per_sample if case.record else None,
        solves_at_record=at_sampling_interval.iterations
        if isinstance(at_sampling_interval, Response)
        else None,
    )
    check = replace(response.check, step_choice=choice)
    return replace(case.integrate(steps, history) if history else response, check=check)


def step_within(
    case: Case,
    tolerance: float,
    *,
    dt: float | None = None,
    duration: float | None = None,
    largest: float = math.inf,
) -> float:
    """Return the time step (s) that `choose_step` selects if no step may be longer than `largest`.

    Parameters
    ----------
    case, tolerance, dt, duration
        As for `choose_step`.
    largest : float
        Maximum time step, s; by default unlimited. The search starts at the first time step that
        does not exceed this maximum.

    Raises
    ------
    UsageError, FailedRun
        As by `choose_step`.
    """
    search = _Search.of(case, tolerance, dt, duration)
    return search.steps(search.within(largest)[0]).h


@dataclass
class _Search:
    """Search for a time step that meets a tolerance, by runs with time steps that are halved.

    A level is the number of halvings from the first time step. Each run ends at the requested end
    time, or less than one time step after it.

    Attributes
    ----------
    coarsest : Steps
        Time steps of level 0.
    power : int
        Level with a time step equal to the sampling interval, or the requested time step.
    runs : dict
        Response or failure of each level that has been run.
    count : int
        Number of runs, including the runs that estimate the errors of other methods.
    errors : dict
        Maximum estimated relative error of the levels that do not meet the tolerance.
    pairs : list of tuple
        For each pair of runs that has been compared, in order: the largest relative difference of
        the peak drifts, and the number of halvings between the two runs.
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
        """Return a search without runs, and compile the time loops that it needs. UsageError is
        raised if the tolerance is not between 0 and 1, or the time step is invalid.
        """
        if not 0.0 < tolerance < 1.0:
            raise UsageError(f"the tolerance must be between 0 and 1 (100 %), got {tolerance:g}")
        requested = case.steps(dt, duration)
        case.prepared.compile([case.method, error_estimate.reference_method(case)])
        if dt is not None or case.model.analysis.dt is not None or case.record is None:
            return cls(case, tolerance, requested, 0)
        # Without a requested time step, start with some sampling intervals of the record.
        power = _FIRST_POWER if tolerance >= _TIGHT else _FIRST_POWER_TIGHT
        return cls(case, tolerance, case.steps(2**power * requested.h, duration), power)

    def steps(self, level: int) -> Steps:
        """Return the time steps of a level.

        Halving doubles the number of steps. If the steps of level 0 end after the requested end, a
        shorter step needs fewer steps, so the number is computed again.
        """
        steps = self.coarsest
        for _ in range(level):
            steps = finer(steps)
        return replace(
            steps, count=max(1, math.ceil(steps.end / steps.h * (1.0 - _STEP_TOLERANCE)))
        )

    def run(self, level: int) -> Response | FailedRun:
        """Return the response or the failure of a level; it is cached, so each level runs only one
        time.
        """
        if level not in self.runs:
            self.runs[level] = error_estimate.attempt(self.case, self.steps(level))
            self.count += 1
        return self.runs[level]

    def within(self, largest: float) -> tuple[int, Response]:
        """Return a level that meets the tolerance with a time step of at most `largest` (s; inf for
        no maximum), and its response with error estimates.

        The search estimates the errors of a level, and predicts the number of levels to skip. A
        skipped level with a longer step could also meet the tolerance. The last level is
        `_MAX_HALVINGS` levels after the level `power`, but at least the first estimated level.

        Raises
        ------
        FailedRun
            No level up to the last meets the tolerance, or the run of the last level failed.
        """
        is_reference = error_estimate.reference_method(self.case) == self.case.method
        # A run of the reference method (`impulse4`) is compared with the previous run, which has a
        # longer time step; the first level is then at least 1. A run of another method is compared
        # with an additional run of the reference method; `previous` is then not used.
        first = self._first_level(largest, is_reference)
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
                raise self._failure(response)
            jump = self._halvings(level, error, is_reference)  # at least 1
            previous, level = level, min(level + jump, last)

    def _first_level(self, largest: float, is_reference: bool) -> int:
        """Return the first level with error estimates.

        `largest` is the maximum time step, s. `is_reference` is True if runs are compared with the
        previous run.
        """
        halvings = 0
        if largest < math.inf:
            halvings = math.ceil(math.log2(self.coarsest.h / largest) - _STEP_TOLERANCE)
        return max(halvings, 1 if is_reference else 0)

    def _failure(self, response: Response | FailedRun) -> FailedRun:
        """Return the failure of a search without a level that meets the tolerance.

        `response` is the result of the level with the smallest time step.
        """
        if isinstance(response, FailedRun):
            return response
        check = response.check
        label, reached, story = self.case.method.label, "the error could not be estimated", None
        if check is not None and check.drift_error is not None:
            story = check.drift_story
            reached = (
                f"the estimated error of the peak drift of story {story} is still "
                f"{100.0 * check.drift_error:.2g} %"
                if math.isfinite(check.drift_error)
                else f"story {story} has no drift in this run"
            )
        message = (
            f"{label} does not reach the tolerance of {100.0 * self.tolerance:g} %: with dt = "
            f"{response.dt:.6g} s {reached}; increase the tolerance or use a higher-order method "
            "such as impulse4"
        )
        return FailedRun(message, NO_STEP, label, response.dt, story=story)

    def _halvings(self, level: int, error: float | None, is_reference: bool) -> int:
        """Predict the number of halvings from a level that does not meet the tolerance to a level
        that meets it, and store the estimated error of the level.

        The prediction uses the order that the errors at this level and at the previous level show.
        Jumps are shorter if runs are compared with the previous run, because the time steps of the
        two runs should be similar.
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
        # At order p, each halving divides the error by 2^p.
        needed = math.ceil(math.log2(error / self.tolerance) / order)
        return min(max(needed, 1), _MAX_JUMP_OF_PAIRS if is_reference else _MAX_JUMP)

    def _with_coarser_run(self, previous: int, level: int) -> Response | FailedRun:
        """Return the response of a level with errors estimated from its difference to the response
        of the previous level, which is added to `pairs`.

        The response has no error estimates if the previous run failed, or if one of the two runs
        ended early by a collapse. The result is a failure if the run of `level` failed.
        """
        coarse, response = self.run(previous), self.run(level)
        if isinstance(response, FailedRun) or isinstance(coarse, FailedRun):
            return response
        if abs(coarse.steps * coarse.dt - response.steps * response.dt) > coarse.dt:
            return response
        difference = _difference(response, coarse)
        factors = error_estimate.EstimateFactors(self._factor(difference, level - previous))
        start = error_estimate.start_peaks(self.case, self.steps(level))
        errors = error_estimate.story_errors(
            response, coarse, factors, start=start, other_is_finer=False
        )
        self.pairs.append((difference, level - previous))
        check = ErrorEstimate.of(
            response.stories,
            errors,
            time_steps=(coarse.dt, response.dt),
            method=response.method,
        )
        return replace(response, check=check)

    def _factor(self, difference: float, halvings: int) -> float:
        """Return the estimated error of the finer run of a pair divided by the difference."""
        # Denominator of Richardson extrapolation at second order, r^2 - 1 with r = 2^halvings.
        richardson = 4.0**halvings - 1.0
        if not self.pairs:
            return _FIRST_PAIR / richardson
        earlier_difference, earlier_halvings = self.pairs[-1]
        # Convert the decrease of the differences since the earlier pair to the halvings of the
        # present pair.
        decrease = math.pow(
            earlier_difference / max(difference, float(np.finfo(float).tiny)),
            halvings / earlier_halvings,
        )
        slow = _SLOW_DECREASE / (max(decrease, _MIN_DECREASE) - 1.0)
        return max(_LATER_PAIR / richardson, slow)

    def _with_reference(self, level: int) -> Response | FailedRun:
        """Return the response of a level with errors from an additional run of the reference
        method, or the failure of the level.
        """
        response = self.run(level)
        if isinstance(response, FailedRun):
            return response
        self.count += 1
        return error_estimate.with_error_estimate(self.case, self.steps(level), response)


def _difference(response: Response, other: Response) -> float:
    """Return the maximum over the stories of |P - P1| / P1 for the peak drifts P and P1 of
    `response` and `other`.
    """
    # A story without drift has the difference 0.
    size = np.maximum(other.stories.peak_drift, np.finfo(float).tiny)
    return float(np.max(np.abs(response.stories.peak_drift - other.stories.peak_drift) / size))
