"""Peaks within a step of `moment4` during which stories change their branches or reverse.

A branch change or a reversal is a corner: the rate of the story force is discontinuous, and so is
the rate of the accelerations. The quintic interpolant between the endpoints of the step
(`tdint.kernels.peaks_between_steps`) does not represent corners. Here the times of the corners and
the story forces follow from the paths of the stories (`tdint.kernels.stories.path`), and the
accelerations follow from equilibrium at nodes: the endpoints of the step, the corners, and the
midpoints between them. Times t are fractions of the step, from 0 to 1. The displacements of floors
and the drifts of stories are parabolas in the step, d0 + rise t + bend (t^2 - t) / 2.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.equations.moment4 import MAX_CORNERS, ROW, R
from tdint.kernels.laws.selection import HAS_ELEMENTS
from tdint.kernels.linear_terms import (
    BRACES,
    FORCES,
    TANGENT_DAMPING,
    add_modal_force,
    force_value,
    power_damper,
)
from tdint.kernels.peaks_between_steps import raise_peak, raise_peak_at_nodes
from tdint.kernels.stepping import Integrals, PathSegment
from tdint.kernels.stories import path
from tdint.kernels.stories.brace import brace_force_within

# Bound of the deviation of a story force from its linear least-squares fit over the step, divided
# by stiffness times change of drift. It is reached if the story loses all stiffness at the middle
# of the step. The accelerations A0 + A1 s of the step correspond to the linear fit.
_FORCE_DEVIATION = 0.125
# Number of passes of the fixed-point iteration for the accelerations at the nodes. After the second
# pass, the error is below the error of the step.
_PASSES = 2
# Fraction of the step. Corners with a smaller distance from each other or from an endpoint are
# regarded as a single corner.
_MIN_DISTANCE = 1e-6


@inline
def _story_value(linear_terms, scratch, row, i):
    """Return the difference between floor `i` and the floor below for a row of floor values.

    For displacements, it is the drift of story `i`. A story on the ground (LINK 0) has no floor
    below, and the value of floor `i` is returned.
    """
    return scratch[row, i] - linear_terms[rows.LINK, i] * scratch[row, max(i - 1, 0)]


@inline
def _story_path(linear_terms, law_state, scratch, i):
    """Return the parabola of drift of story `i` over the complete step.

    d(t) = d0 + rise t + bend (t^2 - t) / 2, with t from 0 to 1. d0 is the committed drift, rise and
    bend are differences of the rows RISE and BEND of the floors, all in m.
    """
    rise = _story_value(linear_terms, scratch, ROW.RISE, i)
    bend = _story_value(linear_terms, scratch, ROW.BEND, i)
    return PathSegment(law_state[rows.DRIFT, i], rise, bend, 0.0, 1.0)


# ---- Path of a story


@inline
def _skip_branch(law_state, i, block, segment, results):
    """Skip a branch; `path.along_branches` calls this function for each branch on a path.

    Its counterpart `path._add_on_branch` integrates the force along the branch. Here only the times
    and states at the ends of the branches are needed. No argument is used.
    """
    pass


@inline
def _ignore_branch_end(results, i, t, force):
    """Ignore the end of a branch; `path.along_branches` calls this function if a limit is reached.

    `_store_forces` uses this function, because it needs only the state at the end of the path. No
    argument is used.

    `force` is the restoring force of the story at this time, N.
    """
    pass


@inline
def _store_corner(results, i, t, force):
    """Insert the time of a corner into the sorted list of corners, and update the peak shear.

    A corner is a branch change or a reversal of a story. The list is in column 0 of the scratch
    rows CORNERS: the number of corners, then their times in ascending order. A corner is not
    inserted if its distance from an endpoint of the step is at most _MIN_DISTANCE, or if the list
    already contains MAX_CORNERS corners. The peak shear of the story is raised in any case.

    `t` is the time of the corner as a fraction of the step, between 0 and 1. `force` is the force
    of the story at the corner, N.
    """
    scratch, first = results
    raise_peak(scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, force)
    count = int(scratch[first, 0])
    if _MIN_DISTANCE < t < 1.0 - _MIN_DISTANCE and count < MAX_CORNERS:
        # Move all later corners to the next row. The new corner is number `position` + 1.
        position = count
        while position > 0 and scratch[first + position, 0] > t:
            scratch[first + position + 1, 0] = scratch[first + position, 0]
            position -= 1
        scratch[first + position + 1, 0] = t
        scratch[first, 0] = count + 1.0


_follow_path_storing_corners = path.along_branches(_skip_branch, _store_corner)
_follow_path = path.along_branches(_skip_branch, _ignore_branch_end)


@inline
def _direction(segment, no_reversal):
    """Return the direction of the movement of a story along a part of its path: 1, -1 or 0.

    The drift is d(t) = start + rise t + bend (t^2 - t) / 2, with t from 0 to 1 over the step. The
    direction is the sign of the change of drift; it is 0 if the drift does not change.

    `no_reversal` is True if the story has no reversal in the step; the direction is then the sign
    of the rise, the change of drift over the complete step.
    """
    drift_change = (
        segment.rise
        if no_reversal
        else path.drift_at(segment, segment.end) - path.drift_at(segment, segment.begin)
    )
    return math.copysign(1.0, drift_change) if drift_change != 0.0 else 0.0


@outlined
def _find_corners(law_parameters, law_state, i, complete, no_reversal, corners):
    """Find the corners of story `i` in the step: its branch changes and its reversal.

    The law follows the parabola of drift d0 + rise t + bend (t^2 - t) / 2, with t from 0 to 1, in
    the trial state SECOND_TRIAL: first to the reversal (or to the end of the step, if there is no
    reversal), then from the reversal to the end. The committed state is not changed. At each
    corner, `_store_corner` stores the time in the list of corners and raises the peak of the story
    force.

    `no_reversal` is True if the story has no reversal in the step. An extremum of the parabola is
    ignored in this case, because the parabola only approximates the drift.

    Parameters
    ----------
    corners : Integrals
        Scratch array and the first of its rows CORNERS. Column 0 of these rows contains the list of
        corners: their number, then their times. The peak force of the story is in the rows PEAKS of
        the same array.
    """
    path.copy(law_state, i, 0, rows.SECOND_TRIAL)  # start from the committed state (block 0)
    # Time of the extremum of the parabola; 1 if there is no extremum within the step
    reversal_time = 1.0 if no_reversal else path.time_of_extremum(complete)
    part_before = path.path_segment(complete, 0.0, reversal_time)
    end_drift = path.drift_at(complete, reversal_time)
    # `_direction` returns the sign of the change of drift over the part. If `no_reversal` is True,
    # the part is the complete step, and the law moves in this direction only.
    _follow_path_storing_corners(
        law_parameters,
        law_state,
        i,
        rows.SECOND_TRIAL,
        part_before,
        _direction(part_before, no_reversal),
        end_drift,
        corners,
    )
    if reversal_time < 1.0:
        _store_corner(corners, i, reversal_time, law_state[rows.SECOND_TRIAL + rows.FORCE, i])
        # The parabola reverses at this time, so the argument `no_reversal` of `_direction` is
        # False.
        part_after = path.path_segment(complete, reversal_time, 1.0)
        end_drift = path.drift_at(complete, 1.0)
        _follow_path_storing_corners(
            law_parameters,
            law_state,
            i,
            rows.SECOND_TRIAL,
            part_after,
            _direction(part_after, False),
            end_drift,
            corners,
        )


@outlined
def _find_corners_of_elements(scene, memory, i):
    """Find the corners of the piecewise-linear elements of story `i`; raise their peak forces."""
    law_parameters = scene.law_parameters
    _, law_state, scratch, _ = memory
    complete = _story_path(scene.linear_terms, law_state, scratch, i)
    no_reversal = scratch[ROW.NO_REVERSAL, i] != 0.0
    corners = Integrals(scratch, ROW.CORNERS)
    for element in range(
        int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
    ):
        if path.is_piecewise_linear(law_parameters, element):
            _find_corners(law_parameters, law_state, element, complete, no_reversal, corners)
            law_state[rows.PEAK_FORCE, element] = max(
                law_state[rows.PEAK_FORCE, element],
                scratch[ROW.PEAKS + rows.PEAK_SHEAR, element],
            )


@outlined
def _store_nodes(scratch, n):
    """Compute the times of the nodes and return their number.

    The nodes are the endpoints of the step, the corners (rows CORNERS), and the midpoints between
    them. A corner is omitted if its distance from the last node is at most _MIN_DISTANCE. The end
    of the step is never omitted: all corners that `_store_corner` has stored are more than
    _MIN_DISTANCE before the end. The times, as fractions of the step, are stored in the last column
    (n, the number of floors) of the rows NODE_FORCE.

    Returns
    -------
    int
        Number of nodes: 1 + 2 (number of corners + 1), without omitted corners.
    """
    scratch[ROW.NODE_FORCE, n] = 0.0
    count = 1
    # Column 0 of the rows CORNERS contains the number of corners, then their times in ascending
    # order. For each corner and for the end of the step, a midpoint and the corner are added.
    corners = int(scratch[ROW.CORNERS, 0])
    for k in range(corners + 1):
        # `t` is the time of the next corner, or 1 for the end of the step.
        previous = scratch[ROW.NODE_FORCE + count - 1, n]
        t = scratch[ROW.CORNERS + 1 + k, 0] if k < corners else 1.0
        if t - previous > _MIN_DISTANCE:
            scratch[ROW.NODE_FORCE + count, n] = 0.5 * (previous + t)
            scratch[ROW.NODE_FORCE + count + 1, n] = t
            count += 2
    return count


@outlined
def _store_forces(coefficients, scene, h, memory, i, count):
    """Compute the force of story `i` at all nodes, including P-delta and without dampers, N.

    The nodes k are times within the step. They are stored as fractions t of the step in column n
    (the number of floors) of the rows NODE_FORCE:

        k even    start of the step, corners, end of the step. A corner is the time of a branch
                  change or reversal of any story
        k odd     midpoint between the nodes k - 1 and k + 1

    There are two approximations of the drift at a node:

        d       d0 plus the difference of row NODE_DISPLACEMENT + k between both floors; this row
                contains the changes of the displacements since the start of the step
        p(t)    parabola of the step, d0 + rise t + bend (t^2 - t) / 2

    d0 is the drift and f0 the force of the law at the start of the step. The drift d is more
    accurate than p(t); the force is computed for d. The formula depends on the type of the story:

    1. The story remains on its linear branch of stiffness k (row LEAVES_BRANCH is 0):

           f0 + k (d - d0)

    2. The story leaves a linear branch. The law follows the parabola p(t) from node to node. Its
       force f_p at p(t) is corrected with the tangent stiffness `slope` of the branch (N/m):

           f_p + slope (d - p(t))

    3. The law is curved. The law is not evaluated. The force is a parabola
       in s = t - 1/2 with the initial value f0 and with the mean F0 and the first moment F1 of the
       law over the step:

           F0 + s F1 + (6 s^2 - 1/2) (f0 - F0 + F1 / 2)

       F0 and F1 are the rows PATH without P-delta, dampers and numerical dissipation.

    In type 2, the branches before and after a corner have different slopes. The force at a corner
    (even k) is first computed with the slope before the corner, which the preceding midpoint has
    determined. If d is ahead of p(t) in the direction of the movement, the story has already passed
    the corner, and the slope after the corner is correct. The next midpoint, k + 1, determines this
    slope. In this case, it adds (slope after - slope before) (d - p(t)) to the force at the corner.

    Parameters
    ----------
    memory : Memory
        Law states and scratch array. Rows PATH contain the mean int f dt and the first moment
        12 int s f dt of the story force f over the step, N. They include P-delta and dampers; the
        first moment also includes the numerical dissipation of the method (`_evaluate_stories`).
        Column i of the rows NODE_FORCE receives the forces; the trial state SECOND_TRIAL of the law
        is overwritten. The list of corners and the peaks do not change.
    """
    law_parameters, scratch = scene.law_parameters, memory.scratch
    if (
        HAS_ELEMENTS
        and law_parameters[rows.CODE, i] <= rows.ELEMENTS
        and scratch[ROW.LEAVES_BRANCH, i] != 0.0
    ):
        for element in range(
            int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
        ):
            _store_law_forces(coefficients, scene, h, memory, i, element, count)
        _store_sums(scene, memory, i, count)
    else:
        _store_law_forces(coefficients, scene, h, memory, i, i, count)


@outlined
def _store_law_forces(coefficients, scene, h, memory, i, column, count):
    """Compute the force of the law in `column`, story `i` or one of its elements, at all nodes; see
    `_store_forces`. The force of an element excludes P-delta.
    """
    _, law_state, scratch, _ = memory
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    story_path = _story_path(linear_terms, law_state, scratch, i)
    # The rows PATH of an element contain its restoring force only.
    is_element = HAS_ELEMENTS and column != i
    geometric = 0.0 if is_element else linear_terms[rows.GEOMETRIC, i]
    leaves_branch = scratch[ROW.LEAVES_BRANCH, i] != 0.0
    is_curved = leaves_branch and not path.is_piecewise_linear(scene.law_parameters, column)
    mean = moment = 0.0
    if is_curved and is_element:
        mean = scratch[ROW.PATH + path.MEAN, column]
        moment = scratch[ROW.PATH + path.MOMENT, column]
    elif is_curved:
        # `mean` and `moment` are F0 and F1 of the law. P-delta, dampers and the numerical
        # dissipation r (k + g) bend, which the rows PATH include, are subtracted here.
        mean = scratch[ROW.PATH + path.MEAN, i] - geometric * (
            story_path.start + 0.5 * story_path.rise - story_path.bend / 12.0
        )
        mean -= linear_terms[rows.STORY_DAMPER, i] / h * story_path.rise + scratch[ROW.DASHPOT, i]
        moment = scratch[ROW.PATH + path.MOMENT, i] - geometric * story_path.rise
        moment -= (
            linear_terms[rows.STORY_DAMPER, i] / h * story_path.bend + scratch[ROW.DASHPOT + 1, i]
        )
        stiffness = scene.law_parameters[rows.STIFFNESS, i] + geometric
        moment -= coefficients[R] * stiffness * story_path.bend
    elif leaves_branch:
        path.copy(law_state, column, 0, rows.SECOND_TRIAL)
    previous_t = previous_distance = previous_direction = 0.0
    slope = law_state[rows.SLOPE, column]
    for k in range(count):
        t = scratch[ROW.NODE_FORCE + k, n]
        s = t - 0.5
        drift = story_path.start + _story_value(linear_terms, scratch, ROW.NODE_DISPLACEMENT + k, i)
        force = law_state[rows.FORCE, column]  # force at the start of the step, N
        if is_curved:
            force = mean + s * moment + (6.0 * s * s - 0.5) * (force - mean + 0.5 * moment)
        elif not leaves_branch:
            force += law_state[rows.SLOPE, column] * (drift - story_path.start)
        elif t > 0.0:
            segment = path.path_segment(story_path, previous_t, t)
            direction = _direction(segment, scratch[ROW.NO_REVERSAL, i] != 0.0)
            end_drift = path.drift_at(story_path, t)
            # Move the law to this node. The last argument is required, but not used:
            # `_follow_path` does not change the list of corners.
            _follow_path(
                scene.law_parameters,
                law_state,
                column,
                rows.SECOND_TRIAL,
                segment,
                direction,
                end_drift,
                Integrals(scratch, ROW.CORNERS),
            )
            # `distance` is d - p(t): drift of the node minus the drift at which the law was
            # evaluated.
            distance = drift - law_state[rows.SECOND_TRIAL + rows.DRIFT, column]
            # An odd `k` is a midpoint between two corners, with an unambiguous slope. At an even
            # `k`, a corner, the slope of the midpoint before the corner is kept.
            if k % 2 == 1:
                slope_before = slope
                slope = law_state[rows.SECOND_TRIAL + rows.SLOPE, column]
                if previous_distance * direction > 0.0 and previous_direction * direction > 0.0:
                    # Correct the force at the corner, node k - 1, where the story does not reverse.
                    # Its drift exceeds the drift of the parabola by `previous_distance` in the
                    # direction of the movement. This part of the drift was multiplied by the slope
                    # before the corner, but requires the slope after the corner.
                    scratch[ROW.NODE_FORCE + k - 1, column] += (
                        slope - slope_before
                    ) * previous_distance
            force = law_state[rows.SECOND_TRIAL + rows.FORCE, column] + slope * distance
            previous_distance = distance
            previous_direction = direction
            previous_t = t
        scratch[ROW.NODE_FORCE + k, column] = force + geometric * drift


@outlined
def _store_sums(scene, memory, i, count):
    """Store the force of story `i` at all nodes as the sum over its elements, with P-delta, N."""
    _, law_state, scratch, _ = memory
    for k in range(count):
        force = 0.0
        for element in range(
            int(scene.law_parameters[rows.FIRST_ELEMENT, i]),
            int(scene.law_parameters[rows.END_ELEMENT, i]),
        ):
            force += scratch[ROW.NODE_FORCE + k, element]
        drift = law_state[rows.DRIFT, i] + _story_value(
            scene.linear_terms, scratch, ROW.NODE_DISPLACEMENT + k, i
        )
        scratch[ROW.NODE_FORCE + k, i] = force + scene.linear_terms[rows.GEOMETRIC, i] * drift


@outlined
def _raise_peaks_of_sums(scene, memory, count):
    """Raise the peak shears of stories with piecewise-linear elements by their forces at the nodes.

    The peak force of an element is raised at its own corners. The sum can have its peak at a corner
    of another element.
    """
    law_parameters, scratch = scene.law_parameters, memory.scratch
    for i in range(scene.linear_terms.shape[1] - 1):
        if (
            law_parameters[rows.CODE, i] <= rows.ELEMENTS
            and scratch[ROW.LEAVES_BRANCH, i] != 0.0
            and path.is_piecewise_linear(law_parameters, i)
        ):
            for k in range(1, count):
                drift = memory.law_state[rows.DRIFT, i] + _story_value(
                    scene.linear_terms, scratch, ROW.NODE_DISPLACEMENT + k, i
                )
                force = (
                    scratch[ROW.NODE_FORCE + k, i] - scene.linear_terms[rows.GEOMETRIC, i] * drift
                )
                raise_peak(scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, force)


@outlined
def _add_tangent_damping(scene, h, memory, count):
    """Add the forces of tangent damping to the story forces at all nodes, N.

    The tangent stiffness at a node is the slope of the force since the previous node; at a corner,
    this is the slope before the corner.
    """
    linear_terms, scratch = scene.linear_terms, memory.scratch
    for i in range(linear_terms.shape[1] - 1):
        coefficient = linear_terms[rows.TANGENT_DAMPING, i]
        if coefficient != 0.0:
            for k in range(count - 1, 0, -1):
                node = ROW.NODE_DISPLACEMENT + k
                drift_change = _story_value(linear_terms, scratch, node, i)
                drift_change -= _story_value(linear_terms, scratch, node - 1, i)
                force_change = (
                    scratch[ROW.NODE_FORCE + k, i]
                    - scratch[ROW.NODE_FORCE + k - 1, i]
                    - linear_terms[rows.GEOMETRIC, i] * drift_change
                )
                rate = _story_value(linear_terms, scratch, ROW.NODE_VELOCITY + k, i) / h
                if drift_change != 0.0:
                    scratch[ROW.NODE_FORCE + k, i] += (
                        coefficient * force_change / drift_change * rate
                    )
            scratch[ROW.NODE_FORCE, i] += memory.state[rows.DAMPING_FORCE, i]


@outlined
def _add_brace_forces(scene, h, memory, count):
    """Add the forces of dampers with braces to the story forces at all nodes, N."""
    linear_terms, scratch = scene.linear_terms, memory.scratch
    n = linear_terms.shape[1] - 1
    for i in range(n):
        if linear_terms[rows.BRACE, i] != 0.0:
            force_0 = memory.state[rows.BRACE_FORCE, i]
            for k in range(count):
                t = scratch[ROW.NODE_FORCE + k, n]
                scratch[ROW.NODE_FORCE + k, i] += brace_force_within(
                    linear_terms, i, h, t, force_0, scratch, ROW.BRACE
                )


@outlined
def _store_accelerations(scene, h, load, scratch, k):
    """Compute the absolute accelerations of all floors at node `k` from equilibrium.

    The absolute acceleration of floor i (mass m) is (p + q - V_i + V_(i+1)) / m with

        p                force applied to the floor, N
        q                viscous force from the ground on the floor, N: -c v of the floor damper c
                         at the velocity v, plus the force of modal damping
        V_i, V_(i+1)     forces of the stories below and above, N: restoring force, P-delta, linear
                         story damper and power-law dashpot

    The ground acceleration does not occur in this equation, because the acceleration is absolute.
    The function uses and sets these rows of `scratch`, with the number n of floors:

        row, columns                before the call                   after the call
        NODE_VELOCITY + k, 0-n-1    h times velocities of floors, m   unchanged
        NODE_FORCE + k, 0-n-1       restoring force and P-delta of    total shears of the
                                    the stories, N                    stories, N
        NODE_FORCE + k, n           time of the node as a fraction    unchanged
                                    of the step
        NODE_ACCELERATION + k       not used                          accelerations, m/s^2

    The total shear of story i is

        V_i - sum of q = sum of (p - m acceleration)

    Both sums extend over the floors that story i supports. Only the absolute value of the total
    shear is used later, for its peak.
    """
    linear_terms, modal, _, forces, _ = scene
    n = linear_terms.shape[1] - 1
    t = scratch[ROW.NODE_FORCE + k, n]
    inverse_h = 1.0 / h
    for i in range(n):
        scratch[ROW.MODAL_FORCE, i] = 0.0
    add_modal_force(modal, scratch, ROW.NODE_VELOCITY + k, -inverse_h, scratch, ROW.MODAL_FORCE, n)
    # From the roof downwards. `viscous_force` is q of floor `i`, and `viscous_shear` is minus the
    # sum of q over floor `i` and the floors above. Row MODAL_FORCE contains the forces of modal
    # damping.
    viscous_shear = story_force_above = 0.0
    for i in range(n - 1, -1, -1):
        link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
        # `rate` is the drift rate, m/s: `_story_value` returns the value of floor `i` minus the
        # value of the floor below, here of h times the velocity.
        rate = inverse_h * _story_value(linear_terms, scratch, ROW.NODE_VELOCITY + k, i)
        story_force = scratch[ROW.NODE_FORCE + k, i] + linear_terms[rows.STORY_DAMPER, i] * rate
        # `power_damper` returns the force of the dashpot and its derivative.
        story_force += power_damper(linear_terms, i, rate)[0]
        viscous_force = (
            scratch[ROW.MODAL_FORCE, i]
            - inverse_h * linear_terms[rows.FLOOR_DAMPER, i] * scratch[ROW.NODE_VELOCITY + k, i]
        )
        viscous_shear -= viscous_force
        scratch[ROW.NODE_FORCE + k, i] = story_force + viscous_shear
        scratch[ROW.NODE_ACCELERATION + k, i] = linear_terms[rows.INVERSE_MASS, i] * (
            story_force_above - story_force + viscous_force
        )
        story_force_above = link * story_force
        viscous_shear *= link
    # Add p / m to the accelerations.
    if FORCES:
        for j in range(forces.shape[0]):
            i = int(forces[j, rows.FLOOR])
            scratch[ROW.NODE_ACCELERATION + k, i] += linear_terms[
                rows.INVERSE_MASS, i
            ] * force_value(forces, j, load[rows.TIME] + t * h)


@outlined
def _integrate_accelerations(h, load, memory, i, count):
    """Integrate the accelerations of floor `i` at the nodes to displacements and velocities.

    The nodes k are times within the step. They are stored as fractions t of the step in column n
    (the number of floors) of the rows NODE_FORCE:

        k even    start of the step, branch changes and reversals of any story, end of the step;
                  all called corners here
        k odd     midpoint between the corners k - 1 and k + 1

    All quantities have the unit m: velocities are multiplied by h, and accelerations by h^2.
    Displacements are relative to the start of the step. Rows NODE_DISPLACEMENT and NODE_VELOCITY
    receive the results of all nodes except node 0, the start of the step, where the response is
    known.

    Integration from corner to corner: The acceleration between two corners is the parabola through
    the accelerations a0 at the first corner, a1 at the midpoint and a2 at the second corner. x is
    the time from the first corner to the midpoint (fraction of the step). The displacement u and
    the velocity v at the first corner then give

        midpoint         velocity        v + x (5 a0 + 8 a1 - a2) / 12
                         displacement    u + x v + x^2 (3.5 a0 + 3 a1 - 0.5 a2) / 12
        second corner    velocity        v + x (a0 + 4 a1 + a2) / 3
                         displacement    u + 2 x v + x^2 (2 a0 + 4 a1) / 3

    Correction: At t = 1, the integrated displacement and velocity differ slightly from the response
    at the end of the step, which the step has already determined. Row RISE contains the change of
    displacement. Row A0 contains h^2 times the mean acceleration, which is h times the change of
    velocity. Therefore, the acceleration p + q (t - 1/2) is added. Its integrals are

        velocity        p t + q (t^2 - t) / 2
        displacement    p t^2 / 2 + q (t^3 / 6 - t^2 / 4)

    The constants p and q are determined so that the differences at t = 1 become zero.
    """
    state, _, scratch, _ = memory
    n = state.shape[1] - 1
    scaled_v0 = h * state[rows.VELOCITY, i]
    # `displacement` and `rate` (h times the velocity) are u and v at the first corner.
    displacement, rate = 0.0, scaled_v0
    a2 = _relative_acceleration(h, load, scratch, 0, i, n)
    for k in range(0, count - 2, 2):  # k: first corner, k + 1: midpoint, k + 2: second corner
        half_interval = scratch[ROW.NODE_FORCE + k + 1, n] - scratch[ROW.NODE_FORCE + k, n]
        a0, a1, a2 = (
            a2,
            _relative_acceleration(h, load, scratch, k + 1, i, n),
            _relative_acceleration(h, load, scratch, k + 2, i, n),
        )
        scratch[ROW.NODE_DISPLACEMENT + k + 1, i] = (
            displacement
            + half_interval * rate
            + half_interval * half_interval * (3.5 * a0 + 3.0 * a1 - 0.5 * a2) / 12.0
        )
        scratch[ROW.NODE_VELOCITY + k + 1, i] = (
            rate + half_interval * (5.0 * a0 + 8.0 * a1 - a2) / 12.0
        )
        displacement += (
            2.0 * half_interval * rate + half_interval * half_interval * (2.0 * a0 + 4.0 * a1) / 3.0
        )
        rate += half_interval * (a0 + 4.0 * a1 + a2) / 3.0
        scratch[ROW.NODE_DISPLACEMENT + k + 2, i] = displacement
        scratch[ROW.NODE_VELOCITY + k + 2, i] = rate
    # Add the correction, the integrals of p + q (t - 1/2). At t = 1 they are p for the velocity and
    # p / 2 - q / 12 for the displacement. They must be equal to the required changes of the
    # velocity, h v0 + A0 - rate, and of the displacement, RISE - displacement, in m.
    p = scaled_v0 + scratch[ROW.A0, i] - rate
    q = 12.0 * (0.5 * p - (scratch[ROW.RISE, i] - displacement))
    for k in range(1, count):
        t = scratch[ROW.NODE_FORCE + k, n]
        scratch[ROW.NODE_DISPLACEMENT + k, i] += t * t * (0.5 * p + q * (t / 6.0 - 0.25))
        scratch[ROW.NODE_VELOCITY + k, i] += t * (p + 0.5 * q * (t - 1.0))


@inline
def _relative_acceleration(h, load, scratch, k, i, n):
    """Return h^2 times the acceleration of floor `i` at node `k`, relative to the ground, m.

    It is the absolute acceleration (row NODE_ACCELERATION + k) minus the ground acceleration, which
    is linear within the step. The time of the node as a fraction of the step is in column n of row
    NODE_FORCE + k.
    """
    t = scratch[ROW.NODE_FORCE + k, n]
    return (
        h
        * h
        * (
            scratch[ROW.NODE_ACCELERATION + k, i]
            - load[rows.GROUND_0]
            - t * (load[rows.GROUND_1] - load[rows.GROUND_0])
        )
    )


@inline
def _may_exceed_shear_peak(law_state, i, rise, bend, peak):
    """Return True if the force of a story may exceed its peak within the step.

    The drift changes by rise t + bend (t^2 - t) / 2, with t from 0 to 1 over the step. The force
    can have its maximum within the step at a reversal, where the rate rise + bend (t - 1/2) is
    zero, or at the end of the current linear branch. Both forces are estimated with the stiffness
    of the current branch.

    The estimate is too small if the story changes to a stiffer branch within the step, such as a
    gap that closes, and then reverses. The observer of the response covers this case: it searches
    the step for reversals that may cause a new peak drift or shear, and evaluates the laws there
    (`find_interstep_peaks`).

    `rise` and `bend` are the coefficients of the change of drift, m. `peak` is the peak force of
    the run, N.
    """
    drift_change = abs(rise) + 0.5 * abs(bend)  # bound of the change of drift within the step
    # The rate rise + bend (t - 1/2) changes its sign within the step if 2 |rise| < |bend|. The
    # force at this reversal is estimated to be at most `max_force`.
    max_force = abs(law_state[rows.FORCE, i]) + abs(law_state[rows.SLOPE, i]) * drift_change
    may_exceed = (2.0 * abs(rise) < abs(bend)) & (max_force > peak)
    # Estimate the force at each limit of the branch that the drift can reach within the step.
    for row in (rows.UPPER, rows.LOWER):
        distance = law_state[row, i] - law_state[rows.DRIFT, i]
        may_exceed |= (abs(distance) <= drift_change) & (
            abs(law_state[rows.FORCE, i] + law_state[rows.SLOPE, i] * distance) > peak
        )
    return may_exceed


@inline
def _has_corners(scene, memory, i):
    """Return True if a law of story `i`, which leaves its branch, has corners in the step.

    A curved law has no corners. A story with elements has corners if one of its piecewise-linear
    elements leaves its branch.
    """
    if HAS_ELEMENTS and scene.law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        return _elements_have_corners(scene, memory, i)
    return path.is_piecewise_linear(scene.law_parameters, i)


@outlined
def _elements_have_corners(scene, memory, i):
    """Return True if a piecewise-linear element of story `i` leaves its branch in the step."""
    law_parameters = scene.law_parameters
    rise = _story_value(scene.linear_terms, memory.scratch, ROW.RISE, i)
    bend = _story_value(scene.linear_terms, memory.scratch, ROW.BEND, i)
    has_corners = False
    for element in range(
        int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
    ):
        has_corners |= path.is_piecewise_linear(
            law_parameters, element
        ) and not path.remains_on_branch(memory.law_state, element, rise, bend)
    return has_corners


@inline
def _may_exceed_peaks(scene, h, load, memory):
    """Return True if a force, an acceleration or a total shear may exceed its peak within the step.

    A corner is a branch change or a reversal of a story within the step. Corners change a story
    force by at most _FORCE_DEVIATION k (|rise| + |bend| / 2) compared with a straight line over the
    step. k is the initial stiffness. The sum in parentheses is an upper bound of the change of the
    drift d0 + rise t + bend (t^2 - t) / 2 within the step, t from 0 to 1. If a branch is stiffer
    than k (stops of a gap), the value is only an estimate. It is added to the shears and, divided
    by the mass, to the accelerations at both endpoints of the step. The sums are compared with the
    peaks. If the result is False, the observer of the response computes the peaks within the step
    from its interpolant. The result is

    - False if all stories remain on linear branches (row LEAVES_BRANCH is 0) or are curved,
    - otherwise True if there are forces on floors,
    - otherwise the result of the comparison, also for the story forces (`_may_exceed_shear_peak`).
    """
    linear_terms, _, law_parameters, forces, _ = scene
    _, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    inverse_h_squared = 1.0 / (h * h)
    any_leaves = False
    may_exceed = FORCES and forces.shape[0] > 0
    deviation_above = shear_0 = shear_1 = 0.0
    # From the roof downwards; shear_0 and shear_1 are sums of mass times absolute acceleration at
    # the start and at the end of the step. Without forces on floors, they are minus the total
    # shears; only their absolute values are used.
    for i in range(n - 1, -1, -1):
        # `deviation` is the bound of the deviation of the story force from a straight line, N. It
        # is 0 for a story that remains on its branch, and for a curved law.
        deviation = 0.0
        if scratch[ROW.LEAVES_BRANCH, i] != 0.0 and _has_corners(scene, memory, i):
            any_leaves = True
            rise = _story_value(linear_terms, scratch, ROW.RISE, i)
            bend = _story_value(linear_terms, scratch, ROW.BEND, i)
            peak = scratch[ROW.PEAKS + rows.PEAK_SHEAR, i]
            may_exceed |= _may_exceed_shear_peak(law_state, i, rise, bend, peak)
            if HAS_ELEMENTS and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
                for element in range(
                    int(law_parameters[rows.FIRST_ELEMENT, i]),
                    int(law_parameters[rows.END_ELEMENT, i]),
                ):
                    peak = law_state[rows.PEAK_FORCE, element]
                    if path.is_piecewise_linear(law_parameters, element):
                        may_exceed |= _may_exceed_shear_peak(law_state, element, rise, bend, peak)
            deviation = (
                _FORCE_DEVIATION * law_parameters[rows.STIFFNESS, i] * (abs(rise) + 0.5 * abs(bend))
            )
        # a_0 and a_1 are the absolute accelerations of the floor at both endpoints, m/s^2. They are
        # the mean acceleration minus and plus half of its change, plus the ground acceleration.
        half_change = 0.5 * inverse_h_squared * scratch[ROW.A1, i]
        a_0 = inverse_h_squared * scratch[ROW.A0, i] - half_change + load[rows.GROUND_0]
        a_1 = inverse_h_squared * scratch[ROW.A0, i] + half_change + load[rows.GROUND_1]
        acceleration_deviation = linear_terms[rows.INVERSE_MASS, i] * (deviation + deviation_above)
        may_exceed |= (
            max(abs(a_0), abs(a_1)) + acceleration_deviation
            > scratch[ROW.PEAKS + rows.PEAK_ACCELERATION, i]
        )
        shear_0 = linear_terms[rows.LINK, i + 1] * shear_0 + linear_terms[rows.MASS, i] * a_0
        shear_1 = linear_terms[rows.LINK, i + 1] * shear_1 + linear_terms[rows.MASS, i] * a_1
        may_exceed |= (
            max(abs(shear_0), abs(shear_1)) + deviation
            > scratch[ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i]
        )
        deviation_above = linear_terms[rows.LINK, i] * deviation
    return may_exceed & any_leaves


@inline
def update_peaks_at_corners(coefficients, scene, h, load, memory):
    """Update the peaks within a step if a story changes its branch or reverses in the step.

    The times of these branch changes and reversals are called corners. The peaks of story forces,
    accelerations and total shears are updated at the corners and between them, before the state at
    the end of the step is committed. In most steps all stories remain on their branches. The last
    column of row LEAVES_BRANCH is then 0, and the function returns without a change.
    """
    if memory.scratch[ROW.LEAVES_BRANCH, scene.linear_terms.shape[1] - 1] != 0.0:
        _update_peaks_at_corners(coefficients, scene, h, load, memory)


@outlined
def _update_peaks_at_corners(coefficients, scene, h, load, memory):
    """Find the corners of the stories, and update the peaks at and between the corners.

    A corner is a branch change or a reversal of a story within the step. Stories that remain on a
    linear branch (row LEAVES_BRANCH is 0) have no corners. Stories with curved laws are
    skipped. The peaks of story forces, accelerations and total shears are raised in the rows of the
    scratch array from ROW.PEAKS on. After a step that sets STEP_PEAKS, the observer of the response
    (`tdint.kernels.time_loop.observer`) merges these rows into the peaks of the run, and copies the
    merged peaks back. Before this function raises them, the rows therefore
    contain the peaks of the run at the last such step, or zeros. These values may be lower than the
    present peaks. The test `_may_exceed_peaks` is then True in more steps than necessary.

    Two elements of the status of the step are set to ROW.PEAKS, the number of the first row:

        STEP_PEAKS    this step has computed peaks. The observer merges them as described, computes
                      no other peaks of these quantities within the step, and then sets the element
                      to 0.
        RUN_PEAKS     the rows contain peaks of the run. The element remains set, so that the time
                      loop resets the rows if it resets the peaks of the run.

    The status is unchanged if no peak can be exceeded, or if the list of corners remains empty. In
    the second case, `_find_corners` can still have raised a peak of a story force, because
    `_store_corner` does not insert corners within _MIN_DISTANCE of an endpoint of the step. The
    force at such a corner is practically the force at the endpoint, which the observer records. The
    raised value is merged after the next step that sets STEP_PEAKS.
    """
    _, law_state, scratch, step_status = memory
    n = scene.linear_terms.shape[1] - 1
    if not _may_exceed_peaks(scene, h, load, memory):
        return
    # Column 0 of the rows CORNERS is the list of the corners of all stories: first their number,
    # then their times. A tuple of type `Integrals` (table, first row) passes the location of the
    # list to the functions; it contains no integrals here.
    scratch[ROW.CORNERS, 0] = 0.0
    for i in range(n):
        if (
            HAS_ELEMENTS
            and scene.law_parameters[rows.CODE, i] <= rows.ELEMENTS
            and scratch[ROW.LEAVES_BRANCH, i] != 0.0
        ):
            _find_corners_of_elements(scene, memory, i)
            continue
        is_linear = path.is_piecewise_linear(scene.law_parameters, i)
        if scratch[ROW.LEAVES_BRANCH, i] != 0.0 and is_linear:
            # Store the corners of the story, and raise the peak of its force. `complete` is its
            # parabola of drift over the complete step.
            complete = _story_path(scene.linear_terms, law_state, scratch, i)
            no_reversal = scratch[ROW.NO_REVERSAL, i] != 0.0
            _find_corners(
                scene.law_parameters,
                law_state,
                i,
                complete,
                no_reversal,
                Integrals(scratch, ROW.CORNERS),
            )
    if scratch[ROW.CORNERS, 0] == 0.0:
        return
    step_status[rows.STEP_PEAKS] = step_status[rows.RUN_PEAKS] = ROW.PEAKS
    _update_peaks_between_corners(coefficients, scene, h, load, memory)


@inline
def _store_first_response(h, memory, i, count):
    """Store displacements and velocities of floor `i` at the nodes for the first pass.

    The nodes are the endpoints of the step, the times of branch changes and reversals of stories,
    and the midpoints between them. An iteration improves the response at the nodes in several
    passes (`_update_peaks_between_corners`). The first pass starts from a cubic function of time,
    which has the displacements and velocities of the step at both endpoints. With the time t from 0
    to 1 over the step and s = t - 1/2,

        u(t) - u0 = t (D + w (t - 1) / 2) - 10 s (s^2 - 1/4) c
        h v(t)    = D + s w + (5/2 - 30 s^2) c
        c = (D - h v0) / 5 - w / 10

    where D (row RISE, m) is the change of displacement, w (row A0, m) is h times the change of
    velocity, and u0 (m) and v0 (m/s) are displacement and velocity at the start. The terms with c
    are 0 for the displacement at both endpoints; the value of c gives h v(0) = h v0 and
    h v(1) = h v0 + w.

    Parameters
    ----------
    memory : Memory
        State and scratch array. The last column of the rows NODE_FORCE, which no floor uses,
        contains the times t of the nodes. Rows NODE_DISPLACEMENT receive u - u0, rows NODE_VELOCITY
        h v, both in m.
    """
    state, _, scratch, _ = memory
    n = state.shape[1] - 1
    # `rise` is D, `velocity_change` is w, and `cubic` is c of the docstring.
    rise, velocity_change = scratch[ROW.RISE, i], scratch[ROW.A0, i]
    cubic = 0.2 * (rise - h * state[rows.VELOCITY, i]) - 0.1 * velocity_change
    for k in range(count):
        s = scratch[ROW.NODE_FORCE + k, n] - 0.5
        t = s + 0.5
        scratch[ROW.NODE_DISPLACEMENT + k, i] = (
            t * (rise + 0.5 * velocity_change * (t - 1.0)) - 10.0 * s * (s * s - 0.25) * cubic
        )
        scratch[ROW.NODE_VELOCITY + k, i] = (
            rise + s * velocity_change + (2.5 - 30.0 * s * s) * cubic
        )


@outlined
def _update_peaks_between_corners(coefficients, scene, h, load, memory):
    """Update the peaks of accelerations and total shears at the corners and between them.

    A corner is the time of a branch change or of a reversal of a story within the step. The
    responses are computed at nodes: the endpoints of the step, the corners, and the midpoints
    between them. Each pass of a fixed-point iteration consists of three computations at all nodes:

        1. displacements and velocities of the floors: in the first pass, cubic functions of time
           through the endpoint values of the step; in the next passes, integrals of the
           accelerations of the previous pass
        2. story forces at these displacements, from the laws (rows NODE_FORCE)
        3. absolute accelerations of the floors (rows NODE_ACCELERATION) and total shears of the
           stories, from equilibrium; the total shears replace the story forces in rows NODE_FORCE

    The peaks are raised by the values of the last pass at the nodes and by the extrema of the
    parabolas through a corner, the next midpoint and the next corner.
    """
    scratch = memory.scratch
    n = scene.linear_terms.shape[1] - 1
    count = _store_nodes(scratch, n)
    for i in range(n):
        _store_first_response(h, memory, i, count)
    for pass_index in range(_PASSES):
        if pass_index > 0:
            for i in range(n):
                _integrate_accelerations(h, load, memory, i, count)
        for i in range(n):
            _store_forces(coefficients, scene, h, memory, i, count)
        if HAS_ELEMENTS and pass_index == _PASSES - 1:
            _raise_peaks_of_sums(scene, memory, count)
        if TANGENT_DAMPING and scene.flags[rows.HAS_TANGENT_DAMPING] != 0.0:
            _add_tangent_damping(scene, h, memory, count)
        if BRACES and scene.flags[rows.HAS_BRACES] != 0.0:
            _add_brace_forces(scene, h, memory, count)
        for k in range(count):
            _store_accelerations(scene, h, load, scratch, k)
    for i in range(n):
        raise_peak_at_nodes(
            scratch, ROW.NODE_ACCELERATION, i, count, ROW.PEAKS + rows.PEAK_ACCELERATION, i
        )
        raise_peak_at_nodes(scratch, ROW.NODE_FORCE, i, count, ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i)
