"""Tables of comparisons of computed with recorded responses, and of fitted parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from tdint.arrays import Array
from tdint.output.tables.table import FLOOR, TEXT, Cell, Column, Table, rows_of
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.studies.recordings.compare import Comparison
    from tdint.studies.recordings.fit import FittedValue
from tdint.output.tables.buildings import COMPARISON_SPECTRA, of_event

COMPARISON = (
    FLOOR,
    Column.named("quantity", "absolute acceleration, or displacement relative to the base", TEXT),
    Column.named(
        "correlation", "Pearson correlation coefficient of the computed and the recorded response"
    ),
    Column.named(
        "peak_ratio",
        "maximum absolute computed value divided by the maximum absolute recorded value",
    ),
    Column.named(
        "rms_difference",
        "root mean square of the difference divided by the root mean square of the recording",
    ),
)

FITTED = (
    Column("parameter", "text", "name", "fitted parameter, with its unit"),
    Column(
        "place",
        "1",
        "number",
        "story or mode of the parameter, from 1; empty if it applies to the whole building",
    ),
    Column.named("start", "value in the model file"),
    Column("fitted", "1", "value", "value with the best agreement with the recording"),
    Column("lower_bound", "1", "low", "lower bound of the fit"),
    Column("upper_bound", "1", "high", "upper bound of the fit"),
    Column.named(
        "standard_error",
        "standard error of the fitted value if the differences are independent; inf: unknown",
    ),
)


def comparison_table(comparisons: Sequence[Comparison]) -> Table:
    """Return the table that compares computed with recorded floor responses, with one row per
    floor and quantity. With several events, the last column is the file of the recordings."""
    return _by_event(COMPARISON, [(comparison, comparison.floors) for comparison in comparisons])


def comparison_spectra_table(
    comparisons: Sequence[Comparison], periods: Array, damping: float
) -> Table:
    """Return the table of computed and recorded floor spectra, with one row per floor and period.

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
    """Return the table of fitted parameters, with one row per value; the name of a parameter
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
    has_event_column = len(events) > 1
    rows: list[tuple[Cell, ...]] = []
    for comparison, results in events:
        all_columns = list(columns)
        if has_event_column:
            all_columns.append(of_event(comparison.event.recording.source))
        for result in results:
            rows += rows_of(all_columns, result)
    return Table.of((*columns, of_event("")) if has_event_column else columns, rows)
