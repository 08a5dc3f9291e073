"""Read campaign files: convert YAML to a checked `CampaignFile`. Files that the campaign
file lists, such as models and records, are not opened."""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path

from tdint.csv_table import number
from tdint.errors import UsageError
from tdint.methods.catalogue import parse as parse_method
from tdint.model.building_rules import CAPACITY, RULES
from tdint.model.config.record_files import FILES, UNITS, RecordFiles, choice_of_files, read_files
from tdint.model.config.sections import read_sample_units
from tdint.model.keys import fields
from tdint.model.keys.document import read_document
from tdint.model.story import MAX_STORIES
from tdint.response.pairs import PAIR_DEMANDS
from tdint.studies.campaign import definition
from tdint.studies.campaign.assigned_motions import (
    DISTANCES,
    MAX_DISTANCE,
    FactorTable,
    FieldFile,
    GridFile,
    Levels,
    MeasureLevels,
    Scales,
)
from tdint.studies.campaign.chunks import CampaignSettings
from tdint.studies.fragility.type_states import DAMAGE, read_damage_request
from tdint.studies.keys import keys
from tdint.studies.motions.intensity import (
    GEOMETRIC_MEAN,
    PAIRS,
    SPECTRAL,
    measure_at,
    scalable_measures,
    scaling_obstacle,
)
from tdint.units import GROUND_MOTION, LENGTH, parse_units

SEED = fields.Integer(0, 2**31 - 1)
_GRID = keys(
    "grid", neighbors=fields.Integer(1, 1000), samples=fields.Integer(1, 100_000), seed=SEED
)
_FIELDS = keys("fields")
_SEQUENCES = keys("sequences")
_FILE_KEYS, _GRID_KEYS, _FIELD_KEYS, _SEQUENCE_KEYS = (
    tuple(key.name for key in keys) for keys in (FILES, _GRID, _FIELDS, _SEQUENCES)
)
MOTIONS = fields.Keys(
    (
        *FILES,
        *_SEQUENCES,
        *_FIELDS,
        *_GRID,
        *keys(
            "sites",
            distance=fields.Choice(DISTANCES, "distance"),
            max_distance=fields.Either((fields.POSITIVE, fields.TextLine())),
        ),
        UNITS,
        *keys("pairs", pair_demand=fields.Choice(PAIR_DEMANDS, "demand of pairs")),
    )
)
"""Keys of `records`. One of files, sequences, fields and grid is required unless the intensity is a
table of factors, which lists the records."""

LOAD_CASES = fields.Keys(
    keys(
        "forces",
        floors=fields.NamedEntries(fields.TextLine(), description="a mapping of floors to columns"),
        floor=fields.Either((fields.Integer(1, MAX_STORIES), fields.Choice((fields.ROOF,)))),
    )
)
"""Keys of `forces` of a campaign; their names are those of `excitation.forces` of a model."""


_TOLERANCE = fields.Bounds(0.0, 1.0, low_allowed=False, high_allowed=False, ratio=True)
_MIN_LEVEL, _MAX_LEVEL = 1e-6, 1e6
"""Range of intensities of ground motions, m/s^2 or m/s."""

_SCATTER = fields.Bounds(0.0, 0.5, ratio=True)
_UNITS = fields.Keys(
    keys("units", length=fields.Choice(("m", "ft"), "length unit of inventories")),
    make=lambda _, length: LENGTH[length],
)
_BUILDINGS = fields.Keys(
    keys(
        "buildings",
        rules=fields.Choice(tuple(RULES), "set of rules"),
        units=_UNITS,
        damping=fields.Choice(("full", "mass-only"), "damping"),
        stiffness_scatter=_SCATTER,
        damping_scatter=_SCATTER,
        seed=SEED,
    ),
    one_of=(("models", "inventory"),),
)

_FIRST_PERIOD = "T1"  # value of `period`: the first period of each building

_INTENSITY = fields.Keys(
    keys(
        "intensity",
        measure=fields.Choice(scalable_measures(), "measure"),
        period=fields.Either((fields.Choice((_FIRST_PERIOD,)), fields.POSITIVE)),
        pair=fields.Choice(tuple(PAIRS), "measure of pairs"),
    ),
    one_of=(("scales", "measure", "factors"),),
)

_METHOD = fields.TextLine(parse_method)
_ANALYSIS = fields.Keys(
    keys(
        "analysis",
        method=_METHOD,
        methods=fields.EntriesOf(
            _METHOD, 1, None, "a list of methods", "is empty; give at least one method"
        ),
        dt=fields.Either(
            (
                fields.POSITIVE,
                fields.EntriesOf(fields.POSITIVE, 1, short="is empty; give at least one step"),
            )
        ),
        tolerance=_TOLERANCE,
    )
)
_TABLES = fields.Choice(("runs", "damage", "losses", "stories", "profiles"), "table")
_OUTPUTS = fields.Keys(keys("outputs"))
CAMPAIGN = fields.Keys(
    keys(
        "campaign",
        buildings=_BUILDINGS,
        records=MOTIONS,
        forces=LOAD_CASES,
        intensity=_INTENSITY,
        analysis=_ANALYSIS,
        vary=definition.Varied(),
        damage=DAMAGE,
        outputs=fields.Either(
            (_OUTPUTS, fields.EntriesOf(_TABLES, 1, short="is empty; name at least one table"))
        ),
    )
)
"""Keys of a campaign file."""


def campaign_schema() -> fields.Schema:
    """Return the JSON schema (draft 7) of campaign files, for editors."""
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "tdint campaign",
        "description": "Runs of buildings under ground motions for tdint",
        **CAMPAIGN.schema(),
    }


def load_campaign(source: str | Path) -> definition.CampaignFile:
    """Read a campaign file. The files that it lists are not read.

    Parameters
    ----------
    source : str or Path
        YAML file; `-` is standard input. Relative paths in the file refer to its directory.

    Raises
    ------
    ModelError
        The file cannot be read, is not YAML, or has errors; all errors are listed with line and
        column.
    """
    origin, root = read_document(source, "campaign file", "`buildings` and `records`")
    section = root.section(CAMPAIGN)
    campaign = _read(section, origin.label, origin.name) if section else None
    root.faults.raise_if_any()
    assert campaign is not None
    return campaign


def _read(section: fields.Section, label: str, name: str) -> definition.CampaignFile:
    """Return the definition of the campaign that the root section of a file contains. Errors are
    recorded in the document; invalid values are replaced by defaults, so that the remaining keys
    are also checked.

    `name` is Default name of the campaign.
    """
    buildings_value = section.need("buildings", "give `models` or an `inventory`")
    # The key `records` is optional if the file specifies a table of factors, which lists records.
    intensity = section.get("intensity")
    are_listed = intensity is not None and intensity.peek("factors") is not None
    forces_value = section.get("forces")
    records_value = (
        section.get("records")
        if are_listed or forces_value
        else section.need("records", "give `files` or a `grid`, or `forces` for loads on floors")
    )
    _check_combinations(section)
    analysis, outputs_value = section.inner("analysis"), section.get("outputs")
    dt = analysis.get("dt")
    buildings = (_read_buildings(buildings_value) if buildings_value else None) or ()
    are_models = not isinstance(buildings, definition.InventoryFile)
    # A list names all tables to write. A mapping adds tables to the default tables.
    listed_tables = None
    if outputs_value and outputs_value.is_list:
        listed_tables = outputs_value.read()
    has_stories = "stories" in (listed_tables or ())
    # Profiles are written by default for model files; for inventories they would be large.
    has_profiles = "profiles" in listed_tables if listed_tables else are_models
    if outputs_value and not outputs_value.is_list:
        added_tables = outputs_value.section(_OUTPUTS)
        if added_tables:
            has_stories = added_tables.read("stories", False)
            has_profiles = added_tables.read("profiles", are_models)
    motions: (
        RecordFiles | definition.SequenceFile | GridFile | FieldFile | definition.LoadFiles | None
    ) = None
    if forces_value:
        motions = _load_cases(forces_value)
    elif records_value:
        motions = read_requested_motions(records_value, are_listed=are_listed)
    demand = records_value.peek("pair_demand") if records_value else None
    return definition.CampaignFile(
        name=section.read("name") or name,
        source=label,
        buildings=buildings,
        records=motions or definition.NO_RECORDS,
        intensity=_read_intensity(intensity) or definition.UNSCALED,
        analysis=_read_analysis(analysis),
        settings=CampaignSettings(
            dt=dt.read() if dt and not dt.is_list else None,
            **analysis.read_present("duration", "tolerance", "until_rest", "check"),
            stories=has_stories,
            profiles=has_profiles,
        ),
        sweep=definition.read_sweep(
            section.get("vary"),
            analysis.get("methods"),
            dt if dt and dt.is_list else None,
            models=are_models,
        ),
        damage=read_damage_request(
            section.get("damage"),
            buildings.rules if isinstance(buildings, definition.InventoryFile) else None,
        ),
        outputs=listed_tables,
        style=section.read("style") or "",
        pair_demand=demand.choice(PAIR_DEMANDS, "demand of pairs") if demand else None,
    )


def _check_combinations(section: fields.Section) -> None:
    """Record errors for keys of the intensity and the analysis that have no effect with the type of
    ground motions that the file requests."""
    records, forces = section.get("records"), section.get("forces")
    if forces and records:
        forces.fault(
            "cannot be used with `records`; remove one of them (forces together with a ground "
            "motion are `excitation.forces` of the model file)"
        )

    def value_of(section_name: str, name: str) -> fields.Value | None:
        """Return the value of a key in a section; None if the key or the section is missing."""
        value = section.get(section_name)
        return value.peek(name) if value else None

    # The events of fields, or of a grid with the key `events`, have a scale factor for each site.
    are_events = value_of("records", "fields") or value_of("records", "events")
    for name in ("measure", "factors"):
        entry = value_of("intensity", name)
        if entry and forces:
            entry.fault(
                "cannot be used with `forces`, which have no ground motion; use `scales` to "
                "multiply the forces"
            )
        if entry and are_events:
            entry.fault(
                "cannot be used with events, because their files specify scale factors; use "
                "`scales` to multiply these factors"
            )
    # The key `pair` of the intensity requires pairs of components. The files of a grid always
    # contain both components, so that the key `pairs` is not needed.
    pair, pairs = value_of("intensity", "pair"), value_of("records", "pairs")
    has_no_pairs = pairs is None or pairs.is_word("false")
    if pair and records and not records.peek("grid") and has_no_pairs:
        pair.fault("has no effect without `pairs: true` of the records; add it, or remove `pair`")
    # A duration could end a sequence before its last event has ended.
    duration = value_of("analysis", "duration")
    if duration and value_of("records", "sequences"):
        duration.fault(
            "cannot be used with `sequences`, because all events are analyzed to their end; remove "
            "it (the key `rest` sets the time between events)"
        )


def _read_analysis(section: fields.Section) -> definition.AnalysisOverrides:
    """Read the settings of the key `analysis` that replace settings of the models: method, collapse
    drift and P-delta. Errors are recorded in the document."""
    method = section.read("method")
    if section.has("methods"):
        section.refuse(("method",), "cannot be used with `methods`; remove one of them")
    return definition.AnalysisOverrides(
        method.label if method else None, **section.read_present("collapse_drift", "p_delta")
    )


def _read_buildings(value: fields.Value) -> tuple[str, ...] | definition.InventoryFile | None:
    """Return the model files or the inventory of the key `buildings`; None after an error, which is
    recorded in the document."""
    section = value.section()
    if section is None:
        return None
    models, inventory = section.get("models"), section.get("inventory")
    if models and inventory:
        inventory.fault("cannot be used with `models`; remove one of them")
        return None
    if inventory:
        return _inventory(section, inventory)
    if models is None:
        section.need("models", "give a list of model files, or an inventory instead")
        return None
    # The keys after `models` and `inventory` describe an inventory.
    section.refuse(_BUILDINGS[2:], "can only be used with an `inventory`")
    empty = "is empty; give at least one model file"
    return section.files("models", "a list of model files", empty)


def _inventory(section: fields.Section, inventory: fields.Value) -> definition.InventoryFile | None:
    """Read the keys of an inventory; None if a required key is missing or invalid. Errors are
    recorded in the document.
    """
    file = inventory.file()
    rules = section.read("rules", next(iter(RULES)))
    units = section.need("units", "give {length: ft} or {length: m}; plan areas are in its square")
    length_unit = units.read() if units else None
    damping, classes = section.read("damping"), section.file("classes")
    optional_settings = section.read_present(
        "stiffness_scatter", "damping_scatter", "seed", "as_published"
    )
    # Rules by capacity curves require another table and have no scatter.
    if rules == CAPACITY:
        section.need("classes", "give the CSV file of the classes (class, sd_m, sa_g)")
        section.refuse(
            ("damping", "stiffness_scatter", "damping_scatter", "seed"),
            f"cannot be used with the rules {CAPACITY}; remove it",
        )
    else:
        section.refuse(("classes", "as_published"), f"can only be used with the rules {CAPACITY}")
    if file is None or rules is None or length_unit is None:
        return None
    return definition.InventoryFile(
        file,
        rules,
        length_unit,
        mass_only=damping == "mass-only",
        classes=classes,
        mapping=section.file("mapping"),
        **optional_settings,
    )


def _read_intensity(value: fields.Value | None) -> Levels | None:
    """Return the scale factors, the levels of an intensity measure, or the file of factors that the
    key `intensity` specifies; None if the key is missing or after an error, which is recorded in
    the document."""
    section = value.section() if value else None
    if value is None or section is None:
        return None
    # Exactly one source of factors is allowed.
    sources = [name for name in ("scales", "measure", "factors") if section.has(name)]
    if len(sources) != 1:
        value.fault(
            "exactly one of scales, measure and factors is required"
            + (f", got {' and '.join(sources)}" if sources else "")
        )
        return None
    if sources == ["measure"]:
        return _levels(section)
    section.refuse(("period", "damping", "levels", "pair"), "can only be used with a `measure`")
    if sources == ["factors"]:
        file = section.file("factors")
        return FactorTable(file, {}) if file else None
    scales = section.get("scales")
    items = (
        scales.items("a list of factors", "is empty; give at least one factor") if scales else None
    )
    # Duplicate factors are ignored, because they would repeat the same run.
    distinct_factors: dict[float, None] = {}
    for item in items or ():
        factor = item.number(fields.ANY)
        if factor == 0.0:
            item.fault("a scale factor must not be zero")
        distinct_factors[factor] = None
    return Scales(tuple(distinct_factors))


def _levels(section: fields.Section) -> MeasureLevels | None:
    """Read the levels of an intensity measure; None if the measure is invalid. Errors are recorded
    in the document."""
    measure_value = section.get("measure")
    # For some measures, levels cannot be reached by scaling.
    if measure_value and (reason := scaling_obstacle(measure_value.word)):
        measure_value.fault(f"{measure_value.word} cannot be used for levels: {reason}")
        return None
    name, pair = section.read("measure"), section.read("pair", GEOMETRIC_MEAN)
    damping = section.number("damping", default=0.05)
    levels = section.need("levels", "give the values, such as [0.1 g, 0.2 g]")
    empty_advice = "is empty; give at least one value"
    level_items = levels.items("a list of values with their unit", empty_advice) if levels else None
    if name is None:
        return None
    # The levels in the file have a unit, which must be a unit of the measured quantity, for example
    # a unit of acceleration for sa. `GROUND_MOTION` contains the units of each quantity with their
    # factors to SI units: select the quantity with this SI unit (factor 1).
    unit = measure_at(name, damping, 1.0).unit
    quantity = next(
        (name for name, units in GROUND_MOTION.items() if units.get(unit) == 1.0), "acceleration"
    )
    values = tuple(dict.fromkeys(_level(item, quantity) for item in level_items or ()))

    # The default period of a spectral measure is the first period of each building (None). Other
    # measures do not depend on a period: any value avoids the computation of the first period.
    period, period_value = None, section.get("period")
    if name not in SPECTRAL:
        period = 1.0
        if period_value:
            period_value.fault(
                f"cannot be used with the measure {name}, which has no period; remove it"
            )
    elif period_value and not period_value.is_word(_FIRST_PERIOD):
        seconds = period_value.number(
            fields.POSITIVE, expected=f"{_FIRST_PERIOD} or a positive number of seconds"
        )
        period = None if math.isnan(seconds) else seconds
    return MeasureLevels(partial(measure_at, name, damping), period, values, pair)


def _level(value: fields.Value, quantity: str) -> float:
    """Return an intensity level, such as `0.1 g`, in SI units; NaN after an error, which is
    recorded in the document. `quantity` is the quantity of the measure, such as acceleration."""
    example = {"acceleration": "0.1 g", "velocity": "0.2 m/s"}.get(quantity, "0.1 m")

    def convert(text: str) -> float:
        """Convert the text of a level to SI units; raise UsageError if it is invalid."""
        try:
            units = parse_units(text)
        except UsageError:
            raise UsageError(
                f"must be a positive number with its unit, such as {example}, got {text!r}"
            ) from None
        # `parse_units` also accepts a unit without a number (no factor), which is not a level.
        if units.quantity != quantity or not units.has_factor:
            raise UsageError(
                f"must be a number with a unit of {quantity}, such as {example}, got {text!r}"
            )
        if not _MIN_LEVEL <= units.scale <= _MAX_LEVEL:
            raise UsageError(
                f"must be from {_MIN_LEVEL:g} to {_MAX_LEVEL:g} in SI units, got {text!r}"
            )
        return units.scale

    return value.parsed(convert) or math.nan


# ---- Ground motions: the key `records` with files, sequences, ground motion fields or a grid


def _load_cases(value: fields.Value) -> definition.LoadFiles | None:
    """Return the load cases that the campaign file requests; None if a required value is missing or
    invalid. Errors are recorded in the document."""
    section = value.section()
    if section is None:
        return None
    section.need("files", "give a list of CSV files, one load case each")
    paths = section.files("files", "a list of CSV files", "is empty; give at least one file")
    # Imported here, because only campaigns of load cases read tables of forces.
    from tdint.model.config.load_tables import read_requests

    # The number of stories is not known, and the roof is floor 0.
    requests = read_requests(section, section.value, None, scale=1.0, start=0.0)
    columns = tuple((item.floor, item.column) for item in requests)
    scale, start = section.number("scale", default=1.0), section.number("start", default=0.0)
    return definition.LoadFiles(paths, columns, scale, start)


def read_requested_motions(
    value: fields.Value, *, are_listed: bool = False
) -> RecordFiles | definition.SequenceFile | GridFile | FieldFile | None:
    """Return the ground motions that the campaign file requests: files, sequences, fields or a
    grid; None if a required value is missing or invalid. Errors are recorded in the document.

    Parameters
    ----------
    are_listed : bool
        True if a table of factors lists the records, so that none of these keys is required.
    """
    section = value.section()
    if section is None:
        return None
    # Keys of other sources of motions would have no effect, and are refused.
    if section.has("grid"):
        excluded_keys = (*_FILE_KEYS, *_SEQUENCE_KEYS, *_FIELD_KEYS)
        section.refuse(
            excluded_keys,
            "can only be used with `files`, `sequences` or `fields`, not with a `grid`",
        )
        section.need("units", "give the units of the grid's motions, such as g or m/s^2")
        return _grid(section, read_sample_units(section.get("units")))
    section.refuse(_GRID_KEYS, "can only be used with a `grid`")
    if section.has("fields"):
        section.refuse(("files", *_SEQUENCE_KEYS), "cannot be used with `fields`; remove it")
        return _fields(section)
    section.refuse(("sites", "rates"), "can only be used with `fields`")
    section.refuse(("distance", "max_distance"), "can only be used with `fields` or a `grid`")
    if section.has("sequences"):
        section.refuse(("files", "pairs"), "cannot be used with `sequences`; remove it")
        sequence_file, choice = section.file("sequences"), choice_of_files(section)
        return (
            definition.SequenceFile(sequence_file, choice, section.read("rest"))
            if sequence_file
            else None
        )
    section.refuse(("rest",), "can only be used with `sequences`")
    # If all four sources of ground motions are missing, the error names the usual one, `files`.
    files = section.get("files")
    if not (files or are_listed):
        section.need("files", "give a list of files and directories, or a `grid` instead")
    return read_files(section)


def _fields(section: fields.Section) -> FieldFile | None:
    """Read the keys of ground motion fields; None if the key `fields` is invalid. Errors are
    recorded in the document."""
    file, sites = section.file("fields"), section.file("sites")
    pairs_value, component_value = section.get("pairs"), section.get("component")
    are_pairs = pairs_value.boolean() if pairs_value else False
    if are_pairs and component_value:
        component_value.fault(
            "cannot be used with `pairs`, which use both components; remove one key"
        )
    # Distances require the locations of sites.
    if not sites:
        section.refuse(
            ("distance", "max_distance"),
            "has no effect without `sites`; specify `sites` or remove it",
        )
    choice, distance = choice_of_files(section), section.read("distance", "km")
    if file is None:
        return None
    max_distance, rates = read_max_distance(section), section.file("rates")
    return FieldFile(file, choice, are_pairs, sites, distance, max_distance, rates)


def _grid(section: fields.Section, units: str | None) -> GridFile | None:
    """Read the keys of a grid; None if a required key is missing or invalid. Errors are recorded in
    the document.

    `units` contains the units of the samples of the grid's motions; None if missing or invalid.
    """
    file, distance = section.file("grid"), section.read("distance", "km")
    # With `events`, all events are run, so that keys of the sampling would have no effect.
    if events := bool(section.read("events")):
        section.refuse(
            ("neighbors", "samples", "seed"),
            "cannot be used with `events`, which are not sampled; remove it",
        )
    else:
        section.need("neighbors", "give the number of grid points to sample from")
        section.need("samples", "give the number of samples for each building")
    # Without a value, which is reported, no building has a sample.
    numbers = section.read("neighbors", 1), section.read("samples", 0), section.read("seed", 0)
    max_distance = read_max_distance(section)
    if file is None or units is None:
        return None
    return GridFile(file, units, *numbers, distance, events, max_distance)


def read_max_distance(section: fields.Section) -> float:
    """Return the maximum distance of a building from its site, m: the value of the key
    `max_distance` of the section, or the default. An invalid value is recorded as an error of the
    file, and the default is returned."""
    value = section.get("max_distance")
    return (value.parsed(parse_distance) if value else None) or MAX_DISTANCE


def parse_distance(text: str) -> float:
    """Convert the text of a distance to m. The text is a number of km, or a number with the unit
    `km` or `m`.

    Raises
    ------
    UsageError
        The text is not a positive distance.
    """
    match = re.fullmatch(r"\s*([0-9.eE+]+)\s*(km|m)?\s*", text)
    meters = number(match[1]) * (1.0 if match[2] == "m" else 1e3) if match else math.nan
    if not meters > 0.0:
        raise UsageError(
            f"must be a positive distance in km or with a unit, such as 15 or 800 m, "
            f"got {text!r:.40}"
        )
    return meters
