"""Overshoot in the first steps with a large time step, and its growth as powers of the time
step."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from selection import every
from tdint.assessment.stability.stability import EXACT_POWERS, STARTS, overshoot, verdict
from tdint.errors import UsageError
from tdint.methods.catalogue import catalogue, parse

# Powers of omega h of the first step for omega h to infinity without damping: u and h v for the
# start u0, and u and h v for the start h v0. They were measured with independent implementations
# with 30 to 40 digits.
NONE = (0, 0, -2, 0)
ALL_LEFT = (-2, 0, -2, -2)  # the initial state decays completely
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
    "newmark:beta=0.3025:gamma=0.6": VELOCITY,
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
    "noh-bathe": (4, 6, 2, 4),
    "chang": NONE,
    # the reported velocity is the velocity at the end of the step; the power of h v from v0 is 0 if
    # the velocity lags
    "cr": (0, -2, 0, 0),
    "kr-alpha": DISPLACEMENT,
    "kr-alpha:rho_inf=0": DISPLACEMENT,
    "rk5": (6, 6, 4, 6),
    "gauss4": NONE,
}
WORDS = {
    NONE: "none", ALL_LEFT: "none", POWERS["exact"]: "none", VELOCITY: "velocity",
    BOTH: "displacement and velocity", DISPLACEMENT: "displacement", POWERS["cr"]: "displacement",
}  # fmt: skip
UNSTABLE = (
    *(method for method in POWERS if math.isfinite(parse(method).stability_limit)),
    "wilson:theta=1.36",
)


def both(method, **more):
    return [overshoot(parse(method), start, **more) for start in STARTS]


def powers(pair):
    return [
        power for motion in pair for power in (motion.displacement_power, motion.velocity_power)
    ]


def test_powers_are_listed_for_every_method():
    assert {method.partition(":")[0] for method in POWERS} == set(catalogue())


@pytest.mark.parametrize("method", every(3, POWERS))
def test_overshoot_powers(method):
    tolerance = (
        0.06 if method == "exact" else 0.02
    )  # the amplitude of a sine is estimated from a few values
    assert powers(both(method)) == pytest.approx(POWERS[method], abs=tolerance)


def test_exact_damped_motion_decays_completely():
    assert powers(both("exact", damping=0.05)) == [-math.inf] * 4


@pytest.mark.parametrize(
    "method", every(3, [method for method in POWERS if method not in UNSTABLE])
)
def test_overshoot_verdict(method):
    assert verdict(parse(method), both(method)) == WORDS[POWERS[method]]


@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_motion_is_normalized_by_exact_amplitude(damping):
    """The normalized motion agrees with the closed form of the free vibration."""
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


def test_first_step_of_wilson():
    """u1 tends to -(omega h)^2 (1 - 1 / theta) u0 / 2, by the equations of the step with da = -a0 /
    theta."""
    motion = both("wilson", dt_over_t=100.0)[0]
    expected = -0.5 * (200.0 * math.pi) ** 2 * (1.0 - 1.0 / 1.4)
    assert motion.displacement[:2] == pytest.approx([1.0, expected], rel=1e-3)


def test_average_acceleration_stays_within_exact_amplitude():
    for motion in both("newmark-average", steps=100):
        assert np.max(np.abs([motion.displacement, motion.velocity])) <= 1.0 + 1e-12


def test_diverged_motion_ends_with_nan():
    motion = both("rk5", steps=60)[0]
    assert motion.displacement.shape == (61,)
    assert np.isfinite(motion.displacement[:11]).all()
    assert np.isnan(motion.displacement[-1])


def test_powers_of_exact_motion_are_the_bound():
    assert [power for pair in EXACT_POWERS.values() for power in pair] == list(POWERS["exact"])


# ---- Nonlinear motion: hardening u'' + 100 u (1 + 10 u^2) = 0 up to 1.5 m, softening u'' + 100
# tanh u = 0 up to 4 m

SPRINGS = {
    "hardening": lambda u: 100.0 * u * (1.0 + 10.0 * u**2),
    "softening": lambda u: 100.0 * math.tanh(u),
}
PULLED = {"hardening": 1.5, "softening": 4.0}
FASTEST = {
    "hardening": math.sqrt(100.0 * 1.5**2 + 500.0 * 1.5**4),
    "softening": math.sqrt(200.0 * math.log(math.cosh(4.0))),
}
"""m/s, with the same energy."""


@pytest.mark.parametrize("law", SPRINGS)
@pytest.mark.parametrize("start", STARTS)
def test_fine_steps_follow_exact_nonlinear_motion(law, start):
    """The motion agrees with DOP853 of SciPy over more than one period. The exact motion reaches
    both normalizing maxima."""
    dt_over_t, steps = 0.002, 1000
    motion = overshoot("gauss4", start, dt_over_t, steps, law=law)
    h = 2.0 * math.pi / 10.0 * dt_over_t
    first = [PULLED[law], 0.0] if start == "displacement" else [0.0, FASTEST[law]]
    exact = solve_ivp(
        lambda _, y: [y[1], -SPRINGS[law](y[0])], (0.0, steps * h), first, method="DOP853",
        t_eval=np.linspace(0.0, steps * h, steps + 1), rtol=1e-11, atol=1e-11,
    )  # fmt: skip
    np.testing.assert_allclose(motion.displacement, exact.y[0] / PULLED[law], atol=1e-4)
    np.testing.assert_allclose(motion.velocity, exact.y[1] / FASTEST[law], atol=1e-4)
    assert motion.largest == pytest.approx((1.0, 1.0), abs=2e-3)


@pytest.mark.parametrize("law", SPRINGS)
def test_first_step_of_average_acceleration_in_nonlinear_motion(law):
    """From an initial velocity V, u1 satisfies 4 (u1 - h V) / h^2 + f(u1) = 0, because a(0) = 0."""
    dt_over_t = 10.0
    h = 2.0 * math.pi / 10.0 * dt_over_t
    force, fastest = SPRINGS[law], FASTEST[law]
    u1 = brentq(lambda u: 4.0 * (u - h * fastest) / h**2 + force(u), 0.0, h * fastest, xtol=1e-14)
    motion = overshoot("newmark-average", "velocity", dt_over_t, 1, law=law)
    assert motion.displacement[1] == pytest.approx(u1 / PULLED[law], rel=1e-9, abs=1e-9)
    assert math.isnan(motion.displacement_power)


def test_average_acceleration_overshoots_in_nonlinear_motion():
    """Average acceleration does not overshoot in linear motion. The expected values are in the
    README."""
    hardening = overshoot("newmark-average", "displacement", 0.3, law="hardening")
    softening = overshoot("newmark-average", "velocity", 10.0, law="softening")
    assert hardening.largest[1] == pytest.approx(1.65, abs=0.005)
    assert softening.largest[0] == pytest.approx(24.8, abs=0.05)


@pytest.mark.parametrize("law", SPRINGS)
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("dt_over_t", [0.1, 0.3, 1.0, 10.0])
def test_moment4_does_not_overshoot_in_nonlinear_motion(law, start, dt_over_t):
    """The method conserves the energy for any time step, and the exact maxima follow from the
    energy."""
    largest = overshoot("moment4", start, dt_over_t, 50, law=law).largest
    assert max(largest) <= 1.0 + 1e-6


def test_diverged_run_has_infinite_overshoot():
    assert overshoot("central-difference", "displacement", law="hardening").largest == (
        math.inf,
        math.inf,
    )


@pytest.mark.parametrize(
    ("method", "law", "message"),
    [("hht", "bent", "linear, hardening"), ("exact", "softening", "linear")],
)
def test_unknown_law_is_refused(method, law, message):
    with pytest.raises(UsageError, match=message):
        overshoot(method, law=law)
