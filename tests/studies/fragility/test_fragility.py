"""Tests of the fits of fragility functions: published numbers, a second computation of each
maximum, and data that cannot be fitted."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import binom, norm

from tdint.errors import AnalysisError, UsageError
from tdint.studies.fragility.fits import empirical, fit_capacities, fit_cloud, fit_stripes
from tdint.studies.fragility.fragility_function import Fragility, Points
from tdint.units import OutputUnits

# Public data of Baker (2015), https://www.jackwbaker.com/fragility.html
LEVELS = [0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0]
COLLAPSES = [0, 0, 0, 4, 6, 13, 12, 16]
HUNDREDTHS = (
    *(49, 62, 63, 63, 65, 70, 71, 72, 77, 79, 80, 84, 91, 92, 93, 97, 104, 104, 105, 108, 108, 109),
    *(112, 113, 122, 132, 133, 134, 140, 140, 147, 172, 176, 215, 231, 242, 250),
)
CAPACITIES = np.array(HUNDREDTHS) / 100.0


STRIPES = fit_stripes(LEVELS, COLLAPSES, [40] * 8)
WHOLE = fit_capacities(CAPACITIES)
TRUNCATED = fit_capacities(np.minimum(CAPACITIES, 1.3), CAPACITIES > 1.3)


@pytest.mark.parametrize(
    ("found", "fit", "numbers", "counts"),
    [
        (STRIPES, "stripes", (1.07612, 0.42924), (320, 0)),
        (WHOLE, "ida", (1.06923, 0.40807), (37, 0)),
        (TRUNCATED, "ida", (1.05822, 0.38214), (37, 12)),
    ],
    ids=["stripes", "capacities", "truncated"],
)
def test_fits_agree_with_published_values_of_baker(found, fit, numbers, counts):
    assert (round(found.theta, 5), round(found.beta, 5)) == numbers
    assert (found.fit, found.motions, found.censored) == (fit, *counts)
    assert found.runs == found.motions


def test_standard_errors_of_capacities_agree_with_closed_form():
    assert WHOLE.theta_error == pytest.approx(WHOLE.beta / math.sqrt(37))
    assert WHOLE.beta_error == pytest.approx(WHOLE.beta / math.sqrt(74))


def information(negative, at, h=1e-4):
    """Return the inverse of the observed information, by central differences of the logarithm of
    the likelihood."""
    steps = h * np.eye(len(at))
    hessian = [
        [
            (
                negative(at + a + b)
                - negative(at + a - b)
                - negative(at - a + b)
                + negative(at - a - b)
            )
            / (4 * h * h)
            for b in steps
        ]
        for a in steps
    ]
    return np.linalg.inv(np.array(hessian))


def stripes_likelihood(p):
    return -np.sum(binom.logpmf(COLLAPSES, 40, norm.cdf((np.log(LEVELS) - p[0]) / p[1])))


def truncated_likelihood(p):
    z = (np.log(np.minimum(CAPACITIES, 1.3)) - p[0]) / p[1]
    return -np.sum(np.where(CAPACITIES > 1.3, norm.logsf(z), norm.logpdf(z) - math.log(p[1])))


@pytest.mark.parametrize(
    ("likelihood", "found"),
    [(stripes_likelihood, STRIPES), (truncated_likelihood, TRUNCATED)],
    ids=["stripes", "truncated"],
)
def test_likelihood_maximum_and_covariance_agree_with_minimizer(likelihood, found):
    best = minimize(
        likelihood, [0.0, 0.5], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}
    )
    assert best.x == pytest.approx([math.log(found.theta), found.beta], abs=1e-6)
    assert found.covariance == pytest.approx(information(likelihood, best.x), rel=1e-4)


def cloud(censored_above=math.inf, count=60):
    random = np.random.default_rng(7)
    im = np.exp(random.normal(0.0, 0.7, count))
    edp = 0.01 * im**1.2 * np.exp(random.normal(0.0, 0.35, count))
    return im, np.minimum(edp, censored_above), edp >= censored_above


def test_cloud_without_censoring_is_least_squares():
    im, edp, _ = cloud()
    slope, intercept = np.polyfit(np.log(im), np.log(edp), 1)
    residuals = np.log(edp) - intercept - slope * np.log(im)
    sigma = np.sqrt(np.sum(residuals**2) / (im.size - 2))
    for found in fit_cloud(im, edp, [0.01, 0.03]):
        assert math.log(found.theta) == pytest.approx(
            (math.log(found.threshold) - intercept) / slope, rel=1e-9
        )
        assert found.beta == pytest.approx(sigma / slope, rel=1e-9)


def test_cloud_of_equal_buildings_and_uncertain_thresholds():
    """A row of the weight 3 equals three rows: the line is the same, and sigma divides by the
    number of demands. The variance of the thresholds is added to the variance about the line, with
    and without collapses."""
    random = np.random.default_rng(3)
    im = np.exp(random.uniform(-2.5, 1.0, 40))
    edp = 0.01 * im**1.5 * np.exp(0.3 * random.standard_normal(40))
    count = np.where(im < 0.4, 3, 1)
    (found,) = fit_cloud(im, edp, [0.02], weight=10.0 * count)
    (same,) = fit_cloud(np.repeat(im, count), np.repeat(edp, count), [0.02])
    assert found.theta == pytest.approx(same.theta) != fit_cloud(im, edp, [0.02])[0].theta
    n = count.sum()
    assert found.beta / same.beta == pytest.approx(math.sqrt(40 / 38 * (n - 2) / n))
    (uncertain,) = fit_cloud(im, edp, [0.02], weight=count, dispersion=0.4)
    spread = math.hypot(found.cloud.sigma, 0.4) / found.cloud.slope
    assert (uncertain.theta, uncertain.beta) == pytest.approx((found.theta, spread))
    fell = im > np.quantile(im, 0.7)
    fell[np.argmax(im)] = False
    (mixed,) = fit_cloud(im, edp, [0.02], collapsed=fell, weight=count, dispersion=0.4)
    repeated = [np.repeat(values, count) for values in (im, edp, fell)]
    (copies,) = fit_cloud(*repeated[:2], [0.02], collapsed=repeated[2])
    mixture = mixed.cloud.mixture
    assert mixture[3:] == pytest.approx(copies.cloud.mixture[3:])
    assert mixture.sigma == pytest.approx(math.hypot(mixed.cloud.sigma, 0.4))


def test_censored_cloud_agrees_with_minimizer():
    im, edp, above = cloud(0.02)
    assert 5 < above.sum() < 40
    x, y = np.log(im), np.log(edp)

    def likelihood(p):
        z = (y - p[0] - p[1] * x) / p[2]
        return -np.sum(np.where(above, norm.logsf(z), norm.logpdf(z) - math.log(p[2])))

    best = minimize(
        likelihood,
        [-4.6, 1.0, 0.4],
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000},
    )
    (found,) = fit_cloud(im, edp, [0.015], above)
    b0, b1, sigma = best.x
    assert math.log(found.theta) == pytest.approx((math.log(0.015) - b0) / b1, abs=1e-6)
    # Sigma of n demands that are not censored is multiplied by sqrt(n / (n - 2)).
    exact = np.sum(~above)
    unbiased = math.sqrt(exact / (exact - 2))
    assert found.beta == pytest.approx(unbiased * sigma / b1, abs=1e-6)
    jacobian = np.array(
        [[-1 / b1, -(math.log(0.015) - b0) / b1**2, 0.0], [0.0, -sigma / b1**2, 1 / b1]]
    )
    jacobian = np.diag([unbiased, unbiased**2]) @ jacobian
    assert found.covariance == pytest.approx(
        jacobian @ information(likelihood, best.x) @ jacobian.T, rel=1e-3
    )


def test_change_of_unit_only_scales_theta():
    in_g, in_si = (
        fit_stripes(np.array(LEVELS) * unit, COLLAPSES, [40] * 8) for unit in (1.0, 9.80665)
    )
    assert in_si.theta == pytest.approx(9.80665 * in_g.theta, rel=1e-10)
    assert (in_si.beta, in_si.theta_error) == pytest.approx((in_g.beta, in_g.theta_error), rel=1e-8)


@pytest.mark.long
def test_standard_errors_agree_with_repeated_samples():
    """For 400 samples of 60 capacities, the scatter of the estimates equals the mean stated error
    within its sampling error of 7 %."""
    random = np.random.default_rng(3)
    found = []
    for _ in range(400):
        x = np.exp(0.4 * random.standard_normal(60))
        found.append(fit_capacities(np.minimum(x, 1.2), x > 1.2))
    for values, errors in (
        ([math.log(fit.theta) for fit in found], [fit.theta_error for fit in found]),
        ([fit.beta for fit in found], [fit.beta_error for fit in found]),
    ):
        assert np.std(values) == pytest.approx(np.mean(errors), rel=0.12)


def test_confidence_band_and_total_dispersion():
    found = fit_capacities(CAPACITIES)
    im = np.array([0.5, found.theta, 2.0])
    low, high = found.band(im)
    assert np.all(
        (low > 0.0) & (low < found.probability(im)) & (found.probability(im) < high) & (high < 1.0)
    )
    # At the median only the error of theta counts: Phi(+-1.96 / sqrt n).
    assert (low[1], high[1]) == pytest.approx(
        tuple(norm.cdf([-1.959964 / math.sqrt(37), 1.959964 / math.sqrt(37)]))
    )
    from dataclasses import replace

    assert replace(found, modeling_dispersion=0.3).beta_total == pytest.approx(
        math.sqrt(found.beta**2 + 0.09)
    )


def test_probability_at_zero_intensity_is_zero():
    assert fit_capacities(CAPACITIES).probability(np.array([0.0, math.inf])).tolist() == [0.0, 1.0]


SURE = Fragility("cloud", 1.0, 0.5, np.zeros((2, 2)), 12)
"""A function that is known without error."""


def test_counts_at_few_levels():
    """There are two levels in any order, with three and two runs; two of the three runs exceed the
    state."""
    counted = SURE.beside_counts(
        np.array([2.0, 1.0, 2.0, 1.0, 2.0]), np.array([1.0, 0.0, 1.0, 1.0, 0.0])
    ).counted
    assert counted.im == pytest.approx([1.0, 2.0])
    assert counted.runs.tolist() == [2.0, 3.0]
    assert counted.fraction == pytest.approx([1 / 2, 2 / 3])
    probability = norm.cdf([0.0, math.log(2.0) / 0.5])
    assert counted.fitted == pytest.approx(probability)
    assert counted.error == pytest.approx(np.sqrt(probability * (1.0 - probability) / [2, 3]))
    assert counted.half_motion == pytest.approx([1 / 4, 1 / 6])
    assert counted.excess_in_errors[0] == 0.0  # half a motion explains it
    assert counted.excess_in_errors[1] == pytest.approx(
        (probability[1] - 2 / 3 - 1 / 6) / counted.error[1]
    )


def test_error_of_counts_includes_error_of_fit():
    """By the delta method, an error of theta changes the probability by the density times the error
    over beta."""
    covariance = np.diag([0.2**2, 0.0])
    unsure = Fragility("ida", 1.0, 0.5, covariance, 12)
    im, beyond = np.array([1.5] * 4), np.array([1.0, 1.0, 0.0, 1.0])
    z = math.log(1.5) / 0.5
    scatter = SURE.beside_counts(im, beyond).counted.error
    assert unsure.beside_counts(im, beyond).counted.error == pytest.approx(
        np.hypot(scatter, norm.pdf(z) * 0.2 / 0.5)
    )


def test_largest_disagreement_with_counts_is_reported():
    """All of 100 runs at the median exceed the state. The expected fraction is one half, the
    scatter is 5 %, and half a motion is 0.5 %."""
    im = np.repeat([1.0, 4.0], 100)
    beside = SURE.beside_counts(im, np.ones(200))
    assert beside.counted.excess_in_errors == pytest.approx([(0.5 - 0.005) / 0.05, 0.0])
    text = (
        "at im 1 100 % of 100 runs exceed, the cloud function gives 50 %: the difference exceeds "
        "the random scatter"
    )
    assert beside.disagreement == text
    assert beside.named(0.02, "Sa", "g").disagreement == "threshold 0.02: " + text.replace(
        "im 1", "Sa 1 g"
    )
    # Three standard errors of 5 % plus half a motion give 65.5: 65 of 100 are not reported, and 66
    # are.
    for beyond, is_reported in ((65, False), (66, True)):
        share = np.concatenate([np.arange(100) < beyond, np.ones(100)])
        assert bool(SURE.beside_counts(im, share.astype(float)).disagreement) == is_reported
    assert SURE.disagreement == ""


def test_observations_are_converted_to_other_units():
    """A line ln EDP = a + b ln IM has the same demands if the number of the intensity is multiplied
    by 9.80665."""
    im = np.array([0.1, 0.2, 0.4, 0.8])
    (fit,) = fit_cloud(im, 0.02 * im**0.9 * np.array([1.1, 0.9, 1.05, 0.95]), (0.01,))
    fit = fit.beside_counts(im, np.array([0.0, 0.0, 1.0, 1.0])).named(0.01, "Sa", "g")
    moved = fit.in_units(OutputUnits(length="cm"))
    factor = moved.theta / fit.theta
    assert (moved.unit, factor) == ("cm/s^2", pytest.approx(980.665))
    assert moved.cloud.im == pytest.approx(factor * im)
    assert moved.counted.im == pytest.approx(factor * fit.counted.im)
    demand = [line.intercept + line.slope * np.log(line.im) for line in (fit.cloud, moved.cloud)]
    assert demand[1] == pytest.approx(demand[0], rel=1e-12)
    points = Fragility(
        "ida", 0.5, 0.4, np.zeros((2, 2)), 3, unit="g", points=Points(im, np.linspace(0, 1, 4))
    )
    assert points.in_units(OutputUnits(length="cm")).points.im == pytest.approx(980.665 * im)


def test_empirical_points_are_midpoints_of_steps():
    points = empirical(np.array([1.0, 3.0, 2.0]), np.zeros(3, bool))
    assert (points.im.tolist(), points.fraction.tolist()) == (
        [1.0, 2.0, 3.0],
        pytest.approx([1 / 6, 1 / 2, 5 / 6]),
    )
    # Two capacities above a censored capacity have steps of 1/3 each, which are half of the
    # remaining 2/3.
    points = empirical(np.array([1.0, 2.0, 3.0]), np.array([True, False, False]))
    assert points.fraction == pytest.approx([0.25, 0.75])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.5, 1.0], [10, 10], [10, 10]), "every record exceeds"),
        (([0.5, 1.0, 2.0], [0, 0, 10], [10, 10, 10]), "add intensity levels in between"),
        (([0.5, 1.0, 2.0], [0, 4, 10], [10, 10, 10]), "add intensity levels in between"),
        (([0.5, 1.0, 2.0], [9, 5, 1], [10, 10, 10]), "does not increase with intensity"),
    ],
)
def test_degenerate_stripes_are_refused(arguments, message):
    with pytest.raises(AnalysisError, match=message):
        fit_stripes(*arguments)


@pytest.mark.parametrize(
    ("capacity", "censored", "message"),
    [
        ([1.0], None, "median and dispersion requires at least two"),
        ([1.0, 2.0, 2.0], [False, True, True], "requires at least two"),
        ([1.0, 1.0, 1.0], None, "all capacities are equal"),
    ],
)
def test_degenerate_capacities_are_refused(capacity, censored, message):
    with pytest.raises(AnalysisError, match=message):
        fit_capacities(capacity, censored)


def test_degenerate_clouds_are_refused():
    with pytest.raises(AnalysisError, match="do not increase"):
        fit_cloud([1.0, 2.0, 3.0, 4.0], [4.0, 3.1, 2.0, 1.0], [2.0])
    with pytest.raises(AnalysisError, match="three different intensities"):
        fit_cloud([1.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0])
    with pytest.raises(AnalysisError, match="on one line"):
        fit_cloud([1.0, 2.0, 4.0], [1.0, 2.0, 4.0], [2.0])
    with pytest.raises(
        AnalysisError, match=r"do not determine the median: .* \+- .*, with a dispersion of"
    ):
        fit_cloud([1.0, 2.0, 4.0, 8.0], [1.0, 3.0, 1.0, 2.2], [1e-9])  # a slope of 0.18, by chance


SQUARE = [[0.5, 1.0], [2.0, 4.0]]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fit_stripes([0.0, 1.0], [0, 1], [2, 2]), "levels of intensity"),
        (lambda: fit_stripes([0.5, 1.0], [0, 3], [2, 2]), "exceedances must not exceed"),
        (lambda: fit_stripes([0.5, 1.0], [0, -1], [2, 2]), "exceedances must not exceed"),
        (lambda: fit_stripes([0.5, 1.0], [0, 0], [2, 0]), "number of records must be"),
        (lambda: fit_stripes([0.5, 1.0], [0], [2, 2]), "arrays of the same length"),
        (lambda: fit_stripes([0.5, 1.0], [0, 1], [2]), "arrays of the same length"),
        (lambda: fit_stripes(SQUARE, SQUARE, SQUARE), "arrays of the same length"),
        (lambda: fit_stripes([], [], []), "arrays of the same length"),
        (lambda: fit_capacities([1.0, -1.0]), "capacities"),
        (lambda: fit_capacities([1.0, math.nan]), "capacities"),
        (lambda: fit_capacities([1.0, 2.0, 3.0], [False, True]), "arrays of the same length"),
        (lambda: fit_capacities(SQUARE, np.zeros((2, 2))), "arrays of the same length"),
        (lambda: fit_cloud([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [0.0]), "thresholds"),
        (lambda: fit_cloud([1.0, 2.0, 3.0], [1.0, 2.0], [1.0]), "arrays of the same length"),
        (
            lambda: fit_cloud([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0], [True]),
            "arrays of the same length",
        ),
        (lambda: fit_cloud(SQUARE, SQUARE, [1.0]), "arrays of the same length"),
    ],
)
def test_invalid_numbers_are_refused(call, message):
    with pytest.raises(UsageError, match=message):
        call()


def test_one_intensity_level_is_refused_with_its_cause():
    for levels, exceeding, records in (([0.5], [3], [10]), ([0.5, 0.5], [3, 4], [10, 10])):
        with pytest.raises(
            AnalysisError, match=r"level 0\.5: one intensity level cannot determine"
        ):
            fit_stripes(levels, exceeding, records)
