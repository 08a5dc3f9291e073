"""Table of the validation cases."""

from __future__ import annotations

from tdint.output.tables.methods import _without_commas
from tdint.output.tables.table import TEXT, Column

VALIDATION = (
    Column("case", "text", "case.name", "name of the case"),
    Column("what", "text", _without_commas("case.title"), "subject of the case"),
    Column("source", "text", _without_commas("case.source"), "source of the published numbers"),
    Column(
        "numbers",
        "1",
        lambda result: len(result.case.published),
        "number of compared published numbers",
    ),
    Column("unit", "text", _without_commas("case.unit"), "unit of the numbers"),
    Column.named(
        "case.relative", "true if differences are relative to the published numbers", TEXT
    ),
    Column(
        "largest_difference",
        "1",
        "largest",
        "maximum difference between computed and published numbers",
    ),
    Column.named("case.tolerance", "maximum allowed difference"),
    Column(
        "difference_is",
        "text",
        _without_commas("case.difference_is"),
        "cause of the difference: rounding of the source, numerical error or model error",
    ),
    Column.named("within", "true if all differences are within the tolerance", TEXT),
)
