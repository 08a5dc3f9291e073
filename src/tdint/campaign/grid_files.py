"""Reading ground motions at places: a grid, as the regional workflow of SimCenter has it, and fields of many events.

EventGrid.csv names a file for each point (GP_file, Longitude, Latitude), that file the ground motions there (TH_file
and, if they differ, their factor), and NAME.json holds one of these: name, dT, data_x and, of a pair, data_y. Fields
are a table of event, site, record and factor, and a table of sites; OpenQuake's names of the columns are known, too.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import starmap
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.campaign.definition import FieldFile
from tdint.campaign.motions import Draw, FieldMotions, FoundMotions, GridFile, GridMotions, PointMotion
from tdint.campaign.suites.intensity import GEOMETRIC_MEAN, IntensityMeasure, MotionIntensity, pga, sa
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, RecordError, TdintError, UsageError
from tdint.ground_motion.header_checks.statement import LONGEST_STEP, SHORTEST_STEP
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.reading.segments import check_possible
from tdint.ground_motion.reading.suites import SuiteMotion, read_components, read_pairs, suite_motions
from tdint.ground_motion.record import Record
from tdint.input_bytes import MOST_BYTES, read_at_most
from tdint.model.keys.fields import resolve
from tdint.units import STANDARD_GRAVITY, parse_units

_EVENTS, _SITES = ("event", "event_id"), ("site", "site_id", "custom_site_id")
_LONGITUDES, _LATITUDES = ("longitude", "lon"), ("latitude", "lat")
_GMV = re.compile(r"gmv_(pga|pgv|sa\((?P<period>[0-9]*\.?[0-9]+)\))")
_CENTIMETER = 0.01
_COMPONENTS = {"data_x": "x", "data_y": "y"}


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
            f"{grid.file}: the motions of a grid are accelerations, their units are given as {grid.units}"
        )
    folder = Path(grid.file).parent
    motions: list[SuiteMotion] = []
    numbers: dict[str, tuple[int, ...]] = {}
    failures: list[RecordError] = []
    points, of_points = [], []
    for file, place in _points(grid.file):
        found: list[PointMotion] = []
        for name, factor in _motions_at(str(folder / file)):
            if name not in numbers:
                first = len(motions)
                try:
                    motions += _components_of(folder, name, unit.scale)
                except RecordError as error:
                    failures.append(error)
                numbers[name] = tuple(range(first, len(motions)))
            found.append((numbers[name], factor))
        points.append((file, place))
        of_points.append(found)
    if not motions:
        raise RecordError("\n".join(map(str, failures)) or f"{grid.file}: no point has a ground motion")
    if grid.events:
        return FoundMotions(tuple(motions), tuple(failures), places=_rows_as_events(grid.file, points, of_points))
    kept = [(place, tuple(one for one in found if one[0])) for (_, place), found in zip(points, of_points, strict=True)]
    there = [(place, found) for place, found in kept if found]
    places = GridMotions([place for place, _ in there], tuple(found for _, found in there))
    return FoundMotions(tuple(motions), tuple(failures), places=places)


def _rows_as_events(
    source: str, points: Sequence[tuple[str, tuple[float, float]]], of_points: Sequence[Sequence[PointMotion]]
) -> FieldMotions:
    """The field in which the k-th row of each point's file is event k."""
    count = len(of_points[0])
    for (file, _), found in zip(points, of_points, strict=True):
        if len(found) != count:
            raise ModelError(
                f"{Path(source).parent / file}: {len(found)} motions, where {points[0][0]} has {count}; with `events` "
                "the rows of these files are the same events at all points"
            )
    motions = tuple(
        tuple(sorted(Draw(one, k, factor) for k, (both, factor) in enumerate(found, start=1) for one in both))
        for found in of_points
    )
    events = tuple(str(number) for number in range(1, count + 1))
    return FieldMotions(events, tuple(file for file, _ in points), motions, [place for _, place in points])


def read_field(wanted: FieldFile) -> FoundMotions:
    """The ground motions of fields, and what each event does at each site.

    Raises
    ------
    ModelError
        A table cannot be read; an event is twice at a site, or a site is in no table of sites.
    RecordError
        No record can be read.
    """
    rows, measure = _field_rows(wanted.file, needs_site=wanted.sites is not None)
    places = _site_places(wanted.sites) if wanted.sites else dict.fromkeys((row.site for row in rows), (0.0, 0.0))
    seen: dict[tuple[str, str], int] = {}
    for row in rows:
        if row.site not in places:
            raise ModelError(f"{wanted.file}:{row.line}: site {row.site!r} is not in {wanted.sites}")
        if (row.event, row.site) in seen:
            at = f"site {row.site!r}" if row.site else "all buildings"
            raise ModelError(
                f"{wanted.file}:{row.line}: event {row.event!r} at {at} is already on line "
                f"{seen[row.event, row.site]}; give each event one record at a site"
            )
        seen[row.event, row.site] = row.line
    records = _FieldRecords(wanted)
    numbers = {event: number for number, event in enumerate(dict.fromkeys(row.event for row in rows), start=1)}
    found: dict[str, list[Draw]] = {site: [] for site in places}
    for row in rows:
        found[row.site] += records.draws(row, numbers[row.event], measure)
    if not any(found.values()):
        raise RecordError("\n".join(map(str, records.failures)))
    given = list(places.values()) if wanted.sites else []
    field = FieldMotions(tuple(numbers), tuple(places), tuple(tuple(sorted(one)) for one in found.values()), given)
    return FoundMotions(tuple(records.motions), tuple(records.failures), tuple(dict.fromkeys(records.notes)), field)


class _FieldRow(NamedTuple):
    """What an event does at a site; the value is a factor on the record, or the intensity that it is brought to, SI."""

    line: int
    event: str
    site: str
    record: str
    component: str
    value: float


def _field_rows(file: str, *, needs_site: bool) -> tuple[list[_FieldRow], IntensityMeasure | None]:
    """The rows, and the measure of their values; None for factors."""
    needs = "fields are a CSV file with the columns event, site, record and, if they are wanted, component and factor"
    table = read_table(file, needs, columns=(*_EVENTS, *_SITES, "record", "component", "factor"), comment="#")
    event, site = _called(table, _EVENTS), _called(table, _SITES)
    table.need(event, "record", *([site] if needs_site else ()))
    lines = [line for line, _ in table.rows]
    nothing = [""] * len(lines)
    events, names = table.texts(event, empty=False), table.texts("record", empty=False)
    sites = table.texts(site, empty=False) if table.has(site) else nothing
    components = table.texts("component") if table.has("component") else nothing
    values, measure = _field_values(table)
    return list(starmap(_FieldRow, zip(lines, events, sites, names, components, values, strict=True))), measure


def _field_values(table: CsvTable) -> tuple[list[float], IntensityMeasure | None]:
    """Factors, or OpenQuake's intensities with their measure: of a column gmv_PGA, gmv_PGV or gmv_SA(0.6)."""
    if table.has("factor"):
        return _factors(table), None
    columns = [name for name in table.header if name.startswith("gmv_")]
    if not columns:
        return _factors(table), None
    known = _GMV.fullmatch(columns[0])
    if len(columns) > 1 or known is None:
        raise ModelError(
            f"{table.source}:{table.header_line}: {', '.join(columns)}: leave the one that the records are to have, "
            "gmv_PGA, gmv_PGV or gmv_SA(period), or give a column factor"
        )
    values, period = table.numbers(columns[0], positive=True), known["period"]
    if columns[0] == "gmv_pgv":
        return [_CENTIMETER * value for value in values], MotionIntensity("pgv")
    return [STANDARD_GRAVITY * value for value in values], sa(float(period), SA_DAMPING) if period else pga()


def _site_places(file: str) -> dict[str, tuple[float, float]]:
    """Longitude and latitude of each site, degrees."""
    needs = "sites are a CSV file with the columns site, longitude, latitude"
    table = read_table(file, needs, columns=(*_SITES, *_LONGITUDES, *_LATITUDES), comment="#")
    site, longitude, latitude = (_called(table, known) for known in (_SITES, _LONGITUDES, _LATITUDES))
    table.need(site, longitude, latitude)
    found: dict[str, tuple[float, float]] = {}
    for (line, name), place in zip(table.lines(site, empty=False), _degrees(table, longitude, latitude), strict=True):
        if name in found:
            raise ModelError(f"{file}:{line}: site {name!r} is there twice")
        found[name] = place
    return found


def _called(table: CsvTable, known: Sequence[str]) -> str:
    """The first of some names of a column that a table has; the usual one where it has none."""
    return next((name for name in known if table.has(name)), known[0])


class _FieldRecords:
    """The records of fields, each read once."""

    def __init__(self, wanted: FieldFile) -> None:
        self._wanted = wanted
        self._known: dict[tuple[str, str], tuple[int, ...]] = {}
        self._measured: dict[int, float] = {}
        self.motions: list[SuiteMotion] = []
        self.failures: list[TdintError] = []
        self.notes: list[str] = []

    def draws(self, row: _FieldRow, event: int, measure: IntensityMeasure | None) -> list[Draw]:
        """The components of a row's record with their factors; none if it cannot be read or has not the measure."""
        key = (row.record, row.component)
        try:
            if key not in self._known:
                self._known[key] = ()  # a record that cannot be read is told once
                found = self._read(row)
                self._known[key] = tuple(range(len(self.motions), len(self.motions) + len(found)))
                self.motions += found
            measured = [1.0 if measure is None else self._value(motion, measure) for motion in self._known[key]]
        except (AnalysisError, RecordError, UsageError) as error:
            self.failures.append(RecordError(f"{self._wanted.file}:{row.line}: {error}"))
            return []
        return [Draw(motion, event, row.value / one) for motion, one in zip(self._known[key], measured, strict=True)]

    def _value(self, motion: int, measure: IntensityMeasure) -> float:
        """The intensity of a motion, of a pair the geometric mean, in SI units."""
        if motion not in self._measured:
            self._measured[motion] = measure.of(self.motions[motion].whole, GEOMETRIC_MEAN)
        return self._measured[motion]

    def _read(self, row: _FieldRow) -> tuple[SuiteMotion, ...]:
        wanted, file = self._wanted, resolve(row.record, Path(self._wanted.file).parent)
        if file.endswith(".json"):
            return _json_motions(file, row, wanted)
        choice = replace(wanted.choice, component=row.component or wanted.choice.component)
        suite = (read_pairs if wanted.pairs else read_components)([file], choice)
        for error in suite.failures:
            raise error
        self.notes += suite.notes
        self.notes += [f"{one.source}: {one.component}: {text}" for one in suite.records for text in one.warnings]
        return suite_motions(suite.motions)


def _json_motions(file: str, row: _FieldRow, wanted: FieldFile) -> tuple[SuiteMotion, ...]:
    """The components of a motion as SimCenter has them."""
    if wanted.choice.units is None:
        raise RecordError(f"{file}: does not say its units; give `units` of the records")
    unit = parse_units(wanted.choice.units)
    if unit.quantity != "acceleration":
        raise RecordError(f"{file}: is an acceleration, its units are given as {wanted.choice.units}")
    motions = _components_of(Path(), file, unit.scale)
    component = row.component or wanted.choice.component
    kept = [one for one in motions if component in (None, "", one.component)]
    if not kept:
        raise RecordError(
            f"{file}: has no component {component!r}; it has {', '.join(one.component for one in motions)}"
        )
    return tuple(kept if wanted.pairs else (replace(one, whole=one.record, direction=1) for one in kept))


def _points(file: str) -> list[tuple[str, tuple[float, float]]]:
    """The file of each point of a grid, and its longitude and latitude, degrees."""
    columns = ("GP_file", "Longitude", "Latitude")
    table = read_table(file, f"a grid is a CSV file with the columns {', '.join(columns)}", columns=columns)
    table.need(*columns)
    places = _degrees(table, "Longitude", "Latitude")
    return list(zip(table.texts("GP_file", empty=False), places, strict=True))


def _degrees(table: CsvTable, longitude: str, latitude: str) -> list[tuple[float, float]]:
    """The places of rows, degrees."""
    east, north = table.numbers(longitude), table.numbers(latitude)
    table.check(longitude, (abs(one) <= 360.0 for one in east), "must be from -360 to 360 degrees")
    table.check(latitude, (abs(one) <= 90.0 for one in north), "must be from -90 to 90 degrees")
    return list(zip(east, north, strict=True))


def _motions_at(file: str) -> list[tuple[str, float]]:
    """The ground motions of a point, and their factors."""
    needs = "the file of a grid's point is a CSV file with the column TH_file and, if they differ, factor"
    table = read_table(file, needs, columns=("TH_file", "factor"))
    names = table.texts("TH_file", empty=False)
    return list(zip(names, _factors(table), strict=True))


def _factors(table: CsvTable) -> list[float]:
    """The factor of each row, 1 where nothing is said."""
    if not table.has("factor"):
        return [1.0] * len(table.rows)
    factors = table.numbers("factor", empty=True)
    table.check("factor", (one != 0.0 for one in factors), "must not be zero")
    return [1.0 if math.isnan(factor) else factor for factor in factors]


def _components_of(folder: Path, name: str, unit: float) -> list[SuiteMotion]:
    """The components of a ground motion.

    Raises
    ------
    RecordError
        It cannot be read.
    """
    records = _read_motion(folder, name, unit)
    whole = records[0] if len(records) == 1 else Horizontals(records[0], records[1])
    return [SuiteMotion(one, name, one.component, whole, direction) for direction, one in enumerate(records, start=1)]


def _read_motion(folder: Path, name: str, scale: float) -> list[Record]:
    file = folder / (name if name.endswith(".json") else f"{name}.json")
    content = _read_json(file)
    if not isinstance(content, Mapping) or "dT" not in content or "data_x" not in content:
        raise RecordError(f"{file}: needs dT and data_x")
    dt = content["dT"]
    if not (isinstance(dt, float) and SHORTEST_STEP <= dt <= LONGEST_STEP):
        limits = f"{SHORTEST_STEP:g} to {LONGEST_STEP:g} s"
        raise RecordError(f"{file}: dT must be a sampling interval, a number from {limits}, got {dt!r:.40}")
    found = []
    for key, component in _COMPONENTS.items():
        if key in content:
            samples = content[key]
            if not isinstance(samples, list) or not all(isinstance(one, float) for one in samples):
                raise RecordError(f"{file}: {key} is no list of numbers")
            record = Record(np.array(samples) * scale, dt, "", "", component, str(file))
            check_possible(record.acceleration, f"{file}: {key}")
            found.append(record)
    if len(found) == 2 and found[0].acceleration.size != found[1].acceleration.size:
        raise RecordError(f"{file}: data_x and data_y have different lengths")
    return found


def _read_json(file: Path) -> object:
    """What a JSON file holds; all its numbers are floats."""
    try:
        data = read_at_most(file, MOST_BYTES, RecordError)
    except (OSError, ValueError) as error:
        raise RecordError(f"{file}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > MOST_BYTES:
        raise RecordError(f"{file}: larger than {MOST_BYTES // 1024**2} MiB; this is no ground motion")
    try:
        found: object = json.loads(data, parse_int=float)
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{file}: not JSON: {error}") from None
    return found
