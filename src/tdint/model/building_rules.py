"""Rules that derive the stories of a building from its properties."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tdint.model import mdof_lu
from tdint.model.capacity import CapacityBuilding, derive_capacity
from tdint.model.mdof_lu import DerivedBuilding, Scatter

CAPACITY = "capacity"
"""Name of the rules for buildings with capacity curves of their classes."""

RULES: Mapping[str, Callable[[Any, Scatter | None], DerivedBuilding | CapacityBuilding]] = {
    "mdof-lu": mdof_lu.derive,
    CAPACITY: lambda facts, scatter: derive_capacity(facts),
}
