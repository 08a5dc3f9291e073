"""Peaks between the ends of a step: error of the quintic interpolation, and completeness of the
restricted search."""

import math

import numpy as np
import pytest

from selection import every
from tdint.kernels import layout as rows
from tdint.kernels.peaks_between_steps import find_interstep_peaks
from tdint.kernels.step_interpolant import cubic_extremum
from tdint.kernels.stepping import Located, Memory, Passage, Scene, Seen, Span
from tdint.kernels.time_loop.observer import _update_peaks, observe, observe_within_step
from tdint.model.building import force_table
from tdint.model.definition import Force

STORIES = 4
K = 50.0


def scene(seed):
    """Return arguments of `find_interstep_peaks`: random motion of several floors over a step, with
    peaks close to the values at its ends."""
    generator = np.random.default_rng(seed)
    h = 10.0 ** generator.uniform(-3.0, 0.0)
    scale = np.array([[1.0], [1.0 / h], [1.0 / h**2]]) * 10.0 ** generator.uniform(
        -1.0, 1.0, (3, 1)
    )
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, STORIES + 1))
    linear_terms[rows.LINK, 1:STORIES] = 1.0
    linear_terms[rows.MASS, :STORIES] = np.linspace(1.0, 2.0, STORIES)
    linear_terms[rows.INVERSE_MASS, :STORIES] = 1.0 / linear_terms[rows.MASS, :STORIES]
    linear_terms[rows.DASHPOT, :STORIES] = 1.0  # the drift rates of stories with a dashpot count
    law_parameters = np.zeros((3, STORIES + 1))
    law_parameters[rows.STIFFNESS, :STORIES] = K
    old, state, law_state = (
        np.zeros((5, STORIES + 1)),
        np.zeros((3, STORIES + 1)),
        np.zeros((rows.LAW_STATE_ROWS, STORIES + 1)),
    )
    old[:3, :STORIES] = scale * generator.normal(size=(3, STORIES))
    old[3:, :STORIES] = scale[1:] * generator.normal(size=(2, STORIES))
    state[:, :STORIES] = scale * generator.normal(size=(3, STORIES))
    if (
        seed % 2
        # displacements that agree with velocities and accelerations, because otherwise no value
        # between the ends follows
    ):
        rise = 0.5 * h * (old[1] + state[rows.VELOCITY]) - h**2 / 12.0 * (
            state[rows.ACCELERATION] - old[2]
        )
        state[rows.DISPLACEMENT] = old[0] + rise
    law_state[rows.DRIFT, :STORIES] = np.diff(state[rows.DISPLACEMENT, :STORIES], prepend=0.0)
    law_state[rows.FORCE, :STORIES] = (
        K * generator.uniform(-1.0, 1.0, STORIES) * law_state[rows.DRIFT, :STORIES]
    )
    ground = scale[2, 0] * generator.normal(size=2)
    ends = np.zeros((rows.PEAK_ROWS, STORIES))
    ends[rows.PEAK_DRIFT] = abs(law_state[rows.DRIFT, :STORIES])
    ends[rows.PEAK_SHEAR] = abs(law_state[rows.FORCE, :STORIES])
    ends[rows.PEAK_DISPLACEMENT] = np.maximum(abs(state[rows.DISPLACEMENT]), abs(old[0]))[:STORIES]
    ends[rows.PEAK_VELOCITY] = np.maximum(abs(state[rows.VELOCITY]), abs(old[1]))[:STORIES]
    ends[rows.PEAK_ACCELERATION] = np.maximum(
        abs(state[rows.ACCELERATION] + ground[1]), abs(old[2] + ground[0])
    )[:STORIES]
    for a, rate, ground_acceleration in (
        (old[2], old[1], ground[0]),
        (state[rows.ACCELERATION], state[rows.VELOCITY], ground[1]),
    ):
        moved = np.cumsum((linear_terms[rows.MASS] * (a + ground_acceleration))[:STORIES][::-1])[
            ::-1
        ]
        ends[rows.PEAK_TOTAL_SHEAR] = np.maximum(ends[rows.PEAK_TOTAL_SHEAR], abs(moved))
        rates = abs(np.diff(rate[:STORIES], prepend=0.0))
        ends[rows.PEAK_DRIFT_RATE] = np.maximum(ends[rows.PEAK_DRIFT_RATE], rates)
    peaks = np.vstack([ends * generator.uniform(1.0, 1.5, ends.shape), np.zeros_like(ends)])
    on_path, fast = (
        bool(ground_acceleration) for ground_acceleration in generator.integers(0, 2, 2)
    )
    return arguments(
        Span(0.0, h, *ground, on_path, fast, False, False),
        linear_terms,
        law_parameters,
        old,
        state,
        law_state,
        peaks,
    )


def arguments(span, linear_terms, law_parameters, old, state, law_state, peaks):
    """Arguments of `find_interstep_peaks` of a linear building."""
    no_rows = np.zeros((0, linear_terms.shape[1]))
    flags = np.zeros(rows.FLAGS_SIZE)
    flags[rows.HAS_DASHPOTS] = flags[rows.LINEAR] = 1.0
    building = Scene(
        linear_terms, no_rows, law_parameters, np.zeros((0, rows.FORCE_COLUMNS)), flags
    )
    return [
        span,
        building,
        Passage(old, 0, state, state, rows.ACCELERATION),
        law_state,
        Located(np.zeros((rows.LOCATED_ROWS, linear_terms.shape[1])), 0, peaks, 0),
    ]


def observed(seed, everything):
    """Return the peaks after and before the observation of a step of `scene`, whose story forces
    are in equilibrium, and the number of reversals.

    One quantity is close to its recorded peak; in a third of the scenes, its values at the ends
    exceed it. With `everything`, the complete search is made in any case.
    """
    span, building, passage, law_state, (*_, peaks, _) = scene(seed)
    absolute = passage.state[rows.ACCELERATION, :STORIES] + span.ground_1
    law_state[rows.FORCE, :STORIES] = -np.cumsum(
        (building.linear_terms[rows.MASS, :STORIES] * absolute)[::-1]
    )[::-1]
    factors = np.random.default_rng(seed).uniform(1.0, 1.5, STORIES)
    peaks[rows.PEAK_SHEAR] = factors * abs(law_state[rows.FORCE, :STORIES])
    # the peaks of these rows are far above the values
    others = np.arange(rows.PEAK_ROWS) != seed % rows.PEAK_ROWS
    peaks[: rows.PEAK_ROWS][others] *= 100.0
    peaks *= 0.8 if seed % 3 == 0 else 1.0
    observer_state = np.zeros((rows.OBSERVER_ROWS, STORIES + 1))
    observer_state[rows.U_PREVIOUS : rows.A_EARLIER + 1] = passage.old
    memory = Memory(passage.state, law_state, np.zeros((0, 0)), np.zeros(rows.STEP_STATUS_SIZE))
    seen = Seen(
        observer_state, peaks, np.zeros((3, STORIES)), np.zeros(rows.TOTALS_SIZE), np.zeros((0, 0))
    )
    before = peaks.copy()
    passing = observe(building, span, 0.0, memory, seen)
    if everything:
        _update_peaks(span.ground_1, passage.state, law_state, seen)
    turned = []

    def update_located_peaks(*arguments):
        turned.extend(observer_state[rows.LOCATED + rows.REVERSAL_DRIFT])
        return 0

    observe_within_step(update_located_peaks, passing or everything, building, span, memory, seen)
    return peaks, before, turned


def test_quick_search_finds_all_peaks_of_full_search():
    passed = []
    for seed in range(300):
        quick, before, turned = observed(seed, False)
        close, _, all_turned = observed(seed, True)
        assert np.array_equal(quick[: rows.PEAK_ROWS], close[: rows.PEAK_ROWS]), f"seed {seed}"
        # The complete search also finds possible peaks that are below the recorded ones.
        bounds, all_bounds = (
            np.maximum(peaks[: rows.PEAK_ROWS], peaks[rows.PEAK_ROWS :]) for peaks in (quick, close)
        )
        assert np.array_equal(bounds, all_bounds), f"seed {seed}"
        assert turned == all_turned, f"seed {seed}"
        passed.append(np.any(quick > before))
    assert any(passed) and not all(passed)


def test_test_motions_raise_every_peak():
    raised = np.zeros(2 * rows.PEAK_ROWS, dtype=bool)
    for seed in range(300):
        before, after = scene(seed), scene(seed)
        find_interstep_peaks(*after)
        raised |= np.any(after[-1].peaks > before[-1].peaks, axis=1)
    # The laws raise the peak shear, and dampers with a brace their peak force.
    others = (rows.PEAK_SHEAR, rows.PEAK_BRACE_FORCE)
    story_rows = [row for row in range(2 * rows.PEAK_ROWS) if row % rows.PEAK_ROWS not in others]
    assert raised[story_rows].all()


def errors(h):
    """Return the missed parts of the peaks of sin(omega t) and its derivatives, relative to the
    peaks, for steps of h around the peaks."""
    omega = 2.0
    missed = np.zeros(3)
    # The ground moves against the floor so that the absolute acceleration is -omega^2 sin(omega t)
    # - 1.
    for middle, quantity in ((0.5 * math.pi, 0), (math.pi, 1), (0.5 * math.pi, 2)):
        for part in (0.3, 0.5, 0.6):
            start = middle / omega - part * h
            times = omega * np.array([start, start + h])
            u, v, a = np.sin(times), omega * np.cos(times), -(omega**2) * np.sin(times)
            linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, 2))
            law_parameters = np.array([[0.0, 0.0], [K, K], [0.0, 0.0]])  # linear stories
            law_state = np.zeros((rows.LAW_STATE_ROWS, 2))
            law_state[rows.DRIFT, 0] = u[1]
            old, state = np.zeros((5, 2)), np.zeros((3, 2))
            old[:3, 0], state[:, 0] = (u[0], v[0], a[0]), (u[1], v[1], a[1])
            ends = [max(abs(u)), 0.0, max(abs(u)), max(abs(v)), max(abs(a - 1.0))]
            peaks = np.array([[*ends, 0.0, 0.0, 0.0, 0.0, 0.0]]).T
            span = Span(0.0, h, -1.0, -1.0, False, False, False, False)
            find_interstep_peaks(
                *arguments(span, linear_terms, law_parameters, old, state, law_state, peaks)
            )
            found = peaks[
                (rows.PEAK_DISPLACEMENT, rows.PEAK_VELOCITY, rows.PEAK_ACCELERATION)[quantity], 0
            ]
            exact = (1.0, omega, omega**2 + 1.0)[quantity]
            missed[quantity] = max(missed[quantity], abs(found / exact - 1.0))
    return missed


def test_peaks_have_order_of_quintic():
    """The error is of order h^6 for u, at least h^5 for u' and h^4 for u''."""
    large, small = errors(0.4), errors(0.2)
    assert np.all(np.log2(large / small) >= [5.8, 4.8, 3.8])
    assert large[2] <= (2.0 * 0.4) ** 4 / 1900.0


@pytest.mark.parametrize("seed", range(12))
def test_largest_extremum_of_cubic(seed):
    p = np.random.default_rng(seed).normal(size=4)
    if seed % 4 == 0:
        p[3] = 0.0
    s = np.linspace(0.0, 1.0, 100001)
    values = np.polyval(p[::-1], s)
    inside = values[1:-1][np.diff(np.sign(np.diff(values))) != 0]
    expected = max([p[0], *inside], key=abs)
    value, location = cubic_extremum(*p)
    assert value == pytest.approx(expected, abs=1e-8)
    assert np.polyval(p[::-1], location) == pytest.approx(expected, abs=1e-8)


def test_extremum_of_a_parabola_and_of_a_constant():
    """A parabola with p1 / (2 p2) = -1/4, whose other zero of the derivative is infinite."""
    for factor in (1.0, -3.0):
        value, location = cubic_extremum(0.0, 0.25 * factor, -0.5 * factor, 0.0)
        assert (value, location) == (0.03125 * factor, 0.25)
    assert cubic_extremum(0.7, 0.0, 0.0, 0.0) == (0.7, 0.0)
    assert cubic_extremum(0.0, 0.0, 0.0, 0.0) == (0.0, 0.0)


QUANTITIES = (
    rows.PEAK_DRIFT, rows.PEAK_DISPLACEMENT, rows.PEAK_VELOCITY, rows.PEAK_DRIFT_RATE,
    rows.PEAK_ACCELERATION, rows.PEAK_TOTAL_SHEAR,
)  # fmt: skip


def peaks_of_one_floor(h, start, end, recorded):
    """Return the recorded and possible peaks of one floor of 1 kg after a step.

    Parameters
    ----------
    h : float
        Length of the step, s.
    start, end : tuple of float
        Displacement, velocity and acceleration at the endpoints.
    recorded : dict of int to float
        Peaks before the step by row. The peaks of other rows are so large that they cause no
        search.
    """
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, 2))
    linear_terms[rows.MASS, 0] = linear_terms[rows.INVERSE_MASS, 0] = 1.0
    linear_terms[rows.DASHPOT, 0] = 1.0
    law_state = np.zeros((rows.LAW_STATE_ROWS, 2))
    law_state[rows.DRIFT, 0], law_state[rows.FORCE, 0] = end[0], -end[2]
    old, state = np.zeros((5, 2)), np.zeros((3, 2))
    old[:3, 0], state[:, 0] = start, end
    peaks = np.full((2 * rows.PEAK_ROWS, 1), 1e300)
    peaks[rows.PEAK_ROWS :] = 0.0
    for row, value in recorded.items():
        peaks[row, 0] = value
    span, building, _, law_state, _ = arguments(
        Span(h, h, 0.0, 0.0, False, False, False, False),
        linear_terms,
        np.array([[0.0, 0.0], [K, K], [0.0, 0.0]]),  # linear stories
        old,
        state,
        law_state,
        peaks,
    )
    observer_state = np.zeros((rows.OBSERVER_ROWS, 2))
    observer_state[rows.U_PREVIOUS : rows.A_EARLIER + 1] = old
    memory = Memory(state, law_state, np.zeros((0, 0)), np.zeros(rows.STEP_STATUS_SIZE))
    seen = Seen(
        observer_state, peaks, np.zeros((3, 1)), np.zeros(rows.TOTALS_SIZE), np.zeros((0, 0))
    )
    may_exceed = observe(building, span, 0.0, memory, seen)
    observe_within_step(lambda *_: 0, may_exceed, building, span, memory, seen)
    return peaks[:, 0]


def test_quintic_exceeding_parabola_is_searched():
    """With h = 1, u = 0, v = +-0.1 and a = 20 and -20.3, the quintic reaches 0.20. A parabola with
    these velocities does not exceed 0.10."""
    start, end = (0.0, 0.1, 20.0), (0.0, -0.1, -20.3)
    s = np.linspace(0.0, 1.0, 100_001)
    c3 = np.linalg.solve(
        [[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]], [-10.1, -20.2, -40.3]
    )
    quintic = s * (0.1 + s * (10.0 + s * (c3[0] + s * (c3[1] + s * c3[2]))))
    largest = np.max(quintic)
    assert largest == pytest.approx(0.2, abs=0.01)
    for row in (rows.PEAK_DRIFT, rows.PEAK_DISPLACEMENT):
        found = peaks_of_one_floor(1.0, start, end, {row: 0.15})
        assert found[row] == pytest.approx(largest, rel=1e-9)


@pytest.mark.parametrize("row", every(3, QUANTITIES))
def test_recorded_peak_just_below_extremum_is_raised(row):
    """The same extremum is found from a peak just below it as from the values at the ends."""
    possible = row + rows.PEAK_ROWS
    rng = np.random.default_rng(row)
    raised = 0
    for _ in range(1500):
        h = 10.0 ** rng.uniform(-3.0, 0.0)
        v0, v1 = rng.uniform(0.0, 1.0), -rng.uniform(0.0, 1.0)
        mean = (v1 - v0) / h * rng.uniform(0.6, 1.4)
        half = abs(mean) * 10.0 ** rng.uniform(-1.0, 2.0) * rng.choice([-1.0, 1.0])
        u1 = h * rng.normal() * 10.0 ** rng.uniform(-2.0, 0.0)
        start, end = (0.0, v0, mean - half), (u1, v1, mean + half)
        values = {
            rows.PEAK_DRIFT: abs(u1),
            rows.PEAK_DISPLACEMENT: abs(u1),
            rows.PEAK_VELOCITY: max(v0, -v1),
            rows.PEAK_DRIFT_RATE: max(v0, -v1),
        }
        at_ends = values.get(row, max(abs(start[2]), abs(end[2])))
        first = peaks_of_one_floor(h, start, end, {row: at_ends})
        for found in (row, possible):
            if first[found] > at_ends * (1.0 + 1e-9):
                below = at_ends + 0.999 * (first[found] - at_ends)
                again = peaks_of_one_floor(h, start, end, {row: below})
                assert again[found] == pytest.approx(first[found], rel=1e-12)
                raised += 1
    assert raised > 10


@pytest.mark.parametrize("count", [0, 1, 2])
def test_each_step_with_forces_on_floors_is_searched(count):
    """Peaks are far. The forces within the step are not known to the bounds."""
    span, building, passage, law_state, (*_, peaks, _) = scene(1)
    forces = force_table([Force(2, 1e-9, 0.0, 3.0)] * count)
    observer_state = np.zeros((rows.OBSERVER_ROWS, STORIES + 1))
    observer_state[rows.U_PREVIOUS : rows.A_EARLIER + 1] = passage.old
    memory = Memory(passage.state, law_state, np.zeros((0, 0)), np.zeros(rows.STEP_STATUS_SIZE))
    seen = Seen(
        observer_state,
        1e9 * peaks,
        np.zeros((3, STORIES)),
        np.zeros(rows.TOTALS_SIZE),
        np.zeros((0, 0)),
    )
    seen.peaks[rows.PEAK_SHEAR] = 1e300
    building = building._replace(forces=forces)
    assert bool(observe(building, span, 0.0, memory, seen)) == (count > 0)


@pytest.mark.parametrize("scale", [1.0, 100.0, 0.01])
def test_total_shear_near_the_rest_of_a_dashpot(scale):
    """One story with constant drift acceleration comes to rest within the step. The rest of the
    total shear is the parabola for which Simpson's rule gives the change of velocity; the maximum
    of the sum is inside the step, before the rest, and the line between its ends has none."""
    coefficient, exponent, threshold = 2.0 * scale, 0.35, 1e-3
    v0, v1 = 0.1, -0.03

    def dashpot(s):
        rate = v0 + (v1 - v0) * s
        return coefficient * rate * (rate * rate + threshold**2) ** (0.5 * (exponent - 1.0))

    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, 2))
    linear_terms[rows.MASS, 0] = linear_terms[rows.INVERSE_MASS, 0] = 1.0
    linear_terms[rows.POWER_DAMPER, 0] = coefficient
    linear_terms[rows.POWER, 0] = 0.5 * (exponent - 1.0)
    linear_terms[rows.THRESHOLD, 0] = threshold**2
    old, state, law_state = np.zeros((5, 2)), np.zeros((3, 2)), np.zeros((rows.LAW_STATE_ROWS, 2))
    old[1, 0], state[rows.VELOCITY, 0] = v0, v1
    old[2, 0] = state[rows.ACCELERATION, 0] = v1 - v0
    smooth_0, smooth_1 = (
        3.0 * scale,
        4.5 * scale,
    )  # N; the ground acceleration gives the total shear at both ends
    shear_0, shear_1 = smooth_0 + dashpot(0.0), smooth_1 + dashpot(1.0)
    span = Span(1.0, 1.0, v0 - v1 - shear_0, v0 - v1 - shear_1, False, False, False, False)
    peaks = np.zeros((2 * rows.PEAK_ROWS, 1))
    search = arguments(span, linear_terms, np.ones((3, 2)), old, state, law_state, peaks)
    search[1].flags[rows.MEAN_WEIGHT], search[1].flags[rows.MEAN_DISTANCE] = 1.0 / 6.0, 0.5
    find_interstep_peaks(*search)
    s = np.linspace(0.0, 1.0, 100001)
    bulge = 2.0 * (dashpot(0.0) + dashpot(1.0)) - 4.0 * dashpot(0.5)
    shears = smooth_0 + (smooth_1 - smooth_0) * s + bulge * s * (1.0 - s) + dashpot(s)
    assert shears.max() > 1.01 * max(shear_0, shear_1)
    assert peaks[rows.PEAK_TOTAL_SHEAR, 0] == pytest.approx(shears.max(), rel=1e-4)
    assert peaks[rows.PEAK_ACCELERATION, 0] == pytest.approx(shears.max(), rel=1e-4)
    # A recorded peak just below it does not prevent the search.
    found = peaks[rows.PEAK_TOTAL_SHEAR, 0]
    peaks[: rows.PEAK_ROWS] = (1.0 - 1e-6) * found
    find_interstep_peaks(*search)
    assert peaks[rows.PEAK_TOTAL_SHEAR, 0] == found
