"""Ground motions at sites, read: a grid of points with their motions, and fields of events."""

from __future__ import annotations

import json
import math
import re
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.arrays import Array
from tdint.campaign.definition import FieldFile
from tdint.campaign.intensity import GEOMETRIC_MEAN, IntensityMeasure, MotionIntensity, pga, sa
from tdint.campaign.motions import FieldMotions, FoundMotions, GridFile, GridMotions, PointMotion
from tdint.csv_table import CsvTable, no_number, number, read_table, stream_table
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
from tdint.units import STANDARD_GRAVITY, parse_units
from tdint.written_numbers import how_many

# ---- Reading ground motions at places: a grid, as the regional workflow of SimCenter has it, and
# fields of many events
#
# EventGrid.csv names a file for each point (GP_file, Longitude, Latitude), that file the ground
# motions there (TH_file and, if they differ, their factor), and NAME.json holds one of these: name,
# dT, data_x and, of a pair, data_y. Fields are a table of event, site, record and factor, and a
# table of sites; OpenQuake's names of the columns are known, too.

_EVENTS, _SITES = ("event", "event_id"), ("site", "site_id", "custom_site_id")
_LONGITUDES, _LATITUDES = ("longitude", "lon"), ("latitude", "lat")
_GMV = re.compile(r"gmv_(pga|pgv|sa\((?P<period>[0-9]*\.?[0-9]+)\))")
_CENTIMETER = 0.01
_SHOWN_FAULTS, _MOST_FAULTS = 10, 1000
"""Faults of a table that are shown, and after which reading ends."""

_COMPONENTS = {"data_x": "x", "data_y": "y"}
_OTHER = (
    "record_2"  # column of the file of the other horizontal of a pair, where names do not tell it
)

Value = TypeVar("Value")


def read_grid(grid: GridFile) -> FoundMotions:
    """The ground motions of a grid, and at which points they are.

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
            f"{grid.file}: the motions of a grid are accelerations, their units are given as "
            f"{grid.units}"
        )
    columns = ("GP_file", "Longitude", "Latitude")
    table = read_table(
        grid.file, f"a grid is a CSV file with the columns {', '.join(columns)}", columns=columns
    )
    table.need(*columns)
    degrees = _degrees(table, "Longitude", "Latitude")
    points = list(zip(table.texts("GP_file", empty=False), degrees, strict=True))

    # The motions of each point; a record that stands in several files is read once.
    folder = Path(grid.file).parent
    motions: list[SuiteMotion] = []
    numbers: dict[str, tuple[int, ...]] = {}
    failures: list[RecordError] = []
    of_points = []
    for file, _ in points:
        of_point: list[PointMotion] = []
        # A record that cannot be read is told once, and its draws are without it.
        for name, factor in _motions_at(str(folder / file)):
            if name not in numbers:
                first = len(motions)
                try:
                    motions += _components_of(folder, name, unit.scale)
                except RecordError as error:
                    failures.append(error)
                numbers[name] = tuple(range(first, len(motions)))
            of_point.append((numbers[name], factor))
        of_points.append(of_point)
    if not motions:
        raise RecordError(
            "\n".join(map(str, failures)) or f"{grid.file}: no point has a ground motion"
        )
    if grid.events:
        return FoundMotions(
            tuple(motions), tuple(failures), places=_rows_as_events(grid.file, points, of_points)
        )
    # Points that lose all of their motions drop out: buildings near them draw from the others.
    there = [
        (place, kept)
        for (_, place), of_point in zip(points, of_points, strict=True)
        if (kept := tuple(motion for motion in of_point if motion[0]))
    ]
    places = GridMotions([place for place, _ in there], tuple(kept for _, kept in there))
    return FoundMotions(tuple(motions), tuple(failures), places=places)


def _rows_as_events(
    source: str,
    points: Sequence[tuple[str, tuple[float, float]]],
    of_points: Sequence[Sequence[PointMotion]],
) -> FieldMotions:
    """The field in which the k-th row of each point's file is event k."""
    # An event is a row of all files: rows that are missing somewhere would shift those below.
    count = len(of_points[0])
    for (file, _), motions in zip(points, of_points, strict=True):
        if len(motions) != count:
            raise ModelError(
                f"{Path(source).parent / file}: {len(motions)} motions, where {points[0][0]} has "
                f"{count}; with `events` the rows of these files are the same events at all points"
            )
    records = {
        both: number
        for number, both in enumerate(dict.fromkeys(b for motions in of_points for b, _ in motions))
    }
    rows = [(records[both], factor) for motions in of_points for both, factor in motions]
    record, value = (
        np.array([row[0] for row in rows], np.int32),
        np.array([row[1] for row in rows], float),
    )
    site, event = (numbers.ravel() for numbers in np.indices((len(points), count), np.int32))
    files, places = zip(*points, strict=True)
    motions_of = [tuple((motion, 1.0) for motion in both) for both in records]
    events = [str(number + 1) for number in range(count)]
    return FieldMotions.of_rows(events, files, (site, event + 1, record, value), motions_of, places)


def read_field(field_file: FieldFile) -> FoundMotions:
    """The ground motions of fields, and what each event does at each site.

    Raises
    ------
    ModelError
        A table cannot be read; an event is twice at a site, or a site is in no table of sites.
    RecordError
        No record can be read.
    """
    places = _site_places(field_file.sites) if field_file.sites else {}
    # Rows first: a fault in the table shows before any record is read.
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
    """How often each event of the fields comes in a year; events that have no field cause no
    loss."""
    table = read_table(file, "rates are a CSV file with the columns event and rate", comment="#")
    event = _called(table, _EVENTS)
    table.need(event, "rate")
    values = table.numbers("rate")
    table.check(
        "rate", (rate >= 0.0 for rate in values), "must be zero or a positive number a year"
    )
    rates = _by_name(table, event, "event", values)
    # An event without a rate would be left out of every annual loss without a word.
    missing = [name for name in events if name not in rates]
    if missing:
        raise ModelError(
            f"{file}: has no rate of {how_many(len(missing), 'event')} of the fields, such as "
            f"{missing[0]!r}"
        )
    return {name: rates[name] for name in events}


def _by_name(table: CsvTable, column: str, what: str, values: Iterable[Value]) -> dict[str, Value]:
    """The values of rows by the names in a column, none of which may be there twice."""
    by_name: dict[str, Value] = {}
    for (line, name), value in zip(table.lines(column, empty=False), values, strict=True):
        if name in by_name:
            raise ModelError(f"{table.source}:{line}: {what} {name!r} is there twice")
        by_name[name] = value
    return by_name


@dataclass
class _FieldRows:
    """What events do at sites: of each row numbers for its site, event (from 1) and record, the
    value (a factor on the record, or the intensity that it is brought to, SI), and its line; 24
    bytes each."""

    sites: dict[str, int]
    events: dict[str, int] = field(default_factory=dict)
    records: dict[tuple[str, str, str], int] = field(default_factory=dict)
    site: array[int] = field(default_factory=lambda: array("i"))
    event: array[int] = field(default_factory=lambda: array("i"))
    record: array[int] = field(default_factory=lambda: array("i"))
    value: array[float] = field(default_factory=lambda: array("d"))
    line: array[int] = field(default_factory=lambda: array("i"))

    def add(self, site: int, event: int, record: int, value: float, line: int) -> None:
        """Take a row."""
        self.site.append(site)
        self.event.append(event)
        self.record.append(record)
        self.value.append(value)
        self.line.append(line)

    def arrays(self) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], Array]:
        """Site, event, record and value."""
        site, event, record = (
            np.frombuffer(numbers, np.int32) for numbers in (self.site, self.event, self.record)
        )
        return site, event, record, np.frombuffer(self.value, np.float64)

    def first_lines(self) -> list[tuple[int, str, str, str]]:
        """Of each record the line where it stands first, its name, its component and the file of
        the other one."""
        first = np.unique(np.frombuffer(self.record, np.int32), return_index=True)[1].tolist()
        return [(self.line[place], *key) for place, key in zip(first, self.records, strict=True)]

    def twice(self, file: str) -> list[str]:
        """What is wrong with rows of an event and a site that an earlier row has."""
        site, event, *_ = self.arrays()
        # Event and site as one number: equal ones stand side by side once sorted.
        key = event.astype(np.int64) * len(self.sites) + site
        order = np.argsort(key, kind="stable")
        again = np.flatnonzero(np.diff(key[order]) == 0)
        names, events = list(self.sites), list(self.events)
        faults = []
        for before, place in sorted(
            (int(order[row + 1]), int(order[row])) for row in again[:_MOST_FAULTS].tolist()
        ):
            name = names[self.site[before]]
            at = f"site {name!r}" if name else "all buildings"
            faults.append(
                f"{file}:{self.line[before]}: event {events[self.event[before] - 1]!r} at {at} is "
                f"already on line {self.line[place]}; give each event one record at a site"
            )
        return faults


def _field_rows(
    field: FieldFile, sites: dict[str, int]
) -> tuple[_FieldRows, IntensityMeasure | None]:
    """The rows, read one after the other, and the measure of their values; None for factors. Sites
    are those that there are places of, or where there are none all that are named.

    Raises
    ------
    ModelError
        The table cannot be read; all faults of its rows.
    """
    file = field.file
    needs = (
        "fields are a CSV file with the columns event, site, record and, if they are wanted, "
        "component and factor"
    )
    columns = (*_EVENTS, *_SITES, "record", _OTHER, "component", "factor")
    # Row by row: a table of many events at many sites does not fit into memory as text.
    table, lines = stream_table(file, needs, columns=columns, comment="#")
    event, site = _called(table, _EVENTS), _called(table, _SITES)
    table.need(event, "record", *([site] if field.sites else ()))
    if table.has(_OTHER) and not field.pairs:
        raise ModelError(
            f"{file}:{table.header_line}: {_OTHER} is of pairs: add pairs: true to the records"
        )
    value, unit, measure = _field_values(table)
    names = (event, "record", site, "component", _OTHER, value)
    width = len(table.header)
    at = [table.header.index(name) if name and table.has(name) else width for name in names]
    # Faults are gathered up to a number, so that one look at the file mends them all.
    rows, faults, pick = _FieldRows(sites), list[str](), itemgetter(*at)
    for line, cells in lines:
        if len(faults) >= _MOST_FAULTS:
            break
        # Almost all rows have names that stood before and a number: taken as they are, in two
        # thirds of the time.
        if len(cells) == width:
            event_name, record, place, component, other, text = pick([*cells, ""])
            at_site, of_event = sites.get(place, -1), rows.events.get(event_name, -1)
            of_record = rows.records.get((record, component, other), -1)
            factor = number(text) if text else math.nan
            if min(at_site, of_event, of_record) >= 0 and (
                factor > 0.0 or (factor < 0.0 and not measure)
            ):
                rows.add(at_site, of_event, of_record, unit * factor, line)
                continue
        if table.overfull(cells):
            faults.append(
                f"{file}:{line}: {how_many(len(cells), 'cell')} under {how_many(width, 'column')}"
            )
            continue
        # Cells that are missing at the end are empty ones.
        cells = [*cells[:width], *[""] * (width + 1 - len(cells[:width]))]
        event_name, record, place, component, other, text = (cells[number].strip() for number in at)
        missing = [name for name, text in ((event, event_name), ("record", record)) if not text]
        missing += [site] * (at[2] < width and not place)
        factor = number(text) if text else 1.0
        if missing:
            faults.append(f"{file}:{line}: {missing[0]} is missing")
        elif field.sites and place not in sites:
            faults.append(f"{file}:{line}: site {place!r} is not in {field.sites}")
        elif measure and not text:
            faults.append(f"{file}:{line}: {value} is missing")
        elif math.isnan(factor) or (measure and factor <= 0.0):
            faults.append(
                f"{file}:{line}: {value} "
                f"{no_number(text, 'a positive number' if measure else 'a number')}"
            )
        elif factor == 0.0:
            faults.append(f"{file}:{line}: {value} must not be zero, got {text[:40]!r}")
        # Names become numbers, 24 bytes a row.
        else:
            at_site = sites.setdefault(place, len(sites))
            of_event = rows.events.setdefault(event_name, len(rows.events) + 1)
            of_record = rows.records.setdefault((record, component, other), len(rows.records))
            rows.add(at_site, of_event, of_record, unit * factor, line)
    faults += rows.twice(file)
    if faults:
        shown, more = faults[:_SHOWN_FAULTS], len(faults) - _SHOWN_FAULTS
        last = (
            [f"and {'at least ' * (len(faults) >= _MOST_FAULTS)}{more} more faults"]
            if more > 0
            else []
        )
        raise ModelError("\n".join([*shown, *last]))
    if not rows.line:
        raise ModelError(f"{file}: has no rows below its header; {needs}")
    return rows, measure


def _field_values(table: CsvTable) -> tuple[str, float, IntensityMeasure | None]:
    """The column of factors, or of OpenQuake's intensities, gmv_PGA, gmv_PGV or gmv_SA(0.6), its
    unit in SI, and the measure of these; no column where all factors are 1."""
    columns = [name for name in table.header if name.startswith("gmv_")]
    # A column of factors goes before OpenQuake's intensities, which may then be any number.
    if table.has("factor") or not columns:
        return "factor" * table.has("factor"), 1.0, None
    match = _GMV.fullmatch(columns[0])
    if len(columns) > 1 or match is None:
        raise ModelError(
            f"{table.source}:{table.header_line}: {', '.join(columns)}: leave the one that the "
            "records are to have, gmv_PGA, gmv_PGV or gmv_SA(period), or give a column factor"
        )
    period = match["period"]
    if columns[0] == "gmv_pgv":
        return columns[0], _CENTIMETER, MotionIntensity("pgv")
    return columns[0], STANDARD_GRAVITY, sa(float(period), SA_DAMPING) if period else pga()


def _site_places(file: str) -> dict[str, tuple[float, float]]:
    """Longitude and latitude of each site, degrees."""
    needs = "sites are a CSV file with the columns site, longitude, latitude"
    table = read_table(file, needs, columns=(*_SITES, *_LONGITUDES, *_LATITUDES), comment="#")
    site, longitude, latitude = (
        _called(table, names) for names in (_SITES, _LONGITUDES, _LATITUDES)
    )
    table.need(site, longitude, latitude)
    return _by_name(table, site, "site", _degrees(table, longitude, latitude))


def _called(table: CsvTable, names: Sequence[str]) -> str:
    """The first of some names of a column that a table has; the usual one where it has none."""
    return next((name for name in names if table.has(name)), names[0])


class _FieldRecords:
    """The records of fields, each read once."""

    def __init__(self, field: FieldFile) -> None:
        self._wanted = field
        self.motions: list[SuiteMotion] = []
        self.failures: list[TdintError] = []
        self.notes: list[str] = []
        self._files: dict[Path, dict[str, list[str]]] = {}

    def motions_of(
        self, line: int, record: str, component: str, other: str, measure: IntensityMeasure | None
    ) -> tuple[tuple[int, float], ...]:
        """The motions of a record by their numbers, and what they have of the measure, SI (of a
        pair the geometric mean), or 1 for factors; none if it cannot be read or has not the
        measure."""
        first = len(self.motions)
        try:
            motions = self._read(record, component, other)
            measured = [
                1.0 if measure is None else measure.of(motion.whole, GEOMETRIC_MEAN)
                for motion in motions
            ]
        except (AnalysisError, RecordError, UsageError) as error:
            self.failures.append(RecordError(f"{self._wanted.file}:{line}: {error}"))
            return ()
        self.motions += motions
        return tuple((first + place, value) for place, value in enumerate(measured))

    def _read(self, record: str, component: str, other: str) -> tuple[SuiteMotion, ...]:
        field, folder = self._wanted, Path(self._wanted.file).parent
        file = resolve(record, folder)
        # Records of SimCenter's events are JSON, all others are records as elsewhere.
        if file.endswith(".json"):
            return _json_motions(file, component, field)
        choice = replace(field.choice, component=component or field.choice.component)
        if not field.pairs:
            suite = read_components([file], choice)
        elif other:
            # What the table names is a pair, whatever the names are.
            suite = read_pairs([file, resolve(other, folder)], choice, ONE_MOTION)
        else:
            suite = read_pairs([file], choice)
            if any(isinstance(error, SingleHorizontal) for error in suite.failures):
                suite = read_pairs(self._named_alike(file), choice)
        for error in suite.failures:
            if isinstance(error, SingleHorizontal):
                raise RecordError(
                    f"{error}: by its name it has no partner, which a column {_OTHER} may name"
                )
            raise error
        self.notes += suite.notes
        return suite_motions(suite.motions)

    def _named_alike(self, file: str) -> list[str]:
        """The files of a motion by their names: those beside a file that `records: files` would
        take together."""
        folder = Path(file).parent
        if folder not in self._files:
            beside = [str(path) for path in sorted(folder.iterdir())]
            of_motion: dict[str, list[str]] = {}
            for path, name in zip(beside, motion_names(beside), strict=True):
                of_motion.setdefault(name, []).append(path)
            self._files[folder] = {path: paths for paths in of_motion.values() for path in paths}
        return self._files[folder].get(str(Path(file)), [file])


def _json_motions(file: str, named: str, field: FieldFile) -> tuple[SuiteMotion, ...]:
    """The components of a motion as SimCenter has them."""
    # Such a file says nothing of its units.
    unit = file_units(field.choice.units).of(file, "JSON")
    if unit is None:
        raise RecordError(f"{file}: does not say its units; give `units` of the records")
    if unit.quantity != "acceleration":
        raise RecordError(f"{file}: is an acceleration, its units are given as {unit.text}")
    motions = _components_of(Path(), file, unit.scale)
    component = named or field.choice.component
    kept = [motion for motion in motions if component in (None, "", motion.component)]
    if not kept:
        raise RecordError(
            f"{file}: has no component {component!r}; it has "
            f"{', '.join(motion.component for motion in motions)}"
        )
    return tuple(
        kept
        if field.pairs
        else (replace(motion, whole=motion.record, direction=1) for motion in kept)
    )


def _degrees(table: CsvTable, longitude: str, latitude: str) -> list[tuple[float, float]]:
    """The places of rows, degrees."""
    east, north = table.numbers(longitude), table.numbers(latitude)
    table.check(
        longitude, (abs(degrees) <= 360.0 for degrees in east), "must be from -360 to 360 degrees"
    )
    table.check(
        latitude, (abs(degrees) <= 90.0 for degrees in north), "must be from -90 to 90 degrees"
    )
    return list(zip(east, north, strict=True))


def _motions_at(file: str) -> list[tuple[str, float]]:
    """The ground motions of a point, and their factors."""
    needs = (
        "the file of a grid's point is a CSV file with the column TH_file and, if they differ, "
        "factor"
    )
    table = read_table(file, needs, columns=("TH_file", "factor"))
    names = table.texts("TH_file", empty=False)
    factors = [1.0] * len(names)
    if table.has("factor"):
        numbers = table.numbers("factor", empty=True)
        table.check("factor", (number != 0.0 for number in numbers), "must not be zero")
        factors = [1.0 if math.isnan(number) else number for number in numbers]
    return list(zip(names, factors, strict=True))


def _components_of(folder: Path, name: str, unit: float) -> list[SuiteMotion]:
    """The components of a ground motion.

    Raises
    ------
    RecordError
        It cannot be read.
    """
    file = folder / (name if name.endswith(".json") else f"{name}.json")
    large = f"larger than {MOST_BYTES // 1024**2} MiB; this is no ground motion"
    data = read_whole(file, RecordError, {}, large, MOST_BYTES)
    try:
        content: object = json.loads(data, parse_int=float)  # all numbers are floats then
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{file}: not JSON: {error}") from None
    if not isinstance(content, Mapping) or "dT" not in content or "data_x" not in content:
        raise RecordError(f"{file}: needs dT and data_x")
    # Python's JSON takes nan and Infinity, too.
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
                raise RecordError(f"{file}: {key} is no list of numbers")
            record = Record(np.array(samples) * unit, dt, "", "", component, str(file))
            check_possible(record.acceleration, f"{file}: {key}")
            records.append(record)
    if len(records) == 2 and records[0].acceleration.size != records[1].acceleration.size:
        raise RecordError(f"{file}: data_x and data_y have different lengths")
    whole = records[0] if len(records) == 1 else Horizontals(records[0], records[1])
    return [
        SuiteMotion(record, name, record.component, whole, direction)
        for direction, record in enumerate(records, start=1)
    ]
