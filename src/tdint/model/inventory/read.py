"""Reading an inventory: a CSV file with a building per row, under the column names of SimCenter's regional workflow."""

from __future__ import annotations

import csv
import io
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from tdint.errors import ModelError, ModelFault
from tdint.model.config.keys.kinds import POSITIVE, RATIO, Bounds
from tdint.model.inventory.definition import BuildingFacts
from tdint.model.inventory.hazus import LEVELS
from tdint.model.inventory.mdof_lu import MOST_STORIES, STRUCTURES, ZONES

NEEDED = ("id", "NumberOfStories", "YearBuilt", "StructureType", "PlanArea")
OPTIONAL = ("height", "seismicZone", "DampingRatio", "DesignLevel", "Latitude", "Longitude")
_DESIGN_LEVELS = (
    {level: level for level in LEVELS}
    | {f"{level}-code": level for level in LEVELS}
    | {f"{level[0]}c": level for level in LEVELS}
)
_YEARS = (1000, 2200)
_MOST_BYTES = 256 * 1024 * 1024


@dataclass(frozen=True, slots=True)
class InventoryRow:
    """A building of an inventory: its id, what is said of it, and where it is (degrees), None if that is not said."""

    id: str
    facts: BuildingFacts
    latitude: float | None = None
    longitude: float | None = None


def read_inventory(
    source: str, length: float, *, mass_only: bool = False
) -> tuple[list[InventoryRow], list[ModelFault]]:
    """The buildings of a CSV file, and what is wrong with the rows that are left out.

    Parameters
    ----------
    source : str
        The file; `-` is standard input.
    length : float
        The unit of the file's lengths in m; areas are in its square.
    mass_only : bool
        Leave out the stiffness-proportional damping of all buildings.

    Raises
    ------
    ModelError
        The file cannot be read, or lacks a column.
    """
    reader = csv.reader(io.StringIO(_text(source), newline=""))
    try:
        lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise ModelError(f"{source}:{reader.line_num}: no CSV: {error}") from None
    if not lines:
        raise ModelError(f"{source}: is empty; its first line must name the columns {', '.join(NEEDED)}")
    (_, header), *rows = lines
    places = _places(source, header)
    faults: list[ModelFault] = []
    buildings: list[InventoryRow] = []
    seen: dict[str, int] = {}
    for line, cells in rows:
        row = _Row(source, line, cells, places, faults)
        if len(cells) > len(header):
            row.fault(len(header), "", f"{len(cells)} cells under {len(header)} columns")
            continue
        building = row.building(length, mass_only)
        if building and building.id in seen:
            row.fault(
                places["id"],
                "id",
                f"{building.id!r} is already on line {seen[building.id]}; give each building its own",
            )
        elif building:
            seen[building.id] = line
            buildings.append(building)
    return buildings, faults


def _text(source: str) -> str:
    try:
        data = sys.stdin.buffer.read(_MOST_BYTES + 1) if source == "-" else Path(source).read_bytes()
    except FileNotFoundError:
        raise ModelError(f"{source}: no such file; give a CSV file with a building per row, or -") from None
    except (OSError, ValueError) as error:
        raise ModelError(f"{source}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > _MOST_BYTES:
        raise ModelError(f"{source}: larger than {_MOST_BYTES // 1024**2} MiB; this is no inventory")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ModelError(f"{source}: not UTF-8 text (byte 0x{data[error.start]:02x}); save it as UTF-8") from None


def _places(source: str, header: list[str]) -> dict[str, int]:
    """The place of each known column; upper and lower case are the same."""
    known = {name.lower(): name for name in (*NEEDED, *OPTIONAL)}
    places: dict[str, int] = {}
    for place, cell in enumerate(header):
        name = known.get(cell.strip().lower())
        if name in places:
            raise ModelError(f"{source}:1: the column {name} is there twice")
        if name:
            places[name] = place
    missing = [name for name in NEEDED if name not in places]
    if missing:
        near = get_close_matches(missing[0].lower(), [cell.strip().lower() for cell in header], n=1)
        hint = f"; did you mean it by {near[0]!r}?" if near else ""
        raise ModelError(f"{source}:1: no column {', '.join(missing)}{hint}")
    return places


class _Row:
    """A row whose cells are read; what is wrong is noted."""

    def __init__(
        self, source: str, line: int, cells: list[str], places: Mapping[str, int], faults: list[ModelFault]
    ) -> None:
        self._source, self._line, self._cells, self._places, self._faults = source, line, cells, places, faults
        self._before = len(faults)

    def fault(self, place: int, name: str, message: str) -> None:
        """Note what is wrong with a cell."""
        self._faults.append(ModelFault(self._source, self._line, place + 1, name, message))

    def building(self, length: float, mass_only: bool) -> InventoryRow | None:
        """The building; None after a fault."""
        name = self._cell("id")
        if not name:
            self.fault(self._places["id"], "id", "is missing")
        zones = {zone.lower(): zone for zone in ZONES}
        given = self._given
        facts = BuildingFacts(
            structure=self._word("StructureType", {one.lower(): one for one in STRUCTURES}),
            stories=self._whole("NumberOfStories", 1, MOST_STORIES),
            year=self._whole("YearBuilt", *_YEARS),
            area=self._number("PlanArea", POSITIVE) * length**2,
            height=self._number("height", POSITIVE) * length if given("height") else None,
            zone=self._word("seismicZone", zones) if given("seismicZone") else "Z4",
            design_level=self._word("DesignLevel", _DESIGN_LEVELS) if given("DesignLevel") else None,
            damping_ratio=self._number("DampingRatio", RATIO) if given("DampingRatio") else None,
            mass_only=mass_only,
        )
        latitude = self._number("Latitude", Bounds(-90.0, 90.0)) if given("Latitude") else None
        longitude = self._number("Longitude", Bounds(-360.0, 360.0)) if given("Longitude") else None
        return InventoryRow(name, facts, latitude, longitude) if len(self._faults) == self._before else None

    def _cell(self, name: str) -> str:
        place = self._places.get(name)
        return self._cells[place].strip() if place is not None and place < len(self._cells) else ""

    def _given(self, name: str) -> bool:
        return bool(self._cell(name))

    def _number(self, name: str, bounds: Bounds, what: str = "") -> float:
        text, what = self._cell(name), what or str(bounds)
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if math.isfinite(number) and bounds.allow(number):
            return number
        message = f"must be {what}, got {text!r}" if text else f"is missing; give {what}"
        self.fault(self._places[name], name, message)
        return math.nan

    def _whole(self, name: str, low: int, high: int) -> int:
        what = f"a whole number from {low} to {high}"
        number = self._number(name, Bounds(low, high), what)
        if math.isnan(number):
            return 0
        if number != int(number):
            self.fault(self._places[name], name, f"must be {what}, got {self._cell(name)!r}")
        return int(number)

    def _word(self, name: str, known: Mapping[str, str]) -> str:
        text = self._cell(name)
        if text.lower() in known:
            return known[text.lower()]
        words = ", ".join(dict.fromkeys(known.values()))
        message = f"unknown {text!r}; known: {words}" if text else f"is missing; give one of {words}"
        self.fault(self._places[name], name, message)
        return ""
