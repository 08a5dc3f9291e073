"""The error of a run of moment4, carried along in the run.

The impulse and the first moment of `tdint.kernels.equations.moment4` hold for the true motion as well. What is not true
is the path along which the story forces are taken: the true one is a parabola plus motions that start and end where
they are. With r what the acceleration (p - f - C u') / M on the path has beyond its line A0 + A1 s, these "bubbles" have

    mean w = h^2 r2 / 360,  r2 = 180 mean((s^2 - 1/12) r)          (even, 30 (s^2 - 1/4)^2)
    12 mean(s w) = -h^2 A1 / 60 + 2 h^2 mean(s^3 r)                (odd, -10 s (s^2 - 1/4))

A second state of the drift laws, the companion's, follows the run's parabolas plus those of the error, and the
bubbles. That the companion fulfills impulse and moment gives the rise and bend of the error: a Newton step by the
matrix of the run's step, which is factored; where stories change branch, or are curved, further ones.

The companion's story `i` has column n + 1 + i of `laws`, `springs` and `work`.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.chain import DASHPOTS, FORCES, MODAL, add_modal_force, force_rate, force_value, power_damper
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.moment4 import (
    _BLOCKS,
    _COUPLING,
    _DASHPOT,
    _LEFT,
    _PATH,
    _STORE,
    _X,
    BEND,
    RISE,
)
from tdint.kernels.equations.tridiagonal import solve_blocks_damped
from tdint.kernels.laws.choosing import BENDING
from tdint.kernels.march.within import look_within, raise_peak
from tdint.kernels.stories import error_path
from tdint.kernels.stories.branches import advance
from tdint.kernels.stories.path import MEAN, MOMENT, arrive, stays
from tdint.kernels.stories.springs import reach

# Rows of state
ERROR_U = 3  # displacement, true minus computed
ERROR_V = 4
STATE_ROWS = 5

# Rows of work behind those of the run's step
_E0 = 0  # rise and bend of the error
_E1 = 1
_W0 = 2  # bubbles of the floors
_W1 = 3
_A1 = 4  # h^2 A1
_F2 = 5  # second and third moment of the story forces
_F3 = 6
_Q0 = 7  # what mean and moment of a story's force are more than the run's
_Q1 = 8
_CALM = 9  # 1 if the story is on the same linear branch in both motions
_WALK = 10
_SEEN = _WALK + error_path.ERROR_PATH_ROWS  # twice displacement, velocity, absolute acceleration of the companion,
_SEEN_ROWS = 5  # with velocity and acceleration one step before that
_SUM = _SEEN + 2 * _SEEN_ROWS
_OTHER = _SUM + 1
_TURN = _OTHER + 1  # the run's acceleration at the end of the step before
_VIEW = _TURN + 1  # drift and force
PEAKS = _VIEW + 2
ERROR_ROWS = PEAKS + 2 * at.PEAK_ROWS

PASSES = 3
_NEAR = 0.7  # of a peak, from which on it may be passed within a step
_SETTLED = 1e-3


def error_peaks(modes: int) -> int:
    """The first of the rows of work with the peaks of the corrected motion, rows as of `Workspace.peaks`."""
    return _STORE + 6 * modes + 1 + PEAKS


@inlined
def _first_row(modal):
    return _STORE + 6 * modal.shape[0] + 1


@called
def begin_error(chain, modal, laws, forces, load, state, springs, work, memo):
    """Start the companion from the run's state."""
    n = chain.shape[1] - 1
    for row in range(springs.shape[0]):
        for i in range(n):
            springs[row, n + 1 + i] = springs[row, i]
    memo[at.ERROR_BEGUN] = 1.0
    observe_error(0.0, chain, modal, laws, forces, load[at.TIME], load, state, springs, work, memo)


@inlined
def carry_error(chain, modal, laws, forces, h, load, state, springs, work, memo):
    """Rise and bend of the error over the step that the rows RISE and BEND tell, and the companion's new state."""
    base = _first_row(modal)
    linear = not BENDING or memo[at.LINEAR] != 0.0
    calm = linear or _same_branches(chain, springs, work)
    if calm:
        _calm_bubbles(chain, h, load, state, springs, work, base)
        _add_loads(chain, modal, forces, h, load, work, base)
        _calm_unbalanced(chain, h, state, springs, work, base)
        _add_modal(modal, h, work, base, chain.shape[1] - 1, False)
        _solve(chain, modal, h, work, base, True)
        calm = linear or _still(chain, springs, work, base)
    else:
        for i in range(chain.shape[1] - 1):
            work[base + _E0, i] = h * state[ERROR_V, i]
            work[base + _E1, i] = 0.0
    if calm:
        _commit(chain, laws, h, state, springs, work, base)
    else:
        _follow(chain, modal, laws, forces, h, load, state, springs, work, base)


@inlined
def _same_branches(chain, springs, work):
    """Whether all stories have kept to linear branches that are the companion's, too."""
    n = chain.shape[1] - 1
    same = True
    for i in range(n):
        same &= (work[_LEFT, i] == 0.0) & (springs[at.SLOPE, i] == springs[at.SLOPE, n + 1 + i])
        if DASHPOTS:
            same &= chain[at.POWER_DAMPER, i] == 0.0
    return same


@inlined
def _calm_bubbles(chain, h, load, state, springs, work, base):
    """Bubbles where all stories keep to their branches, but for modal damping and floor forces."""
    n = chain.shape[1] - 1
    by_h = 1.0 / h
    square = h * h / 360.0
    ground = 180.0 * load[at.GROUND_2] * square
    third = 2.0 * h * h * load[at.GROUND_3]
    a1_below = bend_below = before = floor = inverse = 0.0
    for i in range(n + 1):
        link = chain[at.LINK, i]
        bend = work[BEND, i]
        a1 = 12.0 * (0.5 * bend - work[RISE, i] + h * state[at.VELOCITY, i])
        second = 0.5 * by_h * chain[at.STORY_DAMPER, i] * (a1 - link * a1_below)
        second += 0.5 * (chain[at.GEOMETRIC, i] + springs[at.SLOPE, i]) * (bend - link * bend_below)
        if i > 0:
            work[base + _W0, i - 1] = -square * inverse * (before - link * second + floor * a1_below) - ground
        work[base + _A1, i] = a1
        if i < n:
            work[base + _W1, i] = -a1 / 60.0 - third
        inverse = chain[at.INVERSE_MASS, i]
        floor = 0.5 * by_h * chain[at.FLOOR_DAMPER, i]
        a1_below = a1
        bend_below = bend
        before = second


@inlined
def _calm_unbalanced(chain, h, state, springs, work, base):
    """Minus what the companion's motion leaves out of balance without rise and bend of the error, but for modal
    damping."""
    n = chain.shape[1] - 1
    square = h * h
    by_h = 12.0 / h
    u_below = w0_below = w1_below = before_0 = before_1 = 0.0
    for i in range(n + 1):
        link = chain[at.LINK, i]
        geometric = chain[at.GEOMETRIC, i]
        q0 = q1 = 0.0
        if i < n:
            c = n + 1 + i
            u = state[ERROR_U, i]
            w0 = work[base + _W0, i]
            w1 = work[base + _W1, i]
            stiffness = geometric + springs[at.SLOPE, i]
            bubble = w0 - link * w0_below
            q0 = springs[at.FORCE, c] - springs[at.FORCE, i] + geometric * (u - link * u_below) + stiffness * bubble
            q1 = stiffness * (w1 - link * w1_below) - by_h * chain[at.STORY_DAMPER, i] * bubble
        if i > 0:
            mass = chain[at.MASS, i - 1]
            work[_X, i - 1] = -square * (before_0 - link * q0)
            inertia = 12.0 * h * (chain[at.FLOOR_DAMPER, i - 1] * w0_below - mass * state[ERROR_V, i - 1])
            work[_X + 1, i - 1] = inertia - square * (before_1 - link * q1)
        if i < n:
            u_below = u
            w0_below = w0
            w1_below = w1
            before_0 = q0
            before_1 = q1


@inlined
def _add_modal(modal, h, work, base, n, all_of_it):
    """What modal damping brings to the unbalanced rows."""
    if MODAL and modal.shape[0] > 0:
        if all_of_it:
            add_modal_force(modal, work, base + _E0, -h, work, _X, n)
            add_modal_force(modal, work, base + _E1, -h, work, _X + 1, n)
        add_modal_force(modal, work, base + _W0, 12.0 * h, work, _X + 1, n)


@inlined
def _solve(chain, modal, h, work, base, anew):
    """Rise and bend of the error, or their corrections; returns their sizes and that of the corrections."""
    n = chain.shape[1] - 1
    solve_blocks_damped(work, _BLOCKS, _COUPLING, modal, h, 0.0, 0.0, h, _STORE, _X, _X + 1, n)
    change = 0.0
    size = 0.0
    for i in range(n):
        if anew:
            work[base + _E0, i] = work[_X, i]
            work[base + _E1, i] = work[_X + 1, i]
        else:
            work[base + _E0, i] += work[_X, i]
            work[base + _E1, i] += work[_X + 1, i]
            change += abs(work[_X, i]) + abs(work[_X + 1, i])
            size += abs(work[base + _E0, i]) + abs(work[base + _E1, i])
    return change <= _SETTLED * size


@inlined
def _commit(chain, laws, h, state, springs, work, base):
    """The companion's state at the end of the step, all stories on the branches where they are."""
    n = chain.shape[1] - 1
    by_h = 1.0 / h
    below = 0.0
    for i in range(n):
        c = n + 1 + i
        rise = work[RISE, i] + work[base + _E0, i]
        advance(laws, springs, c, 0, springs[at.DRIFT, c] + rise - chain[at.LINK, i] * below)
        below = rise
        state[ERROR_U, i] += work[base + _E0, i]
        state[ERROR_V, i] += by_h * work[base + _E1, i]


@called
def _follow(chain, modal, laws, forces, h, load, state, springs, work, base):
    """Rise and bend of the error by Newton's iteration from those that are there, and the companion's new state."""
    n = chain.shape[1] - 1
    for i in range(n):
        work[base + _A1, i] = 12.0 * (0.5 * work[BEND, i] - work[RISE, i] + h * state[at.VELOCITY, i])
    for passed in range(PASSES):
        _classify(passed, chain, laws, h, springs, work, base)
        _moments(chain, h, springs, work, base)
        _bubbles(chain, h, load, work, base)
        _add_loads(chain, modal, forces, h, load, work, base)
        _unbalanced(chain, h, state, springs, work, base)
        _add_modal(modal, h, work, base, n, True)
        if _solve(chain, modal, h, work, base, False) and passed > 0:
            break
    for i in range(n):
        if work[base + _CALM, i] == 0.0 and work[base + _WALK + error_path.EVENT, n + 1 + i] > 0.0:
            _shake(chain, modal, forces, h, state, springs, work, base, i)
    below = 0.0
    for i in range(n):
        c = n + 1 + i
        rise = work[RISE, i] + work[base + _E0, i]
        gain = rise - chain[at.LINK, i] * below
        below = rise
        if work[base + _CALM, i] != 0.0:
            advance(laws, springs, c, 0, springs[at.DRIFT, c] + gain)
        else:
            if springs[at.SLOPE, c] < math.inf:
                advance(laws, springs, c, at.FIRST_TRIAL, springs[at.DRIFT, c] + gain)
            arrive(laws, springs, c, gain)
        state[ERROR_U, i] += work[base + _E0, i]
        state[ERROR_V, i] += work[base + _E1, i] / h


@called
def _shake(chain, modal, forces, h, state, springs, work, base, i):
    """Raise the peak accelerations of the floors at both ends of story `i` by those at which it changes its branch."""
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        return
    n = chain.shape[1] - 1
    t = work[base + _WALK + error_path.EVENT, n + 1 + i]
    for floor in range(max(i - 1, 0), i + 1):
        if floor < i and chain[at.LINK, i] == 0.0:
            continue
        above = _story_at(chain, h, t, state, springs, work, base, floor + 1) if floor + 1 < n else 0.0
        story = _story_at(chain, h, t, state, springs, work, base, floor)
        v = _rate_at(t, work, base, floor) / h
        inner = chain[at.LINK, floor + 1] * above - story - chain[at.FLOOR_DAMPER, floor] * v
        raise_peak(work, base + PEAKS + at.PEAK_ACCELERATION, floor, chain[at.INVERSE_MASS, floor] * inner)


@inlined
def _rate_at(t, work, base, i):
    """h times the velocity of a floor on the companion's path."""
    s = t - 0.5
    parabola = work[RISE, i] + work[base + _E0, i] + s * (work[BEND, i] + work[base + _E1, i])
    return parabola + 120.0 * s * (s * s - 0.25) * work[base + _W0, i] + (2.5 - 30.0 * s * s) * work[base + _W1, i]


@inlined
def _way_at(t, work, base, i):
    """Displacement of a floor since the start of the step on the companion's path."""
    rise = work[RISE, i] + work[base + _E0, i]
    bend = work[BEND, i] + work[base + _E1, i]
    bubble = error_path.even(t - 0.5) * work[base + _W0, i] + error_path.odd(t - 0.5) * work[base + _W1, i]
    return t * (rise + 0.5 * bend * (t - 1.0)) + bubble


@called
def _story_at(chain, h, t, state, springs, work, base, i):
    """Force of story `i` and its linear damper at t. Between changes of branch it is taken as linear."""
    n = chain.shape[1] - 1
    c = n + 1 + i
    link = chain[at.LINK, i]
    way = _way_at(t, work, base, i)
    rate = _rate_at(t, work, base, i)
    if i > 0:
        way -= link * _way_at(t, work, base, i - 1)
        rate -= link * _rate_at(t, work, base, i - 1)
    force = springs[at.FORCE, c]
    if work[base + _CALM, i] != 0.0:
        force += springs[at.SLOPE, c] * way
    else:
        event = work[base + _WALK + error_path.EVENT, c]
        at_event = work[base + _WALK + error_path.EVENT + 1, c]
        end = springs[at.FIRST_TRIAL + at.FORCE, c]
        if event <= 0.0:
            force += t * (end - force)
        elif t <= event:
            force += t / event * (at_event - force)
        else:
            force = at_event + (t - event) / (1.0 - event) * (end - at_event)
    return force + chain[at.GEOMETRIC, i] * (springs[at.DRIFT, c] + way) + chain[at.STORY_DAMPER, i] * rate / h


@called
def _classify(passed, chain, laws, h, springs, work, base):
    """Which stories are on the same linear branch in both motions; follow the others."""
    n = chain.shape[1] - 1
    below_0 = below_1 = 0.0
    w0_below = w1_below = a1_below = 0.0
    for i in range(n):
        c = n + 1 + i
        link = chain[at.LINK, i]
        rise = work[RISE, i] + work[base + _E0, i]
        bend = work[BEND, i] + work[base + _E1, i]
        w0 = work[base + _W0, i] if passed > 0 else 0.0
        w1 = work[base + _W1, i] if passed > 0 else 0.0
        a1 = work[base + _A1, i]
        calm = work[_LEFT, i] == 0.0 and springs[at.SLOPE, i] == springs[at.SLOPE, c]
        calm = calm and stays(springs, c, rise - link * below_0, bend - link * below_1)
        damped = DASHPOTS and chain[at.POWER_DAMPER, i] != 0.0
        if calm and not damped:
            work[base + _CALM, i] = 1.0
        else:
            work[base + _CALM, i] = 0.0
            error_path.walk(
                laws, springs, c, rise - link * below_0, bend - link * below_1, w0 - link * w0_below,
                w1 - link * w1_below, work, base + _WALK,
            )  # fmt: skip
            if damped:
                error_path.add_dashpot(
                    chain, i, h, rise - link * below_0, bend - link * below_1, a1 - link * a1_below, work, c,
                    base + _WALK,
                )  # fmt: skip
        below_0, below_1 = rise, bend
        w0_below, w1_below, a1_below = w0, w1, a1


@inlined
def _still(chain, springs, work, base):
    """Whether all stories of the companion keep to their branches on the corrected path."""
    n = chain.shape[1] - 1
    below_0 = below_1 = 0.0
    still = True
    for i in range(n):
        rise = work[RISE, i] + work[base + _E0, i]
        bend = work[BEND, i] + work[base + _E1, i]
        link = chain[at.LINK, i]
        still = still and stays(springs, n + 1 + i, rise - link * below_0, bend - link * below_1)
        below_0, below_1 = rise, bend
    return still


@inlined
def _moments(chain, h, springs, work, base):
    """Second and third moment of the story forces, dampers included."""
    n = chain.shape[1] - 1
    bend_below = 0.0
    a1_below = 0.0
    for i in range(n):
        c = n + 1 + i
        link = chain[at.LINK, i]
        bend = work[BEND, i] - link * bend_below
        a1 = work[base + _A1, i] - link * a1_below
        bend_below = work[BEND, i]
        a1_below = work[base + _A1, i]
        second = 0.5 * (chain[at.STORY_DAMPER, i] / h * a1 + chain[at.GEOMETRIC, i] * bend)
        third = 0.0
        if work[base + _CALM, i] != 0.0:
            second += 0.5 * springs[at.SLOPE, i] * bend
        else:
            second += work[base + _WALK + error_path.SECOND, c]
            third += work[base + _WALK + error_path.THIRD, c]
        work[base + _F2, i] = second
        work[base + _F3, i] = third


@inlined
def _bubbles(chain, h, load, work, base):
    """Bubbles of the floors, but for modal damping and floor forces."""
    n = chain.shape[1] - 1
    square = h * h
    for i in range(n):
        link = chain[at.LINK, i + 1]
        a1 = work[base + _A1, i]
        inverse = chain[at.INVERSE_MASS, i]
        second = work[base + _F2, i] - link * work[base + _F2, i + 1] + 0.5 / h * chain[at.FLOOR_DAMPER, i] * a1
        third = work[base + _F3, i] - link * work[base + _F3, i + 1]
        work[base + _W0, i] = -square / 360.0 * (second * inverse + 180.0 * load[at.GROUND_2])
        work[base + _W1, i] = -a1 / 60.0 - 2.0 * square * (third * inverse + load[at.GROUND_3])


@inlined
def _add_loads(chain, modal, forces, h, load, work, base):
    """What modal damping and floor forces add to the bubbles."""
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        n = chain.shape[1] - 1
        for i in range(n):
            work[base + _F2, i] = 0.0
            work[base + _F3, i] = 0.0
        add_modal_force(modal, work, base + _A1, 0.5 / h, work, base + _F2, n)
        if FORCES and forces.shape[0] > 0:
            _add_forces(forces, load[at.TIME], h, work, base)
        for i in range(n):
            inverse = h * h * chain[at.INVERSE_MASS, i]
            work[base + _W0, i] -= inverse / 360.0 * work[base + _F2, i]
            work[base + _W1, i] -= 2.0 * inverse * work[base + _F3, i]


@called
def _add_forces(forces, t, h, work, base):
    """Second and third moment of the floor forces."""
    for j in range(forces.shape[0]):
        floor = int(forces[j, at.FLOOR])
        k = forces[j, at.OMEGA] * h
        x = 0.5 * k
        value = force_value(forces, j, t + 0.5 * h)
        rate = force_rate(forces, j, t + 0.5 * h) * h
        if k < 0.5:
            q = k * k
            second = -q * (0.5 - q * (0.00892857142857 - q * 6.2e-5))
            third = -q * (1.0 / 16800.0 - q * 8.267e-7)
        else:
            sine, cosine = math.sin(x), math.cos(x)
            squares = 2.0 * (0.25 * sine / k + cosine / k**2 - 2.0 * sine / k**3)
            second = 180.0 * (squares - sine / (12.0 * x))
            cubes = 2.0 * (-0.125 * cosine / k + 0.75 * sine / k**2 + 3.0 * cosine / k**3 - 6.0 * sine / k**4)
            third = (cubes - 0.3 * (sine / k**2 - 0.5 * cosine / k)) / k
        work[base + _F2, floor] -= value * second
        work[base + _F3, floor] -= rate * third


@inlined
def _unbalanced(chain, h, state, springs, work, base):
    """Minus what the companion's motion leaves out of balance, into the rows of the run's corrections."""
    n = chain.shape[1] - 1
    square = h * h
    u_below = e0_below = e1_below = w0_below = w1_below = 0.0
    rise_below = bend_below = 0.0
    for i in range(n):
        c = n + 1 + i
        link = chain[at.LINK, i]
        u = state[ERROR_U, i]
        e0 = work[base + _E0, i] - link * e0_below
        e1 = work[base + _E1, i] - link * e1_below
        w0 = work[base + _W0, i] - link * w0_below
        w1 = work[base + _W1, i] - link * w1_below
        geometric = chain[at.GEOMETRIC, i]
        damper = chain[at.STORY_DAMPER, i] / h
        q0 = geometric * (u - link * u_below + 0.5 * e0 - e1 / 12.0 + w0) + damper * e0
        q1 = geometric * (e0 + w1) + damper * (e1 - 12.0 * w0)
        if work[base + _CALM, i] != 0.0:
            slope = springs[at.SLOPE, i]
            q0 += springs[at.FORCE, c] - springs[at.FORCE, i] + slope * (0.5 * e0 - e1 / 12.0 + w0)
            q1 += slope * (e0 + w1)
        else:
            path = base + _WALK
            rise = work[RISE, i] - link * rise_below
            bend = work[BEND, i] - link * bend_below
            q0 += work[path + error_path.MEAN, c]
            q0 += work[path + error_path.MEAN_BY_EVEN, c] * w0 + work[path + error_path.MEAN_BY_ODD, c] * w1
            q1 += work[path + error_path.MOMENT, c]
            q1 += work[path + error_path.MOMENT_BY_EVEN, c] * w0 + work[path + error_path.MOMENT_BY_ODD, c] * w1
            damped = DASHPOTS and chain[at.POWER_DAMPER, i] != 0.0
            if work[_LEFT, i] == 0.0 and not damped:
                slope = springs[at.SLOPE, i]
                q0 -= springs[at.FORCE, i] + slope * (0.5 * rise - bend / 12.0)
                q1 -= slope * rise
            else:
                drift = springs[at.DRIFT, i]
                q0 -= work[_PATH + MEAN, i] - geometric * (drift + 0.5 * rise - bend / 12.0) - damper * rise
                q1 -= work[_PATH + MOMENT, i] - geometric * rise - damper * bend
        work[base + _Q0, i] = q0
        work[base + _Q1, i] = q1
        u_below = u
        e0_below, e1_below = work[base + _E0, i], work[base + _E1, i]
        w0_below, w1_below = work[base + _W0, i], work[base + _W1, i]
        rise_below, bend_below = work[RISE, i], work[BEND, i]
    for i in range(n):
        link = chain[at.LINK, i + 1]
        mass = chain[at.MASS, i]
        floor = h * chain[at.FLOOR_DAMPER, i]
        e0 = work[base + _E0, i]
        e1 = work[base + _E1, i]
        mean = work[base + _Q0, i] - link * work[base + _Q0, i + 1]
        moment = work[base + _Q1, i] - link * work[base + _Q1, i + 1]
        work[_X, i] = -mass * e1 - floor * e0 - square * mean
        inertia = 12.0 * mass * (0.5 * e1 - e0 + h * state[ERROR_V, i])
        work[_X + 1, i] = -inertia - floor * (e1 - 12.0 * work[base + _W0, i]) - square * moment


@inlined
def observe_error(h, chain, modal, laws, forces, t, load, state, springs, work, memo):
    """Peaks of the companion's motion.

    Accelerations are found where some value may be near its peak, which that at the end of the run's step tells.
    """
    n = chain.shape[1] - 1
    base = _first_row(modal)
    ground = load[at.GROUND_1] if h > 0.0 else load[at.GROUND_0]
    side = int(memo[at.ERROR_SIDE])
    old = base + _SEEN + side * _SEEN_ROWS
    now = base + _SEEN + (1 - side) * _SEEN_ROWS
    peaks = base + PEAKS
    near = h == 0.0
    turning = False
    v_below = 0.0
    old_below = 0.0
    for i in range(n):
        c = n + 1 + i
        link = chain[at.LINK, i]
        u = state[at.DISPLACEMENT, i] + state[ERROR_U, i]
        v = state[at.VELOCITY, i] + state[ERROR_V, i]
        v_old = work[old + 1, i]
        work[now, i] = u
        work[now + 1, i] = v
        a = state[at.ACCELERATION, i]
        absolute = abs(a + ground) >= _NEAR * work[peaks + at.PEAK_ACCELERATION, i]
        story = _raise(work, peaks + at.PEAK_DRIFT, i, springs[at.DRIFT, c])
        story |= _raise(work, peaks + at.PEAK_SHEAR, i, springs[at.FORCE, c])
        floor = _raise(work, peaks + at.PEAK_DISPLACEMENT, i, u)
        fast = _raise(work, peaks + at.PEAK_VELOCITY, i, v)
        turning |= absolute | (story & ((v - link * v_below) * (v_old - link * old_below) <= 0.0))
        turning |= (floor & (v * v_old <= 0.0)) | (fast & (a * work[base + _TURN, i] <= 0.0))
        near |= absolute | story | floor | fast
        work[base + _TURN, i] = a
        v_below = v
        old_below = v_old
    known = 0.0
    if near:
        _accelerations(chain, modal, forces, t, state, springs, work, base, now)
        known = 1.0
        if turning and memo[at.ERROR_NEAR] != 0.0:
            _look(chain, laws, h, load[at.GROUND_0], ground, springs, work, memo, base, old, now)
    memo[at.ERROR_NEAR] = known
    memo[at.ERROR_SIDE] = 1.0 - side
    if memo[at.FAST] != 0.0:
        for i in range(n):
            work[now + 3, i] = work[old + 1, i]
            work[now + 4, i] = work[old + 2, i]


@inlined
def _raise(work, row, i, value):
    """`raise_peak`; near is what a resolved motion may have beside its peak."""
    size = abs(value)
    peak = work[row, i]
    work[row, i] = max(size, peak)
    return size >= _NEAR * peak


@called
def _look(chain, laws, h, ground_0, ground_1, springs, work, memo, base, old, now):
    """Peaks within the step."""
    n = chain.shape[1] - 1
    for i in range(n):
        work[old + 2, i] -= ground_0
        work[now + 2, i] -= ground_1
        work[base + _VIEW, i] = springs[at.DRIFT, n + 1 + i]
        work[base + _VIEW + 1, i] = springs[at.FORCE, n + 1 + i]
    turned = look_within(
        True, memo[at.FAST] != 0.0, chain, laws, h, ground_0, ground_1, work, old, work[now : now + 2], work, now + 2,
        work[base + _VIEW : base + _VIEW + 2], work, base + _SUM, work, base + PEAKS,
    )  # fmt: skip
    if turned > 0:
        for i in range(n):
            turn = work[base + _SUM, i]
            if turn != work[base + _VIEW, i]:
                reach(laws, springs, n + 1 + i, at.COMMITTED, at.FIRST_TRIAL, turn)
                raise_peak(work, base + PEAKS + at.PEAK_SHEAR, i, springs[at.FIRST_TRIAL + at.FORCE, n + 1 + i])
    for i in range(n):
        work[old + 2, i] += ground_0
        work[now + 2, i] += ground_1


@inlined
def _accelerations(chain, modal, forces, t, state, springs, work, base, now):
    """Absolute accelerations of the companion from equilibrium, and their peaks."""
    n = chain.shape[1] - 1
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        for i in range(n):
            work[base + _OTHER, i] = 0.0
        for j in range(forces.shape[0]):
            work[base + _OTHER, int(forces[j, at.FLOOR])] += force_value(forces, j, t)
        add_modal_force(modal, work, now + 1, -1.0, work, base + _OTHER, n)
    before = v_below = 0.0
    for i in range(n + 1):
        story = v = 0.0
        link = chain[at.LINK, i]
        if i < n:
            c = n + 1 + i
            v = work[now + 1, i]
            rate = v - link * v_below
            story = springs[at.FORCE, c] + chain[at.GEOMETRIC, i] * springs[at.DRIFT, c]
            story += chain[at.STORY_DAMPER, i] * rate + power_damper(chain, i, rate)[0]
        if i > 0:
            inner = work[base + _OTHER, i - 1] - chain[at.FLOOR_DAMPER, i - 1] * v_below - before + link * story
            a = chain[at.INVERSE_MASS, i - 1] * inner
            work[now + 2, i - 1] = a
            raise_peak(work, base + PEAKS + at.PEAK_ACCELERATION, i - 1, a)
        v_below = v
        before = story
