"""Motion and peaks at closings of stops and other corners inside a step, against closed forms and
`scipy.integrate.solve_ivp`."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import tdint
from tdint.kernels import layout as rows
from tdint.kernels.equations.corners import _raise_velocity
from tdint.kernels.equations.moment4 import ROW

OFF = {"damping": "none", "plausibility": "off, test"}
MASS, STIFFNESS, DASHPOT, FORCE, GAP = 1e5, 4e6, 3e4, 4e5, 0.05
"""Oscillator that a constant force pushes against a stop: kg, N/m, N s/m, N, m."""


def closing():
    """Return time and velocity at the closing of the stop, s and m/s."""
    omega = math.sqrt(STIFFNESS / MASS)
    decay = DASHPOT / (2.0 * MASS)
    damped = math.sqrt(omega**2 - decay**2)
    static = FORCE / STIFFNESS

    def displacement(t):
        shape = math.cos(damped * t) + decay / damped * math.sin(damped * t)
        return static * (1.0 - math.exp(-decay * t) * shape)

    time = brentq(lambda t: displacement(t) - GAP, 1e-3, 0.2, xtol=1e-14)
    return time, static * omega**2 / damped * math.exp(-decay * time) * math.sin(damped * time)


def pushed(method, dt, dashpot, stop=2e7):
    """Return the response of the oscillator with a stop that has a dashpot."""
    law = {"type": "gap", "gap": GAP, "stop_stiffness": stop, "sides": "positive"}
    if dashpot:
        law["dashpot"] = dashpot
    model = {
        **OFF,
        "stories": [{"mass": MASS, "stiffness": STIFFNESS, "dashpot": DASHPOT}],
        "links": [{"name": "stop", "from": "ground", "to": 1, "law": law}],
        "excitation": {"forces": [{"floor": 1, "points": [[0.0, FORCE], [1.0, FORCE]]}]},
    }
    return tdint.run(model, method=method, dt=dt, duration=0.4)


@pytest.mark.parametrize("dt", [0.02, 0.01])
def test_damper_force_is_largest_at_the_closing(dt):
    """The dashpot of the stop brakes from the closing on. `impulse4` has a substep end there."""
    response = pushed("impulse4", dt, 1.5e6)
    velocity = closing()[1]
    assert response.stories.peak_damper_force[0] == pytest.approx(DASHPOT * velocity, rel=1e-6)
    assert response.stories.peak_velocity[0] == pytest.approx(velocity, rel=1e-6)


@pytest.mark.parametrize("dt", [0.02, 0.01, 0.005])
def test_estimate_of_moment4_covers_the_closing(dt):
    response = pushed("moment4", dt, 1.5e6)
    missing = abs(response.stories.peak_damper_force[0] - DASHPOT * closing()[1])
    assert missing < 2.0 * response.check.errors.peak_damper_force[0]


@pytest.mark.parametrize("dashpot", [0.0, 1.5e6, 3e6])
@pytest.mark.parametrize("method", ["impulse4", "moment4"])
def test_closing_divides_its_step(method, dashpot):
    """With a cubic polynomial across the closing, the velocity would be up to 2.3 % too low."""
    (contact, *_) = pushed(method, 0.01, dashpot).contacts
    time, velocity = closing()
    assert contact.time == pytest.approx(time, abs=1e-5)
    assert contact.approach_velocity == pytest.approx(velocity, rel=1e-3)
    if dashpot:  # the stop does not open before the end of the run

        def rate(t, y):
            force = FORCE - STIFFNESS * y[0] - 2e7 * (y[0] - GAP) - (DASHPOT + dashpot) * y[1]
            return [y[1], force / MASS, dashpot * y[1] ** 2]

        true = solve_ivp(rate, (time, 0.4), [GAP, velocity, 0.0], rtol=1e-9, atol=1e-12)
        assert contact.dissipated_energy == pytest.approx(true.y[2, -1], rel=1e-3)


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
def test_velocity_between_undamped_corners(method):
    """The story becomes stiffer at the corner; the quintic across it is not the motion."""
    stop = 2e8
    law = {"type": "gap", "gap": GAP, "stop_stiffness": stop, "sides": "positive"}
    model = {
        **OFF,
        "stories": [{"mass": MASS, "stiffness": STIFFNESS, "dashpot": DASHPOT, "law": law}],
        "excitation": {"forces": [{"floor": 1, "points": [[0.0, FORCE], [1.0, FORCE]]}]},
    }

    def rate(t, y):
        force = STIFFNESS * y[0] + stop * max(y[0] - GAP, 0.0)
        return [y[1], (FORCE - force - DASHPOT * y[1]) / MASS]

    true = solve_ivp(rate, (0.0, 0.4), [0.0, 0.0], rtol=1e-10, atol=1e-12, max_step=1e-4)
    largest = abs(true.y[1]).max()
    response = tdint.run(model, method=method, dt=0.01, duration=0.4, check=False)
    assert response.stories.peak_velocity[0] == pytest.approx(largest, rel=1e-4)
    assert response.stories.peak_damper_force[0] == pytest.approx(DASHPOT * largest, rel=1e-4)


@pytest.mark.parametrize("stiffness", [4e9, 2.07e10])
def test_contact_within_a_step_has_a_force(stiffness):
    """The peak force of half a sine is v0 sqrt(k m). The accelerations are zero at both ends of
    the step."""
    speed = 0.5
    law = {"type": "gap", "gap": 0.001, "stop_stiffness": stiffness, "sides": "positive"}
    model = {
        **OFF,
        "stories": [{"mass": MASS, "stiffness": 1.0}],
        "initial": {"displacement": [0.0], "velocity": [speed]},
        "links": [{"name": "stop", "from": "ground", "to": 1, "law": law}],
    }
    response = tdint.run(model, method="impulse4", dt=0.02, duration=0.6)
    true = speed * math.sqrt(stiffness * MASS)
    peaks, errors = response.stories, response.check.errors
    for value, error in (
        (response.devices.stories.peak_shear[0], response.devices.errors.peak_shear[0]),
        (peaks.peak_total_shear[0], errors.peak_total_shear[0]),
        (MASS * peaks.peak_absolute_acceleration[0], MASS * errors.peak_absolute_acceleration[0]),
    ):
        assert value == pytest.approx(true, rel=0.2)
        assert abs(value - true) < error


# ---- Tangent Rayleigh damping of a story with the law hertz

HERTZ, RATIO = 4e7, 0.05
OMEGA = math.sqrt(HERTZ / MASS)


def tangent_damped(method, dt, start, law):
    """Return the history of an oscillator with the law hertz and damping in proportion to its
    tangent stiffness."""
    model = {
        **OFF,
        "stories": [{"mass": MASS, "stiffness": HERTZ, "law": {"type": "hertz", **law}}],
        "damping": {"rayleigh": {"mass": 0.0, "stiffness": 2.0 * RATIO / OMEGA, "tangent": True}},
        "initial": {"displacement": [start], "velocity": [0.0]},
    }
    return tdint.run(model, method=method, dt=dt, duration=1.0, history=True, check=False)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average"])
def test_open_stop_has_tangent_damping(method):
    """The coefficient of tangent damping is that of a restitution only if the law has one."""
    response = tangent_damped(method, 0.002, 0.01, {"gap": 1.0, "stop_stiffness": HERTZ})
    t, damped = response.history.time, OMEGA * math.sqrt(1.0 - RATIO**2)
    shape = np.cos(damped * t) + RATIO / math.sqrt(1.0 - RATIO**2) * np.sin(damped * t)
    true = 0.01 * np.exp(-RATIO * OMEGA * t) * shape
    assert np.abs(response.history.displacement[:, 0] - true).max() < 2e-5


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
def test_closed_stop_has_tangent_damping(method):
    gap, stop, factor = 0.006, 2e9, 2.0 * RATIO / OMEGA

    def rate(t, y):
        overlap = max(abs(y[0]) - gap, 0.0)
        force = HERTZ * y[0] + math.copysign(stop * overlap**1.5, y[0])
        tangent = HERTZ + 1.5 * stop * math.sqrt(overlap)
        return [y[1], -(force + factor * tangent * y[1]) / MASS]

    options = {"rtol": 1e-9, "atol": 1e-12, "max_step": 1e-3, "method": "DOP853"}
    true = solve_ivp(rate, (0.0, 1.0), [0.012, 0.0], dense_output=True, **options).sol
    response = tangent_damped(method, 0.002, 0.012, {"gap": gap, "stop_stiffness": stop})
    missing = response.history.displacement[:, 0] - true(response.history.time)[0]
    assert np.abs(missing).max() < 1e-3 * 0.012


@pytest.mark.parametrize("size", [1.0, 1e-9, 1e-18])
def test_extremum_of_a_velocity_between_corners(size):
    """Against the roots of random parabolas of acceleration, which can begin near zero."""
    rng, row, at_rest = np.random.default_rng(5), ROW.PEAKS + rows.PEAK_VELOCITY, (0.0,) * 5
    for _ in range(200):
        a_0, a_1, velocity = rng.normal(size=3)
        a_0, a_2 = size * a_0, -math.copysign(rng.uniform(), a_0)
        parabola = [0.5 * (a_0 + a_2) - a_1, 0.5 * (4.0 * a_1 - 3.0 * a_0 - a_2), a_0]
        change = 0.3 * np.polyint(parabola)
        (turn,) = (x.real for x in np.roots(parabola) if abs(x.imag) < 1e-12 and 0 <= x.real <= 2)
        end = velocity + np.polyval(change, 2.0)
        table = np.zeros((row + 1, 1))
        motion = velocity, end, a_0, a_1, a_2
        _raise_velocity(table, rows.PEAK_VELOCITY, 0, 1.0, 0.3, motion, 0.0, at_rest)
        largest = max(abs(end), abs(velocity + np.polyval(change, turn)))
        assert table[row, 0] == pytest.approx(largest, rel=1e-9)
