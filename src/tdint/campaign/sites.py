"""Read ground motions at sites: a grid of points with their motions, or fields of events."""

from __future__ import annotations

import json
import math
import re
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.arrays import Array
from tdint.campaign.definition import FieldFile
from tdint.campaign.intensity import GEOMETRIC_MEAN, IntensityMeasure, MotionIntensity, pga, sa
from tdint.campaign.motions import FieldMotions, FoundMotions, GridFile, GridMotions, PointMotion
from tdint.csv_table import (
    BLOCK,
    CsvTable,
    number,
    number_error,
    numbers_in,
    read_table,
    stream_table,
)
from tdint.errors import AnalysisError, ModelError, RecordError, TdintError, UsageError
from tdint.files import MOST_BYTES, read_whole
from tdint.ground_motion.horizontals import ONE_MOTION, Horizontals, SingleHorizontal, motion_names
from tdint.ground_motion.miniseed_checks import LONGEST_STEP, SHORTEST_STEP
from tdint.ground_motion.reading.read import check_possible
from tdint.ground_motion.reading.sample_units import file_units
from tdint.ground_motion.reading.suites import (
    SuiteMotion,
    read_components,
    read_pairs,
    suite_motions,
)
from tdint.ground_motion.record import Record
from tdint.model.keys.fields import resolve
from tdint.number_parsing import pluralize
from tdint.units import STANDARD_GRAVITY, parse_units

# ---- Read a grid in the format of SimCenter's regional workflow, or fields of many events
#
# EventGrid.csv names a file for each point (GP_file, Longitude, Latitude). That file lists the
# ground motions of the point (TH_file and, optionally, their factor). NAME.json contains a ground
# motion: name, dT, data_x and, for a pair, data_y. Fields are a table of event, site, record and
# factor, and a table of sites. OpenQuake's names of the columns are also supported.

_EVENT_NAMES, _SITE_NAMES = ("event", "event_id"), ("site", "site_id", "custom_site_id")
_LONGITUDE_NAMES, _LATITUDE_NAMES = ("longitude", "lon"), ("latitude", "lat")
_GMV = re.compile(r"gmv_(pga|pgv|sa\((?P<period>[0-9]*\.?[0-9]+)\))")
_CENTIMETER = 0.01  # m; OpenQuake writes peak ground velocities in cm/s
_SHOWN_FAULTS, _MAX_FAULTS = 10, 1000
"""Number of errors of a table that are shown, and number of errors after which reading stops."""

_COMPONENTS = {"data_x": "x", "data_y": "y"}
_SECOND_FILE = (
    "record_2"  # column with the file of the second component, for files named differently
)

Value = TypeVar("Value")


def read_grid(grid: GridFile) -> FoundMotions:
    """Read the ground motions of a grid and the points to which they belong.

    Parameters
    ----------
    grid : GridFile
        Path and settings of the grid.

    Raises
    ------
    ModelError
        The grid cannot be read.
    RecordError
        No point has a motion.
    """
    unit = parse_units(grid.units)
    if unit.quantity != "acceleration":
        raise RecordError(
            f"{grid.file}: the motions of a grid are accelerations, but their units are specified "
            f"as {grid.units}"
        )
    columns = ("GP_file", "Longitude", "Latitude")
    table = read_table(
        grid.file, f"a grid is a CSV file with the columns {', '.join(columns)}", columns=columns
    )
    table.need(*columns)
    degrees = _degrees(table, "Longitude", "Latitude")
    points = list(zip(table.texts("GP_file", empty=False), degrees, strict=True))

    # Read the motions of each point. A record that is listed in several files is read once.
    folder = Path(grid.file).parent
    motions: list[SuiteMotion] = []
    numbers: dict[str, tuple[int, ...]] = {}
    failures: list[RecordError] = []
    point_motions = []
    for file, _ in points:
        motions_of_point: list[PointMotion] = []
        # A record that cannot be read is reported once. It has no components, so that it is omitted
        # from the samples.
        for name, factor in _motions_at(str(folder / file)):
            if name not in numbers:
                first = len(motions)
                try:
                    motions += _components_of(folder, name, unit.scale)
                except RecordError as error:
                    failures.append(error)
                numbers[name] = tuple(range(first, len(motions)))
            motions_of_point.append((numbers[name], factor))
        point_motions.append(motions_of_point)
    if not motions:
        raise RecordError(
            "\n".join(map(str, failures)) or f"{grid.file}: no point has a ground motion"
        )
    if grid.events:
        return FoundMotions(
            tuple(motions),
            tuple(failures),
            places=_rows_as_events(grid.file, points, point_motions),
        )
    # Points without readable motions are omitted: buildings near them use other points.
    usable = [
        (place, readable)
        for (_, place), motions_of_point in zip(points, point_motions, strict=True)
        if (readable := tuple(motion for motion in motions_of_point if motion[0]))
    ]
    places = GridMotions([place for place, _ in usable], tuple(motions for _, motions in usable))
    return FoundMotions(tuple(motions), tuple(failures), places=places)


def _rows_as_events(
    source: str,
    points: Sequence[tuple[str, tuple[float, float]]],
    point_motions: Sequence[Sequence[PointMotion]],
) -> FieldMotions:
    """Return the field in which row k of the file of each point is event k.

    Parameters
    ----------
    source : str
        Path of the grid.
    points : sequence of (str, (float, float))
        File and location (degrees) of each point.
    point_motions : sequence of sequence
        Motions of each point.
    """
    # An event is identified by its row, so that all files must have the same number of rows.
    count = len(point_motions[0])
    for (file, _), motions in zip(points, point_motions, strict=True):
        if len(motions) != count:
            raise ModelError(
                f"{Path(source).parent / file}: {len(motions)} motions, but {points[0][0]} has "
                f"{count}; with `events` each row of these files must be the same event at all "
                "points"
            )
    # A record is identified by the numbers of its components.
    distinct = dict.fromkeys(numbers for motions in point_motions for numbers, _ in motions)
    record_numbers = {components: number for number, components in enumerate(distinct)}
    rows = [
        (record_numbers[components], factor)
        for motions in point_motions
        for components, factor in motions
    ]
    record = np.array([number for number, _ in rows], np.int32)
    value = np.array([factor for _, factor in rows], float)
    site, event = (numbers.ravel() for numbers in np.indices((len(points), count), np.int32))
    files, places = zip(*points, strict=True)
    motions_of_record = [
        tuple((motion, 1.0) for motion in components) for components in record_numbers
    ]
    events = [str(number + 1) for number in range(count)]
    return FieldMotions.of_rows(
        events, files, (site, event + 1, record, value), motions_of_record, places
    )


def read_field(field_file: FieldFile) -> FoundMotions:
    """Read the ground motions of fields, and the motion of each event at each site.

    Parameters
    ----------
    field_file : FieldFile
        Path and settings of the fields.

    Raises
    ------
    ModelError
        A table cannot be read; an event occurs twice at a site; a site is missing from the table of
        sites.
    RecordError
        No record can be read.
    """
    places = _site_places(field_file.sites) if field_file.sites else {}
    # Read the table first, so that its errors are reported before records are read.
    rows, measure = _field_rows(field_file, {site: number for number, site in enumerate(places)})
    records = _FieldRecords(field_file)
    motions = [records.motions_of(*line, measure) for line in rows.first_lines()]
    if not any(motions):
        raise RecordError("\n".join(map(str, records.failures)))
    events, notes = list(rows.events), tuple(dict.fromkeys(records.notes))
    field = FieldMotions.of_rows(
        events, list(rows.sites), rows.arrays(), motions, list(places.values())
    )
    rates = _rates(field_file.rates, events) if field_file.rates else {}
    return FoundMotions(tuple(records.motions), tuple(records.failures), notes, field, rates)


def _rates(file: str, events: Sequence[str]) -> dict[str, float]:
    """Return the annual rate of each event of the fields. Events without a field are ignored."""
    table = read_table(file, "rates are a CSV file with the columns event and rate", comment="#")
    event = _find_column(table, _EVENT_NAMES)
    table.need(event, "rate")
    values = table.numbers("rate")
    table.check(
        "rate", (rate >= 0.0 for rate in values), "must be zero or a positive number per year"
    )
    rates = _by_name(table, event, "event", values)
    # An event without a rate would be omitted from all annual losses, so it is an error.
    missing = [name for name in events if name not in rates]
    if missing:
        raise ModelError(
            f"{file}: the rate of {pluralize(len(missing), 'event')} of the fields is missing, "
            "such "
            f"as {missing[0]!r}; add a row for each event"
        )
    return {name: rates[name] for name in events}


def _by_name(table: CsvTable, column: str, what: str, values: Iterable[Value]) -> dict[str, Value]:
    """Return the values of rows by the names in a column.

    Parameters
    ----------
    table : CsvTable
        The table.
    column : str
        Column with the names, which must be unique.
    what : str
        Type of the named objects, for messages.
    values : iterable
        Value of each row.
    """
    by_name: dict[str, Value] = {}
    for (line, name), value in zip(table.lines(column, empty=False), values, strict=True):
        if name in by_name:
            raise ModelError(
                f"{table.source}:{line}: {what} {name!r} is listed twice; use each name once"
            )
        by_name[name] = value
    return by_name


@dataclass
class _FieldRows:
    """Rows of a table of fields: numbers of site, event (from 1) and record, value, and line.

    The value is a factor on the record, or the intensity to which the record is scaled (SI). A row
    requires 24 bytes.
    """

    sites: dict[str, int]
    events: dict[str, int] = field(default_factory=dict)
    records: dict[tuple[str, str, str], int] = field(default_factory=dict)
    site: array[int] = field(default_factory=lambda: array("i"))
    event: array[int] = field(default_factory=lambda: array("i"))
    record: array[int] = field(default_factory=lambda: array("i"))
    value: array[float] = field(default_factory=lambda: array("d"))
    line: array[int] = field(default_factory=lambda: array("i"))

    def add(self, site: int, event: int, record: int, value: float, line: int) -> None:
        """Append a row."""
        self.site.append(site)
        self.event.append(event)
        self.record.append(record)
        self.value.append(value)
        self.line.append(line)

    def add_valid(
        self,
        block: Sequence[tuple[int, list[str]]],
        width: int,
        indices: Sequence[int],
        unit: float,
        *,
        are_sites_known: bool,
        measure: IntensityMeasure | None,
    ) -> bool:
        """Append many rows and return True, if all of them are valid; otherwise return False.

        Parameters
        ----------
        block : sequence of (int, list of str)
            Line number and cells of each row.
        width : int
            Number of columns of the table.
        indices : sequence of int
            Indices of the columns of event, record, site, component, second component and value;
            `width` for a column that does not exist.
        unit : float
            Unit of the values in SI.
        are_sites_known : bool
            True if a table of sites exists, so that no site may be added.
        measure : IntensityMeasure or None
            Intensity measure of the values; None for factors.
        """
        lines, rows = zip(*block, strict=True)
        if set(map(len, rows)) != {width}:
            return False
        columns = [*zip(*rows, strict=True), ("",) * len(rows)]
        event, record, site, component, other, value = (columns[index] for index in indices)
        values = np.ones(len(rows)) if indices[5] == width else numbers_in(value)
        if not (values > 0.0 if measure else np.abs(values) > 0.0).all():
            return False
        # Replace names by numbers in the order of their first use. Numbers that are given to the
        # names of an invalid row have no effect, because the table is refused.
        keys = zip(record, component, other, strict=True)
        events = _numbers_of(event, self.events, str.strip, first=1)
        records = _numbers_of(keys, self.records, _strip_each)
        sites = _numbers_of(site, self.sites, str.strip, may_add=not are_sites_known)
        is_unnamed = (
            "" in self.events
            or any(not name for name, *_ in self.records)
            or ("" in self.sites and indices[2] < width)
        )
        if is_unnamed or -1 in sites:
            return False
        self.site.extend(sites)
        self.event.extend(events)
        self.record.extend(records)
        self.value.frombytes((unit * values).tobytes())
        self.line.extend(lines)
        return True

    def arrays(self) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], Array]:
        """Return site, event, record and value of all rows."""
        site, event, record = (
            np.frombuffer(numbers, np.int32) for numbers in (self.site, self.event, self.record)
        )
        return site, event, record, np.frombuffer(self.value, np.float64)

    def first_lines(self) -> list[tuple[int, str, str, str]]:
        """Return for each record the line of its first use, its name, its component and the file of
        its second component."""
        first = np.unique(np.frombuffer(self.record, np.int32), return_index=True)[1].tolist()
        return [(self.line[row], *key) for row, key in zip(first, self.records, strict=True)]

    def find_duplicates(self, file: str) -> list[str]:
        """Return the errors of rows with an event and a site that an earlier row contains."""
        site, event, *_ = self.arrays()
        # Combine event and site into one number. After sorting, duplicates are adjacent.
        key = event.astype(np.int64) * len(self.sites) + site
        order = np.argsort(key, kind="stable")
        repeated = np.flatnonzero(np.diff(key[order]) == 0)
        names, events = list(self.sites), list(self.events)
        faults = []
        for duplicate, first in sorted(
            (int(order[index + 1]), int(order[index])) for index in repeated[:_MAX_FAULTS].tolist()
        ):
            name = names[self.site[duplicate]]
            location = f"site {name!r}" if name else "all buildings"
            faults.append(
                f"{file}:{self.line[duplicate]}: event {events[self.event[duplicate] - 1]!r} at "
                f"{location} is already on line {self.line[first]}; each event can have only one "
                "record at a site"
            )
        return faults


def _numbers_of(
    names: Iterable[Value],
    numbers: dict[Value, int],
    strip: Callable[[Value], Value],
    *,
    first: int = 0,
    may_add: bool = True,
) -> list[int]:
    """Return the numbers of names; -1 for an unknown name.

    Parameters
    ----------
    names : iterable
        Names as in the file.
    numbers : dict
        Numbers by name without surrounding spaces; new names are added.
    strip : callable
        Function that removes the surrounding spaces of a name.
    first : int
        Number of the first name.
    may_add : bool
        True if names may be added.
    """
    names = list(names)
    found = [numbers.get(name, -1) for name in names]
    if -1 in found:
        names = list(map(strip, names))
        for name in dict.fromkeys(names) if may_add else ():
            numbers.setdefault(name, len(numbers) + first)
        found = [numbers.get(name, -1) for name in names]
    return found


def _strip_each(texts: tuple[str, str, str]) -> tuple[str, str, str]:
    """Return the texts without surrounding spaces."""
    first, second, third = texts
    return first.strip(), second.strip(), third.strip()


def _field_rows(
    field: FieldFile, sites: dict[str, int]
) -> tuple[_FieldRows, IntensityMeasure | None]:
    """Read the rows of a table of fields sequentially.

    Parameters
    ----------
    field : FieldFile
        Path and settings of the fields.
    sites : dict of str to int
        Numbers of the sites; if no sites are specified, the sites of the table are added.

    Returns
    -------
    rows : _FieldRows
        The rows.
    measure : IntensityMeasure or None
        Intensity measure of their values; None for factors.

    Raises
    ------
    ModelError
        The table cannot be read; the error lists all errors of its rows.
    """
    file = field.file
    needs = (
        "fields are a CSV file with the columns event, site, record and, optionally, component and "
        "factor"
    )
    columns = (*_EVENT_NAMES, *_SITE_NAMES, "record", _SECOND_FILE, "component", "factor")
    # Read row by row: a table of many events at many sites does not fit into memory as text.
    table, lines = stream_table(file, needs, columns=columns, comment="#")
    event, site = _find_column(table, _EVENT_NAMES), _find_column(table, _SITE_NAMES)
    table.need(event, "record", *([site] if field.sites else ()))
    if table.has(_SECOND_FILE) and not field.pairs:
        raise ModelError(
            f"{file}:{table.header_line}: {_SECOND_FILE} can only be used with pairs; add pairs: "
            "true to "
            "the records"
        )
    value, unit, measure = _field_values(table)
    names = (event, "record", site, "component", _SECOND_FILE, value)
    width = len(table.header)
    # Index of each column. A missing column has the index `width`, at which an empty cell is added.
    indices = [table.header.index(name) if name and table.has(name) else width for name in names]
    # Collect errors up to a maximum, so that users can correct all of them in one edit.
    rows, faults = _FieldRows(sites), list[str]()
    while len(faults) < _MAX_FAULTS and (block := list(islice(lines, BLOCK))):
        # Almost all rows are valid. Only blocks with an error are read row by row.
        if rows.add_valid(
            block, width, indices, unit, are_sites_known=bool(field.sites), measure=measure
        ):
            continue
        for line, cells in block:
            if len(faults) >= _MAX_FAULTS:
                break
            if table.overfull(cells):
                faults.append(
                    f"{file}:{line}: the row has {pluralize(len(cells), 'cell')}, but the header "
                    f"has {pluralize(width, 'column')}"
                )
                continue
            # Missing cells at the end of a row are empty.
            cells = [*cells[:width], *[""] * (width + 1 - len(cells[:width]))]
            event_name, record, place, component, other, text = (
                cells[index].strip() for index in indices
            )
            missing = [name for name, text in ((event, event_name), ("record", record)) if not text]
            missing += [site] if indices[2] < width and not place else []
            factor = number(text) if text else 1.0
            if missing:
                faults.append(f"{file}:{line}: {missing[0]} is missing")
            elif field.sites and place not in sites:
                faults.append(
                    f"{file}:{line}: site {place!r} not found in {field.sites}; add it there"
                )
            elif measure and not text:
                faults.append(f"{file}:{line}: {value} is missing")
            elif math.isnan(factor) or (measure and factor <= 0.0):
                faults.append(
                    f"{file}:{line}: {value} "
                    f"{number_error(text, 'a positive number' if measure else 'a number')}"
                )
            elif factor == 0.0:
                faults.append(f"{file}:{line}: {value} must not be zero, got {text[:40]!r}")
            else:
                # Store numbers instead of names, because a row of numbers requires only 24 bytes.
                site_number = sites.setdefault(place, len(sites))
                event_number = rows.events.setdefault(event_name, len(rows.events) + 1)
                record_number = rows.records.setdefault(
                    (record, component, other), len(rows.records)
                )
                rows.add(site_number, event_number, record_number, unit * factor, line)
    faults += rows.find_duplicates(file)
    if faults:
        shown, more = faults[:_SHOWN_FAULTS], len(faults) - _SHOWN_FAULTS
        last = (
            [f"and {'at least ' if len(faults) >= _MAX_FAULTS else ''}{more} more errors"]
            if more > 0
            else []
        )
        raise ModelError("\n".join([*shown, *last]))
    if not rows.line:
        raise ModelError(f"{file}: has no rows below its header; {needs}")
    return rows, measure


def _field_values(table: CsvTable) -> tuple[str, float, IntensityMeasure | None]:
    """Return the column of values of a table of fields.

    Returns
    -------
    column : str
        Column of factors or of OpenQuake's intensities, `gmv_PGA`, `gmv_PGV` or `gmv_SA(0.6)`;
        empty if all factors are 1.
    unit : float
        Unit of the column in SI.
    measure : IntensityMeasure or None
        Intensity measure of OpenQuake's intensities.
    """
    columns = [name for name in table.header if name.startswith("gmv_")]
    # If the table has a column of factors, OpenQuake's columns of intensities are not used.
    if table.has("factor") or not columns:
        return "factor" if table.has("factor") else "", 1.0, None
    match = _GMV.fullmatch(columns[0])
    if len(columns) > 1 or match is None:
        raise ModelError(
            f"{table.source}:{table.header_line}: {', '.join(columns)}: keep only the intensity to "
            "which records are scaled, gmv_PGA, gmv_PGV or gmv_SA(period), or add a column factor"
        )
    period = match["period"]
    if columns[0] == "gmv_pgv":
        return columns[0], _CENTIMETER, MotionIntensity("pgv")
    return columns[0], STANDARD_GRAVITY, sa(float(period), SA_DAMPING) if period else pga()


def _site_places(file: str) -> dict[str, tuple[float, float]]:
    """Return longitude and latitude of each site, degrees."""
    needs = "sites are a CSV file with the columns site, longitude, latitude"
    table = read_table(
        file, needs, columns=(*_SITE_NAMES, *_LONGITUDE_NAMES, *_LATITUDE_NAMES), comment="#"
    )
    site, longitude, latitude = (
        _find_column(table, names) for names in (_SITE_NAMES, _LONGITUDE_NAMES, _LATITUDE_NAMES)
    )
    table.need(site, longitude, latitude)
    return _by_name(table, site, "site", _degrees(table, longitude, latitude))


def _find_column(table: CsvTable, names: Sequence[str]) -> str:
    """Return the first of several names of a column that a table contains; the first name if it
    contains no such column."""
    return next((name for name in names if table.has(name)), names[0])


class _FieldRecords:
    """Records of fields. Each record is read once."""

    def __init__(self, field: FieldFile) -> None:
        self._field = field
        self.motions: list[SuiteMotion] = []
        self.failures: list[TdintError] = []
        self.notes: list[str] = []
        self._files: dict[Path, dict[str, list[str]]] = {}

    def motions_of(
        self, line: int, record: str, component: str, other: str, measure: IntensityMeasure | None
    ) -> tuple[tuple[int, float], ...]:
        """Read a record and return its motions.

        Parameters
        ----------
        line : int
            Line of its first use, for messages.
        record, component, other : str
            File, component, and file of the second component of a pair.
        measure : IntensityMeasure or None
            Intensity measure of the values; None for factors.

        Returns
        -------
        tuple of (int, float)
            Number of each motion, and its intensity, SI (geometric mean of a pair), or 1 for
            factors. The result is empty if the record cannot be read or the intensity cannot be
            computed.
        """
        first = len(self.motions)
        try:
            motions = self._read(record, component, other)
            measured = [
                1.0 if measure is None else measure.of(motion.whole, GEOMETRIC_MEAN)
                for motion in motions
            ]
        except (AnalysisError, RecordError, UsageError) as error:
            self.failures.append(RecordError(f"{self._field.file}:{line}: {error}"))
            return ()
        self.motions += motions
        return tuple((first + index, value) for index, value in enumerate(measured))

    def _read(self, record: str, component: str, other: str) -> tuple[SuiteMotion, ...]:
        """Read a record.

        Parameters
        ----------
        record, component, other : str
            File, component, and file of the second component of a pair.
        """
        field, folder = self._field, Path(self._field.file).parent
        file = resolve(record, folder)
        # SimCenter's records are JSON files; all other files are read as usual records.
        if file.endswith(".json"):
            return _json_motions(file, component, field)
        choice = replace(field.choice, component=component or field.choice.component)
        if not field.pairs:
            suite = read_components([file], choice)
        elif other:
            # The table specifies the pair, so the file names do not matter.
            suite = read_pairs([file, resolve(other, folder)], choice, ONE_MOTION)
        else:
            suite = read_pairs([file], choice)
            if any(isinstance(error, SingleHorizontal) for error in suite.failures):
                suite = read_pairs(self._files_of_motion(file), choice)
        for error in suite.failures:
            if isinstance(error, SingleHorizontal):
                raise RecordError(
                    f"{error}: no second component found by file name; specify it in a column "
                    f"{_SECOND_FILE}"
                )
            raise error
        self.notes += suite.notes
        return suite_motions(suite.motions)

    def _files_of_motion(self, file: str) -> list[str]:
        """Return the files in the same directory that belong to the motion of a file by their
        names, as for `records: files`."""
        folder = Path(file).parent
        if folder not in self._files:
            neighbors = [str(path) for path in sorted(folder.iterdir())]
            by_motion: dict[str, list[str]] = {}
            for path, name in zip(neighbors, motion_names(neighbors), strict=True):
                by_motion.setdefault(name, []).append(path)
            self._files[folder] = {path: paths for paths in by_motion.values() for path in paths}
        return self._files[folder].get(str(Path(file)), [file])


def _json_motions(file: str, component_name: str, field: FieldFile) -> tuple[SuiteMotion, ...]:
    """Read the components of a motion in SimCenter's format.

    Parameters
    ----------
    file : str
        Path of the file.
    named : str
        Component in the table; empty: the component of the campaign file.
    field : FieldFile
        Settings of the fields.
    """
    # The format does not state units.
    unit = file_units(field.choice.units).of(file, "JSON")
    if unit is None:
        raise RecordError(f"{file}: the file does not state its units; add `units` to the records")
    if unit.quantity != "acceleration":
        raise RecordError(
            f"{file}: the samples are accelerations, but their units are specified as {unit.text}"
        )
    motions = _components_of(Path(), file, unit.scale)
    component = component_name or field.choice.component
    selected = [motion for motion in motions if component in (None, "", motion.component)]
    if not selected:
        raise RecordError(
            f"{file}: component {component!r} not found; available components: "
            f"{', '.join(motion.component for motion in motions)}"
        )
    return tuple(
        selected
        if field.pairs
        else (replace(motion, whole=motion.record, direction=1) for motion in selected)
    )


def _degrees(table: CsvTable, longitude: str, latitude: str) -> list[tuple[float, float]]:
    """Return the locations of rows, degrees."""
    east, north = table.numbers(longitude), table.numbers(latitude)
    table.check(
        longitude, (abs(degrees) <= 360.0 for degrees in east), "must be from -360 to 360 degrees"
    )
    table.check(
        latitude, (abs(degrees) <= 90.0 for degrees in north), "must be from -90 to 90 degrees"
    )
    return list(zip(east, north, strict=True))


def _motions_at(file: str) -> list[tuple[str, float]]:
    """Return the ground motions of a point and their factors."""
    needs = "the file of a grid point is a CSV file with the column TH_file and, optionally, factor"
    table = read_table(file, needs, columns=("TH_file", "factor"))
    names = table.texts("TH_file", empty=False)
    factors = [1.0] * len(names)
    if table.has("factor"):
        numbers = table.numbers("factor", empty=True)
        table.check("factor", (number != 0.0 for number in numbers), "must not be zero")
        factors = [1.0 if math.isnan(number) else number for number in numbers]
    return list(zip(names, factors, strict=True))


def _components_of(folder: Path, name: str, unit: float) -> list[SuiteMotion]:
    """Read the components of a ground motion.

    Parameters
    ----------
    folder : Path
        Directory of the file.
    name : str
        Name of the file, with or without the suffix .json.
    unit : float
        Unit of the samples, m/s^2.

    Raises
    ------
    RecordError
        The file cannot be read.
    """
    file = folder / (name if name.endswith(".json") else f"{name}.json")
    large = f"larger than {MOST_BYTES // 1024**2} MiB; this is not a ground motion"
    data = read_whole(file, RecordError, {}, large, MOST_BYTES)
    try:
        content: object = json.loads(data, parse_int=float)  # all numbers are floats then
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{file}: not JSON: {error}") from None
    if not isinstance(content, Mapping) or "dT" not in content or "data_x" not in content:
        raise RecordError(f"{file}: the keys dT and data_x are required")
    # Python's JSON parser also accepts NaN and Infinity, which this comparison refuses.
    dt = content["dT"]
    if not (isinstance(dt, float) and SHORTEST_STEP <= dt <= LONGEST_STEP):
        limits = f"{SHORTEST_STEP:g} to {LONGEST_STEP:g} s"
        raise RecordError(
            f"{file}: dT must be a sampling interval, a number from {limits}, got {dt!r:.40}"
        )
    records = []
    for key, component in _COMPONENTS.items():
        if key in content:
            samples = content[key]
            if not isinstance(samples, list) or not all(
                isinstance(sample, float) for sample in samples
            ):
                raise RecordError(f"{file}: {key} must be a list of numbers")
            record = Record(np.array(samples) * unit, dt, "", "", component, str(file))
            check_possible(record.acceleration, f"{file}: {key}")
            records.append(record)
    if len(records) == 2 and records[0].acceleration.size != records[1].acceleration.size:
        raise RecordError(
            f"{file}: data_x and data_y must have the same number of samples, got "
            f"{records[0].acceleration.size} and {records[1].acceleration.size}"
        )
    motion = records[0] if len(records) == 1 else Horizontals(records[0], records[1])
    return [
        SuiteMotion(record, name, record.component, motion, direction)
        for direction, record in enumerate(records, start=1)
    ]
