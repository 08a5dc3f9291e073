"""Execution of campaigns by commands: output directory, progress, written files and messages."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tdint import studies
from tdint.errors import AnalysisError, ModelError, RecordError, TdintError, UsageError
from tdint.files import (
    Content,
    Writer,
    check_outputs,
    is_there,
    refuse_protected,
    settle,
    write_files,
)
from tdint.fractiles import small_sample_warning
from tdint.model.status import FALLEN
from tdint.number_parsing import pluralize
from tdint.output import figures
from tdint.output.printed import PRINTED, parse_style
from tdint.output.run_summary import LIMIT_MEANINGS
from tdint.output.summary import files_read, in_units, json_bytes, merged_inputs, stored_summary
from tdint.output.tables.table import Table
from tdint.response.pairs import PairRule, check_pairs
from tdint.response.runs.outcome import FAILED
from tdint.studies.campaign.campaign_summary import campaign_summary, without_error
from tdint.studies.campaign.execute import Advance, Engine, Shard, execute_plan, reuse_results
from tdint.studies.campaign.plan import Plan
from tdint.studies.campaign.story_profiles import (
    FloorSuite,
    check_baseline,
    floor_suites,
    run_floors,
)
from tdint.studies.fragility.building_damage import has_losses
from tdint.studies.fragility.measures import measured, run_measure
from tdint.studies.regions import maps as map_tables
from tdint.studies.store import schema
from tdint.studies.store.opening import open_replacement, open_store, write_from_store
from tdint.studies.store.result_store import FILE, Identity, Store, foreign_file_error
from tdint.studies.store.schema import AnotherStudyError, UntrustedStoreError
from tdint.system import processors
from tdint_cli import options, terminal
from tdint_cli.demand_limits import check_limit_options
from tdint_cli.drawing import emit_table
from tdint_cli.options.spectra import SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE
from tdint_cli.options.suite import PICTURE, PROFILES, RATIOS, SuiteRequest
from tdint_cli.studies.suite_results import NOT_STORED, SuiteResults, unfinished


def apply_style(style: str, source: str) -> None:
    """Apply the figure style of a campaign; settings of the command line have priority.

    `style` is the text of the key `style` of the campaign, empty without a style. ModelError is
    raised if it is invalid.
    """
    if style:
        try:
            PRINTED.set(PRINTED.get().over(parse_style(style, "style:")))
        except UsageError as error:
            raise ModelError(f"{source}: {error}") from None


RUNS, STORIES = "runs.csv", "stories.csv"
SUMMARY = "summary.json"
DAMAGE, TYPES, LOSSES, EXCEEDANCE = "damage.csv", "damage-types.csv", "losses.csv", "exceedance.csv"
PARQUET = ("runs.parquet", "stories.parquet", "damage.parquet", "losses.parquet")
SIMCENTER, GEOJSON, DISTRICTS = "simcenter.csv", "buildings.geojson", "districts.geojson"
"""Names of the files that are written from a store; each file is written completely."""

MEASURES = "measures.csv"
"""Name of the table of the intensity measures of the runs, for `tdint fragility`."""

_WRITTEN_FILES = (
    *(RUNS, *schema.PART_TABLES, PROFILES, RATIOS, DAMAGE, TYPES, LOSSES, EXCEEDANCE, PICTURE),
    *(MEASURES, SPECTRA, SPECTRA_MEAN, SPECTRA_PICTURE, *PARQUET, SIMCENTER, GEOJSON, DISTRICTS),
    SUMMARY,
)
"""Names of all files that a campaign can write; a campaign that replaces another one removes
them."""


def execute_campaign(
    plan: Plan,
    engine: Engine,
    request: SuiteRequest,
    *,
    shard: Shard | None = None,
    max_runs: int | None = None,
    show: bool = False,
) -> None:
    """Execute the remaining runs of a campaign, or of a shard, and write all requested files.

    The output directory is the directory of -o. With --overwrite, another campaign in this
    directory and tables of other commands are replaced. Without -o, only the figure and the report
    are written. `max_runs` limits the runs of the call. With `show`, the table of the runs is also
    printed to standard output.

    Raises
    ------
    OutputError
        The directory contains another campaign or tables of another command, cannot be written,
        or is in use by another process.
    Failures
        Some records could not be read, a building is too far from any site, or the drift limit is
        not met. Raised after all other work is completed.
    """
    report_pairs(plan, request)
    _check_result_options(plan, request)
    folder = Path(request.output) if request.output else None
    extra_files: list[Path] = []
    with ExitStack() as stack:
        if folder is None:
            store, notes = open_store(None, plan)
        else:
            schema.refuse_network(folder)
            shard_buildings = None if shard is None else plan.buildings_of(shard.chunks(plan))
            stack.enter_context(schema.locked(folder))
            extra_files = check_names(folder, request)
            # Refuse tables of other commands in a directory that contains no campaign.
            settings = plan.settings
            refuse_foreign(folder, settings.stories, settings.profiles, overwrite=request.overwrite)
            reuse_note = reuse_results(folder, plan) if request.changed else ""
            replaces = request.overwrite or request.changed
            store, notes = _open_store(folder, plan, shard_buildings, replaces=replaces)
            notes += filter(None, [reuse_note])
        warn_of_plan(plan)
        terminal.note_of_runs(*plan.notes, *notes)
        stack.enter_context(store)
        # Refuse files with the names of results that were not written from this store.
        if not request.overwrite:
            store.refuse_foreign(extra_files)
        advance = advance_with_bar(plan, store, engine, shard=shard, max_runs=max_runs)
        results = SuiteResults(store, request)
        if folder is None:
            # The reader of a pipe does not wait for the figure and the report.
            results.emit_runs()
            contents = _suite_contents(results, None, plan)
            write_files(
                {Path(file): content for file, content in contents.items()},
                overwrite=request.overwrite,
            )
        else:
            part = range(plan.chunks) if shard is None else shard.chunks(plan)
            if Path(store.name) == folder / FILE or store.completed_chunks().issuperset(part):
                finish(results, folder, plan)  # write all tables, figures and the summary
            else:
                terminal.note(
                    f"{folder}: the earlier campaign remains until all runs of the new one are "
                    "done; continue with --overwrite"
                )
            if show:
                results.emit_runs()
        unmet_limits = _report(results, advance)
    _raise_failures(plan, unmet_limits)


def _report(results: SuiteResults, advance: Advance) -> list[TdintError]:
    """Print the results of a call, and return the errors of `SuiteResults.report_results`.

    The first line is the number of runs that the call has completed, with --debug their duration
    and rate, and the number of runs of earlier calls.
    """
    store = results.store
    if results.request.baseline is not None and is_complete(store):
        emit_table(results.ratios(stories=False))
    new_runs = advance.done - advance.before
    if new_runs:
        before = f", {advance.before} before" if advance.before else ""
        duration = f" in {advance.seconds:.3g} s ({_rate(advance)})" if terminal.is_debug() else ""
        terminal.say(f"{pluralize(new_runs, 'run')}{duration}{before}.")
    else:
        terminal.say(f"All runs ({advance.done}) were completed by an earlier call; nothing to do.")
    report_outcomes(store)
    return results.report_results()


def _raise_failures(plan: Plan, unmet_limits: Sequence[TdintError]) -> None:
    """Raise Failures if inputs of a campaign could not be used, or limits are not met."""
    # A building without a motion is omitted and reported in the same way as an unreadable record.
    without_motion: list[TdintError] = []
    if too_far := plan.too_far_from_sites:
        text = (
            f"{pluralize(len(too_far), 'building')} skipped: farther from every site than "
            f"max_distance of the records, such as {too_far[0]}"
        )
        without_motion = [RecordError(text)]
    if plan.failures or unmet_limits or without_motion:
        raise terminal.Failures([*plan.failures, *without_motion, *unmet_limits])


def _check_result_options(plan: Plan, request: SuiteRequest) -> None:
    """Check the options for limits, figures and ratios before any run.

    UsageError is raised if --limit or --require cannot be applied, or the baseline is not a
    building of the campaign; AnalysisError, if an option requires the peaks of all stories, which
    the campaign does not store.
    """
    check_limit_options(request.limit, request.require, plan.models)
    needs_stories = {
        "--plot": request.plot is not None,
        "--baseline": request.baseline is not None,
        "--limit": request.limit is not None,
        "--require": request.require,
    }
    for option, is_requested in needs_stories.items():
        if is_requested and not plan.settings.keeps_stories:
            raise AnalysisError(f"{option}: {NOT_STORED}")
    if request.floor_request.floors and any(model.across for model in plan.models):
        raise UsageError(
            "--floor-spectra of a campaign requires one direction; use `tdint run` for each ground "
            "motion"
        )
    if request.baseline is not None:
        names = (building.name for building in plan.buildings)
        check_baseline(request.baseline, names, plan.own_periods)


def _open_store(
    folder: Path, plan: Plan, buildings: Sequence[int] | None, *, replaces: bool
) -> tuple[Store, list[str]]:
    """Open the store of a campaign (for a shard, of some buildings), or create it, and return it
    with notes for the user.

    With `replaces`, the store of another campaign, or a store that cannot be used, remains with
    its tables until the new campaign is complete. Otherwise another campaign is an
    AnotherStudyError.
    """
    try:
        return open_store(folder, plan, buildings)
    except (UntrustedStoreError, AnotherStudyError):
        if not replaces:
            raise
        refuse_protected(folder / name for name in (*_WRITTEN_FILES, FILE))
        return open_replacement(folder / FILE, Identity.of(plan, buildings))


def report_pairs(plan: Plan, request: SuiteRequest) -> None:
    """Report the pairs of components and their treatment.

    Raises
    ------
    UsageError
        --pair-demand is specified, but the records contain no pairs.
    RecordError
        Two records are a pair by their names, but differ in sampling interval, length or event.
    """
    rule = PairRule.from_motions(plan.motions, plan.pair_demand)
    check_pairs(plan.motions, rule)
    if request.pair_demand is not None and not rule.pairs:
        raise UsageError(
            f"--pair-demand {request.pair_demand}: the records contain no pairs of horizontal "
            "components; omit --pair-demand"
        )
    if rule.pairs:
        files = [motion.name for motion in plan.motions]
        terminal.note(rule.note(files, is_default=plan.pair_demand is None))


def warn_of_plan(plan: Plan) -> None:
    """Warn of unusual values of the buildings first, then of assumptions on the motions."""
    terminal.warn(*plan.warnings)
    terminal.warn(*options.record.warnings_of_suite([motion.record for motion in plan.motions]))


def check_names(folder: Path | None, request: SuiteRequest) -> list[Path]:
    """Check that the additional output files of a call can be written, and return their paths.

    These are files such as the figure and the report. The check is made before the runs. If the
    directory contains a campaign, existing files are accepted here, because the store will check
    later whether an earlier call has written them.

    Parameters
    ----------
    folder : Path | None
        Output directory; None without -o.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    if folder is not None:
        settle(folder)
    may_replace = request.overwrite or (folder is not None and is_there(folder / FILE))
    report = Path(request.report) if request.report else None
    files = [file for file in (request.picture(folder), report) if file]
    if folder is not None:
        options_of_files = {
            RATIOS: request.baseline,
            MEASURES: request.im,
            SPECTRA: request.floor_request.floors,
        }
        files += [folder / name for name, option in options_of_files.items() if option]
    check_outputs(files, overwrite=may_replace)
    return files


def warn_unfinished(store: Store) -> None:
    """Warn that the following results use only the finished runs, unless all runs are done."""
    if progress := unfinished(store):
        terminal.warn(f"{store.name}: {progress}; the following results use only these runs")


def is_complete(store: Store) -> bool:
    """Return True if all runs of a campaign are done.

    A mean over some of the motions could be mistaken for the mean over all motions.
    """
    return not unfinished(store)


def refuse_foreign(folder: Path, stories: bool, profiles: bool, *, overwrite: bool) -> None:
    """Refuse existing tables in a directory without a campaign, because another command wrote them,
    and tables that cannot be written.

    Parameters
    ----------
    stories, profiles : bool
        True if the campaign writes stories.csv and profiles.csv, respectively.

    Raises
    ------
    OutputError
        A table exists and must not be replaced, or cannot be written.
    """
    # A tuple multiplied by False is empty.
    names = (RUNS, *(STORIES,) * stories, *(PROFILES,) * profiles, SUMMARY)
    check_outputs([folder / name for name in names], overwrite=True)
    if not is_there(folder / FILE) and not overwrite:
        for name in names:
            if is_there(folder / name):
                raise foreign_file_error(folder / name)


def advance_with_bar(
    plan: Plan,
    store: Store,
    engine: Engine,
    *,
    shard: Shard | None = None,
    max_runs: int | None = None,
) -> Advance:
    """Execute the remaining runs with a progress bar that shows the rate.

    Parameters
    ----------
    shard : Shard, optional
        Part of the campaign to execute. By default, the complete campaign.
    max_runs : int, optional
        Maximum number of runs. By default, all remaining runs.
    """
    with terminal.progress_bar(to_terminal=False) as progress:

        def show_progress(advance: Advance) -> None:
            """Show the numbers of completed and of all runs, and the rate."""
            progress(
                f"{advance.done}/{advance.runs} runs, {_rate(advance)}", advance.done / advance.runs
            )

        return execute_plan(
            plan, store, engine, shard=shard, max_runs=max_runs, on_chunk=show_progress
        )


def _rate(advance: Advance) -> str:
    """Return the number of runs per hour as text."""
    return f"{3600.0 * advance.rate:.3g} per hour"


def finish(results: SuiteResults, folder: Path, plan: Plan | None = None) -> None:
    """Write the files of a campaign from its store, and update earlier exports.

    The files are the tables that the campaign selects, the requested results over all motions, and
    summary.json. Files that `tdint campaign export` wrote from an earlier state of the store are
    written again, or removed if this is not possible.

    Parameters
    ----------
    plan : Plan, optional
        Buildings, motions and settings of the campaign. Floor spectra, the report and intensity
        measures are written only with a plan.
    """
    # Update only exports that an earlier call has written to this directory.
    optional = (*PARQUET, SIMCENTER, GEOJSON, DISTRICTS)
    existing_exports = [name for name in optional if results.store.is_ours(folder / name)]
    export_writers = _exports(results, existing_exports)
    provenance = {**options.output.command_line(), "time_loops": results.store.time_loops()}
    inputs = files_read()
    _write(results, folder, plan, export_writers, inputs=inputs, provenance=provenance)
    for name, writer in export_writers.items():
        if writer:
            terminal.note(f"{folder / name}: updated to the current state of the campaign")
        else:
            (folder / name).unlink(missing_ok=True)
            terminal.note(
                f"{folder / name}: removed, because it was outdated and this call cannot update "
                "it; run `tdint campaign export` to write it again"
            )


def _suite_contents(
    results: SuiteResults, folder: Path | None, plan: Plan | None = None
) -> dict[str, Content]:
    """Return the name and the content of each requested file with results over all motions: the
    figure of the profiles and the ratios to the baseline; with a plan, the floor spectra, the
    report and the intensity measures of the runs. The dictionary is empty until all runs are
    completed.
    """
    request, store = results.request, results.store
    picture = request.picture(folder)
    # These files are written only after all runs are completed, because results over some of the
    # motions could be mistaken for results over all motions.
    if not is_complete(store):
        return {}
    contents: dict[str, Content] = (
        {str(picture.absolute()): results.draw(picture)} if picture else {}
    )
    if request.baseline is not None:
        contents[RATIOS] = results.ratios(stories=True).csv()
    if plan is None:
        return contents
    tables, wanted, suites = studies.campaign_tables, request.floor_request, list[FloorSuite]()
    if wanted.floors:
        # A store contains no response histories, so the runs are repeated for the floor motions.
        oscillators = wanted.chosen_periods(), wanted.floor_damping
        floors = run_floors(plan, store, wanted.floors, *oscillators, request.jobs or processors())
        suites = list(floor_suites(store, floors))
        contents[SPECTRA] = tables.run_floor_table(store, floors).in_units(results.units).csv()
        contents[SPECTRA_MEAN] = (
            tables.floor_suite_table(store, suites).in_units(results.units).csv()
        )
    if request.plot is not None and suites:
        periods = store.first_periods()  # marked by the figure
        draw = partial(studies.suite_figures.floor_suite_picture, suites, results.units, periods)
        contents[SPECTRA_PICTURE] = figures.style.picture(".png", draw)
    if request.report is not None:
        contents[str(Path(request.report).absolute())] = results.report(plan, suites)
    if request.im:
        measures = [run_measure(name) for name in request.im]
        table = Table.of(tables.measure_columns(measures), measured(plan, store, measures))
        contents[MEASURES] = table.in_units(results.units).csv()
    return contents


def write_exports(results: SuiteResults, folder: Path, *, simcenter: bool) -> None:
    """Write all tables of a campaign again from its store (`tdint campaign export`).

    Parquet files are written also if pyarrow is installed. They and the SimCenter file use SI
    units.

    Raises
    ------
    UsageError
        A map is requested, but the buildings have no coordinates, not all runs are completed, an
        event or a column is unknown, or there are no losses for a map of districts.
    """
    store, by, has_map = results.store, results.by, results.request.geojson
    if has_map:
        map_tables.check_map(store, results.request.event or (), by, complete=is_complete(store))
    optional = {SIMCENTER: simcenter, GEOJSON: has_map, DISTRICTS: has_map and by is not None}
    # Files that an earlier call has written are updated also, because outdated files could be
    # mistaken for the current state.
    exported = {*PARQUET}
    for name, is_requested in optional.items():
        if is_requested or store.is_ours(folder / name):
            exported.add(name)
    writers = _exports(results, exported)
    # A map of districts that this call does not write again would show an earlier state of the
    # campaign, so that it is removed.
    if DISTRICTS in exported and not writers[DISTRICTS]:
        (folder / DISTRICTS).unlink(missing_ok=True)
        terminal.note(
            f"{folder / DISTRICTS}: removed, because it was outdated; add --geojson --by COLUMN "
            "to write it again"
        )
    # The summary keeps the provenance of the runs that the last call of the campaign has recorded.
    last_summary = stored_summary(folder / SUMMARY)
    provenance: dict[str, Any] = {
        **{key: last_summary[key] for key in ("arguments", "command") if key in last_summary},
        "time_loops": store.time_loops(),
        "export": list(terminal.current().arguments),
    }
    inputs = merged_inputs(last_summary.get("inputs", ()), files_read())
    _write(results, folder, None, writers, inputs=inputs, provenance=provenance)


def _exports(results: SuiteResults, names: Collection[str]) -> dict[str, Writer | None]:
    """Return the writer of each named optional file; None if this call cannot write the file."""
    if not names:
        return {}
    from tdint.studies.campaign import exports

    tables, damages = studies.campaign_tables, studies.damage_tables
    by, events = results.by, results.request.event or ()
    store, has_pyarrow = results.store, find_spec("pyarrow") is not None
    write_parquet = partial(exports.write_parquet, store)
    writers: dict[str, Writer | None] = dict.fromkeys(names)
    runs, stories, damage, losses = PARQUET
    if has_pyarrow:
        writers[runs] = partial(write_parquet, tables.run_table(store), has_inventory=True)
        if store.parameters()["stories"]:
            writers[stories] = partial(write_parquet, tables.part_table(store, schema.STORIES))
        if store.damage():
            writers[damage] = partial(
                write_parquet, damages.damage_table(store), has_inventory=True
            )
        if has_losses(store) and is_complete(store):
            writers[losses] = partial(write_parquet, damages.loss_table(store, by))
    writers[SIMCENTER] = partial(exports.write_simcenter, store)
    if is_complete(store) and map_tables.is_mapped(store):
        buildings = map_tables.building_features(store, results.units, events)
        writers[GEOJSON] = partial(map_tables.write_geojson, buildings)
        if by is not None and DISTRICTS in names:
            file = results.request.polygons
            polygons = None if file is None else map_tables.read_polygons(store, file, by)
            features = map_tables.district_features(store, by, polygons, events)
            writers[DISTRICTS] = partial(map_tables.write_geojson, features)
    return {name: writers[name] for name in names}


def _write(
    results: SuiteResults,
    folder: Path,
    plan: Plan | None,
    exports: Mapping[str, Writer | None],
    *,
    inputs: Iterable[Mapping[str, str]],
    provenance: Mapping[str, Any],
) -> None:
    """Write the tables of a store, additional files and, last, the summary.

    `provenance` is the provenance for the summary: command lines of the runs and of the export, and
    the execution of the time loops.
    """
    request, store, units, by = results.request, results.store, results.units, results.by
    tables, damages = studies.campaign_tables, studies.damage_tables
    # Write runs.csv, unless the campaign selects only other tables.
    files: dict[str, Content] = {}
    if store.is_requested("runs"):
        files[RUNS] = lambda stream: tables.run_table(store).write(stream, units)
    files |= _suite_contents(results, folder, plan)
    files |= {name: writer for name, writer in exports.items() if writer}
    settings = store.parameters()
    for name, table in schema.PART_TABLES.items():
        # Rows of stories are also stored for profiles.csv. Elements, attachments, links and events
        # have rows only if the buildings or the motions have them.
        is_written = settings["stories"] if name == STORIES else store.has_rows(table)
        if is_written:
            files[name] = partial(tables.part_table(store, table).write, units=units)
    # Tables of means over the motions are written only after all runs are completed.
    complete = is_complete(store)
    if settings["profiles"] and complete:
        files[PROFILES] = tables.profiles_table(store, units).write
        terminal.warn(*filter(None, [small_sample_warning(store.smallest_suite())]))
    if store.damage() and store.is_requested("damage"):
        files[DAMAGE] = lambda stream: damages.damage_table(store).write(stream, units)
        if complete:
            files[TYPES] = damages.type_table(store).write
    # Losses require a damage state with a loss ratio. Their exceedance rates also require rates of
    # the events.
    if has_losses(store) and complete and store.is_requested("losses"):
        files[LOSSES] = damages.loss_table(store, by).write
        if store.rates():
            files[EXCEEDANCE] = damages.exceedance_table(store, by).write
    summary = campaign_summary(store) | (results.limit_summary() if complete else {})
    summary["inputs"] = merged_inputs(summary["inputs"], inputs)
    unit_of_key = {key: unit for key, (unit, _) in LIMIT_MEANINGS.items()}
    files[SUMMARY] = json_bytes({**in_units(summary, units, unit_of_key), **provenance})
    contents_of_paths = {folder / name: content for name, content in files.items()}
    if not request.overwrite:
        store.refuse_foreign(contents_of_paths)
    # Without --overwrite, a file that was not written from this store is kept.
    earlier_files = (folder / name for name in _WRITTEN_FILES)
    stale = {file: "" for file in earlier_files if request.overwrite or store.is_ours(file)}
    write_from_store(store, contents_of_paths, folder / FILE, stale)


def report_outcomes(store: Store) -> None:
    """Report the numbers of runs that failed, collapsed, were repeated, have no error estimate, or
    did not come to rest.
    """
    statuses = store.statuses()
    failed = {name: statuses[name] for name in FAILED if name in statuses}
    # Missing results require a warning. A collapse is a result and is reported as a plain line.
    if failed:
        listed = ", ".join(f"{count} {name}" for name, count in failed.items())
        terminal.warn(
            f"{pluralize(sum(failed.values()), 'run')} without a result ({listed}); the cells of "
            "these runs are empty"
        )
    collapsed = {name: statuses[name] for name in FALLEN if name in statuses}
    if collapsed:
        listed = ", ".join(f"{pluralize(count, 'run')} {name}" for name, count in collapsed.items())
        terminal.say(f"{listed}.")
    if repeated := store.count("repeats > 0"):
        terminal.note(
            f"{pluralize(repeated, 'run')} repeated with smaller time steps (column dt_s)"
        )
    if without_estimate := without_error(store):
        terminal.note(
            f"{pluralize(without_estimate, 'run')} without error estimates, because the additional "
            "run for the estimate failed, or collapsed before the end of the run; the cells of "
            "these errors are empty"
        )
    if moving := store.count("at_rest = 0"):
        terminal.warn(
            f"{pluralize(moving, 'run')} still in motion at the end of the analysis; the "
            "residual drifts of these runs are not final values; omit them from evaluations "
            f"(at_rest = 0 in {FILE})"
        )
