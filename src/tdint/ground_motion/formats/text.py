"""Plain text: a column of accelerations, or a time and one or several columns, with what they are in a header.

The header is made of comments (after #, %, ;, ! or //), of declarations `key = value` or `key: value`, bare or in
comments (`# dt = 0.01 s, units = g`), and of names of columns (`time_s,acceleration_m_s2`, `Time (s); Acceleration
(g)`). Commas, semicolons, tabs or blanks divide columns; beside semicolons and tabs, a comma is a decimal point.

One column needs its sampling interval declared; of several, the first must be a time in equal steps, unless the names
of the columns have none. Columns without names are components called by their number (2 is the one after the time).
Velocity and displacement beside an acceleration give its peaks; alone they are differentiated. Nothing is guessed:
without declared units the user must give them.
"""

from __future__ import annotations

import re
from array import array
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.formats.columns import MOTIONS, TIME, ColumnName, column_names
from tdint.ground_motion.formats.lines import NUMBER, ROW, Lines, read_lines, recognizes
from tdint.ground_motion.formats.series import Series, code, motion_scale, required_units, to_stream
from tdint.ground_motion.formats.steps import equal_steps
from tdint.ground_motion.soundness.statement import SAMPLES, STEP

if TYPE_CHECKING:
    from obspy import Stream

_COMMENT = re.compile(r"\s*(?:[#%;!]|//)+\s*(.*)")
_OTHER_FORMAT = re.compile(r"#\s*DataSequence\s*:", re.IGNORECASE)
"""A comment that belongs to a format of its own (CWB)."""

_DECLARATION = re.compile(r"\s*([a-z][a-z _]*?)\s*[=:]\s*(\S.*?)\s*", re.IGNORECASE)
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
_COLUMNS = "columns"
"""Key of the names of columns, as they stand in the header."""

_MEANINGS = {name: meaning for meaning, names in _KEYS.items() for name in names}
_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3}
_PER_SECOND = {"": 1.0, "hz": 1.0, "sps": 1.0, "/s": 1.0}

_MOST = 50
"""Columns that a table may have."""

_SAME = 1e-3
"""Relative difference up to which two statements of the sampling interval agree."""


def is_text(file: Any, **_: Any) -> bool:
    """Whether a file has a header as above, if any, then rows of one number, or of several the first of which grows."""
    return recognizes(file, _matches)


def read_text(file: Any, headonly: bool = False, **_: Any) -> Stream:
    """Read a table; see above and `tdint.ground_motion.formats`.

    Raises
    ------
    RecordError
        The sampling interval is not declared, times are not in equal steps, declarations contradict each other or the
        values, or something else than numbers stands among them.
    """
    lines = read_lines(file)
    header = _header(lines.take_until(ROW.fullmatch, "row of numbers"))
    names = column_names(header.get(_COLUMNS, ""))
    columns = _columns(lines)
    if names and len(names) != len(columns):
        raise RecordError(f"its header names {len(names)} columns, the rows have {len(columns)}")
    times = _times(columns, names)
    dt = _step(times, header)
    size = columns[0].size
    if header.get("samples", str(size)) != str(size):
        raise RecordError(f"its header announces {header['samples']} samples, there are {size}")
    common = Series(
        columns[0],
        dt,
        "",
        channel=code(header.get("component", "")),
        station=code(header.get("station", "")),
        location=code(header.get("location", "")),
        network=code(header.get("network", "")),
        start=_start(header.get("start", "")),
        compared=(*((SAMPLES,) if "samples" in header else ()), *((STEP,) if times is not None else ())),
    )
    return to_stream(_components(common, columns, names, header), headonly=headonly)


def _components(
    common: Series, columns: list[NDArray[np.float64]], names: list[ColumnName], header: dict[str, str]
) -> list[Series]:
    """The accelerations among the columns; without any, the velocities or else the displacements."""
    if not names:
        units = required_units(header["units"], "acceleration") if "units" in header else ""
        if len(columns) <= 2:
            return [replace(common, samples=columns[-1], units=units)]
        numbered = enumerate(columns[1:], start=2)
        return [replace(common, samples=column, units=units, channel=str(number)) for number, column in numbered]
    quantity = next(kind for kind in MOTIONS if any(name.kind == kind for name in names))
    series = []
    for name, column in zip(names, columns, strict=True):
        if name.kind != quantity:
            continue
        text = name.units or header.get("units", "")
        units = required_units(text, quantity) if text else ""
        pgv, pgd = (_peak_of(kind, name.component, names, columns) for kind in MOTIONS[1:])
        one = replace(common, samples=column, units=units, channel=name.component or common.channel)
        series.append(replace(one, pgv=pgv, pgd=pgd) if quantity == "acceleration" else one)
    return series


def _peak_of(kind: str, component: str, names: list[ColumnName], columns: list[NDArray[np.float64]]) -> float | None:
    """Peak, SI units, of the velocity or displacement of a component; None without one, or without its units."""
    for name, column in zip(names, columns, strict=True):
        if (name.kind, name.component) == (kind, component) and (scale := motion_scale(name.units, kind)):
            return scale * float(np.max(np.abs(column)))
    return None


def _times(columns: list[NDArray[np.float64]], names: list[ColumnName]) -> NDArray[np.float64] | None:
    """The times, s; None if there are none."""
    if not names:
        return columns[0] if len(columns) > 1 else None
    return columns[0] * _SECONDS[names[0].units] if names[0].kind == TIME else None


def _matches(lines: list[str]) -> bool:
    first = next(place for place, line in enumerate(lines) if ROW.fullmatch(line))
    declared = [_declared(line) for line in lines[:first]]
    rows = [_numbers(line) for line in lines[first:] if line.strip() and not _COMMENT.fullmatch(line)]
    width = len(rows[0])
    if any(map(_OTHER_FORMAT.match, lines[:first])):
        return False
    if None in declared or len(rows) < 2 or width > _MOST or any(len(row) != width for row in rows):
        return False
    named = any(key == _COLUMNS for found in declared for key, _value in found or [])
    return named or width == 1 or (width > 1 and all(a[0] < b[0] for a, b in pairwise(rows)))


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
    if names := column_names(content):
        if names[0].kind == TIME and names[0].units not in _SECONDS:
            return None
        units = {name.units for name in names if name.kind == "acceleration" and name.units}
        return [(_COLUMNS, content.strip()), *(("units", unit) for unit in units if len(units) == 1)]
    parts = [part for part in re.split("[,;]", content) if part.strip()]
    declarations = list(filter(None, map(_declaration, parts)))
    return declarations if comment or len(declarations) == len(parts) else None


def _declaration(text: str) -> tuple[str, str] | None:
    """Meaning and value of `key = value` with a known key."""
    match = _DECLARATION.fullmatch(text)
    meaning = _MEANINGS.get(" ".join(match[1].lower().replace("_", " ").split())) if match else None
    return (meaning, match[2]) if match and meaning else None


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
    """Columns of numbers, to the end of the file; comments may stand among them."""
    first, width = lines.number, 0
    values = array("d")
    while (line := lines.peek()) is not None:
        lines.take()
        if _COMMENT.fullmatch(line):
            continue
        numbers = _numbers(line) if ROW.fullmatch(line) else []
        width = width or len(numbers)
        if len(numbers) != width or not 1 <= width <= _MOST:
            raise RecordError(f"line {lines.number}: {line.strip()[:60]!r} is not {width or 'a row of'} numbers")
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


def _step(times: NDArray[np.float64] | None, header: dict[str, str]) -> float:
    """The sampling interval, s: declared, or that of the times."""
    stated = []
    if "dt" in header:
        stated.append(_quantity(header["dt"], _SECONDS, "dt"))
    if "rate" in header:
        stated.append(1.0 / _quantity(header["rate"], _PER_SECOND, "the sampling rate"))
    if times is not None:
        stated.append(equal_steps(times).dt)
    if not stated:
        raise RecordError(
            "a column of numbers without its sampling interval; declare it in a first line `# dt = 0.01 s, units = g`"
        )
    if max(stated) - min(stated) > _SAME * max(stated):
        raise RecordError(f"its sampling interval is stated as {' s and as '.join(f'{dt:g}' for dt in stated)} s")
    return stated[0]
