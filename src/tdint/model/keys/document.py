"""Read the text of a YAML file and build its nodes, independently of its keys.

The text is read from a file, standard input or a stream. Nodes are built from the events of
PyYAML's parser; tags never create Python objects.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, TextIO

import yaml

from tdint.errors import ModelError
from tdint.files import read_whole, record_digest
from tdint.model.keys import nodes
from tdint.model.keys.fields import Value

_MAX_KEYS = 10_000
"""Maximum number of keys of a mapping. Names of parameters or of damage states are the longest
mappings of a valid file; the limit stops the reading of a file of another type, which is slow."""
_MAX_ALIASED = 200_000
"""Maximum number of values that the aliases of a file repeat. They are read again at every alias;
reading this number requires about 1 s. A building of 1000 equal stories repeats 20 000 values."""
MAX_BYTES = 16 * 1024 * 1024
"""Maximum size of a model file, bytes. Without a limit, a wrong path such as a device would fill
the memory."""


class SourceText(NamedTuple):
    """Content of a model file.

    Attributes
    ----------
    label : str
        Name in messages.
    name : str
        Default name of the model.
    folder : Path
        Directory that relative paths in the file refer to.
    """

    label: str
    name: str
    folder: Path
    data: bytes


_UNNAMED = "<stream>"  # label of a stream without a file name, which is no input file


def read_source(source: str | Path | TextIO, file_type: str = "model file") -> SourceText:
    """Return the content of a file; `-` is standard input. `file_type` names its type in messages.

    Raises
    ------
    ModelError
        The file cannot be read.
    """
    # The label is the name in messages. A stream without a file name has no path.
    stream: Any = source
    label, path = _UNNAMED, None
    if source is sys.stdin or (isinstance(source, str | Path) and str(source) == "-"):
        if sys.stdin is None:
            raise ModelError(f"-: standard input is closed; specify a {file_type}")
        label, stream = "-", getattr(sys.stdin, "buffer", sys.stdin)
    elif isinstance(source, str | Path):
        path, label = Path(source), str(source) or "."
        messages: dict[type[Exception], str] = {
            FileNotFoundError: (
                f"file not found; specify a {file_type} (YAML) or - for standard input"
            ),
            IsADirectoryError: f"this is a directory; specify a {file_type} (YAML)",
            ValueError: "cannot be read: the name contains a null character",
        }
        data = read_whole(label, ModelError, messages, _too_large(file_type), MAX_BYTES)
        record_digest(label, data)
        return SourceText(label, path.stem, path.parent, data)
    elif not hasattr(source, "read"):
        raise ModelError(
            f"a model must be the name of a file or a text stream, not {type(source).__name__}"
        )
    elif isinstance(name := getattr(source, "name", None), str) and not name.startswith("<"):
        label, path = name, Path(name)
    data = _read_stream(stream, label, file_type)
    # Without a path, the name is the first word of the type, such as `model`.
    if path is None:
        return SourceText(label, file_type.partition(" ")[0], Path(), data)
    return SourceText(label, path.stem, path.parent, data)


def _read_stream(stream: TextIO | BinaryIO, label: str, file_type: str) -> bytes:
    """Return the content of a stream as UTF-8, and record it as an input of the command if it has a
    name (`-` or a file name).

    ModelError is raised if the stream cannot be read, or is larger than `MAX_BYTES`.
    """
    try:
        content = stream.read(MAX_BYTES + 1)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ModelError(f"{label}: cannot be read: {reason}") from None
    if len(content) > MAX_BYTES:
        raise ModelError(f"{label}: {_too_large(file_type)}")
    # Surrogates represent bytes that the stream could not decode. `decode` reports them.
    encoded = content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
    if label != _UNNAMED:
        record_digest(label, encoded)
    return encoded


def _too_large(file_type: str) -> str:
    """Return the message for a file of the type that is larger than `MAX_BYTES`."""
    return f"larger than {MAX_BYTES // 1024**2} MiB; this is not a {file_type}"


def read_document(
    source: str | Path | TextIO | Mapping[str, Any],
    file_type: str = "model file",
    needs: str = "`stories`",
) -> tuple[SourceText, Value]:
    """Read a document and return its source and its root.

    Parameters
    ----------
    source : str, Path, text stream or mapping
        YAML file, `-` for standard input, or the content of such a file as Python objects.
    file_type, needs : str
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
        faults = nodes.Faults("model")
        node = nodes.nodes_of(source, faults)
        return SourceText("model", "model", Path(), nodes.text_of(node)), Value(node, "", faults)
    origin = read_source(source, file_type)
    faults = nodes.Faults(origin.label, file_type, needs, origin.folder)
    return origin, Value(parse(decode(origin.data, faults), faults), "", faults)


def parse(text: str, faults: nodes.Faults) -> nodes.Node:
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
        faults.add(nodes.Location(line, column), "", message)
    except yaml.MarkedYAMLError as error:
        # Join the lines of PyYAML's message, and add a remedy for tabs.
        mark, problem = error.problem_mark or error.context_mark, error.problem_mark
        message_parts = [str(part) for part in (error.context, error.problem) if part]
        message = " ".join(f"not valid YAML: {', '.join(message_parts)}".split())
        if problem is not None and text[problem.index : problem.index + 1] == "\t":
            message += "; indent with spaces, not tabs"
        faults.add(
            nodes.Location(mark.line + 1, mark.column + 1) if mark else nodes.Location(1, 1),
            "",
            message,
        )
    raise faults.error()


def decode(data: bytes, faults: nodes.Faults) -> str:
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
            nodes.Location(line, column),
            "",
            f"not UTF-8 text (byte 0x{byte:02x}); save the {faults.file_type} as UTF-8",
        )
    raise faults.error()


def compose(text: str) -> Any:
    """Return the root of a valid document as a PyYAML node, which contains start and end marks."""
    return yaml.compose(text, Loader=yaml.SafeLoader)


class _Composer:
    """Builder of nodes from the events of PyYAML's parser; errors are added to `faults`."""

    def __init__(self, text: str, faults: nodes.Faults) -> None:
        """Start the parser at the beginning of the text."""
        self._loader = yaml.SafeLoader(text)
        self._faults = faults
        # Node of each anchor and its number of nodes with all aliases; None while it is read
        self._anchors: dict[str, tuple[nodes.Node, int] | None] = {}
        self._count = 0  # nodes until now, with all aliases
        self._aliased = 0  # the part of the nodes that aliases repeat

    def document(self) -> nodes.Node:
        """Return the root of the only document."""
        self._next_event()  # the start of the stream
        start = self._next_event()
        if isinstance(start, yaml.StreamEndEvent):
            raise self._error(
                start,
                f"the {self._faults.file_type} is empty; it needs at least {self._faults.needs}",
            )
        root = self._build_node(self._next_event(), 0)
        self._next_event()  # the end of the document
        following = self._next_event()
        if not isinstance(following, yaml.StreamEndEvent):
            raise self._error(
                following,
                f"a second YAML document starts here; a {self._faults.file_type} contains one",
            )
        return root

    def _next_event(self) -> yaml.Event:
        """Return the next event of the parser. yaml.MarkedYAMLError is raised if the text is not
        valid YAML.
        """
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

    def _error(self, event: yaml.Event, message: str) -> ModelError:
        """Add an error at an event, and return the exception with all errors of the file."""
        self._faults.add(_event_location(event), "", message)
        return self._faults.error()

    def _build_node(self, event: yaml.Event, depth: int) -> nodes.Node:
        """Return the node that starts with an event at a nesting level (0 for the root); reads all
        events of a list or mapping. ModelError is raised if an alias has no anchor or is inside its
        own anchor, or the nesting is too deep.
        """
        if isinstance(event, yaml.AliasEvent):
            alias = event.anchor
            if alias not in self._anchors:
                raise self._error(event, f"the alias *{alias} has no anchor &{alias} above it")
            anchored = self._anchors[alias]
            if anchored is None:
                raise self._error(event, f"the alias *{alias} is used inside its own anchor")
            anchored_node, size = anchored
            self._count += size
            self._aliased += size
            if self._aliased > _MAX_ALIASED:
                raise self._error(
                    event,
                    f"the aliases up to *{alias} repeat more than {_MAX_ALIASED} values; write "
                    "long lists in a file of their own",
                )
            return anchored_node
        if depth > nodes.MAX_DEPTH:
            raise self._error(
                event,
                f"more than {nodes.MAX_DEPTH} nested levels; this is not a "
                f"{self._faults.file_type}",
            )
        assert isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
        location = _event_location(event)
        if event.tag is not None:
            self._faults.add(
                location,
                "",
                f"the tag {_abbreviated(event.tag)} is not allowed; write the value without it",
            )
        if event.anchor is not None:
            # None marks an incomplete node. An alias inside it would be an infinite recursion.
            self._anchors[event.anchor] = None
        node: nodes.Node
        count_before = self._count
        self._count += 1
        if isinstance(event, yaml.ScalarEvent):
            node = nodes.ScalarNode(
                location.line, location.column, event.value, plain=not event.style
            )
        elif isinstance(event, yaml.SequenceStartEvent):
            node = nodes.ListNode(
                location.line,
                location.column,
                tuple(self._build_children(yaml.SequenceEndEvent, depth)),
            )
        else:
            children = self._build_children(yaml.MappingEndEvent, depth)
            # Keys and values alternate. Both arguments of zip are the same iterator, so zip forms
            # pairs of key and value.
            node = nodes.MappingNode(
                location.line, location.column, tuple(zip(children, children, strict=True))
            )
        if event.anchor is not None:
            self._anchors[event.anchor] = node, self._count - count_before
        return node

    def _build_children(self, end: type[yaml.Event], depth: int) -> Iterator[nodes.Node]:
        """Yield the nodes of a list, or alternately the keys and values of a mapping, until `end`.
        ModelError is raised if a mapping has too many keys.
        """
        count = 0
        while not isinstance(event := self._next_event(), end):
            count += 1
            if end is yaml.MappingEndEvent and count > 2 * _MAX_KEYS:
                raise self._error(
                    event,
                    f"more than {_MAX_KEYS} keys in a mapping; this is not a "
                    f"{self._faults.file_type}",
                )
            yield self._build_node(event, depth + 1)


def _abbreviated(text: str) -> str:
    """Return text of the file for a message, on one line and with at most 60 characters."""
    if len(text) <= 60 and text.isprintable():
        return text
    return repr(text[:60]) + ("..." if len(text) > 60 else "")


def _line_and_column(text: str) -> tuple[int, int]:
    """Return the line and column, counted from 1, of the character that follows `text`."""
    return text.count("\n") + 1, len(text) - text.rfind("\n")


def _event_location(event: yaml.Event) -> nodes.Location:
    """Return the line and column of an event, counted from 1."""
    assert event.start_mark is not None
    return nodes.Location(event.start_mark.line + 1, event.start_mark.column + 1)
