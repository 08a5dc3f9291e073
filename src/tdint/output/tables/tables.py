"""Tables of a run, of spectra, modes and methods."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from tdint.ground_motion.record import component_names
from tdint.output.tables import columns
from tdint.output.tables.table import Cell, Column, Table, rows_of
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import History, StoryErrors, StoryPeaks
    from tdint.analysis.spectra.elastic import Spectrum
    from tdint.analysis.spectra.published import SpectrumDifference
    from tdint.analysis.spectra.rotated import RotatedSpectrum
    from tdint.methods.method import Integrator
    from tdint.model.modes import Modes

Array = NDArray[np.float64]

_ROWS_AT_ONCE = 256


def story_table(stories: StoryPeaks, errors: StoryErrors | None = None) -> Table:
    """One row per story, from the ground up; with errors a column `<name>_error` for each peak, after all peaks."""
    rows = rows_of(columns.STORY, stories)
    if errors is None:
        return Table.of(columns.STORY, rows)
    both = [peaks + of for peaks, of in zip(rows, rows_of(columns.STORY_ERROR, errors), strict=True)]
    return Table.of((*columns.STORY, *columns.STORY_ERROR), both)


def record_table(own: Sequence[Column], results: Sequence[Any]) -> Table:
    """The rows of results that are each of one record, after the record's name and component."""
    names = component_names([result.record for result in results])
    rows: list[tuple[Cell, ...]] = []
    for result, name in zip(results, names, strict=True):
        rows.extend((result.record.source, name, *row) for row in rows_of(own, result))
    return Table.of((*columns.OF_RECORD, *own), rows)


def spectrum_table(spectra: Sequence[Spectrum], stated: Sequence[str] = ()) -> Table:
    """One row per record, component, damping ratio and period, in the order given.

    `stated`: which of the choices `maxima` and `interpolation` have columns of their own, at the end.
    """
    return record_table((*columns.SPECTRUM, *_choices(stated)), spectra)


def difference_table(lines: Sequence[SpectrumDifference]) -> Table:
    """One row per record, component, damping ratio and period: computed and published values and their difference."""
    from tdint.analysis.spectra.published import QUANTITIES

    return record_table(columns.difference(QUANTITIES[lines[0].published.quantity][1]), lines)


def rotated_table(spectra: Sequence[RotatedSpectrum], stated: Sequence[str] = ()) -> Table:
    """One row per motion, damping ratio and period, a column per percentile; `stated` as for `spectrum_table`."""
    own = (*columns.rotated(spectra[0].percentiles), *_choices(stated))
    return Table.of_results((*columns.OF_MOTION, *own), spectra)


def _choices(stated: Sequence[str]) -> list[Column]:
    choices = {column.name: column for column in columns.CHOICES}
    return [choices[name] for name in stated]


def method_table(integrators: Iterable[Integrator]) -> Table:
    """One row per method with its parameters' defaults and ranges; the other values are those at the defaults."""
    return Table.of_results(columns.METHOD, integrators)


def mode_table(modes: Modes, damping: Array | None) -> Table:
    """One row per mode, longest period first; empty cells for damping ratios (shape (n,)) that are None."""
    ratios = np.full_like(modes.omega, np.nan) if damping is None else damping
    return Table.of_results((*columns.MODE, columns.mode_damping(ratios), *columns.MODE_END), [modes])


def history_columns(stories: int) -> tuple[str, ...]:
    """Columns of a history."""
    places = range(1, stories + 1)
    return (
        *(column.name for column in columns.HISTORY_START),
        *(f"floor_{i}_{column.name}" for i in places for column in columns.HISTORY_FLOOR),
        *(f"story_{i}_{column.name}" for i in places for column in columns.HISTORY_STORY),
        *(column.name for column in columns.HISTORY_ENERGY),
    )


def write_history(history: History, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write a history as CSV, one row per step; some hundred rows are held as text at a time."""
    header = [units.column(name) for name in history_columns(history.displacement.shape[1])]
    stream.write((",".join(name for name, _ in header) + "\n").encode())
    factors = None if units == SI else np.array([factor for _, factor in header])
    line = ",".join(["%.12g"] * len(header)) + "\n"
    start, floors, springs, energies = (
        [column.of(history) for column in group]
        for group in (
            columns.HISTORY_START, columns.HISTORY_FLOOR, columns.HISTORY_STORY, columns.HISTORY_ENERGY,
        )
    )  # fmt: skip
    for first in range(0, len(history.time), _ROWS_AT_ONCE):
        part = slice(first, first + _ROWS_AT_ONCE)
        groups = [np.stack([values[part] for values in group], axis=2) for group in (floors, springs)]
        table = np.column_stack(
            [
                *(values[part] for values in start),
                *(group.reshape(len(group), -1) for group in groups),
                *(values[part] for values in energies),
            ]
        )
        if factors is not None:
            table /= factors
        table += 0.0  # zero has no sign
        text = line * len(table) % tuple(table.ravel().tolist())
        stream.write((text.replace("nan", "") if np.isnan(table).any() else text).encode("ascii"))
