"""Summary of a comparison: what was recorded and computed, how well they agree, and what was fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tdint.analysis.comparison.compare import absolute_displacements
from tdint.output.summaries.summary import input_of, inputs_summary, model_input, schema, versions
from tdint.output.tables.buildings import comparison_table, fitted_table
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.comparison.compare import Comparison
    from tdint.analysis.comparison.fit import Fit
    from tdint.model.definition import Model


def comparison_summary(
    model: Model,
    comparisons: Sequence[Comparison],
    fitted: Fit | None,
    settings: Mapping[str, Any],
    units: OutputUnits = SI,
) -> dict[str, Any]:
    """Content of the JSON file beside the table.

    Parameters
    ----------
    model : Model
        As it was read.
    comparisons : sequence of Comparison
        The event that was asked for, then those it was not fitted to.
    fitted : Fit or None
        What was fitted to the first one.
    settings : mapping
        Settings of the command line.
    units : OutputUnits
        Of the fitted values, whose names say them; the keys' units are those of `in_units`.
    """
    return {
        "schema": schema("compare"),
        "name": model.name,
        "events": [_event(one) for one in comparisons],
        "fit": _fit(fitted, units),
        "settings": dict(settings),
        "inputs": inputs_summary([model_input(model), *(file for one in comparisons for file in _inputs(one))]),
        "columns": comparison_table(comparisons).meanings,
        "versions": versions(),
    }


def _inputs(one: Comparison) -> list[Any]:
    return [input_of(one.event.recording.source, one.event.recording.text), *one.event.inputs]


def _event(one: Comparison) -> dict[str, Any]:
    event, response = one.event, one.response
    return {
        "name": event.recording.name,
        "method": response.method,
        "dt_s": response.dt,
        "status": response.status,
        "base": {"dt_s": event.base.dt, "samples": event.count, "pga_m_s2": event.base.pga},
        "band_hz": list(event.recording.band) if event.recording.band else None,
        "window_s": list(event.recording.window) if event.recording.window else None,
        "shift_s": one.shift,
        "floors": [
            {
                "floor": floor.floor,
                "quantity": floor.quantity,
                "samples": floor.time.size,
                "correlation": floor.correlation,
                "peak_ratio": floor.peak_ratio,
                "rms_difference": floor.rms_difference,
            }
            for floor in one.floors
        ],
        "notes": [*event.notes, *response.notes],
        "warnings": [*event.warnings, *response.warnings, *absolute_displacements(one)],
    }


def _fit(fitted: Fit | None, units: OutputUnits) -> dict[str, Any] | None:
    if fitted is None:
        return None
    table = fitted_table(fitted.values, units)
    values = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    return {"runs": fitted.runs, "values": values, "notes": list(fitted.notes), "columns": table.meanings}
