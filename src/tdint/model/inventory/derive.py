"""The buildings of an inventory by a set of rules, with scatter if that is wanted, and their model files."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tdint.errors import ModelError, UsageError
from tdint.model.definition import RayleighRatio, Story
from tdint.model.inventory import mdof_lu
from tdint.model.inventory.capacity import CapacityBuilding, derive_capacity
from tdint.model.inventory.mdof_lu import DerivedBuilding, Scatter
from tdint.model.inventory.table import InventoryRow, read_inventory
from tdint.model.laws import LAWS
from tdint.tabular import Several
from tdint.units import LENGTH

CAPACITY = "capacity"
"""The rules of buildings that have capacity curves by their classes."""

RULES: Mapping[str, Callable[[Any, Scatter | None], DerivedBuilding | CapacityBuilding]] = {
    "mdof-lu": mdof_lu.derive,
    CAPACITY: lambda facts, scatter: derive_capacity(facts),
}


_MOST_SCATTER = 0.5


@dataclass(frozen=True)
class InventoryBuilding:
    """A row of the inventory and the building that follows from it."""

    row: InventoryRow
    building: DerivedBuilding | CapacityBuilding


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
        if deviation and rules == CAPACITY:
            raise UsageError(f"the rules {CAPACITY} have no scatter of the {name}")
        if not 0.0 <= deviation <= _MOST_SCATTER:
            raise UsageError(f"the scatter of the {name} must be from 0 to {_MOST_SCATTER:g}, got {deviation:g}")
    one = partial(derive_row, rules=rules, stiffness=stiffness, damping=damping, seed=seed)
    return [InventoryBuilding(row, one(row)) for row in rows]


def derive_row(
    row: InventoryRow, rules: str, *, stiffness: float = 0.0, damping: float = 0.0, seed: int = 0
) -> DerivedBuilding | CapacityBuilding:
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


def model_text(name: str, building: DerivedBuilding | CapacityBuilding, rules: str) -> str:
    """A model file in SI units with everything written out: name, stories from the ground up, damping, method."""
    what = f"{building.design_level}-code {building.type}" if isinstance(building, DerivedBuilding) else building.name
    lines = [
        f"# A {what} building by the rules {rules}, made by `tdint inventory`.",
        f"name: {json.dumps(name, ensure_ascii=False)}",
        "stories:",
    ]
    for story in building.stories:
        law = _trilinear(story) if isinstance(building, DerivedBuilding) else _multilinear(story, building.degradation)
        lines += [f"  - mass: {story.mass!r}", f"    height: {story.height!r}"]
        lines += [f"    stiffness: {story.stiffness!r}", f"    law: {{{law}}}"]
    damping = building.damping
    if isinstance(damping, RayleighRatio):
        form = f"ratio: {damping.ratios[0]!r}, modes: [{damping.modes[0]}, {damping.modes[1]}]"
    else:
        form = f"mass: {damping.mass!r}, stiffness: {damping.stiffness!r}"
    return "\n".join([*lines, f"damping: {{rayleigh: {{{form}}}}}", "analysis: {method: impulse4}", ""])


def _trilinear(story: Story) -> str:
    values = zip(LAWS[story.law.name].parameters, story.law.parameters, strict=True)
    return ", ".join([f"type: {story.law.name}", *(f"{one.name}: {value!r}" for one, value in values)])


def _multilinear(story: Story, degradation: bool) -> str:
    numbers = story.law.parameters
    points = ", ".join(f"[{d!r}, {f!r}]" for d, f in zip(numbers[0:8:2], numbers[1:8:2], strict=True))
    drift, force, unloading = numbers[16:19]
    text = (
        f"type: multilinear-pinching, backbone: [{points}], "
        f"pinching: {{drift: {drift!r}, force: {force!r}, unloading: {unloading!r}}}, ultimate_drift: {numbers[22]!r}"
    )
    if not degradation:
        return text
    names = ("peak", "work", "peak_exponent", "work_exponent", "limit")
    parts = []
    for place, kind in enumerate(("stiffness", "drift", "strength")):
        values = zip(names, numbers[23 + 5 * place : 28 + 5 * place], strict=True)
        parts.append(f"{kind}: {{{', '.join(f'{name}: {value!r}' for name, value in values)}}}")
    return f"{text}, degradation: {{{', '.join(parts)}, capacity: {numbers[38]!r}}}"


def inventory(
    source: str,
    *,
    units: str = "m",
    rules: str = "mdof-lu",
    stiffness: float = 0.0,
    damping: float = 0.0,
    seed: int = 0,
) -> Several[InventoryBuilding]:
    """Shear buildings by rules from a table of buildings.

    Parameters
    ----------
    source : str
        The CSV file.
    units : str
        Of its lengths, such as `m` or `ft`; areas are in its square.
    rules : str
        One of `RULES` without classes.
    stiffness, damping, seed
        Scatter, as of `derive_all`.

    Raises
    ------
    UsageError
        Unknown units or rules, or a scatter out of range.
    ModelError
        The file cannot be read, lacks a column, or has rows that cannot be used: all of them.
    """
    if units not in LENGTH:
        raise UsageError(f"unknown unit of length {units!r:.60}; known: {', '.join(LENGTH)}")
    rows, faults = read_inventory(source, LENGTH[units])
    if faults:
        raise ModelError(faults)
    return Several(derive_all(rows, rules, stiffness=stiffness, damping=damping, seed=seed))
