"""What is seen of a motion while it is integrated: peaks, energies, a history if asked for.
O(stories) memory otherwise."""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.compiling import I8, TABLE, VECTOR, called, called_at, inlined, kernel
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
from tdint.kernels.stories.law_state import dissipated, reach, recoverable, start


class _Powers(NamedTuple):
    """Of the load and of the dampers at one time, with their rates, and the momentum of all
    floors."""

    power: float
    rate: float  # without the ground's own rate
    momentum: float
    damped: float
    damped_rate: float


@inlined
def observe(scene, span, slope, memory, seen):
    """Take in the state at the end of a span, reached by a step in which the ground acceleration
    has the given slope.

    The acceleration is that of equilibrium there, whatever the method carries. Call with a span of
    no length at the start. Returns whether a peak may be passed within the step or at its end,
    where it then is raised: in most steps none comes near, which is found without a branch.
    """
    linear_terms, modal, law_parameters, forces, flags = scene
    state, springs = memory.state, memory.springs
    watch, peaks, _, totals, _ = seen
    ground = span.ground_1
    n = linear_terms.shape[1] - 1
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        _other_forces(modal, forces, span.t, state, watch, n)
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
    v = state[at.VELOCITY, n - 1]
    v_0 = watch[at.V_BEFORE, n - 1]
    for i in range(n - 1, -1, -1):
        below = max(i - 1, 0)
        v_below = state[at.VELOCITY, below]
        v_0_below = watch[at.V_BEFORE, below]
        link = linear_terms[at.LINK, i]
        mass = linear_terms[at.MASS, i]
        drift = springs[at.DRIFT, i]
        shear = springs[at.FORCE, i]
        rate = v - link * v_below
        damper, tangent = power_damper(linear_terms, i, rate)
        by_story = linear_terms[at.STORY_DAMPER, i] * rate
        by_floor = linear_terms[at.FLOOR_DAMPER, i] * v
        story = shear + linear_terms[at.GEOMETRIC, i] * drift + by_story + damper
        a = (
            linear_terms[at.INVERSE_MASS, i]
            * (watch[at.OTHER_FORCE, i] - by_floor - story + story_above)
            - ground
        )
        watch[at.ACCELERATION_NOW, i] = a
        damped_above += by_floor
        if MODAL:
            damped_above += watch[at.MODAL_FORCE, i]
        total = story + damped_above
        watch[at.TOTAL_SHEAR, i] = total
        a_0 = watch[at.A_BEFORE, i]
        floor = Ends(0.0, v_0, a_0, state[at.DISPLACEMENT, i], v, a, v_0, a_0)
        moving = Ends(0.0, v_0 - link * v_0_below, 0.0, drift, rate, 0.0, 0.0, 0.0)
        passing |= may_exceed_peaks(
            span, floor, moving, shear, law_parameters[at.STIFFNESS, i], peaks, i
        )
        inside = acceleration_bulge(by_h, floor)
        passing |= may_exceed_acceleration_peak(
            a_0 + span.ground_0, a + ground, inside, peaks[at.PEAK_ACCELERATION, i]
        )
        moved_above += mass * (a_0 + span.ground_0)
        bulge_above += mass * inside
        passing |= may_exceed_acceleration_peak(
            moved_above, -total, bulge_above, peaks[at.PEAK_TOTAL_SHEAR, i]
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
    if flags[at.OWN_WORK] == 0.0:
        power = -ground * momentum
        rate = -ground * force
        totals[at.ALL_FORCES] = force
        totals[at.DAMPED_BY_ALL] = by_all
        if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
            others = _other_powers(modal, forces, span.t, state, watch, n)
            power += others[0]
            rate += others[1]
            damped += others[2]
            damped_rate += others[3]
        _add_work(span, slope, _Powers(power, rate, momentum, damped, 2.0 * damped_rate), totals)
    elif span.h > 0.0:
        totals[at.ENERGY_INPUT] += memory.report[at.WORK_INPUT]
        totals[at.ENERGY_DAMPED] += memory.report[at.WORK_DAMPED]
    totals[at.ENERGY_LARGEST] = max(
        totals[at.ENERGY_LARGEST], totals[at.ENERGY_START] + totals[at.ENERGY_INPUT]
    )
    if DASHPOTS and flags[at.DEVICES] != 0.0:
        passing |= _observe_devices(span, linear_terms, state, seen)
    if passing:
        _raise_ends(ground, state, springs, seen)
    return passing


@called
def _observe_devices(span, linear_terms, state, seen):
    """Work of the dashpots, which is no longer counted as that of damping; whether a drift
    rate may pass its peak, and peaks of those at the end of the step."""
    watch, peaks, _, totals, _ = seen
    h = span.h
    power = power_rate = by_all = 0.0
    v_below = a_below = a_0_below = 0.0
    passing = False
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[at.LINK, i]
        v, a = state[at.VELOCITY, i], watch[at.ACCELERATION_NOW, i]
        a_0 = watch[at.A_BEFORE, i]
        rate = v - link * v_below
        change = a - link * a_below
        ends = Ends(0.0, 0.0, a_0 - link * a_0_below, 0.0, rate, change, 0.0, 0.0)
        passing |= may_exceed_velocity_peak(span, ends, peaks[at.PEAK_DRIFT_RATE, i])
        raise_peak(peaks, at.PEAK_DRIFT_RATE, i, rate)
        damper, tangent = power_damper(linear_terms, i, rate)
        force = linear_terms[at.DASHPOT, i] * rate
        power += (force + damper) * rate
        force += 0.5 * (damper + tangent * rate)
        power_rate += 2.0 * force * change
        by_all += (1.0 - link) * force
        v_below = v
        a_below = a
        a_0_below = a_0
    if h > 0.0:
        work = _work(h, totals[at.POWER_DEVICES], power, totals[at.RATE_DEVICES] - power_rate)
        totals[at.ENERGY_DEVICES] += work
        totals[at.ENERGY_DAMPED] -= work
    totals[at.POWER_DEVICES] = power
    totals[at.RATE_DEVICES] = power_rate
    totals[at.DEVICES_BY_ALL] = by_all
    return passing


@called
def _raise_ends(ground, state, springs, seen):
    """Peaks of what has been observed."""
    watch, peaks, _, _, _ = seen
    for i in range(watch.shape[1] - 1):
        raise_peak(peaks, at.PEAK_DRIFT, i, springs[at.DRIFT, i])
        raise_peak(peaks, at.PEAK_SHEAR, i, springs[at.FORCE, i])
        raise_peak(peaks, at.PEAK_DISPLACEMENT, i, state[at.DISPLACEMENT, i])
        raise_peak(peaks, at.PEAK_VELOCITY, i, state[at.VELOCITY, i])
        raise_peak(peaks, at.PEAK_ACCELERATION, i, watch[at.ACCELERATION_NOW, i] + ground)
        raise_peak(peaks, at.PEAK_TOTAL_SHEAR, i, watch[at.TOTAL_SHEAR, i])


@called
def _other_powers(modal, forces, t, state, watch, n):
    """Power of the floor forces and of modal damping, and half the rate of the latter."""
    power = 0.0
    rate = 0.0
    damped = 0.0
    damped_rate = 0.0
    for j in range(forces.shape[0]):
        floor = int(forces[j, at.FLOOR])
        force = force_value(forces, j, t)
        power += force * state[at.VELOCITY, floor]
        rate += (
            force * watch[at.ACCELERATION_NOW, floor]
            + force_rate(forces, j, t) * state[at.VELOCITY, floor]
        )
    for j in range(modal.shape[0]):
        v_modal = 0.0
        a_modal = 0.0
        for i in range(n):
            v_modal += modal[j, i] * state[at.VELOCITY, i]
            a_modal += modal[j, i] * watch[at.ACCELERATION_NOW, i]
        damped += v_modal * v_modal
        damped_rate += v_modal * a_modal
    return power, rate, damped, damped_rate


@called
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
            v_modal += modal[j, i] * state[at.VELOCITY, i]
            a_modal += modal[j, i]
        damped_rate += v_modal * a_modal
    return rate, damped_rate


@inlined
def look_between(passing, scene, span, memory, seen):
    """Peaks within the step that has been observed: those that the step itself has raised, all of
    them or, on a parabola, what has corners; else as far as its ends tell them, if one may be
    passed. Returns how many stories turned with what may be their largest shear, at the drifts in
    row TURNED_AT."""
    state, springs, work, report = memory
    watch, peaks, _, _, _ = seen
    n = scene.linear_terms.shape[1] - 1
    turned = 0
    if span.cornered:
        _take_over(int(report[at.WITHIN]), work, peaks, n)
        report[at.WITHIN] = 0.0
    if passing and (span.on_path or not span.cornered):
        passage = Passage(watch, at.U_BEFORE, state, watch, at.ACCELERATION_NOW)
        turned = find_interstep_peaks(span, scene, passage, springs, watch, at.TURNED_AT, peaks, 0)
    if span.fast:
        for i in range(n):
            watch[at.V_EARLIER, i] = watch[at.V_BEFORE, i]
            watch[at.A_EARLIER, i] = watch[at.A_BEFORE, i]
    remember(state, watch, n)
    return turned


@called
def _take_over(first, work, peaks, n):
    """The peaks that a step has raised; it learns those of the run, beside which it looks."""
    for row in range(peaks.shape[0]):
        for i in range(n):
            raise_peak(peaks, row, i, work[first + row, i])
            work[first + row, i] = peaks[row, i]


@inlined
def remember(state, watch, n):
    """Keep the motion that has been observed for the next step."""
    for i in range(n):
        watch[at.U_BEFORE, i] = state[at.DISPLACEMENT, i]
        watch[at.V_BEFORE, i] = state[at.VELOCITY, i]
        watch[at.A_BEFORE, i] = watch[at.ACCELERATION_NOW, i]


@inlined
def shift_ground(scene, load, shifts, memory, seen):
    """The line that stands for the ground acceleration begins anew, beside where the one before
    ended.

    A jump of the ground's acceleration moves all floors alike; velocities and displacements stay.
    `shifts` says what of it each row of the state takes.
    """
    linear_terms, modal, _, forces, _ = scene
    state, watch, totals = memory.state, seen.watch, seen.totals
    ground = load[at.GROUND_0]
    shift = memory.report[at.CARRIED_GROUND] - ground
    memory.report[at.CARRIED_GROUND] = ground
    n = linear_terms.shape[1] - 1
    for row in range(shifts.shape[0]):
        if shifts[row] != 0.0:
            for i in range(n):
                state[row, i] += shifts[row] * shift
    for i in range(n):
        a = watch[at.A_BEFORE, i] + shift
        watch[at.ACCELERATION_NOW, i] = a
        watch[at.A_BEFORE, i] = a
    totals[at.POWER_INPUT] += shift * totals[at.MOMENTUM]
    totals[at.RATE_INPUT] += shift * (totals[at.ALL_FORCES] - ground * totals[at.ALL_MASSES])
    totals[at.RATE_DAMPED] += 2.0 * shift * totals[at.DAMPED_BY_ALL]
    totals[at.RATE_DEVICES] += 2.0 * shift * totals[at.DEVICES_BY_ALL]
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        rate, damped_rate = _by_all(modal, forces, load[at.TIME], state, n)
        totals[at.RATE_INPUT] += shift * rate
        totals[at.RATE_DAMPED] += 2.0 * shift * damped_rate


@called
def _other_forces(modal, forces, t, state, watch, n):
    """Forces on floors less modal damping into their row; the row stays zero where a building has
    neither."""
    for i in range(n):
        watch[at.OTHER_FORCE, i] = 0.0
        watch[at.MODAL_FORCE, i] = 0.0
    for j in range(forces.shape[0]):
        watch[at.OTHER_FORCE, int(forces[j, at.FLOOR])] += force_value(forces, j, t)
    add_modal_force(modal, state, at.VELOCITY, 1.0, watch, at.MODAL_FORCE, n)
    for i in range(n):
        watch[at.OTHER_FORCE, i] -= watch[at.MODAL_FORCE, i]


@inlined
def _work(h, power_0, power_1, change):
    """Work over a step by the corrected trapezoidal (Hermite) rule, of order 4; `change` is the
    rate of the power at its start less that at its end."""
    return 0.5 * h * (power_0 + power_1) + h * h / 12.0 * change


@inlined
def _add_work(span, slope, now, totals):
    """Work of load and dampers from their powers at both ends of the step."""
    change = totals[at.RATE_INPUT] - now.rate - slope * (totals[at.MOMENTUM] - now.momentum)
    totals[at.ENERGY_INPUT] += _work(span.h, totals[at.POWER_INPUT], now.power, change)
    change = totals[at.RATE_DAMPED] - now.damped_rate
    totals[at.ENERGY_DAMPED] += _work(span.h, totals[at.POWER_DAMPED], now.damped, change)
    totals[at.POWER_INPUT] = now.power
    totals[at.RATE_INPUT] = now.rate
    totals[at.MOMENTUM] = now.momentum
    totals[at.POWER_DAMPED] = now.damped
    totals[at.RATE_DAMPED] = now.damped_rate


@inlined
def begin_energies(linear_terms, totals):
    """Energies of the initial state, of which stock has been taken."""
    totals[at.ALL_MASSES] = 0.0
    for i in range(linear_terms.shape[1] - 1):
        totals[at.ALL_MASSES] += linear_terms[at.MASS, i]
    totals[at.DISSIPATED_BEFORE] = totals[at.ENERGY_DISSIPATED]
    totals[at.ENERGY_DISSIPATED] = 0.0
    totals[at.ENERGY_START] = totals[at.ENERGY_KINETIC] + totals[at.ENERGY_RECOVERABLE]
    totals[at.ENERGY_LARGEST] = totals[at.ENERGY_START]


@called
def store(ground, line, memory, seen, row):
    """Write one row of the history; stock has been taken. `line` is the ground acceleration of the
    observed motion."""
    state, springs = memory.state, memory.springs
    watch, _, _, totals, history = seen
    n = watch.shape[1] - 1
    history[row, 0] = ground
    for i in range(n):
        history[row, 1 + i] = state[at.DISPLACEMENT, i]
        history[row, 1 + n + i] = state[at.VELOCITY, i]
        history[row, 1 + 2 * n + i] = watch[at.ACCELERATION_NOW, i] + line
        history[row, 1 + 3 * n + i] = springs[at.FORCE, i]
    energies = 1 + at.HISTORY_FIELDS * n
    for j in range(at.ENERGY_TERMS):
        history[row, energies + j] = totals[j]


@inlined
def beyond_limits(springs, seen):
    """Whether the peak drift of some story is beyond its limit, or a story has failed."""
    limits = seen.limits
    beyond = False
    for i in range(limits.shape[1]):
        beyond |= seen.peaks[at.PEAK_DRIFT, i] > limits[at.LIMIT, i] * limits[at.HEIGHT, i]
        beyond |= springs[at.INTERNAL, i] == limits[at.FAILED, i]
    return beyond


@called
def note_collapse(springs, steps, seen):
    """Note which story is beyond its limits after so many whole steps; the energies have been
    summed up."""
    _, peaks, limits, totals, _ = seen
    farthest = 0.0
    for i in range(limits.shape[1]):
        excess = peaks[at.PEAK_DRIFT, i] / limits[at.HEIGHT, i] - limits[at.LIMIT, i]
        if springs[at.INTERNAL, i] == limits[at.FAILED, i]:
            excess = math.inf
            totals[at.COLLAPSE_FAILED] = 1.0
        if excess > farthest:
            farthest = excess
            totals[at.COLLAPSE_STEP] = steps
            totals[at.COLLAPSE_STORY] = i
    for j in range(at.ENERGY_TERMS + 2):
        totals[at.COLLAPSE_ENERGIES + j] = totals[j]


# ---- What a march asks of the drift laws beside the steps: a beginning, energies, and the forces
# where stories turned
#
# The march is given these as kernels of their own, as it is given the step, so that it is compiled
# once for all laws.

BEGIN = I8(TABLE, TABLE, TABLE, TABLE)
TAKE_STOCK = I8(TABLE, TABLE, TABLE, TABLE, VECTOR)
RAISE_SHEARS = I8(TABLE, TABLE, TABLE, I8, TABLE)

_call_begin = called_at(BEGIN)
_call_take_stock = called_at(TAKE_STOCK)
_call_raise_shears = called_at(RAISE_SHEARS)


@inlined
def begin_laws(begin, scene, memory):
    """Call the kernel `begin` that a march was given."""
    _call_begin(begin, scene.linear_terms, scene.law_parameters, memory.state, memory.springs)


@inlined
def sum_up(take_stock, scene, memory, seen):
    """Call the kernel `take_stock` that a march was given."""
    _call_take_stock(
        take_stock,
        scene.linear_terms,
        scene.law_parameters,
        memory.state,
        memory.springs,
        seen.totals,
    )


@inlined
def take_shears(raise_shears, scene, memory, seen):
    """Call the kernel `raise_shears` that a march was given."""
    _call_raise_shears(
        raise_shears, scene.law_parameters, memory.springs, seen.watch, at.TURNED_AT, seen.peaks
    )


@kernel(BEGIN, parts=("laws",))
def begin(linear_terms, law_parameters, state, springs):
    """Bring all stories from rest to their initial drifts."""
    below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        start(
            law_parameters, springs, i, state[at.DISPLACEMENT, i] - linear_terms[at.LINK, i] * below
        )
        below = state[at.DISPLACEMENT, i]
    return 0


@kernel(TAKE_STOCK, parts=("laws",))
def take_stock(linear_terms, law_parameters, state, springs, totals):
    """Kinetic, recoverable and dissipated energy of the present state, J."""
    kinetic = 0.0
    stored = 0.0
    lost = 0.0
    for i in range(linear_terms.shape[1] - 1):
        drift = springs[at.DRIFT, i]
        kinetic += 0.5 * linear_terms[at.MASS, i] * state[at.VELOCITY, i] * state[at.VELOCITY, i]
        stored += (
            recoverable(law_parameters, springs, i)
            + 0.5 * linear_terms[at.GEOMETRIC, i] * drift * drift
        )
        lost += dissipated(law_parameters, springs, i)
    totals[at.ENERGY_KINETIC] = kinetic
    totals[at.ENERGY_RECOVERABLE] = stored
    totals[at.ENERGY_DISSIPATED] = lost - totals[at.DISSIPATED_BEFORE]
    return 0


@kernel(RAISE_SHEARS, parts=("laws",))
def raise_shears(law_parameters, springs, turns, turn, peaks):
    """Peak shears of the stories that turned within a step, at the drifts in row `turn` of `turns`.

    From the end of the step the way leads back to where the story turned: there it finds the force
    again that it had.
    """
    for i in range(peaks.shape[1]):
        if turns[turn, i] != springs[at.DRIFT, i]:
            reach(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL, turns[turn, i])
            raise_peak(peaks, at.PEAK_SHEAR, i, springs[at.FIRST_TRIAL + at.FORCE, i])
    return 0
