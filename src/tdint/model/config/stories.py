"""The `stories` of a model file."""

from __future__ import annotations

import math
from dataclasses import replace

from tdint.model.config.laws import LAW, LINEAR, check_together, read_law
from tdint.model.config.units import ModelUnits
from tdint.model.definition import MAX_STORIES, Law, PowerDashpot, Story
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import (
    NOT_NEGATIVE,
    POSITIVE,
    Bounds,
    Choice,
    Either,
    EntriesOf,
    Flag,
    Key,
    Keys,
    Whole,
)
from tdint.units import MASS, STANDARD_GRAVITY

_DAMPED = "rayleigh"
_EXPONENT = Bounds(0.0, 2.0, low_allowed=False)
_DASHPOT = Keys(
    (
        Key("coefficient", POSITIVE, "force at the unit of velocity", needed=True),
        Key("exponent", _EXPONENT, "power of the drift rate", needed=True),
        Key("linear_below", NOT_NEGATIVE, "drift rate under which the dashpot is linear"),
    )
)
_STORY = Keys(
    (
        Key("mass", POSITIVE, "mass of the floor above"),
        Key("weight", POSITIVE, "weight of the floor above, in place of its mass"),
        Key("height", POSITIVE, "story height, for drift ratios and P-delta"),
        Key("stiffness", POSITIVE, "initial stiffness: story shear over drift"),
        Key("law", LAW, "drift law; linear where it is left out"),
        Key("dashpot", Either((NOT_NEGATIVE, _DASHPOT)), "viscous damper between the floors: force over velocity"),
        Key(
            "isolator",
            Either((Flag(), Choice((_DAMPED,)))),
            "whether the drift is a displacement by design, no drift ratio; with Rayleigh damping if `rayleigh`",
        ),
        Key("repeat", Whole(1, MAX_STORIES), "number of equal stories"),
    ),
    one_of=(("mass", "weight"),),
)
STORIES = EntriesOf(_STORY, least=1)
_AGREEMENT = 1e-9


def read_stories(value: Value | None, unit: ModelUnits, p_delta: bool) -> tuple[tuple[Story, ...], int | None]:
    """The stories from the ground up, and their number: None where a fault leaves it open."""
    entries = value.items("a list of stories") if value else None
    if value is None or entries is None:
        return (), None
    if not entries:
        value.fault("must hold at least one story")
    stories: list[Story] = []
    count: int | None = 0
    for entry in entries:
        story, repeat = _read_entry(entry, unit, p_delta)
        if len(stories) + (repeat or 1) > MAX_STORIES:
            entry.fault(f"brings the model over {MAX_STORIES} stories; check `repeat`")
            return (), None
        stories += [story] * (repeat or 1)
        count = count + repeat if count is not None and repeat is not None else None
    return tuple(stories), count or None


def _read_entry(entry: Value, unit: ModelUnits, p_delta: bool) -> tuple[Story, int | None]:
    """One entry of `stories` and how often it stands; None where a fault leaves that open."""
    section = entry.section(_STORY)
    if section is None:
        return Story(math.nan, None, math.nan, LINEAR, math.nan), None
    law, own_stiffness = read_law(section.get("law"), unit)
    dashpot, power_dashpot = _read_dashpot(section.get("dashpot"), unit)
    height = section.need("height", "p_delta needs the height of every story") if p_delta else section.get("height")
    story = Story(
        mass=_read_mass(section, unit),
        height=height.number(scale=unit.length) if height else None,
        stiffness=_read_stiffness(section, own_stiffness, law, unit),
        law=law,
        dashpot=dashpot,
        power_dashpot=power_dashpot,
    )
    isolator = section.get("isolator")
    if isolator and isolator.is_word(_DAMPED):
        story = replace(story, isolator=True)
    elif isolator and isolator.boolean():
        story = replace(story, isolator=True, rayleigh=False)
    check_together(section.get("law"), law, story.stiffness)
    repeat = section.get("repeat")
    return story, repeat.whole() if repeat else 1


def _read_mass(section: Section, unit: ModelUnits) -> float:
    """The mass of the floor, kg, from the key `mass` or `weight`."""
    if section.has("weight"):
        if section.has("mass"):
            section.value.fault("give either mass or weight, not both")
        return section.number("weight", scale=unit.force / STANDARD_GRAVITY)
    if not section.mentions("mass", "weight"):
        section.need("mass", "give a positive number, or the weight in its place")
        return math.nan
    mass = section.get("mass")
    if mass and unit.mass_is_open:
        mass.fault(
            "its unit is not said, and the file's units are not SI: add mass to `units` "
            f"({', '.join(MASS)}), or give the story's `weight`"
        )
    return section.number("mass", scale=unit.mass, default=math.nan)


def _read_dashpot(value: Value | None, unit: ModelUnits) -> tuple[float, PowerDashpot | None]:
    """The coefficient of a viscous dashpot, N s/m, and the power-law dashpot: a number, or a mapping."""
    if value is None:
        return 0.0, None
    if not value.is_mapping:
        return value.number(NOT_NEGATIVE, unit.factor(force=1, length=-1)), None
    section = value.section(_DASHPOT)
    if section is None:
        return math.nan, None
    exponent = section.number("exponent")
    soft = exponent < 1.0
    if soft and not section.mentions("linear_below"):
        section.need("linear_below", "an exponent below 1 needs the drift rate under which the dashpot is linear")
    below = section.number("linear_below", POSITIVE if soft else NOT_NEGATIVE, unit.length, default=0.0)
    coefficient = section.number("coefficient", scale=unit.factor(force=1, length=-exponent))
    return 0.0, PowerDashpot(coefficient, exponent, below)


def _read_stiffness(section: Section, own: float | None, law: Law, unit: ModelUnits) -> float:
    """The initial stiffness, N/m, from the key `stiffness` or from the law's `own` one."""
    factor = unit.factor(force=1, length=-1)
    if own is None:
        return section.number("stiffness", scale=factor)
    given = section.get("stiffness")
    stiffness = given.number(scale=factor) if given else own
    if given and abs(stiffness - own) > _AGREEMENT * own:
        initial = f"the initial stiffness {own / factor:.10g} of its {law.name} law"
        given.fault(f"must agree with {initial}, got {stiffness / factor:.10g}; correct it or leave it out")
    return own
