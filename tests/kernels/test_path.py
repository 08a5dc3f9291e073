"""Laws along a parabola of drift: integrals, tangents, and work compared with strain energy and
dissipated energy.

The functions are executed without compilation. In compiled form, they are part of the step of
moment4, whose energies follow from these integrals.
"""

import math

import numpy as np
import pytest
from scipy.integrate import quad, simpson

from law_examples import example
from law_paths import FY, K, law_table
from tdint.kernels import layout as rows
from tdint.kernels.laws import LAWS as COMPILED
from tdint.kernels.stories import path as path_module
from tdint.kernels.stories.law_state import (
    commit,
    hysteretic_energy,
    restoring_force,
    start,
    strain_energy,
)
from tdint.kernels.stories.law_tables import law_state_table
from tdint.kernels.stories.path import (
    MAX_POINTS,
    NODES,
    PATH_ROWS,
    WEIGHTS,
    commit_path_end,
    follow,
    integrate_on_branch,
    locate_reversals,
    remains_on_branch,
)

LAWS = {law.name: law for law in COMPILED}
DY = FY / K
PATHS = 60
TOLERANCE = {"tanh": 1e-9, "bouc-wen": 1e-6, "steel": 1e-6} | {
    law.name: 5e-5 if law.name == "hertz" else 1e-6
    for law in COMPILED
    if law.curved and law.functions().points is None
}
"""Of the work, over Fy times the way, where the law is integrated by points (those that do not say
how many, by sixteen; of hertz over a closing, where the force grows with the power 1.5); the others
are integrated exactly."""

INTEGRALS = {"tanh": 1e-6, "bouc-wen": 1e-4}
"""Of the integrals, over the forces; else the error of Simpson's rule across kinks."""

TANGENTS = {"bouc-wen": 1e-3}
"""Over the stiffness: the points move with the path, and the law takes substeps; else the error of
the differences."""


def table(name):
    return law_table(name, *example(name, K, FY).parameters)


def random_paths(seed=3):
    """Return linear and quadratic coefficients of up to a few yield drifts, including paths with a
    reversal, without motion, and without a linear part."""
    generator = np.random.default_rng(seed)
    scale = DY * 10.0 ** generator.uniform(-2.0, 0.5, PATHS)
    rises, bends = scale * generator.normal(size=(2, PATHS)) * [[1.0], [4.0]]
    rises[0] = bends[0] = 0.0
    rises[1] = bends[2] = 0.0
    return list(zip(rises, bends, strict=True))


TURNING = list(LAWS)
STEADY = [name for name, law in LAWS.items() if not law.curved]
"""Laws that are linear branch by branch, whose story may never turn within a path: the parabola
alone turns, and what the force does along it, there and back, is still what the story stores and
dissipates."""


def stored_and_dissipated(law_parameters, state):
    return np.array(
        [energy(law_parameters, state, 0) for energy in (strain_energy, hysteretic_energy)]
    )


def results(law_parameters, state, rise, bend, steady=False):
    """Return mean, first moment and the four tangents, and advance the story along the path."""
    out = np.zeros((PATH_ROWS, 2))
    follow(law_parameters, state, 0, rise, bend, steady, out, 0)
    commit_path_end(law_parameters, state, 0, rise)
    return out[:6, 0].copy()


def simpson_moments(law_parameters, state, rise, bend, parts=160):
    """Return mean and first moment by Simpson's rule over points, between which the law is followed
    along straight drifts."""
    t = np.linspace(0.0, 1.0, 2 * parts + 1)
    forces = []
    for drift in state[rows.DRIFT, 0] + t * rise + 0.5 * bend * (t * t - t):
        restoring_force(law_parameters, state, 0, rows.COMMITTED, rows.FIRST_TRIAL, drift)
        commit(law_parameters, state, 0, rows.COMMITTED, rows.FIRST_TRIAL)
        forces.append(state[rows.FORCE, 0])
    return simpson([forces, 12.0 * (t - 0.5) * forces], x=t)


@pytest.fixture(params=TURNING)
def journey(request):
    """Yield a law, and states and paths of one of its stories, which continues from path
    to path."""
    return journey_of(request.param, steady=False)


@pytest.fixture(params=STEADY)
def steady_journey(request):
    """Yield the same for a story without reversals within a path."""
    return journey_of(request.param, steady=True)


ANY = [*((name, False) for name in TURNING), *((name, True) for name in STEADY)]


@pytest.fixture(params=ANY, ids=lambda way: f"{way[0]}, steady" if way[1] else way[0])
def any_journey(request):
    return journey_of(*request.param)


def journey_of(name, steady):
    law_parameters = table(name)
    state = law_state_table(law_parameters)
    start(law_parameters, state, 0, 0.0)
    visited = []
    for rise, bend in random_paths():
        if abs(state[rows.DRIFT, 0] + rise) > 8.0 * DY:  # not ever farther
            rise, bend = -rise, -bend
        visited.append((state.copy(), rise, bend))
        results(law_parameters, state, rise, bend, steady)
    return name, law_parameters, visited, steady


def test_work_is_strain_energy_plus_dissipated_energy(any_journey):
    name, law_parameters, visited, steady = any_journey
    for state, rise, bend in visited:
        before = stored_and_dissipated(law_parameters, state)
        mean, moment, *_ = results(law_parameters, state, rise, bend, steady)
        after = stored_and_dissipated(law_parameters, state)
        scratch = rise * mean + bend * moment / 12.0
        length = abs(rise) + abs(bend) + 1e-3 * DY
        allowed = TOLERANCE.get(name, 1e-12) * 10.0 * FY * length + 1e-14 * sum(map(abs, after))
        assert scratch == pytest.approx(sum(after) - sum(before), rel=1e-12, abs=allowed)


def test_integrals_of_force_agree_with_simpson_rule(journey):
    name, law_parameters, visited, _ = journey
    for state, rise, bend in (*visited[:4], *visited[4::7]):
        got = results(law_parameters, state.copy(), rise, bend)
        expected = simpson_moments(law_parameters, state.copy(), rise, bend)
        size = abs(state[rows.FORCE, 0]) + abs(got[0]) + K * (abs(rise) + abs(bend))
        assert got[:2] == pytest.approx(expected, abs=INTEGRALS.get(name, 1e-4) * size)


@pytest.mark.parametrize("far", [0.5, 1.5, 3.0, 6.0])
@pytest.mark.parametrize("r0", [5.0, 20.0])
def test_mean_force_over_a_sharp_corner_of_steel(r0, far):
    """First loading to `far` yield drifts (Menegotto and Pinto 1973): mean and first moment; the
    number of points grows with the sharpness of the corner."""
    hardening = 0.02
    law_parameters = law_table("steel", FY, hardening, r0, 0.925, 0.15, 0.0, 1.0, 0.0, 1.0)
    state = law_state_table(law_parameters)
    start(law_parameters, state, 0, 0.0)
    mean, moment = results(law_parameters, state, far * DY, 0.0)[:2]

    def force(t):
        x = far * t
        return FY * (hardening * x + (1.0 - hardening) * x / (1.0 + x**r0) ** (1.0 / r0))

    options = {"epsabs": 1e-12 * FY, "points": [min(1.0 / far, 0.9)], "limit": 200}
    assert mean == pytest.approx(quad(force, 0.0, 1.0, **options)[0], abs=1e-7 * FY)
    expected = quad(lambda t: 12.0 * (t - 0.5) * force(t), 0.0, 1.0, **options)[0]
    assert moment == pytest.approx(expected, abs=1e-7 * FY)


def test_tangents_are_derivatives_of_integrals(any_journey):
    """The tangents equal central differences, except for a few paths that contain a kink."""
    name, law_parameters, visited, steady = any_journey
    deviations = []
    for state, rise, bend in visited[3:]:
        got = results(law_parameters, state.copy(), rise, bend, steady)[2:]
        eps = 1e-5 * (abs(rise) + abs(bend))
        numeric = []
        for by_rise, by_bend in ((eps, 0.0), (0.0, eps)):
            ends = [
                results(
                    law_parameters,
                    state.copy(),
                    rise + sign * by_rise,
                    bend + sign * by_bend,
                    steady,
                )[:2]
                for sign in (1.0, -1.0)
            ]
            numeric.append((ends[0] - ends[1]) / (2.0 * eps))
        deviations.append(np.max(np.abs(np.array(numeric).T.ravel() - got)) / K)
    assert np.quantile(deviations, 0.9) < TANGENTS.get(name, 2e-5)
    assert max(deviations) < 0.05


def test_path_on_one_branch_is_integrated_in_closed_form(journey):
    name, law_parameters, visited, _ = journey
    kept = 0
    for state, rise, bend in visited:
        out = np.zeros((PATH_ROWS, 2))
        if remains_on_branch(state, 0, rise, bend):
            kept += 1
            integrate_on_branch(state, 0, rise, bend, out, 0)
            walked = results(law_parameters, state.copy(), rise, bend)
            scale = K * (abs(rise) + abs(bend)) + abs(state[rows.FORCE, 0]) + K
            assert out[:6, 0] == pytest.approx(walked, abs=1e-11 * scale)
    assert (kept > 0) == (name == "hertz" or not LAWS[name].curved)  # linear within its gap
    assert (kept == PATHS) == (name == "linear")


def test_trial_rows_do_not_affect_results(journey):
    """The results do not depend on values of other stories or steps in the trial blocks."""
    _, law_parameters, visited, _ = journey
    for state, rise, bend in visited[::7]:
        clean, dirty = state.copy(), state.copy()
        clean[rows.LAW_STATE_ROWS : rows.FAILED_INTERNAL] = 0.0
        dirty[rows.LAW_STATE_ROWS : rows.FAILED_INTERNAL] = 1e3
        clean_results, dirty_results = (
            results(law_parameters, table, rise, bend) for table in (clean, dirty)
        )
        assert np.array_equal(clean_results, dirty_results)
        for row in (rows.DRIFT, rows.FORCE, rows.DISSIPATED):
            assert clean[row, 0] == dirty[row, 0]


def test_path_without_reversal_ends_like_straight_path(steady_journey):
    """Without a reversal, drift, force and dissipation depend only on the end of the path, not on
    the parabola."""
    _, law_parameters, visited, _ = steady_journey
    for state, rise, bend in visited:
        straight = state.copy()
        results(law_parameters, state, rise, bend, steady=True)
        results(law_parameters, straight, rise, 0.0)
        size = FY + abs(straight[rows.WORK, 0]) + abs(straight[rows.DISSIPATED, 0])
        for row in (rows.DRIFT, rows.FORCE, rows.WORK, rows.DISSIPATED):
            assert state[row, 0] == pytest.approx(straight[row, 0], abs=1e-12 * size)


def test_reversals_are_zeros_of_rate():
    """The zeros of cubics, including lines and parabolas, equal the roots of the polynomial."""
    generator = np.random.default_rng(11)
    for degree in (1, 2, 3) * 100:
        zeros = generator.uniform(-0.7, 1.7, degree)
        rate = np.polynomial.Polynomial.fromroots(zeros) * generator.choice([-3.0, 3.0])
        extremes = [
            t.real for t in rate.deriv().roots() if abs(t.imag) < 1e-9 and 0.0 < t.real < 1.0
        ]
        mean = rate.integ()(1.0) - rate.integ()(0.0)
        side, *times, nearest = locate_reversals(mean, rate(0.0), rate(1.0), rate.deriv()(0.0))
        inside = sorted(zeros[(zeros > 0.0) & (zeros < 1.0)])
        assert side == np.sign(rate(0.0))
        assert times == pytest.approx([*inside, *[1.0] * (3 - len(inside))], abs=1e-7)
        assert nearest == pytest.approx(
            min((abs(rate(t)) for t in extremes), default=np.inf), rel=1e-6
        )


def test_reversals_from_rest_follow_lowest_power_of_time():
    """The drift rates of upper stories grow with the third or higher powers of time, and the
    parabolas start in the opposite direction. Accelerations that are only rounding errors of the
    floor loads count as zero."""
    for rise, noise in ((0.25, 0.0), (0.2, 1e-14), (0.17, -1e-14)):
        assert locate_reversals(rise, 0.0, 1.0, noise) == (1.0, 1.0, 1.0, 1.0, np.inf)
    assert locate_reversals(-0.25, 0.0, -1.0, 0.0)[:2] == (-1.0, 1.0)
    side, turn, *_ = locate_reversals(
        0.0, 0.0, 1.0, -0.5
    )  # -t/2 + 0 t^2 + 3/2 t^3 - ... : back at first, then ahead
    assert side == -1.0 and 0.0 < turn < 1.0


def test_small_cycle_changes_only_laws_that_degrade_at_reversals(steady_journey):
    """A small cycle of a millionth of the yield drift, followed by a large cycle, changes the
    forces only slightly."""
    name, law_parameters, visited, _ = steady_journey
    if (
        name == "multilinear-pinching"
    ):  # the example does not degrade: 30 % of the strength at the last drift
        law_parameters[rows.FIRST_PARAMETER + 33 : rows.FIRST_PARAMETER + 38, 0] = 0.3, 0, 1, 1, 0.5
    largest = 0.0
    for state, _, _ in visited:
        increments = [DY, -3.0 * DY, 4.0 * DY, -3.0 * DY]
        side = np.sign(state[rows.RATE_SIGN, 0]) or 1.0
        straight = state.copy()
        for increment in (-1e-6 * DY, 1e-6 * DY):
            results(law_parameters, state, side * increment, 0.0)
        for increment in increments:
            results(law_parameters, state, side * increment, 0.0)
            results(law_parameters, straight, side * increment, 0.0)
            largest = max(largest, abs(state[rows.FORCE, 0] - straight[rows.FORCE, 0]) / FY)
    counts = name in ("imk", "multilinear-pinching")  # they degrade at each turn
    assert (largest > 1e-3) == counts, largest
    assert counts or largest < 1e-5


@pytest.mark.parametrize("points", range(1, MAX_POINTS + 1))
def test_gauss_legendre_rules(points):
    x, w = np.polynomial.legendre.leggauss(points)
    np.testing.assert_allclose(NODES[points, :points], 0.5 * (x + 1.0), atol=4e-16)
    np.testing.assert_allclose(WEIGHTS[points, :points], 0.5 * w, rtol=2e-13)
    assert not NODES[points, points:].any() and not WEIGHTS[points, points:].any()


def test_gauss_points_of_a_polynomial_with_unused_coefficients():
    """A polynomial of degree q of the drift, which is a parabola of time, times the rate is
    integrated exactly with q + 1 points, whatever the number of rows of the table is."""
    points = LAWS["polynomial"].functions().points
    for coefficients in ((K,), (K, 0.0, 5.0), (K, 3.0), (K, 2.0, 1.0, -4.0)):
        for unused in range(4):
            values = law_table("polynomial", *coefficients, *[0.0] * unused)
            assert points(values, np.zeros((1, 2)), 0, DY) == len(coefficients) + 1.0


@pytest.mark.parametrize("number", [0.0, -3.0, math.nan, 2.5, 1e9])
def test_number_of_gauss_points_of_a_plugin_law(monkeypatch, number):
    """The function `points` of a plug-in can return any number. At least one point is used."""
    monkeypatch.setattr(path_module, "points_on_path", lambda *arguments: number)
    expected = {2.5: 2.5, 1e9: path_module._MAX_POINTS}.get(number, 1.0)
    assert path_module.required_points(None, None, 0, 1.0) == expected
