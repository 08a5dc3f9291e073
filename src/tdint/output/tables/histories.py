"""Columns of response histories, and their CSV files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import BinaryIO, NamedTuple

import numpy as np

from tdint.output.tables.columns import declared
from tdint.output.tables.devices import history_groups as device_groups
from tdint.output.tables.table import Column, placeholder
from tdint.response.runs.energy import ENERGY_TERMS
from tdint.response.runs.history import DeviceHistory, ErrorHistory, History
from tdint.units import SI, OutputUnits, quantities

ELEMENT_FORCE = Column("force_N", "N", "element_force", "force of the element")
"""Column of each element in a response history; the story and the name of the element precede the
name of the column."""

HISTORY_START, HISTORY_FLOOR, HISTORY_STORY = (
    tuple(
        Column.of_quantity(quantity)
        for quantity in quantities(History)
        if quantity.shown == (location,)
    )
    for location in ("ground", "floor", "story")
)
_history: History = placeholder()
HISTORY_ENERGY = (
    *(
        Column(f"energy_{name}_J", "J", getattr(_history.energy, name), meaning)
        for name, meaning in ENERGY_TERMS.items()
    ),
    *declared("histories.history_energy", energy_error=_history.energy.error),
)

HISTORY_FLOOR_ERROR, HISTORY_STORY_ERROR = (
    tuple(
        Column(
            f"{quantity.column}_error",
            quantity.unit,
            getattr(_history.error, quantity.name),
            quantity.meaning,
        )
        for quantity in quantities(ErrorHistory)
        if quantity.shown == (location,)
    )
    for location in ("floor", "story")
)
"""Last columns of a response history with error estimates."""

_ROWS_AT_ONCE = 256  # rows formatted together, which needs 1 MB for a hundred columns


class HistoryLayout(NamedTuple):
    """Columns of the CSV file of a response history.

    Attributes
    ----------
    error : bool
        True to add the columns of the estimated errors at the end.
    elements : sequence of str
        Labels of the elements of stories with several elements (`History.element_labels`).
    devices : DeviceHistory | None
        Attachments and links of the history.
    rows : sequence of str
        Names of rows that are not floors, which have the columns of floors only.
    """

    stories: int
    error: bool = False
    elements: Sequence[str] = ()
    devices: DeviceHistory | None = None
    rows: Sequence[str] = ()

    @classmethod
    def of(cls, history: History) -> HistoryLayout:
        """Return the columns of a response history."""
        stories, error = history.displacement.shape[1], history.error is not None
        return cls(stories, error, history.element_labels, history.devices, history.rows)

    @property
    def groups(self) -> tuple[tuple[Sequence[str], tuple[Column, ...]], ...]:
        """Columns in groups: the names that precede the columns of a group, and the columns, which
        are repeated for each name (floor, story, element, attachment, link).

        The columns of time, ground and energies have an empty name.
        """
        stories, error, elements, devices, rows = self
        numbers = range(1, 1 if rows else stories + 1)
        floors, story_names = (
            tuple(f"{location}_{i}" for i in numbers) for location in ("floor", "story")
        )
        floors = (*floors, *rows)
        errors = (floors, HISTORY_FLOOR_ERROR), (story_names, HISTORY_STORY_ERROR)
        groups = (
            (("",), HISTORY_START),
            (floors, HISTORY_FLOOR),
            (story_names, HISTORY_STORY),
            (elements, (ELEMENT_FORCE,)),
            *device_groups(devices),
            (("",), HISTORY_ENERGY),
            *(errors if error else ()),
        )
        return tuple((names, columns) for names, columns in groups if names)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns of the file in their order, for example `floor_2_velocity_m_s`."""
        return tuple(
            column._replace(name=f"{name}_{column.name}" if name else column.name)
            for names, group in self.groups
            for name in names
            for column in group
        )


def write_history(
    pieces: Iterable[History],
    stream: BinaryIO,
    units: OutputUnits = SI,
    across: Iterable[History] = (),
) -> None:
    """Write a response history as CSV with a row per time step.

    Parameters
    ----------
    pieces : iterable of History
        Consecutive parts of the history in the order of time, so that memory use is limited.
    units : OutputUnits
        Units of the columns; SI by default.
    across : iterable of History
        Parts of the history in direction y of a run in two directions, with the times of `pieces`.
        The names of all columns but the time then start with the direction, as in
        `y_floor_1_velocity_m_s`.
    """
    for index, parts in enumerate(zip(pieces, across, strict=True) if across else zip(pieces)):
        history = parts[0]
        prefixes = ("x_", "y_") if across else ("",)
        layouts = [HistoryLayout.of(part) for part in parts]
        # The time is the first column of each direction, and the same.
        names_and_factors = [
            units.column(f"{prefix if i else ''}{column.name}", column.unit)
            for prefix, layout in zip(prefixes, layouts, strict=True)
            for i, column in enumerate(layout.columns)
            if i or prefix != "y_"
        ]
        if index == 0:
            stream.write((",".join(name for name, _ in names_and_factors) + "\n").encode())
        factors = None if units == SI else np.array([factor for _, factor in names_and_factors])
        row_format = ",".join(["%.12g"] * len(names_and_factors)) + "\n"
        # `groups` contains the arrays of the columns of each group, shape (steps,) or (steps,
        # stories). For a group with the quantities a and b of each story, the columns of the file
        # are a and b of story 1, a and b of story 2, and so on, as in `HistoryLayout`. `stack`
        # therefore adds the quantity as the last axis, and `reshape` joins the axes of stories and
        # quantities.
        groups = [
            [column.of(part) for column in group if part is history or column.value != "time"]
            for part, layout in zip(parts, layouts, strict=True)
            for _, group in layout.groups
        ]
        for start in range(0, len(history.time), _ROWS_AT_ONCE):
            row_slice = slice(start, start + _ROWS_AT_ONCE)
            group_blocks = (
                np.stack([values[row_slice] for values in group], axis=-1) for group in groups
            )
            table = np.hstack([block.reshape(len(block), -1) for block in group_blocks])
            if factors is not None:
                table /= factors
            table += 0.0  # removes the sign of negative zero
            text = row_format * len(table) % tuple(table.ravel().tolist())
            stream.write(
                (text.replace("nan", "") if np.isnan(table).any() else text).encode("ascii")
            )
