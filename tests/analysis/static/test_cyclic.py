"""Cyclic tests of drift laws: closed forms, the first law, and the same law in a run."""

import math

import numpy as np
import pytest

from building_cases import model, noise, story
from law_examples import example
from tdint.analysis import static as cyclic
from tdint.analysis.run.run import run
from tdint.analysis.static import cyclic_path, cyclic_test, follow_path, path_test
from tdint.errors import AnalysisError, UsageError
from tdint.model.building import assemble
from tdint.model.definition import LAWS, Law
from tdint.units import STANDARD_GRAVITY, parse_drift

K, FY, HEIGHT = 4e7, 4e5, 3.2
DY = FY / K
ELASTIC = ("linear", "polynomial", "tanh")


def one_story(law, **more):
    return model([story(2e5, K, law, height=HEIGHT)], **more)


def imposed(law, *drifts, **more):
    return cyclic_test(one_story(law), 1, [parse_drift(text) for text in drifts], **more)


def work(path):
    """Integral of the shear over the drift from the start, by trapezoids."""
    middle = 0.5 * (path.shear[1:] + path.shear[:-1])
    return np.append(0.0, np.cumsum(middle * np.diff(path.drift)))


# ---- the laws


@pytest.mark.parametrize("hardening", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("ductility", [1.0, 1.5, 2.0, 8.0])
def test_the_bilinear_loop(hardening, ductility):
    """A closed loop dissipates 4 (1 - a) Fy (d - dy); its damping ratio is 2 (m - 1) (1 - a) / (pi m (1 + a m - a))
    (FEMA 440, eq. 6-1 with the secant period)."""
    second = imposed(Law("bilinear", (FY, hardening)), f"{ductility}dy", cycles=2, points=7).cycles[1]
    force = FY * (1.0 + hardening * (ductility - 1.0))
    loop = 4.0 * (1.0 - hardening) * FY * DY * (ductility - 1.0)
    ratio = 2.0 * (ductility - 1.0) * (1.0 - hardening) / (math.pi * ductility * (1.0 + hardening * (ductility - 1.0)))
    assert second.shear == pytest.approx((force, -force), rel=1e-12)
    assert second.secant_stiffness == pytest.approx(force / (ductility * DY), rel=1e-12)
    assert second.dissipated == pytest.approx(loop, rel=1e-11, abs=1e-12)
    assert second.damping_ratio == pytest.approx(ratio, rel=1e-11, abs=1e-15)


@pytest.mark.parametrize("name", LAWS)
def test_work_is_stored_or_dissipated(name):
    """At every point of the path, not at its end alone; and what is dissipated stays so. The integral by trapezoids
    has an error of order 2 in the distance of the points."""
    errors = []
    for points in (500, 1000):
        path = imposed(example(name, K, FY), "7mm", "4cm", points=points).path
        errors.append(np.max(np.abs(path.recoverable + path.dissipated - work(path))) / np.max(np.abs(work(path))))
        assert np.min(np.diff(path.dissipated)) > -1e-12 * np.max(path.recoverable)
    assert errors[0] < 1e-5
    assert errors[1] < 0.5 * errors[0] or errors[1] < 1e-12


@pytest.mark.parametrize("name", LAWS)
def test_a_closed_loop_encloses_what_it_dissipates(name):
    test = imposed(example(name, K, FY), "40mm", cycles=3, points=500)
    done = work(test.path)
    for cycle in test.cycles[1:]:
        end = 2000 * cycle.number
        # A law that deteriorates does not come back to the same force, nor to the same stored energy.
        stored = test.path.recoverable[end] - test.path.recoverable[end - 2000]
        assert name == "imk" or abs(stored) < 1e-9 * FY * 0.04
        lost = cycle.dissipated + stored
        assert done[end] - done[end - 2000] == pytest.approx(lost, rel=1e-5, abs=1e-9 * FY * 0.04)
    if name in ELASTIC:
        assert np.all(test.path.dissipated == 0.0)


@pytest.mark.parametrize("name", LAWS)
def test_the_tangent_is_the_slope(name):
    """The trapezoidal rule over the tangents gives the forces back, but where the tangent jumps: at a few points."""
    test = imposed(example(name, K, FY), "4cm", points=1000)
    tangent, h = test.path.tangent, 0.04 / 1000
    smooth = np.abs(np.diff(tangent)) < 0.02 * K
    slope = np.diff(test.path.shear) / np.diff(test.path.drift)
    assert np.sum(~smooth) < 20
    # The rule's error is h^2 f''' / 12, and f''' is about K / DY^2.
    assert np.max(np.abs(slope - 0.5 * (tangent[1:] + tangent[:-1]))[smooth]) < K * (h / DY) ** 2
    assert tangent[0] == pytest.approx(K, rel=1e-12)


def test_peak_oriented_loops_pass_the_farthest_point():
    """A smaller cycle aims at the farthest point without reaching it; the next larger one goes through it."""
    test = imposed(Law("peak-oriented", (FY, 0.05, 0.3)), "4dy", "2dy", "5dy", points=20)
    drift, shear = test.path.drift, test.path.shear
    farthest = test.cycles[0].shear
    for side, first in ((0, 160), (1, 200)):
        rising = slice(first, first + 21) if side == 0 else slice(first, first + 41)
        index = first + int(np.argmin(np.abs(drift[rising] - (4.0 * DY if side == 0 else -4.0 * DY))))
        assert abs(drift[index]) == pytest.approx(4.0 * DY)
        assert shear[index] == pytest.approx(farthest[side], rel=1e-12)
    # In the cycle to 2 dy the way from zero force leads straight to the point at 4 dy.
    towards = (farthest[0] - shear[100]) / (4.0 * DY - drift[100])
    assert shear[90] == pytest.approx(shear[100] + towards * (drift[90] - drift[100]), rel=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_a_run_lies_on_the_same_law(name):
    """The drifts of a run imposed on the law give its shears: a method that commits at its steps takes the same way."""
    stories = [story(2e5, K, example(name, K, force), dashpot=1e5) for force in (6e5, 3e5)]
    building = model(stories, method="newmark-average")
    history = run(building, noise(peak=4.0), history=True).history
    for i in (1, 2):
        path = follow_path(assemble(building), i, history.drift[:, i - 1].copy())
        largest = np.max(np.abs(path.shear))
        assert largest > 2e5
        assert np.max(np.abs(path.shear - history.shear[:, i - 1])) < 1e-10 * largest


# ---- the test


def test_the_path():
    expected = [0, 1, 2, 1, 0, -1, -2, -1, 0, 1, 2, 1, 0, -1, -2, -1, 0, 3, 6, 3, 0, -3, -6, -3, 0, 3, 6, 3, 0, -3, -6]
    assert cyclic_path([2.0, 6.0], 2, 2).tolist() == [*expected, -3, 0]
    test = imposed(Law("linear", ()), "2mm", "6mm", cycles=2, points=2)
    assert test.cycle_numbers.tolist() == [0, *(cycle for cycle in (1, 2, 3, 4) for _ in range(8))]
    assert [cycle.number for cycle in test.cycles] == [1, 2, 3, 4]
    assert [cycle.amplitude for cycle in test.cycles] == [0.002, 0.002, 0.006, 0.006]


def test_an_asymmetric_law():
    """f = 2 d + d^2 between -1 and 1: forces 3 and -1, the slope between them 2."""
    test = cyclic_test(model([story(1.0, 2.0, Law("polynomial", (2.0, 1.0)))]), 1, [parse_drift("1m")], points=4)
    (cycle,) = test.cycles
    assert (cycle.shear, cycle.secant_stiffness, cycle.damping_ratio) == ((3.0, -1.0), 2.0, 0.0)


def test_no_damping_ratio_without_a_positive_secant_stiffness():
    test = cyclic_test(model([story(1.0, 1.0, Law("polynomial", (1.0, 0.0, -2.0)))]), 1, [parse_drift("1m")])
    assert test.cycles[0].secant_stiffness == -1.0
    assert math.isnan(test.cycles[0].damping_ratio)


def test_p_delta_is_told_apart():
    """Story 2 of three carries the weight of two floors."""
    building = model([story(2e5, K, height=HEIGHT)] * 3, p_delta=True)
    test = cyclic_test(building, 2, [parse_drift("1%")], points=5)
    geometric = -2 * 2e5 * STANDARD_GRAVITY / HEIGHT
    assert test.initial_stiffness == K
    assert test.geometric_stiffness == pytest.approx(geometric, rel=1e-14)
    np.testing.assert_allclose(test.path.shear, K * test.path.drift, rtol=1e-14)
    np.testing.assert_allclose(test.shear_with_p_delta, (K + geometric) * test.path.drift, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "meters"),
    [
        ("0.02", 0.02 * HEIGHT), ("2%", 0.02 * HEIGHT), (" 2 % ", 0.02 * HEIGHT), ("1", HEIGHT), ("20mm", 0.02),
        ("20 mm", 0.02), ("1e1cm", 0.1), (".5in", 0.0127), ("2m", 2.0), ("3dy", 3.0 * DY),
    ],
)  # fmt: skip
def test_amplitudes(text, meters):
    test = imposed(Law("bilinear", (FY, 0.1)), text, points=1)
    assert test.cycles[0].amplitude == pytest.approx(meters, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "write a drift ratio (0.02 or 2%), a length (m, cm, mm, in, ft: 20mm)"),
        ("20 km", "write a drift ratio"),
        ("mm", "write a drift ratio"),
        ("2e", "write a drift ratio"),
        ("nan", "write a drift ratio"),
        ("0", "must be a positive number"),
        ("-2%", "must be a positive number"),
        ("1e999mm", "must be a positive number"),
        ("2", "a drift ratio is 1 at most; a number without a unit is one, did you mean 2%?"),
        ("101%", "a drift ratio is 1 at most"),
    ],
)
def test_drifts_that_are_none(text, message):
    with pytest.raises(UsageError) as caught:
        parse_drift(text)
    assert str(caught.value).startswith(f"drift {text!r}: ")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("number", "drift", "more", "message"),
    [
        (0, "1%", {}, "story 0: the model has 2 stories, counted from 1 at the bottom"),
        (3, "1%", {}, "story 3: the model has 2 stories"),
        (1, "1%", {}, "drift 1% is a drift ratio, and story 1 has no height; give a length, such as 20mm"),
        (2, "2dy", {}, "drift 2dy is a multiple of the yield drift, and the law of story 2 does not yield"),
        (2, "1%", {"cycles": 10**9}, "1000000000 cycles of 800 points are more than 2,000,000 points"),
        (2, "1%", {"points": 500_001}, "1 cycles of 2000004 points are more than 2,000,000 points"),
    ],
)
def test_what_is_refused(number, drift, more, message):
    building = model([story(1.0, K, height=None), story(1.0, K)])
    with pytest.raises(UsageError) as caught:
        cyclic_test(building, number, [parse_drift(drift)], **more)
    assert str(caught.value).startswith(message)


def test_a_story_among_others_is_as_if_alone():
    """Its own height, law and stiffness: no story knows of those above and below in such a test."""
    stories = [
        story(2e5, 3.0 * K, Law("bilinear", (2.0 * FY, 0.1)), height=4.0),
        story(2e5, K, Law("peak-oriented", (FY, 0.05, 0.3)), height=HEIGHT),
        story(2e5, 0.5 * K, Law("linear", ()), height=3.0),
    ]
    among = cyclic_test(model(stories), 2, [parse_drift("2%"), parse_drift("4dy")], points=10)
    alone = cyclic_test(model([stories[1]]), 1, [parse_drift("2%"), parse_drift("4dy")], points=10)
    assert (among.law, among.height, among.yield_drift) == ("peak-oriented", HEIGHT, pytest.approx(DY))
    assert [one.amplitude for one in among.cycles] == pytest.approx([0.02 * HEIGHT, 4.0 * DY])
    assert among.initial_stiffness == alone.initial_stiffness == K
    np.testing.assert_array_equal(among.path.shear, alone.path.shear)
    assert among.cycles == alone.cycles
    given = path_test(model(stories), 2, [1.0, -2.0], in_yield_drifts=True).path.drift
    assert (given.max(), given.min()) == pytest.approx((DY, -2.0 * DY))


def test_a_law_without_a_finite_force():
    law = Law("polynomial", (K, 0.0, 1e200))
    with pytest.raises(AnalysisError, match="story 1: its law has no finite force and energy at drift 5e\\+59 m"):
        imposed(law, "1e60m", points=2)


def test_as_many_points_as_are_allowed(monkeypatch):
    """Three sizes of two cycles of four quarters of five points: 120."""
    building = model([story(1.0, 2.0)])
    sizes = [parse_drift(size) for size in ("1mm", "2mm", "3mm")]
    monkeypatch.setattr(cyclic, "MOST_OF_CYCLES", 120)
    path = cyclic_test(building, 1, sizes, cycles=2, points=5).path
    assert len(path.drift) == 121
    for more in ({"cycles": 3, "points": 4}, {"cycles": 2, "points": 6}):
        with pytest.raises(
            UsageError, match=f"{3 * more['cycles']} cycles of {4 * more['points']} points are more than 120"
        ):
            cyclic_test(building, 1, sizes, **more)
