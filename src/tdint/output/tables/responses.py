"""Tables of runs: stories, events of sequences, response histories."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from tdint.output.tables.devices import history_groups as device_groups
from tdint.output.tables.table import (
    TEXT,
    Cell,
    Column,
    Table,
    describe,
    error_columns,
    joined_rows,
    numbered,
)
from tdint.response.runs.outcome import (
    ELEMENT_QUANTITIES,
    ENERGY_TERMS,
    STORY_QUANTITIES,
    ErrorHistory,
    History,
)
from tdint.units import SI, OutputUnits, quantities

if TYPE_CHECKING:
    from tdint.response.runs.outcome import (
        DeviceHistory,
        ElementPeaks,
        ElementValues,
        Gradient,
        Response,
        StoryErrors,
        StoryPeaks,
    )

_ELEMENT = {quantity.name: quantity for quantity in ELEMENT_QUANTITIES}
STORY_COLUMNS: tuple[Column, ...] = (
    Column(
        "story", "1", numbered("peak_drift"), "story (or the floor above), numbered from the ground"
    ),
    Column.named("height", "story height", "m"),
    *(Column.of_quantity(quantity) for quantity in STORY_QUANTITIES if "table" in quantity.shown),
)
STORY_ERROR = error_columns(STORY_COLUMNS[2:])
"""Additional columns of a run with error estimates."""

ELEMENT_COLUMNS: tuple[Column, ...] = (
    Column.named("story", "story, numbered from the ground"),
    Column.named("element", "name of the element in the model file", TEXT),
    Column.named("law", "hysteretic law of the element", TEXT),
    Column.of_quantity(_ELEMENT["peak_force"]),
    Column.of_quantity(_ELEMENT["dissipated_energy"]),
    Column.named("yield_drift", "drift at first yield; empty without yielding", "m"),
    Column.of_quantity(_ELEMENT["ductility"]),
)
"""Columns of elements.csv: the elements of stories with several elements."""
ELEMENT_ERROR = error_columns(Column.of_quantity(quantity) for quantity in _ELEMENT.values())
ELEMENT_FORCE = Column("force_N", "N", "element_force", "force of the element")
"""Column of each element in a response history; the story and the name of the element precede the
name of the column."""
_ALL = "all"
SHOCK = Column.named("shock", f"event of a sequence, from 1; {_ALL}: the whole sequence", TEXT)

HISTORY_START, HISTORY_FLOOR, HISTORY_STORY = (
    tuple(
        Column.of_quantity(quantity)
        for quantity in quantities(History)
        if quantity.shown == (location,)
    )
    for location in ("ground", "floor", "story")
)
HISTORY_ENERGY = (
    *(
        Column(f"energy_{name}_J", "J", f"energy.{name}", meaning)
        for name, meaning in ENERGY_TERMS.items()
    ),
    Column(
        "energy_error",
        "1",
        "energy.error",
        "energy balance error divided by the maximum input energy of the run",
    ),
)

HISTORY_FLOOR_ERROR, HISTORY_STORY_ERROR = (
    tuple(
        Column(
            f"{quantity.column}_error", quantity.unit, f"error.{quantity.name}", quantity.meaning
        )
        for quantity in quantities(ErrorHistory)
        if quantity.shown == (location,)
    )
    for location in ("floor", "story")
)
"""Last columns of a response history with error estimates."""

_ROWS_AT_ONCE = 256  # rows formatted together, which needs 1 MB for a hundred columns


def story_table(stories: StoryPeaks, errors: StoryErrors | None = None) -> Table:
    """Return the table of the peak responses of the stories, one row per story from the ground up.

    Parameters
    ----------
    errors : StoryErrors, optional
        Estimated errors of the peaks. If they are specified, the columns of the peaks are followed
        by a column `<name>_error` for each peak.
    """
    columns = (*STORY_COLUMNS, *(STORY_ERROR if errors else ()))
    return Table.of(columns, story_rows(stories, errors))


def story_rows(stories: StoryPeaks, errors: StoryErrors | None = None) -> list[tuple[Cell, ...]]:
    """Return the rows of `story_table`."""
    return joined_rows(((STORY_COLUMNS, stories), (STORY_ERROR, errors)))


def element_table(response: Response) -> Table | None:
    """Return the table of the elements of stories with several elements, with error estimates if
    the run has them; None without such stories."""
    if response.elements is None:
        return None
    errors = response.check.elements if response.check else None
    columns = (*ELEMENT_COLUMNS, *(ELEMENT_ERROR if errors else ()))
    return Table.of(columns, element_rows(response.elements, errors))


def element_rows(
    elements: ElementPeaks | None, errors: ElementValues | None = None
) -> list[tuple[Cell, ...]]:
    """Return the rows of `element_table`; empty without elements (None)."""
    return joined_rows(((ELEMENT_COLUMNS, elements), (ELEMENT_ERROR, errors)))


def response_table(response: Response) -> Table:
    """Return the table of the peak responses of a run, with one row per story from the ground up.

    For a sequence, these rows are listed for each event and then for the complete sequence; the
    first column identifies the event.
    """
    if response.model.matrices is not None:
        # Imported here, because few models have matrices.
        from tdint.output.tables.matrices import row_table, with_flexure

        if response.model.rows:
            return row_table(response)
    table = story_table(response.stories, response.check.errors if response.check else None)
    if response.flexure is not None:
        table = with_flexure(response, table)
    if not response.events:
        return table
    rows: list[tuple[Cell, ...]] = []
    for number, event in enumerate(response.events, start=1):
        event_table = story_table(event.stories, event.errors)
        # An event has no errors if the run for the error estimate had ended before it.
        missing_errors = (None,) * (len(table.columns) - len(event_table.columns))
        rows += [(str(number), *row, *missing_errors) for row in event_table.rows]
    rows += [(_ALL, *row) for row in table.rows]
    return Table((SHOCK.name, *table.columns), rows, describe([SHOCK]) | table.meanings)


def history_parts(
    history: History,
) -> tuple[int, bool, Sequence[str], DeviceHistory | None, Sequence[str]]:
    """Return the arguments of `history_groups` and `history_columns` for a response history."""
    stories = history.displacement.shape[1]
    has_error = history.error is not None
    return stories, has_error, history.element_labels, history.devices, history.rows


def history_groups(
    stories: int,
    error: bool,
    elements: Sequence[str] = (),
    devices: DeviceHistory | None = None,
    rows: Sequence[str] = (),
) -> tuple[tuple[Sequence[str], tuple[Column, ...]], ...]:
    """Return the columns of a response history in groups: the names that precede the columns of a
    group, and the columns, which are repeated for each name (floor, story, element of stories with
    several elements, attachment, link).

    The columns of time, ground and energies have an empty name. `error` adds the columns of the
    estimated errors. Rows that are not floors (`rows`) have the columns of floors only.
    """
    if rows:
        groups = (("",), HISTORY_START), (rows, HISTORY_FLOOR), (("",), HISTORY_ENERGY)
        return (*groups, *(((rows, HISTORY_FLOOR_ERROR),) if error else ()))
    floors, story_names = (
        tuple(f"{location}_{i}" for i in range(1, stories + 1)) for location in ("floor", "story")
    )
    errors = ((floors, HISTORY_FLOOR_ERROR), (story_names, HISTORY_STORY_ERROR)) if error else ()
    return (
        (("",), HISTORY_START),
        (floors, HISTORY_FLOOR),
        (story_names, HISTORY_STORY),
        *(((elements, (ELEMENT_FORCE,)),) if elements else ()),
        *device_groups(devices),
        (("",), HISTORY_ENERGY),
        *errors,
    )


def history_columns(
    stories: int,
    error: bool = False,
    elements: Sequence[str] = (),
    devices: DeviceHistory | None = None,
    rows: Sequence[str] = (),
) -> tuple[Column, ...]:
    """Return the columns of the CSV file of a response history, for example `floor_2_velocity_m_s`.

    Parameters
    ----------
    error : bool
        True to add the columns of the estimated errors at the end; false by default.
    elements : sequence of str
        Labels of the elements (`History.element_labels`).
    devices : DeviceHistory, optional
        Attachments and links of the history.
    rows : sequence of str
        Names of rows that are not floors.
    """
    return tuple(
        column._replace(name=f"{name}_{column.name}" if name else column.name)
        for names, group in history_groups(stories, error, elements, devices, rows)
        for name in names
        for column in group
    )


def write_pieces(pieces: Iterable[History], stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write a response history as CSV from consecutive pieces, so that memory use is limited.

    The file is the same as the file that `write_history` writes for the complete history.

    Parameters
    ----------
    pieces : iterable of History
        Parts of the history in the order of time.
    units : OutputUnits
        Units of the columns; SI by default.
    """
    for index, piece in enumerate(pieces):
        write_history(piece, stream, units, header=index == 0)


def write_history(
    history: History, stream: BinaryIO, units: OutputUnits = SI, *, header: bool = True
) -> None:
    """Write a response history as CSV with one row per time step.

    Parameters
    ----------
    header : bool
        True to write the header; true by default.
    """
    parts = history_parts(history)
    names_and_factors = [
        units.column(column.name, column.unit) for column in history_columns(*parts)
    ]
    if header:
        stream.write((",".join(name for name, _ in names_and_factors) + "\n").encode())
    factors = None if units == SI else np.array([factor for _, factor in names_and_factors])
    row_format = ",".join(["%.12g"] * len(names_and_factors)) + "\n"
    # `groups` contains the arrays of the columns of each group, shape (steps,) or (steps, stories).
    # For a group with the quantities a and b of each story, the columns of the file are a and b of
    # story 1, a and b of story 2, and so on, as in `history_columns`. `stack` therefore adds the
    # quantity as the last axis, and `reshape` joins the axes of stories and quantities.
    groups = [[column.of(history) for column in group] for _, group in history_groups(*parts)]
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
        stream.write((text.replace("nan", "") if np.isnan(table).any() else text).encode("ascii"))


def gradient_columns(result: Gradient) -> list[Column]:
    """Return the columns of a table of derivatives of peak responses, in SI units.

    The table has a row for each run, parameter and story. The columns are `run` (omitted for a
    single run), `parameter`, `story`, `value` (of the parameter), and for each quantity its
    derivative `<quantity>`, half the difference of its one-sided derivatives `<quantity>_kink`, and
    its estimated discretization error `<quantity>_error` (omitted without error estimates).
    """
    # The arrays have the shape (runs, parameters, stories), or (parameters, stories) for a single
    # run. The shape always gets the axis of the runs: `atleast_3d` adds a missing axis at the end,
    # so the array is transposed before and after.
    shape = np.atleast_3d(result.peak_drift.T).T.shape
    runs, parameters, stories = np.indices(shape)
    names = np.array(result.parameters)[parameters.ravel()]
    cells_of_columns: list[tuple[str, str, Any]] = []  # name, unit, cells
    if shape[0] > 1:
        cells_of_columns.append(("run", "1", runs.ravel()))
    cells_of_columns += [("parameter", "text", names), ("story", "1", 1 + stories.ravel())]
    parameter_values = np.broadcast_to(np.reshape(result.values, (*shape[:2], 1)), shape)
    cells_of_columns.append(("value", "1", parameter_values.ravel()))
    for quantity in STORY_QUANTITIES:
        for suffix, source in (("", result), ("_kink", result.kink), ("_error", result.errors)):
            if hasattr(source, quantity.name):
                cells = getattr(source, quantity.name).ravel()
                cells_of_columns.append((f"{quantity.name}{suffix}", "1", cells))
    # The unit of a derivative depends on the parameter of the row, so names have no unit.
    return [Column(name, unit, cells, name) for name, unit, cells in cells_of_columns]
