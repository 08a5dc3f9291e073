"""Table of a cyclic test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tdint.output.tables import columns
from tdint.output.tables.table import Table

if TYPE_CHECKING:
    from tdint.analysis.static.cyclic import CyclicTest


def cyclic_table(test: CyclicTest) -> Table:
    """One row per point of the path; row 0 is the start at rest."""
    return Table.of_results(columns.CYCLIC, [test])
