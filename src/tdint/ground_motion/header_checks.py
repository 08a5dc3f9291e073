"""The formats and how each of them is compared with what it says of itself."""

from __future__ import annotations

import math
import re
import struct
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from tdint.ground_motion import miniseed_checks
from tdint.ground_motion.miniseed_checks import (
    CHECKSUM,
    LENGTH,
    PEAK,
    SAMPLES,
    Damaged,
    Statement,
    check_step,
    compare,
    last_samples,
    most_samples,
)
from tdint.written_numbers import how_many

# ---- Binary files of recorders: frames of Kinemetrics (EVT), blocks of Guralp (GCF), packets of Reftek (RT130)

# Kinemetrics: a tag of 16 bytes with length and checksum before each frame (Kinemetrics, Altus data format).

_TAG = "cBBBLHHHH"
_TAG_SIZE = 16  # bytes of the head of a Kinemetrics tag


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
        # Blocks without a rate hold words on the recorder's state.
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
            # What a packet says of itself holds: room for its samples, the last of them, the bytes that they take.
            where = f"packet {number}"
            if count and (version := _PACKET_COMPRESSION.get(packet[23])):
                most = most_samples(packet[_FRAMES:], version)
                if count > most:
                    raise Damaged(f"{where}: its header states {count} samples, it has room for {most}")
                stated, summed = last_samples(packet[_FRAMES:], version, count)
                if stated != summed:
                    raise Damaged(f"{where}: it states a last sample of {stated}, its differences lead to {summed}")
            elif width := _PACKET_WIDTHS.get(packet[23]):
                stated_bytes = _decimal(packet[12:14])
                if stated_bytes != _PACKET_HEADER + count * width:
                    raise Damaged(f"{where}: its header states {count} samples and {stated_bytes} bytes")
            elif count or packet[23] not in _PACKET_COMPRESSION:
                raise Damaged(f"{where}: its header gives an unknown format of its samples")
    return samples


def reftek_statements(samples: Counter[int], traces: list[Any]) -> list[Statement]:
    """Number of samples of each channel."""
    counts: Counter[int] = Counter()
    for trace in traces:
        counts[int(trace.stats.reftek130["channel_number"])] += len(trace.data)
    return [
        Statement(SAMPLES, samples[channel], counts[channel], where=f"channel {channel}")
        for channel in sorted({*samples, *counts})
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


# ---- Formats in which records are exchanged: SAC, GSE, and texts whose header says how many samples follow

# SAC (SAC manual, data format): a header of 158 words, in which much is stated that the samples tell as well.

_DELTA, _SMALLEST, _LARGEST, _BEGIN, _END, _MEAN = 0, 1, 2, 5, 6, 56
_VERSION, _COUNT = 76, 79
_LONGITUDES = (32, 36)
"""Places of words."""

_UNKNOWN = -12345.0
_SINGLE = 2.0**-22
"""Relative rounding of a sum of two single-precision numbers."""

_EXTREME, _AVERAGE = 1e-5, 1e-3
"""Parts of the peak by which programs round the smallest and largest sample, and the mean, which they sum in single
precision."""


@dataclass(frozen=True)
class SacHeader:
    """What the header says: numbers as they stand in it, `count` as an integer."""

    delta: float
    begin: float
    end: float
    smallest: float
    largest: float
    mean: float
    count: int


def look_at_sac(data: bytes) -> SacHeader:
    """Understand the header.

    Raises
    ------
    Damaged
        A longitude is out of all bounds: ObsPy turns it into -180..180 degrees one turn at a time, for ever from 1e30.
    """
    order = "<" if 0 <= struct.unpack_from("<i", data, 4 * _VERSION)[0] <= 20 else ">"
    words = struct.unpack_from(f"{order}70f", data)
    for place in _LONGITUDES:
        if not abs(words[place]) <= -_UNKNOWN:
            raise Damaged(f"its header gives a longitude of {words[place]:g}")
    (count,) = struct.unpack_from(f"{order}i", data, 4 * _COUNT)
    places = (_DELTA, _BEGIN, _END, _SMALLEST, _LARGEST, _MEAN)
    delta, begin, end, smallest, largest, mean = (words[place] for place in places)
    return SacHeader(delta, begin, end, smallest, largest, mean, count)


def sac_statements(header: SacHeader, traces: list[Any]) -> list[Statement]:
    """Number of samples, time of the last one, and the smallest, largest and mean sample."""
    (trace,) = traces
    size = len(trace.data)
    statements = [Statement(SAMPLES, header.count, size)]
    if _UNKNOWN not in (header.begin, header.end):
        # Some programs write the time of the sample that would follow.
        rounding = 1.01 * abs(header.delta) + _SINGLE * (abs(header.end) + abs(header.begin))
        last = header.begin + (size - 1) * header.delta
        statements.append(Statement(f"{LENGTH} (time of the last sample)", header.end, last, rounding, "s"))
    stated = (header.smallest, header.largest, header.mean)
    # Three zeros are placeholders of programs that do not fill them in.
    if size and any(stated) and trace.data.dtype.kind in "iuf":
        samples = np.asarray(trace.data, dtype=np.float64)
        of_samples = (float(samples.min()), float(samples.max()), float(samples.mean()))
        peak = max(map(abs, of_samples[:2]))
        parts = (_EXTREME, _EXTREME, _AVERAGE)
        names = (f"{PEAK} (smallest sample)", f"{PEAK} (largest sample)", "mean")
        statements += [
            Statement(name, number, value, part * peak)
            for name, number, value, part in zip(names, stated, of_samples, parts, strict=True)
            if number != _UNKNOWN
        ]
    return statements


# GSE1 and GSE2 (GSETT documentation, annex D; compression CM6): libgse2 trusts the number of samples and copies lines
# of any length into 83 bytes; ObsPy compares the checksum.

_LINE = 81
_FIELDS = {"1": (slice(27, 35), slice(74, 78), b"CMP6"), "2": (slice(48, 56), slice(44, 48), b"CM6")}
"""Places of the number of samples and of the type of data in the header line, and the type that is compressed."""

_CM6 = re.compile(rb"[-+0-9A-Za-z]*")
_CM6_LAST = re.compile(rb"[-+0-9A-T]")
"""A sample's last character; those before it have the bit that tells that more follow."""


def look_at_gse(data: bytes) -> list[int]:
    """Check the sections' compressed data; returns the number of samples that each header states.

    Raises
    ------
    Damaged
        A section is cut off, damaged, or holds another number of samples than its header states.
    """
    counts = []
    for section in re.split(rb"^(?=WID[12])", data, flags=re.MULTILINE):
        if section[:3] != b"WID":
            continue
        # The station's line, where there is one, is read by itself.
        lines, version = section.split(b"\n"), section[3:4].decode()
        heading = 2 if version == "1" or any(line.startswith(b"STA2") for line in lines[1:2]) else 1
        npts, datatype, compressed = _FIELDS[version]
        count = lines[0][npts].strip()
        if not count.isdigit():
            raise Damaged("a section does not tell its number of samples")
        if lines[0][datatype].strip() == compressed:
            _check_compressed(lines[heading:], f"DAT{version}".encode(), f"CHK{version}".encode(), int(count))
        counts.append(int(count))
    return counts


def gse_statements(counts: list[int], traces: list[Any]) -> list[Statement]:
    """Number of samples; the checksum, which ObsPy has compared, stands for itself."""
    if len(counts) != len(traces):
        raise Damaged(f"it has {len(counts)} sections, {len(traces)} could be read")
    return [
        statement
        for count, trace in zip(counts, traces, strict=True)
        for statement in (Statement(SAMPLES, count, len(trace.data)), Statement(CHECKSUM, 0.0, 0.0))
    ]


def _check_compressed(lines: list[bytes], begin: bytes, end: bytes, count: int) -> None:
    """Check that a section's compressed samples are whole and as many as its header states."""
    # Compressed samples, too, may begin with these letters, but hold no blank.
    ends = [place for place, line in enumerate(lines) if line.startswith(end + b" ")]
    begins = [place for place, line in enumerate(lines) if line.startswith(begin)]
    if not (begins and ends and begins[0] < ends[0]):
        raise Damaged(f"a section without {begin.decode()}, {end.decode()}")
    if any(len(line) > _LINE for line in lines[: ends[0]]):
        raise Damaged(f"a line of data is longer than {_LINE} characters")
    samples = b"".join(line.strip() for line in lines[begins[0] + 1 : ends[0]])
    if not _CM6.fullmatch(samples):
        raise Damaged("a character among the data is none of the compression's")
    got = len(_CM6_LAST.findall(samples))
    if got != count:
        raise Damaged(f"its header states {how_many(count, 'sample')}, there are {got}")


# Texts: SLIST and TSPAIR, Seismic Handler's ASCII, K-NET.

_TIMESERIES = re.compile(rb"^TIMESERIES[^,\n]*,\s*(\d+) samples,\s*([^,\s]+) sps,\s*([^,\s]+)", re.MULTILINE)
_HANDLER = re.compile(rb"^LENGTH:\s*(\d+)", re.MULTILINE)
_PAIR = re.compile(rb"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d{1,6})?)\s+\S+\s*\Z")

_GAL = 0.01
_PRINTED = 0.0006
"""Rounding of K-NET's peak, printed to a thousandth of a gal, beside that of the zero offset."""

_OFFSET = 1e-3
"""Part of the peak by which another way to find the zero offset may change it."""


def look_at_timeseries(data: bytes) -> list[tuple[int, float]]:
    """Number of samples and time between the first and the last one (s, nan if not printed) of each section."""
    sections = []
    for section in re.split(rb"^(?=TIMESERIES)", data, flags=re.MULTILINE)[1:]:
        header, last = _TIMESERIES.match(section), _PAIR.search(section[-200:])
        if not header:
            raise Damaged("a header TIMESERIES does not tell samples, rate and time")
        length = math.nan
        if last:
            with suppress(ValueError, TypeError):  # A text that is no time, or one with a zone beside one without.
                start, end = (datetime.fromisoformat(text.decode("ascii")) for text in (header[3], last[1]))
                length = (end - start).total_seconds()
        sections.append((int(header[1]), length))
    return sections


def timeseries_statements(sections: list[tuple[int, float]], traces: list[Any]) -> list[Statement]:
    """Number of samples, and the time of the last one where times are printed."""
    _same_number(len(sections), len(traces))
    statements = []
    for (count, length), trace in zip(sections, traces, strict=True):
        statements.append(Statement(SAMPLES, count, len(trace.data), where=trace.id))
        if not math.isnan(length):
            dt = float(trace.stats.delta)
            statements.append(Statement(LENGTH, length, (len(trace.data) - 1) * dt, 0.1 * dt, "s", trace.id))
    return statements


def look_at_handler(data: bytes) -> list[int]:
    """Number of samples of each section of a file of Seismic Handler."""
    return [int(count) for count in _HANDLER.findall(data)]


def handler_statements(counts: list[int], traces: list[Any]) -> list[Statement]:
    """Number of samples, where the header has it."""
    if counts:
        _same_number(len(counts), len(traces))
    return [
        Statement(SAMPLES, count, len(trace.data), where=trace.id) for count, trace in zip(counts, traces, strict=False)
    ]


def knet_statements(_: None, traces: list[Any]) -> list[Statement]:
    """Number of samples, by duration and rate, and the peak without the zero offset, gal."""
    statements = []
    for trace in traces:
        header = trace.stats.get("knet")
        if header is None:
            raise Damaged("its header has no end")
        # The header has no number of samples: duration and rate tell it.
        length = header.duration * trace.stats.sampling_rate
        if not (math.isfinite(length) and length > 0.0):
            raise Damaged("its header gives no length that a record can have")
        statements.append(Statement(SAMPLES, round(length), len(trace.data)))
        if len(trace.data):
            samples = np.asarray(trace.data, dtype=np.float64)
            peak = float(np.max(np.abs(samples - samples.mean()))) * trace.stats.calib / _GAL
            rounding = _PRINTED + _OFFSET * peak
            statements.append(Statement(PEAK, header.accmax, peak, rounding, "gal", measured=True))
    return statements


def _same_number(stated: int, count: int) -> None:
    if stated != count:
        raise Damaged(f"it has {stated} headers of channels, {count} could be read")


# ---- Check


@dataclass(frozen=True)
class Check:
    """How a format that another program reads is compared with what it says of itself.

    Attributes
    ----------
    statements : callable
        From what `look` found and the traces that were read the statements to compare.
    look : callable
        From the bytes of a file what they state; raises Damaged for a file that must not come before the reader.
    """

    statements: Callable[[Any, list[Any]], list[Statement]]
    look: Callable[[bytes], Any] = lambda _: None


CHECKS = {
    "MSEED": Check(miniseed_checks.mseed_statements, miniseed_checks.look_at_mseed),
    "SAC": Check(sac_statements, look_at_sac),
    "GSE1": Check(gse_statements, look_at_gse),
    "GSE2": Check(gse_statements, look_at_gse),
    "SLIST": Check(timeseries_statements, look_at_timeseries),
    "TSPAIR": Check(timeseries_statements, look_at_timeseries),
    "SH_ASC": Check(handler_statements, look_at_handler),
    "KNET": Check(knet_statements),
    "KINEMETRICS_EVT": Check(evt_statements, look_at_evt),
    "GCF": Check(gcf_statements, look_at_gcf),
    "REFTEK130": Check(reftek_statements, look_at_reftek),
}
"""ObsPy's formats; tdint's own readers compare while they read (`tdint.ground_motion.formats.series`)."""


def look_at(format_name: str, data: bytes) -> Any:
    """What the bytes of a file state, for `compare_with_statements`; None if the format has nothing.

    Raises
    ------
    Damaged
        The file must not come before the reader of its format: it contradicts itself.
    """
    check = CHECKS.get(format_name)
    return check.look(data) if check else None


def compare_with_statements(format_name: str, looked_at: Any, traces: list[Any]) -> tuple[str, ...]:
    """Compare what was read with what the file states; returns what was compared, nothing if it states nothing.

    Parameters
    ----------
    format_name : str
        ObsPy's name of the format.
    looked_at
        From `look_at`.
    traces : list of obspy.Trace
        What was read.

    Raises
    ------
    Damaged
        Two numbers differ, or a sampling interval is none that a recorder has.
    """
    for trace in traces:
        if len(trace.data) and trace.data.dtype.kind in "iuf":
            check_step(float(trace.stats.delta))
    check = CHECKS.get(format_name)
    return compare(check.statements(looked_at, traces)) if check else ()
