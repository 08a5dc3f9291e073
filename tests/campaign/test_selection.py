"""Motions chosen from many: against every choice of small pools, limits, earthquakes, scatter; the
command."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import tdint
from building_cases import noise
from tdint.campaign.selection import _search, begin_together
from tdint.errors import UsageError

PERIODS = np.geomspace(0.2, 2.0, 20)
TARGET = "asce7:sds=1,sd1=0.6,tl=8"


def score(off, wanted=None):
    """Of a choice: mean of ln Sa over the target, and half of what the scatter is off."""
    result = np.mean(off.mean(axis=0) ** 2)
    return (
        result
        if wanted is None
        else result + 0.5 * np.mean((off.std(axis=0, ddof=1) - wanted) ** 2)
    )


@pytest.mark.parametrize("scatter", [None, 0.35])
@pytest.mark.parametrize("per_event", [1, 99])
def test_the_best_choice_of_small_pools_is_found(scatter, per_event):
    """Of all choices of four of twelve, in 19 of 20 pools at least; none is better than the
    best."""
    rng, events = np.random.default_rng(58), np.arange(12) // 2
    wanted = None if scatter is None else np.full(15, scatter)
    choices = [
        c
        for c in map(list, itertools.combinations(range(12), 4))
        if np.bincount(events[c]).max() <= per_event
    ]
    found = 0
    for _ in range(20):
        off = 0.3 * rng.normal(0.0, 0.4, (12, 15)).cumsum(axis=1) + rng.normal(0.0, 0.2, (12, 1))
        best = min(score(off[choice], wanted) for choice in choices)
        chosen = _search(off, 4, wanted, events, per_event)
        assert np.bincount(events[chosen]).max() <= per_event
        assert score(off[chosen], wanted) >= best * (1.0 - 1e-9)
        found += score(off[chosen], wanted) <= best * (1.0 + 1e-9)
    assert found >= 19


@pytest.fixture(scope="module")
def pool():
    """Motions of several colors, one twice, one at rest, one of samples too far apart."""
    motions = [noise(seed=seed, peak=1.0 + 0.4 * seed) for seed in range(14)]
    coarse = replace(noise(), dt=1.5)
    return [*motions, motions[3], replace(noise(), acceleration=np.zeros(50)), coarse]


def test_the_chosen_fit_the_target_together(pool):
    """Their mean is nearer than that of the four that are nearest each by itself; factors are least
    squares."""
    scaling = tdint.select(pool, TARGET, 4, periods=PERIODS, factors=(0.2, 20.0))
    assert len(scaling.motions) == len(set(scaling.chosen)) == 4
    assert scaling.left_out["duplicate"] == 1 and scaling.left_out["zero"] == 1
    alone = tdint.scale([pool[place] for place in scaling.chosen], target=TARGET, periods=PERIODS)
    np.testing.assert_allclose(scaling.factors, alone.factors.clip(0.2, 20.0), rtol=1e-12)
    aim = np.log(scaling.target.at(PERIODS))
    off = np.log(scaling.spectra(PERIODS)) - aim
    others = np.log(scaling.rest) - aim
    near = sorted([*off, *others], key=lambda row: np.mean(row**2))[:4]
    assert score(off) <= score(np.array(near))
    assert list(scaling.to_dict()) == ["record", "component", "factor"]


def test_a_scatter_that_is_asked_for_is_nearer(pool):
    narrow, wide = (
        tdint.select(pool, TARGET, 5, periods=PERIODS, scatter=asked) for asked in (0.0, 0.8)
    )
    narrow, wide = (
        np.std(np.log(chosen.spectra(PERIODS)), axis=0, ddof=1).mean() for chosen in (narrow, wide)
    )
    assert narrow < 0.9 * wide


def test_the_rule_acts_on_the_chosen(pool):
    scaling = tdint.select(pool, TARGET, 4, rule="ec8", periods=PERIODS, factors=(0.01, 100.0))
    assert scaling.rule == "ec8" and scaling.least[0] >= 0.9 * (1.0 - 1e-6)


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        ({"count": 0}, "the number of motions to select must be a whole number, 1 at least"),
        ({"factors": (2.0, 1.0)}, "the limits must be positive, the least first"),
        ({"per_event": 0}, "per_event must be 1 at least"),
        (
            {"events": ["one"] * 17, "per_event": 2},
            "3 motions are asked for, 2 of 17 can be taken .*at most 2 of an event",
        ),
        ({"scatter": -1.0}, "a scatter is a positive number"),
        ({"rule": "usual"}, "unknown rule 'usual'"),
    ],
)
def test_what_makes_no_sense_is_refused(pool, wishes, message):
    with pytest.raises(UsageError, match=message):
        tdint.select(pool, TARGET, **{"count": 3, "periods": PERIODS} | wishes)


def test_motions_that_begin_together_are_of_one_earthquake():
    starts = [
        "2016-11-13T11:02:50",
        "2016-11-13T11:03:40",
        "2016-11-13T11:33:00",
        "",
        "1970-01-01T00:00:00",
    ]
    events = begin_together([replace(noise(), start=start) for start in starts])
    assert events[0] == events[1] and len(set(events)) == 4
