"""The bytes of an input, a file or standard input: at most so many, and of nothing that may never end."""

from __future__ import annotations

import stat
import sys
from collections.abc import Callable
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO

from tdint.errors import TdintError

STDIN = "-"
"""The name that stands for standard input."""

MOST_BYTES = 2**28
"""Of the largest file that is read: 256 MiB."""

_PIECE = 2**20

READ: ContextVar[dict[str, str] | None] = ContextVar("read", default=None)
"""SHA-256 of the inputs that the command that runs has read, by name; None where nobody asks."""


def note_input(source: str | Path, content: bytes | Callable[[], str]) -> None:
    """Keep that this was read, for who tells what a result came from; of what is large give what makes its SHA-256."""
    seen = READ.get()
    if seen is not None:
        from hashlib import sha256

        seen[str(source)] = sha256(content).hexdigest() if isinstance(content, bytes) else content()


def read_at_most(source: str | Path, most: int, error: type[TdintError]) -> bytes:
    """Read a file, up to one byte beyond `most`, which tells that it is larger.

    Parameters
    ----------
    source : str or Path
        The file, or `-` for standard input.
    most : int
        Bytes.
    error : type
        The error of the reader's kind of file.

    Raises
    ------
    TdintError
        Of the type `error`: the file is a named pipe, or there is no standard input.
    OSError, ValueError
        The system cannot read it, or no file can have this name: readers say it in their own words.
    """
    if str(source) != STDIN:
        if is_named_pipe(source):
            raise error(f"{source}: is a named pipe, which may never end; read from it with - and <")
        with Path(source).open("rb") as file:
            return _read(file, most)
    stream = getattr(sys.stdin, "buffer", None)
    if stream is None:
        raise error(f"{STDIN}: there is no standard input to read from")
    return _read(stream, most)


def _read(file: BinaryIO, most: int) -> bytes:
    """Read in pieces: an endless device ends at `most`, and memory grows as needed."""
    content = bytearray()
    while len(content) <= most and (piece := file.read(_PIECE)):
        content += piece
    return bytes(content)


def is_named_pipe(source: str | Path) -> bool:
    """Whether opening a file may wait for ever; pipes that a shell has opened (`<(command)`) are none of those."""
    if str(source).startswith(("/dev/fd/", "/proc/")):
        return False
    try:
        return stat.S_ISFIFO(Path(source).stat().st_mode)
    except (OSError, ValueError):  # Opening it tells why.
        return False


def is_folder(name: str | Path) -> bool:
    """Whether a name is that of a folder; False also for one that can be no file's (too long, say)."""
    try:
        return Path(name).is_dir()
    except (OSError, ValueError):
        return False


def is_file(name: str | Path) -> bool:
    """Whether a name is that of a file, as `is_folder`."""
    try:
        return Path(name).is_file()
    except (OSError, ValueError):
        return False
