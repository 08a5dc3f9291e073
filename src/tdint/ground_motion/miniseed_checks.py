"""Comparison of MiniSEED and SEED headers with the bytes of their records (SEED manual 2.4,
chapters 3 and 8).

libmseed does not check headers. If a header states more samples than the record can contain,
libmseed reads memory after the record. If the position of the data or the type of a record is
wrong, libmseed drops the record. This module detects both errors before libmseed reads the file.
After reading, the number of samples of each channel must equal the sum of the counts in the
headers.

Steim compression (appendix B) uses frames of 64 bytes with differences of 4 to 32 bits. The first
word of a frame has two bits for each of the remaining 15 words, which state the number of
differences packed into that word. The first frame contains the first and the last sample in the two
words after its first word.
"""

from __future__ import annotations

import re
import struct
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from tdint.errors import RecordError
from tdint.items import grouped

# ---- Values stated in a file, and their comparison with the samples that were read

SAMPLES = "number of samples"
STEP = "sampling interval"
LENGTH = "length"
PEAK = "peak"
CHECKSUM = "checksum"

SHORTEST_STEP, LONGEST_STEP = 1e-6, 10.0
"""Minimum and maximum sampling interval of recorders of ground motion, s."""

_WARNING_DIFFERENCE = 0.01
"""Fraction of a stated peak. A difference up to this fraction is a warning instead of an error,
because it may result from rounding or from a different offset of the samples."""


class Damaged(RecordError):
    """File with a contradiction, which the message states."""


class Statement(NamedTuple):
    """Number stated in the header of a file, and the same number computed from the data that were
    read.

    Attributes
    ----------
    header_quantity : str
        Name of the quantity: `SAMPLES`, `PEAK`, ...
    stated, computed : float
        Stated and computed number, in the same unit.
    rounding : float
        Difference that is explained by the rounding of the stated number.
    where : str
        Part of the file, for messages; empty for the entire file.
    measured : bool
        True if the number is computed from the values of samples; a difference up to 1 % is then a
        warning instead of an error.
    """

    header_quantity: str
    stated: float
    computed: float
    rounding: float = 0.0
    unit: str = ""
    where: str = ""
    measured: bool = False

    @property
    def difference(self) -> float:
        """Difference in excess of the rounding; nan if a number is nan."""
        return abs(self.stated - self.computed) - self.rounding

    def __str__(self) -> str:
        """Return a message that the stated number and the computed number are different."""
        prefix = f"{self.where}: " if self.where else ""
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{prefix}the file states a {self.header_quantity} of {self.stated:.9g}{unit}, but the "
            f"data that were read have {self.computed:.9g}{unit}"
        )


def compare(statements: Iterable[Statement]) -> tuple[str, ...]:
    """Compare numbers stated in the headers of a file with the data that were read.

    A difference that is explained by the rounding of the stated number is accepted. A small
    difference of a number computed from the values of samples is reported as a warning.

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
        is_equal = statement.difference <= 0.0  # False for nan
        if not is_equal:
            tolerance = _WARNING_DIFFERENCE * max(abs(statement.stated), abs(statement.computed))
            is_small = isfinite(tolerance) and statement.difference <= tolerance
            if not (statement.measured and is_small):
                raise RecordError(f"the file is corrupt, or its header is wrong: {statement}")
            warnings.warn(str(statement), stacklevel=2)
        compared[statement.header_quantity] = None
    return tuple(compared)


def check_step(dt: float) -> None:
    """Raise Damaged if a sampling interval `dt`, s, is outside the range of recorders."""
    if not SHORTEST_STEP <= dt <= LONGEST_STEP:
        raise Damaged(
            f"the header states a sampling interval of {dt:g} s; recorders have {SHORTEST_STEP:g} "
            f"to {LONGEST_STEP:g} s"
        )


def last_place(number: str) -> float:
    """Return the unit of the last digit of a number in text form: 0.01 for 1.50, 100 for 1.2E3."""
    mantissa, _, exponent = number.upper().partition("E")
    decimals = len(mantissa.partition(".")[2])
    return float(f"1e{int(exponent or 0) - decimals}")


# ---- MiniSEED

_WORDS_PER_FRAME = 16  # words of 4 bytes in a frame of Steim compression
_DIFFERENCES: dict[int, dict[tuple[int, int | None], int]] = {
    1: {(1, None): 4, (2, None): 2, (3, None): 1},
    2: {(1, None): 4, (2, 1): 1, (2, 2): 2, (2, 3): 3, (3, 0): 5, (3, 1): 6, (3, 2): 7},
}
"""Number of differences in a word of Steim compression (SEED manual, appendix B), by version (1 or
2). The key is the code of the word, and the second code in the first two bits of the word; None if
the word has no second code."""


def most_samples(frames: bytes, version: int, order: str = ">") -> int:
    """Return the number of samples that Steim frames contain, according to their codes.

    Each sample is stored as the difference from the preceding sample. The number is the maximum
    that a header can state, because the last words may be partly unused.

    Parameters
    ----------
    frames : bytes
        Frames of 64 bytes; an incomplete last frame is ignored.
    version : int
        Version of the compression, 1 or 2.
    order : str
        Byte order, > (big-endian, the default) or <.
    """
    frame_bytes = 4 * _WORDS_PER_FRAME
    word_count = len(frames) // frame_bytes * _WORDS_PER_FRAME  # words in complete frames
    words = np.frombuffer(frames, f"{order}u4", word_count).astype(np.uint32)
    # The first word of a frame contains a code of two bits for each of the 16 words; the code of
    # the first word is in the two highest bits.
    shifts = np.arange(30, -2, -2, dtype=np.uint32)
    codes = ((words[::_WORDS_PER_FRAME, None] >> shifts) & 3).astype(np.int64)
    # The word of the codes contains no differences. The first frame also contains the first and
    # the last sample in the next two words.
    codes[:, 0] = 0
    codes = codes.reshape(-1)
    codes[1:3] = 0
    second_codes = (words >> np.uint32(30)).astype(np.int64)
    total = 0
    for (code, second_code), differences in _DIFFERENCES[version].items():
        matches = codes == code
        if second_code is not None:
            matches &= second_codes == second_code
        total += differences * int(np.sum(matches))
    return total


_FIXED_HEADER = 48  # bytes of the fixed section of a data header
_SHORTEST_RECORD = 128  # bytes
_LENGTH_EXPONENTS = range(7, 21)  # exponents n of the permitted record lengths, 2^n bytes
_YEARS = range(1900, 2101)  # plausible years; they determine the byte order
_NOT_BLANK = re.compile(rb"[^ \0]")
_TEXT = 0  # code of the encoding of records that contain text instead of samples
_STEIM = {10: 1, 11: 2, 19: 1, 20: 2}
"""Version of Steim compression by the code of the encoding."""

_WIDTHS = {1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 12: 3, 13: 2, 14: 2, 16: 2, 30: 2, 32: 2, 33: 2}
"""Bytes per sample by the code of the encoding (SEED manual, blockette 1000), for encodings with a
fixed width."""

_HEADER = "6scc5s2s3s2sHHBBBxHHhhBBBBiHH"
"""Fields of the fixed section of a data header, in the notation of the module `struct`."""

_ACTUAL_RATE, _DATA_ONLY = 100, 1000
"""Types of blockettes: actual sampling rate; length, encoding and byte order of the record."""

_MAX_WRONG_CHARACTERS = 3
"""Maximum number of wrong characters in a corrupt channel code."""

_REPORTED_BREAK, _JOINED_BREAK = 0.1 * (1.0 - 1e-6), 0.5
"""Fractions of a sampling interval: minimum gap or overlap of two records that is reported, and
maximum gap or overlap that libmseed ignores when it joins records."""

_TIME_RESOLUTION = 1.01e-4
"""Minimum detectable gap or overlap, s, because header times are rounded to 0.1 ms."""

_MAX_RATE_CORRECTION = 0.01
"""Maximum relative correction of the nominal sampling rate by blockette 100."""


class DataRecord(NamedTuple):
    """Header of a data record of a MiniSEED file.

    Attributes
    ----------
    number : int
        Number of the record in the file, counted from 1.
    id : str
        Network, station, location and channel joined by dots.
    codes : bytes
        Station, location, channel and network as in the header, padded to fixed widths.
    encoding : int
        Code of the encoding of the samples (SEED manual, blockette 1000).
    length : int
        Length of the record, bytes.
    data : int
        Position of the samples in the record, bytes from its start.
    rate : float
        Samples per second; 0 for text.
    start : float
        Time of the first sample, s from the start of the year.
    remaining_bytes : int
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
    remaining_bytes: int = 0

    @property
    def end(self) -> float:
        """Expected time of the next sample after the record, s."""
        return self.start + (self.samples / self.rate if self.rate else 0.0)


def look_at_mseed(data: bytes) -> list[DataRecord]:
    """Check all records of a MiniSEED or SEED file, and return the headers of its data records.

    Raises
    ------
    Damaged
        A header has contradictory contents, or contradicts its record or the other records of its
        channel.
    RecordError
        A record has no blockette 1000.
    """
    records = list(_data_records(data))
    channels = grouped((record.id, record) for record in records if record.samples)
    for name, members in channels.items():
        encodings = {record.encoding for record in members}
        if len(encodings) > 1:
            raise Damaged(f"the records of {name} have different encodings, {sorted(encodings)}")
    # If a channel continues exactly at the end of another channel with a similar name, one of the
    # names is corrupt.
    for name, members in channels.items():
        for other, others in channels.items():
            before, after = members[-1], others[0]
            wrong_characters = sum(a != b for a, b in zip(before.codes, after.codes, strict=True))
            if not 1 <= wrong_characters <= _MAX_WRONG_CHARACTERS:
                continue
            if (
                before.rate
                and before.rate == after.rate
                and abs(after.start - before.end) < 0.5 / before.rate
            ):
                raise Damaged(
                    f"record {after.number} of {other} continues record {before.number} of {name}: "
                    "a channel code may be wrong"
                )
    return records


def mseed_statements(records: list[DataRecord], traces: list[Any]) -> list[Statement]:
    """Return the stated and the read number of samples of each channel of a MiniSEED file, and warn
    about samples that may be missing.

    A warning is given for small gaps and overlaps between records, which libmseed ignores, and for
    data after the last sample of a channel.

    Returns
    -------
    list of Statement
        For each channel, the sum of the sample counts in its headers and the number of samples in
        its traces.
    """
    stated: Counter[str] = Counter()
    for record in records:
        if record.encoding != _TEXT and record.rate:
            stated[record.id] += record.samples
    # Only the last record of a channel is checked for data after its samples: in an earlier record,
    # missing samples would cause a gap.
    last_records = {record.id: record for record in records if record.samples}
    for record in last_records.values():
        if record.remaining_bytes:
            warnings.warn(
                f"the last record of {record.id} states {record.samples} samples, but "
                f"{record.remaining_bytes} nonzero bytes follow them: samples may be "
                "missing at the end; compare the duration with another copy of the file",
                stacklevel=2,
            )
    for name in stated:
        _warn_about_breaks(name, [record for record in records if record.id == name])
    counts: Counter[str] = Counter()
    for trace in traces:
        if trace.data.dtype.kind in "iuf":
            counts[trace.id] += len(trace.data)
    return [
        Statement(SAMPLES, stated[name], counts[name], where=name) for name in {**stated, **counts}
    ]


def _warn_about_breaks(name: str, records: list[DataRecord]) -> None:
    """Warn about small gaps and overlaps between the records of a channel, where libmseed joins
    the samples as if their times were continuous.

    `records`: records of the channel in any order; records without a sampling rate are ignored.
    """
    ordered = sorted((record for record in records if record.rate), key=lambda record: record.start)
    breaks = []  # (length in s, negative for an overlap; number of the record after the break)
    for before, after in pairwise(ordered):
        length = after.start - before.end
        min_reported = max(_REPORTED_BREAK / after.rate, _TIME_RESOLUTION)
        max_joined = _JOINED_BREAK / after.rate + _TIME_RESOLUTION
        if min_reported <= abs(length) <= max_joined:
            breaks.append((length, after.number))
    if breaks:
        longest, number = max(breaks, key=lambda item: abs(item[0]))
        gaps = "gap or overlap" if len(breaks) == 1 else "gaps or overlaps"
        warnings.warn(
            f"{len(breaks)} time {gaps} between the records of {name}, each at most half a "
            f"sampling interval (largest: {1e3 * longest:+.3g} ms before record {number}, "
            "negative for an overlap); the samples are joined at equal intervals",
            stacklevel=3,
        )


def _data_records(data: bytes) -> Iterator[DataRecord]:
    """Yield the headers of the data records of a MiniSEED or SEED file, in the order of the file.
    Blank blocks and the control headers of a full SEED volume are skipped.

    Damaged is raised if a record is incomplete, or a header is contradictory or contradicts its
    record.
    """
    offset, number, control_length = 0, 0, None
    # A full SEED volume starts with a volume control header, which has the type V in its byte 6.
    is_volume = data[6:7] == b"V"
    while offset < len(data):
        header = data[offset : offset + _FIXED_HEADER]
        if not header.strip(b" \0"):
            # Continue with the next non-blank block in one step, because long parts may be blank.
            filled = _NOT_BLANK.search(data, offset)
            blank_bytes = (filled.start() if filled else len(data)) - offset
            offset += max(blank_bytes // _SHORTEST_RECORD, 1) * _SHORTEST_RECORD
            continue
        number += 1
        if len(header) < _FIXED_HEADER:
            raise Damaged(f"the last {len(header)} bytes of the file are not a complete record")
        is_control = (
            is_volume
            and header[6:7] in (b"V", b"A", b"S", b"T")
            and (header[8:11].isdigit() or header[7:8] == b"*")
        )
        if is_control:
            control_length = control_length or _control_length(data)
            if control_length is None:
                raise Damaged(
                    "the first control header of the file does not state the length of the records"
                )
            if offset + control_length > len(data):
                raise Damaged(
                    f"the last record of the file has {len(data) - offset} of {control_length} "
                    "bytes"
                )
            offset += control_length
        else:
            record = _data_record(data, offset, number)
            yield record
            offset += record.length


def _control_length(data: bytes) -> int | None:
    """Return the record length of a full SEED volume, bytes; None if the stated length is not
    permitted, or if the blockette and a second header are missing.

    The length is stated in the first blockette of the volume. Otherwise, it is the position of the
    next header.
    """
    # Blockettes 5, 8 and 10 state the length as an exponent of 2 in two digits.
    if data[8:11] in (b"005", b"008", b"010") and data[19:21].isdigit():
        exponent = int(data[19:21])
        return 2**exponent if exponent in _LENGTH_EXPONENTS else None
    # The next header starts after the first record, which has one of the permitted lengths.
    lengths = (2**exponent for exponent in _LENGTH_EXPONENTS)
    return next((length for length in lengths if _begins_record(data[length : length + 8])), None)


def _begins_record(header: bytes) -> bool:
    """Return True if eight bytes are the start of a record: six digits (the sequence number), a
    letter for the type of the record, and a blank or a continuation mark."""
    return (
        len(header) == 8
        and header[:6].isdigit()
        and header[6:7] in b"VASTDRQM"
        and header[7:8] in b" *\0"
    )


def _data_record(data: bytes, offset: int, number: int) -> DataRecord:
    """Read the header of a data record (number from 1), and check it against the bytes of the
    record.

    Raises
    ------
    Damaged
        The bytes are not a header, or the header is contradictory or contradicts the record.
    RecordError
        The record has no blockette 1000.
    """
    # The byte order is stated only in blockette 1000, which cannot be found without the byte order.
    # The order that gives a valid year is therefore used.
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
        raise Damaged(
            f"{where}: its header states {blockettes} blockettes, but it has {len(chain)}"
        )
    if _DATA_ONLY not in chain:
        raise RecordError(
            f"{where} has no blockette 1000, which states its length and encoding; the record "
            "cannot be checked"
        )
    # Bytes 4 to 6 of blockette 1000 are the code of the encoding, the byte order (1 for big-endian)
    # and the exponent of the record length.
    position = chain[_DATA_ONLY]
    encoding, big, exponent = data[position + 4 : position + 7]
    if exponent not in _LENGTH_EXPONENTS:
        raise Damaged(f"{where}: its header states an invalid length of 2^{exponent} bytes")
    if samples and encoding != _TEXT and (order == ">") != (big == 1):
        raise Damaged(f"{where}: its header and its blockette 1000 have different byte orders")

    rate = _nominal_rate(factor, multiplier)
    if _ACTUAL_RATE in chain:
        (actual,) = struct.unpack_from(order + "f", data, chain[_ACTUAL_RATE] + 4)
        if not abs(actual - rate) <= _MAX_RATE_CORRECTION * rate:
            raise Damaged(f"{where}: its header states {rate:g} and {actual:g} samples a second")
        rate = float(actual)
    names = (part.decode("latin-1").strip(" \0") for part in (network, station, location, channel))
    start = ((day * 24.0 + hour) * 60.0 + minute) * 60.0 + second + 1e-4 * fraction
    codes = station + location + channel + network
    record = DataRecord(
        number, ".".join(names), codes, samples, encoding, 2**exponent, begin, rate, start
    )
    if offset + record.length > len(data):
        raise Damaged(
            f"the last record of the file has {len(data) - offset} of {record.length} bytes"
        )
    if inner := _inner_record(data, record, offset):
        raise Damaged(
            f"{where}: its header states {record.length} bytes, but another record begins after "
            f"{inner}"
        )
    headers_end = max(chain.values()) - offset + 8  # bytes; a blockette has at least 8
    content = data[offset : offset + record.length]
    _check_space(record, content, headers_end, big == 1)
    # For an encoding without a fixed width, the end of the samples is unknown, and the end of the
    # record is used instead.
    samples_end = record.data + record.samples * _WIDTHS.get(record.encoding, record.length)
    bytes_after_samples = len(content[samples_end:].rstrip(b"\0")) if record.samples else 0
    return record._replace(remaining_bytes=bytes_after_samples)


def _nominal_rate(factor: int, multiplier: int) -> float:
    """Return the sampling rate that the fixed section of a header states, samples per second.

    The rate is the product of two numbers. A negative number is a divisor (SEED manual, fields 10
    and 11). The rate is 0 if a number is 0, as in records that contain text.
    """
    if not (factor and multiplier):
        return 0.0
    rate = float(factor) if factor > 0 else -1.0 / factor
    return rate * multiplier if multiplier > 0 else -rate / multiplier


def _inner_record(data: bytes, record: DataRecord, offset: int) -> int | None:
    """Return the position in a record, a power of 2 in bytes, of another record of the same
    channel; None without such a record, which shows that the stated length is too large.
    """
    # The position is a permitted record length below the stated length of the record. Bytes 8 to 19
    # of a header are the codes of its channel.
    for exponent in range(_LENGTH_EXPONENTS.start, record.length.bit_length() - 1):
        position = offset + 2**exponent
        if (
            _begins_record(data[position : position + 8])
            and data[position + 8 : position + 20] == record.codes
        ):
            return 1 << exponent
    return None


def _blockettes(data: bytes, offset: int, first: int, order: str, where: str) -> dict[int, int]:
    """Return the position in the file of each blockette (additional header) of a record by its type
    (such as 1000). The blockettes form a linked list from the position `first`, 0 if there are
    none.

    Damaged is raised if a position is outside the file or not after the preceding blockette.
    """
    chain: dict[int, int] = {}
    position, last_position = first, _FIXED_HEADER - 1
    # The position of the next blockette is 0 after the last blockette. Positions must increase:
    # otherwise, the loop would not end.
    while position:
        if position <= last_position or offset + position + 8 > len(data):
            raise Damaged(f"{where}: the positions of its blockettes are invalid")
        blockette_type, next_position = struct.unpack_from(order + "HH", data, offset + position)
        chain[blockette_type] = offset + position
        last_position, position = position, next_position
    return chain


def _check_space(record: DataRecord, content: bytes, headers_end: int, is_big_endian: bool) -> None:
    """Raise Damaged if a record does not have enough space for its samples after its headers.

    `headers_end` is the minimum position of the end of the last blockette, bytes from the start of
    the record. `is_big_endian` is True if the data have big-endian byte order.
    """
    if not record.samples or record.encoding == _TEXT:
        return
    where = f"record {record.number}"
    if not headers_end <= record.data < record.length:
        raise Damaged(
            f"{where}: its header places the data at byte {record.data}; its blockettes end at "
            f"{headers_end}, and the record at {record.length}"
        )
    if record.encoding in _STEIM:
        if record.data % 64:
            raise Damaged(
                f"{where}: compressed data must start at a multiple of 64 bytes, but its header "
                f"states byte {record.data}"
            )
        byte_order = ">" if is_big_endian else "<"
        max_samples = most_samples(content[record.data :], _STEIM[record.encoding], byte_order)
    elif record.encoding in _WIDTHS:
        if _WIDTHS[record.encoding] % 4 == 0 and record.data % 4:
            raise Damaged(
                f"{where}: data must start at a multiple of 4 bytes, but its header states byte "
                f"{record.data}"
            )
        max_samples = (record.length - record.data) // _WIDTHS[record.encoding]
    else:
        return  # The number of samples of an unknown encoding cannot be checked.
    if record.samples > max_samples:
        raise Damaged(
            f"{where}: its header states {record.samples} samples, but the record has space for "
            f"{max_samples}"
        )
