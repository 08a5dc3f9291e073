"""Text files of the Central Weather Bureau of Taiwan: time and three components in columns.

The header consists of lines `#Key: value`, including the maximum and minimum sample of each
component and the order of the columns (`#DataSequence: Time U(+); N(+); E(+)`). Rows in 4F10.3
follow (CWB free-field strong-motion data, TSMIP).
"""

from __future__ import annotations

import re

import numpy as np

from tdint.errors import RecordError
from tdint.ground_motion.formats import series
from tdint.ground_motion.formats.lines import (
    NUMBER,
    Lines,
    equal_steps,
    is_row_of_numbers,
    recognizer,
)
from tdint.ground_motion.miniseed_checks import SAMPLES, STEP, Statement, compare
from tdint.number_parsing import any_case

_STATION = r"^#\s*StationCode\s*:\s*(\S+)"
_TIME = rf"\(GMT(?P<zone>[-+]\d+)\)\s*:\s*(?P<year>\d+)/(?P<month>\d+)/(?P<day>\d+)-{series.CLOCK}"
_START, _ORIGIN = rf"^#\s*StartTime{_TIME}", rf"^#\s*Origin\s*Time{_TIME}"
_LENGTH = rf"^#\s*RecordLength\(sec\)\s*:\s*({NUMBER})"
_RATE = rf"^#\s*SampleRate\(Hz\)\s*:\s*({NUMBER})"
_UNITS = r"^#\s*AmplitudeUnit\s*:\s*([A-Z/^0-9]+)"
_EXTREMES = any_case(rf"^#\s*AmplitudeMAX\.\s*(\w)\s*:\s*({NUMBER})\s*~\s*({NUMBER})")
_SEQUENCE = r"^#\s*DataSequence\s*:\s*Time\s+(.*)"
_MAX_STATED_SAMPLES = 1e12
"""Maximum number of samples according to a header; a larger number is not compared."""

_NAME = r"(\w+)\s*\(\+\)"


@recognizer
def is_cwb(lines: list[str]) -> object:
    """Return True if the comment lines (#) at the start of a file state the station, the sampling
    rate and the order of the columns, as in a CWB file."""
    return all(map(series.Header(lines[:60]).match, (_STATION, _RATE, _SEQUENCE)))


@series.reader
def read_cwb(lines: Lines) -> list[series.Series]:
    """Read a CWB file, and return its components with the units and the peaks in the header.

    Raises
    ------
    RecordError
        The file is cut off, its times are not in equal steps, or its content does not match its
        header.
    """
    header = series.Header(lines.take_until(is_row_of_numbers, "row of numbers"))
    units, rate = map(header.match, (_UNITS, _RATE))
    names = re.findall(_NAME, header.field(_SEQUENCE))
    if not (names and rate and units):
        raise RecordError(
            "the header of the file must state the sampling rate, the units and the order of the "
            "columns"
        )
    times, *columns = lines.remaining_rows(1 + len(names))
    dt, _ = equal_steps(times)
    statements = [
        Statement(STEP, 1.0 / float(rate[1]) if float(rate[1]) else np.inf, dt, 1e-3 * dt, "s")
    ]
    length = header.match(_LENGTH)
    if length and abs(float(length[1]) * float(rate[1])) < _MAX_STATED_SAMPLES:
        # The length is the duration of all samples or, in some files, the time of the last sample.
        # In the latter case, the file has one sample more than length times rate.
        stated = round(float(length[1]) * float(rate[1]))
        size = stated if times.size == stated + 1 else times.size
        statements.append(Statement(SAMPLES, stated, size))
    compared = compare(statements)
    unit = series.required_units(units[1])

    # The peak of a component is the larger absolute value of its maximum and minimum.
    peaks: dict[str, series.StatedPeak | None] = {}
    for match in filter(None, map(_EXTREMES.search, header)):
        largest = max(match[2], match[3], key=lambda number: abs(float(number)))
        peaks.setdefault(match[1].upper(), series.stated_peak(largest, unit, unit))
    origin = header.moment(_ORIGIN)
    return [
        series.Series(
            column,
            dt,
            unit,
            channel=series.code(name).upper(),
            station=header.code(_STATION),
            start=header.moment(_START),
            event="" if origin is None else f"{origin:%Y-%m-%d %H:%M:%S}",
            peak=peaks.get(name.upper()),
            compared=compared,
        )
        for name, column in zip(names, columns, strict=True)
    ]
