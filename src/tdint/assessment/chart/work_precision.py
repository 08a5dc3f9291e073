"""Work-precision diagrams: cost and error of methods for a single problem at several time steps."""

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
from tdint.arrays import Array
from tdint.assessment.chart.problem import (
    Problem,
    Reference,
    RelativeErrors,
    ending_together,
    errors,
    errors_of_peaks,
    find_reference,
    pose,
)
from tdint.errors import UsageError
from tdint.methods.catalogue import chosen, parse
from tdint.methods.method import Integrator
from tdint.model.status import DONE
from tdint.number_parsing import pluralize
from tdint.response.arguments import AnyModel, AnyRecord, model_of, numbers_of, ratio_of, record_of
from tdint.response.runs.compiled_steps import unsupported_reason
from tdint.response.runs.error_estimate import attempt
from tdint.response.runs.outcome import FailedRun, Response, StoryPeaks
from tdint.response.time_steps import Steps
from tdint.tabular import Progress as Counted
from tdint.tabular import Tabular, progress_reporter

USUAL = "newmark-average"
"""Default method of most programs, used with the sampling interval of the record as time step."""

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
"""Methods of a chart by default; `exact` only for linear buildings."""

COARSEST = 8
"""Maximum default time step, as a multiple of the sampling interval of the record."""

HALVINGS = 7
"""Default number of times that the maximum time step is halved."""

CHOOSING = ("moment4", "impulse4")
"""Methods that can choose their time steps from a tolerance."""

BY_TOLERANCE = " by tolerance"
"""Suffix that follows the method in the name of a line with steps chosen from a tolerance."""

# Default time steps between the halved steps, as multiples of the sampling interval
_INTERMEDIATE = (6.0, 3.0, 1.0 / 3.0, 1.0 / 6.0, 1.0 / 12.0)
# Cost of all runs with the intermediate time steps, over the cost of the runs with halved steps
_INTERMEDIATE_RATIO = 1.7

_DEFAULT_SECONDS = 30.0  # s; approximate duration of all timed runs of a chart by default
_STORY_STEP = 6e-8  # s; approximate cost of one time step per story

# Ratio of two costs below which they are considered equal, because times scatter by 10 % on a
# shared machine
_SAME_COST = 1.1
_MORE_REPEATS = 4  # maximum number of repetitions, as a multiple of the requested number
# Fractions of the total work that are complete after the compilation and after the reference
_COMPILED, _PREPARED = 0.1, 0.25

Progress = Callable[[str, float], None]
"""Callback with the name of the current action and the completed fraction, from 0 to 1."""


def silent(action: str, fraction: float) -> None:
    """Ignore progress reports."""


NOT_RUN = "not-run"
"""Outcome of a point without a run, because runs with larger steps used all of the time."""


@dataclass(frozen=True)
class Point:
    """Result of a single method with one time step.

    Attributes
    ----------
    method, line : str
        The method with its parameters, and the line of the chart that contains the point. Both
        are equal except for methods that choose their time steps from a tolerance.
    dt : float
        Time step, s; nan for a method that chooses its time steps.
    steps, iterations : int
        Number of time steps, None if they were not counted, and number of equation solutions,
        None if the run did not reach its end.
    times, walls : tuple of float
        Processor times (by `tdint.system.clock`) and wall times of the time integration without
        preparation, s, one per repetition.
    errors : RelativeErrors | None
        `Errors` for a single problem, `PeakErrors` for one of many problems; None if the run failed
        or did not reach its end.
    outcome : str
        Status of `tdint run`: `done`, `collapsed`, `unstable-step` (refused), `diverged` or
        `not-converged`. Points of other programs can also be `not-run`, if runs with larger steps
        used all of the time.
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
        """Return the error of a single quantity, named as in `Errors.of`; nan without errors."""
        return math.nan if self.errors is None else self.errors.of(quantity)

    @property
    def time(self) -> float:
        """Median of the times, s; nan if no time was measured."""
        return statistics.median(self.times) if self.times else math.nan

    @property
    def fastest(self) -> float:
        """Minimum of the times, s: the cost without disturbance; nan if no time was measured."""
        return min(self.times, default=math.nan)


@dataclass(frozen=True)
class Timing:
    """Conditions of the timing of a chart.

    Attributes
    ----------
    repeats : tuple of int
        Minimum and maximum number of times that each run was timed.
    load : float | None
        Load of the machine at the end of the runs: number of processes that ran or waited in the
        minute before, including this process.
    processor, processors : str, int
        Name of the processor, and number of processors that this process may use.
    stretch : float | None
        Wall time over processor time of all runs; None if the clock measures wall time.
    """

    clock: str
    repeats: tuple[int, int]
    load: float | None
    processor: str
    processors: int
    stretch: float | None

    @classmethod
    def of(cls, points: Iterable[Point]) -> Timing:
        """Return the conditions for points of a chart that have just been timed."""
        timed = [point for point in points if point.times]
        repeat_counts = [len(point.times) for point in timed] or [0]
        processor_seconds = sum(sum(point.times) for point in timed)
        wall_seconds = sum(sum(point.walls) for point in timed)
        # The ratio of wall time to processor time shows disturbances by other processes.
        is_measured = (
            system.clock() == "thread_time" and processor_seconds > 0.0 and wall_seconds > 0.0
        )
        return cls(
            system.clock(),
            (min(repeat_counts), max(repeat_counts)),
            system.load(),
            system.processor(),
            system.processors(),
            wall_seconds / processor_seconds if is_measured else None,
        )

    @property
    def description(self) -> str:
        """Text with the number of repetitions and the load of the machine."""
        repeat_text = " to ".join(str(count) for count in dict.fromkeys(self.repeats))
        text = f"minimum of {repeat_text} times"
        if self.load is None:
            return text
        return f"{text}, load {self.load:.1f} on {pluralize(self.processors, 'processor')}"

    @property
    def disturbed(self) -> bool:
        """True if other processes used the processors for more than a tenth of the time."""
        return self.stretch is not None and self.stretch > _SAME_COST


@dataclass(frozen=True)
class Peer:
    """Another program in a chart.

    Attributes
    ----------
    name : str
        Name, which is also the first part of the names of its lines.
    """

    name: str
    version: str
    settings: str
    timed: str


@dataclass(frozen=True, repr=False)
class Chart(Tabular):
    """All points of a single problem, with their reference.

    Attributes
    ----------
    stories : int
        Stories of the building.
    interval : float
        Sampling interval of the record, s, or the time step of the model if it has no record.
    recorded : bool
        True if the interval is the sampling interval of a record.
    points : tuple of Point
        Points, sorted by method and by decreasing time step.
    reference : Reference
        Reference solution of the errors, with an estimate of the error of the reference.
    usual : Point
        Point of average acceleration with the interval as time step. It is measured even if it is
        not included in `points`.
    timing : Timing
        Conditions of the timing.
    peers : tuple of Peer
        Other programs that have points.
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
        line_count = len({point.line for point in self.points})
        count_by_noun = {"method": line_count, "point": len(self.points), "story": self.stories}
        return "of " + ", ".join(pluralize(count, noun) for noun, count in count_by_noun.items())


def default_steps(problem: Problem, method_count: int, repeats: int) -> tuple[float, ...]:
    """Return the default time steps for a number of methods if each run is timed `repeats` times,
    s, in descending order.

    The steps are eight sampling intervals and repeated halves, down to 1/16 of an interval. For a
    large building the smallest step is larger, but at most the interval. In between, steps of 6, 3,
    1/3, 1/6 and 1/12 intervals are added, without those below the smallest halved step.
    """
    # Each run is executed `repeats` times for its time, and once before for its errors.
    seconds_at_interval = (
        problem.samples * problem.building.stories * _STORY_STEP * method_count * (repeats + 1)
    )
    halvings = HALVINGS
    # The cost is inversely proportional to the time step. The smallest step is COARSEST /
    # 2**halvings intervals, and all runs with repeatedly halved steps cost together about two times
    # the cost of the run with the smallest step. The intermediate steps multiply the cost by
    # `_INTERMEDIATE_RATIO`. At least three halvings end at a single interval.
    while (
        halvings > 3
        and seconds_at_interval * 2.0 ** (halvings + 1) / COARSEST * _INTERMEDIATE_RATIO
        > _DEFAULT_SECONDS
    ):
        halvings -= 1
    halved = halved_steps(problem, halvings)
    intermediate = (problem.interval * multiple for multiple in _INTERMEDIATE)
    return tuple(sorted((*halved, *(dt for dt in intermediate if dt > halved[-1])), reverse=True))


def halved_steps(problem: Problem, halvings: int) -> tuple[float, ...]:
    """Return eight sampling intervals, and this step halved 1 to `halvings` times, s."""
    return tuple(problem.interval * COARSEST / 2**j for j in range(halvings + 1))


def suited(problem: Problem, integrators: Sequence[Integrator]) -> list[Integrator]:
    """Return the methods of `integrators` that support the building of a problem.

    Raises
    ------
    UsageError
        No method supports the building.
    """
    suitable = [
        integrator
        for integrator in integrators
        if not unsupported_reason(integrator, problem.building)
    ]
    if not suitable:
        raise UsageError(unsupported_reason(integrators[0], problem.building))
    return suitable


def measure(
    problem: Problem,
    integrators: Sequence[Integrator],
    dts: Sequence[float],
    *,
    repeats: int = 5,
    cached: bool = True,
    tolerances: Sequence[float] = (),
    judge: Callable[[Sequence[Point]], object] | None = None,
    progress: Progress = silent,
) -> Chart:
    """Measure the errors, then the times of a problem with methods that can integrate the building
    (`suited`), at several time steps.

    The points are timed alternately, so that disturbances affect all points. Compilation is not
    timed. Each step is the interval of the problem divided or multiplied by a whole number. With
    `cached`, the reference is read from the cache, if available, and stored.

    `tolerances` add lines of the methods in `CHOOSING`, which show the cost and the error of `tdint
    run --tolerance`. The time includes repeated runs, error estimates and the Python code between
    the runs. These runs do not store a response history, so only the error of the peak drifts is
    available.

    `judge` receives all points and returns a result of interest, for example the cheapest point.
    The runs are timed `repeats` times, and then again until the last repetition has not changed
    this result, or up to four times `repeats`.

    Raises
    ------
    UsageError
        A time step does not divide or multiply the interval.
    AnalysisError
        The reference cannot be computed.
    """
    # Extend the duration to a common multiple of all steps, so that all runs end at the same time.
    problem = ending_together(problem, dts)
    step_choices = sorted({problem.steps(dt) for dt in dts}, key=lambda steps: -steps.h)
    record_steps = problem.steps(problem.interval)
    usual_run = (parse(USUAL), record_steps)
    progress("compiling", 0.0)
    problem.prepared.compile(
        [*integrators, usual_run[0]], lambda fraction: progress("compiling", _COMPILED * fraction)
    )
    progress("reference", _COMPILED)
    samples = max(
        steps.count * steps.stride // steps.per_sample for steps in (*step_choices, record_steps)
    )
    reference = find_reference(problem, samples, cached=cached)
    # The usual method at the record's step is always measured, because the costs of other methods
    # are reported relative to its cost.
    runs = [(integrator, steps) for integrator in integrators for steps in step_choices]
    points = _timed(
        problem,
        reference,
        runs if usual_run in runs else [*runs, usual_run],
        repeats,
        judge,
        progress,
    )
    timing = Timing.of(points.values())
    peak_errors = partial(errors_of_peaks, reference=reference.motion)
    points_by_tolerance = [
        point
        for integrator in map(parse, CHOOSING)
        for point in by_tolerance(problem, integrator, tolerances, peak_errors, repeats)
    ]
    return Chart(
        stories=problem.building.floors,
        interval=problem.interval,
        recorded=problem.record is not None,
        points=(*(points[pair] for pair in runs), *points_by_tolerance),
        reference=reference,
        usual=points[usual_run],
        timing=timing,
    )


def by_tolerance(
    problem: Problem,
    integrator: Integrator,
    tolerances: Iterable[float],
    judge: Callable[[StoryPeaks], RelativeErrors],
    repeats: int,
) -> list[Point]:
    """Measure a method that chooses its time steps, and return a point for each relative tolerance
    of the peak drifts, in descending order.

    The first run with each tolerance compiles the method and determines the errors by `judge`. It
    is not timed. A point of a failed run has no errors and no times.
    """
    points = []
    for tolerance in sorted(set(tolerances), reverse=True):
        line = f"{integrator.label}{BY_TOLERANCE}"
        point = Point(f"{integrator.label} within {tolerance:g}", math.nan, None, DONE, line=line)
        try:
            response = problem.run_within(integrator, tolerance)
        except FailedRun as failure:
            points.append(replace(point, outcome=failure.status))
            continue
        times, walls = [], []
        for _ in range(repeats):
            start_time, wall_start = system.seconds(), time.perf_counter()
            problem.run_within(integrator, tolerance)
            times.append(system.seconds() - start_time)
            walls.append(time.perf_counter() - wall_start)
        run_errors = judge(response.stories)
        points.append(
            replace(
                point,
                outcome=response.status,
                errors=run_errors,
                times=tuple(times),
                walls=tuple(walls),
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
    """Measure the cost and the error of methods for a building.

    Parameters
    ----------
    model, record : optional
        Model and record, as in `run`.
    method : str or iterable of str, optional
        Method specifications. Default: `impulse4`, `moment4`, `impulse`, `newmark-average`,
        `newmark-linear`, `central-difference`, `noh-bathe`, `generalized-alpha`, `bathe`, `gauss4`
        and `exact`. Methods for linear buildings are omitted for a nonlinear building.
    dt : float or sequence of float
        Time steps, s; default from eight sampling intervals downwards (`default_steps`).
    duration : float, optional
        Duration, s; default is the duration of the model, otherwise of the record.
    tolerances : sequence of float or str
        Relative tolerances of the peak drifts. Lines of moment4 and impulse4 with steps that are
        chosen for these tolerances (as in `run`) are added.
    repeats : int, default 5
        Number of times that each run is timed; up to four times as many if the result changes.
    cached : bool, default True
        True to read the reference from the cache, if available, and to store it.
    progress : bool or callable, default False
        True for a progress bar (tqdm) on a terminal or in a notebook, or a callback with the
        completed and the total amount of work.

    Returns
    -------
    Chart
        Points with errors and times, by method and time step.

    Raises
    ------
    UsageError
        A method is unknown, a step is invalid, or no method can integrate this building.
    ModelError, RecordError
        The model or the record is invalid.
    AnalysisError
        The building has no excitation, or the reference cannot be computed.
    """
    dts = tuple(numbers_of(dt, "dt").tolist())
    problem = pose(
        model_of(model), None if record is None else record_of(record), duration=duration, dts=dts
    )
    integrators = suited(problem, chosen(method))
    steps = dts or default_steps(problem, len(integrators), repeats)
    # Ignore an item None. `ratio_of` converts any other item or raises an error.
    limits = [limit for text in tolerances if (limit := ratio_of(text, "tolerance")) is not None]
    with progress_reporter(progress, 100, "%") as report:

        def in_percent(action: str, fraction: float) -> None:
            """Report the completed fraction as a number of percent; the action is not shown."""
            report(round(100.0 * fraction), 100)

        return measure(
            problem,
            integrators,
            steps,
            repeats=repeats,
            cached=cached,
            tolerances=limits,
            progress=in_percent,
        )


_MethodSteps = tuple[Integrator, Steps]


def _timed(
    problem: Problem,
    reference: Reference,
    runs: Sequence[_MethodSteps],
    repeats: int,
    judge: Callable[[Sequence[Point]], object] | None,
    progress: Progress,
) -> dict[_MethodSteps, Point]:
    """Measure the errors and the times of runs, as `measure` does, and return the point of each
    run. Without `judge`, each run is timed `repeats` times. A run that failed has no errors and no
    times.
    """
    points: dict[_MethodSteps, Point] = {}
    done, total = 0, (repeats + 1) * sum(steps.count for _, steps in runs)

    def advance(act: str, steps: Steps) -> None:
        """Report the progress before a run; the work of a run is its number of time steps."""
        nonlocal done
        progress(act, _PREPARED + (1.0 - _PREPARED) * done / total)
        done += steps.count

    # A diverged run has no response to compare.
    for integrator, steps in runs:
        advance("errors", steps)
        result = attempt(problem.case(integrator), steps)
        point = Point(integrator.label, steps.h, steps.count, result.status, line=integrator.label)
        if (
            isinstance(result, Response)
            and (motion := problem.motion(integrator, steps)) is not None
        ):
            point = replace(
                point, iterations=result.iterations, errors=errors(motion, reference.motion)
            )
        points[integrator, steps] = point
    # Time the runs alternately, so that disturbances affect all runs equally. The timed loop is
    # the time loop of `tdint run` without --history, with peaks and energies.
    result_of_judge: object = None
    for repetition in range(1, (_MORE_REPEATS if judge else 1) * repeats + 1):
        for run, point in points.items():
            if repetition <= repeats:
                advance("times", run[1])
            if point.errors:
                integration = problem.prepared.integrate(*run, problem.ground)
                points[run] = replace(
                    point,
                    times=(*point.times, integration.seconds),
                    walls=(*point.walls, integration.wall),
                )
        # Without `judge` both results are None, so that the loop ends after `repeats` repetitions.
        previous_result = result_of_judge
        result_of_judge = judge(list(points.values())) if judge else None
        if repetition >= repeats and result_of_judge == previous_result:
            break
    return points


def cheapest(points: Sequence[Point], quantity: str, limit: float) -> Point | None:
    """Return the point of minimum cost that meets an error limit; None if no point meets it. The
    points of a line are sorted by decreasing time step.

    Points of the same line with smaller steps must meet the limit also: a step with an error that
    is small by chance is not recommended. Measured times do not distinguish costs that differ by
    less than a tenth. Of the points with at most 1.1 times the minimum cost, the most accurate
    point is returned.
    """
    lines = dict.fromkeys(point.line for point in points)
    meeting = [point for line in lines for point in within(points, line, quantity, limit)]
    minimum_cost = min((point.fastest for point in meeting), default=math.nan)
    similar_cost = [point for point in meeting if point.fastest <= _SAME_COST * minimum_cost]
    return min(similar_cost, key=lambda point: point.error(quantity), default=None)


def alternative(points: Sequence[Point], quantity: str, limit: float, best: Point) -> Point | None:
    """Return the cheapest point of another line that meets the tolerance, or None.

    Points of the same line with smaller steps must meet the tolerance also. The cost of the
    alternative is at least the cost of the recommended point: a cheaper point was not recommended,
    because it is less accurate and its cost is not measurably lower.
    """
    lines = dict.fromkeys(point.line for point in points if point.line != best.line)
    meeting = [point for line in lines for point in within(points, line, quantity, limit)]
    more_expensive = [point for point in meeting if point.fastest >= best.fastest]
    return min(more_expensive, key=lambda point: point.fastest, default=None)


def within(points: Iterable[Point], line: str, quantity: str, limit: float) -> list[Point]:
    """Return the points of a line that meet an error limit at their step and at all smaller steps.

    A point without errors does not meet the limit.

    Parameters
    ----------
    points : iterable of Point
        Points of all lines; the points of a line are sorted by decreasing time step.
    """
    line_points = [point for point in points if point.line == line]
    return list(takewhile(lambda point: point.error(quantity) <= limit, reversed(line_points)))


# ---- Performance profiles: ratios of the cost to the minimum cost, for many problems


def performance_ratios(costs: Array, is_reference: Sequence[bool]) -> Array:
    """Divide each cost, shape (problems, solvers), by the minimum cost of the reference solvers
    (the methods of tdint) for the same problem.

    The cost is nan and the ratio infinite if a solver does not solve the problem (r_M of Dolan and
    More 2002, section 2). The ratio is 0 if the solver solves the problem, but no reference solver
    does.
    """
    is_unsolved = np.isnan(costs)
    minimum_cost = np.min(
        np.where(is_unsolved, math.inf, costs)[:, np.array(is_reference)],
        axis=1,
        keepdims=True,
        initial=math.inf,
    )
    return np.where(is_unsolved, math.inf, costs / minimum_cost)


@dataclass(frozen=True)
class PerformanceProfile:
    """Performance ratios of a method for many problems at a single tolerance, in ascending order.

    Attributes
    ----------
    quantity, tolerance : str, float
        Quantity of the error, and its limit.
    ratios : tuple of float
        Cost relative to the cheapest of our methods, one value per problem; infinite if the method
        does not meet the tolerance.
    taken : int
        Number of problems that the method accepts. It does not solve the remaining problems.
    not_run : int
        Number of problems omitted from the ratios, because no measured step meets the tolerance and
        smaller steps were not run.
    """

    quantity: str
    tolerance: float
    method: str
    ratios: tuple[float, ...]
    taken: int
    not_run: int = 0

    def within(self, factor: float) -> int:
        """Return the number of problems solved at a cost ratio of at most `factor`.

        This is the performance profile rho(factor) times the number of problems.
        """
        return sum(ratio <= factor for ratio in self.ratios)

    @property
    def problems(self) -> int:
        """Number of problems."""
        return len(self.ratios)

    @property
    def solved(self) -> int:
        """Number of problems that the method solves with one of its time steps."""
        return sum(map(math.isfinite, self.ratios))

    @property
    def median(self) -> float:
        """Median ratio of the accepted problems; infinite if half of the problems are not
        solved."""
        # The ratios of problems that the method does not accept are infinite, so they are last.
        return statistics.median(self.ratios[: self.taken]) if self.taken else math.inf

    @property
    def worst(self) -> float:
        """Maximum ratio of the solved problems; nan if the method solves no problem."""
        return max(filter(math.isfinite, self.ratios), default=math.nan)
