"""Detect the format of a record file and read its traces, also of the files in a zip file.

Each error message starts with the name of the file. Zip files, as delivered by data centers, are
unpacked in memory and not on disk.

`obspy.read` is not used. It passes a file to every installed plugin. A plugin that unpickles files
exists, so a crafted `.mseed` file could execute code. `obspy.read` also downloads URLs, expands
wildcards and unpacks archives. This module calls only the ObsPy plugins in `OBSPY_FORMATS` and the
plugins of tdint, and passes them bytes in memory instead of file names.
"""

from __future__ import annotations

import codecs
import hashlib
import re
import struct
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache, partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tdint.errors import RecordError
from tdint.files import MOST_BYTES, read_whole, record_digest
from tdint.ground_motion.choice import AS_STATED, TextLayout
from tdint.ground_motion.header_checks import compare_with_statements, look_at
from tdint.ground_motion.messages import caught_messages, one_line, quiet_import
from tdint.ground_motion.miniseed_checks import Damaged
from tdint.ground_motion.missing import OtherContent
from tdint.ground_motion.record import Input
from tdint.units import parse_units

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint
    from zipfile import ZipFile, ZipInfo

MAX_FILE_BYTES = MOST_BYTES
"""Maximum size of a record file, bytes; reading needs about six times this memory."""

_ZIP_SIGNATURE = b"PK\x03\x04"  # first bytes of every zip file that is not empty
_MAX_ARCHIVE_FILES = 2000  # files in a zip file; suites of ground motions have tens to hundreds
_MAX_ARCHIVE_DEPTH = 2  # levels of zip files inside zip files; databases use one level
_MAX_NAME_LENGTH = 120  # characters of the name of an archived file that messages show
_CHUNK_BYTES = 2**20  # bytes uncompressed at a time, so that a huge file is rejected early

_ENTRY_POINT_GROUP = "obspy.plugin.waveform"  # registers the names of all waveform formats

_TRIED_FIRST = ("MSEED", "KNET")
_TRIED_LAST = (
    "SAC",
    "GSE2",
    "GSE1",
    "SLIST",
    "TSPAIR",
    "SH_ASC",
    "KINEMETRICS_EVT",
    "GCF",
    "REFTEK130",
)
OBSPY_FORMATS = _TRIED_FIRST + _TRIED_LAST
"""ObsPy formats that are supported: recorder and exchange formats of ground motion with a plugin
that reads from memory, does not execute code, does not open other files and detects truncated
files. Not supported: PICKLE executes code; CSS, NNSA_KB_CORE and Q open files named in a header; AH
and SACXY do not detect corrupt files; DMX, PDAS, SEISAN, WIN and Y require a file name; CYBERSHAKE
contains velocities; the remaining formats are not ground motion."""

_CORRUPT_FILE_WARNING = (
    r"(?i)^ERROR|not be read|skip(?!_lines)|corrupt|truncat|integrity check|broken|contiguous|"
    r"permuted|dropp"
)
"""Pattern of reader warnings that indicate missing or wrong samples. Other warnings (for example of
an unusual header) become notes. Warnings of the readers of tdint must not match this pattern."""

TEXT_TABLE = "TEXT"
"""Name of the format of plain text tables, the only format with a layout that the user may specify
(`TextLayout`)."""

_SPREADSHEET_MEMBERS = ("xl/workbook.xml", "xl/workbook.bin", "META-INF/manifest.xml")
"""Ends of the names of files that only spreadsheets (.xlsx, .xlsb, .ods) contain."""

_OLE_SIGNATURE = b"\xd0\xcf\x11\xe0"  # first bytes of a spreadsheet in the form .xls

_END_OF_TEXT = rb"\x1a[\x1a\s]*\Z"
"""Pattern of the mark ^Z at the end of text files of DOS programs."""

_HEADER_BYTES = 4096  # bytes at the start of a file that are searched for the name of its content

_TAR_MARK = slice(257, 262)  # position of the signature of a tar archive

_COMPRESSIONS = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}
"""Compression programs by the first bytes of their files."""

_LOADED_BY = {
    rb"MATLAB 5": ("MATLAB", "scipy.io.loadmat({!r})['NAME']"),
    rb"MATLAB 7|\x89HDF": ("HDF5", "h5py.File({!r})['NAME'][()]"),
    rb"\x93NUMPY": ("NumPy", "numpy.load({!r})"),
    rb"\{.*\}\s*\n\s*\{": ("JSON", "[json.loads(line)['NAME'] for line in open({!r})]"),
    rb"\s*[\[{]": ("JSON", "json.load(open({!r}))['NAME']"),
}
"""Types of files and Python expressions that load the samples, by a pattern of the first bytes;
NAME is the name of the samples."""


def read_bytes(source: str | Path) -> bytes:
    """Read the content of a file.

    The name is used only as a path: URLs are not downloaded, wildcards are not expanded, and
    compressed files are not uncompressed.

    Parameters
    ----------
    source : str or Path
        File name, or `-` for standard input.

    Raises
    ------
    RecordError
        The file is missing, not a regular file, not readable, empty, or larger than 256 MiB.
    """
    # The message about a missing file also explains common mistakes in its name.
    hint = ""
    if "://" in str(source):
        hint = "; addresses are not fetched, download the record first"
    elif any(sign in str(source) for sign in "*?["):
        hint = (
            "; wildcards are not expanded here, name one file (a shell expands them when they are "
            "not quoted)"
        )
    message_by_error: dict[type[Exception], str] = {
        FileNotFoundError: f"file not found{hint}",
        IsADirectoryError: "this is a directory; specify a record file",
        PermissionError: "no permission to read the file",
    }
    too_large = "the file is larger than 256 MiB; extract the event first"
    content = read_whole(source, RecordError, message_by_error, too_large, MAX_FILE_BYTES)
    if not content:
        raise RecordError(f"{source}: the file is empty")
    return content


def register_input(data: bytes, source: str | Path) -> Input:
    """Return the name of a file with the SHA-256 of its content.

    The file is also added to the inputs of the present command, which are listed with its results.
    """
    record_digest(source, data)
    return Input(str(source), hashlib.sha256(data).hexdigest())


def is_zip(data: bytes) -> bool:
    """Return True if the content of a file starts with the signature of a zip file."""
    return data.startswith(_ZIP_SIGNATURE)


def archive_files(
    data: bytes, source: str, budget: list[int] | None = None, depth: int = 1
) -> Iterator[tuple[str, bytes]]:
    """Yield the names and contents of the files in a zip file and in zip files inside it.

    Names have the form `archive.zip/directory/file`. The checksum of each file is verified. The
    uncompressed bytes are counted while they are read, because the sizes stated in an archive may
    be wrong. Hidden and empty files are skipped. A zip file in the archive is replaced by its files
    down to `_MAX_ARCHIVE_DEPTH` levels. A zip file at a lower level is yielded as a file.

    Parameters
    ----------
    budget : list of int, optional
        Remaining number of uncompressed bytes, in a list so that all nested archives share it.
    depth : int
        Level of the archive, from 1.

    Raises
    ------
    RecordError
        The archive is corrupt or encrypted, contains more than 2000 files, or its total
        uncompressed size exceeds 256 MiB.
    """
    import zipfile  # imported late: needed only for archives

    budget = [MAX_FILE_BYTES] if budget is None else budget
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            files = [entry for entry in archive.infolist() if _is_visible_file(entry)]
            if len(files) > _MAX_ARCHIVE_FILES:
                raise RecordError(
                    f"{source}: the archive must contain at most {_MAX_ARCHIVE_FILES} files, got "
                    f"{len(files)}; extract the files of the ground motion first"
                )
            for entry in files:
                name = "/".join([source, *_parts(entry)])[: len(source) + _MAX_NAME_LENGTH]
                content = _read_archive_file(archive, entry, name, budget)
                if is_zip(content) and depth < _MAX_ARCHIVE_DEPTH:
                    yield from archive_files(content, name, budget, depth + 1)
                elif content:
                    yield name, content
    except RecordError:
        raise  # The message already explains the error.
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


def _is_visible_file(entry: ZipInfo) -> bool:
    """Return True if an entry of a zip file is a file, not a directory, and is not hidden.

    Operating systems add hidden entries to archives: names that start with a dot, and the directory
    `__MACOSX`.
    """
    return not entry.is_dir() and not any(
        part.startswith((".", "__MACOSX")) for part in _parts(entry)
    )


def _parts(entry: ZipInfo) -> list[str]:
    """Return the directories and the name of an entry. The parts `..` of a path are ignored,
    because no files are written."""
    return [part for part in entry.filename.split("/") if part not in ("", ".", "..")]


def _read_archive_file(archive: ZipFile, entry: ZipInfo, name: str, budget: list[int]) -> bytes:
    """Return the uncompressed content of a file in a zip file, and subtract its size from the
    number of bytes in `budget`. RecordError is raised if the file is encrypted, or is larger than
    the budget.
    """
    is_encrypted = entry.flag_bits & 1  # bit 0 of the flags in the zip specification
    if is_encrypted:
        raise RecordError(f"{name}: the file is encrypted; unpack the archive first")
    content = bytearray()
    with archive.open(entry) as file:
        while chunk := file.read(_CHUNK_BYTES):
            content += chunk
            budget[0] -= len(chunk)
            if budget[0] < 0:
                raise RecordError(
                    f"{name}: the archive is larger than 256 MiB uncompressed; extract the ground "
                    "motion first"
                )
    return bytes(content)


class Plugin(NamedTuple):
    """File format with the entry points of its two functions, which are imported on first use.

    Attributes
    ----------
    is_format : EntryPoint
        Function of a file that returns True if the file has this format.
    read_format : EntryPoint
        Function of a file that returns an ObsPy stream.
    """

    name: str
    is_format: EntryPoint
    read_format: EntryPoint


class _Recognized(NamedTuple):
    """File with a recognized format.

    Attributes
    ----------
    read : callable
        Function without arguments that returns the ObsPy stream of the file.
    is_of_one_quantity : bool
        The file may contain a velocity, a displacement or a spectrum of a motion whose acceleration
        is in another file.
    """

    format: str
    read: Callable[[], Any]
    is_of_one_quantity: bool


class Contents(NamedTuple):
    """Traces of a file.

    Attributes
    ----------
    traces : list of obspy.Trace
        Numeric traces in the order of the file.
    compared : tuple of str
        Header values that were compared with the traces; empty if the file states none.
    """

    format: str
    traces: list[Any]
    notes: tuple[str, ...]
    compared: tuple[str, ...]


def other_content(source: str | Path, layout: TextLayout = AS_STATED) -> str:
    """Return the type of a file that contains no ground motion; empty for a record, for a file with
    numbers in an unknown format, and for a file that cannot be read.

    The later attempt to read such a file reports its error, so that no data are lost.
    """
    try:
        return _other_content(read_bytes(source), str(source), layout)
    except RecordError:
        return ""


def _other_content(data: bytes, source: str, layout: TextLayout) -> str:
    """Return the type of a file with this content (`other_content`)."""
    # Imported here and below, because most commands read files with one motion only.
    from tdint.ground_motion.reading.other_files import has_data_suffix, has_few_numbers, other_type

    if is_zip(data) and source.lower().endswith(".zip"):
        return ""
    data = _with_usual_numbers(data)
    try:
        recognized = _require_format(data, source, layout)
        if not recognized.is_of_one_quantity:
            return ""
        # These files may be response spectra, which only their reader recognizes.
        if not (content := other_type(source, data)):
            _read(recognized)
    except OtherContent as error:
        is_data = has_data_suffix(source) and error.content != "spectrum"
        return "" if is_data else error.content
    except RecordError:
        content = other_type(source, data)
        if not (content or has_data_suffix(source)) and has_few_numbers(data):
            return "no numbers"
    return content


def repeated_quantities(
    names: Iterable[str], read: Callable[[str], bytes] = read_bytes
) -> dict[str, str]:
    """Return the names of the velocities and displacements of motions with an acceleration that is
    in another file, by the content of the files, with their quantity."""
    found = []
    for name in names:
        with suppress(Exception):  # Reading the file later reports its error.
            recognized = _by_header(read(name))
            if recognized and recognized.is_of_one_quantity:
                trace = _read(recognized)[0][0]
                key = (Path(name).parent, trace.id, str(trace.stats.starttime))
                found.append((key, name, parse_units(trace.stats.tdint_units).quantity))
    accelerations = {key for key, _, quantity in found if quantity == "acceleration"}
    return {
        name: quantity
        for key, name, quantity in found
        if quantity != "acceleration" and key in accelerations
    }


def record_formats(source: str, layout: TextLayout = AS_STATED) -> list[tuple[str, str]]:
    """Return the names and formats of the records in a file.

    Parameters
    ----------
    source : str
        Record file or zip file.

    Returns
    -------
    list of (str, str)
        Name and format of the file, or of each record in the zip file. Files without a supported
        format, and files that `read_all_contents` omits, are omitted.

    Raises
    ------
    RecordError
        The file cannot be read, or the archive is corrupt.
    """
    data = read_bytes(source)
    files = _records_in_archive(data, source, layout)[0] if is_zip(data) else [(source, data)]
    recognized_by_file = [
        (name, _recognize(_with_usual_numbers(content), layout)) for name, content in files
    ]
    return [(name, recognized.format) for name, recognized in recognized_by_file if recognized]


def read_all_contents(
    data: bytes, source: str, layout: TextLayout = AS_STATED
) -> list[tuple[str, Contents]]:
    """Read the traces of a record file, or of each record in a zip file.

    Parameters
    ----------
    source : str
        Name of the file. The names of archived files start with this name.

    Returns
    -------
    list of (str, Contents)
        Name and traces of each record. Archived files that are no records, or that repeat a motion
        in another quantity, are omitted, with a note.

    Raises
    ------
    RecordError
        The archive contains no record, or `read_contents` raises an error for a record.
    """
    records, notes = [(source, data)], tuple[str, ...]()
    if is_zip(data):
        records, unused = _records_in_archive(data, source, layout)
        if not records:
            names = [name.removeprefix(f"{source}/")[:60] for name in [*unused][:10]]
            raise RecordError(
                f"{source}: the archive contains no record of a supported format; it contains "
                f"{', '.join(names) or 'nothing'}"
            )
        if unused:
            from tdint.ground_motion.reading.other_files import unused_text

            text = unused_text(
                {name.removeprefix(f"{source}/"): why for name, why in unused.items()}
            )
            notes = (f"not used: {text}",)
    contents = [(name, read_contents(content, name, layout)) for name, content in records]
    name, first = contents[0]
    return [(name, first._replace(notes=(*notes, *first.notes))), *contents[1:]]


def _records_in_archive(
    data: bytes, source: str, layout: TextLayout
) -> tuple[list[tuple[str, bytes]], dict[str, str]]:
    """Return the names and contents of the records in a zip file, and the names of its other files
    with the reason why they are not used, by the rules for directories."""
    from tdint.ground_motion.reading.other_files import repeated_motions

    files = [*archive_files(data, source)]
    if any(name.endswith(_SPREADSHEET_MEMBERS) for name, _ in files):
        raise OtherContent(f"{source}: the file is a spreadsheet; save it as CSV", "spreadsheet")
    unused = {name: _other_content(content, name, layout) for name, content in files}
    names = [name for name, why in unused.items() if not why]
    unused |= repeated_motions(names) | repeated_quantities(names, dict(files).__getitem__)
    records = [(name, content) for name, content in files if not unused[name]]
    return records, {name: why for name, why in unused.items() if why}


def read_contents(data: bytes, source: str, layout: TextLayout = AS_STATED) -> Contents:
    """Detect the format of a record, read its traces, and check them against its header.

    Parameters
    ----------
    source : str
        Name of the file, for messages.

    Returns
    -------
    Contents
        At least one trace with numeric samples. Text channels, for example the log of a recorder,
        are omitted.

    Raises
    ------
    RecordError
        The format is not supported, the file is corrupt or cut off, it has no numeric channel, or
        the layout contradicts the file.
    """
    data = _with_usual_numbers(data)
    recognized = _require_format(data, source, layout)
    name = recognized.format
    try:
        if name != TEXT_TABLE:
            layout.check_format(name)
        # Check the headers before the reader is called, because some readers crash or do not
        # terminate for invalid bytes.
        stated_values = look_at(name, data)
        traces, messages = _read(recognized)
        # Some readers only warn about samples that they cannot read. The warning is an error here.
        if warning := next(filter(partial(re.search, _CORRUPT_FILE_WARNING), messages), None):
            raise Damaged(warning)
        # Small differences between the header and the samples are reported as warnings.
        with caught_messages() as differences:
            compared = compare_with_statements(name, stated_values, traces)
        # Text channels, for example the log of a recorder, contain no ground motion, and their
        # sampling interval has no meaning.
        numeric = [trace for trace in traces if trace.data.dtype.kind in "iuf"]
        for trace in numeric:
            layout.check_step(float(trace.stats.delta))
    except Damaged as error:
        raise RecordError(
            f"{source}: the file is corrupt or truncated: {error}; download it again"
        ) from error
    except RecordError as error:
        raise error.located(source) from error
    except struct.error as error:
        raise RecordError(f"{source}: the file is truncated within its header ({name})") from error
    if not numeric:
        raise RecordError(f"{source}: the file ({name}) contains no samples of ground motion")
    prefix = "ObsPy: " if name in OBSPY_FORMATS else ""
    notes = (*(prefix + message for message in messages), *differences)
    # The readers of tdint also compare header values, and list these in the traces.
    compared_by_reader = [
        quantity for trace in numeric for quantity in trace.stats.get("tdint_compared", ())
    ]
    all_compared = tuple(dict.fromkeys([*compared, *compared_by_reader]))  # without repetition
    return Contents(name, numeric, notes, all_compared)


def is_json(data: bytes) -> bool:
    """Return True if a file contains an object or a list of JSON, or objects in separate lines."""
    if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] not in (b"{", b"["):
        return False
    import json  # imported late: needed only for files that may be JSON

    try:
        json.loads(data.partition(b"\n{")[0] if data.startswith(b"{") else data)
    except (ValueError, RecursionError):
        return False
    return True


def _with_usual_numbers(data: bytes) -> bytes:
    """Return the content of a text file in UTF-8 with numbers in the usual form: decimal points,
    the minus sign of ASCII, no separators of thousands, and no end mark. Binary files contain zero
    bytes and are returned unchanged."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        data = data.decode("utf-16", "replace").encode()
    if b"\0" in data:
        return data
    if b"\x1a" in data[-_HEADER_BYTES:]:
        data = re.sub(_END_OF_TEXT, b"", data)
    if _MINUS in data:
        data = data.replace(_MINUS, b"-")
    if b"," not in data:
        return data
    data = _without_groups(data, rb"\.", b",")
    if b";" in data or b"\t" in data or b'"' in data:
        data = _without_groups(data, b",", rb"\.")
    if b'"' in data:
        data = re.sub(_QUOTED, rb"\1.\2", data)
    return _with_decimal_points(data)


_MINUS = "\N{MINUS SIGN}".encode()
_QUOTED = rb'"\s*([-+]?\d+),(\d+(?:[EeDd][-+]?\d+)?)\s*"'
"""Pattern of a number between quotation marks with a decimal comma."""


def _without_groups(data: bytes, mark: bytes, point: bytes) -> bytes:
    """Return a text file without the marks that separate thousands: `1.067,72` becomes `1067,72`,
    and `1,067.72` becomes `1067.72`.

    A mark separates thousands if each number with the mark may have such groups, and other numbers
    have the decimal point only. Both marks are patterns.
    """
    if not re.search(mark, data) or re.search(rb"(?<!\d)0?" + mark + rb"\d", data):
        return data
    group = rb"[-+]?[1-9]\d{0,2}(?:" + mark + rb"\d{3})+"
    cells = re.findall(rb'"\s*([-+\d.,]+)\s*"', data) or re.split(rb"[;\s]+", data)
    marked = {cell for cell in cells if re.fullmatch(rb"[-+]?\d[\d.,]*" + mark + rb".*", cell)}
    forms = {bool(re.fullmatch(group + rb"(?:" + point + rb"\d*)?", cell)) for cell in marked}
    if forms != {True} or not re.search(rb"(?<![\d.,])\d+" + point + rb"\d", data):
        return data
    return re.sub(rb"(?<![\d.,])" + group, lambda cell: re.sub(mark, b"", cell[0]), data)


_COMMA_NUMBER = rb"[-+]?\d+(?:,\d+)?(?:[EeDd][-+]?\d+)?"
_DECIMAL_COMMA = rb"-0,|,0\d|,\d{2,}[EeDd]"
"""Pattern of a comma that separates no integers: the number before it is -0, or the number after it
starts with a zero or has several digits before its exponent."""

_NUMBER_ROW = rb"[-+,;\dEeDd\s]*\d[-+,;\dEeDd\s]*"
_MIN_COMMA_ROWS = 5  # rows of numbers; fewer are no evidence
_MIN_SIGNED_ROWS = 20  # rows; second integers of a motion would have a sign in one of these rows
_MIN_DECIMALS = 8  # different numbers after a comma; fewer may be flags


def _with_decimal_points(data: bytes) -> bytes:
    """Return the content of a text file with decimal points instead of decimal commas.

    Without this, a comma would separate the integer from the decimals of a sample. A file has
    decimal commas if its rows of numbers contain no point and at most one comma in each number,
    without a sign after the comma, and if most rows have a number that cannot be two integers. In a
    longer table a single such number is sufficient if numbers before a comma are negative, and if
    the numbers after the commas differ, but not in their length or some start with a zero.
    """
    lines = data[:_HEADER_BYTES].splitlines()
    if len(data) > _HEADER_BYTES:  # the last line may be cut off
        lines = lines[:-1] or data.splitlines()
    rows = [line for line in lines if re.fullmatch(_NUMBER_ROW, line)]
    words = [word for row in rows for word in re.split(rb"[;\s]+", row.strip())]
    if len(rows) < _MIN_COMMA_ROWS or not all(re.fullmatch(_COMMA_NUMBER, word) for word in words):
        return data
    evident = sum(bool(re.search(_DECIMAL_COMMA, row)) for row in rows)
    decimals = {word.partition(b",")[2] for word in words if b"," in word}
    is_signed = len(rows) >= _MIN_SIGNED_ROWS and any(re.match(rb"-\d+,", word) for word in words)
    is_decimal = len(decimals) >= _MIN_DECIMALS and (
        len(set(map(len, decimals))) == 1 or any(text.startswith(b"0") for text in decimals)
    )
    if 2 * evident < len(rows) and not (evident and is_signed and is_decimal):
        return data
    return re.sub(rb"(?<=\d),(?=\d)", b".", data)


@cache
def plugins() -> tuple[Plugin, ...]:
    """Return the supported formats in the order of the attempts to recognize a file.

    MiniSEED and K-NET, the most frequent formats of ObsPy, are tried first, because their checks
    are strict. The formats of tdint and the remaining formats of ObsPy follow.
    """
    with quiet_import():  # imported late: needed only to read a file
        from importlib.metadata import EntryPoints, PackageNotFoundError, distribution

    obspy_entry_points = distribution("obspy").entry_points
    try:
        tdint_entry_points = distribution("tdint").entry_points
    except PackageNotFoundError:  # tdint runs from a source tree that is not installed.
        tdint_entry_points = EntryPoints()
    names = sorted(tdint_entry_points.select(group=_ENTRY_POINT_GROUP).names)
    entries = {
        (entry.group, entry.name): entry for entry in (*tdint_entry_points, *obspy_entry_points)
    }
    found = []
    for name in (*_TRIED_FIRST, *names, *_TRIED_LAST):
        # ObsPy uses one group of entry points for each format.
        group = f"{_ENTRY_POINT_GROUP}.{name}"
        is_format, read_format = (entries.get((group, use)) for use in ("isFormat", "readFormat"))
        if is_format and read_format:
            found.append(Plugin(name, is_format, read_format))
    return tuple(found)


def _require_format(data: bytes, source: str, layout: TextLayout) -> _Recognized:
    """Return the format of a file. If it is not supported, the RecordError states the probable
    reason, such as a compressed file or a text table without a header, and the remedy.
    """
    from tdint.ground_motion.reading.other_files import metadata_names

    recognized = _recognize(data, layout)
    is_text = recognized is None or recognized.format == TEXT_TABLE
    if is_text and (names := metadata_names(data)):
        raise OtherContent(
            f"{source}: the file is a table of metadata ({', '.join(names[:5])}), not a ground "
            "motion; specify the files of the ground motions",
            "table of metadata",
        )
    if recognized is not None:
        return recognized
    if data[_TAR_MARK] == b"ustar":
        raise RecordError(f"{source}: the file is a tar archive; extract its files first")
    for first_bytes, program in _COMPRESSIONS.items():
        if data.startswith(first_bytes):
            raise RecordError(f"{source}: the file is compressed ({program}); uncompress it first")
    if data.startswith(_OLE_SIGNATURE):
        raise OtherContent(f"{source}: the file is a spreadsheet; save it as CSV", "spreadsheet")
    for pattern, (content, load) in _LOADED_BY.items():
        if re.match(pattern, data) and (content != "JSON" or is_json(data)):
            raise RecordError(
                f"{source}: the file is {content}, which is not read; write a text file, in "
                f"Python: a = {load.format(Path(source).name)}; "
                "numpy.savetxt('record.txt', a, header='dt = 0.01 s, units = g')"
            )
    # Pickle data start with the PROTO opcode 0x80 and end with the STOP opcode, a dot.
    if data.startswith(b"\x80") and data.endswith(b"."):
        reason = (
            "probably a pickled object, which is not loaded because it may execute code; write the "
            "record as MiniSEED"
        )
        raise RecordError(f"{source}: unknown format, {reason}")
    hint = (
        f", and no table of numbers found below its first {layout.skip_lines or 0} lines"
        if layout
        else ""
    )
    formats = ", ".join(plugin.name for plugin in plugins())
    raise RecordError(f"{source}: unknown format{hint}; supported formats: {formats}")


def _recognize(data: bytes, layout: TextLayout) -> _Recognized | None:
    """Return the format of a file; None if it is unknown.

    Text tables, which have no mark of a format, are tried after all formats.
    """
    if recognized := _by_header(data):
        return recognized
    from tdint.ground_motion.formats.text import find_table  # needed only for tables

    table = None if is_json(data) else find_table(data, layout)
    return _Recognized(TEXT_TABLE, table.read, is_of_one_quantity=True) if table else None


def _by_header(data: bytes) -> _Recognized | None:
    """Return the format of a file that has the header of a format; None for tables."""
    with caught_messages():  # Warnings of formats that do not match are ignored.
        for plugin in plugins():
            if plugin.name != TEXT_TABLE and _recognizes(plugin, data):
                module = sys.modules[plugin.read_format.load().__module__]
                if not getattr(module, "has_columns", lambda _: False)(data):
                    read = partial(_call, plugin.read_format, data)
                    return _Recognized(plugin.name, read, hasattr(module, "IS_OF_ONE_QUANTITY"))
    return None


def _recognizes(plugin: Plugin, data: bytes) -> bool:
    """Return True if the check of a format accepts a file."""
    try:
        return bool(_call(plugin.is_format, data))
    except Exception:  # A check that fails on the bytes of another format has not recognized them.
        return False


def _read(recognized: _Recognized) -> tuple[list[Any], list[str]]:
    """Read a file by the reader of its format; return the traces and the messages of the reader.
    Any exception of the reader becomes a RecordError.
    """
    try:
        with caught_messages() as messages:
            traces = list(recognized.read())
    except RecordError:  # The message of a tdint reader already explains the error.
        raise
    except Exception as error:  # Readers raise any type of exception for corrupt bytes.
        reason = one_line(str(error)) or type(error).__name__
        raise RecordError(
            f"cannot be read as {recognized.format}, the file may be corrupt: {reason}"
        ) from error
    return traces, messages


def _call(entry: EntryPoint, data: bytes) -> Any:
    """Import the function of an entry point without warnings of ObsPy, and call it with a file."""
    with quiet_import():
        function = entry.load()
    return function(BytesIO(data))
