"""Columns of tables with a row per run: runs.csv of campaigns, and results of `run_many`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress

from tdint.errors import UsageError
from tdint.model.definition import Model
from tdint.model.parameters import parameter_meaning
from tdint.output.tables.columns import declared
from tdint.output.tables.table import METHOD_SPEC, NAMED_RECORD_COLUMNS, TEXT, Column, error_columns
from tdint.response.runs.run_values import DEMANDED, HIDDEN, RUN, RUN_WITH_ERROR
from tdint.units import SI, suffix

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


def si_units_of(names: Iterable[str], models: Sequence[Model]) -> dict[str, str]:
    """Return the SI unit of each varied parameter; empty for a factor, a ratio and a property of
    the record."""
    units = dict.fromkeys(names, "")
    for name in units:
        for model in models:
            with suppress(UsageError):
                units[name] = model.unit_of(name, SI)[0]
                break
    return units


def varied_columns(units: Mapping[str, str]) -> list[Column]:
    """Return the columns of the parameters that a sweep changed, for example with the name
    `story 3.mass_factor`. `units` contains the SI unit of each parameter; a factor has none."""
    columns = []
    for name, unit in units.items():
        # `story 3.mass_factor` becomes story_3_mass_factor; a key of model files is unchanged.
        column_name = name
        if not name.startswith(("stories", "record")):
            column_name = name.replace(" ", "_").replace(".", "_")
        column_name += suffix(unit or "1")
        columns.append(Column(column_name, unit or "1", name, parameter_meaning(name)))
    return columns
