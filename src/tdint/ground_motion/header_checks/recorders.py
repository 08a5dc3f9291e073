"""Binary files of recorders: frames of Kinemetrics (EVT), blocks of Guralp (GCF), packets of Reftek (RT130)."""

from __future__ import annotations

import struct
from collections import Counter
from typing import Any

from tdint.ground_motion.header_checks.mseed import last_samples, most_samples
from tdint.ground_motion.header_checks.statement import CHECKSUM, SAMPLES, Damaged, Statement

# Kinemetrics: a tag of 16 bytes with length and checksum before each frame (Kinemetrics, Altus data format).

_TAG = "cBBBLHHHH"
_TAG_SIZE = 16


def look_at_evt(data: bytes) -> int:
    """Compare the checksum of every frame, the sum of its bytes; returns the number of frames.

    Raises
    ------
    Damaged
        A frame is cut off or damaged.
    """
    place, frames = 0, 0
    while place + _TAG_SIZE <= len(data) and data[place : place + 1] == b"K":
        order = ">" if data[place + 1] else "<"
        *_, length, more, _, checksum = struct.unpack_from(order + _TAG, data, place)
        content = data[place + _TAG_SIZE : place + _TAG_SIZE + length + more]
        if len(content) < length + more:
            raise Damaged(f"frame {frames} has {len(content)} of {length + more} bytes")
        if sum(content) % 2**16 != checksum:
            raise Damaged(f"frame {frames} states a checksum of {checksum}, its bytes have {sum(content) % 2**16}")
        place += _TAG_SIZE + length + more
        frames += 1
    if data[place:].strip(b"\0"):
        raise Damaged(f"at byte {place}, after frame {frames - 1}, there is no other frame")
    return frames


def evt_statements(frames: int, traces: list[Any]) -> list[Statement]:
    """The checksums, compared before; a tenth of a second in each frame but the header's."""
    statements = [Statement(CHECKSUM, 0.0, 0.0)]
    for trace in traces:
        each = int(trace.stats.sampling_rate) // 10
        statements.append(Statement(SAMPLES, (frames - 1) * each, len(trace.data), where=trace.id))
    return statements


# GCF: blocks of 1024 bytes (Guralp, SWA-RFC-GCFR, 2021). Their last sample is compared by ObsPy.

_BLOCK = 1024
_SAME_TIME = 1e-3
_STATUS = 4
"""Code of a block of words, which has no sampling rate."""

_GCF_HEADER = struct.Struct(">IIIBBBB")


def look_at_gcf(data: bytes) -> int:
    """The sum of the samples that the blocks announce.

    Raises
    ------
    Damaged
        A block announces more than it has room for, or the last one is cut off.
    """
    if len(data) % _BLOCK:
        raise Damaged(f"{len(data)} bytes are no whole number of blocks of {_BLOCK} bytes")
    total = 0
    spans: dict[tuple[int, int], tuple[float, float]] = {}
    for place in range(0, len(data), _BLOCK):
        system, stream, clock, _, rate, compression, records = _GCF_HEADER.unpack_from(data, place)
        block = f"block {place // _BLOCK}"
        if not rate:
            if compression & 7 != _STATUS or not records:
                raise Damaged(f"{block} is neither one of samples nor one of words")
            continue
        if compression & 7 not in (1, 2, 4) or 4 * records + 24 > _BLOCK:
            raise Damaged(f"{block} announces no samples that it can have")
        count = (compression & 7) * records
        total += count
        start = (clock >> 17) * 86_400 + (clock & 0x1FFFF)
        first, _ = spans.get((system, stream), (start, 0.0))
        spans[system, stream] = first, start + count / rate
    for name, (_, end) in spans.items():
        for other, (start, _) in spans.items():
            if name != other and abs(end - start) < _SAME_TIME:
                raise Damaged("one stream of its blocks continues another one: the name in a block is wrong")
    return total


def gcf_statements(total: int, traces: list[Any]) -> list[Statement]:
    """Number of samples in all blocks; the last sample of each stands for itself."""
    return [Statement(SAMPLES, total, sum(len(trace.data) for trace in traces)), Statement("last sample", 0.0, 0.0)]


# RT130: packets of 1024 bytes (Reftek, RT130 log file format).

_PACKET, _PACKET_HEADER, _FRAMES = 1024, 24, 64
_PACKET_COMPRESSION = {0xC0: 1, 0xC2: 2}
_PACKET_WIDTHS = {0x16: 2, 0x32: 4}


def look_at_reftek(data: bytes) -> Counter[int]:
    """Samples of each channel by the packets' headers.

    Raises
    ------
    Damaged
        The packets are no unbroken sequence, or one has no room for its samples or other ones than it states.
    """
    if len(data) % _PACKET:
        raise Damaged(f"{len(data)} bytes are no whole number of packets of {_PACKET} bytes")
    samples: Counter[int] = Counter()
    before = None
    for place in range(0, len(data), _PACKET):
        packet = data[place : place + _PACKET]
        number = _decimal(packet[14:16])
        if before is not None and number != (before + 1) % 10_000:
            raise Damaged(f"packet {number} follows packet {before}")
        before = number
        if packet[:2] == b"DT":
            count = _decimal(packet[20:22])
            samples[_decimal(packet[19:20])] += count
            _check_packet(packet, count, number)
    return samples


def _check_packet(packet: bytes, count: int, number: int) -> None:
    where = f"packet {number}"
    if count and (version := _PACKET_COMPRESSION.get(packet[23])):
        most = most_samples(packet[_FRAMES:], version)
        if count > most:
            raise Damaged(f"{where}: its header states {count} samples, it has room for {most}")
        stated, found = last_samples(packet[_FRAMES:], version, count)
        if stated != found:
            raise Damaged(f"{where}: it states a last sample of {stated}, its differences lead to {found}")
    elif width := _PACKET_WIDTHS.get(packet[23]):
        stated_bytes = _decimal(packet[12:14])
        if stated_bytes != _PACKET_HEADER + count * width:
            raise Damaged(f"{where}: its header states {count} samples and {stated_bytes} bytes")
    elif count or packet[23] not in _PACKET_COMPRESSION:
        raise Damaged(f"{where}: its header gives an unknown format of its samples")


def reftek_statements(samples: Counter[int], traces: list[Any]) -> list[Statement]:
    """Number of samples of each channel."""
    found: Counter[int] = Counter()
    for trace in traces:
        found[int(trace.stats.reftek130["channel_number"])] += len(trace.data)
    return [
        Statement(SAMPLES, samples[channel], found[channel], where=f"channel {channel}")
        for channel in sorted({*samples, *found})
    ]


def _decimal(digits: bytes) -> int:
    """A number of decimal digits, two in a byte.

    Raises
    ------
    Damaged
        It is none.
    """
    text = digits.hex()
    if not text.isdigit():
        raise Damaged(f"{text} stands in a packet's header where a number should")
    return int(text)
