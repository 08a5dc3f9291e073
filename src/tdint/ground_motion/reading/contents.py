"""Reading of record files: bytes of a file or of the records in a zip file, format and traces.

All errors are reported in terms of the file. Zip files, as delivered by data centers, are read in
memory; their members are not written to disk.

`obspy.read` passes a file to every installed plugin. One of them unpickles files, so a crafted
`.mseed` file could execute code. `obspy.read` also downloads URLs, expands wildcards and unpacks
archives. This module avoids all of these. It uses only named plugins of two distributions, the
plugins of ObsPy listed below and those of tdint, and passes bytes in memory instead of file names.
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
from tdint.files import MOST_BYTES, read_whole, record_digest
from tdint.ground_motion.choice import AS_STATED, TextLayout
from tdint.ground_motion.header_checks import compare_with_statements, look_at
from tdint.ground_motion.messages import caught_messages, one_line, quiet_import
from tdint.ground_motion.miniseed_checks import Damaged
from tdint.ground_motion.record import Input

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints
    from zipfile import ZipFile, ZipInfo

LARGEST = MOST_BYTES
"""Maximum size of a file, bytes; reading needs about six times as much memory."""

_ZIP = b"PK\x03\x04"
_MOST_MEMBERS = 2000  # maximum number of files in an archive; suites have tens to hundreds
_DEEPEST = 2  # maximum depth of nested archives; databases use one level
_LONGEST_NAME = 120  # characters; maximum length of a file name in a message
_PIECE = 2**20  # bytes read in one step

_GROUP = "obspy.plugin.waveform"

_FIRST = ("MSEED", "KNET")
_REST = ("SAC", "GSE2", "GSE1", "SLIST", "TSPAIR", "SH_ASC", "KINEMETRICS_EVT", "GCF", "REFTEK130")
OBSPY_FORMATS = _FIRST + _REST
"""ObsPy formats that are supported: recorder and exchange formats of ground motion with a plugin
that reads from memory, does not execute code, does not open other files and detects truncated
files. Not supported: PICKLE executes code; CSS, NNSA_KB_CORE and Q open files named in a header; AH
and SACXY do not detect corrupt files; DMX, PDAS, SEISAN, WIN and Y require a file name; CYBERSHAKE
contains velocities; the remaining formats are not ground motion."""

_DAMAGE = re.compile(
    r"^ERROR|not be read|skip|corrupt|truncat|integrity check|broken|contiguous|permuted|[Dd]ropp",
    re.IGNORECASE,
)
"""Pattern of reader warnings that indicate missing or wrong samples. Other warnings (for example of
an unusual header) become notes. Warnings of the readers of tdint must not match this pattern."""

TABLES = "TEXT"
"""Format with a layout that the user may specify."""

_ARCHIVES = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}


def read_bytes(source: str | Path) -> bytes:
    """Read the content of a file.

    The name is used only as a path: URLs are not downloaded, wildcards are not expanded, and
    compressed files are not uncompressed.

    Parameters
    ----------
    source : str or Path
        File name, or `-` for standard input.

    Returns
    -------
    bytes
        Content of the file, at least one byte.

    Raises
    ------
    RecordError
        The file is missing, not a regular file, not readable, empty, or larger than 256 MiB.
    """
    # Explain common mistakes in the name of a missing file.
    hint = ""
    if "://" in str(source):
        hint = "; addresses are not fetched, download the record first"
    elif any(sign in str(source) for sign in "*?["):
        hint = (
            "; wildcards are not expanded here, name one file (a shell expands them when they are "
            "not quoted)"
        )
    told: dict[type[Exception], str] = {
        FileNotFoundError: f"file not found{hint}",
        IsADirectoryError: "this is a directory; specify a record file in it",
        PermissionError: "no permission to read the file",
    }
    large = "the file is larger than 256 MiB; extract the event from it first"
    content = read_whole(source, RecordError, told, large, LARGEST)
    if not content:
        raise RecordError(f"{source}: the file is empty")
    return content


def digested(data: bytes, source: str | Path) -> Input:
    """Return the name of a file and the SHA-256 of its content, and register it as an input.

    Parameters
    ----------
    data : bytes
        Content of the file.
    source : str or Path
        Name of the file.
    """
    record_digest(source, data)
    return Input(str(source), hashlib.sha256(data).hexdigest())


def is_archive(data: bytes) -> bool:
    """Return True if the first bytes of a file are those of a zip file."""
    return data.startswith(_ZIP)


def members(data: bytes, source: str) -> Iterator[tuple[str, bytes]]:
    """Yield names (`archive.zip/directory/file`) and contents of the files in a zip file and in
    nested zip files.

    The checksums of the archive are compared. Sizes are counted during uncompression, because the
    sizes stated in an archive may be wrong.

    Parameters
    ----------
    data : bytes
        Content of the archive.
    source : str
        Name of the archive.

    Raises
    ------
    RecordError
        The archive is corrupt or encrypted, or its total uncompressed size exceeds 256 MiB.
    """
    return _members(data, source, [LARGEST], 1)


def _members(
    data: bytes, source: str, budget: list[int], depth: int
) -> Iterator[tuple[str, bytes]]:
    """Yield the files of an archive; `budget` has the remaining number of bytes, and `depth` is the
    nesting level.

    Parameters
    ----------
    data : bytes
        Content of the archive.
    source : str
        Name of the archive, with which the names of its files begin.
    budget : list of int
        Remaining number of uncompressed bytes, in a list so that all nested archives share it.
    depth : int
        Nesting level of the archive, from 1.
    """
    import zipfile  # imported late: needed only for archives

    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            files = []
            for info in archive.infolist():
                # Skip hidden files and directories that operating systems add to archives.
                is_hidden = any(
                    part.startswith((".", "__MACOSX")) for part in info.filename.split("/")
                )
                if not (info.is_dir() or is_hidden):
                    files.append(info)
            if len(files) > _MOST_MEMBERS:
                raise RecordError(
                    f"{source}: the archive must contain at most {_MOST_MEMBERS} files, got "
                    f"{len(files)}; extract the files of the ground motion first"
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
            f"{source}: the archive is corrupt or cannot be read: {one_line(str(error))}"
        ) from error
    except Exception as error:  # zlib and lzma raise separate exception types.
        raise RecordError(f"{source}: the archive is corrupt: {one_line(str(error))}") from error


def _content(archive: ZipFile, info: ZipInfo, name: str, budget: list[int]) -> bytes:
    """Read a file of an archive and reduce the remaining number of bytes in `budget`.

    Parameters
    ----------
    archive : ZipFile
        Open archive.
    info : ZipInfo
        Entry of the file in the archive.
    name : str
        Name of the file, for messages.
    budget : list of int
        Remaining number of uncompressed bytes; changed by this function.
    """
    if info.flag_bits & 1:
        raise RecordError(f"{name}: the file is encrypted; unpack the archive first")
    content = bytearray()
    with archive.open(info) as file:
        while piece := file.read(_PIECE):
            content += piece
            budget[0] -= len(piece)
            if budget[0] < 0:
                raise RecordError(
                    f"{name}: the archive is larger than 256 MiB uncompressed; extract the ground "
                    "motion first"
                )
    return bytes(content)


@dataclass(frozen=True)
class Plugin:
    """Entry points of the two functions of a format, which are imported on first use."""

    name: str
    is_format: EntryPoint
    read_format: EntryPoint

    @property
    def is_own(self) -> bool:
        """True for a format of tdint, False for a format of ObsPy."""
        return self.name not in OBSPY_FORMATS


@dataclass(frozen=True)
class Contents:
    """Traces of a file.

    Attributes
    ----------
    format : str
        Name of the format.
    traces : list of obspy.Trace
        Numeric traces in the order of the file.
    notes : tuple of str
        Messages of the reader.
    compared : tuple of str
        Header values that were compared with the traces; empty if the file states none.
    """

    format: str
    traces: list[Any]
    notes: tuple[str, ...]
    compared: tuple[str, ...]


def is_record(source: str | Path, layout: TextLayout = AS_STATED) -> bool:
    """Return True if a file has a supported format, or if it cannot be read, so that reading it
    reports the error.

    A file with a supported format may still be corrupt.

    Parameters
    ----------
    source : str or Path
        File to read.
    layout : TextLayout
        Layout of text tables specified by the user. Default: none.
    """
    try:
        data = read_bytes(source)
        if is_archive(data):  # Spreadsheets are also zip files, so the suffix is checked.
            return str(source).lower().endswith(".zip")
        return _format_of(data, layout) is not None
    except RecordError:
        return True


def formats_of(source: str, layout: TextLayout = AS_STATED) -> list[tuple[str, str]]:
    """Return names and formats of the records in a file: the file itself, or the files in an
    archive. Raises the errors of `read_bytes`.

    Parameters
    ----------
    source : str
        File to read.
    layout : TextLayout
        Layout of text tables specified by the user. Default: none.
    """
    data = read_bytes(source)
    parts = [*members(data, source)] if is_archive(data) else [(source, data)]
    known = [(part, _format_of(content, layout)) for part, content in parts]
    return [(part, plugin.name) for part, plugin in known if plugin]


def read_parts(
    data: bytes, source: str, layout: TextLayout = AS_STATED
) -> list[tuple[str, Contents]]:
    """Read a file, or all records in a zip file; return pairs of name and contents.

    Parameters and errors are the same as for `read_contents`.

    Parameters
    ----------
    data : bytes
        Content of the file.
    source : str
        Name of the file, for messages and as the start of the names in an archive.
    layout : TextLayout
        Layout of text tables specified by the user. Default: none.
    """
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
                f"{source}: the archive contains no record of a supported format; it contains "
                f"{listed}"
            )
    return [(part, read_contents(content, part, layout)) for part, content in parts]


def read_contents(data: bytes, source: str, layout: TextLayout = AS_STATED) -> Contents:
    """Read all traces of a record.

    Parameters
    ----------
    data : bytes
        Content of the file.
    source : str
        Name of the file, for messages.
    layout : TextLayout
        Layout of text tables specified by the user. Default: none.

    Returns
    -------
    Contents
        At least one trace; text channels (the log of a recorder) are omitted.

    Raises
    ------
    RecordError
        The format is not supported, the file is corrupt or cut off, or it has no numeric channel.
    """
    plugin = _detect(data, source, layout)
    try:
        if plugin.name != TABLES:
            layout.check_format(plugin.name)
        # Check the headers before the reader is called, because some readers crash or do not
        # terminate for invalid bytes.
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
            f"{source}: the file is corrupt or truncated: {error}; download it again"
        ) from error
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from error
    except struct.error as error:
        raise RecordError(
            f"{source}: the file is truncated within its header ({plugin.name})"
        ) from error
    # The log of a recorder is a text channel, which is omitted.
    numeric = [trace for trace in traces if trace.data.dtype.kind in "iuf"]
    if not numeric:
        raise RecordError(
            f"{source}: the file ({plugin.name}) contains no samples of ground motion"
        )
    origin = "" if plugin.is_own else "ObsPy: "
    by_reader = [name for trace in numeric for name in trace.stats.get("tdint_compared", ())]
    notes = (*(origin + message for message in messages), *differences)
    return Contents(plugin.name, numeric, notes, tuple(dict.fromkeys([*compared, *by_reader])))


@cache
def plugins() -> tuple[Plugin, ...]:
    """Return the supported formats in the order in which they are tried.

    The most frequent ObsPy formats, which have strict checks, are tried before the formats of
    tdint.
    """
    from importlib.metadata import (
        EntryPoints,
        PackageNotFoundError,
        distribution,
    )  # imported late: needed only to read a file

    theirs = distribution("obspy").entry_points
    try:
        ours = distribution("tdint").entry_points
    except PackageNotFoundError:  # tdint runs from a source tree that is not installed.
        ours = EntryPoints()
    names = sorted(ours.select(group=_GROUP).names)
    return (*_named(theirs, _FIRST), *_named(ours, names), *_named(theirs, _REST))


def _named(entries: EntryPoints, names: Iterable[str]) -> Iterator[Plugin]:
    """Yield the formats with these names that have both functions."""
    by_name = {(entry.group, entry.name): entry for entry in entries}
    for name in names:
        is_format, read_format = (
            by_name.get((f"{_GROUP}.{name}", function)) for function in ("isFormat", "readFormat")
        )
        if is_format and read_format:
            yield Plugin(name, is_format, read_format)


def _detect(data: bytes, source: str, layout: TextLayout) -> Plugin:
    """Return the format of a file; raise RecordError with a hint if it is not supported.

    Parameters
    ----------
    data : bytes
        Content of the file.
    source : str
        Name of the file, for messages.
    layout : TextLayout
        Layout of text tables specified by the user.
    """
    plugin = _format_of(data, layout)
    if plugin is not None:
        return plugin

    # Compressed files and pickled objects are recognized by their first bytes.
    for start, archive in _ARCHIVES.items():
        if data.startswith(start):
            raise RecordError(f"{source}: the file is compressed ({archive}); uncompress it first")
    if data.startswith(b"\x80") and data.endswith(b"."):
        reason = (
            "probably a pickled object, which is not loaded because it may execute code; write the "
            "record as MiniSEED"
        )
        raise RecordError(f"{source}: unknown format, {reason}")

    # A text table without a sufficient header can be read if the user specifies its layout.
    from tdint.ground_motion.formats.text import table_in

    if table := table_in(data, layout):
        raise RecordError(f"{source}: unknown format: {table}")
    hint = (
        f", and no table of numbers found below its first {layout.skip_lines or 0} lines"
        if layout
        else ""
    )
    formats = ", ".join(plugin.name for plugin in plugins())
    raise RecordError(f"{source}: unknown format{hint}; supported formats: {formats}")


def _format_of(data: bytes, layout: TextLayout) -> Plugin | None:
    """Return the first format that recognizes a file; None if no format does.

    Parameters
    ----------
    data : bytes
        Content of the file.
    layout : TextLayout
        Layout of text tables specified by the user.
    """
    attempts: list[tuple[Plugin, dict[str, Any]]] = [(plugin, {}) for plugin in plugins()]
    if layout:
        attempts += [(plugin, {"layout": layout}) for plugin in plugins() if plugin.name == TABLES]
    with caught_messages():
        return next(
            (plugin for plugin, options in attempts if _accepts(plugin, data, **options)), None
        )


def _accepts(plugin: Plugin, data: bytes, **options: Any) -> bool:
    """Return True if a format recognizes a file.

    Parameters
    ----------
    plugin : Plugin
        Format to test.
    data : bytes
        Content of the file.
    """
    try:
        return bool(_load(plugin.is_format)(BytesIO(data), **options))
    except Exception:  # A check that fails on the bytes of another format has not recognized them.
        return False


def _read(plugin: Plugin, data: bytes, layout: TextLayout) -> tuple[list[Any], list[str]]:
    """Return the traces of a file and the messages of the reader.

    Parameters
    ----------
    plugin : Plugin
        Format of the file.
    data : bytes
        Content of the file.
    layout : TextLayout
        Layout of text tables specified by the user; used only for the format of text tables.
    """
    function = _load(plugin.read_format)
    options = {"layout": layout} if plugin.name == TABLES else {}
    try:
        with caught_messages() as messages:
            traces = list(function(BytesIO(data), **options))
    except RecordError:  # The message of a tdint reader already explains the error.
        raise
    except Exception as error:  # Readers raise any type of exception for corrupt bytes.
        reason = one_line(str(error)) or type(error).__name__
        raise RecordError(
            f"cannot be read as {plugin.name}, the file may be corrupt: {reason}"
        ) from error
    return traces, messages


def _load(entry: EntryPoint) -> Any:
    """Import the function of an entry point."""
    with quiet_import():
        return entry.load()
