"""`tdint run`: the response history of a building."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint import system
from tdint.errors import AnalysisError, UsageError
from tdint.files import check_disk_space, is_folder, is_there, write_files
from tdint.number_parsing import pluralize
from tdint.output import figures, tables
from tdint.units import OutputUnits
from tdint_cli import options
from tdint_cli.commands.run_request import (
    ALL_FILES,
    MODES,
    SEQUENCE,
    SEVERAL,
    SINGLE,
    STORIES,
    SUMMARY,
    Request,
)
from tdint_cli.drawing import emit_table
from tdint_cli.options.analysis import with_motion
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.suite import check_limit_options, kept_words
from tdint_cli.terminal import complain, is_quiet, note, say, warn

if TYPE_CHECKING:
    from tdint.analysis.run.case import Case
    from tdint.analysis.run.outcome import Collapse, Response, StepChoice, StoryPeaks
    from tdint.files import Content
    from tdint.ground_motion.record import Input, Record
    from tdint.model.definition import Model
    from tdint.output.tables.table import Table
    from tdint.output.verdicts import Verdict

_FIGURE_STEPS = 20_000  # maximum number of time steps in a figure
_MIN_BYTES = (6.0, 2.0)
"""Minimum bytes of a number in a response history, and in a compressed one; typically 18 and 8."""

_MIN_PROBABILITY = 5e-4
"""Probability below which a damage state is omitted from the summary."""


@options.command(
    "run",
    "tdint run office.yaml",
    "tdint run office.yaml --tolerance 1% -o out --history --plot",
    exits={5: "the run failed, or with --require the drift limit is exceeded"},
)
@options.analysis.model
@options.record.of_record
@options.spectra.of_floors
@options.of(Request)
def command(request: Request) -> None:
    """Compute the response history of a building and the peaks of each story.

    MODEL.yaml is a model file and RECORD a ground motion; one of them may be - (standard input).
    The table of stories is written to standard output as CSV, and with -o also to a directory. The
    options under Record apply to RECORD; without RECORD they replace the settings of the record in
    the model. --method, --dt and --duration replace the settings of the analysis in the model.
    --overwrite replaces all files of an earlier run; files that the new run does not write are
    removed.

    With --sequence the records are successive events (main shock, aftershocks); the table lists the
    stories for each event and for the complete sequence.

    With several records, a directory of records, several scales (--scale 0.5,1,2) or --factors the
    table has one row per run instead; all horizontal components are used unless --component selects
    one. With -o the runs are a small campaign: runs.csv, profiles.csv (mean, fractiles and maximum
    over the ground motions for each story) and campaign.sqlite, which `tdint campaign status`,
    `export` and `merge` read. An interrupted call can be resumed with the same command line.
    """
    if request.record is not None and request.records:
        raise UsageError(
            f"--record {request.record} and {request.records[0]} cannot be used together; omit one "
            "of them"
        )
    named = (request.record,) if request.record is not None else request.records
    models = [file for file in named if file.lower().endswith((".yaml", ".yml"))]
    if models:
        raise UsageError(
            f"{models[0]} is a model, but `tdint run` accepts one model: to run several buildings "
            "under the same records, use a campaign with `buildings: {models: "
            f"[{', '.join([request.model, *models])}]}}` (tdint campaign FILE -o DIR)"
        )
    method = request.method
    if method and "," in method and ":" not in method:
        raise UsageError(
            f"--method {method}: `tdint run` accepts one method; use `tdint chart {request.model} "
            f"--method {method}` to compare methods, or a separate call per method with --history"
        )
    shocks = named if request.sequence else ()
    scale = request.scale if shocks else tuple(dict.fromkeys(request.scale or ())) or None
    request = replace(request, record=named[0] if named else None, scale=scale, shocks=shocks)
    if request.check is False and request.tolerance is not None:
        raise UsageError(
            "--tolerance and --no-check cannot be used together, because --tolerance requires "
            "error estimates; omit one of them"
        )
    if request.sequence:
        refuse_idle(SEQUENCE, MODES)
        request.check_sequence()
        _run(request)
        return
    if request.factors is not None and request.scale:
        raise UsageError("--factors and --scale cannot be used together; omit one of them")
    if (
        request.factors is not None
        or len(named) > 1
        or len(request.scale or ()) > 1
        or (named and is_folder(named[0]))
    ):
        refuse_idle(SEVERAL, MODES)
        request.of_floors.check(request.output)
        from tdint_cli.commands.many_runs import run_many

        run_many(request, named)
    else:
        refuse_idle(SINGLE, MODES)
        _run(request)


def _run(request: Request) -> None:
    """Run one analysis or one sequence, write its files and print its summary.

    Parameters
    ----------
    request : Request
        Options of the command line.
    """
    began = time.perf_counter()
    from tdint.analysis.arguments import model_record, number_of
    from tdint.analysis.run.error_estimate import reference
    from tdint.analysis.run.outcome import FailedRun
    from tdint.analysis.run.prepared import run_interpreted
    from tdint.analysis.run.run import prepare
    from tdint.model.config.model_file import load_model

    request.check_files()
    model = (
        load_model(request.model)
        if request.sequence
        else with_motion(load_model(request.model), request)
    )
    asked = request.output_units
    model = replace(
        model, output_units=asked or model.output_units, page_units=asked or model.page_units
    )
    request = replace(request, output_units=model.output_units)
    check_limit_options(request.limit, request.require, [model])
    request.of_floors.chosen_floors(len(model.stories))
    if model.damage:
        from tdint.campaign.fragility.type_states import own_type

        own_type(model)  # invalid damage states are refused before the run
    # Read the records of a sequence, with one factor each or a common factor. Otherwise read the
    # record of the model, if there is one.
    factors = request.scale or (1.0,)
    shocks = []
    for number, file in enumerate(request.shocks):
        scale = (factors[number if len(factors) > 1 else 0],)
        shock = model_record(with_motion(model, replace(request, record=file, scale=scale)))
        assert shock is not None
        shocks.append(shock)
    record = None if shocks else model_record(model)
    of_records = [source for read in shocks or filter(None, [record]) for source in read.inputs]
    case = prepare(
        model,
        shocks[0] if shocks else record,
        method=request.method,
        allow_unstable=request.allow_unstable,
    )
    # Print these warnings before the integration: an incorrect unit can explain a failure, and a
    # smaller time step does not correct it.
    unusual = [*case.plausibility_warnings, *_of_record(None if shocks else case.record)]
    if not (shocks or request.tolerance or request.until_rest):
        dt, duration = number_of(request.dt, "dt"), number_of(request.duration, "duration")
        steps = case.steps(dt, duration).count
        if request.history:
            _check_room(request, len(model.stories), steps)
        methods, count = [case.method], steps
        if request.check is not False:  # a second run with half the time step
            methods, count = [case.method, reference(case).method], 3 * steps
        warn(*unusual)
        run_interpreted(case.prepared, methods, count)
    else:
        warn(*unusual)
    try:
        response = _respond(case, shocks, request)
        record = response.record
    except FailedRun as failure:
        from tdint.analysis.spectra.elastic import first_mode
        from tdint.output.run_summary import failure_summary
        from tdint.output.summary import model_input

        # Write only the summary, which states how far the run came.
        warn(*_of_record(record if shocks else None))
        note(*failure.notes)
        wall_time, first = time.perf_counter() - began, first_mode(case.building, case.record)
        content = failure_summary(
            failure,
            case.model,
            case.record,
            [model_input(model), *of_records],
            wall_time,
            first=first,
            settings=request.settings,
        )
        _write(request, {}, content)
        raise
    judged = _judged(response, request.limit, request.units_shown)
    stories = tables.responses.response_table(response).in_units(request.units_shown)
    emit_table(stories)
    _write(request, *_files(request, response, stories, case, of_records, began))
    say(_paragraph(response, request.units_shown))
    say(*(verdict.text for verdict in judged))
    if response.collapse:
        whose = f"{response.model.name}: " * is_quiet()
        complain(whose + _collapsed(response, response.collapse))  # It affects the peaks.
    warn(*(text for text in response.warnings if text not in case.plausibility_warnings))
    warn(*_of_record(record if shocks else None))
    note(*response.notes)
    if request.require and (beyond := [verdict.text for verdict in judged if not verdict.met]):
        of_option = "the drift limit is exceeded: " * isinstance(request.limit, float)
        raise AnalysisError(of_option + " ".join(beyond))


def _judged(response: Response, limit: float | str | None, units: OutputUnits) -> list[Verdict]:
    """Compare the demands of a run with the limits.

    Parameters
    ----------
    response : Response
        The response of the run.
    limit : float, str or None
        The drift limit or the performance level of the command line; None for all limits of the
        model.
    units : OutputUnits
        The units of the sentences.

    Raises
    ------
    UsageError
        The building has no story with a height.
    """
    if limit is None and not response.model.limits:
        return []
    from tdint.output.verdicts import run_verdicts

    return run_verdicts(response.limit_checks(limit), response.status, units)


def _respond(case: Case, shocks: list[Record], request: Request) -> Response:
    """Integrate one analysis, or a sequence if there are records of a sequence.

    Parameters
    ----------
    case : Case
        Prepared model, ground motion and method.
    shocks : list of Record
        Records of the sequence; empty for a single analysis.
    request : Request
        Options of the command line.
    """
    from tdint.analysis.run.run import run_case

    settings: dict[str, Any] = {
        "dt": request.dt,
        "history": bool(request.of_floors.floors or request.export_floors),
        "check": request.check,
        "tolerance": request.tolerance,
        "until_rest": request.until_rest,
    }
    if shocks:
        from tdint.analysis.run.sequence import run_sequence

        return run_sequence(case, shocks, rest=request.rest, **settings)
    return run_case(case, duration=request.duration, **settings)


def _of_record(record: Record | None) -> list[str]:
    """Return the warnings of a record with its file; empty without a record."""
    return [f"{record.source}: {text}" for text in record.warnings] if record else []


def _check_room(request: Request, stories: int, steps: int) -> None:
    """Raise OutputError if the disk has not enough space for the response history.

    Parameters
    ----------
    request : Request
        Options of the command line.
    stories : int
        Number of stories.
    steps : int
        Number of time steps.
    """
    if file := request.history_file:
        columns = len(tables.responses.history_columns(stories, bool(request.check)))
        check_disk_space(
            file,
            (steps // request.history_every + 1) * columns * _MIN_BYTES[file.suffix == ".gz"],
        )


def _files(
    request: Request,
    response: Response,
    stories: Table,
    case: Case,
    of_records: list[Input],
    began: float,
) -> tuple[dict[Path, Content], dict[str, Any]]:
    """Return the files of a run except the summary, and the content of the summary.

    Parameters
    ----------
    request : Request
        The options of the command line.
    response : Response
        The response of the run.
    stories : Table
        The table of stories.
    case : Case
        The analysis.
    of_records : list of Input
        The files from which the ground motions were read.
    began : float
        Time at which the run started, s (`time.perf_counter`).

    Returns
    -------
    files : dict of Path to Content
        The content of each file, or the function that writes it.
    content : dict
        The content of the summary; empty if neither -o nor --report is given.
    """
    units = request.units_shown
    files: dict[Path, Content] = {}
    if request.output:
        files[Path(request.output) / STORIES] = stories.csv()
    _check_room(request, len(response.model.stories), response.steps)
    if (file := request.history_file) and (pieces := response.history_chunks):
        # Error columns enlarge the file by half: they are written only with --check.
        kept = (
            piece if request.check else replace(piece, error=None)
            for piece in pieces(request.history_every)
        )
        files[file] = lambda stream: tables.responses.write_pieces(kept, stream, units)
    if request.output:
        of_floors, notes = request.of_floors.files(
            response,
            Path(request.output),
            units,
            plot=request.plot is not None,
            export=request.export_floors,
        )
        files |= of_floors
        note(*notes)
    if picture := request.picture_file:
        files[picture] = figures.style.picture(
            picture.suffix, lambda: figures.runs.run_picture(_thinned(response), units)
        )
    if not (request.output or request.report):
        return files, {}
    # Imported here, because a run without a summary loads a fifth less code.
    from tdint.analysis.spectra.elastic import first_mode
    from tdint.output.run_summary import run_summary
    from tdint.output.summary import files_read, merged_inputs, model_input

    wall_time = time.perf_counter() - began
    first = first_mode(case.building, response.record)
    checks = response.limit_checks(request.limit)
    content = run_summary(
        response,
        [model_input(case.model), *of_records],
        wall_time,
        first=first,
        settings=request.settings,
        limits=checks,
    )
    if request.report:
        from tdint.output.page import Told, page_units
        from tdint.output.report import run_page
        from tdint.output.verdicts import (
            governing_story,
            has_isolator_limit,
            isolator_sentence,
            limit_table,
        )

        model = response.model
        page = page_units(model.page_units)
        # The verdict on the limit; without a limit the maximum demands.
        verdict: list[tuple[bool | None, str]] = [
            (None, f"Maximum {_largest(model, response.stories, page, page=True)}.")
        ]
        if judged := _judged(response, request.limit, page):
            verdict = [
                (met, kept_words(bool(met)) + text if single_limit else text)
                for met, text, single_limit in judged
            ]
            # The displacement of isolators is a result that a drift limit does not cover.
            isolators = isolator_sentence(response.isolator_check, page, mean=False)
            verdict += [(None, isolators)] * bool(isolators and not has_isolator_limit(checks))
        # A collapse is the headline of the report, before the limit and the maximum demands.
        collapse: list[tuple[bool | None, str]] = []
        if response.collapse:
            collapse = [(False, _collapsed(response, response.collapse))]
        # Warnings of the record come before warnings of the run.
        warnings = []
        if response.record is not None:
            warnings += [f"{response.record.source}: {text}" for text in response.record.warnings]
        table = limit_table({"": checks}, page, mean=False) if checks else None
        told = Told(
            # The verdict is not repeated below itself.
            said=[
                line
                for line in _paragraph(response, page, page=True).splitlines()
                if line not in [text for _, text in verdict]
            ],
            verdict=[*collapse, *verdict],
            warnings=[*warnings, *response.warnings],
            head=model.page_head,
            inputs=merged_inputs(content["inputs"], files_read()),
            limits=table,
            governing_story=governing_story(checks),
        )
        floors = request.of_floors.of_run(response)
        files[Path(request.report)] = run_page(_thinned(response), told, floors=floors, units=page)
    return files, content


def _thinned(response: Response) -> Response:
    """Return the response with a history of at most the number of time steps of a figure."""
    from tdint.analysis.run.outcome import History

    assert response.history_chunks is not None
    if response.history is not None:
        return response
    chunks = response.history_chunks(-(-response.steps // _FIGURE_STEPS))
    return replace(response, history=History.joined(chunks))


def _write(request: Request, files: dict[Path, Content], content: dict[str, Any]) -> None:
    """Write the files of this run, and the summary last.

    The summary lists the files in its directory. With --overwrite, files that the summary of an
    earlier run lists are removed.

    Parameters
    ----------
    request : Request
        Options of the command line.
    files : dict of Path to Content
        Contents of the files, without the summary.
    content : dict
        Content of the summary, without the list of files.
    """
    # Without a directory there is no summary that lists the files of an earlier run.
    if request.output is None:
        write_files(files, overwrite=request.overwrite)
        return
    from tdint.output.run_summary import UNITS
    from tdint.output.summary import listed_files

    folder = Path(request.output)

    def summary(digests: Mapping[Path, str]) -> bytes:
        """Return the summary with the SHA-256 of the files in its directory.

        Parameters
        ----------
        digests : mapping of Path to str
            SHA-256 of each written file.
        """
        written_here = [
            {"file": file.name, "sha256": sha}
            for file, sha in digests.items()
            if file in possible_files
        ]
        return options.output.summary_bytes(
            content | {"files": written_here}, request.units_shown, UNITS
        )

    possible_files = request.in_folder(ALL_FILES)
    earlier = {
        folder / name: sha
        for name, sha in listed_files(folder / SUMMARY).items()
        if folder / name in possible_files
    }
    write_files(files, overwrite=request.overwrite, stale=earlier, last=(folder / SUMMARY, summary))
    if changed := [
        file.name
        for file in possible_files
        if file not in files and file.name != SUMMARY and is_there(file)
    ]:
        note(f"{folder}: {', '.join(changed)}: changed since an earlier run wrote it; not removed")


def _paragraph(response: Response, units: OutputUnits, *, page: bool = False) -> str:
    """Return the summary of a run as text. On a report page, drift ratios are in percent and the
    computing time is omitted.

    Parameters
    ----------
    response : Response
        The response of the run.
    units : OutputUnits
        The units of the values.
    page : bool
        True for the text of a report page.
    """
    from tdint.analysis.run.demands import demands

    # Building, ground motion, method, time step, and maximum demands
    record = response.record
    motion = "no ground motion"
    if record is not None:
        pga = units.of(record.pga, "m/s^2")
        motion = (
            f"{record.name} (PGA {pga:{'.3g' if pga < 1000.0 else '.0f'}} {units.unit('m/s^2')[0]})"
        )
    # Name the clock unless it measures the processor time of the thread.
    clock = system.clock()
    clock_text = "" if clock == "thread_time" else f" of {system.CLOCKS[clock]}"
    microseconds = 1e6 * response.solver_time / response.steps
    cost = "" if page else f"{microseconds:.3g} us per step{clock_text}, "
    lines = [
        f"{response.model.name}: {pluralize(len(response.model.stories), 'story')}, {motion}.",
        f"{response.method}: {pluralize(response.steps, 'step')} of {response.dt:.6g} s, "
        f"{cost}energy error {response.energy.error:.1e}.",
        f"Maximum {_largest(response.model, response.stories, units, page)}.",
    ]
    # Each event of a sequence with its residual drift; drift ratios if stories have heights
    for number, shock in enumerate(response.events, start=1):
        largest = demands(shock.stories)
        drift, ratio, residual = largest.drift, largest.drift_ratio, largest.residual_drift_ratio
        drift_text = f"{units.text(drift.value, 'm')} in story {drift.place}"
        if residual.place is not None:
            drift_text = (
                f"ratio {ratio.value:.4g} in story {ratio.place}, residual {residual.value:.3g}"
            )
        lines.append(f"Event {number}, from {shock.start:.6g} s: maximum drift {drift_text}.")
    if response.model.damage:
        lines.append(_damage(response, units))
    if response.time_at_rest is not None:
        lines.append(f"Free vibration has decayed at {response.time_at_rest:.6g} s.")
    # Estimated errors of the peaks
    if (check := response.check) and check.drift_error is not None:
        if check.step_choice is not None:
            lines.append(_chosen(response, check.step_choice))
        method, several = check.method.partition(":")[0], len(check.time_steps) > 1
        dts = " and ".join(f"{dt:.6g}" for dt in check.time_steps)
        source = f"from {'runs' if several else 'a run'} of {method} with dt {dts} s"
        lines.append(
            f"Maximum estimated error of a peak drift: {100.0 * check.drift_error:.2g} % (story "
            f"{check.drift_story}), {source}."
        )
        # Report the more accurate peaks only if they differ in the printed digits.
        corrected = check.corrected and _largest(response.model, check.corrected, units, page)
        if corrected and corrected != _largest(response.model, response.stories, units, page):
            lines.append(f"In that run: maximum {corrected}.")
    return "\n".join(lines)


def _largest(model: Model, stories: StoryPeaks, units: OutputUnits, page: bool = False) -> str:
    """Return the maximum demands of a run.

    Parameters
    ----------
    model : Model
        The building.
    stories : StoryPeaks
        The peaks of the stories.
    units : OutputUnits
        The units of the values.
    page : bool
        True for a report page: drift ratios in percent, and always the base shear with viscous
        forces, which the table of the stories contains. The table has no other base shear if a
        story has dashpots. The base shear of the springs is first in other texts.
    """
    from tdint.analysis.run.demands import demands

    largest = demands(stories)
    worst = f"drift {units.text(largest.drift.value, 'm')} in story {largest.drift.place}"
    if largest.drift_ratio.place is not None:
        value = (
            f"{100.0 * largest.drift_ratio.value:.4g} %"
            if page
            else f"{largest.drift_ratio.value:.4g}"
        )
        ratio = f"drift ratio {value} in story {largest.drift_ratio.place}"
        # A story without a height has no drift ratio: report its drift in addition. For a building
        # with isolators this is their displacement.
        isolators = [i for i, story in enumerate(model.stories) if story.isolator]
        if isolators:
            moved = max(isolators, key=lambda i: stories.peak_drift[i])
            shown = units.text(float(stories.peak_drift[moved]), "m")
            worst = f"{ratio}, isolator displacement {shown} in story {moved + 1}"
        elif all(story.drift_height for story in model.stories):
            worst = ratio
        else:
            worst = f"{ratio}, {worst}"
    roof = units.text(largest.roof_displacement.value, "m")
    springs = units.text(largest.base_shear.value, "N")
    total = f"{units.text(largest.total_base_shear.value, 'N')} with viscous forces"
    base = springs
    if any(story.dashpot or story.power_dashpot for story in model.stories):
        base = total if page else f"{springs} ({total})"
    elif page:
        base = f"{total} ({springs} without)"
    return f"{worst}, roof displacement {roof}, base shear {base}"


def _damage(response: Response, units: OutputUnits) -> str:
    """Return a sentence on the damage according to the damage states of the model.

    Parameters
    ----------
    response : Response
        Result of a run of a model with damage states.
    units : OutputUnits
        Units of the values in the text.
    """
    from tdint.campaign.fragility.runs import damage_of_run
    from tdint.model.damage_states import DEMANDS

    damage = damage_of_run(response.model, response.stories, response.status)
    assert damage is not None
    states, demand = damage.states, DEMANDS[damage.states.demand]
    value = (
        f"{damage.demand[0]:.4g}"
        if demand.unit == "1"
        else units.text(float(damage.demand[0]), demand.unit)
    )
    # Omit outcomes with negligible probability.
    shares = (
        f"{outcome} {100.0 * probability:.3g} %"
        for outcome, probability in zip(
            states.outcomes, damage.probability[0].tolist(), strict=True
        )
        if probability >= _MIN_PROBABILITY
    )
    loss = f"; mean loss ratio {damage.loss[0]:.3g}" if states.losses else ""
    return (
        f"Damage by {states.demand.replace('_', ' ')} {value}: {damage.state[0]} "
        f"({', '.join(shares)}){loss}."
    )


def _chosen(response: Response, choice: StepChoice) -> str:
    """Return sentences on the selected time step and its number of solutions.

    Parameters
    ----------
    response : Response
        Result of the run with the selected time step.
    choice : StepChoice
        Tolerance of the selection, and the numbers of runs and equation solutions.
    """
    line = (
        f"Time step selected for peak drift errors below {100.0 * choice.tolerance:g} %, from "
        f"{pluralize(choice.runs, 'run')}: "
    )
    line += f"{response.dt:.6g} s"
    if choice.samples is not None:
        line += (
            f", {choice.samples:g} sampling {'interval' if choice.samples == 1.0 else 'intervals'} "
            "of the record"
        )
    line += f".\nIt requires {response.iterations} equation solutions"
    if choice.solves_at_record is not None and choice.samples != 1.0:
        line += f"; the sampling interval requires {choice.solves_at_record}"
    return line + "."


def _collapsed(response: Response, collapse: Collapse) -> str:
    """Return a sentence on time, story and cause of the collapse.

    Parameters
    ----------
    response : Response
        Result of the run.
    collapse : Collapse
        Time, story and cause of the collapse.
    """
    end = "; analysis stopped: drift grew without bound" if collapse.ended else ""
    cause = (
        f"the drift ratio of story {collapse.story} exceeds "
        f"{100.0 * response.model.collapse_drift:g} % at"
    )
    if collapse.failed:
        cause = f"story {collapse.story} has no remaining resistance from"
    return f"Status {response.status}: {cause} {collapse.time:.6g} s{end}."
