"""Work against precision: what methods cost and how much they err on one problem, step by step."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import takewhile

import numpy as np

from tdint import system
from tdint.analysis.chart.problem import (
    Problem,
    Reference,
    RelativeErrors,
    ending_together,
    errors,
    errors_of_peaks,
    find_reference,
    pose,
)
from tdint.analysis.given import AnyModel, AnyRecord, model_of, numbers_of, ratio_of, record_of
from tdint.analysis.run.error_estimate import attempt
from tdint.analysis.run.outcome import FailedRun, Response
from tdint.analysis.run.workspace import Steps, unsupported_reason
from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.methods.catalogue import chosen, parse
from tdint.methods.method import Integrator
from tdint.model.damage_states import DONE
from tdint.tabular import Progress as Counted
from tdint.tabular import Tabular, told_progress
from tdint.written_numbers import how_many

USUAL = "newmark-average"
"""What most programs do unless told otherwise, at the record's step."""

DEFAULT_METHODS = (
    "impulse4",
    "moment4",
    "impulse",
    USUAL,
    "newmark-linear",
    "central-difference",
    "noh-bathe",
    "generalized-alpha",
    "bathe",
    "gauss4",
    "exact",
)
"""Methods that are charted unless some are asked for; `exact` for linear buildings only."""

COARSEST = 8
"""The largest of the steps by default, over the record's."""

HALVINGS = 7
"""How often it is halved by default."""

CHOOSING = ("moment4", "impulse4")
"""Methods whose lines `with_tolerances` adds."""

BY_TOLERANCE = " by tolerance"
"""Behind the method in the name of such a line."""

_BETWEEN = (6.0, 3.0, 1.0 / 3.0, 1.0 / 6.0, 1.0 / 12.0)
_WITH_BETWEEN = 1.7  # times the steps without these

_SECONDS = 30.0  # for the marches of a chart by default, roughly
_STORY_STEP = 6e-8  # s, of one step of one story, roughly

_SAME_COST = 1.1  # times on a shared machine scatter by 10 %
_MORE_REPEATS = 4  # times the repeats that are asked for, at most
_COMPILED, _PREPARED = (
    0.1,
    0.25,
)  # of all work, when the methods are compiled and when there is a reference

Progress = Callable[[str, float], None]
"""Told what is being done and how much of it is done, from 0 to 1."""


def silent(act: str, part: float) -> None:
    """Nobody is told of progress."""


NOT_RUN = "not-run"
"""Outcome of a point whose run was not begun, because runs with larger steps took the time."""


@dataclass(frozen=True)
class Point:
    """One method with one step.

    Attributes
    ----------
    method, line : str
        The method with its parameters; the line of the chart that the point belongs to: the same
        but for what chooses its steps by a tolerance.
    dt : float
        Time step, s; nan for a method that chooses its own.
    steps, iterations : int
        Steps, None where they were not counted; solves, None where the march did not reach its end.
    times, walls : tuple of float
        Times of the march alone, s, one per repeat: by `tdint.system.clock`, and on the wall.
    errors : RelativeErrors or None
        `Errors` of one problem, `PeakErrors` of one of many; None where the march has no result, or
        did not reach its end.
    outcome : str
        How `tdint run` ends: `done`, `collapsed`, `unstable-step` (refused), `diverged` or
        `not-converged`. Of other programs also `not-run`: larger steps took the time.
    """

    method: str
    dt: float
    steps: int | None
    outcome: str
    iterations: int | None = None
    errors: RelativeErrors | None = None
    times: tuple[float, ...] = ()
    walls: tuple[float, ...] = field(default=(), kw_only=True)
    line: str = field(default="", kw_only=True)

    def error(self, quantity: str) -> float:
        """The error of one quantity, as `Errors.of` names it; nan for none."""
        return math.nan if self.errors is None else self.errors.of(quantity)

    @property
    def time(self) -> float:
        """Median of the times, s; nan for none."""
        return statistics.median(self.times) if self.times else math.nan

    @property
    def fastest(self) -> float:
        """Least of the times, s: what the march costs when nothing else disturbs; nan for none."""
        return min(self.times, default=math.nan)


@dataclass(frozen=True)
class Timing:
    """How the marches of a chart were timed.

    Attributes
    ----------
    clock : str
        As `tdint.system.clock` has it.
    repeats : tuple of int
        How often each march was timed, the least and the most.
    load : float or None
        Of the machine when they ended: processes that ran or waited in the minute before, this one
        among them.
    processor, processors : str, int
        Its name, and how many of them this process may use.
    stretch : float or None
        Wall time over processor time of all marches; None where the clock is that of the wall.
    """

    clock: str
    repeats: tuple[int, int]
    load: float | None
    processor: str
    processors: int
    stretch: float | None

    @classmethod
    def of(cls, points: Iterable[Point]) -> Timing:
        """Of the points of a chart, now that they have been timed."""
        timed = [point for point in points if point.times]
        counts = [len(point.times) for point in timed] or [0]
        taken = sum(sum(point.times) for point in timed)
        walls = sum(sum(point.walls) for point in timed)
        told = system.clock() == "thread_time" and taken > 0.0 and walls > 0.0
        return cls(
            system.clock(),
            (min(counts), max(counts)),
            system.load(),
            system.processor(),
            system.processors(),
            walls / taken if told else None,
        )

    @property
    def told(self) -> str:
        """The number of times, and how busy the machine was, in words."""
        times = " to ".join(str(count) for count in dict.fromkeys(self.repeats))
        load = (
            ""
            if self.load is None
            else f", load {self.load:.1f} on {how_many(self.processors, 'processor')}"
        )
        return f"least of {times} times{load}"

    @property
    def disturbed(self) -> bool:
        """Whether other work had the processors for more than a tenth of the time."""
        return self.stretch is not None and self.stretch > _SAME_COST


@dataclass(frozen=True)
class Peer:
    """Another program in a chart: its name, which lines begin with, its version, and in words its
    settings and what of it is timed."""

    name: str
    version: str
    settings: str
    timed: str


@dataclass(frozen=True, repr=False)
class Chart(Tabular):
    """All points of one problem, and what they were measured against.

    Attributes
    ----------
    stories : int
        Stories of the building.
    interval : float
        The record's sampling interval, or the model's own step, s.
    recorded : bool
        Whether it is that of a record.
    points : tuple of Point
        Method by method, each from its largest step to its smallest.
    reference : Reference
        What the errors are relative to, and how well it is known.
    usual : Point
        Average acceleration at the interval, whether or not it is among the points.
    timing : Timing
        How the points were timed.
    peers : tuple of Peer
        The other programs that have points.
    """

    stories: int
    interval: float
    recorded: bool
    points: tuple[Point, ...]
    reference: Reference
    usual: Point
    timing: Timing
    peers: tuple[Peer, ...] = ()

    def _headline(self) -> str:
        lines = len({point.line for point in self.points})
        counts = {"method": lines, "point": len(self.points), "story": self.stories}
        return "of " + ", ".join(how_many(count, noun) for noun, count in counts.items())


def default_steps(problem: Problem, methods: int, repeats: int) -> tuple[float, ...]:
    """Steps for some methods, s: from eight intervals down, by halves, to a sixteenth or what a
    large building allows; and between these 6, 3, 1/3, 1/6 and 1/12 intervals.

    Down to the interval itself in any case.
    """
    at_interval = problem.samples * problem.building.stories * _STORY_STEP * methods * (repeats + 1)
    halvings = HALVINGS
    while (
        halvings > 3 and at_interval * 2.0 ** (halvings + 1) / COARSEST * _WITH_BETWEEN > _SECONDS
    ):
        halvings -= 1
    halved = halved_steps(problem, halvings)
    between = (problem.interval * part for part in _BETWEEN)
    return tuple(sorted((*halved, *(dt for dt in between if dt > halved[-1])), reverse=True))


def halved_steps(problem: Problem, halvings: int) -> tuple[float, ...]:
    """Eight intervals, halved so many times, s."""
    return tuple(problem.interval * COARSEST / 2**j for j in range(halvings + 1))


def suited(problem: Problem, integrators: Sequence[Integrator]) -> list[Integrator]:
    """The methods that can integrate the building.

    Raises
    ------
    UsageError
        None of them can.
    """
    able = [
        integrator
        for integrator in integrators
        if not unsupported_reason(integrator, problem.building)
    ]
    if not able:
        raise UsageError(unsupported_reason(integrators[0], problem.building))
    return able


def measure(
    problem: Problem,
    integrators: Sequence[Integrator],
    dts: Sequence[float],
    *,
    repeats: int = 5,
    cached: bool = True,
    judge: Callable[[Sequence[Point]], object] | None = None,
    progress: Progress = silent,
) -> Chart:
    """Integrate a problem with all methods and steps: errors first, then times, all points taking
    turns.

    Parameters
    ----------
    integrators : sequence of Integrator
        Methods that can integrate the building; see `suited`.
    dts : sequence of float
        Steps, s; each a whole part or a whole multiple of the problem's interval.
    repeats : int
        How often each march is timed. Compilation is not timed.
    cached : bool
        Take the reference from the cache if it is there, and keep it.
    judge : callable, optional
        What the points are measured for, such as the cheapest of them: the marches are timed again,
        up to four times as often, until one more time does not change its answer.
    progress : callable
        Told what is being done.

    Raises
    ------
    UsageError
        A step that does not fit.
    AnalysisError
        The reference cannot be had.
    """
    problem = ending_together(problem, dts)
    choices = sorted({problem.steps(dt) for dt in dts}, key=lambda steps: -steps.h)
    record_steps = problem.steps(problem.interval)
    usual = (parse(USUAL), record_steps)
    progress("compiling", 0.0)
    problem.prepared.compile(
        [*integrators, usual[0]], lambda part: progress("compiling", _COMPILED * part)
    )
    progress("reference", _COMPILED)
    samples = max(
        steps.count * steps.stride // steps.per_sample for steps in (*choices, record_steps)
    )
    reference = find_reference(problem, samples, cached=cached)
    # The usual method at the record's step is measured in any case: other costs are told over its
    # cost.
    pairs = [(integrator, steps) for integrator in integrators for steps in choices]
    points = _timed(
        problem, reference, pairs if usual in pairs else [*pairs, usual], repeats, judge, progress
    )
    return Chart(
        stories=problem.building.stories,
        interval=problem.interval,
        recorded=problem.record is not None,
        points=tuple(points[pair] for pair in pairs),
        reference=reference,
        usual=points[usual],
        timing=Timing.of(points.values()),
    )


def with_tolerances(
    problem: Problem, chart: Chart, tolerances: Sequence[float], *, repeats: int
) -> Chart:
    """The chart with lines of `CHOOSING` behind its own: what `tdint run --tolerance` takes, and
    how far off it is.

    Timed is the whole of it: runs made again, the errors that it tells, and what Python does
    between them. A march keeps no history, so the error of the peak drifts alone is known.

    Parameters
    ----------
    tolerances : sequence of float
        Of the peak drifts, as a part.
    repeats : int
        How often each run is timed.
    """
    judge = partial(errors_of_peaks, reference=chart.reference.motion)
    points = [
        point
        for integrator in map(parse, CHOOSING)
        for point in by_tolerance(problem, integrator, tolerances, judge, repeats)
    ]
    return replace(chart, points=(*chart.points, *points))


def by_tolerance(
    problem: Problem,
    integrator: Integrator,
    tolerances: Iterable[float],
    judge: Callable[[Response], RelativeErrors],
    repeats: int,
) -> list[Point]:
    """The line of a method that chooses its steps, a point for each tolerance, the largest first.
    What compiles is not timed."""
    points = []
    for tolerance in sorted(set(tolerances), reverse=True):
        line = f"{integrator.label}{BY_TOLERANCE}"
        point = Point(f"{integrator.label} within {tolerance:g}", math.nan, None, DONE, line=line)
        try:
            response = problem.within(integrator, tolerance)
        except FailedRun as failure:
            points.append(replace(point, outcome=failure.status))
            continue
        # Processor time and wall time of each repetition: their ratio tells whether other work
        # disturbed it.
        times, walls = [], []
        for _ in range(repeats):
            begin, wall = system.seconds(), time.perf_counter()
            problem.within(integrator, tolerance)
            times.append(system.seconds() - begin)
            walls.append(time.perf_counter() - wall)
        off = judge(response)
        points.append(
            replace(
                point, outcome=response.status, errors=off, times=tuple(times), walls=tuple(walls)
            )
        )
    return points


def chart(
    model: AnyModel,
    record: AnyRecord | None = None,
    *,
    method: str | Iterable[str] = DEFAULT_METHODS,
    dt: float | Sequence[float] = (),
    duration: float | None = None,
    repeats: int = 5,
    tolerances: Sequence[float | str] = (),
    cached: bool = True,
    progress: bool | Counted = False,
) -> Chart:
    """Measure what methods cost and how much they err on a building.

    Parameters
    ----------
    model, record : optional
        What `run` takes.
    method : str or iterable of str
        Specifications; those for linear buildings are left out of a nonlinear one.
    dt : float or sequence of float
        Steps, s; by default from eight sampling intervals down (`default_steps`).
    duration : float, optional
        In place of the model's, else the record's, s.
    tolerances : sequence of float or str
        Of the peak drifts: lines of moment4 and impulse4 that choose their steps for them, as `run`
        does.
    repeats, cached
        As of `measure`.
    progress : bool or callable
        A bar on a terminal or in a notebook, by tqdm, or what is told how much is done, of how
        much.

    Returns
    -------
    Chart
        The points: errors and times by method and step.

    Raises
    ------
    UsageError
        An unknown method, a step that does not fit, no method for this building.
    ModelError, RecordError
        The model or the record is none.
    AnalysisError
        Nothing moves the building; the reference cannot be had.
    """
    dts = tuple(numbers_of(dt, "dt").tolist())
    problem = pose(
        model_of(model), None if record is None else record_of(record), duration=duration, dts=dts
    )
    integrators = suited(problem, chosen(method))
    steps = dts or default_steps(problem, len(integrators), repeats)
    limits = [limit for text in tolerances if (limit := ratio_of(text, "tolerance")) is not None]
    problem = ending_together(problem, steps)
    with told_progress(progress, 100, "%") as told:

        def in_percent(act: str, part: float) -> None:
            told(round(100.0 * part), 100)

        measured = measure(
            problem, integrators, steps, repeats=repeats, cached=cached, progress=in_percent
        )
        return with_tolerances(problem, measured, limits, repeats=repeats)


_Pair = tuple[Integrator, Steps]


def _timed(
    problem: Problem,
    reference: Reference,
    pairs: Sequence[_Pair],
    repeats: int,
    judge: Callable[[Sequence[Point]], object] | None,
    progress: Progress,
) -> dict[_Pair, Point]:
    """Each pair of method and step measured, so often that the judge is sure."""
    points: dict[_Pair, Point] = {}
    done, total = 0, (repeats + 1) * sum(steps.count for _, steps in pairs)

    def advance(act: str, steps: Steps) -> None:
        nonlocal done
        progress(act, _PREPARED + (1.0 - _PREPARED) * done / total)
        done += steps.count

    # Outcome and errors, without times; a building that runs away has no motion.
    for integrator, steps in pairs:
        advance("errors", steps)
        ended = attempt(problem.case(integrator), steps)
        point = Point(integrator.label, steps.h, steps.count, ended.status, line=integrator.label)
        if (
            isinstance(ended, Response)
            and (motion := problem.motion(integrator, steps)) is not None
        ):
            point = replace(
                point, iterations=ended.iterations, errors=errors(motion, reference.motion)
            )
        points[integrator, steps] = point
    # One time of each by turns, so that other work on the machine falls on all alike: that of the
    # loop as `tdint run` without --history has it, with peaks and energies.
    verdict: object = None
    for turn in range(1, (_MORE_REPEATS if judge else 1) * repeats + 1):
        for pair, point in points.items():
            if turn <= repeats:
                advance("times", pair[1])
            if point.errors:
                march = problem.prepared.integrate(*pair, problem.ground)
                points[pair] = replace(
                    point, times=(*point.times, march.seconds), walls=(*point.walls, march.wall)
                )
        before, verdict = verdict, judge(list(points.values())) if judge else None
        if turn >= repeats and verdict == before:
            break
    return points


def cheapest(points: Sequence[Point], quantity: str, limit: float) -> Point | None:
    """The point with the least cost whose error is within a limit, as are those of the same line
    with smaller steps.

    So a step whose error is small by chance is not recommended. Of points whose costs differ by
    less than a tenth, which is what clocks tell apart, the most accurate one is taken. None where
    no point is within the limit.
    """
    lines = dict.fromkeys(point.line for point in points)
    good = [point for line in lines for point in within(points, line, quantity, limit)]
    least = min((point.fastest for point in good), default=math.nan)
    alike = [point for point in good if point.fastest <= _SAME_COST * least]
    return min(alike, key=lambda point: point.error(quantity), default=None)


def alternative(points: Sequence[Point], quantity: str, limit: float, best: Point) -> Point | None:
    """Return the cheapest point of another method that meets the tolerance as `cheapest` requires.

    It costs at least as much as the recommended point. A point that is cheaper and was not
    recommended differs by less than clocks distinguish and is less accurate.

    Parameters
    ----------
    points : sequence of Point
        All points of the chart.
    quantity : str
        Name of the error, as `Errors.of` expects it.
    limit : float
        Tolerance.
    best : Point
        The recommended point.
    """
    lines = dict.fromkeys(point.line for point in points if point.line != best.line)
    meeting = [point for line in lines for point in within(points, line, quantity, limit)]
    dearer = [point for point in meeting if point.fastest >= best.fastest]
    return min(dearer, key=lambda point: point.fastest, default=None)


def within(points: Iterable[Point], line: str, quantity: str, limit: float) -> list[Point]:
    """The points of a line whose error is within a limit, as are all those of it with smaller
    steps; these first."""
    of_line = [point for point in points if point.line == line]
    return list(takewhile(lambda point: point.error(quantity) <= limit, reversed(of_line)))


# ---- Performance profiles: costs over those of the best, of many problems


def performance_ratios(costs: Array, ours: Sequence[bool]) -> Array:
    """Costs over the least of ours in each row: a problem each row, a solver each column, nan where
    it does not solve it.

    Infinite where a solver does not solve the problem (Dolan and More 2002, section 2: their r_M);
    0 where it does, and none of ours.
    """
    unsolved = np.isnan(costs)
    least = np.min(
        np.where(unsolved, math.inf, costs)[:, np.array(ours)],
        axis=1,
        keepdims=True,
        initial=math.inf,
    )
    return np.where(unsolved, math.inf, costs / least)


@dataclass(frozen=True)
class PerformanceProfile:
    """How a method fares over many problems at one tolerance: its performance ratios, the least
    first.

    Attributes
    ----------
    quantity, tolerance : str, float
        Of the error: what it is of, and what it must be within.
    method : str
        The line of the chart.
    ratios : tuple of float
        Its cost over that of the cheapest of our methods, a number for each problem; infinite where
        it is never within the tolerance.
    taken : int
        Problems that it takes; the others it does not solve.
    not_run : int
        Problems that are not among the ratios, because no step within the tolerance is known and
        smaller steps were not run.
    """

    quantity: str
    tolerance: float
    method: str
    ratios: tuple[float, ...]
    taken: int
    not_run: int = 0

    def within(self, factor: float) -> int:
        """Problems that it solves at no more than this factor of the least cost: rho(factor) times
        the problems."""
        return sum(ratio <= factor for ratio in self.ratios)

    @property
    def problems(self) -> int:
        """All problems."""
        return len(self.ratios)

    @property
    def solved(self) -> int:
        """Problems that it solves with one of its steps."""
        return sum(map(math.isfinite, self.ratios))

    @property
    def median(self) -> float:
        """Median ratio of the problems that it takes; infinite where half of these are not
        solved."""
        return statistics.median(self.ratios[: self.taken]) if self.taken else math.inf

    @property
    def worst(self) -> float:
        """The largest ratio of those solved; nan without any."""
        return max(filter(math.isfinite, self.ratios), default=math.nan)
