"""Files of the California Strong Motion Instrumentation Program: volumes 1 and 2, one or more
channels per file.

Each channel consists of lines of text, 100 integers (16I5) and reals (8F10.3). Volume 1 has 50
reals and volume 2 has 100. Volume 2 contains acceleration, velocity and displacement, each after a
line that states their number, time step and units. Volume 1 contains accelerations after such a
line, or pairs of time and acceleration, 10F7.3 (Shakal and Huang, CDMG report OSMS 85-03, 1985).
USC files have the same headers and pairs as volume 1, because both formats are derived from the
"Blue Book" tapes of the California Institute of Technology (Hudson et al., EERL 69-20, 1969).
"""

from __future__ import annotations

import re
from dataclasses import replace

from tdint.arrays import max_absolute
from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import (
    COUNT,
    NUMBER,
    Lines,
    at_equal_steps,
    recognizer,
)
from tdint.ground_motion.formats.series import (
    Header,
    Series,
    by_parts,
    code,
    largest_value,
    moment,
    required_units,
)
from tdint.ground_motion.miniseed_checks import PEAK, Statement, compare, last_place
from tdint.number_parsing import any_case

REAL_WIDTH = 10  # characters of a real number of the header
REALS = 50  # number of real numbers in the header of volume 1

_INTEGERS = re.compile(r"\s*-?\d[-\d\s]{60,}")
_LAST_INTEGERS = r"[-\d\s]+"
POINTS = rf"\bNO\. OF POINTS\s*=\s*({COUNT})\b"
_UNITS = r"\bSEC AND\s+([A-Z/^0-9]+)"
_PAIR_WIDTH = 7  # characters of a time or an acceleration

_MAX_DEPARTURE = 2e-3
"""Fraction of the duration; permitted departure of times from equal steps, because the film drives
of recorders were uneven."""


def text_header(lines: Lines) -> Header:
    """Read and return the lines of text at the start of a channel, and skip the lines of integers
    after them, which are not used.

    Raises
    ------
    RecordError
        No line of integers follows.
    """
    header = Header(lines.take_until(_INTEGERS.fullmatch, "header of integers"))
    while (line := lines.peek()) is not None and re.fullmatch(_LAST_INTEGERS, line):
        lines.take()
    return header


def read_pairs(lines: Lines, header: Header) -> Series:
    """Read the pairs of time and acceleration of a channel.

    Times of records on film may depart from equal steps by more than their rounding. The motion is
    then interpolated linearly (`at_equal_steps`).

    Parameters
    ----------
    lines : Lines
        Lines of the file; the next line is the first row of pairs.

    Raises
    ------
    RecordError
        The pairs are cut off, not in a unit of acceleration, or not in equal steps.
    """
    points, units = header.field(POINTS), header.field(_UNITS)
    if not points:
        raise RecordError("the header of the file does not state the number of points")
    # Times and accelerations alternate.
    pairs = lines.numbers(2 * int(points), _PAIR_WIDTH)
    samples, dt = at_equal_steps(pairs[::2], pairs[1::2], _MAX_DEPARTURE)
    return Series(samples, dt, required_units(units) if units else "")


_TITLE = r"^\s*(UN)?CORRECTED ACCELEROGRAM"
CHANNEL = r"^\s*CHAN\w*\.?\s+(\w+)\s*:\s*(.*?)\s*(?:\bDEG\w*\s*)?(?:\(STA\s+CHN.*|LOCATION.*)?$"
_STATION = r"^\s*STATION NO\.?\s*(\w+)"
_START = (
    r"\b(?:TRIGGER|START) "
    r"TIME:\s*(\d+)/(\d+)/(\d+),?\s*(\d+):(\d+):(\d+\.?\d*)\s*(UTC|GMT|PST|PDT)\b"
)
_EVENT = r"^\s*(\S.*?)\s+EARTHQUAKE\s*$"
_ORIGIN = (
    r"\bORIGIN(?:\s*\([^)]*\))?\s*:\s*(\d+/\d+/\d+,?\s+\d+:\d\d:\d\d(?:\.\d*)?\s*"
    r"(?:UTC|GMT|P[SD]T))"
)
_DATE = (
    r"^\s*((?:\d{1,2}\s+[A-Z]{3,9}|[A-Z]{3,9}\s+\d{1,2}),?\s+\d{4}"
    r"(?:[\s,-]+\d{1,2}:?\d\d\s+(?:UTC|GMT|P[SD]T))?)"
)
"""Pattern of the date of the event, with its time if stated; used if the origin time is unknown."""
_ZONES = {"UTC": 0.0, "GMT": 0.0, "PST": -8.0, "PDT": -7.0}
"""Offsets of time zones from UTC, hours."""

_FIRST_YEAR_OF_1900S = 50
"""Two-digit years from this value on are years of the 20th century."""

_EQUAL = any_case(
    rf"^\s*({COUNT})\s+\w+ points at\s+({NUMBER})\s+pts/sec in units of\s+([A-Z/^0-9]+)"
)
"""Pattern of the line before samples at equal steps in volume 1; its groups are the number of
samples, the sampling rate (1/s) and the units."""
_BLOCK = any_case(
    rf"^\s*({COUNT})\s+points of\s+(accel|veloc|displ)\w*\s+data equally spaced "
    rf"at\s+({NUMBER})\s+sec.*?"
    r"(?:UNITS?\s*:?|IN)\s*\(?\s*([A-Z/^0-9]+)"
)
"""Pattern of the line before a block of samples; its groups are the number of samples, the quantity
(ACCEL, VELOC or DISPL), the sampling interval (s) and the units."""

_THREE_BLOCKS = r"\bPOINTS OF .*-CORRECTED (ACCEL, VELOC AND DISPL) DATA"
"""Pattern of the text of a channel with blocks of all three quantities."""

_FORMAT = any_case(r"\(\s*\d*\s*[FEG](\d{1,3})")
_PEAK = (
    rf"\bMAX\s*=\s*({NUMBER})\s*([A-Z/^0-9]+)",
    rf"\bPEAK ACCELERATION\s*=\s*({NUMBER})\s*([A-Z/^0-9]+)",
)
"""Patterns of the peak in volume 1 and in volume 2, which also states the uncorrected peak."""

_QUANTITIES = {"VELOC": "velocity", "DISPL": "displacement"}
"""Quantities by the words in the lines before blocks of samples of volume 2."""

_OTHER_PEAK = {
    word: rf"\bPEAK\s+{quantity}\s*=\s*({NUMBER})\s*CM" for word, quantity in _QUANTITIES.items()
}
"""Patterns of the peak velocity and the peak displacement in the text of a channel, by the words of
`_QUANTITIES`."""
_REALS_VOLUME_2 = 100  # number of real numbers in the header of volume 2
_END = "/&"  # start of the line after the last block of a channel


@recognizer
def is_csmip(lines: list[str]) -> object:
    """Return True if a file starts with the title of a CSMIP file and names a channel within 25
    lines."""
    return Header(lines[:1]).match(_TITLE) and Header(lines[1:25]).match(CHANNEL)


@by_parts
def read_csmip(lines: Lines) -> list[Series]:
    """Read and return the acceleration of the channel that starts at the next line, in a list of
    length 1."""
    first_line = lines.number + 1
    header = text_header(lines)
    title = Header(header[:1]).match(_TITLE)
    if not title:
        raise RecordError(f"the header of a channel must start in line {first_line}")
    series = _volume_1(lines, header) if title[1] else _volume_2(lines, header)
    if (line := lines.peek()) is not None and line.lstrip().startswith(_END):
        lines.take()
    # Group 1 of the title is UN for uncorrected, which is volume 1.
    peak = header.peak(_PEAK[0 if title[1] else 1], series.units)

    # Film recorders started at the trigger, so the trigger time is the time of the first sample.
    started = None
    if clock := header.match(_START):
        month, day, year, hour, minute, second = map(float, clock.groups()[:6])
        if year < 100:
            year += 1900 if year >= _FIRST_YEAR_OF_1900S else 2000
        started = moment(year, month, day, hour, minute, second, _ZONES[clock[7].upper()])
    name = header.field(_EVENT).strip()
    stated = header.field(_ORIGIN) or (header.field(_DATE) if name else "")
    date_text = " ".join(stated.replace(" - ", " ").split())
    # The channel number is the location code, because several channels may have the same azimuth.
    channel = header.match(CHANNEL)
    return [
        replace(
            series,
            station=header.field(_STATION),
            location=channel[1] if channel else "",
            channel=code(channel[2]).upper() if channel else "",
            peak=peak,
            start=started,
            event=f"{name} {date_text}".strip(),
        )
    ]


def _volume_1(lines: Lines, header: Header) -> Series:
    """Read the acceleration of a channel of volume 1 from the lines after the text header.
    RecordError is raised if the samples are cut off, or their sampling rate or units are invalid.
    """
    lines.numbers(REALS, REAL_WIDTH)  # the real numbers of the header are not used
    line = lines.peek() or ""
    if (block := _BLOCK.match(line)) and block[2].upper() == "ACCEL":
        lines.take()
        return Series(
            lines.numbers(int(block[1]), _width(line)), float(block[3]), required_units(block[4])
        )
    if not (equal := _EQUAL.match(line)):
        return read_pairs(lines, header)
    lines.take()
    samples = lines.numbers(int(equal[1]), _width(line))
    rate = float(equal[2])
    if not rate > 0.0:
        raise RecordError(
            f"the sampling rate must be positive, but line {lines.number} states {rate:g}"
        )
    return Series(samples, 1.0 / rate, required_units(equal[3]))


def _volume_2(lines: Lines, header: Header) -> Series:
    """Read the acceleration and the peaks of velocity and displacement of a channel of volume 2
    from the lines after the text header.

    RecordError is raised if a block of samples is missing or cut off, a peak contradicts the
    header, or the units of the acceleration are invalid.
    """
    lines.numbers(_REALS_VOLUME_2, REAL_WIDTH)  # the real numbers of the header are not used
    blocks = {}  # match of the first line, and samples, of each block
    while (line := lines.peek()) is not None and (block := _BLOCK.match(line)):
        lines.take()
        blocks[block[2].upper()] = block, lines.numbers(int(block[1]), _width(line))
    expected = ("ACCEL", "VELOC", "DISPL") if header.match(_THREE_BLOCKS) else ("ACCEL",)
    for word in expected:
        if word not in blocks:
            raise RecordError(
                f"the file is cut off or corrupt: no block of {word} found after line "
                f"{lines.number}"
            )
    peaks: dict[str, float | None] = {}
    for word, quantity in _QUANTITIES.items():
        if word not in blocks:
            continue
        block, samples = blocks[word]
        if stated := header.field(_OTHER_PEAK[word]):
            peak = max_absolute(samples)
            rounding, name = last_place(stated) + 1e-9 * peak, f"{PEAK} {quantity}"
            compare([Statement(name, abs(float(stated)), peak, rounding, block[4], measured=True)])
        peaks[quantity] = largest_value(samples, block[4], quantity)
    pgv, pgd = peaks.get("velocity"), peaks.get("displacement")
    block, samples = blocks["ACCEL"]
    return Series(samples, float(block[3]), required_units(block[4]), pgv=pgv, pgd=pgd)


def _width(line: str) -> int:
    """Return the characters per number of a block, from the Fortran format in its first line;
    `REAL_WIDTH` if the line states no format or a width of 0."""
    match = _FORMAT.search(line)
    return int(match[1]) or REAL_WIDTH if match else REAL_WIDTH
