"""Kernels that integrate many oscillators together, compared with the matrix exponential.

The records are longer than two intervals of each kernel, so that the maximum is in the first, a
middle or the last interval, or in the remaining steps.
"""

import math

import numpy as np
import pytest
from scipy.interpolate import BPoly, PPoly
from scipy.linalg import expm

from exact_oscillators import largest, motion, recursion_table
from tdint.kernels.oscillators import between_steps, elastic, extremes, modal_sums, rotated
from tdint.kernels.oscillators.between_steps import (
    A11,
    A12,
    A21,
    A22,
    B10,
    B11,
    B20,
    B21,
    Vibration,
)

DT = 0.02
OMEGAS = (3.0, 14.0, 45.0)
RATIOS = (0.05, 0.0, 0.2)
FINE = 24


def record(seed, size, growth=0.0):
    """Return noise whose amplitude changes by the factor exp(growth) over the record."""
    noise = np.random.default_rng(seed).normal(size=size)
    return noise * np.exp(growth * np.linspace(0.0, 1.0, size))


QUIET = np.zeros(220)  # two periods of the slowest oscillator


def quiet(samples):
    """Return samples along the last axis until the ground is at rest, as for the kernels."""
    return np.concatenate([samples, 0.0 * samples[..., :1]], axis=-1)


def continued(samples):
    """Return samples followed by the time in which the largest free vibration occurs."""
    return np.append(samples, QUIET)


def linear_table(parts, columns):
    """Return a table of the oscillators; the columns after them repeat the first oscillator."""
    omegas = np.array([*OMEGAS, *[OMEGAS[0]] * (columns - 3)])
    ratios = np.array([*RATIOS, *[RATIOS[0]] * (columns - 3)])
    return recursion_table(
        elastic.COEFFICIENTS, lambda w, xi: (w**2, 2.0 * xi * w), omegas, ratios, DT / parts
    )


def elastic_peaks(samples, parts, between, lanes=2, columns=4):
    result = np.zeros((elastic.PEAKS, 3))
    elastic.peaks.compiled(
        samples, DT, parts, linear_table(parts, columns), lanes, between, result,
        *elastic.scratch(samples.size, parts, lanes),
    )  # fmt: skip
    return result


@pytest.mark.parametrize("growth", [-2.0, 0.0, 2.0])
@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("size", [2, 21, 75])
def test_peaks_of_linear_oscillators(size, parts, growth):
    samples = record(size, size, growth)
    between, at_steps = (elastic_peaks(quiet(samples), parts, flag) for flag in (1, 0))
    last = size * parts * FINE
    for i, (omega, xi) in enumerate(zip(OMEGAS, RATIOS, strict=True)):
        u, v, _ = motion(continued(samples), DT, omega, xi, parts * FINE)
        acceleration = omega**2 * u + 2.0 * xi * omega * v
        values = np.column_stack([u, v, acceleration])
        assert between[:, i] == pytest.approx(largest(values, FINE), rel=3e-5)
        until_end = np.abs(values[: last + 1 : FINE])
        assert at_steps[:, i] == pytest.approx(np.max(until_end, axis=0), rel=1e-9)


def similar_intervals(seed, steps, count):
    """Return a record that repeats a section of so many steps with slightly different amplitudes.
    The maxima of all intervals are then close to each other."""
    random = np.random.default_rng(seed)
    section = random.normal(size=steps)
    factors = random.uniform(0.985, 1.0, count)
    return np.concatenate([factor * section for factor in factors] + [[0.0]])


def test_no_interval_with_a_maximum_is_skipped():
    """The bounds of the intervals only avoid work: the result is equal to that of all intervals."""
    skipped = 0
    for seed in range(60):
        samples = similar_intervals(seed, elastic.INTERVAL_STEPS, 4)[:120]
        ground, starts, maxima, ground_maxima = elastic.scratch(samples.size, 1, 1)
        omega = 10.0 ** np.random.default_rng(seed).uniform(0.3, 1.65)
        table = recursion_table(
            elastic.COEFFICIENTS, lambda w, xi: (w**2, 2.0 * xi * w), [omega], [0.02], DT
        )
        result = np.zeros((elastic.PEAKS, 1))
        elastic.peaks.compiled(
            samples, DT, 1, table, 1, 1, result, ground, starts, maxima, ground_maxima
        )
        best = np.zeros(elastic.PEAKS)
        series = np.zeros((3, between_steps.TERMS))
        one = elastic._TableOscillator(ground, DT, table, 0, starts[0], 1, series, best)
        for interval in range(maxima.shape[1] + 1):
            end = elastic._integrate_interval(one, interval)
        elastic._vibrate_freely(one, *end)
        assert result[:, 0] == pytest.approx(best, rel=1e-12)
        integrated = np.zeros(elastic.PEAKS)
        elastic._integrate_interval(one._replace(best=integrated), int(np.argmax(maxima[0, :, 0])))
        skipped += bool(np.any(integrated < best * (1.0 - 1e-9)))
    assert skipped > 5


def test_derivatives_that_bound_the_maxima_between_steps(monkeypatch):
    """Value and first two derivatives of displacement, velocity and absolute acceleration (with the
    opposite sign) at both ends of each step, by the equation of motion."""
    bounds = []
    monkeypatch.setattr(elastic, "may_exceed", lambda *arguments: bounds.append(arguments[2:]))
    samples, omega, xi = record(3, elastic.INTERVAL_STEPS + 1), 30.0, 0.3
    ground, starts, _, _ = elastic.scratch(samples.size, 1, 1)
    ground[:] = samples
    table = recursion_table(
        elastic.COEFFICIENTS, lambda w, xi: (w**2, 2.0 * xi * w), [omega], [xi], DT
    )
    series, best = np.zeros((3, between_steps.TERMS)), np.zeros(elastic.PEAKS)
    starts[0, 0] = 0.01, -0.2
    one = elastic._TableOscillator(ground, DT, table, 0, starts[0], 1, series, best)
    elastic._integrate_interval(one, 0)
    assert len(bounds) == 3 * elastic.INTERVAL_STEPS
    for step in range(elastic.INTERVAL_STEPS):
        of_u, of_v, of_p = (np.reshape(one, (2, 3)) for one in bounds[3 * step : 3 * step + 3])
        slope = (samples[step + 1] - samples[step]) / DT
        for end in range(2):
            u, v, a = of_u[end]
            assert a == pytest.approx(-(omega**2) * u - 2 * xi * omega * v - samples[step + end])
            j = -(omega**2) * v - 2.0 * xi * omega * a - slope
            assert of_v[end] == pytest.approx([v, a, j], rel=1e-9)
            opposite = omega**2 * of_u[end] + 2.0 * xi * omega * of_v[end]
            assert of_p[end] == pytest.approx(opposite, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("size", [1.0, 30.0])
def test_a_sum_of_modes_is_at_most_the_sum_of_its_amplitudes(size):
    """The amplitude of a mode is sqrt(q^2 + 2 xi q q' / omega + (q' / omega)^2); the last column is
    the roof."""
    random = np.random.default_rng(9)
    modes = np.zeros((max(modal_sums.OMEGA, modal_sums.DAMPING) + 1, 3))
    omega, xi = random.uniform(1.0, 30.0, 3), random.uniform(0.0, 0.3, 3)
    modes[modal_sums.OMEGA], modes[modal_sums.DAMPING] = omega, xi
    shapes, q = random.normal(size=(3, 2)), size * random.normal(size=(1, 3))
    rate = size * omega * random.normal(size=(1, 3))
    scaled = rate / omega
    amplitudes = np.sqrt(q**2 + 2.0 * xi * q * scaled + scaled**2)[0]
    story, roof = amplitudes @ np.abs(shapes)
    for factor, expected in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
        for maxima in ((factor * story, 2.0 * roof), (2.0 * story, factor * roof)):
            assert modal_sums._may_grow(modes, shapes, q, rate, *maxima) == expected


def test_maxima_of_the_ground_in_an_interval():
    steps = elastic.INTERVAL_STEPS
    for seed in range(5):
        ground = record(seed, 2 * steps + 1)
        found = np.zeros((2, 2))
        for k in range(2):
            elastic._measure_ground(ground, DT, k, found)
            part = ground[k * steps : (k + 1) * steps + 1]
            expected = np.max(np.abs(part)), np.max(np.abs(np.diff(part))) / DT
            assert found[k] == pytest.approx(expected, rel=1e-12)


def directions():
    angles = np.radians(np.arange(rotated.ANGLES))
    return np.array([np.cos(angles), np.sin(angles)])


def rotated_peaks(pair, parts, between):
    result = np.zeros((3, rotated.ANGLES))
    rotated.rotated_peaks.compiled(
        *pair, DT, parts, linear_table(parts, rotated.LANES), directions(), between, result,
        *rotated.scratch(pair.shape[1], parts),
    )  # fmt: skip
    return result


@pytest.mark.parametrize(("size", "parts", "growth"), [(40, 1, -2.0), (75, 1, 0.0), (30, 3, 2.0)])
def test_peaks_in_all_directions(size, parts, growth):
    pair = np.array([record(seed + size, size, growth) for seed in (1, 2)])
    between, at_steps = (rotated_peaks(quiet(pair), parts, flag) for flag in (1, 0))
    last = size * parts * FINE
    for i, (omega, xi) in enumerate(zip(OMEGAS, RATIOS, strict=True)):
        both = np.array([motion(continued(one), DT, omega, xi, parts * FINE)[0] for one in pair])
        values = both.T @ directions()
        assert between[i] == pytest.approx(largest(values, FINE), rel=3e-5)
        until_end = np.abs(values[: last + 1 : FINE])
        assert at_steps[i] == pytest.approx(np.max(until_end, axis=0), rel=1e-9)


def test_no_sector_with_a_maximum_is_skipped():
    """The result is at least the maximum of each step in each direction, computed without bounds,
    in records with similar intervals."""
    for seed in range(3):
        pair = np.array([similar_intervals(10 * seed + k, 32, 3)[:90] for k in range(2)])
        found = rotated_peaks(quiet(pair), 1, 1)
        for i, (omega, xi) in enumerate(zip(OMEGAS, RATIOS, strict=True)):
            both = np.array([motion(continued(one), DT, omega, xi, FINE)[0] for one in pair])
            assert found[i] == pytest.approx(largest(both.T @ directions(), FINE), rel=3e-5)


def test_excess_between_steps_follows_from_the_larger_resultant_of_both_ends(monkeypatch):
    """The resultants of the relative accelerations, with the motion between steps by the matrix
    exponential of an oscillator under a straight line of ground motion."""
    passed = []
    monkeypatch.setattr(rotated, "_count_higher", lambda _, excess: passed.append(excess) or 0)
    omega, xi, margin = 25.0, 0.1, 0.37
    ground = np.array([record(k, rotated.INTERVAL_STEPS + 1) for k in range(2)])
    table = recursion_table(
        elastic.COEFFICIENTS, lambda w, xi: (w**2, 2.0 * xi * w), [omega], [xi], DT
    )
    start = np.array([[0.01, -0.2, 0.005, 0.3]])
    rotated._integrate_interval(
        (
            ground, table, 0, Vibration(omega**2, 2.0 * xi * omega, DT), directions(), start,
            np.zeros((rotated._SECTOR_ROWS, rotated._SECTORS + 1)),
            np.zeros((3, between_steps.TERMS)), np.zeros(rotated.ANGLES),
        ), 0, margin, False,
    )  # fmt: skip
    # u, v, ground acceleration and its rate
    system = np.zeros((4, 4))
    system[0, 1] = system[2, 3] = 1.0
    system[1, :3] = -(omega**2), -2.0 * xi * omega, -1.0
    states, squares = start.reshape(2, 2).copy(), []
    for step in range(rotated.INTERVAL_STEPS + 1):
        accelerations = -(omega**2) * states[:, 0] - 2.0 * xi * omega * states[:, 1]
        squares.append(np.sum((accelerations - ground[:, step]) ** 2))
        if step < rotated.INTERVAL_STEPS:
            rates = (ground[:, step + 1] - ground[:, step]) / DT
            both = np.column_stack([states, ground[:, step], rates])
            states = (both @ expm(DT * system).T)[:, :2]
    assert np.any(np.diff(squares) > 0.0) and np.any(np.diff(squares) < 0.0)
    largest_of_steps = np.maximum(squares[:-1], squares[1:])
    assert passed == pytest.approx(margin * np.sqrt(largest_of_steps), rel=1e-9)


def test_bounds_between_axes_and_edges_of_sectors():
    """Sums of sines and cosines: a displacement at an edge is at most the bound, and equal to it
    for a motion along an axis or with the same maximum along both axes."""
    scratch = np.zeros((rotated._SECTOR_ROWS, rotated._SECTORS + 1))
    edges = np.radians(np.linspace(0.0, 180.0, rotated._SECTORS + 1))
    scratch[rotated._COSINES], scratch[rotated._SINES] = np.cos(edges), np.sin(edges)
    random = np.random.default_rng(5)
    axes = np.radians(np.arange(rotated.AXES) * 180.0 / rotated.AXES)
    for x, y in random.normal(size=(20, 2)):
        maxima = np.abs(x * np.cos(axes) + y * np.sin(axes))
        rotated._interpolate(maxima, scratch)
        start, end = scratch[rotated._AT_START].copy(), scratch[rotated._AT_END]
        assert np.array_equal(start[:-1], end[:-1])
        rotated._project(x, y, scratch, sizes := np.zeros(edges.size))
        assert sizes == pytest.approx(np.abs(x * np.cos(edges) + y * np.sin(edges)), rel=1e-12)
        assert np.all(start >= sizes * (1.0 - 1e-12))
        # Between two axes on the same side, the sum is exact.
        signs = np.sign(x * np.cos(axes) + y * np.sin(axes))
        step = rotated._SECTORS // rotated.AXES
        for k in range(rotated.AXES - 1):
            if signs[k] == signs[k + 1]:
                inner = slice(k * step, (k + 1) * step + 1)
                assert start[inner] == pytest.approx(sizes[inner], rel=1e-12)
        assert start[-1] == maxima[0]
    best = random.uniform(size=rotated.ANGLES)
    for sector in range(rotated._SECTORS):
        assert rotated._lowest(best, sector) == np.min(best[10 * sector : 10 * sector + 10])
        scratch[rotated._LOWEST, sector] = rotated._lowest(best, sector)
    for excess in (0.0, 0.01):
        values = random.uniform(0.0, 0.12, size=(2, edges.size))
        scratch[[rotated._AT_START, rotated._AT_END]] = values
        top = np.maximum(np.max(values[:, :-1], axis=0), np.max(values[:, 1:], axis=0))
        assert [rotated._top(scratch, k) for k in range(rotated._SECTORS)] == list(top)
        higher = top / math.cos(math.radians(5.0)) + excess > scratch[rotated._LOWEST, :-1]
        assert rotated._count_higher(scratch, excess) == np.sum(higher)
        assert 0 < np.sum(higher) < rotated._SECTORS


def modal_case(seed, parts):
    """Return a table of modes, their shapes and the static correction; two columns of the table
    only complete the block."""
    random = np.random.default_rng(seed)
    omegas, ratios = random.uniform(3.0, 60.0, 8), random.uniform(0.0, 0.3, 8)
    table = recursion_table(modal_sums.MODE_ROWS, lambda w, xi: (w, xi), omegas, ratios, DT / parts)
    shapes = random.normal(size=(8, 4)) / omegas[:, None] ** -1.0
    shapes[6:] = 0.0
    return omegas, ratios, table, shapes, 0.1 * random.uniform(size=4)


@pytest.mark.parametrize(
    ("size", "parts", "growth"),
    [(3, 1, 0.0), (40, 1, 0.0), (100, 2, -1.0), (150, 1, 1.0), (70, 3, 0.0)],
)
def test_maximum_of_a_sum_of_modes(size, parts, growth):
    for seed in range(3):
        samples = record(seed + size, size, growth)
        omegas, ratios, table, shapes, static = modal_case(seed, parts)
        results = np.zeros(modal_sums.RESULTS)
        modal_sums.largest_drifts.compiled(
            samples, parts, DT / parts, table, shapes, static, results,
            *modal_sums.scratch(size * parts + 200 * parts, 8, 4),
        )  # fmt: skip
        # At the rate of decay of these modes, 200 samples contain the largest free vibration.
        coordinates = [
            motion(continued(samples), DT, w, xi, parts * FINE)
            for w, xi in zip(omegas[:6], ratios[:6], strict=True)
        ]
        q = np.column_stack([one[0] for one in coordinates])
        drift = q @ shapes[:6] - np.outer(coordinates[0][2], static)
        peaks = largest(drift, FINE)
        story = int(np.argmax(peaks[:3]))
        assert results[modal_sums.STORY] == story
        assert results[modal_sums.PEAK] == pytest.approx(peaks[story], rel=3e-5)
        assert results[modal_sums.ROOF] == pytest.approx(peaks[3], rel=3e-5)


def test_sum_of_modes_is_evaluated_between_steps():
    """Value, rate and the next step follow from the state of the modes and a linear ground."""
    _, _, table, shapes, static = modal_case(9, 1)
    random = np.random.default_rng(9)
    q, rate = random.normal(size=(2, modal_sums._CHUNK_STEPS + 1, 8))
    ground = random.normal(size=modal_sums._CHUNK_STEPS + 1)
    slope = (ground[1] - ground[0]) / DT
    modal_sums._integrate_modes(ground, 1, 0, table, q, rate, np.zeros(ground.size))
    drift = q @ shapes - np.outer(ground, static)
    rates = rate @ shapes - slope * static
    sums = modal_sums._Sum(table, shapes, static, DT)
    steps = modal_sums._Steps(q, rate, ground, drift)
    for c in range(4):
        for t, row in ((0.0, 0), (DT, 1)):
            value, speed = modal_sums._column_at(sums, steps, 0, slope, t, c)
            assert value == pytest.approx(drift[row, c], rel=1e-9, abs=1e-11)
            assert speed == pytest.approx(rates[row, c], rel=1e-9, abs=1e-9)
            assert modal_sums._rate(sums, steps, row, slope, c) == pytest.approx(speed, rel=1e-9)


def test_maxima_of_columns_and_their_second_differences():
    rows = modal_sums._CHUNK_STEPS + 1
    drift = np.random.default_rng(10).normal(size=(rows + 3, 5))
    maxima, bends = np.full((2, 5), 7.0)
    modal_sums._update_maxima(drift, maxima, bends)
    assert maxima == pytest.approx(np.max(np.abs(drift[:rows]), axis=0))
    assert bends == pytest.approx(np.max(np.abs(np.diff(drift[:rows], 2, axis=0)), axis=0))


def test_excess_between_steps_and_number_of_terms():
    """The bound of the excess is reached by a cosine of the longest allowed step, about."""
    for omega_h in (0.01, 0.3, 1.0):
        for xi in (0.0, 0.2):
            omega = omega_h / DT
            vibration = Vibration(omega**2, 2.0 * xi * omega, DT)
            expected = DT**2 / 8.0 * math.exp(xi * omega_h) / math.cos(0.5 * omega_h)
            assert between_steps.excess_factor(vibration) == pytest.approx(expected, rel=1e-12)
            # Terms beyond the cubic, until (omega h)^k 3! / (k + 3)! is below 2e-10
            neglected = [omega_h ** (n - 3) * 6.0 / math.factorial(n) for n in range(4, 16)]
            count = next((n for n, term in enumerate(neglected, 4) if term <= 2e-10), 15)
            assert between_steps.term_count(vibration) == max(count, 5)
    damped = Vibration((0.1 / DT) ** 2, 0.9 / DT, DT)
    alone = Vibration((0.9 / DT) ** 2, 0.0, DT)
    assert between_steps.term_count(damped) == between_steps.term_count(alone) == 14


def test_step_may_exceed_maximum_if_its_rate_turns():
    """The rate turns if its signs differ, or if it approaches zero at the start and leaves zero at
    the end. From rest, the second derivative at the start gives the sign."""
    rise, q0, q1 = 0.5, -3.0, 2.0
    for d0 in (-1.0, 0.0, 1.0):
        for e0 in (-2.0, 0.0, 2.0):
            for d1 in (-1.0, 0.0, 1.0):
                for e1 in (-4.0, 0.0, 4.0):
                    before = d0 or e0
                    turns = before * d1 < 0.0 or (d0 * e0 < 0.0 < d1 * e1)
                    bound = 3.0 + rise * max(abs(e0), abs(e1))
                    for best, expected in ((bound - 1e-9, turns), (bound, False)):
                        found = between_steps.may_exceed(best, rise, q0, d0, e0, q1, d1, e1)
                        assert bool(found) == expected


def test_ground_motion_is_linear_between_samples():
    samples = record(11, 7)
    for parts in (1, 3):
        ground = np.full(6 * parts + 1, np.nan)
        between_steps.interpolate_samples(samples, parts, ground)
        expected = np.interp(np.arange(6 * parts + 1) / parts, np.arange(7), samples)
        assert ground == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("rate", [0.0, 0.4])
def test_all_terms_of_the_series_of_a_free_vibration(rate):
    """The derivatives of q'' follow from the equation of motion. The zero of q' at the start is
    divided out if the rate is zero."""
    omega, xi = 0.9 / DT, 0.1
    vibration = Vibration(omega**2, 2.0 * xi * omega, DT)
    system = np.array([[0.0, 1.0], [-(omega**2), -2.0 * xi * omega]])
    n = between_steps.term_count(vibration)
    series = np.full((3, between_steps.TERMS), 7.0)
    second, third = -70.0, 900.0
    between_steps.largest_between(1.0, (rate, second, third), -1.0, vibration, n, series)
    curvature, derivative = [], np.array([second, third])
    for k in range(n - 2):
        curvature.append(DT ** (k + 2) * derivative[0] / math.factorial(k))
        derivative = system @ derivative
    rates = [DT * rate, *(value / (k + 1) for k, value in enumerate(curvature))]
    values = [1.0, *(value / (k + 1) for k, value in enumerate(rates))]
    assert series[0, :n] == pytest.approx(values, rel=1e-12)
    shift = int(rate == 0.0)
    assert series[1, : n - 1 - shift] == pytest.approx(rates[shift:], rel=1e-12)
    assert series[2, : n - 2] == pytest.approx(curvature, rel=1e-12)
    # Terms that do not exist are not written, because the next series follows.
    assert n < between_steps.TERMS
    assert np.all(series[0, n:] == 7.0)
    assert np.all(series[1, n - 1 :] == 7.0)
    assert np.all(series[2, n - 2 :] == 7.0)


@pytest.mark.parametrize("quantity", [0, 1, 2])
def test_no_interval_with_a_maximum_of_one_quantity_is_skipped(quantity):
    """As the test before, but the other quantities select no interval, because their recorded
    maxima are large."""
    larger_between = 0
    for seed in range(60):
        samples = similar_intervals(seed, elastic.INTERVAL_STEPS, 4)
        ground, starts, maxima, ground_maxima = elastic.scratch(samples.size, 1, 1)
        omega = np.random.default_rng(seed).uniform(15.0, 45.0)
        table = recursion_table(
            elastic.COEFFICIENTS,
            lambda w, xi: (w**2, 2.0 * xi * w),
            [omega],
            [0.05 * (seed % 2)],
            DT,
        )
        result, series = np.zeros((elastic.PEAKS, 1)), np.zeros((3, between_steps.TERMS))
        elastic.peaks.compiled(
            samples, DT, 1, table, 1, 1, result, ground, starts, maxima, ground_maxima
        )
        best = np.full(elastic.PEAKS, 1e300)
        best[quantity] = 0.0
        one = elastic._TableOscillator(ground, DT, table, 0, starts[0], 1, series, best)
        elastic._search(one, maxima[0], ground_maxima)
        assert best[quantity] == pytest.approx(result[quantity, 0], rel=1e-12)
        larger_between += best[quantity] > np.max(maxima[0][:, quantity]) * 1.001
    assert larger_between > 20


def test_extremes_are_zeros_of_cubics_with_values_of_quintics():
    """The recursion of the matrix exponential, then the polynomials of SciPy and NumPy in each step
    in which the velocity changes its sign. The last extremum is in the last sampling interval."""
    samples, parts = record(21, 40, 1.0), 2
    samples[-1] = 30.0
    h, omega, xi = DT / parts, 45.0, 0.05
    table = recursion_table(
        elastic.COEFFICIENTS, lambda w, xi: (w**2, 2.0 * xi * w), [omega], [xi], h
    )
    u, v, ground = motion(samples, DT, omega, xi, parts)
    a = -(omega**2) * u - 2.0 * xi * omega * v - ground
    expected = []
    for k in range(u.size - 1):
        if v[k] * v[k + 1] < 0.0:
            cubic = BPoly.from_derivatives([0.0, h], [[v[k], a[k]], [v[k + 1], a[k + 1]]])
            (zero,) = PPoly.from_bernstein_basis(cubic).roots(extrapolate=False)
            ends = [[u[j], v[j], a[j]] for j in (k, k + 1)]
            value = BPoly.from_derivatives([0.0, h], ends)(zero)
            expected.append((k * h + zero, omega**2 * value))
    # Values of another record
    extrema, largest_values = np.zeros((3, 200)), np.full((2, 1), 1e9)
    count = extremes.extremes.compiled(
        samples, DT, np.array([float(parts)]), table, np.zeros(1), extrema, largest_values
    )
    assert count == len(expected) > 10
    assert pytest.approx(np.array(expected), rel=1e-6) == extrema[1:, :count].T
    assert largest_values[0, 0] == pytest.approx(np.max(np.abs(extrema[2, :count])), rel=1e-12)
    assert (samples.size - 2) * DT < expected[-1][0]


def test_radius_is_largest_in_last_interval():
    """Both components are equal, so that the radius is sqrt(2) times the displacement."""
    samples = np.append(np.zeros(3), [0.0, 1.0, -9.0])
    dt, omega = 0.05, 60.0
    table = recursion_table(
        elastic.COEFFICIENTS, lambda w, xi: (w**2, 2.0 * xi * w), [omega], [0.0], dt / 8
    )
    found, largest_values = np.zeros((4, 50)), np.full((2, 1), 1e9)  # of another record
    extremes.radii.compiled(
        np.array([samples, samples]), dt, np.array([8.0]), table, np.zeros(1), found, largest_values
    )
    u, _, _ = motion(samples, dt, omega, 0.0, 400)
    inner = np.abs(u[1:-1])
    is_maximum = (inner >= np.abs(u[:-2])) & (inner > np.abs(u[2:]))
    times = dt / 400 * (1 + np.flatnonzero(is_maximum & (inner > 1e-9)))
    radius = omega**2 * math.sqrt(2.0) * np.max(inner[is_maximum])
    assert times[-1] > 4.0 * dt
    assert found[1, : times.size] == pytest.approx(times, abs=dt / 25)
    assert largest_values[0, 0] == pytest.approx(radius, rel=3e-3)


def test_maxima_along_axes_of_block_of_steps():
    """Displacements from large to small, so that each axis has its maximum at another step."""
    random = np.random.default_rng(12)
    table = linear_table(1, rotated.LANES)
    ground = 50.0 * random.normal(size=(2, rotated._BLOCK + 3))
    states = random.normal(size=(4, rotated.LANES)) * 10.0 ** random.uniform(-3, 1, rotated.LANES)
    old = random.uniform(0.0, 0.1, size=(rotated.AXES + 1, rotated.LANES))
    lane = np.concatenate([table, states, old]).ravel()
    rotated._advance(ground, 2, lane)
    found = lane.reshape(-1, rotated.LANES)[rotated._STATE :]
    axes = np.radians(np.arange(rotated.AXES) * 180.0 / rotated.AXES)
    directions_of_axes = np.array([np.cos(axes), np.sin(axes)])
    for i in range(rotated.LANES):
        a = table[[[A11, A12], [A21, A22]], i]
        b = table[[[B10, B11], [B20, B21]], i]
        by_u, by_v = table[[elastic.BY_DISPLACEMENT, elastic.BY_VELOCITY], i]
        state = states[:, i].reshape(2, 2).T  # displacement and velocity along both axes
        maxima = old[:, i].copy()
        for k in range(rotated._BLOCK + 1):
            along = np.abs(state[0] @ directions_of_axes)
            maxima[:-1] = np.maximum(maxima[:-1], along)
            acceleration = by_u * state[0] + by_v * state[1] + ground[:, 2 + k]
            maxima[-1] = max(maxima[-1], float(acceleration @ acceleration))
            if k < rotated._BLOCK:
                state = a @ state - b @ ground[:, 2 + k : 4 + k].T
        assert found[:4, i] == pytest.approx(state.T.ravel(), rel=1e-10, abs=1e-10)
        assert found[4:, i] == pytest.approx(maxima, rel=1e-10)


def test_power_series_and_its_derivative():
    coefficients = np.random.default_rng(13).normal(size=8)
    for count in (1, 2, 5, 8):
        series = np.polynomial.Polynomial(coefficients[:count])
        for x in (-0.7, 0.0, 0.4, 1.0):
            found = between_steps._value(coefficients, count, x)
            assert found == pytest.approx((series(x), series.deriv()(x)), rel=1e-12, abs=1e-12)
