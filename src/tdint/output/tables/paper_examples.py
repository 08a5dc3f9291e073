"""Errors of methods on the paper's examples as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.output.tables import columns
from tdint.output.tables.table import Table

if TYPE_CHECKING:
    from tdint.analysis.assessment.paper_examples import ExampleRun


def example_table(runs: Sequence[ExampleRun]) -> Table:
    """One row per example, step, method and variant; methods are ranked by the displacement's error, best first."""
    return Table.of_results((*columns.EXAMPLE, columns.rank(lambda one: _rank(one, runs)), columns.OUTCOME), runs)


def _rank(one: ExampleRun, runs: Sequence[ExampleRun]) -> int | None:
    """Place among the methods as they are; none for a variant and for a run without an end."""
    error = one.error("displacement")
    if one.variant or math.isnan(error):
        return None
    rivals = [run for run in runs if (run.example, run.dt, run.variant) == (one.example, one.dt, "")]
    return 1 + sum(run.error("displacement") < error for run in rivals)
