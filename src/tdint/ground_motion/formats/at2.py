"""PEER strong-motion files (AT2) with both versions of the header, and similar files with arbitrary
header lines.

Values follow a line with NPTS and DT in any number of columns (PEER, NGA database documentation).
The lines before it may contain any text. In files of PEER they state earthquake, date, station and
component, and the units g.
"""

from __future__ import annotations

import io
import re
from datetime import UTC, datetime
from typing import Any

from tdint.ground_motion.formats.lines import (
    COUNT,
    NUMBER,
    Lines,
    is_row_of_numbers,
    read_lines,
    recognizer,
)
from tdint.ground_motion.formats.series import Series, code, motion_units, reader, required_units
from tdint.ground_motion.origin import MotionOrigin, header_statement, stated_origin
from tdint.ground_motion.record import Record
from tdint.number_parsing import any_case
from tdint.units import STANDARD_GRAVITY

_COUNT_AND_STEP = (
    any_case(rf"\bNPTS?\s*[=:]?\s*({COUNT})\s*[,;]?\s*DT\s*[=:]?\s*({NUMBER})"),
    any_case(rf"^\s*({COUNT})[\s,;]+({NUMBER})[\s,;]+NPTS?\s*[,;]?\s*DT\b"),
)
_UNITS = (
    any_case(r"\bUNITS?\b[\s:=]*(?:(?:OF|ARE|IS|IN)[\s:=]+)*[(\[]?\s*([A-Z/][A-Z0-9/^*']*)"),
    any_case(
        r"\b(?:ACCELERATION|VELOCITY|DISPLACEMENT)(?:\s+TIME\s+(?:HISTORY|SERIES))?\s+IN\s+(?!UNITS)([A-Z/][A-Z0-9/^*']*)"
    ),
)
_OTHER = any_case(r"\b(VELOCITY|DISPLACEMENT)\s+TIME\s+(?:HISTORY|SERIES)")
_TITLE = any_case(r"\s*PEER\b.*STRONG\s+MOTION\s+DATABASE|\s*PACIFIC ENGINEERING")
_COMPONENT = any_case(r"\s*([A-Z0-9]{1,6})\b")
_START = r"\d{4}-\d\d-\d\dT[\d:.]+Z"  # start time in files written by tdint
_WRITTEN_HERE = "PEER STRONG MOTION DATABASE RECORD, WRITTEN BY TDINT"
_ORIGIN = "; ORIGIN "
"""Separator of `_WRITTEN_HERE` and the origin of a motion in the first line."""


@recognizer
def is_at2(lines: list[str]) -> object:
    """Return True if a file has a line with NPTS and DT, followed by numbers."""
    # Like `read_at2`, this check uses the last of several lines with NPTS and DT.
    index = max(index for index, line in enumerate(lines) if _count_and_step(line))
    return is_row_of_numbers(next(line for line in lines[index + 1 :] if line.strip()))


def has_columns(data: bytes) -> bool:
    """Return True if the rows of a file have several numbers and are as many as NPTS: the columns
    of a text table."""
    lines = read_lines(io.BytesIO(data))
    _, count, _ = _header(lines)
    return len((lines.peek() or "").split()) > 1 and len(lines.remaining()) >= count


def _header(lines: Lines) -> tuple[list[str], int, float]:
    """Take the header up to the numbers, and return its lines, the number of values, and the
    sampling interval (s), which the last line with NPTS and DT states."""
    header = [*lines.take_until(_count_and_step, "line with NPTS and DT"), lines.take()]
    while not lines.at_numbers():
        header.append(lines.take())
    return header, *next(filter(None, map(_count_and_step, reversed(header))))


@reader
def read_at2(lines: Lines) -> list[Series]:
    """Read a PEER file or a similar file, and return its only component.

    Raises
    ------
    RecordError
        The file is cut off, has more values than NPTS, or the units do not match the quantity.
    """
    header, count, step = _header(lines)
    values = lines.numbers(count)

    # The last two parts of the second line of PEER headers are station and component. The parts
    # before them are the event and its date.
    attributes: dict[str, Any] = {}
    parts = header[1].split(",") if len(header) > 2 and _TITLE.match(header[0]) else []
    title, _, statement = header[0].strip().partition(_ORIGIN)
    is_tdint_file = title == _WRITTEN_HERE
    if len(parts) > 2 and (component := _COMPONENT.match(parts[-1])):
        channel = code(parts[-1]) if is_tdint_file else component[1]
        attributes = {"station": code(parts[-2]), "channel": channel}
        # Files of tdint also state the time of the first sample, before the station.
        if is_tdint_file and re.fullmatch(_START, parts[-3].strip()):
            start = datetime.fromisoformat(parts.pop(-3).strip())
            attributes["start"] = start.astimezone(UTC).replace(tzinfo=None)
        attributes["event"] = " ".join(" ".join(parts[:-2]).split())

    lines.expect_no_numbers(count)  # text may follow the values

    # The header may state the units at several positions. The first unit of ground motion that is
    # found there is used; it must be a unit of the quantity in the header.
    text = "\n".join(header[1:] if is_tdint_file else header)
    other = _OTHER.search(text)
    quantity = other[1].lower() if other else "acceleration"
    named = (
        match[1] for pattern in _UNITS for match in pattern.finditer(text) if motion_units(match[1])
    )
    units = next((required_units(name, quantity) for name in named), "")
    if not units and not other:
        from tdint.ground_motion.formats.header_statements import statements  # rarely needed

        stated = statements(header).units
        units = required_units(stated[0]) if len(stated) == 1 else ""
    if is_tdint_file:
        attributes["origin"] = stated_origin(statement, values)
    return [Series(values, step, units, **attributes)]


def at2_text(record: Record, origin: MotionOrigin | None = None) -> str:
    """Return the text of an AT2 file of a record, in g with nine digits.

    The second line contains event, time of the first sample (if known), station and component, in
    the order of PEER files.

    Parameters
    ----------
    origin : MotionOrigin, optional
        Origin of the record, which is stated at the end of the first line. Default: none.
    """
    samples = record.acceleration / STANDARD_GRAVITY
    # A complete id consists of network, station, location and channel, joined by dots.
    station = record.id.split(".")[1] if record.id.count(".") == 3 else ""
    names = [record.event.replace(",", " "), record.start, station, record.component]
    if not record.start:
        del names[1]
    numbers = [f"{value:16.8E}" for value in samples]
    # The checksum in the statement refers to the written digits.
    statement = header_statement(origin, [float(text) for text in numbers]) if origin else ""
    title = f"{_WRITTEN_HERE}{_ORIGIN}{statement}" if statement else _WRITTEN_HERE
    head = (title, ", ".join(names), "ACCELERATION TIME SERIES IN UNITS OF G")
    rows = ["".join(numbers[i : i + 5]) for i in range(0, samples.size, 5)]
    return "\n".join((*head, f"NPTS= {samples.size}, DT= {record.dt!r} SEC", *rows, ""))


def _count_and_step(line: str) -> tuple[int, float] | None:
    """Return the number of values and the sampling interval, s; None if the line does not state
    them."""
    for pattern in _COUNT_AND_STEP:
        if match := pattern.search(line):
            return int(match[1]), float(match[2])
    return None
