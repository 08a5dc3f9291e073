"""Definitions of motions, outcomes, weights and fractiles: reference values of studies."""

import math

import numpy as np
import pytest
from scipy.special import ndtri

import tdint
from tdint.errors import AnalysisError
from tdint.fractiles import expected_deviation, fractiles, small_sample_warning
from tdint.ground_motion.record import Record
from tdint.model.damage_states import DamageStates
from tdint.response import pairs as o
from tdint.response.pairs import (
    LARGER,
    MEAN,
    PAIR_DEMANDS,
    Run,
    join_pairs,
    recording_numbers,
    suite_text,
)
from tdint.studies.campaign.story_profiles import ratios_to
from tdint.studies.fragility.building_damage import BuildingDamage, TypeDamage
from tdint.studies.fragility.fit_table import FragilityRequest, fit_states
from tdint.studies.fragility.fits import fit_capacities, fit_cloud, fit_levels, fit_stripes
from tdint.studies.fragility.measures import SuiteRuns, over_motions
from tdint.studies.ida.ida_curve import IdaCurve, IdaRun, PairCurve
from tdint.studies.motions.intensity import MotionIntensity, pga, sa

LOST, GONE = math.inf, math.nan


def column(*values):
    return np.array(values, float)[:, None]


def test_v1_each_variant_is_compared_under_the_motions_that_it_and_the_baseline_completed():
    base = column(1.2, 1.8, 2.4, 3.0, 1.6, 2.0, LOST)
    b = ratios_to(base, column(0.9, 1.3, 1.6, 2.2, 1.4, 1.5, 2.9))
    d = ratios_to(base, column(1.0, LOST, 1.5, LOST, 1.5, LOST, LOST))
    assert (b.motions, d.motions) == (6, 3)
    found = [value[0] for value in (b.mean, b.max, b.median, d.mean, d.max)]
    assert found == pytest.approx([0.7416666667, 0.7333333333, 0.75, 0.7692307692, 0.625])
    assert d.median[0] == LOST  # four of seven collapse: printed as `collapse`


def test_v1_counts():
    statuses = ["done"] * 3 + ["collapsed", "failed-story", "unstable"]
    found = o.counts(o.outcomes_of(statuses))
    assert found == (3, 2, 1) and found.motions == 6 and found.text == "2 collapsed and 1 failed"


def test_v2_maxima_are_over_all_stories_of_each_building():
    drift = [np.array([[0.015, 0.012, 0.009, 0.006]]), np.array([[0.016, 0.011, 0.007]])]
    shear = [np.array([[900.0, 780, 560, 300]]), np.array([[720.0, 500, 260]])]
    from_roof = [(0, 1), (1, 2), (2, 3)]
    found = ratios_to(*drift, from_roof).mean
    assert found[0] == pytest.approx(1.066666667) and found[2] == pytest.approx(0.016 / 0.012)
    assert math.isnan(found[1])  # the variant has no such story
    base_shear = ratios_to(shear[0][:, :1], shear[1][:, :1])
    assert base_shear.mean[0] == pytest.approx(0.8)


def row(number, motions, probability, loss=(), cost=math.nan):
    """Return the damage of a row of `number` buildings of the cost `cost` after one run under each
    motion; `loss` is the loss ratio of the single state."""
    states = DamageStates("drift_ratio", ("slight",), (0.01,), 0.0, loss * 2)
    p = np.asarray(probability, float)
    outcomes = np.zeros((p.size, len(states.outcomes)))
    outcomes[:, 0], outcomes[:, 1] = 1.0 - p, p
    unknown = np.full(p.size, math.nan)
    return BuildingDamage(
        number=1, building="", type="", period=1.0, states=states,
        keys=[Run(motion, 1.0) for motion in motions], motion=np.arange(p.size),
        level=np.ones(p.size), status=["done"] * p.size, demand=unknown, probability=outcomes,
        sa=unknown, pga=unknown, equal=number, cost=number * cost,
    )  # fmt: skip


def group_of(*rows):
    group = TypeDamage(rows[0].states)
    for item in rows:
        motions = np.array([run.motion for run in item.keys])
        group.add(item, np.ones(motions.size, bool), motions)
    return group


def test_r1_rows_are_weighted_by_the_number_of_buildings():
    p = [[0.4, 0.6, 0.8], [0.02, 0.06, 0.1], [0.9, 0.9, 0.9]]
    group = group_of(*(row(n, range(3), item) for n, item in zip((1, 99, 0), p, strict=True)))
    found = (group.probability.value[1], group.buildings, group.probability.error[1])
    assert found == pytest.approx((0.0654, 100.0, 0.0240177712))
    assert group.buildings * group.probability.value[1] == pytest.approx(6.54)
    assert group.rows == 3  # the row without buildings is listed
    # A row that lost a motion has the mean of its other motions.
    lost = row(1, range(3), p[0])
    lost.status[2] = "diverged"
    lost.probability[2] = math.nan
    both = group_of(lost, row(99, range(3), p[1])).probability.value[1]
    assert both == pytest.approx((0.5 + 99 * 0.06) / 100)


def test_r2_losses_are_weighted_by_cost():
    """A state with the probability p and the loss L has the mean p L and the mean square p L^2."""

    def rows(*costs):
        for number, mean, sd, cost in zip((1, 99), (0.3, 0.02), (0.25, 0.1), costs, strict=True):
            loss = (mean**2 + sd**2) / mean
            yield row(number, [1], [mean / loss], (loss,), cost)

    group = group_of(*rows(4e5, 1e5))
    found = group.value, group.money.value[0], group.loss.value[0], *group.scatter
    assert found == pytest.approx((10300000.0, 318000.0, 0.03087378641, 141067.3598, 1090000.0))
    assert group_of(*rows(math.nan, math.nan)).loss.value == pytest.approx([0.0228])
    part = group_of(*rows(math.nan, 1e5))  # over the row with a cost, whose number is beside
    assert (part.loss.value[0], part.rows_with_cost, part.rows) == (pytest.approx(0.02), 1, 2)


def test_r4_stripes_use_weighted_fractions():
    """Buildings whose thresholds have a dispersion exceed with these probabilities."""
    p = np.array([[0.5, 0.9, 1.0], [0.05, 0.2, 0.5]])
    im, demand = np.tile([0.1, 0.2, 0.4], 2), 0.01 * np.exp(0.3 * ndtri(p.ravel()))
    motions = [np.repeat(values, 3) for values in (im, demand, [1, 1, 1, 99, 99, 99])]
    runs = SuiteRuns(*motions[:2], np.tile(range(3), 6), motions[2], ("pga", "g"))
    (found,) = fit_states(runs, {"slight": 0.01}, FragilityRequest(), 0.3)
    assert found.fit == "stripes"
    assert found.counted.fraction == pytest.approx([0.0545, 0.207, 0.505])
    assert (found.theta, found.beta) == pytest.approx((0.3974168021, 0.8537976893), rel=1e-6)


def components(first, second, dt=0.01):
    """Return two records of a recording, which are a pair by their names."""
    return [
        Record(np.asarray(samples, float), dt, "", "", name, f"a-{name}.csv")
        for samples, name in ((first, "HNE"), (second, "HNN"))
    ]


def test_p1_measures_of_a_pair():
    u, v = [0.3, -1.0, 0.6, 0.2, -0.4], [0.5, 0.4, -0.9, 0.7, -0.1]
    (motion,) = join_pairs(components(u, v))
    expected = {
        "geometric-mean": 0.9486832981,
        "larger": 1.0,
        "rotd50": 0.9552486469,
        "rotd100": 1.081649557,
    }
    assert [pga().of(item) for item in components(u, v)] == pytest.approx([1.0, 0.9])
    for pair, value in expected.items():
        assert pga().of(motion, pair) == pytest.approx(value, rel=1e-9)
    # A measure that is not spectral combines the components alike.
    pgv = [MotionIntensity("pgv").of(item) for item in components(u, v)]
    assert MotionIntensity("pgv").of(motion, "larger") == max(pgv)


def test_p2_a_pair_has_one_factor():
    random = np.random.default_rng(1).standard_normal((2, 800))
    records = [
        record.scaled(value / sa(0.5).of(record))
        for record, value in zip(components(*random), (3.0, 5.0), strict=True)
    ]
    scaled = tdint.scale(records, "sa(0.5)", 4.0)
    assert scaled.suite == "2 components, 1 recording, 1 pair"
    assert scaled.factors == pytest.approx([1.032795559])
    after = [sa(0.5).of(record.scaled(scaled.factors[0])) for record in records]
    assert after == pytest.approx([3.098386677, 5.163977795])


@pytest.mark.parametrize("demand", PAIR_DEMANDS)
def test_p3_the_demand_rule_does_not_change_the_intensity(demand):
    """Elastic oscillators of 5 % damping have drifts of Sa / omega^2 / height. The capacity of a
    component is the intensity of the pair at which it reaches the limit, for each rule."""
    capacities = []
    for sa_of, c in zip([[3, 5], [4, 2.5], [2, 2.4]],
                        [[0.004, 0.005], [0.006, 0.0035], [0.0045, 0.0055]],
                        strict=True):  # fmt: skip
        mean = math.sqrt(math.prod(sa_of))
        curves = []
        for value, drift in zip(sa_of, c, strict=True):
            record = components([1.0, 0.0], [1.0, 0.0])[0]
            runs = [IdaRun(im, im / mean, "done", drift * value * im / mean) for im in (1.0, 9.0)]
            curves.append(IdaCurve(record, tuple(runs), 0.1))
        pair = [PairCurve.combine_components(*curves, demand)] if demand != "separate" else curves
        capacities += [curve.capacity(0.02).capacity for curve in pair]
    found = fit_capacities(capacities)
    if demand == "larger":
        assert (found.theta, found.beta) == pytest.approx((3.003841533, 0.1185051653))
    elif demand == "separate":  # the factors of a pair do not change the mean of its logarithms
        assert found.theta == pytest.approx(4.281138192)
    else:
        assert found.theta > 3.01 and abs(found.theta - 3.646436717) > 0.01


def test_q2_dispersion_of_small_samples():
    c4 = [expected_deviation(n) for n in (3, 7, 11)]
    assert c4 == pytest.approx([0.8862269255, 0.9593687887, 0.9753500771])
    x = [0.8, 1.1, 1.3, 1.9, 2.6, 3.0, 4.2]
    found = fit_capacities(x)
    assert (found.theta, found.beta) == pytest.approx((1.83927309, 0.5943877648))
    assert found.theta_interval == pytest.approx((1.061468617, 3.18702357))
    assert "6 motions" in small_sample_warning(6)
    assert not small_sample_warning(7) and not small_sample_warning(1)


def test_q1_fractiles():
    x = np.array([0.8, 1.1, 1.3, 1.9, 2.6, 3.0, 4.2])
    assert fractiles(x) == pytest.approx([1.086076901, 1.9, 3.040649604])
    low, median, high = fractiles(np.array([*x, LOST, LOST, GONE]))
    assert (low, median) == pytest.approx((1.152674995, 2.6)) and high == LOST
    assert fractiles(x**2) == pytest.approx(fractiles(x) ** 2)
    assert fractiles(np.array([0.0, 1.0]), (0.5,)) == pytest.approx([0.5])  # linear next to zero
    assert np.isnan(fractiles(column(GONE, GONE))).all()


def test_p4_components_recordings_and_pairs():
    names = ["a1", "a2", "b1", "b2", "c1", "c2", "d1"]
    assert suite_text([name[0] for name in names]) == "7 components, 4 recordings, 3 pairs"
    assert suite_text([0, 1]) == "2 records"


def test_c1_cloud_with_collapses():
    im = np.array([0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
    survivors = [0.0035, 0.0075, 0.006, 0.0125, 0.01, 0.019, LOST, 0.021, LOST, 0.036, LOST, LOST]
    drift = np.array(survivors)
    fell = np.isinf(drift)
    found, other = fit_cloud(im, np.where(fell, 0.0, drift), (0.02, 0.1), collapsed=fell)
    mixture = found.cloud.mixture
    parameters = (-2.974223069, 1.143725679, 0.2270803901, 2.30430669, 3.773883452)
    assert mixture == pytest.approx(parameters) and other.cloud.mixture == mixture
    assert (found.theta, found.beta) == pytest.approx((0.4047395404, 0.2248121002))
    at = np.array([0.3, 0.5, 0.8])
    collapse = [0.09627239659, 0.4227364503, 0.8118672382]
    assert mixture.collapse_probability(at) == pytest.approx(collapse)
    assert found.probability(at) == pytest.approx([0.1202622177, 0.8490349461, 0.9997509303])
    points = [mixture.intensity(0.02, probability) for probability in (0.16, 0.84)]
    assert points == pytest.approx([0.3173488714, 0.4962769015])
    in_cm = mixture.in_units(100.0)
    assert in_cm.exceedance(0.02, 100.0 * at) == pytest.approx(mixture.exceedance(0.02, at))


def test_c1_a_function_does_not_depend_on_other_thresholds():
    im = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    drift, fell = np.array([1.0, 2.2, 2.9, 9.0, 5.3, 9.0]), np.array([0, 0, 0, 1, 0, 1], bool)
    (alone,) = fit_cloud(im, drift, (2.0,), collapsed=fell)
    together = fit_cloud(im, drift, (2.0, 4.0, 10.0), collapsed=fell)[0]
    assert (alone.theta, alone.beta) == (together.theta, together.beta)


@pytest.mark.parametrize(
    ("fell", "message"),
    [
        ([0, 0, 0, 0, 1, 1], "no finite maximum"),
        ([1, 1, 0, 0, 0, 0], "does not increase with the intensity"),
        ([0, 0, 1, 1, 1, 1], "three different intensities"),
        ([1, 1, 1, 1, 1, 1], "every motion causes collapse"),
    ],
)
def test_collapses_that_determine_no_cloud(fell, message):
    im = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    drift = np.array([1.0, 2.2, 2.9, 4.3, 4.9, 6.3])
    with pytest.raises(AnalysisError, match=message):
        fit_cloud(im, drift, (2.0,), collapsed=np.array(fell, bool))


def test_s1_s2_s5_stripes():
    capacity = np.array([0.18, 0.24, 0.28, 0.33, 0.36, 0.41, 0.47, 0.55, 0.66, 0.9])
    levels = np.array([0.1, 0.2, 0.3, 0.4, 0.6, 0.8])
    exceeds = (capacity <= levels[:, None]).astype(float)
    found = fit_stripes(levels, exceeds.sum(axis=1), np.full(6, 10.0))
    assert (found.theta, found.beta) == pytest.approx((0.3969109442, 0.5201336606), rel=1e-6)
    errors = found.theta_error, found.beta_error
    assert errors == pytest.approx((0.1061515979, 0.1200975352), rel=1e-5)
    assert found.error_method == "information"
    im, motion, level = (
        np.repeat(levels, 10),
        np.tile(np.arange(10), 6),
        np.repeat(np.arange(6), 10),
    )

    def fit(is_used):
        return [fit_levels(im, level, exceeds.ravel(), is_used)]

    (same,) = over_motions(fit, np.ones(60, bool), motion)
    assert (same.error_method, same.motions) == ("jackknife", 10)
    errors = same.theta_error, same.beta_error
    assert errors == pytest.approx((0.1773031306, 0.1519372863), rel=1e-5)

    levels, k, n = [0.1, 0.2, 0.4, 0.7], [0, 1, 4, 7], [8, 10, 12, 11]
    found = fit_stripes(levels, k, n)
    assert (found.theta, found.beta) == pytest.approx((0.5408760866, 0.7173984296), rel=1e-6)
    errors = found.theta_error, found.beta_error
    assert errors == pytest.approx((0.1914730704, 0.242759612), rel=1e-5)
    assert found.motions == 41
    level = np.repeat(np.arange(4), n)
    im = np.array(levels)[level]
    counts = zip(k, n, strict=True)
    exceeds = np.concatenate([np.arange(of) < exceeding for exceeding, of in counts]) * 1.0
    (other,) = over_motions(fit, np.ones(41, bool), np.arange(41))
    errors = other.theta_error, other.beta_error
    assert errors == pytest.approx((0.1970688318, 0.254403731), rel=1e-5) and other.motions == 41

    found = fit_stripes([0.2, 0.5], [4, 13], [20, 20])
    assert (found.theta, found.beta) == pytest.approx((0.3749705251, 0.7468086967), rel=1e-6)


def test_s3_s4_capacities():
    capacity = [0.18, 0.24, 0.28, 0.33, 0.36, 0.41, 0.47, 0.55, 0.66, 0.9]
    found = fit_capacities(capacity)
    assert (found.theta, found.beta) == pytest.approx((0.394138543, 0.4839784884))
    errors = found.theta_error, found.beta_error
    assert errors == pytest.approx((0.1530474362, 0.10822088)) and found.error_method == "normal"
    found = fit_capacities([*capacity[:8], 0.6, 0.6], [False] * 8 + [True] * 2)
    assert (found.theta, found.beta) == pytest.approx((0.3943589473, 0.4645993515), rel=1e-6)
    assert found.error_method == "information"


def suite():
    """One suite with a pair, a single component, a record listed twice, a collapse, a failed run:
    recording, factor and outcome of each run."""
    return [
        ("a", 1.0, "done", 0.01),
        ("a", 1.0, "done", 0.02),  # pair
        ("b", 1.0, "done", 0.03),  # single component
        ("c", 1.0, "done", 0.04),
        ("c", 1.5, "done", 0.05),  # listed twice
        ("d", 1.0, "done", 0.90),
        ("d", 1.0, "collapsed", 1.0),  # pair, one component collapses
        ("e", 1.0, "unstable", 0.0),
        ("e", 1.0, "collapsed", 1.0),  # no result
    ]


@pytest.mark.parametrize(("rule", "pair"), [(LARGER, 0.02), (MEAN, 0.015)])
def test_one_suite_has_one_set_of_counts_and_fractiles(rule, pair):
    runs = suite()
    motion = o.indices_of((recording, factor) for recording, factor, _, _ in runs)
    outcome = o.outcomes_of_motions(motion, o.outcomes_of(status for _, _, status, _ in runs))
    assert o.counts(outcome) == (4, 1, 1)
    demand = o.demands_of_motions(motion, np.array([value for *_, value in runs]), rule)
    found = o.with_outcomes(demand, outcome)
    assert found[:5].tolist() == pytest.approx([pair, 0.03, 0.04, 0.05, LOST]) and np.isnan(
        found[5]
    )
    assert fractiles(found)[1] == pytest.approx(0.04) and fractiles(found)[2] == LOST


def test_names_of_the_records_state_the_recordings():
    records = {0: ("RSN50_LAKE000.AT2", "", 1), 1: ("RSN50_LAKE090.AT2", "", 1)}
    assert set(recording_numbers(records).values()) == {0}
