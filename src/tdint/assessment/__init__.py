"""Assessment of time-integration methods."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.assessment.chart import chart_figures as chart_figures
    from tdint.assessment.chart import chart_tables as chart_tables
    from tdint.assessment.chart import profile_figures as profile_figures
    from tdint.assessment.examples import example_figures as example_figures
    from tdint.assessment.examples import example_tables as example_tables
    from tdint.assessment.failures import failure_figures as failure_figures
    from tdint.assessment.failures import failure_tables as failure_tables
    from tdint.assessment.order import order_figures as order_figures
    from tdint.assessment.order import order_tables as order_tables
    from tdint.assessment.stability import stability_figures as stability_figures
    from tdint.assessment.stability import stability_tables as stability_tables
    from tdint.assessment.validation import validation_tables as validation_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
