"""Which runs are one ground motion, which motions count, and how they are weighted.

All studies use these functions. The runs of a building at a level are arrays: the index of the
motion of each run, its outcome, and its demands. The arrays of the motions follow from them. In an
array of demands infinity is a collapse, and NaN is a motion without a result, so that the fractiles
(`tdint.fractiles.fractiles`) need no other argument.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.fractiles import fractiles
from tdint.model.status import DONE, FALLEN
from tdint.studies.motions.pairs import MEAN

COMPLETED, COLLAPSED, FAILED = 0, 1, 2
"""Outcomes of runs and of motions. The outcome of a pair is the larger one of its components."""

Outcomes = NDArray[np.int8]
Indices = NDArray[np.intp]

MIN_COMMON = 3
"""Minimum number of common motions for a ratio if a motion of one of the buildings is lost: the
mean of two motions of eleven says nothing about the suite."""


def outcomes_of(statuses: Iterable[str]) -> Outcomes:
    """Return the outcomes of runs from the statuses of tables and stores."""
    codes = {DONE: COMPLETED, **dict.fromkeys(FALLEN, COLLAPSED)}
    return np.array([codes.get(status, FAILED) for status in statuses], np.int8)


def indices_of(keys: Iterable[Hashable]) -> Indices:
    """Return the index of the motion of each run from a key of the motion (`PairRule.motion`, and
    sample, event or factor); motions are numbered in the order of their first runs."""
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


class MotionRatios(NamedTuple):
    """Ratios of a building to a baseline: of the maxima over the stories of each building, then of
    each story of the baseline. NaN if too few motions are common; infinity for a collapse.

    Attributes
    ----------
    motions : int
        Number of motions of the mean and of the maximum; the median is over all motions.
    """

    mean: Array
    median: Array
    max: Array
    motions: int


def ratios_to(
    base: Array,
    variant: Array,
    stories: Sequence[tuple[int, int]] = (),
    apart: tuple[Sequence[int], Sequence[int]] = ((), ()),
) -> MotionRatios:
    """Return the ratios of the demands of a building to those of a baseline, over the motions that
    both completed; the medians are over all motions, a collapse above every value.

    Parameters
    ----------
    base, variant : ndarray, shape (motions, stories)
        Demands under the same motions, infinite for a collapse and NaN without a result.
    stories : sequence of (int, int)
        Indices of corresponding stories of the building and of the baseline.
    apart : tuple of two sequences of int
        Indices of the stories of the baseline, and of the building, that the maxima omit.
    """
    is_common = np.asarray(np.isfinite(base).any(axis=1) & np.isfinite(variant).any(axis=1))
    motions = int(is_common.sum())
    has_collapse = bool(np.isinf(base).any() or np.isinf(variant).any())
    if motions < (MIN_COMMON if has_collapse else 1):
        is_common[:] = False
    numerator, denominator = np.full((2, 3, 1 + base.shape[1]), np.nan)
    statistics = []
    for values, omitted, quotients in zip(
        (base, variant), apart, (denominator, numerator), strict=True
    ):
        common = values[is_common] if is_common.any() else np.full((1, values.shape[1]), np.nan)
        median = fractiles(values, (0.5,))[0]
        of_stories = np.array([common.mean(axis=0), median, common.max(axis=0)])
        # A story without a height has no drift ratio (NaN), which `fmax` omits.
        counted = np.delete(of_stories, omitted, axis=1)
        quotients[:, 0] = np.fmax.reduce(counted, axis=1, initial=-np.inf)
        statistics.append(of_stories)
    denominator[:, 1:] = statistics[0]
    for story, base_story in stories:
        numerator[:, 1 + base_story] = statistics[1][:, story]
    mean, median, largest = quotient(numerator, denominator)
    return MotionRatios(mean, median, largest, motions)


def quotient(numerator: Array, denominator: Array) -> Array:
    """Return a quotient; NaN if the denominator is zero or a number is missing, infinity if the
    numerator is a collapse and the denominator is not."""
    is_known = (denominator > 0.0) & np.isfinite(denominator) & (numerator >= 0.0)
    result = np.full(np.broadcast(numerator, denominator).shape, np.nan)
    return np.asarray(np.divide(numerator, denominator, out=result, where=is_known))


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
