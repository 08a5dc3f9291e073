"""Integrals of the force of a power-law dashpot over a step with a parabola of drift, by SciPy."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BPoly

from tdint.kernels import layout as rows
from tdint.kernels.linear_terms import power_damper
from tdint.kernels.peaks_between_steps import is_near_rest
from tdint.kernels.stepping import Memory, Seen, Span
from tdint.kernels.stories import brace, path
from tdint.kernels.stories.dashpot_path import follow_dashpot
from tdint.kernels.time_loop.observer import _observe_dashpots

H = 0.02


def dashpot(power, threshold):
    """Return a table with a dashpot in the second story."""
    terms = np.zeros((rows.LINEAR_TERM_ROWS, 3))
    terms[rows.POWER_DAMPER, 1] = 8e4
    terms[rows.POWER, 1] = power
    terms[rows.THRESHOLD, 1] = threshold**2
    return terms


def force(power, threshold, rate):
    """Return c v (v^2 + v0^2)^e."""
    return 8e4 * rate * (rate**2 + threshold**2) ** power


@pytest.mark.parametrize("power", [-0.3, 0.0, 0.5])
@pytest.mark.parametrize("threshold", [0.0, 0.02])
def test_force_and_derivative(power, threshold):
    terms = dashpot(power, threshold)
    for rate in (-1.3, -0.01, 0.004, 0.6):
        found, derivative = power_damper(terms, 1, rate)
        assert found == pytest.approx(force(power, threshold, rate), rel=1e-13)
        change = 1e-6 * abs(rate)
        ends = [force(power, threshold, rate + sign * change) for sign in (1.0, -1.0)]
        assert derivative == pytest.approx((ends[0] - ends[1]) / (2.0 * change), rel=1e-7)
    at_rest = power_damper(terms, 1, 0.0)
    linear = power == 0.0 or threshold > 0.0
    assert at_rest[0] == 0.0
    if threshold > 0.0 or power >= 0.0:
        expected = 8e4 * (threshold**2) ** power if linear else 0.0
        assert at_rest[1] == pytest.approx(expected, rel=1e-13)
    assert power_damper(terms, 0, 1.0) == (0.0, 0.0)


def averages(function, zero):
    """Return the mean of a function of s in (-1/2, 1/2) and 12 times the mean of s times it."""
    points = [zero] if -0.5 < zero < 0.5 else None
    options = {"epsabs": 0.0, "epsrel": 1e-11, "limit": 400, "points": points}
    mean = quad(function, -0.5, 0.5, **options)[0]
    return [mean, quad(lambda s: 12.0 * s * function(s), -0.5, 0.5, **options)[0]]


@pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(
    ("first", "last", "close"),
    [
        (1.0, 1.4, 1e-12),  # rates at both ends; the rate is the variable of integration
        (1.6, 1.0, 1e-11),
        (1.0, 1.99, 1e-9),
        (1.0, 2.01, 1e-12),  # the cube root of the rate
        (3.0, 1.0, 1e-12),
        (0.05, 1.0, 1e-12),
        (0.0, 1.0, 2e-5),
        (1.0, 0.0, 2e-5),
        (-0.3, 1.0, 1e-5),  # the rate changes its sign
        (1.0, -0.2, 1e-5),
    ],
)
def test_mean_and_moment_of_the_force(first, last, close, direction):
    first, last = direction * first, direction * last
    rise, bend = H * 0.5 * (first + last), H * (last - first)
    power, threshold = -0.3, 0.002
    terms = dashpot(power, threshold)
    scratch = np.full((12, 3), 7.0)
    follow_dashpot(terms, 1, H, rise, bend, scratch, 0, 9)
    zero = -rise / bend
    expected = averages(lambda s: force(power, threshold, (rise + bend * s) / H), zero)
    size = force(power, threshold, max(abs(first), abs(last)))
    found = scratch[[9 + path.MEAN, 9 + path.MOMENT], 1]
    assert found == pytest.approx(expected, abs=close * size)
    assert scratch[[path.MEAN, path.MOMENT], 1] == pytest.approx(7.0 + found, rel=1e-12)
    assert np.all(scratch[:, [0, 2]] == 7.0)
    # Derivatives with respect to rise and bend, where the force has no kink
    if min(abs(first), abs(last)) >= 1.0:
        derivatives = [
            averages(lambda s: power_damper(terms, 1, (rise + bend * s) / H)[1] / H, zero),
            averages(lambda s: s * power_damper(terms, 1, (rise + bend * s) / H)[1] / H, zero),
        ]
        by_rise = scratch[[path.MEAN_BY_RISE, path.MOMENT_BY_RISE], 1] - 7.0
        by_bend = scratch[[path.MEAN_BY_BEND, path.MOMENT_BY_BEND], 1] - 7.0
        assert by_rise == pytest.approx(derivatives[0], rel=1e-7, abs=1e-8 * size / H)
        assert by_bend == pytest.approx(derivatives[1], rel=1e-7, abs=1e-8 * size / H)


def test_work_of_dashpots_and_the_search_for_peaks_of_drift_rates():
    """Three stories, one of them on the ground. The work follows from the powers at both ends and
    their rates, which are differences here. The rates within the step are those of quintics."""
    random, n, h = np.random.default_rng(73), 3, 0.05
    terms = np.zeros((rows.LINEAR_TERM_ROWS, n + 1))
    terms[rows.LINK, :n] = 0.0, 1.0, 0.0
    terms[rows.POWER_DAMPER, :n] = 8e4, 0.0, 5e4
    terms[rows.POWER, :n], terms[rows.THRESHOLD, :n] = -0.3, 0.1**2
    terms[rows.DASHPOT, :n] = 0.0, 3e4, 0.0
    difference = np.eye(n) - np.diag(terms[rows.LINK, 1:n], -1)

    def power(v):
        rates = difference @ v
        return sum(
            (power_damper(terms, i, rates[i])[0] + terms[rows.DASHPOT, i] * rates[i]) * rates[i]
            for i in range(n)
        )

    def rate_of_power(v, a):
        return (power(v + 1e-6 * a) - power(v - 1e-6 * a)) / 2e-6

    def work(powers, rates):
        return 0.5 * h * sum(powers) + h**2 / 12.0 * (rates[0] - rates[1])

    searched = decided = 0
    for _ in range(40):
        u, v, a = (
            random.normal(size=(3, 2, n)) * np.array([1.0, 1.0 / h, 1.0 / h**2])[:, None, None]
        )
        state, observer_state = np.zeros((3, n + 1)), np.zeros((rows.OBSERVER_ROWS, n + 1))
        state[rows.DISPLACEMENT, :n], state[rows.VELOCITY, :n] = u[1], v[1]
        observer_state[rows.OBSERVED_ACCELERATION, :n] = a[1]
        law_state = np.zeros((rows.DRIFT + 1, n))
        law_state[rows.DRIFT] = difference @ u[1]
        memory = Memory(state, law_state, np.zeros((0, n)), np.zeros(0))
        for row, value in zip(
            (rows.U_PREVIOUS, rows.V_PREVIOUS, rows.A_PREVIOUS), (u[0], v[0], a[0]), strict=True
        ):
            observer_state[row, :n] = value
        points = np.zeros(n)
        for i in range(n):
            ends = [[(difference @ one[k])[i] for one in (u, v, a)] for k in range(2)]
            rate = BPoly.from_derivatives([0.0, h], ends).derivative().c[:, 0]
            inner = rate[1:] if ends[0][2] * ends[1][2] < 0.0 else rate[4:]
            points[i] = np.max(np.abs(inner))
        powers, rates = [power(v[0]), power(v[1])], [rate_of_power(v[k], a[k]) for k in range(2)]
        for raised in range(n):
            for factor, expected in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
                peaks = np.zeros((2 * rows.PEAK_ROWS, n))
                peaks[rows.PEAK_DRIFT_RATE] = 1e9
                peaks[rows.PEAK_DRIFT_RATE, raised] = factor * points[raised]
                totals = np.zeros(rows.TOTALS_SIZE)
                totals[[rows.POWER_DASHPOTS, rows.RATE_DASHPOTS]] = powers[0], rates[0]
                totals[rows.ENERGY_VISCOUS] = 5.0
                seen = Seen(observer_state, peaks, np.zeros((3, n)), totals, np.zeros((0, 0)))
                span = Span(h, h, 0.0, 0.0, False, False, False, False)
                found = _observe_dashpots(span, terms, memory, seen)
                # A step near the rest of a dashpot with an exponent below 1 is always searched.
                ends = [difference @ one for one in v]
                near_rest = any(is_near_rest(terms, i, ends[0][i], ends[1][i]) for i in range(n))
                assert bool(found) == (expected or near_rest)
                searched += found
                decided += not near_rest
        scale = h * max(powers) + h**2 * max(map(abs, rates))
        energy = work(powers, rates)
        assert totals[rows.ENERGY_DASHPOTS] == pytest.approx(energy, abs=1e-6 * scale)
        assert totals[rows.ENERGY_VISCOUS] == pytest.approx(5.0 - energy, abs=1e-6 * scale)
        assert totals[rows.POWER_DASHPOTS] == pytest.approx(powers[1], rel=1e-12)
        assert totals[rows.RATE_DASHPOTS] == pytest.approx(rates[1], rel=1e-6, abs=1e-6 * scale)
        per_acceleration = 0.5 * rate_of_power(v[1], np.ones(n))
        found = totals[rows.DASHPOTS_PER_ACCELERATION]
        assert found == pytest.approx(per_acceleration, rel=1e-6, abs=1e-3)
        raised_to = peaks[rows.PEAK_DRIFT_RATE, n - 1]
        assert raised_to == max((1.0 + 1e-9) * points[n - 1], abs((difference @ v[1])[n - 1]))
    assert decided == 30
    assert searched == 240 - decided // 2


def test_a_sum_of_forces_is_largest_at_any_instant_of_a_step():
    """The spring is stiff and the damper weak, so that the sum is largest where the drift rate,
    linear in time, is zero: also close to the end of the step."""
    terms = np.zeros((rows.LINEAR_TERM_ROWS, 2))
    terms[[rows.BRACE, rows.BRACED_DAMPER, rows.BRACED_RELIEF], 1] = [1e3, 1e-3, 1e3]
    for part in range(brace._INSTANTS // 2 + 1, brace._INSTANTS):
        zero = part / brace._INSTANTS
        ends = (0.0, zero, H * (zero - 0.5), zero - 1.0)
        found = brace.instant_of_largest_sum(terms, 1, H, ends, 0.0, (0.0, 1e4))
        assert found == pytest.approx(zero, rel=1e-12)
