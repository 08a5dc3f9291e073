"""Table of drift spectra."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.output.tables import columns
from tdint.output.tables.table import Table
from tdint.output.tables.tables import record_table

if TYPE_CHECKING:
    from tdint.analysis.spectra.drift import DriftSpectrum


def drift_spectrum_table(spectra: Sequence[DriftSpectrum]) -> Table:
    """One row per record, component, damping ratio and period, in the order given; no story for a beam."""
    return record_table(columns.DRIFT_SPECTRUM, spectra)
