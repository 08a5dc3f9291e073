"""GSE1 and GSE2 (GSETT documentation, annex D; compression CM6).

libgse2 trusts the number of samples and copies lines of any length into 83 bytes; ObsPy compares the checksum.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from tdint.ground_motion.header_checks.statement import CHECKSUM, SAMPLES, Damaged, Statement

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
    for version, lines in _sections(data):
        npts, datatype, compressed = _FIELDS[version]
        count = lines[0][npts].strip()
        if not count.isdigit():
            raise Damaged("a section does not tell its number of samples")
        if lines[0][datatype].strip() == compressed:
            _check_compressed(lines[1:], f"DAT{version}".encode(), f"CHK{version}".encode(), int(count))
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


def _sections(data: bytes) -> Iterator[tuple[str, list[bytes]]]:
    """The sections of a file, each from its WID line on, without the station's line, which is read by itself."""
    for section in re.split(rb"^(?=WID[12])", data, flags=re.MULTILINE):
        if section[:3] != b"WID":
            continue
        lines = section.split(b"\n")
        own = 2 if section[:4] == b"WID1" or any(line.startswith(b"STA2") for line in lines[1:2]) else 1
        yield section[3:4].decode(), [lines[0], *lines[own:]]


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
        raise Damaged(f"its header states {count} samples, there are {got}")
