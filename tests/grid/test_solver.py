"""The separate solver and closed forms."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from grid.solver import solve

MASS, STIFFNESS = 2e5, 5e7  # kg, N/m
OMEGA = math.sqrt(STIFFNESS / MASS)
AT_REST = np.zeros(0)


def oscillator(**more):
    """Return the model of an undamped linear oscillator with more keys of its story."""
    return {"stories": [{"mass": MASS, "stiffness": STIFFNESS, "height": 3.0, **more}]}


def started(model, displacement, velocity):
    """Return a model with an initial motion of its only floor."""
    return model | {"initial": {"displacement": [displacement], "velocity": [velocity]}}


def test_free_vibration():
    peaks = solve(started(oscillator(), 0.003, 0.1), AT_REST, 0.01, 2.0)
    size = math.hypot(0.003, 0.1 / OMEGA)
    assert peaks["peak_drift"] == pytest.approx([size], rel=1e-8)
    assert peaks["peak_total_shear"] == pytest.approx([STIFFNESS * size], rel=1e-8)
    assert peaks["peak_absolute_acceleration"] == pytest.approx([OMEGA**2 * size], rel=1e-8)
    final = 0.003 * math.cos(2.0 * OMEGA) + 0.1 / OMEGA * math.sin(2.0 * OMEGA)
    assert peaks["residual_drift"] == pytest.approx([final], abs=1e-8 * size)


def test_energy_of_a_yielding_story():
    """Without damping, the plastic drift of the first excursion consumes the kinetic energy."""
    law = {"type": "bilinear", "yield_force": 1e5, "hardening": 0.0}
    peaks = solve(started(oscillator(law=law), 0.0, 0.3), AT_REST, 0.01, 1.0)
    first = 1e5 / STIFFNESS
    plastic = (0.5 * MASS * 0.3**2 - 0.5 * 1e5 * first) / 1e5
    assert peaks["peak_drift"] == pytest.approx([first + plastic], rel=1e-9)
    assert peaks["peak_shear"] == pytest.approx([1e5], rel=1e-12)


@pytest.mark.long
def test_drift_slightly_beyond_the_yield_drift():
    """The story yields for a short time about the extreme drift, between two points at which the
    solver tests its drift."""
    law = {"type": "bilinear", "yield_force": 1e5, "hardening": 0.0}
    for excess in np.geomspace(1e-7, 1e-3, 9):
        velocity = OMEGA * 1e5 / STIFFNESS * (1.0 + excess)
        peaks = solve(started(oscillator(law=law), 0.0, velocity), AT_REST, 0.01, 0.4)
        assert peaks["peak_shear"] == pytest.approx([1e5], rel=1e-12)


@pytest.mark.long
def test_sudden_force():
    """A constant force that starts within a sampling interval doubles the static displacement."""
    force = {"floor": 1, "points": [[0.0, 0.0], [0.0, 1e5], [9.0, 1e5]], "start": 0.1237}
    model = oscillator() | {"excitation": {"forces": [force]}}
    peaks = solve(model, AT_REST, 0.01, 2.0)
    assert peaks["peak_drift"] == pytest.approx([2e5 / STIFFNESS], rel=1e-8)
    assert peaks["peak_absolute_acceleration"] == pytest.approx([1e5 / MASS], rel=1e-8)


def test_damper_with_a_brace():
    """A linear damper in series with its brace, by the matrix exponential of three variables."""
    c, brace, factor = 4e5, 2e7, 0.8
    dashpot = {"coefficient": c, "brace": brace, "factor": factor}
    peaks = solve(started(oscillator(dashpot=dashpot), 0.01, 0.0), AT_REST, 0.01, 0.5)
    rates = np.array(
        [
            [0.0, 1.0, 0.0],
            [-STIFFNESS / MASS, 0.0, -factor / MASS],
            [0.0, brace * factor, -brace / c],
        ]
    )
    step = expm(rates * 1e-4)
    motion = [np.array([0.01, 0.0, 0.0])]
    for _ in range(5000):
        motion.append(step @ motion[-1])
    assert peaks["residual_drift"] == pytest.approx([motion[-1][0]], abs=1e-10)
    largest = np.max(np.abs(motion), axis=0)
    assert peaks["peak_damper_force"] == pytest.approx([largest[2]], rel=1e-6)


@pytest.mark.parametrize("law", [None, {"type": "bilinear", "yield_force": 1e5, "hardening": 0.05}])
def test_tangent_damping(law):
    """Without yielding, it equals damping by the initial stiffness; a yielding story is less
    damped."""
    story = {"law": law} if law else {}
    results = []
    for is_tangent in (False, True):
        damping = {"rayleigh": {"mass": 0.0, "stiffness": 0.004, "tangent": is_tangent}}
        model = started(oscillator(**story) | {"damping": damping}, 0.0, 0.3)
        results.append(solve(model, AT_REST, 0.01, 0.5)["peak_drift"][0])
    if law:
        assert results[1] > 1.01 * results[0]
    else:
        assert results[1] == pytest.approx(results[0], rel=1e-9)
