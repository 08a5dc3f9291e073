"""`tdint campaign`: runs of many buildings under many records at many intensity levels, which are
stored on disk as they are completed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint.errors import ModelError, RecordError, TdintError, UsageError
from tdint.number_parsing import abbreviate, parse_head, pluralize
from tdint.system import processors
from tdint.units import OutputUnits
from tdint_cli import options
from tdint_cli.drawing import emit_table
from tdint_cli.options.grammar import Mode, refuse_idle
from tdint_cli.options.option_types import FileName, ListOf, Name, Written
from tdint_cli.options.suite import CHANGED, LIMIT, PAIR_DEMAND, REQUIRE, SuiteRequest
from tdint_cli.studies import options as study_options
from tdint_cli.studies.campaign_files import (
    Profiles,
    apply_style,
    check_names,
    execute_campaign,
    export,
    finish,
    refuse_foreign,
)
from tdint_cli.terminal import Failures, say, warn

if TYPE_CHECKING:
    from tdint.studies.store.result_store import Store


@options.request
class CampaignRequest(SuiteRequest):
    """The command line of `tdint campaign`."""

    arguments: tuple[str, ...] = options.argument(
        "CAMPAIGN.yaml|status|merge|export DIR...", nargs=-1, required=True, type=FileName()
    )
    output: str | None = options.output.output(
        "DIR",
        "Directory of the campaign: campaign.sqlite, runs.csv, profiles.csv, summary.json, "
        "stories.csv, elements.csv.",
    )
    jobs: int | None = options.output.threads("Number of threads; one per processor")
    shard: str | None = options.option(
        metavar="K/N",
        help="Run only part K of N, each part in a separate directory; `merge` combines the parts.",
    )
    max_runs: int | None = options.option(
        type=click.IntRange(1),
        metavar="N",
        recorded=False,
        help="Stop after about N runs; the same call continues the campaign.",
    )
    dask: str | None = options.option(
        metavar="ADDRESS",
        rare=True,
        recorded=False,
        help="Execute the runs on the workers of this Dask scheduler: tcp://127.0.0.1:8786 on this "
        "machine, tls:// on other machines (certificates: the configuration of Dask).",
    )
    partial: bool = options.option(
        rare=True, help="With merge: accept missing runs, and report their number."
    )
    simcenter: bool = options.output.option(
        rare=True,
        help="With export: also write simcenter.csv, the demands with SimCenter names (1-PFA-1-1).",
    )
    geojson: bool = options.output.option(
        rare=True,
        help="With export: also write buildings.geojson, the buildings of an inventory as points "
        "with their demands, damage, losses and average annual losses, for maps; with --by COLUMN "
        "also districts.geojson, the losses by the values of that column.",
    )
    event: tuple[str, ...] | None = options.output.option(
        type=ListOf(Name()),
        needs="--geojson",
        rare=True,
        help="Write only these events of ground motion fields to the maps.",
    )
    polygons: str | None = options.output.option(
        type=FileName(),
        needs="--geojson",
        rare=True,
        metavar="FILE.geojson",
        help="Polygons of the districts for districts.geojson, with a property that has the name "
        "of the column of --by; points of the buildings by default.",
    )

    plot: str | None = options.output.plot(
        "Also plot drifts, accelerations and shears over the height, for each ground motion and "
        "over all motions: to this file (.png, .pdf, .svg), by default profiles.png in the "
        "directory."
    )
    report: str | None = options.output.report
    report_head: tuple[tuple[str, str], ...] | None = options.output.option(
        needs="--report",
        type=Written("head", parse_head),
        metavar="TEXT",
        rare=True,
        help="Lines at the top of the report, instead of `report` of the models: 'Project: Bridge "
        "7; Author: A. B.'.",
    )
    output_units: OutputUnits | None = options.output.units
    overwrite: bool = options.output.overwrite
    changed: bool = CHANGED
    limit: float | str | None = LIMIT
    require: bool = REQUIRE
    pair_demand: str | None = PAIR_DEMAND
    baseline: str | None = options.analysis.option(
        metavar="NAME",
        help="Also write ratios.csv: mean, median and maximum of each building divided by the "
        "values of this building; the ratios of the maximum over all stories are printed.",
    )
    by: str | None = options.output.option(
        metavar="COLUMN",
        rare=True,
        help="Also report losses by the values of this column of the inventory, such as district, "
        "in a column of losses.csv.",
    )
    im: tuple[str, ...] | None = study_options.option(
        type=ListOf(Name()),
        rare=True,
        help="Also write measures.csv, intensity measures of each run for `tdint fragility --im`: "
        "pga, pgv, pgd, arias, cav, cav5, d5-75, d5-95, sa (at T1) or sa:SECONDS, sa-avg (about "
        "T1) or sa-avg:FIRST:LAST in seconds, sdi:T1:STRENGTH or sdi:SECONDS:STRENGTH (yield force "
        "divided by weight).",
    )


# Each mode of the command lists its options. The advice states why an option cannot be used.
_TABLE_OPTIONS = frozenset(
    ("output_units", "overwrite", "plot", "limit", "baseline", "by", "pair_demand")
)
_RUN_OPTIONS = frozenset(("jobs", "shard", "max_runs", "dask", "im", "report", "floors", "changed"))
_NO_MODELS = dict.fromkeys(
    ("im", "report", "floors"), "it requires the models; add it to the call that executes the runs"
)
_RUN = Mode("with `tdint campaign CAMPAIGN.yaml`", _TABLE_OPTIONS | _RUN_OPTIONS | {"output"})
_STATUS = Mode("with `tdint campaign status`", advice=_NO_MODELS)
_EXPORT = Mode(
    "with `tdint campaign export`", _TABLE_OPTIONS | {"simcenter", "geojson"}, _NO_MODELS
)
_MERGE = Mode("with `tdint campaign merge`", _TABLE_OPTIONS | {"output", "partial"}, _NO_MODELS)
MODES = (_RUN, _STATUS, _EXPORT, _MERGE)


@options.command(
    "campaign",
    "tdint campaign campaign.yaml -o study --plot",
    "tdint campaign status study",
    exits={
        4: "a record could not be read; the other records are processed",
        5: "with --require: the limit is exceeded, or the campaign is not complete",
    },
)
@options.analysis.plugin
@options.spectra.floor_request
@options.of(CampaignRequest)
def command(request: CampaignRequest) -> None:
    """Run many buildings under many records at many intensity levels.

    `tdint campaign CAMPAIGN.yaml -o DIR` executes all runs of the file, and writes one row per run
    to DIR/runs.csv, and mean, fractiles and maximum over the ground motions to DIR/profiles.csv.
    After an interruption, the same call continues the campaign. `status DIR` reports the progress,
    `export DIR` writes the tables again, `merge DIR... -o DIR` combines parts that were run with
    --shard.

    A run that fails is repeated with smaller time steps; if it fails again, its row contains the
    status without peaks. Records that cannot be read are reported, the other records are processed,
    and the exit code is 4.
    """
    mode, act = _ACTIONS.get(request.arguments[0], (_RUN, _run))
    refuse_idle(mode, MODES)
    act(request)


def _run(request: CampaignRequest) -> None:
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
    if request.im:
        from tdint.studies.fragility.measures import run_measure

        for name in request.im:
            run_measure(name)
    check_names(Path(request.output), request)
    from tdint.studies.campaign.execute import Shard, cluster, threads
    from tdint.studies.campaign.inputs import read_inputs
    from tdint.studies.campaign.load_cases import LoadFiles
    from tdint.studies.campaign.plan import make_plan
    from tdint.studies.campaign.reader import load_campaign

    shard = None
    if request.shard is not None:
        first, slash, last = request.shard.partition("/")
        if not (slash and first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last)):
            raise UsageError(
                f"--shard must be K/N with K from 1 to N, such as 2/8, got {request.shard!r}"
            )
        shard = Shard(int(first), int(last))
    if request.dask is not None:
        from tdint.studies.campaign.cluster import Cluster

        scheduler = Cluster(request.dask)
        if request.jobs is not None:
            raise UsageError("--jobs cannot be used with --dask; omit --jobs")
        engine = cluster(scheduler)
    else:
        engine = threads(request.jobs or processors())
    campaign = load_campaign(request.arguments[0])
    if request.im and isinstance(campaign.records, LoadFiles):
        raise UsageError(
            "--im cannot be used with `forces`, which have no ground motion; omit --im"
        )
    campaign = replace(campaign, pair_demand=request.pair_demand or campaign.pair_demand)
    plan = make_plan(campaign, read_inputs(campaign))
    apply_style(plan.style, campaign.source)
    execute_campaign(plan, engine, request, shard=shard, max_runs=request.max_runs)


def _status(request: CampaignRequest) -> None:
    """Write the number of runs of each status to standard output (`tdint campaign status`).

    Warnings list the inputs that could not be used.
    """
    from tdint.studies.campaign.campaign_tables import status_table
    from tdint.studies.store.opening import check_chunks, open_existing

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


def _export(request: CampaignRequest) -> None:
    """Write the tables of a campaign again (`tdint campaign export`). Failures is raised afterwards
    if a limit is exceeded with --require.
    """
    from tdint.studies.store.opening import check_chunks, open_existing

    folder = _folder(request)
    with open_existing(folder, write=True) as store:
        extra_files = check_names(folder, request)
        apply_style(store.style(), str(folder))
        if not request.overwrite:
            store.refuse_foreign(extra_files)
        check_chunks(store)
        if request.pair_demand is not None:
            store.choose_pair_demand(request.pair_demand)
        profiles = Profiles(store, request)
        if request.polygons is not None and request.by is None:
            raise UsageError("--polygons requires --by COLUMN, the column of the districts")
        export(profiles, folder, simcenter=request.simcenter)
        if unmet_limits := profiles.report_results():
            raise Failures(unmet_limits)


def _merge(request: CampaignRequest) -> None:
    """Combine the parts of a campaign in a single directory, and write the tables. Failures is
    raised afterwards if some inputs could not be used, or with --require a limit is exceeded.
    """
    folders = [Path(word) for word in request.arguments[1:]]
    if not folders or request.output is None:
        raise UsageError(
            "the directories to merge and -o DIR are required, such as: tdint campaign merge "
            "out-*/ -o all/"
        )
    from tdint.studies.campaign.execute import merge
    from tdint.studies.store.schema import locked

    target = Path(request.output)
    # Lock the directory, so that no other process writes to the directory while the stores are
    # copied.
    with locked(target):
        check_names(target, request)
        refuse_foreign(target, stories=True, profiles=True, overwrite=request.overwrite)
        with merge(folders, target, partial=request.partial) as store:
            apply_style(store.style(), str(target))
            if request.pair_demand is not None:
                store.choose_pair_demand(request.pair_demand)
            profiles = Profiles(store, request)
            finish(profiles, target)
            run_count, done = int(store.meta("runs")), sum(store.statuses().values())
            if done < run_count:
                missing = f"{run_count - done} of {run_count} runs are missing in the directories"
                warn(f"{missing}; `tdint campaign FILE -o {target}` executes them")
            failures = [*_unused_inputs(store), *profiles.report_results()]
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


_ACTIONS: dict[str, tuple[Mode, Callable[[CampaignRequest], None]]] = {
    "status": (_STATUS, _status),
    "export": (_EXPORT, _export),
    "merge": (_MERGE, _merge),
}
