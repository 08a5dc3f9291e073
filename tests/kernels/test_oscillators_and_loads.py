"""Tests of oscillators, loads, internal forces and branch changes against their definitions, which
are computed independently here. None of these tests needs compiled loops."""

import itertools
import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from exact_oscillators import transition
from step_checks import RAYLEIGH, building, matrices
from tdint.kernels import layout as rows
from tdint.kernels.linear_terms import force_value, internal_forces
from tdint.kernels.oscillators import bilinear, elastic, extremes
from tdint.kernels.oscillators.between_steps import (
    A11,
    B10,
    TERMS,
    Vibration,
    largest_between,
    term_count,
)
from tdint.kernels.peaks_between_steps import add_floor_forces
from tdint.kernels.stepping import Span
from tdint.kernels.stories.branches import NONE, first_event
from tdint.kernels.time_loop.ground import (
    fitted_line,
    fitted_line_between_samples,
    ground_at,
    ground_between,
)
from tdint.model.building import assemble, force_table
from tdint.model.definition import Force

GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(3)


def impulse_and_moment(ground: np.ndarray, begin: float, end: float) -> tuple[float, float]:
    """Integrals of the ground acceleration and of its product with the time from mid-step; the
    record is linear between samples and zero after the last sample."""
    times = np.unique([begin, *range(math.ceil(begin), math.ceil(end)), end])
    impulse = moment = 0.0
    for left, right in itertools.pairwise(times):
        t = 0.5 * (left + right) + 0.5 * (right - left) * GAUSS
        values = np.interp(t, np.arange(ground.size + 1), [*ground, 0.0], right=0.0)
        impulse += 0.5 * (right - left) * float(WEIGHTS @ values)
        moment += 0.5 * (right - left) * float(WEIGHTS @ (values * (t - 0.5 * (begin + end))))
    return impulse, moment


@pytest.mark.parametrize(
    ("begin", "end"), [(0, 1), (2, 5), (0.3, 0.8), (1.25, 4.5), (5.5, 8.0), (6, 9), (7.2, 9.1)]
)
def test_line_over_step_has_impulse_and_moment_of_ground_motion(begin, end):
    ground = np.random.default_rng(65).normal(size=8)
    expected = impulse_and_moment(ground, begin, end)
    lines = [fitted_line(ground, float(begin), float(end))]
    if isinstance(begin, int):
        lines.append(fitted_line_between_samples(ground, begin, end))
    for first, last in lines:
        duration = end - begin
        found = 0.5 * duration * (first + last), duration**2 * (last - first) / 12.0
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(("per_sample", "stride"), [(1, 1), (1, 3), (4, 1), (2, 3)])
def test_ground_acceleration_is_interpolated_between_samples(per_sample, stride):
    ground = np.random.default_rng(66).normal(size=8)
    for step in range(40):
        position = step * stride / per_sample
        expected = np.interp(position, np.arange(9), [*ground, 0.0], right=0.0)
        assert ground_at(ground, step, per_sample, stride) == pytest.approx(expected, abs=1e-14)
        assert ground_between(ground, position) == pytest.approx(expected, abs=1e-14)


def test_internal_forces_agree_with_dense_matrices():
    """C v + K u with the matrices of `matrices`, which include P-delta, a dashpot and Rayleigh
    damping; the story forces balance the internal forces of the floors above."""
    damped_model = building(RAYLEIGH)
    _, damping, stiffness = matrices(damped_model)
    assembled = assemble(damped_model)
    random = np.random.default_rng(67)
    u, v = 0.01 * random.normal(size=4), random.normal(size=4)
    drift = np.diff(u, prepend=0.0)
    law_state, scratch = np.zeros((rows.LAW_STATE_ROWS, 5)), np.zeros((3, 5))
    law_state[rows.DRIFT, :4] = drift
    law_state[rows.FORCE, :4] = drift * [story.stiffness for story in damped_model.stories]
    scratch[0, :4] = v
    internal_forces(assembled.linear_terms, assembled.modal, law_state, 0, scratch, 0, 1, 2)
    expected = damping @ v + stiffness @ u
    assert scratch[1, :4] == pytest.approx(expected, rel=1e-12)
    to_ground = RAYLEIGH.mass * np.array([story.mass for story in damped_model.stories]) * v
    above = np.cumsum((expected - to_ground)[::-1])[::-1]
    assert scratch[2, :4] == pytest.approx(above, rel=1e-10)


def test_floor_forces_are_interpolated_at_ends_and_quarters_of_step():
    """The sums over floors 2 and 3 of A0 + (A1 - A0) s + s (1 - s) (B + D (1 - 2 s))."""
    forces = [Force(2, 3.0, -2.0, 9.0), Force(3, 1.0, 4.0, 31.0), Force(3, -5.0, 0.5, 2.0)]
    table = force_table(forces)
    t, h = 0.7, 0.05
    span = Span(t, h, 0.0, 0.0, False, False, False, False)
    # No floor is above: the sums of the first call are ignored.
    above, below = add_floor_forces(span, table, 0.0, 2, (7.0, 7.0, 7.0, 7.0), len(forces))
    for link, count in ((1.0, 3), (0.0, 1)):
        (a0, a1, bulge, tilt), _ = add_floor_forces(span, table, link, 1, above, below)
        for s in (0.0, 0.25, 0.75, 1.0):
            time = t - h + s * h
            expected = sum(
                force.cosine * math.cos(force.omega * time)
                + force.sine * math.sin(force.omega * time)
                for force in forces[:count]
            )
            found = a0 + (a1 - a0) * s + s * (1.0 - s) * (bulge + tilt * (1.0 - 2.0 * s))
            assert found == pytest.approx(expected, rel=1e-12)
            single = force_value(table, 0, time)
            assert count == 3 or single == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("event", [rows.ABOVE, rows.BELOW, rows.REVERSED])
@pytest.mark.parametrize("links", [(0.0, 1.0, 1.0), (0.0, 1.0, 0.0)])
def test_first_branch_change_agrees_with_roots_of_cubic_drifts(event, links):
    """Roots of the polynomials of the drifts between floors that move on Hermite cubics."""
    random = np.random.default_rng(68)
    h, n, found_any = 0.1, 3, 0
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, n + 1))
    linear_terms[rows.LINK, :n] = links
    for _ in range(200):
        u0, u1, (v0, v1) = random.normal(size=n), random.normal(size=n), random.normal(size=(2, n))
        v0, v1 = 40.0 * v0, 40.0 * v1
        floors = [
            Polynomial([a, h * b, 3.0 * (c - a) - h * (2.0 * b + d), 2.0 * (a - c) + h * (b + d)])
            for a, b, c, d in zip(u0, v0, u1, v1, strict=True)
        ]
        law_state = np.zeros((rows.LAW_STATE_ROWS, n + 1))
        law_state[rows.UPPER], law_state[rows.LOWER] = math.inf, -math.inf
        state, scratch = np.zeros((3, n + 1)), np.zeros((3, n + 1))
        state[rows.VELOCITY, :n], scratch[0, :n], scratch[1, :n] = v0, u1, v1
        expected = (NONE, -1)
        for i in range(n):
            drift = floors[i] - (links[i] * floors[i - 1] if i else 0.0)
            law_state[rows.DRIFT, i] = drift(0.0)
            room = random.uniform(0.2, 1.5)
            if event == rows.ABOVE:
                law_state[rows.UPPER, i] = drift(0.0) + room
                crossed = drift - drift(0.0) - room
            elif event == rows.BELOW:
                law_state[rows.LOWER, i] = drift(0.0) - room
                crossed = drift - drift(0.0) + room
            else:
                law_state[rows.RATE_SIGN, i] = math.copysign(1.0, drift.deriv()(0.0))
                crossed = drift.deriv()
            roots = crossed.roots()
            real = roots[np.abs(roots.imag) < 1e-9].real
            inside = np.append(real[(real > 0.0) & (real < 1.0)], NONE)
            expected = min(expected, (float(np.min(inside)), i))
        memory = state, law_state, scratch, None
        first, story, how = first_event(linear_terms, h, memory, (0, 1, 2))
        if expected[0] == NONE:
            assert first == NONE and story == -1
            continue
        found_any += 1
        assert first == pytest.approx(expected[0], abs=1e-7)
        assert (story, how) == (expected[1], event)
    assert found_any > 100


@pytest.mark.parametrize("angle", [0.05, 0.4, 1.0])
@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("from_rest", [False, True])
def test_maximum_of_oscillator_within_step(angle, ratio, from_rest):
    """A damped sine plus a straight line, with the zeros of its rate by bisection."""
    h = 0.02
    omega = angle / h
    damped = omega * math.sqrt(1.0 - ratio**2)
    decay = -ratio * omega
    random = np.random.default_rng(69)
    passed = 0
    for _ in range(100):
        root = complex(decay, damped)
        # The second derivative is zero within the step.
        inflection = random.uniform(0.02, 0.98) * h
        phase = 0.5 * math.pi - 2.0 * math.atan2(damped, decay) - damped * inflection
        factor = complex(math.cos(phase), math.sin(phase))

        def derivative(t, order, root=root, factor=factor):
            return (factor * root**order * np.exp(root * np.asarray(t))).real

        # A zero of the rate within the step, or at its start
        slope = -float(derivative(0.0 if from_rest else random.uniform(0.0, h), 1))
        offset = random.normal()

        def rate(t, slope=slope, derivative=derivative):
            return derivative(t, 1) + slope

        times = np.linspace(0.0, h, 2001)
        rates = rate(times)
        if from_rest:
            rates[0], times = 0.0, times[1:]
            signs = rates[1:]
        else:
            signs = rates
        zeros = [
            brentq(rate, times[k], times[k + 1], xtol=1e-16)
            for k in np.flatnonzero(signs[:-1] * signs[1:] < 0.0)
        ]
        if from_rest and len(zeros) != 1:  # not a step that `may_exceed` selects
            continue
        expected = max((abs(derivative(t, 0) + slope * t + offset) for t in zeros), default=0.0)
        vibration = Vibration(omega**2, -2.0 * decay, h)
        start = 0.0 if from_rest else float(rates[0])
        found = largest_between(
            float(derivative(0.0, 0)) + offset,
            (start, float(derivative(0.0, 2)), float(derivative(0.0, 3))),
            float(rates[-1]),
            vibration,
            term_count(vibration),
            np.zeros((3, TERMS)),
        )
        assert float(found) == pytest.approx(expected, rel=2e-9, abs=2e-9)
        passed += expected > 0.0
    assert passed > 30


def bilinear_reference(ground, dt, omega, xi, hardening, limit, counted):
    """Peak displacement and displacement at rest, by DOP853 from one change of branch to the
    next. z is the part of the force over the mass that yields at +-(1 - hardening) omega^2 limit.
    Peaks count in the first `counted` sampling intervals, then the oscillator comes to rest.
    """
    k, strength = omega**2, (1.0 - hardening) * omega**2 * limit
    u, v, z, side, peak, events = 0.0, 0.0, 0.0, 0.0, 0.0, 0
    # The oscillator comes to rest in 40 periods without ground motion.
    pieces = [(dt, a, (b - a) / dt) for a, b in itertools.pairwise(ground)]
    pieces += [(2.0 * math.pi / omega, 0.0, 0.0)] * 40
    for index, (length, a, slope) in enumerate(pieces):
        t = 0.0
        while t < length:
            start, held = u, z

            def rates(t, y, side=side, start=start, held=held, a=a, slope=slope):
                more = held if side else held + (1.0 - hardening) * k * (y[0] - start)
                return y[1], -(a + slope * t) - 2.0 * xi * omega * y[1] - hardening * k * y[
                    0
                ] - more

            def turn(t, y):
                return y[1]

            def above(t, y, start=start, held=held):
                return held + (1.0 - hardening) * k * (y[0] - start) - strength

            def below(t, y, start=start, held=held):
                return held + (1.0 - hardening) * k * (y[0] - start) + strength

            above.direction, below.direction = 1.0, -1.0
            above.terminal = below.terminal = True
            turn.terminal, turn.direction = bool(side), -side
            done = solve_ivp(
                rates,
                (t, length),
                (u, v),
                "DOP853",
                events=(turn,) if side else (turn, above, below),
                rtol=1e-11,
                atol=1e-14,
            )
            if index < counted:
                peak = max([peak, abs(done.y[0, -1]), *(abs(y[0]) for y in done.y_events[0])])
            t, (u, v) = done.t[-1], done.y[:, -1]
            if not side:
                z = held + (1.0 - hardening) * k * (u - start)
            if done.status == 1:
                events += 1
                side = 0.0 if side else math.copysign(1.0, v)
                z = math.copysign(strength, z)
    return peak, u - (hardening * k * u + z) / k, events


@pytest.mark.parametrize("at_right", [1.0, -1.0])
def test_level_reached_at_start_is_found(at_right):
    """The displacement u = at_right t crosses 0 at t = 0, and any other level at its quotient."""
    series = np.array([0.0, at_right, 0.0, 0.0])
    assert bilinear._root(series, 4, 0, 0.0, 0.0, 0.5) == 0.0
    assert bilinear._root(series, 4, 0, 0.3 * at_right, 0.0, 0.5) == pytest.approx(0.3, rel=1e-15)


@pytest.mark.parametrize(
    ("omega", "xi", "hardening", "limit"),
    [(9.0, 0.05, 0.0, 0.002), (9.0, 0.02, 0.2, 0.003), (70.0, 0.05, 0.05, 1e-4)],
)
def test_bilinear_oscillator_agrees_with_dop853(omega, xi, hardening, limit):
    dt = 0.05
    ground = np.random.default_rng(70).normal(size=40)
    results = np.zeros(bilinear.RESULTS)
    count = bilinear.bilinear_response.compiled(ground, dt, omega, xi, hardening, limit, results)
    arguments = dt, omega, xi, hardening, limit
    peak, residual, events = bilinear_reference(ground, *arguments, counted=39)
    # The ground acceleration decreases to zero in one interval, and the free vibration counts. If
    # it does not exceed the peak of the record, the oscillator comes to rest from the last sample.
    later_peak, later_residual, later_events = bilinear_reference(
        np.append(ground, 0.0), *arguments, counted=80
    )
    if later_peak > peak:
        peak, residual, events = later_peak, later_residual, later_events
    assert 5 < count <= events
    assert results[bilinear.LARGEST] == pytest.approx(peak, rel=1e-8)
    assert results[bilinear.RESIDUAL] == pytest.approx(residual, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("components", [1, 2])
def test_extremes_of_oscillators_agree_with_fine_steps(components):
    """Local maxima of the pseudo-acceleration, or of its radius in the plane, above a level agree
    with 50 exact steps per step."""
    dt, parts, fine = 0.02, np.array([8.0, 4.0]), 50
    samples = np.random.default_rng(71).normal(size=(components, 60))
    by_u, by_v = np.array([40.0, 11.0]) ** 2, 2.0 * np.array([0.05, 0.2]) * [40.0, 11.0]
    oscillators = np.zeros((elastic.COEFFICIENTS, 2))
    oscillators[elastic.BY_DISPLACEMENT], oscillators[elastic.BY_VELOCITY] = by_u, by_v
    level, expected = np.zeros(2), []
    for i in range(2):
        a, b = transition(by_u[i], by_v[i], dt / parts[i])
        for k in range(2):
            oscillators[[A11 + 4 * k, A11 + 4 * k + 1], i] = a[k]
            oscillators[[B10 + 4 * k, B10 + 4 * k + 1], i] = b[k]
        count = int(parts[i]) * fine
        a, b = transition(by_u[i], by_v[i], dt / count)
        times = np.arange(59 * count + 1) * dt / count
        ground = np.array([np.interp(times, dt * np.arange(60), entry) for entry in samples])
        state, motion = np.zeros((2, components)), [np.zeros(components)]
        for k in range(times.size - 1):
            state = a @ state - b @ ground[:, k : k + 2].T
            motion.append(state[0])
        size = by_u[i] * np.linalg.norm(motion, axis=1)
        level[i] = 0.3 * np.max(size)
        for k in range(1, size.size - 1):
            if size[k - 1] < size[k] >= size[k + 1] and size[k] > level[i]:
                expected.append((i, times[k], size[k]))
    capacity = 200
    stored, largest = np.zeros((2 + components, capacity)), np.zeros((2, 2))
    kernel = extremes.extremes if components == 1 else extremes.radii
    kernel_input = samples[0] if components == 1 else samples
    count = kernel.compiled(kernel_input, dt, parts, oscillators, level, stored, largest)
    found = [
        (
            stored[extremes.OSCILLATOR, k],
            stored[extremes.TIME, k],
            math.hypot(*stored[extremes.VALUE :, k]),
        )
        for k in range(count)
    ]
    assert count == len(expected) > 10
    owners, times, sizes = np.transpose(found)
    assert owners.tolist() == [entry[0] for entry in expected]
    # The time of the maximum radius is interpolated linearly in steps of up to dt / 4.
    close = dt / 200.0 if components == 1 else dt / 25.0
    assert times == pytest.approx([entry[1] for entry in expected], abs=close)
    assert sizes == pytest.approx([entry[2] for entry in expected], rel=1e-4)
    for i in range(2):
        assert largest[0, i] == pytest.approx(np.max(sizes[owners == i]), rel=1e-14)
        assert sizes[int(largest[1, i])] == pytest.approx(largest[0, i], rel=1e-14)
