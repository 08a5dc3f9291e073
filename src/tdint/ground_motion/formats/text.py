"""Plain text: a column of accelerations, or two columns of time and acceleration, with what they are in a header.

The header is made of comments (after #, %, ;, ! or //), of declarations `key = value` or `key: value`, bare or in
comments (`# dt = 0.01 s, units = g`), and of names of columns (`time_s,acceleration_m_s2`, `Time (s); Acceleration
(g)`). Commas, semicolons, tabs or blanks divide columns; beside semicolons and tabs, a comma is a decimal point.

One column needs its sampling interval declared; of two, the first must be a time in equal steps. Nothing is guessed:
without declared units the user must give them.
"""

from __future__ import annotations

import re
from array import array
from datetime import UTC, datetime
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import NUMBER, ROW, Lines, read_lines, recognizes
from tdint.ground_motion.formats.series import Series, code, required_units, to_stream
from tdint.ground_motion.formats.steps import equal_steps

if TYPE_CHECKING:
    from obspy import Stream

_COMMENT = re.compile(r"\s*(?:[#%;!]|//)+\s*(.*)")
_DECLARATION = re.compile(r"\s*([a-z][a-z _]*?)\s*[=:]\s*(\S.*?)\s*", re.IGNORECASE)
_NAME = re.compile(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?")
_UNITS_IN_BRACKETS = re.compile(r"(.*?)\s*[(\[]\s*(.*?)\s*[)\]]")
_UNITS_AT_END = re.compile(r"(.*)_((?:mm|cm|m)_s2|gal|g|sec|s|ms)")
_QUANTITY = re.compile(rf"({NUMBER})\s*([a-z/]*)", re.IGNORECASE)

_KEYS = {
    "dt": ("dt", "delta", "time step", "timestep", "sampling interval", "sample interval"),
    "rate": ("sampling rate", "sample rate", "sampling frequency", "fs"),
    "units": ("units", "unit", "acceleration units"),
    "samples": ("samples", "npts", "number of samples", "number of points"),
    "start": ("start", "start time", "starttime"),
    "component": ("component", "channel"),
    "station": ("station",),
    "network": ("network",),
    "location": ("location",),
}
_NAMED, _TIME_UNITS = "acceleration", "time units"
"""Keys of what the names of columns declare, beside the units."""

_MEANINGS = {name: meaning for meaning, names in _KEYS.items() for name in names}
_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3}
_PER_SECOND = {"": 1.0, "hz": 1.0, "sps": 1.0, "/s": 1.0}
_TIMES = ("t", "time", "times")
_ACCELERATION = re.compile(r"(?:ground )?(?:a|ag|acc|accel|acceleration)")

_SAME = 1e-3
"""Relative difference up to which two statements of the sampling interval agree."""


def is_text(file: Any, **_: Any) -> bool:
    """Whether a file has a header as above, if any, and then rows of one number, or of two the first of which grows."""
    return recognizes(file, _matches)


def read_text(file: Any, headonly: bool = False, **_: Any) -> Stream:
    """Read a file of one or two columns; see above and `tdint.ground_motion.formats`.

    Raises
    ------
    RecordError
        The sampling interval is not declared, times are not in equal steps, declarations contradict each other or the
        values, or something else than numbers stands among them.
    """
    lines = read_lines(file)
    header = _header(lines.take_until(ROW.fullmatch, "row of numbers"))
    columns = _columns(lines)
    samples = columns[-1]
    series = Series(
        samples,
        _step(columns, header),
        required_units(header["units"]) if "units" in header else "",
        channel=code(header.get("component", "")),
        station=code(header.get("station", "")),
        location=code(header.get("location", "")),
        network=code(header.get("network", "")),
        start=_start(header.get("start", "")),
    )
    if header.get("samples", str(samples.size)) != str(samples.size):
        raise RecordError(f"its header announces {header['samples']} samples, there are {samples.size}")
    return to_stream([series], headonly=headonly)


def _matches(lines: list[str]) -> bool:
    first = next(place for place, line in enumerate(lines) if ROW.fullmatch(line))
    declared = [_declared(line) for line in lines[:first]]
    rows = [_numbers(line) for line in lines[first:] if line.strip() and not _COMMENT.fullmatch(line)]
    width = len(rows[0])
    if None in declared or len(rows) < 2 or any(len(row) != width for row in rows):
        return False
    names_time = any(key == _TIME_UNITS for found in declared for key, _value in found or [])
    grows = all(a[0] < b[0] for a, b in pairwise(rows))
    return width == 1 or (width == 2 and (names_time or grows))


# The header


def _header(lines: list[str]) -> dict[str, str]:
    """What a header declares, by the keys of _KEYS.

    Raises
    ------
    RecordError
        It contradicts itself.
    """
    header: dict[str, str] = {}
    for line in lines:
        for key, value in _declared(line) or []:
            if header.setdefault(key, value) != value:
                raise RecordError(f"its header gives {key} twice: {header[key]!r} and {value!r}")
    return header


def _declared(line: str) -> list[tuple[str, str]] | None:
    """What a line of the header declares; None if it is neither blank nor of the kinds above."""
    comment = _COMMENT.fullmatch(line)
    content = comment[1] if comment else line
    if names := _column_names(content):
        return names
    parts = [part for part in re.split("[,;]", content) if part.strip()]
    declarations = list(filter(None, map(_declaration, parts)))
    return declarations if comment or len(declarations) == len(parts) else None


def _declaration(text: str) -> tuple[str, str] | None:
    """Meaning and value of `key = value` with a known key."""
    match = _DECLARATION.fullmatch(text)
    meaning = _MEANINGS.get(" ".join(match[1].lower().replace("_", " ").split())) if match else None
    return (meaning, match[2]) if match and meaning else None


def _column_names(text: str) -> list[tuple[str, str]]:
    """What the names of columns, a time's if there are two and an acceleration's, declare; empty if they are others."""
    names = re.split("[,;\t]", text) if re.search("[,;\t]", text) else _NAME.findall(text)
    columns = [_name_and_units(name) for name in names]
    if not columns or not _ACCELERATION.fullmatch(columns[-1][0]) or len(columns) > 2:
        return []
    declared = [(_NAMED, columns[-1][0])]
    if columns[-1][1]:
        declared.append(("units", columns[-1][1]))
    if len(columns) == 2:
        name, units = columns[0]
        if name not in _TIMES or units not in _SECONDS:
            return []
        declared.append((_TIME_UNITS, units))
    return declared


def _name_and_units(text: str) -> tuple[str, str]:
    """`Time (s)` and `time_s` as time and s, `acceleration_m_s2` as acceleration and m/s^2."""
    name = text.strip().strip("\"'").lower()
    match = _UNITS_IN_BRACKETS.fullmatch(name) or _UNITS_AT_END.fullmatch(name)
    name, units = (match[1], match[2]) if match else (name, "")
    return name.replace("_", " ").strip(), re.sub("_s2$", "/s^2", units)


def _quantity(text: str, units: dict[str, float], what: str) -> float:
    """A positive number with one of these units."""
    match = _QUANTITY.fullmatch(text)
    factor = units.get(match[2].lower()) if match else None
    if not match or factor is None or not float(match[1]) > 0.0:
        known = ", ".join(filter(None, units))
        raise RecordError(f"its header gives {what} as {text!r}; write a positive number, in {known}")
    return float(match[1]) * factor


def _start(text: str) -> datetime | None:
    """A time as ISO 8601, UTC if it names no zone; None for another text."""
    try:
        start = datetime.fromisoformat(text)
        return start.astimezone(UTC).replace(tzinfo=None) if start.tzinfo else start
    except (ValueError, OverflowError):
        return None


# The columns


def _columns(lines: Lines) -> list[NDArray[np.float64]]:
    """One or two columns of numbers, to the end of the file; comments may stand among them."""
    first, width = lines.number, 0
    values = array("d")
    while (line := lines.peek()) is not None:
        lines.take()
        if _COMMENT.fullmatch(line):
            continue
        numbers = _numbers(line) if ROW.fullmatch(line) else []
        width = width or len(numbers)
        if len(numbers) != width or width not in (1, 2):
            raise RecordError(f"line {lines.number}: {line.strip()[:60]!r} is not {width or 'one or two'} numbers")
        values.extend(numbers)
    return list(lines.checked(values, first).reshape(-1, width).T.copy())


def _numbers(line: str) -> list[float]:
    """The numbers of a row; empty if there is something else, or nothing, between two separators."""
    separator = next((mark for mark in ";\t," if mark in line.strip()), None)
    cells = line.strip().removesuffix(separator or " ").split(separator)
    point = "," if separator in (";", "\t") else "."
    try:
        return [float(cell.replace(point, ".").replace("D", "E").replace("d", "e")) for cell in cells]
    except ValueError:
        return []


def _step(columns: list[NDArray[np.float64]], header: dict[str, str]) -> float:
    """The sampling interval, s: declared, or that of the times."""
    stated = []
    if "dt" in header:
        stated.append(_quantity(header["dt"], _SECONDS, "dt"))
    if "rate" in header:
        stated.append(1.0 / _quantity(header["rate"], _PER_SECOND, "the sampling rate"))
    if len(columns) == 2:
        stated.append(equal_steps(columns[0] * _SECONDS[header.get(_TIME_UNITS, "")]).dt)
    if not stated:
        raise RecordError(
            "a column of numbers without its sampling interval; declare it in a first line `# dt = 0.01 s, units = g`"
        )
    if max(stated) - min(stated) > _SAME * max(stated):
        raise RecordError(f"its sampling interval is stated as {' s and as '.join(f'{dt:g}' for dt in stated)} s")
    return stated[0]
