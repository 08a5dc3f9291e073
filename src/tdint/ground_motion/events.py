"""Earthquakes of ground motions, identified by the event or the time in the header of a file.

A header names the event as free text. Dates and times in this text are recognized in the spellings
of the supported formats. Times without a time zone are UTC.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

from tdint.ground_motion.record import Record

_UNKNOWN_UNTIL = "1970-01-02"
"""MiniSEED files without a known time start in 1970."""

_SAME_ORIGIN = timedelta(minutes=2)
"""Maximum difference of two origin times of an event. Headers may round to a minute, and agencies
differ by seconds. The first aftershock of Imperial Valley 1979 in PEER files follows after 3
min."""

_SAME_START = timedelta(minutes=10)
"""Maximum difference between the start of a record and an origin time or another start. Waves
arrive within this time at distances up to 2000 km, and strong aftershocks seldom follow so soon."""

SAME_DATE = timedelta(days=1)
"""Maximum difference of two dates of an event, because one may be local and the other in UTC."""

_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_ZONES = {"PST": -8.0, "PDT": -7.0}  # hours; all other zones that are recognized are UTC
_FIRST_YEAR_OF_1900S = 50  # a year of two digits is 19yy from this value on, otherwise 20yy

_CLOCK = (
    r"(?:[T\s,;-]+(?:(?P<hour>\d{1,2}):(?P<minute>\d\d)(?::(?P<second>\d\d)(?:\.\d*)?)?"
    r"|(?P<digits>[0-2]\d[0-5]\d))(?![\d.])\s*(?P<zone>UTC|GMT|UT|Z|PST|PDT)?)?"
)
_NAME_OF_MONTH = r"(?P<month>(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)[a-z]*)\.?"
_DATES = tuple(
    rf"(?i)(?<![\d.]){date}(?!\d){_CLOCK}"
    for date in (
        r"(?P<year>\d{4})[-/](?P<month>\d{1,2})[-/](?P<day>\d{1,2})",
        r"(?P<month>\d{1,2})/(?P<day>\d{1,2})/(?P<year>\d{4}|\d\d)",
        rf"(?P<day>\d{{1,2}})\s+{_NAME_OF_MONTH}\s+(?P<year>\d{{4}})",
        rf"{_NAME_OF_MONTH}\s+(?P<day>\d{{1,2}}),?\s+(?P<year>\d{{4}})",
        rf"(?P<year>\d{{4}})\s+{_NAME_OF_MONTH}\s+(?P<day>\d{{1,2}})",
    )
)
_IGNORED_WORDS = r"\b(?:record of|earthquake|eq|of|mon|tue|wed|thu|fri|sat|sun)\b"


class Earthquake(NamedTuple):
    """Earthquake identified by one file.

    Attributes
    ----------
    name : str
        Name without the date; empty if unknown.
    time : datetime | None
        Origin time, start of the record, or midnight of the date, UTC; None if unknown.
    has_clock : bool
        True if the time of day is known.
    is_start : bool
        True if the time is the start of a record.
    """

    name: str = ""
    time: datetime | None = None
    has_clock: bool = False
    is_start: bool = False

    @property
    def is_known(self) -> bool:
        """True if a name or a time is known."""
        return bool(self.name or self.time)

    @property
    def label(self) -> str:
        """Name and date, with the time of day if it is known; empty if the event is unknown."""
        moment = ""
        if self.time is not None:
            moment = f"{self.time:%Y-%m-%dT%H:%M:%S}" if self.has_clock else f"{self.time:%Y-%m-%d}"
        return " ".join(filter(None, (self.name, moment)))


def parse_event(text: str) -> Earthquake:
    """Return the event that the text of a header identifies.

    Parameters
    ----------
    text : str
        For example `Loma Prieta 10/18/1989`, `IMPERIAL VALLEY 10/15/79 2316` or
        `2018/02/06 23:50:42`. The name is the text before the date.

    Returns
    -------
    Earthquake
        Event with the name and the time that the text states; a text without a date is the name.
    """
    for pattern in _DATES:
        match = re.search(pattern, text)
        time = _time_of(match) if match else None
        if match and time:
            has_clock = bool(match["hour"] or match["digits"])
            return Earthquake(_clean_name(text[: match.start()]), time, has_clock)
    return Earthquake(_clean_name(text))


def event_of(record: Record) -> Earthquake:
    """Return the earthquake of a record from its header.

    If the header states no time of day, the time of the first sample is used as the time of the
    earthquake. It is not used if it contradicts the date of the header by more than a day, because
    the clock of the recorder is then wrong.

    Returns
    -------
    Earthquake
        Earthquake with the known name and time; its attributes are empty if both are unknown.
    """
    event = parse_event(record.event)
    # Times in ISO 8601 are in the order of their texts. An empty text is an unknown start.
    if event.has_clock or record.start <= _UNKNOWN_UNTIL:
        return event
    start = datetime.fromisoformat(record.start)
    if start.tzinfo is not None:
        start = start.astimezone(UTC).replace(tzinfo=None)
    if event.time is not None and abs(start.date() - event.time.date()) > SAME_DATE:
        return event
    return Earthquake(event.name, start, has_clock=True, is_start=True)


def is_same_event(event: Earthquake, other: Earthquake) -> bool:
    """Return True if two files belong to a single event according to their headers.

    If both files state the time of day, the times are compared. Otherwise the names and the dates
    must not contradict each other, and the names or the dates must be known in both files.
    """
    if event.time and other.time and event.has_clock and other.has_clock:
        # A record may start minutes after the origin time, so that starts may differ more.
        are_origins = not (event.is_start or other.is_start)
        return abs(event.time - other.time) <= (_SAME_ORIGIN if are_origins else _SAME_START)
    if event.name and other.name and not _names_agree(event.name, other.name):
        return False
    if event.time and other.time:
        # At least one time of day is unknown, so only the dates are compared.
        dates = [
            datetime.combine(moment, datetime.min.time()) for moment in (event.time, other.time)
        ]
        return abs(dates[0] - dates[1]) <= SAME_DATE
    return bool(event.name and other.name)


def _time_of(match: re.Match[str]) -> datetime | None:
    """Return the date and time of day in a header, converted to UTC, without a time zone; midnight
    if the header states only a date; None if the date or the time does not exist, such as 31
    February.
    """
    year, month_text = int(match["year"]), match["month"]
    if len(match["year"]) == 2:
        year += 1900 if year >= _FIRST_YEAR_OF_1900S else 2000
    is_number = month_text.isdecimal()
    month = int(month_text) if is_number else _MONTHS.index(month_text[:3].lower()) + 1
    # The time of day is written with colons, or as four digits: 2316 is 23:16.
    digits = match["digits"] or ""
    hour, minute = match["hour"] or digits[:2] or 0, match["minute"] or digits[2:] or 0
    second = match["second"] or 0
    try:
        time = datetime(year, month, int(match["day"]), int(hour), int(minute), int(second))
    except ValueError:
        return None
    return time - timedelta(hours=_ZONES.get((match["zone"] or "").upper(), 0.0))


def _clean_name(name: str) -> str:
    """Return the name of an event on one line, without punctuation before and after."""
    return " ".join(name.split()).strip(" ,;:-(")


def _names_agree(name: str, other: str) -> bool:
    """Return True if two names of events (without dates) may belong to a single event.

    Numbers must be equal (Imperial Valley-06 is not Imperial Valley-07). The longer name may have
    additional words at its end (Loma Prieta; LOMA PRIETA, CA EARTHQUAKE).
    """
    first_words, first_numbers = _words_and_numbers(name)
    other_words, other_numbers = _words_and_numbers(other)
    common_length = min(len(first_words), len(other_words))
    has_content = bool(common_length or first_numbers)
    return (
        first_numbers == other_numbers
        and has_content
        and first_words[:common_length] == other_words[:common_length]
    )


def _words_and_numbers(name: str) -> tuple[list[str], list[int]]:
    """Return the words of a name in lower case and its numbers, without words that do not identify
    an event, such as "earthquake"."""
    parts = re.findall(r"[^\W\d_]+|\d+", re.sub(_IGNORED_WORDS, " ", name.lower()))
    words = [part for part in parts if not part.isdecimal()]
    return words, [int(part) for part in parts if part.isdecimal()]
