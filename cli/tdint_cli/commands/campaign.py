"""`tdint campaign`: many buildings under many records at many levels, kept on disk as they are
done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tdint.errors import ModelError, RecordError, TdintError, UsageError
from tdint.system import processors
from tdint.units import OutputUnits
from tdint.written_numbers import how_many, parse_head
from tdint_cli import options
from tdint_cli.campaigns import (
    LIMIT,
    PAIR_DEMAND,
    REQUIRE,
    Profiles,
    SuiteRequest,
    carry_out,
    check_names,
    export,
    finish,
    refuse_foreign,
    set_looks,
)
from tdint_cli.drawing import emit_table
from tdint_cli.options.grammar import FileName, ListOf, Mode, Name, Written, refuse_idle
from tdint_cli.terminal import Failures, say, warn

if TYPE_CHECKING:
    from tdint.campaign.store import Store


@options.request
class CampaignRequest(SuiteRequest):
    """The command line of `tdint campaign`."""

    words: tuple[str, ...] = options.argument(
        "CAMPAIGN.yaml|status|merge|export DIR...", nargs=-1, required=True, type=FileName()
    )
    output: str | None = options.output.output(
        "DIR",
        "The folder of the campaign: campaign.sqlite, runs.csv, profiles.csv, summary.json, "
        "stories.csv.",
    )
    jobs: int | None = options.output.threads("Threads; one for each processor")
    shard: str | None = options.option(
        metavar="K/N",
        help="Do the K-th of N parts alone, each into a folder of its own; then merge them.",
    )
    max_runs: int | None = options.option(
        type=click.IntRange(1),
        metavar="N",
        recorded=False,
        help="Stop after about N runs; call again to go on.",
    )
    dask: str | None = options.option(
        metavar="ADDRESS",
        rare=True,
        recorded=False,
        help="Have the workers of this Dask scheduler do the runs: tcp://127.0.0.1:8786 on this "
        "machine, else tls://.",
    )
    tls_ca: str | None = options.option(
        type=FileName(),
        needs="--dask",
        rare=True,
        recorded=False,
        help="Certificate of the authority, for tls:// (PEM).",
    )
    tls_cert: str | None = options.option(
        type=FileName(),
        needs="--dask",
        rare=True,
        recorded=False,
        help="Our certificate (PEM).",
    )
    tls_key: str | None = options.option(
        type=FileName(),
        needs="--dask",
        rare=True,
        recorded=False,
        help="Its key (PEM).",
    )
    partial: bool = options.option(
        rare=True, help="With merge: accept that runs are in none of the folders, and say how many."
    )
    simcenter: bool = options.output.option(
        rare=True,
        help="With export: also simcenter.csv, the demands under SimCenter's names (1-PFA-1-1).",
    )
    geojson: bool = options.output.option(
        rare=True,
        help="With export: also buildings.geojson, the buildings of an inventory as points with "
        "their mean and largest demands, for maps.",
    )

    plot: str | None = options.output.plot(
        "Also draw drifts, accelerations and shears over the height, of each motion and over all: "
        "to this file (.png, .pdf, .svg), or alone as profiles.png into the folder."
    )
    report: str | None = options.output.report
    report_head: tuple[tuple[str, str], ...] | None = options.output.option(
        needs="--report",
        type=Written("head", parse_head),
        metavar="TEXT",
        rare=True,
        help="Lines at the top of the page, in place of `report` of the models: 'Project: Bridge "
        "7; Author: A. B.'.",
    )
    output_units: OutputUnits | None = options.output.units
    overwrite: bool = options.output.overwrite
    limit: float | None = LIMIT
    require: bool = REQUIRE
    pair_demand: str | None = PAIR_DEMAND
    baseline: str | None = options.analysis.option(
        metavar="NAME",
        help="Also write ratios.csv: each building's mean, median and largest over those of this "
        "one, and tell the ratios of the largest of all stories.",
    )
    by: str | None = options.output.option(
        metavar="COLUMN",
        rare=True,
        help="Losses also by what stands in this column of the inventory, such as district: a "
        "column of losses.csv.",
    )
    im: tuple[str, ...] | None = options.studies.option(
        type=ListOf(Name()),
        rare=True,
        help="Also write measures.csv, intensities of each run for `tdint fragility --im`: pga, "
        "pgv, pgd, arias, cav, cav5, d5-75, d5-95, sa (at T1) or sa:SECONDS, sa-avg (about T1) or "
        "sa-avg:FIRST:LAST in seconds, sdi:T1:STRENGTH or sdi:SECONDS:STRENGTH (yield force over "
        "weight).",
    )


_OF_TABLES = frozenset(
    ("output_units", "overwrite", "plot", "limit", "baseline", "by", "pair_demand")
)
_OF_RUNS = frozenset(("jobs", "shard", "max_runs", "dask", "im", "report", "floors"))
_NO_MODELS = dict.fromkeys(
    ("im", "report", "floors"), "it has no models: give it to the call that does the runs"
)
_RUN = Mode("with `tdint campaign CAMPAIGN.yaml`", _OF_TABLES | _OF_RUNS | {"output"})
_STATUS = Mode("with `tdint campaign status`", advice=_NO_MODELS)
_EXPORT = Mode("with `tdint campaign export`", _OF_TABLES | {"simcenter", "geojson"}, _NO_MODELS)
_MERGE = Mode("with `tdint campaign merge`", _OF_TABLES | {"output", "partial"}, _NO_MODELS)
MODES = (_RUN, _STATUS, _EXPORT, _MERGE)


@options.command(
    "campaign",
    "tdint campaign campaign.yaml -o study --plot",
    "tdint campaign status study",
    exits={
        4: "a record could not be read; the others are done",
        5: "with --require the limit is not kept, or the study not complete",
    },
)
@options.analysis.plugin
@options.spectra.of_floors
@options.of(CampaignRequest)
def command(request: CampaignRequest) -> None:
    """Run many buildings under many records at many intensity levels.

    `tdint campaign CAMPAIGN.yaml -o DIR` does all runs that the file asks for and writes a row of
    each to DIR/runs.csv, and their mean, fractiles and largest over the motions to
    DIR/profiles.csv. Whatever ends it, the same call goes on where it stopped. `status DIR` tells
    how far it is, `export DIR` writes the tables anew, `merge DIR... -o DIR` puts parts together
    that were done with --shard.

    A run that fails is repeated with finer steps; if it still does, its row has the status and no
    peaks. Records that cannot be read are told, the others are done, and the exit code is 4.
    """
    mode, act = _ACTIONS.get(request.words[0], (_RUN, _run))
    refuse_idle(mode, MODES)
    act(request)


def _run(request: CampaignRequest) -> None:
    if len(request.words) > 1:
        raise UsageError(
            f"a campaign is one file, got {len(request.words)}: {' '.join(request.words)}"
        )
    if request.output is None:
        raise UsageError("a campaign is kept in a folder: give -o DIR")
    # What can be seen to fail is refused before the inputs are read: floors, measures, outputs,
    # shard, cluster.
    request.of_floors.check(request.output)
    if request.im:
        from tdint.campaign.fragility.measures import run_measure

        for name in request.im:
            run_measure(name)
    check_names(Path(request.output), request)
    from tdint.campaign.execute import Shard, cluster, threads
    from tdint.campaign.inputs import read_inputs
    from tdint.campaign.plan import make_plan
    from tdint.campaign.reader import load_campaign

    shard = None
    if request.shard is not None:
        first, slash, last = request.shard.partition("/")
        if not (slash and first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last)):
            raise UsageError(
                f"--shard is K/N with K from 1 to N, such as 2/8, got {request.shard!r}"
            )
        shard = Shard(int(first), int(last))
    if request.dask is not None:
        from tdint.campaign.cluster import Cluster

        far = Cluster(request.dask, request.tls_ca, request.tls_cert, request.tls_key)
        if request.jobs is not None:
            raise UsageError("--jobs is for threads of this machine; leave it out with --dask")
        engine = cluster(far)
    else:
        engine = threads(request.jobs or processors())
    campaign = load_campaign(request.words[0])
    campaign = replace(campaign, pair_demand=request.pair_demand or campaign.pair_demand)
    plan = make_plan(campaign, read_inputs(campaign))
    set_looks(plan.style, campaign.source, drawn=bool(request.plot or request.report))
    carry_out(plan, engine, request, shard=shard, max_runs=request.max_runs)


def _status(request: CampaignRequest) -> None:
    from tdint.campaign.store import check_chunks, open_existing
    from tdint.output.tables.campaign import status_table

    with open_existing(_folder(request)) as store:
        check_chunks(store)
        statuses, every = store.statuses(), int(store.meta("runs"))
        done = sum(statuses.values())
        emit_table(status_table(statuses, every - done))
        say(f"{store.meta('name')}: {done} of {how_many(every, 'run')} done.")
        for kind, reasons in store.unused().items():
            if reasons:
                warn(f"{how_many(len(reasons), kind)} could not be used:\n" + "\n".join(reasons))


def _export(request: CampaignRequest) -> None:
    from tdint.campaign.store import check_chunks, open_existing

    folder = _folder(request)
    with open_existing(folder, write=True) as store:
        named = check_names(folder, request)
        set_looks(store.style(), str(folder), drawn=bool(request.plot or request.report))
        if not request.overwrite:
            store.refuse_foreign(named)
        check_chunks(store)
        if request.pair_demand is not None:
            store.choose_pair_demand(request.pair_demand)
        profiles = Profiles(store, request)
        export(profiles, folder, simcenter=request.simcenter, geojson=request.geojson)
        if unmet := profiles.tell():
            raise Failures(unmet)


def _merge(request: CampaignRequest) -> None:
    folders = [Path(word) for word in request.words[1:]]
    if not folders or request.output is None:
        raise UsageError(
            "give the folders to merge and -o DIR: tdint campaign merge out-*/ -o all/"
        )
    from tdint.campaign.execute import merge
    from tdint.campaign.store_schema import locked

    target = Path(request.output)
    # Nobody else may write there while stores are copied, chunk by chunk.
    with locked(target):
        check_names(target, request)
        refuse_foreign(target, stories=True, profiles=True, overwrite=request.overwrite)
        with merge(folders, target, partial=request.partial) as store:
            set_looks(store.style(), str(target), drawn=bool(request.plot or request.report))
            if request.pair_demand is not None:
                store.choose_pair_demand(request.pair_demand)
            profiles = Profiles(store, request)
            finish(profiles, target)
            every, done = int(store.meta("runs")), sum(store.statuses().values())
            if done < every:
                rest = f"`tdint campaign FILE -o {target}` does the rest"
                warn(f"{every - done} of {every} runs are in none of them; {rest}")
            failures = [*_unused_inputs(store), *profiles.tell()]
            if failures:
                raise Failures(failures)


def _unused_inputs(store: Store) -> list[TdintError]:
    """Return an error for the records, and one for the buildings, that a campaign could not use.

    The calls for the shards end with the same errors. A campaign that lacks some of its inputs is
    not complete, although all runs of the others are done.
    """
    kinds: tuple[tuple[str, type[TdintError]], ...] = (
        ("building", ModelError),
        ("record", RecordError),
    )
    errors = []
    for kind, error in kinds:
        reasons = store.unused()[kind]
        # A building without a ground motion is reported as a record is that cannot be read.
        if kind == "building" and all("max_distance is " in reason for reason in reasons):
            error = RecordError
        if reasons:
            text = f"{store.name}: {how_many(len(reasons), kind)} could not be used"
            errors.append(error(f"{text}, such as {reasons[0]}"))
    return errors


def _folder(request: CampaignRequest) -> Path:
    if len(request.words) != 2:
        raise UsageError(f"give one folder: tdint campaign {request.words[0]} DIR")
    return Path(request.words[1])


_ACTIONS: dict[str, tuple[Mode, Callable[[CampaignRequest], None]]] = {
    "status": (_STATUS, _status),
    "export": (_EXPORT, _export),
    "merge": (_MERGE, _merge),
}
