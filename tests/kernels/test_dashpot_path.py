"""Integrals of the force of a power-law dashpot over a step with a parabola of drift, by SciPy."""

import numpy as np
import pytest
from scipy.integrate import quad

from tdint.kernels import layout as rows
from tdint.kernels.linear_terms import power_damper
from tdint.kernels.stories import path
from tdint.kernels.stories.dashpot_path import follow_dashpot

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
    # Derivatives with respect to rise and bend, where the force has no sharp bend
    if min(abs(first), abs(last)) >= 1.0:
        derivatives = [
            averages(lambda s: power_damper(terms, 1, (rise + bend * s) / H)[1] / H, zero),
            averages(lambda s: s * power_damper(terms, 1, (rise + bend * s) / H)[1] / H, zero),
        ]
        by_rise = scratch[[path.MEAN_BY_RISE, path.MOMENT_BY_RISE], 1] - 7.0
        by_bend = scratch[[path.MEAN_BY_BEND, path.MOMENT_BY_BEND], 1] - 7.0
        assert by_rise == pytest.approx(derivatives[0], rel=1e-7, abs=1e-8 * size / H)
        assert by_bend == pytest.approx(derivatives[1], rel=1e-7, abs=1e-8 * size / H)
