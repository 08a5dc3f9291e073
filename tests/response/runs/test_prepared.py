"""A building is assembled once for any number of runs, and all inputs and results of an analysis
are picklable."""

import pickle
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from building_cases import Force, model, noise, ten_bilinear, ten_linear
from tdint import prepare, run, run_case
from tdint.errors import ModelError, ModelFault, UsageError
from tdint.methods.catalogue import parse
from tdint.model import modes
from tdint.response.runs import measured_stability, prepared
from tdint.response.runs.outcome import FailedRun
from tdint.response.time_steps import Steps

SCALES = np.linspace(0.02, 2.0, 100)


@pytest.fixture
def counted(monkeypatch):
    """Count calls of the assembly, of the solution for modes, and of the stability check."""
    count = {"assemble": 0, "solve_modes": 0, "find_instability": 0}

    def observer_state(home, name):
        function = getattr(home, name)

        def counting(*arguments):
            count[name] += 1
            return function(*arguments)

        monkeypatch.setattr(home, name, counting)

    observer_state(prepared, "assemble")
    observer_state(modes, "solve_modes")
    observer_state(measured_stability, "find_instability")
    return count


@pytest.mark.long
def test_scaled_cases_share_matrices_and_modes(counted):
    """Rayleigh damping by modes and a method with a stability limit both require the modes."""
    case = prepare(ten_linear(), noise(samples=11), method="central-difference")
    peaks = [run_case(case.scaled(factor), dt=0.005).stories.peak_drift for factor in SCALES]
    assert counted == {"assemble": 1, "solve_modes": 1, "find_instability": 1}
    expected = np.outer(SCALES / SCALES[-1], peaks[-1])
    np.testing.assert_allclose(peaks, expected, rtol=1e-11, atol=1e-14 * np.max(peaks))


def test_forces_are_not_scaled_with_ground_motion():
    forced = model(ten_linear().stories, forces=[Force(10, 1e5, 0.0, 3.0)])
    case = prepare(forced, noise(samples=11), method="newmark-average")
    small = run_case(case.scaled(1e-14)).stories.peak_drift
    np.testing.assert_allclose(
        small, run_case(case.under(None), dt=0.01, duration=0.1).stories.peak_drift, rtol=1e-6
    )


def test_samples_of_a_batch_can_be_read_only():
    building, record = prepared.PreparedBuilding.of(ten_linear()), noise(samples=11)
    samples = record.acceleration.copy()
    runs = [prepared.RunSpec(samples, 1.0, Steps(record.dt, 10))]
    batch = building.integrate_batch(parse("impulse4"), record.dt, runs)
    assert batch.ends[0, 1] == 10
    samples.flags.writeable = False
    again = building.integrate_batch(parse("impulse4"), record.dt, runs)
    assert np.array_equal(again.peaks, batch.peaks)


def test_scaling_requires_ground_motion():
    with pytest.raises(UsageError, match="no ground motion to scale"):
        prepare(ten_linear(), method="impulse4").scaled(2.0)


# ---- Pickled inputs and results


def same(first, second):
    """Return True if two results are equal; arrays are compared by element."""
    if isinstance(first, np.ndarray):
        return first.dtype == second.dtype and np.array_equal(
            first, second, equal_nan=first.dtype.kind == "f"
        )
    if isinstance(first, float):
        return first == second or (np.isnan(first) and np.isnan(second))
    if is_dataclass(first):
        return type(first) is type(second) and all(
            same(getattr(first, field.name), getattr(second, field.name))
            for field in fields(first)
            if field.compare
        )
    if isinstance(first, tuple | list):
        return len(first) == len(second) and all(map(same, first, second))
    return bool(first == second)


def travelled(thing):
    return pickle.loads(pickle.dumps(thing))


def test_cases_and_responses_are_picklable():
    case = prepare(ten_bilinear(), noise(samples=51), method="impulse4")
    here = run_case(case, history=True, check=True)
    there = run_case(travelled(case), history=True, check=True)
    assert same(case.prepared, travelled(case).prepared)
    assert same(replace(travelled(here), solver_time=0.0), replace(there, solver_time=0.0))
    assert same(travelled(here), here)


def test_exceptions_are_picklable():
    with pytest.raises(FailedRun) as caught:
        run(ten_linear(), noise(samples=51), method="central-difference", dt=0.05)
    failure = caught.value
    again = travelled(failure)
    assert type(again) is FailedRun
    assert (str(again), vars(again)) == (str(failure), vars(failure))
    assert again.largest_stable_dt > 0.0
    fault = ModelFault("a.yaml", 1, 2, "stories", "bad")
    assert travelled(ModelError([fault])).faults == (fault,)
    assert str(travelled(ModelError("all bad"))) == "all bad"


def test_cached_instability_agrees_with_modes_of_building():
    """The cached result equals the result for the separate oscillators."""
    building = prepared.PreparedBuilding.of(ten_linear())
    found = building.instability(parse("central-difference"), 0.05)
    vibration = building.building.modes()
    ratios = vibration.damping_ratios(building.building.damping_matrix())
    assert found == measured_stability.find_instability(
        parse("central-difference"), vibration.omega, ratios, 0.05
    )
    assert building.instability(parse("newmark-average"), 0.05) is None


@pytest.mark.parametrize("scene", [ten_linear, ten_bilinear])
def test_time_integration_in_chunks_equals_single_call(scene, monkeypatch):
    """The call can be interrupted between chunks, and the results do not depend on the chunks."""
    case, steps = (
        prepare(scene(), noise(samples=201, peak=30.0), method="impulse4"),
        Steps(0.01, 200),
    )
    complete = case.integrate(steps, history=True)
    monkeypatch.setattr(prepared, "_FIRST_CALL_SIZE", 1)
    monkeypatch.setattr(prepared, "_CALL_SECONDS", 0.0)
    pieces = case.integrate(steps, history=True)
    np.testing.assert_array_equal(pieces.history.displacement, complete.history.displacement)
    np.testing.assert_array_equal(pieces.history.energy.error, complete.history.energy.error)
    np.testing.assert_array_equal(pieces.stories.peak_shear, complete.stories.peak_shear)
    assert pieces.collapse == complete.collapse


def test_collapse_time_is_first_step_beyond_collapse_drift():
    case = prepare(
        replace(ten_bilinear(), collapse_drift=0.004),
        noise(samples=401, peak=8.0),
        method="impulse4",
    )
    found = case.integrate(Steps(0.01, 400)).collapse
    last = round(found.time / 0.01)
    before, then = (
        case.integrate(Steps(0.01, count)).stories.peak_drift_ratio for count in (last - 1, last)
    )
    assert np.max(before) <= 0.004 < np.max(then)
    assert found.story == int(np.argmax(then)) + 1
