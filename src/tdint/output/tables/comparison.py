"""Tables of results beside recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tdint.output.tables.columns import buildings as columns
from tdint.output.tables.table import Cell, Column, Table, rows_of
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.comparison.compare import Comparison
    from tdint.analysis.comparison.fit import FittedValue

Array = NDArray[np.float64]


def comparison_table(comparisons: Sequence[Comparison]) -> Table:
    """A row per floor; of several events, the file of each in the last column."""
    return _by_event(columns.COMPARISON, [(one, one.floors) for one in comparisons])


def comparison_spectra_table(comparisons: Sequence[Comparison], periods: Array, damping: float) -> Table:
    """A row per floor and period; of several events, the file of each in the last column."""
    return _by_event(columns.COMPARISON_SPECTRA, [(one, one.spectra(periods, damping)) for one in comparisons])


def fitted_table(values: Sequence[FittedValue], units: OutputUnits = SI) -> Table:
    """A row per fitted value, whose name says its unit."""
    return Table.of_results(columns.FITTED, [fitted_in(value, units) for value in values])


def fitted_in(value: FittedValue, units: OutputUnits) -> FittedValue:
    """A fitted value in other units, with the name that goes with them."""
    name, factor = units.column(value.name)
    start, fitted, error = (number / factor for number in (value.start, value.value, value.standard_error))
    return replace(value, name=name, start=start, value=fitted, standard_error=error)


def _by_event(own: Sequence[Column], events: Sequence[tuple[Comparison, Sequence[object]]]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for one, results in events:
        every = (*own, columns.of_event(one.event.recording.source)) if len(events) > 1 else own
        rows += [row for result in results for row in rows_of(every, result)]
    return Table.of((*own, columns.of_event("")) if len(events) > 1 else own, rows)
