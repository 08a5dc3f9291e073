"""The table of validation cases."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tdint.output.tables.table import Column, Table

if TYPE_CHECKING:
    from tdint.validation.case import ValidationResult

VALIDATION = (
    Column("case", "text", "case.name", "name of the case"),
    Column("what", "text", "case.title", "what it shows"),
    Column("source", "text", "case.source", "where its numbers come from"),
    Column("numbers", "1", lambda one: len(one.case.published), "how many numbers are compared"),
    Column("unit", "text", "case.unit", "unit of the numbers"),
    Column("relative", "text", "case.relative", "whether differences are over the published numbers"),
    Column("largest_difference", "1", "largest", "largest difference of computed from published numbers"),
    Column("tolerance", "1", "case.tolerance", "the largest difference that the case allows"),
    Column("difference_is", "text", "case.difference_is", "what differences are made of"),
    Column("within", "text", "within", "whether all numbers are within the tolerance"),
)


def validation_table(results: Iterable[ValidationResult]) -> Table:
    """One row per case."""
    return Table.of_results(VALIDATION, results)
