"""Limits of demands by quantity, story and performance level, and their comparison with demands.

`check_limits` compares limits with the demands of a run, or with the mean demands of a suite of
ground motions. The demand of a story is its maximum response over time, averaged over the motions.
The story with the maximum ratio of demand to limit governs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, Self

from tdint.errors import UsageError, did_you_mean
from tdint.items import grouped

if TYPE_CHECKING:  # reading a model does not need numpy
    import numpy as np
    from numpy.typing import NDArray

    from tdint.arrays import Array


@dataclass(frozen=True)
class LimitedQuantity:
    """Response quantity that can be limited.

    Attributes
    ----------
    text : str
        Name of the quantity in sentences.
    location : str
        Location of the quantity: `story`, `floor`, `attachment` or `link`.
    peak : str
        Name of the peak response with the values of the quantity, shape (motions, n). Demands of
        attachments and links have the keys of `QUANTITIES`.
    per_height : bool
        True for the absolute value of the peak response divided by the story height.
    """

    unit: str
    text: str
    location: str
    peak: str
    per_height: bool = False

    @property
    def of_device(self) -> bool:
        """True for a quantity of attachments or links."""
        return self.location in ("attachment", "link")


DRIFT_RATIO, RESIDUAL = "drift_ratio", "residual_drift_ratio"
ISOLATOR, ACCELERATION = "isolator_displacement", "floor_acceleration"
STROKE, LINK_DEFORMATION, LINK_FORCE = "attachment_stroke", "link_deformation", "link_force"

QUANTITIES = {
    DRIFT_RATIO: LimitedQuantity("1", "drift ratio", "story", "peak_drift_ratio"),
    RESIDUAL: LimitedQuantity("1", "residual drift ratio", "story", "residual_drift", True),
    ISOLATOR: LimitedQuantity("m", "isolator displacement", "story", "peak_drift"),
    ACCELERATION: LimitedQuantity(
        "m/s^2", "floor acceleration", "floor", "peak_absolute_acceleration"
    ),
    STROKE: LimitedQuantity("m", "attachment stroke", "attachment", STROKE),
    LINK_DEFORMATION: LimitedQuantity("m", "link deformation", "link", LINK_DEFORMATION),
    LINK_FORCE: LimitedQuantity("N", "link force", "link", LINK_FORCE),
}
"""Quantities by their keys in the section `limits` of a model file."""


@dataclass(frozen=True)
class Limit:
    """Limit of a quantity for the stories, attachments or links of a building.

    Attributes
    ----------
    level : str
        Name of the performance level; empty for limits without a level.
    quantity : str
        A key of `QUANTITIES`.
    values : tuple of float
        Limit of each story, or of the floor above it, or of each attachment or link, SI units; nan
        without a limit.
    names : tuple of str
        Names of the attachments or links; empty for stories and floors.
    """

    level: str
    quantity: str
    values: tuple[float, ...]
    names: tuple[str, ...] = ()

    @classmethod
    def from_json(cls, stored: Sequence[Any]) -> Self:
        """Create a limit from the list that `as_json` returned."""
        level, quantity, limits, names = stored
        values = tuple(math.nan if limit is None else limit for limit in limits)
        return cls(level, quantity, values, tuple(names))

    def as_json(self) -> list[Any]:
        """Return the limit as a list that JSON can represent: level, quantity, the limits (None: no
        limit), because JSON has no nan, and the names."""
        return [
            self.level,
            self.quantity,
            [None if math.isnan(value) else value for value in self.values],
            list(self.names),
        ]

    def applies_to(self, demands: Array) -> tuple[Array, NDArray[np.int64], Array]:
        """Return the demands with a limit, their places, counted from 1, and the limits.

        The last axis of `demands` is the story, floor, attachment or link.
        """
        import numpy as np

        values = np.array(self.values)
        has_limit = ~np.isnan(values)
        return demands[..., has_limit], np.flatnonzero(has_limit) + 1, values[has_limit]


@dataclass(frozen=True)
class LimitCheck:
    """Comparison of the demands of a building with a limit.

    Attributes
    ----------
    level, quantity : str
        As in `Limit`.
    story : int
        Story, floor, attachment or link, from 1, with the maximum ratio of demand to limit.
    demand : float
        Demand in this story, SI units: of the run, or mean over the motions of a suite.
    limit : float
        Limit in this story, SI units.
    within : bool
        True if no story exceeds its limit.
    largest : float
        Maximum demand of all motions and stories, SI units.
    largest_story : int
        Story, floor, attachment or link with `largest`.
    motion : str
        Motion with `largest`.
    motions : int
        Number of motions of the mean; 1 for a run.
    names : tuple of str
        As in `Limit`.
    statistic : str
        Statistic of a suite that the demand is: `mean`, or `1.2 times the median`.
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
    motions: int
    names: tuple[str, ...] = ()
    statistic: str = "mean"

    def place(self, number: int) -> int | str:
        """Return the number of a story or floor, or the name of an attachment or link, from its
        number."""
        return self.names[number - 1] if self.names else number

    @property
    def ratio(self) -> float:
        """Demand divided by limit."""
        return self.demand / self.limit


_UNACCEPTABLE_FACTOR = 1.2
"""Factor on the median with an unacceptable response (ASCE 7-16, 16.4.1.1)."""


def design_demands(demands: Array, *, unacceptable: int = 0) -> Array:
    """Return the demand of a suite that is compared with a limit: the mean over the motions.

    With unacceptable responses, it is the larger of 1.2 times the median over all motions, where
    an unacceptable response is larger than every value, and the mean over the other motions (ASCE
    7-16, 16.4.1.1, which accepts one unacceptable response).

    Parameters
    ----------
    demands : ndarray, shape (motions, ...)
        Demands under the motions with an acceptable response.
    unacceptable : int
        Number of unacceptable responses; default 0.
    """
    import numpy as np

    from tdint.fractiles import fractiles

    mean: Array = np.mean(demands, axis=0)
    if not unacceptable:
        return mean
    largest = np.full((unacceptable, *demands.shape[1:]), math.inf)
    median = fractiles(np.concatenate([demands, largest]), (0.5,))[0]
    value: Array = np.maximum(_UNACCEPTABLE_FACTOR * median, mean)
    return value


def check_limits(
    limits: Iterable[Limit],
    peaks: Mapping[str, Array],
    height: Array,
    motions: Sequence[str],
    unacceptable: int = 0,
) -> tuple[LimitCheck, ...]:
    """Compare limits with the demands of a building (`design_demands`).

    Parameters
    ----------
    peaks : mapping of str to ndarray, shape (motions, n)
        Peak responses of the stories under each motion, by the names of
        `tdint.response.runs.outcome.StoryValues`, and of attachments and links
        (`device_demands`).
    height : ndarray, shape (n,)
        Story heights, m; nan for isolators.

    Returns
    -------
    tuple of LimitCheck
        Comparison for each limit, in the order of the limits; empty without motions.
    """
    import numpy as np

    if not motions:
        return ()
    checks = []
    for limit in limits:
        quantity = QUANTITIES[limit.quantity]
        all_demands = peaks[quantity.peak]
        if quantity.per_height:
            all_demands = abs(all_demands) / height
        demands, story_numbers, limit_values = limit.applies_to(all_demands)
        # Use the maximum of the story means, as in design codes, not the mean of the maxima.
        mean_demands = design_demands(demands, unacceptable=unacceptable)
        # `argmax` returns the index of the first nan, if any: a limit with an unknown demand is
        # not met.
        governing = int(np.argmax(mean_demands / limit_values))
        motion, story = np.unravel_index(int(np.argmax(demands)), demands.shape)
        is_mean = not mean_demands[governing] > np.mean(demands[:, governing])
        checks.append(
            LimitCheck(
                limit.level,
                limit.quantity,
                story=int(story_numbers[governing]),
                demand=float(mean_demands[governing]),
                limit=float(limit_values[governing]),
                within=bool(np.all(mean_demands <= limit_values)),
                largest=float(demands[motion, story]),
                largest_story=int(story_numbers[story]),
                motion=motions[int(motion)],
                motions=len(motions),
                names=limit.names,
                statistic="mean" if is_mean else f"{_UNACCEPTABLE_FACTOR:g} times the median",
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
    unacceptable: int = 0,
) -> tuple[LimitCheck, ...]:
    """Select the limits that apply to a building, and compare them with the demands of a run or
    with the mean demands of a suite. Without motions the result is empty.

    `requested` is a drift limit that is used instead of the limits of the model, or the name of a
    performance level of the model. Heights are nan for isolators. If the building collapsed, or has
    no result, under a motion (`has_failure`), no limit is met. `unacceptable` is the number of such
    motions that are accepted (`design_demands`).

    Raises
    ------
    UsageError
        The requested limit is invalid, as for `chosen_limits`; or the peaks do not contain the
        attachments and links of a limit.
    """
    if not motions:
        return ()
    limits = chosen_limits(limits, requested, peaks["peak_drift_ratio"], name)
    for limit in limits:
        if QUANTITIES[limit.quantity].of_device and limit.quantity not in peaks:
            raise UsageError(
                f"{name}: these results contain no attachments and links, which the limit "
                f"`{limit.quantity}` requires; use `tdint run` or a campaign, or another limit"
            )
    checks = check_limits(limits, peaks, height, motions, unacceptable)
    return tuple(replace(check, within=False) for check in checks) if has_failure else checks


def device_demands(
    drift: Array, spring_force: Array, damper_force: Array, attachments: int
) -> dict[str, Array]:
    """Return the demands of attachments and links by the keys of `QUANTITIES`.

    The force of a link is the larger of the peaks of its spring and of its dashpot.

    Parameters
    ----------
    drift, spring_force, damper_force : ndarray, shape (..., devices)
        Peaks of the attachments and then the links, m and N.
    attachments : int
        Number of attachments.
    """
    import numpy as np

    links = slice(attachments, None)
    return {
        STROKE: drift[..., :attachments],
        LINK_DEFORMATION: drift[..., links],
        LINK_FORCE: np.fmax(spring_force, damper_force)[..., links],
    }


def by_level(checks: Iterable[LimitCheck]) -> dict[str, list[LimitCheck]]:
    """Group comparisons with limits by performance level.

    The first comparison of each group governs: it has the maximum ratio of demand to limit.
    """
    checks_by_level = grouped((check.level, check) for check in checks)

    def rank(check: LimitCheck) -> tuple[bool, float]:
        """Return the sort key of a comparison. An unknown ratio (nan) precedes the maximum ratio,
        because a limit without a known demand is not met."""
        return not math.isnan(check.ratio), -check.ratio

    return {level: sorted(group, key=rank) for level, group in checks_by_level.items()}


def chosen_limits(
    limits: tuple[Limit, ...], requested: float | str | None, ratios: Array, name: str
) -> tuple[Limit, ...]:
    """Return the limits that apply to a building.

    Parameters
    ----------
    requested : float, str or None
        Drift limit that is used instead of the limits of the model, or the name of a performance
        level of the model; None for all limits of the model.
    ratios : ndarray, shape (..., n)
        Peak drift ratios; nan for a story without a drift ratio.

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
    # For nan, != is true. Stories with nan under all motions have no drift ratio.
    has_no_ratio = (ratios != ratios).reshape(-1, ratios.shape[-1]).all(axis=0)
    if has_no_ratio.all():
        raise UsageError(
            f"{name}: a limit of drift ratios requires story heights; add `height` to the stories "
            "of the model"
        )
    values = tuple(math.nan if is_missing else requested for is_missing in has_no_ratio.tolist())
    return (Limit("", DRIFT_RATIO, values),)


def check_level(limits: Iterable[Limit], level: str, name: str) -> None:
    """Raise UsageError if the limits of a building do not include a performance level."""
    levels = list(dict.fromkeys(limit.level for limit in limits if limit.level))
    if level not in levels:
        available = f"; its levels: {', '.join(levels)}" if levels else "; its model has no levels"
        raise UsageError(
            f"--limit {level}: {name} has no performance level {level!r}"
            f"{did_you_mean(level, levels) or available}"
        )


def uniform_drift_limit(limits: Iterable[Limit]) -> float | None:
    """Return the limit of the drift ratio, if it is the same in all stories with such a limit, for
    figures. Without a common limit, the result is `None`."""
    values = {
        value
        for limit in limits
        if limit.quantity == DRIFT_RATIO
        for value in limit.values
        if not math.isnan(value)
    }
    return values.pop() if len(values) == 1 else None


def isolator_check(
    isolators: Sequence[int], peaks: Mapping[str, Array], height: Array, motions: Sequence[str]
) -> LimitCheck | None:
    """Return the maximum displacement of isolators as a comparison with an infinite limit; None
    without isolators or motions.

    `isolators` are the stories that are isolators, counted from 1; see `check_limits` for the other
    arguments.
    """
    values = tuple(
        math.inf if number in isolators else math.nan for number in range(1, len(height) + 1)
    )
    limits = (Limit("", ISOLATOR, values),) if isolators else ()
    return next(iter(check_limits(limits, peaks, height, motions)), None)
