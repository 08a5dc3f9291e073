"""Peaks within a step, or within the piece of one between two changes of branch.

Between both ends a floor moves on the quintic that has its displacement, velocity and acceleration there; drifts are
differences of such. It errs by (omega h)^4 / 1900 of an acceleration with the frequency omega, and by what a step's
displacements miss over h^2: with a method of order 2 that is of the size of what the acceleration changes by in a step.
Beside the straight line between its ends an acceleration has a bulge, which the velocities tell, and a tilt of it,
which needs the displacements. Where the tilt is no larger, the bulge lies on one side of that line, and is taken; where
it is larger, with methods of order 2 as a rule, displacements do not tell, and the acceleration is largest at an end.

It is looked at closely only where a peak could be passed: where some value is at least half its peak at an end, and
there the displacement (or drift) where its rate changes sign, the velocity where the acceleration does, the absolute
acceleration where it is that large.

Where both accelerations do not tell about what the velocities changed by, or, with modes that the step does not follow,
the rates at the ends of two steps do not lie about on a line, the floor moves otherwise than the interpolant: then
nothing is told, and what the peak might be goes to the rows of doubt. A method whose displacements follow parabolas
tells by these what they do there.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined

_RESOLVED = 0.5  # what a change of velocity may miss the mean acceleration by, over the velocities
_SMOOTH = 1.0  # what an acceleration inside may miss the straight line by, over those at the ends
_SWING = 0.5  # of h times the rates at both ends: what a parabola may go beyond the value at its end


@inlined
def raise_peak(peaks, row, i, value):
    """Raise a peak to the size of a value. Returns whether that is near the peak: at least half of it."""
    size = abs(value)
    peak = peaks[row, i]
    if size > peak:
        peaks[row, i] = size
    return 2.0 * size >= peak


@inlined
def look_within(
    on_path, fast, chain, laws, h, ground_0, ground_1, old, first, state, accelerations, new, springs, turns, turn,
    peaks, top,
):  # fmt: skip
    """Raise the peaks, rows of `peaks` from `top` on, that a step of h has between its ends.

    The ground acceleration is linear in it. Rows from `first` of `old` are displacement, velocity and acceleration of
    the floors at its start, rows of `state`, and row `new` of `accelerations`, those at its end, relative to the
    ground; with `fast` two rows more of `old` are velocity and acceleration one step before. With `on_path`
    displacements follow parabolas.

    Row `turn` of `turns` receives the drift at which a story turns with what may be its largest shear, for others the
    present drift; returns how many there are of these.
    """
    n = chain.shape[1] - 1
    passing = _may_pass(
        on_path, chain, laws, h, ground_0, ground_1, old, first, state, accelerations, new, springs, peaks, top, 0, 0
    )  # fmt: skip
    for i in range(1, n):
        passing |= _may_pass(
            on_path, chain, laws, h, ground_0, ground_1, old, first, state, accelerations, new, springs, peaks, top, i,
            i - 1,
        )  # fmt: skip
    if not passing:
        return 0
    return _look_closely(
        on_path, fast, chain, laws, h, ground_0, ground_1, old, first, state, accelerations, new, springs, turns, turn,
        peaks, top,
    )  # fmt: skip


@inlined
def _may_pass(
    on_path, chain, laws, h, ground_0, ground_1, old, first, state, accelerations, new, springs, peaks, top, i, below
):  # fmt: skip
    """Whether floor `i` or its story may pass a peak. `below` is the floor below, any for the lowest one.

    Without branches: of the many steps in which some value is near its peak few pass it.
    """
    link = chain[at.LINK, i]
    u0 = old[first, i]
    v0 = old[first + 1, i]
    a0 = old[first + 2, i]
    u1 = state[at.DISPLACEMENT, i]
    v1 = state[at.VELOCITY, i]
    a1 = accelerations[new, i]
    drift = springs[at.DRIFT, i]
    rate_0 = v0 - link * old[first + 1, below]
    rate_1 = v1 - link * state[at.VELOCITY, below]
    swing = _SWING * h * (abs(rate_0) + abs(rate_1))
    passed = abs(drift) + swing > peaks[top + at.PEAK_DRIFT, i]
    sheared = abs(springs[at.FORCE, i]) + laws[at.STIFFNESS, i] * swing > peaks[top + at.PEAK_SHEAR, i]
    rise = drift - (u0 - link * old[first, below])
    passing = _turns(on_path, h, rise, rate_0, rate_1) & (passed | sheared)
    passed = abs(u1) + _SWING * h * (abs(v0) + abs(v1)) > peaks[top + at.PEAK_DISPLACEMENT, i]
    passing |= _turns(on_path, h, u1 - u0, v0, v1) & passed
    passing |= (a0 * a1 < 0.0) & (abs(v1) + _SWING * h * (abs(a0) + abs(a1)) > peaks[top + at.PEAK_VELOCITY, i])
    peak = peaks[top + at.PEAK_ACCELERATION, i]
    absolute_0 = a0 + ground_0
    absolute_1 = a1 + ground_1
    bulge, tilt = _bend(h, u0, v0, a0, u1, v1, a1)
    near = (2.0 * abs(absolute_0) > peak) | (2.0 * abs(absolute_1) > peak)
    return passing | (near & (_most(absolute_0, absolute_1, bulge, tilt) > peak) & (abs(tilt) <= abs(bulge)))


@inlined
def _turns(on_path, h, rise, rate_0, rate_1):
    """Whether a displacement has an extremum inside the step."""
    return (on_path & (2.0 * abs(rise) < h * abs(rate_1 - rate_0))) | (rate_0 * rate_1 < 0.0)


@called
def _look_closely(
    on_path, fast, chain, laws, h, ground_0, ground_1, old, first, state, accelerations, new, springs, turns, turn,
    peaks, top,
):  # fmt: skip
    """What `look_within` does where a peak may be passed."""
    turned = 0
    u0_below = 0.0
    v0_below = 0.0
    a0_below = 0.0
    w0_below = 0.0
    b0_below = 0.0
    v1_below = 0.0
    a1_below = 0.0
    for i in range(chain.shape[1] - 1):
        link = chain[at.LINK, i]
        u0 = old[first, i]
        v0 = old[first + 1, i]
        a0 = old[first + 2, i]
        w0 = old[first + 3, i] if fast else v0
        b0 = old[first + 4, i] if fast else a0
        u1 = state[at.DISPLACEMENT, i]
        v1 = state[at.VELOCITY, i]
        a1 = accelerations[new, i]
        drift = springs[at.DRIFT, i]
        rate_0 = v0 - link * v0_below
        rate_1 = v1 - link * v1_below
        turns[turn, i] = drift
        if on_path or rate_0 * rate_1 < 0.0:
            swing = _SWING * h * (abs(rate_0) + abs(rate_1))
            passing = peaks[top + at.PEAK_DRIFT, i] - abs(drift)
            shearing = (peaks[top + at.PEAK_SHEAR, i] - abs(springs[at.FORCE, i])) / laws[at.STIFFNESS, i]
            if swing > min(passing, shearing):
                bend_0 = a0 - link * a0_below
                bend_1 = a1 - link * a1_below
                calm = not fast or _calm(
                    w0 - link * w0_below, rate_0, rate_1, b0 - link * b0_below, bend_0, bend_1
                )  # fmt: skip
                far = _turning_point(
                    on_path, calm, h, u0 - link * u0_below, rate_0, bend_0, drift, rate_1, bend_1,
                    min(passing, shearing), peaks, top + at.PEAK_DRIFT, i,
                )  # fmt: skip
                # A story that has become stiffer may have its largest shear where its drift is largest.
                if far != drift:
                    turns[turn, i] = far
                    turned += 1
        passing = peaks[top + at.PEAK_DISPLACEMENT, i] - abs(u1)
        if (on_path or v0 * v1 < 0.0) and _SWING * h * (abs(v0) + abs(v1)) > passing:
            calm = not fast or _calm(w0, v0, v1, b0, a0, a1)
            _turning_point(on_path, calm, h, u0, v0, a0, u1, v1, a1, passing, peaks, top + at.PEAK_DISPLACEMENT, i)
        if a0 * a1 < 0.0 and abs(v1) + _SWING * h * (abs(a0) + abs(a1)) > peaks[top + at.PEAK_VELOCITY, i]:
            calm = not fast or _calm(w0, v0, v1, b0, a0, a1)
            _fastest(calm, h, u0, v0, a0, u1, v1, a1, peaks, top, i)
        peak = peaks[top + at.PEAK_ACCELERATION, i]
        absolute_0 = a0 + ground_0
        absolute_1 = a1 + ground_1
        bulge, tilt = _bend(h, u0, v0, a0, u1, v1, a1)
        if (
            2.0 * max(abs(absolute_0), abs(absolute_1)) > peak
            and _most(absolute_0, absolute_1, bulge, tilt) > peak
            and abs(tilt) <= abs(bulge)
        ):
            calm = not fast or _calm(w0, v0, v1, b0, a0, a1)
            _most_accelerated(calm, absolute_0, absolute_1, bulge, tilt, peaks, top, i)
        u0_below = u0
        v0_below = v0
        a0_below = a0
        w0_below = w0
        b0_below = b0
        v1_below = v1
        a1_below = a1
    return turned


@called
def _turning_point(on_path, calm, h, u0, v0, a0, u1, v1, a1, passing, peaks, row, i):
    """Raise a peak of displacement by the extremum between both ends, if it may be more than `passing` beyond u1; that
    is returned, u1 if there is none."""
    if on_path and not _told(calm, h, v0, a0, v1, a1):
        rise = u1 - u0
        bend = h * (v1 - v0)
        if 2.0 * abs(rise) >= abs(bend):
            return u1
        s = 0.5 - rise / bend
        far = u0 + s * (rise + 0.5 * bend * (s - 1.0))
        raise_peak(peaks, row, i, far)
        return far
    if v0 * v1 >= 0.0:
        return u1
    # Bezier points of the quintic, or beyond these, and of the cubic. It turns where it goes at first.
    way = math.copysign(1.0, v0)
    back = way * (u0 - u1)
    early = max(h * abs(v0) / 3.0, 0.4 * h * abs(v0) + 0.05 * h * h * way * a0)
    late = max(h * abs(v1) / 3.0, 0.4 * h * abs(v1) + 0.05 * h * h * way * a1)
    if max(back + early, late) <= passing:
        return u1
    if not _told(calm, h, v0, a0, v1, a1):
        rise = u1 - u0
        bend = 3.0 * rise - h * (2.0 * v0 + v1)
        raise_peak(peaks, row + at.PEAK_ROWS, i, _extreme_of_cubic(u0, h * v0, bend, rise - h * v0 - bend))
        return u1
    c3, c4, c5 = _quintic(h, u0, v0, a0, u1, v1, a1)
    far = _extreme(v0 / (v0 - v1), u0, h * v0, 0.5 * h * h * a0, c3, c4, c5)
    raise_peak(peaks, row, i, far)
    return far


@inlined
def _told(calm, h, v0, a0, v1, a1):
    """Whether both accelerations tell about what the velocities changed by."""
    return calm and abs(v1 - v0 - 0.5 * h * (a0 + a1)) <= _RESOLVED * (abs(v0) + abs(v1))


@called
def _fastest(calm, h, u0, v0, a0, u1, v1, a1, peaks, top, i):
    """Raise the peak of velocity."""
    c3, c4, c5 = _quintic(h, u0, v0, a0, u1, v1, a1)
    bulge, tilt = _bend(h, u0, v0, a0, u1, v1, a1)
    told = calm and _smooth(bulge, tilt, abs(a0) + abs(a1))
    row = top + at.PEAK_VELOCITY + (0 if told else at.PEAK_ROWS)
    # Inside it is no larger than its Bezier points.
    early = v0 + 0.25 * h * a0
    late = v1 - 0.25 * h * a1
    middle = 5.0 * (u1 - u0) / h - (v0 + early + late + v1)
    if max(abs(early), abs(middle), abs(late)) > peaks[row, i]:
        far = _extreme(a0 / (a0 - a1), v0, h * a0, 3.0 * c3 / h, 4.0 * c4 / h, 5.0 * c5 / h, 0.0)
        raise_peak(peaks, row, i, far)


@called
def _most_accelerated(calm, absolute_0, absolute_1, bulge, tilt, peaks, top, i):
    """Raise the peak of absolute acceleration."""
    told = calm and _smooth(bulge, tilt, abs(absolute_0) + abs(absolute_1))
    row = top + at.PEAK_ACCELERATION + (0 if told else at.PEAK_ROWS)
    change = absolute_1 - absolute_0 + bulge + tilt
    raise_peak(peaks, row, i, _extreme_of_cubic(absolute_0, change, -bulge - 3.0 * tilt, 2.0 * tilt))


@inlined
def _bend(h, u0, v0, a0, u1, v1, a1):
    """What the acceleration of the quintic has inside beside the straight line between its ends: s (1 - s) times the
    first of these numbers plus (1 - 2 s) times the second."""
    by_h = 1.0 / h
    tilt = 60.0 * by_h * (by_h * (u1 - u0) - 0.5 * (v0 + v1)) + 5.0 * (a1 - a0)
    return 6.0 * by_h * (v1 - v0) - 3.0 * (a0 + a1), tilt


@inlined
def _most(absolute_0, absolute_1, bulge, tilt):
    """The larger of the absolute acceleration's Bezier points inside: it is no larger than these and its ends."""
    one = abs(2.0 * absolute_0 + absolute_1 + bulge + tilt)
    other = abs(absolute_0 + 2.0 * absolute_1 + bulge - tilt)
    return max(one, other) / 3.0


@inlined
def _smooth(bulge, tilt, size):
    """Whether the acceleration's Bezier points inside lie about on the straight line between both ends."""
    return abs(bulge) + abs(tilt) <= 3.0 * _SMOOTH * size


@inlined
def _calm(w0, v0, v1, b0, a0, a1):
    """Whether velocities and accelerations at the ends of two steps lie about on lines."""
    velocities = abs(v1 - 2.0 * v0 + w0) <= abs(v0) + abs(v1)
    return velocities and abs(a1 - 2.0 * a0 + b0) <= abs(a0) + abs(a1)


@inlined
def _quintic(h, u0, v0, a0, u1, v1, a1):
    """Coefficients of s^3, s^4 and s^5, s in [0, 1], of the quintic with these values, rates and accelerations at its
    ends."""
    rise = u1 - u0 - h * (v0 + 0.5 * h * a0)
    change = h * (v1 - v0 - h * a0)
    bend = 0.5 * h * h * (a1 - a0)
    return 10.0 * rise - 4.0 * change + bend, -15.0 * rise + 7.0 * change - 2.0 * bend, 6.0 * rise - 3.0 * change + bend


@inlined
def _extreme(s, p0, p1, p2, p3, p4, p5):
    """Value of p0 + p1 s + ... + p5 s^5 on [0, 1] where its rate is zero, by Newton's iteration from s."""
    for _ in range(3):
        rate = p1 + s * (2.0 * p2 + s * (3.0 * p3 + s * (4.0 * p4 + s * 5.0 * p5)))
        bend = 2.0 * p2 + s * (6.0 * p3 + s * (12.0 * p4 + s * 20.0 * p5))
        # Not towards an extremum of the other kind
        s -= rate / bend if bend * p1 < 0.0 else 0.0
        s = min(max(s, 0.0), 1.0)
    return p0 + s * (p1 + s * (p2 + s * (p3 + s * (p4 + s * p5))))


@inlined
def _extreme_of_cubic(p0, p1, p2, p3):
    """Value of the largest size of p0 + p1 s + p2 s^2 + p3 s^3 at 0 and at its extrema in [0, 1]."""
    best = p0
    discriminant = p2 * p2 - 3.0 * p1 * p3
    if discriminant >= 0.0:
        root = -(p2 + math.copysign(math.sqrt(discriminant), p2))
        s = root / (3.0 * p3) if p3 != 0.0 else 0.0
        if 0.0 < s < 1.0:
            value = p0 + s * (p1 + s * (p2 + s * p3))
            best = value if abs(value) > abs(best) else best
        s = p1 / root if root != 0.0 else 0.0
        if 0.0 < s < 1.0:
            value = p0 + s * (p1 + s * (p2 + s * p3))
            best = value if abs(value) > abs(best) else best
    return best
