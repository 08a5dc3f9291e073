"""Read ground motions at sites: a grid of points, each with several motions, or ground motion
fields, the motion of each event at each site."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, compress, islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from tdint import csv_table
from tdint.arrays import cached_property
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
from tdint.response.spectra.elastic import SA_DAMPING
from tdint.studies.campaign.assigned_motions import (
    CampaignMotions,
    FieldFile,
    FieldMotions,
    GridFile,
    GridMotions,
    PointMotion,
    SiteMotions,
)
from tdint.studies.motions.intensity import (
    GEOMETRIC_MEAN,
    IntensityMeasure,
    MotionIntensity,
    pga,
    sa,
)
from tdint.units import STANDARD_GRAVITY, parse_units

# ---- Read a grid in the format of SimCenter's regional workflow, or fields of many events
#
# EventGrid.csv lists the grid points: a file for each point, and its location (columns GP_file,
# Longitude, Latitude). The file of a point lists its ground motions (columns TH_file and,
# optionally, factor). The ground motion NAME is in NAME.json, with the keys name, dT, data_x and,
# for a pair, data_y. Fields are a table of event, site, record and factor, and a table of sites.
# OpenQuake's names of the columns are also supported.

_EVENT_NAMES, _SITE_NAMES = ("event", "event_id"), ("site", "site_id", "custom_site_id")
_LONGITUDE_NAMES, _LATITUDE_NAMES = ("longitude", "lon"), ("latitude", "lat")
_GMV = r"gmv_(pga|pgv|sa\((?P<period>[0-9]*\.?[0-9]+)\))"
"""Column with an intensity (ground motion value) in a table of OpenQuake."""

_CENTIMETER = 0.01
"""Centimeter in m. OpenQuake writes peak ground velocities in cm/s."""

_SHOWN_FAULTS, _MAX_FAULTS = 10, 1000
"""Number of errors of a table that are shown, and number of errors after which reading stops."""

_COMPONENTS = {"data_x": "x", "data_y": "y"}
"""Name of the component by its key in a JSON file of a ground motion."""

_SECOND_FILE = "record_2"
"""Column with the file of the second component, for pairs of files with different names."""

_POINT_FORMAT = (
    "the file of a grid point is a CSV file with the column TH_file and, optionally, factor"
)

Value = TypeVar("Value")


def read_grid(grid: GridFile) -> CampaignMotions:
    """Read the ground motions of a grid and the points to which they belong.

    Returns
    -------
    CampaignMotions
        Components of all records, errors of records that could not be read, and the motions of each
        point (attribute `site_motions`).

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
    table = csv_table.read_table(
        grid.file, f"a grid is a CSV file with the columns {', '.join(columns)}", columns=columns
    )
    table.need(*columns)
    degrees = _degrees(table, "Longitude", "Latitude")
    points = list(zip(table.texts("GP_file", empty=False), degrees, strict=True))

    files = [file for file, _ in points]
    motions, failures, point_motions = _read_points(Path(grid.file).parent, files, unit.scale)
    if not motions:
        raise RecordError(
            "\n".join(map(str, failures)) or f"{grid.file}: no point has a ground motion"
        )
    if grid.events:
        site_motions: SiteMotions = _rows_as_events(grid, points, point_motions)
    else:
        # Points without readable motions are omitted: buildings near them use other points. A
        # motion that could not be read has no components.
        readable = [
            tuple((components, factor) for components, factor in listed if components)
            for listed in point_motions
        ]
        locations = list(compress(degrees, readable))
        site_motions = GridMotions(grid, locations, tuple(filter(None, readable)))
    return CampaignMotions(tuple(motions), tuple(failures), site_motions=site_motions)


def _read_points(
    folder: Path, files: Sequence[str], unit: float
) -> tuple[list[SuiteMotion], list[RecordError], list[list[PointMotion]]]:
    """Read the ground motions of all points of a grid. A record that several points list is read a
    single time.

    `unit` is the unit of the samples, m/s^2. The result contains the components of all records, the
    error of each record that cannot be read, and for each point its motions. A motion of a point
    without components belongs to a record that cannot be read.
    """
    motions: list[SuiteMotion] = []
    failures: list[RecordError] = []
    components_by_record: dict[str, tuple[int, ...]] = {}
    point_motions = []
    for file in files:
        motions_at_point: list[PointMotion] = []
        table = csv_table.read_table(
            str(folder / file), _POINT_FORMAT, columns=("TH_file", "factor")
        )
        names = table.texts("TH_file", empty=False)
        for name, factor in zip(names, factors_in(table), strict=True):
            if name not in components_by_record:
                first_number = len(motions)
                try:
                    motions += _read_components(folder, name, unit)
                except RecordError as error:
                    failures.append(error)
                # The range of numbers is empty if the record could not be read.
                components_by_record[name] = tuple(range(first_number, len(motions)))
            motions_at_point.append((components_by_record[name], factor))
        point_motions.append(motions_at_point)
    return motions, failures, point_motions


def _rows_as_events(
    grid: GridFile,
    points: Sequence[tuple[str, tuple[float, float]]],
    point_motions: Sequence[Sequence[PointMotion]],
) -> FieldMotions:
    """Convert the ground motions of a grid to ground motion fields.

    The points (file, location in degrees) are the sites, and row k of the file of each point is the
    motion of event k at this site. Events are named by their numbers, from 1. ModelError is raised
    if the files have different numbers of rows.
    """
    event_count = len(point_motions[0])
    for (file, _), motions in zip(points, point_motions, strict=True):
        if len(motions) != event_count:
            raise ModelError(
                f"{Path(grid.file).parent / file}: the file lists {len(motions)} motions, but "
                f"{points[0][0]} lists {event_count}; with `events`, the files of all points must "
                "list the same events in the same rows"
            )
    # List the motions of the first point, then of the second point, and so on. A record is
    # identified by the numbers of its components.
    all_motions = list(chain.from_iterable(point_motions))
    distinct_records = dict.fromkeys(components for components, _ in all_motions)
    record_numbers = {components: number for number, components in enumerate(distinct_records)}
    records = np.array([record_numbers[components] for components, _ in all_motions], np.int32)
    factors = np.array([factor for _, factor in all_motions], float)
    # Site and event (from 0) of each of these motions
    site, event = (indices.ravel() for indices in np.indices((len(points), event_count), np.int32))
    files, locations = zip(*points, strict=True)
    # The values of the fields are factors, so their divisor is 1.
    components_and_factors = [
        tuple((motion, 1.0) for motion in components) for components in record_numbers
    ]
    events = tuple(map(str, range(1, event_count + 1)))
    rows = site, event + 1, records, factors
    return FieldMotions.from_rows(grid, events, files, rows, components_and_factors, locations)


def read_field(field_file: FieldFile) -> CampaignMotions:
    """Read the ground motions of fields, and the motion of each event at each site.

    Returns
    -------
    CampaignMotions
        Records, errors of records that could not be read, notes, the motion of each event at each
        site (attribute `site_motions`), and annual rates of the events.

    Raises
    ------
    ModelError
        A table cannot be read; an event occurs twice at a site; a site is missing from the table of
        sites.
    RecordError
        No record can be read.
    """
    locations = _site_locations(field_file.sites) if field_file.sites else {}
    # Read the table first, so that its errors are reported before records are read.
    rows = _field_rows(field_file, {site: number for number, site in enumerate(locations)})
    records = _FieldRecords(field_file)
    motions = [records.motions_of(*record, rows.measure) for record in rows.first_uses()]
    if not any(motions):
        raise RecordError("\n".join(map(str, records.failures)))
    events, notes = tuple(rows.events), tuple(dict.fromkeys(records.notes))
    site, event, record, _, value = rows.arrays
    numbers = site, event, record, value
    field = FieldMotions.from_rows(
        field_file, events, tuple(rows.sites), numbers, motions, list(locations.values())
    )
    rates = _rates(field_file.rates, events) if field_file.rates else {}
    return CampaignMotions(tuple(records.motions), tuple(records.failures), notes, field, rates)


def _rates(file: str, events: Sequence[str]) -> dict[str, float]:
    """Return the annual rate (1/year) of each event of the fields, by its name, from a CSV file
    with the columns event and rate.

    Events that are not in the fields are ignored. ModelError is raised if the file cannot be read,
    a rate is negative, or an event has no rate.
    """
    table = csv_table.read_table(
        file, "rates are a CSV file with the columns event and rate", comment="#"
    )
    event = _find_column(table, _EVENT_NAMES)
    table.need(event, "rate")
    values = table.numbers("rate")
    table.check(
        "rate", (rate >= 0.0 for rate in values), "must be zero or a positive number per year"
    )
    rates = dict(zip(table.distinct(event, "event"), values, strict=True))
    # An event without a rate would be omitted from all annual losses, so it is an error.
    missing = [name for name in events if name not in rates]
    if missing:
        raise ModelError(
            f"{file}: {pluralize(len(missing), 'event')} of the fields have no rate in this file, "
            f"such as {missing[0]!r}; add a row for each event"
        )
    return {name: rates[name] for name in events}


@dataclass
class _FieldRows:
    """Rows of a table of ground motion fields, as arrays of numbers, which require 24 bytes per
    row.

    Attributes
    ----------
    settings : FieldFile
        Settings of the fields.
    columns : tuple of six str
        Names of the columns of event, record, site, component, file of the second component, and
        value; the last is empty if all values are 1.
    unit : float
        Unit of the values in SI.
    measure : IntensityMeasure | None
        Intensity measure of the values; None for factors.
    sites, events : dict of str to int
        Number of each site, from 0, and of each event, from 1.
    records : dict of (str, str, str) to int
        Number of each record, from 0. The key is the file, the component, and the file of the
        second component.
    blocks : list of tuples of five ndarray
        Arrays of `arrays`, for successive blocks of rows.
    """

    settings: FieldFile
    table: csv_table.CsvTable
    columns: tuple[str, str, str, str, str, str]
    unit: float
    measure: IntensityMeasure | None
    sites: dict[str, int]
    events: dict[str, int] = field(default_factory=dict)
    records: dict[tuple[str, str, str], int] = field(default_factory=dict)
    blocks: list[tuple[NDArray[Any], ...]] = field(default_factory=list)

    @cached_property
    def indices(self) -> list[int]:
        """Index of each column. A missing column has the index after the last column of the table,
        at which an empty cell is added to each row."""
        table = self.table
        return [
            table.header.index(name) if name and table.has(name) else len(table.header)
            for name in self.columns
        ]

    def add_block(self, block: Sequence[tuple[int, list[str]]]) -> list[str]:
        """Append the valid rows of a block (line number and cells of each row), and return the
        errors of the other rows. Cells may be missing at the end of a row."""
        width, indices = len(self.table.header), self.indices
        lines, cells = zip(*block, strict=True)
        # The column at the index `width` is empty, and represents the columns that do not exist.
        columns = [*self.table.columns_of(cells), ("",) * len(cells)]
        event, record, site, component, second_file, texts = (
            list(map(str.strip, columns[index])) for index in indices
        )
        # Without a value, the factor is 1. A value that is not a number is NaN, for which the
        # comparison is False.
        values = csv_table.numbers_in(texts)
        if not self.measure and "" in texts:
            values[[not text for text in texts]] = 1.0
        are_allowed = (values > 0.0 if self.measure else np.abs(values) > 0.0).all()
        # Replace names by numbers in the order of their first use. If a row is invalid, its names
        # also get numbers; this has no effect, because the table is refused.
        keys = list(zip(record, component, second_file, strict=True))
        events = _numbers_of(event, self.events, first=1)
        records = _numbers_of(keys, self.records)
        sites = _numbers_of(site, self.sites, may_add=not self.settings.sites)
        # A name is missing, or a site has no number (-1) because it is not in the table of sites.
        is_unnamed = (
            "" in self.events
            or any(not name for name, *_ in self.records)
            or ("" in self.sites and indices[2] < width)
        )
        # Almost all rows are valid. Only blocks with an error are read row by row.
        errors = [""] * len(cells)
        if not are_allowed or is_unnamed or -1 in sites or max(map(len, cells)) > width:
            rows = zip(cells, event, record, site, texts, values.tolist(), strict=True)
            errors = [self._row_error(*row) for row in rows]
        is_valid = [not error for error in errors]
        numbers = (
            np.array(column, np.int32)[is_valid] for column in (sites, events, records, lines)
        )
        self.blocks.append((*numbers, self.unit * values[is_valid]))
        return [
            f"{self.settings.file}:{line}: {error}"
            for line, error in zip(lines, errors, strict=True)
            if error
        ]

    def _row_error(
        self, cells: list[str], event: str, record: str, site: str, value_text: str, value: float
    ) -> str:
        """Return the error of a row; an empty text if it is valid.

        The texts are empty if the cell is empty or the column does not exist. `value` is NaN if
        `value_text` is not a number; without an intensity measure, it is 1 if the text is empty.
        """
        event_column, _, site_column, _, _, value_column = self.columns
        if error := self.table.surplus(cells):
            return error
        if not event:
            return f"{event_column} is missing"
        if not record:
            return "record is missing"
        if self.indices[2] < len(self.table.header) and not site:
            return f"{site_column} is missing"
        if self.settings.sites and site not in self.sites:
            return f"site {site!r} not found in {self.settings.sites}; add it there"
        if self.measure and not value_text:
            return f"{value_column} is missing"
        if math.isnan(value) or (self.measure and value <= 0.0):
            required = "a positive number" if self.measure else "a number"
            return f"{value_column} {csv_table.number_error(value_text, required)}"
        if value == 0.0:
            return f"{value_column} must not be zero, got {value_text[:40]!r}"
        return ""

    @cached_property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Numbers of site, event and record, line in the file, and value (factor on the record, or
        its target intensity in SI units) of all rows: five arrays of shape (rows,)."""
        return tuple(map(np.concatenate, zip(*self.blocks, strict=True)))

    def first_uses(self) -> list[tuple[int, str, str, str]]:
        """Return, for each record in the order of the numbers, the line of the first row that uses
        it, its file, its component, and the file of its second component."""
        # `unique` returns the index of the first row of each record, sorted by record.
        _, _, record, line, _ = self.arrays
        first_lines = line[np.unique(record, return_index=True)[1]].tolist()
        return [(line, *key) for line, key in zip(first_lines, self.records, strict=True)]

    def find_duplicates(self) -> list[str]:
        """Return an error message for each row that has the same event and site as an earlier row.
        `file` is the path of the table, for the messages."""
        site, event, _, line, _ = self.arrays
        # Combine event and site into one number. After sorting, duplicates are adjacent; the stable
        # sort keeps the order of their rows.
        combined = event.astype(np.int64) * len(self.sites) + site
        order = np.argsort(combined, kind="stable")
        positions = np.flatnonzero(np.diff(combined[order]) == 0)
        names, events = list(self.sites), list(self.events)
        faults = []
        for duplicate, first in sorted(
            (int(order[position + 1]), int(order[position]))
            for position in positions[:_MAX_FAULTS].tolist()
        ):
            name = names[site[duplicate]]
            location = f"site {name!r}" if name else "all buildings"
            event_name = events[event[duplicate] - 1]
            faults.append(
                f"{self.settings.file}:{line[duplicate]}: event {event_name!r} at "
                f"{location} is already on line {line[first]}; each event can have only one "
                "record at a site"
            )
        return faults


def _numbers_of(
    names: Sequence[Value], numbers: dict[Value, int], *, first: int = 0, may_add: bool = True
) -> list[int]:
    """Return the number of each name; -1 if the name has no number and must not be added.

    `numbers` contains the numbers by name, from `first`. New names are added in place, if allowed.
    """
    for name in dict.fromkeys(names) if may_add else ():
        numbers.setdefault(name, len(numbers) + first)
    return [numbers.get(name, -1) for name in names]


def _field_rows(field: FieldFile, sites: dict[str, int]) -> _FieldRows:
    """Read the rows of a table of ground motion fields.

    `sites` contains the numbers of the sites with a known location. If no file with the locations
    is specified, the sites of the table are added; a table without a column of sites then has a
    single site with an empty name. ModelError lists all errors of the rows.
    """
    file = field.file
    needs = (
        "fields are a CSV file with the columns event, site, record and, optionally, component and "
        "factor"
    )
    columns = (*_EVENT_NAMES, *_SITE_NAMES, "record", _SECOND_FILE, "component", "factor")
    # Read row by row: a table of many events at many sites does not fit into memory as text.
    table, lines = csv_table.stream_table(file, needs, columns=columns, comment="#")
    event, site = _find_column(table, _EVENT_NAMES), _find_column(table, _SITE_NAMES)
    table.need(event, "record", *([site] if field.sites else ()))
    if table.has(_SECOND_FILE) and not field.pairs:
        raise ModelError(
            f"{file}:{table.header_line}: the column {_SECOND_FILE} can only be used with pairs; "
            "add `pairs: true` to the records"
        )
    value, unit, measure = _field_values(table)
    used_columns = (event, "record", site, "component", _SECOND_FILE, value)
    rows = _FieldRows(field, table, used_columns, unit, measure, sites)
    # Collect errors up to a maximum, so that users can correct all errors in a single edit.
    faults: list[str] = []
    while len(faults) < _MAX_FAULTS and (block := list(islice(lines, csv_table.BLOCK))):
        faults += rows.add_block(block)
    if not rows.blocks:
        raise ModelError(f"{file}: the table has no rows below its header; {needs}")
    del faults[_MAX_FAULTS:]
    faults += rows.find_duplicates()
    if faults:
        messages = faults[:_SHOWN_FAULTS]
        if (more := len(faults) - _SHOWN_FAULTS) > 0:
            at_least = "at least " if len(faults) >= _MAX_FAULTS else ""
            messages.append(f"and {at_least}{more} more errors")
        raise ModelError("\n".join(messages))
    return rows


def _field_values(table: csv_table.CsvTable) -> tuple[str, float, IntensityMeasure | None]:
    """Return the column with the values of a table of fields, its unit, and its intensity measure.
    The values are factors on the records (no measure), or intensities computed by OpenQuake; the
    records are scaled to these values.

    The column is `factor`, `gmv_PGA`, `gmv_PGV` or `gmv_SA(0.6)`, or empty if all factors are 1.
    ModelError is raised if the table has several columns of intensities, or an unknown intensity.
    """
    columns = [name for name in table.header if name.startswith("gmv_")]
    # If the table has a column of factors, OpenQuake's columns of intensities are not used.
    if table.has("factor") or not columns:
        return "factor" if table.has("factor") else "", 1.0, None
    match = re.fullmatch(_GMV, columns[0])
    if len(columns) > 1 or match is None:
        raise ModelError(
            f"{table.source}:{table.header_line}: the table has the columns {', '.join(columns)}; "
            "keep only the intensity to which records are scaled, gmv_PGA, gmv_PGV or "
            "gmv_SA(period), or add a column factor"
        )
    period = match["period"]
    if columns[0] == "gmv_pgv":
        return columns[0], _CENTIMETER, MotionIntensity("pgv")
    return columns[0], STANDARD_GRAVITY, sa(float(period), SA_DAMPING) if period else pga()


def _site_locations(file: str) -> dict[str, tuple[float, float]]:
    """Read a table of sites, and return a dictionary from the name of each site to its longitude
    and latitude, degrees. `file` is the path of the CSV file."""
    format_text = "sites are a CSV file with the columns site, longitude, latitude"
    table = csv_table.read_table(
        file, format_text, columns=(*_SITE_NAMES, *_LONGITUDE_NAMES, *_LATITUDE_NAMES), comment="#"
    )
    site, longitude, latitude = (
        _find_column(table, names) for names in (_SITE_NAMES, _LONGITUDE_NAMES, _LATITUDE_NAMES)
    )
    table.need(site, longitude, latitude)
    locations = _degrees(table, longitude, latitude)
    return dict(zip(table.distinct(site, "site"), locations, strict=True))


def _find_column(table: csv_table.CsvTable, names: Sequence[str]) -> str:
    """Return the name of a column that can have several names.

    The result is the first name in `names` that the table contains. If the table contains none of
    the names, the result is the first name, with which a later check raises its error.
    """
    return next((name for name in names if table.has(name)), names[0])


class _FieldRecords:
    """Reader of the records of ground motion fields, which numbers the motions in the order in
    which they are read.

    Attributes
    ----------
    motions : list of SuiteMotion
        Motions of all records that were read; the index is the number.
    """

    def __init__(self, field: FieldFile) -> None:
        """Create a reader without motions. `field` contains the settings of the fields."""
        self._field = field
        self.motions: list[SuiteMotion] = []
        self.failures: list[TdintError] = []
        self.notes: list[str] = []
        # By directory, then by file: the name of the motion, which its components have in common
        self._motion_names: dict[Path, dict[str, str]] = {}

    def motions_of(
        self,
        line: int,
        record: str,
        component: str,
        second_file: str,
        measure: IntensityMeasure | None,
    ) -> tuple[tuple[int, float], ...]:
        """Read a record, append its motions to `motions`, and return the number of each motion and
        its intensity, SI (geometric mean of a pair), or 1 for factors.

        If the record cannot be read or the intensity cannot be computed, the error is appended to
        `failures` and the result is empty. `line` is the line of the table that first uses the
        record, for messages. `component` and `second_file` (of a pair) may be empty.
        """
        first_number = len(self.motions)
        try:
            motions = self._read(record, component, second_file)
            intensities = [
                1.0 if measure is None else measure.of(motion.ground_motion, GEOMETRIC_MEAN)
                for motion in motions
            ]
        except (AnalysisError, RecordError, UsageError) as error:
            self.failures.append(RecordError(f"{self._field.file}:{line}: {error}"))
            return ()
        self.motions += motions
        return tuple((first_number + index, value) for index, value in enumerate(intensities))

    def _read(self, record: str, component: str, second_file: str) -> tuple[SuiteMotion, ...]:
        """Read a record and return its motions: its components, or the two components of a pair.

        An empty `component` means the component of the settings. The component is also selected
        from the files of a pair. `second_file` is used only if the settings combine components to
        pairs. RecordError is raised if the record cannot be used, or the second component is not
        found.
        """
        field, folder = self._field, Path(self._field.file).parent
        file = resolve(record, folder)
        # SimCenter's records are JSON files; all other files are read as usual records.
        if file.endswith(".json"):
            return _json_motions(file, component, field)
        choice = replace(field.choice, component=component or field.choice.component)
        if not field.pairs:
            suite = read_components([file], choice)
        elif second_file:
            # The table specifies the pair: with ONE_MOTION, all files are components of one motion,
            # regardless of their names.
            suite = read_pairs([file, resolve(second_file, folder)], choice, ONE_MOTION)
        else:
            # If the file contains a single component, the other component is in a file with a
            # similar name.
            suite = read_pairs([file], choice)
            if any(isinstance(error, SingleHorizontal) for error in suite.failures):
                # The names of the files of a ground motion differ only in the component. Read each
                # directory a single time.
                directory = Path(file).parent
                if directory not in self._motion_names:
                    files = list(map(str, sorted(directory.iterdir())))
                    names = dict(zip(files, motion_names(files), strict=True))
                    self._motion_names[directory] = names
                names = self._motion_names[directory]
                motion_name = names.get(str(Path(file)))
                files = [other for other, name in names.items() if name == motion_name]
                suite = read_pairs(files or [file], choice)
        for error in suite.failures:
            if isinstance(error, SingleHorizontal):
                raise RecordError(
                    f"{error}: no file with a similar name contains the second component; specify "
                    f"its file in a column {_SECOND_FILE}"
                )
            raise error
        if field.pairs and len(suite.motions) > 1:
            raise RecordError(
                f"{file}: a single recording is required, but the file contains "
                f"{len(suite.motions)}; extract them"
            )
        self.notes += suite.notes
        return suite_motions(suite.motions)


def _json_motions(file: str, component_name: str, field: FieldFile) -> tuple[SuiteMotion, ...]:
    """Read the components of a motion in SimCenter's format; with the setting `pairs`, the
    components of a pair.

    An empty name means the component of the campaign file. RecordError is raised if the file cannot
    be used, its units are not specified, or the component is not found.
    """
    # The format does not state units, so the campaign file must specify them.
    unit = file_units(field.choice.units).of(file, "JSON")
    if unit is None:
        raise RecordError(f"{file}: the file does not state its units; add `units` to the records")
    if unit.quantity != "acceleration":
        raise RecordError(
            f"{file}: the samples are accelerations, but their units are specified as {unit.text}"
        )
    motions = _read_components(Path(), file, unit.scale)
    # Without a specified component (None or empty), all components are selected.
    component = component_name or field.choice.component
    selected = [motion for motion in motions if component in (None, "", motion.component)]
    if not selected:
        raise RecordError(
            f"{file}: component {component!r} not found; available components: "
            f"{', '.join(motion.component for motion in motions)}"
        )
    if field.pairs:
        return tuple(selected)
    # Without pairs, each component is a separate motion.
    return tuple(motion._replace(ground_motion=motion.record, direction=1) for motion in selected)


def _degrees(table: csv_table.CsvTable, longitude: str, latitude: str) -> list[tuple[float, float]]:
    """Return the longitude and latitude of each row of a table, degrees. `longitude` and `latitude`
    are the names of the columns."""
    longitudes, latitudes = table.numbers(longitude), table.numbers(latitude)
    table.check(
        longitude,
        (abs(degrees) <= 360.0 for degrees in longitudes),
        "must be from -360 to 360 degrees",
    )
    table.check(
        latitude, (abs(degrees) <= 90.0 for degrees in latitudes), "must be from -90 to 90 degrees"
    )
    return list(zip(longitudes, latitudes, strict=True))


def factors_in(table: csv_table.CsvTable, *, empty: bool = True) -> list[float]:
    """Return the scale factors in the column `factor`, or `scale` as in tables of runs, which must
    not be zero. If the column is missing, or a cell is empty (which `empty` allows), the factor is
    1. An error is raised if the table has both columns."""
    if table.has("factor", "scale"):
        raise table.error(f"{table.source}: factor and scale are both factors; omit one column")
    name = "scale" if table.has("scale") else "factor"
    if not table.has(name):
        return [1.0] * len(table.rows)
    cells = table.numbers(name, empty=empty)
    table.check(name, (factor != 0.0 for factor in cells), "must not be zero")
    return [1.0 if math.isnan(factor) else factor for factor in cells]


def _read_components(folder: Path, name: str, unit: float) -> list[SuiteMotion]:
    """Read one component or the two components of a pair from a JSON file (with or without the
    suffix .json). `unit` is the unit of the samples, m/s^2. RecordError is raised if the file
    cannot be read, or contains invalid values.
    """
    file = folder / (name if name.endswith(".json") else f"{name}.json")
    too_large_text = f"larger than {MOST_BYTES // 1024**2} MiB; this is not a ground motion"
    data = read_whole(file, RecordError, {}, too_large_text, MOST_BYTES)
    try:
        content: object = json.loads(data, parse_int=float)  # read whole numbers as floats also
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{file}: not JSON: {error}") from None
    if not isinstance(content, Mapping) or "dT" not in content or "data_x" not in content:
        raise RecordError(f"{file}: the keys dT and data_x are required")
    # Python's JSON parser also accepts NaN and Infinity, which this comparison refuses.
    dt = content["dT"]
    if not (isinstance(dt, float) and SHORTEST_STEP <= dt <= LONGEST_STEP):
        range_text = f"{SHORTEST_STEP:g} to {LONGEST_STEP:g} s"
        raise RecordError(
            f"{file}: dT must be a sampling interval, a number from {range_text}, got {dt!r:.40}"
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
