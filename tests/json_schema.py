"""Checker for the part of JSON schema (draft 7) that the schemas of tdint use, and generator of
values that a schema must refuse.

Other keywords in a schema are errors. Invalid values follow from the declarations of the keys.
"""

import copy
import re
from collections.abc import Callable
from typing import Any

import yaml

from tdint.model.keys.fields import Bounds, Choice, Either, EntriesOf, Integer, Keys, ValueType

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
        _holds(word, expected, value, schema)
        for word, expected in schema.items()
        if word not in WORDS
    )


def _holds(word: str, expected: Any, value: Any, schema: dict[str, Any]) -> bool:
    """Return True if a value satisfies a keyword of a schema.

    Parameters
    ----------
    word, expected : str, object
        Keyword of the schema, and its value.
    value : object
        Value to be validated.
    schema : dict
        Complete schema, because some keywords depend on other keywords.
    """
    number = TYPES["number"](value)
    match word:
        case "type":
            return any(
                TYPES[name](value)
                for name in ([expected] if isinstance(expected, str) else expected)
            )
        case "enum":
            return value in expected
        case "anyOf":
            return any(valid(value, alternative) for alternative in expected)
        case "oneOf":
            return sum(valid(value, alternative) for alternative in expected) == 1
        case "allOf":
            return all(valid(value, alternative) for alternative in expected)
        case "minimum":
            return not number or value >= expected
        case "maximum":
            return not number or value <= expected
        case "exclusiveMinimum":
            return not number or value > expected
        case "exclusiveMaximum":
            return not number or value < expected
        case "pattern":
            return not isinstance(value, str) or re.search(expected, value) is not None
        case "items":
            return not isinstance(value, list) or all(valid(item, expected) for item in value)
        case "minItems":
            return not isinstance(value, list) or len(value) >= expected
        case "maxItems":
            return not isinstance(value, list) or len(value) <= expected
        case "required":
            return not isinstance(value, dict) or all(name in value for name in expected)
        case "properties":
            extra = schema.get("additionalProperties", True)
            known = isinstance(value, dict) and {
                name: item for name, item in value.items() if name in expected
            }
            return not isinstance(value, dict) or (
                (extra is not False or len(value) == len(known))
                and all(valid(item, expected[name]) for name, item in known.items())
            )
    raise AssertionError(f"the checker does not know {word!r}")


_FLOAT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


def tree(text: str) -> Any:
    """Return YAML as an editor reads it (version 1.2, where 2e8 is a number)."""

    def converted(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: converted(item) for key, item in value.items()}
        if isinstance(value, list):
            return [converted(item) for item in value]
        return float(value) if isinstance(value, str) and _FLOAT.fullmatch(value) else value

    return converted(yaml.safe_load(text))


def wrong(value_type: ValueType) -> list[object]:
    """Return values that a type does not allow, derived from its declaration."""
    if isinstance(value_type, Bounds):
        outside = [
            value_type.low - 1.0,
            value_type.high + 1.0,
            value_type.low * (not value_type.low_allowed),
            value_type.high,
        ]
        return [
            [1],
            "abc",
            *(value for value in outside if abs(value) < 1e30 and not value_type.allow(value)),
        ]
    if isinstance(value_type, Integer):
        return [value_type.low - 1, value_type.high + 1, value_type.low + 0.5, "a"]
    if isinstance(value_type, Choice):
        return ["no such name", {}]
    if isinstance(value_type, EntriesOf):
        return [
            *([] if value_type.or_one else [{}]),
            3,
            *([[]] if value_type.least else []),
            *([value_of_entry] for value_of_entry in wrong(value_type.type)),
        ]
    if isinstance(value_type, Keys):
        return ["text", [1], {"no such key": 1}]
    return [[[]]] if not isinstance(value_type, Either) else [[[]], {"no such key": 1}]


def spoiled(model: dict[str, Any], keys: Keys) -> list[dict[str, Any]]:
    """Return copies of the model with an invalid value for each of its keys, with an unknown key,
    and without each required key."""
    found: list[dict[str, Any]] = []
    for key in keys.declared:
        if key.name not in model:
            continue
        found += [{**copy.deepcopy(model), key.name: value} for value in wrong(key.type)]
        types = key.type.types if isinstance(key.type, Either) else (key.type,)
        inner = [value_type for value_type in types if isinstance(value_type, Keys)]
        if inner and isinstance(model[key.name], dict):
            found += [{**model, key.name: value} for value in spoiled(model[key.name], inner[0])]
        if isinstance(key.type, EntriesOf) and isinstance(key.type.type, Keys):
            first, *others = model[key.name]
            found += [
                {**model, key.name: [value, *others]} for value in spoiled(first, key.type.type)
            ]
        if key.needed:
            found.append({name: value for name, value in model.items() if name != key.name})
    return [*found, {**model, "no such key": 1}]
