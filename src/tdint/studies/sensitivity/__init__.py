"""Sensitivity of peak responses to building parameters."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.sensitivity import sensitivity_figures as sensitivity_figures
    from tdint.studies.sensitivity import sensitivity_tables as sensitivity_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
