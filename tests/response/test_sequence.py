"""Sequences of events: equality with a joined record, initial states of later events, and peaks of
each event."""

from dataclasses import fields, replace

import numpy as np
import pytest

import tdint
from building_cases import ten_bilinear
from tdint.errors import UsageError
from tdint.ground_motion.joined import JoinedRecord, join_records
from tdint.ground_motion.record import Record
from tdint.model.story_laws import Law
from tdint.response.runs.outcome import StoryPeaks
from tdint.response.runs.sequence import run_sequence, sequence_of

NAMES = [
    field.name for field in fields(StoryPeaks) if field.name not in ("height", "residual_drift")
]


def shock(seed, peak, *, dt=0.01, samples=600, source="main"):
    """Return noise under a bell-shaped envelope."""
    t = np.linspace(0.0, 1.0, samples)
    noise = np.convolve(np.random.default_rng(seed).normal(size=samples), np.ones(12), "same")
    motion = noise * np.sin(np.pi * t) ** 2
    return Record(peak * motion / np.abs(motion).max(), dt, "", "", "HNE", source)


MAIN, AFTER = shock(1, 8.0), shock(2, 5.0, source="after")


def case(method="impulse4", model=None):
    return tdint.prepare(model or ten_bilinear(), MAIN, method=method)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average", "bathe"])
def test_sequence_equals_run_of_joined_record(method):
    found = run_sequence(case(method), [MAIN, AFTER], rest=20.0, history=True)
    by_hand = np.concatenate([MAIN.acceleration, np.zeros(1999), AFTER.acceleration])
    alone = tdint.run(
        ten_bilinear(), replace(MAIN, acceleration=by_hand), method=method, history=True
    )
    for name in (*NAMES, "residual_drift"):
        assert np.array_equal(
            getattr(found.stories, name), getattr(alone.stories, name), equal_nan=True
        ), name
    assert np.array_equal(found.history.displacement, alone.history.displacement)
    assert found.energy == alone.energy
    assert [event.start for event in found.events] == pytest.approx(
        [0.0, (MAIN.acceleration.size - 1) * 0.01 + 20.0]
    )


def test_peaks_of_sequence_are_maxima_of_events():
    found = run_sequence(case("moment4"), [AFTER, MAIN, AFTER.scaled(-1.1)], rest=5.0)
    for name in NAMES:
        largest = np.max([getattr(event.stories, name) for event in found.events], axis=0)
        assert np.array_equal(getattr(found.stories, name), largest, equal_nan=True), name
    assert np.array_equal(found.stories.residual_drift, found.events[-1].stories.residual_drift)


def test_first_event_equals_run_until_rest():
    found = run_sequence(case(), [MAIN, AFTER])
    alone = tdint.run(ten_bilinear(), MAIN, method="impulse4", until_rest=True)
    first, second = found.events
    assert second.start == pytest.approx(alone.time_at_rest + 0.01)
    for name in (*NAMES, "residual_drift"):
        assert np.array_equal(
            getattr(first.stories, name), getattr(alone.stories, name), equal_nan=True
        ), name


def test_each_event_has_estimated_errors():
    found = run_sequence(case("newmark-average"), [MAIN, AFTER], rest=2.0, check=True)
    fine = run_sequence(case("newmark-average"), [MAIN, AFTER], rest=2.0, dt=0.01 / 16)
    for event, truth in zip(found.events, fine.events, strict=True):
        error = np.abs(event.stories.peak_drift - truth.stories.peak_drift)
        assert np.all(error <= 1.5 * event.errors.peak_drift)
        assert np.all(event.errors.peak_drift < 0.2 * event.stories.peak_drift)


def test_events_with_different_sampling_intervals_are_resampled():
    coarse = shock(3, 5.0, dt=0.02, samples=300, source="coarse")
    joined = sequence_of(case(), [MAIN, coarse], rest=1.0)
    assert joined.joined.dt == 0.01
    second = joined.joined.acceleration[joined.starts[1] :]
    assert np.array_equal(second[::2], coarse.acceleration)
    assert second[1::2] == pytest.approx(0.5 * (coarse.acceleration[1:] + coarse.acceleration[:-1]))
    with pytest.raises(UsageError, match=r"integer multiple.*--resample"):
        sequence_of(case(), [MAIN, shock(3, 5.0, dt=0.015)])


@pytest.mark.parametrize(("dt", "stride"), [(None, 1), (0.04, 4), (0.0025, 1)])
def test_event_starts_at_first_step_after_rest(dt, stride):
    """The first event has 599 sampling intervals, followed by 101 intervals for 1.01 s at rest."""
    joined = sequence_of(case(), [MAIN, AFTER], rest=1.01, dt=dt)
    assert joined.starts == (0, 700 + -700 % stride)
    alone = tdint.run(
        ten_bilinear(), join_records([MAIN, AFTER], joined.starts), method="impulse4", dt=dt
    )
    found = run_sequence(case(), [MAIN, AFTER], rest=1.01, dt=dt)
    assert np.array_equal(found.stories.peak_drift, alone.stories.peak_drift)
    assert len(found.events) == 2


@pytest.mark.parametrize(("rest", "zeros"), [(0.5, 49), (None, 0)])
def test_joined_records_are_separated_by_rest(rest, zeros):
    shocks = [MAIN, AFTER, MAIN]
    by_hand = [part for record in shocks for part in (np.zeros(zeros), record.acceleration)][1:]
    assert np.array_equal(JoinedRecord.of(shocks, rest).acceleration, np.concatenate(by_hand))


def test_building_without_rest_is_noted():
    found = run_sequence(case(model=ten_bilinear(damping=None)), [MAIN.scaled(1e-3), AFTER])
    assert any("the building still vibrated" in note for note in found.notes)
    assert len(found.events) == 2


def test_collapse_ends_sequence():
    soft = ten_bilinear()
    weak = replace(soft.stories[0], law=Law("bilinear", (2e6, -0.3)))
    model = replace(soft, stories=(weak, *soft.stories[1:]))
    found = run_sequence(case(model=model), [MAIN.scaled(0.05), MAIN.scaled(3.0), AFTER], rest=1.0)
    assert found.status == "failed-story"
    assert found.collapse.time > found.events[1].start
    assert np.max(found.events[0].stories.peak_drift_ratio) < 0.1


@pytest.mark.parametrize("rest", [-1.0, float("inf"), "soon"])
def test_invalid_rest_is_refused(rest):
    with pytest.raises(UsageError, match="rest"):
        run_sequence(case(), [MAIN, AFTER], rest=rest)
    with pytest.raises(UsageError, match="at least one record"):
        run_sequence(case(), [])


def test_a_record_without_a_component_adds_no_name_to_the_sequence():
    """The component of the table was `HNE + `."""
    named = Record(np.ones(5), 0.01, "", "", "HNE", "a.mseed")
    joined = join_records([named, replace(named, component="", source="b.txt")], [0, 10])
    assert (joined.component, joined.source) == ("HNE", "a.mseed + b.txt")


def test_a_rest_with_too_many_samples_is_refused_before_memory_is_allocated():
    """The limit of `pad` holds for the rest between events too; it is counted in samples."""
    with pytest.raises(
        UsageError, match=r"rest: .* at most 50000000 samples, got 2e\+08 \(2e\+06 s"
    ):
        JoinedRecord.of([MAIN, AFTER], 2e6)
    with pytest.raises(UsageError, match="rest: "):
        run_sequence(case(), [MAIN, AFTER], rest=2e6)


@pytest.mark.parametrize("check", [False, True])
def test_events_after_a_collapse_have_no_values(check):
    """The run ends with the step of the collapse; later events keep their places."""
    strong = MAIN.scaled(60.0)
    found = run_sequence(case("newmark-average"), [strong, AFTER, MAIN], rest=1.0, check=check)
    assert found.status != "done" and found.collapse.ended
    assert found.steps * found.dt == pytest.approx(found.collapse.time)
    assert [event.record.source for event in found.events] == [
        item.source for item in (strong, AFTER, MAIN)
    ]
    first, *later = found.events
    assert np.array_equal(first.stories.peak_drift, found.stories.peak_drift)
    assert np.isnan(first.stories.residual_drift).all()
    for event in later:
        assert np.isnan(event.stories.peak_drift).all() and event.start > found.collapse.time
        assert np.array_equal(event.stories.height, first.stories.height)
        assert event.errors is None or np.isnan(event.errors.peak_drift).all()
