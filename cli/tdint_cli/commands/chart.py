"""`tdint chart`: what methods cost and how much they err on a building."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import click

from tdint.analysis.defaults import PEAKS, QUANTITIES
from tdint.errors import UsageError
from tdint.model.plugins import peers
from tdint.output import figures, tables
from tdint.written_numbers import how_many
from tdint_cli import options
from tdint_cli.options.analysis import BuildingRequest, check_motion, with_motion
from tdint_cli.options.grammar import Count, FileName, ListOf, Mode, Number, Ratio, refuse_idle
from tdint_cli.options.output import Outputs
from tdint_cli.options.record import NAMES
from tdint_cli.terminal import Progress, note, part_of, progress_bar, say, warn

if TYPE_CHECKING:
    from tdint.analysis.chart.problem import Problem
    from tdint.analysis.chart.profiles import FieldProblem
    from tdint.analysis.chart.work_precision import Chart, Peer, Point, Timing
    from tdint.ground_motion.record import Record
    from tdint.methods.method import Integrator
    from tdint.model.definition import Model
    from tdint.output.figures.style import Figure
    from tdint.output.summary import Advice

TARGETS = tuple(QUANTITIES | PEAKS)
MOST_STORIES = 10_000
MOST_SECONDS = 1e6
LIMITS = (0.01, 0.001)
"""Errors for which a method and a step are recommended."""

_OF_MODELS = NAMES | {"models", "records", "scale", "duration"}
_OF_STEPS = _OF_MODELS | {"steps", "halvings", "cache"}
_ONE = Mode("with one building", _OF_STEPS | {"tolerances", "versus", "peers"})
_SIZES = Mode("with --stories", _OF_STEPS | {"stories"})
_MANY = Mode("with many problems", _OF_MODELS | {"tolerances", "peers"})
_PROBLEMS = Mode("with --problems", frozenset({"tolerances", "peers"}))
MODES = (_ONE, _SIZES, _MANY, _PROBLEMS)


@options.request
class Request(options.record.RecordRequest):
    """The command line of `tdint chart`."""

    outputs: Outputs
    scale: tuple[float, ...] | None
    models: tuple[str, ...] = options.argument("[MODEL.yaml]...", nargs=-1, type=FileName())
    records: tuple[str, ...] = options.option(
        "--record",
        heading=options.grammar.RECORD,
        type=FileName(),
        multiple=True,
        help="Ground motion in place of the model's; nothing that the model says of its own "
        "applies to it. Several: each building under each of them.",
    )
    problems: str | None = options.option(
        type=FileName(),
        metavar="standard|FILE",
        help="In place of models many problems: the standard ones, twelve buildings under three "
        "records each, or those of a YAML file.",
    )
    methods: tuple[str, ...] = options.analysis.methods("ten of them, from impulse4 to exact,")
    steps: tuple[float, ...] | None = options.analysis.option(
        "--dt",
        type=ListOf(Number(0.0, MOST_SECONDS, min_open=True)),
        metavar="SECONDS,...",
        help="Time steps: whole parts or whole multiples of the record's sampling interval, or "
        "without a record of the model's dt.",
    )
    halvings: int | None = options.analysis.option(
        rare=True,
        type=Count(0, 16),
        help="Without --dt: eight times that interval, halved so many times. By default 7 times, "
        "with some steps between; fewer times for very large buildings.",
    )
    stories: tuple[int, ...] | None = options.analysis.option(
        type=ListOf(click.IntRange(1, MOST_STORIES)),
        metavar="COUNT,...",
        help="Chart the building with these numbers of stories, its own ones repeated; with the "
        "interval itself as the step unless --dt or --halvings is given.",
    )
    duration: float | None = options.analysis.duration
    peers: bool = options.option(
        help="Also chart OpenSeesPy, if it is installed (pip install 'tdint[peers]'), and SciPy's "
        "solve_ivp: minutes."
    )
    repeat: int = options.option(
        type=Count(1, 1000), default=5, rare=True, help="Times each; 5 by default."
    )
    tolerances: tuple[float, ...] | None = options.analysis.option(
        "--tolerance",
        type=ListOf(Ratio(0.0, 1.0, min_open=True, max_open=True)),
        help="Also chart moment4 and impulse4 (of many problems those asked for) with the steps "
        "that `tdint run --tolerance` chooses for these errors of the peak drifts.",
    )
    target_error: str = options.option(
        type=click.Choice(TARGETS),
        default=TARGETS[0],
        help="The error that is drawn and, for one building, for which methods are recommended; "
        "peak-drift by default.",
    )
    versus: str = options.option(
        needs="--plot",
        type=click.Choice(["time", "steps", "solves", "dt"]),
        default="time",
        help="Draw time (default), steps or solves over error, or error over dt.",
    )
    highlight: str = options.option(
        needs="--plot",
        default="",
        metavar="NAME",
        help="The method whose line is thick and in front; by default the only one of a plug-in, "
        "if there is one.",
    )
    cache: bool = options.option(
        "--cache/--no-cache",
        default=True,
        rare=True,
        help="Keep the reference for the next time (default) or not.",
    )

    def of(self, model: str, record: str | None) -> BuildingRequest:
        """One of the buildings under one of the motions."""
        given = {
            field.name: getattr(self, field.name) for field in fields(options.record.RecordRequest)
        }
        return BuildingRequest(
            **given, model=model, record=record, scale=self.scale, duration=self.duration
        )


@options.command(
    "chart",
    "tdint chart office.yaml --method impulse4,newmark-average --dt 0.01",
    "tdint chart office.yaml --method impulse4,newmark-average --dt 0.01 --plot=chart.png",
)
@options.analysis.plugin
@options.record.of_motion
@options.output.to_files(
    "Write the table to this file instead of standard output, and a .json file beside it.",
    picture=options.output.PICTURE,
    in_units=False,
)
@options.of(Request)
def command(request: Request) -> None:
    """Compare the accuracy and computing time of methods: work-precision diagrams.

    Each method integrates the building with each step. MODEL.yaml is a model file, - is standard
    input. CSV: steps and solves; processor time of the compiled loop alone, as `tdint run` without
    --history has it (peaks and energies included, compilation not; wall time where the system's
    clock for it is coarse), the median and the least of the repeats, in which all methods take
    turns; relative errors; how `tdint run` ends: done, collapsed, unstable-step (refused), diverged
    or not-converged, the last three with empty cells. Other programs (--peers) are named
    program/method; their times are those of their analysis loops alone, the solves of scipy are
    evaluations of the rate. Lines by --tolerance have the time of all that `tdint run --tolerance`
    does, and the error of peak drifts alone.

    displacement_error, drift_error, velocity_error and absolute_acceleration_error are those of the
    whole history: root of the sum of squares over all floors or stories and all common times,
    relative to the reference. Common times are the samples of the record, or the steps' ends where
    these are further apart. peak_drift_error is the largest relative error of a story's peak drift;
    stories whose peak is below a thousandth of the largest are left out.

    The reference is computed, not assumed: by the exact method in linear buildings without floor
    forces, otherwise by impulse4 with a very small step. A second method confirms it, and how far
    this is from it goes to standard error, to the picture and to the .json file: smaller errors are
    not drawn. It is kept in TDINT_CACHE_DIR or the user's cache folder. Standard error also tells
    the cheapest method and step for an error of 1 % and 0.1 %.

    Several buildings or motions, or --problems: performance profiles. For each tolerance from 10 to
    0.01 % and the peaks of drift, absolute acceleration and total shear each method takes its
    cheapest step, of 16 samples to 1/16; the table tells how many problems it solves within a
    factor of the least cost (Dolan and More 2002). The reference is impulse4 with 32 steps a
    sample; where moment4, with up to 128, is farther from it than a fifth of a tolerance, the
    problem is not judged there. --peers: OpenSeesPy, on the problems whose laws it has. A method
    that does not take a problem does not solve it.
    """
    if request.problems or len(request.models) > 1 or len(request.records) > 1:
        refuse_idle(_PROBLEMS if request.problems else _MANY, MODES)
        _chart_many(request)
        return
    refuse_idle(_SIZES if request.stories else _ONE, MODES)
    building = _check(request)
    from tdint.analysis.given import model_record
    from tdint.model.config.model_file import load_model

    model = with_motion(load_model(building.model), building)
    record = model_record(model)
    if record:
        warn(*(f"{record.source}: {warning}" for warning in record.warnings))
    with progress_bar(request.outputs.table is None) as progress:
        if request.stories:
            from tdint.analysis.chart.problem import stretched

            # Of each number of stories; without other programs nothing is left out.
            advice: list[Advice] = []
            charts, left_out = [], list[str]()
            share = 1.0 / len(request.stories)
            for done, count in enumerate(request.stories):
                part = part_of(progress, done * share, (done + 1) * share, f"{count}: ")
                chart, advice, _ = _chart(request, stretched(model, count), record, part)
                charts.append(chart)
        else:
            chart, advice, left_out = _chart(request, model, record, progress)
            charts = [chart]
    notes = [*_notes(request, charts, record), *left_out]
    _deliver(request, charts, model, record, advice, notes)
    for chart in charts:
        reference = chart.reference
        say(
            f"{how_many(chart.stories, 'story')}: the reference is {reference.method} with dt "
            f"{reference.dt:.6g} s; {reference.confirmed_by} differs from it by "
            f"{reference.gap.of(request.target_error):.1e} ({request.target_error})."
        )
    if advice:
        _recommend(request, charts[0], advice)
    note(*notes)
    _tell_timing([chart.timing for chart in charts], charts[0].peers)


def _tell_timing(timings: Sequence[Timing], programs: Sequence[Peer]) -> None:
    """How the marches were timed, whether that was disturbed, and which other programs took
    part."""
    from tdint.system import CLOCKS

    worst = max(timings, key=lambda timing: timing.stretch or 0.0)
    say(f"Times are {CLOCKS[worst.clock]}, {worst.told}, {worst.processor}.")
    if worst.disturbed:
        warn(
            f"the marches took {worst.stretch:.3g} times their processor time on the wall: other "
            "work had the processors, and what shares their caches slows the marches, too; time "
            "them again on a quiet machine"
        )
    note(*(f"{peer.name} {peer.version}: {peer.settings}" for peer in programs))


def _check(request: Request) -> BuildingRequest:
    """The building and its motion, after what can be seen to fail was refused."""
    if not request.models:
        raise UsageError("give MODEL.yaml, or several, or --problems standard")
    if request.target_error not in QUANTITIES:
        raise UsageError(
            f"--target-error {request.target_error} is of many problems; of one it is "
            f"{', '.join(QUANTITIES)}"
        )
    if request.steps and request.halvings is not None:
        raise UsageError("--dt already gives the steps; leave out --halvings")
    if request.stories and peers():
        raise UsageError("PEERS of a plug-in are charted for one building; leave out --stories")
    building = request.of(request.models[0], request.records[0] if request.records else None)
    check_motion(building)
    return building


def _chart_many(request: Request) -> None:
    """Performance profiles over many problems."""
    if request.target_error not in PEAKS:
        raise UsageError(
            f"--target-error {request.target_error} is of one problem; of many it is "
            f"{', '.join(PEAKS)}"
        )
    if peers():
        raise UsageError("PEERS of a plug-in are charted for one building")
    from tdint.analysis.chart.profiles import METHODS, measure_all
    from tdint.output.summary import field_summary

    given = _problems(request)
    integrators = _integrators(request, METHODS)
    with progress_bar(request.outputs.table is None) as progress:
        chart = measure_all(
            given,
            integrators,
            repeats=request.repeat,
            tolerances=request.tolerances or (),
            peers=request.peers,
            progress=progress,
        )
    # Problems whose references are not known well enough for all tolerances
    notes = []
    for case in chart.measured:
        if doubtful := {name: case.gap.of(name) for name in PEAKS if not case.judges(name, 1e-4)}:
            gaps = ", ".join(f"{name} {gap:.1e}" for name, gap in doubtful.items())
            notes.append(
                f"{case.name}, {case.motion}: the reference is known to {gaps}: not judged where "
                "that is too far"
            )
        if case.peer_note:
            apart = "" if math.isnan(case.peer_gap) else f" {case.peer_gap:.1e} from the reference,"
            notes.append(f"{case.name}, {case.motion}: openseespy:{apart} {case.peer_note}")
    table = tables.methods.profile_table(chart)
    request.outputs.deliver(
        table,
        lambda: figures.comparison.profile_picture(
            chart, target=request.target_error, highlight=request.highlight
        ),
        lambda: field_summary(chart, notes=notes, meanings=table.meanings),
    )
    leaders = chart.leaders()
    say(
        f"{how_many(len(chart.measured), 'problem')}. Best overall (most within twice the least "
        f"cost): {leaders.overall}; for errors of 3 % and more: {leaders.coarse}; safest (fails "
        f"least): {leaders.safest}."
    )
    note(*notes)
    _tell_timing([chart.timing], chart.peers)


def _problems(request: Request) -> list[FieldProblem]:
    from tdint.analysis.chart.profiles import crossed, read_problems
    from tdint.model.config.model_file import load_model

    if request.problems:
        return read_problems(request.problems)
    models = []
    for file in request.models:
        model = load_model(file)
        # --duration holds for all of them, whatever each model says.
        model = replace(
            model,
            analysis=replace(model.analysis, duration=request.duration or model.analysis.duration),
        )
        for record in request.records or (None,):
            building = request.of(file, record)
            check_motion(building)
            models.append(with_motion(model, building))
    return crossed(models, ())


def _integrators(request: Request, usual: Sequence[str]) -> list[Integrator]:
    """The methods of a chart, after the one to highlight was found among them, or may be another
    program's."""
    integrators = options.analysis.integrators(request.methods or usual)
    labels = [integrator.label for integrator in integrators]
    programs = tables.methods.PEER in request.highlight or request.tolerances
    if request.highlight and request.highlight not in labels and not programs:
        raise UsageError(
            f"--highlight {request.highlight} is not among the methods: {', '.join(labels)}"
        )
    return integrators


def _chart(
    request: Request, model: Model, record: Record | None, progress: Progress
) -> tuple[Chart, list[Advice], list[str]]:
    from tdint.analysis.chart.problem import ending_together, pose
    from tdint.analysis.chart.work_precision import (
        DEFAULT_METHODS,
        cheapest,
        default_steps,
        halved_steps,
        measure,
        suited,
    )

    problem = pose(model, record, duration=request.duration, dts=request.steps or ())
    integrators = suited(problem, _integrators(request, DEFAULT_METHODS))
    # The steps: as they are given, halved so often, or for many stories the sampling interval alone
    if request.steps:
        steps: Sequence[float] = request.steps
    elif request.halvings is not None:
        steps = halved_steps(problem, request.halvings)
    else:
        steps = (
            [problem.interval]
            if request.stories
            else default_steps(problem, len(integrators), request.repeat)
        )
    problem = ending_together(problem, steps)
    of_ours = part_of(progress, 0.0, 0.2 if request.peers else 1.0)

    def verdict(points: Sequence[Point]) -> list[tuple[str, float]]:
        best = [cheapest(points, request.target_error, limit) for limit in LIMITS]
        return [(point.line, point.dt) for point in best if point]

    chart = measure(
        problem,
        integrators,
        steps,
        repeats=request.repeat,
        cached=request.cache,
        judge=verdict,
        progress=of_ours,
    )
    if request.tolerances:
        from tdint.analysis.chart.work_precision import with_tolerances

        chart = with_tolerances(problem, chart, request.tolerances, repeats=request.repeat)
    # Advice is of one building, and where errors tell something
    is_for_one = len(request.stories or ()) < 2 and not _peaks_at_start(request, chart)
    advice = _advice(request, chart, problem) if is_for_one else []
    left_out: list[str] = []
    others = part_of(progress, 0.2, 1.0)
    if request.peers:
        from tdint.analysis.chart.peers import with_peers

        chart, left_out = with_peers(problem, chart, steps, repeats=request.repeat, progress=others)
    if peers():
        from tdint.analysis.chart.peers import with_plugins

        chart, more = with_plugins(problem, chart, repeats=request.repeat, progress=others)
        left_out = [*left_out, *more]
    return chart, advice, left_out


def _advice(request: Request, chart: Chart, problem: Problem) -> list[Advice]:
    from tdint.analysis.chart.work_precision import alternative, cheapest
    from tdint.methods.catalogue import parse
    from tdint.output.summary import Advice

    advice = []
    ours = [point for point in chart.points if not math.isnan(point.dt)]
    for limit in LIMITS:
        best = cheapest(ours, request.target_error, limit)
        if best is None:
            advice.append(Advice(limit, None, None, math.nan))
            continue
        other = alternative(ours, request.target_error, limit, best)
        told = problem.told(parse(best.method), problem.steps(best.dt))
        advice.append(Advice(limit, best, other, told))
    return advice


def _peaks_at_start(request: Request, chart: Chart) -> bool:
    """Whether the errors asked for are those of peaks that are there from the start, as in free
    vibration."""
    motion = chart.reference.motion
    peaks, start = motion.peak_drift, abs(motion.drift[0])
    return request.target_error == "peak-drift" and bool((peaks <= 1.001 * start).all())


def _deliver(
    request: Request,
    charts: list[Chart],
    model: Model,
    record: Record | None,
    advice: list[Advice],
    notes: list[str],
) -> None:
    from tdint.output.summary import chart_summary

    looks: dict[str, Any] = {
        "name": model.name,
        "target": request.target_error,
        "highlight": request.highlight,
    }
    table = (
        tables.methods.sizes_table(charts)
        if request.stories
        else tables.methods.chart_table(charts[0])
    )

    def draw() -> Figure:
        if request.stories:
            return figures.assessment.sizes_picture(charts, **looks)
        return figures.assessment.chart_picture(charts[0], versus=request.versus, **looks)

    def summarize() -> dict[str, Any]:
        told: dict[str, Any] = {"target": request.target_error, "advice": advice, "notes": notes}
        return chart_summary(charts, model=model, record=record, meanings=table.meanings, **told)

    request.outputs.deliver(table, draw, summarize)


_RULE = (
    "Rule: the recommended method is the most accurate of those within 10 % of the least time. "
    "Other methods are listed only if they meet the tolerance and take at least as long; next best "
    "is the fastest of them. A method meets a tolerance if its smaller steps do so, too."
)


def _recommend(request: Request, chart: Chart, advice: list[Advice]) -> None:
    def cost(point: Point) -> str:
        error = point.error(request.target_error)
        return (
            f"{1e3 * point.fastest:.3g} ms, error {100.0 * error:.2g} %"
            if point.errors
            else point.outcome
        )

    for advised in advice:
        goal = f"For {100.0 * advised.limit:g} % ({request.target_error}): "
        if best := advised.point:
            told = (
                f", told {100.0 * advised.told:.2g} % of the peak drifts"
                if advised.told < math.inf
                else ""
            )
            # Only alternatives that meet the tolerance and take at least as long
            others = [("next best: ", advised.next_best)]
            usual = chart.usual
            meets = (
                usual.error(request.target_error) <= advised.limit and usual.fastest >= best.fastest
            )
            if meets and usual.line != (advised.next_best and advised.next_best.line):
                others.append(("the usual choice: ", usual))
            words = [
                f"; {word}{other.line} with dt {other.dt:.6g} s, "
                f"{other.fastest / best.fastest:.2g} times as long, error "
                f"{100.0 * other.error(request.target_error):.2g} %"
                for word, other in others
                if other and other.errors and (other.line, other.dt) != (best.line, best.dt)
            ]
            say(f"{goal}{best.line} with dt {best.dt:.6g} s, {cost(best)}{told}{''.join(words)}.")
        else:
            say(
                f"{goal}none of these methods and steps; add smaller steps with --dt or --halvings."
            )
    whose = "record" if chart.recorded else "model"
    say(
        f"The usual choice, {chart.usual.line} with the {whose}'s dt {chart.usual.dt:.6g} s: "
        f"{cost(chart.usual)}."
    )
    if advice:
        say(_RULE)


def _notes(request: Request, charts: list[Chart], record: Record | None) -> list[str]:
    """What a person should know of the chart."""
    from tdint.methods.catalogue import catalogue

    notes = list(record.notes) if record else []
    points = [point for chart in charts for point in chart.points]
    # Our methods take the impulse of all samples in a long step; other programs look at its end
    # alone.
    coarse = dict.fromkeys(
        p.method.partition(":")[0] for p in points if p.dt > charts[0].interval * 1.001
    )
    skipping = [name for name in coarse if name not in catalogue()]
    if record and skipping:
        notes.append(
            f"steps over {charts[0].interval:.6g} s skip samples of the record in "
            f"{', '.join(skipping)}"
        )
    for label, outcome in dict.fromkeys(
        (point.line, point.outcome) for point in points if not point.errors
    ):
        steps = dict.fromkeys(
            f"{p.dt:.6g}" for p in points if (p.line, p.outcome) == (label, outcome)
        )
        notes.append(f"{label}: {outcome} with dt {', '.join(steps)} s")
    for chart in charts:
        gap = chart.reference.gap.of(request.target_error)
        if _peaks_at_start(request, chart):
            notes.append(
                "the largest drifts are those at the start, which no method misses: use --target "
                "drift"
            )
        if not gap < min(LIMITS):
            notes.append(
                f"the reference is known to {gap:.1e} only: errors of that size are uncertain"
            )
    return notes
