"""Tests of the multilinear law with pinching: loops of OpenSees, loops by hand, energy."""

import csv
import math
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
import pytest

from law_paths import along
from tdint.model.story_laws import LAWS, Law

LOOPS = Path(__file__).parent / "pinching4_loops.csv"
"""Turn points and points between them of loops that OpenSeesPy 3.7.1 made with Pinching4 (1000
steps from row to row; drift over dy, force over Fy, work over Fy dy of the positive side). Damage
as vmtk 1.1 has it, or general."""

VMTK = ((1, 1), (8.000065801378538, 2.0000000969443152), (39.809834016022634, 1.2000000969443152))
VMTK = (*VMTK, (71.61960223066673, 1.2120000581665893))
UNEVEN = ((1, 1), (3, 1.3), (6, 1.5), (10, 0.9))
OTHER = ((1.5, 0.9), (4, 1.2), (7, 1.25), (12, 0.7))
USUAL = (0.5, 0.25, 0.05)
INTACT = (*3 * (0.0, 0.0, 1.0, 1.0, 0.0), math.inf)


def multilinear(
    points, pinching=USUAL, negative=None, other=None, ultimate=math.inf, degradation=INTACT
):
    sides = [
        float(number) for side in (points, negative or points) for point in side for number in point
    ]
    return Law(
        "multilinear-pinching", (*sides, *pinching, *(other or pinching), ultimate, *degradation)
    )


STIFF = ((1, 1), (3, 1.5), (6, 1.8), (12, 1.4))
CASES = {
    "vmtk_quadrilinear": multilinear(VMTK),
    "vmtk_bilinear_hardening": multilinear(((1, 1), (5, 1.1), (9, 1.2), (13, 1.3))),
    "falling_to_residual": multilinear(((1, 1), (4, 1.4), (9, 0.5), (14, 0.2)), (0.4, 0.3, -0.1)),
    "asymmetric": multilinear(UNEVEN, negative=OTHER, other=(0.6, 0.35, -0.15)),
    "force_above_drift": multilinear(STIFF, (0.3, 0.6, 0.1)),
    "unloading_above_reloading": multilinear(
        ((1, 1), (3, 1.2), (6, 1.3), (12, 1.25)), (0.5, 0.2, 0.3)
    ),
    "vmtk_degrading": multilinear(
        VMTK, degradation=(0, 0.1, 0, 0, 0.2, 0, 0.1, 0, 0, 0.2, 0, 0.4, 0, 0.4, 0.9, 10.0)
    ),
    "general_degrading": multilinear(
        UNEVEN,
        negative=OTHER,
        other=(0.6, 0.35, -0.15),
        degradation=(
            0.3,
            0.1,
            0.2,
            0.5,
            0.4,
            0.2,
            0.1,
            1.0,
            0.7,
            0.3,
            0.1,
            0.2,
            1.5,
            0.5,
            0.5,
            3.0,
        ),
    ),
}


def loops():
    with LOOPS.open() as file:
        groups = groupby(csv.DictReader(file), key=lambda row: (row["case"], row["path"]))
        return [
            pytest.param(
                case,
                [[float(row[name]) for name in ("drift", "force", "work")] for row in rows],
                id=f"{case}-{path}",
            )
            for (case, path), rows in groups
        ]


@pytest.mark.parametrize(("case", "rows"), loops())
def test_loops_agree_with_opensees(case, rows):
    """OpenSees sums the work by trapezoids, over steps that pass the bends of the path."""
    drift, force, work = np.transpose(rows)
    path = along(CASES[case], [0.0, *drift])
    assert np.max(np.abs(path.shear[1:] - force)) < 1e-6
    assert np.max(np.abs((path.strain_energy + path.hysteretic_energy)[1:] - work)) < 2e-5


FLAT = ((1, 1), (3, 2), (5, 2), (7, 2))


def pinched(drift):
    """Return the force during unloading from (3, 2) with the usual pinching, from 0.05 F3 beyond
    zero force to a quarter of the force."""
    return -0.1 - 0.15 * (0.9 - drift) / (0.9 + 0.25)


BACK = pinched(0.5) + 0.01 * (2.0 - pinched(0.5)) / 2.5
BY_HAND = [
    # The path leads from (3, 2) towards (-1, -1). It unloads with k to 0.05 F3 beyond zero force,
    # continues to a quarter of the force, at most up to the line with slope k through (-1, -1), and
    # then follows this line.
    (
        USUAL,
        [1, 3, 0.9, 0.2, -0.25, -0.5, -1, -2, 9],
        [1, 2, -0.1, pinched(0.2), -0.25, -0.5, -1, -1.5, 2.0],
    ),
    # Without pinching of the drift, reloading starts on the axis before unloading ends: from (1.01,
    # 1.005) straight to a quarter of the force.
    (
        (0.0, 0.25, 0.05),
        [1.01, 0.505, 0, -0.5, -1],
        [1.005, 0.5 * (1.005 - 0.25), -0.25, -0.625, -1],
    ),
    # The same with a reloading drift beyond the axis, at 0.05 of the drift.
    (
        (0.05, 0.25, 0.05),
        [1.01, 0.48, -0.05, -0.525, -1],
        [1.005, 0.5 * (1.005 - 0.25), -0.25, -0.625, -1],
    ),
    # The unloading force 0.2 F3 = 0.4 is larger than the reloading force, 0.3 of the yield force.
    # Both are replaced by their mean minus or plus a hundredth, each on its own line.
    ((0.5, 0.3, 0.2), [3, 0.6535, -0.3535, -1], [2, -0.3465, -0.3535, -1]),
    # Small reversals on the pinched segment: from 0.5 back on the straight line to (3, 2), and from
    # 0.51, where the force already exceeds 0.05 F3, straight to the start of reloading.
    (
        USUAL,
        [3, 0.5, 0.51, 0.13, -0.25, -1],
        [2, pinched(0.5), BACK, BACK - (0.25 + BACK) * (0.51 - 0.13) / (0.51 + 0.25), -0.25, -1],
    ),
]


@pytest.mark.parametrize(
    ("pinching", "drifts", "shears"),
    BY_HAND,
    ids=["loop", "no drift pinching", "little drift pinching", "mean force", "small reversals"],
)
def test_loops_agree_with_hand_calculation(pinching, drifts, shears):
    """The backbone curve has the points (1, 1) and (3, 2), and is then flat."""
    assert along(multilinear(FLAT, pinching), [0, *drifts]).shear[1:] == pytest.approx(
        shears, abs=1e-12
    )


def test_exhausted_capacity_increases_maximum_drift():
    """The reversal at 3.1, the only one with work beyond the capacity, increases the maximum drift
    by the limit of a fifth, from 3 to 3.6."""
    drifts = [0, 3, -1.5, 3.1, -1.5, 1.8, 2.7, 3.6, 5]
    intact = along(multilinear(FLAT), drifts)
    work = intact.strain_energy + intact.hysteretic_energy
    assert max(*work[1:3], work[4]) < 4.0 < work[3]
    lost = (*INTACT[:5], 0.0, 0.0, 1.0, 1.0, 0.2, *INTACT[:5], 4.0 / (0.5 + 3.0 + 4.0 * 2.0))
    path = along(multilinear(FLAT, degradation=lost), drifts)
    assert path.shear[:4] == pytest.approx(intact.shear[:4], abs=1e-12)
    assert path.shear[5:] == pytest.approx([0.5, 1.25, 2.0, 2.0], abs=1e-12)


def test_forces_do_not_depend_on_number_of_steps():
    """A path in one step or in many steps has the same forces and the same work."""
    for law in CASES.values():
        corners = np.random.default_rng(3).uniform(-12.0, 12.0, 40)
        ways = [np.linspace(a, b, 8)[1:] for a, b in pairwise([0.0, *corners])]
        coarse, fine = along(law, [0.0, *corners]), along(law, [0.0, *np.concatenate(ways)])
        assert fine.shear[7::7] == pytest.approx(coarse.shear[1:], abs=1e-10)
        done = [path.strain_energy + path.hysteretic_energy for path in (coarse, fine)]
        assert done[1][7::7] == pytest.approx(done[0][1:], abs=1e-9)


@pytest.mark.parametrize("case", CASES)
def test_strain_energy_is_work_of_unloading(case):
    """After each of four reversals, the strain energy at a point of the unloading path is the area
    under the remaining path."""
    corners = pairwise([0.0, 6.3, -8.1, 4.2, -9.6])
    path = along(
        CASES[case], [0.0, *np.concatenate([np.linspace(a, b, 2001)[1:] for a, b in corners])]
    )
    middles = 0.5 * (path.shear[1:] + path.shear[:-1]) * np.diff(path.drift)
    for turned in range(2000, 8000, 2000):
        back = path.shear[turned:] * np.sign(path.shear[turned]) > 0.0
        ended = turned + int(np.argmin(back))
        area = -np.cumsum(middles[turned:ended][::-1])[::-1]
        assert area.size > 50
        assert path.strain_energy[turned:ended] == pytest.approx(area, abs=1e-3 * area[0])


@pytest.mark.parametrize(
    ("points", "stiffens"),
    [
        (VMTK, False),
        (((1, 1), (3, 3), (4, 3.5), (6, 3.5)), False),
        (((1, 1), (3, 1.5), (4, 2.6), (6, 3)), True),
    ],
)
def test_law_stiffens_if_later_segment_is_steeper(points, stiffens):
    for length in (1.0, 0.1):
        here, other = (tuple((length * x, y) for x, y in side) for side in (points, VMTK))
        for law in (multilinear(here), multilinear(other, negative=here)):
            assert LAWS[law.name].stiffens(law.parameters) is stiffens


def test_force_is_zero_beyond_ultimate_drift():
    path = along(multilinear(UNEVEN, ultimate=10.0), [0.0, 9.9, 10.1, 5.0, 0.0, -3.0])
    assert path.shear[1] > 0.9
    assert np.all(path.shear[2:] == 0.0)
    assert path.strain_energy[-1] == 0.0


def test_no_degradation_before_first_yielding():
    """Cycles below the yield drift cause no degradation, although their work is not zero."""
    cycles = np.tile([0.9, -0.9], 20)
    degrading = along(CASES["vmtk_degrading"], [0.0, *cycles, 8.0])
    assert degrading.shear == pytest.approx(
        along(multilinear(VMTK), [0.0, *cycles, 8.0]).shear, abs=1e-12
    )


def uneven(random):
    """Return a law with different sides; unloading ends beyond zero force and before the force at
    which reloading becomes straight."""
    sides, pinchings = [], []
    for _ in range(2):
        k, drift = random.uniform(0.5, 2.0, 2)
        points = [(drift, k * drift)]
        for _ in range(3):
            length = random.uniform(0.3, 10.0)
            drift, force = points[-1]
            force = float(np.clip(force + length * random.uniform(-0.3, 0.3) * k, 0.2 * k, 4.9 * k))
            points.append((drift + length, force))
        force = random.uniform(0.02, 1.0)
        sides.append(points)
        pinchings.append((random.uniform(), force, random.uniform(0.0, 0.98 * force)))
    return multilinear(sides[0], pinchings[0], sides[1], pinchings[1])


@pytest.mark.parametrize("seed", range(20))
def test_stationary_cycles_gain_no_energy(seed):
    """The cycles are between any two reversals after any history, with arbitrary sides and 0 <=
    unloading < force."""
    random = np.random.default_rng(seed)
    law, before, between = (
        uneven(random),
        random.uniform(-30.0, 30.0, 8),
        random.uniform(-25.0, 25.0, 2),
    )
    path = along(law, [0.0, *before, *np.tile(between, 250)])
    work = path.strain_energy + path.hysteretic_energy
    assert work[-1] - work[-3] >= -1e-7 * max(np.max(np.abs(np.diff(work[-4:]))), 1.0)


def test_stationary_cycle_with_early_end_of_unloading_gains_energy():
    """Unloading ends before zero force and above the force of reloading, a case that the README
    warns of."""
    points = ((1, 1), (10.4, 0.2), (17.1, 1.5), (24.1, 3.6))
    path = along(
        multilinear(points, (0.72, 0.33, -0.59)), [0.0, -19.0, 24.0, *np.tile([-21.0, 10.0], 40)]
    )
    work = path.strain_energy + path.hysteretic_energy
    assert work[-1] - work[-3] < -5.0


def even(random):
    """Return a law with equal sides, segments below the line of the initial stiffness, and the
    usual pinching."""
    points = [(1.0, 1.0)]
    for _ in range(3):
        length = random.uniform(0.3, 10.0)
        drift, force = points[-1]
        points.append(
            (drift + length, float(np.clip(force + length * random.uniform(-0.3, 0.3), 0.2, 4.9)))
        )
    return multilinear(points)


@pytest.mark.parametrize("seed", range(20))
def test_random_path_gains_no_energy(seed):
    """The energy that a reversal would return is at most the work since the start."""
    random = np.random.default_rng(seed)
    path = along(even(random), [0.0, *random.uniform(-30.0, 30.0, 100)])
    assert np.min(path.hysteretic_energy) >= -1e-12
    assert np.min(path.strain_energy) >= 0.0
