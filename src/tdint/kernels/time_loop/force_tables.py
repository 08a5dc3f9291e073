"""Forces on floors from tables: line of each table over a step, and jumps between the lines.

A table is linear between its points, and zero before the first and after the last point. Two points
with the same time are a jump. Over each step or substep, the equations of motion use the straight
line with the impulse and the first moment of the table, which preserves the order of all methods up
to order 4 with kinks and jumps inside the step. The relative accelerations and the powers are those
of the line. Lines of successive steps can differ at their common endpoint. The accelerations of the
loaded floors then jump by the difference, divided by the mass.

The absolute acceleration of a floor follows from the table itself: with the force p of the table
and the line q, it is the acceleration under the line plus (p - q) / m. Displacements, velocities
and internal forces of the stories are the same under both, except for the error of the method.
"""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.linear_terms import force_value
from tdint.kernels.peaks_between_steps import (
    raise_acceleration_in_part,
    raise_peak,
    raise_velocity_peaks,
)
from tdint.kernels.stepping import Passage

# Points nearer to an endpoint of the step than these fractions of the step and of the time are at
# the endpoint: rounding of times such as 7 * 0.01 and 0.07.
_STEP_TOLERANCE = 1e-12
_TIME_TOLERANCE = 1e-15
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
def _before(forces, points, j, k, t):
    """Return the force of table `j` at time `t` on the line between the points `k` - 1 and `k`, N.

    It is 0 before the first and after the last point (`k` 0 and number of points).
    """
    if k <= 0 or k >= int(forces[j, rows.POINTS]):
        return 0.0
    t_0 = _time(forces, points, j, k - 1)
    value_0 = _value(forces, points, j, k - 1)
    rise = _value(forces, points, j, k) - value_0
    return value_0 + rise * ((t - t_0) / (_time(forces, points, j, k) - t_0))


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
    result of `_locate_step`. Return the value of the line at the start of the step, N.
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
    return start


@outlined
def _fit_line(forces, points, j, t, h):
    """Fit the line of table `j` over the step [t, t + h] with points inside, and store its largest
    deviation. NEXT_POINT is the number of points until the start of the step.

    The sums over the pieces between points have no cancellation, unlike differences of sums from
    the start of the table.
    """
    count = int(forces[j, rows.POINTS])
    k = int(forces[j, rows.NEXT_POINT])
    last = t + h - _tolerance(t + h, h)  # points from this time on are not inside the step
    # Impulse and first moment about the middle. Times of this loop are relative to the start of the
    # step.
    impulse = moment = largest = begin = 0.0
    value = _before(forces, points, j, k, t)
    while True:
        at_end = k == count or _time(forces, points, j, k) >= last
        if at_end:
            end = h
            end_value = _before(forces, points, j, k, t + h)
        else:
            end = _time(forces, points, j, k) - t
            end_value = _value(forces, points, j, k) if k > 0 else 0.0
        area = 0.5 * (end - begin) * (value + end_value)
        impulse += area
        moment += (0.5 * (begin + end - h)) * area + (end - begin) ** 2 / 12.0 * (end_value - value)
        largest = max(largest, abs(value), abs(end_value))
        if at_end:
            break
        k = _points_until(forces, points, j, k, _time(forces, points, j, k))
        begin = end
        value = _value(forces, points, j, k - 1) if k < count else 0.0
    half_rise = 6.0 * moment / (h * h)
    forces[j, rows.LINE_VALUE] = impulse / h - half_rise
    forces[j, rows.LINE_RATE] = 2.0 * half_rise / h
    deviation = _largest_deviation(forces, points, j, t, h)
    forces[j, rows.DEVIATION] = deviation if deviation > _ROUNDING * largest else 0.0


@inline
def _largest_deviation(forces, points, j, t, h):
    """Return the maximum absolute deviation of table `j` from its line in a step, N, and store its
    Legendre coefficients, if the table of forces has columns for them.

    With x from -1 to 1 over the step, the coefficient of degree k from 2 on is (2 k + 1) / 2 times
    the integral of p P_k. Integration by parts reduces the integral to the points inside the step,
    with jumps J of p and K of dp/dx:

        sum of -J I(x) + K II(x)
        I = (P_(k+1) - P_(k-1)) / (2 k + 1)              integral of P_k from -1
        II = (I_(k+1) - I_(k-1)) / (2 k + 1)             integral of I
    """
    count = int(forces[j, rows.POINTS])
    last = t + h - _tolerance(t + h, h)
    k = int(forces[j, rows.NEXT_POINT])
    for column in range(rows.FORCE_COLUMNS, forces.shape[1]):
        forces[j, column] = 0.0
    largest = abs(_before(forces, points, j, k, t) - force_value(forces, j, t))
    while k < count and _time(forces, points, j, k) < last:
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
    return max(largest, abs(_before(forces, points, j, k, t + h) - force_value(forces, j, t + h)))


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
    for i in range(n):
        observer_state[rows.START_FORCE, i] = 0.0
        observer_state[rows.ACCELERATION_JUMP, i] = 0.0
        observer_state[rows.ACCELERATION_DEVIATION, i] = 0.0
        observer_state[rows.DEVIATION_BOUND, i] = 0.0
    is_kinked = has_jumps = False
    power = rate = 0.0
    # Position of the step in the tables with the same times, which usually are those of a file
    position = (0, True, 0.0, 0.0)
    for j in range(forces.shape[0]):
        if forces[j, rows.POINTS] == 0.0:
            continue
        i = int(forces[j, rows.FLOOR])
        old_rate = forces[j, rows.LINE_RATE]
        old_value = forces[j, rows.LINE_VALUE] + old_rate * (t - forces[j, rows.LINE_TIME])
        if forces[j, rows.NEW_TIMES] != 0.0:
            position = _locate_step(forces, points, j, t, h)
        k, is_linear, _, _ = position
        forces[j, rows.NEXT_POINT] = k
        forces[j, rows.LINE_TIME] = t
        if is_linear:
            forces[j, rows.DEVIATION] = 0.0
            value = _copy_line(forces, points, j, position)
        else:
            _fit_line(forces, points, j, t, h)
            value = forces[j, rows.LINE_VALUE]
        observer_state[rows.START_FORCE, i] += value
        jump = value - old_value
        if abs(jump) > _ROUNDING * (abs(value) + abs(old_value)):
            has_jumps = True
            observer_state[rows.ACCELERATION_JUMP, i] += (
                scene.linear_terms[rows.INVERSE_MASS, i] * jump
            )
        velocity = state[rows.VELOCITY, i]
        power += jump * velocity
        rate += (forces[j, rows.LINE_RATE] - old_rate) * velocity
        rate += jump * observer_state[rows.A_PREVIOUS, i]
        if not is_linear and forces[j, rows.DEVIATION] > 0.0:
            is_kinked = True
            inverse_mass = scene.linear_terms[rows.INVERSE_MASS, i]
            last = _points_until(forces, points, j, k, t + h - _tolerance(t + h, h))
            end = _before(forces, points, j, last, t + h) - force_value(forces, j, t + h)
            observer_state[rows.ACCELERATION_DEVIATION, i] += inverse_mass * end
            observer_state[rows.DEVIATION_BOUND, i] += inverse_mass * forces[j, rows.DEVIATION]
    totals[rows.POWER_INPUT] += power
    totals[rows.RATE_INPUT] += rate
    if has_jumps:
        _shift_accelerations(scene, load, shifts, memory, seen, is_kinked)
    return is_kinked


@outlined
def _shift_accelerations(scene, load, shifts, memory, seen, is_kinked):
    """Change the accelerations of the state by row ACCELERATION_JUMP, and the rates of powers that
    depend on them.

    The accelerations after the jump are peaks of the response, except in a kinked step, in which
    they are those of the line (`raise_peaks_in_parts`).
    """
    linear_terms, _, _, forces, _ = scene
    state, observer_state, totals = memory.state, seen.observer_state, seen.totals
    ground = load[rows.GROUND_0]
    below = 0.0  # of the floor below
    for i in range(linear_terms.shape[1] - 1):
        jump = observer_state[rows.ACCELERATION_JUMP, i]
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
        totals[rows.RATE_VISCOUS] += (
            2.0
            * jump
            * (observer_state[rows.VISCOUS_FACTOR, i] + observer_state[rows.MODAL_FORCE, i])
        )
        totals[rows.RATE_DASHPOTS] += (
            2.0
            * observer_state[rows.DASHPOT_FACTOR, i]
            * (jump - linear_terms[rows.LINK, i] * below)
        )
        below = jump
    # START_FORCE contains the tables only. The harmonic forces are first.
    for j in range(forces.shape[0]):
        if forces[j, rows.POINTS] > 0.0:
            break
        totals[rows.RATE_INPUT] += (
            force_value(forces, j, load[rows.TIME])
            * observer_state[rows.ACCELERATION_JUMP, int(forces[j, rows.FLOOR])]
        )


@outlined
def raise_peaks_in_parts(scene, points, span, memory, seen):
    """Raise the peaks of the absolute accelerations, velocities and drift rates in a step in which
    a table is not linear.

    The step is searched in parts between the points of the tables on the floor. In a part, the
    acceleration is the cubic of `peaks_between_steps`, which is valid for the line, plus the
    deviation of the tables from their lines, divided by the mass. The integral of this deviation is
    a deviation of the velocity, which is zero at both endpoints of the step. It changes the forces
    of the dampers and therefore, again, the acceleration: after a jump of a table inside the step,
    by a part that is proportional to the length of the step.
    """
    linear_terms, forces = scene.linear_terms, scene.forces
    passage = Passage(
        seen.observer_state,
        rows.U_PREVIOUS,
        memory.state,
        seen.observer_state,
        rows.OBSERVED_ACCELERATION,
    )
    start, last = span.t - span.h, span.t - _tolerance(span.t, span.h)
    # The tables are in the order of their floors. Rows `first` to `after` - 1 are on floor `i`.
    first = after = 0
    for i in range(linear_terms.shape[1] - 1):
        while first < forces.shape[0] and (
            forces[first, rows.POINTS] == 0.0 or forces[first, rows.FLOOR] < i
        ):
            first += 1
        after = first
        while after < forces.shape[0] and forces[after, rows.FLOOR] == i:
            after += 1
        inverse_mass = linear_terms[rows.INVERSE_MASS, i]
        velocity = damping = 0.0  # deviations of the velocity and of the damping force at `begin`
        begin = start
        while begin < last:
            # The part ends at the next point of a table on the floor, or at the end of the step.
            end = span.t
            for j in range(first, after):
                k = _next_point(forces, points, j, begin, span)
                if k < int(forces[j, rows.POINTS]):
                    time = _time(forces, points, j, k)
                    end = min(end, time) if time < last else end
            deviation_0 = deviation_1 = 0.0
            for j in range(first, after):
                k = _next_point(forces, points, j, begin, span)
                deviation_0 += _before(forces, points, j, k, begin)
                deviation_0 -= force_value(forces, j, begin)
                deviation_1 += _before(forces, points, j, k, end)
                deviation_1 -= force_value(forces, j, end)
            deviation_0 -= damping
            velocity += 0.5 * (end - begin) * inverse_mass * (deviation_0 + damping + deviation_1)
            s = (end - start) / span.h
            damping = 0.0
            if end < span.t:
                damping = raise_velocity_peaks(span, scene, passage, (s, velocity), seen.peaks, i)
            part = (
                (begin - start) / span.h,
                s,
                inverse_mass * deviation_0,
                inverse_mass * (deviation_1 - damping),
            )
            raise_acceleration_in_part(span, passage, part, seen.peaks, i)
            begin = end


@inline
def _next_point(forces, points, j, t, span):
    """Return the number of points of table `j` until time `t` (s) in the step of `span`."""
    tolerance = _tolerance(span.t, span.h)
    return _points_until(forces, points, j, int(forces[j, rows.NEXT_POINT]), t + tolerance)
