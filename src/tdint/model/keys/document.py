"""A file of keys from its text to its root: what reading one begins with, whatever its keys are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

from tdint.model.keys.fields import Value
from tdint.model.keys.plain import nodes_of, text_of
from tdint.model.keys.source import SourceText, read_source
from tdint.model.keys.yaml_source import Faults, decode, parse


def read_document(
    source: str | Path | TextIO | Mapping[str, Any], kind: str = "model file", needs: str = "`stories`"
) -> tuple[SourceText, Value]:
    """Where a document comes from, and its root, whose `faults` collect what is wrong in it.

    Parameters
    ----------
    source : str, Path, text stream or mapping
        A YAML file, `-` for standard input; or what such a file would say.
    kind, needs : str
        What the file is and what it must hold, for messages.

    Raises
    ------
    ModelError
        It cannot be read or is not YAML.
    """
    if isinstance(source, Mapping):
        faults = Faults("model")
        node = nodes_of(source, faults)
        return SourceText("model", "model", Path(), text_of(node)), Value(node, "", faults)
    origin = read_source(source, kind)
    faults = Faults(origin.label, kind, needs)
    return origin, Value(parse(decode(origin.data, faults), faults), "", faults)
