"""What a file may say under a key, declared once: the reader takes names and bounds from here, and so does the JSON
schema that editors check a file against while it is written."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

Schema = dict[str, Any]

_PERCENTAGE = r"^[0-9.]+([eE][+-]?[0-9]+)?%$"


class ValueKind(Protocol):
    """What the value of a key is."""

    def schema(self) -> Schema:
        """The JSON schema (draft 7) of such values."""


@dataclass(frozen=True)
class Bounds:
    """Numbers that a key allows; a `ratio` may be written 0.05 or 5%."""

    low: float = -math.inf
    high: float = math.inf
    low_allowed: bool = True
    high_allowed: bool = True
    ratio: bool = False

    def allow(self, number: float) -> bool:
        """Whether `number` lies in the bounds."""
        above = number >= self.low if self.low_allowed else number > self.low
        below = number <= self.high if self.high_allowed else number < self.high
        return above and below

    def __str__(self) -> str:
        if self.low == 0.0 and self.high == math.inf:
            return "zero or a positive number" if self.low_allowed else "a positive number"
        limits = []
        if self.low > -math.inf:
            limits.append(f"{'of at least' if self.low_allowed else 'above'} {self.low:g}")
        if self.high < math.inf:
            limits.append(f"{'of at most' if self.high_allowed else 'below'} {self.high:g}")
        return " ".join(["a number", " and ".join(limits)]).rstrip()

    def schema(self) -> Schema:
        """A number within the bounds; a percentage is checked for its form alone."""
        result: Schema = {"type": "number"}
        if self.low > -math.inf:
            result["minimum" if self.low_allowed else "exclusiveMinimum"] = self.low
        if self.high < math.inf:
            result["maximum" if self.high_allowed else "exclusiveMaximum"] = self.high
        return {"anyOf": [result, {"type": "string", "pattern": _PERCENTAGE}]} if self.ratio else result


ANY = Bounds()
POSITIVE = Bounds(low=0.0, low_allowed=False)
NOT_NEGATIVE = Bounds(low=0.0)
RATIO = Bounds(low=0.0, high=1.0, high_allowed=False, ratio=True)
POSITIVE_RATIO = Bounds(low=0.0, low_allowed=False, ratio=True)


@dataclass(frozen=True)
class Whole:
    """A whole number within bounds."""

    low: int
    high: int

    def schema(self) -> Schema:
        return {"type": "integer", "minimum": self.low, "maximum": self.high}


@dataclass(frozen=True)
class Flag:
    """True or false."""

    def schema(self) -> Schema:
        return {"type": "boolean"}


@dataclass(frozen=True)
class Words:
    """A line of text; a number without quotes is one, too."""

    def schema(self) -> Schema:
        return {"type": ["string", "number"]}


@dataclass(frozen=True)
class Choice:
    """One of some names; `what` says what they name."""

    names: tuple[str, ...]
    what: str = "value"

    def schema(self) -> Schema:
        return {"enum": list(self.names)}


@dataclass(frozen=True)
class EntriesOf:
    """A list whose entries are of one kind."""

    kind: ValueKind
    least: int = 0
    most: int | None = None

    def schema(self) -> Schema:
        limits = {"minItems": self.least} if self.least else {}
        limits |= {"maxItems": self.most} if self.most is not None else {}
        return {"type": "array", "items": self.kind.schema(), **limits}


@dataclass(frozen=True)
class Either:
    """One of several kinds."""

    kinds: tuple[ValueKind, ...]

    def schema(self) -> Schema:
        return {"anyOf": [kind.schema() for kind in self.kinds]}


@dataclass(frozen=True)
class Key:
    """A key of a mapping: its name, what stands under it, what it means, and whether it must be there."""

    name: str
    kind: ValueKind
    meaning: str = ""
    needed: bool = False


@dataclass(frozen=True)
class Keys(Sequence[str]):
    """The keys of a mapping, as a sequence of their names.

    Attributes
    ----------
    declared : tuple of Key
        In the order in which messages name them.
    one_of : tuple of tuple of str
        Of each of these groups of keys one, and only one, must be there.
    """

    declared: tuple[Key, ...]
    one_of: tuple[tuple[str, ...], ...] = ()

    def __getitem__(self, place: Any) -> Any:
        return tuple(self)[place]

    def __len__(self) -> int:
        return len(self.declared)

    def __iter__(self) -> Iterator[str]:
        return (key.name for key in self.declared)

    def kinds(self) -> Mapping[str, ValueKind]:
        """The kind of each key."""
        return {key.name: key.kind for key in self.declared}

    def schema(self) -> Schema:
        properties = {
            key.name: key.kind.schema() | ({"description": key.meaning} if key.meaning else {}) for key in self.declared
        }
        result: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
        needed = [key.name for key in self.declared if key.needed]
        if needed:
            result["required"] = needed
        if self.one_of:
            result["allOf"] = [{"oneOf": [{"required": [name]} for name in names]} for names in self.one_of]
        return result
