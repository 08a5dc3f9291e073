"""What the tests of several families measure on the compiled steps, and dense matrices to compare with."""

from __future__ import annotations

from functools import cache

import numpy as np
from building_cases import Force, Law, ModalDamping, model, oscillator, story
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from tdint.analysis.amplification import amplification
from tdint.analysis.response import run
from tdint.methods.catalogue import parse

U0, V0 = 0.3, 1.0
FORCE = Force(1, 3.0, 2.0, 5.0)
CUBIC = (40.0, 30.0, 200.0)  # f = 40 u + 30 u^2 + 200 u^3


def _smooth(name):
    """A driven oscillator with a damper, 1 kg, from a displacement and a velocity."""
    start = {"forces": [FORCE], "displacement": (U0,), "velocity": (V0,)}
    if name == "linear":
        return oscillator(2.0 * np.pi, 0.05, **start)
    return model([story(1.0, CUBIC[0], Law("polynomial", CUBIC), dashpot=0.5)], **start)


@cache
def _exact(name):
    """u, v, a of `_smooth` as a function of time, by DOP853."""
    omega = 2.0 * np.pi

    def acceleration(t, u, v):
        load = FORCE.cosine * np.cos(FORCE.omega * t) + FORCE.sine * np.sin(FORCE.omega * t)
        if name == "linear":
            return load - 0.1 * omega * v - omega**2 * u
        return load - 0.5 * v - (CUBIC[0] * u + CUBIC[1] * u**2 + CUBIC[2] * u**3)

    solution = solve_ivp(
        lambda t, x: (x[1], acceleration(t, *x)), (0.0, 1.0), (U0, V0), "DOP853", rtol=1e-12, atol=1e-12,
        dense_output=True,
    )  # fmt: skip

    def motion(t):
        u, v = solution.sol(t)
        return u, v, acceleration(t, u, v)

    return motion


def errors(method, case, steps):
    """Largest errors of u, v, a over one second in `steps` steps."""
    history = run(_smooth(case), method=method, dt=1.0 / steps, duration=1.0, history=True).history
    got = (history.displacement, history.velocity, history.acceleration)
    return np.array([np.max(np.abs(x[:, 0] - y)) for x, y in zip(got, _exact(case)(history.time), strict=True)])


def orders(method, case, steps=320):
    """Orders of u, v, a from `steps` and twice as many steps."""
    return np.log2(errors(method, case, steps) / errors(method, case, 2 * steps))


def period_error_and_damping(method):
    """Elongation of the period and numerical damping ratio of an undamped oscillator at h/T = 0.1, in percent."""
    omega_h = 0.2 * np.pi
    roots = np.linalg.eigvals(amplification(parse(method), np.array([omega_h]), np.zeros(1), 1.0)[0])
    exponent = np.log(roots[np.argmax(roots.imag)])
    return 100.0 * (omega_h / exponent.imag - 1.0), -100.0 * exponent.real / abs(exponent)


def building(damping=None, nonlinear=False, **more):
    """Four unequal stories with P-delta, a dashpot and a floor force."""
    masses, springs = (2e5, 1.5e5, 1.8e5, 1e5), (3e8, 2.5e8, 2.5e8, 1.5e8)
    laws = [Law("polynomial", (k, 0.0, 40.0 * k)) for k in springs] if nonlinear else [Law("linear", ())] * 4
    stories = [story(m, k, law, height=3.0) for m, k, law in zip(masses, springs, laws, strict=True)]
    if not isinstance(damping, ModalDamping):
        stories[2] = story(masses[2], springs[2], laws[2], height=3.0, dashpot=4e5)
        more |= {"p_delta": True, "forces": [Force(3, 2e5, -1e5, 9.0)]}
    return model(stories, damping=damping, displacement=(0.01, 0.0, 0.02, 0.03), velocity=(0.3, 0.1, 0.0, 0.5), **more)


def matrices(model):
    """M, K and the matrix of the dashpots, written out; weights are those above a story, over its height."""
    mass = np.array([s.mass for s in model.stories])
    spring = np.array([s.stiffness for s in model.stories])
    if model.p_delta:
        spring = spring - 9.80665 * np.cumsum(mass[::-1])[::-1] / [s.height for s in model.stories]
    drift = np.eye(mass.size) - np.eye(mass.size, k=-1)
    dashpot = drift.T @ np.diag([s.dashpot for s in model.stories]) @ drift
    return np.diag(mass), drift.T @ np.diag(spring) @ drift, dashpot


def load(model, record, t):
    """Load on the floors at time t, N."""
    ground = np.interp(t, record.dt * np.arange(record.acceleration.size), record.acceleration)
    p = -np.array([s.mass for s in model.stories]) * ground
    for f in model.excitation.forces:
        p[f.floor - 1] += f.cosine * np.cos(f.omega * t) + f.sine * np.sin(f.omega * t)
    return p


def superposed(method, model, ratio, record):
    """Displacements of a linear building, shape (steps + 1, n): the same steps on its modes, as oscillators.

    `ratio` is the damping ratio of a mode as a function of its omega.
    """
    M, K, _ = matrices(model)
    squares, shapes = eigh(K, M)
    total = 0.0
    for omega, shape in zip(np.sqrt(squares), shapes.T, strict=True):
        factor = shape @ M @ np.ones(shape.size)
        u0, v0 = (shape @ M @ np.array([model.initial.displacement, model.initial.velocity]).T) / factor
        start = {"displacement": (u0,), "velocity": (v0,)}
        mode = run(oscillator(omega, ratio(omega), **start), record, method=method, history=True).history
        total = total + factor * mode.displacement * shape
    return total
