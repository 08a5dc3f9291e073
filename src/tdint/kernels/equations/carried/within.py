"""Peaks that the corrected motion has within a step.

Nodes are the ends of the step, where stories turn or change their branches, and even numbers of equal parts between.
There the companion's path, bubbles included, tells the forces of the stories, and equilibrium the accelerations. Over
each two parts both are quadratic; what accelerations integrate to, and a line of them that brings that to where the
corrected motion arrives, are velocities and displacements. Where a story changes its branch, of which the bubbles do
not know, the forces are taken once more where these lead.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.carried.rows import (
    OWN,
    Carried,
    bubbles_of,
    corrected,
    relative,
    story_of,
    surely_keeps,
    turns_of,
    whole_path,
)
from tdint.kernels.equations.moment4 import ROW
from tdint.kernels.laws.choosing import BENDING, DISSIPATING
from tdint.kernels.linear_terms import (
    DASHPOTS,
    FORCES,
    MODAL,
    add_modal_force,
    force_second,
    force_value,
    power_damper,
)
from tdint.kernels.march.peaks_between_steps import raise_at_nodes, raise_peak
from tdint.kernels.stepping import Integrals
from tdint.kernels.stories import error_path, path
from tdint.kernels.stories.error_path import RESULT

_EVENTS = 10  # that become nodes: stories of a tall building yield together
_PAIRS = (3.0, 2.0)  # of equal parts in a step, and in a calm one

# What values may go beyond where a parabola turns: parts of the change of their rate, and of the even bubble, of which
# the acceleration's bulge is 360 times.
_TURN = 0.03
_BULGE = 10.0
_BULGES = _BULGE + 60.0
# Where the slope of a force jumps within a step, its part of the change over the step that goes beyond line and bulge.
_CORNER = 0.07

# Of a step, by which bubbles may move the end of a branch
_NEARBY = 0.1

_OF_MOTION = (at.PEAK_DISPLACEMENT, at.PEAK_VELOCITY, at.PEAK_DRIFT, at.PEAK_DRIFT_RATE)
_AT_NODES = (at.PEAK_ACCELERATION, at.PEAK_TOTAL_SHEAR, at.PEAK_SHEAR)


@inlined
def _corner(carried, i):
    """h^2 times what the force of story `i` may go beyond line and bulge where it leaves its branch; the story that
    stands above the last one has none."""
    scene, memory, _, h, base = carried
    n = scene.linear_terms.shape[1] - 1
    if i >= n or memory.work[base + OWN.CALM, i] != 0.0:
        return 0.0
    slope = scene.law_parameters[at.STIFFNESS, i]
    for block in range(2):
        other = abs(memory.springs[block * at.FIRST_TRIAL + at.SLOPE, n + 1 + i])
        slope = max(slope, other) if other < math.inf else slope
    story = story_of(carried, i)
    return _CORNER * h * h * slope * (abs(story.rise) + 0.5 * abs(story.bend))


class _Moved(NamedTuple):
    """h^2 times what moves a floor and all above: masses times accelerations less the forces on them. At both ends of
    the step about, and its even bubble."""

    start: float
    end: float
    even: float


@inlined
def _of_ground(carried):
    """What the floors' even bubbles leave out of the ground's, in a step over several samples: accelerations are
    looked for where they are absolute."""
    return 0.5 * carried.h * carried.h * carried.load[at.GROUND_2]


@inlined
def _moved(carried, i, above):
    """Floor `i` with all above, of which those above it are given; the rows OTHER hold what `_floor_forces` found."""
    scene, memory, load, h, base = carried
    work = memory.work
    link, mass = scene.linear_terms[at.LINK, i + 1], scene.linear_terms[at.MASS, i]
    half = 0.5 * work[base + OWN.A1, i]
    start = link * above.start + mass * (work[ROW.BEND, i] - half + h * h * load[at.GROUND_0])
    end = link * above.end + mass * (work[ROW.BEND, i] + half + h * h * load[at.GROUND_1])
    even = link * above.even + mass * (work[base + OWN.EVEN, i] + _of_ground(carried))
    if FORCES and scene.forces.shape[0] > 0:
        start -= work[base + OWN.OTHER, i]
        end -= work[base + OWN.OTHER + 1, i]
        even -= work[base + OWN.OTHER + 2, i]
    return _Moved(start, end, even)


@inlined
def _floor_forces(carried):
    """h^2 times the forces on floors at both ends of the step, and their part of even bubbles, into the rows OTHER."""
    scene, memory, load, h, base = carried
    work, forces = memory.work, scene.forces
    for i in range(scene.linear_terms.shape[1] - 1):
        work[base + OWN.OTHER, i] = 0.0
        work[base + OWN.OTHER + 1, i] = 0.0
        work[base + OWN.OTHER + 2, i] = 0.0
    for j in range(forces.shape[0]):
        floor = int(forces[j, at.FLOOR])
        for end in range(2):
            work[base + OWN.OTHER + end, floor] += h * h * force_value(forces, j, load[at.TIME] + end * h)
        work[base + OWN.OTHER + 2, floor] += h * h / 360.0 * force_second(forces, j, load[at.TIME], h)


@inlined
def comes_near(carried, calm):
    """Whether anything may come near its peak within the step, whose state is still that at its start; and whether all
    stories of the companion keep to their branches.

    In most steps nothing does.
    """
    scene, memory, load, h, base = carried
    linear_terms = scene.linear_terms
    _, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    square = h * h
    ground = 0.5 * square * (load[at.GROUND_0] + load[at.GROUND_1])
    jerk = square * (load[at.GROUND_1] - load[at.GROUND_0])
    peaks = base + OWN.PEAKS
    near = False
    still = True
    moved = _Moved(0.0, 0.0, 0.0)
    floor = corrected(carried, n - 1)
    if FORCES and scene.forces.shape[0] > 0:
        _floor_forces(carried)
    for i in range(n - 1, -1, -1):
        below = corrected(carried, max(i - 1, 0))
        story = relative(floor, below, linear_terms[at.LINK, i])
        a1 = work[base + OWN.A1, i]
        a0 = work[ROW.BEND, i] - 0.5 * a1
        even = abs(work[base + OWN.EVEN, i])
        # Few turn, so that asking first is faster
        if _turns(floor):
            near |= _comes_near(floor.u, floor.v, floor.bend, 0.0, work[peaks + at.PEAK_DISPLACEMENT, i])
        if a0 * (a0 + a1) <= 0.0:
            near |= _comes_near(floor.v, a0, a1, _BULGE * even, h * work[peaks + at.PEAK_VELOCITY, i])
        a = work[ROW.BEND, i] + ground
        a1 += jerk
        corner = 0.0 if calm else _corner(carried, i)
        corner_above = 0.0 if calm else linear_terms[at.LINK, i + 1] * _corner(carried, i + 1)
        more = linear_terms[at.INVERSE_MASS, i] * (corner + corner_above)
        even = abs(work[base + OWN.EVEN, i] + _of_ground(carried))
        near |= abs(a) + 0.5 * abs(a1) + _BULGES * even + more > square * work[peaks + at.PEAK_ACCELERATION, i]
        moved = _moved(carried, i, moved)
        most = max(abs(moved.start), abs(moved.end)) + _BULGES * abs(moved.even) + corner
        near |= most > square * work[peaks + at.PEAK_TOTAL_SHEAR, i]
        if _turns(story):
            start = springs[at.DRIFT, n + 1 + i]
            near |= _comes_near(start, story.v, story.bend, 0.0, work[peaks + at.PEAK_DRIFT, i])
            if BENDING:
                force, slope = springs[at.FORCE, n + 1 + i], springs[at.SLOPE, n + 1 + i]
                slope = slope if slope < math.inf else 0.0
                near |= _comes_near(force, slope * story.v, slope * story.bend, 0.0, work[peaks + at.PEAK_SHEAR, i])
        if BENDING:
            still &= surely_keeps(carried, i, story)
        if DASHPOTS and scene.flags[at.DEVICES] != 0.0:
            fastest = max(abs(story.v), abs(story.v + story.bend))
            near |= fastest > 0.8 * h * work[peaks + at.PEAK_DRIFT_RATE, i]
        floor = below
    return near, still


@inlined
def _comes_near(value, rate, change, more, peak):
    """Whether a value comes near a peak where its rate, which changes by `change` over the step, is zero: half the
    change is the most that a parabola goes back from there. A little more, and `more`, is allowed for."""
    size = abs(change)
    return (rate * (rate + change) <= 0.0) & (abs(value + rate + 0.5 * change) + (0.5 + _TURN) * size + more > peak)


@called
def passes(scene, h, load, memory, base, calm):
    """What may pass its peak within the step, if anything comes near one: nothing (0), accelerations or total shears at
    its end (1), something inside (2), and accelerations or total shears besides (3); and the first and the last floor
    of which something does."""
    carried = Carried(scene, memory, load, h, base)
    linear_terms = scene.linear_terms
    _, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    square = h * h
    peaks = base + OWN.PEAKS
    turning = ending = shaking = False
    low, high = n, -1
    moved = _Moved(0.0, 0.0, 0.0)
    for i in range(n - 1, -1, -1):
        floor = corrected(carried, i)
        story = relative(floor, corrected(carried, max(i - 1, 0)), linear_terms[at.LINK, i])
        here = _turns(floor) & _beyond(floor.u, floor.v, floor.bend, 0.0, work[peaks + at.PEAK_DISPLACEMENT, i])
        a0 = work[ROW.BEND, i] - 0.5 * work[base + OWN.A1, i]
        a1 = work[ROW.BEND, i] + 0.5 * work[base + OWN.A1, i]
        more = _BULGE * abs(work[base + OWN.EVEN, i])
        here |= (a0 * a1 <= 0.0) & _beyond(floor.v, a0, a1 - a0, more, h * work[peaks + at.PEAK_VELOCITY, i])
        a0 += square * load[at.GROUND_0]
        a1 += square * load[at.GROUND_1]
        corner = 0.0 if calm else _corner(carried, i)
        corner_above = 0.0 if calm else linear_terms[at.LINK, i + 1] * _corner(carried, i + 1)
        more = linear_terms[at.INVERSE_MASS, i] * (corner + corner_above)
        peak = square * work[peaks + at.PEAK_ACCELERATION, i] - more
        beyond, inside = _bulges(a0, a1, work[base + OWN.EVEN, i] + _of_ground(carried), peak)
        shaking |= beyond | inside
        here |= inside
        end = beyond
        moved = _moved(carried, i, moved)
        peak = square * work[peaks + at.PEAK_TOTAL_SHEAR, i] - corner
        beyond, inside = _bulges(moved.start, moved.end, moved.even, peak)
        shaking |= beyond | inside
        here |= inside
        end |= beyond
        passed = _beyond(springs[at.DRIFT, n + 1 + i], story.v, story.bend, 0.0, work[peaks + at.PEAK_DRIFT, i])
        force, slope = springs[at.FORCE, n + 1 + i], springs[at.SLOPE, n + 1 + i]
        passed |= _beyond(force, slope * story.v, slope * story.bend, 0.0, work[peaks + at.PEAK_SHEAR, i])
        here |= _turns(story) & passed
        if DASHPOTS and scene.flags[at.DEVICES] != 0.0:
            fastest = max(abs(story.v), abs(story.v + story.bend))
            here |= fastest >= 0.8 * h * work[peaks + at.PEAK_DRIFT_RATE, i]
        turning |= here
        ending |= end
        low = i if here | end else low
        high = max(high, i) if here | end else high
    return (3 if shaking else 2) if turning else 1 if ending else 0, low, high


@inlined
def _turns(motion):
    """Whether a parabola turns within the step."""
    return motion.v * (motion.v + motion.bend) <= 0.0


@inlined
def _beyond(value, rate, change, more, peak):
    """Whether a value may pass a peak where its rate, which changes by `change` over the step, is zero: on a parabola
    that is at value + rate |rate| / (2 |change|). A little more, and `more`, is allowed for."""
    size = abs(change)
    return abs(value * size + 0.5 * rate * abs(rate)) + _TURN * size * size >= (peak - more) * size


@inlined
def _bulges(a0, a1, even, peak):
    """Whether a value that goes from about a0 to a1 may pass a peak at the end, and whether it turns away from zero
    inside and may there; its bulge is 360 times the even bubble."""
    bulge = abs(360.0 * even)
    middle = abs(a0 + a1) * 0.5 + _BULGE * abs(even) - peak
    change = abs(a1 - a0)
    inside = (middle + bulge / 12.0) * bulge + 0.25 * change * change >= 0.0
    inside &= (change <= 1.3 * bulge) & ((a0 + a1) * even <= 0.0)
    return middle + 0.5 * change + bulge / 6.0 >= 0.0, inside


@called
def look_within(scene, h, load, memory, base, calm, passing):
    """Raise the peaks of what may pass them (`passes`). `calm`: all stories keep to their linear branches."""
    kind, low, high = passing
    turning = kind > 1
    carried = Carried(scene, memory, load, h, base)
    work = memory.work
    n = scene.linear_terms.shape[1] - 1
    count = _place(carried, calm, turning)
    by_h = 1.0 / h
    # The bubbles know of no corner inside: where accelerations may have a peak they are followed once more.
    again = BENDING and not calm and kind > (1 if DASHPOTS else 2)
    first, last = (0, n - 1) if again else (low, high)
    for i in range(0 if MODAL else max(first - 2, 0), n):
        floor, even, odd = corrected(carried, i), work[base + OWN.EVEN, i], work[base + OWN.ODD, i]
        for k in range(count):
            work[base + OWN.MOTION + k, i] = by_h * _rate(floor, even, odd, work[base + OWN.FORCES + k, n])
    for i in range(max(first - 1, 0), min(last + 2, n)):
        still = not BENDING or calm or work[base + OWN.CALM, i] != 0.0
        _force(carried, i, still, count)
    for k in range(count):
        _accelerate(carried, k, first, last, not again)
    if again:
        _follow_accelerations(carried, count)
        for k in range(count):
            _accelerate(carried, k, first, last, True)
    peaks = base + OWN.PEAKS
    for i in range(low, high + 1):
        still = not BENDING or calm or work[base + OWN.CALM, i] != 0.0
        for given in range(2):
            if turning:
                link = scene.linear_terms[at.LINK, i] if given > 0 else 0.0
                sheared = still and given > 0
                _move(carried, i, link, sheared, count, _OF_MOTION[2 * given], _OF_MOTION[2 * given + 1])
        for given in range(2 if still else 3):
            column = i if given == 1 else n + 1 + i
            first = base + (OWN.MOTION if given == 0 else OWN.FORCES)
            raise_at_nodes(work, first, column, count, peaks + _AT_NODES[given], i)


@inlined
def _place(carried, calm, turning):
    """Put the times of the nodes in their places; returns how many there are. One at the end if nothing turns."""
    base, work = carried.base, carried.memory.work
    n = carried.scene.linear_terms.shape[1] - 1
    if not turning:
        work[base + OWN.FORCES, n] = 1.0
        return 1
    row = base + OWN.MOTION  # events go here at first
    events = 0
    if BENDING and not calm:
        for i in range(n):
            if work[base + OWN.CALM, i] == 0.0:
                out = base + OWN.PATH
                times = (
                    turns_of(carried, i, bubbles_of(carried, i)[0])[1],
                    work[out + RESULT.EVENT, n + 1 + i],
                    work[out + RESULT.LAST_EVENT, n + 1 + i],
                )
                for which in range(3):
                    t = times[which]
                    if which == 2 and t == times[1]:
                        continue
                    if which > 0 and 0.0 < t < 1.0:
                        t = _moved_by_bubbles(carried, i, t)
                    if 0.0 < t < 1.0 and events < _EVENTS:
                        at_place = events
                        while at_place > 0 and work[row + at_place - 1, n] > t:
                            work[row + at_place, n] = work[row + at_place - 1, n]
                            at_place -= 1
                        work[row + at_place, n] = t
                        events += 1
    row = base + OWN.FORCES
    work[row, n] = 0.0
    count = 1
    begin = 0.0
    for event in range(events + 1):
        end = work[base + OWN.MOTION + event, n] if event < events else 1.0
        if end - begin > 1e-9:
            parts = 2 * math.ceil(_PAIRS[int(calm)] * (end - begin))
            for part in range(1, parts + 1):
                work[row + count, n] = begin + (end - begin) * part / parts if part < parts else end
                count += 1
            begin = end
    return count


@inlined
def _moved_by_bubbles(carried, i, t):
    """When story `i` reaches the end of a branch that its parabola reaches at `t`: its bubbles lead it there sooner or
    later. Where it goes too slowly for a first order to tell, `t` stays."""
    whole, s = whole_path(carried, i), t - 0.5
    bubbles = bubbles_of(carried, i)
    rate = whole.rise + whole.bend * s
    rate += 120.0 * s * (s * s - 0.25) * bubbles[0] + (2.5 - 30.0 * s * s) * bubbles[1]
    off = error_path.bubble(bubbles, s)
    return t - off / rate if abs(off) < _NEARBY * abs(rate) else t


@called
def _follow_accelerations(carried, count):
    """Forces of the stories at the nodes, and velocities of the floors, where the accelerations there lead: ways and
    rates beyond those of the path at first, then what they add to the forces."""
    scene, memory, _, h, base = carried
    work = memory.work
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    row, by_h = base + OWN.MOTION, 1.0 / h
    for i in range(n):
        _integrate(carried, i, count)
    for i in range(n):
        link, below = linear_terms[at.LINK, i], max(i - 1, 0)
        for k in range(count):
            way = _relative(work, row + k, i, link)
            rate = by_h * (work[row + k, n + 1 + i] - link * work[row + k, n + 1 + below])
            spring = work[base + OWN.SLOPES + k, i] * way
            more = linear_terms[at.GEOMETRIC, i] * way + linear_terms[at.STORY_DAMPER, i] * rate
            if DASHPOTS:
                before = by_h * _relative_rate(carried, i, work[base + OWN.FORCES + k, n])
                more += power_damper(linear_terms, i, before + rate)[0] - power_damper(linear_terms, i, before)[0]
            work[base + OWN.FORCES + k, n + 1 + i] += spring
            work[base + OWN.FORCES + k, i] += spring + more
    for i in range(n):
        floor, even, odd = corrected(carried, i), work[base + OWN.EVEN, i], work[base + OWN.ODD, i]
        for k in range(count):
            before = _rate(floor, even, odd, work[base + OWN.FORCES + k, n])
            work[row + k, i] = by_h * (before + work[row + k, n + 1 + i])


@inlined
def _relative_rate(carried, i, t):
    """h times the drift rate of story `i` on the companion's path."""
    even, odd = bubbles_of(carried, i)
    return _rate(story_of(carried, i), even, odd, t)


@inlined
def _integrate(carried, i, count):
    """Where the accelerations of floor `i` at the nodes lead, in the rows MOTION: its way beyond that of the path in
    their place, h times its rate beyond that in column n + 1 + i. A line of accelerations brings it to where the step
    does."""
    _, memory, _, h, base = carried
    work = memory.work
    n = carried.scene.linear_terms.shape[1] - 1
    floor = corrected(carried, i)
    square = h * h
    row = base + OWN.MOTION
    even, odd = work[base + OWN.EVEN, i], work[base + OWN.ODD, i]
    way, rate, a2 = 0.0, floor.v, square * work[row, i]
    work[row, i], work[row, n + 1 + i] = way, rate
    for k in range(0, count - 2, 2):
        d = work[base + OWN.FORCES + k + 1, n] - work[base + OWN.FORCES + k, n]
        a0, a1, a2 = a2, square * work[row + k + 1, i], square * work[row + k + 2, i]
        work[row + k + 1, i] = way + d * rate + d * d * (3.5 * a0 + 3.0 * a1 - 0.5 * a2) / 12.0
        work[row + k + 1, n + 1 + i] = rate + d * (5.0 * a0 + 8.0 * a1 - a2) / 12.0
        way += 2.0 * d * rate + d * d * (2.0 * a0 + 4.0 * a1) / 3.0
        rate += d * (a0 + 4.0 * a1 + a2) / 3.0
        work[row + k + 2, i], work[row + k + 2, n + 1 + i] = way, rate
    level = floor.v + floor.bend - rate
    tilt = 12.0 * (0.5 * level - (floor.rise - way))
    for k in range(count):
        t = work[base + OWN.FORCES + k, n]
        path_way = t * (floor.rise + 0.5 * floor.bend * (t - 1.0)) + error_path.bubble((even, odd), t - 0.5)
        work[row + k, i] += t * t * (0.5 * level + tilt * (t / 6.0 - 0.25)) - path_way
        work[row + k, n + 1 + i] += t * (level + 0.5 * tilt * (t - 1.0)) - _rate(floor, even, odd, t)


@inlined
def _force(carried, i, still, count):
    """Forces of story `i` at the nodes: of its spring alone, and with dampers and P-delta."""
    scene, memory, _, _, base = carried
    _, springs, work, _ = memory
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    c = n + 1 + i
    whole = whole_path(carried, i)
    bubbles = bubbles_of(carried, i)
    damper, geometric = linear_terms[at.STORY_DAMPER, i], linear_terms[at.GEOMETRIC, i]
    link = linear_terms[at.LINK, i]
    results = Integrals(work, base + OWN.PATH)
    past = 0
    here = 0.0
    turned = (0.0, 1.0, 1.0, 1.0, math.inf)
    if BENDING and not still:
        turned = turns_of(carried, i, bubbles[0])
        error_path.set_out(springs, c)
    for k in range(count):
        t = work[base + OWN.FORCES + k, n]
        force = springs[at.FORCE, c]
        drift = path.drift_at(whole, t) + error_path.bubble(bubbles, t - 0.5)
        slope = springs[at.SLOPE, c]
        if not BENDING or still:
            force += slope * (drift - whole.start)
        elif t > here:
            force, past = error_path.go_on(
                scene.law_parameters, springs, c, path.part_of(whole, here, t), bubbles, turned, past, results
            )
            slope = springs[at.FIRST_TRIAL + at.SLOPE, c] if slope < math.inf else slope
        here = t
        work[base + OWN.SLOPES + k, i] = slope if slope < math.inf else 0.0
        rate = work[base + OWN.MOTION + k, i] - link * work[base + OWN.MOTION + k, max(i - 1, 0)]
        work[base + OWN.FORCES + k, c] = force
        work[base + OWN.FORCES + k, i] = (
            force + geometric * drift + damper * rate + power_damper(linear_terms, i, rate)[0]
        )
    if BENDING and not still and scene.law_parameters[at.CODE, c] in DISSIPATING:
        # Its state at the last Gauss point, which the nodes have moved
        error_path.follow(scene.law_parameters, springs, c, whole, bubbles, turned, results)


@inlined
def _rate(floor, even, odd, t):
    """h times the velocity of a floor on the companion's path, from the factors of its bubbles."""
    s = t - 0.5
    return floor.rise + s * floor.bend + 120.0 * s * (s * s - 0.25) * even + (2.5 - 30.0 * s * s) * odd


@inlined
def _accelerate(carried, k, low, high, last_time):
    """Accelerations at node `k` from equilibrium, of floors `low` - 1 to `high`; at the last time total shears in place
    of the forces of the stories."""
    scene, memory, load, h, base = carried
    linear_terms, modal, _, forces, _ = scene
    work = memory.work
    n = linear_terms.shape[1] - 1
    row = base + OWN.FORCES + k
    motion = base + OWN.MOTION + k
    t = work[row, n]
    s = t - 0.5
    ground = load[at.GROUND_0] + t * (load[at.GROUND_1] - load[at.GROUND_0])
    # Beyond the line, in a step over several samples
    ground += 180.0 * load[at.GROUND_2] * (s * s - 1.0 / 12.0) + 2800.0 * load[at.GROUND_3] * s * (s * s - 0.15)
    work[motion, n] = ground
    if MODAL or FORCES:
        for i in range(n):
            work[base + OWN.OTHER, i] = 0.0
            work[base + OWN.OTHER + 1, i] = 0.0
        add_modal_force(modal, work, motion, 1.0, work, base + OWN.OTHER, n)
        for j in range(forces.shape[0]):
            work[base + OWN.OTHER + 1, int(forces[j, at.FLOOR])] += force_value(forces, j, load[at.TIME] + t * h)
    damped = before = 0.0
    for i in range(n - 1, max(low - 1, 0) - 1, -1):
        link = linear_terms[at.LINK, i + 1]
        own = linear_terms[at.FLOOR_DAMPER, i] * work[motion, i]
        if MODAL:
            own += work[base + OWN.OTHER, i]
        damped = link * damped + own
        if i > high + 1:
            continue
        story = work[row, i]
        inner = link * before - story - own
        if FORCES:
            inner += work[base + OWN.OTHER + 1, i]
        a = linear_terms[at.INVERSE_MASS, i] * inner
        work[motion, n + 1 + i] = a
        work[motion, i] = a - ground
        before = story
        if last_time:
            work[row, i] = story + damped


@inlined
def _move(carried, i, link, still, count, peak, fastest):
    """Raise the peaks of displacement and velocity of floor `i`, or with a link of its drift and drift rate, and of the
    shear of a story that keeps to a linear branch (`still`)."""
    _, memory, _, h, base = carried
    _, springs, work, _ = memory
    n = carried.scene.linear_terms.shape[1] - 1
    below = max(i - 1, 0)
    square = h * h
    u, v, rise, bend = relative(corrected(carried, i), corrected(carried, below), link)
    row = base + OWN.MOTION
    goes_far = _comes_near(u, v, bend, 0.0, work[base + OWN.PEAKS + peak, i])
    if BENDING and still:
        slope = springs[at.SLOPE, n + 1 + i]
        peak_shear = work[base + OWN.PEAKS + at.PEAK_SHEAR, i]
        goes_far |= _comes_near(springs[at.FORCE, n + 1 + i], slope * v, slope * bend, 0.0, peak_shear)
    goes_fast = False
    if DASHPOTS or fastest == at.PEAK_VELOCITY:
        before, after = _relative(work, row, i, link), _relative(work, row + count - 1, i, link)
        even = abs(work[base + OWN.EVEN, i]) + link * abs(work[base + OWN.EVEN, below])
        most = max(abs(v), abs(v + bend)) + 0.25 * square * abs(after - before) + _BULGE * even
        goes_fast = (before * after <= 0.0) & (most > 0.8 * h * work[base + OWN.PEAKS + fastest, i])
    if not (goes_far or goes_fast):
        return
    far, fast = 0.0, v
    for k in range(0, count - 2, 2):
        d = work[base + OWN.FORCES + k + 1, n] - work[base + OWN.FORCES + k, n]
        a0 = square * _relative(work, row + k, i, link)
        a1 = square * _relative(work, row + k + 1, i, link)
        a2 = square * _relative(work, row + k + 2, i, link)
        far += 2.0 * d * fast + d * d * (2.0 * a0 + 4.0 * a1) / 3.0
        fast += d * (a0 + 4.0 * a1 + a2) / 3.0
    level = v + bend - fast
    tilt = 12.0 * (0.5 * level - (rise - far))
    peaks = base + OWN.PEAKS
    raise_peak(work, peaks + peak, i, u)
    raise_peak(work, peaks + fastest, i, v / h)
    for k in range(0, count - 2, 2):
        t = work[base + OWN.FORCES + k, n]
        d = work[base + OWN.FORCES + k + 1, n] - t
        a0 = square * _relative(work, row + k, i, link) + level + tilt * (t - 0.5)
        a1 = square * _relative(work, row + k + 1, i, link) + level + tilt * (t + d - 0.5)
        a2 = square * _relative(work, row + k + 2, i, link) + level + tilt * (t + 2.0 * d - 0.5)
        b = 0.5 * (4.0 * a1 - 3.0 * a0 - a2)
        c = 0.5 * (a0 - 2.0 * a1 + a2)
        for half in range(2):
            start = float(half)
            v_start = _speed(v, d, a0, b, c, start)
            v_end = _speed(v, d, a0, b, c, start + 1.0)
            a_start = a0 if half == 0 else a1
            a_end = a1 if half == 0 else a2
            if goes_far and v_start * v_end < 0.0:
                x = start + v_start / (v_start - v_end)
                for _ in range(3):
                    slope = d * (a0 + x * (b + x * c))
                    x -= _speed(v, d, a0, b, c, x) / slope if slope * (v_end - v_start) > 0.0 else 0.0
                    x = min(max(x, start), start + 1.0)
                far = _way(u, v, d, a0, b, c, x)
                raise_peak(work, peaks + peak, i, far)
                if still:
                    stretched = springs[at.SLOPE, n + 1 + i] * (far - springs[at.DRIFT, n + 1 + i])
                    raise_peak(work, peaks + at.PEAK_SHEAR, i, springs[at.FORCE, n + 1 + i] + stretched)
            if goes_fast and a_start * a_end < 0.0:
                x = start + a_start / (a_start - a_end)
                for _ in range(2):
                    slope = b + 2.0 * c * x
                    x -= (a0 + x * (b + x * c)) / slope if slope * (a_end - a_start) > 0.0 else 0.0
                    x = min(max(x, start), start + 1.0)
                raise_peak(work, peaks + fastest, i, _speed(v, d, a0, b, c, x) / h)
        u = _way(u, v, d, a0, b, c, 2.0)
        v = _speed(v, d, a0, b, c, 2.0)
        raise_peak(work, peaks + peak, i, u)
        raise_peak(work, peaks + fastest, i, v / h)


@inlined
def _relative(work, row, i, link):
    """Acceleration of a floor, or with a link of its drift."""
    return work[row, i] - link * work[row, max(i - 1, 0)]


@inlined
def _speed(v, d, a0, b, c, x):
    return v + d * x * (a0 + x * (0.5 * b + x * c / 3.0))


@inlined
def _way(u, v, d, a0, b, c, x):
    return u + d * x * (v + d * x * (0.5 * a0 + x * (b / 6.0 + x * c / 12.0)))


@inlined
def raise_end(carried, i):
    """Raise the peaks of displacement, velocity, drift and shear of floor `i` and its story by those at the end of the
    step, where the companion has arrived, but not the run."""
    scene, memory, _, h, base = carried
    state, springs, work, _ = memory
    peaks = base + OWN.PEAKS
    c = scene.linear_terms.shape[1] + i
    u = state[at.DISPLACEMENT, i] + work[ROW.RISE, i] + state[at.ERROR_DISPLACEMENT, i]
    v = state[at.VELOCITY, i] + 1.0 / h * work[ROW.BEND, i] + state[at.ERROR_VELOCITY, i]
    _raise(work, peaks + at.PEAK_DISPLACEMENT, i, abs(u))
    _raise(work, peaks + at.PEAK_VELOCITY, i, abs(v))
    _raise(work, peaks + at.PEAK_DRIFT, i, abs(springs[at.DRIFT, c]))
    _raise(work, peaks + at.PEAK_SHEAR, i, abs(springs[at.FORCE, c]))


@called
def raise_forces(scene, h, load, memory, base):
    """Raise the peaks of accelerations, total shears and drift rates by those at the end of the step, where the
    companion's stories are, and so its velocities."""
    linear_terms, modal, _, forces, _ = scene
    state, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    peaks = base + OWN.PEAKS
    by_h = 1.0 / h
    for i in range(n):
        work[base + OWN.MOTION, i] = state[at.VELOCITY, i] + state[at.ERROR_VELOCITY, i] + by_h * work[ROW.BEND, i]
        work[base + OWN.OTHER, i] = 0.0
        work[base + OWN.OTHER + 1, i] = 0.0
    if MODAL or FORCES:
        add_modal_force(modal, work, base + OWN.MOTION, 1.0, work, base + OWN.OTHER, n)
        for j in range(forces.shape[0]):
            work[base + OWN.OTHER + 1, int(forces[j, at.FLOOR])] += force_value(forces, j, load[at.TIME] + h)
    damped = above = 0.0
    for i in range(n - 1, -1, -1):
        link = linear_terms[at.LINK, i]
        v = work[base + OWN.MOTION, i]
        rate = v - link * work[base + OWN.MOTION, max(i - 1, 0)]
        story = springs[at.FORCE, n + 1 + i] + linear_terms[at.GEOMETRIC, i] * springs[at.DRIFT, n + 1 + i]
        story += linear_terms[at.STORY_DAMPER, i] * rate + power_damper(linear_terms, i, rate)[0]
        own = linear_terms[at.FLOOR_DAMPER, i] * v + work[base + OWN.OTHER, i]
        a = linear_terms[at.INVERSE_MASS, i] * (above - story - own + work[base + OWN.OTHER + 1, i])
        damped += own
        _raise(work, peaks + at.PEAK_ACCELERATION, i, abs(a))
        _raise(work, peaks + at.PEAK_TOTAL_SHEAR, i, abs(story + damped))
        if DASHPOTS:
            _raise(work, peaks + at.PEAK_DRIFT_RATE, i, abs(rate))
        above = link * story
        damped *= link


@inlined
def _raise(work, row, i, size):
    """`raise_peak` without a branch."""
    work[row, i] = max(work[row, i], size)
