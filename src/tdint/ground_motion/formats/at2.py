"""PEER strong-motion files (AT2) of both header generations, and files with free header lines in
their manner.

Values follow a line with NPTS and DT in any number of columns (PEER, NGA database documentation).
The lines before it are free; PEER's own name earthquake, date, station and component, and the
units: g.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import Any

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import COUNT, NUMBER, Lines, is_row_of_numbers, recognizes
from tdint.ground_motion.formats.series import Series, code, motion_units, reader, required_units
from tdint.ground_motion.record import Record
from tdint.units import STANDARD_GRAVITY

_COUNT_AND_STEP = (
    re.compile(rf"\bNPTS?\s*[=:]?\s*({COUNT})\s*[,;]?\s*DT\s*[=:]?\s*({NUMBER})", re.IGNORECASE),
    re.compile(rf"^\s*({COUNT})[\s,;]+({NUMBER})[\s,;]+NPTS?\s*[,;]?\s*DT\b", re.IGNORECASE),
)
_UNITS = (
    re.compile(
        r"\bUNITS?\b[\s:=]*(?:(?:OF|ARE|IS|IN)[\s:=]+)*[(\[]?\s*([A-Z/][A-Z0-9/^*']*)",
        re.IGNORECASE,
    ),
    re.compile(
        r"\b(?:ACCELERATION|VELOCITY|DISPLACEMENT)(?:\s+TIME\s+(?:HISTORY|SERIES))?\s+IN\s+(?!UNITS)([A-Z/][A-Z0-9/^*']*)",
        re.IGNORECASE,
    ),
)
_OTHER = re.compile(r"\b(VELOCITY|DISPLACEMENT)\s+TIME\s+(?:HISTORY|SERIES)", re.IGNORECASE)
_TITLE = re.compile(r"\s*PEER\b.*STRONG\s+MOTION\s+DATABASE|\s*PACIFIC ENGINEERING", re.IGNORECASE)
_COMPONENT = re.compile(r"\s*([A-Z0-9]{1,6})\b", re.IGNORECASE)
_START = re.compile(r"\d{4}-\d\d-\d\dT[\d:.]+Z")  # of the files that tdint writes
_WRITTEN_HERE = "PEER STRONG MOTION DATABASE RECORD, WRITTEN BY TDINT"


def is_at2(file: Any, **_: Any) -> bool:
    """Whether a file has a line with NPTS and DT, and numbers after it."""
    return recognizes(file, _matches)


@reader
def read_at2(lines: Lines) -> list[Series]:
    """Read a PEER file or one in its manner; see `tdint.ground_motion.formats`.

    Raises
    ------
    RecordError
        It is cut off, holds more values than NPTS or something else than accelerations.
    """
    header = [*lines.take_until(_count_and_step, "line with NPTS and DT"), lines.take()]
    while not lines.at_numbers():
        header.append(lines.take())
    count, step = next(filter(None, map(_count_and_step, reversed(header))))
    values = lines.numbers(count)

    # Station and component: the last two parts of the second line of PEER's own headers; the
    # event with its date: the parts before them.
    codes: dict[str, Any] = {}
    parts = header[1].split(",") if len(header) > 2 and _TITLE.match(header[0]) else []
    is_own = header[0].strip() == _WRITTEN_HERE
    if len(parts) > 2 and (component := _COMPONENT.match(parts[-1])):
        channel = code(parts[-1]) if is_own else component[1]
        codes = {"station": code(parts[-2]), "channel": channel}
        if is_own and _START.fullmatch(parts[-3].strip()):
            start = datetime.fromisoformat(parts.pop(-3).strip())
            codes["start"] = start.astimezone(UTC).replace(tzinfo=None)
        codes["event"] = " ".join(" ".join(parts[:-2]).split())

    # Words may follow the values, numbers may not.
    while lines.peek() is not None:
        if lines.at_numbers():
            raise RecordError(f"line {lines.number + 1} holds more values than NPTS announces")
        lines.take()

    # Units: the first word where they may stand that is a unit of motion, of the quantity that the
    # header names.
    text = "\n".join(header)
    other = _OTHER.search(text)
    quantity = other[1].lower() if other else "acceleration"
    named = (
        match[1] for pattern in _UNITS for match in pattern.finditer(text) if motion_units(match[1])
    )
    units = next((required_units(name, quantity) for name in named), "")
    return [Series(values, step, units, **codes)]


def at2_text(record: Record) -> str:
    """Return a record in this format, in g to nine digits.

    The second line names event, time of the first sample (as far as known), station and component,
    in PEER's order.
    """
    rows = record.acceleration / STANDARD_GRAVITY
    station = record.id.split(".")[1] if record.id.count(".") == 3 else ""
    names = [record.event.replace(",", " "), record.start, station, record.component]
    if not record.start:
        del names[1]
    head = (_WRITTEN_HERE, ", ".join(names), "ACCELERATION TIME SERIES IN UNITS OF G")
    values = [
        "".join(f"{value:16.8E}" for value in rows[i : i + 5]) for i in range(0, rows.size, 5)
    ]
    return "\n".join((*head, f"NPTS= {rows.size}, DT= {record.dt!r} SEC", *values, ""))


def _matches(lines: list[str]) -> bool:
    """Some line has count and step, and the next one after it that is not blank holds numbers."""
    places = [i for i, line in enumerate(lines) if _count_and_step(line)]
    after = [line for line in lines[places[-1] + 1 :] if line.strip()] if places else []
    return bool(after) and is_row_of_numbers(after[0])


def _count_and_step(line: str) -> tuple[int, float] | None:
    """Number of values and sampling interval, s, if the line gives them."""
    for pattern in _COUNT_AND_STEP:
        if match := pattern.search(line):
            return int(match[1]), float(match[2])
    return None
