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
    output: str | None = options.output.output("DIR")
    jobs: int | None = options.output.threads()
    shard: str | None = options.option(metavar="K/N")
    max_runs: int | None = options.option(type=click.IntRange(1), metavar="N", recorded=False)
    dask: str | None = options.option(metavar="ADDRESS", rare=True, recorded=False)
    partial: bool = options.option(rare=True)
    simcenter: bool = options.output.option(rare=True)
    geojson: bool = options.output.option(rare=True)
    event: tuple[str, ...] | None = options.output.option(
        type=ListOf(Written("name")), needs="--geojson", rare=True
    )
    polygons: str | None = options.output.option(
        type=FileName(), needs="--geojson", rare=True, metavar="FILE.geojson"
    )

    plot: str | None = options.output.plot()
    report: str | None = options.output.report
    report_head: tuple[tuple[str, str], ...] | None = options.output.option(
        needs="--report", type=Written("head", parse_head), metavar="TEXT", rare=True
    )
    output_units: OutputUnits | None = options.output.units
    overwrite: bool = options.output.overwrite
    changed: bool = CHANGED
    limit: float | str | None = LIMIT
    require: bool = REQUIRE
    risk_category: str | None = RISK_CATEGORY
    pair_demand: str | None = options.record.pair_demand()
    baseline: str | None = options.analysis.option(metavar="NAME")
    by: str | None = options.output.option(metavar="COLUMN", rare=True)
    im: tuple[str, ...] | None = study_options.option(type=ListOf(Written("name")), rare=True)
