"""Forces on floors from tables in CSV files, or from points in the model file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from tdint.csv_table import BLOCK, CsvTable, numbers_in, stream_table
from tdint.errors import ModelError, nearest
from tdint.files import digest_of
from tdint.model.config.number_tables import numbers_of_rows
from tdint.model.config.sections import ModelUnits
from tdint.model.definition import LoadTable, TableForce
from tdint.model.keys.fields import ROOF, Section, Value, quoted
from tdint.number_parsing import number_or_nan, pluralize
from tdint.units import ACCELERATION, FORCE, LENGTH, MASS, VELOCITY

_NEEDS = (
    "a table of forces is a CSV file with a column of times, such as time_s, and columns of "
    "forces, such as roof_kN"
)
_TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0}
"""Factors to s of the units in the name of the column of times; s without a unit."""

_TIME_COLUMN = rf"(?:time|t)(?:(?:_| ?[(\[])({'|'.join(_TIMES)})[)\]]?)?"
"""Name of the column of times in lower case: `time`, `t_ms`, `time (s)` or `t[s]`."""

_OTHER_UNITS = {*LENGTH, *MASS, *VELOCITY, *ACCELERATION} - {"t"}
"""Units that a column of forces must not have. `t` is allowed, because it can belong to a name."""

_UNIT_ENDING = re.compile(r".*(?:_|\s)([^\W_]+)|.*\(\s*([^\W_]+)\s*\)|.*\[\s*([^\W_]+)\s*\]")
"""Unit at the end of the name of a column: `roof_kN`, `roof kN`, `roof (kN)` or `roof [kN]`."""

_NAME_AND_FACTOR = r"\s*(\S+?)\s*(?:\*\s*|\s)(\S.*?)\s*"
"""Factor and name of a column: `0.6 roof_kN` or `0.6 * roof_kN`."""


@dataclass(frozen=True)
class _Request:
    """Column of a file that acts on a floor.

    Attributes
    ----------
    value : Value or _Failing
        Entry of the model file, for messages.
    column : str
        Name of the column; empty for the only column of forces.
    """

    value: Value | _Failing
    floor: int
    column: str
    factor: float
    start: float


def read_table_forces(
    sections: Sequence[Section], unit: ModelUnits, count: int | None, names: Sequence[str] = ()
) -> tuple[TableForce, ...]:
    """Return the forces from tables, in the order of the model file.

    Each file is read one time, and the forces from its columns share one table.

    Parameters
    ----------
    sections : sequence of Section
        Entries of `forces` with a file or with points.
    unit : ModelUnits
        Units of points and of columns without a unit.
    count : int | None
        Number of stories; None if it is unknown after an error.
    names : sequence of str
        Names of rows that are not floors.
    """
    requests: dict[str, list[_Request]] = {}
    forces: list[TableForce] = []
    for section in sections:
        start = section.number("start", default=0.0)
        scale = section.number("scale", default=1.0)
        points = section.get("points")
        if points is not None:
            section.refuse(("file", "floors", "column"), "cannot be used with `points`")
            floor = _read_floor(section, count, names)
            table = _read_points(points, unit)
            if table is not None:
                forces.append(TableForce(floor, table, 0, scale, start))
            continue
        file = section.need("file", "give the file of the table, or `points`")
        path = file.file() if file else None
        found = read_requests(section, file or section.value, count, scale, start, names)
        if path is not None and found:  # otherwise an error has been reported
            requests.setdefault(path, []).extend(found)
    for path, wanted in requests.items():
        try:
            forces += _read_file(path, wanted, unit.force)
        except ModelError as error:
            wanted[0].value.fault(str(error))
    return tuple(forces)


def _read_floor(section: Section, count: int | None, names: Sequence[str]) -> int:
    """Return the entry `floor`; 0 after reporting an error."""
    floor = section.need("floor", "give the floor, counted from 1 at the bottom")
    return floor.floor(count, names) if floor else 0


def read_requests(
    section: Section,
    file: Value,
    count: int | None,
    scale: float,
    start: float,
    names: Sequence[str] = (),
) -> list[_Request]:
    """Return the columns of the file that act on floors: `floors`, or `floor` and `column`.

    Errors of the only column of forces are reported at the entry `file`. `count` is the number of
    stories; if it is unknown (None), the floor `roof` is 0. `names` are the names of rows that are
    not floors.
    """
    floors = section.get("floors")
    if floors is None:
        floor = _read_floor(section, count, names)
        column = section.get("column")
        name = column.text() if column else ""
        if name is None:
            return []
        return [_Request(column or file, floor, name, scale, start)]
    section.refuse(("floor", "column"), "cannot be used with `floors`; give one of the two")
    named = floors.named(
        "a mapping of floors to columns, such as {2: roof_kN, 1: 0.6 roof_kN}",
        "must contain at least one floor",
    )
    requests = []
    for key, entry in (named or {}).items():
        number = float(count or 0) if key == ROOF else number_or_nan(key)
        if key in names and not key.isdecimal():
            number = names.index(key) + 1.0
        is_floor = number >= 1 and number == int(number)
        if not (is_floor or key == ROOF) or (count and number > count and key not in names):
            limit = f" to {count} (the number of stories)" if count else ""
            known = f", {ROOF} or the name of a row or attachment" if any(names) else f" or {ROOF}"
            floors.fault(f"the keys must be floors from 1{limit}{known}, got {quoted(key)}")
            continue
        text = entry.text()
        if text is not None:
            requests.append(_Request(entry, int(number), text, scale, start))
    return requests


def _read_points(points: Value, unit: ModelUnits) -> LoadTable | None:
    """Return the table of `points: [[t, F], ...]`; None after reporting an error."""
    rows = numbers_of_rows(points, 2)
    if rows is None or len(rows) < 2:
        points.read()  # reports the error
        return None
    table = rows * (1.0, unit.force)
    for k in _invalid_times(table[:, 0]):
        (points.items("points") or ())[k].fault(_TIME_ORDER.format(table[k, 0]))
        return None
    return LoadTable("", ("points",), table)


_TIME_ORDER = (
    "times must not decrease, and at most two rows have the same time (a jump), got {:.9g} s"
)


def _invalid_times(times: np.ndarray) -> list[int]:
    """Return the index of the first row with a time that decreases or occurs for the third time, or
    no index."""
    decreases = np.flatnonzero(np.diff(times) < 0.0) + 1
    repeats = np.flatnonzero(times[2:] == times[:-2]) + 2
    return sorted((*decreases.tolist(), *repeats.tolist()))[:1]


def read_load_file(
    path: str,
    columns: Sequence[tuple[int, str]],
    scale: float,
    start: float,
    unit: float | str,
) -> tuple[TableForce, ...]:
    """Return the forces from a file that is not part of a model file: a load case of a campaign.

    Parameters
    ----------
    path : str
        CSV file.
    columns : sequence of (int, str)
        Floor and column of each force; the column is empty for the only column of forces.
    scale, start : float
        As in `tdint.studies.campaign.definition.LoadFiles`.
    unit : float | str
        Factor to N of columns without a unit, or the reason why a unit is required.

    Raises
    ------
    ModelError
        The file is invalid, a column does not exist, or the name of a column lacks a required unit.
    """
    failing = _Failing(path)
    wanted = [_Request(failing, floor, column, scale, start) for floor, column in columns]
    return tuple(_read_file(path, wanted, unit))


@dataclass(frozen=True)
class _Failing:
    """Entry without a position in a file: an error is raised immediately."""

    path: str

    def fault(self, message: str) -> None:
        """Raise ModelError."""
        raise ModelError(f"{self.path}: {message.removesuffix(f' in {self.path}')}")


def _read_file(path: str, wanted: Sequence[_Request], unit: float | str) -> list[TableForce]:
    """Return the forces from the columns of one file. ModelError is raised if the file is invalid.
    Errors of single columns are reported at their entries instead.

    `unit` is the factor to N of columns without a unit, or the reason why they are an error.
    """
    table, rows = stream_table(path, _NEEDS, columns=(), read_first=True)
    time_column, time_factor = _time_column(table)
    chosen: dict[str, int] = {}  # index in the array of values by the name in lower case
    found: list[tuple[_Request, str, float]] = []
    for item in wanted:
        column = _column_and_factor(item, table, time_column)
        if column is not None:
            found.append((item, *column))
            chosen.setdefault(column[0], len(chosen))
    names = (time_column, *chosen)
    for name in names:
        if table.header.count(name) > 1:
            raise ModelError(
                f"{path}:{table.header_line}: the header contains the column {name} twice; rename "
                "or remove one of these columns"
            )
    units = {name: _unit_of(table.titles[table.header.index(name)], unit, table) for name in chosen}
    lines, data = _read_numbers(table, rows, names)
    if len(data) < 2:
        raise ModelError(f"{path}: the table must have at least two rows, got {len(data)}")
    data[:, 0] *= time_factor
    for k in _invalid_times(data[:, 0]):
        raise ModelError(f"{path}:{lines[k]}: {time_column}: {_TIME_ORDER.format(data[k, 0])}")
    for name, index in chosen.items():
        data[:, 1 + index] *= units[name]
    titles = tuple(table.titles[table.header.index(name)] for name in chosen)
    shared = LoadTable(path, titles, data, digest_of(Path(path)))
    return [
        TableForce(item.floor, shared, chosen[name], item.factor * factor, item.start)
        for item, name, factor in found
    ]


def _time_column(table: CsvTable) -> tuple[str, float]:
    """Return the name of the column of times in lower case, and the factor of its unit to s."""
    matches = [match for name in table.header if (match := re.fullmatch(_TIME_COLUMN, name))]
    if len(matches) != 1:
        # Without a column of times, the file can be of another type. Its text is not repeated.
        names = ", ".join(match[0] for match in matches)
        problem = f"several columns of times, {names}; keep one of them"
        if not matches:
            problem = (
                f"no column of times, such as time_s or time_ms, among "
                f"{pluralize(len(table.titles), 'column')}; the first line must contain the names "
                "of the columns"
            )
            if len(table.titles) == 1 and re.search(r"[;\t]", table.titles[0]):
                problem += "; separate columns by commas, and write decimals with a point"
        raise ModelError(f"{table.source}:{table.header_line}: {problem}")
    return matches[0][0], _TIMES[matches[0][1] or "s"]


def _column_and_factor(
    item: _Request, table: CsvTable, time_column: str
) -> tuple[str, float] | None:
    """Return the name of the requested column in lower case and its factor; None after an error.

    The text is the name, or a factor and the name. A name that occurs in the file is never divided.
    """
    others = [name for name in table.header if name and name != time_column]
    titles = [title for title in table.titles if title.lower() in others]
    if not item.column:
        if len(others) == 1:
            return others[0], 1.0
        item.value.fault(
            f"the file has {pluralize(len(others), 'column')} of forces; give `column`: one of "
            f"{', '.join(titles)[:200]}"
        )
        return None
    name, factor = item.column.strip(), 1.0
    if name.lower() not in others and (match := re.fullmatch(_NAME_AND_FACTOR, item.column)):
        number = number_or_nan(match[1])
        if number == number:  # not nan
            name, factor = match[2], number
    if name.lower() in others:
        return name.lower(), factor
    similar = nearest(name.lower(), others)
    hint = f"; did you mean {table.titles[table.header.index(similar)]}?" if similar else ""
    item.value.fault(
        f"no column {quoted(name)} in {table.source}; the columns of forces are "
        f"{', '.join(titles)[:200]}{hint}"
    )
    return None


def _unit_of(title: str, unit: float | str, table: CsvTable) -> float:
    """Return the factor to N of the unit at the end of a name (`_UNIT_ENDING`); for a name without
    a unit, `unit`. ModelError is raised for the unit of another quantity, and without a unit if
    `unit` is a reason.
    """
    match = _UNIT_ENDING.fullmatch(title.strip())
    ending = next(filter(None, match.groups()), "") if match else ""
    # MN and mN differ only in case, so that case matters for this unit.
    factors = {name.lower(): factor for name, factor in FORCE.items() if name != "MN"}
    if ending in FORCE:
        return FORCE[ending]
    if ending.lower() in factors:
        return factors[ending.lower()]
    is_tonne = ending == "t" and title.rstrip().endswith((")", "]"))
    if ending in _OTHER_UNITS or ending.lower() == "mn" or is_tonne:
        raise ModelError(
            f"{table.source}:{table.header_line}: the column {title} has the unit {ending}, which "
            f"is not a unit of force; known: {', '.join(FORCE)}"
        )
    if isinstance(unit, str):
        raise ModelError(
            f"{table.source}:{table.header_line}: the column {title} has no unit; add it to the "
            f"name, for example {title}_kN ({unit})"
        )
    return unit


def _read_numbers(
    table: CsvTable, rows: object, names: Sequence[str]
) -> tuple[list[int], np.ndarray]:
    """Return the line number of each row, and some columns, shape (rows, columns)."""
    indices = [table.header.index(name) for name in names]
    lines: list[int] = []
    parts: list[np.ndarray] = []
    while block := tuple(islice(rows, BLOCK)):  # type: ignore[call-overload]
        lines += [line for line, _ in block]
        columns = table.columns_of([cells for _, cells in block])
        texts = [[cell.strip() for cell in columns[index]] for index in indices]
        part = np.column_stack([numbers_in(column) for column in texts])
        if np.isnan(part).any() or any(table.surplus(cells) for _, cells in block):
            # `numbers` reads decimal commas, and reports the first invalid row.
            checked = replace(table, rows=block)
            part = np.column_stack([checked.numbers(table.titles[index]) for index in indices])
        parts.append(part)
    return lines, np.concatenate(parts) if parts else np.empty((0, len(names)))
