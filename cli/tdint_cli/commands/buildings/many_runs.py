"""`tdint run` with several records or scales: a small campaign, a row for each run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tdint.errors import UsageError
from tdint_cli.batch.campaigns import advance_with_bar, carry_out, tell_outcomes
from tdint_cli.batch.profiles import Profiles, SuiteRequest
from tdint_cli.errors import Failures
from tdint_cli.options.building import BuildingRequest, with_motion
from tdint_cli.terminal.drawing import emit_table
from tdint_cli.terminal.streams import note, say

if TYPE_CHECKING:
    from tdint.campaign.definition import AnalysisWishes
    from tdint.campaign.draws import SuiteMotion
    from tdint.campaign.plan import Plan
    from tdint.model.definition import Model


def run_many(
    request: BuildingRequest,
    records: tuple[str, ...],
    *,
    wishes: AnalysisWishes,
    output: str | None,
    overwrite: bool,
    jobs: int | None,
    factors: str | None,
    of_suite: SuiteRequest,
) -> None:
    """Do the runs of a building under some records (those of the model without any) at some scales, or with the
    factors of a file; the table goes to standard output, and with `output` everything is kept in that folder as `tdint
    campaign` keeps it."""
    from tdint.campaign.carry_out import threads
    from tdint.campaign.store.store import open_store
    from tdint.files import check_outputs, write_files
    from tdint.model.config.model_file import load_model
    from tdint.output.tables.campaign import runs_table
    from tdint.system import processors

    picture = of_suite.picture(Path(output) if output else None)
    if output is None:
        files = (picture, Path(of_suite.report) if of_suite.report else None)
        check_outputs([file for file in files if file], overwrite=overwrite)
    model = load_model(request.model)
    plan = _plan(request, records, model, wishes, factors)
    units = of_suite.units or model.output_units
    engine = threads(jobs or processors())
    if output is None:
        store, _ = open_store(None, plan)
        for text in plan.notes:
            note(text)
        with store:
            advance = advance_with_bar(plan, store, engine)
            emit_table(runs_table(store).in_units(units))
            say(f"{advance.done} runs.")
            tell_outcomes(store)
            profiles = Profiles(store, of_suite, units)
            more = {picture: profiles.draw(picture)} if picture else {}
            if of_suite.report:
                more[Path(of_suite.report)] = profiles.report(plan)
            if more:
                write_files(more, overwrite=overwrite)
            unmet = profiles.tell()
        if plan.failures or unmet:
            raise Failures([*plan.failures, *unmet])
        return
    carry_out(
        plan, engine, Path(output), overwrite=overwrite, show=True, of_suite=of_suite
    )  # fmt: skip


def _plan(
    request: BuildingRequest, records: tuple[str, ...], model: Model, wishes: AnalysisWishes, factors: str | None
) -> Plan:
    from tdint.campaign.definition import CampaignFile, FactorsFile, ModelFiles, RecordFiles
    from tdint.campaign.draws import FoundMotions
    from tdint.campaign.inputs import Inputs, read_factors, read_motions
    from tdint.campaign.levels import Scales
    from tdint.campaign.plan import make_plan

    of_file = FactorsFile(factors) if factors is not None else None
    table = read_factors(of_file) if of_file else None
    campaign = CampaignFile(
        name=model.name,
        source=model.source,
        buildings=ModelFiles((model.source,)),
        records=(wanted := RecordFiles(records, request.choice)),
        intensity=of_file or Scales(request.scale or (1.0,)),
        analysis=wishes,
    )
    found = read_motions(wanted) if records else FoundMotions(_motions_of_model(request, model), ())
    inputs = Inputs((model,), motions=found.motions, factors=table, failures=found.failures, notes=found.notes)
    return make_plan(campaign, inputs)


def _motions_of_model(request: BuildingRequest, model: Model) -> tuple[SuiteMotion, ...]:
    from tdint.analysis.run.run import model_record
    from tdint.campaign.draws import suite_motions

    record = model_record(with_motion(model, replace(request, scale=(1.0,))))
    if record is None:
        raise UsageError("--scale needs a record, the model has none: add a RECORD")
    return suite_motions([record])
