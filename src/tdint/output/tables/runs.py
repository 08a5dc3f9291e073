"""Columns of tables with a row per run: runs.csv of campaigns, and results of `run_many`."""

from __future__ import annotations

from collections.abc import Iterable

from tdint.model.parameters import parameter_meaning
from tdint.output.tables.columns import declared
from tdint.output.tables.table import METHOD_SPEC, NAMED_RECORD_COLUMNS, TEXT, Column, error_columns
from tdint.response.runs.run_values import DEMANDED, HIDDEN, RUN, RUN_WITH_ERROR

BUILDING_COLUMNS = (
    Column.named("building", "name of the building", TEXT),
    *NAMED_RECORD_COLUMNS,
    Column.named("scale", "scale factor of the ground motion"),
)

(SAMPLE,) = declared("runs.sample")

PLACE = declared("runs.place")

RUNS = (
    *BUILDING_COLUMNS,
    SAMPLE,
    *PLACE,
    METHOD_SPEC,
    *(Column.of_quantity(quantity) for quantity in RUN if quantity.shown != HIDDEN),
)
"""Columns of runs.csv."""

SHOCKS = (*declared("runs.shocks"), *(Column.of_quantity(quantity) for quantity in DEMANDED))
"""Columns of shocks.csv: response to each event of a sequence. runs.csv has complete sequences."""

_WITH_ERROR = tuple(Column.of_quantity(quantity) for quantity in RUN_WITH_ERROR)

RUN_ERRORS = error_columns(_WITH_ERROR)
"""Additional columns of a campaign with error estimates."""


def varied_columns(names: Iterable[str]) -> list[Column]:
    """Return the columns of the parameters that a sweep changed, for example with the name
    `story 3.mass_factor`."""
    columns = []
    for name in names:
        # `story 3.mass_factor` becomes story_3_mass_factor; a key of model files is unchanged.
        column_name = name
        if not name.startswith(("stories", "record")):
            column_name = name.replace(" ", "_").replace(".", "_")
        columns.append(Column(column_name, "1", name, parameter_meaning(name)))
    return columns
