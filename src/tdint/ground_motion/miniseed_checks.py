"""MiniSEED and SEED (SEED manual 2.4, chapters 3 and 8): every record's header against the bytes of
the record.

libmseed takes the header's word: more samples than the record has room for are read from the memory
behind it, a wrong place of the data or type of the record drops the record. The walk over all
records here finds both before libmseed sees the file; afterwards the samples of each channel must
be the sum of the headers' counts.

Steim's compression (appendix B) is in frames of 64 bytes with differences of 4 to 32 bits. A
frame's first word has two bits for each of the 15 others that tell how many differences are packed
into it; the first frame has the first and the last sample in its first two words.
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
from tdint.written_numbers import how_many

# ---- A statement of a file about its own samples, and its comparison with the samples that were
# read

SAMPLES = "number of samples"
STEP = "sampling interval"
LENGTH = "length"
PEAK = "peak"
CHECKSUM = "checksum"

SHORTEST_STEP, LONGEST_STEP = 1e-6, 10.0
"""Sampling intervals beyond which no recorder of ground motion goes, s."""

_NEAR = 0.01
"""Part of a stated measured value (a peak) within which another one is remarked only: rounding,
another offset."""


class Damaged(RecordError):
    """A file that contradicts itself; the message says what is wrong in it."""


@dataclass(frozen=True)
class Statement:
    """A number that a file states, and the same number of what was read.

    Attributes
    ----------
    what : str
        What it is: `SAMPLES`, `PEAK`, ...
    stated, found : float
        The two numbers, in the same unit.
    rounding : float
        Difference that the way of writing the stated number explains.
    unit : str
        For messages.
    where : str
        The part of the file, for messages; empty for all of it.
    measured : bool
        Whether the number comes from the samples' values, so that a difference up to 1 % is
        remarked, not refused.
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
        """What the rounding does not explain; nan where a number is none."""
        return abs(self.stated - self.found) - self.rounding

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{place}the file states a {self.what} of {self.stated:.9g}{unit}, what was read has "
            f"{self.found:.9g}{unit}"
        )


def compare(statements: Iterable[Statement]) -> tuple[str, ...]:
    """Compare what a file states with what was read.

    Small differences of measured values are warned about.

    Returns
    -------
    tuple of str
        What was compared, each kind once; empty if the file states nothing.

    Raises
    ------
    RecordError
        Two numbers differ; the message names both.
    """
    compared: dict[str, None] = {}  # a set in the order of arrival
    for statement in statements:
        if not statement.difference <= 0.0:
            near = _NEAR * max(abs(statement.stated), abs(statement.found))
            if not (statement.measured and isfinite(near) and statement.difference <= near):
                raise RecordError(f"the file is damaged, or its header is wrong: {statement}")
            warnings.warn(str(statement), stacklevel=2)
        compared[statement.what] = None
    return tuple(compared)


def check_step(dt: float) -> None:
    """Raise Damaged for a sampling interval, s, that no recorder has."""
    if not SHORTEST_STEP <= dt <= LONGEST_STEP:
        raise Damaged(
            f"its header gives a sampling interval of {dt:g} s; recorders have {SHORTEST_STEP:g} "
            f"to {LONGEST_STEP:g} s"
        )


def last_place(number: str) -> float:
    """Value of the last digit of a number as it is written."""
    mantissa, _, exponent = number.upper().partition("E")
    return float(f"1e{int(exponent or 0) - len(mantissa.partition('.')[2])}")


# ---- Mseed

_WORDS = 16
_DIFFERENCES: dict[int, dict[tuple[int, int | None], int]] = {
    1: {(1, None): 4, (2, None): 2, (3, None): 1},
    2: {(1, None): 4, (2, 1): 1, (2, 2): 2, (2, 3): 3, (3, 0): 5, (3, 1): 6, (3, 2): 7},
}
"""Of each version the number of differences in a word, by its code and, where it has one, the code
in its first two bits."""


def most_samples(frames: bytes, version: int, order: str = ">") -> int:
    """The number of differences that whole frames hold, by the codes of their words.

    Parameters
    ----------
    frames : bytes
        Frames; what is left of the last one that is not whole is passed over.
    version : int
        1 or 2.
    order : str
        Order of the bytes, > or <.
    """
    whole = len(frames) // (4 * _WORDS) * _WORDS
    words = np.frombuffer(frames, f"{order}u4", whole).astype(np.uint32)
    # The code of each word stands in the first one of its frame; that one, and the first and last
    # sample, have none.
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
"""Bytes of a sample by the code of the encoding (SEED manual, blockette 1000), where all have the
same."""

_HEADER = "6scc5s2s3s2sHHBBBxHHhhBBBBiHH"
_ACTUAL_RATE, _DATA_ONLY = 100, 1000
_MISSPELT = 3
"""Letters in which two names may differ to be taken for the same one, damaged."""

_SLIP, _JOINED = 0.1 * (1.0 - 1e-6), 0.5
"""Parts of a sampling interval: from the first one on a break between two records is told, up to
the second one libmseed joins them."""

_TICK = 1.01e-4
"""Headers have times in steps of 0.1 ms, s: of two that are rounded no smaller break is known."""

_RATE_SLACK = 0.01
"""Part by which blockette 100 may correct the nominal sampling rate."""


@dataclass(frozen=True)
class DataRecord:
    """What the header of one data record says.

    Attributes
    ----------
    number : int
        Its place in the file, from 1.
    id : str
        Network, station, location and channel joined by dots.
    codes : bytes
        The same as they stand in the header, padded to their places.
    samples, encoding, length, data : int
        Number of samples, code of their encoding, bytes of the record and of its header.
    rate : float
        Samples per second; 0 for text.
    start : float
        Seconds from the beginning of the year.
    rest : int
        Bytes after the samples, where these have a fixed width, up to the last one that is not
        zero.
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
        """When the sample after the last one would come, s."""
        return self.start + (self.samples / self.rate if self.rate else 0.0)


def look_at_mseed(data: bytes) -> list[DataRecord]:
    """Walk over the records to the end of the file; returns those of data.

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
    # No channel goes on, to the sample, where another one ends whose name differs in a few letters:
    # one is misspelt.
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
    """The counts of all headers of a channel against the samples that were read of it. It is told
    where records that libmseed joins do not follow one another by a sampling interval."""
    stated: Counter[str] = Counter()
    for record in records:
        if record.encoding != _TEXT and record.rate:
            stated[record.id] += record.samples
    for record in {record.id: record for record in records if record.samples}.values():
        if record.rest:  # Of an earlier record a gap would tell.
            warnings.warn(
                f"after the {record.samples} samples that the last record of {record.id} states, "
                f"{record.rest} bytes follow in it that are not zero: are samples missing?",
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
            warnings.warn(
                f"{how_many(len(slips), 'break')} between the records of {name}, the largest "
                f"{1e3 * worst:+.3g} ms before record {number}: less than half a sampling interval "
                "each, joined without them",
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
    offset, number, control_length = 0, 0, None
    is_volume = data[6:7] == b"V"
    while offset < len(data):
        header = data[offset : offset + _FIXED_HEADER]
        if not header.strip(b" \0"):
            # On to the block that has something in it, in one step: a file may be blank for long.
            filled = _FILLED.search(data, offset)
            blank = (filled.start() if filled else len(data)) - offset
            offset += max(blank // _SHORTEST_RECORD, 1) * _SHORTEST_RECORD
            continue
        number += 1
        if len(header) < _FIXED_HEADER:
            raise Damaged(f"its last {len(header)} bytes are no whole record")
        is_control = (
            is_volume
            and header[6:7] in (b"V", b"A", b"S", b"T")
            and (header[8:11].isdigit() or header[7:8] == b"*")
        )
        if is_control:
            control_length = control_length or _control_length(data)
            if control_length is None:
                raise Damaged("its first control header does not tell the records' length")
            if offset + control_length > len(data):
                raise Damaged(f"its last record has {len(data) - offset} of {control_length} bytes")
            offset += control_length
        else:
            record = _data_record(data, offset, number)
            yield record
            offset += record.length


def _control_length(data: bytes) -> int | None:
    """Length of a full SEED volume's records, bytes: by its first blockette, else to the next
    header."""
    if data[8:11] in (b"005", b"008", b"010") and data[19:21].isdigit():
        exponent = int(data[19:21])
        return 2**exponent if exponent in _LENGTH_EXPONENTS else None
    lengths = (2**exponent for exponent in _LENGTH_EXPONENTS)
    return next((length for length in lengths if _begins_record(data[length : length + 8])), None)


def _begins_record(header: bytes) -> bool:
    return (
        len(header) == 8
        and header[:6].isdigit()
        and header[6:7] in b"VASTDRQM"
        and header[7:8] in b" *\0"
    )


def _data_record(data: bytes, offset: int, number: int) -> DataRecord:
    """Understand a data record's header.

    Raises
    ------
    Damaged
        It is none, or contradicts itself.
    """
    # Nothing before blockette 1000 tells the byte order: the right one makes a year of our time.
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
        raise Damaged(f"at byte {offset}, where {where} should begin, there is no header of one")
    chain = _blockettes(data, offset, first, order, where)
    if len(chain) != blockettes:
        raise Damaged(f"{where}: its header states {blockettes} blockettes, there are {len(chain)}")
    if _DATA_ONLY not in chain:
        raise RecordError(
            f"{where} has no blockette 1000, which tells its length and encoding; nothing in it "
            "can be checked"
        )
    place = chain[_DATA_ONLY]
    encoding, big, exponent = data[place + 4 : place + 7]
    if exponent not in _LENGTH_EXPONENTS:
        raise Damaged(f"{where}: its header gives a length of 2^{exponent} bytes")
    if samples and encoding != _TEXT and (order == ">") != (big == 1):
        raise Damaged(f"{where}: its header and its blockette 1000 have different byte orders")

    # Samples per second: either of the two numbers divides where it is negative (SEED manual,
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
    """Where in a record another one of the same channel begins: its length is wrong."""
    for exponent in range(_LENGTH_EXPONENTS.start, record.length.bit_length() - 1):
        place = offset + 2**exponent
        if _begins_record(data[place : place + 8]) and data[place + 8 : place + 20] == record.codes:
            return 1 << exponent
    return None


def _blockettes(data: bytes, offset: int, first: int, order: str, where: str) -> dict[int, int]:
    """Places in the file of a record's blockettes, by their type."""
    chain: dict[int, int] = {}
    place, before = first, _FIXED_HEADER - 1
    while place:
        if place <= before or offset + place + 8 > len(data):
            raise Damaged(f"{where}: the places of its blockettes are wrong")
        kind, following = struct.unpack_from(order + "HH", data, offset + place)
        chain[kind] = offset + place
        before, place = place, following
    return chain


def _check_room(record: DataRecord, content: bytes, headers_end: int, big: bool) -> None:
    """The record must have the room that its samples need, from behind its headers on."""
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
                f"{where}: its header places compressed data at byte {record.data}, no multiple of "
                "64"
            )
        most = most_samples(content[record.data :], _STEIM[record.encoding], ">" if big else "<")
    elif record.encoding in _WIDTHS:
        if _WIDTHS[record.encoding] % 4 == 0 and record.data % 4:
            raise Damaged(
                f"{where}: its header places the data at byte {record.data}, no multiple of 4"
            )
        most = room // _WIDTHS[record.encoding]
    else:
        return
    if record.samples > most:
        raise Damaged(
            f"{where}: its header states {record.samples} samples, it has room for {most}"
        )
