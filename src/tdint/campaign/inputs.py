"""Read the files of a campaign: models, an inventory, records or a grid, and factors."""

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
from tdint.csv_table import number, number_error, read_table
from tdint.errors import ModelError, ModelFault, RecordError, TdintError, UsageError
from tdint.files import MOST_BYTES, read_at_most, record_digest
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
from tdint.number_parsing import abbreviate

_SHOCK_COLUMNS = ("sequence", "record", "component", "factor", "units")
_MOST_NAMES = 10  # names listed in a message

_FACTOR_COLUMNS = ("record", "component", "factor")


@dataclass(frozen=True)
class Inputs:
    """Contents of the files that a campaign names.

    Attributes
    ----------
    models : tuple of Model
        Models of the model files, with the campaign's settings for all buildings.
    rows : InventoryRows or None
        Buildings of the inventory.
    motions : FoundMotions
        Ground motions.
    assignment : Assignment or None
        Ground motions of each building; None: all motions for all buildings.
    factors : FactorTable or None
        Scale factors of the motions, if specified by a file.
    damage : ClassDamage
        Damage states and loss ratios by building class, if specified by files.
    faults : tuple of ModelError
        Errors of the rows of the inventory that were skipped.
    too_far_from_sites : tuple of ModelFault
        Rows of the inventory that were skipped because they are too far from all sites.
    """

    models: tuple[Model, ...] = ()
    rows: InventoryRows | None = None
    motions: FoundMotions = field(default_factory=FoundMotions)
    assignment: Assignment | None = None
    factors: FactorTable | None = None
    damage: ClassDamage = field(default_factory=ClassDamage)
    faults: tuple[ModelError, ...] = ()
    too_far_from_sites: tuple[ModelFault, ...] = ()


def read_inputs(campaign: CampaignFile) -> Inputs:
    """Read all files that a campaign names.

    Parameters
    ----------
    campaign : CampaignFile
        Definition of the campaign.

    Raises
    ------
    ModelError
        Models or the inventory are invalid; the error lists all entries. The file of factors cannot
        be read.
    RecordError
        No record can be used.
    UsageError
        A grid is used without an inventory.
    """
    models: tuple[Model, ...] = ()
    rows: InventoryRows | None = None
    faults: tuple[ModelError, ...] = ()
    sweep = campaign.sweep or ParameterSweep()
    # Read the buildings first, so that errors of model files are reported before records are read.
    if isinstance(campaign.buildings, ModelFiles):
        models = read_models(campaign.buildings, campaign.analysis)
        with sweep.reported_at_key():
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
    # Omit buildings that are too far from all sites before a sweep multiplies them.
    far: tuple[ModelFault, ...] = ()
    if (
        isinstance(campaign.records, GridFile | FieldFile)
        and motions.places is not None
        and motions.places.places
    ):
        rows, unlocated, far = _select_located(campaign, campaign.records, motions.places, rows)
        faults = (*faults, *((ModelError(unlocated),) if unlocated else ()))
    # Costs are used only after all runs. Check them now, so that an error does not waste the runs.
    if rows and campaign.damage:
        _check_costs(rows)
    with sweep.reported_at_key():
        rows = sweep.of_rows(rows) if rows and campaign.sweep else rows
    assignment, damage = (
        _assignment(campaign, motions.places, rows, len(models)),
        read_class_damage(campaign.damage),
    )
    return Inputs(models, rows, motions, assignment, factors, damage, faults, far)


def read_models(buildings: ModelFiles, analysis: AnalysisWishes) -> tuple[Model, ...]:
    """Read model files and apply the campaign's settings for all buildings.

    Parameters
    ----------
    buildings : ModelFiles
        Paths of the files.
    analysis : AnalysisWishes
        Analysis settings of the campaign.

    Raises
    ------
    ModelError
        Files are invalid; the error lists all errors of all files.
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
    """Return a model with the campaign's settings for all buildings.

    Parameters
    ----------
    model : Model
        The model.
    analysis : AnalysisWishes
        Analysis settings of the campaign.

    Raises
    ------
    ModelError
        P-delta is requested for a model without story heights.
    """
    if analysis.collapse_drift is not None:
        model = replace(model, collapse_drift=analysis.collapse_drift)
    if analysis.p_delta is not None:
        if analysis.p_delta and any(story.height is None for story in model.stories):
            raise ModelError(
                f"{model.source}: p_delta of the campaign requires the heights of all stories"
            )
        model = replace(model, p_delta=analysis.p_delta)
    return model


def read_rows(buildings: InventoryFile) -> tuple[InventoryRows, tuple[ModelError, ...]]:
    """Read the buildings of an inventory.

    Returns
    -------
    rows : InventoryRows
        Valid rows.
    faults : tuple of ModelError
        Errors of the skipped rows.

    Raises
    ------
    ModelError
        The inventory cannot be read, or no row is valid.
    """
    classes = read_classes(buildings.classes) if buildings.classes else None
    rows, faults = read_inventory(
        buildings.file,
        buildings.length,
        mass_only=buildings.mass_only,
        classes=classes,
        as_published=buildings.as_published,
        mapping=buildings.mapping,
    )
    if not rows:
        raise ModelError(faults or f"{buildings.file}: the file contains no buildings")
    return rows, (ModelError(faults),) if faults else ()


def _check_costs(rows: InventoryRows) -> None:
    """Raise ModelError for all invalid costs and numbers of buildings, before any run."""
    faults: list[ModelFault] = []
    for name in filter(rows.table.table.has, (COST, NUMBER)):
        faults += rows.faults(
            name,
            lambda _, text: (
                number_error(text, "zero or a positive number")
                if text and not number(text) >= 0.0
                else ""
            ),
        )
    if faults:
        raise ModelError(sorted(faults, key=lambda fault: (fault.line, fault.column)))


def _select_located(
    campaign: CampaignFile,
    records: GridFile | FieldFile,
    motions: GridMotions | FieldMotions,
    rows: InventoryRows | None,
) -> tuple[InventoryRows, list[ModelFault], tuple[ModelFault, ...]]:
    """Select the buildings that have a location close enough to a site. For fields, the nearest
    site and its distance are added before the columns of the inventory that are copied to tables.

    Parameters
    ----------
    campaign : CampaignFile
        Definition of the campaign.
    records : GridFile or FieldFile
        Grid or fields in the campaign file.
    motions : GridMotions or FieldMotions
        Motions and locations of the sites.
    rows : InventoryRows or None
        Buildings.

    Returns
    -------
    kept : InventoryRows
        Selected buildings.
    lost : list of ModelFault
        Errors of the buildings without a location.
    far : tuple of ModelFault
        Buildings that are too far from all sites.

    Raises
    ------
    UsageError
        The campaign has no inventory.
    ModelError
        No building is selected.
    """
    if rows is None:
        raise UsageError(
            f"{campaign.source}: motions at sites require an inventory with Latitude and Longitude"
        )
    # A row without a location is an error of the file; a row that is too far away is not.
    faults: list[ModelFault] = []
    is_unlocated = np.isnan(rows.places[:, 0] + rows.places[:, 1])
    if is_unlocated.any():
        missing = "is missing; motions at sites require the location of each building"
        for name in ("Latitude", "Longitude"):
            faults += rows.only(is_unlocated).faults(name, lambda _, text: "" if text else missing)
        faults.sort(key=lambda fault: (fault.line, fault.column))
    located = rows.only(~is_unlocated)
    if not located:
        raise ModelError(faults)
    # The nearest site may be determined in degrees; its distance is always in m.
    sites = nearest(located.places, motions.places, records.distance)
    distance = meters(located.places, np.array(motions.places)[sites])
    too_far = distance > records.max_distance
    kept, far_km = located.only(~too_far), 1e-3 * distance[too_far]
    if isinstance(motions, FieldMotions):
        kept = replace(kept, near=(motions.sites, sites[~too_far], distance[~too_far]))
    limit = f"max_distance is {1e-3 * records.max_distance:g} km"
    far = located.only(too_far).faults(
        "Latitude", lambda row, _: f"{far_km[row]:.4g} km from the nearest site; {limit}"
    )
    if not kept:
        raise ModelError([*faults, *far])
    return kept, faults, tuple(far)


def _assignment(
    campaign: CampaignFile,
    motions: GridMotions | FieldMotions | None,
    rows: InventoryRows | None,
    models: int,
) -> Assignment | None:
    """Return the motions of each building, or None if all buildings use all motions.

    The motions are samples of the nearest grid points, or the events of the nearest site, of the
    site that the inventory names or, without sites, all events.

    Parameters
    ----------
    campaign : CampaignFile
        Definition of the campaign.
    motions : GridMotions, FieldMotions or None
        Motions of a grid or of fields.
    rows : InventoryRows or None
        Buildings of the inventory.
    models : int
        Number of models.

    Raises
    ------
    UsageError
        The motions have sites, and the campaign has no inventory with locations or sites.
    ModelError
        Buildings have no location or site, or a site without events.
    """
    records = campaign.records
    if motions is None or not isinstance(records, GridFile | FieldFile):
        return None
    if isinstance(motions, GridMotions):
        assert isinstance(records, GridFile) and rows is not None
        return GridDraws(rows, motions, records)
    # Without sites, all buildings have the same ground motion in an event.
    if motions.sites == ("",):
        return FieldDraws(motions, np.zeros(len(rows) if rows else models, dtype=np.int64))
    if rows and rows.near is not None:
        return FieldDraws(motions, np.repeat(rows.near[1], len(rows.changes)))
    if not rows or not rows.table.table.has("site"):
        raise UsageError(
            f"{campaign.source}: events at sites require an inventory with a column `site`, or the "
            "key `sites` of the records, a file with the locations of the sites"
        )
    # The locations of the sites are not specified, so that the inventory must name the site of each
    # building.
    numbers = {site: number for number, site in enumerate(motions.sites)}
    reason = (
        f"is not a site in {records.file}; its sites are "
        f"{', '.join(motions.sites[:5])}{' ...' * (len(numbers) > 5)}"
    )
    faults = rows.faults("site", lambda _, text: "" if text in numbers else f"{text!r} {reason}")
    if faults:
        raise ModelError(faults)
    return FieldDraws(
        motions, np.repeat([numbers[site] for site in rows.texts("site")], len(rows.changes))
    )


def read_motions(records: RecordFiles) -> FoundMotions:
    """Read the records of files and directories.

    Parameters
    ----------
    records : RecordFiles
        Files, and the selection of components.

    Raises
    ------
    RecordError
        No record can be used; the message has the reasons, one line each.
    """
    suite = read_suite(records.files, records.choice, records.pairs)
    if not suite.motions:
        raise RecordError("\n".join(map(str, suite.failures)) or "the campaign contains no records")
    return FoundMotions(suite_motions(suite.motions), suite.failures, suite.notes)


def read_sequences(sequences: SequenceFile) -> FoundMotions:
    """Read sequences of events from a CSV file.

    The file has the columns sequence, record (path relative to the file) and, optionally,
    component, factor and units (of the samples; empty if the record states them). The rows of a
    sequence are in chronological order.

    Parameters
    ----------
    sequences : SequenceFile
        Path of the file, and settings for all records.

    Raises
    ------
    ModelError
        The file cannot be read.
    RecordError
        No sequence can be used; the message has the reasons, one line each.
    """
    needs = (
        f"sequences are a CSV file with the columns {', '.join(_SHOCK_COLUMNS)}; the last three "
        "are optional"
    )
    table = read_table(sequences.file, needs, columns=_SHOCK_COLUMNS)
    table.need("sequence", "record")
    # Defaults of missing columns: all components, factor 1, units of the record.
    optional = [
        table.texts(name) if table.has(name) else [""] * len(table.rows)
        for name in ("component", "factor", "units")
    ]
    names, records = table.texts("sequence", empty=False), table.texts("record", empty=False)
    shocks: dict[str, list[_Shock]] = {}
    for name, record, component, text, unit, (line, _) in zip(
        names, records, *optional, table.rows, strict=True
    ):
        file = resolve(record, Path(sequences.file).parent)
        factor = _factor(sequences.file, line, text or "1")
        shocks.setdefault(name, []).append(_Shock(file, component, factor, unit.strip()))
    motions, failures, notes = list[SuiteMotion](), list[TdintError](), dict[str, None]()
    # Sequences that cannot be used are reported and skipped.
    for name, rows in shocks.items():
        try:
            motions += _sequence(name, rows, sequences, notes)
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
    """Row of a file of sequences."""

    file: str
    component: str
    factor: float
    units: str


def _sequence(
    name: str, shocks: Sequence[_Shock], sequences: SequenceFile, notes: dict[str, None]
) -> Iterator[SuiteMotion]:
    """Yield a motion for each component that all events of a sequence have.

    Parameters
    ----------
    name : str
        Name of the sequence.
    shocks : sequence of _Shock
        Rows of the sequence.
    sequences : SequenceFile
        Settings for all records.
    notes : dict
        Receives notes of the reader as keys.
    """
    by_shock: list[list[Record]] = []
    common = sequences.choice
    for shock in shocks:
        # Units of a row override the units for all rows.
        units = {"*": shock.units} if shock.units else common.units
        choice = replace(common, component=shock.component or common.component, units=units)
        suite = read_components([shock.file], choice)
        for error in suite.failures:
            raise error
        notes |= dict.fromkeys(suite.notes)
        by_shock.append([record.scaled(shock.factor) for record in suite.records])
    # Components with the same name are joined. Records with a single component are joined
    # regardless of its name.
    names = [[record.component for record in records] for records in by_shock]
    if any(part != names[0] for part in names) and any(len(part) > 1 for part in names):
        raise RecordError(
            "the records of the sequence have different components; specify one component for each "
            "record in the column component"
        )
    for records in zip(*by_shock, strict=True):
        joined = JoinedRecord.of(records, sequences.rest)
        yield SuiteMotion(joined, name, joined.component, joined.shocks[0])


def read_factors(factors_file: FactorsFile) -> FactorTable:
    """Read factors from a CSV file with the columns record, component (empty: all components) and
    factor.

    Parameters
    ----------
    factors_file : FactorsFile
        Path of the file.

    Raises
    ------
    ModelError
        The file cannot be read.
    """
    file = factors_file.file
    needs = (
        f"factors are a CSV file with the columns {', '.join(_FACTOR_COLUMNS)}; `tdint scale -o` "
        "writes such a file"
    )
    table = read_table(file, needs, columns=_FACTOR_COLUMNS)
    table.need(*_FACTOR_COLUMNS)
    names = zip(table.texts("record"), table.texts("component"), strict=True)
    # A motion may have several factors; duplicate factors are ignored.
    by_motion: dict[tuple[str, str], dict[float, None]] = {}
    for name, (line, text) in zip(names, table.lines("factor"), strict=True):
        by_motion.setdefault(name, {})[_factor(file, line, text)] = None

    # Read the settings that `tdint scale` wrote next to the table, if they belong to this table.
    # The file is optional.
    settings_file = Path(file.removesuffix(".gz")).with_suffix(".json")
    scaled = {}
    with suppress(OSError, ValueError, KeyError, TypeError, ModelError):
        settings = json.loads(content := read_at_most(settings_file, MOST_BYTES, ModelError))
        digest = sha256(read_at_most(file, MOST_BYTES, ModelError)).hexdigest()
        if settings["schema"]["name"] == "tdint scale" and settings["factors_sha256"] == digest:
            scaled = settings
    if scaled:
        record_digest(settings_file, content)
    return FactorTable(file, {name: tuple(numbers) for name, numbers in by_motion.items()}, scaled)


def read_listed_motions(
    table: FactorTable, records: RecordFiles
) -> tuple[FactorTable, FoundMotions]:
    """Read the records that a table of factors lists.

    Returns
    -------
    table : FactorTable
        Table with the paths of the files.
    motions : FoundMotions
        Motions that have a factor.

    Raises
    ------
    ModelError
        As for `read_listed`.
    RecordError
        No record can be used; the message has the reasons, one line each.
    """
    table, suite = read_listed(table, records.choice, records.pairs)
    if not suite.motions:
        raise RecordError("\n".join(map(str, suite.failures)))
    return table, FoundMotions(suite_motions(suite.motions), suite.failures, suite.notes)


def read_listed(
    table: FactorTable, choice: RecordChoice, pairs: PairNames | None
) -> tuple[FactorTable, Suite]:
    """Read the ground motions that a table of factors lists. Other components of the files are
    ignored.

    Parameters
    ----------
    table : FactorTable
        The table. A path in it is relative to the working directory or, if it is not found there,
        to the directory of the table.
    choice : RecordChoice
        Selection of components and processing of the files.
    pairs : PairNames or None
        Naming scheme of the files of pairs; None for single components.

    Returns
    -------
    table : FactorTable
        Table with the paths of the files.
    suite : Suite
        Motions that the table lists, and errors of files that could not be read.

    Raises
    ------
    ModelError
        Files of the table are not found; the component of a row is missing from its file or
        ambiguous.
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
            problem = (
                f"has {len(motions)} components named {component}"
                if motions
                else f"has no usable component {component}"
            )
            raise ModelError(
                f"{table.source}: {file} {problem}; specify the full id of the component in the "
                "table"
            )
    listed = {id(motion.whole) for motions in rows.values() for motion in motions}
    kept = tuple(motion for motion in suite.motions if id(motion) in listed)
    return table, replace(suite, motions=kept)


def _located(table: FactorTable) -> FactorTable:
    """Return a table of factors with the paths at which its files exist.

    Raises
    ------
    ModelError
        Files are not found.
    """
    directory = Path(table.source).parent
    located: dict[str, str] = {}
    for file in dict.fromkeys(file for file, _ in table.by_name):
        candidates = (Path(file), directory / file)
        path = next((item for item in candidates if file and item.is_file()), None)
        if path is not None:
            located[file] = file if path == candidates[0] else str(path)
    missing = [file for file, _ in table.by_name if file not in located]
    if missing:
        named = abbreviate(list(dict.fromkeys(file or "(empty)" for file in missing)), _MOST_NAMES)
        raise ModelError(
            f"{table.source}: records not found: {named}; a record is a file relative to the "
            "working directory or to the directory of the table"
        )
    by_name = {
        (located[file], component): values for (file, component), values in table.by_name.items()
    }
    return replace(table, by_name=by_name)


def _factor(file: str, line: int, text: str) -> float:
    """Return the number of a cell of the column factor, or raise ModelError."""
    factor = number(text)
    if math.isnan(factor) or factor == 0.0:
        raise ModelError(
            f"{file}:{line}: factor: {number_error(text, 'a number that is not zero')}"
        )
    return factor
