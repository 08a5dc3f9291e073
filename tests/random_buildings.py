"""Random buildings in free vibration: conservative ones, and ones that dissipate by their drift laws alone."""

from __future__ import annotations

import numpy as np

from building_cases import Law, model, story
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
        "peak-oriented", (BEND * k * rng.uniform(0.2, 1.0), rng.uniform(0.01, 0.3), 0.0)
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
