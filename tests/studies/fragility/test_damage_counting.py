"""Intensity levels, damage states and losses of campaigns are counted for artificial runs, without
a store and without time integration."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import norm

from building_cases import Law, model, noise, story
from tdint import run
from tdint.model.building import assemble
from tdint.model.damage_states import DamageStates
from tdint.model.status import DONE, FALLEN
from tdint.response.pairs import COLLAPSED, COMPLETED, FAILED, PairRule, Run
from tdint.response.runs.damage import probabilities
from tdint.studies.campaign.story_profiles import SuiteRules
from tdint.studies.fragility.building_damage import BuildingDamage, TypeDamage
from tdint.studies.ida.ida import _elastic_scale

STATES = DamageStates(
    "drift_ratio",
    ("slight", "moderate", "severe"),
    (0.004, 0.012, 0.04),
    0.5,
    (0.02, 0.2, 0.7, 1.0),
)
ENDS = (DONE, DONE, FALLEN[0], "diverged", DONE, FALLEN[-1], DONE, "not-converged", DONE, DONE)
DEMANDS = np.array([0.001, 0.004, 0.3, math.nan, 0.012, 0.2, 0.0119, math.nan, 0.0, 0.5])
KEYS = [Run(motion, 1.0, 0) for motion in (1, 1, 2, 2, 3, 3, 3, 4, 5, 5)]


def damage(states: DamageStates = STATES) -> BuildingDamage:
    probability = probabilities(states, DEMANDS, ENDS)
    unknown = np.full(len(ENDS), math.nan)
    return BuildingDamage(
        number=1,
        building="a",
        type="a",
        period=1.0,
        states=states,
        keys=KEYS,
        motion=np.array([run.motion for run in KEYS]),
        level=np.ones(len(ENDS)),
        status=list(ENDS),
        demand=DEMANDS,
        probability=probability,
        sa=unknown,
        pga=unknown,
    )


def expected_probabilities(states: DamageStates) -> list[list[float]]:
    """Return the probability of each outcome of each run: no damage, the damage states, and the
    collapses."""
    rows = []
    for demand, end in zip(DEMANDS, ENDS, strict=True):
        if end in FALLEN:
            rows.append([0.0] * 4 + [float(end == boundary) for boundary in FALLEN])
        elif end != DONE:
            rows.append([math.nan] * (4 + len(FALLEN)))
        else:
            beyond = [
                1.0,
                *(
                    norm.cdf(math.log(max(demand, 1e-300) / boundary) / 0.5)
                    for boundary in states.medians
                ),
                0.0,
            ]
            if states.dispersion == 0.0:
                beyond = [1.0, *(float(demand >= boundary) for boundary in states.medians), 0.0]
            rows.append(
                [boundary - other for boundary, other in pairwise(beyond)] + [0.0] * len(FALLEN)
            )
    return rows


@pytest.mark.parametrize("dispersion", [0.5, 0.0])
def test_damage_outcomes_of_runs(dispersion: float) -> None:
    states = DamageStates(STATES.demand, STATES.states, STATES.medians, dispersion, STATES.losses)
    results, expected = damage(states), expected_probabilities(states)
    np.testing.assert_allclose(results.probability, expected, atol=1e-15)
    losses = [0.0, 0.02, 0.2, 0.7, *[1.0] * len(FALLEN)]
    np.testing.assert_allclose(
        results.loss,
        [math.fsum(p * loss for p, loss in zip(row, losses, strict=True)) for row in expected],
    )
    np.testing.assert_allclose(
        results.squared_loss,
        [math.fsum(p * loss**2 for p, loss in zip(row, losses, strict=True)) for row in expected],
    )
    names = ["none", "slight", "moderate", "severe"]
    assert results.known.tolist() == [end == DONE or end in FALLEN for end in ENDS]
    for state, demand, end in zip(results.state, DEMANDS, ENDS, strict=True):
        if end == DONE:
            assert state == names[sum(demand >= loss for loss in STATES.medians)]
        else:
            assert state == (end if end in FALLEN else "")


def test_damage_of_group_is_mean_of_runs() -> None:
    """All runs with a result have equal weight. Jackknife errors omit one motion at a time; the
    motions have different numbers of runs."""
    results, expected = damage(), np.array(expected_probabilities(STATES))
    motions = np.array([key.motion for key in KEYS])
    chosen = np.array([True] * 9 + [False])
    found = TypeDamage(STATES)
    for _ in range(2):
        found.add(results, chosen, motions)
    assert (found.buildings, found.runs, found.failed) == (2, 18, 4)
    known = [i for i in range(9) if ENDS[i] == DONE or ENDS[i] in FALLEN]
    np.testing.assert_allclose(found.probability.value, expected[known].mean(axis=0))
    loss = results.loss[known]
    np.testing.assert_allclose(found.loss.value, loss.mean())
    assert found.loss_sd == pytest.approx(
        math.sqrt(results.squared_loss[known].mean() - loss.mean() ** 2)
    )
    groups = [[i for i in known if motions[i] == motion] for motion in (1, 2, 3, 5)]
    losses_without_group = [
        np.mean([results.loss[i] for i in known if i not in group]) for group in groups
    ]
    np.testing.assert_allclose(
        found.loss.error, math.sqrt(3.0 * float(np.var(losses_without_group)))
    )


def test_levels_count_ground_motions_instead_of_runs() -> None:
    """A pair counts as failed or collapsed if one of its two runs is. A failed motion does not
    count as collapsed."""
    rules = SuiteRules(
        PairRule("larger", {1: 1, 2: 1, 3: 3, 4: 3, 5: 5, 6: 5, 7: 7, 8: 8}),
        True,
        ("pga", "m/s^2"),
    )
    names = {1: "1", 2: "1", 3: "3", 4: "3", 5: "5", 6: "5", 7: "7", 8: "8"}
    small = dict.fromkeys((Run(motion, 0.5, 0) for motion in range(1, 9)), DONE)
    large = {Run(motion, -2.0, 0): DONE for motion in range(1, 9)}
    large |= {Run(2, -2.0, 0): FALLEN[0], Run(3, -2.0, 0): "diverged", Run(4, -2.0, 0): FALLEN[0]}
    large |= {Run(7, -2.0, 0): FALLEN[-1], Run(8, -2.0, 0): "not-converged"}
    rows = [
        (run, names[run.motion], 0.1 if run.scale == 0.5 else 0.4, status)
        for run, status in (large | small).items()
    ]
    first, second = rules.levels(rows)
    assert np.bincount(first.motion).tolist() == [2, 2, 2, 1, 1]
    assert [(level.pairs, *level.counts[1:]) for level in (first, second)] == [(3, 0, 0), (3, 2, 2)]
    assert second.outcome.tolist() == [COLLAPSED, FAILED, COMPLETED, COLLAPSED, FAILED]
    assert (first.level, second.level) == (0.1, 0.4) and math.isnan(first.scale)
    common = SuiteRules(PairRule("larger", {1: 1, 2: 2}), False, ("", ""))
    (level_counts,) = common.levels(
        [(Run(1, 0.5, 0), "1", 0.5, DONE), (Run(2, 0.5, 0), "2", 0.5, DONE)]
    )
    assert level_counts.scale == 0.5 and math.isnan(level_counts.level)


@pytest.mark.parametrize(
    ("yield_force", "share"), [(10.0, 0.7 * 10.0 / 800.0 / 3.0), (1e9, 0.1 * 0.06)]
)
def test_elastic_scale_of_one_story(yield_force: float, share: float) -> None:
    """The elastic scale causes 0.7 of the yield drift or a tenth of the collapse drift, whichever
    is smaller, in a run of the story without yielding."""
    record = noise(samples=300)
    law = Law("bilinear", (yield_force, 0.05))
    building = model([story(2.0, 800.0, law, height=3.0)])
    factor = _elastic_scale(assemble(building), record, 0.06)
    elastic = model([story(2.0, 800.0, height=3.0, dashpot=2.0 * 0.05 * math.sqrt(1600.0))])
    peak = run(elastic, record.scaled(factor), method="exact").stories.peak_drift[0]
    assert peak / 3.0 == pytest.approx(share, rel=2e-3)
