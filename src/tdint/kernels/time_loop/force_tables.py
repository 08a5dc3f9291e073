"""Forces on floors from tables: line of each table over a step, and jumps between the lines.

A table is linear between its points, and zero before the first and after the last point. Two points
with the same time are a jump. Over each step or substep, the equations of motion use the straight
line with the impulse and the first moment of the table, which preserves the order of all methods up
to order 4 with kinks and jumps inside the step. The relative accelerations and the powers are those
of the line. Lines of successive steps can differ at their common endpoint. The accelerations of the
loaded floors then jump by the difference, divided by the mass.

The absolute acceleration of a floor follows from the table: with the force p of the table
and the line q, it is the acceleration under the line plus (p - q) / m. Displacements, velocities
and internal forces of the stories are the same under both, except for the error of the method.
"""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.linear_terms import (
    add_modal_force,
    base_of,
    below_next,
    force_value,
    power_damper,
    tie,
)
from tdint.kernels.peaks_between_steps import observed_passage, raise_peak
from tdint.kernels.peaks_in_parts import raise_peaks_in_part

# Points nearer to an endpoint of the step than these fractions of the step and of the time are at
# the endpoint: rounding of times such as 7 * 0.01 and 0.07.
_STEP_TOLERANCE = 1e-12
_TIME_TOLERANCE = 1e-15
# Columns of harmonic forces, which tables do not use: value (N) and rate (N/s) of the line of the
# last step at the start of the step
_OLD_VALUE = rows.COSINE
_OLD_RATE = rows.SINE
# Fraction of the largest value. Smaller deviations from the line and jumps between lines are
# rounding errors.
_ROUNDING = 1e-11


@inline
def _time(forces, points, j, k):
    """Return the time of point `k` of table `j`, s."""
    index = int(forces[j, rows.TIMES]) + k * int(forces[j, rows.STRIDE])
    return points[index] + forces[j, rows.DELAY]


@inline
def _value(forces, points, j, k):
    """Return the force at point `k` of table `j`, N."""
    index = int(forces[j, rows.VALUES]) + k * int(forces[j, rows.STRIDE])
    return forces[j, rows.FACTOR] * points[index]


@inline
def _tolerance(end, h):
    """Return the distance from an endpoint of a step of length `h` (s) within which a point is at
    the endpoint, s. `end` is the time at the end of the step, s.
    """
    return _STEP_TOLERANCE * h + _TIME_TOLERANCE * abs(end)


@inline
def _share(forces, points, j, k, t):
    """Return the position of time `t` between the points `k` - 1 and `k` of table `j`, from 0 to 1;
    0 before the first and after the last point (`k` 0 and number of points)."""
    if k <= 0 or k >= int(forces[j, rows.POINTS]):
        return 0.0
    t_0 = _time(forces, points, j, k - 1)
    return (t - t_0) / (_time(forces, points, j, k) - t_0)


@inline
def _between(forces, points, j, k, share):
    """Return the force of table `j` on the line between the points `k` - 1 and `k` at the position
    `share` (`_share`), N; 0 before the first and after the last point."""
    if k <= 0 or k >= int(forces[j, rows.POINTS]):
        return 0.0
    value_0 = _value(forces, points, j, k - 1)
    rise = _value(forces, points, j, k) - value_0
    return value_0 + rise * share


@inline
def _before(forces, points, j, k, t):
    """Return the force of table `j` at time `t` on the line between the points `k` - 1 and `k`, N.

    It is 0 before the first and after the last point (`k` 0 and number of points).
    """
    return _between(forces, points, j, k, _share(forces, points, j, k, t))


@inline
def _points_until(forces, points, j, k, t):
    """Return the number of points of table `j` until time `t` (s), searched from the number `k`."""
    count = int(forces[j, rows.POINTS])
    while k > 0 and _time(forces, points, j, k - 1) > t:
        k -= 1
    while k < count and _time(forces, points, j, k) <= t:
        k += 1
    return k


@inline
def initialize_lines(forces, points):
    """Set the line of each table to its constant force at t = 0, after a jump at this time."""
    for j in range(forces.shape[0]):
        if forces[j, rows.POINTS] > 0.0:
            k = _points_until(forces, points, j, 0, 0.0)
            forces[j, rows.NEXT_POINT] = k
            forces[j, rows.LINE_TIME] = 0.0
            forces[j, rows.LINE_VALUE] = _before(forces, points, j, k, 0.0)
            forces[j, rows.LINE_RATE] = 0.0
            forces[j, rows.DEVIATION] = 0.0


@inline
def _locate_step(forces, points, j, t, h):
    """Return the position of the step [t, t + h] in table `j`: the number of points until its
    start, True if no point is inside, its start as a fraction of the interval that contains the
    start, and the inverse length of this interval, 1/s (0 outside the table).
    """
    tolerance = _tolerance(t + h, h)
    count = int(forces[j, rows.POINTS])
    k = _points_until(forces, points, j, int(forces[j, rows.NEXT_POINT]), t + tolerance)
    is_linear = k == count or _time(forces, points, j, k) >= t + h - tolerance
    if k == 0 or k == count:
        return k, is_linear, 0.0, 0.0
    begin = _time(forces, points, j, k - 1)
    by_length = 1.0 / (_time(forces, points, j, k) - begin)
    return k, is_linear, (t - begin) * by_length, by_length


@inline
def _copy_line(forces, points, j, position):
    """Set the line of table `j` to the table in a step without points inside; `position` is the
    result of `_locate_step`.
    """
    k, _, share, by_length = position
    start = rate = 0.0
    if 0 < k < int(forces[j, rows.POINTS]):
        value = _value(forces, points, j, k - 1)
        rise = _value(forces, points, j, k) - value
        start = value + rise * share
        rate = rise * by_length
    forces[j, rows.LINE_VALUE] = start
    forces[j, rows.LINE_RATE] = rate
    for column in range(rows.FORCE_COLUMNS, forces.shape[1]):
        forces[j, column] = 0.0


@outlined
def _fit_lines(forces, points, first, after, t, h):
    """Fit the lines of the tables `first` to `after` - 1, which have the same times, over the step
    [t, t + h] with points inside, and store their largest deviations. NEXT_POINT is the number of
    points until the start of the step.

    The sums over the pieces between points have no cancellation, unlike differences of sums from
    the start of the table. The positions of the points in the step are computed once for all
    tables. LINE_VALUE, LINE_RATE and DEVIATION contain impulse, first moment about the middle and
    largest value of a table until the last piece is added. The result is the number of points
    until the end of the step, and the position of the end (`_share`).
    """
    count = int(forces[first, rows.POINTS])
    k = int(forces[first, rows.NEXT_POINT])
    last = t + h - _tolerance(t + h, h)  # points from this time on are not inside the step
    for j in range(first, after):
        forces[j, rows.LINE_VALUE] = forces[j, rows.LINE_RATE] = forces[j, rows.DEVIATION] = 0.0
    # Times of this loop are relative to the start of the step.
    begin, is_first = 0.0, True
    share, end_share = _share(forces, points, first, k, t), 0.0
    while True:
        at_end = k == count or _time(forces, points, first, k) >= last
        if at_end:
            end, end_share = h, _share(forces, points, first, k, t + h)
        else:
            end = _time(forces, points, first, k) - t
        center = 0.5 * (begin + end - h)
        by_rise = (end - begin) ** 2 / 12.0
        for j in range(first, after):
            if is_first:
                value = _between(forces, points, j, k, share)
            else:
                value = _value(forces, points, j, k - 1) if k < count else 0.0
            if at_end:
                end_value = _between(forces, points, j, k, end_share)
            else:
                end_value = _value(forces, points, j, k) if k > 0 else 0.0
            area = 0.5 * (end - begin) * (value + end_value)
            forces[j, rows.LINE_VALUE] += area
            forces[j, rows.LINE_RATE] += center * area + by_rise * (end_value - value)
            forces[j, rows.DEVIATION] = max(forces[j, rows.DEVIATION], abs(value), abs(end_value))
        if at_end:
            break
        k = _points_until(forces, points, first, k, _time(forces, points, first, k))
        begin, is_first = end, False
    for j in range(first, after):
        half_rise = 6.0 * forces[j, rows.LINE_RATE] / (h * h)
        forces[j, rows.LINE_VALUE] = forces[j, rows.LINE_VALUE] / h - half_rise
        forces[j, rows.LINE_RATE] = 2.0 * half_rise / h
    for j in range(first, after):
        largest = forces[j, rows.DEVIATION]
        deviation = _largest_deviation(forces, points, j, t, h, share, k, end_share)
        forces[j, rows.DEVIATION] = deviation if deviation > _ROUNDING * largest else 0.0
    return k, end_share


@inline
def _largest_deviation(forces, points, j, t, h, share, end, end_share):
    """Return the maximum absolute deviation of table `j` from its line in a step, N, and store its
    Legendre coefficients, if the table of forces has columns for them.

    `share` is the position of the start of the step in its interval, `end` the number of points
    until the end of the step, and `end_share` the position of the end (`_share`).

    With x from -1 to 1 over the step, the coefficient of degree k from 2 on is (2 k + 1) / 2 times
    the integral of p P_k. Integration by parts reduces the integral to the points inside the step,
    with jumps J of p and K of dp/dx:

        sum of -J I(x) + K II(x)
        I = (P_(k+1) - P_(k-1)) / (2 k + 1)              integral of P_k from -1
        II = (I_(k+1) - I_(k-1)) / (2 k + 1)             integral of I
    """
    count = int(forces[j, rows.POINTS])
    k = int(forces[j, rows.NEXT_POINT])
    for column in range(rows.FORCE_COLUMNS, forces.shape[1]):
        forces[j, column] = 0.0
    largest = abs(_between(forces, points, j, k, share) - force_value(forces, j, t))
    while k < end:
        time = _time(forces, points, j, k)
        after = _points_until(forces, points, j, k, time)
        left = _value(forces, points, j, k) if k > 0 else 0.0
        right = _value(forces, points, j, after - 1) if after < count else 0.0
        line = force_value(forces, j, time)
        largest = max(largest, abs(left - line), abs(right - line))
        if forces.shape[1] > rows.FORCE_COLUMNS:
            kink = 0.5 * h * (_slope(forces, points, j, after) - _slope(forces, points, j, k))
            _add_moments(forces, j, 2.0 * (time - t) / h - 1.0, right - left, kink)
        k = after
    return max(
        largest, abs(_between(forces, points, j, end, end_share) - force_value(forces, j, t + h))
    )


@inline
def _slope(forces, points, j, k):
    """Return the slope of table `j` between the points `k` - 1 and `k`, N/s; 0 outside."""
    if k <= 0 or k >= int(forces[j, rows.POINTS]):
        return 0.0
    return (_value(forces, points, j, k) - _value(forces, points, j, k - 1)) / (
        _time(forces, points, j, k) - _time(forces, points, j, k - 1)
    )


@inline
def _add_moments(forces, j, x, jump, kink):
    """Add the contributions of a point at `x` to the Legendre coefficients of table `j`.

    `jump` is the jump of the force (N), `kink` the jump of its derivative with respect to x (N).
    """
    # P_0 to P_4 at x; p_2 is P_k for the current degree k.
    p_0, p_1 = 1.0, x
    p_2 = 0.5 * (3.0 * x * x - 1.0)
    p_3 = (5.0 * x * p_2 - 2.0 * p_1) / 3.0
    p_4 = (7.0 * x * p_3 - 3.0 * p_2) / 4.0
    for column in range(rows.FORCE_COLUMNS, forces.shape[1]):
        k = column - rows.FORCE_COLUMNS + 2.0
        first = (p_3 - p_1) / (2.0 * k + 1.0)
        second = (
            (p_4 - p_2) / (2.0 * k + 3.0) - (p_2 - p_0) / (2.0 * k - 1.0)
        ) / (2.0 * k + 1.0)  # fmt: skip
        forces[j, column] += (k + 0.5) * (kink * second - jump * first)
        p_0, p_1, p_2, p_3 = p_1, p_2, p_3, p_4
        p_4 = ((2.0 * k + 5.0) * x * p_3 - (k + 2.0) * p_2) / (k + 3.0)


@outlined
def start_step(scene, points, h, load, shifts, memory, seen):
    """Fit the lines of all tables over a step and shift the state to their values at its start;
    return True if a table deviates from its line within the step (`Span.kinked`).

    The lines of the last step end, and those of this step start with different values. Velocities v
    and displacements do not change; the acceleration a of a loaded floor changes by the jump of the
    line, divided by the mass. In the totals, the power of the forces p v and its rate p' v + p a
    change, and the rates of the powers of dampers, which are linear in a.
    """
    forces, state = scene.forces, memory.state
    observer_state, totals = seen.observer_state, seen.totals
    n = scene.linear_terms.shape[1] - 1
    t = load[rows.TIME]
    for row in range(rows.START_FORCE, rows.SHEAR_BOUND + 1):
        for i in range(n):
            observer_state[row, i] = 0.0
    is_kinked = has_jumps = False
    power = rate = 0.0
    # Position of the end of the step in the tables with the same times
    last, end_share = 0, 0.0
    for j in range(forces.shape[0]):
        if forces[j, rows.POINTS] == 0.0:
            continue
        if forces[j, rows.NEW_TIMES] != 0.0:
            last, end_share = _fit_tables_with_same_times(forces, points, j, t, h)
        i = int(forces[j, rows.FLOOR])
        inverse_mass = scene.linear_terms[rows.INVERSE_MASS, i]
        value = forces[j, rows.LINE_VALUE]
        observer_state[rows.START_FORCE, i] += value
        jump = value - forces[j, _OLD_VALUE]
        if abs(jump) > _ROUNDING * (abs(value) + abs(forces[j, _OLD_VALUE])):
            has_jumps = True
            observer_state[rows.ACCELERATION_JUMP, i] += inverse_mass * jump
        velocity = state[rows.VELOCITY, i]
        power += jump * velocity
        rate += (forces[j, rows.LINE_RATE] - forces[j, _OLD_RATE]) * velocity
        rate += jump * observer_state[rows.A_PREVIOUS, i]
        if forces[j, rows.DEVIATION] > 0.0:
            is_kinked = True
            end = _between(forces, points, j, last, end_share) - force_value(forces, j, t + h)
            observer_state[rows.ACCELERATION_DEVIATION, i] += inverse_mass * end
            observer_state[rows.DEVIATION_BOUND, i] += inverse_mass * forces[j, rows.DEVIATION]
    totals[rows.POWER_INPUT] += power
    totals[rows.RATE_INPUT] += rate
    if is_kinked:
        _bound_deviations(scene, h, state, observer_state)
    if has_jumps:
        _shift_accelerations(scene, load, shifts, memory, seen, is_kinked)
    return is_kinked


@outlined
def _bound_deviations(scene, h, state, observer_state):
    """Store upper bounds of the deviations of velocities and total shears from the response under
    the lines of a step of length `h` (s), and add the effect of the dampers to the deviations of
    the accelerations (row DEVIATION_BOUND).

    The deviation of a table has no mean and no first moment over the step. If it is at most B,
    its integral is at most B times the distance, in the mean over the step, of a step function from
    the nearest straight line, which is less than h / 3. The bound of a power-law dashpot uses the
    drift rate at the start of the step.
    """
    linear_terms, modal, law_parameters, _, _ = scene
    n = linear_terms.shape[1] - 1
    for i in range(n):
        bound = h / 3.0 * observer_state[rows.DEVIATION_BOUND, i]
        observer_state[rows.VELOCITY_BOUND, i] = bound
        observer_state[rows.MODAL_DEVIATION, i] = 0.0
    tie(linear_terms, observer_state, rows.VELOCITY_BOUND)
    if FULL:
        for j in range(modal.shape[0]):
            amplitude = 0.0
            for i in range(n):
                amplitude += abs(modal[j, i]) * observer_state[rows.VELOCITY_BOUND, i]
            for i in range(n):
                observer_state[rows.MODAL_DEVIATION, i] += abs(modal[j, i]) * amplitude
    story_above = floors = 0.0  # bounds of the sums in `raise_peaks_in_part`, N
    for i in range(n - 1, -1, -1):
        link, link_above = linear_terms[rows.LINK, i], linear_terms[rows.LINK, i + 1]
        below = base_of(linear_terms, i)
        if below_next(linear_terms, i) != i:
            link_above = 0.0
        velocity = observer_state[rows.VELOCITY_BOUND, i]
        rate = velocity + link * observer_state[rows.VELOCITY_BOUND, below]
        coefficient = linear_terms[rows.STORY_DAMPER, i]
        if FULL:
            coefficient += linear_terms[rows.TANGENT_DAMPING, i] * law_parameters[rows.STIFFNESS, i]
        story = coefficient * rate
        if FULL and linear_terms[rows.POWER_DAMPER, i] != 0.0:
            # A change of the rate by d changes the force by at most twice the force at d if the
            # exponent is at most 1, otherwise by d times the larger derivative.
            start = state[rows.VELOCITY, i] - link * state[rows.VELOCITY, below]
            story += 2.0 * power_damper(linear_terms, i, rate)[0]
            story += rate * power_damper(linear_terms, i, abs(start) + rate)[1]
        floor = linear_terms[rows.FLOOR_DAMPER, i] * velocity
        floor += observer_state[rows.MODAL_DEVIATION, i]
        observer_state[rows.DEVIATION_BOUND, i] += linear_terms[rows.INVERSE_MASS, i] * (
            floor + story + link_above * story_above
        )
        floors = link_above * floors + floor
        observer_state[rows.SHEAR_BOUND, i] = story + floors
        story_above = story


@inline
def _fit_tables_with_same_times(forces, points, first, t, h):
    """Fit the lines over the step [t, t + h] of table `first` and of the following tables with the
    same times; return the number of points until the end of the step, and the position of the end
    (`_share`), for steps with points inside.

    The columns _OLD_VALUE and _OLD_RATE receive the lines of the last step.
    """
    after = first + 1
    while after < forces.shape[0] and forces[after, rows.NEW_TIMES] == 0.0:
        after += 1
    position = _locate_step(forces, points, first, t, h)
    for j in range(first, after):
        rate = forces[j, rows.LINE_RATE]
        forces[j, _OLD_RATE] = rate
        forces[j, _OLD_VALUE] = forces[j, rows.LINE_VALUE] + rate * (t - forces[j, rows.LINE_TIME])
        forces[j, rows.NEXT_POINT] = position[0]
        forces[j, rows.LINE_TIME] = t
    if not position[1]:
        return _fit_lines(forces, points, first, after, t, h)
    for j in range(first, after):
        forces[j, rows.DEVIATION] = 0.0
        _copy_line(forces, points, j, position)
    return 0, 0.0


@outlined
def _shift_accelerations(scene, load, shifts, memory, seen, is_kinked):
    """Change the accelerations of the state by row ACCELERATION_JUMP, and the rates of powers that
    depend on them.

    The accelerations after the jump are peaks of the response, except in a kinked step, where they
    are the accelerations of the line (`raise_peaks_in_parts`).
    """
    linear_terms, _, _, forces, _ = scene
    state, observer_state, totals = memory.state, seen.observer_state, seen.totals
    ground = load[rows.GROUND_0]
    tie(linear_terms, observer_state, rows.ACCELERATION_JUMP)
    for i in range(linear_terms.shape[1] - 1):
        jump = observer_state[rows.ACCELERATION_JUMP, i]
        below = observer_state[rows.ACCELERATION_JUMP, base_of(linear_terms, i)]
        for row in range(shifts.shape[0]):
            state[row, i] += shifts[row] * jump
        a = observer_state[rows.A_PREVIOUS, i] + jump
        observer_state[rows.A_PREVIOUS, i] = a
        observer_state[rows.OBSERVED_ACCELERATION, i] = a
        if jump != 0.0 and not is_kinked:
            raise_peak(seen.peaks, rows.PEAK_ACCELERATION, i, a + ground)
        mass = linear_terms[rows.MASS, i]
        totals[rows.RATE_INPUT] += jump * (observer_state[rows.START_FORCE, i] - mass * ground)
        totals[rows.TOTAL_INERTIA] += mass * jump
        # Row MODAL_FORCE contains C v of modal damping. Half of the rate of v^T C v is (C v)^T a.
        factor = observer_state[rows.VISCOUS_FACTOR, i] + observer_state[rows.MODAL_FORCE, i]
        totals[rows.RATE_VISCOUS] += 2.0 * jump * factor
        drift_jump = jump - linear_terms[rows.LINK, i] * below
        change = 2.0 * observer_state[rows.DASHPOT_FACTOR, i] * drift_jump
        totals[rows.RATE_DASHPOTS] += change
        if FULL:
            observer_state[rows.DASHPOT_RATE, i] += change
    # START_FORCE contains the tables only. The harmonic forces are first.
    for j in range(forces.shape[0]):
        if forces[j, rows.POINTS] > 0.0:
            break
        jump = observer_state[rows.ACCELERATION_JUMP, int(forces[j, rows.FLOOR])]
        totals[rows.RATE_INPUT] += force_value(forces, j, load[rows.TIME]) * jump


@outlined
def raise_peaks_in_parts(scene, points, span, memory, seen):
    """Raise the peaks of velocities, drift rates, absolute accelerations and total shears in a step
    where a table is not linear.

    The step is searched in parts between the points of the tables. In a part, the response is that
    of `peaks_between_steps`, which is valid for the lines, plus deviations. The deviation of a
    table from its line, divided by the mass, is a deviation of the acceleration, and its integral a
    deviation of the velocity, which is zero at both endpoints of the step. The deviations of the
    velocities change the forces of the dampers and therefore, again, the accelerations: after a
    jump of a table inside the step, by a part that is proportional to the length of the step. The
    deviations of the displacements are proportional to its square, and omitted.
    """
    observer_state = seen.observer_state
    n = scene.linear_terms.shape[1] - 1
    passage = observed_passage(memory.state, observer_state)
    start, last = span.t - span.h, span.t - _tolerance(span.t, span.h)
    for i in range(n):
        observer_state[rows.VELOCITY_DEVIATION + 1, i] = 0.0
        observer_state[rows.MODAL_DEVIATION + 1, i] = 0.0
        change = observer_state[rows.A_PREVIOUS, i] - observer_state[rows.OBSERVED_ACCELERATION, i]
        observer_state[rows.VELOCITY_BULGE, i] = 0.5 * span.h * change
        observer_state[rows.MODAL_BULGE, i] = 0.0
    row, target = rows.VELOCITY_BULGE, rows.MODAL_BULGE
    add_modal_force(scene.modal, observer_state, row, 1.0, observer_state, target, n)
    begin = start
    while begin < last:
        end = _end_of_part(scene.forces, points, begin, last, span)
        _store_deviations(scene, points, span, begin, end, observer_state)
        part = ((begin - start) / span.h, 1.0 if end == span.t else (end - start) / span.h)
        raise_peaks_in_part(span, scene, passage, memory.law_state, part, seen)
        begin = end
    if span.cornered:
        _raise_accelerations_at_corners(scene, points, span, memory, seen)


@outlined
def _raise_accelerations_at_corners(scene, points, span, memory, seen):
    """Raise the peak accelerations by those at the branch changes within the step, under the tables
    instead of their lines."""
    scratch, forces = memory.scratch, scene.forces
    corner = int(memory.step_status[rows.STEP_PEAKS]) + 2 * rows.PEAK_ROWS
    for i in range(scene.linear_terms.shape[1] - 1):
        t, deviation = scratch[corner + 1, i], 0.0
        for j in range(forces.shape[0]):
            if forces[j, rows.POINTS] > 0.0 and forces[j, rows.FLOOR] == i:
                k = _next_point(forces, points, j, t, span)
                deviation += _before(forces, points, j, k, t) - force_value(forces, j, t)
        acceleration = scratch[corner, i] + scene.linear_terms[rows.INVERSE_MASS, i] * deviation
        raise_peak(seen.peaks, rows.PEAK_ACCELERATION, i, acceleration)


@inline
def _end_of_part(forces, points, begin, last, span):
    """Return the time of the first point of a table after `begin` and before `last`, or the end of
    the step, s.
    """
    end = span.t
    for j in range(forces.shape[0]):
        if forces[j, rows.POINTS] > 0.0 and forces[j, rows.NEW_TIMES] != 0.0:
            k = _next_point(forces, points, j, begin, span)
            if k < int(forces[j, rows.POINTS]):
                time = _time(forces, points, j, k)
                end = min(end, time) if time < last else end
    return end


@inline
def _store_deviations(scene, points, span, begin, end, observer_state):
    """Store the deviations from the response under the lines at both endpoints of a part of a step,
    from `begin` to `end` (s): of the forces of the tables, of the velocities and of the forces of
    modal damping.

    The deviations of the velocities at the start are the deviations at the end of the previous
    part.
    """
    linear_terms, modal, _, forces, _ = scene
    n = linear_terms.shape[1] - 1
    for i in range(n):
        observer_state[rows.LOAD_DEVIATION, i] = 0.0
        observer_state[rows.LOAD_DEVIATION + 1, i] = 0.0
    k, share_0, share_1 = 0, 0.0, 0.0
    for j in range(forces.shape[0]):
        if forces[j, rows.POINTS] == 0.0:
            continue
        if forces[j, rows.NEW_TIMES] != 0.0:
            k = _next_point(forces, points, j, begin, span)
            share_0 = _share(forces, points, j, k, begin)
            share_1 = _share(forces, points, j, k, end)
        i = int(forces[j, rows.FLOOR])
        deviation = _between(forces, points, j, k, share_0) - force_value(forces, j, begin)
        observer_state[rows.LOAD_DEVIATION, i] += deviation
        deviation = _between(forces, points, j, k, share_1) - force_value(forces, j, end)
        observer_state[rows.LOAD_DEVIATION + 1, i] += deviation
    for i in range(n):
        velocity = observer_state[rows.VELOCITY_DEVIATION + 1, i]
        observer_state[rows.VELOCITY_DEVIATION, i] = velocity
        mean = 0.5 * (
            observer_state[rows.LOAD_DEVIATION, i] + observer_state[rows.LOAD_DEVIATION + 1, i]
        )
        velocity += (end - begin) * linear_terms[rows.INVERSE_MASS, i] * mean
        observer_state[rows.VELOCITY_DEVIATION + 1, i] = velocity if end < span.t else 0.0
        # The deviation of the acceleration is linear in the part, the deviation of the velocity is
        # a parabola.
        change = observer_state[rows.LOAD_DEVIATION, i] - observer_state[rows.LOAD_DEVIATION + 1, i]
        observer_state[rows.VELOCITY_DEVIATION + 2, i] = (
            0.5 * (end - begin) * linear_terms[rows.INVERSE_MASS, i] * change
        )
        modal_force = observer_state[rows.MODAL_DEVIATION + 1, i]
        observer_state[rows.MODAL_DEVIATION, i] = modal_force
        observer_state[rows.MODAL_DEVIATION + 1, i] = 0.0
        observer_state[rows.MODAL_DEVIATION + 2, i] = 0.0
    row, target = rows.VELOCITY_DEVIATION, rows.MODAL_DEVIATION
    add_modal_force(modal, observer_state, row + 1, 1.0, observer_state, target + 1, n)
    add_modal_force(modal, observer_state, row + 2, 1.0, observer_state, target + 2, n)


@inline
def _next_point(forces, points, j, t, span):
    """Return the number of points of table `j` until time `t` (s) in the step of `span`."""
    tolerance = _tolerance(span.t, span.h)
    return _points_until(forces, points, j, int(forces[j, rows.NEXT_POINT]), t + tolerance)
