"""Tests of the explicit method of Noh and Bathe (2013): the compiled step against dense equations,
and the path of the drift laws through the first substep."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from building_cases import Law, noise
from step_checks import RAYLEIGH, SingleSteps, building, load, matrices, restoring_of
from tdint.assessment.stability.stability import critical_step
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.methods.noh_bathe import tableau
from tdint.response.runs.run import run

P = 0.54
R = 1.0 - P


def dense_step(M, C, f, h, u0, v0, a0, p_inner, p1):
    """Take two substeps of the published method, each with a predicted velocity. The second
    prediction is the linear extrapolation of the accelerations."""
    s = P * h
    u = u0 + s * v0 + s**2 / 2.0 * a0
    a = np.linalg.solve(M, p_inner - C @ (v0 + s * a0) - f(u))
    v = v0 + s / 2.0 * (a0 + a)
    t = R * h
    u1 = u + t * v + t**2 / 2.0 * a
    slope = (a - a0) / s
    predicted = v0 + h * a0 + h**2 / 2.0 * slope
    a1 = np.linalg.solve(M, p1 - C @ predicted - f(u1))
    q1 = (1.0 - 2.0 * P) / (2.0 * P * R)
    q2 = 0.5 - P * q1
    q0 = -q1 - q2 + 0.5
    return u1, v + t * (q0 * a0 + (0.5 + q1) * a + q2 * a1), a1


@pytest.mark.parametrize("nonlinear", [False, True], ids=["linear", "cubic"])
def test_building_with_p_delta_dashpot_and_force_agrees_with_formulas(nonlinear):
    """The load of the first substep is the load at its end: the ground acceleration is
    interpolated, and the floor force is evaluated at this time."""
    case, record = building(RAYLEIGH, nonlinear=nonlinear), noise(samples=201)
    history = run(case, record, method="noh-bathe", history=True).history
    M, C, _ = matrices(case)
    f, _ = restoring_of(case, nonlinear)
    h = record.dt
    motion = [np.array(case.initial.displacement), np.array(case.initial.velocity)]
    motion.append(np.linalg.solve(M, load(case, record, 0.0) - C @ motion[1] - f(motion[0])))
    motions = [motion]
    for s in range(200):
        loads = load(case, record, (s + P) * h), load(case, record, (s + 1) * h)
        motions.append(dense_step(M, C, f, h, *motions[-1], *loads))
    for name, part in (("displacement", 0), ("velocity", 1)):
        want = np.array([motion[part] for motion in motions])
        np.testing.assert_allclose(
            getattr(history, name), want, rtol=0.0, atol=1e-10 * np.max(np.abs(want))
        )


def test_story_laws_follow_path_through_end_of_first_substep():
    """The lowest story yields in the first step. In the second step it yields backward in the first
    substep and forward in the second one, so a path past its end would have other forces."""
    stiffness, strength, hardening = 100.0, 5.0, 0.1
    steps = SingleSteps("noh-bathe", Law("bilinear", (strength, hardening)))
    law_state = steps.space.law_state[:, 0]
    path = []
    for _ in range(2):
        assert steps.take(-20.0, -20.0) > 0
        path.append(
            (law_state[rows.FIRST_TRIAL + rows.DRIFT], law_state[rows.FIRST_TRIAL + rows.FORCE])
        )
        path.append((law_state[rows.DRIFT], law_state[rows.FORCE]))
    assert path[2][0] < path[1][0] < path[3][0]
    # A spring of the hardening stiffness and a spring that slips at its limit, in parallel
    soft = hardening * stiffness
    limit = (1.0 - hardening) * strength
    slipped = hysteretic_energy = 0.0
    for drift, force in path:
        yield_drift = limit / (stiffness - soft)
        slip = max(abs(drift - slipped) - yield_drift, 0.0)
        slipped += np.copysign(slip, drift - slipped)
        hysteretic_energy += limit * slip
        assert force == pytest.approx(soft * drift + (stiffness - soft) * (drift - slipped))
    assert law_state[rows.DISSIPATED] == pytest.approx(hysteretic_energy, rel=1e-12)


@pytest.mark.parametrize("p", [0.3, 0.5, P, 0.6])
def test_coefficients_are_consistent(p):
    """A constant acceleration is integrated exactly, as are displacement and velocity under an
    acceleration that is linear in time."""
    _, u_by_a0, u_by_ac, w_by_a0, w_by_ac, v_by_a0, v_by_ac, v_by_a1 = tableau(p)
    assert u_by_a0 + u_by_ac == pytest.approx(1.0 / 2.0, rel=1e-14)
    assert w_by_a0 + w_by_ac == pytest.approx(1.0, rel=1e-14)
    assert w_by_ac * p == pytest.approx(1.0 / 2.0, rel=1e-14)
    assert v_by_a0 + v_by_ac + v_by_a1 == pytest.approx(1.0, rel=1e-14)
    assert v_by_ac * p + v_by_a1 == pytest.approx(1.0 / 2.0, rel=1e-14)


def stability_limit(p):
    """Return the largest stable omega h of an oscillator u'' + omega^2 u = 0 with the step h.

    The step multiplies (u, h v) by a 2 x 2 matrix. Its trace T and determinant D are polynomials of
    y = (omega h)^2. Up to omega h of about 3.7, the eigenvalues are complex, with absolute values
    below 1. At the stability limit, an eigenvalue is 1. The result is therefore the square root of
    the smallest positive root y of 1 - T + D = 0. The method uses p = 0.54; other values were not
    tested.
    """
    _, u_by_a0, u_by_ac, _, _, v_by_a0, v_by_ac, v_by_a1 = tableau(p)
    y = Polynomial([0.0, 1.0])
    # h^2 times an acceleration is -y times the displacement. Factors of u0 and of h v0 in uc, u1
    # and h v1
    uc = (1.0 - 0.5 * p * p * y, Polynomial([p]))
    u1 = (1.0 - y * (u_by_a0 + u_by_ac * uc[0]), 1.0 - y * u_by_ac * uc[1])
    v1 = (
        -y * (v_by_a0 + v_by_ac * uc[0] + v_by_a1 * u1[0]),
        1.0 - y * (v_by_ac * uc[1] + v_by_a1 * u1[1]),
    )
    trace = u1[0] + v1[1]
    determinant = u1[0] * v1[1] - u1[1] * v1[0]
    # The root y = 0, a step of zero length, is divided out.
    roots = Polynomial((1.0 - trace + determinant).coef[1:]).roots()
    positive = np.real(roots)[(np.abs(np.imag(roots)) < 1e-9) & (np.real(roots) > 0.0)]
    return math.sqrt(np.min(positive))


def test_stability_limit_is_limit_of_spectral_radius_one():
    assert parse("noh-bathe").stability_limit == pytest.approx(stability_limit(P), rel=1e-12)
    assert stability_limit(P) == pytest.approx(3.745, abs=5e-4)
    limits = [critical_step(parse("noh-bathe"), damping) for damping in (0.0, 0.02, 0.05, 0.2)]
    assert limits == pytest.approx([stability_limit(P), 3.546, 3.268, 2.221], rel=2e-4)
