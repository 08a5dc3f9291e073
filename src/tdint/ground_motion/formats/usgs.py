"""SMC files of the U.S. Geological Survey (National Strong-Motion Program), with a single component
per file.

The file contains eleven lines of text, 48 integers (8I10), 50 reals (5E15.7),
comments and values (8(1PE10.4E1)), all in cm and s. The first integer and the first real are the
values that mark unknown quantities (USGS, SMC-format data files, version 2). If the sampling rate
is unknown, the values are pairs of time and sample, or all times followed by all samples. Some
programs write `#` before each line of the header.
"""

from __future__ import annotations

import math
import re
from datetime import datetime, timedelta

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import Lines, at_equal_steps, recognizer
from tdint.ground_motion.formats.series import Header, Series, StatedPeak, code, moment, reader
from tdint.ground_motion.missing import OtherContent

IS_OF_ONE_QUANTITY = True  # a file contains an acceleration, a velocity or a displacement

_TEXTS, _INTEGERS, _REALS = 11, 48, 50
"""Numbers of lines of text, of integers and of reals in the header of an SMC file."""

_INTEGER_WIDTH, _REAL_WIDTH, _VALUE_WIDTH = 10, 15, 10
"""Characters of an integer and of a real in the header, and of a sample."""

_COMMENT = "#"  # start of each line of the header in some files

_QUANTITY = re.compile(
    r"\s*([0-6])\s+(?:UNKNOWN|(?:UN)?CORRECTED ACCELEROGRAM|VELOCITY|DISPLACEMENT|RESPONSE "
    r"SPECTRA|FOURIER AMPLITUDE)"
)
_ROW_OF_INTEGERS = r"\s*-*\d+(?:\s+-*\d+){7}\s*"
_UNITS = {"0": "", "1": "cm/s^2", "2": "cm/s^2", "3": "cm/s", "4": "cm"}
"""Units by type of series, for the types that are or may be a ground motion."""

_YEAR, _DAY, _HOUR, _MILLISECOND = 1, 2, 3, 6
"""Indices of the start time in the integers; minute and second are between hour and millisecond."""

_DATE = r"^\s*(\d{4})\s+(\d{1,2})\s+(\d{1,2})\b"
"""Pattern of year, month and day of the earthquake in the text."""
_EVENT = r"^\s*(\d{4})\s+(\d{1,2})\s+(\d{1,2})\s+(\d{4})?\s*(.*)"
"""Pattern of date, time (UTC) and name of the earthquake in the text."""
_MAX_DATE_DIFFERENCE = timedelta(days=1.5)
"""Maximum difference between the start time and noon on the date of the earthquake in the text."""

_FROM_VERTICAL, _AZIMUTH, _COMMENTS, _SAMPLES = 12, 13, 15, 16
"""Indices in the integers: angle from the vertical and azimuth of the component (degrees), number
of comments, number of samples."""

_ROUNDING = 1e-4
"""Fraction of a value; rounding error of five digits."""

_RATE, _MAXIMUM, _MINIMUM = 1, 29, 31
"""Indices in the reals: sampling rate (1/s), maximum and minimum sample."""


@recognizer
def is_smc(lines: list[str]) -> object:
    """Return True if a file has the header of an SMC file: a type of series in line 1 and eight
    integers in line 12."""
    title, integers = (line.removeprefix(_COMMENT) for line in (lines[0], lines[_TEXTS]))
    return bool(_QUANTITY.match(title) and re.fullmatch(_ROW_OF_INTEGERS, integers))


@reader
def read_smc(lines: Lines) -> list[Series]:
    """Read an SMC file, and return its only component: an acceleration, a velocity or
    a displacement.

    Raises
    ------
    RecordError
        The file is cut off, has more or fewer values than its header states, or contains no ground
        motion.
    """
    if (lines.peek() or "").startswith(_COMMENT):
        lines = lines.without_prefix(_COMMENT)
    texts = [lines.take() for _ in range(_TEXTS)]
    quantity = _QUANTITY.match(texts[0])
    if not quantity or quantity[1] not in _UNITS:
        raise OtherContent(
            "the file must contain a ground motion, but line 1 states "
            f"{texts[0].strip().lower()[:60]!r}",
            "spectrum",
        )
    integers = lines.numbers(_INTEGERS, _INTEGER_WIDTH).tolist()
    reals = lines.numbers(_REALS, _REAL_WIDTH).tolist()
    for _line in range(int(integers[_COMMENTS])):
        comment = lines.take()
        if not comment.startswith("|"):
            raise RecordError(
                f"line {lines.number} must be one of the {integers[_COMMENTS]:g} comments stated "
                "in the header"
            )

    # A component is up (0 degrees from the vertical), down (180) or an azimuth in degrees. If the
    # azimuth is unknown, the component has no name.
    unknown, vertical, azimuth = integers[0], integers[_FROM_VERTICAL], integers[_AZIMUTH]
    channel = "" if azimuth == unknown else f"{azimuth:g}"
    if vertical in (0, 180) and vertical != unknown:
        channel = "DOWN" if vertical else "UP"

    # If the header states the maximum and the minimum, the peak is the larger absolute value.
    units = _UNITS[quantity[1]]
    extremes = [abs(reals[i]) for i in (_MAXIMUM, _MINIMUM) if reals[i] != reals[0]]
    peak = (
        StatedPeak(max(extremes), _ROUNDING * max(extremes), units) if len(extremes) == 2 else None
    )
    count = int(integers[_SAMPLES])
    if reals[_RATE] == reals[0] or not reals[_RATE] > 0.0:
        samples, dt = _at_unequal_times(lines, count)
    else:
        samples, dt = lines.numbers(count, _VALUE_WIDTH), 1.0 / reals[_RATE]
    series = Series(
        samples,
        dt,
        units,
        channel=channel,
        station=code(texts[2].replace("*", "")),
        start=_start(integers, texts),
        event=_event(texts),
        peak=peak,
        units_from="format",
    )
    lines.expect_no_numbers(count)
    return [series]


def _at_unequal_times(lines: Lines, count: int) -> tuple[Array, float]:
    """Read `count` times and samples, and return the samples at equal steps and the step, s.

    The order of times and samples follows from the values: times increase strictly. The stated
    number may also count all values. RecordError is raised if the number of values differs from the
    header, or the values contain no times.
    """
    first = lines.number
    values = np.array([value for row in lines.following_rows(_VALUE_WIDTH) for value in row])
    if values.size not in (count, 2 * count) or values.size % 2 or not values.size:
        raise RecordError(
            "the header of the file does not state the sampling rate, so that the samples are at "
            f"unequal times: {count} times and samples must follow line {first}, got {values.size} "
            "values"
        )
    orders = (values.reshape(-1, 2).T, values.reshape(2, -1))
    for times, samples in orders:
        if times.size > 1 and np.all(np.diff(times) > 0.0):
            return at_equal_steps(times, samples, math.inf)
    raise RecordError(
        "the header of the file does not state the sampling rate, and the values after line "
        f"{first} contain no increasing times; specify a file with a sampling rate or with times"
    )


def _event(texts: list[str]) -> str:
    """Return name, date and time of the earthquake; empty if the text states no date."""
    match = Header(texts).match(_EVENT)
    if match is None:
        return ""
    year, month, day, clock, name = match.groups("")
    return " ".join(filter(None, (name.strip(), f"{year}-{month}-{day}", clock)))


def _start(integers: list[float], texts: list[str]) -> datetime | None:
    """Return the time of the first sample; None if it is not known to the second or not within 1.5
    days of noon on the date in the text.

    The format specifies the day of the year. Some programs write month and day instead, which
    shifts all following integers by a single position. The first integer marks unknown values.
    """
    year, day = integers[_YEAR], integers[_DAY]
    # The day of the year is the day counted from the first day of January.
    by_day = _header_time(integers[0], year, 1.0, day, *integers[_HOUR : _MILLISECOND + 1])
    date = Header(texts).match(_DATE)
    if date is None:
        return by_day
    stated_year, stated_month, stated_day = map(float, date.groups())
    event = moment(stated_year, stated_month, stated_day, 12, 0, 0)
    # If the header states month and day, the month is at the index of the day of the year.
    by_month = _header_time(integers[0], year, day, *integers[_DAY + 1 : _MILLISECOND + 2])
    candidates = (
        start
        for start in (by_day, by_month)
        if start and event and abs(start - event) <= _MAX_DATE_DIFFERENCE
    )
    return next(candidates, None)


def _header_time(
    unknown: float,
    year: float,
    month: float,
    day: float,
    hour: float,
    minute: float,
    second: float,
    thousandths: float,
) -> datetime | None:
    """Return a time in UTC from the integer header; None if a number is unknown, or if the year,
    the month or the day is out of range.

    The day is counted from the first day of the month and may be up to 366. Hour, minute and second
    may have any value; they are added to the day. Unknown thousandths of a second count as 0.
    """
    if unknown in (year, month, day, hour, minute, second) or not 1 <= day <= 366:
        return None
    fraction = 0.0 if thousandths == unknown else thousandths / 1e3
    # The time is counted from the start of the month, because the day may be after its end.
    seconds = ((day - 1.0) * 24.0 + hour) * 3600.0 + minute * 60.0 + second + fraction
    return moment(year, month, 1, 0, 0, seconds)
