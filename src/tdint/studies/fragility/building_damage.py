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
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property
from tdint.csv_table import number as cell_number
from tdint.model.damage_states import COST, DEMANDS, NUMBER, DamageStates
from tdint.response import pairs
from tdint.response.pairs import Run
from tdint.response.runs.damage import RunDamage, probabilities
from tdint.response.runs.run_values import RUN
from tdint.studies.store.result_store import Store

_COLUMNS = {quantity.name: quantity.column for quantity in RUN}
"""Column of the table of runs by the name of the quantity."""


def stored_states(store: Store) -> dict[str, DamageStates]:
    """Return the damage states of each type of a store; empty if it has no damage states."""
    stored = json.loads(store.damage() or "{}")
    return {name: DamageStates.from_json(item) for name, item in stored.get("types", {}).items()}


def has_losses(store: Store) -> bool:
    """Return True if damage states of the campaign have loss ratios."""
    return any(states.losses for states in stored_states(store).values())


class Mean(NamedTuple):
    """Mean over runs, and its standard error, which is a jackknife estimate over ground motions;
    nan if not available."""

    value: Array
    error: Array


def mean_of_sums(sums: Array) -> Mean:
    """Return the mean from sums over the runs of each motion: the weights, then the weighted
    values."""
    weights, motions = sums[:, :1], len(sums)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = sums[:, 1:].sum(axis=0) / weights.sum()
        if motions < 2:
            return Mean(value, np.full(value.size, np.nan))
        # Change of the mean if a motion is omitted. The jackknife variance is m - 1 times the
        # variance of these m changes.
        change = (weights * value - sums[:, 1:]) / (weights.sum() - weights)
        return Mean(value, np.sqrt((motions - 1) * np.var(change, axis=0)))


@dataclass(frozen=True, kw_only=True)
class BuildingDamage(RunDamage):
    """Damage of a building after each of its runs.

    Attributes
    ----------
    keys : list of Run
        Record, factor and sample of each run.
    motion : ndarray of int, shape (runs,)
        Index of the ground motion of each run at its level, which the components of a pair have in
        common.
    level : ndarray, shape (runs,)
        Level of each run (`tdint.response.pairs.Place`); 1 without levels.
    sa, pga : ndarray, shape (runs,)
        Pseudo-acceleration at the first period and peak ground acceleration, m/s^2.
    equal, cost : float
        Number of equal buildings that the row of the inventory represents, and their cost; nan
        without a cost.
    cells : mapping of str to str
        Cells of the inventory by the lower-case name of the column.
    """

    number: int
    building: str
    type: str
    period: float
    keys: list[Run]
    motion: pairs.Indices
    level: Array
    sa: Array
    pga: Array
    equal: float = 1.0
    cost: float = math.nan
    cells: Mapping[str, str] = field(default_factory=dict)


def building_damages(
    store: Store, common_states: DamageStates | None = None
) -> Iterator[BuildingDamage]:
    """Yield the damage of each building of a store, in the order of the buildings.

    Only one building is in memory at a time. Without damage states, nothing is yielded.

    Parameters
    ----------
    common_states : DamageStates, optional
        States of all buildings, by maximum drift ratios, instead of the stored states of the types.
    """
    types = stored_states(store)
    if not (types or common_states):
        return
    # All types have damage states of the same demand, so that one column of the runs is sufficient.
    column = _COLUMNS[DEMANDS[(common_states or next(iter(types.values()))).demand].quantity]
    names = store.buildings() if common_states else {}
    is_varied = bool(common_states and store.varied())
    query = (
        f"SELECT building, record, scale, sample, status, motion, level, {column}, sa_t1_m_s2, "
        "pga_m_s2 FROM run_rows ORDER BY 1, 2, 3, 4"
    )
    columns = [title.lower() for title in store.inventory_columns()]
    # The rows are sorted by building, so that the rows of one building at a time are read.
    for number, rows in groupby(store.connection.execute(query), key=itemgetter(0)):
        _, records, scales, samples, status, motion, level, *numbers = zip(*rows, strict=True)
        # Common states are thresholds of the maximum drift ratio, which is a value of the runs
        # (divisor 1). Each building is a separate type, together with its variations.
        if common_states:
            building, divisor, period = names[number][0], 1.0, store.period(number) or math.nan
            type_name = building.rpartition(": ")[0] if is_varied else building
        else:
            building, type_name, divisor, period = store.building_type(number)
        states = common_states or types[type_name]
        values, sa, pga = np.array(numbers, float)
        demand = np.abs(values) / divisor
        cells = dict(zip(columns, store.copied_cells(number), strict=False))
        equal = cell_number(cells[NUMBER]) if cells.get(NUMBER) else 1.0
        yield BuildingDamage(
            number=number,
            building=building,
            type=type_name,
            period=period,
            states=states,
            keys=list(map(Run, records, scales, samples)),
            motion=pairs.indices_of(zip(motion, level, samples, strict=True)),
            level=np.array([1.0 if value is None else value for value in level]),
            status=list(status),
            demand=demand,
            probability=probabilities(states, demand, status),
            sa=sa,
            pga=pga,
            equal=equal,
            cost=equal * cell_number(cells.get(COST, "")),
            cells=cells,
        )


def damage_by_motion(damage: BuildingDamage, pair_demand: str) -> BuildingDamage:
    """Return the damage of a building with a single entry per ground motion and level instead of
    per run, unless components count separately.

    The rule determines the demand of a pair, and the demand determines its damage. Key, level,
    Sa(T1) and PGA are the values of the first component.
    """
    motion, firsts = damage.motion, pairs.first_runs(damage.motion)
    if firsts.size == motion.size or pair_demand == pairs.SEPARATE:
        return damage
    demand = pairs.demands_of_motions(motion, damage.demand, pair_demand)
    status = [
        damage.status[run] for run in pairs.worst_runs(motion, pairs.outcomes_of(damage.status))
    ]
    return replace(
        damage,
        keys=[damage.keys[index] for index in firsts],
        motion=np.arange(firsts.size),
        level=damage.level[firsts],
        status=status,
        demand=demand,
        probability=probabilities(damage.states, demand, status),
        sa=damage.sa[firsts],
        pga=damage.pga[firsts],
    )


@dataclass(eq=False)
class TypeDamage:
    """Damage of a building type, or of one building, in a single event and at a single level.

    `add` adds the runs of a building. They are stored as sums for each ground motion.

    Attributes
    ----------
    type, building : str
        Type, and building; empty for all buildings of the type.
    event : str
        Event of a ground motion field; empty without events.
    level : float
        Value of the intensity measure (SI units), scale factor, or number of the level.
    inventory_entry : str
        Entry of the inventory column that defines the groups; empty for other groups.
    rows, rows_with_cost, buildings : int, int, float
        Number of rows of the inventory, of those with a result and a cost, and of the buildings
        that all rows represent.
    runs, failed : int
        Number of runs, and of runs without a result, which do not contribute to the
        probabilities and losses. Runs under a pair that counts as a single ground motion are one
        run.
    """

    states: DamageStates
    type: str = ""
    building: str = ""
    event: str = ""
    level: float = math.nan
    inventory_entry: str = ""
    rows: int = 0
    rows_with_cost: int = 0
    buildings: float = 0.0
    runs: int = 0
    failed: int = 0
    # For each ground motion: weight of its runs, and weighted sums of the probability of each
    # outcome, of the loss ratio and of its square. The weights of a row are the number of its
    # buildings together.
    _sums: dict[int, Array] = field(default_factory=dict)
    # For each ground motion: cost of the buildings, and their mean loss.
    _money: dict[int, Array] = field(default_factory=dict)
    # Rows: loss, loss ratio. Columns: sum of the variances, and of the standard deviations, of the
    # buildings.
    _scatter: Array = field(default_factory=lambda: np.zeros((2, 2)))

    def add(
        self, damage: BuildingDamage, is_at_level: NDArray[np.bool_], motions: NDArray[np.intp]
    ) -> None:
        """Add the runs of a building at a single level.

        `damage` is the damage of the building after each run.
        """
        is_counted = is_at_level & damage.known
        cost, equal = damage.cost, damage.equal
        self.rows += 1
        if not equal > 0.0:  # a row without buildings is listed, but not counted
            return
        self.buildings += equal
        self.runs += int(np.sum(is_at_level))
        self.failed += int(np.sum(is_at_level & ~is_counted))
        has_losses, has_cost = bool(damage.states.losses), not math.isnan(cost)
        self.rows_with_cost += bool(is_counted.any()) and has_cost
        loss_columns = (damage.loss, damage.squared_loss) if has_losses else ()
        # The mean of the row over its runs with a result is weighted by the number of buildings.
        weight = equal / max(int(np.sum(is_counted)), 1)
        summands = weight * np.column_stack(
            [np.ones(len(damage.keys)), damage.probability, *loss_columns]
        )
        for motion in np.unique(motions[is_counted]).tolist():
            motion_sums = summands[is_counted & (motions == motion)].sum(axis=0)
            self._sums[motion] = self._sums.get(motion, 0.0) + motion_sums
            # The cost of the building is divided equally among its runs. `motion_sums[0]` is the
            # weight of the runs under this ground motion, `motion_sums[-2]` the weighted sum of
            # their loss ratios.
            if has_losses and has_cost:
                cost_and_loss = cost / equal * motion_sums[[0, -2]]
                self._money[motion] = self._money.get(motion, 0.0) + cost_and_loss
        # Add the variance and the standard deviation of the loss, which result from the scatter of
        # the runs and of the damage thresholds. Both are computed for the loss ratio of a building,
        # and multiplied by a weight: by the cost for the sum of losses (the first element of
        # `_scatter`), and by the number of buildings for the sum of loss ratios (the second
        # element). Losses of equal buildings are independent.
        if has_losses and is_counted.any():
            mean = float(damage.loss[is_counted].mean())
            deviation = math.sqrt(max(float(damage.squared_loss[is_counted].mean()) - mean**2, 0.0))
            for sums, weight in zip(self._scatter, (cost, equal), strict=True):
                if not math.isnan(weight):
                    sums += (weight * deviation) ** 2 / equal, weight * deviation

    @cached_property
    def _means(self) -> Mean:
        """Means of the probabilities of the outcomes; with losses, also of the loss ratio and its
        square. All are nan without any run with a result."""
        if not self.buildings > 0.0 or not self._sums:
            count = len(self.states.outcomes) + 2 * bool(self.states.losses)
            return Mean(*np.full((2, count), math.nan))
        # The jackknife omits one ground motion (row) at a time.
        return mean_of_sums(np.array(list(self._sums.values())))

    @property
    def probability(self) -> Mean:
        """Probability of each outcome."""
        outcome_count = len(self.states.outcomes)
        return Mean(*(values[:outcome_count] for values in self._means))

    @property
    def loss(self) -> Mean:
        """Loss ratio: loss divided by value, without costs the mean of the buildings; arrays of a
        single value, nan without losses."""
        if not self.states.losses:
            return Mean(*np.full((2, 1), math.nan))
        if self.value > 0.0:
            return mean_of_sums(np.array(list(self._money.values())))
        return Mean(*(values[-2:-1] for values in self._means))

    @property
    def loss_sd(self) -> float:
        """Standard deviation of the loss ratio of one building under one ground motion."""
        if not self.states.losses:
            return math.nan
        mean, mean_square = self._means.value[-2:]
        return math.sqrt(max(float(mean_square - mean**2), 0.0))

    @property
    def value(self) -> float:
        """Cost of the buildings with a result, including identical buildings; nan if the inventory
        does not specify costs."""
        return float(np.array(list(self._money.values()))[:, 0].sum()) if self._money else math.nan

    @property
    def money(self) -> Mean:
        """Mean loss of all these buildings together; arrays of a single value, nan without
        costs."""
        if not self.value > 0.0:
            return Mean(*np.full((2, 1), math.nan))
        return Mean(self.value * self.loss.value, self.value * self.loss.error)

    def mean_loss(self, *, costs: bool) -> Mean:
        """Return the mean loss of these buildings, in the unit of the costs if the inventory has
        costs, otherwise as a ratio."""
        return self.money if costs else self.loss

    @property
    def scatter(self) -> tuple[float, float]:
        """Standard deviation of the total loss, for independent and for fully correlated losses of
        the buildings. Without costs, the standard deviation of the mean loss ratio."""
        # The total loss (row 0) is a sum over the buildings. For the mean loss ratio (row 1), the
        # sum is divided by their number.
        variance_sum, deviation_sum = self._scatter[0 if self._money else 1].tolist()
        divisor = 1.0 if self._money else self.buildings or 1.0
        return math.sqrt(variance_sum) / divisor, deviation_sum / divisor


def group_damages(
    store: Store, *, by_building: bool = False, by: str | None = None
) -> Iterator[TypeDamage]:
    """Yield the damage of each group of buildings, in each event and at each level.

    Only one building is in memory at a time.

    Parameters
    ----------
    by_building : bool
        True for a single group per building.
    by : str, optional
        Column of the inventory that defines the groups, for all types together; "" for a single
        group of all buildings. By default the groups are the types.
    """
    # Events are numbered from 1; the index 0 is the empty name of campaigns without events.
    rule, events = store.pair_rule(), ["", *store.events()]
    groups: dict[tuple[str, int, float], TypeDamage] = {}
    for run_damage in building_damages(store):
        damage = damage_by_motion(run_damage, rule.demand)
        name = damage.type if by is None else damage.cells.get(by.lower(), "")
        motions = np.array([rule.recordings[record] for record, _, _ in damage.keys])
        # With ground motion fields, the sample of a run is the number of its event.
        event_of_run = np.array([sample if len(events) > 1 else 0 for _, _, sample in damage.keys])
        events_and_levels = set(zip(event_of_run.tolist(), damage.level.tolist(), strict=True))
        for event, level in sorted(events_and_levels, key=_by_magnitude):
            is_at_level = (damage.level == level) & (event_of_run == event)
            group = TypeDamage(
                damage.states,
                type=name if by is None else "",
                building=damage.building if by_building else "",
                event=events[event],
                level=level,
                inventory_entry=name if by else "",
            )
            if not by_building:
                group = groups.setdefault((name, event, level), group)
            group.add(damage, is_at_level, motions)
            # A group of a single building is complete after this building, so it is not kept in
            # memory. Groups of several buildings are complete after the last building.
            if by_building:
                yield group
    for key in sorted(groups, key=lambda key: (key[0], _by_magnitude(key[1:]))):
        yield groups[key]


def _by_magnitude(event_and_level: tuple[int, float]) -> tuple[int, float]:
    """Return the sort key of an event and a level: a negative level reverses the motions."""
    event, level = event_and_level
    return event, abs(level)
