"""Files of the California Strong Motion Instrumentation Program: volumes 1 and 2, one channel or
several a file.

For each channel lines of text, 100 integers (16I5) and reals (8F10.3): 50 in volume 1 and 100 in
volume 2. Volume 2 has acceleration, velocity and displacement, each after a line that tells number,
step and units. Volume 1 has accelerations after such a line, or pairs of time and acceleration,
10F7.3 (Shakal and Huang, CDMG report OSMS 85-03, 1985). Headers and pairs of volume 1 are also
those of USC: both descend from the California Institute of Technology's "Blue Book" tapes (Hudson
et al., EERL 69-20, 1969).
"""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import (
    COUNT,
    NUMBER,
    Lines,
    equal_steps,
    finest_step,
    recognizes,
)
from tdint.ground_motion.formats.series import (
    Series,
    by_parts,
    code,
    first_match,
    header_field,
    moment,
    motion_scale,
    required_units,
    stated_peak,
)
from tdint.ground_motion.miniseed_checks import PEAK, Statement, compare, last_place

REAL_WIDTH = 10  # letters of a number of the header
REALS = 50  # in the header of volume 1

_INTEGERS = re.compile(r"\s*-?\d[-\d\s]{60,}")
_LAST_INTEGERS = re.compile(r"[-\d\s]+")
_POINTS = re.compile(rf"\bNO\. OF POINTS\s*=\s*({COUNT})\b", re.IGNORECASE)
_UNITS = re.compile(r"\bSEC AND\s+([A-Z/^0-9]+)", re.IGNORECASE)
_PAIR_WIDTH = 7  # letters of a time or of its value

_SLACK = 2e-3
"""Part of the duration by which times on film may be off equal steps: the drive of the film was not
even."""


def text_header(lines: Lines) -> list[str]:
    """A channel's lines of text; the integers after them, of which nothing is needed, are passed
    over."""
    texts = lines.take_until(_INTEGERS.fullmatch, "header of integers")
    while (line := lines.peek()) is not None and _LAST_INTEGERS.fullmatch(line):
        lines.take()
    return texts


def read_pairs(lines: Lines, texts: list[str]) -> Series:
    """Read the pairs of time and acceleration of a channel.

    At equal steps the samples are kept as they are. Where the times are off equal steps by more
    than their rounding, as those of a film may be, the motion is linear between the file's own
    times, and sampled so finely that it stays the same: at the last decimal of the times, on which
    all of them lie.

    Raises
    ------
    RecordError
        They are cut off, in no unit of acceleration, or too far from equal steps.
    """
    points, units = first_match(_POINTS, texts), first_match(_UNITS, texts)
    if not points:
        raise RecordError("its header does not give the number of points")
    pairs = lines.numbers(2 * int(points[1]), _PAIR_WIDTH)
    mean, departure = equal_steps(pairs[::2], _SLACK)
    samples, dt = pairs[1::2].copy(), mean
    if departure:
        times = pairs[::2] - pairs[0]
        dt = finest_step(pairs[::2], mean)
        samples = np.interp(dt * np.arange(round(times[-1] / dt) + 1), times, samples)
        warnings.warn(
            f"the times in the file are up to {departure:.2g} s off equal steps of {mean:.6g} s: "
            f"the motion is linear between the file's own times, sampled at {dt:.6g} s",
            stacklevel=2,
        )
    return Series(samples, dt, required_units(units[1]) if units else "")


_TITLE = re.compile(r"\s*(UN)?CORRECTED ACCELEROGRAM", re.IGNORECASE)
_CHANNEL = re.compile(
    r"^\s*CHAN\w*\.?\s+(\w+)\s*:\s*(.*?)\s*(?:\bDEG\w*\s*)?(?:\(STA\s+CHN.*|LOCATION.*)?$",
    re.IGNORECASE,
)
_STATION = re.compile(r"^\s*STATION NO\.?\s*(\w+)", re.IGNORECASE)
_START = re.compile(
    r"\b(?:TRIGGER|START) "
    r"TIME:\s*(\d+)/(\d+)/(\d+),?\s*(\d+):(\d+):(\d+\.?\d*)\s*(UTC|GMT|PST|PDT)\b",
    re.IGNORECASE,
)
_EVENT = re.compile(r"^\s*(\S.*?)\s+EARTHQUAKE\s*$", re.IGNORECASE)
_ORIGIN = re.compile(
    r"\bORIGIN(?:\s*\([^)]*\))?\s*:\s*(\d+/\d+/\d+,?\s+\d+:\d\d:\d\d(?:\.\d*)?\s*(?:UTC|GMT|P[SD]T))",
    re.IGNORECASE,
)
_DATE = re.compile(
    r"^\s*((?:\d{1,2}\s+[A-Z]{3,9}|[A-Z]{3,9}\s+\d{1,2}),?\s+\d{4}"
    r"(?:[\s,-]+\d{1,2}:?\d\d\s+(?:UTC|GMT|P[SD]T))?)",
    re.IGNORECASE,
)
"""Origin time and, if that is unknown, date of the event, as they are written."""
_ZONES = {"UTC": 0.0, "GMT": 0.0, "PST": -8.0, "PDT": -7.0}
_ERA = 50
"""Years of two digits from here on are in the last century."""

_EQUAL = re.compile(
    rf"^\s*({COUNT})\s+\w+ points at\s+({NUMBER})\s+pts/sec in units of\s+([A-Z/^0-9]+)",
    re.IGNORECASE,
)
_BLOCK = re.compile(
    rf"^\s*({COUNT})\s+points of\s+(accel|veloc|displ)\w*\s+data equally spaced "
    rf"at\s+({NUMBER})\s+sec.*?"
    r"(?:UNITS?\s*:?|IN)\s*\(?\s*([A-Z/^0-9]+)",
    re.IGNORECASE,
)
_KINDS = re.compile(r"\bPOINTS OF .*-CORRECTED (ACCEL, VELOC AND DISPL) DATA", re.IGNORECASE)
_FORMAT = re.compile(r"\(\s*\d*\s*[FEG](\d{1,3})", re.IGNORECASE)
_PEAK = (
    re.compile(rf"\bMAX\s*=\s*({NUMBER})\s*([A-Z/^0-9]+)", re.IGNORECASE),
    re.compile(rf"\bPEAK ACCELERATION\s*=\s*({NUMBER})\s*([A-Z/^0-9]+)", re.IGNORECASE),
)
"""In volume 1, and in volume 2, which tells the uncorrected one as well."""

_QUANTITIES = {"VELOC": "velocity", "DISPL": "displacement"}
_OTHER_PEAK = {
    kind: re.compile(rf"\bPEAK\s+{name}\s*=\s*({NUMBER})\s*CM", re.IGNORECASE)
    for kind, name in _QUANTITIES.items()
}
_REALS_VOLUME_2 = 100  # in its header
_END = "/&"


def is_csmip(file: Any, **_: Any) -> bool:
    """Whether a file begins with this format's title and soon names a channel."""
    return recognizes(
        file, lambda lines: _TITLE.match(lines[0]) and first_match(_CHANNEL, lines[1:25])
    )


@by_parts
def read_csmip(lines: Lines) -> list[Series]:
    """Read the accelerations of a CSMIP file; see `tdint.ground_motion.formats`.

    Raises
    ------
    RecordError
        It is cut off, or what it holds is not what its headers announce.
    """
    place = lines.number + 1
    texts = text_header(lines)
    title = first_match(_TITLE, texts[:1])
    if not title:
        raise RecordError(f"a channel's header should begin in line {place}")
    series = _volume_1(lines, texts) if title[1] else _volume_2(lines, texts)
    if (line := lines.peek()) is not None and line.lstrip().startswith(_END):
        lines.take()
    stated = first_match(_PEAK[0 if title[1] else 1], texts)
    peak = stated_peak(stated[1], stated[2], series.units or "") if stated else None

    # The first sample is that of the trigger for recorders on film, which started with it.
    started = None
    if clock := first_match(_START, texts):
        month, day, year, hour, minute, second = map(float, clock.groups()[:6])
        if year < 100:
            year += 1900 if year >= _ERA else 2000
        started = moment(year, month, day, hour, minute, second, _ZONES[clock[7].upper()])
    return [replace(series, **_codes(texts), peak=peak, start=started, event=_event(texts))]


def _volume_1(lines: Lines, texts: list[str]) -> Series:
    lines.numbers(REALS, REAL_WIDTH)
    line = lines.peek() or ""
    if (block := _BLOCK.match(line)) and block[2].upper() == "ACCEL":
        lines.take()
        return Series(
            lines.numbers(int(block[1]), _width(line)), float(block[3]), required_units(block[4])
        )
    # Older files have pairs of time and acceleration, later ones equal steps.
    if not (equal := _EQUAL.match(line)):
        return read_pairs(lines, texts)
    lines.take()
    samples = lines.numbers(int(equal[1]), _width(line))
    rate = float(equal[2])
    if not rate > 0.0:
        raise RecordError(f"line {lines.number} gives a sampling rate of {rate:g}")
    return Series(samples, 1.0 / rate, required_units(equal[3]))


def _volume_2(lines: Lines, texts: list[str]) -> Series:
    """The acceleration, and the peaks of velocity and displacement."""
    lines.numbers(_REALS_VOLUME_2, REAL_WIDTH)
    blocks = {}
    while (line := lines.peek()) is not None and (block := _BLOCK.match(line)):
        lines.take()
        blocks[block[2].upper()] = block, lines.numbers(int(block[1]), _width(line))
    expected = ("ACCEL", "VELOC", "DISPL") if first_match(_KINDS, texts) else ("ACCEL",)
    for kind in expected:
        if kind not in blocks:
            raise RecordError(
                f"the file is cut off or damaged: after line {lines.number} there is no block of "
                f"{kind}"
            )
    block, samples = blocks["ACCEL"]
    others = [
        _peak_of(kind, *blocks[kind], texts) if kind in blocks else None
        for kind in ("VELOC", "DISPL")
    ]
    return Series(samples, float(block[3]), required_units(block[4]), pgv=others[0], pgd=others[1])


def _peak_of(
    kind: str, block: re.Match[str], samples: NDArray[np.float64], texts: list[str]
) -> float | None:
    """Peak of a block of velocity or displacement, SI units; None if its units are unknown.

    Raises
    ------
    RecordError
        The header states another one.
    """
    scale = motion_scale(block[4], _QUANTITIES[kind])
    peak = float(np.max(np.abs(samples), initial=0.0))
    stated = first_match(_OTHER_PEAK[kind], texts)
    if stated:
        rounding = last_place(stated[1]) + 1e-9 * peak
        name = f"{PEAK} {_QUANTITIES[kind]}"
        compare([Statement(name, abs(float(stated[1])), peak, rounding, block[4], measured=True)])
    return peak * scale if scale else None


def _width(line: str) -> int:
    match = _FORMAT.search(line)
    return int(match[1]) or REAL_WIDTH if match else REAL_WIDTH


def _event(texts: list[str]) -> str:
    """Return the name of the event and its origin time or date, as far as the lines of text state
    them."""
    name = header_field(_EVENT, texts).strip()
    stated = first_match(_ORIGIN, texts) or (first_match(_DATE, texts) if name else None)
    moment = " ".join(stated[1].replace(" - ", " ").split()) if stated else ""
    return f"{name} {moment}".strip()


def _codes(texts: list[str]) -> dict[str, Any]:
    """The channel's number as location code, because several channels may have one azimuth."""
    channel = first_match(_CHANNEL, texts)
    named = {"location": channel[1], "channel": code(channel[2]).upper()} if channel else {}
    return {"station": header_field(_STATION, texts), **named}
