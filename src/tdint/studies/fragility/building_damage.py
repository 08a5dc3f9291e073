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
from tdint.model.status import DONE, FALLEN
from tdint.response.runs.damage import RunDamage, probabilities
from tdint.response.runs.run_values import RUN
from tdint.studies.campaign.chunks import Run
from tdint.studies.campaign.story_profiles import level_ranks
from tdint.studies.motions.pairs import SEPARATE, PairRule
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


@dataclass(frozen=True, kw_only=True)
class BuildingDamage(RunDamage):
    """Damage of a building after each of its runs.

    Attributes
    ----------
    keys : list of Run
        Record, factor and sample of each run.
    rank : ndarray of int, shape (runs,)
        Index of the level in the sequence of the levels of the ground motion, from 0.
    sa, pga : ndarray, shape (runs,)
        Pseudo-acceleration at the first period and peak ground acceleration, m/s^2.
    """

    number: int
    building: str
    type: str
    period: float
    keys: list[Run]
    rank: NDArray[np.intp]
    sa: Array
    pga: Array


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
    query = (
        f"SELECT building, record, scale, sample, status, {column}, sa_t1_m_s2, pga_m_s2 FROM "
        "run_rows"
    )
    all_rows = store.connection.execute(f"{query} ORDER BY 1, 2, 3, 4")
    # The rows are sorted by building, so that the rows of one building at a time are read.
    for number, rows_of_building in groupby(all_rows, key=itemgetter(0)):
        rows = list(rows_of_building)
        # Common states are thresholds of the maximum drift ratio, which is a value of the runs
        # (divisor 1). Each building is a separate type.
        if common_states:
            building, divisor, period = names[number][0], 1.0, store.period(number) or math.nan
            type_name = building
        else:
            building, type_name, divisor, period = store.building_type(number)
        states = common_states or types[type_name]
        # Columns of a row: 1 to 3 record, scale and sample; 4 status; 5 quantity; 6 Sa(T1); 7 PGA.
        runs = [Run(*row[1:4]) for row in rows]
        status = [row[4] for row in rows]
        values, sa, pga = (np.array([row[index] for row in rows], float) for index in (5, 6, 7))
        demand = np.abs(values) / divisor
        # Each ground motion can have different scale factors. The level of a run is therefore the
        # rank of its factor in the factors of its ground motion.
        ranks = level_ranks(runs)
        run_ranks = np.array([ranks[run] for run in runs])
        probability = probabilities(states, demand, status)
        yield BuildingDamage(
            number=number,
            building=building,
            type=type_name,
            period=period,
            states=states,
            keys=runs,
            rank=run_ranks,
            status=status,
            demand=demand,
            probability=probability,
            sa=sa,
            pga=pga,
        )


def runs_of_motions(damage: BuildingDamage, rule: PairRule) -> list[list[int]]:
    """Group the runs of a building by ground motion, sample and level, and return the indices of
    the runs of each group.

    A group has the run of each component of a pair, even if their scale factors differ. If the
    rule counts components separately, each group has a single run.
    """
    indices: dict[tuple[int, int, int], list[int]] = {}
    for index, (key, rank) in enumerate(zip(damage.keys, damage.rank.tolist(), strict=True)):
        indices.setdefault((rule.motion(key.motion), key.sample, rank), []).append(index)
    return list(indices.values())


def damage_by_motion(damage: BuildingDamage, rule: PairRule) -> BuildingDamage:
    """Combine the damage after the runs of both components of each pair, and return the damage of a
    building with a single entry per ground motion and level instead of per run.

    The rule determines the demand of a pair, and the demand determines its damage. The building has
    collapsed under a pair if it has collapsed under at least one component. A pair has no result if
    one component has no result. Key, rank, Sa(T1) and PGA are the values of the first component. If
    the rule counts components separately, the damage is returned unchanged.
    """
    if rule.demand == SEPARATE or not rule.pairs:
        return damage
    runs_of_motion = runs_of_motions(damage, rule)
    firsts = [indices[0] for indices in runs_of_motion]
    demand = np.array([rule.combine(damage.demand[indices]) for indices in runs_of_motion])

    # If one component has no result and the other collapses, the pair has no result.
    status = []
    for indices in runs_of_motion:
        statuses = [damage.status[index] for index in indices]
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

    The levels are values of an intensity measure (SI units) or scale factors. The list is empty if
    each ground motion has individual factors; then the levels are numbered from 1.
    """
    settings = store.parameters()
    return sorted(settings.get("levels") or settings.get("scales") or (), key=abs)


class Mean(NamedTuple):
    """Mean over runs, and its standard error, which is a jackknife estimate over ground motions;
    nan if not available."""

    value: Array
    error: Array


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
    buildings, runs, failed : int
        Number of buildings, of runs, and of runs without a result, which do not contribute to the
        probabilities and losses. Runs under a pair that counts as a single ground motion are one
        run.
    """

    states: DamageStates
    type: str = ""
    building: str = ""
    event: str = ""
    level: float = math.nan
    inventory_entry: str = ""
    buildings: int = 0
    runs: int = 0
    failed: int = 0
    # For each ground motion: number of runs, and sums of the probability of each outcome, of the
    # loss ratio and of its square.
    _sums: dict[int, Array] = field(default_factory=dict)
    # For each ground motion: cost of the buildings, and their mean loss.
    _money: dict[int, Array] = field(default_factory=dict)
    # Rows: loss, loss ratio. Columns: sum of the variances, and of the standard deviations, of the
    # buildings.
    _scatter: Array = field(default_factory=lambda: np.zeros((2, 2)))

    def add(
        self,
        damage: BuildingDamage,
        is_at_level: NDArray[np.bool_],
        motions: NDArray[np.intp],
        cost: float = math.nan,
        identical_count: float = 1.0,
    ) -> None:
        """Add the runs of a building at a single level.

        `damage` is the damage of the building after each run.
        """
        is_counted = is_at_level & damage.known
        self.buildings += 1
        self.runs += int(np.sum(is_at_level))
        self.failed += int(np.sum(is_at_level & ~is_counted))
        has_losses, has_cost = bool(damage.states.losses), not math.isnan(cost)
        loss_columns = (damage.loss, damage.squared_loss) if has_losses else ()
        summands = np.column_stack([np.ones(len(damage.keys)), damage.probability, *loss_columns])
        for motion in np.unique(motions[is_counted]).tolist():
            motion_sums = summands[is_counted & (motions == motion)].sum(axis=0)
            self._sums[motion] = self._sums.get(motion, 0.0) + motion_sums
            # The cost of the building is divided equally among its runs. `motion_sums[0]` is the
            # number of runs under this ground motion, `motion_sums[-2]` the sum of their loss
            # ratios.
            if has_losses and has_cost:
                cost_and_loss = cost / float(np.sum(is_counted)) * motion_sums[[0, -2]]
                self._money[motion] = self._money.get(motion, 0.0) + cost_and_loss
        # Add the variance and the standard deviation of the loss, which result from the scatter of
        # the runs and of the damage thresholds. Both are computed for the loss ratio of a building,
        # and multiplied by a weight: by the cost for the sum of losses (the first element of
        # `_scatter`), and by the number of runs for the sum of loss ratios (the second element).
        # Losses of identical buildings are independent.
        if has_losses and is_counted.any() and identical_count > 0.0:
            mean = float(damage.loss[is_counted].mean())
            deviation = math.sqrt(max(float(damage.squared_loss[is_counted].mean()) - mean**2, 0.0))
            for sums, weight in zip(self._scatter, (cost, float(np.sum(is_counted))), strict=True):
                if not math.isnan(weight):
                    sums += (weight * deviation) ** 2 / identical_count, weight * deviation

    @cached_property
    def _means(self) -> Mean:
        """Means of the probabilities of the outcomes; with losses, also of the loss ratio and its
        square. All are nan without any run with a result."""
        if not self._sums:
            count = len(self.states.outcomes) + 2 * bool(self.states.losses)
            return Mean(*np.full((2, count), math.nan))
        # The jackknife omits one ground motion (row) at a time.
        return _mean(np.array(list(self._sums.values())))

    @property
    def probability(self) -> Mean:
        """Probability of each outcome."""
        outcome_count = len(self.states.outcomes)
        return Mean(*(values[:outcome_count] for values in self._means))

    @property
    def loss(self) -> Mean:
        """Loss ratio; arrays of a single value, nan without losses."""
        if not self.states.losses:
            return Mean(*np.full((2, 1), math.nan))
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
        # `_mean` returns the sum of the losses divided by the sum of the costs over the ground
        # motions; multiplied by the total cost, it is the mean loss.
        mean_fraction = _mean(np.array(list(self._money.values())))
        return Mean(self.value * mean_fraction.value, self.value * mean_fraction.error)

    @property
    def scatter(self) -> tuple[float, float]:
        """Standard deviation of the total loss, for independent and for fully correlated losses of
        the buildings. Without costs, the standard deviation of the mean loss ratio."""
        # The total loss (row 0) is a sum over the buildings. For the mean loss ratio (row 1), the
        # sum is divided by the number of runs, which was the weight of each building.
        variance_sum, deviation_sum = self._scatter[0 if self._money else 1].tolist()
        divisor = 1.0 if self._money else max(float(self.runs - self.failed), 1.0)
        return math.sqrt(variance_sum) / divisor, deviation_sum / divisor


def _mean(sums: Array) -> Mean:
    """Return the mean of k quantities over all runs with a jackknife standard error over ground
    motions (nan for a single motion).

    Each row of `sums` contains the number of runs under a ground motion (or another weight, such as
    their cost), and the sums of the quantities over these runs.
    """
    counts, motions = sums[:, :1], len(sums)
    value = sums[:, 1:].sum(axis=0) / counts.sum()
    if motions < 2:
        return Mean(value, np.full(value.size, math.nan))
    # Change of the mean if a ground motion is omitted. The jackknife variance is m - 1 times the
    # variance of these m changes.
    with np.errstate(divide="ignore", invalid="ignore"):
        change = (counts * value - sums[:, 1:]) / (counts.sum() - counts)
        return Mean(value, np.sqrt((motions - 1) * np.var(change, axis=0)))


def value_and_count(cells: Mapping[str, str]) -> tuple[float, float]:
    """Return the value of the identical buildings of a row of an inventory, which is nan without a
    cost, and their number. `cells` are the cells of the row by the lower-case name of the column.
    """
    count = cell_number(cells[NUMBER]) if cells.get(NUMBER) else 1.0
    return cell_number(cells.get(COST, "")) * count, count


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
    rule, levels, events = store.pair_rule(), level_values(store), ["", *store.events()]
    groups: dict[tuple[str, int, int], TypeDamage] = {}
    columns = [title.lower() for title in store.inventory_columns()]
    for run_damage in building_damages(store):
        damage = damage_by_motion(run_damage, rule)
        cells = {}
        if COST in columns or by:
            cells = dict(zip(columns, store.copied_cells(damage.number), strict=False))
        # A row of an inventory can represent several identical buildings, each with this cost.
        cost, identical_count = value_and_count(cells)
        name = damage.type if by is None else cells.get(by.lower(), "")
        motions = np.array([rule.recordings[record] for record, _, _ in damage.keys])
        # With ground motion fields, the sample of a run is the number of its event.
        event_of_run = np.array([sample if len(events) > 1 else 0 for _, _, sample in damage.keys])
        events_and_ranks = zip(event_of_run.tolist(), damage.rank.tolist(), strict=True)
        for event, rank in sorted(set(events_and_ranks)):
            is_at_level = (damage.rank == rank) & (event_of_run == event)
            group = TypeDamage(
                damage.states,
                type=name if by is None else "",
                building=damage.building if by_building else "",
                event=events[event],
                level=levels[rank] if levels else rank + 1.0,
                inventory_entry=name if by else "",
            )
            if not by_building:
                group = groups.setdefault((name, event, rank), group)
            group.add(damage, is_at_level, motions, cost, identical_count)
            # A group of a single building is complete after this building, so it is not kept in
            # memory. Groups of several buildings are complete after the last building.
            if by_building:
                yield group
    for key in sorted(groups):
        yield groups[key]
