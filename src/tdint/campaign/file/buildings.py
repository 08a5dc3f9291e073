"""The `buildings` of a campaign file."""

from __future__ import annotations

from pathlib import Path

from tdint.campaign.file.definition import InventoryFile, ModelFiles
from tdint.model.inventory.derive import RULES
from tdint.model.keys.document import resolve
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import Bounds, Choice, EntriesOf, Key, Keys, Whole, Words
from tdint.units import LENGTH

_SCATTER = Bounds(0.0, 0.5, ratio=True)
SEED = Whole(0, 2**31 - 1)
_LENGTHS = ("m", "ft")
_DAMPING = ("full", "mass-only")
_UNITS = Keys((Key("length", Choice(_LENGTHS), "of the inventory; plan areas are in its square", needed=True),))
BUILDINGS = Keys(
    (
        Key("models", EntriesOf(Words(), least=1), "model files, relative to this file"),
        Key("inventory", Words(), "CSV file with a building per row, relative to this file"),
        Key("rules", Choice(tuple(RULES)), "by which the buildings follow from their rows"),
        Key("units", _UNITS, "units of the inventory"),
        Key("damping", Choice(_DAMPING), "mass-only leaves out the stiffness-proportional part"),
        Key("stiffness_scatter", _SCATTER, "standard deviation of a factor on each stiffness"),
        Key("damping_scatter", _SCATTER, "standard deviation of a factor on each damping ratio"),
        Key("seed", SEED, "what the factors are drawn from"),
    ),
    one_of=(("models", "inventory"),),
)


def read_buildings(value: Value, folder: Path) -> ModelFiles | InventoryFile | None:
    """Model files or an inventory; None after a fault."""
    section = value.section(BUILDINGS)
    if section is None:
        return None
    models, inventory = section.get("models"), section.get("inventory")
    if models and inventory:
        inventory.fault("stands in place of `models`; give one of the two")
        return None
    if inventory:
        return _inventory(section, inventory, folder)
    if models is None:
        section.need("models", "give a list of model files, or an inventory in its place")
        return None
    for name in tuple(BUILDINGS)[2:]:
        if entry := section.get(name):
            entry.fault("belongs to an `inventory`")
    items = models.items("a list of model files")
    if items is not None and not items:
        models.fault("is empty; give at least one model file")
    return ModelFiles(tuple(resolve(text, folder) for item in items or () if (text := item.text())))


def _inventory(section: Section, inventory: Value, folder: Path) -> InventoryFile | None:
    file = inventory.text()
    rules = section.get("rules")
    name = rules.choice(RULES, "set of rules") if rules else next(iter(RULES))
    units = section.need("units", "give {length: ft} or {length: m}; plan areas are in its square")
    lengths = units.section(_UNITS) if units else None
    length = lengths.need("length", "give ft or m") if lengths else None
    unit = length.choice(_LENGTHS, "length unit of inventories") if length else None
    damping = section.get("damping")
    kind = damping.choice(_DAMPING, "damping") if damping else "full"
    seed = section.get("seed")
    if file is None or name is None or unit is None:
        return None
    return InventoryFile(
        file=resolve(file, folder),
        rules=name,
        length=LENGTH[unit],
        mass_only=kind == "mass-only",
        stiffness_scatter=section.number("stiffness_scatter", default=0.0),
        damping_scatter=section.number("damping_scatter", default=0.0),
        seed=(seed.whole() if seed else 0) or 0,
    )
