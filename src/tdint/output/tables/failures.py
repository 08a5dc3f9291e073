"""Table of the problems on which methods fail."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tdint.output.tables import columns
from tdint.output.tables.table import Table

if TYPE_CHECKING:
    from tdint.analysis.assessment.failures import Trial


def failure_table(trials: Iterable[Trial]) -> Table:
    """One row per problem, method and step."""
    return Table.of_results(columns.FAILURE, trials)
