"""Buildings are compared on common motions, and a collapse is larger than every value."""

import math

import numpy as np
import pytest

from tdint.response.pairs import COLLAPSED, COMPLETED, Run
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.studies.campaign.story_profiles import Profile, Statistics, ratios, story_pairs


def profile(name: str, drifts: dict[int, list[float]], collapsed=(), heights=(), isolators=()):
    """Return the profile of a building: drift of each story under each motion, by its number."""
    values = np.array(list(drifts.values())).reshape(len(drifts), -1)
    lost = np.full((len(collapsed), values.shape[1]), math.inf)
    values = np.concatenate([values, lost])
    peaks = {quantity.name: values for quantity in STORY_QUANTITIES}
    numbers = [*drifts, *collapsed]
    return Profile(
        scale=1.0,
        level=math.nan,
        runs=[Run(number, 1.0, 0) for number in numbers],
        motion=np.arange(len(numbers)),
        outcome=np.array([COMPLETED] * len(drifts) + [COLLAPSED] * len(collapsed), np.int8),
        run_outcome=np.array([COMPLETED] * len(drifts) + [COLLAPSED] * len(collapsed), np.int8),
        measure=("", ""),
        pair_demand="",
        building=name,
        motions=tuple(f"motion {number}" for number in numbers),
        height=np.array(heights or [3.0] * values.shape[1]),
        peaks=peaks,
        peak_errors={},
        isolators=isolators,
    )


def with_collapses(values, count):
    return np.concatenate([values, np.full((count, values.shape[1]), math.inf)])


def test_a_collapse_counts_as_larger_than_every_value():
    """Of ten motions six cause collapse: the ranks of 16, 50 and 84 % are 1.44, 4.5 and 7.56."""
    values = np.array([[4.0], [1.0], [3.0], [2.0]])
    values = with_collapses(values, 6)
    found = Statistics.of(values)
    assert (
        found.p16[0] == pytest.approx(2.0 * 1.5**0.44)
        and found.mean[0] == 2.5
        and found.max[0] == 4.0
    )
    assert found.median[0] == found.p84[0] == math.inf
    assert Statistics.of(values[-3:]).median[0] == math.inf
    assert math.isnan(Statistics.of(values[:0]).median[0])
    errors = np.where(np.isinf(values), 0.0, 0.1 * values)
    assert math.isnan(Statistics.errors(values, errors).median[0])


@pytest.mark.parametrize("survivors", range(1, 8))
def test_fractiles_never_fall_when_more_motions_cause_collapse(survivors):
    values = np.sort(np.random.default_rng(survivors).exponential(size=(survivors, 3)), axis=0)
    previous = Statistics.of(values)
    for collapsed in range(1, 6):
        found = Statistics.of(with_collapses(values, collapsed))
        for name in ("p16", "median", "p84"):
            assert np.all(getattr(found, name) >= getattr(previous, name))
        previous = found


def test_ratios_use_the_motions_that_both_buildings_survive():
    """The weak building survives the mild motions only. Over its own motions the strong building
    would appear three times as bad."""
    weak = profile("weak", {1: [0.010], 2: [0.012], 3: [0.014]}, collapsed=(4, 5))
    strong = profile("strong", {1: [0.005], 2: [0.006], 3: [0.007], 4: [0.05], 5: [0.08]})
    (drift, *_) = ratios([weak, strong], "weak")
    assert drift.ratios.motions == 3 and drift.ratios.mean == pytest.approx([0.5, 0.5])
    third = profile("third", {1: [0.004], 2: [0.004], 5: [0.01]}, collapsed=(3, 4))
    found = ratios([weak, strong, third], "weak")
    assert [item.ratios.motions for item in found[:: len(STORY_QUANTITIES) + 1]] == [3, 2]
    assert found[0].ratios.mean == pytest.approx([0.5, 0.5])
    assert np.isnan(found[-1].ratios.mean).all()
    counts = found[-1]
    assert (counts.quantity, counts.ratios.mean.size) == ("base_shear", 1)
    lost = [(item.counts.collapsed, item.counts.failed) for item in (counts.compared, counts.base)]
    assert lost == [(2, 0), (2, 0)] and counts.ratios.median.tolist() == [
        pytest.approx(0.01 / 0.014)
    ]


def test_v3_isolators_are_apart():
    base = profile("base", {1: [0.015, 0.012, 0.009]})
    isolated = profile("iso", {1: [0.22, 0.004, 0.003, 0.002]}, isolators=(1,))
    first = ratios([base, isolated], "base")[0]
    assert first.quantity == "peak_drift" and first.ratios.mean[0] == pytest.approx(0.2666666667)
    assert isolated.isolator_check.demand == pytest.approx(0.22)  # m
    assert base.isolator_check is None


def test_two_motions_without_collapse_are_compared():
    first, second = profile("a", {1: [0.2], 2: [0.4]}), profile("b", {1: [0.1], 2: [0.2]})
    assert ratios([first, second], "a")[0].ratios.mean == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize(
    ("heights", "isolators", "pairs"),
    [
        ((math.nan, 4.0, 3.0, 3.0), (1,), [(1, 0), (2, 1), (3, 2)]),  # isolated at the base
        ((4.0, 3.0, 3.0, math.nan), (4,), [(0, 0), (1, 1), (2, 2)]),  # mass damper on the roof
        ((4.0, 3.0, 3.0, 2.0), (), [(0, 0), (1, 1), (2, 2)]),  # one more story
        ((1000.0, 4.0, 3.0, 3.0), (), [(1, 0), (2, 1), (3, 2)]),  # a spring of the soil
        ((4.0, 3.0, 3.0), (), [(0, 0), (1, 1), (2, 2)]),
    ],
)
def test_stories_of_variants_correspond(heights, isolators, pairs):
    drifts = {1: [0.01 * (i + 1) for i in range(len(heights))]}
    variant = profile("variant", drifts, heights=heights, isolators=isolators)
    base = profile("base", {1: [0.1, 0.2, 0.4]}, heights=(4.0, 3.0, 3.0))
    assert story_pairs(variant, base) == pairs
    (first, *_) = ratios([base, variant], "base")
    expected = [
        0.01 * (i + 1) / value for (i, _), value in zip(pairs, (0.1, 0.2, 0.4), strict=True)
    ]
    assert first.ratios.mean[1:] == pytest.approx(expected)
