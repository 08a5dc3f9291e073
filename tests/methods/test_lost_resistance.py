"""Stories with a falling line: motion in closed form, loss of resistance, peak shear."""

import math
from dataclasses import replace

import numpy as np
import pytest

from building_cases import Law, model, noise, story
from tdint import load_model, run, run_many

MASS, K, FY, RATIO = 1e5, 4e6, 1e5, -0.1
DY = FY / K
OMEGA = math.sqrt(K / MASS)


def end_of_resistance(v0, geometric=0.0):
    """Return the time at which the resistance is zero, s, after a start from rest with the rate
    `v0`, m/s; infinite if the story reverses before.

    After yield, x = d - d0 grows as x'' = (|a| k - geometric) / m x, with the drift d0 without
    resistance.
    """
    omega = math.sqrt((K + geometric) / MASS)
    fall = -(RATIO * K + geometric)
    d0 = (1.0 - RATIO) * FY / fall
    rate = math.sqrt(fall / MASS)
    yield_time = math.asin(DY * omega / v0) / omega
    v1 = math.sqrt(v0**2 - (omega * DY) ** 2)
    ratio = rate * (d0 - DY) / v1
    return (yield_time + math.atanh(ratio) / rate if ratio < 1.0 else math.inf), d0


def building(stories, **more):
    """Return a model without a limit of the drift ratio."""
    return replace(model(stories, **more), collapse_drift=10.0)


def falling(v0, **more):
    law = Law("bilinear", (FY, RATIO, FY))
    return building([story(MASS, K, law, height=4.0)], velocity=(v0,), **more)


@pytest.mark.parametrize(
    "method", ["impulse4", "moment4", "newmark-average", "generalized-alpha", "gauss4", "bathe"]
)
@pytest.mark.parametrize("p_delta", [False, True])
def test_run_ends_where_the_resistance_is_zero(method, p_delta):
    geometric = -MASS * 9.80665 / 4.0 if p_delta else 0.0
    time, limit = end_of_resistance(0.8, geometric)
    assert time < 2.0
    response = run(falling(0.8, p_delta=p_delta), method=method, dt=0.005, duration=20.0)
    assert response.status == "failed-story"
    assert (response.collapse.story, response.collapse.failed) == (1, True)
    # The collapse is the end of the step.
    assert response.collapse.time == pytest.approx(time, abs=0.0055)
    assert limit <= response.stories.peak_drift[0] < 1.03 * limit
    assert abs(response.energy.error) < 5e-4
    if method in ("impulse4", "moment4"):
        assert response.stories.peak_shear[0] == pytest.approx(FY, rel=1e-4)


def test_story_that_reverses_before_keeps_its_resistance():
    time, _ = end_of_resistance(0.5)
    assert time == math.inf
    response = run(falling(0.5), method="impulse4", dt=0.005, duration=3.0)
    assert response.status == "done"


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_limit_belongs_to_its_side(side):
    """The weak side has no resistance at a drift that the strong side survives."""
    law = Law("bilinear", (2.0 * FY, RATIO, FY))
    case = building([story(MASS, K, law, height=4.0)], velocity=(0.8 * side,))
    response = run(case, method="impulse4", dt=0.005, duration=3.0)
    assert response.status == ("done" if side > 0.0 else "failed-story")


def test_many_runs_and_samples_end_as_single_runs():
    record = noise(peak=0.5)
    forces = [0.8e5, 1.0e5, 1.6e5]
    case = falling(0.6)
    many = run_many(case, record, vary={"stories.law.yield_force": forces})
    singles = [run(case.replace(**{"stories.law.yield_force": force}), record) for force in forces]
    statuses = [response.status for response in singles]
    assert len(set(statuses)) == 2
    assert [str(status) for status in np.ravel(many.status)] == statuses


@pytest.mark.parametrize("stiff", [0.0, 0.05 * K, 0.2 * K])
def test_lines_of_all_elements_are_added(stiff):
    """A linear element moves the drift without resistance, or keeps the resistance."""
    elements = [
        {"type": "bilinear", "stiffness": K, "yield_force": FY, "hardening": RATIO},
        {"type": "linear", "stiffness": stiff + 1e-3},
    ]
    case = load_model(
        {
            "stories": [{"mass": MASS, "height": 40, "elements": elements}],
            "damping": "none",
            "collapse_drift": 1,
            "initial": {"displacement": [0], "velocity": [1.2]},
        }
    )
    response = run(case, method="impulse4", dt=0.005, duration=3.0, check=False)
    fall = -(RATIO * K + stiff)
    limit = (1.0 - RATIO) * FY / fall if fall > 0.0 else math.inf
    assert response.status == ("failed-story" if limit < math.inf else "done")
    if limit < math.inf:
        assert limit <= response.stories.peak_drift[0] < 1.05 * limit
