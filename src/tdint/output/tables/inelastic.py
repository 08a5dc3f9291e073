"""Table of inelastic spectra."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.output.tables import columns
from tdint.output.tables.table import Table
from tdint.output.tables.tables import record_table

if TYPE_CHECKING:
    from tdint.analysis.spectra.inelastic import InelasticSpectrum


def inelastic_table(spectra: Sequence[InelasticSpectrum]) -> Table:
    """One row per record, component, damping ratio, ductility or strength, and period, in the order given."""
    return record_table(columns.INELASTIC, spectra)
