"""`tdint campaign`: runs of many buildings under many records at many intensity levels, which are
stored on disk as they are completed."""

from __future__ import annotations

from tdint_cli import options
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.studies.campaign_request import CampaignRequest

_ACTIONS = ("status", "export", "merge")
"""First arguments; other arguments are campaign files, whose runs are executed."""


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
    action = name if name in _ACTIONS else "run"
    refuse_idle(action)
    # Imported here, because --help does not need the modules of campaigns.
    from tdint_cli.studies import campaign_actions

    getattr(campaign_actions, action)(request)
