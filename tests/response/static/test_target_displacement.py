"""Tests of target displacements against the equations of the two standards by hand, for oscillators
that yield without hardening."""

import math
from functools import partial

import numpy as np
import pytest

from building_cases import Law, model, story
from selection import every
from tdint import pushover, target_displacements
from tdint.errors import AnalysisError, UsageError
from tdint.response.static.target_displacement import (
    SITE_FACTORS,
    coefficient_displacement,
    largest_strength_ratio,
)
from tdint.units import STANDARD_GRAVITY as G

EC8 = "ec8:type=1,soil=C,ag=0.25g"
# number of points of a curve; corners between the points are located, so that additional points do
# not change the result
POINTS = 15


def oscillator(mass, strength, yield_drift, hardening=0.0, **more):
    law = Law("bilinear", (strength, hardening))
    return model([story(mass, strength / yield_drift, law, height=3.0)], **more)


def closed_form(strengths, stiffness, hardening, share, shear):
    """Return the roof displacement of bilinear stories that carry given shares of the base
    shears."""
    force = np.multiply.outer(shear, share)
    beyond = np.maximum(force - strengths, 0.0)
    return np.sum((force - beyond) / stiffness + beyond / (hardening * stiffness), axis=-1)


def flat(tmp_path, acceleration):
    """Return the file of a target spectrum with a constant pseudo-acceleration in g."""
    file = tmp_path / "flat.csv"
    file.write_text(f"period_s,sa_g\n0.01,{acceleration}\n4,{acceleration}\n")
    return str(file)


@pytest.mark.parametrize(
    ("mass", "strength", "yields", "period", "ratio", "displacement"),
    [
        (1.2e6, 2.4e6, 0.06, 1.088280, None, 0.116582),  # T* > TC: equal displacements
        (
            4.0e5,
            1.2e6,
            0.008,
            0.324462,
            2.349510,
            0.027964,
        ),  # T* < TC: more than the elastic 0.018796
    ],
)
def test_n2_of_oscillator_agrees_with_hand_calculation(
    mass, strength, yields, period, ratio, displacement
):
    """The values of EN 1998-1:2004, annex B, agree with a calculation by hand to its six digits."""
    n2, _ = target_displacements(
        pushover(oscillator(mass, strength, yields), "200mm", points=POINTS), EC8
    )
    assert (n2.period, n2.roof_displacement) == pytest.approx(
        (period, displacement), rel=2e-6, abs=5e-7
    )
    assert (n2.yield_force, n2.yield_displacement) == pytest.approx((strength, yields), rel=1e-6)
    assert n2.ductility[0] == pytest.approx(displacement / yields, rel=2e-5)
    if ratio:
        assert n2.strength_ratio == pytest.approx(ratio, rel=1e-6)


@pytest.mark.parametrize(
    (
        "period",
        "acceleration",
        "strength",
        "site",
        "mass_factor",
        "ratio",
        "factors",
        "displacement",
    ),
    [
        (1.1, 0.55, 0.12, "D", 1.0, 4.583333, (1.0, 1.0), 0.214908 / 1.3),
        (0.45, 1.0, 0.2, "D", 0.9, 4.5, (1.288066, 1.075617), 0.083630 / 1.2),
        (0.15, 1.0, 0.3, "C", 1.0, 3.333333, (1.648148, 1.302469), 0.011998),
    ],
)
def test_coefficient_method_of_oscillator_agrees_with_hand_calculation(
    tmp_path, period, acceleration, strength, site, mass_factor, ratio, factors, displacement
):
    """The calculation follows ASCE 41-17, 7.4.3.3; C0 of a single mass is 1."""
    mass = 2e5
    force = strength * mass * G
    case = oscillator(mass, force, force / mass * (period / (2.0 * math.pi)) ** 2)
    options = {"site_class": site, "mass_factor": mass_factor}
    _, target = target_displacements(
        pushover(case, "0.5m", points=POINTS), flat(tmp_path, acceleration), **options
    )
    assert target.participation == pytest.approx(1.0, rel=1e-12)
    assert (target.period, target.strength_ratio) == pytest.approx((period, ratio), rel=1e-6)
    assert target.factors == pytest.approx(factors, rel=1e-6)
    assert target.roof_displacement == pytest.approx(
        displacement, rel=5e-5
    )  # the digits that were written down


@pytest.mark.parametrize(
    ("period", "mass_factor", "ratio", "c1", "c2", "displacement"),
    [
        (0.45, 0.9, 3.375, 1.195473251, 1.034818673, 0.07280747136),
        (0.15, 0.9, 3.375, 1.989583333, 1.313368056, 0.01708747538),
        (0.8, 0.9, 3.375, 1.061848958, 1.0, 0.197510196),
        (1.2, 1.0, 3.75, 1.0, 1.0, 0.4185133276),
    ],
)
def test_coefficients_of_another_program(period, mass_factor, ratio, c1, c2, displacement):
    """Sa 0.9 g, W 5000 kN, V_y 1200 kN, a 60, C0 1.3."""
    strength_ratio = 0.9 * 5000.0 * mass_factor / 1200.0
    assert strength_ratio == pytest.approx(ratio, rel=1e-9)
    found = coefficient_displacement(period, 0.9 * G, strength_ratio, SITE_FACTORS["D"], 1.3)
    assert found == pytest.approx((c1, c2, displacement), rel=1e-9)


@pytest.mark.parametrize(
    ("factor", "slope", "limit"), [(0.2, -0.08, 7.309225574), (0.8, -0.17, 6.189370653)]
)
def test_largest_strength_ratio_of_another_program(factor, slope, limit):
    found = largest_strength_ratio(0.2 / 0.04, -0.2, -0.05, factor, 0.45)
    assert found == pytest.approx(limit, rel=1e-9)
    # The effective negative slope alpha_e, from the exponent 1 + 0.15 ln T
    effective = -((4.0 * (found - 5.0)) ** (-1.0 / (1.0 + 0.15 * math.log(0.45))))
    assert effective == pytest.approx(slope, rel=1e-9)
    assert largest_strength_ratio(5.0, 0.1, 0.0, factor, 0.45) == 5.0


def test_mass_factor_is_1_for_long_periods(tmp_path):
    """ASCE 41-17, table 7-4: C_m is 1 for periods above 1 s. The result states C_m, a and class."""
    mass, force = 2e5, 0.12 * 2e5 * G
    case = oscillator(mass, force, force / mass * (1.1 / (2.0 * math.pi)) ** 2)
    pushed = pushover(case, "0.5m", points=POINTS)
    _, reduced = target_displacements(pushed, flat(tmp_path, 0.55), mass_factor=0.8)
    _, full = target_displacements(pushed, flat(tmp_path, 0.55), site_class="c")
    assert (reduced.mass_factor, reduced.strength_ratio) == (1.0, full.strength_ratio)
    assert (full.site_class, full.site_factor, full.mass_factor) == ("C", 90.0, 1.0)


def test_base_shear_at_the_target_is_the_base_shear_of_the_curve():
    """With P-delta it exceeds the applied force."""
    building = model(
        [story(3e5, 4e7, Law("bilinear", (8e5, 0.05)), height=3.0) for _ in range(3)], p_delta=True
    )
    curve = pushover(building, "300mm", points=POINTS)
    for target in target_displacements(curve, EC8):
        at_target = [target.roof_displacement], curve.roof_displacement
        assert target.base_shear == pytest.approx(
            np.interp(*at_target, curve.base_shear)[0], rel=1e-4
        )
        assert target.base_shear > 1.001 * target.applied_force


def test_elastic_building_has_elastic_target_displacement():
    """Both methods give Gamma S_d(T1), because the curve is a straight line with the shape of the
    first mode for any pattern."""
    case = model([story(2e5, 1.5e8, Law("bilinear", (4e6, 0.03)), height=3.0)] * 3)
    n2, coefficients = target_displacements(
        pushover(case, "4%", points=POINTS), "asce7:sds=0.2,sd1=0.1,tl=8"
    )
    omega = (
        2.0 * math.sqrt(1.5e8 / 2e5) * math.sin(math.pi / 14.0)
    )  # frequency of three equal masses and springs that are fixed at one end
    shape = np.sin(np.arange(1, 4) * math.pi / 7.0) / math.sin(3.0 * math.pi / 7.0)
    expected = (
        shape.sum() / (shape @ shape) * min(0.2, 0.1 * omega / (2.0 * math.pi)) * G / omega**2
    )
    for target in (n2, coefficients):
        assert target.period == pytest.approx(2.0 * math.pi / omega, rel=1e-6)
        assert target.roof_displacement == pytest.approx(expected, rel=1e-6)
        assert target.drift == pytest.approx(
            np.diff(np.concatenate(([0.0], shape))) * expected, rel=1e-6
        )
        assert np.max(target.ductility) < 1.0
    assert n2.strength_ratio < 1.0


def test_devices_are_ignored_and_isolators_have_no_drift_ratio():
    """A pushover ignores attachments and dashpots between floors, and so do its target
    displacements."""
    target = "ec8:type=1,soil=C,ag=0.2g"
    floor = {"mass": 1e5, "height": 3.0, "stiffness": 5e7}
    bearings = {"mass": 1e5, "stiffness": 4e6, "isolator": True}
    bearings |= {"law": {"type": "bilinear", "yield_force": 1e5, "hardening": 0.1}}
    devices = {
        "attachments": [{"name": "absorber", "floor": 3, "mass": 1e4, "stiffness": 1e5}],
        "links": [{"from": "ground", "to": 2, "dashpot": 1e5}],
    }
    bare = {"stories": [bearings, floor, floor]}
    results = [
        target_displacements(pushover(building, "4%", points=POINTS), target)
        for building in (bare, bare | devices)
    ]
    for without, with_devices in zip(*results, strict=True):
        assert with_devices.roof_displacement == without.roof_displacement
        assert np.array_equal(with_devices.drift_ratio, without.drift_ratio, equal_nan=True)
        assert np.isnan(without.drift_ratio).tolist() == [True, False, False]


def test_idealized_curves_balance_areas():
    """The curve of hardening stories in series has a corner at the yielding of each story. The
    idealized curves of both methods have the same area up to the target displacement, and the first
    line of the coefficient method intersects the curve."""
    strengths, stiffness, hardening = (
        np.array([8e5, 5e5]),
        np.array([1.5e8, 1.2e8]),
        np.array([0.1, 0.05]),
    )
    laws = [
        Law("bilinear", (strength, a)) for strength, a in zip(strengths, hardening, strict=True)
    ]
    case = model([story(2e5, k, law, height=3.0) for k, law in zip(stiffness, laws, strict=True)])
    pushed = pushover(case, "4%", points=POINTS)
    share = np.cumsum(pushed.forces[::-1])[::-1]

    roof = partial(closed_form, strengths, stiffness, hardening, share)
    n2, target = target_displacements(pushed, EC8)
    for result, end in ((n2, n2.yield_force), (target, target.applied_force)):
        assert roof(result.applied_force) == pytest.approx(result.roof_displacement, rel=1e-7)
        corners = np.array([0.0, *sorted(strengths / share), result.applied_force])
        work = np.sum(np.diff(roof(corners)) * (corners[1:] + corners[:-1])) / 2.0
        lines = result.yield_force * result.yield_displacement / 2.0
        lines += (
            (result.yield_force + end)
            / 2.0
            * (result.roof_displacement - result.yield_displacement)
        )
        assert lines == pytest.approx(work, rel=1e-7)
    assert roof(0.6 * target.yield_force) == pytest.approx(
        0.6 * target.yield_displacement, rel=1e-7
    )


@pytest.mark.parametrize("hardening", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("ductility", [2.0, 12.0])
def test_coefficient_method_of_bilinear_oscillator(tmp_path, hardening, ductility):
    """The two lines of the oscillator balance the areas for any ductility. Beyond 1.67 times the
    yield displacement, another strength also balances the areas; it is not the solution."""
    mass, yields, strength = 2e4, 0.004, 8e4
    period = 2.0 * math.pi * math.sqrt(mass * yields / strength)
    # C1 C2 R = ductility: a polynomial of R - 1, by (7-28) to (7-30) with the site class D.
    a, b = 1.0 / (60.0 * max(period, 0.2) ** 2), 1.0 / (800.0 * period**2)
    beyond = np.roots(
        np.polymul(np.polymul([a, 1.0], [b, 0.0, 1.0]), [1.0, 1.0]) - [0, 0, 0, 0, ductility]
    )
    ratio = 1.0 + next(x.real for x in beyond if abs(x.imag) < 1e-9 and x.real > 0.0)
    case = oscillator(mass, strength, yields, hardening)
    _, target = target_displacements(
        pushover(case, "4m", points=POINTS), flat(tmp_path, ratio * strength / mass / G)
    )
    assert (target.yield_force, target.yield_displacement) == pytest.approx(
        (strength, yields), rel=1e-6
    )
    assert (target.period, target.strength_ratio) == pytest.approx((period, ratio), rel=1e-6)
    assert target.ductility[0] == pytest.approx(ductility, rel=1e-6)


@pytest.mark.parametrize("seed", every(2, range(16)))
def test_coefficient_method_of_hardening_buildings(seed):
    """The strength is the smallest that balances the areas up to the target displacement. It is
    found by a scan of all strengths over the closed-form curve, story by story."""
    draw = np.random.default_rng(seed)
    stories = int(draw.integers(1, 6))
    stiffness = np.sort(draw.uniform(0.8e8, 2e8, stories))[::-1]
    hardening = draw.uniform(0.02, 0.3, stories)
    share = np.linspace(1.0, 0.3, stories)
    strengths = draw.uniform(0.1, 0.4) * 2e5 * stories * G * share * draw.uniform(0.8, 1.2, stories)
    laws = [Law("bilinear", pair) for pair in zip(strengths, hardening, strict=True)]
    case = model([story(2e5, k, law, height=3.0) for k, law in zip(stiffness, laws, strict=True)])
    pushed = pushover(case, "40%", points=POINTS)
    target = target_displacements(pushed, f"ec8:type=1,soil=C,ag={draw.uniform(0.2, 0.6):.3f}g")[1]
    share = np.cumsum(pushed.forces[::-1])[::-1]

    roof = partial(closed_form, strengths, stiffness, hardening, share)
    corners = np.array([0.0, *sorted(strengths / share)])
    corners = np.append(corners[corners < target.applied_force], target.applied_force)
    area = np.sum(np.diff(roof(corners)) * (corners[1:] + corners[:-1])) / 2.0
    tried = np.linspace(1e-3, 1.0, 100_001) * target.applied_force
    end = target.roof_displacement
    excess = (tried * end + target.applied_force * (end - roof(0.6 * tried) / 0.6)) / 2.0 - area
    crossed = np.flatnonzero((excess[:-1] < 0.0) & (excess[1:] >= 0.0))
    if target.strength_ratio <= 1.0 and end < corners[1] / target.applied_force * end:
        return
    i = crossed[0]
    balanced = tried[i] - excess[i] * (tried[i + 1] - tried[i]) / (excess[i + 1] - excess[i])
    assert target.yield_force == pytest.approx(balanced, rel=1e-6)
    assert roof(0.6 * target.yield_force) == pytest.approx(
        0.6 * target.yield_displacement, rel=1e-6
    )


@pytest.mark.long
def test_elastic_building_has_no_strength_warning():
    """Forty stories under P-delta are pushed beyond their peak; a strength ratio below 1 is
    elastic."""
    case = model([story(2e5, 4e8, Law("bilinear", (4e6, 0.0)), height=3.0)] * 40, p_delta=True)
    _, target = target_displacements(pushover(case, "2%", points=60), "asce7:sds=0.2,sd1=0.1,tl=8")
    assert target.strength_ratio < 1.0
    assert target.notes == ()


def test_short_curve_does_not_satisfy_ec8(tmp_path):
    """The building has no strength beyond the curve, so that the required 1.5 times the target
    cannot be met. For a curve that was not pushed far enough, the message requests a larger
    displacement."""
    mass = 2e5
    case = oscillator(
        mass, 0.1 * mass * G, 0.02, p_delta=True
    )  # the strength is zero at 3 m times 0.1 = 0.3 m
    pushed, short = pushover(case, "0.31m", points=POINTS), pushover(case, "0.22m", points=POINTS)
    assert pushed.ended == "no remaining lateral resistance"
    assert pushed.applied_force[-1] == 0.0
    target = flat(tmp_path, 0.33)
    (note,) = target_displacements(pushed, target)[0].notes
    assert "1.5 are required (EN 1998-1, 4.3.3.4.2.3) and cannot be met" in note
    (note,) = target_displacements(short, target)[0].notes
    assert note.endswith("continue the pushover to a larger displacement")


def test_corner_period_of_table_equals_corner_of_code_spectrum(tmp_path):
    from tdint.response.spectra.target import read_target

    code = read_target(EC8)
    file = tmp_path / "ec8.csv"
    rows = zip(code.periods, code.psa, strict=True)
    file.write_text("period_s,sa_m_s2\n" + "".join(f"{t:.9g},{a:.12g}\n" for t, a in rows))
    assert code.corner == 0.6
    assert read_target(str(file)).corner == pytest.approx(0.6, rel=1e-8)  # periods of nine digits


def test_loss_of_strength_is_noted(tmp_path):
    """The curve softens only because of P-delta. The limit 1 + |alpha|^-h / 4 of (7-32) is between
    the two demands."""
    mass, height = 2e5, 3.0
    pushed, bare = (
        pushover(oscillator(mass, 0.1 * mass * G, 0.02, p_delta=p_delta), "0.31m", points=POINTS)
        for p_delta in (True, False)
    )
    k, geometric = 0.1 * mass * G / 0.02, mass * G / height
    period = 2.0 * math.pi * math.sqrt(mass / (k - geometric))
    largest = 1.0 + (geometric / (k - geometric)) ** -(1.0 + 0.15 * math.log(period)) / 4.0
    weak, strong = (
        target_displacements(pushed, flat(tmp_path, demand))[1] for demand in (0.4, 0.45)
    )
    assert weak.strength_ratio < largest < strong.strength_ratio
    assert not weak.notes
    (note,) = strong.notes
    assert float(note.split("exceeds ")[1].split(",")[0]) == pytest.approx(
        largest, rel=5e-3
    )  # 3 digits
    assert not target_displacements(bare, flat(tmp_path, 0.45))[1].notes


@pytest.mark.parametrize(
    ("drift", "options", "error", "message"),
    [
        ("30mm", {}, AnalysisError, "exceeds the end of the pushover curve"),
        ("200mm", {"site_class": "X"}, UsageError, "C, D, E, F, got 'X'"),
        (
            "200mm",
            {"mass_factor": 2.0},
            UsageError,
            "mass_factor must be above 0 and at most 1, got 2.0",
        ),
    ],
)
def test_invalid_arguments_are_refused(drift, options, error, message):
    with pytest.raises(error) as caught:
        target_displacements(
            pushover(oscillator(1.2e6, 2.4e6, 0.06), drift, points=POINTS), EC8, **options
        )
    assert message in str(caught.value)
