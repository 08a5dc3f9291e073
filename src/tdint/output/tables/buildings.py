"""Tables of buildings: runs and their histories, cyclic tests, modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from tdint.output.tables.columns import buildings as columns
from tdint.output.tables.table import Table, rows_of
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import History, StoryErrors, StoryPeaks
    from tdint.analysis.static.cyclic import CyclicTest
    from tdint.model.modes import Modes

Array = NDArray[np.float64]

_ROWS_AT_ONCE = 256


def story_table(stories: StoryPeaks, errors: StoryErrors | None = None) -> Table:
    """One row per story, from the ground up; with errors a column `<name>_error` for each peak, after all peaks."""
    rows = rows_of(columns.STORY, stories)
    if errors is None:
        return Table.of(columns.STORY, rows)
    both = [peaks + of for peaks, of in zip(rows, rows_of(columns.STORY_ERROR, errors), strict=True)]
    return Table.of((*columns.STORY, *columns.STORY_ERROR), both)


def cyclic_table(test: CyclicTest) -> Table:
    """One row per point of the path; row 0 is the start at rest."""
    return Table.of_results(columns.CYCLIC, [test])


def mode_table(modes: Modes, damping: Array | None) -> Table:
    """One row per mode, longest period first; empty cells for damping ratios (shape (n,)) that are None."""
    ratios = np.full_like(modes.omega, np.nan) if damping is None else damping
    return Table.of_results((*columns.MODE, columns.mode_damping(ratios), *columns.MODE_END), [modes])


def history_columns(stories: int) -> tuple[str, ...]:
    """Columns of a history."""
    places = range(1, stories + 1)
    return (
        *(column.name for column in columns.HISTORY_START),
        *(f"floor_{i}_{column.name}" for i in places for column in columns.HISTORY_FLOOR),
        *(f"story_{i}_{column.name}" for i in places for column in columns.HISTORY_STORY),
        *(column.name for column in columns.HISTORY_ENERGY),
    )


def write_history(history: History, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write a history as CSV, one row per step; some hundred rows are held as text at a time."""
    header = [units.column(name) for name in history_columns(history.displacement.shape[1])]
    stream.write((",".join(name for name, _ in header) + "\n").encode())
    factors = None if units == SI else np.array([factor for _, factor in header])
    line = ",".join(["%.12g"] * len(header)) + "\n"
    start, floors, springs, energies = (
        [column.of(history) for column in group]
        for group in (
            columns.HISTORY_START, columns.HISTORY_FLOOR, columns.HISTORY_STORY, columns.HISTORY_ENERGY,
        )
    )  # fmt: skip
    for first in range(0, len(history.time), _ROWS_AT_ONCE):
        part = slice(first, first + _ROWS_AT_ONCE)
        groups = [np.stack([values[part] for values in group], axis=2) for group in (floors, springs)]
        table = np.column_stack(
            [
                *(values[part] for values in start),
                *(group.reshape(len(group), -1) for group in groups),
                *(values[part] for values in energies),
            ]
        )
        if factors is not None:
            table /= factors
        table += 0.0  # zero has no sign
        text = line * len(table) % tuple(table.ravel().tolist())
        stream.write((text.replace("nan", "") if np.isnan(table).any() else text).encode("ascii"))
