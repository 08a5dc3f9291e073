"""A file of keys from its text to its root: what reading one begins with, whatever its keys are.

The text comes from a file, standard input or a stream; paths in it start from its folder.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from tdint.errors import ModelError
from tdint.files import is_named_pipe, note_input
from tdint.model.keys.fields import Value
from tdint.model.keys.nodes import Faults, decode, nodes_of, parse, text_of

MAX_BYTES = 16 * 1024 * 1024
"""Size of the largest model file that is read; it keeps a wrong path, such as a device, from filling the memory."""


@dataclass(frozen=True)
class SourceText:
    """A model file as read: how messages call it, its default name, the folder its paths start from, its content."""

    label: str
    name: str
    folder: Path
    data: bytes


def read_source(source: str | Path | TextIO, kind: str = "model file") -> SourceText:
    """The content of a file of some kind; `-` is standard input.

    Raises
    ------
    ModelError
        It cannot be read.
    """
    if source is sys.stdin or (isinstance(source, str | Path) and str(source) == "-"):
        if sys.stdin is None:
            raise ModelError(f"-: standard input is closed; give a {kind}")
        return SourceText(
            "-", kind.partition(" ")[0], Path(), _read_stream(getattr(sys.stdin, "buffer", sys.stdin), "-", kind)
        )
    if isinstance(source, str | Path):
        path, label = Path(source), str(source) or "."
        if is_named_pipe(path):
            raise ModelError(f"{label}: is a named pipe, which may never end; read from it with - and <")
        try:
            with path.open("rb") as stream:
                return SourceText(label, path.stem, path.parent, _read_stream(stream, label, kind))
        except FileNotFoundError:
            raise ModelError(f"{label}: no such file; give a {kind} (YAML) or - for standard input") from None
        except IsADirectoryError:
            raise ModelError(f"{label}: is a folder; give a {kind} (YAML) in it") from None
        except OSError as error:
            raise ModelError(f"{label}: cannot be read: {error.strerror or error}") from None
        except ValueError:
            raise ModelError(f"{label}: cannot be read: no file has a null character in its name") from None
    if not hasattr(source, "read"):
        raise ModelError(f"a model is a file's name or a text stream, not {type(source).__name__}")
    name = getattr(source, "name", None)
    if isinstance(name, str) and not name.startswith("<"):
        return SourceText(name, Path(name).stem, Path(name).parent, _read_stream(source, name, kind))
    return SourceText("<stream>", kind.partition(" ")[0], Path(), _read_stream(source, "<stream>", kind))


def _read_stream(stream: TextIO | BinaryIO, label: str, kind: str) -> bytes:
    try:
        content = stream.read(MAX_BYTES + 1)
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{label}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > MAX_BYTES:
        raise ModelError(f"{label}: larger than {MAX_BYTES // 1024**2} MiB; this is no {kind}")
    # Surrogates stand for bytes that the stream could not decode; passed on, `decode` finds them.
    encoded = content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
    note_input(label, encoded)
    return encoded


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
    faults = Faults(origin.label, kind, needs, origin.folder)
    return origin, Value(parse(decode(origin.data, faults), faults), "", faults)
