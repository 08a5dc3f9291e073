"""Ground motions of a campaign file: the key `records` with files, sequences, ground motion fields
or a grid."""

from __future__ import annotations

from tdint.model.config.record_files import FILES, UNITS, choice_of_files, read_files
from tdint.model.config.sections import read_sample_units
from tdint.model.keys.fields import (
    POSITIVE,
    Bounds,
    Choice,
    Either,
    Flag,
    Integer,
    Key,
    Keys,
    Section,
    TextLine,
    Value,
)
from tdint.studies.campaign.assigned_motions import COORDINATES, GridFile, read_max_distance
from tdint.studies.campaign.definition import FieldFile, RecordFiles, SequenceFile
from tdint.studies.motions.pairs import PAIR_DEMANDS

SEED = Integer(0, 2**31 - 1)
_GRID = (
    Key("grid", TextLine(), "EventGrid.csv, relative to this file"),
    Key("neighbors", Integer(1, 1000), "number of nearest grid points to sample from"),
    Key("samples", Integer(1, 100_000), "number of samples for each building"),
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
        TextLine(),
        "CSV file with the motion of each event (event, site, record, factor), relative to this "
        "file",
    ),
    Key(
        "sites",
        TextLine(),
        "CSV file with the locations of the sites (site, longitude, latitude), relative to this "
        "file",
    ),
    Key(
        "rates",
        TextLine(),
        "CSV file with the annual rate of each event (event, rate), relative to this file",
    ),
)
_DISTANCE = Key(
    "distance",
    Choice(tuple(COORDINATES), "distance"),
    "unit of distances to sites: km, or degrees as in SimCenter",
)
_MAX_DISTANCE = Key(
    "max_distance",
    Either((POSITIVE, TextLine())),
    "km; buildings at a larger distance from the nearest site are omitted; 15 by default",
)
_SEQUENCES = (
    Key(
        "sequences",
        TextLine(),
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
    tuple(key.name for key in keys) for keys in (FILES, _GRID, _FIELDS, _SEQUENCES)
)
_PAIR_DEMAND = Key(
    "pair_demand",
    Choice(PAIR_DEMANDS, "demand of pairs"),
    "demand of the two horizontal components of a recording: the larger (default) or the mean "
    "demand of one motion, or separate for two motions",
)
MOTIONS = Keys(
    (*FILES, *_SEQUENCES, *_FIELDS, *_GRID, _DISTANCE, _MAX_DISTANCE, UNITS, _PAIR_DEMAND),
)
"""Keys of `records`. One of files, sequences, fields and grid is required unless the intensity is a
table of factors, which lists the records."""


def read_requested_motions(
    value: Value, *, are_listed: bool = False
) -> RecordFiles | SequenceFile | GridFile | FieldFile | None:
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
        return SequenceFile(sequence_file, choice, section.read("rest")) if sequence_file else None
    section.refuse(("rest",), "can only be used with `sequences`")
    # If all four sources of ground motions are missing, the error names the usual one, `files`.
    files = section.get("files")
    if not (files or are_listed):
        section.need("files", "give a list of files and directories, or a `grid` instead")
    described = read_files(section)
    return RecordFiles(described.files, described.choice, described.pairs)


def _fields(section: Section) -> FieldFile | None:
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


def _grid(section: Section, units: str | None) -> GridFile | None:
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
