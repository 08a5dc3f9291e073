"""What is seen of a motion while it is integrated: peaks, energies, a history if asked for. O(stories) memory
otherwise."""

from __future__ import annotations

import math

from tdint.kernels.chain import FORCES, MODAL, add_modal_force, force_rate, force_value, power_damper
from tdint.kernels.compiling import called, inlined
from tdint.kernels.laws import LINEAR
from tdint.kernels.layout import (
    CODE,
    DISPLACEMENT,
    DRIFT,
    FLOOR,
    FLOOR_DAMPER,
    FORCE,
    GEOMETRIC,
    INTERNAL,
    INVERSE_MASS,
    LINK,
    MASS,
    OWN_WORK,
    STIFFNESS,
    STORY_DAMPER,
    VELOCITY,
    WORK_DAMPED,
    WORK_INPUT,
)
from tdint.kernels.stories.events import NONE, turning

# peaks: largest absolute values, one row each
PEAK_DRIFT = 0
PEAK_SHEAR = 1
PEAK_DISPLACEMENT = 2
PEAK_VELOCITY = 3
PEAK_ACCELERATION = 4  # absolute: relative to the ground, plus the ground's
PEAK_ROWS = 5

# history: per stored time the ground acceleration, then for all floors displacement, velocity, absolute acceleration,
# and for all stories the shear, then the energies
HISTORY_FIELDS = 4

# observed: numbers of the whole run, the energies first: so many, and a history has them at each stored time. Those at
# the end of the run, J
ENERGY_INPUT = 0  # work of the load on the motion relative to the ground
ENERGY_KINETIC = 1  # of the motion relative to the ground
ENERGY_DAMPED = 2  # work of the viscous dampers
ENERGY_RECOVERABLE = 3  # stored in the stories
ENERGY_DISSIPATED = 4  # by the drift laws since the start
ENERGY_TERMS = 5
ENERGY_START = ENERGY_TERMS  # kinetic and stored energy at the start, J
ENERGY_LARGEST = ENERGY_TERMS + 1  # largest ENERGY_START + ENERGY_INPUT on the way, J
ITERATIONS = ENERGY_TERMS + 2
HALVINGS = ENERGY_TERMS + 3
STEPS_REACHED = ENERGY_TERMS + 4
_POWER_INPUT = ENERGY_TERMS + 5  # powers and their rates at the last observed time
_RATE_INPUT = ENERGY_TERMS + 6  # without the ground's own rate
_MOMENTUM = ENERGY_TERMS + 7
_POWER_DAMPED = ENERGY_TERMS + 8
_RATE_DAMPED = ENERGY_TERMS + 9
BETWEEN_STEPS = ENERGY_TERMS + 10  # set before the march: how peaks of drift and displacement are looked for
DISSIPATED_BEFORE = ENERGY_TERMS + 11  # by the drift laws on the way to the initial drifts, J
COLLAPSE_STEP = ENERGY_TERMS + 12  # whole steps after which a story was first beyond a limit; NO_COLLAPSE for none
COLLAPSE_STORY = ENERGY_TERMS + 13  # the first story that failed, else the one farthest beyond its limit then
COLLAPSE_FAILED = ENERGY_TERMS + 14  # 1 if it failed
COLLAPSE_ENERGIES = ENERGY_TERMS + 15  # the energies then, ENERGY_START and ENERGY_LARGEST after them
OBSERVED_SIZE = COLLAPSE_ENERGIES + ENERGY_TERMS + 2

NO_COLLAPSE = -1.0

# limits: by story
LIMIT = 0  # drift ratio beyond which it has collapsed
HEIGHT = 1  # m; nan for a story without a limit
FAILED = 2  # what INTERNAL is once the story carries nothing any more; nan where that does not happen

# observed[BETWEEN_STEPS]
AT_STEPS_ONLY = 0
INTERPOLATED = 1  # on the cubic Hermite interpolant
ON_THE_PATH = 2  # on the parabola that the method itself takes

# rows of the observer's work
ACCELERATION_ROW = 0
_OTHER = 1
_SUM = 2
_OLD_DRIFT = 3  # at the last observed time
_OLD_RATE = 4
_OLD_U = 5
_OLD_V = 6
_OLD_A = 7
OBSERVER_ROWS = 8

_RESOLVED = 0.5


@inlined
def observe(chain, modal, laws, forces, t, h, ground, slope, state, springs, memo, work, peaks, observed):
    """Take in the state at time t, reached by a step h in which the ground acceleration has the given slope.

    The acceleration is that of equilibrium at t, whatever the method carries. Call with h = 0 at the start.
    """
    n = chain.shape[1] - 1
    _story_forces(chain, state, springs, work, peaks)
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        _other_forces(modal, forces, t, state, work, n)
    power = 0.0
    rate = 0.0
    momentum = 0.0
    damped = 0.0
    damped_rate = 0.0
    v_below = 0.0
    a_below = 0.0
    for i in range(n):
        mass = chain[MASS, i]
        link = chain[LINK, i]
        v = state[VELOCITY, i]
        floor = chain[FLOOR_DAMPER, i] * v
        inner = work[_OTHER, i] - floor - work[_SUM, i] + chain[LINK, i + 1] * work[_SUM, i + 1]
        a = chain[INVERSE_MASS, i] * inner - ground
        work[ACCELERATION_ROW, i] = a
        _raise(peaks, PEAK_DISPLACEMENT, i, state[DISPLACEMENT, i])
        _raise(peaks, PEAK_VELOCITY, i, v)
        _raise(peaks, PEAK_ACCELERATION, i, a + ground)
        momentum += mass * v
        power -= mass * ground * v
        rate -= mass * ground * a
        rate_of_drift = v - link * v_below
        force, tangent = power_damper(chain, i, rate_of_drift)
        story = chain[STORY_DAMPER, i] * rate_of_drift
        damped += floor * v + (story + force) * rate_of_drift
        damped_rate += floor * a + (story + 0.5 * (force + tangent * rate_of_drift)) * (a - link * a_below)
        v_below = v
        a_below = a
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        powers = _other_powers(modal, forces, t, state, work, n)
        power += powers[0]
        rate += powers[1]
        damped += powers[2]
        damped_rate += powers[3]
    _add_work(h, slope, power, rate, momentum, damped, 2.0 * damped_rate, memo, observed)
    if observed[BETWEEN_STEPS] != AT_STEPS_ONLY:
        _look_between(observed[BETWEEN_STEPS] == ON_THE_PATH, chain, h, laws, state, springs, work, peaks)


@called
def _other_powers(modal, forces, t, state, work, n):
    """Power of the floor forces and of modal damping, and half the rate of the latter."""
    power = 0.0
    rate = 0.0
    damped = 0.0
    damped_rate = 0.0
    for j in range(forces.shape[0]):
        floor = int(forces[j, FLOOR])
        force = force_value(forces, j, t)
        power += force * state[VELOCITY, floor]
        rate += force * work[ACCELERATION_ROW, floor] + force_rate(forces, j, t) * state[VELOCITY, floor]
    for j in range(modal.shape[0]):
        v_modal = 0.0
        a_modal = 0.0
        for i in range(n):
            v_modal += modal[j, i] * state[VELOCITY, i]
            a_modal += modal[j, i] * work[ACCELERATION_ROW, i]
        damped += v_modal * v_modal
        damped_rate += v_modal * a_modal
    return power, rate, damped, damped_rate


@called
def _look_between(on_path, chain, h, laws, state, springs, work, peaks):
    """Peaks of drift and displacement within the step: on the method's own path, or where the rate changed its sign, on
    the Hermite interpolant.

    The shear of a linear story peaks with its drift; other shears are seen at the steps. Then the rows of old values
    are set for the next step.
    """
    v_below = 0.0
    a_below = 0.0
    old_a_below = 0.0
    for i in range(chain.shape[1] - 1):
        link = chain[LINK, i]
        u = state[DISPLACEMENT, i]
        v = state[VELOCITY, i]
        a = work[ACCELERATION_ROW, i]
        old_a = work[_OLD_A, i]
        drift = springs[DRIFT, i]
        rate = v - link * v_below
        if on_path or rate * work[_OLD_RATE, i] < 0.0:
            accelerations = a - link * a_below + old_a - link * old_a_below
            peak = _extremum(on_path, work[_OLD_DRIFT, i], work[_OLD_RATE, i], drift, rate, accelerations, h)
            _raise(peaks, PEAK_DRIFT, i, peak)
            if laws[CODE, i] == LINEAR:
                _raise(peaks, PEAK_SHEAR, i, laws[STIFFNESS, i] * peak)
        if on_path or v * work[_OLD_V, i] < 0.0:
            peak = _extremum(on_path, work[_OLD_U, i], work[_OLD_V, i], u, v, a + old_a, h)
            _raise(peaks, PEAK_DISPLACEMENT, i, peak)
        v_below = v
        a_below = a
        old_a_below = old_a
        work[_OLD_DRIFT, i] = drift
        work[_OLD_RATE, i] = rate
        work[_OLD_U, i] = u
        work[_OLD_V, i] = v
        work[_OLD_A, i] = a


@inlined
def _extremum(on_path, x0, v0, x1, v1, accelerations, h):
    """Extremum of the parabola through both ends along which the rate changes by v1 - v0; x1 if there is none between.

    Otherwise that of the cubic Hermite interpolant between a rising and a falling end; x1 where the rate does not
    change about as the mean of both accelerations says: there is no smooth peak between.
    """
    if on_path:
        rise = x1 - x0
        bend = h * (v1 - v0)
        if 2.0 * abs(rise) >= abs(bend):
            return x1
        t = 0.5 - rise / bend
        return x0 + t * (rise + 0.5 * bend * (t - 1.0))
    if abs(v1 - v0 - 0.5 * h * accelerations) > _RESOLVED * (abs(v0) + abs(v1)):
        return x1
    middle = 3.0 * (x1 - x0) / h - v0 - v1  # the rate's Bezier points are v0, middle, v1
    sign = math.copysign(1.0, v0)
    s = turning(sign * v0, sign * middle, sign * v1)
    if s == NONE:
        return x1
    r = 1.0 - s
    return r * r * (x0 * (1.0 + 2.0 * s) + h * v0 * s) + s * s * (x1 * (1.0 + 2.0 * r) - h * v1 * r)


@inlined
def _story_forces(chain, state, springs, work, peaks):
    """Force of each story, column and damper, into its row; peaks of drift and shear."""
    n = chain.shape[1] - 1
    below = 0.0
    for i in range(n):
        v = state[VELOCITY, i]
        drift = springs[DRIFT, i]
        shear = springs[FORCE, i]
        rate = v - chain[LINK, i] * below
        work[_SUM, i] = shear + chain[GEOMETRIC, i] * drift + chain[STORY_DAMPER, i] * rate
        work[_SUM, i] += power_damper(chain, i, rate)[0]
        below = v
        _raise(peaks, PEAK_DRIFT, i, drift)
        _raise(peaks, PEAK_SHEAR, i, shear)


@called
def _other_forces(modal, forces, t, state, work, n):
    """Forces on floors less modal damping into their row; the row stays zero where a building has neither."""
    for i in range(n):
        work[_OTHER, i] = 0.0
    for j in range(forces.shape[0]):
        work[_OTHER, int(forces[j, FLOOR])] += force_value(forces, j, t)
    add_modal_force(modal, state, VELOCITY, -1.0, work, _OTHER, n)


@inlined
def _raise(peaks, row, i, value):
    size = abs(value)
    if size > peaks[row, i]:
        peaks[row, i] = size


@inlined
def _add_work(h, slope, power, rate, momentum, damped, damped_rate, memo, observed):
    """Work of load and dampers: as the step has it, if it tells; else by the corrected trapezoidal (Hermite) rule, of
    order 4, from powers and their rates."""
    if h > 0.0 and memo[OWN_WORK] != 0.0:
        observed[ENERGY_INPUT] += memo[WORK_INPUT]
        observed[ENERGY_DAMPED] += memo[WORK_DAMPED]
        observed[ENERGY_LARGEST] = max(observed[ENERGY_LARGEST], observed[ENERGY_START] + observed[ENERGY_INPUT])
    elif h > 0.0:
        ends = observed[_RATE_INPUT] - rate - slope * (observed[_MOMENTUM] - momentum)
        observed[ENERGY_INPUT] += 0.5 * h * (observed[_POWER_INPUT] + power) + h * h / 12.0 * ends
        ends = observed[_RATE_DAMPED] - damped_rate
        observed[ENERGY_DAMPED] += 0.5 * h * (observed[_POWER_DAMPED] + damped) + h * h / 12.0 * ends
        observed[ENERGY_LARGEST] = max(observed[ENERGY_LARGEST], observed[ENERGY_START] + observed[ENERGY_INPUT])
    observed[_POWER_INPUT] = power
    observed[_RATE_INPUT] = rate
    observed[_MOMENTUM] = momentum
    observed[_POWER_DAMPED] = damped
    observed[_RATE_DAMPED] = damped_rate


@inlined
def begin_energies(observed):
    """Energies of the initial state, of which stock has been taken."""
    observed[DISSIPATED_BEFORE] = observed[ENERGY_DISSIPATED]
    observed[ENERGY_DISSIPATED] = 0.0
    observed[ENERGY_START] = observed[ENERGY_KINETIC] + observed[ENERGY_RECOVERABLE]
    observed[ENERGY_LARGEST] = observed[ENERGY_START]


@called
def store(chain, ground, state, springs, work, observed, history, row):
    """Write one row of the history; stock has been taken."""
    n = chain.shape[1] - 1
    history[row, 0] = ground
    for i in range(n):
        history[row, 1 + i] = state[DISPLACEMENT, i]
        history[row, 1 + n + i] = state[VELOCITY, i]
        history[row, 1 + 2 * n + i] = work[ACCELERATION_ROW, i] + ground
        history[row, 1 + 3 * n + i] = springs[FORCE, i]
    energies = 1 + HISTORY_FIELDS * n
    for j in range(ENERGY_TERMS):
        history[row, energies + j] = observed[j]


@inlined
def beyond_limits(limits, springs, peaks, n):
    """Whether the peak drift of some story is beyond its limit, or a story has failed."""
    beyond = False
    for i in range(n):
        beyond = beyond or peaks[PEAK_DRIFT, i] > limits[LIMIT, i] * limits[HEIGHT, i]
        beyond = beyond or springs[INTERNAL, i] == limits[FAILED, i]
    return beyond


@called
def note_collapse(limits, springs, peaks, steps, observed):
    """Note which story is beyond its limits after so many whole steps; the energies have been summed up."""
    farthest = 0.0
    for i in range(limits.shape[1]):
        excess = peaks[PEAK_DRIFT, i] / limits[HEIGHT, i] - limits[LIMIT, i]
        if springs[INTERNAL, i] == limits[FAILED, i]:
            excess = math.inf
            observed[COLLAPSE_FAILED] = 1.0
        if excess > farthest:
            farthest = excess
            observed[COLLAPSE_STEP] = steps
            observed[COLLAPSE_STORY] = i
    for j in range(ENERGY_TERMS + 2):
        observed[COLLAPSE_ENERGIES + j] = observed[j]
