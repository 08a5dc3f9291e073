"""The buildings of an inventory by a set of rules, with scatter if that is wanted, and their model files."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tdint.errors import UsageError
from tdint.model.definition import RayleighRatio
from tdint.model.inventory import mdof_lu
from tdint.model.inventory.facts import BuildingFacts, DerivedBuilding, Scatter
from tdint.model.inventory.table import InventoryRow

RULES: Mapping[str, Callable[[BuildingFacts, Scatter | None], DerivedBuilding]] = {"mdof-lu": mdof_lu.derive}


_MOST_SCATTER = 0.5


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


def model_text(name: str, building: DerivedBuilding, rules: str) -> str:
    """A model file in SI units with everything written out: name, stories from the ground up, damping, method."""
    lines = [
        f"# A {building.design_level}-code {building.type} building by the rules {rules}, made by `tdint inventory`.",
        f"name: {json.dumps(name, ensure_ascii=False)}",
        "stories:",
    ]
    for story in building.stories:
        strength, ultimate, drift, pinching, unloading = story.law.parameters
        lines += [
            f"  - mass: {story.mass!r}",
            f"    height: {story.height!r}",
            f"    stiffness: {story.stiffness!r}",
            f"    law: {{type: trilinear-pinching, yield_force: {strength!r}, ultimate_force: {ultimate!r}, "
            f"ultimate_drift: {drift!r}, pinching: {pinching!r}, unloading: {unloading!r}}}",
        ]
    damping = building.damping
    if isinstance(damping, RayleighRatio):
        form = f"ratio: {damping.ratios[0]!r}, modes: [{damping.modes[0]}, {damping.modes[1]}]"
    else:
        form = f"mass: {damping.mass!r}, stiffness: {damping.stiffness!r}"
    return "\n".join([*lines, f"damping: {{rayleigh: {{{form}}}}}", "analysis: {method: impulse4}", ""])
