"""Error estimates cover the true error for known solutions and random buildings."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.linalg import expm

from building_cases import (
    LINEAR,
    Force,
    Law,
    model,
    noise,
    oscillator,
    story,
    ten_bilinear,
    ten_linear,
)
from facts import states
from random_buildings import checked_building
from selection import every
from step_checks import broken
from tdint import make_record, prepare, run, run_sequence
from tdint.model.story import PowerDashpot
from tdint.response.runs import error_estimate, step_choice
from tdint.response.runs.case import Case
from tdint.response.runs.error_estimate import common, finer, start_peaks, story_errors
from tdint.response.runs.outcome import StoryErrors
from tdint.response.time_steps import Steps

NAMES = [field.name for field in fields(StoryErrors)]


def pairs(response, reference):
    """Return the estimated and true errors of all peaks that have a value, as flat arrays."""
    for name in NAMES:
        true = np.abs(getattr(response.stories, name) - getattr(reference.stories, name))
        found = getattr(response.check.errors, name)
        known = np.isfinite(getattr(response.stories, name))
        assert np.array_equal(np.isfinite(found), known)
        yield name, found[known], true[known]


# ---- Known solutions


@pytest.mark.parametrize(
    "method",
    every(
        2,
        [
            "impulse4",
            "newmark-average",
            "central-difference",
            "bathe",
            "houbolt",
            "wilson",
            "gauss4",
            "exact",
        ],
    ),
)
@pytest.mark.parametrize("dt", [0.02, 0.05, 0.08])
def test_estimated_errors_of_free_vibration(method, dt):
    """The displacement is u = cos(omega t) + sin(omega t) with a period of 1 s. Its amplitude is
    the root of 2. A linear spring has no residual drift."""
    omega = 2.0 * np.pi
    case = oscillator(omega, displacement=(1.0,), velocity=(omega,))
    case = replace(case, collapse_drift=10.0)
    response = run(case, method=method, dt=dt, duration=6.0, check=True)
    errors, stories = response.check.errors, response.stories
    assert (stories.residual_drift[0], errors.residual_drift[0]) == (0.0, 0.0)
    known = {
        "peak_drift": np.sqrt(2.0),
        "peak_displacement": np.sqrt(2.0),
        "peak_velocity": omega * np.sqrt(2.0),
        "peak_absolute_acceleration": omega**2 * np.sqrt(2.0),
        "peak_shear": omega**2 * np.sqrt(2.0),
    }
    for name, value in known.items():
        found, true = getattr(errors, name)[0], abs(getattr(stories, name)[0] - value)
        assert true <= 2.0 * found
        assert found <= 6.0 * true + 2e-3 * value
    assert response.check.drift_error == errors.peak_drift[0] / stories.peak_drift[0]


@pytest.mark.parametrize(
    ("method", "factor"),
    [
        ("newmark-average", 4.0 / 3.0),
        ("impulse4", 3.0),
        ("moment4", 3.0),
        ("impulse4:rho_inf=0.5", 3.0),
    ],
)
def test_estimate_is_maximum_of_three_terms(method, factor):
    """The terms are the difference from impulse4 with half the time step times a factor, a fifth of
    the root mean square of the differences of all stories (at most eight differences), and 1e-5 of
    the peak."""
    response = run(ten_bilinear(), noise(), method=method)
    other = run(ten_bilinear(), noise(), method="impulse4", dt=0.005, check=False)
    for name in ("peak_drift", "peak_absolute_acceleration", "peak_total_shear"):
        assert not np.any(getattr(response.interstep_bound, name))
        peaks, estimated = getattr(response.stories, name), getattr(response.check.errors, name)
        gap = np.abs(peaks - getattr(other.stories, name)) / peaks
        relative = factor * gap
        mean_error = np.minimum(0.2 * np.sqrt(np.mean(relative**2)), 8.0 * gap)
        least = np.maximum(np.maximum(relative, mean_error), 1e-5)
        assert estimated == pytest.approx(least * peaks, rel=1e-9)
    assert np.array_equal(response.check.corrected.peak_drift, other.stories.peak_drift)
    assert (response.check.time_steps, response.check.method) == ((other.dt,), other.method)


def test_estimate_includes_possible_peaks_between_time_steps():
    """The possible excess counts up to the largest peak that the additional run does not exclude;
    without an additional run with shorter steps it counts completely. To a residual drift it is
    added."""
    response = run(ten_bilinear(), noise(), method="impulse4")
    other = run(ten_bilinear(), noise(), method="impulse4", dt=0.005, check=False)
    names = [field.name for field in fields(StoryErrors)]

    def estimate(own, additional, **more):
        bounds = [
            StoryErrors(**{name: np.full(10, value) for name in names})
            for value in (own, additional)
        ]
        pair = (
            replace(each, interstep_bound=bound)
            for each, bound in zip((response, other), bounds, strict=True)
        )
        return story_errors(*pair, **more)

    resolved = estimate(0.0, 0.0)
    assert np.all(resolved.peak_drift < 1.0) and np.all(resolved.peak_total_shear > 1.0)
    for name in names:
        error = getattr(resolved, name)
        change = getattr(other.stories, name) - getattr(response.stories, name)
        excluded, half, complete = (
            getattr(estimate(1.0, 0.0), name),
            getattr(estimate(1.0, 0.5), name),
            getattr(estimate(1.0, 0.5, other_is_finer=False), name),
        )
        if name == "residual_drift":
            assert all(np.array_equal(each, error + 1.0) for each in (excluded, half, complete))
            continue
        np.testing.assert_array_equal(excluded, error)
        np.testing.assert_allclose(
            half, np.maximum(error, np.minimum(0.5 + change, 1.0)), rtol=0.0, atol=1e-9
        )
        np.testing.assert_array_equal(complete, np.maximum(error, 1.0))


def test_damper_forces_of_central_difference_are_not_overestimated():
    """The parabolas of this method allow velocities far above the velocities at the steps. The
    additional run excludes these velocities."""
    stories = [story(1.0, k, LINEAR, height=3.0, dashpot=0.5) for k in (400.0, 300.0, 200.0)]
    response = run(model(stories), noise(), method="central-difference", dt=0.02)
    truth = run(model(stories), noise(), method="exact", dt=0.001, check=False)
    assert np.any(response.interstep_bound.peak_damper_force > 0.0)
    true = np.abs(response.stories.peak_damper_force - truth.stories.peak_damper_force)
    estimated = response.check.errors.peak_damper_force
    assert np.all(true <= 2.0 * estimated) and np.all(estimated <= 2.0 * true)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average"])
@pytest.mark.parametrize("path", ["run", "sequence", "tolerance"])
def test_estimate_includes_start_of_moving_building(method, path):
    """The upper of two stories vibrates with a period of half a time step and strong damping.

    The accelerations have their maxima a tenth of a time step after the start. The exact values
    follow from the matrix exponential. In both runs, the values at the start are larger than the
    values at all later steps, so that the difference of the runs is zero.
    """
    dampers, springs, h = (1.0, 40.0), (100.0, 1e4), 0.1
    stiffness, damping = (
        np.array([[lower + upper, -upper], [-upper, upper]]) for lower, upper in (springs, dampers)
    )
    rates = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
    states = [np.array([0.0, 1e-3, 0.0, 1.0])]
    growth = expm(rates * h / 1000)
    for _ in range(1000):
        states.append(growth @ states[-1])
    true = np.max(np.abs(np.array(states) @ rates[2:].T), axis=0)
    building = model(
        [
            story(1.0, k, LINEAR, height=3.0, dashpot=c)
            for k, c in zip(springs, dampers, strict=True)
        ],
        displacement=(0.0, 1e-3),
        velocity=(0.0, 1.0),
    )
    still = replace(noise(), dt=h, acceleration=np.zeros(21))
    if path == "sequence":
        response = run_sequence(
            prepare(building, method=method, allow_unstable=True), [still, still], rest=1.0
        )
        first, second = response.events
        peaks, errors = first.stories, first.errors
        later = second.errors.peak_absolute_acceleration
        assert np.all(later < errors.peak_absolute_acceleration)
    elif path == "tolerance":
        response = run(building, still, method=method, tolerance=0.3, dt=2.0 * h)
        peaks, errors = response.stories, response.check.errors
    else:
        response = run(building, still, method=method, allow_unstable=True)
        peaks, errors = response.stories, response.check.errors
    missed = true - peaks.peak_absolute_acceleration
    assert np.all(missed <= 1.1 * errors.peak_absolute_acceleration)
    if path == "run":
        assert np.all(missed > 12.0)
        assert np.all(errors.peak_absolute_acceleration < 1.5 * missed)


def test_additional_run_with_longer_steps_excludes_no_peak(monkeypatch):
    """The search for a tolerance compares a run of impulse4 with a run that has longer time
    steps."""
    compared = []

    def recorded(response, other, by, **more):
        compared.append((response.dt < other.dt, more["other_is_finer"]))
        return story_errors(response, other, by, **more)

    monkeypatch.setattr(step_choice.error_estimate, "story_errors", recorded)
    run(ten_bilinear(), noise(), method="impulse4", tolerance=0.01)
    assert compared and set(compared) == {(True, False)}


def building_with_a_gap():
    """Return random stories, one of which stiffens at a contact, and a record with a sampling
    interval of 0.0125 s."""
    rng = np.random.default_rng(7)
    n = int(rng.integers(1, 5))
    stiffness = rng.uniform(0.5, 1.5, n) * 10.0 ** rng.uniform(1.5, 2.8)
    stories = [story(1.0, k, LINEAR, height=3.0) for k in stiffness]
    i = int(rng.integers(0, n))
    contact = Law("gap", (rng.uniform(0.01, 0.05), stiffness[i] * rng.uniform(5.0, 30.0)))
    stories[i] = story(1.0, stiffness[i], contact, height=3.0)
    return model(stories), replace(noise(), dt=0.0125)


def test_the_note_on_a_slow_estimate_states_no_times(monkeypatch):
    """A quick run has no such note."""
    case = oscillator(2.0 * np.pi, displacement=(1.0,))
    slow_run = "a second run estimates the errors, with most of the time; check=False omits it"
    assert slow_run not in run(case, dt=0.02, duration=1.0, check=True).notes
    monkeypatch.setattr(error_estimate, "_SLOW_RUN", 0.0)
    assert slow_run in run(case, dt=0.02, duration=1.0, check=True).notes
    assert slow_run not in run(case, dt=0.02, duration=1.0, check=False).notes


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average"])
@pytest.mark.parametrize("samples", [5, 10])
def test_long_steps_are_compared_with_steps_of_sampling_interval(method, samples):
    """With half the time step, both runs may miss the same contacts and agree although both are
    wrong. Only peaks are compared, because the residual drift is the drift at one time of a
    vibration."""
    building, record = building_with_a_gap()
    dt, duration = samples * record.dt, 10.0
    response = run(
        building, record, method=method, dt=dt, duration=duration, history=True, check=True
    )
    truth = run(building, record, dt=record.dt / 16, duration=duration, check=False)
    assert response.check.time_steps == pytest.approx((record.dt,))
    assert len(response.history.error.drift) == len(response.history.drift)
    for name in ("peak_drift", "peak_absolute_acceleration", "peak_total_shear"):
        estimated = getattr(response.check.errors, name)
        true = np.abs(getattr(response.stories, name) - getattr(truth.stories, name))
        assert np.all(true[np.isfinite(estimated)] <= 2.0 * estimated[np.isfinite(estimated)]), name


def vibrating_building_with_a_gap():
    """Return three stories in free vibration, one of which stiffens at a contact, and the first
    period."""
    springs = np.random.default_rng(8).uniform(200.0, 600.0, 3)
    stories = [story(1.0, k, LINEAR, height=3.0) for k in springs]
    stories[1] = story(1.0, springs[1], Law("gap", (0.01, 10.0 * springs[1])), height=3.0)
    building = model(stories, velocity=(0.2, 0.4, 0.7))
    return building, 2.0 * np.pi / prepare(building).building.vibration.frequency(1)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average"])
@pytest.mark.parametrize("part", [3, 5, 10])
def test_long_steps_without_record_are_compared_with_fiftieth_of_period(method, part):
    """For a step of half of a fifth of the period, the true error of `impulse4` is 14 times the
    estimate."""
    building, period = vibrating_building_with_a_gap()
    response = run(building, method=method, dt=period / part, duration=9.0 * period)
    truth = run(building, dt=period / 1600, duration=9.0 * period, check=False)
    (dt,) = response.check.time_steps
    assert period / 55.0 < dt <= period / 50.0 * (1.0 + 1e-9)
    for name in ("peak_drift", "peak_absolute_acceleration", "peak_total_shear"):
        true = np.abs(getattr(response.stories, name) - getattr(truth.stories, name))
        assert np.all(true <= 2.0 * getattr(response.check.errors, name)), name


def test_short_steps_without_record_are_compared_with_a_third_of_the_step():
    building, period = vibrating_building_with_a_gap()
    for part in (20, 100):
        response = run(building, dt=period / part, duration=3.0 * period)
        assert response.check.time_steps == pytest.approx((period / part / 3.0,))


def test_half_of_long_step_underestimates_error_of_contact():
    """The true error is more than twice the estimate from half of the step, which is why the
    sampling interval is used."""
    building, record = building_with_a_gap()
    peaks = [
        run(building, record, dt=dt, duration=10.0, check=False).stories.peak_absolute_acceleration
        for dt in (10 * record.dt, 5 * record.dt, record.dt / 16)
    ]
    true, estimated = np.abs(peaks[0] - peaks[2]), 4.0 / 3.0 * np.abs(peaks[0] - peaks[1])
    assert np.max(true / estimated) > 2.0


def test_accidental_agreement_of_one_story_is_corrected():
    """The first of three stories does not change, while the neighbouring stories change by a
    tenth."""
    size = np.array([5.0, 1.0, 1.0])
    estimated = common(np.array([0.0, 0.1, 0.1]), size)
    assert estimated / size == pytest.approx(np.sqrt(0.02 / 3.0))
    unknown = common(np.array([np.nan, 0.1, 0.1]), np.array([np.nan, 1.0, 1.0]))
    assert np.isnan(unknown[0]) and unknown[1:] == pytest.approx(0.1)


def test_exact_estimates_its_own_errors():
    """The method only has errors between its steps. For floor forces, which it interpolates
    linearly, impulse4 estimates the errors."""
    response = run(ten_linear(), noise(), method="exact")
    assert response.check.method == "exact" and response.check.drift_error < 1e-3
    forced = oscillator(2.0 * np.pi, displacement=(1.0,), forces=[Force(1, 1e3, 0.0, 3.0)])
    assert run(forced, method="exact", dt=0.05, duration=2.0).check.method.startswith("impulse4")


BOUC_WEN = Law("bouc-wen", (1e6, 0.05, 2.0, 0.5))


def dashpots(exponent):
    """Return a linear building with power-law dashpots, without other damping."""
    device = PowerDashpot(4e5, exponent, 0.001)
    return model([replace(story(2e5, 1e8), power_dashpot=device) for _ in range(3)])


@pytest.mark.parametrize(
    ("building", "method", "reference"),
    [
        (dashpots(0.5), "moment4", "moment4"),
        (dashpots(0.5), "moment4:rho_inf=0.5", "impulse4"),
        (dashpots(0.5), "impulse4", "moment4"),
        (model([story(2e5, 1e8, Law("tanh", (1e6,)))] * 3), "moment4", "moment4"),
        (ten_bilinear(), "moment4", "impulse4"),
        (
            model([story(2e5, 1e8, Law("bouc-wen", (1e6, 0.05, 2.0, 0.5)))] * 3),
            "moment4",
            "impulse4",
        ),
    ],
)
def test_methods_that_estimate_errors(building, method, reference):
    """`moment4` without numerical dissipation estimates its own errors in buildings whose laws have
    no branches, and those of `impulse4` with power-law dashpots, with a quarter of the step."""
    response = run(building, noise(), method=method)
    assert response.check.method.partition(":")[0] == reference
    parts = 4 if (method, reference) == ("impulse4", "moment4") else 2
    assert response.check.time_steps == (0.01 / parts,)


@pytest.mark.parametrize("exponent", [0.3, 0.6])
def test_errors_of_moment4_with_power_law_dashpots_are_not_overestimated(exponent):
    """Estimates are at least half of the true error, and at most ten times as large, except for one
    value. An additional run of impulse4 gives ratios from 0.2 to 100 (exponent 0.3) and 0.2 to 7
    (0.6).

    Smaller errors than 3e-5 of the peak are not judged, because the smallest estimate is 1e-5."""
    building = dashpots(exponent)
    response = run(building, noise(), method="moment4", dt=0.02)
    truth = run(building, noise(), method="impulse4", dt=0.01 / 64, check=False)
    ratios = []
    for name, found, true in pairs(response, truth):
        peaks = np.abs(getattr(truth.stories, name))
        is_judged = true > 3e-5 * peaks[np.isfinite(peaks)]
        ratios.append(found[is_judged] / true[is_judged])
    ratios = np.concatenate(ratios)
    assert ratios.size > 10
    # The error of the total shear of the first story is small by accident (exponent 0.3: ratio 51).
    assert np.all(ratios > 0.5) and np.sum(ratios >= 10.0) <= 1


# ---- Random buildings

SEEDS = 12
STEP, SAMPLES, FINE = 0.01, 501, 16


@pytest.mark.long
def test_estimates_cover_true_errors_in_random_buildings():
    """At least 99 % of the peaks have a true error below twice the estimate, and the estimates are
    not far too large.

    The reference is impulse4 with 1/16 of the time step; its difference from moment4 is tolerated.
    """
    good, ratios = [], []
    for seed in range(SEEDS):
        case, record, method = checked_building(seed, SAMPLES, STEP)
        end = record.duration
        response = run(case, record, method=method, duration=end, check=True)
        truth, other = (
            run(case, record, method=fine, dt=STEP / FINE, duration=end)
            for fine in ("impulse4", "moment4")
        )
        for (name, found, true), doubt in zip(
            pairs(response, truth),
            (np.abs(getattr(truth.stories, name) - getattr(other.stories, name)) for name in NAMES),
            strict=True,
        ):
            doubt = doubt[np.isfinite(doubt)]
            size = getattr(truth.stories, "peak_drift" if name == "residual_drift" else name)
            assert np.all(doubt <= 1e-5 * np.max(size[np.isfinite(size)], initial=0.0))
            good.append(true <= 2.0 * found + doubt)
            # Errors below a millionth of the peak are below the smallest estimate.
            is_judged = true > np.maximum(10.0 * doubt, 1e-6 * size[np.isfinite(size)])
            ratios.append(found[is_judged] / true[is_judged])
    good, ratios = np.concatenate(good), np.concatenate(ratios)
    print(
        f"{good.size} peaks, {100 * good.mean():.2f} %, ratio {np.median(ratios):.2f}, "
        f"{np.mean(ratios >= 1):.3f}"
    )
    assert good.size > 240
    assert good.mean() >= 0.99
    assert 1.0 <= np.median(ratios) <= 2.0


# ---- The run that is checked


def test_error_estimate_changes_no_result():
    plain = run(ten_bilinear(), noise(), method="newmark-average", history=True, check=False)
    other = run(ten_bilinear(), noise(), method="newmark-average", history=True, check=True)
    for name in NAMES:
        assert np.array_equal(getattr(plain.stories, name), getattr(other.stories, name))
    assert (plain.energy, plain.notes, plain.check) == (other.energy, other.notes, None)
    assert np.array_equal(plain.history.drift, other.history.drift)
    assert other.check.time_steps == (0.005,)


def test_time_steps_of_additional_runs():
    """The steps are divided by two, also for an odd number of samples, and all runs end at the same
    time."""
    assert finer(Steps(0.01, 7, 2)) == Steps(0.005, 14, 4)
    assert finer(Steps(0.06, 7, 1, 6)) == Steps(0.03, 14, 1, 3)
    assert finer(Steps(0.03, 7, 1, 3)) == Steps(0.015, 14, 2, 3)
    response = run(ten_linear(), noise(), method="newmark-average", dt=0.03, check=True)
    assert response.check.time_steps == pytest.approx((0.015,))
    true = run(
        ten_linear(), noise(), method="exact", dt=0.001, duration=response.steps * response.dt
    )
    for _, found, error in pairs(response, true):
        assert np.sum(error <= 2.0 * found) >= 0.9 * error.size


def test_building_at_rest_has_zero_error():
    still = replace(noise(), acceleration=np.zeros(50))
    response = run(ten_linear(), still, method="newmark-average", check=True)
    assert response.check.drift_error == 0.0
    assert all(
        not np.any(found) and not np.any(true) for _, found, true in pairs(response, response)
    )


def test_error_of_story_that_moves_only_in_additional_run_is_infinite():
    """The central difference moves no floor in its first time step, because the ground acceleration
    starts at 0, and one more floor in each further step. The relative error of a drift of 0 is
    infinite, so that a time step is chosen with which all floors move."""
    ground = make_record(np.array([0.0, 1.0]), dt=0.01, units="m/s^2")
    building = model([story(1e3, 1e6)] * 2)
    options = {"method": "central-difference", "dt": 0.01, "duration": 0.01}
    response = run(building, ground, **options)
    assert response.check.errors.peak_drift.min() > 0.0
    assert response.check.drift_error == np.inf
    response = run(building, ground, **options, tolerance=0.5)
    assert response.stories.peak_drift.min() > 0.0 and response.dt < 0.01
    assert 0.0 < response.check.drift_error <= 0.5


def test_failed_additional_run_leaves_errors_unknown(monkeypatch):
    monkeypatch.setattr(Case, "integrate", broken(0.008))
    response = run(ten_linear(), noise(), method="newmark-average", check=True)
    assert (response.check.drift_error, response.check.drift_story, response.check.time_steps) == (
        None,
        None,
        (),
    )
    assert all(np.all(np.isnan(getattr(response.check.errors, name))) for name in NAMES)
    assert states(response.notes[-1], "no error estimate: ... dt 0.005 s ... (diverged)")


@pytest.mark.parametrize("velocity", [0.1, 0.5])
def test_simultaneous_additional_run_gives_the_same_errors(velocity):
    """With the higher velocity the run collapses, so that the additional run is repeated up to that
    time."""
    calls = []

    def begin(function, argument):
        calls.append(argument)
        return lambda: function(argument)

    falling = model(
        [story(1.0, 6.54, Law("bilinear", (0.327, 0.0)), height=3.0)],
        p_delta=True,
        velocity=(velocity,),
    )
    case = prepare(falling, method="newmark-average")
    steps = case.steps(0.01, 10.0)
    alone = error_estimate.run_with_error_estimate(case, steps)
    beside = error_estimate.run_with_error_estimate(case, steps, begin=begin)
    assert (velocity == 0.5) == (alone.collapse is not None)
    assert [argument.h for argument in calls] == [0.005]
    for name in NAMES:
        errors = [getattr(response.check.errors, name) for response in (alone, beside)]
        assert np.array_equal(*errors, equal_nan=True)
    assert alone.check.time_steps == beside.check.time_steps


def test_errors_of_collapsed_run_end_at_collapse():
    falling = model(
        [story(1.0, 6.54, Law("bilinear", (0.327, 0.0)), height=3.0)], p_delta=True, velocity=(0.5,)
    )  # P-delta half as stiff as the story
    response = run(falling, method="newmark-average", dt=0.01, duration=100.0, check=True)
    assert response.collapse.ended
    assert 0.0 < response.check.drift_error < 0.01
    assert any(f"the run ends at {response.collapse.time:.6g} s" in note for note in response.notes)


def test_history_has_error_at_each_step():
    """The errors are differences from the run that estimates the errors of peaks, at the same
    times, and require check=True."""
    record = noise(samples=201)
    options = {"history": True, "duration": record.duration}
    response = run(ten_bilinear(), record, method="newmark-average", check=True, **options)
    other = run(
        ten_bilinear(), record, method="impulse4", dt=record.dt / 2, check=False, **options
    ).history
    for name in ("displacement", "velocity", "drift", "shear"):
        deviation = getattr(other, name)[::2] - getattr(response.history, name)
        assert np.array_equal(getattr(response.history.error, name), deviation) and np.any(
            deviation
        )
    pieces = [piece.error.drift for piece in response.history_chunks(1)]
    assert np.array_equal(np.concatenate(pieces), response.history.error.drift)
    assert run(ten_bilinear(), record, history=True).history.error is None


@pytest.mark.parametrize("law", [LINEAR, Law("gap", (0.012, 6e8))])
def test_later_peaks_are_compared_if_a_building_moves_at_the_start(law):
    """Three undamped stories in free vibration: `start_peaks` covers the true peaks at all times,
    although both runs can report the maximum at the start. The peaks of the first steps alone do
    not cover them."""
    dt, duration = 0.02, 1.6
    building = model(
        [story(1e5, k, law, height=3.0) for k in (2.2e8, 1.8e8, 1.5e8)],
        displacement=(0.014, 0.004, 0.016),
    )
    case = prepare(building, method="park")
    true = run(building, method="impulse4", dt=dt / 32, duration=duration, check=False).stories
    steps = Steps(dt, round(duration / dt), 1, 1)
    first, found = start_peaks(case, replace(steps, count=2)), start_peaks(case, steps)
    names = [name for name in NAMES if name != "residual_drift"]
    assert any(np.any(getattr(first, name) < 0.9 * getattr(true, name)) for name in names)
    for name in names:
        upper, peak = getattr(found, name), getattr(true, name)
        known = np.isfinite(peak) & (peak > 0.0)
        assert np.all(upper[known] >= peak[known] * (1.0 - 1e-4)), name
        assert np.all(upper[known] <= 2.0 * peak[known]), name


def test_later_peaks_far_below_the_start_need_no_second_run(monkeypatch):
    """With 20 % damping, the second maximum is half of the first, and one run is sufficient."""
    runs = []
    peaks_after = error_estimate._peaks_after

    def counted(case, steps, first):
        runs.append(steps.h)
        return peaks_after(case, steps, first)

    monkeypatch.setattr(error_estimate, "_peaks_after", counted)
    for xi, count in ((0.2, 1), (0.0, 2)):
        runs.clear()
        run(oscillator(20.0, xi, displacement=(0.01,)), method="impulse4", dt=0.1, duration=2.0)
        assert len(runs) == count


def test_additional_run_of_a_building_with_stops_has_a_third_of_the_step():
    """Half of a step would have the same end after a closing in its last half. A step of two
    sampling intervals is divided by four, because both intervals must contain steps."""
    with_stop, _ = vibrating_building_with_a_gap()
    motion = make_record(np.sin(0.3 * np.arange(50)), dt=0.01, units="m/s^2")
    for building, divisors in ((with_stop, (3, 4)), (model([story(1e4, 1e6)]), (2, 2))):
        for samples, divisor in zip((1, 2), divisors, strict=True):
            case = prepare(building, motion, method="impulse4")
            steps = case.steps(samples * 0.01)
            shorter = error_estimate.reference_steps(case, steps)
            assert shorter.h == pytest.approx(steps.h / divisor)
            assert shorter.count == divisor * steps.count


def test_additional_run_and_runs_of_studies_compose_no_texts():
    case = prepare(ten_linear(), noise(samples=51), method="newmark-average")
    steps = case.steps()
    assert case.integrate(steps).notes
    for silent in (error_estimate.reference(case), case.silenced()):
        response = silent.integrate(steps)
        assert response.notes == response.warnings == ()


def test_growth_of_a_yielded_story_that_unloads():
    """The present soft branch would lead to a drift without a force far beyond the peak. The story
    unloads with its initial stiffness: the peak does not grow."""
    t = 0.01 * np.arange(301)
    samples = 3.5 * np.sin(7.3 * t + t * t / 3.0) * np.minimum(1.0, (3.0 - t) / 0.3)
    motion = make_record(samples, dt=0.01, units="m/s^2")
    law = {"type": "bilinear", "yield_force": 1.6e5, "hardening": 0.02}
    building = {
        "stories": [{"mass": 1e5, "stiffness": 0.9e7, "law": law}],
        "damping": "3%",
        "plausibility": "off, test",
    }
    short = run(building, motion, duration=3.0)
    longer = run(building, motion, duration=9.0, check=False)
    growth = longer.stories.peak_drift[0] / short.stories.peak_drift[0] - 1.0
    assert growth <= short.growth + 1e-9 < max(2.0 * growth, 0.05)
