"""The table of validation cases."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tdint.output.tables.table import Column, Table

if TYPE_CHECKING:
    from tdint.validation.case import ValidationResult

VALIDATION = (
    Column("case", "case.name", "name of the case", text=True),
    Column("what", "case.title", "what it shows", text=True),
    Column("source", "case.source", "where its numbers come from", text=True),
    Column("numbers", lambda one: len(one.case.published), "how many numbers are compared"),
    Column("unit", "case.unit", "unit of the numbers", text=True),
    Column("relative", "case.relative", "whether differences are over the published numbers", text=True),
    Column("largest_difference", "largest", "largest difference of computed from published numbers"),
    Column("tolerance", "case.tolerance", "the largest difference that the case allows"),
    Column("difference_is", "case.difference_is", "what differences are made of", text=True),
    Column("within", "within", "whether all numbers are within the tolerance", text=True),
)


def validation_table(results: Iterable[ValidationResult]) -> Table:
    """One row per case."""
    return Table.of_results(VALIDATION, results)
