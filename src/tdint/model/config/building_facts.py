"""Read the section `building` of a model file: rules derive the stories from these properties."""

from __future__ import annotations

import math
from typing import Any

from tdint.errors import ModelError
from tdint.model.building_rules import CAPACITY, RULES
from tdint.model.capacity import (
    DAMPING_RATIO,
    UNIT_MASS,
    CapacityBuilding,
    CapacityFacts,
    derive_capacity,
    read_curve,
)
from tdint.model.config.keys import keys
from tdint.model.config.sections import ModelUnits
from tdint.model.keys import fields
from tdint.model.mdof_lu import (
    LEVELS,
    MOST_STORIES,
    STRUCTURES,
    YEARS,
    ZONES,
    BuildingFacts,
    DerivedBuilding,
)

_DAMPING_TYPES = ("full", "mass-only")
_RULES = fields.Choice(tuple(rules for rules in RULES if rules != CAPACITY), "set of rules")
BUILDING = fields.Keys(
    keys(
        "building",
        rules=_RULES,
        type=fields.Choice(STRUCTURES, "structure type"),
        stories=fields.Integer(1, MOST_STORIES),
        year=fields.Integer(*YEARS),
        zone=fields.Choice(ZONES, "seismic zone"),
        design_level=fields.Choice(LEVELS, "design level"),
        damping=fields.Choice(_DAMPING_TYPES, "type of damping"),
    ),
    one_of=(("rules", "capacity"),),
)
# Keys that cannot be used with a capacity curve, and keys that require a capacity curve.
_KEYS_OF_RULES = ("rules", "type", "year", "area", "zone", "design_level", "damping")
_KEYS_OF_CAPACITY = ("mass", "soft_story", "degradation", "as_published")


def read_building(
    value: fields.Value, unit: ModelUnits
) -> DerivedBuilding | CapacityBuilding | None:
    """Return the building derived from rules or a capacity curve; None after reporting an error."""
    section = value.section(BUILDING)
    if section is None:
        return None
    if section.has("capacity"):
        section.refuse(_KEYS_OF_RULES, "cannot be used with a `capacity` curve")
        return _building_of_curve(section, unit)
    section.refuse(_KEYS_OF_CAPACITY, "requires a `capacity` curve")
    # All entries are read before the function returns, so that all errors are reported.
    required_values = [
        _read_needed(section, "rules"),
        _read_needed(section, "type"),
        _read_needed(section, "stories", f"give a whole number from 1 to {MOST_STORIES}"),
    ]
    year = section.read("year")
    if not section.mentions("year", "design_level"):
        section.need("year", "give the year of construction, or the `design_level`")
    area = section.number("area", scale=unit.factor(length=2))
    height = section.number("height", scale=unit.length, default=0.0)
    defaults = {"zone": "Z4", "design_level": "", "damping": "full"}
    zone, level, damping = (section.read(name, default) for name, default in defaults.items())
    # The default -1 represents a missing ratio, because the reader rejects negative ratios and
    # returns nan for invalid ratios. The height 0 represents a missing height.
    damping_ratio = section.number("damping_ratio", default=-1.0)
    has_nan = any(map(math.isnan, (area, height, damping_ratio)))
    if has_nan or None in (*required_values, zone, level, damping) or not (year or level):
        return None
    rules, structure, stories = required_values
    facts = BuildingFacts(
        structure=structure,
        stories=stories,
        year=year,
        area=area,
        height=height or None,
        zone=zone,
        design_level=level or None,
        damping_ratio=None if damping_ratio < 0.0 else damping_ratio,
        mass_only=damping == "mass-only",
    )
    # The argument None omits random factors of stiffness and damping: the model file describes a
    # single building with mean properties.
    return RULES[rules](facts, None)


def _read_needed(section: fields.Section, name: str, advice: str = "") -> Any:
    """Return the converted value of a required entry; None after reporting an error.

    `advice` is the remedy in the message if the entry is missing. Default: the allowed values of a
    choice.
    """
    value_type = BUILDING.types()[name]
    if isinstance(value_type, fields.Choice) and not advice:
        advice = f"give one of {', '.join(value_type.names)}"
    value = section.need(name, advice)
    return value.read() if value else None


def _building_of_curve(section: fields.Section, unit: ModelUnits) -> CapacityBuilding | None:
    """Return the building of a capacity curve; None after reporting an error."""
    curve_entry = section.get("capacity")
    path = curve_entry.file() if curve_entry else None
    curve = None
    if curve_entry and path:
        # Errors in the file of the curve are reported at the key that names the file.
        try:
            curve = read_curve(path)
        except ModelError as error:
            curve_entry.fault(str(error))
    stories = _read_needed(section, "stories", f"give a whole number from 1 to {MOST_STORIES}")
    height = section.number("height", scale=unit.length, default=0.0)
    damping_ratio = section.number("damping_ratio", default=DAMPING_RATIO)
    mass = section.number("mass", scale=unit.mass, default=UNIT_MASS)
    flags = {
        name: section.read(name, False) for name in ("soft_story", "degradation", "as_published")
    }
    if curve is None or stories is None or any(map(math.isnan, (height, damping_ratio, mass))):
        return None
    return derive_capacity(
        CapacityFacts(curve, stories, height or None, mass, damping_ratio=damping_ratio, **flags)
    )
