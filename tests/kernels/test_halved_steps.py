"""Halving of steps that do not converge. The tests replace a function of the time loop, which is
possible only without compiled loops (TDINT_KERNELS=python; tests/mutants/kernels.py)."""

import os

import pytest

from small_buildings import BUILDINGS, MOTION
from tdint import load_model, run
from tdint.kernels import layout as rows
from tdint.kernels.time_loop import loop
from tdint.response.runs.outcome import FailedRun

pytestmark = pytest.mark.skipif(
    os.environ.get("TDINT_KERNELS") != "python", reason="replaces a function of the time loop"
)


def refuse_steps(monkeypatch, longest):
    """Let all steps fail that are longer than a length, s."""
    take_step = loop.take_step

    def limited(step, coefficients, scene, h, load, memory):
        if h > longest * 1.001:
            return rows.NOT_CONVERGED
        return take_step(step, coefficients, scene, h, load, memory)

    monkeypatch.setattr(loop, "take_step", limited)


@pytest.mark.parametrize("parts", [2, 4])
@pytest.mark.parametrize("intervals", [1, 2, 4])
@pytest.mark.parametrize("name", ["forces", "bilinear"])
def test_halved_steps_are_steps_of_their_length(monkeypatch, name, intervals, parts):
    """The ground acceleration is linear in each part, and in parts of a step of several sampling
    intervals it has the same impulse and moment as in steps of their length."""
    model, dt = load_model(BUILDINGS[name]), intervals * MOTION.dt
    options = {"method": "newmark-average", "check": False, "history": True, "duration": 0.96}
    expected = run(model, MOTION, dt=dt / parts, **options)
    refuse_steps(monkeypatch, dt / parts)
    found = run(model, MOTION, dt=dt, **options)
    at_ends = expected.history.displacement[::parts]
    assert found.history.displacement == pytest.approx(at_ends, rel=1e-10, abs=1e-14)
    for quantity in ("peak_drift", "peak_shear", "peak_total_shear"):
        value, other = getattr(found.stories, quantity), getattr(expected.stories, quantity)
        assert value == pytest.approx(other, rel=1e-9)
    # The length of the parts remains the same until the step is complete.
    assert found.substeps == round(0.96 / dt) * (parts // 2)


def test_step_that_always_fails_ends_run(monkeypatch):
    refuse_steps(monkeypatch, 0.0)
    with pytest.raises(FailedRun):
        run(load_model(BUILDINGS["forces"]), MOTION, method="newmark-average", check=False)
