"""Table of the failures of methods."""

from __future__ import annotations

from tdint.output.tables.methods import _without_commas
from tdint.output.tables.table import METHOD_SPEC, TEXT, Column

FAILURE = (
    Column.named("problem", "problem", TEXT),
    METHOD_SPEC,
    Column.named("dt", "time step", "s"),
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
