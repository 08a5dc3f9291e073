"""Tests of the selection of motions: every selection of small pools, limits, earthquakes, scatter,
and the command."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest

import tdint
from building_cases import noise
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.studies.motions.scaling import raise_to_rule
from tdint.studies.motions.selection import _search, events_of, named_events

PERIODS = np.geomspace(0.2, 2.0, 20)
TARGET = "asce7:sds=1,sd1=0.6,tl=8"


def score(deviations, scatter=None):
    """Return the mean squared deviation of ln Sa from the target plus half the mean squared error
    of the scatter, of a selection or of each selection (axes: selection, motion, period)."""
    result = np.mean(deviations.mean(axis=-2) ** 2, axis=-1)
    if scatter is None:
        return result
    return result + 0.5 * np.mean((deviations.std(axis=-2, ddof=1) - scatter) ** 2, axis=-1)


@pytest.mark.parametrize("scatter", [None, 0.35])
@pytest.mark.parametrize("per_event", [1, 99])
@pytest.mark.long
def test_best_selection_from_small_pools_is_found(scatter, per_event):
    """In at least 9 of 10 pools, the best of all selections of four from twelve motions is found,
    and no result is better."""
    rng, events = np.random.default_rng(58), np.arange(12) // 2
    target_scatter = None if scatter is None else np.full(15, scatter)
    choices = np.array(
        [
            c
            for c in map(list, itertools.combinations(range(12), 4))
            if np.bincount(events[c]).max() <= per_event
        ]
    )
    found = 0
    for _ in range(10):
        deviations = 0.3 * rng.normal(0.0, 0.4, (12, 15)).cumsum(axis=1) + rng.normal(
            0.0, 0.2, (12, 1)
        )
        best = np.min(score(deviations[choices], target_scatter))
        chosen = _search(deviations, 4, target_scatter, events, per_event)
        assert np.bincount(events[chosen]).max() <= per_event
        assert score(deviations[chosen], target_scatter) >= best * (1.0 - 1e-9)
        found += score(deviations[chosen], target_scatter) <= best * (1.0 + 1e-9)
    assert found >= 9


@pytest.fixture(scope="module")
def pool():
    """Return motions with different spectra, including a duplicate, a motion at rest and a motion
    with a large sampling interval."""
    motions = [noise(seed=seed, peak=1.0 + 0.4 * seed) for seed in range(14)]
    coarse = replace(noise(), dt=1.5)
    return [*motions, motions[3], replace(noise(), acceleration=np.zeros(50)), coarse]


def test_mean_of_selected_motions_fits_target(pool):
    """The mean of the selection is closer to the target than the mean of the four individually best
    motions; factors follow from least squares."""
    scaling = tdint.select(pool, TARGET, 4, periods=PERIODS, factors=(0.2, 20.0))
    assert len(scaling.motions) == len(set(scaling.chosen)) == 4
    assert scaling.left_out["duplicate"] == 1 and scaling.left_out["zero"] == 1
    alone = tdint.scale([pool[number] for number in scaling.chosen], target=TARGET, periods=PERIODS)
    np.testing.assert_allclose(scaling.factors, alone.factors.clip(0.2, 20.0), rtol=1e-12)
    aim = np.log(scaling.target.at(PERIODS))
    deviations = np.log(scaling.spectra(PERIODS)) - aim
    others = np.log(scaling.unselected_spectra) - aim
    near = sorted([*deviations, *others], key=lambda row: np.mean(row**2))[:4]
    assert score(deviations) <= score(np.array(near))
    columns = ["record", "component", "factor", "target", "rule", "version"]
    assert list(scaling.to_dict()) == columns


@pytest.mark.long
def test_requested_scatter_is_approached(pool):
    narrow, wide = (
        tdint.select(pool, TARGET, 5, periods=PERIODS, scatter=requested)
        for requested in (0.0, 0.8)
    )
    narrow, wide = (
        np.std(np.log(chosen.spectra(PERIODS)), axis=0, ddof=1).mean() for chosen in (narrow, wide)
    )
    assert narrow < 0.9 * wide


def test_rule_applies_to_selected_motions(pool):
    scaling = tdint.select(pool, TARGET, 4, rule="ec8", periods=PERIODS, factors=(0.01, 100.0))
    assert scaling.rule == "ec8" and scaling.least[0] >= 0.9 * (1.0 - 1e-6)


@pytest.mark.parametrize(
    ("wishes", "message"),
    [
        ({"count": 0}, "number .* at least 1"),
        ({"factors": (2.0, 1.0)}, "limits .* positive"),
        ({"per_event": 0}, "per_event must be at least 1"),
        ({"events": ["one"] * 17, "per_event": 2}, "3 motions .* 2 of 17 .*at most 2 of an event"),
        ({"scatter": -1.0}, "target standard deviation must be"),
        ({"rule": "usual"}, "unknown rule 'usual'"),
    ],
)
def test_invalid_arguments_are_refused(pool, wishes, message):
    with pytest.raises(UsageError, match=message):
        tdint.select(pool, TARGET, **{"count": 3, "periods": PERIODS} | wishes)


def test_motions_with_close_start_times_belong_to_one_event():
    starts = [
        "2016-11-13T11:02:50",
        "2016-11-13T11:03:40",
        "2016-11-13T11:33:00",
        "",
        "1970-01-01T00:00:00",
    ]
    events = events_of([replace(noise(), start=start, source=start) for start in starts])
    assert events[0] == events[1] != events[2] and all(events[:3]) and events[3:] == ["", ""]


def motions_with_events(*files_and_events):
    """Return motions of files with the event in their headers."""
    return [
        replace(noise(seed=seed), source=file, event=event)
        for seed, (file, event) in enumerate(files_and_events)
    ]


def test_components_of_recording_belong_to_one_event():
    """One of the two files may state the event, with any spelling."""
    motions = motions_with_events(
        ("A_067.AT2", "Loma Prieta 10/18/1989"),
        ("B_000.AT2", "LOMA PRIETA 10/18/89 00:05"),
        ("A_337.AT2", ""),
        ("C.mseed", "Kobe 1/16/1995"),
        ("D-010.csv", ""),
        ("D-100.csv", "Kobe 1/16/1995"),
        ("E.mseed", ""),
    )
    events = events_of(motions)
    assert events[0] == events[1] == events[2] != events[3]
    assert events[3] == events[4] == events[5] and events[6] == ""
    # A pair is of the event that one of its components states.
    pair = Horizontals(motions[2], motions[0])
    assert events_of([pair, motions[3]]) == ["Loma Prieta 1989-10-18", "Kobe 1995-01-16"]


def test_recordings_of_several_events_in_one_file_are_distinguished():
    """Different times in one file are different events; equal times have one label."""
    motions = motions_with_events(
        *[("all.csv", f"X 1/1/2001 {clock}") for clock in ("0100", "0400", "0100")]
    )
    first, second, third = events_of(motions)
    assert first == third != second


def test_pairs_per_event_are_limited():
    """Motions of files without dates must not count as separate events, because three pairs of one
    event would be selected."""
    pairs = [
        Horizontals(
            *(
                replace(
                    noise(seed=2 * number + direction, peak=1.0 + 0.1 * number),
                    source=f"RSN{number}_{suffix}.AT2",
                    component=suffix,
                    event=event,
                )
                for direction, suffix in enumerate(("000", "090"))
            )
        )
        for number, event in enumerate(
            [*["Loma Prieta 10/18/1989"] * 3, "Kobe 1/16/1995", "Duzce 11/12/1999"]
        )
    ]
    scaling = tdint.select(pairs, TARGET, 3, periods=PERIODS, per_event=1, factors=(0.01, 100.0))
    assert scaling.chosen[1:] == (3, 4)
    assert scaling.events == tuple(events_of(scaling.motions))
    with pytest.raises(
        UsageError, match=r"3 of 5 can be selected .*at most 1 of an event, 3 events"
    ):
        tdint.select(pairs, TARGET, 4, periods=PERIODS, per_event=1)


def test_unknown_events_are_refused(pool):
    motions = motions_with_events(("known.AT2", "Kobe 1/16/1995"), ("one.csv", ""), ("two.csv", ""))
    message = (
        r"per_event: the event of 2 motions is unknown: one\.csv, two\.csv; specify the events"
    )
    with pytest.raises(UsageError, match=message):
        tdint.select(motions, TARGET, 1, periods=PERIODS, per_event=1)
    with pytest.raises(UsageError, match=message):
        tdint.select(motions, TARGET, 1, periods=PERIODS, per_event=1, events=["here", "", ""])
    assert tdint.select(motions, TARGET, 1, periods=PERIODS).chosen


def test_event_table_requires_one_row_per_recording():
    motions = motions_with_events(
        ("x/A_067.AT2", ""), ("x/A_337.AT2", ""), ("x/B.mseed", ""), ("x/C.mseed", "")
    )
    table = {"A_337": "here", "x/B.mseed": "there"}
    assert named_events(motions, table) == ["here", "here", "there", ""]
    assert named_events([Horizontals(*motions[:2])], table) == ["here"]
    with pytest.raises(UsageError, match=r"one recording, .* events differ"):
        named_events(motions, table | {"A_067.AT2": "there"})


@pytest.fixture
def few_starts(monkeypatch):
    """Search from few starting points, and compare averages with the target at few periods, where
    neither is the subject."""
    monkeypatch.setattr("tdint.studies.motions.selection._START_LIMITS", (3, 3))
    monkeypatch.setattr("tdint.studies.motions.scaling._MIN_TOLERANCE", 0.3)


def weak_pairs(count, peak):
    return [
        Horizontals(
            *(
                replace(
                    noise(samples=301, seed=2 * number + i, peak=peak * (1.0 + 0.3 * number)),
                    component=f"HN{i + 1}",
                )
                for i in range(2)
            )
        )
        for number in range(count)
    ]


@pytest.mark.long
@pytest.mark.usefixtures("few_starts")
@pytest.mark.parametrize("rule", ["asce7", "ec8"])
def test_limits_include_common_factor_of_rule(rule):
    """The rule increases the factors of the best selection beyond the limit; another selection
    meets both the rule and the limit."""
    target = "asce7:sds=1,sd1=0.6,tl=8" if rule == "asce7" else "ec8:type=1,soil=B,ag=0.4g"
    pairs = weak_pairs(16, 0.8)
    free = tdint.select(pairs, target, 11, rule=rule, periods=PERIODS, factors=(0.001, 1e3))
    unlimited = np.max(free.factors)
    high = 0.8 * unlimited
    limited = tdint.select(pairs, target, 11, rule=rule, periods=PERIODS, factors=(0.001, high))
    assert np.max(limited.factors) <= high * (1.0 + 1e-9)
    assert limited.least[0] >= 0.9 * (1.0 - 1e-6)
    again = raise_to_rule(replace(limited, least=None), rule)
    np.testing.assert_allclose(again.factors, limited.factors, rtol=1e-6)
    assert limited.limits == (0.001, high) and len(limited.motions) == 11


@pytest.mark.usefixtures("few_starts")
@pytest.mark.parametrize("rule", [pytest.param("asce7", marks=pytest.mark.long), "ec8"])
def test_nearest_selection_is_reported_if_limits_cannot_be_met(rule):
    """The limits in the message are sufficient."""
    target = "asce7:sds=1,sd1=0.6,tl=8" if rule == "asce7" else "ec8:type=1,soil=B,ag=0.4g"
    pairs = weak_pairs(13, 0.2)
    with pytest.raises(AnalysisError, match=f"no selection .* meets the rule {rule}") as error:
        tdint.select(pairs, target, 11, rule=rule, periods=PERIODS, factors=(0.25, 1.0))
    needed = float(re.search(r"set the limits to 0\.25:([\d.]+),", str(error.value))[1])
    assert needed > 1.0
    found = tdint.select(pairs, target, 11, rule=rule, periods=PERIODS, factors=(0.25, needed))
    assert np.max(found.factors) <= needed and found.least[0] >= 0.9 * (1.0 - 1e-6)


def test_motions_at_limit_are_counted(pool):
    """Both selected motions with a factor at a limit and other motions that would have such a
    factor are counted."""
    scaling = tdint.select(pool, TARGET, 4, periods=PERIODS, factors=(2.0, 3.0))
    numbers = [*range(14), 16]  # the other motions are a duplicate and a motion at rest
    motions = [pool[number] for number in numbers]
    free = tdint.scale(motions, target=TARGET, periods=PERIODS).factors
    outside = {
        number for number, factor in zip(numbers, free, strict=True) if not 2.0 < factor < 3.0
    }
    assert len(scaling.at_limit) == len(outside & set(scaling.chosen))
    assert scaling.others_at_limit == len(outside - set(scaling.chosen))
    assert np.all((scaling.factors >= 2.0) & (scaling.factors <= 3.0))
