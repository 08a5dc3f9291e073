"""Fragility functions for OpenQuake, read according to the specification of its format."""

import math
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.special import ndtr

from tdint.errors import UsageError
from tdint.studies.campaign.exports import fragility_model, vulnerability_model, whole_types
from tdint.studies.fragility.fragility_function import Fragility

SPACE = "{http://openquake.org/xmlns/nrml/0.5}"


def function(threshold, theta, beta=0.4, im="sa(0.6)", unit="g", **options):
    return Fragility(
        "stripes", theta, beta, np.eye(2), 40, threshold=threshold, im=im, unit=unit, **options
    )


OFFICE = [
    function(one, theta)
    for one, theta in zip((0.01, 0.02, 0.03, 0.05), (0.2, 0.4, 0.7, 1.0), strict=True)
]
STATES = ("slight", "moderate", "extensive", "complete")


def read(data):
    """Return median and dispersion of each limit state, and check the order of the elements."""
    (model,) = ElementTree.fromstring(data)
    description, states, *functions = model
    assert (description.tag, states.tag) == (f"{SPACE}description", f"{SPACE}limitStates")
    assert model.attrib.keys() >= {"id", "assetCategory", "lossCategory"}
    found = {}
    for element in functions:
        imls, *params = element
        assert (element.get("format"), element.get("shape"), imls.tag) == (
            "continuous",
            "logncdf",
            f"{SPACE}imls",
        )
        assert [part.get("ls") for part in params] == states.text.split()
        values = [(float(part.get("mean")), float(part.get("stddev"))) for part in params]
        medians = [
            (m**2 / math.hypot(m, s), math.sqrt(math.log(1.0 + (s / m) ** 2))) for m, s in values
        ]
        assert (
            float(imls.get("minIML"))
            < min(medians)[0]
            <= max(medians)[0]
            < float(imls.get("maxIML"))
        )
        found[element.get("id")] = (
            imls.get("imt"),
            dict(zip(states.text.split(), medians, strict=True)),
        )
    return found


def test_a_published_model():
    data = fragility_model(OFFICE, "office", STATES)
    ((imt, found),) = read(data).values()
    assert imt == "SA(0.6)"
    for expected, state in zip(OFFICE, STATES, strict=True):
        assert found[state] == pytest.approx((expected.theta, 0.4), rel=1e-7)
    assert (
        f'minIML="{0.2 * math.exp(-1.6):.6g}" maxIML="{1.0 * math.exp(1.6):.6g}"'.encode() in data
    )
    assert b'ls="slight" mean="0.216657' in data and b'stddev="0.09024' in data


# 3.26, hazardlib/imt.py
READ_BY_OPENQUAKE = (
    r"PGA|PGV|IA|CAV|AvgSA|SA\(\d+\.?\d*\)|AvgSA\(\d+\.*\d*\)|SDi\(\d+\.?\d*,\d+\.?\d*\)"
)


@pytest.mark.parametrize(
    ("im", "unit", "imt", "factor"),
    [
        ("sa(0.60001)", "m/s^2", "SA(0.60001)", 1.0 / 9.80665),
        ("sa-avg(0.6)", "g", "AvgSA(0.6)", 1.0),
        ("sa-avg(0.2:2)", "cm/s^2", "AvgSA", 0.01 / 9.80665),
        ("pgv", "in/s", "PGV", 2.54),
        ("arias", "m/s", "IA", 1.0),
        ("cav", "m/s", "CAV", 1.0 / 9.80665),
        ("sdi(0.6,0.1)", "m", "SDi(0.6,0.1)", 100.0),
        ("pga", "m/s^2", "PGA", 1.0 / 9.80665),
    ],
)
def test_measures_have_the_names_and_units_of_openquake(im, unit, imt, factor):
    ((name, found),) = read(fragility_model([function(0.1, 2.0, im=im, unit=unit)], "x")).values()
    assert name == imt and re.fullmatch(READ_BY_OPENQUAKE, name)
    assert found["ds1"][0] == pytest.approx(2.0 * factor, rel=1e-6)


def test_each_damage_level_of_a_building_has_a_function():
    """The dispersion is the square root of the sum of squares of modeling dispersion and dispersion
    of the ground motions: 0.5 from 0.3 and 0.4."""
    functions = [
        function(0.1, 1.0, damage=0.0, modeling_dispersion=0.3),
        function(0.1, 0.5, damage=0.02),
    ]
    found = read(fragility_model(functions, "x & y"))
    assert list(found) == ["x & y", "x & y-damaged-0.02"]
    assert found["x & y"][1]["ds1"] == pytest.approx((1.0, 0.5), rel=1e-7)


def test_each_building_type_has_a_function():
    """Each function has the name, the thresholds and the intensity measure of its type."""
    frame = [
        function(0.2, 1.0, type="C1 & more", state="b"),
        function(0.1, 0.5, type="C1 & more", state="a"),
    ]
    wall = [
        function(0.3, 0.8, im="sa(0.3)", type="W", state="a"),
        function(0.4, 0.9, im="sa(0.3)", type="W", state="b"),
    ]
    found = read(fragility_model([*frame[::-1], *wall], "region"))
    assert {name: imt for name, (imt, _) in found.items()} == {
        "C1 & more": "SA(0.6)",
        "W": "SA(0.3)",
    }
    assert found["C1 & more"][1]["b"] == pytest.approx((1.0, 0.4), rel=1e-7)
    assert found["W"][1]["a"] == pytest.approx((0.8, 0.4), rel=1e-7)
    assert whole_types([*frame, wall[0]]) == (frame, ["W"])
    with pytest.raises(UsageError, match="W: no function of b"):
        fragility_model([*frame[::-1], wall[0]], "region")


@pytest.mark.parametrize(
    ("functions", "states", "text"),
    [
        (OFFICE, ("one",), "4 thresholds"),
        (OFFICE, ("a", "b", "c", "d e"), "each a single word"),
        ([function(0.1, 1.0, im="sa(T1)")], (), "for OpenQuake; got"),
        ([function(0.1, 1.0, unit="")], (), "for OpenQuake; got"),
    ],
)
def test_refusals(functions, states, text):
    with pytest.raises(UsageError, match=text):
        fragility_model(functions, "x", states)


RATIOS = np.array([0.05, 0.2, 0.6, 1.0])
TYPES = [
    function(of.threshold, of.theta, beta, type=name, state=state)
    for name, beta in (("C1", 0.4), ("URM", 0.16))
    for of, state in zip(OFFICE, STATES, strict=True)
]


def test_losses_of_types():
    """Mean and coefficient of variation of the loss of a building follow from the probabilities of
    the states, at the points and interpolated between the points."""
    data = vulnerability_model(TYPES, {"C1": (*RATIOS, 1.0), "URM": (*RATIOS, 1.0)}, "town")
    ((_, *functions),) = ElementTree.fromstring(data)
    assert [element.get("id") for element in functions] == ["C1", "URM"] and {
        element.get("dist") for element in functions
    } == {"BT"}
    for element, beta in zip(functions, (0.4, 0.16), strict=True):
        im, mean, cov = (np.array(part.text.split(), float) for part in element)
        between = np.sqrt(im[1:] * im[:-1])
        for intensity, mean_loss, tolerance in (
            (im, mean, 1e-8),
            (between, np.interp(between, im, mean), 3e-3),
        ):
            beyond = np.array([ndtr(np.log(intensity / state.theta) / beta) for state in OFFICE])
            shares = beyond - np.vstack([beyond[1:], np.zeros_like(intensity)])
            assert np.max(np.abs(mean_loss - RATIOS @ shares)) < tolerance
        exceedance = np.array([ndtr(np.log(im / state.theta) / beta) for state in OFFICE])
        shares = exceedance - np.vstack([exceedance[1:], np.zeros_like(im)])
        square = RATIOS**2 @ shares
        some = (mean > 1e-3) & (mean < 0.999)
        assert (mean * cov)[some] == pytest.approx(np.sqrt(square - mean**2)[some], rel=1e-4)
        assert np.all(cov**2 <= 1.0 / mean - 1.0)


def test_openquake_reads_both_files(tmp_path):
    """If OpenQuake is installed, its reader returns the exported medians, dispersions and
    losses."""
    pytest.importorskip("openquake.risklib.read_nrml")
    from openquake.hazardlib import nrml

    (tmp_path / "f.xml").write_bytes(fragility_model(TYPES, "town"))
    (tmp_path / "v.xml").write_bytes(
        vulnerability_model(TYPES, {"C1": (*RATIOS, 1.0), "URM": (*RATIOS, 1.0)}, "town")
    )
    fragilities, losses = (
        nrml.to_python(str(tmp_path / "f.xml")),
        nrml.to_python(str(tmp_path / "v.xml")),
    )
    for name, beta in (("C1", 0.4), ("URM", 0.16)):
        mean, deviation = fragilities["SA(0.6)", name].array.T
        assert np.sqrt(np.log(1.0 + (deviation / mean) ** 2)) == pytest.approx([beta] * 4, rel=1e-6)
        assert mean * np.exp(-0.5 * beta**2) == pytest.approx(
            [state.theta for state in OFFICE], rel=1e-6
        )
        function_ = losses["SA(0.6)", name]
        beyond = np.array([ndtr(math.log(0.5 / state.theta) / beta) for state in OFFICE])
        assert np.interp(0.5, function_.imls, function_.mean_loss_ratios) == pytest.approx(
            float(RATIOS @ (beyond - np.append(beyond[1:], 0.0))), abs=3e-3
        )
