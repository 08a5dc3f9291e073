"""Table of inelastic spectra, and what it needs of one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.output.tables.tables import Cell, Table, component_names

if TYPE_CHECKING:
    from tdint.analysis.spectra.inelastic import InelasticSpectrum

INELASTIC_COLUMNS = (
    "record",
    "component",
    "damping",
    "hardening",
    "target_ductility",
    "period_s",
    "yield_strength_ratio",
    "ductility",
    "residual_m",
    "sd_m",
    "yield_sd_m",
    "yield_psa_m_s2",
    "reduction_factor",
)


def inelastic_table(spectra: Sequence[InelasticSpectrum]) -> Table:
    """One row per record, component, damping ratio, ductility or strength, and period, in the order given."""
    names = component_names([spectrum.record for spectrum in spectra])
    rows: list[tuple[Cell, ...]] = []
    for spectrum, name in zip(spectra, names, strict=True):
        columns = (
            spectrum.periods,
            spectrum.yield_strength_ratio,
            spectrum.ductility,
            spectrum.residual,
            spectrum.sd,
            spectrum.yield_displacement,
            spectrum.yield_acceleration,
            spectrum.reduction_factor,
        )
        start = (spectrum.record.source, name, spectrum.damping, spectrum.hardening, spectrum.target)
        rows.extend((*start, *values) for values in zip(*(column.tolist() for column in columns), strict=True))
    return Table(INELASTIC_COLUMNS, rows)
