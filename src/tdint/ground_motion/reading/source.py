"""The bytes of a file or of standard input, with every way this can fail said in the user's words."""

from __future__ import annotations

import hashlib
from pathlib import Path

from tdint.errors import RecordError
from tdint.ground_motion.record import Input
from tdint.input_bytes import MOST_BYTES, read_at_most

LARGEST = MOST_BYTES
"""Bytes; reading takes some six times as much memory."""


def read_bytes(source: str | Path) -> bytes:
    """Read a whole file.

    The name is a path and nothing else: no URL is fetched, no wildcard is expanded, nothing is uncompressed.

    Parameters
    ----------
    source : str or Path
        The file, or `-` for standard input.

    Returns
    -------
    bytes
        What the file holds, at least one byte.

    Raises
    ------
    RecordError
        The file is missing, no file, not readable, empty, or larger than 256 MiB.
    """
    try:
        content = read_at_most(source, LARGEST, RecordError)
    except FileNotFoundError:
        raise RecordError(f"{source}: there is no such file{_name_hint(str(source))}") from None
    except IsADirectoryError:
        raise RecordError(f"{source}: is a directory; name the record's file in it") from None
    except PermissionError:
        raise RecordError(f"{source}: no permission to read the file") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error  # without the name again
        raise RecordError(f"{source}: cannot be read: {reason}") from error
    if not content:
        raise RecordError(f"{source}: the file is empty")
    if len(content) > LARGEST:
        raise RecordError(f"{source}: the file is larger than 256 MiB; cut the event out of it first")
    return content


def digested(data: bytes, source: str | Path) -> Input:
    """What was read from a file, by name and SHA-256."""
    return Input(str(source), hashlib.sha256(data).hexdigest())


def _name_hint(name: str) -> str:
    """What the user may have meant by a name that is no file."""
    if "://" in name:
        return "; addresses are not fetched, download the record first"
    if any(sign in name for sign in "*?["):
        return "; wildcards are not expanded here, name one file (a shell expands them when they are not quoted)"
    return ""
