"""Volume 1 files of Iran's Building and Housing Research Center (BHRC, ISMN): three components, one
after another.

For each component lines of text, 100 integers, sixteen a line, 50 reals, eight a line, and the
accelerations at one step that the header gives as number of points and duration, and as samples per
second in the ninth real (BHRC, ISMN volume 1 format). The lines of the header are cut off at 70
characters, so that the last numbers in them are not whole.
"""

from __future__ import annotations

import re
from typing import Any

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import (
    COUNT,
    NUMBER,
    Lines,
    is_row_of_numbers,
    recognizes,
    row_of_numbers,
)
from tdint.ground_motion.formats.series import (
    Series,
    by_parts,
    code,
    first_match,
    header_field,
    required_units,
)
from tdint.ground_motion.miniseed_checks import SAMPLES, STEP, Statement, compare

_TITLE = re.compile(r"\s*\*\s*VOL1\w*\s+FILE:", re.IGNORECASE)
_COMPONENT = re.compile(r"^\s*COMP\s+([A-Z])(\d*)", re.IGNORECASE)
_AZIMUTHS = re.compile(r"\bAzimuth\s+((?:[A-Z]\s+\d{1,3}\s*)+)", re.IGNORECASE)
_AZIMUTH = re.compile(r"([A-Z])\s+(\d{1,3})", re.IGNORECASE)
_STATION = re.compile(r"^\s*(\S.*?)\s+Station\b")
_ORIGIN = re.compile(r"^\s*Origin Time\s*:\s*(\d{4}/\d+/\d+\s+\d+:\d\d(?::\d\d)?)", re.IGNORECASE)
"""Origin time of the earthquake, UTC."""
_POINTS = re.compile(
    rf"\bNO\. OF POINTS\s*=\s*({COUNT})\s+DURATION\s*=\s*({NUMBER})", re.IGNORECASE
)
_UNITS = re.compile(r"\bUNITS ARE SECONDS AND\s+([A-Z/^0-9]+)", re.IGNORECASE)
_ROW = re.compile(r"\s*-?\d+(?:\s+-?\d+){9,}\s*")
_HEADER_LINES = 7
"""Lines of integers, and of reals."""

_COUNT, _RATE = (1, 11), (1, 0)
"""Line and place of the number of points among the integers and of the samples per second among the
reals."""

_END = "/&"


def is_bhrc(file: Any, **_: Any) -> bool:
    """Whether a file begins with this format's title and soon names a component."""
    return recognizes(
        file, lambda lines: _TITLE.match(lines[0]) and first_match(_COMPONENT, lines[1:20])
    )


@by_parts
def read_bhrc(lines: Lines) -> list[Series]:
    """Read the components of a BHRC file; see `tdint.ground_motion.formats`.

    Raises
    ------
    RecordError
        It is cut off, or what it holds is not what its headers announce.
    """
    # The header in words, then the two of numbers.
    place = lines.number + 1
    texts = lines.take_until(_ROW.fullmatch, "header of integers")
    if not any(map(_TITLE.match, texts)):
        raise RecordError(f"a component's header should begin in line {place}")
    points, units, component = (
        first_match(pattern, texts) for pattern in (_POINTS, _UNITS, _COMPONENT)
    )
    if not (points and units and component and int(points[1])):
        raise RecordError(
            f"the header that begins in line {place} gives no points, units or component"
        )
    stated = _header_number(lines, *_COUNT)
    rate = _header_number(lines, *_RATE)

    # Words and numbers must agree; the duration is rounded, so that the rate, where it stands,
    # gives the step.
    count = int(points[1])
    dt = float(points[2]) / count
    statements = [Statement(SAMPLES, stated, count)]
    if rate > 0.0:
        statements.append(Statement(STEP, 1.0 / rate, dt, 1.01 * dt / count, "s"))
    compared = compare(statements)
    samples = lines.numbers(count)
    if (line := lines.peek()) is None or not line.lstrip().startswith(_END):
        raise RecordError(f"after line {lines.number} the line with the end of the data is missing")
    lines.take()

    # A horizontal component is named by its azimuth in degrees, the vertical one by its letter.
    letter = component[1].upper()
    azimuths = first_match(_AZIMUTHS, texts)
    directions = (
        {name.upper(): degrees for name, degrees in _AZIMUTH.findall(azimuths[1])}
        if azimuths
        else {}
    )
    return [
        Series(
            samples,
            1.0 / rate if rate > 0.0 else dt,
            required_units(units[1]),
            channel=directions.get(letter, letter),
            station=code(header_field(_STATION, texts)),
            compared=compared,
            event=header_field(_ORIGIN, texts),
        )
    ]


def _header_number(lines: Lines, row: int, place: int) -> float:
    """One of the numbers in the next seven lines."""
    rows = [lines.take() for _ in range(_HEADER_LINES)]
    numbers = row_of_numbers(rows[row]) if all(map(is_row_of_numbers, rows)) else []
    if len(numbers) <= place:
        raise RecordError(f"the header of numbers before line {lines.number} holds something else")
    return numbers[place]
