"""Damage of the buildings of a campaign: state after each run, probabilities by type, and losses.

A completed run has a demand. The probability of reaching or exceeding a state is
Phi(ln(demand / median) / dispersion). A collapse is an outcome with the probability 1. A run
without a result does not contribute to any probability. Standard errors of probabilities and means
are jackknife estimates over ground motions, because runs under the same ground motion are
correlated.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tdint.analysis.run.demands import RUN
from tdint.analysis.run.outcome import StoryPeaks
from tdint.arrays import Array
from tdint.campaign.batch import Run, demand_cells
from tdint.campaign.fragility.type_states import own_type
from tdint.campaign.pairs import SEPARATE, PairRule
from tdint.campaign.profiles import level_ranks
from tdint.campaign.store import Store
from tdint.csv_table import number as cell_number
from tdint.model.damage_states import COST, DONE, FALLEN, NUMBER, DamageStates
from tdint.model.definition import Model

_RUN_QUANTITIES = {
    "drift_ratio": "peak_drift_ratio",
    "roof_drift_ratio": "peak_roof_displacement",
    "residual_drift_ratio": "residual_drift_ratio",
    "acceleration": "peak_absolute_acceleration",
    "spectral_displacement": "peak_roof_displacement",
}
"""Quantity of the runs from which each demand is computed."""

_COLUMNS = {quantity.name: quantity.column for quantity in RUN}


def stored_states(store: Store) -> dict[str, DamageStates]:
    """Return the damage states of each type of a store; empty if it has no damage states."""
    stored = json.loads(store.damage() or "{}")
    return {name: DamageStates.of_json(item) for name, item in stored.get("types", {}).items()}


@dataclass(frozen=True)
class BuildingDamage:
    """Damage of a building after each of its runs.

    Attributes
    ----------
    number : int
        Index of the building.
    building, type : str
        Name and type of the building.
    period : float
        First period, s.
    states : DamageStates
        Damage states of the type.
    keys : list of Run
        Record, factor and sample of each run.
    rank : ndarray of int, shape (runs,)
        Index of the level in the sequence of the levels of the ground motion, from 0.
    status : list of str
        Status at the end of each run.
    demand : ndarray, shape (runs,)
        Demand of the damage states, SI units; nan for a run without a result. After a collapse, it
        is the demand that was reached.
    probability : ndarray, shape (runs, outcomes)
        Probability of each of `states.outcomes`; nan for a run without a result.
    sa, pga : ndarray, shape (runs,)
        Pseudo-acceleration at the first period and peak ground acceleration, m/s^2.
    """

    number: int
    building: str
    type: str
    period: float
    states: DamageStates
    keys: list[Run]
    rank: NDArray[np.intp]
    status: list[str]
    demand: Array
    probability: Array
    sa: Array
    pga: Array

    @property
    def state(self) -> list[str]:
        """State of the building by the medians, or the type of collapse; empty without a result."""
        reached = np.sum(self.demand[:, np.newaxis] >= np.array(self.states.medians), axis=1)
        return [
            self.states.outcomes[index] if status == DONE else status if status in FALLEN else ""
            for index, status in zip(reached.tolist(), self.status, strict=True)
        ]

    @property
    def known(self) -> NDArray[np.bool_]:
        """True for runs that have a result."""
        return np.array([status == DONE or status in FALLEN for status in self.status])

    @property
    def loss(self) -> Array:
        """Mean loss ratio after each run, shape (runs,); nan without a result."""
        return np.asarray(self.probability @ np.array(self.states.outcome_losses))

    @property
    def squared_loss(self) -> Array:
        """Mean of the squared loss ratio, shape (runs,)."""
        return np.asarray(self.probability @ np.square(self.states.outcome_losses))


def probabilities(states: DamageStates, demand: Array, status: Sequence[str]) -> Array:
    """Return the probability of each outcome after runs, shape (runs, outcomes).

    Parameters
    ----------
    states : DamageStates
        Damage states.
    demand : ndarray, shape (runs,)
        Demands, SI units.
    status : sequence of str
        Status at the end of each run.
    """
    # The probability of a state is the probability of reaching it minus that of reaching the next
    # state. The first outcome is no damage, the last ones are the types of collapse.
    reaching = np.column_stack(
        [np.ones(demand.size), exceedance(states, demand), np.zeros(demand.size)]
    )
    result = np.zeros((demand.size, len(states.outcomes)))
    result[:, : -len(FALLEN)] = reaching[:, :-1] - reaching[:, 1:]
    for run, run_status in enumerate(status):
        if run_status in FALLEN:
            result[run] = [float(outcome == run_status) for outcome in states.outcomes]
        elif run_status != DONE:
            result[run] = math.nan
    return result


def exceedance(states: DamageStates, demand: Array) -> Array:
    """Return the probability of reaching or exceeding each state, shape (runs, states)."""
    medians = np.array(states.medians)
    if states.dispersion == 0.0:
        return np.asarray(demand[:, np.newaxis] >= medians, float)
    with np.errstate(divide="ignore"):
        return np.asarray(ndtr(np.log(demand[:, np.newaxis] / medians) / states.dispersion))


def damage_of_run(model: Model, stories: StoryPeaks, status: str) -> BuildingDamage | None:
    """Return the damage of a building after a single run; None if its model has no damage states.

    Raises
    ------
    ModelError
        The model lacks data from which the demand is computed.
    """
    states, building_type = model.damage, own_type(model)
    if states is None or building_type is None:
        return None
    (cells,) = demand_cells(stories)
    demand = np.array([abs(cells[_RUN_QUANTITIES[states.demand]])]) / building_type.divisor
    unknown = np.array([math.nan])  # intensities, which a single run does not need
    return BuildingDamage(
        number=0,
        building=model.name,
        type=building_type.type,
        period=building_type.period,
        states=states,
        keys=[Run(0, 1.0, 0)],
        rank=np.array([0]),
        status=[status],
        demand=demand,
        probability=probabilities(states, demand, [status]),
        sa=unknown,
        pga=unknown,
    )


def building_damages(
    store: Store, common_states: DamageStates | None = None
) -> Iterator[BuildingDamage]:
    """Yield the damage of each building of a store, in their order.

    Only one building is in memory at a time.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    of_all : DamageStates, optional
        States of all buildings, by drift ratios, instead of their own states.
    """
    types = stored_states(store)
    if not (types or common_states):
        return
    # All types have the same demand, so that a single column of the runs is read.
    column = _COLUMNS[_RUN_QUANTITIES[(common_states or next(iter(types.values()))).demand]]
    names = store.buildings() if common_states else {}
    query = (
        f"SELECT building, record, scale, sample, status, {column}, sa_t1_m_s2, pga_m_s2 FROM "
        "run_rows"
    )
    rows = store.connection.execute(f"{query} ORDER BY 1, 2, 3, 4")
    # The rows are sorted by building, so that the rows of one building at a time are read.
    for number, rows_of_building in groupby(rows, key=itemgetter(0)):
        runs = list(rows_of_building)
        # Common states are thresholds of the maximum drift ratio, which does not depend on a type.
        if common_states:
            building, divisor, period = names[number][0], 1.0, store.period(number) or math.nan
            name = building
        else:
            building, name, divisor, period = store.building_type(number)
        states, status = common_states or types[name], [run[4] for run in runs]
        values, sa, pga = (np.array([run[column] for run in runs], float) for column in (5, 6, 7))
        demand = np.abs(values) / divisor
        keys = [Run(*run[1:4]) for run in runs]
        # Each ground motion can have different scale factors. The level of a run is therefore the
        # rank of its factor among the factors of its ground motion.
        ranks = level_ranks(keys)
        rank = np.array([ranks[key] for key in keys])
        probability = probabilities(states, demand, status)
        yield BuildingDamage(
            number, building, name, period, states, keys, rank, status, demand, probability, sa, pga
        )


def places_of_motions(damage: BuildingDamage, rule: PairRule) -> list[list[int]]:
    """Return the indices of the runs of a building that count as one ground motion, by level.

    A pair has the runs of both components at a level, even if their factors differ.
    """
    indices: dict[tuple[int, int, int], list[int]] = {}
    for index, (key, rank) in enumerate(zip(damage.keys, damage.rank.tolist(), strict=True)):
        indices.setdefault((rule.motion(key.motion), key.sample, rank), []).append(index)
    return list(indices.values())


def by_motion(damage: BuildingDamage, rule: PairRule) -> BuildingDamage:
    """Return the damage of a building with one entry per ground motion instead of per run.

    The demand of a pair follows from the rule, and its damage follows from that demand. A pair is a
    collapse if the building collapses under at least one component. A pair has no result if one
    component has no result. Key, rank, intensity and peak acceleration are taken from the first
    component.
    """
    if rule.demand == SEPARATE or not rule.pairs:
        return damage
    groups = places_of_motions(damage, rule)
    firsts = [group[0] for group in groups]
    demand = np.array([rule.combine(damage.demand[group]) for group in groups])

    # A failure has precedence over a collapse, as in profiles.
    status = []
    for group in groups:
        statuses = [damage.status[index] for index in group]
        failed = [item for item in statuses if item not in (DONE, *FALLEN)]
        collapsed = [item for item in statuses if item in FALLEN]
        status.append(next(iter([*failed, *collapsed]), DONE))
    return replace(
        damage,
        keys=[damage.keys[index] for index in firsts],
        rank=damage.rank[firsts],
        status=status,
        demand=demand,
        probability=probabilities(damage.states, demand, status),
        sa=damage.sa[firsts],
        pga=damage.pga[firsts],
    )


def level_values(store: Store) -> list[float]:
    """Return the levels of a campaign in ascending order.

    The levels are values of an intensity measure (SI units) or factors. The list is empty if the
    ground motions have different factors; their levels are numbered from 1.
    """
    settings = store.parameters()
    return sorted(settings.get("levels") or settings.get("scales") or (), key=abs)


class Mean(NamedTuple):
    """Mean over runs with its standard error over ground motions; nan if not available."""

    value: Array
    error: Array


@dataclass(frozen=True)
class TypeDamage:
    """Damage of a building type, or of one building, in one event and at one level.

    Attributes
    ----------
    type, building : str
        Type, and building; empty for all buildings of the type.
    event : str
        Event of a ground motion field; empty without events.
    level : float
        Level, as in `level_values`.
    states : DamageStates
        Damage states of the type.
    buildings, runs, failed : int
        Number of buildings, of runs, and of runs without a result, which do not contribute to the
        following values. Runs under a pair that counts as one ground motion are one run.
    probability : Mean
        Probability of each of `states.outcomes`.
    loss : Mean
        Loss ratio; arrays of one value, nan without losses.
    loss_sd : float
        Standard deviation of the loss ratio of one building under one ground motion.
    value : float
        Cost of the buildings with a result, including identical buildings; nan if the inventory
        does not specify costs.
    money : Mean
        Mean loss of all these buildings together; arrays of one value, nan without costs.
    part : str
        Entry of the column of the inventory by which buildings are grouped.
    scatter : tuple of two floats
        Standard deviation of the loss (of the mean loss ratio without costs), for independent and
        for fully correlated losses of the buildings.
    """

    type: str
    building: str
    event: str
    level: float
    states: DamageStates
    buildings: int
    runs: int
    failed: int
    probability: Mean
    loss: Mean
    loss_sd: float
    value: float
    money: Mean
    part: str = ""
    scatter: tuple[float, float] = (0.0, 0.0)


class _Group:
    """Group of runs with sums for each ground motion.

    The sums contain the number of runs, the outcomes, the loss ratio and its square; and separately
    the cost and the loss of the buildings.
    """

    def __init__(self, states: DamageStates) -> None:
        self.states, self.buildings, self.runs, self.failed = states, 0, 0, 0
        self._sums: dict[int, Array] = {}
        self._money: dict[int, Array] = {}
        # Sums of variances and of standard deviations, for the loss and for the loss ratio
        self._scatter = np.zeros((2, 2))

    def add(
        self,
        damage: BuildingDamage,
        chosen: NDArray[np.bool_],
        motions: NDArray[np.intp],
        value: float = math.nan,
        number: float = 1.0,
    ) -> None:
        """Add the runs of a building at one level.

        Parameters
        ----------
        damage : BuildingDamage
            Damage of the building after each run.
        chosen : ndarray of bool, shape (runs,)
            Runs at the level.
        motions : ndarray of int, shape (runs,)
            Ground motion of each run.
        value : float
            Cost of all identical buildings together.
        number : float
            Number of identical buildings.
        """
        counted = chosen & damage.known
        self.buildings += 1
        self.runs += int(np.sum(chosen))
        self.failed += int(np.sum(chosen & ~counted))
        has_losses, has_cost = bool(damage.states.losses), not math.isnan(value)
        loss = (damage.loss, damage.squared_loss) if has_losses else ()
        rows = np.column_stack([np.ones(len(damage.keys)), damage.probability, *loss])
        for motion in np.unique(motions[counted]).tolist():
            added = rows[counted & (motions == motion)].sum(axis=0)
            self._sums[motion] = self._sums[motion] + added if motion in self._sums else added
            # The cost of the building is divided equally among its runs. `added[0]` is the number
            # of runs under this ground motion, `added[-2]` the sum of their loss ratios.
            if has_losses and has_cost:
                share = value / float(np.sum(counted)) * added[[0, -2]]
                self._money[motion] = (
                    self._money[motion] + share if motion in self._money else share
                )
        # Add the variance and the standard deviation of the loss, which result from the scatter of
        # the runs and of the damage thresholds, twice: weighted with the cost for the loss, and
        # with the number of runs for the loss ratio.
        if has_losses and counted.any() and number > 0.0:
            mean = float(damage.loss[counted].mean())
            deviation = math.sqrt(max(float(damage.squared_loss[counted].mean()) - mean**2, 0.0))
            for sums, weight in zip(self._scatter, (value, float(np.sum(counted))), strict=True):
                if not math.isnan(weight):
                    sums += (weight * deviation) ** 2 / number, weight * deviation

    def damage(
        self, name: str, building: str, event: str, level: float, part: str = ""
    ) -> TypeDamage:
        """Return the damage of the group.

        Parameters
        ----------
        name, building, event : str
            Type, building and event.
        level : float
            Level, as in `level_values`.
        part : str
            Entry of the column of the inventory.
        """
        count = len(self.states.outcomes)
        # The sums have one row per ground motion, because the jackknife omits one ground motion at
        # a time: runs under the same ground motion are correlated.
        sums = np.array(list(self._sums.values()))
        mean = _mean(sums) if len(sums) else Mean(*np.full((2, count), math.nan))
        probability = Mean(mean.value[:count], mean.error[:count])
        loss = money = Mean(*np.full((2, 1), math.nan))
        sd = value = math.nan
        # The last two sums are the loss ratio and its square.
        if self.states.losses and len(sums):
            loss = Mean(mean.value[-2:-1], mean.error[-2:-1])
            sd = math.sqrt(max(float(mean.value[-1] - mean.value[-2] ** 2), 0.0))
        # The mean loss is a fraction of the cost under each ground motion, averaged over them.
        squares, deviations = self._scatter[0 if self._money else 1].tolist()
        total = 1.0 if self._money else max(float(self.runs - self.failed), 1.0)
        if self._money:
            rows = np.array(list(self._money.values()))
            value = float(rows[:, 0].sum())
            if value > 0.0:
                money = Mean(*(value * part for part in _mean(rows)))
        values = (
            self.states,
            self.buildings,
            self.runs,
            self.failed,
            probability,
            loss,
            sd,
            value,
            money,
        )
        return TypeDamage(
            name,
            building,
            event,
            level,
            *values,
            part,
            (math.sqrt(squares) / total, deviations / total),
        )


def _mean(sums: Array) -> Mean:
    """Return the mean over all runs with a jackknife standard error over ground motions.

    `sums` has one row per ground motion; its first column is the number of runs.
    """
    counts, motions = sums[:, :1], len(sums)
    value = sums[:, 1:].sum(axis=0) / counts.sum()
    if motions < 2:
        return Mean(value, np.full(value.size, math.nan))
    # Change of the mean if a ground motion is omitted; nan if only one ground motion contributes.
    with np.errstate(divide="ignore", invalid="ignore"):
        change = (counts * value - sums[:, 1:]) / (counts.sum() - counts)
        return Mean(value, np.sqrt((motions - 1) * np.var(change, axis=0)))


def group_damages(
    store: Store, *, by_building: bool = False, by: str | None = None
) -> Iterator[TypeDamage]:
    """Yield the damage of each group of buildings, in each event and at each level.

    Only one building is in memory at a time.

    Parameters
    ----------
    store : Store
        Store of the campaign.
    by_building : bool
        True for one group per building.
    by : str, optional
        Column of the inventory that defines the groups, for all types together; "" for a single
        group of all buildings. By default the groups are the types.
    """
    rule, levels, events = store.pair_rule(), level_values(store), ["", *store.events()]
    groups: dict[tuple[str, int, int], _Group] = {}
    columns = [title.lower() for title in store.inventory_columns()]

    # The name of a group is the building type, or the entry of the column `by` of the inventory.
    def result(group: _Group, building: str, key: tuple[str, int, int]) -> TypeDamage:
        name, event, rank = key
        level = levels[rank] if levels else rank + 1.0
        return group.damage(
            "" if by is not None else name, building, events[event], level, name if by else ""
        )

    for run_damage in building_damages(store):
        damage = by_motion(run_damage, rule)
        cells = (
            dict(zip(columns, store.copied_cells(damage.number), strict=False))
            if COST in columns or by
            else {}
        )
        # A row of an inventory can represent several buildings, each with this cost.
        represented = cell_number(cells[NUMBER]) if cells.get(NUMBER) else 1.0
        value = cell_number(cells.get(COST, "")) * represented
        name = damage.type if by is None else cells.get(by.lower(), "")
        motions = np.array([rule.recordings[record] for record, _, _ in damage.keys])
        event = np.array([sample if len(events) > 1 else 0 for _, _, sample in damage.keys])
        # A group of a single building is complete after this building. Groups of several buildings
        # are complete after all buildings.
        for number, rank in sorted(set(zip(event.tolist(), damage.rank.tolist(), strict=True))):
            chosen, key = (damage.rank == rank) & (event == number), (name, number, rank)
            if by_building:
                group = _Group(damage.states)
            else:
                group = groups.setdefault(key, _Group(damage.states))
            group.add(damage, chosen, motions, value, represented)
            if by_building:
                yield result(group, damage.building, key)
    for key in sorted(groups):
        yield result(groups[key], "", key)
