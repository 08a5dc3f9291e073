"""Volume 1 files of the Building and Housing Research Center of Iran (BHRC, ISMN): three successive
components.

Each component consists of lines of text, 100 integers (sixteen per line), 50 reals (eight per line)
and accelerations at a constant time step. The header states the time step as number of points and
duration, and as samples per second in the ninth real (BHRC, ISMN volume 1 format). The header lines
are cut off after 70 characters, so the last numbers in these lines are incomplete.
"""

from __future__ import annotations

import re

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import (
    COUNT,
    NUMBER,
    Lines,
    is_row_of_numbers,
    recognizer,
    row_of_numbers,
)
from tdint.ground_motion.formats.series import Header, Series, by_parts, required_units
from tdint.ground_motion.miniseed_checks import SAMPLES, STEP, Statement, compare
from tdint.number_parsing import any_case

_TITLE = r"^\s*\*\s*VOL1\w*\s+FILE:"
_COMPONENT = r"^\s*COMP\s+([A-Z])(\d*)"
_AZIMUTHS = r"\bAzimuth\s+((?:[A-Z]\s+\d{1,3}\s*)+)"
_AZIMUTH = any_case(r"([A-Z])\s+(\d{1,3})")
_STATION = r"^\s*(\S.*?)\s+(?-i:Station)\b"
_ORIGIN = r"^\s*Origin Time\s*:\s*(\d{4}/\d+/\d+\s+\d+:\d\d(?::\d\d)?)"
"""Pattern of the origin time of the earthquake, UTC."""
_POINTS = rf"\bNO\. OF POINTS\s*=\s*({COUNT})\s+DURATION\s*=\s*({NUMBER})"
_UNITS = r"\bUNITS ARE SECONDS AND\s+([A-Z/^0-9]+)"
_ROW = re.compile(r"\s*-?\d+(?:\s+-?\d+){9,}\s*")
_HEADER_LINES = 7
"""Number of lines of integers and of reals."""

_COUNT, _RATE = (1, 11), (1, 0)
"""Line and index of the number of points in the integers, and of the samples per second in the
reals."""

_INTEGER_WIDTH, _REAL_WIDTH = 5, 13
"""Characters of an integer (14I5) and of a real in the header. Numbers may fill their fields:
`015616` is 0 and 15616."""

_END = "/&"  # start of the line after the samples of a component


@recognizer
def is_bhrc(lines: list[str]) -> object:
    """Return True if a file starts with the title of a BHRC file and names a component within 20
    lines."""
    return Header(lines[:1]).match(_TITLE) and Header(lines[1:20]).match(_COMPONENT)


@by_parts
def read_bhrc(lines: Lines) -> list[Series]:
    """Read and return the component that starts at the next line, in a list of length 1."""
    # The header starts with lines of text, which end at the first row of integers.
    first_line = lines.number + 1
    header = Header(lines.take_until(_ROW.fullmatch, "header of integers"))
    if not header.match(_TITLE):
        raise RecordError(f"the header of a component must start in line {first_line}")
    points, units, component = map(header.match, (_POINTS, _UNITS, _COMPONENT))
    if not (points and units and component and int(points[1])):
        raise RecordError(
            f"the header that starts in line {first_line} must state points, units and component"
        )
    stated = _header_number(lines, *_COUNT, _INTEGER_WIDTH)
    rate = _header_number(lines, *_RATE, _REAL_WIDTH)

    # The text and the numbers of the header must agree. The duration is rounded, so the time step
    # follows from the sampling rate if the header states the rate.
    count = int(points[1])
    dt = float(points[2]) / count
    statements = [Statement(SAMPLES, stated, count)]
    if rate > 0.0:
        # The tolerance permits an error of a single sampling interval in the duration, which
        # changes dt by dt / count.
        statements.append(Statement(STEP, 1.0 / rate, dt, 1.01 * dt / count, "s"))
    compared = compare(statements)
    samples = lines.numbers(count)
    if (line := lines.peek()) is None or not line.lstrip().startswith(_END):
        raise RecordError(
            f"the file is cut off or corrupt: end-of-data line not found after line {lines.number}"
        )
    lines.take()

    # The name of a horizontal component is its azimuth in degrees. The name of the vertical
    # component is its letter.
    letter = component[1].upper()
    azimuths = _AZIMUTH.findall(header.field(_AZIMUTHS))
    directions = {name.upper(): degrees for name, degrees in azimuths}
    return [
        Series(
            samples,
            1.0 / rate if rate > 0.0 else dt,
            required_units(units[1]),
            channel=directions.get(letter, letter),
            station=header.code(_STATION),
            compared=compared,
            event=header.field(_ORIGIN),
        )
    ]


def _header_number(lines: Lines, row: int, index: int, width: int) -> float:
    """Read the seven lines of integers or of reals of a header and return one of the numbers, by
    line and position from 0.

    Fields have a fixed width and are counted from the start of the line, because the last field of
    a line may be cut off. RecordError is raised if a line contains other text or too few numbers.
    """
    rows = [lines.take() for _ in range(_HEADER_LINES)]
    field = rows[row][index * width : (index + 1) * width]
    if not (all(map(is_row_of_numbers, rows)) and is_row_of_numbers(field)):
        raise RecordError(
            f"the header before line {lines.number} must contain only numbers, and at least "
            f"{index + 1} in its row {row + 1}"
        )
    return row_of_numbers(field)[0]
