"""Observed order of every method, and special cases in which two methods are equal."""

import math
from dataclasses import replace

import numpy as np
import pytest

from building_cases import Force, Law, RayleighRatio, model, noise, oscillator, story
from references import smooth
from selection import every
from tdint.assessment.order.order import (
    LOADS,
    OBSERVED_HALVINGS,
    STORY_LAWS,
    ObservedOrder,
    observed_order,
    order_problem,
)
from tdint.errors import UsageError
from tdint.methods.catalogue import catalogue, parse
from tdint.model.definition import Excitation
from tdint.response.runs.run import run

NONLINEAR = [name for name in catalogue() if not parse(name).family.linear_only]
MEMBERS = (
    "newmark:beta=0.3025:gamma=0.6", "generalized-alpha:rho_inf=0", "hht:alpha=-1/3", "u0v0:r=0",
    "collocation:beta=0.18", "bathe:rho_inf=0.5", "bathe:gamma=0.5", "kr-alpha:rho_inf=0.5",
    "impulse4:rho_inf=0.5", "impulse4:rho_inf=0", "moment4:rho_inf=0.5", "moment4:rho_inf=0",
)  # fmt: skip


@pytest.fixture(scope="module")
def problem():
    """Return a function that creates the order problem of a load and a law, and caches it."""
    solved = {}

    def get(load, law):
        if (load, law) not in solved:
            solved[load, law] = order_problem(load, law)
        return solved[load, law]

    return get


@pytest.mark.parametrize(
    ("law", "method"),
    every(
        2,
        [
            *(("linear", method) for method in (*catalogue(), *MEMBERS)),
            *(("polynomial", method) for method in (*NONLINEAR, *MEMBERS)),
        ],
    ),
)
def test_observed_order_is_declared_order(problem, law, method):
    integrator = parse(method)
    observed = observed_order(integrator, problem("harmonic", law), OBSERVED_HALVINGS - 1)
    for quantity in ("displacement", "velocity", "acceleration"):
        assert observed.order(quantity) == pytest.approx(integrator.order, abs=0.1), quantity


@pytest.mark.parametrize(
    ("load", "law", "published"),
    [
        ("harmonic", "linear", 2), ("free", "polynomial", 2), ("harmonic", "polynomial", 2),
        ("record", "polynomial", 2), ("record", "linear", 4), ("free", "linear", 4),
    ],
)  # fmt: skip
def test_order_of_impulse_and_impulse4_by_load_and_law(problem, load, law, published):
    """The trapezoidal impulse is exact for sampled records; the tangent form of the drift laws is
    of order 2."""
    for method, order in (("impulse", published), ("impulse4", 4)):
        observed = observed_order(parse(method), problem(load, law))
        for quantity in ("displacement", "velocity", "acceleration"):
            assert observed.order(quantity) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize(
    ("method", "order"),
    [
        *(
            (method, 1.0)
            for method in ("hht", "wbz", "generalized-alpha:rho_inf=0.5", "u0v0", "kr-alpha")
        ),
        ("newmark", 2.0),
        *((method, np.nan) for method in ("gauss4", "impulse", "houbolt", "exact")),
    ],
)
def test_algorithmic_acceleration_of_alpha_methods_is_of_order_1(problem, method, order):
    """The acceleration from equilibrium has the order of the method; other methods have no
    algorithmic acceleration."""
    observed = observed_order(parse(method), problem("free", "linear"))
    assert np.isnan(observed.algorithmic_acceleration).all() == math.isnan(order)
    assert observed.order("algorithmic_acceleration") == pytest.approx(order, abs=0.25, nan_ok=True)
    if order == 1.0:
        assert observed.order("acceleration") == pytest.approx(2.0, abs=0.05)


def test_rounding_errors_have_no_order(problem):
    observed = observed_order(parse("exact"), problem("record", "linear"))
    assert np.isnan(observed.order("displacement"))
    assert observed.displacement[-1] < 1e-12
    assert observed_order(parse("exact"), problem("harmonic", "linear")).order(
        "displacement"
    ) == pytest.approx(2.0, abs=0.01)


def test_order_is_slope_of_finest_three_steps():
    steps = 0.02 / 2.0 ** np.arange(5)
    errors = np.where(steps > 0.004, 1.0, steps**3)
    observed = ObservedOrder(
        "x", "free", "linear", np.nan, steps, errors, steps**2, steps, 1e-13 * steps
    )
    assert observed.order("displacement") > 3.0
    assert observed.order("velocity") == pytest.approx(2.0)
    assert np.isnan(observed.order("algorithmic_acceleration"))


def test_observed_order_reports_steps_and_names(problem):
    observed = observed_order(parse("newmark-average"), problem("free", "linear"))
    assert observed.steps == pytest.approx(0.02 / 2.0 ** np.arange(OBSERVED_HALVINGS + 1))
    assert (observed.method, observed.load, observed.law) == ("newmark-average", "free", "linear")
    assert np.isnan(observed.frequency_ratio)
    assert order_problem("harmonic", "linear", 2.0).frequency_ratio == 2.0


@pytest.mark.parametrize("law", STORY_LAWS)
@pytest.mark.parametrize("load", LOADS)
def test_exact_motion_satisfies_equation_of_motion(problem, load, law):
    """An independent integration over a sampling interval, from the exact state at its start, gives
    the exact state at its end."""
    solved = problem(load, law)
    h, omega = 0.02, 2.0 * np.pi
    for sample in (0, 57, 199):
        ground = solved.ground[sample : sample + 2] if load == "record" else np.zeros(2)

        def acceleration(t, u, v, start=sample * h, ground=ground):
            force = 20.0 * np.cos(0.5 * omega * (start + t)) if load == "harmonic" else 0.0
            force -= np.interp(t, [0.0, h], ground)
            spring = u + 0.5 * u**3 if law == "polynomial" else u
            return force - 0.04 * omega * v - omega**2 * spring

        u, v, a = solved.exact[:, sample]
        assert a == pytest.approx(acceleration(0.0, u, v), rel=1e-9, abs=1e-9)
        np.testing.assert_allclose(
            smooth(acceleration, u, v, [0.0, h])[:, -1],
            solved.exact[:2, sample + 1],
            rtol=1e-11,
            atol=1e-12,
        )


@pytest.mark.parametrize(
    ("load", "law", "stride", "message"),
    [
        ("sinus", "linear", 1, "harmonic, record .* linear, polynomial"),
        ("free", "bilinear", 1, "harmonic, record .* linear, polynomial"),
        ("record", "linear", 3, "stride"),
        ("record", "linear", 0, "stride"),
        ("harmonic", "linear", 2, "stride"),
    ],
)
def test_invalid_order_problems_are_refused(load, law, stride, message):
    with pytest.raises(UsageError, match=message):
        order_problem(load, law, stride=stride)


def test_linear_method_is_refused_for_nonlinear_law(problem):
    with pytest.raises(UsageError, match="exact supports linear buildings only"):
        observed_order(parse("exact"), problem("free", "polynomial"))


# ---- Special cases in which two methods are equal


LINEAR_BUILDING = model(
    [story(2e5, 3e8), story(1.5e5, 2.5e8, dashpot=4e5), story(1e5, 1.5e8)],
    damping=RayleighRatio((0.05, 0.05), (1, 3)),
    displacement=(0.01, 0.0, 0.02),
    velocity=(0.3, 0.1, 0.0),
)
DUFFING = (40.0, 0.0, 200.0)  # f = 40 u + 200 u^3


def history(case, method, record=None, **more):
    """Return the displacements, velocities and accelerations at the steps."""
    result = run(case, record, method=method, history=True, **more).history
    return result.displacement, result.velocity, result.absolute_acceleration


def assert_same(history, expected, tolerance=1e-10):
    for a, b in zip(history, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=tolerance * np.max(np.abs(b)))


@pytest.mark.parametrize(
    ("law", "methods"),
    [
        (
            "linear",
            ("newmark", "generalized-alpha:rho_inf=1", "hht:alpha=0", "wbz:rho_inf=1", "u0v0:r=1"),
        ),
        ("duffing", ("newmark", "hht:alpha=0", "wbz:rho_inf=1")),
    ],
)
def test_methods_equal_to_average_acceleration(law, methods):
    """The methods are equal under ground motion and, for a linear building, also under a force."""
    forced = replace(LINEAR_BUILDING, excitation=Excitation(None, (Force(3, 2e5, -1e5, 9.0),)))
    case = duffing() if law == "duffing" else forced
    average = history(case, "newmark-average", noise(201))
    for method in methods:
        assert_same(history(case, method, noise(201)), average)


def test_impulse4_equals_impulse_in_linear_building_under_record():
    assert_same(
        history(LINEAR_BUILDING, "impulse4", noise(401)),
        history(LINEAR_BUILDING, "impulse", noise(401)),
    )


def duffing():
    law = Law("polynomial", DUFFING)
    return model([story(1.0, DUFFING[0], law, dashpot=0.5)], displacement=(0.3,), velocity=(1.0,))


def radau_iia(rate, y, h, steps):
    """Integrate with the two-stage method Radau IIA of order 3 (Ehle 1969); the stages are found by
    fixed-point iteration. Shape (steps + 1, y.size)."""
    c, a = (1.0 / 3.0, 1.0), np.array([[5.0, -1.0], [9.0, 3.0]]) / 12.0
    result = [np.asarray(y)]
    for step in range(steps):
        slopes = np.zeros((2, len(y)))
        for _ in range(30):  # each iteration reduces the error of the stages by a factor of ten
            stages = result[-1] + h * a @ slopes
            slopes = np.array(
                [rate((step + part) * h, stage) for part, stage in zip(c, stages, strict=True)]
            )
        result.append(stages[1])
    return np.array(result)


@pytest.mark.parametrize("law", ["linear", "duffing"])
def test_impulse4_with_rho_inf_0_is_radau_iia(law):
    record, omega = noise(101), 2.0 * np.pi
    case = (
        duffing()
        if law == "duffing"
        else oscillator(omega, 0.05, displacement=(0.3,), velocity=(1.0,))
    )

    def rate(t, y):
        u, v = y
        ground = np.interp(t, record.dt * np.arange(101), record.acceleration)
        if law == "duffing":
            return np.array([v, -ground - 0.5 * v - DUFFING[0] * u - DUFFING[2] * u**3])
        return np.array([v, -ground - 0.1 * omega * v - omega**2 * u])

    u, v, _ = history(case, "impulse4:rho_inf=0", record)
    expected = radau_iia(rate, (0.3, 1.0), record.dt, 100)
    # The residual tolerance of impulse4 is of order 4 in the time step for nonlinear laws.
    assert_same((u[:, 0], v[:, 0]), expected.T, 1e-8 if law == "duffing" else 1e-10)


def test_order_with_several_samples_per_step():
    """The coarsest step contains 32 samples and the finest two. tests/methods/test_long_steps.py
    tests all methods."""
    observed = observed_order(parse("hht"), order_problem("record", "linear", stride=32))
    assert observed.order("displacement") == pytest.approx(2.0, abs=0.25)
    assert np.isnan(observed.order("algorithmic_acceleration"))
