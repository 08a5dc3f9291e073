"""Choice of time steps, memory of long runs, and frequency bounds."""

import tracemalloc

import numpy as np
import pytest

from building_cases import Force, Law, model, oscillator, story
from tdint import run
from tdint.errors import UsageError
from tdint.model.building import assemble
from tdint.response.time_steps import Steps, choose_steps


@pytest.mark.parametrize(
    ("dt", "duration", "expected"),
    [
        (None, None, Steps(0.01, 4000)),
        (0.01, None, Steps(0.01, 4000)),
        (0.005, None, Steps(0.005, 8000, per_sample=2)),
        (0.01 / 7.0, 1.0, Steps(0.01 / 7.0, 700, per_sample=7)),
        (0.03, 3.0, Steps(0.03, 100, stride=3)),
        (None, 60.0, Steps(0.01, 6000)),
        (None, 0.0149, Steps(0.01, 2)),
    ],
)
def test_steps_are_chosen_for_record(dt, duration, expected):
    chosen = choose_steps(dt, duration, 0.01, 40.0)
    assert (chosen.count, chosen.per_sample, chosen.stride) == (
        expected.count,
        expected.per_sample,
        expected.stride,
    )
    assert chosen.h == pytest.approx(expected.h, rel=1e-15)


@pytest.mark.parametrize(
    ("dt", "below", "above"), [(0.004, "0.00333333333333", "0.005"), (0.025, "0.02", "0.03")]
)
def test_incompatible_time_step_reports_nearest_steps(dt, below, above):
    with pytest.raises(UsageError, match=f"the nearest time steps are {below} and {above} s"):
        choose_steps(dt, None, 0.01, 40.0)


def test_run_without_record_requires_step_and_duration():
    with pytest.raises(UsageError, match="the time step is required"):
        choose_steps(None, 1.0, None, 0.0)
    with pytest.raises(UsageError, match="the duration is required"):
        choose_steps(0.1, None, None, 0.0)
    assert choose_steps(0.1, 1.0, None, 0.0) == Steps(0.1, 10)


@pytest.mark.parametrize(
    ("dt", "duration"), [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (0.1, np.inf), (0.1, 0.0)]
)
def test_steps_and_durations_must_be_positive(dt, duration):
    with pytest.raises(UsageError, match=r"(positive number of seconds|got nan)"):
        run(oscillator(1.0), method="impulse4", dt=dt, duration=duration)


def test_memory_of_run_does_not_grow_with_steps():
    """Without a history, the memory peak is equal for 31 times the number of steps. One number per
    step would need 24 kB."""
    building = model([story(1.0, 100.0, dashpot=0.1)], forces=[Force(1, 1.0, 0.0, 3.0)])

    def peak(steps):
        tracemalloc.start()
        run(building, method="impulse4", dt=0.01, duration=0.01 * steps, check=False)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    peak(10)
    assert peak(3100) < peak(100) + 12_000


@pytest.mark.parametrize("n", [1, 2, 10, 100])
def test_frequency_bound_is_close_to_maximum_frequency(n):
    generator = np.random.default_rng(n)
    building = assemble(model([story(m, k) for m, k in generator.uniform(1.0, 3.0, (n, 2))]))
    assert building.fastest >= building.modes().omega[-1] * (1.0 - 1e-12)
    assert building.fastest <= 1.02 * building.modes().omega[-1]
    uniform = assemble(model([story(1.0, 1.0)] * n))
    assert uniform.fastest <= 2.0


@pytest.mark.parametrize("method", ["gauss4", "impulse4", "impulse", "newmark-average"])
def test_long_chain_with_underflowing_forces_is_integrated(method):
    """Ahead of the wave, forces are below the smallest positive number of the processor."""
    law = Law("polynomial", (500.0, 0.2))
    chain = model(
        [story(50.0, 500.0, law) for _ in range(100)], forces=[Force(1, 1000.0, 0.0, 50.0)], dt=2e-4
    )
    response = run(chain, method=method, duration=0.03)
    assert response.status == "done"
    assert 0.0 < response.stories.peak_drift[0] < 0.1
    assert response.stories.peak_drift[-1] == 0.0


@pytest.mark.parametrize(
    ("dt", "duration", "record_dt"),
    [
        (1e-300, None, 0.01),
        (1e-13, None, 0.01),
        (None, 1e20, 0.01),
        (None, 1e308, 0.01),
        (0.01, 1e308, None),
    ],
)
def test_excessive_numbers_of_steps_are_refused(dt, duration, record_dt):
    with pytest.raises(UsageError, match=r"1e\+09 steps|by an integer up to 1e\+09"):
        choose_steps(dt, duration, record_dt, 40.0)
