"""Read the files of a campaign: models, an inventory, records or a grid, and factors."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from tdint.csv_table import CsvTable, number, number_error, read_table
from tdint.errors import ModelError, ModelFault, RecordError, TdintError, UsageError
from tdint.files import MOST_BYTES, is_file, read_at_most, record_digest
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.horizontals import PairNames
from tdint.ground_motion.joined import JoinedRecord, rest_intervals
from tdint.ground_motion.reading import suites
from tdint.ground_motion.record import Record
from tdint.model.capacity import read_classes
from tdint.model.config.model_file import load_model
from tdint.model.config.record_files import RecordFiles
from tdint.model.damage_states import COST, NUMBER
from tdint.model.definition import Model
from tdint.model.keys.fields import ROOF, resolve
from tdint.number_parsing import abbreviate, pluralize
from tdint.response.pairs import motions_along_axes
from tdint.response.runs.load_case import LoadCase
from tdint.studies.campaign import assigned_motions, definition
from tdint.studies.fragility.type_states import ClassDamage, read_class_damage
from tdint.studies.regions.inventory import InventoryRows, read_inventory
from tdint.studies.regions.sites import factors_in, read_field, read_grid
from tdint.units import FORCE, GROUND_MOTION, parse_units, suffix

_SHOCK_COLUMNS = ("sequence", "record", "component", "factor", "units")
_MOST_NAMES = 10  # names listed in a message

_FACTOR_COLUMNS = ("record", "component", "factor")
_PROVENANCE_COLUMNS = ("target", "rule")


@dataclass(frozen=True)
class Inputs:
    """Contents of the files that a campaign file lists.

    Attributes
    ----------
    factors : FactorTable | None
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
    motions: assigned_motions.CampaignMotions = field(
        default_factory=assigned_motions.CampaignMotions
    )
    factors: assigned_motions.FactorTable | None = None
    damage: ClassDamage = field(default_factory=ClassDamage)
    faults: tuple[ModelError, ...] = ()
    too_far_from_sites: tuple[ModelFault, ...] = ()


def read_inputs(campaign: definition.CampaignFile, models: tuple[Model, ...] = ()) -> Inputs:
    """Read all files that a campaign file lists.

    Parameters
    ----------
    models : tuple of Model
        Models that have been read already; by default the model files are read.

    Returns
    -------
    Inputs
        Buildings, ground motions, factors and damage states; variations of a sweep are included.

    Raises
    ------
    ModelError
        Models or the inventory are invalid; the error lists all invalid entries. The file of
        factors cannot be read.
    RecordError
        No record can be used.
    UsageError
        A grid is used without an inventory.
    """
    rows: InventoryRows | None = None
    faults: tuple[ModelError, ...] = ()
    sweep = campaign.sweep or definition.ParameterSweep()
    # Read the buildings first, so that errors of model files are reported before records are read.
    if not isinstance(campaign.buildings, definition.InventoryFile):
        models = models or read_models(campaign.buildings, campaign.analysis)
        with sweep.reported_at_key():
            models = sweep.vary_models(models) if campaign.sweep else models
    else:
        rows, faults = read_rows(campaign.buildings)
    factors = (
        read_factors(campaign.intensity.source)
        if isinstance(campaign.intensity, assigned_motions.FactorTable)
        else None
    )
    # If the campaign file lists no records, the table of factors lists them.
    if factors and isinstance(campaign.records, RecordFiles) and not campaign.records.files:
        listed = campaign.records
        factors, suite = read_listed(factors, listed.choice, listed.pairs)
        motions = _motions_of(suite)
    elif isinstance(campaign.records, definition.LoadFiles):
        motions = read_load_cases(campaign.records, models, rows, campaign.source)
    else:
        motions = _READERS[type(campaign.records)](campaign.records)
    if any(model.across for model in models):
        if motions.site_motions is not None or isinstance(
            campaign.records, definition.SequenceFile
        ):
            raise UsageError(
                f"{campaign.source}: buildings with two directions cannot have sequences or "
                "motions of sites; list the records of all buildings, or use models with one "
                "direction"
            )
        along = motions_along_axes(motions.motions, models, campaign.source, campaign.pair_demand)
        demand = "the larger demand" if campaign.pair_demand else "the resultant demands"
        note = (
            f"{pluralize(len(along), 'pair')} of horizontal components: each pair is one motion, "
            f"with {demand} of both directions"
        )
        motions = replace(motions, motions=along, notes=(*motions.notes, note))
    # Omit buildings that are too far from all sites before a sweep multiplies them. The sites have
    # no locations if the inventory names the site of each building.
    too_far: tuple[ModelFault, ...] = ()
    site_motions = motions.site_motions
    if site_motions is not None and site_motions.locations:
        rows, unlocated, too_far = _select_located(campaign.source, site_motions, rows)
        if unlocated:
            faults = (*faults, ModelError(unlocated))
    # Costs are used only after all runs. Check them now, so that an error does not waste the runs.
    if rows and campaign.damage:
        _check_costs(rows)
    with sweep.reported_at_key():
        rows = sweep.vary_inventory(rows) if rows and campaign.sweep else rows
    if site_motions is not None:
        assigned = _assigned(campaign.source, site_motions, rows, len(models))
        motions = replace(motions, site_motions=assigned)
    damage = read_class_damage(campaign.damage)
    return Inputs(models, rows, motions, factors, damage, faults, too_far)


def read_models(files: Sequence[str], analysis: definition.AnalysisOverrides) -> tuple[Model, ...]:
    """Read model files and apply the campaign's settings for all buildings.

    Raises
    ------
    ModelError
        Files are invalid; the error lists all errors of all files.
    """
    models: list[Model] = []
    errors: list[ModelError] = []
    for file in files:
        try:
            models.append(adapted(load_model(file), analysis))
        except ModelError as error:
            errors.append(error)
    if errors:
        # An error of an invalid entry has its position in the file (`faults`). An error without a
        # position, for example of an unreadable file, has only a text.
        faults = [fault for error in errors for fault in error.faults]
        texts = [str(error) for error in errors if not error.faults]
        raise ModelError(faults if not texts else "\n".join([*texts, *map(str, faults)]))
    return tuple(models)


def adapted(model: Model, analysis: definition.AnalysisOverrides) -> Model:
    """Return a model with the collapse drift and the P-delta setting that the campaign file
    specifies for all buildings. Settings that it does not specify (None) are not changed.

    Raises
    ------
    ModelError
        P-delta is requested for a model without story heights.
    """
    if analysis.collapse_drift is not None:
        model = model.in_directions(collapse_drift=analysis.collapse_drift)
    if analysis.p_delta is not None:
        if analysis.p_delta and any(
            story.height is None and story.p_delta is not False for story in model.stories
        ):
            raise ModelError(
                f"{model.source}: p_delta of the campaign file requires the heights of all "
                "stories; add the heights, or remove p_delta"
            )
        model = model.in_directions(p_delta=analysis.p_delta)
    return model


def read_rows(buildings: definition.InventoryFile) -> tuple[InventoryRows, tuple[ModelError, ...]]:
    """Read the buildings of an inventory.

    Returns
    -------
    faults : tuple of ModelError
        One error with all invalid rows, which are skipped; empty if all rows are valid.

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
    """Check the columns of an inventory with the cost and the number of buildings, if they exist.
    Raise ModelError, with all invalid cells, if a cell is neither zero nor a positive number. Only
    costs may be empty: they are unknown."""
    expected = "zero or a positive number"
    faults = []
    for name in filter(rows.table.table.has, (COST, NUMBER)):  # both columns are optional
        missing = "" if name == COST else f"is missing; give {expected}"

        def describe_error(_: int, text: str, missing: str = missing) -> str:
            """Return the error of a cell with this text; empty if the cell is valid."""
            if not text:
                return missing
            return "" if number(text) >= 0.0 else number_error(text, expected)

        faults += rows.faults(describe_error, name)
    if faults:
        raise ModelError(faults)


def _select_located(
    source: str, motions: assigned_motions.SiteMotions, rows: InventoryRows | None
) -> tuple[InventoryRows, list[ModelFault], tuple[ModelFault, ...]]:
    """Select the buildings that have a location and are close enough to a site. For ground motion
    fields, the nearest site and its distance are added to each selected building; tables contain
    them as columns.

    The result contains the selected buildings, the errors of the buildings without a location, and
    the buildings that are too far from all sites. UsageError is raised if the campaign has no
    inventory; ModelError, if no building is selected.
    """
    if rows is None:
        raise UsageError(
            f"{source}: ground motions at sites require an inventory with the columns "
            "Latitude and Longitude"
        )
    # A row without a location is an error of the file; a row that is too far away is not. The sum
    # of longitude and latitude is NaN if one value is missing.
    is_unlocated = np.isnan(rows.locations[:, 0] + rows.locations[:, 1])
    missing = "is missing; motions at sites require the location of each building"
    unlocated = rows.only(is_unlocated).faults(
        lambda _, text: "" if text else missing, "Latitude", "Longitude"
    )
    located = rows.only(~is_unlocated)
    if not located:
        raise ModelError(unlocated)
    # The campaign file selects the distance (km or degrees) that determines the nearest site. The
    # limit `max_distance` applies to the distance in m.
    settings = motions.settings
    nearest_sites = assigned_motions.nearest(
        located.locations, motions.locations, settings.distance
    )
    distances = assigned_motions.meters(
        located.locations, np.array(motions.locations)[nearest_sites]
    )
    is_too_far = distances > settings.max_distance
    selected, distances_km = located.only(~is_too_far), 1e-3 * distances[is_too_far]
    if isinstance(motions, assigned_motions.FieldMotions):
        selected = replace(
            selected, near=(motions.sites, nearest_sites[~is_too_far], distances[~is_too_far])
        )
    limit = f"max_distance is {1e-3 * settings.max_distance:g} km"
    too_far = located.only(is_too_far).faults(
        lambda row, _: f"{distances_km[row]:.4g} km from the nearest site; {limit}", "Latitude"
    )
    if not selected:
        raise ModelError([*unlocated, *too_far])
    return selected, unlocated, tuple(too_far)


def _assigned(
    source: str, motions: assigned_motions.SiteMotions, rows: InventoryRows | None, model_count: int
) -> assigned_motions.SiteMotions:
    """Return motions at sites, assigned to the buildings.

    A building has samples of the motions of its nearest grid points, or all events of its site. The
    site is the nearest one, or the site that the inventory names. If the fields have no sites, a
    building has all events.

    Raises
    ------
    UsageError
        The motions have sites, and the campaign has no inventory with locations or sites.
    ModelError
        Buildings have no location or site, or a site without events.
    """
    if isinstance(motions, assigned_motions.GridMotions):
        return replace(motions, rows=rows)
    # A file without a column of sites has one site with an empty name.
    if motions.sites == ("",):
        count = len(rows) if rows else model_count
        return replace(motions, site_of=np.zeros(count, dtype=np.int64))
    # `near` has the names of the sites, the index of the nearest site of each building, and its
    # distance. Each building is repeated for all its variations.
    if rows and rows.near is not None:
        _, nearest_sites, _ = rows.near
        return replace(motions, site_of=np.repeat(nearest_sites, len(rows.changes)))
    if not rows or not rows.table.table.has("site"):
        raise UsageError(
            f"{source}: events at sites require an inventory with a column `site`, or the "
            "key `sites` of the records, a file with the locations of the sites"
        )
    # All variations of a building, which are consecutive, have the same site.
    site_numbers = {site: number for number, site in enumerate(motions.sites)}
    reason = (
        f"is not a site in {motions.settings.file}; its sites are "
        f"{', '.join(motions.sites[:5])}{' ...' * (len(site_numbers) > 5)}"
    )
    faults = rows.faults(
        lambda _, text: "" if text in site_numbers else f"{text!r} {reason}", "site"
    )
    if faults:
        raise ModelError(faults)
    site_of = np.repeat([site_numbers[site] for site in rows.texts("site")], len(rows.changes))
    return replace(motions, site_of=site_of)


def read_motions(records: RecordFiles) -> assigned_motions.CampaignMotions:
    """Read the records of files and directories.

    Returns
    -------
    CampaignMotions
        Motions, errors of files that could not be read, and notes.

    Raises
    ------
    RecordError
        No record can be used; the message has a line per reason.
    """
    return _motions_of(suites.read_suite(records.files, records.choice, records.pairs))


def _motions_of(suite: suites.Suite) -> assigned_motions.CampaignMotions:
    """Return the motions of a suite; raise RecordError if no record can be used."""
    if not suite.motions:
        raise RecordError("\n".join(map(str, suite.failures)) or "the campaign contains no records")
    return assigned_motions.CampaignMotions(
        suites.suite_motions(suite.motions), suite.failures, suite.notes
    )


def read_sequences(sequences: definition.SequenceFile) -> assigned_motions.CampaignMotions:
    """Read sequences of events from a CSV file.

    The file has the columns sequence, record (path relative to the file, or to the working
    directory) and, optionally, component, factor and units (of the samples; empty if the record
    states them). The rows of a sequence are in chronological order.

    Returns
    -------
    CampaignMotions
        Joined records of the sequences, errors of sequences that cannot be used, and notes.

    Raises
    ------
    ModelError
        The file cannot be read.
    RecordError
        No sequence can be used; the message has a line per reason.
    """
    format_text = (
        f"sequences are a CSV file with the columns {', '.join(_SHOCK_COLUMNS)}; the last three "
        "are optional"
    )
    table = read_table(sequences.file, format_text, columns=_SHOCK_COLUMNS)
    table.need("sequence", "record")
    # Defaults of missing columns: all components, units of the record.
    optional = [
        table.texts(name) if table.has(name) else [""] * len(table.rows)
        for name in ("component", "units")
    ]
    names, records = table.texts("sequence", empty=False), table.texts("record", empty=False)
    # Path, selection of components and factor of each event
    events_by_sequence: dict[str, list[tuple[str, RecordChoice, float]]] = {}
    for name, record, component, unit, factor in zip(
        names, records, *optional, factors_in(table), strict=True
    ):
        file, choice = resolve(record, Path(sequences.file).parent), sequences.choice
        if not is_file(file) and is_file(record):  # relative to the working directory
            file = record
        # Units of a row override the units for all rows ("*": all components).
        units = {"*": unit.strip()} if unit.strip() else choice.units
        choice = replace(choice, component=component or choice.component, units=units)
        events_by_sequence.setdefault(name, []).append((file, choice, factor))
    motions, failures = list[suites.SuiteMotion](), list[TdintError]()
    notes: dict[str, None] = {}  # keys of a dictionary: each note one time, in order
    for name, events in events_by_sequence.items():
        try:
            motions += _sequence(name, events, sequences.rest, notes)
        except (RecordError, UsageError) as error:
            failures.append(RecordError(f"sequence {name}: {error}"))
    if not motions:
        raise RecordError("\n".join(map(str, failures)))
    return assigned_motions.CampaignMotions(tuple(motions), tuple(failures), tuple(notes))


def read_load_cases(
    requested: definition.LoadFiles,
    models: Sequence[Model],
    rows: InventoryRows | None,
    source: str,
) -> assigned_motions.CampaignMotions:
    """Read the files of load cases.

    Returns
    -------
    CampaignMotions
        One motion per file, and the errors of files that cannot be used.

    Raises
    ------
    ModelError
        A building does not have a floor that is loaded.
    RecordError
        No file can be used; the message has a line per reason.
    """
    # Imported here, because only campaigns of load cases read tables of forces.
    from tdint.model.config.load_tables import read_load_file

    highest = max(floor for floor, _ in requested.columns)
    heights = [(model.name, len(model.stories)) for model in models]
    if rows is not None:
        lowest = int(rows.stories.argmin())
        heights.append((rows[lowest].id, int(rows.stories[lowest])))
    for name, count in heights:
        if highest > count:
            raise ModelError(
                f"{source}: forces: floor {highest} does not exist in {name}, which has "
                f"{pluralize(count, 'floor')}; remove the floor, or use {ROOF} for the highest "
                "floor of each building"
            )
    # Columns without a unit have the unit of force of all models; a text is the reason why the
    # columns require a unit.
    unit: float | str = "the buildings of an inventory have no unit of force"
    if models:
        first, *others = sorted({model.units.force for model in models})
        unit = FORCE[first]
        if others:
            unit = f"the models have different units of force: {', '.join([first, *others])}"
    motions, failures = list[suites.SuiteMotion](), list[TdintError]()
    for file in requested.files:
        try:
            loads = read_load_file(file, requested.columns, requested.scale, requested.start, unit)
        except ModelError as error:
            failures.append(RecordError(str(error)))
            continue
        load_case = LoadCase.of(loads)
        motions.append(suites.SuiteMotion(load_case, file, "", load_case))
    if not motions:
        raise RecordError("\n".join(map(str, failures)))
    return assigned_motions.CampaignMotions(tuple(motions), tuple(failures))


_READERS: dict[type, Callable[[Any], assigned_motions.CampaignMotions]]
_READERS = {
    assigned_motions.GridFile: read_grid,
    assigned_motions.FieldFile: read_field,
    definition.SequenceFile: read_sequences,
    RecordFiles: read_motions,
}
"""Function that reads the ground motions, by the type of the records in the campaign file."""


def _sequence(
    name: str,
    events: Sequence[tuple[str, RecordChoice, float]],
    rest: float | None,
    notes: dict[str, None],
) -> Iterator[suites.SuiteMotion]:
    """Yield the ground motions of a sequence: one joined record for each component that the records
    of all its events have. Notes of the reader for the user are added to `notes` as keys.

    RecordError is raised if a record cannot be used, or the records have different components,
    ModelError if the rest is too long.
    """
    components_by_event: list[list[Record]] = []
    for file, choice, factor in events:
        suite = suites.read_components([file], choice)
        for error in suite.failures:
            raise error  # a sequence requires all of its records
        notes |= dict.fromkeys(suite.notes)
        components_by_event.append([record.scaled(factor) for record in suite.records])
    # The i-th components of all records are joined below. They must have the same name, unless
    # each record has a single component.
    names = [[record.component for record in records] for records in components_by_event]
    have_equal_names = all(names_of_shock == names[0] for names_of_shock in names)
    have_single_component = all(len(names_of_shock) <= 1 for names_of_shock in names)
    if not (have_equal_names or have_single_component):
        raise RecordError(
            "the records of the sequence have different components; specify one component for each "
            "record in the column component"
        )
    for records in zip(*components_by_event, strict=True):
        try:
            rest_intervals(rest or 0.0, min(record.dt for record in records))
        except UsageError as error:  # `rest` of the campaign file, not a record
            raise ModelError(f"sequence {name}: {error}") from None
        joined = JoinedRecord.of(records, rest)
        yield suites.SuiteMotion(joined, name, joined.component, joined.events[0])


def read_factors(file: str) -> assigned_motions.FactorTable:
    """Read factors from a CSV file with the columns record, component (empty: all components),
    factor and, if each level has its own motions, level (`_levels_in`).

    Returns
    -------
    FactorTable
        Factors, and the settings of `tdint scale` if it has written the file.

    Raises
    ------
    ModelError
        The file cannot be read.
    """
    format_text = (
        f"factors are a CSV file with the columns {', '.join(_FACTOR_COLUMNS)}; `tdint scale -o` "
        "writes such a file"
    )
    table = read_table(
        file, format_text, columns=(*_FACTOR_COLUMNS, *_PROVENANCE_COLUMNS, *_LEVEL_COLUMNS, "unit")
    )
    table.need(*_FACTOR_COLUMNS)
    levels, level_unit = _levels_in(table)
    motions = zip(table.texts("record"), table.texts("component"), strict=True)
    # A motion may have several factors; duplicate rows are ignored.
    factors_of_motion: dict[tuple[str, str], dict[float, float]] = {}
    factors = factors_in(table, empty=False)
    for motion, factor, level, (line, _) in zip(motions, factors, levels, table.rows, strict=True):
        known_level = factors_of_motion.setdefault(motion, {}).setdefault(factor, level)
        if known_level != level and not math.isnan(level):
            raise ModelError(
                f"{file}:{line}: {' '.join(motion).strip()} has the factor {factor:g} at two "
                "levels; use another factor at one of them"
            )
    # Read the settings that `tdint scale` wrote next to the table. The file of settings is
    # optional, so errors are ignored. Its checksum states whether it belongs to this table.
    settings_file = Path(file.removesuffix(".gz")).with_suffix(".json")
    scale_settings = {}
    with suppress(OSError, ValueError, KeyError, TypeError, ModelError):
        content = read_at_most(settings_file, MOST_BYTES, ModelError)
        settings = json.loads(content)
        digest = sha256(read_at_most(file, MOST_BYTES, ModelError)).hexdigest()
        if settings["schema"]["name"] == "tdint scale" and settings["factors_sha256"] == digest:
            scale_settings = settings
    if scale_settings:
        record_digest(settings_file, content)
    else:
        scale_settings = {"settings": _scaling_in(table)}
    return assigned_motions.FactorTable(file, factors_of_motion, scale_settings, level_unit)


def _scaling_in(table: CsvTable) -> dict[str, str]:
    """Return target and rule of the scaling from the columns of a table of factors; several targets
    of its rows are one text."""
    columns = [name for name in _PROVENANCE_COLUMNS if table.has(name)]
    distinct = {name: dict.fromkeys(filter(None, table.texts(name))) for name in columns}
    return {name: "; ".join(texts) for name, texts in distinct.items() if texts}


_UNITS_OF_LEVELS = {
    unit: (quantity, factor)
    for quantity, units in GROUND_MOTION.items()
    for unit, factor in units.items()
}
"""Quantity and factor to SI of each unit of an intensity measure."""

_LEVEL_COLUMNS = (
    "level",
    *(
        name
        for unit in _UNITS_OF_LEVELS
        for name in dict.fromkeys((f"level{suffix(unit)}", f"level ({unit})", f"level [{unit}]"))
    ),
)
"""Names of the column of the levels: without a unit, or with a unit."""


def _levels_in(table: CsvTable) -> tuple[list[float], str]:
    """Return the levels of the rows of a table of factors, SI units, and their SI unit. The unit is
    in the cell (`0.4 g`), in the name of the column (`level_g`, `level (g)`), or in a column
    `unit`. Without a column of levels, all levels are NaN, and the unit is empty.

    Raises
    ------
    ModelError
        A level is not positive or has no unit, or the levels have units of several quantities.
    """
    columns = [name for name in _LEVEL_COLUMNS if table.has(name)]
    if not columns:
        return [math.nan] * len(table.rows), ""
    if len(columns) > 1:
        raise ModelError(f"{table.source}:1: two columns of levels, {columns[0]} and {columns[1]}")
    (column,) = columns
    column_units = [
        unit
        for unit in _UNITS_OF_LEVELS
        if column in (f"level{suffix(unit)}", f"level ({unit})", f"level [{unit}]")
    ]
    units = table.texts("unit") if table.has("unit") else column_units * len(table.rows)
    texts = table.texts(column, empty=False)
    levels, quantities = [], dict[str, None]()
    for text, unit, (line, _) in zip(texts, units or [""] * len(texts), table.rows, strict=True):
        try:
            level = parse_units(f"{text} {unit}".strip())
        except UsageError:
            level = None
        if level is None or not level.has_factor or level.quantity not in GROUND_MOTION:
            raise ModelError(
                f"{table.source}:{line}: level must be a positive number with its unit, such as "
                f"0.4 g, got {text[:40]!r}; add the unit, or name the column level_g"
            )
        levels.append(level.scale)
        quantities[level.quantity] = None
    if len(quantities) > 1:
        raise ModelError(
            f"{table.source}: the levels have units of {' and '.join(quantities)}; use one measure"
        )
    si_units = GROUND_MOTION[next(iter(quantities))]
    return levels, next(unit for unit, factor in si_units.items() if factor == 1.0)


def read_listed(
    table: assigned_motions.FactorTable, choice: RecordChoice, pairs: PairNames | None
) -> tuple[assigned_motions.FactorTable, suites.Suite]:
    """Read the ground motions that a table of factors lists, and return the table with the paths of
    the files, and the motions with the errors of files that could not be read. Other components of
    the files are ignored.

    Raises
    ------
    ModelError
        Files of the table are not found; the component of a row is missing from its file or
        ambiguous.
    """
    table = _located(table)
    files = tuple(dict.fromkeys(file for file, _ in table.by_name))
    suite = suites.read_suite(files, choice, pairs)

    # Assign each motion to a row of the table. The component in the row is the component as
    # selected by the user, its full name, or empty for all components of the file.
    motions_of_row: dict[tuple[str, str], list[suites.SuiteMotion]] = {
        row: [] for row in table.by_name
    }
    for motion in suites.suite_motions(suite.motions):
        for component in assigned_motions.component_names_of(motion):
            if (motion.name, component) in motions_of_row:
                motions_of_row[motion.name, component].append(motion)
                break
    failure_text = " ".join(map(str, suite.failures))
    for (file, component), motions in motions_of_row.items():
        # The row of a file that could not be read is no error here, because the file is reported
        # with the failures of the suite.
        if component and len(motions) != 1 and file not in failure_text:
            problem = (
                f"has {len(motions)} components named {component}"
                if motions
                else f"has no usable component {component}"
            )
            raise ModelError(
                f"{table.source}: {file} {problem}; specify the full id of the component in the "
                "table"
            )
    listed_ids = {
        id(motion.ground_motion) for motions in motions_of_row.values() for motion in motions
    }
    listed_motions = tuple(motion for motion in suite.motions if id(motion) in listed_ids)
    return table, suite._replace(motions=listed_motions)


def _located(table: assigned_motions.FactorTable) -> assigned_motions.FactorTable:
    """Return a table of factors with the path of each file. A path in the table is relative to the
    working directory or, if it is not found there, to the directory of the table. ModelError lists
    the files that are not found.
    """
    located: dict[str, str] = {}  # path where the file exists, by the path in the table
    for file in dict.fromkeys(file for file, _ in table.by_name):
        if paths := assigned_motions.files_of_row(file, table.source):
            located[file] = file if paths[0] == str(Path(file)) else paths[0]
    missing = [file for file, _ in table.by_name if file not in located]
    if missing:
        missing_text = abbreviate(
            list(dict.fromkeys(file or "(empty)" for file in missing)), _MOST_NAMES
        )
        raise ModelError(
            f"{table.source}: records not found: {missing_text}; the path of a record must be "
            "relative to the working directory or to the directory of the table"
        )
    by_name = {(located[file], part): rows for (file, part), rows in table.by_name.items()}
    return replace(table, by_name=by_name)
