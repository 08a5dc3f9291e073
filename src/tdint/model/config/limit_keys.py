"""Read the section `limits` of a model file.

A limit is a single value for all stories, or a mapping from stories to values. The keys of the
mapping are numbers (`3`, `2-5`), types of hysteretic laws, or `others`. A number has priority over
a type, and a type over `others`. The stories of the model are empty after an error in the stories.
Limits of attachments and links are a single value for all, or a mapping from their names or
`others` to values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from tdint.errors import did_you_mean
from tdint.model.config.keys import keys
from tdint.model.config.sections import ModelUnits
from tdint.model.definition import Attachment, Link
from tdint.model.keys import fields
from tdint.model.limits import (
    ACCELERATION,
    DRIFT_RATIO,
    ISOLATOR,
    LINK_DEFORMATION,
    LINK_FORCE,
    QUANTITIES,
    RESIDUAL,
    STROKE,
    Limit,
)
from tdint.model.story import Story
from tdint.units import parse_with_unit

OTHERS = "others"
# Longer numbers are not matched, because Python limits the number of digits of an integer.
_STORY_NUMBERS = re.compile(r"([1-9]\d{0,17})(?:-([1-9]\d{0,17}))?")
_STORY_KEYS = r"^([1-9][0-9]*(-[1-9][0-9]*)?|[a-z][a-z0-9-]*)$"
_STORY_MAPPING = f"a mapping such as {{1: ..., 2-5: ..., bilinear: ..., {OTHERS}: ...}}"
_NAMES = "^.+$"
_NAME_MAPPING = f"a mapping from names to limits, such as {{tank: ..., {OTHERS}: ...}}"


def _by_story(value_type: fields.ValueType, names: str = _STORY_KEYS) -> fields.Either:
    """Return the type of a value for all stories, or of a mapping from stories or types of laws
    to values; of attachments and links, of a mapping from names (any text)."""
    return fields.Either((value_type, fields.NamedEntries(value_type, names, least=1)))


_LENGTH = fields.Either((fields.POSITIVE, fields.TextLine()))
_LIMIT_TYPES: dict[str, fields.ValueType] = {
    DRIFT_RATIO: _by_story(fields.DRIFT_BOUNDS),
    RESIDUAL: _by_story(fields.DRIFT_BOUNDS),
    ISOLATOR: _by_story(_LENGTH),
    ACCELERATION: _by_story(_LENGTH),
    STROKE: _by_story(_LENGTH, _NAMES),
    LINK_DEFORMATION: _by_story(_LENGTH, _NAMES),
    LINK_FORCE: _by_story(fields.POSITIVE, _NAMES),
}
_COLUMN_NAMES = {ACCELERATION: "peak_absolute_acceleration"}
"""Name of a quantity in tables, by its key, which is accepted also."""
_KEY_TYPES = _LIMIT_TYPES | {name: _LIMIT_TYPES[key] for key, name in _COLUMN_NAMES.items()}
_QUANTITIES = fields.Keys(keys("limits", **_KEY_TYPES))
LIMITS = fields.Keys(
    (*_QUANTITIES.declared, *keys("levels", levels=fields.NamedEntries(_QUANTITIES, least=1)))
)
"""Keys of the section `limits` of a model file."""


_DeviceNames = Mapping[str, tuple[str, ...]]
"""Names of the attachments or links that have a quantity, by the quantity."""


def read_limits(
    value: fields.Value,
    unit: ModelUnits,
    stories: Sequence[Story],
    attachments: Sequence[Attachment],
    links: Sequence[Link],
) -> tuple[Limit, ...]:
    """Return the limits of a model: limits without a level, followed by the limits of each level.

    Limits with errors are reported and omitted.
    """
    attached, linked = (tuple(item.name for item in items) for items in (attachments, links))
    names = {STROKE: attached, LINK_DEFORMATION: linked, LINK_FORCE: linked}
    section = value.section(LIMITS)
    if section is None:
        return ()
    limits = _read_level(section, "", unit, stories, names)
    levels = section.get("levels")
    expected = "the limits of each performance level, such as {life safety: {drift_ratio: 2%}}"
    level_entries = levels.named(expected, f"is empty; give {expected}") if levels else None
    for name, entry in (level_entries or {}).items():
        # Names are printed in messages and tables, so they must be short and printable.
        if not name.isprintable() or not name[:1].isalpha() or len(name) > 60:
            entry.fault(
                "the name of a performance level must start with a letter and have at most 60 "
                "printable characters"
            )
        elif level_section := entry.section(_QUANTITIES):
            if not level_section.mentions(*_QUANTITIES):
                entry.fault(f"is empty; give one of {', '.join(_QUANTITIES)}")
            limits += _read_level(level_section, name, unit, stories, names)
    if not section.mentions(*LIMITS):
        value.fault(f"is empty; give one of {', '.join(LIMITS)}")
    return tuple(limits)


def _read_level(
    section: fields.Section,
    level: str,
    unit: ModelUnits,
    stories: Sequence[Story],
    names: _DeviceNames,
) -> list[Limit]:
    """Return the limits of a single performance level, at most one for each quantity.

    `level` is empty for limits without a level.
    """
    limits = []
    for quantity in _LIMIT_TYPES:
        named = section.get(_COLUMN_NAMES.get(quantity, ""))
        if named and section.get(quantity):
            named.fault(f"is {quantity}, which has a value; give one of them")
        if entry := section.get(quantity) or named:
            values = (
                _read_named_values(entry, quantity, unit, names[quantity])
                if quantity in names
                else _read_values(entry, quantity, unit, stories)
            )
            # A limit with a reported error has no finite value and is omitted.
            if values is not None and any(map(math.isfinite, values)):
                limits.append(Limit(level, quantity, values, names.get(quantity, ())))
    return limits


def _read_values(
    entry: fields.Value, quantity: str, unit: ModelUnits, stories: Sequence[Story]
) -> tuple[float, ...] | None:
    """Return the limit of each story, nan without a limit or after reporting an error; None if no
    story has the quantity, which is reported."""
    # For each story, True if the story has the quantity; an isolator, for example, has no drift
    # ratio.
    applies = [_has_quantity(quantity, story) for story in stories]
    if stories and not any(applies):
        entry.fault(_NOT_APPLICABLE[quantity])
        return None
    if not entry.is_mapping:
        limit = _read_limit(entry, quantity, unit)
        return tuple(limit if is_applicable else math.nan for is_applicable in applies)
    entries = entry.named(_STORY_MAPPING, f"is empty; give {_STORY_MAPPING}") or {}
    limits = [math.nan] * len(stories)
    # Apply the keys in the order of increasing priority.
    for name, inner_entry in sorted(entries.items(), key=lambda item: _priority(item[0])):
        limit = _read_limit(inner_entry, quantity, unit)
        for story_index in _story_indices(inner_entry, name, quantity, stories, applies):
            limits[story_index] = limit
    return tuple(limits)


def _read_named_values(
    entry: fields.Value, quantity: str, unit: ModelUnits, names: Sequence[str]
) -> tuple[float, ...]:
    """Return the limit of each attachment or link, nan without a limit or after reporting an
    error."""
    location = QUANTITIES[quantity].location
    if not names:
        entry.fault(f"the model has no {location}; add `{location}s`, or omit the limit")
    if not entry.is_mapping:
        return (_read_limit(entry, quantity, unit),) * len(names)
    entries = entry.named(_NAME_MAPPING, f"is empty; give {_NAME_MAPPING}") or {}
    limits = {name: _read_limit(inner, quantity, unit) for name, inner in entries.items()}
    for name in limits.keys() - {*names, OTHERS} if names else ():
        hint = did_you_mean(name, [*names, OTHERS]) or f"; names: {', '.join(names)}, {OTHERS}"
        entries[name].fault(f"{location} {name!r} not found{hint}")
    return tuple(limits.get(name, limits.get(OTHERS, math.nan)) for name in names)


def _priority(name: str) -> int:
    """Return the priority of a key; a key of higher priority overrides keys of lower priority.

    The priority is 0 for `others`, 1 for a type of law, 2 for a range of stories (`2-5`) and 3 for
    the number of a story.
    """
    if name == OTHERS:
        return 0
    numbers = _STORY_NUMBERS.fullmatch(name)
    if numbers is None:
        return 1
    is_range = numbers[2] is not None
    return 2 if is_range else 3


def _story_indices(
    entry: fields.Value, name: str, quantity: str, stories: Sequence[Story], applies: Sequence[bool]
) -> list[int]:
    """Return the indices (from 0) of the stories that a key of a limit selects.

    Stories without the quantity are omitted. The list is empty after reporting an error.
    """
    if not stories:
        return []
    count = len(stories)
    noun = "floor" if quantity == ACCELERATION else "story"
    if match := _STORY_NUMBERS.fullmatch(name):
        first, last = int(match[1]), int(match[2] or match[1])
        if not first <= last <= count:
            entry.fault(f"{noun} {name} not found; {noun} numbers are from 1 to {count}")
            return []
        indices = [i for i in range(first - 1, last) if applies[i]]
        # A range may include stories without the quantity, such as isolators for drift ratios; they
        # are skipped. It is an error if no story of the range, or the single story, has it.
        if not indices:
            entry.fault(f"{noun} {name}: {_NOT_APPLICABLE[quantity]}")
        return indices
    if name == OTHERS:
        return [i for i, is_applicable in enumerate(applies) if is_applicable]
    if quantity == ACCELERATION:
        entry.fault(f"floors have no type; specify floor numbers from 1 to {count}, or {OTHERS}")
        return []
    types_of_stories = [[spring.law.name for spring in story.springs] for story in stories]
    law_types = list(dict.fromkeys(law for types in types_of_stories for law in types))
    indices = [i for i, types in enumerate(types_of_stories) if name in types and applies[i]]
    if not indices:
        hint = did_you_mean(name, [*law_types, OTHERS]) if name not in law_types else ""
        entry.fault(
            f"no story to which this limit applies has a law of the type {name!r}{hint}; specify "
            f"story numbers from 1 to {count}, types of laws ({', '.join(law_types)}), or {OTHERS}"
        )
    return indices


def _has_quantity(quantity: str, story: Story) -> bool:
    """Return True if a quantity is defined for a story or the floor above it."""
    if quantity == ISOLATOR:
        return story.isolator
    return quantity == ACCELERATION or story.drift_height is not None


_NOT_APPLICABLE = {
    DRIFT_RATIO: "a drift ratio requires a story with `height` that is not an isolator",
    RESIDUAL: "a drift ratio requires a story with `height` that is not an isolator",
    ISOLATOR: "an isolator displacement requires a story with `isolator: true`",
    ACCELERATION: "",
}
"""Messages if no story has a value of the quantity."""

_LIMIT_UNITS = {
    ISOLATOR: ("displacement", "500 mm"),
    ACCELERATION: ("acceleration", "0.4 g"),
    STROKE: ("displacement", "300 mm"),
    LINK_DEFORMATION: ("displacement", "50 mm"),
}
"""Quantity of a limit with a unit, and an example for messages."""


def _read_limit(value: fields.Value, quantity: str, unit: ModelUnits) -> float:
    """Return a limit with a unit, or a number in the units of the file, in SI units; nan after
    reporting an error."""
    si_unit = QUANTITIES[quantity].unit
    if si_unit == "1":
        return value.number(fields.DRIFT_BOUNDS)
    # A letter that is not the exponent of a number, such as in 1e3, belongs to a unit.
    without_exponent = re.sub(r"[eE][+-]?\d", "", value.word)
    if quantity in _LIMIT_UNITS and re.search(r"[A-Za-z%]", without_exponent):
        example = _LIMIT_UNITS[quantity]
        return value.parsed(lambda text: parse_with_unit(text, *example)) or math.nan
    return value.number(fields.POSITIVE, unit.force if si_unit == "N" else unit.length)
