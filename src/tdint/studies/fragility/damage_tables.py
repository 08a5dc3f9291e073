"""Tables of the damage in a campaign: damage by run, damage by building type, and losses."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict
from itertools import chain
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.special import betainc

from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.model.damage_states import COST, DEMANDS, DamageStates
from tdint.number_parsing import number_text
from tdint.output.tables.runs import BUILDING_COLUMNS, SAMPLE
from tdint.output.tables.table import TEXT, Column, describe, names, placeholder, rows_of
from tdint.studies.campaign.campaign_tables import (
    EVENT,
    StoreTable,
    copied_cells,
    copied_columns,
    suite_columns,
)
from tdint.studies.columns import declared
from tdint.studies.fragility.building_damage import (
    BuildingDamage,
    TypeDamage,
    building_damages,
    group_damages,
    stored_states,
)
from tdint.studies.store import schema
from tdint.studies.store.result_store import Store
from tdint.units import suffix

_STATUS = Column(
    "status", TEXT, lambda damage: np.array(damage.status, object), "status of the run"
)
(_STATE,) = declared("damage.state", state=lambda damage: np.array(damage.state, object))
(TYPE,) = declared("damage.type")
(LEVEL,) = declared("damage.level")
COUNTS = declared("damage.counts")
_damage: BuildingDamage = placeholder()
_group: TypeDamage = placeholder()
LOSS = Column("loss_ratio", "1", _group.loss.value, "mean loss ratio")
TYPES = (
    TYPE,
    LEVEL,
    *COUNTS,
    *declared(
        "damage.types",
        state=lambda group: np.array(group.states.outcomes, dtype=object),
        probability=_group.probability.value,
        probability_error=_group.probability.error,
    ),
)
"""Columns of damage-types.csv."""

_MONEY = declared("damage.money", loss=_group.money.value, loss_error=_group.money.error)
"""Columns of an inventory with costs."""

LOSSES = (
    TYPE,
    Column.named("building", "name of the building; empty for the complete type", TEXT),
    *TYPES[1:6],
    LOSS,
    *declared("damage.losses", loss_ratio_error=_group.loss.error, loss_ratio_sd=_group.loss_sd),
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
            _damage.probability[:, index],
            f"probability of {name}; empty without a result",
        )
        for index, name in enumerate(states.outcomes)
    )
    head = (*BUILDING_COLUMNS, SAMPLE, TYPE, _STATUS, demand_column(states), _STATE)
    return (*head, *outcomes, *((LOSS._replace(value="loss"),) if states.losses else ()))


def damage_table(store: Store) -> StoreTable:
    """Return damage.csv, the damage in each run of a campaign, in the order of runs.csv, followed
    by the columns of its inventory."""
    columns = damage_columns(next(iter(stored_states(store).values())))
    cells_of, of_runs = copied_cells(store), columns[len(BUILDING_COLUMNS) + 1 :]
    results = (row for damage in building_damages(store) for row in rows_of(of_runs, damage))
    rows = (
        [*head, *result, *cells_of(building, sample)]
        for (building, sample, *head), result in zip(
            store.shown(schema.RUNS, (SAMPLE,)), results, strict=True
        )
    )
    return StoreTable((*columns, *copied_columns(store, names(columns))), rows)


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
    columns = suite_columns(store, (*TYPES, *((EVENT,) if store.events() else ())))
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
    return StoreTable.of_results(suite_columns(store, columns), groups)


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
    loss = (_MONEY[1] if has_costs(store) else LOSS)._replace(value="loss")
    group_meaning = f"column {by} of the inventory; empty for all buildings"
    rate, exceedance_rate, *annual_losses = declared("damage.exceedance")
    error = f"standard error of {loss.name} over the ground motions"
    deviation = f"standard deviation of {loss.name} in the event"
    scattered = (
        "annual rate of exceedance of the loss, with its scatter in each event (beta distributions)"
    )
    columns = (
        *((Column(by, "text", "part", group_meaning),) if by else ()),
        LEVEL,
        EVENT,
        rate,
        loss,
        Column(f"{loss.name}_error", "1", "error", error),
        *(
            Column(f"{loss.name}_sd_{name}", "1", f"sd_{name}", f"{deviation}, {assumption}")
            for name, assumption in _CORRELATIONS
        ),
        exceedance_rate,
        *(
            Column(f"exceedance_rate_{name}", "1", f"rate_{name}", f"{scattered}, {assumption}")
            for name, assumption in _CORRELATIONS
        ),
        *annual_losses,
    )
    return StoreTable.of_results(suite_columns(store, columns), _loss_curves(store, by))


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


def _loss_curves(store: Store, by: str | None) -> Iterator[SimpleNamespace]:
    """Yield the loss curves of exceedance.csv: arrays over the events, by decreasing mean loss. In
    addition to the curve for all buildings, each value of the column `by` of the inventory has a
    curve.
    """
    costs, rate_of_event = has_costs(store), store.rates()
    # There is a loss curve for each group of buildings and each level. Its points are the events;
    # events without a result are omitted.
    curves: dict[tuple[str, float], list[tuple[float, float, TypeDamage]]] = {}
    for group in chain(group_damages(store, by=""), group_damages(store, by=by) if by else ()):
        mean, error = (float(values[0]) for values in group.mean_loss(costs=costs))
        if not math.isnan(mean):
            key = group.inventory_entry, group.level
            curves.setdefault(key, []).append((mean, error, group))
    for (inventory_entry, level), curve in curves.items():
        means, errors, groups = zip(*sorted(curve, key=lambda item: -item[0]), strict=True)
        loss, events = np.array(means), [group.event for group in groups]
        rate = np.array([rate_of_event[event] for event in events])
        # The maximum loss is the loss in the most severe damage state. It is a divisor in
        # `_exceeding`. If the losses of all states are zero, mean and deviation are zero as well,
        # and every positive divisor gives the same result.
        maxima = np.array(
            [
                (group.value if costs else 1.0) * (max(group.states.outcome_losses) or 1.0)
                for group in groups
            ]
        )
        # The exceedance rate with the scatter is computed for independent and for fully correlated
        # buildings.
        scatter: dict[str, Array] = {}
        deviations = np.array([group.scatter for group in groups]).T
        for (name, _), sd in zip(_CORRELATIONS, deviations, strict=True):
            exceeding = [rate @ _exceeding(mean, loss, sd, maxima) for mean in means]
            scatter |= {f"sd_{name}": sd, f"rate_{name}": np.array(exceeding)}
        # The events before an event have larger losses.
        yield SimpleNamespace(
            part=inventory_entry,
            level=level,
            event=np.array(events, object),
            rate=rate,
            loss=loss,
            error=np.array(errors),
            exceedance_rate=np.cumsum(rate),
            annual_loss=rate * loss,
            cumulative_annual_loss=np.cumsum(rate * loss),
            **scatter,
        )


_MAX_HEADLINES = 3  # maximum number of events or levels with a separate headline


def damage_headlines(store: Store) -> list[tuple[bool | None, str]]:
    """Return the headlines on losses and damaged buildings, those of all buildings together: with
    annual rates of the events their averages per year, otherwise the events or levels with the
    largest losses."""
    groups = [group for group in group_damages(store, by="") if group.runs > group.failed]
    rates, costs = store.rates(), has_costs(store)

    def loss_text(loss: float, per_year: str = "") -> str:
        """Return a clause on a loss; empty without losses."""
        amount = number_text(loss) if costs else f"{number_text(100.0 * loss)} % of the value"
        return f"loss{per_year} {amount}" if loss == loss else ""

    def damaged(group: TypeDamage) -> float:
        """Return the mean number of damaged buildings."""
        return group.buildings * (1.0 - float(group.probability.value[0]))

    if rates:
        totals: dict[float, list[float]] = defaultdict(lambda: [0.0, 0.0])
        for group in groups:
            loss = float(group.mean_loss(costs=costs).value[0])
            totals[group.level][0] += rates[group.event] * loss
            totals[group.level][1] += rates[group.event] * damaged(group)
        texts = [
            f"{text}{', ' * bool(text)}{number_text(count)} damaged buildings per year on average"
            for loss, count in totals.values()
            for text in [loss_text(loss, " per year")]
        ]
    else:
        groups.sort(key=lambda group: -damaged(group))
        texts = []
        for group in groups[:_MAX_HEADLINES]:
            loss = float(group.mean_loss(costs=costs).value[0])
            ratio = float(group.loss.value[0])
            parts = [loss_text(loss)]
            if costs and ratio == ratio:
                parts.append(f"loss ratio {number_text(100.0 * ratio)} %")
            count = f"{number_text(damaged(group))} of {number_text(group.buildings)}"
            parts.append(f"{count} buildings damaged")
            several = len(groups) > 1
            name = group.event or (f"level {number_text(group.level)}" if several else "")
            text = ", ".join(filter(None, parts))
            texts.append(f"{name}: {text}" if name else text)
    return [(None, f"{text[0].upper()}{text[1:]}.") for text in texts]
