"""Peak responses between the endpoints of a time step or substep.

A substep is the part of a step between two located branch changes of the hysteretic laws. This
module searches its interior for the maximum absolute value of displacements, story drifts,
velocities, drift rates, absolute accelerations and total shears. The caller records the values at
the endpoints. The response within a step is represented by the interpolant of
`tdint.kernels.step_interpolant`.

The force of a power-law dashpot with an exponent below 1 is nearly discontinuous at rest, and no
cubic. In a step where the motion of such a dashpot stops, and near this step, its force is
separated from the quantity: the force follows from the cubic Hermite interpolant of the drift rate,
and the rest of the quantity is a parabola (`_raise_peak_near_rest`).

Search criteria
---------------
Only steps that may exceed a recorded peak are searched. The observer
(`tdint.kernels.time_loop.observer`) checks this for all floors by `may_exceed_floor_peaks`,
`may_exceed_story_peaks`, `may_exceed_velocity_peak` and `may_exceed_acceleration_peak`, which
contain no branches. The interior is then searched if

    displacement, drift       the velocity or drift rate changes its sign
    velocity, drift rate      the acceleration changes its sign

and if a Bezier point of the quantity exceeds the recorded peak. A polynomial does not exceed its
Bezier points, so every extremum above the peak is searched. With V = max(|v0|, |v1|), the bounds
that contain no branches use V / 2: this also covers the middle Bezier point (u0 + u1) / 2 - h (v1 -
v0) / 4 of the parabola of methods with parabolic displacements. The Bezier points of the quintic
are

    u0,  u0 + h v0 / 5,  u0 + 2 h v0 / 5 + h^2 a0 / 20,  u1 - 2 h v1 / 5 + h^2 a1 / 20,
    u1 - h v1 / 5,  u1

Two extrema of a displacement or velocity within a step, without a change of the sign of its rate
over the step, are not searched. If the velocity at the start is exactly zero, as in the first step
from rest, the extremum of the displacement at the start is recorded, and the interior of the step
is not searched.

A story force is searched only at reversals of the drift. If a law reaches its strength and softens
within a step without a reversal, the method must locate the branch change. Otherwise the peak
shear is the largest value at the endpoints of the steps.

Unresolved motion
-----------------
An interior maximum is unreliable in three cases:

1. Displacement, drift: |v1 - v0 - h (a0 + a1) / 2| is large compared with the velocities, so the
   endpoint accelerations do not explain the change of velocity.
2. Velocity, drift rate, acceleration, shear: the interior Bezier points of the acceleration deviate
   from the straight line by more than the sum of the absolute endpoint values.
3. All quantities: the building has modes that the time step does not resolve, and the values at the
   endpoints of two successive steps are far from a straight line.

The maximum is then recorded as a possible peak, PEAK_ROWS rows after the row of the peak
(`tdint.kernels.layout`). For displacements and drifts, it is the maximum of the cubic Hermite
interpolant of u0, v0, u1 and v1. `row`, `peak_row` and `i` are the row and column of the regular
peak. If the method defines a parabola for the displacements within a step, the extremum of
the parabola is recorded as a regular peak instead.

References
----------
Farin, G. (2002). Curves and Surfaces for CAGD, 5th ed.: convex hull property.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.laws.selection import elements_of
from tdint.kernels.linear_terms import (
    base_of,
    below_next,
    force_value,
    has_dashpot,
    has_inerters,
    hermite_rate,
    is_tree,
    power_damper,
)
from tdint.kernels.step_interpolant import (
    acceleration_bulge,
    acceleration_tilt,
    bulge_and_tilt,
    cubic_extremum,
    is_near_line,
    max_interior_bezier_point,
    quintic_coefficients,
    quintic_extremum,
    quintic_motion,
    resolves_motion,
    tilt_weight,
)
from tdint.kernels.stepping import Ends, Passage
from tdint.kernels.stories.brace import instant_of_largest_sum
from tdint.kernels.stories.law_state import has_fractured

# Dimensionless. Maximum of |v1 - v0 - h (a0 + a1) / 2| / (|v0| + |v1|): above this ratio the
# endpoint accelerations do not explain the change of velocity, and the quintic is not used.
_MAX_VELOCITY_MISMATCH = 0.5

# Number of points before and after the rest of a dashpot. The smallest distance from the rest is
# 6e-4 of the part of the step.
_POINTS_NEAR_REST = 12
_BISECTIONS = 40
_TWO_THIRDS = 2.0 / 3.0
_ROOT_TOLERANCE = 1e-12  # fraction of the step; largest last correction of a zero
# Dimensionless. Ratio of the drift rates at both endpoints below which the force of a dashpot with
# an exponent below 1 is not smooth enough for the cubic of the accelerations.
_RATE_NEAR_REST = 0.2


class _NearRest(NamedTuple):
    """Power-law dashpot with an exponent below 1 that comes to rest in a step or near it.

    Attributes
    ----------
    factor : float
        Factor of its force in the searched quantity; 0 for no dashpot.
    story : int
        Story of the dashpot.
    rest : float
        Time of the smallest absolute drift rate, as a fraction of the step.
    largest : float
        Upper limit of the absolute force in the step, N.
    ends : Ends
        Motion of the story.
    """

    factor: float
    story: int
    rest: float
    largest: float
    ends: Ends


ZERO_ENDS = Ends(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum over no floors, above the roof
_NOT_NEAR_REST = _NearRest(0.0, 0, 0.0, 0.0, ZERO_ENDS)
ZERO_FORCES = (0.0, 0.0, 0.0, 0.0)  # N; result of `add_floor_forces` without forces on floors


@inline
def raise_peak(peaks, row, i, value):
    """Raise a recorded peak (maximum absolute value) to the absolute value of a response, if it is
    larger.
    """
    size = abs(value)
    if size > peaks[row, i]:
        peaks[row, i] = size


@inline
def keep_corner(scratch, peaks, i, acceleration, t):
    """Keep the acceleration of floor `i` at a corner within a step (m/s^2) and its time (s), if it
    is the largest of the step.
    """
    corner = peaks + 2 * rows.PEAK_ROWS
    if abs(acceleration) > abs(scratch[corner, i]):
        scratch[corner, i], scratch[corner + 1, i] = acceleration, t


@inline
def may_exceed_floor_peaks(h, by_h, floor, peaks, i):
    """Return True if a displacement or velocity of a floor may exceed its recorded peak in a step.

    The bounds apply to the interior and to the end of the step. The function has no branches,
    because the observer calls it for each floor in each step. At the start of a run, the observer
    passes h = 0 and by_h = 0 (1 / h elsewhere).
    """
    v_max = max(abs(floor.v0), abs(floor.v1))
    a_max = max(abs(floor.a0), abs(floor.a1))
    max_displacement = max(abs(floor.u0), abs(floor.u1)) + h * (0.5 * v_max + 0.05 * h * a_max)
    exceeds = max_displacement > peaks[rows.PEAK_DISPLACEMENT, i]
    return exceeds | (velocity_reach(h, by_h, floor) > peaks[rows.PEAK_VELOCITY, i])


@inline
def velocity_reach(h, by_h, ends):
    """Return an upper bound of the absolute velocity or drift rate within a step, m/s."""
    v_max = max(abs(ends.v0), abs(ends.v1))
    a_max = max(abs(ends.a0), abs(ends.a1))
    return max(v_max + 0.25 * h * a_max, abs(_middle_velocity_bezier_point(h, by_h, ends)))


@inline
def limit_stiffness(linear_terms, law_parameters, i):
    """Return an upper limit of the tangent stiffness of story `i`, N/m, for the search of shears.

    It is the initial stiffness, or a practically infinite value if the story can be stiffer than
    initially. A symmetric elastic story has its initial stiffness as limit in any case: its peak
    shear occurs at its peak drift, which is searched separately.
    """
    return law_parameters[rows.STIFFNESS, i] + linear_terms[rows.STIFFENING, i]


@inline
def story_reach(span, story, shear, stiffness):
    """Return upper bounds of the absolute drift (m) and shear (N) of a story within a step.

    The effect of the drift acceleration at the end of the step is not included: the caller computes
    it later, and `may_exceed_story_peaks` adds it. `shear` is the restoring force at the end of the
    step, `stiffness` the result of `limit_stiffness`.

    The bound of the shear covers a reversal within the step, and assumes that the force changes by
    at most `stiffness` times the distance of the drifts between the reversal and the end of the
    step. For an unsymmetric story that can stiffen, this limit is practically infinite, so that
    each reversal is searched. The bound does not cover a force that rises and softens within the
    step without a reversal.
    """
    v_max = max(abs(story.v0), abs(story.v1))
    excess = span.h * (0.5 * v_max + 0.05 * span.h * abs(story.a0))
    # The drift may reverse if its rates have opposite signs or if the method defines parabolic
    # displacements. Otherwise the shear cannot exceed its value at the end of the step. `excursion`
    # is a bound of the distance of the drift from its value at the end, m.
    excursion = abs(story.u1 - story.u0) + excess
    excursion = excursion if span.on_path or story.v0 * story.v1 < 0.0 else 0.0
    return max(abs(story.u0), abs(story.u1)) + excess, abs(shear) + stiffness * excursion


@inline
def may_exceed_story_peaks(reach, excess, law_parameters, peaks, i):
    """Return True if a drift or shear may exceed its recorded peak in a step.

    `reach` is the result of `story_reach`. `excess` is the effect of the drift acceleration at the
    end of the step on the bound of the drift, m: h^2 / 20 times its absolute value. The initial
    stiffness converts it to a force. If the story can be stiffer, the bound of the shear is
    already practically infinite for each reversal.
    """
    max_drift, max_shear = reach
    exceeds = max_drift + excess > peaks[rows.PEAK_DRIFT, i]
    stiffness = law_parameters[rows.STIFFNESS, i]
    return exceeds | (max_shear + stiffness * excess > peaks[rows.PEAK_SHEAR, i])


@inline
def _displacement_excursion(span, ends):
    """Return an upper bound of the distance of a displacement or drift from u1 within a step, m.

    The bound is valid for all three polynomials of `_raise_displacement_peak`. The Bezier points of
    the cubic, u0 + h v0 / 3 and u1 - h v1 / 3, are covered by the Bezier points of the quintic.
    """
    change = abs(ends.u1 - ends.u0)
    from_start = change + _excess_at_end(span.h, ends.v0, ends.a0)
    from_end = _excess_at_end(span.h, ends.v1, ends.a1)
    on_parabola = 0.5 * change + 0.25 * span.h * abs(ends.v1 - ends.v0)
    return max(from_start, from_end, on_parabola)


@inline
def _excess_at_end(h, v, a):
    """Return an upper bound of the distance of the two Bezier points of the quintic next to an
    endpoint of a step from the displacement at this endpoint, m.
    """
    return h * (0.4 * abs(v) + 0.05 * h * abs(a))


@inline
def may_exceed_velocity_peak(h, by_h, ends, peak):
    """Return True if a velocity or drift rate may exceed its recorded peak in a step or at its end.

    Two changes of the sign of the acceleration within a step, which a step that resolves the motion
    does not have, are not considered.
    """
    exceeds = (ends.a0 * ends.a1 < 0.0) & (_max_velocity_bezier_point(h, by_h, ends) > peak)
    return (abs(ends.v1) > peak) | exceeds


@inline
def _max_velocity_bezier_point(h, by_h, ends):
    """Return the largest absolute value of the interior Bezier points of the velocity, m/s."""
    point_1 = ends.v0 + 0.25 * h * ends.a0
    point_3 = ends.v1 - 0.25 * h * ends.a1
    return max(abs(point_1), abs(point_3), abs(_middle_velocity_bezier_point(h, by_h, ends)))


@inline
def _middle_velocity_bezier_point(h, by_h, ends):
    """Return the middle one of the five Bezier points of the velocity within a step, m/s.

    The other four points are v0, v0 + h a0 / 4, v1 - h a1 / 4 and v1. The mean of all five is the
    mean velocity (u1 - u0) / h.
    """
    sum_of_points = 5.0 * by_h * (ends.u1 - ends.u0)
    return sum_of_points - 2.0 * (ends.v0 + ends.v1) + 0.25 * h * (ends.a1 - ends.a0)


@inline
def may_exceed_acceleration_peak(absolute_0, absolute_1, bulge, peak):
    """Return True if an absolute acceleration or total shear may exceed its recorded peak in a
    step.

    The interior Bezier points are (2 A0 + A1 + B + D) / 3 and (A0 + 2 A1 + B - D) / 3, with the
    absolute accelerations A0 and A1 at the endpoints. The bound covers every tilt, so D is not an
    argument: in all cases w (|B| + |D|) is at most 2 |B|. A Bezier point is therefore within 2 |B|
    / 3 of the straight line between A0 and A1.
    """
    return max(abs(absolute_0), abs(absolute_1)) + _TWO_THIRDS * abs(bulge) > peak


@outlined
def _raise_rate_peaks(span, linear_terms, passage, law_state, peaks, first_peak):
    """Raise the peaks of the drift rates of stories with dashpots by their extrema in the step.

    A separate loop, because the loop over the stories of all buildings does not need it.
    """
    row = first_peak + rows.PEAK_DRIFT_RATE
    for i in range(linear_terms.shape[1] - 1):
        if has_dashpot(linear_terms, i):
            story = ends_of_story(span.fast, linear_terms, passage, law_state, i)
            if story.a0 * story.a1 < 0.0 and may_exceed_velocity_peak(
                span.h, 1.0 / span.h, story, peaks[row, i]
            ):
                _raise_velocity_peak(span, story, peaks, row, i)


@outlined
def find_interstep_peaks(span, scene, passage, law_state, located):
    """Raise the peaks of all floors and stories by the response inside a step or substep; return
    the number of stored reversals and instants.

    For the total shear of a story, the sum of m (a + ag) - p over the floors that the story
    supports is searched, with mass m, absolute acceleration a + ag and force p of each floor. The
    total shear is minus this sum; the sign has no effect on the peak.

    The forces inside the step depend on the hysteretic laws, so this function does not compute
    them. Row REVERSAL_DRIFT of `located` is set to the extreme drift inside the step if that drift
    may cause a new peak drift or peak shear, and to the drift at the end of the step otherwise.
    Rows ACCELERATION_INSTANT and TOTAL_SHEAR_INSTANT are set to the locations of extrema that may
    be peaks. The caller evaluates the laws there (`tdint.kernels.located_peaks`). In a linear
    building, the extrema of the interpolant are the peaks.

    In a kinked step, `raise_peaks_in_part` searches velocities, drift rates and absolute
    accelerations, and total shears, except near the rest of a dashpot. In a step of a method with
    corners (`span.cornered`), the method has searched velocities and drift rates.

    The length of the step must not be zero.
    """
    linear_terms = scene.linear_terms
    table, first, peaks, first_peak = located
    by_h = 1.0 / span.h
    has_dashpots = scene.flags[rows.HAS_DASHPOTS] != 0.0
    # A method that has computed peaks within the step has searched the velocities at its corners.
    searched_in_parts = span.kinked != span.cornered
    located_count = 0
    if scene.flags[rows.CAN_FRACTURE] > 0.0:
        located_count += has_fractured(scene.law_parameters, law_state)
    if has_dashpots and not searched_in_parts:
        _raise_rate_peaks(span, linear_terms, passage, law_state, peaks, first_peak)
    n = linear_terms.shape[1] - 1
    # Sums over the floors from the roof down to floor i: mass times motion, mass, forces on floors
    inertia, mass_sum = ZERO_ENDS, 0.0
    floor_forces = ZERO_FORCES
    next_row = scene.forces.shape[0]
    near_rest_above = _NOT_NEAR_REST
    floor = floor_ends(span.fast, passage, n - 1)
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = n
    while i > 0:
        i -= 1
        # The link of story 0 is 0, so floor 0 is passed without effect.
        if FULL and is_tree(linear_terms):
            floor = floor_ends(span.fast, passage, i)
        floor_below = floor_ends(span.fast, passage, base_of(linear_terms, i))
        story = story_ends(floor, floor_below, linear_terms[rows.LINK, i], law_state[rows.DRIFT, i])
        table[first + rows.REVERSAL_DRIFT, i] = story.u1
        table[first + rows.ACCELERATION_INSTANT, i] = 0.0
        table[first + rows.TOTAL_SHEAR_INSTANT, i] = 0.0
        if _has_extremum(span, story):
            stiffness = limit_stiffness(linear_terms, scene.law_parameters, i)
            # `drift_margin` (m) and `shear_margin` (N) are the differences of the recorded peaks
            # and the absolute values at the end of the step. `drift_excursion` and `stiffness`
            # times `drift_excursion` limit the distances of drift and shear from these values.
            drift_margin = peaks[first_peak + rows.PEAK_DRIFT, i] - abs(story.u1)
            shear_margin = peaks[first_peak + rows.PEAK_SHEAR, i] - abs(law_state[rows.FORCE, i])
            if FULL and scene.law_parameters[rows.CODE, i] <= rows.ELEMENTS:
                shear_margin = _margin_of_elements(
                    scene.law_parameters, law_state, i, stiffness, shear_margin
                )
            drift_excursion = _displacement_excursion(span, story)
            if drift_excursion > drift_margin or stiffness * drift_excursion > shear_margin:
                # A drift at most `margin` away from its value at the end causes no new peak.
                margin = drift_margin
                if not FULL or stiffness > 0.0:  # a link can have no spring
                    margin = min(drift_margin, shear_margin / stiffness)
                row = first_peak + rows.PEAK_DRIFT
                reversal = _raise_displacement_peak(span, story, margin, peaks, row, i)
                # `reversal` is u1 if there is no reliable extremum that may exceed the margin.
                if reversal != story.u1:
                    table[first + rows.REVERSAL_DRIFT, i] = reversal
                    located_count += 1
        margin = peaks[first_peak + rows.PEAK_DISPLACEMENT, i] - abs(floor.u1)
        if _has_extremum(span, floor) and _displacement_excursion(span, floor) > margin:
            row = first_peak + rows.PEAK_DISPLACEMENT
            _raise_displacement_peak(span, floor, margin, peaks, row, i)
        velocity_peak = peaks[first_peak + rows.PEAK_VELOCITY, i]
        if (
            not searched_in_parts
            and floor.a0 * floor.a1 < 0.0
            and may_exceed_velocity_peak(span.h, by_h, floor, velocity_peak)
        ):
            _raise_velocity_peak(span, floor, peaks, first_peak + rows.PEAK_VELOCITY, i)
        # The second value of a quantity is the factor of the ground acceleration: 1 for a floor,
        # the mass of all floors above the story for the shear.
        if not span.cornered:
            near_rest = _NOT_NEAR_REST
            if FULL and has_inerters(linear_terms):
                row = first_peak + rows.PEAK_INERTER_FORCE
                _raise_inerter_peak(span, by_h, linear_terms, floor, story, peaks, row, i)
            elif FULL and has_dashpots and is_near_rest(linear_terms, i, story.v0, story.v1):
                near_rest = _dashpot_near_rest(span.h, linear_terms, i, story)
            row = first_peak + rows.PEAK_ACCELERATION
            if not span.kinked:
                # Floor `i` is between this story and the story above.
                factor = linear_terms[rows.INVERSE_MASS, i]
                link_above = linear_terms[rows.LINK, i + 1]
                if below_next(linear_terms, i) != i:
                    link_above = 0.0  # the next column is not above this floor
                dashpots = (
                    _times(-factor, near_rest),
                    _times(factor * link_above, near_rest_above),
                )
                quantity = floor, 1.0, ZERO_FORCES
                targets = peaks, row, table, first + rows.ACCELERATION_INSTANT
                located_count += _raise_absolute_peak(
                    span, by_h, quantity, dashpots, scene, targets, i
                )
            if FULL and is_tree(linear_terms):
                inertia, mass_sum = add_tree_inertia(
                    linear_terms, span, passage, i, floor, inertia, mass_sum
                )
            else:
                inertia, mass_sum = add_floor_inertia(linear_terms, i, floor, inertia, mass_sum)
            if FULL and scene.forces.shape[0] > 0:
                link = linear_terms[rows.LINK, i + 1]  # 1 if there is a story on floor `i`
                floor_forces, next_row = add_floor_forces(
                    span, scene.forces, link, i, floor_forces, next_row
                )
            if not span.kinked or near_rest.factor != 0.0:
                row = first_peak + rows.PEAK_TOTAL_SHEAR
                dashpots = _times(-1.0, near_rest), _NOT_NEAR_REST
                quantity = inertia, mass_sum, floor_forces
                targets = peaks, row, table, first + rows.TOTAL_SHEAR_INSTANT
                located_count += _raise_absolute_peak(
                    span, by_h, quantity, dashpots, scene, targets, i
                )
                if FULL and linear_terms[rows.BRACED_RELIEF, i] > 0.0:
                    located_count += _locate_relief(
                        span.h, scene, passage, law_state, story, located, i
                    )
            near_rest_above = near_rest
        floor = floor_below
    return located_count


@outlined
def _locate_relief(h, scene, passage, law_state, story, located, i):
    """Replace the instant of the largest total shear of story `i` by the instant of its spring,
    with the initial stiffness, and its damper with a relief force.

    Returns 1 if the row had no instant and has one now, otherwise 0.
    """
    linear_terms, table = scene.linear_terms, located.table
    row = located.first + rows.TOTAL_SHEAR_INSTANT
    stiffness = scene.law_parameters[rows.STIFFNESS, i]
    spring = law_state[rows.FORCE, i] - stiffness * (story.u1 - story.u0), stiffness
    ends = story.u0, story.v0, story.u1, story.v1
    s = instant_of_largest_sum(linear_terms, i, h, ends, passage.state[rows.BRACE_START, i], spring)
    if s == 0.0:
        return 0
    is_new = table[row, i] == 0.0
    table[row, i] = s
    return 1 if is_new else 0


@inline
def element_force(law_state, i, element):
    """Return the force of an element of story `i` in the committed state, N.

    The element can be at an earlier drift of its linear branch (`layout.ELEMENTS`).
    """
    force = law_state[rows.FORCE, element]
    step = law_state[rows.DRIFT, i] - law_state[rows.DRIFT, element]
    if step != 0.0:
        force += law_state[rows.SLOPE, element] * step
    return force


@outlined
def _margin_of_elements(law_parameters, law_state, i, stiffness, margin):
    """Return the margin of the shear of story `i` that also respects the peaks of its elements, N.

    A change of drift exceeds the result divided by `stiffness` if it exceeds the `margin` of the
    story or the margin of an element divided by the initial stiffness of the element.
    """
    for element in elements_of(law_parameters, i):
        element_stiffness = law_parameters[rows.STIFFNESS, element]
        if element_stiffness > 0.0:
            force = element_force(law_state, i, element)
            rest = law_state[rows.PEAK_FORCE, element] - abs(force)
            margin = min(margin, max(rest, 0.0) * stiffness / element_stiffness)
    return margin


@inline
def observed_passage(state, observer_state):
    """Return the response of all floors at both endpoints of the last observed step."""
    return Passage(
        observer_state, rows.U_PREVIOUS, state, observer_state, rows.OBSERVED_ACCELERATION
    )


@inline
def floor_ends(has_unresolved_modes, passage, i):
    """Return the motion of floor `i` at both endpoints of a step, relative to the ground.

    Without unresolved modes, `passage.old` contains no values of the previous step; the fields
    `v_earlier` and `a_earlier` are then not used.
    """
    old, first, state, accelerations, new = passage
    v0 = old[first + 1, i]
    a0 = old[first + 2, i]
    u1, v1, a1 = state[rows.DISPLACEMENT, i], state[rows.VELOCITY, i], accelerations[new, i]
    v_earlier = old[first + 3, i] if has_unresolved_modes else v0
    a_earlier = old[first + 4, i] if has_unresolved_modes else a0
    return Ends(old[first, i], v0, a0, u1, v1, a1, v_earlier, a_earlier)


@inline
def story_ends(floor, floor_below, link, drift):
    """Return drift (m), drift rate and drift acceleration of a story at both endpoints of a step.

    The drift at the end is not the difference of the displacements of the floors, but the value in
    the state of the hysteretic law (`drift`).
    """
    u0, v0, a0, _, v1, a1, v_earlier, a_earlier = _sum_of_ends(1.0, floor, -link, floor_below)
    return Ends(u0, v0, a0, drift, v1, a1, v_earlier, a_earlier)


@inline
def ends_of_story(has_unresolved_modes, linear_terms, passage, law_state, i):
    """Return the values of `story_ends` for story `i`."""
    floor = floor_ends(has_unresolved_modes, passage, i)
    floor_below = floor_ends(has_unresolved_modes, passage, base_of(linear_terms, i))
    return story_ends(floor, floor_below, linear_terms[rows.LINK, i], law_state[rows.DRIFT, i])


@outlined
def _raise_inerter_peak(span, by_h, linear_terms, floor, story, peaks, row, i):
    """Raise the peak of the force of an inerter by the extremum of its cubic in the step."""
    ends = _sum_of_ends(
        linear_terms[rows.STORY_INERTANCE, i], story, linear_terms[rows.FLOOR_INERTANCE, i], floor
    )
    bulge, tilt = acceleration_bulge(by_h, ends), acceleration_tilt(by_h, ends)
    weight = tilt_weight(bulge, tilt)
    if weight > 0.0:
        cubic = ends.a0, ends.a1, weight * bulge, weight * tilt
        _raise_peak_of_cubic(span, ends, cubic, peaks, row, i, False)


@inline
def _sum_of_ends(factor, ends, other_factor, other_ends):
    """Return the sum of two motions, each with a factor."""
    return Ends(
        u0=factor * ends.u0 + other_factor * other_ends.u0,
        v0=factor * ends.v0 + other_factor * other_ends.v0,
        a0=factor * ends.a0 + other_factor * other_ends.a0,
        u1=factor * ends.u1 + other_factor * other_ends.u1,
        v1=factor * ends.v1 + other_factor * other_ends.v1,
        a1=factor * ends.a1 + other_factor * other_ends.a1,
        v_earlier=factor * ends.v_earlier + other_factor * other_ends.v_earlier,
        a_earlier=factor * ends.a_earlier + other_factor * other_ends.a_earlier,
    )


@inline
def add_floor_inertia(linear_terms, i, floor, inertia_above, mass_above):
    """Add mass times motion of floor `i` to the sums over the floors above.

    The floors above are excluded if the story above is supported by the ground instead of floor `i`
    (link 0). For the roof, column `i + 1` is the last column; its LINK has no effect, because the
    sums above the roof are zero.
    """
    link, mass = linear_terms[rows.LINK, i + 1], linear_terms[rows.MASS, i]
    return _sum_of_ends(link, inertia_above, mass, floor), link * mass_above + mass


@outlined
def add_tree_inertia(linear_terms, span, passage, i, floor, inertia_above, mass_above):
    """Add mass times motion of floor `i` and its attachments to the sums over the floors above."""
    if base_of(linear_terms, i + 1) != i:
        inertia_above, mass_above = ZERO_ENDS, 0.0
    ends, mass_sum = add_floor_inertia(linear_terms, i, floor, inertia_above, mass_above)
    j = int(linear_terms[rows.FIRST_ON, i])
    while j > 0:
        mass = linear_terms[rows.MASS, j]
        if j != i + 1 and mass > 0.0:
            ends = _sum_of_ends(1.0, ends, mass, floor_ends(span.fast, passage, j))
            mass_sum += mass
        j = int(linear_terms[rows.NEXT_ON, j])
    return ends, mass_sum


@inline
def _has_extremum(span, ends):
    """Return True if a displacement or drift has an extremum inside the step.

    The comparison of signs misses extrema in two cases:

    - The displacement has two extrema within the step, so that v0 and v1 have the same sign.
    - v0 is zero. The extremum at the start of the step has already been recorded. A further
      extremum within the step is missed.

    Both cases require a motion that the time step does not resolve. The only exception is the first
    step from rest (v0 = 0), if the ground motion changes its sign in this step.
    """
    has_vertex = 2.0 * abs(ends.u1 - ends.u0) < span.h * abs(ends.v1 - ends.v0)
    return (span.on_path & has_vertex) | (ends.v0 * ends.v1 < 0.0)


@inline
def explains_velocities(h, ends):
    """Return True if the accelerations at both ends explain the change of velocity."""
    velocity_mismatch = abs(ends.v1 - ends.v0 - 0.5 * h * (ends.a0 + ends.a1))
    return velocity_mismatch <= _MAX_VELOCITY_MISMATCH * (abs(ends.v0) + abs(ends.v1))


@outlined
def _raise_displacement_peak(span, ends, margin, peaks, row, i):
    """Raise the peak of a displacement or drift by its extremum inside the step; return the
    extremum, m.

    The result is u1 if there is no extremum inside the step that was compared with the regular
    peak. The displacement is interpolated in one of three ways:

    1. The step resolves the motion: by the quintic.
    2. The step does not resolve the motion, and the method defines parabolic displacements
       (`span.on_path`): by the parabola u0 + (u1 - u0) s + h (v1 - v0) (s^2 - s) / 2.
    3. The step does not resolve the motion, other methods: by the cubic with u0, v0, u1 and v1. Its
       extremum is a possible peak.

    `margin` is the recorded peak minus |u1|, m. For a drift, the caller reduces it if a smaller
    distance from u1 can cause a new peak shear. In cases 1 and 3, the extremum is ignored if the
    Bezier points show that its distance from u1 does not exceed `margin`.
    """
    h = span.h
    u0, v0, a0, u1, v1, a1, _, _ = ends
    is_resolved = resolves_motion(span, ends) and explains_velocities(h, ends)
    if span.on_path and not is_resolved:
        # The extremum is at s = 1/2 - rise / curvature, inside the step if |rise / curvature| <
        # 1/2.
        rise = u1 - u0
        curvature = h * (v1 - v0)
        if 2.0 * abs(rise) >= abs(curvature):
            return u1
        s = 0.5 - rise / curvature
        extremum = u0 + s * (rise + 0.5 * curvature * (s - 1.0))
        raise_peak(peaks, row, i, extremum)
        return extremum
    if v0 * v1 >= 0.0:
        return u1
    # The extremum is a maximum for v0 > 0, otherwise a minimum (`direction` 1 or -1). `excess_0` is
    # the largest distance from u0, in the direction of the extremum, of the Bezier points of
    # quintic and cubic near the start; `excess_1` is this distance from u1 for the points near the
    # end. The points with h v / 5 are omitted, because the points with h v / 3 (cubic) are farther
    # away. `start_offset` is the distance of u0 from u1 in this direction.
    direction = math.copysign(1.0, v0)
    start_offset = direction * (u0 - u1)
    excess_0 = max(h * abs(v0) / 3.0, 0.4 * h * abs(v0) + 0.05 * h * h * direction * a0)
    excess_1 = max(h * abs(v1) / 3.0, 0.4 * h * abs(v1) + 0.05 * h * h * direction * a1)
    if max(start_offset + excess_0, excess_1) <= margin:
        return u1
    if not is_resolved:
        # Coefficients of the cubic u0 + h v0 s + c2 s^2 + c3 s^3
        rise = u1 - u0
        c2 = 3.0 * rise - h * (2.0 * v0 + v1)
        extremum, _ = cubic_extremum(u0, h * v0, c2, rise - h * v0 - c2)
        raise_peak(peaks, row + rows.PEAK_ROWS, i, extremum)
        return u1
    c3, c4, c5 = quintic_coefficients(h, ends)
    # The first estimate is the zero of the straight line between v0 and v1.
    extremum = quintic_extremum(v0 / (v0 - v1), (u0, h * v0, 0.5 * h * h * a0, c3, c4, c5))
    raise_peak(peaks, row, i, extremum)
    return extremum


@outlined
def _raise_velocity_peak(span, ends, peaks, peak_row, i):
    """Raise the peak of a velocity or drift rate by its extremum inside the step.

    a0 and a1 must have opposite signs, so that the velocity, the derivative of the quintic, has an
    extremum.
    """
    h = span.h
    _, v0, a0, _, _, a1, _, _ = ends
    c3, c4, c5 = quintic_coefficients(h, ends)
    bulge, tilt = bulge_and_tilt(h, ends)
    is_resolved = resolves_motion(span, ends) and is_near_line(bulge, tilt, abs(a0) + abs(a1))
    row = peak_row + (0 if is_resolved else rows.PEAK_ROWS)
    if _max_velocity_bezier_point(h, 1.0 / h, ends) > peaks[row, i]:
        # Coefficients of 1, s, ..., s^5 in the velocity, which is of degree 4. The first estimate
        # of the extremum is the zero of the straight line between a0 and a1.
        velocity = (v0, h * a0, 3.0 * c3 / h, 4.0 * c4 / h, 5.0 * c5 / h, 0.0)
        raise_peak(peaks, row, i, quintic_extremum(a0 / (a0 - a1), velocity))


@inline
def _raise_absolute_peak(span, by_h, quantity, dashpots, scene, targets, i):
    """Raise the peak of an absolute acceleration or of a total shear by an extremum inside the
    step: near the rest of `dashpots`, if a dashpot has a force at that point, otherwise of a cubic.

    For a total shear, `quantity` contains the sum of mass times motion over the floors that the
    story supports (`ends`), the sum of their masses (kg; 1 for a single floor), and the result of
    `add_floor_forces`. As the ground acceleration is linear within the step, it does not change
    bulge and tilt. `targets` are the peaks, the row of the quantity, and the table and the row for
    the location of an extremum at which the laws must be evaluated. Return the number of stored
    locations.
    """
    peaks, peak_row, table, instants = targets
    if FULL and (dashpots[0].factor != 0.0 or dashpots[1].factor != 0.0):
        _raise_peak_near_rest(span, quantity, dashpots, scene, peaks, peak_row, i)
        return 0
    ends, mass, forces = quantity
    absolute_0 = ends.a0 + mass * span.ground_0 - forces[0]
    absolute_1 = ends.a1 + mass * span.ground_1 - forces[1]
    bulge = acceleration_bulge(by_h, ends) - forces[2]
    count = 0
    if may_exceed_acceleration_peak(absolute_0, absolute_1, bulge, peaks[peak_row, i]):
        # The forces have the same weight as the motion: a cubic with the complete tilt of the
        # forces, but not of the accelerations that they cause, would have a too large extremum.
        tilt = acceleration_tilt(by_h, ends) - forces[3]
        weight = tilt_weight(bulge, tilt)
        if weight > 0.0:
            cubic = absolute_0, absolute_1, weight * bulge, weight * tilt
            is_located = scene.flags[rows.LINEAR] == 0.0
            s = _raise_peak_of_cubic(span, ends, cubic, peaks, peak_row, i, is_located)
            if s > 0.0:
                table[instants, i] = s
                count = 1
    return count


@outlined
def _raise_peak_of_cubic(span, ends, cubic, peaks, peak_row, i, is_located):
    """Raise a peak by the extremum of a cubic inside the step, or return the location of the
    extremum if `is_located` (0 without such an extremum).

    `cubic` contains the values at both endpoints, and bulge and tilt times their weight.
    """
    absolute_0, absolute_1, bulge, tilt = cubic
    peak = peaks[peak_row, i]
    if max_interior_bezier_point(absolute_0, absolute_1, bulge, tilt) <= peak:
        return 0.0
    scale = abs(absolute_0) + abs(absolute_1)
    is_resolved = resolves_motion(span, ends) and is_near_line(bulge, tilt, scale)
    row = peak_row + (0 if is_resolved else rows.PEAK_ROWS)
    # Coefficients of A0 + (A1 - A0) s + s (1 - s) (B + D (1 - 2 s)) in powers of s
    c1 = absolute_1 - absolute_0 + bulge + tilt
    extremum, s = cubic_extremum(absolute_0, c1, -bulge - 3.0 * tilt, 2.0 * tilt)
    if is_resolved and is_located:
        return s if abs(extremum) > peak else 0.0
    raise_peak(peaks, row, i, extremum)
    return 0.0


@inline
def is_near_rest(linear_terms, i, v0, v1):
    """Return True if a dashpot with an exponent below 1 comes to rest in a step or near it.

    The force of such a dashpot is nearly discontinuous at rest. `v0` and `v1` are the drift rates
    at both endpoints, m/s.
    """
    is_near = (v0 * v1 < 0.0) | (min(abs(v0), abs(v1)) < _RATE_NEAR_REST * max(abs(v0), abs(v1)))
    return (linear_terms[rows.POWER, i] < 0.0) & is_near


@outlined
def _dashpot_near_rest(h, linear_terms, i, story):
    """Return the dashpot of a story that comes to rest in a step or near it (`_NearRest`)."""
    if story.v0 * story.v1 < 0.0:
        rest = zero_of_rate(h, story)
    else:
        rest = 0.0 if abs(story.v0) < abs(story.v1) else 1.0
    # The Bezier points of the rate at 1/3 and 2/3 of the step, and the endpoints, limit the rate.
    rate = max(abs(story.v0), abs(story.v1))
    rate = max(rate, abs(story.v0 + h * story.a0 / 3.0), abs(story.v1 - h * story.a1 / 3.0))
    largest = abs(power_damper(linear_terms, i, rate)[0])
    return _NearRest(1.0, i, rest, largest, story)


@inline
def _times(factor, dashpot):
    """Return a dashpot near rest with its force times a further factor."""
    own, story, rest, largest, ends = dashpot
    return _NearRest(factor * own, story, rest, largest, ends)


@inline
def zero_of_rate(h, story):
    """Return the zero of the drift rate in a step as a fraction of the step: by Newton's method,
    with a bisection where it would leave the interval that contains the zero.
    """
    lower, upper = 0.0, 1.0
    change = story.v1 - story.v0
    # Coefficients of the rate v0 + c1 s + c2 s^2 + c3 s^3 (`hermite_rate`)
    c1 = h * story.a0
    c2 = 3.0 * change - h * (2.0 * story.a0 + story.a1)
    c3 = h * (story.a0 + story.a1) - 2.0 * change
    s = -story.v0 / change
    for _ in range(_BISECTIONS):
        rate = story.v0 + s * (c1 + s * (c2 + s * c3))
        if rate * story.v0 > 0.0:
            lower = s
        else:
            upper = s
        slope = c1 + s * (2.0 * c2 + s * 3.0 * c3)
        correction = rate / slope if slope != 0.0 else math.inf
        before, s = s, s - correction
        if not lower <= s <= upper:
            s = 0.5 * (lower + upper)
        if abs(s - before) < _ROOT_TOLERANCE:
            break
    return s


@outlined
def instant_before(h, story, drift):
    """Return the last instant before a story reaches a drift in a step, by bisection, as a fraction
    of the step."""
    side = math.copysign(1.0, drift)
    lower, upper = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (lower + upper)
        if side * (quintic_motion(h, story, middle)[0] - drift) < 0.0:
            lower = middle
        else:
            upper = middle
    return lower


@inline
def _forces_near_rest(h, linear_terms, dashpots, s):
    """Return the sum of the forces of two dashpots at `s` times their factors, N."""
    force = 0.0
    for dashpot in dashpots:
        if dashpot.factor != 0.0:
            rate = hermite_rate(h, dashpot.ends, s)
            force += dashpot.factor * power_damper(linear_terms, dashpot.story, rate)[0]
    return force


@outlined
def _raise_peak_near_rest(span, quantity, dashpots, scene, peaks, peak_row, i):
    """Raise the peak of an absolute acceleration or total shear near the rest of dashpots.

    The force F of a dashpot with an exponent below 1 falls steeply to zero when the motion of its
    story stops. The story force has its maximum at the same time. Their sum has its maximum shortly
    before the rest, which a cubic through the endpoints of the step does not show, whatever the
    length of the step. The quantity without the forces of both `dashpots` is

        S0 + (S1 - S0) s + s (1 - s) B

    B follows from the mean of the quantity, which is the change of velocity, and from the mean of
    the forces. The mean is computed by the rule of the method (`Family.mean_rule`): at a rest, the
    rule has a large error, but so has the change of velocity. The sum is evaluated at
    points that are dense near the rests, and on the parabolas through three of these points. The
    other arguments are the same as for `_raise_absolute_peak`.
    """
    h = span.h
    linear_terms = scene.linear_terms
    ends, mass, forces = quantity
    absolute_0 = ends.a0 + mass * span.ground_0 - forces[0]
    absolute_1 = ends.a1 + mass * span.ground_1 - forces[1]
    smooth_0 = absolute_0 - _forces_near_rest(h, linear_terms, dashpots, 0.0)
    smooth_1 = absolute_1 - _forces_near_rest(h, linear_terms, dashpots, 1.0)
    largest = abs(dashpots[0].factor) * dashpots[0].largest
    largest += abs(dashpots[1].factor) * dashpots[1].largest
    # Six times the mean of the quantity minus the straight line of its smooth part
    bulge = 3.0 * (absolute_0 + absolute_1) - 3.0 * (smooth_0 + smooth_1)
    bulge += acceleration_bulge(1.0 / h, ends) - forces[2]
    line = max(abs(smooth_0), abs(smooth_1))
    # The parabola is at most B / 4; the mean of the forces changes B by at most 6 of them.
    if line + 0.25 * abs(bulge) + 2.5 * largest <= peaks[peak_row, i]:
        return
    weight, distance = scene.flags[rows.MEAN_WEIGHT], scene.flags[rows.MEAN_DISTANCE]
    mean = (1.0 - 2.0 * weight) * _forces_near_rest(h, linear_terms, dashpots, 0.5)
    mean += weight * _forces_near_rest(h, linear_terms, dashpots, 0.5 - distance)
    mean += weight * _forces_near_rest(h, linear_terms, dashpots, 0.5 + distance)
    bulge -= 6.0 * mean
    is_resolved = resolves_motion(span, ends) and is_near_line(
        bulge, 0.0, abs(smooth_0) + abs(smooth_1)
    )
    row = peak_row + (0 if is_resolved else rows.PEAK_ROWS)
    for dashpot in dashpots:
        for side in range(2):
            length = -dashpot.rest if side == 0 else 1.0 - dashpot.rest
            if length == 0.0 or dashpot.factor == 0.0:
                continue
            # Values at three successive points; the last value is `value`.
            earlier = previous = absolute_0 if side == 0 else absolute_1
            for k in range(_POINTS_NEAR_REST - 1, -1, -1):
                x = k / _POINTS_NEAR_REST
                s = dashpot.rest + length * x * x * x
                value = smooth_0 + (smooth_1 - smooth_0) * s + s * (1.0 - s) * bulge
                value += _forces_near_rest(h, linear_terms, dashpots, s)
                raise_peak(peaks, row, i, value)
                linear, quadratic = 0.5 * (value - earlier), 0.5 * (value + earlier) - previous
                if k < _POINTS_NEAR_REST - 1 and abs(linear) < 2.0 * abs(quadratic):
                    raise_peak(peaks, row, i, previous - 0.25 * linear * linear / quadratic)
                earlier, previous = previous, value


@outlined
def add_floor_forces(span, forces, link, i, sums_above, next_row):
    """Add the forces on floor `i` to the sums over the floors above.

    A force is a known function of time. With s from 0 to 1 over the step, its deviation from the
    straight line between its endpoint values is represented as s (1 - s) (bulge + tilt (1 - 2 s)).
    It is matched at s = 1/4 and s = 3/4, where it is 3/16 (bulge + tilt / 2) and 3/16 (bulge - tilt
    / 2).

    `sums_above` is the result of the function for floor `i + 1`. `next_row` is the first row of the
    tables on floors above. The tables are in the order of their floors.

    Returns
    -------
    tuple of float
        Sum of the forces at the start and at the end of the step, its bulge and its tilt, N.
    int
        First row of the tables on this floor and on floors above.
    """
    t, h = span.t, span.h
    sum_0 = link * sums_above[0]
    sum_1 = link * sums_above[1]
    bulge = link * sums_above[2]
    tilt = link * sums_above[3]
    # Tables are straight lines within the step.
    while (
        next_row > 0
        and forces[next_row - 1, rows.POINTS] > 0.0
        and forces[next_row - 1, rows.FLOOR] >= i
    ):
        next_row -= 1
        sum_0 += force_value(forces, next_row, t - h)
        sum_1 += force_value(forces, next_row, t)
    # Harmonic forces precede the tables.
    for j in range(forces.shape[0]):
        if forces[j, rows.POINTS] > 0.0:
            break
        if forces[j, rows.FLOOR] == i:
            force_0 = force_value(forces, j, t - h)
            force_1 = force_value(forces, j, t)
            # `early` and `late` are the deviations at s = 1/4 and s = 3/4, N.
            early = force_value(forces, j, t - 0.75 * h) - 0.75 * force_0 - 0.25 * force_1
            late = force_value(forces, j, t - 0.25 * h) - 0.25 * force_0 - 0.75 * force_1
            sum_0 += force_0
            sum_1 += force_1
            bulge += 8.0 / 3.0 * (early + late)
            tilt += 16.0 / 3.0 * (early - late)
    return (sum_0, sum_1, bulge, tilt), next_row
