"""Peaks at located instants within a step, where the response satisfies the equations of motion.

`tdint.kernels.peaks_between_steps` locates the extrema of accelerations and total shears on the
interpolant of the step. Their values follow from the forces of the laws and dampers at the
interpolated displacements and velocities, so that no peak exceeds what these forces allow.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import F8, FULL, I8, indirect_caller, inline, kernel, outlined
from tdint.kernels.linear_terms import (
    above,
    base_of,
    distribute,
    force_value,
    has_inerters,
    internal_forces,
    is_tree,
)
from tdint.kernels.peaks_between_steps import (
    ends_of_story,
    floor_ends,
    instant_before,
    observed_passage,
    raise_peak,
    story_ends,
    zero_of_rate,
)
from tdint.kernels.step_interpolant import quintic_motion
from tdint.kernels.stepping import MEMORY, SCENE, SEEN, Located, Span
from tdint.kernels.stories.brace import brace_force_at
from tdint.kernels.stories.impact import damping_slope
from tdint.kernels.stories.law_state import (
    columns_of_story,
    drift_of_fracture,
    raise_element_peaks,
    restoring_force,
    restoring_force_outlined,
)


@outlined
def raise_located_peaks(scene, span, passage, law_state, previous, located):
    """Raise the peaks by the forces at reversals and by the response at located instants.

    `previous` is the first row of the states that the laws move from (`step_start`). FIRST_TRIAL
    and SECOND_TRIAL of the states are overwritten.
    """
    table, first, _, _ = located
    n = scene.linear_terms.shape[1] - 1
    for i in range(n):
        reversal = table[first + rows.REVERSAL_DRIFT, i]
        if reversal != law_state[rows.DRIFT, i]:
            _raise_force_at_reversal(scene, law_state, i, previous, reversal, located)
    last = 0.0
    for row in (rows.ACCELERATION_INSTANT, rows.TOTAL_SHEAR_INSTANT):
        for i in range(n):
            s = table[first + row, i]
            # Several floors often have the same instant.
            if s > 0.0 and s != last:
                raise_peaks_at(scene, span, passage, law_state, previous, s, located)
                last = s
    if FULL and scene.flags[rows.CAN_FRACTURE] > 0.0:
        for i in range(n):
            _raise_peaks_before_fracture(scene, span, passage, law_state, i, located)


@outlined
def _raise_peaks_before_fracture(scene, span, passage, law_state, i, located):
    """Raise the peaks by the response at the drifts where laws of story `i` have fractured in the
    step: its forces, and the accelerations they cause, are often largest just before.
    """
    law_parameters = scene.law_parameters
    story = ends_of_story(span.fast, scene.linear_terms, passage, law_state, i)
    for column in columns_of_story(law_parameters, i):
        limit = drift_of_fracture(law_parameters, law_state, column)
        if limit != 0.0:
            _raise_force_at_reversal(scene, law_state, i, rows.STEP_START, limit, located)
            s = instant_before(span.h, story, limit)
            raise_peaks_at(scene, span, passage, law_state, rows.STEP_START, s, located)


@outlined
def _raise_force_at_reversal(scene, law_state, i, previous, drift, located):
    """Raise the peak forces of story `i` and its elements by their forces at a reversal."""
    law_parameters = scene.law_parameters
    restoring_force_outlined(law_parameters, law_state, i, previous, rows.FIRST_TRIAL, drift)
    force = law_state[rows.FIRST_TRIAL + rows.FORCE, i]
    raise_peak(located.peaks, located.first_peak + rows.PEAK_SHEAR, i, force)
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        raise_element_peaks(law_parameters, law_state, i, rows.FIRST_TRIAL, 0.0)


@outlined
def raise_peaks_at(scene, span, passage, law_state, previous, s, located):
    """Raise the peaks of accelerations and total shears by the response at the fraction `s` of the
    step."""
    table, first, peaks, first_peak = located
    linear_terms, _, _, forces, _ = scene
    _store_internal_forces(scene, span, passage, law_state, previous, s, located)
    if FULL and has_inerters(linear_terms):
        _balance_internal_forces(scene, span, s, located)
    total_shear = 0.0
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = linear_terms.shape[1] - 1
    while i > 0:
        i -= 1
        force = table[first + rows.LOCATED_INTERNAL, i]
        if FULL and is_tree(linear_terms):
            # The columns of links, which are the last, have no inertia.
            table[first + rows.LOCATED_SUM, i] = 0.0
            total_shear = above(linear_terms, table, first + rows.LOCATED_SUM, i) + force
            table[first + rows.LOCATED_SUM, i] = total_shear
        else:
            total_shear = linear_terms[rows.LINK, i + 1] * total_shear + force
        raise_peak(peaks, first_peak + rows.PEAK_TOTAL_SHEAR, i, total_shear)
        for j in range(forces.shape[0]):
            if forces[j, rows.FLOOR] == i:
                force -= force_value(forces, j, span.t - (1.0 - s) * span.h)
        acceleration = linear_terms[rows.INVERSE_MASS, i] * force
        if FULL and has_inerters(linear_terms):
            acceleration = table[first + rows.LOCATED_VELOCITY, i]
        raise_peak(peaks, first_peak + rows.PEAK_ACCELERATION, i, acceleration)


@outlined
def _balance_internal_forces(scene, span, s, located):
    """Replace the velocities by the absolute accelerations, and the internal force of each floor by
    its load minus mass times absolute acceleration, in a building with inerters."""
    table, first, _, _ = located
    linear_terms, _, _, forces, _ = scene
    internal, accelerations = first + rows.LOCATED_INTERNAL, first + rows.LOCATED_VELOCITY
    n = linear_terms.shape[1] - 1
    ground = s * span.ground_1 + (1.0 - s) * span.ground_0
    for i in range(n):
        table[accelerations, i] = -table[internal, i] - linear_terms[rows.MASS, i] * ground
        table[internal, i] = 0.0
    for j in range(forces.shape[0]):
        force = force_value(forces, j, span.t - (1.0 - s) * span.h)
        table[internal, int(forces[j, rows.FLOOR])] += force
        table[accelerations, int(forces[j, rows.FLOOR])] += force
    distribute(linear_terms, table, accelerations)
    for i in range(n):
        table[accelerations, i] += ground
        table[internal, i] -= linear_terms[rows.MASS, i] * table[accelerations, i]


@inline
def _store_internal_forces(scene, span, passage, law_state, previous, s, located):
    """Store displacements, velocities and the internal forces of all floors at the fraction `s` of
    the step in the rows of `located`."""
    table, first, _, _ = located
    linear_terms, modal, law_parameters, _, flags = scene
    n = linear_terms.shape[1] - 1
    has_damper_state = flags[rows.HAS_DAMPER_STATE] != 0.0
    below, u_below, v_below = floor_ends(span.fast, passage, 0), 0.0, 0.0
    for i in range(n):
        floor = floor_ends(span.fast, passage, i)
        u, v = quintic_motion(span.h, floor, s)
        table[first + rows.LOCATED_DISPLACEMENT, i] = u
        table[first + rows.LOCATED_VELOCITY, i] = v
        link = linear_terms[rows.LINK, i]
        if FULL and is_tree(linear_terms):
            base = base_of(linear_terms, i)
            below = floor_ends(span.fast, passage, base)
            u_below = table[first + rows.LOCATED_DISPLACEMENT, base]
            v_below = table[first + rows.LOCATED_VELOCITY, base]
        drift, end, tangent = u - link * u_below, law_state[rows.DRIFT, i], law_state[rows.SLOPE, i]
        if previous == rows.COMMITTED and tangent < math.inf:
            # The law has followed a single linear branch. The interpolant can be beyond the limit
            # of this branch at the located instant; the force is then the force at the limit.
            limited = min(max(drift, law_state[rows.LOWER, i]), law_state[rows.UPPER, i])
            law_state[rows.SECOND_TRIAL + rows.DRIFT, i] = drift
            force = law_state[rows.FORCE, i] + tangent * (limited - end)
            law_state[rows.SECOND_TRIAL + rows.FORCE, i] = force
        else:
            block = previous
            if (floor.v0 - link * below.v0) * (floor.v1 - link * below.v1) < 0.0:
                story = story_ends(floor, below, link, end)
                block = _move_to_reversal(span.h, law_parameters, law_state, i, previous, story, s)
            tangent = restoring_force(law_parameters, law_state, i, block, rows.SECOND_TRIAL, drift)
        if FULL and has_damper_state:
            force = 0.0
            if linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
                slope = damping_slope(law_parameters, law_state, i, rows.SECOND_TRIAL, tangent)
                force = linear_terms[rows.TANGENT_DAMPING, i] * slope * (v - link * v_below)
            if linear_terms[rows.BRACE, i] != 0.0:
                story = story_ends(floor, below, link, end)
                motion = (drift - story.u0, story.v0, v - link * v_below)
                row = first + rows.LOCATED_BRACE
                force_0 = passage.state[rows.BRACE_START, i]
                force += brace_force_at(linear_terms, i, s * span.h, motion, force_0, table, row)
            table[first + rows.LOCATED_DEVICE, i] = force
        below, u_below, v_below = floor, u, v
    velocity, trial = first + rows.LOCATED_VELOCITY, rows.SECOND_TRIAL
    internal, sums = first + rows.LOCATED_INTERNAL, first + rows.LOCATED_SUM
    internal_forces(linear_terms, modal, law_state, trial, table, velocity, internal, sums)
    if FULL and has_damper_state:
        for i in range(n):
            force = table[first + rows.LOCATED_DEVICE, i]
            force -= above(linear_terms, table, first + rows.LOCATED_DEVICE, i)
            table[first + rows.LOCATED_INTERNAL, i] += force


@outlined
def _move_to_reversal(h, law_parameters, law_state, i, previous, story, s):
    """Move the law of story `i`, which reverses in the step, to the drift of the reversal in block
    FIRST_TRIAL, if the fraction `s` of the step is after the reversal.

    Return the first row of the block from which the law continues to `s`.
    """
    rest = zero_of_rate(h, story)
    if rest >= s:
        return previous
    reversal = quintic_motion(h, story, rest)[0]
    restoring_force_outlined(law_parameters, law_state, i, previous, rows.FIRST_TRIAL, reversal)
    return rows.FIRST_TRIAL


# ---- Instants of the observer of the response. The kernel is compiled separately, because the time
# loop does not contain the laws.

UPDATE_LOCATED_PEAKS = I8(*SCENE, *MEMORY, *SEEN, F8, F8, I8, I8)

call_update_located_peaks = indirect_caller(UPDATE_LOCATED_PEAKS)
"""Call `update_located_peaks` by its address, the first argument."""


@kernel(UPDATE_LOCATED_PEAKS)
def update_located_peaks(scene, memory, seen, t, h, fast, previous):
    """Update the peaks at the reversals and instants in rows LOCATED of the memory of the observer;
    return 0.

    The step ends at `t` and has the length `h`, `fast` is 1 or 0 (`Span`), `previous` as in
    `raise_located_peaks`.
    """
    ground_0 = ground_1 = 0.0
    if FULL and has_inerters(scene.linear_terms):
        n = scene.linear_terms.shape[1] - 1
        ground_0 = seen.observer_state[rows.LOCATED + rows.LOCATED_DEVICE, n]
        ground_1 = memory.step_status[rows.STATE_GROUND]
    span = Span(t, h, ground_0, ground_1, False, fast != 0, False, False)
    passage = observed_passage(memory.state, seen.observer_state)
    located = Located(seen.observer_state, rows.LOCATED, seen.peaks, 0)
    raise_located_peaks(scene, span, passage, memory.law_state, previous, located)
    return 0
