"""Observation of the response during the time integration: peaks, energies and, if requested, a
history.

Without a history, the required memory is proportional to the number of stories.

The work of the load and of the dampers in a step follows from the powers and their rates at both
endpoints (`_work`). The totals of the run contain the values at the start of the step:
`_update_energies` and `_observe_dashpots` replace them by the values at its end. All rates are
linear in the accelerations, so that `shift_ground` can update them at a jump of the ground
acceleration. Several sums are *half* of a rate: the power c v^2 of a damper has the rate 2 c v a.

`tdint.kernels.layout` describes the arguments.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import (
    FULL,
    I8,
    indirect_caller,
    inline,
    kernel,
    outlined,
)
from tdint.kernels.laws.selection import elements_of
from tdint.kernels.linear_terms import (
    above,
    add_modal_force,
    base_of,
    below,
    distribute,
    force_rate,
    force_value,
    has_dashpot,
    has_inerters,
    inerter_force,
    internal_forces,
    is_tree,
    observed_power_damper,
    power_damper,
    story_value,
    tie,
    upper_of,
)
from tdint.kernels.located_peaks import call_update_located_peaks
from tdint.kernels.peaks_between_steps import (
    element_force,
    ends_of_story,
    find_interstep_peaks,
    instant_before,
    is_near_rest,
    limit_stiffness,
    may_exceed_acceleration_peak,
    may_exceed_floor_peaks,
    may_exceed_story_peaks,
    may_exceed_velocity_peak,
    observed_passage,
    raise_peak,
    story_reach,
    velocity_reach,
)
from tdint.kernels.step_interpolant import acceleration_bulge
from tdint.kernels.stepping import MEMORY, SCENE, SEEN, Ends, Located
from tdint.kernels.stories.impact import damping_slope, start_impact
from tdint.kernels.stories.law_state import (
    columns_of_story,
    has_fractured,
    hysteretic_energy,
    is_new_fracture,
    start,
    step_start,
    strain_energy,
    tangent_in_motion,
)


@inline
def observe(scene, span, slope, memory, seen):
    """Update energies and peaks with the response at the end of a step; return True if a peak can
    be exceeded within the step or at its end.

    The relative acceleration a of each floor is computed from equilibrium, from the roof downwards,
    and does not depend on the method:

        m (a + ag) = p - c v - V + V_above,   V = f + g d + C d' + F

    with the ground acceleration ag, the force p on the floor (minus modal damping), the floor
    damper c, and the force V of a story: restoring force f, P-delta (geometric stiffness g), story
    damper C and power-law dashpot F, at the drift d and the drift rate d'. V_above is the force of
    the story above. The total shear of a story is V plus the forces c v and the forces of modal
    damping on all floors that the story supports.

    For each quantity, an upper bound over the step is compared with the recorded peak. In most
    steps no bound exceeds a peak; only in the other steps the peaks are updated. The results of the
    comparisons are combined without branches (`|=`), because this is faster.

    `slope` is the rate of the ground acceleration in the step, m/s^3. At the start of a run, the
    function is called with a span of zero length.
    """
    linear_terms, modal, law_parameters, forces, flags = scene
    state, law_state = memory.state, memory.law_state
    observer_state, peaks, _, _, _ = seen
    ground = span.ground_1
    n = linear_terms.shape[1] - 1
    if FULL and forces.shape[0] + modal.shape[0] > 0:
        _store_additional_forces(modal, forces, span.t, state, observer_state, n)
    if FULL and flags[rows.HAS_DAMPER_STATE] != 0.0:
        _store_brace_forces(scene, state, observer_state)
    by_h = 1.0 / span.h if span.h > 0.0 else 0.0
    # The bounds include tables (rows START_FORCE and DEVIATION_BOUND), but not harmonic forces
    # within the step; with these, all steps are searched. Harmonic forces precede tables.
    has_forces = FULL and forces.shape[0] > 0
    may_exceed = has_forces and forces[0, rows.POINTS] == 0.0
    if FULL and has_inerters(linear_terms):
        _store_accelerations(scene, ground, memory, seen)
        may_exceed = True  # there is no bound of the forces of inerters
    # Sums over all floors and stories (`_update_energies`)
    momentum = 0.0
    total_inertia = 0.0
    viscous_power = 0.0
    viscous_rate = 0.0
    viscous_per_acceleration = 0.0
    # Values that a floor transfers to the next lower floor. They are zero at the roof of each
    # building: the floors of several independent buildings can be in successive columns.
    story_force_above = 0.0  # force V_above of the story above, N
    floor_damping_above = 0.0  # sum of c v and modal damping over all floors down to here, N
    inertia_above = 0.0  # sum of mass times absolute acceleration at the step start, N
    bulge_above = 0.0  # sum of mass times `bulge`, a measure of the acceleration in the step, N
    story_factor_above = 0.0  # factor of the drift acceleration of the story above, N
    # Velocity at the end of the step; response at its start (_0), beginning with the uppermost
    # floor.
    v = state[rows.VELOCITY, n - 1]
    u_0 = observer_state[rows.U_PREVIOUS, n - 1]
    v_0 = observer_state[rows.V_PREVIOUS, n - 1]
    a_0 = observer_state[rows.A_PREVIOUS, n - 1]
    # The bounds of a story depend on its drift acceleration at the end of the step, and therefore
    # on the accelerations of its upper floor i and its lower floor i - 1. Story i is therefore
    # compared with its peaks in two passes: pass i computes the part of the bounds that is known
    # (`story_reach`: drift, m, and shear, N), and pass i - 1, which computes the acceleration of
    # floor i - 1, adds the rest and compares. A drift acceleration A at the end increases the bound
    # of the drift by h^2 |A| / 20, because one of the Bezier points of the drift is u1 - 2 h v1 / 5
    # + h^2 A / 20.
    reach_above, a_above, link_above = (0.0, 0.0), 0.0, 0.0
    excess = 0.05 * span.h * span.h  # h^2 / 20, s^2
    if FULL and is_tree(linear_terms):
        _clear_tree_sums(observer_state, n)
    last = max(n - 1, 0)
    # With a decreasing `range`, the compiler would not know that `i` is not negative, and would
    # test every index of an array: 10 % of the instructions of this loop.
    i = n
    while i > 0:
        i -= 1
        next_story, base = min(i + 1, last), base_of(linear_terms, i)
        if FULL and is_tree(linear_terms):
            v = state[rows.VELOCITY, i]
            u_0 = observer_state[rows.U_PREVIOUS, i]
            v_0 = observer_state[rows.V_PREVIOUS, i]
            a_0 = observer_state[rows.A_PREVIOUS, i]
            story_force_above = observer_state[rows.FORCE_ON, i]
            floor_damping_above = observer_state[rows.DAMPING_ON, i]
            inertia_above = observer_state[rows.INERTIA_ON, i]
            bulge_above = observer_state[rows.BULGE_ON, i]
            story_factor_above = observer_state[rows.FACTOR_ON, i]
        v_below = state[rows.VELOCITY, base]
        u_0_below = observer_state[rows.U_PREVIOUS, base]
        v_0_below = observer_state[rows.V_PREVIOUS, base]
        a_0_below = observer_state[rows.A_PREVIOUS, base]
        link = linear_terms[rows.LINK, i]
        mass = linear_terms[rows.MASS, i]
        drift = law_state[rows.DRIFT, i]
        shear = law_state[rows.FORCE, i]
        rate = v - link * v_below
        dashpot_force, dashpot_tangent = observed_power_damper(linear_terms, i, rate)
        story_damping = linear_terms[rows.STORY_DAMPER, i] * rate
        floor_damping = linear_terms[rows.FLOOR_DAMPER, i] * v
        story_force = (
            shear + linear_terms[rows.GEOMETRIC, i] * drift + story_damping + dashpot_force
        )
        floor_force = observer_state[rows.FLOOR_FORCE, i] - floor_damping
        floor_force = floor_force - story_force + story_force_above
        a = linear_terms[rows.INVERSE_MASS, i] * floor_force - ground
        if FULL and has_inerters(linear_terms):
            a = observer_state[rows.OBSERVED_ACCELERATION, i]
        if FULL and upper_of(linear_terms, i) != i:
            a = 0.0  # the floor at the end of the link accelerates, not its column
        observer_state[rows.OBSERVED_ACCELERATION, i] = a
        floor_damping_above += floor_damping
        if FULL:
            floor_damping_above += observer_state[rows.MODAL_FORCE, i]
        total_shear = story_force + floor_damping_above
        if FULL and is_tree(linear_terms):
            # Links transmit a part of the shear: sum of load minus inertia instead of forces
            floor_damping_above = observer_state[rows.DAMPING_ON, i] - mass * (a + ground)
            floor_damping_above += (
                observer_state[rows.FLOOR_FORCE, i] + observer_state[rows.MODAL_FORCE, i]
            )
            total_shear = floor_damping_above
        observer_state[rows.TOTAL_SHEAR, i] = total_shear
        # The bounds of the story above were prepared by the previous pass; for the uppermost floor,
        # they are zero and exceed no peak. The last two fields of `Ends` (values one step earlier)
        # are not used by the bounds, so any values are allowed.
        floor = Ends(u_0, v_0, a_0, state[rows.DISPLACEMENT, i], v, a, v_0, a_0)
        may_exceed |= may_exceed_floor_peaks(span.h, by_h, floor, peaks, i)
        if not (FULL and is_tree(linear_terms)):
            change = excess * abs(a_above - link_above * a)
            may_exceed |= may_exceed_story_peaks(
                reach_above, change, law_parameters, peaks, next_story
            )
        # The first zero replaces the drift acceleration at the end, which the next pass computes.
        story = Ends(
            u_0 - link * u_0_below,
            v_0 - link * v_0_below,
            a_0 - link * a_0_below,
            drift,
            rate,
            0.0,
            0.0,
            0.0,
        )
        stiffness = limit_stiffness(linear_terms, law_parameters, i)
        reach_above = story_reach(span, story, shear, stiffness)
        a_above, link_above = a, link
        # Without forces on floors, the total shear is minus the sum of mass times absolute
        # acceleration of all floors that the story supports. With forces, this bound is not valid,
        # but `may_exceed` is then already True. `bulge` is the symmetric deviation of the
        # acceleration from a straight line in the step. The bound that follows from `bulge` also
        # covers the tilt, the antisymmetric deviation (`may_exceed_acceleration_peak`).
        bulge = acceleration_bulge(by_h, floor)
        inertia_above += mass * (a_0 + span.ground_0)
        acceleration_peak = peaks[rows.PEAK_ACCELERATION, i]
        shear_peak = peaks[rows.PEAK_TOTAL_SHEAR, i]
        if has_forces:
            inertia_above -= observer_state[rows.START_FORCE, i]
            acceleration_peak -= observer_state[rows.DEVIATION_BOUND, i]
            shear_peak -= observer_state[rows.SHEAR_BOUND, i]
            reach = velocity_reach(span.h, by_h, floor)
            reach += observer_state[rows.VELOCITY_BOUND, i]
            may_exceed |= reach > peaks[rows.PEAK_VELOCITY, i]
        may_exceed |= may_exceed_acceleration_peak(
            a_0 + span.ground_0, a + ground, bulge, acceleration_peak
        )
        bulge_above += mass * bulge
        may_exceed |= may_exceed_acceleration_peak(
            inertia_above, -total_shear, bulge_above, shear_peak
        )
        momentum += mass * v
        total_inertia += mass * a
        viscous_power += floor_damping * v + (story_damping + dashpot_force) * rate
        # The power F v of a dashpot at the drift rate v has the rate (F + F' v) a, with the drift
        # acceleration a; for a linear damper, this is 2 (c v) a. Half of the rate of the story is
        # therefore a times the factor c v + (F + F' v) / 2. Until here, `story_damping` is c v;
        # from here on, it is this factor. The drift acceleration is the difference of two floor
        # accelerations. The factor of a floor acceleration is therefore the factor of its story
        # minus the factor of the story above.
        story_damping += 0.5 * (dashpot_force + dashpot_tangent * rate)
        viscous_rate += (floor_damping + story_damping - story_factor_above) * a
        if has_forces:
            observer_state[rows.VISCOUS_FACTOR, i] = (
                floor_damping + story_damping - story_factor_above
            )
            if FULL and upper_of(linear_terms, i) != i:
                observer_state[rows.VISCOUS_FACTOR, i] = 0.0
        # An equal change of all floor accelerations only changes the drift acceleration of stories
        # on the ground.
        viscous_per_acceleration += floor_damping + (1.0 - link) * story_damping
        story_force_above = link * story_force
        floor_damping_above *= link
        inertia_above *= link
        bulge_above *= link
        story_factor_above = link * story_damping
        if FULL and upper_of(linear_terms, i) != i:
            floor = upper_of(linear_terms, i)
            observer_state[rows.FORCE_ON, floor] -= story_force
            observer_state[rows.FACTOR_ON, floor] -= story_damping
        if FULL and is_tree(linear_terms) and base != i:
            observer_state[rows.FORCE_ON, base] += story_force_above
            observer_state[rows.DAMPING_ON, base] += floor_damping_above
            observer_state[rows.INERTIA_ON, base] += inertia_above
            observer_state[rows.BULGE_ON, base] += bulge_above
            observer_state[rows.FACTOR_ON, base] += story_factor_above
        v = v_below
        u_0, v_0, a_0 = u_0_below, v_0_below, a_0_below
    # The drift acceleration of the lowest story is the acceleration of floor 1.
    if FULL and is_tree(linear_terms):
        tie(linear_terms, observer_state, rows.OBSERVED_ACCELERATION)
        may_exceed |= _may_exceed_tree_peaks(scene, span, memory, seen)
    else:
        change = excess * abs(a_above)
        may_exceed |= may_exceed_story_peaks(reach_above, change, law_parameters, peaks, 0)
    sums = momentum, total_inertia, viscous_power, viscous_rate, viscous_per_acceleration
    _update_energies(scene, span, slope, sums, memory, seen)
    if flags[rows.HAS_DASHPOTS] != 0.0:
        may_exceed |= _observe_dashpots(span, linear_terms, memory, seen)
    if FULL and law_state.shape[1] > n + 1:
        may_exceed |= _observe_elements(span, scene, memory, seen)
    if FULL and flags[rows.CAN_FRACTURE] != 0.0:
        if flags[rows.CAN_FRACTURE] > 0.0:
            may_exceed |= has_fractured(law_parameters, law_state)
        _record_fractures(scene, span, memory, seen)
    if FULL and flags[rows.HAS_DAMPER_STATE] != 0.0:
        _observe_braces(linear_terms, state, seen)
    if may_exceed:
        _update_peaks(ground, state, law_state, seen)
    return may_exceed


@outlined
def _record_fractures(scene, span, memory, seen):
    """Store time and side of the fractures in the step. The largest drift up to a fracture is the
    drift of the fracture, or an earlier peak on the other side."""
    linear_terms, _, law_parameters, _, _ = scene
    law_state = memory.law_state
    for i in range(linear_terms.shape[1] - 1):
        for column in columns_of_story(law_parameters, i):
            if is_new_fracture(law_parameters, law_state, i, column):
                story = _story_ends(linear_terms, memory, seen.observer_state, i)
                row = rows.FRACTURE_HIGH if story.u1 > 0.0 else rows.FRACTURE_LOW
                limit = law_parameters[row, column]
                s = instant_before(span.h, story, limit) if abs(limit) < abs(story.u1) else 1.0
                size = max(abs(limit), seen.peaks[rows.PEAK_DRIFT, i])
                law_state[rows.FRACTURE_TIME, column] = span.t - (1.0 - s) * span.h
                law_state[rows.FRACTURE_DRIFT, column] = math.copysign(size, limit)


@inline
def _story_ends(linear_terms, memory, observer_state, i):
    """Return the motion of story `i` at both endpoints of the step."""
    passage = observed_passage(memory.state, observer_state)
    return ends_of_story(False, linear_terms, passage, memory.law_state, i)


@outlined
def _store_accelerations(scene, ground, memory, seen):
    """Store the accelerations relative to the ground in a building with inerters, from the forces
    on floors (FLOOR_FORCE), the internal forces and the load by the ground motion, and raise the
    peak forces of the inerters.

    Rows LOCATED of the observer are free until the peaks in the step are searched.
    """
    linear_terms, modal, _, _, _ = scene
    observer_state = seen.observer_state
    velocity, internal = rows.LOCATED + rows.LOCATED_VELOCITY, rows.LOCATED + rows.LOCATED_INTERNAL
    n = linear_terms.shape[1] - 1
    for i in range(n):
        observer_state[velocity, i] = memory.state[rows.VELOCITY, i]
    sums = rows.LOCATED + rows.LOCATED_SUM
    law_state = memory.law_state
    internal_forces(linear_terms, modal, law_state, 0, observer_state, velocity, internal, sums)
    for i in range(n):
        force = observer_state[rows.FLOOR_FORCE, i] + observer_state[rows.MODAL_FORCE, i]
        force -= observer_state[internal, i] + linear_terms[rows.MASS, i] * ground
        observer_state[rows.OBSERVED_ACCELERATION, i] = force
    distribute(linear_terms, observer_state, rows.OBSERVED_ACCELERATION)
    for i in range(n):
        force = inerter_force(linear_terms, observer_state, rows.OBSERVED_ACCELERATION, i)
        raise_peak(seen.peaks, rows.PEAK_INERTER_FORCE, i, force)


@outlined
def _clear_tree_sums(observer_state, n):
    """Set the sums over the stories on each floor to zero (row FORCE_ON and the following rows)."""
    for row in range(rows.FORCE_ON, rows.DASHPOT_POWER):
        for i in range(n):
            observer_state[row, i] = 0.0


@outlined
def _may_exceed_tree_peaks(scene, span, memory, seen):
    """Return True if the drift or the shear of a story can exceed its peak in the step.

    The accelerations of all floors at the end of the step are known, so that no story has to wait
    for the accelerations of its lower floor as in the loop of `observe`.
    """
    linear_terms, _, law_parameters, _, _ = scene
    law_state = memory.law_state
    observer_state, peaks, _, _, _ = seen
    may_exceed = False
    for i in range(linear_terms.shape[1] - 1):
        ends = _story_ends(linear_terms, memory, observer_state, i)
        stiffness = limit_stiffness(linear_terms, law_parameters, i)
        reach = story_reach(span, ends, law_state[rows.FORCE, i], stiffness)
        excess = 0.05 * span.h * span.h * abs(ends.a1)
        may_exceed |= may_exceed_story_peaks(reach, excess, law_parameters, peaks, i)
    return may_exceed


@outlined
def _observe_elements(span, scene, memory, seen):
    """Raise the peak forces of elements; return True if a reversal in the step may exceed one.

    As in `story_reach`, the force of an element at a reversal within the step is at most the force
    at the end of the step plus the initial stiffness times a bound of the change of drift. An
    element that stiffens and is symmetric has its peak force at the peak drift of its story.
    """
    linear_terms, _, law_parameters, _, _ = scene
    law_state = memory.law_state
    may_exceed = False
    for i in range(linear_terms.shape[1] - 1):
        if law_parameters[rows.CODE, i] <= rows.ELEMENTS:
            ends = _story_ends(linear_terms, memory, seen.observer_state, i)
            reach = 0.0
            if span.on_path or ends.v0 * ends.v1 < 0.0:
                reach = span.h * max(abs(ends.v0), abs(ends.v1))
                reach += 0.05 * span.h * span.h * (abs(ends.a0) + abs(ends.a1))
            for element in elements_of(law_parameters, i):
                force = abs(element_force(law_state, i, element))
                peak = max(law_state[rows.PEAK_FORCE, element], force)
                law_state[rows.PEAK_FORCE, element] = peak
                may_exceed |= force + law_parameters[rows.STIFFNESS, element] * reach > peak
    return may_exceed


@inline
def _update_energies(scene, span, slope, sums, memory, seen):
    """Add the work of the load and of all dampers in a step to the energies of the run, and store
    the powers at its end.

    `sums` are sums over all floors and stories at the end of the step, without modal damping and
    without the forces on floors: momentum (N s), mass times relative acceleration (N), power of the
    dampers (W), half the rate of this power (W/s), and its increase if the acceleration of all
    floors increases by 1 m/s^2.

    The power of the load is -ag (sum of m v) plus the power of the forces on floors. Its rate has
    the terms -ag (sum of m a), -ag' (sum of m v) with ag' = `slope`, and the rate of the power of
    the forces; RATE_INPUT does not contain the term with ag'. If the kernel of the step has
    computed the work (flag OWN_WORK), this work is added instead.

    The work of the dashpots is added to ENERGY_VISCOUS; `_observe_dashpots` later moves it to
    ENERGY_DASHPOTS. ENERGY_REFERENCE, the divisor of the relative energy imbalance, is the maximum
    until now of initial energy plus work of the load. TOTAL_INERTIA and VISCOUS_PER_ACCELERATION
    are stored for `shift_ground`.
    """
    _, modal, _, forces, flags = scene
    momentum, inertia, viscous_power, half_viscous_rate, viscous_per_acceleration = sums
    totals, h = seen.totals, span.h
    n = scene.linear_terms.shape[1] - 1
    if flags[rows.OWN_WORK] == 0.0:
        power = -span.ground_1 * momentum
        rate = -span.ground_1 * inertia
        if FULL and forces.shape[0] + modal.shape[0] > 0:
            additional = _additional_powers(
                modal, forces, span.t, memory.state, seen.observer_state, n
            )
            power += additional[0]
            rate += additional[1]
            viscous_power += additional[2]
            half_viscous_rate += additional[3]
        viscous_rate = 2.0 * half_viscous_rate
        change = totals[rows.RATE_INPUT] - rate - slope * (totals[rows.MOMENTUM] - momentum)
        totals[rows.ENERGY_INPUT] += _work(h, totals[rows.POWER_INPUT], power, change)
        change = totals[rows.RATE_VISCOUS] - viscous_rate
        totals[rows.ENERGY_VISCOUS] += _work(h, totals[rows.POWER_VISCOUS], viscous_power, change)
        totals[rows.POWER_INPUT] = power
        totals[rows.RATE_INPUT] = rate
        totals[rows.MOMENTUM] = momentum
        totals[rows.TOTAL_INERTIA] = inertia
        totals[rows.POWER_VISCOUS] = viscous_power
        totals[rows.RATE_VISCOUS] = viscous_rate
        totals[rows.VISCOUS_PER_ACCELERATION] = viscous_per_acceleration
    elif h > 0.0:
        totals[rows.ENERGY_INPUT] += memory.step_status[rows.WORK_INPUT]
        totals[rows.ENERGY_VISCOUS] += memory.step_status[rows.WORK_VISCOUS]
    totals[rows.ENERGY_REFERENCE] = max(
        totals[rows.ENERGY_REFERENCE], totals[rows.ENERGY_INITIAL] + totals[rows.ENERGY_INPUT]
    )


@outlined
def _observe_dashpots(span, linear_terms, memory, seen):
    """Update the work of the dashpots and the peaks of the drift rates; return True if a drift rate
    can exceed its peak in the step, or a dashpot with an exponent below 1 comes to rest.

    The force F of a dashpot, linear or of a power law, depends on the drift rate v of its story
    only. Its power P = F v has the rate P' = (F + F' v) a, with the drift acceleration a and F' =
    dF/dv. The work of the dashpots is part of the work of all dampers (ENERGY_VISCOUS). It is
    subtracted there and reported separately (ENERGY_DASHPOTS). DASHPOTS_PER_ACCELERATION is half of
    the increase of P' if the accelerations of all floors increase by 1 m/s^2, for `shift_ground`.
    """
    observer_state, peaks, _, totals, _ = seen
    h = span.h
    power = power_rate = per_acceleration = 0.0
    by_h = 1.0 / h if h > 0.0 else 0.0
    may_exceed = False
    for i in range(linear_terms.shape[1] - 1):
        if not has_dashpot(linear_terms, i):
            continue
        link, base = linear_terms[rows.LINK, i], base_of(linear_terms, i)
        ends = _story_ends(linear_terms, memory, observer_state, i)
        rate = ends.v1
        may_exceed |= may_exceed_velocity_peak(h, by_h, ends, peaks[rows.PEAK_DRIFT_RATE, i])
        bound = observer_state[rows.VELOCITY_BOUND, i]
        bound += link * observer_state[rows.VELOCITY_BOUND, base]
        reach = velocity_reach(h, by_h, ends) + bound
        may_exceed |= (bound > 0.0) & (reach > peaks[rows.PEAK_DRIFT_RATE, i])
        # The accelerations have peaks before the rest of a dashpot with an exponent below 1.
        may_exceed |= is_near_rest(linear_terms, i, ends.v0, rate)
        raise_peak(peaks, rows.PEAK_DRIFT_RATE, i, rate)
        dashpot_force, dashpot_tangent = power_damper(linear_terms, i, rate)
        linear_force = linear_terms[rows.DASHPOT, i] * rate
        story_power = (linear_force + dashpot_force) * rate
        power += story_power
        # Half of the derivative of the power with respect to the drift rate: c v of the linear
        # dashpot, (F + F' v) / 2 of the power-law dashpot.
        half_derivative = linear_force + 0.5 * (dashpot_force + dashpot_tangent * rate)
        story_power_rate = 2.0 * half_derivative * ends.a1
        power_rate += story_power_rate
        # An attachment on the roof is a further story of a chain (`is_tree` is False).
        if FULL:
            change = observer_state[rows.DASHPOT_RATE, i] - story_power_rate
            observer_state[rows.DASHPOT_WORK, i] += _work(
                h, observer_state[rows.DASHPOT_POWER, i], story_power, change
            )
            observer_state[rows.DASHPOT_POWER, i] = story_power
            observer_state[rows.DASHPOT_RATE, i] = story_power_rate
        observer_state[rows.DASHPOT_FACTOR, i] = half_derivative
        per_acceleration += (1.0 - link) * half_derivative
    if h > 0.0:
        work = _work(h, totals[rows.POWER_DASHPOTS], power, totals[rows.RATE_DASHPOTS] - power_rate)
        totals[rows.ENERGY_DASHPOTS] += work
        totals[rows.ENERGY_VISCOUS] -= work
    totals[rows.POWER_DASHPOTS] = power
    totals[rows.RATE_DASHPOTS] = power_rate
    totals[rows.DASHPOTS_PER_ACCELERATION] = per_acceleration
    return may_exceed


@outlined
def _store_brace_forces(scene, state, observer_state):
    """Add the forces of dampers with braces and of tangent damping on all floors to the rows
    FLOOR_FORCE (with the opposite sign) and MODAL_FORCE, N.

    The sum of the forces on all floors that a story supports is the force of its brace.
    """
    linear_terms, modal, _, forces, _ = scene
    has_other_forces = forces.shape[0] + modal.shape[0] > 0
    for i in range(linear_terms.shape[1] - 1):
        force = state[rows.BRACE_REPORTED, i] + state[rows.DAMPING_FORCE, i]
        force -= above(linear_terms, state, rows.BRACE_REPORTED, i) + above(
            linear_terms, state, rows.DAMPING_FORCE, i
        )
        if not has_other_forces:
            observer_state[rows.FLOOR_FORCE, i] = observer_state[rows.MODAL_FORCE, i] = 0.0
        observer_state[rows.FLOOR_FORCE, i] -= force
        observer_state[rows.MODAL_FORCE, i] += force


@outlined
def _observe_braces(linear_terms, state, seen):
    """Update the work of the dampers with braces and of tangent damping, and the peak forces.

    The dissipated energy of the dampers is added to the work of the dashpots (ENERGY_DASHPOTS), the
    work of tangent damping to the work of viscous damping (ENERGY_VISCOUS).
    """
    totals = seen.totals
    dissipated = work = 0.0
    for i in range(linear_terms.shape[1] - 1):
        raise_peak(seen.peaks, rows.PEAK_BRACE_FORCE, i, state[rows.BRACE_PEAK, i])
        state[rows.BRACE_PEAK, i] = 0.0
        dissipated += state[rows.BRACE_DISSIPATED, i]
        work += state[rows.DAMPING_WORK, i]
    totals[rows.ENERGY_VISCOUS] += work - totals[rows.TANGENT_WORK]
    totals[rows.TANGENT_WORK] = work
    totals[rows.ENERGY_DASHPOTS] += dissipated - totals[rows.BRACED_DISSIPATION]
    totals[rows.BRACED_DISSIPATION] = dissipated


@outlined
def _update_peaks(ground, state, law_state, seen):
    """Raise all peaks by the response at the end of the step."""
    observer_state, peaks, _, _, _ = seen
    for i in range(observer_state.shape[1] - 1):
        raise_peak(peaks, rows.PEAK_DRIFT, i, law_state[rows.DRIFT, i])
        raise_peak(peaks, rows.PEAK_SHEAR, i, law_state[rows.FORCE, i])
        raise_peak(peaks, rows.PEAK_DISPLACEMENT, i, state[rows.DISPLACEMENT, i])
        raise_peak(peaks, rows.PEAK_VELOCITY, i, state[rows.VELOCITY, i])
        # The deviation is zero unless a table of a force is not linear in the step.
        acceleration = observer_state[rows.OBSERVED_ACCELERATION, i] + ground
        acceleration += observer_state[rows.ACCELERATION_DEVIATION, i]
        raise_peak(peaks, rows.PEAK_ACCELERATION, i, acceleration)
        raise_peak(peaks, rows.PEAK_TOTAL_SHEAR, i, observer_state[rows.TOTAL_SHEAR, i])


@outlined
def _additional_powers(modal, forces, t, state, observer_state, n):
    """Return the power of the forces on floors (W) and its rate (W/s), the power of modal damping
    and half of its rate.

    A force p on a floor has the power p v with the rate p a + p' v. A damped mode with the row w
    has the power (w^T v)^2; half of its rate is (w^T v) (w^T a).
    """
    power = 0.0
    rate = 0.0
    viscous_power = 0.0
    half_viscous_rate = 0.0
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
        viscous_power += v_modal * v_modal
        half_viscous_rate += v_modal * a_modal
    return power, rate, viscous_power, half_viscous_rate


@outlined
def _change_per_acceleration(modal, forces, t, state, n):
    """Return the change of two rates if all floor accelerations increase by 1 m/s^2: of the power
    of the floor forces, and half of the rate of the power of modal damping.

    With the rates of `_additional_powers`, these are the sum of all forces p and, for each mode,
    (w^T v) (sum of the elements of w).
    """
    rate = 0.0
    half_viscous_rate = 0.0
    for j in range(forces.shape[0]):
        rate += force_value(forces, j, t)
    for j in range(modal.shape[0]):
        v_modal = 0.0
        a_modal = 0.0
        for i in range(n):
            v_modal += modal[j, i] * state[rows.VELOCITY, i]
            a_modal += modal[j, i]
        half_viscous_rate += v_modal * a_modal
    return rate, half_viscous_rate


@inline
def observe_within_step(update_located_peaks, may_exceed, scene, span, memory, seen):
    """Update the peaks with the response within the last step, and store its end as the next start.

    The kernel of the method can compute peaks within the step (`span.cornered`). If `may_exceed`
    (the result of `observe`) is True, `find_interstep_peaks` computes further peaks from the
    response at the endpoints. The quantities depend on the method:

        no peaks computed by the method                     all quantities
        peaks computed, parabolic displacements (on_path)   displacements, drifts and shears
        peaks computed, other methods                       no quantity

    If the building has modes that the step does not resolve (`span.fast`), the former velocities
    and accelerations are kept in the rows V_EARLIER and A_EARLIER: `find_interstep_peaks` needs the
    response of two successive steps to detect unresolved motion.
    """
    state, law_state, scratch, step_status = memory
    observer_state, peaks, _, _, _ = seen
    n = scene.linear_terms.shape[1] - 1
    if span.cornered:
        _merge_step_peaks(int(step_status[rows.STEP_PEAKS]), scratch, peaks, span.kinked, n)
        step_status[rows.STEP_PEAKS] = 0.0
    if may_exceed and (span.on_path or not span.cornered):
        passage = observed_passage(state, observer_state)
        located = Located(observer_state, rows.LOCATED, peaks, 0)
        # The laws are evaluated only at reversals and instants that may cause a new peak.
        if find_interstep_peaks(span, scene, passage, law_state, located) > 0:
            if FULL and has_inerters(scene.linear_terms):
                observer_state[rows.LOCATED + rows.LOCATED_DEVICE, n] = span.ground_0
            previous = step_start(scene.flags, span.on_path and span.cornered)
            fast = 1 if span.fast else 0
            call_update_located_peaks(
                update_located_peaks, scene, memory, seen, span.t, span.h, fast, previous
            )
    if span.fast:
        for i in range(n):
            observer_state[rows.V_EARLIER, i] = observer_state[rows.V_PREVIOUS, i]
            observer_state[rows.A_EARLIER, i] = observer_state[rows.A_PREVIOUS, i]
    store_previous(state, observer_state, n)


@outlined
def _merge_step_peaks(first, scratch, peaks, is_kinked, n):
    """Merge the peaks in the scratch rows from `first` on into the peaks of the run.

    The scratch rows receive the merged peaks, so that the next step can compare with these peaks.
    In a kinked step, the step has computed the accelerations with the lines of the tables. They are
    only possible peaks.
    """
    if is_kinked:
        for i in range(n):
            possible = scratch[first + rows.PEAK_ACCELERATION, i]
            if possible > peaks[rows.PEAK_ACCELERATION, i]:
                raise_peak(peaks, rows.PEAK_ROWS + rows.PEAK_ACCELERATION, i, possible)
            scratch[first + rows.PEAK_ACCELERATION, i] = 0.0
    for row in range(peaks.shape[0]):
        for i in range(n):
            raise_peak(peaks, row, i, scratch[first + row, i])
            scratch[first + row, i] = peaks[row, i]
    for i in range(n):
        scratch[first + peaks.shape[0], i] = 0.0  # corner of the next step (`keep_corner`)


@inline
def store_previous(state, observer_state, n):
    """Store displacements, velocities and accelerations as the start of the next observed step."""
    for i in range(n):
        observer_state[rows.U_PREVIOUS, i] = state[rows.DISPLACEMENT, i]
        observer_state[rows.V_PREVIOUS, i] = state[rows.VELOCITY, i]
        observer_state[rows.A_PREVIOUS, i] = observer_state[rows.OBSERVED_ACCELERATION, i]


@inline
def shift_ground(scene, load, shifts, memory, seen):
    """Update the state for a jump of the ground acceleration between two steps.

    If a step is longer than the sampling interval, the ground acceleration is a straight line in
    each step, and the lines are not continuous. A jump changes the relative accelerations of all
    floors by the same value with the opposite sign: a increases by `shift` = old minus new ground
    acceleration ag. Velocities v and displacements do not change. The following totals change:

        POWER_INPUT      -ag (sum of m v) increases by shift (sum of m v)
        RATE_INPUT       -ag (sum of m a) increases by shift (sum of m a - ag (sum of m)), with the
                         old a and the new ag; the part p a of forces p on floors increases by
                         shift (sum of p)
        TOTAL_INERTIA    sum of m a increases by shift (sum of m)
        RATE_VISCOUS     rate of the power of all dampers, linear in a
        RATE_DASHPOTS    rate of the power of the dashpots, linear in a

    STATE_GROUND of the status, the ground acceleration for which the accelerations of the state are
    valid, changes from the old to the new value.

    Parameters
    ----------
    shifts : ndarray
        Change of each row of the state per unit increase of the accelerations. In a multi-step
        method, several rows depend on accelerations.
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
    # TOTAL_INERTIA is still the sum before the jump. It is updated here, because the next jump
    # occurs before `observe` stores a new sum if the step fails and is halved.
    totals[rows.POWER_INPUT] += shift * totals[rows.MOMENTUM]
    totals[rows.RATE_INPUT] += shift * (
        totals[rows.TOTAL_INERTIA] - ground * totals[rows.TOTAL_MASS]
    )
    totals[rows.TOTAL_INERTIA] += shift * totals[rows.TOTAL_MASS]
    # The rows *_PER_ACCELERATION contain half of the change of a rate per unit change of a.
    totals[rows.RATE_VISCOUS] += 2.0 * shift * totals[rows.VISCOUS_PER_ACCELERATION]
    totals[rows.RATE_DASHPOTS] += 2.0 * shift * totals[rows.DASHPOTS_PER_ACCELERATION]
    if FULL:
        for i in range(n):
            observer_state[rows.DASHPOT_RATE, i] += (
                2.0 * shift * (1.0 - linear_terms[rows.LINK, i])
            ) * observer_state[rows.DASHPOT_FACTOR, i]
    if FULL and forces.shape[0] + modal.shape[0] > 0:
        rate, half_viscous_rate = _change_per_acceleration(modal, forces, load[rows.TIME], state, n)
        totals[rows.RATE_INPUT] += shift * rate
        totals[rows.RATE_VISCOUS] += 2.0 * shift * half_viscous_rate


@outlined
def _store_additional_forces(modal, forces, t, state, observer_state, n):
    """Store the forces on floors minus the modal damping forces (FLOOR_FORCE) and the modal damping
    forces (MODAL_FORCE), N.

    In a building without both, the function is not called, and the rows remain zero.
    """
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
    """Return the work over a step, J, by the corrected trapezoidal (Hermite) rule of order 4.

    `change` is the rate of the power at the start minus its rate at the end, W/s.
    """
    return 0.5 * h * (power_0 + power_1) + h * h / 12.0 * change


@inline
def initialize_energies(linear_terms, law_state, totals):
    """Store the initial energies (J) and the total mass of the building (kg) in `totals`.

    The kernel `sum_law_energies` must have stored the kinetic, strain and hysteretic energy of the
    initial state before. The energy that the laws have dissipated on the path to the initial
    drifts, INITIAL_DISSIPATION (INITIAL_SPENT of a story), is subtracted from all later values of
    the hysteretic energy.
    """
    totals[rows.TOTAL_MASS] = 0.0
    for i in range(linear_terms.shape[1] - 1):
        totals[rows.TOTAL_MASS] += linear_terms[rows.MASS, i]
        law_state[rows.INITIAL_SPENT, i] = law_state[rows.ENERGY_SPENT, i]
    totals[rows.INITIAL_DISSIPATION] = totals[rows.ENERGY_HYSTERETIC]
    totals[rows.ENERGY_HYSTERETIC] = 0.0
    totals[rows.ENERGY_INITIAL] = totals[rows.ENERGY_KINETIC] + totals[rows.ENERGY_STRAIN]
    totals[rows.ENERGY_REFERENCE] = totals[rows.ENERGY_INITIAL]


@outlined
def store(ground, fitted_ground, memory, seen, row):
    """Write row `row` of the history; the energies in `totals` must have been updated before.

    In a step longer than a sampling interval, the load of the equations is not the ground
    acceleration, but a straight line fitted to the ground acceleration. The relative accelerations
    of the floors are in equilibrium with this line. The absolute accelerations are therefore their
    sums with the value of the line, `fitted_ground`. The history shows the actual ground
    acceleration, `ground`. Both are equal at the start of a run and in steps that are not longer
    than a sampling interval.
    """
    state, law_state = memory.state, memory.law_state
    observer_state, _, _, totals, history = seen
    n = observer_state.shape[1] - 1
    history[row, 0] = ground
    for i in range(n):
        history[row, 1 + i] = state[rows.DISPLACEMENT, i]
        history[row, 1 + n + i] = state[rows.VELOCITY, i]
        acceleration = observer_state[rows.OBSERVED_ACCELERATION, i] + fitted_ground
        if observer_state[rows.ACCELERATION_DEVIATION, i] != 0.0:  # otherwise keep the sign of -0
            acceleration += observer_state[rows.ACCELERATION_DEVIATION, i]
        history[row, 1 + 2 * n + i] = acceleration
        history[row, 1 + 3 * n + i] = law_state[rows.FORCE, i]
    energies = 1 + rows.HISTORY_FIELDS * n
    # A longer row has space for the forces of the braces. Each element also has a column.
    if history.shape[1] > energies + rows.ENERGY_TERMS + law_state.shape[1] - n - 1:
        for i in range(n):
            history[row, energies + i] = state[rows.BRACE_REPORTED, i]
        energies += n
    for j in range(rows.ENERGY_TERMS):
        history[row, energies + j] = totals[j]
    # The forces of the elements follow; their columns are the last columns of the law states. The
    # sum of the energies of the laws has moved them to the drifts of the stories.
    for j in range(law_state.shape[1] - n - 1):
        history[row, energies + rows.ENERGY_TERMS + j] = law_state[rows.FORCE, n + 1 + j]


@inline
def exceeds_limits(law_state, seen):
    """Return True if the peak drift of a story exceeds SMALLEST_LIMIT or a story has failed.

    `record_collapse` then compares the drift with each limit. A story has failed if row INTERNAL of
    its law state has the value FAILED; nan, for laws without failure, is equal to no value.
    """
    limits = seen.limits
    is_exceeded = False
    for i in range(limits.shape[1]):
        is_exceeded |= seen.peaks[rows.PEAK_DRIFT, i] > limits[rows.SMALLEST_LIMIT, i]
        is_exceeded |= law_state[rows.INTERNAL, i] == limits[rows.FAILED, i]
    return is_exceeded


@outlined
def record_collapse(law_state, steps, seen):
    """Store the story and the step of the collapse, and the energies at this time, in `totals`.

    The story is the lowest failed story. If no story has failed, it is the story with the largest
    excess of its peak drift ratio (peak drift / height) over its limit. If the drift exceeds only
    the smaller of two limits on the other side (SMALLEST_LIMIT), only the energies are stored. The
    energies in `totals` must have been updated before. `steps` is the number of complete steps.
    """
    _, peaks, limits, totals, _ = seen
    largest_excess = 0.0
    for i in range(limits.shape[1]):
        excess = peaks[rows.PEAK_DRIFT, i] / limits[rows.HEIGHT, i] - limits[rows.LIMIT, i]
        # The infinite excess of the lowest failed story is not exceeded by other stories.
        drift = law_state[rows.DRIFT, i]
        has_no_resistance = (drift >= limits[rows.HIGH_LIMIT, i]) | (
            drift <= limits[rows.LOW_LIMIT, i]
        )
        if has_no_resistance:
            totals[rows.COLLAPSE_FAILED] = rows.NO_RESISTANCE
        elif law_state[rows.INTERNAL, i] == limits[rows.FAILED, i]:
            totals[rows.COLLAPSE_FAILED] = max(totals[rows.COLLAPSE_FAILED], 1.0)
        if has_no_resistance or law_state[rows.INTERNAL, i] == limits[rows.FAILED, i]:
            excess = math.inf
        if excess > largest_excess:
            largest_excess = excess
            totals[rows.COLLAPSE_STEP] = steps
            totals[rows.COLLAPSE_STORY] = i
    # The energies, ENERGY_INITIAL and ENERGY_REFERENCE.
    for j in range(rows.ENERGY_TERMS + 2):
        totals[rows.COLLAPSE_ENERGIES + j] = totals[j]


# ---- Kernels that evaluate the drift laws outside of the steps: initialization, energies, and
# forces at reversals. The time loop receives the addresses of these kernels and of the step as
# arguments. It is therefore compiled for all laws and methods together.

INITIALIZE_LAWS = I8(*SCENE, *MEMORY)
SUM_LAW_ENERGIES = I8(*SCENE, *MEMORY, *SEEN)

call_initialize_laws = indirect_caller(INITIALIZE_LAWS)
"""Call `initialize_laws` by its address, the first argument."""

update_law_energies = indirect_caller(SUM_LAW_ENERGIES)
"""Call `sum_law_energies` by its address, the first argument. The energies are computed only when
they are needed, because all laws must be evaluated."""


@kernel(INITIALIZE_LAWS)
def initialize_laws(scene, memory):
    """Move the hysteretic laws of all stories from zero drift to their initial drifts; return 0."""
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, _, _ = memory
    displacement_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i]
        displacement_below = below(linear_terms, state, rows.DISPLACEMENT, i, displacement_below)
        drift = state[rows.DISPLACEMENT, i] - link * displacement_below
        start(law_parameters, law_state, i, drift)
        displacement_below = state[rows.DISPLACEMENT, i]
        if linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
            rate = state[rows.VELOCITY, i] - link * state[rows.VELOCITY, base_of(linear_terms, i)]
            slope = tangent_in_motion(law_parameters, law_state, i, rate)
            start_impact(law_parameters, law_state, i, rate)
            slope = damping_slope(law_parameters, law_state, i, rows.COMMITTED, slope)
            state[rows.DAMPING_FORCE, i] = linear_terms[rows.TANGENT_DAMPING, i] * slope * rate
            state[rows.DAMPING_STATE, i] = state[rows.DAMPING_FORCE, i]
    return 0


@kernel(SUM_LAW_ENERGIES)
def sum_law_energies(scene, memory, seen):
    """Store the kinetic, strain and hysteretic energy of the current state in `totals`, J; return
    0.

    The kinetic energy refers to velocities relative to the ground. The strain energy includes
    P-delta. The hysteretic energy is the dissipated energy since the start of the run. The energy
    of the braces of dampers is stored separately.
    """
    linear_terms, _, law_parameters, _, _ = scene
    state, law_state, _, _ = memory
    totals = seen.totals
    kinetic = 0.0
    strain = 0.0
    hysteretic = 0.0
    braces = 0.0
    for i in range(linear_terms.shape[1] - 1):
        drift = law_state[rows.DRIFT, i]
        kinetic += (
            0.5 * linear_terms[rows.MASS, i] * state[rows.VELOCITY, i] * state[rows.VELOCITY, i]
        )
        if FULL and has_inerters(linear_terms):
            v, rate = state[rows.VELOCITY, i], story_value(linear_terms, state, rows.VELOCITY, i)
            kinetic += 0.5 * linear_terms[rows.FLOOR_INERTANCE, i] * v * v
            kinetic += 0.5 * linear_terms[rows.STORY_INERTANCE, i] * rate * rate
        strain += (
            strain_energy(law_parameters, law_state, i)
            + 0.5 * linear_terms[rows.GEOMETRIC, i] * drift * drift
        )
        spent = hysteretic_energy(law_parameters, law_state, i)
        law_state[rows.ENERGY_SPENT, i] = spent - law_state[rows.INITIAL_SPENT, i]
        hysteretic += spent
        if linear_terms[rows.BRACE, i] != 0.0:
            force = state[rows.BRACE_FORCE, i]
            braces += 0.5 * force * force / linear_terms[rows.BRACE, i]
    totals[rows.ENERGY_BRACES] = braces
    totals[rows.ENERGY_KINETIC] = kinetic
    totals[rows.ENERGY_STRAIN] = strain
    totals[rows.ENERGY_HYSTERETIC] = hysteretic - totals[rows.INITIAL_DISSIPATION]
    return 0
