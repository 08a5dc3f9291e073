"""The tables of a campaign, written from its store row by row: however many there are, few are held
at a time."""

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
from tdint.output.tables.responses import STORY, STORY_ERROR
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
    Column("scale", "1", "scale", "factor on the ground acceleration"),
)
SAMPLE = Column(
    "sample",
    "1",
    "sample",
    "number of the draw from a grid of ground motions, or of the event, from 1; 0 where neither is",
)
EVENT = Column("event", "text", "event", "event of a ground motion field")
RUNS = (
    *OF_BUILDING,
    SAMPLE,
    METHOD_SPEC,
    *(Column.of_quantity(one) for one in RUN if one.shown != HIDDEN),
)
"""Of runs.csv."""

_WITH_ERROR = tuple(Column.of_quantity(one) for one in RUN_WITH_ERROR)
RUN_ERRORS = error_columns(_WITH_ERROR)
"""Behind them, of a campaign that has estimated them."""

STORIES = (*OF_BUILDING, *STORY)
"""Of stories.csv of a campaign."""

LEVEL = Column(
    "level",
    "1",
    "level",
    "value of the intensity measure, SI units, or number of each motion's own factors, from the "
    "smallest",
)
COUNTS = (
    Column("runs", "1", "runs", "motions; a pair is one unless its components count separately"),
    Column(
        "collapsed",
        "1",
        "collapsed",
        "motions under which the building collapsed: in no number before",
    ),
    Column("failed", "1", "failed", "motions whose run has no result: in no number before"),
)
PROFILES = (
    OF_BUILDING[0],
    Column(
        "scale",
        "1",
        "scale",
        "factor on the ground acceleration; empty where each motion has its own",
    ),
    Column(
        "quantity",
        "text",
        "quantity",
        "column of stories.csv without its unit: largest absolute values over time",
    ),
    Column("story", "1", "story", "story, or the floor above it, from 1 at the ground"),
    Column("unit", "text", "unit", "unit of the quantity"),
    Column(
        "mean",
        "1",
        "mean",
        "over the motions that came to their end; the demand of a pair is the one in pair_demand",
    ),
    Column("median", "1", "median", "over the same motions"),
    Column("p16", "1", "p16", "value that 16 % of them do not exceed"),
    Column("p84", "1", "p84", "value that 84 % of them do not exceed"),
    Column("max", "1", "max", "the largest of them"),
    *COUNTS,
)
"""Of profiles.csv."""

PROFILE_ERRORS = error_columns(PROFILES[5:10])
"""Behind them, of a campaign that has estimated errors."""

SHOCKS = (
    *OF_BUILDING,
    Column("shock", "1", "shock", "shock of the sequence, from 1"),
    Column("start_s", "s", "start", "time of its first sample in the sequence"),
    Column("pga_m_s2", "m/s^2", "pga", "peak ground acceleration of the shock, scaled"),
    *(Column.of_quantity(one) for one in DEMANDED),
)
"""Of shocks.csv: what each shock of a sequence did; runs.csv has the sequences as a whole."""

FLOOR_SUITES = (*PROFILES[:2], FLOOR, DAMPING, PERIOD, *OF_FLOORS, *COUNTS)
"""Of floor-spectra-mean.csv."""

RATIOS = (
    OF_BUILDING[0],
    Column("baseline", "text", "baseline", "the building that it is compared with"),
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
        "story, or the floor above it; empty for the largest of all stories",
    ),
    Column("mean_ratio", "1", "mean", "mean over the motions, over that of the baseline"),
    Column("median_ratio", "1", "median", "the same of the median"),
    Column("max_ratio", "1", "max", "the same of the largest of any motion"),
)
"""Of ratios.csv."""


def measures_table(measures: Sequence[RunMeasure], runs: Iterable[MeasuredRun]) -> Table:
    """What tells each run, and its intensities."""
    rows = (
        (run.building, run.record, run.component, run.scale, run.sample, *run.values)
        for run in runs
    )
    return Table.of(measure_columns(measures), rows)


def measure_columns(measures: Sequence[RunMeasure]) -> tuple[Column, ...]:
    """Of measures.csv."""
    columns = [
        Column(
            f"{measure.column}{suffix(measure.unit)}", measure.unit, measure.column, measure.meaning
        )
        for measure in measures
    ]
    return (*OF_BUILDING, SAMPLE, *columns)


STATUS = (
    Column("status", "text", "status", "how runs ended; left: not done yet"),
    Column("runs", "1", "runs", "how many"),
)


_PLACED = {
    "site": "site of the fields whose motions the building has: the nearest one",
    "distance_km": "its distance from the building, km",
}
"""Columns before those of an inventory, of fields with places."""

_ROWS_AT_ONCE = 2048  # of runs, formatted together: some MB

_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][-+]?[0-9]{1,2})?")
"""As JSON writes numbers: 02138 is a word."""


def run_columns(store: Store) -> tuple[Column, ...]:
    """Of runs.csv of a campaign; last come what a sweep varied and the columns of an inventory."""
    columns = (*RUNS, *RUN_ERRORS * store.checked, *varied_columns(_swept(store.varied())))
    return (*columns, *carried_columns(store, names(columns)))


def _swept(varied: Sequence[Mapping[str, float]]) -> list[str]:
    return list(dict.fromkeys(name for values in varied for name in values))


def varied_columns(names: Iterable[str]) -> list[Column]:
    """Of what was varied from building to building, by name."""
    # `story 3.mass_factor` is story_3_mass_factor; a key of model files is itself.
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
    """What names a run, by the numbers of its building and record: building, record and
    component."""
    # Once for each of them and not for each run, of which there may be millions.
    buildings = {number: cell_text(name) for number, (name, _) in store.buildings().items()}
    records = {number: [*map(cell_text, named[:2])] for number, named in store.records().items()}
    return lambda building, record: [buildings[building], *records[record]]


def run_rows(store: Store) -> Iterator[list[Any]]:
    """The rows of runs.csv, in the order of buildings, records, scales and draws."""
    varied = store.varied()
    swept = [[values.get(name) for name in _swept(varied)] for values in varied]
    methods = {number: cell_text(method) for number, (_, method) in store.buildings().items()}
    # A row of the store has room for all errors, also where none were estimated.
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
    """Of stories.csv of a campaign; with `sample` where motions were drawn, for two draws may be
    the same motion."""
    drawn = (SAMPLE,) if store.count("sample > 0") else ()
    return (*OF_BUILDING, *drawn, *STORY, *STORY_ERROR * store.checked)


def story_rows(store: Store) -> Iterator[list[Any]]:
    """The rows of stories.csv, in the order of runs.csv and from the ground up."""
    drawn, named = store.count("sample > 0") > 0, run_heads(store)
    count = len(STORY) + len(STORY_ERROR) * store.checked
    for building, record, scale, sample, *rest in store.stories():
        yield [*named(building, record), scale, *((sample,) if drawn else ()), *rest[:count]]


def write_runs(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write runs.csv."""
    write_rows(run_columns(store), run_rows(store), stream, units)


def write_stories(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write stories.csv."""
    write_rows(story_columns(store), story_rows(store), stream, units)


def profile_rows(profiles: Iterable[Profile], units: OutputUnits = SI) -> Iterator[list[Any]]:
    """The rows of profiles.csv: of each building and level the quantities of its stories, from the
    ground up."""
    for profile in profiles:
        counts = (profile.runs, profile.collapsed, profile.failed)
        level = () if math.isnan(profile.level) else (profile.level,)
        demand = (profile.pair_demand,) if profile.pair_demand else ()
        for quantity in STORY_QUANTITIES:
            unit, factor = units.unit(quantity.unit)
            statistics = profile.statistics(quantity)
            errors = profile.errors(quantity)
            # Statistics of their stories; a campaign without errors has nothing behind them.
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
    """The columns; where a level is more than a factor, it has one at this place."""
    from tdint.campaign.profiles import has_levels

    return (*columns[:place], *((LEVEL,) if has_levels(store) else ()), *columns[place:])


def with_pair_demand(store: Store, columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return the columns and, if there are pairs, the one that states how they count."""

    stated = store.pair_rule().stated
    return (*columns, *(replace(PAIR_DEMAND, value=lambda _: stated),) * bool(stated))


def write_profiles(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write profiles.csv; with a column `level` where a level is more than a factor."""
    from tdint.campaign.profiles import profiles

    columns = [*_with_level(store, PROFILES, 2), *PROFILE_ERRORS * store.checked]
    columns = [*with_pair_demand(store, columns)]
    write_rows(columns, profile_rows(profiles(store), units), stream)


def write_shocks(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write shocks.csv."""
    named = run_heads(store)
    rows = (
        [*named(building, record), scale, *rest]
        for building, record, scale, _, *rest in store.shocks()
    )
    write_rows(SHOCKS, rows, stream, units)


def profile_table(profile: Profile, names: Sequence[str], units: OutputUnits = SI) -> Table:
    """Mean and largest of some quantities side by side, a row per story; a quantity that is nowhere
    is left out."""
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
                    f"largest: {quantity.meaning}",
                ),
            ]
    return Table.of_results(columns, [profile]).in_units(units)


_STORY_OF_PROFILE = replace(
    PROFILES[3], value=lambda profile: np.arange(1, profile.height.size + 1)
)


def _named(names: Sequence[str]) -> list[Quantity]:
    """The quantities of these names, in their order."""
    quantities_by_name = {
        quantity.called or quantity.name: quantity for quantity in STORY_QUANTITIES
    }
    return [quantities_by_name[name] for name in names]


def profile_error_table(profile: Profile, names: Sequence[str]) -> Table:
    """By how many percent the errors of the runs may change means and largest values; of residual
    drifts in percent of the peak drifts."""
    columns: list[Column] = [_STORY_OF_PROFILE]
    drift = profile.statistics(_named(["peak_drift"])[0])
    for quantity in _named(names):
        statistics, errors = profile.statistics(quantity), profile.errors(quantity)
        if errors is None or not np.any(np.nan_to_num(statistics.max)):
            continue
        # A residual drift may be next to nothing, and its error a large part of that.
        over = drift if quantity.name.startswith("residual") else statistics
        for name in ("mean", "max"):
            size = np.where(getattr(over, name) > 0.0, getattr(over, name), np.nan)
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
    """Buildings over a baseline: of the largest value of all stories, and with `stories` of each
    story, too."""
    table = Table.of_results(with_pair_demand(store, _with_level(store, RATIOS, 3)), ratios)
    # The largest of all stories stands in the row without a story.
    place = table.columns.index("story")
    return (
        table if stories else replace(table, rows=[row for row in table.rows if row[place] is None])
    )


def run_floor_table(store: Store, floors: Sequence[RunFloors]) -> Table:
    """The spectra of the floors of every run: a row per run, floor, damping ratio and period."""
    # Two draws may be the same motion, so that their number tells rows apart.
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
    """Mean and envelope of them over the motions: a row per building, level, floor, damping ratio
    and period."""
    return Table.of_results(with_pair_demand(store, _with_level(store, FLOOR_SUITES, 2)), suites)


def write_rows(
    columns: Iterable[Column], rows: Iterable[list[Any]], stream: BinaryIO, units: OutputUnits = SI
) -> None:
    """Write rows whose texts are as they shall be (`cell_text`), a few thousand at a time."""
    headed = [units.column(column.name, column.unit) for column in columns]
    stream.write(csv_bytes([[harmless(name) for name, _ in headed]]))
    if units != SI:
        factors = [factor for _, factor in headed]
        rows = (
            [converted(cell, factor) for cell, factor in zip(row, factors, strict=True)]
            for row in rows
        )
    # Formatted a batch at a time: a campaign may have more rows than memory holds.
    source = iter(rows)
    while batch := list(islice(source, _ROWS_AT_ONCE)):
        stream.write(csv_bytes([number_text(cell) for cell in row] for row in batch))


def number_text(cell: Any) -> str:
    """`cell_text` of a number, a text that has gone through it, or nothing; it is called for every
    cell of millions."""
    if type(cell) is float:
        return format(cell + 0.0, ".12g") if cell == cell else ""
    return "" if cell is None else str(cell)


def runs_table(store: Store) -> Table:
    """runs.csv as a table, for a small campaign."""
    return Table.of(run_columns(store), run_rows(store))


def status_table(statuses: dict[str, int], left: int) -> Table:
    """How many runs ended how, and how many are left."""
    return Table.of(STATUS, [*statuses.items(), ("left", left)])


def carried_columns(store: Store, others: Iterable[str]) -> tuple[Column, ...]:
    """The event, where there are fields, and the columns of an inventory, which stand behind others
    of these names; one that is among them gets `inventory_` before its own."""
    columns = [EVENT] if store.events() else []
    taken, titles = {*others, *names(columns)}, store.inventory_columns()
    # Of fields with places the first columns are ours, and say what they mean.
    placed = _PLACED if columns and titles[: len(_PLACED)] == tuple(_PLACED) else {}
    for place, title in enumerate(titles):
        name = title
        while name in taken:
            name = f"inventory_{name}"
        taken.add(name)
        told = f"column {title} of the inventory, as it is written there"
        columns.append(
            Column(name, TEXT, name, placed.get(title, told) if place < len(placed) else told)
        )
    return tuple(columns)


def carried_cells(store: Store) -> Callable[[int, int], list[str]]:
    """What stands in these columns, by a building's number and the draw's; it is asked building by
    building."""
    events = [cell_text(event) for event in store.events()]

    @lru_cache(
        maxsize=1
    )  # one building's cells serve all of its runs, which come one after the other
    def of_building(building: int) -> list[str]:
        return [cell_text(cell) for cell in store.carried(building)]

    return lambda building, sample: [*events[sample - 1 : sample], *of_building(building)]


def numeric(store: Store) -> list[bool]:
    """Of each column of the inventory whether all that stands there are numbers, empty cells
    aside."""
    said: list[set[bool]] = [set() for _ in store.inventory_columns()]
    for number in store.buildings():
        for kinds, text in zip(said, store.carried(number), strict=False):
            if text:
                kinds.add(_NUMBER.fullmatch(text) is not None)
    return [kinds == {True} for kinds in said]
