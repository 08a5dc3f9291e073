"""`tdint run` with several records or scales: a small campaign with a row for each run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tdint.errors import UsageError
from tdint.ground_motion.reading.suites import suite_motions
from tdint.model.config.model_file import load_model
from tdint.model.config.record_files import RecordFiles
from tdint.model.definition import Model
from tdint.response.arguments import model_record
from tdint.response.runs.settings import settings_from
from tdint.studies.campaign.assigned_motions import CampaignMotions, FactorTable, Scales
from tdint.studies.campaign.chunks import CampaignSettings
from tdint.studies.campaign.definition import AnalysisOverrides, CampaignFile
from tdint.studies.campaign.execute import threads
from tdint.studies.campaign.inputs import Inputs, read_inputs
from tdint.studies.campaign.plan import make_plan
from tdint.system import processors
from tdint_cli.commands.run_request import Request
from tdint_cli.options.analysis import changed, with_motion
from tdint_cli.studies.campaign_files import check_names, execute_campaign


def run_many(request: Request, records: tuple[str, ...]) -> None:
    """Run a building under several records at several scales, or with the factors of a file.

    The table is written to standard output. With -o the results are stored in a directory in the
    format of `tdint campaign`.

    Parameters
    ----------
    records : tuple of str
        The record files; if empty, the records of the table of --factors or the record of the model
        are used.

    Raises
    ------
    UsageError
        An input is standard input, or options cannot be used together.
    Failures
        Some records could not be read, or with --require a limit is exceeded. Raised after all
        files are written.
    """
    if "-" in (request.model, *records):
        raise UsageError("with several records or scales, inputs must be files, not standard input")
    # Outputs are checked before the model is read, and before the runs.
    check_names(Path(request.output) if request.output else None, request)
    model = changed(load_model(request.model), request.changes)
    # The runs are a campaign with a single building, but without a campaign file.
    factors = request.factors
    own = (
        None if records or factors is not None else with_motion(model, replace(request, scale=None))
    )
    own_factor = own.excitation.record.scale if own and own.excitation.record else 1.0
    scales = tuple(own_factor * factor for factor in request.scale or (1.0,))
    campaign = CampaignFile(
        name=model.name,
        source=model.source,
        records=RecordFiles(records, request.choice),
        intensity=Scales(scales) if factors is None else FactorTable(factors, {}),
        analysis=AnalysisOverrides(request.method),
        settings=settings_from(request, CampaignSettings, profiles=True, check=bool(request.check)),
        pair_demand=request.pair_demand,
    )
    if own is None:
        inputs = read_inputs(campaign, (model,))
    else:
        record = model_record(_unscaled(own))
        if record is None:
            raise UsageError("--scale requires a record, and the model has no record: add RECORD")
        inputs = Inputs((model,), motions=CampaignMotions(suite_motions([record])))
    plan = make_plan(campaign, inputs)
    # With a directory the runs are a campaign that can be resumed; otherwise the store is in
    # memory.
    execute_campaign(plan, threads(request.jobs or processors()), request, show=True)


def _unscaled(model: Model) -> Model:
    """Return a model whose record has the factor 1 in all directions: the levels contain it."""
    source = model.excitation.record
    excitation = replace(model.excitation, record=source and replace(source, scale=1.0))
    across = model.across and _unscaled(model.across)
    return replace(model, excitation=excitation, across=across)
