"""Tests of cyclic tests of drift laws: closed forms, the first law, and the same law in a run."""

import math

import numpy as np
import pytest

from building_cases import model, noise, story
from facts import states
from law_examples import example
from tdint.errors import UsageError
from tdint.model.building import assemble
from tdint.model.story_laws import LAWS, Law
from tdint.response.runs.run import run
from tdint.response.static import cyclic
from tdint.response.static.cyclic import cyclic_test, follow_path, law_path
from tdint.units import STANDARD_GRAVITY, parse_drift

K, FY, HEIGHT = 4e7, 4e5, 3.2
DY = FY / K
ELASTIC = ("linear", "polynomial", "tanh")


def one_story(law, **more):
    return model([story(2e5, K, law, height=HEIGHT)], **more)


def imposed(law, *drifts, **more):
    return cyclic_test(one_story(law), 1, [parse_drift(text) for text in drifts], **more)


# ---- the laws


@pytest.mark.parametrize("hardening", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("ductility", [1.0, 1.5, 2.0, 8.0])
def test_bilinear_loop_agrees_with_closed_form(hardening, ductility):
    """A closed loop dissipates 4 (1 - a) Fy (d - dy); its damping ratio is 2 (m - 1) (1 - a) / (pi
    m (1 + a m - a)) (FEMA 440, eq. 6-1 with the secant period)."""
    second = imposed(Law("bilinear", (FY, hardening)), f"{ductility}dy", cycles=2, points=7).cycles[
        1
    ]
    force = FY * (1.0 + hardening * (ductility - 1.0))
    loop = 4.0 * (1.0 - hardening) * FY * DY * (ductility - 1.0)
    ratio = (
        2.0
        * (ductility - 1.0)
        * (1.0 - hardening)
        / (math.pi * ductility * (1.0 + hardening * (ductility - 1.0)))
    )
    assert second.shear == pytest.approx((force, -force), rel=1e-12)
    assert second.secant_stiffness == pytest.approx(force / (ductility * DY), rel=1e-12)
    assert second.hysteretic_energy == pytest.approx(loop, rel=1e-11, abs=1e-12)
    assert second.damping_ratio == pytest.approx(ratio, rel=1e-11, abs=1e-15)


@pytest.mark.parametrize("name", LAWS)
def test_work_is_strain_energy_plus_dissipated_energy(name):
    """The equation holds at every point of the path, and the dissipated energy does not decrease.
    The trapezoidal integral has an error of order 2 in the spacing of the points.

    The law steel unloads on a curve that is softer than the stiffness k of its stored energy f^2 /
    (2 k), so that only the dissipated energy of its cycles does not decrease.
    """
    errors = []
    for points in (500, 1000):
        test = imposed(example(name, K, FY), "7mm", "4cm", points=points)
        path = test.path
        work = np.append(
            0.0, np.cumsum(0.5 * (path.shear[1:] + path.shear[:-1]) * np.diff(path.drift))
        )
        errors.append(
            np.max(np.abs(path.strain_energy + path.hysteretic_energy - work))
            / np.max(np.abs(work))
        )
        dissipated = path.hysteretic_energy[:: 4 * points if name == "steel" else 1]
        assert np.min(np.diff(dissipated)) > -1e-12 * np.max(path.strain_energy)
    assert errors[0] < 1e-5
    assert errors[1] < 0.5 * errors[0] or errors[1] < 1e-12
    # The energy of a cycle is the energy that is dissipated between its first and last point;
    # elastic laws dissipate no energy.
    assert [cycle.hysteretic_energy for cycle in test.cycles] == pytest.approx(
        np.diff(path.hysteretic_energy[:: 4 * points])
    )
    assert name not in ELASTIC or np.all(path.hysteretic_energy == 0.0)
    assert path.tangent[0] == pytest.approx(K, rel=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_run_follows_same_law_as_cyclic_test(name):
    """The drifts of a run, imposed on the law, give the shears of the run, because the method
    commits the law at each step."""
    stories = [story(2e5, K, example(name, K, force), dashpot=1e5) for force in (6e5, 3e5)]
    building = model(stories, method="newmark-average")
    history = run(building, noise(peak=4.0), history=True).history
    for i in (1, 2):
        path = follow_path(assemble(building), i, history.drift[:, i - 1].copy())
        largest = np.max(np.abs(path.shear))
        assert largest > 2e5
        assert np.max(np.abs(path.shear - history.shear[:, i - 1])) < 1e-10 * largest


# ---- the test


@pytest.mark.parametrize(
    ("coefficients", "shears", "secant", "ratio"),
    [((2.0, 1.0), (3.0, -1.0), 2.0, 0.0), ((1.0, 0.0, -2.0), (-1.0, 1.0), -1.0, math.nan)],
    ids=["asymmetric", "falling"],
)
def test_secant_stiffness_connects_ends_of_loop(coefficients, shears, secant, ratio):
    """For f = 2 d + d^2 between -1 and 1 the forces are 3 and -1, and the slope between them is 2.
    Without a positive force there is no damping ratio."""
    law = Law("polynomial", coefficients)
    (cycle,) = cyclic_test(
        model([story(1.0, coefficients[0], law)]), 1, [parse_drift("1m")], points=4
    ).cycles
    assert (cycle.shear, cycle.secant_stiffness) == (shears, secant)
    assert cycle.damping_ratio == pytest.approx(ratio, nan_ok=True)


def test_p_delta_is_reported_separately():
    """Story 2 of three stories carries the weight of two floors."""
    building = model([story(2e5, K, height=HEIGHT)] * 3, p_delta=True)
    test = cyclic_test(building, 2, [parse_drift("1%")], points=5)
    geometric = -2 * 2e5 * STANDARD_GRAVITY / HEIGHT
    assert test.initial_stiffness == K
    assert test.geometric_stiffness == pytest.approx(geometric, rel=1e-14)
    np.testing.assert_allclose(test.path.shear, K * test.path.drift, rtol=1e-14)
    np.testing.assert_allclose(
        test.shear_with_p_delta, (K + geometric) * test.path.drift, rtol=1e-12, atol=1e-9
    )


@pytest.mark.parametrize(
    ("text", "meters"),
    [
        ("0.02", 0.02 * HEIGHT), ("2%", 0.02 * HEIGHT), (" 2 % ", 0.02 * HEIGHT), ("1", HEIGHT),
        ("20mm", 0.02), ("20 mm", 0.02), ("1e1cm", 0.1), (".5in", 0.0127), ("2m", 2.0),
        ("3dy", 3.0 * DY),
    ],
)  # fmt: skip
def test_amplitude_units(text, meters):
    test = imposed(Law("bilinear", (FY, 0.1)), text, points=1)
    assert test.cycles[0].amplitude == pytest.approx(meters, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "(0.02 or 2%), ... (m, cm, mm, in, ft: 20mm)"),
        ("20 km", "write a drift ratio"),
        ("mm", "write a drift ratio"),
        ("2e", "write a drift ratio"),
        ("nan", "write a drift ratio"),
        ("0", "must be a positive number"),
        ("-2%", "must be a positive number"),
        ("1e999mm", "must be a positive number"),
        ("2", "drift ratio ... at most 1; ... did you mean 2%?"),
        ("101%", "drift ratio ... at most 1"),
    ],
)
def test_invalid_drifts_are_refused(text, message):
    with pytest.raises(UsageError) as caught:
        parse_drift(text)
    assert str(caught.value).startswith(f"drift {text!r}: ")
    assert states(str(caught.value), message)


def test_cyclic_test_of_story_is_independent_of_other_stories():
    """The story has its own height, law and stiffness, and the test does not depend on the stories
    above and below."""
    stories = [
        story(2e5, 3.0 * K, Law("bilinear", (2.0 * FY, 0.1)), height=4.0),
        story(2e5, K, Law("peak-oriented", (FY, 0.05, 0.3)), height=HEIGHT),
        story(2e5, 0.5 * K, Law("linear", ()), height=3.0),
    ]
    among = cyclic_test(model(stories), 2, [parse_drift("2%"), parse_drift("4dy")], points=10)
    alone = cyclic_test(model([stories[1]]), 1, [parse_drift("2%"), parse_drift("4dy")], points=10)
    assert (among.law, among.height, among.yield_drift) == (
        "peak-oriented",
        HEIGHT,
        pytest.approx(DY),
    )
    assert [cycle.amplitude for cycle in among.cycles] == pytest.approx([0.02 * HEIGHT, 4.0 * DY])
    assert among.initial_stiffness == alone.initial_stiffness == K
    np.testing.assert_array_equal(among.path.shear, alone.path.shear)
    assert among.cycles == alone.cycles
    drift = law_path(model(stories), 2, [1.0, -2.0], in_yield_drifts=True).path.drift
    assert (drift.max(), drift.min()) == pytest.approx((DY, -2.0 * DY))


def test_tangent_at_first_drift_of_a_path():
    """The path starts at zero drift, so the first drift can already be on the second branch."""
    law = Law("bilinear", (K * DY, 0.05))
    path = follow_path(assemble(model([story(1.0, K, law)])), 1, np.array([3.0 * DY, 4.0 * DY]))
    assert path.tangent == pytest.approx([0.05 * K, 0.05 * K])
    assert path.shear == pytest.approx(K * DY * np.array([1.1, 1.15]))


def test_number_of_points_is_limited(monkeypatch):
    """Three amplitudes of two cycles with four quarters of five points have 120 points."""
    building = model([story(1.0, 2.0)])
    sizes = [parse_drift(size) for size in ("1mm", "2mm", "3mm")]
    monkeypatch.setattr(cyclic, "MAX_CYCLE_POINTS", 120)
    path = cyclic_test(building, 1, sizes, cycles=2, points=5).path
    assert len(path.drift) == 121
    for more in ({"cycles": 3, "points": 4}, {"cycles": 2, "points": 6}):
        with pytest.raises(
            UsageError, match=f"{3 * more['cycles']} cycles of {4 * more['points']} points exceed"
        ):
            cyclic_test(building, 1, sizes, **more)


@pytest.mark.parametrize(
    ("sizes", "more"), [("1%", {}), ([], {}), (["1%"], {"cycles": 0}), ([0.01], {"points": 0})]
)
def test_cyclic_test_states_what_it_expects(sizes, more):
    law = Law("bilinear", (FY, 0.05))
    with pytest.raises(UsageError, match=r"sizes must be a sequence .*\['1%', '20mm', '4dy'\]"):
        cyclic_test(one_story(law), 1, sizes, **more)
    both = cyclic_test(one_story(law), 1, np.array([0.01, 0.02])).cycles
    assert [cycle.amplitude for cycle in both] == pytest.approx([0.01 * HEIGHT, 0.02 * HEIGHT])
