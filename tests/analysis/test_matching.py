"""Motions matched to a target: derivatives against differences, the program against scipy's, what a motion keeps."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

import tdint
from building_cases import noise
from tdint.analysis.matching import _Problem, program
from tdint.analysis.spectra.elastic import spectrum
from tdint.errors import UsageError
from tdint.kernels.oscillators.extremes import VALUE, WHEN, WHO

TARGET = "asce7:sds=0.6,sd1=0.4,tl=8"


@pytest.fixture(scope="module")
def motion():
    """A motion as strong motions are, of 8 s."""
    rng = np.random.default_rng(3)
    rough = rng.normal(size=801) * np.sin(np.pi * np.linspace(0.0, 1.0, 801)) ** 2
    return replace(noise(peak=2.0), acceleration=noise(peak=2.0).acceleration + rough)


@pytest.fixture(scope="module")
def matched(motion):
    return tdint.match(motion, TARGET, periods=(0.1, 2.0))


def problem_of(motion, periods):
    wanted = spectrum(motion, periods, 0.05).psa
    return _Problem.of(motion, periods, wanted=wanted, damping=0.05), wanted


def test_the_largest_extremes_are_the_spectrum(motion):
    """By another kernel: that of the spectra, exact between samples."""
    periods = np.geomspace(0.1, 3.0, 25)
    problem, wanted = problem_of(motion, periods)
    found, largest = problem.extremes(motion.acceleration, 0.9 * wanted)
    np.testing.assert_allclose(largest[0], wanted, rtol=2e-4)
    assert np.all(np.abs(found[VALUE]) > 0.9 * wanted[found[WHO].astype(int)] * (1.0 - 1e-9))
    np.testing.assert_array_equal(np.abs(found[VALUE, largest[1].astype(int)]), largest[0])


def test_derivatives_of_extremes_are_their_differences(motion):
    """Without band and envelope the row of an extreme is what it changes by with the samples."""
    periods = np.geomspace(0.1, 2.0, 12)
    problem, wanted = problem_of(motion, periods)
    problem.band = np.ones_like(problem.band)
    problem.envelope = np.ones_like(problem.envelope)
    found, largest = problem.extremes(motion.acceleration, 0.99 * wanted)
    places = largest[1].astype(int)
    rows = problem.rows(found[WHO, places].astype(int), found[WHEN, places], motion.acceleration.size)
    change = 1e-5 * np.random.default_rng(1).normal(size=motion.acceleration.size)
    after, before = (problem.extremes(motion.acceleration + part * change, 0.9 * wanted)[1][0] for part in (1.0, -1.0))
    told = np.sign(found[VALUE, places]) * (rows @ change)
    np.testing.assert_allclose(told, 0.5 * (after - before), rtol=2e-3, atol=1e-7)  # rows are of single precision


def test_the_program_is_that_of_scipy():
    """Multipliers of equalities free, of inequalities none above zero."""
    rng = np.random.default_rng(7)
    for _ in range(5):
        rows = rng.normal(size=(12, 40))
        gram, short, equal = rows @ rows.T / 40.0, rng.normal(size=12), np.arange(12) < 5
        found = program(gram, short, equal, 1e-3)
        matrix = gram + 1e-3 * np.eye(12)
        bounds = LinearConstraint(np.eye(12)[~equal], -np.inf, 0.0)
        best = minimize(
            lambda m, matrix=matrix, short=short: 0.5 * m @ matrix @ m - short @ m,
            np.zeros(12),
            jac=lambda m, matrix=matrix, short=short: matrix @ m - short,
            constraints=[bounds],
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        ).x
        worth = [0.5 * m @ matrix @ m - short @ m for m in (found, best)]
        assert worth[0] == pytest.approx(worth[1], rel=5e-3, abs=5e-3)


def test_a_motion_is_matched(motion, matched):
    """At periods of its own, by the exact spectrum; the ground ends where the scaled seed ends."""
    periods = np.geomspace(0.11, 1.9, 333)
    off = tdint.spectrum(matched.record, periods).psa / matched.target.at(periods) - 1.0
    before = tdint.spectrum(matched.before, periods).psa / matched.target.at(periods) - 1.0
    assert np.max(np.abs(off)) < 0.08 < np.max(np.abs(before))
    assert np.mean(np.abs(off)) < 0.01 and matched.mean_misfit < 0.01
    after, seed = (path.displacement for path in matched.motions)
    assert abs(after[-1] - seed[-1]) < 0.02 * np.max(np.abs(seed))
    assert matched.record.dt == motion.dt and "matched to" in matched.record.processing[-1]
    assert matched.factor * motion.acceleration == pytest.approx(matched.before.acceleration)
    columns = matched.to_dict()
    assert columns["largest_misfit"][0] == matched.largest_misfit and columns["change"][0] == matched.change
    figure = matched.plot()
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["target", "scaled seed", "matched"]


@pytest.mark.parametrize("periods", [(2.0, 0.1), (0.0, 1.0), (0.1, np.inf)])
def test_a_range_that_is_none_is_refused(motion, periods):
    with pytest.raises(UsageError, match="the range of periods must rise"):
        tdint.match(motion, TARGET, periods=periods)
