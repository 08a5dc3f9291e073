"""Reading an inventory: a CSV file with a building per row, under the column names of SimCenter's regional workflow."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

from tdint.csv_table import CsvTable, no_number, number, read_table
from tdint.errors import ModelFault
from tdint.model.inventory.capacity import DAMPING_RATIO, UNIT_MASS, CapacityClass, CapacityFacts
from tdint.model.inventory.mdof_lu import LEVELS, MOST_STORIES, STRUCTURES, YEARS, ZONES, BuildingFacts
from tdint.model.keys.kinds import POSITIVE, RATIO, Bounds
from tdint.written_numbers import how_many

NEEDED = ("id", "NumberOfStories", "YearBuilt", "StructureType", "PlanArea")
OPTIONAL = ("height", "seismicZone", "DampingRatio", "DesignLevel", "Latitude", "Longitude")
_COLUMNS = (*NEEDED, *OPTIONAL)
OF_CLASSES = ("id", "class", "NumberOfStories")
_OF_CLASSES = (*OF_CLASSES, "height", "mass_kg", "DampingRatio", "Latitude", "Longitude")
_NEEDS = f"an inventory is a CSV file with a building per row and the columns {', '.join(NEEDED)}"
_DESIGN_LEVELS = (
    {level: level for level in LEVELS}
    | {f"{level}-code": level for level in LEVELS}
    | {f"{level[0]}c": level for level in LEVELS}
)


@dataclass(frozen=True, slots=True)
class InventoryRow:
    """A building of an inventory.

    Attributes
    ----------
    id : str
        Its own.
    facts : BuildingFacts or CapacityFacts
        What is said of it.
    latitude, longitude : float or None
        Where it is, degrees; None if that is not said.
    columns : tuple of str
        Names of all columns but the id, as they are written; the same object in all rows.
    cells : str
        What stands there, as a JSON list of texts: of millions of buildings one object each.
    changes : tuple of (str, float)
        What a sweep changes in the building that the rules make (`tdint.model.definition.PARAMETERS`).
    label : str
        What tells it from the building's other variations.
    """

    id: str
    facts: BuildingFacts | CapacityFacts
    latitude: float | None = None
    longitude: float | None = None
    columns: tuple[str, ...] = ()
    cells: str = "[]"
    changes: tuple[tuple[str, float], ...] = ()
    label: str = ""

    def cell(self, name: str) -> str:
        """What stands in a column, whose name is compared without regard to case; nothing where there is none."""
        lower = [column.lower() for column in self.columns]
        return str(json.loads(self.cells)[lower.index(name.lower())]) if name.lower() in lower else ""


def read_inventory(
    source: str,
    length: float,
    *,
    mass_only: bool = False,
    classes: Mapping[str, CapacityClass] | None = None,
    as_published: bool = False,
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
    classes : mapping, optional
        Classes by their names: the column `class` says which one a building is of, and no year, type and area is asked.
    as_published : bool
        As of `CapacityFacts`, of all buildings.

    Raises
    ------
    ModelError
        The file cannot be read, or lacks a column.
    """
    columns, needed = (_COLUMNS, NEEDED) if classes is None else (_OF_CLASSES, OF_CLASSES)
    needs = _NEEDS.replace(", ".join(NEEDED), ", ".join(needed))
    table = read_table(source, needs, columns=columns)
    table.need(*needed)
    places = {name: table.header.index(name.lower()) for name in columns if table.has(name)}
    carried = _Carried.of(table)
    faults: list[ModelFault] = []
    buildings: list[InventoryRow] = []
    seen: dict[str, int] = {}
    for line, cells in table.rows:
        row = _Row(table, line, cells, places, faults)
        if table.overfull(cells):
            width = len(table.header)
            row.fault(width, "", f"{how_many(len(cells), 'cell')} under {how_many(width, 'column')}")
            continue
        facts = row.facts(length, mass_only) if classes is None else row.facts_of_class(length, classes, as_published)
        building = row.building(facts, carried)
        if building and building.id in seen:
            row.fault(
                places["id"],
                "id",
                f"{building.id!r} is already on line {seen[building.id]}; give each building its own",
            )
        elif building:
            seen[building.id] = line
            buildings.append(building)
    return buildings, sorted(faults, key=lambda fault: (fault.line, fault.column))


@dataclass(frozen=True)
class _Carried:
    """The columns that are carried along, and their places."""

    names: tuple[str, ...]
    places: tuple[int, ...]

    @classmethod
    def of(cls, table: CsvTable) -> _Carried:
        """All that have a name, but the id."""
        places = tuple(place for place, title in enumerate(table.titles) if title and table.header[place] != "id")
        return cls(tuple(table.titles[place] for place in places), places)

    def cells(self, row: list[str]) -> str:
        """What a row has there."""
        return json.dumps([row[place].strip() if place < len(row) else "" for place in self.places])


class _Row:
    """A row whose cells are read; what is wrong is noted."""

    def __init__(
        self, table: CsvTable, line: int, cells: list[str], places: Mapping[str, int], faults: list[ModelFault]
    ) -> None:
        self._source, self._line, self._cells, self._places, self._faults = table.source, line, cells, places, faults
        self._before = len(faults)

    def fault(self, place: int, name: str, message: str) -> None:
        """Note what is wrong with a cell."""
        self._faults.append(ModelFault(self._source, self._line, place + 1, name, message))

    def building(self, facts: BuildingFacts | CapacityFacts | None, carried: _Carried) -> InventoryRow | None:
        """The building; None after a fault."""
        name = self._cell("id")
        if not name:
            self.fault(self._places["id"], "id", "is missing")
        given = self._given
        latitude = self._number("Latitude", Bounds(-90.0, 90.0)) if given("Latitude") else None
        longitude = self._number("Longitude", Bounds(-360.0, 360.0)) if given("Longitude") else None
        if facts is None or len(self._faults) > self._before:
            return None
        return InventoryRow(name, facts, latitude, longitude, carried.names, carried.cells(self._cells))

    def facts_of_class(
        self, length: float, classes: Mapping[str, CapacityClass], as_published: bool
    ) -> CapacityFacts | None:
        """What is said of a building of a class; None after a fault."""
        name, given = self._cell("class"), self._given
        if name not in classes:
            known = ", ".join(list(classes)[:10]) + " ..." * (len(classes) > 10)
            self.fault(self._places["class"], "class", f"unknown {name!r}; known: {known}" if name else "is missing")
        stories = self._whole("NumberOfStories", 1, MOST_STORIES)
        height = self._number("height", POSITIVE) * length if given("height") else None
        mass = self._number("mass_kg", POSITIVE) if given("mass_kg") else UNIT_MASS
        ratio = self._number("DampingRatio", RATIO) if given("DampingRatio") else DAMPING_RATIO
        if len(self._faults) > self._before:
            return None
        of = classes[name]
        return CapacityFacts(of.curve, stories, height, mass, of.soft_story, of.degradation, ratio, as_published, name)

    def facts(self, length: float, mass_only: bool) -> BuildingFacts:
        """What is said of a building by its type."""
        given = self._given
        zones = {zone.lower(): zone for zone in ZONES}
        return BuildingFacts(
            structure=self._word("StructureType", {one.lower(): one for one in STRUCTURES}),
            stories=self._whole("NumberOfStories", 1, MOST_STORIES),
            year=self._whole("YearBuilt", *YEARS),
            area=self._number("PlanArea", POSITIVE) * length**2,
            height=self._number("height", POSITIVE) * length if given("height") else None,
            zone=self._word("seismicZone", zones) if given("seismicZone") else "Z4",
            design_level=self._word("DesignLevel", _DESIGN_LEVELS) if given("DesignLevel") else None,
            damping_ratio=self._number("DampingRatio", RATIO) if given("DampingRatio") else None,
            mass_only=mass_only,
        )

    def _cell(self, name: str) -> str:
        place = self._places.get(name)
        return self._cells[place].strip() if place is not None and place < len(self._cells) else ""

    def _given(self, name: str) -> bool:
        return bool(self._cell(name))

    def _number(self, name: str, bounds: Bounds, what: str = "") -> float:
        text, what = self._cell(name), what or str(bounds)
        value = number(text)
        if not math.isnan(value) and bounds.allow(value):
            return value
        message = no_number(text, what) if text else f"is missing; give {what}"
        self.fault(self._places[name], name, message)
        return math.nan

    def _whole(self, name: str, low: int, high: int) -> int:
        what = f"a whole number from {low} to {high}"
        value = self._number(name, Bounds(low, high), what)
        if math.isnan(value):
            return 0
        if value != int(value):
            self.fault(self._places[name], name, f"must be {what}, got {self._cell(name)!r}")
        return int(value)

    def _word(self, name: str, known: Mapping[str, str]) -> str:
        text = self._cell(name)
        if text.lower() in known:
            return known[text.lower()]
        words = ", ".join(dict.fromkeys(known.values()))
        message = f"unknown {text!r}; known: {words}" if text else f"is missing; give one of {words}"
        self.fault(self._places[name], name, message)
        return ""
