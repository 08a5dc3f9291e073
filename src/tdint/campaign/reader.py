"""Read campaign files: YAML to a checked `CampaignFile`, by the same reader as models. No other
file is opened."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

from tdint.campaign.batch import RunSettings
from tdint.campaign.definition import (
    AnalysisWishes,
    CampaignFile,
    FactorsFile,
    FieldFile,
    InventoryFile,
    ModelFiles,
    RecordFiles,
    SequenceFile,
    Varied,
    read_sweep,
)
from tdint.campaign.fragility.type_states import DAMAGE, read_wishes
from tdint.campaign.intensity import (
    GEOMETRIC_MEAN,
    PAIRS,
    SPECTRAL,
    levelled,
    measure_at,
    without_levels,
)
from tdint.campaign.motions import COORDINATES, GridFile, MeasureLevels, Scales, read_max_distance
from tdint.campaign.pairs import PAIR_DEMANDS
from tdint.errors import UsageError
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.horizontals import USUAL, PairNames
from tdint.methods.catalogue import parse as parse_method
from tdint.model.config.model_file import LAYOUT, PROCESSING, read_choice
from tdint.model.config.sections import read_sample_units
from tdint.model.inventory import CAPACITY, RULES
from tdint.model.keys.document import read_document
from tdint.model.keys.fields import (
    ANY,
    POSITIVE,
    POSITIVE_RATIO,
    RATIO,
    Bounds,
    Choice,
    Either,
    EntriesOf,
    Flag,
    Key,
    Keys,
    Schema,
    Section,
    Value,
    Whole,
    Words,
)
from tdint.units import GROUND_MOTION, LENGTH, parse_units

# ---- Ground motions of a campaign file, the key `records`: files, sequences, fields or a grid

SEED = Whole(0, 2**31 - 1)
_FILES = (
    Key(
        "files",
        EntriesOf(Words(), least=1),
        "records and directories of records, relative to this file",
    ),
    Key(
        "component",
        Words(),
        "component, if files contain several; all horizontal components by default",
    ),
    Key(
        "pairs",
        Either((Flag(), Words())),
        "combine the two horizontal components of a motion, so that they have the same factors: "
        "true, or patterns of the file names: '{}_N.AT2,{}_E.AT2'",
    ),
    Key("inventory", Words(), "station metadata, to remove the instrument response"),
    *LAYOUT,
    *PROCESSING,
)
_GRID = (
    Key("grid", Words(), "EventGrid.csv, relative to this file"),
    Key("neighbors", Whole(1, 1000), "number of nearest grid points to sample from"),
    Key("samples", Whole(1, 100_000), "number of samples for each building"),
    Key("seed", SEED, "random seed, combined with the building's id"),
    Key(
        "events",
        Flag(),
        "no sampling: the rows of the points' files are events, and each building has the events "
        "of the nearest point",
    ),
)
_FIELDS = (
    Key(
        "fields",
        Words(),
        "CSV file with the motion of each event (event, site, record, factor), relative to this "
        "file",
    ),
    Key(
        "sites",
        Words(),
        "CSV file with the locations of the sites (site, longitude, latitude), relative to this "
        "file",
    ),
    Key(
        "rates",
        Words(),
        "CSV file with the annual rate of each event (event, rate), relative to this file",
    ),
)
_BY_DISTANCE = Choice(tuple(COORDINATES), "distance")
_DISTANCE = Key(
    "distance", _BY_DISTANCE, "unit of distances to sites: km, or degrees as in SimCenter"
)
_MAX_DISTANCE = Key(
    "max_distance",
    Either((POSITIVE, Words())),
    "km; buildings at a larger distance from the nearest site are omitted; 15 by default",
)
_SEQUENCES = (
    Key(
        "sequences",
        Words(),
        "CSV file of events in sequence (sequence, record, component, factor), relative to this "
        "file",
    ),
    Key(
        "rest",
        Bounds(0.0),
        "seconds between the events of a sequence; by default until free vibration has decayed",
    ),
)
_FILE_KEYS, _GRID_KEYS, _FIELD_KEYS, _SEQUENCE_KEYS = (
    tuple(key.name for key in keys) for keys in (_FILES, _GRID, _FIELDS, _SEQUENCES)
)
_SAMPLE_UNITS = Key(
    "units",
    Words(),
    "units of the samples, if the files do not state them: m/s^2, g, ...; by file "
    "'AT2=g,*.mseed=m/s^2', or a table of units, relative to this file",
)
_PAIR_DEMAND = Key(
    "pair_demand",
    Choice(PAIR_DEMANDS, "demand of pairs"),
    "demand of the two horizontal components of a recording: the larger (default) or the mean "
    "demand of one motion, or separate for two motions",
)
MOTIONS = Keys(
    (*_FILES, *_SEQUENCES, *_FIELDS, *_GRID, _DISTANCE, _MAX_DISTANCE, _SAMPLE_UNITS, _PAIR_DEMAND),
)
"""Keys of `records`. One of files, sequences, fields and grid is required unless the intensity is a
table of factors, which lists the records."""


def read_wanted_motions(
    value: Value, *, are_listed: bool = False
) -> RecordFiles | SequenceFile | GridFile | FieldFile | None:
    """Return files, sequences, fields or a grid, or None if there are errors.

    Parameters
    ----------
    value : Value
        Value of the key `records`.
    are_listed : bool
        True if a table of factors lists the records, so that none of these keys is required.
    """
    section = value.section()
    if section is None:
        return None
    # The value is used by `_read_pair_demand`; this call records an error of an invalid value.
    section.read("pair_demand")
    # Keys of other sources of motions would have no effect, and are refused.
    if section.has("grid"):
        others = (*_FILE_KEYS, *_SEQUENCE_KEYS, *_FIELD_KEYS)
        section.refuse(
            others, "can only be used with `files`, `sequences` or `fields`, not with a `grid`"
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
        shocks, choice = section.file("sequences"), _choice(section)
        return SequenceFile(shocks, choice, section.read("rest")) if shocks else None
    section.refuse(("rest",), "can only be used with `sequences`")
    # If all four sources of ground motions are missing, the error names the usual one, `files`.
    files = section.get("files")
    if not (files or are_listed):
        section.need("files", "give a list of files and directories, or a `grid` instead")
    items = (
        files.items("a list of files and directories", "is empty; give at least one record")
        if files
        else None
    )
    pairs, component = section.get("pairs"), section.get("component")
    both = _pair_names(pairs) if pairs else None
    if both and component:
        component.fault("cannot be used with `pairs`, which use both components; remove one key")
    return RecordFiles(
        tuple(file for item in items or () if (file := item.file())), _choice(section), both
    )


def _pair_names(value: Value) -> PairNames | None:
    """Return the naming scheme of pairs; None without pairs or after an error."""
    if "{}" in value.word:
        return value.parsed(PairNames.parse)
    return USUAL if value.boolean() else None


def _choice(section: Section) -> RecordChoice:
    """Return the selection of components and the processing of the records."""
    choice, units = read_choice(section, stdin=False, many=True), section.get("units")
    if units and choice.inventory and isinstance(choice.units, str):
        units.fault("cannot be used with `inventory`, which states the units; remove one key")
    return choice


def _fields(section: Section) -> FieldFile | None:
    """Read the keys of fields; None after an error."""
    file, sites, pairs = section.file("fields"), section.file("sites"), section.get("pairs")
    both, component = pairs.boolean() if pairs else False, section.get("component")
    if both and component:
        component.fault("cannot be used with `pairs`, which use both components; remove one key")
    # Distances require the locations of sites.
    if not sites:
        section.refuse(
            ("distance", "max_distance"),
            "has no effect without `sites`; specify `sites` or remove it",
        )
    choice, distance = _choice(section), section.read("distance", "km")
    return (
        FieldFile(
            file, choice, both, sites, distance, read_max_distance(section), section.file("rates")
        )
        if file
        else None
    )


def _grid(section: Section, units: str | None) -> GridFile | None:
    """Read the keys of a grid; None after an error."""
    file, distance = section.file("grid"), section.read("distance", "km")
    # With `events`, all events are run, so that keys of the sampling would have no effect.
    if section.read("events"):
        section.refuse(
            ("neighbors", "samples", "seed"),
            "cannot be used with `events`, which are not sampled; remove it",
        )
        largest = read_max_distance(section)
        return GridFile(file, units, 1, 0, 0, distance, True, largest) if file and units else None
    neighbors = section.need("neighbors", "give the number of grid points to sample from")
    samples = section.need("samples", "give the number of samples for each building")
    if file is None or units is None or neighbors is None or samples is None:
        return None
    return GridFile(
        file,
        units,
        neighbors.read(),
        samples.read(),
        section.read("seed", 0),
        distance,
        max_distance=read_max_distance(section),
    )


# ---- Reader

_TOLERANCE = Bounds(0.0, 1.0, low_allowed=False, high_allowed=False, ratio=True)
_MIN_LEVEL, _MAX_LEVEL = 1e-6, 1e6
"""Range of intensities of ground motions, m/s^2 or m/s."""

_SCATTER = Bounds(0.0, 0.5, ratio=True)
_LENGTH = Choice(("m", "ft"), "length unit of inventories")
_UNITS = Keys(
    (
        Key(
            "length",
            _LENGTH,
            "length unit of the inventory; plan areas are in its square",
            needed=True,
            advice="give ft or m",
        ),
    ),
    make=lambda _, length: LENGTH[length],
)
_BUILDINGS = Keys(
    (
        Key("models", EntriesOf(Words(), least=1), "model files, relative to this file"),
        Key("inventory", Words(), "CSV file with a building per row, relative to this file"),
        Key("mapping", Words(), "CSV file of taxonomies: the inventory is an exposure model"),
        Key(
            "rules",
            Choice(tuple(RULES), "set of rules"),
            "rules that derive the buildings from their rows",
        ),
        Key(
            "classes", Words(), "CSV file with the capacity curves of classes, for rules: capacity"
        ),
        Key(
            "as_published",
            Flag(),
            "multiply forces by the factor of oq-vmtk 1.1, for rules: capacity",
        ),
        Key("units", _UNITS, "units of the inventory"),
        Key(
            "damping",
            Choice(("full", "mass-only"), "damping"),
            "mass-only omits the stiffness-proportional part",
        ),
        Key("stiffness_scatter", _SCATTER, "standard deviation of a factor on each stiffness"),
        Key("damping_scatter", _SCATTER, "standard deviation of a factor on each damping ratio"),
        Key("seed", SEED, "random seed of the factors"),
    ),
    one_of=(("models", "inventory"),),
)

_FIRST_PERIOD = "T1"


_INTENSITY = Keys(
    (
        Key("scales", EntriesOf(ANY, least=1), "scale factors of all motions"),
        Key("measure", Choice(levelled(), "measure"), "intensity measure of the levels"),
        Key(
            "period",
            Either((Choice((_FIRST_PERIOD,)), POSITIVE)),
            "period of sa and sa-avg, s; by default the first period of each building",
        ),
        Key("damping", RATIO, "damping ratio of sa and sa-avg; 5% by default"),
        Key("levels", EntriesOf(Words(), least=1), "values with units: 0.1 g, 0.2 m/s"),
        Key(
            "pair",
            Choice(tuple(PAIRS), "measure of pairs"),
            "combination of the two components of a pair",
        ),
        Key(
            "factors",
            Words(),
            "CSV file of `tdint scale`, relative to this file; without `files` of the records it "
            "also lists the records",
        ),
    ),
    one_of=(("scales", "measure", "factors"),),
)

_ANALYSIS = Keys(
    (
        Key("method", Words(), "time-integration method with its parameters, for all buildings"),
        Key(
            "methods",
            EntriesOf(Words(), least=1),
            "several methods, in all combinations with the other values",
        ),
        Key(
            "dt",
            Either((POSITIVE, EntriesOf(POSITIVE, 1, short="is empty; give at least one step"))),
            "time step, s, or a list in all combinations with the other values; by default the "
            "time step of each model, otherwise of each record",
        ),
        Key("duration", POSITIVE, "duration of the analysis, s"),
        Key(
            "tolerance",
            _TOLERANCE,
            "choose the time step of each building by the estimated error of its peak drifts",
        ),
        Key("collapse_drift", POSITIVE_RATIO, "drift ratio above which a run counts as collapsed"),
        Key("p_delta", Flag(), "include P-delta effects"),
        Key("until_rest", Flag(), "continue after the record until free vibration has decayed"),
        Key("check", Flag(), "estimate the errors of the demands: columns `<name>_error`"),
    )
)
_TABLES = ("runs", "damage", "losses", "stories", "profiles")
_OUTPUTS = Keys(
    (
        Key("stories", Flag(), "write the peaks of every story, stories.csv"),
        Key(
            "profiles",
            Flag(),
            "write the mean and fractiles of story peaks over the motions, profiles.csv; by "
            "default false for inventories",
        ),
    )
)
CAMPAIGN = Keys(
    (
        Key("name", Words(), "name of the campaign; by default the name of the file"),
        Key("buildings", _BUILDINGS, "model files, or an inventory", needed=True),
        Key(
            "records",
            MOTIONS,
            "files and directories, or a grid; by default the records of the table of factors",
        ),
        Key(
            "intensity",
            _INTENSITY,
            "scale factors or intensity levels of the motions; unscaled by default",
        ),
        Key("analysis", _ANALYSIS, "settings of all runs"),
        Key("vary", Varied(), "parameters of the buildings, in all combinations of their values"),
        Key("damage", DAMAGE, "damage states and losses of the buildings"),
        Key(
            "outputs",
            Either(
                (
                    _OUTPUTS,
                    EntriesOf(
                        Choice(_TABLES, "table"), 1, short="is empty; name at least one table"
                    ),
                )
            ),
            "tables in addition to the default tables, or a list of all tables to write",
        ),
        Key(
            "style",
            Words(),
            "style of the figures, as for --style: 90mm, or width=90mm,title=no",
        ),
    )
)
"""Keys of a campaign file."""


def campaign_schema() -> Schema:
    """Return the JSON schema (draft 7) of campaign files, for editors."""
    about = "Runs of buildings under ground motions for tdint"
    draft = "http://json-schema.org/draft-07/schema#"
    return {"$schema": draft, "title": "tdint campaign", "description": about, **CAMPAIGN.schema()}


def load_campaign(source: str | Path) -> CampaignFile:
    """Read a campaign file. The files that it names are not read.

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


def _read(section: Section, label: str, name: str) -> CampaignFile:
    """Return the campaign of the root section. Errors are recorded in the document.

    Parameters
    ----------
    section : Section
        Root section.
    label : str
        Path of the file, for messages.
    name : str
        Default name of the campaign.
    """
    buildings = section.need("buildings", "give `models` or an `inventory`")
    # The records of the table of factors are used if `records` is missing.
    intensity = section.get("intensity")
    are_listed = intensity is not None and intensity.peek("factors") is not None
    records = (
        section.get("records")
        if are_listed
        else section.need("records", "give `files` or a `grid`")
    )
    _check_together(section)
    analysis, stated = section.inner("analysis"), section.get("outputs")
    # A list names all tables to write. A mapping adds tables to the default tables.
    chosen = stated.read() if stated and stated.is_list else None
    outputs = stated.section(_OUTPUTS) if stated and not stated.is_list else None
    dt = analysis.get("dt")
    read_buildings = (_read_buildings(buildings) if buildings else None) or ModelFiles(())
    # Profiles are written by default for model files; for inventories they would be large.
    models = isinstance(read_buildings, ModelFiles)
    return CampaignFile(
        name=section.read("name") or name,
        source=label,
        buildings=read_buildings,
        records=(read_wanted_motions(records, are_listed=are_listed) if records else None)
        or RecordFiles((), RecordChoice()),
        intensity=_read_intensity(section.get("intensity")) or Scales((1.0,)),
        analysis=_read_analysis(analysis),
        settings=RunSettings(
            dt=dt.read() if dt and not dt.is_list else None,
            **analysis.given("duration", "tolerance", "until_rest", "check"),
            stories=outputs.read("stories", False) if outputs else "stories" in (chosen or ()),
            profiles=outputs.read("profiles", models)
            if outputs
            else "profiles" in (chosen or ("profiles",) * models),
        ),
        sweep=read_sweep(
            section.get("vary"),
            analysis.get("methods"),
            dt if dt and dt.is_list else None,
            models=models,
        ),
        damage=read_wishes(
            section.get("damage"),
            read_buildings.rules if isinstance(read_buildings, InventoryFile) else None,
        ),
        outputs=chosen,
        style=section.read("style") or "",
        pair_demand=_read_pair_demand(records),
    )


def _read_pair_demand(records: Value | None) -> str | None:
    """Return the rule that combines the components of pairs, or None if the file does not specify
    it."""
    value = records.peek("pair_demand") if records else None
    return value.word if value and value.word in PAIR_DEMANDS else None


def _check_together(section: Section) -> None:
    """Record errors for keys that have no effect with the motions of other keys."""
    records = section.get("records")

    def value_of(part: str, name: str) -> Value | None:
        """Return a value of a section, or None."""
        value = section.get(part)
        return value.peek(name) if value else None

    # The key `pair` of the intensity requires pairs of components. The files of a grid always
    # contain both components, so that the key `pairs` is not needed.
    pair, pairs = value_of("intensity", "pair"), value_of("records", "pairs")
    if pair and records and not records.peek("grid") and (pairs is None or pairs.is_word("false")):
        pair.fault("has no effect without `pairs: true` of the records; add it, or remove `pair`")
    # A duration would end a sequence before its last event has ended.
    if (duration := value_of("analysis", "duration")) and value_of("records", "sequences"):
        duration.fault(
            "cannot be used with `sequences`, which use complete records; the time between them is "
            "`rest`"
        )
    for name in ("measure", "factors"):
        if (entry := value_of("intensity", name)) and (
            value_of("records", "fields") or value_of("records", "events")
        ):
            entry.fault(
                "cannot be used with events, which have scale factors; use `scales` to multiply "
                "these factors"
            )


def _read_analysis(section: Section) -> AnalysisWishes:
    """Read the analysis settings that replace settings of models."""
    method = section.get("method")
    named = method.parsed(parse_method) if method else None
    if method and section.has("methods"):
        method.fault("cannot be used with `methods`; remove one of them")
    return AnalysisWishes(
        named.label if named else None, **section.given("collapse_drift", "p_delta")
    )


def _read_buildings(value: Value) -> ModelFiles | InventoryFile | None:
    """Return model files or an inventory; None after an error."""
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
    # Model files specify the values of the other keys.
    section.refuse(_BUILDINGS[2:], "can only be used with an `inventory`")
    items = models.items("a list of model files", "is empty; give at least one model file")
    return ModelFiles(tuple(file for item in items or () if (file := item.file())))


def _inventory(section: Section, inventory: Value) -> InventoryFile | None:
    """Read the keys of an inventory; None after an error."""
    file = inventory.file()
    name = section.read("rules", next(iter(RULES)))
    units = section.need("units", "give {length: ft} or {length: m}; plan areas are in its square")
    unit = units.read() if units else None
    damping, classes = section.read("damping"), section.file("classes")
    numbers = section.given("stiffness_scatter", "damping_scatter", "seed", "as_published")
    # Rules by capacity curves require another table and have no scatter.
    if name == CAPACITY:
        section.need("classes", "give the CSV file of the classes (class, sd_m, sa_g)")
        section.refuse(
            ("damping", "stiffness_scatter", "damping_scatter", "seed"),
            f"cannot be used with the rules {CAPACITY}; remove it",
        )
    else:
        section.refuse(("classes", "as_published"), f"can only be used with the rules {CAPACITY}")
    if file is None or name is None or unit is None:
        return None
    return InventoryFile(
        file,
        name,
        unit,
        mass_only=damping == "mass-only",
        classes=classes,
        mapping=section.file("mapping"),
        **numbers,
    )


def _read_intensity(value: Value | None) -> Scales | MeasureLevels | FactorsFile | None:
    """Return factors, levels of a measure, or a file of factors; None if the key is missing or
    after an error."""
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
        return FactorsFile(file) if file else None
    factors = section.get("scales")
    items = (
        factors.items("a list of factors", "is empty; give at least one factor")
        if factors
        else None
    )
    # Duplicate factors are ignored, because they would repeat the same run.
    numbers: dict[float, None] = {}
    for item in items or ():
        factor = item.number(ANY)
        if factor == 0.0:
            item.fault("a scale factor must not be zero")
        numbers[factor] = None
    return Scales(tuple(numbers))


def _levels(section: Section) -> MeasureLevels | None:
    """Read levels of an intensity measure; None after an error."""
    named = section.get("measure")
    # For some measures, levels cannot be reached by scaling.
    if named and (reason := without_levels(named.word)):
        named.fault(f"{named.word} cannot be used for levels: {reason}")
        return None
    name, pair = section.read("measure"), section.read("pair", GEOMETRIC_MEAN)
    damping = section.number("damping", default=0.05)
    levels = section.need("levels", "give the values, such as [0.1 g, 0.2 g]")
    empty = "is empty; give at least one value"
    items = levels.items("a list of values with their unit", empty) if levels else None
    if name is None:
        return None
    # The levels in the file have a unit. The accepted units depend on the intensity measure, for
    # example units of acceleration for sa.
    unit = measure_at(name, damping, 1.0).unit
    quantity = next(
        (name for name, units in GROUND_MOTION.items() if units.get(unit) == 1.0), "acceleration"
    )
    values = tuple(dict.fromkeys(_level(item, quantity) for item in items or ()))

    # The default period of a spectral measure is the first period of each building.
    period, stated = None, section.get("period")
    if name not in SPECTRAL:
        period = 1.0
        if stated:
            stated.fault(f"cannot be used with the measure {name}, which has no period; remove it")
    elif stated and not stated.is_word(_FIRST_PERIOD):
        seconds = stated.number(
            POSITIVE, expected=f"{_FIRST_PERIOD} or a positive number of seconds"
        )
        period = None if math.isnan(seconds) else seconds
    return MeasureLevels(partial(measure_at, name, damping), period, values, pair)


def _level(value: Value, quantity: str) -> float:
    """Return a value with a unit in SI; NaN after an error."""
    example = {"acceleration": "0.1 g", "velocity": "0.2 m/s"}.get(quantity, "0.1 m")

    def level(text: str) -> float:
        """Convert the text of a level to SI."""
        try:
            units = parse_units(text)
        except UsageError:
            raise UsageError(
                f"must be a positive number with its unit, such as {example}, got {text!r}"
            ) from None
        # A unit without a number is not a level.
        if units.quantity != quantity or not units.has_factor:
            raise UsageError(
                f"must be a number with a unit of {quantity}, such as {example}, got {text!r}"
            )
        if not _MIN_LEVEL <= units.scale <= _MAX_LEVEL:
            raise UsageError(
                f"must be from {_MIN_LEVEL:g} to {_MAX_LEVEL:g} in SI units, got {text!r}"
            )
        return units.scale

    return value.parsed(level) or math.nan
