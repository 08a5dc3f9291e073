"""The largest step within a tolerance: from coarse steps over many samples down to small parts of
one."""

from functools import cache

import numpy as np
import pytest

from building_cases import noise, oscillator, ten_bilinear, ten_linear
from step_checks import broken
from tdint import prepare, run
from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.step_choice import choose_step, step_within
from tdint.errors import UsageError

DT = 0.01


@cache
def truth(building):
    """Peak drifts of ten stories under the motion of this file, as good as true."""
    return run(building(), noise(), method="impulse4", dt=DT / 16).stories.peak_drift


def off(stories, building=ten_bilinear):
    """How far the peak drift of the worst of ten stories is off, over the true one."""
    return np.max(np.abs(stories.peak_drift / truth(building) - 1.0))


@pytest.mark.parametrize(
    "method", ["newmark-average", "impulse4", "moment4", "bathe", "central-difference"]
)
@pytest.mark.parametrize("tolerance", [0.02, 1e-3])
def test_the_largest_step_within_the_tolerance_is_taken(method, tolerance):
    """Twice of it is not within; the true error is. The step is a halving of four samples, the run
    that of the step."""
    record = noise()
    response = run(ten_bilinear(), record, method=method, tolerance=tolerance, history=True)
    check = response.check
    assert check.step_choice.tolerance == tolerance and check.drift_error <= tolerance
    halvings = round(np.log2(4 * DT / response.dt))
    assert halvings >= 0 and response.dt == pytest.approx(4 * DT / 2.0**halvings)
    assert check.step_choice.samples == 4.0 / 2.0**halvings
    assert len(response.history.time) == response.steps + 1
    plain = run(ten_bilinear(), record, method=method, dt=response.dt, check=False)
    assert np.array_equal(plain.stories.peak_drift, response.stories.peak_drift)
    assert off(response.stories) <= tolerance
    # Of impulse4 the pair before, with twice and four times the step, tells one and a half times
    # the tolerance or more.
    pairs = method == "impulse4"
    if halvings < 1 + pairs:
        return
    try:
        before = run(
            ten_bilinear(), record, method=method, dt=(4.0 if pairs else 2.0) * response.dt
        )
    except FailedRun as failure:
        assert (method, failure.status) == ("central-difference", "unstable-step")
    else:
        assert before.check.drift_error > (1.5 if pairs else 1.0) * tolerance


@pytest.mark.parametrize("tolerance", [0.02, 1e-4])
def test_the_finer_run_of_a_pair_has_a_third_of_the_error_that_the_pair_tells(tolerance):
    """By their peaks: 4/9 of the difference, of the first pair 8/9, a fifth of the root mean square
    at least."""
    response = run(ten_bilinear(), noise(), method="impulse4", tolerance=tolerance)
    check = response.check
    assert (check.step_choice.runs == 2) == (tolerance == 0.02)
    assert check.time_steps == (2.0 * response.dt, response.dt) and check.method.startswith(
        "impulse4"
    )
    coarse = run(
        ten_bilinear(), noise(), method="impulse4", dt=2.0 * response.dt, check=False
    ).stories
    part = 8.0 / 9.0 if tolerance == 0.02 else 4.0 / 9.0
    relative = part * np.abs(coarse.peak_drift / response.stories.peak_drift - 1.0)
    least = np.maximum(np.maximum(relative, 0.2 * np.sqrt(np.mean(relative**2))), 1e-5)
    assert check.errors.peak_drift / response.stories.peak_drift == pytest.approx(least, rel=1e-9)


def test_a_step_is_no_larger_than_is_allowed():
    """Half of the tolerance would be met by steps of two samples, the finer of the first pair."""
    case = prepare(ten_linear(), noise(), method="impulse4")
    for largest, taken in ((np.inf, 2), (2 * DT, 2), (1.9 * DT, 1), (DT, 1), (0.9 * DT, 0.5)):
        assert step_within(case, 0.5, largest=largest) == taken * DT
    other = prepare(ten_linear(), noise(), method="newmark-average")
    assert (step_within(other, 0.5), step_within(other, 0.5, largest=3.9 * DT)) == (4 * DT, 2 * DT)


def test_a_given_step_is_the_largest():
    response = run(ten_linear(), noise(), method="impulse4", tolerance=0.05, dt=DT / 2)
    assert (
        response.check.time_steps == (DT / 2, DT / 4) and response.check.step_choice.samples == 0.25
    )  # the first pair
    response = run(ten_linear(), noise(), method="newmark-average", tolerance=0.05, dt=DT / 2)
    assert response.dt == DT / 2 and response.check.step_choice.samples == 0.5


def test_without_a_record_the_step_is_halved():
    case = oscillator(2.0 * np.pi, displacement=(1.0,))
    response = run(case, method="newmark-average", dt=0.1, duration=5.0, tolerance=1e-3)
    assert response.dt < 0.1
    assert response.check.step_choice.samples is None
    assert abs(response.stories.peak_drift[0] - 1.0) <= 1e-3


def test_a_tolerance_that_no_step_reaches():
    record = noise(samples=101)
    with pytest.raises(
        FailedRun,
        match=r"does not reach the tolerance of 1e-09 %: with dt = 3.90625e-05 s .* of story \d+ "
        r"is still",
    ) as failure:
        run(ten_linear(), record, method="newmark-average", tolerance=1e-11)
    assert failure.value.status == "not-within-tolerance"
    assert failure.value.dt == pytest.approx(DT / 256)


@pytest.mark.parametrize("threshold", [1.0, 0.004])
def test_a_tolerance_and_steps_that_fail(monkeypatch, threshold):
    """All of them, or those that would have to tell the errors."""
    monkeypatch.setattr(Case, "integrate", broken(threshold))
    with pytest.raises(FailedRun):
        run(ten_linear(), noise(samples=101), method="newmark-average", tolerance=1e-4)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -0.1, np.nan])
def test_a_tolerance_is_a_part(tolerance):
    with pytest.raises(
        UsageError,
        match=r"the tolerance must be between 0 and 1|tolerance must be a number, got nan",
    ):
        run(ten_linear(), noise(samples=101), method="newmark-average", tolerance=tolerance)


def test_a_case_chooses_its_own_step():
    """What a campaign calls, for each building: the runs that were made are told, those that tell
    errors included."""
    response = choose_step(prepare(ten_linear(), noise(), method="newmark-average"), 0.5)
    assert response.dt == 4 * DT and response.check.step_choice.runs == 2
    response = choose_step(prepare(ten_bilinear(), noise(), method="impulse4"), 1e-4)
    assert response.check.step_choice.runs == 1 + round(np.log2(4 * DT / response.dt))
