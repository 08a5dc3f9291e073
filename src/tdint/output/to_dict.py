"""Conversion of results to columns by name (as for pandas), Parquet, xarray and HTML tables."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.errors import UsageError, write_out_controls
from tdint.files import write_files
from tdint.output.presentation import presentations
from tdint.output.tables.runs import si_units_of, varied_columns
from tdint.output.tables.table import Column, Table, describe, parquet
from tdint.response.runs.energy import ENERGY_TERMS
from tdint.response.runs.history import DEVICE, ELEMENT_FORCE, History
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.tabular import ResultList, import_optional
from tdint.units import SI, OutputUnits, parse_output_units, quantities

if TYPE_CHECKING:
    from tdint.response.runs.many_results import Runs

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
    # The table of several results has a row for each result if their class has the function
    # `rows`. Otherwise each result has a table, and these tables are joined.
    is_sequence = isinstance(result, list | tuple | ResultList)
    members = list(result) if is_sequence else [result]
    known = presentations().get(type(members[0]).__name__) if members else None
    if is_sequence and (known is None or known.rows is None):
        return _joined([_identified(member, to_dict(member, units)) for member in members])
    output_units = parse_output_units(units) if units else SI
    if units and known is not None and known.only_si:
        raise UsageError(known.only_si)
    values = _values(members, output_units)
    row_count = max((len(value) for _, value in values if isinstance(value, np.ndarray)), default=1)
    columns: dict[str, Any] = {}
    for column, value in values:
        name, factor = output_units.column(column.name, column.unit)
        columns[name] = _cells(value, factor, row_count)
    return columns


def _identified(result: Any, table: dict[str, Any]) -> dict[str, Any]:
    """Return the table of a response after its method and time step (s), which identify its rows in
    a joined table; other tables are returned unchanged."""
    if type(result).__name__ not in ("Response", "ResponseWithHistory"):
        return table
    count = len(next(iter(table.values())))
    return {"method": [result.method] * count, "dt_s": np.full(count, result.dt)} | table


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
    columns, members = to_dict(result), result if isinstance(result, ResultList) else [result]
    descriptions = describe(column for column, _ in _values(list(members)))
    write_files({Path(file): parquet(columns, descriptions)}, overwrite=True)


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
    varied = varied_columns(si_units_of(runs.varied, runs.models))
    run_columns = [*RUN_COORDINATES, *(column.name for column in varied)]
    coordinates: dict[str, Any] = {name: ("run", table[name]) for name in run_columns}
    coordinates |= {
        "run": np.arange(len(runs.model)),
        "story": 1 + np.arange(runs.stories.peak_drift.shape[1]),
    }
    # Each variable is a tuple of its dimensions, its values and its attributes.
    variables: dict[str, Any] = {}
    for quantity in STORY_QUANTITIES:
        attributes = {"units": quantity.unit, "long_name": quantity.meaning}
        values = getattr(runs.stories, quantity.name)
        variables[quantity.name] = (("run", "story"), values, attributes)
        if runs.devices:
            values = getattr(runs.devices, quantity.name)
            variables[DEVICE + quantity.name] = (("run", "device"), values, attributes)
        if hasattr(runs.errors, quantity.name):
            errors = getattr(runs.errors, quantity.name)
            variables[f"{quantity.name}_error"] = (
                ("run", "story"),
                errors,
                {"units": quantity.unit},
            )
    for name, values in runs.history.items():
        last = "element" if name == ELEMENT_FORCE else "story"
        last = "device" if name.startswith(DEVICE) else last
        units = _HISTORY_UNITS[name.removeprefix(DEVICE)]
        variables[name] = ("run", "time", last), values, {"units": units}
    if runs.history:
        # Times that differ between runs cannot be a coordinate of the axis `time`.
        if len(runs.time) == 1:
            coordinates["time"] = ("time", runs.time[0])
        else:
            coordinates["times"] = (("run", "time"), runs.time)
    return xarray.Dataset(variables, coordinates)


def history_to_xarray(history: History) -> Any:
    """Return a response history as an `xarray.Dataset`, with the dimensions time and story.

    Raises
    ------
    UsageError
        xarray is not installed.
    """
    xarray = import_optional("xarray", "to_xarray")
    stories = history.rows or 1 + np.arange(history.drift.shape[1])
    coordinates: dict[str, Any] = {"time": ("time", history.time, {"units": "s"})}
    coordinates["story"] = ("story", np.array(stories))
    variables: dict[str, Any] = {}
    for name, unit in _HISTORY_UNITS.items():
        values = getattr(history, name)
        if values is not None:
            dimensions = ("time", "element" if name == ELEMENT_FORCE else "story")
            variables[name] = dimensions[: values.ndim], values, {"units": unit}
    for name in ENERGY_TERMS:
        variables[f"energy_{name}"] = "time", getattr(history.energy, name), {"units": "J"}
    if history.element_force is not None:
        coordinates["element"] = ("element", np.array(history.element_labels))
    if history.devices is not None:
        names = [*history.devices.attachments, *history.devices.links]
        coordinates["device"] = ("device", np.array(names))
        for name, values in vars(history.devices).items():
            if name in _HISTORY_UNITS:
                attributes = {"units": _HISTORY_UNITS[name]}
                variables[f"{DEVICE}{name}"] = ("time", "device"), values, attributes
    del variables["time"]
    return xarray.Dataset(variables, coordinates)


RUN_COORDINATES = ("building", "record", "component", "method", "scale", "dt_s", "status", "steps")
"""Coordinates of a run in addition to its number."""

_HISTORY_UNITS = {quantity.name: quantity.unit for quantity in quantities(History)} | {
    ELEMENT_FORCE: "N"
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
    table = f"<table><caption>{escape(caption)}</caption><tr>{head}</tr>{body}</table>{more_text}"
    return write_out_controls(table)


def _cell(value: Any) -> str:
    """Return a cell of the table of a notebook as text, with 5 significant digits."""
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else format(value + 0.0, f".{_DIGITS}g")
    return "" if value is None else str(value)


def _values(members: list[Any], units: OutputUnits = SI) -> list[tuple[Column, Any]]:
    """Return the columns of the table of a result, each with its values: an array, a list with
    text, or a single value that applies to all rows. UsageError is raised if the result has no
    table. `members` are several results only if their class has the function `rows`, which receives
    `units`.
    """
    # The table of a base class applies to subclasses without a separate table.
    first = members[0]
    for result_class in type(first).__mro__:
        known = presentations().get(result_class.__name__)
        if known is not None and known.columns is not None:
            return [(column, column.of(first)) for column in known.columns(first)]
        if known is not None and known.table is not None:
            table = known.table(first)
            return table.by_column() if isinstance(table, Table) else table
        if known is not None and known.rows is not None:
            return known.rows(members, units).by_column()
    raise UsageError(f"a result of the type {type(first).__name__} has no table")
