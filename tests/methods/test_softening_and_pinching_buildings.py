"""Tests of buildings with stories that pinch, soften and fail: order 4, energy, two independent
solutions, time of collapse."""

from dataclasses import replace

import numpy as np
import pytest

from building_cases import Law, RayleighCoefficients, model, noise, story
from references import orders
from selection import every
from step_checks import at_samples, refined
from tdint import run

DAMPING = RayleighCoefficients(mass=0.3, stiffness=2e-3)
MASS = 2e5


def building(name, seed, **more):
    """Return two to six stories with random properties, which are weaker and softer towards the
    roof."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 7))
    stories = []
    for i in range(n):
        stiffness = 6e7 * random.uniform(0.7, 1.3) * (1.0 - 0.5 * i / n) * n**0.5
        strength = 2.45 * MASS * n * (1.0 - i * (i + 1) / (n * (n + 1))) * random.uniform(0.8, 1.2)
        law = LAWS[name](random, strength, strength / stiffness)
        stories.append(story(MASS, stiffness, law, height=3.2))
    return model(stories, damping=DAMPING, **more)


def trilinear(random, strength, dy):
    ultimate, drift = strength * random.uniform(1.3, 3.0), dy * random.uniform(8.0, 25.0)
    return Law(
        "trilinear-pinching",
        (strength, ultimate, drift, random.uniform(0.2, 0.9), random.uniform(0.0, 0.4)),
    )


def imk(random, strength, dy):
    side = (
        strength, dy * random.uniform(3.0, 6.0), dy * random.uniform(8.0, 20.0), 1.15, 0.15,
        60.0 * dy, 1.0,
    )  # fmt: skip
    pinching = (0.3, 0.5) if random.random() < 0.5 else (1.0, 1.0)
    return Law(
        "imk",
        (*side, 0.9 * strength, *side[1:], *4 * [random.uniform(30.0, 100.0) * dy], 1.0, *pinching),
    )


def multilinear(random, strength, dy):
    """Return a law with degradation and, in some cases, with different sides."""
    sides = []
    for weaker in (1.0, random.choice([1.0, 0.9])):
        drifts = dy * np.cumsum([1.0, *random.uniform(2.0, 6.0, 3)])
        forces = (
            weaker
            * strength
            * np.array([1.0, random.uniform(1.2, 1.6), random.uniform(1.0, 1.3), 0.8])
        )
        sides += [number for point in zip(drifts, forces, strict=True) for number in point]
    losses = (0.0, 0.1, 1.0, 1.0, 0.2, 0.0, 0.1, 1.0, 1.0, 0.2, 0.0, 0.4, 1.0, 1.0, 0.9, 10.0)
    intact = (*3 * (0.0, 0.0, 1.0, 1.0, 0.0), np.inf)
    degradation = losses if random.random() < 0.5 else intact
    return Law("multilinear-pinching", (*sides, *2 * (0.5, 0.25, 0.05), np.inf, *degradation))


def clough(random, strength, dy):
    return Law("peak-oriented", (strength, 0.08, random.uniform(0.0, 0.4)))


LAWS = {
    "trilinear-pinching": trilinear,
    "imk": imk,
    "multilinear-pinching": multilinear,
    "peak-oriented": clough,
}


@pytest.mark.parametrize("name", every(2, LAWS))
@pytest.mark.parametrize("seed", every(3, range(3)))
def test_order_energy_and_agreement_with_average_acceleration(name, seed):
    """Average acceleration with the smallest steps follows the laws over complete steps, without
    branch changes at events."""
    case, record = building(name, seed), noise(samples=501, seed=seed, peak=6.0)
    runs, finest, errors = refined(case, record, (1, 2, 4, 8, 32), size=np.linalg.norm)
    assert runs[0].branch_changes > 40
    assert runs[0].stories.ductility.max() > 2.0
    assert np.all((orders(errors) > 3.5) & (orders(errors) < 4.4))
    assert np.max(np.abs(runs[0].history.energy.error)) < 1e-4
    _, average = at_samples(case, record, "newmark-average", 32)
    assert np.linalg.norm(average - finest) < 1e-4 * np.linalg.norm(finest)


def failing(**more):
    """Return a story with an initial velocity that exceeds its ultimate drift of six yield
    drifts."""
    side = (5.0, 0.4, 0.8, 1.1, 0.2, 0.3, 1.0)
    law = Law("imk", (*side, *side, *4 * [np.inf], 1.0, 1.0, 1.0))
    return model([story(1.0, 100.0, law, height=10.0)], velocity=(3.0,), **more)


@pytest.mark.parametrize("method", ["impulse4", "newmark-average"])
def test_failed_story_is_reported(method):
    """The story yields at 0.05 m after 0.0169 s and then moves against 5 N and more. It fails at
    0.3 m with v^2 = 9 - 0.25 - 2 (1.25 + ...)."""
    response = run(failing(), method=method, dt=0.01, duration=0.5, history=True)
    rise = 0.5 / 0.4
    work = 0.5 * 5.0 * 0.05 + 5.0 * 0.25 + 0.5 * rise * 0.25**2
    speed = np.sqrt(9.0 - 2.0 * work)
    assert response.status == "failed-story"
    assert (response.collapse.story, response.collapse.failed, response.collapse.ended) == (
        1,
        True,
        True,
    )
    assert response.collapse.time == pytest.approx(
        np.interp(0.3, response.history.drift[:, 0], response.history.time), abs=0.011
    )
    assert response.history.shear[-1, 0] == 0.0
    assert response.history.velocity[-1, 0] == pytest.approx(
        speed, rel=1e-6 if method == "impulse4" else 0.02
    )
    assert response.energy.strain == 0.0
    assert response.energy.hysteretic == pytest.approx(
        work, rel=1e-6 if method == "impulse4" else 0.02
    )
    assert abs(response.energy.error) < (1e-6 if method == "impulse4" else 0.02)


def test_collapse_before_story_failure_is_reported():
    """The drift ratio 0.02 is exceeded before the story fails at 0.03."""
    response = run(
        replace(failing(), collapse_drift=0.02), method="impulse4", dt=0.01, duration=0.5
    )
    assert response.status == "collapsed"
    assert not response.collapse.failed


@pytest.mark.parametrize("seed", every(3, range(3)))
def test_collapse_time_agrees_with_fine_steps(seed):
    """For a softening branch with P-delta, the collapse times with the sampling interval and with
    1/64 of it differ by at most one sampling interval."""
    record = noise(samples=1201, seed=seed, peak=14.0)
    case = building("imk", seed, p_delta=True)
    heavy = [story(light.mass, light.stiffness, light.law, height=1.6) for light in case.stories]
    case = model(heavy, damping=DAMPING, p_delta=True)
    coarse, fine = (run(case, record, method="impulse4", dt=record.dt / parts) for parts in (1, 64))
    assert coarse.collapse.time == pytest.approx(fine.collapse.time, abs=1.001 * record.dt)
    assert coarse.collapse.story == fine.collapse.story
    assert abs(coarse.energy.error) < 1e-4
