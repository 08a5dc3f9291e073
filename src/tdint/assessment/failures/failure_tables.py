"""Table of the failures of methods."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tdint.output.tables.table import METHOD_SPEC, TEXT, Column, Table

if TYPE_CHECKING:
    from tdint.assessment.failures.failures import Trial
from tdint.output.tables.methods import _without_commas

FAILURE = (
    Column.named("problem", "problem", TEXT),
    METHOD_SPEC,
    Column("dt_s", "s", "dt", "time step"),
    Column.named(
        "energy_ratio_min", "minimum energy divided by the maximum energy of the exact motion"
    ),
    Column.named(
        "energy_ratio_max", "maximum energy divided by the maximum energy of the exact motion"
    ),
    Column.named("error", "error of the quantity in error_of"),
    Column.named("outcome", "status with which `tdint run` ends", TEXT),
    Column.named("verdict", "pass, the detected defect, or the type of failure", TEXT),
    Column("end_s", "s", "time", "last time reached"),
    Column("error_of", "text", _without_commas("error_of"), "quantity of the error"),
)


def failure_table(trials: Iterable[Trial]) -> Table:
    """Return the table of the results of methods for problems with known solutions, as reported by
    `tdint failures`, with one row per problem, method and time step."""
    return Table.of_results(FAILURE, trials)
