"""Check of campaign files, for `tdint check`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from tdint.files import is_file
from tdint_cli.terminal import say, warn

if TYPE_CHECKING:
    from tdint.studies.campaign.definition import CampaignFile

_CAMPAIGN = re.compile(rb"^(buildings|records|forces)\s*:", re.MULTILINE)
"""A top-level key of campaign files that model files do not have."""


def _campaign_in(file: str) -> CampaignFile | None:
    """Return the campaign of a file; None if the file is not a campaign file. ModelError lists all
    errors of the file, RecordError those of its load cases."""
    if file == "-" or not is_file(file):
        return None
    from tdint.model.keys.document import read_source

    if not _CAMPAIGN.search(read_source(file).data):
        return None
    from tdint.studies.campaign.inputs import check_load_cases
    from tdint.studies.campaign.load_cases import LoadFiles
    from tdint.studies.campaign.reader import load_campaign

    campaign = load_campaign(file)
    say(f"{file}: valid campaign file")
    if isinstance(campaign.records, LoadFiles):
        check_load_cases(campaign)
    return campaign


def _models_of(campaign: CampaignFile) -> tuple[str, ...]:
    """Return the model files of a campaign; none if the buildings are derived from an inventory,
    which is checked: ModelError lists its errors, and warnings about unusual rows are printed.
    """
    from tdint.studies.campaign.definition import ModelFiles

    if isinstance(campaign.buildings, ModelFiles):
        return campaign.buildings.files
    from tdint.studies.campaign.inputs import read_rows
    from tdint.studies.regions.unusual_rows import unusual_rows

    rows, errors = read_rows(campaign.buildings)
    warn(*unusual_rows(rows, campaign.buildings.rules))
    if errors:
        raise errors[0]
    return ()


def models_in(file: str) -> list[tuple[str, tuple[str, ...]]] | None:
    """Return the model files of a campaign, each with the times, `dt` and `duration`, that the runs
    of the campaign have without the model; None if the file is not a campaign file.

    Both times are values of the ground motions. Load cases have the time step of their table only.
    """
    campaign = _campaign_in(file)
    if campaign is None:
        return None
    from tdint.studies.campaign.load_cases import LoadFiles

    is_missing = isinstance(campaign.records, LoadFiles) and campaign.settings.duration is None
    times = ("dt",) if is_missing else ("dt", "duration")
    return [(model, times) for model in _models_of(campaign)]
