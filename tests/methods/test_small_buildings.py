"""Buildings with two stories compared with an independent solution by SciPy.

The equations of motion, with laws in ordinary Python, are integrated by `solve_ivp` with a
tolerance far below the errors of the methods. The tests need no compiled loops. The stored results
of tests/kernels/test_stored_results.py are results of the same buildings.
"""

import itertools
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from selection import every
from small_buildings import BUILDINGS, LAWS, MOTION, STIFFNESS
from tdint import load_model, run

GRAVITY = 9.80665  # m/s^2


def elastic_force(law, stiffness):
    """Return the force of an elastic law as a function of the drift, or None for other laws."""
    if law is None:
        return lambda d: stiffness * d
    if law["type"] == "tanh":
        return lambda d: law["strength"] * np.tanh(stiffness * d / law["strength"])
    if law["type"] == "gap":
        return lambda d: (
            stiffness * d + law["stop_stiffness"] * np.sign(d) * max(abs(d) - law["gap"], 0.0)
        )
    if law["type"] == "polynomial":
        return lambda d: sum(c * d**p for p, c in enumerate(law["coefficients"], start=1))
    return None


def hysteretic_rate(law, stiffness, z, rate):
    """Return the rate of the hysteretic force z of a bilinear or Bouc-Wen law, N/s.

    Parameters
    ----------
    law : dict
        Law as in the model file.
    stiffness : float
        Initial stiffness of the story, N/m.
    z : float
        Hysteretic force without the hardening part, N.
    rate : float
        Rate of the drift, m/s.
    """
    part = 1.0 - law["hardening"]
    strength = part * law["yield_force"]
    if law["type"] == "bilinear":
        if z < 0.0 and "negative" in law:
            strength = part * law["negative"]["yield_force"]
        return 0.0 if abs(z) >= strength and z * rate > 0.0 else part * stiffness * rate
    beta = law["beta"]
    loss = abs(z / strength) ** law["exponent"] * (beta * np.sign(z * rate) + 1.0 - beta)
    return (1.0 - loss) * part * stiffness * rate


@cache
def solution(name):
    """Return the displacements and velocities of a building at the samples of `MOTION`."""
    definition = BUILDINGS[name]
    stories = definition["stories"]
    laws = [story.get("law") for story in stories]
    masses = np.array([story["mass"] for story in stories])
    springs = np.array([story.get("stiffness", STIFFNESS) for story in stories])
    difference = np.eye(2) - np.eye(2, k=-1)  # drifts from displacements
    stiffness = difference.T @ np.diag(springs) @ difference

    # Linear viscous damping: damping ratios in both modes, or Rayleigh coefficients, and dashpots
    damping = definition["damping"]
    if isinstance(damping, float):
        omega = np.sqrt(np.sort(np.linalg.eigvals(stiffness / masses[:, None]).real))
        scale = 2.0 * damping / omega.sum()
        damping = {"rayleigh": {"mass": scale * omega.prod(), "stiffness": scale}}
    rayleigh = damping["rayleigh"]
    viscous = rayleigh["mass"] * np.diag(masses) + rayleigh["stiffness"] * stiffness
    dashpots = np.array([story.get("dashpot", 0.0) for story in stories])
    viscous = viscous + difference.T @ np.diag(dashpots) @ difference
    weights = GRAVITY * np.cumsum(masses[::-1])[::-1]
    p_delta = definition.get("p_delta", False) * weights / [story["height"] for story in stories]

    forces = definition.get("excitation", {}).get("forces", [])
    elastic = [elastic_force(*pair) for pair in zip(laws, springs, strict=True)]
    times = MOTION.dt * np.arange(MOTION.acceleration.size)

    def derivative(t, y):
        u, v, z = y[:2], y[2:4], y[4:]
        drift, rate = difference @ u, difference @ v
        z_rate, shear = np.zeros(2), -p_delta * drift
        for i, law in enumerate(laws):
            if elastic[i]:
                shear[i] += elastic[i](drift[i])
            else:
                z_rate[i] = hysteretic_rate(law, springs[i], z[i], rate[i])
                shear[i] += law["hardening"] * springs[i] * drift[i] + z[i]
        load = -masses * np.interp(t, times, MOTION.acceleration)
        for force in forces:
            wave = np.cos if force["phase"] == "cos" else np.sin
            load[force["floor"] - 1] += force["amplitude"] * wave(force["omega"] * t)
        return [*v, *((load - viscous @ v - difference.T @ shear) / masses), *z_rate]

    # Bilinear stories have yielded if the initial drift exceeds the yield drift.
    initial = definition.get("initial", {"displacement": [0.0, 0.0], "velocity": [0.0, 0.0]})
    drift = difference @ initial["displacement"]
    hysteretic = [
        0.0
        if force
        else (1.0 - law["hardening"])
        * np.clip(spring * story_drift, -law["yield_force"], law["yield_force"])
        for force, law, spring, story_drift in zip(elastic, laws, springs, drift, strict=True)
    ]
    y = np.array([*initial["displacement"], *initial["velocity"], *hysteretic])
    states = [y]
    for begin, end in itertools.pairwise(times):  # The load has a kink at each sample.
        y = solve_ivp(derivative, (begin, end), y, rtol=1e-9, atol=1e-12, max_step=MOTION.dt / 8).y[
            :, -1
        ]
        states.append(y)
    return np.array(states)[:, :4]


def error(name, method, parts):
    """Return the error of the displacements and velocities at the samples, relative to their
    maximum, with `parts` time steps in a sampling interval."""
    history = run(
        load_model(BUILDINGS[name]),
        MOTION,
        method=method,
        dt=MOTION.dt / parts,
        duration=MOTION.duration,
        history=True,
        check=False,
    ).history
    expected = solution(name)
    return max(
        np.max(np.abs(found[::parts] - wanted)) / np.max(np.abs(wanted))
        for found, wanted in (
            (history.displacement, expected[:, :2]),
            (history.velocity, expected[:, 2:]),
        )
    )


SOLVED = [
    name
    for name in ("elastic", "forces", *LAWS)
    if all(
        "law" not in story
        or story["law"]["type"] in ("bilinear", "bouc-wen", "gap", "tanh", "polynomial")
        for story in BUILDINGS[name]["stories"]
    )
]


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
@pytest.mark.parametrize("name", every(3, SOLVED))
def test_order_4_is_observed_with_nonlinear_stories(name, method):
    """With a quarter of the time step, the error is less than 1/30; 1/15 for falling lines with
    moment4, which does not locate branch changes."""
    coarse, fine = error(name, method, 1), error(name, method, 4)
    assert coarse < (0.03 if name in ("gap", "polynomial") else 2e-3)
    assert fine < min(coarse / (15.0 if name == "falling" else 30.0), 2e-4)


@pytest.mark.parametrize(
    "method", ["newmark-average", "bathe", "noh-bathe", "impulse", "gauss4", "hht", "park"]
)
@pytest.mark.parametrize("name", every(2, ["forces", "bilinear", "bouc-wen", "tanh"]))
def test_order_2_is_observed_with_nonlinear_stories(name, method):
    """With a quarter of the time step, the error decreases to less than a fifth."""
    coarse, fine = error(name, method, 1), error(name, method, 4)
    assert coarse < 0.15
    assert fine < coarse / 5.0


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
@pytest.mark.parametrize(
    "name", ["kinematic", "isotropic", "origin", "peak", "hook", "ramberg-osgood"]
)
def test_order_4_is_observed_between_two_methods(name, method):
    """The reference is the other method with a 32nd of the step. impulse4 locates all branch
    changes, and its error decreases by 150 to 270 with a quarter of the step."""
    other = {"impulse4": "moment4", "moment4": "impulse4"}[method]

    def displacement(method, parts):
        history = run(
            load_model(BUILDINGS[name]),
            MOTION,
            method=method,
            dt=MOTION.dt / parts,
            duration=MOTION.duration,
            history=True,
            check=False,
        ).history
        return history.displacement[::parts]

    expected = displacement(other, 32)
    coarse, fine = (
        np.max(np.abs(displacement(method, parts) - expected)) / np.max(np.abs(expected))
        for parts in (1, 4)
    )
    assert coarse < 5e-4
    assert fine < coarse / (100.0 if method == "impulse4" else 30.0)
