"""Parts of the bilinear oscillator, compared with the matrix exponential and polynomials."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from exact_oscillators import transition
from tdint.kernels.oscillators import bilinear


def state(**values):
    found = np.zeros(bilinear.STATE_ROWS)
    for name, value in values.items():
        found[getattr(bilinear, name)] = value
    return found


@pytest.mark.parametrize(("k", "c"), [(0.0, 0.0), (400.0, 0.0), (900.0, 12.0), (0.0, 30.0)])
def test_series_agrees_with_linear_oscillator(k, c):
    """Under a load that is linear in time, up to the longest step, omega h = 1."""
    h = 1.0 / 30.0
    series = np.zeros(bilinear._MAX_TERMS)
    for u, v, load, slope in np.random.default_rng(1).normal(size=(20, 4)) * [1.0, 30.0, 9e2, 3e4]:
        count = bilinear._taylor(series, u, v, load, slope, k, c, h)
        a, b = transition(k, c, h)
        expected = a @ [u, v] + b @ [load, load + slope * h]
        found = [bilinear._derivative(series, count, order, h) for order in range(3)]
        assert found[:2] == pytest.approx(expected, rel=1e-12, abs=1e-13)
        acceleration = load + slope * h - c * expected[1] - k * expected[0]
        assert found[2] == pytest.approx(acceleration, rel=1e-11, abs=1e-9)
        # The series ends after the first two negligible terms in succession.
        size = np.abs(series) * h ** np.arange(series.size)
        negligible = size[:count] <= 1e-18 * np.max(size[:4])
        assert count == series.size or (negligible[-1] and negligible[-2])
        assert not np.any(negligible[4:-2] & negligible[5:-1])


def test_recursion_of_branch_agrees_with_matrix_exponential():
    for k, c in ((0.0, 3.0), (900.0, 12.0)):
        steps = np.full(20, np.nan)
        bilinear._coefficients(steps, 3, np.zeros(bilinear._MAX_TERMS), k, c, 0.03)
        a, b = transition(k, c, 0.03)
        expected = np.hstack([a, -b])
        assert steps[3:7] == pytest.approx(expected[0], rel=1e-12)
        assert steps[7:11] == pytest.approx(expected[1], rel=1e-12)
        assert np.isnan(steps[2]) and np.isnan(steps[11])


def test_values_and_crossings_of_a_series():
    random = np.random.default_rng(2)
    crossed = 0
    for _ in range(100):
        series = random.normal(size=6)
        polynomial = Polynomial(series[:5])
        for order in range(3):
            derivative = polynomial.deriv(order) if order else polynomial
            for t in (0.0, 0.4, 1.3):
                found = bilinear._derivative(series, 5, order, t)
                assert found == pytest.approx(derivative(t), rel=1e-12, abs=1e-12)
            left, right = np.sort(random.uniform(0.0, 2.0, 2))
            level = random.normal()
            at = derivative(np.array([left, right])) - level
            found = bilinear._root(series, 5, order, level, left, right)
            if at[0] * at[1] > 0.0:
                assert found == left
            else:
                crossed += 1
                roots = (derivative - level).roots()
                real = roots[np.abs(roots.imag) < 1e-9].real
                inside = real[(real > left) & (real < right)]
                assert np.min(np.abs(inside - found)) < 1e-12
    assert crossed > 30
    # On a line, the first iteration is exact.
    assert bilinear._root(np.array([1.0, -2.0]), 2, 0, 0.0, 0.0, 4.0) == 0.5
    # Ends on the same side, or at the level
    assert bilinear._root(np.array([0.0, 1.0]), 2, 0, 0.0, 1.0, 2.0) == 1.0
    assert bilinear._root(np.array([0.0, -1.0]), 2, 0, -2.0, 1.0, 2.0) == pytest.approx(2.0)


def test_crossing_is_next_to_event():
    """The result is on the side of the crossing that was computed last, within rounding."""
    random = np.random.default_rng(3)
    for _ in range(50):
        series = np.array([-random.uniform(), random.uniform(), random.uniform(), 8.0])
        t = bilinear._root(series, 4, 0, 0.0, 0.0, 1.0)
        assert abs(Polynomial(series)(t)) < 3e-15


def test_end_of_yielding_is_found():
    """The velocity side (t - first) (t - second), monotonic on both sides of their mean."""
    for side in (1.0, -1.0):
        for first, second, expected in (
            (0.2, 0.6, 0.2),  # opposite from 0.2 to 0.6
            (-0.3, 0.5, 0.0),  # opposite at the start
            (0.5, 1.7, 0.5),
            (0.0, 0.6, 0.0),
        ):
            rate = side * Polynomial.fromroots([first, second])
            series = rate.integ().coef
            middle = min(max(0.5 * (first + second), 0.0), 1.0)
            found = bilinear._end_of_yielding(series, 4, side, middle, 1.0)
            assert found == pytest.approx(expected, abs=1e-14)
        # Minus the same velocity is opposite only after the second zero.
        rate = -side * Polynomial.fromroots([-0.4, 0.8])
        found = bilinear._end_of_yielding(rate.integ().coef, 4, side, 0.2, 1.0)
        assert found == pytest.approx(0.8, abs=1e-14)
        rate = side * Polynomial.fromroots([-0.4, -0.1])
        assert bilinear._end_of_yielding(rate.integ().coef, 4, side, 0.5, 1.0) == bilinear.NEVER
        # A velocity that becomes zero only at the end is not opposite.
        rate = -side * Polynomial.fromroots([-0.4, 1.0])
        assert bilinear._end_of_yielding(rate.integ().coef, 4, side, 0.3, 1.0) == bilinear.NEVER


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_end_of_elastic_branch_is_found(sign):
    """The displacement has a maximum at 0.25 and a minimum at 0.85, below its start."""
    u = 16.0 * Polynomial.fromroots([0.25, 0.85]).integ() + 0.2
    high, low = float(u(0.25)), float(u(0.85))
    between = 0.5 * (low + 0.2)
    times = np.linspace(0.0, 0.95, 95_001)
    for upper, lower in (
        (0.5 * (0.2 + high), -9.0),  # crossed before the maximum
        (high, low),  # reached, but not crossed
        (high + 0.01, between),  # crossed between both extrema
        (9.0, float(u(0.8))),
        (9.0, low - 1e-6),
    ):
        limits = sorted((sign * upper, sign * lower))
        oscillator_state = state(UPPER=limits[1] + 1e-15, LOWER=limits[0] - 1e-15)
        found = bilinear._end_of_elastic_branch(sign * u.coef, 4, oscillator_state, 0.55, 0.95)
        outside = (u(times) > upper + 1e-12) | (u(times) < lower - 1e-12)
        first = int(np.argmax(outside))
        reached = high
        if not np.any(outside):
            assert found == bilinear.NEVER
            reached = max(high, -low)
        else:
            assert found == pytest.approx(times[first], abs=2e-5)
            reached = 0.0 if times[first] < 0.25 else high
        assert oscillator_state[bilinear.PEAK] == pytest.approx(reached, rel=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_states_at_changes_of_branch(side):
    k, hardening, strength = 50.0, 0.2, 3.0
    oscillator = bilinear._Hysteretic(k, 0.0, hardening, strength)
    oscillator_state = state(U=0.7, V=0.1, SIDE=side)
    bilinear._end_yielding(oscillator_state, oscillator)
    yield_displacement = strength / ((1.0 - hardening) * k)
    other = 0.7 - 2.0 * side * yield_displacement
    assert oscillator_state[[bilinear.SIDE, bilinear.V]].tolist() == [0.0, 0.0]
    assert oscillator_state[bilinear.UPPER] == pytest.approx(max(0.7, other), rel=1e-12)
    assert oscillator_state[bilinear.LOWER] == pytest.approx(min(0.7, other), rel=1e-12)
    # The plastic part of the force is +- strength at both limits.
    for u, expected in ((0.7, side * strength), (other, -side * strength)):
        assert oscillator_state[bilinear.OFFSET] + (1.0 - hardening) * k * u == pytest.approx(
            expected
        )
    for rate in (2.0, -2.0):
        two = state(U=0.5 + side * 0.9, V=rate, UPPER=1.5, LOWER=-0.5)
        bilinear._start_yielding(two, strength)
        expected = (1.5 if side > 0.0 else -0.5, rate if rate * side > 0.0 else 0.0)
        assert two[[bilinear.U, bilinear.V]].tolist() == list(expected)
        assert two[[bilinear.SIDE, bilinear.OFFSET]].tolist() == [side, side * strength]


def response(ground, parts, h, oscillator, limit, shortcuts):
    """Integrate over a ground motion; without shortcuts, each step is searched for events."""
    series, found = np.zeros(bilinear._MAX_TERMS), state(UPPER=limit, LOWER=-limit)
    if shortcuts:
        steps = np.zeros(16)
        k, c, hardening, _ = oscillator
        bilinear._coefficients(steps, 0, series, k, c, h)
        bilinear._coefficients(steps, 8, series, hardening * k, c, h)
        count = bilinear._integrate_motion(ground, parts, h, oscillator, steps, series, found)
        return found, count
    count = 0
    for i in range(ground.size - 1):
        rise = (ground[i + 1] - ground[i]) / parts
        for j in range(parts):
            count += bilinear._integrate_step(
                found, series, oscillator, ground[i] + j * rise, rise / h, h
            )
    return found, count


@pytest.mark.parametrize("seed", range(8))
def test_steps_without_events_agree_with_steps_that_are_searched(seed):
    """In a record of 60 samples with several changes of branch."""
    random = np.random.default_rng(seed)
    parts = 1 + seed % 3
    dt = 0.02
    omega = random.uniform(0.2, 1.0) * parts / dt
    xi, hardening = random.choice([0.0, 0.05]), random.choice([0.0, 0.1])
    ground = random.normal(size=60) * np.linspace(0.5, 2.0, 60)
    ground[40:45] = 0.0
    limit = random.choice([0.3, 1.0]) / omega**2
    strength = (1.0 - hardening) * omega**2 * limit
    oscillator = bilinear._Hysteretic(omega**2, 2.0 * xi * omega, hardening, strength)
    found, count = response(ground, parts, dt / parts, oscillator, limit, True)
    expected, events = response(ground, parts, dt / parts, oscillator, limit, False)
    assert count == events > 2
    scale = [limit, omega * limit, 1.0, omega**2 * limit, limit, limit, limit]
    order = ("U", "V", "SIDE", "OFFSET", "UPPER", "LOWER", "PEAK")
    for name, size in zip(order, scale, strict=True):
        row = getattr(bilinear, name)
        assert found[row] == pytest.approx(expected[row], rel=1e-9, abs=1e-8 * size), name


def test_residual_displacement_is_computed():
    """Within the branch it is the center of the free vibration. A larger vibration first yields
    and dissipates energy, until it remains within the branch."""
    k, strength = 100.0, 5.0
    oscillator = bilinear._Hysteretic(k, 0.0, 0.0, strength)
    series = np.zeros(bilinear._MAX_TERMS)
    limits = {"UPPER": 0.25 + 0.05, "LOWER": 0.25 - 0.05}
    offset = -k * 0.25
    for u, v in ((0.25 + 0.03, 0.04 * 10.0), (0.25, -0.0499 * 10.0), (0.25 - 0.05, 0.0)):
        oscillator_state = state(U=u, V=v, OFFSET=offset, **limits)
        found = bilinear._vibrate_freely(oscillator_state, series, oscillator)
        assert found == pytest.approx(0.25, rel=1e-12)
    # A vibration that exceeds the limit by 1 % of a small range yields.
    small = {"UPPER": 0.25 + 1e-4, "LOWER": 0.25 - 1e-4}
    tiny = bilinear._Hysteretic(k, 0.0, 0.0, k * 1e-4)
    oscillator_state = state(U=0.25, V=1.01e-4 * 10.0, OFFSET=offset, **small)
    found = bilinear._vibrate_freely(oscillator_state, series, tiny)
    # Beyond the limit, the energy (1.01^2 - 1) k 1e-8 / 2 is dissipated by the strength k 1e-4.
    assert found - 0.25 == pytest.approx(0.5e-4 * (1.01**2 - 1.0), rel=1e-6)
    # The energy beyond the limit is dissipated while yielding by (v^2 / 2) / strength.
    for direction in (1.0, -1.0):
        u, v = 0.25 + direction * 0.05, direction * 0.4
        oscillator_state = state(U=u, V=v, OFFSET=offset, **limits)
        found = bilinear._vibrate_freely(oscillator_state, series, oscillator)
        expected = 0.25 + direction * 0.5 * 0.4**2 / strength
        assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("center", [0.25, -0.25])
@pytest.mark.parametrize("v", [0.4, -0.4])
@pytest.mark.parametrize("x", [0.0, 0.01, -0.01])
def test_peak_of_a_vibration_to_rest_is_on_the_side_of_its_center(center, v, x):
    """The extrema on both sides of the center count: also the second one, if it is the largest."""
    k, c = 100.0, 2.0
    limits = {"UPPER": center + 0.1, "LOWER": center - 0.1}
    oscillator_state = state(U=center + x, V=v, OFFSET=-k * center, **limits)
    series = np.zeros(bilinear._MAX_TERMS)
    bilinear._vibrate_freely(oscillator_state, series, bilinear._Hysteretic(k, c, 0.0, 10.0))
    damped = math.sqrt(k - 0.25 * c**2)
    t = np.linspace(0.0, 2.0, 200_001)
    sine = (v + 0.5 * c * x) / damped * np.sin(damped * t)
    u = center + np.exp(-0.5 * c * t) * (x * np.cos(damped * t) + sine)
    assert oscillator_state[bilinear.PEAK] == pytest.approx(np.max(np.abs(u)), rel=1e-8)


@pytest.mark.parametrize("omega", [49.0, 51.0, 101.0])
def test_peak_of_elastic_oscillator_and_number_of_steps(omega):
    """With an infinite yield displacement, the peak is that of the exact recursion."""
    dt, ground = 0.02, np.random.default_rng(4).normal(size=40)
    results = np.full(bilinear.RESULTS, np.nan)
    count = bilinear.bilinear_response.compiled(ground, dt, omega, 0.03, 0.1, math.inf, results)
    assert count == 0
    fine = 60
    a, b = transition(omega**2, 0.06 * omega, dt / fine)
    # Until a period after the record, with the ground at rest
    count = 40 + math.ceil(2.0 * math.pi / omega / dt)
    times = np.arange(count * fine + 1) / fine
    samples = np.interp(times, np.arange(41), np.append(ground, 0.0))
    y, path = np.zeros(2), [0.0]
    for k in range(times.size - 1):
        y = a @ y - b @ samples[k : k + 2]
        path.append(y[0])
    assert results[bilinear.LARGEST] == pytest.approx(np.max(np.abs(path)), rel=1e-3)
    assert results[bilinear.LARGEST] >= np.max(np.abs(path)) * (1.0 - 1e-12)
    assert results[bilinear.RESIDUAL] == 0.0
