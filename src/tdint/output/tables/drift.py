"""Table of drift spectra, and what it needs of one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.output.tables.tables import Cell, Table, component_names

if TYPE_CHECKING:
    from tdint.analysis.spectra.drift import DriftSpectrum

DRIFT_SPECTRUM_COLUMNS = (
    "record",
    "component",
    "damping",
    "period_s",
    "height_m",
    "peak_drift_ratio",
    "story",
    "roof_drift_ratio",
)


def drift_spectrum_table(spectra: Sequence[DriftSpectrum]) -> Table:
    """One row per record, component, damping ratio and period, in the order given; no story for a beam."""
    names = component_names([spectrum.record for spectrum in spectra])
    rows: list[tuple[Cell, ...]] = []
    for spectrum, name in zip(spectra, names, strict=True):
        columns = (
            spectrum.periods.tolist(),
            spectrum.heights.tolist(),
            spectrum.peak_drift_ratio.tolist(),
            [story or None for story in spectrum.story.tolist()],
            spectrum.roof_drift_ratio.tolist(),
        )
        rows.extend((spectrum.record.source, name, spectrum.damping, *values) for values in zip(*columns, strict=True))
    return Table(DRIFT_SPECTRUM_COLUMNS, rows)
