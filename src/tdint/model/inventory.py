"""The buildings of an inventory by a set of rules, with scatter if that is wanted, and their model files."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tdint.csv_table import CsvTable, no_number, number, read_table
from tdint.errors import ModelError, ModelFault, UsageError
from tdint.model import mdof_lu
from tdint.model.capacity import (
    DAMPING_RATIO,
    UNIT_MASS,
    CapacityBuilding,
    CapacityClass,
    CapacityFacts,
    derive_capacity,
)
from tdint.model.definition import LAWS, RayleighRatio, Story
from tdint.model.keys.fields import POSITIVE, RATIO, Bounds
from tdint.model.mdof_lu import LEVELS, MOST_STORIES, STRUCTURES, YEARS, ZONES, BuildingFacts, DerivedBuilding, Scatter
from tdint.tabular import Several
from tdint.units import LENGTH
from tdint.written_numbers import how_many

# ---- Reading an inventory: a CSV file with a building per row, under the column names of SimCenter's regional
# workflow

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
    # Columns by their place: all that have a name, but the id, are carried along, whether they are read or not.
    places = {name: table.header.index(name.lower()) for name in columns if table.has(name)}
    carried = [place for place, title in enumerate(table.titles) if title and table.header[place] != "id"]
    names = tuple(table.titles[place] for place in carried)
    faults: list[ModelFault] = []
    buildings: list[InventoryRow] = []
    seen: dict[str, int] = {}
    for line, cells in table.rows:
        row = _Row(table, line, cells, places, faults)
        # One cell too many shifts those behind it: nothing in the row can be trusted.
        if table.overfull(cells):
            width = len(table.header)
            row.fault(width, "", f"{how_many(len(cells), 'cell')} under {how_many(width, 'column')}")
            continue
        facts = row.facts(length, mass_only) if classes is None else row.facts_of_class(length, classes, as_published)
        building = row.building(facts, names, carried)
        # By its id a building is found again in tables, and draws are made.
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

    def building(
        self, facts: BuildingFacts | CapacityFacts | None, names: tuple[str, ...], carried: Sequence[int]
    ) -> InventoryRow | None:
        """The building, with the names of the columns that are carried along, and their places; None after a fault."""
        name = self._cell("id")
        if not name:
            self.fault(self._places["id"], "id", "is missing")
        given = self._given
        latitude = self._number("Latitude", Bounds(-90.0, 90.0)) if given("Latitude") else None
        longitude = self._number("Longitude", Bounds(-360.0, 360.0)) if given("Longitude") else None
        if facts is None or len(self._faults) > self._before:
            return None
        cells = [self._cells[place].strip() if place < len(self._cells) else "" for place in carried]
        return InventoryRow(name, facts, latitude, longitude, names, json.dumps(cells))

    def facts_of_class(
        self, length: float, classes: Mapping[str, CapacityClass], as_published: bool
    ) -> CapacityFacts | None:
        """What is said of a building of a class; None after a fault."""
        name, given = self._cell("class"), self._given
        if name not in classes:
            names = ", ".join(list(classes)[:10]) + " ..." * (len(classes) > 10)
            self.fault(self._places["class"], "class", f"unknown {name!r}; known: {names}" if name else "is missing")
        # All cells are read before the first fault ends it, so that all are told.
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
            structure=self._word("StructureType", {structure.lower(): structure for structure in STRUCTURES}),
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

    def _number(self, name: str, bounds: Bounds, expected: str = "") -> float:
        text, expected = self._cell(name), expected or str(bounds)
        value = number(text)
        if not math.isnan(value) and bounds.allow(value):
            return value
        message = no_number(text, expected) if text else f"is missing; give {expected}"
        self.fault(self._places[name], name, message)
        return math.nan

    def _whole(self, name: str, low: int, high: int) -> int:
        expected = f"a whole number from {low} to {high}"
        value = self._number(name, Bounds(low, high), expected)
        if math.isnan(value):
            return 0
        if value != int(value):
            self.fault(self._places[name], name, f"must be {expected}, got {self._cell(name)!r}")
        return int(value)

    def _word(self, name: str, spellings: Mapping[str, str]) -> str:
        text = self._cell(name)
        if text.lower() in spellings:
            return spellings[text.lower()]
        words = ", ".join(dict.fromkeys(spellings.values()))
        message = f"unknown {text!r}; known: {words}" if text else f"is missing; give one of {words}"
        self.fault(self._places[name], name, message)
        return ""


# ---- Derive

CAPACITY = "capacity"
"""The rules of buildings that have capacity curves by their classes."""

RULES: Mapping[str, Callable[[Any, Scatter | None], DerivedBuilding | CapacityBuilding]] = {
    "mdof-lu": mdof_lu.derive,
    CAPACITY: lambda facts, scatter: derive_capacity(facts),
}


_MOST_SCATTER = 0.5  # of a logarithm: three deviations are a factor of 4.5


@dataclass(frozen=True)
class InventoryBuilding:
    """A row of the inventory and the building that follows from it."""

    row: InventoryRow
    building: DerivedBuilding | CapacityBuilding


def derive_all(
    rows: Sequence[InventoryRow], rules: str, *, stiffness: float = 0.0, damping: float = 0.0, seed: int = 0
) -> list[InventoryBuilding]:
    """The buildings of all rows.

    Parameters
    ----------
    stiffness, damping : float
        Standard deviations of factors with the mean 1 on the stiffness of a building, whose strength stays, and on its
        damping ratio: normal, drawn again where they are not positive.
    seed : int
        What the factors are drawn from, with the id of the building: they do not depend on the other rows.

    Raises
    ------
    UsageError
        Unknown rules, or a scatter out of range.
    """
    if rules not in RULES:
        raise UsageError(f"unknown rules {rules!r}; known: {', '.join(RULES)}")
    for name, deviation in (("stiffness", stiffness), ("damping", damping)):
        if deviation and rules == CAPACITY:
            raise UsageError(f"the rules {CAPACITY} have no scatter of the {name}")
        if not 0.0 <= deviation <= _MOST_SCATTER:
            raise UsageError(f"the scatter of the {name} must be from 0 to {_MOST_SCATTER:g}, got {deviation:g}")
    derived = partial(derive_row, rules=rules, stiffness=stiffness, damping=damping, seed=seed)
    return [InventoryBuilding(row, derived(row)) for row in rows]


def derive_row(
    row: InventoryRow, rules: str, *, stiffness: float = 0.0, damping: float = 0.0, seed: int = 0
) -> DerivedBuilding | CapacityBuilding:
    """The building of one row; parameters are those of `derive_all`, which checks them."""
    scatter = None
    if stiffness or damping:
        random = np.random.default_rng([seed, *row.id.encode()])
        scatter = Scatter(_factor(random, stiffness), _factor(random, damping))
    return RULES[rules](row.facts, scatter)


def _factor(random: np.random.Generator, deviation: float) -> float:
    factor = 0.0
    while factor <= 0.0:
        factor = 1.0 + deviation * random.standard_normal()
    return float(factor)


def model_text(name: str, building: DerivedBuilding | CapacityBuilding, rules: str) -> str:
    """A model file in SI units with everything written out: name, stories from the ground up, damping, method."""
    description = (
        f"{building.design_level}-code {building.type}" if isinstance(building, DerivedBuilding) else building.name
    )
    lines = [
        f"# A {description} building by the rules {rules}, made by `tdint inventory`.",
        f"name: {json.dumps(name, ensure_ascii=False)}",
        "stories:",
    ]
    # All numbers to the last digit: the file gives the same building as the rules.
    for story in building.stories:
        if isinstance(building, DerivedBuilding):
            values = zip(LAWS[story.law.name].parameters, story.law.parameters, strict=True)
            law = ", ".join([f"type: {story.law.name}", *(f"{key.name}: {value!r}" for key, value in values)])
        else:
            law = _multilinear(story, building.degradation)
        lines += [f"  - mass: {story.mass!r}", f"    height: {story.height!r}"]
        lines += [f"    stiffness: {story.stiffness!r}", f"    law: {{{law}}}"]
    damping = building.damping
    if isinstance(damping, RayleighRatio):
        form = f"ratio: {damping.ratios[0]!r}, modes: [{damping.modes[0]}, {damping.modes[1]}]"
    else:
        form = f"mass: {damping.mass!r}, stiffness: {damping.stiffness!r}"
    return "\n".join([*lines, f"damping: {{rayleigh: {{{form}}}}}", "analysis: {method: impulse4}", ""])


def _multilinear(story: Story, degradation: bool) -> str:
    numbers = story.law.parameters
    points = ", ".join(f"[{d!r}, {f!r}]" for d, f in zip(numbers[0:8:2], numbers[1:8:2], strict=True))
    drift, force, unloading = numbers[16:19]
    text = (
        f"type: multilinear-pinching, backbone: [{points}], "
        f"pinching: {{drift: {drift!r}, force: {force!r}, unloading: {unloading!r}}}, ultimate_drift: {numbers[22]!r}"
    )
    # Parameters that lose nothing are left out, as in files that people write.
    if not degradation:
        return text
    names = ("peak", "work", "peak_exponent", "work_exponent", "limit")
    parts = []
    for place, kind in enumerate(("stiffness", "drift", "strength")):
        values = zip(names, numbers[23 + 5 * place : 28 + 5 * place], strict=True)
        parts.append(f"{kind}: {{{', '.join(f'{name}: {value!r}' for name, value in values)}}}")
    return f"{text}, degradation: {{{', '.join(parts)}, capacity: {numbers[38]!r}}}"


def inventory(
    source: str | Path,
    *,
    units: str = "m",
    rules: str = "mdof-lu",
    stiffness: float = 0.0,
    damping: float = 0.0,
    seed: int = 0,
) -> Several[InventoryBuilding]:
    """Shear buildings by rules from a table of buildings.

    Parameters
    ----------
    source : str or Path
        The CSV file.
    units : str
        Of its lengths, such as `m` or `ft`; areas are in its square.
    rules : str
        One of `RULES` without classes.
    stiffness, damping, seed
        Scatter, as of `derive_all`.

    Returns
    -------
    Several of InventoryBuilding
        One for each row of the table.

    Raises
    ------
    UsageError
        Unknown units or rules, or a scatter out of range.
    ModelError
        The file cannot be read, lacks a column, or has rows that cannot be used: all of them.
    """
    if units not in LENGTH:
        raise UsageError(f"unknown unit of length {units!r:.60}; known: {', '.join(LENGTH)}")
    rows, faults = read_inventory(os.fspath(source), LENGTH[units])
    if faults:
        raise ModelError(faults)
    return Several(derive_all(rows, rules, stiffness=stiffness, damping=damping, seed=seed))
