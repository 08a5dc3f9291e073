"""Text files of the China Strong Motion Networks Center (CSMNC), with a single component per file.

The header states the earthquake with its time (BTM is Beijing time, UTC+8), the station, the
component, the units, the number of samples, the sampling interval and the peak. Samples follow in
eight columns, row by row.
"""

from __future__ import annotations

import re
from datetime import timedelta
from functools import partial

from tdint.ground_motion.formats.lines import COUNT, NUMBER, Lines, is_row_of_numbers, recognizer
from tdint.ground_motion.formats.series import CLOCK, Header, Series, code, reader, required_units
from tdint.number_parsing import any_case

_POINTS = (
    rf"\bNO\.?\s*OF POINTS\s*:\s*({COUNT})\s+EQUALLY SPACED INTERVALS OF\s*:\s*({NUMBER})\s*SEC"
)
"""Pattern of the number of samples and the sampling interval, s."""
_UNITS = r"\bACC+ELERATION\s+UNIT\s*:\s*(\S+)"
_COMPONENT = r"^\s*COMP\.?\s*:?\s*([A-Z0-9-]+)"
_STATION = r"^\s*STATION\s*:\s*(.*)"
_STATION_CODE = any_case("(?:\\(|\N{FULLWIDTH LEFT PARENTHESIS}|\xa3\xa8)\\s*([A-Z0-9]+)")
"""Pattern of a station code after the name of the station; `\\xa3\\xa8` is the full-width
parenthesis of the encoding GBK, decoded as Latin-1."""
_PEAK = rf"^\s*PEAK VALUE\s*:\s*({NUMBER})\s+AT\b"
_EPICENTER = any_case(r"^\s*EPICENTER\b")
_ORIGIN = rf"\b(?P<year>\d{{4}})-(?P<month>\d\d?)-(?P<day>\d\d?)\s+{CLOCK}\s+BTM\b"
_BEIJING = 8.0  # offset of Beijing time from UTC, hours
_HEADER = 40  # maximum number of lines of a header
_VALUE_WIDTH = 10  # characters of a sample in files with samples that fill their fields


@recognizer
def is_csmnc(lines: list[str]) -> object:
    """Return True if the first lines of a file state station, component, and number of samples in
    the wording of CSMNC."""
    return all(map(Header(lines[:_HEADER]).match, (_STATION, _COMPONENT, _POINTS)))


@reader
def read_csmnc(lines: Lines) -> list[Series]:
    """Read a CSMNC file, and return its only component, an acceleration.

    Raises
    ------
    RecordError
        The file is cut off, has more values than its header states, or its content does not match
        its header.
    """
    states_points = partial(re.search, _POINTS, flags=re.IGNORECASE)
    header = Header(lines.take_until(states_points, "line with the number of points"))
    header.append(lines.take())
    points = header.match(_POINTS)
    assert points is not None  # take_until has found it
    header += lines.take_until(is_row_of_numbers, "row of numbers")
    units = required_units(header.field(_UNITS))
    count, station = int(points[1]), header.field(_STATION)
    in_brackets = _STATION_CODE.search(station)
    series = Series(
        lines.numbers(count, _VALUE_WIDTH),
        float(points[2]),
        units,
        channel=header.code(_COMPONENT).upper(),
        # The code in parentheses after the name of a station; otherwise the first word
        station=in_brackets[1] if in_brackets else code((station.split() or [""])[0]),
        event=_event(header),
        peak=header.peak(_PEAK, units, units),
    )
    lines.expect_no_numbers(count)
    return [series]


def _event(header: Header) -> str:
    """Return the name of the earthquake, which is above the line of the epicenter, and its time in
    UTC."""
    index = next((i for i, line in enumerate(header) if _EPICENTER.match(line)), 0)
    name = " ".join(header[index - 1].split()) if index else ""
    origin = header.moment(_ORIGIN)
    if origin is None:
        return name
    return f"{name} {origin - timedelta(hours=_BEIJING):%Y-%m-%d %H:%M:%S}".strip()
