"""What is seen of a motion while it is integrated: peaks, energies, a history if asked for.
O(stories) memory otherwise."""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import I8, TABLE, VECTOR, indirect_caller, inline, kernel, outlined
from tdint.kernels.linear_terms import (
    DASHPOTS,
    FORCES,
    MODAL,
    add_modal_force,
    force_rate,
    force_value,
    power_damper,
)
from tdint.kernels.peaks_between_steps import (
    acceleration_bulge,
    find_interstep_peaks,
    may_exceed_acceleration_peak,
    may_exceed_peaks,
    may_exceed_velocity_peak,
    raise_peak,
)
from tdint.kernels.stepping import Ends, Passage
from tdint.kernels.stories.law_state import (
    hysteretic_energy,
    restoring_force_outlined,
    start,
    strain_energy,
)


class _Powers(NamedTuple):
    """Of the load and of the dampers at one time, with their rates, and the momentum of all
    floors."""

    power: float
    rate: float  # without the ground's own rate
    momentum: float
    damped: float
    damped_rate: float


@inline
def observe(scene, span, slope, memory, seen):
    """Take in the state at the end of a span, reached by a step in which the ground acceleration
    has the given slope.

    The acceleration is that of equilibrium there, whatever the method carries. Call with a span of
    no length at the start. Returns whether a peak may be passed within the step or at its end,
    where it then is raised: in most steps none comes near, which is found without a branch.
    """
    linear_terms, modal, law_parameters, forces, flags = scene
    state, law_state = memory.state, memory.law_state
    observer_state, peaks, _, totals, _ = seen
    ground = span.ground_1
    n = linear_terms.shape[1] - 1
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        _other_forces(modal, forces, span.t, state, observer_state, n)
    by_h = 1.0 / span.h if span.h > 0.0 else 0.0
    passing = FORCES and forces.shape[0] > 0  # total shears, whose forces are not looked at here
    momentum = 0.0
    force = 0.0
    damped = 0.0
    damped_rate = 0.0
    by_all = 0.0
    # Of the floors above, as far as they stand on this one
    story_above = 0.0
    damped_above = 0.0
    moved_above = 0.0
    bulge_above = 0.0
    rate_above = 0.0
    v = state[rows.VELOCITY, n - 1]
    v_0 = observer_state[rows.V_PREVIOUS, n - 1]
    for i in range(n - 1, -1, -1):
        below = max(i - 1, 0)
        v_below = state[rows.VELOCITY, below]
        v_0_below = observer_state[rows.V_PREVIOUS, below]
        link = linear_terms[rows.LINK, i]
        mass = linear_terms[rows.MASS, i]
        drift = law_state[rows.DRIFT, i]
        shear = law_state[rows.FORCE, i]
        rate = v - link * v_below
        damper, tangent = power_damper(linear_terms, i, rate)
        by_story = linear_terms[rows.STORY_DAMPER, i] * rate
        by_floor = linear_terms[rows.FLOOR_DAMPER, i] * v
        story = shear + linear_terms[rows.GEOMETRIC, i] * drift + by_story + damper
        a = (
            linear_terms[rows.INVERSE_MASS, i]
            * (observer_state[rows.FLOOR_FORCE, i] - by_floor - story + story_above)
            - ground
        )
        observer_state[rows.OBSERVED_ACCELERATION, i] = a
        damped_above += by_floor
        if MODAL:
            damped_above += observer_state[rows.MODAL_FORCE, i]
        total = story + damped_above
        observer_state[rows.TOTAL_SHEAR, i] = total
        a_0 = observer_state[rows.A_PREVIOUS, i]
        floor = Ends(0.0, v_0, a_0, state[rows.DISPLACEMENT, i], v, a, v_0, a_0)
        moving = Ends(0.0, v_0 - link * v_0_below, 0.0, drift, rate, 0.0, 0.0, 0.0)
        passing |= may_exceed_peaks(
            span, floor, moving, shear, law_parameters[rows.STIFFNESS, i], peaks, i
        )
        inside = acceleration_bulge(by_h, floor)
        passing |= may_exceed_acceleration_peak(
            a_0 + span.ground_0, a + ground, inside, peaks[rows.PEAK_ACCELERATION, i]
        )
        moved_above += mass * (a_0 + span.ground_0)
        bulge_above += mass * inside
        passing |= may_exceed_acceleration_peak(
            moved_above, -total, bulge_above, peaks[rows.PEAK_TOTAL_SHEAR, i]
        )
        momentum += mass * v
        force += mass * a
        damped += by_floor * v + (by_story + damper) * rate
        by_story += 0.5 * (damper + tangent * rate)
        damped_rate += (by_floor + by_story - rate_above) * a
        by_all += by_floor + (1.0 - link) * by_story
        story_above = link * story
        damped_above *= link
        moved_above *= link
        bulge_above *= link
        rate_above = link * by_story
        v = v_below
        v_0 = v_0_below
    if flags[rows.OWN_WORK] == 0.0:
        power = -ground * momentum
        rate = -ground * force
        totals[rows.TOTAL_INERTIA] = force
        totals[rows.VISCOUS_PER_ACCELERATION] = by_all
        if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
            others = _other_powers(modal, forces, span.t, state, observer_state, n)
            power += others[0]
            rate += others[1]
            damped += others[2]
            damped_rate += others[3]
        _add_work(span, slope, _Powers(power, rate, momentum, damped, 2.0 * damped_rate), totals)
    elif span.h > 0.0:
        totals[rows.ENERGY_INPUT] += memory.step_status[rows.WORK_INPUT]
        totals[rows.ENERGY_VISCOUS] += memory.step_status[rows.WORK_VISCOUS]
    totals[rows.ENERGY_REFERENCE] = max(
        totals[rows.ENERGY_REFERENCE], totals[rows.ENERGY_INITIAL] + totals[rows.ENERGY_INPUT]
    )
    if DASHPOTS and flags[rows.HAS_DASHPOTS] != 0.0:
        passing |= _observe_devices(span, linear_terms, state, seen)
    if passing:
        _raise_ends(ground, state, law_state, seen)
    return passing


@outlined
def _observe_devices(span, linear_terms, state, seen):
    """Work of the dashpots, which is no longer counted as that of damping; whether a drift
    rate may pass its peak, and peaks of those at the end of the step."""
    observer_state, peaks, _, totals, _ = seen
    h = span.h
    power = power_rate = by_all = 0.0
    v_below = a_below = a_0_below = 0.0
    passing = False
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i]
        v, a = state[rows.VELOCITY, i], observer_state[rows.OBSERVED_ACCELERATION, i]
        a_0 = observer_state[rows.A_PREVIOUS, i]
        rate = v - link * v_below
        change = a - link * a_below
        ends = Ends(0.0, 0.0, a_0 - link * a_0_below, 0.0, rate, change, 0.0, 0.0)
        passing |= may_exceed_velocity_peak(span, ends, peaks[rows.PEAK_DRIFT_RATE, i])
        raise_peak(peaks, rows.PEAK_DRIFT_RATE, i, rate)
        damper, tangent = power_damper(linear_terms, i, rate)
        force = linear_terms[rows.DASHPOT, i] * rate
        power += (force + damper) * rate
        force += 0.5 * (damper + tangent * rate)
        power_rate += 2.0 * force * change
        by_all += (1.0 - link) * force
        v_below = v
        a_below = a
        a_0_below = a_0
    if h > 0.0:
        scratch = _work(
            h, totals[rows.POWER_DASHPOTS], power, totals[rows.RATE_DASHPOTS] - power_rate
        )
        totals[rows.ENERGY_DASHPOTS] += scratch
        totals[rows.ENERGY_VISCOUS] -= scratch
    totals[rows.POWER_DASHPOTS] = power
    totals[rows.RATE_DASHPOTS] = power_rate
    totals[rows.DASHPOTS_PER_ACCELERATION] = by_all
    return passing


@outlined
def _raise_ends(ground, state, law_state, seen):
    """Peaks of what has been observed."""
    observer_state, peaks, _, _, _ = seen
    for i in range(observer_state.shape[1] - 1):
        raise_peak(peaks, rows.PEAK_DRIFT, i, law_state[rows.DRIFT, i])
        raise_peak(peaks, rows.PEAK_SHEAR, i, law_state[rows.FORCE, i])
        raise_peak(peaks, rows.PEAK_DISPLACEMENT, i, state[rows.DISPLACEMENT, i])
        raise_peak(peaks, rows.PEAK_VELOCITY, i, state[rows.VELOCITY, i])
        raise_peak(
            peaks, rows.PEAK_ACCELERATION, i, observer_state[rows.OBSERVED_ACCELERATION, i] + ground
        )
        raise_peak(peaks, rows.PEAK_TOTAL_SHEAR, i, observer_state[rows.TOTAL_SHEAR, i])


@outlined
def _other_powers(modal, forces, t, state, observer_state, n):
    """Power of the floor forces and of modal damping, and half the rate of the latter."""
    power = 0.0
    rate = 0.0
    damped = 0.0
    damped_rate = 0.0
    for j in range(forces.shape[0]):
        floor = int(forces[j, rows.FLOOR])
        force = force_value(forces, j, t)
        power += force * state[rows.VELOCITY, floor]
        rate += (
            force * observer_state[rows.OBSERVED_ACCELERATION, floor]
            + force_rate(forces, j, t) * state[rows.VELOCITY, floor]
        )
    for j in range(modal.shape[0]):
        v_modal = 0.0
        a_modal = 0.0
        for i in range(n):
            v_modal += modal[j, i] * state[rows.VELOCITY, i]
            a_modal += modal[j, i] * observer_state[rows.OBSERVED_ACCELERATION, i]
        damped += v_modal * v_modal
        damped_rate += v_modal * a_modal
    return power, rate, damped, damped_rate


@outlined
def _by_all(modal, forces, t, state, n):
    """What the second and the fourth of `_other_powers` gain where all floors accelerate by 1 m/s^2
    more."""
    rate = 0.0
    damped_rate = 0.0
    for j in range(forces.shape[0]):
        rate += force_value(forces, j, t)
    for j in range(modal.shape[0]):
        v_modal = 0.0
        a_modal = 0.0
        for i in range(n):
            v_modal += modal[j, i] * state[rows.VELOCITY, i]
            a_modal += modal[j, i]
        damped_rate += v_modal * a_modal
    return rate, damped_rate


@inline
def look_between(passing, scene, span, memory, seen):
    """Peaks within the step that has been observed: those that the step itself has raised, all of
    them or, on a parabola, what has corners; else as far as its ends tell them, if one may be
    passed. Returns how many stories turned with what may be their largest shear, at the drifts in
    row TURNED_AT."""
    state, law_state, scratch, step_status = memory
    observer_state, peaks, _, _, _ = seen
    n = scene.linear_terms.shape[1] - 1
    turned = 0
    if span.cornered:
        _take_over(int(step_status[rows.STEP_PEAKS]), scratch, peaks, n)
        step_status[rows.STEP_PEAKS] = 0.0
    if passing and (span.on_path or not span.cornered):
        passage = Passage(
            observer_state, rows.U_PREVIOUS, state, observer_state, rows.OBSERVED_ACCELERATION
        )
        turned = find_interstep_peaks(
            span, scene, passage, law_state, observer_state, rows.REVERSAL_DRIFT, peaks, 0
        )
    if span.fast:
        for i in range(n):
            observer_state[rows.V_EARLIER, i] = observer_state[rows.V_PREVIOUS, i]
            observer_state[rows.A_EARLIER, i] = observer_state[rows.A_PREVIOUS, i]
    remember(state, observer_state, n)
    return turned


@outlined
def _take_over(first, scratch, peaks, n):
    """The peaks that a step has raised; it learns those of the run, beside which it looks."""
    for row in range(peaks.shape[0]):
        for i in range(n):
            raise_peak(peaks, row, i, scratch[first + row, i])
            scratch[first + row, i] = peaks[row, i]


@inline
def remember(state, observer_state, n):
    """Keep the motion that has been observed for the next step."""
    for i in range(n):
        observer_state[rows.U_PREVIOUS, i] = state[rows.DISPLACEMENT, i]
        observer_state[rows.V_PREVIOUS, i] = state[rows.VELOCITY, i]
        observer_state[rows.A_PREVIOUS, i] = observer_state[rows.OBSERVED_ACCELERATION, i]


@inline
def shift_ground(scene, load, shifts, memory, seen):
    """The line that stands for the ground acceleration begins anew, beside where the one before
    ended.

    A jump of the ground's acceleration moves all floors alike; velocities and displacements stay.
    `shifts` says what of it each row of the state takes.
    """
    linear_terms, modal, _, forces, _ = scene
    state, observer_state, totals = memory.state, seen.observer_state, seen.totals
    ground = load[rows.GROUND_0]
    shift = memory.step_status[rows.STATE_GROUND] - ground
    memory.step_status[rows.STATE_GROUND] = ground
    n = linear_terms.shape[1] - 1
    for row in range(shifts.shape[0]):
        if shifts[row] != 0.0:
            for i in range(n):
                state[row, i] += shifts[row] * shift
    for i in range(n):
        a = observer_state[rows.A_PREVIOUS, i] + shift
        observer_state[rows.OBSERVED_ACCELERATION, i] = a
        observer_state[rows.A_PREVIOUS, i] = a
    totals[rows.POWER_INPUT] += shift * totals[rows.MOMENTUM]
    totals[rows.RATE_INPUT] += shift * (
        totals[rows.TOTAL_INERTIA] - ground * totals[rows.TOTAL_MASS]
    )
    totals[rows.RATE_VISCOUS] += 2.0 * shift * totals[rows.VISCOUS_PER_ACCELERATION]
    totals[rows.RATE_DASHPOTS] += 2.0 * shift * totals[rows.DASHPOTS_PER_ACCELERATION]
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        rate, damped_rate = _by_all(modal, forces, load[rows.TIME], state, n)
        totals[rows.RATE_INPUT] += shift * rate
        totals[rows.RATE_VISCOUS] += 2.0 * shift * damped_rate


@outlined
def _other_forces(modal, forces, t, state, observer_state, n):
    """Forces on floors less modal damping into their row; the row stays zero where a building has
    neither."""
    for i in range(n):
        observer_state[rows.FLOOR_FORCE, i] = 0.0
        observer_state[rows.MODAL_FORCE, i] = 0.0
    for j in range(forces.shape[0]):
        observer_state[rows.FLOOR_FORCE, int(forces[j, rows.FLOOR])] += force_value(forces, j, t)
    add_modal_force(modal, state, rows.VELOCITY, 1.0, observer_state, rows.MODAL_FORCE, n)
    for i in range(n):
        observer_state[rows.FLOOR_FORCE, i] -= observer_state[rows.MODAL_FORCE, i]


@inline
def _work(h, power_0, power_1, change):
    """Work over a step by the corrected trapezoidal (Hermite) rule, of order 4; `change` is the
    rate of the power at its start less that at its end."""
    return 0.5 * h * (power_0 + power_1) + h * h / 12.0 * change


@inline
def _add_work(span, slope, now, totals):
    """Work of load and dampers from their powers at both ends of the step."""
    change = totals[rows.RATE_INPUT] - now.rate - slope * (totals[rows.MOMENTUM] - now.momentum)
    totals[rows.ENERGY_INPUT] += _work(span.h, totals[rows.POWER_INPUT], now.power, change)
    change = totals[rows.RATE_VISCOUS] - now.damped_rate
    totals[rows.ENERGY_VISCOUS] += _work(span.h, totals[rows.POWER_VISCOUS], now.damped, change)
    totals[rows.POWER_INPUT] = now.power
    totals[rows.RATE_INPUT] = now.rate
    totals[rows.MOMENTUM] = now.momentum
    totals[rows.POWER_VISCOUS] = now.damped
    totals[rows.RATE_VISCOUS] = now.damped_rate


@inline
def begin_energies(linear_terms, totals):
    """Energies of the initial state, of which stock has been taken."""
    totals[rows.TOTAL_MASS] = 0.0
    for i in range(linear_terms.shape[1] - 1):
        totals[rows.TOTAL_MASS] += linear_terms[rows.MASS, i]
    totals[rows.INITIAL_DISSIPATION] = totals[rows.ENERGY_HYSTERETIC]
    totals[rows.ENERGY_HYSTERETIC] = 0.0
    totals[rows.ENERGY_INITIAL] = totals[rows.ENERGY_KINETIC] + totals[rows.ENERGY_STRAIN]
    totals[rows.ENERGY_REFERENCE] = totals[rows.ENERGY_INITIAL]


@outlined
def store(ground, line, memory, seen, row):
    """Write one row of the history; stock has been taken. `line` is the ground acceleration of the
    observed motion."""
    state, law_state = memory.state, memory.law_state
    observer_state, _, _, totals, history = seen
    n = observer_state.shape[1] - 1
    history[row, 0] = ground
    for i in range(n):
        history[row, 1 + i] = state[rows.DISPLACEMENT, i]
        history[row, 1 + n + i] = state[rows.VELOCITY, i]
        history[row, 1 + 2 * n + i] = observer_state[rows.OBSERVED_ACCELERATION, i] + line
        history[row, 1 + 3 * n + i] = law_state[rows.FORCE, i]
    energies = 1 + rows.HISTORY_FIELDS * n
    for j in range(rows.ENERGY_TERMS):
        history[row, energies + j] = totals[j]


@inline
def beyond_limits(law_state, seen):
    """Whether the peak drift of some story is beyond its limit, or a story has failed."""
    limits = seen.limits
    beyond = False
    for i in range(limits.shape[1]):
        beyond |= seen.peaks[rows.PEAK_DRIFT, i] > limits[rows.LIMIT, i] * limits[rows.HEIGHT, i]
        beyond |= law_state[rows.INTERNAL, i] == limits[rows.FAILED, i]
    return beyond


@outlined
def note_collapse(law_state, steps, seen):
    """Note which story is beyond its limits after so many whole steps; the energies have been
    summed up."""
    _, peaks, limits, totals, _ = seen
    farthest = 0.0
    for i in range(limits.shape[1]):
        excess = peaks[rows.PEAK_DRIFT, i] / limits[rows.HEIGHT, i] - limits[rows.LIMIT, i]
        if law_state[rows.INTERNAL, i] == limits[rows.FAILED, i]:
            excess = math.inf
            totals[rows.COLLAPSE_FAILED] = 1.0
        if excess > farthest:
            farthest = excess
            totals[rows.COLLAPSE_STEP] = steps
            totals[rows.COLLAPSE_STORY] = i
    for j in range(rows.ENERGY_TERMS + 2):
        totals[rows.COLLAPSE_ENERGIES + j] = totals[j]


# ---- What a march asks of the drift laws beside the steps: a beginning, energies, and the forces
# where stories turned
#
# The march is given these as kernels of their own, as it is given the step, so that it is compiled
# once for all laws.

BEGIN = I8(TABLE, TABLE, TABLE, TABLE)
SUM_LAW_ENERGIES = I8(TABLE, TABLE, TABLE, TABLE, VECTOR)
UPDATE_SHEAR_PEAKS = I8(TABLE, TABLE, TABLE, I8, TABLE)

_call_begin = indirect_caller(BEGIN)
_call_sum_law_energies = indirect_caller(SUM_LAW_ENERGIES)
_call_update_shear_peaks = indirect_caller(UPDATE_SHEAR_PEAKS)


@inline
def begin_laws(begin, scene, memory):
    """Call the kernel `begin` that a march was given."""
    _call_begin(begin, scene.linear_terms, scene.law_parameters, memory.state, memory.law_state)


@inline
def sum_up(sum_law_energies, scene, memory, seen):
    """Call the kernel `sum_law_energies` that a march was given."""
    _call_sum_law_energies(
        sum_law_energies,
        scene.linear_terms,
        scene.law_parameters,
        memory.state,
        memory.law_state,
        seen.totals,
    )


@inline
def take_shears(update_shear_peaks, scene, memory, seen):
    """Call the kernel `update_shear_peaks` that a march was given."""
    _call_update_shear_peaks(
        update_shear_peaks,
        scene.law_parameters,
        memory.law_state,
        seen.observer_state,
        rows.REVERSAL_DRIFT,
        seen.peaks,
    )


@kernel(BEGIN, parts=("laws",))
def begin(linear_terms, law_parameters, state, law_state):
    """Bring all stories from rest to their initial drifts."""
    below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        start(
            law_parameters,
            law_state,
            i,
            state[rows.DISPLACEMENT, i] - linear_terms[rows.LINK, i] * below,
        )
        below = state[rows.DISPLACEMENT, i]
    return 0


@kernel(SUM_LAW_ENERGIES, parts=("laws",))
def sum_law_energies(linear_terms, law_parameters, state, law_state, totals):
    """Kinetic, recoverable and dissipated energy of the present state, J."""
    kinetic = 0.0
    stored = 0.0
    lost = 0.0
    for i in range(linear_terms.shape[1] - 1):
        drift = law_state[rows.DRIFT, i]
        kinetic += (
            0.5 * linear_terms[rows.MASS, i] * state[rows.VELOCITY, i] * state[rows.VELOCITY, i]
        )
        stored += (
            strain_energy(law_parameters, law_state, i)
            + 0.5 * linear_terms[rows.GEOMETRIC, i] * drift * drift
        )
        lost += hysteretic_energy(law_parameters, law_state, i)
    totals[rows.ENERGY_KINETIC] = kinetic
    totals[rows.ENERGY_STRAIN] = stored
    totals[rows.ENERGY_HYSTERETIC] = lost - totals[rows.INITIAL_DISSIPATION]
    return 0


@kernel(UPDATE_SHEAR_PEAKS, parts=("laws",))
def update_shear_peaks(law_parameters, law_state, turns, turn, peaks):
    """Peak shears of the stories that turned within a step, at the drifts in row `turn` of `turns`.

    From the end of the step the way leads back to where the story turned: there it finds the force
    again that it had.
    """
    for i in range(peaks.shape[1]):
        if turns[turn, i] != law_state[rows.DRIFT, i]:
            restoring_force_outlined(
                law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL, turns[turn, i]
            )
            raise_peak(peaks, rows.PEAK_SHEAR, i, law_state[rows.FIRST_TRIAL + rows.FORCE, i])
    return 0
