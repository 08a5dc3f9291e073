"""omega h = sqrt(12): the printed formulas of the impulse method divide by zero there, the step must not."""

import numpy as np
import pytest

from building_cases import RayleighRatio, model, noise, oscillator, story
from tdint import run
from tdint.analysis.run.workspace import amplification
from tdint.methods.catalogue import parse


def pade(omega, xi, h):
    """(2,2) diagonal Pade approximation of the exponential of the oscillator's matrix."""
    z = h * np.array([[0.0, 1.0], [-(omega**2), -2.0 * xi * omega]])
    even = np.eye(2) + z @ z / 12.0
    return np.linalg.solve(even - z / 2.0, even + z / 2.0)


AROUND = np.sqrt(12.0) * (1.0 + np.array([0.0, 1e-15, -1e-15, 1e-12, 1e-9, -1e-9, 1e-6, 1e-3, -1e-3]))


@pytest.mark.parametrize("xi", [0.0, 0.05])
@pytest.mark.parametrize("method", ["impulse", "impulse4", "moment4"])
def test_the_step_is_pade_2_2(method, xi):
    omegas = np.concatenate([AROUND, np.geomspace(1e-3, 1e4, 60)])
    measured = amplification(parse(method), omegas, np.full_like(omegas, xi), 1.0)
    for omega, matrix in zip(omegas, measured, strict=True):
        expected = pade(omega, xi, 1.0)
        scale = np.array([1.0, max(omega, 1.0)])
        balanced = (matrix - expected) / scale[:, None] * scale
        assert np.max(np.abs(balanced)) < 1e-12


@pytest.mark.parametrize("method", ["impulse", "impulse4", "moment4"])
def test_a_run_at_sqrt_12_is_finite_and_keeps_its_energy(method):
    dt = 0.01
    response = run(
        oscillator(np.sqrt(12.0) / dt, displacement=(1.0,)), method=method, dt=dt, duration=10.0, history=True
    )
    omega = np.sqrt(12.0) / dt
    energy = 0.5 * response.history.velocity[:, 0] ** 2 + 0.5 * (omega * response.history.displacement[:, 0]) ** 2
    assert energy == pytest.approx(np.full_like(energy, energy[0]), rel=1e-12)


@pytest.mark.parametrize("method", ["impulse", "impulse4", "moment4"])
def test_a_building_with_a_mode_there(method):
    record = noise()
    base = model([story(2e5, 3.5e8) for _ in range(4)], damping=RayleighRatio((0.05, 0.05), (1, 2)))
    from tdint.model.building import assemble

    omega = assemble(base).modes().omega[-1]
    factor = (np.sqrt(12.0) / record.dt / omega) ** 2
    stiff = model([story(2e5, 3.5e8 * factor) for _ in range(4)], damping=RayleighRatio((0.05, 0.05), (1, 2)))
    response = run(stiff, record, method=method)
    exact = run(stiff, record, method="exact")
    assert response.stories.peak_drift == pytest.approx(exact.stories.peak_drift, rel=1e-2)
