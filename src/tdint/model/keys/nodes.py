"""Nodes of a file with their lines and columns, and the collection of its errors.

The nodes are built from YAML (`document`) or from Python objects (`nodes_of`). Scalars remain text.
YAML 1.1, which PyYAML implements, reads 2e8 as a string, `no` as false and 012 as 10. Therefore the
text is converted when the required type is known (`fields`).
"""

from __future__ import annotations

import json
import os
from array import array
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from tdint.errors import ModelError, ModelFault

MAX_DEPTH = 32
"""Maximum number of nested levels in a file. A model needs six levels; the limit keeps the
recursion below the limit of Python."""


class Location(NamedTuple):
    """Line and column of the start of a node, counted from 1."""

    line: int
    column: int


class ScalarNode(NamedTuple):
    """Scalar value with its text. `plain` is True without quotation marks and block indicators."""

    line: int
    column: int
    text: str
    plain: bool


# Aliases share nodes, so a few lines can define an astronomically large tree. Nodes must not be
# compared or printed.
class ListNode(NamedTuple):
    """A list."""

    line: int
    column: int
    items: Sequence[Node]


class MappingNode(NamedTuple):
    """A mapping in file order; equal keys are kept."""

    line: int
    column: int
    entries: tuple[tuple[Node, Node], ...]


Node = ScalarNode | ListNode | MappingNode


class NumberRows(Sequence[Node]):
    """Rows of numbers of a Python object, as the items of a list. A row becomes nodes only when it
    is read: a table of forces has many thousands of numbers.

    Attributes
    ----------
    data : array of float
        The numbers, row by row.
    columns : int
        Numbers of each row, at least 1.
    """

    def __init__(self, data: array[float], columns: int) -> None:
        self.data = data
        self.columns = columns

    def __len__(self) -> int:
        return len(self.data) // self.columns

    def __getitem__(self, index: Any) -> Any:
        """Return the row with an index, or a tuple of the rows of a slice."""
        if isinstance(index, slice):
            return tuple(self[k] for k in range(len(self))[index])
        first = range(len(self))[index] * self.columns
        numbers = self.data[first : first + self.columns]
        # A whole number is written without a decimal point, as most users wrote it.
        texts = (repr(number).removesuffix(".0") for number in numbers)
        return ListNode(0, 0, tuple(ScalarNode(0, 0, text, plain=True) for text in texts))


@dataclass(eq=False, repr=False)
class Faults:
    """Collection of the errors of one file, which are reported together.

    Attributes
    ----------
    source : str
        Name of the file in messages.
    """

    source: str
    file_type: str = "model file"
    needs: str = "`stories`"
    folder: Path = Path()
    _faults: list[ModelFault] = field(default_factory=list)

    def add(self, location: Location | Node, key: str, message: str) -> None:
        """Add an error of `key` at a line and column."""
        self._faults.append(ModelFault(self.source, location.line, location.column, key, message))

    def error(self) -> ModelError:
        """Return the exception with all errors in the order of the file. The two directions of a
        model report an error in common values twice; it is listed one time."""
        faults = dict.fromkeys(self._faults)
        return ModelError(sorted(faults, key=lambda problem: (problem.line, problem.column)))

    def raise_if_any(self) -> None:
        """Raise the exception if an error has been added."""
        if self._faults:
            raise self.error()


_NO_LOCATION = Location(0, 0)


def nodes_of(value: object, faults: Faults, depth: int = 0) -> Node:
    """Return the nodes of mappings, lists, numbers and text, with line and column 0.

    Parameters
    ----------
    value : object
        Mapping, list, number, text, path, boolean or None.
    depth : int
        Nesting level of the value, from 0.

    Raises
    ------
    ModelError
        A value has a type that a file cannot contain, or a mapping contains itself.
    """
    # Convert arrays and numbers of NumPy.
    if hasattr(value, "tolist"):
        if getattr(value, "ndim", 0) == 2 and value.size and value.dtype.kind in "fiu":  # type: ignore[attr-defined]
            data = array("d", value.astype(float).tobytes())  # type: ignore[attr-defined]
            return ListNode(0, 0, NumberRows(data, value.shape[1]))  # type: ignore[attr-defined]
        value = value.tolist()
    if depth > MAX_DEPTH:
        faults.add(_NO_LOCATION, "", f"more than {MAX_DEPTH} nested levels; this is not a model")
        raise faults.error()
    if isinstance(value, Mapping):
        entries = tuple(
            (_scalar(key, faults), nodes_of(item, faults, depth + 1)) for key, item in value.items()
        )
        return MappingNode(0, 0, entries)
    if isinstance(value, list | tuple):
        if rows := _number_rows(value):
            return ListNode(0, 0, rows)
        return ListNode(0, 0, tuple(nodes_of(item, faults, depth + 1) for item in value))
    return _scalar(value, faults)


def _number_rows(rows: Sequence[object]) -> NumberRows | None:
    """Return a list of equally long rows of numbers; None for any other list."""
    if not rows or {*map(type, rows)} - {list, tuple}:
        return None
    lengths = {*map(len, rows)}  # type: ignore[arg-type]
    numbers: tuple[Any, ...] = tuple(chain.from_iterable(rows))  # type: ignore[arg-type]
    types = {*map(type, numbers)}
    is_number = bool not in types and all(issubclass(kind, int | float) for kind in types)
    if len(lengths) > 1 or not numbers or not is_number:
        return None
    try:
        return NumberRows(array("d", numbers), lengths.pop())
    except OverflowError:  # an integer above 1.8e308
        return None


def plain_values(node: Node) -> Any:
    """Return a node as mappings, lists, numbers and text, for `nodes_of`.

    Text without quotation marks that is a number becomes a number.
    """
    if isinstance(node, MappingNode):
        return {plain_values(key): plain_values(item) for key, item in node.entries}
    if isinstance(node, ListNode):
        return [plain_values(item) for item in node.items]
    words = {"null": None, "true": True, "false": False}
    if not node.plain or node.text in words:
        return words.get(node.text, node.text) if node.plain else node.text
    for number in (int, float):
        with suppress(ValueError):
            return number(node.text)
    return node.text


def text_of(node: Node) -> bytes:
    """Return the nodes as JSON (see `_as_lists`), for the SHA-256 of a model without a file."""
    return json.dumps(_as_lists(node), ensure_ascii=True).encode()


def _scalar(value: object, faults: Faults) -> ScalarNode:
    """Return the node of a number, text, path, boolean or None; ModelError for another type."""
    # None and booleans have the texts of YAML.
    if value is None or isinstance(value, bool):
        return ScalarNode(0, 0, "null" if value is None else str(value).lower(), plain=True)
    if isinstance(value, int | float):
        return ScalarNode(0, 0, repr(value), plain=True)
    if isinstance(value, str | os.PathLike):
        return ScalarNode(0, 0, os.fspath(value), plain=False)
    # A law object has its functions as an attribute.
    remedy = ""
    if hasattr(value, "functions"):
        from tdint.model.plugins import SAVE_IT

        remedy = f"; {SAVE_IT}"
    faults.add(
        _NO_LOCATION,
        "",
        f"a model contains mappings, lists, numbers and text, not {type(value).__name__}{remedy}",
    )
    raise faults.error()


def _as_lists(node: Node) -> Any:
    """Return a node as nested lists: a mapping is a list of lists [key, value]. Rows of numbers of
    Python objects are represented by their SHA-256, which is faster than their text."""
    if isinstance(node, MappingNode):
        return [[_as_lists(key), _as_lists(item)] for key, item in node.entries]
    if isinstance(node, ListNode) and isinstance(node.items, NumberRows):
        import hashlib  # most models are not built from Python objects

        return [node.items.columns, hashlib.sha256(node.items.data).hexdigest()]
    if isinstance(node, ListNode):
        return [_as_lists(item) for item in node.items]
    return node.text
