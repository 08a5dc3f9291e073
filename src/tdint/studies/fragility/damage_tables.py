"""Tables of the damage in a campaign: damage by run, damage by building type, and losses."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from itertools import chain
from typing import Any

import numpy as np
from scipy.special import betainc

from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.model.damage_states import COST, DEMANDS, DamageStates
from tdint.output.tables.runs import BUILDING_COLUMNS, SAMPLE
from tdint.output.tables.table import TEXT, Column, cell_text, describe, names
from tdint.studies.campaign.campaign_tables import (
    EVENT,
    StoreTable,
    copied_cells,
    copied_columns,
    run_heads,
    with_pair_demand,
)
from tdint.studies.columns import declared
from tdint.studies.fragility.building_damage import (
    TypeDamage,
    building_damages,
    group_damages,
    stored_states,
)
from tdint.studies.store.result_store import Store
from tdint.units import suffix

_STATUS = Column.named("status", "status of the run", TEXT)
(_STATE,) = declared("damage.state")
(TYPE,) = declared("damage.type")
(LEVEL,) = declared("damage.level")
COUNTS = declared("damage.counts")
LOSS = Column("loss_ratio", "1", "loss.value", "mean loss ratio")
TYPES = (
    TYPE,
    LEVEL,
    *COUNTS,
    *declared("damage.types", state=lambda group: np.array(group.states.outcomes, dtype=object)),
)
"""Columns of damage-types.csv."""

_MONEY = declared("damage.money")
"""Columns of an inventory with costs."""

LOSSES = (
    TYPE,
    Column.named("building", "name of the building; empty for the complete type", TEXT),
    *TYPES[1:6],
    LOSS,
    *declared("damage.losses"),
)
"""Columns of losses.csv."""


def demand_column(states: DamageStates) -> Column:
    """Return the column of the demand that determines the damage state, such as the peak drift
    ratio."""
    demand = DEMANDS[states.demand]
    return Column(
        f"{states.demand}{suffix(demand.unit)}",
        demand.unit,
        "demand",
        f"{demand.meaning}; it determines the damage state",
    )


def probability_name(outcome: str) -> str:
    """Return the name of the column with the probability of an outcome, a damage state or a type of
    collapse."""
    return f"probability_{outcome.replace('-', '_')}"


def damage_columns(states: DamageStates) -> tuple[Column, ...]:
    """Return the columns of damage.csv, the damage in each run of a campaign.

    The names of the states and the demand are the same for all building types of a campaign;
    `states` are the states of any type.
    """
    outcomes = (
        Column(
            probability_name(name),
            "1",
            "probability",
            f"probability of {name}; empty without a result",
        )
        for name in states.outcomes
    )
    head = (*BUILDING_COLUMNS, SAMPLE, TYPE, _STATUS, demand_column(states), _STATE)
    return (*head, *outcomes, *((LOSS,) if states.losses else ()))


def damage_table(store: Store) -> StoreTable:
    """Return damage.csv, the damage in each run of a campaign, followed by the columns of its
    inventory."""
    columns = damage_columns(next(iter(stored_states(store).values())))
    return StoreTable((*columns, *copied_columns(store, names(columns))), _damage_rows(store))


def _damage_rows(store: Store) -> Iterator[list[Any]]:
    """Yield the rows of damage.csv: state and probabilities of each run, in the order of
    runs.csv."""
    name_cells, inventory_cells = run_heads(store), copied_cells(store)
    for damage in building_damages(store):
        type_name = cell_text(damage.type)
        # A row of `values_of_runs` contains the probabilities of all outcomes of a run and, if
        # there are losses, its loss ratio.
        loss_columns = [damage.loss] if damage.states.losses else []
        values_of_runs = np.column_stack([damage.probability, *loss_columns]).tolist()
        cells_of_runs = zip(
            damage.keys,
            damage.status,
            damage.demand.tolist(),
            damage.state,
            values_of_runs,
            strict=True,
        )
        for (record, scale, sample), status, demand, state, values in cells_of_runs:
            results = [scale, sample, type_name, status, demand, state, *values]
            copied = inventory_cells(damage.number, sample)
            yield [*name_cells(damage.number, record), *results, *copied]


def damage_summary(store: Store) -> dict[str, Any]:
    """Return the part of the JSON file of a campaign about damage: the damage states of each
    building type in SI units, and the descriptions of the columns of its tables."""
    types = stored_states(store)
    tables = {
        "damage.csv": damage_table(store),
        "damage-types.csv": type_table(store),
        "losses.csv": loss_table(store),
    }
    return {
        "types": {name: asdict(states) for name, states in types.items()},
        **{file: {"columns": describe(table.columns)} for file, table in tables.items()},
    }


def type_table(store: Store) -> StoreTable:
    """Return damage-types.csv, the damage of each building type, with a row per type, event, level
    and outcome, which is a damage state or a type of collapse.

    The column of the event is included if the campaign has ground motion fields.
    """
    columns = with_pair_demand(store, (*TYPES, *((EVENT,) if store.events() else ())))
    return StoreTable.of_results(columns, group_damages(store))


def has_costs(store: Store) -> bool:
    """Return True if the inventory has costs of buildings."""
    return COST in [title.lower() for title in store.inventory_columns()]


def loss_table(store: Store, by: str | None = None) -> StoreTable:
    """Return losses.csv, the mean losses of groups of buildings and of each building.

    The groups are: all buildings (if there are costs, or with `by`), all buildings of each type,
    and all buildings with each value of the column `by`.

    Parameters
    ----------
    by : str, optional
        Column of the inventory, such as `district`, which the table includes.

    Raises
    ------
    UsageError
        The inventory has no column `by`.
    """
    if by is not None:
        check_column(store, by)
    costs = has_costs(store)
    group_column = Column(
        by or "",
        "text",
        "inventory_entry",
        f"value of column {by} of the inventory; the row applies to all types of these buildings",
    )
    columns = (
        *LOSSES[:2],
        *((group_column,) if by else ()),
        *LOSSES[2:],
        *(_MONEY if costs else ()),
        *((EVENT,) if store.events() else ()),
    )
    # The total over all types is meaningful if there are costs, or for comparison with the groups.
    groups = chain(
        group_damages(store, by="") if costs or by else (),
        group_damages(store),
        group_damages(store, by=by) if by else (),
        group_damages(store, by_building=True),
    )
    return StoreTable.of_results(with_pair_demand(store, columns), groups)


def check_column(store: Store, by: str) -> None:
    """Raise UsageError if the inventory has no column with the name `by`, regardless of case."""
    if by.lower() not in [title.lower() for title in store.inventory_columns()]:
        available = ", ".join(store.inventory_columns()) or "none"
        raise UsageError(
            f"--by {by}: column not found in the inventory; available columns: {available}"
        )


def exceedance_table(store: Store, by: str | None) -> StoreTable:
    """Return exceedance.csv, the annual rates of exceedance of losses.

    The rows are the events in the order of decreasing mean loss. They are listed for all buildings
    and, if `by` is a column of the inventory, for the buildings with each value in the column.

    The loss is an amount of money if the inventory has costs, otherwise a loss ratio. If `by` is
    the name of a column of the inventory, this column is included.
    """
    loss = _MONEY[1] if has_costs(store) else LOSS
    group_meaning = f"column {by} of the inventory; empty for all buildings"
    rate, exceedance_rate, *annual_losses = declared("damage.exceedance")
    table_columns = (
        *((Column(by, "text", "part", group_meaning),) if by else ()),
        LEVEL,
        EVENT,
        rate,
        loss,
        Column(
            f"{loss.name}_error",
            "1",
            "error",
            f"standard error of {loss.name} over the ground motions",
        ),
        *(
            Column(
                f"{loss.name}_sd_{name}",
                "1",
                name,
                f"standard deviation of {loss.name} in the event, {assumption}",
            )
            for name, assumption in _CORRELATIONS
        ),
        exceedance_rate,
        *(
            Column(
                f"exceedance_rate_{name}",
                "1",
                name,
                "annual rate of exceedance of the loss, with its scatter in each event (beta "
                f"distributions), {assumption}",
            )
            for name, assumption in _CORRELATIONS
        ),
        *annual_losses,
    )
    return StoreTable(with_pair_demand(store, table_columns), _exceedance_rows(store, by))


_CORRELATIONS = (
    ("independent", "losses of buildings independent"),
    ("correlated", "losses of buildings fully correlated"),
)
"""Assumptions on the correlation of losses: end of the column name, and description; in the order
of `TypeDamage.scatter`."""


def _exceeding(loss: float, means: Array, deviations: Array, maxima: Array) -> Array:
    """Return the probability that each of several losses, which have beta distributions between 0
    and `maxima`, reaches or exceeds `loss`.
    """
    mean, relative_loss = means / maxima, loss / maxima
    # A beta distribution with this mean has a variance below mean (1 - mean). The factor keeps a
    # and b above 0.
    variance = np.minimum((deviations / maxima) ** 2, (1.0 - 1e-9) * mean * (1.0 - mean))
    # A loss without scatter, except for rounding, is equal to its mean.
    is_certain = variance <= 1e-12 * mean**2
    # The parameters a and b of the beta distribution follow from its mean a / (a + b) and its
    # variance mean (1 - mean) / (a + b + 1).
    a_plus_b = mean * (1.0 - mean) / np.where(is_certain, 1.0, variance) - 1.0
    a, b = (np.where(is_certain, 1.0, a_plus_b * fraction) for fraction in (mean, 1.0 - mean))
    probability = 1.0 - betainc(a, b, np.minimum(relative_loss, 1.0))
    return np.asarray(np.where(is_certain, means >= loss, probability))


def _exceedance_rows(store: Store, by: str | None) -> Iterator[list[Any]]:
    """Yield the rows of exceedance.csv: the events of each loss curve, by decreasing mean loss. In
    addition to the curve for all buildings, each value of the column `by` of the inventory has a
    curve.
    """
    costs, demand = has_costs(store), store.pair_rule().demand_if_pairs
    pair_demand = [demand] if demand else []
    # There is a loss curve for each group of buildings and each level. Its points are the events;
    # events without a result are omitted.
    curves: dict[tuple[str, float], list[tuple[float, TypeDamage]]] = {}
    for group in chain(group_damages(store, by=""), group_damages(store, by=by) if by else ()):
        mean_loss = float(group.mean_loss(costs=costs).value[0])
        if not math.isnan(mean_loss):
            key = group.inventory_entry, group.level
            curves.setdefault(key, []).append((mean_loss, group))
    rates = store.rates()
    for (inventory_entry, level), curve in curves.items():
        curve.sort(key=lambda loss_and_event: -loss_and_event[0])
        group_cell = [cell_text(inventory_entry)] if by else []
        event_rates = np.array([rates[event.event] for _, event in curve])
        means = np.array([mean_loss for mean_loss, _ in curve])
        annual_losses = event_rates * means
        deviations = np.array([event.scatter for _, event in curve]).T
        # The maximum loss is the loss in the most severe damage state. It is a divisor in
        # `_exceeding`. If the losses of all states are zero, mean and deviation are zero as well,
        # and every positive divisor gives the same result.
        maxima = np.array(
            [
                (event.value if costs else 1.0) * (max(event.states.outcome_losses) or 1.0)
                for _, event in curve
            ]
        )
        for index, (mean_loss, event) in enumerate(curve):
            # The exceedance rate with the scatter is computed for independent and for fully
            # correlated buildings. The events before this event have larger mean losses, so the
            # rate of exceedance is the sum of the rates up to this event.
            yield [
                *group_cell,
                level,
                cell_text(event.event),
                event_rates[index],
                mean_loss,
                float(event.mean_loss(costs=costs).error[0]),
                *event.scatter,
                float(np.sum(event_rates[: index + 1])),
                *(
                    float(event_rates @ _exceeding(mean_loss, means, sd, maxima))
                    for sd in deviations
                ),
                annual_losses[index],
                float(np.sum(annual_losses[: index + 1])),
                *pair_demand,
            ]
