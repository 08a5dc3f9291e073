"""Incremental dynamic analysis: curves, capacities, tables, figures, report."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.ida import ida_figures as ida_figures
    from tdint.studies.ida import ida_tables as ida_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
