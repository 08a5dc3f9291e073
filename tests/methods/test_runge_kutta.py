"""The Runge-Kutta methods: the compiled steps against their stability functions and dense
formulas."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import tdint
from building_cases import Law, noise
from el_centro import el_centro
from step_checks import RAYLEIGH, SingleSteps, building, load, matrices, restoring_of
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.methods.runge_kutta import DORMAND_PRINCE
from tdint.response.runs.measured_stability import amplification
from tdint.response.runs.run import run

METHODS = ("rk5", "gauss4")

# Dormand and Prince (1980), table 2
DP_A = [
    [],
    ["1/5"],
    ["3/40", "9/40"],
    ["44/45", "-56/15", "32/9"],
    ["19372/6561", "-25360/2187", "64448/6561", "-212/729"],
    ["9017/3168", "-355/33", "46732/5247", "49/176", "-5103/18656"],
]
DP_B = ["35/384", "0", "500/1113", "125/192", "-2187/6784", "11/84"]
DP_C = ["0", "1/5", "3/10", "4/5", "8/9", "1"]

GAUSS_A = np.array([[0.25, 0.25 - math.sqrt(3.0) / 6.0], [0.25 + math.sqrt(3.0) / 6.0, 0.25]])
GAUSS_C = np.array([0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0])


def stability_function(method, Z):
    """R(Z) of a matrix: the polynomial of Dormand and Prince, the Pade approximation (2,2)."""
    identity = np.eye(len(Z))
    if method != "rk5":
        even = identity + Z @ Z / 12.0
        return np.linalg.solve(even - Z / 2.0, even + Z / 2.0)
    total, power = identity, identity
    for divisor in (1.0, 2.0, 6.0, 24.0, 120.0, 600.0):
        power = power @ Z
        total = total + power / divisor
    return total


@pytest.mark.parametrize("xi", [0.0, 0.05, 0.7])
@pytest.mark.parametrize("method", [*METHODS, "impulse", "impulse4", "moment4"])
def test_amplification_matrix_equals_stability_function(method, xi):
    """Also at and near sqrt(12), where the printed formulas of the impulse method divide by
    zero."""
    around = math.sqrt(12.0) * (
        1.0 + np.array([0.0, 1e-15, -1e-15, 1e-12, 1e-9, -1e-9, 1e-6, 1e-3, -1e-3])
    )
    h, omega_h = 0.02, np.concatenate([around, np.geomspace(1e-3, 1e4, 30)])
    got = amplification(parse(method), omega_h / h, np.full(omega_h.size, xi), h)
    for w, matrix in zip(omega_h, got, strict=True):
        balanced = matrix * np.array([[1.0, 1.0 / h], [h, 1.0]])
        want = stability_function(method, np.array([[0.0, 1.0], [-(w**2), -2.0 * xi * w]]))
        np.testing.assert_allclose(balanced, want, rtol=1e-10, atol=1e-10 * np.max(np.abs(want)))


def dormand_prince_step(rate, h, t, x):
    slopes = []
    for row, c in zip(DP_A, DP_C, strict=True):
        total = sum(
            (float(Fraction(a)) * k for a, k in zip(row, slopes, strict=True)), np.zeros(x.size)
        )
        slopes.append(rate(t + float(Fraction(c)) * h, x + h * total))
    return x + h * sum(float(Fraction(b)) * k for b, k in zip(DP_B, slopes, strict=True))


def gauss_step(rate, jacobian, h, t, x):
    """Two-stage Gauss on x' = rate(t, x): Newton on both slopes."""
    slopes = np.tile(rate(t, x), (2, 1))
    for _ in range(8):
        points = x + h * GAUSS_A @ slopes
        wrong = np.concatenate(
            [
                k - rate(t + c * h, point)
                for k, c, point in zip(slopes, GAUSS_C, points, strict=True)
            ]
        )
        blocks = [
            [np.eye(x.size) * (i == j) - h * GAUSS_A[i, j] * jacobian(points[i]) for j in (0, 1)]
            for i in (0, 1)
        ]
        slopes = slopes - np.linalg.solve(np.block(blocks), wrong).reshape(2, -1)
    return x + h / 2.0 * slopes.sum(axis=0)


@pytest.mark.parametrize("nonlinear", [False, True], ids=["linear", "cubic"])
@pytest.mark.parametrize("method", METHODS)
def test_building_agrees_with_formulas(method, nonlinear):
    """Four stories with P-delta, a dashpot, Rayleigh damping, a floor force and ground motion, from
    a deflected start: ground acceleration linear in between, the force at the time of each
    stage."""
    case, record = building(RAYLEIGH, nonlinear=nonlinear), noise(samples=41)
    history = run(case, record, method=method, history=True).history
    M, C, _ = matrices(case)
    f, tangent = restoring_of(case, nonlinear)

    def rate(t, x):
        return np.concatenate(
            [x[4:], np.linalg.solve(M, load(case, record, t) - C @ x[4:] - f(x[:4]))]
        )

    def jacobian(x):
        upper = np.hstack([np.zeros((4, 4)), np.eye(4)])
        return np.vstack([upper, -np.linalg.solve(M, np.hstack([tangent(x[:4]), C]))])

    h = record.dt
    x = [np.concatenate([case.initial.displacement, case.initial.velocity])]
    for s in range(40):
        if method == "rk5":
            x.append(dormand_prince_step(rate, h, s * h, x[-1]))
        else:
            x.append(gauss_step(rate, jacobian, h, s * h, x[-1]))
    x = np.array(x)
    # With a curved law, gauss4 solves its equations exactly in the first two steps, then with a
    # residual that is small compared with the error of the step.
    limits = ((3, 1e-10), (41, 1e-5)) if method == "gauss4" and nonlinear else ((41, 1e-10),)
    for count, limit in limits:
        for found, expected in ((history.displacement, x[:, :4]), (history.velocity, x[:, 4:])):
            difference = np.max(np.abs(found[:count] - expected[:count]))
            assert difference <= limit * np.max(np.abs(expected))


def test_one_correction_per_step_is_sufficient_for_a_curved_law():
    """Four stories with cubic hardening: gauss4 is of order 4, although most steps have a single
    correction, because the tolerance of the residuals decreases with the error."""
    case, record = building(RAYLEIGH, nonlinear=True), noise(samples=41)
    case = replace(case, excitation=replace(case.excitation, forces=()))
    end = [
        run(case, record, method="gauss4", dt=record.dt / parts, history=True)
        for parts in (32, 16, 8, 4)
    ]
    exact = end[0].history.displacement[-1]
    errors = [np.max(np.abs(one.history.displacement[-1] - exact)) for one in end[1:]]
    assert errors[1] > 12.0 * errors[0] and errors[2] > 12.0 * errors[1]
    assert all(one.iterations <= 1.3 * one.steps for one in end[1:])


def imaginary_stability_limit(table):
    """Return the largest stable omega h of an explicit method without damping.

    omega is the circular frequency of an undamped oscillator and h the time step. The free
    vibration of the oscillator is a sum of solutions of x' = i omega x and x' = -i omega x. In each
    step, the method multiplies x by R(i omega h), with the stability polynomial

        R(z) = 1 + b e z + b A e z^2 + b A^2 e z^3 + ... + b A^(s - 1) e z^s

    A is the Butcher matrix, b the row of the weights, e a column vector with all elements equal to
    1, and s the number of stages. The step is stable if |R(i omega h)| <= 1. The limit is the
    smallest positive root omega h of |R(i omega h)|^2 = 1: 0 if |R| exceeds 1 for arbitrarily small
    steps, inf if there is no root. `table` is the argument of `explicit_coefficients`.
    """
    stages = len(table)
    matrix = np.zeros((stages, stages))
    for i, row in enumerate(table[:-1], start=1):
        matrix[i, :i] = row
    power = np.ones(stages)  # A^k e, with k = 0 at first
    polynomial = [1.0]  # coefficients of R, lowest power first
    for _ in range(stages):
        polynomial.append(float(np.dot(table[-1], power)))
        power = matrix @ power
    # With y = (omega h)^2, the even powers of z = i omega h are 1, -y, y^2, ... They give the real
    # part of R, a polynomial in y. The odd powers are i omega h times the even powers, so that
    # |R|^2 = real^2 + y imaginary^2.
    real = Polynomial([(-1.0) ** k * value for k, value in enumerate(polynomial[0::2])])
    imaginary = Polynomial([(-1.0) ** k * value for k, value in enumerate(polynomial[1::2])])
    growth = real**2 + Polynomial([0.0, 1.0]) * imaginary**2 - 1.0  # |R|^2 - 1
    # The low powers of y vanish up to the order of the method, except for rounding errors. The sign
    # of the first coefficient that does not vanish decides whether small steps are stable. The
    # tolerance 1e-12 is suitable for rk5, the only explicit method in this module: its first
    # coefficient is -5.6e-4.
    first_power = int(np.argmax(np.abs(growth.coef) > 1e-12))
    if growth.coef[first_power] > 0.0:
        return 0.0
    roots = np.asarray(Polynomial(growth.coef[first_power:]).roots(), dtype=np.complex128)
    # 1e-9 covers the rounding errors of real roots.
    limits = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)]
    return math.sqrt(np.min(limits, initial=math.inf))


@pytest.mark.parametrize(
    ("table", "limit"),
    [
        (((1.0,),), 0.0),  # Euler
        (((0.5,), (0.0, 1.0)), 0.0),  # midpoint
        (((1 / 3,), (0.0, 2 / 3), (0.25, 0.0, 0.75)), math.sqrt(3.0)),  # Heun, order 3
        (
            ((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
            math.sqrt(8.0),
        ),  # Kutta, order 4
    ],
)
def test_stability_limit_on_imaginary_axis(table, limit):
    assert imaginary_stability_limit(table) == pytest.approx(limit, abs=1e-9)


def test_stability_limit_of_rk5_is_that_of_its_table():
    limit = imaginary_stability_limit(DORMAND_PRINCE)
    assert parse("rk5").stability_limit == pytest.approx(limit, rel=1e-12)


@pytest.mark.parametrize(
    ("method", "inner"), [("rk5", ()), ("gauss4", (rows.FIRST_TRIAL, rows.SECOND_TRIAL))]
)
def test_path_of_hysteretic_story_through_stages(method, inner):
    """gauss4 loads a story from the start of the step through both stages to its end, rk5 straight
    to the end."""
    stiffness, strength, hardening = 100.0, 5.0, 0.1
    soft = 1.0 - hardening
    steps = SingleSteps(method, Law("bilinear", (strength, hardening)))

    def internal(z, d, drift):
        return np.clip(z + soft * stiffness * (drift - d), -soft * strength, soft * strength)

    z, d = np.zeros(2), np.zeros(2)
    taken = turned = 0
    for ground in np.random.default_rng(3).uniform(-40.0, 40.0, (40, 2)):
        if steps.take(*ground) == rows.NOT_CONVERGED:  # far beyond the usual range: omega h is 16
            continue
        law_state = steps.space.law_state[:, :2]
        straight = internal(z, d, law_state[rows.DRIFT])
        for block in (*inner, rows.COMMITTED):
            drift = law_state[block + rows.DRIFT].copy()
            z, d = internal(z, d, drift), drift
        np.testing.assert_allclose(law_state[rows.INTERNAL], z, rtol=0.0, atol=1e-9 * strength)
        np.testing.assert_allclose(
            law_state[rows.FORCE], hardening * stiffness * d + z, rtol=1e-9, atol=1e-9 * strength
        )
        taken += 1
        turned += bool(np.any(np.abs(straight - z) > 0.1))
    assert taken > 20
    assert (turned > 0) == bool(inner)


@pytest.mark.parametrize(
    ("method", "least", "most"), [("gauss4", 0.7, 2.5), ("impulse4", 3.5, 4.5)]
)
def test_order_of_the_peak_drift_of_a_bilinear_story(method, least, most):
    """Kinks inside the steps reduce the order of Gauss's method; `impulse4` locates them."""
    story = {"mass": 1e5, "stiffness": 4e6, "law": {"type": "bilinear", "yield_force": 1.5e5}}
    story["law"]["hardening"] = 0.05
    more = {"damping": {"rayleigh": {"mass": 1.0, "stiffness": 0.0}}}
    model = tdint.load_model({"stories": [story], **more})
    record = el_centro(duration=6.0, scale=1.0)

    def peak(spec, dt):
        return tdint.run(model, record, method=spec, dt=dt, duration=6.0).stories.peak_drift[0]

    exact = peak("impulse4", 0.02 / 64)
    first, last = (abs(peak(method, dt) - exact) for dt in (0.02, 0.0025))
    assert least < np.log2(first / last) / 3.0 < most
