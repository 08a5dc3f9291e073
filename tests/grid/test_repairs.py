"""Cases of repairs that random cases meet too seldom: each fails if its repair is removed."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from tdint import load_model, make_record, run

PEAKS = Path(__file__).with_name("later_peaks.csv")
"""Stories of a building with their initial displacements and true peaks (by a separate
Runge-Kutta solver), and its ground motion."""
MOTION = Path(__file__).with_name("later_peaks_motion.txt")

MASS, PERIOD = 1e5, 0.4
STIFFNESS = MASS * (2.0 * math.pi / PERIOD) ** 2


def flat(mass, stiffness, strength):
    """Return a story without hardening."""
    law = {"type": "bilinear", "yield_force": strength, "hardening": 0.0}
    return {"mass": mass, "height": 3.0, "stiffness": stiffness, "law": law}


def within_rounding_of_a_limit(strength, h):
    """Return the response of the first step of two stories, in which the upper story yields."""
    building = load_model(
        {
            "stories": [flat(MASS, STIFFNESS, strength), flat(MASS, STIFFNESS, 2e4)],
            "initial": {"velocity": [0.5, 1.2]},
        }
    )
    return run(building, method="impulse4", dt=h, duration=h, check=False)


def test_force_at_the_end_of_a_step_within_the_tolerance_of_a_limit():
    """The upper story yields within the step. The drift of the lower story ends beyond its limit,
    by less than the tolerance of the location of branch changes: the branch changes at the end of
    the step, and the force is the strength."""
    h = PERIOD / 10.0
    elastic = within_rounding_of_a_limit(1e9, h)
    assert elastic.branch_changes == 1
    strength = elastic.stories.peak_shear[0] / (1.0 + 0.8e-9)
    found = within_rounding_of_a_limit(strength, h)
    assert found.branch_changes == 2
    assert found.stories.peak_shear[0] == pytest.approx(strength, rel=1e-12)


def test_accelerations_at_the_end_of_an_elastic_substep():
    """The total shear of an undamped story is its force. An elastic substep can end beyond the
    limit: the accelerations there are those of the strength. A negligible dashpot that is not
    linear excludes the limits by equilibrium."""
    strength, negligible = 3e4, {"coefficient": 1e-6, "exponent": 1.5}
    story = flat(MASS, MASS * 60.0**2, strength) | {"dashpot": negligible}
    building = load_model({"stories": [story]})
    times = 0.01 * np.arange(301)
    ground = 4.0 * np.sin(17.0 * times) + 3.0 * np.sin(31.0 * times)
    record = make_record(ground, dt=0.01, units="m/s^2")
    stories = run(building, record, method="impulse4", dt=0.02, check=False).stories
    assert stories.ductility[0] > 3.0
    assert stories.peak_total_shear[0] == pytest.approx(strength, rel=3e-4)


def test_peaks_after_a_maximum_at_the_start():
    """Twelve stories with stops, with initial displacements. The run and the additional run report
    the maximum at the start, and miss a later one."""
    with PEAKS.open() as file:
        stories = [
            {name: float(text) for name, text in row.items() if text}
            for row in csv.DictReader(file)
        ]
    bearings = {"type": "bilinear", "yield_force": 1732985.183509996, "hardening": 0.1}
    definition = {
        "stories": [
            {name: story[name] for name in ("mass", "stiffness", "height")}
            | (
                {"law": {"type": "gap"} | {name: story[name] for name in ("gap", "stop_stiffness")}}
                if "gap" in story
                else {"law": bearings, "isolator": True}
            )
            for story in stories
        ],
        "collapse_drift": 0.9,
        "initial": {"displacement": [story["displacement"] for story in stories]},
    }
    record = make_record(np.loadtxt(MOTION), dt=0.01, units="m/s^2")
    response = run(load_model(definition), record, method="park", dt=0.02, duration=4.0)
    for name in ("peak_drift", "peak_shear"):
        true = np.array([story[name] for story in stories])
        error = np.abs(getattr(response.stories, name) - true)
        assert np.all(error <= 2.0 * getattr(response.check.errors, name)), name


def test_step_that_does_not_resolve_a_stiffened_story():
    """The stiffness at the peak drift d of c1 d + c5 d^5 is 1 + 5 c5 d^4 / c1 times the initial
    stiffness. The note appears if the frequency there times the step exceeds 2.5."""
    drift, ratio, first = 0.1, 16.0, MASS * 20.0**2
    fifth = (ratio - 1.0) * first / (5.0 * drift**4)
    law = {"type": "polynomial", "coefficients": [first, 0.0, 0.0, 0.0, fifth]}
    building = load_model(
        {
            "stories": [{"mass": MASS, "height": 3.0, "law": law, "dashpot": 20.0 * MASS}],
            "initial": {"displacement": [drift]},
        }
    )
    limit = 2.5 / (20.0 * math.sqrt(ratio))
    for dt, is_noted in ((1.05 * limit, True), (0.95 * limit, False)):
        response = run(building, method="moment4", dt=dt, duration=20 * dt, check=False)
        assert response.stories.peak_drift[0] == pytest.approx(drift, rel=1e-9)
        assert any("is 16 times as stiff" in note for note in response.notes) == is_noted
