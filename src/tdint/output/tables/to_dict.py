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
from tdint.analysis.run.outcome import STORY, History
from tdint.errors import UsageError
from tdint.files import write_files
from tdint.output.tables import buildings, campaign, methods, responses, spectra, studies
from tdint.output.tables.table import FLOOR, OF_RECORD, Column, Table, columns_of, describe, parquet
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
        function; also the response history of a run, a record, or several results of one type.
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
    if (
        isinstance(result, list | tuple | ResultList)
        and type(result[0] if len(result) else None).__name__ not in _IN_ROWS
    ):
        return _joined([to_dict(item, units) for item in result])
    output_units = parse_output_units(units) if units else SI
    if units and type(result).__name__ == "Gradient":
        raise UsageError("derivatives are in SI units: units cannot be selected for a gradient")
    values = _values(result)
    # A value that is not an array applies to all rows.
    size = max((len(value) for _, value in values if isinstance(value, np.ndarray)), default=1)
    tables: dict[str, Any] = {}
    for column, value in values:
        renamed, factor = output_units.column(column.name, column.unit)
        if isinstance(value, np.ndarray):
            is_text = value.dtype.kind == "U"
            tables[renamed] = (
                value.tolist() if is_text else value if factor == 1.0 else value / factor
            )
        elif isinstance(value, list | str):
            tables[renamed] = [value] * size if isinstance(value, str) else value
        else:
            tables[renamed] = np.full(
                size, np.nan if value is None else value if factor == 1.0 else value / factor
            )
    return tables


def _joined(tables: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Concatenate the columns of several tables.

    Raises
    ------
    UsageError
        There are no tables, or their columns differ.
    """
    if not tables or any(table.keys() != tables[0].keys() for table in tables):
        raise UsageError("a table needs one or more results of the same type")
    return {
        name: [cell for table in tables for cell in table[name]]
        if isinstance(first, list)
        else np.concatenate([table[name] for table in tables])
        for name, first in tables[0].items()
    }


def to_parquet(result: Any, file: str | Path) -> None:
    """Write the table of a result; see `Tabular.to_parquet`."""
    about = describe(column for column, _ in _values(result))
    write_files({Path(file): parquet(to_dict(result), about)}, overwrite=True)


def to_xarray(runs: Runs) -> Any:
    """Return runs as an xarray data set; see `Runs.to_xarray`."""
    xarray = import_optional("xarray", "to_xarray")
    table = to_dict(runs)
    along = [*OF_RUN, *(column.name for column in campaign.varied_columns(runs.varied))]
    coordinates: dict[str, Any] = {name: ("run", table[name]) for name in along}
    coordinates |= {
        "run": np.arange(len(runs.model)),
        "story": 1 + np.arange(runs.stories.peak_drift.shape[1]),
    }
    variables: dict[str, Any] = {}
    for story_quantity in STORY:
        about = {"units": story_quantity.unit, "long_name": story_quantity.meaning}
        variables[story_quantity.name] = (
            ("run", "story"),
            getattr(runs.stories, story_quantity.name),
            about,
        )
        if hasattr(runs.errors, story_quantity.name):
            errors = getattr(runs.errors, story_quantity.name)
            variables[f"{story_quantity.name}_error"] = (
                ("run", "story"),
                errors,
                {"units": story_quantity.unit},
            )
    for name, values in runs.history.items():
        variables[name] = ("run", "time", "story"), values, {"units": _HISTORY_UNITS[name]}
    if runs.history:
        # Times that differ between runs cannot be an axis.
        alike = len(runs.time) == 1
        coordinates["time" if alike else "times"] = (
            ("time", runs.time[0]) if alike else (("run", "time"), runs.time)
        )
    return xarray.Dataset(variables, coordinates)


OF_RUN = ("building", "record", "component", "method", "scale", "dt_s", "status", "steps")
"""Coordinates of a run in addition to its number."""

_HISTORY_UNITS = {
    quantity.called or quantity.name: quantity.unit for quantity in quantities(History)
}


def to_html(result: Any, caption: str) -> str:
    """Return the first rows of a result's table as HTML."""
    tables = to_dict(result)
    size = len(next(iter(tables.values())))
    head = "".join(f"<th>{escape(name)}</th>" for name in tables)
    rows = (
        [escape(_cell(values[row])) for values in tables.values()]
        for row in range(min(size, _ROWS))
    )
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    # A table with thousands of rows would fill the notebook.
    more = f"<p>{size - _ROWS} more rows</p>" if size > _ROWS else ""
    return f"<table><caption>{escape(caption)}</caption><tr>{head}</tr>{body}</table>{more}"


def _cell(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else format(value + 0.0, f".{_DIGITS}g")
    return "" if value is None else str(value)


_Values = list[tuple[Column, Any]]

OF_RUNS: dict[str, Column] = {str(column.value): column for column in campaign.RUNS}
"""Columns of runs.csv by their attributes."""


def _values(result: Any) -> _Values:
    """Return each column with its values: an array, or a value that applies to all rows."""
    # Several results of a class without entry in _IN_ROWS were joined before this call.
    if isinstance(result, list | tuple | ResultList):
        return _in_rows(list(result))
    kinds = (kind.__name__ for kind in type(result).__mro__)
    values = next((_VALUES[kind] for kind in kinds if kind in _VALUES), None)
    if values is None:
        raise UsageError(f"{type(result).__name__} has no table")
    return values(result)


def _rows_of(columns: Sequence[Column]) -> Callable[[Sequence[Any]], Table]:
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
    return _IN_ROWS[type(results[0]).__name__](results).by_column()


def _of(columns: Sequence[Column], result: Any) -> _Values:
    return [(column, column.of(result)) for column in columns]


def _from(table: Callable[[Any], Table]) -> Callable[[Any], _Values]:
    return lambda result: table(result).by_column()


def _of_record(result: Any) -> _Values:
    return _of((*OF_RECORD, *columns_of(type(result))), result)


def _of_campaign(result: Any) -> _Values:
    with result.store as store:
        return campaign.runs_table(store).by_column()


def _of_runs(result: Runs) -> _Values:
    demands = {quantity.name: np.full(len(result.model), np.nan) for quantity in DEMANDED}
    # Arrays have space for the tallest building; the values above a lower building are nan.
    for number in range(len(result.models)):
        runs, stories = result.of_building(number)
        for name, column in demand_columns(stories).items():
            demands[name][runs] = column
    return [
        (OF_RUNS["building"], np.array([model.name for model in result.models])[result.model]),
        (OF_RUNS["record"], np.array([record.source for record in result.records])[result.record]),
        (
            OF_RUNS["component"],
            np.array([record.component for record in result.records])[result.record],
        ),
        (OF_RUNS["method"], np.array(result.methods)[result.model]),
        *zip(campaign.varied_columns(result.varied), result.varied.values(), strict=True),
        *(
            (OF_RUNS[name], getattr(result, name))
            for name in ("scale", "dt", "status", "energy_error", "steps")
        ),
        *((OF_RUNS[name], values) for name, values in demands.items()),
        *_estimated(result),
    ]


def _estimated(result: Runs) -> _Values:
    """Return the errors of the demands as in runs.csv."""
    if result.errors is None:
        return []
    rows = []
    for run, model in enumerate(result.model.tolist()):
        of_run = partial(_one, run=run, stories=len(result.models[model].stories))
        rows.append(demand_errors(of_run(result.stories), of_run(result.errors)))
    return list(zip(campaign.RUN_ERRORS, np.array(rows).T, strict=True))


def _one(values: Any, *, run: int, stories: int) -> Any:
    """Return the values of one run."""
    return type(values)(
        **{field.name: getattr(values, field.name)[run, :stories] for field in fields(values)}
    )


def _of_modes(result: Any) -> _Values:
    ratios = np.full_like(result.omega, np.nan) if result.damping is None else result.damping
    return _of((*buildings.MODE, buildings.mode_damping(ratios), *buildings.MODE_END), result)


def _of_history(result: History) -> _Values:
    """Return the columns of a response history with their values, as in the CSV file."""
    stories, error = result.displacement.shape[1], result.error is not None
    values: list[Any] = []
    for place, columns in responses.history_groups(error):
        arrays = [column.of(result) for column in columns]
        # Each floor or story has a column, in the order of the CSV file.
        values += [array[:, i] for i in range(stories) for array in arrays] if place else arrays
    return list(zip(responses.history_columns(stories, error), values, strict=True))


_VALUES: dict[str, Callable[[Any], _Values]] = {
    "CampaignRuns": _of_campaign,
    "Chart": _from(methods.chart_table),
    "Comparison": _from(lambda result: buildings.comparison_table([result])),
    "CyclicTest": partial(_of, buildings.CYCLIC),
    "FieldChart": _from(methods.profile_table),
    "FloorSpectrum": lambda result: _of([FLOOR], result) + _of(spectra.SPECTRUM, result.spectrum),
    "FragilityResult": _from(lambda result: studies.fragility_table(result.functions)),
    "Gradient": lambda result: _of(responses.gradient_columns(result), result),
    "History": _of_history,
    "IdaStudy": _from(studies.ida_table),
    "Match": _from(lambda result: spectra.match_table([result])),
    "ModalResponse": partial(_of, buildings.MODAL_RESPONSE),
    "Modes": _of_modes,
    "ObservedOrder": _from(lambda result: methods.order_table([result])),
    "Overshoot": partial(_of, methods.OVERSHOOT),
    "Pushover": lambda result: _of(buildings.pushover(result.drift.shape[1]), result),
    "Record": partial(_of, spectra.SAMPLES),
    "Response": _from(responses.response_table),
    "RotatedSpectrum": lambda result: _of(
        (*spectra.OF_MOTION, *spectra.rotated(result.percentiles)), result
    ),
    "Runs": _of_runs,
    "Scaling": _from(studies.factor_table),
    "StabilityCurve": partial(_of, methods.STABILITY),
    "StoryPeaks": partial(_of, responses.STORY_COLUMNS),
    "TargetDisplacement": partial(_of, buildings.TARGET_DISPLACEMENT),
}
_VALUES |= dict.fromkeys(("Fragility", "Overview", "RecordInfo"), lambda result: _in_rows([result]))
_VALUES |= dict.fromkeys(
    ("Spectrum", "InelasticSpectrum", "DriftSpectrum", "FourierSpectrum"), _of_record
)
"""Tables of a single result, by class name."""
