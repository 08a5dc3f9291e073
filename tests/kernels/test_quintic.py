"""Parts of the search for peaks between steps, compared with polynomials of SciPy and NumPy."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BPoly

from tdint.kernels import layout as rows
from tdint.kernels import peaks_between_steps as peaks
from tdint.kernels import peaks_in_parts as parts
from tdint.kernels import step_interpolant as interpolant
from tdint.kernels.stepping import Ends, Passage, Scene, Seen, Span

H = 0.04
FAR = 1e300
JUST_BELOW, JUST_ABOVE = 1.0 - 1e-9, 1.0 + 1e-9


def span(on_path=False, fast=False, ground=(0.0, 0.0)):
    return Span(0.3, H, *ground, on_path, fast, False, False)


def random_ends(seed, count=100, size=1.0):
    """Return motions over a step of the length H in which all terms of the quintic are similar.

    Parameters
    ----------
    seed : int
        Seed of the random numbers.
    count : int
        Number of motions.
    size : float
        Factor of the accelerations.
    """
    scale = np.array([1.0, 1.0 / H, size / H**2])
    values = np.random.default_rng(seed).normal(size=(count, 8))
    factors = np.concatenate([scale, scale, scale[1:]])
    return [Ends(*(float(value) for value in row)) for row in values * factors]


def quintic(ends):
    """Return the polynomial of SciPy through the values, rates and accelerations at both ends."""
    return BPoly.from_derivatives([0.0, H], [ends[:3], ends[3:6]])


def in_powers(bernstein):
    """Return the same polynomial in powers of s = t / H."""
    degree = bernstein.c.shape[0] - 1
    s, total = Polynomial([0.0, 1.0]), Polynomial([0.0])
    binomial = 1.0
    for k in range(degree + 1):
        total += bernstein.c[k, 0] * binomial * s**k * (1.0 - s) ** (degree - k)
        binomial *= (degree - k) / (k + 1)
    return total


def interior_extrema(polynomial):
    """Return the values at the zeros of the derivative between 0 and 1."""
    roots = polynomial.deriv().roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    return polynomial(real[(real > 0.0) & (real < 1.0)])


def cubic_hermite(ends):
    return in_powers(BPoly.from_derivatives([0.0, H], [ends[:2], ends[3:5]]))


@pytest.mark.parametrize("ends", random_ends(1, 20))
def test_coefficients_bulge_and_tilt_of_the_quintic(ends):
    expected = in_powers(quintic(ends)).coef
    assert interpolant.quintic_coefficients(H, ends) == pytest.approx(
        expected[3:], rel=1e-9, abs=1e-9
    )
    bulge, tilt = interpolant.bulge_and_tilt(H, ends)
    s = np.linspace(0.0, 1.0, 7)
    line = ends.a0 + (ends.a1 - ends.a0) * s
    acceleration = line + s * (1.0 - s) * (bulge + tilt * (1.0 - 2.0 * s))
    expected = quintic(ends).derivative(2)(s * H)
    assert acceleration == pytest.approx(expected, abs=1e-11 / H**2)


@pytest.mark.parametrize("ends", random_ends(2, 20))
def test_bezier_points_of_velocity(ends):
    points = quintic(ends).derivative().c[:, 0]
    middle = peaks._middle_velocity_bezier_point(H, 1.0 / H, ends)
    assert middle == pytest.approx(points[2], abs=1e-11 / H)
    largest = peaks._max_velocity_bezier_point(H, 1.0 / H, ends)
    assert largest == pytest.approx(np.max(np.abs(points[1:4])), rel=1e-11)


def test_velocity_is_searched_if_bezier_point_exceeds_peak():
    opposite = 0
    for ends in random_ends(3):
        points = np.abs(quintic(ends).derivative().c[:, 0])
        opposite += ends.a0 * ends.a1 < 0.0
        bound = max(points[1:]) if ends.a0 * ends.a1 < 0.0 else points[4]
        assert peaks.may_exceed_velocity_peak(H, 1.0 / H, ends, bound * JUST_BELOW)
        assert not peaks.may_exceed_velocity_peak(H, 1.0 / H, ends, bound * JUST_ABOVE)
    assert 20 < opposite < 80
    # An acceleration of zero at one end is not a change of the sign.
    for one in (Ends(0.0, 1.0, 0.0, 0.0, 1.0, -9e9, 0.0, 0.0),):
        assert not peaks.may_exceed_velocity_peak(H, 1.0 / H, one, 1.0)


def table(row, value):
    """Return a table of one column with one peak; the other peaks are never exceeded."""
    found = np.full((2 * rows.PEAK_ROWS, 1), FAR)
    found[rows.PEAK_ROWS :] = 0.0
    found[row] = value
    return found


def test_floor_is_searched_if_bound_of_its_bezier_points_exceeds_peak():
    """The bound of the displacement contains all Bezier points. That of the velocity is the
    middle point, or the largest velocity plus h / 4 times the largest acceleration."""
    middle_is_largest = 0
    for size in (0.05, 1.0):
        for ends in random_ends(4, size=size):
            v_max = max(abs(ends.v0), abs(ends.v1))
            a_max = max(abs(ends.a0), abs(ends.a1))
            bound = max(abs(ends.u0), abs(ends.u1)) + 0.5 * H * v_max + H**2 / 20.0 * a_max
            assert np.max(np.abs(quintic(ends).c)) <= bound
            middle = abs(quintic(ends).derivative().c[2, 0])
            middle_is_largest += middle > v_max + 0.25 * H * a_max
            for row, value in (
                (rows.PEAK_DISPLACEMENT, bound),
                (rows.PEAK_VELOCITY, max(middle, v_max + 0.25 * H * a_max)),
            ):
                for factor, expected in ((JUST_BELOW, True), (JUST_ABOVE, False)):
                    found = peaks.may_exceed_floor_peaks(
                        H, 1.0 / H, ends, table(row, factor * value), 0
                    )
                    assert found == expected
    assert 20 < middle_is_largest < 180


@pytest.mark.parametrize("on_path", [False, True])
def test_story_is_searched_if_its_drift_or_shear_may_exceed_peak(on_path):
    """The bound of the drift contains all Bezier points. The bound of the shear is its value at
    the end if the drift cannot reverse, otherwise this value and the stiffness times the bound of
    the distance from the drift at the end."""
    stiffness, reversed_drifts = 30.0, 0
    random = np.random.default_rng(5)
    for ends in random_ends(5):
        shear = float(random.normal(scale=20.0))
        reach = peaks.story_reach(span(on_path), ends, shear, stiffness)
        v_max = max(abs(ends.v0), abs(ends.v1))
        excess = 0.5 * H * v_max + H**2 / 20.0 * (abs(ends.a0) + abs(ends.a1))
        drift = max(abs(ends.u0), abs(ends.u1)) + excess
        assert np.max(np.abs(quintic(ends).c)) <= drift
        distance = abs(ends.u1 - ends.u0) + excess
        assert np.max(np.abs(quintic(ends).c - ends.u1)) <= distance
        reverses = on_path or ends.v0 * ends.v1 < 0.0
        reversed_drifts += reverses
        at_start = H**2 / 20.0 * abs(ends.a0)
        of_end = H**2 / 20.0 * abs(ends.a1)
        expected = drift - of_end, abs(shear) + reverses * stiffness * (distance - of_end)
        assert reach == pytest.approx(expected, rel=1e-12)
        assert at_start < reach[0]
        for row, value in (
            (rows.PEAK_DRIFT, reach[0] + of_end),
            (rows.PEAK_SHEAR, reach[1] + stiffness * of_end),
        ):
            for factor, exceeds in ((JUST_BELOW, True), (JUST_ABOVE, False)):
                found = peaks.may_exceed_story_peaks(
                    reach, of_end, np.full((2, 1), stiffness), table(row, factor * value), 0
                )
                assert found == exceeds
    assert reversed_drifts == 100 if on_path else 20 < reversed_drifts < 80


def test_excursion_contains_quintic_cubic_and_parabola():
    """It is the largest of three bounds, and each of them is the largest in some motions."""
    largest = np.zeros(3, int)
    for size in (0.1, 1.0, 10.0):
        for ends in random_ends(6, size=size):
            change = abs(ends.u1 - ends.u0)
            bounds = (
                change + 0.4 * H * abs(ends.v0) + H**2 / 20.0 * abs(ends.a0),
                0.4 * H * abs(ends.v1) + H**2 / 20.0 * abs(ends.a1),
                0.5 * change + 0.25 * H * abs(ends.v1 - ends.v0),
            )
            found = peaks._displacement_excursion(span(), ends)
            assert found == pytest.approx(max(bounds), rel=1e-12)
            largest[np.argmax(bounds)] += 1
            assert np.max(np.abs(quintic(ends).c - ends.u1)) <= found * JUST_ABOVE
            cubic = BPoly.from_derivatives([0.0, H], [ends[:2], ends[3:5]])
            assert np.max(np.abs(cubic.c - ends.u1)) <= found * JUST_ABOVE
    assert np.all(largest > 0)


def test_acceleration_is_searched_if_bezier_point_may_exceed_peak():
    """A bound of the Bezier points for all tilts that are not ignored, in absolute value at most
    2 |B| after the weights of both."""
    for a0, a1, bulge in np.random.default_rng(7).normal(size=(100, 3)):
        bound = max(abs(a0), abs(a1)) + 2.0 * abs(bulge) / 3.0
        assert peaks.may_exceed_acceleration_peak(a0, a1, bulge, bound * JUST_BELOW)
        assert not peaks.may_exceed_acceleration_peak(a0, a1, bulge, bound * JUST_ABOVE)
        for ratio in np.linspace(-2.0, 2.0, 21):
            weight = min(2.0 - abs(ratio), 1.0)
            inner = interpolant.max_interior_bezier_point(
                a0, a1, weight * bulge, weight * ratio * bulge
            )
            assert inner <= bound * JUST_ABOVE


def test_limits_of_resolved_motion():
    zero = 0.0
    for scale, bulge, tilt in ((2.0, 4.0, -2.0), (1.0, -1.0, 2.0)):
        assert interpolant.is_near_line(bulge, tilt, scale)  # 3 times the scale
        assert not interpolant.is_near_line(bulge * JUST_ABOVE, tilt, scale)
        assert not interpolant.is_near_line(bulge, tilt * JUST_ABOVE, scale)
    # Second differences of velocities (5 - 2 * 2 + 6 = 7 = |5| + |2|) and accelerations
    for name in ("v", "a"):
        for earlier, expected in ((6.0, True), (6.0 + 1e-9, False), (-8.0, True), (-8.1, False)):
            values = {f"{name}0": 2.0, f"{name}1": 5.0, f"{name}_earlier": earlier}
            ends = Ends(**(dict.fromkeys(Ends._fields, zero) | values))
            assert interpolant.resolves_motion(span(fast=True), ends) == expected
            assert interpolant.resolves_motion(span(fast=False), ends)


def test_drift_has_extremum_if_its_rate_or_parabola_turns():
    for on_path in (False, True):
        for ends in random_ends(8):
            slopes = np.array([-0.5, 0.5]) * H * (ends.v1 - ends.v0) + ends.u1 - ends.u0
            expected = ends.v0 * ends.v1 < 0.0 or (on_path and slopes[0] * slopes[1] < 0.0)
            assert peaks._has_extremum(span(on_path), ends) == expected
    level = Ends(0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    assert not peaks._has_extremum(span(), level)
    vertex_at_end = Ends(0.0, 0.0, 0.0, 1.0, 2.0 / H, 0.0, 0.0, 0.0)
    assert not peaks._has_extremum(span(True), vertex_at_end)


def reversing_ends(seed, mismatch):
    """Return motions whose velocity changes its sign, with a relative mismatch of the change of
    velocity, and a displacement that fits the velocities."""
    found = []
    random = np.random.default_rng(seed)
    for _ in range(60):
        v0 = random.choice([-1.0, 1.0]) * random.uniform(0.2, 1.0) / H
        v1 = -np.sign(v0) * random.uniform(0.2, 1.0) / H
        missing = mismatch * random.choice([-1.0, 1.0]) * (abs(v0) + abs(v1))
        mean = (v1 - v0 - missing) / H
        a0 = mean * random.uniform(0.7, 1.3)
        a1 = 2.0 * mean - a0
        u0 = random.normal()
        u1 = u0 + 0.5 * H * (v0 + v1) - H**2 / 12.0 * (a1 - a0) + 0.02 * random.normal()
        found.append(Ends(u0, v0, a0, u1, v1, a1, v0, a0))
    return found


def outward(extrema, ends):
    """Return the extremum on the side of the velocity at the start."""
    return max(extrema, key=lambda value: value * np.sign(ends.v0))


@pytest.mark.parametrize("row", [rows.PEAK_DRIFT, rows.PEAK_DISPLACEMENT])
def test_extremum_of_displacement_is_found(row):
    """Of the quintic if velocities and accelerations agree, otherwise of the parabola of the
    method or of the cubic, which is a possible peak only."""
    for mismatch, on_path in ((0.45, False), (0.45, True), (0.55, False), (0.55, True)):
        for ends in reversing_ends(9, mismatch):
            found = table(row, 0.0)
            result = peaks._raise_displacement_peak(span(on_path), ends, -FAR, found, row, 0)
            if mismatch < 0.5:
                expected = outward(interior_extrema(in_powers(quintic(ends))), ends)
                assert result == pytest.approx(expected, rel=1e-5, abs=1e-7)
                assert found[row, 0] == abs(result)
                assert found[row + rows.PEAK_ROWS, 0] == 0.0
            elif on_path:
                rise, curvature = ends.u1 - ends.u0, 0.5 * H * (ends.v1 - ends.v0)
                parabola = Polynomial([ends.u0, rise - curvature, curvature])
                (expected,) = [*interior_extrema(parabola)] or [ends.u1]
                assert result == pytest.approx(expected, rel=1e-9)
                assert found[row, 0] == (abs(result) if result != ends.u1 else 0.0)
            else:
                extrema = [ends.u0, *interior_extrema(cubic_hermite(ends))]
                assert result == ends.u1
                assert found[row, 0] == 0.0
                possible = found[row + rows.PEAK_ROWS, 0]
                assert possible == pytest.approx(np.max(np.abs(extrema)), rel=1e-9)


def test_parabola_is_used_up_to_its_vertex_at_end():
    # Vertex at 0.9, 1.0 and 1.1 of the step; the accelerations do not explain the velocities.
    for vertex, inside in ((0.9, True), (1.0, False), (1.1, False), (0.1, True), (-0.1, False)):
        parabola = Polynomial([0.5, -4.0 * vertex, 2.0])
        rate = parabola.deriv() / H
        ends = Ends(parabola(0.0), rate(0.0), 0.0, parabola(1.0), rate(1.0), 0.0, 0.0, 0.0)
        found = table(rows.PEAK_DRIFT, 0.0)
        result = peaks._raise_displacement_peak(span(True), ends, -FAR, found, rows.PEAK_DRIFT, 0)
        assert result == pytest.approx(parabola(vertex) if inside else ends.u1, rel=1e-12)


def test_extremum_below_margin_is_ignored():
    """The margin counts from the drift at the end, in the direction of the extremum: the largest
    distance of the Bezier points of the quintic and of the cubic decides."""
    for mismatch in (0.3, 0.7):
        for ends in reversing_ends(10, mismatch):
            direction = np.sign(ends.v0)
            cubic = BPoly.from_derivatives([0.0, H], [ends[:2], ends[3:5]])
            points = [*quintic(ends).c[2:4, 0], *cubic.c[1:3, 0]]
            bound = max(direction * (point - ends.u1) for point in points)
            for factor, expected in ((JUST_BELOW, True), (JUST_ABOVE, False)):
                found = table(rows.PEAK_DRIFT, 0.0)
                peaks._raise_displacement_peak(
                    span(), ends, factor * bound, found, rows.PEAK_DRIFT, 0
                )
                assert (
                    np.any(found[[rows.PEAK_DRIFT, rows.PEAK_DRIFT + rows.PEAK_ROWS]]) == expected
                )
    for v1 in (0.0, 1.0):
        same_direction = Ends(0.0, 1.0, 9.0, 0.0, v1, 9.0, 1.0, 9.0)
        found = table(rows.PEAK_DRIFT, 0.0)
        peaks._raise_displacement_peak(span(), same_direction, -FAR, found, rows.PEAK_DRIFT, 0)
        assert not np.any(found[rows.PEAK_DRIFT :: rows.PEAK_ROWS])


def test_extremum_of_velocity_is_found():
    """Of the derivative of the quintic; a possible peak if the acceleration is far from a line."""
    row, of_kind = rows.PEAK_VELOCITY, [0, 0]
    random = np.random.default_rng(11)
    for _ in range(150):
        a0 = random.choice([-1.0, 1.0]) * random.uniform(0.5, 1.0)
        a1 = -np.sign(a0) * random.uniform(0.5, 1.0)
        # Any bulge and tilt determine the velocity and the displacement at the end.
        bulge, tilt = random.normal(size=2) * 2.0
        v0 = random.normal() * H
        v1 = v0 + H * (0.5 * (a0 + a1) + bulge / 6.0)
        u1 = H * (0.5 * (v0 + v1) + H / 60.0 * (tilt - 5.0 * (a1 - a0)))
        ends = Ends(0.0, v0, a0, u1, v1, a1, v0, a0)
        possible = int(abs(bulge) + abs(tilt) > 3.0 * (abs(a0) + abs(a1)))
        velocity = in_powers(quintic(ends).derivative())
        expected = outward(interior_extrema(velocity), ends._replace(v0=a0))
        for recorded in (0.0, 10.0):
            found = table(row, recorded)
            found[row + rows.PEAK_ROWS] = recorded
            peaks._raise_velocity_peak(span(), ends, found, row, 0)
            of_kind[possible] += 1
            changed, other = found[
                [row + possible * rows.PEAK_ROWS, row + (1 - possible) * rows.PEAK_ROWS], 0
            ]
            assert changed == pytest.approx(max(abs(expected), recorded), rel=1e-3)
            assert other == recorded
    assert min(of_kind) > 20


def raise_absolute_peak(step, ends, mass, forces, values, row, is_located):
    """Search one quantity without dashpots; return the located instant, 0 for none."""
    flags = np.zeros(rows.FLAGS_SIZE)
    flags[rows.LINEAR] = not is_located
    scene = Scene(None, None, None, None, flags)
    dashpots = peaks._NOT_NEAR_REST, peaks._NOT_NEAR_REST
    instants = np.zeros((1, 1))
    targets = values, row, instants, 0
    count = peaks._raise_absolute_peak(
        step, 1.0 / step.h, (ends, mass, forces), dashpots, scene, targets, 0
    )
    assert count == (instants[0, 0] > 0.0)
    return instants[0, 0]


@pytest.mark.parametrize("fast", [False, True])
def test_extremum_of_acceleration_is_found(fast):
    """The curve is the sum of a line and the weighted bulge and tilt. Bulge and tilt of the forces
    on floors are subtracted before the weight is computed. The ground acts on the mass."""
    row, of_kind = rows.PEAK_TOTAL_SHEAR, [0, 0, 0]
    random = np.random.default_rng(12)
    for _ in range(400):
        a0, a1, ground_0, ground_1, f0, f1, f2, f3 = random.normal(size=8)
        mass = random.uniform(1.0, 2.0)
        bulge = 4.0 * random.normal()
        tilt = 2.5 * random.uniform(-1.0, 1.0) * bulge
        v0 = random.normal() * H
        v1 = v0 + H * (0.5 * (a0 + a1) + (bulge + f2) / 6.0)
        u1 = H * (0.5 * (v0 + v1) + H / 60.0 * (tilt + f3 - 5.0 * (a1 - a0)))
        a_earlier = 2.0 * a0 - a1 + random.normal()
        ends = Ends(0.0, v0, a0, u1, v1, a1, 2.0 * v0 - v1, a_earlier)
        ratio = abs(tilt / bulge)
        weight = max(0.0, min(2.0 - ratio, 1.0))
        first, last = a0 + mass * ground_0 - f0, a1 + mass * ground_1 - f1
        s = Polynomial([0.0, 1.0])
        b, d = weight * bulge, weight * tilt
        curve = first + (last - first) * s + s * (1.0 - s) * (b + d * (1.0 - 2.0 * s))
        expected = max([abs(first), *np.abs(interior_extrema(curve))])
        resolved = abs(b) + abs(d) <= 3.0 * (abs(first) + abs(last)) and not (
            fast and abs(a1 - 2.0 * a0 + a_earlier) > abs(a0) + abs(a1)
        )
        found, located = table(row, 0.0), table(row, 0.0)
        step = span(fast=fast, ground=(ground_0, ground_1))
        at, at_located = (
            raise_absolute_peak(step, ends, mass, (f0, f1, f2, f3), values, row, is_located)
            for values, is_located in ((found, False), (located, True))
        )
        kind = 2 if ratio >= 2.0 else int(not resolved)
        of_kind[kind] += 1
        values = [0.0, 0.0]
        if kind < 2:
            values[kind] = expected
        assert found[row :: rows.PEAK_ROWS, 0] == pytest.approx(values, rel=1e-8)
        # A located extremum is not a peak, because the equation of motion gives its value.
        assert at == 0.0
        if kind == 0:
            assert np.all(located[row :: rows.PEAK_ROWS, 0] == 0.0)
            assert abs(curve(at_located)) == pytest.approx(expected, rel=1e-8)
        else:
            assert at_located == 0.0 and np.array_equal(located, found)
    assert min(of_kind) > 20
    # A peak above the Bezier points remains, although the extremum is compared with it again.
    found = table(row, 1e9)
    for is_located in (False, True):
        arguments = found, row, is_located
        assert raise_absolute_peak(span(), ends, mass, (f0, f1, f2, f3), *arguments) == 0.0
    assert found[row, 0] == 1e9


def test_extremum_is_next_to_best_of_seven_points():
    random = np.random.default_rng(13)
    points = np.arange(1, 8) / 8.0
    for _ in range(100):
        coefficients = tuple(random.normal(size=6))
        polynomial = Polynomial(coefficients)
        values = polynomial(points) * np.sign(coefficients[1])
        s, best = interpolant._best_of_samples(coefficients)
        assert s == points[np.argmax(values)]
        assert best == pytest.approx(polynomial(s), rel=1e-12, abs=1e-12)
        assert interpolant._value(0.3, coefficients) == pytest.approx(polynomial(0.3), abs=1e-12)
        # The result is at least as extreme as all points, and on the polynomial.
        extremum = interpolant.quintic_extremum(random.uniform(), coefficients)
        assert extremum * np.sign(coefficients[1]) >= max(values) - 1e-12
        if (extrema := interior_extrema(polynomial)).size:
            highest = max(
                [*extrema, polynomial(0.0), polynomial(1.0)],
                key=lambda v: v * np.sign(coefficients[1]),
            )
            assert extremum * np.sign(coefficients[1]) <= highest * np.sign(coefficients[1]) + 1e-12


def test_three_newton_iterations():
    """Each step of Newton's method squares the error; they stop where the curvature has the sign
    of the slope at the start, and stay between 0 and 1."""
    random = np.random.default_rng(14)
    kept = 0
    for _ in range(100):
        coefficients = tuple(random.normal(size=6))
        p = Polynomial(coefficients)
        s = start = random.uniform()
        for _ in range(3):
            curvature = p.deriv(2)(s)
            if curvature * coefficients[1] < 0.0:
                s = np.clip(s - p.deriv()(s) / curvature, 0.0, 1.0)
        kept += s == start
        found = interpolant._nearest_extremum(start, coefficients)
        assert found == pytest.approx(p(s), rel=1e-9, abs=1e-9)
    assert 10 < kept < 90


def test_motions_of_floors_and_stories_and_sums_above():
    random = np.random.default_rng(16)
    old, state, others = random.normal(size=(3, 8, 4))
    passage = Passage(old, 2, state, others, 3)
    floors = [peaks.floor_ends(True, passage, i) for i in range(3)]
    for i, floor in enumerate(floors):
        assert floor == Ends(
            *old[2:5, i], *state[[rows.DISPLACEMENT, rows.VELOCITY], i], others[3, i], *old[5:7, i]
        )
        calm = peaks.floor_ends(False, passage, i)
        assert calm == floor._replace(v_earlier=floor.v0, a_earlier=floor.a0)
    for link in (0.0, 1.0):
        story = peaks.story_ends(floors[1], floors[0], link, 7.0)
        expected = np.subtract(floors[1], link * np.array(floors[0]))
        expected[3] = 7.0
        assert story == pytest.approx(expected, rel=1e-12)
        terms = np.zeros((rows.LINEAR_TERM_ROWS, 4))
        terms[rows.LINK], terms[rows.MASS] = (9.0, 9.0, link, 9.0), (1.0, 2.5, 1.0, 1.0)
        sums, mass = peaks.add_floor_inertia(terms, 1, floors[1], floors[2], 3.0)
        expected = link * np.array(floors[2]) + 2.5 * np.array(floors[1])
        assert sums == pytest.approx(expected, rel=1e-12)
        assert mass == link * 3.0 + 2.5


# ---- Parts of a kinked step: the interpolant of the step plus a deviation

PARTS = [(0.0, 0.4), (0.3, 0.7), (0.6, 1.0)]
X = np.linspace(0.0, 1.0, 20_001)
NUMBERS = np.random.default_rng(14).normal(size=(100, 4))


def recorded(function, *arguments):
    """Return the largest peak that a function records for the first floor."""
    table = np.zeros((2 * rows.PEAK_ROWS, 1))
    function(span(), *arguments, table, rows.PEAK_VELOCITY, 0)
    return table.max()


@pytest.mark.parametrize("part", PARTS)
def test_velocity_in_a_part_of_a_step(part):
    """The largest velocity in a part is that of a dense sample, at its end or an extremum."""
    s_0, length = part[0], part[1] - part[0]
    s = s_0 + length * X
    for ends, deviation in zip(random_ends(11), NUMBERS[:, :3], strict=True):
        v, (d_0, d_1) = deviation[0] / H, deviation[1:] / H**2
        bulge, tilt = interpolant.bulge_and_tilt(H, ends)
        tilt *= interpolant.tilt_weight(bulge, tilt)
        hermite = BPoly.from_derivatives([0, 1], [[ends.v0, H * ends.a0], [ends.v1, H * ends.a1]])
        velocity = hermite(s) + 0.5 * H * tilt * s**2 * (1.0 - s) ** 2
        velocity += v + H * length * (d_0 * X + 0.5 * (d_1 - d_0) * X**2)
        deviations = (v, v + 0.5 * H * length * (d_0 + d_1), d_0, d_1)
        rises, rises_at_end = velocity[1] > velocity[0], velocity[-1] > velocity[-2]
        expected = abs(velocity[-1]) if part[1] < 1.0 else 0.0
        if rises != rises_at_end:
            expected = max(expected, abs(velocity.max() if rises else velocity.min()))
        found = recorded(parts._raise_velocity_in_part, ends, part, deviations)
        assert found == pytest.approx(expected, rel=1e-6)


def test_deviations_of_accelerations_and_total_shears_in_a_part(monkeypatch):
    """The forces of the dampers of floors and stories, with dense matrices, change with the
    deviations of the velocities: accelerations by -M^-1 C, total shears by their sums from the
    roof. The values are those at both ends of the part, and both bulges."""
    passed = {rows.PEAK_ACCELERATION: {}, rows.PEAK_TOTAL_SHEAR: {}}

    def record(span, quantity, part, deviations, peaks, row, i):
        passed[row][i] = deviations

    monkeypatch.setattr(parts, "_raise_absolute_peak_in_part", record)
    n, random = 3, np.random.default_rng(16)
    mass, of_floors, of_stories = random.uniform(1.0, 3.0, (3, n))
    terms = np.zeros((rows.LINEAR_TERM_ROWS, n + 1))
    terms[[rows.MASS, rows.INVERSE_MASS], :n] = mass, 1.0 / mass
    terms[[rows.FLOOR_DAMPER, rows.STORY_DAMPER], :n] = of_floors, of_stories
    terms[rows.LINK, 1:n] = 1.0
    scene = Scene(terms, np.zeros((0, n + 1)), np.zeros((1, n + 1)), np.zeros((0, 1)), np.zeros(99))
    memory = np.zeros((rows.LOCATED, n + 1))
    for row in range(rows.LOAD_DEVIATION, rows.LOCATED):
        memory[row, :n] = random.normal(size=n)
    accelerations = random.normal(size=(2, n))
    old, new = np.zeros((3, n + 1)), np.zeros((3, n + 1))
    old[2, :n], new[2, :n] = accelerations
    law_state = np.zeros((rows.EXTRA_ROWS, n + 1))
    seen = Seen(memory, np.zeros((2 * rows.PEAK_ROWS, n + 1)), *(np.zeros(0),) * 3)
    parts.raise_peaks_in_part(
        span(), scene, Passage(old, 0, new, new, 2), law_state, (0.2, 0.6), seen
    )
    difference = np.eye(n) - np.eye(n, k=-1)
    damping = np.diag(of_floors) + difference.T @ np.diag(of_stories) @ difference
    velocity, load = rows.VELOCITY_DEVIATION, rows.LOAD_DEVIATION
    modal = [rows.MODAL_DEVIATION, rows.MODAL_DEVIATION + 1, rows.MODAL_DEVIATION + 2]
    # The last bulge is that of the velocity under the lines: of floors it is stored, and of drift
    # rates 4 times the distance of a parabola with these accelerations from its chord.
    rates = 0.5 * H * difference @ (accelerations[0] - accelerations[1])
    forces = [
        *(damping @ memory[velocity + k, :n] + memory[modal[k], :n] for k in range(3)),
        of_floors * memory[rows.VELOCITY_BULGE, :n]
        + difference.T @ (of_stories * rates)
        + memory[rows.MODAL_BULGE, :n],
    ]
    loads = [memory[load, :n], memory[load + 1, :n], np.zeros(n), np.zeros(n)]
    for i in range(n):
        expected = [(own[i] - force[i]) / mass[i] for own, force in zip(loads, forces, strict=True)]
        assert passed[rows.PEAK_ACCELERATION][i] == pytest.approx(expected, rel=1e-12)
        sums = [-float(np.sum(force[i:])) for force in forces]
        assert passed[rows.PEAK_TOTAL_SHEAR][i] == pytest.approx(sums, rel=1e-12)


@pytest.mark.parametrize(("bulge_over_rounding", "weight"), [(0.9, 0.0), (1.5, 0.5), (2.5, 1.0)])
@pytest.mark.parametrize("far", [(1e9, 1e9), (-1e9, -1e9)])
def test_a_bulge_near_its_rounding_is_replaced(bulge_over_rounding, weight, far):
    """The terms of bulge and tilt have rounding errors of a fraction of their sum. Between this sum
    and its double, the weight of the bulge grows from 0 to 1."""
    rounding = parts._TILT_ROUNDING * 2e9 / H**2
    bulge, damping = rounding * bulge_over_rounding, 0.3 * rounding
    a0, v1 = 2.0, H * 2.0 + H / 6.0 * bulge  # with v0 = 0 and a1 = a0
    ends = Ends(far[0], 0.0, a0, far[1], v1, a0, 0.0, a0)
    found_bulge, tilt = interpolant.bulge_and_tilt(H, ends)
    assert found_bulge == pytest.approx(bulge, rel=1e-12)
    forces = 0.0, 0.0, 0.0, tilt  # a step without tilt
    table = np.zeros((2 * rows.PEAK_ROWS, 1))
    parts._raise_absolute_peak_in_part(
        span(), (ends, 0.0, forces), (0.0, 1.0), (0.0, 0.0, 0.0, damping), table,
        rows.PEAK_VELOCITY, 0,
    )  # fmt: skip
    expected = a0 + 0.25 * (weight * bulge + (1.0 - weight) * damping)
    assert table.max() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("mass", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("part", PARTS)
def test_absolute_acceleration_in_a_part_of_a_step(part, mass):
    """The largest sum of inertia forces, ground motion and other forces in a part is that of a
    dense sample of the cubic and a parabola. Where the cubic is far from the line, the ends of the
    line with its deviations are recorded, and the cubic as the peak of a more exact search."""
    s = part[0] + (part[1] - part[0]) * X
    others = np.random.default_rng(15).normal(size=(100, 6)) * (mass > 0.0) / H**2
    found_both = set()
    for ends, numbers, (*forces, ground_0, ground_1) in zip(
        random_ends(13), NUMBERS, others.tolist(), strict=True
    ):
        first, last, part_bulge, damping = (float(number) for number in numbers / H**2)
        start, end = (
            ends.a0 + mass * ground_0 - forces[0],
            ends.a1 + mass * ground_1 - forces[1],
        )
        bulge, tilt = interpolant.bulge_and_tilt(H, ends)
        bulge, tilt = bulge - forces[2], tilt - forces[3]
        weight = interpolant.tilt_weight(bulge, tilt)
        bulge, tilt = weight * bulge + (1.0 - weight) * damping, weight * tilt
        line = start + (end - start) * s + first + (last - first) * X
        values = line + s * (1.0 - s) * (bulge + tilt * (1.0 - 2.0 * s))
        values += part_bulge * X * (1.0 - X)
        table = np.zeros((2 * rows.PEAK_ROWS, 1))
        parts._raise_absolute_peak_in_part(
            span(ground=(ground_0, ground_1)), (ends, mass, forces), part,
            (first, last, part_bulge, damping), table, rows.PEAK_VELOCITY, 0,
        )  # fmt: skip
        found, searched = table[[rows.PEAK_VELOCITY, rows.PEAK_VELOCITY + rows.PEAK_ROWS], 0]
        near = interpolant.is_near_line(bulge, tilt, abs(start) + abs(end) + abs(first) + abs(last))
        found_both.add(bool(near))
        exact = found if near else searched
        assert exact == pytest.approx(np.abs(values).max(), rel=1e-6)
        if not near:
            assert found == pytest.approx(max(abs(line[0]), abs(line[-1])), rel=1e-12)
    assert found_both == {True, False}
