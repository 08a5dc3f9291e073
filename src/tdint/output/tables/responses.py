"""Tables of runs: stories, shocks, histories."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from tdint.analysis.run.outcome import ENERGY_TERMS, ErrorHistory, History
from tdint.analysis.run.outcome import STORY as STORY_QUANTITIES
from tdint.output.tables.table import (
    Cell,
    Column,
    Table,
    describe,
    error_columns,
    numbered,
    rows_of,
)
from tdint.units import SI, OutputUnits, quantities

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import Response, StoryErrors, StoryPeaks

STORY = (
    Column(
        "story", "1", numbered("peak_drift"), "story, or the floor above it, from 1 at the ground"
    ),
    Column("height_m", "m", "height", "story height"),
    *(Column.of_quantity(quantity) for quantity in STORY_QUANTITIES if "table" in quantity.shown),
)
STORY_ERROR = error_columns(STORY[2:])
"""Behind them, of a run whose errors are told."""

_ALL = "all"
SHOCK = Column(
    "shock", "text", "shock", f"shock of a sequence, from 1; {_ALL}: over the whole sequence"
)

HISTORY_START, HISTORY_FLOOR, HISTORY_STORY = (
    tuple(
        Column.of_quantity(quantity)
        for quantity in quantities(History)
        if quantity.shown == (place,)
    )
    for place in ("ground", "floor", "story")
)
HISTORY_ENERGY = (
    *(
        Column(f"energy_{name}_J", "J", f"energy.{name}", meaning)
        for name, meaning in ENERGY_TERMS.items()
    ),
    Column(
        "energy_error", "1", "energy.error", "imbalance over the largest input energy of the run"
    ),
)

HISTORY_FLOOR_ERROR, HISTORY_STORY_ERROR = (
    tuple(
        Column(
            f"{quantity.column}_error", quantity.unit, f"error.{quantity.name}", quantity.meaning
        )
        for quantity in quantities(ErrorHistory)
        if quantity.shown == (place,)
    )
    for place in ("floor", "story")
)
"""Behind all others, of a run whose errors are told there, too."""

_ROWS_AT_ONCE = 256  # of a history, formatted together: 1 MB for a hundred columns


def story_table(stories: StoryPeaks, errors: StoryErrors | None = None) -> Table:
    """One row per story, from the ground up; with errors a column `<name>_error` for each peak,
    after all peaks."""
    told = [
        (columns, values)
        for columns, values in ((STORY, stories), (STORY_ERROR, errors))
        if values is not None
    ]
    rows = zip(*(rows_of(columns, values) for columns, values in told), strict=True)
    return Table.of(
        [column for columns, _ in told for column in columns],
        [tuple(chain.from_iterable(row)) for row in rows],
    )


def response_table(response: Response) -> Table:
    """`story_table` of a run; of a sequence once for each shock and, last, for all, the shock in
    the first column."""
    whole = story_table(response.stories, response.check.errors if response.check else None)
    if not response.events:
        return whole
    rows: list[tuple[Cell, ...]] = []
    for number, shock in enumerate(response.events, start=1):
        of_shock = story_table(shock.stories, shock.errors)
        # A shock at whose time another run had ended has no errors.
        empty = (None,) * (len(whole.columns) - len(of_shock.columns))
        rows += [(str(number), *row, *empty) for row in of_shock.rows]
    rows += [(_ALL, *row) for row in whole.rows]
    return Table((SHOCK.name, *whole.columns), rows, describe([SHOCK]) | whole.meanings)


def history_groups(error: bool) -> tuple[tuple[str, tuple[Column, ...]], ...]:
    """The columns of a history by what each of them is there for: every floor, every story, or
    nothing."""
    errors = (("floor", HISTORY_FLOOR_ERROR), ("story", HISTORY_STORY_ERROR)) if error else ()
    return (
        ("", HISTORY_START),
        ("floor", HISTORY_FLOOR),
        ("story", HISTORY_STORY),
        ("", HISTORY_ENERGY),
        *errors,
    )


def history_columns(stories: int, error: bool = False) -> tuple[Column, ...]:
    """Columns of a history; at the end those of its error, if it has quantity."""
    columns_of_history: list[Column] = []
    for place, columns in history_groups(error):
        heads = [f"{place}_{i}_" for i in range(1, stories + 1)] if place else [""]
        columns_of_history += (
            replace(column, name=head + column.name) for head in heads for column in columns
        )
    return tuple(columns_of_history)


def write_pieces(pieces: Iterable[History], stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write a history that comes in pieces as `write_history` writes it whole."""
    for number, history in enumerate(pieces):
        write_history(history, stream, units, header=number == 0)


def write_history(
    history: History, stream: BinaryIO, units: OutputUnits = SI, *, header: bool = True
) -> None:
    """Write a history as CSV, quantity row per step; some hundred rows are held as text at a
    time."""
    error = history.error is not None
    columns = [
        units.column(column.name, column.unit)
        for column in history_columns(history.displacement.shape[1], error)
    ]
    if header:
        stream.write((",".join(name for name, _ in columns) + "\n").encode())
    factors = None if units == SI else np.array([factor for _, factor in columns])
    line = ",".join(["%.12g"] * len(columns)) + "\n"
    groups = [[column.of(history) for column in group] for _, group in history_groups(error)]
    for first in range(0, len(history.time), _ROWS_AT_ONCE):
        chunk = slice(first, first + _ROWS_AT_ONCE)
        blocks = (np.stack([values[chunk] for values in group], axis=-1) for group in groups)
        table = np.hstack([block.reshape(len(block), -1) for block in blocks])
        if factors is not None:
            table /= factors
        table += 0.0  # zero has no sign
        text = line * len(table) % tuple(table.ravel().tolist())
        stream.write((text.replace("nan", "") if np.isnan(table).any() else text).encode("ascii"))
