"""JSON summaries of comparisons with recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tdint.model.definition import Model
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.studies.recordings.compare import Comparison
    from tdint.studies.recordings.fit import Fit
from tdint.output.summary import input_of, inputs_summary, model_input, schema, versions


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
    from tdint.studies.recordings.comparison_tables import comparison_table, fitted_table

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
    from tdint.studies.recordings.compare import absolute_displacements

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
        "notes": [*event.notes, *response.notes],
        "warnings": [*event.warnings, *response.warnings, *absolute_displacements(comparison)],
    }
