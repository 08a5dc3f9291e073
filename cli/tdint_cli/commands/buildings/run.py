"""`tdint run`: the response of a building in time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint.errors import UsageError
from tdint_cli import options
from tdint_cli.options.building import BuildingRequest, check_motion, with_motion
from tdint_cli.options.values import Part
from tdint_cli.startup import load_numba
from tdint_cli.terminal.streams import emit, say, warn

if TYPE_CHECKING:
    from tdint.analysis.run.run import Case, FailedRun, Response
    from tdint.files import Writer
    from tdint.ground_motion.record import Input, Record

STORIES, HISTORY, PICTURE, SUMMARY = "stories.csv", "history.csv", "response.png", "summary.json"
"""The files of a run. The summary is written last: where it says `done`, all is there."""


@dataclass(frozen=True)
class Request(BuildingRequest):
    """The command line of `tdint run`."""

    method: str | None
    dt: float | None
    output: str | None
    history: bool
    plot: bool
    overwrite: bool
    allow_unstable: bool
    check: bool
    tolerance: float | None


@options.command("run")
@options.building.model
@options.record.record
@options.record.units
@options.record.component
@options.record.inventory
@options.record.scale
@options.record.processing
@options.analysis.method
@options.analysis.dt
@options.analysis.duration
@options.output.output("DIR", f"Write {STORIES} and {SUMMARY} into this folder; it is made if only itself is missing.")
@options.output.option(
    "--history", is_flag=True, help=f"Also write {HISTORY}: every floor and story and the energies at every step."
)
@options.output.option(
    "--plot", is_flag=True, help=f"Also write {PICTURE}: roof displacement, energies, drifts, one hysteresis."
)
@options.output.overwrite
@options.analysis.option(
    "--check",
    is_flag=True,
    help="Repeat the run with a half and a quarter of the step: columns <name>_error with the estimated errors.",
)
@options.analysis.option(
    "--tolerance",
    type=Part(),
    metavar="1%",
    help="Halve the step, up to eight times, until the estimated error of every peak drift is within this part of it; "
    "the columns of --check are there, too.",
)
@options.analysis.option("--allow-unstable", is_flag=True, help="Run a method beyond its largest stable step.")
def command(**given: Any) -> None:
    """Response of a building in time: the peaks of each story.

    MODEL.yaml is a model file, - is standard input. The table of stories goes to standard output as CSV, in SI units;
    with -o it is written to a folder, too. The options from --units to --resample belong to --record if that is given,
    and otherwise replace what the model says of its record; --method, --dt and --duration replace what it says of the
    analysis. --overwrite replaces all files of an earlier run: those the new one does not write are removed.
    """
    _run(Request(**given))


def _run(request: Request) -> None:
    began = time.perf_counter()
    load_numba()
    from tdint.analysis.run.run import FailedRun, model_record, prepare, run_case
    from tdint.model.config.read import load_model
    from tdint.output.summaries.summary import model_input
    from tdint.output.tables.tables import story_table

    _check(request)
    model = with_motion(load_model(request.model), request)
    record = model_record(model)
    inputs = [model_input(model), *(record.inputs if record else ())]
    case = prepare(model, record, method=request.method, allow_unstable=request.allow_unstable)
    try:
        response = run_case(
            case,
            dt=request.dt,
            duration=request.duration,
            history=request.history or request.plot,
            check=request.check,
            tolerance=request.tolerance,
        )
    except FailedRun as failure:
        _remark(record, failure.notes)
        if request.output:
            _write(request, _failed_files(request, failure, case, inputs, began))
        raise
    emit(story_table(response.stories, response.check.errors if response.check else None).csv())
    if request.output:
        _write(request, _files(request, response, case, inputs, began))
    say(_paragraph(response))
    _remark(record, response.notes)


def _remark(record: Record | None, notes: Sequence[str]) -> None:
    if record:
        for warning in record.warnings:
            warn(f"{record.source}: {warning}")
    for note in notes:
        say(f"note: {note}")


def _check(request: Request) -> None:
    """Refuse, before any work, what can be seen to fail."""
    from tdint.files import check_outputs

    for name, wanted in (("--history", request.history), ("--plot", request.plot)):
        if wanted and not request.output:
            raise UsageError(f"{name} writes a file: add -o DIR")
    check_motion(request)
    if request.output:
        folder = Path(request.output)
        names = (STORIES, HISTORY, PICTURE, SUMMARY)
        check_outputs([folder / name for name in names], overwrite=request.overwrite, new_folder=True)


def _files(request: Request, response: Response, case: Case, inputs: list[Input], began: float) -> dict[str, Writer]:
    """The files of a run and what writes them."""
    from tdint.analysis.spectra.first_mode import first_mode
    from tdint.output.summaries.run import run_summary
    from tdint.output.summaries.summary import json_bytes
    from tdint.output.tables.tables import story_table, write_history

    table = story_table(response.stories, response.check.errors if response.check else None).csv()
    wall_time = time.perf_counter() - began
    first = first_mode(case.building, case.record)
    summary = json_bytes(run_summary(response, inputs, wall_time, first=first, settings=_settings(request)))
    files: dict[str, Writer] = {STORIES: lambda stream: stream.write(table)}
    history = response.history
    if request.history and history is not None:
        files[HISTORY] = lambda stream: write_history(history, stream)
    if request.plot:
        from tdint.output.figures.run import run_picture

        files[PICTURE] = run_picture(response, Path(PICTURE).suffix)
    files[SUMMARY] = lambda stream: stream.write(summary)
    return files


def _failed_files(
    request: Request, failure: FailedRun, case: Case, inputs: list[Input], began: float
) -> dict[str, Writer]:
    from tdint.analysis.spectra.first_mode import first_mode
    from tdint.output.summaries.run import failure_summary
    from tdint.output.summaries.summary import json_bytes

    wall_time = time.perf_counter() - began
    first = first_mode(case.building, case.record)
    settings = _settings(request)
    content = failure_summary(failure, case.model, case.record, inputs, wall_time, first=first, settings=settings)
    summary = json_bytes(content)
    return {SUMMARY: lambda stream: stream.write(summary)}


def _settings(request: Request) -> dict[str, Any]:
    """What the command line asked of the analysis; None where it is the model's."""
    return {
        "method": request.method,
        "dt_s": request.dt,
        "duration_s": request.duration,
        "check": request.check,
        "tolerance": request.tolerance,
        "allow_unstable": request.allow_unstable,
    }


def _write(request: Request, files: dict[str, Writer]) -> None:
    """Write the files of this run; with --overwrite the folder keeps none of an earlier one."""
    from tdint.files import write_files

    assert request.output is not None
    folder = Path(request.output)
    others = [folder / name for name in (STORIES, HISTORY, PICTURE, SUMMARY) if name not in files]
    writers = {folder / name: writer for name, writer in files.items()}
    write_files(writers, overwrite=request.overwrite, new_folder=True, stale=others)


def _paragraph(response: Response) -> str:
    """The run in a few sentences."""
    from tdint.analysis.run.demands import demands

    stories = len(response.model.stories)
    record = response.record
    found = demands(response.stories)
    motion = "no ground motion"
    if record is not None:
        motion = f"{' '.join(filter(None, (record.source, record.component)))} (PGA {record.pga:.3g} m/s^2)"
    worst = f"drift {found.drift.value:.4g} m in story {found.drift.place}"
    if found.drift_ratio.place is not None:
        ratio = f"drift ratio {found.drift_ratio.value:.4g} in story {found.drift_ratio.place}"
        # Where a story has no height, its drift is not among the ratios.
        worst = ratio if all(story.height for story in response.model.stories) else f"{ratio}, {worst}"
    lines = [
        f"{response.model.name}: {stories} {'story' if stories == 1 else 'stories'}, {motion}.",
        f"{response.method}: {response.steps} {'step' if response.steps == 1 else 'steps'} of {response.dt:.6g} s, "
        f"{1e6 * response.march_time / response.steps:.3g} us per step, energy error {response.energy.error:.1e}.",
        f"Largest {worst}, roof displacement {found.roof_displacement.value:.4g} m, "
        f"base shear {found.base_shear.value:.4g} N.",
    ]
    if (check := response.check) and check.drift_error is not None:
        runs = " and ".join(f"{dt:.6g}" for dt in check.dts)
        if check.tolerance is not None:
            lines.append(f"Step chosen for peak drifts within {100.0 * check.tolerance:g} %: {response.dt:.6g} s.")
        lines.append(
            f"Largest estimated error of a peak drift: {100.0 * check.drift_error:.2g} % (story {check.drift_story}), "
            f"from runs with dt {runs} s."
        )
    if collapse := response.collapse:
        end = "; the run ends there, for the drift ran away" if collapse.ended else ""
        lines.append(
            f"Status {response.status}: the drift ratio of story {collapse.story} exceeds "
            f"{response.model.collapse_drift:g} at {collapse.time:.6g} s{end}."
        )
    return "\n".join(lines)
