"""Comparison of MiniSEED and SEED headers with the bytes of their records (SEED manual 2.4,
chapters 3 and 8).

libmseed does not check headers. If a header states more samples than the record can contain,
libmseed reads memory after the record. If the position of the data or the type of a record is
wrong, libmseed drops the record. This module finds both errors before libmseed reads the file.
After reading, the number of samples of each channel must equal the sum of the counts in the
headers.

Steim compression (appendix B) uses frames of 64 bytes with differences of 4 to 32 bits. The first
word of a frame has two bits for each of the 15 other words, which state the number of differences
packed into that word. The first frame contains the first and the last sample in the two words after
its first word.
"""

from __future__ import annotations

import re
import struct
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite
from typing import Any

import numpy as np

from tdint.errors import RecordError

# ---- Values stated in a file, and their comparison with the samples that were read

SAMPLES = "number of samples"
STEP = "sampling interval"
LENGTH = "length"
PEAK = "peak"
CHECKSUM = "checksum"

SHORTEST_STEP, LONGEST_STEP = 1e-6, 10.0
"""Minimum and maximum sampling interval of recorders of ground motion, s."""

_NEAR = 0.01
"""Fraction of a stated peak; a smaller difference is a warning instead of an error, because it may
result from rounding or from a different offset."""


class Damaged(RecordError):
    """File that contradicts itself; the message states the contradiction."""


@dataclass(frozen=True)
class Statement:
    """Number stated in a file and the same number computed from the data that were read.

    Attributes
    ----------
    what : str
        Name of the quantity: `SAMPLES`, `PEAK`, ...
    stated, found : float
        Stated and computed number, in the same unit.
    rounding : float
        Difference that is explained by the rounding of the stated number.
    unit : str
        Unit, for messages.
    where : str
        Part of the file, for messages; empty for the entire file.
    measured : bool
        True if the number is computed from the values of samples; a difference up to 1 % is then a
        warning instead of an error.
    """

    what: str
    stated: float
    found: float
    rounding: float = 0.0
    unit: str = ""
    where: str = ""
    measured: bool = False

    @property
    def difference(self) -> float:
        """Difference in excess of the rounding; nan if a number is nan."""
        return abs(self.stated - self.found) - self.rounding

    def __str__(self) -> str:
        prefix = f"{self.where}: " if self.where else ""
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{prefix}the file states a {self.what} of {self.stated:.9g}{unit}, but the data that "
            f"were read have {self.found:.9g}{unit}"
        )


def compare(statements: Iterable[Statement]) -> tuple[str, ...]:
    """Compare the numbers stated in a file with the data that were read.

    Small differences of measured values are reported as warnings.

    Returns
    -------
    tuple of str
        Names of the compared quantities, without repetition; empty if the file states none.

    Raises
    ------
    RecordError
        Two numbers differ; the message states both.
    """
    compared: dict[str, None] = {}  # used as an ordered set
    for statement in statements:
        if not statement.difference <= 0.0:
            near = _NEAR * max(abs(statement.stated), abs(statement.found))
            if not (statement.measured and isfinite(near) and statement.difference <= near):
                raise RecordError(f"the file is corrupt, or its header is wrong: {statement}")
            warnings.warn(str(statement), stacklevel=2)
        compared[statement.what] = None
    return tuple(compared)


def check_step(dt: float) -> None:
    """Raise Damaged if a sampling interval, s, is outside the range of recorders."""
    if not SHORTEST_STEP <= dt <= LONGEST_STEP:
        raise Damaged(
            f"its header states a sampling interval of {dt:g} s; recorders have {SHORTEST_STEP:g} "
            f"to {LONGEST_STEP:g} s"
        )


def last_place(number: str) -> float:
    """Return the value of the last digit of a number in text form."""
    mantissa, _, exponent = number.upper().partition("E")
    return float(f"1e{int(exponent or 0) - len(mantissa.partition('.')[2])}")


# ---- Mseed

_WORDS = 16
_DIFFERENCES: dict[int, dict[tuple[int, int | None], int]] = {
    1: {(1, None): 4, (2, None): 2, (3, None): 1},
    2: {(1, None): 4, (2, 1): 1, (2, 2): 2, (2, 3): 3, (3, 0): 5, (3, 1): 6, (3, 2): 7},
}
"""Number of differences in a word for each version, by the code of the word and, if defined, the
code in its first two bits."""


def most_samples(frames: bytes, version: int, order: str = ">") -> int:
    """Return the number of differences in complete frames, according to the codes of their words.

    Parameters
    ----------
    frames : bytes
        Frames; an incomplete last frame is ignored.
    version : int
        Version of the compression, 1 or 2.
    order : str
        Byte order, > or <. Default >.
    """
    # Number of words in complete frames.
    word_count = len(frames) // (4 * _WORDS) * _WORDS
    words = np.frombuffer(frames, f"{order}u4", word_count).astype(np.uint32)
    # The codes of all words are in the first word of a frame. This word, the first sample and the
    # last sample have no code.
    codes = ((words[::_WORDS, None] >> np.arange(30, -2, -2, dtype=np.uint32)) & 3).astype(np.int64)
    codes[:, 0] = 0
    codes = codes.reshape(-1)
    codes[1:3] = 0
    inner = (words >> np.uint32(30)).astype(np.int64)
    return sum(
        count * int(np.sum((codes == code) & (inner == second if second is not None else True)))
        for (code, second), count in _DIFFERENCES[version].items()
    )


_FIXED_HEADER = 48
_SHORTEST_RECORD = 128
_LENGTH_EXPONENTS = range(7, 21)
_YEARS = range(1900, 2101)
_FILLED = re.compile(rb"[^ \0]")
_TEXT, _STEIM = 0, {10: 1, 11: 2, 19: 1, 20: 2}
_WIDTHS = {1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 12: 3, 13: 2, 14: 2, 16: 2, 30: 2, 32: 2, 33: 2}
"""Bytes per sample by the code of the encoding (SEED manual, blockette 1000), for encodings with a
fixed width."""

_HEADER = "6scc5s2s3s2sHHBBBxHHhhBBBBiHH"
_ACTUAL_RATE, _DATA_ONLY = 100, 1000
_MISSPELT = 3
"""Maximum number of different characters of two names that may be one corrupt name."""

_SLIP, _JOINED = 0.1 * (1.0 - 1e-6), 0.5
"""Fractions of a sampling interval: minimum break between two records that is reported, and maximum
break at which libmseed joins the records."""

_TICK = 1.01e-4
"""s; minimum break that is detectable, because header times are rounded to 0.1 ms."""

_RATE_SLACK = 0.01
"""Maximum relative correction of the nominal sampling rate by blockette 100."""


@dataclass(frozen=True)
class DataRecord:
    """Header of a data record.

    Attributes
    ----------
    number : int
        Position in the file, counted from 1.
    id : str
        Network, station, location and channel joined by dots.
    codes : bytes
        Station, location, channel and network as in the header, padded to fixed widths.
    samples, encoding, length, data : int
        Number of samples, code of their encoding, length of the record in bytes, and position of
        the data in the record.
    rate : float
        Samples per second; 0 for text.
    start : float
        Time of the first sample, s from the start of the year.
    rest : int
        Number of bytes from the end of the samples to the last non-zero byte, for encodings with a
        fixed width.
    """

    number: int
    id: str
    codes: bytes
    samples: int
    encoding: int
    length: int
    data: int
    rate: float
    start: float
    rest: int = 0

    @property
    def end(self) -> float:
        """Expected time of the next sample after the record, s."""
        return self.start + (self.samples / self.rate if self.rate else 0.0)


def look_at_mseed(data: bytes) -> list[DataRecord]:
    """Check all records of a file and return the data records.

    Raises
    ------
    Damaged
        A header contradicts itself, its record or the other records of its channel.
    """
    records = list(_walk(data))
    channels: dict[str, list[DataRecord]] = {}
    for record in records:
        if record.samples:
            channels.setdefault(record.id, []).append(record)
    for name, members in channels.items():
        encodings = {record.encoding for record in members}
        if len(encodings) > 1:
            raise Damaged(f"the records of {name} have different encodings, {sorted(encodings)}")
    # If a channel continues exactly at the end of another channel with a similar name, one of the
    # names is corrupt.
    for name, members in channels.items():
        for other, others in channels.items():
            before, after = members[-1], others[0]
            if sum(a != b for a, b in zip(before.codes, after.codes, strict=True)) not in range(
                1, _MISSPELT + 1
            ):
                continue
            if (
                before.rate
                and before.rate == after.rate
                and abs(after.start - before.end) < 0.5 / before.rate
            ):
                raise Damaged(
                    f"record {after.number} of {other} continues record {before.number} of {name}"
                )
    return records


def mseed_statements(records: list[DataRecord], traces: list[Any]) -> list[Statement]:
    """Return statements of the number of samples of each channel: the sum of the header counts and
    the number that was read.

    A warning is given for records that libmseed joins although their times do not follow one
    another by one sampling interval, and for data after the last sample.
    """
    stated: Counter[str] = Counter()
    for record in records:
        if record.encoding != _TEXT and record.rate:
            stated[record.id] += record.samples
    for record in {record.id: record for record in records if record.samples}.values():
        if record.rest:  # In an earlier record, missing samples would cause a gap.
            warnings.warn(
                f"the last record of {record.id} states {record.samples} samples, but "
                f"{record.rest} nonzero bytes follow them: samples may be missing",
                stacklevel=2,
            )
    for name in stated:
        members = sorted(
            (block for block in records if block.id == name and block.rate),
            key=lambda block: block.start,
        )
        slips = [
            (after.start - before.end, after.number)
            for before, after in pairwise(members)
            if max(_SLIP / after.rate, _TICK)
            <= abs(after.start - before.end)
            <= _JOINED / after.rate + _TICK
        ]
        if slips:
            worst, number = max(slips, key=lambda slip: abs(slip[0]))
            gaps = "gap or overlap" if len(slips) == 1 else "gaps or overlaps"
            warnings.warn(
                f"{len(slips)} time {gaps} between the records of {name}, each at most half a "
                f"sampling interval (largest: {1e3 * worst:+.3g} ms before record {number}, "
                "negative for an overlap); the samples are joined at equal intervals",
                stacklevel=2,
            )
    counts: Counter[str] = Counter()
    for trace in traces:
        if trace.data.dtype.kind in "iuf":
            counts[trace.id] += len(trace.data)
    return [
        Statement(SAMPLES, stated[name], counts[name], where=name) for name in {**stated, **counts}
    ]


def _walk(data: bytes) -> Iterator[DataRecord]:
    """Yield the data records of a file and skip blank blocks and control headers."""
    offset, number, control_length = 0, 0, None
    is_volume = data[6:7] == b"V"
    while offset < len(data):
        header = data[offset : offset + _FIXED_HEADER]
        if not header.strip(b" \0"):
            # Continue with the next non-blank block in one step, because long parts may be blank.
            filled = _FILLED.search(data, offset)
            blank = (filled.start() if filled else len(data)) - offset
            offset += max(blank // _SHORTEST_RECORD, 1) * _SHORTEST_RECORD
            continue
        number += 1
        if len(header) < _FIXED_HEADER:
            raise Damaged(f"its last {len(header)} bytes are not a complete record")
        is_control = (
            is_volume
            and header[6:7] in (b"V", b"A", b"S", b"T")
            and (header[8:11].isdigit() or header[7:8] == b"*")
        )
        if is_control:
            control_length = control_length or _control_length(data)
            if control_length is None:
                raise Damaged("its first control header does not state the length of the records")
            if offset + control_length > len(data):
                raise Damaged(f"its last record has {len(data) - offset} of {control_length} bytes")
            offset += control_length
        else:
            record = _data_record(data, offset, number)
            yield record
            offset += record.length


def _control_length(data: bytes) -> int | None:
    """Return the record length of a full SEED volume, bytes, from its first blockette, otherwise
    from the position of the next header; None if unknown."""
    if data[8:11] in (b"005", b"008", b"010") and data[19:21].isdigit():
        exponent = int(data[19:21])
        return 2**exponent if exponent in _LENGTH_EXPONENTS else None
    lengths = (2**exponent for exponent in _LENGTH_EXPONENTS)
    return next((length for length in lengths if _begins_record(data[length : length + 8])), None)


def _begins_record(header: bytes) -> bool:
    """Return True if eight bytes are the start of a record."""
    return (
        len(header) == 8
        and header[:6].isdigit()
        and header[6:7] in b"VASTDRQM"
        and header[7:8] in b" *\0"
    )


def _data_record(data: bytes, offset: int, number: int) -> DataRecord:
    """Read the header of a data record.

    Parameters
    ----------
    data : bytes
        Content of the file.
    offset : int
        Position of the record in the file.
    number : int
        Number of the record, counted from 1.

    Raises
    ------
    Damaged
        The bytes are not a header, or the header contradicts itself.
    """
    # The byte order is stated only in blockette 1000. Before that, it is chosen so that the year is
    # valid.
    order = ">" if int.from_bytes(data[offset + 20 : offset + 22], "big") in _YEARS else "<"
    fields = struct.unpack_from(order + _HEADER, data, offset)
    sequence, quality, _, station, location, channel, network, year, day, hour, minute, second = (
        fields[:12]
    )
    fraction, samples, factor, multiplier, _, _, _, blockettes, _, begin, first = fields[12:]
    where = f"record {number}"
    is_sequence = not sequence.strip(b"0123456789 \0")
    is_clock = year in _YEARS and 1 <= day <= 366 and hour < 24 and minute < 60 and second < 61
    if not (quality in (b"D", b"R", b"Q", b"M") and is_sequence and is_clock and fraction < 10_000):
        raise Damaged(f"no valid header found at byte {offset}, where {where} must start")
    chain = _blockettes(data, offset, first, order, where)
    if len(chain) != blockettes:
        raise Damaged(f"{where}: its header states {blockettes} blockettes, it has {len(chain)}")
    if _DATA_ONLY not in chain:
        raise RecordError(
            f"{where} has no blockette 1000, which states its length and encoding; the record "
            "cannot be checked"
        )
    position = chain[_DATA_ONLY]
    encoding, big, exponent = data[position + 4 : position + 7]
    if exponent not in _LENGTH_EXPONENTS:
        raise Damaged(f"{where}: its header states an invalid length of 2^{exponent} bytes")
    if samples and encoding != _TEXT and (order == ">") != (big == 1):
        raise Damaged(f"{where}: its header and its blockette 1000 have different byte orders")

    # The sampling rate is the product of two numbers; a negative number is a divisor (SEED manual,
    # fields 10 and 11).
    rate = 0.0
    if factor and multiplier:
        rate = float(factor) if factor > 0 else -1.0 / factor
        rate = rate * multiplier if multiplier > 0 else -rate / multiplier
    if _ACTUAL_RATE in chain:
        (actual,) = struct.unpack_from(order + "f", data, chain[_ACTUAL_RATE] + 4)
        if not abs(actual - rate) <= _RATE_SLACK * rate:
            raise Damaged(f"{where}: its header states {rate:g} and {actual:g} samples a second")
        rate = float(actual)
    names = (part.decode("latin-1").strip(" \0") for part in (network, station, location, channel))
    start = ((day * 24.0 + hour) * 60.0 + minute) * 60.0 + second + 1e-4 * fraction
    codes = station + location + channel + network
    record = DataRecord(
        number, ".".join(names), codes, samples, encoding, 2**exponent, begin, rate, start
    )
    if offset + record.length > len(data):
        raise Damaged(f"its last record has {len(data) - offset} of {record.length} bytes")
    if inner := _inner_record(data, record, offset):
        raise Damaged(
            f"{where}: its header states {record.length} bytes, but another record begins after "
            f"{inner}"
        )
    ends = max(chain.values()) - offset + 8
    content = data[offset : offset + record.length]
    _check_room(record, content, ends, big == 1)
    used = record.data + record.samples * _WIDTHS.get(record.encoding, record.length)
    return replace(record, rest=len(content[used:].rstrip(b"\0")) if record.samples else 0)


def _inner_record(data: bytes, record: DataRecord, offset: int) -> int | None:
    """Return the position in a record at which another record of the same channel starts, which
    shows that the length is wrong; None if there is no such position."""
    for exponent in range(_LENGTH_EXPONENTS.start, record.length.bit_length() - 1):
        position = offset + 2**exponent
        if (
            _begins_record(data[position : position + 8])
            and data[position + 8 : position + 20] == record.codes
        ):
            return 1 << exponent
    return None


def _blockettes(data: bytes, offset: int, first: int, order: str, where: str) -> dict[int, int]:
    """Return the positions in the file of the blockettes of a record, by type.

    Parameters
    ----------
    data : bytes
        Content of the file.
    offset : int
        Position of the record in the file.
    first : int
        Position of the first blockette in the record; 0 if there is none.
    order : str
        Byte order, > or <.
    where : str
        Name of the record in error messages.
    """
    chain: dict[int, int] = {}
    position, last_position = first, _FIXED_HEADER - 1
    # The position of the next blockette is 0 after the last blockette. Positions must increase, so
    # that the loop ends.
    while position:
        if position <= last_position or offset + position + 8 > len(data):
            raise Damaged(f"{where}: the positions of its blockettes are invalid")
        blockette_type, next_position = struct.unpack_from(order + "HH", data, offset + position)
        chain[blockette_type] = offset + position
        last_position, position = position, next_position
    return chain


def _check_room(record: DataRecord, content: bytes, headers_end: int, big: bool) -> None:
    """Raise Damaged if a record has not enough space for its samples after its headers.

    Parameters
    ----------
    record : DataRecord
        Header of the record.
    content : bytes
        Bytes of the record.
    headers_end : int
        End of the last blockette in the record.
    big : bool
        True if the data have big-endian byte order.
    """
    if not record.samples or record.encoding == _TEXT:
        return
    where = f"record {record.number}"
    if not headers_end <= record.data < record.length:
        raise Damaged(
            f"{where}: its header places the data at byte {record.data}; its blockettes end at "
            f"{headers_end}, and the record at {record.length}"
        )
    room = record.length - record.data
    if record.encoding in _STEIM:
        if record.data % 64:
            raise Damaged(
                f"{where}: compressed data must start at a multiple of 64 bytes, but its header "
                f"states byte {record.data}"
            )
        most = most_samples(content[record.data :], _STEIM[record.encoding], ">" if big else "<")
    elif record.encoding in _WIDTHS:
        if _WIDTHS[record.encoding] % 4 == 0 and record.data % 4:
            raise Damaged(
                f"{where}: data must start at a multiple of 4 bytes, but its header states byte "
                f"{record.data}"
            )
        most = room // _WIDTHS[record.encoding]
    else:
        return
    if record.samples > most:
        raise Damaged(
            f"{where}: its header states {record.samples} samples, but the record has space for "
            f"{most}"
        )
