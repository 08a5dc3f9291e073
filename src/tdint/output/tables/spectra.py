"""Tables of spectra: elastic ones, over all directions, inelastic, of drifts and floors, beside published ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tdint.ground_motion.record import component_names
from tdint.output.tables.columns import spectra as columns
from tdint.output.tables.columns.shared import FLOOR, OF_RECORD
from tdint.output.tables.table import Cell, Column, Table, rows_of

if TYPE_CHECKING:
    from tdint.analysis.spectra.drift import DriftSpectrum
    from tdint.analysis.spectra.elastic import Spectrum
    from tdint.analysis.spectra.floors import FloorSpectrum
    from tdint.analysis.spectra.inelastic import InelasticSpectrum
    from tdint.analysis.spectra.published import SpectrumDifference
    from tdint.analysis.spectra.rotated import RotatedSpectrum


def record_table(own: Sequence[Column], results: Sequence[Any]) -> Table:
    """The rows of results that are each of one record, after the record's name and component."""
    names = component_names([result.record for result in results])
    rows: list[tuple[Cell, ...]] = []
    for result, name in zip(results, names, strict=True):
        rows.extend((result.record.source, name, *row) for row in rows_of(own, result))
    return Table.of((*OF_RECORD, *own), rows)


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


def inelastic_table(spectra: Sequence[InelasticSpectrum]) -> Table:
    """One row per record, component, damping ratio, ductility or strength, and period, in the order given."""
    return record_table(columns.INELASTIC, spectra)


def drift_spectrum_table(spectra: Sequence[DriftSpectrum]) -> Table:
    """One row per record, component, damping ratio and period, in the order given; no story for a beam."""
    return record_table(columns.DRIFT_SPECTRUM, spectra)


def floor_spectrum_table(spectra: Sequence[FloorSpectrum]) -> Table:
    """A row per floor, damping ratio and period, in the order given."""
    rows = [(one.floor, *row) for one in spectra for row in rows_of(columns.SPECTRUM, one.spectrum)]
    return Table.of((FLOOR, *columns.SPECTRUM), rows)
