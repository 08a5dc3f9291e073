"""Columns of a single result with their values, for classes without another table."""

from __future__ import annotations

from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.arrays import each_array
from tdint.ground_motion.record import component_names
from tdint.output.tables import histories, runs
from tdint.output.tables.table import Column
from tdint.response.runs.history import History
from tdint.response.runs.run_values import DEMANDED, demand_columns, demand_errors

if TYPE_CHECKING:
    from tdint.response.runs.many_results import Runs

Values = list[tuple[Column, Any]]

RUNS_COLUMNS: dict[str, Column] = {str(column.value): column for column in runs.RUNS}
"""Columns of runs.csv by their attributes."""


def runs_columns(result: Runs) -> Values:
    """Return the columns of the results of `run_many`, with a row per run; they have the names of
    the columns of runs.csv of a campaign."""
    demands = {quantity.name: np.full(len(result.model), np.nan) for quantity in DEMANDED}
    # Arrays have space for the tallest building; the values above a lower building are nan.
    for number in range(len(result.models)):
        run_numbers, stories = result.select_building(number)
        for name, values in demand_columns(stories).items():
            demands[name][run_numbers] = values
    # `model` and `record` contain the index of the building and of the record of each run.
    buildings = np.array([model.name for model in result.models])[result.model]
    sources = np.array([record.source for record in result.records])[result.record]
    components = np.array(component_names(result.records))[result.record]
    methods_of_runs = np.array(result.methods)[result.model]
    return [
        (RUNS_COLUMNS["building"], buildings),
        (RUNS_COLUMNS["record"], sources),
        (RUNS_COLUMNS["component"], components),
        (RUNS_COLUMNS["method"], methods_of_runs),
        *zip(
            runs.varied_columns(runs.si_units_of(result.varied, result.models)),
            result.varied.values(),
            strict=True,
        ),
        *(
            (RUNS_COLUMNS[name], getattr(result, name))
            for name in ("scale", "dt", "status", "energy_error", "steps")
        ),
        *((RUNS_COLUMNS[name], values) for name, values in demands.items()),
        *_demand_errors(result),
    ]


def _demand_errors(result: Runs) -> Values:
    """Return the columns of the estimated errors of the peak responses of `run_many`, with a row
    per run; an empty list if errors were not estimated."""
    if result.errors is None:
        return []
    rows = []
    for run, model in enumerate(result.model.tolist()):
        of_run = itemgetter((run, slice(len(result.models[model].stories))))
        peaks, errors = (each_array(of_run, part) for part in (result.stories, result.errors))
        rows.append(demand_errors(peaks, errors))
    return list(zip(runs.RUN_ERRORS, np.array(rows).T, strict=True))


def history_columns(result: History) -> Values:
    """Return the columns of a response history with their values, as in the CSV file."""
    layout = histories.HistoryLayout.of(result)
    values: list[Any] = []
    for names, columns in layout.groups:
        arrays = [column.of(result) for column in columns]
        # A column for each floor or story, in the order of the CSV file; other names are empty
        values += (
            [array[:, i] for i in range(len(names)) for array in arrays] if all(names) else arrays
        )
    return list(zip(layout.columns, values, strict=True))
