"""The tables of the damage of a campaign: after each run, of each type of buildings, and losses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, BinaryIO

import numpy as np

from tdint.campaign.fragility.run_damage import (
    BuildingDamage,
    TypeDamage,
    building_damages,
    group_damages,
    stored_states,
)
from tdint.campaign.store.store import Store
from tdint.model.damage_states import DEMANDS, DamageStates
from tdint.output.tables.campaign import EVENT, OF_BUILDING, SAMPLE, carried_cells, carried_columns, write_rows
from tdint.output.tables.table import Column, cell_text, describe, names
from tdint.output_units import SI, OutputUnits
from tdint.quantity import suffix

_STATUS = Column("status", "text", "status", "how the run ended")
_STATE = Column(
    "state",
    "text",
    "state",
    "damage state that the medians tell, none below the first; collapsed and failed-story as the run ended; empty "
    "without a result",
)
TYPE = Column("type", "text", "type", "class of buildings, Hazus' type and design level, or name of the model")
LEVEL = Column(
    "level",
    "1",
    "level",
    "value of the intensity measure, SI units, or factor on the motions, or number of each motion's own factors",
)
COUNTS = (
    Column("buildings", "1", "buildings", "buildings of the type"),
    Column("runs", "1", "runs", "their runs"),
    Column("failed", "1", "failed", "those of them without a result: in no number behind"),
)
LOSS = Column("loss_ratio", "1", "loss", "mean loss ratio")
TYPES = (
    TYPE,
    LEVEL,
    *COUNTS,
    Column("state", "text", "state", "none, a damage state, or an end by falling: together they have probability 1"),
    Column("probability", "1", "probability", "mean probability over runs and buildings"),
    Column("probability_error", "1", "probability_error", "its standard error over the ground motions"),
)
"""Of damage-types.csv."""

LOSSES = (
    TYPE,
    Column("building", "text", "building", "name of the building; empty for all of the type"),
    *TYPES[1:5],
    LOSS,
    Column("loss_ratio_error", "1", "loss_error", "its standard error over the ground motions"),
    Column("loss_ratio_sd", "1", "loss_sd", "standard deviation of the loss ratio of one building in one motion"),
)
"""Of losses.csv."""


def demand_column(states: DamageStates) -> Column:
    """What the states are told by."""
    demand = DEMANDS[states.demand]
    return Column(
        f"{states.demand}{suffix(demand.unit)}", demand.unit, "demand", f"{demand.meaning}: its state is told"
    )


def probability_name(outcome: str) -> str:
    """The column of the probability of an outcome."""
    return f"probability_{outcome.replace('-', '_')}"


def damage_columns(states: DamageStates) -> tuple[Column, ...]:
    """Of damage.csv of a campaign, whose types all have these states."""
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
    """Those of a store, the columns of an inventory last."""
    own = damage_columns(next(iter(stored_states(store).values())))
    return (*own, *carried_columns(store, names(own)))


def damage_rows(store: Store) -> Iterator[list[Any]]:
    """The rows of damage.csv, in the order of runs.csv."""
    records = {number: tuple(map(cell_text, named[:2])) for number, named in store.records().items()}
    carried = carried_cells(store)
    for of in building_damages(store):
        head, kind = cell_text(of.building), cell_text(of.type)
        cells = zip(of.keys, of.status, of.demand.tolist(), of.state, _numbers(of).tolist(), strict=True)
        for (record, scale, sample), status, demand, state, numbers in cells:
            yield [
                head,
                *records[record],
                scale,
                sample,
                kind,
                status,
                demand,
                state,
                *numbers,
                *carried(of.number, sample),
            ]


def _numbers(of: BuildingDamage) -> Any:
    """Probabilities and losses of the runs, a row of each."""
    return np.column_stack([of.probability, *((of.loss,) if of.states.losses else ())])


def damage_summary(store: Store) -> dict[str, Any]:
    """The damage states of each type, SI units, and what the columns mean."""
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
    """Write damage.csv."""
    write_rows(damage_table_columns(store), damage_rows(store), stream, units)


def type_columns(store: Store) -> tuple[Column, ...]:
    """Of damage-types.csv; of ground motion fields the last one is the event."""
    return (*TYPES, *(EVENT,) * bool(store.events()))


def loss_columns(store: Store) -> tuple[Column, ...]:
    """Of losses.csv, likewise."""
    return (*LOSSES, *(EVENT,) * bool(store.events()))


def write_types(store: Store, stream: BinaryIO) -> None:
    """Write damage-types.csv."""
    rows = (
        [cell_text(of.type), of.level, *_counts(of), cell_text(state), *numbers, *_event(of)]
        for of in group_damages(store, by_building=False)
        for state, *numbers in zip(of.states.outcomes, *(one.tolist() for one in of.probability), strict=True)
    )
    write_rows(type_columns(store), rows, stream)


def write_losses(store: Store, stream: BinaryIO) -> None:
    """Write losses.csv: first all buildings of each type, then each building."""
    groups = (of for by_building in (False, True) for of in group_damages(store, by_building=by_building))
    write_rows(loss_columns(store), map(_loss_row, groups), stream)


def _loss_row(of: TypeDamage) -> list[Any]:
    means = (float(of.loss.value[0]), float(of.loss.error[0]), of.loss_sd)
    return [cell_text(of.type), cell_text(of.building), of.level, *_counts(of), *means, *_event(of)]


def _counts(of: TypeDamage) -> tuple[int, ...]:
    return of.buildings, of.runs, of.failed


def _event(of: TypeDamage) -> tuple[str, ...]:
    return (cell_text(of.event),) if of.event else ()
