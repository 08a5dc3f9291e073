"""Example 1 of the paper of 2022: 10 u'' + 5 u' + 200 u + 3 u^2 = 500 cos 25t - 200 sin 10t, at rest, 5 s.

The reference is DOP853 at 1e-13. The numbers were measured with another implementation of the same formulas.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from building_cases import Force, Law, model, story
from references import orders, smooth
from tdint import run

BUILDING = model(
    [story(10.0, 200.0, Law("polynomial", (200.0, 3.0)), dashpot=5.0)],
    forces=[Force(1, 500.0, 0.0, 25.0), Force(1, 0.0, -200.0, 10.0)],
)


def exact(times):
    def acceleration(t, u, v):
        return (500 * math.cos(25 * t) - 200 * math.sin(10 * t) - 5 * v - 200 * u - 3 * u * u) / 10.0

    return smooth(acceleration, 0.0, 0.0, times)[0]


def error(method, dt):
    response = run(BUILDING, method=method, dt=dt, duration=5.0, history=True)
    history = response.history
    return np.max(np.abs(history.displacement[:, 0] - exact(history.time)))


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("impulse", 4.72e-3),
        ("newmark-average", 8.88e-3),
        ("newmark-linear", 5.04e-3),
        ("central-difference", 4.81e-3),
        ("wilson:theta=1.4", 8.42e-3),
    ],
)
def test_error_at_dt_0_02(method, expected):
    assert error(method, 0.02) == pytest.approx(expected, rel=0.02)


def test_impulse4_is_of_order_4():
    errors = [error("impulse4", dt) for dt in (0.02, 0.01, 0.005)]
    assert errors[0] <= 2e-5
    assert orders(errors).min() >= 3.9


def test_the_peak():
    response = run(BUILDING, method="impulse4", dt=0.005, duration=5.0)
    assert response.stories.peak_displacement[0] == pytest.approx(0.773, abs=1e-3)


def test_rk5_with_the_load_at_its_stages_is_the_best_of_all():
    assert error("rk5", 0.02) == pytest.approx(4.0e-8, rel=0.05)
