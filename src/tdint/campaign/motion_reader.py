"""What a campaign file says of its ground motions, under `records`: files, sequences, fields or a grid."""

from __future__ import annotations

from tdint.campaign.definition import FieldFile, RecordFiles, SequenceFile
from tdint.campaign.motions import COORDINATES, GridFile
from tdint.ground_motion.pairing import USUAL, PairNames
from tdint.ground_motion.processing import RecordChoice
from tdint.model.config.excitation import LAYOUT, PROCESSING, read_choice
from tdint.model.config.units import read_sample_units
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import Bounds, Choice, Either, EntriesOf, Flag, Key, Keys, Whole, Words

SEED = Whole(0, 2**31 - 1)
_FILES = (
    Key("files", EntriesOf(Words(), least=1), "records and folders of records, relative to this file"),
    Key("component", Words(), "component, where files hold several; all horizontal ones without it"),
    Key(
        "pairs",
        Either((Flag(), Words())),
        "take the two horizontals of a motion together: they share their factors; true, or how the files are named: "
        "'{}_N.AT2,{}_E.AT2'",
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
        "events", Flag(), "nothing is drawn: the rows of the points' files are events, those of the nearest point count"
    ),
)
_FIELDS = (
    Key("fields", Words(), "CSV file of what each event does (event, site, record, factor), relative to this file"),
    Key("sites", Words(), "CSV file of the sites' places (site, longitude, latitude), relative to this file"),
)
_BY_DISTANCE = Choice(tuple(COORDINATES), "distance")
_DISTANCE = Key("distance", _BY_DISTANCE, "what is near: in km, or in degrees as SimCenter has it")
_SEQUENCES = (
    Key("sequences", Words(), "CSV file of shocks (sequence, record, component, factor), relative to this file"),
    Key("rest", Bounds(0.0), "seconds from the end of a shock to the next; until rest where it is left out"),
)
_FILE_KEYS, _GRID_KEYS, _FIELD_KEYS, _SEQUENCE_KEYS = (
    tuple(key.name for key in keys) for keys in (_FILES, _GRID, _FIELDS, _SEQUENCES)
)
_SAMPLE_UNITS = Key("units", Words(), "units of the samples, where the files do not say them: m/s^2, g, ...")
MOTIONS = Keys(
    (*_FILES, *_SEQUENCES, *_FIELDS, *_GRID, _DISTANCE, _SAMPLE_UNITS),
    one_of=(("files", "sequences", "fields", "grid"),),
)
"""The keys of `records`, and what may stand under them."""


def read_wanted_motions(value: Value) -> RecordFiles | SequenceFile | GridFile | FieldFile | None:
    """Files, sequences, fields or a grid; None after a fault."""
    section = value.section()
    if section is None:
        return None
    if section.has("grid"):
        others = (*_FILE_KEYS, *_SEQUENCE_KEYS, *_FIELD_KEYS)
        section.refuse(others, "belongs to `files`, `sequences` or `fields`, not to a `grid`")
        section.need("units", "give the units of the grid's motions, such as g or m/s^2")
        return _grid(section, read_sample_units(section.get("units")))
    section.refuse(_GRID_KEYS, "belongs to a `grid`")
    if section.has("fields"):
        section.refuse(("files", *_SEQUENCE_KEYS), "has no part in `fields`")
        return _fields(section)
    section.refuse(("sites", "distance"), "belongs to `fields`" + " or a `grid`" * section.has("distance"))
    if section.has("sequences"):
        section.refuse(("files", "pairs"), "has no part in `sequences`")
        shocks, choice = section.file("sequences"), _choice(section)
        return SequenceFile(shocks, choice, section.read("rest")) if shocks else None
    section.refuse(("rest",), "belongs to `sequences`")
    files = section.need("files", "give a list of files and folders, or a `grid` in its place")
    items = files.items("a list of files and folders", "is empty; give at least one record") if files else None
    pairs, component = section.get("pairs"), section.get("component")
    both = _pair_names(pairs) if pairs else None
    if both and component:
        component.fault("pairs have both horizontal components; leave one of the two out")
    return RecordFiles(tuple(file for item in items or () if (file := item.file())), _choice(section), both)


def _pair_names(value: Value) -> PairNames | None:
    """How pairs are named; None for no pairs, or after a fault."""
    if "{}" in value.word:
        return value.parsed(PairNames.parse)
    return USUAL if value.boolean() else None


def _choice(section: Section) -> RecordChoice:
    """What is taken of each file, and what is done to it."""
    choice, given = read_choice(section, stdin=False), section.get("units")
    if given and choice.inventory:
        given.fault("an inventory gives the units; leave one of the two out")
    return choice


def _fields(section: Section) -> FieldFile | None:
    file, sites, pairs = section.file("fields"), section.file("sites"), section.get("pairs")
    both, component = pairs.boolean() if pairs else False, section.get("component")
    if both and component:
        component.fault("pairs have both horizontal components; leave one of the two out")
    if section.has("distance") and not sites:
        section.refuse(("distance",), "has nothing to act on without `sites`")
    choice, distance = _choice(section), section.read("distance", "km")
    return FieldFile(file, choice, both, sites, distance) if file else None


def _grid(section: Section, units: str | None) -> GridFile | None:
    file, distance = section.file("grid"), section.read("distance", "km")
    if section.read("events"):
        section.refuse(("neighbors", "samples", "seed"), "has no part in `events`, of which nothing is drawn")
        return GridFile(file, units, 1, 0, 0, distance, events=True) if file and units else None
    neighbors = section.need("neighbors", "give the number of grid points among which is drawn")
    samples = section.need("samples", "give the number of draws for each building")
    if file is None or units is None or neighbors is None or samples is None:
        return None
    return GridFile(file, units, neighbors.read(), samples.read(), section.read("seed", 0), distance)
