"""The types of the buildings of a campaign, and the damage states of each type, before anything is run."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from tdint.campaign.buildings import Buildings, InventoryBuildings, RowBuilding
from tdint.campaign.damage_reader import DamageWishes, with_losses
from tdint.campaign.inputs import Inputs
from tdint.errors import ModelError
from tdint.model.damage import CAPACITY, DEMANDS, HAZUS, DamageStates
from tdint.model.definition import Model, Story
from tdint.model.inventory.capacity import UNIT_MASS, CapacityFacts
from tdint.model.inventory.derive import RULES
from tdint.model.inventory.facts import BuildingFacts
from tdint.model.inventory.hazus import hazus_types
from tdint.model.inventory.mdof_lu import code_of
from tdint.model.modes import solve_modes


class BuildingType(NamedTuple):
    """What a building is for its damage: the type that it belongs to, what the displacement of its roof is divided by
    for the demand, and its first period, s."""

    type: str
    divisor: float
    period: float


@dataclass(frozen=True)
class Damage:
    """How the damage of a campaign is told: the states of each type, and the type of each building by its number."""

    types: Mapping[str, DamageStates]
    buildings: Sequence[BuildingType]

    def description(self) -> str:
        """The states as a store keeps them."""
        return json.dumps({name: asdict(states) for name, states in self.types.items()})


def damage_of(wanted: DamageWishes | None, inputs: Inputs, buildings: Buildings) -> Damage | None:
    """How the damage of a campaign is told; None where nothing is said of it.

    Raises
    ------
    ModelError
        A type has no states, or its buildings have not what the demand is made of.
    """
    if wanted is None and not any(model.damage for model in inputs.models):
        return None
    types: dict[str, DamageStates] = {}
    found: list[BuildingType] = []
    for number in range(len(buildings)):
        if isinstance(buildings, InventoryBuildings):
            facts = buildings.rows[number].facts
            name = type_of(facts)
            states = types.get(name) or _states(wanted, inputs, name, facts)
            one = _of_row(RowBuilding(buildings.rows[number], buildings.rules), states.demand)
        else:
            model = inputs.models[number]
            name = model.name
            states = types.get(name) or (_states(wanted, inputs, name) if wanted else _own(model, inputs.models))
            one = _of_model(model, states.demand)
        types[name] = states
        found.append(BuildingType(name, *one))
    return Damage(types, found)


def type_of(facts: BuildingFacts | CapacityFacts) -> str:
    """The name of the type of a building of an inventory: its class, or Hazus' type and design level (C1M-high)."""
    return facts.name if isinstance(facts, CapacityFacts) else "{1}-{0}".format(*code_of(facts))


def curve_medians(facts: CapacityFacts) -> tuple[float, ...]:
    """Spectral displacements of four damage states from a capacity curve, m, as GEM's toolkit of single-degree
    buildings has them: from yielding to the end of the curve."""
    first, last = facts.curve.yielding, facts.curve.displacement[-1]
    return 0.75 * first, 0.5 * first + 0.33 * last, 0.25 * first + 0.67 * last, last


def _states(
    wanted: DamageWishes | None, inputs: Inputs, name: str, facts: BuildingFacts | CapacityFacts | None = None
) -> DamageStates:
    """The states of a type as the campaign says."""
    assert wanted is not None
    if wanted.of_all:
        return wanted.of_all
    if wanted.source in (HAZUS, CAPACITY):
        medians = _HAZUS_OR_CURVE[wanted.source](facts)
        states = DamageStates(wanted.demand, wanted.states, medians, wanted.dispersion or 0.0, wanted.losses)
    elif name in inputs.class_states:
        states = inputs.class_states[name]
    else:
        raise ModelError(f"{wanted.source}: has no damage thresholds of the class {name!r}")
    return with_losses(states, inputs.class_losses, name, wanted.loss_file) if wanted.loss_file else states


def _hazus_medians(facts: Any) -> tuple[float, ...]:
    row = hazus_types()[code_of(facts)]
    return row.slight_drift_ratio, row.moderate_drift_ratio, row.extensive_drift_ratio, row.complete_drift_ratio


_HAZUS_OR_CURVE = {HAZUS: _hazus_medians, CAPACITY: curve_medians}


def _own(model: Model, models: Sequence[Model]) -> DamageStates:
    """The states that a model says for itself, which are those of the others by name and demand."""
    first = next(one.damage for one in models if one.damage)
    if model.damage is None:
        raise ModelError(f"{model.source}: says nothing of `damage`, as other models of the campaign do")
    assert first is not None
    if (model.damage.demand, model.damage.states) != (first.demand, first.states):
        raise ModelError(f"{model.source}: damage: has another demand or other states than the models before it")
    return model.damage


def _of_row(source: RowBuilding, demand: str) -> tuple[float, float]:
    """Divisor and period of a building of an inventory; alike ones are made once."""
    rules, facts = source.rules, source.row.facts
    if rules.stiffness or rules.damping:
        return _of_model(source.subject().model, demand)
    alike = replace(facts, mass=UNIT_MASS) if isinstance(facts, CapacityFacts) else replace(facts, area=1.0)
    return _of_facts(alike, rules.name, demand)


@lru_cache(maxsize=10_000)
def _of_facts(facts: BuildingFacts | CapacityFacts, rules: str, demand: str) -> tuple[float, float]:
    return _divisor_and_period(RULES[rules](facts, None).stories, demand, "")


def _of_model(model: Model, demand: str) -> tuple[float, float]:
    return _divisor_and_period(model.stories, demand, model.source or model.name)


def _divisor_and_period(stories: Sequence[Story], demand: str, name: str) -> tuple[float, float]:
    heights = [story.height for story in stories]
    if "ratio" in demand and (None in heights if DEMANDS[demand].per else not any(heights)):
        raise ModelError(f"{name}: damage by {demand} needs the heights of the stories")
    links = np.minimum(np.arange(len(stories)), 1.0)
    modes = solve_modes(
        np.array([story.mass for story in stories]), np.array([story.stiffness for story in stories]), links
    )
    per = {"": 1.0, "height": math.fsum(filter(None, heights)), "participation": float(modes.participation[0])}
    return per[DEMANDS[demand].per], float(2.0 * math.pi / modes.omega[0])
