"""The bytes of a file or of standard input, with every way this can fail said in the user's words.

Zip files of records, as data centers deliver them, are read in memory: no member is written anywhere.
"""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from tdint.errors import RecordError
from tdint.ground_motion.messages import one_line
from tdint.ground_motion.record import Input
from tdint.input_bytes import MOST_BYTES, note_input, read_at_most

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
    note_input(source, data)
    return Input(str(source), hashlib.sha256(data).hexdigest())


def _name_hint(name: str) -> str:
    """What the user may have meant by a name that is no file."""
    if "://" in name:
        return "; addresses are not fetched, download the record first"
    if any(sign in name for sign in "*?["):
        return "; wildcards are not expanded here, name one file (a shell expands them when they are not quoted)"
    return ""


START = b"PK\x03\x04"
_MOST_MEMBERS = 2000
_DEEPEST = 2
_LONGEST_NAME = 120
_PIECE = 2**20


def is_archive(data: bytes) -> bool:
    """Whether a file is a zip file by its first bytes."""
    return data.startswith(START)


def members(data: bytes, source: str) -> list[tuple[str, bytes]]:
    """Names (`archive.zip/folder/file`) and contents of the files in a zip file, and in zip files within it.

    The archive's own checksums are compared. Sizes are counted while uncompressing, whatever the archive states.

    Raises
    ------
    RecordError
        The archive is damaged, encrypted, or larger than 256 MiB in all when uncompressed.
    """
    budget = [LARGEST]
    return list(_members(data, source, budget, 1))


def _members(data: bytes, source: str, budget: list[int], depth: int) -> Iterator[tuple[str, bytes]]:
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            files = [info for info in archive.infolist() if not info.is_dir() and not _is_hidden(info.filename)]
            if len(files) > _MOST_MEMBERS:
                raise RecordError(f"{source}: the archive holds {len(files)} files; take out those of the motion")
            for info in files:
                name = f"{source}/{info.filename[:_LONGEST_NAME]}"
                content = _content(archive, info, name, budget)
                if is_archive(content) and depth < _DEEPEST:
                    yield from _members(content, name, budget, depth + 1)
                elif content:
                    yield name, content
    except RecordError:
        raise
    except (zipfile.BadZipFile, NotImplementedError, EOFError, OSError, ValueError, RuntimeError) as error:
        raise RecordError(f"{source}: the archive is damaged or cannot be read: {one_line(str(error))}") from error
    except Exception as error:  # zlib and lzma have errors of their own.
        raise RecordError(f"{source}: the archive is damaged: {one_line(str(error))}") from error


def _content(archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str, budget: list[int]) -> bytes:
    if info.flag_bits & 1:
        raise RecordError(f"{name}: is encrypted; unpack the archive first")
    content = bytearray()
    with archive.open(info) as file:
        while piece := file.read(_PIECE):
            content += piece
            budget[0] -= len(piece)
            if budget[0] < 0:
                raise RecordError(f"{name}: the archive is larger than 256 MiB uncompressed; take out the motion first")
    return bytes(content)


def _is_hidden(name: str) -> bool:
    return any(part.startswith((".", "__MACOSX")) for part in name.split("/"))
