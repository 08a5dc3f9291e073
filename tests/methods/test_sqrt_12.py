"""omega h = sqrt(12): the printed formulas of the impulse method divide by zero, but the step must
not."""

import numpy as np
import pytest

from building_cases import RayleighRatio, model, noise, oscillator, story
from tdint import run
from tdint.model.building import assemble


@pytest.mark.parametrize("method", ["impulse", "impulse4", "moment4"])
def test_run_at_sqrt_12_conserves_energy(method):
    dt = 0.01
    response = run(
        oscillator(np.sqrt(12.0) / dt, displacement=(1.0,)),
        method=method,
        dt=dt,
        duration=10.0,
        history=True,
    )
    omega = np.sqrt(12.0) / dt
    energy = (
        0.5 * response.history.velocity[:, 0] ** 2
        + 0.5 * (omega * response.history.displacement[:, 0]) ** 2
    )
    assert energy == pytest.approx(np.full_like(energy, energy[0]), rel=1e-12)


@pytest.mark.parametrize("method", ["impulse", "impulse4", "moment4"])
def test_building_with_mode_at_sqrt_12(method):
    record = noise()
    damping = RayleighRatio((0.05, 0.05), (1, 2))
    omega = assemble(model([story(2e5, 3.5e8)] * 4)).modes().omega[-1]
    stiffness = 3.5e8 * (np.sqrt(12.0) / record.dt / omega) ** 2
    stiff = model([story(2e5, stiffness)] * 4, damping=damping)
    response = run(stiff, record, method=method)
    exact = run(stiff, record, method="exact")
    assert response.stories.peak_drift == pytest.approx(exact.stories.peak_drift, rel=1e-2)
