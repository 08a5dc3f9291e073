"""Tables of runs: stories, events of sequences, response histories."""

from __future__ import annotations

from typing import Any

import numpy as np

from tdint.output.tables.columns import declared
from tdint.output.tables.table import TEXT, Cell, Column, Table, describe, error_columns, numbered
from tdint.response.runs.outcome import (
    STORY_QUANTITIES,
    Gradient,
    Response,
    StoryErrors,
    StoryPeaks,
)

STORY_COLUMNS: tuple[Column, ...] = (
    *declared("responses.story_columns", story=numbered("peak_drift")),
    *(Column.of_quantity(quantity) for quantity in STORY_QUANTITIES if "table" in quantity.shown),
)
STORY_ERROR = error_columns(STORY_COLUMNS[2:])
"""Additional columns of a run with error estimates."""

(ENERGY,) = declared("responses.energy")
ENERGY_ERROR = error_columns((ENERGY,))

_ALL = "all"
SHOCK = Column.named("shock", f"event of a sequence, from 1; {_ALL}: the whole sequence", TEXT)


def story_table(stories: StoryPeaks, errors: StoryErrors | None = None) -> Table:
    """Return the table of the peak responses of the stories, one row per story from the ground up.

    Parameters
    ----------
    errors : StoryErrors, optional
        Estimated errors of the peaks. If they are specified, the columns of the peaks are followed
        by a column `<name>_error` for each peak.
    """
    return Table.joined((STORY_COLUMNS, stories), (STORY_ERROR, errors))


def response_table(response: Response) -> Table:
    """Return the table of the peak responses of a run, with a row per story from the ground up.

    For a sequence, these rows are listed for each event and then for the complete sequence; the
    first column identifies the event. For two directions, they are listed for each direction and
    for the resultants.
    """
    if response.directions:
        # Imported here, because few models have two directions.
        from tdint.output.tables.directions import direction_table

        return direction_table(response, _table_of_peaks)
    return _table_of_peaks(response)


def _table_of_peaks(response: Response) -> Table:
    """Return the table of a run in one direction, of a sequence, or of the resultants."""
    groups: Any = ()
    if response.model.matrices is not None:
        # Imported here, because few models have matrices.
        from tdint.output.tables.matrices import flexure_groups, row_table

        if response.model.rows:
            return row_table(response)
        groups = flexure_groups(response)
    errors = response.check.errors if response.check else None
    # The energies of the events of a sequence are not stored.
    if response.model.matrices is None and not response.events:
        check = response.check and response.check.hysteretic_energy is not None
        groups = (((ENERGY,), response), (ENERGY_ERROR, response.check if check else None))
    table = Table.joined((STORY_COLUMNS, response.stories), (STORY_ERROR, errors), *groups)
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


def gradient_columns(result: Gradient) -> list[Column]:
    """Return the columns of a table of derivatives of peak responses, in SI units.

    The table has a row for each run, parameter and story or device. The columns are `run` (omitted
    for a single run), `parameter`, `story` or `device`, `value` (of the parameter), and for each
    quantity its derivative `<quantity>`, half the difference of its one-sided derivatives
    `<quantity>_kink`, and its estimated discretization error `<quantity>_error` (omitted without
    error estimates).
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
    cells_of_columns += [("parameter", "text", names), (result.axis, "1", 1 + stories.ravel())]
    parameter_values = np.broadcast_to(np.reshape(result.values, (*shape[:2], 1)), shape)
    cells_of_columns.append(("value", "1", parameter_values.ravel()))
    for quantity in STORY_QUANTITIES:
        for suffix, source in (("", result), ("_kink", result.kink), ("_error", result.errors)):
            if hasattr(source, quantity.name):
                cells = getattr(source, quantity.name).ravel()
                cells_of_columns.append((f"{quantity.name}{suffix}", "1", cells))
    # The unit of a derivative depends on the parameter of the row, so names have no unit.
    return [Column(name, unit, cells, name) for name, unit, cells in cells_of_columns]
