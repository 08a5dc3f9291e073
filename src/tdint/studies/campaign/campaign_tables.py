"""Tables of a campaign: runs, stories, profiles and floor spectra. They are read from the store and
written in batches, so that memory use is limited."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import islice
from types import SimpleNamespace
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from tdint.output.tables.runs import BUILDING_COLUMNS, RUN_ERRORS, RUNS, SAMPLE, varied_columns
from tdint.output.tables.spectra import SPECTRUM
from tdint.output.tables.table import (
    DAMPING,
    FLOOR,
    PAIR_DEMAND,
    PERIOD,
    TEXT,
    Cell,
    Column,
    Table,
    converted,
    csv_bytes,
    error_columns,
    names,
    placeholder,
    rows_of,
)
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.studies.campaign.story_profiles import (
    FloorSuite,
    Profile,
    Ratios,
    SpectraOfRuns,
    SuiteLevel,
    level_measure,
    profiles,
)
from tdint.studies.columns import declared
from tdint.studies.fragility.measures import RunMeasure
from tdint.studies.store import schema
from tdint.studies.store.result_store import Store
from tdint.units import SI, OutputUnits, Quantity, suffix

EVENT = Column.named("event", "event of a ground motion field", TEXT)


(LEVEL,) = declared("campaign.level")
_level: SuiteLevel = placeholder()
COUNTS = declared("campaign.counts", _level.counts, runs=_level.counts.motions)

PROFILES = (BUILDING_COLUMNS[0], *declared("campaign.profiles"), *COUNTS)
"""Columns of profiles.csv."""

PROFILE_ERRORS = tuple(
    column._replace(value=column.name) for column in error_columns(PROFILES[5:10])
)
"""Additional columns of a campaign with error estimates."""

_suite: FloorSuite = placeholder()
FLOOR_SUITES = (
    *PROFILES[:2],
    FLOOR,
    DAMPING,
    PERIOD,
    *declared("campaign.floors", mean_psa_m_s2=_suite.mean, max_psa_m_s2=_suite.envelope),
    *COUNTS,
)
"""Columns of floor-spectra-mean.csv."""

_item: Ratios = placeholder()
RATIOS = (
    BUILDING_COLUMNS[0]._replace(value=_item.compared.building),
    Column("baseline", TEXT, _item.base.building, "name of the baseline building"),
    PROFILES[1],
    Column(
        "quantity",
        "text",
        "quantity",
        f"{PROFILES[2].meaning}; base_shear is the restoring force of the first story",
    ),
    *declared(
        "campaign.ratios",
        _item.compared.counts,
        mean_ratio=_item.ratios.mean,
        median_ratio=_item.ratios.median,
        max_ratio=_item.ratios.max,
        motions=_item.ratios.motions,
        baseline_collapsed=_item.base.counts.collapsed,
        baseline_failed=_item.base.counts.failed,
        story=lambda item: np.array([None, *range(1, item.ratios.mean.size)], dtype=object),
    ),
)
"""Columns of ratios.csv."""


def variant_columns(*, has_levels: bool, by_length: bool) -> list[Column]:
    """Return the columns of the table of a report with a row for each building."""
    drift, drift_unit = ("drift", "m") if by_length else ("drift_ratio", "1")
    end = "_m" if by_length else ""
    profile: Profile = placeholder().profile
    return [
        Column("building", TEXT, profile.building, ""),
        *([Column("level", TEXT, profile.level_text, "")] if has_levels else []),
        Column.named("collapses", "", TEXT),
        Column("motions", "1", profile.counts.completed, ""),
        Column(f"mean_{drift}{end}", drift_unit, "mean_drift", ""),
        Column(f"largest_{drift}{end}", drift_unit, "largest_drift", ""),
        *(
            Column(f"{name}_{drift}{end}", drift_unit, name, "")
            for name in ("median", "p16", "p84")
        ),
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

_NUMBER = r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][-+]?[0-9]{1,2})?"
"""Numbers as in JSON; for example, 02138 is text."""


class StoreTable(NamedTuple):
    """Table of a campaign. The rows are read from the store when they are written, because there
    can be millions of runs. Numbers are in SI units."""

    columns: Sequence[Column]
    rows: Iterable[Sequence[Any]]

    @classmethod
    def of_results(cls, columns: Sequence[Column], results: Iterable[Any]) -> StoreTable:
        """Return a table with the rows of results, for which the columns are evaluated."""
        return cls(columns, (row for result in results for row in rows_of(columns, result)))

    def write(self, stream: BinaryIO, units: OutputUnits = SI) -> None:
        """Write the table as CSV to a stream, in output units."""
        column_names, factors = zip(
            *(units.column(column.name, column.unit) for column in self.columns), strict=True
        )
        stream.write(csv_bytes([column_names]))
        rows = iter(self.rows)
        if units != SI:
            rows = (tuple(map(converted, row, factors)) for row in rows)
        # Rows are formatted in batches, because a campaign may have more rows than fit into memory.
        while batch := list(islice(rows, _ROWS_AT_ONCE)):
            stream.write(csv_bytes(batch))


def run_table(store: Store) -> StoreTable:
    """Return runs.csv, the table of all runs of a campaign, in the order of buildings, records,
    scale factors and samples.

    The last columns are the parameters of a sweep, the event and the columns of the inventory, if
    the campaign has them.
    """
    varied, cells_of = store.varied(), copied_cells(store)
    units = store.varied_units()
    parameters = {name: units.get(name, "") for values in varied for name in values}
    shown = (*RUNS, *(RUN_ERRORS if store.checked else ()))
    columns = (*shown, *varied_columns(parameters))
    rows = (
        [*cells, *(varied[building].get(name) for name in parameters), *cells_of(building, sample)]
        for building, sample, *cells in store.shown(schema.RUNS, shown[4:])
    )
    return StoreTable((*columns, *copied_columns(store, names(columns))), rows)


def part_table(store: Store, table: schema.RowTable) -> StoreTable:
    """Return stories.csv, elements.csv, attachments.csv or links.csv, the results of these parts of
    the buildings in all runs of a campaign; or shocks.csv, the response to each event of a
    sequence. The rows are in the order of runs.csv and of the model file.

    The column `sample` is included if ground motions were sampled, because two samples can be the
    same ground motion.
    """
    errors = table.errors if store.checked else ()
    columns = ((SAMPLE,) if store.has_samples else ()) + table.shown + errors
    rows = (cells for _, _, *cells in store.shown(table, columns))
    return StoreTable((*BUILDING_COLUMNS, *columns), rows)


def _profile_rows(profiles: Iterable[Profile], units: OutputUnits) -> Iterator[SimpleNamespace]:
    """Yield the results of profiles.csv: statistics of the peak responses over the ground motions,
    one per building, intensity level and quantity, with an array over the stories."""
    for profile in profiles:
        for quantity in STORY_QUANTITIES:
            unit, factor = units.unit(quantity.unit)
            statistics, errors = profile.statistics(quantity), profile.errors(quantity)
            values = {
                name: of_stories / factor for name, of_stories in statistics._asdict().items()
            }
            for name, of_stories in errors._asdict().items() if errors else ():
                values[f"{name}_error"] = of_stories / factor
            yield SimpleNamespace(
                building=profile.building,
                scale=profile.scale,
                level=profile.level,
                counts=profile.counts,
                quantity=quantity.called or quantity.name,
                story=np.arange(1, profile.height.size + 1),
                unit=unit,
                **values,
            )


def suite_columns(
    store: Store, columns: Sequence[Column], level_at: int | None = None, *, of_pairs: bool = True
) -> tuple[Column, ...]:
    """Return the columns of a table over ground motions. The column of the intensity level is
    inserted before the column `level_at`, if levels are not scale factors, which have their own
    column; if the campaign has pairs, the last column states the demand of a pair."""
    pair_demand = of_pairs and store.pair_rule().demand_if_pairs
    has_level = level_at is not None and level_measure(store) is not None
    return (
        *columns[:level_at],
        *((LEVEL,) if has_level else ()),
        *(columns[level_at:] if level_at is not None else ()),
        *((PAIR_DEMAND._replace(value=lambda _: pair_demand),) if pair_demand else ()),
    )


def profiles_table(store: Store, units: OutputUnits) -> StoreTable:
    """Return profiles.csv, the statistics of peak responses over the ground motions, in the units
    of its rows."""
    columns = (*PROFILES, *(PROFILE_ERRORS if store.checked else ()))
    return StoreTable.of_results(
        suite_columns(store, columns, 2), _profile_rows(profiles(store), units)
    )


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
    table = Table.of_results(suite_columns(store, RATIOS, 3), ratios)
    # Rows without any ratio are omitted, except the first of a building at a level: its counts.
    start, end = (table.columns.index(name) for name in ("quantity", "mean_ratio"))
    kept: dict[tuple[Cell, ...], list[tuple[Cell, ...]]] = {}
    for row in table.rows:
        rows = kept.setdefault(tuple(map(str, row[:start])), [])
        if not rows or any(cell == cell and cell is not None for cell in row[end : end + 3]):
            rows.append(row)
    table = table._replace(rows=[row for rows in kept.values() for row in rows])
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
    has_samples = store.has_samples
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
    return Table.of_results(suite_columns(store, FLOOR_SUITES, 2), suites)


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
    # The runs of a building are consecutive, so the cells of one building are cached.
    events, inventory_cells = store.events(), lru_cache(maxsize=1)(store.copied_cells)
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
                column_answers.add(re.fullmatch(_NUMBER, text) is not None)
    return [column_answers == {True} for column_answers in answers]


def stored_columns(result: Any) -> list[tuple[Column, Any]]:
    """Return the columns of runs.csv, the table of the runs of a campaign, with their cells."""
    with result.store as store:
        return Table.of(*run_table(store)).by_column()
