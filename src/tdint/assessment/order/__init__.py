"""Observed order of convergence of methods."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.order import order_figures as order_figures
    from tdint.assessment.order import order_tables as order_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
