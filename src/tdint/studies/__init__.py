"""Studies of many runs: campaigns, IDA, fragility, and ground motions for them."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.campaign import campaign_tables as campaign_tables
    from tdint.studies.campaign import suite_figures as suite_figures
    from tdint.studies.fragility import damage_tables as damage_tables
    from tdint.studies.fragility import fragility_figures as fragility_figures
    from tdint.studies.fragility import fragility_tables as fragility_tables
    from tdint.studies.ida import ida_figures as ida_figures
    from tdint.studies.ida import ida_tables as ida_tables
    from tdint.studies.motions import matching_figures as matching_figures
    from tdint.studies.motions import matching_tables as matching_tables
    from tdint.studies.motions import scaling_figures as scaling_figures
    from tdint.studies.motions import scaling_tables as scaling_tables
    from tdint.studies.recordings import comparison_figures as comparison_figures
    from tdint.studies.recordings import comparison_tables as comparison_tables
    from tdint.studies.sensitivity import sensitivity_figures as sensitivity_figures
    from tdint.studies.sensitivity import sensitivity_tables as sensitivity_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
