"""`tdint run` with several records or scales: a small campaign with a row for each run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tdint import studies
from tdint.errors import UsageError
from tdint.files import write_files
from tdint.number_parsing import pluralize
from tdint.system import processors
from tdint_cli.commands.run_request import Request
from tdint_cli.demand_limits import check_limit_options
from tdint_cli.drawing import emit_table
from tdint_cli.options.analysis import with_motion
from tdint_cli.studies.campaign_files import (
    Profiles,
    advance_with_bar,
    check_names,
    execute_campaign,
    report_outcomes,
    report_pairs,
    warn_of_plan,
)
from tdint_cli.terminal import Failures, note_of_runs, say

if TYPE_CHECKING:
    from tdint.files import Content
    from tdint.model.definition import Model
    from tdint.studies.campaign.plan import Plan


def run_many(request: Request, records: tuple[str, ...]) -> None:
    """Run a building under several records at several scales, or with the factors of a file.

    The table is written to standard output. With -o the results are stored in a directory in the
    format of `tdint campaign`.

    Parameters
    ----------
    records : tuple of str
        The record files; if empty, the record of the model is used.

    Raises
    ------
    UsageError
        An input is standard input, or options cannot be used together.
    Failures
        Some records could not be read, or with --require a limit is exceeded. Raised after all
        files are written.
    """
    from tdint.model.config.model_file import load_model
    from tdint.studies.campaign.execute import threads
    from tdint.studies.store.opening import open_store

    if "-" in (request.model, *records):
        raise UsageError("with several records or scales, inputs must be files, not standard input")
    # Outputs are checked before the model is read, and before the runs.
    check_names(Path(request.output) if request.output else None, request)
    model = load_model(request.model)
    plan = _plan(request, records, model)
    engine = threads(request.jobs or processors())
    # With a directory the runs are a campaign that can be resumed; otherwise the store is in
    # memory.
    if request.output is not None:
        execute_campaign(plan, engine, request, show=True)
        return
    report_pairs(plan, request)
    check_limit_options(request.limit, request.require, plan.models)
    store, _ = open_store(None, plan)
    warn_of_plan(plan)
    note_of_runs(*plan.notes)
    with store:
        profiles = Profiles(store, request)
        advance = advance_with_bar(plan, store, engine)
        emit_table(studies.campaign.campaign_tables.runs_table(store).in_units(profiles.units))
        say(f"{pluralize(advance.done, 'run')}.")
        report_outcomes(store)
        picture = request.picture(None)
        files: dict[Path, Content] = {picture: profiles.draw(picture)} if picture else {}
        if request.report:
            files[Path(request.report)] = profiles.report(plan)
        write_files(files, overwrite=request.overwrite)
        unmet_limits = profiles.report_results()
    if plan.failures or unmet_limits:
        raise Failures([*plan.failures, *unmet_limits])


def _plan(request: Request, records: tuple[str, ...], model: Model) -> Plan:
    """Return the plan of the runs of a building under several records, as a campaign with a single
    building, but without a campaign file.

    Without records, the records of the table of --factors are used, or the record of the model
    (UsageError if it has no record).
    """
    from tdint.response.runs.settings import settings_from
    from tdint.studies.campaign.assigned_motions import CampaignMotions, Scales
    from tdint.studies.campaign.chunks import CampaignSettings
    from tdint.studies.campaign.definition import (
        AnalysisOverrides,
        CampaignFile,
        FactorsFile,
        ModelFiles,
        RecordFiles,
    )
    from tdint.studies.campaign.inputs import (
        Inputs,
        read_factors,
        read_listed_motions,
        read_motions,
    )
    from tdint.studies.campaign.plan import make_plan

    factors_file = FactorsFile(request.factors) if request.factors is not None else None
    table = read_factors(factors_file) if factors_file else None
    campaign = CampaignFile(
        name=model.name,
        source=model.source,
        buildings=ModelFiles((model.source,)),
        records=(record_files := RecordFiles(records, request.choice)),
        intensity=factors_file or Scales(request.scale or (1.0,)),
        analysis=AnalysisOverrides(request.method),
        settings=settings_from(request, CampaignSettings, profiles=True, check=bool(request.check)),
        pair_demand=request.pair_demand,
    )
    if records:
        motions = read_motions(record_files)
    elif table:
        table, motions = read_listed_motions(table, record_files)
    else:
        from tdint.ground_motion.reading.suites import suite_motions
        from tdint.response.arguments import model_record

        # Use the unscaled record of the model: --scale defines the levels.
        record = model_record(with_motion(model, replace(request, scale=(1.0,))))
        if record is None:
            raise UsageError("--scale requires a record, and the model has no record: add RECORD")
        motions = CampaignMotions(suite_motions([record]))
    return make_plan(campaign, Inputs((model,), motions=motions, factors=table))
