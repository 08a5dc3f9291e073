"""Observation of the response during the time integration: peaks, energies and, if requested, a
history.

Without a history, the required memory is proportional to the number of stories.
"""

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
    limit_stiffness,
    may_exceed_acceleration_peak,
    may_exceed_floor_peaks,
    may_exceed_story_peaks,
    may_exceed_velocity_peak,
    raise_peak,
    story_reach,
)
from tdint.kernels.stepping import Ends, Passage
from tdint.kernels.stories.law_state import (
    hysteretic_energy,
    restoring_force_outlined,
    start,
    strain_energy,
)


class _PowerValues(NamedTuple):
    """Power of the load and of the dampers at a time, their rates, and the total momentum.

    Attributes
    ----------
    power : float
        Power of the load, W.
    rate : float
        Rate of the power of the load without the contribution of the rate of the ground
        acceleration, W/s.
    momentum : float
        Momentum of all floors, N s.
    viscous_power : float
        Power of the dampers, W.
    viscous_rate : float
        Rate of the power of the dampers, W/s.
    """

    power: float
    rate: float
    momentum: float
    viscous_power: float
    viscous_rate: float


class _FloorSums(NamedTuple):
    """Sums over all floors and stories at the end of a step, without modal damping and without the
    forces on floors.

    Attributes
    ----------
    momentum : float
        Sum of mass times velocity, N s.
    inertia : float
        Sum of mass times acceleration, N.
    viscous_power : float
        Power of the dampers, W.
    half_viscous_rate : float
        Half of the rate of this power, W/s.
    viscous_per_acceleration : float
        Increase of `half_viscous_rate` if the acceleration of all floors increases by 1 m/s^2.
    """

    momentum: float
    inertia: float
    viscous_power: float
    half_viscous_rate: float
    viscous_per_acceleration: float


@inline
def observe(scene, span, slope, memory, seen):
    """Update energies and peaks with the response at the end of a step.

    The relative acceleration a of each floor is computed from equilibrium, from the roof downwards,
    and does not depend on the method:

        m (a + ag) = p - c v - V + V_above,   V = f + g d + C d' + F

    with the ground acceleration ag, the force p on the floor (minus modal damping), the floor
    damper c, and the force V of a story: restoring force f, P-delta (geometric stiffness g), story
    damper C and power-law dashpot F, at the drift d and the drift rate d'. V_above is the force of
    the story above. The total shear of a story is V plus the forces c v and the forces of modal
    damping on all floors that the story supports.

    A loop over the floors does three things:

    1. It computes accelerations and total shears.
    2. For each quantity, it compares an upper bound over the step with the recorded peak. In most
       steps no bound exceeds a peak; only in the other steps the peaks are updated. The results of
       the comparisons are combined without branches (`|=`), because this is faster.
    3. It adds the momentum, the inertia and the power of the dampers of all floors. The energies of
       the run are computed from these sums after the loop.

    At the start of a run, the function is called with a span of zero length.

    Parameters
    ----------
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    span : Span
        Observed time step or substep.
    slope : float
        Rate of the ground acceleration in the step, m/s^3.
    memory : Memory
        State, law states and status of the step, at the end of the step.
    seen : Seen
        Arrays of the observer: response at the start of the step (rows U_PREVIOUS, V_PREVIOUS and
        A_PREVIOUS), peaks and totals of the run.

    Returns
    -------
    bool
        True if a peak can be exceeded within the step or at its end.
    """
    linear_terms, modal, law_parameters, forces, flags = scene
    state, law_state = memory.state, memory.law_state
    observer_state, peaks, _, _, _ = seen
    ground = span.ground_1
    n = linear_terms.shape[1] - 1
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        _store_additional_forces(modal, forces, span.t, state, observer_state, n)
    by_h = 1.0 / span.h if span.h > 0.0 else 0.0
    # Forces on floors within the step are not evaluated here; with such forces, all steps are
    # searched.
    may_exceed = FORCES and forces.shape[0] > 0
    # These sums over all floors and stories determine the powers of the load and of the dampers.
    momentum = 0.0  # mass times velocity, N s
    total_inertia = 0.0  # mass times relative acceleration, N
    viscous_power = 0.0  # power of the dampers, W
    viscous_rate = 0.0  # half of the rate of `viscous_power`, W/s
    viscous_per_acceleration = 0.0  # increase of `viscous_rate` per m/s^2 of all accelerations
    # These variables transfer values from a floor to the next lower floor. The floors of several
    # independent buildings can be in successive columns. The variables are then zero at the roof of
    # each building, because the next column belongs to the lowest story of another building.
    story_force_above = 0.0  # force V_above of the story above, N
    floor_damping_above = 0.0  # sum of c v and modal damping over all floors down to here, N
    inertia_above = 0.0  # sum of mass times absolute acceleration at the step start, N
    bulge_above = 0.0  # sum of mass times `bulge`, a measure of the acceleration in the step, N
    story_factor_above = 0.0  # factor of the drift acceleration of the story above, N
    # Velocity at the end of the step; displacement, velocity and acceleration at its start (suffix
    # _0). They start with the uppermost floor.
    v = state[rows.VELOCITY, n - 1]
    u_0 = observer_state[rows.U_PREVIOUS, n - 1]
    v_0 = observer_state[rows.V_PREVIOUS, n - 1]
    a_0 = observer_state[rows.A_PREVIOUS, n - 1]
    # The bounds of a story depend on its drift acceleration at the end of the step, and therefore
    # on the accelerations of its upper and its lower floor. The upper floor of story i is floor i,
    # the lower floor is floor i - 1. Story i is therefore compared with its peaks in two passes:
    # pass i computes the part of the bounds that is known, and pass i - 1, which computes the
    # acceleration of floor i - 1, adds the rest and compares. Pass i stores three values for this
    # purpose:
    #     reach_above    bounds of drift (m) and shear (N) from `story_reach`, without the effect of
    #                    the drift acceleration at the end
    #     a_above        relative acceleration of the upper floor at the end, m/s^2
    #     link_above     LINK of the story: 1 on the lower floor, 0 on the ground
    # A drift acceleration A at the end increases the bound of the drift by h^2 |A| / 20, because
    # one of the Bezier points of the drift is u1 - 2 h v1 / 5 + h^2 A / 20.
    reach_above, a_above, link_above = (0.0, 0.0), 0.0, 0.0
    excess = 0.05 * span.h * span.h  # h^2 / 20, s^2
    for i in range(n - 1, -1, -1):
        above, below = min(i + 1, n - 1), max(i - 1, 0)  # neighbors, limited to existing floors
        v_below = state[rows.VELOCITY, below]
        u_0_below = observer_state[rows.U_PREVIOUS, below]
        v_0_below = observer_state[rows.V_PREVIOUS, below]
        a_0_below = observer_state[rows.A_PREVIOUS, below]
        link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
        mass = linear_terms[rows.MASS, i]
        # Compute the force of story `i`: restoring force, P-delta, story damper and dashpot.
        drift = law_state[rows.DRIFT, i]
        shear = law_state[rows.FORCE, i]
        rate = v - link * v_below
        dashpot_force, dashpot_tangent = power_damper(linear_terms, i, rate)
        story_damping = linear_terms[rows.STORY_DAMPER, i] * rate
        floor_damping = linear_terms[rows.FLOOR_DAMPER, i] * v
        story_force = (
            shear + linear_terms[rows.GEOMETRIC, i] * drift + story_damping + dashpot_force
        )
        # Compute the relative acceleration of floor `i` from equilibrium.
        a = (
            linear_terms[rows.INVERSE_MASS, i]
            * (
                observer_state[rows.FLOOR_FORCE, i]
                - floor_damping
                - story_force
                + story_force_above
            )
            - ground
        )
        observer_state[rows.OBSERVED_ACCELERATION, i] = a
        # The total shear is the force of the story plus the viscous forces of this floor and of all
        # floors above.
        floor_damping_above += floor_damping
        if MODAL:
            floor_damping_above += observer_state[rows.MODAL_FORCE, i]
        total_shear = story_force + floor_damping_above
        observer_state[rows.TOTAL_SHEAR, i] = total_shear
        # Compare bounds of the displacement and velocity of the floor with their peaks, then bounds
        # of the drift and force of the story above, which the previous pass has prepared. For the
        # uppermost floor, these bounds are zero and exceed no peak. The last two fields of `Ends`
        # are velocity and acceleration one step before the start. The bounds do not use these
        # fields, so any values are allowed: here v_0 and a_0 for the floor, zeros for the story.
        floor_ends = Ends(u_0, v_0, a_0, state[rows.DISPLACEMENT, i], v, a, v_0, a_0)
        may_exceed |= may_exceed_floor_peaks(span.h, by_h, floor_ends, peaks, i)
        may_exceed |= may_exceed_story_peaks(
            reach_above,
            excess * abs(a_above - link_above * a),
            law_parameters[rows.STIFFNESS, above],
            peaks,
            above,
        )
        # The first zero replaces the drift acceleration at the end, which the next pass computes.
        story_ends = Ends(
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
        reach_above = story_reach(span, story_ends, shear, stiffness)
        a_above, link_above = a, link
        # Compare bounds of the absolute acceleration and of the total shear with their peaks.
        # Without forces on floors, the total shear is minus the sum of mass times absolute
        # acceleration of all floors that the story supports. With forces, this bound is not valid,
        # but `may_exceed` is then already True.
        # `bulge` is the symmetric deviation of the acceleration from a straight line in the step.
        # The bound that follows from `bulge` also covers the tilt, the antisymmetric deviation
        # (`may_exceed_acceleration_peak`).
        bulge = acceleration_bulge(by_h, floor_ends)
        may_exceed |= may_exceed_acceleration_peak(
            a_0 + span.ground_0, a + ground, bulge, peaks[rows.PEAK_ACCELERATION, i]
        )
        inertia_above += mass * (a_0 + span.ground_0)
        bulge_above += mass * bulge
        may_exceed |= may_exceed_acceleration_peak(
            inertia_above, -total_shear, bulge_above, peaks[rows.PEAK_TOTAL_SHEAR, i]
        )
        # Add the contributions of the floor and of the story to the sums.
        momentum += mass * v
        total_inertia += mass * a
        viscous_power += floor_damping * v + (story_damping + dashpot_force) * rate
        # The rate of the power of all dampers is twice `viscous_rate`. The power c v^2 of a linear
        # damper has the rate 2 (c v) a. The power F v of a dashpot at the drift rate v has the rate
        # (F + F' v) a, with the drift acceleration a. Half of the rate of the story is therefore a
        # times the factor c v + (F + F' v) / 2. Until here, `story_damping` is c v; from here on,
        # it is this factor. The drift acceleration is the difference of two floor accelerations.
        # The factor of a floor acceleration is therefore the factor of its story minus the factor
        # of the story above (`story_factor_above`).
        story_damping += 0.5 * (dashpot_force + dashpot_tangent * rate)
        viscous_rate += (floor_damping + story_damping - story_factor_above) * a
        # An equal change of all floor accelerations only changes the drift acceleration of stories
        # on the ground.
        viscous_per_acceleration += floor_damping + (1.0 - link) * story_damping
        # Prepare the values above for the floor below; they are zero if the story is on the ground.
        story_force_above = link * story_force
        floor_damping_above *= link
        inertia_above *= link
        bulge_above *= link
        story_factor_above = link * story_damping
        v = v_below
        u_0, v_0, a_0 = u_0_below, v_0_below, a_0_below
    # The drift acceleration of the lowest story is the acceleration of floor 1.
    stiffness = law_parameters[rows.STIFFNESS, 0]
    may_exceed |= may_exceed_story_peaks(reach_above, excess * abs(a_above), stiffness, peaks, 0)
    # Add the work of the load and of the dampers in the step to the energies.
    sums = _FloorSums(
        momentum, total_inertia, viscous_power, viscous_rate, viscous_per_acceleration
    )
    _update_energies(scene, span, slope, sums, memory, seen)
    if DASHPOTS and flags[rows.HAS_DASHPOTS] != 0.0:
        may_exceed |= _observe_dashpots(span, linear_terms, state, seen)
    if may_exceed:
        _update_peaks(ground, state, law_state, seen)
    return may_exceed


@inline
def _update_energies(scene, span, slope, sums, memory, seen):
    """Add the work of the load and of the dampers in a step to the energies of the run.

    The power of the load is -ag (sum of m v) plus the power of the forces on floors, with the
    ground acceleration ag and the masses m, velocities v and accelerations a of the floors. Its
    rate has the terms -ag (sum of m a), -ag' (sum of m v) and the rate of the power of the forces.
    `_add_work` adds the second term, with ag' = `slope`. Modal damping is added to the power of the
    dampers. The work follows from the powers and their rates at both endpoints of the step: the
    values at the start are in the totals of the run, the values at the end are computed here and
    replace them. If the kernel of the step has computed the work (flag OWN_WORK is not 0), this
    work is added instead.

    The reference energy (ENERGY_REFERENCE) is the maximum until now of the sum of initial energy
    and work of the load. It is the divisor of the relative energy imbalance.

    Parameters
    ----------
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    span : Span
        Observed time step or substep; `span.t` is the time at its end, `span.ground_1` the ground
        acceleration at this time.
    slope : float
        Rate of the ground acceleration in the step, m/s^3.
    sums : _FloorSums
        Sums over all floors and stories at the end of the step: momentum (sum of m v), inertia (sum
        of m a), power of the dampers, and half of its rate (`half_viscous_rate`). The last field,
        `viscous_per_acceleration`, is the increase of `half_viscous_rate` if all accelerations
        increase by 1 m/s^2.
    memory : Memory
        State and status of the step.
    seen : Seen
        Arrays of the observer. In the totals of the run, the energies of the load and of the
        dampers and the reference energy are updated. If OWN_WORK is 0, TOTAL_INERTIA and
        VISCOUS_PER_ACCELERATION are stored for `shift_ground`, which updates the rates at a jump of
        the ground acceleration.
    """
    _, modal, _, forces, flags = scene
    totals = seen.totals
    n = scene.linear_terms.shape[1] - 1
    if flags[rows.OWN_WORK] == 0.0:
        # Power of the ground motion and of the dampers at the end of the step, and their rates.
        # `rate` excludes the term -ag' (sum of m v). `viscous_rate` is half of the rate; it is
        # doubled below.
        power = -span.ground_1 * sums.momentum
        rate = -span.ground_1 * sums.inertia
        viscous_power = sums.viscous_power
        viscous_rate = sums.half_viscous_rate
        totals[rows.TOTAL_INERTIA] = sums.inertia
        totals[rows.VISCOUS_PER_ACCELERATION] = sums.viscous_per_acceleration
        if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
            # `additional` is the power of the forces on floors and its rate, then the power of
            # modal damping and half of its rate.
            additional = _additional_powers(
                modal, forces, span.t, memory.state, seen.observer_state, n
            )
            power += additional[0]
            rate += additional[1]
            viscous_power += additional[2]
            viscous_rate += additional[3]
        _add_work(
            span,
            slope,
            _PowerValues(power, rate, sums.momentum, viscous_power, 2.0 * viscous_rate),
            totals,
        )
    elif span.h > 0.0:  # the kernel of the step has computed the work
        totals[rows.ENERGY_INPUT] += memory.step_status[rows.WORK_INPUT]
        totals[rows.ENERGY_VISCOUS] += memory.step_status[rows.WORK_VISCOUS]
    totals[rows.ENERGY_REFERENCE] = max(
        totals[rows.ENERGY_REFERENCE], totals[rows.ENERGY_INITIAL] + totals[rows.ENERGY_INPUT]
    )


@outlined
def _observe_dashpots(span, linear_terms, state, seen):
    """Update the work of the dashpots and the peaks of the drift rates.

    The force F of a dashpot, linear or of a power law, depends on the drift rate v of its story
    only. Its power P = F v has the rate P' = (F + F' v) a, with the drift acceleration a and F' =
    dF/dv. `_work` computes the work over the step from P and P' at the start and at the end. The
    work of the dashpots is included in the work of all dampers (ENERGY_VISCOUS). It is subtracted
    there and reported separately (ENERGY_DASHPOTS). The drift rates at the end of the step are
    recorded as peaks. In the totals, sums over all stories are stored:

        POWER_DASHPOTS               P at the end, W
        RATE_DASHPOTS                P' at the end, W/s; both are the values at the start of the
                                     next step
        DASHPOTS_PER_ACCELERATION    half of the increase of P' if the accelerations of all floors
                                     increase by 1 m/s^2; `shift_ground` uses it to update
                                     RATE_DASHPOTS at a jump of the ground acceleration

    Parameters
    ----------
    span : Span
        Observed time step or substep.
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses: one row per property, one column per floor.
    state : ndarray
        State of the method at the end of the step: displacements (m) and velocities (m/s).
    seen : Seen
        Arrays of the observer: response of the floors at the start of the step (rows U_PREVIOUS,
        V_PREVIOUS, A_PREVIOUS), accelerations at its end (row OBSERVED_ACCELERATION), peaks and
        totals.

    Returns
    -------
    bool
        True if a drift rate can exceed its peak in the step.
    """
    observer_state, peaks, _, totals, _ = seen
    h = span.h
    power = power_rate = per_acceleration = 0.0  # sums over all stories
    by_h = 1.0 / h if h > 0.0 else 0.0
    v_below = a_below = u_0_below = v_0_below = a_0_below = u_below = 0.0
    may_exceed = False
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
        v, a = state[rows.VELOCITY, i], observer_state[rows.OBSERVED_ACCELERATION, i]
        u, u_0 = state[rows.DISPLACEMENT, i], observer_state[rows.U_PREVIOUS, i]
        v_0, a_0 = observer_state[rows.V_PREVIOUS, i], observer_state[rows.A_PREVIOUS, i]
        rate = v - link * v_below
        drift_acceleration = a - link * a_below
        # The last two fields, values one step before the start, are not used.
        ends = Ends(
            u_0 - link * u_0_below,
            v_0 - link * v_0_below,
            a_0 - link * a_0_below,
            u - link * u_below,
            rate,
            drift_acceleration,
            0.0,
            0.0,
        )
        may_exceed |= may_exceed_velocity_peak(h, by_h, ends, peaks[rows.PEAK_DRIFT_RATE, i])
        raise_peak(peaks, rows.PEAK_DRIFT_RATE, i, rate)
        dashpot_force, dashpot_tangent = power_damper(linear_terms, i, rate)
        linear_force = linear_terms[rows.DASHPOT, i] * rate
        power += (linear_force + dashpot_force) * rate
        # Half of the derivative of the power with respect to the drift rate. The linear dashpot has
        # the power c v^2 with the derivative 2 c v, the power-law dashpot the derivative F + F' v.
        half_derivative = linear_force + 0.5 * (dashpot_force + dashpot_tangent * rate)
        power_rate += 2.0 * half_derivative * drift_acceleration
        # An equal change of all floor accelerations only changes the drift acceleration of stories
        # on the ground.
        per_acceleration += (1.0 - link) * half_derivative
        u_below, v_below, a_below = u, v, a
        u_0_below, v_0_below, a_0_below = u_0, v_0, a_0
    # At the start of a run (h = 0) there is no work.
    if h > 0.0:
        work = _work(h, totals[rows.POWER_DASHPOTS], power, totals[rows.RATE_DASHPOTS] - power_rate)
        totals[rows.ENERGY_DASHPOTS] += work
        totals[rows.ENERGY_VISCOUS] -= work
    totals[rows.POWER_DASHPOTS] = power
    totals[rows.RATE_DASHPOTS] = power_rate
    totals[rows.DASHPOTS_PER_ACCELERATION] = per_acceleration
    return may_exceed


@outlined
def _update_peaks(ground, state, law_state, seen):
    """Raise the peaks (maximum absolute values) by the response at the end of the step.

    The quantities are drift, restoring force and total shear of the stories, displacement, velocity
    and absolute acceleration of the floors.

    Parameters
    ----------
    ground : float
        Ground acceleration, m/s^2.
    state : ndarray
        State of the method: displacements (m) and velocities (m/s) relative to the ground.
    law_state : ndarray
        States of the hysteretic laws: drifts (m) and restoring forces (N).
    seen : Seen
        Arrays of the observer, with the relative accelerations (m/s^2) and total shears (N).
    """
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
def _additional_powers(modal, forces, t, state, observer_state, n):
    """Compute the power of the forces on floors and its rate, and the power of modal damping and
    half of its rate.

    A force p on a floor with the velocity v and the acceleration a has the power p v and its rate p
    a + p' v. A damped mode with the row w of the modal damping matrix C = sum of w w^T has the
    power (w^T v)^2 and its rate 2 (w^T v) (w^T a). The result contains half the rate,
    because `_update_energies` doubles the sum over all dampers.

    Parameters
    ----------
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T: one row per damped mode.
    forces : ndarray
        Harmonic forces on floors: one row per force, with the columns FLOOR, COSINE, SINE and
        OMEGA.
    t : float
        Time, s.
    state : ndarray
        State of the method with the velocities, m/s.
    observer_state : ndarray
        Memory of the observer with the accelerations, m/s^2.
    n : int
        Number of floors.

    Returns
    -------
    float, float, float, float
        Power of the floor forces (W) and its rate (W/s); power of modal damping (W) and half of its
        rate (W/s).
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
    """Compute the change of the rates of power for a unit increase of the floor accelerations.

    If the ground acceleration jumps between two steps, the relative accelerations a of all floors
    jump by the same value, and so do the rates of the powers (`shift_ground`). The velocities v do
    not change. A force p on a floor has the power p v with the rate p' v + p a. A damped mode with
    the row w of the modal damping matrix has the power (w^T v)^2; half of its rate is
    (w^T v) (w^T a). If all accelerations increase by 1 m/s^2, the rate of the force increases by p,
    and half of the rate of the mode by (w^T v) (sum of the elements of w).

    Parameters
    ----------
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T: one row per damped mode.
    forces : ndarray
        Harmonic forces on floors: one row per force, with the columns FLOOR, COSINE, SINE and
        OMEGA.
    t : float
        Time, s.
    state : ndarray
        Row VELOCITY (m/s) is used.
    n : int
        Number of floors.

    Returns
    -------
    float, float
        Change of the rate of the power of all floor forces, and change of half of the rate of the
        power of modal damping, each per 1 m/s^2.
    """
    rate = 0.0
    half_viscous_rate = 0.0
    for j in range(forces.shape[0]):
        rate += force_value(forces, j, t)
    for j in range(modal.shape[0]):
        # v_modal is w^T v, and a_modal is w^T a for accelerations of 1 m/s^2.
        v_modal = 0.0
        a_modal = 0.0
        for i in range(n):
            v_modal += modal[j, i] * state[rows.VELOCITY, i]
            a_modal += modal[j, i]
        half_viscous_rate += v_modal * a_modal
    return rate, half_viscous_rate


@inline
def observe_within_step(may_exceed, scene, span, memory, seen):
    """Update the peaks with the response within the last step, and store its end as the next start.

    The kernel of the method can compute peaks within the step (`span.cornered`). These are merged
    into the peaks of the run. If `may_exceed` is True, `find_interstep_peaks` computes further
    peaks from the response at the endpoints. The quantities depend on the method:

        no peaks computed by the method                     all quantities
        peaks computed, parabolic displacements (on_path)   all quantities except absolute
                                                            accelerations and total shears
        peaks computed, other methods                       no quantity

    The response at the end is then stored in the rows U_PREVIOUS, V_PREVIOUS and A_PREVIOUS of the
    memory of the observer. If the building has modes that the step does not resolve (`span.fast`),
    the former contents of V_PREVIOUS and A_PREVIOUS are kept in the rows V_EARLIER and A_EARLIER.
    `find_interstep_peaks` needs the response of two successive steps to detect unresolved motion.

    Parameters
    ----------
    may_exceed : bool
        True if a peak may be exceeded in the step: result of `observe`.
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    span : Span
        Observed step.
    memory : Memory
        State, law states, scratch array and status of the step.
    seen : Seen
        Arrays of the observer.

    Returns
    -------
    int
        Number of stories with a reversal of the drift within the step that may cause a new peak
        shear. If it is positive, row REVERSAL_DRIFT of the memory of the observer contains the
        drifts of these reversals, and the drift at the end of the step for the other stories.
    """
    state, law_state, scratch, step_status = memory
    observer_state, peaks, _, _, _ = seen
    n = scene.linear_terms.shape[1] - 1
    reversals = 0
    if span.cornered:
        # STEP_PEAKS is the first row of the peaks that the step has computed in `scratch`, or 0 if
        # it has computed no peaks (`span.cornered` is then False).
        _merge_step_peaks(int(step_status[rows.STEP_PEAKS]), scratch, peaks, n)
        step_status[rows.STEP_PEAKS] = 0.0
    if may_exceed and (span.on_path or not span.cornered):
        # The fields are table and first row of the response at the start of the step, table with
        # displacement and velocity at its end, table and row of the acceleration at its end.
        passage = Passage(
            observer_state, rows.U_PREVIOUS, state, observer_state, rows.OBSERVED_ACCELERATION
        )
        # The last argument, 0, is the first row of the peaks in `peaks`.
        reversals = find_interstep_peaks(
            span, scene, passage, law_state, observer_state, rows.REVERSAL_DRIFT, peaks, 0
        )
    # Store the response at the end as the start of the next step, and the response at the start as
    # the earlier response.
    if span.fast:
        for i in range(n):
            observer_state[rows.V_EARLIER, i] = observer_state[rows.V_PREVIOUS, i]
            observer_state[rows.A_EARLIER, i] = observer_state[rows.A_PREVIOUS, i]
    store_previous(state, observer_state, n)
    return reversals


@outlined
def _merge_step_peaks(first, scratch, peaks, n):
    """Merge the peaks that the step has computed into the peaks of the run.

    The scratch rows of the step receive the merged peaks, so that the next step can compare with
    them.

    Parameters
    ----------
    first : int
        First scratch row of the peaks.
    scratch : ndarray
        Scratch array of the step: one row per quantity, one column per floor or story.
    peaks : ndarray
        Peaks of the run.
    n : int
        Number of floors.
    """
    for row in range(peaks.shape[0]):
        for i in range(n):
            raise_peak(peaks, row, i, scratch[first + row, i])
            scratch[first + row, i] = peaks[row, i]


@inline
def store_previous(state, observer_state, n):
    """Store displacements, velocities and accelerations as the start of the next observed step.

    Rows U_PREVIOUS, V_PREVIOUS and A_PREVIOUS of the memory of the observer are set.

    Parameters
    ----------
    state : ndarray
        State of the method: rows DISPLACEMENT (m) and VELOCITY (m/s) are used.
    observer_state : ndarray
        Memory of the observer: row OBSERVED_ACCELERATION (m/s^2) is used.
    n : int
        Number of floors.
    """
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

    Parameters
    ----------
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    load : ndarray
        Time at the start of the step (s) and ground acceleration at both endpoints (m/s^2).
    shifts : ndarray
        Change of each row of the state per unit increase of the accelerations.
    memory : Memory
        State and status of the step. STATE_GROUND of the status, the ground acceleration for which
        the accelerations of the state are valid, changes from the old to the new value.
    seen : Seen
        Arrays of the observer: accelerations of the floors and totals of the run are changed.
    """
    linear_terms, modal, _, forces, _ = scene
    state, observer_state, totals = memory.state, seen.observer_state, seen.totals
    ground = load[rows.GROUND_0]
    # All relative accelerations change by the old minus the new ground acceleration. The rows of
    # the state of a multi-step method can also depend on accelerations: the factor of a row is in
    # `shifts`.
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
    # The ground acceleration ag changes by -shift, and all accelerations a by shift. Update the
    # power of the load, -ag (sum of m v), and the term -ag (sum of m a) of its rate. MOMENTUM is
    # the sum of m v. TOTAL_INERTIA is the sum of m a before the jump. It is also updated here,
    # because the next jump occurs before `observe` stores a new sum if the step fails and is
    # halved.
    totals[rows.POWER_INPUT] += shift * totals[rows.MOMENTUM]
    totals[rows.RATE_INPUT] += shift * (
        totals[rows.TOTAL_INERTIA] - ground * totals[rows.TOTAL_MASS]
    )
    totals[rows.TOTAL_INERTIA] += shift * totals[rows.TOTAL_MASS]
    # The rows *_PER_ACCELERATION contain half of the change of a rate per unit change of a.
    totals[rows.RATE_VISCOUS] += 2.0 * shift * totals[rows.VISCOUS_PER_ACCELERATION]
    totals[rows.RATE_DASHPOTS] += 2.0 * shift * totals[rows.DASHPOTS_PER_ACCELERATION]
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        # `rate` is the change of RATE_INPUT per unit change of a by the forces on floors,
        # `half_viscous_rate` half of the change of RATE_VISCOUS by modal damping.
        rate, half_viscous_rate = _change_per_acceleration(modal, forces, load[rows.TIME], state, n)
        totals[rows.RATE_INPUT] += shift * rate
        totals[rows.RATE_VISCOUS] += 2.0 * shift * half_viscous_rate


@outlined
def _store_additional_forces(modal, forces, t, state, observer_state, n):
    """Store the forces on floors and the modal damping forces at time `t`.

    Row FLOOR_FORCE receives the forces on floors minus the modal damping forces, row MODAL_FORCE
    the modal damping forces. The function is not called for a building without modal damping and
    without forces on floors; both rows then remain zero.

    Parameters
    ----------
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T: one row per damped mode.
    forces : ndarray
        Harmonic forces on floors: one row per force, with the columns FLOOR, COSINE, SINE and
        OMEGA.
    t : float
        Time, s.
    state : ndarray
        State of the method: row VELOCITY (m/s) is used.
    observer_state : ndarray
        Rows FLOOR_FORCE and MODAL_FORCE are set, N.
    n : int
        Number of floors.
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

    With power P and its rate P' at the start (0) and at the end (1) of the step of length h, the
    work is h (P0 + P1) / 2 + h^2 (P0' - P1') / 12.

    Parameters
    ----------
    h : float
        Length of the step, s.
    power_0, power_1 : float
        Power at both endpoints, W.
    change : float
        Rate of the power at the start minus its rate at the end, W/s.
    """
    return 0.5 * h * (power_0 + power_1) + h * h / 12.0 * change


@inline
def _add_work(span, slope, current, totals):
    """Add the work of the load and of the dampers in a step to the energies of the run.

    The work is h (P0 + P1) / 2 + h^2 (P0' - P1') / 12 with the powers P and their rates P' at the
    start (in `totals`) and at the end (`current`). The powers at the end are stored for the next
    step. The dampers are all floor and story dampers, modal damping and all dashpots. Their work is
    added to ENERGY_VISCOUS; `_observe_dashpots` later moves the work of the dashpots to
    ENERGY_DASHPOTS.

    Parameters
    ----------
    span : Span
        Observed time step; its length h (s) is used.
    slope : float
        Rate of the ground acceleration in the step, m/s^3.
    current : _PowerValues
        Powers at the end of the step.
    totals : ndarray
        Totals of the run: ENERGY_INPUT and ENERGY_VISCOUS are updated. The powers, their rates
        and MOMENTUM (sum of mass times velocity, N s) change from the values at the start to the
        values at the end of the step.
    """
    # `change` is the rate of a power at the start minus its rate at the end. The rate of the ground
    # acceleration contributes minus `slope` times the momentum to the rate of the power of the
    # load; RATE_INPUT and `current.rate` do not contain this contribution.
    change = (
        totals[rows.RATE_INPUT] - current.rate - slope * (totals[rows.MOMENTUM] - current.momentum)
    )
    totals[rows.ENERGY_INPUT] += _work(span.h, totals[rows.POWER_INPUT], current.power, change)
    change = totals[rows.RATE_VISCOUS] - current.viscous_rate
    totals[rows.ENERGY_VISCOUS] += _work(
        span.h, totals[rows.POWER_VISCOUS], current.viscous_power, change
    )
    totals[rows.POWER_INPUT] = current.power
    totals[rows.RATE_INPUT] = current.rate
    totals[rows.MOMENTUM] = current.momentum
    totals[rows.POWER_VISCOUS] = current.viscous_power
    totals[rows.RATE_VISCOUS] = current.viscous_rate


@inline
def initialize_energies(linear_terms, totals):
    """Store the initial energies (J) and the total mass of the building (kg) in `totals`.

    The kernel `sum_law_energies` must have stored the kinetic, strain and hysteretic energy of the
    initial state before. ENERGY_INITIAL is the sum of kinetic and strain energy. ENERGY_REFERENCE,
    the divisor of the relative energy imbalance, is the largest value so far of the sum
    ENERGY_INITIAL + work of the load; at the start, it is ENERGY_INITIAL. The energy that the laws
    have dissipated on the path to the initial drifts, INITIAL_DISSIPATION, is subtracted from all
    later values of the hysteretic energy. Row MASS of `linear_terms` contains the masses of the
    floors, kg.
    """
    totals[rows.TOTAL_MASS] = 0.0
    for i in range(linear_terms.shape[1] - 1):
        totals[rows.TOTAL_MASS] += linear_terms[rows.MASS, i]
    totals[rows.INITIAL_DISSIPATION] = totals[rows.ENERGY_HYSTERETIC]
    totals[rows.ENERGY_HYSTERETIC] = 0.0
    totals[rows.ENERGY_INITIAL] = totals[rows.ENERGY_KINETIC] + totals[rows.ENERGY_STRAIN]
    totals[rows.ENERGY_REFERENCE] = totals[rows.ENERGY_INITIAL]


@outlined
def store(ground, fitted_ground, memory, seen, row):
    """Write one row of the history: ground acceleration, response of all floors, and energies (J).

    The energies in `totals` must have been updated before.

    In a step longer than a sampling interval, the load of the equations is not the ground
    acceleration itself, but a straight line fitted to it. The relative accelerations of the floors
    are in equilibrium with this line. The absolute accelerations are therefore their sums with the
    value of the line, `fitted_ground`. The history shows the actual ground acceleration, `ground`.

    Parameters
    ----------
    ground : float
        Ground acceleration of the motion at the time of the row, m/s^2.
    fitted_ground : float
        Value of the fitted line at the end of the step, m/s^2. Equal to `ground` at the start of a
        run and for steps that are not longer than a sampling interval.
    memory : Memory
        State and law states.
    seen : Seen
        Arrays of the observer; `history` is written.
    row : int
        Row of the history.
    """
    state, law_state = memory.state, memory.law_state
    observer_state, _, _, totals, history = seen
    n = observer_state.shape[1] - 1
    # The columns are ground acceleration; displacement, velocity and absolute acceleration of n
    # floors; shear of n stories; energies.
    history[row, 0] = ground
    for i in range(n):
        history[row, 1 + i] = state[rows.DISPLACEMENT, i]
        history[row, 1 + n + i] = state[rows.VELOCITY, i]
        history[row, 1 + 2 * n + i] = observer_state[rows.OBSERVED_ACCELERATION, i] + fitted_ground
        history[row, 1 + 3 * n + i] = law_state[rows.FORCE, i]
    energies = 1 + rows.HISTORY_FIELDS * n
    for j in range(rows.ENERGY_TERMS):
        history[row, energies + j] = totals[j]


@inline
def exceeds_limits(law_state, seen):
    """Return True if the peak drift of a story exceeds its limit or a story has failed.

    `law_state` is the table of the law states, `seen` contains the peaks and the limits. The limit
    is the drift ratio LIMIT times the story height HEIGHT (m). A story has failed if row INTERNAL
    of its law state has the value FAILED. Stories without a limit have the height nan, and stories
    without a failure the value nan in row FAILED: the comparisons are then False.
    """
    limits = seen.limits
    is_exceeded = False
    for i in range(limits.shape[1]):
        is_exceeded |= (
            seen.peaks[rows.PEAK_DRIFT, i] > limits[rows.LIMIT, i] * limits[rows.HEIGHT, i]
        )
        is_exceeded |= law_state[rows.INTERNAL, i] == limits[rows.FAILED, i]
    return is_exceeded


@outlined
def record_collapse(law_state, steps, seen):
    """Store the story and the step of the collapse, and the energies at this time, in `totals`.

    The story is the lowest failed story. If no story has failed, it is the story with the largest
    excess of its peak drift ratio (peak drift / height) over its limit. A story has failed if its
    row INTERNAL has the value that its law assigns at a failure (row FAILED of the limits; nan,
    which is equal to no value, for laws without failure). Call this function only if a story has
    failed or exceeds its limit (`exceeds_limits`); otherwise only the energies would be stored. The
    energies in `totals` must have been updated before.

    Parameters
    ----------
    law_state : ndarray
        States of the hysteretic laws: one row per quantity, one column per story.
    steps : int
        Number of complete steps.
    seen : Seen
        Arrays of the observer: the peaks and the collapse limits are used; the rows COLLAPSE_STEP,
        COLLAPSE_STORY, COLLAPSE_FAILED and COLLAPSE_ENERGIES of the totals are set.
    """
    _, peaks, limits, totals, _ = seen
    largest_excess = 0.0
    for i in range(limits.shape[1]):
        excess = peaks[rows.PEAK_DRIFT, i] / limits[rows.HEIGHT, i] - limits[rows.LIMIT, i]
        # The infinite excess of the lowest failed story is not exceeded by other stories.
        if law_state[rows.INTERNAL, i] == limits[rows.FAILED, i]:
            excess = math.inf
            totals[rows.COLLAPSE_FAILED] = 1.0
        if excess > largest_excess:
            largest_excess = excess
            totals[rows.COLLAPSE_STEP] = steps
            totals[rows.COLLAPSE_STORY] = i
    # The first elements of `totals` are the energies, then ENERGY_INITIAL and ENERGY_REFERENCE.
    for j in range(rows.ENERGY_TERMS + 2):
        totals[rows.COLLAPSE_ENERGIES + j] = totals[j]


# ---- Kernels that evaluate the drift laws outside of the steps: initialization, energies, and
# forces at reversals. The time loop receives the addresses of these kernels and of the step as
# arguments. It is therefore compiled only once for all laws and methods.

INITIALIZE_LAWS = I8(TABLE, TABLE, TABLE, TABLE)
SUM_LAW_ENERGIES = I8(TABLE, TABLE, TABLE, TABLE, VECTOR)
UPDATE_SHEAR_PEAKS = I8(TABLE, TABLE, TABLE, I8, TABLE)

_call_initialize_laws = indirect_caller(INITIALIZE_LAWS)
_call_sum_law_energies = indirect_caller(SUM_LAW_ENERGIES)
_call_update_shear_peaks = indirect_caller(UPDATE_SHEAR_PEAKS)


@inline
def call_initialize_laws(initialize_laws, scene, memory):
    """Move the laws of all stories to the initial drifts, by the kernel `initialize_laws`.

    `initialize_laws` is the address of the kernel, `scene` contains the building and the parameters
    of its laws, and `memory` the initial displacements. The law states in `memory` are set. The
    kernel receives plain arrays, because a named tuple cannot be an argument of a call by address.
    """
    _call_initialize_laws(
        initialize_laws, scene.linear_terms, scene.law_parameters, memory.state, memory.law_state
    )


@inline
def update_law_energies(sum_law_energies, scene, memory, seen):
    """Update the kinetic, strain and hysteretic energy in `seen.totals`, J.

    The kernel `sum_law_energies` is called by its address. The energies refer to the current state.
    They are computed only when they are needed, because all laws must be evaluated.

    Parameters
    ----------
    sum_law_energies : Kernel
        Kernel that sums the energies of the laws.
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    memory : Memory
        State, law states, scratch array and status of the step.
    seen : Seen
        Arrays of the observer.
    """
    _call_sum_law_energies(
        sum_law_energies,
        scene.linear_terms,
        scene.law_parameters,
        memory.state,
        memory.law_state,
        seen.totals,
    )


@inline
def update_reversal_shears(update_shear_peaks, scene, memory, seen):
    """Update the peak shears at reversals within the last step, by the kernel `update_shear_peaks`.

    The drifts of the reversals are in row REVERSAL_DRIFT of the memory of the observer.

    Parameters
    ----------
    update_shear_peaks : Kernel
        Kernel that computes the shears at reversals.
    scene : Scene
        Building (masses, dampers, parameters of the laws) and forces on its floors.
    memory : Memory
        State, law states, scratch array and status of the step.
    seen : Seen
        Arrays of the observer.
    """
    _call_update_shear_peaks(
        update_shear_peaks,
        scene.law_parameters,
        memory.law_state,
        seen.observer_state,
        rows.REVERSAL_DRIFT,
        seen.peaks,
    )


@kernel(INITIALIZE_LAWS, parts=("laws",))
def initialize_laws(linear_terms, law_parameters, state, law_state):
    """Move the hysteretic laws of all stories from zero drift to their initial drifts.

    The drift of a story is the difference of the displacements of the floors above and below.

    Parameters
    ----------
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses: one row per property, one column per floor.
    law_parameters : ndarray
        Parameters of the hysteretic laws: one row per parameter, one column per story.
    state : ndarray
        State of the method with the initial displacements.
    law_state : ndarray
        States of the hysteretic laws: one row per quantity, one column per story.

    Returns
    -------
    int
        Always 0, because the evaluation cannot fail.
    """
    displacement_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        start(
            law_parameters,
            law_state,
            i,
            state[rows.DISPLACEMENT, i] - linear_terms[rows.LINK, i] * displacement_below,
        )
        displacement_below = state[rows.DISPLACEMENT, i]
    return 0


@kernel(SUM_LAW_ENERGIES, parts=("laws",))
def sum_law_energies(linear_terms, law_parameters, state, law_state, totals):
    """Store the kinetic, strain and hysteretic energy of the current state in `totals`, J.

    The kinetic energy is the sum of m v^2 / 2 over the floors, with velocities relative to the
    ground. The strain energy is the sum of the energies stored by the laws and of the energy g d^2
    / 2 of P-delta (geometric stiffness g, drift d). The hysteretic energy is the dissipated energy
    since the start of the run.

    Parameters
    ----------
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses: one row per property, one column per floor.
    law_parameters : ndarray
        Parameters of the hysteretic laws: one row per parameter, one column per story.
    state : ndarray
        State of the method: row VELOCITY (m/s) is used.
    law_state : ndarray
        States of the hysteretic laws: one row per quantity, one column per story.
    totals : ndarray
        Totals of the run.

    Returns
    -------
    int
        Always 0, because the evaluation cannot fail.
    """
    kinetic = 0.0
    strain = 0.0
    hysteretic = 0.0
    for i in range(linear_terms.shape[1] - 1):
        drift = law_state[rows.DRIFT, i]
        kinetic += (
            0.5 * linear_terms[rows.MASS, i] * state[rows.VELOCITY, i] * state[rows.VELOCITY, i]
        )
        strain += (
            strain_energy(law_parameters, law_state, i)
            + 0.5 * linear_terms[rows.GEOMETRIC, i] * drift * drift
        )
        hysteretic += hysteretic_energy(law_parameters, law_state, i)
    totals[rows.ENERGY_KINETIC] = kinetic
    totals[rows.ENERGY_STRAIN] = strain
    totals[rows.ENERGY_HYSTERETIC] = hysteretic - totals[rows.INITIAL_DISSIPATION]
    return 0


@kernel(UPDATE_SHEAR_PEAKS, parts=("laws",))
def update_shear_peaks(law_parameters, law_state, reversal_drifts, row, peaks):
    """Update the peak shears of the stories with a reversal within the last step.

    The law states at the start of the step are no longer available. Therefore, the law moves from
    its state at the end of the step back to the drift of the reversal. The result is the force at
    the reversal if unloading after the reversal and reloading follow the same branch. Otherwise, it
    is an approximation. The first trial state in `law_state` is overwritten; the state at the end
    of the step is not changed.

    Parameters
    ----------
    law_parameters : ndarray
        Parameters of the hysteretic laws: one row per parameter, one column per story.
    law_state : ndarray
        States of the hysteretic laws: one row per quantity, one column per story.
    reversal_drifts : ndarray
        Table with the drifts of the reversals.
    row : int
        Row of these drifts, m. For a story without a reversal, the row contains the drift at the
        end of the step.
    peaks : ndarray
        Peaks of the run.

    Returns
    -------
    int
        Always 0, because the evaluation cannot fail.
    """
    # A reversal drift that differs from the drift at the end of the step marks a reversal.
    for i in range(peaks.shape[1]):
        if reversal_drifts[row, i] != law_state[rows.DRIFT, i]:
            # Compute the force on the path from the state at the end of the step (block COMMITTED)
            # and store it in block FIRST_TRIAL.
            restoring_force_outlined(
                law_parameters,
                law_state,
                i,
                rows.COMMITTED,
                rows.FIRST_TRIAL,
                reversal_drifts[row, i],
            )
            raise_peak(peaks, rows.PEAK_SHEAR, i, law_state[rows.FIRST_TRIAL + rows.FORCE, i])
    return 0
