"""Comparison of files with the values in their headers, by format."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tdint.arrays import max_absolute
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
from tdint.number_parsing import pluralize

# SAC (SAC manual, data format): the header of 158 words states several values that can be computed
# from the samples.

_DELTA, _SMALLEST, _LARGEST, _BEGIN, _END, _MEAN = 0, 1, 2, 5, 6, 56
_VERSION, _COUNT = 76, 79
_LONGITUDES = (32, 36)
"""Indices of header words."""

_UNKNOWN = -12345.0
_SINGLE = 2.0**-22
"""Relative rounding of a sum of two single-precision numbers."""

_EXTREME, _AVERAGE = 1e-5, 1e-3
"""Fractions of the peak; rounding of the minimum and maximum sample, and of the mean, which
programs compute in single precision."""


def look_at_sac(data: bytes) -> tuple[int, tuple[float, ...]]:
    """Return the number of samples that a SAC header states, and the floating-point values of the
    header.

    Raises
    ------
    Damaged
        A longitude is out of range. ObsPy reduces longitudes to -180..180 degrees by repeated
        subtraction of 360 degrees, which does not terminate for values above 1e30.
    """
    # The version of the header is a small number only in the right byte order. A word has 4 bytes.
    order = "<" if 0 <= struct.unpack_from("<i", data, 4 * _VERSION)[0] <= 20 else ">"
    values = struct.unpack_from(f"{order}70f", data)
    for index in _LONGITUDES:
        # This comparison also refuses nan, because it is negated.
        if not abs(values[index]) <= -_UNKNOWN:
            raise Damaged(f"the file header states an invalid longitude, {values[index]:g}")
    (count,) = struct.unpack_from(f"{order}i", data, 4 * _COUNT)
    return count, values


def sac_statements(header: tuple[int, tuple[float, ...]], traces: list[Any]) -> list[Statement]:
    """Return the values in the header of a SAC file with the same values computed from its samples.

    The values are the number of samples, the time of the last sample, and the minimum, maximum and
    mean sample. A value that the header does not state is omitted.

    Parameters
    ----------
    header : tuple of (int, tuple of float)
        Result of `look_at_sac`.
    """
    (trace,) = traces
    size = len(trace.data)
    count, values = header
    statements = [Statement(SAMPLES, count, size)]
    delta, begin, end = values[_DELTA], values[_BEGIN], values[_END]
    if _UNKNOWN not in (begin, end):
        # Some programs write the time of the sample after the last sample, so a difference of a
        # single sampling interval is permitted.
        rounding = 1.01 * abs(delta) + _SINGLE * (abs(end) + abs(begin))
        last = begin + (size - 1) * delta
        statements.append(
            Statement(f"{LENGTH} (time of the last sample)", end, last, rounding, "s")
        )
    stated_values = (values[_SMALLEST], values[_LARGEST], values[_MEAN])
    # Three zeros are placeholders of programs that do not fill them in.
    if size and any(stated_values) and trace.data.dtype.kind in "iuf":
        samples = np.asarray(trace.data, dtype=np.float64)
        sample_values = (float(samples.min()), float(samples.max()), float(samples.mean()))
        peak = max(map(abs, sample_values[:2]))
        roundings = [fraction * peak for fraction in (_EXTREME, _EXTREME, _AVERAGE)]
        names = (f"{PEAK} (smallest sample)", f"{PEAK} (largest sample)", "mean")
        statements += [
            Statement(name, number, value, rounding)
            for name, number, value, rounding in zip(
                names, stated_values, sample_values, roundings, strict=True
            )
            if number != _UNKNOWN
        ]
    return statements


# GSE1 and GSE2 (GSETT documentation, annex D; compression CM6): libgse2 does not check the number
# of samples and copies lines of any length into 83 bytes. ObsPy compares the checksum.

_LINE = 81
_FIELDS = {
    "1": (slice(27, 35), slice(74, 78), b"CMP6"),
    "2": (slice(48, 56), slice(44, 48), b"CM6"),
}
"""Positions of the number of samples and of the data type in the header line, and the name of the
compressed data type."""

_CM6 = rb"[-+0-9A-Za-z]*"
_CM6_LAST = rb"[-+0-9A-T]"
"""Pattern of the last character of a sample; the preceding characters have the continuation bit."""


def look_at_gse(data: bytes) -> list[int]:
    """Check the compressed data of all sections of a GSE file; return the number of samples that
    the header of each section states.

    Raises
    ------
    Damaged
        A section is cut off or corrupt, or its number of samples differs from its header.
    """
    counts = []
    # A section starts with a header line WID1 or WID2, by the version of the format.
    for section in re.split(rb"^(?=WID[12])", data, flags=re.MULTILINE):
        if section[:3] != b"WID":
            continue
        # The header has two lines in version 1. In version 2, the second line, which states the
        # station, is optional.
        lines, version = section.split(b"\n"), section[3:4].decode()
        heading = 2 if version == "1" or any(line.startswith(b"STA2") for line in lines[1:2]) else 1
        npts, datatype, compressed = _FIELDS[version]
        count = lines[0][npts].strip()
        if not count.isdigit():
            raise Damaged("the header of a section does not state its number of samples")
        if lines[0][datatype].strip() == compressed:
            _check_compressed(
                lines[heading:], f"DAT{version}".encode(), f"CHK{version}".encode(), int(count)
            )
        counts.append(int(count))
    return counts


def gse_statements(counts: list[int], traces: list[Any]) -> list[Statement]:
    """Return the stated and the read number of samples of each section of a GSE file.

    A statement of equal numbers is added for the checksum of each section, because ObsPy has
    already compared the checksums.
    """
    return [
        *_section_statements(counts, traces, "sections"),
        *(Statement(CHECKSUM, 0.0, 0.0) for _ in counts),
    ]


def _section_statements(
    counts: list[int], traces: list[Any], name: str = "headers of channels"
) -> list[Statement]:
    """Return the stated and the read number of samples of each section (trace) of a file. Damaged
    is raised if the numbers of sections and of traces differ.
    """
    if len(counts) != len(traces):
        raise Damaged(f"the file has {len(counts)} {name}, but {len(traces)} could be read")
    return [
        Statement(SAMPLES, count, len(trace.data))
        for count, trace in zip(counts, traces, strict=True)
    ]


def _check_compressed(lines: list[bytes], begin: bytes, end: bytes, count: int) -> None:
    """Check that the compressed samples (CM6) of a section of a GSE file, between the lines that
    start with `begin` and `end`, are complete. Damaged is raised if the section is cut off or
    corrupt, or its number of samples differs from its header.
    """
    # A line of compressed samples may also start with these characters, but it contains no blank.
    ends = [index for index, line in enumerate(lines) if line.startswith(end + b" ")]
    begins = [index for index, line in enumerate(lines) if line.startswith(begin)]
    if not (begins and ends and begins[0] < ends[0]):
        raise Damaged(
            f"a section has no data between the lines {begin.decode()} and {end.decode()}"
        )
    if any(len(line) > _LINE for line in lines[: ends[0]]):
        raise Damaged(f"a line of data is longer than {_LINE} characters")
    samples = b"".join(line.strip() for line in lines[begins[0] + 1 : ends[0]])
    if not re.fullmatch(_CM6, samples):
        raise Damaged("the compressed data contain an invalid character")
    # A sample consists of several characters. Only its last character has no continuation bit.
    sample_count = len(re.findall(_CM6_LAST, samples))
    if sample_count != count:
        raise Damaged(
            f"the header of a section states {pluralize(count, 'sample')}, but the section has "
            f"{sample_count}"
        )


# Text formats: SLIST and TSPAIR (web services), SH_ASC (Seismic Handler) and K-NET.

_TIMESERIES = rb"(?m)^TIMESERIES[^,\n]*,\s*(\d+) samples"

_SH_CHANNEL = rb"(?m)^DELTA\s*:"
_SH_COUNT = rb"(?m)^LENGTH\s*:\s*(\d+)"
"""Patterns of the lines that a channel of a SH_ASC file contains a single time."""

_GAL = 0.01
_PRINTED = 0.0006
"""gal; rounding of the peak in K-NET files, which is printed to a thousandth of a gal."""

_OFFSET = 1e-3
"""Fraction of the peak; change of the peak due to a different method for the zero offset."""


def _timeseries_counts(data: bytes) -> list[int]:
    """Return the number of samples that each section header (TIMESERIES) of a SLIST or TSPAIR file
    states; `data` is the content of the file."""
    return [int(count) for count in re.findall(_TIMESERIES, data)]


def _sh_counts(data: bytes) -> list[int]:
    """Return the number of samples that each channel of a SH_ASC file states. ObsPy does not
    compare the number with the samples, and omits the last channel if no blank line follows.
    Damaged is raised if a channel states no number.
    """
    counts = [int(count) for count in re.findall(_SH_COUNT, data)]
    if len(counts) != len(re.findall(_SH_CHANNEL, data)):
        raise Damaged("each channel must state DELTA and LENGTH")
    return counts


def knet_statements(_: None, traces: list[Any]) -> list[Statement]:
    """Return the stated and the computed number of samples and peak (gal, without the zero offset)
    of each trace of a K-NET file.

    Parameters
    ----------
    _ : None
        Not used; K-NET has no check before reading.

    Raises
    ------
    Damaged
        A header is incomplete, or its duration or sampling rate is invalid.
    """
    statements = []
    for trace in traces:
        header = trace.stats.get("knet")
        if header is None:
            raise Damaged("the file header is incomplete")
        # The header does not state the number of samples, which is duration times sampling rate.
        length = header.duration * trace.stats.sampling_rate
        if not (math.isfinite(length) and length > 0.0):
            raise Damaged(
                "the file header states an invalid number of samples (duration times rate), "
                f"{length:g}"
            )
        statements.append(Statement(SAMPLES, round(length), len(trace.data)))
        if len(trace.data):
            samples = np.asarray(trace.data, dtype=np.float64)
            peak = max_absolute(samples - samples.mean()) * trace.stats.calib / _GAL
            rounding = _PRINTED + _OFFSET * peak
            statements.append(Statement(PEAK, header.accmax, peak, rounding, "gal", measured=True))
    return statements


# ---- Check


class Check(NamedTuple):
    """Check of a format that is read by ObsPy.

    Attributes
    ----------
    statements : callable
        Function of the result of `read_headers` and the list of traces; returns the statements to
        compare.
    read_headers : callable
        Function of the bytes of a file; returns the values stated in the headers. Raises Damaged
        for a file that must not be passed to the reader.
    """

    statements: Callable[[Any, list[Any]], list[Statement]]
    read_headers: Callable[[bytes], Any] = lambda _: None


CHECKS = {
    "MSEED": Check(miniseed_checks.mseed_statements, miniseed_checks.look_at_mseed),
    "SAC": Check(sac_statements, look_at_sac),
    "GSE1": Check(gse_statements, look_at_gse),
    "GSE2": Check(gse_statements, look_at_gse),
    "SLIST": Check(_section_statements, _timeseries_counts),
    "TSPAIR": Check(_section_statements, _timeseries_counts),
    "SH_ASC": Check(_section_statements, _sh_counts),
    "KNET": Check(knet_statements),
}
"""Checks of ObsPy formats that are common, or with readers that crash or do not terminate for a
corrupt file (SAC, GSE). The readers of tdint compare during reading
(`tdint.ground_motion.formats.series`)."""


def look_at(format_name: str, data: bytes) -> Any:
    """Return the values stated in the headers of a file, for `compare_with_statements`; None if the
    format has no check.

    Raises
    ------
    Damaged
        The file has contradictory contents and must not be passed to the reader of its format.
    """
    check = CHECKS.get(format_name)
    return check.read_headers(data) if check else None


def compare_with_statements(format_name: str, looked_at: Any, traces: list[Any]) -> tuple[str, ...]:
    """Compare the traces of a file with the values stated in its headers.

    Parameters
    ----------
    looked_at
        Result of `look_at`.

    Returns
    -------
    tuple of str
        Names of the compared values; empty if the file states none.

    Raises
    ------
    RecordError
        Two numbers differ, or a sampling interval is outside the range of recorders.
    """
    for trace in traces:
        if len(trace.data) and trace.data.dtype.kind in "iuf":
            check_step(float(trace.stats.delta))
    check = CHECKS.get(format_name)
    return compare(check.statements(looked_at, traces)) if check else ()
