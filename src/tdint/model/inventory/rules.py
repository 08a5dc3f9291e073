"""The sets of rules by which an inventory becomes shear buildings."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from tdint.model.inventory import mdof_lu
from tdint.model.inventory.definition import BuildingFacts, DerivedBuilding, Scatter

RULES: Mapping[str, Callable[[BuildingFacts, Scatter | None], DerivedBuilding]] = {"mdof-lu": mdof_lu.derive}
