"""Text files of the Turkish network (AFAD, formerly NSMN): three components in columns, gal.

Lines `KEY : value`, among them the peaks of the components, the line with their names, then the
samples (AFAD, strong ground motion records of Turkiye, text export).
"""

from __future__ import annotations

import re
from typing import Any

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import COUNT, NUMBER, Lines, recognizes
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


def is_afad(file: Any, **_: Any) -> bool:
    """Whether a file begins with this network's title."""
    return recognizes(file, lambda lines: _TITLE.match(lines[0]))


@reader
def read_afad(lines: Lines) -> list[Series]:
    """Read the components of an AFAD file; see `tdint.ground_motion.formats`.

    Raises
    ------
    RecordError
        It is cut off, or what it holds is not what its header announces.
    """
    texts = lines.take_until(_NAMES.fullmatch, "line with the components' names")
    names = lines.take().split()
    points, step, peaks = (first_match(pattern, texts) for pattern in (_POINTS, _STEP, _PEAKS))
    if not (points and step and peaks):
        raise RecordError(
            "its header does not give the number of data, the sampling interval and the units"
        )
    units = required_units(peaks[1])
    stated = {name.upper(): value for name, value in _PEAK.findall(peaks[2])}
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
            peak=stated_peak(stated[name.upper()], units, units)
            if name.upper() in stated
            else None,
        )
        for name, column in zip(names, columns, strict=True)
    ]
