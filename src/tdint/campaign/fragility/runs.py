"""Damage of the buildings of a campaign: the state after each run, probabilities by type and level,
and losses.

A run that comes to its end has a demand; the probability of a state or a heavier one is
Phi(ln(demand / median) / dispersion). A run under which the building falls is told as what it is,
with the probability 1, and one without a result has no part in any probability. The standard error
of a probability or a mean is that of a mean over the ground motions: runs under the same one are
taken together, for they err alike.
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

_MADE_OF = {
    "drift_ratio": "peak_drift_ratio",
    "roof_drift_ratio": "peak_roof_displacement",
    "residual_drift_ratio": "residual_drift_ratio",
    "acceleration": "peak_absolute_acceleration",
    "spectral_displacement": "peak_roof_displacement",
}
"""The quantity of the runs that each demand is made of."""

_COLUMNS = {one.name: one.column for one in RUN}


def stored_states(store: Store) -> dict[str, DamageStates]:
    """The damage states of each type of a store; empty where nothing is said of damage."""
    said = json.loads(store.damage() or "{}")
    return {name: DamageStates.of_json(stored) for name, stored in said.get("types", {}).items()}


@dataclass(frozen=True)
class BuildingDamage:
    """The damage of a building after each of its runs.

    Attributes
    ----------
    number : int
        Of the building.
    building, type : str
        Its name and its type.
    period : float
        First period, s.
    states : DamageStates
        Of its type.
    keys : list of Run
        Record, factor and draw of each run.
    rank : ndarray of int, shape (runs,)
        The place of the level among those of its motion, from 0.
    status : list of str
        How it ended.
    demand : ndarray, shape (runs,)
        What the states are told by, SI units; nan of a run without a result. Of a run under which
        the building falls what it had reached.
    probability : ndarray, shape (runs, outcomes)
        Of each of `states.outcomes`; nan of a run without a result.
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
        """What became of the building: the state that the medians tell, or how it fell; nothing
        without a result."""
        reached = np.sum(self.demand[:, np.newaxis] >= np.array(self.states.medians), axis=1)
        return [
            self.states.outcomes[place] if status == DONE else status if status in FALLEN else ""
            for place, status in zip(reached.tolist(), self.status, strict=True)
        ]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which runs have a result."""
        return np.array([status == DONE or status in FALLEN for status in self.status])

    @property
    def loss(self) -> Array:
        """Mean loss ratio after each run, shape (runs,); nan without a result."""
        return np.asarray(self.probability @ np.array(self.states.outcome_losses))

    @property
    def squared_loss(self) -> Array:
        """Mean of the loss ratio's square, shape (runs,)."""
        return np.asarray(self.probability @ np.square(self.states.outcome_losses))


def probabilities(states: DamageStates, demand: Array, status: Sequence[str]) -> Array:
    """The probability of each outcome after runs with these demands and ends, shape (runs,
    outcomes)."""
    exceeded = exceedance(states, demand)
    edges = np.column_stack([np.ones(demand.size), exceeded, np.zeros(demand.size)])
    result = np.zeros((demand.size, len(states.outcomes)))
    result[:, : -len(FALLEN)] = edges[:, :-1] - edges[:, 1:]
    for run, end in enumerate(status):
        if end != DONE:
            result[run] = (
                [float(outcome == end) for outcome in states.outcomes]
                if end in FALLEN
                else math.nan
            )
    return result


def exceedance(states: DamageStates, demand: Array) -> Array:
    """The probability of each state or a heavier one under these demands, shape (runs, states)."""
    medians = np.array(states.medians)
    if states.dispersion == 0.0:
        return np.asarray(demand[:, np.newaxis] >= medians, float)
    with np.errstate(divide="ignore"):
        return np.asarray(ndtr(np.log(demand[:, np.newaxis] / medians) / states.dispersion))


def damage_of_run(model: Model, stories: StoryPeaks, status: str) -> BuildingDamage | None:
    """The damage of a building after a single run; None where its model says nothing of it.

    Raises
    ------
    ModelError
        The building has not what the demand is made of.
    """
    states, type_ = model.damage, own_type(model)
    if states is None or type_ is None:
        return None
    (cells,) = demand_cells(stories)
    demand, nothing = (
        np.array([abs(cells[_MADE_OF[states.demand]])]) / type_.divisor,
        np.array([math.nan]),
    )
    probability = probabilities(states, demand, [status])
    keys, rank = [Run(0, 1.0, 0)], np.array([0])
    return BuildingDamage(
        0,
        model.name,
        type_.type,
        type_.period,
        states,
        keys,
        rank,
        [status],
        demand,
        probability,
        nothing,
        nothing,
    )


def building_damages(store: Store, of_all: DamageStates | None = None) -> Iterator[BuildingDamage]:
    """Of each building of a store, in their order, with `of_all`, of drift ratios, in place of its
    own states; one building is held at a time."""
    types = stored_states(store)
    if not (types or of_all):
        return
    # All types have one demand: one column of the runs is read.
    column = _COLUMNS[_MADE_OF[(of_all or next(iter(types.values()))).demand]]
    names = store.buildings() if of_all else {}
    query = (
        f"SELECT building, record, scale, sample, status, {column}, sa_t1_m_s2, pga_m_s2 FROM "
        "run_rows"
    )
    rows = store.connection.execute(f"{query} ORDER BY 1, 2, 3, 4")
    # Rows come sorted by building, so that one is held at a time.
    for number, of_one in groupby(rows, key=itemgetter(0)):
        runs = list(of_one)
        # With thresholds of the largest drift ratio a building needs no type and no divisor.
        if of_all:
            building, divisor, period = names[number][0], 1.0, store.period(number) or math.nan
            name = building
        else:
            building, name, divisor, period = store.building_type(number)
        states, status = of_all or types[name], [run[4] for run in runs]
        values, sa, pga = (np.array([run[place] for run in runs], float) for place in (5, 6, 7))
        demand = np.abs(values) / divisor
        keys = [Run(*run[1:4]) for run in runs]
        # Levels are ranks of the factors, for factors may be each motion's own.
        ranks = level_ranks(keys)
        rank, probability = (
            np.array([ranks[key] for key in keys]),
            probabilities(states, demand, status),
        )
        yield BuildingDamage(
            number, building, name, period, states, keys, rank, status, demand, probability, sa, pga
        )


def places_of_motions(of: BuildingDamage, rule: PairRule) -> list[list[int]]:
    """Return the places of the runs of a building that count as one motion, level by level.

    A pair has the runs of both components at a level, even if these have factors of their own.
    """
    places: dict[tuple[int, int, int], list[int]] = {}
    for place, (key, rank) in enumerate(zip(of.keys, of.rank.tolist(), strict=True)):
        places.setdefault((rule.motion(key.motion), key.sample, rank), []).append(place)
    return list(places.values())


def by_motion(of: BuildingDamage, rule: PairRule) -> BuildingDamage:
    """Return the damage of a building with one entry for each motion instead of each run.

    The demand of a pair is the one of the rule, and its damage follows from that demand. The
    building has fallen under a pair if it has under one of the components, and a pair without a
    result of one component has no result. Key, rank, intensity and peak acceleration are those of
    the first component.
    """
    if rule.demand == SEPARATE or not rule.pairs:
        return of
    groups = places_of_motions(of, rule)
    firsts = [group[0] for group in groups]
    demand = np.array([rule.combine(of.demand[group]) for group in groups])

    # What failed counts before what fell, as for profiles.
    status = []
    for group in groups:
        ends = [of.status[place] for place in group]
        failed = [end for end in ends if end not in (DONE, *FALLEN)]
        fell = [end for end in ends if end in FALLEN]
        status.append(next(iter([*failed, *fell]), DONE))
    return replace(
        of,
        keys=[of.keys[place] for place in firsts],
        rank=of.rank[firsts],
        status=status,
        demand=demand,
        probability=probabilities(of.states, demand, status),
        sa=of.sa[firsts],
        pga=of.pga[firsts],
    )


def level_values(store: Store) -> list[float]:
    """The levels of a campaign from the smallest: values of a measure, SI units, or factors; none
    where motions have factors of their own, whose levels are their numbers from 1."""
    settings = store.parameters()
    return sorted(settings.get("levels") or settings.get("scales") or (), key=abs)


class Mean(NamedTuple):
    """A mean over runs with its standard error over the ground motions; nan where there is none."""

    value: Array
    error: Array


@dataclass(frozen=True)
class TypeDamage:
    """The damage of a type of buildings, or of one building, in one event and at one level.

    Attributes
    ----------
    type, building : str
        The type, and the building; empty for all of the type.
    event : str
        Of a ground motion field; empty where there are none.
    level : float
        As `level_values` has it.
    states : DamageStates
        Of the type.
    buildings, runs, failed : int
        Buildings, their runs, and those of them without a result, which have no part in what
        follows. The runs under a pair that counts as one motion are one.
    probability : Mean
        Of each of `states.outcomes`.
    loss : Mean
        Of the loss ratio; arrays of one number, nan where losses are not told.
    loss_sd : float
        Standard deviation of the loss ratio of one building under one motion.
    value : float
        What the buildings with a result cost, each as often as it is there; nan where the inventory
        does not say it.
    money : Mean
        The mean loss of all of them together; arrays of one number, nan without costs.
    part : str
        What stands in the column of the inventory by which buildings are taken together.
    scatter : tuple of two floats
        Standard deviation of the money, or without costs of the mean loss ratio: with losses of the
        buildings that are independent of each other, and fully correlated.
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
    """Runs that are taken together: sums under each ground motion, a row of outcomes, loss and its
    square, and one of what the buildings cost and lose."""

    def __init__(self, states: DamageStates) -> None:
        self.states, self.buildings, self.runs, self.failed = states, 0, 0, 0
        self._sums: dict[int, Array] = {}
        self._money: dict[int, Array] = {}
        self._scatter = np.zeros(
            (2, 2)
        )  # of money, and of the loss ratio: sums of variances, and of deviations

    def add(
        self,
        of: BuildingDamage,
        chosen: NDArray[np.bool_],
        motions: NDArray[np.intp],
        value: float = math.nan,
        number: float = 1.0,
    ) -> None:
        """Take the runs of a building at one level; motions tells which one each run is under. It
        costs a value, that of a `number` of buildings alike."""
        counted = chosen & of.known
        self.buildings += 1
        self.runs += int(np.sum(chosen))
        self.failed += int(np.sum(chosen & ~counted))
        ones, loss = np.ones(len(of.keys)), (of.loss, of.squared_loss) if of.states.losses else ()
        rows = np.column_stack([ones, of.probability, *loss])
        for motion in np.unique(motions[counted]).tolist():
            added = rows[counted & (motions == motion)].sum(axis=0)
            self._sums[motion] = self._sums[motion] + added if motion in self._sums else added
            if of.states.losses and value == value:  # its runs share what it costs
                share = value / float(np.sum(counted)) * added[[0, -2]]
                self._money[motion] = (
                    self._money[motion] + share if motion in self._money else share
                )
        # How its loss scatters: from run to run, and with the thresholds of its states.
        if of.states.losses and counted.any() and number > 0.0:
            mean = float(of.loss[counted].mean())
            deviation = math.sqrt(max(float(of.squared_loss[counted].mean()) - mean**2, 0.0))
            for sums, worth in zip(self._scatter, (value, float(np.sum(counted))), strict=True):
                if worth == worth:
                    sums += (worth * deviation) ** 2 / number, worth * deviation

    def damage(
        self, name: str, building: str, event: str, level: float, part: str = ""
    ) -> TypeDamage:
        """What the runs tell."""
        count = len(self.states.outcomes)
        # Rows by motion: the error is that between motions, under which buildings err alike.
        sums = np.array(list(self._sums.values()))
        mean = _mean(sums) if len(sums) else Mean(*np.full((2, count), math.nan))
        probability = Mean(mean.value[:count], mean.error[:count])
        loss = money = Mean(*np.full((2, 1), math.nan))
        sd = value = math.nan
        # The last two sums are those of the loss and its square.
        if self.states.losses and len(sums):
            loss = Mean(mean.value[-2:-1], mean.error[-2:-1])
            sd = math.sqrt(max(float(mean.value[-1] - mean.value[-2] ** 2), 0.0))
        # The mean over motions of what is lost, as a part of what the buildings cost under each.
        squares, deviations = self._scatter[0 if self._money else 1].tolist()
        whole = 1.0 if self._money else max(float(self.runs - self.failed), 1.0)
        if self._money:
            rows = np.array(list(self._money.values()))
            value = float(rows[:, 0].sum())
            if value > 0.0:
                money = Mean(*(value * part for part in _mean(rows)))
        told = (
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
            *told,
            part,
            (math.sqrt(squares) / whole, deviations / whole),
        )


def _mean(sums: Array) -> Mean:
    """The mean over all runs of rows of sums under each motion, the first of which counts the runs;
    its error that of leaving out the motions one by one (jackknife)."""
    counts, motions = sums[:, :1], len(sums)
    value = sums[:, 1:].sum(axis=0) / counts.sum()
    if motions < 2:
        return Mean(value, np.full(value.size, math.nan))
    # By how much the mean changes without each; nan where only one motion counts.
    with np.errstate(divide="ignore", invalid="ignore"):
        change = (counts * value - sums[:, 1:]) / (counts.sum() - counts)
        return Mean(value, np.sqrt((motions - 1) * np.var(change, axis=0)))


def group_damages(
    store: Store, *, by_building: bool = False, by: str | None = None
) -> Iterator[TypeDamage]:
    """The damage of each type in each event and at each level, or of each building, or `by` a
    column of the inventory, of all types together; by nothing ("") of all buildings. One building
    is held at a time."""
    rule, levels, events = store.pair_rule(), level_values(store), ["", *store.events()]
    of_types: dict[tuple[str, int, int], _Group] = {}
    columns = [title.lower() for title in store.inventory_columns()]

    # What a row is called by: the type, the event and the level, or a value of the column asked
    # for.
    def told(group: _Group, building: str, key: tuple[str, int, int]) -> TypeDamage:
        name, event, rank = key
        level = levels[rank] if levels else rank + 1.0
        return group.damage(
            "" if by is not None else name, building, events[event], level, name if by else ""
        )

    for of_runs in building_damages(store):
        of = by_motion(of_runs, rule)
        cells = (
            dict(zip(columns, store.carried(of.number), strict=False))
            if COST in columns or by
            else {}
        )
        # A row of an inventory may stand for several buildings, each of this cost.
        number_alike = cell_number(cells[NUMBER]) if cells.get(NUMBER) else 1.0
        value = cell_number(cells.get(COST, "")) * number_alike
        name = of.type if by is None else cells.get(by.lower(), "")
        motions = np.array([rule.recordings[record] for record, _, _ in of.keys])
        event = np.array([sample if len(events) > 1 else 0 for _, _, sample in of.keys])
        # A building's own numbers are given out at once; those of types are summed up to the end.
        for number, rank in sorted(set(zip(event.tolist(), of.rank.tolist(), strict=True))):
            chosen, key = (of.rank == rank) & (event == number), (name, number, rank)
            group = (
                _Group(of.states) if by_building else of_types.setdefault(key, _Group(of.states))
            )
            group.add(of, chosen, motions, value, number_alike)
            if by_building:
                yield told(group, of.building, key)
    for key in sorted(of_types):
        yield told(of_types[key], "", key)
