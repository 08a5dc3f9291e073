"""Ramberg-Osgood law: closed forms of the skeleton curve and of a loop, and Iwan's springs."""

import itertools
import math

import numpy as np
import pytest

from law_paths import along, random_path
from tdint.kernels.laws import ramberg_osgood
from tdint.model.story_laws import Law

K, FY = 4000.0, 80.0
DY = FY / K


def imposed(drifts, alpha=0.6, exponent=5.0):
    return along(Law("ramberg-osgood", (FY, alpha, exponent)), drifts, stiffness=K)


@pytest.mark.parametrize("alpha", [0.02, 0.6, 10.0])
@pytest.mark.parametrize("exponent", [1.5, 3.0, 8.0, 25.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_skeleton_curve(alpha, exponent, side):
    x = np.array([1e-6, 0.1, 0.7, 1.0, 1.3, 1.6])
    drifts = DY * x * (1.0 + alpha * x ** (exponent - 1.0))
    result = imposed(side * drifts, alpha, exponent)
    assert side * result.shear == pytest.approx(FY * x, rel=1e-13)
    tangent = K / (1.0 + alpha * exponent * x ** (exponent - 1.0))
    assert result.tangent == pytest.approx(tangent, rel=1e-11)


@pytest.mark.parametrize("exponent", [2.0, 5.0, 9.5])
def test_energy_of_a_closed_loop(exponent):
    """A loop between +-x dissipates 4 alpha (n - 1) / (n + 1) x^(n + 1) fy dy."""
    alpha, x = 0.6, 1.2
    drift = DY * x * (1.0 + alpha * x ** (exponent - 1.0))
    peaks = [0.0, drift, -drift, drift]
    drifts = np.concatenate([np.linspace(a, b, 31)[1:] for a, b in itertools.pairwise(peaks)])
    result = imposed(drifts, alpha, exponent)
    assert result.shear[[29, 59, 89]] == pytest.approx(FY * np.array([x, -x, x]), rel=1e-12)
    loop = 4.0 * alpha * (exponent - 1.0) / (exponent + 1.0) * x ** (exponent + 1.0) * FY * DY
    assert result.hysteretic_energy[89] - result.hysteretic_energy[29] == pytest.approx(loop)
    assert result.strain_energy[89] == pytest.approx(result.strain_energy[29])


def iwan(drifts, alpha, exponent, count=4000):
    """Return force and dissipated energy of parallel springs with the same skeleton curve."""
    x = np.linspace(0.0, 1.9, count + 1)
    corners, forces = DY * x * (1.0 + alpha * x ** (exponent - 1.0)), FY * x
    slopes = np.append(np.diff(forces) / np.diff(corners), 0.0)
    stiffness = slopes[:-1] - slopes[1:]
    limit, z, previous = stiffness * corners[1:], np.zeros(count), 0.0
    shear, dissipated = [], [0.0]
    for drift in drifts:
        free = z + stiffness * (drift - previous)
        z = np.clip(free, -limit, limit)
        dissipated.append(dissipated[-1] + np.sum(np.abs(z * (free - z)) / stiffness))
        shear.append(z.sum())
        previous = drift
    return np.array(shear), np.array(dissipated[1:])


@pytest.mark.parametrize("seed", range(4))
def test_random_path_agrees_with_springs(seed):
    drifts = random_path(seed, largest=3.0 * DY)
    result = imposed(drifts)
    shear, dissipated = iwan(drifts, 0.6, 5.0)
    assert np.max(np.abs(result.shear - shear)) < 2e-4 * FY
    assert np.max(np.abs(result.hysteretic_energy - dissipated)) < 1e-3 * dissipated[-1]
    assert np.min(np.diff(result.hysteretic_energy)) >= 0.0


def test_force_does_not_depend_on_the_number_of_steps():
    drifts = random_path(1, largest=3.0 * DY, points=40)
    fine = imposed(drifts)
    coarse = imposed(drifts[38::39].copy())
    assert coarse.shear == pytest.approx(fine.shear[38::39], rel=1e-10, abs=1e-9)
    assert coarse.hysteretic_energy == pytest.approx(fine.hysteretic_energy[38::39], rel=1e-9)


def test_more_loops_than_rows_forget_the_smallest_loop():
    """A decaying path leaves open loops; the last amplitude that is stored decides the error."""
    amplitudes = 3.0 * DY * 0.9 ** np.arange(2 * ramberg_osgood._MAX_REVERSALS)
    drifts = np.append(amplitudes * (-1.0) ** np.arange(amplitudes.size), 3.5 * DY)
    result = imposed(drifts)
    virgin = imposed(np.array([3.5 * DY]))
    assert result.shear[-1] == pytest.approx(virgin.shear[0], rel=1e-10)
    assert math.isfinite(result.hysteretic_energy[-1])
    assert np.min(np.diff(result.hysteretic_energy)) >= -1e-12
