"""COSMOS files, versions 1.xx: volumes 0, 1 and 2, one or more channels per file.

Each channel consists of lines of text, integers, reals and comments, each preceded by their number,
and of blocks of values. A line before each block states the number, quantity, units and Fortran
format of its values (COSMOS, Strong motion data format, version 1.20, 2001; units in its table 2).
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import COUNT, NUMBER, Lines, recognizer
from tdint.ground_motion.formats.series import (
    Header,
    Series,
    by_parts,
    code,
    largest_value,
    moment,
    motion_units,
)
from tdint.number_parsing import any_case, pluralize
from tdint.units import parse_units

IS_OF_ONE_QUANTITY = True  # some programs write each quantity to a separate file

_TITLE = any_case(r"\(Format v0?1\.\d+ with\s+(\d{1,3}) text lines\)")
_INTEGERS = any_case(rf"^\s*({COUNT})\s+Integer-header values follow on")
_REALS = any_case(rf"^\s*({COUNT})\s+Real-header values follow on")
_COMMENTS = any_case(rf"^\s*({COUNT})\s+Comment line\(?s?\)? follow")
_BLOCK = any_case(
    rf"^\s*({COUNT})\s+([a-z. ]+?)\s+(?:pts|points)\b(?:.*?approx\s*({COUNT})\s*secs)?"
    r".*?units\s*=\s*([^,(]*)(?:\(\s*0*(\d+)\s*\))?"
)
"""Pattern of the line before a block of samples. Its groups are the number of samples, the
quantity, the approximate duration (s; None if not stated), the name of the units, and the number of
the units in table 2 of the format (None if not stated)."""

_FORMAT = any_case(r"Format\s*=\s*\(\s*\d*\s*[IFEDG](\d{1,3})")
_END = any_case(r"\s*(?:/&|End-of-data)")

_UNKNOWN = rf"unknown/unspecified:\s*{NUMBER}\s*,?\s*({NUMBER})"
_STATION = r"^\s*Stat\w*\s+No\b.*?\bCode:\s*(\w+)-(\w+)"
_CHANNEL = r"^\s*Sta\s+Cha\w*:?\s*(\S+?)\s*:\s*([^(]*?)\s*(?:deg\w*\s*)?(?:\(|Location|$)"
_CODES = r"<SCNL>\s*(\w+)\.(\w+)\.(\w+)\.([-\w]*)"
_UTC = r"^\s*Rcrd start time.*\b(?:UTC|GMT)\b"
_PEAK = rf"^\s*Processed.*\bMax\s*=\s*({NUMBER})\s*([\w/^]+)"

_EVENT = r"^\s*Record of\s+(?:the\s+)?(.*?)\s+Earthquake\b"
_ORIGIN = r"^\s*Origin:\s*(\d+/\d+/\d+),?\s+(\d+:\d\d:\d\d)(?:\.\d*)?\s*(?:UTC|GMT)\b"

_YEAR, _MONTH, _DAY, _HOUR, _MINUTE = 39, 41, 42, 43, 44
_SECOND, _STEP = 29, 61
"""Indices in the integers (date and time) and in the reals (second, sampling interval in ms)."""

_UNITS = {
    "2": "g",
    "4": "cm/s^2",
    "7": "0.0254 m/s^2",
    "10": "gal",
    "11": "0.001 g",
    "12": "1e-6 g",
}
"""Units of acceleration by their numbers in table 2 of the format."""

_COUNTS = "50"  # number of the unit of counts in table 2 of the format
_OTHER_QUANTITIES = ("velocity", "displacement")
_OTHER_UNITS = {"5": "cm/s", "6": "cm", "8": "in/s", "9": "in"}
"""Units of velocity and displacement by their numbers in table 2 of the format."""

_DURATION_TOLERANCE = 0.05
"""Fraction of the stated duration; permitted difference from the samples, in addition to 1 s."""


@recognizer
def is_cosmos(lines: list[str]) -> object:
    """Return True if the first line names the COSMOS format, version 1."""
    return _TITLE.search(lines[0])


@by_parts
def read_cosmos(lines: Lines) -> list[Series]:
    """Read and return the accelerations of the channel that starts at the next line.

    A channel consists of headers and blocks of samples; a block contains a single quantity. Every
    block of accelerations becomes a series. Blocks of velocity and displacement only provide the
    peaks (`pgv` and `pgd`) of these series. In a channel without acceleration, the first block of
    velocity or displacement becomes the only series. Counts of a recorder (volume 0) have no units.

    The decorator `by_parts` replaces this function by a function that reads all channels: it calls
    this function until no line remains.
    """
    title = _TITLE.search(lines.take())
    if not title:
        raise RecordError(f"the header of a channel must start in line {lines.number}")
    header = Header(lines.take() for _ in range(int(title[1]) - 1))
    integers = _header_values(_INTEGERS, lines)
    reals = _header_values(_REALS, lines)
    header += [lines.take() for _ in range(int(_read_announcement(_COMMENTS, lines)[1]))]
    series: list[Series] = []
    peaks: dict[str, float | None] = {}  # peak velocity and displacement in SI units
    other_blocks: list[tuple[Array, re.Match[str]]] = []
    while (line := lines.peek()) is not None and (block := _BLOCK.match(line)):
        lines.take()
        samples = lines.numbers(int(block[1]), _width(line))
        if block[2].lower().startswith(("accel", "raw accel")):
            series.append(_series(samples, block, header, integers, reals))
        elif (quantity := block[2].lower().split()[0]) in _OTHER_QUANTITIES and samples.size:
            # Units by their number; by their name if the number is missing or not in the table.
            units = _OTHER_UNITS.get(block[5] or "") or block[4]
            other_blocks.append((samples, block))
            peaks[quantity] = largest_value(samples, units, quantity)
    if line is None or not _END.match(line):
        raise RecordError(
            f"the file is cut off or corrupt: end-of-data line not found after line {lines.number}"
        )
    lines.take()
    if not series and other_blocks:  # The channel has only a velocity or a displacement.
        return [_series(*other_blocks[0], header, integers, reals)]
    pgv, pgd = peaks.get("velocity"), peaks.get("displacement")
    return [replace(acceleration, pgv=pgv, pgd=pgd) for acceleration in series]


def _read_announcement(pattern: re.Pattern[str], lines: Lines) -> re.Match[str]:
    """Read the next line, which states the number of values or lines that follow, in the first
    group of `pattern`. RecordError is raised if the line does not match.
    """
    match = pattern.match(lines.take())
    if not match:
        raise RecordError(
            f"line {lines.number} must state the number of header lines or values that follow"
        )
    return match


def _header_values(pattern: re.Pattern[str], lines: Lines) -> list[float]:
    """Read the integers or the reals of the header of a channel. `pattern` matches the line before
    the values; its first group is their number.

    RecordError is raised if there are fewer than 62, because the 62nd real is the sampling
    interval.
    """
    match = _read_announcement(pattern, lines)
    values: list[float] = lines.numbers(int(match[1]), _width(match.string)).tolist()
    if len(values) <= _STEP:
        raise RecordError(
            f"the header that ends in line {lines.number} must have at least {_STEP + 1} values, "
            f"got {pluralize(len(values), 'value')}"
        )
    return values


def _width(line: str) -> int | None:
    """Return the characters per number, from the Fortran format in a line; None if the line states
    no format or a width of 0."""
    match = _FORMAT.search(line)
    return int(match[1]) or None if match else None


def _series(
    samples: Array,
    block: re.Match[str],
    header: Header,
    integers: list[float],
    reals: list[float],
) -> Series:
    """Check a block of samples (`block` is the match of `_BLOCK` in the line before the samples)
    and return it with the data of the channel header.

    RecordError is raised if the sampling interval is unknown or contradicts the duration, the units
    do not match the quantity, or samples are invalid.
    """
    # The header states a number that marks unknown values; it is usually -999.
    unknown = float(header.field(_UNKNOWN) or -999.0)
    if reals[_STEP] == unknown:
        raise RecordError("the header of the channel does not state the sampling interval")
    dt = reals[_STEP] / 1000.0  # the header states ms
    # Compare the sampling interval with the duration stated in the line before the block.
    if block[3] and abs(samples.size * dt - int(block[3])) > 1.0 + _DURATION_TOLERANCE * int(
        block[3]
    ):
        raise RecordError(
            f"{samples.size} samples at the interval of {dt:g} s in the header contradict the "
            f"stated duration of {block[3]} s"
        )

    # The unit is stated by name or by its number in the table of the format.
    stated_quantity = block[2].lower().split()[0]
    quantity = stated_quantity if stated_quantity in _OTHER_QUANTITIES else "acceleration"
    units = motion_units(block[4]) or _UNITS.get(block[5] or "") or _OTHER_UNITS.get(block[5] or "")
    if units and parse_units(units).quantity != quantity:
        units = None
    is_counts = units is None and (
        block[5] == _COUNTS or block[4].strip().lower().startswith("count")
    )
    if units is None and not is_counts:
        raise RecordError(
            f"the units of the samples must be a unit of {quantity}, but the header states "
            f"{block[4].strip()!r}"
        )
    missing = 0 if is_counts else int(np.count_nonzero(samples == unknown))
    if missing:
        raise RecordError(
            f"all samples must be known, but {pluralize(missing, 'sample')} marked as unknown "
            f"({unknown:g})"
        )
    if is_counts and (np.any(np.abs(samples) > np.iinfo(np.int32).max) or np.any(samples % 1.0)):
        raise RecordError(
            "the header of the channel states that the samples are counts, but they are not 32-bit "
            "integers"
        )

    # The time of the first sample is used only if it is completely known and in UTC.
    year, month, day, hour, minute = (
        integers[index] for index in (_YEAR, _MONTH, _DAY, _HOUR, _MINUTE)
    )
    second = reals[_SECOND]
    origin = header.match(_ORIGIN)
    origin_time = f"{origin[1]} {origin[2]}" if origin else ""
    is_utc = unknown not in (year, month, day, hour, minute, second) and header.match(_UTC)
    return Series(
        samples.astype(np.int32) if is_counts else samples,
        dt,
        units,
        **_codes(header),
        start=moment(year, month, day, hour, minute, second) if is_utc else None,
        event=" ".join(f"{header.field(_EVENT)} {origin_time}".split()),
        peak=header.peak(_PEAK, units),
    )


def _codes(header: Header) -> dict[str, Any]:
    """Return network, station, location and channel as keyword arguments of `Series`: SEED codes
    from a comment, otherwise codes from the lines of text."""
    if codes := header.match(_CODES):
        location = codes[4].strip("-")
        return {"station": codes[1], "channel": codes[2], "network": codes[3], "location": location}
    station, channel = header.match(_STATION), header.match(_CHANNEL)
    station_codes = {"network": station[1], "station": station[2]} if station else {}
    return station_codes | (
        {"location": code(channel[1]), "channel": code(channel[2]).upper()} if channel else {}
    )
