"""Table of inelastic spectra, and what it needs of one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tdint.ground_motion.record import Record
from tdint.output.results import Array
from tdint.output.tables.tables import Cell, Table, component_names

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


class InelasticResult(Protocol):
    """Response of bilinear oscillators to one record; arrays of shape (k,), SI units. `target` is the ductility that
    was asked for, None for given strengths."""

    @property
    def record(self) -> Record: ...
    @property
    def damping(self) -> float: ...
    @property
    def hardening(self) -> float: ...
    @property
    def target(self) -> float | None: ...
    @property
    def periods(self) -> Array: ...
    @property
    def yield_strength_ratio(self) -> Array: ...
    @property
    def ductility(self) -> Array: ...
    @property
    def residual(self) -> Array: ...
    @property
    def sd(self) -> Array: ...
    @property
    def yield_displacement(self) -> Array: ...
    @property
    def yield_acceleration(self) -> Array: ...
    @property
    def reduction_factor(self) -> Array: ...


def inelastic_table(spectra: Sequence[InelasticResult]) -> Table:
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
