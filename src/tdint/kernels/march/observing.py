"""What is seen of a motion while it is integrated: peaks, energies, a history if asked for. O(stories) memory
otherwise."""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.bundles import Passage
from tdint.kernels.compiling import called, inlined
from tdint.kernels.linear_terms import DASHPOTS, FORCES, MODAL, add_modal_force, force_rate, force_value, power_damper
from tdint.kernels.march.peaks_between_steps import look_within, raise_peak


class _Powers(NamedTuple):
    """Of the load and of the dampers at one time, with their rates, and the momentum of all floors."""

    power: float
    rate: float  # without the ground's own rate
    momentum: float
    damped: float
    damped_rate: float
    devices: float
    devices_rate: float


@inlined
def observe(scene, t, span, slope, memory, seen):
    """Take in the state at time t, reached by a step in which the ground acceleration has the given slope.

    The acceleration is that of equilibrium at t, whatever the method carries. Call with a span of no length at the
    start. Returns whether a value is near its peak (`raise_peak`).
    """
    linear_terms, modal, _, forces, _ = scene
    state = memory.state
    watch, peaks, _, totals, _ = seen
    ground = span.ground_1
    n = linear_terms.shape[1] - 1
    near = _story_forces(linear_terms, state, memory.springs, watch, peaks)
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        _other_forces(modal, forces, t, state, watch, n)
    momentum = 0.0
    force = 0.0
    damped = 0.0
    damped_rate = 0.0
    by_all = 0.0
    devices = 0.0
    devices_rate = 0.0
    devices_by_all = 0.0
    v_below = 0.0
    a_below = 0.0
    for i in range(n):
        v = state[at.VELOCITY, i]
        inner = watch[at.OTHER_FORCE, i] - linear_terms[at.FLOOR_DAMPER, i] * v
        inner = inner - watch[at.STORY_FORCE, i] + linear_terms[at.LINK, i + 1] * watch[at.STORY_FORCE, i + 1]
        a = linear_terms[at.INVERSE_MASS, i] * inner - ground
        watch[at.ACCELERATION_NOW, i] = a
        near |= raise_peak(peaks, at.PEAK_DISPLACEMENT, i, state[at.DISPLACEMENT, i])
        near |= raise_peak(peaks, at.PEAK_VELOCITY, i, v)
        near |= raise_peak(peaks, at.PEAK_ACCELERATION, i, a + ground)
        link = linear_terms[at.LINK, i]
        rate_of_drift = v - link * v_below
        story, tangent = power_damper(linear_terms, i, rate_of_drift)
        by_story = linear_terms[at.STORY_DAMPER, i] * rate_of_drift
        damped += linear_terms[at.FLOOR_DAMPER, i] * v * v + (by_story + story) * rate_of_drift
        by_floor = linear_terms[at.FLOOR_DAMPER, i] * v
        by_story += 0.5 * (story + tangent * rate_of_drift)
        damped_rate += by_floor * a + by_story * (a - link * a_below)
        by_all += by_floor + (1.0 - link) * by_story
        if DASHPOTS:
            device = linear_terms[at.DASHPOT, i] * rate_of_drift
            devices += (device + story) * rate_of_drift
            device += 0.5 * (story + tangent * rate_of_drift)
            devices_rate += device * (a - link * a_below)
            devices_by_all += (1.0 - link) * device
        momentum += linear_terms[at.MASS, i] * v
        force += linear_terms[at.MASS, i] * a
        v_below = v
        a_below = a
    near |= _total_shears(scene, state, watch, peaks)
    power = -ground * momentum
    rate = -ground * force
    totals[at.ALL_FORCES] = force
    totals[at.DAMPED_BY_ALL] = by_all
    totals[at.DEVICES_BY_ALL] = devices_by_all
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        others = _other_powers(modal, forces, t, state, watch, n)
        power += others[0]
        rate += others[1]
        damped += others[2]
        damped_rate += others[3]
    now = _Powers(power, rate, momentum, damped, 2.0 * damped_rate, devices, 2.0 * devices_rate)
    _add_work(span, slope, now, scene, memory.report, totals)
    return near


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
        rate += force * watch[at.ACCELERATION_NOW, floor] + force_rate(forces, j, t) * state[at.VELOCITY, floor]
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
def look_between(near, scene, span, memory, seen):
    """Peaks within the step that has been observed: those that the step itself has raised, else as far as its ends tell
    them, if one has a value near its peak. Returns how many stories turned with what may be their largest shear, at the
    drifts in row TURNED_AT."""
    state, springs, work, report = memory
    watch, peaks, _, totals, _ = seen
    n = scene.linear_terms.shape[1] - 1
    turned = 0
    if report[at.WITHIN] != 0.0:
        _take_over(int(report[at.WITHIN]), work, peaks, n)
        report[at.WITHIN] = 0.0
    elif near or totals[at.NEAR_PEAK] != 0.0:
        passage = Passage(watch, at.U_BEFORE, state, watch, at.ACCELERATION_NOW)
        turned = look_within(span, scene, passage, springs, watch, at.TURNED_AT, peaks, 0)
    totals[at.NEAR_PEAK] = 1.0 if near else 0.0
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
    """The line that stands for the ground acceleration begins anew, beside where the one before ended.

    A jump of the ground's acceleration moves all floors alike; velocities and displacements stay. `shifts` says what of
    it each row of the state takes.
    """
    linear_terms, modal, _, forces, _ = scene
    state, watch, totals = memory.state, seen.watch, seen.totals
    ground = load[at.GROUND_0]
    shift = memory.report[at.CARRIED_GROUND] - ground
    memory.report[at.CARRIED_GROUND] = ground
    n = linear_terms.shape[1] - 1
    for row in range(shifts.size):
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


@inlined
def _story_forces(linear_terms, state, springs, watch, peaks):
    """Force of each story, column and damper, into its row; peaks of drift and shear. Returns as `observe` does."""
    n = linear_terms.shape[1] - 1
    near = False
    below = 0.0
    for i in range(n):
        v = state[at.VELOCITY, i]
        drift = springs[at.DRIFT, i]
        shear = springs[at.FORCE, i]
        rate = v - linear_terms[at.LINK, i] * below
        watch[at.STORY_FORCE, i] = (
            shear + linear_terms[at.GEOMETRIC, i] * drift + linear_terms[at.STORY_DAMPER, i] * rate
        )
        watch[at.STORY_FORCE, i] += power_damper(linear_terms, i, rate)[0]
        below = v
        near |= raise_peak(peaks, at.PEAK_DRIFT, i, drift)
        near |= raise_peak(peaks, at.PEAK_SHEAR, i, shear)
        if DASHPOTS:
            near |= raise_peak(peaks, at.PEAK_DRIFT_RATE, i, rate)
    return near


@inlined
def _total_shears(scene, state, watch, peaks):
    """Peaks of what moves all floors above a story: its own force, and the damping of these floors."""
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    near = False
    above = 0.0
    for j in range(1, n + 1):
        i = n - j
        above = linear_terms[at.LINK, i + 1] * above + linear_terms[at.FLOOR_DAMPER, i] * state[at.VELOCITY, i]
        if MODAL:
            above += watch[at.MODAL_FORCE, i]
        near |= raise_peak(peaks, at.PEAK_TOTAL_SHEAR, i, watch[at.STORY_FORCE, i] + above)
    return near


@called
def _other_forces(modal, forces, t, state, watch, n):
    """Forces on floors less modal damping into their row; the row stays zero where a building has neither."""
    for i in range(n):
        watch[at.OTHER_FORCE, i] = 0.0
        watch[at.MODAL_FORCE, i] = 0.0
    for j in range(forces.shape[0]):
        watch[at.OTHER_FORCE, int(forces[j, at.FLOOR])] += force_value(forces, j, t)
    add_modal_force(modal, state, at.VELOCITY, 1.0, watch, at.MODAL_FORCE, n)
    for i in range(n):
        watch[at.OTHER_FORCE, i] -= watch[at.MODAL_FORCE, i]


@inlined
def _add_work(span, slope, now, scene, report, totals):
    """Work of load and dampers: as the step has it, if it tells; else by the corrected trapezoidal (Hermite) rule, of
    order 4, from powers and their rates."""
    h = span.h
    if h > 0.0 and scene.flags[at.OWN_WORK] != 0.0:
        totals[at.ENERGY_INPUT] += report[at.WORK_INPUT]
        totals[at.ENERGY_DAMPED] += report[at.WORK_DAMPED]
        totals[at.ENERGY_LARGEST] = max(totals[at.ENERGY_LARGEST], totals[at.ENERGY_START] + totals[at.ENERGY_INPUT])
    elif h > 0.0:
        ends = totals[at.RATE_INPUT] - now.rate - slope * (totals[at.MOMENTUM] - now.momentum)
        totals[at.ENERGY_INPUT] += 0.5 * h * (totals[at.POWER_INPUT] + now.power) + h * h / 12.0 * ends
        ends = totals[at.RATE_DAMPED] - now.damped_rate
        totals[at.ENERGY_DAMPED] += 0.5 * h * (totals[at.POWER_DAMPED] + now.damped) + h * h / 12.0 * ends
        totals[at.ENERGY_LARGEST] = max(totals[at.ENERGY_LARGEST], totals[at.ENERGY_START] + totals[at.ENERGY_INPUT])
    if DASHPOTS and h > 0.0:
        ends = totals[at.RATE_DEVICES] - now.devices_rate
        devices = 0.5 * h * (totals[at.POWER_DEVICES] + now.devices) + h * h / 12.0 * ends
        totals[at.ENERGY_DEVICES] += devices
        totals[at.ENERGY_DAMPED] -= devices
    totals[at.POWER_DEVICES] = now.devices
    totals[at.RATE_DEVICES] = now.devices_rate
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
    """Write one row of the history; stock has been taken. `line` is the ground acceleration of the observed motion."""
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
    errors = energies + at.ENERGY_TERMS
    if history.shape[1] > errors:
        for i in range(n):
            history[row, errors + i] = state[at.ERROR_DISPLACEMENT, i]
            history[row, errors + n + i] = state[at.ERROR_VELOCITY, i]
            history[row, errors + 2 * n + i] = springs[at.FORCE, n + 1 + i] - springs[at.FORCE, i]


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
    """Note which story is beyond its limits after so many whole steps; the energies have been summed up."""
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
