"""`tdint run`: the response history of a building."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint import system
from tdint.errors import AnalysisError, UsageError
from tdint.files import is_there, write_files
from tdint.ground_motion.origin import matched_clause
from tdint.number_parsing import pluralize
from tdint.output import figures, tables
from tdint.units import OutputUnits
from tdint_cli import options
from tdint_cli.commands.run_request import (
    ALL_FILES,
    ATTACHMENTS,
    CONTACTS,
    ELEMENTS,
    LINKS,
    RESULTANTS,
    ROWS,
    STORIES,
    SUMMARY,
    Request,
)
from tdint_cli.demand_limits import check_limit_options, outcome_text
from tdint_cli.drawing import emit_table
from tdint_cli.handlers import call
from tdint_cli.options.analysis import changed, with_motion
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.terminal import complain, is_debug, is_quiet, note, note_of_runs, say, warn

if TYPE_CHECKING:
    from tdint.files import Content
    from tdint.ground_motion.record import Input, Record
    from tdint.model.definition import Model
    from tdint.output.tables.table import Table
    from tdint.output.verdicts import Verdict
    from tdint.response.runs.case import Case
    from tdint.response.runs.outcome import Collapse, FailedRun, Response, StepChoice, StoryPeaks

_FIGURE_STEPS = 20_000  # maximum number of time steps in a figure; more are not distinguishable
_MIN_PROBABILITY = 5e-4
"""Probability below which a damage state is omitted from the summary."""


@options.command
@options.analysis.model
@options.record.single_record_options
@options.spectra.floor_request
@options.of(Request)
def command(request: Request) -> None:
    """Compute the response history of a building and the peaks of each story.

    MODEL.yaml is a model file and RECORD a ground motion; one of them may be - (standard input).
    The table of stories is written to standard output as CSV, and with -o also to a directory. The
    options under Record apply to RECORD; without RECORD they replace the settings of the record in
    the model. --method, --dt and --duration replace the settings of the analysis in the model.
    --overwrite replaces all files of an earlier run; files that the new run does not write are
    removed.

    Forces on floors (wind, blast) are part of the model: `excitation: {forces: [{floor: 10, file:
    roof.csv, column: roof_kN}]}`. Only a load that is the same multiple p/m of the mass on every
    floor may be given as a RECORD of -p/m instead; the absolute accelerations are then wrong by
    p/m.

    With --sequence the records are successive events (main shock, aftershocks); the table lists the
    stories for each event and for the complete sequence.

    With several records, a directory of records, several scales (--scale 0.5,1,2) or --factors the
    table has a row per run instead; all horizontal components are used unless --component selects
    one. With -o the runs are a small campaign: runs.csv, profiles.csv (mean, fractiles and maximum
    over the ground motions for each story) and campaign.sqlite, which `tdint campaign status`,
    `export` and `merge` read. An interrupted call can be resumed with the same command line.
    """
    if request.record is not None and request.records:
        raise UsageError(
            f"--record {request.record} and {request.records[0]} cannot be used together; omit one "
            "of them"
        )
    records = (request.record,) if request.record is not None else request.records
    models = [file for file in records if file.lower().endswith((".yaml", ".yml"))]
    if models:
        raise UsageError(
            f"{models[0]} is a model, but `tdint run` accepts one model: to run several buildings "
            "under the same records, use a campaign with `buildings: {models: "
            f"[{', '.join([request.model, *models])}]}}` (tdint campaign FILE -o DIR)"
        )
    from tdint.files import is_set

    # A comma after a colon separates the parameters of a method. Any other comma separates methods.
    method = request.method
    if method and "," in method and ":" not in method:
        raise UsageError(
            f"--method {method}: `tdint run` accepts one method; use `tdint chart {request.model} "
            f"--method {method}` to compare methods, or call `tdint run` once for each method "
            "(with --history to compare histories)"
        )
    # In a sequence, each event has a separate factor; otherwise equal factors are the same run.
    events = records if request.sequence else ()
    scale = request.scale if events else tuple(dict.fromkeys(request.scale or ())) or None
    request = replace(request, record=records[0] if records else None, scale=scale, shocks=events)
    if request.check is False and request.tolerance is not None:
        raise UsageError(
            "--tolerance and --no-check cannot be used together, because --tolerance requires "
            "error estimates; omit one"
        )
    if request.sequence:
        refuse_idle("sequence")
        request.check_sequence()
        _run(request)
        return
    if request.factors is not None and request.scale:
        raise UsageError("--factors and --scale cannot be used together; omit one")
    is_set_of_runs = (
        request.factors is not None
        or len(records) > 1
        or len(request.scale or ()) > 1
        or (records and is_set(records[0]))
    )
    if is_set_of_runs and not _is_pair(request, records):
        refuse_idle("several")
        request.floor_request.check(request.output)
        call("several runs", request, records)
    else:
        refuse_idle("single")
        _run(request)


def _is_pair(request: Request, records: Sequence[str]) -> bool:
    """Return True if two records are the components of one ground motion, because the model has two
    directions."""
    if len(records) != 2 or request.factors is not None or len(request.scale or ()) > 1:
        return False
    # Options are tested before a missing model file is reported.
    if "-" in (request.model, *records) or not is_there(request.model):
        return False
    from tdint.model.config.model_file import load_model

    return load_model(request.model).across is not None


def _run(request: Request) -> None:
    """Run one analysis or one sequence, write its files and print its summary.

    After all files are written, FailedRun is raised if the time integration failed, and
    AnalysisError if a limit is exceeded with --require.
    """
    start_time = time.perf_counter()
    from tdint.response.arguments import number_of
    from tdint.response.runs.outcome import FailedRun
    from tdint.response.runs.run import prepare

    request.check_files()
    model = _model(request)
    request = replace(request, output_units=model.output_units)
    check_limit_options(request.limit, request.require, [model])
    if request.sequence and model.across:
        raise UsageError(
            f"--sequence requires one direction, but {request.model} has two; write a model file "
            "for each direction"
        )
    if model.rows and (request.picture_file or request.report):
        raise UsageError(
            "--plot and --report show stories, but this model has rows that are not floors: use "
            "--history, or `stories` with a `stiffness_matrix`"
        )
    request.floor_request.chosen_floors(model)
    if model.damage:
        from tdint.response.runs.damage import divisor_and_period

        # Invalid damage states are refused before the run.
        divisor_and_period(model.directions[0], model.damage.demand)
    events = _sequence_records(request, model)
    record = None if events else _record(request, model)
    records = events or ([record] if record else [])
    record_inputs = [source for read in records for source in read.inputs]
    case = prepare(
        model,
        events[0] if events else record,
        method=request.method,
        allow_unstable=request.allow_unstable,
    )
    # The number of time steps of a sequence, and of a run with --tolerance or --until-rest, is
    # known only after the run.
    is_adaptive = bool(events or request.tolerance or request.until_rest)
    if not is_adaptive:
        # An invalid time step or duration is reported before the warnings.
        case.steps(number_of(request.dt, "dt"), number_of(request.duration, "duration"))
    # Print these warnings before the integration: an incorrect unit can explain a failure, and a
    # smaller time step does not correct it. The records of a sequence are joined by the run, so
    # that their warnings follow after it.
    # The warnings of two directions follow after the run, with their directions.
    early_warnings = () if case.across else case.plausibility_warnings
    warn(*early_warnings, *_record_warnings(None if events else case.record))
    is_interpreted = _interpret_if_not_compiled(request, case)
    try:
        response = _respond(case, events, request, is_interpreted and not is_adaptive)
    except FailedRun as failure:
        from tdint.output.summary import model_input

        # A failed run has no results except the summary, which states the time of the failure.
        note_of_runs(*failure.notes)
        inputs = [model_input(model), *record_inputs]
        _write(request, {}, _failure_content(request, case, failure, inputs, start_time))
        raise
    verdicts = _verdicts(response, request.limit, request.units_shown)
    stories = tables.responses.response_table(response).in_units(request.units_shown)
    emit_table(stories)
    _write(request, *_files(request, response, stories, case, record_inputs, start_time))
    say(_paragraph(response, request.units_shown))
    say(*(verdict.text for verdict in verdicts))
    # A collapse affects the meaning of the peaks: report it also with --quiet, then with the name
    # of the model.
    if response.collapse:
        subject = f"{response.model.name}: " if is_quiet() else ""
        complain(subject + _collapse_sentence(response, response.collapse))
    warn(*(text for text in response.warnings if text not in early_warnings))
    warn(*_record_warnings(response.record if events else None))
    note_of_runs(*response.notes)
    unmet = [verdict.text for verdict in verdicts if not verdict.met]
    if request.require and unmet:
        subject = "the drift limit is exceeded: " if isinstance(request.limit, float) else ""
        raise AnalysisError(subject + " ".join(unmet))


def _model(request: Request) -> Model:
    """Read the model file, and replace its record and units by the values of the command line. With
    --sequence, the record of the model is unchanged."""
    from tdint.model.config.model_file import load_model

    model = changed(load_model(request.model), request.changes)
    if not request.sequence:
        model = with_motion(model, request)
    if (units := request.output_units) is None:
        return model
    return model.in_directions(output_units=units, page_units=units)


def _record(request: Request, model: Model) -> Record | None:
    """Return the ground motion of a single run: of the command line, or of the model."""
    from tdint.response.arguments import model_record, pair_of_files

    files = request.records or ((request.record,) if request.record else ())
    if model.across is None or not files:
        return model_record(model)
    factor = request.scale[0] if request.scale else 1.0
    return pair_of_files(model, files, request.choice).scaled(factor)


def _sequence_records(request: Request, model: Model) -> list[Record]:
    """Return the scaled ground motion of each event of --sequence; an empty list for a single run.

    --scale has a single factor for all events, or a factor for each event.
    """
    from tdint.response.arguments import model_record

    factors = request.scale or (1.0,)
    if len(factors) == 1:
        factors *= len(request.shocks)
    events = []
    for file, factor in zip(request.shocks, factors, strict=False):
        event = model_record(with_motion(model, replace(request, record=file, scale=(factor,))))
        assert event is not None
        events.append(event)
    return events


def _interpret_if_not_compiled(request: Request, case: Case) -> bool:
    """Select interpreted time loops for the start of the run if the compiled ones do not exist yet;
    return True if they are selected."""
    from tdint.response.runs.analysis_kernels import run_interpreted
    from tdint.response.runs.error_estimate import reference

    is_interpreted = False
    has_summary = bool(request.output or request.report)
    for part in case.directions:
        methods = [part.method]
        if request.check is not False:
            methods.append(reference(part).method)
        is_interpreted |= run_interpreted(
            part.prepared, methods, has_summary and case.record is not None
        )
    return is_interpreted


def _failure_content(
    request: Request, case: Case, failure: FailedRun, inputs: list[Input], start_time: float
) -> dict[str, Any]:
    """Return the content of the summary of a failed run. `start_time` is a value of
    `time.perf_counter`, s."""
    from tdint.output.run_summary import failure_summary
    from tdint.response.spectra.elastic import first_mode

    return failure_summary(
        failure,
        case.model,
        case.record,
        inputs,
        time.perf_counter() - start_time,
        first=first_mode(case.record, *(part.building for part in case.directions)),
        settings=request.settings,
    )


def _verdicts(response: Response, limit: float | str | None, units: OutputUnits) -> list[Verdict]:
    """Compare the demands of a run with the drift limit or performance level of the command line
    (`limit`), or with all limits of the model if it is `None`."""
    if limit is None and not response.model.limits:
        return []
    from tdint.output.spectrum_text import spectrum_text
    from tdint.output.verdicts import limit_verdicts

    origin = response.record.origin if response.record else None
    matched = matched_clause([origin], 1, spectrum_text)
    return limit_verdicts(
        response.limit_checks(limit),
        units,
        mean=False,
        lost="" if response.status == "done" else f", status {response.status}",
        addition=f" 1 ground motion, {matched}." if matched else "",
    )


def _respond(case: Case, events: list[Record], request: Request, is_interpreted: bool) -> Response:
    """Run the time integration under a single ground motion, or under a sequence if there are
    `events`. Interpreted time loops estimate the errors in a second process."""
    from tdint.response.runs.run import integrate_case, run_case
    from tdint.response.runs.settings import RunSettings, settings_from

    names = ("dt", "until_rest", "check", "tolerance")
    arguments: dict[str, Any] = {name: getattr(request, name) for name in names}
    history = bool(request.floor_request.floors or request.export_floors)
    if events:
        from tdint.response.runs.sequence import run_sequence

        return run_sequence(case, events, rest=request.rest, history=history, **arguments)
    # Forked processes have the interpreted time loops.
    if is_interpreted and request.check is None and system.START_OF_PROCESSES == "fork":
        from tdint_cli.processes import worker

        settings = settings_from(request, RunSettings, check=True)
        with worker() as begin:
            return integrate_case(
                case, settings, history=history, tolerance=request.tolerance, begin=begin
            )
    return run_case(case, duration=request.duration, history=history, **arguments)


def _record_warnings(record: Record | None) -> list[str]:
    """Return the warnings of a record with its file; empty without a record."""
    return [f"{record.source}: {text}" for text in record.warnings] if record else []


def _files(
    request: Request,
    response: Response,
    stories: Table,
    case: Case,
    record_inputs: list[Input],
    start_time: float,
) -> tuple[dict[Path, Content], dict[str, Any]]:
    """Return the files of a run except the summary, and the content of the summary; the content is
    empty if neither -o nor --report is given.

    `start_time` is a value of `time.perf_counter`, s.
    """
    units = request.units_shown
    files: dict[Path, Content] = {}
    if request.output:
        folder = Path(request.output)
        files[folder / (ROWS if response.model.rows else STORIES)] = stories.csv()
        if response.directions:
            resultants = tables.directions.resultant_table(response)
            files[folder / RESULTANTS] = resultants.in_units(units).csv()
        parts = dict(zip(("x-", "y-"), response.directions, strict=False)) or {"": response}
        for prefix, part in parts.items():
            floor_files, notes = request.floor_request.files(
                part,
                folder,
                units,
                plot=request.plot is not None,
                export=request.export_floors,
            )
            files |= {
                path.with_name(f"{prefix}{path.name}"): content
                for path, content in floor_files.items()
            }
            note(*notes)
            part_tables = {
                ELEMENTS: tables.elements.element_table(part),
                **dict(zip((ATTACHMENTS, LINKS), tables.devices.device_tables(part), strict=True)),
                CONTACTS: tables.devices.contact_table(part),
            }
            for name, table in part_tables.items():
                if table:
                    files[folder / f"{prefix}{name}"] = table.in_units(units).csv()
    if (file := request.history_file) and response.history_chunks:
        # The columns of estimated errors increase the size of the file by half, so that they are
        # written only with --check.
        chunks = (
            chunk if request.check else replace(chunk, error=None)
            for chunk in response.history_chunks(request.history_every)
        )
        files[file] = lambda stream: tables.histories.write_history(chunks, stream, units)
    elif file and response.directions:
        x, y = (
            replace(part, error=part.error if request.check else None).every(request.history_every)
            for part in (run.history for run in response.directions if run.history)
        )
        files[file] = lambda stream: tables.histories.write_history([x], stream, units, [y])
    if picture := request.picture_file:
        files[picture] = figures.style.picture(
            picture.suffix,
            lambda: (
                figures.runs.plan_picture(response, units)
                if response.directions
                else figures.runs.run_picture(_with_history(response), units)
            ),
        )
    if not (request.output or request.report):
        return files, {}
    # These imports are a fifth of the code of a run, and are not needed without a summary.
    from tdint.output.run_summary import run_summary
    from tdint.output.summary import model_input
    from tdint.response.spectra.elastic import first_mode

    wall_time = time.perf_counter() - start_time
    first = first_mode(response.record, *(part.building for part in case.directions))
    content = run_summary(
        response,
        [model_input(case.model), *record_inputs],
        wall_time,
        first=first,
        settings=request.settings,
        limits=response.limit_checks(request.limit),
    )
    if request.report:
        files[Path(request.report)] = _report_page(request, response, content["inputs"])
    return files, content


def _report_page(
    request: Request, response: Response, inputs: Sequence[Mapping[str, str]]
) -> bytes:
    """Return the HTML report of a run. `inputs` are names and SHA-256 of the files of the model and
    of the ground motions."""
    from tdint.output.page import PageText, page_units
    from tdint.output.report import run_page
    from tdint.output.summary import files_read, merged_inputs
    from tdint.output.verdicts import (
        governing_story,
        has_isolator_limit,
        isolator_sentence,
        limit_table,
    )

    model = response.model
    units = page_units(model.page_units)
    checks = response.limit_checks(request.limit)
    # The text of a single drift limit without a performance level starts with the drift, so the
    # outcome ("Limit met." or "Limit EXCEEDED.") is added in front. All other texts already state
    # it.
    verdict: list[tuple[bool | None, str]] = [
        (met, outcome_text(bool(met)) + text if single_limit else text)
        for met, text, single_limit in _verdicts(response, request.limit, units)
    ]
    if not verdict:
        demands = _maximum_demands(model, response.stories, units, page=True)
        verdict = [(None, f"Maximum {demands}.")]
    # A drift limit does not cover the displacement of isolators.
    elif not has_isolator_limit(checks):
        isolators = isolator_sentence(response.isolator_check, units, mean=False)
        verdict += [(None, isolators)] if isolators else []
    # The sentences below the verdict must not repeat it.
    verdict_texts = [text for _, text in verdict]
    lines = _paragraph(response, units, page=True).splitlines()
    # A collapse is the headline of the report, before the limit and the maximum demands.
    if response.collapse:
        verdict.insert(0, (False, _collapse_sentence(response, response.collapse)))
    # A building that collapses meets no limit, regardless of its demand.
    reasons = {} if response.status == "done" else {"": f"status {response.status}"}
    page_text = PageText(
        sentences=[line for line in lines if line not in verdict_texts],
        verdict=verdict,
        warnings=[*_record_warnings(response.record), *response.warnings],
        head=model.page_head,
        inputs=merged_inputs(inputs, files_read()),
        limits=limit_table({"": checks}, units, mean=False, reasons=reasons) if checks else None,
        governing_story=governing_story(checks),
    )
    floors = [
        request.floor_request.run_spectra(part) for part in response.directions or (response,)
    ]
    shown = response if response.directions else _with_history(response)
    return run_page(shown, page_text, floors=floors, units=units)


def _with_history(response: Response) -> Response:
    """Return the response with a response history for figures, of at most about `_FIGURE_STEPS`
    time steps."""
    from tdint.response.runs.history import History

    assert response.history_chunks is not None
    if response.history is not None:
        return response
    # Integer division with two changes of sign rounds up, so that `every` is at least 1.
    every = -(-response.steps // _FIGURE_STEPS)
    return replace(response, history=History.joined(response.history_chunks(every)))


def _write(request: Request, files: dict[Path, Content], content: dict[str, Any]) -> None:
    """Write the files of the run, and the summary last, because it contains the SHA-256 of the
    files in its directory.

    With --overwrite, files that the summary of an earlier run lists are removed.
    """
    # Without a directory there is no summary that lists the files of an earlier run.
    if request.output is None:
        write_files(files, overwrite=request.overwrite)
        return
    from tdint.output.run_summary import UNITS
    from tdint.output.summary import listed_files

    folder = Path(request.output)

    # Files that this command can write to its directory
    possible_files = request.in_folder(ALL_FILES)

    def summary_bytes(digests: Mapping[Path, str]) -> bytes:
        """Return the summary with the SHA-256 of the written files."""
        written_files = [
            {"file": file.name, "sha256": sha}
            for file, sha in digests.items()
            if file in possible_files
        ]
        return options.output.summary_bytes(
            content | {"files": written_files}, request.units_shown, UNITS
        )

    earlier_files = {
        folder / name: sha
        for name, sha in listed_files(folder / SUMMARY).items()
        if folder / name in possible_files
    }
    write_files(
        files,
        overwrite=request.overwrite,
        stale=earlier_files,
        last=(folder / SUMMARY, summary_bytes),
    )
    # `write_files` removes a file of an earlier run (`stale`) only if its content is unchanged.
    remaining = [
        file
        for file in possible_files
        if file not in files and file.name != SUMMARY and is_there(file)
    ]
    changed = [file.name for file in remaining if file in earlier_files]
    foreign = [file.name for file in remaining if file not in earlier_files]
    if changed:
        note(
            f"{folder}: {', '.join(changed)} is not removed, because it was changed after an "
            "earlier run wrote it"
        )
    if foreign:
        note(
            f"{folder}: {', '.join(foreign)} is not part of the results, and is not removed, "
            "because the summary of the earlier run does not list it"
        )


def _paragraph(response: Response, units: OutputUnits, *, page: bool = False) -> str:
    """Return the summary of a run as text with a sentence per line.

    In a report (`page`), drift ratios are in percent. The computing time requires --debug.
    """
    from tdint.response.runs.demands import demands

    record = response.record
    motion = "no ground motion"
    if record is not None:
        from tdint.ground_motion.axes import pga_of  # numpy: not for help texts

        # With three significant digits, numbers from 1000 would be written with an exponent.
        pga = units.of(pga_of(record), "m/s^2")
        pga_text = f"{pga:.3g}" if pga < 1000.0 else f"{pga:.0f}"
        measure = "geometric-mean PGA" if response.directions else "PGA"
        motion = f"{record.name} ({measure} {pga_text} {units.unit('m/s^2')[0]})"
    cost = ""
    if is_debug() and not page:
        microseconds = 1e6 * response.solver_time / response.steps
        cost = f"{microseconds:.3g} us per step ({system.CLOCKS[system.clock()]}), "
    resultants, results = response.resultants, response.directions
    directions = ", two directions" if results else ""
    lines = [
        f"{response.model.name}: {pluralize(len(response.model.stories), 'story')}{directions}, "
        f"{motion}.",
        f"{response.method}: {pluralize(response.steps, 'step')} of {response.dt:.6g} s, "
        f"{cost}energy error {response.energy.error:.1e}.",
        f"Maximum {_maximum_demands(response.model, response.stories, units, page)}.",
    ]
    if resultants is not None:
        peak, largest = resultants.drift, int(resultants.drift.value.argmax())
        lines[-1] = f"{lines[-1].replace('Maximum', 'Maximum resultants:', 1)}"
        lines.append(
            f"Largest resultant drift {units.text(float(peak.value[largest]), 'm')} at "
            f"{peak.time[largest]:.4g} s, {peak.direction[largest]:.3g} degrees from x."
        )
        lines += [
            f"{name}: maximum {_maximum_demands(part.model, part.stories, units, page)}."
            for name, part in zip("xy", results, strict=True)
        ]
    sentences = tables.devices.device_sentences(response, units) if response.devices else []
    if response.flexure is not None:
        sentences = tables.matrices.linear_sentences(response, units)
    lines += [f"{text[0].upper()}{text[1:]}." for text in sentences]
    for number, event in enumerate(response.events, start=1):
        drifts = _maximum_drifts(event.stories, units, page)
        residual = demands(event.stories).residual_drift_ratio
        if residual.location is not None:
            drifts += f", residual {residual.value:.3g}"
        lines.append(f"Event {number}, from {event.start:.6g} s: maximum {drifts}.")
    if response.model.damage:
        lines.append(_damage(response, units))
    if response.time_at_rest is not None:
        lines.append(f"Free vibration has decayed at {response.time_at_rest:.6g} s.")
    lines += _error_sentences(response, units, page)
    return "\n".join(lines)


def _error_sentences(response: Response, units: OutputUnits, page: bool) -> list[str]:
    """Return sentences on the estimated errors of the peaks; empty without error estimates."""
    check = response.check
    if not check or check.drift_error is None:
        return []
    lines = []
    if check.step_choice is not None:
        lines.append(_step_choice_text(response, check.step_choice))
    method = check.method.partition(":")[0]
    runs = "runs" if len(check.time_steps) > 1 else "a run"
    dts = " and ".join(f"{dt:.6g}" for dt in check.time_steps)
    # If a story moves in the additional run only, the relative error is infinite.
    error = (
        f"{100.0 * check.drift_error:.2g} % (story {check.drift_story})"
        if math.isfinite(check.drift_error)
        else f"not known, because story {check.drift_story} has no drift in this run"
    )
    lines.append(
        f"Maximum estimated error of a peak drift: {error}, from {runs} of {method} with dt "
        f"{dts} s."
    )
    # The run for the error estimate has a smaller time step, so that its peaks are more accurate.
    # They are reported if they differ in the printed digits.
    if check.corrected:
        corrected = _maximum_demands(response.model, check.corrected, units, page)
        if corrected != _maximum_demands(response.model, response.stories, units, page):
            lines.append(f"In that run: maximum {corrected}.")
    return lines


def _maximum_demands(
    model: Model, stories: StoryPeaks, units: OutputUnits, page: bool = False
) -> str:
    """Return a text with the maximum drift, roof displacement and base shear of a run.

    The base shear is the restoring force of the first story, which its columns and walls resist.
    The total shear with P-delta, viscous forces and links to the ground follows in parentheses: in
    a report always, on the terminal (`page` False) only if the building has P-delta, dashpots or
    such links.

    For example "drift ratio 0.012 in story 1, roof displacement 0.08 m, base shear 9e+05 N". Drift
    ratios in a report are in percent.
    """
    from tdint.response.runs.demands import demands

    maximum = demands(stories)
    if model.rows:
        largest = int(stories.peak_displacement.argmax())
        displacement = units.text(float(stories.peak_displacement[largest]), "m")
        force, total = (
            units.text(value, "N")
            for value in (maximum.base_shear.value, maximum.total_base_shear.value)
        )
        return (
            f"displacement {displacement} in row {model.rows[largest]}, force along the ground "
            f"motion {force} ({total} with viscous forces)"
        )
    drift_text = _maximum_drifts(stories, units, page)
    roof = units.text(maximum.roof_displacement.value, "m")
    base_shear = units.text(maximum.base_shear.value, "N")
    forces = model.forces_of_total_base_shear
    if forces and (page or model.has_p_delta or model.has_dashpots or "links" in forces):
        total = units.text(maximum.total_base_shear.value, "N")
        restoring = "restoring force; " if page else ""
        base_shear += f" ({restoring}{total} with {forces})"
    return f"{drift_text}, roof displacement {roof}, base shear {base_shear}"


def _maximum_drifts(stories: StoryPeaks, units: OutputUnits, page: bool) -> str:
    """Return a text with the maximum drift ratio, the maximum drift if a story has no height, and
    the maximum displacement of isolators."""
    from tdint.response.runs.demands import demands

    maximum, texts = demands(stories), []
    if (ratio := maximum.drift_ratio).location is not None:
        value = f"{100.0 * ratio.value:.4g} %" if page else f"{ratio.value:.4g}"
        texts.append(f"drift ratio {value} in story {ratio.location}")
    has_no_ratio = stories.height != stories.height  # nan: a story without height, or an isolator
    if (has_no_ratio & (stories.isolator == 0.0)).any():
        drift = units.text(maximum.drift.value, "m")
        texts.append(f"drift {drift} in story {maximum.drift.location}")
    if (isolator := maximum.isolator_displacement).location is not None:
        displacement = units.text(isolator.value, "m")
        texts.append(f"isolator displacement {displacement} in story {isolator.location}")
    return ", ".join(texts)


def _damage(response: Response, units: OutputUnits) -> str:
    """Return a sentence on the damage according to the damage states of the model."""
    from tdint.model.damage_states import DEMANDS
    from tdint.response.runs.damage import damage_of_run

    damage = damage_of_run(response.model, response.stories, response.status)
    assert damage is not None
    states, demand = damage.states, DEMANDS[damage.states.demand]
    value = (
        "unknown"  # the residual drift after a collapse
        if math.isnan(damage.demand[0])
        else f"{damage.demand[0]:.4g}"
        if demand.unit == "1"
        else units.text(float(damage.demand[0]), demand.unit)
    )
    # Row 0 is the only run.
    probabilities = (
        f"{outcome} {100.0 * probability:.3g} %"
        for outcome, probability in zip(
            states.outcomes, damage.probability[0].tolist(), strict=True
        )
        if probability >= _MIN_PROBABILITY
    )
    loss = f"; mean loss ratio {damage.loss[0]:.3g}" if states.losses else ""
    return (
        f"Damage by {states.demand.replace('_', ' ')} {value}: {damage.state[0]} "
        f"({', '.join(probabilities)}){loss}."
    )


def _step_choice_text(response: Response, choice: StepChoice) -> str:
    """Return sentences on the selected time step and its number of solutions."""
    text = (
        f"Time step selected for peak drift errors below {100.0 * choice.tolerance:g} %, from "
        f"{pluralize(choice.runs, 'run')}: {response.dt:.6g} s"
    )
    if choice.samples is not None:
        noun = "interval" if choice.samples == 1.0 else "intervals"
        text += f", {choice.samples:g} sampling {noun} of the record"
    text += f".\nIt requires {response.iterations} equation solutions"
    if choice.solves_at_record is not None and choice.samples != 1.0:
        text += f"; the sampling interval requires {choice.solves_at_record}"
    return f"{text}."


def _collapse_sentence(response: Response, collapse: Collapse) -> str:
    """Return a sentence on time, story and cause of the collapse."""
    time = f"{collapse.time:.6g} s"
    if collapse.failed:
        cause = f"story {collapse.story} has no remaining resistance from {time}"
    else:
        limit = f"{100.0 * response.model.collapse_drift:g} %"
        cause = f"the drift ratio of story {collapse.story} exceeds {limit} at {time}"
    end = ""
    if collapse.ended:
        grew = collapse.is_unbounded and not collapse.failed
        end = "; analysis stopped" + (": drift grew without bound" if grew else "")
    return f"Status {response.status}: {cause}{end}."
