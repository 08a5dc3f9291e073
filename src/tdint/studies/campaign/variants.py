"""Comparison of buildings, such as variants of a retrofit, with a baseline under the same suite of
ground motions.

A mean over the motions that a building survives cannot be compared with a mean over other motions:
a weak building that survives only the mild motions would appear better than a strong building. A
ratio to the baseline therefore uses the motions that the building and the baseline both complete;
other buildings do not change it. The numbers of collapses are stated separately, because they are a
result that no mean contains.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from tdint.errors import UsageError, did_you_mean
from tdint.number_parsing import abbreviate
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.studies.campaign.story_profiles import Profile
from tdint.studies.motions.outcomes import MotionRatios, ratios_to


def at_levels(profiles: Iterable[Profile]) -> list[list[Profile]]:
    """Group profiles by their level of intensity."""
    # The keys are texts, because scale or level may be NaN, which is not equal to NaN.
    levels: dict[tuple[str, str], list[Profile]] = {}
    for profile in profiles:
        levels.setdefault((repr(profile.scale), repr(profile.level)), []).append(profile)
    return list(levels.values())


class Ratios(NamedTuple):
    """Ratio of a quantity of a building to the quantity of the baseline at the same level: of the
    maxima over all stories of each building, without isolators for drifts; then of each story of
    the baseline from the ground up (`story_pairs`)."""

    compared: Profile
    base: Profile
    quantity: str
    ratios: MotionRatios

    @property
    def scale(self) -> float:
        """Scale factor of all motions; NaN if motions have different factors."""
        return self.compared.scale

    @property
    def level(self) -> float:
        """Value of the intensity measure or number of the level; NaN if the level is a factor."""
        return self.compared.level


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
    level of intensity, over the motions that the building and the baseline complete.

    Returns
    -------
    list of Ratios
        One item for each other building, level and quantity of `STORY_QUANTITIES`, and for the base
        shear, the restoring force of the first story. Levels without a profile of the baseline are
        omitted. The ratios of a level with too few common motions are NaN, except the medians.

    Raises
    ------
    UsageError
        The baseline does not exist, or is the only building.
    """
    check_baseline(baseline, (profile.building for profile in profiles))
    result = []
    for level in at_levels(profiles):
        base = next((profile for profile in level if profile.building == baseline), None)
        if base is None:
            continue
        for compared in level:
            if compared is not base:
                names = (*(quantity.name for quantity in STORY_QUANTITIES), BASE_SHEAR)
                result += [ratios_of(compared, base, name) for name in names]
    return result


BASE_SHEAR = "base_shear"
"""Quantity of ratios: the restoring force of the first story of each building."""

_CALLED = {quantity.name: quantity.called or quantity.name for quantity in STORY_QUANTITIES}


def ratios_of(compared: Profile, base: Profile, quantity: str) -> Ratios:
    """Return the ratios of a quantity of `STORY_QUANTITIES`, or of the base shear, of a building to
    a baseline at the same level."""
    is_base_shear = quantity == BASE_SHEAR
    # Demands of the same motions in both buildings; a motion of only one building has no result.
    keys = list(dict.fromkeys([*base.keys, *compared.keys]))
    values = []
    for profile in (base, compared):
        peaks = profile.peaks["peak_shear" if is_base_shear else quantity]
        of_motions = np.full((len(keys), peaks.shape[1]), math.nan)
        of_motions[[keys.index(key) for key in profile.keys]] = peaks
        values.append(of_motions[:, :1] if is_base_shear else of_motions)
    is_drift = "drift" in quantity  # the drift of an isolator is its displacement
    apart = [[i - 1 for i in item.isolators] if is_drift else [] for item in (base, compared)]
    stories = [] if is_base_shear else story_pairs(compared, base)
    found = ratios_to(values[0], values[1], stories, (apart[0], apart[1]))
    if is_base_shear:  # one row, without a story
        found = found._replace(mean=found.mean[:1], median=found.median[:1], max=found.max[:1])
    return Ratios(compared, base, _CALLED.get(quantity, quantity), found)


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
