"""Convert the nodes of a model file to numbers, text and sections, and collect all errors.

Reading continues after an error, so that a single call reports all errors of a file with their
lines and columns. An invalid number is reported and read as nan. Comparisons with nan are false, so
later checks do not report the same number again.
"""

from __future__ import annotations

import math
import os
import re
import unicodedata
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import lt
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar, cast

from tdint.errors import MAX_LISTED_FAULTS, ModelFault, UsageError, did_you_mean, nearest
from tdint.model.keys.nodes import Faults, ListNode, MappingNode, Node, ScalarNode
from tdint.model.story import MAX_STORIES
from tdint.number_parsing import LARGEST, SMALLEST, number_or_nan, ratio_parts

# ---- Declarations of keys. Both the reader and the JSON schema (editors use the schema to check a
# file during writing) use the names and bounds that are declared here.

Schema = dict[str, Any]

_PERCENTAGE_OR_FRACTION = r"^[0-9.]+([eE][+-]?[0-9]+)? *(%|/ *[0-9.]+([eE][+-]?[0-9]+)?)$"


class ValueType(Protocol):
    """Type of the value of a key."""

    def schema(self) -> Schema:
        """Return the JSON schema (draft 7) of these values."""


class Bounds(NamedTuple):
    """Range of allowed numbers. A `ratio` can be written as 0.05, as 5% or as 1/20."""

    low: float = -math.inf
    high: float = math.inf
    low_allowed: bool = True
    high_allowed: bool = True
    ratio: bool = False

    def allow(self, number: Any) -> Any:
        """Return True if `number` is within the bounds; for an array, a mask of its elements."""
        is_above_low = number >= self.low if self.low_allowed else number > self.low
        is_below_high = number <= self.high if self.high_allowed else number < self.high
        return is_above_low & is_below_high

    def __str__(self) -> str:
        """Return the description of the allowed numbers in messages, with its article."""
        if self.low == 0.0 and self.high == math.inf:
            return "zero or a positive number" if self.low_allowed else "a positive number"
        limit_texts = []
        if self.low > -math.inf:
            limit_texts.append(f"{'of at least' if self.low_allowed else 'above'} {self.low:g}")
        if self.high < math.inf:
            limit_texts.append(f"{'of at most' if self.high_allowed else 'below'} {self.high:g}")
        return " ".join(["a number", " and ".join(limit_texts)]).rstrip()

    def schema(self) -> Schema:
        """Return the schema of a number within the bounds; percentages and fractions are checked
        by form only."""
        result: Schema = {"type": "number"}
        if self.low > -math.inf:
            result["minimum" if self.low_allowed else "exclusiveMinimum"] = self.low
        if self.high < math.inf:
            result["maximum" if self.high_allowed else "exclusiveMaximum"] = self.high
        return (
            {"anyOf": [result, {"type": "string", "pattern": _PERCENTAGE_OR_FRACTION}]}
            if self.ratio
            else result
        )


ANY = Bounds()
POSITIVE = Bounds(low=0.0, low_allowed=False)
NOT_NEGATIVE = Bounds(low=0.0)
RATIO = Bounds(low=0.0, high=1.0, high_allowed=False, ratio=True)
DRIFT_BOUNDS = Bounds(low=0.0, high=1.0, low_allowed=False, ratio=True)
"""Drift ratio. A drift above the story height is a percentage without the percent sign."""


class Integer(NamedTuple):
    """Whole number within bounds; `description` explains the bounds in messages."""

    low: int
    high: int
    description: str = ""

    def schema(self) -> Schema:
        """Return the JSON schema of the whole numbers within the bounds."""
        return {"type": "integer", "minimum": self.low, "maximum": self.high}


def numbered(count: int | None) -> Integer:
    """Return the declaration of a floor or mode number.

    `count` is the number of stories of the model; None if it is unknown because of an error.
    """
    return Integer(1, count or MAX_STORIES, " (the number of stories)" if count else "")


class Flag:
    """Boolean value, true or false."""

    def schema(self) -> Schema:
        """Return the JSON schema of true and false."""
        return {"type": "boolean"}


class TextLine(NamedTuple):
    """One line of text, which may also be a number without quotation marks.

    `parse` converts the text and raises UsageError if the text is invalid. `form` describes the
    text in messages. With `may_be_empty`, a null value is an empty text.
    """

    parse: Callable[[str], Any] | None = None
    form: str = "text"
    may_be_empty: bool = False

    def schema(self) -> Schema:
        """Return the JSON schema of a text or a number; `parse` is not part of the schema."""
        return {"type": ["string", "number", *(["null"] if self.may_be_empty else [])]}


class PathOf:
    """Path relative to the file that contains it; `-` is standard input."""

    def schema(self) -> Schema:
        """Return the JSON schema of a text."""
        return {"type": "string"}


class Choice(NamedTuple):
    """One of several names; `description` is their noun in messages."""

    names: tuple[str, ...]
    description: str = "value"

    def schema(self) -> Schema:
        """Return the JSON schema of the allowed names."""
        return {"enum": list(self.names)}


class EntriesOf(NamedTuple):
    """List with entries of a single type.

    Attributes
    ----------
    description : str
        Description of the list in messages.
    short : str
        Message if there are fewer than `least` entries.
    growing : bool
        Each entry must be larger than the entry before.
    distinct : str
        If not empty, entries must differ; the text describes the list in messages.
    or_one : bool
        A mapping instead of the list is its only entry.
    """

    type: ValueType
    least: int = 0
    most: int | None = None
    description: str = "a list"
    short: str = ""
    growing: bool = False
    distinct: str = ""
    or_one: bool = False

    def schema(self) -> Schema:
        """Return the JSON schema of a list with the allowed number of entries."""
        limits = {"minItems": self.least} if self.least else {}
        limits |= {"maxItems": self.most} if self.most is not None else {}
        entry = self.type.schema()
        schema = {"type": "array", "items": entry, **limits}
        return {"anyOf": [entry, schema]} if self.or_one else schema


class NamedEntries(NamedTuple):
    """Mapping with names that the user chooses.

    Attributes
    ----------
    pattern : str
        Regular expression of the names; empty for any names.
    least : int
        Minimum number of entries.
    description, empty_message : str
        Description of the mapping in messages; message if it is empty.
    """

    type: ValueType
    pattern: str = ""
    least: int = 0
    description: str = ""
    empty_message: str = ""

    def schema(self) -> Schema:
        """Return the JSON schema of the mapping."""
        result: Schema = {"type": "object", "additionalProperties": self.type.schema()}
        if self.pattern:
            names = {self.pattern: self.type.schema()}
            result = {"type": "object", "patternProperties": names, "additionalProperties": False}
        return result | ({"minProperties": self.least} if self.least else {})


class Either(NamedTuple):
    """One of several types; `description` describes them in messages."""

    types: tuple[ValueType, ...]
    description: str = ""

    def schema(self) -> Schema:
        """Return the JSON schema of a value of any of the types."""
        return {"anyOf": [value_type.schema() for value_type in self.types]}


class Key(NamedTuple):
    """Key of a mapping.

    Attributes
    ----------
    meaning : str
        Description in the JSON schema.
    advice : str
        Remedy in the message if the key is missing.
    """

    name: str
    type: ValueType
    meaning: str = ""
    needed: bool = False
    advice: str = ""


@dataclass(frozen=True)
class Keys(Sequence[str]):
    """Keys of a mapping, as a sequence of their names.

    Attributes
    ----------
    declared : tuple of Key
        Keys in their order in messages.
    one_of : tuple of tuple of str
        Groups of keys. Exactly one key of each group is required.
    alternative_groups : tuple of tuple of str
        Groups of keys. A mapping must contain all keys of a single group and no key of another
        group.
    description : str
        Description of the mapping in messages.
    make : callable, optional
        Converts the mapping. Receives the `Value` of the mapping and, as keyword arguments, the
        converted value of each declared key (None if it is missing).
    other_names : tuple of (str, str)
        Unknown names that users try, each with the key that is meant, or with a remedy.
    """

    declared: tuple[Key, ...]
    one_of: tuple[tuple[str, ...], ...] = ()
    alternative_groups: tuple[tuple[str, ...], ...] = ()
    description: str = ""
    make: Callable[..., Any] | None = None
    other_names: tuple[tuple[str, str], ...] = ()

    def __getitem__(self, index: Any) -> Any:
        """Return the name at an index, or a tuple of the names of a slice."""
        return tuple(self)[index]

    def __len__(self) -> int:
        """Return the number of keys."""
        return len(self.declared)

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the keys."""
        return (key.name for key in self.declared)

    def types(self) -> Mapping[str, ValueType]:
        """Return the type of each key by its name."""
        return {key.name: key.type for key in self.declared}

    def schema(self) -> Schema:
        """Return the schema of a mapping with these keys.

        It requires the needed keys, and exactly one key of each group in `one_of`.
        """
        properties = {
            key.name: key.type.schema() | ({"description": key.meaning} if key.meaning else {})
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

NUMBER = re.compile(r"[+-]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
"""Text of a number in a model file."""
_WHOLE_NUMBER = r"[+-]?(?:0|[1-9][0-9]{0,17})"
_NUMBER_HINTS = (
    (r"[+-]?0[0-9][0-9.eE+-]*", "; drop the leading zeros"),
    (r"[0-9.eE+-]*[0-9]_[0-9_.eE+-]*", "; drop the underscores"),
    (r"[+-]?[0-9]+,[0-9]+", "; write a decimal point"),
    (r"(?i)[+-]?\.?(?:nan|inf|infinity)", "; it must be finite"),
    (r"[+-]?[0-9][0-9.]*\s*[A-Za-z%].*", "; write the number without a unit"),
)
_NULL_TEXTS = ("", "~", "null")
"""Texts of a null value in YAML, without quotation marks."""

_EMPTY_MAPPING = MappingNode(0, 0, ())

ROOF = "roof"
"""Name of the highest floor, which can be used instead of its number."""

_MIN_SIMILARITY = 0.75
"""Dimensionless (difflib ratio). An unknown key that is at least this similar to a missing known
key is treated as a misspelling: its value is checked as the value of the known key."""


class Value(NamedTuple):
    """Node of a model file with its full key, such as `stories[2].mass` (lists start at 1).

    Attributes
    ----------
    key : str
        Full key for messages.
    faults : Faults
        Collection that receives errors.
    type : ValueType, optional
        Declared type of the value. Its bounds apply if a method is called without bounds.
    """

    node: Node
    key: str
    faults: Faults
    type: ValueType | None = None

    @property
    def is_list(self) -> bool:
        """True if the value is a list."""
        return isinstance(self.node, ListNode)

    @property
    def is_mapping(self) -> bool:
        """True if the value is a mapping."""
        return isinstance(self.node, MappingNode)

    @property
    def word(self) -> str:
        """Text of a scalar value; empty for lists, mappings and missing values."""
        return self.node.text if isinstance(self.node, ScalarNode) and not self._is_null() else ""

    @property
    def location(self) -> ModelFault:
        """Source, line, column and key of the value, as a `ModelFault` without a message."""
        return ModelFault(self.faults.source, self.node.line, self.node.column, self.key, "")

    def fault(self, message: str) -> None:
        """Report an error of the value."""
        self.faults.add(self.node, self.key, message)

    def floor(self, count: int | None, names: Sequence[str] = ()) -> int:
        """Return the number of the floor: a number from 1, or `roof`; 0 after reporting an error.

        `count` is the number of stories; None if it is unknown because of an error. `names` are the
        names of rows and attachments, which may also be given; empty for a floor without a name.
        """
        if self.word in names and not self.word.isdecimal():
            return names.index(self.word) + 1
        if self.is_word(ROOF):
            return count or 0
        if any(names) and self.word and not self.word[0].isdecimal():
            self.choice([name for name in names if name], "row or attachment")
            return 0
        return self.integer(numbered(count)) or 0

    def is_word(self, word: str) -> bool:
        """Return True if the value is `word`, with or without quotation marks."""
        return isinstance(self.node, ScalarNode) and self.node.text == word

    def number(self, bounds: Bounds | None = None, scale: float = 1.0, expected: str = "") -> float:
        """Return the number in SI units, or nan after reporting an error.

        Parameters
        ----------
        bounds : Bounds, optional
            Allowed range of the number in the file, before conversion. Default: declared bounds.
        scale : float
            Factor from the unit of the file to SI units.
        expected : str
            Description of the allowed numbers in the message. Default: the bounds.
        """
        bounds = bounds or (self.type if isinstance(self.type, Bounds) else ANY)
        number = self._number_in_file(bounds)
        if not bounds.allow(number):
            text = self._message_text_with_hint(NUMBER, bounds)
            # The user may have written 5 instead of 5%. Suggest the percentage if it is valid.
            is_percentage = bounds.ratio and number > 1.0 and bounds.allow(0.01 * number)
            hint = f"; did you mean {self.word}%?" if is_percentage and "%" not in self.word else ""
            self.fault(f"must be {expected or bounds}, got {text}{hint}")
            return math.nan
        # Numbers far outside the range of building properties indicate a wrong unit or exponent.
        converted = number * scale if number else 0.0
        if number != 0.0 and not SMALLEST <= abs(converted) <= LARGEST:
            allowed = f"{SMALLEST:g} and {LARGEST:g} in SI units"
            self.fault(f"must have an absolute value between {allowed}, got {self._message_text()}")
            return math.nan
        return converted

    def integer(self, bounds: Integer) -> int | None:
        """Return the whole number; None after reporting an error."""
        text, low, high = self._plain_text(), bounds.low, bounds.high
        if re.fullmatch(_WHOLE_NUMBER, text) and low <= int(text) <= high:
            return int(text)
        limits = f"{low}" if low == high else f"a whole number from {low} to {high}"
        self.fault(
            f"must be {limits}{bounds.description}, got {self._message_text_with_hint(NUMBER)}"
        )
        return None

    def boolean(self) -> bool:
        """Return the boolean value; False after reporting an error."""
        if self._plain_text() not in ("true", "false"):
            self.fault(f"must be true or false, got {self._message_text_with_hint('true|false')}")
        return self._plain_text() == "true"

    def text(self) -> str | None:
        """Return one line of text; None after reporting an error."""
        if isinstance(self.type, TextLine) and self.type.may_be_empty and self._is_null():
            return ""
        if not isinstance(self.node, ScalarNode) or not self.node.text.strip() or self._is_null():
            form = self.type.form if isinstance(self.type, TextLine) else "text"
            self.fault(f"must be {form}, got {self._message_text()}")
            return None
        if any(unicodedata.category(character) in ("Cc", "Cs") for character in self.node.text):
            self.fault(f"must be one line without control characters, got {self._message_text()}")
            return None
        return self.node.text

    def file(self, *, stdin: bool = False) -> str | None:
        """Return the path of a file relative to the working directory; None after an error.

        In the model file, the path is relative to the directory of the model file. With `stdin`,
        `-` is returned unchanged.
        """
        text = self.text()
        return (
            text if text is None or (stdin and text == "-") else resolve(text, self.faults.folder)
        )

    def read(self) -> Any:
        """Return the value converted to its declared type; None after reporting an error."""
        match self.type:
            case Bounds():
                number = self.number()
                return None if math.isnan(number) else number
            case Integer():
                return self.integer(self.type)
            case Either():
                return self._read_alternative(self.type)
            case EntriesOf():
                return self._read_entries(self.type)
            case Keys():
                return self._make_object(self.type)
            case Flag():
                return self.boolean()
            case Choice(names, description):
                return self.choice(names, description)
            case NamedEntries():
                return self._read_by_name(self.type)
            case PathOf():
                return self.file(stdin=True)
            case TextLine(parse):
                return self.parsed(parse) if parse else self.text()
        # A type such as the hysteretic law of a story has a reader in `tdint.model.config`.
        raise TypeError(
            f"{self.key}: values of the type {self.type} are read by a function in "
            "tdint.model.config, not by Value.read"
        )

    def _read_alternative(self, either: Either) -> Any:
        """Return the value, converted to the first declared type that has the form of the value.

        The form is a mapping, a list or a scalar. A `Choice` is skipped if the value is not one of
        its names. None is the result after reporting an error.
        """
        # These are the types of a scalar.
        allowed_types: Any = (Bounds, Integer, Choice, PathOf, TextLine)
        if self.is_mapping:
            allowed_types = Keys | NamedEntries
        elif self.is_list:
            allowed_types = EntriesOf
        for value_type in either.types:
            is_other_name = isinstance(value_type, Choice) and self.word not in value_type.names
            if not isinstance(value_type, allowed_types) or is_other_name:
                continue
            if isinstance(value_type, Bounds):
                number = self.number(value_type, expected=either.description)
                return None if math.isnan(number) else number
            return self._replace(type=value_type).read()
        self.fault(f"must be {either.description}, got {self._message_text()}")
        return None

    def _read_entries(self, declared: EntriesOf) -> Any:
        """Return the converted entries of a list as a tuple; None after reporting an error.

        `declared` is the type of the entries, their allowed number, and requirements on their
        order.
        """
        items = self.items(declared.description)
        if items is None:
            return None
        # All entries are converted before their number is checked, so that all errors are reported.
        values = tuple(item.read() for item in items)
        if not declared.least <= len(items) <= (declared.most or math.inf):
            is_short = len(items) < declared.least
            message = f"must be {declared.description}, got {len(items)}"
            self.fault(declared.short if declared.short and is_short else message)
            return None
        # An entry with an error, which has been reported, is `None`.
        if None in values:
            return None
        if declared.distinct and len({*values}) < len(values):
            duplicate = next(entry for entry in values if values.count(entry) > 1)
            self.fault(f"must be {declared.distinct}, got {duplicate} twice")
            return None
        if declared.growing and not all(map(lt, values, values[1:])):
            self.fault(f"must be {declared.description}")
        return values

    def _read_by_name(self, declared: NamedEntries) -> dict[str, tuple[Value, Any]] | None:
        """Return the entries of a mapping and their converted values by name; None if the entry is
        not a mapping, or is empty although names are required.

        An invalid entry is reported, and its converted value is `None`.
        """
        entries = self.named(declared.description, declared.empty_message)
        if entries is None:
            return None
        return {
            name: (entry, entry._replace(type=declared.type).read())
            for name, entry in entries.items()
        }

    def _make_object(self, keys: Keys) -> Any:
        """Return the object that `keys.make` builds from the entries of the mapping.

        None is the result if a required entry is missing or invalid, or if no entry is valid.

        `keys` contains the declared keys of the mapping, their groups, and the function `make`.
        """
        section = self.section(keys, keys.description)
        if section is None:
            return None
        # The mapping must contain keys of a single alternative group.
        alternatives = [names for names in keys.alternative_groups if section.has(*names)]
        if len(alternatives) > 1:
            self.fault(f"give either {' or '.join(map(' and '.join, alternatives))}, not both")
            return None
        if keys.alternative_groups and not any(
            section.mentions(*names) for names in keys.alternative_groups
        ):
            names = ", ".join(name for group in keys.alternative_groups for name in group)
            self.fault(f"must be {keys.description}, got a mapping without any of the keys {names}")
        # All keys of the used group are required; without groups, the keys that are declared as
        # required.
        if alternatives:
            needed = {*alternatives[0]}
        else:
            needed = {key.name for key in keys.declared if key.needed}
        # Entries of an incomplete mapping are also converted, so that their errors are reported.
        values = {}
        for key in keys.declared:
            advice = key.advice or (f"give {key.type}" if isinstance(key.type, Bounds) else "")
            value = section.need(key.name, advice) if key.name in needed else section.get(key.name)
            values[key.name] = value.read() if value else None
        if needed:
            is_complete = all(values[name] is not None for name in needed)
        else:
            is_complete = any(values.values())
        return keys.make(self, **values) if keys.make and is_complete else None

    def parsed(self, parse: Callable[[str], Parsed]) -> Parsed | None:
        """Return the result of `parse` for the text; None after reporting an error.

        A UsageError that `parse` raises is reported as an error of the value.
        """
        text = self.text()
        if text is None:
            return None
        try:
            return parse(text)
        except UsageError as error:
            self.fault(str(error))
            return None

    def choice(
        self, names: Collection[str], noun: str, advice: Callable[[str], str] | None = None
    ) -> str | None:
        """Return the name if it is in `names`; None after reporting an error.

        `noun` is the noun for the names in messages. `advice` returns the end of the message about
        an unknown name; by default or if it is empty, the name with the most similar spelling is
        suggested.
        """
        if not isinstance(self.node, ScalarNode) or self._is_null():
            self.fault(f"must be the name of a {noun}, got {self._message_text()}")
        elif self.node.text not in names:
            text = self.node.text
            hint = (advice and advice(text)) or _unknown_key_advice(text, names)
            self.fault(f"unknown {noun} {self._message_text()}{hint}")
        else:
            return self.node.text
        return None

    def items(self, expected: str, empty: str = "") -> tuple[Value, ...] | None:
        """Return the entries of a list; None after reporting an error.

        Parameters
        ----------
        expected : str
            Description of the list in messages.
        empty : str
            Message for an empty list. Default: an empty list is allowed.
        """
        if self.is_mapping and isinstance(self.type, EntriesOf) and self.type.or_one:
            return (self._replace(type=self.type.type),)
        if not isinstance(self.node, ListNode):
            self.fault(f"must be {expected}, got {self._message_text()}")
            return None
        if empty and not self.node.items:
            self.fault(empty)
        entry_type = self.type.type if isinstance(self.type, EntriesOf) else None
        entries = enumerate(self.node.items, start=1)
        return tuple(
            Value(item, f"{self.key}[{i}]", self.faults, entry_type) for i, item in entries
        )

    def section(self, keys: Collection[str] | None = None, expected: str = "") -> Section | None:
        """Return the entries of a mapping; None after reporting an error.

        Parameters
        ----------
        keys : collection of str, optional
            Allowed keys. Default: the declared keys.
        expected : str
            Description of the value in messages. Default: a list of the allowed keys.
        """
        if keys is None:
            assert isinstance(self.type, Keys)
            keys = self.type
        if not isinstance(self.node, MappingNode):
            # A file that is no mapping is of another type. Its text is not repeated.
            is_other_file = not self.key and self.word
            self.fault(
                f"must be {expected or 'a mapping with the keys ' + ', '.join(keys)}, got "
                f"{'text' if is_other_file else self._message_text()}"
            )
            return None
        return Section(self, self.node, keys)

    def peek(self, name: str) -> Value | None:
        """Return the entry `name` of a mapping without checking the other keys.

        Use this method if the allowed keys of the mapping depend on this entry.
        """
        entries = self.node.entries if isinstance(self.node, MappingNode) else ()
        for key, entry in entries:
            if isinstance(key, ScalarNode) and key.text == name:
                return Value(entry, f"{self.key}.{name}", self.faults)
        return None

    def flattened(self, name: str, scalar_name: str) -> Value:
        """Return the mapping with the entries of its entry `name` instead of that entry. An entry
        that is no mapping gets the name `scalar_name`."""
        inner = self.peek(name)
        if inner is None or not isinstance(self.node, MappingNode):
            return self
        entries = []
        for key, node in self.node.entries:
            if node is not inner.node:
                entries.append((key, node))
            elif isinstance(node, MappingNode):
                entries += node.entries
            else:
                entries.append((cast(ScalarNode, key)._replace(text=scalar_name), node))
        return self._replace(node=self.node._replace(entries=tuple(entries)))

    @property
    def names(self) -> list[str]:
        """Keys of a mapping that are text."""
        entries = self.node.entries if isinstance(self.node, MappingNode) else ()
        return [key.text for key, _ in entries if isinstance(key, ScalarNode)]

    def named(self, expected: str, empty: str = "") -> dict[str, Value] | None:
        """Return the entries of a mapping with user-defined names; None after an error.

        Parameters
        ----------
        empty : str
            Message for an empty mapping. Default: an empty mapping is allowed.
        """
        section = self.section(self.names, expected)
        if section is None:
            return None
        if empty and not self.names:
            self.fault(empty)
            return None
        return {name: entry for name in dict.fromkeys(self.names) if (entry := section.get(name))}

    @property
    def is_percentage(self) -> bool:
        """True if the value is written with a percent sign."""
        return isinstance(self.node, ScalarNode) and self.node.text.endswith("%")

    def _number_in_file(self, bounds: Bounds) -> float:
        """Return the number in the file without conversion of units; nan if it is not a number.

        If the bounds are for a ratio, a percentage or a fraction is converted to a ratio.
        """
        text, divisor = self._plain_text(), "1"
        if bounds.ratio and isinstance(self.node, ScalarNode) and set(self.node.text) & set("%/"):
            text, divisor = ratio_parts(self.node.text)
        if not (NUMBER.fullmatch(text) and NUMBER.fullmatch(divisor) and float(divisor)):
            return math.nan
        return number_or_nan(text) / number_or_nan(divisor)

    def _plain_text(self) -> str:
        """Return the text of a scalar without quotation marks; empty for other values."""
        return self.node.text if isinstance(self.node, ScalarNode) and self.node.plain else ""

    def _is_null(self) -> bool:
        """Return True for an empty value, ~ or null."""
        return (
            isinstance(self.node, ScalarNode) and self.node.plain and self.node.text in _NULL_TEXTS
        )

    def _message_text(self) -> str:
        """Return the value as text for messages."""
        if isinstance(self.node, ListNode):
            return "a list"
        if isinstance(self.node, MappingNode):
            return "a mapping"
        if self._is_null():
            return "nothing"
        return quoted(self.node.text)

    def _message_text_with_hint(self, pattern: str | re.Pattern[str], bounds: Bounds = ANY) -> str:
        """Return the value as text for messages, with a remedy for a common mistake in numbers.

        `pattern` is the form of a valid value. Quotation marks around such a value must be removed.
        `bounds` contains the declared bounds, which state if percentages are allowed.
        """
        text = self._message_text()
        # A readable number has no mistake in its form; it is out of range.
        if not isinstance(self.node, ScalarNode) or not math.isnan(self._number_in_file(bounds)):
            return text
        if re.fullmatch(pattern, self.node.text):
            return text if self.node.plain else f"{text} in quotes; remove the quotes"
        for number_form, hint in _NUMBER_HINTS:
            if re.fullmatch(number_form, self.node.text):
                return text + hint
        return text


class Section:
    """Entries of a mapping. The constructor reports unknown keys, duplicate keys and merge keys.

    Parameters
    ----------
    keys : collection of str
        Allowed keys; an instance of `Keys` also declares the types of their values.

    Attributes
    ----------
    value : Value
        The mapping, for errors that concern the complete mapping.
    """

    def __init__(self, value: Value, node: MappingNode, keys: Collection[str]) -> None:
        """Store the entries with allowed keys, and report the errors of all other keys.

        The value of a misspelled key is stored under the most similar allowed key, so that errors
        in this value are also reported.
        """
        self.value = value
        self._entries: dict[str, Value] = {}
        self._types = keys.types() if isinstance(keys, Keys) else {}
        # Declared keys that are missing because of a reported error, so that their absence is not
        # reported again.
        self._misspelled: set[str] = set()
        lines: dict[str, int] = {}  # line of each key
        unknown_keys = 0
        if node.entries and not (value.key or self._is_of_kind(node, keys)):
            message = f"contains none of the keys {', '.join(keys)}; specify another file"
            value.faults.add(node, "", message)
            self._misspelled.update(keys)
            return
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
                    entry, path, value.faults, self._types.get(key.text)
                )
            elif key.text == "<<" and key.plain:
                value.faults.add(key, path, "merge keys are not supported; write the entries out")
                self._misspelled.update(keys)
            elif unknown_keys >= MAX_LISTED_FAULTS:
                # The message does not list this key, so the slow search for similar keys is
                # omitted.
                value.faults.add(key, path, "unknown key")
            else:
                unknown_keys += 1
                value.faults.add(key, path, "unknown key" + _unknown_key_advice(key.text, keys))
                # The default similarity of `nearest` (0.6) is low: if the intended key may be
                # present under a similar name, its absence is not reported.
                similar_key = nearest(key.text, keys)
                if similar_key:
                    self._misspelled.add(similar_key)
                # Assign the value of a misspelled key to the intended key, unless the mapping also
                # contains the intended key, so that errors in the value are also reported. This
                # requires a higher similarity than above, because a value that is assigned to the
                # wrong key would cause misleading errors.
                intended = nearest(key.text, keys, cutoff=_MIN_SIMILARITY)
                if intended and intended not in self._entries:
                    self._entries[intended] = Value(
                        entry, path, value.faults, self._types.get(intended)
                    )

    @staticmethod
    def _is_of_kind(node: MappingNode, keys: Collection[str]) -> bool:
        """Return True if a mapping has a key that is allowed or similar to an allowed key. A file
        without such a key is of another type: its text is not repeated in messages."""
        names = [key.text for key, _ in node.entries if isinstance(key, ScalarNode)]
        return any(name in keys or _related_key(name, keys) for name in names)

    def has(self, *names: str) -> bool:
        """Return True if the mapping contains one of the entries."""
        return any(name in self._entries for name in names)

    def mentions(self, *names: str) -> bool:
        """Return True if the mapping contains one of the entries or a misspelling of its key."""
        return any(name in self._entries or name in self._misspelled for name in names)

    def path(self, name: str) -> str:
        """Return the full key of the entry `name`, such as `damping.modal`, for messages.

        A name with spaces or other unusual characters is written in quotation marks.
        """
        key_text = name if re.fullmatch(r"[\w<.-]{1,40}", name) else quoted(name)
        return f"{self.value.key}.{key_text}" if self.value.key else key_text

    def get(self, name: str) -> Value | None:
        """Return the entry; None if the section does not contain it."""
        return self._entries.get(name)

    def need(self, name: str, advice: str = "") -> Value | None:
        """Return the entry; None after reporting that it is missing.

        `advice` is the remedy in the message. A misspelled key, which has been reported, is not
        reported as missing.
        """
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
        """Return the number of the entry in SI units; nan after reporting an error.

        Parameters
        ----------
        default : float, optional
            Number if the entry is missing. Without a default the entry is required.
        """
        declared = self._types.get(name)
        bounds = bounds or (declared if isinstance(declared, Bounds) else ANY)
        value = self.need(name, f"give {bounds}") if default is None else self.get(name)
        if value is not None:
            return value.number(bounds, scale)
        return math.nan if default is None else default

    def read(self, name: str, default: Any = None) -> Any:
        """Return the entry converted to its declared type, or `default` if it is missing."""
        value = self.get(name)
        return value.read() if value else default

    def read_present(self, *names: str) -> dict[str, Any]:
        """Return the converted values of the entries that the section contains."""
        return {name: value.read() for name in names if (value := self.get(name))}

    def inner(self, name: str) -> Section:
        """Return the section that is the value of a key; empty if it is missing or invalid."""
        value = self.get(name)
        section = value.section() if value else None
        return section or Section(
            Value(_EMPTY_MAPPING, self.path(name), self.value.faults), _EMPTY_MAPPING, ()
        )

    def refuse(self, names: Collection[str], reason: str) -> None:
        """Report an error for each of the entries that the section contains."""
        for name in names:
            if entry := self.get(name):
                entry.fault(reason)

    def file(self, name: str, *, stdin: bool = False) -> str | None:
        """Return the path of the entry (see `Value.file`); None if it is missing or invalid."""
        value = self.get(name)
        return value.file(stdin=stdin) if value else None

    def files(self, name: str, expected: str, empty: str) -> tuple[str, ...]:
        """Return the paths in a list of files (see `Value.items` and `Value.file`), without the
        invalid paths; empty if the list is missing or invalid. A single path needs no list if the
        type of the entry allows a text."""
        value = self.get(name)
        is_single = value is not None and isinstance(value.type, Either) and bool(value.word)
        items = [value] if value and is_single else value.items(expected, empty) if value else None
        return tuple(filter(None, (item.file() for item in items or ())))


def resolve(file: str, folder: Path) -> str:
    """Return the path of a file relative to the working directory.

    `directory/..` is removed from the path, unless `directory` is a symbolic link and the shorter
    path would be another file.

    Parameters
    ----------
    file : str
        Path relative to `folder`, or absolute path.
    """
    path = os.fspath(folder / file)
    normalized = os.path.normpath(path)
    return normalized if os.path.realpath(normalized) == os.path.realpath(path) else path


def quoted(text: str) -> str:
    """Return text of the file in quotation marks, on one line and with at most 40 characters."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _unknown_key_advice(name: str, names: Collection[str]) -> str:
    """Return the remedy for an unknown key or name: a similar name, its section, or all names."""
    return _related_key(name, names) or f"; known: {', '.join(names)}"


def _related_key(name: str, names: Collection[str]) -> str:
    """Return the remedy for an unknown key that is similar to a known key or belongs to another
    section; empty for other keys."""
    # {height: 3,5} is a mapping with the keys `height` and `5`.
    if name.isdecimal():
        return "; a comma divides entries here: write a decimal point"
    if isinstance(names, Keys) and (meant := dict(names.other_names).get(name)):
        return f"; did you mean `{meant}`?" if meant in names else f"; {meant}"
    # The key may belong to an inner section, such as `record` to `excitation`. The keys of `units`
    # (length, force, mass) are not searched, because they are also quantities of other sections.
    if isinstance(names, Keys):
        section_names = [
            key.name
            for key in names.declared
            if isinstance(key.type, Keys) and name in key.type and key.name != "units"
        ]
        if len(section_names) == 1:
            (section,) = section_names
            return f"; it belongs to `{section}`: write `{section}: {{{name}: ...}}`"
    return did_you_mean(name, names)
