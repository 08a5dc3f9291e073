"""Campaigns: runs of many buildings under many ground motions, their tables, figures and report."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.campaign import campaign_tables as campaign_tables
    from tdint.studies.campaign import exports as exports
    from tdint.studies.campaign import many_run_figures as many_run_figures
    from tdint.studies.campaign import suite_figures as suite_figures

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
