"""Tables of a campaign: runs, stories, profiles and floor spectra. They are read from the store and
written in batches, so that memory use is limited."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice, repeat
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from tdint.output.tables.runs import BUILDING_COLUMNS, RUN_ERRORS, RUNS, SAMPLE, varied_columns
from tdint.output.tables.spectra import FLOOR_SUITE_COLUMNS, SPECTRUM
from tdint.output.tables.table import (
    DAMPING,
    FLOOR,
    PAIR_DEMAND,
    PERIOD,
    TEXT,
    Cell,
    Column,
    Table,
    cell_text,
    converted,
    csv_bytes,
    error_columns,
    names,
    rows_of,
)
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.studies.campaign.story_profiles import (
    FloorSuite,
    Profile,
    Ratios,
    SpectraOfRuns,
    level_measure,
    profiles,
)
from tdint.studies.columns import declared
from tdint.studies.fragility.measures import RunMeasure
from tdint.studies.store.result_store import Store
from tdint.studies.store.schema import RowTable
from tdint.units import SI, OutputUnits, Quantity, suffix

EVENT = Column.named("event", "event of a ground motion field", TEXT)


(LEVEL,) = declared("campaign.level")
COUNTS = declared("campaign.counts")

PROFILES = (BUILDING_COLUMNS[0], *declared("campaign.profiles"), *COUNTS)
"""Columns of profiles.csv."""

PROFILE_ERRORS = error_columns(PROFILES[5:10])
"""Additional columns of a campaign with error estimates."""

FLOOR_SUITES = (*PROFILES[:2], FLOOR, DAMPING, PERIOD, *FLOOR_SUITE_COLUMNS, *COUNTS)
"""Columns of floor-spectra-mean.csv."""

RATIOS = (
    BUILDING_COLUMNS[0]._replace(value="compared.building"),
    Column("baseline", TEXT, "base.building", "name of the baseline building"),
    PROFILES[1],
    Column(
        "quantity",
        "text",
        "quantity",
        f"{PROFILES[2].meaning}; base_shear is the restoring force of the first story",
    ),
    *declared(
        "campaign.ratios",
        story=lambda item: np.array([None, *range(1, item.ratios.mean.size)], dtype=object),
    ),
)
"""Columns of ratios.csv."""


def variant_columns(*, has_levels: bool, by_length: bool) -> list[Column]:
    """Return the columns of the table of a report with a row for each building."""
    drift, drift_unit = ("drift", "m") if by_length else ("drift_ratio", "1")
    end = "_m" if by_length else ""
    return [
        Column("building", TEXT, "profile.building", ""),
        *([Column("level", TEXT, "profile.level_text", "")] if has_levels else []),
        Column.named("collapses", "", TEXT),
        Column("motions", "1", "profile.counts.completed", ""),
        Column(f"mean_{drift}{end}", drift_unit, "mean_drift", ""),
        Column(f"largest_{drift}{end}", drift_unit, "largest_drift", ""),
        Column("times_baseline", "1", "ratio", ""),
        Column.named("acceleration", "", "m/s^2"),
        Column(f"residual_{drift}{end}", drift_unit, "residual_drift", ""),
        Column("base_shear_N", "N", "base_shear", ""),
        Column("device_force_N", "N", "device_force", ""),
        Column("device_stroke_m", "m", "device_stroke", ""),
    ]


def measure_columns(measures: Sequence[RunMeasure]) -> tuple[Column, ...]:
    """Return the columns of measures.csv: identification of the run, and a column for each
    intensity measure."""
    columns = [
        Column(
            f"{measure.column}{suffix(measure.unit)}", measure.unit, measure.column, measure.meaning
        )
        for measure in measures
    ]
    return (*BUILDING_COLUMNS, SAMPLE, *columns)


STATUS = (
    Column.named("status", "status of runs; left: not completed yet", TEXT),
    Column.named("runs", "number of runs"),
)


_SITE_COLUMNS = {
    "site": "site of the ground motion fields that is nearest to the building",
    "distance_km": "distance between site and building, km",
}
"""Columns that precede the inventory columns if the ground motion fields have sites."""

_ROWS_AT_ONCE = 2048  # number of runs formatted together, which needs some MB

_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][-+]?[0-9]{1,2})?")
"""Numbers as in JSON; for example, 02138 is text."""


class StoreTable(NamedTuple):
    """Table of a campaign. The rows are read from the store when they are written, because there
    can be millions of runs. Numbers are in SI units; texts were formatted by `cell_text`."""

    columns: Sequence[Column]
    rows: Iterable[list[Any]]

    @classmethod
    def of_results(cls, columns: Sequence[Column], results: Iterable[Any]) -> StoreTable:
        """Return a table with the rows of results, for which the columns are evaluated."""
        rows = (
            [cell_text(cell) if isinstance(cell, str) else cell for cell in row]
            for result in results
            for row in rows_of(columns, result)
        )
        return cls(columns, rows)

    def write(self, stream: BinaryIO, units: OutputUnits = SI) -> None:
        """Write the table as CSV to a stream, in output units."""
        names_and_factors = [units.column(column.name, column.unit) for column in self.columns]
        stream.write(csv_bytes([[name for name, _ in names_and_factors]]))
        rows = self.rows
        if units != SI:
            factors = [factor for _, factor in names_and_factors]
            rows = (
                [converted(cell, factor) for cell, factor in zip(row, factors, strict=True)]
                for row in rows
            )
        # Rows are formatted in batches, because a campaign may have more rows than fit into memory.
        source = iter(rows)
        while batch := list(islice(source, _ROWS_AT_ONCE)):
            stream.write(csv_bytes(batch))


def run_table(store: Store) -> StoreTable:
    """Return runs.csv, the table of all runs of a campaign.

    The last columns are the parameters of a sweep, the event and the columns of the inventory, if
    the campaign has them.
    """
    error_columns_of_runs = RUN_ERRORS if store.checked else ()
    sweep_columns = varied_columns(_varied_names(store.varied()))
    columns = (*RUNS, *error_columns_of_runs, *sweep_columns)
    return StoreTable((*columns, *copied_columns(store, names(columns))), _run_rows(store))


def _varied_names(varied: Sequence[Mapping[str, float]]) -> list[str]:
    """Return the names of all parameters that a sweep changed; `varied` has the changed values of
    each building by name."""
    return list(dict.fromkeys(name for values in varied for name in values))


def run_heads(store: Store) -> Callable[[int, int], list[str]]:
    """Return a function that returns the first three cells of the row of a run: building, record
    and component. The arguments of the function are the numbers of the building and the record."""
    # The names are formatted one time, because there can be millions of runs.
    buildings = {number: cell_text(name) for number, (name, _) in store.buildings().items()}
    records = {
        number: [cell_text(name), cell_text(component)]
        for number, (name, component, _) in store.records().items()
    }
    return lambda building, record: [buildings[building], *records[record]]


def _run_rows(store: Store) -> Iterator[list[Any]]:
    """Yield the rows of runs.csv in the order of buildings, records, scale factors and samples."""
    # For each building of a sweep, `varied` has the changed values by the name of the parameter. It
    # is empty for other campaigns.
    varied = store.varied()
    varied_names = _varied_names(varied)
    varied_cells = [[values.get(name) for name in varied_names] for values in varied]
    methods = {number: cell_text(method) for number, (_, method) in store.buildings().items()}
    name_cells, inventory_cells, has_errors = run_heads(store), copied_cells(store), store.checked
    for building, record, scale, sample, motion, level, dt, status, *values in store.runs():
        head = [
            *name_cells(building, record),
            scale,
            sample,
            motion,
            level,
            methods[building],
            dt,
            status,
        ]
        # The columns of RUNS are followed by values that are not in the table, and by the errors,
        # which every row of the store contains, even if no errors were estimated.
        results = values[: len(RUNS) - len(head)]
        errors = values[len(values) - len(RUN_ERRORS) :] if has_errors else []
        parameters = varied_cells[building] if varied_cells else []
        yield head + results + errors + parameters + inventory_cells(building, sample)


def part_table(store: Store, table: RowTable) -> StoreTable:
    """Return stories.csv, elements.csv, attachments.csv or links.csv, the results of these parts of
    the buildings in all runs of a campaign; or shocks.csv, the response to each event of a
    sequence. The rows are in the order of runs.csv and of the model file.

    The column `sample` is included if ground motions were sampled, because two samples can be the
    same ground motion.
    """
    has_samples = store.count("sample > 0") > 0
    sample_column = (SAMPLE,) if has_samples else ()
    errors = table.errors if store.checked else ()
    columns = (*BUILDING_COLUMNS, *sample_column, *table.shown, *errors)
    return StoreTable(columns, _part_rows(store, table, has_samples=has_samples))


def _part_rows(store: Store, table: RowTable, *, has_samples: bool) -> Iterator[list[Any]]:
    """Yield the rows of `part_table`."""
    name_cells = run_heads(store)
    for building, record, scale, sample, *cells in store.parts(table):
        sample_cell = (sample,) if has_samples else ()
        yield [*name_cells(building, record), scale, *sample_cell, *cells]


def _profile_rows(profiles: Iterable[Profile], units: OutputUnits) -> Iterator[list[Any]]:
    """Yield the rows of profiles.csv: statistics of the peak responses over the ground motions.

    There is one row per building, intensity level, quantity and story, from the ground up.
    """
    for profile in profiles:
        counts = (profile.counts.motions, *profile.counts[1:])
        level = () if math.isnan(profile.level) else (profile.level,)
        pair_demand = (profile.pair_demand,) if profile.pair_demand else ()
        for quantity in STORY_QUANTITIES:
            unit, factor = units.unit(quantity.unit)
            statistics = (np.array(profile.statistics(quantity)).T / factor).tolist()
            errors: Iterable[Sequence[float]] = repeat(())  # no cells if not estimated
            if (error_statistics := profile.errors(quantity)) is not None:
                errors = (np.array(error_statistics).T / factor).tolist()
            name = quantity.called or quantity.name
            # The lengths may differ (`strict=False`), because `repeat` is endless.
            for story, (cells, error_cells) in enumerate(
                zip(statistics, errors, strict=False), start=1
            ):
                head = (cell_text(profile.building), profile.scale, *level, name, story, unit)
                yield [*head, *cells, *counts, *error_cells, *pair_demand]


def with_level(store: Store, columns: tuple[Column, ...], index: int) -> tuple[Column, ...]:
    """Return the columns with the column of the intensity level inserted before the column `index`.

    The columns are unchanged if the levels of the campaign are scale factors, because these have a
    separate column.
    """
    if level_measure(store) is None:
        return columns
    return (*columns[:index], LEVEL, *columns[index:])


def with_pair_demand(store: Store, columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return the columns of a table and, if the campaign has pairs of components, the column with
    the rule for the demand of a pair, such as `larger`; all its cells are equal."""
    pair_demand = store.pair_rule().demand_if_pairs
    if not pair_demand:
        return tuple(columns)
    return (*columns, PAIR_DEMAND._replace(value=lambda _: pair_demand))


def profiles_table(store: Store, units: OutputUnits) -> StoreTable:
    """Return profiles.csv, the statistics of peak responses over the ground motions, in the units
    of its rows.

    Levels that are not scale factors have a column `level`.
    """
    errors = PROFILE_ERRORS if store.checked else ()
    columns = with_pair_demand(store, (*with_level(store, PROFILES, 2), *errors))
    return StoreTable(columns, _profile_rows(profiles(store), units))


def profile_table(
    profile: Profile,
    names: Sequence[str],
    units: OutputUnits = SI,
    statistics_names: Sequence[str] = ("mean", "max"),
) -> Table:
    """Return the mean and maximum of quantities over the ground motions, with a row per story.

    Parameters
    ----------
    names : sequence of str
        Names of the quantities. A quantity that is zero or missing in all stories is omitted.
    """
    columns: list[Column] = [_STORY_OF_PROFILE]
    for quantity in _named(names):
        statistics = profile.statistics(quantity)
        if np.any(np.nan_to_num(statistics.max)):
            columns += [
                Column(
                    f"{name}_{quantity.column}",
                    quantity.unit,
                    getattr(statistics, name),
                    f"{noun}: {quantity.meaning}",
                )
                for name, noun in (("mean", "mean"), ("max", "maximum"))
                if name in statistics_names
            ]
    return Table.of_results(columns, [profile]).in_units(units)


_STORY_OF_PROFILE = PROFILES[3]._replace(
    value=lambda profile: np.arange(1, profile.height.size + 1)
)


def _named(names: Sequence[str]) -> list[Quantity]:
    """Return the quantities with these names, in the order of the names."""
    quantities_by_name = {
        quantity.called or quantity.name: quantity for quantity in STORY_QUANTITIES
    }
    return [quantities_by_name[name] for name in names]


def profile_error_table(profile: Profile, names: Sequence[str]) -> Table:
    """Return the errors of means and maxima that result from the errors of the runs, in percent,
    with a row per story. Errors of residual drifts are in percent of the peak drifts.

    Parameters
    ----------
    names : sequence of str
        Names of the quantities. A quantity without estimated errors is omitted.
    """
    columns: list[Column] = [_STORY_OF_PROFILE]
    drift_statistics = profile.statistics(_named(["peak_drift"])[0])
    for quantity in _named(names):
        statistics, errors = profile.statistics(quantity), profile.errors(quantity)
        if errors is None or not np.any(np.nan_to_num(statistics.max)):
            continue
        # A residual drift can be close to zero, so its error is given relative to the peak drift.
        reference = drift_statistics if quantity.name.startswith("residual") else statistics
        for name in ("mean", "max"):
            reference_values = getattr(reference, name)
            reference_values = np.where(reference_values > 0.0, reference_values, np.nan)
            percent = [
                float(f"{value:.2g}") for value in 100.0 * getattr(errors, name) / reference_values
            ]
            columns.append(
                Column(
                    f"{name}_{quantity.called or quantity.name}",
                    "%",
                    np.array(percent),
                    quantity.meaning,
                )
            )
    return Table.of_results(columns, [profile])


def ratio_table(store: Store, ratios: Sequence[Ratios], *, stories: bool) -> Table:
    """Return the table of the ratios to a baseline.

    Parameters
    ----------
    stories : bool
        True for the ratios of each story and of the maxima over the stories; False for the ratios
        of the maxima only.
    """
    table = Table.of_results(with_pair_demand(store, with_level(store, RATIOS, 3)), ratios)
    if stories:
        return table
    # The rows of the maxima over the stories have no story.
    story_index = table.columns.index("story")
    return table._replace(rows=[row for row in table.rows if row[story_index] is None])


def run_floor_table(store: Store, floors: SpectraOfRuns) -> Table:
    """Return the table of the floor spectra of runs, with a row per run, floor, damping ratio and
    period.
    """
    # Two samples can be the same ground motion; their numbers distinguish the rows.
    has_samples = store.count("sample > 0") > 0
    columns = (*BUILDING_COLUMNS, *((SAMPLE,) if has_samples else ()), FLOOR, *SPECTRUM)
    buildings, records = store.buildings(), store.records()
    heads: list[tuple[Cell, ...]] = []
    spectra = []
    for building, spectra_of_run in floors.items():
        for run, spectra_of_floors in spectra_of_run.items():
            name, component, _ = records[run.motion]
            sample = (run.sample,) if has_samples else ()
            head = (buildings[building][0], name, component, run.scale, *sample)
            heads += [(*head, floor_spectrum.floor) for floor_spectrum in spectra_of_floors]
            spectra += [floor_spectrum.spectrum for floor_spectrum in spectra_of_floors]
    return Table.of_results(columns, spectra, heads)


def floor_suite_table(store: Store, suites: Sequence[FloorSuite]) -> Table:
    """Return the table of the mean and the maximum of floor spectra over the ground motions.

    There is one row per building, level, floor, damping ratio and period.

    Parameters
    ----------
    store : Store
        Store of the campaign, which determines the columns of the level and of pairs.
    """
    return Table.of_results(with_pair_demand(store, with_level(store, FLOOR_SUITES, 2)), suites)


def status_table(statuses: dict[str, int], remaining: int) -> Table:
    """Return the table of the number of runs by status; its last row, with the status `left`, is
    the number of runs that are not completed.

    Parameters
    ----------
    remaining : int
        Number of runs that are not completed.
    """
    return Table.of(STATUS, [*statuses.items(), ("left", remaining)])


def copied_columns(store: Store, others: Iterable[str]) -> tuple[Column, ...]:
    """Return the column of the event, if the campaign has ground motion fields, and the columns
    that are copied from the inventory.

    Parameters
    ----------
    others : iterable of str
        Names of the preceding columns. An inventory column with one of these names gets the prefix
        `inventory_`.
    """
    columns = [EVENT] if store.events() else []
    used_names, titles = {*others, *names(columns)}, store.inventory_columns()
    # If the fields have sites, the first columns are the nearest site and its distance, which tdint
    # has added to the columns of the inventory.
    has_site_columns = bool(columns) and titles[: len(_SITE_COLUMNS)] == tuple(_SITE_COLUMNS)
    for index, title in enumerate(titles):
        name = title
        while name in used_names:
            name = f"inventory_{name}"
        used_names.add(name)
        meaning = f"column {title} of the inventory, unchanged"
        if has_site_columns and index < len(_SITE_COLUMNS):
            meaning = _SITE_COLUMNS[title]
        columns.append(Column(name, TEXT, name, meaning))
    return tuple(columns)


def copied_cells(store: Store) -> Callable[[int, int], list[str]]:
    """Return a function that returns the cells of the columns of `copied_columns`: the event, and
    the cells of the inventory. Its arguments are the numbers of the building and the sample."""
    events = [cell_text(event) for event in store.events()]

    # The runs of a building are consecutive, so the cells of one building are cached.
    @lru_cache(maxsize=1)
    def inventory_cells(building: int) -> list[str]:
        """Return the formatted cells of the inventory row of a building, by its number."""
        return [cell_text(cell) for cell in store.copied_cells(building)]

    # The sample is the number of the event, from 1. Without events, the slice is empty.
    return lambda building, sample: [*events[sample - 1 : sample], *inventory_cells(building)]


def numeric(store: Store) -> list[bool]:
    """Return a list with True for each copied inventory column that contains numbers and no other
    text. Empty cells are ignored; a column with only empty cells is not numeric."""
    # Each set contains True if the column has a cell with a number, and False if it has a cell with
    # other text.
    answers: list[set[bool]] = [set() for _ in store.inventory_columns()]
    for number in store.buildings():
        for column_answers, text in zip(answers, store.copied_cells(number), strict=False):
            if text:
                column_answers.add(_NUMBER.fullmatch(text) is not None)
    return [column_answers == {True} for column_answers in answers]


def stored_columns(result: Any) -> list[tuple[Column, Any]]:
    """Return the columns of runs.csv, the table of the runs of a campaign, with their cells."""
    with result.store as store:
        return Table.of(*run_table(store)).by_column()
