"""Tables of a campaign, written from its store in batches, so that memory use is limited."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from tdint.analysis.run.demands import DEMANDED, HIDDEN, RUN, RUN_WITH_ERROR
from tdint.analysis.run.outcome import STORY as STORY_QUANTITIES
from tdint.model.definition import parameter_meaning
from tdint.output.tables.responses import STORY_COLUMNS, STORY_ERROR
from tdint.output.tables.spectra import OF_FLOORS, SPECTRUM
from tdint.output.tables.table import (
    DAMPING,
    FLOOR,
    METHOD_SPEC,
    OF_NAMED_RECORD,
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
    harmless,
    names,
)
from tdint.units import SI, OutputUnits, Quantity, suffix

if TYPE_CHECKING:
    from tdint.campaign.fragility.measures import MeasuredRun, RunMeasure
    from tdint.campaign.profiles import FloorSuite, Profile, Ratios, RunFloors
    from tdint.campaign.store import Store

OF_BUILDING = (
    Column("building", "text", "building", "name of the building"),
    *OF_NAMED_RECORD,
    Column("scale", "1", "scale", "scale factor of the ground motion"),
)
SAMPLE = Column(
    "sample",
    "1",
    "sample",
    "number of the random sample from a grid of ground motions, or of the event, from 1; 0 without "
    "samples and events",
)
EVENT = Column("event", "text", "event", "event of a ground motion field")
RUNS = (
    *OF_BUILDING,
    SAMPLE,
    METHOD_SPEC,
    *(Column.of_quantity(one) for one in RUN if one.shown != HIDDEN),
)
"""Columns of runs.csv."""

_WITH_ERROR = tuple(Column.of_quantity(one) for one in RUN_WITH_ERROR)
RUN_ERRORS = error_columns(_WITH_ERROR)
"""Additional columns of a campaign with error estimates."""

STORIES = (*OF_BUILDING, *STORY_COLUMNS)
"""Columns of stories.csv of a campaign."""

LEVEL = Column(
    "level",
    "1",
    "level",
    "value of the intensity measure in SI units; if each ground motion has its own scale factors, "
    "their number, from the smallest",
)
COUNTS = (
    Column(
        "runs",
        "1",
        "runs",
        "number of ground motions; a pair counts as one unless its components count separately",
    ),
    Column(
        "collapsed",
        "1",
        "collapsed",
        "number of ground motions with collapse; they are excluded from the statistics",
    ),
    Column(
        "failed",
        "1",
        "failed",
        "number of ground motions without a result; they are excluded from the statistics",
    ),
)
PROFILES = (
    OF_BUILDING[0],
    Column(
        "scale",
        "1",
        "scale",
        "scale factor of the ground motions; empty if each ground motion has its own factor",
    ),
    Column(
        "quantity",
        "text",
        "quantity",
        "column of stories.csv without its unit: maximum absolute value over time",
    ),
    Column("story", "1", "story", "story (or the floor above), numbered from the ground"),
    Column("unit", "text", "unit", "unit of the quantity"),
    Column(
        "mean",
        "1",
        "mean",
        "mean over the ground motions with a result and without collapse; pair_demand states the "
        "demand of a pair",
    ),
    Column("median", "1", "median", "median over the same ground motions"),
    Column("p16", "1", "p16", "16 % fractile over the same ground motions"),
    Column("p84", "1", "p84", "84 % fractile over the same ground motions"),
    Column("max", "1", "max", "maximum over the same ground motions"),
    *COUNTS,
)
"""Columns of profiles.csv."""

PROFILE_ERRORS = error_columns(PROFILES[5:10])
"""Additional columns of a campaign with error estimates."""

SHOCKS = (
    *OF_BUILDING,
    Column("shock", "1", "shock", "event of the sequence, from 1"),
    Column("start_s", "s", "start", "time of the first sample of the event in the sequence"),
    Column("pga_m_s2", "m/s^2", "pga", "peak ground acceleration of the scaled event"),
    *(Column.of_quantity(one) for one in DEMANDED),
)
"""Columns of shocks.csv: response to each event of a sequence. runs.csv has complete sequences."""

FLOOR_SUITES = (*PROFILES[:2], FLOOR, DAMPING, PERIOD, *OF_FLOORS, *COUNTS)
"""Columns of floor-spectra-mean.csv."""

RATIOS = (
    OF_BUILDING[0],
    Column("baseline", "text", "baseline", "name of the baseline building"),
    PROFILES[1],
    Column(
        "quantity",
        "text",
        lambda one: one.quantity.called or one.quantity.name,
        PROFILES[2].meaning,
    ),
    Column(
        "story",
        "1",
        lambda one: np.array([None, *range(1, one.mean.size)], dtype=object),
        "story (or the floor above); empty for the maximum over the stories",
    ),
    Column(
        "mean_ratio",
        "1",
        "mean",
        "mean over the ground motions divided by the mean of the baseline",
    ),
    Column("median_ratio", "1", "median", "median divided by the median of the baseline"),
    Column("max_ratio", "1", "max", "maximum divided by the maximum of the baseline"),
)
"""Columns of ratios.csv."""


def measures_table(measures: Sequence[RunMeasure], runs: Iterable[MeasuredRun]) -> Table:
    """Return the table that identifies each run and lists its intensities."""
    rows = (
        (run.building, run.record, run.component, run.scale, run.sample, *run.values)
        for run in runs
    )
    return Table.of(measure_columns(measures), rows)


def measure_columns(measures: Sequence[RunMeasure]) -> tuple[Column, ...]:
    """Return the columns of measures.csv."""
    columns = [
        Column(
            f"{measure.column}{suffix(measure.unit)}", measure.unit, measure.column, measure.meaning
        )
        for measure in measures
    ]
    return (*OF_BUILDING, SAMPLE, *columns)


STATUS = (
    Column("status", "text", "status", "status of runs; left: not completed yet"),
    Column("runs", "1", "runs", "number of runs"),
)


_PLACED = {
    "site": "site of the ground motion fields that is nearest to the building",
    "distance_km": "distance between site and building, km",
}
"""Columns that precede the inventory columns if the ground motion fields have sites."""

_ROWS_AT_ONCE = 2048  # number of runs formatted together, which takes some MB

_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][-+]?[0-9]{1,2})?")
"""Numbers as in JSON; for example, 02138 is text."""


def run_columns(store: Store) -> tuple[Column, ...]:
    """Return the columns of runs.csv; varied parameters and inventory columns are the last ones."""
    columns = (*RUNS, *RUN_ERRORS * store.checked, *varied_columns(_swept(store.varied())))
    return (*columns, *carried_columns(store, names(columns)))


def _swept(varied: Sequence[Mapping[str, float]]) -> list[str]:
    return list(dict.fromkeys(name for values in varied for name in values))


def varied_columns(names: Iterable[str]) -> list[Column]:
    """Return the columns of the parameters that differ between buildings."""
    # `story 3.mass_factor` becomes story_3_mass_factor; a key of model files is unchanged.
    return [
        Column(
            name
            if name.startswith(("stories", "record"))
            else name.replace(" ", "_").replace(".", "_"),
            "1",
            name,
            parameter_meaning(name),
        )
        for name in names
    ]


def run_heads(store: Store) -> Callable[[int, int], list[str]]:
    """Return a function that returns building, record and component of a run.

    The arguments of the function are the numbers of the building and the record.
    """
    # The names are formatted once, because there can be millions of runs.
    buildings = {number: cell_text(name) for number, (name, _) in store.buildings().items()}
    records = {number: [*map(cell_text, named[:2])] for number, named in store.records().items()}
    return lambda building, record: [buildings[building], *records[record]]


def run_rows(store: Store) -> Iterator[list[Any]]:
    """Yield the rows of runs.csv in the order of buildings, records, scale factors and samples."""
    varied = store.varied()
    swept = [[values.get(name) for name in _swept(varied)] for values in varied]
    methods = {number: cell_text(method) for number, (_, method) in store.buildings().items()}
    # A row of the store has all error columns, even if no errors were estimated.
    estimated, named, carried = (
        len(RUN_ERRORS) * store.checked,
        run_heads(store),
        carried_cells(store),
    )
    for building, record, scale, sample, dt, status, *rest in store.runs():
        head = [*named(building, record), scale, sample, methods[building], dt, cell_text(status)]
        results, behind = rest[: len(RUNS) - len(head)], rest[len(rest) - len(RUN_ERRORS) :]
        yield (
            head
            + results
            + behind[:estimated]
            + (swept[building] if swept else [])
            + carried(building, sample)
        )


def story_columns(store: Store) -> tuple[Column, ...]:
    """Return the columns of stories.csv of a campaign.

    The column `sample` is included if ground motions were sampled, because two samples can be the
    same ground motion.
    """
    drawn = (SAMPLE,) if store.count("sample > 0") else ()
    return (*OF_BUILDING, *drawn, *STORY_COLUMNS, *STORY_ERROR * store.checked)


def story_rows(store: Store) -> Iterator[list[Any]]:
    """Yield the rows of stories.csv, in the order of runs.csv and from the ground up."""
    drawn, named = store.count("sample > 0") > 0, run_heads(store)
    count = len(STORY_COLUMNS) + len(STORY_ERROR) * store.checked
    for building, record, scale, sample, *rest in store.stories():
        yield [*named(building, record), scale, *((sample,) if drawn else ()), *rest[:count]]


def write_runs(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write runs.csv to a stream."""
    write_rows(run_columns(store), run_rows(store), stream, units)


def write_stories(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write stories.csv to a stream."""
    write_rows(story_columns(store), story_rows(store), stream, units)


def profile_rows(profiles: Iterable[Profile], units: OutputUnits = SI) -> Iterator[list[Any]]:
    """Yield the rows of profiles.csv by building, level and quantity, from the ground up."""
    for profile in profiles:
        counts = (profile.runs, profile.collapsed, profile.failed)
        level = () if math.isnan(profile.level) else (profile.level,)
        demand = (profile.pair_demand,) if profile.pair_demand else ()
        for quantity in STORY_QUANTITIES:
            unit, factor = units.unit(quantity.unit)
            statistics = profile.statistics(quantity)
            errors = profile.errors(quantity)
            # Statistics and errors of the stories; there are no errors if none were estimated.
            columns, behind = (
                (np.array(list(vars(of).values())).T / factor).tolist()
                if of
                else [()] * profile.height.size
                for of in (statistics, errors)
            )
            for story, (cells, off) in enumerate(zip(columns, behind, strict=True), start=1):
                head = (cell_text(profile.building), profile.scale, *level)
                yield [
                    *head,
                    quantity.called or quantity.name,
                    story,
                    unit,
                    *cells,
                    *counts,
                    *off,
                    *demand,
                ]


def _with_level(store: Store, columns: tuple[Column, ...], place: int) -> tuple[Column, ...]:
    """Insert the column LEVEL at index `place` if levels are not scale factors."""
    from tdint.campaign.profiles import has_levels

    return (*columns[:place], *((LEVEL,) if has_levels(store) else ()), *columns[place:])


def with_pair_demand(store: Store, columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return the columns and, if there are pairs, the column that states how they are counted."""

    stated = store.pair_rule().demand_if_pairs
    return (*columns, *(replace(PAIR_DEMAND, value=lambda _: stated),) * bool(stated))


def write_profiles(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write profiles.csv; levels that are not scale factors have a column `level`."""
    from tdint.campaign.profiles import profiles

    columns = [*_with_level(store, PROFILES, 2), *PROFILE_ERRORS * store.checked]
    columns = [*with_pair_demand(store, columns)]
    write_rows(columns, profile_rows(profiles(store), units), stream)


def write_shocks(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write shocks.csv to a stream."""
    named = run_heads(store)
    rows = (
        [*named(building, record), scale, *rest]
        for building, record, scale, _, *rest in store.shocks()
    )
    write_rows(SHOCKS, rows, stream, units)


def profile_table(profile: Profile, names: Sequence[str], units: OutputUnits = SI) -> Table:
    """Return mean and maximum of quantities, with one row per story.

    A quantity that is zero or missing in all stories is omitted.
    """
    columns: list[Column] = [_STORY_OF_PROFILE]
    for quantity in _named(names):
        statistics = profile.statistics(quantity)
        if np.any(np.nan_to_num(statistics.max)):
            columns += [
                Column(
                    f"mean_{quantity.column}",
                    quantity.unit,
                    statistics.mean,
                    f"mean: {quantity.meaning}",
                ),
                Column(
                    f"max_{quantity.column}",
                    quantity.unit,
                    statistics.max,
                    f"maximum: {quantity.meaning}",
                ),
            ]
    return Table.of_results(columns, [profile]).in_units(units)


_STORY_OF_PROFILE = replace(
    PROFILES[3], value=lambda profile: np.arange(1, profile.height.size + 1)
)


def _named(names: Sequence[str]) -> list[Quantity]:
    """Return the quantities with these names, in the order of the names."""
    quantities_by_name = {
        quantity.called or quantity.name: quantity for quantity in STORY_QUANTITIES
    }
    return [quantities_by_name[name] for name in names]


def profile_error_table(profile: Profile, names: Sequence[str]) -> Table:
    """Return the effect of the errors of the runs on means and maxima, in percent.

    Errors of residual drifts are in percent of the peak drifts.
    """
    columns: list[Column] = [_STORY_OF_PROFILE]
    drift = profile.statistics(_named(["peak_drift"])[0])
    for quantity in _named(names):
        statistics, errors = profile.statistics(quantity), profile.errors(quantity)
        if errors is None or not np.any(np.nan_to_num(statistics.max)):
            continue
        # A residual drift can be close to zero, so its error is given relative to the peak drift.
        reference = drift if quantity.name.startswith("residual") else statistics
        for name in ("mean", "max"):
            size = np.where(getattr(reference, name) > 0.0, getattr(reference, name), np.nan)
            percent = [float(f"{value:.2g}") for value in 100.0 * getattr(errors, name) / size]
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
    """Return ratios to a baseline of the maxima over the stories; with `stories`, of each story
    also.
    """
    table = Table.of_results(with_pair_demand(store, _with_level(store, RATIOS, 3)), ratios)
    # The row without a story has the maximum over the stories.
    place = table.columns.index("story")
    return (
        table if stories else replace(table, rows=[row for row in table.rows if row[place] is None])
    )


def run_floor_table(store: Store, floors: Sequence[RunFloors]) -> Table:
    """Return floor spectra of all runs, with one row per run, floor, damping ratio and period."""
    # Two samples can be the same ground motion; their numbers distinguish the rows.
    drawn = store.count("sample > 0") > 0
    columns = (*OF_BUILDING, *((SAMPLE,) if drawn else ()), FLOOR, *SPECTRUM)
    buildings, records = store.buildings(), store.records()
    heads: list[tuple[Cell, ...]] = []
    for run in floors:
        name, component, _ = records[run.run.motion]
        head = (
            buildings[run.building][0],
            name,
            component,
            run.run.scale,
            *((run.run.sample,) if drawn else ()),
        )
        heads += ((*head, of.floor) for of in run.spectra)
    return Table.of_results(columns, [of.spectrum for run in floors for of in run.spectra], heads)


def floor_suite_table(store: Store, suites: Sequence[FloorSuite]) -> Table:
    """Return mean and envelope of floor spectra over the ground motions.

    There is one row per building, level, floor, damping ratio and period.
    """
    return Table.of_results(with_pair_demand(store, _with_level(store, FLOOR_SUITES, 2)), suites)


def write_rows(
    columns: Iterable[Column], rows: Iterable[list[Any]], stream: BinaryIO, units: OutputUnits = SI
) -> None:
    """Write rows in batches.

    Parameters
    ----------
    columns : iterable of Column
        Columns of the table.
    rows : iterable of list
        Rows in SI units; texts were formatted by `cell_text`.
    stream : BinaryIO
        Output.
    units : OutputUnits
        Units of the output; SI by default.
    """
    headed = [units.column(column.name, column.unit) for column in columns]
    stream.write(csv_bytes([[harmless(name) for name, _ in headed]]))
    if units != SI:
        factors = [factor for _, factor in headed]
        rows = (
            [converted(cell, factor) for cell, factor in zip(row, factors, strict=True)]
            for row in rows
        )
    # Rows are formatted in batches, because a campaign may have more rows than fit into memory.
    source = iter(rows)
    while batch := list(islice(source, _ROWS_AT_ONCE)):
        stream.write(csv_bytes([number_text(cell) for cell in row] for row in batch))


def number_text(cell: Any) -> str:
    """Return a number, a formatted text or None as text.

    It is a fast version of `cell_text`, because it is called for millions of cells.
    """
    if type(cell) is float:
        return format(cell + 0.0, ".12g") if cell == cell else ""
    return "" if cell is None else str(cell)


def runs_table(store: Store) -> Table:
    """Return runs.csv of a small campaign as a table."""
    return Table.of(run_columns(store), run_rows(store))


def status_table(statuses: dict[str, int], left: int) -> Table:
    """Return the number of runs of each status and the number of remaining runs."""
    return Table.of(STATUS, [*statuses.items(), ("left", left)])


def carried_columns(store: Store, others: Iterable[str]) -> tuple[Column, ...]:
    """Return the column of the event, if there are fields, and the columns of the inventory.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    others : iterable of str
        Names of the preceding columns. An inventory column with one of these names gets the prefix
        `inventory_`.
    """
    columns = [EVENT] if store.events() else []
    taken, titles = {*others, *names(columns)}, store.inventory_columns()
    # If the fields have sites, tdint has added the first columns.
    placed = _PLACED if columns and titles[: len(_PLACED)] == tuple(_PLACED) else {}
    for place, title in enumerate(titles):
        name = title
        while name in taken:
            name = f"inventory_{name}"
        taken.add(name)
        description = f"column {title} of the inventory, unchanged"
        if place < len(placed):
            description = placed.get(title, description)
        columns.append(Column(name, TEXT, name, description))
    return tuple(columns)


def carried_cells(store: Store) -> Callable[[int, int], list[str]]:
    """Return a function that returns the cells of these columns.

    The arguments of the function are the numbers of the building and the sample.
    """
    events = [cell_text(event) for event in store.events()]

    # The runs of a building are consecutive, so the cells of one building are cached.
    @lru_cache(maxsize=1)
    def of_building(building: int) -> list[str]:
        return [cell_text(cell) for cell in store.copied_cells(building)]

    return lambda building, sample: [*events[sample - 1 : sample], *of_building(building)]


def numeric(store: Store) -> list[bool]:
    """Return, for each inventory column, True if it contains only numbers and empty cells."""
    matches: list[set[bool]] = [set() for _ in store.inventory_columns()]
    for number in store.buildings():
        for column, text in zip(matches, store.copied_cells(number), strict=False):
            if text:
                column.add(_NUMBER.fullmatch(text) is not None)
    return [column == {True} for column in matches]
