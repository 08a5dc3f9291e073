"""Conversion of results to columns by name (as for pandas), Parquet, xarray and HTML tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.analysis.run.demands import DEMANDED, demand_columns, demand_errors
from tdint.analysis.run.outcome import STORY_QUANTITIES, History
from tdint.errors import UsageError
from tdint.files import write_files
from tdint.output.tables import buildings, campaign, methods, responses, spectra, studies
from tdint.output.tables.table import (
    FLOOR,
    RECORD_COLUMNS,
    Column,
    Table,
    columns_of,
    describe,
    parquet,
)
from tdint.tabular import ResultList, import_optional
from tdint.units import SI, parse_output_units, quantities

if TYPE_CHECKING:
    from tdint.analysis.run.many_results import Runs

_ROWS = 20  # number of rows in the table of a notebook
_DIGITS = 5  # significant digits in the table of a notebook


def to_dict(result: Any, units: str = "") -> dict[str, Any]:
    """Return the columns of a result's table by name: arrays of equal length, text as lists.

    Parameters
    ----------
    result : object
        A result of `run`, `spectrum`, `modes`, `cyclic_test`, `pushover`, `stability` or another
        function; also the response history of a run, a record, or several results of a single type.
    units : str
        Units instead of SI, such as `kip,in,g`; the column names change accordingly.

    Returns
    -------
    dict
        Columns by name.

    Raises
    ------
    UsageError
        The result has no table, or a unit is unknown.
    """
    # If the class of several results is in `_IN_ROWS`, their table has one row for each result.
    # Otherwise each result has a table, and these tables are joined.
    if isinstance(result, list | tuple | ResultList):
        first = result[0] if len(result) else None
        if type(first).__name__ not in _IN_ROWS:
            return _joined([to_dict(item, units) for item in result])
    output_units = parse_output_units(units) if units else SI
    if units and type(result).__name__ == "Gradient":
        raise UsageError("derivatives are in SI units: units cannot be selected for a gradient")
    values = _values(result)
    row_count = max((len(value) for _, value in values if isinstance(value, np.ndarray)), default=1)
    columns: dict[str, Any] = {}
    for column, value in values:
        name, factor = output_units.column(column.name, column.unit)
        columns[name] = _cells(value, factor, row_count)
    return columns


def _cells(value: Any, factor: float, row_count: int) -> Any:
    """Return the cells of a column: an array of numbers, or a list with text.

    `value` contains the cells of the column, or a value that applies to all rows; None if it is
    missing.
    """
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "U":  # text
            return value.tolist()
        # Division by 1.0 would convert whole numbers to floats.
        return value if factor == 1.0 else value / factor
    if isinstance(value, list):
        return value
    if isinstance(value, str):
        return [value] * row_count
    if value is None:
        return np.full(row_count, np.nan)
    return np.full(row_count, value if factor == 1.0 else value / factor)


def _joined(tables: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Concatenate tables with the same columns. A table is a dictionary from the name of a column
    to its cells, an array or a list. UsageError is raised if there are no tables, or their columns
    differ.
    """
    if not tables or any(table.keys() != tables[0].keys() for table in tables):
        raise UsageError(
            "results cannot be joined to one table, because the list is empty or their tables have "
            "different columns; convert each result separately"
        )
    joined: dict[str, Any] = {}
    for name, first_cells in tables[0].items():
        if isinstance(first_cells, list):
            joined[name] = [cell for table in tables for cell in table[name]]
        else:
            joined[name] = np.concatenate([table[name] for table in tables])
    return joined


def to_parquet(result: Any, file: str | Path) -> None:
    """Write the table of a result in SI units to a Parquet file, with units and meanings of the
    columns as metadata. An existing file is replaced."""
    descriptions = describe(column for column, _ in _values(result))
    write_files({Path(file): parquet(to_dict(result), descriptions)}, overwrite=True)


def to_xarray(runs: Runs) -> Any:
    """Return the results of many runs as an `xarray.Dataset`.

    The peak responses and their errors have the dimensions run and story; response histories have
    the dimensions run, time and story. Building, record, scale factor and the other properties of a
    run are coordinates.

    Raises
    ------
    UsageError
        xarray is not installed.
    """
    xarray = import_optional("xarray", "to_xarray")
    table = to_dict(runs)
    run_columns = [
        *RUN_COORDINATES,
        *(column.name for column in campaign.varied_columns(runs.varied)),
    ]
    coordinates: dict[str, Any] = {name: ("run", table[name]) for name in run_columns}
    coordinates |= {
        "run": np.arange(len(runs.model)),
        "story": 1 + np.arange(runs.stories.peak_drift.shape[1]),
    }
    # Each variable is a tuple of its dimensions, its values and its attributes.
    variables: dict[str, Any] = {}
    for quantity in STORY_QUANTITIES:
        values = getattr(runs.stories, quantity.name)
        attributes = {"units": quantity.unit, "long_name": quantity.meaning}
        variables[quantity.name] = (("run", "story"), values, attributes)
        if hasattr(runs.errors, quantity.name):
            errors = getattr(runs.errors, quantity.name)
            variables[f"{quantity.name}_error"] = (
                ("run", "story"),
                errors,
                {"units": quantity.unit},
            )
    for name, values in runs.history.items():
        variables[name] = ("run", "time", "story"), values, {"units": _HISTORY_UNITS[name]}
    if runs.history:
        # Times that differ between runs cannot be a coordinate of the axis `time`.
        if len(runs.time) == 1:
            coordinates["time"] = ("time", runs.time[0])
        else:
            coordinates["times"] = (("run", "time"), runs.time)
    return xarray.Dataset(variables, coordinates)


RUN_COORDINATES = ("building", "record", "component", "method", "scale", "dt_s", "status", "steps")
"""Coordinates of a run in addition to its number."""

_HISTORY_UNITS = {
    quantity.called or quantity.name: quantity.unit for quantity in quantities(History)
}


def to_html(result: Any, caption: str) -> str:
    """Return the first rows of the table of a result as HTML, for notebooks.

    A note below the table states the number of rows that are omitted.

    Parameters
    ----------
    result : object
        Result that `to_dict` converts to columns.
    """
    columns = to_dict(result)
    row_count = len(next(iter(columns.values())))
    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    rows = (
        [escape(_cell(values[row])) for values in columns.values()]
        for row in range(min(row_count, _ROWS))
    )
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    # Only the first rows are shown, because thousands of rows would fill the notebook.
    more_text = f"<p>{row_count - _ROWS} more rows</p>" if row_count > _ROWS else ""
    return f"<table><caption>{escape(caption)}</caption><tr>{head}</tr>{body}</table>{more_text}"


def _cell(value: Any) -> str:
    """Return a cell of the table of a notebook as text, with 5 significant digits."""
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else format(value + 0.0, f".{_DIGITS}g")
    return "" if value is None else str(value)


_Values = list[tuple[Column, Any]]

RUNS_COLUMNS: dict[str, Column] = {str(column.value): column for column in campaign.RUNS}
"""Columns of runs.csv by their attributes."""


def _values(result: Any) -> _Values:
    """Return the columns of the table of a result, each with its values: an array, a list with
    text, or a single value that applies to all rows. UsageError is raised if the result has no
    table.
    """
    # `to_dict` passes several results only if their class is in `_IN_ROWS`.
    if isinstance(result, list | tuple | ResultList):
        return _in_rows(list(result))
    # The table of a base class applies to subclasses without a separate table.
    for result_class in type(result).__mro__:
        if result_class.__name__ in _VALUES:
            return _VALUES[result_class.__name__](result)
    raise UsageError(f"a result of the type {type(result).__name__} has no table")


def _rows_of(columns: Sequence[Column]) -> Callable[[Sequence[Any]], Table]:
    """Return a function of several results, which returns their table with the given columns."""
    return partial(Table.of_results, columns)


_IN_ROWS: dict[str, Callable[[Sequence[Any]], Table]] = {
    "ExampleRun": methods.example_table,
    "Fragility": studies.fragility_table,
    "Integrator": methods.method_table,
    "InventoryBuilding": _rows_of(buildings.INVENTORY),
    "Overview": _rows_of(buildings.OVERVIEW),
    "RecordInfo": spectra.info_table,
    "ParameterEffect": _rows_of(studies.PARAMETER_EFFECTS),
    "Trial": methods.failure_table,
    "ValidationResult": methods.validation_table,
}
"""Tables with one row per result, by class name, so that the modules of the classes need not be
imported."""


def _in_rows(results: Sequence[Any]) -> _Values:
    """Return the columns, with their cells, of the table with one row for each result."""
    return _IN_ROWS[type(results[0]).__name__](results).by_column()


def _column_values(columns: Sequence[Column], result: Any) -> _Values:
    """Return a list of tuples: a column, and the value of the column for the result."""
    return [(column, column.of(result)) for column in columns]


def _from(table: Callable[[Any], Table]) -> Callable[[Any], _Values]:
    """Return a function of a result, which returns the columns of `table(result)` with their
    cells."""
    return lambda result: table(result).by_column()


def _record_columns(result: Any) -> _Values:
    """Return the columns that the class of a result declares, with their values, after the file and
    the component of its record."""
    return _column_values((*RECORD_COLUMNS, *columns_of(type(result))), result)


def _campaign_columns(result: Any) -> _Values:
    """Return the columns of runs.csv, the table of the runs of a campaign, with their cells."""
    with result.store as store:
        return campaign.runs_table(store).by_column()


def _runs_columns(result: Runs) -> _Values:
    """Return the columns of the results of `run_many`, with one row per run; they have the names of
    the columns of runs.csv of a campaign."""
    demands = {quantity.name: np.full(len(result.model), np.nan) for quantity in DEMANDED}
    # Arrays have space for the tallest building; the values above a lower building are nan.
    for number in range(len(result.models)):
        runs, stories = result.select_building(number)
        for name, values in demand_columns(stories).items():
            demands[name][runs] = values
    # `model` and `record` contain the index of the building and of the record of each run.
    buildings = np.array([model.name for model in result.models])[result.model]
    sources = np.array([record.source for record in result.records])[result.record]
    components = np.array([record.component for record in result.records])[result.record]
    methods_of_runs = np.array(result.methods)[result.model]
    return [
        (RUNS_COLUMNS["building"], buildings),
        (RUNS_COLUMNS["record"], sources),
        (RUNS_COLUMNS["component"], components),
        (RUNS_COLUMNS["method"], methods_of_runs),
        *zip(campaign.varied_columns(result.varied), result.varied.values(), strict=True),
        *(
            (RUNS_COLUMNS[name], getattr(result, name))
            for name in ("scale", "dt", "status", "energy_error", "steps")
        ),
        *((RUNS_COLUMNS[name], values) for name, values in demands.items()),
        *_demand_errors(result),
    ]


def _demand_errors(result: Runs) -> _Values:
    """Return the columns of the estimated errors of the peak responses of `run_many`, with one row
    per run; an empty list if errors were not estimated."""
    if result.errors is None:
        return []
    rows = []
    for run, model in enumerate(result.model.tolist()):
        story_count = len(result.models[model].stories)
        peaks = _values_of_run(result.stories, run, story_count)
        errors = _values_of_run(result.errors, run, story_count)
        rows.append(demand_errors(peaks, errors))
    return list(zip(campaign.RUN_ERRORS, np.array(rows).T, strict=True))


def _values_of_run(values: Any, run: int, story_count: int) -> Any:
    """Return the peak responses, or their errors, of one of many runs."""
    return type(values)(
        **{field.name: getattr(values, field.name)[run, :story_count] for field in fields(values)}
    )


def _mode_columns(result: Any) -> _Values:
    """Return the columns, with their values, of the modes of a building."""
    ratios = np.full_like(result.omega, np.nan) if result.damping is None else result.damping
    return _column_values(
        (*buildings.MODE, buildings.mode_damping(ratios), *buildings.MODE_END), result
    )


def _history_columns(result: History) -> _Values:
    """Return the columns of a response history with their values, as in the CSV file."""
    stories, has_error = result.displacement.shape[1], result.error is not None
    values: list[Any] = []
    labels = result.element_labels
    for location, columns in responses.history_groups(has_error, bool(labels)):
        arrays = [column.of(result) for column in columns]
        if location:  # a column for each floor or story, in the order of the CSV file
            count = len(labels) if location == "element" else stories
            values += [array[:, i] for i in range(count) for array in arrays]
        else:
            values += arrays
    return list(zip(responses.history_columns(stories, has_error, labels), values, strict=True))


_VALUES: dict[str, Callable[[Any], _Values]] = {
    "CampaignRuns": _campaign_columns,
    "Chart": _from(methods.chart_table),
    "Comparison": _from(lambda result: buildings.comparison_table([result])),
    "CyclicTest": partial(_column_values, buildings.CYCLIC),
    "FieldChart": _from(methods.profile_table),
    "FloorSpectrum": lambda result: (
        _column_values([FLOOR], result) + _column_values(spectra.SPECTRUM, result.spectrum)
    ),
    "FragilityResult": _from(lambda result: studies.fragility_table(result.functions)),
    "Gradient": lambda result: _column_values(responses.gradient_columns(result), result),
    "History": _history_columns,
    "IdaStudy": _from(studies.ida_table),
    "Match": _from(lambda result: spectra.match_table([result])),
    "ModalResponse": partial(_column_values, buildings.MODAL_RESPONSE),
    "Modes": _mode_columns,
    "ObservedOrder": _from(lambda result: methods.order_table([result])),
    "Overshoot": partial(_column_values, methods.OVERSHOOT),
    "Pushover": lambda result: _column_values(buildings.pushover(result.drift.shape[1]), result),
    "Record": partial(_column_values, spectra.SAMPLES),
    "Response": _from(responses.response_table),
    "RotatedSpectrum": lambda result: _column_values(
        (*spectra.MOTION_COLUMNS, *spectra.rotated(result.percentiles)), result
    ),
    "Runs": _runs_columns,
    "Scaling": _from(studies.factor_table),
    "StabilityCurve": partial(_column_values, methods.STABILITY),
    "ElementPeaks": partial(_column_values, responses.ELEMENT_COLUMNS),
    "StoryPeaks": partial(_column_values, responses.STORY_COLUMNS),
    "TargetDisplacement": partial(_column_values, buildings.TARGET_DISPLACEMENT),
}
_VALUES |= dict.fromkeys(("Fragility", "Overview", "RecordInfo"), lambda result: _in_rows([result]))
_VALUES |= dict.fromkeys(
    ("Spectrum", "InelasticSpectrum", "DriftSpectrum", "FourierSpectrum"), _record_columns
)
"""Tables of a single result, by class name."""
