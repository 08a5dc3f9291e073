"""Damage states of the building types of a campaign.

The module reads the key `damage` of a campaign file, and the tables of thresholds and losses to
which it refers. It determines the type of each building and the states of each type.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import NamedTuple

from tdint.csv_table import CsvTable, number_error, read_table
from tdint.errors import ModelError, UsageError
from tdint.model.building_rules import CAPACITY as CAPACITY_RULES
from tdint.model.capacity import CapacityFacts
from tdint.model.config import damage
from tdint.model.damage_states import (
    CAPACITY,
    DEMANDS,
    HAZUS,
    HAZUS_DISPERSION,
    STATES,
    DamageStates,
)
from tdint.model.definition import Model
from tdint.model.keys.fields import Either, EntriesOf, Key, Keys, Section, TextLine, Value
from tdint.model.mdof_lu import BuildingFacts, code_of, hazus_types
from tdint.response.runs.damage import divisor_and_period
from tdint.studies.campaign.buildings import Buildings, RowBuilding, RowBuildings, models_of
from tdint.units import ACCELERATION, LENGTH, STANDARD_GRAVITY

_THRESHOLD_SOURCES = (
    "hazus, capacity (the rules of the capacity curves), or a CSV file with one row per class"
)
_THRESHOLDS = Either((damage.THRESHOLDS, TextLine()))
_LOSSES = Either((damage.by_state(damage.LOSS), TextLine()))
_NAMES = EntriesOf(
    TextLine(), 1, description="a list of names, from the lightest", distinct="different names"
)
DAMAGE = Keys(
    (
        damage.DEMAND,
        Key("states", _NAMES, f"names of the states, from the lightest; {', '.join(STATES)}"),
        Key(
            "thresholds",
            _THRESHOLDS,
            f"median demand of each state; or {_THRESHOLD_SOURCES}",
            needed=True,
        ),
        damage.DISPERSION,
        Key("losses", _LOSSES, "loss ratio in each state; or a CSV file by class"),
    )
)
_DEMANDS_OF_RULES = {
    HAZUS: ("roof_drift_ratio", "drift_ratio"),
    CAPACITY: ("spectral_displacement",),
}
"""Possible demands of published thresholds; the first demand is the default."""

_SUFFIXES = {
    "1": {"": 1.0},
    "m": {f"_{unit}": factor for unit, factor in LENGTH.items()},
    "m/s^2": {"_g": STANDARD_GRAVITY, "_m_s2": ACCELERATION["m/s^2"]},
}
"""Suffixes of the state names in the header of a table of thresholds, with their factors to SI
units."""


@dataclass(frozen=True)
class DamageRequest:
    """Settings of damage in a campaign file.

    Attributes
    ----------
    demand : str
        Demand of the states, one of `tdint.model.definition.DEMANDS`.
    states : tuple of str
        Names of the states, from the lightest.
    common_states : DamageStates | None
        States of all buildings, if they are equal; None if they depend on the class.
    source : str
        Source of thresholds by class: `hazus`, `capacity`, or a CSV file; empty if all buildings
        have the same states.
    dispersion : float | None
        Standard deviation of the logarithm of the thresholds; None if a table specifies it.
    losses : tuple of float
        Loss ratio of each state and after a collapse, if equal for all buildings.
    loss_file : str | None
        CSV file of loss ratios by class.
    """

    demand: str
    states: tuple[str, ...]
    common_states: DamageStates | None = None
    source: str = ""
    dispersion: float | None = None
    losses: tuple[float, ...] = ()
    loss_file: str | None = None


def read_damage_request(value: Value | None, rules: str | None) -> DamageRequest | None:
    """Read the key `damage` of a campaign file; None if it is missing or invalid. Errors are
    recorded in the document.

    Parameters
    ----------
    rules : str | None
        Name of the rules of the inventory; None if the buildings are model files.
    """
    section = value.section(DAMAGE) if value else None
    remedy = f"specify the demand of each state, {_THRESHOLD_SOURCES}"
    thresholds = section.need("thresholds", remedy) if section else None
    if section is None or thresholds is None:
        return None
    if not thresholds.is_mapping:
        return _by_class(section, thresholds, rules)
    if entry := section.get("states"):
        entry.fault(
            "cannot be used with a mapping of thresholds, whose keys are the states; remove "
            "`states`, or use a table of thresholds"
        )
    losses = section.get("losses")
    demand = section.read("demand", "drift_ratio")
    if losses is None or losses.is_mapping:
        states = damage.read_damage_states(section, demand or "", thresholds)
        return DamageRequest(states.demand, states.states, states) if states else None
    losses.fault("must be a mapping by state, because the thresholds are a mapping")
    return None


def _by_class(section: Section, thresholds: Value, rules: str | None) -> DamageRequest | None:
    """Read the key `damage` if the thresholds depend on the class of the building: published
    thresholds, or a table. None if a value is invalid, which is recorded in the document.

    `rules` contains the rules of the inventory; None if the buildings are model files.
    """
    source = thresholds.text()
    # Published thresholds apply only to buildings that were derived by these rules.
    required_rules = {HAZUS: "mdof-lu", CAPACITY: CAPACITY_RULES}.get(source or "")
    if required_rules and rules != required_rules:
        thresholds.fault(
            f"the thresholds {source} can only be used with an inventory with the rules "
            f"{required_rules}; specify the thresholds of each state"
        )
        return None
    demand = section.read("demand", _DEMANDS_OF_RULES.get(source or "", ("",))[0])
    states = _names(section)
    if source is None or demand is None or states is None:
        return None
    # A table does not specify the demand of its thresholds; published thresholds do.
    if not demand:
        section.need("demand", f"specify one of {', '.join(DEMANDS)}")
        return None
    # Published thresholds have four states and are available for some demands only.
    if required_rules and (demand not in _DEMANDS_OF_RULES[source] or len(states) != len(STATES)):
        available = " or ".join(_DEMANDS_OF_RULES[source])
        section.value.fault(
            f"the thresholds {source} are available for the states {', '.join(STATES)} and the "
            f"demand {available}; remove other states and demands"
        )
        return None
    # Hazus specifies a dispersion; for capacity curves the user must specify it.
    stated_dispersion = section.read("dispersion")
    if source == CAPACITY and not section.has("dispersion"):
        section.need("dispersion", "specify 0 for exact thresholds")
    # Losses in the campaign file apply to all classes. Losses in a table depend on the class.
    losses_value = section.get("losses")
    common_losses = losses_value if losses_value and losses_value.is_mapping else None
    losses = damage.read_losses(common_losses, states)
    loss_file = losses_value.file() if losses_value and not common_losses else None
    if losses is None:
        return None
    dispersion = (
        HAZUS_DISPERSION if source == HAZUS and stated_dispersion is None else stated_dispersion
    )
    source = source if required_rules else thresholds.file() or source
    return DamageRequest(
        demand, states, source=source, dispersion=dispersion, losses=losses, loss_file=loss_file
    )


def _names(section: Section) -> tuple[str, ...] | None:
    """Return the names of the states in the section `damage`; None if they are invalid, which is
    recorded in the document."""
    names: tuple[str, ...] | None = section.read("states", STATES)
    if names and not all(map(damage.is_state, names)):
        section.refuse(("states",), "must be names of letters, digits, _ and -")
        return None
    return names


@dataclass(frozen=True)
class ClassDamage:
    """Damage states and loss ratios by the name of the class. Each mapping is empty if no table
    specifies the values."""

    states: Mapping[str, DamageStates] = field(default_factory=dict)
    losses: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def read_class_damage(request: DamageRequest | None) -> ClassDamage:
    """Read the tables of thresholds and loss ratios by class that a campaign file lists.

    Parameters
    ----------
    request : DamageRequest | None
        Settings of the campaign file; None: the campaign has no damage states.

    Raises
    ------
    ModelError
        A table cannot be read or contains invalid values.
    """
    if request is None:
        return ClassDamage()
    states = _read_states(request) if request.source not in ("", HAZUS, CAPACITY) else {}
    if not request.loss_file:
        return ClassDamage(states)

    # Loss ratios have a column for each state, and optionally a column for a collapse.
    table = read_table(
        request.loss_file,
        "losses are a CSV file with the column class and a column for each damage state",
    )
    columns = {state: state for state in request.states}
    if table.has(damage.COLLAPSE):
        columns[damage.COLLAPSE] = damage.COLLAPSE
    rows = _values_by_class(table, columns)
    for name, values in rows.items():
        for column, value in values.items():
            if not damage.LOSS.allow(value):
                raise ModelError(
                    f"{request.loss_file}: class {name}: the loss ratio {column} must be a number "
                    f"from 0 to 1, got {value:g}"
                )
    losses = {name: damage.losses_in_order(values, request.states) for name, values in rows.items()}
    return ClassDamage(states, losses)


def _read_states(request: DamageRequest) -> dict[str, DamageStates]:
    """Read a CSV file of thresholds, which can be the file of capacity curves, and return the
    damage states of each class by its name.

    The columns are `class`, one column for each state with the unit of the demand (`slight` for a
    ratio, `slight_m`, `slight_g`), and optionally `beta`, the dispersion. One row of a class must
    contain the values; the other rows may repeat them or be empty.
    """
    table = read_table(
        request.source,
        "thresholds are a CSV file with the column class and a column for each damage state",
    )
    # The names of the columns contain the unit, which is the same for all states.
    # If no suffix has a column for every state, the first suffix leads to an error about a missing
    # column.
    suffixes = _SUFFIXES[DEMANDS[request.demand].unit]
    available = (
        suffix_with_unit
        for suffix_with_unit in suffixes
        if table.has(*(f"{state}{suffix_with_unit}" for state in request.states))
    )
    suffix = next(available, next(iter(suffixes)))
    columns = {state: f"{state}{suffix}" for state in request.states}
    # If the campaign file specifies no dispersion, each class must specify it.
    if request.dispersion is None:
        table.need(*columns.values(), "beta")
        columns = {**columns, "beta": "beta"}
    rows = _values_by_class(table, columns)
    states_of_class = {}
    for name, values in rows.items():
        dispersion = values.pop("beta", request.dispersion or 0.0)
        # `DamageStates` raises UsageError if the medians are not in ascending order.
        try:
            medians = tuple(suffixes[suffix] * values[state] for state in request.states)
            states_of_class[name] = DamageStates(
                request.demand, request.states, medians, dispersion, request.losses
            )
        except UsageError as error:
            raise ModelError(f"{request.source}: class {name}: {error}") from None
    return states_of_class


def _values_by_class(table: CsvTable, columns: Mapping[str, str]) -> dict[str, dict[str, float]]:
    """Return the values of each class in a table, by the keys of `columns` (key: name of the
    column). Classes without values are omitted. ModelError is raised if a value is missing or
    invalid, or a class has different values in two rows.
    """
    table.need("class", *columns.values())
    # For each key, the line number and the text of the cell in each row
    cells = {key: list(table.lines(column)) for key, column in columns.items()}
    by_class: dict[str, dict[str, float]] = {}
    for row, name in enumerate(table.texts("class", empty=False)):
        texts = {key: lines[row] for key, lines in cells.items()}
        if not any(text for _, text in texts.values()):
            continue
        values = {}
        for key, (line, text) in texts.items():
            values[key] = table.number(text)
            if math.isnan(values[key]) or values[key] < 0.0:
                problem = number_error(text, "zero or a positive number") if text else "is missing"
                raise ModelError(f"{table.source}:{line}: {columns[key]} {problem}")
        first_values = by_class.setdefault(name, values)
        for key, value in values.items():
            if value != first_values[key]:
                raise ModelError(
                    f"{table.source}:{texts[key][0]}: class {name} has {columns[key]} {value:g}, "
                    f"but {first_values[key]:g} in a row above; make the values of the class "
                    "equal, or specify them in one row"
                )
    return by_class


class BuildingType(NamedTuple):
    """Properties of a building for the computation of its damage.

    Attributes
    ----------
    divisor : float
        Divisor that converts a peak of the run to the demand of the damage states, for example the
        height for the roof drift ratio; 1 if the peak is the demand.
    """

    type: str
    divisor: float
    period: float


@dataclass(frozen=True)
class Damage:
    """Damage states of each type of a campaign, and the type of each building by its index."""

    types: Mapping[str, DamageStates]
    buildings: Sequence[BuildingType]

    def description(self) -> str:
        """Return the states of each type and the SHA-256 of the buildings as JSON text, which is
        written to the store."""
        # Many buildings have the same properties, so each distinct building is converted to text
        # only one time.
        texts = {building: repr(tuple(building)) for building in set(self.buildings)}
        digest = hashlib.sha256("".join(map(texts.__getitem__, self.buildings)).encode())
        types = {name: asdict(states) for name, states in self.types.items()}
        return json.dumps({"types": types, "buildings_sha256": digest.hexdigest()})


def damage_of(
    request: DamageRequest | None, classes: ClassDamage, buildings: Buildings
) -> Damage | None:
    """Return the damage states of a campaign; None if they are not specified.

    Parameters
    ----------
    classes : ClassDamage
        Thresholds and loss ratios by building class, read from the CSV files of `request`.

    Returns
    -------
    Damage, optional
        States of each building type. For each building: its type, its first period (s), and the
        divisor that converts a peak of a run to the demand of the states, for example the height of
        the building for the roof drift ratio.

    Raises
    ------
    ModelError
        A type has no states, or a building lacks data for the demand.
    """
    # If one model specifies damage states, all models must specify them (`_model_states`).
    models = models_of(buildings)
    if request is None and not any(model.damage for model in models):
        return None
    types: dict[str, DamageStates] = {}  # the states of a type are those of its first building
    building_types: list[BuildingType] = []
    # Buildings of an inventory that differ only by location and size have the same properties,
    # which are computed for the first of these buildings. `first_alike` contains, for each
    # building, the index of the first building with the same properties.
    first_alike: Sequence[int] = range(len(buildings))
    has_random_factors = isinstance(buildings, RowBuildings) and (
        buildings.rules.stiffness or buildings.rules.damping
    )
    if isinstance(buildings, RowBuildings) and not has_random_factors:
        first_alike = buildings.rows.equivalent_indices
    for index, first in enumerate(first_alike):
        if first < index:
            building_types.append(building_types[first])
            continue
        building = buildings[index]
        if isinstance(building, RowBuilding):
            facts = building.row.facts
            name = type_of(facts)
            states = types.get(name) or _states(request, classes, name, facts)
            divisor, period = divisor_and_period(building.subject().model, states.demand)
        else:
            model = building.made.model
            name = model.name
            if name in types:
                states = types[name]
            elif request:
                states = _states(request, classes, name)
            else:
                states = _model_states(model, models)
            divisor, period = divisor_and_period(model, states.demand)
        types[name] = states
        building_types.append(BuildingType(name, divisor, period))
    return Damage(types, building_types)


def type_of(facts: BuildingFacts | CapacityFacts) -> str:
    """Return the type of a building of an inventory.

    The type is the name of its class for the rules of capacity curves; otherwise the type and the
    design level of Hazus, for example C1M-high.
    """
    # `code_of` returns the design level and the Hazus type, in this order.
    return facts.name if isinstance(facts, CapacityFacts) else "{1}-{0}".format(*code_of(facts))


def curve_medians(facts: CapacityFacts) -> tuple[float, ...]:
    """Return the median spectral displacements of four damage states from a capacity curve, m, the
    lightest state first.

    The formulas are from GEM's toolkit for single-degree-of-freedom systems. They use the
    displacement where damage starts and the displacement at the end of the curve.

    Parameters
    ----------
    facts : CapacityFacts
        Data of the building in the inventory, with its capacity curve.
    """
    yielding, ultimate = facts.curve.damage_begins, facts.curve.displacement[-1]
    return (
        0.75 * yielding,
        0.5 * yielding + 0.33 * ultimate,
        0.25 * yielding + 0.67 * ultimate,
        ultimate,
    )


def _states(
    request: DamageRequest | None,
    classes: ClassDamage,
    name: str,
    facts: BuildingFacts | CapacityFacts | None = None,
) -> DamageStates:
    """Return the damage states of a type that the campaign file specifies. ModelError is raised if
    a table does not contain the class.
    """
    assert request is not None
    if request.common_states:
        return request.common_states
    if request.source in (HAZUS, CAPACITY):
        if isinstance(facts, CapacityFacts):
            medians = curve_medians(facts)
        else:
            # The thresholds of Hazus require an inventory, which contains the facts.
            assert facts is not None
            row = hazus_types()[code_of(facts)]
            medians = tuple(getattr(row, f"{state}_drift_ratio") for state in STATES)
        states = DamageStates(
            request.demand, request.states, medians, request.dispersion or 0.0, request.losses
        )
    elif name in classes.states:
        states = classes.states[name]
    else:
        raise ModelError(
            f"{request.source}: damage thresholds of the class {name!r} not found; "
            "add a row for the class"
        )
    # The loss ratios of the classes can be in a separate file from the thresholds.
    if request.loss_file and name not in classes.losses:
        raise ModelError(
            f"{request.loss_file}: losses of the class {name!r} not found; add a row for the class"
        )
    return replace(states, losses=classes.losses[name]) if request.loss_file else states


def _model_states(model: Model, models: Sequence[Model]) -> DamageStates:
    """Return the damage states of a model. Names and demand must be the same in all models,
    because losses are summed over models; otherwise raise ModelError."""
    first = next(candidate.damage for candidate in models if candidate.damage)
    if model.damage is None:
        raise ModelError(
            f"{model.source}: `damage` is required, because other models of the campaign have it"
        )
    assert first is not None
    if (model.damage.demand, model.damage.states) != (first.demand, first.states):
        raise ModelError(
            f"{model.source}: damage: all models of a campaign must have the same demand and the "
            f"same states; this model has the demand {model.damage.demand} and the states "
            f"{', '.join(model.damage.states)}, but another model has the demand {first.demand} "
            f"and the states {', '.join(first.states)}"
        )
    return model.damage
