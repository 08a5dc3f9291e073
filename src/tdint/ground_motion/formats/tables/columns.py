"""The names of a table's columns: time, acceleration, velocity, displacement, or components of the acceleration.

`Time,Acc,Vel,Disp`, `t N V E`, `time_s,HNE_m_s2,HNN_m_s2`, `Time (s); Acceleration (g)`: blanks, commas, semicolons or
tabs divide them, units stand in brackets or after an underscore.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from tdint.errors import RecordError

TIME, OTHER = "time", "other"
SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3}
"""Units of times, s."""

MOTIONS = ("acceleration", "velocity", "displacement")

_NAME = re.compile(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?")
_UNITS_IN_BRACKETS = re.compile(r"(.*?)\s*[(\[]\s*(.*?)\s*[)\]]")
_UNITS_AT_END = re.compile(r"(.*?)_((?:mm|cm|m|in|ft)_s2|(?:mm|cm|m|in|ft)_s|gal|g|sec|s|ms|mm|cm|m|in|ft)")
_COMPONENT = (
    r"[nsewudzvhxylr]\d?|[nsewud]-?[nsewud]|up|down|dn|ver(?:t(?:ical)?)?|north|south|east|west|"
    r"trans(?:v(?:erse)?)?|long(?:itudinal)?|rad(?:ial)?|\d{1,3}|[a-z][hn][a-z0-9]|[ns]\d{1,2}[ew]"
)
_TIMES = ("t", "time", "times", "s", "sec")
_KINDS = {
    "acceleration": re.compile(rf"(?:ground )?(?:a|ag|acc|accel|acceleration)(?:[ -]({_COMPONENT}))?"),
    "velocity": re.compile(rf"(?:ground )?(?:vg|vel|veloc|velocity)(?:[ -]({_COMPONENT}))?"),
    "displacement": re.compile(rf"(?:ground )?(?:dg|dis|disp|displ|displacement)(?:[ -]({_COMPONENT}))?"),
}
_BARE = {"v": "velocity", "d": "displacement"}
"""What these letters mean beside a column called acceleration; else they are components."""


@dataclass(frozen=True)
class ColumnName:
    """What a column is.

    Attributes
    ----------
    kind : str
        `TIME`, one of `MOTIONS`, or `OTHER` for what the name does not tell.
    component, units : str
        Empty where the name has none.
    text, plain : str
        The name as it is written, and without its units.
    """

    kind: str
    component: str = ""
    units: str = ""
    text: str = ""
    plain: str = ""


def column_names(text: str) -> list[ColumnName]:
    """What a line says about the columns below it; empty if it is no line of names.

    One name alone must be that of a motion; of several, the first may be a time.
    """
    columns = _columns(_parts(text))
    if not columns or any(column.kind == OTHER for column in columns):
        return []
    motions = [column for column in columns if column.kind != TIME]
    if not motions or (len(columns) == 1 and columns[0].component):
        return []
    if any(column.kind == "acceleration" and not column.component for column in motions):
        columns = [_beside_acceleration(column) for column in columns]
    return columns


def any_names(text: str, width: int) -> tuple[ColumnName, ...]:
    """The names of so many columns in any words, divided as above or by two blanks; empty if they are not so many.

    A first column in seconds is a time, whatever it is called.

    Raises
    ------
    RecordError
        A time is in another unit.
    """
    for parts in (_parts(text), re.split(r"\s{2,}|\t", text.strip())):
        columns = _columns(parts)
        if len(columns) != width:
            continue
        first = columns[0]
        if width > 1 and first.kind == OTHER and first.units and first.units in SECONDS:
            columns[0] = first = replace(first, kind=TIME)
        if first.kind == TIME and first.units not in SECONDS:
            raise RecordError(f"its header gives the times in {first.units!r}, not in s or ms")
        return tuple(columns)
    return ()


def place_of(wanted: str, names: tuple[ColumnName, ...], width: int) -> int:
    """The place, counted from 0, of the column with a number, counted from 1, or a name; case does not matter.

    Raises
    ------
    RecordError
        There is none, or there are several, or it is that of the time.
    """
    if wanted.isdecimal():
        place = int(wanted) - 1 if len(wanted) < 10 else -1
        if not 0 <= place < width:
            raise RecordError(f"there is no column {wanted[:40]}; the table has {width}")
    elif not names:
        raise RecordError(f"there is no column {wanted[:40]!r}: the table has no names of columns; give its number")
    else:
        place = _named(wanted, names)
    if names and names[place].kind == TIME:
        raise RecordError(f"column {wanted} is the time ({names[place].text})")
    return place


def _named(wanted: str, names: tuple[ColumnName, ...]) -> int:
    name = " ".join(wanted.lower().split())
    ways = [[one.text.lower() for one in names], [one.plain for one in names], [one.component.lower() for one in names]]
    for way in ways:
        found = [place for place, text in enumerate(way) if text == name]
        if len(found) == 1:
            return found[0]
        if found:
            numbers = " and ".join(str(place + 1) for place in found)
            raise RecordError(f"columns {numbers} are called {wanted[:40]!r}; give the number")
    raise RecordError(f"there is no column {wanted[:40]!r}; there are {', '.join(one.text[:40] for one in names)}")


def _parts(text: str) -> list[str]:
    return re.split("[,;\t]", text) if re.search("[,;\t]", text) else _NAME.findall(text)


def _columns(parts: list[str]) -> list[ColumnName]:
    """What each name says; nothing if one of them is empty."""
    words = [name_and_units(part) for part in parts]
    if not words or any(not name for name, _ in words):
        return []
    kinds = [_classified(name, units, place == 0 and len(words) > 1) for place, (name, units) in enumerate(words)]
    return [
        replace(kind, text=" ".join(part.strip().strip("\"'").split()), plain=name)
        for kind, part, (name, _) in zip(kinds, parts, words, strict=True)
    ]


def _classified(name: str, units: str, may_be_time: bool) -> ColumnName:
    if may_be_time and name in _TIMES:
        return ColumnName(TIME, units=units)
    for kind, pattern in _KINDS.items():
        if match := pattern.fullmatch(name):
            return ColumnName(kind, (match[1] or "").upper(), units)
    if re.fullmatch(_COMPONENT, name):
        return ColumnName("acceleration", name.upper(), units)
    return ColumnName(OTHER, units=units)


def _beside_acceleration(column: ColumnName) -> ColumnName:
    kind = _BARE.get(column.component.lower())
    return replace(column, kind=kind, component="") if kind else column


def name_and_units(text: str) -> tuple[str, str]:
    """`Time (s)` and `time_s` as time and s, `acceleration_m_s2` as acceleration and m/s^2."""
    name = text.strip().strip("\"'").lower()
    match = _UNITS_IN_BRACKETS.fullmatch(name) or _UNITS_AT_END.fullmatch(name)
    name, units = (match[1], match[2]) if match else (name, "")
    return name.replace("_", " ").strip(), re.sub("_s$", "/s", re.sub("_s2$", "/s^2", units))
