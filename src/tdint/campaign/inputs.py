"""What a campaign file names, read: models, an inventory, records or a grid, factors; each by a
reader of its own."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tdint.campaign.definition import (
    AnalysisWishes,
    CampaignFile,
    FactorsFile,
    FieldFile,
    InventoryFile,
    ModelFiles,
    ParameterSweep,
    RecordFiles,
    SequenceFile,
)
from tdint.campaign.fragility.type_states import ClassDamage, read_class_damage
from tdint.campaign.motions import (
    Assignment,
    FactorTable,
    FieldDraws,
    FieldMotions,
    FoundMotions,
    GridDraws,
    GridFile,
    GridMotions,
    meters,
    nearest,
)
from tdint.campaign.sites import read_field, read_grid
from tdint.csv_table import no_number, number, read_table
from tdint.errors import ModelError, ModelFault, RecordError, TdintError, UsageError
from tdint.files import MOST_BYTES, note_input, read_at_most
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.horizontals import PairNames
from tdint.ground_motion.reading.suites import (
    Suite,
    SuiteMotion,
    read_components,
    read_suite,
    suite_motions,
)
from tdint.ground_motion.record import JoinedRecord, Record
from tdint.model.capacity import read_classes
from tdint.model.config.model_file import load_model
from tdint.model.damage_states import COST, NUMBER
from tdint.model.definition import Model
from tdint.model.inventory import InventoryRows, read_inventory
from tdint.model.keys.fields import resolve
from tdint.written_numbers import first_few

_SHOCK_COLUMNS = ("sequence", "record", "component", "factor", "units")
_MOST_NAMES = 10  # that a message names

_FACTOR_COLUMNS = ("record", "component", "factor")


@dataclass(frozen=True)
class Inputs:
    """What the files that a campaign names hold.

    Attributes
    ----------
    models : tuple of Model
        Of model files, with what the campaign says of all buildings.
    rows : InventoryRows or None
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
    far : tuple of ModelFault
        Rows of an inventory that are farther from any site than is allowed, and left out.
    """

    models: tuple[Model, ...] = ()
    rows: InventoryRows | None = None
    motions: FoundMotions = field(default_factory=FoundMotions)
    assignment: Assignment | None = None
    factors: FactorTable | None = None
    damage: ClassDamage = field(default_factory=ClassDamage)
    faults: tuple[ModelError, ...] = ()
    far: tuple[ModelFault, ...] = ()


def read_inputs(campaign: CampaignFile) -> Inputs:
    """Read all that a campaign file names.

    Raises
    ------
    ModelError
        A model or the inventory cannot be used: all faults of all of them. The file of factors
        cannot be read.
    RecordError
        No record can be used.
    UsageError
        A grid without an inventory.
    """
    models: tuple[Model, ...] = ()
    rows: InventoryRows | None = None
    faults: tuple[ModelError, ...] = ()
    sweep = campaign.sweep or ParameterSweep()
    # Buildings first: faults of model files are told before records are read.
    if isinstance(campaign.buildings, ModelFiles):
        models = read_models(campaign.buildings, campaign.analysis)
        with sweep.told_at_its_place():
            models = sweep.of(models) if campaign.sweep else models
    else:
        rows, faults = read_rows(campaign.buildings)
    factors = (
        read_factors(campaign.intensity) if isinstance(campaign.intensity, FactorsFile) else None
    )
    if factors and isinstance(campaign.records, RecordFiles) and not campaign.records.files:
        factors, motions = read_listed_motions(factors, campaign.records)
    else:
        motions = _READERS[type(campaign.records)](campaign.records)
    # What is too far from any site is left out before a sweep multiplies it.
    far: tuple[ModelFault, ...] = ()
    if (
        isinstance(campaign.records, GridFile | FieldFile)
        and motions.places is not None
        and motions.places.places
    ):
        rows, lost, far = _placed(campaign, campaign.records, motions.places, rows)
        faults = (*faults, *((ModelError(lost),) if lost else ()))
    # Costs go into no run, but a wrong one would come up only after all of them.
    if rows and campaign.damage:
        _check_costs(rows)
    with sweep.told_at_its_place():
        rows = sweep.of_rows(rows) if rows and campaign.sweep else rows
    assignment, damage = (
        _assignment(campaign, motions.places, rows, len(models)),
        read_class_damage(campaign.damage),
    )
    return Inputs(models, rows, motions, assignment, factors, damage, faults, far)


def read_models(buildings: ModelFiles, analysis: AnalysisWishes) -> tuple[Model, ...]:
    """The models of files, with what a campaign says of all buildings.

    Raises
    ------
    ModelError
        Some cannot be used: all faults of all of them.
    """
    models: list[Model] = []
    errors: list[ModelError] = []
    for file in buildings.files:
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
            raise ModelError(
                f"{model.source}: p_delta of the campaign needs the heights of all stories"
            )
        model = replace(model, p_delta=analysis.p_delta)
    return model


def read_rows(buildings: InventoryFile) -> tuple[InventoryRows, tuple[ModelError, ...]]:
    """The buildings of an inventory, and what is wrong with those that are left out.

    Raises
    ------
    ModelError
        It cannot be read, or no row can be used.
    """
    classes = read_classes(buildings.classes) if buildings.classes else None
    rows, faults = read_inventory(
        buildings.file,
        buildings.length,
        mass_only=buildings.mass_only,
        classes=classes,
        as_published=buildings.as_published,
    )
    if not rows:
        raise ModelError(faults or f"{buildings.file}: has no building")
    return rows, (ModelError(faults),) if faults else ()


def _check_costs(rows: InventoryRows) -> None:
    """Raise ModelError for costs and numbers of buildings that are none: all of them, before any
    run."""
    faults: list[ModelFault] = []
    for name in filter(rows.of.table.has, (COST, NUMBER)):
        faults += rows.faults(
            name,
            lambda _, text: (
                no_number(text, "zero or a positive number")
                if text and not number(text) >= 0.0
                else ""
            ),
        )
    if faults:
        raise ModelError(sorted(faults, key=lambda fault: (fault.line, fault.column)))


def _placed(
    campaign: CampaignFile,
    records: GridFile | FieldFile,
    motions: GridMotions | FieldMotions,
    rows: InventoryRows | None,
) -> tuple[InventoryRows, list[ModelFault], tuple[ModelFault, ...]]:
    """The buildings that have a place near enough to a site, and those left out: without a place,
    and too far away. Of fields the nearest site and its distance go before the other columns that
    are carried along.

    Raises
    ------
    UsageError
        There is no inventory.
    ModelError
        None is left.
    """
    if rows is None:
        raise UsageError(
            f"{campaign.source}: motions at places need an inventory with Latitude and Longitude"
        )
    # A row without a place is a fault of the file; one that is too far away is not.
    lost, nowhere = list[ModelFault](), np.isnan(rows.places[:, 0] + rows.places[:, 1])
    if nowhere.any():
        missing = "is missing; motions at places need that of each building"
        for name in ("Latitude", "Longitude"):
            lost += rows.only(nowhere).faults(name, lambda _, text: "" if text else missing)
        lost.sort(key=lambda fault: (fault.line, fault.column))
    placed = rows.only(~nowhere)
    if not placed:
        raise ModelError(lost)
    # What is nearest may be told in degrees; how far away it is, is always in m.
    sites = nearest(placed.places, motions.places, records.distance)
    away = meters(placed.places, np.array(motions.places)[sites])
    too_far = away > records.max_distance
    kept, beyond = placed.only(~too_far), 1e-3 * away[too_far]
    if isinstance(motions, FieldMotions):
        kept = replace(kept, near=(motions.sites, sites[~too_far], away[~too_far]))
    limit = f"max_distance is {1e-3 * records.max_distance:g} km"
    far = placed.only(too_far).faults(
        "Latitude", lambda at, _: f"{beyond[at]:.4g} km from the nearest site; {limit}"
    )
    if not kept:
        raise ModelError([*lost, *far])
    return kept, lost, tuple(far)


def _assignment(
    campaign: CampaignFile,
    motions: GridMotions | FieldMotions | None,
    rows: InventoryRows | None,
    models: int,
) -> Assignment | None:
    """The motions of each building: draws near it, or the events of the nearest site, of the one
    that it names, or, without sites, all; None for all motions.

    Raises
    ------
    UsageError
        There are sites, and no inventory with places or sites.
    ModelError
        Buildings have no place or no site, or a site that no event is at.
    """
    records = campaign.records
    if motions is None or not isinstance(records, GridFile | FieldFile):
        return None
    if isinstance(motions, GridMotions):
        assert isinstance(records, GridFile) and rows is not None
        return GridDraws(rows, motions, records)
    # Events without sites act on all buildings alike.
    if motions.sites == ("",):
        return FieldDraws(motions, np.zeros(len(rows) if rows else models, dtype=np.int64))
    if rows and rows.near is not None:
        return FieldDraws(motions, np.repeat(rows.near[1], len(rows.changes)))
    if not rows or not rows.of.table.has("site"):
        raise UsageError(
            f"{campaign.source}: events at sites need an inventory with a column `site`, or "
            "`sites` of the records, a file of their places"
        )
    # Sites without places are named by the buildings themselves.
    numbers = {site: number for number, site in enumerate(motions.sites)}
    reason = (
        f"is not in {records.file}; known: "
        f"{', '.join(motions.sites[:5])}{' ...' * (len(numbers) > 5)}"
    )
    if lost := rows.faults("site", lambda _, text: "" if text in numbers else f"{text!r} {reason}"):
        raise ModelError(lost)
    return FieldDraws(
        motions, np.repeat([numbers[site] for site in rows.texts("site")], len(rows.changes))
    )


def read_motions(records: RecordFiles) -> FoundMotions:
    """The records of files and folders.

    Raises
    ------
    RecordError
        None can be used: why, one line each.
    """
    suite = read_suite(records.files, records.choice, records.pairs)
    if not suite.motions:
        raise RecordError(
            "\n".join(map(str, suite.failures)) or "there is no record in this campaign"
        )
    return FoundMotions(suite_motions(suite.motions), suite.failures, suite.notes)


def read_sequences(sequences: SequenceFile) -> FoundMotions:
    """Shocks one after the other, of a CSV file with the columns sequence, record (relative to the
    file) and, if they are wanted, component, factor and units (of the samples, empty where the file
    says them); shocks of one sequence stand below each other.

    Raises
    ------
    ModelError
        The file cannot be read.
    RecordError
        No sequence can be used: why, one line each.
    """
    needs = (
        f"sequences are a CSV file with the columns {', '.join(_SHOCK_COLUMNS)}; the last three "
        "may be left out"
    )
    table = read_table(sequences.file, needs, columns=_SHOCK_COLUMNS)
    table.need("sequence", "record")
    # Columns that are left out say nothing: all components, the factor 1, the file's own units.
    told = [
        table.texts(name) if table.has(name) else [""] * len(table.rows)
        for name in ("component", "factor", "units")
    ]
    names, records = table.texts("sequence", empty=False), table.texts("record", empty=False)
    shocks: dict[str, list[_Shock]] = {}
    for name, record, component, text, unit, (line, _) in zip(
        names, records, *told, table.rows, strict=True
    ):
        file = resolve(record, Path(sequences.file).parent)
        factor = _factor(sequences.file, line, text or "1")
        shocks.setdefault(name, []).append(_Shock(file, component, factor, unit.strip()))
    motions, failures, notes = list[SuiteMotion](), list[TdintError](), dict[str, None]()
    # A sequence that cannot be used is told; the others are taken.
    for name, of_one in shocks.items():
        try:
            motions += _sequence(name, of_one, sequences, notes)
        except (RecordError, UsageError) as error:
            failures.append(RecordError(f"sequence {name}: {error}"))
    if not motions:
        raise RecordError("\n".join(map(str, failures)))
    return FoundMotions(tuple(motions), tuple(failures), tuple(notes))


_READERS: dict[type, Callable[[Any], FoundMotions]]
_READERS = {
    GridFile: read_grid,
    FieldFile: read_field,
    SequenceFile: read_sequences,
    RecordFiles: read_motions,
}


class _Shock(NamedTuple):
    """A row of a file of sequences."""

    file: str
    component: str
    factor: float
    units: str


def _sequence(
    name: str, shocks: Sequence[_Shock], sequences: SequenceFile, notes: dict[str, None]
) -> Iterator[SuiteMotion]:
    """A motion for each component that all shocks of a sequence have."""
    of_shocks: list[list[Record]] = []
    common = sequences.choice
    for shock in shocks:
        # What a row says of its file counts before what is said of all; an inventory is for the
        # other rows.
        units = {"*": shock.units} if shock.units else common.units
        choice = replace(common, component=shock.component or common.component, units=units)
        suite = read_components([shock.file], choice)
        for error in suite.failures:
            raise error
        notes |= dict.fromkeys(suite.notes)
        of_shocks.append([record.scaled(shock.factor) for record in suite.records])
    # Components go together by their names; a single one goes with whatever the others have.
    names = [[record.component for record in records] for records in of_shocks]
    if any(part != names[0] for part in names) and any(len(part) > 1 for part in names):
        raise RecordError(
            "its records have different components; name one of each in the column component"
        )
    for records in zip(*of_shocks, strict=True):
        whole = JoinedRecord.of(records, sequences.rest)
        yield SuiteMotion(whole, name, whole.component, whole.shocks[0])


def read_factors(factors_file: FactorsFile) -> FactorTable:
    """Factors from a CSV file with the columns record, component (empty for all components) and
    factor.

    Raises
    ------
    ModelError
        It cannot be read.
    """
    file = factors_file.file
    needs = (
        f"factors are a CSV file with the columns {', '.join(_FACTOR_COLUMNS)}; `tdint scale -o` "
        "writes such a file"
    )
    table = read_table(file, needs, columns=_FACTOR_COLUMNS)
    table.need(*_FACTOR_COLUMNS)
    names = zip(table.texts("record"), table.texts("component"), strict=True)
    # A motion may have several factors; one that is there twice counts once.
    by_motion: dict[tuple[str, str], dict[float, None]] = {}
    for name, (line, text) in zip(names, table.lines("factor"), strict=True):
        by_motion.setdefault(name, {})[_factor(file, line, text)] = None

    # What `tdint scale` wrote beside the table, if it is of this one; a table needs no such file.
    beside = Path(file.removesuffix(".gz")).with_suffix(".json")
    scaled = {}
    with suppress(OSError, ValueError, KeyError, TypeError, ModelError):
        told = json.loads(content := read_at_most(beside, MOST_BYTES, ModelError))
        digest = sha256(read_at_most(file, MOST_BYTES, ModelError)).hexdigest()
        if told["schema"]["name"] == "tdint scale" and told["factors_sha256"] == digest:
            scaled = told
    if scaled:
        note_input(beside, content)
    return FactorTable(file, {name: tuple(numbers) for name, numbers in by_motion.items()}, scaled)


def read_listed_motions(
    table: FactorTable, records: RecordFiles
) -> tuple[FactorTable, FoundMotions]:
    """Read the records that a table of factors lists.

    Returns
    -------
    table : FactorTable
        The table with the files as they were found.
    motions : FoundMotions
        The motions that have a factor.

    Raises
    ------
    ModelError
        As of `read_listed`.
    RecordError
        No record can be used: why, one line each.
    """
    table, suite = read_listed(table, records.choice, records.pairs)
    if not suite.motions:
        raise RecordError("\n".join(map(str, suite.failures)))
    return table, FoundMotions(suite_motions(suite.motions), suite.failures, suite.notes)


def read_listed(
    table: FactorTable, choice: RecordChoice, pairs: PairNames | None
) -> tuple[FactorTable, Suite]:
    """Read the ground motions that a table of factors lists, and no other component of its files.

    Parameters
    ----------
    table : FactorTable
        The table. A file in it is relative to the working directory or, if it is not found there,
        to the directory of the table.
    choice : RecordChoice
        How the files are read.
    pairs : PairNames or None
        How the files of pairs are named; None for single components.

    Returns
    -------
    table : FactorTable
        The table with the files as they were found.
    suite : Suite
        The motions that the table lists, and files that could not be read.

    Raises
    ------
    ModelError
        Files of the table are not found; a row has no component in its file, or more than one.
    """
    table = _located(table)
    files = tuple(dict.fromkeys(file for file, _ in table.by_name))
    suite = read_suite(files, choice, pairs)

    # Each row belongs to one component; an empty component belongs to all components of the file.
    rows: dict[tuple[str, str], list[SuiteMotion]] = {row: [] for row in table.by_name}
    for motion in suite_motions(suite.motions):
        for component in dict.fromkeys((motion.component, motion.record.component, "")):
            if (motion.name, component) in rows:
                rows[motion.name, component].append(motion)
                break
    failed = " ".join(map(str, suite.failures))
    for (file, component), motions in rows.items():
        if component and len(motions) != 1 and file not in failed:
            what = (
                f"has {len(motions)} components {component}" if motions else f"has no {component}"
            )
            raise ModelError(
                f"{table.source}: {file} {what} among the components that can be used; name one "
                "component by its full id in the table"
            )
    listed = {id(motion.whole) for motions in rows.values() for motion in motions}
    kept = tuple(motion for motion in suite.motions if id(motion) in listed)
    return table, replace(suite, motions=kept)


def _located(table: FactorTable) -> FactorTable:
    """Return a table of factors with its files as they are found.

    Raises
    ------
    ModelError
        Files are not found.
    """
    beside = Path(table.source).parent
    found: dict[str, str] = {}
    for file in dict.fromkeys(file for file, _ in table.by_name):
        candidates = (Path(file), beside / file)
        place = next((path for path in candidates if file and path.is_file()), None)
        if place is not None:
            found[file] = file if place == candidates[0] else str(place)
    missing = [file for file, _ in table.by_name if file not in found]
    if missing:
        named = first_few(list(dict.fromkeys(file or "(empty)" for file in missing)), _MOST_NAMES)
        raise ModelError(
            f"{table.source}: records not found: {named}; a record is a file relative to the "
            "working directory or to the directory of the table"
        )
    by_name = {
        (found[file], component): values for (file, component), values in table.by_name.items()
    }
    return replace(table, by_name=by_name)


def _factor(file: str, line: int, text: str) -> float:
    factor = number(text)
    if math.isnan(factor) or factor == 0.0:
        raise ModelError(f"{file}:{line}: factor: {no_number(text, 'a number that is not zero')}")
    return factor
