"""Random models, methods and time steps, including absurd values: every run ends with a documented
status.

No exception is raised, a failed run has no results, no table or summary contains nan, and an energy
balance error above 1 % is noted.
"""

import json
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from building_cases import (
    LINEAR,
    Force,
    Law,
    ModalDamping,
    RayleighCoefficients,
    model,
    noise,
    story,
)
from tdint import run
from tdint.methods.catalogue import catalogue, parse
from tdint.model.story import PowerDashpot
from tdint.output.run_summary import failure_summary, run_summary
from tdint.output.summary import json_bytes
from tdint.output.tables.histories import HistoryLayout
from tdint.output.tables.responses import story_table
from tdint.response.runs.energy import ENERGY_TERMS
from tdint.response.runs.outcome import FailedRun

RUNS, USUAL = 500, 100
BATCH = 50
STIFFNESS = 1e6
METHODS = [name for name in catalogue() if name != "exact"] + [
    "impulse4:rho_inf=0",
    "impulse4:rho_inf=0.5",
    "moment4:rho_inf=0",
]


def law(generator, strength):
    """Return a random law of a story with stiffness 1e6 N/m."""
    hardening = float(generator.choice([0.0, 0.02, 0.5]))
    laws = [
        LINEAR,
        Law("bilinear", (strength, hardening)),
        Law("peak-oriented", (strength, hardening, float(generator.uniform(0.0, 0.9)))),
        Law("tanh", (strength,)),
        Law("bouc-wen", (strength, hardening, float(generator.choice([1.0, 2.0, 20.0])), 0.5)),
        Law("gap", (strength / STIFFNESS, 100.0 * STIFFNESS)),
        Law(
            "polynomial",
            (
                STIFFNESS,
                float(generator.normal()) * STIFFNESS,
                10.0 ** generator.uniform(0, 4) * STIFFNESS,
            ),
        ),
        Law("polynomial", (STIFFNESS, 0.0, -(10.0 ** generator.uniform(0, 4)) * STIFFNESS)),
    ]
    return laws[int(generator.integers(len(laws)))]


def random_run(seed):
    """Return arguments of `run`: a building of one to six stories, at rest or moving, under a
    record, a force or no load."""
    generator = np.random.default_rng(seed)
    n = int(generator.integers(1, 7))
    mass = 10.0 ** generator.uniform(1.0, 4.0)
    strength = STIFFNESS * 10.0 ** generator.uniform(-4.0, -1.0)
    height = [None, 3.0][int(generator.integers(2))]
    stories = [
        story(
            mass,
            STIFFNESS,
            law(generator, strength),
            height,
            float(generator.choice([0.0, 1e3, 1e6])),
        )
        for _ in range(n)
    ]
    method = METHODS[int(generator.integers(len(METHODS)))]
    if generator.random() < 0.2 and parse(method).family.power_dampers:
        dashpot = PowerDashpot(
            10.0 ** generator.uniform(1.0, 6.0), float(generator.choice([0.2, 0.5, 1.7])), 1e-3
        )
        stories[0] = replace(stories[0], power_dashpot=dashpot)
    damping = [None, ModalDamping((0.05,)), RayleighCoefficients(0.5, 0.002)][
        int(generator.integers(3))
    ]
    forces = (
        [Force(n, 10.0 ** generator.uniform(1.0, 7.0), 0.0, 5.0)]
        if generator.random() < 0.3
        else []
    )
    start = (
        10.0 ** generator.uniform(-3.0, 2.0) * generator.normal(size=n)
        if generator.random() < 0.4
        else None
    )
    case = model(
        stories,
        damping=damping,
        forces=forces,
        velocity=None if start is None else start.tolist(),
        p_delta=bool(height and mass * n < 1e4 and generator.random() < 0.5),
    )
    shaken = generator.random() < 0.6
    record = noise(101, 0.02, seed, 10.0 ** generator.uniform(-1.0, 3.0)) if shaken else None
    dt = (
        0.02 * float(generator.choice([0.25, 1.0, 3.0, 10.0]))
        if shaken
        else 10.0 ** generator.uniform(-3.0, 2.0)
    )
    return case, record, {"method": method, "dt": dt, "duration": 50 * dt}


def numbers(content):
    """Return all numbers of a JSON document; None represents a value that was not finite."""
    if isinstance(content, dict):
        return [number for item in content.values() for number in numbers(item)]
    if isinstance(content, list):
        return [number for item in content for number in numbers(item)]
    return [] if isinstance(content, str | bool) else [content]


def check_response(response):
    assert response.status in ("done", "collapsed")
    stories = response.stories
    for values in (
        stories.peak_drift,
        stories.peak_shear,
        stories.peak_displacement,
        stories.peak_velocity,
        stories.peak_absolute_acceleration,
    ):
        assert np.all(np.isfinite(values))
    # A collapsed building has no residual drift.
    has_residual = np.isfinite(stories.residual_drift)
    assert np.all(has_residual == (response.status == "done"))
    assert b"nan" not in story_table(stories).csv() and b"inf" not in story_table(stories).csv()
    history = response.history
    assert (
        len(HistoryLayout(len(stories.height)).columns)
        == 2 + 7 * len(stories.height) + len(ENERGY_TERMS) + 1
    )
    for values in (
        history.displacement,
        history.velocity,
        history.absolute_acceleration,
        history.drift,
        history.shear,
        *vars(history.energy).values(),
    ):
        assert np.all(np.isfinite(values))
    summary = json.loads(json_bytes(run_summary(response, [], 0.0)))
    assert None not in numbers(summary["energy"])
    is_noted = any("energy imbalance is" in note for note in response.warnings)
    assert is_noted == (abs(response.energy.error) > 0.01)
    assert (response.substeps > 0) == any("halved" in note for note in response.notes)
    assert (response.status == "collapsed") == (summary["collapse"] is not None)


def check_failure(failure, case, record):
    assert failure.status in ("diverged", "not-converged", "unstable-step")
    assert "nan" not in str(failure) and "inf " not in str(failure)
    summary = json.loads(json_bytes(failure_summary(failure, case, record, [], 0.0)))
    assert "peaks" not in summary and "energy" not in summary
    assert math.isfinite(summary["time_s"])
    if failure.status == "not-converged":
        assert summary["story"] and summary["residual"] > 0.0
    elif failure.status == "diverged":
        assert summary["story"]
    else:
        assert summary["largest_stable_dt_s"] is not None


@pytest.mark.parametrize(
    "batch",
    [
        pytest.param(i, marks=pytest.mark.slow if i >= USUAL // BATCH else pytest.mark.long)
        for i in range(RUNS // BATCH)
    ],
)
def test_every_random_run_ends_with_documented_status(batch):
    ends = Counter()
    for seed in range(batch * BATCH, (batch + 1) * BATCH):
        case, record, arguments = random_run(seed)
        try:
            response = run(case, record, history=True, **arguments)
        except FailedRun as failure:
            check_failure(failure, case, record)
            ends[failure.status] += 1
        else:
            check_response(response)
            ends[response.status] += 1
    assert ends["done"] > 10 and ends["collapsed"] > 0 and ends["diverged"] > 0
