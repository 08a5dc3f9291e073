"""Assessment of time-integration methods."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment import tables as tables
    from tdint.assessment.chart import chart_figures as chart_figures
    from tdint.assessment.failures import failure_figures as failure_figures
    from tdint.assessment.stability import stability_figures as stability_figures

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
