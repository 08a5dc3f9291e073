"""Peaks within a step, or within the piece of one between two changes of branch.

Between both ends a floor moves on the quintic that has its displacement, velocity and acceleration there; drifts are
differences of such. It errs by (omega h)^4 / 1900 of an acceleration with the frequency omega, and by what a step's
displacements miss over h^2: with a method of order 2 that is of the size of what the acceleration changes by in a step.
Beside the straight line between its ends an acceleration has a bulge, which the velocities tell, and a tilt of it,
which needs the displacements. Where the tilt is no larger, the bulge lies on one side of that line, and is taken; where
it is far larger, with methods of order 2 as a rule, displacements do not tell, and the acceleration is largest at an
end. In between a part of both is taken, so that no peak jumps.

It is looked at closely only where a peak could be passed. The observer asks that of all floors without a branch
(`may_pass`, `may_bulge`); of most steps that is all there is to do. Else the displacement (or drift) is looked at where
its rate changes sign, the velocity where the acceleration does, the absolute acceleration where it is at least half its
peak.

Where both accelerations do not tell about what the velocities changed by, or, with modes that the step does not follow,
the rates at the ends of two steps do not lie about on a line, the floor moves otherwise than the interpolant: then
nothing is told, and what the peak might be goes to the rows of doubt. A method whose displacements follow parabolas
tells by these what they do there.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.linear_terms import DASHPOTS, FORCES, force_value
from tdint.kernels.stepping import Ends

_RESOLVED = 0.5  # what a change of velocity may miss the mean acceleration by, over the velocities
_SMOOTH = 1.0  # what an acceleration inside may miss the straight line by, over those at the ends
_NOTHING = Ends(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_UNLOADED = (0.0, 0.0, 0.0, 0.0)  # no forces on floors: of `_loaded`
_FADED = 2.0  # tilt over bulge from which neither is taken; up to 1 all of both is
_SWING = (
    0.5  # of h times the rates at both ends: what a parabola may go beyond the value at its end
)


@inlined
def raise_peak(peaks, row, i, value):
    """Raise a peak to the size of a value."""
    size = abs(value)
    if size > peaks[row, i]:
        peaks[row, i] = size


@inlined
def raise_at_nodes(work, first, column, count, row, i):
    """Raise a peak by what stands in a column of `count` rows from `first` on, and by the parabolas through the first,
    second and third of these, the third, fourth and fifth, and so on, the second being half-way. The first of several
    stands at the start of the step, where the step before has ended."""
    if count == 1:
        raise_peak(work, row, i, work[first, column])
    for k in range(0, count - 2, 2):
        a0, a1, a2 = (
            work[first + k, column],
            work[first + k + 1, column],
            work[first + k + 2, column],
        )
        raise_peak(work, row, i, a1)
        raise_peak(work, row, i, a2)
        b = 0.5 * (4.0 * a1 - 3.0 * a0 - a2)
        c = 0.5 * (a0 - 2.0 * a1 + a2)
        if abs(b + 2.0 * c) < 2.0 * abs(c):
            raise_peak(work, row, i, a0 - 0.25 * b * b / c)


@inlined
def may_pass(span, floor, story, shear, stiffness, peaks, i):
    """Whether a displacement, velocity, drift or shear of floor `i` and its story may pass its peak within a step or at
    its end."""
    swing = _SWING * span.h
    by_story = swing * (abs(story.v0) + abs(story.v1))
    passing = abs(story.u1) + by_story > peaks[at.PEAK_DRIFT, i]
    passing |= abs(shear) + stiffness * by_story > peaks[at.PEAK_SHEAR, i]
    passing |= (
        abs(floor.u1) + swing * (abs(floor.v0) + abs(floor.v1)) > peaks[at.PEAK_DISPLACEMENT, i]
    )
    return passing | may_be_fastest(span, floor, peaks[at.PEAK_VELOCITY, i])


@inlined
def may_be_fastest(span, ends, peak):
    """Whether a velocity or a drift rate may pass its peak."""
    return abs(ends.v1) + _SWING * span.h * (abs(ends.a0) + abs(ends.a1)) > peak


@inlined
def may_bulge(absolute_0, absolute_1, bulge, peak):
    """Whether an absolute acceleration, or masses times such, may pass its peak: as far as bulge and tilt are
    taken, the Bezier points inside (`_most`) are no farther beyond the larger end than this."""
    inside = (2.0 * abs(bulge) - abs(absolute_1 - absolute_0)) / 3.0
    return max(abs(absolute_0), abs(absolute_1)) + max(inside, 0.0) > peak


@called
def look_within(span, scene, passage, springs, turns, turn, peaks, top):
    """Raise the peaks, rows of `peaks` from `top` on, that a step has between its ends.

    Row `turn` of `turns` receives the drift at which a story turns with what may be its largest shear, for others the
    present drift; returns how many there are of these.
    """
    linear_terms = scene.linear_terms
    swing = _SWING * span.h
    with_devices = scene.flags[at.DEVICES] != 0.0
    turned = 0
    n = linear_terms.shape[1] - 1
    above, mass = _NOTHING, 0.0
    loaded = _UNLOADED
    floor = _floor(span.fast, passage, n - 1)
    for i in range(n - 1, -1, -1):
        below = _floor(span.fast, passage, max(i - 1, 0))
        story = _story(floor, below, linear_terms[at.LINK, i], springs[at.DRIFT, i])
        turns[turn, i] = story.u1
        if _turns(span, story):
            stiffness = scene.law_parameters[at.STIFFNESS, i]
            passing = peaks[top + at.PEAK_DRIFT, i] - abs(story.u1)
            shearing = peaks[top + at.PEAK_SHEAR, i] - abs(springs[at.FORCE, i])
            rates = swing * (abs(story.v0) + abs(story.v1))
            if rates > passing or stiffness * rates > shearing:
                far = _turning_point(
                    span, story, min(passing, shearing / stiffness), peaks, top + at.PEAK_DRIFT, i
                )
                # A story that has become stiffer may have its largest shear where its drift is largest.
                if far != story.u1:
                    turns[turn, i] = far
                    turned += 1
        passing = peaks[top + at.PEAK_DISPLACEMENT, i] - abs(floor.u1)
        if _turns(span, floor) and swing * (abs(floor.v0) + abs(floor.v1)) > passing:
            _turning_point(span, floor, passing, peaks, top + at.PEAK_DISPLACEMENT, i)
        if floor.a0 * floor.a1 < 0.0 and may_be_fastest(
            span, floor, peaks[top + at.PEAK_VELOCITY, i]
        ):
            _fastest(span, floor, peaks, top + at.PEAK_VELOCITY, i)
        fastest = peaks[top + at.PEAK_DRIFT_RATE, i]
        if (
            DASHPOTS
            and with_devices
            and story.a0 * story.a1 < 0.0
            and may_be_fastest(span, story, fastest)
        ):
            _fastest(span, story, peaks, top + at.PEAK_DRIFT_RATE, i)
        if not span.cornered:
            _most_accelerated(span, floor, 1.0, peaks, top + at.PEAK_ACCELERATION, i, _UNLOADED)
            above, mass = _moved(linear_terms, i, floor, above, mass)
            if FORCES and scene.forces.shape[0] > 0:
                loaded = _loaded(span, scene.forces, linear_terms[at.LINK, i + 1], i, loaded)
            _most_accelerated(span, above, mass, peaks, top + at.PEAK_TOTAL_SHEAR, i, loaded)
        floor = below
    return turned


@inlined
def _floor(fast, passage, i):
    """Floor `i` at both ends of a step."""
    old, first, state, accelerations, new = passage
    v0 = old[first + 1, i]
    a0 = old[first + 2, i]
    w = old[first + 3, i] if fast else v0
    b = old[first + 4, i] if fast else a0
    return Ends(
        old[first, i],
        v0,
        a0,
        state[at.DISPLACEMENT, i],
        state[at.VELOCITY, i],
        accelerations[new, i],
        w,
        b,
    )


@inlined
def _story(floor, below, link, drift):
    """The story between a floor and the one below."""
    return Ends(
        u0=floor.u0 - link * below.u0,
        v0=floor.v0 - link * below.v0,
        a0=floor.a0 - link * below.a0,
        u1=drift,
        v1=floor.v1 - link * below.v1,
        a1=floor.a1 - link * below.a1,
        w=floor.w - link * below.w,
        b=floor.b - link * below.b,
    )


@inlined
def _moved(linear_terms, i, floor, above, mass):
    """Motion times mass of floor `i` and all above, of which that of those above is given; and their mass."""
    link, floor_mass = linear_terms[at.LINK, i + 1], linear_terms[at.MASS, i]
    ends = Ends(
        u0=link * above.u0 + floor_mass * floor.u0,
        v0=link * above.v0 + floor_mass * floor.v0,
        a0=link * above.a0 + floor_mass * floor.a0,
        u1=link * above.u1 + floor_mass * floor.u1,
        v1=link * above.v1 + floor_mass * floor.v1,
        a1=link * above.a1 + floor_mass * floor.a1,
        w=link * above.w + floor_mass * floor.w,
        b=link * above.b + floor_mass * floor.b,
    )
    return ends, link * mass + floor_mass


@inlined
def _turns(span, ends):
    """Whether a displacement has an extremum inside the step."""
    bends = 2.0 * abs(ends.u1 - ends.u0) < span.h * abs(ends.v1 - ends.v0)
    return (span.on_path & bends) | (ends.v0 * ends.v1 < 0.0)


@called
def _turning_point(span, ends, passing, peaks, row, i):
    """Raise a peak of displacement by the extremum between both ends, if it may be more than `passing` beyond u1; that
    is returned, u1 if there is none."""
    h = span.h
    u0, v0, a0, u1, v1, a1, _, _ = ends
    # Both accelerations tell about what the velocities changed by.
    told = _calm(span, ends) and abs(v1 - v0 - 0.5 * h * (a0 + a1)) <= _RESOLVED * (
        abs(v0) + abs(v1)
    )
    if span.on_path and not told:
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
    if not told:
        rise = u1 - u0
        bend = 3.0 * rise - h * (2.0 * v0 + v1)
        raise_peak(
            peaks, row + at.PEAK_ROWS, i, _extreme_of_cubic(u0, h * v0, bend, rise - h * v0 - bend)
        )
        return u1
    c3, c4, c5 = _quintic(h, ends)
    far = _extreme(v0 / (v0 - v1), (u0, h * v0, 0.5 * h * h * a0, c3, c4, c5))
    raise_peak(peaks, row, i, far)
    return far


@called
def _fastest(span, ends, peaks, peak_row, i):
    """Raise the peak of a velocity or a drift rate."""
    h = span.h
    u0, v0, a0, u1, v1, a1, _, _ = ends
    c3, c4, c5 = _quintic(h, ends)
    bulge, tilt = _bend(h, ends)
    told = _calm(span, ends) and _smooth(bulge, tilt, abs(a0) + abs(a1))
    row = peak_row + (0 if told else at.PEAK_ROWS)
    # Inside it is no larger than its Bezier points.
    early = v0 + 0.25 * h * a0
    late = v1 - 0.25 * h * a1
    middle = 5.0 * (u1 - u0) / h - (v0 + early + late + v1)
    if max(abs(early), abs(middle), abs(late)) > peaks[row, i]:
        far = _extreme(a0 / (a0 - a1), (v0, h * a0, 3.0 * c3 / h, 4.0 * c4 / h, 5.0 * c5 / h, 0.0))
        raise_peak(peaks, row, i, far)


@inlined
def _most_accelerated(span, ends, mass, peaks, peak_row, i, loaded):
    """Raise the peak of an absolute acceleration, or of masses times such less the forces on them, if it may be
    passed."""
    peak = peaks[peak_row, i]
    absolute_0 = ends.a0 + mass * span.ground_0 - loaded[0]
    absolute_1 = ends.a1 + mass * span.ground_1 - loaded[1]
    bulge, tilt = _bend(span.h, ends)
    near = 2.0 * max(abs(absolute_0), abs(absolute_1)) > peak
    if near and abs(tilt) < _FADED * abs(bulge):
        taken = min((_FADED - abs(tilt / bulge)) / (_FADED - 1.0), 1.0)
        bulge = bulge * taken - loaded[2]
        tilt = tilt * taken - loaded[3]
    else:
        near = False
    if near and _most(absolute_0, absolute_1, bulge, tilt) > peak:
        told = _calm(span, ends) and _smooth(bulge, tilt, abs(absolute_0) + abs(absolute_1))
        row = peak_row + (0 if told else at.PEAK_ROWS)
        change = absolute_1 - absolute_0 + bulge + tilt
        raise_peak(
            peaks, row, i, _extreme_of_cubic(absolute_0, change, -bulge - 3.0 * tilt, 2.0 * tilt)
        )


@called
def _loaded(span, forces, link, i, above):
    """Forces on floor `i` and those above, of which the latter are given: at both ends of the step, and their bulge and
    tilt between, by their values at quarters of it."""
    t, h = span.t, span.h
    p0 = link * above[0]
    p1 = link * above[1]
    bulge = link * above[2]
    tilt = link * above[3]
    for j in range(forces.shape[0]):
        if forces[j, at.FLOOR] == i:
            f0 = force_value(forces, j, t - h)
            f1 = force_value(forces, j, t)
            first = force_value(forces, j, t - 0.75 * h) - 0.75 * f0 - 0.25 * f1
            last = force_value(forces, j, t - 0.25 * h) - 0.25 * f0 - 0.75 * f1
            p0 += f0
            p1 += f1
            bulge += 8.0 / 3.0 * (first + last)
            tilt += 16.0 / 3.0 * (first - last)
    return p0, p1, bulge, tilt


@inlined
def _bend(h, ends):
    """What the acceleration of the quintic has inside beside the straight line between its ends: s (1 - s) times the
    bulge, (1 - 2 s) times the tilt of it."""
    u0, v0, a0, u1, v1, a1, _, _ = ends
    by_h = 1.0 / h
    tilt = 60.0 * by_h * (by_h * (u1 - u0) - 0.5 * (v0 + v1)) + 5.0 * (a1 - a0)
    return bulge(by_h, ends), tilt


@inlined
def bulge(by_h, ends):
    """The bulge of the acceleration over a step of 1 / by_h."""
    return 6.0 * by_h * (ends.v1 - ends.v0) - 3.0 * (ends.a0 + ends.a1)


@inlined
def _most(absolute_0, absolute_1, bulge, tilt):
    """The larger of the absolute acceleration's Bezier points inside: it is no larger than these and its ends."""
    first = abs(2.0 * absolute_0 + absolute_1 + bulge + tilt)
    other = abs(absolute_0 + 2.0 * absolute_1 + bulge - tilt)
    return max(first, other) / 3.0


@inlined
def _smooth(bulge, tilt, size):
    """Whether the acceleration's Bezier points inside lie about on the straight line between both ends."""
    return abs(bulge) + abs(tilt) <= 3.0 * _SMOOTH * size


@inlined
def _calm(span, ends):
    """Whether velocities and accelerations at the ends of two steps lie about on lines, in a fast span."""
    velocities = abs(ends.v1 - 2.0 * ends.v0 + ends.w) <= abs(ends.v0) + abs(ends.v1)
    accelerations = abs(ends.a1 - 2.0 * ends.a0 + ends.b) <= abs(ends.a0) + abs(ends.a1)
    return not span.fast or (velocities and accelerations)


@inlined
def _quintic(h, ends):
    """Coefficients of s^3, s^4 and s^5, s in [0, 1], of the quintic with these values, rates and accelerations at its
    ends."""
    u0, v0, a0, u1, v1, a1, _, _ = ends
    rise = u1 - u0 - h * (v0 + 0.5 * h * a0)
    change = h * (v1 - v0 - h * a0)
    bend = 0.5 * h * h * (a1 - a0)
    return (
        10.0 * rise - 4.0 * change + bend,
        -15.0 * rise + 7.0 * change - 2.0 * bend,
        6.0 * rise - 3.0 * change + bend,
    )


@inlined
def _extreme(s, coefficients):
    """Value of p0 + p1 s + ... + p5 s^5 on [0, 1] where its rate is zero, by Newton's iteration from s."""
    p0, p1, p2, p3, p4, p5 = coefficients
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
