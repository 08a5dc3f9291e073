"""`tdint chart`: computing time and error of methods for a building (work-precision diagrams)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from tdint import assessment
from tdint.errors import UsageError
from tdint.model.plugins import peers
from tdint.number_parsing import pluralize
from tdint.output import tables
from tdint.response.defaults import PEAKS, QUANTITIES
from tdint_cli import options
from tdint_cli.assessment import method_options
from tdint_cli.options.analysis import BuildingRequest, check_motion, with_motion
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import Count, FileName, ListOf, Number
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import Progress, note, part_of, progress_bar, say, warn

if TYPE_CHECKING:
    from tdint.assessment.chart.chart_summary import Advice
    from tdint.assessment.chart.problem import Problem
    from tdint.assessment.chart.work_precision import Chart, Peer, Point, Timing
    from tdint.ground_motion.record import Record
    from tdint.methods.method import Integrator
    from tdint.model.definition import Model
    from tdint.output.figures.style import Figure

TARGETS = tuple(QUANTITIES | PEAKS)
MOST_STORIES = 10_000
MOST_SECONDS = 1e6
LIMITS = (0.01, 0.001)
"""Errors for which a method and a time step are recommended."""


@options.request
class Request(options.record.RecordRequest):
    """The command line of `tdint chart`."""

    outputs: Outputs
    scale: tuple[float, ...] | None
    models: tuple[str, ...] = options.argument(
        "[MODEL.yaml]... [RECORD]...", nargs=-1, type=FileName()
    )
    records: tuple[str, ...] = options.option("--record", multiple=True)
    problems: str | None = options.option()
    methods: tuple[str, ...] = method_options.methods("ten methods, and exact if linear,")
    steps: tuple[float, ...] | None = options.option(
        "--dt", type=ListOf(Number(0.0, MOST_SECONDS, min_open=True))
    )
    halvings: int | None = options.option(type=Count(0, 16))
    stories: tuple[int, ...] | None = options.option(type=ListOf(click.IntRange(1, MOST_STORIES)))
    duration: float | None = options.option()
    peers: bool = options.option()
    repeat: int = options.option(type=Count(1, 1000), default=5)
    tolerances: tuple[float, ...] | None = options.option("--tolerance")
    target_error: str = options.option(type=click.Choice(TARGETS), default=TARGETS[0])
    versus: str = options.option(default="time")
    highlight: str = options.option(default="")
    cache: bool = options.option("--cache/--no-cache", default=True)

    def of(self, model: str, record: str | None) -> BuildingRequest:
        """Return the request for one building under one ground motion."""
        return BuildingRequest(
            choice=self.choice, model=model, record=record, scale=self.scale, duration=self.duration
        )


@options.command
@options.analysis.plugin
@options.record.motion_options
@options.output.to_files(picture=True, in_units=False)
@options.of(Request)
def command(request: Request) -> None:
    """Compare the accuracy and computing time of methods: work-precision diagrams.

    Each method integrates the building with each time step. MODEL.yaml is a model file, RECORD is a
    ground motion, and - is standard input. Files after the first are models if their names end with
    .yaml or .yml, otherwise records, as with --record.

    The CSV has a row for each method and time step, with the number of steps and solves, times,
    relative errors and the outcome. Times are processor times of the compiled time loop, as in
    `tdint run` without --history: with peaks and energies, without compilation. Wall time is used
    if the clock of the system for processor time is coarse. The median and the minimum of the
    repetitions are written; repetitions alternate between the methods. The outcome is, as in
    `tdint run`: done, collapsed, unstable-step (refused), diverged or not-converged. Cells without
    a result are empty. Other programs (--peers) are listed as program/method.
    Their times include only their analysis loops, and the solves of scipy are evaluations of the
    derivative. Rows of --tolerance contain the total time of `tdint run --tolerance`, and only the
    error of peak drifts.

    displacement_error, drift_error, velocity_error and absolute_acceleration_error are errors of
    the complete response history: root of the sum of squares over all floors or stories and all
    common times, relative to the reference. Common times are the samples of the record, or the ends
    of the time steps if these are longer. peak_drift_error is the maximum relative error of the
    peak drift of a story; stories with a peak below a thousandth of the maximum are ignored.

    The reference solution is computed: by the exact method in linear buildings without floor
    forces, otherwise by impulse4 with a very small time step. A second method confirms it. The
    difference between them is written to standard error, to the figure and to the .json file;
    smaller errors are not plotted. The reference is stored in TDINT_CACHE_DIR or the cache
    directory of the user. Standard error also reports the cheapest method and time step for errors
    of 1 % and 0.1 %.

    Several buildings or motions, or --problems, give performance profiles (Dolan and More 2002).
    For each tolerance from 10 to 0.01 % and for the peaks of drift, absolute acceleration and total
    shear, each method uses its cheapest time step, from 16 samples to 1/16 sample. The table
    reports the number of problems that the method solves within a factor of the lowest cost. The
    reference is impulse4 with 32 steps per sample. It is confirmed by moment4 with up to 128 steps
    per sample: if the results differ by more than a fifth of a tolerance, the problem is omitted at
    this tolerance. --peers adds OpenSeesPy for problems with laws that it supports. A problem that
    a method does not support counts as not solved.
    """
    request = _sorted_files(request)
    if request.problems or len(request.models) > 1 or len(request.records) > 1:
        refuse_idle("problems" if request.problems else "many")
        _chart_many(request)
        return
    refuse_idle("sizes" if request.stories else "building")
    building = _check(request)
    from tdint.model.config.model_file import load_model
    from tdint.response.arguments import model_record

    model = with_motion(load_model(building.model), building)
    record = model_record(model)
    if record:
        warn(*(f"{record.source}: {warning}" for warning in record.warnings))
    with progress_bar(request.outputs.table is None) as progress:
        if request.stories:
            from tdint.assessment.chart.problem import stretched

            # Compare the methods for each number of stories. Other programs are not run here.
            advice: list[Advice] = []
            charts, omissions = [], list[str]()
            share = 1.0 / len(request.stories)
            for done, count in enumerate(request.stories):
                part = part_of(progress, done * share, (done + 1) * share, f"{count}: ")
                chart, advice, _ = _chart(request, stretched(model, count), record, part)
                charts.append(chart)
        else:
            chart, advice, omissions = _chart(request, model, record, progress)
            charts = [chart]
    notes = [*_notes(request, charts, record), *omissions]
    _deliver(request, charts, model, record, advice, notes)
    for chart in charts:
        reference = chart.reference
        say(
            f"{pluralize(chart.stories, 'story')}: the reference is {reference.method} with dt "
            f"{reference.dt:.6g} s; {reference.confirmed_by} differs from it by "
            f"{reference.gap.of(request.target_error):.1e} ({request.target_error})."
        )
    if advice:
        _recommend(request, charts[0], advice)
    note(*notes)
    _report_timing([chart.timing for chart in charts], charts[0].peers)


def _sorted_files(request: Request) -> Request:
    """Return the request with the models in `models` and the records in `records`.

    The command line accepts both as arguments: models have the suffix .yaml or .yml, and the first
    file is always a model. UsageError is raised if records are specified both as arguments and with
    --record.
    """
    after_first = request.models[1:]
    records = tuple(file for file in after_first if not file.lower().endswith((".yaml", ".yml")))
    if records and request.records:
        raise UsageError(
            f"--record {request.records[0]} and {records[0]} cannot be used together; omit --record"
        )
    models = tuple(file for file in request.models if file not in records)
    return replace(request, models=models, records=records or request.records)


def _report_timing(timings: Sequence[Timing], programs: Sequence[Peer]) -> None:
    """Report the timing of the time integrations, any disturbance of it, and the other programs."""
    from tdint.system import CLOCKS

    # Report the timing with the largest ratio of wall time to processor time.
    timing = max(timings, key=lambda timing: timing.stretch or 0.0)
    say(f"Times are {CLOCKS[timing.clock]}, {timing.description}, {timing.processor}.")
    if timing.disturbed:
        warn(
            f"timing was disturbed: wall time was {timing.stretch:.3g} times the processor time "
            "because other processes used the processors and their caches; repeat the timing on an "
            "idle machine"
        )
    note(*(f"{peer.name} {peer.version}: {peer.settings}" for peer in programs))


def _check(request: Request) -> BuildingRequest:
    """Check the options of a call with a single building, and return the request for the building.
    UsageError is raised if no model is specified, or options cannot be used together.
    """
    if not request.models:
        raise UsageError(
            "a model is required; specify one or several MODEL.yaml, or --problems standard"
        )
    if request.target_error not in QUANTITIES:
        raise UsageError(
            f"--target-error {request.target_error} requires several models, several records or "
            "--problems; for one building under at most one record use "
            f"{', '.join(QUANTITIES)}"
        )
    if request.steps and request.halvings is not None:
        raise UsageError("--halvings cannot be used with --dt; omit one")
    if request.stories and peers():
        raise UsageError(
            "the plug-in defines other programs for comparison (PEERS), which cannot be used with "
            "--stories; omit --stories"
        )
    building = request.of(request.models[0], request.records[0] if request.records else None)
    check_motion(building)
    return building


def _chart_many(request: Request) -> None:
    """Compute performance profiles over many problems and write them. An option that requires a
    single building is a UsageError.
    """
    if request.target_error not in PEAKS:
        raise UsageError(
            f"--target-error {request.target_error} requires one building under at most one "
            "record; for several models, several records or --problems use "
            f"{', '.join(PEAKS)}"
        )
    if peers():
        raise UsageError(
            "the plug-in defines other programs for comparison (PEERS), which require one building "
            "under one record; specify one model and one record"
        )
    from tdint.assessment.chart.chart_summary import field_summary
    from tdint.assessment.chart.performance_profiles import METHODS, performance_profiles

    models = None if request.problems else _models(request)
    integrators = _integrators(request, METHODS)
    with progress_bar(request.outputs.table is None) as progress:
        chart = performance_profiles(
            models,
            problems=request.problems,
            method=[integrator.label for integrator in integrators],
            repeats=request.repeat,
            tolerances=request.tolerances or (),
            peers=request.peers,
            progress=progress,
        )
    # A reference with a gap (uncertainty) above the smallest tolerance, 1e-4, cannot assess errors
    # as small as this tolerance, so that a note lists the problem.
    notes = [f"not solved within 10 %: {text}" for text in chart.unsolved()]
    for case in chart.measured:
        if uncertain := {name: case.gap.of(name) for name in PEAKS if not case.judges(name, 1e-4)}:
            gaps = ", ".join(f"{name} {gap:.1e}" for name, gap in uncertain.items())
            notes.append(
                f"{case.name}, {case.motion}: reference accuracy {gaps}; not assessed at "
                "tolerances that require higher accuracy"
            )
        if case.peer_note:
            gap = "" if math.isnan(case.peer_gap) else f" {case.peer_gap:.1e} from the reference,"
            notes.append(f"{case.name}, {case.motion}: openseespy:{gap} {case.peer_note}")
    table = assessment.tables.profile_table(chart)
    request.outputs.deliver(
        table,
        lambda: assessment.chart_figures.profile_picture(
            chart, target=request.target_error, highlight=request.highlight
        ),
        lambda: field_summary(chart, notes=notes, meanings=table.meanings),
    )
    leaders = chart.leaders()
    say(
        f"{pluralize(len(chart.measured), 'problem')}. Best overall (most problems within twice "
        f"the lowest cost): {leaders.overall}; for errors of 3 % and more: {leaders.coarse}; most "
        f"robust (fewest failures): {leaders.safest}."
    )
    note(*notes)
    _report_timing([chart.timing], chart.peers)


def _models(request: Request) -> list[Model]:
    """Return all combinations of the models and records."""
    from tdint.model.config.model_file import load_model

    models = []
    for file in request.models:
        model = load_model(file)
        # --duration replaces the duration of every model.
        model = replace(
            model,
            analysis=replace(model.analysis, duration=request.duration or model.analysis.duration),
        )
        for record in request.records or (None,):
            # Options for this model and record, as on the command line of `tdint run`
            building_request = request.of(file, record)
            check_motion(building_request)
            models.append(with_motion(model, building_request))
    # The models already contain their records, so that no further records are specified.
    return models


def _integrators(request: Request, default: Sequence[str]) -> list[Integrator]:
    """Return the methods of a chart, without specified methods the default. UsageError is raised if
    --highlight is not one of the methods and cannot be the label of another program.
    """
    integrators = method_options.integrators(request.methods or default)
    labels = [integrator.label for integrator in integrators]
    programs = tables.methods.PEER in request.highlight or request.tolerances
    if request.highlight and request.highlight not in labels and not programs:
        raise UsageError(
            f"--highlight {request.highlight} must be one of the methods {', '.join(labels)}"
        )
    return integrators


def _chart(
    request: Request, model: Model, record: Record | None, progress: Progress
) -> tuple[Chart, list[Advice], list[str]]:
    """Measure the methods on one building. Return the times and errors, the recommended methods and
    time steps (if any), and notes about omitted other programs.
    """
    from tdint.assessment.chart.peers import with_peers, with_plugins
    from tdint.assessment.chart.problem import ending_together, pose
    from tdint.assessment.chart.work_precision import (
        DEFAULT_METHODS,
        cheapest,
        default_steps,
        halved_steps,
        measure,
        suited,
    )

    problem = pose(model, record, duration=request.duration, dts=request.steps or ())
    integrators = suited(problem, _integrators(request, DEFAULT_METHODS))
    # The time steps are the requested steps or halvings. With --stories, only the sampling interval
    # is used, because a chart over the number of stories shows a single time step.
    if request.steps:
        steps: Sequence[float] = request.steps
    elif request.halvings is not None:
        steps = halved_steps(problem, request.halvings)
    elif request.stories:
        steps = [problem.interval]
    else:
        steps = default_steps(problem, len(integrators), request.repeat)
    problem = ending_together(problem, steps)
    # The methods of tdint need about a fifth of the time if other programs also run.
    own_progress = part_of(progress, 0.0, 0.2 if request.peers else 1.0)

    def recommended(points: Sequence[Point]) -> list[tuple[str, float]]:
        """Return the recommended runs (label of the method, time step in s): the cheapest for each
        error limit that a method meets. `measure` repeats the timing until this result no longer
        changes.
        """
        cheapest_points = [cheapest(points, request.target_error, limit) for limit in LIMITS]
        return [(point.line, point.dt) for point in cheapest_points if point]

    chart = measure(
        problem,
        integrators,
        steps,
        repeats=request.repeat,
        cached=request.cache,
        tolerances=request.tolerances or (),
        judge=recommended,
        progress=own_progress,
    )
    # Recommend methods only for one building, and only if the errors are meaningful.
    can_recommend = len(request.stories or ()) < 2 and not _peaks_at_start(request, chart)
    advice = _advice(request, chart, problem) if can_recommend else []
    # Other programs: OpenSeesPy and SciPy on request, and the programs of plug-ins.
    peer_settings: dict[str, Any] = {
        "repeats": request.repeat,
        "progress": part_of(progress, 0.2, 1.0),
    }
    omissions: list[str] = []
    if request.peers:
        chart, omissions = with_peers(problem, chart, steps, **peer_settings)
    chart, plugin_omissions = with_plugins(problem, chart, **peer_settings)
    return chart, advice, [*omissions, *plugin_omissions]


def _advice(request: Request, chart: Chart, problem: Problem) -> list[Advice]:
    """Return the cheapest method and time step for each error limit of `LIMITS`.

    The limits apply to the error that --target-error selects. Each advice also contains the error
    of the peak drifts that `tdint run` would estimate for this method and time step.
    """
    from tdint.assessment.chart.chart_summary import Advice
    from tdint.assessment.chart.work_precision import alternative, cheapest
    from tdint.methods.catalogue import parse

    advice = []
    # Methods that choose their time steps (dt is NaN) cannot be recommended with a time step.
    with_dt = [point for point in chart.points if not math.isnan(point.dt)]
    for limit in LIMITS:
        best = cheapest(with_dt, request.target_error, limit)
        if best is None:
            advice.append(Advice(limit, None, None, math.nan))
            continue
        next_best = alternative(with_dt, request.target_error, limit, best)
        estimated_error = problem.estimate_error(parse(best.method), problem.steps(best.dt))
        advice.append(Advice(limit, best, next_best, estimated_error))
    return advice


def _peaks_at_start(request: Request, chart: Chart) -> bool:
    """Return True if the target error is peak-drift and the peak drifts occur at the start.

    This is the case for free vibration from an initial displacement. The errors of the peak drifts
    are then zero for all methods.
    """
    motion = chart.reference.motion
    peaks, start = motion.peak_drift, abs(motion.drift[0])
    # The factor allows for rounding and for small discretization errors of the peaks.
    return request.target_error == "peak-drift" and bool((peaks <= 1.001 * start).all())


def _deliver(
    request: Request,
    charts: list[Chart],
    model: Model,
    record: Record | None,
    advice: list[Advice],
    notes: list[str],
) -> None:
    """Write the table, the figure and the summary of one building.

    `record` is the record; None for a model without a record.
    """
    from tdint.assessment.chart.chart_summary import chart_summary

    settings: dict[str, Any] = {
        "name": model.name,
        "target": request.target_error,
        "highlight": request.highlight,
    }
    table = (
        assessment.tables.sizes_table(charts)
        if request.stories
        else assessment.tables.chart_table(charts[0])
    )

    def draw() -> Figure:
        """Return the figure of a single chart, or of the charts for several numbers of stories."""
        if request.stories:
            return assessment.chart_figures.sizes_picture(charts, **settings)
        return assessment.chart_figures.chart_picture(charts[0], versus=request.versus, **settings)

    def summarize() -> dict[str, Any]:
        """Return the content of the JSON file: the charts, the recommendations and the notes."""
        return chart_summary(
            charts,
            model=model,
            record=record,
            meanings=table.meanings,
            target=request.target_error,
            advice=advice,
            notes=notes,
        )

    request.outputs.deliver(table, draw, summarize)


# The last line of the recommendations explains how they were chosen.
_RULE = (
    "Of the methods that meet the tolerance in at most 1.1 times the shortest time, the most "
    "accurate is recommended; next best is the fastest of the other methods that take at least as "
    "long. A time step meets the tolerance if all smaller steps of its method meet it, too."
)


def _recommend(request: Request, chart: Chart, advice: list[Advice]) -> None:
    """Write the recommended methods and the default method, with their times and errors.

    `advice` contains the recommended methods and time steps, one for each error of `LIMITS`.
    """

    for recommendation in advice:
        say(_recommendation_text(request, chart.usual, recommendation))
    source = "record" if chart.recorded else "model"
    say(
        f"Common choice, {chart.usual.line} with dt {chart.usual.dt:.6g} s of the {source}: "
        f"{_cost_text(chart.usual, request.target_error)}."
    )
    if advice:
        say(_RULE)


def _cost_text(point: Point, target_error: str) -> str:
    """Return the time (ms) and the error (%) of a measured run, or its outcome if it failed.

    `target_error` is the type of the error, such as `drift`.
    """
    if not point.errors:
        return point.outcome
    return f"{1e3 * point.fastest:.3g} ms, true error {100.0 * point.error(target_error):.2g} %"


def _recommendation_text(request: Request, usual: Point, advice: Advice) -> str:
    """Return a sentence with the cheapest method for an error limit and its alternatives."""
    target = request.target_error
    goal = f"For {100.0 * advice.limit:g} % ({target}): "
    best, next_best = advice.point, advice.next_best
    if best is None:
        return (
            f"{goal}no method meets this error with these time steps; add smaller steps with "
            "--dt or --halvings."
        )
    text = f"{goal}{best.line} with dt {best.dt:.6g} s, {_cost_text(best, target)}"
    if advice.estimated_error < math.inf:
        # `tdint run` does not have the true error and reports its estimate.
        text += f" (`tdint run` will estimate {100.0 * advice.estimated_error:.2g} %)"
    alternatives = [("next best", next_best)]
    # The common choice is an alternative if it meets the tolerance and takes at least as long.
    is_alternative = usual.error(target) <= advice.limit and usual.fastest >= best.fastest
    if is_alternative and not (next_best and usual.line == next_best.line):
        alternatives.append(("common choice", usual))
    for label, point in alternatives:
        if point and point.errors and (point.line, point.dt) != (best.line, best.dt):
            text += (
                f"; {label}: {point.line} with dt {point.dt:.6g} s, "
                f"{point.fastest / best.fastest:.2g} times as long, true error "
                f"{100.0 * point.error(target):.2g} %"
            )
    return f"{text}."


def _notes(request: Request, charts: list[Chart], record: Record | None) -> list[str]:
    """Return the notes about the charts: skipped samples, failed runs, uncertain references.

    `charts` contains the measured times and errors; with --stories, one chart for each number of
    stories. `record` is the ground motion; None for a problem without a record.
    """
    from tdint.methods.catalogue import catalogue

    notes = list(record.notes) if record else []
    points = [point for chart in charts for point in chart.points]
    # The methods of tdint use the impulse of all samples in a long time step. Other programs use
    # only the sample at its end. The factor allows for rounding of the time step.
    with_long_steps = dict.fromkeys(
        p.method.partition(":")[0] for p in points if p.dt > charts[0].interval * 1.001
    )
    skipping_samples = [name for name in with_long_steps if name not in catalogue()]
    if record and skipping_samples:
        notes.append(
            f"time steps longer than {charts[0].interval:.6g} s skip samples of the record in "
            f"{', '.join(skipping_samples)}"
        )
    failed = [point for point in points if not point.errors]
    for line, outcome in dict.fromkeys((point.line, point.outcome) for point in failed):
        steps = dict.fromkeys(
            f"{p.dt:.6g}" for p in failed if (p.line, p.outcome) == (line, outcome)
        )
        notes.append(f"{line}: {outcome} with dt {', '.join(steps)} s")
    for chart in charts:
        gap = chart.reference.gap.of(request.target_error)
        if _peaks_at_start(request, chart):
            notes.append(
                "the peak drifts occur at the start, where all methods are exact; use "
                "--target-error drift"
            )
        if not gap < min(LIMITS):
            notes.append(
                f"the reference is accurate only to {gap:.1e}; errors of this size are uncertain"
            )
    return notes
