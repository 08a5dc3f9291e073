"""`tdint campaign`: runs of many buildings under many records at many intensity levels, which are
stored on disk as they are completed."""

from __future__ import annotations

from tdint_cli import options
from tdint_cli.options.grammar import Mode, refuse_idle
from tdint_cli.studies.campaign_request import CampaignRequest

# Each mode of the command lists its options. The advice states why an option cannot be used.
_TABLE_OPTIONS = frozenset(
    ("output_units", "overwrite", "plot", "limit", "risk_category", "baseline", "by", "pair_demand")
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
_ACTIONS = {"status": _STATUS, "export": _EXPORT, "merge": _MERGE}
"""Modes by the first argument; other arguments are campaign files, whose runs are executed."""


@options.command
@options.analysis.plugin
@options.spectra.floor_request
@options.of(CampaignRequest)
def command(request: CampaignRequest) -> None:
    """Run many buildings under many records at many intensity levels.

    `tdint campaign CAMPAIGN.yaml -o DIR` executes all runs of the file, and writes a row per run
    to DIR/runs.csv, and mean, fractiles and maximum over the ground motions to DIR/profiles.csv.
    After an interruption, the same call continues the campaign. `status DIR` reports the progress,
    `export DIR` writes the tables again, `merge DIR... -o DIR` combines parts that were run with
    --shard.

    A run that fails is repeated with smaller time steps; if it fails again, its row contains the
    status without peaks. Records that cannot be read are reported, the other records are processed,
    and the exit code is 4.
    """
    name = request.arguments[0]
    refuse_idle(_ACTIONS.get(name, _RUN), MODES)
    # Imported here, because --help does not need the modules of campaigns.
    from tdint_cli.studies import campaign_actions

    act = getattr(campaign_actions, name) if name in _ACTIONS else campaign_actions.run
    act(request)
