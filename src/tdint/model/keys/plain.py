"""A model that is a Python mapping, as the nodes that a file would give: one reader reads both."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

from tdint.model.keys.yaml_source import MAX_DEPTH, Faults, ListNode, MappingNode, Node, Place, ScalarNode

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
