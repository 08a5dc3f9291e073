"""Fragility functions, and damage of the buildings of campaigns."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.fragility import damage_tables as damage_tables
    from tdint.studies.fragility import fragility_figures as fragility_figures
    from tdint.studies.fragility import fragility_tables as fragility_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
