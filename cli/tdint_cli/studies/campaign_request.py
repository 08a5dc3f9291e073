"""The options of `tdint campaign`."""

from __future__ import annotations

import click

from tdint.number_parsing import parse_head
from tdint.units import OutputUnits
from tdint_cli import options
from tdint_cli.options.option_types import FileName, ListOf, Written
from tdint_cli.options.suite import CHANGED, LIMIT, REQUIRE, RISK_CATEGORY, SuiteRequest
from tdint_cli.studies import options as study_options


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
        help="Stop after N runs; the same call continues the campaign.",
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
        type=ListOf(Written("name")),
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
    risk_category: str | None = RISK_CATEGORY
    pair_demand: str | None = options.record.pair_demand()
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
        type=ListOf(Written("name")),
        rare=True,
        help="Also write measures.csv, intensity measures of each run for `tdint fragility --im`: "
        "pga, pgv, pgd, arias, cav, cav5, d5-75, d5-95, sa (at T1) or sa:SECONDS, sa-avg (about "
        "T1) or sa-avg:FIRST:LAST in seconds, sdi:T1:STRENGTH or sdi:SECONDS:STRENGTH (yield force "
        "divided by weight).",
    )
