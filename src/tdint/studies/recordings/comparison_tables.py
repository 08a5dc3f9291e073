"""Tables and JSON summaries of comparisons of computed with recorded responses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tdint.arrays import Array
from tdint.model.definition import Model
from tdint.output.summary import input_of, inputs_summary, model_input, schema, versions
from tdint.output.tables.table import FLOOR, PERIOD, Table, placeholder
from tdint.studies.columns import declared
from tdint.studies.recordings.compare import Comparison, FloorSpectra

COMPARISON = (FLOOR, *declared("compare.comparison"))

_spectra: FloorSpectra = placeholder()
COMPARISON_SPECTRA = (
    FLOOR,
    PERIOD,
    *declared(
        "compare.spectra",
        computed_sa_m_s2=_spectra.computed,
        recorded_sa_m_s2=_spectra.recorded,
    ),
)


def comparison_table(comparison: Comparison) -> Table:
    """Return the table that compares computed with recorded floor responses, with a row per
    floor and quantity."""
    return Table.of_results(COMPARISON, comparison.floors)


def comparison_spectra_table(comparison: Comparison, periods: Array, damping: float) -> Table:
    """Return the table of computed and recorded floor spectra, with a row per floor and period."""
    return Table.of_results(COMPARISON_SPECTRA, comparison.spectra(periods, damping))


def comparison_summary(
    model: Model, comparison: Comparison, settings: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the content of the JSON file of a comparison with recordings."""
    event = comparison.event
    recorded = input_of(event.recording.source, event.recording.text)
    inputs = [model_input(model), recorded, *event.inputs]
    return {
        "schema": schema("compare"),
        "name": model.name,
        "events": [_event(comparison)],
        "settings": dict(settings),
        "inputs": inputs_summary(inputs),
        "columns": comparison_table(comparison).meanings,
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
