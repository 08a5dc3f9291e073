"""Checker for the part of JSON schema (draft 7) that the schemas of tdint use, and generator of
values that a schema must refuse.

Other keywords in a schema are errors. Invalid values follow from the declarations of the keys.
"""

import copy
import re
from collections.abc import Callable
from typing import Any

import yaml

from tdint.model.keys.fields import Bounds, Choice, Either, EntriesOf, Keys, ValueType, Whole

TYPES: dict[str, Callable[[object], bool]] = {
    "object": lambda value: isinstance(value, dict),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "number": lambda value: isinstance(value, int | float) and not isinstance(value, bool),
    "integer": lambda value: (
        isinstance(value, int | float) and not isinstance(value, bool) and value == int(value)
    ),
}
WORDS = ("$schema", "title", "description", "additionalProperties")


def valid(value: Any, schema: dict[str, Any]) -> bool:
    """Return True if a value is valid for the schema."""
    return all(
        _holds(word, told, value, schema) for word, told in schema.items() if word not in WORDS
    )


def _holds(word: str, told: Any, value: Any, schema: dict[str, Any]) -> bool:
    number = TYPES["number"](value)
    match word:
        case "type":
            return any(TYPES[name](value) for name in ([told] if isinstance(told, str) else told))
        case "enum":
            return value in told
        case "anyOf":
            return any(valid(value, one) for one in told)
        case "oneOf":
            return sum(valid(value, one) for one in told) == 1
        case "allOf":
            return all(valid(value, one) for one in told)
        case "minimum":
            return not number or value >= told
        case "maximum":
            return not number or value <= told
        case "exclusiveMinimum":
            return not number or value > told
        case "exclusiveMaximum":
            return not number or value < told
        case "pattern":
            return not isinstance(value, str) or re.search(told, value) is not None
        case "items":
            return not isinstance(value, list) or all(valid(item, told) for item in value)
        case "minItems":
            return not isinstance(value, list) or len(value) >= told
        case "maxItems":
            return not isinstance(value, list) or len(value) <= told
        case "required":
            return not isinstance(value, dict) or all(name in value for name in told)
        case "properties":
            extra = schema.get("additionalProperties", True)
            known = isinstance(value, dict) and {
                name: item for name, item in value.items() if name in told
            }
            return not isinstance(value, dict) or (
                (extra is not False or len(value) == len(known))
                and all(valid(item, told[name]) for name, item in known.items())
            )
    raise AssertionError(f"the checker does not know {word!r}")


_FLOAT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


def tree(text: str) -> Any:
    """YAML as an editor reads it (version 1.2, where 2e8 is a number)."""

    def converted(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: converted(item) for key, item in value.items()}
        if isinstance(value, list):
            return [converted(item) for item in value]
        return float(value) if isinstance(value, str) and _FLOAT.fullmatch(value) else value

    return converted(yaml.safe_load(text))


def wrong(kind: ValueType) -> list[object]:
    """Return values that a type does not allow, derived from its declaration."""
    if isinstance(kind, Bounds):
        outside = [kind.low - 1.0, kind.high + 1.0, kind.low * (not kind.low_allowed), kind.high]
        return [
            [1],
            "abc",
            *(value for value in outside if abs(value) < 1e30 and not kind.allow(value)),
        ]
    if isinstance(kind, Whole):
        return [kind.low - 1, kind.high + 1, kind.low + 0.5, "a"]
    if isinstance(kind, Choice):
        return ["no such name", {}]
    if isinstance(kind, EntriesOf):
        return [{}, 3, *([[]] if kind.least else []), *([one] for one in wrong(kind.type))]
    if isinstance(kind, Keys):
        return ["text", [1], {"no such key": 1}]
    return [[[]]] if not isinstance(kind, Either) else [[[]], {"no such key": 1}]


def spoiled(model: dict[str, Any], keys: Keys) -> list[dict[str, Any]]:
    """Return copies of the model with an invalid value for each of its keys, with an unknown key,
    and without each required key."""
    found: list[dict[str, Any]] = []
    for key in keys.declared:
        if key.name not in model:
            continue
        found += [{**copy.deepcopy(model), key.name: value} for value in wrong(key.type)]
        kinds = key.type.types if isinstance(key.type, Either) else (key.type,)
        inner = [kind for kind in kinds if isinstance(kind, Keys)]
        if inner and isinstance(model[key.name], dict):
            found += [{**model, key.name: value} for value in spoiled(model[key.name], inner[0])]
        if isinstance(key.type, EntriesOf) and isinstance(key.type.type, Keys):
            first, *rest = model[key.name]
            found += [
                {**model, key.name: [value, *rest]} for value in spoiled(first, key.type.type)
            ]
        if key.needed:
            found.append({name: value for name, value in model.items() if name != key.name})
    return [*found, {**model, "no such key": 1}]
