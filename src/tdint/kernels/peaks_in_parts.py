"""Peak responses within the parts of a kinked step, in which a table of forces is not linear.

`tdint.kernels.time_loop.force_tables` divides such a step at the points of the tables. The response
in a part is the interpolant of the step (`tdint.kernels.step_interpolant`) plus deviations.
"""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.linear_terms import (
    base_of,
    below_next,
    damping_change,
    has_dashpot,
    is_tree,
    tie,
)
from tdint.kernels.peaks_between_steps import (
    ZERO_ENDS,
    ZERO_FORCES,
    add_floor_forces,
    add_floor_inertia,
    add_tree_inertia,
    floor_ends,
    is_near_rest,
    raise_peak,
    story_ends,
)
from tdint.kernels.step_interpolant import (
    bulge_and_tilt,
    cubic_extremum,
    is_near_line,
    quintic_extremum,
    resolves_motion,
    tilt_weight,
)

# Dimensionless. Bound of the rounding errors of bulge and tilt, divided by the sum of the absolute
# values of their terms (times 60 at most). The displacements of a sum or difference of floors have
# rounding errors a thousand times as large as that of the sum.
_TILT_ROUNDING = 60.0 * 1e3 * 2.2e-16


@outlined
def raise_peaks_in_part(span, scene, passage, law_state, part, seen):
    """Raise the peaks of velocities, drift rates, absolute accelerations and total shears in a part
    of a kinked step.

    `part` contains the endpoints of the part as fractions of the step. Between them, the tables of
    forces are linear. The rows LOAD_DEVIATION, VELOCITY_DEVIATION and MODAL_DEVIATION of the memory
    of the observer, and the rows after them, contain the deviations from the response under the
    lines of the tables at both endpoints. The deviations of the forces of the dampers follow from
    the deviations of the velocities. They do not include dampers with braces, because the forces of
    these dampers do not depend directly on the drift rate. The rows VELOCITY_BULGE and MODAL_BULGE
    are the same for all parts.

    If the kernel of the method has computed peaks (`span.cornered`), the extrema of velocities and
    total shears inside the part are not searched.
    """
    linear_terms, _, _, forces, flags = scene
    observer_state, peaks = seen.observer_state, seen.peaks
    n = linear_terms.shape[1] - 1
    has_dashpots = flags[rows.HAS_DASHPOTS] != 0.0
    inertia, mass_sum = ZERO_ENDS, 0.0
    floor_forces = ZERO_FORCES
    next_row = forces.shape[0]
    # Results of `damping_change`, N: for the story above, and for the sum of the damping forces on
    # the floors that the story supports
    above, floors = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    for row in range(3):
        tie(linear_terms, observer_state, rows.VELOCITY_DEVIATION + row)
    floor = floor_ends(span.fast, passage, n - 1)
    for i in range(n - 1, -1, -1):
        base = base_of(linear_terms, i)
        if FULL and is_tree(linear_terms):
            floor = floor_ends(span.fast, passage, i)
        floor_below = floor_ends(span.fast, passage, base)
        link, link_above = linear_terms[rows.LINK, i], linear_terms[rows.LINK, i + 1]
        if below_next(linear_terms, i) != i:
            link_above = 0.0  # the next column is not above this floor
        story = story_ends(floor, floor_below, link, law_state[rows.DRIFT, i])
        inverse_mass = linear_terms[rows.INVERSE_MASS, i]
        floor_rates = _floor_deviation(linear_terms, observer_state, i)
        below = _floor_deviation(linear_terms, observer_state, base)
        story_rates = (
            floor_rates[0] - link * below[0],
            floor_rates[1] - link * below[1],
            floor_rates[2] - link * below[2],
            floor_rates[3] - link * below[3],
            floor_rates[4] - link * below[4],
        )
        row = rows.PEAK_VELOCITY
        _raise_velocity_in_part(span, floor, part, floor_rates, peaks, row, i)
        if has_dashpots and has_dashpot(linear_terms, i):
            row = rows.PEAK_DRIFT_RATE
            _raise_velocity_in_part(span, story, part, story_rates, peaks, row, i)
        changes = damping_change(span.h, scene, law_state, story, part, story_rates, i)
        damper = linear_terms[rows.FLOOR_DAMPER, i]
        own = (
            damper * floor_rates[0] + observer_state[rows.MODAL_DEVIATION, i],
            damper * floor_rates[1] + observer_state[rows.MODAL_DEVIATION + 1, i],
            damper * floor_rates[4] + observer_state[rows.MODAL_DEVIATION + 2, i],
            damper * observer_state[rows.VELOCITY_BULGE, i] + observer_state[rows.MODAL_BULGE, i],
        )
        deviations = (
            floor_rates[2] - inverse_mass * (own[0] + changes[0] - link_above * above[0]),
            floor_rates[3] - inverse_mass * (own[1] + changes[1] - link_above * above[1]),
            -inverse_mass * (own[2] + changes[2] - link_above * above[2]),
            -inverse_mass * (own[3] + changes[3] - link_above * above[3]),
        )
        quantity = floor, 1.0, ZERO_FORCES
        row = rows.PEAK_ACCELERATION
        _raise_absolute_peak_in_part(span, quantity, part, deviations, peaks, row, i)
        # The searched sum is minus the total shear (`find_interstep_peaks`).
        floors = (
            link_above * floors[0] + own[0],
            link_above * floors[1] + own[1],
            link_above * floors[2] + own[2],
            link_above * floors[3] + own[3],
        )
        if FULL and is_tree(linear_terms):
            inertia, mass_sum = add_tree_inertia(
                linear_terms, span, passage, i, floor, inertia, mass_sum
            )
        else:
            inertia, mass_sum = add_floor_inertia(linear_terms, i, floor, inertia, mass_sum)
        floor_forces, next_row = add_floor_forces(
            span, forces, link_above, i, floor_forces, next_row
        )
        is_at_rest = FULL and has_dashpots and is_near_rest(linear_terms, i, story.v0, story.v1)
        if not (span.cornered or is_at_rest):
            deviations = (
                -floors[0] - changes[0],
                -floors[1] - changes[1],
                -floors[2] - changes[2],
                -floors[3] - changes[3],
            )
            quantity = inertia, mass_sum, floor_forces
            row = rows.PEAK_TOTAL_SHEAR
            _raise_absolute_peak_in_part(span, quantity, part, deviations, peaks, row, i)
        above = changes
        floor = floor_below


@inline
def _floor_deviation(linear_terms, observer_state, i):
    """Return the deviations of the velocity of floor `i` (m/s) at both endpoints of a part, those
    of the forces of tables divided by the mass (m/s^2), and the bulge of the first (m/s).
    """
    inverse_mass = linear_terms[rows.INVERSE_MASS, i]
    return (
        observer_state[rows.VELOCITY_DEVIATION, i],
        observer_state[rows.VELOCITY_DEVIATION + 1, i],
        inverse_mass * observer_state[rows.LOAD_DEVIATION, i],
        inverse_mass * observer_state[rows.LOAD_DEVIATION + 1, i],
        observer_state[rows.VELOCITY_DEVIATION + 2, i],
    )


@outlined
def _raise_velocity_in_part(span, ends, part, deviation, peaks, peak_row, i):
    """Raise the peak of a velocity or drift rate in a part of a kinked step.

    The velocity is the derivative of the quintic with the weight w of the tilt D, plus a deviation
    with the values `deviation[0]` and `deviation[1]` (m/s) and the derivatives `deviation[2]` and
    `deviation[3]` (m/s^2) at the endpoints of the part. The derivative of the deviation is linear
    in the part. The derivative of the quintic is the cubic Hermite interpolant of the velocity plus
    h D s^2 (1 - s)^2 / 2.
    """
    h = span.h
    s, length = part[0], part[1] - part[0]
    _, v0, a0, _, v1, a1, _, _ = ends
    bulge, tilt = bulge_and_tilt(h, ends)
    # Coefficients of the velocity in powers of s, then of x, from 0 to 1 in the part, including the
    # deviation
    tilt *= tilt_weight(bulge, tilt)
    c4 = 0.5 * h * tilt
    c1, c2 = h * a0, 3.0 * (v1 - v0) - h * (2.0 * a0 + a1) + c4
    c3 = h * (a0 + a1) - 2.0 * (v1 - v0) - 2.0 * c4
    p0 = v0 + s * (c1 + s * (c2 + s * (c3 + s * c4))) + deviation[0]
    p1 = length * (c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * 4.0 * c4)) + h * deviation[2])
    p2 = length * length * (c2 + s * (3.0 * c3 + s * 6.0 * c4))
    p2 += 0.5 * h * length * (deviation[3] - deviation[2])
    p3 = length * length * length * (c3 + s * 4.0 * c4)
    p4 = length * length * length * length * c4
    is_resolved = resolves_motion(span, ends) and is_near_line(bulge, tilt, abs(a0) + abs(a1))
    row = peak_row + (0 if is_resolved else rows.PEAK_ROWS)
    # The caller records the end of the step.
    if part[1] < 1.0:
        raise_peak(peaks, row, i, p0 + p1 + p2 + p3 + p4)
    slope = p1 + 2.0 * p2 + 3.0 * p3 + 4.0 * p4
    if p1 * slope < 0.0 and not span.cornered:
        velocity = (p0, p1, p2, p3, p4, 0.0)
        raise_peak(peaks, row, i, quintic_extremum(p1 / (p1 - slope), velocity))


@outlined
def _raise_absolute_peak_in_part(span, quantity, part, deviations, peaks, row, i):
    """Raise the peak of an absolute acceleration or of a total shear in a part of a kinked step.

    The quantity is the cubic of `_raise_peak_of_cubic`, plus a deviation, a parabola in the
    part: `deviations` contains its values at the endpoints and its bulge. If the tilt of the step
    is not reliable, neither is the bulge of a second-order method. The last element of
    `deviations`, the bulge of the forces of the dampers, replaces it: after a jump inside the step,
    it is proportional to the length of the step, the remaining bulge to its square.

    If the step does not resolve the motion, the straight line between the endpoint values of the
    step replaces the cubic; otherwise, the extremum of the cubic is a possible peak. `quantity`
    contains the motion, mass and forces as in `_raise_absolute_peak`.
    """
    s_0, s_1 = part
    deviation_0, deviation_1, part_bulge, damping_bulge = deviations
    ends, mass, forces = quantity
    absolute_0 = ends.a0 + mass * span.ground_0 - forces[0]
    absolute_1 = ends.a1 + mass * span.ground_1 - forces[1]
    bulge, tilt = bulge_and_tilt(span.h, ends)
    bulge, tilt = bulge - forces[2], tilt - forces[3]
    weight = tilt_weight(bulge, tilt)
    # With linear accelerations of the method, both are rounding errors, and so is their
    # ratio.
    u0, v0, a0, u1, v1, a1, _, _ = ends
    terms = ((abs(u0) + abs(u1)) / span.h + abs(v0) + abs(v1)) / span.h + abs(a0) + abs(a1)
    excess = abs(bulge) + abs(tilt) - _TILT_ROUNDING * terms
    if excess < _TILT_ROUNDING * terms:
        weight *= max(excess / (_TILT_ROUNDING * terms), 0.0)
    bulge = weight * bulge + (1.0 - weight) * damping_bulge
    tilt *= weight
    # Coefficients of the cubic in powers of s, then of x, from 0 to 1 in the part, including the
    # deviation
    length = s_1 - s_0
    c1 = absolute_1 - absolute_0 + bulge + tilt
    c2, c3 = -bulge - 3.0 * tilt, 2.0 * tilt
    p0 = absolute_0 + s_0 * (c1 + s_0 * (c2 + s_0 * c3)) + deviation_0
    p1 = length * (c1 + s_0 * (2.0 * c2 + 3.0 * s_0 * c3)) + deviation_1 - deviation_0
    p1 += part_bulge
    p2 = length * length * (c2 + 3.0 * s_0 * c3) - part_bulge
    p3 = length * length * length * c3
    scale = abs(absolute_0) + abs(absolute_1) + abs(deviation_0) + abs(deviation_1)
    if not (resolves_motion(span, ends) and is_near_line(bulge, tilt, scale)):
        rise = absolute_1 - absolute_0
        raise_peak(peaks, row, i, absolute_0 + rise * s_0 + deviation_0)
        raise_peak(peaks, row, i, absolute_0 + rise * s_1 + deviation_1)
        row += rows.PEAK_ROWS
    raise_peak(peaks, row, i, cubic_extremum(p0, p1, p2, p3)[0])
    raise_peak(peaks, row, i, p0 + p1 + p2 + p3)
