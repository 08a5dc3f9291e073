"""COSMOS files, versions 1.xx: volumes 0, 1 and 2, one or several channels a file.

For each channel lines of text, integers, reals and comments, the number of each announced, then
blocks of values, each after a line that tells their number, kind, units and Fortran format (COSMOS,
Strong motion data format, version 1.20, 2001; units in its table 2).
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import COUNT, NUMBER, Lines, recognizes
from tdint.ground_motion.formats.series import (
    Series,
    by_parts,
    code,
    first_match,
    moment,
    motion_scale,
    motion_units,
    stated_peak,
)
from tdint.units import parse_units
from tdint.written_numbers import how_many

_TITLE = re.compile(r"\(Format v0?1\.\d+ with\s+(\d{1,3}) text lines\)", re.IGNORECASE)
_INTEGERS = re.compile(rf"^\s*({COUNT})\s+Integer-header values follow on", re.IGNORECASE)
_REALS = re.compile(rf"^\s*({COUNT})\s+Real-header values follow on", re.IGNORECASE)
_COMMENTS = re.compile(rf"^\s*({COUNT})\s+Comment line\(?s?\)? follow", re.IGNORECASE)
_BLOCK = re.compile(
    rf"^\s*({COUNT})\s+([a-z. ]+?)\s+(?:pts|points)\b(?:.*?approx\s*({COUNT})\s*secs)?"
    r".*?units\s*=\s*([^,(]*)(?:\(\s*0*(\d+)\s*\))?",
    re.IGNORECASE,
)
_FORMAT = re.compile(r"Format\s*=\s*\(\s*\d*\s*[IFEDG](\d{1,3})", re.IGNORECASE)
_END = re.compile(r"\s*(?:/&|End-of-data)", re.IGNORECASE)

_UNKNOWN = re.compile(rf"unknown/unspecified:\s*{NUMBER}\s*,?\s*({NUMBER})", re.IGNORECASE)
_STATION = re.compile(r"^\s*Stat\w*\s+No\b.*?\bCode:\s*(\w+)-(\w+)", re.IGNORECASE)
_CHANNEL = re.compile(
    r"^\s*Sta\s+Cha\w*:?\s*(\S+?)\s*:\s*([^(]*?)\s*(?:deg\w*\s*)?(?:\(|Location|$)", re.IGNORECASE
)
_CODES = re.compile(r"<SCNL>\s*(\w+)\.(\w+)\.(\w+)\.([-\w]*)", re.IGNORECASE)
_UTC = re.compile(r"^\s*Rcrd start time.*\b(?:UTC|GMT)\b", re.IGNORECASE)
_PEAK = re.compile(rf"^\s*Processed.*\bMax\s*=\s*({NUMBER})\s*([\w/^]+)", re.IGNORECASE)

_EVENT = re.compile(r"^\s*Record of\s+(?:the\s+)?(.*?)\s+Earthquake\b", re.IGNORECASE)
_ORIGIN = re.compile(
    r"^\s*Origin:\s*(\d+/\d+/\d+),?\s+(\d+:\d\d:\d\d)(?:\.\d*)?\s*(?:UTC|GMT)\b", re.IGNORECASE
)

_YEAR, _MONTH, _DAY, _HOUR, _MINUTE = 39, 41, 42, 43, 44
_SECOND, _STEP = 29, 61
"""Places among the integers and among the reals; the step is in ms."""

_UNITS = {
    "2": "g",
    "4": "cm/s^2",
    "7": "0.0254 m/s^2",
    "10": "gal",
    "11": "0.001 g",
    "12": "1e-6 g",
}
_COUNTS = "50"
_OTHERS = ("velocity", "displacement")
_OTHER_UNITS = {"5": "cm/s", "6": "cm", "8": "in/s", "9": "in"}

_APPROXIMATE = 0.05
"""By how much the duration in words may be off, beside one second."""


def is_cosmos(file: Any, **_: Any) -> bool:
    """Whether the first line names this format and its version."""
    return recognizes(file, lambda lines: _TITLE.search(lines[0]))


@by_parts
def read_cosmos(lines: Lines) -> list[Series]:
    """Read the accelerations of a COSMOS file; see `tdint.ground_motion.formats`.

    Counts of a recorder (volume 0) come without units.

    Raises
    ------
    RecordError
        It is cut off, what it holds is not what its headers announce, or it holds no acceleration.
    """
    title = _TITLE.search(lines.take())
    if not title:
        raise RecordError(f"a channel's header should begin in line {lines.number}")
    texts = [lines.take() for _ in range(int(title[1]) - 1)]
    integers = _header_values(_INTEGERS, lines)
    reals = _header_values(_REALS, lines)
    texts += [lines.take() for _ in range(int(_announced(_COMMENTS, lines)[1]))]
    series: list[Series] = []
    peaks: dict[str, float] = {}
    others: list[tuple[NDArray[np.float64], re.Match[str]]] = []
    while (line := lines.peek()) is not None and (block := _BLOCK.match(line)):
        lines.take()
        samples = lines.numbers(int(block[1]), _width(line))
        if block[2].lower().startswith(("accel", "raw accel")):
            series.append(_series(samples, block, texts, integers, reals))
        elif (kind := block[2].lower().split()[0]) in _OTHERS and samples.size:
            units = _OTHER_UNITS.get(block[5] or "") or block[4]
            others.append((samples, block))
            if scale := motion_scale(units, kind):
                peaks[kind] = scale * float(np.max(np.abs(samples)))
    if line is None or not _END.match(line):
        raise RecordError(f"after line {lines.number} the line with the end of the data is missing")
    lines.take()
    if not series and others:  # A channel that has a velocity or a displacement only.
        return [_series(*others[0], texts, integers, reals)]
    return [
        replace(part, pgv=peaks.get("velocity"), pgd=peaks.get("displacement")) for part in series
    ]


def _announced(pattern: re.Pattern[str], lines: Lines) -> re.Match[str]:
    """What the next line, which announces others, says."""
    match = pattern.match(lines.take())
    if not match:
        raise RecordError(
            f"line {lines.number} should tell the number of header lines or values that follow"
        )
    return match


def _header_values(pattern: re.Pattern[str], lines: Lines) -> list[float]:
    match = _announced(pattern, lines)
    values: list[float] = lines.numbers(int(match[1]), _width(match.string)).tolist()
    if len(values) <= _STEP:
        raise RecordError(
            f"the header that ends with line {lines.number} has only "
            f"{how_many(len(values), 'value')}"
        )
    return values


def _width(line: str) -> int | None:
    match = _FORMAT.search(line)
    return int(match[1]) or None if match else None


def _series(
    samples: NDArray[np.float64],
    block: re.Match[str],
    texts: list[str],
    integers: list[float],
    reals: list[float],
) -> Series:
    """A block of samples with what the channel's header tells of it."""
    # The step, against the duration that the block's own line tells.
    match = first_match(_UNKNOWN, texts)
    unknown = float(match[1]) if match else -999.0
    if reals[_STEP] == unknown:
        raise RecordError("its header does not give the sampling interval")
    dt = reals[_STEP] / 1000.0
    if block[3] and abs(samples.size * dt - int(block[3])) > 1.0 + _APPROXIMATE * int(block[3]):
        raise RecordError(
            f"{samples.size} samples at the header's {dt:g} s are not the {block[3]} s that it "
            "tells"
        )

    # The unit by its name or by its number in the format's table; a recorder's counts have none.
    kind = block[2].lower().split()[0]
    quantity = kind if kind in _OTHERS else "acceleration"
    units = motion_units(block[4]) or _UNITS.get(block[5] or "") or _OTHER_UNITS.get(block[5] or "")
    if units and parse_units(units).quantity != quantity:
        units = None
    counts = units is None and (block[5] == _COUNTS or block[4].strip().lower().startswith("count"))
    if units is None and not counts:
        raise RecordError(
            f"its header gives the samples in {block[4].strip()!r}, which is no unit of {quantity}"
        )
    missing = 0 if counts else int(np.count_nonzero(samples == unknown))
    if missing:
        raise RecordError(f"{how_many(missing, 'sample')} marked as unknown ({unknown:g})")
    if counts and (np.any(np.abs(samples) > np.iinfo(np.int32).max) or np.any(samples % 1.0)):
        raise RecordError(
            "its header says that the samples are counts, but they are not integers of 32 bits"
        )

    # The time of the first sample, if it is known and in UTC.
    year, month, day, hour, minute = (
        integers[place] for place in (_YEAR, _MONTH, _DAY, _HOUR, _MINUTE)
    )
    second = reals[_SECOND]
    is_utc = unknown not in (year, month, day, hour, minute, second) and first_match(_UTC, texts)
    stated = first_match(_PEAK, texts)
    return Series(
        samples.astype(np.int32) if counts else samples,
        dt,
        units,
        **_codes(texts),
        start=moment(year, month, day, hour, minute, second) if is_utc else None,
        event=_event(texts),
        peak=stated_peak(stated[1], stated[2], units) if stated and units else None,
    )


def _event(texts: list[str]) -> str:
    """Return the name and the origin time (UTC) of the event, as far as the lines of text state
    them."""
    named, origin = first_match(_EVENT, texts), first_match(_ORIGIN, texts)
    moment = f"{origin[1]} {origin[2]}" if origin else ""
    return " ".join(f"{named[1] if named else ''} {moment}".split())


def _codes(texts: list[str]) -> dict[str, Any]:
    """Codes of the channel: those of SEED where a comment gives them, else what the lines of text
    say."""
    if codes := first_match(_CODES, texts):
        location = codes[4].strip("-")
        return {"station": codes[1], "channel": codes[2], "network": codes[3], "location": location}
    station, channel = first_match(_STATION, texts), first_match(_CHANNEL, texts)
    named = {"network": station[1], "station": station[2]} if station else {}
    return named | (
        {"location": code(channel[1]), "channel": code(channel[2]).upper()} if channel else {}
    )
