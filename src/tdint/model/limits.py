"""Limits of demands by quantity, story and performance level, and their comparison with demands.

One function, `check_limits`, compares limits with the demands of a run, or with the mean demands of
a suite: maximum of each motion over time, in each story; mean over the motions; maximum ratio of
demand to limit over the stories.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, Self

from tdint.errors import UsageError, did_you_mean

if TYPE_CHECKING:  # reading a model does not need numpy
    from tdint.arrays import Array


@dataclass(frozen=True)
class LimitedQuantity:
    """Quantity that a limit can apply to.

    Attributes
    ----------
    unit : str
        SI unit; 1 for a ratio.
    text : str
        Name in sentences.
    place : str
        Type of location: story or floor.
    values : callable
        Returns the absolute values, shape (motions, n), from the peaks by name and the heights.
    """

    unit: str
    text: str
    place: str
    values: Callable[[Mapping[str, Array], Array], Array]


DRIFT_RATIO, RESIDUAL = "drift_ratio", "residual_drift_ratio"
ISOLATOR, ACCELERATION = "isolator_displacement", "floor_acceleration"

QUANTITIES = {
    DRIFT_RATIO: LimitedQuantity(
        "1", "drift ratio", "story", lambda peaks, height: peaks["peak_drift_ratio"]
    ),
    RESIDUAL: LimitedQuantity(
        "1",
        "residual drift ratio",
        "story",
        lambda peaks, height: abs(peaks["residual_drift"]) / height,
    ),
    ISOLATOR: LimitedQuantity(
        "m", "isolator displacement", "story", lambda peaks, height: peaks["peak_drift"]
    ),
    ACCELERATION: LimitedQuantity(
        "m/s^2",
        "floor acceleration",
        "floor",
        lambda peaks, height: peaks["peak_absolute_acceleration"],
    ),
}
"""Quantities by their keys in the section `limits` of a model file."""


@dataclass(frozen=True)
class Limit:
    """Limit of a quantity for the stories of a building.

    Attributes
    ----------
    level : str
        Name of the performance level; empty for limits without a level.
    quantity : str
        A key of `QUANTITIES`.
    values : tuple of float
        Limit of each story, or of the floor above it, SI units; nan without a limit.
    """

    level: str
    quantity: str
    values: tuple[float, ...]

    @classmethod
    def of_json(cls, stored: Sequence[Any]) -> Self:
        """Create a limit from the list that `as_json` returned."""
        level, quantity, values = stored
        return cls(level, quantity, tuple(math.nan if v is None else v for v in values))

    def as_json(self) -> list[Any]:
        """Return the limit as a list that JSON can represent; null is a story without a limit."""
        return [
            self.level,
            self.quantity,
            [None if math.isnan(value) else value for value in self.values],
        ]


@dataclass(frozen=True)
class LimitCheck:
    """Comparison of the demands of a building with one limit.

    Attributes
    ----------
    level, quantity : str
        As in `Limit`.
    story : int
        Story or floor, from 1, with the maximum ratio of demand to limit.
    demand : float
        Demand in this story, SI units: of the run, or mean over the motions of a suite.
    limit : float
        Limit in this story, SI units.
    within : bool
        True if no story exceeds its limit.
    largest : float
        Maximum demand of all motions and stories, SI units.
    largest_story : int
        Story or floor with `largest`.
    motion : str
        Motion with `largest`.
    """

    level: str
    quantity: str
    story: int
    demand: float
    limit: float
    within: bool
    largest: float
    largest_story: int
    motion: str

    @property
    def ratio(self) -> float:
        """Demand divided by limit."""
        return self.demand / self.limit


def check_limits(
    limits: Iterable[Limit],
    peaks: Mapping[str, Array],
    height: Array,
    motions: Sequence[str],
) -> tuple[LimitCheck, ...]:
    """Compare limits with the demands of a building; empty without motions.

    Parameters
    ----------
    limits : iterable of Limit
        Limits of the building.
    peaks : mapping of str to ndarray, shape (motions, n)
        Peaks of the stories of each motion, by the names of `StoryValues`.
    height : ndarray, shape (n,)
        Story heights, m; nan for isolators.
    motions : sequence of str
        Names of the motions.

    Returns
    -------
    tuple of LimitCheck
        One comparison for each limit, in the order of the limits.
    """
    import numpy as np

    if not motions:
        return ()
    checks = []
    for limit in limits:
        limit_values = np.array(limit.values)
        has_limit = ~np.isnan(limit_values)
        demands = QUANTITIES[limit.quantity].values(peaks, height)[:, has_limit]
        story_numbers, limit_values = np.flatnonzero(has_limit) + 1, limit_values[has_limit]
        # Use the maximum of the story means, as in design codes, not the mean of the maxima.
        mean = np.mean(demands, axis=0)
        # A nan has the maximum ratio: a limit without a known demand is not met.
        governing = int(np.argmax(mean / limit_values))
        motion, story = np.unravel_index(int(np.argmax(demands)), demands.shape)
        checks.append(
            LimitCheck(
                limit.level,
                limit.quantity,
                int(story_numbers[governing]),
                float(mean[governing]),
                float(limit_values[governing]),
                bool(np.all(mean <= limit_values)),
                float(demands[motion, story]),
                int(story_numbers[story]),
                motions[int(motion)],
            )
        )
    return tuple(checks)


def check_demands(
    limits: tuple[Limit, ...],
    requested: float | str | None,
    peaks: Mapping[str, Array],
    height: Array,
    motions: Sequence[str],
    *,
    name: str,
    has_failure: bool,
) -> tuple[LimitCheck, ...]:
    """Compare the demands of a run or the mean demands of a suite with the limits that apply.

    Parameters
    ----------
    limits : tuple of Limit
        Limits of the model.
    requested : float, str or None
        Drift limit or name of a performance level, as in `chosen_limits`.
    peaks, height, motions
        As in `check_limits`.
    name : str
        Name of the building, for messages.
    has_failure : bool
        True if the building collapsed, or has no result, under a motion: no limit is then met.

    Raises
    ------
    UsageError
        As in `chosen_limits`.
    """
    if not motions:
        return ()
    limits = chosen_limits(limits, requested, peaks["peak_drift_ratio"], name)
    checks = check_limits(limits, peaks, height, motions)
    return tuple(replace(check, within=False) for check in checks) if has_failure else checks


def by_level(checks: Iterable[LimitCheck]) -> dict[str, list[LimitCheck]]:
    """Return the comparisons of each performance level, the governing comparison first.

    The governing comparison has the maximum ratio of demand to limit.
    """
    levels: dict[str, list[LimitCheck]] = {}
    for check in checks:
        levels.setdefault(check.level, []).append(check)
    # The highest ratio of demand to limit comes first. An unknown ratio (nan) precedes it, so that
    # the first check states whether the level is met.
    return {
        level: sorted(of_level, key=lambda check: (not math.isnan(check.ratio), -check.ratio))
        for level, of_level in levels.items()
    }


def chosen_limits(
    limits: tuple[Limit, ...], requested: float | str | None, ratios: Array, name: str
) -> tuple[Limit, ...]:
    """Return the limits that apply to a building.

    Parameters
    ----------
    limits : tuple of Limit
        Limits of the model.
    requested : float, str or None
        Drift limit that is used instead of the limits of the model, or the name of a performance
        level of the model; None for all limits of the model.
    ratios : ndarray, shape (..., n)
        Peak drift ratios; nan for a story without a drift ratio.
    name : str
        Name of the building, for messages.

    Raises
    ------
    UsageError
        The limit is not a positive number, no story has a drift ratio, or the model does not have
        the performance level.
    """
    if requested is None:
        return limits
    if isinstance(requested, str):
        check_level(limits, requested, name)
        return tuple(limit for limit in limits if limit.level == requested)
    is_number = isinstance(requested, Real) and not isinstance(requested, bool)
    if not (is_number and 0.0 < requested < math.inf):
        raise UsageError(
            "a limit must be a positive drift ratio, such as 0.02, or the name of a performance "
            f"level, got {requested!r:.60}"
        )
    missing = (ratios != ratios).reshape(-1, ratios.shape[-1]).all(axis=0)  # nan
    if missing.all():
        raise UsageError(
            f"{name}: a limit of drift ratios requires story heights; add `height` to the stories "
            "of the model"
        )
    values = tuple(math.nan if without else requested for without in missing.tolist())
    return (Limit("", DRIFT_RATIO, values),)


def check_level(limits: Iterable[Limit], level: str, name: str) -> None:
    """Raise UsageError if limits of a building do not contain a performance level."""
    known = list(dict.fromkeys(limit.level for limit in limits if limit.level))
    if level not in known:
        available = f"; its levels: {', '.join(known)}" if known else "; its model has no levels"
        raise UsageError(
            f"--limit {level}: {name} has no performance level {level!r}"
            f"{did_you_mean(level, known) or available}"
        )


def uniform_drift_limit(limits: Iterable[Limit]) -> float | None:
    """Return the drift limit that all stories have in common, for figures; None without one."""
    values = {
        value
        for limit in limits
        if limit.quantity == DRIFT_RATIO
        for value in limit.values
        if not math.isnan(value)
    }
    return values.pop() if len(values) == 1 else None


def isolator_limits(isolators: Iterable[int], stories: int) -> tuple[Limit, ...]:
    """Return an infinite limit of the displacement of the isolators, to find their maximum.

    `isolators` are story numbers from 1; the result is empty without isolators.
    """
    numbers = set(isolators)
    values = tuple(math.inf if i + 1 in numbers else math.nan for i in range(stories))
    return (Limit("", ISOLATOR, values),) if numbers else ()
