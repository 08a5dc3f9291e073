"""Demand of a pair: rule that combines the results under the two horizontal components of a
recording to the result of a single ground motion.

The rule is specified once (`pair_demand` of the records, `--pair-demand`) and used by profiles,
damage, losses, maps, incremental dynamic analyses and fragility functions:

- `larger`: the pair is one motion, and each demand is the larger value of the two components
- `mean`: the pair is one motion, and each demand is the mean of the two components
- `separate`: each component is a separate motion

A pair is two components that were read as a pair, or two records that are recognized as such by
their names. With `larger` and `mean` the building has collapsed under a pair if it has collapsed
under a component, and a pair has no result if a component has no result.

This module also decides for all studies which runs are one ground motion, which motions count, and
how they are weighted. The runs of a building at a level are arrays: the index of the
motion of each run, its outcome, and its demands. The arrays of the motions follow from them. In an
array of demands infinity is a collapse, and NaN is a motion without a result, so that the fractiles
(`tdint.fractiles.fractiles`) need no other argument.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import RecordError, UsageError, did_you_mean
from tdint.ground_motion import horizontals
from tdint.ground_motion.axes import along_axes
from tdint.ground_motion.reading.suites import GroundMotion, SuiteMotion, suite_motions
from tdint.ground_motion.record import Record
from tdint.model.status import DONE, FALLEN
from tdint.number_parsing import abbreviate, pluralize

if TYPE_CHECKING:
    from tdint.model.definition import Model

LARGER, MEAN, SEPARATE = "larger", "mean", "separate"
PAIR_DEMANDS = (LARGER, MEAN, SEPARATE)
"""Allowed demands of a pair; the first is the default."""

_DESCRIPTIONS = {
    LARGER: "each pair counts once, with the larger demand of its two components",
    MEAN: "each pair counts once, with the mean demand of its two components",
    SEPARATE: "each component of a pair counts as a separate motion",
}


def check_pair_demand(demand: str) -> str:
    """Return the name of a rule for the demand of a pair if it is one of `PAIR_DEMANDS`.

    Raises
    ------
    UsageError
        The text is not an item of `PAIR_DEMANDS`.
    """
    if demand not in PAIR_DEMANDS:
        raise UsageError(
            f"pair_demand must be {', '.join(PAIR_DEMANDS[:-1])} or {PAIR_DEMANDS[-1]}, got "
            f"{demand!r}{did_you_mean(demand, PAIR_DEMANDS)}"
        )
    return demand


def recording_numbers(records: Mapping[int, tuple[str, str, int]]) -> dict[int, int]:
    """Assign each record to a recording, which is identified by the number of its first component.

    Parameters
    ----------
    records : mapping of int to (str, str, int)
        Name, component and direction of each record by its number. If two components were read as
        a pair, the direction of the second component is 2, and its number is the number of the
        first component plus 1.

    Returns
    -------
    dict of int to int
        Number of the first component of the recording, by the number of the record. For a record
        without a partner, both numbers are equal.
    """
    records_of_name: dict[tuple[str, str], list[int]] = defaultdict(list)
    names = horizontals.motion_names([name for name, _, _ in records.values()])
    codes: dict[int, str] = {}
    for (number, (_, component, _)), name in zip(records.items(), names, strict=True):
        station, codes[number] = station_and_code(component)
        records_of_name[name, station].append(number)
    first_component = {number: number for number in records}

    # Two records with the same name apart from the component are one recording, if the directions
    # of the components are at right angles. A record of unknown component has the component of its
    # file.
    for first, *others in records_of_name.values():
        if len(others) == 1:
            (second,) = others
            directions = [
                codes[number] or horizontals.component_in_name(records[number][0])
                for number in (first, second)
            ]
            if horizontals.at_right_angles(*directions):
                first_component[second] = first

    # The second component of a pair that was read as a pair has the direction 2; the first
    # component is the record before it.
    for number, (_, _, direction) in records.items():
        if direction > 1:
            first_component[number] = number - 1
    return first_component


def station_and_code(component: str) -> tuple[str, str]:
    """Return the station and the channel code of an id NET.STA.LOC.CHA, the name of a
    component in a file with several stations; a name of another form is a code."""
    station, _, code = component.rpartition(".")
    return (station, code) if station.count(".") == 2 else ("", component)


@dataclass(frozen=True)
class PairRule:
    """Rule that combines the components of pairs.

    Attributes
    ----------
    demand : str
        An item of `PAIR_DEMANDS`.
    recordings : mapping of int to int
        Number of the first component of the recording to which a record belongs, by the number of
        the record. Results under the two components of a recording are correlated, regardless of
        the rule that is used.
    """

    demand: str = LARGER
    recordings: Mapping[int, int] = field(default_factory=dict)

    @classmethod
    def from_motions(cls, motions: Sequence[SuiteMotion], demand: str | None) -> Self:
        """Return the rule for motions that have been read.

        Parameters
        ----------
        motions : sequence of SuiteMotion
            The motions, in the order of their numbers.
        demand : str | None
            An item of `PAIR_DEMANDS`; None: the default.
        """
        records = {
            number: (motion.name, motion.component, motion.direction)
            for number, motion in enumerate(motions)
        }
        return cls(demand or LARGER, recording_numbers(records))

    @property
    def pairs(self) -> int:
        """Number of pairs in the records."""
        return sum(number != first for number, first in self.recordings.items())

    @property
    def demand_if_pairs(self) -> str:
        """Name of the rule if there are pairs; empty if there are none, because the rule then has
        no effect."""
        return self.demand if self.pairs else ""

    @property
    def partners(self) -> dict[int, int]:
        """Number of the first component by the number of the second component."""
        return {number: first for number, first in self.recordings.items() if number != first}

    def motion_key(self, run: Run, name: str) -> Hashable:
        """Return the key of the ground motion of a run at its level. `name` is the name of the
        motion (`Place`), which the components of a pair have in common; each component is a motion
        if components count separately."""
        return run if self.demand == SEPARATE else (name, run.sample)

    def motions_of(self, runs: Sequence[Run]) -> Indices:
        """Return the index of the ground motion of each run of a building at one level."""
        places = motions_and_levels(runs, [math.nan] * len(runs), self.recordings)
        return indices_of(
            self.motion_key(run, place.motion) for run, place in zip(runs, places, strict=True)
        )

    def note(self, files: Sequence[str] = (), *, is_default: bool = True) -> str:
        """Return one line that reports the number of recognized pairs, their names and the rule for
        their demand.

        Parameters
        ----------
        files : sequence of str
            File of each record, by its number; both components of a pair may be in one file or in
            two. Files of a pair are listed by their common name. None are listed by default.
        is_default : bool
            True if the user specified no rule: the option that changes it is added.
        """
        # Both components of each pair, in the order of the records
        pairs = self.partners.items() if files else ()
        names = [files[number] for pair in pairs for number in reversed(pair)]
        listed = abbreviate(list(dict.fromkeys(horizontals.motion_names(names))), _MAX_LISTED_PAIRS)
        others = " or ".join(other for other in PAIR_DEMANDS if other != self.demand)
        change = f"; --pair-demand {others} changes this" if is_default else ""
        counts = suite_text([*self.recordings.values()])
        return (
            f"{counts}{f' ({listed})' if listed else ''}: {describe_demand(self.demand)} "
            f"(pair_demand: {self.demand}{change})"
        )


_MAX_LISTED_PAIRS = 4  # maximum number of pairs in a note


def suite_text(recording: Sequence[Hashable]) -> str:
    """Return the text `7 components, 4 recordings, 3 pairs` from the recording of each component;
    `4 records` if no two belong to one recording."""
    components, recordings = len(recording), len(set(recording))
    if components == recordings:
        return pluralize(components, "record")
    nouns = {"component": components, "recording": recordings, "pair": components - recordings}
    return ", ".join(pluralize(count, noun) for noun, count in nouns.items())


def check_pairs(motions: Sequence[SuiteMotion], rule: PairRule) -> None:
    """Raise RecordError if two components count as one motion, because of their names, but cannot
    belong to the same recording: their sampling intervals, lengths or events differ."""
    if rule.demand == SEPARATE:
        return
    for second, first in rule.partners.items():
        # Components that were read as a pair (direction 2) have been checked by the reader.
        if motions[second].direction != 2:
            horizontals.check_components(motions[first].record, motions[second].record)


def recordings_of(motions: Sequence[SuiteMotion]) -> list[GroundMotion]:
    """Return the recording to which each motion belongs: a pair, or a single record.

    Two single records that are a pair by their names have the same pair. Components that do not fit
    together, for example with different sampling intervals, remain single records
    (`check_pairs`).
    """
    return _recordings(motions, PairRule.from_motions(motions, None), RecordError)


def _recordings(
    motions: Sequence[SuiteMotion], rule: PairRule, *tolerated: type[RecordError]
) -> list[GroundMotion]:
    """Return the recording of each motion; `tolerated` errors leave single records."""
    result = [motion.ground_motion for motion in motions]
    for second, first in rule.partners.items():
        components = (result[first], result[second])
        records = [motion for motion in components if isinstance(motion, Record)]
        if len(records) == 2:
            with suppress(*tolerated):
                result[first] = result[second] = horizontals.find_horizontals(
                    [horizontals.with_component(record, in_degrees=True) for record in records]
                )
    return result


def common_axis(models: Sequence[Model], source: str) -> float | None:
    """Return the azimuth of axis x of buildings in two directions, degrees; None if unknown.

    Raises
    ------
    UsageError
        A building has one direction, or the azimuths of the buildings differ.
    """
    axes = {model.axis_azimuth for model in models}
    if len(axes) > 1 or not all(model.across for model in models):
        raise UsageError(
            f"{source}: buildings with one and with two directions, or with different azimuths of "
            "axis x, cannot have the same ground motions; analyze each of them separately"
        )
    return axes.pop()


def motions_along_axes(
    motions: Sequence[SuiteMotion], models: Sequence[Model], source: str, demand: str | None
) -> tuple[SuiteMotion, ...]:
    """Return the ground motions of buildings in two directions: each pair is one motion along the
    axes of the buildings. `demand` is `larger` for the larger demand of both directions; None for
    resultants.

    Raises
    ------
    UsageError
        A building has one direction, the azimuths of the buildings differ, or the demand is
        `mean` or `separate`.
    RecordError
        A motion has no second component.
    """
    if demand not in (None, LARGER):
        raise UsageError(
            f"{source}: pair_demand {demand} cannot be used with two directions; use {LARGER}, or "
            "omit it for resultants"
        )
    axis = common_axis(models, source)
    along = []
    for pair in {id(motion): motion for motion in recordings_of(motions)}.values():
        if not isinstance(pair, horizontals.Horizontals):
            raise RecordError(
                f"{pair.source}: buildings with two directions require both horizontal components; "
                f"the second component of {pair.name} was not found"
            )
        record = along_axes(pair, axis, larger=demand == LARGER)
        along.append(SuiteMotion(record, pair.source, pair.component, pair))
    return tuple(along)


def join_pairs(motions: Sequence[GroundMotion]) -> list[GroundMotion]:
    """Return the ground motions, with two single records replaced by a pair if their names state
    that they belong to the same recording. A pair is at the position of its first record.

    Raises
    ------
    RecordError
        Two such records cannot be a pair, for example because their sampling intervals differ.
    """
    records = suite_motions(motions)
    rule = PairRule.from_motions(records, None)
    recordings = _recordings(records, rule)
    return [recordings[number] for number, first in rule.recordings.items() if number == first]


def describe_demand(demand: str) -> str:
    """Return a clause that describes the demand of a pair."""
    return _DESCRIPTIONS[demand]


# ---- Motions of runs, their outcomes and demands


class Run(NamedTuple):
    """Run of a building.

    Attributes
    ----------
    motion : int
        Number of the ground motion in the campaign.
    scale : float
        Scale factor of the ground motion; a negative factor reverses its direction.
    sample : int
        Number of the random sample of the building's parameters; 0: the building as specified.
    """

    motion: int
    scale: float
    sample: int = 0


class Place(NamedTuple):
    """Place of a run in the suite of its building.

    Attributes
    ----------
    motion : str
        Name of the ground motion of the run at its level. The components of a recording with equal
        factors have the same name, the number of the recording from 1. If a recording has several
        factors at a level, each is a motion: `4-1`, `4-2`.
    level : float
        Level: value of the intensity measure (SI units), common scale factor, or number of the
        level. NaN if all motions are one suite with individual factors.
    """

    motion: str = ""
    level: float = math.nan


def motions_and_levels(
    runs: Sequence[Run], levels: Sequence[float], recordings: Mapping[int, int]
) -> list[Place]:
    """Return the ground motion and the level of each run of a building.

    Components are one motion if recording, sample, level and factor are equal. This function is the
    only place that decides it; the results are stored with the runs.
    """
    # A level of NaN is not equal to NaN.
    keys = [
        (recordings[run.motion], run.sample, None if math.isnan(level) else level)
        for run, level in zip(runs, levels, strict=True)
    ]
    factors: dict[tuple[int, int, float | None], list[float]] = {}
    for key, run in zip(keys, runs, strict=True):
        known = factors.setdefault(key, [])
        if run.scale not in known:
            known.append(run.scale)
    places = []
    for key, run, level in zip(keys, runs, levels, strict=True):
        name = f"{key[0] + 1}"
        if len(factors[key]) > 1:
            name += f"-{factors[key].index(run.scale) + 1}"
        places.append(Place(name, level))
    return places


COMPLETED, COLLAPSED, FAILED = 0, 1, 2
"""Outcomes of runs and of motions. The outcome of a pair is the larger one of its components."""

Outcomes = NDArray[np.int8]
Indices = NDArray[np.intp]


def outcomes_of(statuses: Iterable[str]) -> Outcomes:
    """Return the outcomes of runs from the statuses of tables and stores."""
    codes = {DONE: COMPLETED, **dict.fromkeys(FALLEN, COLLAPSED)}
    return np.array([codes.get(status, FAILED) for status in statuses], np.int8)


def indices_of(keys: Iterable[Hashable]) -> Indices:
    """Return the index of the motion of each run from a key of the motion (`PairRule.motion_key`,
    and sample, event or factor); motions are numbered in the order of their first runs."""
    index_of_key: dict[Hashable, int] = {}
    return np.array([index_of_key.setdefault(key, len(index_of_key)) for key in keys], np.intp)


def first_runs(motion: Indices) -> Indices:
    """Return the index of the first run of each motion."""
    return np.unique(motion, return_index=True)[1]


def last_runs(motion: Indices) -> Indices:
    """Return the index of the last run of each motion."""
    return motion.size - 1 - np.unique(motion[::-1], return_index=True)[1]


def worst_runs(motion: Indices, outcome: Outcomes) -> Indices:
    """Return the index of the first run with the outcome of the motion, for each motion."""
    order = np.lexsort((np.arange(motion.size), -outcome.astype(int), motion))
    return order[np.unique(motion[order], return_index=True)[1]]


def outcomes_of_motions(motion: Indices, outcome: Outcomes) -> Outcomes:
    """Return the outcome of each motion: failed if a component has no result, otherwise collapsed
    if the building collapsed under a component."""
    result = np.full(first_runs(motion).size, COMPLETED, np.int8)
    np.maximum.at(result, motion, outcome)
    return result


def demands_of_motions(motion: Indices, values: Array, pair_demand: str) -> Array:
    """Return the demand of each motion, the maximum or the mean of its components.

    Parameters
    ----------
    values : ndarray, shape (runs, ...)
        Demands of the runs.
    pair_demand : str
        An item of `PAIR_DEMANDS`.
    """
    shape = (first_runs(motion).size, *values.shape[1:])
    if pair_demand == MEAN:
        total = np.zeros(shape)
        np.add.at(total, motion, values)
        return np.asarray((total.T / np.bincount(motion)).T)
    largest = np.full(shape, -np.inf)
    with np.errstate(invalid="ignore"):  # NaN: a run without a result
        np.maximum.at(largest, motion, values)
    return largest


def geometric_means(motion: Indices, values: Array) -> Array:
    """Return the geometric mean of the intensities of the components of each motion."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.exp(demands_of_motions(motion, np.log(values), MEAN)))


def with_outcomes(values: Array, outcome: Outcomes) -> Array:
    """Return demands with infinity for each collapse and NaN for each motion without a result."""
    result = np.array(values, float)
    result[outcome == COLLAPSED] = np.inf
    result[outcome == FAILED] = np.nan
    return result


class Counts(NamedTuple):
    """Numbers of motions of a suite."""

    completed: int
    collapsed: int
    failed: int

    @property
    def motions(self) -> int:
        """Number of all motions."""
        return sum(self)

    @property
    def lost(self) -> int:
        """Number of motions with collapse or without a result, which means exclude."""
        return self.collapsed + self.failed

    @property
    def text(self) -> str:
        """Numbers of lost motions, such as `8 collapsed and 1 failed`; empty if there are none."""
        counts = {"collapsed": self.collapsed, "failed": self.failed}
        return " and ".join(f"{count} {name}" for name, count in counts.items() if count)


def counts(outcome: Outcomes) -> Counts:
    """Return the numbers of motions by outcome."""
    return Counts(*np.bincount(outcome, minlength=3).tolist())
