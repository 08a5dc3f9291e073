"""Tables of the damage in a campaign: damage by run, damage by building type, and losses."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from itertools import chain
from typing import Any, BinaryIO

import numpy as np
from scipy.special import betainc

from tdint.arrays import Array
from tdint.campaign.fragility.runs import TypeDamage, building_damages, group_damages, stored_states
from tdint.campaign.store import Store
from tdint.errors import UsageError
from tdint.model.damage_states import COST, DEMANDS, DamageStates
from tdint.output.tables.campaign import (
    EVENT,
    OF_BUILDING,
    SAMPLE,
    carried_cells,
    carried_columns,
    with_pair_demand,
    write_rows,
)
from tdint.output.tables.table import Column, Table, cell_text, describe, names
from tdint.units import SI, OutputUnits, suffix

_STATUS = Column("status", "text", "status", "status of the run")
_STATE = Column(
    "state",
    "text",
    "state",
    "damage state by comparison with the median thresholds, none below the first; collapsed or "
    "failed-story if the run ended so; empty without a result",
)
TYPE = Column(
    "type",
    "text",
    "type",
    "building type: Hazus type with design level, or name of the model",
)
LEVEL = Column(
    "level",
    "1",
    "level",
    "value of the intensity measure in SI units, or scale factor of the ground motions, or number "
    "of the scale factor if each ground motion has its own factors",
)
COUNTS = (
    Column("buildings", "1", "buildings", "number of buildings of the type"),
    Column(
        "runs",
        "1",
        "runs",
        "number of runs; a pair counts as one unless its components count separately",
    ),
    Column(
        "failed",
        "1",
        "failed",
        "number of runs without a result; they are excluded from the other columns",
    ),
)
LOSS = Column("loss_ratio", "1", "loss", "mean loss ratio")
TYPES = (
    TYPE,
    LEVEL,
    *COUNTS,
    Column(
        "state",
        "text",
        "state",
        "none, a damage state or a type of collapse; their probabilities sum to 1",
    ),
    Column("probability", "1", "probability", "mean probability over runs and buildings"),
    Column(
        "probability_error",
        "1",
        "probability_error",
        "standard error of probability over the ground motions",
    ),
)
"""Columns of damage-types.csv."""

_MONEY = (
    Column(
        "value",
        "1",
        "value",
        "value of the buildings with a result: sum of cost times number in the inventory",
    ),
    Column("loss", "1", "money", "mean total loss of these buildings, in the unit of cost"),
    Column("loss_error", "1", "money_error", "standard error of loss over the ground motions"),
)
"""Columns of an inventory with costs."""

LOSSES = (
    TYPE,
    Column("building", "text", "building", "name of the building; empty for the complete type"),
    *TYPES[1:5],
    LOSS,
    Column(
        "loss_ratio_error",
        "1",
        "loss_error",
        "standard error of loss_ratio over the ground motions",
    ),
    Column(
        "loss_ratio_sd",
        "1",
        "loss_sd",
        "standard deviation of the loss ratio of one building under one ground motion",
    ),
)
"""Columns of losses.csv."""


def demand_column(states: DamageStates) -> Column:
    """Return the column of the demand that determines the damage state."""
    demand = DEMANDS[states.demand]
    return Column(
        f"{states.demand}{suffix(demand.unit)}",
        demand.unit,
        "demand",
        f"{demand.meaning}; it determines the damage state",
    )


def probability_name(outcome: str) -> str:
    """Return the name of the column of the probability of an outcome."""
    return f"probability_{outcome.replace('-', '_')}"


def damage_columns(states: DamageStates) -> tuple[Column, ...]:
    """Return the columns of damage.csv of a campaign in which all types have these states."""
    outcomes = (
        Column(
            probability_name(name),
            "1",
            "probability",
            f"probability of {name}; empty without a result",
        )
        for name in states.outcomes
    )
    head = (*OF_BUILDING, SAMPLE, TYPE, _STATUS, demand_column(states), _STATE)
    return (*head, *outcomes, *(LOSS,) * bool(states.losses))


def damage_table_columns(store: Store) -> tuple[Column, ...]:
    """Return the columns of damage.csv of a store; inventory columns are the last ones."""
    columns = damage_columns(next(iter(stored_states(store).values())))
    return (*columns, *carried_columns(store, names(columns)))


def damage_rows(store: Store) -> Iterator[list[Any]]:
    """Yield the rows of damage.csv, in the order of runs.csv."""
    records = {
        number: tuple(map(cell_text, named[:2])) for number, named in store.records().items()
    }
    carried = carried_cells(store)
    for of in building_damages(store):
        head, kind = cell_text(of.building), cell_text(of.type)
        # One row of probabilities and losses for each run.
        damage = np.column_stack(
            [of.probability, *((of.loss,) if of.states.losses else ())]
        ).tolist()
        cells = zip(of.keys, of.status, of.demand.tolist(), of.state, damage, strict=True)
        for (record, scale, sample), status, demand, state, numbers in cells:
            results = [scale, sample, kind, status, demand, state, *numbers]
            yield [head, *records[record], *results, *carried(of.number, sample)]


def damage_summary(store: Store) -> dict[str, Any]:
    """Return the damage states of each type in SI units, and the descriptions of the columns."""
    types = stored_states(store)
    columns = {
        "damage.csv": damage_table_columns(store),
        "damage-types.csv": type_columns(store),
        "losses.csv": loss_columns(store),
    }
    return {
        "types": {name: asdict(states) for name, states in types.items()},
        **{name: {"columns": describe(of_one)} for name, of_one in columns.items()},
    }


def write_damage(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write damage.csv to a stream."""
    write_rows(damage_table_columns(store), damage_rows(store), stream, units)


def type_columns(store: Store) -> tuple[Column, ...]:
    """Return the columns of damage-types.csv; with ground motion fields, the event is the last."""
    return with_pair_demand(store, (*TYPES, *(EVENT,) * bool(store.events())))


def has_costs(store: Store) -> bool:
    """Return True if the inventory has costs of buildings."""
    return COST in [title.lower() for title in store.inventory_columns()]


def loss_columns(store: Store, by: str | None = None) -> tuple[Column, ...]:
    """Return the columns of losses.csv.

    If `by` names a column of the inventory, the column is included.
    """
    part = Column(
        by or "",
        "text",
        "part",
        f"value of column {by} of the inventory; the row applies to all types of these buildings",
    )
    columns = (
        *LOSSES[:2],
        *(part,) * bool(by),
        *LOSSES[2:],
        *_MONEY * has_costs(store),
        *(EVENT,) * bool(store.events()),
    )
    return with_pair_demand(store, columns)


def write_types(store: Store, stream: BinaryIO) -> None:
    """Write damage-types.csv to a stream."""
    write_rows(type_columns(store), _type_rows(store), stream)


def type_table(store: Store) -> Table:
    """Return damage-types.csv as a table for a report."""
    return Table.of(type_columns(store), _type_rows(store))


def _type_rows(store: Store) -> Iterator[list[Any]]:
    """Return the rows of damage-types.csv: one per type, event, level and damage state."""
    demand = _pair_demand(store)
    return (
        [
            *(cell_text(of.type), of.level, *_counts(of), cell_text(state)),
            *(*numbers, *_event(of), *demand),
        ]
        for of in group_damages(store)
        for state, *numbers in zip(
            of.states.outcomes, *(outcome.tolist() for outcome in of.probability), strict=True
        )
    )


def check_column(store: Store, by: str) -> None:
    """Raise UsageError if the inventory has no column of a name."""
    if by.lower() not in [title.lower() for title in store.inventory_columns()]:
        offered = ", ".join(store.inventory_columns()) or "none"
        raise UsageError(f"--by {by}: the inventory has no such column; it has {offered}")


def write_losses(store: Store, stream: BinaryIO, by: str | None = None) -> None:
    """Write losses.csv.

    The rows are: all buildings (if there are costs), all buildings of each type, all buildings with
    each value of the column `by`, and each building.

    Raises
    ------
    UsageError
        The inventory has no such column.
    """
    if by is not None:
        check_column(store, by)
    write_rows(loss_columns(store, by), _loss_rows(store, by), stream)


def loss_table(store: Store) -> Table:
    """Return losses.csv as a table for a report; it has no rows if the states have no losses."""
    lost = any(states.losses for states in stored_states(store).values())
    return Table.of(loss_columns(store), _loss_rows(store) if lost else ())


def _loss_rows(store: Store, by: str | None = None) -> Iterator[list[Any]]:
    """Return the rows of losses.csv in the order that `write_losses` describes."""
    costs, demand = has_costs(store), _pair_demand(store)
    # The total over all types is meaningful if there are costs, or for comparison with its parts.
    groups = chain(
        group_damages(store, by="") if costs or by else (),
        group_damages(store),
        group_damages(store, by=by) if by else (),
        group_damages(store, by_building=True),
    )

    def row(of: TypeDamage) -> list[Any]:
        means = (float(of.loss.value[0]), float(of.loss.error[0]), of.loss_sd)
        money = (of.value, float(of.money.value[0]), float(of.money.error[0])) if costs else ()
        part = (cell_text(of.inventory_entry),) if by else ()
        head = (cell_text(of.type), cell_text(of.building), *part, of.level)
        return [*head, *_counts(of), *means, *money, *_event(of), *demand]

    return map(row, groups)


def exceedance_columns(store: Store, by: str | None = None) -> tuple[Column, ...]:
    """Return the columns of exceedance.csv."""
    lost = _MONEY[1] if has_costs(store) else LOSS
    columns = (
        *(
            Column(
                by or "", "text", "part", f"column {by} of the inventory; empty for all buildings"
            ),
        )
        * bool(by),
        LEVEL,
        EVENT,
        Column("rate", "1", "rate", "annual rate of the event"),
        lost,
        Column(
            f"{lost.name}_error",
            "1",
            "error",
            f"standard error of {lost.name} over the ground motions",
        ),
        *(
            Column(
                f"{lost.name}_sd_{name}",
                "1",
                name,
                f"standard deviation of {lost.name} in the event, {how}",
            )
            for name, how in _HOW
        ),
        Column(
            "exceedance_rate",
            "1",
            "exceedance",
            "annual rate of exceedance of the loss, from the mean losses of the events",
        ),
        *(
            Column(
                f"exceedance_rate_{name}",
                "1",
                name,
                "annual rate of exceedance of the loss, with its scatter in each event (beta "
                f"distributions), {how}",
            )
            for name, how in _HOW
        ),
        Column(
            "annual_loss",
            "1",
            "annual",
            "rate times loss; the sum over the events is the average annual loss",
        ),
        Column(
            "cumulative_annual_loss",
            "1",
            "cumulative",
            "sum of annual_loss from the first row to this row",
        ),
    )
    return with_pair_demand(store, columns)


_HOW = (
    ("independent", "losses of buildings independent"),
    ("correlated", "losses of buildings fully correlated"),
)


def _exceeding(loss: float, means: Array, deviations: Array, maxima: Array) -> Array:
    """Return the probability that each of several losses, which have beta distributions between 0
    and `maxima`, reaches or exceeds `loss`.

    Parameters
    ----------
    loss : float
        Loss to be reached or exceeded.
    means, deviations : ndarray, shape (k,)
        Means and standard deviations of the losses.
    maxima : ndarray, shape (k,)
        Maximum losses, the upper bounds of the distributions.
    """
    mean, relative_loss = means / maxima, loss / maxima
    # A beta distribution with this mean has a variance below mean (1 - mean).
    variance = np.minimum((deviations / maxima) ** 2, (1.0 - 1e-9) * mean * (1.0 - mean))
    # A loss without scatter is equal to its mean.
    is_certain = variance <= 1e-12 * mean**2
    a_plus_b = mean * (1.0 - mean) / np.where(is_certain, 1.0, variance) - 1.0
    a, b = (np.where(is_certain, 1.0, a_plus_b * fraction) for fraction in (mean, 1.0 - mean))
    probability = 1.0 - betainc(a, b, np.minimum(relative_loss, 1.0))
    return np.asarray(np.where(is_certain, means >= loss, probability))


def write_exceedance(store: Store, stream: BinaryIO, by: str | None = None) -> None:
    """Write exceedance.csv: events in the order of decreasing mean loss.

    The events are listed for all buildings and for the buildings with each value of the column
    `by`.
    """
    rates, costs, demand = store.rates(), has_costs(store), _pair_demand(store)

    def rows() -> Iterator[list[Any]]:
        groups = chain(group_damages(store, by=""), group_damages(store, by=by) if by else ())
        # Each part and level has a curve. Events without a result are omitted.
        curves: dict[tuple[str, float], list[tuple[float, TypeDamage]]] = {}
        for of in groups:
            lost = float((of.money if costs else of.loss).value[0])
            if not math.isnan(lost):
                curves.setdefault((of.inventory_entry, of.level), []).append((lost, of))
        for (part, level), events in curves.items():
            events.sort(key=lambda event: -event[0])
            rate = np.array([rates[of.event] for _, of in events])
            means = np.array([lost for lost, _ in events])
            maxima = np.array(
                [
                    (of.value if costs else 1.0) * (max(of.states.outcome_losses) or 1.0)
                    for _, of in events
                ]
            )
            annual = rate * means
            for place, (lost, of) in enumerate(events):
                often = [
                    float(
                        rate
                        @ _exceeding(
                            lost,
                            means,
                            np.array([other.scatter[way] for _, other in events]),
                            maxima,
                        )
                    )
                    for way in (0, 1)
                ]
                error = float((of.money if costs else of.loss).error[0])
                head = [*[cell_text(part)] * bool(by), level, cell_text(of.event), rate[place]]
                sums = [float(np.sum(values[: place + 1])) for values in (rate, annual)]
                results = (lost, error, *of.scatter, sums[0], *often, annual[place], sums[1])
                yield [*head, *results, *demand]

    write_rows(exceedance_columns(store, by), rows(), stream)


def _pair_demand(store: Store) -> tuple[str, ...]:
    """Return the cell that states how pairs are counted, if there are pairs."""
    pair_demand = store.pair_rule().demand_if_pairs
    return (pair_demand,) if pair_demand else ()


def _counts(of: TypeDamage) -> tuple[int, ...]:
    """Return the cells of the columns `COUNTS`."""
    return of.buildings, of.runs, of.failed


def _event(of: TypeDamage) -> tuple[str, ...]:
    """Return the cell of the event; empty if the campaign has no events."""
    return (cell_text(of.event),) if of.event else ()
