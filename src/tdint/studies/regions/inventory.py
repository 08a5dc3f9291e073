"""Derive the buildings of an inventory from a set of rules, and write their model files.

An inventory is a CSV file with a building per row. Stiffness and damping can be sampled at random
around the values of the rules.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import compress, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property
from tdint.csv_table import BLOCK, CsvTable, TextColumn, number, number_error, stream_table
from tdint.errors import ModelError, ModelFault, UsageError
from tdint.items import LazySequence
from tdint.model import capacity, mdof_lu
from tdint.model.building_rules import CAPACITY, RULES
from tdint.model.definition import RayleighRatio
from tdint.model.keys.fields import POSITIVE, RATIO, Bounds
from tdint.model.plausibility import USUAL, period_range
from tdint.model.story import Story
from tdint.model.story_laws import LAWS
from tdint.studies.regions.exposure import TAXONOMY, read_mapping, stream_exposure
from tdint.tabular import ResultList
from tdint.units import LENGTH

# ---- Read an inventory. Column names are those of SimCenter's regional workflow.

NEEDED = ("id", "NumberOfStories", "YearBuilt", "StructureType", "PlanArea")
OPTIONAL = ("height", "seismicZone", "DampingRatio", "DesignLevel", "Latitude", "Longitude")
_COLUMNS = (*NEEDED, *OPTIONAL)
NEEDED_WITH_CLASSES = ("id", "class", "NumberOfStories")
_CLASS_COLUMNS = (
    *NEEDED_WITH_CLASSES,
    "height",
    "mass_kg",
    "DampingRatio",
    "Latitude",
    "Longitude",
)
_NUMBERS = {
    "PlanArea": POSITIVE,
    "height": POSITIVE,
    "mass_kg": POSITIVE,
    "DampingRatio": RATIO,
    "Latitude": Bounds(-90.0, 90.0),
    "Longitude": Bounds(-360.0, 360.0),
}
"""Allowed range of the columns where every building may have a different number. The other
columns contain few distinct texts, which are checked once each."""

_REQUIREMENTS = (
    f"an inventory is a CSV file with a building per row and the columns {', '.join(NEEDED)}"
)
_DESIGN_LEVELS = (
    {level: level for level in mdof_lu.LEVELS}
    | {f"{level}-code": level for level in mdof_lu.LEVELS}
    | {f"{level[0]}c": level for level in mdof_lu.LEVELS}
)
"""Design levels by their spellings in inventories: `high`, `high-code` and `hc` are equivalent."""


def _columns_of(
    classes: Mapping[str, capacity.CapacityClass] | None,
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the columns that tdint uses, and of the required columns."""
    return (_COLUMNS, NEEDED) if classes is None else (_CLASS_COLUMNS, NEEDED_WITH_CLASSES)


@dataclass(frozen=True, slots=True)
class InventoryRow:
    """Building of an inventory.

    Attributes
    ----------
    id : str
        Unique identifier.
    latitude, longitude : float | None
        Location, degrees; None if the file does not contain it.
    columns : tuple of str
        Names of all columns except the id, as in the file; the same object for all rows.
    cells : str
        Texts of these columns as a JSON list, which needs one object for each of millions of rows.
    changes : tuple of (str, float)
        Parameters that a sweep changes, with their values (`tdint.model.parameters.PARAMETERS`).
    label : str
        Name of this variation of the building.
    """

    id: str
    facts: mdof_lu.BuildingFacts | capacity.CapacityFacts
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
    classes: Mapping[str, capacity.CapacityClass] | None = None,
    as_published: bool = False,
    mapping: str | None = None,
) -> tuple[InventoryRows, list[ModelFault]]:
    """Read the buildings of a CSV file (`-` is standard input), or of an exposure model of
    OpenQuake. Return the valid rows, and the errors of all other rows.

    Areas are in the square of the unit of lengths (m). With `mass_only`, buildings have no
    stiffness-proportional damping. With building classes, the column `class` specifies the class of
    a building; year, type and area are not required. `as_published` is the value of
    `CapacityFacts.as_published` for all buildings. With `mapping`, a CSV file with the columns of
    an inventory for each taxonomy, the source is an exposure model
    (`tdint.studies.regions.exposure`).

    Raises
    ------
    ModelError
        The file cannot be read, or a required column is missing.
    """
    columns, needed = _columns_of(classes)
    arguments = (length, mass_only, classes, as_published)
    if mapping is None:
        # `requirements` describes a valid file in error messages. Its list of columns is replaced,
        # because an inventory with classes requires other columns. `read_first` loads the complete
        # file into memory; `rows` yields its rows on demand.
        requirements = _REQUIREMENTS.replace(", ".join(NEEDED), ", ".join(needed))
        table, rows = stream_table(source, requirements, columns=columns, read_first=True)
    else:
        # The mapping table must contain all required columns except the first, which is the id of
        # a building.
        taxonomies = read_mapping(mapping)
        taxonomies.need(*needed[1:])
        # Read the mapping table as an inventory: rename the column `taxonomy` to `id`.
        header = tuple("id" if name == TAXONOMY else name for name in taxonomies.header)
        renamed = _Table(replace(taxonomies, header=header, titles=header), *arguments)
        renamed.read(iter(taxonomies.rows))
        if faults := _separate_valid_rows(renamed)[1]:
            raise ModelError(faults)
        table, rows = stream_exposure(source, taxonomies, columns)
    inventory_table = _Table(table, *arguments)
    # `read` accepts a header without the required columns; `need` raises ModelError if a column is
    # missing. In this order, a row that cannot be read is reported before a missing column.
    inventory_table.read(rows)
    table.need(*needed)
    return _separate_valid_rows(inventory_table)


def _separate_valid_rows(table: _Table) -> tuple[InventoryRows, list[ModelFault]]:
    """Return the valid rows of a table, and the errors of the other rows in the order of the file.

    The first of several rows with the same id is valid, the other rows are errors.
    """
    faults: list[ModelFault] = []
    # In a table of a million rows almost all rows are valid. Only the other rows are read cell by
    # cell, which is much slower, to list their errors.
    valid = table.valid_rows()
    first_lines: dict[str, int] = {}  # line of the first building with each id
    for index in np.flatnonzero(~valid).tolist():
        # A surplus cell shifts the cells after it, so no cell of the row can be trusted.
        if index in table.overfull:
            surplus = table.overfull[index]
            faults.append(table.fault(index, len(table.table.header), "", surplus))
            continue
        building = _read_row(table, index, faults)
        # The id must be unique, because tables refer to a building by its id, and the id determines
        # its random samples.
        if building and building.id in first_lines:
            message = (
                f"{building.id!r} is already on line {first_lines[building.id]}; use a different "
                "id for each building"
            )
            faults.append(table.fault(index, table.column_indices["id"], "id", message))
        elif building:
            first_lines[building.id] = table.lines[index]
            valid[index] = True
    return InventoryRows(table, np.flatnonzero(valid)), sorted(
        faults, key=lambda fault: (fault.line, fault.column)
    )


@dataclass(frozen=True)
class _Table:
    """Text of an inventory by columns, with the arguments of `read_inventory`.

    Attributes
    ----------
    length, mass_only, classes, as_published
        Arguments of `read_inventory`.
    columns : list of TextColumn
        Texts of each column.
    lines : array of int
        Line number of each row.
    overfull : dict of int to str
        Error of each row that has more cells than the header, by the index of the row.
    """

    table: CsvTable
    length: float
    mass_only: bool
    classes: Mapping[str, capacity.CapacityClass] | None
    as_published: bool
    columns: list[TextColumn] = field(default_factory=list)
    lines: array[int] = field(default_factory=lambda: array("i"))
    overfull: dict[int, str] = field(default_factory=dict)

    def read(self, rows: Iterator[tuple[int, list[str]]]) -> None:
        """Read all rows and fill `columns`, `lines` and `overfull`.

        `rows` contains the line number and cells of each row.
        """
        self.columns.extend(TextColumn() for _ in self.table.header)
        while block := list(islice(rows, BLOCK)):
            for index, (line, cells) in enumerate(block, start=len(self.lines)):
                self.lines.append(line)
                if error := self.table.surplus(cells):
                    self.overfull[index] = error
            columns = self.table.columns_of([cells for _, cells in block])
            for column, column_cells in zip(self.columns, columns, strict=True):
                column.add(tuple(map(str.strip, column_cells)))

    @cached_property
    def column_indices(self) -> dict[str, int]:
        """Indices of the columns that tdint uses, by name."""
        names, _ = _columns_of(self.classes)
        return {
            name: self.table.header.index(name.lower()) for name in names if self.table.has(name)
        }

    def fault(self, index: int, column: int, name: str, message: str) -> ModelFault:
        """Return the error of the cell in a row and a column, both numbered from 0."""
        return ModelFault(self.table.source, self.lines[index], column + 1, name, message)

    @cached_property
    def carried(self) -> dict[int, str]:
        """Indices and names of the columns that are copied to results: all except the id."""
        named = enumerate(zip(self.table.titles, self.table.header, strict=True))
        return {index: title for index, (title, name) in named if title and name != "id"}

    @cached_property
    def numbers(self) -> dict[str, Array]:
        """Values of the numeric columns by name; nan for cells without a number."""
        names = (name for name in ("NumberOfStories", *_NUMBERS) if name in self.column_indices)
        return {name: self.columns[self.column_indices[name]].numbers() for name in names}

    def valid_rows(self) -> NDArray[np.bool_]:
        """Return a mask of the rows that contain no error."""
        ids = self.columns[self.column_indices["id"]]
        valid = np.ones(len(ids), dtype=bool)
        # Ids must be unique and not empty. Ids with different hashes are different. An array of
        # hashes requires an eighth of the memory of a set of ids, so the ids are counted only if
        # two hashes are equal.
        hashes = np.sort(np.fromiter(map(hash, ids), np.int64, len(ids)))
        if (np.diff(hashes) == 0).any() or "" in ids:
            count = Counter(ids)
            valid = np.array([bool(name) and count[name] == 1 for name in ids])
        valid[list(self.overfull)] = False
        for name in self.numbers.keys() & _NUMBERS.keys():
            is_allowed = _NUMBERS[name].allow(self.numbers[name])
            # Cells of optional columns may be empty.
            if name not in NEEDED and not is_allowed.all():
                is_allowed |= np.array(
                    [not text for text in self.columns[self.column_indices[name]]]
                )
            valid &= is_allowed
        # The remaining columns contain few distinct texts. A row is valid if the first row with the
        # same texts in these columns is read without an error.
        names = [name for name in self.column_indices if name not in ("id", *_NUMBERS)]
        columns = [self.columns[self.column_indices[name]] for name in names]
        readable: dict[tuple[str, ...], bool] = {}
        for row, texts in enumerate(zip(*columns, strict=True)):
            if texts not in readable and valid[row]:
                readable[texts] = _read_row(self, row, []) is not None
            if not readable.get(texts):
                valid[row] = False
        return valid


Changes = tuple[tuple[tuple[str, float], ...], str]
"""Variation of a building in a sweep: names and values of the changed parameters, and the label."""


@dataclass(frozen=True, eq=False)
class InventoryRows(LazySequence[InventoryRow]):
    """Buildings of a table, created on access, and arrays of their properties.

    Attributes
    ----------
    indices : ndarray of int
        Indices of the rows in the table.
    near : tuple of (sequence of str, ndarray of int, ndarray), or None
        Names of all sites, index of the nearest site for each row, and its distance, m. Results
        contain them before the other columns.
    changes : sequence of Changes
        Variations of each building in a sweep. Default: the unchanged building.
    """

    table: _Table
    indices: NDArray[np.int64]
    near: tuple[Sequence[str], NDArray[np.int64], Array] | None = None
    changes: Sequence[Changes] = (((), ""),)

    def __len__(self) -> int:
        return len(self.indices) * len(self.changes)

    def make(self, number: int) -> InventoryRow:
        """Create the building with index `number`.

        The variations of the first row come first, followed by those of the second row, and so on.
        """
        position, variation = divmod(number, len(self.changes))
        row_index = int(self.indices[position])
        # The row is valid, so that the list that receives its errors remains empty.
        row = _read_row(self.table, row_index, [])
        assert row is not None
        changes, label = self.changes[variation]
        cells = [self.table.columns[column][row_index] for column in self.table.carried]
        if self.near is not None:
            # Names of all sites; for each row, the index of its nearest site and the distance, m.
            names, sites, distances = self.near
            distance_km = 1e-3 * distances[position]
            cells = [names[sites[position]], f"{distance_km:.6g}", *cells]
        return replace(
            row, columns=self.titles, cells=json.dumps(cells), changes=changes, label=label
        )

    @cached_property
    def titles(self) -> tuple[str, ...]:
        """Names of the columns that are copied to results."""
        return (*(("site", "distance_km") if self.near else ()), *self.table.carried.values())

    def only(self, kept: NDArray[np.bool_]) -> InventoryRows:
        """Return the selected rows. Sites and variations must not have been assigned yet."""
        return InventoryRows(self.table, self.indices[kept])

    def texts(self, name: int | str) -> TextColumn:
        """Return the texts of a column, by its index or by its name (case is ignored).

        Each row is contained one time, regardless of the number of variations.
        """
        index = self.table.table.header.index(name.lower()) if isinstance(name, str) else name
        column = self.table.columns[index]
        if len(self.indices) == len(column):
            return column
        is_selected = np.zeros(len(column), dtype=bool)
        is_selected[self.indices] = True
        return TextColumn(compress(column, is_selected.tolist()))

    def faults(self, message: Callable[[int, str], str], *names: str) -> list[ModelFault]:
        """Return the errors of columns in the order of the file, with the lines of their cells.

        Parameters
        ----------
        message : callable
            Receives the number of a row in these rows, from 0, and the text of its cell. Returns an
            error message, or an empty string if the cell is valid.
        """
        faults = []
        for name in names:
            self.table.table.need(name)
            column = self.table.table.header.index(name.lower())
            cells = enumerate(zip(self.indices.tolist(), self.texts(name), strict=True))
            for row_number, (row_index, text) in cells:
                if error := message(row_number, text):
                    faults.append(self.table.fault(row_index, column, name, error))
        return sorted(faults, key=lambda fault: (fault.line, fault.column))

    @property
    def is_varied(self) -> bool:
        """True if a sweep changes the buildings."""
        return any(changes for changes, _ in self.changes)

    @property
    def stories(self) -> NDArray[np.int64]:
        """Number of stories of each building."""
        return np.repeat(
            self.table.numbers["NumberOfStories"][self.indices].astype(np.int64), len(self.changes)
        )

    @cached_property
    def locations(self) -> Array:
        """Longitude and latitude of each building, degrees, shape (rows, 2); nan if unknown."""
        unknown = np.full(len(self.table.lines), math.nan)
        degrees = [
            self.table.numbers.get(name, unknown)[self.indices] for name in reversed(_COORDINATES)
        ]
        return np.repeat(np.column_stack(degrees), len(self.changes), axis=0)

    @cached_property
    def equivalent_indices(self) -> Sequence[int]:
        """Index of the first equivalent building for each building.

        Equivalent buildings differ only in id, location, floor area and mass, so that they have the
        same response per unit mass. In a sweep each building has only itself as equivalent.
        """
        if self.is_varied:
            return range(len(self))
        first_indices: dict[tuple[str, ...], int] = {}  # by the texts of the other columns
        columns = (
            self.texts(index)
            for name, index in self.table.column_indices.items()
            if name not in INDIVIDUAL_COLUMNS
        )
        return [
            first_indices.setdefault(cells, number)
            for number, cells in enumerate(zip(*columns, strict=True))
        ]

    def digest(self, *, carried: bool) -> str:
        """Return a SHA-256 of the buildings.

        Parameters
        ----------
        carried : bool
            True for the columns that are copied to results (`_Table.carried`) and the nearest sites
            (`near`); False for everything that defines the response of the buildings. Coordinates
            are then not included, because they only assign sites to buildings.
        """
        table = self.table
        defining_values = (
            (self.titles,)
            if carried
            else (table.length, table.mass_only, table.as_published, table.classes, self.changes)
        )
        digest = hashlib.sha256(repr(defining_values).encode())
        columns = (
            table.carried
            if carried
            else [index for name, index in table.column_indices.items() if name not in _COORDINATES]
        )
        # The name before each column separates it from the column before. A column is added in
        # parts, so that its text is never in memory as a whole.
        for column in columns:
            digest.update(repr(table.table.header[column]).encode())
            for part_number, texts in enumerate(self.texts(column).parts()):
                separator = "\n" if part_number > 0 else ""
                digest.update((separator + "\n".join(texts)).encode())
        if carried and self.near is not None:
            names, sites, distances = self.near
            digest.update(repr(names).encode() + sites.tobytes() + distances.tobytes())
        return digest.hexdigest()


_COORDINATES = ("Latitude", "Longitude")
INDIVIDUAL_COLUMNS = ("id", "PlanArea", "mass_kg", *_COORDINATES)
"""Columns that differ between buildings with the same response per unit mass."""


def _read_row(table: _Table, index: int, faults: list[ModelFault]) -> InventoryRow | None:
    """Return the building that a row defines; None after the errors of its cells have been appended
    to `faults`. All cells are converted, so that all errors are reported."""
    values: dict[str, Any] = {}
    earlier_faults = len(faults)
    _, needed = _columns_of(table.classes)
    for name, column in table.column_indices.items():
        text = table.columns[column][index]
        # Cells of optional columns may be empty; the facts of the building then have a default.
        if not text and name not in needed:
            continue
        try:
            values[name] = _CONVERSIONS[name](text)
            if name == "class":
                _check_class(text, table.classes or {})
        except UsageError as error:
            faults.append(table.fault(index, column, name, str(error)))
    if len(faults) > earlier_faults:
        return None
    height = values["height"] * table.length if "height" in values else None
    facts: mdof_lu.BuildingFacts | capacity.CapacityFacts
    if table.classes is None:
        facts = mdof_lu.BuildingFacts(
            structure=values["StructureType"],
            stories=values["NumberOfStories"],
            year=values["YearBuilt"],
            area=values["PlanArea"] * table.length**2,
            height=height,
            zone=values.get("seismicZone", "Z4"),
            design_level=values.get("DesignLevel"),
            damping_ratio=values.get("DampingRatio"),
            mass_only=table.mass_only,
        )
    else:
        building_class = table.classes[values["class"]]
        facts = capacity.CapacityFacts(
            building_class.curve,
            values["NumberOfStories"],
            height,
            values.get("mass_kg", capacity.UNIT_MASS),
            building_class.soft_story,
            building_class.degradation,
            values.get("DampingRatio", capacity.DAMPING_RATIO),
            table.as_published,
            values["class"],
        )
    return InventoryRow(values["id"], facts, values.get("Latitude"), values.get("Longitude"))


# The following functions convert the text of a cell. They raise UsageError, with the end of the
# message, if it is invalid.


def _required(text: str) -> str:
    """Return a text that must not be empty."""
    if not text:
        raise UsageError("is missing")
    return text


def _number_within(bounds: Bounds, text: str, expected: str = "") -> float:
    """Return a number; `expected` describes the allowed values, by default the bounds."""
    value, expected = number(text), expected or str(bounds)
    if math.isnan(value) or not bounds.allow(value):
        raise UsageError(number_error(text, expected) if text else f"is missing; give {expected}")
    return value


def _whole_number(low: int, high: int, text: str) -> int:
    """Return a whole number."""
    expected = f"a whole number from {low} to {high}"
    value = _number_within(Bounds(low, high), text, expected)
    if value != int(value):
        raise UsageError(f"must be {expected}, got {text!r}")
    return int(value)


def _choice(spellings: Mapping[str, str], text: str) -> str:
    """Return one of few values by its spelling."""
    if text.lower() not in spellings:
        allowed = ", ".join(dict.fromkeys(spellings.values()))
        raise UsageError(
            f"unknown {text!r}; known: {allowed}" if text else f"is missing; give one of {allowed}"
        )
    return spellings[text.lower()]


def _check_class(name: str, classes: Mapping[str, capacity.CapacityClass]) -> None:
    """Check that the name of a class is known."""
    if name not in classes:
        names = ", ".join(list(classes)[:10]) + " ..." * (len(classes) > 10)
        raise UsageError(f"unknown {name!r}; known: {names}")


_CONVERSIONS: Mapping[str, Callable[[str], Any]] = {
    "id": _required,
    "class": _required,
    "NumberOfStories": partial(_whole_number, 1, mdof_lu.MOST_STORIES),
    "YearBuilt": partial(_whole_number, *mdof_lu.YEARS),
    "StructureType": partial(_choice, {name.lower(): name for name in mdof_lu.STRUCTURES}),
    "seismicZone": partial(_choice, {zone.lower(): zone for zone in mdof_lu.ZONES}),
    "DesignLevel": partial(_choice, _DESIGN_LEVELS),
    **{name: partial(_number_within, bounds) for name, bounds in _NUMBERS.items()},
}
"""Function that converts the text of a cell, by the name of the column."""


# ---- Derive buildings from the rows


_MAX_SCATTER = 0.5
"""Maximum standard deviation of the random factors, whose mean is 1; dimensionless."""


@dataclass(frozen=True)
class InventoryBuilding:
    """Row of the inventory and the building derived from it.

    Attributes
    ----------
    row : InventoryRow
        Row of the inventory.
    building : DerivedBuilding or CapacityBuilding
        Building derived from the row.
    """

    row: InventoryRow
    building: mdof_lu.DerivedBuilding | capacity.CapacityBuilding


def derive_all(
    rows: Sequence[InventoryRow],
    rules: str,
    *,
    stiffness: float = 0.0,
    damping: float = 0.0,
    seed: int = 0,
) -> list[InventoryBuilding]:
    """Derive the buildings of all rows.

    Parameters
    ----------
    rules : str
        Name of the rules, one of `RULES`.
    stiffness, damping : float
        Standard deviations of the factors on the stiffness of a building (its strength does not
        change) and on its damping ratio. The factors have a normal distribution with mean 1; values
        that are not positive are sampled again.
    seed : int
        Seed of the samples, combined with the id of the building. The samples of a building do not
        depend on other rows.

    Raises
    ------
    UsageError
        The rules are unknown, or a standard deviation is out of range.
    """
    if rules not in RULES:
        raise UsageError(f"unknown rules {rules!r}; known: {', '.join(RULES)}")
    for name, deviation in (("stiffness", stiffness), ("damping", damping)):
        if deviation and rules == CAPACITY:
            raise UsageError(
                f"the rules {CAPACITY} do not use the scatter of the {name}, got {deviation:g}; "
                "set it to 0"
            )
        if not 0.0 <= deviation <= _MAX_SCATTER:
            raise UsageError(
                f"the scatter of the {name} must be from 0 to {_MAX_SCATTER:g}, got {deviation:g}"
            )
    derive = partial(derive_row, rules=rules, stiffness=stiffness, damping=damping, seed=seed)
    return [InventoryBuilding(row, derive(row)) for row in rows]


def derive_row(
    row: InventoryRow, rules: str, *, stiffness: float = 0.0, damping: float = 0.0, seed: int = 0
) -> mdof_lu.DerivedBuilding | capacity.CapacityBuilding:
    """Derive the building of one row. `derive_all` describes and checks the parameters."""
    scatter = None
    if stiffness or damping:
        random = np.random.default_rng([seed, *row.id.encode()])
        scatter = mdof_lu.Scatter(
            _sample_factor(random, stiffness), _sample_factor(random, damping)
        )
    return RULES[rules](row.facts, scatter)


def _sample_factor(random: np.random.Generator, deviation: float) -> float:
    """Sample a positive factor with a normal distribution of mean 1."""
    # A factor on a stiffness or a damping ratio must be positive.
    factor = 0.0
    while factor <= 0.0:
        factor = 1.0 + deviation * random.standard_normal()
    return float(factor)


def model_text(
    name: str, building: mdof_lu.DerivedBuilding | capacity.CapacityBuilding, rules: str
) -> str:
    """Return a model file in SI units without defaults: name, stories, damping and method.

    Parameters
    ----------
    rules : str
        Name of the rules, for the comment at the top of the file.
    """
    description = (
        f"{building.design_level}-code {building.type}"
        if isinstance(building, mdof_lu.DerivedBuilding)
        else building.name
    )
    lines = [
        f"# {description} building by the rules {rules}, generated by `tdint inventory`.",
        f"name: {json.dumps(name, ensure_ascii=False)}",
        "stories:",
    ]
    # Write numbers with all significant digits (repr), so that the model file defines exactly the
    # building that is derived by the rules.
    for story in building.stories:
        if isinstance(building, mdof_lu.DerivedBuilding):
            keys = [key.name for key in LAWS[story.law.name].parameters]
            law = {"type": story.law.name} | dict(zip(keys, story.law.parameters, strict=True))
        else:
            law = _multilinear_keys(story, building.degradation)
        lines += [f"  - mass: {story.mass!r}", f"    height: {story.height!r}"]
        lines += [f"    stiffness: {story.stiffness!r}", f"    law: {_flow_text(law)}"]
    damping = building.damping
    form: dict[str, Any]
    if isinstance(damping, RayleighRatio):
        form = {"ratio": damping.ratios[0], "modes": list(damping.modes)}
    else:
        form = {"mass": damping.mass, "stiffness": damping.stiffness}
    return "\n".join(
        [*lines, f"damping: {_flow_text({'rayleigh': form})}", "analysis: {method: impulse4}", ""]
    )


def _flow_text(value: Any) -> str:
    """Return a value as YAML in one line; texts are written without quotation marks."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{name}: {_flow_text(item)}' for name, item in value.items())}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_flow_text, value))}]"
    return value if isinstance(value, str) else repr(value)


def _multilinear_keys(story: Story, degradation: bool) -> dict[str, Any]:
    """Return the hysteretic law `multilinear-pinching` of a story by the keys of a model file.

    The parameters of the law are: 0 to 15, the backbone of each direction (drift and force of four
    points); 16 to 21, the pinching of each direction (3 values); 22, the ultimate drift; 23 to 37,
    the degradation of stiffness, drift and strength (5 values each); 38, the energy capacity. Only
    the first direction is written, because `CapacityBuilding.stories` makes the laws symmetric.
    """
    parameters = story.law.parameters
    law = {
        "type": story.law.name,
        "backbone": [list(parameters[first : first + 2]) for first in range(0, 8, 2)],
        "pinching": dict(zip(("drift", "force", "unloading"), parameters[16:19], strict=True)),
        "ultimate_drift": parameters[22],
    }
    # Parameters of degradation are omitted if the law does not degrade.
    if degradation:
        names = ("peak", "work", "peak_exponent", "work_exponent", "limit")
        groups: dict[str, Any] = {
            quantity: dict(zip(names, parameters[first : first + 5], strict=True))
            for quantity, first in (("stiffness", 23), ("drift", 28), ("strength", 33))
        }
        law["degradation"] = groups | {"capacity": parameters[38]}
    return law


def inventory(
    source: str | Path,
    *,
    units: str = "",
    rules: str = "mdof-lu",
    stiffness_scatter: float = 0.0,
    damping_scatter: float = 0.0,
    seed: int = 0,
    mapping: str | Path | None = None,
) -> ResultList[InventoryBuilding]:
    """Derive shear buildings from a table of buildings.

    Parameters
    ----------
    source : str or Path
        Path of the CSV file, or of an exposure model of OpenQuake.
    units : str
        Unit of lengths, such as `m` or `ft`. Areas are in its square. It is required, as on the
        command line, because a file does not state it.
    rules : str, default "mdof-lu"
        Name of the rules. `capacity` requires classes and is refused here: `tdint inventory` and
        campaigns have them.
    stiffness_scatter, damping_scatter : float, default 0.0
        Standard deviations of the random factors on stiffness and damping ratio, as in campaign
        files (`derive_all`).
    seed : int, default 0
        Seed of the random factors.
    mapping : str or Path, optional
        CSV file with the columns of an inventory for each taxonomy of an exposure model.

    Returns
    -------
    ResultList of InventoryBuilding
        One building for each row of the table.

    Raises
    ------
    UsageError
        Units or rules are unknown, or a standard deviation is out of range.
    ModelError
        The file cannot be read, a column is missing, or rows are invalid. All invalid rows are
        listed.
    """
    file = os.fspath(source)
    if units not in LENGTH:
        known = ", ".join(LENGTH)
        raise UsageError(f"inventory: units {units!r:.60} is no unit of length; known: {known}")
    if rules == CAPACITY:
        raise UsageError("the rules capacity need classes; use `tdint inventory --classes FILE`")
    table = None if mapping is None else os.fspath(mapping)
    rows, faults = read_inventory(file, LENGTH[units], mapping=table)
    if faults:
        raise ModelError(faults)
    return ResultList(
        derive_all(rows, rules, stiffness=stiffness_scatter, damping=damping_scatter, seed=seed)
    )


# ---- Questions about the rows: numbers of stories, heights, periods and drifts that are unusual
# for the building type

_MAX_LISTED = 10
"""Maximum number of rows that are listed, because a wrong unit makes every row unusual."""

Question = tuple[str, str]
"""Name of a column, and the reason why its cell is unusual."""


def unusual_rows(rows: InventoryRows, rules: str) -> list[str]:
    """Return warnings about the unusual rows of an inventory, with file, line and column.

    The first ten rows are listed, and the remaining rows are counted. Random factors on stiffness
    and damping, and the changes of a sweep, are not considered.

    Parameters
    ----------
    rules : str
        Name of the rules that derive the buildings.
    """
    table = rows.table
    # Rows with equal cells in the columns that define a building are derived one time.
    names = [name for name in table.column_indices if name not in INDIVIDUAL_COLUMNS]
    # The rules derive period and drifts independently of the height, so that one building is
    # derived for all heights.
    properties = cache(partial(_properties, rules))
    questions: dict[tuple[str, ...], Sequence[Question]] = {}
    unusual: list[ModelFault] = []
    cells_of_rows = zip(*(rows.texts(name) for name in names), strict=True)
    for position, cells in enumerate(cells_of_rows):
        if cells not in questions:
            questions[cells] = _questions(rows.make(position * len(rows.changes)), properties)
        unusual += [
            table.fault(int(rows.indices[position]), table.column_indices[name], name, text)
            for name, text in questions[cells]
        ]
    warnings = list(map(str, unusual[:_MAX_LISTED]))
    if len(unusual) > _MAX_LISTED:
        omitted = len(unusual) - _MAX_LISTED
        warnings.append(
            f"{table.table.source}: {omitted} more unusual values, {len(unusual)} in total"
        )
    return warnings


def _questions(row: InventoryRow, properties: Callable[..., _Properties]) -> Sequence[Question]:
    """Return the questions about a row. An unusual number of stories or an unusual height is the
    cause of other unusual values, which are then not reported."""
    facts = row.facts
    if isinstance(facts, mdof_lu.BuildingFacts) and facts.structure in mdof_lu.USUAL_STORIES:
        low, high = mdof_lu.USUAL_STORIES[facts.structure]
        if not low <= facts.stories <= high:
            usual = f"{low} to {high} stories" if high > low else "one story"
            return [
                (
                    "NumberOfStories",
                    f"{facts.stories} stories are unusual for {facts.structure}, which has "
                    f"{usual}; check the number of stories and the type",
                )
            ]
    period, height, yield_drift, ultimate_drift = properties(replace(facts, height=None))
    if facts.height is not None:
        height = facts.height / facts.stories
    if not USUAL["height"].contains(height):
        return [("height", USUAL["height"].warning(USUAL["height"].text(height)))]
    usual_period = period_range(facts.stories, facts.stories * height)
    checked = (
        ("NumberOfStories", usual_period, period),
        ("NumberOfStories", USUAL["yield_drift"], yield_drift / height),
        ("NumberOfStories", USUAL["ultimate_drift"], ultimate_drift / height),
    )
    return [
        (name, usual_range.warning(usual_range.text(value)))
        for name, usual_range, value in checked
        if not usual_range.contains(value)
    ]


_Properties = tuple[float, float, float, float]
"""Period, s, and story height of the rules, largest yield drift and largest ultimate drift, m."""


def _properties(rules: str, facts: mdof_lu.BuildingFacts | capacity.CapacityFacts) -> _Properties:
    """Return the properties of the building that the rules derive from facts without a height."""
    derived = RULES[rules](facts, None)
    drifts = (
        (derived.yield_drift, derived.ultimate_drift)
        if isinstance(derived, mdof_lu.DerivedBuilding)
        else (derived.drifts[:, 0], derived.drifts[:, -1])
    )
    yield_drift, ultimate_drift = (float(drift.max()) for drift in drifts)
    return derived.period, float(derived.height[0]), yield_drift, ultimate_drift
