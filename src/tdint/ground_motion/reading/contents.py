"""What a file holds: its bytes or those of the records in a zip file, their format, and what the
format's reader finds.

Every way in which a file cannot be read is said in the user's words. Zip files, as data centers
deliver them, are read in memory: no member is written anywhere.

ObsPy offers any file to every plugin it finds, one of which unpickles it: a crafted `.mseed` would
run code. It also fetches URLs, expands wildcards and unpacks archives. None of this happens here:
the plugins are taken by name from two distributions, ObsPy's by the list below and tdint's own, and
they see bytes in memory, never a file name.
"""

from __future__ import annotations

import hashlib
import re
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint.errors import RecordError
from tdint.files import MOST_BYTES, note_input, read_whole
from tdint.ground_motion.choice import AS_STATED, TextLayout
from tdint.ground_motion.header_checks import compare_with_statements, look_at
from tdint.ground_motion.messages import caught_messages, one_line, quiet_import
from tdint.ground_motion.miniseed_checks import Damaged
from tdint.ground_motion.record import Input

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints
    from zipfile import ZipFile, ZipInfo

LARGEST = MOST_BYTES
"""Bytes; reading takes some six times as much memory."""

_ZIP = b"PK\x03\x04"
_MOST_MEMBERS = 2000  # of an archive: downloads of a suite have tens to hundreds
_DEEPEST = 2  # archives in archives: databases pack one level
_LONGEST_NAME = 120  # letters that a message shows
_PIECE = 2**20  # bytes read at a time

_GROUP = "obspy.plugin.waveform"

_FIRST = ("MSEED", "KNET")
_REST = ("SAC", "GSE2", "GSE1", "SLIST", "TSPAIR", "SH_ASC", "KINEMETRICS_EVT", "GCF", "REFTEK130")
OBSPY_FORMATS = _FIRST + _REST
"""ObsPy's formats that are read: recorders' and exchange formats of ground motion whose plugin
reads from memory, runs nothing and opens no other file, and in which a cut-off file can be told.
PICKLE runs code; CSS, NNSA_KB_CORE and Q open the files that a header names; AH and SACXY cannot
tell a damaged file; DMX, PDAS, SEISAN, WIN and Y read from a named file only; CYBERSHAKE holds
velocities; the others are not ground motion."""

_DAMAGE = re.compile(
    r"^ERROR|not be read|skip|corrupt|truncat|integrity check|broken|contiguous|permuted|[Dd]ropp",
    re.IGNORECASE,
)
"""Warnings of ObsPy's readers after which samples are missing or wrong. Others (an unusual header)
become notes."""

TABLES = "TEXT"
"""The format of which a user may say what the file does not."""

_ARCHIVES = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}


def read_bytes(source: str | Path) -> bytes:
    """Read a whole file.

    The name is a path and nothing else: no URL is fetched, no wildcard is expanded, nothing is
    uncompressed.

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
    # What the user may have meant by a name that is no file.
    hint = ""
    if "://" in str(source):
        hint = "; addresses are not fetched, download the record first"
    elif any(sign in str(source) for sign in "*?["):
        hint = (
            "; wildcards are not expanded here, name one file (a shell expands them when they are "
            "not quoted)"
        )
    told: dict[type[Exception], str] = {
        FileNotFoundError: f"there is no such file{hint}",
        IsADirectoryError: "is a directory; name the record's file in it",
        PermissionError: "no permission to read the file",
    }
    large = "the file is larger than 256 MiB; cut the event out of it first"
    content = read_whole(source, RecordError, told, large, LARGEST)
    if not content:
        raise RecordError(f"{source}: the file is empty")
    return content


def digested(data: bytes, source: str | Path) -> Input:
    """What was read from a file, by name and SHA-256."""
    note_input(source, data)
    return Input(str(source), hashlib.sha256(data).hexdigest())


def is_archive(data: bytes) -> bool:
    """Whether a file is a zip file by its first bytes."""
    return data.startswith(_ZIP)


def members(data: bytes, source: str) -> Iterator[tuple[str, bytes]]:
    """Names (`archive.zip/folder/file`) and contents of the files in a zip file, and in zip files
    within it.

    The archive's own checksums are compared. Sizes are counted while uncompressing, whatever the
    archive states.

    Raises
    ------
    RecordError
        The archive is damaged, encrypted, or larger than 256 MiB in all when uncompressed.
    """
    return _members(data, source, [LARGEST], 1)


def _members(
    data: bytes, source: str, budget: list[int], depth: int
) -> Iterator[tuple[str, bytes]]:
    import zipfile  # of archives alone

    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            files = []
            for info in archive.infolist():
                # What systems put into archives beside the user's files is passed over.
                is_hidden = any(
                    part.startswith((".", "__MACOSX")) for part in info.filename.split("/")
                )
                if not (info.is_dir() or is_hidden):
                    files.append(info)
            if len(files) > _MOST_MEMBERS:
                raise RecordError(
                    f"{source}: the archive holds {len(files)} files; take out those of the motion"
                )
            for info in files:
                name = f"{source}/{info.filename[:_LONGEST_NAME]}"
                content = _content(archive, info, name, budget)
                if is_archive(content) and depth < _DEEPEST:
                    yield from _members(content, name, budget, depth + 1)
                elif content:
                    yield name, content
    except RecordError:
        raise
    except (
        zipfile.BadZipFile,
        NotImplementedError,
        EOFError,
        OSError,
        ValueError,
        RuntimeError,
    ) as error:
        raise RecordError(
            f"{source}: the archive is damaged or cannot be read: {one_line(str(error))}"
        ) from error
    except Exception as error:  # zlib and lzma have errors of their own.
        raise RecordError(f"{source}: the archive is damaged: {one_line(str(error))}") from error


def _content(archive: ZipFile, info: ZipInfo, name: str, budget: list[int]) -> bytes:
    if info.flag_bits & 1:
        raise RecordError(f"{name}: is encrypted; unpack the archive first")
    content = bytearray()
    with archive.open(info) as file:
        while piece := file.read(_PIECE):
            content += piece
            budget[0] -= len(piece)
            if budget[0] < 0:
                raise RecordError(
                    f"{name}: the archive is larger than 256 MiB uncompressed; take out the motion "
                    "first"
                )
    return bytes(content)


@dataclass(frozen=True)
class Plugin:
    """One format's two functions, not imported yet."""

    name: str
    is_format: EntryPoint
    read_format: EntryPoint

    @property
    def is_own(self) -> bool:
        """Whether it is tdint's, not ObsPy's."""
        return self.name not in OBSPY_FORMATS


@dataclass(frozen=True)
class Contents:
    """What a file holds: `traces` are obspy Trace objects with numbers in them, in file order.

    `compared` names what the file states of itself and was compared with them; empty if it states
    nothing.
    """

    format: str
    traces: list[Any]
    notes: tuple[str, ...]
    compared: tuple[str, ...]


def is_record(source: str | Path, layout: TextLayout = AS_STATED) -> bool:
    """Whether a file has one of the known formats; True as well for one that cannot be read, which
    reading will tell.

    A file that has a known format may still be damaged.
    """
    try:
        data = read_bytes(source)
        if is_archive(data):  # Spreadsheets and others are zip files, too: the name tells.
            return str(source).lower().endswith(".zip")
        return _format_of(data, layout) is not None
    except RecordError:
        return True


def formats_of(source: str, layout: TextLayout = AS_STATED) -> list[tuple[str, str]]:
    """Names and formats of the records in a file: of itself, or of those in an archive. Errors are
    `read_bytes`'."""
    data = read_bytes(source)
    parts = [*members(data, source)] if is_archive(data) else [(source, data)]
    known = [(part, _format_of(content, layout)) for part, content in parts]
    return [(part, plugin.name) for part, plugin in known if plugin]


def read_parts(
    data: bytes, source: str, layout: TextLayout = AS_STATED
) -> list[tuple[str, Contents]]:
    """What a file holds; of a zip file what the records in it hold, each with its name. As
    `read_contents`."""
    parts = [(source, data)]
    if is_archive(data):
        files = [*members(data, source)]
        parts = [(part, content) for part, content in files if _format_of(content, layout)]
        if not parts:
            listed = (
                ", ".join(part.removeprefix(f"{source}/")[:60] for part, _ in files[:10])
                or "nothing"
            )
            raise RecordError(
                f"{source}: the archive holds no record of a known format; it holds {listed}"
            )
    return [(part, read_contents(content, part, layout)) for part, content in parts]


def read_contents(data: bytes, source: str, layout: TextLayout = AS_STATED) -> Contents:
    """Read all traces of a record.

    Parameters
    ----------
    data : bytes
        The whole file.
    source : str
        The file's name, for messages only.
    layout : TextLayout
        What the user says of text tables.

    Returns
    -------
    Contents
        At least one trace; channels of text (a recorder's log) are left out.

    Raises
    ------
    RecordError
        Not a known format, damaged, cut off, or without a numeric channel.
    """
    plugin = _detect(data, source, layout)
    try:
        if plugin.name != TABLES:
            layout.check_format(plugin.name)
        # Before the reader of another program sees the bytes: some of them never end, or crash, on
        # bad ones.
        looked_at = look_at(plugin.name, data)
        traces, messages = _read(plugin, data, layout)
        if damage := next(filter(_DAMAGE.search, messages), None):
            raise Damaged(damage)
        with caught_messages() as differences:
            compared = compare_with_statements(plugin.name, looked_at, traces)
        for trace in traces:
            layout.check_step(float(trace.stats.delta))
    except Damaged as error:
        raise RecordError(
            f"{source}: the file is damaged or cut off: {error}; fetch it again"
        ) from error
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from error
    except struct.error as error:
        raise RecordError(
            f"{source}: the file is cut off within its header ({plugin.name})"
        ) from error
    # A recorder's log is a channel, too, of text.
    numeric = [trace for trace in traces if trace.data.dtype.kind in "iuf"]
    if not numeric:
        raise RecordError(f"{source}: the file ({plugin.name}) holds no samples of ground motion")
    speaker = "" if plugin.is_own else "ObsPy: "
    of_traces = [name for trace in numeric for name in trace.stats.get("tdint_compared", ())]
    notes = (*(speaker + message for message in messages), *differences)
    return Contents(plugin.name, numeric, notes, tuple(dict.fromkeys([*compared, *of_traces])))


@cache
def plugins() -> tuple[Plugin, ...]:
    """The formats that may be read, in the order in which a file is offered to them; asked for
    once.

    ObsPy's most frequent formats, whose checks are strict, come before those of tdint.
    """
    from importlib.metadata import (
        EntryPoints,
        PackageNotFoundError,
        distribution,
    )  # only where a file is read

    theirs = distribution("obspy").entry_points
    try:
        ours = distribution("tdint").entry_points
    except PackageNotFoundError:  # Run from a source tree that is not installed.
        ours = EntryPoints()
    names = sorted(ours.select(group=_GROUP).names)
    return (*_named(theirs, _FIRST), *_named(ours, names), *_named(theirs, _REST))


def _named(entries: EntryPoints, names: Iterable[str]) -> Iterator[Plugin]:
    by_name = {(entry.group, entry.name): entry for entry in entries}
    for name in names:
        is_format, read_format = (
            by_name.get((f"{_GROUP}.{name}", function)) for function in ("isFormat", "readFormat")
        )
        if is_format and read_format:
            yield Plugin(name, is_format, read_format)


def _detect(data: bytes, source: str, layout: TextLayout) -> Plugin:
    plugin = _format_of(data, layout)
    if plugin is not None:
        return plugin

    # Compressed files and pickled objects are told by their first bytes.
    for start, archive in _ARCHIVES.items():
        if data.startswith(start):
            raise RecordError(f"{source}: the file is compressed ({archive}); uncompress it first")
    if data.startswith(b"\x80") and data.endswith(b"."):
        look = "by its look a pickled object: loading one can run code; write it as MiniSEED"
        raise RecordError(f"{source}: unknown format, {look}")

    # A table in a text that tells nothing of it can be read with what the user says.
    from tdint.ground_motion.formats.text import table_in

    if table := table_in(data, layout):
        raise RecordError(f"{source}: unknown format: {table}")
    hint = (
        f", and no table of numbers stands below its first {layout.skip_lines or 0} lines"
        if layout
        else ""
    )
    formats = ", ".join(plugin.name for plugin in plugins())
    raise RecordError(f"{source}: unknown format{hint}; those that are read: {formats}")


def _format_of(data: bytes, layout: TextLayout) -> Plugin | None:
    offers: list[tuple[Plugin, dict[str, Any]]] = [(plugin, {}) for plugin in plugins()]
    if layout:
        offers += [(plugin, {"layout": layout}) for plugin in plugins() if plugin.name == TABLES]
    with caught_messages():
        return next((plugin for plugin, said in offers if _accepts(plugin, data, **said)), None)


def _accepts(plugin: Plugin, data: bytes, **said: Any) -> bool:
    try:
        return bool(_load(plugin.is_format)(BytesIO(data), **said))
    except Exception:  # A check that stumbles over foreign bytes has not recognized them.
        return False


def _read(plugin: Plugin, data: bytes, layout: TextLayout) -> tuple[list[Any], list[str]]:
    """The traces of a file, and what was said while they were read."""
    function = _load(plugin.read_format)
    said = {"layout": layout} if plugin.name == TABLES else {}
    try:
        with caught_messages() as messages:
            traces = list(function(BytesIO(data), **said))
    except RecordError:  # A reader of tdint's own, which knows what is wrong.
        raise
    except Exception as error:  # Readers of corrupt bytes raise whatever their parsing runs into.
        reason = one_line(str(error)) or type(error).__name__
        raise RecordError(
            f"cannot be read as {plugin.name}, the file may be damaged: {reason}"
        ) from error
    return traces, messages


def _load(entry: EntryPoint) -> Any:
    with quiet_import():
        return entry.load()
