"""Public models whose laws are plug-ins (tests/methods/recipes), against
`scipy.integrate.solve_ivp`: Bouc-Wen with a gamma of its own, and asymmetric; and a self-centering
oscillator."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tdint
from registered import forgotten  # noqa: F401
from registered import plain as interpreted  # noqa: F401
from tdint.model import law_checks

RECIPES = Path(__file__).parents[2] / "methods/recipes"
TIME = 0.01 * np.arange(301)
MOTION = 2.4 * np.sin(6.1 * TIME) * np.exp(-0.3 * TIME) + 1.1 * np.sin(13.0 * TIME)
RECORD = tdint.make_record(MOTION, dt=0.01, units="m/s^2")
BOUC_WEN = {
    "gamma above beta": {"beta": 0.2, "gamma": 0.8},
    "stiffening": {"exponent": 1.0, "beta": 0.8, "gamma": -1.1},  # of Noel and Schoukens
    "asymmetric": {"beta": 0.6, "gamma": 0.3, "direction": 0.15, "side": -0.05},
}


SAMPLES = [*MOTION.tolist(), 0.0]


@pytest.fixture(autouse=True)
def short_paths(monkeypatch):
    """Verify the laws of the plug-ins up to a drift of 0.1 m, five times the drift at yielding: the
    path to 1 m, with 2500 substeps for each rise, took most of the time of each test."""
    monkeypatch.setattr(law_checks, "_DECADES", law_checks._DECADES[:4])


def ground(t):
    """Return the acceleration between the samples, as `np.interp`, which takes ten times as long
    for a single number."""
    i, rest = divmod(t / 0.01, 1.0)
    return SAMPLES[int(i)] + rest * (SAMPLES[int(i) + 1] - SAMPLES[int(i)])


def sign(x):
    return (x > 0.0) - (x < 0.0)


@pytest.mark.parametrize("name", BOUC_WEN)
def test_bouc_wen(name, interpreted):  # noqa: F811
    tdint.load_plugin(RECIPES / "general_bouc_wen.py")
    numbers = {"beta": 0.0, "gamma": 0.0, "direction": 0.0, "side": 0.0, **BOUC_WEN[name]}
    mass, k, a, strength, dashpot = 2e3, 1e5, 0.1, 2e3, 1e3
    n = BOUC_WEN[name].get("exponent", 1.4)
    law = {"type": "general-bouc-wen", "force": strength, "hardening": a, "exponent": n}
    story = {"mass": mass, "stiffness": k, "dashpot": dashpot, "law": law | BOUC_WEN[name]}
    model = tdint.load_model({"stories": [story], "plausibility": "off, test"})

    beta, gamma, direction, side = (numbers[key] for key in ("beta", "gamma", "direction", "side"))

    def rate(t, y):
        u, v, z = y.tolist()
        p = beta * sign(v * z) + gamma + direction * sign(v) + side * sign(z)
        change = (1.0 - a) * k * v * (1.0 - abs(z / strength) ** n * p)
        force = a * k * u + z + dashpot * v
        return [v, -force / mass - ground(t), change]

    solution = solve_ivp(
        rate, (0.0, 3.0), [0.0] * 3, rtol=1e-8, atol=1e-8, max_step=0.01, t_eval=TIME
    )
    history = tdint.run(
        model, RECORD, method="newmark-average", dt=0.0025, history=True, check=False
    ).history
    peak = np.abs(solution.y[0]).max()
    computed = history.displacement[: 4 * TIME.size : 4, 0][: TIME.size]
    np.testing.assert_allclose(computed, solution.y[0], rtol=0.0, atol=1e-3 * peak)
    # The hysteresis matters: without it, z would be (1 - a) k u.
    assert np.abs(solution.y[2] - (1.0 - a) * k * solution.y[0]).max() > 0.3 * strength


def test_law_that_stiffens_without_a_limit(interpreted, monkeypatch):  # noqa: F811
    """With beta + gamma = -1, the force is infinite at a drift of pi / 2 times F / ((1 - a) k),
    which the path of its check to 1 m exceeds."""
    monkeypatch.setattr(law_checks, "_DECADES", (*law_checks._DECADES, 1.0))
    tdint.load_plugin(RECIPES / "general_bouc_wen.py")
    a, strength, beta, gamma = 0.5, 0.5, 0.5, -1.5
    law = {"type": "general-bouc-wen", "force": strength, "hardening": a, "exponent": 2.0}
    story = {"mass": 1.0, "stiffness": 1.0, "dashpot": 0.2}
    model = tdint.load_model({"stories": [{**story, "law": {**law, "beta": beta, "gamma": gamma}}]})
    times = 0.02 * np.arange(300)
    motion = tdint.make_record(0.05 * np.sin(1.3 * times), dt=0.02, units="m/s^2")

    def rate(t, y):
        u, v, z = y.tolist()
        force = 0.2 * v + a * u + (1.0 - a) * z
        shape = beta * sign(v * z) + gamma
        change = v * (1.0 - abs((1.0 - a) * z / strength) ** 2 * shape)
        return [v, -np.interp(t, times, motion.acceleration) - force, change]

    options = {"rtol": 1e-9, "atol": 1e-11, "max_step": 0.02, "t_eval": times}
    right = solve_ivp(rate, (0.0, times[-1]), [0.0] * 3, **options).y[0]
    found = tdint.run(model, motion, history=True, check=False).history.displacement[:300, 0]
    np.testing.assert_allclose(found, right, rtol=0.0, atol=1e-3 * np.abs(right).max())


@pytest.mark.slow
def test_nine_stories_with_gamma_above_beta_and_compiled_loops():
    """A reduced model of nine stories whose Bouc-Wen laws have a gamma above beta."""
    tdint.load_plugin(RECIPES / "general_bouc_wen.py")
    mass, dashpot, a, n, beta, gamma = 2e3, 1e4, 0.1, 1.4, 0.2, 0.8
    k = np.linspace(4e6, 2e6, 9)
    strength = np.linspace(2.5e4, 6e3, 9)
    law = {"type": "general-bouc-wen", "hardening": a, "exponent": n, "beta": beta, "gamma": gamma}
    stories = [
        {"mass": mass, "stiffness": k_i, "dashpot": dashpot, "law": law | {"force": strength_i}}
        for k_i, strength_i in zip(k.tolist(), strength.tolist(), strict=True)
    ]
    model = tdint.load_model({"stories": stories, "plausibility": "off, test"})

    def rate(t, y):
        u, v, z = y.reshape(3, 9)
        drift, drift_rate = np.diff(u, prepend=0.0), np.diff(v, prepend=0.0)
        shape = beta * np.sign(drift_rate * z) + gamma
        change = (1.0 - a) * k * drift_rate * (1.0 - np.abs(z / strength) ** n * shape)
        force = a * k * drift + z + dashpot * drift_rate
        return np.concatenate([v, np.diff(force, append=0.0) / mass - ground(t), change])

    solution = solve_ivp(
        rate, (0.0, 3.0), np.zeros(27), rtol=1e-8, atol=1e-8, max_step=0.01, t_eval=TIME
    )
    drifts = np.diff(solution.y[:9], axis=0, prepend=0.0).T
    peaks = np.abs(drifts).max(axis=0)
    history = tdint.run(
        model, RECORD, method="newmark-average", dt=0.000625, history=True, check=False
    ).history
    displacements = history.displacement[: 16 * TIME.size : 16][: TIME.size]
    computed = np.diff(displacements, axis=1, prepend=0.0)
    np.testing.assert_allclose(computed / peaks, drifts / peaks, rtol=0.0, atol=1e-3)
    assert (np.abs(solution.y[18:]).max(axis=1) > 0.5 * strength).all()


def test_self_centering_oscillator(interpreted):  # noqa: F811
    compare_self_centering_oscillator()


@pytest.mark.slow
def test_self_centering_oscillator_with_compiled_loops():
    compare_self_centering_oscillator()


def compare_self_centering_oscillator():
    """The flag is a multilinear law with rounded corners in the reference: a small viscous spring
    decides between its two lines."""
    tdint.load_plugin(RECIPES / "flag.py")
    mass, k, strength, a, loss = 2e3, 1e5, 2e3, 0.05, 0.6
    law = {"type": "flag", "yield_force": strength, "hardening": a, "loss": loss}
    story = {"mass": mass, "stiffness": k, "dashpot": 1e3, "law": law}
    model = tdint.load_model({"stories": [story], "plausibility": "off, test"})
    width = loss * strength  # the spring s slides between 0 and the width of the flag

    def force_of(u, f_before, du):
        """Force after a small change of the displacement."""
        dy, side = strength / k, sign(u) or 1.0
        upper = max(k * dy + a * k * (abs(u) - dy), 0.0)
        lower = upper - width
        elastic = f_before * side + k * du * side
        return side * (min(k * abs(u), max(lower, min(upper, elastic))))

    u, v, f, peak, h = 0.0, 0.0, 0.0, 0.0, 2e-5
    displacement = [0.0]
    for step in range(1, 150_001):
        v += h * (-(f + 1e3 * v) / mass - ground((step - 0.5) * h))
        f = force_of(u + h * v, f, h * v)
        u += h * v
        peak = max(peak, abs(u))
        if step % 500 == 0:
            displacement.append(u)
    result = tdint.run(
        model, RECORD, method="newmark-average", dt=0.0025, history=True, check=False
    )
    computed = result.history.displacement[: 4 * TIME.size : 4, 0][: TIME.size]
    np.testing.assert_allclose(computed, displacement, rtol=0.0, atol=3e-3 * peak)
    assert peak > 3.0 * strength / k
