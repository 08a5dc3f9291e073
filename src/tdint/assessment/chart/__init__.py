"""Work-precision diagrams and performance profiles."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.chart import chart_figures as chart_figures
    from tdint.assessment.chart import chart_notes as chart_notes
    from tdint.assessment.chart import chart_tables as chart_tables
    from tdint.assessment.chart import profile_figures as profile_figures

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
