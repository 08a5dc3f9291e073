"""Tests of Chang, CR and KR-alpha: the compiled steps agree with the published equations with dense
matrices."""

import math

import numpy as np
import pytest

from building_cases import Law, model, noise, story
from step_checks import RAYLEIGH, building, load, matrices, restoring_of
from tdint.methods.catalogue import parse
from tdint.response.runs.measured_stability import amplification
from tdint.response.runs.outcome import FailedRun
from tdint.response.runs.run import run

KR = ("kr-alpha:rho_inf=1", "kr-alpha", "kr-alpha:rho_inf=0.5", "kr-alpha:rho_inf=0")
METHODS = ("chang", "cr", *KR)


def chang(M, C, K, h):
    """Return the method of Chang (2002) as (step, start, report) for dense matrices; `restoring` is
    a function of u."""
    D = M + h / 2.0 * C + h**2 / 4.0 * K
    E = M + h / 2.0 * C

    def step(restoring, u, v, a, p0, p1):
        new = u + np.linalg.solve(D, E @ (h * v) + h**2 / 2.0 * M @ a)
        b = np.linalg.solve(E, p1 - C @ (v + h / 2.0 * a) - restoring(new))
        return new, v + h / 2.0 * (a + b), b

    def start(restoring, u, v, p0):
        return u, v, np.linalg.solve(M, p0 - C @ v - restoring(u))

    return step, start, lambda u, v, a: v


def cr(M, C, K, h):
    """Return the method of Chen and Ricles (2008), which starts and reports half a step away, where
    its velocity is defined."""
    A = M + h / 2.0 * C + h**2 / 4.0 * K

    def step(restoring, u, w, a, p0, p1):
        q = np.linalg.solve(A, M @ a)
        new_w = w + h * q
        new = u + h * w + h**2 * q
        return new, new_w, np.linalg.solve(M, p1 - C @ new_w - restoring(new))

    return step, *shift(M, C, K, h, A, 0.5, 0.25)


def kr_alpha(rho, M, C, K, h):
    """Return the method of Kolay and Ricles (2014), which starts and reports gamma h away."""
    am, af = (2.0 * rho - 1.0) / (1.0 + rho), rho / (1.0 + rho)
    gamma = 0.5 - am + af
    beta = 0.25 * (0.5 + gamma) ** 2
    X = gamma * h * C + beta * h**2 * K
    A = M + X
    B = (1.0 - am) * M + (1.0 - af) * X

    def step(restoring, u, w, a, p0, p1):
        q = np.linalg.solve(A, M @ a)
        new_w = w + h * q
        new = u + h * w + (0.5 + gamma) * h**2 * q
        f = (1.0 - af) * (p1 - C @ new_w - restoring(new)) + af * (p0 - C @ w - restoring(u))
        return new, new_w, np.linalg.solve(B, A @ np.linalg.solve(M, f) - (am * M + af * X) @ a)

    return step, *shift(M, C, K, h, A, gamma, beta)


def shift(M, C, K, h, A, gamma, beta):
    """Start with w0 = v0 - gamma h A^-1 M a0, where a0 is in equilibrium for this w0, and report w
    + gamma h A^-1 M a."""

    def start(restoring, u, v, p0):
        # A q = M a0 = p0 - C (v - gamma h q) - f(u)
        q = np.linalg.solve(M + beta * h**2 * K, p0 - C @ v - restoring(u))
        return u, v - gamma * h * q, np.linalg.solve(M, A @ q)

    return start, lambda u, w, a: w + gamma * h * np.linalg.solve(A, M @ a)


def published(method, M, C, K, h):
    integrator = parse(method)
    if integrator.method.name == "kr-alpha":
        return kr_alpha(*integrator.values, M, C, K, h)
    return {"chang": chang, "cr": cr}[method](M, C, K, h)


def scalars(*values):
    return [np.full((1, 1), value) for value in values]


@pytest.mark.parametrize("nonlinear", [False, True], ids=["linear", "cubic"])
@pytest.mark.parametrize("method", METHODS)
def test_building_agrees_with_published_formulas(method, nonlinear):
    """Four stories have P-delta, a dashpot, Rayleigh damping, a floor force, ground motion and an
    initial deflection.

    The reference of KR-alpha and CR stores its own lagging velocity, which tdint does not compute.
    """
    case, record = building(RAYLEIGH, nonlinear=nonlinear), noise(samples=201)
    history = run(case, record, method=method, history=True).history
    M, C, K = matrices(case)
    restoring, _ = restoring_of(case, nonlinear)
    h = record.dt
    step, start, report = published(method, M, C, K, h)
    loads = [load(case, record, s * h) for s in range(201)]
    motion = start(
        restoring, np.array(case.initial.displacement), np.array(case.initial.velocity), loads[0]
    )
    u, v = [motion[0]], [report(*motion)]
    for s in range(200):
        motion = step(restoring, *motion, loads[s], loads[s + 1])
        u.append(motion[0])
        v.append(report(*motion))
    np.testing.assert_allclose(history.displacement, u, rtol=0.0, atol=1e-10 * np.max(np.abs(u)))
    np.testing.assert_allclose(history.velocity, v, rtol=0.0, atol=1e-10 * np.max(np.abs(v)))


@pytest.mark.parametrize("rho_inf", [1.0, 0.8, 0.5, 0.0])
def test_kr_alpha_equals_transformed_generalized_alpha(rho_inf):
    h, omega, xi = 0.02, np.array([0.5, 15.0, 100.0, 500.0]), np.full(4, 0.05)
    integrator = parse(f"kr-alpha:rho_inf={rho_inf}")
    beta = integrator.coefficients(None, None, h)[2]
    change = np.eye(3)
    change[0, 2] = beta * h**2
    got = change @ amplification(integrator, omega, xi, h) @ np.linalg.inv(change)
    want = amplification(parse(f"generalized-alpha:rho_inf={rho_inf}"), omega, xi, h)
    scale = h ** np.arange(3)
    np.testing.assert_allclose((got - want) * scale[:, None] / scale, 0.0, atol=1e-12)


def grows(method, omega_h, tangent, steps=4000):
    """Return True if the free vibration of an oscillator grows if its tangent differs from the
    initial stiffness of the law.

    Only the displacement counts. For such a tangent, the velocities of chang are far too large at
    omega dt = 100, so that `run` reports divergence unless unstable steps are allowed; but they do
    not grow.
    """
    h = 0.01
    k = (omega_h / h) ** 2
    case = model([story(1.0, k, Law("polynomial", (tangent * k,)))], displacement=(1e-3,))
    try:
        response = run(
            case, method=method, dt=h, duration=steps * h, allow_unstable=True, check=False
        )
    except FailedRun:
        return True
    return bool(response.stories.peak_displacement[0] > 1.0)


@pytest.mark.parametrize(
    ("method", "limit"),
    [
        ("chang", math.sqrt(8.0)),
        ("cr", math.sqrt(8.0)),
        ("kr-alpha:rho_inf=1", math.sqrt(8.0)),
        ("kr-alpha:rho_inf=0", math.sqrt(24.0)),
    ],
)
def test_stability_limit_for_tangent_of_one_and_a_half_initial_stiffness(method, limit):
    assert not grows(method, 0.99 * limit, 1.5)
    assert grows(method, 1.01 * limit, 1.5)


@pytest.mark.parametrize("rho_inf", [0.8, 0.5])
@pytest.mark.parametrize("omega_h", [0.3, 1.0, 3.0])
def test_stiffening_has_no_stable_step_for_intermediate_rho_inf(rho_inf, omega_h):
    assert grows(f"kr-alpha:rho_inf={rho_inf}", omega_h, 1.5, steps=400_000)


@pytest.mark.parametrize("tangent", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("method", METHODS)
def test_softening_is_stable(method, tangent):
    assert not any(grows(method, omega_h, tangent) for omega_h in (0.1, 1.0, 10.0, 100.0))


def published_kr_alpha(rho_inf, dt, steps):
    """Displacements of an undamped oscillator (T = 2 s, released at 1 m) by the equations of Kolay
    and Ricles (2014), which start with the velocity of the oscillator."""
    alpha_m, alpha_f = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0), rho_inf / (rho_inf + 1.0)
    gamma = 0.5 - alpha_m + alpha_f
    beta = 0.25 * (0.5 + gamma) ** 2
    k = math.pi**2
    alpha_1 = 1.0 / (1.0 + beta * dt**2 * k)
    alpha_2 = (0.5 + gamma) * alpha_1
    alpha_3 = (alpha_m + alpha_f * beta * dt**2 * k) * alpha_1
    u, v, a = 1.0, 0.0, -k
    displacements = [u]
    for _ in range(steps):
        u_1, v = u + dt * v + dt**2 * alpha_2 * a, v + dt * alpha_1 * a
        force = k * ((1.0 - alpha_f) * u_1 + alpha_f * u)
        a = (-force - alpha_3 * a) / (1.0 - alpha_3)
        u = u_1
        displacements.append(u)
    return np.array(displacements)


@pytest.mark.parametrize(
    ("rho_inf", "published", "ours"), [(1, 1.0108, 0.9948), (0.5, 1.0207, 0.9809)]
)
def test_start_of_kr_alpha_differs_from_its_publication(rho_inf, published, ours):
    """The published start has order 1, the start of tdint order 2."""
    errors = []
    for dt in (0.1, 0.05, 0.025, 0.0125):
        steps = round(4.0 / dt)
        building = model([story(1.0, math.pi**2)], displacement=[1.0])
        response = run(
            building,
            method=f"kr-alpha:rho_inf={rho_inf}",
            dt=dt,
            duration=4.0,
            check=False,
            history=True,
        )
        pair = published_kr_alpha(rho_inf, dt, steps), response.history.displacement[:, 0]
        exact = np.cos(math.pi * dt * np.arange(steps + 1))
        errors.append([np.max(np.abs(values - exact)) for values in pair])
        if dt == 0.1:
            ends = [values[-1] for values in pair]
            assert ends == pytest.approx([published, ours], abs=5e-5)
    ratios = [coarse / fine for coarse, fine in zip(*errors[-2:], strict=True)]
    assert ratios == pytest.approx([2.0, 4.0], rel=0.1)
