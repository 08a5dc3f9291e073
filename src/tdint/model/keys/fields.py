"""Reading nodes as numbers, words and sections: what is wrong is noted with its place, and reading
goes on.

A faulty number is noted and read as nan. Comparisons with nan are false, so later checks that ask
"is it wrong?" stay silent about it: one fault gives one line.
"""

from __future__ import annotations

import math
import os
import re
import unicodedata
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import lt
from pathlib import Path
from typing import Any, Protocol, TypeVar

from tdint.errors import ModelFault, UsageError, did_you_mean, nearest
from tdint.model.definition import MAX_STORIES
from tdint.model.keys.nodes import Faults, ListNode, MappingNode, Node, ScalarNode
from tdint.written_numbers import LARGEST, SMALLEST

# ---- What a file may say under a key, declared once: the reader takes names and bounds from here,
# and so does the JSON schema that editors check a file against while it is written

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

    def allow(self, number: Any) -> Any:
        """Whether `number`, or each of an array, lies in the bounds."""
        above = number >= self.low if self.low_allowed else number > self.low
        below = number <= self.high if self.high_allowed else number < self.high
        return above & below

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
        return (
            {"anyOf": [result, {"type": "string", "pattern": _PERCENTAGE}]}
            if self.ratio
            else result
        )


ANY = Bounds()
POSITIVE = Bounds(low=0.0, low_allowed=False)
NOT_NEGATIVE = Bounds(low=0.0)
RATIO = Bounds(low=0.0, high=1.0, high_allowed=False, ratio=True)
POSITIVE_RATIO = Bounds(low=0.0, low_allowed=False, ratio=True)


@dataclass(frozen=True)
class Whole:
    """A whole number within bounds; `what` says what these stand for."""

    low: int
    high: int
    what: str = ""

    def schema(self) -> Schema:
        return {"type": "integer", "minimum": self.low, "maximum": self.high}


def numbered(count: int | None) -> Whole:
    """The number of a floor or mode of a model with `count` stories, None where a fault leaves that
    open."""
    return Whole(1, count or MAX_STORIES, " (the number of stories)" if count else "")


@dataclass(frozen=True)
class Flag:
    """True or false."""

    def schema(self) -> Schema:
        return {"type": "boolean"}


@dataclass(frozen=True)
class Words:
    """A line of text; a number without quotes is one, too. `parse` makes of it what is meant, and
    raises UsageError."""

    parse: Callable[[str], Any] | None = None

    def schema(self) -> Schema:
        return {"type": ["string", "number"]}


@dataclass(frozen=True)
class PathOf:
    """The path of a file, relative to the one that it stands in; `-` is standard input."""

    def schema(self) -> Schema:
        return {"type": "string"}


@dataclass(frozen=True)
class Choice:
    """One of some names; `what` says what they name."""

    names: tuple[str, ...]
    what: str = "value"

    def schema(self) -> Schema:
        return {"enum": list(self.names)}


@dataclass(frozen=True)
class EntriesOf:
    """A list whose entries are of one kind; `what` says it in words, `short` what to do where there
    are too few, and `distinct` what entries are none of which stands twice."""

    kind: ValueKind
    least: int = 0
    most: int | None = None
    what: str = "a list"
    short: str = ""
    growing: bool = False
    distinct: str = ""

    def schema(self) -> Schema:
        limits = {"minItems": self.least} if self.least else {}
        limits |= {"maxItems": self.most} if self.most is not None else {}
        return {"type": "array", "items": self.kind.schema(), **limits}


@dataclass(frozen=True)
class ByName:
    """A mapping with names of its own choice; `make` takes the value and what stands under each
    name."""

    kind: ValueKind
    what: str
    none: str
    make: Callable[..., Any]

    def schema(self) -> Schema:
        return {"type": "object", "additionalProperties": self.kind.schema()}


@dataclass(frozen=True)
class Either:
    """One of several kinds; `what` says it in words."""

    kinds: tuple[ValueKind, ...]
    what: str = ""

    def schema(self) -> Schema:
        return {"anyOf": [kind.schema() for kind in self.kinds]}


@dataclass(frozen=True)
class Key:
    """A key of a mapping: its name, what stands under it, what it means, and whether it must be
    there."""

    name: str
    kind: ValueKind
    meaning: str = ""
    needed: bool = False
    advice: str = ""


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
    ways: tuple[tuple[str, ...], ...] = ()
    what: str = ""
    make: Callable[..., Any] | None = None

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
            key.name: key.kind.schema() | ({"description": key.meaning} if key.meaning else {})
            for key in self.declared
        }
        result: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
        needed = [key.name for key in self.declared if key.needed]
        if needed:
            result["required"] = needed
        if self.one_of:
            result["allOf"] = [
                {"oneOf": [{"required": [name]} for name in names]} for names in self.one_of
            ]
        return result


# ---- Fields

Parsed = TypeVar("Parsed")

_NUMBER = re.compile(r"[+-]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WHOLE = re.compile(r"[+-]?(?:0|[1-9][0-9]{0,17})")
_NUMBER_HINTS = (
    (re.compile(r"[+-]?0[0-9][0-9.eE+-]*"), "; drop the leading zeros"),
    (re.compile(r"[0-9.eE+-]*[0-9]_[0-9_.eE+-]*"), "; drop the underscores"),
    (re.compile(r"[+-]?[0-9]+,[0-9]+"), "; write a decimal point"),
    (re.compile(r"[+-]?\.?(?:nan|inf|infinity)", re.IGNORECASE), "; it must be finite"),
    (re.compile(r"[+-]?[0-9][0-9.]*\s*[A-Za-z%].*"), "; write the number alone"),
)
_NOTHING = ("", "~", "null")
_NOTHING_THERE = MappingNode(0, 0, ())

_MEANT = 0.75
"""How alike an unknown key must be to a known one that is not there for its value to be read as
that of the other."""


@dataclass(frozen=True, eq=False)
class Value:
    """A node under its key, such as `stories[2].mass`; entries of a list count from 1.

    `kind` is what its key declares: bounds that are not given otherwise are those of it.
    """

    node: Node
    key: str
    faults: Faults
    kind: ValueKind | None = None

    @property
    def is_list(self) -> bool:
        """Whether the value is a list."""
        return isinstance(self.node, ListNode)

    @property
    def is_mapping(self) -> bool:
        """Whether the value is a mapping."""
        return isinstance(self.node, MappingNode)

    @property
    def word(self) -> str:
        """The text of a single value, as it stands; empty for anything else and for nothing."""
        return (
            self.node.text if isinstance(self.node, ScalarNode) and not self._is_nothing() else ""
        )

    @property
    def place(self) -> ModelFault:
        """Where it stands."""
        return ModelFault(self.faults.source, self.node.line, self.node.column, self.key, "")

    def fault(self, message: str) -> None:
        """Note what is wrong with this value."""
        self.faults.add(self.node, self.key, message)

    def is_word(self, word: str) -> bool:
        """Whether the value is the word, quoted or not."""
        return isinstance(self.node, ScalarNode) and self.node.text == word

    def number(self, bounds: Bounds | None = None, scale: float = 1.0, expected: str = "") -> float:
        """The number times `scale`, its factor to SI; nan if there is a fault.

        `bounds` hold for the number in the file; `expected` says what it must be where they do not.
        """
        bounds = bounds or (self.kind if isinstance(self.kind, Bounds) else ANY)
        number = self._bare_number(bounds)
        if not bounds.allow(number):
            self.fault(f"must be {expected or bounds}, got {self._shown_unquoted(_NUMBER, bounds)}")
            return math.nan
        # Zero is zero in any unit; other sizes must be such as buildings have.
        converted = number * scale if number else 0.0
        if number != 0.0 and not SMALLEST <= abs(converted) <= LARGEST:
            limits = f"{SMALLEST:g} and {LARGEST:g} in SI units"
            self.fault(
                f"is out of all proportion: its size must lie between {limits}, got {self._shown()}"
            )
            return math.nan
        return converted

    def whole(self, bounds: Whole) -> int | None:
        """The whole number within bounds; None if there is a fault."""
        text, low, high = self._plain_text(), bounds.low, bounds.high
        if _WHOLE.fullmatch(text) and low <= int(text) <= high:
            return int(text)
        limits = f"{low}" if low == high else f"a whole number from {low} to {high}"
        self.fault(f"must be {limits}{bounds.what}, got {self._shown_unquoted(_NUMBER)}")
        return None

    def boolean(self) -> bool:
        """True or false; false if there is a fault."""
        if self._plain_text() not in ("true", "false"):
            self.fault(f"must be true or false, got {self._shown_unquoted('true|false')}")
        return self._plain_text() == "true"

    def text(self) -> str | None:
        """A line of text, quoted or not; None if there is a fault."""
        if (
            not isinstance(self.node, ScalarNode)
            or not self.node.text.strip()
            or self._is_nothing()
        ):
            self.fault(f"must be text, got {self._shown()}")
            return None
        if any(unicodedata.category(character) in ("Cc", "Cs") for character in self.node.text):
            self.fault(f"must be one line without control characters, got {self._shown()}")
            return None
        return self.node.text

    def file(self, *, stdin: bool = False) -> str | None:
        """The path of a file, which starts from the folder of the one that it stands in, as seen
        from the working directory; None if there is a fault. With `stdin`, `-` stays what it is.
        """
        text = self.text()
        return (
            text if text is None or (stdin and text == "-") else resolve(text, self.faults.folder)
        )

    def read(self) -> Any:
        """The value as its key declares it, a number, a word, true or false; None if there is a
        fault."""
        match self.kind:
            case Bounds():
                number = self.number()
                return None if math.isnan(number) else number
            case Whole():
                return self.whole(self.kind)
            case Either():
                return self._alternative(self.kind)
            case EntriesOf():
                return self._entries_of(self.kind)
            case Keys():
                return self._made(self.kind)
            case Flag():
                return self.boolean()
            case Choice(names, what):
                return self.choice(names, what)
            case ByName():
                return self._by_name(self.kind)
            case PathOf():
                return self.file(stdin=True)
            case Words(parse):
                return self.parsed(parse) if parse else self.text()
        raise TypeError(f"{self.key}: {self.kind} is read by its own reader")

    def _alternative(self, either: Either) -> Any:
        shape = (
            Keys
            if self.is_mapping
            else EntriesOf
            if self.is_list
            else (Bounds, Whole, Choice, PathOf)
        )
        # By its shape one kind is meant: messages are then of that one alone.
        for kind in either.kinds:
            if isinstance(kind, shape) and not (
                isinstance(kind, Choice) and self.word not in kind.names
            ):
                if isinstance(kind, Bounds):
                    number = self.number(kind, expected=either.what)
                    return None if math.isnan(number) else number
                return replace(self, kind=kind).read()
        self.fault(f"must be {either.what}, got {self._shown()}")
        return None

    def _entries_of(self, kind: EntriesOf) -> Any:
        items = self.items(kind.what)
        if items is None:
            return None
        # The members first, so that all that is wrong with them is told beside their number.
        values = tuple(item.read() for item in items)
        if not kind.least <= len(items) <= (kind.most or math.inf):
            self.fault(
                kind.short
                if kind.short and len(items) < kind.least
                else f"must be {kind.what}, got {len(items)}"
            )
            return None
        if None in values:
            return None
        if kind.distinct and len({*values}) < len(values):
            self.fault(
                f"must be {kind.distinct}, got {next(v for v in values if values.count(v) > 1)} "
                "twice"
            )
            return None
        if kind.growing and not all(map(lt, values, values[1:])):
            self.fault(f"must be {kind.what}")
        return values

    def _by_name(self, kind: ByName) -> Any:
        entries = self.named(kind.what, kind.none)
        if entries is None:
            return None
        return kind.make(
            self,
            {
                name: (entry, replace(entry, kind=kind.kind).read())
                for name, entry in entries.items()
            },
        )

    def _made(self, kind: Keys) -> Any:
        """What the mapping's own `make` gives of its entries; by one of its ways, where it has
        several."""
        section = self.section(kind, kind.what)
        if section is None:
            return None
        # One way of several: keys of two of them contradict each other.
        given = [way for way in kind.ways if section.has(*way)]
        if len(given) > 1:
            self.fault(f"give either {' or '.join(map(' and '.join, given))}, not both")
            return None
        if kind.ways and not any(section.mentions(*way) for way in kind.ways):
            self.fault(f"must be {kind.what}, got a mapping without either")
        # All entries are read, those of a mapping that is not complete, too, for their faults.
        needed = {*given[0]} if given else {key.name for key in kind.declared if key.needed}
        values = {}
        for key in kind.declared:
            advice = key.advice or (f"give {key.kind}" if isinstance(key.kind, Bounds) else "")
            value = section.need(key.name, advice) if key.name in needed else section.get(key.name)
            values[key.name] = value.read() if value else None
        complete = (
            all(values[name] is not None for name in needed)
            if needed
            else bool(any(values.values()))
        )
        return kind.make(self, **values) if kind.make and complete else None

    def parsed(self, parse: Callable[[str], Parsed]) -> Parsed | None:
        """What `parse` makes of the text; None if there is a fault, as where it raises
        UsageError."""
        text = self.text()
        if text is None:
            return None
        try:
            return parse(text)
        except UsageError as error:
            self.fault(str(error))
            return None

    def choice(self, names: Collection[str], kind: str) -> str | None:
        """One of the `names`; None if there is a fault. `kind` says what they name."""
        if not isinstance(self.node, ScalarNode) or self._is_nothing():
            self.fault(f"must be the name of a {kind}, got {self._shown()}")
        elif self.node.text not in names:
            self.fault(f"unknown {kind} {self._shown()}{_advice(self.node.text, names)}")
        else:
            return self.node.text
        return None

    def items(self, expected: str, empty: str = "") -> tuple[Value, ...] | None:
        """The entries of a list; None if there is a fault. `expected`: what the list must be, and
        `empty`, if it must have entries, what is wrong without."""
        if not isinstance(self.node, ListNode):
            self.fault(f"must be {expected}, got {self._shown()}")
            return None
        if empty and not self.node.items:
            self.fault(empty)
        kind = self.kind.kind if isinstance(self.kind, EntriesOf) else None
        entries = enumerate(self.node.items, start=1)
        return tuple(Value(item, f"{self.key}[{i}]", self.faults, kind) for i, item in entries)

    def section(self, keys: Collection[str] | None = None, expected: str = "") -> Section | None:
        """The entries of a mapping, by default those that its key declares; None if there is a
        fault. `expected` says what the value must be if not just that."""
        if keys is None:
            assert isinstance(self.kind, Keys)
            keys = self.kind
        if not isinstance(self.node, MappingNode):
            self.fault(
                f"must be {expected or 'a mapping with the keys ' + ', '.join(keys)}, got "
                f"{self._shown()}"
            )
            return None
        return Section(self, self.node, keys)

    def peek(self, name: str) -> Value | None:
        """The entry `name` of a mapping whose known keys depend on it; nothing is noted."""
        for key, entry in self.node.entries if isinstance(self.node, MappingNode) else ():
            if isinstance(key, ScalarNode) and key.text == name:
                return Value(entry, f"{self.key}.{name}", self.faults)
        return None

    @property
    def names(self) -> list[str]:
        """The keys of a mapping, as far as they are texts."""
        entries = self.node.entries if isinstance(self.node, MappingNode) else ()
        return [key.text for key, _ in entries if isinstance(key, ScalarNode)]

    def named(self, expected: str, empty: str = "") -> dict[str, Value] | None:
        """The entries of a mapping with names of its own choice; None if there is a fault.
        `expected`: what the mapping must be, and `empty`, if it must have entries, what is wrong
        without."""
        section = self.section(self.names, expected)
        if section is None:
            return None
        if empty and not self.names:
            self.fault(empty)
            return None
        return {name: entry for name in dict.fromkeys(self.names) if (entry := section.get(name))}

    def _bare_number(self, bounds: Bounds) -> float:
        """The number as it stands in the file, of a ratio also as a percentage; nan if it is
        none."""
        text, unit = self._plain_text(), 1.0
        if bounds.ratio and isinstance(self.node, ScalarNode) and self.node.text.endswith("%"):
            text, unit = self.node.text[:-1].rstrip(), 100.0
        return float(text) / unit if _NUMBER.fullmatch(text) else math.nan

    def _plain_text(self) -> str:
        return self.node.text if isinstance(self.node, ScalarNode) and self.node.plain else ""

    def _is_nothing(self) -> bool:
        return isinstance(self.node, ScalarNode) and self.node.plain and self.node.text in _NOTHING

    def _shown(self) -> str:
        """The value as messages show it."""
        if isinstance(self.node, ListNode):
            return "a list"
        if isinstance(self.node, MappingNode):
            return "a mapping"
        if self._is_nothing():
            return "nothing"
        return quoted(self.node.text)

    def _shown_unquoted(self, pattern: str | re.Pattern[str], bounds: Bounds = ANY) -> str:
        """The same where quotes are out of place, with what to do about the value as far as that
        can be told."""
        if not isinstance(self.node, ScalarNode) or not math.isnan(self._bare_number(bounds)):
            return self._shown()
        if re.fullmatch(pattern, self.node.text):
            return self._shown() + ("" if self.node.plain else " in quotes; remove the quotes")
        return self._shown() + next(
            (hint for form, hint in _NUMBER_HINTS if form.fullmatch(self.node.text)), ""
        )


class Section:
    """The entries of a mapping. Unknown, repeated and merge keys are noted when it is made.

    Attributes
    ----------
    value : Value
        The mapping itself, for faults that concern it as a whole.
    """

    def __init__(self, value: Value, node: MappingNode, keys: Collection[str]) -> None:
        self.value = value
        self._entries: dict[str, Value] = {}
        self._kinds = keys.kinds() if isinstance(keys, Keys) else {}
        self._excused: set[str] = set()  # keys whose absence follows from a fault already noted
        lines: dict[str, int] = {}
        for key, entry in node.entries:
            if not isinstance(key, ScalarNode):
                value.faults.add(key, value.key, "a key must be a word, got a list or a mapping")
                continue
            path = self.path(key.text)
            if key.text in lines:
                value.faults.add(key, path, f"duplicate key, first given on line {lines[key.text]}")
                continue
            lines[key.text] = key.line
            if key.text in keys:
                self._entries[key.text] = Value(
                    entry, path, value.faults, self._kinds.get(key.text)
                )
            elif key.text == "<<" and key.plain:
                value.faults.add(key, path, "merge keys are not supported; write the entries out")
                self._excused.update(keys)
            else:
                value.faults.add(key, path, "unknown key" + _advice(key.text, keys))
                self._excused.update(filter(None, [nearest(key.text, keys)]))

        # What stands under a misspelled key is read as that of the key that was meant, for the
        # faults in it.
        for key, entry in node.entries:
            if not isinstance(key, ScalarNode) or key.text in keys:
                continue
            meant = nearest(key.text, keys, cutoff=_MEANT)
            if meant and meant not in self._entries:
                self._entries[meant] = Value(
                    entry, self.path(key.text), value.faults, self._kinds.get(meant)
                )

    def has(self, *names: str) -> bool:
        """Whether one of the entries is there."""
        return any(name in self._entries for name in names)

    def mentions(self, *names: str) -> bool:
        """Whether one of the entries is there or was meant by a key already noted as wrong."""
        return any(name in self._entries or name in self._excused for name in names)

    def path(self, name: str) -> str:
        """The full key of the entry `name`."""
        shown = name if re.fullmatch(r"[\w<.-]{1,40}", name) else quoted(name)
        return f"{self.value.key}.{shown}" if self.value.key else shown

    def get(self, name: str) -> Value | None:
        """The entry, or None if the section lacks it."""
        return self._entries.get(name)

    def need(self, name: str, advice: str = "") -> Value | None:
        """The entry; its absence is a fault, to which `advice` adds what to give."""
        if not self.mentions(name):
            message = f"is missing; {advice}" if advice else "is missing"
            self.value.faults.add(self.value.node, self.path(name), message)
        return self._entries.get(name)

    def number(
        self,
        name: str,
        bounds: Bounds | None = None,
        scale: float = 1.0,
        default: float | None = None,
    ) -> float:
        """The number of the entry; without a `default` the entry must be there, and nan stands for
        a fault.

        The bounds are those that the key declares, unless others are given.
        """
        declared = self._kinds.get(name)
        bounds = bounds or (declared if isinstance(declared, Bounds) else ANY)
        value = self.need(name, f"give {bounds}") if default is None else self.get(name)
        if value is not None:
            return value.number(bounds, scale)
        return math.nan if default is None else default

    def read(self, name: str, default: Any = None) -> Any:
        """The entry as its key declares it (`Value.read`); the default if the section lacks it."""
        value = self.get(name)
        return value.read() if value else default

    def given(self, *names: str) -> dict[str, Any]:
        """The entries that are there, as their keys declare them."""
        return {name: value.read() for name in names if (value := self.get(name))}

    def inner(self, name: str) -> Section:
        """The section under a key, as that declares it: an empty one if there is none, or after a
        fault."""
        value = self.get(name)
        section = value.section() if value else None
        return section or Section(
            Value(_NOTHING_THERE, self.path(name), self.value.faults), _NOTHING_THERE, ()
        )

    def refuse(self, names: Collection[str], reason: str) -> None:
        """Note that some entries, where they are there, have no place in this section."""
        for name in names:
            if entry := self.get(name):
                entry.fault(reason)

    def file(self, name: str, *, stdin: bool = False) -> str | None:
        """The path of the entry, as `Value.file` has it; None if the section lacks it or it is
        faulty."""
        value = self.get(name)
        return value.file(stdin=stdin) if value else None


def resolve(file: str, folder: Path) -> str:
    """The path as seen from the working directory, without `folder/..` where that means the
    same."""
    path = os.fspath(folder / file)
    plain = os.path.normpath(path)
    return plain if os.path.realpath(plain) == os.path.realpath(path) else path


def quoted(text: str) -> str:
    """Text of the file in quotes, on one line and not too long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _advice(name: str, names: Collection[str]) -> str:
    if name.isdecimal():  # {height: 3,5}
        return "; a comma divides entries here: write a decimal point"
    return did_you_mean(name, names) or f"; known: {', '.join(names)}"
