"""Many problems: what each method costs on each of them for an error, and its performance profile
over all (Dolan and More 2002, Benchmarking optimization software with performance profiles,
Mathematical Programming 91:201-213).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tdint.analysis.chart.problem import (
    Errors,
    Problem,
    Reference,
    RelativeErrors,
    ending_together,
    largest_relative,
    pose,
)
from tdint.analysis.chart.work_precision import (
    BY_TOLERANCE,
    CHOOSING,
    NOT_RUN,
    Peer,
    PerformanceProfile,
    Point,
    Progress,
    Timing,
    by_tolerance,
    performance_ratios,
    silent,
    suited,
    within,
)
from tdint.analysis.given import AnyModel, AnyRecord, model_of, model_record, record_of
from tdint.analysis.run.error_estimate import attempt
from tdint.analysis.run.outcome import FailedRun, Response, StoryPeaks
from tdint.arrays import cached_property
from tdint.errors import AnalysisError, RecordError, UsageError
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import chosen, parse
from tdint.methods.method import Integrator
from tdint.model.config.model_file import model_within, record_within
from tdint.model.damage_states import DONE
from tdint.model.definition import Model, RecordSource
from tdint.model.keys.document import SourceText, read_document
from tdint.model.keys.fields import Section, Value
from tdint.tabular import Tabular
from tdint.written_numbers import how_many

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
"""Methods that are measured unless some are asked for: ours, and those that programs have."""

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
"""Steps over the record's interval: halvings, and some between, for with these alone costs would
come by twos."""

PEAKS = ("peak_drift", "peak_absolute_acceleration", "peak_total_shear")

_FINE = 32  # parts of the interval that the reference steps with
_FINER = (32, 128)  # and the second method: the latter where the former does not confirm it
_SURE = (
    0.2  # of a tolerance: what the reference must be known to, so that an error within it is one
)
_NEAR = 1.5  # times the least: costs that may yet turn out to be it when they are measured again
# of the smallest tolerance: two steps with such errors are followed by none that is smaller
_FAR_BELOW = 0.25
# of the time that OpenSees has for one problem: with all of it many take longer than our own
# methods
_SHARE = 0.3
_REPEATS = 3  # the least of them counts: other work can only add to a time


@dataclass(frozen=True)
class PeakErrors(RelativeErrors):
    """Largest relative errors of the peaks of all stories: drift, absolute acceleration, total
    shear. Stories whose peak is below a thousandth of the largest one are left out."""

    peak_drift: float
    peak_absolute_acceleration: float
    peak_total_shear: float

    def of(self, quantity: str) -> float:
        """One of the errors by its name, with a hyphen or an underscore in it; nan for one that
        this has not."""
        return float(getattr(self, quantity.replace("-", "_"), math.nan))

    @classmethod
    def between(cls, peaks: StoryPeaks, true: StoryPeaks) -> PeakErrors:
        """Of some peaks against those that are true."""
        return cls(*(largest_relative(getattr(peaks, name), getattr(true, name)) for name in PEAKS))


@dataclass(frozen=True)
class FieldProblem:
    """One of many problems: a building under a motion, their names, and why it is one of them."""

    name: str
    motion: str
    reason: str
    posed: Problem


@dataclass(frozen=True)
class Measured:
    """What the methods came to on one problem.

    Attributes
    ----------
    name, motion, reason : str
        As of `FieldProblem`.
    stories, interval, duration, ductility, changes : int or float
        Stories; the record's interval and the time integrated, s; largest ductility (nan for laws
        without yield) and changes of branch of the reference.
    confirmed_by : str
        The second solution, in words.
    gap : PeakErrors
        Of that against the reference: errors are known where they are well above it.
    points : tuple of Point
        Method by method, each from its largest step to its smallest; `Point.errors` are
        `PeakErrors`.
    peer_gap, peer_note : float, str
        How far OpenSees' average acceleration with fine steps is from the reference
        (`peers.opensees_gap`); with which steps, why it has no points, or not all.
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
    points: tuple[Point, ...]
    peer_gap: float = math.nan
    peer_note: str = ""

    def judges(self, quantity: str, tolerance: float) -> bool:
        """Whether the reference is known well enough for a tolerance."""
        return self.gap.of(quantity) <= _SURE * tolerance

    def costs(self, quantity: str, tolerance: float) -> dict[str, float]:
        """Least time of each method within a tolerance, there and with all smaller steps, s; nan
        for none."""
        lines = dict.fromkeys(point.line for point in self.points)
        run = [point for point in self.points if point.outcome != NOT_RUN]
        return {
            line: min(
                (point.fastest for point in within(run, line, quantity, tolerance)),
                default=math.nan,
            )
            for line in lines
        }

    def is_unknown(self, line: str, quantity: str, tolerance: float) -> bool:
        """Return True if a line has no step within a tolerance and its smaller steps were not run:
        the problem is then neither solved nor unsolved."""
        of_line = [point for point in self.points if point.line == line]
        run = [point for point in of_line if point.outcome != NOT_RUN]
        return len(run) < len(of_line) and not within(run, line, quantity, tolerance)


class Leaders(NamedTuple):
    """Methods that are recommended: for all tolerances, for 3 % and more, and where nothing must
    fail."""

    overall: str
    coarse: str
    safest: str


COARSE = 0.03  # relative error: between 10 and 1 %, where coarse steps are chosen
PEER = "/"  # in the name of a line that is another program's: program/method


APART = ("openseespy/generalized-alpha",)
"""Lines that are not among the profiles: from its second iteration on, OpenSees' integrator solves
other equations than the method (`peers.ITERATED`)."""


def of_steps(line: str) -> bool:
    """Whether a line is that of a method of ours with steps that are given."""
    return PEER not in line and not line.endswith(BY_TOLERANCE)


@dataclass(frozen=True, repr=False)
class FieldChart(Tabular):
    """Many problems, and the performance profiles of the methods over them.

    Attributes
    ----------
    measured : tuple of Measured
        Problem by problem.
    timing : Timing
        How the points were timed.
    peers : tuple of Peer
        Other programs that have points on some of the problems.
    """

    measured: tuple[Measured, ...]
    timing: Timing
    peers: tuple[Peer, ...] = ()

    @property
    def lines(self) -> list[str]:
        """The methods, behind them what chooses its steps, then other programs."""
        lines = dict.fromkeys(point.line for measured in self.measured for point in measured.points)
        lines = dict.fromkeys(line for line in lines if line not in APART)
        return sorted(lines, key=lambda line: (PEER in line, not of_steps(line)))

    @cached_property
    def profiles(self) -> tuple[PerformanceProfile, ...]:
        """By quantity, by tolerance, by method: over all problems whose references are known well
        enough; one that a method does not take is one that it does not solve. A problem whose steps
        within the tolerance were not run is not among those of its method. The costs of what
        chooses its steps, and of another program, are over the least of ours, which they do not
        change."""
        profiles = []
        ours = [of_steps(line) for line in self.lines]
        for quantity, tolerance in product(PEAKS, TOLERANCES):
            sure = [measured for measured in self.measured if measured.judges(quantity, tolerance)]
            if not sure:
                continue
            judged = [measured.costs(quantity, tolerance) for measured in sure]
            table = np.array(
                [[costs.get(line, math.nan) for line in self.lines] for costs in judged]
            )
            for line, ratios in zip(self.lines, performance_ratios(table, ours).T, strict=True):
                unknown = [one.is_unknown(line, quantity, tolerance) for one in sure]
                taken = sum(line in costs for costs in judged) - sum(unknown)
                known = sorted(ratios[~np.array(unknown)].tolist())
                profiles.append(
                    PerformanceProfile(quantity, tolerance, line, tuple(known), taken, sum(unknown))
                )
        return tuple(profiles)

    def named(self, line: str) -> str:
        """The method, and how many problems it takes if not all."""
        taken = sum(
            any(point.line == line for point in measured.points) for measured in self.measured
        )
        return line if taken == len(self.measured) else f"{line} ({taken} of {len(self.measured)})"

    def leaders(self) -> Leaders:
        """What is best: solves most within twice the least cost, over all quantities and
        tolerances, and over those of 3 % and more; and what fails least, with the least worst
        ratio. What a method does not take it fails."""
        profiles = [profile for profile in self.profiles if of_steps(profile.method)]
        lines = [line for line in self.lines if any(p.method == line and p.taken for p in profiles)]
        if not lines:
            raise AnalysisError(
                "no reference is known well enough for any tolerance: nothing can be recommended"
            )

        def near(line: str, least: float) -> int:
            return sum(p.within(2.0) for p in profiles if p.method == line and p.tolerance >= least)

        def fails(line: str) -> tuple[int, float]:
            of_line = [p for p in profiles if p.method == line]
            return sum(p.problems - p.solved for p in of_line), max(
                (p.worst for p in of_line if p.solved), default=math.inf
            )

        return Leaders(
            max(lines, key=lambda line: near(line, 0.0)),
            max(lines, key=lambda line: near(line, COARSE)),
            min((line for line in lines if near(line, 0.0)), key=fails),
        )

    def _headline(self) -> str:
        return (
            f"of {how_many(sum(map(of_steps, self.lines)), 'method')}, "
            f"{how_many(len(self.measured), 'problem')}"
        )


# ---- One problem


def measure_problem(
    problem: FieldProblem,
    integrators: Sequence[Integrator],
    *,
    repeats: int = _REPEATS,
    tolerances: Sequence[float] = (),
    peers: bool = False,
    progress: Progress = silent,
) -> Measured:
    """Integrate one problem with all methods and steps: errors first, then the times of all that
    may be the cheapest for a tolerance, all in turns.

    Parameters
    ----------
    repeats : int
        How often these are timed.
    tolerances : sequence of float
        Of peak drifts: lines of moment4 and impulse4, of those asked for, that choose their steps
        for them.
    peers : bool
        OpenSeesPy, too, where it is installed and can do the building.

    Raises
    ------
    AnalysisError
        The reference does not reach its end.
    """
    # The building's own loops, and steps that all end at one time
    posed = problem.posed
    dts = [posed.interval * part for part in PARTS]
    posed = ending_together(posed, dts)
    able = suited(posed, integrators)
    progress("compiling", 0.0)
    posed.prepared.compile([*able, parse("impulse4"), parse("moment4")])

    # The reference, and how far a second method is from it
    progress("reference", 0.1)
    true = posed.case(parse("impulse4")).integrate(posed.steps(posed.interval / _FINE))
    gap, confirmed_by = PeakErrors(math.inf, math.inf, math.inf), ""
    for parts in _FINER:
        other = posed.case(parse("moment4")).integrate(posed.steps(posed.interval / parts))
        apart = _off(true.stories, other)
        gap = PeakErrors(*np.minimum(astuple(gap), astuple(apart)).tolist())
        confirmed_by = f"moment4 with dt {posed.interval / parts:.4g} s"
        if gap.worst <= _SURE * min(TOLERANCES):
            break

    # Errors of all, then times of what matters
    points: dict[tuple[Integrator, float], Point] = {}
    for done, integrator in enumerate(able):
        progress("errors", 0.2 + 0.6 * done / len(able))
        points |= {
            (integrator, point.dt): point for point in _line(posed, integrator, dts, true.stories)
        }
    contenders = _contenders(points.values())
    for turn in range(1, repeats):
        progress("times", 0.8 + 0.2 * turn / repeats)
        for pair, point in points.items():
            if point in contenders:
                again = posed.case(pair[0]).integrate(posed.steps(pair[1]))
                points[pair] = replace(point, times=(*point.times, again.solver_time))
        contenders = [point for point in points.values() if len(point.times) == turn + 1]
    # What chooses its steps: all that `tdint run --tolerance` takes
    choosing: list[Point] = []
    for integrator in able:
        if integrator.label in CHOOSING:
            choosing += by_tolerance(
                posed, integrator, tolerances, partial(_off, true.stories), repeats
            )
    others, agreed, said = _others(posed, dts, true.stories) if peers else ([], math.nan, "")
    return Measured(
        name=problem.name,
        motion=problem.motion,
        reason=problem.reason,
        stories=posed.building.stories,
        interval=posed.interval,
        duration=posed.samples * posed.interval,
        ductility=max(filter(math.isfinite, true.stories.ductility.tolist()), default=math.nan),
        changes=int(true.branch_changes),
        confirmed_by=confirmed_by,
        gap=gap,
        points=(*points.values(), *choosing, *others),
        peer_gap=agreed,
        peer_note=said,
    )


def _off(true: StoryPeaks, response: Response) -> PeakErrors:
    """The errors of the peaks of a run."""
    return PeakErrors.between(response.stories, true)


def _line(
    posed: Problem, integrator: Integrator, dts: Sequence[float], true: StoryPeaks
) -> list[Point]:
    """One method with all steps, until two in a row are far below all tolerances. Each has one time
    yet."""
    points: list[Point] = []
    for dt in dts:
        steps = posed.steps(dt)
        bare = Point(integrator.label, steps.h, steps.count, DONE, line=integrator.label)
        response = attempt(posed.case(integrator), steps)
        if isinstance(response, FailedRun):
            points.append(replace(bare, outcome=response.status))
            continue
        point = replace(
            bare,
            outcome=response.status,
            iterations=response.iterations,
            times=(response.solver_time,),
        )
        if response.status == DONE:
            point = replace(point, errors=_off(true, response))
        points.append(point)
        # Two in a row, for the error of one step may be small by chance.
        last = [point.errors for point in points[-2:] if point.errors]
        if len(last) == 2 and max(error.worst for error in last) < _FAR_BELOW * min(TOLERANCES):
            break
    return points


def _contenders(points: Iterable[Point]) -> list[Point]:
    """Points whose cost is the least of their line for some quantity and tolerance, or may be when
    timed again."""
    points = list(points)
    contenders: dict[int, Point] = {}
    for line, quantity, tolerance in product(
        dict.fromkeys(point.line for point in points), PEAKS, TOLERANCES
    ):
        good = within(points, line, quantity, tolerance)
        least = min((point.fastest for point in good), default=math.nan)
        contenders |= {id(point): point for point in good if point.fastest <= _NEAR * least}
    return list(contenders.values())


def _others(
    posed: Problem, dts: Sequence[float], true: StoryPeaks
) -> tuple[list[Point], float, str]:
    """OpenSeesPy's points, `peer_gap` and `peer_note` of `Measured`. It has points where with fine
    steps it has the reference's histories but for a fifth of the smallest tolerance: the law is
    one.
    """
    from tdint.analysis.chart.peers import ITERATED, opensees_gap, openseespy_points

    h = posed.interval / _FINE
    motion = posed.motion(parse("impulse4"), posed.steps(h))
    assert motion is not None  # it has come to its end before
    reference = Reference("impulse4", h, "", Errors(0.0, 0.0, 0.0, 0.0, 0.0), motion)
    gap, said = opensees_gap(posed, reference, _SURE * min(TOLERANCES))
    if not gap <= _SURE * min(TOLERANCES):
        return [], gap, f"left out: {said}"
    judge = partial(PeakErrors.between, true=true)
    points, notes = openseespy_points(posed, dts, reference, repeats=1, share=_SHARE, judge=judge)
    return points, gap, "; ".join([said, *(note for note in notes if note != ITERATED)])


# ---- All of them

STANDARD = "standard"
_SET = Path(__file__).with_name("standard_problems.yaml")
_RECORDS = (Path(__file__).with_name("records"), Path(__file__).parents[4] / "records")
"""Where the records of the standard set lie: in an installed package, and in its sources."""


def performance_profiles(
    models: AnyModel | Sequence[AnyModel] | None = None,
    records: AnyRecord | Sequence[AnyRecord] = (),
    *,
    problems: str | Path | None = None,
    method: str | Iterable[str] = METHODS,
    repeats: int = _REPEATS,
    tolerances: Sequence[float] = (),
    peers: bool = False,
    progress: Progress = silent,
) -> FieldChart:
    """Measure methods over many problems: performance profiles of their costs within tolerances.

    Parameters
    ----------
    models, records : optional
        A building or several, each under each of the ground motions: what `run` takes. Without
        records each has that of its model.
    problems : str or Path, optional
        In their place `standard` (twelve buildings, three records each), or a YAML file of
        problems.
    method : str or iterable of str
        Specifications; those for linear buildings are given these only.
    repeats : int
        How often a step is timed that may be the cheapest for a tolerance.
    tolerances : sequence of float
        As of `measure_problem`.
    peers : bool
        OpenSeesPy, too, on the problems whose laws it has.
    progress : callable
        Told what is being done, and how much of it is done, from 0 to 1.

    Returns
    -------
    FieldChart
        What was measured, and the `profiles` of the methods.

    Raises
    ------
    UsageError
        Neither problems nor models, or both; an unknown method.
    ModelError, RecordError
        A model, a record or the file of problems is none.
    AnalysisError
        A reference cannot be had: the building diverges.
    """
    if problems is not None and models is None:
        given = read_problems(problems)
    elif models is not None and problems is None:
        given = crossed(models, records)
    else:
        raise UsageError(
            "performance_profiles takes either models (with records) or problems: 'standard' or "
            "a file"
        )
    return measure_all(
        given,
        chosen(method),
        repeats=repeats,
        tolerances=tolerances,
        peers=peers,
        progress=progress,
    )


def measure_all(
    given: Sequence[FieldProblem],
    integrators: Sequence[Integrator],
    *,
    repeats: int = _REPEATS,
    tolerances: Sequence[float] = (),
    peers: bool = False,
    progress: Progress = silent,
) -> FieldChart:
    """`measure_problem` of each, one after the other."""
    measured: list[Measured] = []
    for done, problem in enumerate(given):

        def tell(act: str, part: float, done: int = done, problem: FieldProblem = problem) -> None:
            progress(f"{problem.name}, {problem.motion}: {act}", (done + part) / len(given))

        measured.append(
            measure_problem(
                problem,
                integrators,
                repeats=repeats,
                tolerances=tolerances,
                peers=peers,
                progress=tell,
            )
        )
    return field_chart(measured)


def field_chart(measured: Sequence[Measured]) -> FieldChart:
    """The chart of what was measured."""
    from tdint.analysis.chart.peers import peers_of

    points = [point for of_problem in measured for point in of_problem.points]
    return FieldChart(tuple(measured), Timing.of(points), peers_of(points))


def crossed(
    models: AnyModel | Sequence[AnyModel], records: AnyRecord | Sequence[AnyRecord]
) -> list[FieldProblem]:
    """Each building under each motion, or under its own where there is none."""
    buildings = models if isinstance(models, list | tuple) else [models]
    motions = records if isinstance(records, list | tuple) else [records]
    read = [record_of(record) for record in motions]
    problems = []
    for model in map(model_of, buildings):
        given: Sequence[Record | None] = read or [model_record(model)]
        for record in given:
            motion = (
                " ".join(filter(None, (Path(record.source).stem, record.component)))
                if record
                else "its forces"
            )
            problems.append(FieldProblem(model.name, motion, "", pose(model, record)))
    return problems


def read_problems(source: str | Path) -> list[FieldProblem]:
    """The problems of a file, or `standard`.

    Raises
    ------
    ModelError
        The file cannot be read, is not YAML or has faults: all of them, in file order.
    RecordError
        A record cannot be read.
    """
    standard = source == STANDARD
    origin, root = read_document(
        _SET if standard else source, "file of problems", "`records` and `problems`"
    )
    if standard:
        folder = next((folder for folder in _RECORDS if folder.is_dir()), None)
        if folder is None:
            raise RecordError(
                "the records of the standard problems are not installed; give a file of problems"
            )
        root.faults.folder = folder
    # What the file says: motions by name, and buildings that name them
    section = root.section(("records", "problems"))
    sources: dict[str, RecordSource] = {}
    entries: list[tuple[str, str, Model | str, dict[str, float]]] = []
    if section:
        named = section.need("records", "give ground motions by name")
        listed = section.need("problems", "give a list of problems: name, model and scales")
        motions = named.named("a mapping from names to ground motions") if named else None
        for name, motion in (motions or {}).items():
            if (stated := record_within(motion)) is not None:
                sources[name] = stated
        for item in (
            listed.items("a list of problems", "is empty; give at least one") if listed else None
        ) or ():
            entry = item.section(("name", "reason", "model", "scales"))
            if entry and (problem := _entry(entry, origin, named.names if named else ())):
                entries.append(problem)
    root.faults.raise_if_any()
    # Each building under each of its motions
    records: dict[str, Record | None] = {}
    problems = []
    for name, reason, building, scales in entries:
        model = model_of(building)
        for motion_name, factor in scales.items():
            if motion_name not in records:
                bare = replace(model.excitation, record=sources[motion_name], forces=())
                records[motion_name] = model_record(replace(model, excitation=bare))
            record = records[motion_name]
            assert record is not None
            scaled = record.scaled(factor) if factor != 1.0 else record
            problems.append(FieldProblem(name, motion_name, reason, pose(model, scaled)))
    return problems


def _entry(
    entry: Section, origin: SourceText, motions: Sequence[str]
) -> tuple[str, str, Model | str, dict[str, float]] | None:
    """One problem: its name, its reason, its model or the file of it, and the factor of each
    motion; None after a fault."""
    name, value = (
        entry.need("name", "give the problem a name"),
        entry.need("model", "give a model or its file"),
    )
    scales, reason = (
        entry.need("scales", "give a factor for each record: {NAME: 1}"),
        entry.get("reason"),
    )
    label = name.text() if name else None
    # A model stands here itself or in a file; what it says of a record does not count.
    model: Model | str | None = None
    if value is not None:
        inside = replace(origin, name=label or origin.name)
        model = model_within(value, inside) if value.is_mapping else value.file()
    of_motions = scales.section(motions, "a mapping from records to factors") if scales else None
    factors: dict[str, float] = {}
    for motion in scales.names if scales and of_motions else ():
        factor: Value | None = of_motions.get(motion) if of_motions else None
        if factor is not None:
            factors[motion] = factor.number()
            if factors[motion] == 0.0:
                factor.fault("must not be zero")
    return (
        (label, (reason.text() if reason else "") or "", model, factors)
        if label and model
        else None
    )
