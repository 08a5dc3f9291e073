"""What stands above the numbers of a text table: declarations `key = value`, and the names of columns."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import NUMBER
from tdint.ground_motion.formats.tables.columns import SECONDS, TIME, ColumnName, any_names, column_names

COMMENT = re.compile(r"\s*(?:[#%;!]|//)+\s*(.*)")

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
COLUMNS = "columns"
"""Key of the names of columns, as they stand in the header."""

_MEANINGS = {name: meaning for meaning, names in _KEYS.items() for name in names}
_PER_SECOND = {"": 1.0, "hz": 1.0, "sps": 1.0, "/s": 1.0}


@dataclass(frozen=True)
class TableHeader:
    """What is declared, by the keys above, and the names of the columns; none if it has none."""

    declared: dict[str, str]
    names: tuple[ColumnName, ...] = ()

    def get(self, key: str) -> str:
        """What is declared for a key, empty if nothing."""
        return self.declared.get(key, "")

    def intervals(self) -> list[float]:
        """The sampling intervals that are declared, s."""
        stated = []
        if "dt" in self.declared:
            stated.append(_quantity(self.declared["dt"], SECONDS, "dt"))
        if "rate" in self.declared:
            stated.append(1.0 / _quantity(self.declared["rate"], _PER_SECOND, "the sampling rate"))
        return stated

    @property
    def start(self) -> datetime | None:
        """The time declared as ISO 8601, UTC if it names no zone; None for none, or another text."""
        try:
            start = datetime.fromisoformat(self.get("start"))
            return start.astimezone(UTC).replace(tzinfo=None) if start.tzinfo else start
        except (ValueError, OverflowError):
            return None


def read_header(lines: list[str], width: int) -> TableHeader:
    """The header of a table that is recognized by it.

    Parameters
    ----------
    lines : list of str
        All that stands above the numbers.
    width : int
        Columns of the table.

    Raises
    ------
    RecordError
        It contradicts itself, or names more or fewer columns.
    """
    declared = _together(lines)
    names = tuple(column_names(declared.get(COLUMNS, "")))
    if names and len(names) != width:
        raise RecordError(f"its header names {len(names)} columns, the rows have {width}")
    return TableHeader(declared, names)


def read_foreign_header(lines: list[str], width: int, skipped: int) -> TableHeader:
    """The header of a table whose user tells what else is needed: its last line may name the columns in any words.

    Raises
    ------
    RecordError
        As above, or a line is neither understood nor such names: `skipped` lines were passed over before.
    """
    header = read_header(lines, width)
    filled = [place for place, line in enumerate(lines) if line.strip()]
    unknown = [place for place in filled if declared_in(lines[place]) is None]
    last = lines[filled[-1]] if filled and not header.names else ""
    comment = COMMENT.fullmatch(last)
    names = any_names(comment[1] if comment else last, width) if last else ()
    if comment and names and names[0].kind != TIME:
        names = ()  # A sentence of so many words.
    if not comment and names:
        unknown = unknown[:-1]
    if unknown:
        place = unknown[-1]
        raise RecordError(
            f"line {skipped + place + 1}: {lines[place].strip()[:60]!r} is neither a declaration (dt = 0.01 s) nor the "
            f"names of {width} columns; pass over it with skip lines {skipped + place + 1}"
        )
    return TableHeader(header.declared, header.names or names)


def declared_in(line: str) -> list[tuple[str, str]] | None:
    """What a line of the header declares; None if it is neither blank nor of the kinds above."""
    comment = COMMENT.fullmatch(line)
    content = comment[1] if comment else line
    if names := column_names(content):
        if names[0].kind == TIME and names[0].units not in SECONDS:
            return None
        units = {name.units for name in names if name.kind == "acceleration"}
        return [(COLUMNS, content.strip()), *(("units", unit) for unit in units if unit and len(units) == 1)]
    parts = [part for part in re.split("[,;]", content) if part.strip()]
    declarations = list(filter(None, map(_declaration, parts)))
    return declarations if comment or len(declarations) == len(parts) else None


def _together(lines: list[str]) -> dict[str, str]:
    """What lines declare, by the keys of _KEYS.

    Raises
    ------
    RecordError
        They contradict each other.
    """
    header: dict[str, str] = {}
    for line in lines:
        for key, value in declared_in(line) or []:
            if header.setdefault(key, value) != value:
                raise RecordError(f"its header gives {key} twice: {header[key]!r} and {value!r}")
    return header


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
