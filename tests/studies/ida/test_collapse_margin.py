"""Collapse margins by FEMA P-695: values that two other programs computed, and refusals."""

import numpy as np
import pytest

from tdint.errors import AnalysisError, UsageError
from tdint.studies.ida.collapse_margin import (
    Acceptance,
    CollapseMargin,
    collapse_factor,
    effective_yield_displacement,
    record_dispersion,
    spectral_shape_factor,
)
from tdint.studies.motions.scaling import normalization
from tdint.units import STANDARD_GRAVITY as G

DESIGN = "smt=0.9g,ductility=3.5,sdc=Dmax,dr=good,td=good,mdl=fair"
PGV = np.array([30.0, 45.0, 60.0, 38.0])
SA = G * np.array([[0.3, 0.42], [0.55, 0.4], [0.6, 0.85], [0.28, 0.36]])
FACTORS = np.array([[2.1, 2.6], [1.8, 3.0], [2.4, 2.2], [1.9, 2.8]])


def test_margin_of_four_pairs():
    assert normalization(PGV) == pytest.approx(
        [1.383333333, 0.9222222222, 0.6916666667, 1.092105263], rel=1e-9
    )
    assert normalization(PGV) * PGV == pytest.approx(41.5, rel=1e-9)
    margin = CollapseMargin.of(PGV, SA, FACTORS, Acceptance.parse(DESIGN), period=1.0)
    assert margin.median_sa / G == pytest.approx(0.415, rel=1e-9)
    assert 0.9 * G / margin.median_sa == pytest.approx(2.168674699, rel=1e-9)
    assert margin.s_ct / G == pytest.approx(0.913, rel=1e-9)  # value n/2
    assert margin.cmr == pytest.approx(0.913 / 0.9, rel=1e-9)
    # The logarithmic median of the factors is another definition.
    other = 0.9 * 1.059552666 / 0.415
    assert other == pytest.approx(np.exp(np.median(np.log(FACTORS))), rel=1e-9)
    assert margin.acmr == pytest.approx(margin.ssf * margin.cmr, rel=1e-12)
    assert np.std(np.log(FACTORS), ddof=1) == pytest.approx(0.1822804239, rel=1e-9)


def test_another_set_of_four_pairs():
    """The values of the public case, with seven more digits of the factors."""
    pgv = np.array([28.0, 47.0, 61.0, 35.0])
    sa = G * np.array([[0.31, 0.44], [0.52, 0.41], [0.63, 0.8], [0.27, 0.35]])
    factors = np.array([[2.2, 2.7], [1.7, 3.1], [2.3, 2.1], [1.95, 2.9]])
    design = Acceptance.parse(DESIGN.replace("0.9g", "0.85g"))
    margin = CollapseMargin.of(pgv, sa, factors, design, period=1.0)
    assert margin.median_sa / G == pytest.approx(0.4385298221137077, rel=1e-12)
    assert margin.s_ct / G == pytest.approx(0.964765608650157, rel=1e-12)
    assert margin.cmr == pytest.approx(1.1350183631178319, rel=1e-12)


@pytest.mark.parametrize(
    ("ductility", "period", "epsilon", "factor"),
    [
        (1.1, 0.5, 1.5, 1.049069797),
        (2.0, 1.0, 1.5, 1.182936611),
        (8.0, 0.5, 1.0, 1.135193255),
        (8.0, 1.5, 1.5, 1.608835933),
        (20.0, 3.0, 1.5, 1.608835933),  # constant above a ductility of 8 and a period of 1.5 s
    ],
)
def test_spectral_shape_factor(ductility, period, epsilon, factor):
    assert spectral_shape_factor(ductility, period, epsilon) == pytest.approx(factor, rel=1e-9)


def test_dispersion_and_acceptance():
    design = Acceptance.parse(DESIGN)
    assert record_dispersion(3.5) == design.beta_rtr == 0.4
    assert (record_dispersion(1.0), record_dispersion(2.0)) == pytest.approx((0.2, 0.3))
    assert design.beta_total == pytest.approx(0.6020797289, rel=1e-9)
    assert (design.acmr_10, design.acmr_20) == pytest.approx((2.163216467, 1.659843107), rel=1e-9)
    half = Acceptance(G, 2.0, 1.5, (0.4, 0.0, 0.0))
    assert half.beta_total == pytest.approx(0.5)
    assert (half.acmr_10, half.acmr_20) == pytest.approx((1.897952707, 1.523195783), rel=1e-9)
    # CMR 1.45 and SSF 1.2: a margin whose ACMR is 1.74
    margin = CollapseMargin.of(PGV, SA, FACTORS, design, period=1.0)
    scale = 1.74 / margin.acmr
    shifted = CollapseMargin.of(PGV, scale * SA, FACTORS, design, period=1.0)
    assert shifted.acmr == pytest.approx(1.74, rel=1e-12)
    assert shifted.collapse_probability == pytest.approx(0.1787986341, rel=1e-9)
    assert "ACMR of each building at least 1.66: met" in shifted.sentences[1]
    assert "at least 2.163: not met" in shifted.sentences[1]


def test_period_based_ductility():
    yielding = effective_yield_displacement(1.3, 0.12, 1.0, 1.2)
    assert yielding == pytest.approx(0.05580177701, rel=1e-9)
    assert 0.35 / yielding == pytest.approx(6.272201688, rel=1e-9)


def test_components_without_collapse():
    assert collapse_factor(np.array([3.0, 1.0, np.inf, 2.0])) == 2.0
    assert collapse_factor(np.array([3.0, 1.0, 2.0])) == 2.0
    open_factors = np.where(FACTORS > 2.0, np.inf, FACTORS)
    with pytest.raises(AnalysisError, match="2 of 8 components cause collapse"):
        CollapseMargin.of(PGV, SA, open_factors, Acceptance.parse(DESIGN), period=1.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("smt=0.9g,", "", "requires smt"),
        ("smt=0.9g", "smt=0.9", "smt must be a number with its unit"),
        ("smt=0.9g", "smt=0g", "must be"),
        ("ductility=3.5", "ductility=0.9", "ductility must be at least 1, got 0.9"),
        ("ductility=3.5", "ductility=x", "ductility must be at least 1"),
        ("sdc=Dmax", "sdc=E", "sdc must be one of B, C, Dmin, Dmax, got 'E'"),
        ("mdl=fair", "mdl=fine", "mdl must be one of superior, good, fair, poor"),
    ],
)
def test_invalid_designs(old, new, message):
    with pytest.raises(UsageError, match=message):
        Acceptance.parse(DESIGN.replace(old, new))
