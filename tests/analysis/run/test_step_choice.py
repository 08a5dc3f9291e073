"""The largest step within a tolerance: from coarse steps over many samples down to small parts of one."""

from __future__ import annotations

import numpy as np
import pytest

from building_cases import noise, oscillator, ten_bilinear, ten_linear
from tdint import prepare, run
from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.step_choice import choose_step
from tdint.errors import UsageError

DT = 0.01


@pytest.mark.parametrize("method", ["newmark-average", "impulse4", "bathe", "central-difference"])
@pytest.mark.parametrize("tolerance", [0.02, 1e-4])
def test_the_largest_step_within_the_tolerance_is_taken(method, tolerance):
    """A halving of it is as good, twice of it is not; the true error is within the tolerance."""
    record = noise()
    response = run(ten_bilinear(), record, method=method, tolerance=tolerance, history=True)
    assert response.check.choice.tolerance == tolerance
    assert response.check.drift_error <= tolerance
    halvings = round(np.log2(DT / response.dt))
    assert response.dt == pytest.approx(DT / 2.0**halvings)
    assert response.check.choice.samples == 2.0**-halvings
    assert len(response.history.time) == response.steps + 1
    try:
        before = run(ten_bilinear(), record, method=method, dt=2.0 * response.dt, check=True)
    except FailedRun as failure:
        assert (method, failure.status) == ("central-difference", "unstable-step")
    else:
        assert before.check.drift_error > tolerance
    truth = run(ten_bilinear(), record, method="impulse4", dt=DT / 64).stories.peak_drift
    assert np.max(np.abs(response.stories.peak_drift / truth - 1.0)) <= tolerance


def test_a_rough_tolerance_takes_steps_over_many_samples():
    """Ten linear stories of a first period of 1 s under a motion without much above 6 Hz: a tenth of the solves."""
    response = run(ten_linear(), noise(), method="impulse4", tolerance=0.05)
    choice = response.check.choice
    assert choice.samples >= 4.0
    assert response.iterations == response.steps <= 200
    assert response.steps * response.dt == pytest.approx(8.0)
    fine = run(ten_linear(), noise(), method="impulse4")
    assert np.max(np.abs(response.stories.peak_drift / fine.stories.peak_drift - 1.0)) <= 0.05


def test_a_given_step_is_the_largest():
    response = run(ten_linear(), noise(), method="impulse4", tolerance=0.05, dt=DT / 2)
    assert response.dt == DT / 2
    assert response.check.choice.samples == 0.5


def test_without_a_record_the_step_is_halved():
    case = oscillator(2.0 * np.pi, displacement=(1.0,))
    response = run(case, method="newmark-average", dt=0.1, duration=5.0, tolerance=1e-3)
    assert response.dt < 0.1
    assert response.check.choice.samples is None
    assert abs(response.stories.peak_drift[0] - 1.0) <= 1e-3


def test_a_tolerance_that_no_step_reaches():
    record = noise(samples=101)
    with pytest.raises(
        FailedRun, match=r"does not come within 1e-09 %: with dt 3.90625e-05 s .* of story \d+ is still"
    ) as failure:
        run(ten_linear(), record, method="newmark-average", tolerance=1e-11)
    assert failure.value.status == "not-within-tolerance"
    assert failure.value.dt == pytest.approx(DT / 256)


def broken(threshold):
    """A march that diverges below a step."""
    march = Case.march

    def fails(case, steps, history=False):
        if steps.h < threshold:
            raise FailedRun("broken", "diverged", case.integrator.label, steps.h)
        return march(case, steps, history)

    return fails


@pytest.mark.parametrize("threshold", [1.0, 0.004])
def test_a_tolerance_and_steps_that_fail(monkeypatch, threshold):
    """All of them, or those that would have to tell the errors."""
    monkeypatch.setattr(Case, "march", broken(threshold))
    with pytest.raises(FailedRun):
        run(ten_linear(), noise(samples=101), method="newmark-average", tolerance=1e-4)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -0.1, np.nan])
def test_a_tolerance_is_a_part(tolerance):
    with pytest.raises(UsageError, match=r"a tolerance lies between 0 and 1|tolerance must be a number, got nan"):
        run(ten_linear(), noise(samples=101), method="newmark-average", tolerance=tolerance)


def test_a_case_chooses_its_own_step():
    """What a campaign calls, for each building."""
    case = prepare(ten_linear(), noise(), method="newmark-average")
    response = choose_step(case, 0.5)
    assert response.check.choice.runs == len({*response.check.dts, response.dt}) + (response.dt < 0.1)


@pytest.mark.parametrize("tolerance", [0.05, 1e-4])
def test_runs_that_tell_their_error_choose_the_step(tolerance):
    """The first one has a step that is far too long: it is repeated only where its size is asked for, above 1 %."""
    response = run(ten_bilinear(), noise(), method="moment4", tolerance=tolerance)
    assert response.check.drift_error <= tolerance
    truth = run(ten_bilinear(), noise(), method="impulse4", dt=DT / 64).stories.peak_drift
    assert np.max(np.abs(response.stories.peak_drift / truth - 1.0)) <= tolerance
    if tolerance < 0.01:
        assert response.check.choice.runs == 1 + np.log2(0.08 / response.dt)
        assert response.check.corrected is not None
