"""Examples of the paper of 2022."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.examples import example_figures as example_figures
    from tdint.assessment.examples import example_tables as example_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
