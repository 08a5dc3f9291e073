"""Campaign files: YAML to a checked `CampaignFile`, with the same reader as models; nothing else is
opened."""

from __future__ import annotations

import math
import re
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
from tdint.campaign.motions import COORDINATES, MAX_DISTANCE, GridFile, MeasureLevels, Scales
from tdint.campaign.pairs import PAIR_DEMANDS
from tdint.csv_table import number
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

# ---- What a campaign file says of its ground motions, under `records`: files, sequences, fields or
# a grid

SEED = Whole(0, 2**31 - 1)
_FILES = (
    Key(
        "files",
        EntriesOf(Words(), least=1),
        "records and folders of records, relative to this file",
    ),
    Key(
        "component", Words(), "component, where files hold several; all horizontal ones without it"
    ),
    Key(
        "pairs",
        Either((Flag(), Words())),
        "take the two horizontals of a motion together: they share their factors; true, or how the "
        "files are named: '{}_N.AT2,{}_E.AT2'",
    ),
    Key("inventory", Words(), "station metadata, to remove the instrument's response"),
    *LAYOUT,
    *PROCESSING,
)
_GRID = (
    Key("grid", Words(), "EventGrid.csv, relative to this file"),
    Key("neighbors", Whole(1, 1000), "grid points among which each building draws"),
    Key("samples", Whole(1, 100_000), "draws for each building"),
    Key("seed", SEED, "what is drawn from, with the building's id"),
    Key(
        "events",
        Flag(),
        "nothing is drawn: the rows of the points' files are events, those of the nearest point "
        "count",
    ),
)
_FIELDS = (
    Key(
        "fields",
        Words(),
        "CSV file of what each event does (event, site, record, factor), relative to this file",
    ),
    Key(
        "sites",
        Words(),
        "CSV file of the sites' places (site, longitude, latitude), relative to this file",
    ),
    Key(
        "rates",
        Words(),
        "CSV file of how often the events come in a year (event, rate), relative to this file",
    ),
)
_BY_DISTANCE = Choice(tuple(COORDINATES), "distance")
_DISTANCE = Key("distance", _BY_DISTANCE, "what is near: in km, or in degrees as SimCenter has it")
_LARGEST = Key(
    "max_distance",
    Either((POSITIVE, Words())),
    "km on the earth, buildings whose nearest site is farther away are left out; 15 by default",
)
_SEQUENCES = (
    Key(
        "sequences",
        Words(),
        "CSV file of shocks (sequence, record, component, factor), relative to this file",
    ),
    Key(
        "rest",
        Bounds(0.0),
        "seconds from the end of a shock to the next; until rest where it is left out",
    ),
)
_FILE_KEYS, _GRID_KEYS, _FIELD_KEYS, _SEQUENCE_KEYS = (
    tuple(key.name for key in keys) for keys in (_FILES, _GRID, _FIELDS, _SEQUENCES)
)
_SAMPLE_UNITS = Key(
    "units",
    Words(),
    "units of the samples, where the files do not say them: m/s^2, g, ...; by file "
    "'AT2=g,*.mseed=m/s^2', or a table of them, relative to this file",
)
_PAIR_DEMAND = Key(
    "pair_demand",
    Choice(PAIR_DEMANDS, "demand of pairs"),
    "how the two horizontal components of a recording count: as one motion with the larger (by "
    "default) or the mean demand, or each as a motion of its own",
)
MOTIONS = Keys(
    (*_FILES, *_SEQUENCES, *_FIELDS, *_GRID, _DISTANCE, _LARGEST, _SAMPLE_UNITS, _PAIR_DEMAND),
)
"""The keys of `records`, and their values. One of files, sequences, fields and grid is required
unless the intensity is a table of factors, which lists the records."""


def read_wanted_motions(
    value: Value, *, are_listed: bool = False
) -> RecordFiles | SequenceFile | GridFile | FieldFile | None:
    """Return files, sequences, fields or a grid; None after a fault.

    `are_listed`: without any of these the records are those of a table of factors.
    """
    section = value.section()
    if section is None:
        return None
    section.read("pair_demand")  # its value is used in `read_campaign`; errors are found here
    # Each way has its own keys: those of another one would be without effect, and are told.
    if section.has("grid"):
        others = (*_FILE_KEYS, *_SEQUENCE_KEYS, *_FIELD_KEYS)
        section.refuse(others, "belongs to `files`, `sequences` or `fields`, not to a `grid`")
        section.need("units", "give the units of the grid's motions, such as g or m/s^2")
        return _grid(section, read_sample_units(section.get("units")))
    section.refuse(_GRID_KEYS, "belongs to a `grid`")
    if section.has("fields"):
        section.refuse(("files", *_SEQUENCE_KEYS), "has no part in `fields`")
        return _fields(section)
    section.refuse(("sites", "rates"), "belongs to `fields`")
    section.refuse(("distance", "max_distance"), "belongs to `fields` or a `grid`")
    if section.has("sequences"):
        section.refuse(("files", "pairs"), "has no part in `sequences`")
        shocks, choice = section.file("sequences"), _choice(section)
        return SequenceFile(shocks, choice, section.read("rest")) if shocks else None
    section.refuse(("rest",), "belongs to `sequences`")
    # Files are the usual way: without any of the four these are asked for.
    files = section.get("files")
    if not (files or are_listed):
        section.need("files", "give a list of files and folders, or a `grid` in its place")
    items = (
        files.items("a list of files and folders", "is empty; give at least one record")
        if files
        else None
    )
    pairs, component = section.get("pairs"), section.get("component")
    both = _pair_names(pairs) if pairs else None
    if both and component:
        component.fault("pairs have both horizontal components; leave one of the two out")
    return RecordFiles(
        tuple(file for item in items or () if (file := item.file())), _choice(section), both
    )


def _pair_names(value: Value) -> PairNames | None:
    """How pairs are named; None for no pairs, or after a fault."""
    if "{}" in value.word:
        return value.parsed(PairNames.parse)
    return USUAL if value.boolean() else None


def _choice(section: Section) -> RecordChoice:
    """What is taken of each file, and what is done to it."""
    choice, given = read_choice(section, stdin=False, many=True), section.get("units")
    if given and choice.inventory and isinstance(choice.units, str):
        given.fault("an inventory gives the units; leave one of the two out")
    return choice


def _fields(section: Section) -> FieldFile | None:
    file, sites, pairs = section.file("fields"), section.file("sites"), section.get("pairs")
    both, component = pairs.boolean() if pairs else False, section.get("component")
    if both and component:
        component.fault("pairs have both horizontal components; leave one of the two out")
    # Only where sites have places is there something to be near to.
    if not sites:
        section.refuse(("distance", "max_distance"), "has nothing to act on without `sites`")
    choice, distance = _choice(section), section.read("distance", "km")
    return (
        FieldFile(file, choice, both, sites, distance, _largest(section), section.file("rates"))
        if file
        else None
    )


def _largest(section: Section) -> float:
    """The largest distance of a building from its site, m."""
    value = section.get("max_distance")
    return (value.parsed(_meters) if value else None) or MAX_DISTANCE


def _meters(text: str) -> float:
    """A distance, a number of km or with its unit, in m."""
    match = re.fullmatch(r"\s*([0-9.eE+]+)\s*(km|m)?\s*", text)
    meters = number(match[1]) * (1.0 if match[2] == "m" else 1e3) if match else math.nan
    if not meters > 0.0:
        raise UsageError(
            f"must be a positive distance in km, such as 15 or 800 m, got {text!r:.40}"
        )
    return meters


def _grid(section: Section, units: str | None) -> GridFile | None:
    file, distance = section.file("grid"), section.read("distance", "km")
    # Rows as events are all done: numbers and seed of draws would be without effect.
    if section.read("events"):
        section.refuse(
            ("neighbors", "samples", "seed"), "has no part in `events`, of which nothing is drawn"
        )
        largest = _largest(section)
        return GridFile(file, units, 1, 0, 0, distance, True, largest) if file and units else None
    neighbors = section.need("neighbors", "give the number of grid points among which is drawn")
    samples = section.need("samples", "give the number of draws for each building")
    if file is None or units is None or neighbors is None or samples is None:
        return None
    return GridFile(
        file,
        units,
        neighbors.read(),
        samples.read(),
        section.read("seed", 0),
        distance,
        max_distance=_largest(section),
    )


# ---- Reader

_TOLERANCE = Bounds(0.0, 1.0, low_allowed=False, high_allowed=False, ratio=True)
_LEAST_LEVEL, _MOST_LEVEL = 1e-6, 1e6
"""Of an intensity, m/s^2 or m/s: beyond them lies no ground motion."""

_SCATTER = Bounds(0.0, 0.5, ratio=True)
_LENGTH = Choice(("m", "ft"), "length unit of inventories")
_UNITS = Keys(
    (
        Key(
            "length",
            _LENGTH,
            "of the inventory; plan areas are in its square",
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
        Key(
            "rules",
            Choice(tuple(RULES), "set of rules"),
            "by which the buildings follow from their rows",
        ),
        Key("classes", Words(), "CSV file of the classes' capacity curves, for the rules capacity"),
        Key(
            "as_published",
            Flag(),
            "multiply forces by the factor of oq-vmtk 1.1, for the rules capacity",
        ),
        Key("units", _UNITS, "units of the inventory"),
        Key(
            "damping",
            Choice(("full", "mass-only"), "damping"),
            "mass-only leaves out the stiffness-proportional part",
        ),
        Key("stiffness_scatter", _SCATTER, "standard deviation of a factor on each stiffness"),
        Key("damping_scatter", _SCATTER, "standard deviation of a factor on each damping ratio"),
        Key("seed", SEED, "what the factors are drawn from"),
    ),
    one_of=(("models", "inventory"),),
)

_FIRST = "T1"


_INTENSITY = Keys(
    (
        Key("scales", EntriesOf(ANY, least=1), "factors on all motions"),
        Key("measure", Choice(levelled(), "measure"), "intensity measure that takes the levels"),
        Key(
            "period",
            Either((Choice((_FIRST,)), POSITIVE)),
            "of sa and sa-avg; that of each building by default",
        ),
        Key("damping", RATIO, "damping ratio of sa and sa-avg; 5% by default"),
        Key("levels", EntriesOf(Words(), least=1), "values with their unit: 0.1 g, 0.2 m/s"),
        Key(
            "pair",
            Choice(tuple(PAIRS), "measure of pairs"),
            "what stands for the two components of a pair",
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
        Key("methods", EntriesOf(Words(), least=1), "several methods, each with all the rest"),
        Key(
            "dt",
            Either((POSITIVE, EntriesOf(POSITIVE, 1, short="is empty; give at least one step"))),
            "time step, s, or several, each with all the rest; that of each model, else of each "
            "record, without it",
        ),
        Key("duration", POSITIVE, "time to integrate, s"),
        Key(
            "tolerance",
            _TOLERANCE,
            "choose the step of each building by the error of its peak drifts",
        ),
        Key("collapse_drift", POSITIVE_RATIO, "drift ratio beyond which a run counts as collapsed"),
        Key("p_delta", Flag(), "whether gravity acts on the displaced buildings"),
        Key("until_rest", Flag(), "go on with the ground at rest until the motion has died"),
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
            "write their mean and fractiles over the motions, profiles.csv; false for inventories",
        ),
    )
)
CAMPAIGN = Keys(
    (
        Key("name", Words(), "the campaign's name; that of the file where it is left out"),
        Key("buildings", _BUILDINGS, "model files, or an inventory", needed=True),
        Key(
            "records",
            MOTIONS,
            "files and folders, or a grid; by default the records of the table of factors",
        ),
        Key(
            "intensity",
            _INTENSITY,
            "how strong the motions are made; as they are where it is left out",
        ),
        Key("analysis", _ANALYSIS, "what is the same for all runs"),
        Key("vary", Varied(), "parameters of the buildings, each value with all the others"),
        Key("damage", DAMAGE, "damage states of the buildings, and what they cost"),
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
            "what is written beside a row for each run, or a list of all that is written",
        ),
        Key(
            "style",
            Words(),
            "looks of the pictures, as --style has them: 90mm, or width=90mm,title=no",
        ),
    )
)
"""The keys of a campaign file, and what may stand under them."""


def campaign_schema() -> Schema:
    """The JSON schema (draft 7) of campaign files, for editors."""
    about = "Runs of buildings under ground motions for tdint"
    draft = "http://json-schema.org/draft-07/schema#"
    return {"$schema": draft, "title": "tdint campaign", "description": about, **CAMPAIGN.schema()}


def load_campaign(source: str | Path) -> CampaignFile:
    """Read a campaign file; the files that it names are not read yet.

    Parameters
    ----------
    source : str or Path
        The YAML file; `-` is standard input. Relative paths in it start from its folder.

    Raises
    ------
    ModelError
        It cannot be read, is not YAML, or has faults: all of them, with line and column.
    """
    origin, root = read_document(source, "campaign file", "`buildings` and `records`")
    section = root.section(CAMPAIGN)
    campaign = _read(section, origin.label, origin.name) if section else None
    root.faults.raise_if_any()
    assert campaign is not None
    return campaign


def _read(section: Section, label: str, name: str) -> CampaignFile:
    buildings = section.need("buildings", "give `models` or an `inventory`")
    # Without records those of the table of factors are used.
    intensity = section.get("intensity")
    are_listed = intensity is not None and intensity.peek("factors") is not None
    records = (
        section.get("records")
        if are_listed
        else section.need("records", "give `files` or a `grid`")
    )
    _check_together(section)
    analysis, stated = section.inner("analysis"), section.get("outputs")
    # A list chooses all tables that are written, keys add to what is usual.
    chosen = stated.read() if stated and stated.is_list else None
    outputs = stated.section(_OUTPUTS) if stated and not stated.is_list else None
    dt = analysis.get("dt")
    read_buildings = (_read_buildings(buildings) if buildings else None) or ModelFiles(())
    # Profiles come by default for single models; of inventories they would be large.
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
    """Return how the components of pairs count, None if the file does not choose."""
    value = records.peek("pair_demand") if records else None
    return value.word if value and value.word in PAIR_DEMANDS else None


def _check_together(section: Section) -> None:
    """What one part asks for and the motions of another leave without effect."""
    records = section.get("records")

    def said(part: str, name: str) -> Value | None:
        value = section.get(part)
        return value.peek(name) if value else None

    # Of a grid pairs may be without the key: its files have both components.
    pair, pairs = said("intensity", "pair"), said("records", "pairs")
    if pair and records and not records.peek("grid") and (pairs is None or pairs.is_word("false")):
        pair.fault("has nothing to act on without `pairs: true` of the records")
    # A sequence has its own end: that of its last shock.
    if (duration := said("analysis", "duration")) and said("records", "sequences"):
        duration.fault(
            "is not for `sequences`, which have all of each record; `rest` of the records is in "
            "between"
        )
    for name in ("measure", "factors"):
        if (entry := said("intensity", name)) and (
            said("records", "fields") or said("records", "events")
        ):
            entry.fault("has no part in events, whose factors are given; `scales` multiply them")


def _read_analysis(section: Section) -> AnalysisWishes:
    method = section.get("method")
    named = method.parsed(parse_method) if method else None
    if method and section.has("methods"):
        method.fault("stands in place of `methods`; give one of the two")
    return AnalysisWishes(
        named.label if named else None, **section.given("collapse_drift", "p_delta")
    )


def _read_buildings(value: Value) -> ModelFiles | InventoryFile | None:
    """Model files or an inventory; None after a fault."""
    section = value.section()
    if section is None:
        return None
    models, inventory = section.get("models"), section.get("inventory")
    if models and inventory:
        inventory.fault("stands in place of `models`; give one of the two")
        return None
    if inventory:
        return _inventory(section, inventory)
    if models is None:
        section.need("models", "give a list of model files, or an inventory in its place")
        return None
    # Models bring what the keys of an inventory say.
    section.refuse(_BUILDINGS[2:], "belongs to an `inventory`")
    items = models.items("a list of model files", "is empty; give at least one model file")
    return ModelFiles(tuple(file for item in items or () if (file := item.file())))


def _inventory(section: Section, inventory: Value) -> InventoryFile | None:
    file = inventory.file()
    name = section.read("rules", next(iter(RULES)))
    units = section.need("units", "give {length: ft} or {length: m}; plan areas are in its square")
    unit = units.read() if units else None
    kind, classes = section.read("damping"), section.file("classes")
    numbers = section.given("stiffness_scatter", "damping_scatter", "seed", "as_published")
    # Rules by capacity curves read another table and know no scatter.
    if name == CAPACITY:
        section.need("classes", "give the CSV file of the classes (class, sd_m, sa_g)")
        section.refuse(
            ("damping", "stiffness_scatter", "damping_scatter", "seed"),
            f"has no part in {CAPACITY}",
        )
    else:
        section.refuse(("classes", "as_published"), f"belongs to the rules {CAPACITY}")
    if file is None or name is None or unit is None:
        return None
    return InventoryFile(
        file, name, unit, mass_only=kind == "mass-only", classes=classes, **numbers
    )


def _read_intensity(value: Value | None) -> Scales | MeasureLevels | FactorsFile | None:
    """Factors, levels of a measure, or a file of factors; None without any, or after a fault."""
    section = value.section() if value else None
    if value is None or section is None:
        return None
    # One way at a time: levels of a measure make the factors that the others give.
    ways = [name for name in ("scales", "measure", "factors") if section.has(name)]
    if len(ways) != 1:
        value.fault(
            "give one of scales, measure and factors"
            + (f", not {' and '.join(ways)}" if ways else "")
        )
        return None
    if ways == ["measure"]:
        return _levels(section)
    section.refuse(("period", "damping", "levels", "pair"), "belongs to a `measure`")
    if ways == ["factors"]:
        file = section.file("factors")
        return FactorsFile(file) if file else None
    factors = section.get("scales")
    items = (
        factors.items("a list of factors", "is empty; give at least one factor")
        if factors
        else None
    )
    # A factor twice would be the same run twice.
    numbers: dict[float, None] = {}
    for item in items or ():
        factor = item.number(ANY)
        if factor == 0.0:
            item.fault("must not be zero")
        numbers[factor] = None
    return Scales(tuple(numbers))


def _levels(section: Section) -> MeasureLevels | None:
    named = section.get("measure")
    # Of some measures no factor leads to a level.
    if named and (reason := without_levels(named.word)):
        named.fault(f"{named.word}: {reason}; no level can be asked of it")
        return None
    name, pair = section.read("measure"), section.read("pair", GEOMETRIC_MEAN)
    damping = section.number("damping", default=0.05)
    levels = section.need("levels", "give the values, such as [0.1 g, 0.2 g]")
    empty = "is empty; give at least one value"
    items = levels.items("a list of values with their unit", empty) if levels else None
    if name is None:
        return None
    # Each level has its unit in the file: what it must be a unit of hangs on the measure.
    unit = measure_at(name, damping, 1.0).unit
    quantity = next(
        (one for one, units in GROUND_MOTION.items() if units.get(unit) == 1.0), "acceleration"
    )
    values = tuple(dict.fromkeys(_level(item, quantity) for item in items or ()))

    # The period of a spectral measure, by default that of each building; others have none.
    period, stated = None, section.get("period")
    if name not in SPECTRAL:
        period = 1.0
        if stated:
            stated.fault(f"{name} has no period")
    elif stated and not stated.is_word(_FIRST):
        seconds = stated.number(POSITIVE, expected=f"{_FIRST} or a positive number of seconds")
        period = None if math.isnan(seconds) else seconds
    return MeasureLevels(partial(measure_at, name, damping), period, values, pair)


def _level(value: Value, quantity: str) -> float:
    """A value with its unit in SI; nan after a fault."""
    example = {"acceleration": "0.1 g", "velocity": "0.2 m/s"}.get(quantity, "0.1 m")

    def level(text: str) -> float:
        try:
            units = parse_units(text)
        except UsageError:
            raise UsageError(
                f"must be a positive number with its unit, such as {example}, got {text!r}"
            ) from None
        # A bare unit is no value: its factor is the level.
        if units.quantity != quantity or not units.has_factor:
            raise UsageError(
                f"must be a number with a unit of {quantity}, such as {example}, got {text!r}"
            )
        if not _LEAST_LEVEL <= units.scale <= _MOST_LEVEL:
            raise UsageError(
                f"must be from {_LEAST_LEVEL:g} to {_MOST_LEVEL:g} in SI units, got {text!r}"
            )
        return units.scale

    return value.parsed(level) or math.nan
