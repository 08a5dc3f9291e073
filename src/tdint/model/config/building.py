"""The `building` of a model file: a few facts in place of `stories`, from which rules derive them."""

from __future__ import annotations

import math

from tdint.model.config.fields import POSITIVE, RATIO, Section, Value
from tdint.model.config.units import ModelUnits
from tdint.model.inventory.definition import BuildingFacts, DerivedBuilding
from tdint.model.inventory.hazus import LEVELS
from tdint.model.inventory.mdof_lu import MOST_STORIES, STRUCTURES, ZONES
from tdint.model.inventory.rules import RULES

_KEYS = (
    "rules",
    "type",
    "stories",
    "year",
    "area",
    "height",
    "zone",
    "design_level",
    "damping_ratio",
    "damping",
)
_DAMPING = ("full", "mass-only")


def read_building(value: Value, unit: ModelUnits) -> DerivedBuilding | None:
    """The building that the rules derive; None after a fault."""
    section = value.section(_KEYS)
    if section is None:
        return None
    rules = _choice(section, "rules", tuple(RULES), "set of rules")
    structure = _choice(section, "type", STRUCTURES, "structure type")
    count = section.need("stories", f"give a whole number from 1 to {MOST_STORIES}")
    stories = count.whole(1, MOST_STORIES) if count else None
    built = section.need("year", "give the year of construction")
    year = built.whole(1000, 2200) if built else None
    area = section.number("area", POSITIVE, unit.factor(length=2))
    height = section.number("height", POSITIVE, unit.length, default=0.0)
    zone = _choice(section, "zone", ZONES, "seismic zone", "Z4")
    level = _choice(section, "design_level", LEVELS, "design level", "")
    ratio = section.number("damping_ratio", RATIO, default=-1.0)
    damping = _choice(section, "damping", _DAMPING, "kind of damping", "full")
    if None in (rules, structure, stories, year, zone, level, damping) or any(map(math.isnan, (area, height, ratio))):
        return None
    assert rules and structure and stories and year and zone
    facts = BuildingFacts(
        structure=structure,
        stories=stories,
        year=year,
        area=area,
        height=height or None,
        zone=zone,
        design_level=level or None,
        damping_ratio=None if ratio < 0.0 else ratio,
        mass_only=damping == "mass-only",
    )
    return RULES[rules](facts, None)


def _choice(section: Section, name: str, known: tuple[str, ...], what: str, default: str | None = None) -> str | None:
    value = section.get(name) if default is not None else section.need(name, f"give one of {', '.join(known)}")
    if value is None:
        return default
    return value.choice(known, what)
