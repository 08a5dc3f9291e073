"""Failures of methods on problems that are difficult to integrate."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.failures import failure_figures as failure_figures
    from tdint.assessment.failures import failure_tables as failure_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
