"""A checker of the part of JSON schema (draft 7) that tdint's schemas use; anything else in a schema is an error."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

TYPES: dict[str, Callable[[object], bool]] = {
    "object": lambda value: isinstance(value, dict),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "number": lambda value: isinstance(value, int | float) and not isinstance(value, bool),
    "integer": lambda value: isinstance(value, int | float) and not isinstance(value, bool) and value == int(value),
}
WORDS = ("$schema", "title", "description", "additionalProperties")


def valid(value: Any, schema: dict[str, Any]) -> bool:
    """Whether a value is as the schema says."""
    return all(_holds(word, told, value, schema) for word, told in schema.items() if word not in WORDS)


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
            known = isinstance(value, dict) and {name: item for name, item in value.items() if name in told}
            return not isinstance(value, dict) or (
                (extra is not False or len(value) == len(known))
                and all(valid(item, told[name]) for name, item in known.items())
            )
    raise AssertionError(f"the checker does not know {word!r}")
