"""Which level of intensity comes next: a function of the runs so far alone, so that a study goes on where it ended.

Hunt, bisect, fill (Vamvatsikos and Cornell 2002, doi 10.1002/eqe.141; 2004, doi 10.1193/1.1737737), and then look above
the capacity, where a building may stand again (structural resurrection).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from tdint.campaign.ida.runs import IdaRun

_HUNT = 1.5
"""Ratio of neighbouring levels while no collapse is known."""

_MOST_HUNTS = 40
_FILL = 1.2
"""Ratio of drifts of neighbouring levels up to which nothing is put between them."""

_PROBES = (1.25, 1.5)
"""Levels above the first collapse at which the building may stand again, over its level."""

_NEAR = 0.01
"""Levels that differ by less than this part, of themselves or of their bracket, are the same."""

_PLACES = (0.5, 0.25, 0.75, 0.375, 0.625)
"""Where between two levels, in the logarithm, a run is tried; the next one where the run before had no result."""

MOST_RUNS = 300


@dataclass(frozen=True)
class Levels:
    """What decides on the levels.

    Attributes
    ----------
    start : float
        The first level: the building should remain elastic.
    precision : float
        Bracket of the capacity, upper over lower level less 1.
    lowest_drift : float
        A drift ratio that one run at least stays below: the lowest threshold.
    most : float
        The largest level; capacities above it are censored.
    """

    start: float
    precision: float = 0.05
    lowest_drift: float = math.inf
    most: float = math.inf

    def next(self, runs: Sequence[IdaRun]) -> float | None:
        """The next level, None if all is known; `runs` in any order."""
        if not runs:
            return min(self.start, self.most)
        if len(runs) >= MOST_RUNS:
            return None
        for wanted in (self._hunt, self._bisect, self._descend, self._fill, self._probe):
            level = wanted(sorted(runs, key=lambda run: run.im))
            if level is not None:
                return level
        return None

    def _hunt(self, runs: list[IdaRun]) -> float | None:
        """Up until the building collapses; down until it stands."""
        collapse = first_collapse(runs)
        if collapse is None:
            highest = runs[-1].im
            if highest >= self.most or highest > self.start * _HUNT**_MOST_HUNTS:
                return None
            return min(highest * _HUNT, self.most)
        if last_stable(runs) is None and runs[0].im > self.start / _HUNT**_MOST_HUNTS:
            return runs[0].im / _HUNT
        return None

    def _bisect(self, runs: list[IdaRun]) -> float | None:
        """Between the last level at which it stands and the first at which it collapses."""
        low, high = last_stable(runs), first_collapse(runs)
        if low is None or high is None or high.im <= low.im * (1.0 + self.precision):
            return None
        return _between(low.im, high.im, runs)

    def _descend(self, runs: list[IdaRun]) -> float | None:
        """Down until the drift is below the lowest threshold."""
        stable = list(below_collapse(runs))
        if not stable or stable[0].drift_ratio < self.lowest_drift or runs[0].im < self.start / _HUNT**_MOST_HUNTS:
            return None
        return runs[0].im * max(0.1, min(1.0 / _HUNT, 0.8 * self.lowest_drift / stable[0].drift_ratio))

    def _fill(self, runs: list[IdaRun]) -> float | None:
        """Between neighbours of which the drifts differ by much."""
        for low, high in pairwise(below_collapse(runs)):
            small, large = sorted((low.drift_ratio, high.drift_ratio))
            if large > _FILL * small and high.im > low.im * (1.0 + self.precision):
                level = _between(low.im, high.im, runs)
                if level is not None:
                    return level
        return None

    def _probe(self, runs: list[IdaRun]) -> float | None:
        """Above the first collapse."""
        collapse = first_collapse(runs)
        if collapse is None:
            return None
        levels = (probe * collapse.im for probe in _PROBES if probe * collapse.im <= self.most)
        untried = (level for level in levels if all(abs(run.im - level) > _NEAR * level for run in runs))
        return next(untried, None)


def first_collapse(runs: Sequence[IdaRun]) -> IdaRun | None:
    """The lowest level at which the building collapses."""
    return min((run for run in runs if run.collapsed), key=lambda run: run.im, default=None)


def below_collapse(runs: Sequence[IdaRun]) -> Iterator[IdaRun]:
    """The levels below the first collapse at which the building stands, from the lowest."""
    collapse = first_collapse(runs)
    limit = math.inf if collapse is None else collapse.im
    return (run for run in sorted(runs, key=lambda run: run.im) if run.stable and run.im < limit)


def last_stable(runs: Sequence[IdaRun]) -> IdaRun | None:
    """The highest level below the first collapse at which the building stands."""
    return max(below_collapse(runs), key=lambda run: run.im, default=None)


def _between(low: float, high: float, runs: Sequence[IdaRun]) -> float | None:
    """A level between two neighbours that was not tried without a result."""
    tried = [run.im for run in runs if low < run.im < high]
    near = _NEAR * math.log(high / low)
    levels = (low * (high / low) ** place for place in _PLACES)
    return next((level for level in levels if all(abs(math.log(im / level)) > near for im in tried)), None)
