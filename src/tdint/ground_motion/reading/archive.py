"""Zip files of records, as data centers deliver them: members are read in memory, none is written anywhere."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from io import BytesIO

from tdint.errors import RecordError
from tdint.ground_motion.messages import one_line
from tdint.ground_motion.reading.source import LARGEST

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
