"""The `records` of a campaign file."""

from __future__ import annotations

from pathlib import Path

from tdint.campaign.file.buildings import SEED
from tdint.campaign.file.definition import GridFile, RecordFiles
from tdint.campaign.studies.suite import RecordChoice
from tdint.model.config.excitation import LAYOUT, PROCESSING, read_layout, read_processing
from tdint.model.config.units import read_sample_units
from tdint.model.keys.document import resolve
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import EntriesOf, Flag, Key, Keys, Whole, Words

_FILES = (
    Key("files", EntriesOf(Words(), least=1), "records and folders of records, relative to this file"),
    Key("component", Words(), "component, where files hold several; all horizontal ones without it"),
    Key("pairs", Flag(), "take the two horizontals of a motion together: they share their factors"),
    Key("inventory", Words(), "station metadata, to remove the instrument's response"),
    *LAYOUT,
    *PROCESSING,
)
_GRID = (
    Key("grid", Words(), "EventGrid.csv, relative to this file"),
    Key("neighbors", Whole(1, 1000), "grid points among which each building draws"),
    Key("samples", Whole(1, 100_000), "draws for each building"),
    Key("seed", SEED, "what is drawn from, with the building's id"),
)
_FILE_KEYS, _GRID_KEYS = (tuple(key.name for key in keys) for keys in (_FILES, _GRID))
_UNITS = Key("units", Words(), "units of the samples, where the files do not say them: m/s^2, g, ...")
RECORDS = Keys((*_FILES, *_GRID, _UNITS), one_of=(("files", "grid"),))


def read_records_section(value: Value, folder: Path) -> RecordFiles | GridFile | None:
    """Files or a grid; None after a fault."""
    section = value.section(RECORDS)
    if section is None:
        return None
    units = section.get("units")
    text = read_sample_units(units)
    if section.has("grid"):
        _refuse(section, _FILE_KEYS, "belongs to `files`, not to a `grid`")
        section.need("units", "give the units of the grid's motions, such as g or m/s^2")
        return _grid(section, text, folder)
    _refuse(section, _GRID_KEYS, "belongs to a `grid`")
    files = section.need("files", "give a list of files and folders, or a `grid` in its place")
    items = files.items("a list of files and folders") if files else None
    if files and items is not None and not items:
        files.fault("is empty; give at least one record")
    pairs, component, inventory = section.get("pairs"), section.get("component"), section.text("inventory")
    both = pairs.boolean() if pairs else False
    if both and component:
        component.fault("pairs have both horizontal components; leave one of the two out")
    if units and inventory:
        units.fault("an inventory gives the units; leave one of the two out")
    choice = RecordChoice(
        units=text,
        component=section.text("component"),
        inventory=resolve(inventory, folder) if inventory else None,
        processing=read_processing(section),
        layout=read_layout(section),
    )
    return RecordFiles(tuple(resolve(text, folder) for item in items or () if (text := item.text())), choice, both)


def _grid(section: Section, units: str | None, folder: Path) -> GridFile | None:
    file = section.text("grid")
    neighbors = section.need("neighbors", "give the number of grid points among which is drawn")
    samples = section.need("samples", "give the number of draws for each building")
    seed = section.get("seed")
    numbers = (
        neighbors.whole() if neighbors else None,
        samples.whole() if samples else None,
        seed.whole() if seed else 0,
    )
    if file is None or units is None or None in numbers:
        return None
    return GridFile(resolve(file, folder), units, *numbers)  # type: ignore[arg-type]


def _refuse(section: Section, names: tuple[str, ...], reason: str) -> None:
    for name in names:
        if entry := section.get(name):
            entry.fault(reason)
