"""Read the text of a YAML file and build its nodes, independently of its keys.

The text is read from a file, standard input or a stream. Nodes are built from the events of
PyYAML's parser; tags never create Python objects.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import yaml

from tdint.errors import ModelError
from tdint.files import read_whole, record_digest
from tdint.model.keys.fields import Value
from tdint.model.keys.nodes import (
    MAX_DEPTH,
    Faults,
    ListNode,
    MappingNode,
    Node,
    Place,
    ScalarNode,
    nodes_of,
    text_of,
)

MAX_BYTES = 16 * 1024 * 1024
"""Maximum size of a model file, bytes. Without it, a wrong path such as a device would fill the
memory."""


@dataclass(frozen=True)
class SourceText:
    """Content of a model file.

    Attributes
    ----------
    label : str
        Name in messages.
    name : str
        Default name of the model.
    folder : Path
        Directory to which relative paths in the file refer.
    data : bytes
        Content.
    """

    label: str
    name: str
    folder: Path
    data: bytes


def read_source(source: str | Path | TextIO, kind: str = "model file") -> SourceText:
    """Return the content of a file; `-` is standard input. `kind` names its type in messages.

    Raises
    ------
    ModelError
        The file cannot be read.
    """
    stream: Any = source
    label, path = "<stream>", None
    if source is sys.stdin or (isinstance(source, str | Path) and str(source) == "-"):
        if sys.stdin is None:
            raise ModelError(f"-: standard input is closed; specify a {kind}")
        label, stream = "-", getattr(sys.stdin, "buffer", sys.stdin)
    elif isinstance(source, str | Path):
        path, label = Path(source), str(source) or "."
        messages: dict[type[Exception], str] = {
            FileNotFoundError: f"file not found; specify a {kind} (YAML) or - for standard input",
            IsADirectoryError: f"this is a directory; specify a {kind} (YAML)",
            ValueError: "cannot be read: the name contains a null character",
        }
        data = read_whole(label, ModelError, messages, _too_large(kind), MAX_BYTES)
        record_digest(label, data)
        return SourceText(label, path.stem, path.parent, data)
    elif not hasattr(source, "read"):
        raise ModelError(
            f"a model must be the name of a file or a text stream, not {type(source).__name__}"
        )
    elif isinstance(name := getattr(source, "name", None), str) and not name.startswith("<"):
        label, path = name, Path(name)
    data = _read_stream(stream, label, kind)
    return SourceText(
        label, path.stem if path else kind.partition(" ")[0], path.parent if path else Path(), data
    )


def _read_stream(stream: TextIO | BinaryIO, label: str, kind: str) -> bytes:
    try:
        content = stream.read(MAX_BYTES + 1)
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(
            f"{label}: cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from None
    if len(content) > MAX_BYTES:
        raise ModelError(f"{label}: {_too_large(kind)}")
    # Surrogates represent bytes that the stream could not decode. `decode` reports them.
    encoded = content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
    record_digest(label, encoded)
    return encoded


def _too_large(kind: str) -> str:
    return f"larger than {MAX_BYTES // 1024**2} MiB; this is not a {kind}"


def read_document(
    source: str | Path | TextIO | Mapping[str, Any],
    kind: str = "model file",
    needs: str = "`stories`",
) -> tuple[SourceText, Value]:
    """Read a document and return its source and its root.

    Parameters
    ----------
    source : str, Path, text stream or mapping
        YAML file, `-` for standard input, or the content of such a file as Python objects.
    kind, needs : str
        Type of the file and its required content, for messages.

    Returns
    -------
    SourceText, Value
        Source of the document, and its root. `Value.faults` of the root collects errors.

    Raises
    ------
    ModelError
        The document cannot be read or is not YAML.
    """
    if isinstance(source, Mapping):
        faults = Faults("model")
        node = nodes_of(source, faults)
        return SourceText("model", "model", Path(), text_of(node)), Value(node, "", faults)
    origin = read_source(source, kind)
    faults = Faults(origin.label, kind, needs, origin.folder)
    return origin, Value(parse(decode(origin.data, faults), faults), "", faults)


def parse(text: str, faults: Faults) -> Node:
    """Return the root node of the only document in `text`.

    Tags are reported in `faults`, and reading continues. Other syntax errors raise an exception.

    Raises
    ------
    ModelError
        `text` is not YAML, is empty, contains several documents or too many nested levels, or has
        an alias without an anchor.
    """
    try:
        return _Composer(text, faults).document()
    except yaml.reader.ReaderError as error:
        line, column = _line_and_column(text[: error.position])
        message = f"invalid character U+{ord(text[error.position]):04X} in a YAML file; remove it"
        faults.add(Place(line, column), "", message)
    except yaml.MarkedYAMLError as error:
        # Join the lines of PyYAML's message, and add a remedy for tabs.
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
        faults.add(
            Place(line, column),
            "",
            f"not UTF-8 text (byte 0x{byte:02x}); save the {faults.kind} as UTF-8",
        )
    raise faults.error()


def composed(text: str) -> Any:
    """Return the root of a valid document as a PyYAML node, which contains start and end marks."""
    return yaml.compose(text, Loader=yaml.SafeLoader)


class _Composer:
    """Builder of nodes from the events of PyYAML's parser."""

    def __init__(self, text: str, faults: Faults) -> None:
        self._loader = yaml.SafeLoader(text)
        self._faults = faults
        self._anchors: dict[str, Node | None] = {}

    def document(self) -> Node:
        """Return the root of the only document."""
        self._next()  # the start of the stream
        start = self._next()
        if isinstance(start, yaml.StreamEndEvent):
            raise self._refusal(
                start, f"the {self._faults.kind} is empty; it needs at least {self._faults.needs}"
            )
        root = self._node(self._next(), 0)
        self._next()  # the end of the document
        following = self._next()
        if not isinstance(following, yaml.StreamEndEvent):
            raise self._refusal(
                following,
                f"a second YAML document starts here; a {self._faults.kind} contains one",
            )
        return root

    def _next(self) -> yaml.Event:
        try:
            event: yaml.Event = self._loader.get_event()  # type: ignore[no-untyped-call]
        except (ValueError, OverflowError):
            # PyYAML does not catch errors of chr() and int(), for example for "\UFFFFFFFF" or a
            # %YAML version of a thousand digits. Their text depends on the version of Python.
            problem = "the number here is too large for a character or a version"
            raise yaml.MarkedYAMLError(
                problem=problem, problem_mark=self._loader.get_mark()
            ) from None
        return event

    def _refusal(self, event: yaml.Event, message: str) -> ModelError:
        self._faults.add(_event_place(event), "", message)
        return self._faults.error()

    def _node(self, event: yaml.Event, depth: int) -> Node:
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                raise self._refusal(
                    event, f"the alias *{event.anchor} has no anchor &{event.anchor} above it"
                )
            if (shared := self._anchors[event.anchor]) is None:
                raise self._refusal(
                    event, f"the alias *{event.anchor} is used inside its own anchor"
                )
            return shared
        if depth > MAX_DEPTH:
            raise self._refusal(
                event,
                f"more than {MAX_DEPTH} nested levels; this is not a {self._faults.kind}",
            )
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        place = _event_place(event)
        if event.tag is not None:
            self._faults.add(
                place, "", f"the tag {_short(event.tag)} is not allowed; write the value without it"
            )
        if event.anchor is not None:
            # The node is incomplete. An alias inside it would be an infinite recursion.
            self._anchors[event.anchor] = None
        node: Node
        if isinstance(event, yaml.ScalarEvent):
            node = ScalarNode(place.line, place.column, event.value, plain=not event.style)
        elif isinstance(event, yaml.SequenceStartEvent):
            node = ListNode(
                place.line, place.column, tuple(self._children(yaml.SequenceEndEvent, depth))
            )
        else:
            children = self._children(yaml.MappingEndEvent, depth)
            # Both arguments of zip are the same iterator, so keys and values alternate.
            node = MappingNode(
                place.line, place.column, tuple(zip(children, children, strict=True))
            )
        if event.anchor is not None:
            self._anchors[event.anchor] = node
        return node

    def _children(self, end: type[yaml.Event], depth: int) -> Iterator[Node]:
        while not isinstance(event := self._next(), end):
            yield self._node(event, depth + 1)


def _short(text: str) -> str:
    """Return text of the file for a message, on one line and with at most 60 characters."""
    return (
        text
        if len(text) <= 60 and text.isprintable()
        else repr(text[:60]) + ("..." if len(text) > 60 else "")
    )


def _line_and_column(text: str) -> tuple[int, int]:
    """Return line and column of the character after `text`, counted from 1."""
    return text.count("\n") + 1, len(text) - text.rfind("\n")


def _event_place(event: yaml.Event) -> Place:
    assert event.start_mark is not None
    return Place(event.start_mark.line + 1, event.start_mark.column + 1)
