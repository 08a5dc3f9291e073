"""YAML text, or a Python mapping, to nodes with line and column: one reader reads both.

Scalars stay text: YAML 1.1, which PyYAML follows, takes 2e8 for a string, `no` for false and 012 for 10, so what a
scalar means is decided where it is used (`fields`). The nodes are built from PyYAML's events; no Python object is ever
constructed from a tag.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from tdint.errors import ModelError, ModelFault

MAX_DEPTH = 32
"""Nesting that a file may have; a model needs six levels. It keeps the recursion below Python's limit."""


@dataclass(frozen=True)
class Place:
    """Where a node begins, both counted from 1."""

    line: int
    column: int


@dataclass(frozen=True, eq=False)
class ScalarNode(Place):
    """A single value: its text, and whether it was written plain, without quotes or a block sign."""

    text: str
    plain: bool


# An alias shares its node, so a few lines can hold a tree of astronomical size: it is never compared or printed.
@dataclass(frozen=True, eq=False)
class ListNode(Place):
    """A list."""

    items: tuple[Node, ...] = field(repr=False)


@dataclass(frozen=True, eq=False)
class MappingNode(Place):
    """A mapping in file order; equal keys are kept."""

    entries: tuple[tuple[Node, Node], ...] = field(repr=False)


Node = ScalarNode | ListNode | MappingNode


@dataclass
class Faults:
    """The problems of one file, collected so that they are reported together; `kind` is what the file is, `needs` what
    it must hold, `folder` where paths in it start from."""

    source: str
    kind: str = "model file"
    needs: str = "`stories`"
    folder: Path = Path()
    _faults: list[ModelFault] = field(default_factory=list)

    def add(self, place: Place, key: str, message: str) -> None:
        """Note a problem of `key` at `place`."""
        self._faults.append(ModelFault(self.source, place.line, place.column, key, message))

    def error(self) -> ModelError:
        """The error that holds all problems in file order."""
        return ModelError(sorted(self._faults, key=lambda problem: (problem.line, problem.column)))

    def raise_if_any(self) -> None:
        """Raise `error()` if there is a problem."""
        if self._faults:
            raise self.error()


def parse(text: str, faults: Faults) -> Node:
    """Return the root node of the only document in `text`.

    Tags are collected in `faults`. Everything else that is not the YAML of a model file stops the reading.

    Raises
    ------
    ModelError
        If `text` is not YAML, is empty, holds several documents, nests too deeply or has an alias without an anchor.
    """
    try:
        return _Composer(text, faults).document()
    except yaml.reader.ReaderError as error:
        line, column = _line_and_column(text[: error.position])
        message = f"the character U+{ord(text[error.position]):04X} cannot stand in a YAML file; remove it"
        faults.add(Place(line, column), "", message)
    except yaml.MarkedYAMLError as error:
        # PyYAML's several lines as one, and what to do about a tab.
        mark, problem = error.problem_mark or error.context_mark, error.problem_mark
        parts = [str(part) for part in (error.context, error.problem) if part]
        message = " ".join(f"not valid YAML: {', '.join(parts)}".split())
        if problem is not None and text[problem.index : problem.index + 1] == "\t":
            message += "; indent with spaces, not tabs"
        faults.add(Place(mark.line + 1, mark.column + 1) if mark else Place(1, 1), "", message)
    raise faults.error()


def decode(data: bytes, faults: Faults) -> str:
    """Return `data` as text, without a byte order mark.

    Raises
    ------
    ModelError
        If `data` is not UTF-8.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line, column = _line_and_column(error.object[: error.start].decode("utf-8", "replace"))
        byte = error.object[error.start]
        faults.add(Place(line, column), "", f"not UTF-8 text (byte 0x{byte:02x}); save the {faults.kind} as UTF-8")
    raise faults.error()


def composed(text: str) -> Any:
    """The root of a document that `parse` has taken, as PyYAML has it: nodes know where they begin and end."""
    return yaml.compose(text, Loader=yaml.SafeLoader)


class _Composer:
    """Builds nodes from the events of PyYAML's parser."""

    def __init__(self, text: str, faults: Faults) -> None:
        self._loader = yaml.SafeLoader(text)
        self._faults = faults
        self._anchors: dict[str, Node | None] = {}

    def document(self) -> Node:
        """The root of the only document."""
        self._next()  # the start of the stream
        start = self._next()
        if isinstance(start, yaml.StreamEndEvent):
            raise self._refusal(start, f"the {self._faults.kind} is empty; it needs at least {self._faults.needs}")
        root = self._node(self._next(), 0)
        self._next()  # the end of the document
        following = self._next()
        if not isinstance(following, yaml.StreamEndEvent):
            raise self._refusal(following, f"a second YAML document begins here; a {self._faults.kind} holds one")
        return root

    def _next(self) -> yaml.Event:
        try:
            event: yaml.Event = self._loader.get_event()  # type: ignore[no-untyped-call]
        except (ValueError, OverflowError):
            # PyYAML lets the errors of chr() and int() through: "\UFFFFFFFF", a %YAML version of a thousand digits.
            # Which of them, and in which words, is a matter of Python's version.
            problem = "the number here is too large for a character or a version"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=self._loader.get_mark()) from None
        return event

    def _refusal(self, event: yaml.Event, message: str) -> ModelError:
        self._faults.add(_event_place(event), "", message)
        return self._faults.error()

    def _node(self, event: yaml.Event, depth: int) -> Node:
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                raise self._refusal(event, f"the alias *{event.anchor} has no anchor &{event.anchor} above it")
            if (shared := self._anchors[event.anchor]) is None:
                raise self._refusal(event, f"the alias *{event.anchor} stands inside its own anchor")
            return shared
        if depth > MAX_DEPTH:
            raise self._refusal(event, f"nested more than {MAX_DEPTH} levels deep; this is no {self._faults.kind}")
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        if event.tag is not None:
            message = f"the tag {_short(event.tag)} is not allowed; write the value without it"
            self._faults.add(_event_place(event), "", message)
        if event.anchor is not None:
            self._anchors[event.anchor] = None  # not complete yet: an alias inside it would never end
        node = self._content(event, depth)
        if event.anchor is not None:
            self._anchors[event.anchor] = node
        return node

    def _content(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent, depth: int) -> Node:
        place = _event_place(event)
        if isinstance(event, yaml.ScalarEvent):
            return ScalarNode(place.line, place.column, event.value, plain=not event.style)
        if isinstance(event, yaml.SequenceStartEvent):
            return ListNode(place.line, place.column, tuple(self._children(yaml.SequenceEndEvent, depth)))
        children = self._children(yaml.MappingEndEvent, depth)
        # zip draws key and value in turn from the one iterator.
        return MappingNode(place.line, place.column, tuple(zip(children, children, strict=True)))

    def _children(self, end: type[yaml.Event], depth: int) -> Iterator[Node]:
        while not isinstance(event := self._next(), end):
            yield self._node(event, depth + 1)


def _short(text: str) -> str:
    """Text from the file for a message: one line, not long."""
    return text if len(text) <= 60 and text.isprintable() else repr(text[:60]) + ("..." if len(text) > 60 else "")


def _line_and_column(text: str) -> tuple[int, int]:
    """The place right after `text`, counted from 1."""
    return text.count("\n") + 1, len(text) - text.rfind("\n")


def _event_place(event: yaml.Event) -> Place:
    assert event.start_mark is not None
    return Place(event.start_mark.line + 1, event.start_mark.column + 1)


_NOWHERE = Place(0, 0)


def nodes_of(value: object, faults: Faults, depth: int = 0) -> Node:
    """The nodes of mappings, lists, numbers and text; what has no place in a file has line and column 0.

    Raises
    ------
    ModelError
        Something that a file could not say, or a mapping inside itself.
    """
    if hasattr(value, "tolist"):  # an array or a number of numpy
        value = value.tolist()
    if depth > MAX_DEPTH:
        faults.add(_NOWHERE, "", f"nested more than {MAX_DEPTH} levels deep; this is no model")
        raise faults.error()
    if isinstance(value, Mapping):
        entries = tuple((_scalar(key, faults), nodes_of(item, faults, depth + 1)) for key, item in value.items())
        return MappingNode(0, 0, entries)
    if isinstance(value, list | tuple):
        return ListNode(0, 0, tuple(nodes_of(item, faults, depth + 1) for item in value))
    return _scalar(value, faults)


def text_of(node: Node) -> bytes:
    """The nodes as JSON, for the SHA-256 of a model without a file."""
    return json.dumps(_tree(node), ensure_ascii=True).encode()


def _scalar(value: object, faults: Faults) -> ScalarNode:
    if value is None or isinstance(value, bool):
        return ScalarNode(0, 0, "null" if value is None else str(value).lower(), plain=True)
    if isinstance(value, int | float):
        return ScalarNode(0, 0, repr(value), plain=True)
    if isinstance(value, str | os.PathLike):
        return ScalarNode(0, 0, os.fspath(value), plain=False)
    faults.add(_NOWHERE, "", f"a model holds mappings, lists, numbers and text, not {type(value).__name__}")
    raise faults.error()


def _tree(node: Node) -> Any:
    if isinstance(node, MappingNode):
        return [[_tree(key), _tree(item)] for key, item in node.entries]
    if isinstance(node, ListNode):
        return [_tree(item) for item in node.items]
    return node.text
