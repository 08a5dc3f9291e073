"""Tests of drift laws: tangents, paths, energies, and the location of events."""

import itertools
import math

import numpy as np
import pytest

from law_paths import CYCLE, FY, HARDENING, K, follow, law_table
from tdint.kernels import layout as rows
from tdint.kernels.laws import branch_following
from tdint.kernels.laws.branch_following import branch_follower
from tdint.kernels.laws.law import DriftLaw
from tdint.kernels.stories.branches import (
    _REVERSAL_TOLERANCE,
    NONE,
    _crossing,
    _exceeds_while_rising,
    find_sign_change,
    first_event,
)
from tdint.kernels.stories.law_state import restoring_force, start
from tdint.kernels.stories.law_tables import law_state_table
from tdint.model import law_checks
from tdint.model.law_checks import path_faults
from tdint.model.story_laws import LAWS

IMK_SIDE = (FY, 0.035, 0.1, 1.1, 0.2, 0.5, 1.0)
MULTILINEAR_SIDE = (FY / K, FY, 0.05, 1.4 * FY, 0.1, 1.1 * FY, 0.3, 0.5 * FY)
INTACT = (math.inf, *3 * (0.0, 0.0, 1.0, 1.0, 0.0), math.inf)
DEGRADING = (0.002, 0.01, 0.01, 0.5, 0.2, 0.1, 0.3, 0.01, 0.5, 0.1)
LAW_CASES = {
    "linear": (),
    "polynomial": (K, 200.0, 5e4),
    "bilinear": (FY, HARDENING, 0.8 * FY),
    "peak-oriented": (FY, HARDENING, 0.4),
    "tanh": (FY,),
    "bouc-wen": (FY, HARDENING, 1.7, 0.6, *DEGRADING),
    "gap": (0.05, 4.0 * K, 0.0, 0.0, 1.0),
    "hertz": (0.05, 20.0 * K, 0.0, 1.0),
    "trilinear-pinching": (FY, 2.5 * FY, 0.2, 0.4, 0.3),
    "imk": (*IMK_SIDE, *IMK_SIDE, *4 * [1.5], 1.0, 0.4, 0.6),
    "multilinear-pinching": (*2 * MULTILINEAR_SIDE, *2 * (0.5, 0.25, 0.05), *INTACT),
    "ramberg-osgood": (FY, 0.6, 5.0),
    "steel": (FY, HARDENING, 15.0, 0.9, 0.15, 0.05, 1.0, 0.04, 1.0),
    # Rule kinematic; tests/kernels/test_multilinear.py contains all rules.
    "multilinear": (0.0, 0.02 * K, *2 * (FY / K, FY, 0.05, 1.4 * FY, *76 * (math.inf,))),
}


def test_every_law_has_a_case():
    assert set(LAW_CASES) == set(LAWS)


def view(array, name):
    """Return a view of an array whose numbers are plain floats: interpreted laws take a third of
    the time."""
    return memoryview(array)


@pytest.mark.parametrize("name", LAWS)
def test_declarations_of_law_agree_with_its_functions(name, monkeypatch):
    assert LAWS[name].kinked == (LAWS[name].functions().switch is not None)
    law_parameters = law_table(name, *LAW_CASES[name])
    state = law_state_table(law_parameters)
    start(law_parameters, state, 0, 0.06 if name == "hertz" else 0.0)  # linear within the gap
    assert math.isinf(state[rows.SLOPE, 0]) == LAWS[name].curved
    # Force, tangent and branches agree along paths from the elastic range to drifts far beyond
    # yielding.
    numbers, values = law_parameters[:, 0], law_parameters[rows.FIRST_PARAMETER :, 0].tolist()
    law, yield_drift = LAWS[name], LAWS[name].yield_drift(K, values)
    assert path_faults(law, numbers, yield_drift, view) == []
    # Without the drift at first yield, the tangent of a curved law is verified on the first three
    # paths; the longer ones are the same as before.
    monkeypatch.setattr(law_checks, "_DECADES", law_checks._DECADES[:3])
    assert path_faults(law, numbers, guard=view) == []


@pytest.mark.parametrize(
    "name", sorted(set(LAW_CASES) - {"polynomial", "multilinear-pinching", "multilinear"})
)
def test_declared_dimensions_of_parameters_are_correct(name):
    """If the unit of force is a thousandth and the unit of length a hundredth, every force along a
    path is 1000 times the number. Laws with lists as parameters are omitted."""
    by_force, by_length = 1000.0, 100.0
    parameters = LAWS[name].parameters
    assert len(parameters) == len(LAW_CASES[name])
    scaled = [
        value * by_force**parameter.force * by_length**parameter.length
        for parameter, value in zip(parameters, LAW_CASES[name], strict=True)
    ]
    other = law_table(name, *scaled)
    other[rows.STIFFNESS, 0] *= by_force / by_length
    forces, stored, dissipated = follow(law_table(name, *LAW_CASES[name]), CYCLE)
    found = follow(other, by_length * CYCLE)
    assert found[0] == pytest.approx(by_force * forces, rel=1e-9, abs=1e-6)
    energy = by_force * by_length * np.array([stored, dissipated])
    assert found[1:] == pytest.approx(energy, rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("name", LAW_CASES)
def test_tangent_is_slope_of_force(name):
    law_parameters = law_table(name, *LAW_CASES[name])
    state = law_state_table(law_parameters)
    start(law_parameters, state, 0, 0.01)
    for drift in (-0.05, 0.004, 0.015, 0.07):
        tangent = restoring_force(law_parameters, state, 0, 0, rows.FIRST_TRIAL, drift)
        force = state[rows.FIRST_TRIAL + rows.FORCE, 0]
        restoring_force(law_parameters, state, 0, 0, rows.FIRST_TRIAL, drift + 1e-7)
        assert (state[rows.FIRST_TRIAL + rows.FORCE, 0] - force) / 1e-7 == pytest.approx(
            tangent, rel=1e-5
        )


def test_bilinear_loop_agrees_with_hand_calculation():
    """Yield at 0.02; up to 0.06, back over an elastic range of 0.04, then yielding the other
    way."""
    law_parameters = law_table("bilinear", FY, HARDENING)
    forces, _, _ = follow(law_parameters, [0.02, 0.06, 0.02, -0.02])
    turn = FY + HARDENING * K * 0.04
    expected = [FY, turn, turn - K * 0.04, turn - K * 0.04 - HARDENING * K * 0.04]
    assert forces == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", ["bilinear", "gap"])
def test_following_branches_agrees_with_closed_form(name):
    law_parameters = law_table(name, *LAW_CASES[name])
    functions = LAWS[name].functions()
    walk = branch_follower(functions.switch, *([functions.advance] if name == "bilinear" else []))
    by_branches = law_state_table(law_parameters)
    start(law_parameters, by_branches, 0, 0.0)
    forces, _, hysteretic_energy = follow(law_parameters, CYCLE)
    for drift, force in zip(CYCLE, forces, strict=True):
        walk(law_parameters, by_branches, 0, 0, rows.SECOND_TRIAL, drift)
        by_branches[: rows.LAW_STATE_ROWS] = by_branches[
            rows.SECOND_TRIAL : rows.SECOND_TRIAL + rows.LAW_STATE_ROWS
        ]
        assert by_branches[rows.FORCE, 0] == pytest.approx(force, rel=1e-12, abs=1e-10)
        if name == "gap":
            beyond = max(abs(drift) - 0.05, 0.0)
            assert force == pytest.approx(
                K * drift + 4.0 * K * np.copysign(beyond, drift), rel=1e-12
            )
    assert by_branches[rows.DISSIPATED, 0] == pytest.approx(hysteretic_energy, rel=1e-12)


def test_peak_oriented_loop_agrees_with_hand_calculation():
    """The law of Clough without degradation of the unloading stiffness yields, unloads to zero
    force and reloads towards the yield point of the opposite direction."""
    law_parameters = law_table("peak-oriented", FY, HARDENING, 0.0)
    turn = FY + HARDENING * K * 0.04  # at drift 0.06
    zero = 0.06 - turn / K
    back = -FY / (zero + 0.02)  # slope from (zero, 0) to (-0.02, -FY), negative
    drifts = [0.02, 0.06, zero, 0.0, -0.02, -0.04, -0.04 + (FY + 1.0) / K]
    expected = [FY, turn, 0.0, back * zero, -FY, -FY - 1.0, 0.0]
    forces, _, _ = follow(law_parameters, drifts)
    assert forces == pytest.approx(expected, rel=1e-10, abs=1e-10)
    # On towards the farthest point on the positive side.
    forces, _, _ = follow(law_parameters, [*drifts, 0.06, 0.08])
    assert forces[-2:] == pytest.approx([turn, turn + HARDENING * K * 0.02], rel=1e-10)


def _origin_oriented():
    """Return an origin-oriented law: linear up to the maximum drift, and then with a tenth of the
    stiffness. Its own state row counts the reversals at the maximum drift."""

    def strain_energy(law_parameters, law_state, i):
        return 0.5 * law_state[rows.FORCE, i] * law_state[rows.DRIFT, i]

    def enter(law_parameters, law_state, i):
        law_state[rows.UPPER, i], law_state[rows.LOWER, i] = FY / K, -FY / K

    def switch(law_parameters, law_state, i, block, event):
        drift = law_state[block + rows.DRIFT, i]
        law_state[block + rows.RATE_SIGN, i] = event
        law_state[block + rows.UPPER, i] = math.inf if event else abs(drift)
        law_state[block + rows.LOWER, i] = -math.inf if event else -abs(drift)
        law_state[block + rows.SLOPE, i] = (
            0.1 * K if event else law_state[block + rows.FORCE, i] / drift
        )
        law_state[branch_following.extra_rows(law_state, block), i] += event == rows.REVERSED

    return branch_following.branch_first(
        branch_following.follow_branches(switch, strain_energy, enter)
    )


PLUGINS = {
    "origin-oriented": DriftLaw("origin-oriented", "", _origin_oriented, kinked=True, extra_rows=1)
}
KNOWING = [
    name
    for name, law in LAWS.items()
    if law.kinked and law.functions().keep and not law.functions().accumulate_dissipation
]


def _along(functions, law_parameters, law_state, drifts):
    """Return tangent, force and work at successive drifts, each computed in its own trial block."""
    results = []
    for previous, drift in enumerate(drifts):
        trial = (previous + 1) * rows.LAW_STATE_ROWS
        law_state[trial + rows.DRIFT, 0] = drift
        tangent = functions.force(
            law_parameters, law_state, 0, previous * rows.LAW_STATE_ROWS, trial, drift
        )
        results.append((tangent, law_state[trial + rows.FORCE, 0], law_state[trial + rows.WORK, 0]))
    return results


@pytest.mark.parametrize("name", [*KNOWING, *PLUGINS])
def test_branch_shortcut_changes_no_bit(name, monkeypatch):
    """Forces, tangents, work and committed states agree with the plain path follower, on random
    paths over up to three blocks, repeated with other drifts as in iterations."""
    law = {**LAWS, **PLUGINS}[name]
    looking = law.functions()
    with monkeypatch.context() as patch:
        patch.setattr(branch_following, "branch_first", lambda functions: functions)
        plain = law.functions()
    code = name if name in LAWS else "linear"
    law_parameters = law_table(code, *LAW_CASES.get(name, ()))
    tables = [
        np.zeros((rows.EXTRA_ROWS + rows.LAW_STATE_BLOCKS * law.extra_rows, 2)) for _ in range(2)
    ]
    for law_state in tables:
        law_state[rows.SLOPE, 0], law_state[rows.UPPER, 0], law_state[rows.LOWER, 0] = (
            K,
            math.inf,
            -math.inf,
        )
        plain.enter(law_parameters, law_state, 0)
    looking_at, walked = tables
    looking_at[rows.LAW_STATE_ROWS : rows.FAILED_INTERNAL] = (
        1e3  # any earlier content of the trial blocks
    )
    generator = np.random.default_rng(len(name))
    drift, borrowed, from_block, own = 0.0, 0, 0, 0
    for part in np.linspace(0.0, 1.0, 500):
        restoring_force_outlined = (0.5 + 8.0 * part) * FY / K
        for _ in range(generator.integers(1, 4)):
            steps = (
                FY
                / K
                * 10.0 ** generator.uniform(-2.0, 0.5)
                * generator.normal(size=generator.integers(1, 4))
            )
            drifts = np.clip(
                drift + np.cumsum(steps), -restoring_force_outlined, restoring_force_outlined
            )
            assert _along(looking, law_parameters, looking_at, drifts) == _along(
                plain, law_parameters, walked, drifts
            )
        loans = looking_at[
            rows.FIRST_TRIAL + rows.BRANCH_OFFSET : rows.FAILED_INTERNAL : rows.LAW_STATE_ROWS, 0
        ][: drifts.size]
        borrowed += np.count_nonzero(loans)
        own += np.count_nonzero(loans == 0.0)
        from_block += np.count_nonzero(loans[1:] == -rows.LAW_STATE_ROWS)
        for functions, law_state in ((looking, looking_at), (plain, walked)):
            trial = drifts.size * rows.LAW_STATE_ROWS
            functions.keep(law_parameters, law_state, 0, trial - rows.LAW_STATE_ROWS, trial)
            law_state[[rows.DRIFT, rows.FORCE, rows.INTERNAL], 0] = law_state[
                trial + np.array([rows.DRIFT, rows.FORCE, rows.INTERNAL]), 0
            ]
        drift = walked[rows.DRIFT, 0]
        assert np.array_equal(looking_at[: rows.LAW_STATE_ROWS], walked[: rows.LAW_STATE_ROWS])
        assert np.array_equal(
            looking_at[rows.EXTRA_ROWS :][: law.extra_rows],
            walked[rows.EXTRA_ROWS :][: law.extra_rows],
        )
    assert min(borrowed, own) > 50 and from_block > 10


@pytest.mark.parametrize("seed", range(12))
def test_first_crossing_of_cubic(seed):
    generator = np.random.default_rng(seed)
    d = generator.normal(size=4)
    limit = d[0] + abs(generator.normal())
    s = np.linspace(0.0, 1.0, 200001)
    values = (
        (1 - s) ** 3 * d[0] + 3 * s * (1 - s) ** 2 * d[1] + 3 * s * s * (1 - s) * d[2] + s**3 * d[3]
    )
    above = np.flatnonzero(values > limit)
    found = _crossing(d, limit, 0.0, NONE)
    assert found == pytest.approx(s[above[0]], abs=1e-5) if above.size else found == NONE


def test_cubic_starting_beyond_limit_returns_before_crossing():
    """The last event may have been missed slightly, or the cubic turns outside of the limit and
    crosses it again."""
    assert _crossing((1.0, 0.0, 0.0, 1.0), 0.999, 0.0, NONE) == pytest.approx(1.0, abs=1e-3)
    assert _crossing((1.0, 0.0, 0.0, 1.0), 0.2, 0.0, NONE) == pytest.approx(0.5)
    assert _crossing((1.0, 0.5, 0.2, 0.1), 0.999, 0.0, NONE) == NONE
    assert _crossing((1.0, 1.1, 1.2, 1.3), 0.999, 0.0, NONE) == 0.0


def test_crossing_must_be_first_and_exceed_slack():
    straight = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)
    assert _crossing(straight, 0.5, 0.4, NONE) == pytest.approx(0.5)
    assert _crossing(straight, 0.5, 0.6, NONE) == NONE
    assert _crossing(straight, 0.5, 0.0, 0.51) == pytest.approx(0.5)
    assert _crossing(straight, 0.5, 0.0, 0.49) == NONE


@pytest.mark.parametrize("seed", range(12))
def test_first_sign_change_of_quadratic(seed):
    generator = np.random.default_rng(seed)
    r = generator.normal(size=3)
    r[0] = abs(r[0])
    s = np.linspace(0.0, 1.0, 200001)
    values = (1 - s) ** 2 * r[0] + 2 * s * (1 - s) * r[1] + s * s * r[2]
    below = np.flatnonzero(values < 0.0)
    found = find_sign_change(*r)
    assert found == pytest.approx(s[below[0]], abs=1e-5) if below.size else found == NONE
    assert math.isfinite(found)


def test_sign_change_is_found_without_division_by_zero():
    """A caller searches only if a later Bezier point is negative. For all such quadratics on a grid
    with equal and zero points, the result is a zero of the quadratic, which is negative after
    it."""
    points = [-1.0, -0.5, 0.0, 0.5, 1.0]
    for r0, r1, r2 in itertools.product([0.5, 1.0], points, points):
        if min(r1, r2) >= 0.0:
            continue
        found = find_sign_change(r0, r1, r2)
        if r2 < 0.0:
            assert 0.0 < found < 1.0
            assert (1 - found) ** 2 * r0 + 2 * found * (1 - found) * r1 + found**2 * r2 == (
                pytest.approx(0.0, abs=1e-15)
            )
        else:
            assert found == NONE or r1 * r1 >= r0 * r2


def test_rate_opposite_to_branch_changes_sign_at_start_or_not_at_all():
    for r0 in (0.0, -1e-9):
        assert find_sign_change(r0, -1.0, 1.0) == 0.0
        assert find_sign_change(r0, -1.0, -1.0) == 0.0
        assert find_sign_change(r0, 1.0, -1.0) == NONE
    # From rest, the rate is negative in the complete step.
    assert find_sign_change(0.0, 0.0, -1e-7) == 0.0


def test_force_is_nan_after_too_many_changes_of_branch():
    """A law with branches of equal length: a path over up to the maximum number of ends has a
    force, a longer path has none."""

    def switch(law_parameters, law_state, i, block, event):
        upper = law_state[block + rows.UPPER, i] + FY / K
        branch_following.set_branch(law_state, i, block, 0.5 * K, -math.inf, upper, 0.0)

    walk = branch_follower(switch)
    law_parameters = law_table("linear")
    state = law_state_table(law_parameters)
    branch_following.set_branch(state, 0, 0, K, -math.inf, FY / K, 0.0)
    most = branch_following.MAX_BRANCHES
    for ends in (most, most + 1):
        tangent = walk(law_parameters, state, 0, 0, rows.SECOND_TRIAL, (ends + 0.5) * FY / K)
        expected = FY * (1.0 + 0.5 * (ends - 0.5)) if ends == most else math.nan
        force = state[rows.SECOND_TRIAL + rows.FORCE, 0]
        assert force == pytest.approx(expected, rel=1e-12, nan_ok=True)
        assert math.isnan(tangent) == (ends > most)


def event_of_one_story(d0, d3, w0, w1, sign, ignored=0.0):
    """Return the first change of branch of a story from its drifts, and the rates times the length
    of the step, at both ends."""
    h, linear_terms = 0.1, np.zeros((rows.LINEAR_TERM_ROWS, 2))
    law_state, state, scratch = (np.zeros((count, 2)) for count in (rows.LAW_STATE_ROWS, 3, 3))
    law_state[[rows.UPPER, rows.LOWER, rows.RATE_SIGN, rows.DRIFT], 0] = (
        math.inf,
        -math.inf,
        sign,
        d0,
    )
    state[rows.VELOCITY, 0], scratch[:, 0] = w0 / h, (d3, w1 / h, ignored)
    return first_event(linear_terms, h, (state, law_state, scratch, None), (0, 1, 2))


@pytest.mark.parametrize(
    ("d0", "d1", "expected"),
    [(1.0, 1.1, True), (1.1, 1.2, True), (0.9, 1.1, False), (1.0, 1.0, False), (1.0, 0.9, False)],
)
def test_a_cubic_that_starts_at_its_limit_exceeds_it_while_rising(d0, d1, expected):
    """Also if its later values, within rounding errors, do not show the rise."""
    assert bool(_exceeds_while_rising(d0, d1, d0, 0.8, 0.8, 1.0)) == expected


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_reversals_within_rounding_are_ignored(sign):
    """The tolerance is a fraction of the sum of both drifts, for the differences of the last three
    Bezier points."""
    tolerance = _REVERSAL_TOLERANCE * (1.0 + 1.5)
    for factor, expected in ((0.9, False), (1.1, True)):
        # The rate at the end, a third of which is the last difference
        found = event_of_one_story(
            sign, 1.5 * sign, 0.5 * sign, -3.0 * factor * tolerance * sign, sign
        )
        assert (found[0] < NONE) == expected
        # The difference of the two middle points; the other two differences are half a tolerance
        small = _REVERSAL_TOLERANCE * 2.0
        rate, change = 1.5 * small, (1.0 - factor) * small
        found = event_of_one_story(sign, sign * (1.0 + change), sign * rate, sign * rate, sign)
        assert (found[0] < NONE) == expected
    reversing = (0.0, 0.0, 0.5 * sign, -0.5 * sign, sign)
    assert event_of_one_story(*reversing)[0] == pytest.approx(0.5, rel=1e-9)
    assert event_of_one_story(*reversing, ignored=1.0) == (NONE, -1, rows.REVERSED)
    assert event_of_one_story(*reversing[:4], 0.0)[0] == NONE


@pytest.mark.parametrize("name", LAW_CASES)
def test_other_laws_may_have_more_parameters(name):
    """The table of a building has as many rows as its law with the most parameters needs. More
    coefficients of a polynomial are zero."""
    law_parameters = law_table(name, *LAW_CASES[name])
    more = np.vstack([law_parameters, np.full((4, 2), 0.0 if name == "polynomial" else np.nan)])
    expected, found = follow(law_parameters, 2.0 * CYCLE), follow(more, 2.0 * CYCLE)
    assert np.array_equal(expected[0], found[0])
    assert expected[1:] == found[1:]


def test_each_deterioration_of_imk_has_its_own_capacity():
    """The capacities of strength, capping, reloading and unloading act on different rows, so that
    five laws, one of them without deterioration, have five different forces."""
    paths = [np.linspace(a, b, 20)[1:] for a, b in ((0, 0.09), (0.09, -0.09), (-0.09, 0.12))]
    drifts = np.concatenate(paths)
    forces = []
    for finite in (None, 0, 1, 2, 3):
        capacities = [math.inf] * 4
        if finite is not None:
            capacities[finite] = 0.6
        values = (*IMK_SIDE, *IMK_SIDE, *capacities, 1.0, 0.4, 0.6)
        forces.append(follow(law_table("imk", *values), drifts)[0])
    for first, second in itertools.combinations(forces, 2):
        assert np.max(np.abs(first - second)) > 0.01 * FY


def test_gap_stiffens_with_any_stop():
    assert LAWS["gap"].stiffens([0.05, 1e-3])
    assert not LAWS["gap"].stiffens([0.05, 0.0])


@pytest.mark.parametrize(("name", "lowest"), [("bilinear", -1.0), ("peak-oriented", 0.0)])
def test_hardening_ratio_of_1_is_refused(name, lowest):
    """The branches of the law would have the same stiffness."""
    (hardening,) = (one for one in LAWS[name].parameters if one.name == "hardening")
    assert (hardening.low, hardening.high) == (lowest, 1.0)
    assert not hardening.high_allowed


def test_ultimate_drift_of_trilinear_pinching_is_beyond_yield_drift():
    fault = LAWS["trilinear-pinching"].fault
    others = (0.2, 0.4, 0.3)
    assert "beyond the yield drift" in fault(K, (FY, FY, FY / K, *others))
    assert fault(K, (FY, FY, 1.001 * FY / K, *others)) is None
    assert "at least yield_force" in fault(K, (FY, 0.999 * FY, 1.0, *others))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_least_unloading_stiffness_of_a_peak_oriented_story(side):
    """hardening / (1 - unloading / 2) of the stiffness k, if it is more than (dy / dmax)^unloading
    and than the slope of the line to the origin."""
    hardening, unloading = 0.2, 0.8
    peak = 100.0 * FY / K
    table = law_table("peak-oriented", FY, hardening, unloading)
    forces, _, _ = follow(table, side * np.array([peak, 0.99 * peak]))
    slope = (forces[0] - forces[1]) / (0.01 * side * peak)
    assert slope == pytest.approx(K * hardening / (1.0 - 0.5 * unloading), rel=1e-9)
