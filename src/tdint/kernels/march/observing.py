"""What is seen of a motion while it is integrated: peaks, energies, a history if asked for. O(stories) memory
otherwise."""

from __future__ import annotations

import math

from tdint.kernels import layout as at
from tdint.kernels.chain import FORCES, MODAL, add_modal_force, force_rate, force_value, power_damper
from tdint.kernels.compiling import called, inlined
from tdint.kernels.march.within import look_within, raise_peak

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
        v = state[at.VELOCITY, i]
        inner = work[_OTHER, i] - chain[at.FLOOR_DAMPER, i] * v
        inner = inner - work[_SUM, i] + chain[at.LINK, i + 1] * work[_SUM, i + 1]
        a = chain[at.INVERSE_MASS, i] * inner - ground
        work[ACCELERATION_ROW, i] = a
        near |= raise_peak(peaks, at.PEAK_DISPLACEMENT, i, state[at.DISPLACEMENT, i])
        near |= raise_peak(peaks, at.PEAK_VELOCITY, i, v)
        near |= raise_peak(peaks, at.PEAK_ACCELERATION, i, a + ground)
        link = chain[at.LINK, i]
        rate_of_drift = v - link * v_below
        story, tangent = power_damper(chain, i, rate_of_drift)
        by_story = chain[at.STORY_DAMPER, i] * rate_of_drift
        damped += chain[at.FLOOR_DAMPER, i] * v * v + (by_story + story) * rate_of_drift
        by_floor = chain[at.FLOOR_DAMPER, i] * v
        by_story += 0.5 * (story + tangent * rate_of_drift)
        damped_rate += by_floor * a + by_story * (a - link * a_below)
        by_all += by_floor + (1.0 - link) * by_story
        momentum += chain[at.MASS, i] * v
        force += chain[at.MASS, i] * a
        v_below = v
        a_below = a
    power = -ground * momentum
    rate = -ground * force
    observed[at.ALL_FORCES] = force
    observed[at.DAMPED_BY_ALL] = by_all
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
        floor = int(forces[j, at.FLOOR])
        force = force_value(forces, j, t)
        power += force * state[at.VELOCITY, floor]
        rate += force * work[ACCELERATION_ROW, floor] + force_rate(forces, j, t) * state[at.VELOCITY, floor]
    for j in range(modal.shape[0]):
        v_modal = 0.0
        a_modal = 0.0
        for i in range(n):
            v_modal += modal[j, i] * state[at.VELOCITY, i]
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
            v_modal += modal[j, i] * state[at.VELOCITY, i]
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
    if memo[at.WITHIN] != 0.0:
        _take_over(int(memo[at.WITHIN]), step_work, peaks, n)
        memo[at.WITHIN] = 0.0
    elif near or observed[at.NEAR_PEAK] != 0.0:
        turned = look_within(
            observed[at.ON_PATH] != 0.0, memo[at.FAST] != 0.0, chain, laws, h, ground_0, ground_1, work, _OLD_U, state,
            work, ACCELERATION_ROW, springs, work, TURN, peaks, 0,
        )  # fmt: skip
    observed[at.NEAR_PEAK] = 1.0 if near else 0.0
    if memo[at.FAST] != 0.0:
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
        work[_OLD_U, i] = state[at.DISPLACEMENT, i]
        work[_OLD_V, i] = state[at.VELOCITY, i]
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
    observed[at.POWER_INPUT] += shift * observed[at.MOMENTUM]
    observed[at.RATE_INPUT] += shift * (observed[at.ALL_FORCES] - ground * observed[at.ALL_MASSES])
    observed[at.RATE_DAMPED] += 2.0 * shift * observed[at.DAMPED_BY_ALL]
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        rate, damped_rate = _by_all(modal, forces, t, state, n)
        observed[at.RATE_INPUT] += shift * rate
        observed[at.RATE_DAMPED] += 2.0 * shift * damped_rate


@inlined
def _story_forces(chain, state, springs, work, peaks):
    """Force of each story, column and damper, into its row; peaks of drift and shear. Returns as `observe` does."""
    n = chain.shape[1] - 1
    near = False
    below = 0.0
    for i in range(n):
        v = state[at.VELOCITY, i]
        drift = springs[at.DRIFT, i]
        shear = springs[at.FORCE, i]
        rate = v - chain[at.LINK, i] * below
        work[_SUM, i] = shear + chain[at.GEOMETRIC, i] * drift + chain[at.STORY_DAMPER, i] * rate
        work[_SUM, i] += power_damper(chain, i, rate)[0]
        below = v
        near |= raise_peak(peaks, at.PEAK_DRIFT, i, drift)
        near |= raise_peak(peaks, at.PEAK_SHEAR, i, shear)
    return near


@called
def _other_forces(modal, forces, t, state, work, n):
    """Forces on floors less modal damping into their row; the row stays zero where a building has neither."""
    for i in range(n):
        work[_OTHER, i] = 0.0
    for j in range(forces.shape[0]):
        work[_OTHER, int(forces[j, at.FLOOR])] += force_value(forces, j, t)
    add_modal_force(modal, state, at.VELOCITY, -1.0, work, _OTHER, n)


@inlined
def _add_work(h, slope, power, rate, momentum, damped, damped_rate, memo, observed):
    """Work of load and dampers: as the step has it, if it tells; else by the corrected trapezoidal (Hermite) rule, of
    order 4, from powers and their rates."""
    if h > 0.0 and memo[at.OWN_WORK] != 0.0:
        observed[at.ENERGY_INPUT] += memo[at.WORK_INPUT]
        observed[at.ENERGY_DAMPED] += memo[at.WORK_DAMPED]
        observed[at.ENERGY_LARGEST] = max(
            observed[at.ENERGY_LARGEST], observed[at.ENERGY_START] + observed[at.ENERGY_INPUT]
        )
    elif h > 0.0:
        ends = observed[at.RATE_INPUT] - rate - slope * (observed[at.MOMENTUM] - momentum)
        observed[at.ENERGY_INPUT] += 0.5 * h * (observed[at.POWER_INPUT] + power) + h * h / 12.0 * ends
        ends = observed[at.RATE_DAMPED] - damped_rate
        observed[at.ENERGY_DAMPED] += 0.5 * h * (observed[at.POWER_DAMPED] + damped) + h * h / 12.0 * ends
        observed[at.ENERGY_LARGEST] = max(
            observed[at.ENERGY_LARGEST], observed[at.ENERGY_START] + observed[at.ENERGY_INPUT]
        )
    observed[at.POWER_INPUT] = power
    observed[at.RATE_INPUT] = rate
    observed[at.MOMENTUM] = momentum
    observed[at.POWER_DAMPED] = damped
    observed[at.RATE_DAMPED] = damped_rate


@inlined
def begin_energies(chain, observed):
    """Energies of the initial state, of which stock has been taken."""
    observed[at.ALL_MASSES] = 0.0
    for i in range(chain.shape[1] - 1):
        observed[at.ALL_MASSES] += chain[at.MASS, i]
    observed[at.DISSIPATED_BEFORE] = observed[at.ENERGY_DISSIPATED]
    observed[at.ENERGY_DISSIPATED] = 0.0
    observed[at.ENERGY_START] = observed[at.ENERGY_KINETIC] + observed[at.ENERGY_RECOVERABLE]
    observed[at.ENERGY_LARGEST] = observed[at.ENERGY_START]


@called
def store(chain, ground, line, state, springs, work, observed, history, row):
    """Write one row of the history; stock has been taken. `line` is the ground acceleration of the observed motion."""
    n = chain.shape[1] - 1
    history[row, 0] = ground
    for i in range(n):
        history[row, 1 + i] = state[at.DISPLACEMENT, i]
        history[row, 1 + n + i] = state[at.VELOCITY, i]
        history[row, 1 + 2 * n + i] = work[ACCELERATION_ROW, i] + line
        history[row, 1 + 3 * n + i] = springs[at.FORCE, i]
    energies = 1 + at.HISTORY_FIELDS * n
    for j in range(at.ENERGY_TERMS):
        history[row, energies + j] = observed[j]


@inlined
def beyond_limits(limits, springs, peaks, n):
    """Whether the peak drift of some story is beyond its limit, or a story has failed."""
    beyond = False
    for i in range(n):
        beyond |= peaks[at.PEAK_DRIFT, i] > limits[at.LIMIT, i] * limits[at.HEIGHT, i]
        beyond |= springs[at.INTERNAL, i] == limits[at.FAILED, i]
    return beyond


@called
def note_collapse(limits, springs, peaks, steps, observed):
    """Note which story is beyond its limits after so many whole steps; the energies have been summed up."""
    farthest = 0.0
    for i in range(limits.shape[1]):
        excess = peaks[at.PEAK_DRIFT, i] / limits[at.HEIGHT, i] - limits[at.LIMIT, i]
        if springs[at.INTERNAL, i] == limits[at.FAILED, i]:
            excess = math.inf
            observed[at.COLLAPSE_FAILED] = 1.0
        if excess > farthest:
            farthest = excess
            observed[at.COLLAPSE_STEP] = steps
            observed[at.COLLAPSE_STORY] = i
    for j in range(at.ENERGY_TERMS + 2):
        observed[at.COLLAPSE_ENERGIES + j] = observed[j]
