"""First steps under a large step, and the powers with which they grow."""

import math

import numpy as np
import pytest

from tdint.analysis.assessment.stability import EXACT_POWERS, STARTS, overshoot, verdict
from tdint.methods.catalogue import catalogue, parse

# Powers of omega h in the first step as omega h goes to infinity, without damping: u and h v from u0, u and h v from
# h v0. Measured with independent implementations at 30-40 digits.
NONE = (0, 0, -2, 0)
ALL_LEFT = (-2, 0, -2, -2)  # nothing is left of the start
VELOCITY = (0, 2, -2, 0)
BOTH = (2, 2, 0, 0)
DISPLACEMENT = (0, 0, 0, 0)
POWERS = {
    "exact": (0, 1, -1, 0),
    "impulse": NONE,
    "impulse4": NONE,
    "impulse4:rho_inf=0.5": NONE,
    "impulse4:rho_inf=0": ALL_LEFT,
    "moment4": NONE,
    "moment4:rho_inf=0.5": NONE,
    "moment4:rho_inf=0": ALL_LEFT,
    "newmark": NONE,
    "newmark-average": NONE,
    "newmark:beta=0.3025,gamma=0.6": VELOCITY,
    "newmark-linear": VELOCITY,
    "fox-goodwin": VELOCITY,
    "central-difference": (2, 4, 0, 2),
    "hht": VELOCITY,
    "hht:alpha=-1/3": VELOCITY,
    "wbz": VELOCITY,
    "generalized-alpha": VELOCITY,
    "generalized-alpha:rho_inf=0.5": VELOCITY,
    "collocation": BOTH,
    "collocation:beta=0.18": BOTH,
    "wilson": BOTH,
    "u0v0": NONE,
    "u0v0:r=0.8": NONE,
    "houbolt": NONE,  # the first two steps are average acceleration
    "park": NONE,
    "bathe": ALL_LEFT,
    "bathe:gamma=0.5": ALL_LEFT,
    "bathe:rho_inf=0.5": NONE,
    "bathe:rho_inf=1": NONE,
    "chang": NONE,
    "cr": (0, -2, 0, 0),  # its velocity is that at the step's end; 0 for h v from u0 where it lags
    "kr-alpha": DISPLACEMENT,
    "kr-alpha:rho_inf=0": DISPLACEMENT,
    "rk5": (6, 6, 4, 6),
    "gauss4": NONE,
}
DAMPED = {  # damping ratio 0.05
    "hht": (1, 2, 0, 1),
    "wbz": (1, 2, 0, 1),
    "generalized-alpha": (1, 2, 0, 1),
    "newmark:beta=0.3025,gamma=0.6": (1, 2, 0, 1),
    "collocation": (2, 2, 1, 1),
    "wilson": (2, 2, 1, 1),
    "newmark-average": NONE,
    "bathe:rho_inf=0.5": NONE,
    "impulse4": NONE,
    "gauss4": NONE,
    "chang": NONE,
    "kr-alpha": DISPLACEMENT,
}
WORDS = {
    NONE: "none",
    ALL_LEFT: "none",
    POWERS["exact"]: "none",
    VELOCITY: "velocity",
    BOTH: "displacement and velocity",
    DISPLACEMENT: "displacement",
    POWERS["cr"]: "displacement",
}
UNSTABLE = (*(method for method in POWERS if math.isfinite(parse(method).stability_limit)), "wilson:theta=1.36")


def both(method, **more):
    return [overshoot(parse(method), start, **more) for start in STARTS]


def powers(pair):
    return [power for motion in pair for power in (motion.displacement_power, motion.velocity_power)]


def test_the_table_holds_every_method():
    assert {method.partition(":")[0] for method in POWERS} == set(catalogue())


@pytest.mark.parametrize("method", POWERS)
def test_powers(method):
    tolerance = 0.06 if method == "exact" else 0.02  # the amplitude of a sine is that of a few of its values
    assert powers(both(method)) == pytest.approx(POWERS[method], abs=tolerance)


@pytest.mark.parametrize("method", DAMPED)
def test_powers_with_damping(method):
    assert powers(both(method, damping=0.05)) == pytest.approx(DAMPED[method], abs=0.02)


def test_the_exact_motion_leaves_nothing_of_a_damped_start():
    assert powers(both("exact", damping=0.05)) == [-math.inf] * 4


@pytest.mark.parametrize("method", [method for method in POWERS if method not in UNSTABLE])
def test_verdict(method):
    assert verdict(parse(method), both(method)) == WORDS[POWERS[method]]


@pytest.mark.parametrize("method", UNSTABLE)
def test_verdict_of_an_unstable_method(method):
    assert verdict(parse(method), both(method)) == "unstable"


@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_motion_is_over_the_exact_amplitude(damping):
    """Against the closed form of the free vibration."""
    dt_over_t, steps = 0.3, 7
    omega_d = math.sqrt(1.0 - damping**2)  # over omega
    t = 2.0 * math.pi * dt_over_t * np.arange(steps + 1)  # omega t
    decay, c, s = np.exp(-damping * t), np.cos(omega_d * t), np.sin(omega_d * t) / omega_d
    expected = {
        "displacement": (decay * (c + damping * s), -decay * s),
        "velocity": (decay * s, decay * (c - damping * s)),
    }
    for motion in both("exact", dt_over_t=dt_over_t, steps=steps, damping=damping):
        np.testing.assert_allclose(motion.displacement, expected[motion.start][0], atol=1e-13)
        np.testing.assert_allclose(motion.velocity, expected[motion.start][1], atol=1e-13)
        assert (motion.method, motion.dt_over_t, motion.damping) == ("exact", dt_over_t, damping)


def test_the_first_step_of_wilson():
    """u1 tends to -(omega h)^2 (1 - 1 / theta) u0 / 2: the formulas of the step with da = -a0 / theta."""
    motion = both("wilson", dt_over_t=100.0)[0]
    expected = -0.5 * (200.0 * math.pi) ** 2 * (1.0 - 1.0 / 1.4)
    assert motion.displacement[:2] == pytest.approx([1.0, expected], rel=1e-3)


def test_average_acceleration_stays_within_the_exact_amplitude():
    for motion in both("newmark-average", steps=100):
        assert np.max(np.abs([motion.displacement, motion.velocity])) <= 1.0 + 1e-12


def test_a_motion_that_runs_away_ends_in_nan():
    motion = both("rk5", steps=60)[0]
    assert motion.displacement.shape == (61,)
    assert np.isfinite(motion.displacement[:11]).all()
    assert np.isnan(motion.displacement[-1])


def test_powers_of_the_exact_motion_are_the_bound():
    assert [power for pair in EXACT_POWERS.values() for power in pair] == list(POWERS["exact"])
