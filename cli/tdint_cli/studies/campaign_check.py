"""Check of campaign files, for `tdint check`."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import TYPE_CHECKING

from tdint.errors import ModelError, RecordError, TdintError, UsageError
from tdint.files import is_file
from tdint_cli.terminal import say, warn

if TYPE_CHECKING:
    from tdint.model.definition import Model

_CAMPAIGN = re.compile(rb"^(buildings|records|forces)\s*:", re.MULTILINE)
"""A top-level key of campaign files that model files do not have."""

_MODEL = re.compile(rb"^(stories|building|matrices)\s*:", re.MULTILINE)
"""A top-level key of model files that campaign files do not have."""


def models_in(
    file: str,
) -> tuple[list[tuple[str, tuple[str, ...]]], list[TdintError]] | None:
    """Check a campaign file by the plan of its runs, and return its model files, each with the
    times, `dt` and `duration`, that the runs of the campaign have without the model; and the errors
    of other files and of the plan. None is returned if the file is not a campaign file.

    Both times are values of the ground motions. Load cases have the time step of their table only.
    There are no model files if the buildings are derived from an inventory. If a model is invalid,
    its errors are found with the model, and no plan is made.

    Raises
    ------
    ModelError
        The campaign file has errors, which are all listed.
    """
    if file == "-" or not is_file(file):
        return None
    from tdint.model.keys.document import read_source

    data = read_source(file).data
    if not _CAMPAIGN.search(data) or _MODEL.search(data):
        return None
    # Imported here, because the check of a model file needs no module of campaigns.
    from tdint.studies.campaign.definition import InventoryFile, LoadFiles
    from tdint.studies.campaign.inputs import read_inputs, read_models
    from tdint.studies.campaign.plan import make_plan
    from tdint.studies.campaign.reader import load_campaign

    campaign = load_campaign(file)
    listed: list[tuple[str, tuple[str, ...]]] = []
    models: tuple[Model, ...] = ()
    if not isinstance(campaign.buildings, InventoryFile):
        is_missing = isinstance(campaign.records, LoadFiles) and campaign.settings.duration is None
        times = ("dt",) if is_missing else ("dt", "duration")
        listed = [(model, times) for model in campaign.buildings]
        with suppress(ModelError):
            models = read_models(campaign.buildings, campaign.analysis)
        if not models:
            return listed, []
    try:
        plan = make_plan(campaign, read_inputs(campaign, models))
    except (ModelError, RecordError) as error:
        return listed, [error]
    except UsageError as error:
        return listed, [ModelError(str(error))]
    if not plan.failures:
        say(f"{file}: valid campaign file")
    if not models:  # unusual values of models are reported with each model
        warn(*plan.warnings)
    units = campaign.sweep.units_of(models) if campaign.sweep else {}
    for name, text in campaign.sweep.values_text.items() if campaign.sweep else ():
        say(f"vary: {name}: {text} {units[name][0] if name in units else ''}".rstrip())
    return listed, list(plan.failures)
