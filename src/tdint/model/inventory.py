"""The buildings of an inventory by a set of rules, with scatter if that is wanted, and their model
files."""

from __future__ import annotations

import hashlib
import json
import math
import os
from abc import abstractmethod
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, islice, zip_longest
from pathlib import Path
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property
from tdint.csv_table import BLOCK, CsvTable, no_number, number, numbers_in, stream_table
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
from tdint.model.mdof_lu import (
    LEVELS,
    MOST_STORIES,
    STRUCTURES,
    YEARS,
    ZONES,
    BuildingFacts,
    DerivedBuilding,
    Scatter,
)
from tdint.tabular import ResultList
from tdint.units import LENGTH
from tdint.written_numbers import how_many

# ---- Reading an inventory: a CSV file with a building per row, under the column names of
# SimCenter's regional workflow

NEEDED = ("id", "NumberOfStories", "YearBuilt", "StructureType", "PlanArea")
OPTIONAL = ("height", "seismicZone", "DampingRatio", "DesignLevel", "Latitude", "Longitude")
_COLUMNS = (*NEEDED, *OPTIONAL)
OF_CLASSES = ("id", "class", "NumberOfStories")
_OF_CLASSES = (*OF_CLASSES, "height", "mass_kg", "DampingRatio", "Latitude", "Longitude")
_NUMBERS = {
    "PlanArea": POSITIVE,
    "height": POSITIVE,
    "mass_kg": POSITIVE,
    "DampingRatio": RATIO,
    "Latitude": Bounds(-90.0, 90.0),
    "Longitude": Bounds(-360.0, 360.0),
}
"""Columns in which each building may have a number of its own; in the others a few words come again
and again."""

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
        What a sweep changes in the building that the rules make
        (`tdint.model.definition.PARAMETERS`).
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


def read_inventory(
    source: str,
    length: float,
    *,
    mass_only: bool = False,
    classes: Mapping[str, CapacityClass] | None = None,
    as_published: bool = False,
) -> tuple[InventoryRows, list[ModelFault]]:
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
        Classes by their names: the column `class` says which one a building is of, and no year,
        type and area is asked.
    as_published : bool
        As of `CapacityFacts`, of all buildings.

    Raises
    ------
    ModelError
        The file cannot be read, or lacks a column.
    """
    columns, needed = (_COLUMNS, NEEDED) if classes is None else (_OF_CLASSES, OF_CLASSES)
    needs = _NEEDS.replace(", ".join(NEEDED), ", ".join(needed))
    table, rows = stream_table(source, needs, columns=columns, whole=True)
    of = _Table(table, length, mass_only, classes, as_published)
    of.read(rows)
    table.need(*needed)
    faults: list[ModelFault] = []
    # Of a million rows almost all are sound; the others are read cell by cell, and tell what is
    # wrong.
    sound, seen = of.sound(), dict[str, int]()
    for at in np.flatnonzero(~sound).tolist():
        row, width = _Row(of, at, faults), len(table.header)
        # One cell too many shifts those behind it: nothing in the row can be trusted.
        if at in of.overfull:
            row.fault(
                width, "", f"{how_many(of.overfull[at], 'cell')} under {how_many(width, 'column')}"
            )
            continue
        building = row.building()
        # By its id a building is found again in tables, and draws are made.
        if building and building.id in seen:
            above = f"{building.id!r} is already on line {seen[building.id]}"
            row.fault(of.places["id"], "id", f"{above}; give each building its own")
        elif building:
            seen[building.id] = of.lines[at]
            sound[at] = True
    return InventoryRows(of, np.flatnonzero(sound)), sorted(
        faults, key=lambda fault: (fault.line, fault.column)
    )


Item = TypeVar("Item")


class Made(Sequence[Item]):
    """Items that are made each time they are asked for: of millions none is kept."""

    @abstractmethod
    def make(self, number: int) -> Item:
        """Make an item."""

    @overload
    def __getitem__(self, at: int) -> Item: ...
    @overload
    def __getitem__(self, at: slice) -> list[Item]: ...
    def __getitem__(self, at: int | slice) -> Item | list[Item]:
        numbers = range(len(self))[at]
        return (
            self.make(numbers)
            if isinstance(numbers, int)
            else [self.make(number) for number in numbers]
        )


@dataclass(frozen=True)
class _Table:
    """An inventory as it is written, by columns, and how it is read: the arguments of
    `read_inventory`."""

    table: CsvTable
    length: float
    mass_only: bool
    classes: Mapping[str, CapacityClass] | None
    as_published: bool
    columns: list[tuple[str, ...]] = field(default_factory=list)
    lines: array[int] = field(default_factory=lambda: array("i"))
    overfull: dict[int, int] = field(default_factory=dict)

    def read(self, rows: Iterator[tuple[int, list[str]]]) -> None:
        """Read its rows: the cells of each column, the lines, and how many cells rows have that
        have too many."""
        width = len(self.table.header)
        blocks: list[list[tuple[str, ...]]] = [[()] * width]
        while block := list(islice(rows, BLOCK)):
            for at, (line, cells) in enumerate(block, start=len(self.lines)):
                self.lines.append(line)
                if len(cells) > width and self.table.overfull(cells):
                    self.overfull[at] = len(cells)
            texts = [
                tuple(map(str.strip, of))
                for of in zip_longest(*(cells for _, cells in block), fillvalue="")
            ]
            # Cells that are missing at the end of all rows are empty ones.
            blocks.append(texts[:width] + [("",) * len(block)] * (width - len(texts)))
        # Tuples of texts, which the collector of cycles leaves alone.
        self.columns.extend(
            tuple(chain.from_iterable(column)) for column in zip(*blocks, strict=True)
        )

    @cached_property
    def places(self) -> dict[str, int]:
        """The places of the columns that count."""
        names = _COLUMNS if self.classes is None else _OF_CLASSES
        return {
            name: self.table.header.index(name.lower()) for name in names if self.table.has(name)
        }

    @cached_property
    def carried(self) -> dict[int, str]:
        """Places and names of those that are carried along: all that have one, but the id."""
        named = enumerate(zip(self.table.titles, self.table.header, strict=True))
        return {place: title for place, (title, name) in named if title and name != "id"}

    @cached_property
    def numbers(self) -> dict[str, Array]:
        """The columns of numbers; nan where none stands."""
        named = (name for name in ("NumberOfStories", *_NUMBERS) if name in self.places)
        return {name: numbers_in(self.columns[self.places[name]]) for name in named}

    def sound(self) -> NDArray[np.bool_]:
        """Of each row whether it is seen to have no fault."""
        ids = self.columns[self.places["id"]]
        sound = np.ones(len(ids), dtype=bool)
        if len(set(ids)) < len(ids) or "" in ids:
            count = Counter(ids)
            sound = np.array([bool(name) and count[name] == 1 for name in ids])
        sound[list(self.overfull)] = False
        for name in self.numbers.keys() & _NUMBERS.keys():
            right = _NUMBERS[name].allow(self.numbers[name])
            # A number that may be left out is none where nothing stands.
            if name not in NEEDED and not right.all():
                right |= np.array([not text for text in self.columns[self.places[name]]])
            sound &= right
        # A word is right if a row with it is read without a fault; each is tried once.
        tried: dict[int, bool] = {}
        for column in (
            self.columns[place]
            for name, place in self.places.items()
            if name not in ("id", *_NUMBERS)
        ):
            firsts = dict(zip(reversed(column), range(len(column) - 1, -1, -1), strict=True))
            for at in firsts.values():
                if at not in tried:
                    tried[at] = bool(sound[at]) and _Row(self, at, []).building() is not None
            right_words = {word for word, at in firsts.items() if tried[at]}
            if len(right_words) < len(firsts):
                sound &= np.array([word in right_words for word in column], dtype=bool)
        return sound


Changes = tuple[tuple[tuple[str, float], ...], str]
"""What a sweep changes in a building, and the label, as of `InventoryRow`."""


@dataclass(frozen=True, eq=False)
class InventoryRows(Made[InventoryRow]):
    """The buildings of a table, each made when it is asked for, and what is asked of all of them,
    as arrays.

    Attributes
    ----------
    of : _Table
        The table.
    at : ndarray of int
        Which of its rows.
    near : tuple of (sequence of str, ndarray of int, ndarray), or None
        All sites, the number of that of each row, and how far away it is, m: carried along before
        the other columns.
    changes : sequence of Changes
        What a sweep makes of each building; as they are by default.
    """

    of: _Table
    at: NDArray[np.int64]
    near: tuple[Sequence[str], NDArray[np.int64], Array] | None = None
    changes: Sequence[Changes] = (((), ""),)

    def __len__(self) -> int:
        return len(self.at) * len(self.changes)

    def make(self, number: int) -> InventoryRow:
        place, change = divmod(number, len(self.changes))
        row = _Row(self.of, int(self.at[place]), []).building()
        assert row is not None
        changes, label = self.changes[change]
        cells = [self.of.columns[column][self.at[place]] for column in self.of.carried]
        if self.near is not None:
            names, sites, away = self.near
            cells = [names[sites[place]], f"{1e-3 * away[place]:.6g}", *cells]
        return replace(
            row, columns=self.titles, cells=json.dumps(cells), changes=changes, label=label
        )

    @cached_property
    def titles(self) -> tuple[str, ...]:
        """Of the columns that are carried along."""
        return (*(("site", "distance_km") if self.near else ()), *self.of.carried.values())

    def only(self, kept: NDArray[np.bool_]) -> InventoryRows:
        """Some of them, before they have sites and changes."""
        return InventoryRows(self.of, self.at[kept])

    def texts(self, place: int | str) -> Sequence[str]:
        """What stands in a column, by its place or its name without regard to case, for a row
        once."""
        column = self.of.columns[
            self.of.table.header.index(place.lower()) if isinstance(place, str) else place
        ]
        return column if len(self.at) == len(column) else [column[at] for at in self.at.tolist()]

    def faults(self, name: str, message: Callable[[int, str], str]) -> list[ModelFault]:
        """What is wrong with the cells of a column, by the number of a row and what stands there;
        nothing to say of a cell is no fault."""
        table, lines = self.of.table, self.of.lines
        table.need(name)
        told = enumerate(zip(self.at.tolist(), self.texts(name), strict=True))
        place = table.header.index(name.lower()) + 1
        said = ((lines[at], message(number, text)) for number, (at, text) in told)
        return [ModelFault(table.source, line, place, name, text) for line, text in said if text]

    @property
    def is_varied(self) -> bool:
        """Whether a sweep changes them."""
        return any(changes for changes, _ in self.changes)

    @property
    def stories(self) -> NDArray[np.int64]:
        """How many stories each has."""
        return np.repeat(
            self.of.numbers["NumberOfStories"][self.at].astype(np.int64), len(self.changes)
        )

    @cached_property
    def places(self) -> Array:
        """Longitude and latitude of each, degrees, shape (rows, 2); nan where they are not told."""
        nowhere = np.full(len(self.of.lines), math.nan)
        degrees = [self.of.numbers.get(name, nowhere)[self.at] for name in reversed(_PLACES)]
        return np.repeat(np.column_stack(degrees), len(self.changes), axis=0)

    @cached_property
    def alike(self) -> Sequence[int]:
        """Of each the first one that differs from it by id, place and size alone; itself in a
        sweep."""
        if self.is_varied:
            return range(len(self))
        first: dict[tuple[str, ...], int] = {}
        columns = (
            self.texts(place) for name, place in self.of.places.items() if name not in _OF_ONE
        )
        return [
            first.setdefault(cells, number)
            for number, cells in enumerate(zip(*columns, strict=True))
        ]

    def digest(self, *, carried: bool) -> str:
        """SHA-256 of what the buildings are, or of what is carried along, as it is written."""
        of = self.of
        about = (
            (self.titles,)
            if carried
            else (of.length, of.mass_only, of.as_published, of.classes, self.changes)
        )
        whole = hashlib.sha256(repr(about).encode())
        for place in (
            of.carried
            if carried
            else [of.places[name] for name in of.places if name not in _PLACES]
        ):
            whole.update("\n".join(self.texts(place)).encode())
        if carried and self.near is not None:
            whole.update(
                repr(self.near[0]).encode() + self.near[1].tobytes() + self.near[2].tobytes()
            )
        return whole.hexdigest()


_PLACES = ("Latitude", "Longitude")
_OF_ONE = ("id", "PlanArea", "mass_kg", *_PLACES)


class _Row:
    """A row whose cells are read; what is wrong is noted."""

    def __init__(self, of: _Table, at: int, faults: list[ModelFault]) -> None:
        self._of, self._places, self._faults, self._before = of, of.places, faults, len(faults)
        self._line, self._cells = of.lines[at], [column[at] for column in of.columns]

    def fault(self, place: int, name: str, message: str) -> None:
        """Note what is wrong with a cell."""
        self._faults.append(ModelFault(self._of.table.source, self._line, place + 1, name, message))

    def building(self) -> InventoryRow | None:
        """The building; None after a fault."""
        classes, given = self._of.classes, self._cell
        facts = self._facts() if classes is None else self._facts_of_class(classes)
        name = self._cell("id")
        if not name:
            self.fault(self._places["id"], "id", "is missing")
        latitude, longitude = (self._number(name) if given(name) else None for name in _PLACES)
        if facts is None or len(self._faults) > self._before:
            return None
        return InventoryRow(name, facts, latitude, longitude)

    def _facts_of_class(self, classes: Mapping[str, CapacityClass]) -> CapacityFacts | None:
        """What is said of a building of a class; None after a fault."""
        name, given, length, published = (
            self._cell("class"),
            self._cell,
            self._of.length,
            self._of.as_published,
        )
        if name not in classes:
            names = ", ".join(list(classes)[:10]) + " ..." * (len(classes) > 10)
            self.fault(
                self._places["class"],
                "class",
                f"unknown {name!r}; known: {names}" if name else "is missing",
            )
        # All cells are read before the first fault ends it, so that all are told.
        stories = self._whole("NumberOfStories", 1, MOST_STORIES)
        height = self._number("height") * length if given("height") else None
        mass = self._number("mass_kg") if given("mass_kg") else UNIT_MASS
        ratio = self._number("DampingRatio") if given("DampingRatio") else DAMPING_RATIO
        if len(self._faults) > self._before:
            return None
        of = classes[name]
        return CapacityFacts(
            of.curve, stories, height, mass, of.soft_story, of.degradation, ratio, published, name
        )

    def _facts(self) -> BuildingFacts:
        """What is said of a building by its type."""
        given, length = self._cell, self._of.length
        zones = {zone.lower(): zone for zone in ZONES}
        return BuildingFacts(
            structure=self._word(
                "StructureType", {structure.lower(): structure for structure in STRUCTURES}
            ),
            stories=self._whole("NumberOfStories", 1, MOST_STORIES),
            year=self._whole("YearBuilt", *YEARS),
            area=self._number("PlanArea") * length**2,
            height=self._number("height") * length if given("height") else None,
            zone=self._word("seismicZone", zones) if given("seismicZone") else "Z4",
            design_level=self._word("DesignLevel", _DESIGN_LEVELS)
            if given("DesignLevel")
            else None,
            damping_ratio=self._number("DampingRatio") if given("DampingRatio") else None,
            mass_only=self._of.mass_only,
        )

    def _cell(self, name: str) -> str:
        return self._cells[self._places[name]] if name in self._places else ""

    def _number(self, name: str, bounds: Bounds | None = None, expected: str = "") -> float:
        text, bounds = self._cell(name), bounds or _NUMBERS[name]
        value = number(text)
        if not math.isnan(value) and bounds.allow(value):
            return value
        expected = expected or str(bounds)
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
        message = (
            f"unknown {text!r}; known: {words}" if text else f"is missing; give one of {words}"
        )
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
    rows: Sequence[InventoryRow],
    rules: str,
    *,
    stiffness: float = 0.0,
    damping: float = 0.0,
    seed: int = 0,
) -> list[InventoryBuilding]:
    """The buildings of all rows.

    Parameters
    ----------
    stiffness, damping : float
        Standard deviations of factors with the mean 1 on the stiffness of a building, whose
        strength stays, and on its damping ratio: normal, drawn again where they are not positive.
    seed : int
        What the factors are drawn from, with the id of the building: they do not depend on the
        other rows.

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
            raise UsageError(
                f"the scatter of the {name} must be from 0 to {_MOST_SCATTER:g}, got {deviation:g}"
            )
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
    """A model file in SI units with everything written out: name, stories from the ground up,
    damping, method."""
    description = (
        f"{building.design_level}-code {building.type}"
        if isinstance(building, DerivedBuilding)
        else building.name
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
            law = ", ".join(
                [f"type: {story.law.name}", *(f"{key.name}: {value!r}" for key, value in values)]
            )
        else:
            law = _multilinear(story, building.degradation)
        lines += [f"  - mass: {story.mass!r}", f"    height: {story.height!r}"]
        lines += [f"    stiffness: {story.stiffness!r}", f"    law: {{{law}}}"]
    damping = building.damping
    if isinstance(damping, RayleighRatio):
        form = f"ratio: {damping.ratios[0]!r}, modes: [{damping.modes[0]}, {damping.modes[1]}]"
    else:
        form = f"mass: {damping.mass!r}, stiffness: {damping.stiffness!r}"
    return "\n".join(
        [*lines, f"damping: {{rayleigh: {{{form}}}}}", "analysis: {method: impulse4}", ""]
    )


def _multilinear(story: Story, degradation: bool) -> str:
    numbers = story.law.parameters
    points = ", ".join(
        f"[{d!r}, {f!r}]" for d, f in zip(numbers[0:8:2], numbers[1:8:2], strict=True)
    )
    drift, force, unloading = numbers[16:19]
    text = (
        f"type: multilinear-pinching, backbone: [{points}], pinching: {{drift: {drift!r}, force: "
        f"{force!r}, unloading: {unloading!r}}}, ultimate_drift: {numbers[22]!r}"
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
) -> ResultList[InventoryBuilding]:
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
    ResultList of InventoryBuilding
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
    return ResultList(derive_all(rows, rules, stiffness=stiffness, damping=damping, seed=seed))
