"""Annual frequencies by a hazard curve: values that two other programs computed, closed forms,
derivatives, and files that are refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from tdint.errors import AnalysisError, ModelError
from tdint.studies.fragility.fits import fit_cloud
from tdint.studies.fragility.fragility_function import CloudPoints, CollapseCloud, Fragility
from tdint.studies.fragility.hazard import (
    HazardCurve,
    at_risk,
    probability_in,
    rate_of,
    read_hazard,
)

IM = np.array([0.05, 0.1, 0.2, 0.4, 0.8, 1.6])
RATE = np.array([0.05, 0.018, 0.005, 0.001, 0.00014, 1e-05])
TABLE = HazardCurve(IM, RATE, unit="g")
SLOPE = HazardCurve(np.array([0.2, 0.8]), 4e-4 * np.array([0.5, 2.0]) ** -2.5, unit="g")


def function(theta, beta, covariance=((math.nan,) * 2,) * 2, **attributes):
    return Fragility("stripes", theta, beta, np.array(covariance), 10, unit="g", **attributes)


def test_constant_slope():
    """Cornell 1996: H(theta) exp(k^2 beta^2 / 2); half of the frequency is from intensities below
    theta exp(-k beta^2)."""
    risk = SLOPE.risk(function(0.4082789730560385, 0.279809575418))
    assert risk.annual_frequency == pytest.approx(0.0004853722098, rel=1e-9)
    assert risk.probability_50_years == pytest.approx(0.02397649561, rel=1e-9)
    assert risk.contributing_im == pytest.approx(0.3356997643, rel=1e-9)
    assert risk.risk_targeted_theta == pytest.approx(0.8260993425, rel=1e-9)
    assert risk.risk_targeted_im == pytest.approx(0.3829039201, rel=1e-9)


def test_table_with_parts_outside():
    risk = TABLE.risk(function(0.6, 0.4))
    total, below, above = risk.annual_frequency, risk.frequency_below, risk.frequency_above
    assert total - below - above == pytest.approx(0.0005382122616, rel=1e-9)
    assert below == pytest.approx(1.29659002e-12, rel=1e-6)
    assert above == pytest.approx(9.975954446e-06, rel=1e-9)
    assert total == pytest.approx(0.0005481882173, rel=1e-9)
    assert risk.probability_50_years == pytest.approx(0.02703718158, rel=1e-9)
    assert risk.share_outside == pytest.approx(0.01819804846, rel=1e-9)
    assert (risk.above_low, risk.above_high) == pytest.approx((9.928982104e-06, 1e-05), rel=1e-9)
    assert TABLE.rates(0.3) == pytest.approx(0.001950288063, rel=1e-9)
    assert risk.risk_targeted_theta == pytest.approx(1.112799877, rel=1e-9)
    assert risk.risk_targeted_im == pytest.approx(0.5157920036, rel=1e-9)


def test_rates_and_probabilities():
    rate = float(rate_of(0.1, 50.0))
    assert (rate, 1.0 / rate) == pytest.approx((0.002107210313, 474.5610791), rel=1e-9)
    assert probability_in(50.0, rate) == pytest.approx(0.1, rel=1e-12)
    assert float(rate_of(0.01, 50.0)) == pytest.approx(0.0002010067171, rel=1e-9)
    assert function(1.0, 0.3, modeling_dispersion=0.35).beta_total == pytest.approx(0.4609772229)


@pytest.mark.parametrize("modeling", [0.0, 0.35])
def test_standard_error_of_a_constant_slope(modeling):
    """ln lambda = ln H(theta) + k^2 beta^2 / 2 has the derivatives -k and k^2 beta, also if beta is
    a part of the total dispersion."""
    covariance = np.array([[0.02, 0.003], [0.003, 0.01]])
    fitted = function(0.5, 0.4, covariance, modeling_dispersion=modeling)
    risk = SLOPE.risk(fitted, total=True)
    gradient = np.array([-2.5, 2.5**2 * 0.4])
    assert risk.annual_frequency_error / risk.annual_frequency == pytest.approx(
        math.sqrt(gradient @ covariance @ gradient), rel=1e-6
    )


@pytest.mark.parametrize(("theta", "beta"), [(0.6, 1e-6), (1e-4, 0.3), (0.6, 8.0), (30.0, 0.5)])
def test_extreme_functions_stay_finite(theta, beta):
    risk = TABLE.risk(function(theta, beta, np.diag([0.01, 0.01])))
    assert 0.0 < risk.annual_frequency < math.inf and math.isfinite(risk.annual_frequency_error)
    if beta < 1e-3:  # a step: the rate at theta
        assert risk.annual_frequency == pytest.approx(float(TABLE.rates(theta)), rel=1e-6)


def mixture(a1):
    cloud = CollapseCloud(-3.0, 1.1, 0.4, 1.5, a1)
    points = CloudPoints(*([np.ones(1)] * 3), -3.0, 1.1, 0.4, cloud)
    theta, beta = cloud.lognormal(0.02)
    return function(theta, beta, threshold=0.02, cloud=points), cloud


def test_cloud_with_collapses():
    """The mixture is not lognormal: the frequency is the integral of its own probabilities."""
    fitted, cloud = mixture(5.0)
    risk = TABLE.risk(fitted)
    slopes = np.diff(np.log(RATE)) / np.diff(np.log(IM))
    parts = [
        quad(
            lambda x, slope=slope: (
                -slope
                * float(TABLE.rates(math.exp(x)))
                * float(cloud.exceedance(0.02, np.exp(np.array(x))))
            ),
            *ends,
            epsabs=1e-16,
        )[0]
        for slope, ends in zip(
            [slopes[0], *slopes, slopes[-1]],
            zip([-12.0, *np.log(IM)], [*np.log(IM), 12.0], strict=True),
            strict=True,
        )
    ]
    assert risk.annual_frequency == pytest.approx(sum(parts), rel=1e-5)
    assert risk.frequency_below == pytest.approx(parts[0], rel=1e-3)
    assert risk.frequency_above == pytest.approx(parts[-1], rel=1e-4)
    lognormal = TABLE.risk(function(fitted.theta, fitted.beta))
    assert lognormal.annual_frequency != pytest.approx(risk.annual_frequency, rel=1e-2)


def test_cloud_whose_frequency_is_infinite():
    with pytest.raises(AnalysisError, match=r"the frequency is infinite.*--fit stripes"):
        TABLE.risk(mixture(1.2)[0])


def test_frequency_of_a_fit():
    """A function of `fit_cloud` needs no other attribute."""
    (fitted,) = fit_cloud([0.1, 0.2, 0.4, 0.8], [0.003, 0.008, 0.011, 0.03], [0.02])
    curve = HazardCurve(IM[:4], RATE[:4])
    (result,), (warning,) = at_risk([fitted], curve, allow_outside=True)
    assert result.risk.annual_frequency_error > 0.0 and "outside the points" in warning
    with pytest.raises(AnalysisError, match=r"another continuation.*at most 10 %"):
        at_risk([fitted], curve)


def test_known_part_outside():
    """Above the last point the probability is 1: 27 % of the frequency are from there, and no
    continuation of the curve changes it."""
    known = function(0.12, 0.1)
    curve = HazardCurve(np.array([0.01, 0.1, 0.2]), np.array([0.1, 0.01, 0.0027]), unit="g")
    (result,), warnings = at_risk([known], curve)
    assert result.risk.share_outside > 0.25 and not warnings
    assert result.risk.uncertainty_outside < 1e-6


@pytest.mark.parametrize("median", [0.1, 0.6, 2.0])
def test_uncertainty_is_that_of_other_continuations(median):
    """Steep and flat curves beyond the last point change the frequency by at most the bounds."""
    risk = TABLE.risk(function(median, 0.4))
    ends = []
    for rate in (1e-12, RATE[-1] * (1.0 - 1e-9)):
        other = HazardCurve(np.append(IM, 1.6001), np.append(RATE, rate), unit="g")
        ends.append(other.risk(function(median, 0.4)).annual_frequency)
    low = risk.annual_frequency - risk.frequency_above + risk.above_low
    high = risk.annual_frequency - risk.frequency_above + risk.above_high
    assert low * (1.0 - 1e-3) <= min(ends) and max(ends) <= high * (1.0 + 1e-3)
    bounds = (high - low + risk.frequency_below) / risk.annual_frequency
    assert risk.uncertainty_outside == pytest.approx(bounds, rel=1e-9)


@pytest.mark.parametrize("is_mixture", [True, False])
def test_frequency_never_falls(is_mixture):
    """The frequency does not fall with the modeling dispersion, with the rates or with a smaller
    limit; without dispersion it is that without the option."""
    fitted = mixture(5.0)[0] if is_mixture else function(0.6, 0.4)

    def frequency(dispersion, curve=TABLE, fitted=fitted):
        total = replace(fitted, modeling_dispersion=dispersion)
        return curve.risk(total, total=True).annual_frequency

    values = [frequency(dispersion) for dispersion in (0.0, 1e-4, 0.01, 0.1, 0.3, 0.6)]
    assert values[0] == TABLE.risk(fitted).annual_frequency
    assert values[1] == pytest.approx(values[0], rel=1e-4)
    assert np.all(np.diff(values) > 0.0)
    more = HazardCurve(IM, 1.2 * RATE, unit="g")
    assert frequency(0.3, more) == pytest.approx(1.2 * frequency(0.3), rel=1e-9)
    if is_mixture:
        assert frequency(0.3, fitted=replace(fitted, threshold=0.01)) > frequency(0.3)


def test_modeling_dispersion_of_a_mixture():
    """Independent route: the averaged frequency is the mean over the modeling factor of the
    frequencies of shifted hazard curves."""
    fitted, _ = mixture(5.0)
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    shifted = [
        HazardCurve(IM * math.exp(0.3 * node), RATE, unit="g").risk(fitted).annual_frequency
        for node in nodes
    ]
    total = TABLE.risk(replace(fitted, modeling_dispersion=0.3), total=True)
    mean = float(weights @ shifted / weights.sum())
    assert total.annual_frequency == pytest.approx(mean, rel=1e-4)
    probability = replace(fitted, modeling_dispersion=0.3).probability(0.1, total=True)
    assert probability > fitted.probability(0.1)


FORMS = {
    "unit": "im,unit,rate\n0.1,g,0.02\n0.4,g,0.001\n",
    "name": "IM_g,rate\n0.1,0.02\n0.4,0.001\n",
    "parentheses": "im (g),rate\n0.1,0.02\n0.4,0.001\n",
    "cells": "im,rate\n0.1 g,0.02\n0.4 g,0.001\n",
    "other": "im,unit,rate\n0.980665,m/s^2,0.02\n3.92266,m/s^2,0.001\n",
    "probability": "im,unit,probability,years\n0.1,g,0.6321205588285577,50\n0.4,g,0.001,1\n",
}


@pytest.mark.parametrize("form", FORMS)
def test_forms_of_a_curve(tmp_path, form):
    file = tmp_path / "curve.csv"
    file.write_text(FORMS[form])
    curve = read_hazard(str(file)).in_unit(function(0.3, 0.4))
    assert curve.im == pytest.approx([0.1, 0.4], rel=1e-12)
    assert curve.rate == pytest.approx([0.02, 0.001], rel=6e-4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("im,unit,rate\n0.1,g,0.02\n0.2,g,0.02\n", ":3: rate must be smaller"),
        ("im,unit,rate\n0.2,g,0.02\n0.1,g,0.01\n", ":3: im must be larger"),
        ("im,unit,rate\n0.2,g,0.02\n", "at least two points, got 1"),
        ("im,unit,rate\n0.2,g,0.02\n0.4,g,0\n", ":3: rate must be a positive number"),
        ("im,unit,probability\n0.2,g,0.02\n0.4,g,0.01\n", "no column years"),
        ("im,unit,probability,years\n.2,g,1,50\n.4,g,.1,50\n", ":2: probability must be below 1"),
        ("im,unit\n0.2,g\n0.4,g\n", ":1: either the column rate"),
        ("im,unit,rate,probability,years\n.2,g,.1,.1,1\n", ":1: either the column rate"),
    ],
)
def test_invalid_curves(tmp_path, text, message):
    file = tmp_path / "curve.csv"
    file.write_text(text)
    with pytest.raises(ModelError, match=message):
        read_hazard(str(file))


@pytest.mark.parametrize(
    ("hazard", "fitted", "message"),
    [
        ("sa(0.8)", "pga", "other intensity measure"),
        ("sa(0.8)", "sa(1.2)", "other period"),
        ("sa(0.8)", "sa(T1)", "other period"),
        ("rotd100-sa(0.8)", "geometric-mean-sa(0.8)", "other combination"),
        ("sa(0.8)", "geometric-mean-sa(0.803)", ""),
        ("SA (1.1)", "sa(1.09504)", ""),
        ("", "pga", ""),
    ],
)
def test_measures_must_agree(hazard, fitted, message):
    curve = HazardCurve(IM, RATE, hazard, "g", "curve.csv")
    named = function(0.6, 0.4, im=fitted)
    if message:
        with pytest.raises(ModelError, match=f"curve.csv:2: {message}"):
            curve.in_unit(named)
    else:
        assert curve.in_unit(named) is curve


@pytest.mark.parametrize("unit", ["", "m/s"])
def test_units_must_agree(unit):
    with pytest.raises(ModelError, match="state units of the same quantity"):
        HazardCurve(IM, RATE, "", unit, "curve.csv").in_unit(function(0.6, 0.4))
