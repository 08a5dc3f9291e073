"""Validation against published and exact results."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.validation import validation_tables as validation_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
