"""The largest step within a tolerance: from coarse steps over many samples down to small parts of one."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from building_cases import noise, oscillator, ten_bilinear, ten_linear
from step_checks import broken
from tdint import prepare, run, run_case
from tdint.analysis.run import prepared, step_choice
from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.step_choice import _least_drifts, choose_step, step_within
from tdint.analysis.run.workspace import Bound
from tdint.errors import UsageError

DT = 0.01


@cache
def truth(building):
    """Peak drifts of ten stories under the motion of this file, as good as true."""
    return run(building(), noise(), method="impulse4", dt=DT / 16).stories.peak_drift


def off(stories, building=ten_bilinear):
    """How far the peak drift of the worst of ten stories is off, over the true one."""
    return np.max(np.abs(stories.peak_drift / truth(building) - 1.0))


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
    assert off(response.stories) <= tolerance


def test_a_rough_tolerance_takes_steps_over_many_samples():
    """Ten linear stories of a first period of 1 s under a motion without much above 6 Hz: a tenth of the solves."""
    response = run(ten_linear(), noise(), method="impulse4", tolerance=0.05)
    choice = response.check.choice
    assert choice.samples >= 4.0
    assert response.iterations == response.steps <= 200
    assert response.steps * response.dt == pytest.approx(8.0)
    assert off(response.stories, ten_linear) <= 0.05


def test_a_step_is_no_larger_than_is_allowed():
    """The tolerance is met by steps of 16 samples, more than an eighth of the first period."""
    case = prepare(ten_linear(), noise(), method="impulse4")
    assert step_within(case, 0.5) == 16 * DT
    for largest, taken in ((16 * DT, 16), (15.9 * DT, 8), (8 * DT, 8), (7.9 * DT, 4), (4 * DT, 4), (DT, 1)):
        assert step_within(case, 0.5, largest=largest) == taken * DT


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
    response = run(ten_bilinear(), noise(), method="moment4", tolerance=tolerance, history=True)
    assert response.check.drift_error <= tolerance
    assert off(response.stories) <= tolerance
    if tolerance < 0.01:
        assert response.check.choice.runs == 1 + np.log2(0.08 / response.dt)
        assert response.check.corrected is not None


# ---- Strides of moment4, chosen on the way

NAMES = ("peak_drift", "peak_velocity", "peak_acceleration", "peak_shear", "peak_total_shear", "residual_drift")


@pytest.mark.parametrize("model", [ten_bilinear, ten_linear])
def test_strides_are_chosen_on_the_way(model):
    """For each tolerance the true error is within it, and energy is kept as at any step of moment4; a smaller one takes
    more of them."""
    taken = []
    for tolerance in (1e-2, 1e-3, 1e-4, 1e-6):
        response = run(model(), noise(), method="moment4", tolerance=tolerance)
        assert response.check.choice.tolerance == tolerance
        assert response.check.drift_error <= tolerance
        assert off(response.stories, model) <= tolerance + 1e-7
        shortest, longest = response.step_range
        assert DT / 256 <= shortest < response.dt < longest <= 16 * DT
        assert np.log2(shortest / DT) % 1.0 == np.log2(longest / DT) % 1.0 == 0.0
        assert response.steps * response.dt == pytest.approx(8.0)
        assert abs(response.energy.error) < 1e-9
        taken.append(response.steps)
    assert taken == sorted(set(taken))


def strided(parts, longest, allowed=np.inf, model=ten_bilinear):
    """The march of ten stories in strides of up to so many parts of a sample, and their case. Drifts are taken for
    their peaks from the start."""
    case, _ = prepare(model(), noise(), method="moment4").carrying_error()
    units = case.steps(DT / parts)
    return case, case.march(replace(units, stride=longest, bound=Bound(allowed, np.full(10, 0.01))))


@pytest.mark.parametrize(("parts", "longest"), [(1, 1), (8, 8), (2, 1)])
def test_equal_strides_are_equal_steps_bit_for_bit(parts, longest):
    case, found = strided(parts, longest)
    other = case.march(case.steps(DT * longest / parts))
    assert (found.steps, found.iterations, found.energy) == (other.steps, other.iterations, other.energy)
    for name in NAMES:
        assert np.array_equal(getattr(found.stories, name), getattr(other.stories, name))
        assert np.array_equal(getattr(found.check.corrected, name), getattr(other.check.corrected, name))


def test_long_strides_are_steps_over_several_samples():
    """But for the first ones, which lead up to them. In linear stories: what a yielding one decides within so long a
    step hangs on rounding, and its accelerations and total shears on that, by as much as the step errs by (2 %)."""
    case, found = strided(1, 4, model=ten_linear)
    assert found.step_range == (DT, 4 * DT)
    other = case.march(case.steps(4 * DT))
    assert 0 < found.steps - other.steps < 4
    for name in NAMES:
        assert getattr(found.stories, name) == pytest.approx(getattr(other.stories, name), rel=2e-3, abs=1e-6)


def test_strides_go_with_the_fourth_root_of_what_they_may_miss():
    """So the error goes with it: to a sixteenth half of the stride."""
    taken = [strided(256, 4096, allowed)[1].steps for allowed in (1.6e-2, 1e-3, 6.25e-5)]
    assert np.diff(np.log2(taken)) == pytest.approx([1.0, 1.0], abs=0.2)


def test_the_pieces_of_a_strided_march_do_not_show(monkeypatch):
    """It is cut by time, so that it can be interrupted."""
    case = prepare(ten_bilinear(), noise(samples=51), method="moment4")
    whole = run_case(case, tolerance=1e-3)
    monkeypatch.setattr(prepared, "_FIRST_PIECE", 70)
    monkeypatch.setattr(prepared, "_PIECE", 1e-4)
    pieces = run_case(case, tolerance=1e-3)
    assert np.array_equal(pieces.stories.peak_drift, whole.stories.peak_drift)
    assert (pieces.steps, pieces.step_range, pieces.energy) == (whole.steps, whole.step_range, whole.energy)


def test_a_strided_run_beyond_the_tolerance_is_made_again(monkeypatch):
    monkeypatch.setattr(step_choice, "_MISSED", 1e4)
    response = run(ten_bilinear(), noise(), method="moment4", tolerance=1e-3)
    assert response.check.choice.runs > 1 and response.check.drift_error <= 1e-3
    monkeypatch.setattr(step_choice, "_TRIES", 1)
    equal = run(ten_bilinear(), noise(), method="moment4", tolerance=1e-3)
    assert equal.step_range is None and equal.check.drift_error <= 1e-3
    assert "the steps are equal, for those chosen on the way did not come within the tolerance" in equal.notes


@pytest.mark.parametrize("given", [{"history": True}, {"dt": DT}, {"method": "moment4:rho_inf=0.5"}])
def test_steps_are_equal_where_they_have_to_be(given):
    """Rows of a history are equally far from each other, a step that is given is the largest, and rho_inf below 1
    carries no error along. A history is told why."""
    response = run(ten_linear(), noise(), **{"method": "moment4", "tolerance": 1e-3} | given)
    assert response.step_range is None and response.check.drift_error <= 1e-3
    assert any("steps are equal" in note for note in response.notes) == ("history" in given)


def test_strides_until_rest():
    response = run(ten_bilinear(), noise(), method="moment4", tolerance=1e-3, until_rest=True)
    assert response.rest_time == pytest.approx(response.steps * response.dt)
    assert response.rest_time > 8.0 and response.step_range[1] > 4 * DT
    assert np.max(response.moving_drift) < 2e-3 * np.max(response.stories.peak_drift)


def test_a_collapse_in_strides():
    """It is noted at the end of one of them."""
    case = prepare(ten_bilinear(), noise().scaled(50.0), method="moment4")
    found, equal = (run_case(case, tolerance=1e-2, equal=equal) for equal in (False, True))
    assert found.status == equal.status == "collapsed"
    assert found.collapse.story == equal.collapse.story
    assert abs(found.collapse.time - equal.collapse.time) <= max(found.step_range[1], equal.dt)


def test_a_step_that_is_too_long_is_told_by_the_next_one_of_the_row():
    """As without a tolerance: by its corrected peaks, which are handed over."""
    record = noise()
    response = run(ten_bilinear(), record, method="moment4", dt=8.0 * record.dt, tolerance=0.05)
    check = response.check
    assert len(check.dts) == 1 and check.choice.runs == 1 + np.log2(8.0 * record.dt / check.dts[0])
    assert off(response.stories) == pytest.approx(check.drift_error, rel=0.2)
    assert off(check.corrected) < check.drift_left < 0.1 * off(response.stories)


@pytest.mark.parametrize("method", ["newmark-average", "impulse4"])
def test_steps_over_several_samples_go_as_far_as_the_tolerance(method):
    """Whatever the tolerance: twice the step is beyond it, or beyond a quarter of the first period."""
    record, case = noise(), prepare(oscillator(2.0 * np.pi / 0.5, 0.05), noise(), method=method)
    found = set()
    for tolerance in np.geomspace(0.003, 0.3, 9):
        step = step_within(case, tolerance)
        found.add(round(step / record.dt))
        assert run_case(case, dt=step, check=True).check.drift_error <= tolerance
        if 2.0 * step <= 0.5 / 4.0:
            assert run_case(case, dt=2.0 * step, check=True).check.drift_error > tolerance
    assert len(found) >= 2


def test_the_least_drifts_are_parts_of_those_of_the_first_mode():
    """Of one story a quarter of its own peak drift without yielding; where no spectrum reaches, of pga / omega^2."""
    record = noise()
    for omega, xi in ((6.0, 0.05), (20.0, 0.02)):
        case = prepare(oscillator(omega, xi), record, method="moment4")
        peak = run(oscillator(omega, xi), record, method="exact").stories.peak_drift
        np.testing.assert_allclose(_least_drifts(case), step_choice._LEAST * peak, rtol=1e-3)
    stiff = prepare(oscillator(1e7), record, method="moment4")
    np.testing.assert_allclose(_least_drifts(stiff), step_choice._LEAST * record.pga / 1e14)
