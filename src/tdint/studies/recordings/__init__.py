"""Comparison of computed with recorded responses, and estimation of parameters."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.recordings import comparison_figures as comparison_figures
    from tdint.studies.recordings import comparison_tables as comparison_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
