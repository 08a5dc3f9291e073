"""Tests of the pushover analysis: closed forms, and equilibrium of every story in every row."""

import math
from pathlib import Path

import numpy as np
import pytest

import tdint
from building_cases import Law, model, story
from tdint import load_model
from tdint.errors import UsageError
from tdint.kernels import layout as rows
from tdint.model.building import assemble
from tdint.response.spectra.modal import response_spectrum_analysis
from tdint.response.static.cyclic import follow_path
from tdint.response.static.pushover import PATTERNS, _Story, _target, pushover
from tdint.units import STANDARD_GRAVITY, parse_drift

CONFIGS = Path(__file__).parents[3] / "configs"


def softening(strength, dy, ultimate=60.0, residual=0.1):
    side = (strength, 4.0 * dy, 8.0 * dy, 1.1, residual, ultimate * dy, 1.0)
    return Law("imk", (*side, *side, *4 * [50.0 * dy], 1.0, 0.4, 0.5))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_pushover_of_linear_building(pattern):
    """Story shears are the sums of the forces above, so that roof displacement over base shear is
    the sum of share / k."""
    masses, k = np.array([3.0, 2.0, 1.0]), np.array([900.0, 700.0, 400.0])
    case = model([story(m, s, height=3.0) for m, s in zip(masses, k, strict=True)])
    result = pushover(case, parse_drift("1%"), pattern=pattern, points=5)
    shape = {"uniform": np.ones(3), "triangular": np.array([1.0, 2.0, 3.0])}
    shape["first-mode"] = assemble(case).modes().shapes[:, 0]
    forces = masses * shape[pattern] / np.sum(masses * shape[pattern])
    share = np.cumsum(forces[::-1])[::-1]
    assert result.forces == pytest.approx(forces, rel=1e-12)
    assert result.roof_displacement == pytest.approx(0.09 * np.arange(6) / 5, rel=1e-10)
    assert result.applied_force == pytest.approx(
        result.roof_displacement / np.sum(share / k), rel=1e-9
    )
    assert result.roof_drift_ratio[-1] == pytest.approx(0.01, rel=1e-10)


def test_pushover_of_one_story_is_its_backbone_curve():
    """For k = Fy = 1, the force decreases from drift 5 and is constant at 0.1 from 5 + 8 / 1.1;
    P-delta reduces it by 0.01 per unit of drift."""
    heavy = 0.01 * 3.0 / STANDARD_GRAVITY
    case = model([story(heavy, 1.0, softening(1.0, 1.0), height=3.0)], p_delta=True)
    result = pushover(case, parse_drift("20m"), points=60)
    x = result.roof_displacement
    fall = 1.1 - 1.1 / 8.0 * (x - 5.0)
    backbone = np.minimum(np.minimum(x, 1.0 + 0.025 * (x - 1.0)), np.maximum(fall, 0.1))
    expected = backbone - 0.01 * x
    assert result.ended == "no remaining lateral resistance"
    assert result.applied_force == pytest.approx(expected[: x.size], abs=1e-9)
    assert x[-1] == pytest.approx(
        (1.1 + 5.0 * 1.1 / 8.0) / (1.1 / 8.0 + 0.01), rel=1e-9
    )  # fall is 0.01 x
    assert result.roof_at_largest == pytest.approx(5.0, abs=1e-9)


@pytest.mark.parametrize("points", [7, 10, 23])
def test_maximum_applied_force_does_not_depend_on_rows(points):
    """The maximum is 1.1 at the capping drift 5 for all numbers of rows."""
    case = model([story(1.0, 1.0, softening(1.0, 1.0)), story(1.0, 4.0)])
    result = pushover(case, parse_drift("12m"), points=points)
    assert result.largest_applied_force == pytest.approx(1.1, rel=1e-9)
    assert result.drift_at_largest == pytest.approx([5.0, 1.1 * result.forces[1] / 4.0], rel=1e-9)
    assert np.max(result.applied_force) <= result.largest_applied_force


@pytest.mark.long
def test_decreasing_roof_displacement_is_followed():
    """The lower story softens by 1.1 / 8 per unit of drift from its capping force 1.1 at a drift of
    5. The upper story with a stiffness of 0.05, which carries half the force, unloads by 10 per
    unit of force, whereas the lower drift increases only by 8 / 1.1."""
    case = model([story(1.0, 1.0, softening(1.0, 1.0)), story(1.0, 0.05)])
    result = pushover(case, parse_drift("40m"), pattern="uniform", points=100)
    back = np.flatnonzero(np.diff(result.roof_displacement) < 0.0)
    before = (
        result.drift[:, 0] < 12.0
    )  # beyond this drift, the residual strength allows arbitrary displacements of the upper story
    assert np.max(result.roof_displacement[before]) == pytest.approx(5.0 + 11.0, abs=0.2)
    assert back.size > 10
    assert np.all(result.roof_displacement >= 0.0)
    falling = result.drift[:, 0] >= 5.0
    assert result.drift[:, 1] == pytest.approx(10.0 * result.applied_force, rel=1e-9, abs=1e-9)
    on_the_fall = np.maximum(1.1 - 1.1 / 8.0 * (result.drift[falling, 0] - 5.0), 0.1)
    assert result.applied_force[falling] == pytest.approx(on_the_fall, abs=1e-9)


@pytest.mark.long
def test_tall_frame_with_p_delta_is_followed_to_zero_strength():
    """Every story loses stiffness by yielding. The first yielding story softens alone, and all
    other stories unload. The drift at zero strength follows in closed form from the stiffness k,
    the hardening a k after yielding and the P-delta stiffness -g."""
    k, a, strength, weight = 1e8, 0.03, 5e6, 2e6
    stories = [
        story(weight / STANDARD_GRAVITY, k, Law("bilinear", (strength, a)), height=3.0)
        for _ in range(40)
    ]
    result = pushover(model(stories, p_delta=True), parse_drift("2%"), pattern="uniform", points=30)
    fall = 40.0 * weight / 3.0
    assert result.ended == "no remaining lateral resistance"
    assert result.drift[-1, 0] == pytest.approx((1.0 - a) * strength / (fall - a * k), rel=1e-8)
    assert result.drift[-1, 1:] == pytest.approx(np.zeros(39), abs=1e-10)
    # the roof displacement decreases
    assert np.argmax(result.roof_displacement) < result.roof_displacement.size - 5


def test_failed_story_ends_pushover():
    case = model([story(1.0, 100.0, softening(1.0, 0.01, ultimate=20.0)), story(1.0, 200.0)])
    result = pushover(case, parse_drift("1m"), points=300)
    assert result.ended == "no remaining lateral resistance"
    assert result.drift[-1, 0] == pytest.approx(0.2, abs=0.005)
    assert result.drift[-1, 1] == pytest.approx(0.0, abs=1e-12)
    assert result.applied_force[-1] == pytest.approx(0.0, abs=1e-10)
    assert np.all(result.applied_force[1:-1] > 0.0)  # only the last row has no strength


CASES = {
    "frame": (load_model(CONFIGS / "collapse-prone-frame.yaml"), "4%"),
    "hazus": (load_model(CONFIGS / "hazus-c1.yaml"), "3%"),
    "mixed": (
        model([
            story(2e5, 4e7, Law("bouc-wen", (4e5, 0.02, 2.0, 0.6))),
            story(2e5, 4e7, Law("tanh", (3.6e5,))),
            story(2e5, 3e7, Law("peak-oriented", (1.8e5, 0.05, 0.3))),
        ], p_delta=True),
        "1%",
    ),
    "equal stories": (model([story(1.0, 100.0, softening(1.0, 0.01))] * 3), "0.2m"),
}  # fmt: skip


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] * (name == "mixed")) for name in CASES]
)
def test_story_shears_are_in_equilibrium_in_every_row(name):
    """The laws are evaluated again, from row to row, for the drifts of the table."""
    case, drift = CASES[name]
    result = pushover(case, parse_drift(drift), pattern="uniform", points=12)
    building = assemble(case)
    share = np.cumsum(result.forces[::-1])[::-1]
    for i in range(building.stories):
        path = follow_path(building, i + 1, result.drift[:, i].copy())
        carried = path.shear + building.linear_terms[rows.GEOMETRIC, i] * path.drift
        assert carried == pytest.approx(
            share[i] * result.applied_force, abs=2e-5 * np.max(result.applied_force)
        )
    goals = np.arange(13) / 12 * _target(parse_drift(drift), building)
    # a curve that ends without strength stops before the target
    table_rows = result.applied_force.size - bool(result.ended)
    assert result.roof_displacement[:table_rows] == pytest.approx(goals[:table_rows], rel=1e-8)


class Staircase(_Story):
    """Story with a force that increases in steps, x + 0.99 sin x; its tangents between 0.01 and
    1.99 mislead Newton's method."""

    def __init__(self):
        self.drift, self.force, self.initial_tangent, self.tangent, self._maximum_force = (
            0.0,
            0.0,
            1.99,
            1.99,
            100.0,
        )

    def response_at(self, drift):
        return drift + 0.99 * math.sin(drift), 1.0 + 0.99 * math.cos(drift)


@pytest.mark.parametrize("force", [*np.arange(-60.0, 60.0, 9.1), math.pi, -3.0 * math.pi])
def test_drift_at_force_is_found_with_misleading_tangents(force):
    found = Staircase().drift_at_force(force)
    assert found is not None
    assert found + 0.99 * math.sin(found) == pytest.approx(force, abs=1e-8)


@pytest.mark.parametrize(
    ("drift", "pattern", "message"),
    [
        ("4%", "uniform", "drift 4% "),
        ("1m", "triangular", "the triangular pattern requires the height"),
        ("1m", "modal", "unknown pattern 'modal'; known: first-mode, uniform, triangular"),
    ],
)
def test_invalid_arguments_are_refused(drift, pattern, message):
    with pytest.raises(UsageError) as caught:
        pushover(model([story(1.0, 100.0, height=None)]), parse_drift(drift), pattern=pattern)
    assert str(caught.value).startswith(message)


def test_pattern_of_numbers():
    """Only the ratios of the forces are used: numbers of the uniform pattern give its curve."""
    case = model([story(m, 700.0, height=3.0) for m in (3.0, 2.0, 1.0)])
    uniform, numbers = (
        pushover(case, parse_drift("1%"), pattern=pattern, points=5)
        for pattern in ("uniform", "30,20,10")
    )
    assert numbers.forces == pytest.approx(uniform.forces, rel=1e-12)
    assert numbers.applied_force == pytest.approx(uniform.applied_force, rel=1e-12)
    for pattern, message in (
        ("1,2", "a force for each of the 3 floors, got 2"),
        ("1,2,0", "positive at the roof"),
        ("-1,2,3", "zero or positive numbers"),
        ("linear", "unknown pattern 'linear'"),
    ):
        with pytest.raises(UsageError, match=message):
            pushover(case, parse_drift("1%"), pattern=pattern)


def test_base_shear_is_the_restoring_force_and_exceeds_the_applied_force_by_p_delta():
    """Applied force (k - P/h) d and restoring force k d of one story, in the curve, in events and
    in the response spectrum analysis."""
    stiffness, weight_over_height = 2e6, 1e5 * 9.80665 / 3.0
    law = {"type": "bilinear", "yield_force": 4e4, "hardening": 0.1}
    story = {"mass": 1e5, "height": 3.0, "stiffness": stiffness}
    building = {"stories": [story], "p_delta": True}
    pushed = tdint.pushover(building, "1%")
    np.testing.assert_allclose(pushed.base_shear, stiffness * pushed.drift[:, 0], rtol=1e-12)
    applied = (stiffness - weight_over_height) * pushed.drift[:, 0]
    np.testing.assert_allclose(pushed.applied_force, applied, rtol=1e-9, atol=1e-6)
    elements = [
        {"name": "a", "type": "linear", "stiffness": 1e6},
        {"name": "b", "stiffness": 1e6, **law},
    ]
    both = {"stories": [{"mass": 1e5, "height": 3.0, "elements": elements}], "p_delta": True}
    (event,) = tdint.pushover(both, "3%").events
    assert (event.base_shear, event.drift) == pytest.approx((8e4, 0.04), rel=1e-4)
    assert event.applied_force == pytest.approx(8e4 - weight_over_height * 0.04, rel=1e-4)
    modal = response_spectrum_analysis(building, "asce7:sds=0.5,sd1=0.3,tl=8")
    restoring = stiffness * modal.drift_cqc[0]
    assert (modal.base_shear[0], modal.shear_cqc[0]) == pytest.approx((restoring,) * 2, rel=1e-9)
    assert modal.applied_force[0] == pytest.approx(
        restoring - weight_over_height * modal.drift_cqc[0], rel=1e-9
    )
