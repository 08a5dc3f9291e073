"""The formats and how each of them is compared with what it says of itself."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
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
)
from tdint.written_numbers import how_many

# SAC (SAC manual, data format): a header of 158 words, in which much is stated that the samples
# tell as well.

_DELTA, _SMALLEST, _LARGEST, _BEGIN, _END, _MEAN = 0, 1, 2, 5, 6, 56
_VERSION, _COUNT = 76, 79
_LONGITUDES = (32, 36)
"""Places of words."""

_UNKNOWN = -12345.0
_SINGLE = 2.0**-22
"""Relative rounding of a sum of two single-precision numbers."""

_EXTREME, _AVERAGE = 1e-5, 1e-3
"""Parts of the peak by which programs round the smallest and largest sample, and the mean, which
they sum in single precision."""


def look_at_sac(data: bytes) -> tuple[int, tuple[float, ...]]:
    """The number of samples that the header states, and its words that are numbers.

    Raises
    ------
    Damaged
        A longitude is out of all bounds: ObsPy turns it into -180..180 degrees one turn at a time,
        for ever from 1e30.
    """
    order = "<" if 0 <= struct.unpack_from("<i", data, 4 * _VERSION)[0] <= 20 else ">"
    words = struct.unpack_from(f"{order}70f", data)
    for place in _LONGITUDES:
        if not abs(words[place]) <= -_UNKNOWN:
            raise Damaged(f"its header gives a longitude of {words[place]:g}")
    (count,) = struct.unpack_from(f"{order}i", data, 4 * _COUNT)
    return count, words


def sac_statements(header: tuple[int, tuple[float, ...]], traces: list[Any]) -> list[Statement]:
    """Number of samples, time of the last one, and the smallest, largest and mean sample."""
    (trace,) = traces
    size = len(trace.data)
    count, words = header
    statements = [Statement(SAMPLES, count, size)]
    delta, begin, end = words[_DELTA], words[_BEGIN], words[_END]
    if _UNKNOWN not in (begin, end):
        # Some programs write the time of the sample that would follow.
        rounding = 1.01 * abs(delta) + _SINGLE * (abs(end) + abs(begin))
        last = begin + (size - 1) * delta
        statements.append(
            Statement(f"{LENGTH} (time of the last sample)", end, last, rounding, "s")
        )
    stated = (words[_SMALLEST], words[_LARGEST], words[_MEAN])
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


# GSE1 and GSE2 (GSETT documentation, annex D; compression CM6): libgse2 trusts the number of
# samples and copies lines of any length into 83 bytes; ObsPy compares the checksum.

_LINE = 81
_FIELDS = {
    "1": (slice(27, 35), slice(74, 78), b"CMP6"),
    "2": (slice(48, 56), slice(44, 48), b"CM6"),
}
"""Places of the number of samples and of the type of data in the header line, and the type that is
compressed."""

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
            _check_compressed(
                lines[heading:], f"DAT{version}".encode(), f"CHK{version}".encode(), int(count)
            )
        counts.append(int(count))
    return counts


def gse_statements(counts: list[int], traces: list[Any]) -> list[Statement]:
    """Number of samples; the checksum, which ObsPy has compared, stands for itself."""
    return [
        *_of_sections(counts, traces, "sections"),
        *(Statement(CHECKSUM, 0.0, 0.0) for _ in counts),
    ]


def _of_sections(counts: list[int], traces: list[Any], name: str) -> list[Statement]:
    """Number of samples of each section."""
    if len(counts) != len(traces):
        raise Damaged(f"it has {len(counts)} {name}, {len(traces)} could be read")
    return [
        Statement(SAMPLES, count, len(trace.data))
        for count, trace in zip(counts, traces, strict=True)
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


# Texts: SLIST and TSPAIR, which web services give, and K-NET.

_TIMESERIES = re.compile(rb"^TIMESERIES[^,\n]*,\s*(\d+) samples", re.MULTILINE)

_GAL = 0.01
_PRINTED = 0.0006
"""Rounding of K-NET's peak, printed to a thousandth of a gal, beside that of the zero offset."""

_OFFSET = 1e-3
"""Part of the peak by which another way to find the zero offset may change it."""


def _counts(data: bytes) -> list[int]:
    return [int(count) for count in _TIMESERIES.findall(data)]


def timeseries_statements(counts: list[int], traces: list[Any]) -> list[Statement]:
    """Number of samples of each section."""
    return _of_sections(counts, traces, "headers of channels")


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


# ---- Check


@dataclass(frozen=True)
class Check:
    """How a format that another program reads is compared with what it says of itself.

    Attributes
    ----------
    statements : callable
        From what `look` found and the traces that were read the statements to compare.
    look : callable
        From the bytes of a file what they state; raises Damaged for a file that must not come
        before the reader.
    """

    statements: Callable[[Any, list[Any]], list[Statement]]
    look: Callable[[bytes], Any] = lambda _: None


CHECKS = {
    "MSEED": Check(miniseed_checks.mseed_statements, miniseed_checks.look_at_mseed),
    "SAC": Check(sac_statements, look_at_sac),
    "GSE1": Check(gse_statements, look_at_gse),
    "GSE2": Check(gse_statements, look_at_gse),
    "SLIST": Check(timeseries_statements, _counts),
    "TSPAIR": Check(timeseries_statements, _counts),
    "KNET": Check(knet_statements),
}
"""ObsPy's formats that many have, or whose readers crash or never end on a damaged file (SAC, GSE);
tdint's own readers compare while they read (`tdint.ground_motion.formats.series`)."""


def look_at(format_name: str, data: bytes) -> Any:
    """What the bytes of a file state, for `compare_with_statements`; None if the format has
    nothing.

    Raises
    ------
    Damaged
        The file must not come before the reader of its format: it contradicts itself.
    """
    check = CHECKS.get(format_name)
    return check.look(data) if check else None


def compare_with_statements(format_name: str, looked_at: Any, traces: list[Any]) -> tuple[str, ...]:
    """Compare what was read with what the file states; returns what was compared, nothing if it
    states nothing.

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
