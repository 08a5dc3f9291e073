"""The damage states of the types of buildings of a campaign: what its key `damage` says, the tables
of thresholds and losses that it names, and the type that each building belongs to."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from tdint.campaign.buildings import Buildings, RowBuilding, RowBuildings, models_of
from tdint.csv_table import CsvTable, no_number, number, read_table
from tdint.errors import ModelError, UsageError
from tdint.model.capacity import UNIT_MASS, CapacityFacts
from tdint.model.config import sections
from tdint.model.damage_states import (
    CAPACITY,
    DEMANDS,
    HAZUS,
    HAZUS_DISPERSION,
    STATES,
    DamageStates,
)
from tdint.model.definition import Model, Story
from tdint.model.inventory import CAPACITY as CAPACITY_RULES
from tdint.model.inventory import RULES
from tdint.model.keys.fields import Either, EntriesOf, Key, Keys, Section, Value, Words
from tdint.model.mdof_lu import BuildingFacts, code_of, hazus_types
from tdint.model.modes import solve_modes
from tdint.units import ACCELERATION, LENGTH, STANDARD_GRAVITY

_WHERE = (
    "hazus, capacity (the rules of the capacity curves), or a CSV file with a row for each class"
)
_THRESHOLDS, _LOSSES = (
    Either((sections.THRESHOLDS, Words())),
    Either((sections.ByState(sections.LOSS), Words())),
)
_NAMES = EntriesOf(
    Words(), 1, what="a list of names, from the lightest", distinct="names, each its own"
)
DAMAGE = Keys(
    (
        sections.DEMAND,
        Key("states", _NAMES, f"names of the states, from the lightest; {', '.join(STATES)}"),
        Key("thresholds", _THRESHOLDS, f"median demand of each state; or {_WHERE}", needed=True),
        sections.DISPERSION,
        Key("losses", _LOSSES, "loss ratio in each state; or a CSV file by class"),
    )
)
_OF_RULES = {HAZUS: ("roof_drift_ratio", "drift_ratio"), CAPACITY: ("spectral_displacement",)}
"""The demands that these thresholds may be of; the first by default."""

_SUFFIXES = {
    "1": {"": 1.0},
    "m": {f"_{unit}": factor for unit, factor in LENGTH.items()},
    "m/s^2": {"_g": STANDARD_GRAVITY, "_m_s2": ACCELERATION["m/s^2"]},
}
"""What follows the name of a state in the header of a table of thresholds, and the value in SI
units."""


@dataclass(frozen=True)
class DamageWishes:
    """What a campaign file says of damage.

    Attributes
    ----------
    demand : str
        What states are told by, one of `tdint.model.definition.DEMANDS`.
    states : tuple of str
        Names of the states, from the lightest.
    of_all : DamageStates or None
        Where all buildings have the same.
    source : str
        Else `hazus`, `capacity` or a CSV file of thresholds by class.
    dispersion : float or None
        As of `tdint.model.definition.DamageStates`; None where a table has it.
    losses : tuple of float
        The loss ratio of each state and after a collapse, the same for all.
    loss_file : str or None
        A CSV file of loss ratios by class.
    """

    demand: str
    states: tuple[str, ...]
    of_all: DamageStates | None = None
    source: str = ""
    dispersion: float | None = None
    losses: tuple[float, ...] = ()
    loss_file: str | None = None


def read_wishes(value: Value | None, rules: str | None) -> DamageWishes | None:
    """What is wanted of damage; None without any, or after a fault. `rules` are those of an
    inventory."""
    section = value.section(DAMAGE) if value else None
    advice = f"give the demand of each state, {_WHERE}"
    thresholds = section.need("thresholds", advice) if section else None
    if section is None or thresholds is None:
        return None
    if not thresholds.is_mapping:
        return _by_class(section, thresholds, rules)
    if entry := section.get("states"):
        entry.fault("the thresholds name the states; leave one of the two out")
    losses = section.get("losses")
    demand = section.read("demand", "drift_ratio")
    if losses is None or losses.is_mapping:
        read = sections.states_of(section, demand or "", thresholds)
        return DamageWishes(read.demand, read.states, read) if read else None
    losses.fault("must be a mapping by state, as the thresholds are")
    return None


def _by_class(section: Section, thresholds: Value, rules: str | None) -> DamageWishes | None:
    """Thresholds by rules or of a table; None after a fault."""
    source = thresholds.text()
    # Published thresholds belong to the rules whose types they are of.
    needed = {HAZUS: "mdof-lu", CAPACITY: CAPACITY_RULES}.get(source or "")
    if needed and rules != needed:
        thresholds.fault(
            f"{source} has thresholds of buildings of an inventory by the rules {needed}"
        )
        return None
    demand = section.read("demand", _OF_RULES.get(source or "", ("",))[0])
    states = _names(section)
    if source is None or demand is None or states is None:
        return None
    # A table does not say what its thresholds are of; published ones do.
    if not demand:
        section.need("demand", f"give one of {', '.join(DEMANDS)}")
        return None
    # Published states are four, and only some demands have them.
    if needed and (demand not in _OF_RULES[source] or len(states) != len(STATES)):
        of = " or ".join(_OF_RULES[source])
        section.value.fault(
            f"the thresholds {source} are of {len(STATES)} states, by {of}; leave the others out"
        )
        return None
    # Hazus has a dispersion of its own; beside capacity curves the user gives it.
    beta = section.read("dispersion")
    if source == CAPACITY and not section.has("dispersion"):
        section.need("dispersion", "give 0 for exact thresholds")
    # Losses are the same for all classes in the file itself, or by class in a table.
    given = section.get("losses")
    of_all = given if given and given.is_mapping else None
    losses = sections.read_losses(of_all, states)
    file = given.file() if given and not of_all else None
    if losses is None:
        return None
    dispersion = HAZUS_DISPERSION if source == HAZUS and beta is None else beta
    source = source if needed else thresholds.file() or source
    return DamageWishes(
        demand, states, source=source, dispersion=dispersion, losses=losses, loss_file=file
    )


def _names(section: Section) -> tuple[str, ...] | None:
    """The names of the states; None after a fault."""
    names: tuple[str, ...] | None = section.read("states", STATES)
    if names and not all(map(sections.is_state, names)):
        section.refuse(("states",), "must be names: words of letters, digits, _ and -")
        return None
    return names


@dataclass(frozen=True)
class ClassDamage:
    """The damage states and the loss ratios of classes by their names, as far as tables have
    them."""

    states: Mapping[str, DamageStates] = field(default_factory=dict)
    losses: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def read_class_damage(request: DamageWishes | None) -> ClassDamage:
    """What the tables say that a campaign names.

    Raises
    ------
    ModelError
        One cannot be read, or what it says makes no sense.
    """
    if request is None:
        return ClassDamage()
    states = _read_states(request) if request.source not in ("", HAZUS, CAPACITY) else {}
    if not request.loss_file:
        return ClassDamage(states)

    # Loss ratios: a column for each state and, if wanted, one for a collapse.
    table = read_table(
        request.loss_file,
        "losses are a CSV file with the column class and one for each damage state",
    )
    columns = {state: state for state in request.states}
    if table.has(sections.COLLAPSE):
        columns[sections.COLLAPSE] = sections.COLLAPSE
    rows = _of_classes(table, columns)
    for name, values in rows.items():
        if not all(map(sections.LOSS.allow, values.values())):
            raise ModelError(
                f"{request.loss_file}: class {name}: a loss ratio is a number from 0 to 1"
            )
    losses = {name: sections.losses_of(values, request.states) for name, values in rows.items()}
    return ClassDamage(states, losses)


def _read_states(request: DamageWishes) -> dict[str, DamageStates]:
    """The damage states by class of a CSV file, which may be the one of capacity curves: the column
    `class`, one for each state with the unit of the demand (`slight` of a ratio, `slight_m`,
    `slight_g`), and if wanted `beta`. Of the rows of a class one has them; the others may repeat
    them or be empty."""
    table = read_table(
        request.source,
        "thresholds are a CSV file with the column class and one for each damage state",
    )
    # The unit stands in the columns' names, one for all states.
    suffixes = _SUFFIXES[DEMANDS[request.demand].unit]
    there = (
        ending
        for ending in suffixes
        if table.has(*(f"{state}{ending}" for state in request.states))
    )
    suffix = next(there, next(iter(suffixes)))
    columns = {state: f"{state}{suffix}" for state in request.states}
    # Without a dispersion in the campaign's file each class must have one.
    if request.dispersion is None:
        table.need(*columns.values(), "beta")
    rows = _of_classes(
        table, {**columns, **({"beta": "beta"} if request.dispersion is None else {})}
    )
    by_class = {}
    for name, values in rows.items():
        beta = values.pop("beta", request.dispersion or 0.0)
        # What the medians may be together the states know themselves.
        try:
            medians = tuple(suffixes[suffix] * values[state] for state in request.states)
            by_class[name] = DamageStates(
                request.demand, request.states, medians, beta, request.losses
            )
        except UsageError as error:
            raise ModelError(f"{request.source}: class {name}: {error}") from None
    return by_class


def _of_classes(table: CsvTable, columns: Mapping[str, str]) -> dict[str, dict[str, float]]:
    """The numbers of each class that has some, by the keys of their columns."""
    table.need("class", *columns.values())
    cells = {key: list(table.lines(column)) for key, column in columns.items()}
    by_class: dict[str, dict[str, float]] = {}
    for row, name in enumerate(table.texts("class", empty=False)):
        texts = {key: lines[row] for key, lines in cells.items()}
        # Of the rows of a curve's points one alone may have the numbers of its class.
        if not any(text for _, text in texts.values()):
            continue
        values = {}
        for key, (line, text) in texts.items():
            values[key] = number(text)
            if math.isnan(values[key]) or values[key] < 0.0:
                said = no_number(text, "zero or a positive number") if text else "is missing"
                raise ModelError(f"{table.source}:{line}: {columns[key]} {said}")
        # Repeated numbers must be the same: which would count is nothing to guess.
        if by_class.setdefault(name, values) != values:
            raise ModelError(
                f"{table.source}:{line}: class {name} has other numbers in a row above"
            )
    return by_class


class BuildingType(NamedTuple):
    """What a building is for its damage: the type that it belongs to, what the displacement of its
    roof is divided by for the demand, and its first period, s."""

    type: str
    divisor: float
    period: float


@dataclass(frozen=True)
class Damage:
    """How the damage of a campaign is told: the states of each type, and the type of each building
    by its number."""

    types: Mapping[str, DamageStates]
    buildings: Sequence[BuildingType]

    def description(self) -> str:
        """The states of each type as a store keeps them, and the SHA-256 of what its buildings are;
        JSON."""
        texts = {building: repr(tuple(building)) for building in set(self.buildings)}
        whole = hashlib.sha256("".join(map(texts.__getitem__, self.buildings)).encode())
        types = {name: asdict(states) for name, states in self.types.items()}
        return json.dumps({"types": types, "buildings_sha256": whole.hexdigest()})


def damage_of(
    request: DamageWishes | None, classes: ClassDamage, buildings: Buildings
) -> Damage | None:
    """How the damage of a campaign is told; None where nothing is said of it.

    Raises
    ------
    ModelError
        A type has no states, or its buildings have not what the demand is made of.
    """
    # Models may say their states themselves; then all of them must.
    models = models_of(buildings)
    if request is None and not any(model.damage for model in models):
        return None
    # The states of a type are looked for once, by its first building.
    types: dict[str, DamageStates] = {}
    of_buildings: list[BuildingType] = []
    # Buildings of an inventory that differ by place and size alone are made once.
    firsts: Sequence[int] = range(len(buildings))
    if isinstance(buildings, RowBuildings) and not (
        buildings.rules.stiffness or buildings.rules.damping
    ):
        firsts = buildings.rows.alike
    for at, first in enumerate(firsts):
        if first < at:
            of_buildings.append(of_buildings[first])
            continue
        building = buildings[at]
        if isinstance(building, RowBuilding):
            rules, facts = building.rules, building.row.facts
            name = type_of(facts)
            states = types.get(name) or _states(request, classes, name, facts)
            if rules.stiffness or rules.damping or building.row.changes:
                divisor_and_period = _of_model(building.subject().model, states.demand)
            else:
                sized = (
                    replace(facts, mass=UNIT_MASS)
                    if isinstance(facts, CapacityFacts)
                    else replace(facts, area=1.0)
                )
                divisor_and_period = _divisor_and_period(
                    RULES[rules.name](sized, None).stories, states.demand, ""
                )
        else:
            model = building.made.model
            name = model.name
            states = types.get(name) or (
                _states(request, classes, name) if request else _own(model, models)
            )
            divisor_and_period = _of_model(model, states.demand)
        types[name] = states
        of_buildings.append(BuildingType(name, *divisor_and_period))
    return Damage(types, of_buildings)


def type_of(facts: BuildingFacts | CapacityFacts) -> str:
    """The name of the type of a building of an inventory: its class, or Hazus' type and design
    level (C1M-high)."""
    return facts.name if isinstance(facts, CapacityFacts) else "{1}-{0}".format(*code_of(facts))


def curve_medians(facts: CapacityFacts) -> tuple[float, ...]:
    """Spectral displacements of four damage states from a capacity curve, m, as GEM's toolkit of
    single-degree buildings has them: from yielding to the end of the curve."""
    first, last = facts.curve.damage_begins, facts.curve.displacement[-1]
    return 0.75 * first, 0.5 * first + 0.33 * last, 0.25 * first + 0.67 * last, last


def _states(
    request: DamageWishes | None,
    classes: ClassDamage,
    name: str,
    facts: BuildingFacts | CapacityFacts | None = None,
) -> DamageStates:
    """The states of a type as the campaign says."""
    assert request is not None
    if request.of_all:
        return request.of_all
    if request.source in (HAZUS, CAPACITY):
        medians = (
            curve_medians(facts) if isinstance(facts, CapacityFacts) else _hazus_medians(facts)
        )
        states = DamageStates(
            request.demand, request.states, medians, request.dispersion or 0.0, request.losses
        )
    elif name in classes.states:
        states = classes.states[name]
    else:
        raise ModelError(f"{request.source}: has no damage thresholds of the class {name!r}")
    # Losses may come from another file than thresholds, class by class.
    if request.loss_file and name not in classes.losses:
        raise ModelError(f"{request.loss_file}: has no losses of the class {name!r}")
    return replace(states, losses=classes.losses[name]) if request.loss_file else states


def _hazus_medians(facts: Any) -> tuple[float, ...]:
    row = hazus_types()[code_of(facts)]
    return (
        row.slight_drift_ratio,
        row.moderate_drift_ratio,
        row.extensive_drift_ratio,
        row.complete_drift_ratio,
    )


def _own(model: Model, models: Sequence[Model]) -> DamageStates:
    """The states that a model says for itself, which are those of the others by name and demand."""
    # Functions and losses are summed over models: they need the same states by the same demand.
    first = next(candidate.damage for candidate in models if candidate.damage)
    if model.damage is None:
        raise ModelError(
            f"{model.source}: says nothing of `damage`, as other models of the campaign do"
        )
    assert first is not None
    if (model.damage.demand, model.damage.states) != (first.demand, first.states):
        raise ModelError(
            f"{model.source}: damage: has another demand or other states than the models before it"
        )
    return model.damage


def own_type(model: Model) -> BuildingType | None:
    """What a building is for the damage states of its own model; None where that has none.

    Raises
    ------
    ModelError
        It has not what the demand is made of.
    """
    return (
        BuildingType(model.name, *_of_model(model, model.damage.demand)) if model.damage else None
    )


def _of_model(model: Model, demand: str) -> tuple[float, float]:
    return _divisor_and_period(model.stories, demand, model.source or model.name)


def _divisor_and_period(stories: Sequence[Story], demand: str, name: str) -> tuple[float, float]:
    heights = [story.height for story in stories]
    if "ratio" in demand and (None in heights if DEMANDS[demand].per else not any(heights)):
        raise ModelError(f"{name}: damage by {demand} needs the heights of the stories")
    links = np.minimum(np.arange(len(stories)), 1.0)
    modes = solve_modes(
        np.array([story.mass for story in stories]),
        np.array([story.stiffness for story in stories]),
        links,
    )
    per = {
        "": 1.0,
        "height": math.fsum(filter(None, heights)),
        "participation": float(modes.participation[0]),
    }
    return per[DEMANDS[demand].per], float(2.0 * math.pi / modes.omega[0])
