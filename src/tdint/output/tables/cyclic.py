"""Table of a cyclic test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tdint.output.tables.tables import Cell, Table

if TYPE_CHECKING:
    from tdint.analysis.run.cyclic import CyclicTest

CYCLIC_COLUMNS = (
    "story",
    "step",
    "cycle",
    "drift_m",
    "drift_ratio",
    "shear_N",
    "shear_with_p_delta_N",
    "tangent_stiffness_N_m",
    "recoverable_energy_J",
    "dissipated_energy_J",
)


def cyclic_table(test: CyclicTest) -> Table:
    """One row per point of the path; row 0 is the start at rest."""
    path = test.path
    columns = (
        test.cycle_numbers,
        path.drift,
        path.drift / test.height,
        path.shear,
        test.shear_with_p_delta,
        path.tangent,
        path.recoverable,
        path.dissipated,
    )
    values = zip(*(column.tolist() for column in columns), strict=True)
    rows: list[tuple[Cell, ...]] = [(test.story, step, *row) for step, row in enumerate(values)]
    return Table(CYCLIC_COLUMNS, rows)
