"""Composite method of Bathe: comparison of the compiled step with the published formulas and
properties."""

import math

import numpy as np
import pytest

from building_cases import Law, noise
from step_checks import RAYLEIGH, TOO_LARGE, SingleSteps, building, load, matrices
from tdint.errors import UsageError
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.response.runs.run import run

METHODS = (
    "bathe",
    "bathe:gamma=0.5",
    "bathe:rho_inf=0.5",
    "bathe:rho_inf=1",
    "bathe:rho_inf=0.8:gamma=0.3",
)


def published(rho_inf, gamma):
    """Return q0, q1, q2 of Noh and Bathe (2019)."""
    q1 = (rho_inf + 1.0) / (2.0 * gamma * (rho_inf - 1.0) + 4.0)
    return 0.5 + (gamma - 1.0) * q1, q1, 0.5 - gamma * q1


def dense_step(values, M, C, K, h, u0, v0, a0, p_inner, p1):
    """Perform one step of Noh and Bathe (2019), solved for the displacements."""
    gamma = values[1]
    q0, q1, q2 = published(*values)
    g = gamma * h
    u_inner = np.linalg.solve(
        4.0 / g**2 * M + 2.0 / g * C + K,
        p_inner + M @ (4.0 / g**2 * u0 + 4.0 / g * v0 + a0) + C @ (2.0 / g * u0 + v0),
    )
    v_inner = 2.0 / g * (u_inner - u0) - v0
    a_inner = 2.0 / g * (v_inner - v0) - a0
    # v1 = (u1 - x) / (q2 h), a1 = (v1 - y) / (q2 h)
    s = q2 * h
    x = u0 + h * (q0 * v0 + q1 * v_inner)
    y = v0 + h * (q0 * a0 + q1 * a_inner)
    u1 = np.linalg.solve(M / s**2 + C / s + K, p1 + M @ (x / s**2 + y / s) + C @ x / s)
    v1 = (u1 - x) / s
    return u1, v1, (v1 - y) / s


@pytest.mark.parametrize("gamma", [0.1, 0.5, 2.0 - math.sqrt(2.0), 0.9])
def test_rho_inf_0_equals_method_of_2005(gamma):
    q0, q1, q2 = published(0.0, gamma)
    assert q0 == pytest.approx(1.0 / (2.0 * (2.0 - gamma)), rel=1e-14)
    assert q1 == pytest.approx(q0, rel=1e-14)
    assert q2 == pytest.approx((1.0 - gamma) / (2.0 - gamma), rel=1e-14)
    assert parse(f"bathe:gamma={gamma!r}").coefficients(None, None, 1.0) == pytest.approx(
        [gamma, q0, q1, q2], rel=1e-14
    )


@pytest.mark.parametrize("method", METHODS)
def test_building_with_p_delta_dashpot_and_force_agrees_with_formulas(method):
    """The load of the first substep is the load at its end: the ground acceleration is
    interpolated, and the force is evaluated at this time."""
    case, record = building(RAYLEIGH), noise(samples=201)
    history = run(case, record, method=method, history=True).history
    rho_inf, gamma = parse(method).values
    M, C, K = matrices(case)
    h = record.dt
    motion = [np.array(case.initial.displacement), np.array(case.initial.velocity)]
    motion.append(np.linalg.solve(M, load(case, record, 0.0) - C @ motion[1] - K @ motion[0]))
    u = [motion[0]]
    for s in range(200):
        loads = load(case, record, (s + gamma) * h), load(case, record, (s + 1) * h)
        motion = dense_step((rho_inf, gamma), M, C, K, h, *motion, *loads)
        u.append(motion[0])
    np.testing.assert_allclose(history.displacement, u, rtol=0.0, atol=1e-10 * np.max(np.abs(u)))


@pytest.mark.parametrize("rho_inf", [0.0, 0.3, 0.8, 1.0 - 1e-9, 1.0])
def test_default_gamma_gives_equal_matrices_in_both_substeps(rho_inf):
    gamma, _, _, q2 = parse(f"bathe:rho_inf={rho_inf!r}").coefficients(None, None, 1.0)
    assert q2 == gamma / 2.0
    assert q2 == pytest.approx(published(rho_inf, gamma)[2], rel=1e-14)
    if rho_inf < 0.9:
        assert gamma == pytest.approx(
            (2.0 - math.sqrt(2.0 + 2.0 * rho_inf)) / (1.0 - rho_inf), rel=1e-14
        )
    else:
        assert gamma == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("text", ["gamma=0", "gamma=1", "rho_inf=-0.1", "rho_inf=1.1"])
def test_parameters_out_of_range_are_refused(text):
    with pytest.raises(UsageError, match="must be in"):
        parse(f"bathe:{text}")


def test_failed_second_substep_leaves_state_unchanged():
    """The load is small at the inner point and too large for the stories at the end."""
    gamma = 2.0 - math.sqrt(2.0)
    small = 1.0
    steps = SingleSteps("bathe")
    before = steps.memory()
    assert steps.take((small - gamma * TOO_LARGE) / (1.0 - gamma), TOO_LARGE) == rows.NOT_CONVERGED
    np.testing.assert_array_equal(steps.memory(), before)
    assert np.all(steps.space.law_state[rows.FIRST_TRIAL + rows.DRIFT, :2] != 0.0)
    assert steps.take((small - gamma * TOO_LARGE) / (1.0 - gamma), small) > 0


@pytest.mark.parametrize("gamma", [2.0 - math.sqrt(2.0), 0.5])
def test_story_laws_follow_path_through_inner_point(gamma):
    """The lowest story yields before the inner point and unloads elastically after it."""
    stiffness, strength, hardening = 100.0, 5.0, 0.1
    steps = SingleSteps(f"bathe:gamma={gamma!r}", Law("bilinear", (strength, hardening)))
    inner, end = -20.0, 10.0  # ground acceleration at the inner point and at the end, m/s^2
    assert steps.take((inner - gamma * end) / (1.0 - gamma), end) > 0
    law_state = steps.space.law_state[:, 0]
    slip = law_state[rows.FIRST_TRIAL + rows.DRIFT] - strength / stiffness
    force = strength + hardening * stiffness * slip
    assert slip > 0.0
    assert law_state[rows.FIRST_TRIAL + rows.FORCE] == pytest.approx(force, rel=1e-12)
    way_back = law_state[rows.DRIFT] - law_state[rows.FIRST_TRIAL + rows.DRIFT]
    assert -2.0 * strength / stiffness < way_back < 0.0
    assert law_state[rows.FORCE] == pytest.approx(force + stiffness * way_back, rel=1e-12)
    assert law_state[rows.DISSIPATED] == pytest.approx(
        (1.0 - hardening) * strength * slip, rel=1e-12
    )
