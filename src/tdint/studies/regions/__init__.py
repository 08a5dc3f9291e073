"""Buildings of regions: inventories, exposure models, ground motions at sites, maps."""

from typing import TYPE_CHECKING

from tdint.tabular import modules_on_use

if TYPE_CHECKING:
    from tdint.studies.regions import maps as maps

__getattr__ = modules_on_use(__name__, style="tdint.output.figures.style")
