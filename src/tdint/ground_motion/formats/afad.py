"""Text files of the Turkish network (AFAD, formerly NSMN): three components in columns, gal.

The file consists of lines `KEY : value`, including the peaks of the components, a line with the
names of the components, and the samples (AFAD, strong ground motion records of Turkiye, text
export).
"""

from __future__ import annotations

import re

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import COUNT, NUMBER, Lines, recognizer
from tdint.ground_motion.formats.series import (
    CLOCK,
    Series,
    code,
    first_match,
    header_field,
    moment_in,
    reader,
    required_units,
    stated_peak,
)

_TITLE = re.compile(r"\s*STRONG GROUND MOTION RECORDS OF TURK", re.IGNORECASE)
_POINTS = re.compile(rf"^\s*NUMBER OF DATA\s*:\s*({COUNT})\s*$", re.IGNORECASE)
_STEP = re.compile(rf"^\s*SAMPLING INTERVAL\s*\(sec\)\s*:\s*({NUMBER})\s*$", re.IGNORECASE)
_PEAKS = re.compile(r"^\s*RAW PGA VALUES\s*\(([^)]*)\)\s*:(.*)", re.IGNORECASE)
_PEAK = re.compile(rf"\(([-A-Z]+)\)\s*({NUMBER})", re.IGNORECASE)
_STATION = re.compile(r"^\s*STATION ID\s*:\s*(\S+)", re.IGNORECASE)
_START = re.compile(
    rf"^\s*RECORD TIME\s*:\s*(?P<day>\d+)/(?P<month>\d+)/(?P<year>\d+)\s+{CLOCK}\s*\((?:GMT|UTC)\)",
    re.IGNORECASE,
)
_EARTHQUAKE = re.compile(
    r"^\s*EARTHQUAKE DATE\s*:\s*(\d.*?)\s*\(?(?:GMT|UTC)\)?\s*$", re.IGNORECASE
)
_NAMES = re.compile(r"\s*(?:[NSEWUD]-[NSEWUD]\s*){1,3}", re.IGNORECASE)


@recognizer
def is_afad(lines: list[str]) -> object:
    """Return True if a file starts with the title of the Turkish network (AFAD)."""
    return _TITLE.match(lines[0])


@reader
def read_afad(lines: Lines) -> list[Series]:
    """Read an AFAD file, and return its components with the units and the peaks in the header."""
    texts = lines.take_until(_NAMES.fullmatch, "line with the names of the components")
    names = lines.take().split()
    points, step, peaks = (first_match(pattern, texts) for pattern in (_POINTS, _STEP, _PEAKS))
    if not (points and step and peaks):
        raise RecordError(
            "the header of the file must state the number of data, the sampling interval and the "
            "units"
        )
    units = required_units(peaks[1])
    peak_by_name = {name.upper(): value for name, value in _PEAK.findall(peaks[2])}
    columns = lines.table(int(points[1]), len(names))
    lines.expect_end()
    return [
        Series(
            column,
            float(step[1]),
            units,
            channel=code(name).replace("-", "").upper(),
            station=code(header_field(_STATION, texts)),
            start=moment_in(_START, texts),
            event=header_field(_EARTHQUAKE, texts),
            peak=stated_peak(peak_by_name[name.upper()], units, units)
            if name.upper() in peak_by_name
            else None,
        )
        for name, column in zip(names, columns, strict=True)
    ]
