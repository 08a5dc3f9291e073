"""Bouc-Wen law compared with closed forms and DOP853 of SciPy, and properties that every numerical
form must have."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from law_paths import CYCLE, FY, HARDENING, K, follow, law_table, law_variant
from path_kernel import forces_behind
from selection import every
from tdint.kernels import layout as rows
from tdint.kernels.laws import LAWS as COMPILED
from tdint.kernels.stories import path
from tdint.kernels.stories.law_state import start
from tdint.kernels.stories.law_tables import law_state_table
from tdint.model.story_laws import LAWS

SOFT = (1.0 - HARDENING) * FY
DY = FY / K


def law(exponent, beta):
    return law_table("bouc-wen", FY, HARDENING, exponent, beta)


def hysteretic(forces, drifts):
    """Return w from the force."""
    return (np.asarray(forces) - HARDENING * K * np.asarray(drifts)) / SOFT


@pytest.mark.parametrize(
    ("exponent", "closed"), [(1.0, lambda x: 1.0 - np.exp(-x)), (2.0, np.tanh)]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_loading_from_rest_agrees_with_closed_form(exponent, closed, sign):
    """The solution of w' = 1 - w is 1 - exp(-x), that of w' = 1 - w^2 is tanh x."""
    x = np.array([0.01, 0.5, 1.0, 3.0, 5.0, 80.0])
    drifts = sign * DY * x
    forces, _, _ = follow(law(exponent, 0.5), drifts)
    assert sign * hysteretic(forces, drifts) == pytest.approx(closed(x), abs=1e-6)


@pytest.mark.parametrize("exponent", every(2, [1.3, 1.0, 6.0, 2.0]))
@pytest.mark.parametrize("beta", [0.05, 0.23, 0.5, pytest.param(0.75, marks=pytest.mark.slow), 1.0])
def test_cycle_agrees_with_dop853(exponent, beta):
    """The differential equation of Wen (1976) is integrated by another solver along each straight
    segment."""
    w = 0.0
    here = 0.0
    expected = []
    for drift in CYCLE[38::39]:
        direction = math.copysign(1.0, drift - here)

        def rate(x, w, direction=direction):
            share = beta * math.copysign(1.0, direction * w[0]) + 1.0 - beta
            return [direction * (1.0 - abs(w[0]) ** exponent * share)]

        # Short steps over the place where w changes its sign, and the equation its form.
        length = abs(drift - here) / DY
        w = solve_ivp(
            rate, (0.0, length), [w], method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.05
        ).y[0, -1]
        expected.append(w)
        here = drift
    forces, _, _ = follow(law(exponent, beta), CYCLE)
    assert hysteretic(forces[38::39], CYCLE[38::39]) == pytest.approx(np.array(expected), abs=2e-6)


@pytest.mark.parametrize("block", [rows.COMMITTED, rows.FIRST_TRIAL, rows.SECOND_TRIAL])
@pytest.mark.parametrize("internal", [-0.4, 0.4])
@pytest.mark.parametrize("event", [rows.REVERSED, rows.REVERSED + 1.0])
def test_limits_of_a_branch_after_its_end(event, internal, block):
    """After a change of sign of w, the branch has no limit. After a reversal, it ends where w
    becomes zero, if w has the sign of the previous direction. Nothing else changes."""
    (of_name,) = (one for one in COMPILED if one.name == "bouc-wen")
    law_parameters = law(1.0, 0.5)
    state = law_state_table(law_parameters)
    state[:] = 7.0
    state[block + rows.DRIFT, 0], state[block + rows.INTERNAL, 0] = 0.01, internal
    state[block + rows.RATE_SIGN, 0] = 1.0
    expected = state.copy()
    expected[block + rows.UPPER, 0], expected[block + rows.LOWER, 0] = math.inf, -math.inf
    of_name.functions().switch(law_parameters, state, 0, block, event)
    if event == rows.REVERSED:
        expected[block + rows.RATE_SIGN, 0] = -1.0
        if internal > 0.0:  # unloading: w' = -1 for beta = 0.5 and the exponent 1
            expected[block + rows.LOWER, 0] = 0.01 - internal * DY
    assert state == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("exponent", [1.0, 1.7, 2.0, 10.0])
def test_force_does_not_depend_on_number_of_steps(exponent):
    """The law is independent of the rate: one segment of the drift gives the same force as a
    hundred substeps."""
    law_parameters = law(exponent, 0.7)
    for turn in (0.5 * DY, 4.0 * DY):
        path = [turn, -3.0 * DY]
        fine = np.concatenate(
            [np.linspace(0.0, turn, 101)[1:], np.linspace(turn, -3.0 * DY, 301)[1:]]
        )
        once, stored_once, lost_once = follow(law_parameters, path)
        forces, stored, lost = follow(law_parameters, fine)
        assert once[-1] == pytest.approx(forces[-1], abs=2e-6 * FY)
        assert stored_once == pytest.approx(stored, abs=2e-6 * FY * DY)
        assert lost_once == pytest.approx(lost, abs=1e-5 * FY * DY)


def forces_on_straight_paths(law_parameters, turn, drifts):
    """Return the forces at drifts after a reversal, with straight paths as in most methods."""
    return [follow(law_parameters, [turn, drift])[0][-1] for drift in drifts]


def forces_by_path_integration(law_parameters, turn, drifts, go=forces_behind.function):
    """Return the forces at drifts after a reversal, with the path integration of moment4 in plain
    Python."""
    begun = law_state_table(law_parameters)
    start(law_parameters, begun, 0, 0.0)
    scratch, forces = np.zeros((path.PATH_ROWS, 2)), np.zeros(len(drifts))
    turned = np.zeros_like(begun)
    go(law_parameters, begun, turned, np.array([turn]), scratch, forces[:1])
    go(law_parameters, turned, np.zeros_like(begun), np.asarray(drifts) - turn, scratch, forces)
    return forces


def compiled_forces_by_path_integration(law_parameters, turn, drifts):
    """Return the forces of `forces_by_path_integration`, in compiled form."""
    go = forces_behind.variant(law_variant(law_parameters))
    return forces_by_path_integration(law_parameters, turn, drifts, go)


@pytest.mark.parametrize("exponent", [1.0, 1.7, 20.0])
@pytest.mark.parametrize(
    ("start", "reach", "size"),
    [
        (forces_on_straight_paths, 4.0, 1001),
        (forces_by_path_integration, 2.0, 201),
        pytest.param(compiled_forces_by_path_integration, 4.0, 10_001, marks=pytest.mark.slow),
    ],
)
def test_force_is_continuous_function_of_drift(exponent, start, reach, size):
    """Newton's iteration requires that the force does not jump where the number of substeps or the
    sign of w changes, at a distance of a yield drift."""
    drifts = 3.0 * DY - np.linspace(0.0, reach, size) * DY
    forces = start(law(exponent, 0.9), 3.0 * DY, drifts)
    slopes = np.diff(forces) / np.diff(drifts)
    assert slopes.max() <= 2.0 * K
    assert slopes.min() >= 0.0
    assert np.max(np.abs(np.diff(slopes))) < 0.02 * K * exponent


@pytest.mark.parametrize("exponent", [1.0, 2.0, 100.0])
def test_force_is_at_most_strength(exponent):
    """|w| <= 1 holds on any path, including steps of a million yield drifts."""
    generator = np.random.default_rng(7)
    drifts = DY * generator.normal(size=400) * 10.0 ** generator.uniform(-3, 6, size=400)
    law_parameters = law_table("bouc-wen", FY, 0.0, exponent, 0.7)
    forces, _, dissipated = follow(law_parameters, drifts)
    assert np.max(np.abs(forces)) <= FY * (1.0 + 1e-12)
    assert dissipated > 0.0


def test_large_exponent_approaches_bilinear_law():
    """For beta = gamma, the limit n -> infinity is the bilinear law."""
    smooth, _, _ = follow(law(100.0, 0.5), CYCLE)
    sharp, _, _ = follow(law_table("bilinear", FY, HARDENING), CYCLE)
    assert smooth == pytest.approx(sharp, abs=0.02 * FY)


@pytest.mark.parametrize("beta", [0.05, 0.23, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("exponent", [1.0, 1.6])
def test_branch_ends_where_w_changes_its_sign(exponent, beta):
    """The drift change is the integral of du / (1 + (2 beta - 1) u^n) from 0 to |w|."""
    functions = LAWS["bouc-wen"].functions()
    law_parameters = law(exponent, beta)
    state = law_state_table(law_parameters)
    for side in (1.0, -1.0):
        for w in (0.03, 0.6, 0.98):
            state[rows.INTERNAL, 0] = -side * w
            expected = DY * quad(lambda u: 1.0 / (1.0 + (2.0 * beta - 1.0) * u**exponent), 0, w)[0]
            found = functions.kink(law_parameters, state, 0, 0, side)
            assert found == pytest.approx(expected, rel=1e-7)
            assert functions.kink(law_parameters, state, 0, 0, -side) == math.inf
            state[rows.DRIFT, 0], state[rows.RATE_SIGN, 0] = 0.3 * DY, -side
            functions.switch(law_parameters, state, 0, 0, rows.REVERSED)
            limits = (
                (0.3 * DY + expected, -math.inf) if side > 0.0 else (math.inf, 0.3 * DY - expected)
            )
            assert state[[rows.UPPER, rows.LOWER], 0] == pytest.approx(limits, rel=1e-7)
            functions.switch(law_parameters, state, 0, 0, rows.ABOVE)
            assert state[[rows.UPPER, rows.LOWER], 0].tolist() == [math.inf, -math.inf]
    state[rows.INTERNAL, 0] = 0.0
    assert functions.kink(law_parameters, state, 0, 0, 1.0) == math.inf


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_small_drifts_agree_with_an_integral_within_rounding(exponent):
    """The drift is the integral of dw / (1 - w^n). A power series is used for small w and exponents
    below 2; Runge-Kutta steps would err by 1e-9 to 1e-7."""
    x = np.array([1e-3, 0.02, 0.1, 0.2])
    forces, _, _ = follow(law(exponent, 0.5), DY * x)
    for drift, w in zip(x, hysteretic(forces, DY * x), strict=True):
        found = quad(lambda w: 1.0 / (1.0 - w**exponent), 0.0, w, epsrel=1e-13)[0]
        assert found == pytest.approx(drift, rel=2e-10)
