"""Comparison of buildings, such as variants of a retrofit, under the same suite of ground motions.

A mean over the motions that a building survives cannot be compared with a mean over other motions:
a weak building that survives only the mild motions would appear better than a strong building. All
comparisons therefore use the motions that every compared building completes without collapse
(common motions). The number of collapses is stated separately, because it is a result that no mean
contains.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array
from tdint.errors import UsageError, did_you_mean
from tdint.number_parsing import abbreviate, pluralize
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.studies.campaign.story_profiles import Profile
from tdint.units import Quantity

MIN_COMMON = 3
"""Minimum number of common motions for a comparison if motions are lost by collapse: the mean of
two motions of eleven says nothing about the suite."""


@dataclass(frozen=True)
class Comparison:
    """Results of all buildings at a level of intensity, under their common motions.

    Attributes
    ----------
    profiles : list of Profile
        Results of each building under all motions.
    common : list of Profile
        Results of each building under the common motions only; empty if these are too few.
    motions : int
        Number of common motions.
    """

    profiles: list[Profile]
    common: list[Profile]
    motions: int

    @classmethod
    def of(cls, profiles: Sequence[Profile]) -> Comparison:
        """Return the comparison of profiles at the same level."""
        keys = set.intersection(*(set(profile.keys) for profile in profiles))
        is_complete = all(len(keys) == profile.runs for profile in profiles)
        enough = len(keys) >= MIN_COMMON or (is_complete and bool(keys))
        common = [profile.restricted_to(keys) for profile in profiles] if enough else []
        return cls(list(profiles), common, len(keys))

    @property
    def note(self) -> str:
        """Sentence on the motions of the comparison; empty if all motions are common."""
        lost = abbreviate(
            [
                f"{profile.building} {profile.lost_text}"
                for profile in self.profiles
                if profile.lost
            ],
            _MAX_LOST,
        )
        if not lost:
            return ""
        level = self.profiles[0].level_text
        total = pluralize(max(profile.runs for profile in self.profiles), "motion")
        head = f"{level}: " if level else ""
        if self.common:
            return (
                f"{head}comparisons of buildings use the {self.motions} of {total} that all "
                f"buildings survive ({lost})"
            )
        return (
            f"{head}no comparison of means, because only {self.motions} of {total} are survived by "
            f"all buildings ({lost}); compare the numbers of collapses"
        )


_MAX_LOST = 8  # maximum number of buildings with collapses in a sentence


def comparisons(profiles: Iterable[Profile]) -> list[Comparison]:
    """Return the comparison of all buildings at each level of intensity, in the order of the
    profiles."""
    return [Comparison.of(level) for level in at_levels(profiles)]


def at_levels(profiles: Iterable[Profile]) -> list[list[Profile]]:
    """Group profiles by their level of intensity."""
    # The keys are texts, because scale or level may be NaN, which is not equal to NaN.
    levels: dict[tuple[str, str], list[Profile]] = {}
    for profile in profiles:
        levels.setdefault((repr(profile.scale), repr(profile.level)), []).append(profile)
    return list(levels.values())


@dataclass(frozen=True)
class Ratios:
    """Ratio of a quantity of a building to the quantity of the baseline at the same level, in each
    story of the baseline.

    Attributes
    ----------
    scale : float
        Scale factor of all motions; NaN if motions have different factors.
    level : float
        Value of the intensity measure or number of the level; NaN if the level is a factor.
    mean, median, max : ndarray, shape (1 + stories,)
        Ratio of the maximum over the stories that both buildings have, then ratio of each story of
        the baseline from the ground up (`story_pairs`); NaN if a building does not have the story,
        or the baseline has no value, or zero.
    motions : int
        Number of motions, which are the same for both buildings.
    """

    building: str
    baseline: str
    scale: float
    level: float
    quantity: Quantity
    mean: Array
    median: Array
    max: Array
    motions: int


def check_baseline(baseline: str, buildings: Iterable[str]) -> None:
    """Raise UsageError if a baseline is not one of the buildings, or is the only building."""
    names = list(dict.fromkeys(buildings))
    if baseline not in names:
        suggestion = did_you_mean(baseline, names)
        raise UsageError(
            f"building {baseline!r} not found{suggestion}; available buildings: "
            f"{abbreviate(names, 10)}"
        )
    if len(names) == 1:
        raise UsageError(f"no other building to compare with {baseline!r}; add a building")


def ratios(profiles: Sequence[Profile], baseline: str) -> list[Ratios]:
    """Divide the statistics of each building by the statistics of a baseline building, at each
    level of intensity, over the motions that all buildings survive.

    Returns
    -------
    list of Ratios
        One item for each other building, level and quantity of `STORY_QUANTITIES`. Levels without a
        profile of the baseline are omitted. All ratios of a level with too few common motions are
        NaN.

    Raises
    ------
    UsageError
        The baseline does not exist, or is the only building.
    """
    check_baseline(baseline, (profile.building for profile in profiles))
    result = []
    for comparison in comparisons(profiles):
        # Without common motions, the profiles of all motions only name the buildings.
        shown = {p.building: p for p in comparison.common or comparison.profiles}
        base = shown.pop(baseline, None)
        if base is None:
            continue
        for compared in shown.values():
            level = compared.building, baseline, compared.scale, compared.level
            for quantity in STORY_QUANTITIES:
                mean, median, largest = (
                    _story_ratios(compared, base, quantity)
                    if comparison.common
                    else [np.full(1 + base.height.size, math.nan)] * 3
                )
                ratio = Ratios(*level, quantity, mean, median, largest, comparison.motions)
                result.append(ratio)
    return result


def _story_ratios(compared: Profile, base: Profile, quantity: Quantity) -> list[Array]:
    """Divide the mean, median and maximum of a building by those of the baseline: the ratio of the
    maxima over the common stories, then the ratio of each story of the baseline. NaN if the value
    of the baseline is zero or missing.
    """
    stories = story_pairs(compared, base)
    compared_statistics, base_statistics = compared.statistics(quantity), base.statistics(quantity)
    result = []
    for name in ("mean", "median", "max"):
        denominators = getattr(base_statistics, name)
        numerators = np.full(denominators.size, math.nan)
        for story, base_story in stories:
            numerators[base_story] = getattr(compared_statistics, name)[story]
        # The maxima may occur in different stories of the two buildings. Without any finite value,
        # the maximum is -inf (`initial`), so that the ratio is unknown.
        is_common = np.isin(np.arange(denominators.size), [pair[1] for pair in stories])
        highest = [
            np.max(values[np.isfinite(values) & is_common], initial=-math.inf)
            for values in (numerators, denominators)
        ]
        numerator = np.concatenate([highest[:1], numerators])
        denominator = np.concatenate([highest[1:], denominators])
        is_known = (denominator > 0.0) & np.isfinite(numerator)
        ratio = np.full(numerator.size, math.nan)
        result.append(np.divide(numerator, denominator, out=ratio, where=is_known))
    return result


def story_pairs(compared: Profile, base: Profile) -> list[tuple[int, int]]:
    """Return the indices of the stories of two buildings that correspond to each other.

    Isolators correspond to isolators if both buildings have the same number. The other stories
    correspond from the roof downwards, so that an additional story at the base shifts no number;
    but from the ground upwards if only then the heights are equal, as with a story on the roof.
    """
    isolators, stories = [], []
    for profile in (compared, base):
        numbers = range(profile.height.size)
        isolators.append([i for i in numbers if i + 1 in profile.isolators])
        stories.append([i for i in numbers if i + 1 not in profile.isolators])
    count = min(map(len, stories))

    def have_equal_heights(part: slice) -> bool:
        """Return True if the heights of a part of the stories of both buildings are equal."""
        heights = (compared.height[stories[0][part]], base.height[stories[1][part]])
        return bool(np.allclose(*heights, rtol=1e-6, equal_nan=True))

    from_roof, from_ground = slice(-count, None), slice(0, count)
    from_ground_only = have_equal_heights(from_ground) and not have_equal_heights(from_roof)
    part = from_ground if from_ground_only else from_roof
    pairs = list(zip(stories[0][part], stories[1][part], strict=True)) if count else []
    if len(isolators[0]) == len(isolators[1]):
        pairs += zip(*isolators, strict=True)
    return sorted(pairs)
