"""What is seen of a motion while it is integrated: peaks, energies, a history if asked for. O(stories) memory
otherwise."""

from __future__ import annotations

import math

from tdint.kernels.chain import FORCES, MODAL, add_modal_force, force_rate, force_value, power_damper
from tdint.kernels.compiling import called, inlined
from tdint.kernels.layout import (
    DISPLACEMENT,
    DRIFT,
    FAST,
    FLOOR,
    FLOOR_DAMPER,
    FORCE,
    GEOMETRIC,
    INTERNAL,
    INVERSE_MASS,
    LINK,
    MASS,
    OWN_WORK,
    PEAK_ACCELERATION,
    PEAK_DISPLACEMENT,
    PEAK_DRIFT,
    PEAK_SHEAR,
    PEAK_VELOCITY,
    STORY_DAMPER,
    VELOCITY,
    WITHIN,
    WORK_DAMPED,
    WORK_INPUT,
)
from tdint.kernels.march.within import look_within, raise_peak

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
ON_PATH = ENERGY_TERMS + 10  # set before the march: 1 if displacements follow parabolas within a step
DISSIPATED_BEFORE = ENERGY_TERMS + 11  # by the drift laws on the way to the initial drifts, J
COLLAPSE_STEP = ENERGY_TERMS + 12  # whole steps after which a story was first beyond a limit; NO_COLLAPSE for none
COLLAPSE_STORY = ENERGY_TERMS + 13  # the first story that failed, else the one farthest beyond its limit then
COLLAPSE_FAILED = ENERGY_TERMS + 14  # 1 if it failed
COLLAPSE_ENERGIES = ENERGY_TERMS + 15  # the energies then, ENERGY_START and ENERGY_LARGEST after them
_NEAR = COLLAPSE_ENERGIES + ENERGY_TERMS + 2  # 1 if a value at the last observed time was near its peak
_FORCE = _NEAR + 1  # masses times accelerations at that time
_BY_ALL = _NEAR + 2  # half of what the rate of the damped power gains where all floors accelerate by 1 m/s^2 more
_MASS = _NEAR + 3  # of all floors
OBSERVED_SIZE = _NEAR + 4

NO_COLLAPSE = -1.0

# limits: by story
LIMIT = 0  # drift ratio beyond which it has collapsed
HEIGHT = 1  # m; nan for a story without a limit
FAILED = 2  # what INTERNAL is once the story carries nothing any more; nan where that does not happen

# rows of the observer's work
ACCELERATION_ROW = 0
_OTHER = 1
_SUM = 2
_OLD_U = 3  # at the last observed time
_OLD_V = 4
_OLD_A = 5
_OLDER_V = 6  # one step before that
_OLDER_A = 7
TURN = 8  # where stories turned
OBSERVER_ROWS = 9


@inlined
def observe(chain, modal, forces, t, h, ground, slope, state, springs, memo, work, peaks, observed):
    """Take in the state at time t, reached by a step h in which the ground acceleration has the given slope.

    The acceleration is that of equilibrium at t, whatever the method carries. Call with h = 0 at the start. Returns
    whether a value is near its peak (`raise_peak`).
    """
    n = chain.shape[1] - 1
    near = _story_forces(chain, state, springs, work, peaks)
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        _other_forces(modal, forces, t, state, work, n)
    momentum = 0.0
    force = 0.0
    damped = 0.0
    damped_rate = 0.0
    by_all = 0.0
    v_below = 0.0
    a_below = 0.0
    for i in range(n):
        v = state[VELOCITY, i]
        inner = work[_OTHER, i] - chain[FLOOR_DAMPER, i] * v
        inner = inner - work[_SUM, i] + chain[LINK, i + 1] * work[_SUM, i + 1]
        a = chain[INVERSE_MASS, i] * inner - ground
        work[ACCELERATION_ROW, i] = a
        near |= raise_peak(peaks, PEAK_DISPLACEMENT, i, state[DISPLACEMENT, i])
        near |= raise_peak(peaks, PEAK_VELOCITY, i, v)
        near |= raise_peak(peaks, PEAK_ACCELERATION, i, a + ground)
        link = chain[LINK, i]
        rate_of_drift = v - link * v_below
        story, tangent = power_damper(chain, i, rate_of_drift)
        by_story = chain[STORY_DAMPER, i] * rate_of_drift
        damped += chain[FLOOR_DAMPER, i] * v * v + (by_story + story) * rate_of_drift
        by_floor = chain[FLOOR_DAMPER, i] * v
        by_story += 0.5 * (story + tangent * rate_of_drift)
        damped_rate += by_floor * a + by_story * (a - link * a_below)
        by_all += by_floor + (1.0 - link) * by_story
        momentum += chain[MASS, i] * v
        force += chain[MASS, i] * a
        v_below = v
        a_below = a
    power = -ground * momentum
    rate = -ground * force
    observed[_FORCE] = force
    observed[_BY_ALL] = by_all
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        others = _other_powers(modal, forces, t, state, work, n)
        power += others[0]
        rate += others[1]
        damped += others[2]
        damped_rate += others[3]
    _add_work(h, slope, power, rate, momentum, damped, 2.0 * damped_rate, memo, observed)
    return near


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
def _by_all(modal, forces, t, state, n):
    """What the second and the fourth of `_other_powers` gain where all floors accelerate by 1 m/s^2 more."""
    rate = 0.0
    damped_rate = 0.0
    for j in range(forces.shape[0]):
        rate += force_value(forces, j, t)
    for j in range(modal.shape[0]):
        v_modal = 0.0
        a_modal = 0.0
        for i in range(n):
            v_modal += modal[j, i] * state[VELOCITY, i]
            a_modal += modal[j, i]
        damped_rate += v_modal * a_modal
    return rate, damped_rate


@inlined
def look_between(near, chain, laws, h, ground_0, ground_1, state, springs, work, step_work, memo, peaks, observed):
    """Peaks within the step that has been observed: those that the step itself has raised, else as far as its ends tell
    them, if one has a value near its peak. Returns how many stories turned with what may be their largest shear, at the
    drifts in row TURN."""
    n = chain.shape[1] - 1
    turned = 0
    if memo[WITHIN] != 0.0:
        _take_over(int(memo[WITHIN]), step_work, peaks, n)
        memo[WITHIN] = 0.0
    elif near or observed[_NEAR] != 0.0:
        turned = look_within(
            observed[ON_PATH] != 0.0, memo[FAST] != 0.0, chain, laws, h, ground_0, ground_1, work, _OLD_U, state, work,
            ACCELERATION_ROW, springs, work, TURN, peaks, 0,
        )  # fmt: skip
    observed[_NEAR] = 1.0 if near else 0.0
    if memo[FAST] != 0.0:
        for i in range(n):
            work[_OLDER_V, i] = work[_OLD_V, i]
            work[_OLDER_A, i] = work[_OLD_A, i]
    remember(state, work, n)
    return turned


@called
def _take_over(first, step_work, peaks, n):
    """The peaks that a step has raised; it learns those of the run, beside which it looks."""
    for row in range(peaks.shape[0]):
        for i in range(n):
            raise_peak(peaks, row, i, step_work[first + row, i])
            step_work[first + row, i] = peaks[row, i]


@inlined
def remember(state, work, n):
    """Keep the motion that has been observed for the next step."""
    for i in range(n):
        work[_OLD_U, i] = state[DISPLACEMENT, i]
        work[_OLD_V, i] = state[VELOCITY, i]
        work[_OLD_A, i] = work[ACCELERATION_ROW, i]


@inlined
def shift_ground(chain, modal, forces, t, shift, ground, shifts, state, work, observed):
    """The line that stands for the ground acceleration begins at `ground`, and the one before ended `shift` above.

    A jump of the ground's acceleration moves all floors alike; velocities and displacements stay. `shifts` says what of
    it each row of the state takes.
    """
    n = chain.shape[1] - 1
    for row in range(shifts.size):
        if shifts[row] != 0.0:
            for i in range(n):
                state[row, i] += shifts[row] * shift
    for i in range(n):
        a = work[_OLD_A, i] + shift
        work[ACCELERATION_ROW, i] = a
        work[_OLD_A, i] = a
    observed[_POWER_INPUT] += shift * observed[_MOMENTUM]
    observed[_RATE_INPUT] += shift * (observed[_FORCE] - ground * observed[_MASS])
    observed[_RATE_DAMPED] += 2.0 * shift * observed[_BY_ALL]
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        rate, damped_rate = _by_all(modal, forces, t, state, n)
        observed[_RATE_INPUT] += shift * rate
        observed[_RATE_DAMPED] += 2.0 * shift * damped_rate


@inlined
def _story_forces(chain, state, springs, work, peaks):
    """Force of each story, column and damper, into its row; peaks of drift and shear. Returns as `observe` does."""
    n = chain.shape[1] - 1
    near = False
    below = 0.0
    for i in range(n):
        v = state[VELOCITY, i]
        drift = springs[DRIFT, i]
        shear = springs[FORCE, i]
        rate = v - chain[LINK, i] * below
        work[_SUM, i] = shear + chain[GEOMETRIC, i] * drift + chain[STORY_DAMPER, i] * rate
        work[_SUM, i] += power_damper(chain, i, rate)[0]
        below = v
        near |= raise_peak(peaks, PEAK_DRIFT, i, drift)
        near |= raise_peak(peaks, PEAK_SHEAR, i, shear)
    return near


@called
def _other_forces(modal, forces, t, state, work, n):
    """Forces on floors less modal damping into their row; the row stays zero where a building has neither."""
    for i in range(n):
        work[_OTHER, i] = 0.0
    for j in range(forces.shape[0]):
        work[_OTHER, int(forces[j, FLOOR])] += force_value(forces, j, t)
    add_modal_force(modal, state, VELOCITY, -1.0, work, _OTHER, n)


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
def begin_energies(chain, observed):
    """Energies of the initial state, of which stock has been taken."""
    observed[_MASS] = 0.0
    for i in range(chain.shape[1] - 1):
        observed[_MASS] += chain[MASS, i]
    observed[DISSIPATED_BEFORE] = observed[ENERGY_DISSIPATED]
    observed[ENERGY_DISSIPATED] = 0.0
    observed[ENERGY_START] = observed[ENERGY_KINETIC] + observed[ENERGY_RECOVERABLE]
    observed[ENERGY_LARGEST] = observed[ENERGY_START]


@called
def store(chain, ground, line, state, springs, work, observed, history, row):
    """Write one row of the history; stock has been taken. `line` is the ground acceleration of the observed motion."""
    n = chain.shape[1] - 1
    history[row, 0] = ground
    for i in range(n):
        history[row, 1 + i] = state[DISPLACEMENT, i]
        history[row, 1 + n + i] = state[VELOCITY, i]
        history[row, 1 + 2 * n + i] = work[ACCELERATION_ROW, i] + line
        history[row, 1 + 3 * n + i] = springs[FORCE, i]
    energies = 1 + HISTORY_FIELDS * n
    for j in range(ENERGY_TERMS):
        history[row, energies + j] = observed[j]


@inlined
def beyond_limits(limits, springs, peaks, n):
    """Whether the peak drift of some story is beyond its limit, or a story has failed."""
    beyond = False
    for i in range(n):
        beyond |= peaks[PEAK_DRIFT, i] > limits[LIMIT, i] * limits[HEIGHT, i]
        beyond |= springs[INTERNAL, i] == limits[FAILED, i]
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
