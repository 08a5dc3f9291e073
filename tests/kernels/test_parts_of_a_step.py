"""Tests of single terms of the time steps against their definitions, which are computed
independently here."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from step_checks import RAYLEIGH, ModalDamping, SingleSteps, matrices
from step_checks import building as dense_building
from tdint.kernels import layout as rows
from tdint.kernels.equations import corners, moment4
from tdint.kernels.equations import impulse4 as equations
from tdint.kernels.equations import impulse_momentum as momentum
from tdint.kernels.equations.iteration import RESIDUAL_TOLERANCE, ROUNDING, TANGENT_TOLERANCE
from tdint.kernels.equations.moment4 import MAX_CORNERS, ROW, STORE
from tdint.kernels.linear_terms import force_moment, force_rate
from tdint.kernels.step_interpolant import max_interior_bezier_point
from tdint.kernels.stepping import Memory, Scene
from tdint.kernels.stories import brace
from tdint.kernels.stories.path import Integrals
from tdint.methods.catalogue import parse
from tdint.methods.workspace import workspace
from tdint.model.building import assemble, force_table
from tdint.model.definition import Force
from tdint.model.story_laws import Law


@pytest.mark.parametrize("half_angle", [1e-6, 1e-3, 0.02, 0.05, 0.08, 0.0999, 0.1001, 0.5, 2.0])
def test_moment_of_force_agrees_with_power_series(half_angle):
    """Share (sin x - x cos x) / x^3 of the rate at mid-step, by its power series: sum of (-1)^k
    (2 k + 2) x^(2 k) / (2 k + 3)!."""
    h, t = 0.02, 0.3
    forces = force_table([Force(1, 3.0, -2.0, 2.0 * half_angle / h)])
    share = math.fsum(
        (-1) ** k * (2 * k + 2) * half_angle ** (2 * k) / math.factorial(2 * k + 3)
        for k in range(20)
    )
    expected = 3.0 * h * share * force_rate(forces, 0, t + 0.5 * h)
    # Below 0.1, the first omitted term is at most 7e-15; above 0.1, the closed form loses digits by
    # cancellation.
    close = 2e-14 if half_angle < 0.1 else 1e-12
    assert force_moment(forces, 0, t, h) == pytest.approx(expected, rel=close, abs=0.0)


def test_bound_of_acceleration_is_maximum_inner_bezier_point():
    """The acceleration A0 + (A1 - A0) s + s (1 - s) (B + D (1 - 2 s)) is converted to coefficients
    of powers of s."""
    generator = np.random.default_rng(65)
    s = np.linspace(0.0, 1.0, 101)
    for a0, a1, bulge, tilt in generator.normal(size=(200, 4)):
        line = np.polynomial.Polynomial([a0, a1 - a0])
        arch = np.polynomial.Polynomial([0.0, 1.0, -1.0])
        cubic = line + arch * np.polynomial.Polynomial([bulge + tilt, -2.0 * tilt])
        c0, c1, c2, _ = cubic.coef
        inner = abs(c0 + c1 / 3.0), abs(c0 + 2.0 * c1 / 3.0 + c2 / 3.0)
        bound = max_interior_bezier_point(a0, a1, bulge, tilt)
        assert bound == pytest.approx(max(inner), rel=1e-12)
        assert np.max(np.abs(cubic(s))) <= max(bound, abs(a0), abs(a1)) * (1.0 + 1e-12)


def test_floor_motion_between_corners_integrates_acceleration():
    """Accelerations that are quadratic in time are integrated exactly. The difference at the end of
    the step is distributed by a cubic, and the rates are its derivative."""
    h, velocity = 0.02, 0.7
    times = np.array([0.0, 0.15, 0.3, 0.65, 1.0])
    ground = (0.4, -0.9)
    relative = np.polynomial.Polynomial([0.3, -1.1, 2.3])  # h^2 times the acceleration
    rate = relative.integ() + h * velocity
    way = rate.integ()
    missed, missed_rate = 0.013, -0.021
    scratch = np.zeros((STORE, 2))
    scratch[ROW.NODE_FORCE : ROW.NODE_FORCE + 5, 1] = times
    absolute = relative(times) / h**2 + ground[0] + times * (ground[1] - ground[0])
    scratch[ROW.NODE_ACCELERATION : ROW.NODE_ACCELERATION + 5, 0] = absolute
    scratch[ROW.A0, 0] = rate(1.0) - rate(0.0) + missed_rate
    scratch[ROW.RISE, 0] = way(1.0) + missed
    state = np.zeros((3, 2))
    state[rows.VELOCITY, 0] = velocity
    load = np.array([0.0, *ground])
    corners._integrate_accelerations(
        h, load, Memory(state, np.zeros((1, 2)), scratch, np.zeros(1)), 0, 5
    )
    # The cubic p with p(0) = p'(0) = 0, p(1) and p'(1) as missed.
    cubic = np.polynomial.Polynomial(
        [0.0, 0.0, 3.0 * missed - missed_rate, missed_rate - 2.0 * missed]
    )
    moved, rates = (
        scratch[row + 1 : row + 5, 0] for row in (ROW.NODE_DISPLACEMENT, ROW.NODE_VELOCITY)
    )
    assert moved == pytest.approx((way + cubic)(times[1:]), rel=1e-12)
    assert rates == pytest.approx((rate + cubic.deriv())(times[1:]), rel=1e-12)


def impulse4_parts():
    """Return workspace, building, coefficients and scene of a step of 1 s without forces."""
    steps = SingleSteps("impulse4")
    space, building = steps.space, steps.building
    no_forces = np.zeros((0, rows.FORCE_COLUMNS))
    coefficients = steps.integrator.coefficients(building, no_forces, 1.0)
    scene = Scene(
        building.linear_terms, building.modal, building.law_parameters, no_forces, space.flags
    )
    return space, building, coefficients, scene


def test_impulse4_refactors_if_tangent_or_step_changes():
    """Each of the tangents at the inner point and at the end of either story, by more than the
    tolerance."""
    space, building, coefficients, scene = impulse4_parts()
    scratch, factors = space.scratch, equations.FACTORS
    path = (False, coefficients, scene, 1.0, space.memory, factors)
    assert equations._evaluate_laws(*path)  # the matrix has not been factored yet
    equations._factor(coefficients, building.linear_terms, building.modal, 1.0, scratch, factors)
    assert not equations._evaluate_laws(*path)
    tolerance = TANGENT_TOLERANCE * 100.0  # N/m; the stories have 100 N/m
    for row in (equations._BLOCK.FACTORED_C, equations._BLOCK.FACTORED_1):
        for story in range(2):
            for change, stale in ((0.5, False), (-0.5, False), (2.0, True), (-2.0, True)):
                scratch[factors + row, story] += change * tolerance
                assert equations._evaluate_laws(*path) == stale
                scratch[factors + row, story] -= change * tolerance
    assert equations._evaluate_laws(False, coefficients, scene, 0.5, space.memory, factors)


def test_impulse4_tolerates_rounding_of_displacements():
    """The tolerated residual is between one and a thousand units in the last place of the spring
    forces for the displacements of both floors."""
    space, _, coefficients, scene = impulse4_parts()
    space.state[rows.DISPLACEMENT, :2] = 0.3, -0.2
    equations._evaluate_laws(False, coefficients, scene, 1.0, space.memory, equations.FACTORS)
    tolerated = RESIDUAL_TOLERANCE * space.scratch[momentum.SIZE, :2]
    forces = 100.0 * np.array([0.3, 0.2 + 0.3])
    units = tolerated / (np.finfo(float).eps * forces)
    assert units[0] == pytest.approx(units[1], rel=1e-12)
    assert 1.0 < units[0] < 1000.0


@pytest.mark.parametrize("coefficient", [1.0, 5.0])
def test_impulse4_adds_the_force_of_a_power_law_dashpot(coefficient):
    """c r |r|^(2 e) with e = -0.2, of the story that has the dashpot."""
    ends = []
    for damper in (0.0, coefficient):
        space, building, coefficients, scene = impulse4_parts()
        terms = building.linear_terms.copy()
        terms[[rows.POWER_DAMPER, rows.POWER], 1] = damper, -0.2
        space.scratch[momentum.DV, :2] = 0.3, -0.4
        path = (False, coefficients, scene._replace(linear_terms=terms), 1.0, space.memory)
        equations._evaluate_laws(*path, equations.FACTORS)
        ends.append(space.scratch[momentum.FORCE_1, :2].copy())
    force = -coefficient * 0.7**0.6
    assert ends[1] - ends[0] == pytest.approx([0.0, force], rel=1e-9)


def over_reversal(dashpot, h=0.1, last_rate=-3.0):
    """Evaluate a Bouc-Wen story over a step in which its drift reverses; return the row of the
    kink, the force at the reversal and the tangents.

    The drift grows from 0.6 with the rate 2, reverses at 0.7 and ends at 0.6 with the rate -2.
    """
    bouc_wen = Law("bouc-wen", (30.0, 0.0, 1.0, 0.5))
    steps = SingleSteps("impulse4", bouc_wen)
    space, building = steps.space, steps.building
    no_forces = np.zeros((0, rows.FORCE_COLUMNS))
    coefficients = steps.integrator.coefficients(building, no_forces, h)
    linear_terms = building.linear_terms.copy()
    if dashpot:
        linear_terms[[rows.POWER_DAMPER, rows.POWER, rows.THRESHOLD], 0] = 5.0, 0.0, 0.0
    scene = Scene(linear_terms, building.modal, building.law_parameters, no_forces, space.flags)
    space.law_state[rows.DRIFT, 0], space.law_state[rows.RATE_SIGN, 0] = 0.6, 1.0
    space.law_state[rows.INTERNAL, 0] = 0.4
    space.state[rows.VELOCITY, 0], space.scratch[momentum.V1, 0] = 2.0, last_rate
    results = equations._evaluate_over_reversal(
        coefficients, scene, h, 0, (0.62, 0.58), space.memory
    )
    assert results[2] == (last_rate < 0.0)
    kink = float(space.scratch[equations.ROW.KINK, 0])
    return kink, float(space.law_state[rows.THIRD_TRIAL + rows.FORCE, 0]), results


def test_dashpot_adds_fraction_of_its_smaller_force_to_kink():
    alone, force, tangents = over_reversal(False)
    kink, same_force, same_tangents = over_reversal(True)
    assert (force, tangents) == (same_force, same_tangents)
    assert alone > 0.0
    # The dashpot forces at both ends are 5 times 2 and 5 times -3.
    assert over_reversal(True, last_rate=0.5)[2] == (0.0, 0.0, False)
    added = (kink - alone) * abs(force)
    assert added == pytest.approx(equations._DASHPOT_KINK * 10.0, rel=1e-9)


def test_mismatch_of_accelerations_and_negligible_kinks():
    """The mismatch is the sum of mass times the squared difference of the mean of both
    accelerations and the mean over the step, without the dashpots."""
    h, row = 0.1, equations.ROW
    random = np.random.default_rng(72)
    for near_peak in (False, True):
        for dashpot in (False, True):
            space, building, _, _ = impulse4_parts()
            linear_terms = building.linear_terms.copy()
            linear_terms[rows.MASS, :2], linear_terms[rows.INVERSE_MASS, :2] = (
                (2.0, 4.0),
                (0.5, 0.25),
            )
            linear_terms[rows.POWER_DAMPER, 1] = 7.0 * dashpot
            scene = Scene(
                linear_terms, building.modal, building.law_parameters,
                np.zeros((0, rows.FORCE_COLUMNS)), space.flags,
            )  # fmt: skip
            a0, a1, mean = random.normal(size=(3, 2))
            damper = random.normal(size=2)
            space.state[rows.ACCELERATION, :2] = a0
            space.scratch[momentum.A1, :2], space.scratch[momentum.DV, :2] = a1, h * mean
            space.scratch[row.DASHPOT_MISMATCH, :3] = *damper, 9.0
            space.law_state[rows.THIRD_TRIAL + rows.DRIFT, :2] = 0.1, -0.81 if near_peak else -0.79
            space.scratch[row.LARGEST_DRIFT, :2] = 1.0
            difference = 0.5 * (a0 + a1) - mean + [0.5, 0.25] * (damper - [damper[1], 0.0])
            mismatch = float(np.sum([2.0, 4.0] * difference**2))
            norm = float(np.sum([1.0, 2.0] * (a0**2 + a1**2)))
            limit = equations._MAX_KINK * mismatch / norm
            for first, second in ((0.999, 1.001), (1.001, 0.999)):
                space.scratch[row.KINK, :2] = limit * first, limit * second
                space.scratch[row.RUN_MAXIMA, :2] = 0.0, 0.5 * norm
                equations.keep_negligible_kinks(scene, h, space.memory)
                found = space.scratch[row.KINK, :2]
                assert (found[0] > 0.0) == (first < 1.0)
                assert (found[1] > 0.0) == (second < 1.0 and not (dashpot and near_peak))
                maxima = space.scratch[row.RUN_MAXIMA, :2]
                assert maxima == pytest.approx([mismatch, norm], rel=1e-12)
            # A larger mismatch of an earlier step remains, and allows larger kinks.
            space.scratch[row.KINK, :2] = 1.9 * limit
            space.scratch[row.RUN_MAXIMA, :2] = 2.0 * mismatch, 3.0 * norm
            equations.keep_negligible_kinks(scene, h, space.memory)
            assert space.scratch[row.KINK, 0] > 0.0
            assert space.scratch[row.RUN_MAXIMA, :2] == pytest.approx([2.0 * mismatch, 3.0 * norm])


@pytest.mark.parametrize("relief", [0.0, 0.5, 800.0])
def test_force_of_a_damper_above_its_relief_force(relief):
    """c r up to the relief force, from there with a fraction of c; 0 for no relief force."""
    terms = np.zeros((rows.LINEAR_TERM_ROWS, 2))
    terms[rows.BRACED_DAMPER, 0], terms[rows.BRACED_EXPONENT, 0] = 1000.0, 1.0
    terms[[rows.BRACED_RELIEF, rows.BRACED_RELIEF_RATIO], 0] = relief, 0.05
    for rate in (2e-4, -3e-3, 2.0, -5.0):
        size = 1000.0 * abs(rate)
        if 0.0 < relief < size:
            size = relief + 0.05 * (size - relief)
        found = brace._damper_force(terms, 0, rate)
        assert found == pytest.approx(math.copysign(size, rate), rel=1e-12)


def test_force_of_a_brace_in_a_step_of_impulse4_and_its_mismatch():
    """A linear damper with a brace along a parabola of drift: F' = kb (d' - F / c). Force at the
    end, impulse, and the difference of the mean of both end forces from the mean over the step."""
    h, stiffness, damper = 0.1, 300.0, 1000.0
    space, building, _, scene = impulse4_parts()
    linear_terms = building.linear_terms.copy()
    braced = [rows.BRACE, rows.BRACED_DAMPER, rows.BRACED_EXPONENT]
    linear_terms[braced, 1] = stiffness, damper, 1.0
    memory = space.memory._replace(state=np.zeros((8, 3)))  # of a building with braces
    scratch, factors = space.scratch, equations.FACTORS
    for start, rise, bend in ((40.0, 0.3, 0.2), (-25.0, 0.1, -0.9), (0.0, -0.4, 0.5)):
        memory.state[rows.BRACE_FORCE, 1] = start
        scratch[[momentum.FORCE_1, momentum.FORCE_S, equations.ROW.DASHPOT_MISMATCH], 1] = 7.0
        equations._add_brace(
            scene._replace(linear_terms=linear_terms), 1, h, rise, bend, memory, factors
        )
        path = solve_ivp(
            lambda t, force, rise=rise, bend=bend: [
                stiffness * ((rise + bend * (t / h - 0.5)) / h - force[0] / damper), force[0]
            ],
            (0.0, h), [start, 0.0], rtol=1e-11, atol=1e-9,
        )  # fmt: skip
        end, impulse = path.y[:, -1]
        scale = abs(start) + stiffness * (abs(rise) + abs(bend))
        assert scratch[momentum.FORCE_1, 1] - 7.0 == pytest.approx(end, abs=2e-6 * scale)
        assert scratch[momentum.FORCE_S, 1] - 7.0 == pytest.approx(impulse, abs=2e-6 * scale * h)
        mismatch = 0.5 * (start + end) - impulse / h
        assert abs(mismatch) > 1e-3 * scale
        found = scratch[equations.ROW.DASHPOT_MISMATCH, 1]
        assert found == pytest.approx(mismatch, abs=2e-6 * scale)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average", "gauss4", "bathe"])
def test_residual_of_converged_step_is_small(method):
    """The residual is a fraction of the sum of the absolute values of the terms."""
    steps = SingleSteps(method)
    for ground in (1.0, -2.0):
        assert steps.take(0.0, ground) >= 0
        assert 0.0 <= steps.space.step_status[rows.RESIDUAL] < 1e-6


def test_first_motion_between_corners_is_cubic_of_step(monkeypatch):
    """Without a pass of the iteration: displacements from the start, and velocities times the
    length of the step, of the cubic with the values and rates at both ends."""
    monkeypatch.setattr(corners, "_PASSES", 0)
    steps, h = SingleSteps("moment4"), 0.05
    space, building = steps.space, steps.building
    scene = Scene(
        building.linear_terms,
        building.modal,
        building.law_parameters,
        np.zeros((0, rows.FORCE_COLUMNS)),
        space.flags,
    )
    scratch, v0 = space.scratch, np.array([0.7, -2.0])
    space.state[rows.VELOCITY, :2] = v0
    scratch[ROW.RISE, :2] = rise = np.array([0.02, 0.05])
    scratch[ROW.A0, :2] = change = np.array([-0.01, 0.03])
    scratch[ROW.CORNERS : ROW.CORNERS + 4, 0] = 3.0, 0.2, 0.2, 0.6
    coefficients = steps.integrator.coefficients(building, scene.forces, h)
    corners._update_peaks_between_corners(coefficients, scene, h, np.zeros(3), space.memory)
    times = scratch[ROW.NODE_FORCE : ROW.NODE_FORCE + 7, 2]
    assert times == pytest.approx([0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
    for i in range(2):
        # c t^2 + d t^3 with c + d = rise - h v0 and 2 c + 3 d = change
        remaining = rise[i] - h * v0[i]
        d = change[i] - 2.0 * remaining
        cubic = np.polynomial.Polynomial([0.0, h * v0[i], remaining - d, d])
        moved, rates = (
            scratch[row : row + 7, i] for row in (ROW.NODE_DISPLACEMENT, ROW.NODE_VELOCITY)
        )
        assert moved == pytest.approx(cubic(times), abs=1e-15)
        assert rates == pytest.approx(cubic.deriv()(times), abs=1e-15)


@pytest.mark.parametrize("link", [1.0, 0.0])
@pytest.mark.parametrize("damping", [RAYLEIGH, ModalDamping((0.02, 0.05, 0.1))])
def test_accelerations_at_the_start_of_a_step_of_moment4_balance_the_forces(damping, link):
    """With dense matrices, P-delta, dampers, and a load that is linear in time; a dashpot is
    added in the second story. With the link 0, the third story is on the ground."""

    def dashpot(rate):
        return 3e5 * rate * (rate**2 + 0.01**2) ** -0.2

    case = dense_building(damping)
    assembled, random = assemble(case), np.random.default_rng(74)
    space = workspace(assembled, parse("moment4"))
    linear_terms = assembled.linear_terms.copy()
    linear_terms[[rows.POWER_DAMPER, rows.POWER, rows.THRESHOLD], 1] = 3e5, -0.2, 0.01**2
    scene = Scene(
        linear_terms,
        assembled.modal,
        assembled.law_parameters,
        np.zeros((0, rows.FORCE_COLUMNS)),
        space.flags,
    )
    linear_terms[rows.LINK, 2] = link
    u, v = 0.01 * random.normal(size=4), random.normal(size=4)
    difference = np.eye(4) - np.diag(linear_terms[rows.LINK, 1:4], -1)
    drift, rate = difference @ u, difference @ v
    springs = np.array([story.stiffness for story in case.stories])
    space.state[rows.DISPLACEMENT, :4], space.state[rows.VELOCITY, :4] = u, v
    space.law_state[rows.DRIFT, :4], space.law_state[rows.FORCE, :4] = drift, springs * drift
    mean, moment = 1e5 * random.normal(size=(2, 4))
    space.scratch[ROW.LOAD, :4], space.scratch[ROW.LOAD + 1, :4] = mean, moment
    story_force = (springs + linear_terms[rows.GEOMETRIC, :4]) * drift
    story_force += linear_terms[rows.STORY_DAMPER, :4] * rate
    story_force[1] += dashpot(rate[1])
    modal = assembled.modal[:, :4]
    on_floors = linear_terms[rows.FLOOR_DAMPER, :4] * v + modal.T @ (modal @ v)
    # The load at the start is p0 if its mean is p0 + p1 / 2 and its first moment p1.
    force = mean - 0.5 * moment - on_floors - difference.T @ story_force
    found = [moment4._acceleration(scene, space.memory, i) for i in range(4)]
    assert found == pytest.approx(force / linear_terms[rows.MASS, :4], rel=1e-11)
    if link and damping is RAYLEIGH:
        _, viscous, stiffness = matrices(case)
        assert viscous @ v + stiffness @ u == pytest.approx(
            on_floors + difference.T @ (story_force - [0.0, dashpot(rate[1]), 0.0, 0.0]), rel=1e-11
        )


def test_corrections_of_moment4_are_compared_with_the_rounding_of_displacements():
    """Rises and bends are corrected and the corrections kept. They are small if the sum of both is
    at most a multiple of the sum of displacement, rise and bend."""
    n, random = 2, np.random.default_rng(75)
    for large_floor, large_row in ((None, 0), (0, 0), (0, 1), (1, 0), (1, 1)):
        state, scratch = np.zeros((3, n + 1)), random.normal(size=(STORE, n + 1))
        state[rows.DISPLACEMENT, :n] = -1.5, 0.25
        rise, bend = np.array([-0.3, 0.5]), np.array([0.7, -0.25])
        share = np.array([[0.5, -0.25], [-0.5, 0.25]]) * (1.0 - 1e-6)
        if large_floor is not None:
            share[large_row, large_floor] *= 4.0
        size = np.abs(state[0, :n]) + np.abs(rise) + np.abs(bend)
        corrections = share * ROUNDING * size
        scratch[ROW.RISE, :n], scratch[ROW.BEND, :n] = rise, bend
        scratch[ROW.X : ROW.X + 2, :n] = corrections
        assert moment4._correct(state, scratch, n) == (large_floor is None)
        assert scratch[ROW.RISE, :n] == pytest.approx(rise + corrections[0], rel=1e-15)
        assert scratch[ROW.BEND, :n] == pytest.approx(bend + corrections[1], rel=1e-15)
        kept = scratch[ROW.CORRECTION : ROW.CORRECTION + 2, :n]
        assert np.array_equal(kept, corrections)


def test_corners_are_sorted_and_those_at_the_ends_are_ignored():
    space = SingleSteps("moment4").space
    scratch, near = space.scratch, 0.5 * corners._MIN_DISTANCE
    scratch[ROW.CORNERS, 0], scratch[ROW.PEAKS + rows.PEAK_SHEAR, 1] = 0.0, 3.0
    scratch[ROW.PEAKS + rows.PEAK_DRIFT, 1] = 0.0
    results = Integrals(scratch, ROW.CORNERS)
    times = [0.7, 0.2, near, 1.0 - near, 1.0 + near, 0.9, 0.5, 0.0, 1.0, 0.1, 0.3, 0.6, 0.05, 0.8]
    for t in times:
        corners._store_branch_end(results, 1, t, 0.5 * t, -2.0 * t)
    stored = scratch[ROW.CORNERS + 1 : ROW.CORNERS + 1 + MAX_CORNERS, 0]
    assert scratch[ROW.CORNERS, 0] == MAX_CORNERS == 8
    assert stored.tolist() == [0.05, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7, 0.9]
    assert scratch[ROW.PEAKS + rows.PEAK_SHEAR, 1] == 3.0
    assert scratch[ROW.PEAKS + rows.PEAK_DRIFT, 1] == 0.5 * (1.0 + near)
    corners._store_branch_end(results, 1, 0.4, -0.6, -3.5)
    assert scratch[ROW.PEAKS + rows.PEAK_SHEAR, 1] == 3.5
    assert scratch[ROW.PEAKS + rows.PEAK_DRIFT, 1] == 0.6


def test_extrema_between_corners_are_located_on_parabolas():
    """Extrema that exceed the recorded peak and all three nodes become corners."""
    random, n, found = np.random.default_rng(15), 2, 0
    scratch = SingleSteps("moment4").space.scratch
    for _ in range(100):
        peak = random.choice([0.0, 2.0])
        times, values = np.array([0.0, 0.2, 0.4, 0.7, 1.0]), random.normal(size=5)
        scratch[:] = 0.0
        scratch[ROW.PEAKS + rows.PEAK_ACCELERATION, 1] = peak
        scratch[ROW.NODE_FORCE : ROW.NODE_FORCE + 5, n] = times
        scratch[ROW.NODE_ACCELERATION : ROW.NODE_ACCELERATION + 5, 1] = values
        scratch[ROW.CORNERS : ROW.CORNERS + 2, 0] = 1.0, 0.4
        expected = [0.4]
        for first, last in ((0.0, 0.4), (0.4, 1.0)):
            at_nodes = values[times.tolist().index(first) :][:3]
            parabola = np.polynomial.Polynomial.fit(
                [first, 0.5 * (first + last), last], at_nodes, 2, domain=[]
            ).convert()
            (extremum,) = parabola.deriv().roots()
            largest = max(peak, *np.abs(at_nodes))
            if first < extremum < last and abs(parabola(extremum)) > largest:
                expected.append(extremum)
        assert corners._add_extrema_to_corners(scratch, 5, n) == (len(expected) > 1)
        assert scratch[ROW.CORNERS, 0] == len(expected)
        stored = scratch[ROW.CORNERS + 1 : ROW.CORNERS + 1 + len(expected), 0]
        assert stored == pytest.approx(sorted(expected), rel=1e-9)
        found += len(expected) - 1
    assert found > 20


@pytest.mark.parametrize("link", [1.0, 0.0])
@pytest.mark.parametrize("leaving", [0, 1])
def test_step_with_corners_is_searched_if_bound_exceeds_peak(leaving, link):
    """Accelerations and total shears at both ends, plus the deviation due to the story that leaves
    its branch. Other peaks are far."""
    steps, h = SingleSteps("moment4", Law("bilinear", (50.0, 0.1))), 0.1
    space, building = steps.space, steps.building
    linear_terms, random = building.linear_terms.copy(), np.random.default_rng(76)
    mass = np.array([2.0, 5.0])
    linear_terms[rows.MASS, :2], linear_terms[rows.INVERSE_MASS, :2] = mass, 1.0 / mass
    linear_terms[rows.LINK, 1] = link
    no_forces = np.zeros((0, rows.FORCE_COLUMNS))
    scene = Scene(linear_terms, building.modal, building.law_parameters, no_forces, space.flags)
    space.law_state[rows.SLOPE, :2] = 100.0
    space.law_state[[rows.UPPER, rows.LOWER], :2] = [[1e9], [-1e9]]
    for _ in range(20):
        rise, bend, mean, change = random.normal(size=(4, 2)) * [[0.1], [0.1], [h * h], [h * h]]
        ground = random.normal(size=2)
        scratch = space.scratch
        for row, value in (
            (ROW.RISE, rise),
            (ROW.BEND, bend),
            (ROW.A0, mean),
            (ROW.A1, change),
        ):
            scratch[row, :2] = value
        story = [one[leaving] - (link * one[0] if leaving else 0.0) for one in (rise, bend)]
        deviation = corners._FORCE_DEVIATION * 100.0 * (abs(story[0]) + 0.5 * abs(story[1]))
        of_stories = np.zeros(2)
        of_stories[leaving] = deviation
        floor_request = of_stories + np.array([link * of_stories[1], 0.0])
        ends = [
            (mean + sign * 0.5 * change) / h**2 + g for sign, g in zip((-1, 1), ground, strict=True)
        ]
        accelerations = np.max(np.abs(ends), axis=0) + floor_request / mass
        shears = [np.array([m[0] + link * m[1], m[1]]) for m in (mass * end for end in ends)]
        total_shears = np.max(np.abs(shears), axis=0) + of_stories
        for row, bounds in (
            (rows.PEAK_ACCELERATION, accelerations),
            (rows.PEAK_TOTAL_SHEAR, total_shears),
        ):
            for i in range(2):
                for factor, expected in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
                    scratch[ROW.PEAKS : ROW.PEAKS + rows.PEAK_ROWS] = 1e12
                    scratch[ROW.PEAKS + row, i] = factor * bounds[i]
                    scratch[ROW.LEAVES_BRANCH, :2] = 0.0
                    scratch[ROW.LEAVES_BRANCH, leaving] = 1.0
                    load = np.array([0.0, *ground])
                    found = corners._may_exceed_peaks(scene, h, load, space.memory)
                    assert bool(found) == expected
    scratch[ROW.LEAVES_BRANCH, :2] = 0.0
    scratch[ROW.PEAKS : ROW.PEAKS + rows.PEAK_ROWS] = 0.0
    assert not corners._may_exceed_peaks(scene, h, load, space.memory)


@pytest.mark.parametrize("link", [1.0, 0.0])
def test_residual_norm_of_moment4_without_motion(link):
    """For zero rises and bends: a1 = 12 h v / (1 + 6 r), a0 = -r a1, the residuals
    M a0 + h^2 (F0 - P0) and M a1 - h^2 P1, and the sum of their squares (the second divided by 12)
    over the masses."""
    steps, h = SingleSteps("moment4", Law("bilinear", (50.0, 0.1))), 0.1
    space, building = steps.space, steps.building
    no_forces = np.zeros((0, rows.FORCE_COLUMNS))
    coefficients = steps.integrator.coefficients(building, no_forces, h)
    linear_terms, random = building.linear_terms.copy(), np.random.default_rng(77)
    linear_terms[rows.LINK, 1] = link
    scene = Scene(linear_terms, building.modal, building.law_parameters, no_forces, space.flags)
    for _ in range(5):
        v, drift, force, p0, p1 = random.normal(size=(5, 2)) * [
            [1.0],
            [0.1],
            [10.0],
            [30.0],
            [30.0],
        ]
        space.state[rows.VELOCITY, :2] = v
        space.law_state[rows.DRIFT, :2], space.law_state[rows.FORCE, :2] = drift, force
        space.scratch[ROW.LOAD, :2], space.scratch[ROW.LOAD + 1, :2] = p0, p1
        found = moment4._solve_on_branches(coefficients, scene, h, space.memory)
        r = coefficients[moment4.R]
        a1 = 12.0 * h * v / (1.0 + 6.0 * r)
        stories = force + linear_terms[rows.GEOMETRIC, :2] * drift
        floors = stories - np.array([link * stories[1], 0.0])
        impulse, moment = -r * a1 + h**2 * (floors - p0), a1 - h**2 * p1  # floors of 1 kg
        expected = float(impulse @ impulse + moment @ moment / 12.0)
        assert found == pytest.approx(expected, rel=1e-12)
        # The solution is the first correction, which a line search can halve.
        solution = space.scratch[ROW.RISE : ROW.RISE + 2, :2]
        assert np.all(solution != 0.0)
        assert np.array_equal(space.scratch[ROW.CORRECTION : ROW.CORRECTION + 2, :2], solution)
