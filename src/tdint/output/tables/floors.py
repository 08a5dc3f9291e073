"""Table of floor spectra."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.output.tables import columns
from tdint.output.tables.table import Table, rows_of

if TYPE_CHECKING:
    from tdint.analysis.spectra.floors import FloorSpectrum


def floor_spectrum_table(spectra: Sequence[FloorSpectrum]) -> Table:
    """A row per floor, damping ratio and period, in the order given."""
    rows = [(one.floor, *row) for one in spectra for row in rows_of(columns.SPECTRUM, one.spectrum)]
    return Table.of((columns.FLOOR, *columns.SPECTRUM), rows)
