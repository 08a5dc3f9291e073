"""Tests of the spectral radius, the period error, the numerical damping and the critical steps,
which are measured on the compiled steps."""

import math

import numpy as np
import pytest

from facts import states
from selection import every
from tdint.assessment.stability.stability import critical_step, false_limit, stability
from tdint.kernels import layout as rows
from tdint.methods.catalogue import catalogue, parse
from tdint.methods.workspace import workspace
from tdint.model.building import oscillators
from tdint.response.runs.measured_stability import amplification
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.time_steps import Steps

# Period error and numerical damping ratio in percent at dt/T = 0.1 without damping, to the last
# printed digit. They were measured with independent implementations with 30 to 40 digits. 0 means
# less than 1e-9.
ACCURACY = {
    "newmark": ("3.21", "0"),
    "newmark-average": ("3.21", "0"),
    "newmark-linear": ("1.60", "0"),
    "fox-goodwin": ("-0.033", "0"),
    "central-difference": ("-1.69", "0"),
    "newmark:beta=0.3025:gamma=0.6": ("3.29", "2.95"),
    "hht": ("3.61", "0.118"),
    "hht:alpha=-0.1": ("3.95", "0.211"),
    "hht:alpha=-1/3": ("4.67", "0.378"),
    "wbz": ("4.19", "0.340"),
    "wbz:rho_inf=0.5": ("6.22", "1.27"),
    "wbz:rho_inf=0": ("12.3", "5.49"),
    "generalized-alpha": ("3.38", "0.016"),
    "generalized-alpha:rho_inf=0.5": ("4.67", "0.378"),
    "generalized-alpha:rho_inf=0": ("12.3", "5.49"),
    "collocation": ("3.23", "0.006"),
    "collocation:beta=0.20": ("3.91", "0.268"),
    "collocation:beta=0.18": ("5.01", "0.772"),
    "wilson": ("6.15", "1.40"),
    "u0v0:r=0.8": ("3.27", "0.004"),
    "u0v0": ("3.72", "0.102"),
    "u0v0:r=0": ("6.73", "1.96"),
    "houbolt": ("12.3", "5.49"),
    "park": ("6.71", "0.445"),
    "bathe": ("1.57", "0.087"),
    "bathe:gamma=0.5": ("1.62", "0.082"),
    "bathe:rho_inf=1": ("0.82", "0"),
    "bathe:rho_inf=0.8": ("0.94", "0.019"),
    "bathe:rho_inf=0.5": ("1.15", "0.046"),
    "noh-bathe": ("-0.247", "0.052"),
    "chang": ("3.21", "0"),
    "cr": ("3.21", "0"),
    "kr-alpha:rho_inf=1": ("3.21", "0"),
    "kr-alpha": ("3.38", "0.016"),
    "kr-alpha:rho_inf=0.5": ("4.67", "0.378"),
    "kr-alpha:rho_inf=0": ("12.3", "5.49"),
    "rk5": ("-0.003", "0.0016"),
    "gauss4": ("0.021", "0"),
    "impulse": ("0.021", "0"),
    "impulse4": ("0.021", "0"),
    "impulse4:rho_inf=0.8": ("0.022", "0.037"),
    "impulse4:rho_inf=0.5": ("0.025", "0.111"),
    "impulse4:rho_inf=0": ("0.057", "0.330"),
    "moment4": ("0.021", "0"),
    "moment4:rho_inf=0.8": ("0.022", "0.037"),
    "moment4:rho_inf=0.5": ("0.025", "0.111"),
    "moment4:rho_inf=0": ("0.057", "0.330"),
    "exact": ("0", "0"),
}


def one_point(method, dt_over_t, damping=0.0):
    return stability(parse(method), np.array([dt_over_t]), damping)


def printed_value(text):
    """Return a number and an error of half a unit in its last digit."""
    decimals = len(text.partition(".")[2])
    return pytest.approx(float(text), abs=0.51 * 10.0**-decimals if float(text) else 1e-9)


def test_accuracy_is_listed_for_every_method():
    assert {method.partition(":")[0] for method in ACCURACY} == set(catalogue())


@pytest.mark.parametrize("method", every(3, ACCURACY))
def test_period_error_and_numerical_damping(method):
    curve = one_point(method, 0.1)
    period_error, numerical_damping = ACCURACY[method]
    assert 100.0 * curve.period_error[0] == printed_value(period_error)
    assert 100.0 * curve.numerical_damping[0] == printed_value(numerical_damping)
    # Damping is d over the modulus, decay that over the phase: they differ by the third power.
    assert curve.amplitude_decay[0] == pytest.approx(
        1.0 - math.exp(-2.0 * math.pi * curve.numerical_damping[0]), rel=2e-3, abs=1e-9
    )


MEMBERS = (
    *(
        "bathe:rho_inf=0.0:gamma=0.95",
        "bathe:rho_inf=0.3:gamma=0.05",
        "bathe:rho_inf=1.0:gamma=0.95",
    ),
    *("bathe:rho_inf=0.3", "bathe:rho_inf=0.8", "bathe:rho_inf=0.8:gamma=0.5", "bathe:rho_inf=1.0"),
    *("kr-alpha:rho_inf=0.0", "kr-alpha:rho_inf=0.5", "kr-alpha:rho_inf=1.0"),
)
EXPLICIT = {"central-difference", "chang", "cr", "exact", "kr-alpha", "noh-bathe", "rk5"}


@pytest.mark.parametrize("method", every(6, [*catalogue(), *MEMBERS], ("impulse4", "moment4")))
def test_critical_step_is_declared_stability_limit(method):
    integrator = parse(method)
    assert critical_step(integrator) == pytest.approx(integrator.stability_limit, rel=1e-4)
    if math.isinf(integrator.stability_limit):
        assert critical_step(integrator, 0.05) == math.inf


def test_explicit_methods_are_declared():
    assert {name for name in catalogue() if not parse(name).implicit} == EXPLICIT
    conditional = {
        "central-difference",
        "fox-goodwin",
        "newmark-linear",
        "noh-bathe",
        "rk5",
    }  # no limit at infinity to speak of
    assert {name for name in catalogue() if math.isnan(parse(name).rho_inf)} == conditional


def test_wilson_below_1_366_is_unstable():
    assert critical_step(parse("wilson:theta=1.3661")) == math.inf
    assert critical_step(parse("wilson:theta=1.36")) == pytest.approx(24.0, abs=0.05)


@pytest.mark.parametrize(
    "method",
    every(
        3, [method for method in (*catalogue(), *MEMBERS) if not math.isnan(parse(method).rho_inf)]
    ),
)
def test_spectral_radius_at_infinity_is_declared(method):
    """The amplification matrix tends to its limit as 1 / (omega h)^2, and m coinciding roots as the
    m-th root of this term: m is 6 for park and at most 3 for other methods. In chang, rounding
    increases the radius by 1e-16 (omega h)^2."""
    integrator = parse(method)
    omega_h = 1e6
    radius = one_point(method, omega_h / (2.0 * math.pi)).spectral_radius[0]
    bound = omega_h ** (-2.0 / len(integrator.family.memory)) + 1e-16 * omega_h**2
    assert radius == pytest.approx(integrator.rho_inf, abs=bound)


@pytest.mark.parametrize("method", ["impulse", "impulse4", "gauss4"])
def test_spectral_radius_of_conservative_methods_is_one(method):
    curve = stability(parse(method), np.geomspace(1e-3, 1e4, 2000) / (2.0 * math.pi))
    assert np.max(np.abs(curve.spectral_radius - 1.0)) <= 1e-12
    assert one_point(method, 0.1).period_error[0] == pytest.approx(2.11e-4, abs=0.005e-4)


@pytest.mark.parametrize("damping", every(2, [0.05, 0.0]))
@pytest.mark.parametrize("method", catalogue())
def test_k_steps_equal_kth_power_of_amplification_matrix(method, damping):
    """The memory rows are set at random, as after the start of a multi-step method; h differs from
    1."""
    integrator = parse(method)
    family, h, k = integrator.family, 0.01, 25
    omega = np.array([0.1, 0.5, 0.9]) / h
    building = oscillators(omega, np.array([damping]))
    memory = list(family.memory)
    units = h ** -np.array([float(family.derivatives[row]) for row in memory])[:, None]
    space = workspace(building, integrator)
    space.state[memory, :-1] = units * np.random.default_rng(3).standard_normal(
        (len(memory), omega.size)
    )
    space.step_status[rows.STEPS_DONE] = 100.0
    # time integration starts with the acceleration from equilibrium
    if rows.ACCELERATION in memory:
        u, v = space.state[0, :-1], space.state[rows.VELOCITY, :-1]
        space.state[rows.ACCELERATION, :-1] = (
            -(omega**2) * u - building.linear_terms[rows.STORY_DAMPER, :-1] * v
        )
    matrices = amplification(integrator, omega, np.full_like(omega, damping), h)
    powers = np.linalg.matrix_power(matrices, k)
    expected = np.einsum("jab,bj->aj", powers, space.state[memory, :-1])
    assert (
        PreparedBuilding(building).loop(integrator, h, np.zeros(1), space)(Steps(h, k), 0, k) == 0
    )
    np.testing.assert_allclose(
        space.state[memory, :-1] / units, expected / units, rtol=0.0, atol=1e-11
    )


def test_amplification_does_not_depend_on_other_oscillators():
    """The coefficients of `exact` belong to one building, which here contains many oscillators."""
    integrator = parse("exact")
    omega, damping = np.geomspace(1e-3, 1e4, 60), np.tile([0.0, 0.05, 0.9], 20)
    alone = [
        amplification(integrator, omega[j : j + 1], damping[j : j + 1], 1.0)[0]
        for j in range(omega.size)
    ]
    np.testing.assert_allclose(
        amplification(integrator, omega, damping, 1.0), alone, rtol=1e-13, atol=0.0
    )


def test_principal_root_is_found_for_single_step():
    steps = np.geomspace(0.01, 0.45, 30)
    for method in ("houbolt", "park", "wilson"):
        curve = stability(parse(method), steps, 0.05)
        assert one_point(method, 0.3, 0.05).period_error[0] == pytest.approx(
            np.interp(0.3, steps, curve.period_error), rel=1e-2
        )


def test_period_error_is_undefined_beyond_half_a_period():
    curve = stability(parse("exact"), np.array([0.3, 0.49, 0.51, 10.3]), 0.05)
    np.testing.assert_allclose(curve.period_error[:2], 0.0, atol=1e-12)
    np.testing.assert_allclose(curve.numerical_damping[:2], 0.0, atol=1e-12)
    assert np.isnan(curve.period_error[2:]).all()
    np.testing.assert_allclose(curve.amplitude_decay[:2], 0.0, atol=1e-12)
    assert np.isnan(curve.amplitude_decay[2:]).all()
    np.testing.assert_allclose(
        curve.spectral_radius, np.exp(-0.05 * 2.0 * math.pi * curve.dt_over_t), rtol=1e-12
    )


def test_numerical_damping_excludes_damping_of_oscillator():
    """The principal root of average acceleration is (1 - z/2)^-1 (1 + z/2) with z = h s."""
    xi, omega_h = 0.05, 0.2 * math.pi
    z = omega_h * complex(-xi, math.sqrt(1.0 - xi**2))
    root = np.log((1.0 + z / 2.0) / (1.0 - z / 2.0))
    curve = one_point("newmark-average", 0.1, xi)
    assert curve.period_error[0] == pytest.approx(z.imag / root.imag - 1.0, rel=1e-9)
    assert curve.numerical_damping[0] == pytest.approx(-root.real / abs(root) - xi, rel=1e-9)


def test_false_stability_limit_is_reported():
    """No method of the catalog has a false limit. A false declaration is reported with both values,
    also if infinity is wrong."""
    for name in ("central-difference", "newmark-linear", "wilson", "impulse4", "rk5"):
        integrator = parse(name)
        assert false_limit(integrator, critical_step(integrator)) == ""
    explicit, implicit = parse("central-difference"), parse("newmark-average")
    assert states(false_limit(explicit, 1.9), "2, ... 1.9")
    assert states(false_limit(explicit, math.inf), "no limit up to 10000")
    assert states(false_limit(implicit, 3.5), "inf, ... 3.5")
