"""From a checked campaign file to the plan of its runs: models, inventories, records and factors are read here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from tdint.campaign.buildings import Buildings, GivenBuildings, InventoryBuildings, Rules
from tdint.campaign.engine.settings import RunSettings
from tdint.campaign.engine.subject import Subject
from tdint.campaign.file.definition import (
    AnalysisWishes,
    CampaignFile,
    FactorsFile,
    GridFile,
    InventoryFile,
    ModelFiles,
    RecordFiles,
)
from tdint.campaign.file.grid import read_grid
from tdint.campaign.levels import GivenFactors, IntensityLevels, Levels, MeasureLevels, Scales
from tdint.campaign.motions import Assignment, EveryMotion, SuiteMotion, suite_motions
from tdint.campaign.plan import Plan
from tdint.campaign.studies.suite import read_components, read_pairs
from tdint.csv_table import no_number, number, read_table
from tdint.errors import ModelError, ModelFault, RecordError, TdintError, UsageError
from tdint.ground_motion.reading.folders import records_of
from tdint.methods.catalogue import DEFAULT_METHOD
from tdint.model.config.model_file import load_model
from tdint.model.definition import Model
from tdint.model.inventory.table import InventoryRow, read_inventory

_COLLAPSE_DRIFT = 0.10
_FACTOR_COLUMNS = ("record", "component", "factor")


@dataclass
class _Said:
    """What went wrong with records or rows while the others are taken, and what a person should know."""

    failures: list[TdintError] = field(default_factory=list)
    faults: list[ModelFault] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def make_plan(campaign: CampaignFile) -> Plan:
    """Read all that a campaign file names.

    Raises
    ------
    ModelError
        A model or the inventory cannot be used: all faults of all of them.
    RecordError
        No record can be used.
    UsageError
        A time step that does not fit.
    """
    said = _Said()
    buildings, rows = _buildings(campaign, said)
    motions, assignment = _motions(campaign, rows, said)
    if not motions:
        raise RecordError("\n".join(map(str, said.failures)) or "there is no record in this campaign")
    analysis = campaign.analysis
    plan = Plan(
        name=campaign.name,
        buildings=buildings,
        motions=motions,
        assignment=assignment,
        levels=_levels(campaign, motions),
        settings=RunSettings(analysis.dt, analysis.duration, analysis.until_rest, campaign.stories, analysis.tolerance),
        failures=(*said.failures, *([ModelError(said.faults)] if said.faults else ())),
        notes=tuple(said.notes),
    )
    plan.check_steps()
    return plan


def _buildings(campaign: CampaignFile, said: _Said) -> tuple[Buildings, Sequence[InventoryRow]]:
    wanted = campaign.buildings
    if isinstance(wanted, ModelFiles):
        return GivenBuildings.of(_subjects(wanted, campaign.analysis, said)), ()
    rows, faults = read_inventory(wanted.file, wanted.length, mass_only=wanted.mass_only)
    if not rows:
        raise ModelError(faults or f"{wanted.file}: has no building")
    said.faults += faults
    return InventoryBuildings(rows, _rules(wanted, campaign.analysis, said)), rows


def _subjects(wanted: ModelFiles, analysis: AnalysisWishes, said: _Said) -> list[Subject]:
    models: list[Model] = []
    errors: list[ModelError] = []
    for file in wanted.files:
        try:
            models.append(adapted(load_model(file), analysis))
        except ModelError as error:
            errors.append(error)
    if errors:
        faults = [fault for error in errors for fault in error.faults]
        texts = [str(error) for error in errors if not error.faults]
        raise ModelError(faults if not texts else "\n".join([*texts, *map(str, faults)]))
    return [subject_of(model, analysis.method, said.notes) for model in models]


def adapted(model: Model, analysis: AnalysisWishes) -> Model:
    """A model with what a campaign says of all buildings.

    Raises
    ------
    ModelError
        P-delta of a model without heights.
    """
    if analysis.collapse_drift is not None:
        model = replace(model, collapse_drift=analysis.collapse_drift)
    if analysis.p_delta is not None:
        if analysis.p_delta and any(story.height is None for story in model.stories):
            raise ModelError(f"{model.source}: p_delta of the campaign needs the heights of all stories")
        model = replace(model, p_delta=analysis.p_delta)
    return model


def subject_of(model: Model, method: str | None, notes: list[str]) -> Subject:
    """A building with its method: that of the campaign, of the model, or the default, which is noted."""
    chosen = method or model.analysis.method
    if chosen is None:
        chosen = DEFAULT_METHOD
        notes.append(f"{model.source}: names no method, {DEFAULT_METHOD} is used")
    return Subject(model, chosen)


def _rules(wanted: InventoryFile, analysis: AnalysisWishes, said: _Said) -> Rules:
    if analysis.method is None:
        said.notes.append(f"no method is named, {DEFAULT_METHOD} is used")
    return Rules(
        name=wanted.rules,
        stiffness=wanted.stiffness_scatter,
        damping=wanted.damping_scatter,
        seed=wanted.seed,
        method=analysis.method or DEFAULT_METHOD,
        collapse_drift=analysis.collapse_drift or _COLLAPSE_DRIFT,
        p_delta=bool(analysis.p_delta),
    )


def _motions(
    campaign: CampaignFile, rows: Sequence[InventoryRow], said: _Said
) -> tuple[tuple[SuiteMotion, ...], Assignment]:
    wanted = campaign.records
    if isinstance(wanted, GridFile):
        if not rows:
            raise UsageError(
                f"{campaign.source}: a grid of ground motions needs an inventory with Latitude and Longitude"
            )
        motions, assignment, failures = read_grid(wanted, rows)
        said.failures += failures
        return motions, assignment
    motions = read_motions(wanted, said.failures, said.notes)
    return motions, EveryMotion(len(motions))


def read_motions(wanted: RecordFiles, failures: list[TdintError], notes: list[str]) -> tuple[SuiteMotion, ...]:
    """The records of files and folders; what cannot be read is added to `failures`."""
    sources = records_of(wanted.files, wanted.choice.layout)
    suite = (read_pairs if wanted.pairs else read_components)(sources.files, wanted.choice)
    failures += [*sources.failures, *suite.failures]
    notes += [*sources.notes, *suite.notes]
    for record in suite.records:
        notes += [f"{record.source}: {record.component}: {text}" for text in record.warnings]
    return suite_motions(suite.motions)


def _levels(campaign: CampaignFile, motions: tuple[SuiteMotion, ...]) -> Levels:
    wanted = campaign.intensity
    match wanted:
        case Scales():
            return wanted
        case MeasureLevels():
            return IntensityLevels(wanted, motions)
        case FactorsFile():
            return read_factors(wanted.file, motions)


def read_factors(file: str, motions: Sequence[SuiteMotion]) -> GivenFactors:
    """Factors from a CSV file with the columns record, component (empty for all components) and factor.

    Raises
    ------
    ModelError
        It cannot be read, or has no factor for a motion.
    """
    needs = f"factors are a CSV file with the columns {', '.join(_FACTOR_COLUMNS)}; `tdint scale -o` writes such a file"
    table = read_table(file, needs, columns=_FACTOR_COLUMNS)
    table.need(*_FACTOR_COLUMNS)
    names = zip(table.texts("record"), table.texts("component"), strict=True)
    known: dict[tuple[str, str], dict[float, None]] = {}
    for name, (line, text) in zip(names, table.lines("factor"), strict=True):
        known.setdefault(name, {})[_factor(file, line, text)] = None
    return GivenFactors({place: _factors_of(motion, known, file) for place, motion in enumerate(motions)})


def _factors_of(motion: SuiteMotion, known: dict[tuple[str, str], dict[float, None]], file: str) -> tuple[float, ...]:
    whole = motion.whole
    names = dict.fromkeys([motion.name, Path(motion.name).name, whole.source])
    components = dict.fromkeys([motion.component, whole.component, ""])
    for name in names:
        for component in components:
            if (name, component) in known:
                return tuple(known[name, component])
    raise ModelError(f"{file}: no factor for {motion.name} {motion.component}")


def _factor(file: str, line: int, text: str) -> float:
    factor = number(text)
    if math.isnan(factor) or factor == 0.0:
        raise ModelError(f"{file}:{line}: factor: {no_number(text, 'a number that is not zero')}")
    return factor
