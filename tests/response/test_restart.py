"""Runs that continue from the final state of another run, and `Stepper`: the numbers of an
uninterrupted run, bit for bit."""

import pickle

import numpy as np
import pytest

import tdint
from feature_buildings import FEATURES, building
from small_buildings import MOTION
from tdint.errors import AnalysisError, UsageError
from tdint.response.runs.energy import ENERGY_TERMS

INTERVAL, SAMPLES = MOTION.dt, MOTION.acceleration
STEPS = SAMPLES.size - 1
PLAIN = {"stories": [{"mass": 2e5, "height": 3.0, "stiffness": 4e7}] * 2, "damping": 0.03}
METHODS = ["moment4", "newmark-average", "bathe", "gauss4", "houbolt", "rk5", "hht:alpha=-0.1"]
QUANTITIES = (
    "time",
    "ground_acceleration",
    "displacement",
    "velocity",
    "absolute_acceleration",
    "drift",
    "shear",
    "damper_force",
    "total_shear",
)


def record(samples, dt=INTERVAL):
    return tdint.make_record(samples, dt=dt, units="m/s^2")


def halves(model, cut, dt=INTERVAL, **options):
    """Return an uninterrupted run under `MOTION`, and a run that continues after `cut` sampling
    intervals from the state at the end of a run of the first part."""
    more = {"history": True, "check": False}
    duration = STEPS * INTERVAL
    whole = tdint.run(model, MOTION, dt=dt, duration=duration, **options, **more)
    first = tdint.run(model, MOTION, dt=dt, duration=cut * INTERVAL, **options, **more)
    rest = record(SAMPLES[cut:])
    second = tdint.run(
        model, rest, initial=first.final_state, duration=duration - cut * INTERVAL, **more
    )
    return whole, first, second


def assert_same_rows(whole, rows, second):
    """Assert that the rows of a history equal the rows of another history, bit for bit."""
    for name in QUANTITIES:
        expected = getattr(whole.history, name)[rows:]
        np.testing.assert_array_equal(getattr(second.history, name), expected, err_msg=name)
    for part in ("element_force", "devices"):
        assert (getattr(whole.history, part) is None) == (getattr(second.history, part) is None)
    if whole.history.element_force is not None:
        np.testing.assert_array_equal(
            second.history.element_force, whole.history.element_force[rows:]
        )
    if whole.history.devices is not None:
        for name in ("displacement", "velocity", "absolute_acceleration", "drift", "shear"):
            expected = getattr(whole.history.devices, name)[rows:]
            np.testing.assert_array_equal(
                getattr(second.history.devices, name), expected, err_msg=name
            )


@pytest.mark.parametrize("feature", FEATURES)
def test_restart_equals_uninterrupted_run(feature):
    whole, _, second = halves(building((feature,)), 25)
    assert_same_rows(whole, 25, second)
    assert abs(second.energy.error) < 1e-2


@pytest.mark.parametrize("method", METHODS)
def test_restart_of_other_methods(method):
    model = PLAIN | {"stories": building(("elements",))["stories"]}
    whole, _, second = halves(model, 17, method=method)
    assert second.method == whole.method
    assert_same_rows(whole, 17, second)


@pytest.mark.parametrize(("dt", "cut", "rows"), [(INTERVAL / 4, 21, 84), (2 * INTERVAL, 24, 12)])
def test_restart_with_parts_and_multiples_of_the_sampling_interval(dt, cut, rows):
    whole, _, second = halves(building(("power",)), cut, dt=dt)
    assert_same_rows(whole, rows, second)


def test_restart_between_two_samples():
    model, dt = building(("brace",)), INTERVAL / 4
    more = {"history": True, "check": False, "dt": dt}
    whole = tdint.run(model, MOTION, duration=STEPS * INTERVAL, **more)
    first = tdint.run(model, MOTION, duration=21.25 * INTERVAL, **more)
    # The record goes on at its samples, of which the first is a quarter of an interval later.
    times = np.arange(85, 4 * STEPS + 1) / 4.0
    rest = record(np.interp(times, np.arange(SAMPLES.size), SAMPLES), dt)
    second = tdint.run(
        model, rest, initial=first.final_state, duration=(STEPS - 21.25) * INTERVAL, **more
    )
    np.testing.assert_allclose(
        second.history.displacement, whole.history.displacement[85:], rtol=1e-12, atol=1e-15
    )


def test_record_of_zeros_continues_like_the_end_of_a_record():
    model, samples = building(("links",)), SAMPLES[:31]
    assert samples[-1] != 0.0
    more = {"history": True, "check": False}
    whole = tdint.run(model, record(samples), duration=50 * INTERVAL, **more)
    first = tdint.run(model, record(samples), duration=30 * INTERVAL, **more)
    second = tdint.run(
        model, record(np.zeros(21)), initial=first.final_state, duration=20 * INTERVAL, **more
    )
    assert_same_rows(whole, 30, second)
    assert any("value of the state" in note for note in second.notes)
    free = tdint.run(model, initial=first.final_state, duration=20 * INTERVAL, **more)
    assert_same_rows(whole, 30, free)


def test_chain_of_restarts_from_pickled_states():
    model, more = building(("relief",)), {"history": True, "check": False}
    whole = tdint.run(model, MOTION, duration=50 * INTERVAL, **more)
    response = tdint.run(model, MOTION, duration=10 * INTERVAL, **more)
    for first in (10, 20, 30, 40):
        state = pickle.loads(pickle.dumps(response)).final_state
        part = record(SAMPLES[first : first + 11])
        response = tdint.run(model, part, initial=state, duration=10 * INTERVAL, **more)
    np.testing.assert_array_equal(response.history.displacement, whole.history.displacement[40:])
    assert response.history.time[0] == whole.history.time[40]


@pytest.mark.parametrize("feature", ["elements", "attachments", "brace", "tangent", "points"])
def test_energies_start_at_zero_and_peaks_are_those_of_the_run(feature):
    whole, first, second = halves(building((feature,)), 20)
    start = {name: getattr(second.history.energy, name)[0] for name in ENERGY_TERMS}
    stored = start["kinetic"] + start["strain"] + start["braces"]
    np.testing.assert_allclose(second.energy.initial, stored, rtol=1e-12)
    for name in ("input", "viscous", "dampers", "hysteretic"):
        assert start[name] == 0.0
        expected = getattr(whole.energy, name) - getattr(first.energy, name)
        scale = whole.energy.reference
        np.testing.assert_allclose(getattr(second.energy, name), expected, atol=1e-9 * scale)
    if whole.devices is not None:
        np.testing.assert_allclose(
            second.devices.dissipated_energy,
            whole.devices.dissipated_energy - first.devices.dissipated_energy,
            atol=1e-9 * whole.energy.reference,
        )
    for peak, name in (("peak_drift", "drift"), ("peak_total_shear", "total_shear"),
                       ("peak_absolute_acceleration", "absolute_acceleration")):  # fmt: skip
        rows = np.abs(getattr(second.history, name)).max(axis=0)
        found = getattr(second.stories, peak)
        assert (found >= rows * (1.0 - 1e-12)).all()
        assert (found <= 1.1 * rows).all()  # between the steps


def test_peak_of_a_decaying_motion_is_its_start():
    model = {"stories": [{"mass": 1.0, "stiffness": 100.0}], "damping": 0.5}
    first = tdint.run({**model, "initial": {"displacement": [0.1]}}, dt=0.01, duration=0.1)
    second = tdint.run(model, initial=first.final_state, duration=0.5, history=True)
    assert second.stories.peak_drift[0] == abs(second.history.drift[0, 0])


def test_history_in_chunks_of_a_restart():
    _, _, second = halves(building(("attachments",)), 13)
    (thinned,) = second.history_chunks(5)
    np.testing.assert_array_equal(thinned.displacement, second.history.displacement[::5])
    np.testing.assert_array_equal(thinned.time, second.history.time[::5])
    (complete,) = second.history_chunks(1)
    np.testing.assert_array_equal(complete.shear, second.history.shear)
    np.testing.assert_array_equal(complete.energy.error, second.history.energy.error)


def test_restart_of_flexural_stories_within_rounding():
    model = {
        "stories": [
            {"mass": 1e5, "height": 3.0, "flexural": {"EI": 4e8, "GA": 1e9}}
        ] * 3,
        "damping": 0.05,
    }  # fmt: skip
    whole, _, second = halves(model, 20, method="exact")
    for name in ("displacement", "velocity", "absolute_acceleration", "shear"):
        expected = getattr(whole.history, name)[20:]
        np.testing.assert_allclose(
            getattr(second.history, name), expected, rtol=0, atol=1e-10 * np.abs(expected).max()
        )


def test_free_vibration_until_rest_from_a_state():
    model = PLAIN | {"damping": 0.1}
    first = tdint.run(model, MOTION, duration=20 * INTERVAL, check=False)
    rest = record(np.zeros(2))
    second = tdint.run(model, rest, initial=first.final_state, until_rest=True, history=True)
    assert second.time_at_rest == second.history.time[-1]
    assert np.abs(second.history.drift[-1]).max() < 1e-3 * first.stories.peak_drift.max()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": PLAIN | {"damping": 0.05}}, "initial is the state of another building"),
        ({"model": PLAIN | {"stories": PLAIN["stories"][:1]}}, "of another building"),
        ({"model": building(("harmonic",))}, "of another building"),
        ({"method": "newmark-average"}, "initial is the state of a run by impulse4.*omit the meth"),
        ({"dt": INTERVAL / 2}, "with dt 0.02 s, and cannot be continued with dt 0.01 s; omit dt"),
        ({"check": True}, "check cannot be used with initial"),
        ({"tolerance": "1%"}, "tolerance cannot be used with initial"),
        ({"gradient": "damping"}, "gradient cannot be used with initial"),
        ({"initial": {"displacement": [0.1]}}, "initial must be RunState or None"),
    ],
)
def test_invalid_restart(change, message):
    state = tdint.run(PLAIN, MOTION, method="impulse4", check=False).final_state
    arguments = {"model": PLAIN, "record": MOTION, "initial": state} | change
    with pytest.raises(UsageError, match=message):
        tdint.run(**arguments)


def driven(stepper, samples, forces=None):
    """Return the displacements at the start and after each step."""
    rows = [stepper.state.displacement]
    for i, sample in enumerate(samples):
        stepper.step(sample, None if forces is None else forces[i])
        rows.append(stepper.state.displacement)
    return np.array(rows)


@pytest.mark.parametrize("feature", FEATURES)
def test_stepper_equals_run(feature):
    model = building((feature,))
    expected = tdint.run(
        model, MOTION, duration=STEPS * INTERVAL, history=True, check=False
    ).history
    stepper = tdint.Stepper(model, dt=INTERVAL)
    count = len(expected.displacement)  # a collapse ends the run, and not the stepper
    np.testing.assert_array_equal(driven(stepper, SAMPLES[1:count]), expected.displacement)
    end = stepper.state.history
    for name in QUANTITIES[1:]:
        np.testing.assert_array_equal(getattr(end, name)[0], getattr(expected, name)[-1])
    if expected.devices is not None:
        np.testing.assert_array_equal(end.devices.shear[0], expected.devices.shear[-1])


@pytest.mark.parametrize("method", METHODS)
def test_stepper_of_other_methods(method):
    model = PLAIN | {"stories": building(("elements",))["stories"]}
    expected = tdint.run(
        model, MOTION, duration=STEPS * INTERVAL, history=True, check=False, method=method
    )
    found = driven(tdint.Stepper(model, method, INTERVAL), SAMPLES[1:])
    np.testing.assert_array_equal(found, expected.history.displacement)


@pytest.mark.parametrize("method", ["impulse4", "gauss4", "newmark-average"])
def test_floor_forces_equal_tables(method):
    steps, rng = 1100, np.random.default_rng(3)  # more than the first size of the arrays
    samples = np.append(0.0, rng.normal(size=steps))
    forces = np.vstack([np.zeros(2), 1e5 * rng.normal(size=(steps, 2))])
    times = np.arange(steps + 1) * INTERVAL
    tables = [
        {"floor": i + 1, "points": np.column_stack([times, forces[:, i]]).tolist()}
        for i in range(2)
    ]
    model = building(("attachments",))
    expected = tdint.run(
        model | {"excitation": {"forces": tables}},
        record(samples),
        duration=times[-1],
        history=True,
        check=False,
        method=method,
    ).history
    stepper = tdint.Stepper(model, method, INTERVAL)
    found = driven(stepper, samples[1:], forces[1:])
    np.testing.assert_array_equal(found, expected.displacement)
    end = stepper.state.history
    np.testing.assert_array_equal(end.total_shear[0], expected.total_shear[-1])


def test_forces_start_at_zero_and_default_to_zero():
    model = PLAIN | {"damping": 0.0}
    late, early = (tdint.Stepper(model, "newmark-average", INTERVAL) for _ in range(2))
    for forces in ([0.0, 0.0], [0.0, 0.0], [1e5, 2e5], [0.0, 0.0]):
        early.step(0.0, forces)
    for forces in (None, None, [1e5, 2e5], None):
        late.step(0.0, forces)
    assert early.state.displacement.all()
    np.testing.assert_allclose(late.state.displacement, early.state.displacement, rtol=1e-12)


@pytest.mark.parametrize("forces", [None, np.full((STEPS, 2), 3e4)])
def test_reset_copy_and_state_are_independent(forces):
    stepper = tdint.Stepper(building(("links",)), dt=INTERVAL)
    expected = driven(stepper, SAMPLES[1:], forces)
    stepper.reset()
    assert stepper.time == 0.0
    np.testing.assert_array_equal(driven(stepper, SAMPLES[1:], forces), expected)
    stepper.reset()
    driven(stepper, SAMPLES[1:21], forces)
    other, state = stepper.copy(), stepper.state
    other.step(99.0, None if forces is None else [1e6, 1e6])
    stepper.step(SAMPLES[21], None if forces is None else forces[20])
    assert not np.array_equal(other.state.displacement, stepper.state.displacement)
    np.testing.assert_array_equal(stepper.state.displacement, expected[21])
    np.testing.assert_array_equal(state.displacement, expected[20])


@pytest.mark.parametrize("feature", FEATURES)
def test_run_continues_from_a_stepper(feature):
    model = building((feature,))
    whole = tdint.run(model, MOTION, duration=STEPS * INTERVAL, history=True, check=False)
    stepper = tdint.Stepper(model, dt=INTERVAL)
    for cut in (0, 20):
        second = tdint.run(
            model,
            record(SAMPLES[cut:]),
            initial=stepper.state,
            duration=(STEPS - cut) * INTERVAL,
            history=True,
            check=False,
        )
        assert_same_rows(whole, cut, second)
        driven(stepper, SAMPLES[1:21])


def test_stepper_starts_with_the_initial_motion_of_the_model():
    model = PLAIN | {"initial": {"displacement": [0.01, 0.03]}}
    state = tdint.Stepper(model, dt=0.01).state
    np.testing.assert_array_equal(state.displacement, [0.01, 0.03])
    omega_squared = 4e7 / 2e5
    acceleration = [-omega_squared * (0.01 - 0.02), -omega_squared * 0.02]
    undamped = tdint.Stepper(model | {"damping": 0.0}, dt=0.01).state.history
    np.testing.assert_allclose(undamped.absolute_acceleration[0], acceleration, rtol=1e-12)


def test_stepper_reports_a_step_that_fails():
    polynomial = {"type": "polynomial", "coefficients": [1e5, 0.0, -1e7]}
    model = {"stories": [{"mass": 1e3, "height": 3.0, "law": polynomial}]}
    stepper = tdint.Stepper(model, dt=0.01)
    with pytest.raises(AnalysisError, match="story 1"):
        for _ in range(2000):
            stepper.step(8.0)
    stepper.reset()
    stepper.step(0.1)
    assert stepper.time == 0.01


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.nan,), "step: ground_acceleration must be a finite number, got nan"),
        ((0.0, [1.0]), "step: floor_forces must contain 2 finite numbers, one for each floor, got"),
        ((0.0, [1.0, np.inf]), "step: floor_forces must contain 2 finite numbers"),
    ],
)
def test_invalid_step(arguments, message):
    stepper = tdint.Stepper(PLAIN, dt=0.01)
    with pytest.raises(UsageError, match=message):
        stepper.step(*arguments)
    assert stepper.time == 0.0


def test_stepper_needs_a_stable_time_step():
    with pytest.raises(UsageError, match="Stepper: dt is missing; specify the time step in s"):
        tdint.Stepper(PLAIN)
    with pytest.raises(tdint.FailedRun, match="unstable"):
        tdint.Stepper(PLAIN, "central-difference", 0.5)


def test_kinks_of_power_law_dashpots_do_not_depend_on_recorded_peaks():
    """A restart resets the peaks of a run, but not the largest drift until now, with which
    `impulse4` compares the reversals of curved laws."""
    stories = [
        {
            "mass": mass, "stiffness": stiffness,
            "law": {"type": "bouc-wen", "yield_force": strength, "hardening": 0.05,
                    "exponent": 2, "beta": 0.5},
            "dashpot": {"coefficient": dashpot, "exponent": 0.4, "linear_below": 0.005},
        }
        for mass, stiffness, strength, dashpot in ((1e5, 3e7, 2.5e5, 2e5), (9e4, 2.5e7, 2e5, 1.5e5))
    ]  # fmt: skip
    model = {"stories": stories, "damping": "2%", "plausibility": "off, test"}
    whole, _, second = halves(model, STEPS // 2, dt=0.5 * INTERVAL, method="impulse4")
    assert_same_rows(whole, STEPS, second)


OF_MOTION = [(name, "impulse4") for name in FEATURES if name not in ("harmonic", "points")]


@pytest.mark.parametrize(
    ("feature", "method"), [*OF_MOTION, ("p-delta", "houbolt"), ("attachments", "gauss4")]
)
def test_replaced_motion_at_rest_is_the_initial_motion_of_a_model(feature, method):
    """Laws, dampers and methods of several steps start from the motion as at the start of a run,
    also if the state is that of the start of another model."""
    model = building((feature,))
    u, v = [4e-3, -5e-3], [0.05, -0.1]
    attached = [item["name"] for item in model.get("attachments", [])]
    motion = {"displacement": 1e-3, "velocity": 0.02}
    initial = {"displacement": u, "velocity": v}
    if attached:
        initial["attachments"] = dict.fromkeys(attached, motion)
        u, v = [*u, *[1e-3] * len(attached)], [*v, *[0.02] * len(attached)]
    expected = tdint.Stepper(model | {"initial": initial}, method, INTERVAL)
    other = tdint.Stepper(model | {"initial": {"displacement": [0.02, 0.0]}}, method, INTERVAL)
    later = tdint.Stepper(model, method, INTERVAL)
    for _ in range(3):
        later.step(0.0)
    for stepper in (later, other):
        state = stepper.state.replace(u, v)
        start = expected.state.history
        np.testing.assert_allclose(state.history.shear, start.shear, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(
            state.history.energy.strain, start.energy.strain, rtol=1e-9, atol=1e-9
        )
        stepper.reset(state)
    for steps in (0, 10):
        for stepper in (expected, other, later):
            for acceleration in SAMPLES[1 : steps + 1]:
                stepper.step(acceleration)
        for stepper in (other, later):
            for name in QUANTITIES[2:]:
                values = getattr(expected.state.history, name)
                np.testing.assert_allclose(
                    getattr(stepper.state.history, name), values,
                    rtol=0, atol=1e-9 * np.max(np.abs(values)) + 1e-300, err_msg=name,
                )  # fmt: skip
