"""Reading nodes as numbers, words and sections: what is wrong is noted with its place, and reading goes on.

A faulty number is noted and read as nan. Comparisons with nan are false, so later checks that ask "is it wrong?"
stay silent about it: one fault gives one line.
"""

from __future__ import annotations

import math
import os
import re
import unicodedata
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from tdint.errors import UsageError, did_you_mean, nearest
from tdint.model.definition import MAX_STORIES
from tdint.model.keys.kinds import ANY, Bounds, Choice, EntriesOf, Flag, Keys, ValueKind, Whole, Words
from tdint.model.keys.nodes import Faults, ListNode, MappingNode, Node, ScalarNode
from tdint.written_numbers import LARGEST, SMALLEST

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
"""How alike an unknown key must be to a known one that is not there for its value to be read as that of the other."""


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
        return self.node.text if isinstance(self.node, ScalarNode) and not self._is_nothing() else ""

    def fault(self, message: str) -> None:
        """Note what is wrong with this value."""
        self.faults.add(self.node, self.key, message)

    def is_word(self, word: str) -> bool:
        """Whether the value is the word, quoted or not."""
        return isinstance(self.node, ScalarNode) and self.node.text == word

    def number(self, bounds: Bounds | None = None, scale: float = 1.0, what: str = "") -> float:
        """The number times `scale`, its factor to SI; nan if there is a fault.

        `bounds` hold for the number in the file; `what` says what it must be where they do not.
        """
        bounds = bounds or (self.kind if isinstance(self.kind, Bounds) else ANY)
        number = self._bare_number(bounds)
        if not bounds.allow(number):
            self.fault(f"must be {what or bounds}, got {self._shown_unquoted(_NUMBER, bounds)}")
            return math.nan
        converted = number * scale if number else 0.0
        if number != 0.0 and not SMALLEST <= abs(converted) <= LARGEST:
            limits = f"{SMALLEST:g} and {LARGEST:g} in SI units"
            self.fault(f"is out of all proportion: its size must lie between {limits}, got {self._shown()}")
            return math.nan
        return converted

    def whole(self, low: int = 0, high: int = -1, what: str = "") -> int | None:
        """The whole number from `low` to `high`; None if there is a fault. `what` says what the bounds stand for."""
        if high < low:
            assert isinstance(self.kind, Whole)
            low, high = self.kind.low, self.kind.high
        text = self._plain_text()
        if _WHOLE.fullmatch(text) and low <= int(text) <= high:
            return int(text)
        limits = f"{low}" if low == high else f"a whole number from {low} to {high}"
        self.fault(f"must be {limits}{what}, got {self._shown_unquoted(_NUMBER)}")
        return None

    def counted(self, count: int | None) -> int | None:
        """The number of a floor or mode of a model with `count` stories, None where a fault leaves that open."""
        return self.whole(1, count or MAX_STORIES, " (the number of stories)" if count else "")

    def boolean(self) -> bool:
        """True or false; false if there is a fault."""
        if self._plain_text() not in ("true", "false"):
            self.fault(f"must be true or false, got {self._shown_unquoted('true|false')}")
        return self._plain_text() == "true"

    def text(self) -> str | None:
        """A line of text, quoted or not; None if there is a fault."""
        if not isinstance(self.node, ScalarNode) or not self.node.text.strip() or self._is_nothing():
            self.fault(f"must be text, got {self._shown()}")
            return None
        if any(unicodedata.category(character) in ("Cc", "Cs") for character in self.node.text):
            self.fault(f"must be one line without control characters, got {self._shown()}")
            return None
        return self.node.text

    def file(self, *, stdin: bool = False) -> str | None:
        """The path of a file, which starts from the folder of the one that it stands in, as seen from the working
        directory; None if there is a fault. With `stdin`, `-` stays what it is.
        """
        text = self.text()
        return text if text is None or (stdin and text == "-") else resolve(text, self.faults.folder)

    def read(self) -> Any:
        """The value as its key declares it, a number, a word, true or false; None if there is a fault."""
        match self.kind:
            case Bounds():
                number = self.number()
                return None if math.isnan(number) else number
            case Whole():
                return self.whole()
            case Flag():
                return self.boolean()
            case Choice(names, what):
                return self.choice(names, what)
            case Words():
                return self.text()
        raise TypeError(f"{self.key}: {self.kind} is read by its own reader")

    def parsed(self, parse: Callable[[str], Parsed]) -> Parsed | None:
        """What `parse` makes of the text; None if there is a fault, as where it raises UsageError."""
        text = self.text()
        if text is None:
            return None
        try:
            return parse(text)
        except UsageError as error:
            self.fault(str(error))
            return None

    def choice(self, known: Collection[str], what: str) -> str | None:
        """One of the `known` names; None if there is a fault. `what` says what they name."""
        if not isinstance(self.node, ScalarNode) or self._is_nothing():
            self.fault(f"must be the name of a {what}, got {self._shown()}")
        elif self.node.text not in known:
            self.fault(f"unknown {what} {self._shown()}{_advice(self.node.text, known)}")
        else:
            return self.node.text
        return None

    def items(self, what: str, empty: str = "") -> tuple[Value, ...] | None:
        """The entries of a list; None if there is a fault. `what` says what the list must be, and `empty`, if it must
        have entries, what is wrong without."""
        if not isinstance(self.node, ListNode):
            self.fault(f"must be {what}, got {self._shown()}")
            return None
        if empty and not self.node.items:
            self.fault(empty)
        kind = self.kind.kind if isinstance(self.kind, EntriesOf) else None
        entries = enumerate(self.node.items, start=1)
        return tuple(Value(item, f"{self.key}[{i}]", self.faults, kind) for i, item in entries)

    def section(self, known: Collection[str] | None = None, what: str = "") -> Section | None:
        """The entries of a mapping, by default those that its key declares; None if there is a fault. `what` says what
        the value must be if not just that."""
        if known is None:
            assert isinstance(self.kind, Keys)
            known = self.kind
        if not isinstance(self.node, MappingNode):
            self.fault(f"must be {what or 'a mapping with the keys ' + ', '.join(known)}, got {self._shown()}")
            return None
        return Section(self, self.node, known)

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

    def _bare_number(self, bounds: Bounds) -> float:
        """The number as it stands in the file, of a ratio also as a percentage; nan if it is none."""
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

    def _shown_unquoted(self, wanted: str | re.Pattern[str], bounds: Bounds = ANY) -> str:
        """The same where quotes are out of place, with what to do about the value as far as that can be told."""
        if not isinstance(self.node, ScalarNode) or not math.isnan(self._bare_number(bounds)):
            return self._shown()
        if re.fullmatch(wanted, self.node.text):
            return self._shown() + ("" if self.node.plain else " in quotes; remove the quotes")
        return self._shown() + next((hint for form, hint in _NUMBER_HINTS if form.fullmatch(self.node.text)), "")


class Section:
    """The entries of a mapping. Unknown, repeated and merge keys are noted when it is made.

    Attributes
    ----------
    value : Value
        The mapping itself, for faults that concern it as a whole.
    """

    def __init__(self, value: Value, node: MappingNode, known: Collection[str]) -> None:
        self.value = value
        self._entries: dict[str, Value] = {}
        self._kinds = known.kinds() if isinstance(known, Keys) else {}
        self._excused: set[str] = set()  # keys whose absence follows from a fault already noted
        lines: dict[str, int] = {}
        for key, entry in node.entries:
            if not isinstance(key, ScalarNode):
                value.faults.add(key, value.key, "a key must be a word, got a list or a mapping")
            elif key.text in lines:
                message = f"duplicate key, first given on line {lines[key.text]}"
                value.faults.add(key, self.path(key.text), message)
            else:
                lines[key.text] = key.line
                self._admit(key, entry, known)
        self._admit_misspelled(node, known)

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
        self, name: str, bounds: Bounds | None = None, scale: float = 1.0, default: float | None = None
    ) -> float:
        """The number of the entry; without a `default` the entry must be there, and nan stands for a fault.

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
        """The section under a key, as that declares it: an empty one if there is none, or after a fault."""
        value = self.get(name)
        found = value.section() if value else None
        return found or Section(Value(_NOTHING_THERE, self.path(name), self.value.faults), _NOTHING_THERE, ())

    def refuse(self, names: Collection[str], reason: str) -> None:
        """Note that some entries, where they are there, have no place in this section."""
        for name in names:
            if entry := self.get(name):
                entry.fault(reason)

    def text(self, name: str) -> str | None:
        """The text of the entry; None if the section lacks it or it is faulty."""
        value = self.get(name)
        return value.text() if value else None

    def file(self, name: str, *, stdin: bool = False) -> str | None:
        """The path of the entry, as `Value.file` has it; None if the section lacks it or it is faulty."""
        value = self.get(name)
        return value.file(stdin=stdin) if value else None

    def _admit(self, key: ScalarNode, entry: Node, known: Collection[str]) -> None:
        faults, path = self.value.faults, self.path(key.text)
        if key.text in known:
            self._entries[key.text] = Value(entry, path, faults, self._kinds.get(key.text))
        elif key.text == "<<" and key.plain:
            faults.add(key, path, "merge keys are not supported; write the entries out")
            self._excused.update(known)
        else:
            faults.add(key, path, "unknown key" + _advice(key.text, known))
            self._excused.update(filter(None, [nearest(key.text, known)]))

    def _admit_misspelled(self, node: MappingNode, known: Collection[str]) -> None:
        """Read what stands under a misspelled key as that of the key that was meant, for the faults in it."""
        for key, entry in node.entries:
            if not isinstance(key, ScalarNode) or key.text in known:
                continue
            meant = nearest(key.text, known, cutoff=_MEANT)
            if meant and meant not in self._entries:
                self._entries[meant] = Value(entry, self.path(key.text), self.value.faults, self._kinds.get(meant))


def resolve(file: str, folder: Path) -> str:
    """The path as seen from the working directory, without `folder/..` where that means the same."""
    path = os.fspath(folder / file)
    plain = os.path.normpath(path)
    return plain if os.path.realpath(plain) == os.path.realpath(path) else path


def quoted(text: str) -> str:
    """Text of the file in quotes, on one line and not too long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _advice(name: str, known: Collection[str]) -> str:
    return did_you_mean(name, known) or f"; known: {', '.join(known)}"
