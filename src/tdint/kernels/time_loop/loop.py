"""Time loop: one compiled loop for all methods, which receives the compiled step as an argument."""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.compiling import F8, FULL, I8, VECTOR, inline, kernel, outlined
from tdint.kernels.located_peaks import UPDATE_LOCATED_PEAKS
from tdint.kernels.stepping import (
    MEMORY,
    SCENE,
    SEEN,
    STEP,
    Span,
    take_step,
)
from tdint.kernels.stories.law_state import store_step_start
from tdint.kernels.time_loop.force_tables import initialize_lines, raise_peaks_in_parts, start_step
from tdint.kernels.time_loop.ground import fitted_line, fitted_line_between_samples, ground_at
from tdint.kernels.time_loop.observer import (
    INITIALIZE_LAWS,
    SUM_LAW_ENERGIES,
    call_initialize_laws,
    exceeds_limits,
    initialize_energies,
    observe,
    observe_within_step,
    record_collapse,
    shift_ground,
    store,
    store_previous,
    update_law_energies,
)

# The first arguments change from call to call; the other arguments are constant in the runs of a
# building (`tdint.kernels.building.compilable.bind`).
INTEGRATE = I8(
    I8,  # number of steps of the run
    I8,  # number of completed steps
    I8,  # number of steps where the call ends
    I8,  # number of steps that have the length of the next argument
    I8,  # number of sampling intervals; 1 if a step is not longer than a sampling interval
    STEP,  # step of the method
    INITIALIZE_LAWS,  # kernel that initializes the drift laws
    SUM_LAW_ENERGIES,  # kernel that sums their energies
    UPDATE_LOCATED_PEAKS,  # kernel that computes the response at located instants
    I8,  # steps per row of the history
    I8,  # rows of the complete history before the first row of the array
    I8,  # maximum number of halvings of a step
    F8,  # length of a step, s
    VECTOR,  # ground acceleration, m/s^2
    VECTOR,  # points of the tables of forces
    VECTOR,  # coefficients of the method
    # Change of each row of the state per unit increase of the floor accelerations at a jump of the
    # ground acceleration
    VECTOR,
    *SCENE,
    *MEMORY,
    VECTOR,  # load, LOAD_SIZE elements of scratch
    *SEEN,
)

OVERFLOW = 1e300
"""Dimensionless. Minimum relative residual for which a step that did not converge is treated as
divergence."""

RUNAWAY = 1e6
"""Displacement above which the time integration ends as if the response were not finite, m. No
building reaches such displacements."""


@inline
def start(initialize_laws, sum_law_energies, scene, ground, memory, seen):
    """Prepare the arrays of a run for the first step, from the displacements and velocities in the
    state.

    The collapse limits are checked, because the initial drifts can exceed them.
    """
    n = scene.linear_terms.shape[1] - 1
    state = memory.state
    call_initialize_laws(initialize_laws, scene, memory)
    # `observe` stores the accelerations from equilibrium and records the initial values as the
    # first peaks. The flags of the span concern only the interior of a step.
    observe(scene, Span(0.0, 0.0, ground, ground, False, False, False, False), 0.0, memory, seen)
    store_previous(state, seen.observer_state, n)
    store_step_start(scene.flags, memory.law_state)
    for i in range(n):
        state[rows.ACCELERATION, i] = seen.observer_state[rows.OBSERVED_ACCELERATION, i]
    memory.step_status[rows.STATE_GROUND] = ground
    update_law_energies(sum_law_energies, scene, memory, seen)
    initialize_energies(scene.linear_terms, memory.law_state, seen.totals)
    check_limits(sum_law_energies, scene, memory, 0, seen)


@inline
def has_diverged(state, n):
    """Return True if the absolute displacement of a floor is at least RUNAWAY (m), or nan."""
    # A comparison with nan is False. The loop has no branches, so that it is fast.
    is_bounded = True
    for i in range(n):
        is_bounded &= abs(state[rows.DISPLACEMENT, i]) < RUNAWAY
    return not is_bounded


@inline
def observe_span(update_located_peaks, scene, points, span, slope, memory, seen):
    """Update peaks and energies with the response at the end of a step or substep and within it.

    `slope` is the rate of the ground acceleration, m/s^3.
    """
    may_exceed = observe(scene, span, slope, memory, seen)
    if FULL and span.kinked and (may_exceed or span.cornered):
        raise_peaks_in_parts(scene, points, span, memory, seen)
    observe_within_step(update_located_peaks, may_exceed, scene, span, memory, seen)
    store_step_start(scene.flags, memory.law_state)


@inline
def check_limits(sum_law_energies, scene, memory, steps, seen):
    """Record the collapse if a story exceeds its limit for the first time in the run.

    A story exceeds its limit if its peak drift exceeds a multiple of the story height, or if its
    law has failed.
    """
    if seen.totals[rows.COLLAPSE_STEP] == rows.NO_COLLAPSE and exceeds_limits(
        memory.law_state, seen
    ):
        _record_collapse(sum_law_energies, scene, memory, steps, seen)


@outlined
def _record_collapse(sum_law_energies, scene, memory, steps, seen):
    """Update the energies and record the collapse: story, step and energies.

    Compiled separately, because it is called at most once per run.
    """
    update_law_energies(sum_law_energies, scene, memory, seen)
    record_collapse(memory.law_state, steps, seen)


@inline
def _fit_ground(ground, position, step_ratio, load):
    """Store the ground acceleration of a step or substep that is longer than a sampling interval:
    the straight line with the same impulse and first moment.

    `position` contains the index of the step, and the completed part of the step and the length of
    the substep as fractions of the step. `step_ratio` is (per_sample, stride) as in `integrate`.
    `fitted_line_between_samples` is faster than `fitted_line`.
    """
    step_index, completed_fraction, substep_fraction = position
    per_sample, stride = step_ratio
    samples = stride / per_sample  # sampling intervals in a step
    substep_start = (step_index + completed_fraction) * samples
    substep_end = (step_index + completed_fraction + substep_fraction) * samples
    if per_sample == 1 and substep_fraction == 1.0:
        load[rows.GROUND_0], load[rows.GROUND_1] = fitted_line_between_samples(
            ground, step_index * stride, (step_index + 1) * stride
        )
    else:
        load[rows.GROUND_0], load[rows.GROUND_1] = fitted_line(ground, substep_start, substep_end)


@kernel(INTEGRATE)
def integrate(
    steps,
    first_step,
    last_step,
    per_sample,
    stride,
    step,
    initialize_laws,
    sum_law_energies,
    update_located_peaks,
    steps_per_row,
    rows_before,
    max_halvings,
    h,
    ground,
    points,
    coefficients,
    shifts,
    scene,
    memory,
    load,
    seen,
):
    """Integrate the equations of motion over the steps `first_step` to `last_step` - 1 of a run.

    A run starts with `first_step` 0. A further call continues from the memory of the previous call,
    so that the caller can interrupt a run between calls.

    If a step is longer than a sampling interval, the ground acceleration within the step is
    replaced by the straight line with the same impulse and first moment. The lines of successive
    steps have different values at the common endpoint. At this jump of the ground acceleration, the
    relative accelerations of all floors jump by the same value with the opposite sign.

    If a step or substep does not converge, it is repeated with half the length, up to
    `max_halvings` times in a step. The following substeps of the step keep this length.
    `step_status[STEPS_DONE]` is the number of steps since the start or since the last halved step;
    with 0, multi-step methods restart, because they need the results of complete steps.
    `totals[STEPS_REACHED]` counts the complete steps.

    Parameters
    ----------
    steps : int
        Number of steps of the run. If `last_step` is equal to `steps`, the energies of the laws are
        updated at the end of the call.
    first_step : int
        Number of steps that previous calls have completed.
    last_step : int
        Number of steps that are complete after this call.
    per_sample, stride : int
        `per_sample` steps have the length of `stride` sampling intervals.
    rows_before : int
        Row of the complete history that is stored in row 0 of the array `history`. The array can
        contain only a part of the history.
    points : ndarray
        Points of the tables of forces: times (s) and values; empty without tables. The rows of
        `forces` that are tables contain the lines of the current step, which this function changes.
    shifts : ndarray
        Change of each row of the state per unit increase of the floor accelerations, at a jump of
        the ground acceleration between two steps.

    Returns
    -------
    int
        0, or the negative error code of the step that failed. NOT_FINITE: the response is not
        finite or exceeds RUNAWAY, a story has no resistance left (COLLAPSE_FAILED), or the
        iteration has diverged (relative residual nan or at least OVERFLOW). NOT_CONVERGED: the
        iteration has not converged after `max_halvings` halvings.
    """
    linear_terms, _, _, forces, flags = scene
    state, _, _, step_status = memory
    _, _, _, totals, history = seen
    on_path = flags[rows.PARABOLIC] != 0.0
    has_unresolved_modes = flags[rows.UNRESOLVED_MODES] != 0.0
    # `ground_0` and `ground_1` are the ground acceleration of the motion, rows GROUND_0 and
    # GROUND_1 of `load` the values in the equations of motion. They differ if a line is fitted
    # (`stride` > 1).
    ground_0 = ground_at(ground, first_step, per_sample, stride)
    if first_step == 0:
        if FULL:
            initialize_lines(forces, points)
        start(initialize_laws, sum_law_energies, scene, ground_0, memory, seen)
        if history.shape[0] > 0:
            store(ground_0, ground_0, memory, seen, 0)
    min_fraction = 0.5**max_halvings  # shortest substep, as a fraction of the step
    for step_index in range(first_step, last_step):
        ground_1 = ground_at(ground, step_index + 1, per_sample, stride)
        ground_rate = (ground_1 - ground_0) / h
        completed_fraction = 0.0  # as a fraction of the step
        substep_fraction = 1.0  # length of the next substep, as a fraction of the step
        while completed_fraction < 1.0:
            # At the start of a line, the ground acceleration jumps from its value at the end of the
            # previous line (STATE_GROUND) to GROUND_0. `shift_ground` subtracts this jump from the
            # relative accelerations of the floors, and sets STATE_GROUND to the new value. If the
            # substep fails and is halved, another line is fitted; its jump then starts from this
            # value.
            load[rows.TIME] = (step_index + completed_fraction) * h
            if stride > 1:
                position = step_index, completed_fraction, substep_fraction
                _fit_ground(ground, position, (per_sample, stride), load)
                ground_rate = (load[rows.GROUND_1] - load[rows.GROUND_0]) / (substep_fraction * h)
                shift_ground(scene, load, shifts, memory, seen)
            else:
                load[rows.GROUND_0] = ground_0 + completed_fraction * (ground_1 - ground_0)
                load[rows.GROUND_1] = (
                    ground_1
                    if completed_fraction + substep_fraction == 1.0
                    else ground_0 + (completed_fraction + substep_fraction) * (ground_1 - ground_0)
                )
            # The lines of the tables of forces change the accelerations at the start.
            is_kinked = (
                FULL
                and points.shape[0] > 0
                and start_step(scene, points, substep_fraction * h, load, shifts, memory, seen)
            )
            code = take_step(step, coefficients, scene, substep_fraction * h, load, memory)
            if code < 0:
                if code == rows.NOT_FINITE or substep_fraction <= min_fraction:
                    check_limits(sum_law_energies, scene, memory, step_index, seen)
                    # A residual of at least OVERFLOW, or nan, means that the iteration has
                    # diverged.
                    return code if step_status[rows.RESIDUAL] < OVERFLOW else rows.NOT_FINITE
                substep_fraction *= 0.5
                totals[rows.HALVINGS] += 1.0
                step_status[rows.STEPS_DONE] = 0.0  # multi-step methods restart
                continue
            # The accelerations of the state are now valid for GROUND_1.
            completed_fraction += substep_fraction
            totals[rows.ITERATIONS] += code
            step_status[rows.STATE_GROUND] = load[rows.GROUND_1]
            t = (step_index + completed_fraction) * h
            has_step_peaks = step_status[rows.STEP_PEAKS] != 0.0
            span = Span(
                t,
                substep_fraction * h,
                load[rows.GROUND_0],
                load[rows.GROUND_1],
                on_path,
                has_unresolved_modes,
                has_step_peaks,
                is_kinked,
            )
            observe_span(update_located_peaks, scene, points, span, ground_rate, memory, seen)
        # `substep_fraction` is 1 only if the step was not halved.
        step_status[rows.STEPS_DONE] = (
            step_status[rows.STEPS_DONE] + 1.0 if substep_fraction == 1.0 else 0.0
        )
        totals[rows.STEPS_REACHED] += 1.0
        if has_diverged(state, linear_terms.shape[1] - 1):
            return rows.NOT_FINITE
        check_limits(sum_law_energies, scene, memory, step_index + 1, seen)
        # A story on a falling line continues with a negative resistance. The run ends with this
        # step like a run that fails after a collapse.
        if totals[rows.COLLAPSE_FAILED] == rows.NO_RESISTANCE and step_index + 1 < steps:
            return rows.NOT_FINITE
        if history.shape[0] > 0 and (step_index + 1) % steps_per_row == 0:
            update_law_energies(sum_law_energies, scene, memory, seen)
            # The relative accelerations are in equilibrium with the fitted line, so that the
            # absolute accelerations require its value (second argument).
            row = (step_index + 1) // steps_per_row - rows_before
            store(ground_1, load[rows.GROUND_1], memory, seen, row)
        ground_0 = ground_1
    if last_step == steps:
        update_law_energies(sum_law_energies, scene, memory, seen)
    return 0
