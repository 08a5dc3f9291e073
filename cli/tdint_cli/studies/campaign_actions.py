"""Actions of `tdint campaign`: execute the runs of a campaign file, report their progress, write
their tables again, and merge parts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tdint.errors import ModelError, RecordError, TdintError, UsageError
from tdint.number_parsing import abbreviate, pluralize
from tdint.studies.campaign.campaign_tables import status_table
from tdint.studies.campaign.definition import LoadFiles
from tdint.studies.campaign.execute import Shard, cluster, threads
from tdint.studies.campaign.execute import merge as merge_stores
from tdint.studies.campaign.inputs import read_inputs
from tdint.studies.campaign.plan import make_plan
from tdint.studies.campaign.reader import load_campaign
from tdint.studies.fragility.measures import run_measure
from tdint.studies.store.opening import check_chunks, open_existing
from tdint.studies.store.result_store import Store
from tdint.studies.store.schema import locked
from tdint.system import processors
from tdint_cli.drawing import emit_table
from tdint_cli.studies import campaign_files
from tdint_cli.studies.campaign_request import CampaignRequest
from tdint_cli.studies.suite_results import SuiteResults
from tdint_cli.terminal import Failures, say, warn


def run(request: CampaignRequest) -> None:
    """Execute the runs of a campaign file and write its tables.

    After all files are written, Failures is raised if some inputs could not be used, or with
    --require a limit is exceeded.
    """
    if len(request.arguments) > 1:
        raise UsageError(
            f"one campaign file is required, got {len(request.arguments)}: "
            f"{' '.join(request.arguments)}"
        )
    if request.output is None:
        raise UsageError("-o DIR is required: the directory of the campaign")
    # Check the options first, because reading the inputs of a large campaign can last minutes.
    request.floor_request.check(request.output)
    for name in request.im or ():
        run_measure(name)
    campaign_files.check_names(Path(request.output), request)
    shard = None
    if request.shard is not None:
        first, slash, last = request.shard.partition("/")
        if not (slash and first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last)):
            raise UsageError(
                f"--shard must be K/N with K from 1 to N, such as 2/8, got {request.shard!r}"
            )
        shard = Shard(int(first), int(last))
    if request.dask is not None:
        engine = cluster(request.dask)
        if request.jobs is not None:
            raise UsageError("--jobs cannot be used with --dask; omit --jobs")
    else:
        engine = threads(request.jobs or processors())
    campaign = load_campaign(request.arguments[0])
    if request.im and isinstance(campaign.records, LoadFiles):
        raise UsageError(
            "--im cannot be used with `forces`, which have no ground motion; omit --im"
        )
    campaign = replace(campaign, pair_demand=request.pair_demand or campaign.pair_demand)
    plan = make_plan(campaign, read_inputs(campaign))
    campaign_files.apply_style(plan.style, campaign.source)
    campaign_files.execute_campaign(plan, engine, request, shard=shard, max_runs=request.max_runs)


def status(request: CampaignRequest) -> None:
    """Write the number of runs of each status to standard output (`tdint campaign status`).

    Warnings list the inputs that could not be used.
    """
    with open_existing(_folder(request)) as store:
        check_chunks(store)
        statuses, run_count = store.statuses(), int(store.meta("runs"))
        done = sum(statuses.values())
        name, all_runs = store.meta("name"), ""
        # The directory of a part of a campaign has only the runs of the part, unless the other
        # parts have been merged into it.
        if (parts := store.shards()) and done <= sum(parts.values()) < run_count:
            name += f", part {abbreviate(list(parts), 4)}"
            all_runs = f" ({run_count} in all parts)"
            run_count = sum(parts.values())
        emit_table(status_table(statuses, run_count - done))
        say(f"{name}: {done} of {pluralize(run_count, 'run')} completed{all_runs}.")
        for input_kind, reasons in store.unused().items():
            if reasons:
                warn(
                    f"{pluralize(len(reasons), input_kind)} could not be used:\n"
                    + "\n".join(reasons)
                )


def export(request: CampaignRequest) -> None:
    """Write the tables of a campaign again (`tdint campaign export`). Failures is raised afterwards
    if a limit is exceeded with --require.
    """
    folder = _folder(request)
    with open_existing(folder, write=True) as store:
        extra_files = campaign_files.check_names(folder, request)
        campaign_files.apply_style(store.style(), str(folder))
        if not request.overwrite:
            store.refuse_foreign(extra_files)
        check_chunks(store)
        if request.pair_demand is not None:
            store.choose_pair_demand(request.pair_demand)
        results = SuiteResults(store, request)
        if request.polygons is not None and request.by is None:
            raise UsageError("--polygons requires --by COLUMN, the column of the districts")
        campaign_files.write_exports(results, folder, simcenter=request.simcenter)
        if unmet_limits := results.report_results():
            raise Failures(unmet_limits)


def merge(request: CampaignRequest) -> None:
    """Combine the parts of a campaign in a single directory, and write the tables. Failures is
    raised afterwards if some inputs could not be used, or with --require a limit is exceeded.
    """
    folders = [Path(word) for word in request.arguments[1:]]
    if not folders or request.output is None:
        raise UsageError(
            "the directories to merge and -o DIR are required, such as: tdint campaign merge "
            "out-*/ -o all/"
        )

    target = Path(request.output)
    # Lock the directory, so that no other process writes to the directory while the stores are
    # copied.
    with locked(target):
        campaign_files.check_names(target, request)
        campaign_files.refuse_foreign(
            target, stories=True, profiles=True, overwrite=request.overwrite
        )
        with merge_stores(
            folders, target, partial=request.partial, overwrite=request.overwrite
        ) as store:
            campaign_files.apply_style(store.style(), str(target))
            if request.pair_demand is not None:
                store.choose_pair_demand(request.pair_demand)
            results = SuiteResults(store, request)
            campaign_files.finish(results, target)
            run_count, done = int(store.meta("runs")), sum(store.statuses().values())
            if done < run_count:
                missing = f"{run_count - done} of {run_count} runs are missing in the directories"
                warn(f"{missing}; `tdint campaign FILE -o {target}` executes them")
            failures = [*_unused_inputs(store), *results.report_results()]
            if failures:
                raise Failures(failures)


def _unused_inputs(store: Store) -> list[TdintError]:
    """Return the errors for records and buildings that a campaign could not use.

    There is at most one error for all records and one for all buildings. A campaign without some of
    its inputs is not complete, although all other runs are completed, so that `merge` ends with the
    same errors as the calls for its parts.
    """
    error_types: tuple[tuple[str, type[TdintError]], ...] = (
        ("building", ModelError),
        ("record", RecordError),
    )
    errors = []
    for input_kind, error_type in error_types:
        reasons = store.unused()[input_kind]
        # A building that is farther than max_distance from the sites of all records has no ground
        # motion. If this is the only reason, the error has the exit code of an unreadable record.
        if input_kind == "building" and all("max_distance is " in reason for reason in reasons):
            error_type = RecordError
        if reasons:
            text = f"{store.name}: {pluralize(len(reasons), input_kind)} could not be used"
            errors.append(error_type(f"{text}, such as {reasons[0]}"))
    return errors


def _folder(request: CampaignRequest) -> Path:
    """Return the directory of `status` or `export`; raise UsageError unless it is exactly one."""
    if len(request.arguments) != 2:
        raise UsageError(
            f"exactly one directory is required, got {len(request.arguments) - 1}; use: "
            f"tdint campaign {request.arguments[0]} DIR"
        )
    return Path(request.arguments[1])
