"""Cost of methods for many problems and tolerances, and their performance profiles.

Reference: Dolan and More 2002, Benchmarking optimization software with performance profiles,
Mathematical Programming 91:201-213.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tdint.arrays import cached_property
from tdint.assessment.chart import work_precision
from tdint.assessment.chart.problem import (
    Errors,
    Problem,
    Reference,
    RelativeErrors,
    ending_together,
    largest_relative,
    pose,
)
from tdint.errors import AnalysisError, RecordError, UsageError
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import chosen, parse
from tdint.methods.method import Integrator
from tdint.model.config.model_file import model_from_mapping, record_from_value
from tdint.model.definition import Excitation, Model
from tdint.model.keys.document import SourceText, read_document
from tdint.model.keys.fields import Value
from tdint.model.status import DONE
from tdint.number_parsing import pluralize
from tdint.output.tables.methods import PEER
from tdint.response.arguments import AnyModel, AnyRecord, model_of, model_record, record_of
from tdint.response.runs.error_estimate import attempt
from tdint.response.runs.outcome import FailedRun, Response, StoryPeaks
from tdint.tabular import Tabular

METHODS = (
    "impulse4",
    "moment4",
    "gauss4",
    "newmark-average",
    "newmark-linear",
    "central-difference",
    "noh-bathe",
    "hht",
    "generalized-alpha",
    "wilson",
    "bathe",
    "impulse",
    "exact",
)
"""Methods of the profiles by default: our methods, and methods that other programs provide."""

TOLERANCES = (0.1, 0.03, 0.01, 0.003, 0.001, 0.0001)

PARTS = (
    16.0,
    12.0,
    8.0,
    6.0,
    4.0,
    3.0,
    2.0,
    1.0,
    1 / 2,
    1 / 3,
    1 / 4,
    1 / 6,
    1 / 8,
    1 / 12,
    1 / 16,
)
"""Time steps of the profiles, as multiples of the sampling interval of the record. Steps between
the halved steps are included, because costs would otherwise differ by factors of two."""

PEAKS = ("peak_drift", "peak_absolute_acceleration", "peak_total_shear")

_FINE = 32  # number of time steps of the reference per sampling interval
# Numbers of steps per interval of the second method that confirms the reference. The second number
# is used if the difference between the two methods is too large with the first number.
_FINER = (32, 128)
# Maximum difference between the reference and the second method, as a fraction of a tolerance. With
# a larger difference, the problem cannot show which methods meet the tolerance.
_SURE = 0.2
_NEAR = 1.5  # points with a cost up to this multiple of the minimum are timed again
# Fraction of the smallest tolerance. After two time steps with errors below it, no smaller time
# step is run
_FAR_BELOW = 0.25
# Fraction of the time limit of OpenSees for a problem; with the full time, OpenSees would need more
# time than all methods of tdint in many problems
_SHARE = 0.3
# Number of times that a point is timed. The cost is the minimum time, because disturbances by other
# processes only increase times
_REPEATS = 5


@dataclass(frozen=True)
class PeakErrors(RelativeErrors):
    """Maximum relative errors of the peaks of all stories: drift, absolute acceleration, shear.

    Stories with a peak below a thousandth of the maximum are omitted.
    """

    peak_drift: float
    peak_absolute_acceleration: float
    peak_total_shear: float

    @classmethod
    def between(cls, peaks: StoryPeaks, true_peaks: StoryPeaks) -> PeakErrors:
        """Return the maximum over the stories of the error of each peak relative to its true
        value.
        """
        return cls(
            *(largest_relative(getattr(peaks, name), getattr(true_peaks, name)) for name in PEAKS)
        )


@dataclass(frozen=True)
class FieldProblem:
    """One of many problems: a building under a ground motion, with names and the reason to use it.

    Attributes
    ----------
    name, motion : str
        Names of the building and of the ground motion.
    reason : str
        Reason for including the problem.
    posed : Problem
        Building with its excitation.
    """

    name: str
    motion: str
    reason: str
    posed: Problem


@dataclass(frozen=True)
class Measured:
    """Results of the methods for a single problem.

    Attributes
    ----------
    name, motion, reason : str
        As in `FieldProblem`.
    stories, interval, duration, ductility, changes : int or float
        Number of stories; sampling interval of the record and duration of the time integration, s;
        maximum ductility (nan for laws without yield) and number of branch changes of the
        reference.
    gap : PeakErrors
        Errors of the second solution relative to the reference. Only errors well above this gap
        can be measured.
    points : tuple of Point
        Points, sorted by method and by decreasing time step; `Point.errors` are `PeakErrors`.
    peer_gap, peer_note : float, str
        Difference between OpenSees' average acceleration with small steps and the reference
        (`peers.opensees_gap`); description of the steps, or the reason for missing points.
    """

    name: str
    motion: str
    reason: str
    stories: int
    interval: float
    duration: float
    ductility: float
    changes: int
    confirmed_by: str
    gap: PeakErrors
    points: tuple[work_precision.Point, ...]
    peer_gap: float = math.nan
    peer_note: str = ""

    def judges(self, quantity: str, tolerance: float) -> bool:
        """Return True if the reference is accurate enough to show which methods meet a tolerance.

        Parameters
        ----------
        quantity : str
            Name of the error, for example `peak_drift`.
        """
        return self.gap.of(quantity) <= _SURE * tolerance

    def costs(self, quantity: str, tolerance: float) -> dict[str, float]:
        """Return the minimum computing time that each method needs to meet a tolerance.

        A time step meets the tolerance only if all smaller time steps meet it also.

        Returns
        -------
        dict of str to float
            Time, s, by the name of the line of the method; nan if no step meets the tolerance.
        """
        lines = dict.fromkeys(point.line for point in self.points)
        executed = [point for point in self.points if point.outcome != work_precision.NOT_RUN]
        return {
            line: min(
                (
                    point.fastest
                    for point in work_precision.within(executed, line, quantity, tolerance)
                ),
                default=math.nan,
            )
            for line in lines
        }

    def is_unknown(self, line: str, quantity: str, tolerance: float) -> bool:
        """Return True if it is unknown whether a method can meet a tolerance.

        This is the case if no executed time step meets the tolerance, and smaller steps were not
        run, because the time limit of the program was reached.
        """
        points = [point for point in self.points if point.line == line]
        executed = [point for point in points if point.outcome != work_precision.NOT_RUN]
        return executed != points and not work_precision.within(executed, line, quantity, tolerance)


class Leaders(NamedTuple):
    """Recommended methods, by the name of their lines (`FieldChart.leaders`).

    Attributes
    ----------
    overall, coarse : str
        Method with low costs for all tolerances, and for tolerances of at least 3 %.
    safest : str
        Method with the fewest failures.
    """

    overall: str
    coarse: str
    safest: str


COARSE = 0.03  # minimum relative error of a coarse tolerance


APART = ("openseespy/generalized-alpha",)
"""Lines that are excluded from the profiles. From its second iteration on, OpenSees' integrator
solves other equations than the published method."""


def has_specified_steps(line: str) -> bool:
    """Return True if a line belongs to one of our methods with specified time steps."""
    return PEER not in line and not line.endswith(work_precision.BY_TOLERANCE)


@dataclass(frozen=True, repr=False)
class FieldChart(Tabular):
    """Results for many problems, with the performance profiles of the methods.

    Attributes
    ----------
    measured : tuple of Measured
        Results, one entry per problem.
    timing : Timing
        Conditions of the timing.
    peers : tuple of Peer
        Other programs that have points for some of the problems.
    """

    measured: tuple[Measured, ...]
    timing: work_precision.Timing
    peers: tuple[work_precision.Peer, ...] = ()

    @property
    def lines(self) -> list[str]:
        """Methods, followed by methods that choose their time steps, and by other programs."""
        every_line = (point.line for measured in self.measured for point in measured.points)
        lines = dict.fromkeys(line for line in every_line if line not in APART)
        return sorted(lines, key=lambda line: (PEER in line, not has_specified_steps(line)))

    @cached_property
    def profiles(self) -> tuple[work_precision.PerformanceProfile, ...]:
        """Profiles for each quantity, tolerance and method, in this order.

        They include all problems with a reference that is accurate enough for the tolerance. A
        problem that a method does not accept counts as not solved. A problem is omitted from the
        profile of a method if it is unknown whether the method can meet the tolerance. All costs
        are relative to the minimum of tdint's methods with specified steps.
        """
        profiles = []
        is_ours = [has_specified_steps(line) for line in self.lines]
        for quantity, tolerance in product(PEAKS, TOLERANCES):
            judged_problems = [
                measured for measured in self.measured if measured.judges(quantity, tolerance)
            ]
            if not judged_problems:
                continue
            problem_costs = [measured.costs(quantity, tolerance) for measured in judged_problems]
            # Rows: problems; columns: methods. A method without points did not accept the problem.
            cost_table = np.array(
                [[costs.get(line, math.nan) for line in self.lines] for costs in problem_costs]
            )
            for line, ratios in zip(
                self.lines, work_precision.performance_ratios(cost_table, is_ours).T, strict=True
            ):
                is_unknown = [
                    problem.is_unknown(line, quantity, tolerance) for problem in judged_problems
                ]
                accepted = sum(line in costs for costs in problem_costs) - sum(is_unknown)
                sorted_ratios = sorted(ratios[~np.array(is_unknown)].tolist())
                profiles.append(
                    work_precision.PerformanceProfile(
                        quantity, tolerance, line, tuple(sorted_ratios), accepted, sum(is_unknown)
                    )
                )
        return tuple(profiles)

    def unsolved(self) -> list[str]:
        """Return a text for each problem that methods do not solve at the largest tolerance: its
        name, and these methods with the outcome of their smallest time step."""
        texts, tolerance = [], max(TOLERANCES)
        for problem in self.measured:
            lines_by_outcome: dict[str, list[str]] = {}
            for quantity in PEAKS:
                for line, cost in problem.costs(quantity, tolerance).items():
                    if math.isnan(cost) and not problem.is_unknown(line, quantity, tolerance):
                        outcome = [point.outcome for point in problem.points if point.line == line]
                        reason = "inaccurate" if outcome[-1] == DONE else outcome[-1]
                        lines_by_outcome.setdefault(reason, []).append(line)
            if lines_by_outcome:
                outcomes = [
                    f"{reason} with {', '.join(dict.fromkeys(lines))}"
                    for reason, lines in lines_by_outcome.items()
                ]
                texts.append(f"{problem.name}, {problem.motion}: {'; '.join(outcomes)}")
        return texts

    def named(self, line: str) -> str:
        """Return the name of a method, with the number of problems if it does not accept them all.

        Parameters
        ----------
        line : str
            Method specification, as in the points of the charts.
        """
        accepted = sum(
            any(point.line == line for point in measured.points) for measured in self.measured
        )
        count = len(self.measured)
        return line if accepted == count else f"{line} ({accepted} of {count})"

    def leaders(self) -> Leaders:
        """Return the recommended methods.

        The method `overall` solves most problems within twice the minimum cost, over all quantities
        and tolerances; `coarse` does this for tolerances of at least 3 %. The method `safest` has
        the fewest failures, and of these the smallest maximum ratio. A problem that a method does
        not accept counts as a failure.

        Raises
        ------
        AnalysisError
            No reference is accurate enough for any tolerance.
        """
        profiles = [profile for profile in self.profiles if has_specified_steps(profile.method)]
        lines = [line for line in self.lines if any(p.method == line and p.taken for p in profiles)]
        if not lines:
            raise AnalysisError(
                "no method can be recommended, because no reference solution is accurate enough "
                "for any of the tolerances; add other problems"
            )

        def count_near_minimum(line: str, smallest_tolerance: float) -> int:
            """Return the number of problems solved within twice the minimum cost, summed over all
            quantities and over tolerances from `smallest_tolerance`.
            """
            return sum(
                p.within(2.0)
                for p in profiles
                if p.method == line and p.tolerance >= smallest_tolerance
            )

        def failures(line: str) -> tuple[int, float]:
            """Return the number of unsolved problems, and the maximum ratio of solved problems."""
            line_profiles = [p for p in profiles if p.method == line]
            return sum(p.problems - p.solved for p in line_profiles), max(
                (p.worst for p in line_profiles if p.solved), default=math.inf
            )

        return Leaders(
            max(lines, key=lambda line: count_near_minimum(line, 0.0)),
            max(lines, key=lambda line: count_near_minimum(line, COARSE)),
            min((line for line in lines if count_near_minimum(line, 0.0)), key=failures),
        )

    def _headline(self) -> str:
        return (
            f"of {pluralize(sum(map(has_specified_steps, self.lines)), 'method')}, "
            f"{pluralize(len(self.measured), 'problem')}"
        )


# ---- One problem


def measure_problem(
    problem: FieldProblem,
    integrators: Sequence[Integrator],
    *,
    repeats: int = _REPEATS,
    tolerances: Sequence[float] = (),
    peers: bool = False,
    progress: work_precision.Progress = work_precision.silent,
) -> Measured:
    """Measure one problem with all methods and time steps.

    The errors are measured first. Then all points that can be the cheapest for a tolerance are
    timed alternately.

    Parameters
    ----------
    integrators : sequence of Integrator
        Methods; methods that cannot integrate the building are omitted.
    repeats : int
        Number of times that these points are timed.
    tolerances : sequence of float
        Relative tolerances of peak drifts. For each tolerance, points of moment4 and impulse4 with
        steps chosen for this tolerance are added, if these methods are selected.
    peers : bool
        True to include OpenSeesPy, if it is installed and supports the building.

    Raises
    ------
    AnalysisError
        The reference does not reach its end.
    """
    posed = problem.posed
    dts = [posed.interval * multiple for multiple in PARTS]
    posed = ending_together(posed, dts)
    suitable = work_precision.suited(posed, integrators)
    progress("compiling", 0.0)
    posed.prepared.compile([*suitable, parse("impulse4"), parse("moment4")])

    progress("reference", 0.1)
    reference, gap, confirmed_by = _reference(posed)

    points: dict[tuple[Integrator, float], work_precision.Point] = {}
    for completed, integrator in enumerate(suitable):
        progress("errors", 0.2 + 0.6 * completed / len(suitable))
        points |= {
            (integrator, point.dt): point
            for point in _points_of_method(posed, integrator, dts, reference.stories)
        }
    # Repeat the timing of all points that can be the cheapest for some tolerance. Each repetition
    # times every such point, so that a slow phase of the machine affects all points.
    contenders = _contenders(points)
    for repetition in range(1, repeats):
        progress("times", 0.8 + 0.2 * repetition / repeats)
        for integrator, dt in contenders:
            point = points[integrator, dt]
            response = posed.case(integrator).integrate(posed.steps(dt))
            points[integrator, dt] = replace(point, times=(*point.times, response.solver_time))

    # Time complete runs of methods that choose their steps, as `tdint run --tolerance` does.
    peak_errors = partial(PeakErrors.between, true_peaks=reference.stories)
    points_by_tolerance: list[work_precision.Point] = []
    for integrator in suitable:
        if integrator.label in work_precision.CHOOSING:
            points_by_tolerance += work_precision.by_tolerance(
                posed, integrator, tolerances, peak_errors, repeats
            )

    # Add the results of OpenSeesPy, if requested.
    opensees_points, opensees_gap, opensees_note = (
        _opensees_results(posed, dts, reference.stories) if peers else ([], math.nan, "")
    )
    return Measured(
        name=problem.name,
        motion=problem.motion,
        reason=problem.reason,
        stories=posed.building.floors,
        interval=posed.interval,
        duration=posed.samples * posed.interval,
        ductility=max(
            filter(math.isfinite, reference.stories.ductility.tolist()), default=math.nan
        ),
        changes=int(reference.branch_changes),
        confirmed_by=confirmed_by,
        gap=gap,
        points=(*points.values(), *points_by_tolerance, *opensees_points),
        peer_gap=opensees_gap,
        peer_note=opensees_note,
    )


def _reference(posed: Problem) -> tuple[Response, PeakErrors, str]:
    """Compute the reference of a problem by impulse4 with small time steps; return it with the
    difference of the peaks of a second method, the minimum over its time steps, and the name of
    this method with its last time step.

    The time step of the second method is reduced until the difference is small enough to confirm
    the reference at the smallest tolerance.
    """
    reference = posed.case(parse("impulse4")).integrate(posed.steps(posed.interval / _FINE))
    gap, confirmed_by = PeakErrors(math.inf, math.inf, math.inf), ""
    for steps_per_interval in _FINER:
        second_response = posed.case(parse("moment4")).integrate(
            posed.steps(posed.interval / steps_per_interval)
        )
        difference = PeakErrors.between(second_response.stories, reference.stories)
        gap = PeakErrors(*np.minimum(astuple(gap), astuple(difference)).tolist())
        confirmed_by = f"moment4 with dt {posed.interval / steps_per_interval:.4g} s"
        if gap.worst <= _SURE * min(TOLERANCES):
            break
    return reference, gap, confirmed_by


def _points_of_method(
    posed: Problem, integrator: Integrator, dts: Sequence[float], true_peaks: StoryPeaks
) -> list[work_precision.Point]:
    """Measure one method with decreasing time steps, and return a point for each time step.

    No smaller step is run after two successive errors far below all tolerances. Each point is timed
    one time.

    `dts` contains the time steps in descending order, s.
    """
    points: list[work_precision.Point] = []
    for dt in dts:
        steps = posed.steps(dt)
        point_without_result = work_precision.Point(
            integrator.label, steps.h, steps.count, DONE, line=integrator.label
        )
        response = attempt(posed.case(integrator), steps)
        if isinstance(response, FailedRun):
            points.append(replace(point_without_result, outcome=response.status))
            continue
        point = replace(
            point_without_result,
            outcome=response.status,
            iterations=response.iterations,
            times=(response.solver_time,),
        )
        if response.status == DONE:
            point = replace(point, errors=PeakErrors.between(response.stories, true_peaks))
        points.append(point)
        # Two successive small errors are required, because a single error may be small by chance.
        last_errors = [point.errors for point in points[-2:] if point.errors]
        if len(last_errors) == 2 and max(errors.worst for errors in last_errors) < _FAR_BELOW * min(
            TOLERANCES
        ):
            break
    return points


def _contenders(
    points: Mapping[tuple[Integrator, float], work_precision.Point],
) -> list[tuple[Integrator, float]]:
    """Return the runs with a point that is, or may become, the cheapest of its line for a
    tolerance.

    These points meet the tolerance at a cost of at most `_NEAR` times the minimum of their line.
    """
    lines = dict.fromkeys(point.line for point in points.values())
    contenders: set[tuple[str, float]] = set()  # lines and time steps
    for line, quantity, tolerance in product(lines, PEAKS, TOLERANCES):
        meeting = work_precision.within(points.values(), line, quantity, tolerance)
        minimum_cost = min((point.fastest for point in meeting), default=math.nan)
        contenders |= {
            (line, point.dt) for point in meeting if point.fastest <= _NEAR * minimum_cost
        }
    return [run for run, point in points.items() if (point.line, point.dt) in contenders]


def _opensees_results(
    posed: Problem, dts: Sequence[float], true_peaks: StoryPeaks
) -> tuple[list[work_precision.Point], float, str]:
    """Measure OpenSeesPy with all time steps; return the points, the relative difference between
    OpenSees with small steps and the reference (nan if unknown), and a note.

    Points are returned only if OpenSees integrates the same building: with small steps, its
    histories must equal the reference within a fifth of the smallest tolerance.
    """
    from tdint.assessment.chart.peers import ITERATED, opensees_gap, openseespy_points

    h = posed.interval / _FINE
    motion = posed.motion(parse("impulse4"), posed.steps(h))
    assert motion is not None  # the reference has reached its end with the same step
    # The functions below use only the motion of the reference, not its error.
    reference = Reference("impulse4", h, "", Errors(), motion)
    gap, note = opensees_gap(posed, reference, _SURE * min(TOLERANCES))
    if not gap <= _SURE * min(TOLERANCES):
        return [], gap, f"omitted: {note}"
    peak_errors = partial(PeakErrors.between, true_peaks=true_peaks)
    points, notes = openseespy_points(
        posed, dts, reference, repeats=1, share=_SHARE, judge=peak_errors
    )
    return points, gap, "; ".join([note, *(text for text in notes if text != ITERATED)])


# ---- Many problems

STANDARD = "standard"
_SET = Path(__file__).with_name("standard_problems.yaml")
_RECORDS = (Path(__file__).with_name("records"), Path(__file__).parents[4] / "records")
"""Directories of the records of the standard set: in an installed package, and in a checkout."""


def performance_profiles(
    models: AnyModel | Sequence[AnyModel] | None = None,
    records: AnyRecord | Sequence[AnyRecord] = (),
    *,
    problems: str | Path | None = None,
    method: str | Iterable[str] = METHODS,
    repeats: int = _REPEATS,
    tolerances: Sequence[float] = (),
    peers: bool = False,
    progress: work_precision.Progress = work_precision.silent,
) -> FieldChart:
    """Measure methods for many problems, and compute performance profiles of their costs.

    Parameters
    ----------
    models, records : optional
        One building or several buildings; each building is run under each ground motion, as in
        `run`. Without records, each building is used with the record of its model.
    problems : str or Path, optional
        Instead of models: `standard` (twelve buildings with three records each), or a YAML file of
        problems.
    method : str or iterable of str, optional
        Method specifications; those of the benchmark page by default. Methods for linear
        buildings are used for linear buildings only.
    repeats : int, default 5
        Number of times that a point is timed if it can be the cheapest for a tolerance.
    tolerances : sequence of float
        As in `measure_problem`.
    peers : bool, default False
        True to include OpenSeesPy for problems with supported laws.
    progress : callable, optional
        Silent by default. Callback with the name of the current action and the completed fraction,
        from 0 to 1.

    Returns
    -------
    FieldChart
        Results and `profiles` of the methods.

    Raises
    ------
    UsageError
        No problems and no models are specified, or both; or a method is unknown.
    ModelError, RecordError
        A model, a record or the file of problems is invalid.
    AnalysisError
        A reference cannot be computed, because the building diverges.
    """
    if problems is not None and models is None:
        selected = read_problems(problems)
    elif models is not None and problems is None:
        selected = crossed(models, records)
    else:
        raise UsageError(
            "performance_profiles requires either models (with records) or problems: 'standard' or "
            "a file"
        )
    integrators = chosen(method)

    def measure_one(completed: int, problem: FieldProblem) -> Measured:
        """Measure a problem after `completed` other problems."""
        label = f"{problem.name}, {problem.motion}"
        return measure_problem(
            problem,
            integrators,
            repeats=repeats,
            tolerances=tolerances,
            peers=peers,
            progress=lambda action, fraction: progress(
                f"{label}: {action}", (completed + fraction) / len(selected)
            ),
        )

    return field_chart([measure_one(*numbered) for numbered in enumerate(selected)])


def field_chart(measured: Sequence[Measured]) -> FieldChart:
    """Return the chart of measured problems."""
    from tdint.assessment.chart.peers import peers_of

    points = [point for problem in measured for point in problem.points]
    return FieldChart(tuple(measured), work_precision.Timing.of(points), peers_of(points))


def crossed(
    models: AnyModel | Sequence[AnyModel], records: AnyRecord | Sequence[AnyRecord]
) -> list[FieldProblem]:
    """Return one problem for each combination of a building and a ground motion.

    Parameters
    ----------
    records : one or a sequence
        Ground motions, as in `run`. If empty, each building is used with the record of its model.
    """
    buildings = models if isinstance(models, list | tuple) else [models]
    motions = records if isinstance(records, list | tuple) else [records]
    read_records = [record_of(record) for record in motions]
    problems = []
    for model in map(model_of, buildings):
        model_records: Sequence[Record | None] = read_records or [model_record(model)]
        for record in model_records:
            motion = "its forces"
            if record:
                motion = f"{Path(record.source).stem} {record.component}".strip()
            problems.append(FieldProblem(model.name, motion, "", pose(model, record)))
    return problems


def read_problems(source: str | Path) -> list[FieldProblem]:
    """Read the problems of a file, or the standard problems.

    Parameters
    ----------
    source : str or Path
        YAML file with the keys `records` and `problems`, or the text `standard`.

    Raises
    ------
    ModelError
        The file cannot be read, is not YAML or contains errors. All errors are listed in file
        order.
    RecordError
        A record cannot be read.
    """
    is_standard = source == STANDARD
    origin, root = read_document(
        _SET if is_standard else source, "file of problems", "`records` and `problems`"
    )
    if is_standard:
        directory = next((directory for directory in _RECORDS if directory.is_dir()), None)
        if directory is None:
            raise RecordError(
                "the records of the standard problems are not installed; specify a file of problems"
            )
        root.faults.folder = directory
    section = root.section(("records", "problems"))
    records_value = section and section.need("records", "list ground motions by name")
    problems_value = section and section.need(
        "problems", "list problems with name, model and scales"
    )
    motions = records_value and records_value.named("a mapping from names to ground motions")
    sources = {name: record_from_value(motion) for name, motion in (motions or {}).items()}
    items = problems_value and problems_value.items(
        "a list of problems", "is empty; add at least one problem"
    )
    entries = [_read_problem(item, origin, tuple(sources)) for item in items or ()]
    root.faults.raise_if_any()
    records: dict[str, Record | None] = {}
    problems = []
    for name, reason, building, scales in entries:
        model = model_of(building)
        for motion_name, factor in scales.items():
            if motion_name not in records:
                record_only = Excitation(sources[motion_name])
                records[motion_name] = model_record(replace(model, excitation=record_only))
            record = records[motion_name]
            assert record is not None
            scaled = record.scaled(factor) if factor != 1.0 else record
            problems.append(FieldProblem(name, motion_name, reason, pose(model, scaled)))
    return problems


def _read_problem(item: Value, origin: SourceText, motions: Sequence[str]) -> Any:
    """Read one entry of the list of problems: name, reason, model or its file, and factors on the
    ground motions by name. Errors are stored in the document; the result is then incomplete.
    """
    entry = item.section(("name", "reason", "model", "scales"))
    if entry is None:
        return None
    name = entry.need("name", "specify a name of the problem")
    model = entry.need("model", "specify a model or its file")
    scales = entry.need("scales", "specify a factor for each record: {NAME: 1}")
    reason = entry.get("reason")
    label = name and name.text()
    # The model is part of the file or a separate file. The record of the model is ignored.
    building: Model | str | None = None
    if model and model.is_mapping:
        building = model_from_mapping(model, origin._replace(name=label or origin.name))
    elif model:
        building = model.file()
    factors = {}
    if scales and (factor_section := scales.section(motions, "a mapping from records to factors")):
        for motion in scales.names:
            if factor := factor_section.get(motion):
                factors[motion] = factor.number()
                if factors[motion] == 0.0:
                    factor.fault("must not be zero")
    return label, (reason and reason.text()) or "", building, factors
