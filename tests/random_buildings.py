"""Random buildings: in free vibration, conservative or dissipating by their drift laws alone; under a random motion, of
all laws that are linear branch by branch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from building_cases import LINEAR, Law, ModalDamping, RayleighCoefficients, model, noise, story
from tdint.model.building import assemble

BEND = 0.02
"""Drift at which laws bend, about, m."""


def _polynomial(rng, k):
    """Hardening, with a positive tangent everywhere."""
    cubic = rng.uniform(0.1, 3.0) * k / BEND**2
    return Law("polynomial", (k, rng.uniform(-1.0, 1.0) * np.sqrt(k * cubic), cubic))


def _gap(rng, k):
    return Law("gap", (BEND * rng.uniform(0.2, 1.0), k * rng.uniform(1.0, 30.0)))


CONSERVATIVE = {
    "polynomial": _polynomial,
    "gap": _gap,
    "tanh": lambda rng, k: Law("tanh", (BEND * k * rng.uniform(0.5, 2.0),)),
    "linear": lambda rng, k: Law("linear", ()),
}
HYSTERETIC = {
    "bilinear": lambda rng, k: Law("bilinear", (BEND * k * rng.uniform(0.2, 1.0), rng.uniform(0.0, 0.3))),
    "peak-oriented": lambda rng, k: Law(
        "peak-oriented", (BEND * k * rng.uniform(0.2, 1.0), rng.uniform(0.01, 0.3), rng.uniform(0.0, 0.9))
    ),
    "linear": lambda rng, k: Law("linear", ()),
}


def random_building(rng, laws):
    """A building of one to eight stories of laws drawn from `laws`, sometimes with P-delta, let go with drifts of up to
    a few times those at which it bends; and its fundamental period, s."""
    n = int(rng.integers(1, 9))
    masses = 1e5 * rng.uniform(0.5, 2.0, n)
    springs = 1e8 * rng.uniform(0.5, 2.0, n) * np.linspace(1.5, 0.7, n)
    names = rng.choice(list(laws), n)
    stories = [story(m, k, laws[name](rng, k), height=3.0) for m, k, name in zip(masses, springs, names, strict=True)]
    drifts = BEND * rng.uniform(-3.0, 3.0, n)
    rates = rng.uniform(-0.5, 0.5, n)
    built = model(
        stories,
        displacement=tuple(np.cumsum(drifts)),
        velocity=tuple(np.cumsum(rates)),
        p_delta=bool(rng.random() < 0.4),
    )
    return built, 2.0 * np.pi / assemble(built).modes().omega[0]


def _imk(rng, strength, drift):
    hardening = (drift * rng.uniform(2.0, 6.0), drift * rng.uniform(10.0, 30.0), rng.uniform(1.0, 1.3))
    side = (strength, *hardening, rng.uniform(0.0, 0.4), 100.0 * drift, 1.0)
    pinching = rng.uniform(0.2, 0.8, 2) if rng.random() < 0.5 else (1.0, 1.0)
    capacity = drift * rng.uniform(20.0, 200.0) if rng.random() < 0.7 else np.inf
    return Law("imk", (*side, *side, *4 * [capacity], 1.0, *pinching))


def _trilinear(rng, strength, drift):
    ultimate = (strength * rng.uniform(1.0, 2.0), drift * rng.uniform(4.0, 12.0))
    return Law("trilinear-pinching", (strength, *ultimate, rng.uniform(0.2, 1.0), rng.uniform(0.0, 0.4)))


PIECEWISE = {
    "bilinear": lambda rng, strength, drift: Law("bilinear", (strength, rng.uniform(0.0, 0.3))),
    "peak-oriented": lambda rng, strength, drift: Law(
        "peak-oriented", (strength, rng.uniform(0.0, 0.2), rng.uniform(0.0, 0.5))
    ),
    "gap": lambda rng, strength, drift: Law(
        "gap", (drift * rng.uniform(0.5, 1.5), strength / drift * rng.uniform(1.0, 20.0))
    ),
    "trilinear-pinching": _trilinear,
    "imk": _imk,
}


def piecewise_building(rng):
    """A building of one to seven stories of laws drawn from `PIECEWISE`, a third of them isolated, with P-delta in two
    of five, and a motion that takes it far beyond the drifts at which they bend."""
    n = int(rng.integers(1, 7))
    isolated = rng.random() < 0.35
    period = rng.uniform(0.1, 0.25) * n**0.75 + 0.1
    masses = 1e5 * rng.uniform(0.7, 1.4, n)
    springs = (2.0 * np.pi / period) ** 2 * masses.mean() * (n + 1) ** 2 / 2.5 * np.linspace(1.5, 0.7, n)
    springs *= rng.uniform(0.8, 1.2, n)
    above = np.cumsum(masses[::-1])[::-1]
    strengths = rng.uniform(0.08, 0.3) * 9.81 * above * rng.uniform(0.8, 1.2, n)
    if isolated:
        masses = np.append(1e5, masses)
        springs = np.append((2.0 * np.pi / rng.uniform(0.8, 1.5)) ** 2 * masses.sum(), 5.0 * springs)
        strengths = np.append(rng.uniform(0.03, 0.08) * 9.81 * masses.sum(), 3.0 * strengths)
    names = rng.choice(list(PIECEWISE), len(springs))
    stories = [
        story(m, k, PIECEWISE[name](rng, f, f / k), height=3.2, dashpot=rng.uniform(0.01, 0.06) * np.sqrt(m * k))
        for m, k, f, name in zip(masses, springs, strengths, names, strict=True)
    ]
    motion = noise(samples=601, peak=rng.uniform(3.0, 8.0), seed=int(rng.integers(1 << 30)))
    return model(stories, p_delta=bool(rng.random() < 0.4)), motion


def shaken_building(rng, laws=("linear", "tanh", "polynomial", "bouc-wen"), samples=601):
    """A building of one to six stories of smooth laws, and a motion that takes it beyond where they bend."""
    n = int(rng.integers(1, 7))
    period = rng.uniform(0.1, 0.25) * n**0.75 + 0.1
    masses = 1e5 * rng.uniform(0.7, 1.4, n)
    springs = (2.0 * np.pi / period) ** 2 * masses.mean() * (n + 1) ** 2 / 2.5 * np.linspace(1.5, 0.7, n)
    springs *= rng.uniform(0.8, 1.2, n)
    strengths = rng.uniform(0.08, 0.3) * 9.81 * np.cumsum(masses[::-1])[::-1]
    smooth = {
        "linear": lambda k, f: Law("linear", ()),
        "tanh": lambda k, f: Law("tanh", (1.5 * f,)),
        "polynomial": lambda k, f: Law("polynomial", (k, 0.0, rng.uniform(0.05, 0.5) * k * (k / f) ** 2)),
        "bouc-wen": lambda k, f: Law("bouc-wen", (f, rng.uniform(0.02, 0.2), 2.0, 0.5)),
    }
    names = rng.choice(list(laws), n)
    stories = [
        story(m, k, smooth[name](k, f), height=3.2, dashpot=rng.uniform(0.01, 0.06) * np.sqrt(m * k))
        for m, k, f, name in zip(masses, springs, strengths, names, strict=True)
    ]
    return model(stories), noise(samples=samples, peak=rng.uniform(3.0, 8.0), seed=int(rng.integers(1 << 30)))


METHODS = ("impulse4", "newmark-average", "bathe", "generalized-alpha", "gauss4", "impulse", "park", "wilson")
LAWS = ("linear", "bilinear", "peak-oriented", "tanh", "polynomial", "bouc-wen")


def random_law(name, generator, stiffness, strength):
    """A law by name with parameters that matter at the strength, N."""
    hardening = float(generator.uniform(0.01, 0.1))
    return {
        "linear": LINEAR,
        "bilinear": Law("bilinear", (strength, hardening)),
        "peak-oriented": Law("peak-oriented", (strength, hardening, float(generator.uniform(0.0, 0.5)))),
        "tanh": Law("tanh", (1.5 * strength,)),
        "polynomial": Law("polynomial", (stiffness, 0.0, float(generator.uniform(-5.0, 200.0)) * stiffness)),
        "bouc-wen": Law("bouc-wen", (strength, hardening, 2.0, 0.5)),
    }[name]


def checked_building(seed, samples=501, step=0.01):
    """One to eight stories of one law or of all, under a smooth or a rough motion, and a method."""
    generator = np.random.default_rng(seed)
    n = int(generator.integers(1, 9))
    mass = 2e5
    omega = 2.0 * np.pi / (0.1 + n * generator.uniform(0.08, 0.16))
    stiffness = mass * (omega / (2.0 * np.sin(np.pi / (4 * n + 2)))) ** 2
    base = generator.uniform(0.1, 0.4) * n * mass * 9.81
    peak = generator.uniform(2.0, 6.0)
    name = (*LAWS, "mixed")[seed % 7]
    stories = []
    for i in range(n):
        k = float(stiffness * generator.uniform(0.8, 1.2))
        kind = str(generator.choice(LAWS)) if name == "mixed" else name
        law = random_law(kind, generator, k, float(base * (1.0 - 0.7 * (i / n) ** 2)))
        stories.append(story(float(mass * generator.uniform(0.8, 1.2)), k, law))
    damping = [RayleighCoefficients(0.3, 0.001), ModalDamping((0.05,)), None][seed % 3]
    record = noise(samples, step, seed=seed, peak=peak)
    if seed % 2:
        rough = 0.3 * peak * generator.normal(size=samples) * np.sin(np.pi * np.linspace(0.0, 1.0, samples)) ** 2
        record = replace(record, acceleration=record.acceleration + rough)
    method = "exact" if name == "linear" and seed % 14 == 0 else METHODS[seed % len(METHODS)]
    return replace(model(stories, damping=damping, p_delta=seed % 5 == 0), collapse_drift=1e9), record, method
