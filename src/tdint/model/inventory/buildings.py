"""The buildings of an inventory by a set of rules, with scatter if that is wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tdint.errors import UsageError
from tdint.model.inventory.definition import DerivedBuilding, Scatter
from tdint.model.inventory.read import InventoryRow
from tdint.model.inventory.rules import RULES

_MOST_SCATTER = 0.5
_LARGEST_DAMPING = 0.99


@dataclass(frozen=True)
class InventoryBuilding:
    """A row of the inventory and the building that follows from it."""

    row: InventoryRow
    building: DerivedBuilding


def derive_all(
    rows: Sequence[InventoryRow], rules: str, *, stiffness: float = 0.0, damping: float = 0.0, seed: int = 0
) -> list[InventoryBuilding]:
    """The buildings of all rows.

    Parameters
    ----------
    stiffness, damping : float
        Standard deviations of factors with the mean 1 on the stiffness of a building, whose strength stays, and on its
        damping ratio: normal, drawn again where they are not positive.
    seed : int
        What the factors are drawn from, with the id of the building: they do not depend on the other rows.

    Raises
    ------
    UsageError
        Unknown rules, or a scatter out of range.
    """
    if rules not in RULES:
        raise UsageError(f"unknown rules {rules!r}; known: {', '.join(RULES)}")
    for name, deviation in (("stiffness", stiffness), ("damping", damping)):
        if not 0.0 <= deviation <= _MOST_SCATTER:
            raise UsageError(f"the scatter of the {name} must be from 0 to {_MOST_SCATTER:g}, got {deviation:g}")
    one = partial(derive_row, rules=rules, stiffness=stiffness, damping=damping, seed=seed)
    return [InventoryBuilding(row, one(row)) for row in rows]


def derive_row(
    row: InventoryRow, rules: str, *, stiffness: float = 0.0, damping: float = 0.0, seed: int = 0
) -> DerivedBuilding:
    """The building of one row; parameters are those of `derive_all`, which checks them."""
    scatter = _scatter(row.id, stiffness, damping, seed) if stiffness or damping else None
    return RULES[rules](row.facts, scatter)


def _scatter(name: str, stiffness: float, damping: float, seed: int) -> Scatter:
    random = np.random.default_rng([seed, *name.encode()])
    return Scatter(_factor(random, stiffness), _factor(random, damping))


def _factor(random: np.random.Generator, deviation: float) -> float:
    factor = 0.0
    while factor <= 0.0:
        factor = 1.0 + deviation * random.standard_normal()
    return float(factor)
