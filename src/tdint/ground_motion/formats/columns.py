"""The names of a table's columns: time, acceleration, velocity, displacement, or components of the acceleration.

`Time,Acc,Vel,Disp`, `t N V E`, `time_s,HNE_m_s2,HNN_m_s2`, `Time (s); Acceleration (g)`: blanks, commas, semicolons or
tabs divide them, units stand in brackets or after an underscore.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

TIME = "time"
MOTIONS = ("acceleration", "velocity", "displacement")

_NAME = re.compile(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?")
_UNITS_IN_BRACKETS = re.compile(r"(.*?)\s*[(\[]\s*(.*?)\s*[)\]]")
_UNITS_AT_END = re.compile(r"(.*?)_((?:mm|cm|m|in|ft)_s2|(?:mm|cm|m|in|ft)_s|gal|g|sec|s|ms|mm|cm|m|in|ft)")
_COMPONENT = (
    r"[nsewudzvhxylr]\d?|[nsewud]-?[nsewud]|up|down|dn|ver(?:t(?:ical)?)?|north|south|east|west|"
    r"trans(?:v(?:erse)?)?|long(?:itudinal)?|rad(?:ial)?|\d{1,3}|[a-z][hn][a-z0-9]|[ns]\d{1,2}[ew]"
)
_TIMES = ("t", "time", "times")
_KINDS = {
    "acceleration": re.compile(rf"(?:ground )?(?:a|ag|acc|accel|acceleration)(?:[ -]({_COMPONENT}))?"),
    "velocity": re.compile(rf"(?:ground )?(?:vg|vel|veloc|velocity)(?:[ -]({_COMPONENT}))?"),
    "displacement": re.compile(rf"(?:ground )?(?:dg|dis|disp|displ|displacement)(?:[ -]({_COMPONENT}))?"),
}
_BARE = {"v": "velocity", "d": "displacement"}
"""What these letters mean beside a column called acceleration; else they are components."""


@dataclass(frozen=True)
class ColumnName:
    """What a column is: `kind` is `time` or a motion, `component` and `units` are empty where the name has none."""

    kind: str
    component: str = ""
    units: str = ""


def column_names(text: str) -> list[ColumnName]:
    """What a line says about the columns below it; empty if it is no line of names.

    One name alone must be that of a motion; of several, the first may be a time.
    """
    parts = re.split("[,;\t]", text) if re.search("[,;\t]", text) else _NAME.findall(text)
    words = [_name_and_units(part) for part in parts]
    if not words or any(not name for name, _ in words):
        return []
    found = [_classified(name, units, place == 0 and len(words) > 1) for place, (name, units) in enumerate(words)]
    columns = [column for column in found if column is not None]
    if len(columns) != len(words):
        return []
    motions = [column for column in columns if column.kind != TIME]
    if not motions or (len(columns) == 1 and columns[0].component):
        return []
    if any(column.kind == "acceleration" and not column.component for column in motions):
        columns = [_beside_acceleration(column) for column in columns]
    return columns


def _classified(name: str, units: str, may_be_time: bool) -> ColumnName | None:
    if may_be_time and name in _TIMES:
        return ColumnName(TIME, units=units)
    for kind, pattern in _KINDS.items():
        if match := pattern.fullmatch(name):
            return ColumnName(kind, (match[1] or "").upper(), units)
    if re.fullmatch(_COMPONENT, name):
        return ColumnName("acceleration", name.upper(), units)
    return None


def _beside_acceleration(column: ColumnName) -> ColumnName:
    kind = _BARE.get(column.component.lower())
    return replace(column, kind=kind, component="") if kind else column


def _name_and_units(text: str) -> tuple[str, str]:
    """`Time (s)` and `time_s` as time and s, `acceleration_m_s2` as acceleration and m/s^2."""
    name = text.strip().strip("\"'").lower()
    match = _UNITS_IN_BRACKETS.fullmatch(name) or _UNITS_AT_END.fullmatch(name)
    name, units = (match[1], match[2]) if match else (name, "")
    return name.replace("_", " ").strip(), re.sub("_s$", "/s", re.sub("_s2$", "/s^2", units))
