"""Methods of Houbolt and Park: comparison of the compiled step with the formulas and properties."""

import numpy as np
import pytest

from building_cases import noise, oscillator
from step_checks import RAYLEIGH, building, load, matrices
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.response.runs.run import run

METHODS = ("houbolt", "park")

# The formulas on displacements (on displacements and velocities for Park), times h or h^2, latest
# first
HOUBOLT_V = np.array([11.0, -18.0, 9.0, -2.0]) / 6.0
HOUBOLT_A = np.array([2.0, -5.0, 4.0, -1.0])
PARK = np.array([10.0, -15.0, 6.0, -1.0]) / 6.0


def dense_integration(method, case, record, steps):
    """Integrate with dense matrices: two steps of average acceleration, followed by the formulas
    with older displacements."""
    M, C, K = matrices(case)
    h = record.dt
    u, v = [np.array(case.initial.displacement)], [np.array(case.initial.velocity)]
    a = [np.linalg.solve(M, load(case, record, 0.0) - C @ v[0] - K @ u[0])]
    for s in range(steps):
        p = load(case, record, (s + 1) * h)
        if s < 2:
            x, y = u[-1] + h * v[-1] + h**2 / 4.0 * a[-1], v[-1] + h / 2.0 * a[-1]
            a.append(np.linalg.solve(M + h / 2.0 * C + h**2 / 4.0 * K, p - C @ y - K @ x))
            u.append(x + h**2 / 4.0 * a[-1])
            v.append(y + h / 2.0 * a[-1])
        elif method == "houbolt":
            past_v = np.tensordot(HOUBOLT_V[1:], u[:-4:-1], 1) / h
            past_a = np.tensordot(HOUBOLT_A[1:], u[:-4:-1], 1) / h**2
            effective = HOUBOLT_A[0] / h**2 * M + HOUBOLT_V[0] / h * C + K
            u.append(np.linalg.solve(effective, p - M @ past_a - C @ past_v))
            v.append(HOUBOLT_V[0] / h * u[-1] + past_v)
        else:
            past_v = np.tensordot(PARK[1:], u[:-4:-1], 1) / h
            past_a = np.tensordot(PARK[1:], v[:-4:-1], 1) / h
            b = PARK[0] / h
            u.append(
                np.linalg.solve(b**2 * M + b * C + K, p - M @ (past_a + b * past_v) - C @ past_v)
            )
            v.append(b * u[-1] + past_v)
    return np.array(u), np.array(v)


@pytest.mark.parametrize("method", METHODS)
def test_building_with_p_delta_dashpot_and_force_agrees_with_formulas(method):
    case, record = building(RAYLEIGH), noise(samples=201)
    history = run(case, record, method=method, history=True).history
    u, v = dense_integration(method, case, record, 200)
    np.testing.assert_allclose(history.displacement, u, rtol=0.0, atol=1e-10 * np.max(np.abs(u)))
    np.testing.assert_allclose(history.velocity, v, rtol=0.0, atol=1e-10 * np.max(np.abs(v)))


def test_small_steps_of_houbolt_have_no_cancellation():
    """With older displacements, Houbolt's period of 1e5 steps has an error of 4e-10."""
    case = oscillator(2.0 * np.pi, displacement=(1.0,))
    end = run(case, method="houbolt", dt=1e-5, duration=1.0, history=True).history.displacement[
        -1, 0
    ]
    assert end == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize("method", METHODS)
def test_memory_rows_are_declared(method):
    integrator = parse(method)
    kinematic_rows = (rows.DISPLACEMENT, rows.VELOCITY, rows.ACCELERATION)
    assert [row in integrator.family.memory for row in kinematic_rows] == [
        True,
        method == "park",
        False,
    ]
    assert len(integrator.family.derivatives) == integrator.family.state_rows
