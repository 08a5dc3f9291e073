"""The options of `tdint campaign`."""

from __future__ import annotations

import click

from tdint.number_parsing import parse_head
from tdint.units import OutputUnits
from tdint_cli import options
from tdint_cli.options.option_types import FileName, Written
from tdint_cli.options.suite import LIMIT, SuiteRequest


@options.request
class CampaignRequest(SuiteRequest):
    """The command line of `tdint campaign`."""

    arguments: tuple[str, ...] = options.argument(
        "CAMPAIGN.yaml|status|merge|export DIR...", nargs=-1, required=True, type=FileName()
    )
    output: str | None = options.output.output
    jobs: int | None = options.option()
    shard: str | None = options.option()
    max_runs: int | None = options.option(type=click.IntRange(1))
    dask: str | None = options.option()
    partial: bool = options.option()
    simcenter: bool = options.option()
    geojson: bool = options.option()
    event: tuple[str, ...] | None = options.option()
    polygons: str | None = options.option()

    plot: str | None = options.output.plot
    report: str | None = options.output.report
    report_head: tuple[tuple[str, str], ...] | None = options.option(
        type=Written("head", parse_head)
    )
    output_units: OutputUnits | None = options.option()
    overwrite: bool = options.option()
    changed: bool = options.option()
    limit: float | str | None = LIMIT
    require: bool = options.option()
    risk_category: str | None = options.option(
        type=click.Choice(("I", "II", "III", "IV"), case_sensitive=False)
    )
    pair_demand: str | None = options.option()
    baseline: str | None = options.option()
    by: str | None = options.option()
    im: tuple[str, ...] | None = options.option()
