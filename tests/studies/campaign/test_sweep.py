"""Tests of sweeps of campaigns, and of the sensitivity of peaks."""

import csv
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import kendalltau, lognorm, norm, spearmanr, uniform

import tdint
from facts import states
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.reading.suites import suite_motions
from tdint.model.config.record_files import RecordFiles
from tdint.studies.campaign.assigned_motions import CampaignMotions, Scales
from tdint.studies.campaign.campaign_tables import run_table
from tdint.studies.campaign.chunks import CampaignSettings
from tdint.studies.campaign.definition import (
    AnalysisOverrides,
    CampaignFile,
    Correlation,
    Distribution,
    ParameterSweep,
    correlation_of_scores,
    reordered,
)
from tdint.studies.campaign.execute import execute_plan, threads
from tdint.studies.campaign.inputs import Inputs
from tdint.studies.campaign.plan import make_plan
from tdint.studies.campaign.reader import load_campaign
from tdint.studies.sensitivity.sensitivity import (
    one_at_a_time,
    parameter_effects,
    rank_correlations,
)
from tdint.studies.store.opening import open_store

STORY = {
    "mass": 1e4,
    "height": 3.0,
    "stiffness": 4e6,
    "law": {"type": "bilinear", "yield_force": 3e4, "hardening": 0.05},
}
MODEL = {"name": "frame", "stories": [{**STORY, "repeat": 2}], "damping": "5%"}


@pytest.fixture(scope="module")
def model():
    return tdint.load_model(MODEL)


@pytest.fixture(scope="module")
def records():
    t = np.arange(600) * 0.01
    return [
        tdint.make_record(a * np.sin(w * t) * np.exp(-0.3 * t), dt=0.01, units="m/s^2")
        for a, w in ((4, 9), (3, 14))
    ]


def stored(models, records, scales=(1.0,)):
    """Return an open store with the runs of some models."""
    motions = suite_motions(records)
    files = (), RecordFiles((), RecordChoice())
    campaign = CampaignFile(
        "sweep",
        "sweep",
        *files,
        Scales(scales),
        AnalysisOverrides(),
        CampaignSettings(profiles=True),
    )
    plan = make_plan(campaign, Inputs(tuple(models), motions=CampaignMotions(motions)))
    store, _ = open_store(None, plan)
    execute_plan(plan, store, threads(1))
    return store


def rows(store, path):
    with path.open("wb") as stream:
        run_table(store).write(stream)
    with path.open() as stream:
        return list(csv.DictReader(stream))


def test_factors_and_ratios_change_model(model):
    """The first period is proportional to the square root of mass over stiffness; strengths and
    stiffnesses are independent."""
    before = tdint.modes(model)
    after = model.replace(mass_factor=1.5, stiffness_factor=0.7, damping=0.02, strength_factor=1.2)
    modes = tdint.modes(after)
    np.testing.assert_allclose(modes.omega, before.omega * math.sqrt(0.7 / 1.5), rtol=1e-12)
    np.testing.assert_allclose(modes.damping, 0.02, rtol=1e-9)
    assert [story.law.parameters[0] for story in after.stories] == [3.6e4, 3.6e4]
    assert after.varied_parameters == (
        ("mass_factor", 1.5),
        ("stiffness_factor", 0.7),
        ("damping", 0.02),
        ("strength_factor", 1.2),
    )
    changed = model.replace(**{"story 2.stiffness_factor": 0.5})
    assert [story.stiffness for story in changed.stories] == [4e6, 2e6]


def test_inconsistent_law_parameters_are_reported_with_story(records):
    """Each value is within its range, but the ultimate force is smaller than the yield force."""
    law = {
        "type": "trilinear-pinching",
        "yield_force": 3e4,
        "ultimate_force": 5e4,
        "ultimate_drift": 0.05,
    }
    law |= {"pinching": 0.5, "unloading": 0.0}
    model = tdint.load_model(MODEL | {"stories": [{**STORY, "law": law, "repeat": 2}]})
    name, message = "stories[2].law.yield_force", "frame: invalid variation of story 2: "
    with pytest.raises(UsageError, match=message):
        model.replace(**{name: 6e4})
    with pytest.raises(UsageError, match=rf"{message}.* \(sample 2\)"):
        tdint.run_many(model, records[0], vary={name: [2e4, 6e4]})


def test_change_without_effect_is_refused():
    plain = tdint.load_model({"stories": [{"mass": 1.0, "stiffness": 1.0}]})
    for change, message in (
        ("damping", "damping ratio cannot be changed"),
        ("strength_factor", "has no effect"),
    ):
        with pytest.raises(UsageError, match=message):
            plain.replace(**{change: 0.5})


@pytest.mark.parametrize(
    ("change", "stiffness"), [("coefficients[1]", 300.0), ("coefficients[2]", 100.0)]
)
def test_story_stiffness_follows_law_parameters(change, stiffness):
    """The stiffness of a polynomial law is its first coefficient. A stiffness factor multiplies all
    coefficients of the law and the stiffness of the story."""
    law = {"type": "polynomial", "coefficients": [100.0, 2.0]}
    plain = tdint.load_model({"stories": [{"mass": 1.0, "law": law}]})
    (story,) = plain.replace(**{f"story 1.law.{change}": 300.0}).stories
    assert (story.stiffness, 300.0 in story.law.parameters) == (stiffness, True)
    (stiffer,) = plain.replace(stiffness_factor=1.5).stories
    assert (stiffer.stiffness, stiffer.law.parameters) == (150.0, (150.0, 3.0))


def test_text_of_distributions():
    random = {
        "story 1.stiffness": Distribution("uniform", 0.8, 1.2, "kN/mm"),
        "mass_factor": Distribution("normal", 1.0, 0.1),
    }
    texts = ParameterSweep(grids={"damping": (0.02, 0.05)}, random=random, samples=2).values_text
    assert texts == {
        "damping": "0.02, 0.05",
        "story 1.stiffness": "uniform, low 0.8, high 1.2 kN/mm",
        "mass_factor": "normal, mean 1, sd 0.1",
    }


def test_latin_hypercube_has_one_sample_per_stratum():
    """For 40 samples, each fortieth of a distribution contains one sample, and equal seeds give
    equal samples."""
    random = {
        "stiffness_factor": Distribution("lognormal", 1.1, 0.2),
        "mass_factor": Distribution("uniform", 0.8, 1.2),
    }
    changes = ParameterSweep(random=random, samples=40, seed=3).changes()
    stiffness, mass = (np.array([change[name] for change in changes]) for name in random)
    parts = (np.log(stiffness / 1.1) / 0.2, (mass - 0.8) / 0.4)
    from scipy.special import ndtr

    for part in (ndtr(parts[0]), parts[1]):
        assert sorted((part * 40).astype(int).tolist()) == list(range(40))
    assert abs(np.corrcoef(parts)[0, 1]) < 0.5
    assert changes == ParameterSweep(random=random, samples=40, seed=3).changes()
    assert changes != ParameterSweep(random=random, samples=40, seed=4).changes()


def test_each_variation_equals_run_of_varied_model(tmp_path, model, records):
    sweep = ParameterSweep(
        {"damping": (0.02, 0.05), "story 1.strength_factor": (0.8, 1.0)},
        methods=("newmark-average", "bathe"),
    )
    with stored(sweep.vary_models([model]), records, (0.5, 1.0)) as store:
        found = rows(store, tmp_path / "runs.csv")
    assert len(found) == 2 * 2 * 2 * 2 * 2
    assert list(found[0])[-2:] == ["damping", "story_1_strength_factor"]
    assert len({row["building"] for row in found}) == 8
    for row in found[:: len(found) // 5]:
        changes = {
            "damping": float(row["damping"]),
            "story 1.strength_factor": float(row["story_1_strength_factor"]),
        }
        peaks = [
            tdint.run(
                model.replace(**changes), record.scaled(float(row["scale"])), method=row["method"]
            ).stories.peak_drift.max()
            for record in records
        ]
        assert min(abs(peak / float(row["peak_drift_m"]) - 1.0) for peak in peaks) < 1e-9


def test_campaign_file_with_sweep(tmp_path):
    text = """
        buildings: {models: [frame.yaml]}
        records: {files: [a.mseed]}
        analysis: {methods: [bathe, "hht:alpha=-0.1"], dt: [0.01, 0.005]}
        vary: {damping: [2%, 5%], mass_factor: {uniform: {low: 0.9, high: 1.1}}, samples: 7, seed: 2}
    """  # noqa: E501
    (tmp_path / "c.yaml").write_text(text)
    sweep = load_campaign(tmp_path / "c.yaml").sweep
    assert sweep == ParameterSweep(
        {"damping": (0.02, 0.05)},
        {"mass_factor": Distribution("uniform", 0.9, 1.1)},
        7,
        2,
        ("bathe", "hht:alpha=-0.1"),
        (0.01, 0.005),
    )
    faults = {
        "damping: [2%, 5%]": ("damping: [2%, 500%]", "vary.damping[2]: damping must be a ratio"),
        "low: 0.9": ("low: 1.9", "uniform: low must be less than high"),
        "samples: 7": ("samples: 100001", "vary.samples: must be a whole number from 1 to 100000"),
        "seed: 2": ("seed: 2147483648", "vary.seed: must be a whole number from 0 to 2147483647"),
        ", samples: 7": ("", "random parameters require `samples`"),
        "mass_factor": ("masses", "unknown parameter 'masses'"),
        "{uniform": ("{triangular", "triangular"),
        "methods: [": ("method: hht, methods: [", "cannot be used with `methods`"),
    }
    for before, (after, message) in faults.items():
        (tmp_path / "c.yaml").write_text(text.replace(before, after))
        with pytest.raises(ModelError) as caught:
            load_campaign(tmp_path / "c.yaml")
        assert message in str(caught.value)


def test_parameter_effects_agree_with_runs_and_are_sorted(model, records):
    ranges = {"damping": (0.02, 0.08), "strength_factor": (0.7, 1.3)}
    with stored(one_at_a_time(model, ranges), records[:1]) as store:
        found = parameter_effects(store, "frame", ranges)
    drifts = [effect for effect in found if effect.quantity.name == "peak_drift_ratio"]
    assert drifts[0].effect >= drifts[1].effect
    for effect in drifts:
        for value, peak in ((effect.low, effect.at_low), (effect.high, effect.at_high)):
            run = tdint.run(model.replace(**{effect.parameter: value}), records[0])
            assert math.isclose(run.stories.peak_drift_ratio.max(), peak, rel_tol=1e-9)


def test_labels_of_variations_contain_values_and_sample_number(model):
    random = {"mass_factor": Distribution("uniform", 0.9, 1.1)}
    sweep = ParameterSweep(
        {"damping": (0.02, 0.05)}, random, samples=2, seed=1, methods=("bathe",), steps=(0.01,)
    )
    labels = [varied.label for varied in sweep.vary_models([model])]
    assert labels == [
        f"damping={ratio}, draw {draw}, bathe, dt=0.01" for ratio in (0.02, 0.05) for draw in (1, 2)
    ]


def test_rank_correlation_of_monotonic_response(records):
    """The static part of the drift of a soft, strong story decreases with its stiffness in every
    sample."""
    stiff = tdint.load_model(
        {
            "name": "stiff",
            "stories": [{"mass": 1.0, "height": 1.0, "stiffness": 1e6}],
            "damping": "5%",
        }
    )
    sweep = ParameterSweep(
        random={"stiffness_factor": Distribution("uniform", 0.5, 2.0)}, samples=12, seed=1
    )
    with stored(sweep.vary_models([stiff]), records) as store:
        found = {correlation.quantity.name: correlation for correlation in rank_correlations(store)}
    assert math.isclose(found["peak_drift_ratio"].coefficient, -1.0)
    assert found["peak_drift_ratio"].draws == 12
    assert {correlation.building for correlation in found.values()} == {
        "stiff"
    }  # the name of the sampled building without sample numbers
    with stored([stiff], records) as store, pytest.raises(UsageError, match="has no sweep"):
        rank_correlations(store)


def test_buildings_with_a_colon_in_their_name_have_separate_correlations(model, records):
    sweep = ParameterSweep({"stiffness_factor": (0.8, 0.9, 1.0)})
    towers = [replace(model, name=f"tower: {side}") for side in ("north", "south")]
    with stored(sweep.vary_models(towers), records[:1]) as store:
        found = rank_correlations(store)
    assert {(item.building, item.draws) for item in found} == {
        ("tower: north", 3),
        ("tower: south", 3),
    }


@pytest.mark.parametrize(
    ("distribution", "expected"),
    [
        (Distribution("lognormal", 0.4, 0.3), lognorm(0.3, scale=0.4)),
        (Distribution("normal", -2.0, 0.3), norm(-2.0, 0.3)),
        (Distribution("uniform", -1.0, 4.0), uniform(-1.0, 5.0)),
    ],
)
def test_distributions_agree_with_scipy(distribution: Distribution, expected: Any) -> None:
    parts = np.linspace(0.01, 0.99, 21)
    np.testing.assert_allclose(distribution.at(parts), expected.ppf(parts), rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "numbers", "message"),
    [
        ("lognormal", (0.0, 0.3), "lognormal: median must be positive"),
        ("lognormal", (1.0, 0.0), "lognormal: beta must be positive"),
        ("lognormal", (1.0, 2e5), "lognormal: median 1 and beta 200000 give values that exceed"),
        ("normal", (1.0, 1e308), r"normal: mean 1 and sd 1e\+308 give values that exceed"),
        ("normal", (0.0, 0.0), "normal: sd must be positive"),
        ("uniform", (1.0, 1.0), "uniform: low must be less than high"),
    ],
)
def test_invalid_distribution_parameters_are_refused(
    name: str, numbers: tuple[float, float], message: str
) -> None:
    """Parameters at their bounds are refused, and parameters just within them are accepted."""
    with pytest.raises(UsageError, match=message):
        Distribution(name, *numbers)
    for first, second in ((1e-9, 1.0), (0.5, 0.6)):
        Distribution(name, first, second)


# Two lognormal properties with the coefficients of variation 0.3 and 0.5
PROPERTIES = {
    name: Distribution("lognormal", 1.0, math.sqrt(math.log(1.0 + variation**2)))
    for name, variation in (("stiffness_factor", 0.3), ("strength_factor", 0.5))
}


def pair_of(rho: float, of: str = "values") -> Correlation:
    return Correlation(tuple(PROPERTIES), ((1.0, rho), (rho, 1.0)), of)


def test_k1_normal_scores_of_correlated_lognormal_values():
    """K1: logarithmic standard deviations, and correlation of the normal scores."""
    assert [item.second for item in PROPERTIES.values()] == pytest.approx(
        [0.2935603792, 0.4723807271], rel=1e-9
    )
    score = pair_of(0.6).of_scores(PROPERTIES)[0, 1]
    assert score == pytest.approx(0.6214486798, rel=1e-9)
    assert 6.0 / math.pi * math.asin(score / 2.0) == pytest.approx(0.6034295996, rel=1e-9)
    assert 2.0 / math.pi * math.asin(score) == pytest.approx(0.4269111344, rel=1e-9)
    of_ranks = pair_of(0.6, "ranks").of_scores(PROPERTIES)[0, 1]
    assert of_ranks == pytest.approx(0.6180339887, rel=1e-9)


def test_k1_samples_have_the_correlations():
    """K1: rank correlations of the samples, whose values have the correlation 0.6."""
    sweep = ParameterSweep(random=PROPERTIES, samples=20_000, correlation=pair_of(0.6))
    samples = np.array([[*change.values()] for change in sweep.changes()]).T
    assert np.corrcoef(samples)[0, 1] == pytest.approx(0.6, abs=0.005)
    assert spearmanr(*samples)[0] == pytest.approx(0.6034295996, abs=0.003)
    assert kendalltau(*samples)[0] == pytest.approx(0.4269111344, abs=0.003)


@pytest.mark.parametrize(
    ("first", "second", "factor"),
    [
        (Distribution("uniform", 1.0, 3.0), Distribution("normal", 5.0, 2.0), math.pi / 3.0),
        (Distribution("normal", 1.0, 0.1), Distribution("normal", 5.0, 2.0), 1.0),
    ],
)
def test_correlation_of_scores_of_other_distributions(first, second, factor):
    """For a normal and a uniform value, the correlation is sqrt(3 / pi) of that of the scores."""
    found = correlation_of_scores(0.6, first, second)
    assert found == pytest.approx(0.6 * math.sqrt(factor), rel=1e-12)


def test_k2_reordering_of_a_latin_hypercube():
    x, y = np.arange(1.0, 6.0), np.array([30.0, 10.0, 50.0, 20.0, 40.0])
    assert spearmanr(x, y)[0] == pytest.approx(0.3)
    found = reordered(np.column_stack([x, y]), np.array([[1.0, 0.8], [0.8, 1.0]]))
    assert found[:, 0].tolist() == x.tolist()
    assert found[:, 1].tolist() == [20.0, 10.0, 40.0, 30.0, 50.0]
    assert spearmanr(*found.T)[0] == pytest.approx(0.8)


def test_correlated_samples_keep_every_stratum_and_other_parameters():
    random = {"mass_factor": Distribution("uniform", 0.8, 1.2), **PROPERTIES}
    free = ParameterSweep(random=random, samples=30, seed=3)
    tied = replace(free, correlation=pair_of(-0.7, "ranks"))
    before, after = (
        {name: [change[name] for change in sweep.changes()] for name in random}
        for sweep in (free, tied)
    )
    assert after["mass_factor"] == before["mass_factor"]
    for name in PROPERTIES:
        assert sorted(after[name]) == sorted(before[name])
    ranks = spearmanr(*(after[name] for name in PROPERTIES))[0]
    assert ranks == pytest.approx(-0.7, abs=0.05)
    with pytest.raises(UsageError, match="2 samples are too few for 2 correlated parameters"):
        replace(tied, samples=2).changes()


def test_correlations_in_a_campaign_file(tmp_path):
    """K4 and other invalid matrices are errors at the key."""
    text = """
        buildings: {models: [frame.yaml]}
        records: {files: [a.mseed]}
        vary:
          damping: {normal: {mean: 0.05, sd: 0.001}}
          mass_factor: {uniform: {low: 0.9, high: 1.1}}
          strength_factor: {lognormal: {median: 1, beta: 0.4}}
          stiffness_factor: [1, 2]
          samples: 9
          correlation: {parameters: [damping, mass_factor, strength_factor], matrix: MATRIX}
    """
    valid = "[[1, 0.5, 0], [0.5, 1, 0.2], [0, 0.2, 1]]"
    file = tmp_path / "c.yaml"
    file.write_text(text.replace("MATRIX", valid))
    correlation = load_campaign(file).sweep.correlation
    assert correlation == Correlation(
        ("damping", "mass_factor", "strength_factor"),
        ((1.0, 0.5, 0.0), (0.5, 1.0, 0.2), (0.0, 0.2, 1.0)),
    )
    assert "ranks (Spearman) of damping, mass_factor, strength_factor" in correlation.note
    faults = {
        "[[1, 0.9, 0.9], [0.9, 1, -0.9], [0.9, -0.9, 1]]": "its smallest eigenvalue is -0.8",
        "[[1, 0.5, 0], [0.4, 1, 0], [0, 0, 1]]": "symmetric, got 0.4 and 0.5 for mass_factor",
        "[[1, 0.5, 0], [0.5, 1, 0], [0, 0, 0.9]]": "diagonal ... 1, got 0.9 for strength_factor",
        "[[1, 0.5], [0.5, 1]]": "3 rows of 3 numbers",
        "[[1, 1.5, 0], [1.5, 1, 0], [0, 0, 1]]": "matrix[1][2]: must be a number of at least -1",
        "[[1, 0, 0], [0, 1, -0.97], [0, -0.97, 1]], of: values":
            "mass_factor and strength_factor: ... between -0.926 and 0.926, got -0.97",
        f"{valid}, of: logs": ".of: unknown value 'logs'",
    }  # fmt: skip
    for matrix, message in faults.items():
        file.write_text(text.replace("MATRIX", matrix))
        with pytest.raises(ModelError) as caught:
            load_campaign(file)
        assert states(str(caught.value), f"vary.correlation ... {message}"), str(caught.value)
    unknown = text.replace("MATRIX", valid).replace("[damping,", "[stiffness_factor,")
    file.write_text(unknown)
    with pytest.raises(ModelError, match="'stiffness_factor' is not a random parameter"):
        load_campaign(file)
