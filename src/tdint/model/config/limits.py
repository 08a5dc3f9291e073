"""Read the section `limits` of a model file.

A limit is one value for all stories, or a mapping from stories to values. The keys of the mapping
are numbers (`3`, `2-5`), types of hysteretic laws, or `others`. A number has priority over a type,
and a type over `others`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tdint.errors import UsageError, did_you_mean
from tdint.model.config.sections import ModelUnits
from tdint.model.definition import Story
from tdint.model.keys.fields import (
    POSITIVE,
    POSITIVE_RATIO,
    Either,
    Key,
    Keys,
    Schema,
    Section,
    Value,
    ValueType,
    Words,
)
from tdint.model.limits import ACCELERATION, DRIFT_RATIO, ISOLATOR, RESIDUAL, Limit
from tdint.units import parse_with_unit

OTHERS = "others"
_NUMBERS = re.compile(r"([1-9]\d*)(?:-([1-9]\d*))?")
_PLACES = r"^([1-9][0-9]*(-[1-9][0-9]*)?|[a-z][a-z0-9-]*)$"
_BY_PLACE = f"a mapping such as {{1: ..., 2-5: ..., bilinear: ..., {OTHERS}: ...}}"


@dataclass(frozen=True)
class _ByPlace:
    """One value for all stories, or a mapping from stories or types of laws to values."""

    type: ValueType

    def schema(self) -> Schema:
        value = self.type.schema()
        return {
            "anyOf": [
                value,
                {
                    "type": "object",
                    "patternProperties": {_PLACES: value},
                    "additionalProperties": False,
                    "minProperties": 1,
                },
            ]
        }


_LENGTH = Either((POSITIVE, Words()))
_LIMITS = (
    Key(DRIFT_RATIO, _ByPlace(POSITIVE_RATIO), "drift ratio of the stories: 2% or 0.02"),
    Key(
        RESIDUAL,
        _ByPlace(POSITIVE_RATIO),
        "absolute drift ratio of the stories at the end of the run",
    ),
    Key(
        ISOLATOR,
        _ByPlace(_LENGTH),
        "displacement of the stories with `isolator: true`, in the unit of length of the file or "
        "with a unit: 500 mm",
    ),
    Key(
        ACCELERATION,
        _ByPlace(_LENGTH),
        "absolute acceleration of the floors, in the unit of length of the file over s^2 or with "
        "a unit: 0.4 g",
    ),
)
_QUANTITIES = Keys(_LIMITS)


@dataclass(frozen=True)
class _Levels:
    """Mapping from the names of performance levels to their limits."""

    def schema(self) -> Schema:
        return {"type": "object", "additionalProperties": _QUANTITIES.schema(), "minProperties": 1}


LIMITS = Keys(
    (*_LIMITS, Key("levels", _Levels(), "limits of performance levels, by the name of the level"))
)
"""Keys of the section `limits` of a model file."""


def read_limits(value: Value, unit: ModelUnits, stories: Sequence[Story]) -> tuple[Limit, ...]:
    """Return the limits of a model; empty without limits.

    Parameters
    ----------
    value : Value
        The section.
    unit : ModelUnits
        Units of the file.
    stories : sequence of Story
        Stories of the model; empty after an error.
    """
    section = value.section(LIMITS)
    if section is None:
        return ()
    limits = _of_level(section, "", unit, stories)
    levels = section.get("levels")
    named = (
        levels.named(
            "the limits of each performance level, such as {life safety: {drift_ratio: 2%}}",
            "is empty; give the limits of each performance level, such as {life safety: "
            "{drift_ratio: 2%}}",
        )
        if levels
        else None
    )
    for name, entry in (named or {}).items():
        if not name.isprintable() or not name[:1].isalpha() or len(name) > 60:
            entry.fault("the name of a performance level must start with a letter")
        elif inner := entry.section(_QUANTITIES):
            if not inner.mentions(*_QUANTITIES):
                entry.fault(f"is empty; give one of {', '.join(_QUANTITIES)}")
            limits += _of_level(inner, name, unit, stories)
    if not section.mentions(*LIMITS):
        value.fault(f"is empty; give one of {', '.join(LIMITS)}")
    return tuple(limits)


def _of_level(
    section: Section, level: str, unit: ModelUnits, stories: Sequence[Story]
) -> list[Limit]:
    """Return the limits of one performance level.

    Parameters
    ----------
    section : Section
        Section with quantities as keys.
    level : str
        Name of the level; empty for limits without a level.
    unit : ModelUnits
        Units of the file.
    stories : sequence of Story
        Stories of the model; empty after an error.
    """
    limits = []
    for quantity in _QUANTITIES:
        if entry := section.get(quantity):
            values = _values(entry, quantity, unit, stories)
            if values is not None and any(map(math.isfinite, values)):
                limits.append(Limit(level, quantity, values))
    return limits


def _values(
    entry: Value, quantity: str, unit: ModelUnits, stories: Sequence[Story]
) -> tuple[float, ...] | None:
    """Return the limit of each story, nan without a limit, or None after reporting an error.

    Parameters
    ----------
    entry : Value
        One value, or a mapping by stories or laws.
    quantity : str
        Limited quantity.
    unit : ModelUnits
        Units of the file.
    stories : sequence of Story
        Stories of the model; empty after an error.
    """
    read = _reader(quantity, unit)
    applies = [_applies(quantity, story) for story in stories]
    if stories and not any(applies):
        entry.fault(_NOT_APPLICABLE[quantity])
        return None
    if not entry.is_mapping:
        number = read(entry)
        return tuple(number if applied else math.nan for applied in applies)
    entries = entry.named(_BY_PLACE, f"is empty; give {_BY_PLACE}") or {}
    values = [math.nan] * len(stories)
    # Apply the keys in the order of increasing priority.
    for name, inner in sorted(entries.items(), key=lambda item: _priority(item[0])):
        number = read(inner)
        for i in _places(inner, name, quantity, stories, applies):
            values[i] = number
    return tuple(values)


def _priority(name: str) -> int:
    """Return the priority of a key: `others`, then types of laws, then ranges, then numbers."""
    if name == OTHERS:
        return 0
    match = _NUMBERS.fullmatch(name)
    return 1 if match is None else 2 if match[2] else 3


def _places(
    entry: Value, name: str, quantity: str, stories: Sequence[Story], applies: Sequence[bool]
) -> list[int]:
    """Return the indices of the stories of a key; empty after reporting an error.

    Parameters
    ----------
    entry : Value
        Value of the key, for messages.
    name : str
        The key: a number, a range, a type of law, or `others`.
    quantity : str
        Limited quantity.
    stories : sequence of Story
        Stories of the model; empty after an error.
    applies : sequence of bool
        True for the stories to which the quantity applies.
    """
    if not stories:
        return []
    count, place = len(stories), "floor" if quantity == ACCELERATION else "story"
    if match := _NUMBERS.fullmatch(name):
        first, last = int(match[1]), int(match[2] or match[1])
        if not first <= last <= count:
            entry.fault(f"{place} {name} not found; {place} numbers are from 1 to {count}")
            return []
        chosen = [i for i in range(first - 1, last) if applies[i]]
        # Stories of a range to which the quantity does not apply, such as isolators for drift
        # ratios, are skipped; the quantity must apply to a single story.
        if not chosen:
            entry.fault(f"{place} {name}: {_NOT_APPLICABLE[quantity]}")
        return chosen
    if name == OTHERS:
        return [i for i, applied in enumerate(applies) if applied]
    law_types = list(dict.fromkeys(story.law.name for story in stories))
    chosen = [i for i, story in enumerate(stories) if story.law.name == name and applies[i]]
    if quantity == ACCELERATION:
        entry.fault(f"floors have no type; specify floor numbers from 1 to {count}, or {OTHERS}")
        return []
    if not chosen:
        hint = did_you_mean(name, [*law_types, OTHERS]) if name not in law_types else ""
        entry.fault(
            f"no story to which this limit applies has a law of the type {name!r}{hint}; specify "
            f"story numbers from 1 to {count}, types of laws ({', '.join(law_types)}), or {OTHERS}"
        )
    return chosen


def _applies(quantity: str, story: Story) -> bool:
    """Return True if a story has a value of a quantity."""
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

_UNITS = {ISOLATOR: ("displacement", "500 mm"), ACCELERATION: ("acceleration", "0.4 g")}
"""Quantity and example for values with a unit."""


def _reader(quantity: str, unit: ModelUnits) -> Callable[[Value], float]:
    """Return the function that reads a limit in SI units, or nan after reporting an error.

    Parameters
    ----------
    quantity : str
        Response quantity of the limit.
    unit : ModelUnits
        Units of the model file.
    """
    if quantity in (DRIFT_RATIO, RESIDUAL):
        return lambda value: value.number(POSITIVE_RATIO)
    kind, example = _UNITS[quantity]

    def with_unit(text: str) -> float:
        number = parse_with_unit(text, kind, example)
        if not (math.isfinite(number) and number > 0.0):
            raise UsageError(f"must be positive, got {text!r}")
        return number

    def read(value: Value) -> float:
        # A number without a unit is in the units of the file.
        if re.search(r"[A-Za-z%]", re.sub(r"[eE][+-]?\d", "", value.word)):
            return value.parsed(with_unit) or math.nan
        return value.number(POSITIVE, unit.length)

    return read
