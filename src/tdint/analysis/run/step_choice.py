"""The cheapest step of a run whose peak drifts are within a tolerance.

It is looked for among steps that are halves of one another, from a coarse one on: several sampling intervals of the
record, as far as the building's first mode allows, or the step that was asked for. Each is judged by runs with its half
and its quarter, which are the next ones in the row, or by the error that its own run, or the next one, carries along:
to come down from far above costs little more than to begin at the step that is taken.

moment4, which carries its error along, chooses its steps on the way instead (`tdint.kernels.march.strides`): a sampling
interval halved or doubled so many times, long where the motion is weak. What a stride may miss goes with the tolerance;
whether that was little enough the error says to which the run has come, else it is made again with less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tdint.analysis.run.case import Case
from tdint.analysis.run.error_estimate import FINER, TOLD, attempt, checked_run, doubt, told_by_finer, with_check
from tdint.analysis.run.outcome import NO_STEP, FailedRun, Response, StepChoice
from tdint.analysis.run.workspace import MOST_STEPS, Bound, Steps, choose_steps, finer
from tdint.analysis.spectra.elastic import spectrum
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as at

_PER_PERIOD = 8.0
"""Steps in the building's first period, at least, to begin with; half as many are tried if that will do."""

_FEWEST = 4.0
"""Steps in that period below which none is tried."""

_SAME = 1e-9
"""Numbers of steps that differ by less than this part are the same."""

_MOST_HALVINGS = 8
"""Halvings of the record's step, or of the one that was asked for, after which the search ends."""

_MISSED = 100.0
"""What a stride may miss, over the tolerance."""

_LONGEST = 0.5
"""The longest stride over the first period and the fourth root of what strides may miss; it is a sample at least."""

_LEAST = 0.25
"""Part of the peak drifts of the elastic first mode that stories are taken to come to at least: quiet starts need not
be followed as closely as what comes."""

_TRIES = 3
"""Runs with steps chosen on the way, until one is within the tolerance."""

_AIM = 2.0 / 3.0
"""Error over the tolerance that a run may tell: it may be told too small."""

_AGAIN = 1.0 / 16.0
"""What strides may miss, over that of the run before, where its error is in doubt: half of the strides."""


def choose_step(
    case: Case,
    tolerance: float,
    *,
    dt: float | None = None,
    duration: float | None = None,
    history: bool = False,
    equal: bool = False,
) -> Response:
    """The response, checked, with steps chosen on the way, or the largest equal one, that keep to a tolerance.

    Parameters
    ----------
    tolerance : float
        Largest estimated error of any peak drift over that drift.
    dt : float, optional
        The largest step to be tried, s; by default one of several sampling intervals of the record.
    duration : float, optional
        As for `Case.steps`.
    history : bool
        Keep the whole response, at equal steps.
    equal : bool
        Take equal steps in any case.

    Raises
    ------
    UsageError
        A tolerance that is none; a step that does not fit.
    FailedRun
        No step down to a 256th of the record's, or of `dt`, is within it, or none gives a response.
    """
    _check(tolerance)
    why = ""
    if dt is None and case.model.analysis.dt is None:
        chosen = _on_the_way(case, tolerance, duration, equal or history)
        if isinstance(chosen, Response):
            return chosen
        why = chosen
    search, level = _searched(case, tolerance, dt, duration, math.inf)
    response = search.taken(level, history)
    return replace(response, notes=(*response.notes, why)) if why else response


def step_within(
    case: Case, tolerance: float, *, dt: float | None = None, duration: float | None = None, largest: float = math.inf
) -> float:
    """The step that `choose_step` takes, s, or the first one in its row that is no larger than `largest` and will do.

    Errors are those of `choose_step`.
    """
    search, level = _searched(case, tolerance, dt, duration, largest)
    return search.steps(level).h


def _check(tolerance: float) -> None:
    if not 0.0 < tolerance < 1.0:
        raise UsageError(f"a tolerance lies between 0 and 1 (100 %), got {tolerance:g}")


def _on_the_way(case: Case, tolerance: float, duration: float | None, equal: bool) -> Response | str:
    """The response with steps chosen on the way; why there is none, or nothing where the method has none."""
    carrying, _ = case.carrying_error()
    record = case.record
    if carrying is None or record is None:
        return ""
    if equal:
        return "the steps are equal, for a history or a sequence; without one moment4 chooses them on the way"
    asked = case.steps(None, duration)
    if asked.count * 2**_MOST_HALVINGS > MOST_STEPS:
        return "the steps are equal, for there are too many of them"
    units = choose_steps(record.dt / 2**_MOST_HALVINGS, asked.count * asked.h, record.dt, record.duration)
    drifts, aim = _least_drifts(case), _AIM * min(tolerance, TOLD)
    allowed = _MISSED * aim
    for runs in range(1, _TRIES + 1):
        # The error goes with the fourth power of a stride: so does its largest length with what may be missed.
        longest = math.log2(_LONGEST * case.prepared.period * allowed**0.25 / units.h)
        steps = replace(
            units, stride=2 ** max(math.floor(longest), _MOST_HALVINGS), bound=Bound(allowed, drifts), end=asked.end
        )
        response = attempt(carrying, steps)
        if isinstance(response, FailedRun) or response.check is None or (response.collapse and response.collapse.ended):
            break
        error = response.check.drift_error
        if error is not None and error <= aim and not doubt(response, case.building):
            choice = StepChoice(tolerance, runs, samples=None, solves_at_record=None)
            return replace(response, check=replace(response.check, choice=choice))
        # Again with what would have met the aim, for the error goes with what a stride may miss.
        allowed *= max(_AIM * aim / error, 0.01) if error is not None and error > aim else _AGAIN
    return "the steps are equal, for those chosen on the way did not come within the tolerance"


def _least_drifts(case: Case) -> Array:
    """A part of the peak drifts of the elastic first mode, m; shape (n,)."""
    assert case.record is not None
    omega, damping = case.building.first_mode()
    try:
        largest = float(spectrum(case.record, np.array([2.0 * math.pi / omega]), damping).sd[0])
    except (AnalysisError, UsageError):  # no oscillator, such as a period too short for the motion
        largest = case.record.pga / omega**2
    shape = case.building.vibration.first[1]
    drifts = shape - case.building.linear_terms[at.LINK, :-1] * np.concatenate([[0.0], shape[:-1]])
    part = _LEAST * largest * float(case.building.mass @ shape)
    return np.asarray(np.maximum(part * np.abs(drifts), np.finfo(float).tiny))


def _searched(
    case: Case, tolerance: float, dt: float | None, duration: float | None, largest: float
) -> tuple[_Search, int]:
    """The search, and the level that it finds among steps up to `largest`."""
    _check(tolerance)
    asked = case.steps(dt, duration)
    fixed = dt is not None or case.model.analysis.dt is not None or case.record is None
    search = _Search(case, tolerance, asked, 0 if fixed else _samples(case, asked, _PER_PERIOD))
    begin = max(0, math.ceil(math.log2(search.steps(0).h / largest) - _SAME)) if largest < math.inf else 0
    level = search.first_within(begin)
    if not fixed and level == 0:
        allowed = math.log2(largest / asked.h) + _SAME
        level = search.coarser(min(_samples(case, asked, _FEWEST), allowed))
    return search, level


def _samples(case: Case, asked: Steps, per_period: float) -> int:
    """The power of 2, at least 0, of sampling intervals that go into a part of the first period and are stable."""
    period = 2.0 * math.pi / float(case.building.modes().omega[0])
    power = max(0, math.floor(math.log2(max(period / per_period / asked.h, 1.0))))
    while power and asked.count >> power < 2:
        power -= 1
    while power and not case.allow_unstable and case.prepared.instability(case.method, asked.h * 2**power):
        power -= 1
    return power


@dataclass
class _Search:
    """Runs with steps that are halves of one another: `level` 0 has 2^power times the step that was asked for."""

    case: Case
    tolerance: float
    asked: Steps
    power: int
    runs: dict[int, Response | FailedRun] = field(default_factory=dict)

    def steps(self, level: int) -> Steps:
        """The steps of a level; all levels end at the same time."""
        record = self.case.record
        steps = self.asked
        if self.power and record:
            end = self.asked.count * self.asked.h
            steps = choose_steps(record.dt * 2**self.power, end, record.dt, record.duration)
        for _ in range(level):
            steps = finer(steps)
        return steps

    def checked(self, level: int) -> Response | FailedRun:
        """The response of a level with its estimated errors."""
        run = self._telling(level)
        if isinstance(run, FailedRun):
            return run
        if run is not None:
            reason = doubt(run, self.case.building)
            others = map(self._telling, range(level + 1, level + FINER + 1))
            return told_by_finer(run, (half for half in others if half is not None), reason) if reason else run
        for finer_level in range(level, level + FINER + 1):
            if finer_level not in self.runs:
                self.runs[finer_level] = attempt(self.case, self.steps(finer_level))
        response = self.runs[level]
        if isinstance(response, FailedRun):
            return response
        return with_check(response, [self.runs[level + half] for half in range(1, FINER + 1)])

    def _telling(self, level: int) -> Response | FailedRun | None:
        """The run of a level, which tells its error unless it was made to tell that of another; None if none does."""
        carrying, _ = self.case.carrying_error()
        if carrying is not None and level not in self.runs:
            self.runs[level] = attempt(carrying, self.steps(level))
        return None if carrying is None else self.runs[level]

    def within(self, level: int) -> bool:
        """Whether a level is within the tolerance. Of a run that says only that its step is too long nobody asks how
        much, where that is beyond the tolerance."""
        run = self._telling(level)
        error = run.check.drift_error if isinstance(run, Response) and run.check else None
        if error is not None and self.tolerance <= TOLD and not error <= TOLD:
            return False
        response = self.checked(level)
        if isinstance(response, FailedRun) or response.check is None or response.check.drift_error is None:
            return False
        return response.check.drift_error <= self.tolerance

    def first_within(self, begin: int) -> int:
        """The first level from `begin` on that is within the tolerance."""
        last = max(self.power + _MOST_HALVINGS, begin)
        for level in range(begin, last + 1):
            if self.within(level):
                return level
        response = self.checked(last)
        if isinstance(response, FailedRun):
            raise response
        check, label = response.check, self.case.method.label
        assert check is not None
        reached = "no error could be estimated"
        if check.drift_error is not None:
            reached = (
                f"the estimated error of the peak drift of story {check.drift_story} is still "
                f"{100.0 * check.drift_error:.2g} %"
            )
        message = (
            f"{label} does not come within {100.0 * self.tolerance:g} %: with dt {response.dt:.6g} s {reached}; "
            "allow a larger tolerance or use a method of higher order, such as impulse4"
        )
        raise FailedRun(message, NO_STEP, label, response.dt, story=check.drift_story)

    def coarser(self, power: float) -> int:
        """Go on to larger steps, up to 2^power sampling intervals, while they are within the tolerance. The level."""
        while self.power + 1 <= power:
            # Runs that the coarser search has in common with this one are not made again.
            other = _Search(self.case, self.tolerance, self.asked, self.power + 1)
            if other.steps(1) == self.steps(0):
                other.runs = {level + 1: run for level, run in self.runs.items()}
            within = other.within(0)
            self.power, self.runs = other.power, other.runs
            if not within:
                return 1
        return 0

    def taken(self, level: int, history: bool) -> Response:
        """The response of a level, over the time that was asked for."""
        checked = self.checked(level)
        assert isinstance(checked, Response) and checked.check is not None
        steps = self.steps(level)
        # All levels end with whole steps of the coarsest one, which may be after the time that was asked for.
        end = self.asked.count * self.asked.h
        steps = replace(steps, count=min(steps.count, math.ceil(end / steps.h * (1.0 - _SAME))))
        kept = checked
        if steps.count != self.steps(level).count:
            kept = checked_run(self.case, steps, history)
        elif history:
            kept = replace(self.case.march(steps, history), check=checked.check)
        usual = self.runs.get(self.power)  # with the record's step
        choice = StepChoice(
            tolerance=self.tolerance,
            runs=len(self.runs),
            samples=steps.stride / steps.per_sample if self.case.record else None,
            solves_at_record=usual.iterations if isinstance(usual, Response) else None,
        )
        assert kept.check is not None
        return replace(kept, check=replace(kept.check, choice=choice))
