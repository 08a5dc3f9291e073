"""Check of campaign files, for `tdint check`."""

from __future__ import annotations

import re

from tdint.files import is_file
from tdint_cli.terminal import say, warn

_CAMPAIGN = re.compile(rb"^(buildings|records|forces)\s*:", re.MULTILINE)
"""A top-level key of campaign files that model files do not have."""


def models_in(file: str) -> list[tuple[str, tuple[str, ...]]] | None:
    """Check a campaign file, and return its model files, each with the times, `dt` and `duration`,
    that the runs of the campaign have without the model; None if the file is not a campaign file.

    Both times are values of the ground motions. Load cases have the time step of their table only.
    There are no model files if the buildings are derived from an inventory, which is checked:
    warnings about unusual rows are printed.

    Raises
    ------
    ModelError
        The campaign file or the inventory has errors, which are all listed.
    RecordError
        Files of load cases are invalid.
    """
    if file == "-" or not is_file(file):
        return None
    from tdint.model.keys.document import read_source

    if not _CAMPAIGN.search(read_source(file).data):
        return None
    # Imported here, because the check of a model file needs no module of campaigns.
    from tdint.studies.campaign.definition import InventoryFile, LoadFiles
    from tdint.studies.campaign.inputs import check_load_cases, read_rows
    from tdint.studies.campaign.reader import load_campaign
    from tdint.studies.regions.inventory import unusual_rows

    campaign = load_campaign(file)
    say(f"{file}: valid campaign file")
    has_load_cases = isinstance(campaign.records, LoadFiles)
    if has_load_cases:
        check_load_cases(campaign)
    if not isinstance(campaign.buildings, InventoryFile):
        is_missing = has_load_cases and campaign.settings.duration is None
        times = ("dt",) if is_missing else ("dt", "duration")
        return [(model, times) for model in campaign.buildings]
    rows, errors = read_rows(campaign.buildings)
    warn(*unusual_rows(rows, campaign.buildings.rules))
    if errors:
        raise errors[0]
    return []
