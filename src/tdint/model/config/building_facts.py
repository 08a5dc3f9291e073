"""The `building` of a model file: a few facts in place of `stories`, from which rules derive them."""

from __future__ import annotations

import math

from tdint.model.config.units import ModelUnits
from tdint.model.inventory.derive import RULES
from tdint.model.inventory.facts import BuildingFacts, DerivedBuilding
from tdint.model.inventory.hazus import LEVELS
from tdint.model.inventory.mdof_lu import MOST_STORIES, STRUCTURES, ZONES
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import POSITIVE, RATIO, Choice, Key, Keys, Whole

_DAMPING = ("full", "mass-only")
_YEARS = Whole(1000, 2200)
BUILDING = Keys(
    (
        Key("rules", Choice(tuple(RULES)), "the rules that derive the stories", needed=True),
        Key("type", Choice(STRUCTURES), "structure type of Hazus", needed=True),
        Key("stories", Whole(1, MOST_STORIES), "number of stories", needed=True),
        Key("year", _YEARS, "year of construction", needed=True),
        Key("area", POSITIVE, "area of one floor, in the square of the unit of length", needed=True),
        Key("height", POSITIVE, "height of the whole building"),
        Key("zone", Choice(ZONES), "seismic zone; Z4 where it is left out"),
        Key("design_level", Choice(LEVELS), "design level; else from zone and year"),
        Key("damping_ratio", RATIO, "viscous damping ratio; else that of the type"),
        Key("damping", Choice(_DAMPING), "without the stiffness-proportional part, or full"),
    )
)


def read_building(value: Value, unit: ModelUnits) -> DerivedBuilding | None:
    """The building that the rules derive; None after a fault."""
    section = value.section(BUILDING)
    if section is None:
        return None
    rules = _choice(section, "rules", "set of rules")
    structure = _choice(section, "type", "structure type")
    count = section.need("stories", f"give a whole number from 1 to {MOST_STORIES}")
    stories = count.whole() if count else None
    built = section.need("year", "give the year of construction")
    year = built.whole() if built else None
    area = section.number("area", scale=unit.factor(length=2))
    height = section.number("height", scale=unit.length, default=0.0)
    zone = _choice(section, "zone", "seismic zone", "Z4")
    level = _choice(section, "design_level", "design level", "")
    ratio = section.number("damping_ratio", default=-1.0)
    damping = _choice(section, "damping", "kind of damping", "full")
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


def _choice(section: Section, name: str, what: str, default: str | None = None) -> str | None:
    kind = BUILDING.kinds()[name]
    assert isinstance(kind, Choice)
    value = section.get(name) if default is not None else section.need(name, f"give one of {', '.join(kind.names)}")
    if value is None:
        return default
    return value.choice(kind.names, what)
