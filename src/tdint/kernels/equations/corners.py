"""Peaks within a step of `moment4` during which stories change their branches or reverse.

A branch change or a reversal is a corner: the rate of the story force is discontinuous, and so is
the rate of the accelerations. The quintic interpolant between the endpoints of the step
(`tdint.kernels.peaks_between_steps`) does not represent corners. Here the times of the corners and
the story forces follow from the paths of the stories (`tdint.kernels.stories.path`), and the
accelerations follow from equilibrium at nodes: the endpoints of the step, the corners, and the
midpoints between them. Times t are fractions of the step, from 0 to 1. The times of the nodes are
in column n (the number of floors) of the rows NODE_FORCE; nodes with an even number k are endpoints
or corners, nodes with an odd k midpoints. Column 0 of the rows CORNERS contains the number of
corners, then their times in ascending order. The displacements of floors and the drifts of stories
are parabolas in the step, d0 + rise t + bend (t^2 - t) / 2.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.equations.moment4 import MAX_CORNERS, ROW, R
from tdint.kernels.laws.branch_following import copy_state
from tdint.kernels.laws.selection import elements_of
from tdint.kernels.linear_terms import (
    above,
    add_modal_force,
    base_of,
    force_value,
    has_dashpot,
    is_tree,
    power_damper,
    story_value,
    tie,
)
from tdint.kernels.peaks_between_steps import keep_corner, raise_peak
from tdint.kernels.stepping import Integrals, PathSegment
from tdint.kernels.stories import path
from tdint.kernels.stories.brace import brace_force_at
from tdint.kernels.stories.law_state import copy_step_start, restoring_force_outlined

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
# Relative to the terms of the parabola of drift: rounding of a drift at a given time.
_DRIFT_ROUNDING = 1e-13


@inline
def _story_path(linear_terms, law_state, scratch, i):
    """Return the parabola of drift of story `i` over the step, from the committed drift."""
    rise = story_value(linear_terms, scratch, ROW.RISE, i)
    bend = story_value(linear_terms, scratch, ROW.BEND, i)
    return PathSegment(law_state[rows.DRIFT, i], rise, bend, 0.0, 1.0)


# ---- Path of a story


@inline
def _skip_branch(law_state, i, block, segment, results):
    """Skip a branch; `path.along_branches` calls this function for each branch on a path.

    Its counterpart `path._add_on_branch` integrates the force along the branch. Here only the times
    and states at the ends of the branches are needed.
    """
    pass


@inline
def _store_corner(corners, t):
    """Insert the time of a corner into the sorted list of corners.

    A corner is not inserted close to an endpoint of the step or into a full list.
    """
    scratch, first = corners
    count = int(scratch[first, 0])
    if _MIN_DISTANCE < t < 1.0 - _MIN_DISTANCE and count < MAX_CORNERS:
        # The new corner is number `position` + 1.
        position = count
        while position > 0 and scratch[first + position, 0] > t:
            scratch[first + position + 1, 0] = scratch[first + position, 0]
            position -= 1
        scratch[first + position + 1, 0] = t
        scratch[first, 0] = count + 1.0


@inline
def _store_branch_end(results, i, t, drift, force):
    """Store the corner at the end of a branch; raise the peaks of the drift and of the force.

    The law has been at the limit `drift` (m) with the force `force` (N). The interpolant of the
    observer can reverse slightly before this limit. Without the limit, the peak force would belong
    to a drift that is larger than the peak drift.
    """
    raise_peak(results.table, ROW.PEAKS + rows.PEAK_SHEAR, i, force)
    raise_peak(results.table, ROW.PEAKS + rows.PEAK_DRIFT, i, drift)
    _store_corner(results, t)


_follow_path_storing_corners = path.along_branches(_skip_branch, _store_branch_end)


@inline
def _store_corners_on(part, no_reversal, scene, law_state, column, corners):
    """Follow a part of the path of a story, and store its corners. If `no_reversal`, the direction
    is that of the complete path."""
    target = path.drift_at(part, part.end)
    change = part.rise if no_reversal else target - path.drift_at(part, part.begin)
    side = math.copysign(1.0, change) if change != 0.0 else 0.0
    _follow_path_storing_corners(
        scene.law_parameters, law_state, column, rows.SECOND_TRIAL, part, side, target, corners
    )


@outlined
def _find_corners(scene, memory, i, column):
    """Find the corners of the law in a column of story `i` in the step: store their times, and
    raise the peaks of drift and story force at the ends of branches.

    The law follows the parabola in the trial state SECOND_TRIAL. In a story without a reversal (row
    NO_REVERSAL), an extremum of the parabola is ignored, because the parabola only approximates the
    drift. The peaks are not raised at a reversal: the observer evaluates the law at the reversal of
    its interpolant, which is more accurate than the extremum of the parabola. The laws move there
    from their states at the start of the step: the reversal of the parabola can be farther, and the
    path back from the reversal is stiffer.
    """
    _, law_state, scratch, _ = memory
    complete = _story_path(scene.linear_terms, law_state, scratch, i)
    corners = Integrals(scratch, ROW.CORNERS)  # only passes the location of the list of corners
    no_reversal = scratch[ROW.NO_REVERSAL, i] != 0.0
    copy_state(law_state, column, 0, rows.SECOND_TRIAL)
    reversal_time = 1.0 if no_reversal else path.time_of_extremum(complete)
    part = path.path_segment(complete, 0.0, reversal_time)
    _store_corners_on(part, no_reversal, scene, law_state, column, corners)
    if reversal_time < 1.0:
        _store_corner(corners, reversal_time)
        part = path.path_segment(complete, reversal_time, 1.0)
        _store_corners_on(part, False, scene, law_state, column, corners)


@outlined
def _find_corners_of_elements(scene, memory, i):
    """Find the corners of the piecewise-linear elements of story `i`; raise their peak forces and
    the peak drift of the story at the ends of their branches."""
    law_parameters = scene.law_parameters
    _, law_state, scratch, _ = memory
    for element in elements_of(law_parameters, i):
        if path.is_piecewise_linear(law_parameters, element):
            _find_corners(scene, memory, i, element)
            law_state[rows.PEAK_FORCE, element] = max(
                law_state[rows.PEAK_FORCE, element],
                scratch[ROW.PEAKS + rows.PEAK_SHEAR, element],
            )
            peak_drift = scratch[ROW.PEAKS + rows.PEAK_DRIFT, element]
            raise_peak(scratch, ROW.PEAKS + rows.PEAK_DRIFT, i, peak_drift)


@outlined
def _store_nodes(scratch, n):
    """Compute the times of the nodes and return their number.

    A corner is omitted if it is close to the last node. The end of the step is never omitted: all
    stored corners are more than _MIN_DISTANCE before the end.
    """
    scratch[ROW.NODE_FORCE, n] = 0.0
    count = 1
    corners = int(scratch[ROW.CORNERS, 0])
    for k in range(corners + 1):
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

    The drift d at a node is the initial drift d0 plus the difference of row NODE_DISPLACEMENT + k
    between both floors:

    1. The story remains on its linear branch of stiffness k (row LEAVES_BRANCH is 0): f0 + k (d -
       d0), with the force f0 at the start of the step.
    2. The story leaves a linear branch. The law follows the drifts from node to node.
    3. The law is curved. The law is not evaluated. The force is a parabola in s = t - 1/2 with the
       initial value f0 and with the mean F0 and the first moment F1 of the law over the step (rows
       PATH without P-delta, dampers and numerical dissipation): F0 + s F1 + (6 s^2 - 1/2) (f0 - F0
       + F1 / 2)

    The trial states SECOND_TRIAL and THIRD_TRIAL are overwritten. FIRST_TRIAL contains the state at
    the end of the step. The list of corners and the peaks do not change.
    """
    law_parameters, scratch = scene.law_parameters, memory.scratch
    if (
        FULL
        and law_parameters[rows.CODE, i] <= rows.ELEMENTS
        and scratch[ROW.LEAVES_BRANCH, i] != 0.0
    ):
        for element in elements_of(law_parameters, i):
            _store_law_forces(coefficients, scene, h, memory, i, element, count)
        _store_sums(scene, memory, i, count)
    else:
        _store_law_forces(coefficients, scene, h, memory, i, i, count)


@outlined
def _store_law_forces(coefficients, scene, h, memory, i, column, count):
    """Compute the force of the law in `column`, story `i` or one of its elements, at all nodes
    (`_store_forces`). The force of an element excludes P-delta.
    """
    _, law_state, scratch, _ = memory
    linear_terms = scene.linear_terms
    n = linear_terms.shape[1] - 1
    story_path = _story_path(linear_terms, law_state, scratch, i)
    # The rows PATH of an element contain its restoring force only.
    is_element = FULL and column != i
    geometric = 0.0 if is_element else linear_terms[rows.GEOMETRIC, i]
    leaves_branch = scratch[ROW.LEAVES_BRANCH, i] != 0.0
    is_curved = leaves_branch and not path.is_piecewise_linear(scene.law_parameters, column)
    mean = moment = 0.0
    if is_curved and is_element:
        mean = scratch[ROW.PATH + path.MEAN, column]
        moment = scratch[ROW.PATH + path.MOMENT, column]
    elif is_curved:
        # The rows PATH include P-delta, dampers and the numerical dissipation r (k + g) bend.
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
    # The states at the last node and at the next node alternate between two blocks.
    block, trial, other = rows.COMMITTED, rows.SECOND_TRIAL, rows.THIRD_TRIAL
    for k in range(count):
        drift = story_path.start + story_value(linear_terms, scratch, ROW.NODE_DISPLACEMENT + k, i)
        force = law_state[rows.FORCE, column]  # at the start of the step
        if is_curved:
            s = scratch[ROW.NODE_FORCE + k, n] - 0.5
            force = mean + s * moment + (6.0 * s * s - 0.5) * (force - mean + 0.5 * moment)
        elif not leaves_branch:
            force += law_state[rows.SLOPE, column] * (drift - story_path.start)
        elif k > 0:
            restoring_force_outlined(scene.law_parameters, law_state, column, block, trial, drift)
            force = law_state[trial + rows.FORCE, column]
            block, trial, other = trial, other, trial
        scratch[ROW.NODE_FORCE + k, column] = force + geometric * drift


@outlined
def _store_sums(scene, memory, i, count):
    """Store the force of story `i` at all nodes as the sum over its elements, with P-delta, N."""
    _, law_state, scratch, _ = memory
    for k in range(count):
        force = 0.0
        for element in elements_of(scene.law_parameters, i):
            force += scratch[ROW.NODE_FORCE + k, element]
        drift = law_state[rows.DRIFT, i] + story_value(
            scene.linear_terms, scratch, ROW.NODE_DISPLACEMENT + k, i
        )
        scratch[ROW.NODE_FORCE + k, i] = force + scene.linear_terms[rows.GEOMETRIC, i] * drift


@outlined
def _raise_peaks_of_sums(scene, memory, count):
    """Raise the peak shears of stories with piecewise-linear elements by their forces at the nodes.

    The peak force of an element is raised at the ends of the branches of the element. The sum can
    have its peak at the end of a branch of another element. It is evaluated on the parabola of the
    step, which is at the limits of the branches at the corners. Beyond the peak drift, near the
    extremum of the parabola, the sum is not used (`_find_corners`).
    """
    law_parameters, law_state, scratch = scene.law_parameters, memory.law_state, memory.scratch
    n = scene.linear_terms.shape[1] - 1
    for i in range(n):
        if (
            law_parameters[rows.CODE, i] <= rows.ELEMENTS
            and scratch[ROW.LEAVES_BRANCH, i] != 0.0
            and path.is_piecewise_linear(law_parameters, i)
        ):
            story_path = _story_path(scene.linear_terms, law_state, scratch, i)
            start, rise = story_path.start, story_path.rise
            largest = max(abs(start), abs(start + rise), scratch[ROW.PEAKS + rows.PEAK_DRIFT, i])
            largest += _DRIFT_ROUNDING * (abs(start) + abs(rise) + abs(story_path.bend))
            block, trial, other = rows.COMMITTED, rows.SECOND_TRIAL, rows.THIRD_TRIAL
            for k in range(1, count):
                drift = path.drift_at(story_path, scratch[ROW.NODE_FORCE + k, n])
                restoring_force_outlined(law_parameters, law_state, i, block, trial, drift)
                if abs(drift) <= largest:
                    force = law_state[trial + rows.FORCE, i]
                    raise_peak(scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, force)
                block, trial, other = trial, other, trial


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
                drift_change = story_value(linear_terms, scratch, node, i)
                drift_change -= story_value(linear_terms, scratch, node - 1, i)
                force_change = (
                    scratch[ROW.NODE_FORCE + k, i]
                    - scratch[ROW.NODE_FORCE + k - 1, i]
                    - linear_terms[rows.GEOMETRIC, i] * drift_change
                )
                rate = story_value(linear_terms, scratch, ROW.NODE_VELOCITY + k, i) / h
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
            force_0 = memory.state[rows.BRACE_REPORTED, i]
            first_rate = story_value(linear_terms, memory.state, rows.VELOCITY, i)
            for k in range(count):
                rise = story_value(linear_terms, scratch, ROW.NODE_DISPLACEMENT + k, i)
                rate = story_value(linear_terms, scratch, ROW.NODE_VELOCITY + k, i) / h
                duration = h * scratch[ROW.NODE_FORCE + k, n]
                motion = (rise, first_rate, rate)
                scratch[ROW.NODE_FORCE + k, i] += brace_force_at(
                    linear_terms, i, duration, motion, force_0, scratch, ROW.NODE_BRACE
                )


@outlined
def _store_accelerations(scene, h, load, scratch, k):
    """Compute the absolute accelerations of all floors and the total shears of all stories at node
    `k` from equilibrium.

    The total shears replace the story forces (restoring force and P-delta) in row NODE_FORCE + k.
    Their sign is not relevant. Rows NODE_VELOCITY contain h times the velocities. The ground
    acceleration does not occur in the equation, because the accelerations are absolute.
    """
    linear_terms, modal, _, forces, _ = scene
    n = linear_terms.shape[1] - 1
    t = scratch[ROW.NODE_FORCE + k, n]
    inverse_h = 1.0 / h
    for i in range(n):
        scratch[ROW.MODAL_FORCE, i] = 0.0
    add_modal_force(modal, scratch, ROW.NODE_VELOCITY + k, -inverse_h, scratch, ROW.MODAL_FORCE, n)
    # `viscous_force` is the viscous force from the ground on floor `i` (damper and modal damping),
    # and `viscous_shear` is minus the sum of these forces over floor `i` and the floors above.
    viscous_shear = story_force_above = 0.0
    for i in range(n - 1, -1, -1):
        link = linear_terms[rows.LINK, i]
        # `story_value` returns h times the drift rate.
        rate = inverse_h * story_value(linear_terms, scratch, ROW.NODE_VELOCITY + k, i)
        story_force = scratch[ROW.NODE_FORCE + k, i] + linear_terms[rows.STORY_DAMPER, i] * rate
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
        if FULL and is_tree(linear_terms):
            scratch[ROW.NODE_FORCE + k, i] = story_force
            scratch[ROW.MODAL_FORCE, i] = viscous_force
    if FULL and is_tree(linear_terms):
        _store_tree_accelerations(linear_terms, scratch, k)
    if FULL:
        for j in range(forces.shape[0]):
            i = int(forces[j, rows.FLOOR])
            scratch[ROW.NODE_ACCELERATION + k, i] += linear_terms[
                rows.INVERSE_MASS, i
            ] * force_value(forces, j, load[rows.TIME] + t * h)
    tie(linear_terms, scratch, ROW.NODE_ACCELERATION + k)


@outlined
def _store_tree_accelerations(linear_terms, scratch, k):
    """Compute the results of `_store_accelerations` without forces on floors for a building with
    attachments or links, from the story forces (row NODE_FORCE + k) and the viscous forces from the
    ground on the floors (row MODAL_FORCE)."""
    n = linear_terms.shape[1] - 1
    forces, accelerations = ROW.NODE_FORCE + k, ROW.NODE_ACCELERATION + k
    for i in range(n):
        force = above(linear_terms, scratch, forces, i) - scratch[forces, i]
        force += scratch[ROW.MODAL_FORCE, i]
        scratch[accelerations, i] = linear_terms[rows.INVERSE_MASS, i] * force
    for i in range(n - 1, -1, -1):
        # The columns of links, which are the last, have no inertia.
        scratch[forces, i] = 0.0
        shear = above(linear_terms, scratch, forces, i)
        scratch[forces, i] = shear - linear_terms[rows.MASS, i] * scratch[accelerations, i]


@outlined
def _integrate_accelerations(h, load, memory, i, count):
    """Integrate the accelerations of floor `i` at the nodes to displacements and velocities.

    All quantities have the unit m: velocities are multiplied by h, and accelerations by h^2.
    Displacements are relative to the start of the step. The acceleration between two corners is the
    parabola through its values at the corners and at the midpoint.

    At t = 1, the integrated displacement and velocity differ slightly from the response at the end
    of the step, which the step has already determined (row RISE: change of displacement, row A0: h
    times the change of velocity). Therefore, the acceleration p + q (t - 1/2) is added. Its
    integrals are

        velocity        p t + q (t^2 - t) / 2
        displacement    p t^2 / 2 + q (t^3 / 6 - t^2 / 4)
    """
    state, _, scratch, _ = memory
    n = state.shape[1] - 1
    scaled_v0 = h * state[rows.VELOCITY, i]
    # at the first corner; `rate` is h times the velocity
    displacement, rate = 0.0, scaled_v0
    a2 = _relative_acceleration(h, load, scratch, 0, i, n)
    for k in range(0, count - 2, 2):  # k: first corner, k + 1: midpoint, k + 2: second corner
        half_interval = scratch[ROW.NODE_FORCE + k + 1, n] - scratch[ROW.NODE_FORCE + k, n]
        a0, a1 = a2, _relative_acceleration(h, load, scratch, k + 1, i, n)
        a2 = _relative_acceleration(h, load, scratch, k + 2, i, n)
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
    p = scaled_v0 + scratch[ROW.A0, i] - rate
    q = 12.0 * (0.5 * p - (scratch[ROW.RISE, i] - displacement))
    for k in range(1, count):
        t = scratch[ROW.NODE_FORCE + k, n]
        scratch[ROW.NODE_DISPLACEMENT + k, i] += t * t * (0.5 * p + q * (t / 6.0 - 0.25))
        scratch[ROW.NODE_VELOCITY + k, i] += t * (p + 0.5 * q * (t - 1.0))


@inline
def _relative_acceleration(h, load, scratch, k, i, n):
    """Return h^2 times the acceleration of floor `i` at node `k`, relative to the ground, m."""
    t = scratch[ROW.NODE_FORCE + k, n]
    ground_change = load[rows.GROUND_1] - load[rows.GROUND_0]
    acceleration = scratch[ROW.NODE_ACCELERATION + k, i]
    return h * h * (acceleration - load[rows.GROUND_0] - t * ground_change)


@inline
def _may_exceed_shear_peak(law_state, i, rise, bend, peak):
    """Return True if the force of a story may exceed its peak within the step, estimated with the
    stiffness of the current branch.

    The estimate is too small if the story changes to a stiffer branch within the step, such as a
    gap that closes, and then reverses. The observer of the response covers this case: it searches
    the step for reversals that may cause a new peak drift or shear (`find_interstep_peaks`).
    """
    drift_change = abs(rise) + 0.5 * abs(bend)  # bound of the change of drift within the step
    # The rate rise + bend (t - 1/2) changes its sign within the step if 2 |rise| < |bend|.
    max_force = abs(law_state[rows.FORCE, i]) + abs(law_state[rows.SLOPE, i]) * drift_change
    may_exceed = (2.0 * abs(rise) < abs(bend)) & (max_force > peak)
    # The drift can reach a limit of the branch within the step.
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
    if FULL and scene.law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        return _elements_have_corners(scene, memory, i)
    return path.is_piecewise_linear(scene.law_parameters, i)


@outlined
def _elements_have_corners(scene, memory, i):
    """Return True if a piecewise-linear element of story `i` leaves its branch in the step."""
    law_parameters = scene.law_parameters
    rise = story_value(scene.linear_terms, memory.scratch, ROW.RISE, i)
    bend = story_value(scene.linear_terms, memory.scratch, ROW.BEND, i)
    has_corners = False
    for element in elements_of(law_parameters, i):
        has_corners |= path.is_piecewise_linear(
            law_parameters, element
        ) and not path.remains_on_branch(memory.law_state, element, rise, bend)
    return has_corners


@inline
def _largest_at_ends(start, change):
    """Return the larger absolute value at both ends of a step."""
    return max(abs(start), abs(start + change))


@inline
def _may_exceed_peaks(scene, h, load, memory):
    """Return True if a force, a velocity, a drift rate of a dashpot, an acceleration or a total
    shear may exceed its peak within the step because of corners.

    Corners change a story force by at most _FORCE_DEVIATION k (|rise| + |bend| / 2) compared with a
    straight line over the step, with the initial stiffness k. If a branch is stiffer than k (stops
    of a gap), the value is only an estimate. If the result is False, the observer of the response
    computes the peaks within the step from its interpolant.
    """
    linear_terms, _, law_parameters, forces, _ = scene
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    inverse_h_squared = 1.0 / (h * h)
    any_leaves = False
    has_dashpots = scene.flags[rows.HAS_DASHPOTS] != 0.0
    # The sums below apply to a chain.
    may_exceed = (FULL and forces.shape[0] > 0) or (FULL and is_tree(linear_terms))
    deviation_above = shear_0 = shear_1 = 0.0
    # shear_0 and shear_1 are sums of mass times absolute acceleration at the start and at the end
    # of the step. Without forces on floors, they are minus the total shears.
    for i in range(n - 1, -1, -1):
        # 0 for a story that remains on its branch, and for a curved law
        deviation = 0.0
        if scratch[ROW.LEAVES_BRANCH, i] != 0.0 and _has_corners(scene, memory, i):
            any_leaves = True
            rise = story_value(linear_terms, scratch, ROW.RISE, i)
            bend = story_value(linear_terms, scratch, ROW.BEND, i)
            peak = scratch[ROW.PEAKS + rows.PEAK_SHEAR, i]
            may_exceed |= _may_exceed_shear_peak(law_state, i, rise, bend, peak)
            if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
                for element in elements_of(law_parameters, i):
                    peak = law_state[rows.PEAK_FORCE, element]
                    if path.is_piecewise_linear(law_parameters, element):
                        may_exceed |= _may_exceed_shear_peak(law_state, element, rise, bend, peak)
            deviation = (
                _FORCE_DEVIATION * law_parameters[rows.STIFFNESS, i] * (abs(rise) + 0.5 * abs(bend))
            )
        # The accelerations are the mean minus and plus half of the change, plus the ground
        # acceleration.
        half_change = 0.5 * inverse_h_squared * scratch[ROW.A1, i]
        a_0 = inverse_h_squared * scratch[ROW.A0, i] - half_change + load[rows.GROUND_0]
        a_1 = inverse_h_squared * scratch[ROW.A0, i] + half_change + load[rows.GROUND_1]
        acceleration_deviation = linear_terms[rows.INVERSE_MASS, i] * (deviation + deviation_above)
        # A velocity exceeds its values at both ends by at most a quarter of the step times the
        # acceleration, if the acceleration is linear.
        reach = _largest_at_ends(state[rows.VELOCITY, i], scratch[ROW.A0, i] / h) + 0.25 * h * (
            max(abs(a_0 - load[rows.GROUND_0]), abs(a_1 - load[rows.GROUND_1]))
            + acceleration_deviation
        )
        may_exceed |= reach > scratch[ROW.PEAKS + rows.PEAK_VELOCITY, i]
        if has_dashpots and has_dashpot(linear_terms, i):
            rate = story_value(linear_terms, state, rows.VELOCITY, i)
            mean = story_value(linear_terms, scratch, ROW.A0, i) / h
            change = story_value(linear_terms, scratch, ROW.A1, i) / h
            reach = _largest_at_ends(rate, mean) + 0.5 * (abs(mean) + abs(change))
            may_exceed |= reach > scratch[ROW.PEAKS + rows.PEAK_DRIFT_RATE, i]
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
    """Update the peaks at and between the corners of a step, before the state at its end is
    committed.

    In most steps all stories remain on their branches. The last column of row LEAVES_BRANCH is then
    0.
    """
    if memory.scratch[ROW.LEAVES_BRANCH, scene.linear_terms.shape[1] - 1] != 0.0:
        _update_peaks_at_corners(coefficients, scene, h, load, memory)


@outlined
def _update_peaks_at_corners(coefficients, scene, h, load, memory):
    """Find the corners of the stories, and update the peaks at and between the corners.

    The peaks are raised in the rows of the scratch array from ROW.PEAKS on. After a step that sets
    STEP_PEAKS, the observer merges these rows into the peaks of the run, computes no other peaks of
    velocities, accelerations and total shears within the step, copies the merged peaks back, and
    sets STEP_PEAKS to 0. Before this function raises them, the rows therefore contain the peaks of
    the run at the last such step, or zeros. These values may be lower than the present peaks; the
    test `_may_exceed_peaks` is then True in more steps than necessary. A function that resets the
    peaks of the run also resets the rows (`Family.step_peaks`).

    The status is unchanged if no peak can be exceeded or no corner is found. Peaks that
    `_store_branch_end` has then raised, at a corner close to an endpoint of the step, are
    practically the values at the endpoint; they are merged after the next step that sets
    STEP_PEAKS.
    """
    _, law_state, scratch, step_status = memory
    n = scene.linear_terms.shape[1] - 1
    if not _may_exceed_peaks(scene, h, load, memory):
        return
    scratch[ROW.CORNERS, 0] = 0.0
    for i in range(n):
        if scratch[ROW.LEAVES_BRANCH, i] == 0.0:
            continue
        if FULL and scene.law_parameters[rows.CODE, i] <= rows.ELEMENTS:
            _find_corners_of_elements(scene, memory, i)
        elif path.is_piecewise_linear(scene.law_parameters, i):
            _find_corners(scene, memory, i, i)
    if scratch[ROW.CORNERS, 0] == 0.0:
        return
    step_status[rows.STEP_PEAKS] = ROW.PEAKS
    copy_step_start(law_state)
    _update_peaks_between_corners(coefficients, scene, h, load, memory)


@inline
def _store_first_response(h, memory, i, count):
    """Store displacements and velocities of floor `i` at the nodes for the first pass.

    The first pass starts from a cubic function of time, which has the displacements and velocities
    of the step at both endpoints. With s = t - 1/2,

        u(t) - u0 = t (D + w (t - 1) / 2) - 10 s (s^2 - 1/4) c
        h v(t) = D + s w + (5/2 - 30 s^2) c
        c = (D - h v0) / 5 - w / 10

    where D (row RISE, m) is the change of displacement and w (row A0, m) is h times the change of
    velocity.
    """
    state, _, scratch, _ = memory
    n = state.shape[1] - 1
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
    """Update the peaks of velocities, accelerations and total shears at the corners and between
    them.

    Extrema between the corners are located on the parabolas through a corner, the next midpoint and
    the next corner. They become nodes, and the response at all nodes is computed again. The peaks
    are the values at the nodes, which satisfy the equations of motion.
    """
    scratch = memory.scratch
    n = scene.linear_terms.shape[1] - 1
    count = _store_nodes(scratch, n)
    _store_response_at_nodes(coefficients, scene, h, load, memory, count)
    if _add_extrema_to_corners(scratch, count, n):
        count = _store_nodes(scratch, n)
        _store_response_at_nodes(coefficients, scene, h, load, memory, count)
    if FULL:
        _raise_peaks_of_sums(scene, memory, count)
    _raise_velocities(scene, h, load, memory, count)
    for k in range(1, count):
        t = load[rows.TIME] + h * scratch[ROW.NODE_FORCE + k, n]
        for i in range(n):
            acceleration = scratch[ROW.NODE_ACCELERATION + k, i]
            raise_peak(scratch, ROW.PEAKS + rows.PEAK_ACCELERATION, i, acceleration)
            total_shear = scratch[ROW.NODE_FORCE + k, i]
            raise_peak(scratch, ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i, total_shear)
            if FULL:
                keep_corner(scratch, ROW.PEAKS, i, acceleration, t)


@outlined
def _raise_velocities(scene, h, load, memory, count):
    """Raise the peaks of the velocities of all floors, and of the drift rates of stories with
    dashpots, at the corners and by their extrema between the corners."""
    linear_terms, scratch = scene.linear_terms, memory.scratch
    n = linear_terms.shape[1] - 1
    has_dashpots = scene.flags[rows.HAS_DASHPOTS] != 0.0
    for i in range(n):
        has_rate = has_dashpots and has_dashpot(linear_terms, i)
        link = linear_terms[rows.LINK, i]
        for k in range(0, count - 2, 2):
            half = scratch[ROW.NODE_FORCE + k + 1, n] - scratch[ROW.NODE_FORCE + k, n]
            motion = _motion_between(h, load, scratch, k, i, n)
            _raise_velocity(scratch, rows.PEAK_VELOCITY, i, h, half, motion, 0.0, motion)
            if has_rate:
                lower = _motion_between(h, load, scratch, k, base_of(linear_terms, i), n)
                _raise_velocity(scratch, rows.PEAK_DRIFT_RATE, i, h, half, motion, link, lower)


@inline
def _motion_between(h, load, scratch, k, i, n):
    """Return h times the velocities of floor `i` at the corners `k` and `k` + 2, and h^2 times its
    accelerations relative to the ground at both corners and at the midpoint between them, m."""
    return (
        scratch[ROW.NODE_VELOCITY + k, i],
        scratch[ROW.NODE_VELOCITY + k + 2, i],
        _relative_acceleration(h, load, scratch, k, i, n),
        _relative_acceleration(h, load, scratch, k + 1, i, n),
        _relative_acceleration(h, load, scratch, k + 2, i, n),
    )


@inline
def _raise_velocity(scratch, row, i, h, half, motion, link, lower):
    """Raise a peak by a velocity at the second of two corners, and by its extremum between them.

    The velocity is that of `motion` minus `link` times that of `lower` (`_motion_between`). Its
    acceleration is the parabola through the three accelerations; `half` is half the distance of the
    corners as a fraction of the step.
    """
    v_0, v_2 = motion[0] - link * lower[0], motion[1] - link * lower[1]
    a_0, a_1, a_2 = (
        motion[2] - link * lower[2],
        motion[3] - link * lower[3],
        motion[4] - link * lower[4],
    )
    raise_peak(scratch, ROW.PEAKS + row, i, v_2 / h)
    if a_0 * a_2 < 0.0:
        # a_0 + b x + c x^2, with x from 0 to 2. At the root between both corners, the slope has the
        # sign of -a_0. Of the two forms of this root, one has no difference of similar numbers.
        b, c = 0.5 * (4.0 * a_1 - 3.0 * a_0 - a_2), 0.5 * (a_0 - 2.0 * a_1 + a_2)
        root = math.copysign(math.sqrt(max(b * b - 4.0 * a_0 * c, 0.0)), a_0)
        x = -0.5 * (b + root) / c if b * a_0 > 0.0 else 2.0 * a_0 / (root - b)
        extremum = v_0 + half * x * (a_0 + x * (0.5 * b + x * c / 3.0))
        raise_peak(scratch, ROW.PEAKS + row, i, extremum / h)


@outlined
def _store_response_at_nodes(coefficients, scene, h, load, memory, count):
    """Store accelerations and total shears at the nodes.

    Each pass of a fixed-point iteration computes displacements and velocities of the floors from
    the accelerations of the previous pass (first pass: cubic functions of time), the story forces
    at these displacements from the laws, and from equilibrium the accelerations and the total
    shears.
    """
    scratch = memory.scratch
    n = scene.linear_terms.shape[1] - 1
    for i in range(n):
        _store_first_response(h, memory, i, count)
    for pass_index in range(_PASSES):
        if pass_index > 0:
            for i in range(n):
                _integrate_accelerations(h, load, memory, i, count)
        for i in range(n):
            _store_forces(coefficients, scene, h, memory, i, count)
        if FULL and scene.flags[rows.HAS_TANGENT_DAMPING] != 0.0:
            _add_tangent_damping(scene, h, memory, count)
        if FULL and scene.flags[rows.HAS_BRACES] != 0.0:
            _add_brace_forces(scene, h, memory, count)
        for k in range(count):
            _store_accelerations(scene, h, load, scratch, k)


@outlined
def _add_extrema_to_corners(scratch, count, n):
    """Add the times of extrema between the nodes that exceed a peak and the nodes to the list of
    corners; return True if it has more corners.
    """
    corner_count = scratch[ROW.CORNERS, 0]
    corners = Integrals(scratch, ROW.CORNERS)
    for i in range(n):
        for quantity in range(2):
            first = ROW.NODE_ACCELERATION if quantity == 0 else ROW.NODE_FORCE
            row = rows.PEAK_ACCELERATION if quantity == 0 else rows.PEAK_TOTAL_SHEAR
            peak = scratch[ROW.PEAKS + row, i]
            for k in range(0, count - 2, 2):
                p0, p1 = scratch[first + k, i], scratch[first + k + 1, i]
                p2 = scratch[first + k + 2, i]
                # With x = 0, 1, 2 at the nodes, the extremum at x = -linear / (2 quadratic) is
                # inside if its distance from x = 1 is less than 1.
                linear = 0.5 * (4.0 * p1 - 3.0 * p0 - p2)
                quadratic = 0.5 * (p0 - 2.0 * p1 + p2)
                if abs(linear + 2.0 * quadratic) < 2.0 * abs(quadratic):
                    extremum = abs(p0 - 0.25 * linear * linear / quadratic)
                    if extremum > max(peak, abs(p0), abs(p1), abs(p2)):
                        t = scratch[ROW.NODE_FORCE + k, n]
                        length = scratch[ROW.NODE_FORCE + k + 2, n] - t
                        _store_corner(corners, t - 0.25 * length * linear / quadratic)
    return scratch[ROW.CORNERS, 0] > corner_count
