"""Tests of the choice of the largest step within a tolerance, from steps of many samples to small
fractions of a sample."""

from functools import cache

import numpy as np
import pytest

from building_cases import noise, oscillator, ten_bilinear, ten_linear
from selection import every
from step_checks import broken
from tdint import prepare, run
from tdint.errors import UsageError
from tdint.response.runs.case import Case
from tdint.response.runs.outcome import FailedRun
from tdint.response.runs.step_choice import _Search, step_within

DT = 0.01


@cache
def truth(building):
    """Return reference peak drifts of ten stories under the motion of this file."""
    return run(building(), noise(), method="impulse4", dt=DT / 16).stories.peak_drift


def relative_error(stories, building=ten_bilinear):
    """Return the maximum relative error of the peak drifts of ten stories."""
    return np.max(np.abs(stories.peak_drift / truth(building) - 1.0))


@pytest.mark.parametrize(
    "method", every(2, ["newmark-average", "impulse4", "moment4", "bathe", "central-difference"])
)
@pytest.mark.parametrize("tolerance", [0.02, 1e-3])
def test_large_step_within_tolerance_is_chosen(method, tolerance):
    """The true error is within the tolerance. The time step is a halving of four samples, or of two
    samples for a small tolerance, and at most three halvings smaller than the largest suitable time
    step, because a prediction halves at most three times at once."""
    record = noise()
    response = run(ten_bilinear(), record, method=method, tolerance=tolerance, history=True)
    check = response.check
    assert check.step_choice.tolerance == tolerance and check.drift_error <= tolerance
    coarsest = 4 if tolerance >= 0.003 else 2
    halvings = round(np.log2(coarsest * DT / response.dt))
    assert halvings >= 0 and response.dt == pytest.approx(coarsest * DT / 2.0**halvings)
    assert check.step_choice.samples == coarsest / 2.0**halvings
    assert len(response.history.time) == response.steps + 1
    plain = run(ten_bilinear(), record, method=method, dt=response.dt, check=False)
    assert np.array_equal(plain.stories.peak_drift, response.stories.peak_drift)
    assert relative_error(response.stories) <= tolerance
    # The search would have stopped at this time step, which is eight times as long.
    if halvings < 3:
        return
    try:
        before = run(ten_bilinear(), record, method=method, dt=8.0 * response.dt)
    except FailedRun as failure:
        assert (method, failure.status) == ("central-difference", "unstable-step")
    else:
        assert before.check.drift_error > tolerance


def pair_errors(tolerance, factor):
    """Return the check of a run with a tolerance, its reported errors, and the errors that follow
    from the pair of runs, both relative to the peaks."""
    response = run(ten_bilinear(), noise(), method="impulse4", tolerance=tolerance)
    check = response.check
    assert check.method.startswith("impulse4") and check.time_steps[1] == response.dt
    coarse = run(
        ten_bilinear(), noise(), method="impulse4", dt=check.time_steps[0], check=False
    ).stories
    relative = factor * np.abs(coarse.peak_drift / response.stories.peak_drift - 1.0)
    least = np.maximum(np.maximum(relative, 0.2 * np.sqrt(np.mean(relative**2))), 1e-5)
    return check, check.errors.peak_drift / response.stories.peak_drift, least


@pytest.mark.parametrize(
    ("tolerance", "runs", "ratio", "factor"), [(0.02, 2, 2, 8 / 9), (1e-4, 3, 2, 2 / 3)]
)
def test_error_is_fraction_of_difference_of_pair(tolerance, runs, ratio, factor):
    """The error is 8/9 of the difference of the first pair, or 2/3 if differences have decreased by
    more than a factor of 3. It is at least a fifth of the root mean square over the stories."""
    check, reported, expected = pair_errors(tolerance, factor)
    assert check.step_choice.runs == runs
    assert check.time_steps[0] == pytest.approx(ratio * check.time_steps[1])
    assert reported == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("earlier", "difference", "halvings", "factor"),
    [
        (None, 0.1, 1, 8 / 9),  # twice the error 4/9 of the finer run at order 2 with its 4/3
        (1.0, 0.1, 1, 2 / 3),
        # a decrease by a factor of 100 over twice the number of halvings
        (1.0, 0.1, 2, (4 / 3) / 99),
        (1.0, 0.5, 1, 4 / 3),  # of order 1: the error of the finer run is the difference
        (1.0, 2.0, 1, 4.0),  # growing differences
        (0.0, 0.0, 1, 4.0),
    ],
)
def test_error_fraction_follows_observed_order(earlier, difference, halvings, factor):
    """By Richardson extrapolation, the fraction is 1 / (r^p - 1) with the observed order p, with a
    margin of a third, and at least 2 / (r^2 - 1)."""
    search = _Search.of(prepare(ten_linear(), noise(samples=101), method="impulse4"), 0.01, None, 1)
    if earlier is not None:
        search.pairs.append((earlier, 1))
    least = 2.0 / (4.0**halvings - 1.0) if earlier is not None else 0.0
    assert search._factor(difference, halvings) == pytest.approx(max(factor, least))


def test_halvings_are_predicted_from_error_and_tolerance():
    """At order 2, an error of 15 tolerances requires two halvings (factor 16). At the observed
    order 1, it requires four halvings, of which three are made at once. At order 3, it requires
    two."""
    case = prepare(ten_linear(), noise(samples=101), method="newmark-average")
    search = _Search.of(case, 0.01, None, 1)
    assert search._halvings(0, 0.15, False) == 2
    assert search._halvings(1, 0.075, False) == 3
    search = _Search.of(case, 0.01, None, 1)
    assert search._halvings(0, None, False) == search._halvings(0, np.inf, False) == 1
    assert search._halvings(0, 0.8, False) == 3  # 6.3 / 2
    assert search._halvings(1, 0.079, False) == 1  # order 3.3 is observed, 3 is used
    case = prepare(ten_linear(), noise(samples=101), method="impulse4")
    assert _Search.of(case, 0.001, None, 1)._halvings(1, 0.9, True) == 2


def test_chosen_step_is_at_most_allowed_step():
    """Half of the tolerance would be met by steps of two samples, the finer step of the first
    pair."""
    case = prepare(ten_linear(), noise(), method="impulse4")
    for largest, chosen in ((np.inf, 2), (2 * DT, 2), (1.9 * DT, 1), (DT, 1), (0.9 * DT, 0.5)):
        assert step_within(case, 0.5, largest=largest) == chosen * DT
    other = prepare(ten_linear(), noise(), method="newmark-average")
    assert (step_within(other, 0.5), step_within(other, 0.5, largest=3.9 * DT)) == (4 * DT, 2 * DT)


def test_requested_step_is_upper_bound_of_chosen_step():
    response = run(ten_linear(), noise(), method="impulse4", tolerance=0.05, dt=DT / 2)
    assert (
        response.check.time_steps == (DT / 2, DT / 4) and response.check.step_choice.samples == 0.25
    )  # the first pair
    response = run(ten_linear(), noise(), method="newmark-average", tolerance=0.05, dt=DT / 2)
    assert response.dt == DT / 2 and response.check.step_choice.samples == 0.5


def test_step_is_halved_without_record():
    case = oscillator(2.0 * np.pi, displacement=(1.0,))
    response = run(case, method="newmark-average", dt=0.1, duration=5.0, tolerance=1e-3)
    assert response.dt < 0.1
    assert response.check.step_choice.samples is None
    assert abs(response.stories.peak_drift[0] - 1.0) <= 1e-3


def test_unreachable_tolerance_is_refused():
    record = noise(samples=101)
    with pytest.raises(
        FailedRun,
        match=r"1e-09 %.* dt = 3.90625e-05 s .* of story \d+ "
        r"is still",
    ) as failure:
        run(ten_linear(), record, method="newmark-average", tolerance=1e-11)
    assert failure.value.status == "not-within-tolerance"
    assert failure.value.dt == pytest.approx(DT / 256)


@pytest.mark.parametrize("threshold", [1.0, 0.004])
def test_failed_runs_end_search_for_tolerance(monkeypatch, threshold):
    """All runs fail, or only the runs that would estimate the errors."""
    monkeypatch.setattr(Case, "integrate", broken(threshold))
    with pytest.raises(FailedRun):
        run(ten_linear(), noise(samples=101), method="newmark-average", tolerance=1e-4)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -0.1, np.nan])
def test_tolerance_must_be_between_0_and_1(tolerance):
    with pytest.raises(UsageError, match=r"tolerance .* (0 and 1|nan)"):
        run(ten_linear(), noise(samples=101), method="newmark-average", tolerance=tolerance)
