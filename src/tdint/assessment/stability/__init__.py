"""Stability, accuracy and overshoot of methods."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.stability import stability_figures as stability_figures
    from tdint.assessment.stability import stability_tables as stability_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
