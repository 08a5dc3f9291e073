"""Tell a cut-off or corrupt file from a sound one, where the reader of its format does not.

ObsPy's readers of some formats drop what is missing without a word; those of others run C code or loops that a corrupt
file sends beyond the end of their memory or into an endless search. Such files are refused before they are read.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Iterator
from typing import Any, Literal

_Order = Literal["big", "little"]


def damage_of_bytes(format_name: str, data: bytes) -> str | None:
    """Say what is wrong with a file, judged by its bytes alone; None if nothing is, or it cannot be told.

    Parameters
    ----------
    format_name : str
        ObsPy's name of the format.
    data : bytes
        The file.
    """
    check = _CHECKS.get(format_name)
    return check(data) if check else None


def missing_samples(format_name: str, data: bytes, traces: list[Any]) -> str | None:
    """Say where the header announces more samples than were read; None if it does not.

    Parameters
    ----------
    format_name : str
        ObsPy's name of the format.
    data : bytes
        The file.
    traces : list of obspy.Trace
        What ObsPy read from it.
    """
    if format_name == "KNET":
        if any("knet" not in trace.stats for trace in traces):
            return "its header has no end"
        lengths = [trace.stats.knet.duration * trace.stats.sampling_rate for trace in traces]
        if not all(map(math.isfinite, lengths)):
            return "its header gives no length that a record can have"
        announced = list(map(round, lengths))
    elif format_name in _ANNOUNCED:
        announced = [int(count) for count in _ANNOUNCED[format_name].findall(data)]
    else:
        return None
    if len(announced) > len(traces):
        return f"its header announces {len(announced)} channels, there are {len(traces)}"
    for expected, trace in zip(announced, traces, strict=False):
        if len(trace.data) < expected:
            return f"its header announces {expected} samples, there are {len(trace.data)}"
    return None


_ANNOUNCED = {
    "SLIST": re.compile(rb"^TIMESERIES[^,\n]*,\s*(\d+) samples", re.MULTILINE),
    "TSPAIR": re.compile(rb"^TIMESERIES[^,\n]*,\s*(\d+) samples", re.MULTILINE),
    "SH_ASC": re.compile(rb"^LENGTH:\s*(\d+)", re.MULTILINE),
}
"""Where a text format's header says how many samples follow."""


# MiniSEED and SEED (SEED manual 2.4, chapters 3 and 8): libmseed drops a last record that is cut off in the middle.

_FIXED_HEADER = 48
_SHORTEST_RECORD = 128
_LENGTH_EXPONENTS = range(7, 21)


def _mseed(data: bytes) -> str | None:
    """Walk over the records to the end of the file."""
    offset, control_length = 0, None
    while offset < len(data):
        header = data[offset : offset + _FIXED_HEADER]
        if not header.strip(b" \0"):
            offset += _SHORTEST_RECORD
            continue
        if len(header) < _FIXED_HEADER:
            return f"its last {len(header)} bytes are no whole record"
        if header[6] in b"VAST":
            control_length = control_length or _control_length(header)
            length = control_length
        else:
            length = _data_length(data, offset)
        if length is None:  # Not a header that can be followed: libmseed is to say what it is.
            return None
        if offset + length > len(data):
            return f"its last record has {len(data) - offset} of {length} bytes"
        offset += length
    return None


def _control_length(header: bytes) -> int | None:
    """Length of a full SEED volume's records, bytes, from its first blockette (type 5, 8 or 10)."""
    if header[8:11] not in (b"005", b"008", b"010") or not header[19:21].isdigit():
        return None
    exponent = int(header[19:21])
    return 2**exponent if exponent in _LENGTH_EXPONENTS else None


def _data_length(data: bytes, offset: int) -> int | None:
    """Length of a data record, bytes, from its blockette 1000; None without one."""
    if data[offset + 6] not in b"DRQM":
        return None
    # Nothing before blockette 1000 tells the byte order: the right one makes a year of our time.
    year = int.from_bytes(data[offset + 20 : offset + 22], "big")
    order: _Order = "big" if 1900 <= year <= 2100 else "little"

    def number(place: int) -> int:
        return int.from_bytes(data[offset + place : offset + place + 2], order)

    blockette = number(46)
    while blockette >= _FIXED_HEADER and offset + blockette + 8 <= len(data):
        following = number(blockette + 2)
        if number(blockette) == 1000:
            exponent = data[offset + blockette + 6]
            return 2**exponent if exponent in _LENGTH_EXPONENTS else None
        if following <= blockette:
            return None
        blockette = following
    return None


# SAC (SAC manual, data format): ObsPy turns longitudes into -180..180 degrees one turn at a time, for ever from 1e30.

_SAC_LONGITUDES = (32, 36)
_SAC_VERSION = 76
_SAC_LARGEST = 12345.0
"""A longitude that is not known is written as -12345."""


def _sac(data: bytes) -> str | None:
    order = "<" if 0 <= struct.unpack_from("<i", data, 4 * _SAC_VERSION)[0] <= 20 else ">"
    for word in _SAC_LONGITUDES:
        (longitude,) = struct.unpack_from(f"{order}f", data, 4 * word)
        if not abs(longitude) <= _SAC_LARGEST:
            return f"its header gives a longitude of {longitude:g}"
    return None


# GSE1 and GSE2 (GSETT documentation, annex D; compression CM6): libgse2 trusts the number of samples and copies lines
# of any length into 83 bytes.

_GSE_LINE = 81
_GSE_FIELDS = {"1": (slice(27, 35), slice(74, 78), b"CMP6"), "2": (slice(48, 56), slice(44, 48), b"CM6")}
"""Places of the number of samples and of the type of data in the header line, and the type that is compressed."""

_CM6 = re.compile(rb"[-+0-9A-Za-z]*")
_CM6_LAST = re.compile(rb"[-+0-9A-T]")
"""A sample's last character; those before it have the bit that tells that more follow."""


def _gse(data: bytes) -> str | None:
    for version, lines in _gse_sections(data):
        npts, datatype, compressed = _GSE_FIELDS[version]
        if lines[0][datatype].strip() != compressed:
            continue
        count = lines[0][npts].strip()
        problem = _cm6(lines[1:], f"DAT{version}".encode(), f"CHK{version}".encode(), count)
        if problem:
            return problem
    return None


def _gse_sections(data: bytes) -> Iterator[tuple[str, list[bytes]]]:
    """The sections of a file, each from its WID line on, without the station's line, which is read by itself."""
    for section in re.split(rb"^(?=WID[12])", data, flags=re.MULTILINE):
        if section[:3] != b"WID":
            continue
        lines = section.split(b"\n")
        own = 2 if section[:4] == b"WID1" or any(line.startswith(b"STA2") for line in lines[1:2]) else 1
        yield section[3:4].decode(), [lines[0], *lines[own:]]


def _cm6(lines: list[bytes], begin: bytes, end: bytes, count: bytes) -> str | None:
    """Check that a section's compressed samples are whole and as many as its header announces."""
    # Compressed samples, too, may begin with these letters, but hold no blank.
    ends = [place for place, line in enumerate(lines) if line.startswith(end + b" ")]
    begins = [place for place, line in enumerate(lines) if line.startswith(begin)]
    if not (begins and ends and begins[0] < ends[0] and count.isdigit()):
        return f"a section without {begin.decode()}, {end.decode()} or its number of samples"
    if any(len(line) > _GSE_LINE for line in lines[: ends[0]]):
        return f"a line of data is longer than {_GSE_LINE} characters"
    samples = b"".join(line.strip() for line in lines[begins[0] + 1 : ends[0]])
    if not _CM6.fullmatch(samples):
        return "a character among the data that is none of the compression's"
    got = len(_CM6_LAST.findall(samples))
    return None if got == int(count) else f"its header announces {int(count)} samples, there are {got}"


_CHECKS: dict[str, Callable[[bytes], str | None]] = {"MSEED": _mseed, "SAC": _sac, "GSE1": _gse, "GSE2": _gse}
