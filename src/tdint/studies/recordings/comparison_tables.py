"""Tables and JSON summaries of comparisons of computed with recorded responses, and of fitted
parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from tdint.arrays import Array
from tdint.model.definition import Model
from tdint.output.summary import input_of, inputs_summary, model_input, schema, versions
from tdint.output.tables.buildings import COMPARISON_SPECTRA, of_event
from tdint.output.tables.table import FLOOR, Column, Table
from tdint.studies.columns import declared
from tdint.studies.recordings.compare import Comparison
from tdint.studies.recordings.fit import Fit, FittedValue
from tdint.units import SI, OutputUnits

COMPARISON = (FLOOR, *declared("compare.comparison"))

FITTED = declared("compare.fitted")


def comparison_table(comparisons: Sequence[Comparison]) -> Table:
    """Return the table that compares computed with recorded floor responses, with a row per
    floor and quantity. With several events, the last column is the file of the recordings."""
    return _by_event(COMPARISON, [(comparison, comparison.floors) for comparison in comparisons])


def comparison_spectra_table(
    comparisons: Sequence[Comparison], periods: Array, damping: float
) -> Table:
    """Return the table of computed and recorded floor spectra, with a row per floor and period.

    With several events, the last column is the file of the recordings.

    Parameters
    ----------
    comparisons : sequence of Comparison
        Comparisons of a computed with a recorded response, one for each event.
    """
    return _by_event(
        COMPARISON_SPECTRA,
        [(comparison, comparison.spectra(periods, damping)) for comparison in comparisons],
    )


def fitted_table(values: Sequence[FittedValue], units: OutputUnits = SI) -> Table:
    """Return the table of fitted parameters, with a row per value; the name of a parameter
    contains its unit."""
    return Table.of_results(FITTED, [fitted_in(value, units) for value in values])


def fitted_in(value: FittedValue, units: OutputUnits) -> FittedValue:
    """Convert a fitted value, its bounds and its standard error from SI to other units; its name
    then ends with the new unit."""
    name, factor = units.column(value.name, value.unit)
    numbers = {
        key: getattr(value, key) / factor
        for key in ("start", "value", "low", "high", "standard_error")
    }
    return replace(value, name=name, **numbers)


def _by_event(
    columns: Sequence[Column], events: Sequence[tuple[Comparison, Sequence[object]]]
) -> Table:
    """Return the rows of several results for each event. If there are several events, the last
    column is the file of the recordings.

    `events` is the comparison with the recordings of each event, and the results of the event.
    """
    tables = []
    for comparison, results in events:
        last = (of_event(comparison.event.recording.source),) if len(events) > 1 else ()
        tables.append(Table.of_results((*columns, *last), results))
    return tables[0]._replace(rows=[row for table in tables for row in table.rows])


def comparison_summary(
    model: Model,
    comparisons: Sequence[Comparison],
    fitted: Fit | None,
    settings: Mapping[str, Any],
    units: OutputUnits = SI,
) -> dict[str, Any]:
    """Return the content of the JSON file of a comparison with recordings.

    Parameters
    ----------
    comparisons : sequence of Comparison
        The selected event first, then the events that were not used for the fit.
    fitted : Fit | None
        Result of the fit to the first event.
    units : OutputUnits
        Units of the fitted values, which are included in their names; SI by default. Other keys are
        converted by `in_units`.
    """
    # The fitted values are stored with their descriptions, because their names depend on the units.
    fit: dict[str, Any] | None = None
    if fitted is not None:
        table = fitted_table(fitted.values, units)
        fit = {
            "runs": fitted.runs,
            "values": table.as_dictionaries(),
            "notes": list(fitted.notes),
            "columns": table.meanings,
        }
    inputs = [model_input(model)]
    for event in (comparison.event for comparison in comparisons):
        inputs += [input_of(event.recording.source, event.recording.text), *event.inputs]
    return {
        "schema": schema("compare"),
        "name": model.name,
        "events": [_event(comparison) for comparison in comparisons],
        "fit": fit,
        "settings": dict(settings),
        "inputs": inputs_summary(inputs),
        "columns": comparison_table(comparisons).meanings,
        "versions": versions(),
    }


def _event(comparison: Comparison) -> dict[str, Any]:
    """Return the part of a JSON file about one event of a comparison with recordings: its settings
    and the agreement of the responses on each floor."""
    from tdint.methods.catalogue import resolved

    event, response = comparison.event, comparison.response
    return {
        "name": event.recording.name,
        "method": response.method,
        "method_parameters": resolved(response.method),
        "dt_s": response.dt,
        "status": response.status,
        "base": {"dt_s": event.base.dt, "samples": event.count, "pga_m_s2": event.base.pga},
        "band_hz": list(event.recording.band) if event.recording.band else None,
        "window_s": list(event.recording.window) if event.recording.window else None,
        "shift_s": comparison.shift,
        "floors": [
            {"floor": floor.floor, "quantity": floor.quantity, "samples": floor.time.size}
            | {
                name: getattr(floor, name)
                for name in ("correlation", "peak_ratio", "rms_difference")
            }
            for floor in comparison.floors
        ],
        "notes": list(comparison.notes),
        "warnings": comparison.warnings,
    }
