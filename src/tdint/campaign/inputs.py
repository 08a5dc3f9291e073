"""What a campaign file names, read: models, an inventory, records or a grid, factors; each by a reader of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tdint.campaign.definition import (
    AnalysisWishes,
    CampaignFile,
    FactorsFile,
    FieldFile,
    InventoryFile,
    ModelFiles,
    RecordFiles,
    SequenceFile,
)
from tdint.campaign.fragility.type_states import ClassDamage, read_class_damage
from tdint.campaign.grid_files import read_field, read_grid
from tdint.campaign.motions import (
    Assignment,
    FactorTable,
    FieldDraws,
    FieldMotions,
    FoundMotions,
    GridDraws,
    GridFile,
    GridMotions,
)
from tdint.csv_table import no_number, number, read_table
from tdint.errors import ModelError, ModelFault, RecordError, TdintError, UsageError
from tdint.ground_motion.joining import JoinedRecord
from tdint.ground_motion.reading.suites import SuiteMotion, read_components, read_suite, suite_motions
from tdint.ground_motion.record import Record
from tdint.model.config.model_file import load_model
from tdint.model.definition import Model
from tdint.model.inventory.capacity import read_classes
from tdint.model.inventory.table import InventoryRow, read_inventory
from tdint.model.keys.fields import resolve

_SHOCK_COLUMNS = ("sequence", "record", "component", "factor")
_FACTOR_COLUMNS = ("record", "component", "factor")


@dataclass(frozen=True)
class Inputs:
    """What the files that a campaign names hold.

    Attributes
    ----------
    models : tuple of Model
        Of model files, with what the campaign says of all buildings.
    rows : tuple of InventoryRow
        Of an inventory.
    motions : FoundMotions
        The ground motions.
    assignment : Assignment or None
        Which of them each building gets; None: all.
    factors : FactorTable or None
        The factors on them, if a file has them.
    damage : ClassDamage
        Damage states and loss ratios by class, if files have them.
    faults : tuple of ModelError
        Rows of an inventory that could not be used; the others are taken.
    """

    models: tuple[Model, ...] = ()
    rows: tuple[InventoryRow, ...] = ()
    motions: FoundMotions = field(default_factory=FoundMotions)
    assignment: Assignment | None = None
    factors: FactorTable | None = None
    damage: ClassDamage = field(default_factory=ClassDamage)
    faults: tuple[ModelError, ...] = ()


def read_inputs(campaign: CampaignFile) -> Inputs:
    """Read all that a campaign file names.

    Raises
    ------
    ModelError
        A model or the inventory cannot be used: all faults of all of them. The file of factors cannot be read.
    RecordError
        No record can be used.
    UsageError
        A grid without an inventory.
    """
    models: tuple[Model, ...] = ()
    rows: tuple[InventoryRow, ...] = ()
    faults: tuple[ModelError, ...] = ()
    if isinstance(campaign.buildings, ModelFiles):
        models = read_models(campaign.buildings, campaign.analysis)
        models = campaign.sweep.of(models) if campaign.sweep else models
    else:
        rows, faults = read_rows(campaign.buildings)
        rows = campaign.sweep.of_rows(rows) if campaign.sweep else rows
    if isinstance(campaign.records, GridFile):
        _check_places(campaign, rows)
        found = read_grid(campaign.records)
    elif isinstance(campaign.records, FieldFile):
        found = read_field(campaign.records)
    elif isinstance(campaign.records, SequenceFile):
        found = read_sequences(campaign.records)
    else:
        found = read_motions(campaign.records)
    factors = read_factors(campaign.intensity) if isinstance(campaign.intensity, FactorsFile) else None
    return Inputs(
        models,
        rows,
        found,
        _assignment(campaign, found.places, rows, len(models)),
        factors,
        read_class_damage(campaign.damage),
        faults,
    )


def read_models(wanted: ModelFiles, analysis: AnalysisWishes) -> tuple[Model, ...]:
    """The models of files, with what a campaign says of all buildings.

    Raises
    ------
    ModelError
        Some cannot be used: all faults of all of them.
    """
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
    return tuple(models)


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


def read_rows(wanted: InventoryFile) -> tuple[tuple[InventoryRow, ...], tuple[ModelError, ...]]:
    """The buildings of an inventory, and what is wrong with those that are left out.

    Raises
    ------
    ModelError
        It cannot be read, or no row can be used.
    """
    classes = read_classes(wanted.classes) if wanted.classes else None
    rows, faults = read_inventory(
        wanted.file, wanted.length, mass_only=wanted.mass_only, classes=classes, as_published=wanted.as_published
    )
    if not rows:
        raise ModelError(faults or f"{wanted.file}: has no building")
    return tuple(rows), (ModelError(faults),) if faults else ()


def _check_places(campaign: CampaignFile, rows: tuple[InventoryRow, ...]) -> None:
    """Raise UsageError without an inventory, and ModelError for buildings without a place."""
    if not isinstance(campaign.buildings, InventoryFile):
        raise UsageError(f"{campaign.source}: motions at places need an inventory with Latitude and Longitude")
    lost = [row.id for row in rows if row.latitude is None or row.longitude is None]
    if lost:
        file, missing = campaign.buildings.file, "is missing; motions at places need that of each building"
        columns = (
            _faults(file, name, lost, lambda text: "" if text else missing) for name in ("Latitude", "Longitude")
        )
        raise ModelError(sorted((one for faults in columns for one in faults), key=lambda one: (one.line, one.column)))


def _assignment(
    campaign: CampaignFile, found: GridMotions | FieldMotions | None, rows: tuple[InventoryRow, ...], models: int
) -> Assignment | None:
    """The motions of each building: draws near it, or the events of the nearest site, of the one that it names, or,
    without sites, all; None for all motions.

    Raises
    ------
    UsageError
        There are sites, and no inventory with places or sites.
    ModelError
        Buildings have no place or no site, or a site that no event is at.
    """
    wanted = campaign.records
    if found is None or not isinstance(wanted, GridFile | FieldFile):
        return None
    if isinstance(found, GridMotions):
        assert isinstance(wanted, GridFile)
        return GridDraws(rows, found, wanted)
    if found.sites == ("",):
        return FieldDraws(found, np.zeros(len(rows) or models, dtype=np.int64))
    if found.places:
        _check_places(campaign, rows)
        return FieldDraws(found, found.nearest(rows, wanted.distance))
    if not rows or "site" not in [name.lower() for name in rows[0].columns]:
        raise UsageError(
            f"{campaign.source}: events at sites need an inventory with a column `site`, or `sites` of the records, a "
            "file of their places"
        )
    numbers = {site: number for number, site in enumerate(found.sites)}
    named = [row.cell("site") for row in rows]
    lost = [row.id for row, site in zip(rows, named, strict=True) if site not in numbers]
    if lost and isinstance(campaign.buildings, InventoryFile):
        known = f"is not in {wanted.file}; known: {', '.join(found.sites[:5])}{' ...' * (len(numbers) > 5)}"
        raise ModelError(_faults(campaign.buildings.file, "site", lost, lambda text: f"{text!r} {known}"))
    return FieldDraws(found, np.array([numbers[site] for site in named], dtype=np.int64))


def _faults(file: str, column: str, ids: Collection[str], message: Callable[[str], str]) -> list[ModelFault]:
    """Where some buildings of an inventory stand, and what is wrong with their cells in a column; nothing to say of a
    cell is no fault."""
    table = read_table(file, "an inventory", columns=("id", column))
    table.need(column)
    rows, wanted = zip(table.lines("id"), table.texts(column), strict=True), set(ids)
    place = table.header.index(column.lower()) + 1
    return [
        ModelFault(file, line, place, column, said)
        for (line, name), text in rows
        if name in wanted and (said := message(text))
    ]


def read_motions(wanted: RecordFiles) -> FoundMotions:
    """The records of files and folders.

    Raises
    ------
    RecordError
        None can be used: why, one line each.
    """
    suite = read_suite(wanted.files, wanted.choice, wanted.pairs)
    if not suite.motions:
        raise RecordError("\n".join(map(str, suite.failures)) or "there is no record in this campaign")
    said = [f"{record.source}: {record.component}: {text}" for record in suite.records for text in record.warnings]
    return FoundMotions(suite_motions(suite.motions), suite.failures, (*suite.notes, *said))


def read_sequences(wanted: SequenceFile) -> FoundMotions:
    """Shocks one after the other, of a CSV file with the columns sequence, record (relative to the file) and, if they
    are wanted, component and factor; shocks of one sequence stand below each other.

    Raises
    ------
    ModelError
        The file cannot be read.
    RecordError
        No sequence can be used: why, one line each.
    """
    needs = f"sequences are a CSV file with the columns {', '.join(_SHOCK_COLUMNS)}; the last two may be left out"
    table = read_table(wanted.file, needs, columns=_SHOCK_COLUMNS)
    table.need("sequence", "record")
    components = table.texts("component") if table.has("component") else [""] * len(table.rows)
    factors = table.lines("factor") if table.has("factor") else [(line, "1") for line, _ in table.rows]
    rows = zip(
        table.texts("sequence", empty=False), table.texts("record", empty=False), components, factors, strict=True
    )
    shocks: dict[str, list[_Shock]] = {}
    for name, record, component, (line, text) in rows:
        file = resolve(record, Path(wanted.file).parent)
        shocks.setdefault(name, []).append(_Shock(file, component, _factor(wanted.file, line, text or "1")))
    motions, failures, notes = list[SuiteMotion](), list[TdintError](), dict[str, None]()
    for name, of_one in shocks.items():
        try:
            motions += _sequence(name, of_one, wanted, notes)
        except (RecordError, UsageError) as error:
            failures.append(RecordError(f"sequence {name}: {error}"))
    if not motions:
        raise RecordError("\n".join(map(str, failures)))
    return FoundMotions(tuple(motions), tuple(failures), tuple(notes))


class _Shock(NamedTuple):
    """A row of a file of sequences."""

    file: str
    component: str
    factor: float


def _sequence(
    name: str, shocks: Sequence[_Shock], wanted: SequenceFile, notes: dict[str, None]
) -> Iterator[SuiteMotion]:
    """A motion for each component that all shocks of a sequence have."""
    found: list[list[Record]] = []
    for shock in shocks:
        choice = replace(wanted.choice, component=shock.component or wanted.choice.component)
        suite = read_components([shock.file], choice)
        for error in suite.failures:
            raise error
        notes |= dict.fromkeys(
            (*suite.notes, *(f"{one.source}: {text}" for one in suite.records for text in one.warnings))
        )
        found.append([record.scaled(shock.factor) for record in suite.records])
    names = [[record.component for record in records] for records in found]
    if any(one != names[0] for one in names) and any(len(one) > 1 for one in names):
        raise RecordError("its records have different components; name one of each in the column component")
    for records in zip(*found, strict=True):
        whole = JoinedRecord.of(records, wanted.rest)
        yield SuiteMotion(whole, name, whole.component, whole.shocks[0])


def read_factors(wanted: FactorsFile) -> FactorTable:
    """Factors from a CSV file with the columns record, component (empty for all components) and factor.

    Raises
    ------
    ModelError
        It cannot be read.
    """
    file = wanted.file
    needs = f"factors are a CSV file with the columns {', '.join(_FACTOR_COLUMNS)}; `tdint scale -o` writes such a file"
    table = read_table(file, needs, columns=_FACTOR_COLUMNS)
    table.need(*_FACTOR_COLUMNS)
    names = zip(table.texts("record"), table.texts("component"), strict=True)
    known: dict[tuple[str, str], dict[float, None]] = {}
    for name, (line, text) in zip(names, table.lines("factor"), strict=True):
        known.setdefault(name, {})[_factor(file, line, text)] = None
    return FactorTable(file, {name: tuple(factors) for name, factors in known.items()})


def _factor(file: str, line: int, text: str) -> float:
    factor = number(text)
    if math.isnan(factor) or factor == 0.0:
        raise ModelError(f"{file}:{line}: factor: {no_number(text, 'a number that is not zero')}")
    return factor
