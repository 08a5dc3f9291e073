"""Tests of the trilinear-pinching and the imk law against a second implementation, with curves
instead of branches, and against calculations by hand."""

import csv
import math
import os
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from law_paths import along
from separate_laws import ImkCurves, TrilinearCurves
from tdint.model.story_laws import Law

LOOPS = os.environ.get("TDINT_LAW_LOOPS")
"""A folder with law_loops.csv: loops of other programs, in units of yield drift and force."""


def imposed(law, drifts):
    """Impose a path on a story with stiffness and yield force 1, from rest."""
    return along(law, drifts, stiffness=1.0)


def trilinear(ultimate=3.0, drift=20.0, pinching=0.5, unloading=0.3):
    return Law("trilinear-pinching", (1.0, ultimate, drift, pinching, unloading))


def side(
    strength=1.0, plastic=4.0, post_capping=8.0, cap=1.2, residual=0.2, ultimate=40.0, rate=1.0
):
    return (strength, plastic, post_capping, cap, residual, ultimate, rate)


def imk(positive=None, negative=None, deterioration=math.inf, exponent=1.0, pinching=(1.0, 1.0)):
    positive = side() if positive is None else positive
    return Law(
        "imk", (*positive, *(negative or positive), *4 * [deterioration], exponent, *pinching)
    )


def random_path(seed, largest, turns=40, points=15):
    generator = np.random.default_rng(seed)
    ends = [0.0, *generator.uniform(-largest, largest, turns)]
    return np.concatenate([np.linspace(a, b, points)[1:] for a, b in pairwise(ends)])


# ---- Agreement with a second statement of each law


def curves(story, path):
    forces = []
    for x in path:
        story.go(x)
        forces.append(story.f)
    return np.array(forces)


@pytest.mark.parametrize("unloading", [0.0, 0.4])
@pytest.mark.parametrize("pinching", [0.2, 0.7, 1.0])
@pytest.mark.parametrize("largest", [0.9, 3.0, 30.0])
def test_trilinear_pinching_agrees_with_curves(pinching, unloading, largest):
    for seed in range(4):
        path = random_path(seed, largest)
        law = (2.5, 12.0, pinching, unloading)
        assert imposed(trilinear(*law), path).shear == pytest.approx(
            curves(TrilinearCurves(*law), path), abs=1e-10
        )


SIDES = {
    "equal": (side(), side()),
    "different": (side(), side(0.8, 3.0, 12.0, 1.1, 0.3, 50.0, 0.6)),
    "residual": (side(residual=1.0), side(residual=0.95)),
}


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("pinching", [(1.0, 1.0), (0.3, 0.5), (0.6, 0.2)])
@pytest.mark.parametrize(("capacity", "exponent"), [(math.inf, 1.0), (150.0, 1.0), (100.0, 1.5)])
def test_imk_agrees_with_curves(sides, pinching, capacity, exponent):
    for seed in range(4):
        path = random_path(seed, 9.0, turns=25)
        story = ImkCurves(*SIDES[sides], capacity, exponent, pinching)
        got = imposed(imk(*SIDES[sides], capacity, exponent, pinching), path)
        assert got.shear == pytest.approx(curves(story, path), abs=1e-9)
        assert got.strain_energy[-1] + got.hysteretic_energy[-1] == pytest.approx(
            story.work, rel=1e-10
        )
        assert np.min(np.diff(got.hysteretic_energy)) > -1e-10


# ---- Relatives


def test_trilinear_law_without_pinching_equals_peak_oriented_law():
    path = random_path(1, 15.0)
    hardening = 2.0 / 19.0
    clough = imposed(Law("peak-oriented", (1.0, hardening, 0.3)), path)
    mine = imposed(trilinear(pinching=1.0), path)
    assert mine.shear == pytest.approx(clough.shear, abs=1e-10)
    assert mine.hysteretic_energy == pytest.approx(clough.hysteretic_energy, abs=1e-9)


# ---- By hand


def test_backbone_curve_of_imk_law():
    """Yielding is at 1 and capping at 5 with 1.2; the slope is then -0.15, the residual 0.2 from 5
    + 1 / 0.15 on, and the force zero beyond 15."""
    path = imposed(
        imk(side(ultimate=15.0)), [0.5, 1.0, 3.0, 5.0, 7.0, 11.0, 12.0, 14.9, 15.1, 14.0, -3.0]
    )
    assert path.shear == pytest.approx(
        [0.5, 1.0, 1.1, 1.2, 0.9, 0.3, 0.2, 0.2, 0.0, 0.0, 0.0], abs=1e-12
    )
    work = 0.5 + 4.4 + 0.7 / 0.15 + 0.2 * (10.0 - 1.0 / 0.15)
    assert path.hysteretic_energy[-1] == pytest.approx(work, rel=1e-12)
    assert path.strain_energy[-1] == 0.0


def test_story_with_complete_deterioration_has_zero_force():
    """Up to a drift of 3, the work is 0.5 + 2.1, of which 1.1^2 / 2 is returned; at the reversal,
    beta = 1.995 / (capacity - 1.995)."""
    spent = 0.5 + 2.1 - 0.5 * 1.1**2
    path = [3.0, 2.9, 0.0, -4.0]
    assert imposed(imk(deterioration=1.99 * spent), path).shear == pytest.approx(
        [1.1, 0.0, 0.0, 0.0], abs=1e-12
    )
    alive = imposed(imk(deterioration=4.0 * spent), path)
    assert alive.shear[1] == pytest.approx(1.1 - 0.1 * (1.0 - 1.0 / 3.0), rel=1e-12)


def test_reversal_at_zero_residual_force_is_zero_crossing():
    """The force is zero beyond the end of the capping line, and after a reversal the other side is
    loaded at once."""
    path = imposed(imk(side(residual=0.0)), [14.0, 13.5, -1.0, -1.5])
    assert path.shear == pytest.approx([0.0, -0.5 / 15.0, -1.0, -1.025], abs=1e-12)


def test_zero_crossing_beyond_peak_keeps_force_continuous():
    """The first reversal removes most of the unloading stiffness. The force becomes zero beyond the
    yield point of the other side, and increases again without a jump."""
    law = imk(side(plastic=20.0), deterioration=19.6)
    path = imposed(law, [*np.linspace(0.0, 10.0, 11), *np.linspace(10.0, -20.0, 3001)])
    zero = np.flatnonzero(path.shear < 0.0)[0]
    assert path.drift[zero] < -1.0
    assert 0.3 < -np.min(path.shear) < 1.2
    assert np.max(np.abs(np.diff(path.shear[11:]))) < 0.0101


@pytest.mark.skipif(not LOOPS, reason="TDINT_LAW_LOOPS does not name a folder")
def test_loops_agree_with_other_program():
    laws = {
        "hysteretic_w1_high": trilinear(3.0, 1.0 + 2.0 / 0.0870354, 0.8, 0.1),
        "hysteretic_urm_pre": trilinear(2.0, 1.0 + 1.0 / 0.111111, 0.2, 0.1),
        "hysteretic_c1_high": trilinear(3.0, 1.0 + 2.0 / 0.0864933, 0.5, 0.4),
        "imk_peak_no_deterioration": imk(deterioration=1e6),
        "imk_peak_lambda50": imk(deterioration=50.0),
        "imk_peak_lambda20": imk(deterioration=20.0),
        "imk_pinching_no_deterioration": imk(deterioration=1e6, pinching=(0.3, 0.5)),
        "imk_pinching_lambda50": imk(deterioration=50.0, pinching=(0.3, 0.5)),
    }
    rows = list(csv.DictReader((Path(LOOPS) / "law_loops.csv").read_text().splitlines()))
    cases = {
        key: list(group) for key, group in groupby(rows, key=lambda row: (row["case"], row["path"]))
    }
    assert {case for case, _ in cases} == set(laws)
    for (case, _), group in cases.items():
        drift, force, work = (
            np.array([float(row[column]) for row in group])
            for column in ("displacement_over_dy", "force_over_fy", "dissipated_over_fy_dy")
        )
        path = imposed(laws[case], drift)
        assert np.max(np.abs(path.shear - force)) < 1e-6
        assert np.max(np.abs(path.strain_energy + path.hysteretic_energy - work)) < 1e-5


# ---- The dissipated energy does not decrease: no path returns more energy than it received

PART = st.floats(0.0, 0.99)


@st.composite
def peak_oriented(draw):
    return Law("peak-oriented", (1.0, draw(PART), draw(PART)))


@st.composite
def any_trilinear(draw):
    """Return a trilinear law that does not unload beyond zero drift."""
    unloading, drift = draw(PART), draw(st.floats(1.5, 30.0))
    highest = max(drift ** (1.0 - unloading), 1.0)
    return Law(
        "trilinear-pinching",
        (1.0, draw(st.floats(1.0, highest)), 1.01 * drift, draw(st.floats(0.05, 1.0)), unloading),
    )


@st.composite
def bilinear(draw):
    return Law("bilinear", (1.0, draw(PART)))


@st.composite
def bouc_wen(draw):
    return Law("bouc-wen", (1.0, draw(PART), draw(st.floats(1.0, 10.0)), draw(st.floats(0.5, 1.0))))


@settings(max_examples=200, deadline=None)
@given(
    st.one_of(peak_oriented(), any_trilinear(), bilinear(), bouc_wen()),
    st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=40),
)
@pytest.mark.long
def test_dissipated_energy_does_not_decrease(law, drifts):
    path = imposed(law, [0.0, *drifts])
    work = path.hysteretic_energy + path.strain_energy
    assert np.min(np.diff(path.hysteretic_energy)) >= -1e-12 * np.max(work, initial=1.0)
    assert np.min(work) >= -1e-12


@pytest.mark.parametrize("hardening", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("unloading", [0.5, 0.9])
def test_cycles_of_hardening_peak_oriented_story(hardening, unloading):
    """Cycles have growing and constant amplitudes. The work of a closed cycle is the area that it
    encloses."""
    for largest in (3.0, 10.0, 100.0):
        law = Law("peak-oriented", (1.0, hardening, unloading))
        corners = np.outer([*np.linspace(1.5, largest, 6), largest, largest], [1.0, -1.0]).ravel()
        ways = zip([0.0, *corners], corners, strict=False)
        path = imposed(law, np.concatenate([np.linspace(a, b, 400) for a, b in ways]))
        work = np.concatenate(
            [[0.0], np.cumsum(0.5 * (path.shear[1:] + path.shear[:-1]) * np.diff(path.drift))]
        )
        last = work[-1] - work[-801]
        assert (
            last >= -1e-12 * work[-1]
        )  # zero if the bounds reduce the law to a line through the origin
        assert path.hysteretic_energy[-1] + path.strain_energy[-1] == pytest.approx(
            work[-1], rel=1e-3
        )
        # Unloading ends on the side of its start: the returned energy is at most the triangle to
        # the origin.
        peak = np.argmax(path.drift)
        assert path.strain_energy[peak] <= 0.5 * path.shear[peak] * path.drift[peak] * (1.0 + 1e-12)


def test_bounds_do_not_affect_common_stories():
    """A Takeda story with exponent 0.4 and 5 % hardening unloads with the stated stiffness up to a
    ductility of hundreds."""
    for ductility in (1.5, 6.0, 300.0):
        path = imposed(Law("peak-oriented", (1.0, 0.05, 0.4)), [0.0, ductility, ductility - 0.001])
        assert (path.shear[1] - path.shear[2]) / 0.001 == pytest.approx(ductility**-0.4, rel=1e-9)


def test_trilinear_force_depends_continuously_on_small_pinching_factors():
    """With a pinching factor near 0, the line from the zero crossing with the unloading stiffness
    ends at the start of the second part of the reloading, up to rounding errors."""
    generator = np.random.default_rng(3)
    drifts = generator.uniform(-12.0, 12.0, 60)
    expected = imposed(trilinear(pinching=1e-9), drifts).shear
    for pinching in (1e-12, 1e-14, 1e-16):
        assert imposed(trilinear(pinching=pinching), drifts).shear == pytest.approx(
            expected, abs=1e-5
        )
