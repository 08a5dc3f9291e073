"""Runs that continue until the building is at rest, notes on other runs, and residual drifts with
long time steps."""

from dataclasses import replace
from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

import tdint
from building_cases import (
    FIVE_PERCENT,
    Force,
    model,
    noise,
    oscillator,
    story,
    ten_bilinear,
    ten_linear,
)
from random_buildings import checked_building
from tdint import load_model, run
from tdint.response.pairs import Run
from tdint.response.runs.batch import Subject
from tdint.response.runs.case import AT_REST, REST_PERIODS
from tdint.response.runs.outcome import FailedRun
from tdint.studies.campaign.chunks import Batch, CampaignSettings
from tdint.units import parse_output_units

ROOT = Path(__file__).parents[3]
MOVES = "the building still vibrates at the end (drift of story"


def moves(response):
    return any(note.startswith(MOVES) for note in response.notes)


@pytest.mark.parametrize(("damping", "rests"), [(FIVE_PERCENT, 1), (None, 0)])
def test_run_until_rest_equals_run_of_campaign(damping, rests):
    record, building = noise(seed=3), ten_bilinear(damping)
    response = run(building, record, method="impulse4", until_rest=True)
    batch = Batch(
        0,
        Subject(building, "impulse4"),
        {0: record},
        {0: None},
        CampaignSettings(until_rest=True),
    )
    row = batch.results([Run(0, 1.0)]).runs[0]
    assert (row.steps, row.at_rest) == (response.steps, rests)
    ratios = np.abs(response.stories.residual_drift) / response.stories.height
    assert row.residual_drift_ratio == np.max(ratios)


@pytest.mark.long
@pytest.mark.parametrize(
    "more", [{}, {"tolerance": 0.01}, {"check": True, "dt": 0.04}, {"history": True}]
)
def test_residual_drifts_are_taken_at_rest(more):
    """The residual drifts equal those of a run ten times as long. Without the option, the building
    moves at the end of the record, and a note states this."""
    record = noise(seed=3)
    plain = run(ten_bilinear(), record, method="impulse4")
    resting = run(ten_bilinear(), record, method="impulse4", until_rest=True, **more)
    last = run(
        ten_bilinear(),
        record,
        method="impulse4",
        duration=10.0 * resting.time_at_rest,
        dt=more.get("dt"),
    )
    scale = np.max(resting.stories.peak_displacement)
    assert (
        resting.time_at_rest == pytest.approx(resting.steps * resting.dt)
        and resting.time_at_rest > record.duration
    )
    assert not moves(resting) and moves(plain) and plain.time_at_rest is None
    if "dt" not in more and "tolerance" not in more:
        assert np.array_equal(plain.stories.peak_drift, resting.stories.peak_drift)
    if "tolerance" not in more:
        assert (
            np.max(np.abs(resting.stories.residual_drift - last.stories.residual_drift))
            < 2.0 * AT_REST * scale
        )
    far = np.abs(plain.stories.residual_drift - last.stories.residual_drift)
    assert np.max(far) > 5.0 * AT_REST * scale
    assert np.max(far) < 2.0 * np.max(plain.residual_oscillation)
    peaks = plain.stories.peak_drift
    assert f"largest drift {np.max(peaks):.4g} m in story {np.argmax(peaks) + 1}" in repr(plain)
    message = (
        f"{MOVES} {np.argmax(plain.residual_oscillation) + 1} by about +-"
        f"{1e3 * np.max(plain.residual_oscillation):.2g} mm"
    )
    assert any(note.startswith(message) for note in plain.notes)
    in_inches = run(
        replace(ten_bilinear(), output_units=parse_output_units("in,kip")),
        record,
        method="impulse4",
    )
    message = (
        f"{MOVES} {np.argmax(plain.residual_oscillation) + 1} by about +-"
        f"{np.max(plain.residual_oscillation) / 0.0254:.2g} in"
    )
    assert any(note.startswith(message) for note in in_inches.notes)
    if resting.history is not None:
        assert resting.history.time[-1] == pytest.approx(resting.time_at_rest)
        assert f"of 10 stories, {resting.steps} steps to {resting.time_at_rest:.6g} s" in repr(
            resting.history
        )


def test_collapsed_run_is_not_extended_to_rest():
    frame = load_model(ROOT / "configs" / "collapse-prone-frame.yaml")
    response = run(frame, noise(seed=3).scaled(20.0), method="impulse4")
    assert response.collapse.ended and np.max(response.residual_oscillation) > 0.1 * np.max(
        response.stories.peak_drift
    )
    assert not moves(response)


def test_undamped_building_does_not_come_to_rest():
    response = run(oscillator(10.0), noise(), method="impulse4", until_rest=True)
    assert response.time_at_rest is None and moves(response)
    assert any(
        note.endswith("; until_rest stops after 100 first periods") for note in response.notes
    )
    assert response.steps * response.dt == pytest.approx(8.0 + REST_PERIODS * 0.2 * np.pi, rel=0.01)


@pytest.mark.parametrize("duration", [1.0, 1.37, 2.5])
def test_residual_oscillation_of_free_vibration(duration):
    """The oscillation of one story in free vibration equals that of its start at any time; there is
    no note without ground motion."""
    response = run(oscillator(10.0, velocity=(0.3,)), method="exact", dt=0.01, duration=duration)
    assert response.residual_oscillation[0] == pytest.approx(0.03, rel=1e-6)
    assert not moves(response)


def test_residual_oscillation_under_forces_is_ignored():
    shaken = replace(
        ten_linear(),
        excitation=replace(ten_linear().excitation, forces=(Force(10, 1e5, 0.0, 5.0),)),
    )
    assert not moves(run(shaken, noise(), method="impulse4"))


@cache
def random_run(seed):
    """Return a random building, its motion, a method and the true peaks."""
    building, record, method = checked_building(seed, 502)
    return (
        building,
        record,
        method,
        run(building, record, method="impulse4", dt=record.dt / 16, duration=record.duration),
    )


@pytest.mark.parametrize("samples", [2, 4])
@pytest.mark.long
def test_errors_of_residual_drifts_of_steps_beyond_end_of_record(samples):
    """The residual drifts differ from the drifts at the end of the record, and the estimated errors
    cover the difference."""
    good, changed = [], []
    for seed in range(16):
        building, record, method, true = random_run(seed)
        step, end = samples * record.dt, record.duration
        try:
            response = run(building, record, method=method, dt=step, duration=end, check=True)
        except FailedRun:  # the step does not resolve the motion
            continue
        if response.check.drift_error is None:
            continue
        far = np.abs(response.stories.residual_drift - true.stories.residual_drift)
        good.append(
            far <= 2.0 * response.check.errors.residual_drift + 1e-6 * true.stories.peak_drift
        )
        changed.append(np.max(response.interstep_bound.residual_drift))
    assert len(good) >= 12 and min(changed) > 0.0
    assert np.mean(np.concatenate(good)) >= 0.98


def test_residual_oscillation_of_first_mode():
    """For two equal stories, omega^2 = (3 - sqrt 5) / 2 k/m; the ratio of the floors is 1 to the
    golden ratio, and the ratio of the drifts is its inverse."""
    golden, omega = (1.0 + np.sqrt(5.0)) / 2.0, 10.0 * np.sqrt((3.0 - np.sqrt(5.0)) / 2.0)
    two = model([story(1.0, 100.0), story(1.0, 100.0)], velocity=(0.3, 0.3 * golden))
    for duration in (1.0, 1.37):
        response = run(two, method="exact", dt=0.001, duration=duration)
        assert response.residual_oscillation == pytest.approx(
            0.3 / omega * np.array([1.0, golden - 1.0]), rel=1e-5
        )


@pytest.mark.parametrize("until_rest", [False, True])
def test_linear_buildings_have_no_residual_drift(until_rest):
    """Springs and dashpots that are linear, also with attachments, in single runs, batches and
    sequences; the history keeps its last values."""
    text = "{name: tmd, floor: 3, mass: 2000, stiffness: 2e5, dashpot: 500}"
    stories = "{repeat: 3, mass: 1e5, stiffness: 4e7, height: 3, dashpot: 2e5}"
    model = load_model(StringIO(f"stories: [{stories}]\nattachments: [{text}]\n"))
    for building in (ten_linear(), model):
        single = run(building, noise(seed=3), history=True, until_rest=until_rest, check=True)
        assert not single.stories.residual_drift.any()
        assert not single.check.errors.residual_drift.any()
        assert single.devices is None or not single.devices.stories.residual_drift.any()
        assert single.history.drift[-1].any()
        many = tdint.run_many(building, [noise(seed=3), noise(seed=4)])
        assert not many.stories.residual_drift.any()
    sequence = tdint.run_sequence(
        Subject(model, "impulse4").case(noise()), [noise(seed=3), noise(seed=4)]
    )
    assert not any(event.stories.residual_drift.any() for event in sequence.events)


@pytest.mark.parametrize(
    ("more", "is_zero"),
    [
        ({"dashpot": {"coefficient": 1e6, "exponent": 1, "brace": 5e7}}, True),
        ({"dashpot": {"coefficient": 1e6, "exponent": 0.5, "linear_below": 0.01}}, False),
        (
            {
                "dashpot": {"coefficient": 1e6, "exponent": 1, "brace": 5e7}
                | {"relief": {"force": 1e5, "ratio": 0.1}}
            },
            False,
        ),
        ({"law": {"type": "polynomial", "coefficients": [4e7, 0.0, 1e10]}}, False),
    ],
)
def test_buildings_that_rest_at_zero(more, is_zero):
    """Linear dashpots with a brace are linear; power laws, relief valves and curved laws are not.
    Matrices are linear too."""
    story = {"mass": 1e5, "height": 3, "stiffness": 4e7} | more
    if "law" in more:
        del story["stiffness"]
    response = tdint.run({"stories": [story], "damping": "none"}, noise(), check=False)
    assert response.stories.residual_drift.any() != is_zero
    matrices = {"mass": [1e5, 1e5], "stiffness": [[8e7, -4e7], [-4e7, 4e7]]}
    model = {"matrices": {"names": ["u", "v"]} | matrices, "damping": {"modal": 0.05}}
    assert not tdint.run(model, noise(), check=False).stories.residual_drift.any()


def test_residual_drift_under_a_force_that_stays():
    """A force that stays keeps its static drift in a linear building; without it at the end the
    drift is zero. A yielding story keeps the drift at the end of the run."""
    law = {"type": "bilinear", "yield_force": 4e5, "hardening": 0.02}
    story = {"mass": 1e5, "stiffness": 4e7, "dashpot": 1e6}
    for end, law_of_story, right in ((2e5, None, 5e-3), (0.0, None, 0.0), (0.0, law, None)):
        points = [[0.0, 0.0], [1.0, 6e5], [2.0, end], [30.0, end]]
        model = {
            "stories": [story | ({"law": law_of_story} if law_of_story else {})],
            "excitation": {"forces": [{"floor": 1, "points": points}]},
        }
        response = tdint.run(model, dt=0.01, duration=30.0, check=False, history=True)
        expected = response.history.drift[-1, 0] if right is None else right
        assert response.stories.residual_drift[0] == pytest.approx(expected, rel=1e-6)
        assert right is not None or expected > 1e-3


@pytest.mark.parametrize(("strength", "seed"), [(3.3e5, 2), (2e5, 1)])
def test_error_of_residual_drift_of_a_story_that_softens_at_rest(strength, seed):
    """A pinched story goes on to a softer branch when its force changes its sign. It moves 4.6
    times as far as its stiffness at the end of the run shows. The estimate follows from a longer
    run."""
    stiffness = 4e7
    points = ((1.0, 1.0), (2.5, 1.2), (6.0, 1.35), (15.0, 0.8))
    law = {
        "type": "multilinear-pinching",
        "backbone": [[x * strength / stiffness, y * strength] for x, y in points],
        "pinching": {"drift": 0.5, "force": 0.4, "unloading": 0.1},
    }
    pinched = {"mass": 1.5e5, "height": 3.5, "law": law, "dashpot": 2e5}
    building, record = load_model({"stories": [pinched]}), noise(seed=seed)
    response = run(building, record, method="impulse4", until_rest=True)
    longer = run(
        building, record, method="impulse4", duration=5.0 * response.time_at_rest, check=False
    )
    error = np.abs(longer.stories.residual_drift - response.stories.residual_drift)
    estimate = response.check.errors.residual_drift
    assert error > 3.0 * response.residual_oscillation
    assert 0.8 * estimate < error < 1.2 * estimate


def test_error_of_residual_drift_of_a_building_that_collapses_has_no_longer_run():
    """The drift grows without bound, so that neither a residual drift nor its error is known."""
    frame = load_model(ROOT / "configs/collapse-prone-frame.yaml")
    record = replace(frame.excitation.record, scale=3.0)
    frame = replace(frame, excitation=replace(frame.excitation, record=record))
    response = run(frame, duration=1.0, until_rest=True)
    assert response.status == "collapsed"
    assert np.isnan(response.stories.residual_drift).all()
    assert np.isnan(response.check.errors.residual_drift).all()
    assert np.isfinite(response.check.errors.peak_drift).all()
