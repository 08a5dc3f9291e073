"""Find a file's format among the safe ones and let its ObsPy plugin read it from memory.

ObsPy offers any file to every plugin it finds, one of which unpickles it: a crafted `.mseed` would run code. It also
fetches URLs, expands wildcards and unpacks archives. None of this happens here: the plugins are taken by name from two
distributions, ObsPy's by the list below and tdint's own, and they see bytes in memory, never a file name.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, PackageNotFoundError, distribution
from io import BytesIO
from typing import Any

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import WIDE
from tdint.ground_motion.header_checks.check import compare_with_statements, look_at
from tdint.ground_motion.header_checks.statement import Damaged
from tdint.ground_motion.messages import caught_messages, one_line, quiet_import
from tdint.ground_motion.text_layout import AS_STATED, TextLayout

_GROUP = "obspy.plugin.waveform"

_FIRST = ("MSEED", "KNET")
_REST = ("SAC", "GSE2", "GSE1", "SLIST", "TSPAIR", "SH_ASC", "KINEMETRICS_EVT", "GCF", "REFTEK130")
OBSPY_FORMATS = _FIRST + _REST
"""ObsPy's formats that are read: recorders' and exchange formats of ground motion whose plugin reads from memory, runs
nothing and opens no other file, and in which a cut-off file can be told. PICKLE runs code; CSS, NNSA_KB_CORE and Q open
the files that a header names; AH and SACXY cannot tell a damaged file; DMX, PDAS, SEISAN, WIN and Y read from a named
file only; CYBERSHAKE holds velocities; the others are not ground motion."""

_DAMAGE = re.compile(
    r"^ERROR|not be read|skip|corrupt|truncat|integrity check|broken|contiguous|permuted|[Dd]ropp", re.IGNORECASE
)
"""Warnings of ObsPy's readers after which samples are missing or wrong. Others (an unusual header) become notes."""

TABLES = "TEXT"
"""The format of which a user may say what the file does not."""

_HEAD = 8192
_ARCHIVES = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}


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

    `compared` names what the file states of itself and was compared with them; empty if it states nothing.
    """

    format: str
    traces: list[Any]
    notes: tuple[str, ...]
    compared: tuple[str, ...]


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
        looked_at = look_at(plugin.name, data)
        traces, messages = _read(plugin, data, layout)
        if damage := next(filter(_DAMAGE.search, messages), None):
            raise Damaged(damage)
        with caught_messages() as differences:
            compared = compare_with_statements(plugin.name, looked_at, traces)
        for trace in traces:
            layout.check_step(float(trace.stats.delta))
    except Damaged as error:
        raise RecordError(f"{source}: the file is damaged or cut off: {error}; fetch it again") from error
    except RecordError as error:
        raise RecordError(f"{source}: {error}") from error
    except struct.error as error:
        raise RecordError(f"{source}: the file is cut off within its header ({plugin.name})") from error
    numeric = [trace for trace in traces if trace.data.dtype.kind in "iuf"]
    if not numeric:
        raise RecordError(f"{source}: the file ({plugin.name}) holds no samples of ground motion")
    speaker = "" if plugin.is_own else "ObsPy: "
    own = [name for trace in numeric for name in trace.stats.get("tdint_compared", ())]
    notes = (*(speaker + message for message in messages), *differences)
    return Contents(plugin.name, numeric, notes, tuple(dict.fromkeys([*compared, *own])))


def has_known_format(data: bytes, layout: TextLayout = AS_STATED) -> bool:
    """Whether the contents of a file are those of a format that is read."""
    return _format_of(data, layout) is not None


@cache
def plugins() -> tuple[Plugin, ...]:
    """The formats that may be read, in the order in which a file is offered to them; asked for once.

    ObsPy's most frequent formats, whose checks are strict, come before those of tdint.
    """
    theirs = distribution("obspy").entry_points
    try:
        ours = distribution("tdint").entry_points
    except PackageNotFoundError:  # Run from a source tree that is not installed.
        ours = EntryPoints()
    own = sorted(ours.select(group=_GROUP).names)
    return (*_named(theirs, _FIRST), *_named(ours, own), *_named(theirs, _REST))


def _named(entries: EntryPoints, names: Iterable[str]) -> Iterator[Plugin]:
    found = {(entry.group, entry.name): entry for entry in entries}
    for name in names:
        is_format, read_format = (found.get((f"{_GROUP}.{name}", one)) for one in ("isFormat", "readFormat"))
        if is_format and read_format:
            yield Plugin(name, is_format, read_format)


def _detect(data: bytes, source: str, layout: TextLayout) -> Plugin:
    plugin = _format_of(data, layout)
    if plugin is None:
        known = ", ".join(plugin.name for plugin in plugins())
        reason = _foreign(data) or f"unknown format{_hint(data, layout)}; those that are read: {known}"
        raise RecordError(f"{source}: {reason}")
    return plugin


def _format_of(data: bytes, layout: TextLayout) -> Plugin | None:
    with caught_messages():
        found = next((plugin for plugin in plugins() if _accepts(plugin, data)), None)
    if found is None and layout and _first_row(data, layout):
        return next(plugin for plugin in plugins() if plugin.name == TABLES)
    return found


def _first_row(data: bytes, layout: TextLayout) -> int | None:
    from tdint.ground_motion.formats.text import first_row

    return None if b"\0" in data[:_HEAD] and not data.startswith(WIDE) else first_row(BytesIO(data), layout)


def _hint(data: bytes, layout: TextLayout) -> str:
    """What may help where a table stands in a text that tells nothing of it."""
    if layout:
        return f", and no table of numbers stands below its first {layout.skip_lines or 0} lines"
    line = _first_row(data, layout)
    if line is None:
        return ""
    above = f", past the lines above by `skip_lines={line - 1}`," if line > 1 else ""
    return f" (a table of numbers begins in line {line}: tell by `step` and `column`{above} what it is)"


def _accepts(plugin: Plugin, data: bytes) -> bool:
    try:
        return bool(_load(plugin.is_format)(BytesIO(data)))
    except Exception:  # A check that stumbles over foreign bytes has not recognized them.
        return False


def _foreign(data: bytes) -> str | None:
    """What a file that is no record looks like, where a better message than its unknown format can be given."""
    for start, archive in _ARCHIVES.items():
        if data.startswith(start):
            return f"the file is compressed ({archive}); uncompress it first"
    if data.startswith(b"\x80") and data.endswith(b"."):
        return "unknown format, by its look a pickled object: loading one can run code; write it as MiniSEED"
    return None


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
        raise RecordError(f"cannot be read as {plugin.name}, the file may be damaged: {reason}") from error
    return traces, messages


def _load(entry: EntryPoint) -> Any:
    with quiet_import():
        return entry.load()
