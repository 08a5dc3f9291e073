"""The law `multilinear` and the two sides of `bilinear` against independent forms of the rules."""

import math

import numpy as np
import pytest

from law_paths import along, follow, law_table, random_path
from tdint import load_model
from tdint.kernels.laws.multilinear import _RULES
from tdint.model.building import assemble
from tdint.model.story_laws import LAWS, Law
from tdint.response.static.cyclic import follow_path

POINTS = [(0.02, 80.0), (0.04, 120.0), (0.10, 150.0)]
OTHER = [(0.015, 60.0), (0.03, 90.0), (0.08, 115.0)]  # the same slopes at other drifts
LAST = 200.0
MANY = [(0.002 * j, 80.0 * (1.0 - 0.96**j)) for j in range(1, 41)]


def multilinear(rule, points, last_slope=LAST, negative=None):
    """Return a law; the points of the negative side are those of the positive side by default."""

    def numbers(side):
        values = [float(number) for point in side for number in point]
        return values + [math.inf] * (80 - len(values))

    return Law(
        "multilinear",
        (
            float(_RULES.index(rule)),
            last_slope,
            *numbers(points),
            *numbers(negative or points),
        ),
    )


def curve(points, last_slope, drift):
    """Return the force of a backbone curve at a positive drift."""
    drifts, forces = np.array([(0.0, 0.0), *points]).T
    return np.interp(drift, drifts, forces) + last_slope * np.maximum(drift - drifts[-1], 0.0)


def springs(points, last_slope, negative, drifts):
    """Return the force and the plastic work of parallel elastic-perfectly plastic springs."""
    corner_drifts, corner_forces = np.array([(0.0, 0.0), *points]).T
    slopes = np.append(np.diff(corner_forces) / np.diff(corner_drifts), last_slope)
    stiffness = slopes[:-1] - slopes[1:]
    upper = stiffness * corner_drifts[1:]
    lower = -stiffness * np.array([drift for drift, _ in negative])
    z, previous, forces, work = np.zeros(len(points)), 0.0, [], 0.0
    for drift in drifts:
        free = z + stiffness * (drift - previous)
        z = np.clip(free, lower, upper)
        moving = stiffness > 0.0
        work += np.sum(np.abs(z * (free - z))[moving] / stiffness[moving])
        forces.append(last_slope * drift + z.sum())
        previous = drift
    return np.array(forces), work


def isotropic(points, last_slope, negative, drifts):
    """Return the force by bisection of the plastic drift of each step."""
    k = points[0][1] / points[0][0]

    def strength(side, plastic):
        points_of_side = points if side > 0.0 else negative
        x = np.array([drift - force / k for drift, force in points_of_side])
        y = np.array([force for _, force in points_of_side])
        beyond = last_slope * k / (k - last_slope) * max(plastic - x[-1], 0.0)
        return np.interp(plastic, x, y) + beyond

    force, plastic, previous, forces = 0.0, 0.0, 0.0, []
    for drift in drifts:
        trial = force + k * (drift - previous)
        side = math.copysign(1.0, trial)
        if abs(trial) > strength(side, plastic):
            low, high = 0.0, abs(trial) / k
            for _ in range(80):
                middle = 0.5 * (low + high)
                if abs(trial) - k * middle > strength(side, plastic + middle):
                    low = middle
                else:
                    high = middle
            plastic += low
            trial = side * strength(side, plastic)
        force, previous = trial, drift
        forces.append(force)
    return np.array(forces)


@pytest.mark.parametrize("negative", [POINTS, OTHER])
@pytest.mark.parametrize("seed", range(4))
def test_kinematic_rule_is_sum_of_elastic_plastic_springs(seed, negative):
    drifts = random_path(seed)
    forces, work = springs(POINTS, LAST, negative, drifts)
    result = along(multilinear("kinematic", POINTS, LAST, negative), drifts)
    assert result.shear == pytest.approx(forces, rel=1e-11, abs=1e-9)
    assert result.hysteretic_energy[-1] == pytest.approx(work, rel=1e-9)


def test_kinematic_rule_with_many_points_passes_all_of_them_in_one_step():
    drifts = np.array([0.3, -0.3, 0.2, -0.25, 0.3])
    forces, _ = springs(MANY, 0.0, MANY, drifts)
    result = along(multilinear("kinematic", MANY, 0.0), drifts)
    assert result.shear == pytest.approx(forces, rel=1e-10, abs=1e-9)


def test_points_on_a_line_change_nothing():
    between = [(0.01, 40.0), POINTS[0], (0.03, 100.0), *POINTS[1:], (0.15, 160.0)]
    drifts = random_path(7)
    for rule in _RULES[:1] + _RULES[2:]:
        few, many = (along(multilinear(rule, points), drifts) for points in (POINTS, between))
        if rule in ("kinematic", "elastic"):
            assert many.shear == pytest.approx(few.shear, rel=1e-10, abs=1e-9)


@pytest.mark.parametrize("hardening", [0.05, 0.0, -0.05])
@pytest.mark.parametrize("negative", [80.0, 50.0])
def test_one_point_is_the_bilinear_law(hardening, negative):
    k, strength = 4000.0, 80.0
    drifts = random_path(3, largest=0.12)
    law = Law("bilinear", (strength, hardening, negative))
    other = multilinear("kinematic", [(0.02, strength)], hardening * k, [(negative / k, negative)])
    expected, found = along(law, drifts, stiffness=k), along(other, drifts)
    assert found.shear == pytest.approx(expected.shear, rel=1e-11, abs=1e-9)
    assert found.strain_energy == pytest.approx(expected.strain_energy, rel=1e-9, abs=1e-9)
    assert found.hysteretic_energy == pytest.approx(expected.hysteretic_energy, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("negative", [POINTS, OTHER])
@pytest.mark.parametrize("seed", range(4))
def test_isotropic_rule_shares_the_plastic_path(seed, negative):
    drifts = random_path(seed, turns=15)
    result = along(multilinear("isotropic", POINTS, LAST, negative), drifts)
    expected = isotropic(POINTS, LAST, negative, drifts)
    assert result.shear == pytest.approx(expected, rel=1e-9, abs=1e-7)


@pytest.mark.parametrize("points", [POINTS, [(0.02, 80.0), (0.05, 90.0), (0.08, 250.0)]])
def test_origin_rule_is_the_line_from_the_point_of_maximum_drift(points):
    drifts = random_path(5)
    maxima, expected = {1.0: points[0][0], -1.0: OTHER[0][0]}, []
    for drift in drifts:
        side = math.copysign(1.0, drift)
        maxima[side] = max(maxima[side], abs(drift))
        curve_points = points if side > 0.0 else OTHER
        expected.append(drift * curve(curve_points, LAST, maxima[side]) / maxima[side])
    result = along(multilinear("origin", points, LAST, OTHER), drifts)
    assert result.shear == pytest.approx(expected, rel=1e-10, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_peak_rule_is_the_peak_oriented_law_without_degradation_of_unloading(seed):
    k, strength, hardening = 4000.0, 80.0, 0.05
    drifts = random_path(seed)
    law = Law("peak-oriented", (strength, hardening, 0.0))
    expected = along(law, drifts, stiffness=k)
    found = along(multilinear("peak", [(0.02, strength)], hardening * k), drifts)
    assert found.shear == pytest.approx(expected.shear, rel=1e-11, abs=1e-9)
    assert found.hysteretic_energy == pytest.approx(expected.hysteretic_energy, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_peak_rule_is_the_trilinear_law_without_pinching(seed):
    drifts = random_path(seed)
    law = Law("trilinear-pinching", (80.0, 120.0, 0.06, 1.0, 0.0))
    expected = along(law, drifts, stiffness=4000.0)
    found = along(multilinear("peak", [(0.02, 80.0), (0.06, 120.0)], 0.0), drifts)
    assert found.shear == pytest.approx(expected.shear, rel=1e-11, abs=1e-9)


def test_elastic_rule_is_the_curve():
    drifts = random_path(2)
    negative = [(0.03, 0.0), (0.05, -10.0), (0.06, 400.0)]
    result = along(multilinear("elastic", POINTS, LAST, negative), drifts)
    expected = np.where(drifts >= 0.0, curve(POINTS, LAST, drifts), -curve(negative, LAST, -drifts))
    assert result.shear == pytest.approx(expected, rel=1e-12, abs=1e-10)
    assert np.all(result.hysteretic_energy == 0.0)
    gap = along(Law("gap", (0.03, 2e4)), drifts, stiffness=4000.0)
    stops = along(multilinear("elastic", [(0.03, 120.0)], 24e3), drifts)
    assert stops.shear == pytest.approx(gap.shear, rel=1e-12, abs=1e-9)
    assert stops.strain_energy == pytest.approx(gap.strain_energy, rel=1e-12, abs=1e-12)


CURVES = {
    "hardening": (POINTS, LAST),
    "flat": (POINTS, 0.0),
    "falling": (POINTS, -500.0),
    "falling segment": ([*POINTS, (0.13, 100.0)], -1500.0),
    "stiffening": ([(0.02, 80.0), (0.04, 100.0), (0.06, 300.0)], 1000.0),
}


ACCEPTED = [
    (rule, name)
    for rule in _RULES
    for name, (points, last_slope) in CURVES.items()
    if not LAWS["multilinear"].fault(4000.0, multilinear(rule, points, last_slope).parameters)
]


def test_rules_refuse_curves_that_they_cannot_follow():
    refused = {(rule, name) for rule in _RULES[:-1] for name in CURVES} - set(ACCEPTED)
    assert refused == {
        ("kinematic", "falling segment"),
        ("kinematic", "stiffening"),
        ("isotropic", "stiffening"),
    }


@pytest.mark.parametrize(("rule", "curve_name"), ACCEPTED)
def test_energy_is_conserved_and_dissipation_does_not_decrease(rule, curve_name):
    points, last_slope = CURVES[curve_name]
    law = multilinear(rule, points, last_slope)
    for seed in range(3):
        drifts = random_path(seed, largest=0.12, points=400, turns=12)
        result = along(law, drifts)
        middle = 0.5 * (result.shear[1:] + result.shear[:-1])
        work = np.sum(middle * np.diff(drifts)) + 0.5 * result.shear[0] * drifts[0]
        total = result.strain_energy[-1] + result.hysteretic_energy[-1]
        scale = np.max(np.abs(result.shear)) * 0.1
        assert total == pytest.approx(work, rel=2e-3, abs=1e-4 * scale)
        # A line to the origin that becomes steeper releases more energy than was supplied.
        if (rule, curve_name) != ("origin", "stiffening"):
            assert np.min(np.diff(result.hysteretic_energy)) >= -1e-12 * scale


@pytest.mark.parametrize("rule", ["isotropic", "origin", "peak"])
def test_story_fails_where_its_curve_reaches_zero_force(rule):
    law = multilinear(rule, [(0.02, 80.0)], -1000.0)
    result = along(law, [0.02, 0.06, 0.0999, 0.1001, 0.05, -0.05])
    assert result.shear[:3] == pytest.approx([80.0, 40.0, 0.1], rel=1e-9)
    assert np.all(result.shear[3:] == 0.0)


def test_bilinear_loop_with_two_strengths_agrees_with_hand_calculation():
    k, positive, negative, a = 1000.0, 20.0, 12.0, -0.05
    table = law_table("bilinear", positive, a, negative)
    forces, stored, dissipated = follow(table, [0.02, 0.06, 0.028, 0.0])
    top = positive + a * k * 0.04
    bottom = top - (positive + negative)
    assert forces == pytest.approx([positive, top, bottom, bottom - a * k * 0.028], rel=1e-12)
    # The plastic drift is (1 - a) times the drift during yielding.
    expected = (1.0 - a) * (0.5 * (positive + top) * 0.04)
    expected += (1.0 - a) * 0.5 * -(forces[2] + forces[3]) * 0.028
    assert dissipated == pytest.approx(expected, rel=1e-12)
    assert stored == pytest.approx(forces[3] ** 2 / (2.0 * k), rel=1e-12)


@pytest.mark.parametrize("k", [1000.0])
def test_yield_drift_of_bilinear_law_is_the_smaller_one(k):
    assert LAWS["bilinear"].yield_drift(k, Law("bilinear", (20.0, 0.1, 5.0)).parameters) == 0.005


def test_self_centering_story_of_two_elements():
    """A hysteretic part of 1/4 and an elastic part of 3/4 of the same curve dissipate a quarter of
    the energy of the hysteretic law, and the flags return to zero drift."""
    cycle = np.concatenate(
        [np.linspace(a, b, 41)[1:] for a, b in ((0, 4), (4, -4), (-4, 4), (4, -4), (-4, 0))]
    )

    def dissipated(elements):
        definition = {"stories": [{"mass": 1, "elements": elements}], "damping": "none"}
        result = follow_path(assemble(load_model(definition)), 1, cycle)
        return result.hysteretic_energy[159] - result.hysteretic_energy[79], result.shear

    hysteretic = {"type": "bilinear", "stiffness": 0.25, "yield_force": 0.25, "hardening": 0}
    elastic = {"type": "multilinear", "rule": "elastic", "backbone": [[1, 0.75]]}
    energy, shear = dissipated([{**hysteretic, "stiffness": 1, "yield_force": 1}])
    assert energy == pytest.approx(12.0, rel=1e-12)
    energy, shear = dissipated([hysteretic, elastic])
    assert energy == pytest.approx(3.0, rel=1e-12)
    assert shear[39] == pytest.approx(1.0, rel=1e-12)
    # Back at 1 and at -1, the flag is half as wide as the hysteretic force.
    assert shear[[54, 64]] == pytest.approx([0.5, -1.0], rel=1e-12)


def test_multilinear_curve_of_springs_equals_its_elements():
    drifts = random_path(11)
    corners = np.array([(0.0, 0.0), *POINTS])
    slopes = np.append(np.diff(corners[:, 1]) / np.diff(corners[:, 0]), LAST)
    elements = [
        {
            "type": "bilinear",
            "stiffness": float(slope - next_slope),
            "yield_force": float((slope - next_slope) * drift),
            "hardening": 0,
        }
        for slope, next_slope, (drift, _) in zip(slopes, slopes[1:], POINTS, strict=False)
    ]
    elements.append({"type": "linear", "stiffness": LAST})
    definition = {"stories": [{"mass": 1, "elements": elements}], "damping": "none"}
    expected = follow_path(assemble(load_model(definition)), 1, drifts)
    found = along(multilinear("kinematic", POINTS), drifts)
    assert found.shear == pytest.approx(expected.shear, rel=1e-10, abs=1e-9)
    energies = expected.hysteretic_energy
    assert found.hysteretic_energy == pytest.approx(energies, rel=1e-9, abs=1e-9)
