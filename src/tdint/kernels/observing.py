"""What is seen of a motion while it is integrated: peaks, energies, a history if asked for. O(stories) memory
otherwise."""

from __future__ import annotations

from tdint.kernels.chain import add_modal_force, force_rate, force_value
from tdint.kernels.compiling import inlined
from tdint.kernels.layout import (
    DISPLACEMENT,
    DISSIPATED,
    DRIFT,
    FLOOR,
    FLOOR_DAMPER,
    FORCE,
    GEOMETRIC,
    INVERSE_MASS,
    LINK,
    MASS,
    STORY_DAMPER,
    VELOCITY,
)
from tdint.kernels.springs import recoverable

# peaks: largest absolute values at the steps, one row each
PEAK_DRIFT = 0
PEAK_SHEAR = 1
PEAK_DISPLACEMENT = 2
PEAK_VELOCITY = 3
PEAK_ACCELERATION = 4  # absolute: relative to the ground, plus the ground's
PEAK_ROWS = 5

# history: per stored time the ground acceleration, then for all floors displacement, velocity, absolute acceleration,
# and for all stories the shear
HISTORY_FIELDS = 4

# observed: numbers of the whole run
ENERGY_START = 0  # kinetic and stored energy at the start, J
ENERGY_INPUT = 1  # work of the load on the motion relative to the ground, J
ENERGY_DAMPED = 2  # work of the viscous dampers, J
ENERGY_KINETIC = 3  # at the end, of the motion relative to the ground, J
ENERGY_RECOVERABLE = 4  # stored in the stories at the end, J
ENERGY_DISSIPATED = 5  # by the drift laws, J
ENERGY_LARGEST = 6  # largest ENERGY_START + ENERGY_INPUT on the way, J
ITERATIONS = 7
HALVINGS = 8
STEPS_REACHED = 9
_POWER_INPUT = 10  # powers and their rates at the last observed time
_RATE_INPUT = 11  # without the ground's own rate
_MOMENTUM = 12
_POWER_DAMPED = 13
_RATE_DAMPED = 14
OBSERVED_SIZE = 15

# rows of the observer's work
ACCELERATION_ROW = 0
_OTHER = 1
_SUM = 2
OBSERVER_ROWS = 3


@inlined
def observe(chain, modal, forces, t, h, ground, slope, state, springs, work, peaks, observed):
    """Take in the state at time t, reached by a step h in which the ground acceleration has the given slope.

    The acceleration is that of equilibrium at t, whatever the method carries. Call with h = 0 at the start.
    """
    n = chain.shape[1] - 1
    _story_forces(chain, state, springs, work, peaks)
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
        story = chain[STORY_DAMPER, i] * (v - link * v_below)
        damped += floor * v + story * (v - link * v_below)
        damped_rate += floor * a + story * (a - link * a_below)
        v_below = v
        a_below = a
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
    _add_work(h, slope, power, rate, momentum, damped, 2.0 * damped_rate, observed)


@inlined
def _story_forces(chain, state, springs, work, peaks):
    """Force of each story, column and damper, into its row; peaks of drift and shear."""
    n = chain.shape[1] - 1
    below = 0.0
    for i in range(n):
        v = state[VELOCITY, i]
        drift = springs[DRIFT, i]
        shear = springs[FORCE, i]
        work[_SUM, i] = shear + chain[GEOMETRIC, i] * drift + chain[STORY_DAMPER, i] * (v - chain[LINK, i] * below)
        below = v
        _raise(peaks, PEAK_DRIFT, i, drift)
        _raise(peaks, PEAK_SHEAR, i, shear)


@inlined
def _other_forces(modal, forces, t, state, work, n):
    """Forces on floors less modal damping into their row; the row stays zero where a building has neither."""
    if forces.shape[0] + modal.shape[0] > 0:
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
def _add_work(h, slope, power, rate, momentum, damped, damped_rate, observed):
    """Work of load and dampers by the corrected trapezoidal (Hermite) rule, order 4, from powers and their rates."""
    if h > 0.0:
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
def take_stock(chain, laws, state, springs, observed):
    """Kinetic, recoverable and dissipated energy of the present state, J."""
    kinetic = 0.0
    stored = 0.0
    dissipated = 0.0
    for i in range(chain.shape[1] - 1):
        drift = springs[DRIFT, i]
        kinetic += 0.5 * chain[MASS, i] * state[VELOCITY, i] * state[VELOCITY, i]
        stored += recoverable(laws, springs, i) + 0.5 * chain[GEOMETRIC, i] * drift * drift
        dissipated += springs[DISSIPATED, i]
    observed[ENERGY_KINETIC] = kinetic
    observed[ENERGY_RECOVERABLE] = stored
    observed[ENERGY_DISSIPATED] = dissipated


@inlined
def store(chain, ground, state, springs, work, history, row):
    """Write one row of the history."""
    n = chain.shape[1] - 1
    history[row, 0] = ground
    for i in range(n):
        history[row, 1 + i] = state[DISPLACEMENT, i]
        history[row, 1 + n + i] = state[VELOCITY, i]
        history[row, 1 + 2 * n + i] = work[ACCELERATION_ROW, i] + ground
        history[row, 1 + 3 * n + i] = springs[FORCE, i]
