"""The `stories` of a model file."""

from __future__ import annotations

import math

from tdint.model.definition import MAX_STORIES, Law, Story
from tdint.model.fields import NOT_NEGATIVE, POSITIVE, Section, Value
from tdint.model.law_config import LINEAR, read_law
from tdint.model.unit_config import Units

_STORY_KEYS = ("mass", "height", "stiffness", "law", "dashpot", "repeat")
_AGREEMENT = 1e-9


def read_stories(value: Value | None, unit: Units, p_delta: bool) -> tuple[tuple[Story, ...], int | None]:
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


def _read_entry(entry: Value, unit: Units, p_delta: bool) -> tuple[Story, int | None]:
    """One entry of `stories` and how often it stands; None where a fault leaves that open."""
    section = entry.section(_STORY_KEYS)
    if section is None:
        return Story(math.nan, None, math.nan, LINEAR, math.nan), None
    law, own_stiffness = read_law(section.get("law"), unit)
    height = section.need("height", "p_delta needs the height of every story") if p_delta else section.get("height")
    story = Story(
        mass=section.number("mass", POSITIVE, unit.mass),
        height=height.number(POSITIVE, unit.length) if height else None,
        stiffness=_read_stiffness(section, own_stiffness, law, unit),
        law=law,
        dashpot=section.number("dashpot", NOT_NEGATIVE, unit.factor(force=1, length=-1), default=0.0),
    )
    repeat = section.get("repeat")
    return story, repeat.whole(1, MAX_STORIES) if repeat else 1


def _read_stiffness(section: Section, own: float | None, law: Law, unit: Units) -> float:
    """The initial stiffness, N/m, from the key `stiffness` or from the law's `own` one."""
    factor = unit.factor(force=1, length=-1)
    if own is None:
        return section.number("stiffness", POSITIVE, factor)
    given = section.get("stiffness")
    stiffness = given.number(POSITIVE, factor) if given else own
    if given and abs(stiffness - own) > _AGREEMENT * own:
        initial = f"the initial stiffness {own / factor:.10g} of its {law.name} law"
        given.fault(f"must agree with {initial}, got {stiffness / factor:.10g}; correct it or leave it out")
    return own
