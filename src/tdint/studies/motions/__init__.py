"""Ground motions for studies: selection, scaling, spectral matching, pairs, intensity measures."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.motions import matching_figures as matching_figures
    from tdint.studies.motions import matching_tables as matching_tables
    from tdint.studies.motions import scaling_figures as scaling_figures
    from tdint.studies.motions import scaling_tables as scaling_tables

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
